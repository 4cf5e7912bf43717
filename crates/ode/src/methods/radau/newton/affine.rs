//! The stages of a step of a linear system whose rates depend on the state alone: one solution of its equations, without iteration.
//!
//! Elimination without pivoting is exact to rounding where a matrix is diagonally dominant ([`Pattern::is_dominant`](crate::Pattern::is_dominant)).
//! Of any other, a solution is confirmed by an iteration that finds nothing left to correct: once for all steps of such a length,
//! because what counts is the share of the couplings in the matrix.

use super::{Attempt, Iterations, Newton, pack, product, unpack};
use crate::methods::radau::stages::{Start, Stiff};
use crate::sparse::Field;
use crate::workspace::FLOOR;

/// A confirmed solution stands for steps that are so many times as long.
const ALIKE: f64 = 8.0;

impl<const S: usize, const L: usize> Newton<S, L> {
    /// Jacobian and factors as needed, and the stages. `rounding` is that of the state, in units of what is tolerated.
    pub(super) fn try_linear(
        &mut self,
        problem: &mut impl Stiff,
        start: &Start<'_>,
        rounding: f64,
    ) -> Iterations {
        self.factor(problem, start, self.known == super::Jacobian::Unknown)?;
        let (n, h) = (self.w.len(), self.h);
        let sums = pack::<S, L>(&product(&self.table.inverse, &[1.0; S]));
        self.w.iter_mut().zip(start.rate).for_each(|(w, rate)| *w = sums.scale(h * rate));
        start.pattern.solve(&self.factors, &mut self.w);
        let mut check = 0.0;
        for (i, w) in self.w.iter().enumerate() {
            let z = product(&self.table.vectors, &unpack::<S, L>(*w));
            for (j, z) in z.into_iter().enumerate() {
                self.z[j * n + i] = z;
                check += 0.0 * z;
            }
        }
        if check != 0.0 {
            return Err(Attempt::NotFinite(self.z.iter().position(|z| !z.is_finite()).map(|i| i % n)));
        }
        for (component, _) in start.y.iter().enumerate().filter(|(_, y)| y.abs() < FLOOR) {
            self.weigh_by_change(component, start.tolerance);
        }
        if h <= self.confirmed {
            return Ok(1);
        }
        self.eta = 1.0;
        let found = self.iterate(problem, start, rounding)?;
        if found == 1 {
            self.confirmed = ALIKE * h;
        }
        Ok(1 + found)
    }
}
