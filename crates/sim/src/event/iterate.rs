//! The loop of event iteration: rounds of productions, then the selection of modes, then the start of flows.

use super::{EventStage, Firing, lives};
use crate::error::{Error, Site};
use crate::scratch::clear;

/// Most rounds of productions at one instant.
pub const MAX_ROUNDS: usize = 10_000;

impl EventStage<'_, '_> {
    /// Brings the structure at the present instant to rest: nothing holds any more, and every module
    /// has its equations. The modules in `self.events.opened` are open already.
    pub fn iterate(&mut self) -> Result<(), Error> {
        self.instant.number += 1;
        self.note_arrivals();
        self.open_resting();
        self.events.consistency_rounds = 0;
        self.iterate_from(0)
    }

    /// The same where nothing but productions of lazy modules is known to happen at the instant: `self.events.firing_lazy`.
    /// Most events are like that.
    pub fn iterate_lazily(&mut self) -> Result<(), Error> {
        if !self.setup.plain {
            return self.iterate();
        }
        self.instant.number += 1;
        let lazy = std::mem::take(&mut self.events.firing_lazy);
        self.replace_all_lazy(lazy, 1)?;
        // New modules may have to be looked up, or end at once.
        if self.events.fresh.is_empty() && self.events.firing_lazy.is_empty() {
            Ok(())
        } else {
            self.iterate_from(1)
        }
    }

    /// Goes on with the instant after so many rounds of productions.
    fn iterate_from(&mut self, mut rounds: usize) -> Result<(), Error> {
        let mut hurried = false;
        loop {
            if !self.events.fresh.is_empty() || std::mem::take(&mut self.events.changed) {
                self.look_up();
                self.make_consistent(false)?;
            }
            if self.events.steps.due {
                self.afford_round(self.events.steps.len(), self.events.steps.first())?;
            }
            let mut firing = self.judge();
            self.take_back_rounding(&mut firing);
            let mut lazy = std::mem::take(&mut self.events.firing_lazy);
            self.find_steps(&mut firing);
            if !self.events.steps.firing.is_empty() {
                rounds += 1;
                self.replace_with_steps(&mut lazy, &mut firing, rounds)?;
                (self.events.firing, self.events.firing_lazy) = (firing, lazy);
                continue;
            }
            if firing.is_empty() && lazy.is_empty() && !self.events.opened.is_empty() {
                self.select_modes(&mut hurried, &mut firing)?;
            }
            if firing.is_empty() && lazy.is_empty() {
                if self.make_consistent(true)? {
                    (self.events.firing, self.events.firing_lazy) = (firing, lazy);
                    continue;
                }
                (self.events.firing, self.events.firing_lazy) = (firing, lazy);
                break;
            }
            rounds += 1;
            if let Some(limit) = self.budget.exceeded(&self.setup.settings, self.log.stats.events) {
                return Err(limit.error(self.site_of_round(&lazy, &firing)));
            }
            if rounds > MAX_ROUNDS {
                let site = self.site_of_round(&lazy, &firing);
                return Err(if hurried { Error::Zeno { site } } else { Error::Cascade { site, rounds } });
            }
            if firing.iter().all(|fire| self.world.is_lazy(fire.id)) {
                lazy.extend(firing.iter().map(|fire| fire.id.slot() as u32));
                self.replace_all_lazy(lazy, rounds)?;
            } else {
                self.materialise_all(&lazy, &mut firing);
                self.replace(&firing, rounds)?;
                clear(&mut lazy);
                self.events.firing_lazy = lazy;
            }
            clear(&mut firing);
            self.events.firing = firing;
        }
        self.events.met.clear();
        self.events.replaced_values.clear();
        self.events.is_after = false;
        self.neighbours.end_instant();
        self.finish_transitions();
        self.start_flows()?;
        self.arrange_step()
    }

    /// The production of each open module whose condition holds at the instant.
    fn judge(&mut self) -> Vec<Firing> {
        // A cascade of lazy modules may be most of the structure.
        if self.events.opened.iter().all(|id| self.world.is_lazy(*id)) {
            self.events.firing_lazy.extend(self.events.opened.iter().map(|id| id.slot() as u32));
            clear(&mut self.events.opened);
        }
        let mut firing = std::mem::take(&mut self.events.firing);
        let world = &self.world;
        firing.extend(self.events.opened.iter().filter_map(|&id| {
            if let Some(class) = world.lives.get(world.tree.label_if_alive(id)?) {
                return Some(Firing::at(id, class.rule, class.produce()?));
            }
            let state = world.state(id)?;
            let (rule, open) = (state.rule.get()?, state.open.as_ref()?);
            if let Some(produce) = self.production_at(rule, &open.at) {
                let after = open.behind && self.setup.jumps[rule][produce];
                return Some(Firing { id, rule, produce, after });
            }
            let produce = self.production_behind(rule, open)?;
            Some(Firing { id, rule, produce, after: self.setup.jumps[rule][produce] })
        }));
        firing
    }

    /// Takes back productions of modules that begin on a threshold but for the resolution of time, where the numbers of their parameters are
    /// a rounding beyond it: whether one holds is told by where they go from there.
    fn take_back_rounding(&mut self, firing: &mut Vec<Firing>) {
        let begins_near = |me: &Self, fire: &Firing| {
            let open = me.world.state(fire.id).and_then(|state| state.open.as_ref());
            open.is_some_and(|open| open.flow.is_none() && !open.clear)
        };
        if !firing.iter().any(|fire| begins_near(self, fire)) {
            return;
        }
        let opened = std::mem::take(&mut self.events.opened);
        self.choose_first(&opened);
        self.events.opened = opened;
        self.flows.known_rates.clear();
        firing.retain(|fire| {
            if !begins_near(self, fire) {
                return true;
            }
            self.signs_after(fire.id);
            let open = self.world.state(fire.id).and_then(|state| state.open.as_ref());
            open.is_none_or(|open| self.production_at(fire.rule, &open.at) == Some(fire.produce))
        });
    }

    /// The place of a round of productions that is one too many.
    fn site_of_round(&mut self, lazy: &[u32], firing: &[Firing]) -> Site {
        let first = lazy.first().map_or_else(|| firing[0].id, |slot| self.world.tree.id(*slot));
        let class = self.world.lives.get(self.world.tree.label(first));
        match class.and_then(|class| Some((class.rule, class.produce()?))) {
            Some((rule, produce)) => {
                let (rules, now) = (&self.setup.model.rules, self.instant.at);
                lives::write_values_at_event(self.world, rules, first, now, self.scratch);
                self.site(&Firing::at(first, rule, produce))
            }
            None => match firing.first() {
                Some(fire) => self.site(fire),
                None => self.world.site(self.setup.model, first, 0, Default::default(), self.instant.at),
            },
        }
    }

    /// Starts the trajectories of the modules that were open, and of those that depend on them.
    pub fn start_flows(&mut self) -> Result<(), Error> {
        let mut opened = std::mem::take(&mut self.events.opened);
        opened.append(&mut self.events.ready);
        clear(&mut self.events.ready);
        for &id in &opened {
            if let Some(state) = self.world.state_mut(id) {
                state.open = None;
                state.waits = true;
            }
        }
        // A module that got several rules within the instant is there several times; its trajectory begins once.
        opened.retain(|&id| {
            let Some(state) = self.world.state_mut(id) else { return false };
            let begins = std::mem::take(&mut state.waits);
            if begins && state.rule.get().is_some() {
                state.restart(self.instant.number);
                let numeric_only = self.setup.numeric_only;
                self.flow().start_trajectories(id, numeric_only);
            }
            begins
        });
        if self.setup.looks_around || self.setup.is_algebraic {
            self.note_resting(&opened);
            self.flow().couple(&opened)?;
        }
        for &id in &opened {
            let state = self.world.state(id).filter(|s| s.rule.get().is_some() && !s.coupled);
            if state.is_some() {
                let now = self.instant.at;
                self.flow().look_ahead(id, now)?;
            }
        }
        clear(&mut opened);
        self.events.opened = opened;
        Ok(())
    }
}
