//! Explicit Runge-Kutta pairs: one implementation for all tableaus.
//!
//! A pair is a table of coefficients and a dense output ([`Pair`]); stages, error estimate and stability test are computed here from
//! the table. All pairs are "first same as last": the last stage of a step is the rate at its end and serves as the first stage of
//! the next. Inside a step each component is a polynomial in the Bernstein basis on [0, 1], whose coefficients bound it.
//!
//! Sources: E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. 1993, sections II.4 (step
//! control), II.5 (pairs) and II.6 (dense output); the same authors' II (1996), section IV.2 (stiffness).

mod columns;
mod few;
mod together;

use crate::Rates;
use crate::column::{FEW, Stage};
use crate::dense::{Dense, PLACE};
use crate::one_step::{InteriorError, OneStep, Step, Trial};
use crate::workspace::{MAX_STAGES, Workspace};
use dlsys_expr::SimTime;
use std::marker::PhantomData;

/// An explicit Runge-Kutta pair with dense output, for `y' = f(t, y)` and steps of length `h`.
///
/// Stage `i` (from 0) is `k_i = f(t + c_i h, y + h sum_j a_ij k_j)` over `j < i`.
#[derive(Debug, Clone, Copy)]
pub struct Tableau {
    /// Order of the solution that is carried on.
    #[cfg(test)]
    pub order: u32,
    /// Order `q` of the error estimate for step control: the estimate falls like `h^(q+1)`.
    pub error_order: u32,
    /// Stages of a step, with the last one, the rate at the end, counted. Further rows of `a` are the extra
    /// stages of the dense output, wanted only for accepted steps.
    pub stages: usize,
    /// Nodes as fractions of the step, one for each stage, extra stages included.
    pub c: &'static [f64],
    /// Stage coefficients; row `i` has `i` entries. Row `stages - 1` holds the weights of the solution.
    pub a: &'static [&'static [f64]],
    /// Weights of the error estimates, each of `stages` entries: one for the 5(4) pair; for DOP853 two, the
    /// estimate of 5th order and then that of 3rd order, to be joined by [`join_estimates`].
    pub e: &'static [&'static [f64]],
    /// Weights of the dense output beyond its Hermite part, each with one entry for every stage.
    pub d: &'static [&'static [f64]],
}

#[cfg(test)]
impl Tableau {
    /// Weights of the solution at the end of the step: `y1 = y0 + h sum_i b_i k_i`, over `stages - 1` stages.
    pub fn weights(&self) -> &'static [f64] {
        self.a[self.stages - 1]
    }
}

/// Where the coefficients of a dense output go, component after component.
pub(crate) trait Receiver {
    /// Those of the next components.
    fn put(&mut self, coefficients: &[f64]);
}

impl Receiver for Vec<f64> {
    #[inline(always)]
    fn put(&mut self, coefficients: &[f64]) {
        self.extend_from_slice(coefficients);
    }
}

/// A part of those of all components.
impl Receiver for &mut [f64] {
    #[inline(always)]
    fn put(&mut self, coefficients: &[f64]) {
        let (next, rest) = std::mem::take(self).split_at_mut(coefficients.len());
        next.copy_from_slice(coefficients);
        *self = rest;
    }
}

/// What distinguishes one pair from another.
pub trait Pair: Clone {
    /// Its coefficients.
    const TABLEAU: &'static Tableau;
    /// Degree of its dense output.
    const DEGREE: usize;
    /// The step length times the rate of decay up to which it damps. The bounds lie below the ends of the stability regions, where
    /// step control settles.
    const STABILITY: f64;
    /// As [`OneStep::INTERIOR_IS_MEASURED`].
    const INTERIOR_IS_MEASURED: bool = false;

    /// Appends the dense output of `count` of `N` components, from `first` on, to `out`: `DEGREE + 1` Bernstein coefficients for each. `y` and
    /// `end` are their values at the ends of the step, `k` the rates of all components at all stages.
    fn dense<const N: usize, K: Stage>(
        y: &[f64; N],
        end: &[f64; N],
        k: &[K; MAX_STAGES],
        first: usize,
        h: f64,
        count: usize,
        out: &mut impl Receiver,
    );

    /// The error of the dense output of some components inside a step of length `h`, from `y` on, by what is known at one place.
    fn interior_error(_h: f64, _y: &[f64], _place: AtPlace) -> InteriorError {
        InteriorError::default()
    }
}

/// What is known of components at [`PLACE`] inside a step.
pub struct AtPlace<'s> {
    /// Their rates at the start of the step.
    pub first: &'s [f64],
    /// The values of the dense output, and its slopes, per unit of position.
    pub values: &'s [f64],
    pub slopes: &'s [f64],
    /// The rates of the equations at these values.
    pub rates: &'s [f64],
}

/// The rates of `N` components, from `first` on, at the first `S` stages, times the length of the step.
#[inline(always)]
pub(super) fn changes<const N: usize, const S: usize>(
    k: &[impl Stage; MAX_STAGES],
    first: usize,
    h: f64,
) -> [[f64; N]; S] {
    let mut hk = [[0.0; N]; S];
    for (hk, k) in hk.iter_mut().zip(k) {
        if N == 1 {
            hk[0] = h * k.at(first);
            continue;
        }
        for (hk, k) in hk.iter_mut().zip(&k[first..first + N]) {
            *hk = h * k;
        }
    }
    hk
}

/// The one-step method of a pair.
#[derive(Clone, Debug)]
pub struct Explicit<P> {
    /// The nodes whose rates have a weight in the error estimate.
    nodes: Vec<f64>,
    pair: PhantomData<P>,
}

impl<P: Pair> Default for Explicit<P> {
    fn default() -> Explicit<P> {
        let counts = |(_, weight): &(&f64, &f64)| **weight != 0.0;
        let nodes = P::TABLEAU.c.iter().zip(P::TABLEAU.e[0]).filter(counts).map(|(c, _)| *c).collect();
        Explicit { nodes, pair: PhantomData }
    }
}

impl<P: Pair> OneStep for Explicit<P> {
    const INTERIOR_IS_MEASURED: bool = P::INTERIOR_IS_MEASURED;
    const STAGES_ARE_KEPT: bool = true;

    fn error_order(&self) -> u32 {
        P::TABLEAU.error_order
    }

    fn stages(&self) -> usize {
        P::TABLEAU.a.len()
    }

    fn carried(&self) -> usize {
        P::TABLEAU.stages - 1
    }

    fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    fn attempt(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> Trial {
        work.attempt_pair::<P>(system, step, tolerance)
    }

    fn absolute_error(&self, work: &Workspace, step: Step<'_>, _error: f64, _tolerance: f64) -> f64 {
        let part =
            |(component, y): (usize, &f64)| work.estimate::<P>(step.h, component).abs() / y.abs().max(1.0);
        step.y.iter().enumerate().map(part).fold(0.0, f64::max)
    }

    fn is_limited_by_stability(&self, work: &Workspace, h: f64) -> Option<bool> {
        Some(work.stiffness(P::TABLEAU, h) > P::STABILITY)
    }

    fn dense(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        let (Step { y, start, h }, tableau) = (step, P::TABLEAU);
        if work.is_few {
            return work.dense_few::<P>(system, step, end);
        }
        if let Some(parts) = work.parts(system, tableau.a.len() - tableau.stages) {
            return work.dense_together::<P>(parts, step, end);
        }
        work.from[..y.len()].copy_from_slice(y);
        for i in tableau.stages..tableau.a.len() {
            work.combine_for::<P>(i, h);
            work.reach(false);
            work.evaluate(system, tableau.c[i] * h, i);
        }
        let c = work.polynomials::<P>(y, h);
        Dense::new(start, end, h, P::DEGREE, c)
    }

    fn interior_error(
        &self,
        work: &mut Workspace,
        system: &mut impl Rates,
        y: &[f64],
        dense: &Dense,
    ) -> InteriorError {
        if !P::INTERIOR_IS_MEASURED {
            return InteriorError::default();
        }
        if let Some(parts) = work.parts(system, 1) {
            return work.interior_error_together::<P>(parts, y, dense);
        }
        // The second and the third stage are no longer needed.
        for component in 0..y.len() {
            (work.stage[component], work.k[2][component]) = dense.at_place(component);
        }
        work.evaluate(system, PLACE * dense.h, 1);
        let [first, rates, slopes] = [0, 1, 2].map(|stage| &work.k[stage][..]);
        P::interior_error(dense.h, y, AtPlace { first, values: &work.stage, slopes, rates })
    }

    fn accept(&mut self, work: &mut Workspace) -> bool {
        work.k.swap(0, self.carried());
        true
    }
}

impl Workspace {
    /// Tries a step of a pair from a state whose rates are known.
    fn attempt_pair<P: Pair>(&mut self, system: &mut impl Rates, step: Step<'_>, tolerance: f64) -> Trial {
        self.is_few = false;
        if let Some(parts) = self.parts(system, P::TABLEAU.stages - 1) {
            return self.attempt_together::<P>(parts, step, tolerance);
        }
        let (Step { y, h, .. }, n, tableau) = (step, step.y.len(), P::TABLEAU);
        let (mut error, rounding) = if (1..=FEW).contains(&n) {
            self.attempt_few::<P>(system, step, tolerance)
        } else {
            self.pass_stages::<P>(system, step);
            self.largest_error::<P>(n, h, tolerance)
        };
        if system.is_algebraic() {
            let errors: Vec<f64> = (0..y.len()).map(|j| self.estimate::<P>(h, j)).collect();
            error = error.max(system.algebraic_error(h, &self.end, &errors, tolerance));
        }
        self.outcome(error, rounding, tableau.stages - 1)
    }

    /// Goes through all stages of a step of many components.
    fn pass_stages<P: Pair>(&mut self, system: &mut impl Rates, Step { y, h, .. }: Step<'_>) {
        let (n, tableau) = (y.len(), P::TABLEAU);
        self.from[..n].copy_from_slice(y);
        for i in 1..tableau.stages {
            self.combine_for::<P>(i, h);
            self.reach(i == 1);
            self.evaluate(system, tableau.c[i] * h, i);
            if i + 2 == tableau.stages {
                self.other_end.copy_from_slice(&self.stage[..n]);
            }
            if i + 1 == tableau.stages {
                // The last stage is the end of the step.
                self.end.copy_from_slice(&self.stage[..n]);
            }
        }
    }

    /// An estimate of the step times the largest rate of decay: two states at the end of the step and the
    /// difference of their rates (Hairer and Wanner 1996, IV.2).
    fn stiffness(&self, tableau: &Tableau, h: f64) -> f64 {
        let (n, last) = (self.end.len(), tableau.stages - 1);
        let (a, b) = (self.k[last].head(n), self.k[last - 1].head(n));
        let square = |x: &[f64], y: &[f64]| columns::distance(x, y);
        let distance = square(&self.end, &self.other_end);
        if distance > 0.0 { h * (square(a, b) / distance).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests;
