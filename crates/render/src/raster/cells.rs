//! Which triangle is the nearest in pixels, at one sample or at several: for the outlines of visible regions.

use super::{Corner, EQUAL, Pattern, STEPS, Triangle};
use crate::mapping::Cut;

/// The pattern of one sample, in the middle of a pixel.
pub(crate) const MIDDLE: Pattern<1> = [(0, 0)];

/// Eight samples, no two in a row or column.
pub(crate) const EIGHT: Pattern<8> = [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)];

/// The nearest triangles at the samples of some pixels, one after another: the number of each plus 1, or 0, and its depth.
pub(crate) struct Nearest<const N: usize> {
    pub(crate) numbers: Vec<[u32; N]>,
    pub(crate) depths: Vec<[f32; N]>,
}

/// Finds the nearest of `count` triangles, given their corners and what is cut out of them, at each sample of the pixels that have a `place` below `places`. Of two at the same
/// depth it is the later. Triangles that are known to be `seen` come first, so that most others are hidden by then.
pub(crate) fn nearest<'c, const N: usize>(
    pattern: &Pattern<N>,
    size: [usize; 2],
    (count, corners, cut): (usize, impl Fn(usize) -> [Corner; 3], impl Fn(usize) -> Option<Cut<'c>>),
    (places, place): (usize, impl Fn(usize) -> usize),
    seen: impl Fn(usize) -> bool,
) -> Nearest<N> {
    let mut nearest = Nearest { numbers: vec![[0; N]; places], depths: vec![[f32::NEG_INFINITY; N]; places] };
    for number in (0..count).filter(|number| seen(*number)) {
        nearest.add(pattern, size, (number, corners(number), cut(number)), &place, |_, _| true);
    }
    if (0..count).all(&seen) {
        return nearest;
    }
    let farthest = |depths: &[f32; N]| depths.iter().copied().fold(f32::INFINITY, f32::min);
    let far: Vec<f32> = nearest.depths.iter().map(farthest).collect();
    let is_open = |place: usize, depth: f64| far.get(place).is_some_and(|far| depth as f32 + EQUAL >= *far);
    for number in (0..count).filter(|number| !seen(*number)) {
        nearest.add(pattern, size, (number, corners(number), cut(number)), &place, is_open);
    }
    nearest
}

impl<const N: usize> Nearest<N> {
    /// Adds a triangle where it is in front. `is_open` tells whether something at this depth may be seen at a place.
    fn add(
        &mut self,
        pattern: &Pattern<N>,
        [width, height]: [usize; 2],
        (number, corners, cut): (usize, [Corner; 3], Option<Cut<'_>>),
        place: impl Fn(usize) -> usize,
        is_open: impl Fn(usize, f64) -> bool,
    ) {
        let offset = |k: i64| (k as f64 + 8.5) / 16.0;
        let front = corners[0].depth.max(corners[1].depth).max(corners[2].depth);
        let places = self.numbers.len();
        let is_drawn = |cell: usize| {
            let at = place(cell);
            at < places && is_open(at, front)
        };
        if !touches(pattern, &corners, [width, height], is_drawn) {
            return;
        }
        let Some(triangle) = Triangle::new(pattern, corners, width, height) else { return };
        let number = number as u32 + 1;
        let [least, greatest] = triangle.depths;
        let [origin, right, down] = triangle.depth;
        let at = &triangle.at_samples;
        let largest = at.map(|at| at.iter().copied().max().unwrap_or(0));
        let right_by = triangle.sides.map(|[a, ..]| a * STEPS);
        for row in triangle.rows[0]..=triangle.rows[1] {
            let first = triangle.columns[0];
            let mut corner = [0, 1, 2].map(|k| {
                let [a, b, c] = triangle.sides[k];
                a * (first as i64 * STEPS) + b * (row as i64 * STEPS) + c + triangle.bias[k] - right_by[k]
            });
            for column in first..=triangle.columns[1] {
                corner = [0, 1, 2].map(|k| corner[k] + right_by[k]);
                if (0..3).any(|k| corner[k] + largest[k] < 0) {
                    continue;
                }
                let place = place(row * width + column);
                if !is_open(place, front) {
                    continue;
                }
                let (Some(numbers), Some(depths)) = (self.numbers.get_mut(place), self.depths.get_mut(place))
                else {
                    continue;
                };
                for (s, &(x, y)) in pattern.iter().enumerate() {
                    if (corner[0] + at[0][s]) | (corner[1] + at[1][s]) | (corner[2] + at[2][s]) < 0 {
                        continue;
                    }
                    let (x, y) = (column as f64 + offset(x), row as f64 + offset(y));
                    if cut.as_ref().is_some_and(|cut| !cut.is_drawn([x, y])) {
                        continue;
                    }
                    let depth = origin + right * x + down * y;
                    let depth = depth.clamp(least, greatest) as f32;
                    let is_later = number > numbers[s];
                    if depth > depths[s] + EQUAL || is_later && depth + EQUAL >= depths[s] {
                        depths[s] = depth.max(depths[s]);
                        numbers[s] = number;
                    }
                }
            }
        }
    }
}

/// Whether a triangle may touch a sample of a pixel that is to be drawn. Most of the small ones do not.
fn touches<const N: usize>(
    pattern: &Pattern<N>,
    corners: &[Corner; 3],
    [width, height]: [usize; 2],
    is_drawn: impl Fn(usize) -> bool,
) -> bool {
    // The samples of a pixel begin and end so far from its sides; corners are rounded.
    let (first, last) = if pattern.len() == 1 { (0.48, 0.52) } else { (0.0, 1.0) };
    let range = |at: [f64; 3], end: usize| {
        let low = at[0].min(at[1]).min(at[2]) - last;
        let high = at[0].max(at[1]).max(at[2]) - first;
        (low.ceil().max(0.0) as usize, (high.floor().min(end as f64 - 1.0) + 1.0) as usize)
    };
    let (left, right) = range(corners.each_ref().map(|corner| corner.x), width);
    let (top, bottom) = range(corners.each_ref().map(|corner| corner.y), height);
    if left >= right || top >= bottom {
        return false;
    }
    // Of a large one it is not worth the search.
    let is_large = (right - left) * (bottom - top) > 256;
    is_large || (top..bottom).any(|row| (left..right).any(|column| is_drawn(row * width + column)))
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
