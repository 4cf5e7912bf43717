//! The frames of a running simulation, drawn on other threads.

use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::album::{Album, Keeping};
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
    modules: usize,
    string: Result<ModuleString, Failure>,
}

impl Frame {
    /// Number of modules, brackets not counted.
    pub fn modules(&self) -> usize {
        self.modules
    }

    /// Productions since the frame before, if the settings include the log.
    pub fn events(&self) -> &[Event] {
        &self.events
    }
}

/// Where the frames of a pass come from.
enum Origin<'r> {
    Simulation(Box<Simulation<'r>>),
    /// All scenes or strings are kept from a pass before, which had these statistics.
    Album(&'r Album, Stats),
}

/// Frames at the times at which a model is observed.
struct FrameSource<'r> {
    run: &'r ModelRun,
    times: Cow<'r, [f64]>,
    origin: Origin<'r>,
    next: usize,
    failed: bool,
}

impl<'r> FrameSource<'r> {
    fn start(
        run: &'r ModelRun,
        times: Cow<'r, [f64]>,
        settings: Settings,
        album: Option<&'r Album>,
    ) -> Result<FrameSource<'r>, Failure> {
        let kept = album.and_then(|album| Some((album, album.stats_of_all(times.len())?)));
        let origin = match kept {
            Some((album, stats)) => Origin::Album(album, stats),
            None => {
                let simulation = run.session.simulate(settings).map_err(|error| run.fault(&error))?;
                Origin::Simulation(Box::new(simulation))
            }
        };
        Ok(FrameSource { run, times, origin, next: 0, failed: false })
    }

    fn stats(&self) -> Stats {
        match &self.origin {
            Origin::Simulation(simulation) => simulation.stats(),
            Origin::Album(_, stats) => *stats,
        }
    }

    /// The frame at the next time; `None` after the last, or after an error.
    fn next_frame(&mut self) -> Option<Frame> {
        let index = self.next;
        let &time = self.times.get(index).filter(|_| !self.failed)?;
        self.next += 1;
        if interrupt::asked() {
            self.failed = true;
            let string = Err(Failure::Model(format!("stopped before t = {time}\n")));
            return Some(Frame { index, time, events: Vec::new(), modules: 0, string });
        }
        let mut string = ModuleString::default();
        let simulation = match &mut self.origin {
            Origin::Simulation(simulation) => simulation,
            Origin::Album(album, _) => {
                let (string, modules) = album.string(index);
                return Some(Frame { index, time, events: Vec::new(), modules, string: Ok(string) });
            }
        };
        let wound = simulation.at(time, &mut string).map_err(|error| self.run.fault(&error));
        self.failed = wound.is_err();
        let modules = string.iter().filter(|m| !m.kind.is_bracket()).count();
        let events = simulation.take_events();
        Some(Frame { index, time, events, modules, string: wound.map(|()| string) })
    }
}

/// Settings of one pass through the animation.
#[derive(Clone, Copy)]
pub struct Pass<'a> {
    pub settings: Settings,
    pub keeping: Keeping<'a>,
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
    pass: Pass<'_>,
    threads: usize,
    clock: &mut Clock,
    log: Option<&mut EventLog>,
    work: impl Fn(&Frame, &Scene) -> Done + Sync,
    take: impl FnMut(Done) -> Result<(), Failure>,
) -> Result<Stats, Failure> {
    play_times(run, Cow::Borrowed(&run.times), pass, threads, (clock, log), work, take)
}

/// The same at other times than those of the run, without an album.
///
/// # Errors
/// As of [`play`].
pub fn play_at<Done: Send>(
    run: &ModelRun,
    times: Vec<f64>,
    pass: Pass<'_>,
    threads: usize,
    (clock, log): (&mut Clock, Option<&mut EventLog>),
    work: impl Fn(&Frame, &Scene) -> Done + Sync,
    take: impl FnMut(Done) -> Result<(), Failure>,
) -> Result<Stats, Failure> {
    let pass = Pass { keeping: Keeping::Nothing, ..pass };
    play_times(run, Cow::Owned(times), pass, threads, (clock, log), work, take)
}

fn play_times<Done: Send>(
    run: &ModelRun,
    times: Cow<'_, [f64]>,
    pass: Pass<'_>,
    threads: usize,
    (clock, mut log): (&mut Clock, Option<&mut EventLog>),
    work: impl Fn(&Frame, &Scene) -> Done + Sync,
    mut take: impl FnMut(Done) -> Result<(), Failure>,
) -> Result<Stats, Failure> {
    let count = times.len();
    let mut source = FrameSource::start(run, times, pass.settings, pass.keeping.used())?;
    // With fewer frames than threads, several threads share a frame.
    let nursery = run.nursery().with_threads((threads / count.max(1)).max(1));
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
        let kept = pass.keeping.used().and_then(|album| album.take(frame.index));
        let is_kept = kept.is_some();
        let pooled = kept.or_else(|| pool().pop());
        let mut scene = pooled.unwrap_or_else(|| blank.clone());
        scene.accuracy = pass.accuracy;
        let drawn = if is_kept { Ok(()) } else { draw_frame(run, &nursery, &mut frame, &mut scene) };
        let is_whole = drawn.is_ok();
        let done = drawn.map(|()| work(&frame, &scene));
        let warnings = std::mem::take(&mut scene.warnings);
        let unkept = match (pass.keeping.filled().filter(|_| is_whole), frame.string) {
            (Some(album), Ok(string)) => album.keep((frame.index, count), scene, (string, frame.modules)),
            _ => Some(scene).filter(|_| !is_kept),
        };
        pool().extend(unkept);
        (frame.events, warnings, done, before.elapsed())
    };
    let taken: Result<(), Failure> =
        parallel::in_order(threads, make, draw, |(events, warnings, done, spent)| {
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
    run.note_sway(nursery.sway_report());
    if let Origin::Simulation(simulation) = &source.origin {
        run.note(simulation.remarks());
    }
    taken?;
    if let Some(album) = pass.keeping.filled() {
        album.finish(source.stats());
    }
    Ok(source.stats())
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
