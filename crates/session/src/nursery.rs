//! Plants of other models in a scene: the declaration `plant @NAME from "FILE"`.
//!
//! The turtle leaves a [`Seedling`] for each plant; a [`Nursery`] runs the models and puts in their place what they draw at their
//! ages. Plants of one model and one seed are one simulation, looked at at all their ages; without random numbers the seed does not
//! matter, so a thousand plants of such a model are one simulation.
//!
//! Results do not depend on what was drawn before: a simulation that is kept for the next scene goes on to the same bits as one that
//! begins anew.

use std::collections::HashMap;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::bed::{Bed, Grown};
use crate::gauge::{Detail, Gauge};
use crate::looks::Sight;
use crate::swaying::{Around, SwayReport, Swaying, sways};
use dlsys_diagnostic::Diagnostic;
use dlsys_geometry::scene::{Bounds, Color, MaterialId, Plant, Scene, Seedling, Width};
use dlsys_geometry::turtle::{self, Strains};
use dlsys_model::{self as model, Model};
use dlsys_sim::{self as sim, Settings, Simulation, brief};
use dlsys_surround::{
    self as surround, Classes, Earth, Gases, Motion, Passive as Following, Place, Quilt, Sheets, Terrain,
    Weather,
};
use dlsys_tree::ModuleString;

/// Most simulations that are kept from one scene to the next.
const MOST_KEPT: usize = 256;
/// Most elements (segments, polygons, surfaces, patches) that the plants of one scene hold, those that look the same counted once.
pub(crate) const MOST_ELEMENTS: usize = 50_000_000;
/// Most plants in one scene, plants in plants included.
const MOST_PLANTS: usize = 10_000_000;

/// Why a string cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrawError {
    /// A module of the string cannot be drawn.
    #[error(transparent)]
    Turtle(#[from] turtle::Error),
    /// A plant of another model cannot be drawn.
    #[error("{}", .0.message)]
    Plant(Box<Diagnostic>),
    /// What is passive in the scene cannot be followed: stems in the wind.
    #[error(transparent)]
    Surround(#[from] surround::Error),
}

impl DrawError {
    /// The error as a message that quotes the model.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            DrawError::Turtle(error) => error.diagnostic(),
            DrawError::Plant(diagnostic) => (**diagnostic).clone(),
            DrawError::Surround(error) => error.diagnostic(),
        }
    }
}

/// A simulation that is kept, and the time that it has reached.
#[derive(Clone)]
pub(crate) struct Kept<'m> {
    pub(crate) simulation: Simulation<'m>,
    pub(crate) time: f64,
    /// The string at that time.
    pub(crate) string: ModuleString,
}

impl Kept<'_> {
    /// Goes on to an age.
    pub(crate) fn reach(&mut self, plant: &model::Plant, age: f64) -> Result<(), DrawError> {
        self.simulation.at(age, &mut self.string).map_err(|error| fault(plant, age, &error))?;
        self.time = age;
        Ok(())
    }
}

/// Simulations by plant and seed.
pub(crate) type Growing<'m> = HashMap<(usize, u64), Kept<'m>>;

/// Draws strings of a model with the plants of other models that they contain.
pub struct Nursery<'m> {
    pub(crate) model: &'m Model,
    settings: Settings,
    /// An empty scene of the model, with materials that suit the scene that it stands in.
    blank: Scene,
    /// The nurseries of the plants' models, for plants in plants.
    pub(crate) below: Vec<Nursery<'m>>,
    /// One set of simulations for each thread that draws.
    pool: Mutex<Vec<Growing<'m>>>,
    /// The wind, and the stems of the model in it, once a string has been drawn.
    passive: OnceLock<Result<Passive<'m>, surround::Error>>,
    /// The plants in the wind.
    swaying: Swaying<'m>,
    /// The size of the picture, if there is one, and what it means for the plants in the wind.
    detail: Option<Detail>,
    gauge: OnceLock<Option<Gauge<'m>>>,
    /// Threads for the plants of one scene.
    threads: usize,
    has_gases: bool,
    has_ground: bool,
    /// Ground that gives way is drawn by [`Nursery::draw_quilt`] only.
    is_in_pieces: bool,
    /// The material of ground that gives way.
    earth: Earth,
}

/// What is passive in a scene.
struct Passive<'m> {
    around: Around<'m>,
    motion: Option<Motion<'m>>,
    gases: Option<Gases<'m>>,
    sheets: Option<Sheets<'m>>,
    terrain: Option<Terrain<'m>>,
}

impl<'m> Nursery<'m> {
    /// For a model and its runs with these settings.
    pub fn new(model: &'m Model, settings: Settings) -> Nursery<'m> {
        let settings = Settings { log: false, ..settings };
        let mut nursery = Nursery::with_blanks(model, settings, &mut turtle::blanks(model).into_iter());
        if let Some(bed) = &model.scenery.bed {
            let color = Color::hex(model.scenery.soils[bed.soil].color);
            let palette = &mut nursery.blank.palette;
            nursery.earth = match &bed.texture {
                Some(texture) => {
                    let surface = palette.add_textured("ground", texture);
                    Earth { surface, loose: palette.add("ground", color) }
                }
                None => palette.add("ground", color).into(),
            };
        }
        nursery
    }

    /// The blank scenes are those of the model, of its plants, and of theirs, in the order of [`turtle::blanks`].
    fn with_blanks(
        model: &'m Model,
        settings: Settings,
        blanks: &mut dyn Iterator<Item = Scene>,
    ) -> Nursery<'m> {
        let blank = blanks.next().unwrap_or_default();
        let plants = model.scenery.plants.iter();
        let below = plants.map(|plant| Nursery::with_blanks(&plant.model, settings, blanks)).collect();
        Nursery {
            model,
            settings,
            blank,
            below,
            pool: Mutex::default(),
            passive: OnceLock::new(),
            swaying: Swaying::default(),
            detail: None,
            gauge: OnceLock::new(),
            threads: 1,
            has_gases: true,
            has_ground: true,
            is_in_pieces: false,
            earth: MaterialId::LEAF.into(),
        }
    }

    /// With so many threads for the plants of one scene, at least 1. Results do not depend on it.
    pub fn with_threads(self, threads: usize) -> Nursery<'m> {
        Nursery { threads: threads.max(1), ..self }
    }

    /// Without blobs of gases, which then cost nothing.
    pub fn without_gases(self) -> Nursery<'m> {
        Nursery { has_gases: false, ..self }
    }

    /// Without the surface of ground that gives way, which then costs nothing.
    pub fn without_ground(self) -> Nursery<'m> {
        Nursery { has_ground: false, ..self }
    }

    /// Ground that gives way is left out of drawings; [`Nursery::draw_quilt`] draws it in pieces.
    pub fn with_ground_in_pieces(self) -> Nursery<'m> {
        Nursery { is_in_pieces: true, ..self }
    }

    /// Ground that gives way as pieces that serve for all times up to one; `None` without such ground.
    ///
    /// # Errors
    /// As of [`Nursery::draw`].
    pub fn quilt(&self, until: f64) -> Result<Option<Quilt>, DrawError> {
        let Passive { motion, terrain, .. } = self.passive()?;
        let quilt = terrain.as_ref().map(|terrain| terrain.quilt(until, self.earth, motion.as_ref()));
        Ok(quilt.transpose()?)
    }

    /// Draws the pieces at a time, and what lies on bodies.
    ///
    /// # Errors
    /// As of [`Nursery::draw`].
    pub fn draw_quilt(&self, time: f64, quilt: &Quilt, scene: &mut Scene) -> Result<(), DrawError> {
        let Passive { motion, terrain, .. } = self.passive()?;
        match terrain {
            Some(terrain) => Ok(terrain.draw_quilt(time, quilt, motion.as_ref(), scene)?),
            None => Ok(()),
        }
    }

    /// The times after one and up to another at which ground that gives way changes.
    pub fn ticks(&self, from: f64, to: f64) -> Vec<f64> {
        let terrain = self.passive().ok().and_then(|passive| passive.terrain.as_ref());
        terrain.map_or_else(Vec::new, |terrain| terrain.ticks(from, to).collect())
    }

    /// For pictures of this size, in which plants that are small move by the modes of their class, with an error below its bound, and plants that
    /// differ by less than that share a drawing.
    /// Without a size, all plants are solved; so are those in plants.
    pub fn for_picture(self, detail: Option<Detail>) -> Nursery<'m> {
        Nursery { detail, gauge: OnceLock::new(), ..self }
    }

    /// How the plants that have been drawn so far were followed in the wind; `None` if none of them sways.
    pub fn sway_report(&self) -> Option<SwayReport> {
        self.swaying.report()
    }

    /// The times at which what the model has let go was jolted by the ground, up to the latest one drawn. Between them, motion is smooth.
    pub fn jolts(&self) -> Vec<f64> {
        self.passive().ok().and_then(|passive| passive.motion.as_ref()).map_or_else(Vec::new, Motion::jolts)
    }

    /// An empty scene with the materials of the model and of its plants, to be drawn into.
    pub fn blank(&self) -> Scene {
        self.blank.clone()
    }

    /// Draws a string of the model, adding to the scene, with the plants of other models. May be called from several threads.
    ///
    /// # Errors
    /// A module that cannot be drawn, or a plant whose run or drawing fails.
    pub fn draw(&self, string: &ModuleString, scene: &mut Scene) -> Result<(), DrawError> {
        let Passive { around, motion, gases, sheets, terrain } = self.passive()?;
        // They read the motion of stems at ticks before.
        let gases = match gases {
            Some(gases) => gases.at(string.time, motion.as_ref())?,
            None => Vec::new(),
        };
        let ground = match terrain.as_ref().filter(|_| !self.is_in_pieces) {
            Some(terrain) => Some(terrain.at(string.time, self.earth, motion.as_ref())?),
            None => None,
        };
        let bent = match motion {
            Some(motion) => Some(motion.at(string)?),
            None => None,
        };
        let strains = bent.as_ref().map(|bent| bent as &dyn Strains);
        self.draw_with((self.settings.seed, around), string, strains, scene)?;
        scene.gases = gases;
        if let Some(sheets) = sheets {
            sheets.draw(string.time, scene)?;
        }
        if let Some(ground) = ground {
            scene.add_terrain(ground);
        }
        Ok(())
    }

    /// What is passive in the scene.
    fn passive(&self) -> Result<&Passive<'m>, surround::Error> {
        let start = || {
            let model = self.model;
            let has_gas = self.has_gases && turtle::lets_out(model);
            let weather = if sways(model) || has_gas { Weather::of(model, self.settings)? } else { None };
            let around = Around { place: Place::of_scene(&model.scenery), weather: weather.clone() };
            let following = Following::of(self.settings.bending);
            let motion = Motion::new(model, self.settings, weather.clone(), around.place, following)?;
            let gases = match has_gas {
                true => Gases::new(model, self.settings, weather, self.threads)?,
                false => None,
            };
            let sheets = Sheets::new(model, self.settings)?;
            let terrain = match self.has_ground {
                true => Terrain::new(model, self.settings, self.threads)?,
                false => None,
            };
            Ok(Passive { around, motion, gases, sheets, terrain })
        };
        self.passive.get_or_init(start).as_ref().map_err(Clone::clone)
    }

    pub(crate) fn draw_with(
        &self,
        (seed, around): (u64, &Around<'m>),
        string: &ModuleString,
        strains: Option<&dyn Strains>,
        scene: &mut Scene,
    ) -> Result<(), DrawError> {
        self.dress(scene);
        match strains {
            Some(strains) => turtle::draw_bent(self.model, string, strains, scene)?,
            None => turtle::draw(self.model, string, scene)?,
        }
        if scene.seedlings.is_empty() {
            return Ok(());
        }
        let pool = || self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let mut growing = pool().pop().unwrap_or_default();
        let grown = self.grow((seed, around, string.time), scene, &mut growing);
        pool().push(growing);
        grown
    }

    /// Gives a scene the materials of the plants, if it has those of the model only.
    fn dress(&self, scene: &mut Scene) {
        if scene.palette.materials().len() < self.blank.palette.materials().len()
            || scene.contours.len() < self.blank.contours.len()
            || scene.prepared_for.is_none()
        {
            let Scene { palette, shapes, prepared_for, contours, first_contour, .. } = self.blank.clone();
            (scene.palette, scene.shapes, scene.prepared_for) = (palette, shapes, prepared_for);
            (scene.contours, scene.first_contour) = (contours, first_contour);
        }
    }

    /// Puts plants in the place of seedlings.
    fn grow(
        &self,
        (seed, around, time): (u64, &Around<'m>, f64),
        scene: &mut Scene,
        growing: &mut Growing<'m>,
    ) -> Result<(), DrawError> {
        let seedlings = std::mem::take(&mut scene.seedlings);
        let plants = &self.model.scenery.plants;
        if scene.plants.len() + seedlings.len() > MOST_PLANTS {
            return Err(too_many(&plants[seedlings[0].plant], format!("more than {MOST_PLANTS} plants")));
        }
        let is_scaled = |seedling: &&Seedling| {
            seedling.placement.largest() != 1.0 && sways(&plants[seedling.plant].model)
        };
        if let Some(seedling) = seedlings.iter().find(is_scaled) {
            return Err(of_own_size(&plants[seedling.plant]));
        }
        let key = |seedling: &Seedling| {
            let own = seedling.seed.map_or(seed, number_of);
            (seedling.plant, if plants[seedling.plant].is_random { own } else { 0 })
        };
        let mut order: Vec<usize> = (0..seedlings.len()).collect();
        order.sort_by(|a, b| {
            let (a, b) = (&seedlings[*a], &seedlings[*b]);
            key(a).cmp(&key(b)).then(a.age.total_cmp(&b.age))
        });
        let motions = self.motions((seed, around, time), &seedlings)?;
        // A first pass knows no accuracy.
        let is_survey = scene.accuracy == 0.0;
        let declared = scene.surroundings.camera;
        let sight = self.detail.and_then(|detail| Sight::new(detail, declared, is_survey));
        scene.lacked_accuracy |= is_survey && sight.is_some();
        let elements = AtomicUsize::new(0);
        let bed = Bed {
            nursery: self,
            around,
            seedlings: &seedlings,
            motions: motions.as_deref(),
            sight,
            accuracy: scene.accuracy,
            elements: &elements,
        };
        let mut jobs = Vec::new();
        for group in order.chunk_by(|a, b| key(&seedlings[*a]) == key(&seedlings[*b])) {
            bed.divide(key(&seedlings[group[0]]), group, growing, &mut jobs)?;
        }
        let mut drawn: Vec<Option<Plant>> = vec![None; seedlings.len()];
        for done in dlsys_threads::in_order(self.threads, jobs, |job| bed.grow(job)) {
            let Grown { plants, kept, warnings, lacked_accuracy } = done?;
            for (i, plant) in plants {
                drawn[i] = Some(plant);
            }
            for (span, warning) in warnings {
                if !scene.warnings.iter().any(|known| known.labels.first().is_some_and(|l| l.0 == span)) {
                    scene.warnings.push(warning);
                }
            }
            scene.lacked_accuracy |= lacked_accuracy;
            if let Some((key, kept)) = kept.filter(|_| growing.len() < MOST_KEPT) {
                growing.insert(key, kept);
            }
        }
        scene.plants.extend(drawn.into_iter().flatten());
        Ok(())
    }

    pub(crate) fn start(&self, plant: &'m model::Plant, seed: u64) -> Result<Simulation<'m>, DrawError> {
        let settings = Settings { seed, ..self.settings };
        let reads_wind = plant.model.scenery.flow_reader.is_some();
        if plant.model.reads_inputs() || reads_wind {
            // Each would grow in another way, at its own place.
            let (what, why) = match plant.model.reads_strain() {
                _ if reads_wind => {
                    ("the wind", "the wind of a scene is not yet known to the rules of its plants")
                }
                false if plant.model.reads_ground() => (
                    "the height of soil",
                    "the ground of a scene is not yet known to the rules of its plants",
                ),
                true => ("`strain`", "a plant in another model bends, but its rules cannot read that yet"),
                false => {
                    ("the force of sheets", "sheets of the model around a plant do not push what it draws")
                }
            };
            let error = Diagnostic::error(format!("the rules of the plant `{}` read {what}", plant.name))
                .at(plant.span, why)
                .help(format!("draw it as a model of its own, or let its rules do without {what}"));
            return Err(DrawError::Plant(Box::new(error)));
        }
        Simulation::new(&plant.model, settings).map_err(|error| fault(plant, 0.0, &error))
    }

    /// The motions of the plants, in their order; `None` if none of them sways.
    #[allow(clippy::type_complexity)]
    fn motions<'s>(
        &self,
        (seed, around, time): (u64, &Around<'m>, f64),
        seedlings: &'s [Seedling],
    ) -> Result<Option<Vec<Option<Arc<Motion<'m>>>>>, DrawError> {
        let plants = &self.model.scenery.plants;
        if !seedlings.iter().any(|seedling| sways(&plants[seedling.plant].model)) {
            return Ok(None);
        }
        let of = |seedling: &'s Seedling| {
            let Seedling { plant, seed: own, .. } = *seedling;
            (seedling, &plants[plant].model, own.map_or(seed, number_of))
        };
        let all: Vec<(&Seedling, &'m Model, u64)> = seedlings.iter().map(of).collect();
        let now = around.place.birth + time * around.place.units.time;
        let gauge = || {
            let (model, classes) = ((self.model, self.settings), Arc::new(Classes::default()));
            Gauge::new(model, &self.blank, around, self.detail?, &classes)
        };
        let gauge = self.detail.and_then(|_| self.gauge.get_or_init(gauge).as_ref());
        let motions = self.swaying.of(around, &all, (self.settings, gauge), now);
        motions.map(Some).map_err(|(i, error)| {
            let plant = &plants[seedlings[i].plant];
            let message = format!("the plant `{}` cannot move in the wind", plant.name);
            DrawError::Plant(Box::new(within(plant, message, &error.diagnostic())))
        })
    }
}

/// Gives lines of default width the width that suits the plant at its age, so that it does not depend on the scene around it.
pub(crate) fn set_widths(scene: &mut Scene) {
    let is_default = |width: &Width| matches!(width, Width::Default(_));
    if !scene.segments.iter().flat_map(|segment| &segment.widths).any(is_default) {
        return;
    }
    let default = Bounds::of(scene).default_width();
    for width in scene.segments.iter_mut().flat_map(|segment| &mut segment.widths) {
        *width = Width::Set(width.resolve(default));
    }
}

pub(crate) fn count(scene: &Scene) -> usize {
    scene.segments.len()
        + scene.polygons.len()
        + scene.surfaces.len()
        + scene.patches.len()
        + scene.plants.len()
        + 1
}

/// A seed as it is given in a string: whole numbers as `--seed` takes them; others by their digits.
pub(crate) fn number_of(seed: f64) -> u64 {
    match (0.0..9e15).contains(&seed) && seed.fract() == 0.0 {
        true => seed as u64,
        false => seed.to_bits(),
    }
}

fn fault(plant: &model::Plant, age: f64, error: &sim::Error) -> DrawError {
    let message = format!("the plant `{}` cannot grow to the age {}", plant.name, brief(age, 6));
    let error = within(plant, message, &error.diagnostic()).help(format!(
        "`dlsys run {} --at {}` shows the whole message",
        plant.source.name,
        brief(age, 6)
    ));
    DrawError::Plant(Box::new(error))
}

/// A mistake in the model of a plant, with its place there as a note.
fn within(plant: &model::Plant, message: String, inner: &Diagnostic) -> Diagnostic {
    let place = inner.labels.first().map_or(String::new(), |(span, _)| {
        let at = (span.start as usize).min(plant.source.text.len());
        let before = plant.source.text.get(..at).unwrap_or_default();
        let line = before.bytes().filter(|byte| *byte == b'\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        format!("{}:{line}:{column}: ", plant.source.name)
    });
    let error = Diagnostic::error(message).at(plant.span, "this plant");
    let error = error.note(format!("{place}{}", inner.message));
    let error = inner.notes.iter().fold(error, |error, note| error.note(note.as_str()));
    inner.help.iter().fold(error, |error, help| error.help(help.as_str()))
}

/// Forces and falls are those of the size that a model declares.
fn of_own_size(plant: &model::Plant) -> DrawError {
    let error =
        Diagnostic::error("a plant that moves in the wind, or lets something go, has the size of its model")
            .at(plant.span, "this plant is drawn with another size");
    DrawError::Plant(Box::new(error.help(format!(
        "leave out the third parameter of `{}`, and change the lengths in its model",
        plant.name
    ))))
}

pub(crate) fn too_many(plant: &model::Plant, what: String) -> DrawError {
    let error = Diagnostic::error("too much is drawn in one scene").at(plant.span, what);
    DrawError::Plant(Box::new(error.help("draw fewer plants, or plants of fewer modules")))
}
