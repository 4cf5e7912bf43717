//! What the elements of a sheet write into: forces, and the matrices of a step.

use crate::matrix::Blocks;
use crate::{Matrix, Vector};

/// Weights of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// τ of the material, in s.
    pub delay: f64,
    /// γ² h²: weight of stiffness.
    pub stiffness: f64,
    /// γ h: weight of damping.
    pub damping: f64,
}

/// The forces, the stiffness `K`, and the matrix `M + γ h D + γ² h² K`.
pub(crate) struct Assembly<'a> {
    pub forces: &'a mut [Vector],
    pub stiffness: &'a mut Blocks,
    pub step: &'a mut Blocks,
}

impl Assembly<'_> {
    /// Adds a block of the diagonal: the stiffness of the material, and that of tension.
    #[inline(always)]
    pub fn diagonal(&mut self, point: usize, material: &Matrix, tension: &Matrix, weights: &Weights) {
        let stiffness = material + tension;
        self.stiffness.diagonal[point] += stiffness;
        self.step.diagonal[point] +=
            stiffness * weights.stiffness + material * (weights.damping * weights.delay);
    }

    /// Adds a block of a pair.
    #[inline(always)]
    pub fn pair(
        &mut self,
        slot: usize,
        pair: (usize, usize),
        material: &Matrix,
        tension: &Matrix,
        weights: &Weights,
    ) {
        let stiffness = material + tension;
        self.stiffness.add(slot, pair.0, pair.1, &stiffness);
        let sum = stiffness * weights.stiffness + material * (weights.damping * weights.delay);
        self.step.add(slot, pair.0, pair.1, &sum);
    }
}
