//! Energy of a state.

use crate::forces::Stretch;
use crate::place::{Local, Place, Strain};
use crate::sweep::part;
use crate::{Error, Fixed, Skeleton, Solver, State, Vector};

/// Energy of a state, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// ½ m v² and ½ ω J ω of all parts.
    pub kinetic: f64,
    /// Of the bent tissue. Where the rest shape is an equilibrium, with the work of the moments that it has at rest.
    pub elastic: f64,
    /// Of the weight, zero at the origin of the world.
    pub potential: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.potential
    }
}

impl Solver {
    /// Velocities of the ends of all segments (world coordinates, m/s), with the prescribed motion.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance).
    pub fn velocities(&mut self, skeleton: &Skeleton, state: &State) -> Result<Vec<Vector>, Error> {
        self.skeleton.clear();
        self.renew(state, 0.0, &mut Fixed(skeleton))?;
        let mut places: Vec<Place> = Vec::with_capacity(skeleton.len());
        for (index, segment) in skeleton.segments().iter().enumerate() {
            let rate = if segment.rigid { Vector::zeros() } else { state.rate[index] };
            let strain = Strain { value: state.strain[index], rate, acceleration: Vector::zeros() };
            let parent = segment.parent.map(|parent| &places[parent]);
            places.push(Local::new(segment, parent, &Vector::zeros(), &strain).1);
        }
        Ok(places.iter().map(|place| place.axes * place.twist.linear).collect())
    }

    /// Energy of a state of a skeleton.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance).
    pub fn energy(&mut self, skeleton: &Skeleton, state: &State) -> Result<Energy, Error> {
        self.skeleton.clear();
        self.renew(state, 0.0, &mut Fixed(skeleton))?;
        let air = self.settings.air;
        let mut energy = Energy::default();
        let mut places: Vec<Place> = Vec::with_capacity(skeleton.len());
        for (index, segment) in skeleton.segments().iter().enumerate() {
            let (value, rate) = (state.strain[index], state.rate[index]);
            let rate = if segment.rigid { Vector::zeros() } else { rate };
            let strain = Strain { value, rate, acceleration: Vector::zeros() };
            let parent = segment.parent.map(|parent| &places[parent]);
            let (local, place) = Local::new(segment, parent, &Vector::zeros(), &strain);
            let stretch = Stretch::new(&local);
            let (kinetic, mass) = part(skeleton, &air, &self.work.rotary, index).motion(&local, &stretch);
            energy.kinetic += kinetic;
            let centre = place.origin * mass.0 + place.axes * mass.1;
            energy.potential -= air.gravity.dot(&centre);
            let moment = segment.rigidity().component_mul(&value) * 0.5 + self.work.rest_moments[index];
            energy.elastic += segment.length * moment.dot(&value);
            places.push(place);
        }
        Ok(energy)
    }
}
