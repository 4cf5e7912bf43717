//! The next thing that is known of each module that is not light, in order of time.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use dlsys_tree::SimTime;

/// Who an entry is about: a slot of the tree, the coupled modules together, or all that discrete rules apply to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Who {
    Module(u32),
    Coupled,
    Step,
}

#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub at: SimTime,
    pub who: Who,
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
        time.then_with(|| other.who.cmp(&self.who)).then_with(|| other.serial.cmp(&self.serial))
    }
}

/// A queue in which an entry is replaced by a later one of the same module.
#[derive(Clone, Debug, Default)]
pub struct Queue {
    heap: BinaryHeap<Entry>,
    /// The valid entry of each slot.
    serials: Vec<u32>,
    coupled: u32,
    step: u32,
}

impl Queue {
    fn serial(&mut self, who: Who) -> &mut u32 {
        match who {
            Who::Coupled => &mut self.coupled,
            Who::Step => &mut self.step,
            Who::Module(slot) => {
                let slot = slot as usize;
                if self.serials.len() <= slot {
                    self.serials.resize(slot + 1, 0);
                }
                &mut self.serials[slot]
            }
        }
    }

    /// Forgets what was known.
    pub fn cancel(&mut self, who: Who) {
        let serial = self.serial(who);
        *serial = serial.wrapping_add(1);
    }

    /// Puts in what is known now, in place of what was.
    pub fn schedule(&mut self, who: Who, at: SimTime) {
        self.cancel(who);
        let serial = *self.serial(who);
        self.heap.push(Entry { at, who, serial });
    }

    /// The earliest valid entry.
    pub fn peek_other(&mut self) -> Option<Entry> {
        while let Some(&entry) = self.heap.peek() {
            if *self.serial(entry.who) == entry.serial {
                return Some(entry);
            }
            self.heap.pop();
        }
        None
    }

    /// All valid entries, in no order.
    pub fn valid(&self) -> impl Iterator<Item = &Entry> {
        let serial = |who| match who {
            Who::Coupled => Some(self.coupled),
            Who::Step => Some(self.step),
            Who::Module(slot) => self.serials.get(slot as usize).copied(),
        };
        self.heap.iter().filter(move |entry| serial(entry.who) == Some(entry.serial))
    }

    /// Takes out what `peek_other` has shown.
    pub fn pop(&mut self) {
        self.heap.pop();
    }
}
