//! The matrix of the equations of coupled modules, with the closed forms that they read as further unknowns.

use super::{Linear, Problem};
use crate::flow::coupled::rows::{FormulaInput, VariableSource};
use crate::flow::coupled::system::{Membership, System};
use crate::trajectory::{Chain, Trajectory};
use crate::world::prefetch::prefetch;
use crate::world::trajectories::Law;
use dlsys_expr::Scratch;
use dlsys_model::Rule;
use smallvec::smallvec;

/// The unknowns numbered so far.
#[derive(Default)]
struct Unknowns {
    problem: Problem,
    /// By closed form: the unknown that stands for it; [`NONE`] as long as there is none.
    inputs: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Unknowns {
    /// Makes a source an unknown of its own if it is a closed form, and what flows into that further ones; None if that solves no linear
    /// equations with real eigenvalues.
    fn number(&mut self, source: &VariableSource, formulas: &[FormulaInput]) -> Option<()> {
        let VariableSource::Formula(i) = *source else { return Some(()) };
        if self.inputs[i as usize] != NONE {
            return Some(());
        }
        let formula = &formulas[i as usize];
        let Chain { links, inflow } = chain(&formula.trajectory, formula.x, formula.offset)?;
        let Problem { entries, b, y, .. } = &mut self.problem;
        let n = y.len() as u32;
        self.inputs[i as usize] = n;
        for (n, (d, x)) in (n..).zip(&links) {
            entries.push((n, n, *d));
            y.push(*x);
            b.push(0.0);
        }
        let last = n + links.len() as u32 - 1;
        entries.extend((n..last).map(|n| (n, n + 1, 1.0)));
        b[last as usize] = inflow;
        Some(())
    }
}

/// A closed form as a chain of linear equations with real eigenvalues, from a time since its start, at which its value was `x`; None if
/// it is none.
pub fn chain(trajectory: &Trajectory, x: f64, offset: f64) -> Option<Chain> {
    let value = trajectory.at(x, offset);
    let mut chain = match trajectory {
        Trajectory::Polynomial([c, 0.0, 0.0, 0.0]) => Chain { links: smallvec![(0.0, value)], inflow: *c },
        Trajectory::Riccati(law) => {
            let decay = law.exponential()?.1;
            // x' = rate + decay (x - x(start))
            Chain { links: smallvec![(decay, value)], inflow: trajectory.rate(offset) - decay * value }
        }
        other => other.terms(x)?.chain(offset)?,
    };
    chain.links[0].1 = value;
    Some(chain)
}

impl Linear {
    /// The same as [`Linear::new`] without a table of equations, where modules read nothing but one another and what rests, and their
    /// coefficients are those of their clause. None where that is not so.
    pub fn of_plain(rules: &[Rule], modules: &Membership, y: &[f64], tolerance: f64) -> Option<Linear> {
        let world = modules.world;
        let mut problem = Problem { entries: Vec::new(), b: vec![0.0; y.len()], y: y.to_vec(), tolerance };
        let (mut known, mut out) = (None, Vec::new());
        for (at, &id) in modules.members.iter().enumerate() {
            prefetch(world, modules.members, at);
            let state = world.state(id)?;
            let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { continue };
            let clause = &rules[rule].solves[solve];
            let linear = clause.linear.as_ref()?;
            if known != Some((rule, solve)) {
                let is_plain = rules[rule].aggregates.is_empty() && clause.algebraic.is_empty();
                if !is_plain || !linear.coefficients.reads().is_empty() {
                    return None;
                }
                out.resize(linear.coefficients.outputs(), 0.0);
                // None of them is read.
                let variables = vec![0.0; rules[rule].variables + clause.switches.len()];
                linear.coefficients.eval(&variables, &mut Vec::new(), &mut out);
                known = Some((rule, solve));
                let left = modules.members.len() - at;
                problem.entries.reserve(left * linear.variables.iter().map(Vec::len).sum::<usize>());
            }
            if state.numeric_only {
                return None;
            }
            let mut next = out.iter();
            for (reads, &position) in linear.variables.iter().zip(&clause.numeric) {
                let Law::Coupled(n) = state.trajectories.get(clause.of[position])? else {
                    return None;
                };
                problem.b[n as usize] += next.next()?;
                for &variable in reads {
                    let coefficient = *next.next()?;
                    let read = clause.stepping.reads(false).iter().find(|read| read.variable == variable)?;
                    let (module, moves) = match read.neighbour.map(|n| state.context.context()[n]) {
                        None => (id, Some(state)),
                        Some(module) => (module, world.state(module)),
                    };
                    match moves.and_then(|state| state.trajectories.get(read.parameter)) {
                        Some(Law::Coupled(column)) => problem.entries.push((n, column, coefficient)),
                        None | Some(Law::Rest | Law::Step(_)) => {
                            problem.b[n as usize] +=
                                coefficient * world.tree.parameters(module)[read.parameter];
                        }
                        Some(Law::Formula(_)) => return None,
                    }
                }
            }
        }
        Linear::of(problem, (0..y.len() as u32).collect(), modules.start)
    }

    /// The solution of the equations of coupled modules, from the state `y`. None if the equations, or those of a
    /// closed form that they read, are not linear, or no method solves them without steps. `tolerance` is relative to
    /// max(1, |value|).
    pub fn new(system: &System, rules: &[Rule], y: &[f64], tolerance: f64) -> Option<Linear> {
        if !system.algebra.is_empty() {
            return None;
        }
        let table = &system.table;
        let mut unknown = vec![NONE; y.len()];
        let mut all = Unknowns { inputs: vec![NONE; table.formulas.len()], ..Unknowns::default() };
        all.problem.tolerance = tolerance;
        all.problem.y.reserve(y.len());
        all.problem.b.reserve(y.len());
        all.problem.entries.reserve(table.sources.len());
        // Unknowns are numbered in string order: the left context of a module before the module.
        for row in &table.rows {
            let rule = &rules[row.rule];
            let solve = &rule.solves[row.solve];
            if row.numeric_only {
                return None;
            }
            let linear = solve.linear.as_ref()?;
            let sources = &table.sources[row.first_source..row.first_source + row.sources];
            let before = rule.parameters.len() + rule.left.iter().map(|p| p.width).sum::<usize>();
            let is_formula = |source: &VariableSource| matches!(source, VariableSource::Formula(_));
            let read = |v: usize| linear.variables.iter().flatten().any(|r| *r == v);
            for (v, source) in sources.iter().enumerate().take(before) {
                if is_formula(source) && read(v) {
                    all.number(source, &table.formulas)?;
                }
            }
            for component in row.first_rate..row.first_rate + solve.numeric.len() {
                unknown[component] = all.problem.y.len() as u32;
                all.problem.y.push(y[component]);
                all.problem.b.push(0.0);
            }
            for (v, source) in sources.iter().enumerate().skip(before) {
                if is_formula(source) && read(v) {
                    all.number(source, &table.formulas)?;
                }
            }
        }
        let Unknowns { mut problem, inputs } = all;
        let (mut variables, mut scratch, mut out): (Vec<f64>, Scratch<f64>, Vec<f64>) = Default::default();
        // The clause whose coefficients `out` has, if they are the same for all its modules.
        let mut known = None;
        for row in &table.rows {
            let linear = rules[row.rule].solves[row.solve].linear.as_ref()?;
            let clause = (row.rule, row.solve);
            if known != Some(clause) {
                table.variables(rules, row, 0.0, y, &[], &mut variables);
                out.resize(linear.coefficients.outputs(), 0.0);
                linear.coefficients.eval(&variables, &mut scratch, &mut out);
                known = linear.coefficients.reads().is_empty().then_some(clause);
            }
            let mut next = out.iter();
            for (i, reads) in linear.variables.iter().enumerate() {
                let n = unknown[row.first_rate + i];
                problem.b[n as usize] += next.next()?;
                for &v in reads {
                    let coefficient = *next.next()?;
                    match table.sources[row.first_source + v] {
                        VariableSource::Fixed(x) => problem.b[n as usize] += coefficient * x,
                        VariableSource::State(component) => {
                            problem.entries.push((n, unknown[component as usize], coefficient));
                        }
                        VariableSource::Formula(input) => {
                            problem.entries.push((n, inputs[input as usize], coefficient));
                        }
                        VariableSource::Input(_) | VariableSource::Aggregate(_) => return None,
                    }
                }
            }
        }
        Linear::of(problem, unknown, table.start)
    }
}
