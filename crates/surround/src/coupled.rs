//! Coupling both ways: rules read the strain of their stems, and what they change acts back at the next tick.
//!
//! Growth and stems advance in lock step. At a tick the stems are advanced to the next one, with growth going on at its present rates;
//! until then the strains that rules read are linear in time, so events on them are located like any other. A little before each
//! tick is a second one, at which the string is noted for the rates of growth.

use std::sync::Arc;

use dlsys_model::Model;
use dlsys_sim::{self as sim, Failure, Inputs, Settings, Simulation, Surroundings};
use dlsys_sway::{self as sway, Vector};
use dlsys_tree::ModuleString;

use crate::bending::{Bending, Tick};
use crate::course::LOOK_BACK;
use crate::descent::Descent;
use crate::layers;
use crate::motion::Passive;
use crate::place::Place;
use crate::pushed;
use crate::reading;
use crate::sampler::Sampler;
use crate::weather::Weather;
use crate::{CLOCK, Error};

/// Starts a simulation of a model, in the surroundings that its rules read, if they read any.
///
/// # Errors
/// As of [`Simulation::new`], and if the wind has no meaning.
pub fn start<'m>(model: &'m Model, settings: Settings, place: Place) -> Result<Simulation<'m>, sim::Error> {
    reading::bind(model).map_err(|error| beginning(&error))?;
    if model.reads_force() {
        return pushed::start(model, settings, place);
    }
    if let Some(layers) = reading::layers(model).map_err(|error| beginning(&error))? {
        return layers::start(model, settings, (place, layers));
    }
    if !model.reads_strain() || model.scenery.tissues.is_empty() {
        return Simulation::new(model, settings);
    }
    let shared = Arc::new(model.clone());
    let solver = Passive::of(settings.bending).solver;
    let time = place.time_of(place.first_tick()).max(0.0);
    let coupled = Coupled { model: shared, place, solver, course: None, time };
    Simulation::with_surroundings(model, settings, Box::new(coupled))
}

/// The error of surroundings that cannot begin.
fn beginning(error: &Error) -> sim::Error {
    sim::Error::of_beginning(failure(error, &ModuleString::default()))
}

/// The stems of a model in lock step with its growth.
#[derive(Clone)]
struct Coupled {
    model: Arc<Model>,
    place: Place,
    solver: sway::Settings,
    /// The stems, once the first tick has passed.
    course: Option<Course>,
    /// The time of the next tick, in units of the model.
    time: f64,
}

#[derive(Clone)]
struct Course {
    bending: Bending<'static, Arc<Model>>,
    number: u64,
    tick: Arc<Tick>,
    /// Productions since the present tick.
    descent: Descent,
    /// The string a little before the next tick, once it has been noted.
    earlier: Option<Arc<ModuleString>>,
}

impl Coupled {
    /// A little before the tick of a number.
    fn before(&self, number: u64) -> f64 {
        self.place.time_of(number) - LOOK_BACK * CLOCK / self.place.units.time
    }

    fn begin(&self, string: &ModuleString) -> Result<Course, Error> {
        let sampler = Arc::new(Sampler::new(Weather::without_solids(&self.model.scenery)?, self.place));
        let mut bending = Bending::new(self.model.clone(), sampler, self.place, self.solver);
        let number = self.place.first_tick();
        let tick = Arc::new(bending.advance(number, string, None)?);
        Ok(Course { bending, number, tick, descent: Descent::default(), earlier: None })
    }

    /// Passes a tick; the new course, and the time up to which its strains are known.
    fn pass(&mut self, string: &ModuleString, inputs: &Inputs) -> Result<f64, Error> {
        let Some(mut course) = self.course.take() else {
            let course = self.begin(string)?;
            let next = self.before(course.number + 1);
            self.course = Some(course);
            return Ok(next);
        };
        course.descent.add(&self.model, inputs.productions());
        let next = match course.earlier.take() {
            None => {
                course.earlier = Some(Arc::new(string.clone()));
                self.place.time_of(course.number + 1)
            }
            Some(earlier) => {
                course.number += 1;
                let earlier = inputs.productions().is_empty().then_some(&*earlier);
                let before = Some((&*course.tick, &course.descent, earlier));
                course.tick = Arc::new(course.bending.advance(course.number, string, before)?);
                course.descent = Descent::default();
                self.before(course.number + 1)
            }
        };
        self.course = Some(course);
        Ok(next)
    }
}

impl Surroundings for Coupled {
    fn next_tick(&self) -> f64 {
        self.time
    }

    fn tick(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure> {
        let next = self.pass(string, inputs).map_err(|error| failure(&error, string))?;
        self.time = next;
        let Some(course) = &self.course else { return Ok(()) };
        let seconds = self.place.seconds(next);
        let mut depth = 0;
        let mut readers = inputs.readers().to_vec().into_iter().peekable();
        let mut found = Vec::with_capacity(readers.len());
        for (index, module) in string.iter().enumerate() {
            if module.kind == dlsys_model::KindId::OPEN {
                depth += 1;
            } else if module.kind == dlsys_model::KindId::CLOSE {
                depth -= 1;
            }
            if readers.next_if_eq(&index).is_some() {
                found.push(course.tick.largest(module.lineage.id, depth, &course.descent, seconds));
            }
        }
        inputs.strain_mut().copy_from_slice(&found);
        Ok(())
    }

    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a,
    {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        self.course.as_ref().map_or(0, |course| course.tick.size() * 2 * size_of::<Vector>())
    }

    fn work(&self) -> u64 {
        /// The cost of a stem and step.
        const STEM: u64 = 15;
        self.course.as_ref().map_or(0, |course| course.bending.effort.stem_steps * STEM)
    }
}

/// An error at a string as the kernel reports it.
pub(crate) fn failure(error: &Error, string: &ModuleString) -> Failure {
    let diagnostic = error.diagnostic();
    let mut failure = Failure::new(diagnostic.message.clone());
    if let Error::Bending { stem: Some(stem), .. } = error
        && let Some(index) = string.iter().position(|module| module.lineage == stem.lineage)
    {
        failure = failure.of(index);
    }
    if let Some((span, _)) = diagnostic.labels.first() {
        failure = failure.at(*span);
    }
    if let Error::Coupling { lineage, .. } = error
        && let Some(index) = string.iter().position(|module| module.lineage == *lineage)
    {
        failure = failure.of(index);
    }
    if let Some(help) = diagnostic.help.first() {
        failure = failure.help(help.clone());
    }
    failure
}
