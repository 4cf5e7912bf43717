//! The schedule: the next event of every module, in one order of time.
//!
//! Two structures keep one order. The *indexed queue* holds the next event of every module that has a state, and can take
//! entries back; the *calendar queue* holds those of lazy modules, 12 bytes each, with the time as a float. The *batch*
//! is the earliest float of the calendar queue, its instants computed again to all digits. Within one instant, slots
//! decide.

mod calendar;
mod indexed;
mod sorting;

use std::cmp::Ordering;
use std::collections::HashSet;

use crate::world::World;
use calendar::CalendarQueue;
use dlsys_tree::{ModuleId, SimTime};
use indexed::IndexedQueue;

pub use indexed::{Entry, Owner};
pub use sorting::sort_by_time;

/// The lazy events of one float.
#[derive(Clone, Debug, Default)]
struct Batch {
    time: f64,
    /// The instants, if they are not all `first`.
    instants: Vec<SimTime>,
    first: SimTime,
    /// Slots, in the order of instants and slots.
    members: Vec<u32>,
    /// The number of members that have been taken.
    passed: usize,
}

impl Batch {
    fn head(&self) -> Option<(SimTime, u32)> {
        let slot = *self.members.get(self.passed)?;
        Some((self.instants.get(self.passed).copied().unwrap_or(self.first), slot))
    }

    /// Removes members that have not been taken yet, and returns them.
    fn remove(&mut self, is_gone: impl Fn(u32) -> bool) -> Vec<u32> {
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

/// The next entry of the schedule.
#[derive(Clone, Copy, Debug)]
pub enum NextEvent {
    /// The slot of a lazy module.
    Lazy(SimTime, u32),
    Other(Entry),
}

impl NextEvent {
    pub fn at(&self) -> SimTime {
        match self {
            NextEvent::Lazy(at, _) => *at,
            NextEvent::Other(entry) => entry.at,
        }
    }
}

/// True if an entry at an instant is passed on the way to `until`: events of that instant itself take place, a stretch that
/// was searched up to there is enough.
pub fn is_before(at: SimTime, event: bool, until: SimTime) -> bool {
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

/// The next event of every module, and how far time has passed.
#[derive(Clone, Debug, Default)]
pub struct Schedule {
    queue: IndexedQueue,
    calendar: CalendarQueue,
    batch: Batch,
    /// Slots of lazy modules that were cut off before their events: their entries in the calendar queue are void.
    tombstones: HashSet<u32>,
    /// Entries passed so far; the last of them, and whether it was an event.
    pub passed: u64,
    pub last: Option<(SimTime, bool)>,
}

impl Schedule {
    /// Puts in the next event of an owner, in place of the one that was known.
    pub fn schedule(&mut self, owner: Owner, at: SimTime) {
        self.queue.schedule(owner, at);
    }

    /// Removes the next event of an owner.
    pub fn cancel(&mut self, owner: Owner) {
        self.queue.cancel(owner);
    }

    /// Puts in the event of a lazy module. It is never taken back; see [`Schedule::bury`].
    #[inline]
    pub fn schedule_lazy(&mut self, time: f64, slot: u32) {
        self.calendar.push(time, slot);
    }

    /// Puts in the events of many lazy modules: the time of each, and its slot.
    pub fn schedule_all_lazy(&mut self, entries: Vec<(f64, u32)>) {
        self.calendar.push_all(entries);
    }

    /// Puts an entry back that was taken.
    pub fn put_back(&mut self, entry: NextEvent) {
        match entry {
            NextEvent::Lazy(at, slot) => self.calendar.push(at.to_f64(), slot),
            NextEvent::Other(entry) => self.queue.schedule(entry.owner, entry.at),
        }
    }

    /// The earliest entry. `instant_of` computes the instant of the event of the lazy module in a slot.
    pub fn peek(
        &mut self,
        world: &mut World,
        instant_of: impl FnMut(&mut World, u32) -> SimTime,
    ) -> Option<NextEvent> {
        let lazy = self.lazy_head(world, instant_of);
        match (lazy, self.queue.peek()) {
            (Some((at, slot)), Some(entry)) => {
                let order = at.partial_cmp(&entry.at).unwrap_or(Ordering::Equal);
                let first = order.then(Owner::Module(slot).cmp(&entry.owner)) == Ordering::Less;
                Some(if first { NextEvent::Lazy(at, slot) } else { NextEvent::Other(entry) })
            }
            (Some((at, slot)), None) => Some(NextEvent::Lazy(at, slot)),
            (None, other) => other.map(NextEvent::Other),
        }
    }

    /// The earliest event of a lazy module.
    fn lazy_head(
        &mut self,
        world: &mut World,
        mut instant_of: impl FnMut(&mut World, u32) -> SimTime,
    ) -> Option<(SimTime, u32)> {
        let next = self.calendar.earliest();
        if let Some(head) = self.batch.head()
            && next.is_none_or(|next| next > self.batch.time)
        {
            return Some(head);
        }
        if next.is_none() && self.batch.members.is_empty() && self.batch.time == f64::INFINITY {
            return None;
        }
        // An event may have been scheduled since that is not later.
        self.return_batch();
        let mut members = std::mem::take(&mut self.batch.members);
        while members.is_empty() && self.calendar.earliest().is_some() {
            self.batch.time = self.calendar.earliest().unwrap_or(f64::INFINITY);
            self.calendar.pop(&mut members);
            self.without_tombstones(world, &mut members);
        }
        if members.is_empty() {
            self.batch.time = f64::INFINITY;
        }
        if let Some(&some) = members.first() {
            self.batch.first = instant_of(world, some);
        }
        if members.iter().skip(1).any(|slot| instant_of(world, *slot) != self.batch.first) {
            let mut all: Vec<(SimTime, u32)> =
                members.iter().map(|slot| (instant_of(world, *slot), *slot)).collect();
            all.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
            members.clear();
            members.extend(all.iter().map(|(_, slot)| *slot));
            self.batch.instants.extend(all.iter().map(|(at, _)| *at));
        } else {
            sort(&mut members, world.tree.slots());
        }
        self.batch.members = members;
        self.batch.head()
    }

    /// Removes the entry that [`Schedule::peek`] has returned.
    pub fn take(&mut self, next: &NextEvent) {
        match next {
            NextEvent::Lazy(..) => self.batch.passed += 1,
            NextEvent::Other(_) => self.queue.pop(),
        }
    }

    /// Takes the whole batch, if all of it happens at one instant and nothing else does; `firing` gets its slots.
    pub fn take_batch(&mut self, at: SimTime, firing: &mut Vec<u32>) -> bool {
        let far = |time: f64| time - at.to_f64() > 2.0 * at.resolution();
        let alone = self.batch.instants.is_empty()
            && self.calendar.earliest().is_none_or(far)
            && self.queue.peek().is_none_or(|entry| far(entry.at.to_f64()));
        if !alone {
            return false;
        }
        std::mem::swap(firing, &mut self.batch.members);
        self.batch.members.clear();
        if self.batch.passed > 0 {
            firing.drain(..self.batch.passed);
            self.batch.passed = 0;
        }
        true
    }

    /// The slot of the lazy module whose event comes after the batch, if it is known without a search.
    pub fn upcoming_slot(&mut self) -> Option<u32> {
        self.calendar.earliest_slot()
    }

    /// Some modules with states whose entries come soon; some entries may be void.
    pub fn soon(&self) -> impl Iterator<Item = u32> {
        self.queue.soon()
    }

    /// The time of the earliest entry that is not of a lazy module; infinite if there is none.
    pub fn earliest_other(&mut self) -> f64 {
        self.queue.peek().map_or(f64::INFINITY, |entry| entry.at.to_f64())
    }

    /// Number of entries of lazy modules, about.
    pub fn lazy_entries(&self) -> usize {
        self.calendar.len()
    }

    /// True if so many lazy modules, at least, have their events before a time.
    pub fn has_lazy_before(&mut self, time: f64, number: usize) -> bool {
        self.return_batch();
        self.calendar.count_before(time, number) >= number
    }

    /// Takes the lazy modules out that have their events before a time: the float of each, and its slot.
    pub fn take_lazy_before(&mut self, time: f64, out: &mut Vec<(f64, u32)>) {
        self.return_batch();
        self.calendar.take_before(time, out);
    }

    /// Gives the batch back to the calendar queue.
    fn return_batch(&mut self) {
        let Batch { time, members, passed, instants, .. } = &mut self.batch;
        for &slot in &members[*passed..] {
            self.calendar.push(*time, slot);
        }
        members.clear();
        instants.clear();
        *passed = 0;
    }

    /// True if some entry within the resolution of `until` satisfies a condition, or is of a lazy module.
    pub fn any_at(&mut self, until: SimTime, is_event: impl Fn(Owner) -> bool) -> bool {
        let within = |at: SimTime| at.since(until) <= until.resolution();
        self.batch.head().is_some_and(|(at, _)| within(at))
            || self.calendar.earliest().map(SimTime::new).is_some_and(within)
            || self.queue.valid().any(|other| within(other.at) && is_event(other.owner))
    }

    /// Marks the entry of a lazy module that was cut off as void. Its slot stays empty until the entry comes up.
    pub fn bury(&mut self, id: ModuleId) {
        self.tombstones.insert(id.slot() as u32);
    }

    pub fn is_buried(&self, slot: u32) -> bool {
        self.tombstones.contains(&slot)
    }

    /// Removes void entries from the batch.
    pub fn clean_batch(&mut self, world: &mut World) {
        let tombstones = &self.tombstones;
        let freed = self.batch.remove(|slot| tombstones.contains(&slot));
        for slot in freed {
            self.tombstones.remove(&slot);
            world.tree.free_slot(slot);
        }
    }

    /// Removes modules that were cut off from a list of slots.
    fn without_tombstones(&mut self, world: &mut World, slots: &mut Vec<u32>) {
        if self.tombstones.is_empty() {
            return;
        }
        slots.retain(|slot| {
            let gone = self.tombstones.remove(slot);
            if gone {
                world.tree.free_slot(*slot);
            }
            !gone
        });
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
