//! Solids of a model on their way through a tick: the shapes that sheets meet, and where they are.
//!
//! What a solid module draws counts as the smallest convex body around it. Its place is a polynomial of degree 3 through the drawings at four instants,
//! so that motion under a force that is linear in time is exact.

use std::collections::HashMap;

use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle::{self, Origin, Passive};
use dlsys_model::Model;
use dlsys_sheet::{Attitude, Place as Stand, Shape, Vector};
use dlsys_solid::Path as Course;
use dlsys_tree::ModuleString;

use crate::Error;
use crate::descent::Descent;
use crate::place::Place;
use crate::points::{Pair, rigid_motion};
use crate::solids::{MOST_BODIES, corners, rounded};

/// The instants of a tick, or of a part of one, at which solids are drawn, in parts of it.
pub(crate) const INSTANTS: [f64; 4] = Course::INSTANTS;
/// Most iterations to find a rotation, each of which squares the error.
const ITERATIONS: usize = 8;

/// What meets solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meets {
    /// The wind, which they push.
    Wind,
    /// Sheets.
    Sheets,
    /// What is let go.
    Falling,
}

impl Meets {
    /// What bodies do with it.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Meets::Wind => "push the wind",
            Meets::Sheets => "meet sheets",
            Meets::Falling => "be in the way of what falls",
        }
    }
}

/// A solid on its way through a tick.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    /// The module that draws it where the path begins.
    pub(crate) origin: Origin,
    pub(crate) shape: Shape,
    /// It is not drawn at the end, or elsewhere: a production has taken its place.
    pub(crate) is_gone: bool,
    course: Course,
}

impl Path {
    /// Adds ways at the instants, in m.
    pub(crate) fn deviate(&mut self, ways: [Vector; 4]) {
        self.course.deviate(ways);
    }

    /// Where it is at a time in s.
    pub(crate) fn place(&self, time: f64) -> Stand {
        self.course.place(time)
    }
}

/// A solid through a tick, as what falls meets it.
pub(crate) struct Body {
    /// The module that draws it where the tick begins.
    pub(crate) module: u64,
    /// The diagonal of the box around it, in m.
    pub(crate) diagonal: f64,
    pub(crate) parts: Vec<Shape>,
    pub(crate) path: Course,
}

/// A solid as it is drawn at an instant, in m.
#[derive(Clone)]
struct Drawn {
    origin: Origin,
    balls: Vec<(Vector, f64)>,
}

impl Drawn {
    /// The diagonal of the box around it.
    fn diagonal(&self) -> f64 {
        let first = self.balls.first().map_or(Vector::zeros(), |(point, _)| *point);
        let (low, high) = self.balls.iter().fold((first, first), |(low, high), (point, radius)| {
            (low.inf(&point.add_scalar(-radius)), high.sup(&point.add_scalar(*radius)))
        });
        (high - low).norm()
    }
}

/// The solids of a tick so far.
#[derive(Clone, Default)]
pub(crate) struct Watch {
    first: Vec<Drawn>,
    /// The drawings at the other instants; `None` where there is none of as many points.
    later: Vec<[Option<Vec<Vector>>; 3]>,
    /// The module that drew each solid last.
    modules: Vec<u64>,
}

impl Watch {
    /// Notes the solids of a string at an instant, by its number. `descent` has the productions since the first one.
    pub(crate) fn note(
        &mut self,
        (instant, string): (usize, &ModuleString),
        (model, place): (&Model, &Place),
        (descent, meets): (&Descent, Meets),
        scene: &mut Scene,
    ) -> Result<(), Error> {
        let is_solid =
            |module: dlsys_tree::Module| model.scenery.solids.iter().any(|(kind, _)| *kind == module.kind);
        if !string.iter().any(is_solid) {
            return Ok(());
        }
        let mut drawn = Vec::new();
        for solid in turtle::solids(model, string, scene)? {
            let span = || {
                let mut declared = model.scenery.solids.iter();
                declared
                    .find(|(kind, _)| *kind == solid.origin.kind)
                    .map(|(_, span)| *span)
                    .unwrap_or_default()
            };
            if let Some(passive) = solid.passive {
                let kind = model.kinds.get(solid.origin.kind).name.clone();
                let falls = passive == Passive::Falls;
                let lineage = solid.origin.lineage;
                return Err(Error::PassiveSolid {
                    kind,
                    lineage,
                    falls,
                    meets,
                    time: string.time,
                    span: span(),
                });
            }
            if drawn.len() == MOST_BODIES {
                return Err(Error::TooManySolids {
                    most: MOST_BODIES,
                    time: string.time,
                    meets,
                    span: span(),
                });
            }
            let metre = place.units.length;
            let ball = |(point, radius): &(dlsys_geometry::scene::Point, f64)| {
                (place.point(point.coords * metre), radius * metre)
            };
            drawn.push(Drawn { origin: solid.origin, balls: solid.points.iter().map(ball).collect() });
        }
        if instant == 0 {
            self.later = vec![Default::default(); drawn.len()];
            self.modules = drawn.iter().map(|solid| solid.origin.lineage.id).collect();
            self.first = drawn;
            return Ok(());
        }
        let known: HashMap<u64, usize> =
            self.first.iter().enumerate().map(|(i, solid)| (solid.origin.lineage.id, i)).collect();
        for solid in drawn {
            let first = descent.line(solid.origin.lineage.id).find_map(|id| known.get(&id));
            let first = first.filter(|first| self.first[**first].balls.len() == solid.balls.len());
            if let Some(&first) = first.filter(|first| !self.is_put_elsewhere(**first, &solid)) {
                let points = solid.balls.iter().map(|(point, _)| *point).collect();
                self.later[first][instant - 1].get_or_insert(points);
                self.modules[first] = solid.origin.lineage.id;
            }
        }
        Ok(())
    }

    /// Whether a production has put a solid of this number further away than the diagonal of the box around it: then it is lifted, and has not passed what is
    /// between. It is where it was until the tick is over.
    fn is_put_elsewhere(&self, number: usize, solid: &Drawn) -> bool {
        if self.modules[number] == solid.origin.lineage.id {
            return false;
        }
        let most = solid.diagonal();
        let moved =
            |ways: &mut dyn Iterator<Item = Vector>| ways.fold(0.0, |most: f64, way| most.max(way.norm()));
        let now = solid.balls.iter().map(|(point, _)| *point);
        let way = match self.later[number].iter().rev().flatten().next() {
            Some(points) => moved(&mut points.iter().zip(now).map(|(from, to)| to - from)),
            None => moved(&mut self.first[number].balls.iter().zip(now).map(|((from, _), to)| to - from)),
        };
        way > most
    }

    /// The solids of a tick as what falls meets them: sharp where they are drawn so.
    pub(crate) fn bodies(&self, begin: f64, length: f64) -> Vec<Body> {
        let body = |(first, later): (&Drawn, &[Option<Vec<Vector>>; 3])| {
            let (balls, middle, path) = course(first, later, (begin, length));
            let about: Vec<_> = balls.iter().map(|(point, radius)| (point - middle, *radius)).collect();
            let parts = dlsys_solid::parts(&about).ok()?;
            Some(Body { module: first.origin.lineage.id, diagonal: first.diagonal(), parts, path })
        };
        self.first.iter().zip(&self.later).filter_map(body).collect()
    }

    /// The ways of all solids through a tick that begins at a time and has a length, in s. What is not drawn at an instant stays where it was before.
    pub(crate) fn paths(&self, begin: f64, length: f64) -> Vec<Path> {
        self.first
            .iter()
            .zip(&self.later)
            .filter_map(|(first, later)| path(first, later, (begin, length)))
            .collect()
    }
}

fn path(first: &Drawn, later: &[Option<Vec<Vector>>; 3], span: (f64, f64)) -> Option<Path> {
    let (balls, middle, course) = course(first, later, span);
    let (points, radius) = rounded(&balls);
    let shape = Shape::rounded(points.iter().map(|point| point - middle).collect(), radius).ok()?;
    Some(Path { origin: first.origin, shape, is_gone: later[2].is_none(), course })
}

/// The balls of a drawing that are corners, the middle of them, and its way.
fn course(
    first: &Drawn,
    later: &[Option<Vec<Vector>>; 3],
    span: (f64, f64),
) -> (Vec<(Vector, f64)>, Vector, Course) {
    let chosen = corners(&first.balls);
    let balls: Vec<(Vector, f64)> = chosen.iter().map(|i| first.balls[*i]).collect();
    let middle = balls.iter().map(|(point, _)| point).sum::<Vector>() / balls.len().max(1) as f64;
    let (mut centres, mut turns) = ([middle; 4], [Vector::zeros(); 4]);
    for k in 0..3 {
        (centres[k + 1], turns[k + 1]) = (centres[k], turns[k]);
        if let Some(there) = &later[k] {
            let pairs: Vec<Pair> = chosen.iter().map(|i| (first.balls[*i].0, there[*i])).collect();
            centres[k + 1] = pairs.iter().map(|(_, there)| there).sum::<Vector>() / pairs.len() as f64;
            turns[k + 1] = rotation(&pairs, [middle, centres[k + 1]], turns[k]);
        }
    }
    (balls, middle, Course::through(span, centres, turns))
}

/// The rotation vector that leads from places about one centre to places about another, as near as that is possible. `guess` is one for an instant before.
fn rotation(pairs: &[Pair], [from, to]: [Vector; 2], guess: Vector) -> Vector {
    let mut turn = Attitude::from_scaled_axis(guess);
    for _ in 0..ITERATIONS {
        let apart = |(here, there): &Pair| {
            let turned = turn * (here - from);
            (turned, (there - to) - turned)
        };
        let moved: Vec<Pair> = pairs.iter().map(apart).collect();
        let more = rigid_motion(&moved, Vector::zeros()).spin;
        turn = Attitude::from_scaled_axis(more) * turn;
        if more.norm() < 1e-12 {
            break;
        }
    }
    turn.scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_model::KindId;
    use dlsys_tree::Lineage;

    /// A cube that turns and flies along a parabola.
    #[test]
    fn a_path_is_that_of_the_drawings() {
        let corner = |k: usize| Vector::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64) * 0.2;
        let middle = Vector::repeat(0.1);
        let (v, a, w) =
            (Vector::new(1.0, 2.0, -0.5), Vector::new(0.0, -9.81, 0.0), Vector::new(3.0, -20.0, 5.0));
        let at = |t: f64, k: usize| {
            middle + v * t + a * (t * t / 2.0) + Attitude::from_scaled_axis(w * t) * (corner(k) - middle)
        };
        let length = 1.0 / 64.0;
        let points = |t: f64| (0..8).map(|k| at(t, k)).collect::<Vec<_>>();
        let origin = Origin::new(KindId::OPEN, Lineage::of_axiom(0));
        let first = Drawn { origin, balls: points(0.0).into_iter().map(|point| (point, 0.0)).collect() };
        let later = [1, 2, 3].map(|k| Some(points(length * INSTANTS[k])));
        let path = path(&first, &later, (2.0, length)).expect("a body");
        for part in [0.0, 0.4, 1.0] {
            let (t, place) = (length * part, path.place(2.0 + length * part));
            assert!((place.position - (middle + v * t + a * (t * t / 2.0))).norm() < 1e-12);
            assert!((place.velocity - (v + a * t)).norm() < 1e-10);
            assert!((place.spin - w).norm() < 1e-7, "{}", place.spin);
            assert!((place.attitude * (corner(5) - middle) + place.position - at(t, 5)).norm() < 1e-12);
        }
    }
}
