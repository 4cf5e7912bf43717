//! The facts of a run that do not change: the model, the settings, and their consequences.

use super::{Method, Settings};
use dlsys_expr::Program;
use dlsys_model::{CUT, KindId, Model, Produce, Rule, Solve, Successor, ZeroCrossing};
use dlsys_tree::Seed;
use std::collections::BTreeSet;

/// The facts of a run. Every stage reads them, none writes them.
#[derive(Clone)]
pub struct Setup<'m> {
    pub model: &'m Model,
    pub settings: Settings,
    /// The settings of modules that are integrated together.
    pub coupled_settings: Settings,
    pub seed: Seed,
    /// Every equation is integrated, also where it has a closed form.
    pub numeric_only: bool,
    /// The fast path is enabled (closed forms that are predicted at birth).
    pub fast_path: bool,
    /// The kind of `%`, if the model has it.
    pub cuts: Option<KindId>,
    /// Some rule has a context.
    pub looks_around: bool,
    /// By kind: some of its rules have a context.
    pub kinds_with_context: Vec<bool>,
    /// By rule: some successor of it reads parameters of the context.
    pub successors_read_context: Vec<bool>,
    /// By rule: see [`levels_decide`].
    pub levels_decide: Vec<bool>,
    /// By rule: see [`has_meetings`].
    pub has_meetings: Vec<bool>,
    /// By rule: some equation of it is not defined on both sides of a level, and no comparison jumps: behind a jump values are kept off their levels.
    pub has_edges: Vec<bool>,
    /// By rule: some production makes modules that have such equations.
    pub leads_to_edges: Vec<bool>,
    /// By rule and production: see [`is_delicate`].
    pub is_delicate: Vec<Vec<bool>>,
    /// By rule and production: something jumps in its condition or its successors.
    pub jumps: Vec<Vec<bool>>,
    /// By rule and production: the variables over which something jumps in its successors.
    pub jump_reads: Vec<Vec<Vec<usize>>>,
    /// By rule: some comparison jumps.
    pub has_jumps: Vec<bool>,
    /// Neighbours are remembered.
    pub hands_on: bool,
    /// Some rule has an aggregate.
    pub gathers: bool,
    /// No rule has a context, is algebraic or discrete, and no transition is recorded: a production of a lazy module concerns
    /// no other module.
    pub plain: bool,
    /// Some rule reads what the surroundings give.
    pub reads_inputs: bool,
    /// Some rule reads the height of ground that may move.
    pub reads_ground: bool,
    /// Some parameters are algebraic.
    pub is_algebraic: bool,
    /// Some rates may have pulses.
    pub has_pulses: bool,
    /// Some rule has conditions.
    pub has_conditions: bool,
}

impl<'m> Setup<'m> {
    pub fn new(model: &'m Model, settings: Settings) -> Setup<'m> {
        let has_context = |rule: &usize| model.rules[*rule].looks_around();
        let kinds_with_context: Vec<bool> =
            model.kinds.iter().map(|(_, kind)| kind.rules.iter().any(has_context)).collect();
        let looks_around = kinds_with_context.contains(&true);
        let hands_on = looks_around || model.rules.iter().any(|rule| rule.discrete && rule.context_len() > 0);
        let gathers = model.rules.iter().any(|rule| !rule.aggregates.is_empty());
        let solves = || model.rules.iter().flat_map(|rule| &rule.solves);
        let is_algebraic = solves().any(|solve| !solve.algebraic.is_empty());
        let successors_read_context = model.rules.iter().map(|rule| {
            let context = rule.parameters.len()..rule.variables - 2;
            rule.produces.iter().flat_map(|produce| produce.outcome.reads()).any(|v| context.contains(&v))
        });
        let is_discrete = model.rules.iter().any(|rule| rule.discrete);
        let has_jumps = |rule: &Rule| rule.jumping.contains(&true) || rule.jumping_whole.contains(&true);
        Setup {
            model,
            settings,
            coupled_settings: settings.for_clocks(solves().any(|solve| solve.has_hazard_clock)),
            seed: Seed::new(settings.seed),
            numeric_only: settings.method != Method::Auto,
            fast_path: !settings.transitions && !settings.slow,
            cuts: model.kinds.find(CUT, 0),
            looks_around,
            kinds_with_context,
            successors_read_context: successors_read_context.collect(),
            levels_decide: model.rules.iter().map(levels_decide).collect(),
            has_meetings: model.rules.iter().map(has_meetings).collect(),
            has_edges: model.rules.iter().map(|rule| has_edges(rule) && !has_jumps(rule)).collect(),
            leads_to_edges: model.rules.iter().map(|rule| leads_to_edges(model, rule)).collect(),
            is_delicate: model.rules.iter().map(|rule| is_delicate(model, rule)).collect(),
            jumps: model.rules.iter().map(jumps).collect(),
            jump_reads: model.rules.iter().map(jump_reads).collect(),
            has_jumps: model.rules.iter().map(has_jumps).collect(),
            hands_on,
            gathers,
            plain: !hands_on && !gathers && !is_algebraic && !is_discrete && !settings.transitions,
            reads_inputs: model.reads_inputs(),
            reads_ground: model.reads_ground(),
            is_algebraic,
            has_pulses: solves().any(|solve| !solve.pulses.is_empty()),
            has_conditions: model.rules.iter().any(|rule| !rule.atoms.is_empty()),
        }
    }

    /// True for a kind of which no module counts as a context.
    pub fn skips(&self, kind: KindId) -> bool {
        self.model.kinds.get(kind).skipped
    }
}

/// True if a production asks for a whole part or a sign, or if a variable that meets a level, at which conditions of the rule change, decides
/// over something that jumps in a successor. Then an event is more than the meeting of two sides.
pub fn levels_decide(rule: &Rule) -> bool {
    let crossings =
        rule.solves.iter().map(|solve| &solve.zero_crossings).chain([&rule.zero_crossings_at_rest]);
    let meets: Vec<usize> = (crossings.flatten())
        .filter_map(|crossing| match crossing {
            ZeroCrossing::Formula { variable, .. }
            | ZeroCrossing::Search { level: Some((variable, _)), .. } => Some(*variable),
            _ => None,
        })
        .collect();
    let asks = rule.produces.iter().any(|produce| asks_for_jumps(rule, produce));
    asks || !meets.is_empty()
        && rule.produces.iter().any(|produce| produce.outcome.jump_reads().any(|v| meets.contains(&v)))
}

/// True if a production depends on sides that meet where no variable that moves by itself alone meets a level: `x + y = 3.4`, or
/// `v = 3.4` of a value that the module computes from others.
fn has_meetings(rule: &Rule) -> bool {
    let is_meeting = |atom: usize, clause: Option<&Solve>, crossing: &ZeroCrossing| match crossing {
        ZeroCrossing::Search { level: None, .. } => !rule.jumping_whole[atom],
        ZeroCrossing::Search { level: Some((variable, _)), .. } => {
            clause.is_some_and(|clause| clause.algebraic.of.contains(variable))
        }
        _ => false,
    };
    let meets = |atom: usize| {
        let mut solves = rule.solves.iter();
        is_meeting(atom, None, &rule.zero_crossings_at_rest[atom])
            || solves.any(|solve| is_meeting(atom, Some(solve), &solve.zero_crossings[atom]))
    };
    (0..rule.atoms.len()).any(|atom| rule.decides_productions(atom) && meets(atom))
}

/// True if some equation of a rule has a function that ends at an edge, beyond which it is not defined.
fn has_edges(rule: &Rule) -> bool {
    let programs = rule.solves.iter().flat_map(|solve| [&solve.rates, &solve.algebraic.values]);
    programs.into_iter().any(|program| !program.partial_reads().is_empty())
}

/// True for a kind with such a rule.
fn is_at_edge(model: &Model, kind: KindId) -> bool {
    model.kinds.get(kind).rules.iter().any(|rule| has_edges(&model.rules[*rule]))
}

/// The kinds of the modules that a production makes.
fn kinds_of(produce: &Produce) -> impl Iterator<Item = KindId> {
    produce.outcome.successors.iter().flat_map(Successor::kinds)
}

/// True if some production of a rule makes modules with equations that end at an edge.
fn leads_to_edges(model: &Model, rule: &Rule) -> bool {
    rule.produces.iter().flat_map(kinds_of).any(|kind| is_at_edge(model, kind))
}

/// By production: a rounding of the values at the instant may decide over its successor. Something jumps there, or ends at an edge, it has
/// weights, or equations of the new modules end at an edge.
fn is_delicate(model: &Model, rule: &Rule) -> Vec<bool> {
    let is_partial = |program: &Program| !program.partial_reads().is_empty();
    let of = |produce: &Produce| {
        let outcome = &produce.outcome;
        outcome.weights.is_some()
            || outcome.jump_reads().next().is_some()
            || outcome.successors.iter().flat_map(Successor::programs).any(is_partial)
            || kinds_of(produce).any(|kind| is_at_edge(model, kind))
    };
    rule.produces.iter().map(of).collect()
}

/// True if the condition of a production compares whole parts or signs.
fn asks_for_jumps(rule: &Rule, produce: &Produce) -> bool {
    produce.guard.atoms().any(|(atom, _)| rule.jumping[atom])
}

/// By production: something jumps in its condition or its successors.
fn jumps(rule: &Rule) -> Vec<bool> {
    let asks = |produce: &Produce| produce.guard.atoms().any(|(atom, _)| rule.jumping_whole[atom]);
    let makes = |produce: &Produce| produce.outcome.jump_reads().next().is_some();
    let jumps = |produce: &Produce| asks_for_jumps(rule, produce) || asks(produce) || makes(produce);
    rule.produces.iter().map(jumps).collect()
}

/// By production: the variables over which something jumps in its successors, each once.
fn jump_reads(rule: &Rule) -> Vec<Vec<usize>> {
    let reads = |produce: &Produce| -> BTreeSet<usize> { produce.outcome.jump_reads().collect() };
    rule.produces.iter().map(|produce| reads(produce).into_iter().collect()).collect()
}
