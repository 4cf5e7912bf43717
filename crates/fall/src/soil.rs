//! Ground whose surface is a height field: triangles between columns, and where a body faces them.
//!
//! A square of four columns is two triangles, divided along the diagonal whose ends differ less in height. Their upper sides touch. A place on an edge or a corner
//! touches only in directions in which the triangles around it are nowhere higher, so a body slides over edges between triangles in one plane as over the plane.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use dlsys_solid::Shape;

use crate::approach::{Front, Touch, pass_by};
use crate::error::check;
use crate::fall::Rules;
use crate::manifold::{Apart, Ridge, ridges};
use crate::pairs::SKIN;
use crate::step::Step;
use crate::{Error, Motion, Surface, Vector};

/// Most columns below a body.
pub(crate) const MOST_COLUMNS: i64 = 250_000;
/// Rounding of places in parts of a cell.
const ROUNDING: f64 = 1e-9;

/// Heights of columns on a grid of squares.
pub trait Columns: fmt::Debug + Send + Sync {
    /// Distance of columns in m.
    fn cell(&self) -> f64;

    /// Height in m of the column at x = i·cell, z = k·cell.
    fn height(&self, i: i32, k: i32) -> f64;

    /// Bounds in m of the heights of columns from one to another along x and z.
    fn bounds(&self, x: [i32; 2], z: [i32; 2]) -> [f64; 2];
}

/// Ground that is a height field, at rest.
#[derive(Clone, Debug)]
pub struct Soil {
    /// Its columns.
    pub columns: Arc<dyn Columns>,
    /// How it holds what touches it.
    pub surface: Surface,
}

impl Soil {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let cell = self.columns.cell();
        check("a distance of columns (m)", cell, cell > 0.0, "more than 0")?;
        self.surface.check()
    }
}

/// Heights of columns above which soil does not count for a body, because it has come onto the body: columns from one to another, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Hollow {
    x: [i32; 2],
    z: [i32; 2],
    heights: Vec<f64>,
}

impl Hollow {
    pub(crate) fn is_empty(&self) -> bool {
        self.heights.is_empty()
    }

    fn of(x: [i32; 2], z: [i32; 2], height: impl Fn(i32, i32) -> f64) -> Hollow {
        let columns = (z[0]..=z[1]).flat_map(|k| (x[0]..=x[1]).map(move |i| (i, k)));
        Hollow { x, z, heights: columns.map(|(i, k)| height(i, k)).collect() }
    }

    fn get(&self, i: i32, k: i32) -> Option<f64> {
        let is_in = |at: i32, [from, to]: [i32; 2]| (from..=to).contains(&at);
        if self.is_empty() || !is_in(i, self.x) || !is_in(k, self.z) {
            return None;
        }
        let row = (self.x[1] - self.x[0]) as usize + 1;
        self.heights.get((k - self.z[0]) as usize * row + (i - self.x[0]) as usize).copied()
    }
}

/// The soil as a body meets it.
#[derive(Clone, Debug)]
pub(crate) struct Relief {
    pub(crate) soil: Soil,
    pub(crate) hollow: Arc<Hollow>,
    /// Heights near the body as it meets them, computed once.
    pub(crate) near: Hollow,
}

/// A triangle, with its normal upward.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    pub(crate) corners: [Vector; 3],
    pub(crate) up: Vector,
}

impl Face {
    fn new(corners: [Vector; 3]) -> Face {
        let [a, b, c] = corners;
        Face { corners, up: (b - a).cross(&(c - a)).normalize() }
    }

    /// The weights of the corners at a place in plan.
    fn weights(&self, x: f64, z: f64) -> [f64; 3] {
        let [a, b, c] = &self.corners;
        let across = |p: &Vector, q: &Vector| (p.x - x) * (q.z - z) - (p.z - z) * (q.x - x);
        let parts = [across(b, c), across(c, a), across(a, b)];
        let whole: f64 = parts.iter().sum();
        parts.map(|part| part / whole)
    }

    /// Whether a place in plan is within it, up to rounding.
    pub(crate) fn holds(&self, x: f64, z: f64) -> bool {
        self.weights(x, z).iter().all(|weight| *weight >= -ROUNDING)
    }

    /// How far the lowest of some points is above its plane.
    pub(crate) fn lowest(&self, points: &[Vector]) -> f64 {
        points.iter().map(|point| -self.depth(point)).fold(f64::INFINITY, f64::min)
    }

    /// False for most points that are not within a distance.
    fn is_near(&self, point: &Vector, distance: f64) -> bool {
        let within = |along: fn(&Vector) -> f64| {
            let [a, b, c] = [0, 1, 2].map(|k| along(&self.corners[k]));
            let at = along(point);
            at >= a.min(b).min(c) - distance && at <= a.max(b).max(c) + distance
        };
        self.depth(point).abs() <= distance && within(|place| place.x) && within(|place| place.z)
    }

    /// How far below it a point is along the normal; negative above.
    pub(crate) fn depth(&self, point: &Vector) -> f64 {
        (self.corners[0] - point).dot(&self.up)
    }
}

impl Relief {
    pub(crate) fn new(soil: Soil, hollow: Arc<Hollow>) -> Relief {
        Relief { soil, hollow, near: Hollow::default() }
    }

    /// With the heights of some columns at hand.
    pub(crate) fn with(self, [x, z]: [[i32; 2]; 2]) -> Relief {
        Relief { near: Hollow::of(x, z, |i, k| self.height(i, k)), ..self }
    }

    fn height(&self, i: i32, k: i32) -> f64 {
        self.near.get(i, k).unwrap_or_else(|| {
            let height = self.soil.columns.height(i, k);
            self.hollow.get(i, k).map_or(height, |hollow| height.min(hollow))
        })
    }

    /// The columns at the edges of the squares in which a stretch lies.
    fn columns(&self, from: f64, to: f64) -> [i32; 2] {
        let cell = self.soil.columns.cell();
        // Saturates.
        let low = libm::floor(from / cell - ROUNDING) as i32;
        [low, (libm::ceil(to / cell + ROUNDING) as i32).max(low.saturating_add(1))]
    }

    /// The columns around a place, within a distance.
    pub(crate) fn around(&self, centre: &Vector, radius: f64) -> [[i32; 2]; 2] {
        [centre.x, centre.z].map(|at| self.columns(at - radius, at + radius))
    }

    /// How many there are.
    pub(crate) fn count(&self, centre: &Vector, radius: f64) -> i64 {
        let [x, z] = self.around(centre, radius);
        let along = |[from, to]: [i32; 2]| i64::from(to) - i64::from(from) + 1;
        along(x).saturating_mul(along(z))
    }

    /// Lowest and highest of columns.
    pub(crate) fn bounds(&self, [x, z]: [[i32; 2]; 2]) -> [f64; 2] {
        let [low, high] = self.soil.columns.bounds(x, z);
        let lowest = self.hollow.heights.iter().copied().fold(low, f64::min);
        [lowest, high]
    }

    /// The columns as they are, or lower by a depth, as a limit for what comes onto them.
    pub(crate) fn hollow(&self, [x, z]: [[i32; 2]; 2], sunk: f64) -> Hollow {
        Hollow::of(x, z, |i, k| self.height(i, k) - sunk)
    }

    /// True if no column below what lies in it has got lower.
    pub(crate) fn holds(&self, hollow: &Hollow) -> bool {
        let columns =
            (hollow.z[0]..=hollow.z[1]).flat_map(|k| (hollow.x[0]..=hollow.x[1]).map(move |i| (i, k)));
        hollow.is_empty()
            || columns.zip(&hollow.heights).all(|((i, k), held)| self.soil.columns.height(i, k) >= *held)
    }

    /// The triangles of the square from a column on, counterclockwise from above.
    fn square(&self, i: i32, k: i32) -> [Face; 2] {
        let cell = self.soil.columns.cell();
        let corner =
            |i: i32, k: i32| Vector::new(f64::from(i) * cell, self.height(i, k), f64::from(k) * cell);
        let [a, b, c, d] = [corner(i, k), corner(i, k + 1), corner(i + 1, k + 1), corner(i + 1, k)];
        if (a.y - c.y).abs() <= (b.y - d.y).abs() {
            [Face::new([a, b, c]), Face::new([a, c, d])]
        } else {
            [Face::new([a, b, d]), Face::new([b, c, d])]
        }
    }

    /// The triangles of the squares that touch a rectangle.
    pub(crate) fn faces(&self, x: [f64; 2], z: [f64; 2]) -> impl Iterator<Item = Face> {
        let ([i0, i1], [k0, k1]) = (self.columns(x[0], x[1]), self.columns(z[0], z[1]));
        (k0..k1).flat_map(move |k| (i0..i1).flat_map(move |i| self.square(i, k)))
    }

    /// The triangle above or below a place.
    pub(crate) fn face(&self, x: f64, z: f64) -> Option<Face> {
        self.faces([x; 2], [z; 2]).find(|face| face.holds(x, z))
    }

    /// The height of the surface at a place.
    pub(crate) fn surface(&self, x: f64, z: f64) -> Option<f64> {
        let face = self.face(x, z)?;
        let weights = face.weights(x, z);
        Some(face.corners.iter().zip(weights).map(|(corner, weight)| corner.y * weight).sum())
    }

    /// How far a point is below the surface along the normal there; negative above.
    pub(crate) fn depth(&self, point: &Vector) -> Option<f64> {
        self.face(point.x, point.z).map(|face| face.depth(point))
    }

    /// True if the surface around a place of it is nowhere higher along a direction, up to a length.
    pub(crate) fn is_outward(&self, place: &Vector, normal: &Vector, most: f64) -> bool {
        let mut around = self.faces([place.x; 2], [place.z; 2]).filter(|face| face.holds(place.x, place.z));
        around.all(|face| face.corners.iter().all(|corner| (corner - place).dot(normal) <= most))
    }

    /// The triangles within a distance of the body, and some more.
    pub(crate) fn near<'a>(&self, rules: &'a Rules, motion: &Motion, more: f64) -> Cow<'a, [Face]> {
        match rules.close.as_ref().filter(|close| close.budget >= close.moved(rules, motion) + more) {
            Some(close) if self.is_of(rules) => Cow::Borrowed(&close.faces),
            _ => Cow::Owned(self.around_body(rules, motion, more)),
        }
    }

    /// It is the soil of the present step.
    fn is_of(&self, rules: &Rules) -> bool {
        rules.soil.as_ref().is_some_and(|soil| self.is_same(soil))
    }

    pub(crate) fn is_same(&self, other: &Relief) -> bool {
        Arc::ptr_eq(&self.soil.columns, &other.soil.columns) && Arc::ptr_eq(&self.hollow, &other.hollow)
    }

    pub(crate) fn around_body(&self, rules: &Rules, motion: &Motion, more: f64) -> Vec<Face> {
        let radius = rules.body.reach() + more;
        let [x, z] = self.around(&motion.position, radius);
        let mut near = Vec::new();
        for k in z[0]..z[1] {
            for i in x[0]..x[1] {
                for face in self.square(i, k) {
                    let [a, b, c] = &face.corners;
                    let middle = (a + b + c) / 3.0;
                    let reach =
                        face.corners.iter().map(|corner| (corner - middle).norm()).fold(0.0, f64::max);
                    let local = motion.attitude.inverse_transform_vector(&(middle - motion.position));
                    let [low, high] = &rules.hull;
                    let outside = (0..3).map(|n| (low[n] - local[n]).max(local[n] - high[n]).max(0.0));
                    let outside = libm::sqrt(outside.map(|x| x * x).sum());
                    if outside <= reach + more {
                        near.push(face);
                    }
                }
            }
        }
        near
    }

    /// What the body meets first in a step, as [`Rules::first_touch`] says it of solids.
    pub(crate) fn first_touch(&self, (rules, step): (&Rules, &Step), (depth, sunk): (f64, bool)) -> Touch {
        let (reach, position) = (rules.body.reach(), &step.first.position);
        let (swept, skin) = (step.swept(reach), SKIN * rules.resolution());
        // Of what is too fast, a part of the step.
        let mut share = 1.0;
        while swept * share > reach && self.count(position, reach + skin + swept * share) > 4 * MOST_COLUMNS {
            share /= 2.0;
        }
        let end = step.start + (step.end - step.start) * share;
        let mut first = if share < 1.0 { Touch::Until(end) } else { Touch::Nothing };
        // Soil has come above it.
        let is_below = |part: &Shape| {
            let width = rules.width(part);
            rules.core(&step.first, part).iter().any(|point| {
                let face = self.face(point.x, point.z);
                face.is_some_and(|face| face.depth(point) > 0.5 * depth - width && face.depth(point) > 0.0)
            })
        };
        if !sunk && rules.parts.iter().any(is_below) {
            return Touch::At(step.start);
        }
        let bend = step.curvature(reach);
        let faces = self.near(rules, &step.first, swept * share + skin);
        for part in &rules.parts {
            let (core, width) = (rules.core(&step.first, part), rules.width(part));
            let reach = width + swept * share;
            let near: Vec<&Face> = faces.iter().filter(|face| face.lowest(&core) <= reach).collect();
            let mut pass = |own: &[Vector], other: &[Vector]| {
                let until = match first {
                    Touch::Nothing => step.end,
                    Touch::At(time) | Touch::Until(time) => time,
                };
                let place =
                    |_: f64| Front { points: other.to_vec(), velocities: vec![Vector::zeros(); other.len()] };
                let found = pass_by(step, own, (width, &place), (bend, until), (depth, sunk));
                if found != Touch::Nothing {
                    first = found;
                }
            };
            for face in &near {
                for (own, point) in part.core().iter().zip(&core) {
                    if face.is_near(point, reach) {
                        pass(&[*own], &face.corners);
                    }
                }
            }
            if core.len() > 1 {
                let mut apart = Apart::new(&core, reach);
                for Ridge { ends, .. } in ridges(&near, self.fold()) {
                    if apart.meeting(&ends).is_some() {
                        pass(part.core(), &ends);
                    }
                }
            }
        }
        first
    }
}
