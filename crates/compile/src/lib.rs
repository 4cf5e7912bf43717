//! The language front end: text to [`Model`].
//!
//! ```text
//! text ──layout──▶ items ──parse──▶ Document ──scope, rules──▶ Model ──check──▶ remarks
//! ```
//!
//! [`load`] is the whole of it. Mistakes are collected, not thrown: a text with three mistakes gets three
//! messages. Every pass is linear in the text, and none recurses deeper than a fixed bound.

#![warn(missing_docs)]

mod advice;
mod analysis;
mod appearance;
mod build;
mod call;
mod chance;
mod check;
mod choice;
mod clauses;
mod conditions;
mod contexts;
mod curves;
mod dead_rules;
mod declared;
mod equations;
mod gather;
mod globals;
mod locals;
mod measure;
mod rules;
mod scope;
mod smooth;
mod strings;
mod surface;
mod table;

use dlsys_diagnostic::{Diagnostic, Severity, Source};
use dlsys_expr::{Binary, Unary};
use dlsys_model::{Distribution, Model};
pub use dlsys_syntax::{Errors, Files, NoFiles};

pub use measure::measure;
use scope::Scope;

/// A value for a `param`, given from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The name of the `param`.
    pub name: String,
    /// The value that takes the place of the declared one.
    pub value: f64,
}

/// What came of a text: a model unless there are errors, and everything there is to say about it.
#[derive(Debug)]
pub struct Loaded {
    /// The compiled model; None if there are errors.
    pub model: Option<Model>,
    /// The text with all that it includes, if that is more than was given: places in messages are places in it.
    pub source: Option<Source>,
    /// Errors, then warnings, each in the order of their places.
    pub diagnostics: Vec<Diagnostic>,
    /// What is wrong with the settings; then there is no model either.
    pub refused_settings: Vec<Diagnostic>,
}

/// Reads, checks and compiles a model that names no files.
pub fn load(source: &Source, settings: &[Setting]) -> Loaded {
    load_with(source, settings, &NoFiles)
}

/// Reads, checks and compiles a model. The surfaces that it names come from `files`.
pub fn load_with(source: &Source, settings: &[Setting], files: &dyn Files) -> Loaded {
    let (whole, document, mut diagnostics) = dlsys_syntax::read(source, files);
    let unread = !diagnostics.is_empty();
    let mut scope = Scope::default();
    let model = build::build(&document, settings, &mut scope, unread, files);
    diagnostics.append(&mut scope.diagnostics);
    let failed = diagnostics.iter().any(|d| d.severity == Severity::Error);
    diagnostics.sort_by_key(|d| (d.severity == Severity::Warning, d.labels.first().map(|l| l.0)));
    let refused_settings = scope.refused_settings;
    let model = model.filter(|_| !failed && refused_settings.is_empty());
    Loaded { model, source: whole, diagnostics, refused_settings }
}

/// The functions that an expression can call without declaring them: those of numbers, distributions, aggregates, of
/// curves, and of the library.
pub fn functions() -> impl Iterator<Item = &'static str> {
    let numbers =
        Unary::NAMED.iter().map(|(name, _)| *name).chain(Binary::NAMED.iter().map(|(name, _)| *name));
    let draws = Distribution::NAMED.iter().map(|(name, ..)| *name);
    let curves = curves::FUNCTIONALS.iter().map(|(name, _)| *name);
    numbers.chain(draws).chain(dlsys_syntax::words::FOLDS).chain(curves).chain(dlsys_syntax::library_names())
}

#[cfg(test)]
mod tests {
    #[test]
    fn functions_of_every_origin_are_listed() {
        for name in ["integral", "gompertz", "sin", "max", "sum", "normal"] {
            assert!(super::functions().any(|known| known == name), "{name}");
        }
    }
}
