//! Which triangle is the nearest in the middles of pixels: for the outlines of visible regions.

use std::ops::Range;

use wide::bytemuck::cast;
use wide::{f32x4, i32x4};

use super::plane::Ready;
use super::{Corner, EQUAL, Place, STEPS};
use crate::mapping::Cut;

/// Pixels that are worked on at a time.
const LANES: usize = 4;
/// Pixels of a row that are passed at once where a triangle is behind all of them.
const BLOCK: usize = 64;
/// The largest side of a small triangle, in steps.
const SMALL: i64 = 24 * STEPS;
/// The odd ones of four pixels, and the last two.
const ONES: i32x4 = i32x4::new([0, -1, 0, -1]);
const TWOS: i32x4 = i32x4::new([0, 0, -1, -1]);
/// Half a pixel.
const HALF: i64 = STEPS / 2;

/// The nearest triangles at the samples of some pixels, one after another: the number of each plus 1, or 0, and its depth.
pub(crate) struct Nearest<const N: usize> {
    pub(crate) numbers: Vec<[u32; N]>,
    pub(crate) depths: Vec<[f32; N]>,
}

/// The nearest triangles in the middles of all pixels of a raster, row by row: the number of each plus 1, or 0, and its depth.
pub(crate) struct Middles {
    pub(crate) numbers: Vec<u32>,
    pub(crate) depths: Vec<f32>,
}

/// A number of triangles, the corners of each, and what is cut out of it.
pub(crate) struct Given<C, D> {
    pub(crate) count: usize,
    pub(crate) corners: C,
    pub(crate) cut: D,
}

/// Finds the nearest triangle in the middle of each pixel, in rasters that are empty before, and of each row the first column and the one after the last in which
/// there are any. Of two at the same depth it is the later.
pub(crate) fn in_middles<'c>(
    [width, height]: [usize; 2],
    triangles: &Given<impl Fn(usize) -> [Place; 3], impl Fn(usize) -> Option<Cut<'c>>>,
    mut nearest: Middles,
) -> (Middles, Vec<[u32; 2]>) {
    let mut spans = vec![[u32::MAX, 0]; height];
    let mut hidden = Hidden::of(width);
    for number in 0..triangles.count {
        let corners = (triangles.corners)(number);
        // Most are so small that they lie between the middles.
        let columns = middles(corners.map(|p| p.x), width);
        let rows = middles(corners.map(|p| p.y), height);
        if columns.is_empty() || rows.is_empty() {
            continue;
        }
        let Some(ready) = Ready::new(corners, width, &(0..height)) else { continue };
        let cut = (triangles.cut)(number);
        if cut.is_none() && is_small(&corners) && columns.len().next_multiple_of(LANES) <= width {
            nearest.add_small(number as u32 + 1, &ready, [columns, rows], (width, &mut spans));
            continue;
        }
        let both = [columns, rows];
        nearest.add_middles(number as u32 + 1, &ready, both, (&mut spans, &mut hidden), cut.as_ref());
    }
    spans.iter_mut().filter(|[first, _]| *first == u32::MAX).for_each(|span| *span = [0; 2]);
    (nearest, spans)
}

/// The pixels whose middles lie between the coordinates of corners, of so many.
fn middles(at: [i32; 3], count: usize) -> Range<usize> {
    let low = (i64::from(at[0].min(at[1]).min(at[2])) + HALF - 1).div_euclid(STEPS);
    let high = (i64::from(at[0].max(at[1]).max(at[2])) + HALF).div_euclid(STEPS);
    low.max(0) as usize..high.clamp(0, count as i64) as usize
}

/// Whether a triangle is so small that the functions of its sides are within 32 bits, and that it takes longer to find its sides row by row than to look at
/// all pixels around it.
fn is_small(corners: &[Place; 3]) -> bool {
    let within = |at: [i32; 3]| {
        let [low, high] = [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])];
        i64::from(high) - i64::from(low) <= SMALL
    };
    within(corners.map(|corner| corner.x)) && within(corners.map(|corner| corner.y))
}

impl Middles {
    /// Adds a small triangle, four pixels at a time.
    #[inline(always)]
    fn add_small(
        &mut self,
        number: u32,
        ready: &Ready,
        [columns, rows]: [Range<usize>; 2],
        (width, spans): (usize, &mut [[u32; 2]]),
    ) {
        let plane = ready.plane;
        let count = columns.len().next_multiple_of(LANES);
        // Beside the triangle, nothing changes.
        let first = columns.start.min(width - count);
        let ahead = [(first, ready.columns[0]), (rows.start, ready.rows[0])]
            .map(|(to, from)| STEPS * (to as i64 - from as i64) + HALF);
        let each = |[value, a, b]: [i64; 3]| {
            let value = (value + a * ahead[0] + b * ahead[1]) as i32;
            let right = (a * STEPS) as i32;
            // Numbers that are stored one by one and loaded together would be waited for.
            i32x4::splat(value) + (i32x4::splat(right) & ONES) + (i32x4::splat(2 * right) & TWOS)
        };
        let mut start = ready.sides.map(each);
        let further = ready.sides.map(|[_, a, _]| i32x4::splat((a * STEPS) as i32 * LANES as i32));
        let down = ready.sides.map(|[_, _, b]| i32x4::splat((b * STEPS) as i32));
        let number = i32x4::splat(number as i32);
        for row in rows {
            let mut here = start;
            (0..3).for_each(|side| start[side] += down[side]);
            let (depth, slope) = plane.along([first, row]);
            let along = f32x4::splat(slope) * f32x4::new([0.0, 1.0, 2.0, 3.0]);
            let cells = row * width + first..row * width + first + count;
            let held = self.numbers[cells.clone()].as_chunks_mut::<LANES>().0;
            let behind = self.depths[cells].as_chunks_mut::<LANES>().0;
            let mut depth = f32x4::splat(depth);
            for (held, behind) in held.iter_mut().zip(behind) {
                let [p, q, r] = here;
                (0..3).for_each(|side| here[side] += further[side]);
                let outside = p | q | r;
                let (here, far) = (plane.bounded_four(depth + along), f32x4::new(*behind));
                depth += f32x4::splat(slope * LANES as f32);
                // Later ones have greater numbers.
                let is_nearer = cast::<f32x4, i32x4>((here + f32x4::splat(EQUAL)).simd_ge(far));
                let is_seen: i32x4 = is_nearer & !(outside >> 31_i32);
                if is_seen.to_bitmask() == 0 {
                    continue;
                }
                *held = cast(is_seen.select(number, cast(*held)));
                let nearest = cast::<i32x4, f32x4>(is_seen).select(here.fast_max(far), far);
                *behind = cast(nearest);
            }
            let [from, end] = &mut spans[row];
            (*from, *end) = ((*from).min(columns.start as u32), (*end).max(columns.end as u32));
        }
    }

    /// Adds a triangle, row by row. Where many large ones lie one over another, most of them are hidden, block by block.
    fn add_middles(
        &mut self,
        number: u32,
        ready: &Ready,
        [columns, rows]: [Range<usize>; 2],
        (spans, hidden): (&mut [[u32; 2]], &mut Hidden),
        cut: Option<&Cut<'_>>,
    ) {
        let (plane, width) = (ready.plane, hidden.width);
        let ahead = [(columns.start, ready.columns[0]), (rows.start, ready.rows[0])]
            .map(|(to, from)| STEPS * (to as i64 - from as i64) + HALF);
        let mut start = ready.sides.map(|[value, a, b]| value + a * ahead[0] + b * ahead[1]);
        let step = ready.sides.map(|side| side[1] * STEPS);
        for row in rows {
            let within = not_negative(start, step, columns.len());
            (0..3).for_each(|k| start[k] += ready.sides[k][2] * STEPS);
            if within.is_empty() {
                continue;
            }
            let (first, end) = (columns.start + within.start, columns.start + within.end);
            let span = &mut spans[row];
            *span = [span[0].min(first as u32), span[1].max(end as u32)];
            let (left, right) = plane.along([first, row]);
            let depth = |column: usize| plane.bounded(left + right * (column - first) as f32);
            let mut from = first;
            while from < end {
                let block = from / BLOCK;
                let to = end.min((block + 1) * BLOCK);
                // The depth grows or falls along a row.
                let greatest = depth(from).max(depth(to - 1));
                if greatest + EQUAL >= hidden.least(block, row) {
                    let cells = row * width + from..row * width + to;
                    let held = self.numbers[cells.clone()].iter_mut();
                    for (column, (held, behind)) in (from..to).zip(held.zip(&mut self.depths[cells])) {
                        let depth = depth(column);
                        // Later ones have greater numbers.
                        if depth + EQUAL >= *behind
                            && cut.is_none_or(|cut| cut.is_drawn([column as f64 + 0.5, row as f64 + 0.5]))
                        {
                            *behind = if depth > *behind { depth } else { *behind };
                            *held = number;
                        }
                    }
                    if to - from == hidden.size(block) {
                        hidden.look(block, row, &self.depths);
                    }
                }
                from = to;
            }
        }
    }
}

/// The part of so many places in a row at which none of three linear functions is negative, given their values at the first place and their steps.
fn not_negative(values: [i64; 3], steps: [i64; 3], count: usize) -> Range<usize> {
    let (mut first, mut end) = (0, count as i64);
    for (value, step) in values.into_iter().zip(steps) {
        match step {
            0 if value < 0 => return 0..0,
            0 => {}
            1.. => first = first.max((-value).div_euclid(step) + i64::from((-value).rem_euclid(step) > 0)),
            _ => end = end.min(value.div_euclid(-step) + 1),
        }
    }
    first as usize..end.max(first) as usize
}

/// What is hidden in a raster: a lower bound of the depths of each block of pixels of a row.
struct Hidden {
    width: usize,
    /// Empty before the first is known.
    least: Vec<f32>,
}

impl Hidden {
    /// A raster of which nothing is known.
    fn of(width: usize) -> Hidden {
        Hidden { width, least: Vec::new() }
    }

    fn index(&self, block: usize, row: usize) -> usize {
        row * self.width.div_ceil(BLOCK) + block
    }

    fn least(&self, block: usize, row: usize) -> f32 {
        self.least.get(self.index(block, row)).copied().unwrap_or(f32::NEG_INFINITY)
    }

    /// Pixels of a block.
    fn size(&self, block: usize) -> usize {
        BLOCK.min(self.width - block * BLOCK)
    }

    /// Takes note of the depths of a block. They only grow.
    fn look(&mut self, block: usize, row: usize, depths: &[f32]) {
        let from = row * self.width + block * BLOCK;
        let depths = depths[from..from + self.size(block)].iter();
        let index = self.index(block, row);
        if index >= self.least.len() {
            let blocks = self.index(0, row + 1);
            self.least.resize(blocks, f32::NEG_INFINITY);
        }
        self.least[index] =
            depths.fold(f32::INFINITY, |least, depth| if *depth < least { *depth } else { least });
    }
}

/// The weights of a triangle's corners in the middle of a pixel, or near it if that is outside.
pub(crate) fn weights([p, q, r]: [Corner; 3], [column, row]: [usize; 2]) -> [f64; 3] {
    let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
    let wide = |a: &Corner, b: &Corner| (a.x - x) * (b.y - y) - (a.y - y) * (b.x - x);
    let raw = [wide(&q, &r), wide(&r, &p), wide(&p, &q)];
    let area: f64 = raw.iter().sum();
    let inner = raw.map(|w| (w / area).max(0.0));
    let sum: f64 = inner.iter().sum();
    if sum.is_finite() && sum > 0.0 { inner.map(|w| w / sum) } else { [1.0 / 3.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_triangles_are_where_large_ones_would_be() {
        let (width, height) = (40, 30);
        let mut state = 7_u64;
        let mut random = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * most
        };
        let empty =
            || Middles { numbers: vec![0; width * height], depths: vec![f32::NEG_INFINITY; width * height] };
        for round in 0..100 {
            let triangles: Vec<[Place; 3]> = (0..60)
                .map(|_| {
                    let (x, y) = (random(44.0) - 4.0, random(34.0) - 4.0);
                    [(); 3].map(|()| {
                        Corner { x: x + random(9.0), y: y + random(9.0), depth: random(1.0) }.place()
                    })
                })
                .collect();
            let given = Given { count: triangles.len(), corners: |n: usize| triangles[n], cut: |_| None };
            let (found, spans) = in_middles([width, height], &given, empty());
            let mut plain = empty();
            let mut rows = vec![[u32::MAX, 0]; height];
            for (number, &corners) in (1..).zip(&triangles) {
                assert!(is_small(&corners));
                let Some(ready) = Ready::new(corners, width, &(0..height)) else { continue };
                let both = [middles(corners.map(|p| p.x), width), middles(corners.map(|p| p.y), height)];
                plain.add_middles(number, &ready, both, (&mut rows, &mut Hidden::of(width)), None);
            }
            // At depths that are equal but for rounding, the two may differ.
            let differing = found.numbers.iter().zip(&plain.numbers).filter(|(a, b)| a != b).count();
            assert!(differing <= 1, "round {round}: {differing} pixels differ");
            for (row, [first, end]) in spans.iter().enumerate() {
                let line = &found.numbers[row * width..][..width];
                let is_within = |column: usize| (*first as usize..*end as usize).contains(&column);
                assert!((0..width).all(|column| line[column] == 0 || is_within(column)), "round {round}");
            }
        }
    }

    /// Many large ones, one over another, in any order: what is hidden is passed by, and nothing else is.
    #[test]
    fn blocks_that_hide_what_is_behind_change_nothing() {
        let (width, height) = (200, 40);
        let mut state = 11_u64;
        let mut random = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * most
        };
        let triangles: Vec<[Place; 3]> = (0..300)
            .map(|_| {
                let depth = random(1.0);
                [(); 3].map(|()| {
                    Corner { x: random(400.0) - 100.0, y: random(100.0) - 30.0, depth: depth + random(0.05) }
                        .place()
                })
            })
            .collect();
        let empty =
            || Middles { numbers: vec![0; width * height], depths: vec![f32::NEG_INFINITY; width * height] };
        let given = Given { count: triangles.len(), corners: |n: usize| triangles[n], cut: |_| None };
        let (found, spans) = in_middles([width, height], &given, empty());
        // Nothing is known to be hidden if each begins anew.
        let (mut plain, mut rows) = (empty(), vec![[u32::MAX, 0]; height]);
        for (number, &corners) in (1..).zip(&triangles) {
            let Some(ready) = Ready::new(corners, width, &(0..height)) else { continue };
            let both = [middles(corners.map(|p| p.x), width), middles(corners.map(|p| p.y), height)];
            plain.add_middles(number, &ready, both, (&mut rows, &mut Hidden::of(width)), None);
            // At each middle a triangle is where its sides say, one by one.
            for row in 0..height {
                let at = |column: usize| {
                    let ahead = [(column, ready.columns[0]), (row, ready.rows[0])]
                        .map(|(to, from)| STEPS * (to as i64 - from as i64) + HALF);
                    ready.sides.iter().all(|[value, a, b]| value + a * ahead[0] + b * ahead[1] >= 0)
                };
                let columns = (0..width).filter(|column| at(*column));
                let held = |column: &usize| plain.numbers[row * width + column] >= number;
                let covered = columns.filter(|column| !held(column));
                let depths = |column: usize| plain.depths[row * width + column];
                assert!(covered.into_iter().all(|column| depths(column) > f32::NEG_INFINITY), "{number}");
            }
        }
        assert!(found.numbers == plain.numbers && found.depths == plain.depths);
        assert!(spans.iter().zip(&rows).all(|(a, b)| a == b || b[0] == u32::MAX));
        let seen: std::collections::HashSet<u32> = found.numbers.iter().copied().collect();
        assert!((10..250).contains(&seen.len()), "{}", seen.len());
    }
}
