//! The error type of the crate.

/// Why a mesh is no sheet, or a sheet cannot be advanced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of the tissue, of a solid, or of the settings is out of range.
    #[error("{name} of {value} is out of range: expected {expected}")]
    Value {
        /// What has the value.
        name: &'static str,
        /// The value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// The mesh has too many points, or none.
    #[error("the mesh has {points} points: expected 1 to {most}")]
    Points {
        /// Points of the mesh.
        points: usize,
        /// The largest number.
        most: usize,
    },
    /// A face or a cord has a point that does not exist, or the same point twice, or a face has fewer than three points.
    #[error("{element} {index} is not valid: {what}")]
    Element {
        /// "face" or "cord".
        element: &'static str,
        /// Its index in the mesh, from 0.
        index: usize,
        /// Description of the mistake.
        what: &'static str,
    },
    /// More than two faces share an edge.
    #[error("the mesh is not manifold: {faces} faces share the edge between points {} and {}", edge[0], edge[1])]
    Manifold {
        /// The ends of the edge, from 0.
        edge: [usize; 2],
        /// Number of faces at it.
        faces: usize,
    },
    /// A point belongs to no face and to no cord, so that it has no mass.
    #[error("point {point} belongs to no face and to no cord, so it has no mass")]
    Massless {
        /// Its index, from 0.
        point: usize,
    },
    /// The state does not fit the sheet and the solids.
    #[error("the state has {state} {what}, where {expected} are expected")]
    State {
        /// "points" or "free bodies".
        what: &'static str,
        /// Number in the state.
        state: usize,
        /// Number in the sheet or among the solids.
        expected: usize,
    },
    /// The error of a step is too large, or a solid goes too deep, even with the shortest step.
    #[error("at {time:.6} s, steps of {step:.1e} s are not short enough: {cause}")]
    Step {
        /// Time at which the step begins, in s.
        time: f64,
        /// Length of the shortest step, in s.
        step: f64,
        /// What was too large.
        cause: Rejection,
    },
    /// The steps that the tolerance requires are too many.
    #[error("at {time:.6} s, steps of {step:.1e} s are more than {most:e} in a step of the clock: {cause}")]
    Steps {
        /// Time that was reached, in s.
        time: f64,
        /// Length of the last step, in s.
        step: f64,
        /// The largest number.
        most: u64,
        /// Why steps are short.
        cause: Rejection,
    },
    /// The linear system of a step has not been solved within the number of iterations.
    #[error("at {time:.6} s, {iterations} iterations do not solve the system of a step of {step:.1e} s")]
    Solve {
        /// Time at which the step begins, in s.
        time: f64,
        /// Length of the step, in s.
        step: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// [`Solver::deadline`](crate::Solver::deadline) is over.
    #[error("no time is left at {time:.6} s")]
    OutOfTime {
        /// Time that was reached, in s.
        time: f64,
    },
}

/// Why a step was made shorter.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// The estimate of the error.
    #[error("the error of point {point} is {excess:.1e} times the tolerance")]
    Error {
        /// The point, or the number of points and the index of a free body in sum.
        point: usize,
        /// The error in units of the tolerance; not finite if the motion is not.
        excess: f64,
    },
    /// Solid and sheet move too far relative to each other for a sure search of contacts.
    #[error("solid {solid} and the sheet move by {moved:.1e} m relative to each other")]
    Fast {
        /// Index of the solid.
        solid: usize,
        /// Relative motion in m.
        moved: f64,
    },
    /// The sheet is too deep in a solid.
    #[error("the sheet is {depth:.1e} m deep in solid {solid}, which is squeezed or driven too hard")]
    Deep {
        /// Index of the solid.
        solid: usize,
        /// Depth in m.
        depth: f64,
    },
    /// The linear system was not solved.
    #[error("the linear system is not solved in {iterations} iterations")]
    Unsolved {
        /// Iterations made.
        iterations: usize,
    },
    /// Nothing: steps of the longest length.
    #[error("no step was rejected")]
    None,
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
