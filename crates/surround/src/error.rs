//! Errors of the surroundings, with their place in the model.

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_geometry::turtle;
use dlsys_sim::{self as sim, brief};
use dlsys_sway as sway;
use dlsys_wind as wind;

/// Why the surroundings cannot be computed.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The growth fails.
    #[error("{}", .0.diagnostic().message)]
    Growth(Box<sim::Error>),
    /// A string cannot be drawn.
    #[error(transparent)]
    Turtle(#[from] Box<turtle::Error>),
    /// The declared wind has no meaning.
    #[error("{error}")]
    Wind {
        /// The reason.
        error: wind::Error,
        /// The declaration.
        span: Span,
    },
    /// Stems cannot be advanced in time.
    #[error("the stems of {module} cannot be followed at t = {time}: {error}")]
    Bending {
        /// The reason.
        error: sway::Error,
        /// The module that draws the stem in question.
        module: String,
        /// The declaration of its tissue.
        span: Span,
        /// The time in units of the model.
        time: f64,
    },
    /// Too many steps up to the time that is asked for.
    #[error("the surroundings take more than {most:e} steps up to t = {time}")]
    TooLong {
        /// The largest number of steps.
        most: f64,
        /// The time in units of the model.
        time: f64,
        /// Seconds in a unit of time.
        seconds: f64,
        /// The declaration of the first tissue.
        span: Span,
    },
}

impl Error {
    /// The error as a message that quotes the model, with advice.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            Error::Growth(error) => error.diagnostic(),
            Error::Turtle(error) => error.diagnostic(),
            Error::Wind { error, span } => Diagnostic::error(format!("this wind cannot blow: {error}"))
                .at(*span, "declared here")
                .help("look at the values of its expressions over time: they may read `t`"),
            Error::Bending { error, module, span, time } => {
                let when = brief(*time, 8);
                let shown = format!("stems cannot be followed at t = {when}: {error}");
                Diagnostic::error(shown)
                    .at(*span, "made of this tissue")
                    .note(format!("the stem is drawn for module {module}"))
                    .help("look for a width or a length that is far too small or large for the `units`, or more damping")
            }
            Error::TooLong { most, time, seconds, span } => Diagnostic::error(format!(
                "the surroundings take more than {most:.0e} steps up to t = {}",
                brief(*time, 8)
            ))
            .at(
                *span,
                format!("stems move in steps of a thirtieth of a second, and a unit of t is {seconds} s"),
            )
            .help("`units time S` is the pace of the film: seconds of motion in a unit of t, such as 1"),
        }
    }
}

impl From<sim::Error> for Error {
    fn from(error: sim::Error) -> Error {
        Error::Growth(Box::new(error))
    }
}

impl From<turtle::Error> for Error {
    fn from(error: turtle::Error) -> Error {
        Error::Turtle(Box::new(error))
    }
}
