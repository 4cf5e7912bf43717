//! Closed forms: the trajectories of a clause's parameters from their values at one instant on.
//!
//! Everything here is a function of the rule and of the variables in [`Scratch`]; the prediction of whole lives
//! (`prediction`) and the general way (`start_trajectories`) both use it.

use crate::scratch::Scratch;
use crate::trajectory::{AutonomousFlow, DrivenSolution, FunctionOfTime, Pace, Riccati, Terms, Trajectory};
use crate::world::state::State;
use dlsys_expr::Value;
use dlsys_model::{SolutionForm, Solve};
use dlsys_tree::Tree;

/// The first stretch that is searched on closed forms, in units of time, if their time scale is unknown.
const FIRST_WINDOW: f64 = 1.0;

/// The trajectories of a clause from `scratch.variables`; false if a formula refuses these numbers.
pub fn formulas(solve: &Solve, time: usize, scratch: &mut Scratch, trajectories: &mut [Trajectory]) -> bool {
    let mut out = [0.0; 4];
    // For the algebra: the coefficients f and d of exponential trajectories.
    let mut sums_follow = false;
    for (law, &parameter) in solve.solution_forms.iter().zip(&solve.of) {
        match law {
            SolutionForm::Polynomial(program) => {
                let out = &mut out[..program.outputs()];
                program.eval(&scratch.variables, &mut scratch.registers, out);
                trajectories[parameter] =
                    Trajectory::Polynomial(integrated(out, scratch.variables[time + 1]));
            }
            SolutionForm::Quadratic(program) => {
                program.eval(&scratch.variables, &mut scratch.registers, &mut out[..3]);
                let riccati = Riccati::new(scratch.variables[parameter], out[0], out[1], out[2]);
                if riccati.loses_digits(scratch.variables[parameter], out[0], out[1], out[2]) {
                    return false;
                }
                trajectories[parameter] = Trajectory::Riccati(riccati);
            }
            SolutionForm::Sum { .. } => sums_follow = true,
            SolutionForm::Driven(driven) => match self::driven(driven, parameter, time, scratch) {
                Some(trajectory) => trajectories[parameter] = trajectory,
                None => return false,
            },
            SolutionForm::Numeric(_) => {}
        }
    }
    if sums_follow && !sums(solve, time, scratch, trajectories) {
        return false;
    }
    for (component, &position) in solve.numeric.iter().enumerate() {
        trajectories[solve.of[position]] = Trajectory::Step(component as u32);
    }
    trajectories.iter().zip(&scratch.variables).all(|(m, _)| !m.is_formula() || m.rate(0.0).is_finite())
}

/// The trajectory of a parameter at a pace; None if its formula does not hold for these numbers.
fn driven(
    law: &dlsys_model::DrivenGrowth,
    parameter: usize,
    time: usize,
    scratch: &mut Scratch,
) -> Option<Trajectory> {
    let mut c = [0.0; 3];
    let coefficients = &mut c[..law.coefficients.outputs()];
    law.coefficients.eval(&scratch.variables, &mut scratch.registers, coefficients);
    if coefficients.iter().any(|c| !c.is_finite()) {
        return None;
    }
    let x = scratch.variables[parameter];
    let flow = AutonomousFlow::new(law.growth, x, c)?;
    let pace = match &law.pace {
        Some(program) => Some(Pace::new(program.clone(), &scratch.variables, time)?),
        None => None,
    };
    Some(Trajectory::Driven(Box::new(DrivenSolution::new(flow, pace))))
}

/// The trajectories of explicit parameters that are formulas, and components for those that are solved for.
pub fn functions(solve: &Solve, time: usize, scratch: &Scratch, trajectories: &mut [Trajectory]) -> bool {
    let algebraic = &solve.algebraic;
    for (place, &parameter) in algebraic.of.iter().enumerate() {
        if !algebraic.closed[place] {
            continue;
        }
        let program = &algebraic.formulas[place];
        let moves = |v: &usize| *v < trajectories.len() && !matches!(trajectories[*v], Trajectory::Rest);
        let moving =
            program.reads().iter().copied().filter(moves).map(|v| (v, trajectories[v].clone())).collect();
        let Some(function) = FunctionOfTime::new(program, &scratch.variables, moving, time) else {
            return false;
        };
        trajectories[parameter] = Trajectory::Function(Box::new(function));
    }
    solved(solve, false, trajectories);
    true
}

/// Components for the algebraic parameters that are solved for, after those that are integrated.
pub fn solved(solve: &Solve, numeric_only: bool, trajectories: &mut [Trajectory]) {
    let algebraic = &solve.algebraic;
    let first = if numeric_only { solve.of.len() } else { solve.numeric.len() };
    let places = (0..algebraic.of.len()).filter(|place| algebraic.is_solved(*place, numeric_only));
    for (component, place) in (first..).zip(places) {
        trajectories[algebraic.of[place]] = Trajectory::Step(component as u32);
    }
}

/// The trajectories that are sums, those that others depend on first.
fn sums(solve: &Solve, time: usize, scratch: &mut Scratch, trajectories: &mut [Trajectory]) -> bool {
    let mut variables: Vec<Terms> = scratch.variables.iter().map(|&x| Terms::constant(x)).collect();
    for v in [time, time + 1] {
        variables[v] = Terms::affine(scratch.variables[v], 1.0);
    }
    let mut known: Vec<bool> =
        solve.solution_forms.iter().map(|law| !matches!(law, SolutionForm::Sum { .. })).collect();
    for (i, &parameter) in solve.of.iter().enumerate() {
        if known[i]
            && let Some(terms) = trajectories[parameter].terms(scratch.variables[parameter])
        {
            variables[parameter] = terms;
        }
    }
    while let Some(i) = (0..known.len()).find(|&i| {
        let SolutionForm::Sum { inflow, .. } = &solve.solution_forms[i] else { return false };
        let waits = |v: usize| solve.of.iter().position(|p| *p == v).is_some_and(|j| j != i && !known[j]);
        !known[i] && !inflow.reads().iter().copied().any(waits)
    }) {
        let SolutionForm::Sum { factor, inflow } = &solve.solution_forms[i] else {
            unreachable!("found as one")
        };
        let parameter = solve.of[i];
        let mut b = [0.0];
        factor.eval(&scratch.variables, &mut scratch.registers, &mut b);
        let mut g = [Terms::constant(0.0)];
        inflow.eval(&variables, &mut Vec::new(), &mut g);
        let Some(sum) = g[0].solve(scratch.variables[parameter], b[0]) else { return false };
        variables[parameter] = sum.terms(scratch.variables[parameter]);
        trajectories[parameter] = Trajectory::Sum(Box::new(sum));
        known[i] = true;
    }
    known.into_iter().all(|k| k)
}

/// Coefficients of the displacement whose rate is `Σ c_j age^j`, as powers of the time since a given age.
pub fn integrated(c: &[f64], age: f64) -> [f64; 4] {
    let mut shifted = [0.0; 4];
    shifted[..c.len()].copy_from_slice(c);
    if age != 0.0 {
        // Taylor shift by Horner's scheme.
        for i in 0..c.len() {
            for j in (i..c.len() - 1).rev() {
                shifted[j] += age * shifted[j + 1];
            }
        }
    }
    [shifted[0], shifted[1] / 2.0, shifted[2] / 3.0, shifted[3] / 4.0]
}

/// A time in which the formulas of a module change noticeably.
pub fn time_scale(state: &State, tree: &Tree) -> f64 {
    let values = tree.parameters(state.id);
    let times = state.trajectories.iter().zip(values).filter_map(|(law, x)| {
        let rate = law.formula()?.rate(0.0).abs();
        (rate > 0.0 && *x != 0.0).then(|| (x.abs() / rate).clamp(1e-9, 1e9))
    });
    times.reduce(f64::min).unwrap_or(FIRST_WINDOW)
}
