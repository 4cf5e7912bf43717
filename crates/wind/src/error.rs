//! The reasons why a field cannot be built or evaluated.

use thiserror::Error;

/// The reason why a [`Description`](crate::Description) is not a wind, or why a wind has no value at an instant.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Error {
    /// The direction is zero or not finite.
    #[error("the direction of the wind is ({}), which is no direction: one component at least must differ from 0, and all must be finite", .0.map(shown).join(", "))]
    Direction([f64; 3]),
    /// The axis of a vortex is zero at an instant. Flows are counted from 1.
    #[error("the axis of flow {flow} is (0, 0, 0) at {time} s, which is no direction")]
    Axis {
        /// The number of the flow.
        flow: usize,
        /// The time in seconds.
        time: f64,
    },
    /// One of the flows has no meaning, or no value at an instant.
    #[error("{error}")]
    Flow {
        /// The number of the flow, from 0.
        index: usize,
        /// The reason, which names the flow.
        error: Box<Error>,
    },
    /// A number that must be greater than 0 is not.
    #[error("{name} is {value}, and must be a finite number greater than 0")]
    NotPositive {
        /// The name of the number.
        name: &'static str,
        /// The number itself.
        value: f64,
    },
    /// A number that must not be negative is.
    #[error("{name} is {value}, and must be a finite number of at least 0")]
    Negative {
        /// The name of the number.
        name: &'static str,
        /// The number itself.
        value: f64,
    },
    /// The roughness length is not between 0 and the 10 m at which the speed is given.
    #[error(
        "the roughness is {0} m, and must be greater than 0 and less than 10 m, the height at which the speed is given"
    )]
    Roughness(f64),
    /// A quantity of a wind with a period does not have that period.
    #[error(
        "{name} does not repeat after the period of {period} s: it is {first} at {time} s and {second} one period later"
    )]
    NotPeriodic {
        /// The name of the quantity.
        name: String,
        /// The period in seconds.
        period: f64,
        /// A time at which it was evaluated, in seconds.
        time: f64,
        /// Its value there.
        first: f64,
        /// Its value one period later.
        second: f64,
    },
    /// A quantity is not finite at an instant.
    #[error("{name} is {value} at {time} s, and must be finite")]
    NotFinite {
        /// The name of the quantity.
        name: String,
        /// The time in seconds.
        time: f64,
        /// Its value.
        value: f64,
    },
    /// The path of the wind up to an instant cannot be computed: the time is not finite, or too far from 0.
    #[error(
        "the wind has no value at {time} s: times must be finite, and within {limit:e} s of 0 where the speed varies"
    )]
    Time {
        /// The time in seconds.
        time: f64,
        /// The largest distance from 0 in seconds.
        limit: f64,
    },
}

/// A number in a message; very large and very small ones with an exponent.
fn shown(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-4..1e6 => value.to_string(),
        _ if value.is_finite() => format!("{value:e}"),
        _ => value.to_string(),
    }
}
