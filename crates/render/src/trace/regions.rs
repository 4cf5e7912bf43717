//! Regions of one module and one shade, as sets of cells of a raster.
//!
//! Regions are painted one over the other, in order. Each covers its own cells, and reaches under those that are painted later:
//! by a margin, so that no background shows through where two outlines meet; and through holes, so that an outline within another is
//! needed once only.

use super::contour::{Corner, Mask};

/// The width of the margin, in cells.
const MARGIN: usize = 3;
/// The distance of outlines from the edges of cells, in cells.
const TOLERANCE: f64 = 0.4;

/// No region.
pub const NOTHING: u32 = u32::MAX;

/// A raster of regions, by number in the order of painting.
pub struct Regions {
    pub width: usize,
    pub height: usize,
    /// By cell; [`NOTHING`] for the background.
    pub labels: Vec<u32>,
    /// By cell: its place in `samples`, if it is at the edge of an item; or anything greater.
    pub places: Vec<u32>,
    /// Items at the samples of cells, in the order of painting.
    pub samples: Vec<[u32; 16]>,
    /// By region: its item.
    pub items: Vec<u32>,
}

/// The cells that a region may touch: first column and row, and those after the last.
#[derive(Clone, Copy)]
struct Bounds {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
}

impl Regions {
    /// Gives cells that stand alone among others of their item to a neighbour, so that noise of shading makes no outlines.
    pub fn without_specks(&mut self) {
        let width = self.width;
        for row in 1..self.height.saturating_sub(1) {
            for cell in row * width + 1..(row + 1) * width - 1 {
                let label = self.labels[cell];
                let around = [cell - 1, cell + 1, cell - width, cell + width].map(|other| self.labels[other]);
                if label == NOTHING || around.contains(&label) {
                    continue;
                }
                let item = |label: u32| self.items.get(label as usize);
                if let Some(other) = around.into_iter().find(|other| item(*other) == item(label)) {
                    self.labels[cell] = other;
                }
            }
        }
    }

    /// The outlines of every region, by number, in cells from the upper left corner.
    pub fn outlines(&self, count: usize) -> Vec<Vec<Vec<Corner>>> {
        let mut bounds: Vec<Option<Bounds>> = vec![None; count];
        for (cell, &label) in self.labels.iter().enumerate().filter(|(_, label)| **label != NOTHING) {
            let (x, y) = (cell % self.width, cell / self.width);
            let own = bounds[label as usize].get_or_insert(Bounds { left: x, top: y, right: x, bottom: y });
            own.left = own.left.min(x);
            own.right = own.right.max(x + 1);
            own.bottom = own.bottom.max(y + 1);
        }
        let of = |(label, bounds): (usize, &Option<Bounds>)| match bounds {
            Some(bounds) => self.outlines_of(label as u32, *bounds),
            None => Vec::new(),
        };
        bounds.iter().enumerate().map(of).collect()
    }

    fn outlines_of(&self, label: u32, bounds: Bounds) -> Vec<Vec<Corner>> {
        let (left, top) = (bounds.left.saturating_sub(MARGIN), bounds.top.saturating_sub(MARGIN));
        let width = (bounds.right + MARGIN).min(self.width) - left;
        let height = (bounds.bottom + MARGIN).min(self.height) - top;
        let label_at = |i: usize| self.labels[(top + i / width) * self.width + left + i % width];
        let is_later = |other: u32| other != NOTHING && other > label;
        let mut inside: Vec<bool> = (0..width * height).map(|i| label_at(i) == label).collect();
        let later: Vec<bool> = (0..width * height).map(|i| is_later(label_at(i))).collect();
        spread(&mut inside, &later, width);
        fill_holes(&mut inside, &later, width);
        // The part of a cell that this item covers, or one that is painted later.
        let item = self.items[label as usize];
        let covered = |i: usize| {
            let cell = (top + i / width) * self.width + left + i % width;
            match self.samples.get(self.places[cell] as usize) {
                Some(samples) => {
                    let count = samples.iter().filter(|other| **other != NOTHING && **other >= item).count();
                    count as f64 / 16.0
                }
                None => f64::from(u8::from(inside[i])),
            }
        };
        let mask = Mask { width, height, inside: &inside, covered };
        let mut outlines = mask.outlines(TOLERANCE);
        for corner in outlines.iter_mut().flatten() {
            *corner = [corner[0] + left as f64, corner[1] + top as f64];
        }
        outlines
    }
}

/// Adds cells near the set, where they are free.
fn spread(inside: &mut [bool], free: &[bool], width: usize) {
    let mut edge: Vec<usize> = (0..inside.len()).filter(|i| inside[*i]).collect();
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

/// The cells beside, above and below one.
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
