//! What is let go as a body in SI: mass, size, attitude and contacts, from what the turtle notes.

use dlsys_fall::{self as fall, Attitude, Body, Contact, Shape};
use dlsys_geometry::turtle::{self, Form, FreePart, Origin, Piece};
use dlsys_model::{Model, Tissue};
use dlsys_sway::{Matrix, Vector};
use dlsys_tree::ModuleString;

use crate::bending::BentStems;
use crate::body::{density, frame, thickness};
use crate::points::{directions, outermost};
use crate::{Error, Place};

/// A part that is let go, where it is at an instant.
#[derive(Clone, Debug)]
pub struct Loose {
    /// The module that holds its `@D`.
    pub origin: Origin,
    /// Mass, size and contacts.
    pub body: Body,
    /// Its centre of mass in the scene, in m.
    pub(crate) centre: Vector,
    /// From its axes to those of the scene.
    pub(crate) attitude: Attitude,
}

/// A part counts as a plate if the square of its thickness is less than this part of that of its width.
const FLAT: f64 = 0.25;
/// Least half-extent in parts of the largest one.
const THINNEST: f64 = 1e-3;
/// A surface whose normals cancel to less than this part of its area is closed, or folded: it shows a quarter of its area from anywhere (Cauchy).
const CLOSED: f64 = 0.3;

/// Number of directions in which the outermost point of a part is a contact: the most that a body may have.
const DIRECTIONS: usize = 64;

impl Loose {
    /// The body of a part; `None` if it has no mass.
    ///
    /// # Errors
    /// A value that no body can have.
    pub(crate) fn of(part: &FreePart, model: &Model, place: &Place) -> Result<Option<Loose>, fall::Error> {
        let (metre, tissues) = (place.units.length, &model.scenery.tissues[..]);
        let masses: Vec<f64> =
            part.pieces.iter().map(|p| p.form.measure() * density(p, tissues, metre)).collect();
        let mass: f64 = masses.iter().sum();
        // What is smaller than any grain of pollen by far is nothing.
        if mass <= 1e-30 {
            return Ok(None);
        }
        let at = |piece: &Piece| piece.centre.coords * metre;
        let pairs = || part.pieces.iter().zip(&masses);
        let centre = pairs().map(|(piece, mass)| at(piece) * *mass).sum::<Vector>() / mass;
        let mut spread = Matrix::zeros();
        for (piece, mass) in pairs() {
            let aside = at(piece) - centre;
            spread += piece.spread * (density(piece, tissues, metre) * metre * metre)
                + aside * aside.transpose() * *mass;
        }
        let (axes, variances) = principal(&(spread / mass));
        let of_surfaces: f64 = pairs().filter(|(piece, _)| is_surface(piece)).map(|(_, mass)| *mass).sum();
        let is_plate = of_surfaces > mass / 2.0 && variances[2] < FLAT * variances[1];
        let extent = if is_plate { 4.0 } else { 5.0 };
        let half = variances.map(|variance| (extent * variance).sqrt());
        let half = half.map(|extent| extent.max(THINNEST * half[0]));
        let shown = |piece: &Piece| shown(piece, is_plate.then(|| axes.column(2).into_owned()));
        let area = part.pieces.iter().map(shown).sum::<f64>() * metre * metre;
        let mut body =
            if is_plate { Body::plate(mass, [half[0], half[1]])? } else { Body::lump(mass, half)? };
        if is_plate {
            body.half[2] = half[2];
        } else {
            body.volume = part.pieces.iter().map(|piece| volume(piece, tissues, metre)).sum();
        }
        body.area = area;
        let body = body.touching(contacts(part, (centre, &axes), half, metre))?;
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(place.turn * axes);
        let attitude = Attitude::from_rotation_matrix(&rotation);
        Ok(Some(Loose { origin: part.origin, body, centre: place.point(centre), attitude }))
    }

    /// The bodies that a string has let go, in its shape at rest.
    ///
    /// # Errors
    /// A module that cannot be drawn, or a value that no body can have.
    pub fn all(model: &Model, string: &ModuleString) -> Result<Vec<Loose>, Error> {
        let strains = BentStems::at_rest();
        let parts = turtle::free_parts(model, string, &strains, &mut turtle::blank(model))?;
        let place = Place::of_scene(&model.scenery);
        let mut all = Vec::with_capacity(parts.len());
        for part in &parts {
            let loose = Loose::of(part, model, &place);
            all.extend(
                loose.map_err(|error| Error::falling(model, &part.origin, None, (error, string.time)))?,
            );
        }
        Ok(all)
    }

    /// True for a plate, which flutters or tumbles; false for a compact body.
    pub fn is_plate(&self) -> bool {
        self.body.shape == Shape::Plate
    }
}

fn is_surface(piece: &Piece) -> bool {
    matches!(piece.form, Form::Surface(_))
}

/// Axes of the largest, the middle and the smallest variance, right-handed, and these variances.
fn principal(spread: &Matrix) -> (Matrix, [f64; 3]) {
    let found = nalgebra::SymmetricEigen::new(*spread);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| found.eigenvalues[*b].total_cmp(&found.eigenvalues[*a]));
    let axis = |k: usize| found.eigenvectors.column(order[k]).into_owned();
    let axes = Matrix::from_columns(&[axis(0), axis(1), axis(0).cross(&axis(1))]);
    (axes, order.map(|k| found.eigenvalues[k].max(0.0)))
}

/// The area that a piece shows along a direction, or on average over all directions.
fn shown(piece: &Piece, along: Option<Vector>) -> f64 {
    let measure = piece.form.measure();
    match (piece.form, along) {
        (Form::Surface(_), _) if piece.faces[0].norm() < CLOSED * measure => measure / 4.0,
        (_, Some(normal)) => piece.faces.iter().map(|face| face.dot(&normal).abs()).sum(),
        (Form::Surface(_), None) => piece.faces[0].norm() / 2.0,
        (Form::Ball(_), None) => piece.faces.iter().map(Vector::norm).sum::<f64>() / 3.0,
        // The mean over all directions of the shadow of the side of a cylinder.
        (Form::Rod(_), None) => piece.faces[0].norm() * std::f64::consts::FRAC_PI_4,
    }
}

/// The volume of air that a piece displaces, in m³.
fn volume(piece: &Piece, tissues: &[Tissue], metre: f64) -> f64 {
    match piece.form {
        Form::Surface(area) => area * metre * metre * thickness(piece, tissues),
        Form::Ball(volume) | Form::Rod(volume) => volume * metre.powi(3),
    }
}

/// The outermost points of a part in directions all around, in the axes of its body.
fn contacts(part: &FreePart, (centre, axes): (Vector, &Matrix), half: [f64; 3], metre: f64) -> Vec<Contact> {
    let inverse = axes.transpose();
    let place = |(point, radius): &(dlsys_geometry::scene::Point, f64)| {
        (inverse * (point.coords * metre - centre), radius * metre)
    };
    let balls: Vec<(Vector, f64)> = part.points.iter().map(place).collect();
    // In proportion to the extents: all around a long leaf, not its ends only.
    let ways = directions(DIRECTIONS).map(|way| Vector::from_fn(|k, _| way[k] / half[k]));
    let ways = ways.filter_map(|way| way.try_normalize(0.0));
    let contact = |i: usize| Contact { point: balls[i].0, radius: balls[i].1 };
    outermost(&balls, ways).into_iter().map(contact).collect()
}

/// The turtle's frame at the `@D` of a part in the scene: where it is in m, and its axes.
pub(crate) fn stand(part: &FreePart, place: &Place) -> (Vector, Matrix) {
    (place.point(part.pose.position.coords * place.units.length), place.turn * frame(part.pose.axes))
}
