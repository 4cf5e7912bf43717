//! What a run on ticks keeps for random access to time: its last ticks, for times that come a little late, and copies to begin again from.
//!
//! ```text
//! ticks   t₀   t₁   t₂   t₃   t₄   t₅ ...       a global grid
//! recent            [ t₂   t₃   t₄ ]            the last ones, up to a size
//! marks        ●              ●                 copies, at most so many, the further apart the longer a run gets
//! ```
//!
//! What is kept decides what a time costs, never what it gives: from each mark a run gets the same bits.

use std::collections::BTreeMap;

/// Largest number of marks.
const MOST_MARKS: usize = 24;
/// The first distance between marks, in ticks.
const FIRST_SPACING: u64 = 64;

/// Copies of a course at ticks.
pub(crate) struct Marks<C> {
    marks: BTreeMap<u64, (C, usize)>,
    /// The sum of the sizes, and the largest.
    size: usize,
    most: usize,
    spacing: u64,
}

impl<C: Clone> Marks<C> {
    /// No marks, of which all together may get as large as this.
    pub(crate) fn new(most: usize) -> Marks<C> {
        Marks { marks: BTreeMap::new(), size: 0, most, spacing: FIRST_SPACING }
    }

    /// The last mark up to the tick of a number.
    pub(crate) fn before(&self, number: u64) -> Option<&C> {
        self.marks.range(..=number).next_back().map(|(_, (course, _))| course)
    }

    /// Sets a mark at the tick of a number, if one is due. If there get to be too many, every other one goes.
    pub(crate) fn set(&mut self, number: u64, course: &C, size: impl FnOnce(&C) -> usize) {
        if !number.is_multiple_of(self.spacing) || self.marks.contains_key(&number) {
            return;
        }
        let size = size(course);
        self.marks.insert(number, (course.clone(), size));
        self.size += size;
        while self.marks.len() > MOST_MARKS || self.size > self.most && self.marks.len() > 1 {
            self.spacing *= 2;
            self.marks.retain(|number, _| number.is_multiple_of(self.spacing));
            self.size = self.marks.values().map(|(_, size)| size).sum();
        }
    }
}

/// Ticks that have been computed.
pub(crate) struct Recent<T> {
    ticks: BTreeMap<u64, (T, usize)>,
    /// The sum of the sizes, and the largest.
    size: usize,
    most: usize,
}

impl<T> Recent<T> {
    /// No ticks, of which all together may get as large as this.
    pub(crate) fn new(most: usize) -> Recent<T> {
        Recent { ticks: BTreeMap::new(), size: 0, most }
    }

    pub(crate) fn get(&self, number: u64) -> Option<&T> {
        self.ticks.get(&number).map(|(tick, _)| tick)
    }

    /// The last one before the tick of a number.
    pub(crate) fn before(&self, number: u64) -> Option<&T> {
        self.ticks.range(..number).next_back().map(|(_, (tick, _))| tick)
    }

    /// Adds a tick. The first ones go if all together get too large.
    pub(crate) fn add(&mut self, number: u64, tick: T, size: usize) {
        if let Some((_, before)) = self.ticks.insert(number, (tick, size)) {
            self.size -= before;
        }
        self.size += size;
        while self.size > self.most && self.ticks.len() > 1 {
            self.size -= self.ticks.pop_first().map_or(0, |(_, (_, size))| size);
        }
    }

    pub(crate) fn clear(&mut self) {
        self.ticks.clear();
        self.size = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_get_sparse_and_stay_within_their_size() {
        let mut marks = Marks::new(1000);
        for number in 1..=100_000 {
            marks.set(number, &number, |_| 1);
            assert!(marks.marks.len() <= MOST_MARKS);
        }
        for number in [5000, 50_000, 100_000] {
            // No further back than twice the mean distance of as many as there may be.
            let mark = *marks.before(number).expect("a mark");
            assert!(mark <= number && number - mark < 100_000 / (MOST_MARKS as u64 / 2), "{number}: {mark}");
        }
        assert!(marks.before(63).is_none());
        let mut large = Marks::new(1000);
        (1..=10_000).for_each(|number| large.set(number, &number, |_| 400));
        assert!(large.size <= 1000 && !large.marks.is_empty());
        // One that is too large alone stays: without it a run would begin anew each time.
        let mut single = Marks::new(10);
        (1..=128).for_each(|number| single.set(number, &number, |_| 400));
        assert_eq!(single.marks.len(), 1);
    }

    #[test]
    fn the_last_ticks_are_kept() {
        let mut recent = Recent::new(10);
        for number in 0..20 {
            recent.add(number, number, 2);
        }
        assert_eq!((recent.get(14), recent.get(15), recent.get(19)), (None, Some(&15), Some(&19)));
        assert_eq!(recent.before(17), Some(&16));
        recent.add(19, 190, 1);
        assert_eq!((recent.size, recent.get(19)), (9, Some(&190)));
        recent.add(20, 20, 100);
        assert_eq!((recent.ticks.len(), recent.size), (1, 100));
        recent.clear();
        assert_eq!((recent.get(20), recent.size), (None, 0));
    }
}
