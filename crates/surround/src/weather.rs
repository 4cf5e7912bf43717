//! The wind that a model declares, as a field in SI.

use std::sync::{Arc, Mutex, PoisonError};

use dlsys_diagnostic::Span;
use dlsys_expr::Program;
use dlsys_model::{self as model, Primitive, Scenery, Units};
use dlsys_sway as sway;
use dlsys_wind::{self as wind, Description, Field, Flow, Ground, Signal, Snapshot, Spectrum};
use nalgebra::Vector3;

use crate::{Error, Place};

/// The wind of a scene: a pure function of place and time.
#[derive(Debug)]
pub struct Weather {
    field: Field,
    /// The last instants that were asked for; many plants stand in one wind.
    recent: Mutex<Vec<(f64, Arc<Snapshot>)>>,
    spans: Spans,
}

/// The declarations of the wind and of the flows.
#[derive(Debug)]
struct Spans {
    wind: Span,
    flows: Vec<Span>,
}

impl Spans {
    /// An error with the place of the declaration that it is about.
    fn locate(&self, error: wind::Error) -> Error {
        let flow = if let wind::Error::Flow { index, .. } = &error { self.flows.get(*index) } else { None };
        Error::Wind { span: *flow.unwrap_or(&self.wind), error }
    }
}

/// Number of instants that are kept: the stages of some ticks, as plants that are drawn one after another read them.
const KEPT: usize = 48;

impl Weather {
    /// The wind and the flows that a model declares; `None` if it declares neither.
    ///
    /// # Errors
    /// A value that is out of range, with the place of its declaration.
    pub fn of(scenery: &Scenery) -> Result<Option<Arc<Weather>>, Error> {
        let Scenery { units, wind, flows, ground, .. } = scenery;
        let span = wind.as_ref().map(|wind| wind.span).or(flows.first().map(|flow| flow.span));
        let Some(span) = span else { return Ok(None) };
        let make = || {
            let mut description = match wind {
                Some(wind) => of_wind(wind, *units),
                None => Description::new(Vector3::x(), 0.0),
            };
            description.flows = flows.iter().map(|flow| of_flow(flow, *units)).collect();
            description.ground = ground.map(|height| Ground::Flat(height * units.length));
            let spans = Spans { wind: span, flows: flows.iter().map(|flow| flow.span).collect() };
            match Field::new(description) {
                Ok(field) => Ok(Arc::new(Weather { field, recent: Mutex::default(), spans })),
                Err(error) => Err(spans.locate(error)),
            }
        };
        scenery.field.get_or_make(make)
    }

    /// The field.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// The wind at an instant, in s.
    fn at(&self, time: f64) -> Result<Arc<Snapshot>, wind::Error> {
        let recent = || self.recent.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = recent().iter().find(|(at, _)| *at == time) {
            return Ok(known.clone());
        }
        let new = Arc::new(self.field.at(time)?);
        let mut recent = recent();
        if recent.len() >= KEPT {
            recent.remove(0);
        }
        recent.push((time, new.clone()));
        Ok(new)
    }
}

/// A function of the model's time as a signal in seconds, times a factor.
fn signal(program: &Program, output: usize, units: Units, factor: f64) -> Signal {
    if let Some(values) = program.constants() {
        return Signal::Constant(values[output] * factor);
    }
    let program = program.clone();
    Signal::function(move |seconds| {
        let mut values = vec![0.0; program.outputs()];
        program.eval(&[seconds / units.time], &mut Vec::new(), &mut values);
        values[output] * factor
    })
}

fn of_wind(wind: &model::Wind, units: Units) -> Description {
    let spectrum = match wind.spectrum {
        model::Spectrum::VonKarman => Spectrum::VonKarman,
        model::Spectrum::Kolmogorov([dissipation, inertial, sigma]) => {
            Spectrum::Kolmogorov { dissipation, inertial, sigma }
        }
    };
    Description {
        turbulence: wind.turbulence,
        scale: wind.scale,
        roughness: wind.roughness,
        period: wind.period.map(|period| period * units.time),
        seed: wind.seed,
        spectrum,
        ..Description::new(Vector3::from(wind.direction), signal(&wind.speed, 0, units, 1.0))
    }
}

fn of_flow(flow: &model::Flow, units: Units) -> Flow {
    let value = |output, factor| signal(&flow.program, output, units, factor);
    let at = || [1, 2, 3].map(|output| value(output, units.length));
    let decay = flow.decay.map(|decay| decay * units.length);
    let core = CORE;
    match flow.primitive {
        Primitive::Uniform => Flow::Uniform([0, 1, 2].map(|output| value(output, 1.0))),
        Primitive::Source => Flow::Source { strength: value(0, 1.0), at: at(), decay, core },
        Primitive::Sink => Flow::Source { strength: value(0, -1.0), at: at(), decay, core },
        Primitive::Vortex => {
            let axis = [4, 5, 6].map(|output| value(output, 1.0));
            Flow::Vortex { circulation: value(0, 1.0), at: at(), axis, decay, core }
        }
    }
}

/// Radius of the core of sources and vortices, in m.
const CORE: f64 = 0.1;

/// The wind at a place, for a solver that asks for a few instants many times.
pub struct Sampler {
    weather: Option<Arc<Weather>>,
    /// The last instant.
    last: Mutex<Option<(f64, Arc<Snapshot>)>>,
    /// The reason why the wind had no value at an instant.
    failure: Mutex<Option<wind::Error>>,
    place: Place,
}

impl Sampler {
    /// The wind for a model at a place; without weather the air is still.
    pub fn new(weather: Option<Arc<Weather>>, place: Place) -> Sampler {
        Sampler { weather, last: Mutex::default(), failure: Mutex::default(), place }
    }

    /// True if the air moves somewhere at some time.
    pub fn blows(&self) -> bool {
        self.weather.is_some()
    }

    /// The reason why the wind had no value, if there was an instant without one: its velocities are not numbers then, and a solver
    /// that depends on them fails.
    pub(crate) fn failure(&self) -> Option<Error> {
        let error = self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        Some(self.weather.as_ref()?.spans.locate(error))
    }

    /// The wind at an instant, in s; `None` without weather, or if it has no value.
    fn at(&self, time: f64) -> Option<Arc<Snapshot>> {
        let weather = self.weather.as_ref()?;
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((at, known)) = &*last
            && *at == time
        {
            return Some(known.clone());
        }
        let new = match weather.at(time) {
            Ok(new) => new,
            Err(error) => {
                *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                return None;
            }
        };
        *last = Some((time, new.clone()));
        Some(new)
    }
}

/// The wind in the axes of the scene at instants of a grid, and between them by straight lines: for bodies that fall, each in steps of its own.
/// Turbulence changes little from one instant to the next, and many bodies read the same ones.
pub(crate) struct Gusts<'a>(pub(crate) &'a Sampler);

/// Instants in a second. Steps of a flight end at parts of a second that are powers of 2, and the longest ones read the wind at these.
const INSTANTS: f64 = 128.0;

impl sway::Wind for Gusts<'_> {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        let Gusts(sampler) = self;
        if !sampler.blows() {
            return sway::Vector::zeros();
        }
        let at = |instant: f64| match sampler.at(instant / INSTANTS) {
            Some(snapshot) => snapshot.velocity(point),
            None => sway::Vector::repeat(f64::NAN),
        };
        let instant = (time * INSTANTS).floor();
        let part = time * INSTANTS - instant;
        let before = at(instant);
        if part == 0.0 { before } else { before.lerp(&at(instant + 1.0), part) }
    }
}

impl sway::Wind for Sampler {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        match self.at(time) {
            Some(snapshot) => self.place.turn.transpose() * snapshot.velocity(self.place.point(point)),
            None if self.blows() => sway::Vector::repeat(f64::NAN),
            None => sway::Vector::zeros(),
        }
    }
}
