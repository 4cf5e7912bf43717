//! Which plants are small enough in the picture to move by modes: by the distance of that motion from the solved one, measured on a sample.
//!
//! ```text
//! sample of each declaration `plant` ──solved, and by 2, 4, 6 modes──▶ greatest distance of any point in m
//! place of a plant + camera + size of the picture ──▶ pixels in a metre ──▶ fewest modes under the bound, or solved
//! ```
//!
//! The sample is taken from the scene at the end of the frames that the model declares, the camera is looked through over all of them, and
//! plants are solved where there is no camera. So the choice depends on the model and on the size of the picture; it does not depend on the
//! times that are drawn, on their order and on threads. Distances only grow while the sample is followed, so this ends as soon as every plant that
//! was asked for is known to be solved, and goes on for one that is smaller in the picture.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex, PoisonError};

use dlsys_geometry::scene::{Point, Scene, Seedling, Viewpoint};
use dlsys_geometry::turtle;
use dlsys_model::Model;
use dlsys_sim::{Settings, Simulation};
use dlsys_surround::{ByModes, CLOCK, Classes, Motion, Passive};
use dlsys_tree::ModuleString;

use crate::nursery::number_of;
use crate::swaying::{Around, sways};

/// Numbers of modes of each root that are tried.
const LADDER: [usize; 3] = [2, 4, 6];
/// Fewest plants of a declaration that are worth a measurement.
const FEWEST: usize = 24;
/// Plants that are measured of each declaration.
const SAMPLE: usize = 8;
/// Most ticks of a sample that are solved, and most in which it moves by modes.
const MOST_TICKS: [u64; 2] = [900, 120];
/// The part of the bound that the sample may have, because others may have more.
const PART: f64 = 0.5;
/// Instants of a moving camera.
const LOOKS: u32 = 64;

/// The size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Pixels across the smaller side, times the zoom.
    pub pixels: f64,
    /// The larger side in smaller ones.
    pub shape: f64,
    /// A camera that stands above the one that the model declares.
    pub viewpoint: Option<Viewpoint>,
    /// Largest error of a plant that moves by modes, in pixels.
    pub bound: f64,
}

/// How a plant moves by modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// Modes of each root.
    pub count: usize,
    /// The error that the sample has at the plant's place in the picture, in pixels.
    pub pixels: f64,
}

/// What is measured.
pub(crate) struct Gauge<'m> {
    detail: Detail,
    cameras: Vec<Viewpoint>,
    /// By the number of the declaration.
    kinds: Vec<Option<Mutex<Kind<'m>>>>,
}

/// A declaration `plant`, as far as its sample has been followed.
struct Kind<'m> {
    /// The sample: each plant solved, and by each number of modes. None when it has been followed to its end.
    runs: Vec<(Motion<'m>, Vec<Motion<'m>>)>,
    /// The first instant of the sample, and the last one of the frames, in s; the metres of a unit of the scene.
    span: [f64; 2],
    metre: f64,
    ticks: u64,
    /// Largest distance of any point of a sample from its root, in m.
    reach: f64,
    /// Largest distance between the solved motion and that by modes, for each number of them, in m.
    errors: [f64; LADDER.len()],
    /// No plant of it ever stands, or one cannot be followed.
    is_lost: bool,
}

impl<'m> Gauge<'m> {
    /// The plants of a scene; `None` if it has no camera, or no plants that are worth it.
    pub(crate) fn new(
        (model, settings): (&'m Model, Settings),
        blank: &Scene,
        around: &Around<'m>,
        detail: Detail,
        classes: &Arc<Classes>,
    ) -> Option<Gauge<'m>> {
        let cameras = cameras(model, detail)?;
        let end = model.frames.map_or(0.0, |frames| frames.to);
        let settings = Settings { log: false, ..settings };
        let mut string = ModuleString::default();
        let mut scene = blank.clone();
        Simulation::new(model, settings).ok()?.at(end, &mut string).ok()?;
        turtle::draw(model, &string, &mut scene).ok()?;
        let kinds = (0..model.scenery.plants.len()).map(|plant| {
            let all: Vec<&Seedling> = scene.seedlings.iter().filter(|s| s.plant == plant).collect();
            if all.len() < FEWEST || !sways(&model.scenery.plants[plant].model) {
                return None;
            }
            kind(model, settings, around, (&chosen(all), end), classes).map(Mutex::new)
        });
        let kinds: Vec<Option<Mutex<Kind<'m>>>> = kinds.collect();
        kinds.iter().any(Option::is_some).then_some(Gauge { detail, cameras, kinds })
    }

    /// How a plant of a declaration moves at a place in the scene; `None` if it is solved.
    pub(crate) fn choose(&self, plant: usize, at: Point) -> Option<Choice> {
        let mut kind = self.kinds.get(plant)?.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let choice = self.fewest(&kind, at).filter(|_| !kind.is_lost)?;
            if kind.runs.is_empty() {
                return Some(choice);
            }
            kind.go_on();
        }
    }

    /// The fewest modes with an error under the bound, by what is known so far.
    fn fewest(&self, kind: &Kind<'m>, at: Point) -> Option<Choice> {
        let (reach, metre) = (kind.reach / kind.metre, kind.metre);
        let scales = self.cameras.iter().map(|camera| scale(camera, at, reach));
        let scale = self.detail.pixels * scales.fold(0.0, f64::max);
        let of = |(&count, &error): (&usize, &f64)| Choice { count, pixels: error / metre * scale };
        LADDER.iter().zip(&kind.errors).map(of).find(|choice| choice.pixels <= PART * self.detail.bound)
    }
}

/// The cameras of all frames that a model declares.
fn cameras(model: &Model, detail: Detail) -> Option<Vec<Viewpoint>> {
    if let Some(viewpoint) = detail.viewpoint {
        return Some(vec![viewpoint]);
    }
    let (from, to) = model.frames.map_or((0.0, 0.0), |frames| (frames.from, frames.to));
    let time = |k: u32| from + (to - from) * f64::from(k) / f64::from(LOOKS);
    let mut cameras: Vec<Viewpoint> =
        (0..=LOOKS).map(|k| turtle::surroundings(model, time(k)).ok()?.camera).collect::<Option<_>>()?;
    cameras.dedup();
    Some(cameras)
}

/// Parts of the picture's smaller side in a unit of length, at the point of a plant that is nearest to the camera. Infinite where that is beside or
/// behind the camera, 0 where the whole plant is behind it.
fn scale(camera: &Viewpoint, at: Point, reach: f64) -> f64 {
    let forward = (camera.aim - camera.eye).normalize();
    let depth = (at - camera.eye).dot(&forward);
    if depth + reach <= 0.0 {
        return 0.0;
    }
    if depth - reach <= 0.0 {
        return f64::INFINITY;
    }
    0.5 / ((camera.angle / 2.0).to_radians().tan() * (depth - reach))
}

/// A sample: chosen by seed and place, whatever the order.
fn chosen(mut all: Vec<&Seedling>) -> Vec<&Seedling> {
    let key = |seedling: &Seedling| {
        let mut hasher = DefaultHasher::new();
        let bits = |x: f64| (x + 0.0).to_bits();
        seedling.seed.map(bits).hash(&mut hasher);
        bits(seedling.birth).hash(&mut hasher);
        seedling.placement.origin.coords.iter().for_each(|x| bits(*x).hash(&mut hasher));
        hasher.finish()
    };
    all.sort_by_key(|seedling| key(seedling));
    all.truncate(SAMPLE);
    all
}

/// A sample of one declaration from t = 0 to the end, before it is followed; `None` if there is none.
fn kind<'m>(
    model: &'m Model,
    settings: Settings,
    around: &Around<'m>,
    (sample, end): (&[&Seedling], f64),
    classes: &Arc<Classes>,
) -> Option<Kind<'m>> {
    let first = sample.first()?;
    let place = around.within(first, &model.scenery.plants[first.plant].model).place;
    let (metre, second) = (place.units.length, around.place.units.time);
    let motion = |seedling: &Seedling, modes: Option<ByModes>| {
        let inner = &model.scenery.plants[seedling.plant].model;
        let settings = Settings { seed: seedling.seed.map_or(settings.seed, number_of), ..settings };
        let place = around.within(seedling, inner).place;
        let passive = Passive { kept: 0, marks: false, modes, ..Passive::of(settings.bending) };
        Motion::new(inner, settings, around.weather.clone(), place, passive).ok()?
    };
    let mut runs = Vec::new();
    for seedling in sample {
        let by = |count| motion(seedling, Some(ByModes { count, classes: Arc::clone(classes) }));
        let all: Option<Vec<Motion<'_>>> = LADDER.into_iter().map(by).collect();
        runs.push((motion(seedling, None)?, all?));
    }
    let first = runs.iter().map(|(solved, _)| solved.reached()).fold(f64::INFINITY, f64::min);
    let last = if end > 0.0 { around.place.birth + end * second } else { f64::INFINITY };
    let errors = [0.0; LADDER.len()];
    Some(Kind { runs, span: [first, last], metre, ticks: 0, reach: 0.0, errors, is_lost: false })
}

impl Kind<'_> {
    /// Follows the sample for a tick, or ends it.
    fn go_on(&mut self) {
        let by_modes = |motions: &[Motion<'_>]| motions[0].effort().by_modes;
        let [first, last] = self.span;
        let now = first + ((self.ticks + 1) as f64 + 0.5) * CLOCK;
        let is_over = self.ticks >= MOST_TICKS[0]
            || now > last
            || self.runs.iter().all(|(_, motions)| by_modes(motions) >= MOST_TICKS[1]);
        if is_over {
            self.is_lost = self.runs.iter().all(|(_, motions)| by_modes(motions) == 0);
            self.runs.clear();
            return;
        }
        self.ticks += 1;
        // All in turn, so that they share the instants of the wind.
        for (solved, motions) in &self.runs {
            if solved.advance(now).is_err() {
                self.is_lost = true;
                return;
            }
            let points = solved.points();
            self.reach = points.iter().map(|point| point.norm()).fold(self.reach, f64::max);
            for (motion, error) in motions.iter().zip(&mut self.errors) {
                if motion.advance(now).is_err() {
                    *error = f64::INFINITY;
                    continue;
                }
                let apart = motion.points().into_iter().zip(&points).map(|(a, b)| (a - b).norm());
                // What is no number is no motion.
                let number = |one: f64| if one.is_nan() { f64::INFINITY } else { one };
                *error = apart.map(number).fold(*error, f64::max);
            }
        }
    }
}
