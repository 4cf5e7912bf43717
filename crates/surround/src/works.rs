//! What acts on the columns of a model in a tick: the bodies of a string, and what is poured.

use dlsys_diagnostic::Span;
use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle;
use dlsys_ground as ground;
use dlsys_model::Model;
use dlsys_tree::ModuleString;

use crate::Error;
use crate::descent::Descent;
use crate::motion::Motion;
use crate::place::Place;
use crate::pressing::{Placed, placed};

/// Ticks of the ground in a second.
pub const TICKS: f64 = 120.0;
/// Patches of bodies are as near to theirs as this part of a column.
const ACCURACY: f64 = 0.1;

/// A model with ground that gives way.
#[derive(Clone, Copy)]
pub(crate) struct Works<'m> {
    pub(crate) model: &'m Model,
    pub(crate) place: Place,
    /// Ticks in a second.
    pub(crate) ticks: f64,
}

impl<'m> Works<'m> {
    /// The bodies of a string, each with its place in that of the tick before.
    pub(crate) fn bodies(
        &self,
        string: &ModuleString,
        (past, descent): (&[Placed], &Descent),
        scene: &mut Scene,
        motion: Option<&Motion<'m>>,
    ) -> Result<Vec<Placed>, Error> {
        let scenery = &self.model.scenery;
        let counts = |kind| scenery.solids.iter().chain(&scenery.shelves).any(|(own, _)| *own == kind);
        if !string.iter().any(|module| counts(module.kind)) {
            return Ok(Vec::new());
        }
        let bent = motion.map(|motion| motion.at(string)).transpose()?;
        let strains = bent.as_ref().map(|bent| bent as &dyn turtle::Strains);
        let cell = scenery.bed.as_ref().map_or(1.0, |bed| bed.cell);
        let drawn = turtle::bodies(self.model, string, strains, ACCURACY * cell, scene)?;
        let name = |body: &turtle::DrawnBody| self.model.kinds.get(body.origin.kind).name.clone();
        Ok(placed(drawn, past, descent, self.place.units.length, name))
    }

    /// What is poured up to a tick, at the rates and places of the middle of its time.
    pub(crate) fn pours(&self, next: u64) -> Result<Vec<ground::Pour>, Error> {
        let metre = self.place.units.length;
        let time = self.place.time_at((next as f64 - 0.5) / self.ticks);
        let mut pours = Vec::new();
        for (number, pour) in self.model.scenery.pours.iter().enumerate() {
            let rate = pour.rate.eval_one(&[time]) / self.place.units.time;
            let impossible = || Error::Pour { rate: rate * self.place.units.time, time, span: pour.span };
            if !(rate >= 0.0 && rate.is_finite()) {
                return Err(impossible());
            }
            if rate == 0.0 {
                continue;
            }
            let (place, rate) = match &pour.place {
                None => (ground::Place::Everywhere, rate * metre),
                Some((program, radius)) => {
                    let mut at = [f64::NAN; 3];
                    program.eval(&[time], &mut Vec::new(), &mut at);
                    if at.iter().any(|at| !at.is_finite()) {
                        return Err(impossible());
                    }
                    let centre = [at[0] * metre, at[2] * metre];
                    (ground::Place::Disc { centre, radius: radius * metre }, rate * metre.powi(3))
                }
            };
            pours.push(ground::Pour { id: number as u64, place, rate });
        }
        Ok(pours)
    }

    /// The time of the model at a tick.
    pub(crate) fn time_of(&self, number: u64) -> f64 {
        self.place.time_at(number as f64 / self.ticks)
    }

    /// The declaration of the ground.
    pub(crate) fn span(&self) -> Span {
        self.model.scenery.bed.as_ref().map(|bed| bed.span).unwrap_or_default()
    }

    /// The failure of a ground with its place in the text: that of the body, of what is poured, or of the ground.
    pub(crate) fn failed(&self, error: ground::Error, time: f64) -> Error {
        let scenery = &self.model.scenery;
        let name = match &error {
            ground::Error::Open { name, .. }
            | ground::Error::Outside { name, .. }
            | ground::Error::Body { name, .. }
            | ground::Error::Fast { name, .. } => Some(name.as_str()),
            _ => None,
        };
        let declared = || {
            let mut bodies = scenery.solids.iter().chain(&scenery.shelves);
            let is_it = |name: &str| bodies.find(|(kind, _)| *self.model.kinds.get(*kind).name == *name);
            name.and_then(is_it).map(|(_, span)| *span)
        };
        let poured = matches!(&error, ground::Error::Height { name, .. } if *name != "the ground")
            || matches!(&error, ground::Error::Outside { name, .. } if name == "a pour");
        let pour = scenery.pours.first().filter(|_| poured).map(|pour| pour.span);
        let span = declared().or(pour).unwrap_or_else(|| self.span());
        Error::Ground { error, time, metre: self.place.units.length, span }
    }
}
