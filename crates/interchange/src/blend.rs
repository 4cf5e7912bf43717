//! Few shapes of which all shapes of a life are sums.
//!
//! An organ that opens while it grows goes through shapes that look all different but lie in a space of few dimensions, because its numbers are made of few
//! functions of time. A file needs a shape for each dimension, not for each age. Directions are found one by one: the largest difference that is left over gives the
//! next one, and is taken out of all shapes (Gram and Schmidt, with pivots). Then the origin is moved to a corner of the box around all coordinates, so that weights are from 0 to 1: many programs
//! allow no others.

use crate::life::Shape;
use crate::part::{Part, length};
use crate::thin::thin;

/// Most directions.
const MOST: usize = 24;
/// Numbers that are worked on at once, at most.
const LARGEST: usize = 60_000_000;
/// Samples for normals, besides one for each direction.
const SPARE: usize = 4;

/// A shape with the weights that make it.
#[derive(Clone, Debug)]
pub(crate) struct Example {
    pub(crate) weights: Vec<f32>,
    pub(crate) numbers: Vec<f32>,
}

/// Shapes at ages, and the directions found so far.
struct Space<'a> {
    form: &'a [Part],
    /// Of each sample, what is left over.
    rest: Vec<Vec<f64>>,
    directions: Vec<Vec<f64>>,
    /// Of each sample, its coordinates.
    coordinates: Vec<Vec<f64>>,
}

impl Space<'_> {
    /// Adds the direction of the largest difference that is left. False if all are within the tolerance.
    fn grow(&mut self, tolerance: f64) -> bool {
        let sizes = self.rest.iter().map(|rest| length(self.form, rest)).enumerate();
        let Some((pivot, size)) = sizes.reduce(|a, b| if b.1 > a.1 { b } else { a }) else { return false };
        if size <= tolerance {
            return false;
        }
        let norm = self.rest[pivot].iter().map(|x| x * x).sum::<f64>().sqrt();
        let direction: Vec<f64> = self.rest[pivot].iter().map(|x| x / norm).collect();
        for (rest, coordinates) in self.rest.iter_mut().zip(&mut self.coordinates) {
            let along: f64 = rest.iter().zip(&direction).map(|(a, b)| a * b).sum();
            rest.iter_mut().zip(&direction).for_each(|(a, b)| *a -= along * b);
            coordinates.push(along);
        }
        self.directions.push(direction);
        true
    }

    /// The displacement of these coordinates.
    fn displacement(&self, coordinates: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.directions.first().map_or(0, Vec::len), 0.0);
        for (direction, along) in self.directions.iter().zip(coordinates) {
            out.iter_mut().zip(direction).for_each(|(a, b)| *a += along * b);
        }
    }

    /// Samples between which straight lines of coordinates are near enough.
    fn keys(&self, ages: &[f64], tolerance: f64) -> Vec<usize> {
        let mut room = Vec::new();
        thin(ages.len(), |i, j| {
            (i + 1..j).all(|k| {
                let w = (ages[k] - ages[i]) / (ages[j] - ages[i]);
                let [a, b, c] = [i, j, k].map(|n| &self.coordinates[n]);
                let off: Vec<f64> = (a.iter().zip(b).zip(c)).map(|((a, b), c)| a + (b - a) * w - c).collect();
                self.displacement(&off, &mut room);
                length(self.form, &room) <= tolerance
            })
        })
    }
}

/// The shapes of a life as sums of fewer than `fewer` other shapes; `None` if there are no such. Returns the ages of keys.
pub(crate) fn blend(
    form: &[Part],
    ages: &[f64],
    numbers: &[&[f32]],
    fewer: usize,
    tolerance: f64,
) -> Option<(Vec<f64>, Shape)> {
    let last = numbers.last()?;
    if ages.len() * last.len() > LARGEST {
        return None;
    }
    let rest = |own: &&[f32]| own.iter().zip(*last).map(|(a, b)| f64::from(*a) - f64::from(*b)).collect();
    let mut space = Space {
        form,
        rest: numbers.iter().map(rest).collect(),
        directions: Vec::new(),
        coordinates: vec![Vec::new(); ages.len()],
    };
    while space.grow(tolerance / 2.0) {
        if space.directions.len() >= fewer.min(MOST + 1) {
            return None;
        }
    }
    let count = space.directions.len();
    // From the end of each direction that is nearer to the mature shape, to the other one.
    let ends: Vec<[f64; 2]> = (0..count)
        .map(|k| {
            let all = || space.coordinates.iter().map(|own| own[k]);
            let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
            if low.abs() <= high.abs() { [low, high] } else { [high, low] }
        })
        .collect();
    let weights = |i: usize| -> Vec<f32> {
        let own = space.coordinates[i].iter().zip(&ends);
        own.map(|(c, [from, to])| ((c - from) / (to - from)).clamp(0.0, 1.0) as f32).collect()
    };
    let mut room = Vec::new();
    let mut shape = |coordinates: &[f64]| -> Vec<f32> {
        space.displacement(coordinates, &mut room);
        last.iter().zip(&room).map(|(a, b)| (f64::from(*a) + b) as f32).collect()
    };
    let base: Vec<f64> = ends.iter().map(|end| end[0]).collect();
    let mut shapes = vec![shape(&base)];
    for (k, end) in ends.iter().enumerate() {
        let mut there = base.clone();
        there[k] = end[1];
        shapes.push(shape(&there));
    }
    let kept = space.keys(ages, tolerance / 2.0);
    let wanted = (count + SPARE).min(ages.len());
    let examples = (0..wanted).map(|i| {
        let i = if wanted > 1 { i * (ages.len() - 1) / (wanted - 1) } else { 0 };
        Example { weights: weights(i), numbers: numbers[i].to_vec() }
    });
    let examples = examples.collect();
    let keys = kept.iter().map(|&i| ages[i]).collect();
    let weights = kept.iter().flat_map(|&i| weights(i)).collect();
    Some((keys, Shape::Mixed { shapes, weights, examples }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turning_and_growing_corner_needs_two_directions() {
        let ages: Vec<f64> = (0..=100).map(|i| f64::from(i) / 100.0).collect();
        let numbers: Vec<Vec<f32>> = (ages.iter())
            .map(|t| {
                let (sin, cos) = (2.0 * t).sin_cos();
                let size = 1.0 + t;
                [0.0, 0.0, 0.0, size * cos, size * sin, 0.0, cos, 1.0, sin].map(|x| x as f32).to_vec()
            })
            .collect();
        let refs: Vec<&[f32]> = numbers.iter().map(Vec::as_slice).collect();
        let form = [Part::Polygon(3)];
        let (keys, shape) = blend(&form, &ages, &refs, 10, 1e-3).expect("few directions");
        let Shape::Mixed { shapes, weights, examples } = shape else { panic!("mixed") };
        assert_eq!((shapes.len(), examples.len()), (5, 8));
        assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)));
        for (t, own) in ages.iter().zip(&refs) {
            let (i, w) = crate::thin::place(&keys, *t);
            for (n, x) in own.iter().enumerate() {
                let weight = |k: usize| {
                    let (a, b) = (weights[i * 4 + k], weights[(i + 1).min(keys.len() - 1) * 4 + k]);
                    a + (b - a) * w as f32
                };
                let sum: f32 = (0..4).map(|k| weight(k) * (shapes[k + 1][n] - shapes[0][n])).sum();
                assert!((shapes[0][n] + sum - x).abs() < 1e-3, "{t} {n}");
            }
        }
        assert!(blend(&form, &ages, &refs, 4, 1e-3).is_none(), "not with fewer");
    }
}
