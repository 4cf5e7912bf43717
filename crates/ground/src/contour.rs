//! Contours of the columns that material has to leave: the distance of each from those that are free, in rings (Sumner, O'Brien, Hodgins,
//! section 3.2: the contour map).

use std::collections::BTreeSet;

use crate::press::AROUND;
use crate::tile::Extent;

/// Full columns in order, each with the number of its ring: 1 beside a free column, 0 if no way leads to one.
pub(crate) struct Contours(Vec<((i32, i32), u32)>);

impl Contours {
    pub fn of(full: &BTreeSet<(i32, i32)>, extent: Extent) -> Contours {
        let mut all = Contours(full.iter().map(|column| (*column, 0)).collect());
        let near = |(i, k): (i32, i32)| AROUND.map(|(di, dk)| (i + di, k + dk));
        let is_free = |at: (i32, i32)| extent.contains(at.0, at.1) && all.place(at).is_none();
        let beside = |n: &usize| near(all.0[*n].0).into_iter().any(is_free);
        let mut ring: Vec<usize> = (0..all.0.len()).filter(beside).collect();
        let mut number = 1;
        while !ring.is_empty() {
            for n in &ring {
                all.0[*n].1 = number;
            }
            number += 1;
            let next = ring.iter().flat_map(|n| near(all.0[*n].0)).filter_map(|at| all.place(at));
            let mut next: Vec<usize> = next.filter(|n| all.0[*n].1 == 0).collect();
            next.sort_unstable();
            next.dedup();
            ring = next;
        }
        all
    }

    fn place(&self, column: (i32, i32)) -> Option<usize> {
        self.0.binary_search_by_key(&column, |(column, _)| *column).ok()
    }

    /// The ring of a full column from which a way leads to a free one.
    pub fn ring(&self, column: (i32, i32)) -> Option<u32> {
        self.place(column).map(|n| self.0[n].1).filter(|ring| *ring > 0)
    }

    /// Columns with a ring, from the one farthest from the rim on.
    pub fn inward_first(&self) -> Vec<((i32, i32), u32)> {
        let mut order: Vec<_> = self.0.iter().copied().filter(|(_, ring)| *ring > 0).collect();
        order.sort_unstable_by_key(|(column, ring)| (std::cmp::Reverse(*ring), *column));
        order
    }
}
