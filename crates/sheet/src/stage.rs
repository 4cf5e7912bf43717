//! A stage: places and velocities at its end, from non-linear equations in which all forces, those of contacts too, are those at its end.
//!
//! ```text
//! M (v - v̂) = s F(x, v),   x = x̂ + s v
//! ```
//!
//! With its base `x̂, v̂` a stage is a step of backward Euler, or a part of a step of higher order. The equations are those of the least
//! of an incremental potential (Kane, Marsden, Ortiz, West, Int. J. Numer. Meth. Eng. 49, 2000), found by Newton's method with the positive part of the
//! stiffness of each element, and with a search along each way. Forces of viscosity follow from the changes of strains, not from strain rates at one
//! time: a cord that turns far within a step is not stretched by that. Contacts are found again in each iteration.

use crate::contact::Contact;
use crate::elastic::{Assembly, Weights};
use crate::matrix::Blocks;
use crate::solve::{Bodies, Free, Scratch, System};
use crate::step::{Around, inertia, places};
use crate::{Matrix, Place, Push, Rejection, State, Vector};

/// Largest number of iterations.
const ITERATIONS: usize = 60;
/// The size of the last correction, in parts of the error that is allowed; one that suffices after the last iteration.
const SMALL: f64 = 1e-5;
const SUFFICIENT: f64 = 1e-2;
/// Residual of a linear system, relative to its right-hand side.
const ACCURACY: f64 = 1e-4;
/// A way is short enough if the slope at its end is less than this part of that at its start; it is shortened so many times.
const SLOPE: f64 = 0.5;
const SEARCH: usize = 6;

/// From where a stage starts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Base {
    pub positions: Vec<Vector>,
    pub velocities: Vec<Vector>,
    /// Places and velocities of free solids; spins do not count.
    pub bodies: Vec<Place>,
    /// Angular momenta of free solids about their centres.
    pub momenta: Vec<Vector>,
    /// Strains from which viscosity counts.
    pub strains: Vec<f64>,
}

/// Working memory of stages.
#[derive(Clone, Debug, Default)]
pub(crate) struct Newton {
    pub numbers: Vec<Option<usize>>,
    pub free: Vec<Free>,
    pub contacts: Vec<Contact>,
    blocks: Blocks,
    scratch: Scratch,
    forces: Vec<Vector>,
    right: Vec<Vector>,
    change: Vec<Vector>,
    gusts: Vec<Vector>,
    places: Vec<Place>,
    pub iterations: u64,
}

fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

impl Newton {
    /// Solves a stage of length `s` that ends at `time`. The velocities in `state` are a first guess.
    pub fn solve(
        &mut self,
        around: Around,
        (time, s): (f64, f64),
        base: &Base,
        state: &mut State,
    ) -> Result<(), Rejection> {
        let Around { sheet, wind, settings, .. } = around;
        let allowed = settings.tolerance * sheet.extent();
        for (velocity, held) in state.velocities.iter_mut().zip(&sheet.pinned) {
            if *held {
                *velocity = Vector::zeros();
            }
        }
        place(s, base, state);
        sheet.gusts(&settings.air, wind, time, &state.positions, &mut self.gusts);
        // The part of the last change that was taken, the slope at its start, and how often it was shortened.
        let mut way: Option<(f64, f64, usize)> = None;
        for iteration in 1..=ITERATIONS {
            self.assemble(around, (time, s), base, state);
            if let Some((part, start, tries)) = way {
                let slope = dot(&self.right, &self.change);
                if slope < -SLOPE * start && tries < SEARCH {
                    let shorter = part * (start / (start - slope)).clamp(0.1, 0.7);
                    self.go(shorter - part, state);
                    place(s, base, state);
                    way = Some((shorter, start, tries + 1));
                    continue;
                }
            }
            let mut change = std::mem::take(&mut self.change);
            let solved = self.linear(around, s, &mut change, ACCURACY);
            self.change = change;
            solved?;
            let start = dot(&self.right, &self.change);
            self.go(1.0, state);
            place(s, base, state);
            let size = self.size(around, s);
            let enough = if iteration == ITERATIONS { SUFFICIENT } else { SMALL };
            if size <= enough * allowed {
                return Ok(());
            }
            if !size.is_finite() {
                return Err(Rejection::Unsolved { iterations: iteration });
            }
            way = Some((1.0, start, 0));
        }
        Err(Rejection::Unsolved { iterations: ITERATIONS })
    }

    /// Adds a part of the last change to the velocities.
    fn go(&self, part: f64, state: &mut State) {
        let points = state.velocities.len();
        for (velocity, change) in state.velocities.iter_mut().zip(&self.change) {
            *velocity += change * part;
        }
        for (number, body) in state.bodies.iter_mut().enumerate() {
            body.velocity += self.change[points + 2 * number] * part;
            body.spin += self.change[points + 2 * number + 1] * part;
        }
    }

    /// The largest way of the last change, in m.
    fn size(&self, around: Around, s: f64) -> f64 {
        let points = around.sheet.len();
        let mut size = 0.0;
        let mut meet = |way: f64| {
            // A way that is no number stays.
            if way > size || way.is_nan() {
                size = way;
            }
        };
        self.change[..points].iter().for_each(|change| meet(change.norm() * s));
        let reaches = around.solids.iter().filter(|solid| solid.is_free()).map(|solid| solid.shape.reach());
        for (number, reach) in reaches.enumerate() {
            meet(self.free[number].way(&self.change[points + 2 * number]).norm() * s);
            meet(self.change[points + 2 * number + 1].norm() * s * reach);
        }
        size
    }

    /// Forces at a state, the matrix, and the right-hand side `s F - M (v - v̂)`.
    fn assemble(&mut self, around: Around, (time, s): (f64, f64), base: &Base, state: &State) {
        let Around { sheet, solids, settings, .. } = around;
        let (x, v) = (&state.positions, &state.velocities);
        places(solids, time, &state.bodies, &mut self.places);
        self.free.clear();
        self.free.extend(solids.iter().zip(&self.places).filter_map(|(solid, place)| inertia(solid, place)));
        let points = sheet.len();
        self.forces.clear();
        self.forces.resize(points + 2 * self.free.len(), Vector::zeros());
        self.blocks.clear(&sheet.pattern);
        for (block, mass) in self.blocks.diagonal.iter_mut().zip(&sheet.masses) {
            *block = Matrix::from_diagonal_element(*mass);
        }
        let weights = Weights::new(s, sheet.tissue.delay());
        let mut assembly = Assembly { forces: &mut self.forces, step: &mut self.blocks };
        sheet.assemble_elastic(x, &base.strains, &weights, &mut assembly);
        sheet.assemble_loads(&settings.air, &self.gusts, (x, v), &weights, &mut assembly);
        self.contacts.clear();
        for (index, solid) in solids.iter().enumerate() {
            sheet.contacts((index, solid), &self.places[index], x, v, &mut self.contacts);
        }
        for (solid, number) in solids.iter().zip(&self.numbers) {
            if let Some(number) = number {
                self.forces[points + 2 * number] = solid.load(time, &settings.air.gravity);
            }
        }
        for contact in &self.contacts {
            contact.spread(&contact.force, &mut self.forces);
            if let Some(number) = self.numbers[contact.solid] {
                let forces = &mut self.forces[points + 2 * number..];
                self.free[number].press(&contact.force, &contact.arm, forces);
            }
        }
        self.right.clear();
        self.right.extend(self.forces.iter().map(|force| force * s));
        for (k, velocity) in v.iter().enumerate().take(points) {
            if sheet.pinned[k] {
                self.right[k] = Vector::zeros();
            } else {
                self.right[k] -= (velocity - base.velocities[k]) * sheet.masses[k];
            }
        }
        for (number, (free, body)) in self.free.iter().zip(&state.bodies).enumerate() {
            let start = points + 2 * number;
            self.right[start] -= (body.velocity - base.bodies[number].velocity) * free.mass;
            self.right[start + 1] -= free.inertia * body.spin - base.momenta[number];
        }
    }

    fn linear(
        &mut self,
        around: Around,
        s: f64,
        x: &mut Vec<Vector>,
        accuracy: f64,
    ) -> Result<(), Rejection> {
        let system = System {
            pattern: &around.sheet.pattern,
            blocks: &self.blocks,
            pinned: &around.sheet.pinned,
            contacts: &self.contacts,
            numbers: &self.numbers,
            free: &self.free,
            weights: (s * s, s),
        };
        let limits = (accuracy, around.settings.iterations);
        let solved = system.solve(&self.right, x, &mut self.scratch, limits);
        let iterations = solved.map_err(|iterations| Rejection::Unsolved { iterations })?;
        self.iterations += iterations as u64;
        Ok(())
    }

    /// Passes changes of velocities, of points and free solids, through `(M + s D + s² K)⁻¹ M` of the last stage.
    pub fn smooth(
        &mut self,
        around: Around,
        s: f64,
        changes: &mut Vec<Vector>,
        accuracy: f64,
    ) -> Result<(), Rejection> {
        let points = around.sheet.len();
        self.right.clear();
        self.right
            .extend(changes[..points].iter().zip(&around.sheet.masses).map(|(change, mass)| change * *mass));
        for (number, free) in self.free.iter().enumerate() {
            let [push, turn] = [0, 1].map(|k| changes[points + 2 * number + k]);
            self.right.extend([push * free.mass, free.inertia * turn]);
        }
        self.linear(around, s, changes, accuracy)
    }

    /// Adds the impulses on solids by the contacts of the last stage, for a time `h`.
    pub fn push(&self, points: usize, s: f64, h: f64, pushes: &mut [Push]) {
        let bodies = Bodies { points, numbers: &self.numbers, free: &self.free };
        for contact in &self.contacts {
            // The last change is part of the state.
            let change = bodies.relative(contact, &self.change);
            let force = contact.force - (contact.stiffness * s + contact.damping) * change;
            let moment = contact.arm.cross(&force) * h;
            pushes[contact.solid] += Push { impulse: -force * h, moment: -moment };
        }
    }

    /// The solids and elements that touch.
    pub fn touching(&self, out: &mut Vec<(usize, usize)>) {
        touching(&self.contacts, out);
    }
}

/// The solids and elements of contacts.
pub(crate) fn touching(contacts: &[Contact], out: &mut Vec<(usize, usize)>) {
    out.clear();
    out.extend(contacts.iter().map(|contact| (contact.solid, contact.element)));
}

/// Places from velocities.
fn place(s: f64, base: &Base, state: &mut State) {
    state.positions.clear();
    state.positions.extend(base.positions.iter().zip(&state.velocities).map(|(x, v)| x + v * s));
    for (body, start) in state.bodies.iter_mut().zip(&base.bodies) {
        let moved = start.after(body.velocity * s, body.spin * s);
        *body = Place { velocity: body.velocity, spin: body.spin, ..moved };
    }
}
