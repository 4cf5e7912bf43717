//! Detection of rates that may have pulses: large values over a time that a step may miss.
//!
//! A step resolves the parameters that it integrates and polynomials of them, but not time or parameters that follow
//! formulas, which may vary arbitrarily between two stages. So a rate may have pulses if it is not a polynomial in the
//! variables that change, or reads a parameter that follows a formula. Exponential growth or decay is fast only at its
//! beginning, where a step begins as well; a rate that is linear in it has no pulse.

use dlsys_expr::{Graph, NodeId};
use dlsys_model::{Kinds, Pattern, SolutionForm};

use super::RuleAnalysis;
use super::variability::Moving;
use crate::declared::{DeclaredSolve, ResolvedRule};

/// The variation of a parameter between the stages of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Pace {
    /// It is constant, integrated, or a polynomial of time.
    #[default]
    Resolved,
    /// It grows or decays exponentially.
    Exponential,
    /// It follows any other formula.
    Any,
}

/// The parameters of a clause that follow formulas other than polynomials, with their variation.
type Paces = Vec<(usize, Pace)>;

/// By rule and clause: true if a rate may have pulses.
pub fn find(
    graph: &mut Graph,
    kinds: &Kinds,
    rules: &[ResolvedRule],
    found: &[RuleAnalysis],
    moving: &Moving,
) -> Vec<Vec<bool>> {
    let clauses: Vec<Vec<Paces>> = (rules.iter().zip(found))
        .map(|(rule, found)| {
            let solves = rule.declared.solves.iter().zip(&found.clauses);
            solves.map(|(solve, clause)| paces(graph, solve, &clause.solution_forms)).collect()
        })
        .collect();
    let mut of_kinds: Vec<Vec<Pace>> =
        kinds.iter().map(|(_, kind)| vec![Pace::default(); kind.width()]).collect();
    for (id, kind) in kinds.iter() {
        for &(parameter, pace) in kind.rules.iter().flat_map(|rule| clauses[*rule].iter().flatten()) {
            let known = &mut of_kinds[id.index()][parameter];
            *known = pace.max(*known);
        }
    }
    let mut pulses = Vec::with_capacity(rules.len());
    for (index, (rule, found)) in rules.iter().zip(found).enumerate() {
        let surroundings = Surroundings {
            rule,
            moving: moving.context(index),
            context: context_paces(rule, &of_kinds),
            children: (rule.children.iter())
                .flat_map(|pattern| pattern.kinds.iter().flat_map(|kind| &of_kinds[kind.index()]))
                .fold(Pace::default(), |most, pace| most.max(*pace)),
        };
        let solves = rule.declared.solves.iter().zip(&found.clauses).zip(&clauses[index]);
        pulses.push(
            solves
                .map(|((solve, clause), own)| {
                    surroundings.has_pulses(graph, solve, &clause.solution_forms, own)
                })
                .collect(),
        );
    }
    pulses
}

/// A rule with the variation of its context and children.
struct Surroundings<'r> {
    rule: &'r ResolvedRule,
    /// By variable of the context: true if it changes.
    moving: &'r [bool],
    /// The variation of the context.
    context: Vec<Pace>,
    /// The variation of the parameters of children in aggregates.
    children: Pace,
}

impl Surroundings<'_> {
    /// True if a rate of the clause may have pulses. `paces` gives the variation of the module's own parameters.
    fn has_pulses(
        &self,
        graph: &mut Graph,
        solve: &DeclaredSolve,
        solution_forms: &[SolutionForm],
        paces: &Paces,
    ) -> bool {
        let declared = &self.rule.declared;
        let (own, time) = (declared.own(), declared.time());
        let mut nodes: Vec<NodeId> = solve.rates.iter().map(|rate| rate.1).collect();
        nodes.extend(solve.algebraic.iter().filter(|entry| entry.explicit).map(|entry| entry.node));
        // Terms of aggregates count as parts of the rates that read the aggregates.
        let read = graph.variables(&nodes);
        let summed = declared.terms().enumerate();
        nodes.extend(
            summed
                .filter(|(i, _)| read.contains(&((declared.first_aggregate + i) as u32)))
                .map(|(_, term)| term),
        );
        let moved = |v: usize| match v {
            v if v < own => solve.moves(v),
            v if v < time => self.moving[v - own],
            // The parameters of children follow all other variables.
            v => v <= time + 1 || v >= declared.variables,
        };
        let pace = |v: usize| match v {
            v if v < own => paces.iter().find(|(p, _)| *p == v).map_or(Pace::default(), |p| p.1),
            v if v < time => self.context[v - own],
            v if v >= declared.variables => self.children,
            _ => Pace::default(),
        };
        // A rate with a formula is integrated only if all equations are.
        let rates = solve.rates.iter().zip(solution_forms);
        let closed: Vec<NodeId> =
            rates.filter(|(_, form)| form.is_closed()).map(|((_, node), _)| *node).collect();
        nodes.iter().any(|&node| {
            let Some(all) = graph.polynomial(node, |v| moved(v as usize)) else { return true };
            let exponential = |powers: &[(u32, u32)]| {
                let of = powers.iter().filter(|(v, _)| pace(*v as usize) == Pace::Exponential);
                of.map(|(_, power)| power).sum::<u32>()
            };
            let any = || graph.variables(&[node]).into_iter().any(|v| pace(v as usize) == Pace::Any);
            !closed.contains(&node) && (any() || all.terms.keys().any(|powers| exponential(powers) > 1))
        })
    }
}

fn paces(graph: &mut Graph, solve: &DeclaredSolve, solution_forms: &[SolutionForm]) -> Paces {
    let mut all = Vec::new();
    for ((parameter, rate), form) in solve.rates.iter().zip(solution_forms) {
        let pace = match form {
            SolutionForm::Numeric(_) | SolutionForm::Polynomial(_) => continue,
            SolutionForm::Quadratic(_) => {
                let by_self = graph.polynomial(*rate, |v| v as usize == *parameter);
                if by_self.is_some_and(|p| p.degree() <= 1) { Pace::Exponential } else { Pace::Any }
            }
            _ => Pace::Any,
        };
        all.push((*parameter, pace));
    }
    all.extend(solve.algebraic.iter().map(|entry| (entry.parameter, Pace::Any)));
    all
}

/// The variation of the variables of the context, over all kinds that match.
fn context_paces(rule: &ResolvedRule, kinds: &[Vec<Pace>]) -> Vec<Pace> {
    let of = |pattern: &Pattern, p: usize| pattern.kinds.iter().map(|kind| kinds[kind.index()][p]).max();
    let mut all: Vec<Pace> = (rule.context())
        .flat_map(|pattern| (0..pattern.width).map(move |p| of(pattern, p).unwrap_or_default()))
        .collect();
    all.resize(rule.declared.time() - rule.declared.own(), Pace::default());
    all
}
