//! Which rates may be large for a time too short for a step to see.
//!
//! A step resolves what it integrates, and polynomials of that. It does not resolve time, nor what follows a formula: that
//! may do anything between two stages. So a rate may have flashes if it is no polynomial in what moves, or reads something
//! that follows a formula. What grows or decays exponentially is fast at its beginning only, where a step begins, too; one that
//! enters a rate linearly makes no flash.

use super::Draft;
use dlsys_expr::{Graph, NodeId};
use dlsys_model::{Law, Model, Pattern, Rule};

/// How a parameter may move between the stages of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Pace {
    /// It rests, is integrated, or is a polynomial of time.
    #[default]
    Resolved,
    /// It grows or decays exponentially.
    Exponential,
    /// It follows any other formula.
    Any,
}

/// Sets [`Solve::flashes`](super::Solve::flashes) in all rules. `moving` tells, by rule, which variables of the context move.
pub fn find_flashes(graph: &mut Graph, model: &mut Model, drafts: &[Draft], moving: &[Vec<bool>]) {
    let clauses: Vec<Vec<Vec<(usize, Pace)>>> =
        model.rules.iter().zip(drafts).map(|(rule, draft)| paces(graph, rule, draft)).collect();
    let mut kinds: Vec<Vec<Pace>> =
        model.kinds.iter().map(|(_, kind)| vec![Pace::default(); kind.width()]).collect();
    for (id, kind) in model.kinds.iter() {
        for &(parameter, pace) in kind.rules.iter().flat_map(|rule| clauses[*rule].iter().flatten()) {
            let known = &mut kinds[id.index()][parameter];
            *known = pace.max(*known);
        }
    }
    for (((rule, draft), moving), clauses) in model.rules.iter_mut().zip(drafts).zip(moving).zip(&clauses) {
        let context = context_paces(rule, &kinds);
        let of_children: Pace = (rule.aggregates.iter())
            .flat_map(|aggregate| aggregate.pattern.kinds.iter().flat_map(|kind| &kinds[kind.index()]))
            .fold(Pace::default(), |most, pace| most.max(*pace));
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
            let moved = |v: usize| match v {
                v if v < own => solve.of.contains(&v) || solve.algebraic.of.contains(&v),
                v if v < time => moving[v - own],
                // Those of children come after all others.
                v => v <= time + 1 || v >= rule.variables,
            };
            let pace = |v: usize| match v {
                v if v < own => {
                    clauses[number].iter().find(|(p, _)| *p == v).map_or(Pace::default(), |p| p.1)
                }
                v if v < time => context[v - own],
                v if v >= rule.variables => of_children,
                _ => Pace::default(),
            };
            // What has a formula itself is integrated only where everything is.
            let rates = draft.rates[number].iter().zip(&solve.laws);
            let closed: Vec<NodeId> =
                rates.filter(|(_, law)| law.is_closed()).map(|((_, node), _)| *node).collect();
            solve.flashes = nodes.iter().any(|&node| {
                let Some(all) = graph.polynomial(node, |v| moved(v as usize)) else { return true };
                let exponential = |powers: &[(u32, u32)]| {
                    let of = powers.iter().filter(|(v, _)| pace(*v as usize) == Pace::Exponential);
                    of.map(|(_, power)| power).sum::<u32>()
                };
                let any = || graph.variables(&[node]).into_iter().any(|v| pace(v as usize) == Pace::Any);
                !closed.contains(&node) && (any() || all.terms.keys().any(|powers| exponential(powers) > 1))
            });
        }
    }
}

/// The parameters of each clause that follow formulas which are no polynomials, and how.
fn paces(graph: &mut Graph, rule: &Rule, draft: &Draft) -> Vec<Vec<(usize, Pace)>> {
    let clauses = rule.solves.iter().zip(&draft.rates);
    clauses
        .map(|(solve, rates)| {
            let mut all = Vec::new();
            for ((parameter, rate), law) in rates.iter().zip(&solve.laws) {
                let pace = match law {
                    Law::Numeric(_) | Law::Polynomial(_) => continue,
                    Law::Quadratic(_) => {
                        let by_self = graph.polynomial(*rate, |v| v as usize == *parameter);
                        if by_self.is_some_and(|p| p.degree() <= 1) { Pace::Exponential } else { Pace::Any }
                    }
                    _ => Pace::Any,
                };
                all.push((*parameter, pace));
            }
            all.extend(solve.algebraic.of.iter().map(|parameter| (*parameter, Pace::Any)));
            all
        })
        .collect()
}

/// The same of the variables of the context: in any kind that matches.
fn context_paces(rule: &Rule, kinds: &[Vec<Pace>]) -> Vec<Pace> {
    let of = |pattern: &Pattern, p: usize| pattern.kinds.iter().map(|kind| kinds[kind.index()][p]).max();
    let mut all: Vec<Pace> = (rule.left.iter().chain(&rule.right))
        .flat_map(|pattern| (0..pattern.width).map(move |p| of(pattern, p).unwrap_or_default()))
        .collect();
    all.resize(rule.variables - 2 - rule.parameters.len(), Pace::default());
    all
}
