//! Soil that solids sink into, where rules read the force on them: its columns from tick to tick, and what it does to a solid in a part of a tick.
//!
//! ```text
//! columns at a tick ──Bearing (ground)──▶ limits of the force around a solid
//!                                             │
//! path of the solid, inverse of its mass ──▶ implicit steps ──▶ impulse and its integral ──▶ force, linear in time
//! ```
//!
//! The path is that of growth under the forces of the pass before; a solid deviates from it by what the soil does beyond that, as from sheets (`leading.rs`). Parts of a tick
//! end at the ticks of the ground, too. There the ground gives way to the solids where growth has them then, as it does in the [`Terrain`](crate::Terrain) that is drawn.

use std::sync::Arc;

use dlsys_geometry::scene::Scene;
use dlsys_ground::{self as ground, Bearing, Drive, Ground, Stand};
use dlsys_model::Model;
use dlsys_sheet::Vector;
use dlsys_sim::Settings;
use dlsys_tree::ModuleString;

use crate::Error;
use crate::columns;
use crate::descent::Descent;
use crate::line::Line;
use crate::masses::Body;
use crate::paths::{INSTANTS, Path};
use crate::place::Place;
use crate::pressing::Placed;
use crate::works::{TICKS, Works};

/// Steps from one instant of a part to the next at first, and at most.
const FEWEST: usize = 1;
const MOST: usize = 64;
/// Halvings to find when a body touches soil.
const HALVINGS: usize = 48;
/// How near two numbers of steps have to come, in parts of what is allowed.
const NEAR: f64 = 0.01;
/// A part that ends within this many seconds of a tick ends there.
const SAME: f64 = 1e-9;

/// How far a body is from its path at all instants but the first, and its velocity relative to it at the last one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Deviation {
    pub(crate) ways: [Vector; 3],
    pub(crate) velocity: Vector,
}

/// The soil of a model at the tick at or before a part.
#[derive(Clone)]
pub(crate) struct Mire<'m> {
    works: Works<'m>,
    ground: Ground,
    /// The bodies at the tick; `None` before the first one.
    bodies: Option<Arc<Vec<Placed>>>,
    number: u64,
    /// Productions since the tick.
    descent: Descent,
    /// The means of its forces in the part before.
    forces: Vec<(u64, Line)>,
}

impl<'m> Mire<'m> {
    /// The soil of a model at t = 0; `None` if it has none, or no rules that read forces.
    ///
    /// # Errors
    /// A ground whose values are out of range.
    pub(crate) fn new(model: &'m Model, place: Place, settings: Settings) -> Result<Option<Mire<'m>>, Error> {
        if !model.reads_force() {
            return Ok(None);
        }
        let Some(ground) = columns::ground(model, &place, (1, TICKS), settings.ground_rule)? else {
            return Ok(None);
        };
        let works = Works { model, place, ticks: TICKS };
        let (descent, forces) = (Descent::default(), Vec::new());
        Ok(Some(Mire { works, ground, bodies: None, number: 0, descent, forces }))
    }

    /// The next tick, in s.
    pub(crate) fn next_tick(&self) -> f64 {
        (self.number + 1) as f64 / TICKS
    }

    /// Columns in memory.
    pub(crate) fn stored(&self) -> usize {
        self.ground.stored()
    }

    /// The means of its forces in the part before, by modules.
    pub(crate) fn forces(&self) -> &[(u64, Line)] {
        &self.forces
    }

    /// How it bears the solids of a string, at the beginning of a part, that have these modules and middles; `None` for one that is no body.
    ///
    /// # Errors
    /// A drawing fails.
    pub(crate) fn bearings(
        &mut self,
        string: &ModuleString,
        readers: &[(u64, Vector)],
        scene: &mut Scene,
    ) -> Result<Vec<Option<Bearing>>, Error> {
        let past = self.bodies.clone().unwrap_or_default();
        let bodies = self.works.bodies(string, (&past, &self.descent), scene, None)?;
        let bearing = |(module, middle): &(u64, Vector)| {
            let body = bodies.iter().find(|body| body.module() == *module && !body.is_shelf())?;
            Some(self.ground.bearing(body.id(), (body.triangles(), body.points()), middle))
        };
        let found = readers.iter().map(bearing).collect();
        // Bodies that stand in the soil from the beginning have pressed nothing on their way.
        self.bodies.get_or_insert_with(|| Arc::new(bodies));
        Ok(found)
    }

    /// Goes on to the end of a part, in s, with the string there, the productions and the forces in the part, whose length is in s.
    ///
    /// # Errors
    /// A drawing fails, or the ground does.
    pub(crate) fn go_on(
        &mut self,
        (string, end): (&ModuleString, f64),
        (descent, forces): (&Descent, &[(u64, Line)]),
        length: f64,
        scene: &mut Scene,
    ) -> Result<(), Error> {
        self.descent.extend(descent);
        let mean = |(module, line): &(u64, Line)| (*module, Line::constant(line.mean(length)));
        self.forces = forces.iter().map(mean).collect();
        if end < self.next_tick() - SAME {
            return Ok(());
        }
        let past = self.bodies.clone().unwrap_or_default();
        let bodies = self.works.bodies(string, (&past, &self.descent), scene, None)?;
        let pours = self.works.pours(self.number + 1)?;
        let moving: Vec<ground::Body> = bodies.iter().map(Placed::moving).collect();
        let done = self.ground.advance(&pours, &moving);
        done.map_err(|error| self.works.failed(error, self.works.time_of(self.number + 1)))?;
        self.bodies = Some(Arc::new(bodies));
        self.number += 1;
        self.descent = Descent::default();
        Ok(())
    }
}

/// When a body on its path through a part (beginning and length, in s) is in soil first, in parts of it; `None` if it is not at any instant.
pub(crate) fn touch(bearing: &Bearing, path: &Path, (begin, length): (f64, f64)) -> Option<f64> {
    let is_below = |part: f64| {
        let stand = path.place(begin + part * length);
        bearing.is_below(&stand.position, &stand.attitude)
    };
    let number = INSTANTS.into_iter().position(is_below)?;
    let mut high = INSTANTS[number];
    let mut low = if number > 0 { INSTANTS[number - 1] } else { high };
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        (low, high) = if is_below(middle) { (low, middle) } else { (middle, high) };
    }
    Some(low)
}

/// What soil does to a body in a part (beginning and length, in s): its force, and how that makes the body deviate from its path. `share` is its force in the path, and
/// `others` what sheets do beyond theirs. The inner error is the distance in m between the finest steps, where it is more than what is allowed.
pub(crate) fn sink(
    bearing: &Bearing,
    (body, path): (&Body, &Path),
    (begin, length): (f64, f64),
    (share, others): (&Line, &Line),
    allowed: f64,
) -> Result<(Line, Deviation), f64> {
    let touch = touch(bearing, path, (begin, length));
    if *share == Line::default() && *others == Line::default() && touch.is_none() {
        return Ok((Line::default(), Deviation::default()));
    }
    // A step begins where the body touches the soil, so that none goes over that.
    let mut stops = INSTANTS.to_vec();
    if let Some(touch) = touch.filter(|touch| !INSTANTS.contains(touch)) {
        stops.insert(stops.partition_point(|stop| *stop < touch), touch);
    }
    let mut before: Option<Deviation> = None;
    let mut apart = f64::INFINITY;
    let mut count = FEWEST;
    while count <= MOST {
        let (line, deviation) =
            steps(bearing, (body, path), (begin, length), (share, others), (&stops, count));
        if let Some(before) = before {
            let way = (deviation.ways[2] - before.ways[2]).norm();
            apart = way.max((deviation.velocity - before.velocity).norm() * length);
            if apart <= NEAR * allowed {
                return Ok((line, deviation));
            }
        }
        before = Some(deviation);
        count *= 2;
    }
    Err(apart)
}

/// The same in a number of steps from each stop, in parts of the span, to the next.
fn steps(
    bearing: &Bearing,
    (body, path): (&Body, &Path),
    (begin, length): (f64, f64),
    (share, others): (&Line, &Line),
    (stops, count): (&[f64], usize),
) -> (Line, Deviation) {
    let light = body.light;
    let at = |part: f64| {
        let place = path.place(begin + part * length);
        let [impulse, integral] = others.moments(part * length);
        let position = place.position + light * integral;
        (Stand { position, velocity: place.velocity + light * impulse }, place)
    };
    let mut deviation = Deviation::default();
    let mut way = Vector::zeros();
    // Beyond the force in the path.
    let [mut impulse, mut integral] = [Vector::zeros(); 2];
    let mut is_touched = false;
    let mut here = at(0.0).0;
    for ends in stops.windows(2) {
        let part_of = |n: usize, half: f64| {
            let whole = (n as f64 + half) / count as f64;
            if whole < 1.0 { ends[0] + (ends[1] - ends[0]) * whole } else { ends[1] }
        };
        let step = (ends[1] - ends[0]) / count as f64 * length;
        for n in 0..count {
            let [from, middle, to] = [0.0, 0.5, 1.0].map(|half| part_of(n, half));
            let there = at(to).0;
            let [before, after] = [from, to].map(|part| share.moments(part * length)[0]);
            let given = after - before;
            let (_, place) = at(middle);
            let velocity = here.velocity + deviation.velocity;
            let stand = Stand { position: here.position + way, velocity };
            let free = velocity + (there.velocity - here.velocity) - light * given;
            let drive = Drive { turn: place.attitude, spin: place.spin, free, light };
            let (_, push) = bearing.step(&stand, &drive, step);
            is_touched |= push != Vector::zeros();
            let more = push - given;
            let faster = light * more;
            way += (deviation.velocity + faster * 0.5) * step;
            deviation.velocity += faster;
            impulse += more;
            integral += more * (length - middle * length);
            here = there;
        }
        if let Some(number) = INSTANTS.into_iter().position(|instant| instant == ends[1]) {
            deviation.ways[number - 1] = way;
        }
    }
    // What nothing touches is under no force, exactly.
    let line = match is_touched {
        true => {
            let [given, sum] = share.moments(length);
            Line::through([given + impulse, sum + integral], length)
        }
        false => Line::default(),
    };
    (line, deviation)
}

/// The same of a body that is in no soil any more, through a part of this length in s: it deviates by the force that is not there.
pub(crate) fn released((body, length): (&Body, f64), share: &Line) -> (Line, Deviation) {
    let mut deviation = Deviation::default();
    for (way, part) in deviation.ways.iter_mut().zip(&INSTANTS[1..]) {
        *way = -(body.light * share.moments(part * length)[1]);
    }
    deviation.velocity = -(body.light * share.moments(length)[0]);
    (Line::default(), deviation)
}
