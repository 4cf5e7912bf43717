//! The language front end: text to [`Model`].
//!
//! ```text
//! text ──layout──▶ items ──parse──▶ Document ──scope, rules──▶ Model ──check──▶ remarks
//! ```
//!
//! The entry point is [`load`]. Errors are collected: a text with three errors yields three messages. Every pass takes
//! time linear in the text and recurses to a fixed depth at most.

#![warn(missing_docs)]

mod advice;
mod air;
mod analysis;
mod appearance;
mod build;
mod call;
mod chance;
mod check;
mod choice;
mod clauses;
mod comparisons;
mod conditions;
mod contexts;
mod coverage;
mod curves;
mod dead_rules;
mod declared;
mod equations;
mod functions;
mod gases;
mod gather;
mod globals;
mod inputs;
mod land;
mod locals;
mod measure;
mod physics;
mod porting;
mod rules;
mod scene_checks;
mod scenery;
mod scope;
mod sheets;
mod smooth;
mod soils;
mod strings;
mod surface;
mod table;

use dlsys_diagnostic::{Diagnostic, Severity, Source};
use dlsys_expr::{Binary, Unary};
use dlsys_model::{Distribution, Model};
pub use dlsys_syntax::{Errors, Files, NoFiles};

pub use measure::measure;
use scope::Scope;

/// A value for a `param`, given when a model is loaded.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The name of the `param`.
    pub name: String,
    /// The value that takes the place of the declared one.
    pub value: f64,
}

/// The result of loading a text: a model, unless there are errors, and all messages.
#[derive(Debug)]
pub struct Loaded {
    /// The compiled model; None if there are errors.
    pub model: Option<Model>,
    /// The text with the files that it includes, if there are any; spans in messages then refer to it.
    pub source: Option<Source>,
    /// Errors, then warnings, each in the order of their places.
    pub diagnostics: Vec<Diagnostic>,
    /// Errors in the settings; there is no model if it is not empty.
    pub refused_settings: Vec<Diagnostic>,
}

/// Parses, checks and compiles a model that names no files.
pub fn load(source: &Source, settings: &[Setting]) -> Loaded {
    load_with(source, settings, &NoFiles)
}

/// Parses, checks and compiles a model. Included texts, surfaces, tables and plants are read from `files`.
pub fn load_with(source: &Source, settings: &[Setting], files: &dyn Files) -> Loaded {
    load_nested(source, settings, files, &scenery::Nesting::default())
}

/// As [`load_with`], of a model that may be a plant of others.
fn load_nested(
    source: &Source,
    settings: &[Setting],
    files: &dyn Files,
    nesting: &scenery::Nesting,
) -> Loaded {
    let (whole, document, mut diagnostics) = dlsys_syntax::read(source, files);
    let unread = !diagnostics.is_empty();
    let mut scope = Scope::default();
    let model = build::build(&document, settings, &mut scope, unread, (files, nesting));
    diagnostics.append(&mut scope.diagnostics);
    let failed = diagnostics.iter().any(|d| d.severity == Severity::Error);
    diagnostics.sort_by_key(|d| (d.severity == Severity::Warning, d.labels.first().map(|l| l.0)));
    let refused_settings = scope.refused_settings;
    let model = model.filter(|_| !failed && refused_settings.is_empty());
    Loaded { model, source: whole, diagnostics, refused_settings }
}

/// The functions that an expression can call without declaring them: those of numbers, distributions, aggregates, of
/// curves, of the wind and the ground, and of the library.
pub fn functions() -> impl Iterator<Item = &'static str> {
    let numbers =
        Unary::NAMED.iter().map(|(name, _)| *name).chain(Binary::NAMED.iter().map(|(name, _)| *name));
    let draws = Distribution::NAMED.iter().map(|(name, ..)| *name);
    let curves = curves::FUNCTIONALS.iter().map(|(name, _)| *name);
    let known = numbers.chain(draws).chain(dlsys_syntax::words::FOLDS).chain(curves).chain(air::FUNCTIONS);
    let known = known.chain([land::FUNCTION]);
    known.chain(dlsys_syntax::library_names())
}

#[cfg(test)]
mod tests {
    #[test]
    fn functions_of_every_origin_are_listed() {
        for name in ["integral", "gompertz", "sin", "max", "sum", "normal", "flow_y", "ground"] {
            assert!(super::functions().any(|known| known == name), "{name}");
        }
    }
}
