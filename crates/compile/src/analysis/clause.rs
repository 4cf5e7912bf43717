//! Analysis of one `solve` clause: classifies and compiles its equations.

use std::sync::Arc;

use dlsys_expr::{Graph, NodeId, Program};
use dlsys_model::{Algebraic, Equations, SolutionForm};

use super::crossings::crossing;
use super::solution_forms::{classify, jacobian, linear};
use super::stepping::{StepEquations, VariableLayout};
use super::variability::Constants;
use crate::declared::{DeclaredSolve, ResolvedRule};

/// Classifies the equations of a clause. `is_needed` is true for parameters of the module that a rule reads.
pub fn analyse_clause(
    graph: &mut Graph,
    rule: &ResolvedRule,
    solve: &DeclaredSolve,
    constants: &Constants,
    is_needed: &dyn Fn(usize) -> bool,
    layout: &VariableLayout,
) -> Equations {
    let declared = &rule.declared;
    let rates = &solve.rates;
    let total = declared.variables + solve.switches.len();
    let solution_forms = classify(graph, rates, constants, total);
    let monotone = |variable: usize| {
        let position = rates.iter().position(|(p, _)| *p == variable);
        let given = solve.algebraic.iter().any(|entry| entry.parameter == variable);
        !given && position.is_none_or(|i| is_monotone(&solution_forms[i]))
    };
    let zero_crossings = (declared.sides.iter())
        .map(|&sides| crossing(graph, sides, constants, &monotone, declared.variables))
        .collect();
    let algebraic = algebraic(graph, solve, &solution_forms, constants, total, is_needed);
    let jacobian = jacobian(graph, rates, constants, total);
    let numeric: Vec<usize> = (0..rates.len()).filter(|i| !solution_forms[*i].is_closed()).collect();
    let roots: Vec<NodeId> = numeric.iter().map(|i| rates[*i].1).collect();
    let numeric_rates = Program::compile(graph, &roots, total);
    let linear = linear(graph, &roots, constants, total);
    let clocked = rates.iter().any(|(p, _)| declared.clocks.iter().any(|clock| clock.parameter == *p));
    let all: Vec<NodeId> = rates.iter().map(|rate| rate.1).collect();
    let (of, rates): (Vec<usize>, _) =
        (rates.iter().map(|(parameter, _)| *parameter).collect(), Program::compile(graph, &all, total));
    let equations = StepEquations {
        of: &of,
        rates: &rates,
        solution_forms: &solution_forms,
        numeric: &numeric,
        numeric_rates: &numeric_rates,
        linear: linear.as_ref(),
        jacobian: &jacobian,
        algebraic: &algebraic,
    };
    Equations {
        stepping: equations.stepping(layout),
        of,
        rates,
        has_hazard_clock: clocked && !numeric.is_empty(),
        solution_forms,
        numeric,
        numeric_rates,
        linear,
        jacobian,
        algebraic,
        zero_crossings,
    }
}

/// True if a solution of this form is monotone.
fn is_monotone(form: &SolutionForm) -> bool {
    match form {
        SolutionForm::Polynomial(coefficients) => coefficients.outputs() == 1,
        SolutionForm::Quadratic(_) => true,
        SolutionForm::Driven(driven) => driven.monotone,
        _ => false,
    }
}

/// Compiles the values and implicit equations of a clause.
fn algebraic(
    graph: &mut Graph,
    solve: &DeclaredSolve,
    solution_forms: &[SolutionForm],
    constants: &Constants,
    total: usize,
    is_needed: &dyn Fn(usize) -> bool,
) -> Algebraic {
    let entries = &solve.algebraic;
    let nodes: Vec<NodeId> = entries.iter().map(|entry| entry.node).collect();
    let follows_formula = |v: u32| {
        let v = v as usize;
        let by_formula =
            solve.rates.iter().position(|(p, _)| *p == v).is_some_and(|i| solution_forms[i].is_closed());
        constants.is_constant(v as u32) || v == constants.time || v == constants.time + 1 || by_formula
    };
    let closed: Vec<bool> = (entries.iter())
        .map(|entry| entry.explicit && graph.variables(&[entry.node]).into_iter().all(follows_formula))
        .collect();
    let formulas = (nodes.iter().zip(&closed))
        .map(|(node, closed)| match closed {
            true => Arc::new(Program::compile(graph, &[*node], total)),
            false => Arc::default(),
        })
        .collect();
    let rows: Vec<(usize, NodeId)> = entries.iter().map(|entry| (entry.parameter, entry.node)).collect();
    Algebraic {
        of: rows.iter().map(|row| row.0).collect(),
        explicit: entries.iter().map(|entry| entry.explicit).collect(),
        closed,
        needed: rows.iter().map(|row| is_needed(row.0)).collect(),
        values: Program::compile(graph, &nodes, total),
        formulas,
        jacobian: jacobian(graph, &rows, constants, total),
        spans: entries.iter().map(|entry| entry.span).collect(),
    }
}
