//! The clauses of a rule, lowered to the graph: conditions, productions and equations.

use std::borrow::Cow;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::analysis::never_reached;
use crate::chance::{Hazard, production_keys};
use crate::conditions::Atoms;
use crate::declared::{DeclaredRule, DeclaredSolve};
use crate::equations::Equations;
use crate::inputs::Handing;
use crate::rules::RuleBuilder;
use crate::scope::Variables;
use dlsys_diagnostic::Span;
use dlsys_expr::{Graph, NodeId};
use dlsys_model::{Clock, Condition, ContextPart, Input, Produce, Switch, base_of};
use dlsys_syntax::ast::{self, Action, Document, HeadModule, Item};
use dlsys_syntax::print;

/// The variables of the current rule.
struct Frame<'r> {
    rule: &'r ast::Rule,
    variables: Variables,
    /// Number of the strict predecessor's parameters, hidden ones included.
    own: usize,
    /// Number of all variables, switches excluded.
    count: usize,
}

/// Equations, the numbers of the module's parameters, of those of the context, and of all variables.
type Flow = (Vec<(usize, NodeId)>, [usize; 3]);

/// By flow and by the two sides of an atom: true if the flow cannot make them equal. Rules that differ in names only have the same
/// expressions.
#[derive(Default)]
pub struct OutOfReach(FxHashMap<Flow, FxHashMap<(NodeId, NodeId), bool>>);

/// The condition of a clause.
#[derive(Default)]
struct Guard {
    condition: Condition,
    /// The whole condition; None if there is none.
    node: Option<NodeId>,
}

/// The productions of a rule.
#[derive(Default)]
struct Productions {
    produces: Vec<Produce>,
    clocks: Vec<Clock>,
    hazards: Vec<Hazard>,
}

/// The equations of a clause, smooth between the changes of its switches.
struct Smooth {
    guard: Condition,
    span: Span,
    equations: Equations,
    switches: Vec<Switch>,
}

/// Parameters by name of the module, without its index, and the number of its parameters: those that some rule moves; None if it may move
/// all of them.
pub type MovingParameters = FxHashMap<(Arc<str>, usize), Option<FxHashSet<usize>>>;

/// The parameters that the rules of a document move.
pub fn moving_parameters(document: &Document) -> MovingParameters {
    let mut all = MovingParameters::default();
    let rules = document.items.iter().filter_map(|(item, _)| match item {
        Item::Rule(rule) => Some(rule),
        _ => None,
    });
    for rule in rules {
        let HeadModule { name, parameters, .. } = &rule.predecessor;
        let moving = moving(rule);
        // One rule may stand for both turns.
        let names: &[&str] = if &*name.text == "±" { &["+", "-"] } else { &[base_of(&name.text)] };
        for &name in names {
            let known =
                all.entry((name.into(), parameters.len())).or_insert_with(|| Some(FxHashSet::default()));
            match (known.as_mut(), &moving) {
                (Some(known), Some(moving)) => known.extend(moving),
                _ => *known = None,
            }
        }
    }
    all
}

/// The parameters of a module that some clause of its rule gives an equation or a value; None if some equation does not say for what it is
/// solved.
fn moving(rule: &ast::Rule) -> Option<FxHashSet<usize>> {
    let equations = rule.clauses.iter().filter_map(|clause| match &clause.action {
        Action::Solve(equations) => Some(equations),
        _ => None,
    });
    let mut moving: Vec<&str> = Vec::new();
    for equation in equations.flatten() {
        match equation {
            ast::Equation::Rate { parameter, .. } | ast::Equation::Value { parameter, .. } => {
                moving.push(&parameter.text);
            }
            ast::Equation::Zero { unknown: Some(unknown), .. } => moving.push(&unknown.text),
            ast::Equation::Zero { unknown: None, .. } => return None,
        }
    }
    let all = rule.predecessor.parameters.iter().enumerate();
    Some(all.filter(|(_, parameter)| moving.contains(&&*parameter.text)).map(|(number, _)| number).collect())
}

impl RuleBuilder<'_> {
    /// The variables of a rule, parameters of its module and of the context, that no rule moves.
    fn steady(&self, rule: &ast::Rule) -> Vec<u32> {
        let mut steady = Vec::new();
        let mut first = 0;
        let own = moving(rule);
        for (i, module) in std::iter::once(&rule.predecessor).chain(&rule.left).chain(&rule.right).enumerate()
        {
            let key = (base_of(&module.name.text).into(), module.parameters.len());
            let moves = |parameter: &usize| match (i, self.moving.get(&key)) {
                (0, _) => own.as_ref().is_none_or(|own| own.contains(parameter)),
                (_, Some(moving)) => moving.as_ref().is_none_or(|moving| moving.contains(parameter)),
                (_, None) => false,
            };
            let rest = (0..module.parameters.len()).filter(|parameter| !moves(parameter));
            steady.extend(rest.map(|parameter| (first + parameter) as u32));
            first += module.parameters.len() + self.hidden(module);
        }
        steady
    }

    /// Lowers a rule, which gets this index among those of the model. None if it has errors, which have been reported.
    pub fn rule(&mut self, rule: &ast::Rule, index: usize) -> Option<DeclaredRule> {
        let mut good = self.not_a_bracket(&rule.predecessor, false);
        for context in rule.left.iter().chain(&rule.right) {
            good &= self.not_a_bracket(context, true);
        }
        for name in names_of(rule) {
            self.kinds.intern(&name, rule.predecessor.parameters.len());
        }
        let written = self.aggregates_in(rule);
        let own = rule.predecessor.parameters.len() + self.hidden(&rule.predecessor);
        let (mut variables, count) = self.variables(&rule.predecessor, &rule.left, &rule.right, written);
        self.name_inputs(rule, &mut variables);
        self.scope.comparisons.clear();
        self.scope.gathered.clear();
        good &= self.locals(rule, &mut variables);
        let frame = Frame { rule, variables, own, count };
        let first_aggregate = count - 2 - written as usize;
        let mut atoms = Atoms::of(self.steady(rule), first_aggregate as u32);
        let guards = self.guards(&frame, &mut atoms, &mut good);
        self.begin_handing(&rule.predecessor);
        let productions = self.productions(&frame, &guards, &mut atoms, &mut good);
        self.handing = Handing::default();
        let productions = productions?;
        let smooth = self.smooth_clauses(&frame, &guards, &productions, &mut atoms, &mut good)?;
        if !good {
            return None;
        }
        let aggregates = self.aggregates();
        let solves = self.declare_solves(&frame, smooth, &atoms);
        Some(DeclaredRule {
            index,
            label: print::head(rule),
            span: rule.head,
            discrete: rule.discrete,
            parameters: self.names(&rule.predecessor),
            context_names: rule.left.iter().chain(&rule.right).flat_map(|m| self.names(m)).collect(),
            left: rule.left.iter().map(|m| self.pattern(m.clone())).collect(),
            right: rule.right.iter().map(|m| self.pattern(m.clone())).collect(),
            right_shape: rule.right_shape.iter().map(|part| turn(*part)).collect(),
            aggregates,
            first_aggregate,
            variables: count,
            sides: atoms.sides,
            atoms: atoms.spans,
            boundaries: atoms.boundaries,
            jumping: atoms.jumping,
            solves,
            produces: productions.produces,
            hidden: self.hidden(&rule.predecessor),
            clocks: productions.clocks,
        })
    }

    /// Lowers the conditions of all clauses, which share their atoms and therefore come first.
    fn guards(&mut self, frame: &Frame, atoms: &mut Atoms, good: &mut bool) -> Vec<Guard> {
        let mut guards = Vec::with_capacity(frame.rule.clauses.len());
        for clause in &frame.rule.clauses {
            let Some(guard) = clause.guard else {
                guards.push(Guard::default());
                continue;
            };
            let node = self.scope.condition(&self.document.expressions, guard, &frame.variables);
            atoms.of_productions = matches!(clause.action, ast::Action::Produce(_));
            let condition = match (node, &clause.hazard) {
                // The clock determines the time of an event at a rate.
                (Some(_), Some(_)) => Some(Condition::default()),
                (node, _) => node.and_then(|node| self.decompose(node, clause.span, atoms)),
            };
            *good &= condition.is_some();
            guards.push(Guard { condition: condition.unwrap_or_default(), node });
        }
        atoms.of_productions = false;
        guards
    }

    /// Lowers the productions, with the clocks of events at a rate; the checks for negative rates follow the productions.
    fn productions(
        &mut self,
        frame: &Frame,
        guards: &[Guard],
        atoms: &mut Atoms,
        good: &mut bool,
    ) -> Option<Productions> {
        let mut all = Productions::default();
        let mut faults = Vec::new();
        let mut keys = production_keys(frame.rule);
        for (clause, written) in frame.rule.clauses.iter().zip(guards) {
            let Action::Produce(successors) = &clause.action else { continue };
            let key = keys.next().map_or(0, |(_, key)| key);
            let mut guard = written.condition.clone();
            if clause.hazard.is_some() {
                let head = (&frame.rule.predecessor, key);
                match self.hazard(clause, head, written.node, &frame.variables) {
                    Some(hazard) => {
                        guard = self.clock_is_down(&hazard, atoms)?;
                        faults.extend(self.negative_rate(&hazard, clause.span, frame.count, atoms));
                        all.clocks.push(Clock { parameter: hazard.parameter, produce: all.produces.len() });
                        all.hazards.push(hazard);
                    }
                    None => *good = false,
                }
            }
            match self.outcome(successors, &frame.variables, frame.count) {
                Some(outcome) => {
                    all.produces.push(Produce { guard, span: clause.span, key, is_fault: false, outcome })
                }
                None => *good = false,
            }
        }
        all.produces.extend(faults);
        Some(all)
    }

    /// Lowers the equations of all `solve` clauses and replaces their conditions with switches.
    fn smooth_clauses(
        &mut self,
        frame: &Frame,
        guards: &[Guard],
        productions: &Productions,
        atoms: &mut Atoms,
        good: &mut bool,
    ) -> Option<Vec<Smooth>> {
        let &Frame { rule, own, count, .. } = frame;
        let hazards = &productions.hazards;
        let mut all = Vec::new();
        for (clause, guard) in rule.clauses.iter().zip(guards) {
            let Action::Solve(equations) = &clause.action else { continue };
            let equations = self.equations(equations, &rule.predecessor, &frame.variables, clause.span);
            let Some(mut equations) = equations else {
                *good = false;
                continue;
            };
            equations.rates.extend(hazards.iter().filter_map(|hazard| self.clock_rate(hazard, guard.node)));
            equations.rates.extend(self.input_rates(rule));
            let (smooth, switches) =
                self.smooth_as_before(equations.all(), own, count, clause.span, atoms)?;
            equations.set_all(smooth);
            all.push(Smooth { guard: guard.condition.clone(), span: clause.span, equations, switches });
        }
        let clock = productions.clocks.first();
        let inputs = self.input_rates(rule);
        if *good && all.is_empty() && (clock.is_some() || !inputs.is_empty()) {
            // Clocks and inputs go on even if the rule has no other equation.
            let span = clock.map_or(rule.head, |first| productions.produces[first.produce].span);
            let clocks = hazards.iter().filter_map(|hazard| self.clock_rate(hazard, None));
            let rates = clocks.collect::<Vec<_>>().into_iter().chain(inputs).collect();
            let (rates, switches) = self.smooth_as_before(rates, own, count, span, atoms)?;
            let equations = Equations { rates, algebraic: Vec::new() };
            all.push(Smooth { guard: Condition::default(), span, equations, switches });
        }
        Some(all)
    }

    /// Determines for each clause the atoms whose zero its flow cannot reach.
    fn declare_solves(&mut self, frame: &Frame, clauses: Vec<Smooth>, atoms: &Atoms) -> Vec<DeclaredSolve> {
        let context = frame.count - frame.own - 2;
        let mut solves = Vec::with_capacity(clauses.len());
        for Smooth { guard, span, equations: Equations { rates, algebraic }, switches } in clauses {
            let total = frame.count + switches.len();
            let graph = &mut self.scope.graph;
            // The analysis applies only to parameters with rates.
            let given = |graph: &Graph, (a, b): (NodeId, NodeId)| {
                let read = graph.variables(&[a, b]);
                algebraic.iter().any(|entry| read.contains(&(entry.parameter as u32)))
            };
            let known = self.out_of_reach.0.entry((rates.clone(), [frame.own, context, total])).or_default();
            let mut is_never = |graph: &mut Graph, sides: (NodeId, NodeId)| {
                let find = || never_reached(graph, sides, &rates, frame.own, context, total);
                *known.entry(sides).or_insert_with(find)
            };
            let unreachable =
                atoms.sides.iter().map(|&sides| !given(graph, sides) && is_never(graph, sides)).collect();
            solves.push(DeclaredSolve { guard, span, rates, algebraic, switches, unreachable });
        }
        solves
    }

    /// The names of a module's parameters, hidden ones last.
    fn names(&self, module: &HeadModule) -> Vec<String> {
        let (name, arity) = (&module.name.text, module.parameters.len());
        let clocks = std::iter::repeat_n("clock", self.clocks.width(name, arity));
        let of_input = |input: Input| {
            let name = input.quantity.name();
            [name.to_owned(), format!("slope of {name}")]
        };
        let inputs = self.inputs.of(name, arity).into_iter().flat_map(of_input);
        let hidden = clocks.map(str::to_owned).chain(inputs);
        module.parameters.iter().map(|p| p.text.to_string()).chain(hidden).collect()
    }
}

/// The names of the modules to which a rule applies: `±` stands for both turns, and `±_l` for `+_l` and `-_l`.
pub fn names_of(rule: &ast::Rule) -> Vec<Cow<'_, str>> {
    let name = &*rule.predecessor.name.text;
    match name.strip_prefix('±') {
        Some(subscript) => vec![format!("+{subscript}").into(), format!("-{subscript}").into()],
        None => vec![name.into()],
    }
}

fn turn(part: ast::ContextPart) -> ContextPart {
    match part {
        ast::ContextPart::Module => ContextPart::Module,
        ast::ContextPart::Open => ContextPart::Open,
        ast::ContextPart::Close => ContextPart::Close,
    }
}
