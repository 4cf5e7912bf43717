//! The parts of a string that have been let go, and where they are: each a pure function of its release.
//!
//! A release is found when growth passes the production that makes the module. The part then has the pose in which the branch holds
//! it, and the velocity that it has there: both from two drawings, the second a little later, as if the branch still held it. So
//! growth, stems in the wind, and other flights give their motion to what they let go. On its way it meets the solids of the scene and its soil.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use dlsys_fall::{self as fall, Attitude, Fall, Ground};
use dlsys_geometry::scene::{Point, Scene};
use dlsys_geometry::turtle::{self, FreePart, Origin, PartKey, Pose, StemKey};
use dlsys_model::{KindId, Model, Successor};
use dlsys_sim::Event;
use dlsys_sway::{Matrix, Vector};
use dlsys_tree::{Module, ModuleString};

use crate::Error;
use crate::bending::BentStems;
use crate::body::rotation_vector;
use crate::descent::Descent;
use crate::loose::{Loose, stand};
use crate::place::Place;
use crate::points::{Pair, rigid_motion};
use crate::sampler::{Gusts, Sampler};

/// Most parts that one model may let go.
const MOST_PARTS: usize = 100_000;
/// Steps of the first flights that are kept for going back, and of one; the n-th has an n-th part of them.
const MOST_STEPS: usize = 40_000;
const MOST_STEPS_OF_ONE: usize = 4000;
/// Seconds by which flights go on in turn: they read the same instants of the wind, few enough that all are kept until the last
/// one has read them.
const TURN: f64 = 1.0 / 8.0;

/// A part that has been let go.
#[derive(Debug)]
struct Release {
    /// When, in s.
    begin: f64,
    origin: Origin,
    /// Its flight; `None` if it has no mass and stays where it is.
    fall: Option<Fall>,
    /// The turtle's frame at the `@D` in the axes of the body: place relative to the centre of mass, and axes. In the scene, where there is no
    /// body.
    offset: Vector,
    axes: Matrix,
}

/// All parts that a model has let go.
pub(crate) struct Flights<'m> {
    /// The kinds that hold an `@D`.
    lets_go: Vec<bool>,
    /// Branches leave nothing behind: no polygon that is begun in one module has corners in others.
    prunes: bool,
    /// Where the drawing of a module is an interpretation, a part of it goes on in that which takes its place.
    parts: HashMap<PartKey, usize>,
    releases: Vec<Release>,
    /// The strains with which stems were let go, per unit of length, and when.
    frozen: Arc<Frozen>,
    wind: Arc<Sampler<'m>>,
    place: Place,
    settings: fall::Settings,
    scene: Scene,
    /// The time up to which flights have gone on in turn, in s.
    reached: f64,
}

/// Strains of stems that no longer give way, and since when, in s.
pub(crate) type Frozen = HashMap<StemKey, (f64, Vector)>;

/// Where the parts of a string are that have been let go.
#[derive(Clone, Debug, Default)]
pub(crate) struct Flown {
    pub(crate) poses: HashMap<PartKey, Pose>,
    pub(crate) frozen: Arc<Frozen>,
}

impl<'m> Flights<'m> {
    /// `None` for a model that lets go of nothing.
    pub(crate) fn new(
        model: &Model,
        wind: Arc<Sampler<'m>>,
        place: Place,
        tolerance: f64,
    ) -> Option<Flights<'m>> {
        let lets_go = turtle::kinds_that_let_go(model);
        let settings = fall::Settings { tolerance: tolerance.clamp(1e-12, 0.1), ..Default::default() };
        lets_go.contains(&true).then(|| Flights {
            lets_go,
            prunes: !has_open_polygons(model),
            parts: HashMap::new(),
            releases: Vec::new(),
            frozen: Arc::default(),
            wind,
            place,
            settings,
            scene: turtle::blank(model),
            reached: f64::INFINITY,
        })
    }

    /// True if a production may let go of something.
    pub(crate) fn is_release(&self, model: &Model, event: &Event) -> bool {
        let successors = &model.rules[event.rule].produces[event.clause].outcome.successors;
        successors.iter().any(|successor| successor.kinds().any(|kind| self.lets_go[kind.index()]))
    }

    /// The modules of a string that may let go of something, and that are not known, by [`id`](dlsys_tree::Lineage::id). Flights of modules
    /// that a production has replaced go on in those that take their place.
    pub(crate) fn news(&mut self, model: &Model, string: &ModuleString, descent: &Descent) -> HashSet<u64> {
        let mut news = HashSet::new();
        for module in string.iter().filter(|module| self.lets_go[module.kind.index()]) {
            let id = module.lineage.id;
            if self.parts.contains_key(&PartKey { module: id, number: 0 }) {
                continue;
            }
            // A plain `@D` begins a part; it has not been drawn as one before.
            let is_drawn = model.kinds.get(module.kind).interpretation.is_some();
            let before = descent.line(id).skip(1).filter(|_| is_drawn);
            let known =
                before.map(|module| PartKey { module, number: 0 }).find(|key| self.parts.contains_key(key));
            let Some(known) = known else {
                news.insert(id);
                continue;
            };
            for number in 0.. {
                let Some(&release) = self.parts.get(&PartKey { number, ..known }) else { break };
                self.parts.insert(PartKey { module: id, number }, release);
            }
        }
        news
    }

    /// The string without the branches in which none of these modules is. They are drawn alike in it, and at a small part of the cost.
    pub(crate) fn way_to(&self, string: &ModuleString, modules: &HashSet<u64>) -> ModuleString {
        if !self.prunes {
            return string.clone();
        }
        pruned(string, |module| modules.contains(&module.lineage.id))
    }

    /// The parts of a string that are not known.
    pub(crate) fn new_parts(
        &mut self,
        model: &Model,
        string: &ModuleString,
        strains: &BentStems,
    ) -> Result<Vec<FreePart>, Error> {
        let mut parts = turtle::free_parts(model, string, strains, &mut self.scene)?;
        parts.retain(|part| !self.parts.contains_key(&part.key));
        Ok(parts)
    }

    /// Lets go of parts of a string, where the same ones, if the branch still held them, are elsewhere a little later. Times are in s.
    pub(crate) fn let_go(
        &mut self,
        model: &Model,
        (news, strains): (Vec<FreePart>, &BentStems),
        later: &[FreePart],
        [time, after]: [f64; 2],
    ) -> Result<(), Error> {
        let later: HashMap<PartKey, &FreePart> = later.iter().map(|part| (part.key, part)).collect();
        for part in news {
            let place = self.place;
            let failed =
                |error: fall::Error| Error::falling(model, &part.origin, None, (error, place.time_at(time)));
            let here = stand(&part, &place);
            let there = later.get(&part.key).copied();
            let loose = Loose::of(&part, model, &place).map_err(failed)?;
            let release = match loose {
                Some(loose) => {
                    let motion = motion(&loose, &part, there, &place, after - time);
                    let (offset, axes) = (
                        loose.attitude.inverse_transform_vector(&(here.0 - loose.centre)),
                        loose.attitude.inverse().to_rotation_matrix().into_inner() * here.1,
                    );
                    let ground = place.ground.map(Ground::at);
                    let mut fall =
                        Fall::new(loose.body, motion, time, ground, self.settings).map_err(failed)?;
                    // For files that play, whose times go to and fro.
                    fall.keep_steps((MOST_STEPS / (self.releases.len() + 1)).min(MOST_STEPS_OF_ONE));
                    Release { begin: time, origin: part.origin, fall: Some(fall), offset, axes }
                }
                None => {
                    Release { begin: time, origin: part.origin, fall: None, offset: here.0, axes: here.1 }
                }
            };
            if self.releases.len() >= MOST_PARTS {
                let span = part.origin.span(model);
                return Err(Error::TooManyParts { most: MOST_PARTS, time: place.time_at(time), span });
            }
            for stem in &part.stems {
                let strain = turtle::Strains::strain(strains, stem.key, stem.width);
                if strain != Vector::zeros() {
                    Arc::make_mut(&mut self.frozen).insert(stem.key, (time, strain));
                }
            }
            self.parts.insert(part.key, self.releases.len());
            self.releases.push(release);
            self.reached = self.reached.min(time);
        }
        Ok(())
    }

    /// Where the parts of a string are; all that it has let go goes on in turn.
    pub(crate) fn poses(&mut self, model: &Model, string: &ModuleString) -> Result<Flown, Error> {
        let keys = self.keys(string);
        self.advance(model, &keys, self.place.seconds(string.time))?;
        self.flown(model, string)
    }

    /// Where the parts of a string are.
    pub(crate) fn flown(&mut self, model: &Model, string: &ModuleString) -> Result<Flown, Error> {
        let time = self.place.seconds(string.time);
        let mut poses = HashMap::new();
        for (key, release) in self.keys(string) {
            poses.insert(key, self.pose(model, release, time)?);
        }
        Ok(Flown { poses, frozen: Arc::clone(&self.frozen) })
    }

    /// The parts of a string that are known, with the numbers of their releases.
    fn keys(&self, string: &ModuleString) -> Vec<(PartKey, usize)> {
        let mut keys = Vec::new();
        if self.releases.is_empty() {
            return keys;
        }
        for module in string.iter().filter(|module| self.lets_go[module.kind.index()]) {
            let of = |number| PartKey { module: module.lineage.id, number };
            keys.extend((0..).map(of).map_while(|key| Some((key, *self.parts.get(&key)?))));
        }
        keys
    }

    /// The times at which what flies was jolted, so far, in units of the model.
    pub(crate) fn jolts(&self) -> impl Iterator<Item = f64> {
        let falls = self.releases.iter().filter_map(|release| release.fall.as_ref());
        falls.flat_map(|fall| fall.jolts()).map(|seconds| self.place.time_at(*seconds))
    }

    /// Lets flights go on in turn.
    fn advance(&mut self, model: &Model, keys: &[(PartKey, usize)], time: f64) -> Result<(), Error> {
        let flies = |release: &Release| release.fall.as_ref().is_some_and(|fall| fall.rest().is_none());
        let mut flying: Vec<usize> =
            keys.iter().map(|(_, i)| *i).filter(|i| flies(&self.releases[*i])).collect();
        let mut turn = self.reached.min(time);
        while !flying.is_empty() {
            let first = flying.iter().map(|i| self.releases[*i].begin).fold(f64::INFINITY, f64::min);
            turn = ((turn.max(first) / TURN).floor() + 1.0) * TURN;
            if turn >= time {
                break;
            }
            for &i in &flying {
                self.pose(model, i, turn)?;
            }
            flying.retain(|i| flies(&self.releases[*i]));
        }
        self.reached = time;
        Ok(())
    }

    /// Where the turtle stands at the `@D` of a part, in the model's axes and units.
    fn pose(&mut self, model: &Model, release: usize, time: f64) -> Result<Pose, Error> {
        let place = self.place;
        let Release { origin, fall, offset, axes, .. } = &mut self.releases[release];
        let (position, axes) = match fall {
            None => (*offset, *axes),
            Some(fall) => {
                let gusts = Gusts(&self.wind);
                let among = self.wind.in_the_way();
                let moved = fall.among(time, &gusts, &among).map_err(|error| {
                    // An earlier failure of solids is not the reason of another one.
                    let of_solids = matches!(error, fall::Error::Solids { .. });
                    let known = if of_solids { among.failure() } else { None };
                    let failed =
                        Error::falling(model, origin, Some(fall.body()), (error, place.time_at(time)));
                    known.or_else(|| self.wind.failure()).unwrap_or(failed)
                })?;
                (moved.point(*offset), moved.attitude.to_rotation_matrix().into_inner() * *axes)
            }
        };
        let inverse = place.turn.transpose();
        let position = Point::from(inverse * (position - place.origin.coords) / place.units.length);
        let axes = inverse * axes;
        Ok(Pose { position, axes: [0, 1, 2].map(|k| axes.column(k).into_owned()) })
    }
}

/// A string without the branches in which no module is needed.
pub(crate) fn pruned(string: &ModuleString, is_needed: impl Fn(Module) -> bool) -> ModuleString {
    // Places of the brackets that are open, with the length that the list of places had before each.
    let mut kept: Vec<usize> = Vec::new();
    let mut open: Vec<(usize, bool)> = Vec::new();
    for (place, module) in string.iter().enumerate() {
        match module.kind {
            KindId::OPEN => open.push((kept.len(), false)),
            _ if !module.kind.is_bracket() && is_needed(module) => {
                open.iter_mut().for_each(|(_, needed)| *needed = true);
            }
            _ => {}
        }
        kept.push(place);
        if module.kind == KindId::CLOSE
            && let Some((before, false)) = open.pop()
        {
            kept.truncate(before);
        }
    }
    let mut way = ModuleString::default();
    way.reset(string.time);
    way.set_run_limit(string.drawn_limit());
    for module in kept.into_iter().map(|place| string.get(place)) {
        way.push(module.kind, module.parameters.iter().copied(), module.age, module.lineage);
    }
    way
}

/// True if a polygon may be open where a module ends.
pub(crate) fn has_open_polygons(model: &Model) -> bool {
    let count = |string: &Successor, name: &str| {
        string.kinds().filter(|kind| model.kinds.get(*kind).name == name).count()
    };
    let is_odd = |string: &Successor| count(string, "{") != count(string, "}");
    let of_rules = model.rules.iter().flat_map(|rule| &rule.produces).flat_map(|p| &p.outcome.successors);
    let grown = std::iter::once(&model.axiom).chain(of_rules);
    let mut drawn = model.interpretations.iter().map(|interpretation| &interpretation.drawn);
    grown.into_iter().any(|string| count(string, "{") > 0) || drawn.any(is_odd)
}

/// The motion of a body at its release, from where the part is then and a little later.
fn motion(
    loose: &Loose,
    here: &FreePart,
    there: Option<&FreePart>,
    place: &Place,
    seconds: f64,
) -> fall::Motion {
    let attitude: Attitude = loose.attitude;
    let moves = |(velocity, spin): (Vector, Vector)| fall::Motion {
        position: loose.centre,
        velocity,
        attitude,
        spin: attitude.inverse_transform_vector(&spin),
    };
    let Some(there) = there else { return moves((Vector::zeros(), Vector::zeros())) };
    let [before, after] = [here, there].map(|part| stand(part, place));
    let turn = after.1 * before.1.transpose();
    let centre = after.0 + turn * (loose.centre - before.0);
    let rigid = ((centre - loose.centre) / seconds, rotation_vector(&turn) / seconds);
    let bends = !here.stems.is_empty() && here.points.len() == there.points.len();
    let followed = || mean_motion(loose, here, there, place, seconds);
    moves(if bends { followed().unwrap_or(rigid) } else { rigid })
}

/// The velocity and the spin of the rigid motion that is nearest to that of the points of a part whose stems bend (least squares). `None`
/// if the points are in one line.
fn mean_motion(
    loose: &Loose,
    here: &FreePart,
    there: &FreePart,
    place: &Place,
    seconds: f64,
) -> Option<(Vector, Vector)> {
    let at = |point: &Point| place.point(point.coords * place.units.length);
    let pairs = here
        .points
        .iter()
        .zip(&there.points)
        .map(|((from, _), (to, _))| (at(from), (at(to) - at(from)) / seconds));
    let found = rigid_motion(&pairs.collect::<Vec<Pair>>(), loose.centre);
    found.is_determined.then_some((found.velocity, found.spin))
}
