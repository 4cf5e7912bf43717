//! Chains: lives that follow each other one by one, without the queue.
//!
//! A lazy module (`world::life`) whose production puts one lazy module in its place begins a *chain* of lives. In a model in which no module
//! reads another, a chain depends on nothing but the values and the birth of its first module. So chains are computed one beside the
//! other up to some time, many lives at once, and only the order of their productions is that of time:
//!
//! - [`law`]: of which classes of lives chains are made, and what they need of the model
//! - [`lanes`]: the lives of some newborns at once, by the functions of `flow::prediction`; [`straight`]: those without curves
//! - [`plan`]: the chains of a stretch of time, without a change of anything
//! - [`order`]: the productions of all chains, sorted
//! - [`threads`]: both on several threads, as many as [`Settings::threads`](crate::Settings::threads) allows
//!
//! The queue of events ([`Schedule`](crate::schedule)) is the general way, and decides whatever is unusual: two productions at nearly one
//! instant, successors that end at birth, short lives, errors, limits. A plan ends before the first such thing. The results are
//! the same bits, with all counts and numbers of groups; when chains are made is a matter of speed only.

mod lanes;
mod law;
mod order;
mod plan;
mod straight;

use crate::kernel::Simulation;
use crate::log::Event;
use dlsys_tree::{LastOfChain, SimTime};
use law::Law;
use order::Sorted;
use plan::{Course, Logged, Plan, plans};

/// Productions for which a plan is worth its beginning.
const FEW: usize = 64;
/// Productions that a plan should have, by the number of modules; memory and caches limit it. The least is for each thread: threads have to be
/// started.
const LEAST: usize = 1 << 14;
const MOST: usize = 1 << 17;
/// Productions by the queue before chains are tried, again and at last.
const FIRST_PAUSE: u64 = 256;
const LONGEST_PAUSE: u64 = 1 << 16;
/// Plans of one stretch, each shorter than the one before.
const TRIALS: usize = 3;
/// A plan keeps so many resolutions of time away from what happens in the general way.
const APART: f64 = 16.0;

/// When chains are made next.
#[derive(Clone, Debug)]
pub struct Chains {
    /// The number of productions from which on they are tried.
    next: u64,
    pause: u64,
    /// When the pause began: the time and the number of productions.
    mark: (SimTime, u64),
    /// The time that the last plan took, as far as it is known.
    length: Option<f64>,
    /// Productions in chains so far.
    pub productions: u64,
}

impl Default for Chains {
    fn default() -> Chains {
        Chains {
            next: FIRST_PAUSE,
            pause: FIRST_PAUSE,
            mark: (SimTime::ZERO, 0),
            length: None,
            productions: 0,
        }
    }
}

impl Chains {
    /// Leaves the next productions to the queue.
    fn rest(&mut self, now: SimTime, done: u64) {
        *self = Chains { next: done + self.pause, mark: (now, done), length: None, ..*self };
        self.pause = (2 * self.pause).min(LONGEST_PAUSE);
    }
}

/// The end of a stretch that keeps away from what happens at a time.
fn short_of(time: f64) -> f64 {
    if time.is_finite() { time - APART * SimTime::new(time).resolution() } else { time }
}

/// What happens in a stretch of time: each production once, in order, and what becomes of the modules.
struct Planned {
    plans: Vec<Plan>,
    events: Sorted,
    /// By entry, if productions are logged.
    logged: Vec<Logged>,
}

impl Simulation<'_> {
    /// Passes many productions of chains on the way to `t`; false if that is not worth while.
    #[inline]
    pub(super) fn pass_chains(&mut self, t: f64) -> bool {
        self.log.stats.events >= self.chains.next && self.try_chains(t)
    }

    fn try_chains(&mut self, t: f64) -> bool {
        let (setup, now) = (&self.setup, self.instant.at);
        let events = self.log.stats.events;
        let alone = setup.plain && setup.cuts.is_none() && setup.fast_path && !setup.numeric_only;
        if !alone || self.surroundings.is_some() {
            self.chains.next = u64::MAX;
            return false;
        }
        // A limit is exceeded by the production that exceeds it.
        let room = self.budget.left(&setup.settings, events.max(self.schedule.passed));
        if room < FEW as u64 || self.world.tree.len() >= setup.settings.max_modules {
            return false;
        }
        let (since, before) = self.chains.mark;
        let least = (LEAST * self.threads().max(1)).min(MOST);
        let wanted = (4 * self.schedule.lazy_entries()).clamp(least, MOST).min(room as usize / 2);
        let pace = now.since(since) / (events - before).max(1) as f64;
        let length = self.chains.length.unwrap_or(pace * wanted as f64);
        if !(length > 0.0 && length.is_finite()) {
            self.chains.rest(now, events);
            return false;
        }
        let until = short_of(t).min(now.to_f64() + length).min(short_of(self.schedule.earliest_other()));
        if !self.schedule.has_lazy_before(until, FEW) {
            // Too few up to an observation are no sign of more to come.
            match until < short_of(t) {
                true => self.chains.rest(now, events),
                false => self.chains.next = events + FEW as u64,
            }
            return false;
        }
        let Some(planned) = self.plan_chains(until, room) else {
            self.chains.rest(self.instant.at, events);
            return false;
        };
        let filled = planned.events.len() as f64 / wanted as f64;
        self.chains.length = Some(length / filled.clamp(0.25, 4.0));
        (self.chains.next, self.chains.pause) = (0, FIRST_PAUSE);
        self.carry_out(&planned);
        true
    }

    /// Threads that are worth their beginning for the modules there are.
    fn threads(&self) -> usize {
        let settings = &self.setup.settings;
        if self.world.tree.len() < settings.threads_from { 1 } else { settings.threads }
    }

    /// Plans for the chains up to a time, or to an earlier one, with their productions sorted. They are complete: what is in them has left
    /// the queue. None if there are none with enough productions.
    fn plan_chains(&mut self, until: f64, room: u64) -> Option<Planned> {
        let laws = Law::all(self.setup.model, &self.world.lives);
        let mut entries = Vec::new();
        self.schedule.take_lazy_before(until, &mut entries);
        // Memory is read and written in its order.
        entries.sort_unstable_by_key(|(_, slot)| *slot);
        let mut limit = until;
        for &(time, slot) in &entries {
            let label = self.world.tree.label(self.world.tree.id(slot));
            if laws.get(usize::from(label)).is_none_or(Option::is_none) {
                limit = limit.min(short_of(time));
            }
        }
        let (tree, lives, logs) = (&self.world.tree, &self.world.lives, self.log.records());
        let threads = self.threads();
        let mut later = Vec::new();
        for _ in 0..TRIALS {
            later.extend(entries.extract_if(.., |(time, _)| *time >= limit));
            if entries.len() < FEW {
                break;
            }
            let course = Course { tree, lives, laws: &laws, limit, logs };
            let slots: Vec<u32> = entries.iter().map(|(_, slot)| *slot).collect();
            let mut plans = plans(course, &slots, threads);
            let cut = plans.iter().map(|plan| plan.cut).fold(f64::INFINITY, f64::min);
            let (lists, logged) = plan::take_events(&mut plans);
            let events = Sorted::of(lists, threads);
            let near = events.near.map_or(f64::INFINITY, SimTime::to_f64);
            let excess = events.nth(room as usize).map_or(f64::INFINITY, |event| event.at.to_f64());
            let cut = cut.min(near).min(excess);
            if cut == f64::INFINITY {
                self.schedule.schedule_all_lazy(later);
                return Some(Planned { plans, events, logged });
            }
            limit = short_of(cut);
            if events.iter().take_while(|event| event.at.to_f64() < limit).count() < FEW {
                break;
            }
        }
        later.append(&mut entries);
        self.schedule.schedule_all_lazy(later);
        None
    }

    /// Makes what is planned so.
    fn carry_out(&mut self, planned: &Planned) {
        let Planned { plans, events, logged } = planned;
        let Some(last) = events.last() else { return };
        if self.log.records() {
            self.log_chains(events, logged);
        }
        let mut next = Vec::new();
        for plan in plans {
            for runner in plan.runners.iter().filter(|runner| runner.productions > 0) {
                let plan::Runner { slot, kind, birth, family, label, productions, values, .. } = *runner;
                let arguments = &plan.values[values.0 as usize..values.1 as usize];
                let last = LastOfChain { kind, arguments, birth, family, label, productions };
                self.world.tree.replace_chain(slot, &last);
                next.extend(runner.next.map(|time| (time, slot)));
            }
        }
        self.schedule.schedule_all_lazy(next);
        self.instant.at = last.at;
        let (productions, instants) = (events.len() as u64, events.instants);
        self.instant.number += instants;
        self.world.structure += instants;
        self.log.stats.events += productions;
        self.chains.productions += productions;
        self.schedule.passed += instants;
        self.schedule.last = Some((last.at, true));
        self.goes_on();
    }

    /// Records what takes place.
    fn log_chains(&mut self, events: &Sorted, logged: &[Logged]) {
        let mut group = self.instant.number;
        let mut before = None;
        for happened in events.iter() {
            group += u64::from(before != Some(happened.at));
            before = Some(happened.at);
            let Logged { lineage, kind, rule, clause, residual } = logged[happened.entry as usize];
            let time = happened.at.to_f64();
            let (successor, made, transition) = (None, 1, None);
            #[rustfmt::skip]
            self.log.add(Event { time, lineage, kind, rule, clause, successor, made, residual, group, transition });
        }
    }
}
