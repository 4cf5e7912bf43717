//! The flow around one body at an instant.
//!
//! In the frame of the body, near its centre, the potential of the wind is its value there, plus a symmetric part, which is the gradient
//! of something, plus half of the velocity × r. The first two have no curl and are subtracted, so that the layer around the body
//! bends the wind no more than it has to. What is left has its tangential part ramped to zero at the surface. The velocity of the surface,
//! v + ω × r, has the potential v × r/2 + (ω × r) × r/3 and is subtracted, too: the flow relative to the body does not pass it.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use crate::lattice::curl;
use crate::obstacle::{Obstacle, ramp};
use crate::snapshot::Snapshot;

/// A body at an instant, and the wind at its centre.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    pub(crate) obstacle: Arc<dyn Obstacle>,
    centre: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    pub(crate) layer: f64,
    /// The potential at the centre, and the symmetric part of its derivatives.
    potential: Vector3<f64>,
    stretching: Matrix3<f64>,
    /// The velocity at the centre that the potential does not have.
    rest: Vector3<f64>,
}

impl Body {
    /// The body in the wind of a snapshot, of which everything but the bodies is ready.
    pub(crate) fn new(obstacle: &Arc<dyn Obstacle>, time: f64, wind: &Snapshot) -> Body {
        let centre = obstacle.centre(time);
        let (potential, derivatives) = wind.potential(centre);
        Body {
            obstacle: Arc::clone(obstacle),
            centre,
            velocity: obstacle.velocity(time),
            spin: obstacle.spin(time),
            layer: obstacle.layer(),
            potential,
            stretching: (derivatives + derivatives.transpose()) * 0.5,
            rest: wind.stream(centre).rest,
        }
    }

    /// The velocity of a point of the body.
    pub(crate) fn velocity_at(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.spin.cross(&(x - self.centre))
    }

    /// The velocity that a body at this distance takes away from the wind. `potential` is that of the wind with its derivatives,
    /// `rest` the velocity that the potential does not have.
    pub(crate) fn turn_aside(
        &self,
        time: f64,
        x: Vector3<f64>,
        distance: f64,
        (potential, derivatives): (Vector3<f64>, Matrix3<f64>),
        rest: Vector3<f64>,
    ) -> Vector3<f64> {
        let r = x - self.centre;
        let relative = (self.rest - self.velocity) * 0.5;
        let (turning, turning_first) = turning(self.spin, r);
        let a = potential + relative.cross(&r) - self.potential - self.stretching * r - turning;
        let first = derivatives + relative.cross_matrix() - self.stretching - turning_first;
        let (normal, bending) = self.obstacle.bending(x, time);
        // The tangential part a - n(n·a), and its curl; the normal has none.
        let outward = normal.dot(&a);
        let along = a - normal * outward;
        let outward_gradient = first.transpose() * normal + bending.transpose() * a;
        let along_curl = curl(&first) - outward_gradient.cross(&normal);
        let [value, slope, _] = ramp(distance / self.layer);
        let potential_part = along_curl * (1.0 - value) - normal.cross(&along) * (slope / self.layer);
        // What has no potential, beyond its value at the centre: no air passes the surface, but the divergence is not zero.
        potential_part + normal * (normal.dot(&(rest - self.rest)) * (1.0 - value))
    }
}

/// A potential of the velocity of a rotation, ω × r, and its derivatives: (ω × r) × r/3, since a velocity that is linear in r without
/// divergence is the curl of a third of its product with r.
fn turning(spin: Vector3<f64>, r: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let along = spin.dot(&r);
    let value = r * along - spin * r.norm_squared();
    let first = Matrix3::identity() * along + r * spin.transpose() - spin * r.transpose() * 2.0;
    (value / 3.0, first / 3.0)
}
