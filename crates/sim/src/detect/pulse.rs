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
//! A pulse may stand beside something larger, so what is bounded are the terms of sums, in the rates and inside functions and products in them. Each is compared
//! with its own change: where its bounds go beyond the range of its values at the stages by far more than that range, they show what no stage has seen.
//! What that does to a rate is measured: the rate is evaluated with the term as it may be.
//!
//! What jumps in an aggregate is not frozen, as what jumps elsewhere in rates is. So a term that reads one is followed to the first place at which it has another
//! value before and after; the step ends there, and the next one, which is tiny, passes over it.
//!
//! The value of a neighbour that follows a formula hides its terms, so those are examined along with the equations that read it.
//!
//! In stiff equations terms that read what is integrated are compared with their sizes at the stages: the rates of two states a tolerance apart may
//! differ by any amount. A term may still be a steep
//! function of a difference of two values that move together, so it is bounded by its value in the middle of a piece and its derivative along the dense
//! output, too, in which the two rates cancel: the excess of that bound falls with the square of the piece.
//!
//! Steps whose rates cannot be bounded are counted; `run --stats` and `explain` report their rules.

use smallvec::SmallVec;

use crate::detect::calm::CalmTest;
use crate::detect::examined::{ExaminedStep, exceeds};
use crate::trajectory::Trajectory;
use crate::world::course::Course;
use crate::world::path::Path;
use crate::world::trajectories::Law;
use dlsys_expr::{Dual, Held, Interval, Program, Scratch};
use dlsys_model::PulseTerms;
use dlsys_tree::{ModuleId, SimTime};

/// A pulse may be overlooked where the bounds of a term go beyond its range at the stages by this many times that range; in stiff equations, where they are
/// this many times larger than all its values there.
const SURPRISE: f64 = 8.0;
/// Positions between the stages of all methods at which rates are compared with those of the dense output.
const BETWEEN: [f64; 2] = [0.16, 0.55];
/// Pieces narrower than this part of a step are not halved any more.
const NARROW: f64 = 1.0 / 256.0;
/// Most pieces of a step that are examined.
const MAX_PIECES: usize = 512;
/// Pieces narrower than this part of a step, in which something jumps, are not halved any more.
const INSTANT: f64 = 1e-9;
/// Most pieces of a step that are examined for jumps.
const MAX_PIECES_OF_JUMPS: usize = 4096;
/// A jump is passed over by steps so short that it changes their ends by no more than this part of the tolerance.
const JUMP: f64 = 1e-3;
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

/// A step of a module that reads another one, and the first variable of that one in its equations.
#[derive(Clone, Copy)]
struct Reader<'r, 'p> {
    step: &'r ExaminedStep<'p>,
    course: &'r Course<'p>,
    offset: usize,
}

/// Terms of a step that are examined.
struct Examination<'e, 'p> {
    step: &'e ExaminedStep<'p>,
    course: &'e Course<'p>,
    terms: &'e PulseTerms,
    /// An expression that lasts for the whole step contributes so many times its size to the values.
    scale: f64,
    /// The step whose values count, if not those of the module itself.
    reader: Option<Reader<'e, 'p>>,
}

/// The positions of a step at which the ranges of terms have been sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
enum Sampled {
    #[default]
    Nowhere,
    Ends,
    Stages,
}

/// Bounds rates along steps. The fields are working memory.
#[derive(Clone, Debug, Default)]
pub struct PulseDetector {
    calm: CalmTest,
    /// The range of each term at the positions that have been sampled.
    ranges: Vec<Interval>,
    sampled: Sampled,
    /// By term: true if it is compared with its size and not with its change.
    stiff: Vec<bool>,
    values: Vec<f64>,
    bounds: Vec<Interval>,
    out: Vec<f64>,
    changed: Vec<f64>,
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
    /// Bounds the terms of the module's equations, and of its values that are solved for, along a step, and compares them
    /// with their values at the stages.
    pub fn examine(&mut self, step: &ExaminedStep) -> PulseFinding {
        if self.calm.is_calm(step) {
            return PulseFinding::Clear;
        }
        let (all, pulses) = (step.end.since(step.start), &step.solve.pulses);
        let formulas = if step.state.numeric_only { Some((&pulses.formula_rates, all)) } else { None };
        let own = [(&pulses.rates, all)].into_iter().chain(formulas).chain([(&pulses.values, 1.0)]);
        let course = &step.course();
        let mut first = PulseFinding::Clear;
        for (terms, scale) in own {
            first =
                first.earlier(self.examine_terms(&Examination { step, course, terms, scale, reader: None }));
        }
        if first == PulseFinding::Clear && !step.conditions.stiff && !step.conditions.sliced {
            first = along(step, |path, _| self.examine_between(step, course, path));
        }
        let mut offset = step.world.tree.parameters(step.state.id).len();
        for (n, id) in step.state.context.iter().enumerate() {
            // The variables of children are gathered, and stand nowhere.
            let reader = (n < step.state.context.context().len()).then_some(Reader { step, course, offset });
            first = first.earlier(self.examine_formulas(step, *id, reader));
            offset += step.world.tree.parameters(*id).len();
        }
        first
    }

    /// Compares the rates of the module's equations, and its values, with those of the dense output between the stages. The two formulas of a step, from
    /// which its error is estimated, may agree by chance though a stage has met a pulse: on one of some hundred steps over one.
    fn examine_between(&mut self, step: &ExaminedStep, course: &Course, path: &Path) -> PulseFinding {
        let has_values = step.solve.pulses.values.terms.outputs() > 0;
        // A value that a stage has met need not be that of the dense output.
        let stages = if has_values { step.stages.nodes } else { &[] };
        for position in BETWEEN.iter().chain(stages) {
            let at = path.start.after(position * path.h);
            course.at(at, &mut self.values);
            let is_far = BETWEEN.contains(position) && self.rates_are_far(step, course, at);
            if is_far || has_values && self.values_are_far(step, course, at) {
                return PulseFinding::Overlooked(0.0);
            }
        }
        PulseFinding::Clear
    }

    /// True if rates at an instant are not those of the dense output. The variables then are in `values`.
    fn rates_are_far(&mut self, step: &ExaminedStep, course: &Course, at: SimTime) -> bool {
        let (solve, all) = (step.solve, step.end.since(step.start));
        let rates = if step.state.numeric_only { &solve.rates } else { &solve.numeric_rates };
        self.out.resize(rates.outputs(), 0.0);
        rates.eval(&self.values, &mut self.scratch, &mut self.out);
        self.out.iter().enumerate().any(|(number, rate)| {
            let parameter = solve.of[if step.state.numeric_only { number } else { solve.numeric[number] }];
            course
                .departure(parameter, at)
                .is_some_and(|Dual { value, rate: of_dense }| step.is_far(rate * all, of_dense * all, value))
        })
    }

    /// True if values at an instant are not those of the dense output. The variables then are in `values`.
    fn values_are_far(&mut self, step: &ExaminedStep, course: &Course, at: SimTime) -> bool {
        let terms = &step.solve.pulses.values;
        self.values.resize(self.values.len() + terms.terms.outputs(), 0.0);
        self.out.resize(terms.disturbed.outputs(), 0.0);
        terms.disturbed.eval(&self.values, &mut self.scratch, &mut self.out);
        terms.parameters.iter().zip(&self.out).enumerate().any(|(number, (parameter, value))| {
            course.departure(*parameter, at).is_some_and(|Dual { value: of_dense, .. }| {
                let expected = if number < terms.explicit { of_dense } else { 0.0 };
                step.is_far(*value, expected, of_dense)
            })
        })
    }

    /// Examines the terms of the values of another module that follow formulas.
    fn examine_formulas<'p>(
        &mut self,
        step: &ExaminedStep<'p>,
        id: ModuleId,
        reader: Option<Reader<'_, 'p>>,
    ) -> PulseFinding {
        let Some(state) = step.world.state(id) else { return PulseFinding::Clear };
        let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { return PulseFinding::Clear };
        let rule = &step.conditions.rules[rule];
        let (solve, terms) = (&rule.solves[solve], &rule.solves[solve].pulses.values);
        let follows =
            |p: &usize| matches!(state.trajectories.get(*p), Some(Law::Formula(Trajectory::Function(_))));
        if terms.terms.outputs() == 0 || !terms.parameters.iter().any(follows) {
            return PulseFinding::Clear;
        }
        let scale = step.end.since(step.start);
        let other = ExaminedStep { state, rule, solve, own: None, ..*step };
        let course = &other.course();
        self.examine_terms(&Examination { step: &other, course, terms, scale, reader })
    }

    /// Bounds terms along a step and compares each with its values at the stages.
    fn examine_terms(&mut self, all: &Examination) -> PulseFinding {
        if all.terms.terms.outputs() == 0 {
            return PulseFinding::Clear;
        }
        self.ranges.clear();
        self.ranges.resize(all.terms.terms.outputs(), Interval::EMPTY);
        self.sampled = Sampled::Nowhere;
        self.note_stiff(all);
        along(all.step, |path, part| self.halve(all, path, part))
    }

    /// Notes for which terms the rates of two states a tolerance apart may differ by any amount: those of what is integrated under stiff equations.
    fn note_stiff(&mut self, all: &Examination) {
        let ExaminedStep { world, state, rule, start, own, .. } = *all.step;
        let path = Path::of_equations(world, state, rule, (start, 0.0), own);
        let is_stiff = |reads: &Vec<usize>| all.step.conditions.stiff && path.is_integrated(reads);
        self.stiff.clear();
        self.stiff.extend(all.terms.reads.iter().map(is_stiff));
    }

    /// Includes the values of terms at the ends or the stages of a step in their ranges.
    fn sample(&mut self, all: &Examination, up_to: Sampled) {
        if self.sampled >= up_to {
            return;
        }
        self.sampled = up_to;
        let (step, program) = (all.step, &all.terms.terms);
        let h = step.end.since(step.start);
        self.out.resize(program.outputs(), 0.0);
        let nodes = if up_to == Sampled::Ends { &[0.0, 1.0][..] } else { step.stages.nodes };
        for node in nodes {
            all.course.at(step.start.after(node * h), &mut self.values);
            program.eval(&self.values, &mut self.scratch, &mut self.out);
            for (range, value) in self.ranges.iter_mut().zip(&self.out) {
                let known = !range.is_empty();
                range.lo = if known { range.lo.min(*value) } else { *value };
                range.hi = if known { range.hi.max(*value) } else { *value };
            }
        }
    }

    /// Bounds terms over a path, which is the part `part` of the step, and over halves of pieces of it as long as the bounds are a surprise.
    fn halve(&mut self, all: &Examination, path: &Path, part: f64) -> PulseFinding {
        let mut stack: SmallVec<[(f64, f64); 16]> = SmallVec::new();
        stack.push((0.0, 1.0));
        let (mut pieces, mut jumps) = (0, 0);
        while let Some(piece) = stack.pop() {
            self.bound(path, &all.terms.terms, piece);
            if self.may_jump(all.terms) {
                let (lo, hi) = piece;
                let is_instant = (hi - lo) * part <= INSTANT;
                if jumps > MAX_PIECES_OF_JUMPS || is_instant && self.jumps(all, path, piece) {
                    // One that begins with a jump passes over it.
                    return PulseFinding::Overlooked(if lo > 0.0 { lo } else { hi });
                }
                if !is_instant {
                    jumps += 1;
                    let middle = 0.5 * (lo + hi);
                    stack.extend([(middle, hi), (lo, middle)]);
                }
                continue;
            }
            pieces += 1;
            if !self.is_surprised(all, path, part, piece) {
                continue;
            }
            if !path.world.stretch.is_finite() {
                self.tighten(path, &all.terms.terms, piece);
                if !self.is_surprised(all, path, part, piece) {
                    continue;
                }
            }
            let (lo, hi) = piece;
            let bounded =
                self.bounds_out.iter().take(all.terms.outer).all(|bounds| bounds.magnitude().is_finite());
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

    /// True if a term that reads aggregates of what jumps may do so over the piece whose bounds are known.
    fn may_jump(&self, terms: &PulseTerms) -> bool {
        terms.jumping.iter().zip(&self.bounds_out).any(|(jumping, bounds)| *jumping && bounds.partial)
    }

    /// True if a term has another value after a piece of a path than before, which matters.
    fn jumps(&mut self, all: &Examination, path: &Path, (lo, hi): (f64, f64)) -> bool {
        let program = &all.terms.terms;
        let [mut before, mut after] = [lo, hi].map(|at| (at, Vec::new()));
        for (at, out) in [&mut before, &mut after] {
            path.everything_at(*at, &mut self.values);
            out.resize(program.outputs(), 0.0);
            program.eval(&self.values, &mut self.scratch, out);
        }
        let differences = before.1.iter().zip(&after.1).map(|(before, after)| (after - before).abs());
        let tolerance = JUMP * all.step.conditions.tolerance;
        let mut jumps = all.terms.jumping.iter().zip(differences);
        jumps.any(|(jumping, difference)| *jumping && exceeds(all.scale * difference, tolerance))
    }

    /// True if the bounds of some term over a piece of a path allow for a pulse that no stage has seen.
    fn is_surprised(&mut self, all: &Examination, path: &Path, part: f64, (lo, hi): (f64, f64)) -> bool {
        let (share, tolerance) = (part * (hi - lo), all.step.conditions.tolerance);
        (0..self.bounds_out.len()).any(|term| {
            let (bounds, is_stiff) = (self.bounds_out[term], self.stiff[term]);
            let is_outer = term < all.terms.outer && all.reader.is_none();
            if is_outer && (bounds.hi - bounds.lo).max(0.0) * all.scale * share <= tolerance && !is_stiff {
                return false;
            }
            if !is_outer && !bounds.magnitude().is_finite() {
                // What is bounded as a whole may have terms that are not.
                return false;
            }
            let mut excess = (0.0, 0.0);
            for sampled in [Sampled::Ends, Sampled::Stages] {
                self.sample(all, sampled);
                let range = self.ranges[term];
                let usual = if is_stiff { range.magnitude() } else { range.hi - range.lo };
                excess = match is_stiff {
                    true => (bounds.hi.max(0.0), (-bounds.lo).max(0.0)),
                    false => (bounds.hi - range.hi, range.lo - bounds.lo),
                };
                if excess.0.max(excess.1) <= SURPRISE * usual {
                    return false;
                }
            }
            let effect = match is_outer {
                true => all.scale * excess.0.max(excess.1),
                false => {
                    let middle = 0.5 * (lo + hi);
                    [excess.0, -excess.1]
                        .map(|by| self.effect(all, path, middle, term, by))
                        .into_iter()
                        .fold(0.0, f64::max)
                }
            };
            exceeds(effect * share, tolerance)
        })
    }

    /// The change of values over the whole step if a term were larger by `more` than it is at a position of a path.
    fn effect(&mut self, all: &Examination, path: &Path, position: f64, term: usize, more: f64) -> f64 {
        let (terms, program) = (all.terms, &all.terms.disturbed);
        let at = path.start.after(position * path.h);
        all.course.at(at, &mut self.values);
        let first = self.values.len();
        self.values.resize(first + terms.terms.outputs(), 0.0);
        self.out.resize(program.outputs(), 0.0);
        self.changed.resize(program.outputs(), 0.0);
        program.eval(&self.values, &mut self.scratch, &mut self.out);
        self.values[first + term] = more;
        program.eval(&self.values, &mut self.scratch, &mut self.changed);
        let Some(Reader { step, course, offset }) = all.reader else {
            return all.scale * largest_difference(&self.changed, &self.out);
        };
        course.at(at, &mut self.values);
        let changes: SmallVec<[(usize, f64); 4]> =
            (terms.parameters.iter().zip(self.changed.iter().zip(&self.out)))
                .map(|(parameter, (after, before))| (offset + parameter, after - before))
                .collect();
        let rates = if step.state.numeric_only { &step.solve.rates } else { &step.solve.numeric_rates };
        let mut all_effects = 0.0f64;
        for (program, scale) in [(rates, all.scale), (&step.solve.algebraic.values, 1.0)] {
            self.out.resize(program.outputs(), 0.0);
            self.changed.resize(program.outputs(), 0.0);
            program.eval(&self.values, &mut self.scratch, &mut self.out);
            changes.iter().for_each(|(variable, more)| self.values[*variable] += more);
            program.eval(&self.values, &mut self.scratch, &mut self.changed);
            changes.iter().for_each(|(variable, more)| self.values[*variable] -= more);
            all_effects = all_effects.max(scale * largest_difference(&self.changed, &self.out));
        }
        all_effects
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

/// The largest difference of two lists; infinite where one of them has no number.
fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max)
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
