//! Which rule applies to a module, in which context, and how its signs stand there.
//!
//! The first rule whose context is present applies, looked up again whenever the structure has changed
//! (LANGUAGE, "Rules").

use super::EventStage;
use std::collections::HashSet;

use crate::scratch::{LONG, clear};
use crate::world::context::Context;
use crate::world::state::{Signs, State};
use dlsys_model::{KindId, Rule, Sign};
use dlsys_tree::ModuleId;

/// True if a module whose neighbours have been replaced goes on as it was, but for the inputs of its common step: it is
/// integrated with its neighbours already, and neither its conditions nor its formulas read them. So its signs, its clause
/// and its own events stay, and most events of a tissue concern one module, not three.
fn goes_on(state: &State, rule: &Rule, number: usize, context: &Context) -> bool {
    if state.rule.get() != Some(number) || !state.coupled || state.open.is_some() {
        return false;
    }
    let Some(clause) = state.solve.get().map(|solve| &rule.solves[solve]) else { return false };
    // A zero sign may go elsewhere with another neighbour.
    let is_clear = |sign: &Sign| matches!(sign, Sign::Plus | Sign::Minus);
    let (own, all) = (rule.parameters.len(), rule.variables - 2);
    let reads_own = |reads: &[bool]| !reads.get(own..all).unwrap_or_default().contains(&true);
    state.context.len() == context.len()
        && rule.aggregates.is_empty()
        && !rule.is_algebraic()
        && state.marks.signs().iter().all(is_clear)
        && reads_own(&rule.watched)
        && reads_own(clause.stepping.formulas_read())
}

impl EventStage<'_, '_> {
    /// Finds the rule and context of every module for which they may be new, and opens it if they are.
    pub fn look_up(&mut self) {
        let model = self.setup.model;
        let mut fresh = std::mem::take(&mut self.events.fresh);
        self.cut_branches(&fresh);
        if fresh.len() > LONG {
            // A cascade: growing bit by bit, the list would be there twice.
            self.events.firing_lazy.reserve_exact(fresh.len());
        }
        for id in fresh.drain(..) {
            // It may have been replaced already, within the same instant.
            if !self.world.tree.is_alive(id) {
                continue;
            }
            if self.setup.reads_ground {
                self.world.put_on_ground(model, id);
            }
            let kind = self.world.tree.kind(id);
            if self.events.steps.has_rules[kind.index()] {
                self.events.steps.join(id);
            }
            if self.setup.kinds_with_context[kind.index()] {
                self.events.to_look.push(id);
            } else if let Some(&rule) = model.kinds.get(kind).rules.first()
                && !self.begin_predicted(id, rule)
            {
                self.take_up(id, rule, &Context::default());
            } else if self.setup.reads_inputs && model.kinds.get(kind).rules.is_empty() {
                self.world.let_inputs_go_on(model, id, self.instant.at);
            }
        }
        clear(&mut fresh);
        self.events.fresh = fresh;
        let mut heir = self.events.heir.take();
        if std::mem::take(&mut self.events.lost) {
            heir = None;
            self.neighbours.forget();
            self.events.to_look = self.contextual();
        }
        if !self.events.to_look.is_empty() {
            self.look_around(heir);
        }
    }

    /// Looks up the modules whose neighbours have changed; see [`Events::heir`](super::Events).
    fn look_around(&mut self, heir: Option<(ModuleId, ModuleId)>) {
        let model = self.setup.model;
        let mut to_look = std::mem::take(&mut self.events.to_look);
        let mut context = Context::default();
        if self.setup.gathers {
            // A module with many children has been put in by each of them that is new.
            let mut seen = HashSet::new();
            to_look.retain(|id| seen.insert(*id));
        }
        for id in to_look.drain(..) {
            if !self.world.tree.is_alive(id) {
                continue;
            }
            let rules = &model.kinds.get(self.world.tree.kind(id)).rules;
            let applies = self.context_with_heir(id, heir, &mut context).or_else(|| {
                let mut rules = rules.iter().copied();
                rules.find(|&rule| self.context(id, &model.rules[rule], true, &mut context))
            });
            let state = self.world.state(id);
            let Some(rule) = applies else {
                if state.is_none_or(|s| s.rule.get().is_some()) {
                    self.world.rebase(id, self.instant.at);
                    self.flow().forget(id);
                    self.world.new_state(id).restart(self.instant.number);
                    self.world.let_inputs_go_on(model, id, self.instant.at);
                    self.events.ready.push(id);
                }
                continue;
            };
            match state {
                Some(s) if s.rule.get() == Some(rule) && s.context == context => {}
                Some(s) if goes_on(s, &model.rules[rule], rule, &context) => {
                    self.exchange_neighbours(id, &context);
                }
                _ => self.take_up(id, rule, &context),
            }
        }
        clear(&mut to_look);
        self.events.to_look = to_look;
        let world = &self.world;
        self.events
            .opened
            .retain(|id| world.state(*id).is_some_and(|s| s.rule.get().is_some()) || world.is_lazy(*id));
    }

    /// The rule of a module that looks at one whose heir is of the same kind, and nothing else has changed: all that matched
    /// then matches now. None for all others.
    fn context_with_heir(
        &mut self,
        id: ModuleId,
        heir: Option<(ModuleId, ModuleId)>,
        context: &mut Context,
    ) -> Option<usize> {
        let ((dead, heir), state) = (heir.filter(|(_, heir)| *heir != id)?, self.world.state(id)?);
        let rule = state.rule.get()?;
        context.clone_from(&state.context);
        context.exchange(dead, heir);
        self.neighbours.note(&self.world.tree, id, heir);
        debug_assert!(self.is_matched(id, rule, context), "it matches another way");
        Some(rule)
    }

    /// True if a rule is the first one of a module that matches, in this context.
    fn is_matched(&mut self, id: ModuleId, rule: usize, context: &Context) -> bool {
        let (model, mut found) = (self.setup.model, Context::default());
        let mut rules = model.kinds.get(self.world.tree.kind(id)).rules.iter().copied();
        rules.find(|&rule| self.context(id, &model.rules[rule], false, &mut found)) == Some(rule)
            && found == *context
    }

    /// Gives a module that goes on as it was the neighbours that have come in the place of others. It is integrated anew,
    /// and each of them is examined, whether it begins a trajectory now or has been there before: it may have to join.
    fn exchange_neighbours(&mut self, id: ModuleId, context: &Context) {
        let state = self.world.state_mut(id).expect("a module that goes on");
        let left = state.context.iter().filter(|seen| !context.contains(seen));
        self.flows.coupled.loosened.extend(left);
        self.flows.coupled.loosened.push(id);
        self.flows.coupled.loosened.extend_from_slice(context);
        state.exchange(self.instant.number);
        state.context.clone_from(context);
    }

    /// Gives a module its rule and opens it.
    pub fn take_up(&mut self, id: ModuleId, rule: usize, context: &Context) {
        self.take_up_with(id, rule, context, &[]);
    }

    /// The same with new values of some parameters.
    pub fn take_up_with(&mut self, id: ModuleId, rule: usize, context: &Context, given: &[(usize, f64)]) {
        let compiled = &self.setup.model.rules[rule];
        let (signs, clear, was_open) = match self.world.state(id).is_some() {
            true => self.signs_anew(id, rule, context, given),
            false => {
                self.world.give(id, given);
                let (signs, clear) = self.signs_of_values(id, compiled, context, None);
                self.world.new_state(id);
                (signs, clear, false)
            }
        };
        let state = self.world.state_mut(id).expect("just made");
        if state.coupled {
            self.flows.coupled.loosened.extend_from_slice(&state.context);
        }
        state.context = context.clone();
        state.marks.set_switches(&[]);
        state.marks.set_signs(&signs);
        state.next = if state.rule.get() == Some(rule) { state.next.again() } else { Default::default() };
        (state.since, state.horizon) = (self.instant.at, f64::NAN);
        if compiled.is_plain() {
            // Nothing to judge and nothing to choose.
            state.put_under(rule, (!compiled.solves.is_empty()).then_some(0));
            state.open = None;
            self.events.ready.push(id);
            return;
        }
        state.put_under(rule, None);
        state.place(clear);
        if !was_open {
            self.events.opened.push(id);
        }
    }

    /// The signs of a rule of a module that has lived under this or another one, by its values of now; whether all are far from zero; and
    /// whether it is open.
    fn signs_anew(
        &mut self,
        id: ModuleId,
        rule: usize,
        context: &Context,
        given: &[(usize, f64)],
    ) -> (Signs, bool, bool) {
        let compiled = &self.setup.model.rules[rule];
        let error = self.flows.error_of(self.world, id);
        self.world.rebase_with(id, self.instant.at, given);
        let followed = self.signs_followed(id, rule).map(|signs| (signs, error));
        let (mut signs, clear) = self.signs_of_values(id, compiled, context, followed);
        let state = self.world.state(id).expect("it has lived");
        // A limit that is only approached may have been reached by rounding.
        if state.rule.get() == Some(rule)
            && let Some(solve) = state.solve.get()
        {
            for (atom, &unreachable) in compiled.solves[solve].unreachable.iter().enumerate() {
                if unreachable {
                    signs[atom] = state.marks.signs()[atom];
                }
            }
        }
        (signs, clear, state.open.is_some())
    }

    /// The signs up to now that a module was followed with, if it was under this rule.
    fn signs_followed(&mut self, id: ModuleId, rule: usize) -> Option<Signs> {
        let now = self.instant.at;
        let state = self.world.state_mut(id)?;
        state.pass_changes(now);
        (state.rule.get() == Some(rule)).then(|| state.marks.signs().into())
    }

    /// The modules whose rules have contexts, in string order.
    pub fn contextual(&self) -> Vec<ModuleId> {
        match self.setup.looks_around {
            true => self.world.modules_of(&self.setup.kinds_with_context).collect(),
            false => Vec::new(),
        }
    }

    /// Marks the modules that have looked at a module that is replaced, and hands its neighbours on.
    pub fn hand_on(&mut self, id: ModuleId, kind: KindId, kinds: &[KindId], made: &[ModuleId]) {
        if !self.setup.hands_on {
            return;
        }
        let skipped = |kind| self.setup.model.kinds.get(kind).skipped;
        self.events.to_look.extend_from_slice(self.neighbours.lookers(id));
        self.neighbours.bury(id);
        self.neighbours.hand_on(Some(id), kinds, made, skipped);
        // A skipped module may be replaced by one that stands between others.
        let counts = |kind: &KindId| !kind.is_bracket() && !skipped(*kind);
        self.events.lost |= skipped(kind) && kinds.iter().any(counts);
    }
}
