//! Which rates may have pulses: be large for a time too short for a step to notice.
//!
//! A step resolves what it integrates, and polynomials of that. It does not resolve time, nor what follows a formula: that
//! may do anything between two stages. So a rate may have pulses if it is no polynomial in what moves, or reads something
//! that follows a formula. What grows or decays exponentially is fast at its beginning only, where a step begins, too; one that
//! enters a rate linearly makes no pulse.

use dlsys_expr::{Graph, NodeId};
use dlsys_model::{Kinds, Pattern, SolutionForm};

use super::RuleAnalysis;
use super::variability::Moving;
use crate::declared::{DeclaredSolve, ResolvedRule};

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

/// The parameters of a clause that follow formulas which are no polynomials, and how.
type Paces = Vec<(usize, Pace)>;

/// For each rule and each of its clauses: whether a rate may have pulses.
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

/// A rule, and how what stands around its modules moves.
struct Surroundings<'r> {
    rule: &'r ResolvedRule,
    /// Which variables of the context move.
    moving: &'r [bool],
    /// How they move.
    context: Vec<Pace>,
    /// How the parameters of children move that are added up.
    children: Pace,
}

impl Surroundings<'_> {
    /// Whether a rate of the clause may have pulses. `paces` are those of the module's own parameters.
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
        // Terms of aggregates count as the rates that they are added up in.
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
            // Those of children come after all others.
            v => v <= time + 1 || v >= declared.variables,
        };
        let pace = |v: usize| match v {
            v if v < own => paces.iter().find(|(p, _)| *p == v).map_or(Pace::default(), |p| p.1),
            v if v < time => self.context[v - own],
            v if v >= declared.variables => self.children,
            _ => Pace::default(),
        };
        // What has a formula itself is integrated only where everything is.
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

/// How the variables of the context move, in any kind that matches.
fn context_paces(rule: &ResolvedRule, kinds: &[Vec<Pace>]) -> Vec<Pace> {
    let of = |pattern: &Pattern, p: usize| pattern.kinds.iter().map(|kind| kinds[kind.index()][p]).max();
    let mut all: Vec<Pace> = (rule.context())
        .flat_map(|pattern| (0..pattern.width).map(move |p| of(pattern, p).unwrap_or_default()))
        .collect();
    all.resize(rule.declared.time() - rule.declared.own(), Pace::default());
    all
}
