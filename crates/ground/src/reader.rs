//! Heights of columns, read one after the other.

use crate::Ground;
use crate::tile::{Extent, Key, QUANTA, Tile};

/// Reads columns of a ground, fast where they are in the tile of the one before.
pub(crate) struct Reader<'a> {
    ground: &'a Ground,
    last: Option<(Key, Option<&'a Tile>)>,
}

impl<'a> Reader<'a> {
    pub fn new(ground: &'a Ground) -> Reader<'a> {
        Reader { ground, last: None }
    }

    /// Height of a column in quanta, as [`Ground::top`].
    pub fn top(&mut self, (i, k): (i32, i32)) -> i64 {
        let ground = self.ground;
        let (i, k) = ground.extent().mirrored(i, k);
        let (key, index) = ground.setup.place(i, k);
        let tile = match self.last {
            Some((last, tile)) if last == key => tile,
            _ => {
                let tile = ground.tiles.get(&key).map(|tile| &**tile);
                self.last = Some((key, tile));
                tile
            }
        };
        match tile {
            Some(tile) => tile.top(index) + (ground.book.fallen - tile.fallen),
            None => ground.top(i, k),
        }
    }
}

impl Ground {
    /// The box around all columns in memory that are higher or lower by more than a height in m than before anything touched them; none if there are none.
    pub fn moved(&self, least: f64) -> Option<Extent> {
        let (extent, least) = (self.extent(), least / self.cell() * QUANTA);
        let mut found: Option<Extent> = None;
        for (key, tile) in self.tiles.iter() {
            for index in 0..tile.bed.len() {
                let (i, k) = self.setup.column(*key, index);
                let before = self.setup.untouched(i, k).unwrap_or_default().iter().sum::<i64>();
                let change = tile.top(index) + (self.book.fallen - tile.fallen) - before;
                if !extent.contains(i, k) || change.unsigned_abs() as f64 <= least {
                    continue;
                }
                let Extent { x, z } = found.unwrap_or(Extent { x: [i; 2], z: [k; 2] });
                found = Some(Extent { x: [x[0].min(i), x[1].max(i)], z: [z[0].min(k), z[1].max(k)] });
            }
        }
        found
    }
}
