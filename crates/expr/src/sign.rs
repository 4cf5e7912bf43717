//! Signs of differences: the values by which conditions are decided.

/// The sign of `a - b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Sign {
    /// `a < b`.
    Minus,
    /// `a = b`, within the tolerance of the caller.
    Zero,
    /// `a > b`.
    Plus,
    /// Not yet known: it is zero now, and where it goes depends on equations that are being chosen.
    Any,
    /// One side is NaN. Every comparison with it is false, except `!=`.
    #[default]
    Undefined,
}

impl Sign {
    /// The exact sign of a number; undefined for NaN.
    pub fn of(x: f64) -> Sign {
        if x < 0.0 {
            Sign::Minus
        } else if x > 0.0 {
            Sign::Plus
        } else if x == 0.0 {
            Sign::Zero
        } else {
            Sign::Undefined
        }
    }
}
