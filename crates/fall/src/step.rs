//! One step of a fall: the pair of Bogacki and Shampine, and the motion within a step.

use crate::forces::Dynamics;
use crate::motion::{Packed, between, turn};
use crate::{Error, Motion, Vector, Wind};

/// The motion from one time to another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub(crate) start: f64,
    pub(crate) end: f64,
    pub(crate) first: Motion,
    pub(crate) last: Motion,
    /// Rotation vector from the first attitude to the last, in the axes of the first.
    turned: Vector,
    /// Rates of the rotation vector at both ends.
    turning: [Vector; 2],
}

impl Step {
    pub(crate) fn new(start: f64, first: Motion, end: f64, last: Motion) -> Step {
        let turned = between(first.attitude, last.attitude);
        // The rate of a rotation vector θ is ω + ½ θ×ω + ..., with ω in the turned axes.
        let rate = vector_rate(&turned, &last.spin);
        Step { start, end, first, last, turned, turning: [first.spin, rate] }
    }

    fn span(&self) -> f64 {
        self.end - self.start
    }

    /// The motion at a time within the step: cubics with the positions, attitudes and rates of both ends.
    pub(crate) fn at(&self, time: f64) -> Motion {
        let span = self.span();
        if span <= 0.0 || time <= self.start {
            return self.first;
        }
        let x = (time - self.start) / span;
        let rise = self.last.position - self.first.position;
        let (place, velocity) = cubic(x, rise, self.first.velocity * span, self.last.velocity * span);
        let (angle, turning) = cubic(x, self.turned, self.turning[0] * span, self.turning[1] * span);
        Motion {
            position: self.first.position + place,
            velocity: velocity / span,
            attitude: turn(self.first.attitude, angle),
            spin: spin(&angle, &(turning / span)),
        }
    }

    /// A bound of the second derivative of the height of a point of the body, at a distance from its centre, over the whole step, in m/s².
    pub(crate) fn bound(&self, distance: f64) -> f64 {
        let span = self.span();
        let rise = (self.last.position - self.first.position).y;
        let [u, v] = [self.first.velocity.y * span, self.last.velocity.y * span];
        // The second derivative of a cubic is linear: one of its ends is the largest.
        let lift = (6.0 * rise - 4.0 * u - 2.0 * v).abs().max((6.0 * rise - 2.0 * u - 4.0 * v).abs());
        self.bound_with(lift, distance)
    }

    /// The same of the place of the point, whatever the direction.
    pub(crate) fn curvature(&self, distance: f64) -> f64 {
        let span = self.span();
        let rise = (self.last.position - self.first.position) * 6.0;
        let [u, v] = [self.first.velocity * span, self.last.velocity * span];
        let bend = (rise - u * 4.0 - v * 2.0).norm().max((rise - u * 2.0 - v * 4.0).norm());
        self.bound_with(bend, distance)
    }

    /// A bound of the way of all points of a body within a distance from its centre, in m.
    pub(crate) fn swept(&self, distance: f64) -> f64 {
        let span = self.span();
        let [u, v] = self.turning.map(|rate| rate * span);
        let turn = (self.turned * 6.0 - u * 4.0 - v * 2.0)
            .norm()
            .max((self.turned * 6.0 - u * 2.0 - v * 4.0).norm());
        self.speed() * span + distance * (u.norm() + turn)
    }

    /// A bound of the speed of the centre of mass, in m/s.
    pub(crate) fn speed(&self) -> f64 {
        let span = self.span();
        let rise = self.last.position - self.first.position;
        let [u, v] = [self.first.velocity, self.last.velocity];
        // The derivative of a cubic is within the hull of three points.
        u.norm().max(v.norm()).max((rise * (3.0 / span) - u - v).norm())
    }

    /// With the bound of the centre of mass times the square of the length of the step.
    fn bound_with(&self, lift: f64, distance: f64) -> f64 {
        let span = self.span();
        let [u, v] = self.turning.map(|rate| rate * span);
        let turn = (self.turned * 6.0 - u * 4.0 - v * 2.0)
            .norm()
            .max((self.turned * 6.0 - u * 2.0 - v * 4.0).norm());
        // A bound of the rate of the rotation vector from its value at one end; the exponential does not expand.
        let rate = u.norm() + turn;
        (lift + distance * (turn + 2.0 * rate * rate)) / (span * span)
    }

    /// The part of the step up to a time.
    pub(crate) fn until(&self, time: f64) -> Step {
        Step::new(self.start, self.first, time, self.at(time))
    }
}

/// Value and derivative at x in 0..1 of the cubic from 0 to `rise` with derivatives `u` and `v` at its ends.
fn cubic(x: f64, rise: Vector, u: Vector, v: Vector) -> (Vector, Vector) {
    let square = rise * 3.0 - u * 2.0 - v;
    let cube = u + v - rise * 2.0;
    ((u + (square + cube * x) * x) * x, u + (square * 2.0 + cube * (3.0 * x)) * x)
}

/// Rate of a rotation vector, from the angular velocity in the turned axes: the inverse of the right Jacobian of rotations.
fn vector_rate(angle: &Vector, spin: &Vector) -> Vector {
    let size = angle.norm();
    let factor = if size < 1e-3 {
        1.0 / 12.0 + size * size / 720.0
    } else {
        let half = size / 2.0;
        (1.0 - half * libm::cos(half) / libm::sin(half)) / (size * size)
    };
    spin + angle.cross(spin) * 0.5 + angle.cross(&angle.cross(spin)) * factor
}

/// Angular velocity in the turned axes from the rate of a rotation vector: the right Jacobian of rotations.
fn spin(angle: &Vector, rate: &Vector) -> Vector {
    let size = angle.norm();
    let (first, second) = if size < 1e-3 {
        (0.5 - size * size / 24.0, 1.0 / 6.0 - size * size / 120.0)
    } else {
        let square = size * size;
        ((1.0 - libm::cos(size)) / square, (size - libm::sin(size)) / (square * size))
    };
    let across = angle.cross(rate);
    rate - across * first + angle.cross(&across) * second
}

/// A step in flight: the state at its end, the derivative there, and the error of the embedded solution of order 2. `rate` is the derivative at
/// its beginning, if it is known.
pub(crate) fn bogacki_shampine(
    dynamics: &Dynamics,
    (motion, rate): (&Motion, Option<Packed>),
    (start, end): (f64, f64),
    wind: &impl Wind,
) -> Result<(Motion, Packed, Packed), Error> {
    let (y, h) = (motion.pack(), end - start);
    let a = match rate {
        Some(rate) => rate,
        None => dynamics.derivative(&y, start, wind)?,
    };
    let b = dynamics.derivative(&(y + a * (h / 2.0)), start + h / 2.0, wind)?;
    let c = dynamics.derivative(&(y + b * (0.75 * h)), start + 0.75 * h, wind)?;
    let last = Motion::unpack(&(y + (a * (2.0 / 9.0) + b * (1.0 / 3.0) + c * (4.0 / 9.0)) * h));
    let d = dynamics.derivative(&last.pack(), end, wind)?;
    let error = (a * (-5.0 / 72.0) + b * (1.0 / 12.0) + c * (1.0 / 9.0) - d * 0.125) * h;
    Ok((last, d, error))
}
