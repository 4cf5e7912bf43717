//! Cohesion: banks that stand up to a height, and fail along Culmann's plane above it.
//!
//! Li and Moshell (*Modeling Soil*, 1993) compare the strength of the soil along a plane through the toe of a slope with the weight above. For the worst plane,
//! at the angle (β + φ)/2, a bank of slope β fails above the height (4c/γ) sin β cos φ/(1 - cos(β - φ)) (Culmann 1866), which does not depend on the
//! distance of columns. What lies above the plane comes loose, and the law of slipping does the rest.

use std::collections::{BTreeMap, BTreeSet};

use crate::tile::{Key, QUANTA};
use crate::{Error, Ground, Soil};

/// Directions in which slopes are followed upward.
const DIRECTIONS: [(i32, i32); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
/// Longest slope that is followed, in columns.
const LONGEST: i32 = 256;

impl Soil {
    /// The largest height in m at which a bank of a slope of `angle` degrees stands; infinite where the friction suffices.
    pub fn standing_height(&self, angle: f64) -> f64 {
        let (beta, phi) = (angle.to_radians(), self.repose.to_radians());
        if beta <= phi {
            return f64::INFINITY;
        }
        4.0 * self.cohesion / self.weight * libm::sin(beta) * libm::cos(phi) / (1.0 - libm::cos(beta - phi))
    }
}

/// Marks the columns that bits of the rows of a tile stand for as strained.
pub(crate) fn note(strained: &mut BTreeMap<Key, Box<[u32]>>, key: Key, bits: &[u32]) {
    let rows = strained.entry(key).or_insert_with(|| vec![0; bits.len()].into_boxed_slice());
    for (row, bits) in rows.iter_mut().zip(bits) {
        *row |= bits;
    }
}

impl Ground {
    /// Loosens what lies above the planes along which banks fail, where the surface has changed since the last time.
    pub(crate) fn fail_banks(&mut self) -> Result<(), Error> {
        if !self.setup.settings.rule.bonds(self.soil()) {
            return Ok(());
        }
        let strained = std::mem::take(&mut self.strained);
        let mut toes = BTreeSet::new();
        for (key, rows) in &strained {
            for (row, bits) in rows.iter().enumerate() {
                for c in (0..self.setup.settings.side).filter(|c| bits >> c & 1 != 0) {
                    let (i, k) = self.setup.column(*key, row * self.setup.settings.side + c);
                    if !self.extent().contains(i, k) {
                        continue;
                    }
                    for direction in DIRECTIONS {
                        toes.insert((self.toe((i, k), direction), direction));
                    }
                }
            }
        }
        // All planes are those of the surface as it is, so their order does not matter.
        let mut cuts = BTreeMap::new();
        for (toe, direction) in toes {
            if let Some(plane) = self.worst_plane(toe, direction) {
                self.cut(toe, direction, plane, &mut cuts);
            }
        }
        for ((i, k), height) in cuts {
            self.loosen(i, k, height)?;
        }
        Ok(())
    }

    /// The foot of the slope that a column belongs to, in a direction that leads upward.
    fn toe(&self, (i, k): (i32, i32), (di, dk): (i32, i32)) -> (i32, i32) {
        let (mut foot, mut height) = ((i, k), self.top(i, k));
        for _ in 0..LONGEST {
            let next = (foot.0 - di, foot.1 - dk);
            if !self.extent().contains(next.0, next.1) || self.top(next.0, next.1) >= height {
                break;
            }
            (foot, height) = (next, self.top(next.0, next.1));
        }
        foot
    }

    /// The slope of the plane along which the bank above a toe fails, if it does: that of its least stable part.
    fn worst_plane(&self, toe: (i32, i32), (di, dk): (i32, i32)) -> Option<f64> {
        let (soil, cell) = (self.soil(), self.cell());
        let length = f64::from(di * di + dk * dk).sqrt() * cell;
        let (foot, mut before) = (self.top(toe.0, toe.1), self.top(toe.0, toe.1));
        let (mut worst, mut plane) = (1.0, None);
        for d in 1..=LONGEST {
            let (i, k) = (toe.0 + d * di, toe.1 + d * dk);
            if !self.extent().contains(i, k) || self.top(i, k) <= before {
                break;
            }
            before = self.top(i, k);
            let height = (before - foot) as f64 / QUANTA * cell;
            let angle = libm::atan2(height, f64::from(d) * length).to_degrees();
            let load = height / soil.standing_height(angle);
            if load > worst {
                worst = load;
                plane = Some(libm::tan(((angle + soil.repose) / 2.0).to_radians()));
            }
        }
        plane
    }

    /// Notes for each column above a plane how high it stays.
    fn cut(&self, toe: (i32, i32), (di, dk): (i32, i32), plane: f64, cuts: &mut BTreeMap<(i32, i32), i64>) {
        let length = f64::from(di * di + dk * dk).sqrt();
        let foot = self.top(toe.0, toe.1);
        for d in 1.. {
            let (i, k) = (toe.0 + d * di, toe.1 + d * dk);
            let height = foot.saturating_add((plane * f64::from(d) * length * QUANTA) as i64);
            if !self.extent().contains(i, k) || self.top(i, k) <= height {
                return;
            }
            let cut = cuts.entry((i, k)).or_insert(height);
            *cut = height.min(*cut);
        }
    }

    /// Loosens what is bonded above a height.
    pub(crate) fn loosen(&mut self, i: i32, k: i32, height: i64) -> Result<(), Error> {
        self.wake(i, k)?;
        let (key, index) = self.setup.place(i, k);
        let growth = 65_536 + i128::from(self.setup.swell);
        let tile = self.tile_mut(key)?;
        let part = (tile.base(index) - height).clamp(0, tile.bonded[index]);
        let volume = i128::from(part) * growth;
        tile.bonded[index] -= part;
        tile.loose[index] += (volume >> 16) as i64;
        self.book.swollen += volume & 0xffff;
        if part > 0 {
            self.graph = None;
        }
        Ok(())
    }
}
