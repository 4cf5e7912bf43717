//! Passive motion with random access to time: the same bits whatever is asked for, in whatever order.
//!
//! ```text
//! ticks   t₀   t₁   t₂   t₃   t₄   t₅ ...       a global grid, t_n = n · 1/30 s
//! growth  ───────────────────────▶              one tick ahead of the stems
//! stems   ──────────────────▶ present
//! kept              [ t₂   t₃   t₄ ]            the last ticks, for frames that come a little late
//! marks   ●              ●                      copies to begin again from
//! ```

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle;
use dlsys_model::Model;
use dlsys_sim::{self as sim, Settings, Simulation};
use dlsys_sway as sway;
use dlsys_tree::ModuleString;

use crate::bending::{Bending, BentStems, Effort, Tick, bent};
use crate::classes::ByModes;
use crate::coupled;
use crate::descent::Descent;
use crate::place::Place;
use crate::weather::{Sampler, Weather};
use crate::{CLOCK, Error};

/// Most ticks up to a time that is asked for.
pub const MOST_TICKS: f64 = 1e7;
/// Most stems of the ticks that are kept.
const MOST_KEPT: usize = 1_000_000;
/// Largest number of marks.
const MOST_MARKS: usize = 24;
/// The first distance between marks, in ticks.
const FIRST_SPACING: u64 = 64;
/// Part of a tick over which the rates of growth are taken.
pub(crate) const LOOK_BACK: f64 = 1.0 / 1024.0;

/// How passive motion is computed and kept.
#[derive(Clone, Debug)]
pub struct Passive {
    /// The solver of stems: method, tolerance, air.
    pub solver: sway::Settings,
    /// Number of strains of past ticks that are kept for times that come late.
    pub kept: usize,
    /// Copies are kept, so that a time far back does not mean to begin anew.
    pub marks: bool,
    /// Moves by modes where it does not grow; otherwise it is solved.
    pub modes: Option<ByModes>,
}

impl Passive {
    /// With the method and the tolerance of the settings of a run.
    pub fn of(bending: sim::BendSettings) -> Passive {
        let method = match bending.method {
            sim::BendMethod::Ros2 => sway::Method::Ros2,
            sim::BendMethod::Ros34Pw2 => sway::Method::Ros34Pw2,
            sim::BendMethod::Euler => sway::Method::Euler,
        };
        let default = Passive::default();
        Passive {
            solver: sway::Settings { method, tolerance: bending.tolerance, ..default.solver },
            ..default
        }
    }
}

impl Default for Passive {
    fn default() -> Passive {
        Passive {
            solver: sway::Settings { longest: CLOCK, ..Default::default() },
            kept: MOST_KEPT,
            marks: true,
            modes: None,
        }
    }
}

/// A run of growth with the motion of its stems, at a tick and up to the next.
#[derive(Clone)]
struct Course<'m> {
    growth: Simulation<'m>,
    bending: Bending<&'m Model>,
    /// The number of the present tick.
    number: u64,
    tick: Arc<Tick>,
    /// Productions from the present tick to the next.
    descent: Arc<Descent>,
    /// The strings a little before the next tick, and at the next tick, if growth gets there.
    ahead: Result<Arc<[ModuleString; 2]>, Error>,
    /// There was a production between these two strings.
    jumps: bool,
}

impl<'m> Course<'m> {
    /// From the first tick.
    fn new(mut growth: Simulation<'m>, mut bending: Bending<&'m Model>) -> Result<Course<'m>, Error> {
        let mut string = ModuleString::default();
        let number = bending.place().first_tick();
        growth.at(bending.place().time_of(number).max(0.0), &mut string)?;
        growth.take_events();
        let tick = Arc::new(bending.advance(number, &string, None)?);
        let descent = Arc::default();
        let mut course =
            Course { growth, bending, number, tick, descent, ahead: Ok(Arc::default()), jumps: false };
        course.look_ahead();
        Ok(course)
    }

    /// Lets growth go on to the next tick. It may fail there, after a time that is asked for.
    fn look_ahead(&mut self) {
        let place = *self.bending.place();
        let next = place.time_of(self.number + 1);
        let before = next - LOOK_BACK * CLOCK / place.units.time;
        let mut strings = <[ModuleString; 2]>::default();
        let [earlier, now] = &mut strings;
        let mut gone = self.growth.at(before, earlier);
        let mut descent = Descent::default();
        descent.add(self.bending.model(), &self.growth.take_events());
        if gone.is_ok() {
            gone = self.growth.at(next, now);
        }
        let last = self.growth.take_events();
        self.jumps = !last.is_empty();
        descent.add(self.bending.model(), &last);
        self.descent = Arc::new(descent);
        self.ahead = gone.map(|()| Arc::new(strings)).map_err(Error::from);
    }

    /// Goes on to the next tick; returns the one that is past.
    fn tick(&mut self) -> Result<Past, Error> {
        let ahead = self.ahead.clone()?;
        let [before, now] = &*ahead;
        let before = (!self.jumps).then_some(before);
        let tick = self.bending.advance(self.number + 1, now, Some((&self.tick, &self.descent, before)))?;
        let tick = std::mem::replace(&mut self.tick, Arc::new(tick));
        let past = Past { number: self.number, tick, descent: self.descent.clone() };
        self.number += 1;
        self.look_ahead();
        Ok(past)
    }
}

/// A tick of the past.
#[derive(Clone)]
struct Past {
    number: u64,
    tick: Arc<Tick>,
    descent: Arc<Descent>,
}

impl Past {
    /// Number of strains that it keeps, and one for itself.
    fn size(&self) -> usize {
        self.tick.size() + 1
    }
}

/// The passive motion of a model: its stems in the wind.
pub struct Motion<'m> {
    model: &'m Model,
    courses: Mutex<Courses<'m>>,
}

struct Courses<'m> {
    present: Course<'m>,
    /// In the order of time, without gaps, up to the present tick.
    past: VecDeque<Past>,
    /// The sum of the sizes of the past ticks.
    kept: usize,
    marks: Vec<Course<'m>>,
    spacing: u64,
    passive: Passive,
    /// Seconds that the stems may take, and what they have taken.
    limit: f64,
    spent: Duration,
    scene: Scene,
}

impl<'m> Motion<'m> {
    /// The motion of a model at a place of a scene with this weather. `None` if nothing in it is passive.
    ///
    /// # Errors
    /// A wind without meaning, or the first instant fails.
    pub fn new(
        model: &'m Model,
        settings: Settings,
        weather: Option<Arc<Weather>>,
        place: Place,
        passive: Passive,
    ) -> Result<Option<Motion<'m>>, Error> {
        if model.scenery.tissues.is_empty() {
            return Ok(None);
        }
        check(model, &place, place.first_tick() as f64)?;
        let settings = Settings { log: true, transitions: false, ..settings };
        let growth = coupled::start(model, settings, place)?;
        let sampler = Arc::new(Sampler::new(weather, place));
        let bending = Bending::new(model, sampler, place, passive.solver).by_modes(passive.modes.clone());
        let present = Course::new(growth, bending)?;
        let courses = Courses {
            // Without marks the whole is begun anew where time goes back.
            marks: vec![present.clone()],
            passive,
            limit: settings.max_seconds,
            spent: Duration::ZERO,
            present,
            past: VecDeque::new(),
            kept: 0,
            spacing: FIRST_SPACING,
            scene: turtle::blank(model),
        };
        Ok(Some(Motion { model, courses: Mutex::new(courses) }))
    }

    /// The strains of a string of the model, at the string's time.
    ///
    /// # Errors
    /// The growth up to that time fails, or the motion of the stems does.
    pub fn at(&self, string: &ModuleString) -> Result<BentStems, Error> {
        let mut courses = self.courses.lock().unwrap_or_else(PoisonError::into_inner);
        courses.at(self.model, string)
    }

    /// Goes on to the tick at or before a time of the scene, in s. Motions in one wind that take turns share its instants.
    ///
    /// # Errors
    /// As of [`Motion::at`].
    pub fn advance(&self, seconds: f64) -> Result<(), Error> {
        let mut courses = self.courses.lock().unwrap_or_else(PoisonError::into_inner);
        let number = courses.number_of(self.model, seconds)?;
        while (courses.present.number as f64) < number {
            courses.tick()?;
        }
        Ok(())
    }

    /// The time of the scene, in s, of the present tick.
    pub fn reached(&self) -> f64 {
        let courses = self.courses.lock().unwrap_or_else(PoisonError::into_inner);
        courses.present.number as f64 * CLOCK
    }

    /// Points of the plant at the present tick, in m: the ends of all stems, and of what they carry about as far beyond its centre as that is
    /// from the stem.
    pub fn points(&self) -> Vec<sway::Vector> {
        self.courses.lock().unwrap_or_else(PoisonError::into_inner).present.tick.points()
    }

    /// Work of the present course from t = 0.
    pub fn effort(&self) -> Effort {
        self.courses.lock().unwrap_or_else(PoisonError::into_inner).present.bending.effort
    }
}

/// Fails if there are too many ticks up to one of this number.
fn check(model: &Model, place: &Place, number: f64) -> Result<(), Error> {
    if number <= MOST_TICKS {
        return Ok(());
    }
    let (seconds, span) = (place.units.time, model.scenery.tissues[0].span);
    let time = place.time_at(number * CLOCK);
    Err(Error::TooLong { most: MOST_TICKS, time, seconds, span })
}

impl<'m> Courses<'m> {
    fn at(&mut self, model: &'m Model, string: &ModuleString) -> Result<BentStems, Error> {
        let place = *self.present.bending.place();
        let number = self.number_of(model, place.seconds(string.time))?;
        // Before the first tick nothing has moved.
        if number < place.first_tick() as f64 {
            return Ok(BentStems::at_rest());
        }
        let number = number as u64;
        if number < self.present.number && self.past.front().is_none_or(|past| past.number > number) {
            let mark = self.marks.iter().rev().find(|mark| mark.number <= number);
            let mark = mark.or(self.marks.first()).cloned();
            if let Some(mark) = mark {
                (self.present, self.past, self.kept) = (mark, VecDeque::new(), 0);
            }
        }
        if number >= self.present.number {
            while self.present.number < number {
                self.tick()?;
            }
            let Course { tick, descent, .. } = &self.present;
            return bent(tick, descent, &self.present.bending, string, &mut self.scene);
        }
        let first = self.past.front().map_or(0, |past| past.number);
        let Past { tick, descent, .. } = &self.past[(number - first) as usize];
        bent(tick, descent, &self.present.bending, string, &mut self.scene)
    }

    /// The number of the tick at or before a time of the scene, in s, if so many are possible.
    fn number_of(&self, model: &Model, seconds: f64) -> Result<f64, Error> {
        let number = Place::tick_at(seconds);
        check(model, self.present.bending.place(), number)?;
        Ok(number)
    }

    /// Goes on to the next tick.
    fn tick(&mut self) -> Result<(), Error> {
        // Without a limit the clock is not asked.
        let begun = self.limit.is_finite().then(Instant::now);
        let left =
            Duration::try_from_secs_f64(self.limit).unwrap_or(Duration::MAX).saturating_sub(self.spent);
        self.present.bending.give_up_at(begun.and_then(|begun| begun.checked_add(left)));
        let past = self.present.tick();
        self.spent += begun.map_or(Duration::ZERO, |begun| begun.elapsed());
        if self.spent.as_secs_f64() > self.limit {
            let bending = &self.present.bending;
            let time = bending.place().time_of(self.present.number);
            let span = bending.model().scenery.tissues[0].span;
            return Err(Error::OutOfTime { limit: self.limit, time, span });
        }
        let past = past?;
        self.kept += past.size();
        self.past.push_back(past);
        while self.kept > self.passive.kept && self.past.len() > 1 {
            self.kept -= self.past.pop_front().map_or(0, |past| past.size());
        }
        self.mark();
        Ok(())
    }

    /// Sets a mark where one is due.
    fn mark(&mut self) {
        let number = self.present.number;
        if !self.passive.marks
            || !number.is_multiple_of(self.spacing)
            || self.marks.last().is_some_and(|mark| mark.number >= number)
        {
            return;
        }
        self.marks.push(self.present.clone());
        if self.marks.len() > MOST_MARKS {
            self.spacing *= 2;
            let (spacing, first) = (self.spacing, self.marks[0].number);
            self.marks.retain(|mark| mark.number.is_multiple_of(spacing) || mark.number == first);
        }
    }
}
