//! Which rule applies to a module, in which context, and how its signs stand there.
//!
//! The first rule whose context is present applies, looked up again whenever the structure has changed
//! (LANGUAGE, "Rules").

use std::collections::HashSet;

use smallvec::SmallVec;

use super::around::Around;
use super::doubt::half_width;
use super::settle::{LONG, clear};
use super::signs::opposite;
use super::simulation::Simulation;
use super::state::{Signs, State};
use super::watch::TOUCH;
use dlsys_expr::Interval;
use dlsys_model::{Pattern, Rule, Sign, Turn};
use dlsys_tree::{ModuleId, Visit};

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

/// What the errors of values, relative, make of the difference of an atom's sides.
fn noise(rule: &Rule, atom: usize, values: &[f64], error: f64) -> f64 {
    let around = |x: &f64| Interval { lo: x - error * x.abs(), hi: x + error * x.abs(), partial: false };
    let variables: Vec<Interval> = values.iter().map(around).collect();
    let mut out = vec![Interval::EMPTY; rule.sides.outputs()];
    rule.sides.eval(&variables, &mut Vec::new(), &mut out);
    half_width(out[2 * atom], out[2 * atom + 1])
}

/// The place of the bracket that closes the first one.
fn closing(shape: &[Turn]) -> usize {
    let mut depth = 0;
    for (i, turn) in shape.iter().enumerate() {
        match turn {
            Turn::Open => depth += 1,
            Turn::Close if depth == 1 => return i,
            Turn::Close => depth -= 1,
            Turn::Module => {}
        }
    }
    shape.len()
}

impl Simulation<'_> {
    /// Finds the rule and context of every module for which they may be new, and opens it if they are.
    pub(super) fn look_up(&mut self) {
        let model = self.model;
        let mut fresh = std::mem::take(&mut self.fresh);
        self.cut_branches(&fresh);
        if fresh.len() > LONG {
            // A cascade: growing bit by bit, the list would be there twice.
            self.firing_light.reserve_exact(fresh.len());
        }
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
                self.take_up(id, rule, &Around::default());
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
        let mut context = Around::default();
        if self.gathers {
            // A module with many children has been put in by each of them that is new.
            let mut seen = HashSet::new();
            to_look.retain(|id| seen.insert(*id));
        }
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
    pub(super) fn take_up(&mut self, id: ModuleId, rule: usize, context: &Around) {
        let compiled = &self.model.rules[rule];
        let error = self.error_of(id);
        self.plant.materialise(id, self.now);
        let now = self.now;
        if let Some(state) = self.plant.state_mut(id) {
            state.pass_changes(now);
        }
        let followed =
            self.plant.state(id).filter(|s| s.rule == Some(rule)).map(|s| Signs::from_slice(&s.signs));
        let followed = followed.map(|signs| (signs, error));
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
        state.context = context.clone();
        state.solve = None;
        state.signs = signs;
        state.switches.clear();
        state.next = if state.rule == Some(rule) { state.next.again() } else { Default::default() };
        state.rule = Some(rule);
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

    /// What integrated values that a module reads may be wrong by now, relative; 0 where nothing is integrated.
    pub(super) fn error_of(&self, id: ModuleId) -> f64 {
        let Some(state) = self.plant.state(id) else { return 0.0 };
        let own = state.step.as_ref().filter(|_| state.is_numeric()).map_or(0.0, |step| step.dense.error);
        let common = if self.plant.coupled.is_some() { self.coupled.control.error } else { 0.0 };
        own.max(common)
    }

    /// Collects the context that a rule asks for, in the order of the rule's variables; false if it is
    /// not there. `lasting` says that the module goes on looking at what it has found.
    pub(super) fn context(&mut self, id: ModuleId, rule: &Rule, lasting: bool, out: &mut Around) -> bool {
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
        if rule.right_shape.iter().all(|turn| *turn == Turn::Module) {
            if !rule.right.iter().all(|pattern| look(&mut at, pattern, false)) {
                return false;
            }
        } else if self.follow((id, lasting), id, &rule.right_shape, &mut rule.right.iter(), out).is_none() {
            return false;
        }
        out.reverse(rule.left.len());
        if !rule.aggregates.is_empty() {
            self.attached_to((id, lasting), id);
            let tree = &self.plant.tree;
            for aggregate in &rule.aggregates {
                let matching = |child: &&ModuleId| aggregate.pattern.matches(tree.kind(**child));
                out.push_children(self.attached.iter().filter(matching).copied());
            }
        }
        true
    }

    /// Finds the modules attached to one, and notes, if that is to last, that somebody has looked at them. Tells whether the last is on its
    /// axis.
    fn attached_to(&mut self, (looker, lasting): (ModuleId, bool), id: ModuleId) -> bool {
        let (tree, neighbours) = (&self.plant.tree, &mut self.neighbours);
        self.attached.clear();
        let on_axis = tree.children(id, |kind| self.model.kinds.get(kind).skipped, &mut self.attached);
        for child in self.attached.iter().filter(|_| lasting) {
            neighbours.note(tree, looker, *child);
        }
        on_axis
    }

    /// Collects a right context with branches, as seen from a module: each branch stands for the first one, after those
    /// before it, that begins with what is written. None if it is not there. No deeper than brackets in a text.
    fn follow(
        &mut self,
        looker: (ModuleId, bool),
        from: ModuleId,
        shape: &[Turn],
        patterns: &mut std::slice::Iter<Pattern>,
        out: &mut Around,
    ) -> Option<()> {
        let mut on_axis = self.attached_to(looker, from);
        let mut around = self.attached.clone();
        let mut next_branch = 0;
        let mut turns = 0;
        while turns < shape.len() {
            if shape[turns] == Turn::Module {
                let next = around.last().copied().filter(|_| on_axis)?;
                let pattern = patterns.next()?;
                if !pattern.matches(self.plant.tree.kind(next)) {
                    return None;
                }
                out.push(next);
                turns += 1;
                if turns < shape.len() {
                    on_axis = self.attached_to(looker, next);
                    around = self.attached.clone();
                    next_branch = 0;
                }
                continue;
            }
            let inside = &shape[turns + 1..turns + closing(&shape[turns..])];
            let branches = around.len() - usize::from(on_axis);
            let known = out.context().len();
            let found = (next_branch..branches).find_map(|branch| {
                let mut inner = patterns.clone();
                let first = inner.next()?;
                out.truncate(known);
                if !first.matches(self.plant.tree.kind(around[branch])) {
                    return None;
                }
                out.push(around[branch]);
                self.follow(looker, around[branch], &inside[1..], &mut inner, out)?;
                Some((branch, inner))
            });
            let (branch, inner) = found?;
            next_branch = branch + 1;
            *patterns = inner;
            turns += inside.len() + 2;
        }
        Some(())
    }

    /// The signs of a rule's atoms by the values of now, and whether all are far from zero. `followed` are the signs
    /// that the module was followed with.
    pub(super) fn signs_of_values(
        &mut self,
        id: ModuleId,
        rule: &Rule,
        context: &Around,
        followed: Option<(Signs, f64)>,
    ) -> (Signs, bool) {
        if rule.atoms.is_empty() {
            return (Signs::new(), true);
        }
        let read = (rule, &rule.watched[..]);
        self.plant.variables_read(read, id, context, self.now, &mut self.variables);
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
                let turned = followed.as_ref().is_some_and(|f| f.0[atom] == opposite(Sign::of(difference)));
                let tolerance = if turned { TOUCH } else { EQUAL };
                let equal = size.is_finite() && difference.abs() <= tolerance * size;
                // By no more than the error of integration: it goes on with the sign that it had.
                if let Some((signs, error)) = followed.as_ref().filter(|f| turned && !equal && f.1 > 0.0)
                    && difference.abs() <= noise(rule, atom, &self.variables, *error)
                {
                    return signs[atom];
                }
                clear &= !equal && difference.abs() > NEAR * scale;
                if equal { Sign::Zero } else { Sign::of(difference) }
            })
            .collect();
        (signs, clear)
    }
}
