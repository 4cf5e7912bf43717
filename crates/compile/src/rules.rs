//! Rules, strings and interpretations: from the syntax tree to the model.

use std::collections::HashMap;
use std::sync::Arc;

use crate::advice;
use crate::analysis::{Draft, never_reached};
use crate::chance::{Clocks, production_keys};
use crate::equations::Equations;
use crate::gather::watched;
use crate::scope::{RESERVED, Scope, Variables};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, Graph, Node, NodeId, Program, Unary};
use dlsys_model::{
    Boundary, CUT, Class, Clock, Comparison, Condition, DRAWN_WORDS, Interpretation, Jacobian, KindId, Kinds,
    Pattern, Produce, Rule, Solve, Step, Turn, base_of, class_of,
};
use dlsys_syntax::ast::{self, Action, Document, Expression, HeadModule};
use dlsys_syntax::print;

/// Longest condition, in comparisons and connectives, after functions are put in.
const MAX_CONDITION: usize = 10_000;

/// Builds the parts of a model that are made of modules.
pub struct RuleBuilder<'b> {
    pub document: &'b Document,
    pub scope: &'b mut Scope,
    pub kinds: &'b mut Kinds,
    pub clocks: Clocks,
    /// Each kind that stands in a string, with the first place where it does.
    pub occurs: HashMap<KindId, Span>,
    /// The heads of the aggregates of each rule.
    pub gathered: Vec<Vec<HeadModule>>,
    /// The same of drawings, where they are not those of the kind itself.
    pub drawn: HashMap<KindId, Span>,
}

/// The pairs of expressions that the conditions of a rule compare.
#[derive(Default)]
pub(super) struct Atoms {
    sides: Vec<(NodeId, NodeId)>,
    spans: Vec<Span>,
    boundaries: Vec<Boundary>,
    index: HashMap<(NodeId, NodeId), u32>,
}

impl RuleBuilder<'_> {
    pub(super) fn error(&mut self, error: Diagnostic) {
        self.scope.diagnostics.push(error);
    }

    /// The variables of a head, and how many there are with `t` and `age`.
    pub(super) fn variables(
        &mut self,
        own: &HeadModule,
        left: &[HeadModule],
        right: &[HeadModule],
        aggregates: u32,
    ) -> (Variables, usize) {
        let mut names: HashMap<Arc<str>, NodeId> = HashMap::new();
        let mut spans: HashMap<Arc<str>, Span> = HashMap::new();
        let mut count = 0;
        let mut parameters = Vec::new();
        for module in std::iter::once(own).chain(left).chain(right) {
            parameters.extend(module.parameters.iter().zip(count..));
            // Behind those that are written, a module has hidden ones.
            let hidden = self.clocks.width(&module.name.text, module.parameters.len());
            count += (module.parameters.len() + hidden) as u32;
        }
        for (parameter, number) in parameters {
            let node = self.scope.graph.var(number);
            if RESERVED.contains(&&*parameter.text) {
                self.error(
                    Diagnostic::error(format!("a parameter cannot be called `{}`", parameter.text))
                        .at(parameter.span, "this name stands for time in every rule")
                        .help(match &*parameter.text {
                            "age" => "`age`, the time since the module was made, is known without a parameter; for another time choose another name".to_owned(),
                            name => format!("`{name}`, the time since the start, is known without a parameter; for another time choose another name"),
                        }),
                );
            }
            if let Some(before) = spans.insert(parameter.text.clone(), parameter.span) {
                self.error(
                    Diagnostic::error(format!("two parameters of this head are called `{}`", parameter.text))
                        .at(parameter.span, "the second one")
                        .at(before, "the first one")
                        .help(advice::other_name(&parameter.text, !left.is_empty(), !right.is_empty())),
                );
            }
            names.insert(parameter.text.clone(), node);
        }
        let first_aggregate = count;
        count += aggregates;
        for name in RESERVED {
            let node = self.scope.graph.var(count);
            names.insert(name.into(), node);
            count += 1;
        }
        let aggregates = Some((first_aggregate, count));
        (Variables { names, aggregates, ..Variables::default() }, count as usize)
    }

    fn not_a_bracket(&mut self, head: &HeadModule, is_context: bool) -> bool {
        let bracket = matches!(&*head.name.text, "[" | "]");
        if bracket {
            self.error(
                Diagnostic::error("a bracket has no rules")
                    .at(head.name.span, "brackets structure the string; they do not develop")
                    .help(if is_context {
                        "in a context after `>` brackets stand in pairs around a branch: `A > [ B ] C`"
                    } else {
                        "to change a branch, write a rule for a module in it"
                    }),
            );
        }
        let cut = &*head.name.text == CUT;
        if cut {
            self.error(
                Diagnostic::error("`%` has no rules and no context")
                    .at(head.name.span, "it cuts off the rest of its branch, and is gone at once")
                    .help("write the rule for the module that makes it, as in `A(x): if x = 1 produce %`"),
            );
        }
        !bracket && !cut
    }

    pub fn interpretation(
        &mut self,
        head: &HeadModule,
        drawn: &[ast::Module],
    ) -> Option<(KindId, Interpretation)> {
        if !self.not_a_bracket(head, false) {
            return None;
        }
        // Who draws or measures a module sees what is written of it, and no clocks.
        let clocks = std::mem::take(&mut self.clocks);
        let (mut variables, count) = self.variables(head, &[], &[], 0);
        // And one module after another.
        variables.aggregates = None;
        if let Some(cut) = drawn.iter().find(|module| &*module.name == CUT) {
            self.error(
                Diagnostic::error("a drawing cuts nothing off")
                    .at(cut.span, "`%` belongs into the successors of rules")
                    .help("to draw nothing, write `ε`"),
            );
        }
        if let Some(again) = drawn.iter().find(|module| is_head(module, head)) {
            self.error(draws_nothing(again, head));
        }
        // What is only drawn does not develop: it makes no rule reachable.
        let before = std::mem::take(&mut self.occurs);
        let drawn = self.string(drawn, &variables, count);
        self.clocks = clocks;
        let inside = std::mem::replace(&mut self.occurs, before);
        let kind = self.kinds.intern(&head.name.text, head.parameters.len());
        self.drawn.extend(inside.into_iter().filter(|(other, _)| *other != kind));
        Some((kind, Interpretation { span: head.span, drawn: drawn? }))
    }

    /// A rule, and the kinds it is for. `PatternNames` are matched to kinds once all kinds are known.
    pub fn rule(&mut self, rule: &ast::Rule) -> Option<(Rule, Draft)> {
        let mut good = self.not_a_bracket(&rule.predecessor, false);
        for context in rule.left.iter().chain(&rule.right) {
            good &= self.not_a_bracket(context, true);
        }
        let names: &[&str] = match &*rule.predecessor.name.text {
            "±" => &["+", "-"],
            name => &[name],
        };
        let hidden = |me: &Self, m: &HeadModule| me.clocks.width(&m.name.text, m.parameters.len());
        for name in names {
            self.kinds.intern(name, rule.predecessor.parameters.len());
        }
        let written = self.aggregates_in(rule);
        let own = rule.predecessor.parameters.len() + hidden(self, &rule.predecessor);
        let (mut variables, count) = self.variables(&rule.predecessor, &rule.left, &rule.right, written);
        self.scope.comparisons.clear();
        self.scope.gathered.clear();
        good &= self.locals(rule, &mut variables);

        // All conditions first: they share their atoms.
        let mut atoms = Atoms::default();
        let mut guards = Vec::new();
        for clause in &rule.clauses {
            let mut node = None;
            let guard = match clause.guard {
                None => Some(Condition::default()),
                Some(guard) => {
                    node = self.scope.condition(&self.document.expressions, guard, &variables);
                    // Under a rate it is the clock that says when.
                    match (node, &clause.hazard) {
                        (Some(_), Some(_)) => Some(Condition::default()),
                        (node, _) => node.and_then(|node| self.decompose(node, clause.span, &mut atoms)),
                    }
                }
            };
            good &= guard.is_some();
            guards.push((guard.unwrap_or_default(), node));
        }
        let mut clocks = Vec::new();
        let mut hazards = Vec::new();
        let mut faults = Vec::new();
        let mut drafts = Vec::new();
        let mut produces = Vec::new();
        let mut keys = production_keys(rule);
        for (clause, (guard, node)) in rule.clauses.iter().zip(&guards) {
            let Action::Produce(successors) = &clause.action else { continue };
            let key = keys.next().map_or(0, |(_, key)| key);
            let mut guard = guard.clone();
            if clause.hazard.is_some() {
                match self.hazard(clause, (&rule.predecessor, key), *node, &variables) {
                    Some(hazard) => {
                        guard = self.clock_is_down(&hazard, &mut atoms)?;
                        faults.extend(self.negative_rate(&hazard, clause.span, count, &mut atoms));
                        clocks.push(Clock { parameter: hazard.parameter, produce: produces.len() });
                        hazards.push(hazard);
                    }
                    None => good = false,
                }
            }
            match self.outcome(successors, &variables, count) {
                Some(outcome) => {
                    produces.push(Produce { guard, span: clause.span, key, is_fault: false, outcome });
                }
                None => good = false,
            }
        }
        produces.extend(faults);
        for (clause, (guard, node)) in rule.clauses.iter().zip(&guards) {
            let Action::Solve(equations) = &clause.action else { continue };
            let equations = self.equations(equations, &rule.predecessor, &variables, clause.span);
            let Some(mut equations) = equations else {
                good = false;
                continue;
            };
            equations.rates.extend(hazards.iter().filter_map(|hazard| self.clock_rate(hazard, *node)));
            let (smooth, switches) = self.smooth(equations.all(), own, count, clause.span, &mut atoms)?;
            equations.set_all(smooth);
            drafts.push((guard.clone(), clause.span, equations, switches));
        }
        if !good {
            return None;
        }
        if let (true, Some(first)) = (drafts.is_empty(), clocks.first()) {
            // Clocks run, though nothing else does.
            let span = produces[first.produce].span;
            let rates = hazards.iter().filter_map(|hazard| self.clock_rate(hazard, None)).collect();
            let (rates, switches) = self.smooth(rates, own, count, span, &mut atoms)?;
            drafts.push((Condition::default(), span, Equations { rates, algebraic: Vec::new() }, switches));
        }
        let context = count - own - 2;
        let (aggregates, terms) = self.aggregates(count);
        let sides = atoms.sides.clone();
        let mut draft = Draft { rates: Vec::new(), algebraic: Vec::new(), sides, terms };
        let solves = drafts
            .into_iter()
            .map(|(guard, span, Equations { rates, algebraic }, switches)| {
                let total = count + switches.len();
                let graph = &mut self.scope.graph;
                // A value that has no rate is not known to approach anything.
                let given = |graph: &Graph, (a, b): (NodeId, NodeId)| {
                    let read = graph.variables(&[a, b]);
                    algebraic.iter().any(|entry| read.contains(&(entry.parameter as u32)))
                };
                let unreachable = (atoms.sides.iter())
                    .map(|&sides| {
                        !given(graph, sides) && never_reached(graph, sides, &rates, own, context, total)
                    })
                    .collect();
                let roots: Vec<NodeId> = rates.iter().map(|(_, node)| *node).collect();
                draft.rates.push(rates.clone());
                draft.algebraic.push(algebraic);
                Solve {
                    guard,
                    span,
                    of: rates.iter().map(|(parameter, _)| *parameter).collect(),
                    rates: Program::compile(&self.scope.graph, &roots, total),
                    switches,
                    unreachable,
                    // The analysis of the whole model fills in the rest.
                    laws: Vec::new(),
                    numeric: Vec::new(),
                    numeric_rates: Program::default(),
                    linear: None,
                    jacobian: Jacobian::default(),
                    algebraic: Default::default(),
                    watch: Vec::new(),
                    flashes: false,
                    is_delicate: false,
                    stepping: Default::default(),
                }
            })
            .collect();
        let sides: Vec<NodeId> = atoms.sides.iter().flat_map(|(a, b)| [*a, *b]).collect();
        let sides = Program::compile(&self.scope.graph, &sides, count);
        let first = count - 2 - written as usize;
        let pattern = |m: &HeadModule| {
            let arity = m.parameters.len();
            Pattern { kinds: Vec::new(), arity, width: arity + hidden(self, m) }
        };
        let names = |m: &HeadModule| {
            let clocks = std::iter::repeat_n("clock".to_owned(), hidden(self, m));
            m.parameters.iter().map(|p| p.text.to_string()).chain(clocks).collect::<Vec<_>>()
        };
        let compiled = Rule {
            index: 0,
            label: print::head(rule),
            span: rule.head,
            discrete: rule.discrete,
            parameters: names(&rule.predecessor),
            context_names: rule.left.iter().chain(&rule.right).flat_map(names).collect(),
            left: rule.left.iter().map(pattern).collect(),
            right: rule.right.iter().map(pattern).collect(),
            right_shape: rule.right_shape.iter().map(|part| turn(*part)).collect(),
            variables: count,
            watched: watched(&sides, &aggregates, count, first),
            aggregates,
            first_aggregate: first,
            sides,
            atoms: atoms.spans,
            boundaries: atoms.boundaries,
            solves,
            produces,
            hidden: hidden(self, &rule.predecessor),
            clocks,
            moving_context: Vec::new(),
            reads_context: false,
            watch_at_rest: Vec::new(),
        };
        Some((compiled, draft))
    }

    /// Takes a condition apart into comparisons of two sides.
    pub(super) fn decompose(&mut self, root: NodeId, span: Span, atoms: &mut Atoms) -> Option<Condition> {
        enum Task {
            Visit(NodeId),
            Emit(Step),
        }
        let mut steps = Vec::new();
        let mut tasks = vec![Task::Visit(root)];
        while let Some(task) = tasks.pop() {
            if steps.len() > MAX_CONDITION {
                self.error(
                    Diagnostic::error("this condition is too long")
                        .at(span, format!("more than {MAX_CONDITION} comparisons and connectives"))
                        .help("functions that call functions multiply what they compare: compute a shared part once"),
                );
                return None;
            }
            let id = match task {
                Task::Emit(step) => {
                    steps.push(step);
                    continue;
                }
                Task::Visit(id) => id,
            };
            match self.scope.graph.node(id) {
                Node::Const(bits) => steps.push(Step::Constant(f64::from_bits(bits) != 0.0)),
                Node::Unary(Unary::Not, a) => tasks.extend([Task::Emit(Step::Not), Task::Visit(a)]),
                Node::Binary(op @ (Binary::And | Binary::Or), a, b) => {
                    let step = if op == Binary::And { Step::And } else { Step::Or };
                    tasks.extend([Task::Emit(step), Task::Visit(b), Task::Visit(a)]);
                }
                Node::Binary(op, a, b) => {
                    let comparison = match op {
                        Binary::Lt => Comparison::Less,
                        Binary::Le => Comparison::LessOrEqual,
                        Binary::Eq => Comparison::Equal,
                        _ => Comparison::NotEqual,
                    };
                    let known = self.scope.comparisons.get(&id);
                    let (at, boundary) = known.map_or((span, None), |(at, sides)| (*at, Some(&**sides)));
                    let never = [a, b]
                        .into_iter()
                        .any(|side| self.scope.graph.as_constant(side).is_some_and(f64::is_nan));
                    if never {
                        self.scope.diagnostics.push(
                            Diagnostic::warning("this comparison never holds")
                                .at(at, "one of its sides has no value (NaN)")
                                .help(advice::not_finite(f64::NAN)),
                        );
                    }
                    steps.push(atoms.step(a, b, comparison, at, boundary));
                }
                node => unreachable!("{node:?} is no condition"),
            }
        }
        Some(Condition(steps))
    }

    /// The value of an expression of constants, for declarations such as `angle`.
    pub fn constant(&mut self, expression: Expression) -> Option<f64> {
        self.scope.constant_value(&self.document.expressions, expression)
    }
}

/// Whether a module of a drawing is of the kind that is drawn, and says nothing to the turtle by its name.
fn is_head(module: &ast::Module, head: &HeadModule) -> bool {
    let same = module.name == head.name.text && module.arguments.len() == head.parameters.len();
    same && class_of(&module.name) == Class::Word && !DRAWN_WORDS.contains(&base_of(&module.name))
}

fn draws_nothing(module: &ast::Module, head: &HeadModule) -> Diagnostic {
    let name = &module.name;
    let arguments = if head.parameters.is_empty() { "" } else { "(…)" };
    Diagnostic::warning(format!("`{name}` draws nothing in its own drawing"))
        .at(module.span, format!("inside its own drawing a module is what its name says, and `{name}` says nothing to the turtle"))
        .help(format!(
            "drawings do not repeat themselves: let a rule make the parts, `{}: … produce F(1) {name}{arguments}`, or draw a module with another name",
            print::head_module(head)
        ))
}

fn turn(part: ast::Turn) -> Turn {
    match part {
        ast::Turn::Module => Turn::Module,
        ast::Turn::Open => Turn::Open,
        ast::Turn::Close => Turn::Close,
    }
}

impl Atoms {
    /// The step that compares two sides; each pair is kept once, whichever way round it is written.
    fn step(
        &mut self,
        a: NodeId,
        b: NodeId,
        comparison: Comparison,
        span: Span,
        sides: Option<&[String; 2]>,
    ) -> Step {
        let (pair, comparison) = if a <= b { ((a, b), comparison) } else { ((b, a), comparison.mirrored()) };
        let atom = *self.index.entry(pair).or_insert_with(|| {
            self.sides.push(pair);
            self.spans.push(span);
            let known = sides.map(|[left, right]| Boundary::new(left, right, a > b));
            self.boundaries.push(known.unwrap_or_default());
            self.sides.len() as u32 - 1
        });
        Step::Atom(atom, comparison)
    }
}
