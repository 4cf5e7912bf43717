//! Light through blobs: transmittance, and what is scattered and emitted towards the origin of a ray.

use std::sync::{Mutex, PoisonError};

use crate::error::check;
use crate::ray::HalfErf;
use crate::tree::Tree;
use crate::{Blob, Error, Light, Look, Ray, Span, Vector};

/// The blobs of gases in light, at an instant.
///
/// Transmittance is exact but for the cut of blobs at their reach. Light is that of the paper's equations 22 to 27 with single scattering: each blob is lit as
/// its centre is, behind the gas between it and the lights, and a ray adds up intervals front to back.
#[derive(Clone, Debug)]
pub struct Smoke {
    looks: Vec<Look>,
    /// Sorted by the tree.
    puffs: Vec<Puff>,
    /// What each blob scatters and emits, in the order of the blobs.
    colours: Vec<[f64; 3]>,
    tree: Tree,
    reach: f64,
    intervals: usize,
}

/// A blob with the number of its look. Its mass is times the extinction, an area in m².
#[derive(Clone, Copy, Debug)]
pub(crate) struct Puff {
    pub(crate) blob: Blob,
    look: u32,
    /// Its place among the blobs as they were given.
    number: u32,
}

/// Distance in standard deviations at which a blob ends: 1.5e-8 of its density at the centre.
const REACH: f64 = 6.0;
/// Intervals of a ray.
const INTERVALS: usize = 48;
/// Blobs that a thread lights at a time.
const CHUNK: usize = 256;

/// A blob that a ray passes.
struct Passed {
    blob: usize,
    along: f64,
    /// Optical depth of the whole line.
    through: f64,
}

impl Smoke {
    /// Blobs without light: for transmittance.
    ///
    /// # Errors
    ///
    /// A look out of range.
    pub fn new(look: Look, blobs: Vec<Blob>) -> Result<Smoke, Error> {
        Smoke::cut(look, blobs, REACH)
    }

    /// The same with blobs that end at a distance of their centres, in standard deviations: 3 has a hundredth of the density there, which a picture does not
    /// show, and takes a fourth of the time.
    ///
    /// # Errors
    ///
    /// A look or a distance out of range.
    pub fn cut(look: Look, blobs: Vec<Blob>, reach: f64) -> Result<Smoke, Error> {
        Smoke::of(vec![(look, blobs)], reach)
    }

    /// Several gases in one place.
    ///
    /// # Errors
    ///
    /// As of [`cut`](Smoke::cut).
    pub fn of(gases: Vec<(Look, Vec<Blob>)>, reach: f64) -> Result<Smoke, Error> {
        check("a reach of blobs", reach, (1.0..=40.0).contains(&reach), "1 to 40")?;
        let (mut looks, mut puffs) = (Vec::new(), Vec::new());
        for (number, (look, blobs)) in gases.into_iter().enumerate() {
            look.check()?;
            looks.push(look);
            let first = puffs.len();
            let puff = |(place, blob): (usize, Blob)| Puff {
                blob: Blob { mass: blob.mass * look.extinction, ..blob },
                look: number as u32,
                number: (first + place) as u32,
            };
            puffs.extend(blobs.into_iter().enumerate().map(puff));
        }
        let tree = Tree::new(&mut puffs, reach);
        Ok(Smoke { looks, puffs, colours: Vec::new(), tree, reach, intervals: INTERVALS })
    }

    /// The same with another number of intervals along a ray (48). The error of light is of order 2 in their length; transmittance has none.
    pub fn with_intervals(self, intervals: usize) -> Smoke {
        Smoke { intervals: intervals.clamp(1, 100_000), ..self }
    }

    /// Lights the blobs. The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// A light without meaning.
    pub fn lit(self, lights: &[Light], threads: usize) -> Result<Smoke, Error> {
        self.lit_among(lights, &|_| 1.0, threads)
    }

    /// Lights the blobs where something else may hide distant lights: they shine on a place with this part of their light.
    ///
    /// # Errors
    ///
    /// A light without meaning.
    pub fn lit_among(
        mut self,
        lights: &[Light],
        visible: &(dyn Fn(&Vector) -> f64 + Sync),
        threads: usize,
    ) -> Result<Smoke, Error> {
        lights.iter().try_for_each(Light::check)?;
        let mut colours = vec![[0.0; 3]; self.puffs.len()];
        let chunks = Mutex::new(colours.chunks_mut(CHUNK).zip(self.puffs.chunks(CHUNK)));
        let work = || loop {
            let next = chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((colours, puffs)) = next else { return };
            for (colour, puff) in colours.iter_mut().zip(puffs) {
                *colour = self.source(puff, lights, visible);
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads.clamp(1, 1024) {
                scope.spawn(work);
            }
            work();
        });
        self.colours = colours;
        Ok(self)
    }

    /// Equation 24: what the gas in the middle of a blob scatters and emits.
    fn source(&self, puff: &Puff, lights: &[Light], visible: &(dyn Fn(&Vector) -> f64 + Sync)) -> [f64; 3] {
        let mut light = [0.0; 3];
        let point = puff.blob.centre;
        for source in lights {
            let (share, colour) = match source {
                Light::Ambient(colour) => (1.0, colour),
                Light::Distant { towards, colour } => {
                    let ray = Ray { origin: point, direction: *towards };
                    (self.transmittance(&ray, Span::ALL) * visible(&point), colour)
                }
            };
            light = std::array::from_fn(|k| light[k] + share * colour[k]);
        }
        let Look { albedo, glow, .. } = self.looks[puff.look as usize];
        std::array::from_fn(|k| albedo[k] * light[k] + (1.0 - albedo[k]) * glow[k])
    }

    /// All blobs, each with the area that it hides, in m², as its mass.
    pub fn blobs(&self) -> impl Iterator<Item = &Blob> {
        self.puffs.iter().map(|puff| &puff.blob)
    }

    /// What each blob scatters and emits where it lets no light through (equation 24), gas by gas in the order in which they were given; black
    /// if they have not been [lit](Smoke::lit).
    pub fn colours(&self) -> Vec<[f64; 3]> {
        let mut colours = vec![[0.0; 3]; self.puffs.len()];
        for (puff, colour) in self.puffs.iter().zip(&self.colours) {
            colours[puff.number as usize] = *colour;
        }
        colours
    }

    /// The blobs that a ray passes within a span.
    fn passed(&self, ray: &Ray, span: Span, mut found: impl FnMut(Passed)) {
        self.tree.along(ray, span, |range| {
            for blob in range {
                let Blob { centre, variance, .. } = self.puffs[blob].blob;
                let (along, square) = ray.nearest(&centre);
                let room = self.reach * self.reach * variance - square;
                if room < 0.0 {
                    continue;
                }
                let half = libm::sqrt(room);
                if along + half > span.from && along - half < span.to {
                    found(Passed { blob, along, through: self.puffs[blob].blob.through(square) });
                }
            }
        });
    }

    /// ∫κ_t ρ ds along a span of a ray: the optical depth.
    pub fn depth(&self, ray: &Ray, span: Span) -> f64 {
        let (mut depth, table) = (0.0, HalfErf::table());
        self.passed(ray, span, |Passed { blob, along, through }| {
            let unit = 1.0 / libm::sqrt(2.0 * self.puffs[blob].blob.variance);
            depth += through * table.between((span.from - along) * unit, (span.to - along) * unit);
        });
        depth
    }

    /// The part of light that passes a span of a ray: e^(-depth).
    pub fn transmittance(&self, ray: &Ray, span: Span) -> f64 {
        libm::exp(-self.depth(ray, span))
    }

    /// The light that comes from a span of a ray to its near end, with the transmittance of the span. What is behind the gas is to be added,
    /// times the transmittance. Blobs that have not been [lit](Smoke::lit) are black.
    pub fn light(&self, ray: &Ray, span: Span) -> ([f64; 3], f64) {
        let mut passed = Vec::new();
        self.passed(ray, span, |blob| passed.push(blob));
        let half = |found: &Passed| self.reach * libm::sqrt(self.puffs[found.blob].blob.variance);
        let from = passed.iter().map(|found| found.along - half(found)).fold(f64::INFINITY, f64::min);
        let to = passed.iter().map(|found| found.along + half(found)).fold(f64::NEG_INFINITY, f64::max);
        let (from, to) = (from.max(span.from), to.min(span.to));
        if from >= to {
            return ([0.0; 3], 1.0);
        }
        let width = (to - from) / self.intervals as f64;
        // Optical depth of each interval, and what it scatters and emits.
        let mut intervals = vec![[0.0; 4]; self.intervals];
        for found in &passed {
            self.share_out(found, (from, width), half(found), &mut intervals);
        }
        let (mut colour, mut left) = ([0.0; 3], 1.0);
        for [red, green, blue, depth] in intervals {
            if depth > 0.0 {
                let passing = libm::exp(-depth);
                let share = left * (1.0 - passing) / depth;
                for (sum, value) in colour.iter_mut().zip([red, green, blue]) {
                    *sum += share * value;
                }
                left *= passing;
            }
        }
        (colour, left)
    }

    /// Adds the mass of a blob to the intervals that it reaches into.
    fn share_out(&self, found: &Passed, (from, width): (f64, f64), half: f64, intervals: &mut [[f64; 4]]) {
        let unit = 1.0 / libm::sqrt(2.0 * self.puffs[found.blob].blob.variance);
        let [red, green, blue] = self.colours.get(found.blob).copied().unwrap_or_default();
        let last = intervals.len() - 1;
        // Saturates below 0.
        let index = |distance: f64| (((distance - from) / width) as usize).min(last);
        let (first, end) = (index(found.along - half), index(found.along + half));
        let table = HalfErf::table();
        let at = |index: usize| table.at((from + width * index as f64 - found.along) * unit);
        let mut before = at(first);
        for (place, interval) in intervals.iter_mut().enumerate().take(end + 1).skip(first) {
            let after = at(place + 1);
            let depth = found.through * (after - before);
            for (sum, value) in interval.iter_mut().zip([red, green, blue, 1.0]) {
                *sum += depth * value;
            }
            before = after;
        }
    }
}
