//! `strain` in rules: the kinds whose rules read it, their hidden parameters, and the places that cannot read it.
//!
//! A kind whose rules read `strain` has two hidden parameters behind its clocks: the strain, and the slope with which it goes on
//! until the surroundings give the next value. The strain is a parameter with the slope as its rate, so that closed forms, event
//! location and step control treat it as any other. A name of the model hides `strain`.

use std::collections::HashSet;

use crate::chance::{group, sort};
use crate::rules::RuleBuilder;
use crate::scope::{Scope, Variables};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::NodeId;
use dlsys_model::{Kinds, Model, Strain};
use dlsys_syntax::ast::{self, Action, Document, Expr, ExprId, Expression, Expressions, HeadModule, Item};

/// The name in expressions.
pub(super) const NAME: &str = "strain";

/// A range of nodes of expressions, the last included.
type Nodes = (u32, u32);

/// The kinds whose rules read `strain`.
#[derive(Default)]
pub struct Strains {
    /// By name and number of parameters of the predecessor.
    readers: HashSet<(String, usize)>,
    /// The same for all kinds that one context pattern may match.
    groups: HashSet<(String, usize)>,
    /// The rules that read it, each by its first expression.
    rules: HashSet<ExprId>,
    /// The first place that reads it.
    pub first: Option<Span>,
}

impl Strains {
    /// Finds the rules that read `strain`; none if the model declares a name of its own.
    pub fn new(document: &Document, scope: &Scope) -> Strains {
        let mut strains = Strains::default();
        if is_declared(scope) {
            return strains;
        }
        for (item, _) in &document.items {
            let Item::Rule(rule) = item else { continue };
            let Some(place) = first_read(&document.expressions, rule) else { continue };
            let (name, arity) = (&rule.predecessor.name.text, rule.predecessor.parameters.len());
            strains.readers.insert((sort(name).into_owned(), arity));
            strains.groups.insert((group(name).into_owned(), arity));
            strains.rules.insert(rule.nodes.0);
            strains.first = strains.first.or(Some(place));
        }
        strains
    }

    /// The hidden parameters of a kind.
    pub fn of(&self, name: &str, arity: usize) -> Strain {
        if !self.groups.contains(&(group(name).into_owned(), arity)) {
            Strain::Absent
        } else if self.readers.contains(&(sort(name).into_owned(), arity)) {
            Strain::Read
        } else {
            Strain::Unread
        }
    }

    /// Stores them in the kinds.
    pub fn assign(&self, kinds: &mut Kinds) {
        if self.groups.is_empty() {
            return;
        }
        let all: Vec<_> = kinds.iter().map(|(id, kind)| (id, self.of(&kind.name, kind.arity))).collect();
        for (id, strain) in all {
            kinds.get_mut(id).strain = strain;
        }
    }
}

impl RuleBuilder<'_> {
    /// Number of the hidden parameter `strain` among the variables of a rule with this predecessor.
    pub(super) fn strain_parameter(&self, head: &HeadModule) -> Option<usize> {
        let (name, arity) = (&head.name.text, head.parameters.len());
        (self.strains.of(name, arity) == Strain::Read).then(|| arity + self.clocks.width(name, arity))
    }

    /// Makes the name known to a rule that reads it.
    pub(super) fn name_strain(&mut self, rule: &ast::Rule, variables: &mut Variables) {
        if self.strains.rules.contains(&rule.nodes.0)
            && let Some(parameter) = self.strain_parameter(&rule.predecessor)
        {
            let node = self.scope.graph.var(parameter as u32);
            variables.names.insert(NAME.into(), node);
        }
    }

    /// The equation of the strain: its rate is the slope, which is constant. Discrete rules have no equations.
    pub(super) fn strain_rate(&mut self, rule: &ast::Rule) -> Option<(usize, NodeId)> {
        let parameter = self.strain_parameter(&rule.predecessor).filter(|_| !rule.discrete)?;
        Some((parameter, self.scope.graph.var(parameter as u32 + 1)))
    }

    /// Strain and slope of a new module: those of the module that it replaces, if it draws a part of the same stem; a branch begins
    /// unbent.
    pub(super) fn strain_of_new(&mut self, module: &ast::Module, in_branch: bool) -> Vec<NodeId> {
        let strain = self.strains.of(&module.name, module.arguments.len());
        let same_stem = self.parent_strain.filter(|_| strain == Strain::Read && !in_branch);
        (0..strain.width())
            .map(|i| match same_stem {
                Some(parameter) => self.scope.graph.var((parameter + i) as u32),
                None => self.scope.graph.constant(0.0),
            })
            .collect()
    }
}

/// The error of a `strain` outside rules.
pub(super) fn misplaced(span: Span) -> Diagnostic {
    Diagnostic::error("`strain` has no meaning here")
        .at(span, "the bending strain of a module is known in its own rules only")
        .help("read it in a condition, an equation or a successor of the module's rule, and pass its value on: to a function as an argument, to a drawing or a neighbour as a parameter (`solve s = strain`)")
}

/// Reports a model that reads `strain` where nothing bends.
pub(super) fn check(model: &Model, first: Option<Span>, diagnostics: &mut Vec<Diagnostic>) {
    let Some(span) = first.filter(|_| model.scenery.tissues.is_empty()) else { return };
    diagnostics.push(
        Diagnostic::error("`strain` reads the bending of stems, and nothing bends here")
            .at(span, "the model declares no tissue")
            .help("declare a material, as in `tissue wood = stiffness 1e9, density 800, damping 0.05`, and put `@E(wood)` before the stems that give way"),
    );
}

fn is_declared(scope: &Scope) -> bool {
    scope.constants.contains_key(NAME)
        || scope.functions.contains_key(NAME)
        || scope.curves.contains_key(NAME)
        || scope.arrays.contains_key(NAME)
        || scope.poisoned.contains(NAME)
}

/// The first place of a rule that reads `strain` and means the built-in one.
fn first_read(all: &Expressions, rule: &ast::Rule) -> Option<Span> {
    let is_named = |head: &HeadModule| head.parameters.iter().any(|p| &*p.text == NAME);
    let mut heads = std::iter::once(&rule.predecessor).chain(&rule.left).chain(&rule.right);
    if heads.any(is_named) || rule.locals.iter().any(|(name, _)| &*name.text == NAME) {
        return None;
    }
    let nodes = rule.nodes.0.0..rule.nodes.1.0;
    let reads = |id: &u32| matches!(all.get(ExprId(*id)), Expr::Name(name) if &**name == NAME);
    let mut read = nodes.clone().filter(reads).peekable();
    read.peek()?;
    // Names of indices and of children hold in a part of the rule.
    let mut hidden: Vec<Nodes> = Vec::new();
    for id in nodes {
        if let Expr::Aggregate(aggregate) = all.get(ExprId(id))
            && is_named(&aggregate.head)
        {
            hidden.extend(aggregate.term.map(range));
        }
    }
    for clause in &rule.clauses {
        if let Action::Produce(alternatives) = &clause.action {
            alternatives.iter().for_each(|a| hide_indices(&a.modules, false, &mut hidden));
        }
    }
    let is_free = |id: &u32| !hidden.iter().any(|(first, last)| (first..=last).contains(&id));
    read.find(is_free).map(|id| all.span(ExprId(id)))
}

fn range(expression: Expression) -> Nodes {
    (expression.first.0, expression.root.0)
}

/// Collects the expressions of a string in which `strain` is the index of a repetition; everywhere if `inside`.
fn hide_indices(parts: &[ast::Part], inside: bool, hidden: &mut Vec<Nodes>) {
    for part in parts {
        match part {
            ast::Part::Module(module) if inside => hidden.extend(module.arguments.iter().map(|a| range(*a))),
            ast::Part::Module(_) => {}
            ast::Part::Repeat(of) => {
                if inside {
                    hidden.extend([range(of.from), range(of.to)]);
                }
                hide_indices(&of.body, inside || &*of.index.text == NAME, hidden);
            }
            ast::Part::If(of) => {
                hidden.extend(inside.then(|| range(of.condition)));
                hide_indices(&of.then, inside, hidden);
                hide_indices(&of.otherwise, inside, hidden);
            }
        }
    }
}
