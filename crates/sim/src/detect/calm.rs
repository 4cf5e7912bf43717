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

use crate::detect::examined::{ExaminedStep, StageRange};
use crate::trajectory::Trajectory;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::{Interval, Scratch, Smooth, Value};
use dlsys_tree::ModuleId;

/// What the terms may differ by, times the length of the step, in tolerances: as much as the error of a step may be.
const SHARE: f64 = 0.1;

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
        if step.conditions.sliced || has_values || !step.rule.aggregates.is_empty() {
            return false;
        }
        let Some(stages) = step.stages.range else { return false };
        self.gather(step, stages);
        let h = step.end.since(step.start);
        let formulas = step.state.numeric_only.then_some(&pulses.formula_rates);
        std::iter::once(&pulses.rates).chain(formulas).all(|all| {
            self.terms.resize(all.terms.outputs(), Smooth::UNKNOWN);
            all.terms.eval(&self.variables, &mut self.scratch, &mut self.terms);
            // The others stand inside of these.
            self.terms[..all.outer].iter().all(|term| term.misfit * h <= SHARE * step.conditions.tolerance)
        })
    }

    /// The box of all variables.
    fn gather(&mut self, step: &ExaminedStep, stages: StageRange) {
        let (world, variables) = (step.world, &mut self.variables);
        variables.clear();
        let mut add = |id: ModuleId| {
            let values = world.tree.parameters(id);
            match world.state(id).filter(|state| !state.trajectories.is_empty()) {
                Some(state) => {
                    let laws = values.iter().zip(state.trajectories.iter());
                    variables.extend(laws.map(|(x, law)| range(step, stages, state, law, *x)));
                }
                None => variables.extend(values.iter().map(|x| Smooth::constant(*x))),
            }
        };
        add(step.state.id);
        for id in step.state.context.context() {
            add(*id);
        }
        variables.resize(step.rule.time_variable(), Smooth::constant(0.0));
        let birth = world.tree.birth(step.state.id);
        variables.push(Smooth::spanned(step.start.to_f64(), step.end.to_f64()));
        variables.push(Smooth::spanned(step.start.since(birth), step.end.since(birth)));
        let switches = step.state.marks.switch_values().map(Smooth::constant);
        variables.extend(switches);
    }
}

/// The range of a parameter over a step and its stages.
#[inline]
fn range(step: &ExaminedStep, stages: StageRange, state: &State, law: Law, x: f64) -> Smooth {
    match (law, step.own) {
        (Law::Rest, _) => Smooth::constant(x),
        (Law::Step(c), Some(dense)) if state.id == step.state.id => stages.with(c, dense.bounds(c as usize)),
        (Law::Coupled(c), None) => {
            let hull = (step.world.coupled.as_ref()).and_then(|all| all.hull(c as usize, step.start));
            hull.map_or(Smooth::UNKNOWN, |bounds| stages.with(c, bounds))
        }
        (Law::Formula(trajectory @ Trajectory::Polynomial(_)), _) => {
            let [from, to] = [step.start, step.end].map(|at| at.since(state.since));
            let Interval { lo, hi, .. } = trajectory.within(x, from, to).value;
            Smooth::spanned(lo, hi)
        }
        // What a step does not resolve.
        _ => Smooth::UNKNOWN,
    }
}
