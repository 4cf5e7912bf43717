//! The analysis of a model: the solution of each equation and the location of each zero (see
//! [`SolutionForm`](dlsys_model::SolutionForm) and [`ZeroCrossing`]).
//!
//! It works on the expression graph. Whether a rate is affine, quadratic or polynomial is a property of its coefficients
//! and does not depend on the notation. Parameters of a module without an equation in the active clause are constant, and
//! so are parameters of neighbours for which no rule has an equation.
//!
//! [`analyse`] takes all rules at once, because the results depend on the rules of neighbours, and returns compiled rules.
//!
//! - `variability`: the variables that are constant while a clause is active;
//! - `solution_forms`: the solution of each equation; `driven`: equations with a known integral;
//! - `crossings`: zero-crossing functions; `invariance`: differences that never become zero;
//! - `need`: parameters that nothing reads; `pulses`: rates with pulses that a step may miss;
//! - `stepping`: the variables of a step; `form`, `rank`: numbers with bounds of their errors, singular equations.

mod clause;
mod crossings;
mod driven;
mod form;
mod invariance;
mod need;
mod pulses;
mod rank;
mod solution_forms;
mod stepping;
mod variability;
mod zeros;

use std::sync::Arc;

use rustc_hash::FxHashMap;

use dlsys_expr::{Graph, NodeId, Program};
use dlsys_model::{Aggregate, Equations, Jacobian, Kinds, Pulses, Rule, Solve, ZeroCrossing};

use crate::declared::ResolvedRule;
use crate::gather::watched;
use clause::analyse_clause;
use crossings::crossing;
use stepping::VariableLayout;
use variability::{Constants, Moving};

pub use driven::{driven_form, outside_of_drivers};
pub use invariance::never_reached;
pub use rank::is_singular;

/// The compiled rules of a model and the results about its kinds.
pub struct Analysed {
    pub rules: Vec<Rule>,
    /// By kind and parameter: true if only drawings and output read it.
    pub drawn_only: Vec<Vec<bool>>,
}

/// Classifies all equations and conditions, and compiles the rules.
pub fn analyse(graph: &mut Graph, kinds: &Kinds, rules: Vec<ResolvedRule>) -> Analysed {
    let moving = Moving::new(graph, kinds, &rules);
    let aggregates: Vec<Vec<Aggregate>> =
        rules.iter().enumerate().map(|(i, rule)| aggregates(graph, &moving, i, rule)).collect();
    let needed = need::needed(graph, kinds, &rules);
    let mut kinds_of: Vec<Vec<usize>> = vec![Vec::new(); rules.len()];
    for (id, kind) in kinds.iter() {
        kind.rules.iter().for_each(|rule| kinds_of[*rule].push(id.index()));
    }
    let mut found: Vec<RuleAnalysis> = Vec::with_capacity(rules.len());
    let mut alike: Vec<Option<usize>> = Vec::with_capacity(rules.len());
    let mut known: FxHashMap<Shape, usize> = FxHashMap::default();
    for (i, rule) in rules.iter().enumerate() {
        let shape = Shape::of(rule, moving.context(i));
        let like = shape.as_ref().and_then(|shape| known.get(shape).copied());
        let analysis = match like {
            Some(like) => found[like].clone(),
            None => {
                let is_needed = |p: usize| kinds_of[i].iter().any(|kind| needed.contains(&(*kind, p)));
                analyse_rule(graph, rule, moving.context(i), &is_needed)
            }
        };
        found.push(analysis);
        alike.push(like);
        if let Some(shape) = shape {
            known.entry(shape).or_insert(i);
        }
    }
    let pulses = pulses::find(graph, kinds, &rules, (&found, &alike), &moving);
    let drawn_only = need::drawn_only(graph, kinds, &rules);
    let parts = rules.into_iter().zip(found).zip(aggregates).zip(pulses).enumerate();
    let rules = parts
        .map(|(i, (((rule, found), aggregates), pulses))| {
            let first = rule.declared.own();
            let context = moving.context(i).iter().enumerate();
            let moving = context.filter(|(_, moves)| **moves).map(|(v, _)| first + v).collect();
            compile_rule(graph, rule, found, aggregates, moving, pulses)
        })
        .collect();
    Analysed { rules, drawn_only }
}

/// All that the analysis of a rule depends on: rules that differ in names only have the same expressions, and are analysed once.
#[derive(PartialEq, Eq, Hash)]
struct Shape {
    layout: VariableLayout,
    sides: Vec<(NodeId, NodeId)>,
    /// By clause: parameters with their rates, and the number of switches.
    clauses: Vec<(Vec<(usize, NodeId)>, usize)>,
    /// The parameters that are clocks.
    clocks: Vec<usize>,
    moving: Vec<bool>,
}

impl Shape {
    /// None if it depends on more: which values and implicit equations are needed, and where they stand in the text.
    fn of(rule: &ResolvedRule, moving: &[bool]) -> Option<Shape> {
        let declared = &rule.declared;
        if declared.algebraic().next().is_some() {
            return None;
        }
        let clauses = declared.solves.iter().map(|solve| (solve.rates.clone(), solve.switches.len()));
        Some(Shape {
            layout: VariableLayout::of(rule),
            sides: declared.sides.clone(),
            clauses: clauses.collect(),
            clocks: declared.clocks.iter().map(|clock| clock.parameter).collect(),
            moving: moving.to_vec(),
        })
    }
}

/// The results of the analysis of one rule.
#[derive(Clone)]
pub struct RuleAnalysis {
    zero_crossings_at_rest: Vec<ZeroCrossing>,
    reads_context: bool,
    clauses: Vec<Arc<Equations>>,
}

fn analyse_rule(
    graph: &mut Graph,
    rule: &ResolvedRule,
    moving: &[bool],
    is_needed: &dyn Fn(usize) -> bool,
) -> RuleAnalysis {
    let declared = &rule.declared;
    let still = Constants::at_rest(declared, moving);
    let zero_crossings_at_rest: Vec<ZeroCrossing> = (declared.sides.iter())
        .map(|&sides| crossing(graph, sides, &still, &|_| true, declared.variables))
        .collect();
    let mut reads_context = declared.sides.iter().any(|(a, b)| still.reads_context(graph, &[*a, *b]));
    let layout = VariableLayout::of(rule);
    let mut clauses = Vec::with_capacity(declared.solves.len());
    for solve in &declared.solves {
        let constants = still.under(solve);
        let nodes: Vec<NodeId> = solve.rates.iter().map(|rate| rate.1).collect();
        reads_context |= constants.reads_context(graph, &nodes);
        let given: Vec<NodeId> = solve.algebraic.iter().map(|entry| entry.node).collect();
        reads_context |= constants.reads_context(graph, &given);
        clauses.push(Arc::new(analyse_clause(graph, rule, solve, &constants, is_needed, &layout)));
    }
    RuleAnalysis { zero_crossings_at_rest, reads_context, clauses }
}

/// Compiles the aggregates of a rule, with the derivatives of their terms with respect to the variables that change.
fn aggregates(graph: &mut Graph, moving: &Moving, index: usize, rule: &ResolvedRule) -> Vec<Aggregate> {
    let declared = &rule.declared;
    let (own, count, first) = (declared.own(), declared.variables, declared.first_aggregate);
    let context = moving.context(index);
    let mut all = Vec::with_capacity(declared.aggregates.len());
    for (i, (aggregate, pattern)) in declared.aggregates.iter().zip(&rule.children).enumerate() {
        let changes = |v: usize| match v {
            v if v >= count => moving.in_pattern(pattern, v - count),
            v if v < own => declared.moves(v),
            v if v < first => context[v - own],
            _ => false,
        };
        let total = count + pattern.width;
        let (mut entries, mut roots) = (Vec::new(), Vec::new());
        for v in graph.variables(&[aggregate.term]) {
            if changes(v as usize) {
                entries.push((0, v as usize));
                roots.push(graph.derivative(aggregate.term, v));
            }
        }
        let head = &aggregate.pattern.head;
        all.push(Aggregate {
            fold: aggregate.fold,
            pattern: pattern.clone(),
            term: Program::compile(graph, &[aggregate.term], total),
            jacobian: Jacobian { entries, values: Program::compile(graph, &roots, total) },
            moves: context[first - own + i],
            label: format!("{} over {}", aggregate.fold.name(), dlsys_syntax::print::head_module(head)),
            span: head.span,
        });
    }
    all
}

/// By atom: true if a side jumps, itself or through an aggregate, of which there are these from a variable on, and the comparison was not taken
/// apart.
fn jumping_whole(sides: &Program, (first, aggregates): (usize, &[Aggregate]), jumping: &[bool]) -> Vec<bool> {
    let gathered: Vec<usize> = (first..)
        .zip(aggregates)
        .filter(|(_, aggregate)| aggregate.term.output_jumps(0))
        .map(|(variable, _)| variable)
        .collect();
    let reads = |side: usize| sides.output_reads(side).iter().any(|variable| gathered.contains(variable));
    let side_jumps = |side: usize| sides.output_jumps(side) || !gathered.is_empty() && reads(side);
    let jumps = |atom: usize| side_jumps(2 * atom) || side_jumps(2 * atom + 1);
    jumping.iter().enumerate().map(|(atom, apart)| !apart && jumps(atom)).collect()
}

/// The variables that the sides of an atom read, ascending.
fn atom_reads(sides: &Program, atom: usize) -> Vec<usize> {
    let mut reads = [2 * atom, 2 * atom + 1].map(|side| sides.output_reads(side)).concat();
    reads.sort_unstable();
    reads.dedup();
    reads
}

/// Combines the declared rule with the results of its analysis. `moving` contains the variables of the context that change.
fn compile_rule(
    graph: &mut Graph,
    rule: ResolvedRule,
    found: RuleAnalysis,
    aggregates: Vec<Aggregate>,
    moving: Vec<usize>,
    pulses: Vec<Pulses>,
) -> Rule {
    let ResolvedRule { declared, left, right, .. } = rule;
    let count = declared.variables;
    let sides: Vec<NodeId> = declared.side_nodes().collect();
    let sides = graph.program(&sides, count);
    let solves = declared.solves.into_iter().zip(found.clauses).zip(pulses);
    let solves = solves.map(|((solve, equations), pulses)| Solve {
        guard: solve.guard,
        span: solve.span,
        switches: solve.switches,
        unreachable: solve.unreachable,
        pulses,
        equations,
    });
    Rule {
        index: declared.index,
        label: declared.label,
        span: declared.span,
        discrete: declared.discrete,
        parameters: declared.parameters,
        context_names: declared.context_names,
        left,
        right,
        right_shape: declared.right_shape,
        atom_reads: (0..declared.atoms.len()).map(|atom| atom_reads(&sides, atom)).collect(),
        jumping_whole: jumping_whole(&sides, (declared.first_aggregate, &aggregates), &declared.jumping),
        watched: watched(&sides, &aggregates, count, declared.first_aggregate),
        aggregates,
        first_aggregate: declared.first_aggregate,
        variables: count,
        sides,
        atoms: declared.atoms,
        boundaries: declared.boundaries,
        jumping: declared.jumping,
        solves: solves.collect(),
        produces: declared.produces,
        hidden: declared.hidden,
        clocks: declared.clocks,
        moving_context: moving,
        reads_context: found.reads_context,
        zero_crossings_at_rest: found.zero_crossings_at_rest,
    }
}
