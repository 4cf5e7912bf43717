//! The ground, and the search for the instant at which a body touches it.

use nalgebra::Matrix3;

use crate::error::check;
use crate::impulse::{Bound, Carrier};
use crate::step::Step;
use crate::{Body, Contact, Error, Motion, Surface, Vector};

/// Whether, and with which least velocity along its normal, a contact takes part: from its gap and its velocity.
pub(crate) type Demand<'a> = &'a dyn Fn(f64, f64) -> Option<f64>;

/// The number of the ground among what is touched.
pub(crate) const GROUND: usize = usize::MAX;

/// A level rigid floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Height in m.
    pub height: f64,
    /// Coulomb's coefficient of friction.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1: speed of a rebound relative to that of the impact.
    pub restitution: f64,
    /// Resistance of round contacts to rolling, in parts of their radius.
    pub rolling: f64,
}

impl Ground {
    /// A floor at a height in m, with a friction of 0.5, a restitution of 0.2 and a resistance to rolling of 0.02.
    pub fn at(height: f64) -> Ground {
        Ground { height, friction: 0.5, restitution: 0.2, rolling: 0.02 }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let Ground { height, friction, restitution, rolling } = *self;
        check("a height of the ground (m)", height, true, "a finite number")?;
        check("a friction", friction, friction >= 0.0, "0 or more")?;
        check("a restitution", restitution, (0.0..=1.0).contains(&restitution), "0 to 1")?;
        check("a resistance to rolling", rolling, rolling >= 0.0, "0 or more")
    }

    /// How what touches it is held.
    pub(crate) fn surface(&self) -> Surface {
        Surface { friction: self.friction, restitution: self.restitution, rolling: self.rolling }
    }

    /// The contacts that `demand` lets take part, with the least velocity upward that it gives: from height and velocity upward.
    pub(crate) fn bounds(&self, motion: &Motion, body: &Body, demand: Demand) -> Vec<Bound> {
        let (turn, spin) = (motion.attitude.to_rotation_matrix(), motion.world_spin());
        let bound = |contact: &Contact| {
            let mut arm = turn * contact.point;
            arm.y -= contact.radius;
            let climb = motion.velocity.y + spin.z * arm.x - spin.x * arm.z;
            let least = demand(motion.position.y + arm.y - self.height, climb)?;
            Some(Bound {
                arm,
                frame: Matrix3::identity(),
                surface: Vector::zeros(),
                carrier: Carrier::default(),
                radius: contact.radius,
                least,
                grip: self.surface(),
                number: GROUND,
            })
        };
        body.contacts.iter().filter_map(bound).collect()
    }

    /// Height of a contact above the ground, in m.
    pub(crate) fn gap(&self, motion: &Motion, contact: &Contact) -> f64 {
        motion.point(contact.point).y - contact.radius - self.height
    }

    /// Height of the lowest contact above the ground, in m; infinite without contacts.
    pub(crate) fn lowest(&self, motion: &Motion, body: &Body) -> f64 {
        let up = motion.attitude.inverse_transform_vector(&Vector::y());
        let low = body.contacts.iter().map(|contact| up.dot(&contact.point) - contact.radius);
        motion.position.y - self.height + low.fold(f64::INFINITY, f64::min)
    }

    /// The first time in a step at which a contact is lower than `-depth`, to within the time in which it sinks half of that; `None` if there
    /// is none.
    ///
    /// Between two samples, a height lies above their chord less an eighth of its largest second derivative times the square of the time between
    /// them. Intervals where that is not enough are halved, so no point dips into the ground and comes out between two samples.
    pub(crate) fn first_contact(&self, step: &Step, body: &Body, depth: f64) -> Option<f64> {
        let (reach, span) = (body.reach(), step.end - step.start);
        let curvature = step.bound(reach);
        // High above the ground, no contact matters.
        let lowest = step.first.position.y.min(step.last.position.y) - curvature * span * span / 8.0;
        if lowest - reach > self.height {
            return None;
        }
        let height = |time: f64| self.lowest(&step.at(time), body);
        let ends = [(step.start, height(step.start)), (step.end, height(step.end))];
        let crossed = self.search(&height, curvature, depth, ends, HALVINGS)?;
        let (mut above, mut below) = crossed;
        for _ in 0..60 {
            let middle = (above + below) / 2.0;
            let value = height(middle);
            if value < -depth {
                below = middle;
            } else {
                above = middle;
                if value < -0.5 * depth {
                    break;
                }
            }
        }
        Some(above)
    }

    /// Two times around the first crossing of `-depth` downward.
    fn search(
        &self,
        height: &impl Fn(f64) -> f64,
        curvature: f64,
        depth: f64,
        [from, to]: [(f64, f64); 2],
        halvings: u32,
    ) -> Option<(f64, f64)> {
        let span = to.0 - from.0;
        let sag = curvature * span * span / 8.0;
        if from.1.min(to.1) - sag > -depth {
            return None;
        }
        // A sag of a part of the depth cannot matter.
        if halvings == 0 || sag < 0.1 * depth {
            return (to.1 < -depth).then_some((from.0, to.0));
        }
        let middle = (from.0 + to.0) / 2.0;
        let middle = (middle, height(middle));
        self.search(height, curvature, depth, [from, middle], halvings - 1)
            .or_else(|| self.search(height, curvature, depth, [middle, to], halvings - 1))
    }
}

/// Largest depth of the search; its steps are shorter than the resolution of time then.
const HALVINGS: u32 = 48;
