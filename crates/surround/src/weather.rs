//! The wind that a model declares, as a field in SI.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use dlsys_diagnostic::Span;
use dlsys_expr::Program;
use dlsys_geometry::turtle;
use dlsys_model::{self as model, Model, Primitive, Scenery, Units};
use dlsys_sim::Settings;
use dlsys_wind::{
    self as wind, Description, Field, Flow, Ground, Hull, Obstacle, Signal, Snapshot, Spectrum,
};
use nalgebra::Vector3;

use crate::Error;
use crate::between;
use crate::footing::{Among, Footing};
use crate::obstacles::Obstacles;
use crate::solids::Solids;

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
    /// The same of those between instants.
    between: Recent,
}

/// The wind that a model declares, without bodies. Runs of one model share it.
#[derive(Debug)]
struct Declared {
    field: Arc<Field>,
    recent: Recent,
    /// The last tick, with the parts that it is divided into.
    parts: Mutex<Option<(f64, Option<u32>)>>,
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
            Ok(field) => {
                let (field, recent, parts) = (Arc::new(field), Recent::default(), Mutex::default());
                Ok(Arc::new(Declared { field, recent, parts, spans }))
            }
            Err(error) => Err(spans.locate(error)),
        }
    }

    fn at(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        let make = || self.field.at(time).map(Arc::new);
        self.recent.get_or_make(time, make).map_err(|error| self.spans.locate(error))
    }

    /// The same at the times of short steps, in s, with turbulence between instants.
    fn between(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        let around = self.parts(between::tick_of(time))?.and_then(|parts| between::around(time, parts));
        let Some(around) = around else { return self.at(time) };
        let [a, b, c, d] = around.times.map(|time| self.at(time));
        let (a, b, c, d) = (a?, b?, c?, d?);
        match self.field.between(time, [&a, &b, &c, &d], around.place) {
            Ok(Some(snapshot)) => Ok(Arc::new(snapshot)),
            Ok(None) => self.at(time),
            Err(error) => Err(self.spans.locate(error)),
        }
    }

    /// The parts of a tick between which turbulence is interpolated, as a power of two.
    fn parts(&self, tick: f64) -> Result<Option<u32>, Error> {
        let last = || self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, parts)) = last().filter(|(of, _)| *of == tick) {
            return Ok(parts);
        }
        let parts = between::parts(&self.field, tick).map_err(|error| self.spans.locate(error))?;
        *last() = Some((tick, parts));
        Ok(parts)
    }
}

impl<'m> Weather<'m> {
    fn new(
        declared: Arc<Declared>,
        solids: Option<Arc<Solids<'m>>>,
        obstacles: Option<Arc<Obstacles<'m>>>,
        footing: Option<Arc<Footing<'m>>>,
    ) -> Weather<'m> {
        let (recent, between) = (Recent::default(), Recent::default());
        Weather { declared, solids, obstacles, footing, recent, between }
    }

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
        Ok(Some(Arc::new(Weather::new(declared, solids, obstacles, footing))))
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
        Ok(declared.map(|declared| Arc::new(Weather::new(declared, None, None, None))))
    }

    /// The wind of a model whose rules read `strain`, which has no bodies.
    pub(crate) fn without_solids(scenery: &Scenery) -> Result<Option<Arc<Weather<'static>>>, Error> {
        if let Some((_, span)) = scenery.solids.first() {
            return Err(Error::SolidInLoop { span: *span });
        }
        let declared = Declared::of(scenery, None)?;
        Ok(declared.map(|declared| Arc::new(Weather::new(declared, None, None, None))))
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
        Ok(Weather::new(declared, solids, obstacles, footing))
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

    /// What is in the way of what falls.
    pub(crate) fn in_the_way(&self) -> Among<'_, 'm> {
        Among { obstacles: self.obstacles.as_deref(), footing: self.footing.as_deref() }
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
        self.with_bodies(time, self.declared.at(time)?, &self.recent)
    }

    /// The wind at a time of a step of stems, in s: at times that are close together with turbulence as it is between instants, with an error of some
    /// 1 %, see `between.rs`. All else is that of the time itself.
    ///
    /// # Errors
    /// As of [`Weather::at`].
    pub fn between(&self, time: f64) -> Result<Arc<Snapshot>, Error> {
        self.with_bodies(time, self.declared.between(time)?, &self.between)
    }

    fn with_bodies(&self, time: f64, free: Arc<Snapshot>, recent: &Recent) -> Result<Arc<Snapshot>, Error> {
        let Some(solids) = &self.solids else { return Ok(free) };
        let make = || {
            let bodies = solids.at(time)?;
            if bodies.is_empty() {
                return Ok(free);
            }
            free.among(&bodies).map(Arc::new).map_err(|error| self.declared.spans.locate(error))
        };
        recent.get_or_make(time, make)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CLOCK;
    use crate::between::around;

    fn declared(turbulence: f64) -> Declared {
        let description = Description { turbulence, seed: 3, ..Description::new(Vector3::x(), 3.0) };
        let spans = Spans { wind: Span::default(), flows: Vec::new() };
        let field = Arc::new(Field::new(description).expect("a wind"));
        Declared { field, recent: Recent::default(), parts: Mutex::default(), spans }
    }

    /// However many steps a tick has, it makes the instants that its turbulence asks for; steps that meet them read these, to the last bit.
    #[test]
    fn a_tick_of_short_steps_makes_few_instants() {
        const STEPS: u32 = 256;
        let declared = declared(0.3);
        let x = Vector3::new(0.3, 1.2, -0.7);
        let (mut error, mut square, mut met) = (0.0, 0.0, 0);
        for step in 0..=STEPS {
            let time = CLOCK * (7.0 + f64::from(step) / f64::from(STEPS));
            let found = declared.between(time).expect("a wind").velocity(x);
            let exact = declared.field.at(time).expect("a wind").velocity(x);
            error += (found - exact).norm_squared();
            square += (exact - Vector3::x() * 3.0).norm_squared();
            let parts = declared.parts(7.0).expect("a speed").expect("turbulence");
            if around(time, parts).is_none() {
                assert_eq!(found, exact);
                met += 1;
            }
        }
        let instants = declared.recent.0.lock().expect("nobody has it").len();
        assert!(met >= 5 && instants <= met + 3, "{instants} instants for {STEPS} steps, {met} met");
        let relative = (error / square).sqrt();
        assert!(relative < 0.02, "{relative}");
    }

    /// In any order.
    #[test]
    fn wind_between_instants_is_a_function_of_time() {
        let times: Vec<f64> = (0..60).map(|i| 0.4 + f64::from(i * 17 % 60) * 0.0013).collect();
        let x = Vector3::new(0.3, 1.2, -0.7);
        let read = |declared: &Declared, time: f64| declared.between(time).expect("a wind").velocity(x);
        let one = declared(0.3);
        let all: Vec<_> = times.iter().map(|time| read(&one, *time)).collect();
        for (time, known) in times.iter().zip(all).rev() {
            assert_eq!(read(&declared(0.3), *time), known);
        }
    }
}
