//! Gases, sources and settings, and their checks.

use crate::error::check;
use crate::{Error, Vector};

/// A gas: how its blobs begin and change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gas {
    /// Diffusivity κ in m²/s: the variance along an axis grows by 2κ in a second.
    pub diffusion: f64,
    /// Rate of decay α in 1/s: the mass is m e^(-αt). A blob ends when a thousandth is left.
    pub decay: f64,
    /// Standard deviation σ of a new blob, in m.
    pub size: f64,
    /// Mass of a new blob, in kg.
    pub mass: f64,
    /// Speed relative to the air at which blobs sink, in m/s; negative ones rise. Bodies turn the wind aside, not this speed: what is
    /// in its way is for [`Walls`](crate::Walls).
    pub fall: f64,
}

/// The part of its mass that a blob has when it ends.
pub(crate) const FAINTEST: f64 = 1e-3;

impl Gas {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Gas { diffusion, decay, size, mass, fall } = *self;
        check("a diffusion (m²/s)", diffusion, diffusion >= 0.0, "0 or more")?;
        check("a decay (1/s)", decay, decay >= 0.0, "0 or more")?;
        check("a size of a blob (m)", size, size > 0.0, "more than 0")?;
        check("a mass of a blob (kg)", mass, mass > 0.0, "more than 0")?;
        check("a speed of fall (m/s)", fall, fall.abs() <= 1e3, "-1000 to 1000")
    }

    /// Time in s that a blob lasts.
    pub fn life(&self) -> f64 {
        if self.decay > 0.0 { -libm::log(FAINTEST) / self.decay } else { f64::INFINITY }
    }
}

/// Where blobs begin during a tick. Values that change do so evenly from the first to the second one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// Its identity: random numbers and counts of blobs belong to it.
    pub id: u64,
    /// The identity of the source whose place it takes, if there is one: the part of a blob that was due there is due here.
    pub predecessor: Option<u64>,
    /// The part of a blob that is due when it begins, from 0 to 1, without a predecessor.
    pub phase: f64,
    /// When it begins and ends, in s, within the tick; `None` is the whole tick.
    pub during: Option<[f64; 2]>,
    /// Its centre at these times, in m.
    pub from: Vector,
    /// See `from`.
    pub to: Vector,
    /// Blobs begin within these distances of the centre, uniformly, in m.
    pub radius: [f64; 2],
    /// Blobs in a second.
    pub rate: [f64; 2],
}

impl Source {
    /// A source that does not change.
    pub fn at(id: u64, centre: Vector, radius: f64, rate: f64) -> Source {
        Source {
            id,
            predecessor: None,
            phase: 0.0,
            during: None,
            from: centre,
            to: centre,
            radius: [radius; 2],
            rate: [rate; 2],
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        for value in self.from.iter().chain(self.to.iter()) {
            check("a coordinate of a source (m)", *value, true, "a finite number")?;
        }
        for radius in self.radius {
            check("a radius of a source (m)", radius, radius >= 0.0, "0 or more")?;
        }
        for rate in self.rate {
            check("a rate of a source (1/s)", rate, rate >= 0.0, "0 or more")?;
        }
        check("a phase of a source", self.phase, (0.0..=1.0).contains(&self.phase), "0 to 1")
    }

    /// The time after its beginning at which so many blobs have begun, if it lasts for a time (both in s): the root of a square equation
    /// without cancellation.
    pub(crate) fn time_of(&self, count: f64, lasts: f64) -> f64 {
        let [first, last] = self.rate;
        let growth = (last - first) / lasts;
        let root = libm::sqrt((first * first + 2.0 * growth * count).max(0.0));
        (2.0 * count / (first + root)).clamp(0.0, lasts)
    }
}

/// How a cloud is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Seconds from one tick to the next; rounded down to a power of 2. Steps of blobs have the length of a tick over 2^m.
    pub tick: f64,
    /// Largest error of a step of a blob, in parts of its standard deviation.
    pub tolerance: f64,
    /// Largest m. Where that does not suffice (at a surface on which the wind jumps) the step is taken as it is.
    pub deepest: u8,
    /// Whether all steps are a tick long, whatever their error. For measurements of order.
    pub fixed: bool,
    /// Standard deviation at which a blob is replaced by four with 1/√2 of it, in m; infinite: never. It should be that of the smallest eddies, and
    /// is at least twice the [size](Gas::size) of new blobs.
    pub split: f64,
    /// Blobs are not replaced by smaller ones if there would be more than so many then.
    pub most_split: usize,
    /// Largest number of blobs; more are an error.
    pub most: usize,
    /// Another one gives other random numbers.
    pub seed: u64,
    /// Number of threads. The result does not depend on it.
    pub threads: usize,
}

impl Default for Settings {
    /// Ticks of 1/64 s, a tolerance of a tenth of a blob, no splitting, ten million blobs, one thread.
    fn default() -> Settings {
        Settings {
            tick: 1.0 / 64.0,
            tolerance: 0.1,
            deepest: 10,
            fixed: false,
            split: f64::INFINITY,
            most_split: 10_000_000,
            seed: 0,
            most: 10_000_000,
            threads: 1,
        }
    }
}

/// Most blobs of any cloud: their numbers fit in memory.
const MOST: usize = 100_000_000;

impl Settings {
    pub(crate) fn checked(mut self, gas: &Gas) -> Result<Settings, Error> {
        let Settings { tick, tolerance, deepest, split, most, threads, .. } = self;
        check("a tick (s)", tick, (1e-9..=1.0).contains(&tick), "1e-9 to 1")?;
        check("a tolerance", tolerance, (1e-12..=1.0).contains(&tolerance), "1e-12 to 1")?;
        check("a largest level", f64::from(deepest), deepest <= 40, "at most 40")?;
        check("a largest number of blobs", most as f64, most <= MOST, "at most 1e8")?;
        check("a number of threads", threads as f64, (1..=1024).contains(&threads), "1 to 1024")?;
        if split != f64::INFINITY {
            check(
                "a size at which blobs split (m)",
                split,
                split >= 2.0 * gas.size,
                "twice the size of a new blob or more",
            )?;
        }
        if !self.fixed {
            // Powers of 2 have exact multiples.
            self.tick = libm::exp2(libm::floor(libm::log2(tick)));
        }
        Ok(self)
    }
}
