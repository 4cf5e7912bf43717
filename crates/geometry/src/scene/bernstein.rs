//! Points and normals of bicubic patches: sums of control points by Bernstein's polynomials.

use super::patch::Net;
use super::{Point, Vector};

/// The curve of a patch at one parameter along its rows: the control points of the curve, and of its slope across. Sums are those of
/// [`point`] and [`normal`], to the last bit.
pub(super) struct Column {
    pub(super) u: f64,
    points: [Vector; 4],
    slopes: [Vector; 4],
}

impl Column {
    pub(super) fn new(net: &Net, u: f64) -> Column {
        Column { u, points: along_rows(net, weights(u)), slopes: along_rows(net, slopes(u)) }
    }

    /// Place and normal at a parameter along the curve, given the polynomials and their derivatives there.
    pub(super) fn at(&self, net: &Net, (v, values, slopes): &(f64, [f64; 4], [f64; 4])) -> (Point, Vector) {
        let across = combined(&self.slopes, *values).cross(&combined(&self.points, *slopes));
        let normal = across.try_normalize(1e-9).unwrap_or_else(|| normal(net, self.u, *v));
        (Point::from(combined(&self.points, *values)), normal)
    }
}

/// The points of each row with these weights.
pub(super) fn along_rows(net: &Net, weights: [f64; 4]) -> [Vector; 4] {
    [0, 1, 2, 3].map(|row: usize| {
        let mut along = Vector::zeros();
        for (point, weight) in net[row].iter().zip(weights) {
            along += point.coords * weight;
        }
        along
    })
}

/// The sum of vectors with these weights.
pub(super) fn combined(vectors: &[Vector; 4], weights: [f64; 4]) -> Vector {
    let mut sum = Vector::zeros();
    for (vector, weight) in vectors.iter().zip(weights) {
        sum += vector * weight;
    }
    sum
}

/// Bernstein's polynomials of degree three.
pub(super) fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// Their derivatives.
pub(super) fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t]
}

fn sum(net: &Net, of_columns: [f64; 4], of_rows: [f64; 4]) -> Vector {
    combined(&along_rows(net, of_columns), of_rows)
}

pub(super) fn point(net: &Net, u: f64, v: f64) -> Point {
    Point::from(sum(net, weights(u), weights(v)))
}

/// The unit normal on the front; where an edge shrinks to a point, that of a place nearby.
pub(super) fn normal(net: &Net, u: f64, v: f64) -> Vector {
    for inwards in [0.0, 1e-3, 0.03, 0.3] {
        let (u, v) = (u + (0.5 - u) * inwards, v + (0.5 - v) * inwards);
        let across = sum(net, slopes(u), weights(v)).cross(&sum(net, weights(u), slopes(v)));
        if let Some(normal) = across.try_normalize(1e-9) {
            return normal;
        }
    }
    Vector::z()
}
