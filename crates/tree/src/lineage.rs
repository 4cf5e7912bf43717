//! Identity by descent.
//!
//! A module is identified by its place in the initial string, or by the production that made it, the parent
//! that it replaced, and its place in the successor. That does not depend on the frames that are observed or
//! on the scheduler, so exported names, messages and random numbers are derived from it.

use std::fmt;

/// The identity of a module. Constant in size, whatever the number of generations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Lineage {
    /// A hash of the whole line of descent, unique in practice (64 bits).
    pub id: u64,
    /// Number of productions between the initial string and this module.
    pub generation: u32,
    /// Places in the successors of the last eight generations, one byte each, the latest lowest;
    /// for people to read.
    trail: u64,
}

/// The common part of the lineages of the modules of one successor.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    pub(super) mixed: u64,
    pub(super) generation: u32,
    /// The parent's.
    pub(super) trail: u64,
}

impl Family {
    /// That of the initial string.
    pub const AXIOM: Family = Family { mixed: 0x646c_7379_7300, generation: 0, trail: 0 };

    /// The module at a place of the successor.
    pub fn child(self, place: usize) -> Lineage {
        let Family { mixed, generation, .. } = self;
        Lineage { id: mix(mixed, place as u64), generation, trail: trail(self.trail, place) }
    }
}

impl Lineage {
    /// The module at a place (from 0, brackets not counted) of the initial string.
    pub fn of_axiom(place: usize) -> Lineage {
        Family::AXIOM.child(place)
    }

    /// The module at a place of the successor by which a production (a number that tells the
    /// productions of a model apart) replaced this module.
    pub fn child(self, production: u64, place: usize) -> Lineage {
        self.family(production).child(place)
    }

    /// The common part of the lineages of all modules of the successor, by a production.
    pub fn family(self, production: u64) -> Family {
        Family {
            mixed: mix(self.id, production),
            generation: self.generation.saturating_add(1),
            trail: self.trail,
        }
    }

    /// The place in the successor that made it, or in the initial string; None if it is one of the larger ones, which
    /// are not told apart.
    pub fn place(self) -> Option<usize> {
        (self.trail & 255).checked_sub(1).filter(|place| *place < 254).map(|place| place as usize)
    }

    /// The identity of a module of a plant that stands in another model, at this module of it.
    pub fn of_plant(self, inner: Lineage) -> Lineage {
        Lineage { id: mix(self.id, inner.id), ..inner }
    }

    /// A name for files: 13 characters, lower case and digits.
    pub fn name(self) -> String {
        let mut name = String::with_capacity(13);
        self.push_name(&mut name);
        name
    }

    /// Appends the [name](Lineage::name).
    pub fn push_name(self, out: &mut String) {
        const DIGITS: &[u8; 32] = b"0123456789abcdefghjkmnpqrstvwxyz";
        out.extend((0..13).rev().map(|i| DIGITS[(self.id >> (5 * i) & 31) as usize] as char));
    }
}

/// Adds a place, counted from 1 as it is displayed; places from 255 on are not distinguished.
fn trail(before: u64, place: usize) -> u64 {
    before << 8 | (place as u64 + 1).min(255)
}

/// The finalizer of SplitMix64 (Steele, Lea, Flood 2014) over a running value: 64 bits that look random for any two
/// numbers, such as a seed and a counter.
pub fn mix(state: u64, value: u64) -> u64 {
    let mut z =
        state.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_add(value.wrapping_mul(0xd6e8_feb8_6659_fd93));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl fmt::Display for Lineage {
    /// `3.1.2`: the 3rd module of the initial string, its 1st successor, of that the 2nd.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = (self.generation as usize + 1).min(8);
        if self.generation >= 8 {
            write!(f, "…")?;
        }
        for i in (0..shown).rev() {
            let place = self.trail >> (8 * i) & 255;
            write!(f, "{}{place}", if i + 1 == shown && self.generation < 8 { "" } else { "." })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lineages_are_displayed_as_paths_of_places() {
        let mut lineage = Lineage::of_axiom(2);
        assert_eq!(lineage.to_string(), "3");
        lineage = lineage.child(0, 0).child(5, 1);
        assert_eq!(lineage.to_string(), "3.1.2");
        for _ in 0..9 {
            lineage = lineage.child(0, 0);
        }
        assert_eq!(lineage.to_string(), "….1.1.1.1.1.1.1.1");
        assert_eq!(lineage.name().len(), 13);
    }

    #[test]
    fn lineages_differ_by_place_production_and_parent() {
        let root = Lineage::of_axiom(0);
        let all = [root, root.child(0, 0), root.child(0, 1), root.child(1, 0), Lineage::of_axiom(1)];
        let ids: std::collections::HashSet<u64> = all.iter().map(|l| l.id).collect();
        assert_eq!(ids.len(), all.len());
    }
}
