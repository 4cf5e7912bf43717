//! Next event of every module that has a state, ordered by time; an entry replaces the earlier one of the same owner.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use dlsys_tree::SimTime;

/// The subject of an entry: a slot of the tree, the coupled modules together, all that discrete rules apply to, or the
/// surroundings, which come last at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    Module(u32),
    Coupled,
    Derivation,
    Tick,
}

#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub at: SimTime,
    pub owner: Owner,
    serial: u32,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Entry) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Entry) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// The earliest is the greatest, because the heap gives the greatest first.
    fn cmp(&self, other: &Entry) -> Ordering {
        let time = other.at.partial_cmp(&self.at).unwrap_or(Ordering::Equal);
        time.then_with(|| other.owner.cmp(&self.owner)).then_with(|| other.serial.cmp(&self.serial))
    }
}

/// A queue in which an entry is replaced by a later one of the same module.
#[derive(Clone, Debug, Default)]
pub struct IndexedQueue {
    heap: BinaryHeap<Entry>,
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
                if self.serials.len() <= slot {
                    self.serials.resize(slot + 1, 0);
                }
                &mut self.serials[slot]
            }
        }
    }

    /// Removes the entry of an owner.
    pub fn cancel(&mut self, owner: Owner) {
        let serial = self.serial(owner);
        *serial = serial.wrapping_add(1);
    }

    /// Puts in the entry of an owner, in place of its earlier one.
    pub fn schedule(&mut self, owner: Owner, at: SimTime) {
        self.cancel(owner);
        let serial = *self.serial(owner);
        self.heap.push(Entry { at, owner, serial });
    }

    /// The earliest valid entry.
    pub fn peek(&mut self) -> Option<Entry> {
        while let Some(&entry) = self.heap.peek() {
            if *self.serial(entry.owner) == entry.serial {
                return Some(entry);
            }
            self.heap.pop();
        }
        None
    }

    /// Some modules whose entries come soon, the first of them first; some entries may be void.
    pub fn soon(&self) -> impl Iterator<Item = u32> {
        const FEW: usize = 3;
        self.heap.as_slice().iter().take(FEW).filter_map(|entry| match entry.owner {
            Owner::Module(slot) => Some(slot),
            _ => None,
        })
    }

    /// All valid entries, in no order.
    pub fn valid(&self) -> impl Iterator<Item = &Entry> {
        let serial = |owner| match owner {
            Owner::Coupled => Some(self.coupled),
            Owner::Derivation => Some(self.step),
            Owner::Tick => Some(self.tick),
            Owner::Module(slot) => self.serials.get(slot as usize).copied(),
        };
        self.heap.iter().filter(move |entry| serial(entry.owner) == Some(entry.serial))
    }

    /// Removes the entry that `peek` has returned.
    pub fn pop(&mut self) {
        self.heap.pop();
    }
}
