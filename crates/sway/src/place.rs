//! Where the segments are, and how they move: one pass from the roots to the tips.
//!
//! Velocities and accelerations are vectors of the world as components in the base frame of their segment. Gravity enters as an
//! acceleration of the world upwards, so that minus mass times acceleration is the sum of weight and inertial force.

use crate::arc::Section;
use crate::form::{Twist, ZEROS, cross_columns};
use crate::{Matrix, Segment, Vector};

/// A segment in space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Axes and origin of the base frame in the world.
    pub axes: Matrix,
    pub origin: Vector,
    /// Base frame in the base frame of the parent: axes and origin.
    pub turn: Matrix,
    pub reach: Vector,
    /// End frame in the base frame.
    pub end: Matrix,
    pub tip: Vector,
    /// Derivatives of turn and place of the end by the strain, divided by the length: B and l C.
    pub turning: Matrix,
    pub shift: Matrix,
    /// Velocity and acceleration of the end frame.
    pub twist: Twist,
    pub rate: Twist,
    /// Velocity of the end frame by rates of strain only, as if joints and lengths stood still.
    pub flow: Twist,
}

impl Place {
    pub(crate) const ZERO: Place = Place {
        axes: ZEROS,
        origin: Vector::new(0.0, 0.0, 0.0),
        turn: ZEROS,
        reach: Vector::new(0.0, 0.0, 0.0),
        end: ZEROS,
        tip: Vector::new(0.0, 0.0, 0.0),
        turning: ZEROS,
        shift: ZEROS,
        twist: Twist::ZERO,
        rate: Twist::ZERO,
        flow: Twist::ZERO,
    };
}

/// The motion of a segment in its base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    pub length: f64,
    length_rate: f64,
    length_acceleration: f64,
    theta: Vector,
    theta_rate: Vector,
    theta_acceleration: Vector,
    base: Twist,
    rate: Twist,
    /// The end, where most of what is carried is.
    end: Motion,
}

/// The motion of a section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub section: Section,
    pub place: Vector,
    pub turning: Matrix,
    pub shift: Matrix,
    pub angular: Vector,
    pub velocity: Vector,
    pub angular_acceleration: Vector,
    pub acceleration: Vector,
}

/// Strain beyond rest, its rate and its acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strain {
    pub value: Vector,
    pub rate: Vector,
    pub acceleration: Vector,
}

impl Local {
    /// Places a segment behind its parent. `upwards` is minus gravity.
    #[inline(always)]
    pub(crate) fn new(
        segment: &Segment,
        parent: Option<&Place>,
        upwards: &Vector,
        strain: &Strain,
    ) -> (Local, Place) {
        let joint = &segment.joint;
        let mut place = Place::ZERO;
        let (base, rate);
        match parent {
            None => {
                place.turn = joint.rotation;
                place.reach = joint.offset;
                place.axes = joint.rotation;
                place.origin = joint.offset;
                let back = |vector: &Vector| place.turn.tr_mul(vector);
                base = Twist { angular: back(&joint.angular_velocity), linear: back(&joint.velocity) };
                rate = Twist {
                    angular: back(&joint.angular_acceleration),
                    linear: back(&(joint.acceleration + upwards)),
                };
            }
            Some(parent) => {
                place.turn = parent.end * joint.rotation;
                let offset = parent.end * joint.offset;
                place.reach = parent.tip + offset;
                place.axes = parent.axes * place.turn;
                place.origin = parent.origin + parent.axes * place.reach;
                let carry = |vector: &Vector| parent.end * vector;
                let (twist, accelerated) = (&parent.twist, &parent.rate);
                let (spin, slide) = (carry(&joint.angular_velocity), carry(&joint.velocity));
                let back = |vector: Vector| place.turn.tr_mul(&vector);
                let lever = twist.angular.cross(&offset);
                base =
                    Twist { angular: back(twist.angular + spin), linear: back(twist.linear + lever + slide) };
                rate = Twist {
                    angular: back(
                        accelerated.angular + twist.angular.cross(&spin) + carry(&joint.angular_acceleration),
                    ),
                    linear: back(
                        accelerated.linear
                            + accelerated.angular.cross(&offset)
                            + twist.angular.cross(&(lever + slide * 2.0))
                            + carry(&joint.acceleration),
                    ),
                };
            }
        }
        let kappa = segment.rest + strain.value;
        let kappa_rate = segment.rest_rate + strain.rate;
        let kappa_acceleration = segment.rest_acceleration + strain.acceleration;
        let mut local = Local {
            length: segment.length,
            length_rate: segment.length_rate,
            length_acceleration: segment.length_acceleration,
            theta: kappa * segment.length,
            theta_rate: kappa * segment.length_rate + kappa_rate * segment.length,
            theta_acceleration: kappa * segment.length_acceleration
                + kappa_rate * (2.0 * segment.length_rate)
                + kappa_acceleration * segment.length,
            base,
            rate,
            end: Motion::ZERO,
        };
        let end = local.motion(1.0);
        local.end = end;
        place.end = end.section.rotation();
        place.tip = end.place;
        place.turning = end.turning;
        place.shift = end.shift;
        place.twist = Twist { angular: end.angular, linear: end.velocity };
        place.rate = Twist { angular: end.angular_acceleration, linear: end.acceleration };
        let mut flow = Twist::ZERO;
        if let Some(parent) = parent {
            let arm = place.reach - parent.tip;
            flow.angular = place.turn.tr_mul(&parent.flow.angular);
            flow.linear = place.turn.tr_mul(&parent.flow.at(&arm));
        }
        let swing = strain.rate * segment.length;
        place.flow.linear = flow.at(&place.tip) + place.shift * swing;
        place.flow.angular = flow.angular + place.turning * swing;
        (local, place)
    }

    /// The motion of a section that carries something.
    #[inline(always)]
    pub(crate) fn carrier(&self, xi: f64) -> Motion {
        if xi == 1.0 { self.end } else { self.motion(xi) }
    }

    /// The section at a fraction of the length.
    #[inline(always)]
    pub(crate) fn motion(&self, xi: f64) -> Motion {
        let l = self.length;
        let section = Section::new(&self.theta, xi);
        let shape = section.place();
        let (turning, change) = (section.turning(), section.shift());
        let rate = &self.theta_rate;
        let place = shape * l;
        let slope = change * rate;
        let slide = slope * l + shape * self.length_rate;
        let slide_rate = (change * self.theta_acceleration + section.shift_rate(rate)) * l
            + slope * (2.0 * self.length_rate)
            + shape * self.length_acceleration;
        let spin = turning * rate;
        let spin_rate = turning * self.theta_acceleration + section.turning_rate(rate);
        let (omega, alpha) = (&self.base.angular, &self.rate.angular);
        let swing = omega.cross(&place);
        Motion {
            section,
            place,
            turning,
            shift: change * l,
            angular: omega + spin,
            velocity: self.base.linear + swing + slide,
            angular_acceleration: alpha + omega.cross(&spin) + spin_rate,
            acceleration: self.rate.linear
                + alpha.cross(&place)
                + omega.cross(&(swing + slide * 2.0))
                + slide_rate,
        }
    }

    /// The section at a fraction: shape only.
    #[inline(always)]
    pub(crate) fn section(&self, xi: f64) -> Section {
        Section::new(&self.theta, xi)
    }
}

impl Motion {
    const ZERO: Motion = {
        let zero = Vector::new(0.0, 0.0, 0.0);
        Motion {
            section: Section::ZERO,
            place: zero,
            turning: ZEROS,
            shift: ZEROS,
            angular: zero,
            velocity: zero,
            angular_acceleration: zero,
            acceleration: zero,
        }
    };

    /// Derivative by the strain, divided by the length, of a point that the section carries at `arm`.
    #[inline(always)]
    pub(crate) fn shift_at(&self, arm: &Vector) -> Matrix {
        self.shift - cross_columns(arm, &self.turning)
    }

    /// Velocity of such a point.
    #[inline(always)]
    pub(crate) fn velocity_at(&self, arm: &Vector) -> Vector {
        self.velocity + self.angular.cross(arm)
    }

    /// Acceleration of such a point.
    #[inline(always)]
    pub(crate) fn acceleration_at(&self, arm: &Vector) -> Vector {
        self.acceleration
            + self.angular_acceleration.cross(arm)
            + self.angular.cross(&self.angular.cross(arm))
    }
}
