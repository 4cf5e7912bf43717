//! Solids of a scene in the way of what falls, at any time: from tick to tick, the same bits whatever is asked for, in whatever order.
//!
//! ```text
//! growth ──string at instants of the tick──▶ turtle ──solids, by lineage──▶ paths ──spans──▶ flights (fall)
//! ```
//!
//! Growth is one of its own, with what acts back on it: a solid that a sheet pushes is where the sheet has pushed it. It begins when a flight first comes to a tick, so
//! a model without `@D`, or without `solid`, has none of it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_diagnostic::Span as Text;
use dlsys_fall::{self as fall, Obstacle, Span, Surface};
use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle;
use dlsys_model::Model;
use dlsys_sim::{Settings, Simulation};
use dlsys_sway::Vector;
use dlsys_tree::ModuleString;

use crate::Error;
use crate::coupled;
use crate::descent::Descent;
use crate::flights::{has_open_polygons, pruned};
use crate::hanging::TICK;
use crate::marks::{Marks, Recent};
use crate::motion::MOST_TICKS;
use crate::paths::{Body, INSTANTS, Meets, Watch};
use crate::place::Place;

/// Most points of the solids of the ticks that are kept for times that come late, each tick counting as one more.
const MOST_KEPT: usize = 1_000_000;

/// The solids of a model at any time.
pub(crate) struct Obstacles<'m> {
    model: &'m Model,
    settings: Settings,
    place: Place,
    /// Branches without solids need no drawing.
    prunes: bool,
    runs: Mutex<Option<Runs<'m>>>,
    /// Why the solids of a tick are not known.
    failure: Mutex<Option<Error>>,
}

struct Runs<'m> {
    start: Run<'m>,
    present: Option<Run<'m>>,
    past: Recent<Tick>,
    marks: Marks<Run<'m>>,
    spent: Duration,
}

/// The solids of a tick, and why growth fails before its end; they stand still from there on.
#[derive(Clone)]
struct Tick {
    span: Arc<Span>,
    failed: Option<Error>,
}

/// A run of growth at a tick.
#[derive(Clone)]
struct Run<'m> {
    growth: Simulation<'m>,
    /// The number of the tick.
    number: u64,
    /// What was at the end of the tick before, by modules at its beginning: numbers of solids, and where they were in m.
    before: HashMap<u64, (u64, Vector)>,
    /// The productions of the tick before.
    descent: Descent,
    scene: Scene,
}

impl<'m> Obstacles<'m> {
    /// `None` for a model that declares no solids.
    pub(crate) fn new(model: &'m Model, settings: Settings) -> Option<Obstacles<'m>> {
        let settings = Settings { log: true, transitions: false, ..settings };
        let place = Place::of_scene(&model.scenery);
        (!model.scenery.solids.is_empty()).then(|| Obstacles {
            model,
            settings,
            place,
            prunes: !has_open_polygons(model),
            runs: Mutex::default(),
            failure: Mutex::default(),
        })
    }

    /// The reason why the solids of a tick are not known, if there was one.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The declaration of the first one.
    fn text(&self) -> Text {
        self.model.scenery.solids.first().map(|(_, span)| *span).unwrap_or_default()
    }

    /// The solids of the tick in which a time in s lies.
    fn at(&self, seconds: f64) -> Result<Arc<Span>, Error> {
        let number = (seconds / TICK).floor().max(0.0);
        if number > MOST_TICKS {
            let (time, seconds) = (self.place.time_at(seconds), self.place.units.time);
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds, span: self.text() });
        }
        let number = number as u64;
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let runs = match &mut *runs {
            Some(runs) => runs,
            none => none.insert(self.begin()?),
        };
        if let Some(tick) = runs.past.get(number) {
            return Ok(Arc::clone(&tick.span));
        }
        // Without a limit the clock is not asked.
        let limit = self.settings.max_seconds;
        let begun = limit.is_finite().then(Instant::now);
        let found = self.go_to(runs, number);
        runs.spent += begun.map_or(Duration::ZERO, |begun| begun.elapsed());
        if runs.spent.as_secs_f64() > limit {
            let time = self.place.time_at(seconds);
            return Err(Error::OutOfTime { limit, time, span: self.text() });
        }
        found
    }

    /// The solids in the way of a flight at a time in s.
    pub(crate) fn at_time(&self, time: f64) -> Result<Arc<Span>, fall::Error> {
        self.at(time).map_err(|error| {
            *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            fall::Error::Solids { time }
        })
    }

    fn begin(&self) -> Result<Runs<'m>, Error> {
        let growth = coupled::start(self.model, self.settings, self.place)?;
        let scene = turtle::blank(self.model);
        let (before, descent) = (HashMap::new(), Descent::default());
        let start = Run { growth, number: 0, before, descent, scene };
        let (past, marks) = (Recent::new(MOST_KEPT), Marks::new(usize::MAX));
        Ok(Runs { start, present: None, past, marks, spent: Duration::ZERO })
    }

    fn go_to(&self, runs: &mut Runs<'m>, number: u64) -> Result<Arc<Span>, Error> {
        let mut present = match runs.present.take() {
            Some(present) if present.number <= number => present,
            _ => {
                runs.past.clear();
                runs.marks.before(number).unwrap_or(&runs.start).clone()
            }
        };
        loop {
            let here = present.number;
            let tick = present.tick(self)?;
            let size = tick.span.solids().iter().flat_map(|solid| solid.parts.iter());
            let size = 1 + size.map(|shape| 1 + shape.core().len()).sum::<usize>();
            runs.past.add(here, tick.clone(), size);
            if tick.failed.is_none() {
                runs.marks.set(present.number, &present, |_| 0);
            }
            match (tick.failed, here == number) {
                (Some(error), false) => return Err(error),
                (Some(_), true) => return Ok(tick.span),
                (None, true) => {
                    runs.present = Some(present);
                    return Ok(tick.span);
                }
                (None, false) => {}
            }
        }
    }
}

impl Run<'_> {
    /// The solids from the present tick to the next, which is the present one then.
    fn tick(&mut self, among: &Obstacles) -> Result<Tick, Error> {
        let Obstacles { model, place, prunes, .. } = among;
        let begin = self.number as f64 * TICK;
        let (mut watch, mut descent, mut failed) = (Watch::default(), Descent::default(), None);
        let mut string = ModuleString::default();
        let is_solid =
            |module: dlsys_tree::Module| model.scenery.solids.iter().any(|(kind, _)| *kind == module.kind);
        for (instant, part) in INSTANTS.into_iter().enumerate() {
            let time = place.time_at(begin + TICK * part).max(0.0);
            if let Err(error) = self.growth.at(time, &mut string) {
                failed = Some(Error::from(error));
                break;
            }
            descent.add(model, &self.growth.take_events());
            let way = if *prunes { &pruned(&string, is_solid) } else { &string };
            watch.note((instant, way), (model, place), (&descent, Meets::Falling), &mut self.scene)?;
        }
        let mut now = HashMap::new();
        let mut solids = Vec::new();
        for Body { module, diagonal, parts, path } in watch.bodies(begin, TICK) {
            let here = path.place(begin).position;
            let known = self.descent.line(module).find_map(|id| self.before.get(&id)).copied();
            let number = known.map_or(module, |(number, _)| number);
            // A production may put a solid elsewhere at once.
            let is_new = known.is_none_or(|(_, there)| (here - there).norm() > diagonal);
            now.insert(module, (number, path.place(begin + TICK).position));
            let surface = Surface::default();
            solids.push(Obstacle {
                number,
                parts: parts.into(),
                path,
                surface,
                is_new: is_new && self.number > 0,
            });
        }
        (self.before, self.descent) = (now, descent);
        self.number += 1;
        let time = place.time_at(begin);
        let span = Span::new(begin, begin + TICK, solids);
        let span = span.map_err(|error| Error::Obstacle { error, time, span: among.text() })?;
        Ok(Tick { span: Arc::new(span), failed })
    }
}
