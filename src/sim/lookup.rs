//! Which rule applies to a module, in which context, and how its signs stand there.
//!
//! The first rule whose context is present applies, looked up again whenever the structure has changed
//! (LANGUAGE, "Rules").

use smallvec::SmallVec;

use super::settle::clear;
use super::simulation::Simulation;
use super::state::{Signs, State};
use super::watch::{TOUCH, opposite};
use crate::model::{Pattern, Rule, Sign};
use crate::structure::{ModuleId, Visit};

/// Two numbers are equal if they differ by no more than this part of the larger.
const EQUAL: f64 = 8.0 * f64::EPSILON;

/// Sides closer together than this part of the module's size may be equal but for the resolution of time.
pub(super) const NEAR: f64 = 1e-9;

/// The sign of an atom of a module that comes from nowhere, by its two sides.
pub(super) fn sign_at_birth(a: f64, b: f64) -> Sign {
    let (difference, size) = (a - b, a.abs().max(b.abs()));
    let equal = size.is_finite() && difference.abs() <= EQUAL * size;
    if equal { Sign::Zero } else { Sign::of(difference) }
}

impl Simulation<'_> {
    /// Finds the rule and context of every module for which they may be new, and opens it if they are.
    pub(super) fn look_up(&mut self) {
        let model = self.model;
        let mut fresh = std::mem::take(&mut self.fresh);
        self.cut_branches(&fresh);
        for id in fresh.drain(..) {
            // It may have been replaced already, within the same instant.
            if !self.plant.tree.is_alive(id) {
                continue;
            }
            let kind = self.plant.tree.kind(id);
            if self.steps.has_rules[kind.index()] {
                self.steps.join(id);
            }
            if self.kinds_with_context[kind.index()] {
                self.to_look.push(id);
            } else if let Some(&rule) = model.kinds.get(kind).rules.first()
                && !self.begin_quickly(id, rule)
            {
                self.take_up(id, rule, &[]);
            }
        }
        clear(&mut fresh);
        self.fresh = fresh;
        if std::mem::take(&mut self.lost) {
            self.neighbours.forget();
            self.to_look = self.contextual();
        }
        if !self.to_look.is_empty() {
            self.look_around();
        }
    }

    /// The modules whose rules have contexts, in string order.
    pub(super) fn contextual(&self) -> Vec<ModuleId> {
        let has_context = |visit| match visit {
            Visit::Module(id) if self.kinds_with_context[self.plant.tree.kind(id).index()] => Some(id),
            _ => None,
        };
        if self.looks_around { self.plant.tree.walk().filter_map(has_context).collect() } else { Vec::new() }
    }

    /// Looks up the modules whose neighbours have changed.
    fn look_around(&mut self) {
        let model = self.model;
        let mut to_look = std::mem::take(&mut self.to_look);
        let mut context = SmallVec::new();
        for id in to_look.drain(..) {
            if !self.plant.tree.is_alive(id) {
                continue;
            }
            let rules = &model.kinds.get(self.plant.tree.kind(id)).rules;
            let applies =
                rules.iter().copied().find(|&rule| self.context(id, &model.rules[rule], true, &mut context));
            let state = self.plant.state(id);
            let Some(rule) = applies else {
                if state.is_none_or(|s| s.rule.is_some()) {
                    self.plant.materialise(id, self.now);
                    self.forget(id);
                    self.plant.new_state(id).restarted = self.group;
                    self.ready.push(id);
                }
                continue;
            };
            if state.is_none_or(|s| s.rule != Some(rule) || s.context != context) {
                self.take_up(id, rule, &context);
            }
        }
        self.to_look = to_look;
        let plant = &self.plant;
        self.opened.retain(|id| plant.state(*id).is_some_and(|s| s.rule.is_some()) || plant.is_light(*id));
    }

    /// Gives a module its rule and opens it.
    fn take_up(&mut self, id: ModuleId, rule: usize, context: &[ModuleId]) {
        let compiled = &self.model.rules[rule];
        self.plant.materialise(id, self.now);
        let now = self.now;
        if let Some(state) = self.plant.state_mut(id) {
            state.pass_changes(now);
        }
        let followed = self.plant.state(id).filter(|s| s.rule == Some(rule)).map(|s| s.signs.clone());
        let (mut signs, clear) = self.signs_of_values(id, compiled, context, followed);
        let before = self.plant.state(id);
        // A limit that is only approached may have been reached by rounding.
        if let Some(State { rule: Some(last), solve: Some(solve), signs: known, .. }) = before
            && *last == rule
        {
            for (atom, &unreachable) in compiled.solves[*solve].unreachable.iter().enumerate() {
                if unreachable {
                    signs[atom] = known[atom];
                }
            }
        }
        let was_open = before.is_some_and(|s| s.open.is_some());
        if before.is_none() {
            self.plant.new_state(id);
        }
        let state = self.plant.state_mut(id).expect("just made");
        if state.coupled {
            self.coupled.loosened.extend_from_slice(&state.context);
        }
        state.rule = Some(rule);
        state.context = SmallVec::from_slice(context);
        state.solve = None;
        state.signs = signs;
        state.switches.clear();
        state.next = Default::default();
        state.since = self.now;
        if compiled.is_plain() {
            // Nothing to judge and nothing to choose.
            state.solve = (!compiled.solves.is_empty()).then_some(0);
            state.open = None;
            self.ready.push(id);
            return;
        }
        state.place(clear);
        if !was_open {
            self.opened.push(id);
        }
    }

    /// Collects the context that a rule asks for, in the order of the rule's variables; false if it is
    /// not there. `lasting` says that the module goes on looking at what it has found.
    pub(super) fn context(
        &mut self,
        id: ModuleId,
        rule: &Rule,
        lasting: bool,
        out: &mut SmallVec<[ModuleId; 2]>,
    ) -> bool {
        out.clear();
        let skipped = |kind| self.model.kinds.get(kind).skipped;
        let (tree, neighbours) = (&self.plant.tree, &mut self.neighbours);
        let mut look = |at: &mut ModuleId, pattern: &Pattern, left: bool| {
            let found = match left {
                true => neighbours.left(tree, *at, skipped),
                false => neighbours.right(tree, *at, skipped),
            };
            let Some(found) = found else { return false };
            if lasting {
                neighbours.note(tree, id, found);
            }
            *at = found;
            out.push(found);
            pattern.matches(tree.kind(found))
        };
        let mut at = id;
        if !rule.left.iter().rev().all(|pattern| look(&mut at, pattern, true)) {
            return false;
        }
        at = id;
        if !rule.right.iter().all(|pattern| look(&mut at, pattern, false)) {
            return false;
        }
        out[..rule.left.len()].reverse();
        true
    }

    /// The signs of a rule's atoms by the values of now, and whether all are far from zero. `followed` are the signs
    /// that the module was followed with.
    fn signs_of_values(
        &mut self,
        id: ModuleId,
        rule: &Rule,
        context: &[ModuleId],
        followed: Option<Signs>,
    ) -> (Signs, bool) {
        if rule.atoms.is_empty() {
            return (Signs::new(), true);
        }
        self.plant.variables(id, context, self.now, &mut self.variables);
        let mut out: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.variables, &mut self.scratch, &mut out);
        let scale = self.plant.tree.parameters(id).iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let mut clear = true;
        let signs = (out.chunks(2).enumerate())
            .map(|(atom, side)| {
                let difference = side[0] - side[1];
                // An infinite side is far from everything.
                let size = side[0].abs().max(side[1].abs());
                // A sign that has just turned, by no more than rounding, turns at this instant.
                let turned = followed.as_ref().is_some_and(|f| f[atom] == opposite(Sign::of(difference)));
                let tolerance = if turned { TOUCH } else { EQUAL };
                let equal = size.is_finite() && difference.abs() <= tolerance * size;
                clear &= !equal && difference.abs() > NEAR * scale;
                if equal { Sign::Zero } else { Sign::of(difference) }
            })
            .collect();
        (signs, clear)
    }
}
