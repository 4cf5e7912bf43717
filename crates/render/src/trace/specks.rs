//! Pieces of regions that are too small for an outline of their own.

use super::memory::MarkMemory;
use super::pieces::Pieces;
use super::regions::Regions;

/// Pieces of so many pixels, and of so many cells, may belong to a neighbour whose light differs by no more than this; those of a pixel to one
/// whose light differs by more.
const SPECK: f64 = 6.0;
const MOST_SPECK: usize = 64;
const OFF: f64 = 0.075;
const FAR_OFF: f64 = 0.2;

impl Regions {
    /// Gives small pieces of regions that stand among others of their item to the neighbour that they border on most, if its light is about theirs,
    /// so that neither noise of shading nor the many shades of what is seen through a gap makes outlines. A narrow strip that runs aslant is one
    /// piece: its cells touch in their corners. A pixel has so many cells. Memory
    /// is for `cells`, if there are no more.
    pub fn without_specks(&mut self, per_pixel: f64, marks: &mut MarkMemory, cells: usize) {
        let most = ((SPECK * per_pixel) as usize).clamp(1, MOST_SPECK);
        let mut piece = Vec::with_capacity(most);
        // The last piece that a cell was looked at for.
        let mut number = marks.begin(self.labels.len(), cells);
        let seen = &mut marks.on;
        let around = std::mem::take(&mut self.around);
        let pieces = Pieces::of(&self.labels, self.width, &around);
        // Labels change on the way: a piece that has grown by then is not a small one, or begins before its first cell.
        for first in pieces.firsts().filter(|first| pieces.has_at_most(*first, most)) {
            let Some(cell) = pieces.cells(first).next().map(|run| run.start) else { continue };
            number += 1;
            let mut is_new = |cell: usize| std::mem::replace(&mut seen[cell], number) != number;
            if self.gather_speck(cell, most, &mut is_new, &mut piece) {
                let off = if piece.len() as f64 > per_pixel { OFF } else { FAR_OFF };
                if let Some(label) = self.around_speck(&piece, off) {
                    piece.iter().for_each(|cell| self.labels[*cell] = label);
                }
            }
        }
        self.around = around;
        marks.end(number);
    }

    /// Whether the piece of a region of which this is the first cell has so many cells at most: these cells. `is_new` tells whether one is asked for
    /// the first time.
    fn gather_speck(
        &self,
        first: usize,
        most: usize,
        mut is_new: impl FnMut(usize) -> bool,
        piece: &mut Vec<usize>,
    ) -> bool {
        piece.clear();
        piece.push(first);
        is_new(first);
        let mut next = 0;
        while let Some(&cell) = piece.get(next) {
            next += 1;
            for other in self.around(cell).into_iter().chain(self.corners(cell)) {
                if self.labels[other] == self.labels[first] && is_new(other) {
                    // A piece that has two first cells is found from the one that comes before.
                    if piece.len() == most || other < first {
                        return false;
                    }
                    piece.push(other);
                }
            }
        }
        true
    }

    /// The region of the same item that a piece borders on most, of those whose light differs from that of the piece by no more than this, or any
    /// if the piece is a single cell; of several the one whose light is nearest.
    fn around_speck(&self, piece: &[usize], off: f64) -> Option<u32> {
        let own = self.labels[piece[0]];
        let strength: f64 = piece.iter().map(|cell| f64::from(self.strengths[*cell])).sum();
        let apart = |label: u32| (strength / piece.len() as f64 - self.means[label as usize]).abs();
        let mut found: Vec<(usize, u32)> = Vec::new();
        for other in piece.iter().flat_map(|cell| self.around(*cell)) {
            let label = self.labels[other];
            let is_other = label != own && self.items.get(label as usize) == Some(&self.items[own as usize]);
            if !is_other || piece.len() > 1 && apart(label) > off {
                continue;
            }
            match found.iter_mut().find(|known| known.1 == label) {
                Some((count, _)) => *count += 1,
                None => found.push((1, label)),
            }
        }
        let best = |a: &(usize, u32), b: &(usize, u32)| {
            a.0.cmp(&b.0).then(apart(b.1).total_cmp(&apart(a.1))).then(b.1.cmp(&a.1))
        };
        found.into_iter().max_by(best).map(|(_, label)| label)
    }
}

#[cfg(test)]
mod tests {
    use super::super::regions::tests::regions;
    use super::*;

    #[test]
    fn a_narrow_strip_that_runs_aslant_is_one_region() {
        let of = || regions(&["0111", "2011", "2201", "2220"]);
        let mut cleaned = of();
        cleaned.without_specks(1.0, &mut MarkMemory::default(), 0);
        assert_eq!(cleaned.labels, of().labels);
        assert_eq!(of().outlines(3, &mut MarkMemory::default(), 0)[0].len(), 1);
    }

    #[test]
    fn a_cell_alone_goes_to_a_neighbour_of_its_item_only() {
        let mut of = regions(&["000", "010", "000"]);
        let middle = 2 * of.width + 2;
        of.without_specks(1.0, &mut MarkMemory::default(), 0);
        assert_eq!(of.labels[middle], 1, "another item");
        of.items = vec![0; 10];
        of.without_specks(1.0, &mut MarkMemory::default(), 0);
        assert_eq!(of.labels[middle], 0);
    }

    #[test]
    fn a_few_cells_go_to_a_neighbour_whose_light_is_about_theirs() {
        let light = [0.5, 0.55, 0.75];
        let cleaned = |inner: &str| {
            let mut of = regions(&["00000000", inner, "00000000"]);
            of.items = vec![0; 10];
            of.means[..3].copy_from_slice(&light);
            of.strengths =
                of.labels.iter().map(|label| light.get(*label as usize).map_or(0.0, |x| *x as f32)).collect();
            of.without_specks(1.0, &mut MarkMemory::default(), 0);
            of.labels[2 * of.width + 1..][..8].to_vec()
        };
        assert_eq!(cleaned("00111000"), [0; 8]);
        // Too different, and too large.
        assert_eq!(cleaned("00222000"), [0, 0, 2, 2, 2, 0, 0, 0]);
        assert_eq!(cleaned("11111110"), [1, 1, 1, 1, 1, 1, 1, 0]);
    }
}
