//! Growth under the forces of its sheets: rules read `force_x`, `force_y`, `force_z`.
//!
//! ```text
//! Sheets (a growth of its own, with the mechanics) ──ticks with forces──▶ Pushed ──▶ any simulation of the model
//! ```
//!
//! Forces are a function of the model and its settings. They are computed once for all copies of a simulation, when one of them first gets to a tick; so copies,
//! threads and orders do not change them, and growth that gets them does the same as the one that they were computed with.

use std::sync::{Arc, OnceLock};

use dlsys_model::Model;
use dlsys_sim::{self as sim, Failure, Inputs, Settings, Simulation, Surroundings};
use dlsys_tree::ModuleString;

use crate::coupled::failure;
use crate::descent::Descent;
use crate::line::Exerted;
use crate::place::Place;
use crate::{Error, Sheets};

/// Starts a simulation of a model whose rules read forces.
pub(crate) fn start<'m>(
    model: &'m Model,
    settings: Settings,
    place: Place,
) -> Result<Simulation<'m>, sim::Error> {
    let shared = Arc::new(Shared { model, settings, sheets: OnceLock::new() });
    let time = place.time_at(0.0).max(0.0);
    let pushed = Pushed { shared, place, tick: 0, part: 0, time };
    Simulation::with_surroundings(model, settings, Box::new(pushed))
}

/// The sheets of a model, for all copies of a simulation.
struct Shared<'m> {
    model: &'m Model,
    settings: Settings,
    sheets: OnceLock<Result<Option<Sheets<'m>>, Error>>,
}

impl<'m> Shared<'m> {
    fn sheets(&self) -> Result<Option<&Sheets<'m>>, Error> {
        let made = self.sheets.get_or_init(|| Sheets::and_soil(self.model, self.settings));
        made.as_ref().map(Option::as_ref).map_err(Clone::clone)
    }
}

/// Where a simulation is among the ticks of its sheets.
#[derive(Clone)]
struct Pushed<'m> {
    shared: Arc<Shared<'m>>,
    place: Place,
    /// The number of the next tick, and that of its part.
    tick: u64,
    part: usize,
    /// The time of the next part, in units of the model.
    time: f64,
}

impl Pushed<'_> {
    fn pass(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Error> {
        let begin = self.place.seconds(self.time);
        let tick = match self.shared.sheets()? {
            Some(sheets) => sheets.tick_of(self.tick as f64, self.time)?,
            None => Arc::default(),
        };
        let Some(part) = tick.parts.get(self.part) else {
            // No sheets, or growth fails before.
            self.time = f64::INFINITY;
            return Ok(());
        };
        let exerted = Exerted { forces: &part.forces, since: &Descent::default() };
        let length = part.end - begin;
        inputs.set_forces(string, |module| exerted.on(module.lineage.id).in_model(length, &self.place));
        self.time = self.place.time_at(part.end);
        self.part += 1;
        if self.part == tick.parts.len() {
            (self.tick, self.part) = (self.tick + 1, 0);
            if tick.failed.is_some() {
                self.time = f64::INFINITY;
            }
        }
        Ok(())
    }
}

impl Surroundings for Pushed<'_> {
    fn next_tick(&self) -> f64 {
        self.time
    }

    fn tick(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure> {
        self.pass(string, inputs).map_err(|error| failure(&error, string))
    }

    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a,
    {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        size_of::<Self>()
    }

    fn work(&self) -> u64 {
        /// The cost of a tick that has been computed.
        const TICK: u64 = 10;
        self.tick * TICK
    }
}
