//! What rules read of the surroundings, `strain` and `force_x`, `force_y`, `force_z`: the kinds whose rules do, their hidden parameters, and the places
//! that cannot read it.
//!
//! A kind whose rules read such a quantity has two hidden parameters for it behind its clocks: the value, and the slope with which it goes
//! on until the surroundings give the next one. The value is a parameter with the slope as its rate, so that closed forms, event
//! location and step control treat it as any other. A name of the model hides that of a quantity.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::{FxHashMap, FxHashSet};

use crate::chance::{group, sort};
use crate::rules::RuleBuilder;
use crate::scope::{Scope, Variables};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::NodeId;
use dlsys_model::{Input, Kinds, Model, Quantity};
use dlsys_syntax::ast::{self, Action, Document, Expr, ExprId, Expression, Expressions, HeadModule, Item};

/// The name of the state of the ground among the variables of a rule, which nobody can write.
pub(super) const LAYER: &str = "ground ";

/// The quantity of a name in expressions.
pub(super) fn named(name: &str) -> Option<Quantity> {
    Quantity::NAMED.into_iter().find(|quantity| quantity.name() == name)
}

/// A range of nodes of expressions, the last included.
type Nodes = (u32, u32);

/// Name and number of parameters of a predecessor.
type Head = (String, usize);

/// The kinds whose rules read what the surroundings give.
#[derive(Default)]
pub struct Inputs {
    readers: FxHashMap<Head, BTreeSet<Quantity>>,
    /// The same for all kinds that one context pattern may match.
    groups: FxHashMap<Head, BTreeSet<Quantity>>,
    /// The rules that read a quantity, each by its first expression.
    rules: FxHashSet<(ExprId, Quantity)>,
    /// The first place in the rules of a kind that reads a quantity, in the order of the text.
    places: Vec<(Head, Quantity, Span)>,
    /// The model declares a sheet, with or without a mistake.
    has_sheet: bool,
}

impl Inputs {
    /// Finds the rules that read them, unless the model declares a name of its own.
    pub fn new(document: &Document, scope: &Scope) -> Inputs {
        let mut inputs = Inputs::default();
        let built_in = Quantity::NAMED.into_iter().filter(|quantity| !is_declared(scope, quantity.name()));
        let mut built_in: Vec<Quantity> = built_in.collect();
        if scope.land.moves() && !is_declared(scope, Quantity::Ground.name()) {
            built_in.push(Quantity::Ground);
        }
        for (item, _) in &document.items {
            inputs.has_sheet |= matches!(item, Item::Sheet { .. });
            let Item::Rule(rule) = item else { continue };
            for &quantity in &built_in {
                let place = match quantity {
                    Quantity::Ground => first_call(&document.expressions, rule, quantity.name()),
                    _ => first_read(&document.expressions, rule, quantity.name()),
                };
                let Some(place) = place else { continue };
                let (name, arity) = (&rule.predecessor.name.text, rule.predecessor.parameters.len());
                let head = (sort(name).into_owned(), arity);
                inputs.readers.entry(head.clone()).or_default().insert(quantity);
                inputs.groups.entry((group(name).into_owned(), arity)).or_default().insert(quantity);
                inputs.rules.insert((rule.nodes.0, quantity));
                inputs.places.push((head, quantity, place));
            }
        }
        inputs
    }

    /// The quantities in the hidden parameters of a kind.
    pub fn of(&self, name: &str, arity: usize) -> Vec<Input> {
        if self.groups.is_empty() {
            return Vec::new();
        }
        let Some(all) = self.groups.get(&(group(name).into_owned(), arity)) else { return Vec::new() };
        let read = self.readers.get(&(sort(name).into_owned(), arity));
        let input = |&quantity: &Quantity| {
            let is_read = read.is_some_and(|read| read.contains(&quantity));
            Input { quantity, is_read }
        };
        all.iter().map(input).collect()
    }

    /// Stores them in the kinds.
    pub fn assign(&self, kinds: &mut Kinds) {
        if self.groups.is_empty() {
            return;
        }
        let all: Vec<_> = kinds.iter().map(|(id, kind)| (id, self.of(&kind.name, kind.arity))).collect();
        for (id, inputs) in all {
            kinds.get_mut(id).inputs = inputs;
        }
    }

    /// The first place that reads a quantity of some sort.
    fn first(&self, sort: impl Fn(Quantity) -> bool) -> Option<(Quantity, Span)> {
        let of_sort = self.places.iter().filter(|(_, quantity, _)| sort(*quantity));
        of_sort.map(|(_, quantity, span)| (*quantity, *span)).min_by_key(|(_, span)| span.start)
    }
}

/// What the modules of a string take over from the module that they replace.
#[derive(Clone, Default)]
pub struct Handing {
    /// The quantities of the module that is replaced, with the numbers of their parameters.
    parent: BTreeMap<Quantity, usize>,
    /// A module before has taken over the forces: they act once.
    forces_are_taken: bool,
}

impl Handing {
    /// Before the first module of a string.
    pub fn restart(&mut self) {
        self.forces_are_taken = false;
    }

    /// After two strings of which one is made.
    pub fn join(&mut self, other: &Handing) {
        self.forces_are_taken |= other.forces_are_taken;
    }
}

impl RuleBuilder<'_> {
    /// Numbers of the hidden parameters that the rules of a predecessor read.
    fn read_inputs(&self, head: &HeadModule) -> BTreeMap<Quantity, usize> {
        let (name, arity) = (&head.name.text, head.parameters.len());
        let first = arity + self.clocks.width(name, arity);
        let all = self.inputs.of(name, arity).into_iter().enumerate();
        all.filter(|(_, input)| input.is_read).map(|(i, input)| (input.quantity, first + 2 * i)).collect()
    }

    /// Makes the names known to a rule that reads them.
    pub(super) fn name_inputs(&mut self, rule: &ast::Rule, variables: &mut Variables) {
        for (quantity, parameter) in self.read_inputs(&rule.predecessor) {
            if self.inputs.rules.contains(&(rule.nodes.0, quantity)) {
                let node = self.scope.graph.var(parameter as u32);
                let name = if quantity == Quantity::Ground { LAYER } else { quantity.name() };
                variables.names.insert(name.into(), node);
            }
        }
    }

    /// The equations: the rate of a value is its slope, which is constant. Discrete rules have no equations, and the number of a ground does not move.
    pub(super) fn input_rates(&mut self, rule: &ast::Rule) -> Vec<(usize, NodeId)> {
        if rule.discrete {
            return Vec::new();
        }
        let read = self.read_inputs(&rule.predecessor).into_iter();
        let moving = read.filter(|(quantity, _)| *quantity != Quantity::Ground);
        moving.map(|(_, parameter)| (parameter, self.scope.graph.var(parameter as u32 + 1))).collect()
    }

    /// Before the productions of a rule are lowered.
    pub(super) fn begin_handing(&mut self, head: &HeadModule) {
        self.handing = Handing { parent: self.read_inputs(head), forces_are_taken: false };
    }

    /// Values and slopes of a new module. The strain is that of the module that it replaces, if it draws a part of the same stem: a branch begins
    /// unbent. Forces go on to the first module that reads one.
    pub(super) fn inputs_of_new(&mut self, module: &ast::Module, in_branch: bool) -> Vec<NodeId> {
        let inputs = self.inputs.of(&module.name, module.arguments.len());
        let mut values = Vec::with_capacity(2 * inputs.len());
        let (mut takes_force, taken) = (false, self.handing.forces_are_taken);
        for input in inputs {
            let is_force = input.quantity.is_force();
            let is_barred = match input.quantity {
                Quantity::Strain => in_branch,
                Quantity::Force(_) => taken,
                // Simulations give each new module the present one.
                Quantity::Ground => true,
            };
            takes_force |= is_force && input.is_read;
            let from = self.handing.parent.get(&input.quantity).filter(|_| input.is_read && !is_barred);
            let graph = &mut self.scope.graph;
            values.extend([0, 1].map(|i| match from {
                Some(parameter) => graph.var((parameter + i) as u32),
                None => graph.constant(0.0),
            }));
        }
        self.handing.forces_are_taken |= takes_force;
        values
    }
}

/// The error of a quantity outside rules.
pub(super) fn misplaced(quantity: Quantity, span: Span) -> Diagnostic {
    let name = quantity.name();
    let what = match quantity {
        Quantity::Force(_) => "the force on a solid is known in the rules of its module only",
        Quantity::Strain => "the bending strain of a module is known in its own rules only",
        Quantity::Ground => "the height of soil, which may move, is known in rules only",
    };
    let short = &name[..1];
    Diagnostic::error(format!("`{name}` has no meaning here")).at(span, what).help(format!("read it in a condition, an equation or a successor of the module's rule, and pass its value on: to a function as an argument, to a drawing or a neighbour as a parameter (`solve {short} = {name}`)"))
}

/// Reports rules that read what nothing gives.
pub(super) fn check(model: &Model, inputs: &Inputs, diagnostics: &mut Vec<Diagnostic>) {
    let strain = inputs.first(|quantity| quantity == Quantity::Strain);
    let force = inputs.first(Quantity::is_force);
    if let (Some((_, ground)), Some((quantity, other))) =
        (inputs.first(|quantity| quantity == Quantity::Ground), strain.or(force))
    {
        let (name, what) = (quantity.name(), if quantity.is_force() { "sheets and soil" } else { "stems" });
        diagnostics.push(
            Diagnostic::error(format!("rules read both `ground` and `{name}`"))
                .at(ground, "the height of soil that may move")
                .at(other, format!("what {what} do"))
                .help(format!("growth goes on in turn with its ground or with its {what}: let the rules do without one of them, make two models, or declare a rigid ground, as in `ground 0`")),
        );
        return;
    }
    if let Some((_, span)) = strain.filter(|_| model.scenery.tissues.is_empty()) {
        diagnostics.push(
            Diagnostic::error("`strain` reads the bending of stems, and nothing bends here")
                .at(span, "the model declares no tissue")
                .help("declare a material, as in `tissue wood = stiffness 1e9, density 800, damping 0.05`, and put `@E(wood)` before the stems that give way"),
        );
    }
    let blows = model.scenery.wind.is_some() || !model.scenery.flows.is_empty();
    if let (Some((_, span)), Some((_, solid)), true) = (strain, model.scenery.solids.first(), blows) {
        diagnostics.push(
            Diagnostic::error("rules read `strain`, and bodies push the wind")
                .at(span, "how a stem bends in the wind")
                .at(*solid, "what the wind is pushed by")
                .help("growth would follow the wind, and the wind its bodies, at one and the same time: leave out `solid`, or let the rules do without `strain`"),
        );
        return;
    }
    let Some((quantity, span)) = force else { return };
    let name = quantity.name();
    if !inputs.has_sheet && model.scenery.bed.is_none() {
        diagnostics.push(
            Diagnostic::error(format!("`{name}` reads what sheets and soil do to a solid, and there is neither here"))
                .at(span, "the model declares no sheet, and no ground of soil")
                .help("declare a sheet, as in `sheet @Net from \"net.obj\" of rope pinned y > 2.99`, and place it: `[ @Net ]`")
                .help("or ground that gives way: `soil dry = sand`, `ground dry cell 0.02 extent 2`"),
        );
        return;
    }
    if let Some((_, other)) = strain {
        diagnostics.push(
            Diagnostic::error(format!("rules read both `strain` and `{name}`"))
                .at(span, "what sheets and soil do to a solid")
                .at(other, "how a stem bends")
                .help("growth goes on in turn with its stems or with its sheets and soil: let the rules do without one of them, or make two models"),
        );
        return;
    }
    let mut told: FxHashSet<&Head> = FxHashSet::default();
    for (head, quantity, span) in inputs.places.iter().filter(|(_, quantity, _)| quantity.is_force()) {
        let (kind, arity) = head;
        let is_solid = model
            .kinds
            .find(kind, *arity)
            .is_none_or(|id| model.scenery.solids.iter().any(|(solid, _)| *solid == id));
        if !is_solid && told.insert(head) {
            diagnostics.push(
                Diagnostic::error(format!("`{kind}` is not solid, so that nothing pushes it"))
                    .at(*span, format!("`{}` is the force of sheets and soil on a solid", quantity.name()))
                    .help(format!("declare that sheets and soil meet what it draws: `solid {kind}`")),
            );
        }
    }
}

fn is_declared(scope: &Scope, name: &str) -> bool {
    scope.constants.contains_key(name)
        || scope.functions.contains_key(name)
        || scope.curves.contains_key(name)
        || scope.arrays.contains_key(name)
        || scope.poisoned.contains(name)
}

/// The first place of a rule that calls a function.
fn first_call(all: &Expressions, rule: &ast::Rule, wanted: &str) -> Option<Span> {
    let calls = |id: &u32| matches!(all.get(ExprId(*id)), Expr::Call(name, _) if &**name == wanted);
    (rule.nodes.0.0..rule.nodes.1.0).find(calls).map(|id| all.span(ExprId(id)))
}

/// The first place of a rule that reads a name and means the built-in one.
fn first_read(all: &Expressions, rule: &ast::Rule, wanted: &str) -> Option<Span> {
    let is_named = |head: &HeadModule| head.parameters.iter().any(|p| &*p.text == wanted);
    let mut heads = std::iter::once(&rule.predecessor).chain(&rule.left).chain(&rule.right);
    if heads.any(is_named) || rule.locals.iter().any(|(name, _)| &*name.text == wanted) {
        return None;
    }
    let nodes = rule.nodes.0.0..rule.nodes.1.0;
    let reads = |id: &u32| matches!(all.get(ExprId(*id)), Expr::Name(name) if &**name == wanted);
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
            alternatives.iter().for_each(|a| hide_indices(&a.modules, (wanted, false), &mut hidden));
        }
    }
    let is_free = |id: &u32| !hidden.iter().any(|(first, last)| (first..=last).contains(&id));
    read.find(is_free).map(|id| all.span(ExprId(id)))
}

fn range(expression: Expression) -> Nodes {
    (expression.first.0, expression.root.0)
}

/// Collects the expressions of a string in which a name is the index of a repetition; everywhere if `inside`.
fn hide_indices(parts: &[ast::Part], (wanted, inside): (&str, bool), hidden: &mut Vec<Nodes>) {
    for part in parts {
        match part {
            ast::Part::Module(module) if inside => hidden.extend(module.arguments.iter().map(|a| range(*a))),
            ast::Part::Module(_) => {}
            ast::Part::Repeat(of) => {
                if inside {
                    hidden.extend([range(of.from), range(of.to)]);
                }
                hide_indices(&of.body, (wanted, inside || &*of.index.text == wanted), hidden);
            }
            ast::Part::If(of) => {
                hidden.extend(inside.then(|| range(of.condition)));
                hide_indices(&of.then, (wanted, inside), hidden);
                hide_indices(&of.otherwise, (wanted, inside), hidden);
            }
        }
    }
}
