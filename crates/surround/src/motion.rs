//! Passive motion with random access to time: the same bits whatever is asked for, in whatever order.
//!
//! ```text
//! ticks   t₀   t₁   t₂   t₃   t₄   t₅ ...       a global grid, t_n = n · 1/30 s
//! growth  ───────────────────────▶              one tick ahead of the stems
//! stems   ──────────────────▶ present
//! ```

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_diagnostic::Span;
use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle;
use dlsys_model::Model;
use dlsys_sim::memory::{self, TICKS_OF_MEMORY};
use dlsys_sim::{self as sim, Settings};
use dlsys_sway as sway;
use dlsys_tree::ModuleString;

use crate::bending::{Bending, BentStems, Effort, Foot, bent};
use crate::classes::ByModes;
use crate::coupled;
use crate::course::{Course, Past};
use crate::flights::Flights;
use crate::marks::{Marks, Recent};
use crate::place::Place;
use crate::sampler::Sampler;
use crate::weather::Weather;
use crate::{CLOCK, Error};

/// Most ticks up to a time that is asked for.
pub const MOST_TICKS: f64 = 1e7;
/// Most stems of the ticks that are kept.
const MOST_KEPT: usize = 1_000_000;

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

/// The passive motion of a model: its stems in the wind, and what it lets go.
pub struct Motion<'m> {
    model: &'m Model,
    courses: Mutex<Courses<'m>>,
}

struct Courses<'m> {
    /// At the first tick.
    start: Course<'m>,
    present: Course<'m>,
    /// What has been let go up to the latest tick, if anything may be. A release is the same whichever course comes by.
    flights: Option<Flights<'m>>,
    past: Recent<Past>,
    /// `None` if none are kept.
    marks: Option<Marks<Course<'m>>>,
    /// Seconds that the stems may take, and what they have taken.
    limit: f64,
    spent: Duration,
    /// Bytes that the process may take.
    memory: u64,
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
        weather: Option<Arc<Weather<'m>>>,
        place: Place,
        passive: Passive,
    ) -> Result<Option<Motion<'m>>, Error> {
        if !turtle::bends(model) && !turtle::lets_go(model) {
            return Ok(None);
        }
        check(model, &place, place.first_tick() as f64)?;
        let settings = Settings { log: true, transitions: false, ..settings };
        let growth = coupled::start(model, settings, place)?;
        let sampler = Arc::new(Sampler::new(weather, place));
        let bending =
            Bending::new(model, sampler.clone(), place, passive.solver).by_modes(passive.modes.clone());
        let mut flights = Flights::new(model, sampler, place, passive.solver.tolerance);
        let present = Course::new(model, (growth, bending), &mut flights)?;
        present.bending.forget_wind();
        let courses = Courses {
            start: present.clone(),
            past: Recent::new(passive.kept),
            marks: passive.marks.then(|| Marks::new(usize::MAX)),
            limit: settings.max_seconds,
            memory: settings.max_memory,
            spent: Duration::ZERO,
            present,
            flights,
            scene: turtle::blank(model),
        };
        Ok(Some(Motion { model, courses: Mutex::new(courses) }))
    }

    /// The strains of a string of the model, and where what it has let go is, at the string's time.
    ///
    /// # Errors
    /// The growth up to that time fails, or the motion of the stems or of what falls does.
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
        // Each of many plants would keep instants of its own.
        courses.present.bending.forget_wind();
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

    /// The feet of stems at the present tick: those that stand on what does not give way.
    pub fn feet(&self) -> Vec<Foot> {
        self.courses.lock().unwrap_or_else(PoisonError::into_inner).present.tick.feet()
    }

    /// The times, in units of the model, at which what it has let go was jolted by the ground, as far as it has been followed.
    pub fn jolts(&self) -> Vec<f64> {
        let courses = self.courses.lock().unwrap_or_else(PoisonError::into_inner);
        courses.flights.iter().flat_map(Flights::jolts).collect()
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
    let (seconds, span) = (place.units.time, span(model));
    let time = place.time_at(number * CLOCK);
    Err(Error::TooLong { most: MOST_TICKS, time, seconds, span })
}

/// The place in the text of the first declaration, or module, that makes a model passive.
fn span(model: &Model) -> Span {
    let tissue = model.scenery.tissues.first().map(|tissue| tissue.span);
    tissue.or_else(|| turtle::place_of_detach(model)).unwrap_or_default()
}

impl<'m> Courses<'m> {
    fn at(&mut self, model: &'m Model, string: &ModuleString) -> Result<BentStems, Error> {
        let mut stems = self.bent(model, string)?;
        if let Some(flights) = &mut self.flights {
            let begun = self.limit.is_finite().then(Instant::now);
            stems.flown = flights.poses(model, string)?;
            self.spent += begun.map_or(Duration::ZERO, |begun| begun.elapsed());
            self.check_time()?;
        }
        Ok(stems)
    }

    fn bent(&mut self, model: &'m Model, string: &ModuleString) -> Result<BentStems, Error> {
        let place = *self.present.bending.place();
        let number = self.number_of(model, place.seconds(string.time))?;
        // Before the first tick nothing has moved.
        if number < place.first_tick() as f64 {
            return Ok(BentStems::at_rest());
        }
        let number = number as u64;
        if number < self.present.number {
            if let Some(Past { tick, descent, .. }) = self.past.get(number) {
                return bent(tick, descent, &self.present.bending, string, &mut self.scene);
            }
            let mark = self.marks.as_ref().and_then(|marks| marks.before(number));
            self.present = mark.unwrap_or(&self.start).clone();
            self.past.clear();
        }
        while self.present.number < number {
            self.tick()?;
        }
        let Course { tick, descent, held, .. } = &self.present;
        if let Some((_, error)) = held.as_ref().filter(|(since, _)| *since <= string.time) {
            return Err(error.clone());
        }
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
        let past = self.present.tick(&mut self.flights);
        self.spent += begun.map_or(Duration::ZERO, |begun| begun.elapsed());
        self.check_time()?;
        if self.present.number.is_multiple_of(TICKS_OF_MEMORY) {
            self.check_memory()?;
        }
        let past = past?;
        let size = past.size();
        self.past.add(past.number, past, size);
        if let Some(marks) = &mut self.marks {
            marks.set(self.present.number, &self.present, |_| 0);
        }
        Ok(())
    }

    /// Fails if the surroundings have taken more time than they may.
    fn check_time(&self) -> Result<(), Error> {
        if self.spent.as_secs_f64() <= self.limit {
            return Ok(());
        }
        let (time, span) = self.present_place();
        Err(Error::OutOfTime { limit: self.limit, time, span })
    }

    /// Fails if there is no memory to go on.
    fn check_memory(&self) -> Result<(), Error> {
        memory::ask_for_a_little(self.memory).map_err(|shortage| {
            let (time, span) = self.present_place();
            Error::OutOfMemory { shortage, time, span }
        })
    }

    /// The present time, in units of the model, and what moves.
    fn present_place(&self) -> (f64, Span) {
        let bending = &self.present.bending;
        (bending.place().time_of(self.present.number), span(bending.model()))
    }
}
