//! Pieces of regions: cells of one region that hang together, also by their corners. They are found row by row, as runs of cells.

use std::ops::Range;

use super::regions::COVERED;
use super::spans::Spans;

/// No run.
const NONE: u32 = u32::MAX;

/// Cells of one region next to one another in a row.
struct Run {
    first: u32,
    end: u32,
    /// A run of the same piece that comes before it, or itself.
    before: u32,
    /// The next run of its piece, and, of the first one, the last.
    next: u32,
    last: u32,
}

/// The pieces of all regions.
pub struct Pieces(Vec<Run>);

impl Pieces {
    /// Those in a raster of so many columns; all that is labelled is within the spans.
    pub fn of(labels: &[u32], width: usize, spans: &Spans) -> Pieces {
        let mut pieces = Pieces(Vec::new());
        // The runs of the row above, and that row.
        let (mut above, mut row_above) = (0..0, usize::MAX);
        for cells in spans.cells() {
            let (row, start) = (cells.start / width, pieces.0.len());
            let mut cell = cells.start as u32;
            for run in labels[cells].chunk_by(|a, b| a == b) {
                let first = cell;
                cell += run.len() as u32;
                if run[0] < COVERED {
                    let number = pieces.0.len() as u32;
                    pieces.0.push(Run { first, end: cell, before: number, next: NONE, last: number });
                }
            }
            let end = pieces.0.len();
            if row_above.wrapping_add(1) == row {
                pieces.join(above, start..end, (labels, width as u32));
            }
            (above, row_above) = (start..end, row);
        }
        pieces.chain();
        pieces
    }

    /// Joins runs of one row with those of one region in the row above that they touch.
    fn join(&mut self, above: Range<usize>, runs: Range<usize>, (labels, width): (&[u32], u32)) {
        let mut first = above.start;
        for run in runs {
            // In columns of the row above.
            let [from, to] = [self.0[run].first - width, self.0[run].end - width];
            let label = labels[self.0[run].first as usize];
            while first < above.end && self.0[first].end < from {
                first += 1;
            }
            let mut other = first;
            while other < above.end && self.0[other].first <= to {
                if labels[self.0[other].first as usize] == label {
                    let [a, b] = [self.root(run as u32), self.root(other as u32)];
                    self.0[a.max(b) as usize].before = a.min(b);
                }
                other += 1;
            }
        }
    }

    /// The first run of a piece, as far as it is known.
    fn root(&mut self, mut run: u32) -> u32 {
        while self.0[run as usize].before != run {
            let before = self.0[run as usize].before;
            self.0[run as usize].before = self.0[before as usize].before;
            run = self.0[run as usize].before;
        }
        run
    }

    /// Strings the runs of each piece together.
    fn chain(&mut self) {
        for run in 0..self.0.len() as u32 {
            let root = self.root(run);
            if root != run {
                let last = std::mem::replace(&mut self.0[root as usize].last, run);
                self.0[last as usize].next = run;
            }
        }
    }

    /// The first run of each piece, in the order of their first cells.
    pub fn firsts(&self) -> impl Iterator<Item = u32> + '_ {
        (0..).zip(&self.0).filter(|(number, run)| run.before == *number).map(|(number, _)| number)
    }

    /// Whether a piece has so many cells or fewer, given its first run.
    pub fn has_at_most(&self, first: u32, most: usize) -> bool {
        let left = self.cells(first).try_fold(most, |left, run| left.checked_sub(run.len()));
        left.is_some()
    }

    /// The cells of a piece, run by run, from its first one on.
    pub fn cells(&self, first: u32) -> impl Iterator<Item = Range<usize>> + '_ {
        let run = |number: u32| self.0.get(number as usize);
        let runs = std::iter::successors(run(first), move |last| run(last.next));
        runs.map(|run| run.first as usize..run.end as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::super::regions::NOTHING;
    use super::*;

    /// The cells of each piece, by a search from cell to cell.
    fn found(labels: &[u32], width: usize) -> Vec<Vec<usize>> {
        let mut is_done = vec![false; labels.len()];
        let mut pieces = Vec::new();
        for first in 0..labels.len() {
            if is_done[first] || labels[first] >= COVERED {
                continue;
            }
            let mut cells = vec![first];
            is_done[first] = true;
            let mut next = 0;
            while let Some(&cell) = cells.get(next) {
                next += 1;
                let around = [width - 1, width, width + 1].into_iter().chain([1]);
                for other in around.flat_map(|by| [cell - by, cell + by]) {
                    if labels[other] == labels[first] && !is_done[other] {
                        is_done[other] = true;
                        cells.push(other);
                    }
                }
            }
            cells.sort_unstable();
            pieces.push(cells);
        }
        pieces
    }

    #[test]
    fn pieces_are_those_that_a_search_from_cell_to_cell_finds() {
        let (width, height) = (14, 12);
        let mut state = 1_u64;
        for round in 0..300 {
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as u32
            };
            let mut labels = vec![NOTHING; width * height];
            let mut rows = vec![[0; 2]; height];
            for row in 1..height - 1 {
                // Some rows are empty.
                if random() % 8 == 0 {
                    continue;
                }
                rows[row] = [1, width as u32 - 1];
                for column in 1..width - 1 {
                    let label = random() % (2 + round % 4);
                    labels[row * width + column] = if label == 0 { COVERED } else { label };
                }
            }
            let pieces = Pieces::of(&labels, width, &Spans::new(width, rows));
            let cells: Vec<Vec<usize>> =
                pieces.firsts().map(|first| pieces.cells(first).flatten().collect()).collect();
            assert_eq!(cells, found(&labels, width), "round {round}");
        }
    }
}
