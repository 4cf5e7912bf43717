//! The rigid motion that is nearest to that of some points.

use nalgebra::{Matrix3, Vector3};

/// A place and its velocity.
pub(crate) type Pair = (Vector3<f64>, Vector3<f64>);

/// The velocity at a place, and the spin, of the rigid motion that is nearest to that of some points (least squares). Points in one line
/// do not tell the rotation about it: there is none then.
pub(crate) fn rigid_motion(pairs: &[Pair], place: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
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
    let mut spin = Vector3::zeros();
    for (value, axis) in found.eigenvalues.iter().zip(found.eigenvectors.column_iter()) {
        if *value > 1e-9 * largest {
            spin += axis * (axis.dot(&moment) / value);
        }
    }
    (mean + spin.cross(&(place - middle)), spin)
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
        let (at, found) = rigid_motion(&all, Vector3::zeros());
        assert!((at - velocity).norm() < 1e-12 && (found - spin).norm() < 1e-12);
        // Two points: no rotation about their line. One point: none at all.
        let line: Vec<Pair> = [Vector3::zeros(), Vector3::y()].map(moves).into();
        let (at, found) = rigid_motion(&line, Vector3::zeros());
        assert!((at - velocity).norm() < 1e-12);
        assert!((found - Vector3::new(0.3, 0.0, -1.0)).norm() < 1e-12);
        let (at, found) = rigid_motion(&line[..1], Vector3::x());
        assert!(at == velocity && found == Vector3::zeros());
    }
}
