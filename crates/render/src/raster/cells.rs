//! Which triangle is the nearest in each pixel, and at samples of some pixels: for the outlines of visible regions.

use super::{Corner, EQUAL, FARTHEST, Pattern, SIXTEEN, STEPS, Triangle};

/// The nearest triangle in the middle of each pixel: its number plus 1, or 0, and its depth. Of two at the same depth it is the later.
pub(crate) fn nearest(
    [width, height]: [usize; 2],
    count: usize,
    corners: impl Fn(usize) -> [Corner; 3],
) -> (Vec<u32>, Vec<f32>) {
    const MIDDLE: Pattern<1> = [(0, 0)];
    let (mut numbers, mut depths) = (vec![0; width * height], vec![f32::NEG_INFINITY; width * height]);
    for number in 0..count {
        let Some(triangle) = Triangle::new(&MIDDLE, number, corners(number), width, height) else { continue };
        let [least, greatest] = triangle.depths;
        let [origin, right, down] = triangle.depth;
        for row in triangle.rows[0]..=triangle.rows[1] {
            for column in triangle.columns[0]..=triangle.columns[1] {
                let inside = (0..3).all(|k| {
                    let [a, b, c] = triangle.sides[k];
                    let corner =
                        a * (column as i64 * STEPS) + b * (row as i64 * STEPS) + c + triangle.bias[k];
                    corner + triangle.at_samples[k][0] >= 0
                });
                if !inside {
                    continue;
                }
                let depth = origin + right * (column as f64 + 0.5) + down * (row as f64 + 0.5);
                let depth = depth.clamp(least, greatest) as f32;
                let held = &mut depths[row * width + column];
                if depth + EQUAL >= *held {
                    *held = depth.max(*held);
                    numbers[row * width + column] = number as u32 + 1;
                }
            }
        }
    }
    (numbers, depths)
}

/// The nearest triangles at sixteen samples of some pixels, as of [`nearest`]. `places` has for each pixel its place in the
/// answer, of `chosen` pixels; or anything greater.
pub(crate) fn samples(
    [width, height]: [usize; 2],
    count: usize,
    corners: impl Fn(usize) -> [Corner; 3],
    places: &[u32],
    chosen: usize,
) -> Vec<[u32; 16]> {
    let mut numbers = vec![[0; 16]; chosen];
    let mut depths = vec![[f32::NEG_INFINITY; 16]; chosen];
    for number in 0..count {
        let Some(triangle) = Triangle::new(&SIXTEEN, number, corners(number), width, height) else {
            continue;
        };
        let [least, greatest] = triangle.depths;
        let [origin, right, down] = triangle.depth;
        let largest = triangle.at_samples.map(|at| at.iter().copied().max().unwrap_or(0));
        for row in triangle.rows[0]..=triangle.rows[1] {
            for column in triangle.columns[0]..=triangle.columns[1] {
                let place = places[row * width + column] as usize;
                let (Some(numbers), Some(depths)) = (numbers.get_mut(place), depths.get_mut(place)) else {
                    continue;
                };
                let corner = [0, 1, 2].map(|k| {
                    let [a, b, c] = triangle.sides[k];
                    a * (column as i64 * STEPS) + b * (row as i64 * STEPS) + c + triangle.bias[k]
                });
                if (0..3).any(|k| corner[k] + largest[k] < 0) {
                    continue;
                }
                for (s, (x, y)) in SIXTEEN.into_iter().enumerate() {
                    let at = &triangle.at_samples;
                    if (corner[0] + at[0][s]) | (corner[1] + at[1][s]) | (corner[2] + at[2][s]) < 0 {
                        continue;
                    }
                    let offset = |k: i64| (k as f64 + 8.5) / 16.0;
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
    numbers
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
            self.triangle = Triangle::new(&[(0, 0)], number, corners(), far, far);
        }
        let middle = |at: usize| at as i64 * STEPS + STEPS / 2;
        match &self.triangle {
            Some(triangle) => triangle.weights(middle(column), middle(row)),
            None => [1.0 / 3.0; 3],
        }
    }
}
