//! Regions of one module and one shade, as sets of cells of a raster.
//!
//! Regions are painted one over the other, in order. Each covers its own cells, and reaches under those that are painted later:
//! by a margin, so that no background shows through where two outlines meet; and through holes, so that an outline within another is
//! needed once only. A region is worked on piece by piece (cells that hang together), so the work is bounded by the pieces' sizes.

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

/// A raster of regions, by number in the order of painting.
pub struct Regions {
    pub width: usize,
    pub height: usize,
    /// By cell; [`NOTHING`] for the background, [`COVERED`] where something else is drawn.
    pub labels: Vec<u32>,
    /// By cell: its place in `samples`, if it is at the edge of an item or at a crease; or anything greater.
    pub places: Vec<u32>,
    pub samples: Vec<[Sample; 16]>,
    /// By region: its item (module and material), in the order of painting, and its shade.
    pub items: Vec<u32>,
    pub steps: Vec<i32>,
    /// By cell: the strength of light in its middle.
    pub strengths: Vec<f32>,
    /// By region: the least strength of light in its cells.
    pub least: Vec<f64>,
}

/// Cells of one region that hang together: one of them, and the rectangle around them, from the upper left corner to the one
/// after the last.
struct Piece {
    cell: usize,
    low: [usize; 2],
    high: [usize; 2],
}

impl Regions {
    /// Gives cells that stand alone among others of their item to a neighbour, so that noise of shading makes no outlines. A narrow
    /// strip that runs aslant is no such cell: its cells touch in their corners.
    pub fn without_specks(&mut self) {
        let item = |label: u32| self.items.get(label as usize).copied();
        let is_alone = |cell: &usize| {
            let label = self.labels[*cell];
            label < COVERED
                && neighbours(*cell, self.width, self.labels.len()).all(|other| self.labels[other] != label)
                && corners(*cell, self.width, self.labels.len()).all(|other| self.labels[other] != label)
        };
        // All at once, so that one label does not spread from cell to cell.
        let mut changes = Vec::new();
        for cell in (0..self.labels.len()).filter(is_alone) {
            let own = item(self.labels[cell]);
            let around = neighbours(cell, self.width, self.labels.len()).map(|other| self.labels[other]);
            if let Some(other) = around.into_iter().find(|other| item(*other) == own) {
                changes.push((cell, other));
            }
        }
        changes.into_iter().for_each(|(cell, label)| self.labels[cell] = label);
    }

    /// The outlines of `count` regions, by number, in cells from the upper left corner.
    pub fn outlines(&self, count: usize) -> Vec<Vec<Vec<Corner>>> {
        let mut outlines = vec![Vec::new(); count];
        for piece in self.pieces() {
            outlines[self.labels[piece.cell] as usize].append(&mut self.outlines_of(&piece));
        }
        outlines
    }

    /// The pieces of all regions, in the order of their first cells.
    fn pieces(&self) -> Vec<Piece> {
        let mut seen = vec![false; self.labels.len()];
        let mut stack = Vec::new();
        let mut pieces = Vec::new();
        for first in 0..self.labels.len() {
            if seen[first] || self.labels[first] >= COVERED {
                continue;
            }
            let mut piece = Piece { cell: first, low: [self.width, self.height], high: [0, 0] };
            seen[first] = true;
            stack.push(first);
            while let Some(cell) = stack.pop() {
                for (k, at) in [cell % self.width, cell / self.width].into_iter().enumerate() {
                    piece.low[k] = piece.low[k].min(at);
                    piece.high[k] = piece.high[k].max(at + 1);
                }
                let mut visit = |other: usize| {
                    if !seen[other] && self.labels[other] == self.labels[first] {
                        seen[other] = true;
                        stack.push(other);
                    }
                };
                neighbours(cell, self.width, self.labels.len()).for_each(&mut visit);
                corners(cell, self.width, self.labels.len()).for_each(&mut visit);
            }
            pieces.push(piece);
        }
        pieces
    }

    fn outlines_of(&self, piece: &Piece) -> Vec<Vec<Corner>> {
        let label = self.labels[piece.cell];
        let [left, top] = piece.low.map(|low| low.saturating_sub(MARGIN));
        let width = (piece.high[0] + MARGIN).min(self.width) - left;
        let height = (piece.high[1] + MARGIN).min(self.height) - top;
        let cell_at = |i: usize| (top + i / width) * self.width + left + i % width;
        // Other pieces of the region have the same colour, so it does not matter which of the two covers a cell.
        let free: Vec<bool> = (0..width * height)
            .map(|i| {
                let other = self.labels[cell_at(i)];
                other != NOTHING && other >= label
            })
            .collect();
        let mut inside = vec![false; width * height];
        let first = (piece.cell / self.width - top) * width + piece.cell % self.width - left;
        inside[first] = true;
        let mut edge = vec![first];
        let mut own = edge.clone();
        let count = inside.len();
        while let Some(cell) = edge.pop() {
            let mut visit = |other: usize| {
                if !inside[other] && self.labels[cell_at(other)] == label {
                    inside[other] = true;
                    edge.push(other);
                    own.push(other);
                }
            };
            neighbours(cell, width, count).for_each(&mut visit);
            corners(cell, width, count).for_each(&mut visit);
        }
        spread(&mut inside, &free, width, own);
        fill_holes(&mut inside, &free, width);
        // The part of a cell that this region covers, or one that is painted later.
        let (item, step) = (self.items[label as usize], self.steps[label as usize]);
        let covered = |i: usize, part: Part| match self.samples.get(self.places[cell_at(i)] as usize) {
            Some(samples) => {
                let least = if part == Part::Shade { step } else { i32::MIN };
                let is_covered = |at: &&Sample| at.item != NOTHING && (at.item, at.step) >= (item, least);
                samples.iter().filter(is_covered).count() as f64 / samples.len() as f64
            }
            None => f64::from(u8::from(inside[i])),
        };
        let shade = |i: usize| {
            let cell = cell_at(i);
            let is_own = self.items.get(self.labels[cell] as usize) == Some(&item);
            is_own.then(|| f64::from(self.strengths[cell]) - self.least[label as usize])
        };
        let mask = Mask { width, height, inside: &inside, covered, shade };
        let mut outlines = mask.outlines();
        for corner in outlines.iter_mut().flatten() {
            *corner = [corner[0] + left as f64, corner[1] + top as f64];
        }
        outlines
    }
}

/// Adds free cells near the set, whose cells are `edge`.
fn spread(inside: &mut [bool], free: &[bool], width: usize, mut edge: Vec<usize>) {
    for _ in 0..MARGIN {
        let mut next = Vec::new();
        for &cell in &edge {
            for other in neighbours(cell, width, inside.len()) {
                if free[other] && !inside[other] {
                    inside[other] = true;
                    next.push(other);
                }
            }
        }
        edge = next;
    }
}

/// Adds the cells that the set surrounds, where all of them are free.
fn fill_holes(inside: &mut [bool], free: &[bool], width: usize) {
    let height = inside.len() / width.max(1);
    let mut seen = vec![false; inside.len()];
    let mut stack = Vec::new();
    let mut hole = Vec::new();
    for start in 0..inside.len() {
        if inside[start] || seen[start] {
            continue;
        }
        hole.clear();
        seen[start] = true;
        stack.push(start);
        let mut is_free = true;
        while let Some(cell) = stack.pop() {
            let (x, y) = (cell % width, cell / width);
            is_free &= free[cell] && x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            hole.push(cell);
            for other in neighbours(cell, width, inside.len()) {
                if !inside[other] && !seen[other] {
                    seen[other] = true;
                    stack.push(other);
                }
            }
        }
        if is_free {
            hole.iter().for_each(|cell| inside[*cell] = true);
        }
    }
}

/// The cells beside, above and below one, of a rectangle of `count` cells.
fn neighbours(cell: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let x = cell % width;
    [
        (x > 0).then(|| cell - 1),
        (x + 1 < width).then(|| cell + 1),
        cell.checked_sub(width),
        Some(cell + width).filter(|next| *next < count),
    ]
    .into_iter()
    .flatten()
}

/// The cells that touch one in a corner only, of a rectangle of `count` cells.
fn corners(cell: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let x = cell % width;
    let beside = [(x > 0).then(|| cell.wrapping_sub(1)), (x + 1 < width).then_some(cell + 1)];
    beside.into_iter().flatten().flat_map(move |beside| {
        [beside.checked_sub(width), Some(beside + width).filter(|below| *below < count)].into_iter().flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regions by their digits; each is an item of its own, and no cell is at an edge.
    fn regions(rows: &[&str]) -> Regions {
        let label = |b: u8| if b == b'.' { NOTHING } else { u32::from(b - b'0') };
        let labels: Vec<u32> = rows.iter().flat_map(|row| row.bytes().map(label)).collect();
        let places = vec![u32::MAX; labels.len()];
        let items = (0..10).collect();
        let (width, height, strengths) = (rows[0].len(), rows.len(), vec![0.0; labels.len()]);
        Regions {
            width,
            height,
            labels,
            places,
            samples: Vec::new(),
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
        assert!(reach(&outlines[0][0]) > 9.0 && (reach(&outlines[1][0]) - 9.0).abs() < 0.6);
    }

    #[test]
    fn what_comes_earlier_stays_open() {
        let outlines = regions(&["11111", "11011", "11011", "11011", "11111"]).outlines(2);
        assert_eq!(outlines[1].len(), 2, "an outline and its hole: {outlines:?}");
    }

    #[test]
    fn pieces_far_apart_are_worked_on_by_themselves() {
        let wide = format!("0{}0", ".".repeat(60));
        let of = regions(&[&wide, &wide]);
        assert!(of.pieces().iter().all(|piece| piece.high[0] - piece.low[0] == 1));
    }

    #[test]
    fn a_cell_alone_goes_to_a_neighbour_of_its_item_only() {
        let mut of = regions(&["000", "010", "000"]);
        of.without_specks();
        assert_eq!(of.labels[4], 1, "another item");
        of.items = vec![0; 10];
        of.without_specks();
        assert_eq!(of.labels[4], 0);
    }
}
