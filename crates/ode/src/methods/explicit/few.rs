//! Steps of a pair with few components: those of a module that is integrated alone.
//!
//! Stages and states are arrays of known length in the nearest memory, all weights are numbers in the code, and components are side by side. In the
//! columns that serve thousands of components ([`columns`](super::columns)), finding the number would take several times longer than what is done with it. Each
//! component is summed in the same order as there: the bits are the same.

use super::Pair;
use super::columns::{EstimateOf, Known, Scale, StageOf, Weights, for_stage, join, worse};
use crate::Rates;
use crate::column::Row;
use crate::dense::Dense;
use crate::one_step::Step;
use crate::workspace::{Few, Workspace, part_of_sum};
use dlsys_expr::SimTime;

/// The sums of the rates of `N` components at the stages with these weights.
#[inline(always)]
fn weighed<W: Weights, const N: usize>(k: &Few) -> [f64; N] {
    let mut sums = [0.0; N];
    for (stage, weight) in W::WEIGHTS.iter().enumerate() {
        if *weight != 0.0 {
            for (sum, k) in sums.iter_mut().zip(&k[stage].0) {
                *sum += weight * k;
            }
        }
    }
    sums
}

/// The state at which the rates of a stage are taken.
fn combine<W: Weights, const N: usize>(from: &[f64; N], k: &Few, h: f64) -> [f64; N] {
    let mut state = weighed::<W, N>(k);
    for j in 0..N {
        state[j] = from[j] + h * state[j];
    }
    state
}

/// The first values of a list.
#[inline(always)]
fn first<const N: usize>(values: &[f64]) -> [f64; N] {
    let mut first = [0.0; N];
    first.copy_from_slice(&values[..N]);
    first
}

/// Calls a method of the workspace for the number of components.
macro_rules! for_number {
    ($n:expr, $pair:ty, $work:ident.$method:ident($($argument:expr),*)) => {
        match $n {
            1 => $work.$method::<$pair, 1>($($argument),*),
            2 => $work.$method::<$pair, 2>($($argument),*),
            3 => $work.$method::<$pair, 3>($($argument),*),
            4 => $work.$method::<$pair, 4>($($argument),*),
            _ => unreachable!("more are not few"),
        }
    };
}

impl Workspace {
    /// Tries a step of few components from a state whose rates are known.
    pub(super) fn attempt_few<P: Pair>(
        &mut self,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> (f64, f64) {
        for_number!(step.y.len(), P, self.attempt_number(system, step, tolerance))
    }

    fn attempt_number<P: Pair, const N: usize>(
        &mut self,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> (f64, f64) {
        let (Step { y, h, .. }, tableau) = (step, P::TABLEAU);
        let from = first::<N>(y);
        let (mut least, mut greatest, mut state) = (from, from, from);
        self.few[0].0[..N].copy_from_slice(self.k[0].head(N));
        for i in 1..tableau.stages {
            if i + 1 == tableau.stages {
                self.other_end.copy_from_slice(&state);
            }
            state = for_stage!(i, P, combine, &from, &self.few, h);
            for j in 0..N {
                (least[j], greatest[j]) = (least[j].min(state[j]), greatest[j].max(state[j]));
            }
            system.rates(tableau.c[i] * h, &state, &mut self.few[i].0[..N]);
        }
        self.evaluations += system.modules() * (tableau.stages as u64 - 1);
        // The last stage is the end of the step.
        self.end.copy_from_slice(&state);
        if self.reached_is_kept {
            self.reached[0][..N].copy_from_slice(&least);
            self.reached[1][..N].copy_from_slice(&greatest);
        }
        for stage in [tableau.stages - 2, tableau.stages - 1] {
            self.k[stage].head_mut(N).copy_from_slice(&self.few[stage].0[..N]);
        }
        self.is_few = true;
        self.error_of_few::<P, N>(&from, (h, tolerance))
    }

    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding.
    fn error_of_few<P: Pair, const N: usize>(
        &self,
        from: &[f64; N],
        (h, tolerance): (f64, f64),
    ) -> (f64, f64) {
        let scale = Scale::of::<P>(h, tolerance, (self.resolution, self.floor));
        let (mut worst, mut roundest) = (0, 0.0f64);
        let estimates = self.estimates_of_few::<P, N>(h);
        for j in 0..N {
            let is_sum = self.is_sum.get(j).is_some_and(|is_sum| *is_sum);
            let known = Known {
                from: from[j],
                end: self.end[j],
                departure: self.few[0].0[j],
                second: self.few[1].0[j],
                part: if is_sum { part_of_sum(tolerance) } else { 1.0 },
                noise: self.noise.get(j).copied().unwrap_or(0.0),
            };
            let (error, rounding) = scale.errors(estimates[j].abs(), known);
            worst = worse(worst, error);
            roundest = roundest.max(rounding);
        }
        (f64::from_bits(worst), roundest)
    }

    /// The estimated errors of the components at the end of the step, with their signs.
    fn estimates_of_few<P: Pair, const N: usize>(&self, h: f64) -> [f64; N] {
        let mut errors = weighed::<EstimateOf<P, 0>, N>(&self.few);
        let low = weighed::<EstimateOf<P, 1>, N>(&self.few);
        for j in 0..N {
            errors[j] = join::<P>(h * errors[j], h * low[j]);
        }
        errors
    }

    /// The estimated error of one of few components.
    pub(super) fn estimate_of_few<P: Pair>(&self, h: f64, n: usize, component: usize) -> f64 {
        fn all<P: Pair, const N: usize>(work: &Workspace, h: f64, component: usize) -> f64 {
            work.estimates_of_few::<P, N>(h)[component]
        }
        match n {
            1 => all::<P, 1>(self, h, component),
            2 => all::<P, 2>(self, h, component),
            3 => all::<P, 3>(self, h, component),
            _ => all::<P, 4>(self, h, component),
        }
    }

    /// The dense output of a step of few components.
    pub(super) fn dense_few<P: Pair>(
        &mut self,
        system: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        for_number!(step.y.len(), P, self.dense_number(system, step, end))
    }

    fn dense_number<P: Pair, const N: usize>(
        &mut self,
        system: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        let (Step { y, start, h }, tableau) = (step, P::TABLEAU);
        let from = first::<N>(y);
        let (mut least, mut greatest) = (from, from);
        for i in tableau.stages..tableau.a.len() {
            let state = for_stage!(i, P, combine, &from, &self.few, h);
            for j in 0..N {
                (least[j], greatest[j]) = (least[j].min(state[j]), greatest[j].max(state[j]));
            }
            system.rates(tableau.c[i] * h, &state, &mut self.few[i].0[..N]);
        }
        self.evaluations += system.modules() * (tableau.a.len() - tableau.stages) as u64;
        if self.reached_is_kept {
            for j in 0..N {
                self.reached[0][j] = self.reached[0][j].min(least[j]);
                self.reached[1][j] = self.reached[1][j].max(greatest[j]);
            }
        }
        let to = first::<N>(&self.end);
        let mut out = Vec::with_capacity(N * (P::DEGREE + 1));
        P::dense::<N, Row>(&from, &to, &self.few, 0, h, N, &mut out);
        Dense::new(start, end, h, P::DEGREE, out)
    }
}
