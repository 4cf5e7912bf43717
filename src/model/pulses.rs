//! Which rates may be large for a time too short for a step to see.
//!
//! A step resolves what it integrates, and polynomials of that. It does not resolve time, nor what follows a formula: that
//! may do anything between two stages. So a rate may have flashes if it is no polynomial in what moves, or reads something
//! that follows a formula other than a polynomial of time.

use super::analysis::Draft;
use super::{Law, Model, Rule, Solve};
use crate::expr::{Graph, NodeId};

/// Sets [`Solve::flashes`] in all rules. `moving` tells, by rule, which variables of the context move.
pub fn find_flashes(graph: &mut Graph, model: &mut Model, drafts: &[Draft], moving: &[Vec<bool>]) {
    let mut formulas: Vec<Vec<bool>> =
        model.kinds.iter().map(|(_, kind)| vec![false; kind.width()]).collect();
    for (id, kind) in model.kinds.iter() {
        for solve in kind.rules.iter().flat_map(|rule| &model.rules[*rule].solves) {
            for parameter in by_formula(solve) {
                formulas[id.index()][parameter] = true;
            }
        }
    }
    for ((rule, draft), moving) in model.rules.iter_mut().zip(drafts).zip(moving) {
        let context = context_by_formula(rule, &formulas);
        let terms_read: bool = (rule.aggregates.iter()).any(|aggregate| {
            aggregate.pattern.kinds.iter().any(|kind| formulas[kind.index()].contains(&true))
        });
        let (own, time) = (rule.parameters.len(), rule.variables - 2);
        for (number, solve) in rule.solves.iter_mut().enumerate() {
            let mut nodes: Vec<NodeId> = draft.rates[number].iter().map(|rate| rate.1).collect();
            nodes.extend(
                draft.algebraic[number].iter().filter(|entry| entry.explicit).map(|entry| entry.node),
            );
            // Terms of aggregates count as what they are added up in.
            let read = graph.variables(&nodes);
            let summed =
                (0..rule.aggregates.len()).filter(|i| read.contains(&((rule.first_aggregate + i) as u32)));
            nodes.extend(summed.map(|i| draft.terms[i]));
            let formula_of: Vec<usize> = by_formula(solve).collect();
            let moved = |v: usize| match v {
                v if v < own => solve.of.contains(&v) || solve.algebraic.of.contains(&v),
                v if v < time => moving[v - own],
                // Those of children come after all others.
                v => v <= time + 1 || v >= rule.variables,
            };
            let unresolved = |v: usize| match v {
                v if v < own => formula_of.contains(&v),
                v if v < time => context[v - own] || v >= rule.first_aggregate && terms_read,
                _ => false,
            };
            // What has a formula itself is integrated only where everything is.
            let rates = draft.rates[number].iter().zip(&solve.laws);
            let closed: Vec<NodeId> =
                rates.filter(|(_, law)| law.is_closed()).map(|((_, node), _)| *node).collect();
            solve.flashes = nodes.iter().any(|node| {
                let reads_formula = || graph.variables(&[*node]).into_iter().any(|v| unresolved(v as usize));
                !closed.contains(node) && reads_formula()
                    || graph.polynomial(*node, |v| moved(v as usize)).is_none()
            });
        }
    }
}

/// The parameters of a clause that follow formulas which are no polynomials.
fn by_formula(solve: &Solve) -> impl Iterator<Item = usize> + '_ {
    let laws = solve.laws.iter().zip(&solve.of);
    let closed = laws.filter(|(law, _)| law.is_closed() && !matches!(law, Law::Polynomial(_)));
    let given = solve.algebraic.of.iter().zip(&solve.algebraic.closed).filter(|(_, closed)| **closed);
    closed.map(|(_, parameter)| *parameter).chain(given.map(|(parameter, _)| *parameter))
}

/// For each variable of the context: whether it follows such a formula in some kind that matches.
fn context_by_formula(rule: &Rule, formulas: &[Vec<bool>]) -> Vec<bool> {
    let mut all: Vec<bool> = (rule.left.iter().chain(&rule.right))
        .flat_map(|pattern| (0..pattern.width).map(|p| pattern.kinds.iter().any(|k| formulas[k.index()][p])))
        .collect();
    all.resize(rule.variables - 2 - rule.parameters.len(), false);
    all
}
