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

use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle;
use dlsys_model::Model;
use dlsys_sim::{Settings, Simulation};
use dlsys_sway as sway;
use dlsys_tree::ModuleString;

use crate::bending::{Bending, BentStems, Effort, Tick, bent};
use crate::descent::Descent;
use crate::weather::{Sampler, Weather};
use crate::{CLOCK, Error};

/// Most ticks up to a time that is asked for.
const MOST_TICKS: f64 = 1e7;
/// Most stems of the ticks that are kept.
const MOST_KEPT: usize = 1_000_000;
/// Largest number of marks.
const MOST_MARKS: usize = 24;
/// The first distance between marks, in ticks.
const FIRST_SPACING: u64 = 64;
/// Part of a tick over which the rates of growth are taken.
const LOOK_BACK: f64 = 1.0 / 1024.0;

/// A run of growth with the motion of its stems, at a tick and up to the next.
#[derive(Clone)]
struct Course<'m> {
    growth: Simulation<'m>,
    bending: Bending<'m>,
    /// The number of the present tick.
    number: u64,
    tick: Arc<Tick>,
    /// Productions from the present tick to the next.
    descent: Arc<Descent>,
    /// The strings a little before the next tick, and at the next tick, if growth gets there.
    ahead: Result<Arc<[ModuleString; 2]>, Error>,
}

impl<'m> Course<'m> {
    /// From t = 0.
    fn new(mut growth: Simulation<'m>, mut bending: Bending<'m>) -> Result<Course<'m>, Error> {
        let mut string = ModuleString::default();
        growth.at(0.0, &mut string)?;
        growth.take_events();
        let tick = Arc::new(bending.advance(0, &string, None)?);
        let descent = Arc::default();
        let mut course = Course { growth, bending, number: 0, tick, descent, ahead: Ok(Arc::default()) };
        course.look_ahead();
        Ok(course)
    }

    /// Lets growth go on to the next tick. It may fail there, after a time that is asked for.
    fn look_ahead(&mut self) {
        let model = self.bending.model();
        let unit = model.scenery.units.time;
        let next = (self.number + 1) as f64 * CLOCK / unit;
        let mut strings = <[ModuleString; 2]>::default();
        let [before, now] = &mut strings;
        let gone = self.growth.at(next - LOOK_BACK * CLOCK / unit, before);
        let gone = gone.and_then(|()| self.growth.at(next, now));
        let mut descent = Descent::default();
        descent.add(model, &self.growth.take_events());
        self.descent = Arc::new(descent);
        self.ahead = gone.map(|()| Arc::new(strings)).map_err(Error::from);
    }

    /// Goes on to the next tick; returns the one that is past.
    fn tick(&mut self) -> Result<Past, Error> {
        let ahead = self.ahead.clone()?;
        let [before, now] = &*ahead;
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

/// The passive motion of a model: its stems in the wind.
pub struct Motion<'m> {
    model: &'m Model,
    courses: Mutex<Courses<'m>>,
}

struct Courses<'m> {
    present: Course<'m>,
    /// In the order of time, without gaps, up to the present tick.
    past: VecDeque<Past>,
    marks: Vec<Course<'m>>,
    spacing: u64,
    scene: Scene,
}

impl<'m> Motion<'m> {
    /// The motion of a model whose origin stands at a place (in m, for the wind), from t = 0. `None` if nothing in it is passive.
    ///
    /// # Errors
    /// A wind without meaning, or the first instant fails.
    pub fn new(
        model: &'m Model,
        settings: Settings,
        weather: Option<Arc<Weather>>,
        origin: [f64; 3],
        passive: sway::Settings,
    ) -> Result<Option<Motion<'m>>, Error> {
        if model.scenery.tissues.is_empty() {
            return Ok(None);
        }
        let growth = Simulation::new(model, Settings { log: true, transitions: false, ..settings })?;
        let sampler = Arc::new(Sampler::new(weather, origin.into()));
        let present = Course::new(growth, Bending::new(model, sampler, passive))?;
        let courses = Courses {
            marks: vec![present.clone()],
            present,
            past: VecDeque::new(),
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

    /// Work of the present course from t = 0.
    pub fn effort(&self) -> Effort {
        self.courses.lock().unwrap_or_else(PoisonError::into_inner).present.bending.effort
    }
}

impl<'m> Courses<'m> {
    fn at(&mut self, model: &'m Model, string: &ModuleString) -> Result<BentStems, Error> {
        let units = model.scenery.units;
        let number = (string.time * units.time / CLOCK).floor();
        if number > MOST_TICKS {
            let span = model.scenery.tissues[0].span;
            return Err(Error::TooLong { most: MOST_TICKS, time: string.time, seconds: units.time, span });
        }
        let number = number.max(0.0) as u64;
        if number < self.present.number && !self.past.front().is_some_and(|past| past.number <= number) {
            let mark = self.marks.iter().rev().find(|mark| mark.number <= number);
            let mark = mark.or(self.marks.first()).cloned();
            if let Some(mark) = mark {
                (self.present, self.past) = (mark, VecDeque::new());
            }
        }
        if number >= self.present.number {
            while self.present.number < number {
                self.tick()?;
            }
            let Course { tick, descent, .. } = &self.present;
            return bent(tick, descent, model, string, &mut self.scene);
        }
        let first = self.past.front().map_or(0, |past| past.number);
        let Past { tick, descent, .. } = &self.past[(number - first) as usize];
        bent(tick, descent, model, string, &mut self.scene)
    }

    /// Goes on to the next tick.
    fn tick(&mut self) -> Result<(), Error> {
        let past = self.present.tick()?;
        self.past.push_back(past);
        let size = |past: &Past| past.tick.size() + 1;
        let mut kept: usize = self.past.iter().map(size).sum();
        while kept > MOST_KEPT && self.past.len() > 1 {
            kept -= self.past.pop_front().map_or(0, |past| size(&past));
        }
        self.mark();
        Ok(())
    }

    /// Sets a mark where one is due.
    fn mark(&mut self) {
        let number = self.present.number;
        if number % self.spacing != 0 || self.marks.last().is_some_and(|mark| mark.number >= number) {
            return;
        }
        self.marks.push(self.present.clone());
        if self.marks.len() > MOST_MARKS {
            self.spacing *= 2;
            let spacing = self.spacing;
            self.marks.retain(|mark| mark.number % spacing == 0);
        }
    }
}
