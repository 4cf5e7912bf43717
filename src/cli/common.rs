//! Parts that the commands share: reading the model, times, settings, statistics, failures.

use std::collections::HashSet;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::args::{IncludeArgs, RenderArgs};
use super::output;
use super::shared::{Scheduler, SharedArgs};
use crate::compile::Setting;
use crate::diagnostic::{Diagnostic, Span};
use crate::model::Frames;
use crate::render::{Layout, Survey, View};
use crate::scene::Scene;
use crate::session::{Detail, DrawError, Nursery, Session, SwayReport};
use crate::sim::{self, Settings, Simulation, Stats, brief};
use crate::tree::ModuleString;
use crate::turtle;

/// Why a command ends without success, which determines the exit status.
#[derive(Debug)]
pub enum Failure {
    /// An error in the model or the run, with the rendered message: status 1.
    Model(String),
    /// An error in the command line, with the message: status 2.
    Usage(String),
    /// The reader of standard output has closed the pipe, which is not an error: status 0.
    ClosedPipe,
    /// A file that the command reads has changed, so its result would be obsolete.
    Stale,
}

impl Failure {
    /// Adds the seed of the specimen that failed.
    pub fn of_seed(self, seed: u64) -> Failure {
        match self {
            Failure::Model(message) => {
                let message = message.trim_end();
                Failure::Model(format!(
                    "{message}\n  = note: this happens to the specimen of `--seed {seed}`\n\n"
                ))
            }
            other => other,
        }
    }
}

/// The failure for an error of standard output.
pub fn out_error(error: std::io::Error) -> Failure {
    match error.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::ClosedPipe,
        _ => Failure::Model(format!("error: cannot write: {error}\n")),
    }
}

/// Writes a message to standard error. Errors of that are ignored.
pub fn tell(message: &str) {
    use std::io::Write;
    let _ = std::io::stderr().write_all(message.as_bytes());
}

/// `1 rule`, `2 rules`.
pub fn count_of(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// A number of bytes with its unit.
pub fn size_of(bytes: u64) -> String {
    match bytes as f64 {
        n if n >= 1e9 => format!("{:.2} GB", n / 1e9),
        n if n >= 1e6 => format!("{:.1} MB", n / 1e6),
        n if n >= 1e3 => format!("{:.0} kB", n / 1e3),
        n => format!("{n} bytes"),
    }
}

/// True if messages may be coloured.
pub fn coloured() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

/// Largest number of messages printed for one model.
const MOST_SHOWN: usize = 50;

/// Reads a model and prints its warnings.
pub fn open(path: &Path, settings: &[Setting], include: &IncludeArgs) -> Result<Session, Failure> {
    match Session::open_with(path, settings, &include.folders) {
        Ok(session) => {
            for warning in session.warnings.iter().take(MOST_SHOWN) {
                tell(&warning.render(&session.source, coloured()));
            }
            Ok(session)
        }
        Err(refused) => {
            let draw = |all: &[Diagnostic]| -> String {
                let shown = all.iter().take(MOST_SHOWN).map(|d| d.render(&refused.source, coloured()));
                let mut text: String = shown.collect();
                if all.len() > MOST_SHOWN {
                    text += &format!("… and {} more\n", all.len() - MOST_SHOWN);
                }
                text
            };
            if refused.diagnostics.iter().any(|d| d.severity == crate::diagnostic::Severity::Error) {
                return Err(Failure::Model(draw(&refused.diagnostics)));
            }
            Err(Failure::Usage(draw(&refused.settings)))
        }
    }
}

/// Time spent in each stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    pub parse: Duration,
    pub simulate: Duration,
    pub output: Duration,
}

/// A model, with the times and settings with which it is to be run.
pub struct ModelRun {
    pub session: Session,
    /// Warnings found while drawing.
    remarks: Mutex<Remarks>,
    pub times: Vec<f64>,
    pub settings: Settings,
    /// The size of the pictures, if they have one: see [`Nursery::for_picture`].
    pub detail: Option<Detail>,
    /// How plants were followed in the wind.
    sway: Mutex<Option<SwayReport>>,
    /// Time spent; at first that of reading the model.
    pub clock: Clock,
}

/// Warnings of frames, without duplicates.
#[derive(Default)]
struct Remarks {
    known: HashSet<(String, Option<Span>)>,
    waiting: Vec<Diagnostic>,
    /// What is written holds no gases.
    lacks_gases: bool,
    /// What is written has ground of soil in pieces of its own.
    has_ground_in_pieces: bool,
}

/// The content of the file of `--stats`.
#[derive(Serialize)]
struct StatsFile {
    parse_s: f64,
    simulate_s: f64,
    output_s: f64,
    frames: usize,
    /// Seed of the random numbers.
    seed: u64,
    #[serde(flatten)]
    counts: Stats,
    /// How plants of other models were followed in the wind.
    #[serde(skip_serializing_if = "Option::is_none")]
    sway: Option<SwayStats>,
}

/// A [`SwayReport`] in the file.
#[derive(Serialize)]
struct SwayStats {
    plants: usize,
    solved: usize,
    by_modes: usize,
    /// Least and greatest number of modes of a root.
    modes: [usize; 2],
    classes: usize,
    /// Measured on a sample.
    error_pixels: f64,
}

impl SwayStats {
    fn of(report: SwayReport) -> SwayStats {
        let SwayReport { plants, solved, by_modes, modes, classes, error_pixels } = report;
        SwayStats { plants, solved, by_modes, modes, classes, error_pixels }
    }
}

/// Largest number of slices of the scheduler `local`, the same as that of frames.
const MAX_SLICES: f64 = 1e7;

/// Refuses to overwrite the model, or to write two outputs into one file.
fn spare_files(args: &SharedArgs) -> Result<(), Failure> {
    let there = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let named =
        [("model", Some(&args.model)), ("--events", args.events.as_ref()), ("--stats", args.stats.as_ref())];
    for (i, (_, second)) in named.iter().enumerate() {
        let Some(second) = second else { continue };
        for (what, first) in &named[..i] {
            if first.is_some_and(|first| there(first) == there(second)) {
                let (name, path) = (named[i].0, second.display());
                let of = if *what == "model" { "the model itself" } else { "the file of `--events`" };
                return Err(Failure::Usage(format!("error: `{name} {path}` would be written over {of}\n")));
            }
        }
    }
    Ok(())
}

/// Refuses flags that are wrong for any model.
fn ready(args: &SharedArgs) -> Result<(), Failure> {
    args.solver.apply(Settings::default())?;
    for (flag, path) in [("--stats", &args.stats), ("--events", &args.events)] {
        if let Some(path) = path.as_ref().filter(|path| path.is_dir()) {
            return Err(Failure::Usage(format!(
                "error: `{flag} {0}` is a directory\n\n  = help: name a file in it, such as `{flag} {1}`\n",
                path.display(),
                path.join(if flag == "--stats" { "stats.json" } else { "events.jsonl" }).display()
            )));
        }
        // Checked before a long run, not after it.
        let folder = path.as_ref().and_then(|path| path.parent()).filter(|f| !f.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            return Err(Failure::Usage(format!(
                "error: there is no directory {0} for the file of `{flag}`\n\n  = help: make it first: `mkdir -p {0}`\n",
                folder.display()
            )));
        }
    }
    scheduler(args)?;
    spare_files(args)
}

/// Number of threads by default: one for each core.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The settings given by the flags.
///
/// # Errors
/// Flags that are wrong for any model.
pub fn settings(args: &SharedArgs) -> Result<Settings, Failure> {
    ready(args)?;
    let settings = args.solver.apply(args.budget.settings())?;
    Ok(Settings { scheduler: scheduler(args)?, log: args.events.is_some(), ..settings })
}

/// The scheduler given by the flags.
fn scheduler(args: &SharedArgs) -> Result<sim::Scheduler, Failure> {
    let usage = |message: &str| Err(Failure::Usage(format!("error: {message}\n")));
    match (args.scheduler, args.slice) {
        (Scheduler::Local, Some(_)) if args.solver.method.is_fixed_step() => {
            usage("the scheduler `local` has slices of its own: choose a method with step control")
        }
        (Scheduler::Local, Some(slice)) => Ok(sim::Scheduler::Local { slice }),
        (Scheduler::Local, None) => {
            usage("the scheduler `local` goes by slices of time: give their length with `--slice DT`")
        }
        (_, Some(_)) => usage("`--slice` is for `--scheduler local`"),
        (Scheduler::Auto, None) => Ok(sim::Scheduler::Auto),
        (Scheduler::Global, None) => Ok(sim::Scheduler::Global),
    }
}

impl ModelRun {
    /// Reads the model.
    pub fn start(args: &SharedArgs) -> Result<ModelRun, Failure> {
        let before = Instant::now();
        ready(args)?;
        let session = open(&args.model, &args.settings, &args.include)?;
        let mut run = ModelRun::of(session, args)?;
        run.clock.parse = before.elapsed();
        Ok(run)
    }

    /// A run of a model that has been read.
    pub fn of(session: Session, args: &SharedArgs) -> Result<ModelRun, Failure> {
        let settings = settings(args)?;
        let times = times(args, &session)?;
        if let (sim::Scheduler::Local { slice }, Some(end)) = (settings.scheduler, times.last())
            && end / slice > MAX_SLICES
        {
            return Err(Failure::Usage(format!(
                "error: {slice} is too short a slice: it takes {:.1e} of them up to t = {end}, and {MAX_SLICES:e} are the most\n",
                end / slice
            )));
        }
        if let Some(end) = times.last().filter(|_| settings.method.is_fixed_step()) {
            let (h, steps) = (settings.step_size, end / settings.step_size);
            if steps > settings.max_events as f64 {
                return Err(Failure::Usage(format!(
                    "error: {h:e} is too short a step: it takes {steps:.1e} of them up to t = {end}, and {} are the most\n\n  \
                     = help: if this is meant, allow more: `--max-events {:.0e}`\n",
                    settings.max_events,
                    steps.min(1e308)
                )));
            }
        }
        let settings = Settings { horizon: times.last().copied().unwrap_or(settings.horizon), ..settings };
        let (remarks, sway) = Default::default();
        Ok(ModelRun { session, remarks, times, settings, detail: None, sway, clock: Clock::default() })
    }

    /// The same on so many threads; by default on one for each core. Results do not depend on it.
    pub fn on_threads(mut self, threads: Option<usize>) -> ModelRun {
        self.settings.threads = threads.unwrap_or_else(cores);
        self
    }

    /// Starts a simulation.
    pub fn simulate(&self) -> Result<Simulation<'_>, Failure> {
        self.session.simulate(self.settings).map_err(|error| self.fault(&error))
    }

    /// The failure for an error of the run, with the rendered message.
    pub fn fault(&self, error: &sim::Error) -> Failure {
        Failure::Model(error.diagnostic().render(&self.session.source, coloured()))
    }

    /// Draws the strings of a run, with plants of other models.
    pub fn nursery(&self) -> Nursery<'_> {
        let nursery = Nursery::new(&self.session.model, self.settings).for_picture(self.detail);
        let Remarks { lacks_gases, has_ground_in_pieces, .. } =
            *self.remarks.lock().unwrap_or_else(PoisonError::into_inner);
        let nursery = if lacks_gases { nursery.without_gases() } else { nursery };
        if has_ground_in_pieces { nursery.with_ground_in_pieces() } else { nursery }
    }

    /// Notes that files or pages of some sort do not hold the gases of the model, if it has any; these are not followed then.
    pub fn note_missing_gases(&self, what: &str) {
        let model = &self.session.model;
        if let Some(span) = turtle::place_of_source(model).filter(|_| turtle::lets_out(model)) {
            let warning = Diagnostic::warning(format!("{what} does not hold gases"))
                .at(span, "what begins here is not seen in it")
                .help("PNG pictures and films show gases: `dlsys render MODEL --format png`; OBJ, GLB and USDA files have blobs as points");
            self.note(vec![warning]);
            self.remarks.lock().unwrap_or_else(PoisonError::into_inner).lacks_gases = true;
        }
    }

    /// Notes that a sheet of frames is not seen from the camera that the model declares, unless a flag says from where it is.
    pub fn note_unused_camera(&self, args: &RenderArgs) {
        if args.layout == Layout::Frames || args.view.is_some() || args.perspective.is_some() {
            return;
        }
        let Some(camera) = &self.session.model.scenery.camera else { return };
        let warning = Diagnostic::warning(format!("--layout {} does not use the camera", args.layout.name()))
            .at(camera.span, "stages on a sheet are moved apart, and seen from the front")
            .help("choose another direction, `--view 20,10`, or render a file for each frame, which the camera takes");
        self.note(vec![warning]);
    }

    /// Notes that a floor without end hides the sky of a picture that is seen from above without perspective.
    pub fn note_covered_sky(&self, args: &RenderArgs) {
        let scenery = &self.session.model.scenery;
        let has_camera = args.camera.is_some() || args.view.is_none() && scenery.camera.is_some();
        let has_sky = args.sky.is_some() || scenery.sky.is_some();
        let has_floor = args.ground.is_some() || scenery.ground.is_some();
        if has_camera || args.perspective.is_some() || !has_sky || !has_floor {
            return;
        }
        let view = args.view.as_deref().and_then(|view| view.parse().ok()).unwrap_or(View::FRONT);
        if view.is_from_above() {
            let warning = Diagnostic::warning("the floor hides the sky")
                .help("without perspective a floor has no horizon: see the scene in perspective, such as with `--perspective 40`");
            self.note(vec![warning]);
        }
    }

    /// Frames are drawn without ground of soil, whose pieces [`Nursery::draw_quilt`] draws.
    pub fn take_ground_in_pieces(&self) {
        self.remarks.lock().unwrap_or_else(PoisonError::into_inner).has_ground_in_pieces = true;
    }

    /// Notes how the plants of a pass were followed in the wind. A pass of scenes that are kept follows none.
    pub fn note_sway(&self, report: Option<SwayReport>) {
        if report.is_some() {
            *self.sway.lock().unwrap_or_else(PoisonError::into_inner) = report;
        }
    }

    /// How plants of other models were followed in the wind; `None` if none sways.
    pub fn sway(&self) -> Option<SwayReport> {
        *self.sway.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// An error of the turtle, with its place in the text.
    pub fn draw(&self, nursery: &Nursery, string: &ModuleString, scene: &mut Scene) -> Result<(), Failure> {
        nursery.draw(string, scene).map_err(|error| self.misdrawn(&error))
    }

    /// The failure for an error of drawing, with the rendered message.
    pub fn misdrawn(&self, error: &DrawError) -> Failure {
        Failure::Model(error.diagnostic().render(&self.session.source, coloured()))
    }

    /// Adds the warnings of a frame; new ones are kept for [`ModelRun::warn`].
    pub fn note(&self, warnings: Vec<Diagnostic>) {
        if warnings.is_empty() {
            return;
        }
        let mut remarks = self.remarks.lock().unwrap_or_else(PoisonError::into_inner);
        for warning in warnings {
            let key = (warning.message.clone(), warning.labels.first().map(|label| label.0));
            if remarks.known.insert(key) {
                remarks.waiting.push(warning);
            }
        }
    }

    /// Adds a warning if nothing is drawn in any frame, or little but the width of a stem.
    pub fn note_what_is_seen(&self, survey: &Survey) {
        if let Some((widest, extent)) = survey.too_wide() {
            let width = brief(widest.width, 4);
            let scale = brief(extent / (20.0 * widest.width), 1);
            let warning = Diagnostic::warning("a stem is wider than half of the largest side of the drawing")
                .at(widest.span, format!("{width} wide at t = {}, and the largest side is {}", brief(widest.time, 6), brief(extent, 4)))
                .help(format!(
                    "widths are lengths in scene units, as those of `F`; in cpfg they are pixels: scale them, such as `!({scale}*w)`"
                ));
            self.note(vec![warning]);
        }
        if survey.fit().bounds.is_none() {
            let warning = Diagnostic::warning("nothing is drawn in any frame").help(
                "the turtle draws F, surfaces such as @L, and what `interpret` says of other modules: `interpret A(x): F(x)`",
            );
            self.note(vec![warning]);
        }
    }

    /// Prints the new warnings.
    pub fn warn(&self) {
        let mut remarks = self.remarks.lock().unwrap_or_else(PoisonError::into_inner);
        for warning in remarks.waiting.drain(..).take(MOST_SHOWN) {
            tell(&warning.render(&self.session.source, coloured()));
        }
    }

    /// Writes the file of `--stats`.
    pub fn write_stats(&self, args: &SharedArgs, clock: Clock, counts: Stats) -> Result<(), Failure> {
        let Some(path) = &args.stats else { return Ok(()) };
        let file = StatsFile {
            parse_s: clock.parse.as_secs_f64(),
            simulate_s: clock.simulate.as_secs_f64(),
            output_s: clock.output.as_secs_f64(),
            frames: self.times.len(),
            seed: self.settings.seed,
            counts,
            sway: self.sway().map(SwayStats::of),
        };
        let text = serde_json::to_string_pretty(&file)
            .map_err(|error| Failure::Model(format!("error: cannot write {}: {error}\n", path.display())))?
            + "\n";
        output::write(path, &text)
    }
}

/// The time between observed times: that of `--step`, of the rate of a film, or of the model.
pub fn step(args: &SharedArgs, session: &Session) -> Option<f64> {
    let units = session.model.scenery.units.time;
    let of_rate = args.rate.map(|rate| rate.speed.unwrap_or(1.0 / units) / rate.frames);
    args.step.or(of_rate).or(session.model.frames.map(|own| own.step))
}

/// The observed times, in ascending order without duplicates.
pub fn times(args: &SharedArgs, session: &Session) -> Result<Vec<f64>, Failure> {
    if let Some(at) = &args.at {
        let mut times = at.clone();
        times.sort_by(f64::total_cmp);
        times.dedup();
        return Ok(times);
    }
    let own = session.model.frames;
    // The model gives the values that the flags leave out.
    let (from, to, step) =
        (args.from.or(own.map(|own| own.from)), args.to.or(own.map(|own| own.to)), step(args, session));
    let (Some(from), Some(to), Some(step)) = (from, to, step) else {
        return Err(Failure::Usage(
            "error: the model has no `frames`: say when to look with `--at T1,T2,…` or `--from A --to B --step S`\n"
                .to_owned(),
        ));
    };
    let frames = Frames { from, to, step };
    if to < from {
        let own = |flag: Option<f64>| if flag.is_some() { "" } else { " of the model" };
        return Err(Failure::Usage(format!(
            "error: --to {to}{} is before --from {from}{}\n",
            own(args.to),
            own(args.from)
        )));
    }
    if (to - from) / step >= Frames::LIMIT as f64 {
        return Err(Failure::Usage(format!("error: more than {} frames\n", Frames::LIMIT)));
    }
    Ok(frames.times().collect())
}
