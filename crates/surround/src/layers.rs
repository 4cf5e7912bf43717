//! What rules read of ground that gives way: its heights from tick to tick, and the simulations that read them.
//!
//! ```text
//! Terrain (a growth of its own, in lock step with the columns) ──layers, tick by tick──▶ Grounded ──▶ any simulation of the model
//! ```
//!
//! A *layer* is the ground from one tick to the next: heights at both, linear in time between them, and beyond. Rules hold the number of a layer in a hidden
//! parameter, and get another one at each tick at which the ground changes. So what they read is a function of time and place, continuous up to the tolerance
//! at which growth and ground agree ([`Terrain`]).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use dlsys_expr::{FIELD_ARGUMENTS, Field, FieldPart, Interval};
use dlsys_ground::Ground;
use dlsys_model::Model;
use dlsys_sim::{self as sim, Failure, Inputs, Settings, Simulation, Surroundings};
use dlsys_tree::ModuleString;

use crate::coupled::failure;
use crate::place::Place;
use crate::terrain::PassedTick;
use crate::{Error, Terrain};

/// The numbers of arguments: the time, x, the number of a layer, z.
const TIME: usize = 0;
const X: usize = 1;
const LAYER: usize = 2;
const Z: usize = 3;
/// Bounds over so many places where cells end are those of each cell; over more, those of columns.
const MOST_PLACES: usize = 256;

/// The ground from a tick on.
#[derive(Debug)]
pub(crate) struct Layer {
    /// Its number; 0 is the ground at the beginning, for ever.
    pub(crate) number: u64,
    /// The time of the model at which it begins, and the time to the next tick.
    begin: f64,
    length: f64,
    /// At both ticks; one for all times if nothing moves.
    first: Ground,
    next: Option<Ground>,
}

/// The layers of a model that simulations hold.
#[derive(Debug)]
pub(crate) struct Layers {
    start: Arc<Layer>,
    /// Metres in a unit of the model.
    metre: f64,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    last: u64,
    layers: HashMap<u64, Weak<Layer>>,
}

impl Layers {
    /// Of a ground at the beginning, with the metres in a unit of the model, and its time from tick to tick.
    pub(crate) fn new(first: Ground, (metre, tick): (f64, f64)) -> Layers {
        let start = Arc::new(Layer { number: 0, begin: 0.0, length: tick, first, next: None });
        Layers { start, metre, kept: Mutex::default() }
    }

    pub(crate) fn start(&self) -> Arc<Layer> {
        Arc::clone(&self.start)
    }

    /// A new layer from a time of the model on. It is known as long as it is held.
    pub(crate) fn add(&self, (begin, length): (f64, f64), first: Ground, next: Option<Ground>) -> Arc<Layer> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.last += 1;
        let number = kept.last;
        let layer = Arc::new(Layer { number, begin, length, first, next });
        if kept.layers.len() > 64 && number.is_multiple_of(64) {
            kept.layers.retain(|_, layer| layer.strong_count() > 0);
        }
        kept.layers.insert(number, Arc::downgrade(&layer));
        layer
    }

    fn get(&self, number: f64) -> Option<Arc<Layer>> {
        if number == 0.0 {
            return Some(self.start());
        }
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.layers.get(&(number as u64)).and_then(Weak::upgrade)
    }
}

impl Layer {
    /// It is this ground, and does not move.
    pub(crate) fn stays_at(&self, ground: &Ground) -> bool {
        self.next.is_none()
            && ground.changed_since(&self.first).is_empty()
            && self.first.changed_since(ground).is_empty()
    }

    /// The share of the way to the next tick.
    fn share(&self, time: f64) -> f64 {
        (time - self.begin) / self.length
    }

    /// A function of the ground at a time, from that at both ticks.
    fn between(&self, share: f64, of: impl Fn(&Ground) -> f64) -> f64 {
        let first = of(&self.first);
        self.next.as_ref().map_or(first, |next| first + share * (of(next) - first))
    }

    /// The same over a stretch of time, of bounds at places: what is linear has its bounds at the ends.
    fn over(&self, [from, to]: [f64; 2], of: impl Fn(&Ground) -> [f64; 2]) -> [f64; 2] {
        let [low, high] = of(&self.first);
        let Some(next) = &self.next else { return [low, high] };
        let [lower, higher] = of(next);
        let ends = [from, to].map(|share| {
            let part = |a: f64, b: f64| a + share * (b - a);
            // Between the ticks a height lies between both; beyond, it may be anywhere that their bounds lead to.
            match (0.0..=1.0).contains(&share) {
                true => [part(low, lower), part(high, higher)],
                false => {
                    let all = [part(low, lower), part(low, higher), part(high, lower), part(high, higher)];
                    [
                        all.into_iter().fold(f64::INFINITY, f64::min),
                        all.into_iter().fold(f64::NEG_INFINITY, f64::max),
                    ]
                }
            }
        });
        [ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])]
    }
}

/// The slope of a ground along an axis at a place in m: that of the cell.
fn slope(ground: &Ground, axis: usize, place: [f64; 2]) -> f64 {
    let (cell, extent) = (ground.cell(), ground.extent());
    let [from, to] = [extent.x, extent.z][axis].map(f64::from);
    let at = place[axis] / cell;
    if !(from..=to).contains(&at) {
        return 0.0;
    }
    let low = at.floor().min(to - 1.0);
    let height = |at: f64| {
        let mut there = place;
        there[axis] = at * cell;
        ground.height(there[0], there[1])
    };
    (height(low + 1.0) - height(low)) / cell
}

/// The ends of a stretch in m, and the columns in it; `None` if there are many.
fn places(ground: &Ground, axis: usize, [from, to]: [f64; 2]) -> Option<Vec<f64>> {
    let (cell, extent) = (ground.cell(), ground.extent());
    let [first, last] = [extent.x, extent.z][axis].map(f64::from);
    let low = (from / cell).ceil().max(first);
    let high = (to / cell).floor().min(last);
    if (high - low).is_nan() || high - low >= MOST_PLACES as f64 {
        return None;
    }
    let mut all = vec![from, to];
    let mut at = low;
    while at <= high {
        all.push(at * cell);
        at += 1.0;
    }
    all.sort_by(f64::total_cmp);
    Some(all)
}

/// Bounds of the height over a rectangle in m. They are exact over few cells: the surface of each is bilinear.
fn heights(ground: &Ground, x: [f64; 2], z: [f64; 2]) -> [f64; 2] {
    let exact = |xs: &[f64], zs: &[f64]| {
        let all = xs.iter().flat_map(|x| zs.iter().map(move |z| ground.height(*x, *z)));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], height| {
            [low.min(height), high.max(height)]
        })
    };
    match (places(ground, 0, x), places(ground, 1, z)) {
        (Some(xs), Some(zs)) if xs.len() * zs.len() <= MOST_PLACES => exact(&xs, &zs),
        _ => ground.bounds(x, z),
    }
}

/// Bounds of the slope along an axis over a rectangle in m: on a cell it is linear along the other axis.
fn slopes(ground: &Ground, axis: usize, along: [f64; 2], across: [f64; 2]) -> [f64; 2] {
    let (Some(along), Some(across)) = (places(ground, axis, along), places(ground, 1 - axis, across)) else {
        return [f64::NEG_INFINITY, f64::INFINITY];
    };
    if along.len() * across.len() > MOST_PLACES {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY];
    for pair in along.windows(2) {
        for other in &across {
            let middle = 0.5 * (pair[0] + pair[1]);
            let found = slope(ground, axis, if axis == 0 { [middle, *other] } else { [*other, middle] });
            bounds = [bounds[0].min(found), bounds[1].max(found)];
        }
    }
    bounds
}

impl Field for Layers {
    fn value(&self, part: FieldPart, at: [f64; FIELD_ARGUMENTS]) -> f64 {
        if at.iter().any(|of| of.is_nan()) {
            return f64::NAN;
        }
        let Some(layer) = self.get(at[LAYER]) else { return f64::NAN };
        let (x, z, share) = (at[X] * self.metre, at[Z] * self.metre, layer.share(at[TIME]));
        match part.by.map(usize::from) {
            None => layer.between(share, |ground| ground.height(x, z)) / self.metre,
            Some(X) => layer.between(share, |ground| slope(ground, 0, [x, z])),
            Some(Z) => layer.between(share, |ground| slope(ground, 1, [x, z])),
            Some(TIME) => {
                let of = |share: f64| layer.between(share, |ground| ground.height(x, z));
                (of(1.0) - of(0.0)) / (layer.length * self.metre)
            }
            // The number of a layer does not change within one.
            Some(_) => 0.0,
        }
    }

    fn over(&self, part: FieldPart, at: [Interval; FIELD_ARGUMENTS]) -> Interval {
        let Some(layer) = self.get(at[LAYER].lo) else { return Interval::EMPTY };
        let [x, z] = [at[X], at[Z]].map(|of| [of.lo * self.metre, of.hi * self.metre]);
        let time = [at[TIME].lo, at[TIME].hi].map(|time| layer.share(time));
        let [lo, hi] = match part.by.map(usize::from) {
            None => layer.over(time, |ground| heights(ground, x, z)).map(|height| height / self.metre),
            Some(X) => layer.over(time, |ground| slopes(ground, 0, x, z)),
            Some(Z) => layer.over(time, |ground| slopes(ground, 1, z, x)),
            Some(TIME) => match &layer.next {
                None => [0.0; 2],
                Some(next) => {
                    let ([a, b], [c, d]) = (heights(&layer.first, x, z), heights(next, x, z));
                    [c - b, d - a].map(|change| change / (layer.length * self.metre))
                }
            },
            Some(_) => [0.0; 2],
        };
        if lo.is_nan() || hi.is_nan() {
            return Interval::ENTIRE;
        }
        Interval { lo, hi, partial: false }
    }

    fn stretch(&self) -> f64 {
        self.start.length
    }
}

/// Starts a simulation of a model whose rules read the height of ground that gives way.
pub(crate) fn start<'m>(
    model: &'m Model,
    settings: Settings,
    (place, layers): (Place, Arc<Layers>),
) -> Result<Simulation<'m>, sim::Error> {
    let shared = Arc::new(Shared { model, settings, terrain: OnceLock::new() });
    let time = place.time_at(0.0).max(0.0);
    let held = [layers.start(), layers.start()];
    let grounded = Grounded { shared, tick: 0, time, held };
    Simulation::with_surroundings(model, settings, Box::new(grounded))
}

/// The ground of a model, for all copies of a simulation.
struct Shared<'m> {
    model: &'m Model,
    settings: Settings,
    terrain: OnceLock<Result<Option<Terrain<'m>>, Error>>,
}

/// Where a simulation is among the ticks of its ground.
#[derive(Clone)]
struct Grounded<'m> {
    shared: Arc<Shared<'m>>,
    /// The number and the time of the next tick.
    tick: u64,
    time: f64,
    /// The layer that rules read, and the one before: trajectories up to the tick read that.
    held: [Arc<Layer>; 2],
}

impl Grounded<'_> {
    fn pass(&mut self, inputs: &mut Inputs) -> Result<(), Error> {
        let Shared { model, settings, terrain } = &*self.shared;
        let made = terrain.get_or_init(|| Terrain::new(model, *settings, 1));
        self.time = f64::INFINITY;
        if let Some(terrain) = made.as_ref().map_err(Clone::clone)?
            && let Some(PassedTick { layer, goes_on }) = terrain.layer(self.tick)?
        {
            self.held = [layer, Arc::clone(&self.held[0])];
            self.tick += 1;
            if goes_on {
                self.time = terrain.works.time_of(self.tick);
            }
        }
        inputs.set_ground(self.held[0].number as f64);
        Ok(())
    }
}

impl Surroundings for Grounded<'_> {
    fn next_tick(&self) -> f64 {
        self.time
    }

    fn tick(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure> {
        self.pass(inputs).map_err(|error| failure(&error, string))
    }

    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a,
    {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        size_of::<Self>()
    }

    fn work(&self) -> u64 {
        /// The cost of a tick that has been computed.
        const TICK: u64 = 10;
        self.tick * TICK
    }
}
