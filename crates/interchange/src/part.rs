//! What a module draws at one instant, as numbers in a frame of its own.
//!
//! | part | numbers |
//! |---|---|
//! | a straight stem | start, end; of each of them, its radius along three axes: across, at a right angle to that, along the stem |
//! | one with a neck | the same, then the end of the neck and its radius along the axes |
//! | a polygon | its corners |
//! | a surface | origin, and the displacements along its three axes from there to the limits of its mesh |
//! | a patch | 16 control points, row by row |
//! | a net: a surface whose vertices move by themselves | its vertices |
//!
//! All numbers are points or displacements, three at a time, and the corners of meshes depend on them linearly. So a straight line
//! between the numbers of two instants is a straight line between all corners, and a bound of the difference of numbers is
//! a bound of the distance of corners. Lengths are in metres.

use std::collections::HashMap;
use std::sync::Arc;

use dlsys_geometry::scene::{MaterialId, Mesh, PatchSet, Point, Surface, Vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// Points of a stem, start, end and end of its neck, as triples of its numbers, each with the first of its radii.
const STEM_POINTS: [[usize; 2]; 3] = [[0, 2], [1, 5], [8, 9]];

/// Those of a stem that has these numbers.
fn stem_points<N>(numbers: &[N]) -> impl Iterator<Item = [usize; 2]> {
    STEM_POINTS.into_iter().filter(|[point, _]| 3 * point < numbers.len())
}

/// Where the radii of a stem begin among its numbers.
pub(crate) fn stem_radii<N>(numbers: &[N]) -> impl Iterator<Item = usize> {
    stem_points(numbers).map(|[_, axes]| 3 * axes)
}

/// The start of a stem (0), its end (1) or the end of its neck (2), and the radius there along three axes: across, at a right angle to that, along.
pub(crate) fn stem_point<N: Number>(numbers: &[N], which: usize) -> (Vector, [Vector; 3]) {
    let [point, axes] = STEM_POINTS[which];
    (triple(numbers, point), [0, 1, 2].map(|axis| triple(numbers, axes + axis)))
}

/// What is drawn, without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Part {
    /// A piece of a stem, with this contour of the model, or round.
    Stem(Option<u32>),
    /// The same at a fork, where it begins wider than it is.
    Shoot(Option<u32>),
    /// A polygon of so many corners.
    Polygon(u32),
    /// A surface, by the place of its mesh in memory.
    Surface(usize),
    /// A bicubic Bézier patch.
    Patch,
    /// A surface whose vertices move, by the place in memory of its mesh at rest, and their number.
    Net(usize, u32),
}

impl Part {
    /// How many numbers it has.
    pub(crate) fn numbers(self) -> usize {
        match self {
            Part::Stem(_) => 24,
            Part::Shoot(_) => 36,
            Part::Polygon(corners) => 3 * corners as usize,
            Part::Surface(_) => 12,
            Part::Patch => 48,
            Part::Net(_, corners) => 3 * corners as usize,
        }
    }

    /// A bound of the distance between corners of a part whose numbers differ by these.
    fn distance(self, differences: &[f64]) -> f64 {
        let norms = differences.as_chunks::<3>().0.iter().map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
        match self {
            // A corner of the mesh is the origin and at most one of each displacement.
            Part::Surface(_) => norms.sum(),
            // One of a stem is a mean of its points, and of its radii.
            Part::Stem(_) | Part::Shoot(_) => {
                let square = |i: usize| triple(differences, i).norm_squared();
                let [mut middle, mut radius] = [0.0_f64; 2];
                for [point, axes] in stem_points(differences) {
                    middle = middle.max(square(point));
                    radius = radius.max((axes..axes + 3).map(square).sum());
                }
                middle.sqrt() + radius.sqrt()
            }
            _ => norms.fold(0.0, f64::max),
        }
    }

    /// A bound of the distance of its corners from the origin of its frame.
    fn reach(self, numbers: &[f32]) -> f64 {
        let norm = |i: usize| triple(numbers, i).norm();
        match self {
            Part::Stem(_) | Part::Shoot(_) => {
                stem_points(numbers).map(|[point, axes]| norm(point) + norm(axes)).fold(0.0, f64::max)
            }
            Part::Surface(_) => (0..4).map(norm).sum(),
            Part::Polygon(_) | Part::Patch | Part::Net(..) => {
                (0..numbers.len() / 3).map(norm).fold(0.0, f64::max)
            }
        }
    }
}

/// The numbers of samples: 32 bits where many are kept, 64 where their differences count.
pub(crate) trait Number: Copy + Into<f64> {
    fn of(x: f64) -> Self;
}

impl Number for f32 {
    fn of(x: f64) -> f32 {
        x as f32
    }
}

impl Number for f64 {
    fn of(x: f64) -> f64 {
        x
    }
}

/// Three numbers as a vector.
pub(crate) fn triple<N: Number>(numbers: &[N], i: usize) -> Vector {
    Vector::new(numbers[3 * i].into(), numbers[3 * i + 1].into(), numbers[3 * i + 2].into())
}

/// All parts of a module: forms with the same parts are one.
pub(crate) type Form = Arc<[Part]>;

/// A bound of the distance between the corners of a drawing of this form and those that lie at `weight` (0 to 1) between two others, all in the
/// same frame.
pub(crate) fn distance(form: &[Part], [a, b]: [&[f32]; 2], weight: f64, c: &[f32]) -> f64 {
    let mut first = 0;
    let mut greatest = 0.0_f64;
    let mut differences = [0.0; 48];
    let mut many = Vec::new();
    for part in form {
        let count = part.numbers();
        let room = match differences.get_mut(..count) {
            Some(room) => room,
            None => {
                many.resize(count, 0.0);
                &mut many[..]
            }
        };
        for (k, difference) in room.iter_mut().enumerate() {
            let (a, b) = (f64::from(a[first + k]), f64::from(b[first + k]));
            *difference = a + (b - a) * weight - f64::from(c[first + k]);
        }
        greatest = greatest.max(part.distance(room));
        first += count;
    }
    greatest
}

/// A bound of the distance between the corners of two drawings of this form whose numbers differ by these.
pub(crate) fn length(form: &[Part], differences: &[f64]) -> f64 {
    let mut first = 0;
    let mut greatest = 0.0_f64;
    for part in form {
        greatest = greatest.max(part.distance(&differences[first..first + part.numbers()]));
        first += part.numbers();
    }
    greatest
}

/// A bound of the distance of all corners from the origin of the frame.
pub(crate) fn reach(form: &[Part], numbers: &[f32]) -> f64 {
    let mut first = 0;
    let mut greatest = 0.0_f64;
    for part in form {
        greatest = greatest.max(part.reach(&numbers[first..first + part.numbers()]));
        first += part.numbers();
    }
    greatest
}

/// Position and orientation of a module. Its axes: `+Y` is the turtle's heading, `-X` its left, `+Z` its up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) origin: Point,
    pub(crate) turn: UnitQuaternion<f64>,
}

impl Frame {
    /// The frame of a turtle with this heading and, as far as that is at a right angle to it, this left.
    pub(crate) fn new(origin: Point, heading: Vector, left: Vector) -> Frame {
        let right = left - heading * heading.dot(&left);
        let right = -right.try_normalize(1e-12).unwrap_or_else(|| any_across(&heading));
        let axes = Matrix3::from_columns(&[right, heading, right.cross(&heading)]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Frame { origin, turn: UnitQuaternion::new_normalize(turn.into_inner()) }
    }

    /// A frame that turns the axes of space to these, which are at right angles to one another and right-handed.
    pub(crate) fn of_axes(origin: Point, axes: [Vector; 3]) -> Frame {
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(
            Matrix3::from_columns(&axes),
        ));
        Frame { origin, turn: UnitQuaternion::new_normalize(turn.into_inner()) }
    }

    /// A displacement of the scene in this frame.
    pub(crate) fn local(&self, v: Vector) -> Vector {
        self.turn.inverse_transform_vector(&v)
    }

    /// At `weight` from this frame to another, as players interpolate: a straight line, and a turn at constant speed.
    pub(crate) fn between(&self, other: &Frame, weight: f64) -> Frame {
        let origin = self.origin + (other.origin - self.origin) * weight;
        Frame { origin, turn: slerp(&self.turn, &other.turn, weight) }
    }

    /// A bound of the distance between two places of a point that is this far from the origin of the frame.
    pub(crate) fn distance(&self, other: &Frame, reach: f64) -> f64 {
        (self.origin - other.origin).norm() + chord(&self.turn, &other.turn) * reach
    }
}

/// The distance that a point at a distance of 1 covers from one turn to another, at most.
fn chord(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let (a, b) = (a.coords, b.coords);
    // Differences, because the cosine of a small angle has half of its digits.
    let (near, far) = ((a - b).norm_squared(), (a + b).norm_squared());
    near.min(far).sqrt() * 2.0
}

/// Spherical interpolation the shorter way.
fn slerp(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, weight: f64) -> UnitQuaternion<f64> {
    let turn = a.inverse() * b;
    let turn = if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn };
    let half = turn.imag().norm().atan2(turn.w) * weight;
    let axis = turn.imag().try_normalize(1e-300).unwrap_or_else(Vector::y);
    let (sin, cos) = half.sin_cos();
    let part = nalgebra::Quaternion::from_parts(cos, axis * sin);
    UnitQuaternion::new_normalize(a.into_inner() * part)
}

/// A unit vector at a right angle to another one.
pub(crate) fn any_across(v: &Vector) -> Vector {
    let other = if v.x.abs() < 0.6 { Vector::x() } else { Vector::z() };
    v.cross(&other).try_normalize(1e-300).unwrap_or_else(Vector::x)
}

/// A surface before it is placed.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Mesh(Arc<Mesh>),
    Patches(Arc<PatchSet>, Arc<Mesh>),
}

impl Source {
    pub(crate) fn of(surface: &Surface) -> Source {
        match (&surface.patches, &surface.rest) {
            (Some(patches), _) => Source::Patches(patches.clone(), surface.mesh.clone()),
            (None, Some(rest)) => Source::Mesh(rest.clone()),
            (None, None) => Source::Mesh(surface.mesh.clone()),
        }
    }

    /// Where it is in memory.
    pub(crate) fn place(&self) -> usize {
        match self {
            Source::Mesh(mesh) => Arc::as_ptr(mesh) as usize,
            Source::Patches(patches, _) => Arc::as_ptr(patches) as usize,
        }
    }

    /// Its largest coordinates along its axes, at least a millionth of the largest of all.
    pub(crate) fn limits(&self) -> [f64; 3] {
        let (Source::Mesh(mesh) | Source::Patches(_, mesh)) = self;
        let Some([low, high]) = mesh.bounds() else { return [1.0; 3] };
        // The preview of a curved surface may lack a little.
        let spare = if let Source::Patches(..) = self { 1.02 } else { 1.0 };
        let limits = [0, 1, 2].map(|k| low[k].abs().max(high[k].abs()) * spare);
        let least = limits.iter().fold(0.0_f64, |a, b| a.max(*b)) * 1e-6;
        limits.map(|limit| if least > 0.0 { limit.max(least) } else { 1.0 })
    }

    /// Its mesh, no further than `accuracy` from it where its unit is `scale` long.
    pub(crate) fn mesh(&self, accuracy: f64, scale: f64) -> Arc<Mesh> {
        match self {
            Source::Mesh(mesh) => mesh.clone(),
            Source::Patches(patches, _) => patches.draft(accuracy / scale.max(f64::MIN_POSITIVE)),
        }
    }
}

/// Forms, lists of materials and surfaces that have been seen, each kept once.
#[derive(Debug, Default)]
pub(crate) struct Catalogue {
    forms: HashMap<Vec<Part>, Form>,
    paints: HashMap<Vec<Option<MaterialId>>, Paint>,
    pub(crate) surfaces: HashMap<usize, Source>,
}

/// The materials of the parts of a module; `None` for a surface that has its own.
pub(crate) type Paint = Arc<[Option<MaterialId>]>;

impl Catalogue {
    pub(crate) fn form(&mut self, parts: &[Part]) -> Form {
        if let Some(known) = self.forms.get(parts) {
            return known.clone();
        }
        let form: Form = parts.into();
        self.forms.insert(parts.to_vec(), form.clone());
        form
    }

    pub(crate) fn paint(&mut self, materials: &[Option<MaterialId>]) -> Paint {
        if let Some(known) = self.paints.get(materials) {
            return known.clone();
        }
        let paint: Paint = materials.into();
        self.paints.insert(materials.to_vec(), paint.clone());
        paint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_interpolated_at_constant_speed_the_shorter_way() {
        let frame = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Frame::new(
                Point::new(degrees, 0.0, 0.0),
                Vector::new(-sin, cos, 0.0),
                Vector::new(-cos, -sin, 0.0),
            )
        };
        for (from, to, weight) in
            [(0.0, 80.0, 0.25), (10.0, 170.0, 0.5), (170.0, 190.0, 0.7), (5.0, 5.0, 0.3)]
        {
            let middle = frame(from).between(&frame(to), weight);
            let off = middle.distance(&frame(from + (to - from) * weight), 2.0);
            assert!(off < 1e-12, "{from} {to}: {off}");
        }
        let quarter = frame(0.0).distance(&frame(90.0), 3.0);
        // 3 times the square root of 2 and 90: the bound is above the chord, by less than a sixth.
        assert!((94.24..94.9).contains(&quarter), "{quarter}");
    }
}
