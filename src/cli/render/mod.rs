//! `dlsys render`: frames of an animation, or all of them on one sheet.
//!
//! The animation is run twice. The first run measures it, so that all frames share one picture area and
//! one default width; the second writes the frames. Both are the same to the last bit, and running again is
//! cheaper than keeping every frame in memory. Frames are drawn and written on other threads while the simulation
//! continues; files do not depend on the number of threads.

pub(super) mod args;
mod failure;
mod film;
pub(super) mod flags;
mod moving;
pub(super) mod one_picture;
pub(super) mod pace;
mod shutter;
mod turntable;
mod watch;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use serde_json::json;

use super::album::{Album, Keeping};
use super::args::RenderArgs;
use super::common::{Clock, Failure, ModelRun, count_of, out_error, size_of, tell};
use super::events::EventLog;
use super::export;
use super::frame_source::{Frame, Pass, play, play_at};
use super::progress::Progress;
use super::values::{RenderFormat, Seeds};
use crate::render::{
    self, Companion, Content, Fit, Format, FrameDirectory, FrameRecord, FrameWriter, Layout, Manifest, Page,
    Picture, Sheet, SheetWriter, Survey,
};
use crate::scene::Scene;
use crate::session::SwayReport;
use crate::sim::{GroundRule, Method, Settings, Stats, brief};
use failure::{explain, out_of_directory};
use shutter::Moments;
use turntable::Orbit;

/// Runs a model and writes its frames; with `--watch`, again and again.
pub fn render(args: &RenderArgs) -> Result<(), Failure> {
    if args.watch { watch::watch(args) } else { once(args, &|| false) }
}

/// Makes the allocator keep the memory of a frame for the next one. That of GNU gives a block above a certain size back to the system as soon as it is
/// free, and the system hands out the next one page by page, which takes as long as to draw into it. That size follows the largest block that was given back,
/// up to this one. To other allocators it is nothing.
fn keep_memory() {
    const LARGEST: usize = (32 << 20) - (64 << 10);
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST)));
}

/// Renders, unless `stale` becomes true before anything is written.
fn once(args: &RenderArgs, stale: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    keep_memory();
    let format = match args.format {
        RenderFormat::Frames(format) => format,
        RenderFormat::Growth(format) => return export::render(args, format, stale),
        RenderFormat::Film(format) => return film::render(args, format, stale),
        RenderFormat::Moving => return moving::render(args, stale),
    };
    flags::survey(args)?;
    flags::agree(args, format)?;
    let mut run = ModelRun::start(&args.shared)?.on_threads(args.threads);
    run.detail = flags::detail(args, format);
    match args.seeds {
        Some(seeds) => specimens(args, format, run, seeds),
        None => render_run(args, run, stale),
    }
}

/// Renders specimens with several seeds, to one scale. All are measured before anything is written.
fn specimens(args: &RenderArgs, format: Format, mut run: ModelRun, seeds: Seeds) -> Result<(), Failure> {
    if format.content() == Content::Vectors {
        run.note_missing_gases("an SVG picture");
    }
    let begun = Instant::now();
    run.note_unused_camera(args);
    turntable::repeat(args, &mut run.times);
    let never = || false;
    let threads = flags::threads(args);
    let mut survey = flags::survey(args)?;
    let mut parts = Vec::new();
    for seed in seeds.iter() {
        run.settings.seed = seed;
        let mut render = Render {
            args,
            format,
            run: &run,
            out: &args.out,
            threads,
            frames: Vec::new(),
            album: None,
            stale: &never,
        };
        survey = render.measure(survey, &mut Clock::default()).map_err(|why| why.of_seed(seed))?;
        parts.push(render.frames);
    }
    let fit = flags::fit(args, &survey, |fit| picture(args, &run, &parts[0], fit))?;
    let width = seeds.last.to_string().len();
    let mut bytes = 0;
    for (seed, frames) in seeds.iter().zip(parts) {
        run.settings.seed = seed;
        let out = args.out.join(format!("seed-{seed:0width$}"));
        let render =
            Render { args, format, run: &run, out: &out, threads, frames, album: None, stale: &never };
        bytes += render.write(fit.clone(), &mut Clock::default())?.1.bytes;
    }
    if args.quiet {
        return Ok(());
    }
    let line = format!(
        "{}, {} of each, {}, in {:.2} s: {}\n",
        count_of(seeds.count(), "specimen"),
        count_of(run.times.len(), "frame"),
        size_of(bytes),
        begun.elapsed().as_secs_f64(),
        args.out.display()
    );
    std::io::stdout().write_all(line.as_bytes()).map_err(out_error)
}

/// Renders a model that has been read.
pub fn render_run(
    args: &RenderArgs,
    mut run: ModelRun,
    stale: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    let begun = Instant::now();
    let format = match args.format {
        RenderFormat::Frames(format) => format,
        RenderFormat::Growth(format) => return export::render_run(args, format, run, stale),
        RenderFormat::Film(format) => return film::render_run(args, format, run, stale),
        RenderFormat::Moving => return moving::render_run(args, run, stale),
    };
    let survey = flags::survey(args)?;
    flags::agree(args, format)?;
    if format.content() == Content::Vectors {
        run.note_missing_gases("an SVG picture");
    }
    run.note_unused_camera(args);
    if args.layout == Layout::Frames && format.content() != Content::Mesh {
        run.note_covered_sky(args);
    }
    turntable::repeat(args, &mut run.times);
    let mut clock = run.clock;
    let threads = flags::threads(args);
    let album = Some(Album::default());
    let single = one_picture::format(args);
    single.map_or(Ok(()), |format| one_picture::spare_others(args, format))?;
    // One picture is made in a folder of its own.
    let folder = single.map(|_| tempfile::tempdir()).transpose();
    let folder = folder.map_err(|error| Failure::Model(format!("error: no temporary folder: {error}\n")))?;
    let out = folder.as_ref().map_or(&*args.out, |folder| folder.path());
    let mut render = Render { args, format, run: &run, out, threads, frames: Vec::new(), album, stale };
    let survey = render.measure(survey, &mut clock)?;
    let fit = flags::fit(args, &survey, |fit| picture(args, &run, &render.frames, fit))?;
    let (stats, mut written) = render.write(fit, &mut clock)?;
    if let (Some(folder), Some(format)) = (&folder, single) {
        one_picture::put(folder.path(), args, format)?;
        written.names = args.out.display().to_string();
    }
    run.write_stats(&args.shared, clock, stats)?;
    if args.quiet {
        return Ok(());
    }
    let mut line = format!(
        "{}, {}, in {:.2} s: {}\n",
        count_of(run.times.len(), "frame"),
        size_of(written.bytes),
        begun.elapsed().as_secs_f64(),
        written.names
    );
    line += &written.note;
    if let Some(sway) = run.sway().filter(|sway| sway.by_modes > 0) {
        line += &sway_line(&sway);
    }
    if written.bytes > LARGE && args.accuracy.is_none() && format.content() != Content::Pixels {
        line +=
            "  large: --accuracy 0.02 makes surfaces of fewer pieces, --format png makes pictures of dots\n";
    }
    std::io::stdout().write_all(line.as_bytes()).map_err(out_error)
}

/// How the plants in the wind were followed.
fn sway_line(sway: &SwayReport) -> String {
    let [least, most] = sway.modes;
    let modes = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let (solved, error) = (sway.solved, brief(sway.error_pixels, 2));
    let modal = format!("{} by {modes} modes a root, measured error {error} pixels", sway.by_modes);
    format!("  {} in the wind: {solved} solved, {modal}\n", count_of(sway.plants, "plant"))
}

/// The area of the page: that of a frame, or of a sheet of frames.
fn picture(args: &RenderArgs, run: &ModelRun, frames: &[Survey], fit: &Fit) -> Picture {
    match args.layout {
        Layout::Frames => fit.picture,
        _ => sheet(args, run, frames, fit).picture,
    }
}

/// Frames on a sheet.
fn sheet(args: &RenderArgs, run: &ModelRun, frames: &[Survey], fit: &Fit) -> Sheet {
    let captions: Vec<String> = match args.layout {
        Layout::Grid if !args.no_captions => {
            run.times.iter().map(|&t| format!("t = {}", brief(t, 9))).collect()
        }
        _ => Vec::new(),
    };
    Sheet::new(args.layout, fit, frames, &captions, flags::spacing(args))
}

/// Bytes from which a render gets a hint about its size.
const LARGE: u64 = 50_000_000;

/// The summary of a render.
struct Written {
    bytes: u64,
    /// Names of the first and the last file.
    names: String,
    /// A line of its own, if there is something to say.
    note: String,
}

/// A render in progress.
struct Render<'r> {
    args: &'r RenderArgs,
    format: Format,
    run: &'r ModelRun,
    /// The output directory.
    out: &'r Path,
    threads: usize,
    /// The survey of every frame, if the layout needs it.
    frames: Vec<Survey>,
    /// Scenes of the first pass, if the second one follows at once.
    album: Option<Album>,
    /// Whether a file of the model has changed since it was read.
    stale: &'r (dyn Fn() -> bool + Sync),
}

impl Render<'_> {
    /// The second pass.
    fn write(&self, fit: Fit, clock: &mut Clock) -> Result<(Stats, Written), Failure> {
        match self.args.layout {
            Layout::Frames => self.frames(fit, clock),
            _ => self.sheet(fit, clock),
        }
    }

    /// The first pass.
    fn measure(&mut self, mut survey: Survey, clock: &mut Clock) -> Result<Survey, Failure> {
        let mut progress = self.bar("measuring", self.run.times.len());
        let mut events = EventLog::create(self.args.shared.events.as_deref(), self.run)?;
        let nothing = survey.clone();
        let of_frame = |_: &Frame, scene: &Scene| {
            let mut survey = nothing.clone();
            survey.add(scene);
            survey
        };
        let keeping = self.album.as_ref().map_or(Keeping::Nothing, Keeping::Fill);
        let pass = Pass { settings: self.run.settings, keeping, accuracy: 0.0 };
        let measured = play(self.run, pass, self.threads, clock, events.as_mut(), of_frame, |frame| {
            survey.merge(&frame);
            if self.args.layout != Layout::Frames {
                self.frames.push(frame);
            }
            progress.inc();
            if (self.stale)() { Err(Failure::Stale) } else { Ok(()) }
        });
        drop(progress);
        if measured.is_ok() {
            self.run.note_what_is_seen(&survey);
        }
        self.run.warn();
        events.map_or(Ok(()), EventLog::finish)?;
        measured.map(|_| survey)
    }

    /// The second pass, if each frame has a file of its own.
    fn frames(&self, fit: Fit, clock: &mut Clock) -> Result<(Stats, Written), Failure> {
        let mut writer = FrameWriter::new(self.format, fit);
        writer.page = flags::page(self.args, writer.page.picture)?;
        // The directory is created only after the first pass has succeeded.
        let mut directory = FrameDirectory::create(self.out, self.args.force)
            .map_err(out_of_directory)?
            .limited(self.args.max_output);
        let mut manifest = self.manifest(&writer.fit, &writer.page);
        let count = self.run.times.len();
        // With fewer frames than threads, several threads share a frame.
        writer.threads = (self.threads / count.max(1)).max(1);
        if let Some(moments) = Moments::plan(self, &writer, clock)? {
            let mut progress = self.bar("writing", count);
            let stats = moments.expose(self, &writer, clock, |record, pixels| {
                let title = format!("{}, t = {}", self.title(), record.time);
                let bytes = writer.encoded(&pixels, &title);
                directory.write(&record.file, &bytes).map_err(out_of_directory)?;
                manifest.frames.push(record);
                progress.inc();
                Ok(())
            })?;
            drop(progress);
            return Ok((stats, self.finish(directory, &manifest, moments.note())?));
        }
        let staging = directory.staging();
        let orbit = Orbit::new(self.args, &self.run.times);
        let work = |frame: &Frame, scene: &Scene| {
            let angle = orbit.map(|orbit| orbit.angle(frame.index as f64, frame.time));
            let writer = turntable::turned(&writer, angle);
            let file = self.file(frame.index);
            let companions = if frame.index == 0 { writer.companions(scene) } else { Vec::new() };
            let title = format!("{}, t = {}", self.title(), frame.time);
            let staged = staging
                .write(|file| writer.write_to(scene, &title, file))
                .map_err(|error| explain(error, frame, scene));
            (record(&writer.fit, frame, scene, file), companions, staged)
        };
        let mut progress = self.bar("writing", count);
        let stats = play(
            self.run,
            self.writing(&writer.fit),
            self.threads_for(&writer.page),
            clock,
            None,
            work,
            |(record, companions, staged)| {
                let staged = staged?;
                for Companion { name, bytes } in companions {
                    directory.write(&name, &bytes).map_err(out_of_directory)?;
                }
                directory.put(&record.file, staged).map_err(out_of_directory)?;
                manifest.frames.push(record);
                progress.inc();
                Ok(())
            },
        )?;
        drop(progress);
        Ok((stats, self.finish(directory, &manifest, String::new())?))
    }

    /// The name of the file of a frame.
    fn file(&self, index: usize) -> String {
        FrameDirectory::frame_name(index, self.run.times.len(), self.format.extension())
    }

    /// Ends the directory of a file for each frame.
    fn finish(
        &self,
        directory: FrameDirectory,
        manifest: &Manifest,
        note: String,
    ) -> Result<Written, Failure> {
        self.run.warn();
        let names = match &manifest.frames[..] {
            [] => self.out.display().to_string(),
            [only] => self.out.join(&only.file).display().to_string(),
            [first, .., last] => format!("{} to {}", self.out.join(&first.file).display(), last.file),
        };
        let written = Written { bytes: directory.bytes(), names, note };
        directory.finish(manifest).map_err(out_of_directory)?;
        Ok(written)
    }

    /// The second pass, if all frames have one file.
    fn sheet(&self, fit: Fit, clock: &mut Clock) -> Result<(Stats, Written), Failure> {
        let times = &self.run.times;
        let sheet = sheet(self.args, self.run, &self.frames, &fit);
        let page = flags::page(self.args, sheet.picture)?;
        if sheet.lacks_captions {
            tell(
                "warning: the times below the frames are left out: there is no room for letters that can be read; choose a larger --width, fewer --columns, or --no-captions\n",
            );
        }
        let refuse = |error: render::Error| Failure::Usage(format!("error: {error}\n"));
        let writer = SheetWriter::new(self.format, fit.clone(), sheet, page).map_err(refuse)?;
        let mut directory = FrameDirectory::create(self.out, self.args.force)
            .map_err(out_of_directory)?
            .limited(self.args.max_output);
        let mut manifest = self.manifest(&fit, writer.page());
        let work = |frame: &Frame, scene: &Scene| {
            (record(&fit, frame, scene, writer.file()), writer.part(frame.index, scene))
        };
        let mut assembly = writer.begin();
        let mut progress = self.bar("drawing", times.len());
        let stats = play(
            self.run,
            self.writing(&fit),
            self.threads_for(writer.page()),
            clock,
            None,
            work,
            |(record, part)| {
                manifest.frames.push(record);
                progress.inc();
                part.and_then(|part| assembly.add(part)).map_err(refuse)
            },
        )?;
        self.run.warn();
        let title = match &times[..] {
            [] => self.title().to_owned(),
            [only] => format!("{}, t = {only}", self.title()),
            [first, .., last] => format!("{}, t = {first} to {last}", self.title()),
        };
        directory.write(&writer.file(), &assembly.finish(&title)).map_err(out_of_directory)?;
        let names = self.out.join(writer.file()).display().to_string();
        let written = Written { bytes: directory.bytes(), names, note: String::new() };
        directory.finish(&manifest).map_err(out_of_directory)?;
        Ok((stats, written))
    }

    fn bar(&self, what: &str, count: usize) -> Progress {
        if self.args.quiet { Progress::quiet() } else { Progress::new(what, count) }
    }

    /// Number of threads for pages of this size, so that large pages do not fill the memory.
    fn threads_for(&self, page: &Page) -> usize {
        const PIXELS_AT_ONCE: u64 = 100_000_000;
        let pixels = page.pixels.iter().map(|&side| u64::from(side)).product::<u64>();
        let most =
            if self.format.content() == Content::Pixels { PIXELS_AT_ONCE / pixels.max(1) } else { u64::MAX };
        self.threads.min(most.clamp(1, 256) as usize)
    }

    fn title(&self) -> &str {
        self.run.session.model.title.as_deref().unwrap_or(&self.run.session.source.name)
    }

    /// Settings of the second pass: without the log, and with the accuracy that follows from the extent.
    fn writing(&self, fit: &Fit) -> Pass<'_> {
        let keeping = self.album.as_ref().map_or(Keeping::Nothing, Keeping::Use);
        Pass { settings: Settings { log: false, ..self.run.settings }, keeping, accuracy: fit.accuracy }
    }

    fn manifest(&self, fit: &Fit, page: &Page) -> Manifest {
        let (args, run) = (self.args, self.run);
        let model = &run.session.model;
        let parameters: serde_json::Map<String, serde_json::Value> =
            model.parameters.iter().map(|p| (p.name.clone(), p.value.into())).collect();
        let settings = &run.settings;
        let method = Method::NAMED.iter().rev().find(|(_, m)| *m == settings.method).map(|(name, _)| *name);
        let format = self.format;
        let mut described = json!({
            "format": format.extension(),
            "layout": args.layout.name(),
            "view": fit.camera.view().to_string(),
            "perspective": args.perspective,
            "accuracy": fit.accuracy,
            "method": method,
            "parameters": parameters,
            "seed": run.settings.seed,
        });
        if let Some(degrees) = args.orbit {
            described["orbit"] = degrees.into();
        }
        if let Some(part) = args.shutter {
            described["shutter"] = part.into();
        }
        if settings.method.is_fixed_step() {
            described["step_size"] = settings.step_size.into();
        } else {
            described["tolerance"] = settings.tolerance.into();
        }
        if crate::session::sways(model) {
            described["bend_method"] = settings.bending.method.name().into();
            described["bend_tolerance"] = settings.bending.tolerance.into();
        }
        if settings.ground_rule != GroundRule::Law {
            described["ground_rule"] = settings.ground_rule.name().into();
        }
        if format.content() != Content::Mesh {
            described["size"] = json!(page.pixels);
            described["background"] = page.background.map(|color| color.to_string()).into();
        }
        // A path would make the bytes depend on the working directory.
        let path = std::path::Path::new(&run.session.source.name);
        let name =
            path.file_name().map_or(run.session.source.name.clone(), |n| n.to_string_lossy().into_owned());
        let mut manifest = Manifest::new(name, model.title.clone(), described);
        manifest.view_box = (format.content() == Content::Vectors).then(|| page.picture.view_box());
        manifest.bounds = fit.bounds.map(|c| c.map(|p| [p.x, p.y, p.z]));
        manifest
    }
}

/// The entry of a frame in the manifest.
fn record(fit: &Fit, frame: &Frame, scene: &Scene, file: String) -> FrameRecord {
    FrameRecord {
        index: frame.index,
        time: frame.time,
        file,
        modules: frame.modules(),
        bounds: fit.bounds_of(scene).map(|c| c.map(|p| [p.x, p.y, p.z])),
    }
}
