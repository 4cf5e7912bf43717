//! What the modules of one successor have in common: when they were born, and of whom.
//!
//! A production makes several modules at once. Birth and line of descent are kept once for all of them, and given up
//! when the last of them is gone.

use std::collections::BTreeMap;

use super::{Family, Lineage, SimTime};

/// No brood: brackets are of none.
pub(super) const NO_BROOD: u32 = u32::MAX;

/// Places of the last seven generations: the eighth is that of the module itself. The highest byte counts modules.
const TRAIL: u64 = (1 << 56) - 1;
const ONE: u64 = 1 << 56;
/// So many are not counted any more; what is known of them is kept for good.
const UNCOUNTED: u64 = 255;

#[derive(Clone, Copy, Debug)]
struct Brood {
    mixed: u64,
    trail: u64,
    birth: SimTime,
}

/// All broods, by number; numbers are used again.
#[derive(Clone, Debug, Default)]
pub(super) struct Broods {
    all: Vec<Brood>,
    /// Their numbers of generations. Beside the rest, so that neither leaves a gap.
    generations: Vec<u32>,
    /// Where the places of a brood begin in the successor, for the further ones of a very long successor.
    begins: BTreeMap<u32, u32>,
    free: Vec<u32>,
}

impl Broods {
    /// Bytes that they take, about.
    pub fn size(&self) -> usize {
        size_of_val(&self.all[..]) + size_of_val(&self.generations[..]) + 4 * self.free.len()
    }

    /// A new brood, of nobody yet, whose modules stand at these places of the successor (brackets not counted).
    pub fn begin(&mut self, family: Family, birth: SimTime, first: u32) -> u32 {
        let brood = Brood { mixed: family.mixed, trail: family.trail & TRAIL, birth };
        let number = match self.free.pop() {
            Some(number) => {
                self.all[number as usize] = brood;
                self.generations[number as usize] = family.generation;
                number
            }
            None => {
                self.all.push(brood);
                self.generations.push(family.generation);
                self.all.len() as u32 - 1
            }
        };
        if first > 0 {
            self.begins.insert(number, first);
        }
        number
    }

    /// Counts the modules of a new brood, if it is one.
    pub fn count(&mut self, number: u32, modules: u16) {
        if number != NO_BROOD {
            self.all[number as usize].trail += u64::from(modules).min(UNCOUNTED) * ONE;
        }
    }

    /// One module is gone.
    pub fn leave(&mut self, number: u32) {
        let brood = &mut self.all[number as usize];
        match brood.trail / ONE {
            UNCOUNTED => {}
            1 => {
                brood.trail -= ONE;
                self.free.push(number);
                if !self.begins.is_empty() {
                    self.begins.remove(&number);
                }
            }
            _ => brood.trail -= ONE,
        }
    }

    pub fn birth(&self, number: u32) -> SimTime {
        self.all[number as usize].birth
    }

    pub fn lineage(&self, number: u32, place: u16) -> Lineage {
        let Brood { mixed, trail, .. } = self.all[number as usize];
        let generation = self.generations[number as usize];
        let first = if self.begins.is_empty() { None } else { self.begins.get(&number) };
        let place = *first.unwrap_or(&0) as usize + usize::from(place);
        Family { mixed, generation, trail: trail & TRAIL }.child(place)
    }

    /// Becomes the same as another, but for what only matters to those who add to it.
    pub fn copy(&mut self, other: &Broods) {
        self.all.clone_from(&other.all);
        self.generations.clone_from(&other.generations);
        self.begins.clone_from(&other.begins);
    }

    pub fn clear(&mut self) {
        self.all.clear();
        self.generations.clear();
        self.begins.clear();
    }
}
