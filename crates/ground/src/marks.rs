//! Columns that are marked, as bits of tiles.

use std::collections::BTreeMap;

use crate::tile::{Extent, Key};

/// The largest number of columns in a row of a tile.
const WIDEST: usize = 32;

/// Marked columns of some tiles.
pub(crate) struct Marks {
    /// Columns in a row of a tile, and its logarithm to the base of two.
    side: i32,
    shift: u32,
    /// Tiles with the bits of their rows, in the order in which they came; and where they are there.
    tiles: Vec<(Key, [u32; WIDEST])>,
    numbers: BTreeMap<Key, usize>,
    last: Option<(Key, usize)>,
}

impl Marks {
    pub fn new(side: i32) -> Marks {
        let shift = side.trailing_zeros();
        Marks { side, shift, tiles: Vec::new(), numbers: BTreeMap::new(), last: None }
    }

    fn tile(&mut self, key: Key) -> &mut [u32; WIDEST] {
        let number = match self.last {
            Some((last, number)) if last == key => number,
            _ => {
                let next = self.tiles.len();
                let number = *self.numbers.entry(key).or_insert(next);
                if number == next {
                    self.tiles.push((key, [0; WIDEST]));
                }
                self.last = Some((key, number));
                number
            }
        };
        &mut self.tiles[number].1
    }

    /// Marks a column.
    pub fn add(&mut self, (i, k): (i32, i32)) {
        let (shift, last) = (self.shift, self.side - 1);
        self.tile((i >> shift, k >> shift))[(k & last) as usize] |= 1 << (i & last);
    }

    /// Marks a column and those around it.
    pub fn add_around(&mut self, (i, k): (i32, i32)) {
        let (shift, last) = (self.shift, self.side - 1);
        let (c, r) = (i & last, k & last);
        if c == 0 || c == last || r == 0 || r == last {
            (-1..=1).for_each(|dk| (-1..=1).for_each(|di| self.add((i + di, k + dk))));
            return;
        }
        let rows = self.tile((i >> shift, k >> shift));
        for row in &mut rows[r as usize - 1..r as usize + 2] {
            *row |= 7 << (c - 1);
        }
    }

    /// The tiles in order, with the bits of their columns that are within an extent.
    pub fn within(mut self, extent: Extent) -> impl Iterator<Item = (Key, [u32; WIDEST])> {
        let side = self.side;
        self.tiles.sort_unstable_by_key(|(key, _)| *key);
        self.tiles.into_iter().filter_map(move |(key, mut rows)| {
            if !extent.surrounds(key, side) {
                let inside = |at: i32, [from, to]: [i32; 2]| (from..=to).contains(&at);
                let places = (0..side).filter(|c| inside(key.0 * side + c, extent.x));
                let wanted = places.fold(0_u32, |wanted, c| wanted | 1 << c);
                for (row, k) in rows.iter_mut().zip(key.1 * side..) {
                    *row &= if inside(k, extent.z) { wanted } else { 0 };
                }
            }
            rows.iter().any(|row| *row != 0).then_some((key, rows))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::Marks;
    use crate::Extent;

    /// At and around edges of tiles and of the ground, as a set of columns.
    #[test]
    fn marked_columns_are_those_of_a_set() {
        let extent = Extent { x: [-20, 45], z: [-3, 33] };
        for side in [16, 32] {
            let (mut marks, mut expected) = (Marks::new(side), BTreeSet::new());
            for (n, at) in
                [(-21, 0), (-17, -4), (0, 0), (15, 16), (31, 33), (46, 5), (20, 20)].iter().enumerate()
            {
                if n % 3 == 2 {
                    marks.add(*at);
                    expected.insert(*at);
                } else {
                    marks.add_around(*at);
                    let around = (-1..=1).flat_map(|di| (-1..=1).map(move |dk| (at.0 + di, at.1 + dk)));
                    expected.extend(around);
                }
            }
            expected.retain(|(i, k)| extent.contains(*i, *k));
            let mut found = BTreeSet::new();
            for ((p, q), rows) in marks.within(extent) {
                for (row, k) in rows.iter().zip(q * side..) {
                    found.extend((0..32).filter(|c| row >> c & 1 != 0).map(|c| (p * side + c, k)));
                }
            }
            assert_eq!(found, expected);
        }
    }
}
