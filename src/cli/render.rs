//! `dlsys render`: frames of an animation.
//!
//! The animation is run twice. The first run measures it, so that all frames share one picture area and
//! one default width; the second writes the frames. Both are the same to the last bit, and running again is
//! cheaper than keeping every frame in memory.

use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::args::{Background, FrameFormat, RenderArgs};
use super::common::{Failure, Run};
use super::events::EventLog;
use crate::export::{
    self, Format, FrameDirectory, FrameRecord, FrameWriter, Manifest, Page, Picture, Size, Survey, View,
};
use crate::scene::Scene;
use crate::sim::{Method, Settings, Simulation};
use crate::structure::ModuleString;
use crate::turtle;

/// Runs a model and writes its frames.
pub fn render(args: &RenderArgs) -> Result<(), Failure> {
    let view: View = args.view.parse().map_err(|e| Failure::Usage(format!("error: {e}\n")))?;
    let format = match args.format {
        FrameFormat::Svg => Format::Svg,
        FrameFormat::Png => Format::Png,
        FrameFormat::Obj => Format::Obj,
    };
    only_of_pictures(args)?;
    let run = Run::start(&args.shared)?;
    let mut clock = run.clock;
    let count = run.times.len();

    let progress = bar("measuring", count);
    let mut survey = Survey::new(view);
    if let Some(field) = args.perspective {
        survey = survey.with_perspective(field);
    }
    let mut events = EventLog::create(args.shared.events.as_deref(), &run)?;
    let measured = (|| {
        let mut reel = Reel::start(&run, run.settings)?;
        for &t in &run.times {
            let before = Instant::now();
            let wound = reel.wind(t);
            clock.simulate += before.elapsed();
            if let Some(log) = &mut events {
                log.write(&mut reel.simulation)?;
            }
            wound?;
            survey.add(&reel.scene);
            progress.inc(1);
        }
        Ok(())
    })();
    progress.finish_and_clear();
    events.map_or(Ok(()), EventLog::finish)?;
    measured?;

    let mut fit = survey.fit();
    fit.accuracy = args.accuracy.unwrap_or(fit.accuracy);
    let mut writer = FrameWriter::new(format, fit);
    writer.page = page(args, writer.fit.picture)?;
    // Only now that the run is known to be good, the directory is touched.
    let mut directory = FrameDirectory::create(&args.out, args.force).map_err(out_of_directory)?;
    let mut manifest = manifest(args, &run, view, &writer);
    let progress = bar("writing", count);
    let title = run.session.model.title.clone().unwrap_or_else(|| run.session.source.name.clone());
    let mut reel = Reel::start(&run, Settings { log: false, ..run.settings })?;
    reel.scene.accuracy = writer.fit.accuracy;
    for (index, &t) in run.times.iter().enumerate() {
        let before = Instant::now();
        reel.wind(t)?;
        clock.simulate += before.elapsed();
        let before = Instant::now();
        if let Some((name, bytes)) = writer.companion(&reel.scene).filter(|_| index == 0) {
            directory.write(name, &bytes).map_err(out_of_directory)?;
        }
        let file = FrameDirectory::frame_name(index, count, format.extension());
        let bytes = writer.write(&reel.scene, &format!("{title}, t = {t}"));
        directory.write(&file, &bytes).map_err(out_of_directory)?;
        clock.output += before.elapsed();
        let corners = writer.fit.bounds_of(&reel.scene);
        manifest.frames.push(FrameRecord {
            index,
            time: t,
            file,
            modules: reel.string.iter().filter(|m| !m.kind.is_bracket()).count(),
            bounds: corners.map(|c| c.map(|p| [p.x, p.y, p.z])),
        });
        progress.inc(1);
    }
    directory.finish(&manifest).map_err(out_of_directory)?;
    progress.finish_and_clear();
    run.write_stats(&args.shared, clock, reel.simulation.stats())
}

/// Refuses flags that mean nothing for meshes.
fn only_of_pictures(args: &RenderArgs) -> Result<(), Failure> {
    let given = [
        ("--perspective", args.perspective.is_some()),
        ("--width", args.width.is_some()),
        ("--size", args.size.is_some()),
        ("--background", args.background.is_some()),
    ];
    match given.iter().find(|(_, given)| *given && args.format == FrameFormat::Obj) {
        Some((flag, _)) => Err(Failure::Usage(format!(
            "error: {flag} is for pictures, and an OBJ file is a mesh in space: leave it out, or choose --format svg or png\n"
        ))),
        None => Ok(()),
    }
}

/// The page that was asked for.
fn page(args: &RenderArgs, picture: Picture) -> Result<Page, Failure> {
    let size = match (args.size, args.width) {
        (Some((width, height)), _) => Size::Exact(width, height),
        (None, Some(width)) => Size::Width(width),
        (None, None) => Size::default(),
    };
    let background = args.background.map_or(Some(Page::BACKGROUND), |Background(color)| color);
    Page::new(picture, size, background).map_err(|e| Failure::Usage(format!("error: {e}\n")))
}

/// A running simulation and what is drawn of it.
struct Reel<'r> {
    run: &'r Run,
    simulation: Simulation<'r>,
    string: ModuleString,
    scene: Scene,
}

impl<'r> Reel<'r> {
    fn start(run: &'r Run, settings: Settings) -> Result<Reel<'r>, Failure> {
        let simulation = run.session.simulate(settings).map_err(|error| run.fault(&error))?;
        Ok(Reel { run, simulation, string: ModuleString::default(), scene: Scene::default() })
    }

    /// Goes on to a time and draws what is there.
    fn wind(&mut self, t: f64) -> Result<(), Failure> {
        self.simulation.at(t, &mut self.string).map_err(|error| self.run.fault(&error))?;
        self.scene.clear();
        turtle::draw(&self.run.session.model, &self.string, &mut self.scene)
            .map_err(|error| Failure::Model(format!("error: at t = {t}: {error}\n")))
    }
}

/// A progress bar; it hides itself where standard error is no terminal.
fn bar(what: &'static str, count: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {per_sec}, {eta} left");
    ProgressBar::new(count as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        .with_message(what)
}

fn manifest(args: &RenderArgs, run: &Run, view: View, writer: &FrameWriter) -> Manifest {
    let model = &run.session.model;
    let parameters: serde_json::Map<String, serde_json::Value> =
        model.parameters.iter().map(|p| (p.name.clone(), p.value.into())).collect();
    let settings = &run.settings;
    let method = Method::NAMED.iter().rev().find(|(_, m)| *m == settings.method).map(|(name, _)| *name);
    let mut described = json!({
        "format": writer.format.extension(),
        "view": view.to_string(),
        "perspective": args.perspective,
        "accuracy": writer.fit.accuracy,
        "method": method,
        "parameters": parameters,
        "seed": args.shared.seed,
    });
    if settings.method.is_fixed_step() {
        described["step_size"] = settings.step_size.into();
    } else {
        described["tolerance"] = settings.tolerance.into();
    }
    let mut manifest = Manifest::new(&run.session.source.name, model.title.clone(), described);
    if writer.format != Format::Obj {
        manifest.settings["size"] = json!(writer.page.pixels);
        manifest.settings["background"] = writer.page.background.map(|color| color.to_string()).into();
    }
    manifest.view_box = (writer.format == Format::Svg).then(|| writer.page.picture.view_box());
    manifest.bounds = writer.fit.bounds.map(|c| c.map(|p| [p.x, p.y, p.z]));
    manifest
}

fn out_of_directory(error: export::Error) -> Failure {
    let message = format!("error: {error}\n");
    match error {
        export::Error::Io { .. } => Failure::Model(message),
        // The directory was chosen on the command line.
        _ => Failure::Usage(message),
    }
}
