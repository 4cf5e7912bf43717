//! Impulses of the ground and of solids on a body: Coulomb's friction, restitution, resistance to rolling.

use nalgebra::Matrix3;

use crate::forces::Dynamics;
use crate::{Motion, Surface, Vector};

/// Largest number of sweeps over the contacts that are pushed.
const SWEEPS: usize = 100;
/// Error of velocities in parts of the largest one.
const ACCURACY: f64 = 1e-9;

/// A contact that may be pushed.
#[derive(Clone)]
pub(crate) struct Bound {
    /// From the centre of mass to the point of contact, in the axes of the world.
    pub(crate) arm: Vector,
    /// From the axes of the contact, of which the second one is the normal, to those of the world.
    pub(crate) frame: Matrix3<f64>,
    /// Velocity of what is touched, at the contact.
    pub(crate) surface: Vector,
    /// The motion of what is touched as a rigid one.
    pub(crate) carrier: Carrier,
    /// The radius of the body there.
    pub(crate) radius: f64,
    /// The least velocity along the normal after the impulses, relative to what is touched.
    pub(crate) least: f64,
    pub(crate) grip: Surface,
    /// The number of what is touched.
    pub(crate) number: usize,
}

/// A rigid motion that carries a body along: velocity at the body's centre of mass, and angular velocity in the axes of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Carrier {
    pub(crate) velocity: Vector,
    pub(crate) spin: Vector,
}

impl Carrier {
    /// A motion as it is relative to the carrier.
    pub(crate) fn relative(&self, motion: &Motion) -> Motion {
        let velocity = motion.velocity - self.velocity;
        let spin = motion.spin - motion.attitude.inverse_transform_vector(&self.spin);
        Motion { velocity, spin, ..*motion }
    }

    /// A motion with the velocity and the spin relative to the carrier times a factor.
    pub(crate) fn slowed(&self, motion: &Motion, factor: f64) -> Motion {
        let relative = self.relative(motion);
        let own = motion.attitude.inverse_transform_vector(&self.spin);
        Motion {
            velocity: self.velocity + relative.velocity * factor,
            spin: own + relative.spin * factor,
            ..*motion
        }
    }
}

/// A contact that is pushed.
struct Touch {
    bound: Bound,
    response: Response,
    /// In the axes of the contact.
    impulse: Vector,
    /// The impulse before the sweep, and the direction in which it goes on after the sweep.
    last: Vector,
    direction: Vector,
    /// Impulsive moment against rolling.
    moment: Vector,
}

/// The rates of a body by an impulse at a contact, in the axes of the contact.
struct Response {
    /// Velocity of the contact, in its axes.
    at_contact: Matrix3<f64>,
    /// The impulse by a velocity of the contact: the inverse.
    stick: Matrix3<f64>,
    /// Velocity of the centre of mass and angular velocity, in the axes of the world.
    light: Matrix3<f64>,
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

/// The motion after impulses at contacts, and the number of what pushed most, if anything did. Kinetic energy relative to what is touched is not larger than
/// before, and where several things that move are touched, contacts do no work.
///
/// Impulses are found by projected Gauss-Seidel iteration (Jean, *The non-smooth contact dynamics method*, Comput. Methods Appl. Mech. Eng. 177,
/// 1999): each contact in turn gets the impulse that satisfies its own law.
pub(crate) fn collide(dynamics: &Dynamics, motion: &Motion, bounds: Vec<Bound>) -> (Motion, Option<usize>) {
    let moves = |bound: &Bound| bound.carrier != Carrier::default();
    // Rebounds from several things that move may add energy: these impacts are without any.
    let again = bounds.iter().any(moves).then(|| bounds.clone());
    let (mut after, touches) = impelled(dynamics, motion, bounds);
    let mut pushing = touches.iter().filter(|touch| touch.impulse.y > 0.0);
    let Some(first) = pushing.next() else { return (*motion, None) };
    let carrier = first.bound.carrier;
    if pushing.all(|touch| touch.bound.carrier == carrier) {
        // Restitution with friction may add energy (Kane's paradox), and so may an iteration that has not converged.
        let [before, now] = [motion, &after].map(|motion| dynamics.kinetic_energy(&carrier.relative(motion)));
        if now > before {
            after = carrier.slowed(&after, libm::sqrt(before / now));
        }
    } else if let Some(bounds) = again
        && work(&touches, motion, &after) > 0.0
    {
        let stopped = |bound: Bound| Bound { least: bound.least.min(0.0), ..bound };
        after = impelled(dynamics, motion, bounds.into_iter().map(stopped).collect()).0;
    }
    let most = touches.iter().max_by(|a, b| a.impulse.y.total_cmp(&b.impulse.y));
    (after, most.map(|touch| touch.bound.number))
}

/// The motion after impulses, and these.
fn impelled(dynamics: &Dynamics, motion: &Motion, mut waiting: Vec<Bound>) -> (Motion, Vec<Touch>) {
    let mut moving = Moving::new(dynamics, motion);
    let scale =
        waiting.iter().map(|bound| (moving.at(&bound.arm) - bound.surface).norm()).fold(0.0, f64::max);
    let mut touches: Vec<Touch> = Vec::new();
    // Few contacts hold a body: those that the impulses at the others do not keep above their bounds.
    while let Some(worst) = worst(&waiting, &moving, ACCURACY * scale) {
        touches.push(Touch::new(waiting.swap_remove(worst), &moving));
        settle(&mut touches, &mut moving, ACCURACY * scale);
    }
    let spin = motion.attitude.inverse_transform_vector(&moving.spin);
    (Motion { velocity: moving.velocity, spin, ..*motion }, touches)
}

/// The work of impulses on a body, less that on what it touches.
fn work(touches: &[Touch], before: &Motion, after: &Motion) -> f64 {
    let mean = |touch: &Touch| {
        let at = |motion: &Motion| motion.velocity + motion.world_spin().cross(&touch.bound.arm);
        (at(before) + at(after)) / 2.0 - touch.bound.surface
    };
    touches.iter().map(|touch| (touch.bound.frame * touch.impulse).dot(&mean(touch))).sum()
}

/// The contact that moves most below its bound, by more than `error` (m/s).
fn worst(waiting: &[Bound], moving: &Moving, error: f64) -> Option<usize> {
    let below = waiting.iter().map(|bound| bound.least - moving.climb(bound));
    let worst = below.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    worst.filter(|(_, below)| *below > error).map(|(index, _)| index)
}

/// Iterates until impulses change velocities by less than `error` (m/s).
fn settle(touches: &mut [Touch], moving: &mut Moving, error: f64) {
    let mut before = 0.0;
    for sweep in 1..=SWEEPS {
        let mut changed = 0.0_f64;
        for touch in &mut *touches {
            changed = changed.max(touch.correct(moving));
            touch.brake(moving);
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
        moving.velocity += touch.response.light * further;
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

    /// Velocity of a contact along its normal, relative to what it touches.
    fn climb(&self, bound: &Bound) -> f64 {
        let inverse = bound.frame.transpose();
        let (velocity, spin) = (inverse * (self.velocity - bound.surface), inverse * self.spin);
        let arm = inverse * bound.arm;
        velocity.y + spin.z * arm.x - spin.x * arm.z
    }

    fn response(&self, bound: &Bound) -> Response {
        let cross = bound.arm.cross_matrix();
        let spin = self.agile * cross;
        let at_contact = bound.frame.transpose() * (self.light - cross * spin) * bound.frame;
        // Positive definite; without an inverse, rounding has made it singular, and the contact slips.
        let stick = at_contact.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
        Response { at_contact, stick, light: self.light * bound.frame, spin: spin * bound.frame }
    }
}

impl Touch {
    fn new(bound: Bound, moving: &Moving) -> Touch {
        let [impulse, last, direction, moment] = [Vector::zeros(); 4];
        Touch { response: moving.response(&bound), bound, impulse, last, direction, moment }
    }

    /// Changes the impulse so that this contact satisfies its law, the others as they are; returns the change of its velocity.
    fn correct(&mut self, moving: &mut Moving) -> f64 {
        let Response { at_contact, stick, light, spin } = &self.response;
        let Bound { arm, frame, surface, least, grip, .. } = &self.bound;
        let excess = frame.transpose() * (moving.at(arm) - surface) - Vector::y() * *least;
        let stuck = self.impulse - *stick * excess;
        let limit = grip.friction * stuck.y;
        let wanted = if limit >= 0.0 && stuck.xz().norm_squared() <= limit * limit {
            stuck
        } else {
            slipping(&self.impulse, &excess, at_contact, grip.friction)
        };
        let change = wanted - self.impulse;
        self.impulse = wanted;
        moving.velocity += *light * change;
        moving.spin += *spin * change;
        (*at_contact * change).norm()
    }

    /// Changes the moment against rolling.
    fn brake(&mut self, moving: &mut Moving) {
        let limit = self.bound.grip.rolling * self.bound.radius * self.impulse.y;
        if limit <= 0.0 {
            return;
        }
        let spin = moving.spin - self.bound.carrier.spin;
        let response = (moving.agile * spin).norm();
        let stopped = if response > 0.0 { spin * (spin.norm() / response) } else { spin };
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
fn slipping(impulse: &Vector, excess: &Vector, at_contact: &Matrix3<f64>, friction: f64) -> Vector {
    // Neither eigenvalue of the response in the plane is above its trace, so steps along the gradient converge.
    let step = 1.0 / (at_contact[(0, 0)] + at_contact[(2, 2)]);
    let mut wanted = *impulse;
    wanted.y = (wanted.y - excess.y / at_contact[(1, 1)]).max(0.0);
    wanted.x -= excess.x * step;
    wanted.z -= excess.z * step;
    let (limit, sideways) = (friction * wanted.y, wanted.xz().norm());
    if sideways > limit {
        let share = limit / sideways;
        wanted.x *= share;
        wanted.z *= share;
    }
    wanted
}
