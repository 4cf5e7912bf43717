//! Contours of the columns that material has to leave: the distance of each from those that are free, in rings (Sumner, O'Brien, Hodgins,
//! section 3.2: the contour map).

use std::collections::BTreeSet;

use crate::press::AROUND;
use crate::tile::Extent;

/// Full columns in order, each with the number of its ring: 1 beside a free column, 0 if no way leads to one.
pub(crate) struct Contours {
    columns: Vec<((i32, i32), u32)>,
    /// By x from that of the first column on: the number of the first column there; and the number of columns.
    starts: Vec<u32>,
}

impl Contours {
    pub fn of(full: &BTreeSet<(i32, i32)>, extent: Extent) -> Contours {
        let columns: Vec<_> = full.iter().map(|column| (*column, 0)).collect();
        let mut starts = Vec::new();
        if let (Some(&((low, _), _)), Some(&((high, _), _))) = (columns.first(), columns.last()) {
            let mut rest = 0;
            for x in low..=high + 1 {
                rest += columns[rest..].iter().take_while(|((i, _), _)| *i < x).count();
                starts.push(rest as u32);
            }
        }
        let mut all = Contours { columns, starts };
        let near = |(i, k): (i32, i32)| AROUND.map(|(di, dk)| (i + di, k + dk));
        let is_free = |at: (i32, i32)| extent.contains(at.0, at.1) && all.place(at).is_none();
        let beside = |n: &usize| near(all.columns[*n].0).into_iter().any(is_free);
        let mut ring: Vec<usize> = (0..all.columns.len()).filter(beside).collect();
        let mut number = 1;
        while !ring.is_empty() {
            for n in &ring {
                all.columns[*n].1 = number;
            }
            number += 1;
            let next = ring.iter().flat_map(|n| near(all.columns[*n].0)).filter_map(|at| all.place(at));
            let mut next: Vec<usize> = next.filter(|n| all.columns[*n].1 == 0).collect();
            next.sort_unstable();
            next.dedup();
            ring = next;
        }
        all
    }

    fn place(&self, column: (i32, i32)) -> Option<usize> {
        let ((first, _), _) = self.columns.first()?;
        let x = usize::try_from(column.0.checked_sub(*first)?).ok()?;
        let (from, to) = (*self.starts.get(x)? as usize, *self.starts.get(x + 1)? as usize);
        let along = &self.columns[from..to];
        let ((_, nearest), _) = along.first()?;
        // Most rows have no gap.
        let guess = usize::try_from(column.1 - nearest).ok()?;
        if along.get(guess).is_some_and(|(at, _)| *at == column) {
            return Some(from + guess);
        }
        along.binary_search_by_key(&column, |(column, _)| *column).ok().map(|n| from + n)
    }

    /// The ring of a full column from which a way leads to a free one.
    pub fn ring(&self, column: (i32, i32)) -> Option<u32> {
        self.place(column).map(|n| self.columns[n].1).filter(|ring| *ring > 0)
    }

    /// Columns with a ring, from the one farthest from the rim on.
    pub fn inward_first(&self) -> Vec<((i32, i32), u32)> {
        let mut order: Vec<_> = self.columns.iter().copied().filter(|(_, ring)| *ring > 0).collect();
        order.sort_unstable_by_key(|(column, ring)| (std::cmp::Reverse(*ring), *column));
        order
    }
}
