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
use crate::one_step::{InteriorError, OneStep, Step, Trial};
use crate::workspace::{FLOOR, MAX_STAGES, PART, Workspace, part, part_of_sum};
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
        work.from[..y.len()].copy_from_slice(y);
        for i in tableau.stages..tableau.a.len() {
            work.combine_for::<P>(i, y.len(), h);
            work.reach(false);
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

/// The weights of a sum over stages. They are known when this is compiled, so that zeros cost nothing and no loop is left.
trait Weights {
    const WEIGHTS: &'static [f64];
}

/// The weights of the state at which stage `I` is evaluated.
struct StageOf<P, const I: usize>(PhantomData<P>);

/// The weights of error estimate `I`.
struct EstimateOf<P, const I: usize>(PhantomData<P>);

impl<P: Pair, const I: usize> Weights for StageOf<P, I> {
    const WEIGHTS: &'static [f64] = row(P::TABLEAU.a, I);
}

impl<P: Pair, const I: usize> Weights for EstimateOf<P, I> {
    const WEIGHTS: &'static [f64] = row(P::TABLEAU.e, I);
}

/// A row of a table; empty beyond its end.
const fn row(table: &'static [&'static [f64]], i: usize) -> &'static [f64] {
    if i < table.len() { table[i] } else { &[] }
}

/// The rates at all stages, in parts.
type Parts<'k> = [&'k [[f64; PART]]; MAX_STAGES];

/// The first `blocks` parts of the rates at the stages that count in a sum.
#[inline(always)]
fn parts<W: Weights>(k: &[Vec<f64>], blocks: usize) -> Parts<'_> {
    let counts = |stage: usize| stage < W::WEIGHTS.len() && W::WEIGHTS[stage] != 0.0;
    std::array::from_fn(|stage| if counts(stage) { &k[stage].as_chunks().0[..blocks] } else { &[][..] })
}

/// The sums of the stages' rates, of the components of a part.
#[inline(always)]
fn weigh<W: Weights>(k: &Parts<'_>, block: usize) -> [f64; PART] {
    let mut sums = [0.0; PART];
    for (weight, k) in W::WEIGHTS.iter().zip(k) {
        if *weight != 0.0 {
            for (sum, k) in sums.iter_mut().zip(&k[block]) {
                *sum += weight * k;
            }
        }
    }
    sums
}

/// The sum of one component's rates at the stages with these weights.
#[inline(always)]
fn weighed<W: Weights>(k: &[Vec<f64>], component: usize) -> f64 {
    let mut sum = 0.0;
    let k = &k[..W::WEIGHTS.len()];
    for (weight, k) in W::WEIGHTS.iter().zip(k) {
        if *weight != 0.0 {
            sum += weight * k[component];
        }
    }
    sum
}

impl Workspace {
    /// Tries a step of a pair from a state whose rates are known.
    fn attempt_pair<P: Pair>(&mut self, system: &mut impl Rates, step: Step<'_>, tolerance: f64) -> Trial {
        let (Step { y, h, .. }, n, tableau) = (step, step.y.len(), P::TABLEAU);
        self.from[..n].copy_from_slice(y);
        for i in 1..tableau.stages {
            self.combine_for::<P>(i, n, h);
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
        let (mut error, rounding) = self.error::<P>(n, h, tolerance);
        if system.is_algebraic() {
            let errors: Vec<f64> = (0..y.len()).map(|j| self.estimate::<P>(h, j)).collect();
            error = error.max(system.algebraic_error(h, &self.end, &errors, tolerance));
        }
        self.outcome(error, rounding, tableau.stages - 1)
    }

    /// The state at which the rates of a stage are taken.
    fn combine_for<P: Pair>(&mut self, stage: usize, n: usize, h: f64) {
        match stage {
            1 => self.combine::<StageOf<P, 1>>(n, h),
            2 => self.combine::<StageOf<P, 2>>(n, h),
            3 => self.combine::<StageOf<P, 3>>(n, h),
            4 => self.combine::<StageOf<P, 4>>(n, h),
            5 => self.combine::<StageOf<P, 5>>(n, h),
            6 => self.combine::<StageOf<P, 6>>(n, h),
            7 => self.combine::<StageOf<P, 7>>(n, h),
            8 => self.combine::<StageOf<P, 8>>(n, h),
            9 => self.combine::<StageOf<P, 9>>(n, h),
            10 => self.combine::<StageOf<P, 10>>(n, h),
            11 => self.combine::<StageOf<P, 11>>(n, h),
            12 => self.combine::<StageOf<P, 12>>(n, h),
            13 => self.combine::<StageOf<P, 13>>(n, h),
            14 => self.combine::<StageOf<P, 14>>(n, h),
            15 => self.combine::<StageOf<P, 15>>(n, h),
            _ => unreachable!("there are {MAX_STAGES} stages at most, and the first needs no state"),
        }
    }

    /// The state at which a stage's rate is taken, given its weights.
    fn combine<W: Weights>(&mut self, n: usize, h: f64) {
        let Workspace { from, stage, k, .. } = self;
        if n <= FEW {
            for j in 0..n {
                stage[j] = from[j] + h * weighed::<W>(k, j);
            }
            return;
        }
        let (from, stage) = (from.as_chunks::<PART>().0, stage.as_chunks_mut::<PART>().0);
        let k = parts::<W>(k, from.len());
        for (block, (from, stage)) in from.iter().zip(stage).enumerate() {
            let sums = weigh::<W>(&k, block);
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
    fn error<P: Pair>(&mut self, n: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let (mut error, mut rounding): (f64, f64) = (0.0, 0.0);
        let blur = 4.0 * self.resolution / P::TABLEAU.c[1];
        // The last stage is the end of the step.
        let (from, end) = (self.from.as_chunks::<PART>().0, self.stage.as_chunks::<PART>().0);
        let high = parts::<EstimateOf<P, 0>>(&self.k, from.len());
        let low = parts::<EstimateOf<P, 1>>(&self.k, from.len());
        for (block, (from, end)) in from.iter().zip(end).enumerate() {
            let first = block * PART;
            let mut estimate = self.estimates::<EstimateOf<P, 0>>(&high, n, block);
            if P::TABLEAU.e.len() > 1 {
                for (high, low) in estimate.iter_mut().zip(self.estimates::<EstimateOf<P, 1>>(&low, n, block))
                {
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
            let mut size = from.map(f64::abs);
            for (size, is_sum) in size.iter_mut().zip(self.is_sum.iter().skip(first)) {
                *size *= if *is_sum { part_of_sum(tolerance) } else { 1.0 };
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
                let scale = tolerance * (size[j].max(h.abs() * speed) + FLOOR) + blur;
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

    /// The estimates of a part of `n` components.
    #[inline(always)]
    fn estimates<W: Weights>(&self, k: &Parts<'_>, n: usize, block: usize) -> [f64; PART] {
        match n {
            0..=FEW => std::array::from_fn(|j| if j < n { weighed::<W>(&self.k, j) } else { 0.0 }),
            _ => weigh::<W>(k, block),
        }
    }

    /// The estimated error of one component at the end of the step, with its sign.
    fn estimate<P: Pair>(&self, h: f64, component: usize) -> f64 {
        let high = h * weighed::<EstimateOf<P, 0>>(&self.k, component);
        match P::TABLEAU.e.len() {
            1 => high,
            _ => {
                let low = h * weighed::<EstimateOf<P, 1>>(&self.k, component);
                join_estimates(high, low).copysign(high)
            }
        }
    }
}

#[cfg(test)]
mod tests;
