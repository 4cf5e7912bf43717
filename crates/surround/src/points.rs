//! Sets of points: the outermost ones, and the rigid motion that is nearest to theirs.

use nalgebra::{Matrix3, Vector3};

/// In radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Directions evenly over a sphere, along a spiral of the golden angle.
pub(crate) fn directions(count: usize) -> impl Iterator<Item = Vector3<f64>> {
    (0..count).map(move |k| {
        let height = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = (GOLDEN_ANGLE * k as f64).sin_cos();
        let across = (1.0 - height * height).sqrt();
        Vector3::new(across * cos, across * sin, height)
    })
}

/// The outermost of some balls (centre, radius) in each direction: their numbers, each once, in the order of directions.
pub(crate) fn outermost(
    balls: &[(Vector3<f64>, f64)],
    directions: impl Iterator<Item = Vector3<f64>>,
) -> Vec<usize> {
    let mut found = Vec::new();
    for direction in directions {
        let reach = |i: usize| direction.dot(&balls[i].0) + balls[i].1;
        let farthest = (0..balls.len()).max_by(|a, b| reach(*a).total_cmp(&reach(*b)));
        found.extend(farthest.filter(|farthest| !found.contains(farthest)));
    }
    found
}

/// A place and its velocity.
pub(crate) type Pair = (Vector3<f64>, Vector3<f64>);

/// A rigid motion.
pub(crate) struct RigidMotion {
    /// The velocity at a place.
    pub(crate) velocity: Vector3<f64>,
    pub(crate) spin: Vector3<f64>,
    /// False for points in one line, which do not tell the rotation about it: it is 0 then.
    pub(crate) is_determined: bool,
}

/// The rigid motion that is nearest to that of some points (least squares), with its velocity at a place.
pub(crate) fn rigid_motion(pairs: &[Pair], place: Vector3<f64>) -> RigidMotion {
    let count = pairs.len().max(1) as f64;
    let middle = pairs.iter().map(|(point, _)| *point).sum::<Vector3<f64>>() / count;
    let mean = pairs.iter().map(|(_, velocity)| *velocity).sum::<Vector3<f64>>() / count;
    let (mut spread, mut moment) = (Matrix3::zeros(), Vector3::zeros());
    for (point, velocity) in pairs {
        let arm = point - middle;
        spread += Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
        moment += arm.cross(&(velocity - mean));
    }
    // The pseudo-inverse of a symmetric matrix, in parts of its largest value.
    let found = nalgebra::SymmetricEigen::new(spread);
    let largest = found.eigenvalues.max();
    let (mut spin, mut axes) = (Vector3::zeros(), 0);
    for (value, axis) in found.eigenvalues.iter().zip(found.eigenvectors.column_iter()) {
        if *value > 1e-9 * largest {
            spin += axis * (axis.dot(&moment) / value);
            axes += 1;
        }
    }
    RigidMotion { velocity: mean + spin.cross(&(place - middle)), spin, is_determined: axes == 3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_found_again() {
        let (velocity, spin) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 4.0, -1.0));
        let point = |k: usize| Vector3::new((k % 3) as f64, (k / 3 % 2) as f64 + 0.1 * k as f64, k as f64);
        let moves = |point: Vector3<f64>| (point, velocity + spin.cross(&point));
        let all: Vec<Pair> = (0..7).map(|k| moves(point(k))).collect();
        let found = rigid_motion(&all, Vector3::zeros());
        assert!((found.velocity - velocity).norm() < 1e-12 && (found.spin - spin).norm() < 1e-12);
        assert!(found.is_determined);
        // Two points: no rotation about their line. One point: none at all.
        let line: Vec<Pair> = [Vector3::zeros(), Vector3::y()].map(moves).into();
        let found = rigid_motion(&line, Vector3::zeros());
        assert!((found.velocity - velocity).norm() < 1e-12 && !found.is_determined);
        assert!((found.spin - Vector3::new(0.3, 0.0, -1.0)).norm() < 1e-12);
        let found = rigid_motion(&line[..1], Vector3::x());
        assert!(found.velocity == velocity && found.spin == Vector3::zeros());
    }

    #[test]
    fn corners_of_a_cube_are_the_outermost_points() {
        let coordinate = |k: usize, bit: usize| (k >> bit & 1) as f64 * 2.0 - 1.0;
        let corner = |k: usize| Vector3::new(coordinate(k, 0), coordinate(k, 1), coordinate(k, 2));
        let mut balls: Vec<(Vector3<f64>, f64)> = (0..8).map(|k| (corner(k), 0.0)).collect();
        balls.extend((0..8).map(|k| (corner(k) * 0.9, 0.01)));
        let mut found = outermost(&balls, directions(64));
        found.sort_unstable();
        assert_eq!(found, (0..8).collect::<Vec<usize>>());
    }
}
