//! What the elements of a sheet write into: forces, and the matrix of a stage.

use crate::matrix::Blocks;
use crate::{Matrix, Vector};

/// Weights of a stage of length s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// τ/s: what a change of strain in the stage adds to the strain, by viscosity.
    pub rate: f64,
    /// s² + sτ: weight of the stiffness of the material.
    pub material: f64,
    /// s²: weight of other stiffness.
    pub stiffness: f64,
    /// s: weight of damping.
    pub damping: f64,
}

impl Weights {
    /// For a stage of length `s` and a delay τ, both in s.
    pub fn new(s: f64, delay: f64) -> Weights {
        Weights { rate: delay / s, material: s * s + s * delay, stiffness: s * s, damping: s }
    }
}

/// The forces, and the matrix `M + s D + s² K`.
pub(crate) struct Assembly<'a> {
    pub forces: &'a mut [Vector],
    pub step: &'a mut Blocks,
}

impl Assembly<'_> {
    /// Adds a block of the diagonal: the stiffness of the material, and that of tension.
    #[inline(always)]
    pub fn diagonal(&mut self, point: usize, material: &Matrix, tension: &Matrix, weights: &Weights) {
        self.step.diagonal[point] += material * weights.material + tension * weights.stiffness;
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
        let sum = material * weights.material + tension * weights.stiffness;
        self.step.add(slot, pair.0, pair.1, &sum);
    }
}
