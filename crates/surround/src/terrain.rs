//! Ground that gives way, at any time of a model: the same bits whatever is asked for, in whatever order.
//!
//! ```text
//! growth ──string at each tick──▶ turtle, stems as they bend ──bodies, shelves──▶ columns ──▶ mesh at a tick
//! ```
//!
//! What is seen at a time is the ground at the tick at or before it. Where nothing can touch it any more, ticks pass at no cost.
//!
//! If rules read the height of the ground, and bodies of the model press it, each acts on the other. A tick is then gone through with a guess of the ground at its
//! end, first that of its beginning and then what came out, until both agree; in between, heights are linear in time ([`Layers`]).

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_geometry::scene::{self, Scene};
use dlsys_geometry::turtle;
use dlsys_ground::{self as ground, Ground};
use dlsys_model::Model;
use dlsys_sim::{Inputs, Settings, Simulation};
use dlsys_tree::ModuleString;

use crate::Error;
use crate::columns;
use crate::coupled;
use crate::descent::Descent;
use crate::layers::{Layer, Layers};
use crate::marks::{Marks, Recent};
use crate::motion::{MOST_TICKS, Motion};
use crate::picture::{Earth, Picture};
use crate::place::Place;
use crate::pressing::Placed;
use crate::reading;
use crate::spray::with_spray;
pub use crate::works::TICKS;
use crate::works::Works;

/// A time that is short of a tick by this part of one counts as the tick: a rounding of frames of 24, 30, or 60 in a second.
const SLACK: f64 = 1e-6;
/// Most columns of the moments that are kept because they were asked for, and of marks.
const MOST_KEPT: usize = 4_000_000;
/// Most times that growth goes through a tick with the ground that it reads.
const PASSES: usize = 12;

/// The ground of a model.
pub struct Terrain<'m> {
    settings: Settings,
    pub(crate) works: Works<'m>,
    /// Some module may draw a body or a shelf.
    has_bodies: bool,
    /// The picture on it.
    pub(crate) picture: Option<Picture>,
    /// What rules read of the ground, if they do.
    layers: Option<Arc<Layers>>,
    pub(crate) state: Mutex<State<'m>>,
}

/// The ground at a tick, and the bodies there.
#[derive(Clone)]
pub(crate) struct Moment {
    number: u64,
    pub(crate) ground: Ground,
    bodies: Arc<Vec<Placed>>,
    /// What rules read from the tick before to this one.
    layer: Option<Arc<Layer>>,
}

/// What rules read from a tick on.
pub(crate) struct PassedTick {
    pub(crate) layer: Arc<Layer>,
    /// The ground may change at a later tick.
    pub(crate) goes_on: bool,
}

/// A moment to go on from.
#[derive(Clone)]
struct Course<'m> {
    growth: Simulation<'m>,
    moment: Moment,
    /// What rules read up to the tick before.
    held: Option<Arc<Layer>>,
}

pub(crate) struct State<'m> {
    start: Course<'m>,
    /// The bodies of the start are known.
    has_begun: bool,
    present: Option<Course<'m>>,
    /// The tick in which growth fails, with what it read until then.
    broken: Option<(u64, Arc<Layer>)>,
    /// Moments that were asked for: they may be asked for again.
    kept: Recent<Moment>,
    marks: Marks<Course<'m>>,
    spent: Duration,
    scene: Scene,
    /// The last mesh, with its tick, the bits of its time if something is in the air, and its material.
    mesh: Option<((u64, u64, Earth), Arc<scene::Mesh>)>,
}

/// What the columns of a ground are doing at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerrainReport {
    /// Ticks from the beginning.
    pub ticks: u64,
    /// Columns in memory.
    pub columns: usize,
    /// Sweeps over columns so far, and columns that they computed.
    pub sweeps: u64,
    /// See `sweeps`.
    pub updates: u64,
    /// What columns, loads, particles, what sticks to bodies and what is compressed have gained less what was poured, in parts of quanta: always 0.
    pub imbalance: i128,
    /// Volume that lies on bodies, in m³.
    pub carried: f64,
    /// Volume that sticks to them, and volume in the air, in m³.
    pub sticking: f64,
    /// See `sticking`.
    pub airborne: f64,
    /// Number of particles in the air.
    pub particles: usize,
    /// Nothing slips.
    pub is_at_rest: bool,
}

impl<'m> Terrain<'m> {
    /// The ground of the model of a scene; `None` if none is declared that gives way. Results do not depend on the number of threads.
    ///
    /// # Errors
    /// A ground whose values are out of range.
    pub fn new(model: &'m Model, settings: Settings, threads: usize) -> Result<Option<Terrain<'m>>, Error> {
        Terrain::with_ticks(model, settings, (threads, TICKS))
    }

    /// As [`Terrain::new`], with another number of ticks in a second, for studies of the error. Rules that read the ground always read it as it is with [`TICKS`].
    ///
    /// # Errors
    /// As of [`Terrain::new`].
    pub fn with_ticks(
        model: &'m Model,
        settings: Settings,
        (threads, ticks): (usize, f64),
    ) -> Result<Option<Terrain<'m>>, Error> {
        let place = Place::of_scene(&model.scenery);
        reading::bind(model)?;
        let layers = reading::layers(model)?;
        let ticks = if layers.is_some() { TICKS } else { ticks };
        let Some(ground) = columns::ground(model, &place, (threads, ticks), settings.ground_rule)? else {
            return Ok(None);
        };
        let settings = Settings { log: true, transitions: false, ..settings };
        let growth = match layers.is_some() {
            // It reads what is computed here.
            true => Simulation::new(model, settings)?,
            false => coupled::start(model, settings, place)?,
        };
        let layer = layers.as_ref().map(|layers| layers.start());
        let moment = Moment { number: 0, ground, bodies: Arc::default(), layer };
        let state = State {
            start: Course { growth, moment, held: None },
            has_begun: false,
            present: None,
            broken: None,
            kept: Recent::new(MOST_KEPT),
            marks: Marks::new(MOST_KEPT),
            spent: Duration::ZERO,
            scene: turtle::blank(model),
            mesh: None,
        };
        let has_bodies = !model.scenery.solids.is_empty() || !model.scenery.shelves.is_empty();
        let picture = model.scenery.bed.as_ref().and_then(|bed| Picture::of(bed, place.units.length));
        let works = Works { model, place, ticks };
        Ok(Some(Terrain { settings, works, has_bodies, picture, layers, state: Mutex::new(state) }))
    }

    /// The surface of the ground and of what lies on bodies, and the particles in the air, at a time of the model, in its units, of a material. Stems move as they do here.
    ///
    /// # Errors
    /// The growth up to that time fails, or the motion of its stems; a body or what is poured is not possible, or there is too much of it.
    pub fn at(
        &self,
        time: f64,
        earth: impl Into<Earth>,
        motion: Option<&Motion<'m>>,
    ) -> Result<Arc<scene::Mesh>, Error> {
        let earth = earth.into();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let moment = self.reach(&mut state, time, motion)?;
        let (seconds, still) = (self.works.place.seconds(time), moment.ground.particles() == 0);
        let of = (moment.number, if still { 0 } else { seconds.to_bits() }, earth);
        if let Some((known, mesh)) = &state.mesh
            && *known == of
        {
            return Ok(Arc::clone(mesh));
        }
        let mesh = Arc::new(self.mesh(&moment.ground, seconds, earth));
        state.mesh = Some((of, Arc::clone(&mesh)));
        Ok(mesh)
    }

    /// The height of the surface at a time and a place of the model.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub fn height(&self, time: f64, [x, z]: [f64; 2], motion: Option<&Motion<'m>>) -> Result<f64, Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let moment = self.reach(&mut state, time, motion)?;
        let metre = self.works.place.units.length;
        Ok(moment.ground.height(x * metre, z * metre) / metre)
    }

    /// The rectangle around what has moved up to a time of the model, by a hundredth of a column or more: its least and its greatest x and z.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub fn moved(&self, time: f64, motion: Option<&Motion<'m>>) -> Result<Option<[[f64; 2]; 2]>, Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let ground = self.reach(&mut state, time, motion)?.ground;
        let scale = ground.cell() / self.works.place.units.length;
        let around = ground.moved(0.01 * ground.cell());
        Ok(around.map(|ground::Extent { x, z }| {
            [0, 1].map(|end| [x[end], z[end]].map(|at| f64::from(at) * scale))
        }))
    }

    /// Counts and volumes at a time of the model.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub fn report(&self, time: f64, motion: Option<&Motion<'m>>) -> Result<TerrainReport, Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let Moment { number, ground, .. } = self.reach(&mut state, time, motion)?;
        Ok(TerrainReport {
            ticks: number,
            columns: ground.stored(),
            sweeps: ground.sweeps(),
            updates: ground.updates(),
            imbalance: ground.imbalance(),
            carried: ground.carried(),
            sticking: ground.sticking(),
            airborne: ground.airborne(),
            particles: ground.particles(),
            is_at_rest: ground.is_at_rest(),
        })
    }

    /// The ground at the tick at or before a time of the model.
    pub(crate) fn reach(
        &self,
        state: &mut State<'m>,
        time: f64,
        motion: Option<&Motion<'m>>,
    ) -> Result<Moment, Error> {
        let number = (self.works.place.seconds(time).max(0.0) * self.works.ticks + SLACK).floor();
        self.reach_tick(state, number, motion)
    }

    /// What rules read from a tick on, up to the next one; `None` if they read nothing of the ground.
    ///
    /// # Errors
    /// As of [`Terrain::at`], unless growth fails within the tick: then it is what it reads until then.
    pub(crate) fn layer(&self, number: u64) -> Result<Option<PassedTick>, Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match self.reach_tick(&mut state, number as f64 + 1.0, None) {
            Ok(Moment { layer, ground, .. }) => {
                Ok(layer.map(|layer| PassedTick { layer, goes_on: !self.rests(&ground) }))
            }
            Err(error) => match state.broken.take() {
                Some((tick, layer)) if tick == number => Ok(Some(PassedTick { layer, goes_on: false })),
                _ => Err(error),
            },
        }
    }

    /// The ground at a tick, and whether nothing can move it any more, as it is without stems that bend.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub(crate) fn columns(&self, number: u64) -> Result<(Ground, bool), Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let Moment { ground, .. } = self.reach_tick(&mut state, number as f64, None)?;
        let rests = self.rests(&ground);
        Ok((ground, rests))
    }

    /// Nothing can move a ground any more.
    fn rests(&self, ground: &Ground) -> bool {
        !self.has_bodies && self.works.model.scenery.pours.is_empty() && ground.is_at_rest()
    }

    fn reach_tick(
        &self,
        state: &mut State<'m>,
        number: f64,
        motion: Option<&Motion<'m>>,
    ) -> Result<Moment, Error> {
        // Stems that bend have a growth of their own, which reads the ground that is computed here.
        let motion = motion.filter(|_| self.layers.is_none());
        if number > MOST_TICKS {
            let (seconds, time) =
                (self.works.place.units.time, self.works.place.time_at(number / self.works.ticks));
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds, span: self.works.span() });
        }
        let begun = Instant::now();
        let (limit, spent) = (self.settings.max_seconds, state.spent);
        let in_time = |at: f64| match (spent + begun.elapsed()).as_secs_f64() > limit {
            true => Err(Error::OutOfTime { limit, time: at, span: self.works.span() }),
            false => Ok(()),
        };
        let moment = self.moment(state, number as u64, motion, &in_time);
        state.spent += begun.elapsed();
        moment
    }

    fn moment(
        &self,
        state: &mut State<'m>,
        number: u64,
        motion: Option<&Motion<'m>>,
        in_time: &dyn Fn(f64) -> Result<(), Error>,
    ) -> Result<Moment, Error> {
        if let Some(moment) = state.kept.get(number) {
            return Ok(moment.clone());
        }
        if !state.has_begun {
            let mut course = state.start.clone();
            if self.has_bodies {
                let mut string = ModuleString::default();
                course.growth.at(self.works.time_of(0), &mut string)?;
                course.growth.take_events();
                course.moment.bodies = Arc::new(self.works.bodies(
                    &string,
                    (&[], &Descent::default()),
                    &mut state.scene,
                    motion,
                )?);
            }
            (state.start, state.has_begun) = (course, true);
        }
        let mut present = match state.present.take() {
            Some(present) if present.moment.number <= number => present,
            _ => state.marks.before(number).unwrap_or(&state.start).clone(),
        };
        while present.moment.number < number {
            in_time(self.works.time_of(present.moment.number))?;
            if self.rests(&present.moment.ground) {
                let Moment { number: from, ground, layer, .. } = &present.moment;
                let still =
                    self.layers.as_ref().map(|layers| self.still(layers, (*from, ground), layer.as_ref()));
                (present.moment.number, present.moment.layer) = (number, still);
                break;
            }
            self.tick(&mut present, state, motion)?;
            state.marks.set(present.moment.number, &present, |course| {
                let ground = &course.moment.ground;
                ground.stored() + ground.particles()
            });
        }
        let moment = present.moment.clone();
        state.present = Some(present);
        // Columns that it does not share with the one before.
        let own = match state.kept.before(number) {
            Some(before) => moment.ground.changed_since(&before.ground).len() * 32 * 32,
            None => moment.ground.stored(),
        };
        let own = own + moment.ground.particles();
        state.kept.add(number, moment.clone(), own + 1);
        Ok(moment)
    }

    /// Goes on to the next tick.
    fn tick(
        &self,
        course: &mut Course<'m>,
        state: &mut State<'m>,
        motion: Option<&Motion<'m>>,
    ) -> Result<(), Error> {
        if let Some(layers) = self.layers.as_ref().filter(|_| self.has_bodies) {
            return self.tick_together(layers, course, state);
        }
        let next = course.moment.number + 1;
        let first = self.layers.as_ref().map(|_| course.moment.ground.clone());
        let mut bodies = Vec::new();
        if self.has_bodies {
            let mut string = ModuleString::default();
            course.growth.at(self.works.time_of(next), &mut string)?;
            let mut descent = Descent::default();
            descent.add(self.works.model, &course.growth.take_events());
            bodies =
                self.works.bodies(&string, (&course.moment.bodies, &descent), &mut state.scene, motion)?;
        }
        let pours = self.works.pours(next)?;
        let moving: Vec<ground::Body> = bodies.iter().map(Placed::moving).collect();
        let done = course.moment.ground.advance(&pours, &moving);
        done.map_err(|error| self.works.failed(error, self.works.time_of(next)))?;
        course.moment.bodies = Arc::new(bodies);
        if let (Some(layers), Some(first)) = (&self.layers, first) {
            let span = self.span_of(course.moment.number);
            course.moment.layer = Some(layers.add(span, first, Some(course.moment.ground.clone())));
        }
        course.moment.number = next;
        Ok(())
    }

    /// Goes on to the next tick, with growth that reads the ground until then.
    fn tick_together(
        &self,
        layers: &Layers,
        course: &mut Course<'m>,
        state: &mut State<'m>,
    ) -> Result<(), Error> {
        let Moment { number, ground: first, bodies: past, layer: before } = course.moment.clone();
        let (span, pours) = (self.span_of(number), self.works.pours(number + 1)?);
        let mut layer = self.still(layers, (number, &first), before.as_ref());
        let mut guess = first.clone();
        let mut apart = 0.0;
        for _ in 0..PASSES {
            let mut growth = course.growth.clone();
            let mut string = ModuleString::default();
            let read = |_: &ModuleString, inputs: &mut Inputs| inputs.set_ground(layer.number as f64);
            let gone =
                growth.give(span, read).and_then(|()| growth.at(self.works.time_of(number + 1), &mut string));
            if let Err(error) = gone {
                state.broken = Some((number, layer));
                return Err(error.into());
            }
            let mut descent = Descent::default();
            descent.add(self.works.model, &growth.take_events());
            let bodies = self.works.bodies(&string, (&past, &descent), &mut state.scene, None)?;
            let moving: Vec<ground::Body> = bodies.iter().map(Placed::moving).collect();
            let mut ground = first.clone();
            let done = ground.advance(&pours, &moving);
            done.map_err(|error| self.works.failed(error, self.works.time_of(number + 1)))?;
            apart = distance(&ground, &guess);
            if apart <= self.allowed() {
                let bodies = Arc::new(bodies);
                // The layer before is still read by what happened up to the tick.
                course.held = before;
                course.growth = growth;
                course.moment = Moment { number: number + 1, ground, bodies, layer: Some(layer) };
                return Ok(());
            }
            layer = layers.add(span, first.clone(), Some(ground.clone()));
            guess = ground;
        }
        let (time, allowed) = (self.works.time_of(number), self.allowed());
        let metre = self.works.place.units.length;
        Err(Error::GroundApart { by: apart / metre, allowed: allowed / metre, time, span: self.works.span() })
    }

    /// How far the ground that growth reads may be from what comes out, in m.
    fn allowed(&self) -> f64 {
        let cell = self.works.model.scenery.bed.as_ref().map_or(1.0, |bed| bed.cell);
        self.settings.bending.tolerance * cell * self.works.place.units.length
    }

    /// A layer of a ground that does not move: the one before, if that has been so.
    fn still(
        &self,
        layers: &Layers,
        (number, ground): (u64, &Ground),
        before: Option<&Arc<Layer>>,
    ) -> Arc<Layer> {
        match before.filter(|before| before.stays_at(ground) && self.works.model.scenery.pours.is_empty()) {
            Some(before) => Arc::clone(before),
            None => layers.add(self.span_of(number), ground.clone(), None),
        }
    }

    /// The time of the model at a tick, and up to the next one.
    fn span_of(&self, number: u64) -> (f64, f64) {
        (self.works.time_of(number), 1.0 / (self.works.ticks * self.works.place.units.time))
    }

    /// The surface, and what is in the air at a time in s, in units of the model.
    fn mesh(&self, ground: &Ground, seconds: f64, earth: Earth) -> scene::Mesh {
        let metre = self.works.place.units.length;
        let mut surface = ground.mesh();
        surface.append(&ground.heaps());
        surface.append(&ground.clods());
        with_spray(surface, &ground.spray(seconds), (metre, self.picture), earth)
    }
}

/// The largest difference of the heights of two states of a ground, in m.
fn distance(one: &Ground, other: &Ground) -> f64 {
    let mut most = 0.0_f64;
    for extent in one.changed_since(other).into_iter().chain(other.changed_since(one)) {
        for k in extent.z[0]..=extent.z[1] {
            for i in extent.x[0]..=extent.x[1] {
                most = most.max((one.column(i, k) - other.column(i, k)).abs());
            }
        }
    }
    most
}
