//! Some cells of a raster, numbered in order. A bit stands for each cell of the raster, so that the set stays in the caches.

use std::ops::Range;

/// Cells in a word.
const WORD: usize = 32;

/// A set of cells.
#[derive(Default)]
pub struct CellSet {
    /// Of each cell in turn a bit; and how many cells of the set come before those of the word.
    words: Vec<[u32; 2]>,
    cells: Vec<u32>,
}

impl CellSet {
    /// An empty set of cells of a raster of so many.
    pub fn new(count: usize) -> CellSet {
        CellSet { words: vec![[0; 2]; count.div_ceil(WORD)], cells: Vec::new() }
    }

    /// Adds a cell. Cells have their numbers only after [`number`](CellSet::number).
    #[inline(always)]
    pub fn insert(&mut self, cell: usize) {
        self.words[cell / WORD][0] |= 1 << (cell % WORD);
    }

    /// Numbers the cells, all of which are in these ranges, which are in order.
    pub fn number(&mut self, ranges: impl Iterator<Item = Range<usize>>) {
        let mut next = 0;
        for range in ranges {
            let end = range.end.div_ceil(WORD);
            // The last word of a range may be the first of the next one.
            for word in next.max(range.start / WORD)..end {
                let [mut bits, before] = self.words[word];
                if bits == 0 {
                    continue;
                }
                debug_assert_eq!(before, 0);
                self.words[word][1] = self.cells.len() as u32;
                while bits != 0 {
                    self.cells.push((word * WORD) as u32 + bits.trailing_zeros());
                    bits &= bits - 1;
                }
            }
            next = next.max(end);
        }
    }

    /// The cells in order.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// The number of a cell, from 0 on, if it is in the set.
    #[inline(always)]
    pub fn place(&self, cell: usize) -> Option<usize> {
        let [bits, before] = self.words[cell / WORD];
        let bit = 1 << (cell % WORD);
        (bits & bit != 0).then(|| before as usize + (bits & (bit - 1)).count_ones() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_numbered_in_order() {
        let cells = [3_usize, 31, 32, 70, 71, 127, 130];
        let mut set = CellSet::new(150);
        cells.iter().rev().for_each(|cell| set.insert(*cell));
        // Ranges that begin and end within one word.
        set.number([0..40, 60..71, 71..72, 100..128, 128..150].into_iter());
        assert_eq!(set.cells(), cells.map(|cell| cell as u32));
        for cell in 0..150 {
            assert_eq!(set.place(cell), cells.iter().position(|other| *other == cell), "{cell}");
        }
    }
}
