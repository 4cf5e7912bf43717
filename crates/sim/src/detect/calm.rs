//! Steps over which no rate can have a pulse, because all rates are polynomials there but for less than the tolerance.
//!
//! Polynomials of what a step integrates have no pulses ([`Pulses`](dlsys_model::Pulses)): a step resolves its variables to the tolerance, so no stage and no
//! estimate of its error can miss what they do. A rate that is no polynomial is examined because it might do anything
//! between the stages. It cannot where the arguments of its functions move little. Let B be a box of the variables that
//! contains the dense output of the step and all states at which the method has evaluated rates, and let each term of a rate
//! differ from a polynomial of the variables by no more than ε in all of B ([`Smooth`]). Then
//!
//! - whatever the method has done in this step, stages, estimate of the error and dense output, it has done to the polynomials but for
//!   rates that differ by ε at each place, so to values that differ by about h ε;
//! - the equations differ from those with the polynomials by ε along the dense output, so the solutions differ by about h ε.
//!
//! So if h ε is no more than the error of a step may be, for each term, the step is as good as one of polynomials, of which no pulse is feared. In particular no
//! stage can have met a pulse beside the dense output that the two formulas of the step by chance do not show: the stages are in B.
//!
//! The test is one evaluation of the terms. Most steps that accuracy has made short pass it; others are examined piece by piece ([`pulse`](super::pulse)).

use crate::detect::pulse::ExaminedStep;
use crate::trajectory::Trajectory;
use crate::world::state::State;
use dlsys_expr::{Interval, Scratch, Smooth, Value};
use dlsys_ode::Reached;

/// What the terms may differ by, times the length of the step, in tolerances: as much as the error of a step may be.
const SHARE: f64 = 0.1;

/// The range of integrated variables at the stages of a step, or of several end to end.
#[derive(Clone, Copy)]
pub struct StageRange<'p> {
    pub reached: Reached<'p>,
    /// By component of the coupled solution: its number in the step. Those that are not in the step, with a number beyond, are its inputs along their dense output. None if
    /// they are numbered alike.
    pub numbers: Option<&'p [u32]>,
}

/// The range of the components over steps end to end.
#[derive(Clone, Default)]
pub struct RangeOfSteps {
    least: Vec<f64>,
    greatest: Vec<f64>,
    steps: usize,
    is_known: bool,
}

impl RangeOfSteps {
    /// Begins with the first of other steps.
    pub fn begin(&mut self) {
        (self.steps, self.is_known) = (0, true);
    }

    /// Includes a step, if its range is known.
    pub fn add(&mut self, step: Option<Reached>) {
        let Some(Reached { least, greatest }) = step else {
            self.is_known = false;
            return;
        };
        if self.steps == 0 {
            self.least.clear();
            self.greatest.clear();
            self.least.extend_from_slice(least);
            self.greatest.extend_from_slice(greatest);
        }
        self.least.iter_mut().zip(least).for_each(|(known, new)| *known = known.min(*new));
        self.greatest.iter_mut().zip(greatest).for_each(|(known, new)| *known = known.max(*new));
        self.steps += 1;
    }

    /// The range of all of them, if it is known.
    pub fn stages<'r>(&'r self, numbers: &'r [u32]) -> Option<StageRange<'r>> {
        let reached = Reached { least: &self.least, greatest: &self.greatest };
        (self.is_known && self.steps > 0).then_some(StageRange { reached, numbers: Some(numbers) })
    }
}

impl<'p> StageRange<'p> {
    /// The range of a step whose components are numbered as they are known.
    pub fn of_step(reached: Reached<'p>) -> StageRange<'p> {
        StageRange { reached, numbers: None }
    }

    /// The range of a component whose dense output has these bounds.
    fn with(&self, component: u32, bounds: Interval) -> Smooth {
        let number = match self.numbers {
            Some(numbers) => numbers.get(component as usize).copied().unwrap_or(u32::MAX),
            None => component,
        };
        match self.reached.of(number as usize) {
            Some((lo, hi)) => Smooth::spanned(bounds.lo.min(lo), bounds.hi.max(hi)),
            None if self.numbers.is_some() => Smooth::spanned(bounds.lo, bounds.hi),
            None => Smooth::UNKNOWN,
        }
    }
}

/// Tests steps; the fields are working memory.
#[derive(Clone, Debug, Default)]
pub struct CalmTest {
    variables: Vec<Smooth>,
    terms: Vec<Smooth>,
    scratch: Scratch<Smooth>,
}

impl CalmTest {
    /// True if the terms of the module's rates are polynomials along the step but for less than the tolerance.
    pub fn is_calm(&mut self, step: &ExaminedStep) -> bool {
        let pulses = &step.solve.pulses;
        let has_values = pulses.values.terms.outputs() > 0;
        if step.sliced || has_values || !step.rule.aggregates.is_empty() {
            return false;
        }
        let Some(stages) = step.stages else { return false };
        self.gather(step, stages);
        let h = step.end.since(step.start);
        let formulas = step.state.numeric_only.then_some(&pulses.formula_rates);
        std::iter::once(&pulses.rates).chain(formulas).all(|all| {
            self.terms.resize(all.terms.outputs(), Smooth::UNKNOWN);
            all.terms.eval(&self.variables, &mut self.scratch, &mut self.terms);
            // The others stand inside of these.
            self.terms[..all.outer].iter().all(|term| term.misfit * h <= SHARE * step.tolerance)
        })
    }

    /// The box of all variables.
    fn gather(&mut self, step: &ExaminedStep, stages: StageRange) {
        let (world, variables) = (step.world, &mut self.variables);
        variables.clear();
        for &id in std::iter::once(&step.state.id).chain(step.state.context.context()) {
            let values = world.tree.parameters(id);
            match world.state(id).filter(|state| !state.trajectories.is_empty()) {
                Some(state) => variables.extend(
                    (values.iter().zip(&state.trajectories))
                        .map(|(x, trajectory)| range(step, stages, state, trajectory, *x)),
                ),
                None => variables.extend(values.iter().map(|x| Smooth::constant(*x))),
            }
        }
        variables.resize(step.rule.time_variable(), Smooth::constant(0.0));
        let birth = world.tree.birth(step.state.id);
        variables.push(Smooth::spanned(step.start.to_f64(), step.end.to_f64()));
        variables.push(Smooth::spanned(step.start.since(birth), step.end.since(birth)));
        let switches = step.state.switches.iter().map(|&on| Smooth::constant(f64::from(u8::from(on))));
        variables.extend(switches);
    }
}

/// The range of a parameter over a step and its stages.
#[inline]
fn range(step: &ExaminedStep, stages: StageRange, state: &State, trajectory: &Trajectory, x: f64) -> Smooth {
    match (trajectory, step.own) {
        (Trajectory::Rest, _) => Smooth::constant(x),
        (Trajectory::Step(c), Some(dense)) if state.id == step.state.id => {
            stages.with(*c, dense.bounds(*c as usize))
        }
        (Trajectory::Coupled(c), None) => {
            let hull = (step.world.coupled.as_ref()).and_then(|all| all.hull(*c as usize, step.start));
            hull.map_or(Smooth::UNKNOWN, |bounds| stages.with(*c, bounds))
        }
        (Trajectory::Polynomial(_), _) => {
            let [from, to] = [step.start, step.end].map(|at| at.since(state.since));
            let Interval { lo, hi, .. } = trajectory.within(x, from, to).value;
            Smooth::spanned(lo, hi)
        }
        // What a step does not resolve.
        _ => Smooth::UNKNOWN,
    }
}
