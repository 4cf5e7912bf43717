//! Detection of rates that may have pulses: large values over a time that a step may miss.
//!
//! A step resolves the parameters that it integrates and polynomials of them, but not time or parameters that follow
//! formulas, which may vary arbitrarily between two stages. So a rate may have pulses if it is not a polynomial in the
//! variables that change, or reads a parameter that follows a formula. Exponential growth or decay is fast only at its
//! beginning, where a step begins as well; a rate that is linear in it has no pulse.
//!
//! What is found are the terms of sums, not whole rates: in stiff equations large terms cancel each other, and bounds of their sum over a range of states tell
//! nothing. Those of one term do, and those of the sum of all that may have pulses in a rate, because two steps that come and go are short together only.

use dlsys_expr::{Binary, Graph, Node, NodeId, Program, Unary};
use dlsys_model::{Kinds, Pattern, PulseTerms, Pulses, SolutionForm};

use super::RuleAnalysis;
use super::variability::Moving;
use crate::comparisons::{Moves, has_steps};
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

/// By rule and clause: the terms that may have pulses. `alike` has, by rule, one before with the same expressions, if there is one.
pub fn find(
    graph: &mut Graph,
    kinds: &Kinds,
    rules: &[ResolvedRule],
    (found, alike): (&[RuleAnalysis], &[Option<usize>]),
    moving: &Moving,
) -> Vec<Vec<Pulses>> {
    let mut clauses: Vec<Vec<Paces>> = Vec::with_capacity(rules.len());
    for ((rule, found), like) in rules.iter().zip(found).zip(alike) {
        let solves = rule.declared.solves.iter().zip(&found.clauses);
        clauses.push(match like {
            Some(like) => clauses[*like].clone(),
            None => solves.map(|(solve, clause)| paces(graph, solve, &clause.solution_forms)).collect(),
        });
    }
    let mut of_kinds: Vec<Vec<Pace>> =
        kinds.iter().map(|(_, kind)| vec![Pace::default(); kind.width()]).collect();
    for (id, kind) in kinds.iter() {
        for &(parameter, pace) in kind.rules.iter().flat_map(|rule| clauses[*rule].iter().flatten()) {
            let known = &mut of_kinds[id.index()][parameter];
            *known = pace.max(*known);
        }
    }
    let mut pulses: Vec<Vec<Pulses>> = Vec::with_capacity(rules.len());
    let mut contexts: Vec<Vec<Pace>> = Vec::with_capacity(rules.len());
    for (index, (rule, found)) in rules.iter().zip(found).enumerate() {
        contexts.push(context_paces(rule, &of_kinds));
        // Without aggregates nothing else matters.
        let is_alone = |index: usize| rules[index].children.is_empty();
        let is_same = |like: &usize| is_alone(index) && is_alone(*like) && contexts[*like] == contexts[index];
        if let Some(like) = alike[index].filter(is_same) {
            pulses.push(pulses[like].clone());
            continue;
        }
        let surroundings = Surroundings {
            rule,
            moving: moving.context(index),
            context: &contexts[index],
            children: (rule.children.iter())
                .flat_map(|pattern| pattern.kinds.iter().flat_map(|kind| &of_kinds[kind.index()]))
                .fold(Pace::default(), |most, pace| most.max(*pace)),
        };
        let solves = rule.declared.solves.iter().zip(&found.clauses).zip(&clauses[index]);
        pulses.push(
            solves
                .map(|((solve, clause), own)| surroundings.pulses(graph, solve, &clause.solution_forms, own))
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
    context: &'r [Pace],
    /// The variation of the parameters of children in aggregates.
    children: Pace,
}

impl Surroundings<'_> {
    /// The terms of a clause that may have pulses. `paces` gives the variation of the module's own parameters.
    fn pulses(
        &self,
        graph: &mut Graph,
        solve: &DeclaredSolve,
        solution_forms: &[SolutionForm],
        paces: &Paces,
    ) -> Pulses {
        let declared = &self.rule.declared;
        let clause = Clause { around: self, solve, paces };
        // An aggregate may have pulses where its term may.
        let hazy: Vec<u32> = (declared.terms().enumerate())
            .filter(|(_, term)| clause.varies(graph, *term, true))
            .map(|(i, _)| (declared.first_aggregate + i) as u32)
            .collect();
        let moves = Moves { steady: &[], jumping: &[] };
        let jumping: Vec<u32> = (declared.first_aggregate as u32..)
            .zip(declared.terms())
            .filter(|(_, term)| has_steps(graph, &[*term], &moves))
            .map(|(variable, _)| variable)
            .collect();
        let total = declared.variables + solve.switches.len();
        let finder = Finder { clause: &clause, hazy: &hazy, jumping: &jumping, total };
        let rates = |closed: bool| -> Vec<(usize, NodeId)> {
            let forms = solve.rates.iter().zip(solution_forms);
            forms.filter(|(_, form)| form.is_closed() == closed).map(|(rate, _)| *rate).collect()
        };
        Pulses {
            rates: finder.terms(graph, &rates(false), &[], true),
            formula_rates: finder.terms(graph, &rates(true), &[], false),
            values: finder.values(graph),
        }
    }
}

/// Finds the terms of expressions of a clause that may have pulses.
struct Finder<'c> {
    clause: &'c Clause<'c>,
    /// The variables of aggregates that may have pulses.
    hazy: &'c [u32],
    /// The variables of aggregates of what jumps.
    jumping: &'c [u32],
    /// The number of variables that the expressions read.
    total: usize,
}

impl Finder<'_> {
    /// The terms of some expressions, with the parameters whose rates or values they are, and of some equations, with the estimate of what each tells of its
    /// unknown. `by_pace`: what a step does not resolve counts.
    fn terms(
        &self,
        graph: &mut Graph,
        expressions: &[(usize, NodeId)],
        equations: &[(usize, NodeId, NodeId)],
        by_pace: bool,
    ) -> PulseTerms {
        let (mut outer, mut inner) = (Vec::new(), Vec::new());
        for (position, (_, node)) in expressions.iter().enumerate() {
            let found = summands(graph, *node, &|v| self.clause.moves(v as usize));
            let found: Vec<(NodeId, bool)> =
                found.into_iter().filter(|(term, _)| self.has(graph, *term, by_pace)).collect();
            // Two of them may come and go between two stages that each alone differs between: `tanh(50*(t - 3)) - tanh(50*(t - 3.1))`.
            if found.len() > 1 {
                let zero = graph.constant(0.0);
                let sum = found.iter().fold(zero, |sum, &(term, minus)| {
                    graph.binary(if minus { Binary::Sub } else { Binary::Add }, sum, term)
                });
                outer.push((position, sum));
            }
            outer.extend(found.into_iter().map(|(term, _)| (position, term)));
        }
        let roots: Vec<NodeId> =
            expressions.iter().map(|e| e.1).chain(equations.iter().map(|e| e.1)).collect();
        for term in self.inner_summands(graph, &roots) {
            if outer.iter().all(|(_, known)| *known != term) && self.has(graph, term, by_pace) {
                inner.push(term);
            }
        }
        if outer.is_empty() && inner.is_empty() {
            return PulseTerms::default();
        }
        let changes: Vec<NodeId> =
            expressions.iter().map(|e| e.1).chain(equations.iter().map(|e| e.2)).collect();
        let mut disturbed = graph.rewrite(&changes, |graph, id, node| {
            let number = inner.iter().position(|term| *term == id)?;
            let (term, more) = (graph.add(id, node), graph.var((self.total + outer.len() + number) as u32));
            Some(graph.binary(Binary::Add, term, more))
        });
        for (number, (position, _)) in outer.iter().enumerate() {
            let more = graph.var((self.total + number) as u32);
            disturbed[*position] = graph.binary(Binary::Add, disturbed[*position], more);
        }
        let all: Vec<NodeId> = outer.iter().map(|(_, term)| *term).chain(inner).collect();
        let owners = expressions.iter().map(|e| e.0).chain(equations.iter().map(|e| e.0));
        let terms = Program::compile(graph, &all, self.total);
        PulseTerms {
            reads: (0..all.len()).map(|term| terms.output_reads(term)).collect(),
            terms,
            outer: outer.len(),
            jumping: all.iter().map(|term| self.jumps(graph, *term)).collect(),
            disturbed: Program::compile(graph, &disturbed, self.total + all.len()),
            parameters: owners.collect(),
            explicit: expressions.len(),
        }
    }

    /// The terms of the values of the clause. What is solved for tells nothing about pulses in its own equation.
    fn values(&self, graph: &mut Graph) -> PulseTerms {
        let of = |explicit: bool| {
            let entries = self.clause.solve.algebraic.iter().filter(move |entry| entry.explicit == explicit);
            entries.map(|entry| (entry.parameter, entry.node)).collect::<Vec<_>>()
        };
        let (explicit, implicit) = (of(true), of(false));
        let mut equations = Vec::with_capacity(implicit.len());
        for &(parameter, node) in &implicit {
            let mut size = graph.constant(0.0);
            for &(unknown, _) in &implicit {
                let partial = graph.derivative(node, unknown as u32);
                let partial = graph.unary(Unary::Abs, partial);
                size = graph.plus(size, partial);
            }
            equations.push((parameter, node, graph.binary(Binary::Div, node, size)));
        }
        let resting: Paces = (self.clause.paces.iter())
            .filter(|(parameter, _)| implicit.iter().all(|(unknown, _)| unknown != parameter))
            .copied()
            .collect();
        let clause = Clause { paces: &resting, ..*self.clause };
        Finder { clause: &clause, ..*self }.terms(graph, &explicit, &equations, true)
    }

    /// True if a term may have pulses.
    fn has(&self, graph: &mut Graph, term: NodeId, by_pace: bool) -> bool {
        graph.variables(&[term]).iter().any(|v| self.hazy.contains(v))
            || self.clause.varies(graph, term, by_pace)
    }

    /// True if a term jumps where the aggregates that it reads do.
    fn jumps(&self, graph: &Graph, term: NodeId) -> bool {
        !self.jumping.is_empty() && graph.variables(&[term]).iter().any(|v| self.jumping.contains(v))
    }

    /// The terms of all sums in some expressions.
    fn inner_summands(&self, graph: &mut Graph, roots: &[NodeId]) -> Vec<NodeId> {
        let mut all = Vec::new();
        for id in graph.reachable(roots) {
            if let Node::Binary(Binary::Add | Binary::Sub, a, b) = graph.node(id) {
                all.extend(
                    [a, b].map(|term| without_factor(graph, term, &|v| self.clause.moves(v as usize))),
                );
            }
        }
        all.sort_unstable();
        all.dedup();
        let is_sum = |id: &NodeId| matches!(graph.node(*id), Node::Binary(Binary::Add | Binary::Sub, ..));
        all.retain(|id| !is_sum(id));
        all
    }
}

/// A clause with the variation of all that it reads.
#[derive(Clone, Copy)]
struct Clause<'c> {
    around: &'c Surroundings<'c>,
    solve: &'c DeclaredSolve,
    /// That of the module's own parameters.
    paces: &'c Paces,
}

impl Clause<'_> {
    fn moves(&self, v: usize) -> bool {
        let declared = &self.around.rule.declared;
        let (own, time) = (declared.own(), declared.time());
        match v {
            v if v < own => self.solve.moves(v),
            v if v < time => self.around.moving[v - own],
            // The parameters of children follow all other variables.
            v => v <= time + 1 || v >= declared.variables,
        }
    }

    fn pace(&self, v: usize) -> Pace {
        let declared = &self.around.rule.declared;
        let (own, time) = (declared.own(), declared.time());
        match v {
            v if v < own => self.paces.iter().find(|(p, _)| *p == v).map_or(Pace::default(), |p| p.1),
            v if v < time => self.around.context[v - own],
            v if v >= declared.variables => self.around.children,
            _ => Pace::default(),
        }
    }

    /// True if a term may have pulses: it is no polynomial of what moves or, if `by_pace`, a polynomial of what a step does not resolve.
    fn varies(&self, graph: &mut Graph, term: NodeId, by_pace: bool) -> bool {
        let Some(all) = graph.polynomial(term, |v| self.moves(v as usize)) else { return true };
        let exponential = |powers: &[(u32, u32)]| {
            let of = powers.iter().filter(|(v, _)| self.pace(*v as usize) == Pace::Exponential);
            of.map(|(_, power)| power).sum::<u32>()
        };
        let any = || graph.variables(&[term]).into_iter().any(|v| self.pace(v as usize) == Pace::Any);
        by_pace && (any() || all.terms.keys().any(|powers| exponential(powers) > 1))
    }
}

/// A term without its sign and the factors in which nothing moves.
fn without_factor(graph: &Graph, mut node: NodeId, moves: &dyn Fn(u32) -> bool) -> NodeId {
    let rests = |node| !graph.variables(&[node]).into_iter().any(moves);
    loop {
        node = match graph.node(node) {
            Node::Unary(Unary::Neg, a) => a,
            Node::Binary(Binary::Mul, a, b) if rests(a) => b,
            Node::Binary(Binary::Mul | Binary::Div, a, b) if rests(b) => a,
            _ => return node,
        };
    }
}

/// The terms whose sum an expression is, each with the truth of: it is subtracted. Factors in which nothing moves are multiplied into them.
fn summands(graph: &mut Graph, node: NodeId, moves: &dyn Fn(u32) -> bool) -> Vec<(NodeId, bool)> {
    let rests = |graph: &Graph, node| !graph.variables(&[node]).into_iter().any(moves);
    let (mut found, mut open) = (Vec::new(), vec![(node, None, false)]);
    while let Some((node, factor, minus)) = open.pop() {
        match graph.node(node) {
            Node::Unary(Unary::Neg, a) => open.push((a, factor, !minus)),
            Node::Binary(Binary::Add, a, b) => open.extend([(a, factor, minus), (b, factor, minus)]),
            Node::Binary(Binary::Sub, a, b) => open.extend([(a, factor, minus), (b, factor, !minus)]),
            Node::Binary(Binary::Mul, a, b) if rests(graph, a) => {
                let all = factor.map_or(a, |f| graph.binary(Binary::Mul, f, a));
                open.push((b, Some(all), minus));
            }
            Node::Binary(Binary::Mul, a, b) if rests(graph, b) => {
                let all = factor.map_or(b, |f| graph.binary(Binary::Mul, f, b));
                open.push((a, Some(all), minus));
            }
            Node::Binary(Binary::Div, a, b) if rests(graph, b) => {
                let one = factor.unwrap_or_else(|| graph.constant(1.0));
                let all = graph.binary(Binary::Div, one, b);
                open.push((a, Some(all), minus));
            }
            _ => found.push((factor.map_or(node, |f| graph.binary(Binary::Mul, f, node)), minus)),
        }
    }
    found
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
