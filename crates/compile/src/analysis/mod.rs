//! Finds out how much work each equation and each condition is (see [`Law`] and [`Watch`]).
//!
//! The analysis works on the expression graph. Whether a rate is affine, quadratic or polynomial is asked of its
//! coefficients, so spelling does not matter. Everything that a module's own equation of the moment leaves alone is
//! a constant to it, and so is a neighbour's parameter for which no rule has an equation.

mod driven;
mod form;
mod invariance;
mod need;
mod pulses;
mod rank;

use std::collections::HashSet;
use std::sync::Arc;

use dlsys_diagnostic::Span;
use dlsys_expr::{Binary, Graph, Monomial, Node, NodeId, Polynomial, Program, Unary};
use dlsys_model::{
    Algebraic, Jacobian, Law, Linear, Model, Numeric, Obstacle, Pattern, Rule, Stepping, Sum, Watch,
};
use need::{drawn_only, needed};
use pulses::find_flashes;

pub use driven::{driven_form, outside_of_drivers};
pub use invariance::never_reached;
pub use rank::is_singular;

/// The expressions of a rule, before they are code.
#[derive(Clone, Debug, Default)]
pub struct Draft {
    /// Per `solve`: its parameters with their rates.
    pub rates: Vec<Vec<(usize, NodeId)>>,
    /// Per `solve`: what has a value or an equation instead of a rate, explicit parameters first.
    pub algebraic: Vec<Vec<AlgebraicDraft>>,
    /// Per atom.
    pub sides: Vec<(NodeId, NodeId)>,
    /// Of the aggregates.
    pub terms: Vec<NodeId>,
}

/// `x = f`, or `0 = g` to be solved for x.
#[derive(Clone, Debug)]
pub struct AlgebraicDraft {
    pub parameter: usize,
    /// f or g.
    pub node: NodeId,
    pub explicit: bool,
    pub span: Span,
}

/// Highest degree in `age` of a rate that is integrated as a polynomial.
const MAX_AGE_DEGREE: u32 = 3;

/// Classifies everything in the model. `drafts` stand in the order of its rules.
pub fn analyse(graph: &mut Graph, model: &mut Model, drafts: &[Draft]) {
    for (rule, draft) in model.rules.iter_mut().zip(drafts) {
        for (solve, algebraic) in rule.solves.iter_mut().zip(&draft.algebraic) {
            solve.algebraic.of = algebraic.iter().map(|entry| entry.parameter).collect();
        }
    }
    let kinds = moving_parameters(model);
    let all_terms = || drafts.iter().map(|draft| &draft.terms[..]);
    let moving: Vec<Vec<bool>> = (model.rules.iter().zip(all_terms()))
        .map(|(rule, terms)| moving_context(graph, &kinds, rule, terms))
        .collect();
    for ((rule, terms), moving) in model.rules.iter_mut().zip(all_terms()).zip(&moving) {
        gather(graph, &kinds, rule, terms, moving);
    }
    for ((rule, draft), moving) in model.rules.iter_mut().zip(drafts).zip(&moving) {
        let own = rule.parameters.len();
        let all = 0..rule.variables;
        rule.moving_context = (0..moving.len()).filter(|i| moving[*i]).map(|i| own + i).collect();
        let still = Constants { own, of: HashSet::new(), moving, time: rule.variables - 2 };
        rule.watch_at_rest =
            draft.sides.iter().map(|&s| watch(graph, s, &still, &|_| true, all.len())).collect();
        let mut reads_context = draft.sides.iter().any(|(a, b)| still.reads_context(graph, &[*a, *b]));
        for ((solve, rates), algebraic) in rule.solves.iter_mut().zip(&draft.rates).zip(&draft.algebraic) {
            let total = rule.variables + solve.switches.len();
            let moved = rates.iter().map(|r| r.0).chain(algebraic.iter().map(|entry| entry.parameter));
            let constants = Constants { of: moved.collect(), ..still.clone() };
            let laws = laws(graph, rates, &constants, total);
            let monotone = |variable: usize| {
                let position = rates.iter().position(|(p, _)| *p == variable);
                let given = algebraic.iter().any(|entry| entry.parameter == variable);
                !given
                    && position.is_none_or(|i| match &laws[i] {
                        Law::Polynomial(coefficients) => coefficients.outputs() == 1,
                        Law::Quadratic(_) => true,
                        Law::Driven(driven) => driven.monotone,
                        _ => false,
                    })
            };
            solve.watch =
                draft.sides.iter().map(|&s| watch(graph, s, &constants, &monotone, all.len())).collect();
            let nodes: Vec<NodeId> = rates.iter().map(|r| r.1).collect();
            reads_context |= constants.reads_context(graph, &nodes);
            let given: Vec<NodeId> = algebraic.iter().map(|entry| entry.node).collect();
            reads_context |= constants.reads_context(graph, &given);
            solve.algebraic = self::algebraic(graph, algebraic, rates, &laws, &constants, total);
            solve.jacobian = jacobian(graph, rates, &constants, total);
            let numeric: Vec<usize> = (0..rates.len()).filter(|i| !laws[*i].is_closed()).collect();
            let roots: Vec<NodeId> = numeric.iter().map(|i| rates[*i].1).collect();
            solve.numeric_rates = Program::compile(graph, &roots, total);
            solve.linear = linear(graph, &roots, &constants, total);
            let clocked =
                rates.iter().any(|(parameter, _)| rule.clocks.iter().any(|c| c.parameter == *parameter));
            solve.is_delicate = clocked && laws.iter().any(|law| !law.is_closed());
            solve.laws = laws;
            solve.numeric = numeric;
        }
        rule.reads_context = reads_context;
    }
    find_flashes(graph, model, drafts, &moving);
    let needed = needed(graph, model, drafts);
    for rule in 0..model.rules.len() {
        let kinds: Vec<usize> =
            model.kinds.iter().filter(|(_, k)| k.rules.contains(&rule)).map(|(id, _)| id.index()).collect();
        for algebraic in model.rules[rule].solves.iter_mut().map(|s| &mut s.algebraic) {
            let is_needed = |p: &usize| kinds.iter().any(|kind| needed.contains(&(*kind, *p)));
            algebraic.needed = algebraic.of.iter().map(is_needed).collect();
        }
        for solve in 0..model.rules[rule].solves.len() {
            let of = &model.rules[rule];
            let stepping = Stepping::new(of, &of.solves[solve]);
            model.rules[rule].solves[solve].stepping = stepping;
        }
    }
    model.drawn_only = drawn_only(graph, model, drafts);
}

/// Per kind and parameter: whether some rule has an equation for it.
fn moving_parameters(model: &Model) -> Vec<Vec<bool>> {
    let mut all: Vec<Vec<bool>> = model.kinds.iter().map(|(_, kind)| vec![false; kind.width()]).collect();
    for (id, kind) in model.kinds.iter() {
        for solve in kind.rules.iter().flat_map(|r| &model.rules[*r].solves) {
            for &parameter in solve.of.iter().chain(&solve.algebraic.of) {
                all[id.index()][parameter] = true;
            }
        }
    }
    all
}

/// For each parameter of the context: whether it moves in any kind that matches; then the same for each aggregate.
fn moving_context(graph: &Graph, kinds: &[Vec<bool>], rule: &Rule, terms: &[NodeId]) -> Vec<bool> {
    let mut all: Vec<bool> = (rule.left.iter().chain(&rule.right))
        .flat_map(|pattern| (0..pattern.width).map(|p| moves(kinds, pattern, p)))
        .collect();
    let context = rule.parameters.len() + all.len();
    let moving: Vec<bool> = (rule.aggregates.iter().zip(terms))
        .map(|(aggregate, term)| {
            graph.variables(&[*term]).into_iter().any(|v| match v as usize {
                v if v >= rule.variables => moves(kinds, &aggregate.pattern, v - rule.variables),
                v if v < rule.parameters.len() => is_own(rule, v),
                v if v < context => all[v - rule.parameters.len()],
                _ => true,
            })
        })
        .collect();
    all.extend(moving);
    all.resize(rule.variables - 2 - rule.parameters.len(), false);
    all
}

fn moves(kinds: &[Vec<bool>], pattern: &Pattern, parameter: usize) -> bool {
    pattern.kinds.iter().any(|kind| kinds[kind.index()][parameter])
}

/// True if the rule has an equation for a parameter of its own.
fn is_own(rule: &Rule, parameter: usize) -> bool {
    rule.solves.iter().any(|s| s.of.contains(&parameter) || s.algebraic.of.contains(&parameter))
}

/// Finds out what changes in the aggregates of a rule.
fn gather(graph: &mut Graph, kinds: &[Vec<bool>], rule: &mut Rule, terms: &[NodeId], moving: &[bool]) {
    let (own, count, first) = (rule.parameters.len(), rule.variables, rule.first_aggregate);
    for i in 0..rule.aggregates.len() {
        let pattern = &rule.aggregates[i].pattern;
        let changes = |v: usize| match v {
            v if v >= count => moves(kinds, pattern, v - count),
            v if v < own => is_own(rule, v),
            v if v < first => moving[v - own],
            _ => false,
        };
        let total = count + pattern.width;
        let (mut entries, mut roots) = (Vec::new(), Vec::new());
        for v in graph.variables(&[terms[i]]) {
            if changes(v as usize) {
                entries.push((0, v as usize));
                roots.push(graph.derivative(terms[i], v));
            }
        }
        let values = Program::compile(graph, &roots, total);
        let aggregate = &mut rule.aggregates[i];
        aggregate.jacobian = Jacobian { entries, values };
        aggregate.moves = moving[first - own + i];
    }
}

/// What is known of the parameters that have a value or an equation instead of a rate.
fn algebraic(
    graph: &mut Graph,
    drafts: &[AlgebraicDraft],
    rates: &[(usize, NodeId)],
    laws: &[Law],
    constants: &Constants,
    total: usize,
) -> Algebraic {
    let nodes: Vec<NodeId> = drafts.iter().map(|entry| entry.node).collect();
    let follows_formula = |v: u32| {
        let v = v as usize;
        let by_law = rates.iter().position(|(p, _)| *p == v).is_some_and(|i| laws[i].is_closed());
        constants.is_constant(v as u32) || v == constants.time || v == constants.time + 1 || by_law
    };
    let closed: Vec<bool> = (drafts.iter())
        .map(|entry| entry.explicit && graph.variables(&[entry.node]).into_iter().all(follows_formula))
        .collect();
    let formulas = (nodes.iter().zip(&closed))
        .map(|(node, closed)| match closed {
            true => Arc::new(Program::compile(graph, &[*node], total)),
            false => Arc::default(),
        })
        .collect();
    let rows: Vec<(usize, NodeId)> = drafts.iter().map(|entry| (entry.parameter, entry.node)).collect();
    Algebraic {
        of: rows.iter().map(|row| row.0).collect(),
        explicit: drafts.iter().map(|entry| entry.explicit).collect(),
        closed,
        needed: Vec::new(),
        values: Program::compile(graph, &nodes, total),
        formulas,
        jacobian: jacobian(graph, &rows, constants, total),
        spans: drafts.iter().map(|entry| entry.span).collect(),
    }
}

/// Which variables stand still while one clause is active.
#[derive(Clone)]
struct Constants<'a> {
    own: usize,
    /// Own parameters with an equation.
    of: HashSet<usize>,
    /// Of the context.
    moving: &'a [bool],
    /// Index of `t`; `age` is the next.
    time: usize,
}

impl Constants<'_> {
    fn is_constant(&self, variable: u32) -> bool {
        let v = variable as usize;
        if v < self.own {
            !self.of.contains(&v)
        } else if v < self.time {
            !self.moving[v - self.own]
        } else {
            v > self.time + 1
        }
    }

    fn all_constant(&self, graph: &Graph, roots: &[NodeId]) -> bool {
        graph.variables(roots).into_iter().all(|v| self.is_constant(v))
    }

    fn reads_context(&self, graph: &Graph, roots: &[NodeId]) -> bool {
        let context = |v: u32| (v as usize) >= self.own && (v as usize) < self.time;
        graph.variables(roots).into_iter().any(|v| context(v) && !self.is_constant(v))
    }
}

/// Classifies the equations of a clause. Those that others depend on come first, whatever their order.
fn laws(graph: &mut Graph, rates: &[(usize, NodeId)], constants: &Constants, total: usize) -> Vec<Law> {
    let mut laws: Vec<Option<Law>> = vec![None; rates.len()];
    // Parameters known to be sums of exponentials and polynomials.
    let mut sums: HashSet<u32> = HashSet::new();
    loop {
        let mut progress = false;
        for (i, &(parameter, rate)) in rates.iter().enumerate() {
            if laws[i].is_some() {
                continue;
            }
            let law = closed(graph, parameter as u32, rate, constants, &sums, total)
                .or_else(|| Some((driven(graph, parameter as u32, rate, constants, total)?, false)));
            if let Some((law, is_sum)) = law {
                laws[i] = Some(law);
                if is_sum {
                    sums.insert(parameter as u32);
                }
                progress = true;
            }
        }
        if !progress {
            break;
        }
    }
    let numeric = |graph: &mut Graph, parameter: usize, rate: NodeId| Numeric {
        coupled: constants.reads_context(graph, &[rate]),
        linear: affine(graph, rate, constants).is_some(),
        obstacle: obstacle(graph, parameter as u32, rate, constants),
    };
    laws.into_iter()
        .zip(rates)
        .map(|(law, &(parameter, rate))| law.unwrap_or_else(|| Law::Numeric(numeric(graph, parameter, rate))))
        .collect()
}

/// Why [`closed`] finds no formula.
fn obstacle(graph: &mut Graph, parameter: u32, rate: NodeId, constants: &Constants) -> Obstacle {
    if constants.reads_context(graph, &[rate]) {
        return Obstacle::Neighbours;
    }
    let Some(by_self) = graph.polynomial(rate, |v| v == parameter) else { return Obstacle::NotPolynomial };
    if by_self.degree() > 2 {
        return Obstacle::Degree(by_self.degree());
    }
    let factors: Vec<NodeId> = (1..3).filter_map(|power| by_self.coefficient(parameter, power)).collect();
    // A square with a coefficient that stands still has no formula beside an inflow that moves.
    if constants.all_constant(graph, &factors) { Obstacle::Inflow } else { Obstacle::Factor }
}

/// The law of a parameter, if it is one with a formula, and whether that is a sum of exponentials and polynomials.
fn closed(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    constants: &Constants,
    sums: &HashSet<u32>,
    total: usize,
) -> Option<(Law, bool)> {
    let zero = graph.constant(0.0);
    let by_self = graph.polynomial(rate, |v| v == parameter)?;
    if by_self.degree() > 2 {
        return None;
    }
    let coefficients: Vec<NodeId> =
        (0..3).map(|power| by_self.coefficient(parameter, power).unwrap_or(zero)).collect();
    let [inflow, factor, square] = coefficients[..] else { unreachable!("three of them") };
    if constants.all_constant(graph, &coefficients) {
        if by_self.degree() == 0 {
            return Some((Law::Polynomial(Program::compile(graph, &[inflow], total)), true));
        }
        let is_sum = by_self.degree() == 1;
        return Some((Law::Quadratic(Program::compile(graph, &coefficients, total)), is_sum));
    }
    if square != zero || !constants.all_constant(graph, &[factor]) {
        return None;
    }
    let age = constants.time as u32 + 1;
    if factor == zero
        && let Some(by_age) = graph.polynomial(inflow, |v| v == age)
        && by_age.degree() <= MAX_AGE_DEGREE
    {
        let powers: Vec<NodeId> =
            (0..=by_age.degree()).map(|power| by_age.coefficient(age, power).unwrap_or(zero)).collect();
        if constants.all_constant(graph, &powers) {
            return Some((Law::Polynomial(Program::compile(graph, &powers, total)), true));
        }
    }
    is_sum(graph, inflow, constants, sums).then(|| {
        let factor = Program::compile(graph, &[factor], total);
        (Law::Sum { factor, inflow: Program::compile(graph, &[inflow], total) }, true)
    })
}

/// The law of a parameter that follows curves, growth functions of time, or a growth law.
fn driven(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    constants: &Constants,
    total: usize,
) -> Option<Law> {
    let is_constant = |v: u32| constants.is_constant(v);
    let form = driven_form(graph, parameter, rate, &is_constant, constants.time as u32)?;
    Some(Law::Driven(Box::new(form.compile(graph, total))))
}

/// True if an expression is made of constants, time, exponentials, sines and cosines of time, and parameters that are
/// such themselves, by addition and multiplication.
fn is_sum(graph: &mut Graph, root: NodeId, constants: &Constants, sums: &HashSet<u32>) -> bool {
    let is_time = |v: u32| v as usize == constants.time || v as usize == constants.time + 1;
    for id in graph.reachable(&[root]) {
        if constants.all_constant(graph, &[id]) {
            continue;
        }
        let good = match graph.node(id) {
            Node::Const(_) => true,
            Node::Var(v) => is_time(v) || sums.contains(&v),
            Node::Unary(Unary::Neg, _) | Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..) => true,
            Node::Unary(Unary::Exp | Unary::Sin | Unary::Cos, a) => {
                let by_time = graph.polynomial(a, is_time);
                by_time.is_some_and(|p| {
                    let coefficients: Vec<NodeId> = p.terms.values().copied().collect();
                    p.degree() <= 1 && constants.all_constant(graph, &coefficients)
                })
            }
            Node::Binary(Binary::Div, _, b) => constants.all_constant(graph, &[b]),
            Node::Binary(Binary::Pow, _, b) => {
                graph.as_constant(b).is_some_and(|n| (0.0..=4.0).contains(&n) && n == n.trunc())
            }
            Node::Select(c, ..) => constants.all_constant(graph, &[c]),
            _ => false,
        };
        if !good {
            return false;
        }
    }
    true
}

/// A rate as `constant + Σ coefficient · variable`, if it is that, with constant coefficients.
fn affine(graph: &mut Graph, rate: NodeId, constants: &Constants) -> Option<Polynomial> {
    let polynomial = graph.polynomial(rate, |v| !constants.is_constant(v))?;
    let time = |m: &Monomial| m.iter().any(|(v, _)| *v as usize >= constants.time);
    (polynomial.degree() <= 1 && !polynomial.terms.keys().any(time)).then_some(polynomial)
}

fn linear(graph: &mut Graph, rates: &[NodeId], constants: &Constants, total: usize) -> Option<Linear> {
    let zero = graph.constant(0.0);
    let (mut variables, mut roots) = (Vec::new(), Vec::new());
    for &rate in rates {
        let polynomial = affine(graph, rate, constants)?;
        roots.push(polynomial.terms.get(&Monomial::new()).copied().unwrap_or(zero));
        let mut row = Vec::new();
        for (monomial, &coefficient) in &polynomial.terms {
            if let [(variable, 1)] = monomial[..] {
                row.push(variable as usize);
                roots.push(coefficient);
            }
        }
        variables.push(row);
    }
    Some(Linear { variables, coefficients: Program::compile(graph, &roots, total) })
}

fn jacobian(graph: &mut Graph, rates: &[(usize, NodeId)], constants: &Constants, total: usize) -> Jacobian {
    let (mut entries, mut roots) = (Vec::new(), Vec::new());
    for (row, &(_, rate)) in rates.iter().enumerate() {
        for variable in graph.variables(&[rate]) {
            if (variable as usize) < constants.time && !constants.is_constant(variable) {
                entries.push((row, variable as usize));
                roots.push(graph.derivative(rate, variable));
            }
        }
    }
    Jacobian { entries, values: Program::compile(graph, &roots, total) }
}

/// How the meeting of two sides is found. `monotone` tells of an own parameter that it moves one way only.
fn watch(
    graph: &mut Graph,
    (a, b): (NodeId, NodeId),
    constants: &Constants,
    monotone: &dyn Fn(usize) -> bool,
    total: usize,
) -> Watch {
    if constants.all_constant(graph, &[a, b]) {
        return Watch::Still;
    }
    let difference = graph.binary(Binary::Sub, a, b);
    let Some(p) = graph.polynomial(difference, |v| !constants.is_constant(v)) else {
        return Watch::Root(None);
    };
    let moving: Vec<(&[(u32, u32)], NodeId)> =
        p.terms.iter().filter(|(m, _)| !m.is_empty()).map(|(m, c)| (&m[..], *c)).collect();
    match moving[..] {
        [] => Watch::Still,
        [(&[(variable, 1)], slope)] => {
            let v = variable as usize;
            if v >= constants.own && v < constants.time || v < constants.own && !monotone(v) {
                return Watch::Root(sum(graph, &p));
            }
            let level = match p.terms.get(&Monomial::new()) {
                None => graph.constant(0.0),
                Some(&rest) => {
                    let minus = graph.unary(Unary::Neg, rest);
                    graph.binary(Binary::Div, minus, slope)
                }
            };
            Watch::Crossing { variable: v, level: Program::compile(graph, &[level], total) }
        }
        _ => Watch::Root(sum(graph, &p)),
    }
}

/// A polynomial as a sum with factors that are known, if it is one.
fn sum(graph: &Graph, p: &Polynomial) -> Option<Sum> {
    let mut sum = Sum { constant: 0.0, terms: Vec::new() };
    for (monomial, &factor) in &p.terms {
        let factor = graph.as_constant(factor)?;
        match monomial[..] {
            [] => sum.constant = factor,
            [(variable, 1)] => sum.terms.push((variable as usize, factor)),
            _ => return None,
        }
    }
    Some(sum)
}
