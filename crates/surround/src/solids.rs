//! Bodies of a model that push its wind aside: where they are at any time.
//!
//! ```text
//! growth ──string at each instant──▶ turtle ──bodies, by lineage──▶ instants ──straight lines──▶ hulls at any time
//! ```
//!
//! What a solid module draws counts as the smallest convex body around it. Instants are parts of a tick, so results depend neither on frames nor
//! on the order of the times that are asked for.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_diagnostic::Span;
use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle::{self, Passive, SolidBody};
use dlsys_model::{Model, Units};
use dlsys_sim::{Settings, Simulation};
use dlsys_tree::ModuleString;
use dlsys_wind::{Hull, Obstacle};
use nalgebra::Vector3;

use crate::coupled;
use crate::descent::Descent;
use crate::motion::MOST_TICKS;
use crate::paths::Meets;
use crate::place::Place;
use crate::points::{Pair, RigidMotion, directions, outermost, rigid_motion};
use crate::{CLOCK, Error};

/// Instants in a tick.
const PARTS: f64 = 4.0;
/// Most bodies at one instant: each place in the wind is compared with all of them.
pub(crate) const MOST_BODIES: usize = 1000;
/// Most points of the instants that are kept, each of which counts as one more.
const MOST_KEPT: usize = 200_000;
/// Directions in which the outermost point of a body with many points is a corner of its hull.
const DIRECTIONS: usize = 64;
/// The least radius by which a hull is rounded, in parts of its extent: the flow around a sharp edge has no velocity.
const ROUNDING: f64 = 0.02;
/// Points that stand for a ball that is larger than the rounding.
const BALL_POINTS: usize = 32;

/// The bodies of a model at any time.
pub(crate) struct Solids<'m> {
    model: &'m Model,
    settings: Settings,
    place: Place,
    track: Mutex<Option<Track<'m>>>,
}

/// A run of growth, and the bodies at its last instants.
struct Track<'m> {
    growth: Simulation<'m>,
    scene: Scene,
    string: ModuleString,
    /// The number of the first instant that is kept.
    first: u64,
    kept: VecDeque<Vec<Body>>,
    /// The sum of the sizes of those kept.
    size: usize,
    /// Time that it has taken so far.
    spent: Duration,
}

/// A body at an instant.
#[derive(Clone)]
struct Body {
    /// The module.
    id: u64,
    /// Its place among the bodies of the instant before, if it was there.
    before: Option<usize>,
    /// Number of points of its drawing, and those of them that are corners.
    drawn: usize,
    chosen: Arc<[usize]>,
    /// The corners in m, with radii.
    points: Vec<(Vector3<f64>, f64)>,
}

impl<'m> Solids<'m> {
    /// `None` for a model that declares none.
    ///
    /// # Errors
    /// A model whose rules read `strain`.
    pub(crate) fn new(model: &'m Model, settings: Settings) -> Result<Option<Solids<'m>>, Error> {
        let Some((_, span)) = model.scenery.solids.first() else { return Ok(None) };
        if model.reads_strain() {
            return Err(Error::SolidInLoop { span: *span });
        }
        let settings = Settings { log: true, transitions: false, ..settings };
        let place = Place::of_scene(&model.scenery);
        Ok(Some(Solids { model, settings, place, track: Mutex::default() }))
    }

    /// The bodies at a time in s.
    ///
    /// # Errors
    /// The growth up to that time fails or takes too long, or a body cannot be one.
    pub(crate) fn at(&self, seconds: f64) -> Result<Vec<Arc<dyn Obstacle>>, Error> {
        let hulls = self.hulls(seconds)?.into_iter();
        Ok(hulls.map(|hull| Arc::new(hull) as Arc<dyn Obstacle>).collect())
    }

    /// The same as hulls.
    pub(crate) fn hulls(&self, seconds: f64) -> Result<Vec<Hull>, Error> {
        let place = (seconds / CLOCK * PARTS).max(0.0);
        if place > MOST_TICKS * PARTS {
            let Units { time: second, .. } = self.place.units;
            let time = self.place.time_at(seconds);
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds: second, span: self.span() });
        }
        let (number, part) = (place as u64, place.fract());
        let mut track = self.track.lock().unwrap_or_else(PoisonError::into_inner);
        if track.as_ref().is_none_or(|track| number < track.first) {
            let growth = coupled::start(self.model, self.settings, self.place)?;
            let (scene, string) = (turtle::blank(self.model), ModuleString::default());
            let (kept, spent) = (VecDeque::new(), track.as_ref().map_or(Duration::ZERO, |track| track.spent));
            *track = Some(Track { growth, scene, string, first: 0, kept, size: 0, spent });
        }
        let Some(track) = track.as_mut() else { return Ok(Vec::new()) };
        track.go_to(self, number)?;
        // Where growth ends soon after the time that is asked for, bodies stay where they are until then.
        let goes_on = track.go_to(self, number + 1).is_ok();
        let at = |number: u64| &track.kept[(number - track.first) as usize];
        let (here, empty) = (at(number), Vec::new());
        let next = if goes_on { at(number + 1) } else { &empty };
        let mut ends: Vec<Option<&Body>> = vec![None; here.len()];
        for body in next {
            if let Some(before) = body.before {
                ends[before].get_or_insert(body);
            }
        }
        Ok(here.iter().zip(ends).filter_map(|(body, end)| body.hull(end, part)).collect())
    }

    /// The first name in the declaration.
    fn span(&self) -> Span {
        self.model.scenery.solids.first().map(|(_, span)| *span).unwrap_or_default()
    }
}

impl Track<'_> {
    /// Goes on until an instant is kept, and keeps at least two.
    fn go_to(&mut self, solids: &Solids, number: u64) -> Result<(), Error> {
        // Without a limit the clock is not asked.
        let limit = solids.settings.max_seconds;
        while self.first + self.kept.len() as u64 <= number {
            let next = self.first + self.kept.len() as u64;
            let time = solids.place.time_at(next as f64 * (CLOCK / PARTS));
            let begun = limit.is_finite().then(Instant::now);
            self.growth.at(time.max(0.0), &mut self.string)?;
            let mut descent = Descent::default();
            descent.add(solids.model, &self.growth.take_events());
            let bodies = self.bodies(solids, &descent)?;
            self.size += size(&bodies);
            self.kept.push_back(bodies);
            while self.size > MOST_KEPT && self.kept.len() > 3 {
                self.size -= self.kept.pop_front().map_or(0, |past| size(&past));
                self.first += 1;
            }
            self.spent += begun.map_or(Duration::ZERO, |begun| begun.elapsed());
            if self.spent.as_secs_f64() > limit {
                return Err(Error::OutOfTime { limit, time, span: solids.span() });
            }
        }
        Ok(())
    }

    /// The bodies of the present string.
    fn bodies(&mut self, solids: &Solids, descent: &Descent) -> Result<Vec<Body>, Error> {
        let is_solid = |module: dlsys_tree::Module| {
            solids.model.scenery.solids.iter().any(|(kind, _)| *kind == module.kind)
        };
        if !self.string.iter().any(is_solid) {
            return Ok(Vec::new());
        }
        let drawn = turtle::solids(solids.model, &self.string, &mut self.scene)?;
        let past = self.kept.back();
        let known: HashMap<u64, usize> =
            past.into_iter().flatten().enumerate().map(|(i, body)| (body.id, i)).collect();
        if drawn.len() > MOST_BODIES {
            let span = self.span(solids, &drawn[MOST_BODIES]);
            let meets = Meets::Wind;
            return Err(Error::TooManySolids { most: MOST_BODIES, time: self.string.time, meets, span });
        }
        let mut bodies = Vec::with_capacity(drawn.len());
        for solid in &drawn {
            if let Some(passive) = solid.passive {
                let kind = solids.model.kinds.get(solid.origin.kind).name.clone();
                let (span, lineage) = (self.span(solids, solid), solid.origin.lineage);
                let falls = passive == Passive::Falls;
                let meets = Meets::Wind;
                return Err(Error::PassiveSolid {
                    kind,
                    lineage,
                    falls,
                    meets,
                    time: self.string.time,
                    span,
                });
            }
            let id = solid.origin.lineage.id;
            let before = descent.line(id).find_map(|id| known.get(&id).copied());
            let past = before.and_then(|before| past?.get(before));
            bodies.push(Body::new((id, before), solid, past, &solids.place));
        }
        Ok(bodies)
    }

    /// The declaration of a body.
    fn span(&self, solids: &Solids, solid: &SolidBody) -> Span {
        let mut declared = solids.model.scenery.solids.iter();
        declared.find(|(kind, _)| *kind == solid.origin.kind).map(|(_, span)| *span).unwrap_or_default()
    }
}

/// Points of the bodies of an instant, and one for itself.
fn size(bodies: &[Body]) -> usize {
    1 + bodies.iter().map(|body| body.points.len()).sum::<usize>()
}

impl Body {
    fn new(
        (id, before): (u64, Option<usize>),
        solid: &SolidBody,
        past: Option<&Body>,
        place: &Place,
    ) -> Body {
        let metre = place.units.length;
        let at = |(point, radius): &(dlsys_geometry::scene::Point, f64)| {
            (place.point(point.coords * metre), radius * metre)
        };
        let all: Vec<(Vector3<f64>, f64)> = solid.points.iter().map(at).collect();
        // Corners stay the same points of the drawing as long as it has as many of them.
        let chosen = match past.filter(|past| past.drawn == all.len()) {
            Some(past) => Arc::clone(&past.chosen),
            None => corners(&all),
        };
        let points = chosen.iter().map(|i| all[*i]).collect();
        Body { id, before, drawn: all.len(), chosen, points }
    }

    /// The hull on the way to another instant, with its motion.
    fn hull(&self, end: Option<&Body>, part: f64) -> Option<Hull> {
        let end = end.filter(|end| end.points.len() == self.points.len() && end.drawn == self.drawn);
        let Some(end) = end else { return hull(&self.points) };
        let pairs = || self.points.iter().zip(&end.points);
        let between: Vec<(Vector3<f64>, f64)> =
            pairs().map(|((a, r), (b, s))| (a.lerp(b, part), r + (s - r) * part)).collect();
        let rate = PARTS / CLOCK;
        let moved: Vec<Pair> =
            pairs().zip(&between).map(|(((a, _), (b, _)), (p, _))| (*p, (b - a) * rate)).collect();
        let hull = hull(&between)?;
        let RigidMotion { velocity, spin, .. } = rigid_motion(&moved, hull.centre(0.0));
        Some(hull.moving(velocity, spin))
    }
}

/// The hull of balls.
fn hull(balls: &[(Vector3<f64>, f64)]) -> Option<Hull> {
    let (points, rounding) = rounded(balls);
    Hull::new(points, rounding)
}

/// The hull of balls as points with one radius. Balls that are larger than the smallest one are points all around them.
pub(crate) fn rounded(balls: &[(Vector3<f64>, f64)]) -> (Vec<Vector3<f64>>, f64) {
    let count = balls.len() as f64;
    let middle = balls.iter().map(|(point, _)| point).sum::<Vector3<f64>>() / count;
    let extent = balls.iter().map(|(p, radius)| (p - middle).norm() + radius).fold(0.0, f64::max);
    let least = balls.iter().map(|(_, radius)| *radius).fold(f64::INFINITY, f64::min);
    let rounding = least.max(ROUNDING * extent);
    let mut points = Vec::with_capacity(balls.len());
    for (centre, radius) in balls {
        if *radius <= rounding * (1.0 + 1e-9) {
            points.push(*centre);
        } else {
            points.extend(directions(BALL_POINTS).map(|way| centre + way * (radius - rounding)));
        }
    }
    (points, rounding)
}

/// The points of a drawing that are corners of its hull: all of them if they are few, otherwise the outermost ones in directions all around.
pub(crate) fn corners(points: &[(Vector3<f64>, f64)]) -> Arc<[usize]> {
    if points.len() <= DIRECTIONS {
        return (0..points.len()).collect();
    }
    let mut chosen = outermost(points, directions(DIRECTIONS));
    chosen.sort_unstable();
    chosen.into()
}
