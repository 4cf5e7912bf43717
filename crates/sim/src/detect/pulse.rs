//! Pulses: rates that are large for a time so short that no stage of a step falls into it.
//!
//! Step control sees a rate where a stage evaluates it and nowhere else. A flash of light of a ten-thousandth of a day
//! between two stages of a step of a day is not seen by any method. So rates that may have pulses are bounded by interval
//! arithmetic over pieces of the step, along its dense output, and compared with the rates that were seen: where they
//! may be much larger, the step is cut.
//!
//! Which rates may have pulses is known from the model ([`Solve::has_pulses`](dlsys_model::Solve::has_pulses)): those that are
//! no polynomials in what moves, and those that read what follows a formula, which a step does not resolve. NextKind moves by
//! the step itself is resolved by it, to the tolerance, and a polynomial of that has no pulses.
//!
//! In stiff equations bounds over a range of states say nothing: the rates of two states a tolerance apart may
//! differ by any amount. There the states are taken as they are in the middle of a piece, and only time and formulas vary.
//! NextKind cannot be bounded is counted, and `run --stats` and `explain` say of what.

use smallvec::SmallVec;

use crate::world::World;
use crate::world::path::Path;
use crate::world::state::State;
use dlsys_expr::{Interval, Program, Scratch};
use dlsys_model::{Rule, Solve};
use dlsys_ode::Dense;
use dlsys_tree::SimTime;

/// Rates so many times larger than all that were seen are a surprise.
const SURPRISE: f64 = 8.0;
/// Pieces of a step narrower than this are not halved any more, and no more of them are looked at.
const NARROW: f64 = 1.0 / 256.0;
const MAX_PIECES: usize = 512;
/// Most times that a step is cut for want of bounds: a part of 4^-20 of it is as narrow as anything that can be told.
pub const MAX_UNBOUNDED: usize = 20;

/// NextKind bounds say of a step, at the first position where they say anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseFinding {
    /// Nothing has been overlooked.
    Clear,
    /// Something may have been, from this position on.
    Overlooked(f64),
    /// There are no bounds near this position.
    Unbounded(f64),
}

/// A step of a module's equations, to be looked through.
pub struct Step<'p> {
    pub world: &'p World,
    pub state: &'p State,
    pub rule: &'p Rule,
    pub solve: &'p Solve,
    pub start: SimTime,
    pub end: SimTime,
    /// Where in the step the method has evaluated rates.
    pub nodes: &'p [f64],
    /// The dense output, if the module is integrated alone.
    pub own: Option<&'p Dense>,
    pub tolerance: f64,
    pub stiff: bool,
}

/// Bounds rates along steps.
#[derive(Clone, Debug, Default)]
pub struct PulseDetector {
    values: Vec<f64>,
    bounds: Vec<Interval>,
    seen: Vec<f64>,
    out: Vec<f64>,
    bounds_out: Vec<Interval>,
    scratch: Scratch<f64>,
    bounds_scratch: Scratch<Interval>,
}

impl PulseDetector {
    /// Looks along a step for what the rates of the module's equations, and its values that are solved for, may be between
    /// the places where they were evaluated.
    pub fn look(&mut self, step: &Step) -> PulseFinding {
        let all = step.end.since(step.start);
        let rates = if step.state.numeric_only { &step.solve.rates } else { &step.solve.numeric_rates };
        self.see(step, rates, all);
        let values = &step.solve.algebraic.values;
        let explicit = values.outputs() > 0 && step.solve.algebraic.explicit.iter().all(|e| *e);
        let mut start = step.start;
        while step.end.since(start) > 0.0 {
            let knot = match (&step.world.coupled, step.own) {
                (Some(solution), None) => step.world.knot(step.state, solution, start),
                _ => step.end,
            };
            let h = knot.since(start);
            if h <= 0.0 {
                break;
            }
            let path = Path::of_equations(step.world, step.state, step.rule, (start, h), step.own);
            let (before, part) = (start.since(step.start) / all, h / all);
            let mut finding = self.along(&path, rates, all * part, part, step);
            if explicit && finding == PulseFinding::Clear {
                // NextKind the dense output has of them, against what they may be.
                let rates = std::mem::take(&mut self.seen);
                let of = step.solve.algebraic.of.iter();
                self.seen =
                    of.map(|p| path.dense_bounds(*p).map_or(f64::INFINITY, Interval::magnitude)).collect();
                finding = self.along(&path, values, 1.0, part, step);
                self.seen = rates;
            }
            match finding {
                PulseFinding::Clear => start = knot,
                PulseFinding::Overlooked(at) => return PulseFinding::Overlooked(before + part * at),
                PulseFinding::Unbounded(at) => return PulseFinding::Unbounded(before + part * at),
            }
        }
        PulseFinding::Clear
    }

    /// The rates where the method has seen them.
    fn see(&mut self, step: &Step, rates: &Program, all: f64) {
        self.seen.clear();
        self.seen.resize(rates.outputs(), 0.0);
        self.out.resize(rates.outputs(), 0.0);
        for node in step.nodes {
            let at = (step.start.after(node * all), 0.0);
            let path = Path::of_equations(step.world, step.state, step.rule, at, step.own);
            path.everything_at(0.0, &mut self.values);
            rates.eval(&self.values, &mut self.scratch, &mut self.out);
            for (seen, value) in self.seen.iter_mut().zip(&self.out) {
                *seen = seen.max(value.abs());
            }
        }
    }

    /// Compares bounds of a program along a path, which is a part of the step, with what was seen. NextKind they exceed that
    /// by matters times `scale`, when it lasts for the whole path.
    fn along(&mut self, path: &Path, program: &Program, scale: f64, part: f64, step: &Step) -> PulseFinding {
        self.bounds_out.resize(program.outputs(), Interval::EMPTY);
        let mut stack: SmallVec<[(f64, f64); 16]> = SmallVec::new();
        stack.push((0.0, 1.0));
        let mut pieces = 0;
        while let Some((lo, hi)) = stack.pop() {
            pieces += 1;
            path.everything_over(lo, hi, step.stiff, &mut self.bounds);
            program.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
            let (mut surprising, mut bounded) = (false, true);
            for (bounds, seen) in self.bounds_out.iter().zip(&self.seen) {
                let size = bounds.magnitude();
                bounded &= size.is_finite();
                surprising |= !(size <= SURPRISE * seen || size * scale * (hi - lo) <= step.tolerance);
            }
            if !surprising {
                continue;
            }
            if (hi - lo) * part <= NARROW {
                return if bounded { PulseFinding::Overlooked(lo) } else { PulseFinding::Unbounded(lo) };
            }
            if pieces >= MAX_PIECES {
                return PulseFinding::Unbounded(lo);
            }
            let middle = 0.5 * (lo + hi);
            stack.extend([(middle, hi), (lo, middle)]);
        }
        PulseFinding::Clear
    }
}
