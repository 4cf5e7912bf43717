//! Stems that give way: from the shape at rest, which the turtle walks, to the shape that is seen.
//!
//! The turtle's own state is always that of the shape at rest. Where a stem bends, a rigid motion leads from there to the
//! place where things are seen; along a stem of the strain `u` (radians per scene unit about heading, left and up) its
//! rotation `Q` obeys
//!
//! ```text
//! dQ/ds = Q [R u]×,   dp/ds = Q h
//! ```
//!
//! with the frame at rest `R` and its heading `h`. Over a straight piece both have closed forms (Rodrigues), so cutting a stem in two
//! changes nothing. Without a strain there is no motion, and numbers are the same to the bit.

use dlsys_tree::Lineage;
use nalgebra::Matrix3;

use super::Pose;
use crate::scene::{Point, Vector};

/// A stem of a string: the module that draws it, and its number among the stems of that module. Straight steps of one width that
/// a module draws without anything in between are one stem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StemKey {
    /// [`Lineage::id`] of the module.
    pub module: u64,
    /// From 0, in the order of drawing.
    pub number: u32,
}

impl StemKey {
    /// A stem of a module.
    pub fn of(module: Lineage, number: u32) -> StemKey {
        StemKey { module: module.id, number }
    }
}

/// A part of a string that is let go: the module that holds its `@D`, and its number among those of that module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PartKey {
    /// [`Lineage::id`] of the module.
    pub module: u64,
    /// From 0, in the order of drawing.
    pub number: u32,
}

/// How far the stems of a string are from their shapes at rest, and where the parts are that it has let go.
pub trait Strains {
    /// The strain of a stem beyond that of its shape at rest: rotation about its heading, left and up, in radians per scene unit.
    /// Zero for a stem that is not known. `width` is that of the stem as it is drawn, in scene units.
    fn strain(&self, stem: StemKey, width: f64) -> Vector;

    /// Where the turtle stands at the `@D` of a part that has been let go; `None` for one that is not known, which stays where the branch
    /// holds it.
    fn flight(&self, _: PartKey) -> Option<Pose> {
        None
    }
}

/// The rigid motion from the shape at rest to what is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bent {
    rotation: Matrix3<f64>,
    /// A point of the shape at rest, and where it is seen.
    rest: Point,
    seen: Point,
}

impl Bent {
    /// No motion, about a point.
    pub(super) fn at(point: Point) -> Bent {
        Bent { rotation: Matrix3::identity(), rest: point, seen: point }
    }

    /// The motion that leads from one pose to another.
    pub(super) fn between(rest: &Pose, seen: &Pose) -> Bent {
        let [from, to] = [rest.axes, seen.axes].map(|axes| Matrix3::from_columns(&axes));
        Bent { rotation: to * from.transpose(), rest: rest.position, seen: seen.position }
    }

    /// Where a point of the shape at rest is seen.
    pub(super) fn point(&self, p: Point) -> Point {
        self.seen + self.rotation * (p - self.rest)
    }

    /// A direction of the shape at rest as it is seen.
    pub(super) fn vector(&self, v: Vector) -> Vector {
        self.rotation * v
    }

    /// The motion at the end of a straight piece of a stem that begins at `from` and goes this way at rest, while its frame turns by
    /// `turn` (radians, in the axes of the scene at rest). Also the displacement that is seen.
    pub(super) fn along(&self, from: Point, way: Vector, turn: Vector) -> (Bent, Vector) {
        let angle = turn.norm();
        let cross = turn.cross_matrix();
        let square = cross * cross;
        let (a, b, c) = coefficients(angle);
        let rotation = Matrix3::identity() + cross * a + square * b;
        let mean = Matrix3::identity() + cross * b + square * c;
        let displacement = self.rotation * (mean * way);
        let seen = self.point(from) + displacement;
        (Bent { rotation: self.rotation * rotation, rest: from + way, seen }, displacement)
    }

    /// The same motion about a point that has been put in another place.
    pub(super) fn put(&self, rest: Point, seen: Point) -> Bent {
        Bent { rotation: self.rotation, rest, seen }
    }
}

/// sin θ/θ, (1 - cos θ)/θ², (θ - sin θ)/θ³.
fn coefficients(angle: f64) -> (f64, f64, f64) {
    let square = angle * angle;
    if angle < 0.05 {
        let a = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
        let b = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0));
        let c = 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0));
        return (a, b, c);
    }
    let half = (angle / 2.0).sin();
    (angle.sin() / angle, 2.0 * half * half / square, (angle - angle.sin()) / (square * angle))
}

/// Into how many straight pieces a stem of this length and strain is cut, so that none is further from it than `accuracy` (0: not
/// known).
pub(super) fn pieces(strain: Vector, length: f64, accuracy: f64) -> usize {
    /// Turns within a piece, in radians: with and without an accuracy to go by.
    const SHARPEST: [f64; 2] = [0.35, 0.07];
    const MOST: f64 = 1000.0;
    // Twist alone moves no point of the axis.
    let turn = strain.y.hypot(strain.z) * length.abs() + strain.x.abs() * length.abs() * 0.1;
    let count = if accuracy > 0.0 {
        (turn * length.abs() / (8.0 * accuracy)).sqrt().max(turn / SHARPEST[0])
    } else {
        turn / SHARPEST[1]
    };
    count.ceil().clamp(1.0, MOST) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_circle_ends_where_it_does() {
        let strain = Vector::new(0.0, 0.0, std::f64::consts::FRAC_PI_2 / 2.0);
        let (end, way) = Bent::at(Point::origin()).along(Point::origin(), Vector::y() * 2.0, strain * 2.0);
        // Turned left, from +y towards -x, on a circle of the radius 4/π.
        let radius = 4.0 / std::f64::consts::PI;
        assert!((way - Vector::new(-radius, radius, 0.0)).norm() < 1e-14, "{way:?}");
        assert!((end.vector(Vector::y()) + Vector::x()).norm() < 1e-14);
    }

    #[test]
    fn cutting_a_stem_changes_nothing() {
        let (way, turn) = (Vector::new(0.3, 1.2, -0.4), Vector::new(0.7, -1.9, 0.4));
        let start = Bent::at(Point::new(1.0, 2.0, 3.0));
        let (whole, _) = start.along(start.rest, way, turn);
        for part in [1e-12, 0.013, 0.5, 0.9] {
            let (middle, _) = start.along(start.rest, way * part, turn * part);
            let (end, _) = middle.along(middle.rest, way * (1.0 - part), turn * (1.0 - part));
            assert!((end.seen - whole.seen).norm() < 1e-14, "{part}");
            assert!((end.rotation - whole.rotation).norm() < 1e-14, "{part}");
        }
    }

    #[test]
    fn series_and_formulas_agree() {
        for angle in [0.0499999, 0.0500001] {
            let (a, b, c) = coefficients(angle);
            let exact = (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle));
            assert!((a - exact.0).abs() < 1e-15 && (b - exact.1).abs() < 1e-12);
            assert!((c - (1.0 / 6.0 - angle * angle / 120.0 + angle.powi(4) / 5040.0)).abs() < 1e-12);
        }
    }
}
