//! The state of a sheet and of free solids, the solution within a step, and energy.

use nalgebra::Quaternion;

use crate::{Attitude, Place, Push, Sheet, Vector};

/// Places and velocities of the points of a sheet and of the free solids around it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Places of the points in m.
    pub positions: Vec<Vector>,
    /// Velocities of the points in m/s.
    pub velocities: Vec<Vector>,
    /// The free solids, in their order among all solids.
    pub bodies: Vec<Place>,
    /// m of the last step H/2^m: the first length to try.
    pub(crate) level: u32,
}

impl State {
    /// A sheet at rest, without free solids.
    pub fn at_rest(sheet: &Sheet) -> State {
        State {
            positions: sheet.rest.clone(),
            velocities: vec![Vector::zeros(); sheet.len()],
            bodies: Vec::new(),
            level: 0,
        }
    }

    /// The same with free solids.
    pub fn with(self, bodies: Vec<Place>) -> State {
        State { bodies, ..self }
    }
}

/// A step that was taken.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Its beginning in s.
    pub from: f64,
    /// Its end in s.
    pub to: f64,
    /// The state at its beginning.
    pub before: &'a State,
    /// The state at its end.
    pub after: &'a State,
    /// What the sheet did to each solid.
    pub pushes: &'a [Push],
    /// The largest depth of the sheet in each solid at the end, in m.
    pub depths: &'a [f64],
}

impl Step<'_> {
    /// The state at a time within the step: cubic polynomials through the places and velocities at its ends.
    pub fn at(&self, time: f64) -> State {
        let h = self.to - self.from;
        let share = if h > 0.0 { ((time - self.from) / h).clamp(0.0, 1.0) } else { 1.0 };
        let (a, b) = (self.before, self.after);
        let mut state = b.clone();
        for k in 0..a.positions.len() {
            let ends = [(a.positions[k], a.velocities[k]), (b.positions[k], b.velocities[k])];
            (state.positions[k], state.velocities[k]) = hermite(ends, h, share);
        }
        for (k, body) in state.bodies.iter_mut().enumerate() {
            let (a, b) = (&a.bodies[k], &b.bodies[k]);
            let ends = [(a.position, a.velocity), (b.position, b.velocity)];
            (body.position, body.velocity) = hermite(ends, h, share);
            body.attitude = between(a.attitude, b.attitude, share);
            body.spin = a.spin + (b.spin - a.spin) * share;
        }
        state
    }
}

/// Place and velocity of the cubic polynomial through two of each.
fn hermite([(x, v), (y, w)]: [(Vector, Vector); 2], h: f64, s: f64) -> (Vector, Vector) {
    // So that ends are the given values, to the last bit.
    if s == 0.0 {
        return (x, v);
    }
    if s == 1.0 || h == 0.0 {
        return (y, w);
    }
    let way = y - x;
    let (a, b) = (v * h - way, way - w * h);
    let r = 1.0 - s;
    let place = x + way * s + (a * r + b * s) * (s * r);
    let rate = (way + (a * (r * (1.0 - 3.0 * s)) + b * (s * (2.0 - 3.0 * s)))) / h;
    (place, rate)
}

/// Between two attitudes, along the shorter way.
fn between(a: Attitude, b: Attitude, s: f64) -> Attitude {
    if s == 0.0 {
        return a;
    }
    let (first, mut last) = (a.coords, b.coords);
    if first.dot(&last) < 0.0 {
        last = -last;
    }
    let coords = first * (1.0 - s) + last * s;
    let norm = coords.norm();
    if norm > 0.0 { Attitude::new_unchecked(Quaternion { coords: coords / norm }) } else { b }
}

/// Energy in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of motion, of points that are not pinned and of free solids.
    pub kinetic: f64,
    /// Of the springs.
    pub elastic: f64,
    /// Of weight.
    pub weight: f64,
    /// Of contacts.
    pub contact: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.weight + self.contact
    }
}
