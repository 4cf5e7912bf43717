//! Errors of gases.

/// Why a gas cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value that has no meaning.
    #[error("{name} of {value} is out of range: expected {expected}")]
    Value {
        /// The quantity.
        name: &'static str,
        /// What was given.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// More blobs than allowed.
    #[error(
        "more than {most} blobs at {time} s: sources with lower rates, blobs that begin larger, diffuse less or decay sooner are fewer"
    )]
    Blobs {
        /// The largest number.
        most: usize,
        /// When, in s.
        time: f64,
    },
    /// A wind that has no value at a place.
    #[error("the wind has no value at {time} s at ({}, {}, {}) m", at[0], at[1], at[2])]
    Wind {
        /// When, in s.
        time: f64,
        /// Where, in m.
        at: [f64; 3],
    },
    /// A field of wind that has no value at a time, or no meaning.
    #[error(transparent)]
    Field(#[from] dlsys_wind::Error),
}

/// An error unless a value is finite and holds a condition.
pub(crate) fn check(
    name: &'static str,
    value: f64,
    holds: bool,
    expected: &'static str,
) -> Result<(), Error> {
    if value.is_finite() && holds { Ok(()) } else { Err(Error::Value { name, value, expected }) }
}
