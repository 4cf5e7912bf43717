//! What is done with an input: each target takes any bytes, and must neither panic nor take for ever.

use dlsys::diagnostic::Source;
use dlsys::export::{Format, FrameWriter, Survey, View};
use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::structure::ModuleString;

/// The targets by name.
pub const TARGETS: [(&str, fn(&[u8])); 4] =
    [("front", front), ("format", format), ("simulate", simulate), ("draw", draw)];

fn source(bytes: &[u8]) -> Option<Source> {
    Source::from_bytes("input.dls", bytes.to_vec()).ok()
}

/// Reads a model, and draws every message about it.
pub fn front(bytes: &[u8]) {
    let source = match Source::from_bytes("input.dls", bytes.to_vec()) {
        Ok(source) => source,
        Err(refused) => {
            refused.1.render(&refused.0, false);
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

/// Lays a model out; what comes of it stays as it is when it is laid out again.
pub fn format(bytes: &[u8]) {
    let Some(source) = source(bytes) else { return };
    let Ok(once) = dlsys::lang::format::format(&source) else { return };
    let Some(again) = self::source(once.as_bytes()) else { return };
    let twice = dlsys::lang::format::format(&again).expect("what was laid out parses");
    assert_eq!(once, twice, "laid out once and twice");
}

/// Runs a model for a while, on a small budget.
pub fn simulate(bytes: &[u8]) {
    run(bytes, |_, _| ());
}

/// Draws what it looks like, in all formats; no file may have a number that is none.
pub fn draw(bytes: &[u8]) {
    run(bytes, |session, string| {
        let mut scene = dlsys::turtle::blank(&session.model);
        if dlsys::turtle::draw(&session.model, string, &mut scene).is_err() {
            return;
        }
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let fit = survey.fit();
        for format in [Format::Svg, Format::Png, Format::Obj] {
            let bytes = FrameWriter::new(format, fit.clone()).write(&scene, "a frame");
            if format == Format::Svg {
                let text = String::from_utf8(bytes).expect("text");
                assert!(!text.contains("NaN") && !text.contains("\"inf") && !text.contains("-inf"), "{text}");
            }
        }
    });
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
