//! The part of each row of a raster in which something is: most of a picture is empty.

use std::ops::Range;

/// By row: the first column, and the one after the last; both are the same where nothing is.
#[derive(Clone, Debug, Default)]
pub struct Spans {
    width: usize,
    rows: Vec<[u32; 2]>,
}

impl Spans {
    /// Of rows that are so wide.
    pub fn new(width: usize, rows: Vec<[u32; 2]>) -> Spans {
        Spans { width, rows }
    }

    /// The cells of each row that has any, from the first row on.
    pub fn cells(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let starts = (0..).step_by(self.width.max(1));
        let cells = starts.zip(&self.rows).map(|(start, &[first, end])| {
            let at = |column: u32| start + column as usize;
            at(first)..at(end)
        });
        cells.filter(|cells| !cells.is_empty())
    }

    /// With the cells around these.
    pub fn widened(&self) -> Spans {
        let around = |row: usize| {
            let near = &self.rows[row.saturating_sub(1)..(row + 2).min(self.rows.len())];
            let near = near.iter().filter(|[first, end]| first < end);
            let wide = near.map(|[first, end]| [first.saturating_sub(1), (end + 1).min(self.width as u32)]);
            wide.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default()
        };
        Spans { width: self.width, rows: (0..self.rows.len()).map(around).collect() }
    }

    /// Gives the cells of a raster this value.
    pub fn fill<T: Copy>(&self, raster: &mut [T], value: T) {
        self.cells().for_each(|cells| raster[cells].fill(value));
    }
}

/// Cells that are compared at once.
const BLOCK: usize = 8;

/// The cells of a range whose value differs from that of the cell so far before; most have neighbours of their own value.
pub fn changes(values: &[u32], mut cells: Range<usize>, before: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::from_fn(move || {
        while !cells.is_empty() {
            let cell = cells.start;
            if cell + BLOCK <= cells.end && is_same(values, [cell - before, cell]) {
                cells.start += BLOCK;
                continue;
            }
            cells.start += 1;
            if values[cell - before] != values[cell] {
                return Some(cell);
            }
        }
        None
    })
}

/// Whether the blocks that begin with two cells have the same values.
fn is_same(values: &[u32], firsts: [usize; 2]) -> bool {
    let [a, b] = firsts.map(|first| values[first..].first_chunk::<BLOCK>());
    let (Some(a), Some(b)) = (a, b) else { return false };
    a.iter().zip(b).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_found_wherever_blocks_begin() {
        let mut state = 3_u32;
        let values: Vec<u32> = (0..400)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                u32::from(state >> 28 == 0)
            })
            .collect();
        for (first, end, before) in [(1, 400, 1), (30, 399, 30), (17, 21, 2), (5, 5, 5)] {
            let found: Vec<usize> = changes(&values, first..end, before).collect();
            let expected: Vec<usize> = (first..end).filter(|i| values[*i] != values[i - before]).collect();
            assert_eq!(found, expected);
            assert!(expected.is_empty() || expected.len() > 1);
        }
    }

    #[test]
    fn cells_around_spans_are_within_the_raster() {
        let spans = Spans::new(10, vec![[0, 0], [4, 6], [0, 0], [0, 0], [9, 10]]);
        assert_eq!(spans.cells().collect::<Vec<_>>(), [14..16, 49..50]);
        let wide: Vec<_> = spans.widened().cells().collect();
        assert_eq!(wide, [3..7, 13..17, 23..27, 38..40, 48..50]);
        let mut raster = [0; 50];
        spans.fill(&mut raster, 1);
        assert_eq!(raster.iter().sum::<i32>(), 3);
    }
}
