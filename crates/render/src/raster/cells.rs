//! Which triangle is the nearest in pixels, at one sample or at several: for the outlines of visible regions.

use std::ops::Range;

use super::fragments::{Cover, places};
use super::plane::Ready;
use super::{Corner, EQUAL, Pattern, Place, STEPS};
use crate::mapping::Cut;

/// Eight samples, no two in a row or column.
pub(crate) const EIGHT: Pattern<8> = [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)];
/// In a rectangle of more pixels than this it is not worth the search whether any is to be drawn.
const FEW: usize = 256;
/// Half a pixel.
const HALF: i64 = STEPS / 2;

/// The nearest triangles at the samples of some pixels, one after another: the number of each plus 1, or 0, and its depth.
pub(crate) struct Nearest<const N: usize> {
    pub(crate) numbers: Vec<[u32; N]>,
    pub(crate) depths: Vec<[f32; N]>,
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
    mut nearest: Nearest<1>,
) -> (Nearest<1>, Vec<[u32; 2]>) {
    let mut spans = vec![[u32::MAX, 0]; height];
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
        nearest.add_middles(number as u32 + 1, &ready, [columns, rows], (width, &mut spans), cut.as_ref());
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

impl Nearest<1> {
    fn add_middles(
        &mut self,
        number: u32,
        ready: &Ready,
        [columns, rows]: [Range<usize>; 2],
        (width, spans): (usize, &mut [[u32; 2]]),
        cut: Option<&Cut<'_>>,
    ) {
        let plane = ready.plane;
        let ahead = [(columns.start, ready.columns[0]), (rows.start, ready.rows[0])]
            .map(|(to, from)| STEPS * (to as i64 - from as i64) + HALF);
        let mut start = ready.sides.map(|[value, a, b]| value + a * ahead[0] + b * ahead[1]);
        let step = ready.sides.map(|side| side[1] * STEPS);
        for row in rows {
            let mut here = start;
            (0..3).for_each(|k| start[k] += ready.sides[k][2] * STEPS);
            let mut first = columns.start;
            while first < columns.end && here[0] | here[1] | here[2] < 0 {
                (0..3).for_each(|k| here[k] += step[k]);
                first += 1;
            }
            let line = row * width;
            let mut column = first;
            while column < columns.end && here[0] | here[1] | here[2] >= 0 {
                (0..3).for_each(|k| here[k] += step[k]);
                let is_cut = cut.is_some_and(|cut| !cut.is_drawn([column as f64 + 0.5, row as f64 + 0.5]));
                let depth = plane.sample(plane.at([column, row]), [HALF as f32; 2]);
                let ([held], [behind]) = (&mut self.numbers[line + column], &mut self.depths[line + column]);
                // Later ones have greater numbers.
                if depth + EQUAL >= *behind && !is_cut {
                    *behind = if depth > *behind { depth } else { *behind };
                    *held = number;
                }
                column += 1;
            }
            if column > first {
                let [from, end] = &mut spans[row];
                (*from, *end) = ((*from).min(first as u32), (*end).max(column as u32));
            }
        }
    }
}

/// Finds the nearest triangle at each sample of these pixels, the first of which has the `place` 0; others have one beyond all of them. Of two at the same depth it is the later.
/// Triangles that are known to be `seen` come first, so that most others are hidden by then.
pub(crate) fn at_samples<'c, const N: usize>(
    pattern: &Pattern<N>,
    size: [usize; 2],
    triangles: &Given<impl Fn(usize) -> [Place; 3], impl Fn(usize) -> Option<Cut<'c>>>,
    (cells, place): (&[u32], impl Fn(usize) -> usize),
    seen: impl Fn(usize) -> bool,
) -> Nearest<N> {
    let count = cells.len();
    let mut nearest = Nearest { numbers: vec![[0; N]; count], depths: vec![[f32::NEG_INFINITY; N]; count] };
    let Given { corners, cut, .. } = triangles;
    for number in (0..triangles.count).filter(|number| seen(*number)) {
        nearest.add(pattern, size, (number, corners(number), || cut(number)), &place, |_, _| true);
    }
    let farthest = |depths: &[f32; N]| depths.iter().copied().fold(f32::INFINITY, f32::min);
    let far: Vec<f32> = nearest.depths.iter().map(farthest).collect();
    let is_open = |place: usize, depth: f32| far.get(place).is_some_and(|far| depth + EQUAL >= *far);
    let blocks = Blocks::new(size, cells, &far);
    for number in (0..triangles.count).filter(|number| !seen(*number)) {
        let corners = corners(number);
        if blocks.is_open(&corners) {
            nearest.add(pattern, size, (number, corners, || cut(number)), &place, is_open);
        }
    }
    nearest
}

/// Pixels along a side of a block, as a power of two.
const BLOCK: u32 = 3;

/// By block of pixels the depth of what is farthest in those that are to be drawn, so that most of what is hidden is passed at once.
struct Blocks {
    size: [usize; 2],
    far: Vec<f32>,
}

impl Blocks {
    /// Of these pixels, which have these depths.
    fn new([width, height]: [usize; 2], cells: &[u32], depths: &[f32]) -> Blocks {
        let size = [width, height].map(|side| (side >> BLOCK) + 1);
        let mut far = vec![f32::INFINITY; size[0] * size[1]];
        for (cell, depth) in cells.iter().zip(depths) {
            let [column, row] = [*cell as usize % width, *cell as usize / width].map(|at| at >> BLOCK);
            let known = &mut far[row * size[0] + column];
            *known = known.min(*depth);
        }
        Blocks { size, far }
    }

    /// Whether a triangle may be in front of something.
    fn is_open(&self, corners: &[Place; 3]) -> bool {
        let range = |at: [i32; 3], count: usize| {
            let block = |at: i32| (i64::from(at).div_euclid(STEPS) >> BLOCK).max(0) as usize;
            let [low, high] = [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])];
            (block(low).min(count), (block(high) + 1).min(count))
        };
        let front = corners[0].depth.max(corners[1].depth).max(corners[2].depth);
        let columns = range(corners.each_ref().map(|corner| corner.x), self.size[0]);
        let rows = range(corners.each_ref().map(|corner| corner.y), self.size[1]);
        (rows.0..rows.1).any(|row| {
            let line = &self.far[row * self.size[0]..][..self.size[0]];
            line[columns.0..columns.1].iter().any(|far| front + EQUAL >= *far)
        })
    }
}

impl<const N: usize> Nearest<N> {
    /// Adds a triangle where it is in front. `is_open` tells whether something at this depth may be seen at a place.
    fn add<'c>(
        &mut self,
        pattern: &Pattern<N>,
        [width, height]: [usize; 2],
        (number, corners, cut): (usize, [Place; 3], impl FnOnce() -> Option<Cut<'c>>),
        place: impl Fn(usize) -> usize,
        is_open: impl Fn(usize, f32) -> bool,
    ) {
        let front = corners[0].depth.max(corners[1].depth).max(corners[2].depth);
        let count = self.numbers.len();
        let is_drawn = |cell: usize| {
            let at = place(cell);
            at < count && is_open(at, front)
        };
        if !touches(&corners, [width, height], is_drawn) {
            return;
        }
        let Some(Ready { columns, rows, sides, plane }) = Ready::new(corners, width, &(0..height)) else {
            return;
        };
        let cut = cut();
        let samples = places(pattern);
        let mut cover: Option<Cover<N>> = None;
        // What the samples of a pixel add to a side's function at most.
        let most = sides.map(|[_, a, b]| (a.max(0) + b.max(0)) * STEPS);
        let number = number as u32 + 1;
        let mut start = sides.map(|side| side[0]);
        for row in rows[0]..=rows[1] {
            let mut corner = start;
            (0..3).for_each(|k| start[k] += sides[k][2] * STEPS);
            let mut entered = false;
            for column in columns[0]..=columns[1] {
                let here = corner;
                (0..3).for_each(|k| corner[k] += sides[k][1] * STEPS);
                if (here[0] + most[0]) | (here[1] + most[1]) | (here[2] + most[2]) < 0 {
                    if entered {
                        break;
                    }
                    continue;
                }
                entered = true;
                let place = place(row * width + column);
                if place >= count || !is_open(place, front) {
                    continue;
                }
                let mut left = cover.get_or_insert_with(|| Cover::new(&sides, &samples)).mask(here);
                let (numbers, depths) = (&mut self.numbers[place], &mut self.depths[place]);
                let base = plane.at([column, row]);
                while left != 0 {
                    let s = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let at = [samples[0][s], samples[1][s]];
                    let step = 1.0 / STEPS as f64;
                    let whole =
                        || [column as f64 + f64::from(at[0]) * step, row as f64 + f64::from(at[1]) * step];
                    if cut.as_ref().is_some_and(|cut| !cut.is_drawn(whole())) {
                        continue;
                    }
                    let depth = plane.sample(base, at);
                    let is_later = number > numbers[s];
                    if depth > depths[s] + EQUAL || is_later && depth + EQUAL >= depths[s] {
                        depths[s] = if depth > depths[s] { depth } else { depths[s] };
                        numbers[s] = number;
                    }
                }
            }
        }
    }
}

/// Whether a triangle may touch a pixel that is to be drawn. Most of the small ones do not.
fn touches(corners: &[Place; 3], [width, height]: [usize; 2], is_drawn: impl Fn(usize) -> bool) -> bool {
    let range = |at: [i32; 3], count: usize| {
        let low = i64::from(at[0].min(at[1]).min(at[2])).div_euclid(STEPS);
        let high = i64::from(at[0].max(at[1]).max(at[2])).div_euclid(STEPS) + 1;
        low.max(0) as usize..high.clamp(0, count as i64) as usize
    };
    let columns = range(corners.each_ref().map(|corner| corner.x), width);
    let mut rows = range(corners.each_ref().map(|corner| corner.y), height);
    columns.len() * rows.len() > FEW
        || rows.any(|row| columns.clone().any(|column| is_drawn(row * width + column)))
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
