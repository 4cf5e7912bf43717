//! Masses of solids whose motion is computed by growth: measured from what a small force more does to their places.

use std::collections::BTreeMap;

use dlsys_model::Quantity;
use dlsys_sheet::{Matrix, Vector};
use nalgebra::SymmetricEigen;

use crate::Error;
use crate::descent::Descent;
use crate::error::CouplingFault;
use crate::hanging::{Hanging, View};
use crate::leading::Leading;
use crate::line::Line;

/// The way of a solid by which its mass is measured, in parts of its size, and most tries to find the force for it.
const PROBE: f64 = 1e-3;
const TRIES: usize = 5;
/// A mass makes a ninth of its way in the first third of a span. What makes all of it, but for this part, jumps with the force.
const JUMP: f64 = 0.1;
/// A part of an inverse mass that a mass does not have, relative to it, and still counts as an error of growth.
const SKEW: f64 = 0.05;

/// A solid whose rules read the force on it.
pub(crate) struct Body {
    /// Its number among the paths.
    pub(crate) path: usize,
    pub(crate) module: u64,
    /// Its inverse mass in 1/kg.
    pub(crate) light: Matrix,
}

impl<'m> Hanging<'m> {
    /// The bodies with their inverse masses, which are measured where they are not known or `again`.
    pub(crate) fn weigh(
        &mut self,
        readers: &[(usize, u64)],
        (view, span): (&View, (f64, f64)),
        given: &BTreeMap<u64, Line>,
        (leading, again): (&mut Leading, bool),
    ) -> Result<Vec<Body>, Error> {
        let all: Option<Vec<Matrix>> = readers.iter().map(|(_, module)| leading.known(*module)).collect();
        let lights = match all.filter(|_| !again) {
            Some(all) => all,
            None => self.measure(readers, (view, span), given, leading)?,
        };
        let bodies = readers.iter().zip(lights);
        let bodies: Vec<Body> =
            bodies.map(|((path, module), light)| Body { path: *path, module: *module, light }).collect();
        leading.masses = bodies.iter().map(|body| (body.module, body.light)).collect();
        Ok(bodies)
    }

    /// Measures inverse masses: ways that growth makes more under a force more. The axes of the model are those of the scene.
    fn measure(
        &mut self,
        readers: &[(usize, u64)],
        (view, span): (&View, (f64, f64)),
        given: &BTreeMap<u64, Line>,
        leading: &Leading,
    ) -> Result<Vec<Matrix>, Error> {
        let end = span.0 + span.1;
        let reads: Vec<[bool; 3]> = readers
            .iter()
            .map(|(path, _)| {
                let kind = self.model.kinds.get(view.paths[*path].origin.kind);
                [0, 1, 2].map(|axis| kind.input_parameter(Quantity::Force(axis)).is_some())
            })
            .collect();
        let mut lights = vec![Matrix::zeros(); readers.len()];
        let mut jumps = vec![false; readers.len()];
        for axis in 0..3 {
            let mut strengths: Vec<f64> =
                reads.iter().map(|reads| f64::from(u8::from(reads[axis]))).collect();
            // At first the mass is not known at all; a force that is near the right one is good enough.
            for _ in 0..TRIES {
                let mut forces = given.clone();
                for ((_, module), strength) in readers.iter().zip(&strengths) {
                    let force = forces.entry(*module).or_default();
                    force.force[axis] += strength;
                }
                if strengths.iter().all(|strength| *strength == 0.0) {
                    break;
                }
                let (_, probe) = self.led(span, (&forces, &Descent::default()), leading)?;
                let mut is_good = true;
                for (b, (path, _)) in readers.iter().enumerate() {
                    if strengths[b] == 0.0 {
                        continue;
                    }
                    let ends = probe.paths.get(*path).filter(|_| probe.failed.is_none());
                    let here = &view.paths[*path];
                    let wanted = PROBE * here.shape.reach();
                    let way = ends.map(|there| {
                        let [third, whole] = [span.0 + span.1 / 3.0, end]
                            .map(|time| there.place(time).position - here.place(time).position);
                        let is_seen = whole.norm() > JUMP * wanted;
                        jumps[b] |= is_seen && (third - whole).norm() < JUMP * whole.norm();
                        whole
                    });
                    let factor = match way {
                        None => 1e-3,
                        Some(way) => {
                            let column = way * (2.0 / (strengths[b] * span.1 * span.1));
                            lights[b].set_column(axis, &column);
                            if way == Vector::zeros() { 1.0 } else { wanted / way.norm() }
                        }
                    };
                    is_good &= (0.1..=10.0).contains(&factor);
                    strengths[b] *= factor.clamp(1e-9, 1e9);
                }
                if is_good {
                    break;
                }
            }
        }
        let known = |module: u64| leading.known(module);
        let masses = readers.iter().zip(lights.iter().zip(&reads).zip(&jumps));
        masses
            .map(|((path, module), ((light, reads), jumps))| {
                if let Some(light) = leading.afloat.light(view.paths[*path].origin.kind) {
                    return Ok(light);
                }
                let fault = || self.fails(&view.paths[*path].origin, span.0, CouplingFault::NoMass);
                let found = as_of_a_mass(light, reads).filter(|_| !jumps);
                // A production within the part, or none of a probe, is no motion by a force.
                found.or_else(|| known(*module)).ok_or_else(fault)
            })
            .collect()
    }
}

/// An inverse mass along the axes whose forces are read; `None` if no mass has it.
fn as_of_a_mass(light: &Matrix, reads: &[bool; 3]) -> Option<Matrix> {
    let read = Matrix::from_fn(|i, j| if reads[i] && reads[j] { light[(i, j)] } else { 0.0 });
    let symmetric = (read + read.transpose()) / 2.0;
    let found = SymmetricEigen::new(symmetric);
    let (least, most) = (found.eigenvalues.min(), found.eigenvalues.max());
    let skew = (read - symmetric).norm();
    if !(least >= -SKEW * most && skew <= SKEW * most) {
        return None;
    }
    let values = found.eigenvalues.map(|value| value.max(0.0));
    let axes = found.eigenvectors;
    Some(axes * Matrix::from_diagonal(&values) * axes.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_masses_are_masses() {
        let with =
            |rows: [[f64; 3]; 3], reads: [bool; 3]| as_of_a_mass(&Matrix::from_fn(|i, j| rows[i][j]), &reads);
        let ball = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        assert!(with(ball, [true; 3]).is_some_and(|light| (light - Matrix::identity() * 2.0).norm() < 1e-14));
        let along_y = with(ball, [false, true, false]).expect("a mass");
        assert!((along_y - Matrix::from_diagonal(&Vector::new(0.0, 2.0, 0.0))).norm() < 1e-14);
        assert!(with([[0.0; 3]; 3], [true; 3]).is_some(), "what nothing moves");
        assert!(with([[-1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], [true; 3]).is_none(), "against the force");
        assert!(with([[1.0, 0.3, 0.0], [0.0, 1.0, 0.0], [0.0; 3]], [true; 3]).is_none());
        // A pendulum that reads one force only, aslant.
        let slope = [[0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0; 3]];
        assert!(with(slope, [true, false, false]).is_some_and(|light| (light[(0, 0)] - 0.5).abs() < 1e-15));
    }
}
