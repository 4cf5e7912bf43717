//! Material that lies on bodies: floors, their loads, how loads ride on a body and slip off.
//!
//! Each span of a body has a floor on its top. A load moves with the triangle of the body that it lies on. It slips by the law of the ground, with the
//! corners at floors as triangles; a neighbour of a floor is the highest floor, or the ground, beside it that is not above its surface, or else the
//! lowest one. What slips over an edge is on the ground below in the same sweep.

use std::collections::BTreeMap;
use std::sync::Arc;

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
        let columns = self.feet.get(&body).into_iter().flat_map(|foot| &foot.floors);
        let mut floors = columns.filter_map(|column| self.floors.get(column)).flatten();
        floors.any(|floor| floor.body == body && floor.load > 0)
    }

    /// Takes a body's floors away and returns what lay on them, with the triangles.
    pub(crate) fn take_floors(&mut self, body: u64) -> Vec<((i32, i32), Floor)> {
        let Some(foot) = self.feet.get(&body).cloned().filter(|foot| !foot.floors.is_empty()) else {
            return Vec::new();
        };
        self.graph = None;
        let mut taken = Vec::new();
        let floors = Arc::make_mut(&mut self.floors);
        if floors.values().flatten().all(|floor| floor.body == body) {
            // No other body has floors.
            let all = std::mem::take(floors).into_iter();
            let all = all.flat_map(|(column, floors)| floors.into_iter().map(move |floor| (column, floor)));
            taken = all.filter(|(_, floor)| floor.load > 0).collect();
            // In the order of the columns of spans, as below.
            taken.sort_by_key(|((i, k), _)| (*k, *i));
            return taken;
        }
        for column in &foot.floors {
            let Some(all) = floors.get_mut(column) else { continue };
            all.retain(|floor| {
                if floor.body == body && floor.load > 0 {
                    taken.push((*column, *floor));
                }
                floor.body != body
            });
            if all.is_empty() {
                floors.remove(column);
            }
        }
        taken
    }

    /// Adds a body's floors, without loads.
    pub(crate) fn add_floors(&mut self, new: impl Iterator<Item = ((i32, i32), Floor)>) {
        self.graph = None;
        let floors = Arc::make_mut(&mut self.floors);
        if floors.is_empty() {
            let mut all: Vec<_> = new.collect();
            all.sort_unstable_by_key(|(column, floor)| (*column, floor.base, floor.body));
            let columns = all.chunk_by(|a, b| a.0 == b.0);
            *floors = columns.map(|all| (all[0].0, all.iter().map(|(_, floor)| *floor).collect())).collect();
            return;
        }
        for (column, floor) in new {
            let all = floors.entry(column).or_default();
            let at = all.partition_point(|other| (other.base, other.body) < (floor.base, floor.body));
            all.insert(at, floor);
        }
    }
}
