//! `--format glb` and `--format usda` of `dlsys run` and of `dlsys render`: a growing plant as one file that other programs play.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use super::album::Keeping;
use super::args::{RenderArgs, RunArgs};
use super::common::{Clock, Failure, ModelRun, cores, count_of, out_error, size_of};
use super::events::EventLog;
use super::frame_source::{Frame, Pass, play_at};
use super::one_file::{file_of, place_of, save, spare, spare_copy};
use super::progress::Progress;
use super::render::flags::of_pictures;
use super::shared::{SharedArgs, Topology};
use crate::diagnostic::Diagnostic;
use crate::interchange::{self, Error, Growth, Options, Summary, grow, vary_usda};
use crate::interrupt;
use crate::render::{Companion, Fit, Format, FrameWriter, Layout, Survey, View, aside};
use crate::scene::Scene;
use crate::sim::Stats;

/// Half of the side of the floor, in parts of the extent: as in OBJ files.
const FLOOR: f64 = 5.0;
/// Frames from one to the next that is measured.
const SURVEYED: usize = 4;
/// Bytes from which a file gets a hint about its size.
const LARGE: usize = 50_000_000;

/// How the file is written, from the flags of either command.
struct Order<'a> {
    format: interchange::Format,
    shared: &'a SharedArgs,
    out: PathBuf,
    /// In units of the model.
    accuracy: Option<f64>,
    /// Units of the model's time in a second.
    speed: Option<f64>,
    topology: Topology,
    threads: usize,
    limit: u64,
    force: bool,
    quiet: bool,
}

impl Order<'_> {
    fn spare(&self) -> Result<(), Failure> {
        if self.topology == Topology::Varying && self.format != interchange::Format::Usda {
            return Err(usage(format!(
                "--topology varying does not go with --format {}: its meshes keep their triangles; choose --format usda",
                self.format.extension()
            )));
        }
        let mark = self.format.mark();
        let kind = format!("a {}", self.format.extension().to_uppercase());
        spare(&self.out, self.force, &kind, |start| start.starts_with(mark))
    }
}

fn usage(message: impl std::fmt::Display) -> Failure {
    Failure::Usage(format!("error: {message}\n"))
}

/// Refuses flags of `run` that are for files, where it prints text.
pub fn refuse_flags(args: &RunArgs) -> Result<(), Failure> {
    let file = &args.file;
    let given = [
        ("--out", file.out.is_some()),
        ("--accuracy", file.accuracy.is_some()),
        ("--speed", file.speed.is_some()),
        ("--topology", file.topology == Topology::Varying),
        ("--force", file.force),
    ];
    if let Some((flag, _)) = given.iter().find(|(_, given)| *given) {
        return Err(usage(format!(
            "{flag} is for animated files; name a file that ends in .glb or .usda, or add --format glb or usda; a picture is written by `dlsys render`; or leave it out and take what is printed: `dlsys run … > strings.txt`"
        )));
    }
    Ok(())
}

/// `dlsys run MODEL --format glb -o FILE`.
pub fn run(args: &RunArgs, format: interchange::Format) -> Result<(), Failure> {
    let given = [
        ("--field", args.field.is_some()),
        ("--seeds", args.seeds.is_some()),
        ("--verify", args.verify.verify),
    ];
    refuse(format, &given, "a file holds one growing plant")?;
    let model = &args.shared.model;
    let Some(out) = &args.file.out else {
        let name = model.file_stem().map_or("plant".into(), |stem| stem.to_string_lossy());
        let extension = format.extension();
        return Err(usage(format!(
            "`--format {extension}` writes a file: name it, such as `-o {name}.{extension}`"
        )));
    };
    let order = Order {
        format,
        shared: &args.shared,
        out: file_of(out, model, format.extension())?,
        accuracy: args.file.accuracy,
        speed: args.file.speed,
        topology: args.file.topology,
        threads: args.threads.unwrap_or_else(cores),
        limit: u64::MAX,
        force: args.file.force,
        quiet: false,
    };
    order.spare()?;
    write(&order, ModelRun::start(&args.shared)?.on_threads(args.threads), &|| false)
}

/// `dlsys render MODEL --format glb -o FILE`.
pub fn render(
    args: &RenderArgs,
    format: interchange::Format,
    stale: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    order_of(args, format)?.spare()?;
    render_run(args, format, ModelRun::start(&args.shared)?.on_threads(args.threads), stale)
}

/// The same for a model that has been read.
pub fn render_run(
    args: &RenderArgs,
    format: interchange::Format,
    run: ModelRun,
    stale: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    let order = order_of(args, format)?;
    order.spare()?;
    write(&order, run, stale)
}

/// The flags of `render`; those for pictures are refused.
fn order_of(args: &RenderArgs, format: interchange::Format) -> Result<Order<'_>, Failure> {
    refuse(
        format,
        &[("--fps", args.fps.is_some())],
        "the program that plays the file has a rate of its own",
    )?;
    let in_a_plane = [("--view", args.view.is_some()), ("--layout", args.layout != Layout::Frames)];
    let pictures: Vec<_> = in_a_plane.into_iter().chain(of_pictures(args)).collect();
    refuse(format, &pictures, "the file is a plant in space, and the program that shows it has a camera")?;
    refuse(format, &[("--seeds", args.seeds.is_some())], "a file holds one growing plant")?;
    Ok(Order {
        format,
        shared: &args.shared,
        out: file_of(&args.out, &args.shared.model, format.extension())?,
        accuracy: args.accuracy,
        speed: args.speed,
        topology: args.topology,
        threads: args.threads.unwrap_or_else(cores),
        limit: args.max_output,
        force: args.force,
        quiet: args.quiet,
    })
}

fn refuse(format: interchange::Format, given: &[(&str, bool)], why: &str) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(usage(format!(
            "{flag} does not go with --format {}: {why}; leave it out",
            format.extension()
        ))),
        None => Ok(()),
    }
}

/// Runs the model twice: to measure it, because all accuracy is relative to its extent, and to follow it.
fn write(order: &Order<'_>, run: ModelRun, stale: &dyn Fn() -> bool) -> Result<(), Failure> {
    let begun = Instant::now();
    let is_still = run.times.len() < 2 && order.topology != Topology::Varying;
    let holds_plants = is_still && order.format == interchange::Format::Glb;
    if !holds_plants && !run.session.model.scenery.plants.is_empty() {
        return Err(failure(&run, &Error::Plants));
    }
    let mut clock = run.clock;
    let (survey, stats) = measure(order, &run, &mut clock)?;
    if stale() {
        return Err(Failure::Stale);
    }
    let fit = FrameWriter::new(Format::OBJ, survey.fit()).fit;
    let options = options(order, &run, &survey, &fit);
    if order.topology == Topology::Varying {
        let summary = varying(order, &run, options, &mut clock)?;
        run.write_stats(order.shared, clock, stats)?;
        return report(order, &summary, fit.accuracy / Fit::ACCURACY, begun);
    }
    let growth = follow(order, &run, &options, &mut clock)?;
    let before = Instant::now();
    let bytes = growth.file(order.format).map_err(|error| failure(&run, &error))?;
    if bytes.len() as u64 > order.limit {
        return Err(Failure::Model(format!(
            "error: the file is {}, and --max-output allows {}\n\n  = help: a coarser --accuracy makes it smaller\n",
            size_of(bytes.len() as u64),
            size_of(order.limit)
        )));
    }
    let companions = growth.companions(order.format);
    copy(order, &companions)?;
    save(&order.out, &bytes)?;
    clock.output += before.elapsed();
    run.write_stats(order.shared, clock, stats)?;
    if order.quiet {
        return Ok(());
    }
    let seconds = begun.elapsed().as_secs_f64();
    let beside: String = companions.iter().map(|companion| format!(", with {}", companion.name)).collect();
    let mut line = format!(
        "{}{beside}: {}, {}, {}, in {seconds:.2} s\n",
        order.out.display(),
        count_of(growth.nodes(), "node"),
        match growth.lives() {
            1 => "1 different life".to_owned(),
            lives => format!("{lives} different lives"),
        },
        size_of(bytes.len() as u64),
    );
    if bytes.len() > LARGE && order.accuracy.is_none() {
        line += "  large: a coarser --accuracy, or a shorter time, makes a smaller file\n";
    }
    std::io::stdout().write_all(line.as_bytes()).map_err(out_error)
}

/// Writes the pictures beside the file.
fn copy(order: &Order<'_>, companions: &[Companion]) -> Result<(), Failure> {
    for companion in companions {
        spare_copy(&order.out.with_file_name(&companion.name), &companion.bytes, order.force)?;
    }
    companions.iter().try_for_each(|Companion { name, bytes }| save(&order.out.with_file_name(name), bytes))
}

/// Writes a file whose triangles change from frame to frame, under a temporary name until it is whole.
fn varying(
    order: &Order<'_>,
    run: &ModelRun,
    mut options: Options,
    clock: &mut Clock,
) -> Result<Summary, Failure> {
    let before = Instant::now();
    options.limits.bytes = order.limit;
    let io = |error: std::io::Error| {
        Failure::Model(format!("error: cannot write {}: {error}\n", order.out.display()))
    };
    let place = place_of(&order.out)?.0;
    let file = aside(place).map_err(|error| Failure::Model(format!("error: {error}\n")))?;
    let mut progress = bar(order, "writing", run.times.len());
    let mut out = std::io::BufWriter::with_capacity(1 << 20, file);
    let summary = vary_usda(&run.session, run.settings, &run.times, &options, &mut out, &mut |_| {
        progress.inc();
        !interrupt::asked()
    });
    drop(progress);
    let summary = summary.map_err(|error| failure(run, &error))?;
    copy(order, &summary.companions)?;
    let file = out.into_inner().map_err(|error| io(error.into_error()))?;
    file.persist(&order.out).map_err(|error| io(error.error))?;
    clock.simulate += before.elapsed();
    Ok(summary)
}

/// A line about a file whose triangles change.
fn report(order: &Order<'_>, summary: &Summary, extent: f64, begun: Instant) -> Result<(), Failure> {
    if order.quiet {
        return Ok(());
    }
    let beside: String =
        summary.companions.iter().map(|companion| format!(", with {}", companion.name)).collect();
    let line = format!(
        "{}{beside}: {}, {} corners in the largest, velocities to {:.0e} of the extent a second, {}, in {:.2} s\n",
        order.out.display(),
        count_of(summary.frames, "frame"),
        summary.corners,
        summary.velocity_error / extent,
        size_of(summary.bytes),
        begun.elapsed().as_secs_f64(),
    );
    std::io::stdout().write_all(line.as_bytes()).map_err(out_error)
}

/// The first pass.
fn measure(order: &Order<'_>, run: &ModelRun, clock: &mut Clock) -> Result<(Survey, Stats), Failure> {
    let nothing = Survey::new(View::FRONT);
    let mut survey = nothing.clone();
    let mut events = EventLog::create(order.shared.events.as_deref(), run)?;
    // The extent changes little from frame to frame.
    let count = run.times.len();
    let times = (0..count).filter(|i| i % SURVEYED == 0 || i + 1 == count).map(|i| run.times[i]).collect();
    let mut progress = bar(order, "measuring", count.div_ceil(SURVEYED));
    let pass = Pass { settings: run.settings, keeping: Keeping::Nothing, accuracy: 0.0 };
    let of_frame = |_: &Frame, scene: &Scene| {
        let mut survey = nothing.clone();
        survey.add(scene);
        survey
    };
    let measured = play_at(run, times, pass, order.threads, (clock, events.as_mut()), of_frame, |frame| {
        survey.merge(&frame);
        progress.inc();
        Ok(())
    });
    drop(progress);
    if measured.is_ok() {
        run.note_what_is_seen(&survey);
    }
    run.warn();
    events.map_or(Ok(()), EventLog::finish)?;
    measured.map(|stats| (survey, stats))
}

/// How the run becomes a file.
fn options(order: &Order<'_>, run: &ModelRun, survey: &Survey, fit: &Fit) -> Options {
    let extent = fit.accuracy / Fit::ACCURACY;
    let mut options = Options::new(&run.session.model, fit.default_width, extent);
    options.threads = order.threads;
    options.grown = fit.is_grown();
    options.gases = true;
    if let Some(accuracy) = order.accuracy {
        options.accuracy = fit.clone().with_accuracy(accuracy).accuracy / extent;
    }
    if let Some(speed) = order.speed {
        options.seconds = 1.0 / speed;
    }
    if let Some(height) = survey.first_surroundings().floor {
        let [low, high] = fit.bounds.unwrap_or_default();
        let middle = crate::scene::Point::from((low.coords + high.coords) / 2.0);
        options.floor = Some([height, middle.x, middle.z, FLOOR * extent]);
    }
    options
}

/// The second pass.
fn follow(
    order: &Order<'_>,
    run: &ModelRun,
    options: &Options,
    clock: &mut Clock,
) -> Result<Growth, Failure> {
    let before = Instant::now();
    let (first, last) = (run.times.first().copied().unwrap_or(0.0), run.times.last().copied().unwrap_or(0.0));
    let mut progress = bar(order, "following", 1000);
    let mut reached = |time: f64| {
        progress.reach((time - first) / (last - first).max(f64::MIN_POSITIVE));
        !interrupt::asked()
    };
    let growth = grow(&run.session, run.settings, &run.times, options, &mut reached);
    drop(progress);
    clock.simulate += before.elapsed();
    growth.map_err(|error| failure(run, &error))
}

fn bar(order: &Order<'_>, what: &str, count: usize) -> Progress {
    if order.quiet { Progress::quiet() } else { Progress::new(what, count) }
}

/// An error as a message, with advice where there is some.
fn failure(run: &ModelRun, error: &interchange::Error) -> Failure {
    let drawn = |diagnostic: Diagnostic| {
        Failure::Model(diagnostic.render(&run.session.source, super::common::coloured()))
    };
    let span = run.times.last().unwrap_or(&0.0) - run.times.first().unwrap_or(&0.0);
    let a_minute =
        format!("let more of the model's time pass in a second: `--speed {:.0}`", (span / 60.0).ceil());
    let help: &[&str] = match error {
        Error::Run(error) => return run.fault(error),
        Error::Draw(error) => return drawn(error.diagnostic()),
        Error::Plants => &[
            "a single time of the whole scene: `dlsys render MODEL --at T -o scene.glb`, in which plants that look the same share a mesh",
            "for what moves, write the other model by itself, and place copies of it in the program that takes the file",
        ],
        Error::TooMany { .. } => &[
            "each is a node of its own, and programs for scenes hardly open more; end earlier with `--to T`",
            "a single time of any size: `dlsys render MODEL --at T --format obj`",
        ],
        Error::TooLarge { .. } => {
            &["a coarser --accuracy needs fewer numbers; so does a shorter time with `--from A --to B`"]
        }
        Error::TooManyShapes { .. } => &[
            "draw what turns in a module of its own: a module is turned as a whole, while turns within its interpretation change its shape",
            "a coarser --accuracy needs fewer shapes; so does a shorter time with `--from A --to B`",
        ],
        Error::Bytes { .. } => &[
            "a coarser --accuracy has fewer triangles, and fewer frames (--step) fewer of them",
            "without `--topology varying` shapes are shared by modules, and the file is much smaller",
        ],
        Error::TooLong { .. } => &[&a_minute],
        Error::TooFar { .. } => &[
            "let the plant stand nearer to the origin, or write USD, which keeps all digits: `--format usda`",
        ],
        Error::GroundTooFar { .. } => &["a ground at the foot of the plants, as in `ground 0`"],
        Error::TooWide { .. } => &["a shorter unit, `units length 1e-30`, or an earlier end, `--to T`"],
        _ => &[],
    };
    let help: String = help.iter().map(|line| format!("\n  = help: {line}")).collect();
    let gap = if help.is_empty() { "" } else { "\n" };
    Failure::Model(format!("error: {error}\n{gap}{}{gap}", help.trim_start_matches('\n')))
}
