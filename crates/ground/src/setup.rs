//! What of a ground does not change: its description, the law with its steps, and columns before anything touches them.

use std::collections::BTreeMap;
use std::sync::Mutex;

use crate::error::check;
use crate::kernel::Law;
use crate::noise::variation;
use crate::tile::{Key, Tile};
use crate::{Description, Error, Settings};

/// Most columns of a ground whose relief is a function: it is evaluated at each.
const SURVEYED: u64 = 1 << 26;

/// What does not change.
#[derive(Debug)]
pub(crate) struct Setup {
    pub description: Description,
    pub settings: Settings,
    pub side: i32,
    /// The law with λδt/4Δ² of the sweeps of a tick.
    pub law: Law,
    /// Ratio of slopes at which resting material begins to slip.
    pub start: f64,
    /// Sweeps in a tick.
    pub sweeps: u32,
    /// Parts of 2^16 by which bonded material grows when it comes loose.
    pub swell: i64,
    /// Lowest and highest untouched surface, in quanta.
    pub range: [i64; 2],
    /// Tiles in which the untouched surface is steeper than material can stand.
    pub steep: Vec<Key>,
    /// Sizes of the squares of untouched tiles in a mesh, as far as there was one.
    pub squares: Mutex<BTreeMap<Key, i32>>,
}

impl Setup {
    /// Tile and index in it of a column.
    pub fn place(&self, i: i32, k: i32) -> (Key, usize) {
        // Sides are powers of two.
        let (shift, last) = (self.side.trailing_zeros(), self.side - 1);
        ((i >> shift, k >> shift), (((k & last) << shift) | (i & last)) as usize)
    }

    /// The column of an index in a tile.
    pub fn column(&self, (p, q): Key, index: usize) -> (i32, i32) {
        let (side, index) = (self.side, index as i32);
        (p * side + index % side, q * side + index / side)
    }

    /// Bed, bonded and loose thickness of a column before anything touches it, in quanta.
    pub fn untouched(&self, i: i32, k: i32) -> Result<[i64; 3], Error> {
        let Description { cell, soil, bed, depth, .. } = &self.description;
        let bed = bed.quanta("the bed of the ground", *cell, i, k)?;
        let depth = depth.quanta("the thickness of the ground", *cell, i, k)?.max(0);
        Ok(if self.settings.rule.bonds(soil) { [bed, depth, 0] } else { [bed, 0, depth] })
    }

    /// A tile that nothing has touched.
    pub fn tile(&self, key: Key, fallen: i64) -> Result<Tile, Error> {
        let count = self.settings.side * self.settings.side;
        let zeros = || vec![0; count].into_boxed_slice();
        let (mut bed, mut bonded, mut loose) = (zeros(), zeros(), zeros());
        let Description { extent, cell, soil, .. } = &self.description;
        for index in 0..count {
            let (i, k) = self.column(key, index);
            if extent.contains(i, k) {
                [bed[index], bonded[index], loose[index]] = self.untouched(i, k)?;
                loose[index] += fallen;
            }
        }
        let slope = (soil.rough > 0.0).then(|| {
            let at = |index| {
                let (i, k) = self.column(key, index);
                let (x, z) = (f64::from(i) * cell, f64::from(k) * cell);
                self.law.slope * (1.0 + soil.rough * variation(x, z))
            };
            (0..count).map(at).collect()
        });
        let awake = vec![0; self.settings.side].into_boxed_slice();
        Ok(Tile { bed, bonded, loose, packed: zeros(), slope, slid: None, awake, pressed: false, fallen })
    }

    /// Examines the untouched surface: how low and how high it is, and where it is too steep.
    pub fn survey(&mut self) -> Result<(), Error> {
        let Description { extent, bed, depth, .. } = &self.description;
        let ([i0, i1], [k0, k1]) = (extent.x, extent.z);
        let top = |i: i32, k: i32| self.untouched(i, k).map(|layers| layers.iter().sum::<i64>());
        let first = top(i0, k0)?;
        if bed.is_level() && depth.is_level() {
            self.range = [first; 2];
            return Ok(());
        }
        let columns = (i64::from(i1 - i0) + 1) * (i64::from(k1 - k0) + 1);
        let few = columns as u64 <= SURVEYED;
        check("a number of columns with a relief", columns as f64, few, "at most 2^26")?;
        // Cohesive banks may fail from the angle of repose on.
        let start = if self.settings.rule.bonds(&self.description.soil) { 1.0 } else { self.start };
        let most = (self.law.slope * start).powi(2);
        let mut steep = Vec::new();
        let [mut low, mut high] = [first; 2];
        let mut before: Vec<i64> = Vec::new();
        for k in k0..=k1 {
            let row = (i0..=i1).map(|i| top(i, k)).collect::<Result<Vec<_>, _>>()?;
            for height in &row {
                (low, high) = (low.min(*height), high.max(*height));
            }
            // A ground of one row or column has its mirror image beside it.
            let lower = if k == k0 { &row } else { &before };
            for c in 0..row.len() {
                let next = (c + 1).min(row.len() - 1);
                let e = |from: i64, to: i64| ((to - from) as f64).powi(2);
                let along = e(lower[c], lower[next]).max(e(row[c], row[next]));
                let across = e(lower[c], row[c]).max(e(lower[next], row[next]));
                if along + across > most {
                    let i = i0 + c as i32;
                    steep.extend([(i, k), (i + 1, k), (i, k - 1), (i + 1, k - 1)].map(|(i, k)| {
                        let (i, k) = extent.mirrored(i, k);
                        self.place(i, k).0
                    }));
                }
            }
            steep.dedup();
            before = row;
        }
        steep.sort_unstable();
        steep.dedup();
        (self.range, self.steep) = ([low, high], steep);
        Ok(())
    }
}
