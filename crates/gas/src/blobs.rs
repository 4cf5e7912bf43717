//! Blobs: structure of arrays, births, splits and ends.

use crate::carry::Moving;
use crate::chance::Chance;
use crate::{Error, Gas, Settings, Vector};

/// A blob of gas at an instant: a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Its centre, in m.
    pub centre: Vector,
    /// Its variance σ² along each axis, in m².
    pub variance: f64,
    /// Its mass in kg.
    pub mass: f64,
}

/// A blob at its birth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Birth {
    pub(crate) centre: Vector,
    /// When the line of blobs that it belongs to began, in s. Its mass decays from then on.
    pub(crate) born: f64,
    /// When it had its variance, in s.
    pub(crate) since: f64,
    pub(crate) variance: f64,
    /// Its share of the mass of a new blob.
    pub(crate) share: f64,
    pub(crate) chance: Chance,
}

/// The blobs of a cloud, in the order of their births.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blobs {
    pub(crate) moving: Vec<Moving>,
    pub(crate) born: Vec<f64>,
    pub(crate) since: Vec<f64>,
    pub(crate) variances: Vec<f64>,
    shares: Vec<f64>,
    chances: Vec<Chance>,
}

impl Blobs {
    pub(crate) fn len(&self) -> usize {
        self.moving.len()
    }

    pub(crate) fn push(&mut self, birth: Birth) {
        let Birth { centre, born, since, variance, share, chance } = birth;
        self.moving.push(Moving::at(centre));
        self.born.push(born);
        self.since.push(since);
        self.variances.push(variance);
        self.shares.push(share);
        self.chances.push(chance);
    }

    /// The variance of a blob at a time.
    pub(crate) fn variance(&self, blob: usize, gas: &Gas, time: f64) -> f64 {
        self.variances[blob] + 2.0 * gas.diffusion * (time - self.since[blob])
    }

    pub(crate) fn get(&self, blob: usize, gas: &Gas, time: f64) -> Blob {
        let decayed = libm::exp(-gas.decay * (time - self.born[blob]));
        Blob {
            centre: self.moving[blob].centre,
            variance: self.variance(blob, gas, time),
            mass: gas.mass * self.shares[blob] * decayed,
        }
    }

    /// What tells blobs from others at any time, in their order.
    pub(crate) fn keys(&self) -> impl Iterator<Item = u64> {
        self.chances.iter().map(|chance| chance.key())
    }

    /// Removes blobs of which too little is left at a time.
    pub(crate) fn end(&mut self, gas: &Gas, time: f64) {
        let life = gas.life();
        self.keep(|born| time - born < life);
    }

    /// Removes blobs by the times at which their lines began.
    pub(crate) fn keep(&mut self, stays: impl Fn(f64) -> bool) {
        if self.born.iter().all(|born| stays(*born)) {
            return;
        }
        let keep: Vec<bool> = self.born.iter().map(|born| stays(*born)).collect();
        retain(&mut self.moving, &keep);
        retain(&mut self.born, &keep);
        retain(&mut self.since, &keep);
        retain(&mut self.variances, &keep);
        retain(&mut self.shares, &keep);
        retain(&mut self.chances, &keep);
    }

    /// Replaces blobs with a standard deviation of `size` (m) or more by four of half the variance, at the corners of a tetrahedron. Mass, centre
    /// and second moments of all together stay the same. The first takes the place of the blob, the others are the youngest.
    pub(crate) fn split(&mut self, gas: &Gas, time: f64, settings: &Settings) -> Result<(), Error> {
        let Settings { split: size, most, most_split, .. } = *settings;
        for blob in 0..self.len() {
            let variance = self.variance(blob, gas, time);
            if variance < size * size {
                continue;
            }
            if self.len() + 3 > most_split {
                return Ok(());
            }
            if self.len() + 3 > most {
                return Err(Error::Blobs { most, time });
            }
            let (Moving { centre, level, .. }, share) = (self.moving[blob], self.shares[blob] / 4.0);
            let (born, own) = (self.born[blob], self.chances[blob]);
            let [x, y, z] = own.axes();
            // Corners (±1, ±1, ±1) with an even number of signs: their mean is 0, the mean of their squares the identity.
            let half = (variance / 2.0).sqrt();
            let corners = [x + y + z, x - y - z, y - x - z, z - x - y];
            for (number, corner) in corners.into_iter().enumerate() {
                let chance = own.of(6 + number as u64);
                let variance = variance / 2.0;
                let birth =
                    Birth { centre: centre + corner * half, born, since: time, variance, share, chance };
                if number == 0 {
                    self.replace(blob, birth);
                } else {
                    self.push(birth);
                }
                let child = if number == 0 { blob } else { self.len() - 1 };
                self.moving[child].level = level;
            }
        }
        Ok(())
    }

    fn replace(&mut self, blob: usize, birth: Birth) {
        self.moving[blob] = Moving::at(birth.centre);
        self.since[blob] = birth.since;
        self.variances[blob] = birth.variance;
        self.shares[blob] = birth.share;
        self.chances[blob] = birth.chance;
    }
}

/// Removes the values whose place says so.
fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| keep.next().copied().unwrap_or(true));
}
