//! Impulses of the ground on a body: Coulomb's friction, restitution, resistance to rolling.

use nalgebra::Matrix3;

use crate::forces::Dynamics;
use crate::{Body, Ground, Motion, Vector};

/// Largest number of sweeps over all contacts.
const SWEEPS: usize = 60;

/// A contact that may be pushed.
struct Touch {
    /// From the centre of mass to the lowest point, in the axes of the world.
    arm: Vector,
    radius: f64,
    /// The least velocity along y after the impulses.
    least: f64,
    /// Velocity of the point by an impulse at it.
    response: Matrix3<f64>,
    impulse: Vector,
    /// Impulsive moment against rolling.
    moment: Vector,
}

/// Whether, and with which least velocity upward, a contact takes part: from its height and its velocity.
pub(crate) type Demand<'a> = &'a dyn Fn(f64, f64) -> Option<f64>;

/// The motion after impulses of the ground at the contacts that `demand` lets take part, and whether there were any. Kinetic energy is not
/// larger than before.
///
/// Impulses are found by projected Gauss-Seidel iteration (Jean, *The non-smooth contact dynamics method*, Comput. Methods Appl. Mech. Eng. 177,
/// 1999): each contact in turn gets the impulse that satisfies its own law.
pub(crate) fn collide(
    dynamics: &Dynamics,
    body: &Body,
    ground: &Ground,
    motion: &Motion,
    demand: Demand,
) -> (Motion, bool) {
    let mut after = *motion;
    let mut touches = touches(dynamics, body, ground, motion, demand);
    if touches.is_empty() {
        return (after, false);
    }
    let scale = touches.iter().map(|touch| velocity(motion, touch).norm()).fold(0.0, f64::max);
    for _ in 0..SWEEPS {
        let mut changed = 0.0_f64;
        for touch in &mut touches {
            let change = touch.correct(ground, &after);
            apply(dynamics, &mut after, touch.arm.cross(&change), change);
            changed = changed.max((touch.response * change).norm());
            let change = touch.brake(dynamics, ground, &after);
            apply(dynamics, &mut after, change, Vector::zeros());
        }
        if changed <= 1e-9 * scale {
            break;
        }
    }
    let pushed = touches.iter().any(|touch| touch.impulse.y > 0.0);
    // Restitution with friction may add energy (Kane's paradox), and so may an iteration that has not converged.
    let [before, now] = [motion, &after].map(|motion| dynamics.kinetic_energy(motion));
    if now > before {
        let factor = libm::sqrt(before / now);
        after.velocity *= factor;
        after.spin *= factor;
    }
    (after, pushed)
}

fn touches(dynamics: &Dynamics, body: &Body, ground: &Ground, motion: &Motion, demand: Demand) -> Vec<Touch> {
    let mut touches = Vec::new();
    for contact in &body.contacts {
        let arm = motion.turned(contact.point) - Vector::y() * contact.radius;
        let mut touch = Touch {
            arm,
            radius: contact.radius,
            least: 0.0,
            response: Matrix3::zeros(),
            impulse: Vector::zeros(),
            moment: Vector::zeros(),
        };
        let Some(least) = demand(ground.gap(motion, contact), velocity(motion, &touch).y) else { continue };
        touch.least = least;
        for axis in 0..3 {
            let mut unit = Vector::zeros();
            unit[axis] = 1.0;
            let spin = motion.turned(dynamics.twisted(motion, arm.cross(&unit)));
            touch.response.set_column(axis, &(dynamics.pushed(motion, unit) + spin.cross(&arm)));
        }
        touches.push(touch);
    }
    touches
}

fn velocity(motion: &Motion, touch: &Touch) -> Vector {
    motion.velocity + motion.world_spin().cross(&touch.arm)
}

fn apply(dynamics: &Dynamics, motion: &mut Motion, moment: Vector, impulse: Vector) {
    motion.velocity += dynamics.pushed(motion, impulse);
    motion.spin += dynamics.twisted(motion, moment);
}

impl Touch {
    /// The change of the impulse by which this contact satisfies its law, the others as they are.
    fn correct(&mut self, ground: &Ground, motion: &Motion) -> Vector {
        let excess = velocity(motion, self) - Vector::y() * self.least;
        // Neither eigenvalue of the response in the plane is above its trace, so steps along the gradient converge.
        let step = 1.0 / (self.response[(0, 0)] + self.response[(2, 2)]);
        let mut wanted = self.impulse;
        wanted.y = (wanted.y - excess.y / self.response[(1, 1)]).max(0.0);
        wanted.x -= excess.x * step;
        wanted.z -= excess.z * step;
        let (limit, sideways) = (ground.friction * wanted.y, wanted.x.hypot(wanted.z));
        if sideways > limit {
            let share = limit / sideways;
            wanted.x *= share;
            wanted.z *= share;
        }
        let change = wanted - self.impulse;
        self.impulse = wanted;
        change
    }

    /// The change of the moment against rolling.
    fn brake(&mut self, dynamics: &Dynamics, ground: &Ground, motion: &Motion) -> Vector {
        let limit = ground.rolling * self.radius * self.impulse.y;
        if limit <= 0.0 {
            return Vector::zeros();
        }
        let spin = motion.world_spin();
        let response = dynamics.twisted(motion, spin).norm();
        let stopped = if response > 0.0 { spin * (spin.norm() / response) } else { spin };
        let mut wanted = self.moment - stopped;
        let size = wanted.norm();
        if size > limit {
            wanted *= limit / size;
        }
        let change = wanted - self.moment;
        self.moment = wanted;
        change
    }
}
