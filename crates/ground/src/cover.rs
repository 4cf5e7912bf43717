//! What bodies cover: their undersides as ceilings over columns.

use std::sync::Arc;

use crate::press::AROUND;
use crate::spans::Place;
use crate::{Error, Ground};

/// What a body covers: the lowest underside over each column, in quanta.
#[derive(Clone, Debug, Default)]
pub(crate) struct Foot {
    pub places: Arc<[Place]>,
    /// In order along z first, as spans are.
    pub undersides: Vec<((i32, i32), i64)>,
    /// First and last column with an underside along x and z.
    pub reach: Option<[[i32; 2]; 2]>,
    /// Columns with floors of the body.
    pub floors: Vec<(i32, i32)>,
    /// Whether its spans were computed: they are not where a body can neither press nor carry anything.
    pub spanned: bool,
}

impl Foot {
    /// Whether some point is lower than a height in quanta.
    pub fn comes_below(&self, height: i64) -> bool {
        self.places.iter().any(|place| place.y < height)
    }

    /// The underside over a column.
    fn over(&self, (i, k): (i32, i32)) -> Option<i64> {
        let at = self.undersides.binary_search_by_key(&(k, i), |((i, k), _)| (*k, *i)).ok()?;
        Some(self.undersides[at].1)
    }
}

/// The box around columns.
pub(crate) fn reach_of(columns: &[((i32, i32), i64)]) -> Option<[[i32; 2]; 2]> {
    columns.iter().fold(None, |reach, &((i, k), _)| {
        let [x, z] = reach.unwrap_or([[i; 2], [k; 2]]);
        Some([[x[0].min(i), x[1].max(i)], [z[0].min(k), z[1].max(k)]])
    })
}

fn meet(a: Option<[[i32; 2]; 2]>, b: Option<[[i32; 2]; 2]>) -> bool {
    let along = |a: [i32; 2], b: [i32; 2]| a[0] <= b[1] && b[0] <= a[1];
    a.zip(b).is_some_and(|(a, b)| along(a[0], b[0]) && along(a[1], b[1]))
}

/// The columns of two lists, in order, each with the lower underside.
fn merged(a: &[((i32, i32), i64)], b: &[((i32, i32), i64)]) -> Vec<((i32, i32), i64)> {
    let mut all: Vec<_> = a.iter().chain(b).copied().collect();
    all.sort_unstable_by_key(|((i, k), underside)| (*k, *i, *underside));
    all.dedup_by_key(|(column, _)| *column);
    all
}

impl Ground {
    /// Puts a body's new undersides in the place of the old ones, and wakes the columns that this concerns.
    pub(crate) fn cover(&mut self, id: u64, before: Option<&Foot>, after: Option<Foot>) -> Result<(), Error> {
        let under = |foot: Option<&Foot>| foot.map_or(Vec::new(), |foot| foot.undersides.clone());
        let lowest = merged(&under(before), &under(after.as_ref()));
        let feet = Arc::make_mut(&mut self.feet);
        match after {
            Some(foot) => feet.insert(id, Arc::new(foot)),
            None => feet.remove(&id),
        };
        let reach = reach_of(&lowest);
        let near: Vec<_> = self.feet.values().filter(|foot| meet(foot.reach, reach)).cloned().collect();
        let roofs = lowest.iter().map(|&(column, _)| {
            let all = near.iter().filter_map(|foot| foot.over(column));
            (column, all.min().unwrap_or(i64::MAX))
        });
        let roofs: Vec<_> = roofs.collect();
        self.set_roofs(&roofs);
        // Columns under a body that touches them, or did, and those around it.
        let touched = lowest.into_iter().filter(|((i, k), underside)| {
            self.extent().contains(*i, *k) && underside - (1 << 32) <= self.top(*i, *k)
        });
        let around = touched
            .flat_map(|((i, k), _)| std::iter::once((i, k)).chain(AROUND.map(|(di, dk)| (i + di, k + dk))));
        let around = around.collect();
        self.wake_all(around)
    }

    /// Sets the ceilings over columns; tiles without any are not stored.
    fn set_roofs(&mut self, roofs: &[((i32, i32), i64)]) {
        self.graph = None;
        let (extent, count) = (self.extent(), self.setup.settings.side * self.setup.settings.side);
        let inside = roofs.iter().filter(|((i, k), _)| extent.contains(*i, *k));
        let mut places: Vec<_> = inside.map(|((i, k), roof)| (self.setup.place(*i, *k), *roof)).collect();
        places.sort_unstable();
        let stored = Arc::make_mut(&mut self.roofs);
        for tile in places.chunk_by(|a, b| a.0.0 == b.0.0) {
            let key = tile[0].0.0;
            let all = stored.entry(key).or_insert_with(|| vec![i64::MAX; count].into());
            let all = Arc::make_mut(all);
            for ((_, index), roof) in tile {
                all[*index] = *roof;
            }
            if all.iter().all(|roof| *roof == i64::MAX) {
                stored.remove(&key);
            }
        }
    }

    /// Height of what is above a column, in quanta.
    pub(crate) fn roof(&self, (i, k): (i32, i32)) -> i64 {
        let (key, index) = self.setup.place(i, k);
        self.roofs.get(&key).map_or(i64::MAX, |roofs| roofs[index])
    }
}
