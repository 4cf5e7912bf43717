//! Consistent values at an instant: algebraic parameters, which are given by a value or an equation.
//!
//! When modules are born, change their equations or get other neighbours, their algebraic parameters are solved for
//! before anything is judged, together with those of all modules that depend on them. Parameters that
//! only drawing and successors read are not kept up to date: they are computed on observation.

use std::collections::HashSet;

use super::EventStage;
use crate::error::Error;
use crate::flow::algebraic::{Solved, is_algebraic};
use crate::world::state::Switches;
use dlsys_model::Truth;
use dlsys_tree::ModuleId;

/// Values that differ by more than so many tolerances have jumped; a smaller difference may be their error.
const JUMP: f64 = 10.0;
/// Most times at one instant that values change and conditions with them, beyond one for each module that the instant concerns: a signal may
/// pass from one to the next.
const MAX_ROUNDS: usize = 100;

/// Modules whose solved values are others than before.
#[derive(Default)]
struct Changed {
    /// By more than rounding.
    all: Vec<ModuleId>,
    /// By more than an error of what was followed.
    jumped: Vec<ModuleId>,
}

impl EventStage<'_, '_> {
    /// Makes the algebraic parameters consistent of all modules that the instant concerns. `chosen`: they have their
    /// equations, and values that were followed may have jumped. True if values have changed that conditions may read.
    pub fn make_consistent(&mut self, chosen: bool) -> Result<bool, Error> {
        if !self.setup.is_algebraic {
            return Ok(false);
        }
        let mut matters = self.solve_again(chosen)?;
        // Before anything is judged, the equations have the sides of their conditions on which their solutions are.
        while !chosen && self.take_sides() {
            if self.events.consistency_rounds > MAX_ROUNDS + self.events.opened.len() {
                let id = self.events.opened[0];
                let site = self.world.site_of_rule(self.setup.model, id, self.instant.at);
                return Err(Error::Chattering { site });
            }
            matters |= self.solve_again(chosen)?;
        }
        Ok(matters)
    }

    /// Gives the equations of modules that may have jumped the sides of their conditions on which their values are; true if some have changed.
    fn take_sides(&mut self) -> bool {
        let mut changed = false;
        for &id in &self.events.opened {
            let Some(state) = self.world.state_mut(id) else { continue };
            let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { continue };
            let clause = &self.setup.model.rules[rule].solves[solve];
            if clause.algebraic.is_empty() || state.open.as_ref().is_none_or(|open| open.flow.is_some()) {
                continue;
            }
            let signs = state.marks.signs();
            let holds = |s: &dlsys_model::Switch| s.condition.judge(|i| signs[i]) != Truth::No;
            let sides: Switches = clause.switches.iter().map(holds).collect();
            changed |= sides != state.marks.switches();
            state.marks.set_switches(&sides);
        }
        changed
    }

    /// Solves once for the algebraic parameters; as [`EventStage::make_consistent`].
    fn solve_again(&mut self, chosen: bool) -> Result<bool, Error> {
        self.events.consistency_rounds += 1;
        let wanted = self.modules_to_solve(chosen);
        if wanted.is_empty() {
            return Ok(false);
        }
        let solved = self.flow().solve_algebraic(&wanted)?;
        let Changed { all: changed, jumped } = self.take_over(&solved);
        if changed.is_empty() {
            return Ok(false);
        }
        let mut again: Vec<(ModuleId, bool)> = changed.iter().map(|id| (*id, true)).collect();
        for &id in &changed {
            let jumps = jumped.contains(&id);
            self.neighbours
                .readers(self.world, self.setup.model, id, |reader, _| again.push((reader, jumps)));
        }
        // Of a module that is there several times, the last says whether anything has jumped.
        again.sort_unstable();
        let mut matters = false;
        for (n, &(id, jumps)) in again.iter().enumerate() {
            if again.get(n + 1).is_none_or(|next| next.0 != id) {
                matters |= self.place_again(id, changed.contains(&id), jumps);
            }
        }
        if matters && self.events.consistency_rounds > MAX_ROUNDS + self.events.opened.len() {
            let id = changed[0];
            let site = self.world.site_of_rule(self.setup.model, id, self.instant.at);
            return Err(Error::Chattering { site });
        }
        Ok(matters)
    }

    /// The modules whose algebraic parameters may be inconsistent: those that the instant concerns, and all that depend on
    /// them.
    fn modules_to_solve(&mut self, chosen: bool) -> Vec<ModuleId> {
        let mut wanted: Vec<ModuleId> = Vec::new();
        for &id in self.events.opened.iter().chain(&self.events.ready) {
            let Some(state) = self.world.state_mut(id) else { continue };
            let Some(rule) = state.rule.get().map(|r| &self.setup.model.rules[r]) else { continue };
            let elsewhere = state.open.as_ref().is_none_or(|open| open.flow.is_none());
            if !chosen && !elsewhere {
                continue;
            }
            if state.solve.get().is_none() && !chosen {
                // The equations that it is going to have, as far as can be told.
                let signs = state.marks.signs();
                let may = |guard: &dlsys_model::Condition| guard.judge(|i| signs[i]) != Truth::No;
                let solve = rule.solves.iter().position(|s| may(&s.guard));
                let switches = solve.map_or(&[][..], |s| &rule.solves[s].switches);
                let sides: Switches = switches.iter().map(|s| may(&s.condition)).collect();
                state.marks.set_switches(&sides);
                state.solve = solve.into();
            }
            wanted.push(id);
        }
        // One that has got several rules at the instant is there several times.
        let mut once = HashSet::new();
        wanted.retain(|id| once.insert(*id));
        // And all modules that depend on them.
        let mut known: HashSet<ModuleId> = wanted.iter().copied().collect();
        let mut at = 0;
        while at < wanted.len() {
            let mut found = Vec::new();
            self.neighbours.readers(self.world, self.setup.model, wanted[at], |reader, _| found.push(reader));
            found.retain(|id| is_algebraic(self.setup.model, self.world, *id) && known.insert(*id));
            wanted.append(&mut found);
            at += 1;
        }
        wanted.retain(|id| is_algebraic(self.setup.model, self.world, *id));
        wanted
    }

    /// Writes solved values into the tree where they differ; returns the modules that have changed by more than rounding.
    fn take_over(&mut self, solved: &Solved) -> Changed {
        let Solved { places, before, values } = solved;
        let mut changed = Changed::default();
        let error = JUMP * self.setup.settings.tolerance;
        let replaced = &mut self.events.replaced_values;
        replaced.sort_unstable_by(f64::total_cmp);
        replaced.dedup();
        let replaced = &*replaced;
        // A successor has the value that was followed up to the instant, which may have met a level, and not one that differs from it by an error.
        let followed = |value: f64| {
            let next = replaced.partition_point(|other| *other < value);
            let around = &replaced[next.saturating_sub(1)..(next + 1).min(replaced.len())];
            let nearest =
                around.iter().copied().min_by(|a, b| (value - a).abs().total_cmp(&(value - b).abs()));
            nearest.filter(|other| (value - other).abs() <= error * value.abs().max(1.0)).unwrap_or(value)
        };
        for ((of, &before), &value) in places.iter().zip(before).zip(values) {
            let (id, _) = of.owner(&self.world.tree);
            let state = self.world.state(id).expect("wanted");
            let in_question = self.events.ready.contains(&id) && state.open.is_none();
            let elsewhere = in_question || state.open.as_ref().is_some_and(|open| open.flow.is_none());
            let value = if elsewhere { followed(value) } else { value };
            let size = value.abs().max(before.abs()).max(1.0);
            let step = (value - before).abs();
            let jumps = step > error * size;
            if !(jumps || elsewhere && value.to_bits() != before.to_bits()) {
                continue;
            }
            self.world.rebase(id, self.instant.at);
            self.world.tree.set_value(of.place as usize, value);
            if jumps || step > 1e-12 * size {
                changed.all.push(id);
            }
            if jumps {
                changed.jumped.push(id);
            }
        }
        changed.all.dedup();
        changed
    }

    /// Judges the signs of a module anew by its values; true if it has any. `own`: its own values have changed; `jumps`: they, or values
    /// that it reads, have jumped.
    fn place_again(&mut self, id: ModuleId, own: bool, jumps: bool) -> bool {
        let Some(state) = self.world.state(id) else { return false };
        let Some(rule) = state.rule.get() else { return false };
        let compiled = &self.setup.model.rules[rule];
        let is_open = state.open.is_some();
        // Signs that were followed to the instant are valid, unless something has jumped.
        if !own && !jumps && is_open && state.open.as_ref().is_some_and(|open| open.flow.is_some()) {
            return false;
        }
        if compiled.atoms.is_empty() {
            if own && !is_open && !self.events.ready.contains(&id) {
                self.events.ready.push(id);
            }
            return false;
        }
        self.world.rebase(id, self.instant.at);
        let around = self.world.state(id).expect("seen above").context.clone();
        let (signs, clear) = self.signs_of_values(id, compiled, &around, None);
        let now = self.instant.at;
        let state = self.world.state_mut(id).expect("seen above");
        state.pass_changes(now);
        let same = is_open
            && *state.marks.signs() == signs[..]
            && state.open.as_ref().is_some_and(|o| o.at == signs);
        state.marks.set_signs(&signs);
        state.place(clear);
        if !is_open {
            self.events.opened.push(id);
            self.events.ready.retain(|other| *other != id);
        }
        !same
    }
}
