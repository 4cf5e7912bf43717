//! Bending of faces: a moment across each edge that two triangles share.
//!
//! The moment is `2 k sin(φ/2)` with the change φ of the angle between the faces, and `k = B |e|²/A`, where B is the rigidity of the sheet, e the
//! edge and A the area of both triangles (Grinspun, Hirani, Desbrun, Schröder, *Discrete shells*, 2003). With that k, a surface that is bent around a
//! cylinder has the energy `½ B κ²` per area where the edges run along the cylinder, and in every direction if the triangles are
//! equilateral. Forces keep both momenta.

use crate::elastic::{Assembly, Weights};
use crate::{Tissue, Vector};

/// Two triangles with a common edge.
#[derive(Clone, Debug)]
pub(crate) struct Hinge {
    /// The ends of the edge, and the corners on both sides.
    pub points: [usize; 4],
    /// k in N m.
    stiffness: f64,
    /// Angle at rest.
    rest: f64,
    /// Triangles that are lower than this, in m, give less force: at height 0 their normals are undefined.
    least: f64,
    /// Slots of the pairs (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3).
    pub slots: [usize; 6],
}

/// The pairs of four points.
pub(crate) const PAIRS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// The angle, and its gradient by the four points.
struct Fold {
    angle: f64,
    gradient: [Vector; 4],
    /// The lower height of both triangles.
    height: f64,
}

impl Fold {
    fn of([a, b, c, d]: [Vector; 4]) -> Option<Fold> {
        let edge = b - a;
        let length = edge.norm();
        let normals = [edge.cross(&(c - a)), (d - a).cross(&edge)];
        let squares = normals.map(|normal| normal.norm_squared());
        if !(length > 0.0 && squares[0] > 0.0 && squares[1] > 0.0) {
            return None;
        }
        let sine = normals[0].cross(&normals[1]).dot(&edge) / length;
        let angle = libm::atan2(sine, normals[0].dot(&normals[1]));
        // A corner turns its face; the feet of the perpendiculars divide what the ends of the edge do.
        let turns = [normals[0] * (-length / squares[0]), normals[1] * (-length / squares[1])];
        let feet = [c, d].map(|corner| (corner - a).dot(&edge) / (length * length));
        let gradient = [
            -turns[0] * (1.0 - feet[0]) - turns[1] * (1.0 - feet[1]),
            -turns[0] * feet[0] - turns[1] * feet[1],
            turns[0],
            turns[1],
        ];
        let height = squares[0].min(squares[1]).sqrt() / length;
        Some(Fold { angle, gradient, height })
    }
}

/// An angle between -π and π.
fn wrapped(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * libm::round(angle / std::f64::consts::TAU)
}

impl Hinge {
    /// A hinge at rest that has this part of the stiffness.
    pub fn new(points: [usize; 4], x: &[Vector], tissue: &Tissue, share: f64) -> Option<Hinge> {
        let corners = points.map(|point| x[point]);
        let fold = Fold::of(corners)?;
        let [a, b, c, d] = corners;
        let edge = b - a;
        let area = 0.5 * (edge.cross(&(c - a)).norm() + edge.cross(&(d - a)).norm());
        let stiffness = tissue.rigidity() * share * edge.norm_squared() / area;
        Some(Hinge { points, stiffness, rest: fold.angle, least: 0.1 * fold.height, slots: [0; 6] })
    }

    /// Change of the angle, between -π and π.
    fn change(&self, angle: f64) -> f64 {
        wrapped(angle - self.rest)
    }

    /// Elastic energy in J.
    pub fn energy(&self, x: &[Vector]) -> f64 {
        let fold = Fold::of(self.points.map(|point| x[point]));
        fold.map_or(0.0, |fold| {
            let sine = libm::sin(self.change(fold.angle) / 4.0);
            8.0 * self.stiffness * sine * sine
        })
    }

    fn fold(&self, x: &[Vector]) -> Option<(f64, [Vector; 4])> {
        let fold = Fold::of(self.points.map(|point| x[point]))?;
        let share = (fold.height / self.least).min(1.0);
        Some((self.change(fold.angle), fold.gradient.map(|part| part * share)))
    }

    /// The change of the angle.
    pub fn strain(&self, x: &[Vector]) -> f64 {
        Fold::of(self.points.map(|point| x[point])).map_or(0.0, |fold| self.change(fold.angle))
    }

    /// Adds forces, and the matrix without the turn of the gradient; `base` is the change from which viscosity counts.
    pub fn assemble(&self, x: &[Vector], base: f64, weights: &Weights, assembly: &mut Assembly) {
        let Some((change, gradient)) = self.fold(x) else { return };
        let viscous = weights.rate * wrapped(change - base);
        let moment = self.stiffness * (2.0 * libm::sin(change / 2.0) + viscous);
        for (point, gradient) in self.points.into_iter().zip(&gradient) {
            assembly.forces[point] -= gradient * moment;
        }
        let viscous = weights.material - weights.stiffness;
        let sum = self.stiffness * (libm::cos(change / 2.0).max(0.0) * weights.stiffness + viscous);
        for (point, gradient) in self.points.into_iter().zip(&gradient) {
            let block = gradient * gradient.transpose();
            assembly.step.diagonal[point] += block * sum;
        }
        for (slot, (j, k)) in self.slots.into_iter().zip(PAIRS) {
            let block = gradient[j] * gradient[k].transpose();
            assembly.step.add(slot, self.points[j], self.points[k], &(block * sum));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::{Blocks, Pattern};

    #[test]
    fn forces_are_minus_the_gradient_of_the_energy() {
        let rest = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.3, 0.9, 0.2], [0.6, -1.1, -0.1]].map(Vector::from);
        let tissue = Tissue::new(1e6, 1000.0, 1e-3);
        let hinge = Hinge::new([0, 1, 2, 3], &rest, &tissue, 1.0).unwrap();
        let mut x = rest;
        x[2] += Vector::new(0.05, -0.2, 0.7);
        x[1] += Vector::new(0.1, 0.2, -0.3);
        let mut forces = [Vector::zeros(); 4];
        let pattern = Pattern::new(4, PAIRS.map(|(j, k)| [j, k]).to_vec());
        let mut blocks = Blocks::default();
        blocks.clear(&pattern);
        let mut assembly = Assembly { forces: &mut forces, step: &mut blocks };
        hinge.assemble(&x, 0.0, &Weights::new(0.1, 0.0), &mut assembly);
        for k in 0..4 {
            for axis in 0..3 {
                let energy = |by: f64| {
                    let mut moved = x;
                    moved[k][axis] += by;
                    hinge.energy(&moved)
                };
                let slope = (energy(1e-5) - energy(-1e-5)) / 2e-5;
                assert!((slope + forces[k][axis]).abs() < 1e-6 * forces[2].norm(), "{k} {axis}");
            }
        }
    }
}
