//! Forces on solids that are linear in time, from tick to tick: how they follow from what a sheet did, and how growth gets them.
//!
//! What happens within a tick counts for a body by two numbers for each direction: the impulse, which is the change of momentum, and its integral over
//! time, which is the mass times the change of place. The line through both leads a mass to the place and the velocity where it was pushed.

use std::collections::BTreeMap;

use dlsys_sheet::Vector;
use dlsys_sim::{Force, Simulation};

use crate::Error;
use crate::descent::Descent;
use crate::place::Place;

/// A force in N at the beginning of a span of time, in the axes of the scene, and its rate in N/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Line {
    pub(crate) force: Vector,
    pub(crate) rate: Vector,
}

impl Line {
    pub(crate) fn constant(force: Vector) -> Line {
        Line { force, rate: Vector::zeros() }
    }

    /// With an impulse (N s) and its integral (N s²) over a length in s.
    pub(crate) fn through([impulse, integral]: [Vector; 2], length: f64) -> Line {
        let rate = (impulse * (length / 2.0) - integral) * (12.0 / (length * length * length));
        Line { force: impulse / length - rate * (length / 2.0), rate }
    }

    /// The impulse since the beginning, and its integral.
    pub(crate) fn moments(&self, time: f64) -> [Vector; 2] {
        let half = time * time / 2.0;
        [self.force * time + self.rate * half, self.force * half + self.rate * (half * time / 3.0)]
    }

    pub(crate) fn mean(&self, length: f64) -> Vector {
        self.force + self.rate * (length / 2.0)
    }

    pub(crate) fn plus(&self, other: &Line) -> Line {
        Line { force: self.force + other.force, rate: self.rate + other.rate }
    }

    pub(crate) fn minus(&self, other: &Line) -> Line {
        Line { force: self.force - other.force, rate: self.rate - other.rate }
    }

    /// In units and along the axes of a model, over a length in s.
    pub(crate) fn in_model(&self, length: f64, place: &Place) -> Force {
        let unit = place.units.time * place.units.time / place.units.length;
        let ends = [self.force, self.force + self.rate * length];
        let [from, to] = ends.map(|force| place.turn.transpose() * force * unit);
        [0, 1, 2].map(|axis| [from[axis], to[axis]])
    }
}

/// Forces on the modules that read them.
pub(crate) struct Exerted<'a> {
    pub(crate) forces: &'a BTreeMap<u64, Line>,
    /// The productions since the modules that have forces.
    pub(crate) since: &'a Descent,
}

impl Exerted<'_> {
    /// The force on a module.
    pub(crate) fn on(&self, module: u64) -> Line {
        self.since.line(module).find_map(|id| self.forces.get(&id)).copied().unwrap_or_default()
    }

    /// Growth that has reached the beginning of a span (beginning and length, in s) goes on under the forces.
    pub(crate) fn act(
        &self,
        growth: &mut Simulation,
        (begin, length): (f64, f64),
        place: &Place,
    ) -> Result<(), Error> {
        let span = (place.time_at(begin), length / place.units.time);
        let force = |module: dlsys_tree::Module| self.on(module.lineage.id).in_model(length, place);
        Ok(growth.give(span, |string, inputs| inputs.set_forces(string, force))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_the_moments_that_it_was_made_of() {
        let (impulse, integral) = (Vector::new(1.0, -2.0, 0.0), Vector::new(0.01, 0.002, -0.1));
        let line = Line::through([impulse, integral], 0.125);
        let [found, sum] = line.moments(0.125);
        assert!((found - impulse).norm() < 1e-14 && (sum - integral).norm() < 1e-14);
        assert!((line.mean(0.125) * 0.125 - impulse).norm() < 1e-14);
        let constant = Line::constant(Vector::x() * 3.0);
        let again = Line::through(constant.moments(0.5), 0.5);
        assert!(again.minus(&constant) == Line::default() && again.plus(&constant).force.x == 6.0);
    }
}
