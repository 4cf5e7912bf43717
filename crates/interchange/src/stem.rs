//! The mesh of a straight stem: a tube with a half ball at each end.
//!
//! Both ends are balls, so stems that meet at any angle leave no gap, each being a mesh of its own.

use dlsys_geometry::scene::{Vector, sin_cos_degrees};
use dlsys_render::Spoke;

/// A corner of a stem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// Whether it belongs to the upper end.
    pub(crate) upper: bool,
    /// From the middle of that end, in radii: across, at a right angle to that and to the stem, along the stem.
    pub(crate) place: [f64; 3],
    /// The unit normal, along the same axes.
    pub(crate) normal: [f64; 3],
}

/// Corners and triangles of a stem.
#[derive(Clone, Debug)]
pub(crate) struct Tube {
    pub(crate) corners: Vec<Corner>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Tube {
    /// With this cross-section.
    pub(crate) fn new(spokes: &[Spoke]) -> Tube {
        let sides = spokes.len() as u32;
        // As round along the stem as around it.
        let steps = (sides / 4).clamp(2, 8);
        let mut tube = Tube { corners: Vec::new(), triangles: Vec::new() };
        let latitudes = (0..2 * steps).map(|i| {
            (i >= steps, if i < steps { i as i32 + 1 - steps as i32 } else { i as i32 - steps as i32 })
        });
        tube.corners.push(Corner { upper: false, place: [0.0, 0.0, -1.0], normal: [0.0, 0.0, -1.0] });
        for (upper, latitude) in latitudes {
            let (sin, cos) = sin_cos_degrees(90.0 * f64::from(latitude) / f64::from(steps));
            tube.corners.extend(spokes.iter().map(|spoke| {
                let ([x, y], [a, b]) = (spoke.place, spoke.normal);
                Corner { upper, place: [x * cos, y * cos, sin], normal: [a * cos, b * cos, sin] }
            }));
        }
        tube.corners.push(Corner { upper: true, place: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 1.0] });
        let ring = |row: u32, side: u32| 1 + row * sides + side % sides;
        let (rows, pole) = (2 * steps, tube.corners.len() as u32 - 1);
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
        let tube = Tube::new(&dlsys_render::cross_section(None, 1.0, 0.05));
        let axes = [-Vector::x(), Vector::z(), Vector::y()];
        let at = |i: u32| {
            let corner = tube.corners[i as usize];
            Corner::turned(corner.place, axes) + Vector::y() * if corner.upper { 2.0 } else { 0.0 }
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
        let exact = std::f64::consts::PI * (2.0 + 4.0 / 3.0);
        assert!((0.9 * exact..exact).contains(&volume), "{volume} {exact}");
    }
}
