//! The whole life of the plant at a glance: how much space it takes up, how many modules it has when, what happens.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::look::Space;
use crate::History;
use dlsys_geometry::scene::Scene;
use dlsys_render::{Survey, View};
use dlsys_session::{Nursery, Session};
use dlsys_sim::{Passed, Settings, Simulation};
use dlsys_tree::ModuleString;

/// What is known of a life.
#[derive(Clone, Default)]
pub struct Life {
    pub space: Space,
    /// Some times, and the modules that there are then, brackets not counted.
    pub counts: Vec<(f64, u64)>,
    pub history: History,
    /// Nothing is missing.
    pub whole: bool,
}

/// Most times at which modules are counted, and at which the space is measured.
const MOST_COUNTED: usize = 400;
const MOST_MEASURED: usize = 24;
/// Entries that are passed before somebody looks at the flag.
const STRIDE: usize = 64;
/// For so long the window waits for the first picture; then it shows the part that is known.
const PATIENCE: Duration = Duration::from_millis(1500);

/// A life that is being gone through.
pub struct Living<'s> {
    session: &'s Session,
    /// None if it is over, or ended in an error, which is told when that time is to be shown.
    simulation: Option<Simulation<'s>>,
    times: Vec<f64>,
    survey: Survey,
    nursery: Nursery<'s>,
    scene: Scene,
    string: ModuleString,
    life: Life,
    begun: Instant,
    told: bool,
}

impl<'s> Living<'s> {
    pub fn new(session: &'s Session, settings: Settings, [from, to]: [f64; 2], step: f64) -> Living<'s> {
        let nursery = Nursery::new(&session.model, settings).without_ground();
        let frames = if step > 0.0 { ((to - from) / step).round() as usize } else { 0 };
        let pieces = frames.clamp(1, MOST_COUNTED);
        let times = (0..=pieces).map(|i| from + (to - from) * i as f64 / pieces as f64).collect();
        Living {
            session,
            simulation: session.simulate(Settings { log: true, ..settings }).ok(),
            times,
            survey: Survey::new(View::FRONT),
            scene: nursery.blank(),
            nursery,
            string: ModuleString::default(),
            life: Life::default(),
            begun: Instant::now(),
            told: false,
        }
    }

    pub fn is_done(&self) -> bool {
        self.life.whole
    }

    /// What is known by now.
    pub fn life(&self) -> Life {
        Life { space: Space::of(&self.survey), ..self.life.clone() }
    }

    /// Goes on for a while. True if there is something to tell: all, or after some time a part.
    pub fn advance(&mut self, stop: &AtomicBool) -> bool {
        if self.life.whole {
            return false;
        }
        let next = self.life.counts.len();
        match self.times.get(next).copied() {
            Some(time) => match self.look(time, next, stop) {
                Some(true) => {}
                Some(false) => return false,
                None => self.life.whole = true,
            },
            None => self.life.whole = true,
        }
        let late = !self.told && self.begun.elapsed() > PATIENCE && !self.life.counts.is_empty();
        self.told |= late;
        if self.life.whole {
            self.simulation = None;
        }
        late || self.life.whole
    }

    /// Looks at a time. False if it was interrupted, `None` if there is an error.
    fn look(&mut self, time: f64, number: usize, stop: &AtomicBool) -> Option<bool> {
        let simulation = self.simulation.as_mut()?;
        while simulation.pass_some(time, STRIDE, false).ok()? != Passed::All {
            if stop.load(Ordering::Relaxed) {
                return Some(false);
            }
        }
        simulation.at(time, &mut self.string).ok()?;
        let session = self.session;
        self.life.history.add(&simulation.take_events(), &session.model, &session.source);
        let each = self.times.len().div_ceil(MOST_MEASURED);
        if number.is_multiple_of(each) || number + 1 == self.times.len() {
            self.scene.clear();
            self.nursery.draw(&self.string, &mut self.scene).ok()?;
            self.survey.add(&self.scene);
        }
        let modules = self.string.iter().filter(|m| !m.kind.is_bracket()).count() as u64;
        self.life.counts.push((time, modules));
        Some(true)
    }
}
