//! Helpers for several tests: scenes from strings written by hand, paths of models, and runs.

use dlsys::model::Model;
use dlsys::scene::Scene;
use dlsys::tree::{Lineage, ModuleString};
use dlsys::turtle;

/// The drawing of a string; the angle of a turn without a parameter is 45 degrees.
pub fn scene(text: &str) -> Scene {
    let mut model = Model { angle: 45.0, ..Model::default() };
    let string = modules(&mut model, text);
    let mut scene = Scene::default();
    turtle::draw(&model, &string, &mut scene).expect("drawable");
    scene
}

fn modules(model: &mut Model, text: &str) -> ModuleString {
    let mut string = ModuleString::default();
    let mut rest = text.trim_start();
    let mut place = 0;
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let length = match first {
            '@' => 1 + rest[1..].find(|c| !word(c)).unwrap_or(rest.len() - 1),
            c if c.is_alphabetic() => rest.find(|c| !word(c)).unwrap_or(rest.len()),
            c => c.len_utf8(),
        };
        let (name, after) = rest.split_at(length);
        let (arguments, after) = match after.strip_prefix('(') {
            Some(inside) => inside.split_once(')').expect("a closing parenthesis"),
            None => ("", after),
        };
        let parameters: Vec<f64> = arguments
            .split(',')
            .filter(|a| !a.is_empty())
            .map(|a| a.trim().parse().expect("a number"))
            .collect();
        let kind = model.kinds.intern(name, parameters.len());
        string.push(kind, parameters, 0.0, Lineage::of_axiom(place));
        place += usize::from(!kind.is_bracket());
        rest = after.trim_start();
    }
    string
}

/// A place in the repository.
pub fn repository(path: &str) -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// All models of the repository, and the mistakes.
pub fn models() -> Vec<std::path::PathBuf> {
    let mut folders: Vec<std::path::PathBuf> =
        ["models", "tests/paper-models", "tests/errors"].map(repository).to_vec();
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "dls") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A module of a string: its name and parameters.
pub type Plain = (String, Vec<f64>);

/// The modules of a string, brackets included.
pub fn plain(model: &Model, string: &ModuleString) -> Vec<Plain> {
    string.iter().map(|m| (model.kinds.get(m.kind).name.clone(), m.parameters.to_vec())).collect()
}

/// Reads a model that must be valid.
pub fn session(text: &str) -> dlsys::session::Session {
    dlsys::session::Session::from_text("test.dls", text, &[]).unwrap_or_else(|refused| {
        let all: String = refused.diagnostics.iter().map(|d| d.render(&refused.source, false)).collect();
        panic!("{all}")
    })
}

/// The strings of a model at some times.
pub fn run(
    text: &str,
    settings: dlsys::sim::Settings,
    times: &[f64],
) -> Result<Vec<Vec<Plain>>, dlsys::sim::Error> {
    let session = session(text);
    let mut simulation = session.simulate(settings)?;
    let mut string = ModuleString::default();
    let mut all = Vec::new();
    for &t in times {
        simulation.at(t, &mut string)?;
        all.push(plain(&session.model, &string));
    }
    Ok(all)
}

/// A string as text, for comparison: `A(1, 2) [ B ]`, parameters rounded to nine digits.
pub fn show(string: &[Plain]) -> String {
    let modules = string.iter().map(|(name, parameters)| {
        if parameters.is_empty() {
            return name.clone();
        }
        let shown: Vec<String> = parameters
            .iter()
            .map(|x| {
                let rounded: f64 = format!("{x:.8e}").parse().expect("a number");
                // A zero is a zero, whichever way it was come to.
                if rounded.abs() < 1e-9 { "0".to_owned() } else { rounded.to_string() }
            })
            .collect();
        format!("{name}({})", shown.join(", "))
    });
    modules.collect::<Vec<_>>().join(" ")
}

/// The parameters of all modules of a string, to the last bit.
pub fn bits(string: &dlsys::tree::ModuleString) -> Vec<u64> {
    string.iter().flat_map(|module| module.parameters.iter().map(|x| x.to_bits())).collect()
}
