//! The error of this crate: points that make no curve.

use crate::MAX_POINTS;

/// Why points make no [`Curve`](crate::Curve). Points are counted from 0.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Fewer points than this number, which the sort of curve needs.
    TooFew(usize),
    /// More than [`MAX_POINTS`].
    TooMany,
    /// The x of this point is less than that of the one before.
    NotAscending(usize),
    /// This point is the third with the same x.
    Crowded(usize),
    /// This point and the one before are a jump at the first or the last x.
    JumpAtEnd(usize),
    /// A periodic curve whose last value is not its first.
    NotClosed {
        /// Value of the first point.
        first: f64,
        /// Value of the last point.
        last: f64,
    },
    /// Slopes or areas leave the range of numbers.
    TooLarge,
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::TooFew(least) => write!(f, "a curve of this sort needs {least} points or more"),
            Error::TooMany => write!(f, "a curve has at most {MAX_POINTS} points"),
            Error::NotAscending(i) => write!(f, "the x of point {i} is less than that before"),
            Error::Crowded(i) => write!(f, "point {i} is the third with the same x"),
            Error::JumpAtEnd(i) => write!(f, "the jump at point {i} has no curve on one of its sides"),
            Error::NotClosed { first, last } => {
                write!(f, "a periodic curve begins with {first} and ends with {last}")
            }
            Error::TooLarge => write!(f, "slopes or areas of the curve are greater than any number"),
        }
    }
}

impl std::error::Error for Error {}
