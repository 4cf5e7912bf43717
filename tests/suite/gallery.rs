//! The error gallery: one small model per mistake in `tests/errors`, with its message beside it.
//!
//! `NAME.dls` is a mistake that reading finds; `warn_NAME.dls` gets a warning and passes; `run_NAME.dls`
//! reads well and fails when it runs; `draw_NAME.dls` fails when it is drawn, and `warn_draw_NAME.dls` gets a warning
//! there. `NAME.txt` is the message. To renew the messages after an
//! intended change, run the tests with `DLSYS_RENEW_GOLDEN=1`, and review every difference.

use dlsys::diagnostic::{Diagnostic, Severity, Source};
use dlsys::scene::Scene;
use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

use crate::common::repository;

/// What is said about a model, and whether it is refused.
fn judge(name: &str, text: &[u8]) -> (Vec<Diagnostic>, Source, bool) {
    let source = match Source::from_bytes(name, text.to_vec()) {
        Ok(source) => source,
        Err(bad) => return (vec![bad.diagnostic], bad.source, true),
    };
    let session = match Session::from_text(name, &source.text, &[]) {
        Err(refused) => return (refused.diagnostics, source, true),
        Ok(session) => session,
    };
    let mut said = session.warnings.clone();
    let draws = name.trim_start_matches("warn_").starts_with("draw_");
    if !name.starts_with("run_") && !draws {
        return (said, source, false);
    }
    let settings = Settings { max_modules: 1000, ..Settings::default() };
    let mut string = ModuleString::default();
    let fault = match session.simulate(settings) {
        Err(fault) => Some(fault),
        Ok(mut simulation) => simulation.at(10.0, &mut string).err(),
    };
    let mut fault = fault.map(|fault| fault.diagnostic());
    if fault.is_none() && draws {
        let mut scene = Scene::default();
        fault =
            dlsys::turtle::draw(&session.model, &string, &mut scene).err().map(|fault| fault.diagnostic());
        said.append(&mut scene.warnings);
    }
    let failed = fault.is_some();
    said.extend(fault);
    (said, source, failed)
}

#[test]
fn every_mistake_gets_its_message() {
    let folder = repository("tests/errors");
    let renew = std::env::var_os("DLSYS_RENEW_GOLDEN").is_some();
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .expect("the gallery")
        .filter_map(|entry| entry.expect("readable").file_name().into_string().ok())
        .filter(|name| name.ends_with(".dls"))
        .collect();
    names.sort();
    assert!(names.len() > 100, "the gallery is there");
    let mut wrong = Vec::new();
    for name in &names {
        let text = std::fs::read(folder.join(name)).expect("readable");
        let (said, source, failed) = judge(name, &text);
        let message: String = said.iter().map(|d| d.render(&source, false)).collect();
        let warns = name.starts_with("warn_");
        assert_eq!(failed, !warns, "{name} is {}refused:\n{message}", if failed { "" } else { "not " });
        assert!(!message.is_empty(), "{name} gets no message");
        if warns {
            assert!(said.iter().all(|d| d.severity == Severity::Warning), "{name}");
        }
        // Who meets a mistake wants to know what to do next.
        for one in &said {
            assert!(!one.help.is_empty(), "{name} gets no help:\n{}", one.render(&source, false));
        }
        let stored = folder.join(name).with_extension("txt");
        if renew {
            std::fs::write(&stored, &message).expect("written");
        }
        let expected = std::fs::read_to_string(&stored).unwrap_or_default().replace("\r\n", "\n");
        if expected != message {
            wrong.push(format!("--- {name} is to say\n{expected}--- but says\n{message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The production that a domain error suggests is pasted under the head, and the model runs.
#[test]
fn the_suggested_production_can_be_pasted() {
    let model = "initial string: F_v(1, 0.5)\nF_v(x, c):\n  if x < 2 & c > 0 solve dx/dt = 1, dc/dt = 0.1\n";
    let run = |text: &str| -> Result<(), Diagnostic> {
        let session = Session::from_text("pasted.dls", text, &[]).expect("a model");
        let mut simulation = session.simulate(Settings::default()).map_err(|e| e.diagnostic())?;
        simulation.at(10.0, &mut ModuleString::default()).map_err(|e| e.diagnostic())
    };
    let said = run(model).expect_err("nothing is said about x = 2");
    let clauses: Vec<&str> = said.help.iter().filter_map(|help| help.split('`').nth(1)).collect();
    assert_eq!(clauses, ["if x = 2 produce F_end(x, c)", "if x >= 2 solve dx/dt = 0"]);
    for clause in clauses {
        run(&format!("{model}  {clause}\n")).expect(clause);
    }
}

/// Polygons mean what they mean in cpfg, wherever they stand, and a subscript says that the command of this language is meant.
#[test]
fn what_is_meant_gets_no_warning() {
    let polygon = "{ -(22) f(1) +(22) f(1) | -(22) f(1) . }";
    for text in [
        format!("initial string: F {polygon} F"),
        format!("initial string: A\nA: if age = 1 produce F {polygon} A"),
        format!("initial string: A\nA -> F {polygon} A"),
        format!("initial string: A\ninterpret A: F {polygon}"),
        "initial string: !(1) F !_s F".to_owned(),
    ] {
        let session = Session::from_text("meant.dls", &text, &[]).expect("good");
        assert!(session.warnings.is_empty(), "{text}: {:?}", session.warnings);
        let without = text.replace("!_s", "! ");
        let session = Session::from_text("meant.dls", &without, &[]).expect("good");
        assert_eq!(session.warnings.len(), usize::from(text != without), "{without}");
    }
}
