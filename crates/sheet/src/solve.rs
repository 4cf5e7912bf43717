//! The linear system of a step: blocks of the sheet, contacts, free solids; solved by conjugate gradients.

use crate::contact::Contact;
use crate::matrix::{Blocks, Pattern};
use crate::{Matrix, Vector};

/// A solid that forces move in the system: mass, and inertia in the axes of the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Free {
    pub mass: f64,
    pub inertia: Matrix,
    /// Of a solid that is led, the root of the inverse mass, by which its unknown moves it; it has no spin of its own.
    pub root: Option<Matrix>,
}

impl Free {
    /// Motion by the first unknown. Also the force on it, as the root is symmetric.
    pub fn way(&self, unknown: &Vector) -> Vector {
        self.root.map_or(*unknown, |root| root * unknown)
    }

    /// Adds minus a force at an arm to the forces on both unknowns.
    pub fn press(&self, force: &Vector, arm: &Vector, out: &mut [Vector]) {
        out[0] -= self.way(force);
        if self.root.is_none() {
            out[1] -= arm.cross(force);
        }
    }
}

/// The matrix of a step. Unknowns are the points, then two vectors for each free solid: velocity and spin.
pub(crate) struct System<'a> {
    pub pattern: &'a Pattern,
    pub blocks: &'a Blocks,
    pub pinned: &'a [bool],
    pub contacts: &'a [Contact],
    /// The number of each solid among the free ones.
    pub numbers: &'a [Option<usize>],
    pub free: &'a [Free],
    /// Weights of the stiffness and of the damping of contacts.
    pub weights: (f64, f64),
}

/// Working memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    inverse: Vec<Matrix>,
    residual: Vec<Vector>,
    conditioned: Vec<Vector>,
    direction: Vec<Vector>,
    product: Vec<Vector>,
}

fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// Where the free solids stand in a vector of unknowns.
#[derive(Clone, Copy)]
pub(crate) struct Bodies<'a> {
    /// Number of points of the sheet.
    pub points: usize,
    /// The number of each solid among the free ones.
    pub numbers: &'a [Option<usize>],
    pub free: &'a [Free],
}

impl Bodies<'_> {
    fn body(&self, contact: &Contact) -> Option<(usize, &Free)> {
        self.numbers[contact.solid].map(|number| (self.points + 2 * number, &self.free[number]))
    }

    /// Motion of an element relative to its solid.
    pub fn relative(&self, contact: &Contact, x: &[Vector]) -> Vector {
        contact.relative(x, self.body(contact).map(|(start, free)| (free.way(&x[start]), x[start + 1])))
    }

    /// Adds the forces `-C u` of contacts for relative motions u, with a matrix C for each contact.
    pub fn resist(
        &self,
        contacts: &[Contact],
        matrix: impl Fn(&Contact) -> Matrix,
        x: &[Vector],
        out: &mut [Vector],
    ) {
        for contact in contacts {
            let force = -(matrix(contact) * self.relative(contact, x));
            contact.spread(&force, out);
            if let Some((start, free)) = self.body(contact) {
                free.press(&force, &contact.arm, &mut out[start..]);
            }
        }
    }
}

impl System<'_> {
    fn points(&self) -> usize {
        self.pinned.len()
    }

    fn bodies(&self) -> Bodies<'_> {
        Bodies { points: self.points(), numbers: self.numbers, free: self.free }
    }

    fn block(&self, contact: &Contact) -> Matrix {
        contact.stiffness * self.weights.0 + contact.damping * self.weights.1
    }

    fn multiply(&self, x: &[Vector], y: &mut [Vector]) {
        let points = self.points();
        self.blocks.multiply(self.pattern, x, y);
        for (number, free) in self.free.iter().enumerate() {
            y[points + 2 * number] = x[points + 2 * number] * free.mass;
            y[points + 2 * number + 1] = free.inertia * x[points + 2 * number + 1];
        }
        self.bodies().resist(self.contacts, |contact| -self.block(contact), x, y);
        self.hold(y);
    }

    /// Sets the part of pinned points to 0.
    fn hold(&self, x: &mut [Vector]) {
        for (value, pinned) in x.iter_mut().zip(self.pinned) {
            if *pinned {
                *value = Vector::zeros();
            }
        }
    }

    /// The inverses of the blocks of the diagonal.
    fn invert(&self, inverse: &mut Vec<Matrix>) {
        let points = self.points();
        inverse.clear();
        inverse.extend_from_slice(&self.blocks.diagonal);
        for free in self.free {
            inverse.extend([Matrix::from_diagonal_element(free.mass), free.inertia]);
        }
        for contact in self.contacts {
            let block = self.block(contact);
            for k in 0..3 {
                inverse[contact.points[k]] += block * (contact.weights[k] * contact.weights[k]);
            }
            if let Some(number) = self.numbers[contact.solid] {
                let cross = contact.arm.cross_matrix();
                match self.free[number].root {
                    Some(root) => inverse[points + 2 * number] += root * block * root,
                    None => {
                        inverse[points + 2 * number] += block;
                        inverse[points + 2 * number + 1] += cross.transpose() * block * cross;
                    }
                }
            }
        }
        for (index, block) in inverse.iter_mut().enumerate() {
            let pinned = self.pinned.get(index).copied().unwrap_or(false);
            // Positive definite; without an inverse, values are not finite, which shows in the residual.
            *block = if pinned {
                Matrix::zeros()
            } else {
                block.try_inverse().unwrap_or_else(|| Matrix::repeat(f64::NAN))
            };
        }
    }

    fn condition(&self, inverse: &[Matrix], r: &[Vector], z: &mut [Vector]) {
        let points = self.points();
        self.blocks.sweep(self.pattern, inverse, r, z);
        for index in points..r.len() {
            z[index] = inverse[index] * r[index];
        }
    }

    /// Solves for a right-hand side up to a relative residual. Returns the iterations, or their number if they do not suffice.
    pub fn solve(
        &self,
        right: &[Vector],
        x: &mut Vec<Vector>,
        scratch: &mut Scratch,
        (tolerance, most): (f64, usize),
    ) -> Result<usize, usize> {
        let Scratch { inverse, residual, conditioned, direction, product } = scratch;
        self.invert(inverse);
        residual.clear();
        residual.extend_from_slice(right);
        self.hold(residual);
        x.clear();
        x.resize(right.len(), Vector::zeros());
        for vector in [&mut *conditioned, &mut *product] {
            vector.clear();
            vector.resize(right.len(), Vector::zeros());
        }
        self.condition(inverse, residual, conditioned);
        direction.clone_from(conditioned);
        let mut size = dot(residual, conditioned);
        let enough = size * tolerance * tolerance;
        if size == 0.0 {
            return Ok(0);
        }
        for iteration in 1..=most {
            self.multiply(direction, product);
            let length = size / dot(direction, product);
            if !length.is_finite() {
                return Err(iteration);
            }
            for k in 0..right.len() {
                x[k] += direction[k] * length;
                residual[k] -= product[k] * length;
            }
            self.condition(inverse, residual, conditioned);
            let next = dot(residual, conditioned);
            if next <= enough {
                return Ok(iteration);
            }
            let share = next / size;
            size = next;
            for k in 0..right.len() {
                direction[k] = conditioned[k] + direction[k] * share;
            }
        }
        Err(most)
    }
}
