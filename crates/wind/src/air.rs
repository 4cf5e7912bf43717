//! The velocity of the air as bodies in it see it: a function of place and time, whatever computes it.

use nalgebra::Vector3;

/// Velocity of the air.
///
/// Every closure `Fn(Vector3<f64>, f64) -> Vector3<f64>` is one. It must be a pure function: what bends or falls in it is computed in any order.
pub trait Wind {
    /// Velocity in m/s at a point (world coordinates, m) and a time (s).
    fn velocity(&self, point: Vector3<f64>, time: f64) -> Vector3<f64>;
}

impl<F: Fn(Vector3<f64>, f64) -> Vector3<f64>> Wind for F {
    fn velocity(&self, point: Vector3<f64>, time: f64) -> Vector3<f64> {
        self(point, time)
    }
}

/// Air that does not move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Still;

impl Wind for Still {
    fn velocity(&self, _: Vector3<f64>, _: f64) -> Vector3<f64> {
        Vector3::zeros()
    }
}
