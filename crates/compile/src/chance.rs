//! Random elements of a model: draws, weights of successors, and the clocks of events at a rate.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::conditions::Atoms;
use crate::rules::RuleBuilder;
use crate::scope::{Lowered, Scope, Variables, plural};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, Graph, Interval, Node, NodeId, Program, Unary};
use dlsys_model::{
    Class, Condition, Distribution, Draw, Kinds, NewClock, Outcome, Produce, base_of, class_of,
};
use dlsys_syntax::ast::{Action, Clause, Document, HeadModule, Item, Rule};
use dlsys_tree::key;

/// Variables from this number on are draws that are not yet assigned to modules.
pub(super) const DRAW: u32 = 1 << 25;
/// Maximum number of draws of a model, after expansion of functions.
const MAX_DRAWS: usize = 100_000;
/// Rates below this are negative; between this and 0 they may be errors of integration.
const LEAST_RATE: f64 = -1e-9;

/// A draw before its successor is compiled.
#[derive(Clone, Debug)]
pub struct DraftDraw {
    distribution: Distribution,
    parameters: Vec<NodeId>,
    span: Span,
}

/// The draws of a model so far.
#[derive(Default)]
pub struct Draws {
    pub all: Vec<DraftDraw>,
    /// True while lowering expressions that are computed once, when a module is created.
    pub allowed: bool,
}

impl Scope {
    /// A call of a distribution.
    pub(super) fn draw(
        &mut self,
        distribution: Distribution,
        span: Span,
        nodes: Vec<NodeId>,
    ) -> Option<Lowered> {
        let wanted = distribution.parameters();
        if wanted.map_or(nodes.is_empty(), |wanted| nodes.len() != wanted) {
            let wanted = wanted.map_or("values to choose from".to_owned(), |n| plural(n, "parameter"));
            self.diagnostics.push(
                Diagnostic::error(format!("`{}` has {wanted}, not {}", distribution.name(), nodes.len()))
                    .at(span, format!("{} given", plural(nodes.len(), "argument")))
                    .help(format!("it is written `{}`", distribution.usage())),
            );
            return None;
        }
        self.may_draw(distribution.name(), span)?;
        let parameters: Option<Vec<f64>> = nodes.iter().map(|node| self.graph.as_constant(*node)).collect();
        if let Some(why) = parameters.and_then(|values| distribution.fault(&values)) {
            self.diagnostics.push(
                Diagnostic::error(format!("`{}` cannot be drawn from", distribution.name()))
                    .at(span, why)
                    .help(distribution.demand()),
            );
            return None;
        }
        self.add_draw(DraftDraw { distribution, parameters: nodes, span })
            .map(|node| Lowered { node, is_condition: false })
    }

    /// Reports a draw in an expression that cannot contain one.
    pub(super) fn may_draw(&mut self, name: &str, span: Span) -> Option<()> {
        if self.draws.allowed {
            return Some(());
        }
        self.diagnostics.push(
            Diagnostic::error(format!("`{name}` draws a random number, which cannot be done here"))
                .at(span, "numbers are drawn once, for the parameters of a new module")
                .help("draw it where the module is made, as in `produce F(uniform(0, 1))`, and read that parameter here"),
        );
        None
    }

    fn add_draw(&mut self, draw: DraftDraw) -> Option<NodeId> {
        if self.draws.all.len() >= MAX_DRAWS {
            if self.draws.all.len() == MAX_DRAWS {
                self.draws.all.push(draw.clone());
                self.diagnostics.push(
                    Diagnostic::error("this model draws too many random numbers")
                        .at(draw.span, format!("more than {MAX_DRAWS} places in its text"))
                        .help("a function that calls another twice doubles its draws"),
                );
            }
            return None;
        }
        self.draws.all.push(draw);
        Some(self.graph.var(DRAW + self.draws.all.len() as u32 - 1))
    }

    /// Copies the draws of a function for one call of it. The result maps the draws of the body to the copies; `arguments`
    /// maps the formal parameters to the arguments.
    pub(super) fn draw_again(
        &mut self,
        draws: Range<u32>,
        arguments: &dyn Fn(u32) -> Option<NodeId>,
    ) -> Option<FxHashMap<u32, NodeId>> {
        let mut images = FxHashMap::default();
        for number in draws {
            let DraftDraw { distribution, parameters, span } = self.draws.all[number as usize].clone();
            let parameters = self.graph.rewrite(&parameters, |_, _, node| match node {
                Node::Var(v) if v >= DRAW => images.get(&v).copied(),
                Node::Var(v) => arguments(v),
                _ => None,
            });
            let image = self.add_draw(DraftDraw { distribution, parameters, span })?;
            images.insert(DRAW + number, image);
        }
        Some(images)
    }
}

/// The draws of a successor before it is compiled.
#[derive(Default)]
pub(super) struct Drawn {
    /// Index of the module in the successor, and the numbers of its draws.
    pub modules: Vec<(usize, Range<u32>)>,
}

impl Drawn {
    /// Compiles the arguments of a successor and its draws; `count` is the number of the rule's variables.
    pub fn compile(&self, scope: &mut Scope, roots: Vec<NodeId>, count: usize) -> (Program, Vec<Draw>) {
        if self.modules.is_empty() {
            return (scope.graph.program(&roots, count), Vec::new());
        }
        let order: Vec<(usize, u32, u32)> = (self.modules.iter())
            .flat_map(|(place, draws)| draws.clone().enumerate().map(|(i, d)| (*place, i as u32, d)))
            .collect();
        let sure = unconditional(&scope.graph, &scope.draws.all, &roots);
        let index: FxHashMap<u32, u32> = order.iter().zip(0..).map(|((.., draw), i)| (*draw, i)).collect();
        let place = |graph: &mut Graph, node| match node {
            Node::Var(v) if v >= DRAW => Some(graph.var(count as u32 + index[&(v - DRAW)])),
            _ => None,
        };
        let roots = scope.graph.rewrite(&roots, |graph, _, node| place(graph, node));
        let draws = (order.iter().enumerate())
            .map(|(i, &(module, number, draw))| {
                let DraftDraw { distribution, parameters, span } = scope.draws.all[draw as usize].clone();
                let parameters = scope.graph.rewrite(&parameters, |graph, _, node| place(graph, node));
                Draw {
                    distribution,
                    parameters: Program::compile(&scope.graph, &parameters, count + i),
                    place: module,
                    number,
                    conditional: !sure.contains(&draw),
                    span,
                }
            })
            .collect();
        (Program::compile(&scope.graph, &roots, count + order.len()), draws)
    }
}

/// The draws that some expressions read whatever the values of their conditions.
fn unconditional(graph: &Graph, draws: &[DraftDraw], roots: &[NodeId]) -> Vec<u32> {
    let mut sure = Vec::new();
    let mut seen: dlsys_expr::NodeSet = roots.iter().copied().collect();
    let mut stack: Vec<NodeId> = roots.to_vec();
    while let Some(id) = stack.pop() {
        let next: Vec<NodeId> = match graph.node(id) {
            Node::Select(condition, ..) => vec![condition],
            Node::Var(v) if v >= DRAW => {
                sure.push(v - DRAW);
                draws[(v - DRAW) as usize].parameters.clone()
            }
            node => node.operands().into_iter().flatten().collect(),
        };
        stack.extend(next.into_iter().filter(|id| seen.insert(*id)));
    }
    sure
}

/// The clocks of the kinds of a model.
#[derive(Default)]
pub struct Clocks {
    /// The keys of the clauses with a rate, by name and number of parameters of the predecessor.
    keys: FxHashMap<(Arc<str>, usize), Vec<u64>>,
    /// The maximum number of clocks over the kinds that one context pattern may match.
    widths: FxHashMap<(String, usize), usize>,
}

/// The name under which clocks are collected: `+`, `-` and `±` share their rules, and so do `+_l`, `-_l` and `±_l`.
pub(super) fn sort(name: &str) -> Cow<'_, str> {
    match name.strip_prefix(['+', '-']) {
        Some(subscript) => format!("±{subscript}").into(),
        None => name.into(),
    }
}

/// The name under which the kinds are collected that one context pattern may match.
pub(super) fn group(name: &str) -> Cow<'_, str> {
    if class_of(name) == Class::Word { base_of(name).into() } else { sort(name) }
}

impl Clocks {
    pub fn new(document: &Document) -> Clocks {
        let mut clocks = Clocks::default();
        for (item, _) in &document.items {
            let Item::Rule(rule) = item else { continue };
            if rule.clauses.iter().all(|clause| clause.hazard.is_none()) {
                continue;
            }
            let arity = rule.predecessor.parameters.len();
            let name = &rule.predecessor.name.text;
            let hazards = production_keys(rule).filter(|(clause, _)| clause.hazard.is_some());
            let keys = clocks.keys.entry((Arc::from(&*sort(name)), arity)).or_default();
            keys.extend(hazards.map(|(_, key)| key));
            let width = clocks.widths.entry((group(name).into_owned(), arity)).or_default();
            *width = (*width).max(keys.len());
        }
        clocks
    }

    /// Number of hidden parameters of a kind.
    pub fn width(&self, name: &str, arity: usize) -> usize {
        if self.widths.is_empty() {
            return 0;
        }
        self.widths.get(&(group(name).into_owned(), arity)).copied().unwrap_or(0)
    }

    /// The keys of the hidden parameters of a kind; 0 for those that it does not use.
    fn of(&self, name: &str, arity: usize) -> Vec<u64> {
        if self.keys.is_empty() {
            return Vec::new();
        }
        let mut keys = self.keys.get(&(Arc::from(&*sort(name)), arity)).cloned().unwrap_or_default();
        keys.resize(self.width(name, arity), 0);
        keys
    }

    /// The clocks of a new module.
    pub fn for_new(&self, name: &str, arity: usize, place: usize, after: usize) -> Vec<NewClock> {
        if self.width(name, arity) == 0 {
            return Vec::new();
        }
        self.of(name, arity).into_iter().map(|key| NewClock { place, after, key }).collect()
    }

    /// Stores the keys of the clocks in the kinds.
    pub fn assign(&self, kinds: &mut Kinds) {
        let all: Vec<_> = kinds.iter().map(|(id, kind)| (id, self.of(&kind.name, kind.arity))).collect();
        for (id, clocks) in all {
            kinds.get_mut(id).clocks = clocks;
        }
    }

    /// Index of the clock of a clause among the hidden parameters of its kind.
    fn slot(&self, head: &HeadModule, key: u64) -> usize {
        let keys = self.keys.get(&(Arc::from(&*sort(&head.name.text)), head.parameters.len()));
        keys.and_then(|keys| keys.iter().position(|k| *k == key)).expect("every clause was seen")
    }
}

/// The `produce` clauses of a rule with their keys.
pub(super) fn production_keys(rule: &Rule) -> impl Iterator<Item = (&Clause, u64)> {
    let side = |modules: &[HeadModule]| -> String {
        modules.iter().map(|m| format!("{}({})", m.name.text, m.parameters.len())).collect()
    };
    let own = std::slice::from_ref(&rule.predecessor);
    let head = format!("{}<{}>{}", side(&rule.left), side(own), side(&rule.right));
    let produces = rule.clauses.iter().filter(|clause| matches!(clause.action, Action::Produce(_)));
    produces.enumerate().map(move |(i, clause)| (clause, key(&head, i)))
}

/// An event at a rate while its rule is lowered.
pub(super) struct Hazard {
    /// Number of the clock among the rule's variables.
    pub parameter: usize,
    guard: Option<NodeId>,
    rate: NodeId,
    span: Span,
}

impl RuleBuilder<'_> {
    /// Lowers the rate of a clause. `guard` is its condition.
    pub(super) fn hazard(
        &mut self,
        clause: &Clause,
        (head, key): (&HeadModule, u64),
        guard: Option<NodeId>,
        variables: &Variables,
    ) -> Option<Hazard> {
        let expression = clause.hazard?;
        let rate = self.scope.number(&self.document.expressions, expression, variables)?;
        let span = self.document.expressions.span(expression.root);
        if let Some(value) = self.scope.graph.as_constant(rate).filter(|x| !(x.is_finite() && *x >= 0.0)) {
            self.scope.diagnostics.push(
                Diagnostic::error("a rate is a number of at least 0")
                    .at(span, format!("this is {value}"))
                    .help(
                        "it is the mean number of events in a unit of time: `at rate 0.5` is one in 2 units",
                    ),
            );
            return None;
        }
        let parameter = head.parameters.len() + self.clocks.slot(head, key);
        Some(Hazard { parameter, guard, rate, span })
    }

    /// The rate of a clock under equations whose condition is `active`; None if the clock does not run there.
    pub(super) fn clock_rate(&mut self, hazard: &Hazard, active: Option<NodeId>) -> Option<(usize, NodeId)> {
        let graph = &mut self.scope.graph;
        if graph.as_constant(hazard.rate) == Some(0.0) {
            return None;
        }
        let minus = graph.unary(Unary::Neg, hazard.rate);
        let known = |graph: &Graph, part: NodeId| active.is_some_and(|a| conjuncts(graph, a).contains(&part));
        let rate = match hazard.guard {
            Some(guard) if !conjuncts(graph, guard).into_iter().all(|part| known(graph, part)) => {
                let zero = graph.constant(0.0);
                graph.select(guard, minus, zero)
            }
            _ => minus,
        };
        Some((hazard.parameter, rate))
    }

    /// The condition that a clock has reached 0.
    pub(super) fn clock_is_down(&mut self, hazard: &Hazard, atoms: &mut Atoms) -> Option<Condition> {
        let graph = &mut self.scope.graph;
        let (clock, zero) = (graph.var(hazard.parameter as u32), graph.constant(0.0));
        let down = graph.binary(Binary::Le, clock, zero);
        self.scope
            .comparisons
            .insert(down, (hazard.span, Arc::new(["clock".to_owned(), "0".to_owned()].into())));
        self.decompose(down, hazard.span, atoms)
    }

    /// A clause that fires where a rate is negative; None if it is never negative.
    pub(super) fn negative_rate(
        &mut self,
        hazard: &Hazard,
        clause: Span,
        count: usize,
        atoms: &mut Atoms,
    ) -> Option<Produce> {
        let graph = &mut self.scope.graph;
        if is_never_negative(graph, hazard.rate, count) {
            return None;
        }
        let least = graph.constant(LEAST_RATE);
        let mut fault = graph.binary(Binary::Lt, hazard.rate, least);
        self.scope
            .comparisons
            .insert(fault, (hazard.span, Arc::new(["rate".to_owned(), "0".to_owned()].into())));
        if let Some(guard) = hazard.guard {
            fault = self.scope.graph.binary(Binary::And, guard, fault);
        }
        atoms.of_productions = true;
        let guard = self.decompose(fault, hazard.span, atoms);
        atoms.of_productions = false;
        let guard = guard?;
        Some(Produce { guard, span: clause, key: 0, is_fault: true, outcome: Outcome::default() })
    }
}

/// The terms of a conjunction.
fn conjuncts(graph: &Graph, condition: NodeId) -> Vec<NodeId> {
    let (mut parts, mut stack) = (Vec::new(), vec![condition]);
    while let Some(id) = stack.pop() {
        match graph.node(id) {
            Node::Binary(Binary::And, a, b) => stack.extend([a, b]),
            _ => parts.push(id),
        }
    }
    parts
}

/// True if interval arithmetic shows that a rate is at least 0 for all values of the parameters.
fn is_never_negative(graph: &Graph, rate: NodeId, count: usize) -> bool {
    let mut variables = vec![Interval::ENTIRE; count];
    for time in &mut variables[count - 2..] {
        *time = Interval { lo: 0.0, hi: f64::INFINITY, partial: false };
    }
    let mut out = [Interval::EMPTY];
    Program::compile(graph, &[rate], count).eval(&variables, &mut Vec::new(), &mut out);
    out[0].lo >= 0.0
}
