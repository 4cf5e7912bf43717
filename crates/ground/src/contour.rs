//! Contours of the columns that material has to leave: the distance of each from those that are free, in rings (Sumner, O'Brien, Hodgins,
//! section 3.2: the contour map).

use crate::press::AROUND;
use crate::tile::Extent;

/// Full columns in order, each with the number of its ring: 1 beside a free column, 0 if no way leads to one.
pub(crate) struct Contours {
    columns: Vec<((i32, i32), u32)>,
    /// The columns of the rectangle around them, by their numbers and 1, or 0; none if few of it are full.
    grid: Vec<u32>,
    low: (i32, i32),
    wide: [u32; 2],
}

/// Columns of the rectangle around full ones, for each of these, up to which numbers are found in a grid.
const SPARSE: usize = 32;

impl Contours {
    /// The contours of columns that are in order.
    pub fn of(full: &[(i32, i32)], extent: Extent) -> Contours {
        let columns: Vec<_> = full.iter().map(|column| (*column, 0)).collect();
        let first = full.first().copied().unwrap_or_default();
        let ends = |(low, high): (i32, i32), at: i32| (low.min(at), high.max(at));
        let (near, far) = full.iter().fold((first.1, first.1), |both, (_, k)| ends(both, *k));
        let low = (first.0, near);
        let wide =
            [full.last().map_or(0, |last| last.0.abs_diff(first.0)), far.abs_diff(near)].map(|n| n + 1);
        let count = wide[0] as usize * wide[1] as usize;
        let mut all = Contours { columns, grid: Vec::new(), low, wide };
        if count <= SPARSE * full.len() {
            let mut grid = vec![0; count];
            for (number, column) in full.iter().enumerate() {
                grid[all.place(*column).unwrap_or(0)] = number as u32 + 1;
            }
            all.grid = grid;
        }
        let near = |(i, k): (i32, i32)| AROUND.map(|(di, dk)| (i + di, k + dk));
        let is_free = |at: (i32, i32)| extent.contains(at.0, at.1) && all.number(at).is_none();
        let beside = |n: &usize| near(all.columns[*n].0).into_iter().any(is_free);
        let mut ring: Vec<usize> = (0..all.columns.len()).filter(beside).collect();
        let mut number = 1;
        while !ring.is_empty() {
            for n in &ring {
                all.columns[*n].1 = number;
            }
            number += 1;
            let next = ring.iter().flat_map(|n| near(all.columns[*n].0)).filter_map(|at| all.number(at));
            let mut next: Vec<usize> = next.filter(|n| all.columns[*n].1 == 0).collect();
            next.sort_unstable();
            next.dedup();
            ring = next;
        }
        all
    }

    /// The number of a full column.
    pub fn number(&self, column: (i32, i32)) -> Option<usize> {
        let place = self.place(column)?;
        if self.grid.is_empty() {
            return self.columns.binary_search_by_key(&column, |(column, _)| *column).ok();
        }
        (self.grid[place] as usize).checked_sub(1)
    }

    /// The place of a column in the grid; none beyond it.
    fn place(&self, (i, k): (i32, i32)) -> Option<usize> {
        let (x, z) = (i.wrapping_sub(self.low.0) as u32, k.wrapping_sub(self.low.1) as u32);
        (x < self.wide[0] && z < self.wide[1]).then(|| x as usize * self.wide[1] as usize + z as usize)
    }

    /// A full column and its ring.
    pub fn column(&self, number: usize) -> ((i32, i32), u32) {
        self.columns[number]
    }

    /// Whether a way leads from a full column to a free one, and it is nearer to that than those of a ring.
    pub fn is_below(&self, number: usize, ring: u32) -> bool {
        (1..ring).contains(&self.columns[number].1)
    }

    /// The numbers of columns with a ring, from the one farthest from the rim on.
    pub fn inward_first(&self) -> Vec<usize> {
        let mut order: Vec<_> = (0..self.columns.len()).filter(|n| self.columns[*n].1 > 0).collect();
        order.sort_by_key(|n| std::cmp::Reverse(self.columns[*n].1));
        order
    }
}
