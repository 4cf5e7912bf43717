//! Rules, strings and interpretations: from the syntax tree to the model.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::ast::{self, Action, Document, Expression, HeadModule};
use super::print;
use super::scope::{RESERVED, Scope, Variables, plural};
use super::suggest::did_you_mean;
use crate::diagnostic::{Diagnostic, Span};
use crate::expr::{Binary, Node, NodeId, Program, Unary};
use crate::model::{
    CUT, Class, Comparison, Condition, Draft, Interpretation, Jacobian, KindId, Kinds, Pattern, Produce,
    Rule, Solve, Step, Successor, class_of, never_reached,
};

/// Longest condition, in comparisons and connectives, after functions are put in.
const MAX_CONDITION: usize = 10_000;

/// Builds the parts of a model that are made of modules.
pub struct RuleBuilder<'b> {
    pub document: &'b Document,
    pub scope: &'b mut Scope,
    pub kinds: &'b mut Kinds,
    /// Each kind that stands in a string, with the first place where it does.
    pub occurs: HashMap<KindId, Span>,
    /// The same of drawings, where they are not those of the kind itself.
    pub drawn: HashMap<KindId, Span>,
}

/// The pairs of expressions that the conditions of a rule compare.
#[derive(Default)]
pub(super) struct Atoms {
    sides: Vec<(NodeId, NodeId)>,
    spans: Vec<Span>,
    boundaries: Vec<String>,
    index: HashMap<(NodeId, NodeId), u32>,
}

impl RuleBuilder<'_> {
    pub(super) fn error(&mut self, error: Diagnostic) {
        self.scope.diagnostics.push(error);
    }

    /// A string of modules over the given variables.
    pub fn successor(
        &mut self,
        modules: &[ast::Module],
        variables: &Variables,
        count: usize,
    ) -> Option<Successor> {
        let mut kinds = Vec::with_capacity(modules.len());
        let mut roots = Vec::new();
        let mut open: Vec<Span> = Vec::new();
        let mut good = true;
        for module in modules {
            let kind = self.kinds.intern(&module.name, module.arguments.len());
            match &*module.name {
                "[" | "]" if !module.arguments.is_empty() => {
                    self.error(
                        Diagnostic::error("a bracket has no parameters")
                            .at(module.span, "a `(` cannot follow a bracket"),
                    );
                    good = false;
                    if &*module.name == "[" {
                        open.push(module.span);
                    } else {
                        open.pop();
                    }
                    continue;
                }
                "[" => open.push(module.span),
                "]" if open.pop().is_none() => {
                    self.error(
                        Diagnostic::error("this `]` closes no branch")
                            .at(module.span, "there is no `[` before it in this string")
                            .help("brackets must match within each string"),
                    );
                    good = false;
                }
                _ => {}
            }
            self.occurs.entry(kind).or_insert(module.span);
            kinds.push(kind);
            for &argument in &module.arguments {
                let known = self.scope.diagnostics.len();
                let Some(node) = self.scope.number(&self.document.expressions, argument, variables) else {
                    good = false;
                    if count > 0
                        && known < self.scope.diagnostics.len()
                        && let Some(head) = self.looks_like_a_head(module)
                    {
                        let error = self.scope.diagnostics.last_mut().expect("one was added");
                        error.help.push(format!("if `{head}` is the head of a rule, end it with `:`"));
                    }
                    continue;
                };
                if let Some(value) = self.scope.graph.as_constant(node).filter(|x| !x.is_finite()) {
                    self.error(
                        Diagnostic::error("this has no finite value")
                            .at(self.document.expressions.span(argument.root), format!("it is {value}")),
                    );
                    good = false;
                }
                roots.push(node);
            }
        }
        if let Some(bracket) = open.pop() {
            self.error(
                Diagnostic::error("this `[` is never closed")
                    .at(bracket, "expected a `]` for it in this string")
                    .help("brackets must match within each string"),
            );
            good = false;
        }
        if !good {
            return None;
        }
        Some(Successor { kinds, arguments: Program::compile(&self.scope.graph, &roots, count) })
    }

    /// A module whose arguments are bare names, as a rule's head has them.
    fn looks_like_a_head(&self, module: &ast::Module) -> Option<String> {
        let names: Vec<&str> = (module.arguments.iter())
            .map(|argument| match self.document.expressions.get(argument.root) {
                ast::Expr::Name(name) => Some(&**name),
                _ => None,
            })
            .collect::<Option<_>>()?;
        Some(format!("{}({})", module.name, names.join(", ")))
    }

    /// The variables of a head, and how many there are with `t` and `age`.
    fn variables(
        &mut self,
        own: &HeadModule,
        left: &[HeadModule],
        right: &[HeadModule],
    ) -> (Variables, usize) {
        let mut names: HashMap<Arc<str>, NodeId> = HashMap::new();
        let mut spans: HashMap<Arc<str>, Span> = HashMap::new();
        let mut count = 0;
        for parameter in std::iter::once(own).chain(left).chain(right).flat_map(|m| &m.parameters) {
            let node = self.scope.graph.var(count);
            count += 1;
            if RESERVED.contains(&&*parameter.text) {
                self.error(
                    Diagnostic::error(format!("a parameter cannot be called `{}`", parameter.text))
                        .at(parameter.span, "this name stands for time in every rule"),
                );
            }
            if let Some(before) = spans.insert(parameter.text.clone(), parameter.span) {
                self.error(
                    Diagnostic::error(format!("two parameters of this head are called `{}`", parameter.text))
                        .at(parameter.span, "the second one")
                        .at(before, "the first one"),
                );
            }
            names.insert(parameter.text.clone(), node);
        }
        for name in RESERVED {
            let node = self.scope.graph.var(count);
            names.insert(name.into(), node);
            count += 1;
        }
        (Variables { names, ..Variables::default() }, count as usize)
    }

    fn not_a_bracket(&mut self, head: &HeadModule) -> bool {
        let bracket = matches!(&*head.name.text, "[" | "]");
        if bracket {
            self.error(
                Diagnostic::error("a bracket has no rules")
                    .at(head.name.span, "brackets structure the string; they do not develop"),
            );
        }
        let cut = &*head.name.text == CUT;
        if cut {
            self.error(
                Diagnostic::error("`%` has no rules and no context")
                    .at(head.name.span, "it cuts off the rest of its branch, and is gone at once"),
            );
        }
        !bracket && !cut
    }

    pub fn interpretation(
        &mut self,
        head: &HeadModule,
        drawn: &[ast::Module],
    ) -> Option<(KindId, Interpretation)> {
        if !self.not_a_bracket(head) {
            return None;
        }
        let (variables, count) = self.variables(head, &[], &[]);
        // What is only drawn does not develop: it makes no rule reachable.
        if let Some(cut) = drawn.iter().find(|module| &*module.name == CUT) {
            self.error(
                Diagnostic::error("a drawing cuts nothing off")
                    .at(cut.span, "`%` belongs into the successors of rules")
                    .help("to draw nothing, write `ε`"),
            );
        }
        let before = std::mem::take(&mut self.occurs);
        let drawn = self.successor(drawn, &variables, count);
        let inside = std::mem::replace(&mut self.occurs, before);
        let kind = self.kinds.intern(&head.name.text, head.parameters.len());
        self.drawn.extend(inside.into_iter().filter(|(other, _)| *other != kind));
        Some((kind, Interpretation { span: head.span, drawn: drawn? }))
    }

    /// A rule, and the kinds it is for. `PatternNames` are matched to kinds once all kinds are known.
    pub fn rule(&mut self, rule: &ast::Rule) -> Option<(Rule, Draft)> {
        let mut good = self.not_a_bracket(&rule.predecessor);
        for context in rule.left.iter().chain(&rule.right) {
            good &= self.not_a_bracket(context);
        }
        let names: &[&str] = match &*rule.predecessor.name.text {
            "±" => &["+", "-"],
            name => &[name],
        };
        let own = rule.predecessor.parameters.len();
        for name in names {
            self.kinds.intern(name, own);
        }
        let (mut variables, count) = self.variables(&rule.predecessor, &rule.left, &rule.right);
        self.scope.comparisons.clear();
        good &= self.locals(rule, &mut variables);

        // All conditions first: they share their atoms.
        let mut atoms = Atoms::default();
        let mut guards = Vec::new();
        for clause in &rule.clauses {
            let guard = match clause.guard {
                None => Some(Condition::default()),
                Some(guard) => {
                    let node = self.scope.condition(&self.document.expressions, guard, &variables);
                    node.and_then(|node| self.decompose(node, clause.span, &mut atoms))
                }
            };
            good &= guard.is_some();
            guards.push(guard.unwrap_or_default());
        }
        let mut drafts = Vec::new();
        let mut produces = Vec::new();
        for (clause, guard) in rule.clauses.iter().zip(guards) {
            match &clause.action {
                Action::Produce(modules) => match self.successor(modules, &variables, count) {
                    Some(successor) => produces.push(Produce { guard, span: clause.span, successor }),
                    None => good = false,
                },
                Action::Solve(equations) => {
                    let rates = self.equations(equations, &rule.predecessor, &variables);
                    let (rates, switches) = match rates {
                        Some(rates) => self.smooth(rates, own, count, clause.span, &mut atoms)?,
                        None => {
                            good = false;
                            continue;
                        }
                    };
                    drafts.push((guard, clause.span, rates, switches));
                }
            }
        }
        if !good {
            return None;
        }
        let context = count - own - 2;
        let mut draft = Draft { rates: Vec::new(), sides: atoms.sides.clone() };
        let solves = drafts
            .into_iter()
            .map(|(guard, span, rates, switches)| {
                let total = count + switches.len();
                let unreachable = (atoms.sides.iter())
                    .map(|&sides| never_reached(&self.scope.graph, sides, &rates, own, context, total))
                    .collect();
                let roots: Vec<NodeId> = rates.iter().map(|(_, node)| *node).collect();
                draft.rates.push(rates.clone());
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
                    watch: Vec::new(),
                    flashes: false,
                }
            })
            .collect();
        let sides: Vec<NodeId> = atoms.sides.iter().flat_map(|(a, b)| [*a, *b]).collect();
        let sides = Program::compile(&self.scope.graph, &sides, count);
        let pattern = |m: &HeadModule| Pattern { kinds: Vec::new(), arity: m.parameters.len() };
        let names = |m: &HeadModule| m.parameters.iter().map(|p| p.text.to_string()).collect::<Vec<_>>();
        let compiled = Rule {
            label: print::head(rule),
            span: rule.head,
            discrete: rule.discrete,
            parameters: names(&rule.predecessor),
            context_names: rule.left.iter().chain(&rule.right).flat_map(names).collect(),
            left: rule.left.iter().map(pattern).collect(),
            right: rule.right.iter().map(pattern).collect(),
            variables: count,
            watched: (0..count).map(|v| sides.reads().binary_search(&v).is_ok()).collect(),
            sides,
            atoms: atoms.spans,
            boundaries: atoms.boundaries,
            solves,
            produces,
            moving_context: Vec::new(),
            reads_context: false,
            watch_at_rest: Vec::new(),
        };
        Some((compiled, draft))
    }

    /// The derivatives of a `solve`, by parameter; those that are the constant 0 are left out.
    fn equations(
        &mut self,
        equations: &[ast::Equation],
        head: &HeadModule,
        variables: &Variables,
    ) -> Option<Vec<(usize, NodeId)>> {
        let mut rates: Vec<(usize, NodeId)> = Vec::new();
        let mut seen: HashMap<usize, Span> = HashMap::new();
        let mut good = true;
        for equation in equations {
            let name = &equation.parameter;
            let Some(parameter) = head.parameters.iter().position(|p| p.text == name.text) else {
                self.error(not_a_parameter(name, head, variables));
                good = false;
                continue;
            };
            if let Some(before) = seen.insert(parameter, name.span) {
                self.error(
                    Diagnostic::error(format!("two equations for `{}` in one `solve`", name.text))
                        .at(name.span, "the second one")
                        .at(before, "the first one"),
                );
                good = false;
            }
            match self.scope.number(&self.document.expressions, equation.rate, variables) {
                Some(rate) if self.scope.graph.as_constant(rate) == Some(0.0) => {}
                Some(rate) => rates.push((parameter, rate)),
                None => good = false,
            }
        }
        good.then_some(rates)
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
                        .at(span, format!("more than {MAX_CONDITION} comparisons and connectives")),
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
                    let (at, boundary) = known.map_or((span, ""), |(at, boundary)| (*at, boundary));
                    steps.push(atoms.step(a, b, comparison, at, boundary));
                }
                node => unreachable!("{node:?} is no condition"),
            }
        }
        Some(Condition(steps))
    }

    /// Wrong numbers of parameters: of words that have rules (or drawings), wherever they stand in a string (or a
    /// drawing). `place` says where the right number is.
    pub fn check_arities(&mut self, heads: &[&HeadModule], strings: &[&[ast::Module]], place: &str) {
        let mut declared: HashMap<&str, Vec<&HeadModule>> = HashMap::new();
        for &head in heads {
            declared.entry(&head.name.text).or_default().push(head);
        }
        let mut reported: HashSet<(&str, usize)> = HashSet::new();
        for module in strings.iter().copied().flatten() {
            // A symbol or surface may leave its parameters to the turtle's defaults.
            if class_of(&module.name) != Class::Word {
                continue;
            }
            let Some(heads) = declared.get(&*module.name) else { continue };
            let given = module.arguments.len();
            if heads.iter().any(|h| h.parameters.len() == given) || !reported.insert((&module.name, given)) {
                continue;
            }
            let error = Diagnostic::error(format!(
                "`{}` has {}, not {given}",
                module.name,
                plural(heads[0].parameters.len(), "parameter"),
            ))
            .at(module.span, format!("{} here", plural(given, "parameter")))
            .at(heads[0].span, format!("{} {place}", plural(heads[0].parameters.len(), "parameter")));
            self.error(error);
        }
    }

    /// Drawings of modules that neither the strings nor other drawings ever have.
    pub fn check_interpretations(&mut self, heads: &[&HeadModule]) {
        for head in heads {
            let name = &*head.name.text;
            let given = head.parameters.len();
            let seen = |kind| self.occurs.contains_key(&kind) || self.drawn.contains_key(&kind);
            if self.kinds.find(name, given).is_some_and(seen) {
                continue;
            }
            let mut error =
                Diagnostic::warning(format!("nothing is drawn as `{}`", print::head_module(head)))
                    .at(head.span, "no string and no other drawing has this module");
            let other = (self.occurs.iter().chain(&self.drawn))
                .filter(|(kind, _)| self.kinds.get(**kind).name == name)
                .min_by_key(|(_, span)| **span);
            if let Some((kind, span)) = other {
                let arity = self.kinds.get(*kind).arity;
                error = error.at(*span, format!("here it has {}", plural(arity, "parameter")));
            }
            self.error(error);
        }
    }

    /// The value of an expression of constants, for declarations such as `angle`.
    pub fn constant(&mut self, expression: Expression) -> Option<f64> {
        self.scope.constant_value(&self.document.expressions, expression)
    }
}

fn not_a_parameter(name: &ast::Name, head: &HeadModule, variables: &Variables) -> Diagnostic {
    let known = head.parameters.iter().map(|p| &*p.text);
    let error =
        Diagnostic::error(format!("`{}` is no parameter of `{}`", name.text, print::head_module(head)))
            .at(name.span, "only the parameters of the strict predecessor have equations")
            .at(head.span, "the strict predecessor");
    if variables.lets.contains_key(&name.text) {
        return error.help("a `let` names an expression; nothing is stored that could be solved");
    }
    if variables.names.contains_key(&name.text) && !RESERVED.contains(&&*name.text) {
        return error
            .help("this is a parameter of a neighbour; its equation belongs into the neighbour's rule");
    }
    error.help_opt(did_you_mean(&name.text, known))
}

impl Atoms {
    /// The step that compares two sides; each pair is kept once, whichever way round it is written.
    fn step(&mut self, a: NodeId, b: NodeId, comparison: Comparison, span: Span, boundary: &str) -> Step {
        let (pair, comparison) = if a <= b { ((a, b), comparison) } else { ((b, a), comparison.mirrored()) };
        let atom = *self.index.entry(pair).or_insert_with(|| {
            self.sides.push(pair);
            self.spans.push(span);
            self.boundaries.push(boundary.to_owned());
            self.sides.len() as u32 - 1
        });
        Step::Atom(atom, comparison)
    }
}
