//! Explicit Runge-Kutta pairs: one implementation for all tableaus.
//!
//! A pair is a table of coefficients and a dense output ([`Pair`]); stages, error estimate and stability test are computed here from
//! the table. All pairs are "first same as last": the last stage of a step is the rate at its end and serves as the first stage of
//! the next. Inside a step each component is a polynomial in the Bernstein basis on [0, 1], whose coefficients bound it.
//!
//! Sources: E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. 1993, sections II.4 (step
//! control), II.5 (pairs) and II.6 (dense output); the same authors' II (1996), section IV.2 (stiffness).

use super::dop853::join_estimates;
use crate::Rates;
use crate::dense::Dense;
use crate::one_step::{InteriorError, Nodes, OneStep, Step, Trial};
use crate::workspace::{FLOOR, MAX_STAGES, PART, Workspace, part};
use dlsys_expr::SimTime;
use smallvec::SmallVec;
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

    /// Appends the dense output of [`PART`] components at most, from `first` on, to `out`: `DEGREE + 1` Bernstein coefficients for
    /// each. `y` and `end` are their values at the ends of the step, `k` the rates at all stages.
    fn dense(y: &[f64], end: &[f64], k: &[Vec<f64>], first: usize, h: f64, out: &mut Vec<f64>);

    /// As [`OneStep::interior_error`].
    fn interior_error(
        _work: &mut Workspace,
        _system: &mut impl Rates,
        _y: &[f64],
        _dense: &Dense,
    ) -> InteriorError {
        InteriorError::default()
    }
}

/// The one-step method of a pair.
#[derive(Clone, Debug)]
pub struct Explicit<P>(PhantomData<P>);

impl<P> Default for Explicit<P> {
    fn default() -> Explicit<P> {
        Explicit(PhantomData)
    }
}

impl<P: Pair> OneStep for Explicit<P> {
    const INTERIOR_IS_MEASURED: bool = P::INTERIOR_IS_MEASURED;

    fn error_order(&self) -> u32 {
        P::TABLEAU.error_order
    }

    fn nodes(&self) -> Nodes {
        let counts = |(_, weight): &(&f64, &f64)| **weight != 0.0;
        P::TABLEAU.c.iter().zip(P::TABLEAU.e[0]).filter(counts).map(|(c, _)| *c).collect()
    }

    fn attempt(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> Trial {
        work.attempt_pair(P::TABLEAU, system, step, tolerance)
    }

    fn absolute_error(&self, work: &Workspace, step: Step<'_>, _error: f64, _tolerance: f64) -> f64 {
        let part = |(component, y): (usize, &f64)| {
            work.estimate(P::TABLEAU, step.h, component).abs() / y.abs().max(1.0)
        };
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
        work.from[..y.len()].copy_from_slice(y);
        for i in tableau.stages..tableau.a.len() {
            work.combine(tableau.a[i], y.len(), h);
            work.evaluate(system, tableau.c[i] * h, i);
        }
        let mut c = Vec::with_capacity(y.len() * (P::DEGREE + 1));
        for (block, (y, end)) in y.chunks(PART).zip(work.end.chunks(PART)).enumerate() {
            P::dense(y, end, &work.k, block * PART, h, &mut c);
        }
        Dense::new(start, end, h, P::DEGREE, c)
    }

    fn interior_error(
        &self,
        work: &mut Workspace,
        system: &mut impl Rates,
        y: &[f64],
        dense: &Dense,
    ) -> InteriorError {
        P::interior_error(work, system, y, dense)
    }

    fn accept(&mut self, work: &mut Workspace) -> bool {
        work.k.swap(0, P::TABLEAU.stages - 1);
        true
    }
}

/// So few components are summed one by one, in the same order as many.
const FEW: usize = 2;

/// So many parts are summed without a list of the stages that count, which takes about as long to make.
const SHORT: usize = 8;

/// A stage that counts in a sum: its weight, and its rates in parts.
type Term<'k> = (f64, &'k [[f64; PART]]);

/// All stages that count in a sum.
type Listed<'k> = SmallVec<[Term<'k>; MAX_STAGES]>;

/// The stages that count in a sum with these weights.
#[inline(always)]
fn terms<'k>(weights: &[f64], k: &'k [Vec<f64>]) -> impl Iterator<Item = Term<'k>> {
    let counts = |(weight, _): &(&f64, &Vec<f64>)| **weight != 0.0;
    weights.iter().zip(k).filter(counts).map(|(weight, k)| (*weight, k.as_chunks().0))
}

/// The sums of the stages' rates, of the components of a part.
#[inline(always)]
fn weigh<'k>(terms: impl Iterator<Item = Term<'k>>, block: usize) -> [f64; PART] {
    let mut sums = [0.0; PART];
    for (weight, k) in terms {
        for (sum, k) in sums.iter_mut().zip(&k[block]) {
            *sum += weight * k;
        }
    }
    sums
}

/// The sum of one component's rates at the stages with these weights.
fn weighed(weights: &[f64], k: &[Vec<f64>], component: usize) -> f64 {
    let mut sum = 0.0;
    for (weight, k) in weights.iter().zip(k) {
        if *weight != 0.0 {
            sum += weight * k[component];
        }
    }
    sum
}

impl Workspace {
    /// Tries a step of a pair from a state whose rates are known.
    fn attempt_pair(
        &mut self,
        tableau: &Tableau,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> Trial {
        let (Step { y, h, .. }, n) = (step, step.y.len());
        self.from[..n].copy_from_slice(y);
        for i in 1..tableau.stages {
            self.combine(tableau.a[i], n, h);
            self.evaluate(system, tableau.c[i] * h, i);
            if i + 2 == tableau.stages {
                self.other_end.copy_from_slice(&self.stage[..n]);
            }
            if i + 1 == tableau.stages {
                // The last stage is the end of the step.
                self.end.copy_from_slice(&self.stage[..n]);
            }
        }
        let (mut error, rounding) = self.error(tableau, n, h, tolerance);
        if system.is_algebraic() {
            let errors: Vec<f64> = (0..y.len()).map(|j| self.estimate(tableau, h, j)).collect();
            error = error.max(system.algebraic_error(h, &self.end, &errors, tolerance));
        }
        self.outcome(error, rounding, tableau.stages - 1)
    }

    /// The state at which a stage's rate is taken, given its weights.
    fn combine(&mut self, weights: &[f64], n: usize, h: f64) {
        let Workspace { from, stage, k, .. } = self;
        if n <= FEW {
            for (j, (s, y)) in stage.iter_mut().zip(from).enumerate().take(n) {
                *s = *y + h * weighed(weights, k, j);
            }
            return;
        }
        let (from, stage) = (from.as_chunks::<PART>().0, stage.as_chunks_mut::<PART>().0);
        let listed: Listed = if from.len() > SHORT { terms(weights, k).collect() } else { Listed::new() };
        for (block, (from, stage)) in from.iter().zip(stage).enumerate() {
            let sums = match listed.is_empty() {
                true => weigh(terms(weights, k), block),
                false => weigh(listed.iter().copied(), block),
            };
            for i in 0..PART {
                stage[i] = from[i] + h * sums[i];
            }
        }
    }

    /// An estimate of the step times the largest rate of decay: two states at the end of the step and the
    /// difference of their rates (Hairer and Wanner 1996, IV.2).
    fn stiffness(&self, tableau: &Tableau, h: f64) -> f64 {
        let [a, b] = [1, 2].map(|before| &self.k[tableau.stages - before][..self.end.len()]);
        let square = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
        let distance = square(&self.end, &self.other_end);
        if distance > 0.0 { h * (square(a, b) / distance).sqrt() } else { 0.0 }
    }

    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding.
    fn error(&mut self, tableau: &Tableau, n: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let (mut error, mut rounding): (f64, f64) = (0.0, 0.0);
        let blur = 4.0 * self.resolution / tableau.c[1];
        let mut listed: [Listed; 2] = Default::default();
        if n > SHORT * PART {
            listed.iter_mut().zip(tableau.e).for_each(|(list, row)| list.extend(terms(row, &self.k)));
        }
        let estimates = |number: usize, block: usize| {
            let (row, list) = (tableau.e[number], &listed[number]);
            match n {
                0..=FEW => std::array::from_fn(|j| if j < n { weighed(row, &self.k, j) } else { 0.0 }),
                _ if list.is_empty() => weigh(terms(row, &self.k), block),
                _ => weigh(list.iter().copied(), block),
            }
        };
        // The last stage is the end of the step.
        let (from, end) = (self.from.as_chunks::<PART>().0, self.stage.as_chunks::<PART>().0);
        for (block, (from, end)) in from.iter().zip(end).enumerate() {
            let first = block * PART;
            let mut estimate = estimates(0, block);
            if tableau.e.len() > 1 {
                for (high, low) in estimate.iter_mut().zip(estimates(1, block)) {
                    *high = join_estimates(h * *high, h * low);
                }
            } else {
                estimate = estimate.map(|high| (h * high).abs());
            }
            let (departure, second) = (part(&self.k[0], first), part(&self.k[1], first));
            let (mut ratios, mut roundings) = ([0.0; PART], [0.0; PART]);
            let mut noise = [0.0; PART];
            for (noise, known) in noise.iter_mut().zip(self.noise.iter().skip(first)) {
                *noise = *known;
            }
            for j in 0..PART {
                // Relative to where the step begins, and to how far it goes from there at first: what
                // grows from 1e-6 must be known to its own digits. Not to where it ends: beyond an
                // event, equations may lead anywhere, and that must not spoil the part that counts.
                // What begins from rest goes somewhere only after that: the second stage shows it.
                let speed = departure[j].abs().max(second[j].abs());
                // Rates that depend on time are known as well as time is.
                let blur = blur * (second[j] - departure[j]).abs();
                let blur = blur + 4.0 * h.abs() * noise[j];
                let scale = tolerance * (from[j].abs().max(h.abs() * speed) + FLOOR) + blur;
                roundings[j] = 4.0 * f64::EPSILON * end[j].abs() / scale;
                ratios[j] = estimate[j] / scale;
            }
            for (ratio, other) in ratios.into_iter().zip(roundings).take(n - first) {
                rounding = rounding.max(other);
                error = if ratio > error || ratio.is_nan() { ratio } else { error };
            }
        }
        (error, rounding)
    }

    /// The estimated error of one component at the end of the step, with its sign.
    fn estimate(&self, tableau: &Tableau, h: f64, component: usize) -> f64 {
        let high = h * weighed(tableau.e[0], &self.k, component);
        match tableau.e.get(1) {
            None => high,
            Some(low) => join_estimates(high, h * weighed(low, &self.k, component)).copysign(high),
        }
    }
}

#[cfg(test)]
mod tests;
