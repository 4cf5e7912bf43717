//! The fuzz targets: each accepts any bytes, and must neither panic nor hang. Beside them random models whose results are known
//! ([`accuracy`]).

pub mod accuracy;
mod dice;
mod options;

pub use dice::Dice;
pub use options::Options;

use std::path::Path;

use dlsys::compile::Files;
use dlsys::diagnostic::Source;
use dlsys::model::Model;
use dlsys::render::{Format, FrameWriter, Page, Size, Survey, View};
use dlsys::session::Session;
use dlsys::sim::{Settings, Simulation};
use dlsys::tree::ModuleString;

/// What is run on an input.
pub type Target = fn(&[u8]);

/// The targets by name.
pub const TARGETS: [(&str, Target); 5] =
    [("front", front), ("format", format), ("simulate", simulate), ("draw", draw), ("files", files)];

fn source(bytes: &[u8]) -> Option<Source> {
    Source::from_bytes("input.dls", bytes.to_vec()).ok()
}

/// Loads a model and renders every message about it.
pub fn front(bytes: &[u8]) {
    let source = match Source::from_bytes("input.dls", bytes.to_vec()) {
        Ok(source) => source,
        Err(refused) => {
            refused.diagnostic.render(&refused.source, false);
            return;
        }
    };
    match Session::from_text("input.dls", &source.text, &[]) {
        Ok(session) => {
            session.warnings.iter().for_each(|warning| drop(warning.render(&session.source, false)))
        }
        Err(refused) => {
            refused.diagnostics.iter().for_each(|d| drop(d.render(&refused.source, false)));
        }
    }
}

/// Formats a model; formatting the result again must not change it.
pub fn format(bytes: &[u8]) {
    let Some(source) = source(bytes) else { return };
    let Ok(once) = dlsys::syntax::format::format(&source) else { return };
    let Some(again) = self::source(once.as_bytes()) else { return };
    let twice = dlsys::syntax::format::format(&again).expect("what was laid out parses");
    assert_eq!(once, twice, "laid out once and twice");
}

/// Runs a model for a while, on a small budget.
pub fn simulate(bytes: &[u8]) {
    run(bytes, |_, _| ());
}

/// Draws a model in all formats; no file may contain NaN or an infinite number.
pub fn draw(bytes: &[u8]) {
    run(bytes, |session, string| paint(&session.model, string));
}

/// The larger side of a picture.
const PIXELS: u32 = 240;

fn paint(model: &Model, string: &ModuleString) {
    let mut scene = dlsys::turtle::blank(model);
    if dlsys::turtle::draw(model, string, &mut scene).is_err() {
        return;
    }
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let fit = survey.fit();
    for format in [Format::SVG, Format::PNG, Format::OBJ] {
        let mut writer = FrameWriter::new(format, fit.clone());
        // Small pictures, so that more of them are tried: with light, a large one takes seconds in this build.
        if let Ok(page) = Page::new(writer.page.picture, Size::Larger(PIXELS), writer.page.background) {
            writer.page = page;
        }
        let bytes = writer.write(&scene, "a frame");
        if format == Format::SVG {
            let text = String::from_utf8(bytes).expect("text");
            assert!(!text.contains("NaN") && !text.contains("\"inf") && !text.contains("-inf"), "{text}");
        }
    }
}

/// Any file has the same content.
struct Same<'b>(&'b [u8]);

impl Files for Same<'_> {
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, String> {
        let bytes: &[u8] = match path.to_str() {
            Some("spot.png") => include_bytes!("../seeds/spot.png"),
            Some("square.obj") => include_bytes!("../seeds/square.obj"),
            _ => self.0,
        };
        Ok(bytes[..bytes.len().min(limit as usize)].to_vec())
    }
}

/// Reads the input as a table, as surfaces in both formats, as a surface with a picture, as a picture, and as a part of a model; draws the surfaces.
pub fn files(bytes: &[u8]) {
    for text in [
        "table g from \"input.csv\"\ninitial string: A(0)\nA(x): solve dx/dt = g(x)\ninterpret A(x): F(g(t))\n",
        "table monotone g from \"input.csv\" column \"rain\"\ninitial string: A(0)\nA(x): solve dx/dt = g(x)\n",
        "surface @M from \"input.s\"\ninitial string: F(1) @M(2)\n",
        "surface @M from \"input.obj\"\ninitial string: F(1) @M(2)\n",
        "surface @M from \"input.obj\" texture \"spot.png\"\ninitial string: F(1) @M(2)\n",
        "surface @M from \"square.obj\" texture \"input.png\"\ninitial string: F(1) @M(2)\n",
        "include \"input.dls\"\ninitial string: A(1)\n",
    ] {
        let source = Source::from_bytes("input.dls", text.as_bytes().to_vec()).expect("text");
        let loaded = dlsys::compile::load_with(&source, &[], &Same(bytes));
        let read = loaded.source.as_ref().unwrap_or(&source);
        loaded.diagnostics.iter().for_each(|d| drop(d.render(read, false)));
        let Some(model) = loaded.model else { continue };
        let settings =
            Settings { max_modules: 100, max_events: 100, max_seconds: 1.0, ..Settings::default() };
        let Ok(mut simulation) = Simulation::new(&model, settings) else { continue };
        let mut string = ModuleString::default();
        if simulation.at(0.5, &mut string).is_ok() {
            paint(&model, &string);
        }
    }
}

fn run(bytes: &[u8], see: impl Fn(&Session, &ModuleString)) {
    let Some(source) = source(bytes) else { return };
    let Ok(session) = Session::from_text("input.dls", &source.text, &[]) else { return };
    let settings = Settings {
        max_modules: 2000,
        max_events: 20_000,
        max_seconds: 2.0,
        max_memory: 1 << 31,
        ..Settings::default()
    };
    let mut simulation = match session.simulate(settings) {
        Ok(simulation) => simulation,
        Err(error) => return drop(error.diagnostic().render(&session.source, false)),
    };
    let mut string = ModuleString::default();
    for time in [0.0, 0.3, 1.0, 4.0] {
        if let Err(error) = simulation.at(time, &mut string) {
            error.diagnostic().render(&session.source, false);
            return;
        }
        see(&session, &string);
    }
}
