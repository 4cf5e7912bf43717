//! Next event of every module that has a state, ordered by time; an entry replaces the earlier one of the same owner.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use dlsys_tree::{SimTime, room};

/// The subject of an entry: a slot of the tree, the coupled modules together, all that discrete rules apply to, or the
/// surroundings, which come last at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    Module(u32),
    Coupled,
    Derivation,
    Tick,
}

impl Owner {
    // No slot is as large as these.
    const COUPLED: u32 = u32::MAX - 2;
    const DERIVATION: u32 = u32::MAX - 1;
    const TICK: u32 = u32::MAX;

    /// As a number, in the same order.
    fn number(self) -> u32 {
        match self {
            Owner::Module(slot) => slot,
            Owner::Coupled => Owner::COUPLED,
            Owner::Derivation => Owner::DERIVATION,
            Owner::Tick => Owner::TICK,
        }
    }

    fn of_number(number: u32) -> Owner {
        match number {
            Owner::COUPLED => Owner::Coupled,
            Owner::DERIVATION => Owner::Derivation,
            Owner::TICK => Owner::Tick,
            slot => Owner::Module(slot),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub at: SimTime,
    pub owner: Owner,
}

/// An entry as the queue keeps it: 24 bytes, because there are as many as modules, and more that are void.
#[derive(Clone, Copy, Debug)]
struct Kept {
    at: SimTime,
    owner: u32,
    serial: u32,
}

impl Kept {
    fn entry(&self) -> Entry {
        Entry { at: self.at, owner: Owner::of_number(self.owner) }
    }
}

impl PartialEq for Kept {
    fn eq(&self, other: &Kept) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Kept {}

impl PartialOrd for Kept {
    fn partial_cmp(&self, other: &Kept) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Kept {
    /// The earliest is the greatest, because the heap gives the greatest first.
    fn cmp(&self, other: &Kept) -> Ordering {
        let time = other.at.partial_cmp(&self.at).unwrap_or(Ordering::Equal);
        time.then_with(|| other.owner.cmp(&self.owner)).then_with(|| other.serial.cmp(&self.serial))
    }
}

/// A queue in which an entry is replaced by a later one of the same module.
#[derive(Clone, Debug, Default)]
pub struct IndexedQueue {
    heap: BinaryHeap<Kept>,
    /// The valid entry of each slot.
    serials: Vec<u32>,
    coupled: u32,
    step: u32,
    tick: u32,
}

impl IndexedQueue {
    fn serial(&mut self, owner: Owner) -> &mut u32 {
        match owner {
            Owner::Coupled => &mut self.coupled,
            Owner::Derivation => &mut self.step,
            Owner::Tick => &mut self.tick,
            Owner::Module(slot) => {
                let slot = slot as usize;
                room::cover(&mut self.serials, slot, || 0);
                &mut self.serials[slot]
            }
        }
    }

    /// Removes the entry of an owner.
    pub fn cancel(&mut self, owner: Owner) {
        if let Owner::Module(slot) = owner
            && slot as usize >= self.serials.len()
        {
            // It has never had one.
            return;
        }
        let serial = self.serial(owner);
        *serial = serial.wrapping_add(1);
    }

    /// Puts in the entry of an owner, in place of its earlier one.
    pub fn schedule(&mut self, owner: Owner, at: SimTime) {
        let serial = self.serial(owner);
        *serial = serial.wrapping_add(1);
        let serial = *serial;
        if self.heap.len() == self.heap.capacity() {
            self.heap.reserve_exact(room::step(self.heap.len()));
        }
        self.heap.push(Kept { at, owner: owner.number(), serial });
    }

    /// The earliest valid entry.
    pub fn peek(&mut self) -> Option<Entry> {
        while let Some(&kept) = self.heap.peek() {
            let entry = kept.entry();
            if *self.serial(entry.owner) == kept.serial {
                return Some(entry);
            }
            self.heap.pop();
        }
        None
    }

    /// Some modules whose entries come soon, the first of them first; some entries may be void.
    pub fn soon(&self) -> impl Iterator<Item = u32> {
        const FEW: usize = 3;
        self.heap.as_slice().iter().take(FEW).filter_map(|kept| match kept.entry().owner {
            Owner::Module(slot) => Some(slot),
            _ => None,
        })
    }

    /// All valid entries, in no order.
    pub fn valid(&self) -> impl Iterator<Item = Entry> {
        let serial = |owner| match owner {
            Owner::Coupled => Some(self.coupled),
            Owner::Derivation => Some(self.step),
            Owner::Tick => Some(self.tick),
            Owner::Module(slot) => self.serials.get(slot as usize).copied(),
        };
        let valid = move |kept: &Kept| serial(kept.entry().owner) == Some(kept.serial);
        self.heap.iter().filter(move |kept| valid(kept)).map(Kept::entry)
    }

    /// Removes the entry that `peek` has returned.
    pub fn pop(&mut self) {
        self.heap.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn owners_are_numbered_in_their_order() {
        let all = [Owner::Module(0), Owner::Module(7), Owner::Coupled, Owner::Derivation, Owner::Tick];
        assert!(all.is_sorted() && all.map(Owner::number).is_sorted());
        assert_eq!(all.map(|owner| Owner::of_number(owner.number())), all);
    }

    #[test]
    fn a_later_entry_of_an_owner_takes_the_place_of_the_one_before() {
        let mut queue = IndexedQueue::default();
        queue.schedule(Owner::Module(3), SimTime::new(2.0));
        queue.schedule(Owner::Coupled, SimTime::new(1.0));
        queue.schedule(Owner::Module(3), SimTime::new(0.5));
        queue.schedule(Owner::Module(1), SimTime::new(1.0));
        queue.cancel(Owner::Tick);
        let mut order = Vec::new();
        while let Some(Entry { at, owner }) = queue.peek() {
            order.push((at.to_f64(), owner));
            queue.pop();
        }
        assert_eq!(order, [(0.5, Owner::Module(3)), (1.0, Owner::Module(1)), (1.0, Owner::Coupled)]);
    }
}
