//! The mesh of a straight stem: a tube with a half ball at each end.
//!
//! Both ends are balls, so stems that meet at any angle leave no gap, each being a mesh of its own. One that an axis goes on into at its end has a neck: it
//! begins as wide as that, and narrows smoothly.

use dlsys_geometry::scene::{Vector, sin_cos_degrees};
use dlsys_render::Spoke;

/// Sizes of a stem: its length, its radii at the lower and at the upper end, the length of its neck and the radius at the end of that. A stem without a neck has the first three.
/// The height of a corner is a sum of lengths, and its distance from the middle one of radii.
pub(crate) const SIZES: usize = 5;
/// Which of them are lengths.
pub(crate) const IS_LENGTH: [bool; SIZES] = [true, false, false, true, false];
const LOWER: [f64; SIZES] = [0.0, 1.0, 0.0, 0.0, 0.0];
const UPPER: [f64; SIZES] = [1.0, 0.0, 1.0, 0.0, 0.0];
/// Pieces of a neck.
const PIECES: u32 = 8;

/// A corner of a stem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// How much it has of each of the [sizes](SIZES).
    pub(crate) shares: [f64; SIZES],
    /// How fast the neck narrows there, in parts of the change of its radius over its length.
    pub(crate) slope: f64,
    /// From the middle of its cross-section, in radii: across, at a right angle to that and to the stem, along the stem.
    pub(crate) place: [f64; 3],
    /// The unit normal, along the same axes.
    pub(crate) normal: [f64; 3],
}

/// Corners and triangles of a stem.
#[derive(Clone, Debug)]
pub(crate) struct Tube {
    pub(crate) corners: Vec<Corner>,
    /// How many of the sizes it has.
    pub(crate) sizes: usize,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Tube {
    /// With this cross-section, and a neck or none.
    pub(crate) fn new(spokes: &[Spoke], neck: bool) -> Tube {
        let sides = spokes.len() as u32;
        // As round along the stem as around it.
        let steps = (sides / 4).clamp(2, 8);
        let sizes = if neck { SIZES } else { 3 };
        let mut tube = Tube { corners: Vec::new(), sizes, triangles: Vec::new() };
        let turn = |latitude: u32| sin_cos_degrees(90.0 * f64::from(latitude) / f64::from(steps));
        let lower = (0..steps).rev().map(|i| (LOWER, 0.0, (0.0 - turn(i).0, turn(i).1)));
        let pieces = if neck { PIECES } else { 0 };
        let narrowing = (1..=pieces).map(|k| {
            let u = f64::from(k) / f64::from(PIECES);
            let part = u * u * (3.0 - 2.0 * u);
            ([0.0, 1.0 - part, 0.0, u, part], 6.0 * u * (1.0 - u), (0.0, 1.0))
        });
        let upper = (0..steps).map(|i| (UPPER, 0.0, turn(i)));
        let pole = |shares, z| Corner { shares, slope: 0.0, place: [0.0, 0.0, z], normal: [0.0, 0.0, z] };
        tube.corners.push(pole(LOWER, -1.0));
        for (shares, slope, (sin, cos)) in lower.chain(narrowing).chain(upper) {
            tube.corners.extend(spokes.iter().map(|spoke| {
                let ([x, y], [a, b]) = (spoke.place, spoke.normal);
                let (place, normal) = ([x * cos, y * cos, sin], [a * cos, b * cos, sin]);
                Corner { shares, slope, place, normal }
            }));
        }
        tube.corners.push(pole(UPPER, 1.0));
        let ring = |row: u32, side: u32| 1 + row * sides + side % sides;
        let (rows, pole) = (2 * steps + pieces, tube.corners.len() as u32 - 1);
        for side in 0..sides {
            tube.triangles.push([0, ring(0, side + 1), ring(0, side)]);
            for row in 1..rows {
                let [a, b] = [ring(row - 1, side), ring(row - 1, side + 1)];
                let [d, c] = [ring(row, side), ring(row, side + 1)];
                tube.triangles.extend([[a, b, c], [a, c, d]]);
            }
            tube.triangles.push([pole, ring(rows - 1, side), ring(rows - 1, side + 1)]);
        }
        tube
    }
}

impl Corner {
    /// Its height above the lower end, and its distance from the middle in parts of that of its place, where the stem has these sizes.
    pub(crate) fn sized(&self, sizes: &[f64; SIZES]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for ((share, size), is_length) in self.shares.iter().zip(sizes).zip(IS_LENGTH) {
            sums[usize::from(!is_length)] += share * size;
        }
        sums
    }

    /// A displacement along these axes: across, at a right angle to that, along.
    pub(crate) fn turned([x, y, z]: [f64; 3], [u, v, along]: [Vector; 3]) -> Vector {
        u * x + v * y + along * z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stem_is_closed_and_faces_outwards() {
        let exact = std::f64::consts::PI * (2.0 + 4.0 / 3.0);
        let round = |neck| Tube::new(&dlsys_render::cross_section(None, 1.0, 0.05), neck);
        is_closed(&round(false), &[2.0, 1.0, 1.0, 0.0, 0.0], exact);
        is_closed(&round(true), &[2.0, 1.0, 1.0, 1.0, 1.0], exact);
        // The integral of (1 - s/2)² along the neck, where s goes smoothly from 0 to 1, is 0.5 + 0.25 · 13/35.
        let narrow = std::f64::consts::PI * (0.5 + 13.0 / 140.0 + 0.25 + (2.0 + 0.25) / 3.0);
        is_closed(&round(true), &[2.0, 1.0, 0.5, 1.0, 0.5], narrow);
    }

    fn is_closed(tube: &Tube, sizes: &[f64; SIZES], exact: f64) {
        let axes = [-Vector::x(), Vector::z(), Vector::y()];
        let at = |i: u32| {
            let corner = tube.corners[i as usize];
            let [height, radius] = corner.sized(sizes);
            Corner::turned(corner.place, axes) * radius + Vector::y() * height
        };
        let mut edges = std::collections::HashMap::new();
        let mut volume = 0.0;
        for &[a, b, c] in &tube.triangles {
            volume += at(a).dot(&at(b).cross(&at(c))) / 6.0;
            let face = (at(b) - at(a)).cross(&(at(c) - at(a)));
            assert!(face.dot(&Corner::turned(tube.corners[a as usize].normal, axes)) > 0.0);
            for (p, q) in [(a, b), (b, c), (c, a)] {
                *edges.entry((p, q)).or_insert(0) += 1;
                *edges.entry((q, p)).or_insert(0) -= 1;
            }
        }
        assert!(edges.values().all(|&count| count == 0));
        assert!((0.9 * exact..exact).contains(&volume), "{volume} {exact}");
    }
}
