//! Material that lies on bodies: floors, their loads, how loads ride on a body and slip off.
//!
//! Each span of a body has a floor on its top. A load moves with the triangle of the body that it lies on. It slips by the law of the ground, with the
//! corners at floors as triangles; a neighbour of a floor is the highest floor, or the ground, beside it that is not above its surface, or else the
//! lowest one. What slips over an edge is on the ground below in the same sweep.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::kernel::Law;
use crate::{Error, Ground};

/// A floor on a body, over a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floor {
    /// The body.
    pub body: u64,
    /// The triangle of the body.
    pub triangle: u32,
    /// Height of the floor, of what lies on it, and of what is above, in quanta.
    pub base: i64,
    pub load: i64,
    pub ceiling: i64,
    /// Where the load is, from the column, in parts of the lattice.
    pub offset: [i64; 2],
}

impl Floor {
    pub fn top(&self) -> i64 {
        self.base + self.load
    }
}

/// The floors over each column, from the lowest on.
pub(crate) type Floors = BTreeMap<(i32, i32), Vec<Floor>>;

/// A load on its way from a floor to another one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parcel {
    pub column: (i32, i32),
    /// Height of its floor.
    pub base: i64,
    pub load: i64,
    pub offset: [i64; 2],
}

/// Difference of heights up to which a floor is the one that a load lay on before, in quanta.
const SAME: i64 = 2 << 32;
/// Directions to neighbours: along x, then along z.
const SIDES: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];

/// A floor or the ground of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Node {
    column: (i32, i32),
    /// The number of the floor in its column; none: the ground.
    floor: Option<usize>,
}

/// The state of a node.
#[derive(Clone, Copy, Debug)]
struct Level {
    base: i64,
    load: i64,
    ceiling: i64,
}

impl Ground {
    /// Volume that lies on bodies, in m³.
    pub fn carried(&self) -> f64 {
        let sum: i128 = self.floors.values().flatten().map(|floor| i128::from(floor.load)).sum();
        sum as f64 / crate::tile::QUANTA * self.cell().powi(3)
    }

    /// Puts a load onto the floor of a body that it belongs to: that which is nearest to its height. Without one it falls.
    pub(crate) fn put(&mut self, body: u64, parcel: Parcel) -> Result<(), Error> {
        let Parcel { column, base, load, offset } = parcel;
        if load == 0 {
            return Ok(());
        }
        let floors = Arc::make_mut(&mut self.floors);
        let own = floors.get_mut(&column).into_iter().flatten().filter(|floor| floor.body == body);
        let nearest = own.min_by_key(|floor| (floor.base - base).abs());
        match nearest.filter(|floor| (floor.base - base).abs() <= SAME) {
            Some(floor) => {
                if load > floor.load {
                    floor.offset = offset;
                }
                floor.load += load;
                Ok(())
            }
            None => self.drop(column, base.saturating_add(load), load),
        }
    }

    /// Lets a load fall from a height: onto the highest floor below, or onto the ground.
    pub(crate) fn drop(&mut self, column: (i32, i32), height: i64, load: i64) -> Result<(), Error> {
        let column = self.extent().mirrored(column.0, column.1);
        let floors = Arc::make_mut(&mut self.floors);
        let below = floors.get_mut(&column).into_iter().flatten().filter(|floor| floor.base <= height);
        if let Some(floor) = below.max_by_key(|floor| floor.base) {
            floor.load += load;
            return Ok(());
        }
        self.wake(column.0, column.1)?;
        let (key, index) = self.setup.place(column.0, column.1);
        self.tile_mut(key)?.loose[index] += load;
        Ok(())
    }

    /// Whether something lies on a body.
    pub(crate) fn carries(&self, body: u64) -> bool {
        self.floors.values().flatten().any(|floor| floor.body == body && floor.load > 0)
    }

    /// Takes a body's floors away and returns what lay on them, with the triangles.
    pub(crate) fn take_floors(&mut self, body: u64) -> Vec<((i32, i32), Floor)> {
        if self.floors.values().flatten().all(|floor| floor.body != body) {
            return Vec::new();
        }
        let mut taken = Vec::new();
        let floors = Arc::make_mut(&mut self.floors);
        floors.retain(|column, floors| {
            floors.retain(|floor| {
                if floor.body == body && floor.load > 0 {
                    taken.push((*column, *floor));
                }
                floor.body != body
            });
            !floors.is_empty()
        });
        taken
    }

    /// Adds a body's floors, without loads.
    pub(crate) fn add_floors(&mut self, new: impl Iterator<Item = ((i32, i32), Floor)>) {
        let floors = Arc::make_mut(&mut self.floors);
        for (column, floor) in new {
            let all = floors.entry(column).or_default();
            let at = all.partition_point(|other| (other.base, other.body) < (floor.base, floor.body));
            all.insert(at, floor);
        }
    }

    fn level(&self, node: Node) -> Option<Level> {
        match node.floor {
            Some(floor) => {
                let Floor { base, load, ceiling, .. } = *self.floors.get(&node.column)?.get(floor)?;
                Some(Level { base, load, ceiling })
            }
            None => {
                let (i, k) = node.column;
                let (key, index) = self.setup.place(i, k);
                let tile = self.tiles.get(&key)?;
                let risen = self.book.fallen - tile.fallen;
                Some(Level {
                    base: tile.base(index),
                    load: tile.loose[index] + risen,
                    ceiling: self.roof((i, k)),
                })
            }
        }
    }

    /// What is beside a node in a direction.
    fn beside(&self, (column, from): ((i32, i32), Level), (di, dk): (i32, i32)) -> Option<Node> {
        let to = (column.0 + di, column.1 + dk);
        if !self.extent().contains(to.0, to.1) {
            return None;
        }
        let count = self.floors.get(&to).map_or(0, Vec::len);
        let nodes = std::iter::once(None).chain((0..count).map(Some)).map(|floor| Node { column: to, floor });
        let open = nodes.filter_map(|node| {
            let level = self.level(node)?;
            (level.base.max(from.base) < level.ceiling.min(from.ceiling)).then_some((node, level.base))
        });
        let top = from.base + from.load;
        let [mut below, mut above]: [Option<(Node, i64)>; 2] = [None; 2];
        for (node, base) in open {
            if base <= top {
                if below.is_none_or(|(_, best)| base > best) {
                    below = Some((node, base));
                }
            } else if above.is_none_or(|(_, best)| base < best) {
                above = Some((node, base));
            }
        }
        below.or(above).map(|(node, _)| node)
    }

    /// One sweep of the loads. Whether anything moved.
    pub(crate) fn sweep_loads(&mut self, law: &Law) -> Result<bool, Error> {
        let columns: Vec<_> = self.floors.iter().map(|(column, floors)| (*column, floors.len())).collect();
        for &((i, k), _) in &columns {
            for (di, dk) in std::iter::once((0, 0)).chain(SIDES) {
                let (i, k) = self.extent().mirrored(i + di, k + dk);
                self.ensure(self.setup.place(i, k).0)?;
            }
        }
        // What flows from one node to another, by pairs; sums of integers do not depend on their order.
        let mut fluxes: BTreeMap<(Node, Node), i64> = BTreeMap::new();
        for (column, count) in columns {
            for floor in 0..count {
                self.corner_fluxes(Node { column, floor: Some(floor) }, law, &mut fluxes);
            }
        }
        if fluxes.is_empty() {
            return Ok(false);
        }
        self.limit_and_apply(fluxes)
    }

    /// Fluxes of the four triangles at a floor.
    fn corner_fluxes(&self, node: Node, law: &Law, fluxes: &mut BTreeMap<(Node, Node), i64>) {
        let Some(from) = self.level(node) else { return };
        let film = law.film as i64;
        let sides = SIDES.map(|side| {
            let other = self.beside((node.column, from), side)?;
            let to = self.level(other)?;
            let e = to.base + to.load - from.base - from.load;
            let (upper, lower) = if e > 0 { (to, from) } else { (from, to) };
            let full = lower.ceiling != i64::MAX && lower.ceiling - lower.base - lower.load <= film;
            let wall = upper.load <= film || full;
            Some((other, if wall { 0.0 } else { e as f64 }))
        });
        let e = sides.map(|side| side.map_or(0.0, |(_, e)| e));
        let weight = |x: usize, z: usize| {
            let square = e[x] * e[x] + e[z] * e[z];
            let most = law.slope * law.rest;
            if square > most * most { law.tau - law.tau * law.slope / square.sqrt() } else { 0.0 }
        };
        let [a, b, c, d] = [weight(0, 2), weight(1, 2), weight(0, 3), weight(1, 3)];
        for (side, weight) in sides.into_iter().zip([a + c, b + d, a + b, c + d]) {
            let Some((other, e)) = side else { continue };
            let flux = (weight * e).round() as i64;
            if flux > 0 {
                *fluxes.entry((other, node)).or_insert(0) += flux;
            } else if flux < 0 {
                *fluxes.entry((node, other)).or_insert(0) -= flux;
            }
        }
    }

    /// Scales fluxes down to what nodes have and can take, and applies them.
    fn limit_and_apply(&mut self, fluxes: BTreeMap<(Node, Node), i64>) -> Result<bool, Error> {
        let (mut out, mut into): (BTreeMap<Node, i64>, BTreeMap<Node, i64>) =
            (BTreeMap::new(), BTreeMap::new());
        for ((from, to), flux) in &fluxes {
            *out.entry(*from).or_insert(0) += flux;
            *into.entry(*to).or_insert(0) += flux;
        }
        let scaled = |flux: i64, has: i64, wanted: i64| {
            if wanted > has {
                (i128::from(flux) * i128::from(has.max(0)) / i128::from(wanted)) as i64
            } else {
                flux
            }
        };
        let mut changes: BTreeMap<Node, i64> = BTreeMap::new();
        for ((from, to), flux) in &fluxes {
            let (Some(giver), Some(taker)) = (self.level(*from), self.level(*to)) else { continue };
            let flux = scaled(*flux, giver.load, out[from]);
            let room =
                if taker.ceiling == i64::MAX { i64::MAX } else { taker.ceiling - taker.base - taker.load };
            let flux = scaled(flux, room, into[to]);
            *changes.entry(*from).or_insert(0) -= flux;
            *changes.entry(*to).or_insert(0) += flux;
        }
        let mut moved = false;
        for (node, change) in changes.into_iter().filter(|(_, change)| *change != 0) {
            moved = true;
            let (i, k) = node.column;
            match node.floor {
                Some(floor) => {
                    let floors = Arc::make_mut(&mut self.floors);
                    if let Some(floor) = floors.get_mut(&(i, k)).and_then(|floors| floors.get_mut(floor)) {
                        floor.load += change;
                    }
                }
                None => {
                    self.wake(i, k)?;
                    let (key, index) = self.setup.place(i, k);
                    self.tile_mut(key)?.loose[index] += change;
                }
            }
        }
        Ok(moved)
    }

    /// Columns with floors, and whether the ground at or beside them slips.
    pub(crate) fn floors_are_stirred(&self) -> bool {
        let tiles: BTreeSet<_> = self.floors.keys().map(|(i, k)| self.setup.place(*i, *k).0).collect();
        let near = |(p, q): &(i32, i32)| {
            let mut around = (-1..=1).flat_map(|dq| (-1..=1).map(move |dp| (p + dp, q + dq)));
            around.any(|key| self.awake.binary_search(&key).is_ok())
        };
        tiles.iter().any(near)
    }
}
