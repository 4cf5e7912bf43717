//! The error type of this crate and of `dlsys-compile`: diagnostics, so that each error points at the text.

use std::fmt;
use std::ops::Deref;

use dlsys_diagnostic::Diagnostic;

/// The errors of a text that cannot be parsed or compiled, at least one. It dereferences to the diagnostics, which
/// [`Source`](dlsys_diagnostic::Source) renders with the lines that they point at.
#[derive(Clone, Debug)]
pub struct Errors(Vec<Diagnostic>);

impl Errors {
    /// The diagnostics, in the order in which they were found.
    pub fn into_diagnostics(self) -> Vec<Diagnostic> {
        self.0
    }
}

impl Deref for Errors {
    type Target = [Diagnostic];

    fn deref(&self) -> &[Diagnostic] {
        &self.0
    }
}

impl From<Vec<Diagnostic>> for Errors {
    fn from(diagnostics: Vec<Diagnostic>) -> Errors {
        Errors(diagnostics)
    }
}

impl From<Diagnostic> for Errors {
    fn from(diagnostic: Diagnostic) -> Errors {
        Errors(vec![diagnostic])
    }
}

/// Writes the messages, one a line, without their places.
impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.0.iter().enumerate() {
            let end = if i + 1 < self.0.len() { "\n" } else { "" };
            write!(f, "{}{end}", diagnostic.message)?;
        }
        Ok(())
    }
}

impl std::error::Error for Errors {}
