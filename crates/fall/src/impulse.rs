//! Impulses of the ground on a body: Coulomb's friction, restitution, resistance to rolling.

use nalgebra::Matrix3;

use crate::forces::Dynamics;
use crate::{Body, Contact, Ground, Motion, Vector};

/// Largest number of sweeps over the contacts that are pushed.
const SWEEPS: usize = 100;
/// Error of velocities in parts of the largest one.
const ACCURACY: f64 = 1e-9;

/// A contact that may be pushed.
struct Bound {
    /// From the centre of mass to the lowest point, in the axes of the world.
    arm: Vector,
    radius: f64,
    /// The least velocity along y after the impulses.
    least: f64,
}

/// A contact that is pushed.
struct Touch {
    bound: Bound,
    response: Response,
    impulse: Vector,
    /// The impulse before the sweep, and the direction in which it goes on after the sweep.
    last: Vector,
    direction: Vector,
    /// Impulsive moment against rolling.
    moment: Vector,
}

/// The rates of a body by an impulse at a contact.
struct Response {
    /// Velocity of the contact.
    at_contact: Matrix3<f64>,
    /// The impulse by a velocity of the contact: the inverse.
    stick: Matrix3<f64>,
    /// Angular velocity.
    spin: Matrix3<f64>,
}

/// The rates of a body in the axes of the world, and the inverses of its inertia.
struct Moving {
    velocity: Vector,
    spin: Vector,
    /// Velocity by an impulse at the centre of mass.
    light: Matrix3<f64>,
    /// Angular velocity by an impulsive moment.
    agile: Matrix3<f64>,
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
    let mut moving = Moving::new(dynamics, motion);
    let mut waiting = bounds(body, ground, motion, &moving, demand);
    let scale = waiting.iter().map(|bound| moving.at(&bound.arm).norm()).fold(0.0, f64::max);
    let mut touches: Vec<Touch> = Vec::new();
    // Few contacts hold a body: those that the impulses at the others do not keep above their bounds.
    while let Some(worst) = worst(&waiting, &moving, ACCURACY * scale) {
        touches.push(Touch::new(waiting.swap_remove(worst), &moving));
        settle(&mut touches, ground, &mut moving, ACCURACY * scale);
    }
    let pushed = touches.iter().any(|touch| touch.impulse.y > 0.0);
    if !pushed {
        return (after, false);
    }
    after.velocity = moving.velocity;
    after.spin = motion.attitude.inverse_transform_vector(&moving.spin);
    // Restitution with friction may add energy (Kane's paradox), and so may an iteration that has not converged.
    let [before, now] = [motion, &after].map(|motion| dynamics.kinetic_energy(motion));
    if now > before {
        let factor = libm::sqrt(before / now);
        after.velocity *= factor;
        after.spin *= factor;
    }
    (after, pushed)
}

/// The contacts that may be pushed.
fn bounds(body: &Body, ground: &Ground, motion: &Motion, moving: &Moving, demand: Demand) -> Vec<Bound> {
    let turn = motion.attitude.to_rotation_matrix();
    let bound = |contact: &Contact| {
        let mut arm = turn * contact.point;
        arm.y -= contact.radius;
        let least = demand(motion.position.y + arm.y - ground.height, moving.climb(&arm))?;
        Some(Bound { arm, radius: contact.radius, least })
    };
    body.contacts.iter().filter_map(bound).collect()
}

/// The contact that moves most below its bound, by more than `error` (m/s).
fn worst(waiting: &[Bound], moving: &Moving, error: f64) -> Option<usize> {
    let below = waiting.iter().map(|bound| bound.least - moving.climb(&bound.arm));
    let worst = below.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    worst.filter(|(_, below)| *below > error).map(|(index, _)| index)
}

/// Iterates until impulses change velocities by less than `error` (m/s).
fn settle(touches: &mut [Touch], ground: &Ground, moving: &mut Moving, error: f64) {
    let mut before = 0.0;
    for sweep in 1..=SWEEPS {
        let mut changed = 0.0_f64;
        for touch in &mut *touches {
            changed = changed.max(touch.correct(ground, moving));
            touch.brake(ground, moving);
        }
        // The last impulses are within their cones.
        if changed <= error || sweep == SWEEPS {
            break;
        }
        before = go_on(touches, moving, before);
    }
}

/// Goes on in the direction of the sweeps so far, as in the method of conjugate gradients (Silcowitz-Hansen, Niebe, Erleben, *A nonsmooth
/// nonlinear conjugate gradient method for interactive contact force problems*, Vis. Comput. 26, 2010): contacts that are near to each other take
/// few sweeps then. Returns the square of the change by the last sweep; `before` is that of the sweep before.
fn go_on(touches: &mut [Touch], moving: &mut Moving, before: f64) -> f64 {
    let now = touches.iter().map(|touch| (touch.impulse - touch.last).norm_squared()).sum::<f64>();
    let share = if now < before { now / before } else { 0.0 };
    for touch in touches {
        let change = touch.impulse - touch.last;
        touch.last = touch.impulse;
        let further = touch.direction * share;
        touch.direction = change + further;
        touch.last += further;
        touch.impulse += further;
        moving.velocity += moving.light * further;
        moving.spin += touch.response.spin * further;
    }
    now
}

impl Moving {
    fn new(dynamics: &Dynamics, motion: &Motion) -> Moving {
        let (light, agile) = dynamics.inverse_inertia(motion);
        Moving { velocity: motion.velocity, spin: motion.world_spin(), light, agile }
    }

    /// Velocity of a point, from its place relative to the centre of mass.
    fn at(&self, arm: &Vector) -> Vector {
        self.velocity + self.spin.cross(arm)
    }

    /// Velocity of a point along y.
    fn climb(&self, arm: &Vector) -> f64 {
        self.velocity.y + self.spin.z * arm.x - self.spin.x * arm.z
    }

    fn response(&self, arm: &Vector) -> Response {
        let cross = arm.cross_matrix();
        let spin = self.agile * cross;
        let at_contact = self.light - cross * spin;
        // Positive definite; without an inverse, rounding has made it singular, and the contact slips.
        let stick = at_contact.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
        Response { at_contact, stick, spin }
    }
}

impl Touch {
    fn new(bound: Bound, moving: &Moving) -> Touch {
        let [impulse, last, direction, moment] = [Vector::zeros(); 4];
        Touch { response: moving.response(&bound.arm), bound, impulse, last, direction, moment }
    }

    /// Changes the impulse so that this contact satisfies its law, the others as they are; returns the change of its velocity.
    fn correct(&mut self, ground: &Ground, moving: &mut Moving) -> f64 {
        let Response { at_contact, stick, spin } = &self.response;
        let excess = moving.at(&self.bound.arm) - Vector::y() * self.bound.least;
        let stuck = self.impulse - *stick * excess;
        let limit = ground.friction * stuck.y;
        let wanted = if limit >= 0.0 && stuck.xz().norm_squared() <= limit * limit {
            stuck
        } else {
            slipping(&self.impulse, &excess, at_contact, ground)
        };
        let change = wanted - self.impulse;
        self.impulse = wanted;
        moving.velocity += moving.light * change;
        moving.spin += *spin * change;
        (*at_contact * change).norm()
    }

    /// Changes the moment against rolling.
    fn brake(&mut self, ground: &Ground, moving: &mut Moving) {
        let limit = ground.rolling * self.bound.radius * self.impulse.y;
        if limit <= 0.0 {
            return;
        }
        let response = (moving.agile * moving.spin).norm();
        let stopped =
            if response > 0.0 { moving.spin * (moving.spin.norm() / response) } else { moving.spin };
        let mut wanted = self.moment - stopped;
        let size = wanted.norm();
        if size > limit {
            wanted *= limit / size;
        }
        let change = wanted - self.moment;
        self.moment = wanted;
        moving.spin += moving.agile * change;
    }
}

/// The next impulse of a contact that slips, or lets go.
fn slipping(impulse: &Vector, excess: &Vector, at_contact: &Matrix3<f64>, ground: &Ground) -> Vector {
    // Neither eigenvalue of the response in the plane is above its trace, so steps along the gradient converge.
    let step = 1.0 / (at_contact[(0, 0)] + at_contact[(2, 2)]);
    let mut wanted = *impulse;
    wanted.y = (wanted.y - excess.y / at_contact[(1, 1)]).max(0.0);
    wanted.x -= excess.x * step;
    wanted.z -= excess.z * step;
    let (limit, sideways) = (ground.friction * wanted.y, wanted.xz().norm());
    if sideways > limit {
        let share = limit / sideways;
        wanted.x *= share;
        wanted.z *= share;
    }
    wanted
}
