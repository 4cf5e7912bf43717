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

#[cfg(test)]
mod tests {
    use super::*;

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
