//! The error type of the crate.

/// Why a body cannot be let go, or its fall not be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of the body, of its release, of the ground or of the settings is out of range.
    #[error("{name} of {value} is out of range: expected {expected}")]
    Value {
        /// What has the value.
        name: &'static str,
        /// The value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// The wind has no value.
    #[error("the wind has no finite value at {time:.6} s at ({:.3}, {:.3}, {:.3}) m", at[0], at[1], at[2])]
    Wind {
        /// Time in s.
        time: f64,
        /// Place in m.
        at: [f64; 3],
    },
    /// The solids are not known.
    #[error("the solids at {time:.6} s are not known")]
    Solids {
        /// Time in s.
        time: f64,
    },
    /// The body lies on too many columns.
    #[error("there are {count} columns of the ground below it, and may be {most}")]
    Columns {
        /// How many.
        count: i64,
        /// The most that are allowed.
        most: i64,
    },
    /// The error is too large even with the shortest step.
    #[error(
        "at {time:.6} s, steps of {step:.1e} s are not short enough: the error is {excess:.1e} times the tolerance"
    )]
    Step {
        /// Time at which the step begins, in s.
        time: f64,
        /// Length of the shortest step, in s.
        step: f64,
        /// The error, in units of the tolerance; not finite if the motion is not.
        excess: f64,
    },
    /// The fall takes too many steps.
    #[error(
        "the fall from {from:.3} s on has taken {steps} steps at {time:.3} s, which is the most that is allowed"
    )]
    Steps {
        /// Time of the release in s.
        from: f64,
        /// Number of steps.
        steps: u64,
        /// Time that was reached, in s.
        time: f64,
    },
}

impl From<dlsys_solid::Error> for Error {
    fn from(error: dlsys_solid::Error) -> Error {
        let dlsys_solid::Error::Value { name, value, expected } = error;
        Error::Value { name, value, expected }
    }
}

/// Checks that a value is in a range.
pub(crate) fn check(name: &'static str, value: f64, good: bool, expected: &'static str) -> Result<(), Error> {
    if good && value.is_finite() { Ok(()) } else { Err(Error::Value { name, value, expected }) }
}
