//! Regions of one module and one shade, as sets of cells of a raster.
//!
//! Regions are painted one over the other, in order. Each covers its own cells, and reaches under those that are painted later:
//! by a margin, so that no background shows through where two outlines meet; and through holes, so that an outline within another is
//! needed once only. A region is worked on piece by piece (cells that hang together), and the work on a piece is that of its cells.

use super::contour::{Corner, Mask, Part};

/// The width of the margin, in cells.
const MARGIN: usize = 3;

/// No region.
pub const NOTHING: u32 = u32::MAX;
/// Cells that will be drawn over by something else, so that regions may reach there.
pub const COVERED: u32 = u32::MAX - 1;

/// One place in a cell.
#[derive(Clone, Copy)]
pub struct Sample {
    /// In the order of painting, or [`NOTHING`], or [`COVERED`].
    pub item: u32,
    /// Its shade.
    pub step: i32,
}

/// A raster of regions, by number in the order of painting. Nothing is in the cells at its rim.
pub struct Regions {
    pub width: usize,
    /// By cell; [`NOTHING`] for the background, [`COVERED`] where something else is drawn.
    pub labels: Vec<u32>,
    /// By cell: its place among those with `per_cell` samples, if it is at the edge of an item or at a crease; or anything greater.
    pub places: Vec<u32>,
    pub samples: Vec<Sample>,
    pub per_cell: usize,
    /// By region: its item (module and material), in the order of painting, and its shade.
    pub items: Vec<u32>,
    pub steps: Vec<i32>,
    /// By cell: the strength of light in its middle.
    pub strengths: Vec<f32>,
    /// By region: the least strength of light in its cells.
    pub least: Vec<f64>,
}

/// Marks on the cells of a raster, a number for each region piece, so that they need not be taken away.
struct Marks {
    /// The last piece that a cell was found to be in, or is covered by.
    inside: Vec<u32>,
    /// The last piece an outline of which passed above a cell.
    begun: Vec<u32>,
    /// The last hole that a cell was seen in.
    seen: Vec<u32>,
    holes: u32,
}

impl Regions {
    /// Gives cells that stand alone among others of their item to a neighbour, so that noise of shading makes no outlines. A narrow
    /// strip that runs aslant is no such cell: its cells touch in their corners.
    pub fn without_specks(&mut self) {
        let item = |label: u32| self.items.get(label as usize).copied();
        let is_alone = |cell: &usize| {
            let label = self.labels[*cell];
            let differs = |other: usize| self.labels[other] != label;
            label < COVERED
                && self.around(*cell).into_iter().all(differs)
                && self.corners(*cell).into_iter().all(differs)
        };
        // All at once, so that one label does not spread from cell to cell.
        let mut changes = Vec::new();
        for cell in (0..self.labels.len()).filter(is_alone) {
            let own = item(self.labels[cell]);
            let around = self.around(cell).map(|other| self.labels[other]);
            if let Some(other) = around.into_iter().find(|other| item(*other) == own) {
                changes.push((cell, other));
            }
        }
        changes.into_iter().for_each(|(cell, label)| self.labels[cell] = label);
    }

    /// The outlines of `count` regions, by number, in cells from the upper left corner.
    pub fn outlines(&self, count: usize) -> Vec<Vec<Vec<Corner>>> {
        let cells = self.labels.len();
        let none = || vec![0; cells];
        let mut marks = Marks { inside: none(), begun: none(), seen: none(), holes: 0 };
        let mut is_done = vec![false; cells];
        let mut outlines = vec![Vec::new(); count];
        let mut pieces = 0;
        let mut piece = Vec::new();
        for first in 0..cells {
            if is_done[first] || self.labels[first] >= COVERED {
                continue;
            }
            pieces += 1;
            self.gather(first, pieces, &mut is_done, &mut marks.inside, &mut piece);
            self.spread(pieces, &mut marks.inside, &mut piece);
            outlines[self.labels[first] as usize].append(&mut self.outlines_of(pieces, &piece, &mut marks));
        }
        outlines
    }

    /// The cells of a region that hang together with one of them, marked with a number.
    fn gather(
        &self,
        first: usize,
        number: u32,
        is_done: &mut [bool],
        inside: &mut [u32],
        piece: &mut Vec<usize>,
    ) {
        piece.clear();
        piece.push(first);
        (is_done[first], inside[first]) = (true, number);
        let mut next = 0;
        while let Some(&cell) = piece.get(next) {
            next += 1;
            for other in self.around(cell).into_iter().chain(self.corners(cell)) {
                if !is_done[other] && self.labels[other] == self.labels[first] {
                    (is_done[other], inside[other]) = (true, number);
                    piece.push(other);
                }
            }
        }
    }

    /// Adds the cells near a piece that are painted later. Other pieces of the region have the same colour, so it does not matter which of
    /// the two covers a cell.
    fn spread(&self, number: u32, inside: &mut [u32], piece: &mut Vec<usize>) {
        let label = self.labels[piece[0]];
        let mut from = 0;
        for _ in 0..MARGIN {
            let end = piece.len();
            for at in from..end {
                for other in self.around(piece[at]) {
                    if inside[other] != number && self.is_free(other, label) {
                        inside[other] = number;
                        piece.push(other);
                    }
                }
            }
            from = end;
        }
    }

    /// Whether a cell is painted after a region, or with it.
    fn is_free(&self, cell: usize, label: u32) -> bool {
        let other = self.labels[cell];
        other != NOTHING && other >= label
    }

    /// Adds the cells of a hole, one of which is given, to a piece if all of them are painted later. False if not.
    fn fill(&self, hole: usize, number: u32, label: u32, marks: &mut Marks) -> bool {
        marks.holes += 1;
        let mut cells = vec![hole];
        marks.seen[hole] = marks.holes;
        let mut next = 0;
        while let Some(&cell) = cells.get(next) {
            next += 1;
            if !self.is_free(cell, label) {
                return false;
            }
            for other in self.around(cell) {
                if marks.inside[other] != number && marks.seen[other] != marks.holes {
                    marks.seen[other] = marks.holes;
                    cells.push(other);
                }
            }
        }
        cells.into_iter().for_each(|cell| marks.inside[cell] = number);
        true
    }

    fn outlines_of(&self, number: u32, piece: &[usize], marks: &mut Marks) -> Vec<Vec<Corner>> {
        let label = self.labels[piece[0]];
        let (item, step) = (self.items[label as usize], self.steps[label as usize]);
        let mut outlines = Vec::new();
        for &cell in piece {
            let Marks { inside, begun, .. } = marks;
            // The part of a cell that this region covers, or one that is painted later.
            let samples_of = |cell: usize| {
                let first = self.places[cell] as usize * self.per_cell;
                self.samples.get(first..first + self.per_cell)
            };
            let covered = |cell: usize, part: Part| match samples_of(cell) {
                Some(samples) => {
                    let least = if part == Part::Shade { step } else { i32::MIN };
                    let is_covered = |at: &&Sample| at.item != NOTHING && (at.item, at.step) >= (item, least);
                    samples.iter().filter(is_covered).count() as f64 / samples.len() as f64
                }
                None => f64::from(u8::from(inside[cell] == number)),
            };
            let shade = |cell: usize| {
                let is_own = self.items.get(self.labels[cell] as usize) == Some(&item);
                is_own.then(|| f64::from(self.strengths[cell]) - self.least[label as usize])
            };
            let mask = Mask { width: self.width, inside: |cell| inside[cell] == number, covered, shade };
            if begun[cell] == number || !mask.is_top(cell) {
                continue;
            }
            let outline = mask.follow(cell, |cell| begun[cell] = number);
            if !outline.is_hole || !self.fill(cell - self.width, number, label, marks) {
                outlines.extend(outline.simplified());
            }
        }
        outlines
    }

    /// The cells beside, above and below one that is not at the rim of the raster.
    fn around(&self, cell: usize) -> [usize; 4] {
        [cell - 1, cell + 1, cell - self.width, cell + self.width]
    }

    /// The cells that touch such a one in a corner only.
    fn corners(&self, cell: usize) -> [usize; 4] {
        let [up, down] = [cell - self.width, cell + self.width];
        [up - 1, up + 1, down - 1, down + 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regions by their digits; each is an item of its own, and no cell is at an edge.
    fn regions(rows: &[&str]) -> Regions {
        let label = |b: u8| if b == b'.' { NOTHING } else { u32::from(b - b'0') };
        let rim = ".".repeat(rows[0].len() + 2);
        let rows: Vec<String> = rows.iter().map(|row| format!(".{row}.")).collect();
        let rows: Vec<&str> =
            [&rim[..]].into_iter().chain(rows.iter().map(String::as_str)).chain([&rim[..]]).collect();
        let labels: Vec<u32> = rows.iter().flat_map(|row| row.bytes().map(label)).collect();
        let places = vec![u32::MAX; labels.len()];
        let items = (0..10).collect();
        let (width, strengths) = (rim.len(), vec![0.0; labels.len()]);
        Regions {
            width,
            labels,
            places,
            samples: Vec::new(),
            per_cell: 1,
            items,
            strengths,
            least: vec![0.0; 10],
            steps: vec![0; 10],
        }
    }

    #[test]
    fn a_region_reaches_under_those_that_come_later_and_has_no_holes_for_them() {
        let of =
            regions(&["0000000000", "0111111110", "0111111110", "0111221110", "0111111110", "0000000000"]);
        let outlines = of.outlines(3);
        assert_eq!(outlines.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1], "{outlines:?}");
        let reach = |outline: &[Corner]| outline.iter().fold(0.0_f64, |reach, p| reach.max(p[0]));
        assert!(reach(&outlines[0][0]) > 10.0 && (reach(&outlines[1][0]) - 10.0).abs() < 0.6);
    }

    #[test]
    fn what_comes_earlier_stays_open() {
        let outlines = regions(&["11111", "11011", "11011", "11011", "11111"]).outlines(2);
        assert_eq!(outlines[1].len(), 2, "an outline and its hole: {outlines:?}");
    }

    #[test]
    fn a_hole_with_something_earlier_in_its_midst_stays_open() {
        let ring = |inner: &str| {
            let midst = format!("12222{inner}22221");
            regions(&["11111111111", "12222222221", &midst, "12222222221", "11111111111"]).outlines(3)
        };
        assert_eq!((ring("2")[1].len(), ring("0")[1].len()), (1, 2));
    }

    #[test]
    fn a_narrow_strip_that_runs_aslant_is_one_region() {
        let of = || regions(&["0111", "2011", "2201", "2220"]);
        let mut cleaned = of();
        cleaned.without_specks();
        assert_eq!(cleaned.labels, of().labels);
        assert_eq!(of().outlines(3)[0].len(), 1);
    }

    #[test]
    fn a_cell_alone_goes_to_a_neighbour_of_its_item_only() {
        let mut of = regions(&["000", "010", "000"]);
        let middle = 2 * of.width + 2;
        of.without_specks();
        assert_eq!(of.labels[middle], 1, "another item");
        of.items = vec![0; 10];
        of.without_specks();
        assert_eq!(of.labels[middle], 0);
    }
}
