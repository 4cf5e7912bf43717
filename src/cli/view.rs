//! `dlsys view`: the growing plant in a window, or as a page for the browser.

use std::io::Write;
use std::path::Path;

use super::album::Keeping;
use super::args::ViewArgs;
use super::common::{Failure, ModelRun, cores, count_of, out_error};
use super::frame_source::{Frame, Pass, play, play_at};
use super::one_file::{named, refuse_stream};
use super::progress::Progress;
use crate::diagnostic::Diagnostic;
use crate::player::{Clouds, Recorder, Recording, Stage, page};
use crate::render::{self, Survey, View};
use crate::scene::Scene;
use crate::sim::Settings;

/// Largest number of frames of a recording, about five minutes at 60 frames per second.
const MOST_FRAMES: usize = 20_000;

/// Frames that are looked at before a scene of plants is recorded, and how many times what a page holds is certainly too much: what
/// moves straight takes fewer numbers.
const LOOKS: usize = 8;
const CERTAIN: usize = 4;

/// Opens the window, or writes a page.
pub fn view(args: &ViewArgs) -> Result<(), Failure> {
    match &args.out {
        Some(out) => {
            refuse_stream(out, &format!("a page has a name: `-o {}`", named(&args.shared.model, "html")))?;
            write(args, out)
        }
        None => open(args),
    }
}

#[cfg(not(feature = "viewer"))]
fn open(args: &ViewArgs) -> Result<(), Failure> {
    let model = args.shared.model.display();
    Err(Failure::Usage(format!(
        "error: this dlsys was built without the window\n  help: `dlsys view {model} -o plant.html` writes a page that plays the growth in a browser;\n        `cargo install --path . --features viewer` builds the window too (minutes; no system packages)\n"
    )))
}

#[cfg(feature = "viewer")]
fn open(args: &ViewArgs) -> Result<(), Failure> {
    use super::common::settings;
    use crate::player::Error;
    use crate::player::window::{Options, Trial, open};
    let shared = &args.shared;
    let model = shared.model.clone();
    if !model.is_file() {
        // The same message as from other commands.
        return super::common::open(&model, &shared.settings, &shared.include).map(drop);
    }
    let range = shared.from.zip(shared.to).map(|(from, to)| [from, to]);
    if let Some([from, to]) = range.filter(|[from, to]| to < from) {
        return Err(Failure::Usage(format!("error: --to {to} is before --from {from}\n")));
    }
    let options = Options {
        model,
        set: shared.settings.clone(),
        include: shared.include.folders.clone(),
        settings: settings(shared)?,
        range,
        at: shared.at.as_ref().and_then(|at| at.iter().copied().reduce(f64::min)),
        trial: Trial {
            delay: args.delay,
            slide: args.slide.clone(),
            play: args.play,
            screenshot: args.screenshot.clone(),
        },
    };
    open(options).map_err(|error| {
        let help = match error {
            Error::Screen(_) => "\n  help: `-o plant.html` writes a page that plays the growth in a browser",
            _ => "",
        };
        Failure::Model(format!("error: {error}{help}\n"))
    })
}

/// Writes the page of a model.
fn write(args: &ViewArgs, out: &Path) -> Result<(), Failure> {
    spare(args, out)?;
    let run = ModelRun::start(&args.shared)?.on_threads(None);
    let count = run.times.len();
    if count > MOST_FRAMES {
        return Err(Failure::Usage(format!(
            "error: {count} frames are too many for a page, which takes {MOST_FRAMES}: choose fewer with `--from A --to B --step S`\n"
        )));
    }
    look_ahead(&run)?;
    let recording = record(&run, args.accuracy)?;
    let document = page::document(&recording);
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = out.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
    render::replace(folder, &name, document.as_bytes())
        .map_err(|error| Failure::Model(format!("error: {error}\n")))?;
    let megabytes = document.len() as f64 / 1e6;
    writeln!(std::io::stdout(), "{}: {}, {megabytes:.1} MB", out.display(), count_of(count, "frame"))
        .map_err(out_error)
}

/// Refuses to overwrite a file that is not a page of dlsys.
fn spare(args: &ViewArgs, out: &Path) -> Result<(), Failure> {
    use std::io::Read;
    let usage = |message: String| Err(Failure::Usage(format!("error: {message}\n")));
    if out.is_dir() || out.file_name().is_none() {
        return usage(format!("`-o {}` is a directory: name the page, such as plant.html", out.display()));
    }
    let Ok(file) = std::fs::File::open(out) else { return Ok(()) };
    let mut start = Vec::new();
    let read = file.take(page::MARK.len() as u64).read_to_end(&mut start);
    if args.force || (read.is_ok() && start == page::MARK.as_bytes()) {
        return Ok(());
    }
    usage(format!(
        "{} is there and is not a page of `dlsys view`: choose another name, or add --force",
        out.display()
    ))
}

/// Refuses at once what is certainly too much to record: a scene of plants whose frames, by a look at a few of them, have many times the
/// numbers that a page holds.
fn look_ahead(run: &ModelRun) -> Result<(), Failure> {
    let count = run.times.len();
    if run.session.model.scenery.plants.is_empty() || count <= 2 * LOOKS {
        return Ok(());
    }
    let times = (0..LOOKS).map(|i| run.times[i * (count - 1) / (LOOKS - 1)]).collect();
    let pass =
        Pass { settings: Settings { log: false, ..run.settings }, keeping: Keeping::Nothing, accuracy: 0.0 };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut numbers = 0;
    let weight = |_: &Frame, scene: &Scene| Stage::weight(scene);
    play_at(run, times, pass, threads, (&mut { run.clock }, None), weight, |weight| {
        numbers += weight;
        Ok(())
    })?;
    let all = numbers / LOOKS * count;
    if all <= CERTAIN * Recorder::MOST_NUMBERS {
        return Ok(());
    }
    let millions = |numbers: usize| (numbers as f64 / 1e6).round();
    Err(Failure::Model(format!(
        "error: there is too much to record: the plants of {count} frames are placed by about {} million numbers, and a page holds {} million\n  \
         help: take fewer plants, or fewer frames with `--from A --to B --step S`; a film holds any number: `dlsys render MODEL --format webp`\n",
        millions(all),
        millions(Recorder::MOST_NUMBERS),
    )))
}

/// Runs the model twice, because recorded coordinates are relative to the extent of the animation. Frames are drawn on all
/// cores; the recording does not depend on their number.
fn record(run: &ModelRun, accuracy: Option<f64>) -> Result<Recording, Failure> {
    let threads = cores();
    run.take_ground_in_pieces();
    let mut clock = run.clock;
    let nothing = Survey::new(View::FRONT);
    let mut survey = nothing.clone();
    let pass =
        Pass { settings: Settings { log: false, ..run.settings }, keeping: Keeping::Nothing, accuracy: 0.0 };
    let mut progress = Progress::new("measuring", run.times.len());
    let of_frame = |_: &Frame, scene: &Scene| {
        let mut survey = nothing.clone();
        survey.add(scene);
        (survey, scene.gases.iter().map(|gas| gas.blobs.len() as u64).sum::<u64>())
    };
    let (mut blobs, mut fullest) = (0, 0);
    play(run, pass, threads, &mut clock, None, of_frame, |(frame, count)| {
        survey.merge(&frame);
        (blobs, fullest) = (blobs + count, count.max(fullest));
        progress.inc();
        Ok(())
    })?;
    drop(progress);
    let mut fit = survey.fit();
    run.note_what_is_seen(&survey);
    run.warn();
    if let Some(accuracy) = accuracy {
        fit = fit.with_accuracy(accuracy);
    }
    let (model, source) = (&run.session.model, &run.session.source);
    let name =
        Path::new(&source.name).file_name().map_or(source.name.clone(), |n| n.to_string_lossy().into());
    let mut recorder = Recorder::new(model, &run.nursery().blank(), &name, &fit);
    recorder.surround(&survey.first_surroundings());
    let clouds = Clouds::of(blobs, fullest);
    if clouds.share() > 1 {
        let warning = Diagnostic::warning(format!("the page shows one of {} blobs of gas", clouds.share()))
            .help("what it shows is as dense as all of them; for all of them in each frame, take pictures: `dlsys render MODEL --format png`");
        run.note(vec![warning]);
        run.warn();
    }
    recorder.expect(clouds);
    // Ground is followed in the order of time, in pieces that serve for all frames.
    let ground = run.nursery();
    let quilt = match run.times.last() {
        Some(end) => ground.quilt(*end).map_err(|error| run.misdrawn(&error))?,
        None => None,
    };
    let mut bare = ground.blank();
    let pass = Pass {
        settings: Settings { log: true, ..run.settings },
        keeping: Keeping::Nothing,
        accuracy: fit.accuracy,
    };
    let mut progress = Progress::new("recording", run.times.len());
    let staged = |frame: &Frame, scene: &Scene| {
        let mut stage = Stage::default();
        stage.set(scene, &fit);
        (frame.time, frame.modules() as u64, frame.events().to_vec(), stage)
    };
    play(run, pass, threads, &mut clock, None, staged, |(time, modules, events, mut stage)| {
        if let Some(quilt) = &quilt {
            bare.clear();
            ground.draw_quilt(time, quilt, &mut bare).map_err(|error| run.misdrawn(&error))?;
            stage.add_ground(&bare);
        }
        recorder.history().add(&events, model, source);
        progress.inc();
        recorder.add(time, modules, &stage).map_err(|error| {
            Failure::Model(format!(
                "error: {error}\n  help: take fewer frames with `--from A --to B --step S`\n"
            ))
        })
    })?;
    drop(progress);
    Ok(recorder.finish())
}
