//! The error of this crate: why no step could be made.

/// Why a system could not be integrated further. Each names the component that is to blame, as far as that can be told: the first
/// that is not finite, or the one that changes fastest for its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The step that the tolerance (or the step size given) asks for is shorter than the resolution of time.
    StepTooSmall(usize),
    /// A rate at the start of a step is not finite.
    RateNotFinite(usize),
    /// A value or a rate inside a step is not finite, however short the step.
    ValueNotFinite(usize),
}

impl Error {
    /// The number of the component to blame.
    pub fn component(self) -> usize {
        match self {
            Error::StepTooSmall(component)
            | Error::RateNotFinite(component)
            | Error::ValueNotFinite(component) => component,
        }
    }
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::StepTooSmall(c) => {
                write!(f, "component {c} needs steps shorter than the resolution of time")
            }
            Error::RateNotFinite(c) => write!(f, "the rate of component {c} is not finite"),
            Error::ValueNotFinite(c) => write!(f, "component {c} is not finite within a step"),
        }
    }
}

impl std::error::Error for Error {}
