//! The error type of the crate.

/// Why a skeleton cannot be advanced, or an equilibrium not be found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of the skeleton is out of range.
    #[error("segment {segment}: {what}")]
    Value {
        /// Index of the segment.
        segment: usize,
        /// Description of the mistake.
        what: &'static str,
    },
    /// State and skeleton have different numbers of segments.
    #[error("the state has {state} segments, the skeleton {skeleton}")]
    Length {
        /// Segments of the state.
        state: usize,
        /// Segments of the skeleton.
        skeleton: usize,
    },
    /// The error is too large even with the shortest step.
    #[error(
        "at {time:.6} s, steps of {step:.1e} s are not short enough for segment {segment}, whose error is {excess:.1e} times the tolerance"
    )]
    Step {
        /// Time at which the step begins, in s.
        time: f64,
        /// Length of the shortest step, in s.
        step: f64,
        /// The segment with the largest error.
        segment: usize,
        /// Its error, in units of the tolerance; not finite if its motion is not.
        excess: f64,
    },
    /// The steps that the tolerance requires are too many.
    #[error(
        "at {time:.6} s, steps of {step:.1e} s for segment {segment} are more than {most:e} in a step of the clock"
    )]
    Steps {
        /// Time that was reached, in s.
        time: f64,
        /// Length of the last step, in s.
        step: f64,
        /// The segment with the largest error in it.
        segment: usize,
        /// The largest number.
        most: u64,
    },
    /// [`Solver::deadline`](crate::Solver::deadline) is over.
    #[error("no time is left at {time:.6} s")]
    OutOfTime {
        /// Time that was reached, in s.
        time: f64,
    },
    /// An equilibrium has not been found within the number of iterations.
    #[error(
        "no equilibrium after {iterations} iterations; segment {segment} still moves by {moved} m in one"
    )]
    Equilibrium {
        /// Iterations made.
        iterations: usize,
        /// The segment that moved the most in the last iteration.
        segment: usize,
        /// How far it moved, in m.
        moved: f64,
    },
    /// Eigenvalues have not been found.
    #[error("no vibration can be computed: {0}")]
    Vibration(&'static str),
}
