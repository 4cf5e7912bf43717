//! `--format webp`, `apng`, `gif` and `y4m`: all frames as a film in one file.
//!
//! Pictures are drawn on several threads and taken in order; only those in work and the one before are in memory.

use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::super::one_file::{file_of, place_of, spare};
use super::{
    Clock, Failure, ModelRun, Moments, Orbit, Render, count_of, flags, out_error, out_of_directory, pace,
    play, size_of, turntable,
};
use crate::cli::album::Album;
use crate::cli::args::RenderArgs;
use crate::film::{Film, Format, Shape};
use crate::render::{self, FrameWriter, Layout};

/// Standard output in place of a file.
pub(super) const STREAM: &str = "-";

pub(super) fn usage(message: impl std::fmt::Display) -> Failure {
    Failure::Usage(format!("error: {message}\n"))
}

/// `dlsys render MODEL --format webp -o FILE`.
pub fn render(args: &RenderArgs, format: Format, stale: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    check(args, format)?;
    let mut run = ModelRun::start(&args.shared)?.on_threads(args.threads);
    run.detail = flags::detail(args, render::Format::PNG);
    render_run(args, format, run, stale)
}

/// Refuses flags that do not go with a format of whole animations.
pub(super) fn agree(args: &RenderArgs, name: &str) -> Result<(), Failure> {
    pace::agree(args)?;
    flags::survey(args)?;
    flags::of_layouts(args)?;
    if args.layout != Layout::Frames {
        return Err(usage(format!(
            "--layout {} puts all frames on one sheet, and --format {name} makes a film of them; choose one of the two",
            args.layout.name()
        )));
    }
    if args.seeds.is_some() {
        return Err(usage(format!(
            "--seeds does not go with --format {name}: a film shows one plant; leave it out"
        )));
    }
    Ok(())
}

/// Refuses flags that do not go with films, and files that are not to be written over. Returns the file; `None` is standard output.
fn check(args: &RenderArgs, format: Format) -> Result<Option<PathBuf>, Failure> {
    let name = format.extension();
    agree(args, name)?;
    let is_clear = args.background.is_some_and(|background| background.0.is_none());
    if is_clear && !format.has_alpha() {
        return Err(usage(format!(
            "{name} files have no transparency; choose a colour, or --format webp or apng"
        )));
    }
    if args.out.as_os_str() == STREAM {
        return match format {
            Format::Y4m => Ok(None),
            _ => Err(usage(format!("`-o -` is for --format y4m; a {name} film is a file: `-o film.{name}`"))),
        };
    }
    let out = file_of(&args.out, &args.shared.model, name)?;
    spare(&out, args.force, &format!("a {}", name.to_uppercase()), |start| format.begins(start))?;
    Ok(Some(out))
}

/// The same for a model that has been read.
pub fn render_run(
    args: &RenderArgs,
    format: Format,
    mut run: ModelRun,
    stale: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    let begun = Instant::now();
    let out = check(args, format)?;
    turntable::repeat(args, &mut run.times);
    let mut clock = run.clock;
    let mut render = Render {
        args,
        format: render::Format::PNG,
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
    let mut target = Target::begin(out.as_deref(), args.max_output)?;
    let (stats, note) = film(&render, format, &writer, &mut target, &mut clock)?;
    let bytes = target.bytes;
    target.finish(out.as_deref())?;
    run.warn();
    run.write_stats(&args.shared, clock, stats)?;
    let (false, Some(out)) = (args.quiet, out) else { return Ok(()) };
    let [width, height] = writer.page.pixels;
    let ends = pace::ends(args, &run);
    let (asked, played) = (ends.last().copied().unwrap_or(0.0), format.played(&ends));
    let slower = match played > 1.05 * asked {
        true => format!(
            "  its frames are too short for {}, so it plays more slowly than the {asked:.2} s asked for\n",
            format.extension()
        ),
        false => String::new(),
    };
    let line = format!(
        "{}: {} of {width}x{height} pixels, {}{:.2} s to play, {}, in {:.2} s\n{note}{slower}{}",
        out.display(),
        count_of(run.times.len(), "frame"),
        pace::rate(&ends).map_or_else(String::new, |rate| format!("{} a second, ", pace::rounded(rate))),
        played,
        size_of(bytes),
        begun.elapsed().as_secs_f64(),
        pace::remark(args, &run, &ends)
    );
    io::stdout().write_all(line.as_bytes()).map_err(out_error)
}

/// The second pass. Returns a line about it, too, if there is something to say.
fn film(
    render: &Render<'_>,
    format: Format,
    writer: &FrameWriter,
    target: &mut Target,
    clock: &mut Clock,
) -> Result<(crate::sim::Stats, String), Failure> {
    let [width, height] = writer.page.pixels;
    let shape = Shape { width, height, has_alpha: writer.page.background.is_none() };
    let limit = target.limit;
    let failed = |error: io::Error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failure::ClosedPipe,
        io::ErrorKind::QuotaExceeded => out_of_directory(render::Error::TooLarge { limit }),
        io::ErrorKind::InvalidInput => usage(error),
        _ => Failure::Model(format!("error: cannot write the film: {error}\n")),
    };
    let ends = pace::ends(render.args, render.run);
    let mut film = Film::begin(format, target, shape, ends, render.threads).map_err(failed)?;
    let moments = Moments::plan(render, writer, clock)?;
    let mut progress = render.bar("writing", render.run.times.len());
    if let Some(moments) = moments {
        let stats = moments.expose(render, writer, clock, |_, pixels| {
            film.add(&pixels).map_err(failed)?;
            progress.inc();
            Ok(())
        })?;
        film.finish().map_err(failed)?;
        return Ok((stats, moments.note()));
    }
    let orbit = Orbit::new(render.args, &render.run.times);
    let stats = play(
        render.run,
        render.writing(&writer.fit),
        render.threads_for(&writer.page),
        clock,
        None,
        |frame, scene| {
            let angle = orbit.map(|orbit| orbit.angle(frame.index as f64, frame.time));
            turntable::turned(writer, angle).pixels(scene)
        },
        |pixels| {
            film.add(&pixels).map_err(failed)?;
            progress.inc();
            Ok(())
        },
    )?;
    film.finish().map_err(failed)?;
    Ok((stats, String::new()))
}

/// A file under a temporary name, or standard output, as long as there is room.
struct Target {
    place: Place,
    bytes: u64,
    limit: u64,
}

enum Place {
    File(Box<tempfile::NamedTempFile>),
    Stream(io::BufWriter<io::Stdout>),
}

impl Target {
    fn begin(out: Option<&Path>, limit: u64) -> Result<Target, Failure> {
        let place = match out {
            Some(out) => Place::File(Box::new(render::aside(place_of(out)?.0).map_err(out_of_directory)?)),
            None => Place::Stream(io::BufWriter::new(io::stdout())),
        };
        Ok(Target { place, bytes: 0, limit })
    }

    /// Gives the file its name.
    fn finish(self, out: Option<&Path>) -> Result<(), Failure> {
        let (Place::File(file), Some(out)) = (self.place, out) else { return Ok(()) };
        file.persist(out).map(|_| ()).map_err(|error| {
            Failure::Model(format!("error: cannot write {}: {}\n", out.display(), error.error))
        })
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.bytes + bytes.len() as u64 > self.limit {
            return Err(io::Error::new(io::ErrorKind::QuotaExceeded, "too many bytes"));
        }
        let written = match &mut self.place {
            Place::File(file) => file.write(bytes)?,
            Place::Stream(stream) => stream.write(bytes)?,
        };
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.place {
            Place::File(file) => file.flush(),
            Place::Stream(stream) => stream.flush(),
        }
    }
}

impl Seek for Target {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.place {
            Place::File(file) => file.seek(to),
            Place::Stream(_) => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
