//! Gravity and the air: drag on faces and cords.
//!
//! A face has the law of O'Brien, Zordan and Hodgins (*Combining Active and Passive Simulations for Secondary Motion*),
//! `f = s |v| (α_n (n·v) n + α_t (v - (n·v) n))`, with `α = ½ ρ C` from drag coefficients. The air that moves with a sheet has no inertia here.

use crate::elastic::{Assembly, Weights};
use crate::{Matrix, Sheet, Vector, Wind};

/// Constants of the surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Gravitational acceleration, in m/s².
    pub gravity: Vector,
    /// Density of the air, in kg/m³.
    pub density: f64,
    /// Drag coefficient of a cord across the flow (1.1: Reynolds numbers from 10³ to 10⁵).
    pub cylinder: f64,
    /// Drag coefficient of a face along its normal (1.2: flat plates broadside on).
    pub normal: f64,
    /// Friction coefficient of a face along its surface, both sides together (0.1: Reynolds numbers of some 10³).
    pub tangential: f64,
}

impl Default for Air {
    fn default() -> Air {
        Air {
            gravity: Vector::new(0.0, -9.81, 0.0),
            density: 1.2,
            cylinder: 1.1,
            normal: 1.2,
            tangential: 0.1,
        }
    }
}

/// Drag on an element: a force, and a symmetric matrix in the place of minus its derivative by the velocity, which is exact for flow along the normal
/// and along the surface.
struct Drag {
    force: Vector,
    damping: Matrix,
}

impl Air {
    /// Air and gravity that do nothing.
    pub fn none() -> Air {
        Air { gravity: Vector::zeros(), density: 0.0, ..Air::default() }
    }

    /// On a face of which `span` is the normal times the doubled area. `v` is its velocity relative to the air.
    fn face(&self, span: &Vector, v: &Vector) -> Drag {
        let (doubled, speed) = (span.norm(), v.norm());
        if doubled <= 0.0 || speed <= 0.0 {
            return Drag { force: Vector::zeros(), damping: Matrix::zeros() };
        }
        let normal = span / doubled;
        let scale = 0.25 * self.density * doubled * speed;
        let along = normal * normal.dot(v);
        let across = v - along;
        let force = (along * self.normal + across * self.tangential) * -scale;
        let cosine = normal.dot(v) / speed;
        let part = scale * (self.normal * (1.0 + cosine * cosine) - self.tangential);
        let sideways = scale * self.tangential / (speed * speed);
        let damping = Matrix::from_diagonal_element(scale * self.tangential)
            + normal * (normal * part).transpose()
            + across * (across * sideways).transpose();
        Drag { force, damping }
    }

    /// On a cord with this way between its ends.
    fn cord(&self, way: &Vector, width: f64, v: &Vector) -> Drag {
        let length = way.norm();
        let along = way.try_normalize(0.0).unwrap_or_else(Vector::y);
        let across = v - along * along.dot(v);
        let speed = across.norm();
        if speed <= 0.0 {
            return Drag { force: Vector::zeros(), damping: Matrix::zeros() };
        }
        let scale = 0.5 * self.density * self.cylinder * length * width;
        let plane = Matrix::identity() - along * along.transpose();
        let damping = plane * (scale * speed) + across * (across * (scale / speed)).transpose();
        Drag { force: across * (-scale * speed), damping }
    }
}

impl Sheet {
    /// Calls `act` for each face and each cord with its points and the drag on it.
    fn drag(
        &self,
        air: &Air,
        wind: &dyn Wind,
        time: f64,
        x: &[Vector],
        v: &[Vector],
        mut act: impl FnMut(&[usize], Drag),
    ) {
        if air.density == 0.0 {
            return;
        }
        for face in &self.faces {
            let [a, b, c] = face.map(|point| x[point]);
            let velocity = face.iter().map(|point| v[*point]).sum::<Vector>() / 3.0;
            let relative = velocity - wind.velocity((a + b + c) / 3.0, time);
            act(face, air.face(&(b - a).cross(&(c - a)), &relative));
        }
        for cord in &self.cords {
            let [a, b] = cord.points;
            let relative = (v[a] + v[b]) / 2.0 - wind.velocity((x[a] + x[b]) / 2.0, time);
            act(&cord.points, air.cord(&(x[b] - x[a]), self.tissue.thickness, &relative));
        }
    }

    /// Adds weight and drag.
    pub(crate) fn loads(
        &self,
        air: &Air,
        wind: &dyn Wind,
        time: f64,
        x: &[Vector],
        v: &[Vector],
        forces: &mut [Vector],
    ) {
        self.weigh(air, forces);
        self.drag(air, wind, time, x, v, |points, drag| {
            let share = drag.force / points.len() as f64;
            points.iter().for_each(|point| forces[*point] += share);
        });
    }

    fn weigh(&self, air: &Air, forces: &mut [Vector]) {
        for (force, mass) in forces.iter_mut().zip(&self.masses) {
            *force += air.gravity * *mass;
        }
    }

    /// Adds weight and drag, and the damping by drag of each point for itself.
    pub(crate) fn assemble_loads(
        &self,
        air: &Air,
        wind: &dyn Wind,
        time: f64,
        (x, v): (&[Vector], &[Vector]),
        weights: &Weights,
        assembly: &mut Assembly,
    ) {
        self.weigh(air, assembly.forces);
        let damping = weights.damping;
        self.drag(air, wind, time, x, v, |points, drag| {
            let count = points.len() as f64;
            for point in points {
                assembly.forces[*point] += drag.force / count;
                // The sum of the row: a bound of what the full matrix does, with the same effect on motions that are alike in neighbours.
                assembly.step.diagonal[*point] += drag.damping * (damping / count);
            }
        });
    }
}
