//! What a run may take: productions and steps, seconds, memory. So that what runs away ends with a message.
//!
//! A life of 1e-18, an event at rate 1e300 or a step of 1e-300 never ends, and no count of modules grows. So time is
//! watched, too: where at the pace of the last hundred thousand things, and of those before, a run would take a hundred
//! times what it may, it is stopped at once. A structure of many modules may have much to do at one time: what counts is many
//! things for each module. Results do not depend on any of this, unless it is exceeded.

use std::time::{Duration, Instant as Wall};

use super::error::{Error, Site};
use super::passing::Coming;
use super::queue::Who;
use super::simulation::Simulation;
use crate::memory::{self, Shortage};
use dlsys_model::Successor;
use dlsys_tree::{ModuleId, SimTime, Visit};

/// Things after which the pace is looked at: so many at least, and so many for each module.
const LOOK: u64 = 100_000;
const LOOK_PER_MODULE: u64 = 25;
/// Looks in a row that must find the run too slow, none much better than the first.
const LOOKS: u32 = 4;
const BETTER: f64 = 2.0;
/// Times what it may take, that a run is foreseen to take.
const FAR_TOO_MANY: f64 = 100.0;

/// Bytes a module in lists of what happens at one instant, and in a string that is observed.
const IN_LISTS: u64 = 64;
const IN_STRING: u64 = 160;

/// What was spent so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Budget {
    /// When to look next, in things done.
    next: u64,
    /// Things done at the last look, and the time then.
    done: u64,
    mark: SimTime,
    /// Looks in a row that have found the run far too slow, and by how much the first.
    slow: u32,
    first: f64,
    /// Wall time of earlier calls, and when the present one began.
    spent: Duration,
    since: Option<Wall>,
}

impl Simulation<'_> {
    /// Productions and steps so far. One entry of the queue may be many productions, and most are one.
    fn done(&self) -> u64 {
        self.stats.events.max(self.passed)
    }

    /// Begins to count seconds, if they are limited.
    pub(super) fn start_clock(&mut self) {
        self.budget.since = self.settings.max_seconds.is_finite().then(Wall::now);
    }

    pub(super) fn stop_clock(&mut self) {
        if let Some(since) = self.budget.since.take() {
            self.budget.spent += since.elapsed();
        }
    }

    fn is_overtime(&self) -> bool {
        let Some(since) = self.budget.since else { return false };
        (self.budget.spent + since.elapsed()).as_secs_f64() > self.settings.max_seconds
    }

    /// Sees to it that what comes next may still be done, on the way to some time.
    #[inline]
    pub(super) fn watch_budget(&mut self, coming: Coming, until: SimTime) -> Result<(), Error> {
        if self.done() < self.budget.next && self.budget.since.is_none() {
            return Ok(());
        }
        self.look_at_budget(coming, until)
    }

    #[cold]
    fn look_at_budget(&mut self, coming: Coming, until: SimTime) -> Result<(), Error> {
        if self.is_overtime() {
            let (site, limit) = (self.site_of_coming(coming), self.settings.max_seconds);
            return Err(Error::OutOfTime { site, limit });
        }
        let (done, limit) = (self.done(), self.settings.max_events);
        if done < self.budget.next {
            return Ok(());
        }
        if done >= limit {
            return Err(Error::TooManyEvents { site: self.site_of_coming(coming), limit, foreseen: None });
        }
        let at = coming.at();
        let (some, time) = (done - self.budget.done, at.since(self.budget.mark));
        let foreseen = some as f64 * (until.since(at).max(0.0) / time.max(0.0));
        if until.to_f64().is_finite() && self.budget.next > 0 && foreseen > FAR_TOO_MANY * limit as f64 {
            if self.budget.slow == 0 || time > BETTER * self.budget.first {
                (self.budget.slow, self.budget.first) = (0, time);
            }
            self.budget.slow += 1;
            if self.budget.slow >= LOOKS {
                let foreseen = Some(Box::new((foreseen, until.to_f64())));
                return Err(Error::TooManyEvents { site: self.site_of_coming(coming), limit, foreseen });
            }
        } else {
            self.budget.slow = 0;
        }
        (self.budget.done, self.budget.mark) = (done, at);
        let window = LOOK.max(LOOK_PER_MODULE * self.plant.tree.len() as u64);
        self.budget.next = (done + window).min(limit);
        Ok(())
    }

    /// The same in the middle of an instant, after a round of productions: `id` is who is next.
    pub(super) fn watch_round(&mut self, id: impl FnOnce(&mut Self) -> Site) -> Result<(), Error> {
        if self.stats.events > self.settings.max_events {
            let limit = self.settings.max_events;
            return Err(Error::TooManyEvents { site: id(self), limit, foreseen: None });
        }
        if self.is_overtime() {
            let limit = self.settings.max_seconds;
            return Err(Error::OutOfTime { site: id(self), limit });
        }
        Ok(())
    }

    /// Whose turn it is.
    fn site_of_coming(&mut self, coming: Coming) -> Site {
        let at = coming.at();
        let id = match coming {
            Coming::Light(_, slot) => self.plant.tree.id(slot),
            Coming::Other(entry) => match entry.who {
                Who::Module(slot) => match &self.plant.states[slot as usize] {
                    Some(state) => state.id,
                    None => self.anyone(),
                },
                Who::Step => self.steps.first().unwrap_or_else(|| self.anyone()),
                Who::Coupled => self.anyone(),
            },
        };
        self.site_of_module(id, at)
    }

    /// A module, with the clause that it follows, or the production that it is about to make, as far as that is known.
    fn site_of_module(&mut self, id: ModuleId, at: SimTime) -> Site {
        let model = self.model;
        let career = self.plant.careers.get(self.plant.tree.label(id));
        let known = career.map(|career| (career.rule, career.produce()));
        if let Some((rule, produce)) = known {
            let span = produce.map_or(model.rules[rule].span, |p| model.rules[rule].produces[p].span);
            return self.site_of(id, rule, span, at.to_f64());
        }
        let kind = model.kinds.get(self.plant.tree.kind(id));
        let state = self.plant.state(id);
        let own = state.and_then(|state| Some((state.rule?, state.solve)));
        let first = || kind.rules.first().or(kind.steps.first()).copied().unwrap_or(0);
        let (rule, solve) = own.unwrap_or_else(|| (first(), None));
        let Some(found) = model.rules.get(rule) else {
            return self.site_of_axiom(at.to_f64());
        };
        let span = solve.map_or(found.span, |solve| found.solves[solve].span);
        self.site_of(id, rule, span, at.to_f64())
    }

    /// Asks for memory before it is needed.
    pub(super) fn afford(&mut self, bytes: u64, site: impl FnOnce(&mut Self) -> Site) -> Result<(), Error> {
        let used = self.plant.tree.size() as u64;
        memory::ask(bytes, self.settings.max_memory, used).map_err(|shortage| {
            let site = site(self);
            self.out_of_memory(shortage, site)
        })
    }

    pub(super) fn out_of_memory(&self, shortage: Shortage, site: Site) -> Error {
        Error::OutOfMemory { modules: self.plant.tree.len(), shortage: Box::new(shortage), site }
    }

    /// Asks for the lists that so many productions of one instant take.
    pub(super) fn afford_round(&mut self, productions: usize, id: Option<ModuleId>) -> Result<(), Error> {
        let bytes = productions as u64 * (IN_LISTS + if self.steps.due { 2 * IN_LISTS } else { 0 });
        // Lists are there twice while they grow.
        self.afford(3 * bytes, |simulation| match id {
            Some(id) => simulation.site_of_module(id, simulation.now),
            None => simulation.site_of_axiom(simulation.now.to_f64()),
        })
    }

    /// Asks for what it takes to write the structure out.
    pub(super) fn afford_string(&mut self) -> Result<(), Error> {
        let (nodes, values) = self.plant.tree.extent();
        let bytes = nodes as u64 * IN_STRING + 16 * values as u64;
        self.afford(bytes, |simulation| {
            let some = simulation.plant.tree.walk().find_map(|visit| match visit {
                Visit::Module(id) => Some(id),
                _ => None,
            });
            match some {
                Some(id) => simulation.site_of_module(id, simulation.now),
                None => simulation.site_of_axiom(simulation.now.to_f64()),
            }
        })
    }

    /// Sees to it that a successor has a place. Where lists must grow for that, they are twice as long afterwards, and all
    /// that is known of modules is going to be: that is asked for at once.
    #[inline]
    pub(super) fn room_for(&mut self, successor: &Successor) -> Result<(), Shortage> {
        match self.plant.tree.has_room(&successor.kinds, successor.width()) {
            true => Ok(()),
            false => self.grow(successor),
        }
    }

    #[cold]
    fn grow(&mut self, successor: &Successor) -> Result<(), Shortage> {
        let wanted = 2 * self.size() as u64 + IN_LISTS * self.plant.tree.slots() as u64;
        memory::ask(wanted, self.settings.max_memory, self.plant.tree.size() as u64)?;
        let grown = self.plant.tree.make_room(&successor.kinds, successor.width());
        grown.map_err(|_| Shortage { wanted, there: None, own_limit: false })
    }
}
