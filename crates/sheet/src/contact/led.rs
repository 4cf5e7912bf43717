//! Solids whose motion is computed elsewhere: led along a path, and free to deviate from it.
//!
//! Within a span of time, the place is that of the path, which is the motion under an assumed force F, and a deviation q that begins at rest:
//!
//! ```text
//! M q'' = f - F,   place = path + q,   p = B⁻¹ q',   W = M⁻¹ = B B
//! ```
//!
//! with the forces f of contacts. In p, the momentum over the root of the mass, the solid is a body of mass 1 that a sheet touches through B. So W may be
//! singular: along directions in which nothing moves the solid it is 0. Equations of motion stay where they are; of them only M is needed here, and
//! contacts are as stiff and keep momentum as well as those of free solids.

use crate::error::check;
use crate::{Error, Matrix, Place, Vector};

/// The least eigenvalue of an inverse mass, and the largest one that counts as 0, relative to the largest one.
const LEAST: f64 = -1e-3;
const NOTHING: f64 = 1e-9;

/// A solid on a path under an assumed force, with an inverse mass. It follows the turns of the path. Its place in a
/// [`State`](crate::State) is the deviation, at first [`Led::start`]; [`Led::place`] gives the place of the solid.
#[derive(Clone, Copy)]
pub struct Led<'a> {
    path: &'a dyn Fn(f64) -> Place,
    root: Matrix,
    /// The inverse of the root where it has one, 0 along directions in which nothing moves the solid.
    inverse: Matrix,
    /// A time in s, the force then in N, and its rate in N/s.
    assumed: (f64, Vector, Vector),
}

impl<'a> Led<'a> {
    /// No deviation, at rest: the place in a state at the beginning of a span of time.
    pub fn start() -> Place {
        Place::at(Vector::zeros())
    }

    /// A solid on a path, with the inverse of its mass in 1/kg: acceleration by force.
    ///
    /// # Errors
    ///
    /// An inverse mass that is not symmetric and not positive, beyond a thousandth of its largest eigenvalue.
    pub fn new(path: &'a dyn Fn(f64) -> Place, inverse_mass: &Matrix) -> Result<Led<'a>, Error> {
        for value in inverse_mass.iter() {
            check("an inverse mass (1/kg)", *value, true, "a finite number")?;
        }
        let symmetric = (inverse_mass + inverse_mass.transpose()) / 2.0;
        let found = nalgebra::SymmetricEigen::new(symmetric);
        let (least, most) = (found.eigenvalues.min(), found.eigenvalues.max());
        let skew = (inverse_mass - symmetric).norm();
        check(
            "an inverse mass (1/kg)",
            least,
            least >= LEAST * most.max(0.0),
            "0 or more in every direction",
        )?;
        check("the skew part of an inverse mass (1/kg)", skew, skew <= -LEAST * most, "0")?;
        let roots = found.eigenvalues.map(|value| if value > NOTHING * most { value.sqrt() } else { 0.0 });
        let inverses = roots.map(|root| if root > 0.0 { 1.0 / root } else { 0.0 });
        let axes = found.eigenvectors;
        let [root, inverse] =
            [roots, inverses].map(|all| axes * Matrix::from_diagonal(&all) * axes.transpose());
        Ok(Led { path, root, inverse, assumed: (0.0, Vector::zeros(), Vector::zeros()) })
    }

    /// The same on a path that was computed with a force in N at a time in s, which changes at a rate in N/s.
    pub fn assuming(self, time: f64, force: Vector, rate: Vector) -> Led<'a> {
        Led { assumed: (time, force, rate), ..self }
    }

    /// The assumed force at a time.
    pub fn assumed(&self, time: f64) -> Vector {
        let (start, force, rate) = self.assumed;
        force + rate * (time - start)
    }

    /// The symmetric root of the inverse mass.
    pub fn root(&self) -> Matrix {
        self.root
    }

    /// The place of the solid at a time, with a deviation.
    pub fn place(&self, time: f64, deviation: &Place) -> Place {
        let path = (self.path)(time);
        let position = path.position + self.root * deviation.position;
        Place { position, velocity: path.velocity + self.root * deviation.velocity, ..path }
    }

    /// The impulse (N s) beyond the assumed force, and its integral over time (N s²), that lead to a deviation. Along directions in which nothing moves the
    /// solid they are those that are given: what [`Push`](crate::Push)es are in sum, less the assumed force.
    pub fn effect(&self, deviation: &Place, given: [Vector; 2]) -> [Vector; 2] {
        let still = Matrix::identity() - self.inverse * self.root;
        let [impulse, integral] = given;
        [
            self.inverse * deviation.velocity + still * impulse,
            self.inverse * deviation.position + still * integral,
        ]
    }

    /// The path.
    pub(crate) fn path(&self, time: f64) -> Place {
        (self.path)(time)
    }
}
