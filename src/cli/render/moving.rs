//! `--format asvg`: all frames as one SVG document that plays by itself.

use std::io::Write;
use std::time::Instant;

use super::super::one_file::{file_of, save, spare};
use super::{
    Failure, ModelRun, Orbit, Render, count_of, film, flags, out_error, out_of_directory, pace, play,
    size_of, turntable,
};
use crate::cli::album::Album;
use crate::cli::args::RenderArgs;
use crate::cli::values::ANIMATED_SVG;
use crate::render::{Error, Format, FrameWriter, Moving};

/// The extension of the file.
const EXTENSION: &str = "svg";
/// Bytes from which there is a hint about the size.
const LARGE: usize = 20_000_000;

/// `dlsys render MODEL --format asvg -o FILE`.
pub fn render(args: &RenderArgs, stale: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    check(args)?;
    let run = ModelRun::start(&args.shared)?.on_threads(args.threads);
    render_run(args, run, stale)
}

/// Refuses flags that do not go with it, and a file that is not to be written over. Returns that file.
fn check(args: &RenderArgs) -> Result<std::path::PathBuf, Failure> {
    film::agree(args, ANIMATED_SVG)?;
    if args.shutter.is_some() {
        return Err(film::usage(
            "--shutter averages pixels, and SVG files have none; choose a film of pixels (webp, apng, gif or y4m)",
        ));
    }
    if args.out.as_os_str() == film::STREAM {
        return Err(film::usage("`-o -` is for --format y4m; an animated SVG is a file: `-o film.svg`"));
    }
    let out = file_of(&args.out, &args.shared.model, EXTENSION)?;
    spare(&out, args.force, "an animated SVG", Moving::begins)?;
    Ok(out)
}

/// The same for a model that has been read.
pub fn render_run(
    args: &RenderArgs,
    mut run: ModelRun,
    stale: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    let begun = Instant::now();
    let out = check(args)?;
    run.note_missing_gases("an SVG picture");
    turntable::repeat(args, &mut run.times);
    let mut clock = run.clock;
    let mut render = Render {
        args,
        format: Format::SVG,
        run: &run,
        out: &args.out,
        threads: flags::threads(args),
        frames: Vec::new(),
        album: Some(Album::default()),
        stale,
    };
    let survey = render.measure(flags::survey(args)?, &mut clock)?;
    let fit = flags::fit(args, &survey, |fit| fit.picture)?;
    let mut writer = FrameWriter::new(render.format, fit);
    writer.page = flags::page(args, writer.page.picture)?;
    let ends = pace::ends(args, &run);
    let seconds = ends.last().copied().unwrap_or_default();
    let mut moving = Moving::new(ends);
    let mut progress = render.bar("writing", run.times.len());
    let orbit = Orbit::new(args, &run.times);
    let stats = play(
        &run,
        render.writing(&writer.fit),
        render.threads,
        &mut clock,
        None,
        |frame, scene| {
            let angle = orbit.map(|orbit| orbit.angle(frame.index as f64, frame.time));
            turntable::turned(&writer, angle).write(scene, "")
        },
        |document| {
            moving.add(&String::from_utf8_lossy(&document)).map_err(out_of_directory)?;
            progress.inc();
            Ok(())
        },
    )?;
    drop(progress);
    let text = moving.finish(render.title());
    if text.len() as u64 > args.max_output {
        return Err(out_of_directory(Error::TooLarge { limit: args.max_output }));
    }
    save(&out, text.as_bytes())?;
    run.warn();
    run.write_stats(&args.shared, clock, stats)?;
    if args.quiet {
        return Ok(());
    }
    let mut line = format!(
        "{}: {}, {seconds:.2} s to play, {}, in {:.2} s\n",
        out.display(),
        count_of(run.times.len(), "frame"),
        size_of(text.len() as u64),
        begun.elapsed().as_secs_f64()
    );
    if text.len() > LARGE {
        line += "  large: what is shaded is drawn frame by frame; take fewer frames with --step, or --format webp\n";
    }
    std::io::stdout().write_all(line.as_bytes()).map_err(out_error)
}
