//! Pulses: rates that are large for a time so short that no stage of a step falls into it.
//!
//! Step control depends on rates where a stage evaluates them and nowhere else. A rate that is large for a
//! ten-thousandth of a day, between two stages of a step of a day, is invisible to every method. So rates that may have
//! pulses are bounded by interval arithmetic over pieces of the step, along its dense output, and compared with the
//! rates at the stages: where the bounds are much larger, the step is cut.
//!
//! The analysis of the model tells which terms of rates may have pulses ([`Pulses`](dlsys_model::Pulses)):
//! those that are not polynomial in the variables that move, and those that read a variable with a closed form, which a
//! step does not resolve. An integrated variable is resolved by the step to the tolerance, and a polynomial of it has
//! no pulses.
//!
//! Fields ([`dlsys_expr::Field`]) are held at the middle of a piece, too: they do not vary on less than the time that they give, and steps of equations that read
//! them are no longer than some of that ([`World::resolved`]).
//!
//! In stiff equations bounds of a whole rate carry no information: large terms cancel each other, and the rates of two states a tolerance apart may
//! differ by any amount. There the terms that may have pulses are bounded one by one and compared with themselves at the stages. A term may still be a steep
//! function of a difference of two values that move together, so it is bounded by its value in the middle of a piece and its derivative along the dense
//! output, too, in which the two rates cancel: the excess of that bound falls with the square of the piece.
//!
//! In all equations a pulse may stand beside something larger, so each such term is also compared with its own change: where its bounds go beyond the
//! range of its values at the stages by far more than that range, they show what no stage has seen.
//!
//! Steps whose rates cannot be bounded are counted; `run --stats` and `explain` report their rules.

use smallvec::SmallVec;

use crate::world::World;
use crate::world::path::Path;
use crate::world::state::State;
use dlsys_expr::{Dual, Held, Interval, Program, Scratch};
use dlsys_model::{Rule, Solve};
use dlsys_ode::Dense;
use dlsys_tree::SimTime;

/// A rate may be overlooked where its bound is this many times larger than all its values at the stages.
const SURPRISE: f64 = 8.0;
/// A pulse may be overlooked where the bounds of a term go beyond its range at the stages by this many times that range.
const SURPRISING_CHANGE: f64 = 8.0;
/// Pieces narrower than this part of a step are not halved any more.
const NARROW: f64 = 1.0 / 256.0;
/// Most pieces of a step that are examined.
const MAX_PIECES: usize = 512;
/// Most times that a step is cut for want of bounds: a part of 4^-20 of it is at the limit of resolution.
pub const MAX_UNBOUNDED: usize = 20;

/// The result of the examination of a step. Positions are parts of the step, from 0 to 1; the first of them counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseFinding {
    /// No pulse has been overlooked.
    Clear,
    /// A pulse may have been overlooked from this position on.
    Overlooked(f64),
    /// The rates have no bounds near this position.
    Unbounded(f64),
}

impl PulseFinding {
    /// The one of two findings that comes first in the step.
    fn earlier(self, other: PulseFinding) -> PulseFinding {
        let at = |finding| match finding {
            PulseFinding::Clear => f64::INFINITY,
            PulseFinding::Overlooked(at) | PulseFinding::Unbounded(at) => at,
        };
        if at(other) < at(self) { other } else { self }
    }
}

/// A step of a module's equations that is to be examined.
pub struct ExaminedStep<'p> {
    /// The world before the step, with the solution of the coupled modules.
    pub world: &'p World,
    /// The module, its rule and its active equations.
    pub state: &'p State,
    /// See `state`.
    pub rule: &'p Rule,
    /// See `state`.
    pub solve: &'p Solve,
    /// The instants between which rates are bounded.
    pub start: SimTime,
    /// See `start`.
    pub end: SimTime,
    /// The positions in the step at which the method has evaluated rates, from 0 to 1.
    pub nodes: &'p [f64],
    /// The dense output, if the module is integrated alone; else it is that of the coupled modules.
    pub own: Option<&'p Dense>,
    /// The rates at the start, if that is one of the nodes and the module is integrated alone.
    pub at_start: Option<&'p [f64]>,
    /// The largest contribution to the values that may be overlooked.
    pub tolerance: f64,
    /// The equations are stiff: their terms are examined one by one.
    pub stiff: bool,
}

/// Bounds rates along steps. The fields are working memory.
#[derive(Clone, Debug, Default)]
pub struct PulseDetector {
    values: Vec<f64>,
    bounds: Vec<Interval>,
    seen: Vec<f64>,
    ranges: Vec<Interval>,
    out: Vec<f64>,
    bounds_out: Vec<Interval>,
    scratch: Scratch<f64>,
    bounds_scratch: Scratch<Interval>,
    held: Vec<Held>,
    held_out: Vec<Held>,
    held_scratch: Scratch<Held>,
    along: Vec<Dual<Interval>>,
    along_out: Vec<Dual<Interval>>,
    along_scratch: Scratch<Dual<Interval>>,
}

impl PulseDetector {
    /// Bounds the rates of the module's equations, and its values that are solved for, along a step, and compares them
    /// with the values at the stages.
    pub fn examine(&mut self, step: &ExaminedStep) -> PulseFinding {
        let finding = self.examine_sizes(step);
        if step.stiff || finding != PulseFinding::Clear {
            return finding;
        }
        let (all, pulses) = (step.end.since(step.start), &step.solve.pulses);
        let mut first = self.examine_changes(step, &pulses.rates, all);
        if step.state.numeric_only {
            first = first.earlier(self.examine_changes(step, &pulses.formula_rates, all));
        }
        first.earlier(self.examine_changes(step, &pulses.values, 1.0))
    }

    /// As [`PulseDetector::examine`], by the sizes of rates, or of terms where the equations are stiff.
    fn examine_sizes(&mut self, step: &ExaminedStep) -> PulseFinding {
        if step.stiff {
            let (all, pulses) = (step.end.since(step.start), &step.solve.pulses);
            let mut first = self.examine_terms(step, &pulses.rates, all);
            if step.state.numeric_only {
                first = first.earlier(self.examine_terms(step, &pulses.formula_rates, all));
            }
            return first.earlier(self.examine_terms(step, &pulses.values, 1.0));
        }
        let all = step.end.since(step.start);
        let rates = if step.state.numeric_only { &step.solve.rates } else { &step.solve.numeric_rates };
        self.seen.clear();
        self.seen.resize(rates.outputs(), 0.0);
        // Most rates change so little over a step that those at its start tell enough.
        if let Some(at_start) = step.at_start {
            self.seen.iter_mut().zip(at_start).for_each(|(seen, rate)| *seen = rate.abs());
            if self.is_plain(step, rates, all) {
                return PulseFinding::Clear;
            }
        }
        let values = &step.solve.algebraic.values;
        let explicit = values.outputs() > 0 && step.solve.algebraic.explicit.iter().all(|e| *e);
        let mut sampled = Vec::new();
        if explicit {
            self.sample(step, values, all);
            sampled.clone_from(&self.seen);
        }
        self.sample(step, rates, all);
        along(step, |path, part| {
            let finding = self.compare(path, rates, all * part, part, step);
            if !explicit || finding != PulseFinding::Clear {
                return finding;
            }
            // Bounds of the explicit values are compared with the dense output of these values, which others read, and with the values at the stages: dense
            // output has stages of its own, on which no error depends.
            let rates = std::mem::take(&mut self.seen);
            let of = step.solve.algebraic.of.iter().zip(&sampled);
            let seen = |(p, at_stages): (&usize, &f64)| {
                path.dense_bounds(*p).map_or(f64::INFINITY, |bounds| bounds.magnitude().min(*at_stages))
            };
            self.seen = of.map(seen).collect();
            let finding = self.compare(path, values, 1.0, part, step);
            self.seen = rates;
            finding
        })
    }

    /// True for a step of a module that is integrated alone whose rates are bounded over the whole of it by what has been seen.
    fn is_plain(&mut self, step: &ExaminedStep, rates: &Program, all: f64) -> bool {
        if step.solve.algebraic.values.outputs() > 0 {
            return false;
        }
        let path = Path::of_equations(step.world, step.state, step.rule, (step.start, all), step.own);
        self.bound(&path, rates, (0.0, 1.0));
        self.bounds_out.iter().zip(&self.seen).all(|(bounds, seen)| bounds.magnitude() <= SURPRISE * seen)
    }

    /// Bounds terms of the module's equations and compares each with its values at the stages. One that lasts for the whole step contributes `scale`
    /// times its size to the values.
    fn examine_terms(&mut self, step: &ExaminedStep, terms: &Program, scale: f64) -> PulseFinding {
        if terms.outputs() == 0 {
            return PulseFinding::Clear;
        }
        self.sample(step, terms, step.end.since(step.start));
        along(step, |path, part| self.compare(path, terms, scale * part, part, step))
    }

    /// Compares bounds of terms with the range of their values at the ends of the step, and if need be at all stages.
    fn examine_changes(&mut self, step: &ExaminedStep, terms: &Program, scale: f64) -> PulseFinding {
        if terms.outputs() == 0 {
            return PulseFinding::Clear;
        }
        self.ranges.clear();
        self.ranges.resize(terms.outputs(), Interval::EMPTY);
        let mut finding = PulseFinding::Clear;
        for nodes in [&[0.0, 1.0][..], step.nodes] {
            self.widen_ranges(step, terms, nodes);
            finding = along(step, |path, part| self.compare_changes(path, terms, scale * part, part, step));
            if finding == PulseFinding::Clear {
                break;
            }
        }
        finding
    }

    /// Includes the values of a program at some positions of a step in its ranges.
    fn widen_ranges(&mut self, step: &ExaminedStep, program: &Program, nodes: &[f64]) {
        let all = step.end.since(step.start);
        self.out.resize(program.outputs(), 0.0);
        for node in nodes {
            let at = (step.start.after(node * all), 0.0);
            let path = Path::of_equations(step.world, step.state, step.rule, at, step.own);
            path.everything_at(0.0, &mut self.values);
            program.eval(&self.values, &mut self.scratch, &mut self.out);
            for (range, value) in self.ranges.iter_mut().zip(&self.out) {
                let known = !range.is_empty();
                range.lo = if known { range.lo.min(*value) } else { *value };
                range.hi = if known { range.hi.max(*value) } else { *value };
            }
        }
    }

    /// Compares bounds of terms along a path with their ranges; as [`PulseDetector::compare`].
    fn compare_changes(
        &mut self,
        path: &Path,
        terms: &Program,
        scale: f64,
        part: f64,
        step: &ExaminedStep,
    ) -> PulseFinding {
        self.halve(path, terms, part, true, |bounds, detector, length| {
            bounds.iter().zip(&detector.ranges).any(|(bounds, range)| {
                let excess = (bounds.hi - range.hi).max(range.lo - bounds.lo);
                !(excess <= SURPRISING_CHANGE * (range.hi - range.lo)
                    || excess * scale * length <= step.tolerance)
            })
        })
    }

    /// Evaluates a program at the stages of the method, and keeps the largest size of each output.
    fn sample(&mut self, step: &ExaminedStep, program: &Program, all: f64) {
        self.seen.clear();
        self.seen.resize(program.outputs(), 0.0);
        self.out.resize(program.outputs(), 0.0);
        for node in step.nodes {
            let at = (step.start.after(node * all), 0.0);
            let path = Path::of_equations(step.world, step.state, step.rule, at, step.own);
            path.everything_at(0.0, &mut self.values);
            program.eval(&self.values, &mut self.scratch, &mut self.out);
            for (seen, value) in self.seen.iter_mut().zip(&self.out) {
                *seen = seen.max(value.abs());
            }
        }
    }

    /// Compares bounds of a program along a path, which is the part `part` of the step, with its values at the stages.
    /// A rate that lasts for the whole path contributes `scale` times its size to the values.
    fn compare(
        &mut self,
        path: &Path,
        program: &Program,
        scale: f64,
        part: f64,
        step: &ExaminedStep,
    ) -> PulseFinding {
        self.halve(path, program, part, step.stiff, |bounds, detector, length| {
            bounds.iter().zip(&detector.seen).any(|(bounds, seen)| {
                let size = bounds.magnitude();
                !(size <= SURPRISE * seen || size * scale * length <= step.tolerance)
            })
        })
    }

    /// Bounds a program over a path, and over halves of pieces of it as long as the bounds are a surprise in a piece of some length.
    fn halve(
        &mut self,
        path: &Path,
        program: &Program,
        part: f64,
        tightens: bool,
        is_surprise: impl Fn(&[Interval], &PulseDetector, f64) -> bool,
    ) -> PulseFinding {
        let mut stack: SmallVec<[(f64, f64); 16]> = SmallVec::new();
        stack.push((0.0, 1.0));
        let mut pieces = 0;
        while let Some((lo, hi)) = stack.pop() {
            pieces += 1;
            self.bound(path, program, (lo, hi));
            if !is_surprise(&self.bounds_out, self, hi - lo) {
                continue;
            }
            if tightens && !path.world.stretch.is_finite() {
                self.tighten(path, program, (lo, hi));
                if !is_surprise(&self.bounds_out, self, hi - lo) {
                    continue;
                }
            }
            let bounded = self.bounds_out.iter().all(|bounds| bounds.magnitude().is_finite());
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

    /// Bounds the outputs of a program over a piece of a path.
    fn bound(&mut self, path: &Path, program: &Program, (lo, hi): (f64, f64)) {
        self.bounds_out.resize(program.outputs(), Interval::EMPTY);
        path.everything_over(lo, hi, &mut self.bounds);
        if path.world.stretch.is_finite() {
            self.held.clear();
            self.held.extend(self.bounds.iter().copied().map(Held));
            self.held_out.resize(program.outputs(), Held(Interval::EMPTY));
            program.eval(&self.held, &mut self.held_scratch, &mut self.held_out);
            self.bounds_out.iter_mut().zip(&self.held_out).for_each(|(out, held)| *out = held.0);
        } else {
            program.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
        }
    }

    /// Narrows the bounds of outputs by the mean value theorem: the value in the middle, and the derivative along the path.
    fn tighten(&mut self, path: &Path, program: &Program, (lo, hi): (f64, f64)) {
        path.everything_along(lo, hi, &mut self.along);
        self.along_out.resize(program.outputs(), Dual { value: Interval::EMPTY, rate: Interval::EMPTY });
        program.eval(&self.along, &mut self.along_scratch, &mut self.along_out);
        path.everything_at(0.5 * (lo + hi), &mut self.values);
        self.out.resize(program.outputs(), 0.0);
        program.eval(&self.values, &mut self.scratch, &mut self.out);
        for ((bounds, along), middle) in self.bounds_out.iter_mut().zip(&self.along_out).zip(&self.out) {
            let reach = 0.5 * (hi - lo) * along.rate.magnitude();
            if !along.value.partial && !along.rate.partial && reach.is_finite() && middle.is_finite() {
                bounds.lo = bounds.lo.max(middle - reach);
                bounds.hi = bounds.hi.min(middle + reach);
            }
        }
    }
}

/// The first finding along a step, which is gone through in pieces on which all dense output is that of one step each: `examine` gets a piece, and the part of the
/// step that it is.
fn along(step: &ExaminedStep, mut examine: impl FnMut(&Path, f64) -> PulseFinding) -> PulseFinding {
    let all = step.end.since(step.start);
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
        match examine(&path, part) {
            PulseFinding::Clear => start = knot,
            PulseFinding::Overlooked(at) => return PulseFinding::Overlooked(before + part * at),
            PulseFinding::Unbounded(at) => return PulseFinding::Unbounded(before + part * at),
        }
    }
    PulseFinding::Clear
}
