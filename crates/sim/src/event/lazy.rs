//! The events of lazy modules: they are born and replaced without ever having a state.

use super::apply::{Refusal, residual};
use super::{EventStage, Firing, chance, lives};
use crate::error::Error;
use crate::flow::prediction::values_at_event;
use crate::scratch::{LONG, clear};
use crate::world::context::Context;
use crate::world::life::{End, Life, Newborn, REFUSED};
use crate::world::new_modules::kinds_of;
use dlsys_model::{KindId, Outcome, Sign};
use dlsys_tree::{ModuleId, NO_LABEL};

impl EventStage<'_, '_> {
    /// Replaces lazy modules: no module reads another's successor. Successors that end at once are the next in
    /// `self.events.firing_lazy`, which was empty.
    pub fn replace_all_lazy(&mut self, mut firing: Vec<u32>, rounds: usize) -> Result<(), Error> {
        if firing.len() > LONG {
            let first = self.world.tree.id(firing[0]);
            self.afford_round(firing.len(), Some(first))?;
            // A cascade may double with each round. Growing bit by bit, the list would be there twice.
            self.events.firing_lazy.reserve_exact(2 * firing.len());
        }
        for &slot in &firing {
            self.replace_lazy(slot, rounds)?;
        }
        if self.events.firing_lazy.is_empty() {
            clear(&mut firing);
            self.events.firing_lazy = firing;
        }
        self.world.structure += 1;
        self.events.changed = true;
        if !self.events.opened.is_empty() {
            let world = &self.world;
            self.events.opened.retain(|id| world.state(*id).is_some());
        }
        Ok(())
    }

    /// Begins the life of a module whose kind may be lazy; false if it is not.
    pub fn begin_lazily(&mut self, id: ModuleId, rule: usize) -> bool {
        let mut label = self.world.tree.label(id);
        if label == NO_LABEL {
            let (compiled, now) = (&self.setup.model.rules[rule], self.instant.at);
            self.world.variables(compiled, id, &Context::default(), now, &mut self.scratch.variables);
            let child = lives::classify(self.setup, self.world, now, rule, self.scratch);
            label = child.label;
            self.world.tree.set_label(id, label);
            if let Some(time) = child.time {
                self.schedule.schedule_lazy(time, id.slot() as u32);
            }
        }
        let Some(class) = self.world.lives.get(label) else { return false };
        if class.is_over_at_birth() {
            // A cascade may be most of the structure: half the memory where no other module is open.
            match self.events.opened.is_empty() {
                true => self.events.firing_lazy.push(id.slot() as u32),
                false => self.events.opened.push(id),
            }
        }
        true
    }

    /// Replaces a lazy module whose event it is. Nothing that other modules of the instant read changes by that.
    fn replace_lazy(&mut self, slot: u32, rounds: usize) -> Result<(), Error> {
        let model = self.setup.model;
        let (label, mut life) = lives::life(self.world, &model.rules, slot, self.scratch);
        let look = self.world.tree.look(slot);
        let (id, kind, lineage) = (look.id, look.kind, self.world.tree.lineage_of(&look));
        let class = self.world.lives.get(label).expect("a lazy module");
        let (rule, produce) = (class.rule, class.produce().expect("it is its event"));
        let clause = &model.rules[rule].produces[produce];
        // A random successor is drawn for each module.
        let again = match life.replaced == Some(self.instant.at) {
            true => !clause.outcome.is_random() && !clause.is_fault,
            false => life.end_again(self.instant.at),
        };
        let mut possible = if again { Ok(()) } else { self.succeed(&mut life, id, rule, produce) };
        if possible.is_err() {
            life.replaced = None;
        } else if clause.is_fault {
            possible = Err(Refusal::NegativeRate);
        } else {
            let kinds = kinds_of(&clause.outcome.successors[life.successor], &life.new.kinds);
            possible = self.room(kinds, life.new.arguments.len(), rounds);
        }
        if let Err(refusal) = possible {
            self.world.lives.keep(label, life);
            lives::write_values_at_event(self.world, &model.rules, id, self.instant.at, self.scratch);
            let site = self.site(&Firing::at(id, rule, produce));
            return Err(refusal.error(self.world, site));
        }
        if self.log.records() {
            let which = clause.outcome.weights.is_some().then_some(life.successor);
            let kinds = kinds_of(&clause.outcome.successors[life.successor], &life.new.kinds);
            self.record((kind, lineage), (rule, produce), (which, kinds), life.residual);
        }
        let family = lineage.family(Outcome::production(clause.key, life.successor));
        let (tree, made) = (&mut self.world.tree, &mut self.events.made);
        made.clear();
        let kinds = kinds_of(&clause.outcome.successors[life.successor], &life.new.kinds);
        tree.replace(id, kinds, &life.new.arguments, self.instant.at, family, made);
        for (&id, child) in self.events.made.iter().zip(&life.children) {
            if child.label != NO_LABEL {
                tree.set_label(id, child.label);
            }
            if let Some(time) = child.time {
                self.schedule.schedule_lazy(time, id.slot() as u32);
            }
            if !child.open {
                continue;
            }
            // A module that ends at birth is replaced in the next round, without being looked up.
            let goes_on = child.label < REFUSED && self.events.fresh.is_empty();
            match goes_on && self.setup.plain && self.setup.cuts.is_none() {
                true => self.events.firing_lazy.push(id.slot() as u32),
                false => self.events.fresh.push(id),
            }
        }
        if self.setup.hands_on {
            let made = std::mem::take(&mut self.events.made);
            self.hand_on(id, kind, kinds, &made);
            self.events.made = made;
        }
        self.world.lives.keep(label, life);
        self.log.stats.events += 1;
        self.log.stats.peak_modules = self.log.stats.peak_modules.max(self.world.tree.len() as u64);
        Ok(())
    }

    /// Computes the successor of a life that ends now, and the lives of its modules.
    fn succeed(&mut self, life: &mut Life, id: ModuleId, rule: usize, produce: usize) -> Result<(), Refusal> {
        let (label, lineage) = (self.world.tree.label(id), self.world.tree.lineage(id));
        let compiled = &self.setup.model.rules[rule];
        let clause = &compiled.produces[produce];
        self.scratch.variables.clear();
        values_at_event(life, self.instant.at, &mut self.scratch.variables);
        self.scratch.variables.extend([self.instant.at.to_f64(), self.instant.at.since(life.birth)]);
        life.children.clear();
        life.new.clear();
        (life.replaced, life.lasting) = (Some(self.instant.at), false);
        if clause.is_fault {
            return Ok(());
        }
        if self.log.events.is_some() {
            let class = self.world.lives.get(label).expect("a lazy module");
            let zero = |atom: usize| match class.end {
                Some(End::Crossing { atom: touched, .. }) => atom == touched,
                _ => class.signs[atom] == Sign::Zero,
            };
            life.residual = residual(compiled, produce, zero, self.scratch);
        }
        let (which, _) = chance::successor(self.setup.seed, clause, lineage, self.scratch, &mut life.new)?;
        life.successor = which;
        let mut rest = &life.new.arguments[..];
        let kinds = kinds_of(&clause.outcome.successors[which], &life.new.kinds);
        for &kind in kinds.iter().filter(|kind| !kind.is_bracket()) {
            let (own, others) = rest.split_at(self.setup.model.kinds.get(kind).width());
            rest = others;
            let child = self.child(kind, own);
            life.children.push(child);
        }
        // The values at the end are those after the rounded time since birth, which is not the same at all instants.
        let is_exact = life.tau == Some(self.instant.at.since(life.birth));
        let same_successor = is_exact && self.world.lives.is_lasting(rule, produce);
        life.lasting = same_successor && life.children.iter().all(|child| child.lasting);
        Ok(())
    }

    /// The life of a newborn module of a kind.
    fn child(&mut self, kind: KindId, parameters: &[f64]) -> Newborn {
        let now = self.instant.at;
        match self.world.lives.rule(kind) {
            Some(rule) => {
                self.scratch.variables.clear();
                self.scratch.variables.extend_from_slice(parameters);
                self.scratch.variables.extend([now.to_f64(), now.since(now)]);
                lives::classify(self.setup, self.world, now, rule, self.scratch)
            }
            None => {
                let open = Some(kind) == self.setup.cuts || !self.setup.model.kinds.get(kind).has_no_rules();
                Newborn { label: NO_LABEL, time: None, open, lasting: true, tau: None }
            }
        }
    }
}
