//! Flashes: rates that are large for a time so short that no stage of a step falls into it.
//!
//! Step control sees a rate where a stage evaluates it and nowhere else. A flash of light of a ten-thousandth of a day
//! between two stages of a step of a day is not seen by any method. So rates that may have flashes are bounded by interval
//! arithmetic over pieces of the step, along its dense output, and compared with the rates that were seen: where they
//! may be much larger, the step is cut.
//!
//! Which rates may have flashes is known from the model ([`Solve::flashes`](crate::model::Solve::flashes)): those that are
//! no polynomials in what moves, and those that read what follows a formula, which a step does not resolve. What moves by
//! the step itself is resolved by it, to the tolerance, and a polynomial of that has no flashes.
//!
//! In stiff equations bounds over a range of states say nothing: the rates of two states a tolerance apart may
//! differ by any amount. There the states are taken as they are in the middle of a piece, and only time and formulas vary.
//! What cannot be bounded is counted, and `run --stats` and `explain` say of what.

use super::plant::Path;
use crate::expr::{Interval, Program, Scratch};
use crate::model::Solve;

/// Rates so many times larger than all that were seen are a surprise.
const SURPRISE: f64 = 8.0;
/// Pieces of a step narrower than this are not halved any more, and no more of them are looked at.
const NARROW: f64 = 1.0 / 256.0;
const MAX_PIECES: usize = 512;
/// Most times that a step is cut for want of bounds: a part of 4^-20 of it is as narrow as anything that can be told.
pub const MAX_UNBOUNDED: usize = 20;
/// Where rates are looked at.
const LOOKS: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0];

/// What bounds say of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Glance {
    /// Nothing has been overlooked.
    Clear,
    /// Something may have been, from this position on.
    Overlooked(f64),
    /// There are no bounds near this position.
    Unbounded(f64),
}

/// Bounds rates along steps.
#[derive(Clone, Debug, Default)]
pub struct Lookout {
    values: Vec<f64>,
    bounds: Vec<Interval>,
    seen: Vec<f64>,
    out: Vec<f64>,
    bounds_out: Vec<Interval>,
    scratch: Scratch<f64>,
    bounds_scratch: Scratch<Interval>,
}

impl Lookout {
    /// Looks along a path, the dense output of a step, for what the rates and values of the module's equations may be in
    /// between, to a tolerance.
    pub fn look(&mut self, path: &Path, solve: &Solve, tolerance: f64, stiff: bool) -> Glance {
        let rates = if path.state.forced { &solve.rates } else { &solve.numeric_rates };
        let mut glance = Glance::Clear;
        if rates.outputs() > 0 {
            glance = self.along(path, rates, path.h, tolerance, stiff);
        }
        // Values that are solved for enter other modules' rates.
        let values = &solve.algebraic.values;
        if glance == Glance::Clear && values.outputs() > 0 && solve.algebraic.explicit.iter().all(|e| *e) {
            glance = self.along(path, values, 1.0, tolerance, stiff);
        }
        glance
    }

    /// The same for one program, whose outputs matter when they last for a part of `scale`.
    fn along(&mut self, path: &Path, program: &Program, scale: f64, tolerance: f64, stiff: bool) -> Glance {
        self.seen.clear();
        self.seen.resize(program.outputs(), 0.0);
        self.out.resize(program.outputs(), 0.0);
        self.bounds_out.resize(program.outputs(), Interval::EMPTY);
        for position in LOOKS {
            path.everything_at(position, &mut self.values);
            program.eval(&self.values, &mut self.scratch, &mut self.out);
            for (seen, value) in self.seen.iter_mut().zip(&self.out) {
                *seen = seen.max(value.abs());
            }
        }
        let mut stack = vec![(0.0, 1.0)];
        let mut pieces = 0;
        while let Some((lo, hi)) = stack.pop() {
            pieces += 1;
            path.everything_over(lo, hi, stiff, &mut self.bounds);
            program.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
            let (mut surprising, mut bounded) = (false, true);
            for (bounds, seen) in self.bounds_out.iter().zip(&self.seen) {
                let size = bounds.magnitude();
                bounded &= size.is_finite();
                surprising |= !(size <= SURPRISE * seen || size * scale * (hi - lo) <= tolerance);
            }
            if !surprising {
                continue;
            }
            if hi - lo <= NARROW {
                return if bounded { Glance::Overlooked(lo) } else { Glance::Unbounded(lo) };
            }
            if pieces >= MAX_PIECES {
                return Glance::Unbounded(lo);
            }
            let middle = 0.5 * (lo + hi);
            stack.extend([(middle, hi), (lo, middle)]);
        }
        Glance::Clear
    }
}
