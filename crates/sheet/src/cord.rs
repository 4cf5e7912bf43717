//! Cords: stretch along them, and bending where one goes on in another.

use crate::elastic::{Assembly, Weights};
use crate::{Matrix, Tissue, Vector};

/// A cord between two points: the law of Hooke, `EA (l - L)/L`.
#[derive(Clone, Debug)]
pub(crate) struct Cord {
    pub points: [usize; 2],
    length: f64,
    /// EA/L in N/m.
    pub stiffness: f64,
    pub slot: usize,
}

impl Cord {
    pub fn new(points: [usize; 2], x: &[Vector], tissue: &Tissue) -> Cord {
        let length = (x[points[1]] - x[points[0]]).norm();
        Cord { points, length, stiffness: tissue.stiffness * tissue.section() / length, slot: 0 }
    }

    /// Unit vector along the cord, and its length, which is not below a millionth of that at rest.
    fn way(&self, x: &[Vector]) -> (Vector, f64) {
        let way = x[self.points[1]] - x[self.points[0]];
        let length = way.norm().max(1e-6 * self.length);
        (way / length, length)
    }

    /// Elastic energy in J.
    pub fn energy(&self, x: &[Vector]) -> f64 {
        let stretch = self.way(x).1 - self.length;
        0.5 * self.stiffness * stretch * stretch
    }

    fn apply(&self, (along, length): (Vector, f64), v: &[Vector], delay: f64, forces: &mut [Vector]) {
        let [a, b] = self.points;
        let rate = along.dot(&(v[b] - v[a]));
        let force = along * (self.stiffness * (length - self.length + delay * rate));
        forces[a] += force;
        forces[b] -= force;
    }

    /// Adds forces; `delay` is τ.
    #[inline(always)]
    pub fn forces(&self, x: &[Vector], v: &[Vector], delay: f64, forces: &mut [Vector]) {
        self.apply(self.way(x), v, delay, forces);
    }

    /// Adds forces and matrices. A cord under pressure has no stiffness across.
    pub fn assemble(&self, x: &[Vector], v: &[Vector], weights: &Weights, assembly: &mut Assembly) {
        let (along, length) = self.way(x);
        self.apply((along, length), v, weights.delay, assembly.forces);
        let line = along * along.transpose();
        let material = line * self.stiffness;
        let tension = self.stiffness * (length - self.length).max(0.0) / length;
        let across = (Matrix::identity() - line) * tension;
        let [a, b] = self.points;
        assembly.diagonal(a, &material, &across, weights);
        assembly.diagonal(b, &material, &across, weights);
        assembly.pair(self.slot, (a, b), &-material, &-across, weights);
    }
}

/// Two cords of which one continues the other: the energy is `½ k (|t₂ - t₁| - s)²`, with unit tangents t, their difference s at rest,
/// and `k = EI/L` for the mean length L.
#[derive(Clone, Debug)]
pub(crate) struct Bend {
    /// In order along the cords.
    pub points: [usize; 3],
    /// k in N m.
    stiffness: f64,
    rest: f64,
    /// Shortest lengths that count, in m.
    least: f64,
    /// Slots of the pairs (0, 1), (1, 2), (0, 2).
    pub slots: [usize; 3],
}

/// Tangents and how they turn with the points.
struct Turn {
    /// t₂ - t₁.
    turn: Vector,
    /// Derivatives of `turn` by the three points.
    by: [Matrix; 3],
}

impl Bend {
    pub fn new(points: [usize; 3], x: &[Vector], tissue: &Tissue) -> Bend {
        let ways = [x[points[1]] - x[points[0]], x[points[2]] - x[points[1]]];
        let lengths = ways.map(|way| way.norm());
        let turn = (ways[1] / lengths[1] - ways[0] / lengths[0]).norm();
        // A turn of rounding is none.
        let rest = if turn < 1e-6 { 0.0 } else { turn };
        let stiffness = tissue.cord_rigidity() / (0.5 * (lengths[0] + lengths[1]));
        Bend { points, stiffness, rest, least: 0.1 * lengths[0].min(lengths[1]), slots: [0; 3] }
    }

    fn turn(&self, x: &[Vector]) -> Turn {
        let [a, b, c] = self.points.map(|point| x[point]);
        let tangent = |way: Vector| {
            let length = way.norm().max(self.least);
            let along = way / length;
            (along, (Matrix::identity() - along * along.transpose()) / length)
        };
        let ((before, first), (after, second)) = (tangent(b - a), tangent(c - b));
        Turn { turn: after - before, by: [first, -first - second, second] }
    }

    /// Elastic energy in J.
    pub fn energy(&self, x: &[Vector]) -> f64 {
        let excess = self.turn(x).turn.norm() - self.rest;
        0.5 * self.stiffness * excess * excess
    }

    fn apply(&self, turn: &Turn, v: &[Vector], delay: f64, forces: &mut [Vector]) {
        let size = turn.turn.norm();
        let share = if size > 0.0 { 1.0 - self.rest / size } else { 0.0 };
        let mut rate: Vector = (0..3).map(|k| turn.by[k] * v[self.points[k]]).sum();
        // A turn of the whole is no bending: only the size of the difference counts.
        if size > 0.0 {
            rate = turn.turn * (rate.dot(&turn.turn) / (size * size));
        }
        let moment = (turn.turn * share + rate * delay) * self.stiffness;
        for k in 0..3 {
            forces[self.points[k]] -= turn.by[k] * moment;
        }
    }

    /// Adds forces; `delay` is τ.
    #[inline(always)]
    pub fn forces(&self, x: &[Vector], v: &[Vector], delay: f64, forces: &mut [Vector]) {
        self.apply(&self.turn(x), v, delay, forces);
    }

    /// Adds forces and matrices.
    pub fn assemble(&self, x: &[Vector], v: &[Vector], weights: &Weights, assembly: &mut Assembly) {
        let turn = self.turn(x);
        self.apply(&turn, v, weights.delay, assembly.forces);
        let zero = Matrix::zeros();
        for k in 0..3 {
            let block = turn.by[k] * turn.by[k] * self.stiffness;
            assembly.diagonal(self.points[k], &block, &zero, weights);
        }
        for (slot, (j, k)) in self.slots.into_iter().zip([(0, 1), (1, 2), (0, 2)]) {
            let block = turn.by[j] * turn.by[k] * self.stiffness;
            assembly.pair(slot, (self.points[j], self.points[k]), &block, &zero, weights);
        }
    }
}
