//! The passing of time: what comes next, and what happens together.
//!
//! Two queues are one order: that of modules with a state (`queue`), and that of light ones (`agenda`), which says of
//! an event no more than its time as a float. The *front* is what comes first of the latter, with its instants to all
//! their digits. Within one instant, slots decide.

use std::cmp::Ordering;

use super::error::Error;
use super::queue::{Entry, Who};
use super::simulation::Simulation;
use super::state::What;
use dlsys_tree::{ModuleId, SimTime};

/// The light events of one float.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    time: f64,
    /// The instants, if they are not all `first`.
    instants: Vec<SimTime>,
    first: SimTime,
    /// In order of instants and slots.
    members: Vec<u32>,
    /// How many of them are gone.
    passed: usize,
}

impl Front {
    fn head(&self) -> Option<(SimTime, u32)> {
        let slot = *self.members.get(self.passed)?;
        Some((self.instants.get(self.passed).copied().unwrap_or(self.first), slot))
    }

    /// Takes out some of those who are still to come, and tells them.
    pub(super) fn remove(&mut self, is_gone: impl Fn(u32) -> bool) -> Vec<u32> {
        let mut gone = Vec::new();
        let mut kept = self.passed;
        for i in self.passed..self.members.len() {
            if is_gone(self.members[i]) {
                gone.push(self.members[i]);
                continue;
            }
            self.members.swap(kept, i);
            if !self.instants.is_empty() {
                self.instants.swap(kept, i);
            }
            kept += 1;
        }
        self.members.truncate(kept);
        self.instants.truncate(kept);
        gone
    }
}

/// What is known to come.
#[derive(Clone, Copy, Debug)]
pub(super) enum Coming {
    /// The slot of a light module.
    Light(SimTime, u32),
    Other(Entry),
}

impl Coming {
    pub fn at(&self) -> SimTime {
        match self {
            Coming::Light(at, _) => *at,
            Coming::Other(entry) => entry.at,
        }
    }
}

/// True if what comes at an instant is passed on the way to another: events of that instant itself take place, what is
/// known up to there is enough.
pub(super) fn is_before(at: SimTime, event: bool, until: SimTime) -> bool {
    let ahead = at.since(until);
    if event { ahead <= until.resolution() } else { ahead < 0.0 }
}

/// Sorts numbers below `end`, each of which is there once.
fn sort(numbers: &mut Vec<u32>, end: usize) {
    if numbers.is_sorted() {
        return;
    }
    // Where they are a good part of all, they need not be compared.
    if numbers.len() < end / 64 {
        return numbers.sort_unstable();
    }
    let mut there = vec![0u64; end / 64 + 1];
    for number in numbers.drain(..) {
        there[number as usize / 64] |= 1 << (number % 64);
    }
    for (i, &word) in there.iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            numbers.push(i as u32 * 64 + rest.trailing_zeros());
            rest &= rest - 1;
        }
    }
}

impl Simulation<'_> {
    /// What comes next.
    pub(super) fn coming(&mut self) -> Option<Coming> {
        let light = self.light_head();
        let other = self.queue.peek_other();
        match (light, other) {
            (Some((at, slot)), Some(entry)) => {
                let order = at.partial_cmp(&entry.at).unwrap_or(Ordering::Equal);
                let first = order.then(Who::Module(slot).cmp(&entry.who)) == Ordering::Less;
                Some(if first { Coming::Light(at, slot) } else { Coming::Other(entry) })
            }
            (Some((at, slot)), None) => Some(Coming::Light(at, slot)),
            (None, other) => other.map(Coming::Other),
        }
    }

    /// The first light event.
    fn light_head(&mut self) -> Option<(SimTime, u32)> {
        let next = self.agenda.earliest();
        if let Some(head) = self.front.head() {
            if next.is_none_or(|next| next > self.front.time) {
                return Some(head);
            }
            // Something came up that is not later.
            let Front { time, members, passed, .. } = &mut self.front;
            for &slot in &members[*passed..] {
                self.agenda.push(*time, slot);
            }
        }
        let mut members = std::mem::take(&mut self.front.members);
        members.clear();
        self.front.instants.clear();
        self.front.passed = 0;
        while members.is_empty() && self.agenda.earliest().is_some() {
            self.front.time = self.agenda.earliest().unwrap_or(f64::INFINITY);
            self.agenda.pop(&mut members);
            self.without_ghosts(&mut members);
        }
        if members.is_empty() {
            self.front.time = f64::INFINITY;
        }
        if let Some(&some) = members.first() {
            self.front.first = self.event_of(some);
        }
        if members.iter().skip(1).any(|slot| self.event_of(*slot) != self.front.first) {
            let mut all: Vec<(SimTime, u32)> =
                members.iter().map(|slot| (self.event_of(*slot), *slot)).collect();
            all.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
            members.clear();
            members.extend(all.iter().map(|(_, slot)| *slot));
            self.front.instants.extend(all.iter().map(|(at, _)| *at));
        } else {
            sort(&mut members, self.plant.tree.slots());
        }
        self.front.members = members;
        self.front.head()
    }

    /// Takes out what `coming` has shown.
    fn take(&mut self, coming: &Coming) {
        match coming {
            Coming::Light(..) => self.front.passed += 1,
            Coming::Other(_) => self.queue.pop(),
        }
    }

    /// Lets every event up to `t` take place, and finds out what every module does until then.
    pub(super) fn advance(&mut self, t: f64) -> Result<(), Error> {
        while self.advance_once(t)?.is_some() {}
        Ok(())
    }

    /// Passes the next thing that is known to come, if that is before `t`; tells whether it was an event.
    pub(super) fn advance_once(&mut self, t: f64) -> Result<Option<bool>, Error> {
        let until = SimTime::new(t);
        let Some(coming) = self.coming() else { return Ok(None) };
        let event = match coming {
            Coming::Other(entry) => self.is_event(entry.who),
            Coming::Light(..) => true,
        };
        if !is_before(coming.at(), event, until) && (event || !self.is_in_the_way(coming, until)) {
            return Ok(None);
        }
        self.watch_budget(coming, until)?;
        (self.passed, self.last) = (self.passed + 1, Some((coming.at(), event)));
        match coming {
            Coming::Other(entry) if !event => {
                self.queue.pop();
                self.pass_end(entry)?;
            }
            _ => self.pass_event(coming)?,
        }
        Ok(Some(event))
    }

    /// True for the end of what is known if it comes at the very instant up to which time passes, and what happens then is
    /// known only, or comes up only, when one has gone on from there.
    fn is_in_the_way(&mut self, coming: Coming, until: SimTime) -> bool {
        let Coming::Other(entry) = coming else { return false };
        let within = |at: SimTime| at.since(until) <= until.resolution();
        if !within(entry.at) {
            return false;
        }
        // The stretch of a formula that was searched costs nothing to go on from.
        if let Who::Module(slot) = entry.who
            && self.plant.states[slot as usize].as_ref().is_some_and(|s| s.coupled || !s.is_numeric())
        {
            return true;
        }
        // A step more may lead where nobody wanted to go.
        self.front.head().is_some_and(|(at, _)| within(at))
            || self.agenda.earliest().map(SimTime::new).is_some_and(within)
            || self.queue.valid().any(|other| within(other.at) && self.is_event(other.who))
    }

    /// True if the entry is an event, not the end of what is known.
    fn is_event(&self, who: Who) -> bool {
        match who {
            Who::Coupled => false,
            Who::Step => true,
            Who::Module(slot) => {
                let state = self.plant.states[slot as usize].as_ref();
                state.is_some_and(|s| s.next.what != What::Window)
            }
        }
    }

    /// Goes on from the end of what is known.
    fn pass_end(&mut self, entry: Entry) -> Result<(), Error> {
        self.stalled = 0;
        match entry.who {
            Who::Coupled => self.pass_coupled_step(entry.at),
            Who::Step => unreachable!("a step is an event"),
            Who::Module(slot) => {
                let id = self.plant.states[slot as usize].as_ref().expect("scheduled").id;
                self.pass_window(id, entry.at)
            }
        }
    }

    /// Goes to an event and through it, with all that happens at the same instant.
    fn pass_event(&mut self, first: Coming) -> Result<(), Error> {
        let at = first.at();
        if let Coming::Light(_, slot) = first
            && self.only_the_front(at)
        {
            // All of the front, at one instant.
            self.now = at;
            // Who comes next is fetched from memory meanwhile.
            if let Some(slot) = self.agenda.earliest_slot() {
                std::hint::black_box(self.plant.tree.birth(self.plant.tree.id(slot)));
            }
            self.show_coupled(at);
            std::mem::swap(&mut self.firing_light, &mut self.front.members);
            self.front.members.clear();
            if self.front.passed > 0 {
                self.firing_light.drain(..self.front.passed);
                self.front.passed = 0;
            }
            self.watch_for_piling_up(self.plant.tree.id(slot))?;
            return self.settle_lightly();
        }
        let oldest = self.gather(at)?;
        if let Some(id) = oldest {
            self.watch_for_piling_up(id)?;
        }
        let before = self.stats.events;
        self.settle()?;
        match oldest {
            Some(id) if self.stats.events == before => self.watch_for_standstill(id),
            _ => Ok(()),
        }
    }

    /// Equations that change again and again at one instant.
    fn watch_for_standstill(&mut self, id: ModuleId) -> Result<(), Error> {
        /// Others may happen at nearly the same instant, within its resolution; so many do not.
        const MOST: usize = 1000;
        let (since, times) = self.standing;
        let stands = self.now.since(since) <= self.now.resolution();
        self.standing = if stands { (since, times + 1) } else { (self.now, 0) };
        if times <= MOST || !stands {
            return Ok(());
        }
        let rule = self.plant.rule_and_clause(id).0.unwrap_or(0);
        let site = self.site_of(id, rule, self.model.rules[rule].span, self.now.to_f64());
        Err(Error::Chattering { site })
    }

    /// True if all of the front has one instant, and nothing else happens then.
    fn only_the_front(&mut self, at: SimTime) -> bool {
        let far = |time: f64| time - at.to_f64() > 2.0 * at.resolution();
        self.front.instants.is_empty()
            && self.agenda.earliest().is_none_or(far)
            && self.queue.peek_other().is_none_or(|entry| far(entry.at.to_f64()))
    }

    /// Opens everything that happens at an instant; tells the first module of it.
    fn gather(&mut self, at: SimTime) -> Result<Option<ModuleId>, Error> {
        let mut group = std::mem::take(&mut self.group_entries);
        group.clear();
        let mut first: Option<(SimTime, f64)> = None;
        let mut later = Vec::new();
        while let Some(coming) = self.coming() {
            if coming.at().since(at) > at.resolution() {
                break;
            }
            self.take(&coming);
            let id = match coming {
                // The common step does not go on before what happens at this instant.
                Coming::Other(Entry { who: Who::Coupled, .. }) if !group.is_empty() => {
                    later.push(coming);
                    continue;
                }
                Coming::Other(entry) if !self.is_event(entry.who) => {
                    self.pass_end(entry)?;
                    continue;
                }
                Coming::Light(_, slot) => Some(self.plant.tree.id(slot)),
                Coming::Other(Entry { who: Who::Module(slot), .. }) => {
                    Some(self.plant.states[slot as usize].as_ref().expect("scheduled").id)
                }
                Coming::Other(_) => None,
            };
            if let Some(id) = id {
                let birth = self.plant.tree.birth(id);
                match first {
                    None => first = Some((birth, at.since(birth))),
                    // Those born together have clocks that are as good as their age is short.
                    Some((elder, age)) if elder == birth => {
                        if coming.at().since(birth) - age > SimTime::new(age).resolution() {
                            later.push(coming);
                            continue;
                        }
                    }
                    Some(_) => {}
                }
            }
            group.push(coming);
        }
        for coming in later {
            match coming {
                Coming::Light(at, slot) => self.agenda.push(at.to_f64(), slot),
                Coming::Other(entry) => self.queue.schedule(entry.who, entry.at),
            }
        }
        self.now = at;
        self.show_coupled(at);
        let all_light = group.iter().all(|coming| match coming {
            Coming::Light(..) => true,
            Coming::Other(entry) => entry.who == Who::Step,
        });
        let mut oldest = None;
        for coming in &group {
            let who = match *coming {
                Coming::Light(_, slot) if all_light => {
                    self.firing_light.push(slot);
                    oldest = oldest.or(Some(self.plant.tree.id(slot)));
                    continue;
                }
                Coming::Light(_, slot) => {
                    self.promote(self.plant.tree.id(slot));
                    Who::Module(slot)
                }
                Coming::Other(entry) => entry.who,
            };
            let first = match who {
                Who::Coupled => None,
                Who::Step => {
                    self.begin_step();
                    None
                }
                Who::Module(slot) => match self.fire_quickly(slot as usize) {
                    Some(firing) => {
                        let id = firing.id;
                        self.firing.push(firing);
                        Some(id)
                    }
                    None => Some(self.touch_alone(slot as usize)?),
                },
            };
            oldest = oldest.or(first);
        }
        self.group_entries = group;
        self.join_ties();
        Ok(oldest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slots_are_sorted_whether_they_are_many_or_few(
            slots in proptest::collection::hash_set(0..1000u32, 0..200),
            end in 1000..40_000usize,
        ) {
            let mut numbers: Vec<u32> = slots.into_iter().collect();
            let mut expected = numbers.clone();
            expected.sort();
            sort(&mut numbers, end);
            prop_assert_eq!(numbers, expected);
        }
    }
}
