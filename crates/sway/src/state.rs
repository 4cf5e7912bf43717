//! The state of a skeleton, and the state within a step.

use crate::{Skeleton, Vector};

/// Strain beyond the rest strain, and its rate, of every segment.
///
/// Both are intensive: a production that cuts a segment in two copies them to both parts, and neither shape nor velocity changes.
/// A segment that is born in a bracket begins with zeros.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Strain u of each segment, in 1/m, in the axes of [`Segment`](crate::Segment).
    pub strain: Vec<Vector>,
    /// Rate of the strain, in 1/(m s).
    pub rate: Vec<Vector>,
    /// Level m of the last step, which had the length H/2^m. It is where the next search for a step begins, and part of the state, because
    /// the result depends on it.
    pub level: u32,
    /// Work done since the state was made.
    pub work: Work,
}

/// Energy that crossed the border of a system, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Work of the air on the segments and plates; still air takes energy, so it is negative then.
    pub wind: f64,
    /// Energy turned to heat within the tissue.
    pub dissipated: f64,
}

impl State {
    /// The rest shape, without motion.
    pub fn at_rest(skeleton: &Skeleton) -> State {
        let zeros = vec![Vector::zeros(); skeleton.len()];
        State { strain: zeros.clone(), rate: zeros, level: 0, work: Work::default() }
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.strain.len()
    }

    /// Whether there are no segments.
    pub fn is_empty(&self) -> bool {
        self.strain.is_empty()
    }
}

/// An accepted step, with the solution inside it.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Time at its beginning, in s.
    pub from: f64,
    /// Time at its end, in s.
    pub to: f64,
    /// State at its beginning.
    pub before: &'a State,
    /// State at its end.
    pub after: &'a State,
}

impl Step<'_> {
    /// Strain of a segment at a time within the step, in 1/m: the cubic that has the strains and rates at both ends.
    pub fn strain(&self, segment: usize, time: f64) -> Vector {
        hermite(
            time,
            (self.from, self.before.strain[segment], self.before.rate[segment]),
            (self.to, self.after.strain[segment], self.after.rate[segment]),
        )
        .0
    }

    /// Rate of that cubic, in 1/(m s).
    pub fn rate(&self, segment: usize, time: f64) -> Vector {
        hermite(
            time,
            (self.from, self.before.strain[segment], self.before.rate[segment]),
            (self.to, self.after.strain[segment], self.after.rate[segment]),
        )
        .1
    }
}

/// Value and rate at a time, of the cubic through two knots (time, value, rate). Both are those of the first knot if the knots are one
/// instant.
pub fn hermite(time: f64, first: (f64, Vector, Vector), second: (f64, Vector, Vector)) -> (Vector, Vector) {
    let span = second.0 - first.0;
    if span == 0.0 {
        return (first.1, first.2);
    }
    let x = (time - first.0) / span;
    let rise = second.1 - first.1;
    // In powers of x: the first rate, then two coefficients that meet value and rate at the end.
    let linear = first.2 * span;
    let square = rise * 3.0 - linear * 2.0 - second.2 * span;
    let cube = linear + second.2 * span - rise * 2.0;
    let value = first.1 + (linear + (square + cube * x) * x) * x;
    let rate = (linear + (square * 2.0 + cube * (3.0 * x)) * x) / span;
    (value, rate)
}
