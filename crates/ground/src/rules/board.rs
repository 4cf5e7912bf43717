//! The columns that a sweep by a rule of the papers computes, with one tile around.

use std::collections::BTreeMap;

use crate::tile::{Key, QUANTA, Tile};
use crate::wedge::note;
use crate::{Error, Ground};

/// A column: the number of its tile on the board, and the index in it.
pub(super) type Site = (usize, usize);

/// The eight neighbours of a column, and their distances in cells.
pub(super) const AROUND: [((i32, i32), f64); 8] = [
    ((1, 0), 1.0),
    ((-1, 0), 1.0),
    ((0, 1), 1.0),
    ((0, -1), 1.0),
    ((1, 1), std::f64::consts::SQRT_2),
    ((-1, 1), std::f64::consts::SQRT_2),
    ((1, -1), std::f64::consts::SQRT_2),
    ((-1, -1), std::f64::consts::SQRT_2),
];

/// What each column of the board gets, in quanta: one list a tile.
pub(super) type Moves = Vec<Vec<i64>>;
/// Speeds of slices by tile, if the rule has any.
pub(super) type SpeedLists = Vec<(Key, Vec<f64>)>;

/// Tiles to compute, and those around them.
pub(super) struct Board<'a> {
    pub ground: &'a Ground,
    side: i32,
    pub tiles: Vec<(Key, &'a Tile)>,
    /// How many of the tiles, the first ones, are to be computed.
    pub computed: usize,
    numbers: BTreeMap<Key, usize>,
}

/// What a sweep made of a tile: loose material and the columns that have changed.
pub(crate) struct Changed {
    key: Key,
    loose: Option<Box<[i64]>>,
    awake: Box<[u32]>,
    updates: u64,
}

impl<'a> Board<'a> {
    /// Makes the tiles around those of a list.
    pub fn new(ground: &'a mut Ground, list: &[Key]) -> Result<Board<'a>, Error> {
        let (extent, side) = (ground.extent(), ground.setup.side);
        let near =
            |key: &Key| (0..9).map(move |n| (key.0 + n % 3 - 1, key.1 + n / 3 - 1)).collect::<Vec<_>>();
        let around = list.iter().flat_map(near).filter(|key| extent.has_tile(*key, side));
        let mut ring: Vec<Key> = around.filter(|key| list.binary_search(key).is_err()).collect();
        ring.sort_unstable();
        ring.dedup();
        for key in list.iter().chain(&ring) {
            ground.ensure(*key)?;
        }
        let ground = &*ground;
        let stored = list.iter().chain(&ring).filter_map(|key| Some((*key, &**ground.tiles.get(key)?)));
        let tiles: Vec<_> = stored.collect();
        let numbers = tiles.iter().enumerate().map(|(number, (key, _))| (*key, number)).collect();
        Ok(Board { ground, side, tiles, computed: list.len(), numbers })
    }

    /// No moves.
    pub fn still(&self) -> Moves {
        let columns = self.ground.setup.settings.side.pow(2);
        vec![vec![0; columns]; self.tiles.len()]
    }

    /// The columns to compute, in order.
    pub fn sites(&self) -> impl Iterator<Item = Site> + '_ {
        let (columns, extent) = (self.ground.setup.settings.side.pow(2), self.ground.extent());
        let inside = move |(tile, index): &Site| {
            let (i, k) = self.ground.setup.column(self.tiles[*tile].0, *index);
            extent.contains(i, k)
        };
        (0..self.computed).flat_map(move |tile| (0..columns).map(move |index| (tile, index))).filter(inside)
    }

    /// The column beside one; none beyond the edges of the ground and of the board.
    pub fn beside(&self, (tile, index): Site, (di, dk): (i32, i32)) -> Option<Site> {
        let (side, index) = (self.side, index as i32);
        let (i, k) = (index % side + di, index / side + dk);
        let (p, q) = self.tiles[tile].0;
        if !self.ground.extent().contains(p * side + i, q * side + k) {
            return None;
        }
        if (0..side).contains(&i) && (0..side).contains(&k) {
            return Some((tile, (k * side + i) as usize));
        }
        let (key, index) = self.ground.setup.place(p * side + i, q * side + k);
        Some((*self.numbers.get(&key)?, index))
    }

    /// Height of a column's surface in quanta.
    pub fn top(&self, (tile, index): Site) -> i64 {
        self.tiles[tile].1.top(index)
    }

    /// What a column can give: its loose material in quanta.
    pub fn loose(&self, (tile, index): Site) -> i64 {
        self.tiles[tile].1.loose[index]
    }

    /// What a column can take until it meets a body above it, in quanta.
    pub fn room(&self, (tile, index): Site) -> i64 {
        let (key, columns) = self.tiles[tile];
        let roof = self.ground.roofs.get(&key).map_or(i64::MAX, |roofs| roofs[index]);
        if roof == i64::MAX { i64::MAX } else { (roof - columns.top(index)).max(0) }
    }

    /// Tangent of the angle of repose between two columns: that of compressed material if one of them is.
    pub fn repose(&self, from: Site, to: Site) -> f64 {
        let own = |(tile, index): Site| {
            let columns = self.tiles[tile].1;
            let slope = columns.slope.as_ref().map_or(self.ground.setup.law.slope, |slope| slope[index]);
            if columns.packed[index] > 0 { self.ground.soil().inner_slope() } else { slope / QUANTA }
        };
        own(from).max(own(to))
    }

    /// Loose material after the moves, and the columns that have changed.
    pub fn outcome(&self, list: &[Key], moves: &Moves) -> Vec<Changed> {
        let side = self.ground.setup.settings.side;
        let each = self.tiles.iter().zip(moves);
        each.map(|((key, tile), moves)| {
            let mut awake = vec![0_u32; side].into_boxed_slice();
            for (index, _) in moves.iter().enumerate().filter(|(_, change)| **change != 0) {
                awake[index / side] |= 1 << (index % side);
            }
            let moved = awake.iter().any(|row| *row != 0);
            let loose =
                moved.then(|| tile.loose.iter().zip(moves).map(|(loose, change)| loose + change).collect());
            let updates = if list.binary_search(key).is_ok() { (side * side) as u64 } else { 0 };
            Changed { key: *key, loose, awake, updates }
        })
        .collect()
    }
}

impl Ground {
    /// Puts the outcome of a sweep by a rule into the tiles.
    pub(super) fn take_over_moves(&mut self, outcome: Vec<Changed>) -> Result<(), Error> {
        let bonds = self.setup.settings.rule.bonds(self.soil());
        self.awake.clear();
        for Changed { key, loose, awake, updates } in outcome {
            self.book.updates += updates;
            let is_awake = self.tiles.get(&key).is_some_and(|tile| tile.is_awake());
            let Some(loose) = loose else {
                if is_awake {
                    self.tile_mut(key)?.awake.fill(0);
                }
                continue;
            };
            if bonds {
                note(&mut self.strained, key, &awake);
            }
            let tile = self.tile_mut(key)?;
            (tile.loose, tile.awake) = (loose, awake);
            self.awake.push(key);
        }
        self.awake.sort_unstable();
        Ok(())
    }
}
