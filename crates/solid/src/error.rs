//! The error type of the crate.

/// Why there is no such solid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A value is out of range.
    #[error("{name} of {value} is out of range: expected {expected}")]
    Value {
        /// What has the value.
        name: &'static str,
        /// The value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
}

/// Checks that a value is in a range.
pub(crate) fn check(name: &'static str, value: f64, good: bool, expected: &'static str) -> Result<(), Error> {
    if good && value.is_finite() { Ok(()) } else { Err(Error::Value { name, value, expected }) }
}
