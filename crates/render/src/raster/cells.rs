//! Which triangle is the nearest in pixels, at one sample or at several: for the outlines of visible regions.

use super::{Corner, EQUAL, FARTHEST, Pattern, STEPS, Triangle};

/// The pattern of one sample, in the middle of a pixel.
pub(crate) const MIDDLE: Pattern<1> = [(0, 0)];

/// The nearest triangles at the samples of some pixels, one after another: the number of each plus 1, or 0, and its depth.
pub(crate) struct Nearest<const N: usize> {
    pub(crate) numbers: Vec<[u32; N]>,
    pub(crate) depths: Vec<[f32; N]>,
}

/// Finds the nearest of `count` triangles at each sample of the pixels that have a `place` below `places`. Of two at the same
/// depth it is the later.
pub(crate) fn nearest<const N: usize>(
    pattern: &Pattern<N>,
    [width, height]: [usize; 2],
    count: usize,
    corners: impl Fn(usize) -> [Corner; 3],
    places: usize,
    place: impl Fn(usize) -> usize,
) -> Nearest<N> {
    let offset = |k: i64| (k as f64 + 8.5) / 16.0;
    let mut numbers = vec![[0; N]; places];
    let mut depths = vec![[f32::NEG_INFINITY; N]; places];
    for number in 0..count {
        let Some(triangle) = Triangle::new(pattern, number, corners(number), width, height) else { continue };
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
                let (Some(numbers), Some(depths)) = (numbers.get_mut(place), depths.get_mut(place)) else {
                    continue;
                };
                for (s, &(x, y)) in pattern.iter().enumerate() {
                    if (corner[0] + at[0][s]) | (corner[1] + at[1][s]) | (corner[2] + at[2][s]) < 0 {
                        continue;
                    }
                    let depth =
                        origin + right * (column as f64 + offset(x)) + down * (row as f64 + offset(y));
                    let depth = depth.clamp(least, greatest) as f32;
                    if depth + EQUAL >= depths[s] {
                        depths[s] = depth.max(depths[s]);
                        numbers[s] = number as u32 + 1;
                    }
                }
            }
        }
    }
    Nearest { numbers, depths }
}

/// Weights of corners in the middle of pixels, of one triangle after another.
#[derive(Default)]
pub(crate) struct Weights {
    triangle: Option<Triangle<1>>,
}

impl Weights {
    /// The weights of a triangle's corners in the middle of a pixel, or near it if that is outside.
    pub(crate) fn at(
        &mut self,
        number: usize,
        corners: impl FnOnce() -> [Corner; 3],
        [column, row]: [usize; 2],
    ) -> [f64; 3] {
        if self.triangle.as_ref().is_none_or(|triangle| triangle.number != number) {
            let far = FARTHEST as usize;
            self.triangle = Triangle::new(&MIDDLE, number, corners(), far, far);
        }
        let middle = |at: usize| at as i64 * STEPS + STEPS / 2;
        match &self.triangle {
            Some(triangle) => triangle.weights(middle(column), middle(row)),
            None => [1.0 / 3.0; 3],
        }
    }
}
