//! Plants of other models that sway, each at its own place in the wind of the scene.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use dlsys_geometry::scene::Seedling;
use dlsys_geometry::turtle::{bends, lets_go};
use dlsys_model::{Model, Units};
use dlsys_sim::Settings;
use dlsys_surround::{ByModes, CLOCK, Classes, Error, Motion, Passive, Place, Weather};
use nalgebra::Matrix3;

use crate::gauge::{Choice, Gauge};

/// Most motions that are kept from one scene to the next.
const MOST_KEPT: usize = 100_000;
/// Strains of past ticks that a motion keeps, for scenes that are drawn a little late.
const KEPT: usize = 2000;
/// Seconds by which motions go on in turn: one tick. Their steps are parts of a tick by powers of 2, so they read the same instants of
/// the wind, and few enough that all of them are kept until the last plant has read them.
const TURN: f64 = CLOCK;

/// A model in the scene: where it stands, and in which wind.
#[derive(Clone)]
pub struct Around<'m> {
    pub place: Place,
    pub weather: Option<Arc<Weather<'m>>>,
}

impl<'m> Around<'m> {
    /// The place of a plant that stands in this model.
    fn of(&self, seedling: &Seedling, inner: &Model) -> Place {
        let outer = &self.place;
        let units = if outer.units == Units::default() { inner.scenery.units } else { outer.units };
        let turn = outer.turn * Matrix3::from_columns(&seedling.placement.axes);
        let at = outer.turn * seedling.placement.origin.coords * outer.units.length;
        Place {
            units,
            birth: outer.birth + seedling.birth * outer.units.time,
            origin: outer.origin + at,
            turn,
            ground: outer.ground,
        }
    }

    /// A plant as the model around the plants in it.
    pub fn within(&self, seedling: &Seedling, inner: &Model) -> Around<'m> {
        Around { place: self.of(seedling, inner), weather: self.weather.clone() }
    }
}

/// True if something in a model, or in the plants in it, is passive: stems that give way, or what is let go.
pub fn sways(model: &Model) -> bool {
    bends(model) || lets_go(model) || model.scenery.plants.iter().any(|plant| sways(&plant.model))
}

/// A plant at its place: its number, its seed, its birth and its placement.
type Key = (usize, u64, [u64; 13]);

/// How the plants of a scene that sway were followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwayReport {
    /// Plants that sway.
    pub plants: usize,
    /// Those that were solved.
    pub solved: usize,
    /// Those that moved by modes where they did not grow.
    pub by_modes: usize,
    /// Least and greatest number of modes of a root among them.
    pub modes: [usize; 2],
    /// Different bodies that they had.
    pub classes: usize,
    /// Largest error of these plants, in pixels: the one that a sample of their declaration has, at their places.
    pub error_pixels: f64,
}

/// The motions of the plants of a model.
#[derive(Default)]
pub struct Swaying<'m> {
    kept: Mutex<HashMap<Key, Kept<'m>>>,
    classes: Arc<Classes>,
}

/// A motion, and how it is followed: `None` if it is solved.
type Kept<'m> = (Arc<Motion<'m>>, Option<Choice>);

impl<'m> Swaying<'m> {
    /// How the plants that have been drawn were followed; `None` if none sways.
    pub fn report(&self) -> Option<SwayReport> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let mut report = SwayReport { plants: kept.len(), ..SwayReport::default() };
        for (_, choice) in kept.values() {
            let Some(choice) = choice else {
                report.solved += 1;
                continue;
            };
            let [least, most] = report.modes;
            let least = if report.by_modes == 0 { choice.count } else { least.min(choice.count) };
            report.modes = [least, most.max(choice.count)];
            report.by_modes += 1;
            report.error_pixels = report.error_pixels.max(choice.pixels);
        }
        report.classes = if report.by_modes > 0 { self.classes.count() } else { 0 };
        (report.plants > 0).then_some(report)
    }

    /// The motions of these plants, all advanced to the present of the scene, in s. Each comes with its model and its seed;
    /// `None` for a plant without stems that give way.
    ///
    /// # Errors
    /// The first failure in the order of the plants, with its index.
    pub fn of(
        &self,
        around: &Around<'m>,
        plants: &[(&Seedling, &'m Model, u64)],
        (settings, gauge): (Settings, Option<&Gauge<'m>>),
        now: f64,
    ) -> Result<Vec<Option<Arc<Motion<'m>>>>, (usize, Error)> {
        let mut motions = Vec::with_capacity(plants.len());
        for (i, &(seedling, model, seed)) in plants.iter().enumerate() {
            let place = around.of(seedling, model);
            let key = (seedling.plant, seed, bits(&place));
            let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((known, _)) = kept().get(&key) {
                motions.push(Some(known.clone()));
                continue;
            }
            let settings = Settings { seed, ..settings };
            let choice = gauge.and_then(|gauge| gauge.choose(seedling.plant, seedling.placement.origin));
            let by = |choice: Choice| ByModes { count: choice.count, classes: Arc::clone(&self.classes) };
            let default = Passive::of(settings.bending);
            let passive = Passive { kept: KEPT, marks: false, modes: choice.map(by), ..default };
            let new = Motion::new(model, settings, around.weather.clone(), place, passive);
            let new = new.map_err(|error| (i, error))?.map(Arc::new);
            if let Some(new) = &new {
                let mut kept = kept();
                if kept.len() >= MOST_KEPT {
                    kept.clear();
                }
                kept.insert(key, (new.clone(), choice));
            }
            motions.push(new);
        }
        let first = motions.iter().flatten().map(|motion| motion.reached()).fold(now, f64::min);
        let mut until = first;
        while until < now {
            until = (until + TURN).min(now);
            for (i, motion) in motions.iter().enumerate() {
                if let Some(motion) = motion {
                    motion.advance(until).map_err(|error| (i, error))?;
                }
            }
        }
        Ok(motions)
    }
}

fn bits(place: &Place) -> [u64; 13] {
    let mut numbers = [place.birth; 13];
    numbers[1..4].copy_from_slice(place.origin.coords.as_slice());
    numbers[4..].copy_from_slice(place.turn.as_slice());
    // Both zeros are one place.
    numbers.map(|x| (x + 0.0).to_bits())
}
