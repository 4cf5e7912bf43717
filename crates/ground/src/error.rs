//! The error type of the crate.

/// Why a ground cannot be made, or not be followed.
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
    /// A height of the ground that is not a number, or too far from 0 for the size of its columns.
    #[error("{name} at ({}, {}) m is {value} m: expected at most {most} m up or down", at[0], at[1])]
    Height {
        /// Which surface.
        name: &'static str,
        /// Its height or thickness, in m.
        value: f64,
        /// Where: x and z, in m.
        at: [f64; 2],
        /// The largest value, in m.
        most: f64,
    },
    /// The columns that have been touched need more memory than allowed.
    #[error(
        "the ground around ({}, {}) m needs more than {most} MB: larger columns or fewer places where it is touched need less",
        at[0], at[1]
    )]
    Memory {
        /// The allowed memory, in MB.
        most: usize,
        /// Where the next columns are needed: x and z, in m.
        at: [f64; 2],
    },
    /// More particles in the air than allowed.
    #[error(
        "more than {most} particles are in the air, the last of them from ({}, {}) m: larger ones, or less that sticks, are fewer",
        at[0], at[1]
    )]
    Particles {
        /// The allowed number.
        most: usize,
        /// Where the next one begins: x and z, in m.
        at: [f64; 2],
    },
    /// Material that still slips after the allowed number of sweeps.
    #[error("the ground around ({}, {}) m still slips after {sweeps} sweeps, the most that is allowed", at[0], at[1])]
    Sweeps {
        /// Number of sweeps.
        sweeps: u64,
        /// Where it slips: x and z, in m.
        at: [f64; 2],
    },
    /// A body whose surface does not separate inside from outside.
    #[error("the surface of {name} is not closed: above and below ({}, {}) m, it is entered and left unequally often", at[0], at[1])]
    Open {
        /// The body.
        name: String,
        /// Where: x and z, in m.
        at: [f64; 2],
    },
    /// Something that reaches beyond the edges of the ground.
    #[error("{name} reaches ({}, {}) m, where there is no ground", at[0], at[1])]
    Outside {
        /// A body or a pour.
        name: String,
        /// Where: x and z, in m.
        at: [f64; 2],
    },
    /// A body that is not a body: points that are not numbers or too far away, or triangles between points that do not exist.
    #[error("{name} {fault}")]
    Body {
        /// The body.
        name: String,
        /// What is wrong.
        fault: &'static str,
    },
    /// A body that moves too far in a tick.
    #[error("{name} moves {way} m in a tick: expected at most {most} m with columns of {cell} m")]
    Fast {
        /// The body.
        name: String,
        /// How far, in m.
        way: f64,
        /// The longest way, in m.
        most: f64,
        /// Distance of columns in m.
        cell: f64,
    },
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
