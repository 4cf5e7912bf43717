//! Sweeps: which columns slip, from tile to tile, until everything is at rest.
//!
//! A sweep moves material along all edges at once, from the heights that it finds. It computes only squares that have a column that slipped in the
//! sweep before, or was changed. So what happens far away changes nothing here, and the order of tiles and the number of threads do not matter.

use std::ops::Range;
use std::sync::Arc;

use crate::ground::TAU;
use crate::kernel::{Block, Law, Traits, to_float};
use crate::slide;
use crate::tile::{Key, Tile};
use crate::wedge::note;
use crate::{Error, Ground, Rule};

/// Columns around a tile on which its fluxes depend.
pub(crate) const HALO: usize = 2;
/// Fewest tiles for which threads are started.
const MANY: usize = 32;

/// In the place of a neighbour: the column is far beyond an edge, where nothing depends on it.
const FAR: usize = 3;

/// The neighbours of a tile and itself, in rows; none beyond the edges.
pub(crate) type Around<'a> = [Option<&'a Tile>; 9];

/// Rows of a block and places in them.
type Area = (Range<usize>, Range<usize>);

/// New loose material of a tile, and which columns slipped.
struct Outcome {
    key: Key,
    loose: Box<[i64]>,
    /// How far columns have slid, if that is followed.
    slid: Option<Box<[[f64; 2]]>>,
    awake: Box<[u32]>,
    updates: u64,
}

impl Ground {
    /// Lets the ground slip until it is at rest, in at most this many sweeps. Time stands still.
    ///
    /// # Errors
    ///
    /// More sweeps or more memory than allowed.
    pub fn settle(&mut self, most: u64) -> Result<(), Error> {
        self.sweeps_at_most(most)?;
        if self.is_at_rest() { Ok(()) } else { Err(Error::Sweeps { sweeps: most, at: self.unrest() }) }
    }

    /// Sweeps until the ground is at rest, or this many times. Time stands still.
    ///
    /// # Errors
    ///
    /// More memory than allowed.
    pub fn sweeps_at_most(&mut self, most: u64) -> Result<(), Error> {
        let law = Law { tau: TAU, ..self.setup.law };
        for _ in 0..most {
            if self.is_at_rest() {
                break;
            }
            self.step(&law)?;
        }
        Ok(())
    }

    /// A place that is not at rest: x and z in m.
    pub(crate) fn unrest(&self) -> [f64; 2] {
        let key = self.awake.first().or(self.fresh.first()).copied().unwrap_or_default();
        let side = self.setup.settings.side;
        let first = self.tiles.get(&key).and_then(|tile| {
            let row = tile.awake.iter().position(|row| *row != 0)?;
            Some(row * side + tile.awake[row].trailing_zeros() as usize)
        });
        let (i, k) = self.setup.column(key, first.unwrap_or(0));
        [i, k].map(|at| f64::from(at) * self.cell())
    }

    /// One sweep of the ground and of what lies on bodies.
    pub(crate) fn step(&mut self, law: &Law) -> Result<(), Error> {
        match self.setup.settings.rule {
            Rule::Law => self.sweep(law)?,
            rule => self.sweep_by(rule)?,
        }
        self.sweep_loads(law)
    }

    /// One sweep of the ground.
    pub(crate) fn sweep(&mut self, law: &Law) -> Result<(), Error> {
        self.book.sweeps += 1;
        if self.is_at_rest() {
            return Ok(());
        }
        self.spread_fresh();
        let list = self.to_compute();
        for &key in &list {
            for key in around(key) {
                if self.setup.description.extent.has_tile(key, self.setup.side) {
                    self.ensure(key)?;
                }
            }
        }
        let fresh = std::mem::take(&mut self.fresh);
        let threads = if list.len() >= MANY { self.setup.settings.threads.min(list.len()) } else { 1 };
        let this = &*self;
        let compute = |part: &[Key]| {
            let mut worker = Worker::new(this, law);
            let full = |key: &Key| fresh.binary_search(key).is_ok();
            part.iter().filter_map(|key| worker.compute(*key, full(key))).collect::<Vec<_>>()
        };
        let outcomes = if threads > 1 {
            std::thread::scope(|scope| {
                let parts = list.chunks(list.len().div_ceil(threads));
                let running: Vec<_> = parts.map(|part| (part, scope.spawn(move || compute(part)))).collect();
                // A thread that could not do its part leaves it to this one.
                let done =
                    running.into_iter().map(|(part, thread)| thread.join().unwrap_or_else(|_| compute(part)));
                done.flatten().collect::<Vec<_>>()
            })
        } else {
            compute(&list)
        };
        self.take_over(&list, outcomes)
    }

    /// Adds the neighbours of tiles that are to be examined: a flux from one into another is computed in both.
    pub(crate) fn spread_fresh(&mut self) {
        let (side, extent) = (self.setup.side, self.setup.description.extent);
        let near = self.fresh.iter().flat_map(|key| around(*key)).filter(|key| extent.has_tile(*key, side));
        let mut near: Vec<_> = near.collect();
        near.sort_unstable();
        near.dedup();
        self.fresh = near;
    }

    /// Tiles with columns that can move in a sweep, in order.
    pub(crate) fn to_compute(&self) -> Vec<Key> {
        let (side, extent) = (self.setup.side, self.setup.description.extent);
        let mut list = self.fresh.clone();
        for &key in &self.awake {
            let Some(tile) = self.tiles.get(&key) else { continue };
            let mut all = 0;
            for row in &tile.awake {
                all |= row;
            }
            let first = tile.awake.first().copied().unwrap_or(0);
            let last = tile.awake.last().copied().unwrap_or(0);
            // Bits of columns, of rows: whether something is awake at the lower edge, anywhere, at the higher edge.
            let rows = [first, all, last];
            for (index, near) in around(key).into_iter().enumerate() {
                let row = rows[index / 3];
                let reaches = match index % 3 {
                    0 => row & 1 != 0,
                    1 => row != 0,
                    _ => row >> (side - 1) & 1 != 0,
                };
                if reaches && extent.has_tile(near, side) {
                    list.push(near);
                }
            }
        }
        list.sort_unstable();
        list.dedup();
        list
    }

    /// Puts the outcomes of a sweep into the tiles.
    fn take_over(&mut self, list: &[Key], outcomes: Vec<Outcome>) -> Result<(), Error> {
        let mut outcomes = outcomes.into_iter().peekable();
        let before = std::mem::take(&mut self.awake);
        let cohesive = self.setup.settings.rule.bonds(self.soil());
        let tiles = Arc::make_mut(&mut self.tiles);
        for key in list {
            match outcomes.next_if(|outcome| outcome.key == *key) {
                Some(Outcome { loose, awake, updates, slid, .. }) => {
                    self.book.updates += updates;
                    let moves = awake.iter().any(|row| *row != 0);
                    if moves && cohesive {
                        note(&mut self.strained, *key, &awake);
                    }
                    let Some(shared) = tiles.get_mut(key) else { continue };
                    if moves || shared.is_awake() {
                        let tile = Arc::make_mut(shared);
                        (tile.loose, tile.awake) = (loose, awake);
                        tile.slid = slid.or(tile.slid.take());
                    }
                    if moves {
                        self.awake.push(*key);
                    }
                }
                None => {
                    // Nothing near it is awake.
                    if before.binary_search(key).is_ok()
                        && let Some(tile) = tiles.get_mut(key)
                    {
                        Arc::make_mut(tile).awake.fill(0);
                    }
                }
            }
        }
        Ok(())
    }
}

/// A tile and its neighbours, in rows.
fn around((p, q): Key) -> [Key; 9] {
    std::array::from_fn(|n| (p + n as i32 % 3 - 1, q + n as i32 / 3 - 1))
}

/// Memory for the computation of a tile.
struct Worker<'a> {
    ground: &'a Ground,
    law: &'a Law,
    block: Block,
    /// For each place along x and along z, from two before the tile on: which of the three neighbours has that column, and where.
    images: [Vec<(usize, usize)>; 2],
    /// Bits of the columns of a row that are awake, from two before the tile on.
    awake: Vec<u64>,
}

impl<'a> Worker<'a> {
    fn new(ground: &'a Ground, law: &'a Law) -> Worker<'a> {
        let width = ground.setup.settings.side + 2 * HALO;
        Worker {
            ground,
            law,
            block: Block::new(width),
            images: [vec![(FAR, 0); width], vec![(FAR, 0); width]],
            awake: vec![0; width],
        }
    }

    /// What a sweep makes of a tile; none if nothing in it can move.
    fn compute(&mut self, key: Key, full: bool) -> Option<Outcome> {
        let ground = self.ground;
        let side = ground.setup.settings.side;
        let tiles: Around = around(key).map(|key| ground.tiles.get(&key).map(|tile| &**tile));
        let tile = tiles[4]?;
        let inside = ground.setup.description.extent.surrounds(key, ground.setup.side);
        self.find_images(key);
        self.gather_awake(&tiles, inside);
        let (rows, places) = if full { (HALO..HALO + side, HALO..HALO + side) } else { self.reach(side)? };
        let around = (rows.start - HALO..rows.end + HALO, places.start - HALO..places.end + HALO);
        // A little less than any, where they differ from place to place.
        let least = self.law.slope
            * (1.0 - ground.soil().rough)
            * if ground.soil().rough > 0.0 { 0.999 } else { 1.0 };
        let mut traits = Traits { least, ..Traits::default() };
        if inside {
            self.gather(&tiles, &around.0);
        } else {
            self.gather_mirrored(&tiles, &around);
        }
        let width = self.block.width;
        let wanted = u64::MAX >> (64 - around.1.len()) << around.1.start;
        traits.varied = around.0.clone().any(|r| self.awake[r] & wanted != wanted)
            || tiles.iter().flatten().any(|tile| tile.pressed || tile.slope.is_some());
        let roofs = self::around(key).map(|key| ground.roofs.get(&key).map(|roofs| &**roofs));
        traits.roofed = roofs.iter().any(Option::is_some);
        traits.bare = around.0.clone().any(|r| {
            let row = &self.block.loose[r * width + around.1.start..r * width + around.1.end];
            let bare = row.iter().fold(0, |bare, loose| bare | u64::from(*loose <= self.law.film));
            bare != 0
        });
        if traits.varied {
            self.gather_slopes(&tiles, &around, inside);
        }
        if traits.roofed {
            self.gather_roofs(&roofs, &tiles, &around, inside);
        }
        self.block.flow(self.law, &rows, &places, traits);
        let mut loose = tile.loose.clone();
        let mut awake = vec![0; side].into_boxed_slice();
        let shift = places.start - HALO;
        for r in rows.clone() {
            let row = &mut loose[(r - HALO) * side..][..side];
            if inside {
                awake[r - HALO] = self.block.apply(r, &places, &mut row[shift..]) << shift;
            } else {
                let mut new = [0; 32];
                let bits = self.block.apply(r, &places, &mut new) << shift;
                for (c, new) in (places.start - HALO..places.end - HALO).zip(new) {
                    let (i, k) = ground.setup.column(key, (r - HALO) * side + c);
                    if ground.extent().contains(i, k) {
                        row[c] = new;
                        awake[r - HALO] |= bits & 1 << c;
                    }
                }
            }
        }
        let follows = ground.setup.settings.slides && awake.iter().any(|row| *row != 0);
        let slid = follows.then(|| slide::slid(&self.block, &tiles, (&rows, &places), side, &awake));
        Some(Outcome { key, loose, slid, awake, updates: (rows.len() * places.len()) as u64 })
    }

    /// Rows of the block and places in them that a flux can reach; none if nothing near is awake.
    fn reach(&self, side: usize) -> Option<Area> {
        let near = ((1 << (side + 2)) - 1) << 1;
        let rows = 1..side + 3;
        let first = rows.clone().find(|r| self.awake[*r] & near != 0)?;
        let last = rows.clone().rev().find(|r| self.awake[*r] & near != 0)?;
        let all = rows.fold(0, |all, r| all | self.awake[r] & near);
        let clamp = |from: usize, to: usize| from.saturating_sub(1).max(HALO)..(to + 2).min(HALO + side);
        let (rows, places) =
            (clamp(first, last), clamp(all.trailing_zeros() as usize, 63 - all.leading_zeros() as usize));
        (!rows.is_empty() && !places.is_empty()).then_some((rows, places))
    }

    /// For a row of the block, the number of the tiles in that row of tiles, and the row in these.
    fn band(r: usize, side: usize) -> (usize, usize) {
        match r {
            r if r < HALO => (0, side + r - HALO),
            r if r < HALO + side => (1, r - HALO),
            r => (2, r - HALO - side),
        }
    }

    /// The parts of a row of the block that three tiles have: the number of the tile, where the part is in the block, and where in the tile.
    fn parts(r: usize, row: usize, side: usize, width: usize) -> [(usize, Range<usize>, Range<usize>); 3] {
        let (before, after, at) = (row * side, (row + 1) * side, r * width);
        [
            (0, at..at + HALO, after - HALO..after),
            (1, at + HALO..at + HALO + side, before..after),
            (2, at + HALO + side..at + width, before..before + HALO),
        ]
    }

    /// Calls a function with each part of rows of the block: where it is there, its tile, and where in that.
    fn each_part(
        &mut self,
        tiles: &Around,
        rows: &Range<usize>,
        mut put: impl FnMut(&mut Block, Range<usize>, &Tile, Range<usize>),
    ) {
        let (side, width) = (self.ground.setup.settings.side, self.block.width);
        for r in rows.clone() {
            let (band, row) = Self::band(r, side);
            for (number, to, from) in Self::parts(r, row, side, width) {
                if let Some(tile) = tiles[3 * band + number] {
                    put(&mut self.block, to, tile, from);
                }
            }
        }
    }

    /// Finds the columns that stand for those of the block: themselves, or their mirror images.
    fn find_images(&mut self, key: Key) {
        let (side, extent) = (self.ground.setup.side, self.ground.extent());
        for n in 0..self.block.width {
            let beyond = |at: i32| at * side + n as i32 - HALO as i32;
            let (i, k) = extent.mirrored(beyond(key.0), beyond(key.1));
            for (images, (at, middle)) in self.images.iter_mut().zip([(i, key.0), (k, key.1)]) {
                let near = at.div_euclid(side) - middle + 1;
                let near = if (0..3).contains(&near) { near as usize } else { FAR };
                images[n] = (near, at.rem_euclid(side) as usize);
            }
        }
    }

    fn gather_awake(&mut self, tiles: &Around, inside: bool) {
        let side = self.ground.setup.settings.side;
        for r in 0..self.block.width {
            self.awake[r] = if inside {
                let (band, row) = Self::band(r, side);
                let three = [tiles[3 * band], tiles[3 * band + 1], tiles[3 * band + 2]];
                let bits = three.map(|tile| tile.map_or(0, |tile| u64::from(tile.awake[row])));
                (bits[0] >> (side - HALO)) | (bits[1] << HALO) | ((bits[2] & 3) << (HALO + side))
            } else {
                // Beyond the edges, columns are awake that are images of such.
                let (band, row) = self.images[1][r];
                let bits = |near: usize| {
                    let tile = if band < FAR { tiles[3 * band + near] } else { None };
                    tile.map_or(0, |tile| u64::from(tile.awake[row]))
                };
                let bits = [bits(0), bits(1), bits(2), 0];
                let places = self.images[0].iter().enumerate();
                places.fold(0, |all, (c, (near, place))| all | (bits[*near] >> place & 1) << c)
            };
        }
    }

    /// Heights and loose material of rows of the block.
    fn gather(&mut self, tiles: &Around, rows: &Range<usize>) {
        self.each_part(tiles, rows, |block, to, tile, from| {
            let (bed, bonded, loose) =
                (&tile.bed[from.clone()], &tile.bonded[from.clone()], &tile.loose[from]);
            let heights = &mut block.height[to.clone()];
            for (((height, bed), bonded), loose) in heights.iter_mut().zip(bed).zip(bonded).zip(loose) {
                *height = to_float(bed.wrapping_add(*bonded).wrapping_add(*loose));
            }
            for (to, loose) in block.loose[to].iter_mut().zip(loose) {
                *to = to_float(*loose);
            }
        });
    }

    /// Calls a function with each place in rows and places of the block, the tile of the column that is there, and its number and the index in it.
    fn each(
        &mut self,
        tiles: &Around,
        (rows, places): &Area,
        mut put: impl FnMut(&mut Block, usize, &Tile, usize, usize),
    ) {
        let (side, width) = (self.ground.setup.settings.side, self.block.width);
        for r in rows.clone() {
            let (band, row) = self.images[1][r];
            if band == FAR {
                continue;
            }
            let three = [tiles[3 * band], tiles[3 * band + 1], tiles[3 * band + 2], None];
            for (c, &(near, place)) in places.clone().zip(&self.images[0][places.clone()]) {
                if let Some(tile) = three[near] {
                    put(&mut self.block, r * width + c, tile, 3 * band + near, row * side + place);
                }
            }
        }
    }

    fn gather_mirrored(&mut self, tiles: &Around, around: &Area) {
        self.each(tiles, around, |block, at, tile, _, index| {
            block.height[at] = to_float(tile.top(index));
            block.loose[at] = to_float(tile.loose[index]);
        });
    }

    fn gather_slopes(&mut self, tiles: &Around, around: &Area, inside: bool) {
        let (ground, law, width) = (self.ground, self.law, self.block.width);
        let (rows, places) = around;
        let inner = law.slope * (ground.soil().inner_slope() / ground.soil().slope());
        if !tiles.iter().flatten().any(|tile| tile.pressed || tile.slope.is_some()) {
            self.block.slope[rows.start * width..rows.end * width].fill(law.slope);
        } else if inside {
            self.each_part(tiles, rows, |block, to, tile, from| {
                let to = &mut block.slope[to];
                match &tile.slope {
                    Some(slope) => to.copy_from_slice(&slope[from.clone()]),
                    None => to.fill(law.slope),
                }
                if tile.pressed {
                    for (slope, packed) in to.iter_mut().zip(&tile.packed[from]) {
                        *slope = if *packed > 0 { inner } else { *slope };
                    }
                }
            });
        } else {
            self.each(tiles, around, |block, at, tile, _, index| {
                let outer = tile.slope.as_ref().map_or(law.slope, |slope| slope[index]);
                block.slope[at] = if tile.packed[index] > 0 { inner } else { outer };
            });
        }
        for r in rows.clone() {
            let (bits, row) = (self.awake[r], &mut self.block.ratio[r * width..(r + 1) * width]);
            let wanted = u64::MAX >> (64 - places.len()) << places.start;
            match bits & wanted {
                0 => row[places.clone()].fill(ground.setup.start),
                all if all == wanted => row[places.clone()].fill(law.rest),
                _ => {
                    for c in places.clone() {
                        row[c] = if bits >> c & 1 != 0 { law.rest } else { ground.setup.start };
                    }
                }
            }
        }
    }

    fn gather_roofs(&mut self, roofs: &[Option<&[i64]>; 9], tiles: &Around, around: &Area, inside: bool) {
        if inside {
            let side = self.ground.setup.settings.side;
            for r in around.0.clone() {
                let (band, row) = Self::band(r, side);
                for (number, to, from) in Self::parts(r, row, side, self.block.width) {
                    let room = &mut self.block.room[to];
                    let (Some(tile), Some(roofs)) = (tiles[3 * band + number], roofs[3 * band + number])
                    else {
                        room.fill(f64::INFINITY);
                        continue;
                    };
                    for ((room, roof), index) in room.iter_mut().zip(&roofs[from.clone()]).zip(from) {
                        *room = match *roof {
                            i64::MAX => f64::INFINITY,
                            roof => to_float(roof - tile.top(index)),
                        };
                    }
                }
            }
            return;
        }
        self.each(tiles, around, |block, at, tile, number, index| {
            let roof = roofs[number].map_or(i64::MAX, |roofs| roofs[index]);
            block.room[at] = if roof == i64::MAX { f64::INFINITY } else { to_float(roof - tile.top(index)) };
        });
    }
}
