//! The frames of a running simulation, drawn on other threads.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::common::{Clock, Failure, ModelRun};
use super::events::EventLog;
use super::parallel;
use crate::diagnostic::Diagnostic;
use crate::interrupt;
use crate::scene::Scene;
use crate::session::Nursery;
use crate::sim::{Event, Settings, Simulation, Stats};
use crate::tree::ModuleString;

/// The string of modules at one observed time.
pub struct Frame {
    pub index: usize,
    pub time: f64,
    /// Productions since the frame before.
    events: Vec<Event>,
    string: Result<ModuleString, Failure>,
}

impl Frame {
    /// Number of modules, brackets not counted.
    pub fn modules(&self) -> usize {
        let string = self.string.as_ref().ok();
        string.map_or(0, |string| string.iter().filter(|m| !m.kind.is_bracket()).count())
    }

    /// Productions since the frame before, if the settings include the log.
    pub fn events(&self) -> &[Event] {
        &self.events
    }
}

/// A simulation and the times at which it is observed.
struct FrameSource<'r> {
    run: &'r ModelRun,
    simulation: Simulation<'r>,
    next: usize,
    failed: bool,
}

impl<'r> FrameSource<'r> {
    fn start(run: &'r ModelRun, settings: Settings) -> Result<FrameSource<'r>, Failure> {
        let simulation = run.session.simulate(settings).map_err(|error| run.fault(&error))?;
        Ok(FrameSource { run, simulation, next: 0, failed: false })
    }

    /// The frame at the next time; `None` after the last, or after an error.
    fn next_frame(&mut self) -> Option<Frame> {
        let index = self.next;
        let &time = self.run.times.get(index).filter(|_| !self.failed)?;
        self.next += 1;
        if interrupt::asked() {
            self.failed = true;
            let string = Err(Failure::Model(format!("stopped before t = {time}\n")));
            return Some(Frame { index, time, events: Vec::new(), string });
        }
        let mut string = ModuleString::default();
        let wound = self.simulation.at(time, &mut string).map_err(|error| self.run.fault(&error));
        self.failed = wound.is_err();
        Some(Frame { index, time, events: self.simulation.take_events(), string: wound.map(|()| string) })
    }
}

/// Settings of one pass through the animation.
#[derive(Clone, Copy)]
pub struct Pass {
    pub settings: Settings,
    /// See [`Scene::accuracy`].
    pub accuracy: f64,
}

/// Runs a model from the beginning: `work` is done on each of its scenes, on several threads, and `take` gets the
/// results in the order of time. The time spent is added to the clock; for drawing and writing, the sum over all threads.
///
/// # Errors
/// The first error in the order of time, of the run, of drawing, or of `take`.
pub fn play<Done: Send>(
    run: &ModelRun,
    pass: Pass,
    threads: usize,
    clock: &mut Clock,
    mut log: Option<&mut EventLog>,
    work: impl Fn(&Frame, &Scene) -> Done + Sync,
    mut take: impl FnMut(Done) -> Result<(), Failure>,
) -> Result<Stats, Failure> {
    let mut source = FrameSource::start(run, pass.settings)?;
    let nursery = run.nursery();
    let mut blank = nursery.blank();
    blank.accuracy = pass.accuracy;
    // Scenes are reused, because they keep their memory; there is at most one for each thread.
    let scenes: Mutex<Vec<Scene>> = Mutex::default();
    let pool = || scenes.lock().unwrap_or_else(PoisonError::into_inner);
    let Clock { mut simulate, mut output, .. } = *clock;
    let make = || {
        let before = Instant::now();
        let frame = source.next_frame();
        simulate += before.elapsed();
        frame
    };
    let draw = |mut frame: Frame| -> (Vec<Event>, Vec<Diagnostic>, Result<Done, Failure>, Duration) {
        let before = Instant::now();
        let pooled = pool().pop();
        let mut scene = pooled.unwrap_or_else(|| blank.clone());
        let done = draw_frame(run, &nursery, &mut frame, &mut scene).map(|()| work(&frame, &scene));
        let warnings = std::mem::take(&mut scene.warnings);
        pool().push(scene);
        (frame.events, warnings, done, before.elapsed())
    };
    let taken = parallel::in_order(threads, make, draw, |(events, warnings, done, spent)| {
        if let Some(log) = &mut log {
            log.write(&events)?;
        }
        run.note(warnings);
        let before = Instant::now();
        take(done?)?;
        output += spent + before.elapsed();
        Ok(())
    });
    (clock.simulate, clock.output) = (simulate, output);
    run.note(source.simulation.remarks());
    taken.map(|()| source.simulation.stats())
}

/// Draws a frame.
fn draw_frame(
    run: &ModelRun,
    nursery: &Nursery,
    frame: &mut Frame,
    scene: &mut Scene,
) -> Result<(), Failure> {
    scene.clear();
    match &mut frame.string {
        Ok(string) => run.draw(nursery, string, scene),
        failed => std::mem::replace(failed, Ok(ModuleString::default())).map(|_| ()),
    }
}
