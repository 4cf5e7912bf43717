//! The wind that a model declares, as a field in SI.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use dlsys_diagnostic::Span;
use dlsys_expr::Program;
use dlsys_geometry::turtle;
use dlsys_model::{self as model, Model, Primitive, Scenery, Units};
use dlsys_sim::Settings;
use dlsys_sway as sway;
use dlsys_wind::{
    self as wind, Description, Field, Flow, Ground, Hull, Obstacle, Signal, Snapshot, Spectrum,
};
use nalgebra::Vector3;

use crate::footing::{Among, Footing};
use crate::obstacles::Obstacles;
use crate::solids::Solids;
use crate::{Error, Place};

/// The wind of a scene, with its bodies: a pure function of place and time.
pub struct Weather<'m> {
    declared: Arc<Declared>,
    solids: Option<Arc<Solids<'m>>>,
    /// The same bodies in the way of what falls.
    obstacles: Option<Arc<Obstacles<'m>>>,
    /// The soil on which it lands.
    footing: Option<Arc<Footing<'m>>>,
    /// The last instants with bodies.
    recent: Recent,
}

/// The wind that a model declares, without bodies. Runs of one model share it.
#[derive(Debug)]
struct Declared {
    field: Arc<Field>,
    recent: Recent,
    spans: Spans,
}

/// The last instants that were asked for; many plants stand in one wind.
#[derive(Debug, Default)]
struct Recent(Mutex<VecDeque<(f64, Arc<Snapshot>)>>);

/// Number of instants that are kept: the stages of some ticks, as plants that are drawn one after another read them.
const KEPT: usize = 48;

/// A cloud that is smaller than this part of the smallest eddies feels all of them: 99.8 % of their velocity.
const NOTHING: f64 = 0.01;

impl Recent {
    /// An instant that is kept, or a new one.
    fn get_or_make<E>(
        &self,
        time: f64,
        make: impl FnOnce() -> Result<Arc<Snapshot>, E>,
    ) -> Result<Arc<Snapshot>, E> {
        let recent = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = recent().iter().find(|(at, _)| *at == time) {
            return Ok(known.clone());
        }
        let new = make()?;
        let mut recent = recent();
        if recent.len() >= KEPT {
            recent.pop_front();
        }
        recent.push_back((time, new.clone()));
        Ok(new)
    }
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

impl Declared {
    /// The wind and the flows that a model declares; `None` if it declares neither, and no bodies that may move the air, and no soil on which something lands.
    fn of(scenery: &Scenery, soil: Option<Span>) -> Result<Option<Arc<Declared>>, Error> {
        let Scenery { wind, flows, solids, .. } = scenery;
        let span = wind.as_ref().map(|wind| wind.span).or(flows.first().map(|flow| flow.span));
        let span = span.or(solids.first().map(|(_, span)| *span)).or(soil);
        let Some(span) = span else { return Ok(None) };
        scenery.field.get_or_make(|| Declared::new(scenery, span, 0.0))
    }

    /// With turbulence averaged over a Gaussian of a standard deviation in m.
    fn new(scenery: &Scenery, span: Span, smoothing: f64) -> Result<Arc<Declared>, Error> {
        let Scenery { units, wind, flows, ground, .. } = scenery;
        let mut description = match wind {
            Some(wind) => of_wind(wind, *units),
            None => Description::new(Vector3::x(), 0.0),
        };
        description.smoothing = smoothing;
        description.flows = flows.iter().map(|flow| of_flow(flow, *units)).collect();
        description.ground = ground.map(|height| Ground::Flat(height * units.length));
        let spans = Spans { wind: span, flows: flows.iter().map(|flow| flow.span).collect() };
        match Field::new(description) {
            Ok(field) => Ok(Arc::new(Declared { field: Arc::new(field), recent: Recent::default(), spans })),
            Err(error) => Err(spans.locate(error)),
        }
    }

    fn at(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        let make = || self.field.at(time).map(Arc::new);
        self.recent.get_or_make(time, make).map_err(|error| self.spans.locate(error))
    }
}

impl<'m> Weather<'m> {
    /// The wind and the flows that a model declares, pushed aside by its bodies as they move in a run with these settings; `None` if it
    /// declares none of them, and no soil on which something may land.
    ///
    /// # Errors
    /// A value that is out of range, with the place of its declaration; bodies of a model whose rules read `strain`.
    pub fn of(model: &'m Model, settings: Settings) -> Result<Option<Arc<Weather<'m>>>, Error> {
        let soil = Footing::declared(model).filter(|_| lets_go(model));
        let Some(declared) = Declared::of(&model.scenery, soil)? else { return Ok(None) };
        let solids = Solids::new(model, settings)?.map(Arc::new);
        let obstacles = Obstacles::new(model, settings).map(Arc::new);
        let footing = Footing::new(model, settings).map(Arc::new);
        Ok(Some(Arc::new(Weather { declared, solids, obstacles, footing, recent: Recent::default() })))
    }

    /// The wind and the flows that a model declares, whatever bodies it has; `None` if it declares neither.
    ///
    /// # Errors
    /// A value that is out of range, with the place of its declaration.
    pub(crate) fn around_bodies(scenery: &Scenery) -> Result<Option<Arc<Weather<'static>>>, Error> {
        if scenery.wind.is_none() && scenery.flows.is_empty() {
            return Ok(None);
        }
        let declared = Declared::of(scenery, None)?;
        let weather = |declared| {
            let (obstacles, footing) = (None, None);
            Arc::new(Weather { declared, solids: None, obstacles, footing, recent: Recent::default() })
        };
        Ok(declared.map(weather))
    }

    /// The wind of a model whose rules read `strain`, which has no bodies.
    pub(crate) fn without_solids(scenery: &Scenery) -> Result<Option<Arc<Weather<'static>>>, Error> {
        if let Some((_, span)) = scenery.solids.first() {
            return Err(Error::SolidInLoop { span: *span });
        }
        let declared = Declared::of(scenery, None)?;
        let weather = |declared| {
            let (obstacles, footing) = (None, None);
            Arc::new(Weather { declared, solids: None, obstacles, footing, recent: Recent::default() })
        };
        Ok(declared.map(weather))
    }

    /// The same wind as a cloud of a size feels it, around the same bodies: turbulence averaged over a Gaussian of this standard deviation in m.
    ///
    /// # Errors
    /// A value that is out of range.
    pub(crate) fn averaged(&self, scenery: &Scenery, size: f64) -> Result<Weather<'m>, Error> {
        let declared = match self.field().smallest_eddy() {
            Some(eddy) if size > NOTHING * eddy => Declared::new(scenery, self.declared.spans.wind, size)?,
            _ => Arc::clone(&self.declared),
        };
        let (solids, obstacles, footing) =
            (self.solids.clone(), self.obstacles.clone(), self.footing.clone());
        Ok(Weather { declared, solids, obstacles, footing, recent: Recent::default() })
    }

    /// The field without bodies.
    pub fn field(&self) -> &Field {
        &self.declared.field
    }

    /// The same, shared.
    pub(crate) fn shared_field(&self) -> Arc<Field> {
        Arc::clone(&self.declared.field)
    }

    /// The wind at an instant, in s, without bodies.
    ///
    /// # Errors
    /// A value of the wind that is not finite at that time.
    pub(crate) fn free(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        self.declared.at(time)
    }

    /// The bodies at a time in s.
    ///
    /// # Errors
    /// Their growth up to that time fails.
    pub(crate) fn hulls(&self, time: f64) -> Result<Vec<Hull>, Error> {
        self.solids.as_ref().map_or(Ok(Vec::new()), |solids| solids.hulls(time))
    }

    /// True if there may be bodies.
    pub(crate) fn has_bodies(&self) -> bool {
        self.solids.is_some()
    }

    /// A wind with bodies in it as they are at an instant.
    ///
    /// # Errors
    /// One of them cannot push the wind.
    pub(crate) fn among(&self, free: &Snapshot, hulls: &[Hull]) -> Result<Snapshot, Error> {
        let bodies: Vec<_> = hulls.iter().map(|hull| Arc::new(hull.clone()) as Arc<dyn Obstacle>).collect();
        free.among(&bodies).map_err(|error| self.declared.spans.locate(error))
    }

    /// The wind at an instant, in s.
    ///
    /// # Errors
    /// A value of the wind that is not finite at that time; the growth of the bodies up to that time fails, or one of them cannot push
    /// the wind.
    pub fn at(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        let free = self.declared.at(time)?;
        let Some(solids) = &self.solids else { return Ok(free) };
        let make = || {
            let bodies = solids.at(time)?;
            if bodies.is_empty() {
                return Ok(free);
            }
            free.among(&bodies).map(Arc::new).map_err(|error| self.declared.spans.locate(error))
        };
        self.recent.get_or_make(time, make)
    }
}

/// True if a model, or a plant in it, may let go of something.
fn lets_go(model: &Model) -> bool {
    turtle::lets_go(model) || model.scenery.plants.iter().any(|plant| lets_go(&plant.model))
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
pub struct Sampler<'m> {
    weather: Option<Arc<Weather<'m>>>,
    /// The last instant.
    last: Mutex<Option<(f64, Arc<Snapshot>)>>,
    /// The reason why the wind had no value at an instant.
    failure: Mutex<Option<Error>>,
    place: Place,
}

impl<'m> Sampler<'m> {
    /// The wind for a model at a place; without weather the air is still.
    pub fn new(weather: Option<Arc<Weather<'m>>>, place: Place) -> Sampler<'m> {
        Sampler { weather, last: Mutex::default(), failure: Mutex::default(), place }
    }

    /// What is in the way of what falls.
    pub(crate) fn in_the_way(&self) -> Among<'_, 'm> {
        let weather = self.weather.as_ref();
        let obstacles = weather.and_then(|weather| weather.obstacles.as_deref());
        Among { obstacles, footing: weather.and_then(|weather| weather.footing.as_deref()) }
    }

    /// True if the air moves somewhere at some time.
    pub fn blows(&self) -> bool {
        self.weather.is_some()
    }

    /// The reason why the wind had no value, if there was an instant without one: its velocities are not numbers then, and a solver
    /// that depends on them fails.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
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
pub(crate) struct Gusts<'a, 'm>(pub(crate) &'a Sampler<'m>);

/// Instants in a second. Steps of a flight end at parts of a second that are powers of 2, and the longest ones read the wind at these.
const INSTANTS: f64 = 128.0;

impl sway::Wind for Gusts<'_, '_> {
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

impl sway::Wind for Sampler<'_> {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        match self.at(time) {
            Some(snapshot) => self.place.turn.transpose() * snapshot.velocity(self.place.point(point)),
            None if self.blows() => sway::Vector::repeat(f64::NAN),
            None => sway::Vector::zeros(),
        }
    }
}
