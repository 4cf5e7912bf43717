//! The gases of a model at any time: blobs that the wind carries, the same bits whatever is asked for, in whatever order.
//!
//! ```text
//! growth ──string at each tick──▶ turtle, stems as they bend ──sources──▶ clouds ──▶ blobs at any time
//! ```
//!
//! Ticks of gases are powers of 2 of a second, so that their multiples are exact. Growth is one tick ahead of the clouds. Between ticks, centres are
//! cubics with the places and velocities at both.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_diagnostic::Span;
use dlsys_gas::{self as gas, Cloud, Source};
use dlsys_geometry::scene::{Blob, Color, Gas, Point, Scene};
use dlsys_geometry::turtle;
use dlsys_model::{self as model, Model};
use dlsys_sim::{Event, Settings, Simulation};
use dlsys_tree::ModuleString;
use dlsys_wind::Still;

use crate::Error;
use crate::coupled;
use crate::descent::Descent;
use crate::drift::Drift;
use crate::marks::{Marks, Recent};
use crate::motion::{MOST_TICKS, Motion};
use crate::outlets::{Change, Outlet};
use crate::place::Place;
use crate::weather::Weather;

/// Seconds from one tick of the gases to the next.
pub const TICK: f64 = 1.0 / 32.0;
/// Most blobs of one gas.
pub const MOST_BLOBS: usize = 2_000_000;
/// Blobs are not replaced by smaller ones beyond so many.
const MOST_SPLIT: usize = 20_000;
/// Most blobs of the ticks that are kept for times that come a little late, and of marks.
const MOST_KEPT: usize = 500_000;
const MOST_MARKED: usize = 1_000_000;
/// A blob as large as this part of the smallest eddies is replaced by smaller ones.
const EDDY: f64 = 0.5;

/// The gases of a model.
pub struct Gases<'m> {
    model: &'m Model,
    settings: Settings,
    place: Place,
    /// The wind as blobs of each gas feel it; empty in still air.
    weathers: Vec<Weather<'m>>,
    state: Mutex<State<'m>>,
}

/// The clouds at a tick, and what begins until the next one.
#[derive(Clone)]
struct Moment {
    number: u64,
    clouds: Arc<Vec<Cloud>>,
    /// The sources at the tick.
    here: Arc<Vec<Outlet>>,
    /// What becomes of them up to the next tick, if growth gets there.
    ahead: Result<Arc<Ahead>, Error>,
}

/// The sources at the next tick, and what is there in between, by gas.
#[derive(Default)]
struct Ahead {
    next: Arc<Vec<Outlet>>,
    sources: Vec<Vec<Source>>,
}

/// A moment to go on from.
#[derive(Clone)]
struct Course<'m> {
    growth: Simulation<'m>,
    moment: Moment,
}

struct State<'m> {
    /// At the first tick; its sources are known after the first use.
    start: Course<'m>,
    has_begun: bool,
    present: Option<Course<'m>>,
    past: Recent<Moment>,
    marks: Marks<Course<'m>>,
    spent: Duration,
    scene: Scene,
}

impl Moment {
    fn blobs(&self) -> usize {
        self.clouds.iter().map(Cloud::len).sum()
    }
}

impl<'m> Gases<'m> {
    /// The gases of the model of a scene; `None` if nothing lets out any. Clouds are followed by so many threads, on which results do not depend.
    ///
    /// # Errors
    /// A gas that cannot be followed.
    pub fn new(
        model: &'m Model,
        settings: Settings,
        weather: Option<Arc<Weather<'m>>>,
        threads: usize,
    ) -> Result<Option<Gases<'m>>, Error> {
        if !turtle::lets_out(model) {
            return Ok(None);
        }
        let place = Place::of_scene(&model.scenery);
        let settings = Settings { log: true, transitions: false, ..settings };
        let eddy = weather.as_ref().and_then(|weather| weather.field().smallest_eddy());
        let cloud = |gas: &model::Gas| {
            let split = eddy.map_or(f64::INFINITY, |eddy| (EDDY * eddy).max(2.0 * gas.size));
            let settings = gas::Settings {
                tick: TICK,
                split,
                most_split: MOST_SPLIT,
                most: MOST_BLOBS,
                seed: settings.seed,
                threads: threads.clamp(1, 1024),
                ..gas::Settings::default()
            };
            let physics = gas::Gas {
                diffusion: gas.diffusion,
                decay: gas.decay,
                size: gas.size,
                mass: gas.mass,
                fall: gas.fall,
            };
            let failed = |error| Error::Gas { name: gas.name.to_string(), error, time: 0.0, span: gas.span };
            Cloud::new(physics, settings).map_err(failed)
        };
        let clouds = model.scenery.gases.iter().map(cloud).collect::<Result<Vec<_>, Error>>()?;
        let averaged = |weather: &Arc<Weather<'m>>| {
            let scenery = &model.scenery;
            scenery
                .gases
                .iter()
                .map(|gas| weather.averaged(scenery, gas.size))
                .collect::<Result<Vec<_>, Error>>()
        };
        let weathers = weather.as_ref().map_or(Ok(Vec::new()), averaged)?;
        let growth = coupled::start(model, settings, place)?;
        let (here, ahead) = (Arc::default(), Ok(Arc::default()));
        let moment = Moment { number: 0, clouds: Arc::new(clouds), here, ahead };
        let state = State {
            start: Course { growth, moment },
            has_begun: false,
            present: None,
            past: Recent::new(MOST_KEPT),
            marks: Marks::new(MOST_MARKED),
            spent: Duration::ZERO,
            scene: turtle::blank(model),
        };
        Ok(Some(Gases { model, settings, place, weathers, state: Mutex::new(state) }))
    }

    /// The gases at a time of the model, with sources on stems that move as they do here.
    ///
    /// # Errors
    /// The growth up to that time fails, or the motion of the stems; there are too many blobs or ticks, or the wind has no value.
    pub fn at(&self, time: f64, motion: Option<&Motion<'m>>) -> Result<Vec<Gas>, Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let seconds = self.place.seconds(time).max(0.0);
        let number = (seconds / TICK).floor();
        if number > MOST_TICKS {
            let seconds = self.place.units.time;
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds, span: self.span() });
        }
        let begun = Instant::now();
        let limit = self.settings.max_seconds;
        let spent = state.spent;
        let in_time = |at: f64| match (spent + begun.elapsed()).as_secs_f64() > limit {
            true => Err(Error::OutOfTime { limit, time: at, span: self.span() }),
            false => Ok(()),
        };
        let done = self.moment(&mut state, number as u64, motion, &in_time);
        let shown = done.and_then(|moment| self.shown(&moment, seconds));
        state.spent += begun.elapsed();
        shown
    }

    /// The clouds at a tick.
    fn moment(
        &self,
        state: &mut State<'m>,
        number: u64,
        motion: Option<&Motion<'m>>,
        in_time: &dyn Fn(f64) -> Result<(), Error>,
    ) -> Result<Moment, Error> {
        if let Some(moment) = state.past.get(number) {
            return Ok(moment.clone());
        }
        if !state.has_begun {
            self.begin(state, motion)?;
        }
        let mut present = match state.present.take() {
            Some(present) if present.moment.number <= number => present,
            _ => {
                state.past.clear();
                state.marks.before(number).unwrap_or(&state.start).clone()
            }
        };
        while present.moment.number < number {
            in_time(self.time_of(present.moment.number))?;
            let before = present.moment.clone();
            self.tick(&mut present, state, motion)?;
            let size = 1 + before.blobs();
            state.past.add(before.number, before, size);
            state.marks.set(present.moment.number, &present, |course| course.moment.blobs());
        }
        let moment = present.moment.clone();
        state.present = Some(present);
        Ok(moment)
    }

    /// The sources at t = 0, and up to the first tick.
    fn begin(&self, state: &mut State<'m>, motion: Option<&Motion<'m>>) -> Result<(), Error> {
        let mut course = state.start.clone();
        let (here, _) = self.outlets(&mut course.growth, 0, &mut state.scene, motion)?;
        course.moment.here = Arc::new(here);
        self.look_ahead(&mut course, state, motion);
        (state.start, state.has_begun) = (course, true);
        Ok(())
    }

    /// The sources at a tick, to which growth goes on, with the productions on the way.
    fn outlets(
        &self,
        growth: &mut Simulation<'m>,
        number: u64,
        scene: &mut Scene,
        motion: Option<&Motion<'m>>,
    ) -> Result<(Vec<Outlet>, Vec<Event>), Error> {
        let mut string = ModuleString::default();
        growth.at(self.time_of(number), &mut string)?;
        let events = growth.take_events();
        scene.clear();
        match motion {
            Some(motion) => turtle::draw_bent(self.model, &string, &motion.at(&string)?, scene)?,
            None => turtle::draw(self.model, &string, scene)?,
        }
        Ok((Outlet::of(scene, &string, &self.place), events))
    }

    /// Lets growth go on to the next tick. It may fail there, after a time that is asked for.
    fn look_ahead(&self, course: &mut Course<'m>, state: &mut State<'m>, motion: Option<&Motion<'m>>) {
        let number = course.moment.number;
        let here = Arc::clone(&course.moment.here);
        let found = self.outlets(&mut course.growth, number + 1, &mut state.scene, motion);
        course.moment.ahead = found.map(|(next, events)| {
            let mut descent = Descent::default();
            descent.add(self.model, &events);
            let change = Change {
                here: &here,
                next: &next,
                events: &events,
                descent: &descent,
                ticks: [number, number + 1].map(|number| number as f64 * TICK),
                seed: self.settings.seed,
            };
            let count = self.model.scenery.gases.len();
            let sources = (0..count).map(|gas| change.sources(gas, &self.place)).collect();
            Arc::new(Ahead { next: Arc::new(next), sources })
        });
    }

    /// Goes on to the next tick.
    fn tick(
        &self,
        course: &mut Course<'m>,
        state: &mut State<'m>,
        motion: Option<&Motion<'m>>,
    ) -> Result<(), Error> {
        let moment = &mut course.moment;
        let ahead = moment.ahead.clone()?;
        let begin = moment.number as f64 * TICK;
        let clouds = Arc::make_mut(&mut moment.clouds);
        for (number, cloud) in clouds.iter_mut().enumerate() {
            let sources = ahead.sources.get(number).map_or(&[][..], Vec::as_slice);
            if cloud.is_empty() && sources.is_empty() {
                // Time passes.
                let passed = cloud.advance(&[], &Still);
                passed.map_err(|error| self.failed(number, error, (begin, &ahead), None))?;
                continue;
            }
            let drift = self.drift(begin, (number, cloud))?;
            let done = cloud.advance_among(sources, &drift, &drift);
            done.map_err(|error| self.failed(number, error, (begin, &ahead), drift.failure()))?;
        }
        moment.number += 1;
        moment.here = Arc::clone(&ahead.next);
        self.look_ahead(course, state, motion);
        Ok(())
    }

    /// The wind of a gas, by its number.
    fn drift(&self, begin: f64, (number, cloud): (usize, &Cloud)) -> Result<Drift<'_, 'm>, Error> {
        Drift::new(self.weathers.get(number), [begin, TICK], cloud.gas().fall, self.place.ground)
    }

    /// The blobs at a time in s after a tick, in scene units.
    fn shown(&self, moment: &Moment, seconds: f64) -> Result<Vec<Gas>, Error> {
        let begin = moment.number as f64 * TICK;
        let mut gases = Vec::with_capacity(moment.clouds.len());
        for (number, cloud) in moment.clouds.iter().enumerate() {
            let declared = &self.model.scenery.gases[number];
            if seconds == begin {
                gases.push(self.gas(declared, cloud));
                continue;
            }
            // Where growth ends soon after the time that is asked for, nothing new begins until then.
            let none = Arc::default();
            let ahead = moment.ahead.as_ref().unwrap_or(&none);
            let sources = ahead.sources.get(number).map_or(&[][..], Vec::as_slice);
            if cloud.is_empty() && sources.is_empty() {
                gases.push(self.gas(declared, cloud));
                continue;
            }
            let drift = self.drift(begin, (number, cloud))?.showing(seconds)?;
            let shown = cloud.shown_among(seconds, sources, &drift, &drift);
            let shown = shown.map_err(|error| self.failed(number, error, (begin, ahead), drift.failure()))?;
            gases.push(self.gas(declared, &shown));
        }
        Ok(gases)
    }

    /// A gas with its blobs in scene units.
    fn gas(&self, declared: &model::Gas, cloud: &Cloud) -> Gas {
        let metre = self.place.units.length;
        let blob = |(blob, key): (gas::Blob, u64)| Blob {
            centre: Point::from(blob.centre / metre),
            deviation: blob.variance.sqrt() / metre,
            mass: blob.mass / declared.mass,
            key,
        };
        Gas {
            name: Arc::clone(&declared.name),
            color: Color::hex(declared.color),
            albedo: declared.albedo,
            glow: declared.glow,
            area: declared.extinction * declared.mass / (metre * metre),
            size: declared.size / metre,
            blobs: cloud.blobs().zip(cloud.keys()).map(blob).collect(),
        }
    }

    /// The time of the model at a tick.
    fn time_of(&self, number: u64) -> f64 {
        self.place.time_at(number as f64 * TICK)
    }

    /// The first place in the text that lets out a gas, or the declaration of the first one.
    fn span(&self) -> Span {
        let declared = || self.model.scenery.gases.first().map(|gas| gas.span);
        turtle::place_of_source(self.model).or_else(declared).unwrap_or_default()
    }

    /// The failure of a cloud with its place in the text: that of the source that makes the most blobs.
    fn failed(
        &self,
        number: usize,
        error: gas::Error,
        (begin, ahead): (f64, &Ahead),
        wind: Option<Error>,
    ) -> Error {
        if let Some(wind) = wind {
            return wind;
        }
        let declared = &self.model.scenery.gases[number];
        let of_gas = ahead.next.iter().filter(|outlet| outlet.gas == number);
        let strongest = of_gas.max_by(|a, b| a.rate.total_cmp(&b.rate));
        let span = strongest.and_then(|outlet| outlet.origin.span(self.model));
        let span = span.unwrap_or(declared.span);
        Error::Gas { name: declared.name.to_string(), error, time: self.place.time_at(begin), span }
    }
}
