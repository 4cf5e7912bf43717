//! The skeleton of a string: its stems that give way, and what they carry, in their shape at rest.
//!
//! The turtle notes, for each element that it draws, the stem at whose end it is. Masses follow from the elements of the scene.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;

use dlsys_diagnostic::Span;
use dlsys_model::{KindId, Model};
use dlsys_tree::Lineage;
use nalgebra::Matrix3;

use super::bent::StemKey;
use super::error;
use super::free::{FreePart, SolidBody};
use crate::scene::{Mesh, Patch, Placement, Point, Polygon, Scene, Segment, Surface, Vector};

/// The module of the string that draws something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Its kind.
    pub kind: KindId,
    /// Its identity.
    pub lineage: Lineage,
    /// The interpretation that draws it, and the kind of the part of it.
    pub(super) inside: Option<(usize, KindId)>,
}

impl Origin {
    /// The module of a string, drawn without an interpretation.
    pub fn new(kind: KindId, lineage: Lineage) -> Origin {
        Origin { kind, lineage, inside: None }
    }

    /// The place in the text that says how it is drawn, as far as that is known.
    pub fn span(&self, model: &Model) -> Option<Span> {
        error::place(model, self.kind, self.lineage, self.inside)
    }
}

/// A stem that gives way: a straight or, under a tropism, bent piece of one width, in its shape at rest.
#[derive(Clone, Debug)]
pub struct Stem {
    /// Its identity.
    pub key: StemKey,
    /// The module that draws it.
    pub origin: Origin,
    /// The stem from whose end it grows, rigid parts in between; `None` if it is clamped where the turtle stands.
    pub parent: Option<usize>,
    /// Number of brackets of the string around the module that draws it.
    pub depth: usize,
    /// Where it begins, in scene units.
    pub start: Point,
    /// Heading, left and up where it begins.
    pub axes: [Vector; 3],
    /// Where it ends.
    pub end: Point,
    /// Heading, left and up where it ends.
    pub end_axes: [Vector; 3],
    /// Its length along its axis.
    pub length: f64,
    /// Its diameter.
    pub width: f64,
    /// Number of its tissue among those of the model, from 0.
    pub tissue: usize,
}

/// Something that a stem carries, in its shape at rest.
#[derive(Clone, Debug)]
pub struct Load {
    /// The stem at whose end it is.
    pub stem: usize,
    /// The thing itself.
    pub piece: Piece,
}

/// An element of the scene as a body.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Number of its tissue among those of the model, from 0; `None` if there is no tissue.
    pub tissue: Option<usize>,
    /// Its measure.
    pub form: Form,
    /// The centre of its measure, in scene units.
    pub centre: Point,
    /// The integral of (x - centre)(x - centre)ᵀ over its measure.
    pub spread: Matrix3<f64>,
    /// Normals times areas, for drag: of a surface the sum over its faces, so that of a flat leaf its length is the area; of a solid the
    /// areas that it shows along three axes at right angles, or two of a stem.
    pub faces: [Vector; 3],
}

/// The kind of the measure of a [`Piece`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A surface of this area.
    Surface(f64),
    /// A ball of this volume.
    Ball(f64),
    /// A rigid stem of this volume.
    Rod(f64),
}

impl Form {
    /// Area or volume, in scene units.
    pub fn measure(self) -> f64 {
        match self {
            Form::Surface(measure) | Form::Ball(measure) | Form::Rod(measure) => measure,
        }
    }
}

/// The stems of a string that give way, and what they carry.
#[derive(Clone, Debug, Default)]
pub struct Skeleton {
    /// In string order: a stem comes after the one that it grows from.
    pub stems: Vec<Stem>,
    /// In string order, by kind.
    pub loads: Vec<Load>,
}

/// The stem that carries an element, or the free part that it belongs to, if there is one, the body that it is a part of, and the number of its
/// tissue.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Carrier {
    pub(super) stem: Option<usize>,
    pub(super) part: Option<usize>,
    pub(super) solid: Option<usize>,
    pub(super) tissue: Option<usize>,
}

/// What the turtle notes.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    pub(super) stems: Vec<Stem>,
    pub(super) parts: Vec<FreePart>,
    /// The bodies, if they are noted, and which kinds are solid.
    pub(super) solids: Vec<SolidBody>,
    pub(super) solid_kinds: Vec<bool>,
    pub(super) segments: Vec<Carrier>,
    pub(super) surfaces: Vec<Carrier>,
    pub(super) polygons: Vec<Carrier>,
    pub(super) patches: Vec<Carrier>,
}

impl Recorder {
    /// The skeleton, with the masses of what has been drawn into the scene.
    pub(super) fn finish(self, scene: &Scene) -> Skeleton {
        let mut loads = Vec::new();
        self.pieces(scene, |carrier| carrier.stem, |stem, piece| loads.push(Load { stem, piece }));
        Skeleton { stems: self.stems, loads }
    }

    /// The free parts, with what they are made of.
    pub(super) fn finish_parts(mut self, scene: &Scene) -> Vec<FreePart> {
        let mut parts = std::mem::take(&mut self.parts);
        self.pieces(scene, |carrier| carrier.part, |part, piece| parts[part].pieces.push(piece));
        self.points(scene, &mut parts);
        parts
    }

    /// Hands over what has a mass and an owner of one sort, with the owner's number.
    fn pieces(
        &self,
        scene: &Scene,
        owner: fn(&Carrier) -> Option<usize>,
        mut take: impl FnMut(usize, Piece),
    ) {
        let mut add = |carrier: &Carrier, moments: Moments, form: fn(f64) -> Form| {
            if let Some(owner) = owner(carrier)
                && moments.measure > 0.0
            {
                take(owner, moments.piece(carrier.tissue, form));
            }
        };
        for (carrier, segment) in self.segments.iter().zip(&scene.segments) {
            add(carrier, Moments::of_segment(segment), Form::Rod);
        }
        let mut known = KnownMoments::new();
        for (carrier, surface) in
            self.surfaces.iter().zip(&scene.surfaces).filter(|(c, _)| owner(c).is_some())
        {
            let (moments, form) = Moments::of_surface(surface, &mut known);
            add(carrier, moments, form);
        }
        for (carrier, polygon) in self.polygons.iter().zip(&scene.polygons) {
            add(carrier, Moments::of_polygon(polygon), Form::Surface);
        }
        for (carrier, patch) in self.patches.iter().zip(&scene.patches) {
            add(carrier, Moments::of_patch(patch), Form::Surface);
        }
    }
}

/// Moments of meshes about their origins, by their proportions: the largest scale is 1.
type KnownMoments = HashMap<(*const Mesh, [u64; 3]), Moments>;

/// Proportions are alike that differ by less than a part of this: no more than rounding.
const PROPORTION: f64 = (1_u64 << 44) as f64;

/// Integrals over a surface or a solid about a point of reference.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    measure: f64,
    first: Vector,
    second: Matrix3<f64>,
    faces: [Vector; 3],
    origin: Vector,
}

impl Moments {
    fn about(origin: Point) -> Moments {
        Moments { origin: origin.coords, ..Moments::default() }
    }

    /// Adds a triangle (exact for polynomials of degree 2: the three mid-points of its sides).
    fn add(&mut self, corners: [Point; 3]) {
        let [p, q, r] = corners.map(|corner| corner.coords - self.origin);
        let normal = (q - p).cross(&(r - p)) / 2.0;
        let area = normal.norm();
        self.measure += area;
        self.faces[0] += normal;
        for middle in [(p + q) / 2.0, (q + r) / 2.0, (r + p) / 2.0] {
            self.first += middle * (area / 3.0);
            self.second += middle * middle.transpose() * (area / 3.0);
        }
    }

    /// Of a mesh about its origin, enlarged along its axes.
    fn of_mesh(mesh: &Mesh, [x, y, z]: [f64; 3]) -> Moments {
        let mut moments = Moments::about(Point::origin());
        let place = |corner: u32| {
            let p = mesh.vertices[corner as usize];
            Point::new(x * p.x, y * p.y, z * p.z)
        };
        for face in &mesh.faces {
            moments.add(face.corners.map(place));
        }
        moments
    }

    /// Also the form that it has.
    fn of_surface(surface: &Surface, known: &mut KnownMoments) -> (Moments, fn(f64) -> Form) {
        let place = &surface.placement;
        if surface.patches.as_ref().is_some_and(|patches| patches.is_ball()) {
            let [x, y, z] = place.scales.map(|scale| scale / 2.0);
            let volume = 4.0 / 3.0 * PI * x * y * z;
            let axes = Matrix3::from_columns(&place.axes);
            let spread = Matrix3::from_diagonal(&Vector::new(x * x, y * y, z * z)) * (volume / 5.0);
            let second = axes * spread * axes.transpose();
            let faces =
                [place.axes[0] * (PI * y * z), place.axes[1] * (PI * x * z), place.axes[2] * (PI * x * y)];
            let (first, origin) = (Vector::zeros(), place.origin.coords);
            return (Moments { measure: volume, first, second, faces, origin }, Form::Ball);
        }
        // Surfaces of one shape that grow in proportion differ by one scale.
        let proportions =
            place.scales.map(|scale| (scale / place.largest() * PROPORTION).round() / PROPORTION);
        let own = *known
            .entry((Arc::as_ptr(&surface.mesh), proportions.map(f64::to_bits)))
            .or_insert_with(|| Moments::of_mesh(&surface.mesh, proportions));
        (own.placed(place), Form::Surface)
    }

    /// These moments, of a surface with its origin at 0 and the largest scale 1, after a placement.
    fn placed(&self, place: &Placement) -> Moments {
        let scale = place.largest();
        let axes = Matrix3::from_columns(&place.axes);
        let area = scale * scale;
        Moments {
            measure: self.measure * area,
            first: axes * self.first * (area * scale),
            second: axes * self.second * axes.transpose() * (area * area),
            faces: self.faces.map(|face| axes * face * area),
            origin: place.origin.coords,
        }
    }

    fn of_polygon(polygon: &Polygon) -> Moments {
        let first = polygon.vertices[0];
        let mut moments = Moments::about(first);
        for pair in polygon.vertices[1..].windows(2) {
            moments.add([first, pair[0], pair[1]]);
        }
        moments
    }

    /// Of a patch by the triangles of its control net drawn on the surface: 4 × 4 squares.
    fn of_patch(patch: &Patch) -> Moments {
        const PARTS: usize = 4;
        let mut moments = Moments::about(patch.net[0][0]);
        let at =
            |row: usize, column: usize| patch.point(row as f64 / PARTS as f64, column as f64 / PARTS as f64);
        for (row, column) in (0..PARTS).flat_map(|row| (0..PARTS).map(move |column| (row, column))) {
            let [a, b, c, d] =
                [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            moments.add([a, b, c]);
            moments.add([a, c, d]);
        }
        moments
    }

    /// Of a rigid stem: a cylinder.
    fn of_segment(segment: &Segment) -> Moments {
        let [a, b] = segment.widths.map(|width| width.resolve(0.0));
        let (way, width) = (segment.end - segment.start, (a + b) / 2.0);
        let volume = PI / 4.0 * width * width * way.norm();
        let side = segment.across * (width * way.norm());
        let across = Matrix3::identity() - segment.direction * segment.direction.transpose();
        Moments {
            measure: volume,
            second: (way * way.transpose() / 12.0 + across * (width * width / 16.0)) * volume,
            faces: [side, segment.direction.cross(&side), Vector::zeros()],
            origin: (segment.start + way / 2.0).coords,
            first: Vector::zeros(),
        }
    }

    fn piece(&self, tissue: Option<usize>, form: fn(f64) -> Form) -> Piece {
        let mean = self.first / self.measure;
        Piece {
            tissue,
            form: form(self.measure),
            centre: Point::from(self.origin + mean),
            spread: self.second - mean * mean.transpose() * self.measure,
            faces: self.faces,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_square() {
        let corner = |x: f64, y: f64| Point::new(3.0 + x, y, 1.0);
        let mut moments = Moments::about(corner(0.0, 0.0));
        moments.add([corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 2.0)]);
        moments.add([corner(0.0, 0.0), corner(2.0, 2.0), corner(0.0, 2.0)]);
        let load = moments.piece(None, Form::Surface);
        assert_eq!(load.form, Form::Surface(4.0));
        assert!((load.centre - corner(1.0, 1.0)).norm() < 1e-14);
        // ∫ x² over a square of the side 2 about its middle is a⁴/12.
        assert!(
            (load.spread - Matrix3::from_diagonal(&Vector::new(4.0 / 3.0, 4.0 / 3.0, 0.0))).norm() < 1e-14
        );
        assert!((load.faces[0] - Vector::z() * 4.0).norm() < 1e-14);
    }
}
