//! Sibling groups: birth and line of descent of the modules of one successor, stored once for all of them.
//!
//! A production makes several modules at once. Their group is freed when the last of them has been replaced.

use std::collections::BTreeMap;

use super::{Family, Lineage, SimTime, room};

/// The number of no group: brackets belong to none.
pub(super) const NO_GROUP: u32 = u32::MAX;

/// Places of the last seven generations: the eighth is that of the module itself. The highest byte counts modules.
const TRAIL: u64 = (1 << 56) - 1;
const ONE: u64 = 1 << 56;
/// Groups of so many modules are not counted, and never freed.
const UNCOUNTED: u64 = 255;

#[derive(Clone, Copy, Debug)]
struct SiblingGroup {
    mixed: u64,
    trail: u64,
    birth: SimTime,
}

/// All groups, by number; numbers of freed groups are used again.
#[derive(Clone, Debug, Default)]
pub(super) struct SiblingGroups {
    all: Vec<SiblingGroup>,
    /// Number of generations of each, in an array of its own, so that neither array has padding.
    generations: Vec<u32>,
    /// The place in the successor at which a group begins, for all but the first group of a very long successor.
    begins: BTreeMap<u32, u32>,
    free: Vec<u32>,
}

impl SiblingGroups {
    /// Bytes of memory, about.
    pub fn size(&self) -> usize {
        size_of_val(&self.all[..]) + size_of_val(&self.generations[..]) + 4 * self.free.len()
    }

    /// A new group, without modules yet, of those from place `first` of the successor on (brackets not counted).
    pub fn begin(&mut self, family: Family, birth: SimTime, first: u32) -> u32 {
        let group = SiblingGroup { mixed: family.mixed, trail: family.trail & TRAIL, birth };
        let number = match self.free.pop() {
            Some(number) => {
                self.all[number as usize] = group;
                self.generations[number as usize] = family.generation;
                number
            }
            None => {
                room::push(&mut self.all, group);
                room::push(&mut self.generations, family.generation);
                self.all.len() as u32 - 1
            }
        };
        if first > 0 {
            self.begins.insert(number, first);
        }
        number
    }

    /// Sets the number of modules of a new group; nothing for [`NO_GROUP`].
    pub fn count(&mut self, number: u32, modules: u16) {
        if number != NO_GROUP {
            self.all[number as usize].trail += u64::from(modules).min(UNCOUNTED) * ONE;
        }
    }

    /// Removes one module; the last one frees the group.
    pub fn leave(&mut self, number: u32) {
        let group = &mut self.all[number as usize];
        match group.trail / ONE {
            UNCOUNTED => {}
            1 => {
                group.trail -= ONE;
                self.free.push(number);
                if !self.begins.is_empty() {
                    self.begins.remove(&number);
                }
            }
            _ => group.trail -= ONE,
        }
    }

    pub fn birth(&self, number: u32) -> SimTime {
        self.all[number as usize].birth
    }

    pub fn lineage(&self, number: u32, place: u16) -> Lineage {
        let (family, first) = self.family(number);
        family.child(first + usize::from(place))
    }

    /// What the modules of a group have in common, and the place in the successor at which it begins.
    pub fn family(&self, number: u32) -> (Family, usize) {
        let SiblingGroup { mixed, trail, .. } = self.all[number as usize];
        let generation = self.generations[number as usize];
        let first = if self.begins.is_empty() { None } else { self.begins.get(&number) };
        (Family { mixed, generation, trail: trail & TRAIL }, *first.unwrap_or(&0) as usize)
    }

    /// Copies all that lookups need; what is needed to add groups is left out.
    pub fn copy(&mut self, other: &SiblingGroups) {
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
