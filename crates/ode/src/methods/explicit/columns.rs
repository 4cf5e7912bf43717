//! What a step of a pair does with all components side by side: sums of the rates at its stages, and the largest error.
//!
//! Loops run along the columns, with all stages of a sum in their body, because that is what a compiler makes wide registers of; they are built for
//! several widths ([`dlsys_wide`]). Every component is summed in the same order, alone or beside others.

use super::super::dop853::join_estimates;
use super::{Pair, Receiver};
use crate::column::{Column, Stage};
use crate::workspace::{MAX_STAGES, Workspace, part_of_sum};
use dlsys_wide::Kernel;
use std::marker::PhantomData;

/// Components whose errors are judged at a time: what is in between stays in the nearest cache.
const TILE: usize = 64;

/// Fewer components do not gain from wide registers: what is left over of whole registers takes longer than is won.
const NARROW: usize = 32;

/// Components whose dense output is computed side by side.
const MANY: usize = 8;

/// The weights of a sum over stages. They are known when this is compiled, so that zeros cost nothing and no loop is left.
pub(super) trait Weights {
    const WEIGHTS: &'static [f64];
}

/// The weights of the state at which stage `I` is evaluated.
pub(super) struct StageOf<P, const I: usize>(PhantomData<P>);

/// The weights of error estimate `I`.
pub(super) struct EstimateOf<P, const I: usize>(PhantomData<P>);

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

/// The sum of one component's rates at the stages with these weights.
#[inline(always)]
fn weighed<W: Weights>(k: &[impl Stage], component: usize) -> f64 {
    let mut sum = 0.0;
    let k = &k[..W::WEIGHTS.len()];
    for (weight, k) in W::WEIGHTS.iter().zip(k) {
        if *weight != 0.0 {
            sum += weight * k.at(component);
        }
    }
    sum
}

/// What is made of the sums of the components from `first` on.
#[inline(always)]
fn weigh<W: Weights>(
    stages: &[impl Stage; MAX_STAGES],
    first: usize,
    out: &mut [f64],
    made: impl Fn(usize, f64) -> f64,
) {
    let n = out.len();
    let mut k = [&[][..]; MAX_STAGES];
    for (k, (stage, weight)) in k.iter_mut().zip(stages.iter().zip(W::WEIGHTS)) {
        if *weight != 0.0 {
            *k = &stage[first..first + n];
        }
    }
    for (i, out) in out.iter_mut().enumerate() {
        let mut sum = 0.0;
        for (weight, k) in W::WEIGHTS.iter().zip(&k) {
            if *weight != 0.0 {
                sum += weight * k[i];
            }
        }
        *out = made(i, sum);
    }
}

/// The square of the distance of two states, summed in several parts side by side.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    const PARTS: usize = 8;
    if let ([a], [b]) = (a, b) {
        return (a - b) * (a - b);
    }
    let (whole, rest) = a.as_chunks::<PARTS>();
    let (others, other_rest) = b.as_chunks::<PARTS>();
    let mut sums = [0.0; PARTS];
    for (a, b) in whole.iter().zip(others) {
        for i in 0..PARTS {
            sums[i] += (a[i] - b[i]) * (a[i] - b[i]);
        }
    }
    let rest = rest.iter().zip(other_rest).map(|(a, b)| (a - b) * (a - b));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}

/// The state at which a stage's rate is taken.
struct Combination<'w, W, K> {
    from: &'w [f64],
    k: &'w [K; MAX_STAGES],
    stage: &'w mut [f64],
    h: f64,
    weights: PhantomData<W>,
}

impl<W: Weights, K: Stage> Kernel for Combination<'_, W, K> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let from = &self.from[..self.stage.len()];
        weigh::<W>(self.k, 0, self.stage, |i, sum| from[i] + self.h * sum);
    }
}

/// The largest errors in a step, in units of what is tolerated: by truncation and by rounding.
///
/// There may be more numbers than components, for whole registers.
struct LargestError<'w, P, K> {
    step: Tried<'w, K>,
    n: usize,
    scale: Scale,
    pair: PhantomData<P>,
}

/// What the errors of a step tried are computed from: the rates at its stages, the states at its start and at its end, which components are
/// [`Workspace::is_sum`], and their [`Workspace::noise`].
pub(super) struct Tried<'w, K> {
    pub k: &'w [K; MAX_STAGES],
    pub from: &'w [f64],
    pub end: &'w [f64],
    pub is_sum: &'w [bool],
    pub noise: &'w [f64],
}

/// What the error of a component is compared with.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    h: f64,
    tolerance: f64,
    /// The error of a change of the rates, because time is known no better.
    blur: f64,
    /// See [`FLOOR`](crate::workspace::FLOOR).
    floor: f64,
}

/// What is known of a component: its values at the start and the end, its rates there and at the second stage, the part of its value that counts
/// and the error of its rate by rounding of the state.
pub(super) struct Known {
    pub from: f64,
    pub end: f64,
    pub departure: f64,
    pub second: f64,
    pub part: f64,
    pub noise: f64,
}

impl Scale {
    /// The scale of a step of this length, with time known to a resolution.
    pub fn of<P: Pair>(h: f64, tolerance: f64, (resolution, floor): (f64, f64)) -> Scale {
        Scale { h, tolerance, blur: 4.0 * resolution / P::TABLEAU.c[1], floor }
    }

    /// The errors of a component by truncation and by rounding, given the estimate of the former.
    #[inline(always)]
    pub fn errors(self, estimate: f64, known: Known) -> (f64, f64) {
        let Known { from, end, departure, second, part, noise } = known;
        // Relative to where the step begins, and to how far it goes from there at first: what
        // grows from 1e-6 must be known to its own digits. Not to where it ends: beyond an
        // event, equations may lead anywhere, and that must not spoil the part that counts.
        // What begins from rest goes somewhere only after that: the second stage shows it.
        let speed = departure.abs().max(second.abs());
        // Rates that depend on time are known as well as time is.
        let blur = self.blur * (second - departure).abs();
        let blur = blur + 4.0 * self.h.abs() * noise;
        let scale = self.tolerance * ((from.abs() * part).max(self.h.abs() * speed) + self.floor) + blur;
        (estimate / scale, 4.0 * f64::EPSILON * end.abs() / scale)
    }
}

/// The larger of two errors; NaN if one is NaN. Numbers that are not negative have the order of their bits, which wide registers compare sooner.
#[inline(always)]
pub(super) fn worse(a: u64, error: f64) -> u64 {
    a.max(error.to_bits() & !SIGN)
}

const SIGN: u64 = 1 << 63;

impl<P: Pair, K: Stage> Kernel for LargestError<'_, P, K> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run(self) -> (f64, f64) {
        let LargestError { step: Tried { k, from, end, is_sum, noise: noises }, n, scale, .. } = self;
        let h = scale.h;
        let part_of_sum = part_of_sum(scale.tolerance);
        let has_sums = is_sum.contains(&true);
        let (mut worst, mut roundest) = (0, 0);
        let [mut part, mut noise] = [[1.0; TILE], [0.0; TILE]];
        let [mut errors, mut low, mut roundings] = [[0.0; TILE]; 3];
        for first in (0..n).step_by(TILE) {
            // What is in the padding is computed, too.
            let tile = first..(first + TILE).min(from.len());
            let len = tile.len();
            let errors = &mut errors[..len];
            if P::TABLEAU.e.len() > 1 {
                weigh::<EstimateOf<P, 0>>(k, first, errors, |_, high| h * high);
                weigh::<EstimateOf<P, 1>>(k, first, &mut low[..len], |_, low| h * low);
                for (error, low) in errors.iter_mut().zip(&low) {
                    *error = join_estimates(*error, *low);
                }
            } else {
                weigh::<EstimateOf<P, 0>>(k, first, errors, |_, high| (h * high).abs());
            }
            if has_sums {
                for (part, is_sum) in part.iter_mut().zip(&is_sum[first..]) {
                    *part = if *is_sum { part_of_sum } else { 1.0 };
                }
            }
            if !noises.is_empty() {
                noise.iter_mut().zip(&noises[first..]).for_each(|(noise, known)| *noise = *known);
            }
            // The last stage is the end of the step.
            let (from, end) = (&from[tile.clone()], &end[tile.clone()]);
            let (departure, second) = (&k[0][tile.clone()], &k[1][tile]);
            let (part, noise, roundings) = (&part[..len], &noise[..len], &mut roundings[..len]);
            for i in 0..len {
                let known = Known {
                    from: from[i],
                    end: end[i],
                    departure: departure[i],
                    second: second[i],
                    part: part[i],
                    noise: noise[i],
                };
                (errors[i], roundings[i]) = scale.errors(errors[i], known);
            }
            let there = len.min(n - first);
            worst = errors[..there].iter().fold(worst, |worst, error| worse(worst, *error));
            // Where rounding cannot be told, truncation cannot either.
            let known = roundings[..there].iter().map(|error| if error.is_nan() { 0.0 } else { *error });
            roundest = known.fold(roundest, worse);
        }
        (f64::from_bits(worst), f64::from_bits(roundest))
    }
}

/// The dense output of all components.
struct Polynomials<'w, P, K, C> {
    k: &'w [K; MAX_STAGES],
    y: &'w [f64],
    end: &'w [f64],
    h: f64,
    out: C,
    pair: PhantomData<P>,
}

impl<P: Pair, K: Stage, C: Receiver> Kernel for Polynomials<'_, P, K, C> {
    type Output = C;

    #[inline(always)]
    fn run(self) -> C {
        let Polynomials { k, y, end, h, mut out, .. } = self;
        let n = y.len();
        for first in (0..n).step_by(MANY) {
            if first + MANY > k[0].len() {
                // A part of the components has no padding behind it.
                for j in first..n {
                    P::dense::<1, K>(&[y[j]], &[end[j]], k, j, h, 1, &mut out);
                }
                break;
            }
            let count = MANY.min(n - first);
            let [mut from, mut to] = [[0.0; MANY]; 2];
            from[..count].copy_from_slice(&y[first..first + count]);
            to[..count].copy_from_slice(&end[first..first + count]);
            P::dense::<MANY, K>(&from, &to, k, first, h, count, &mut out);
        }
        out
    }
}

/// Carries out a loop over so many components.
#[inline]
fn run<K: Kernel>(components: usize, kernel: K) -> K::Output {
    if components <= NARROW { kernel.run() } else { dlsys_wide::run(kernel) }
}

/// Calls a function with the weights of a stage, which have to be known when this is compiled.
macro_rules! for_stage {
    ($stage:expr, $pair:ident, $function:ident, $($argument:expr),*) => {
        match $stage {
            1 => $function::<StageOf<$pair, 1>, _>($($argument),*),
            2 => $function::<StageOf<$pair, 2>, _>($($argument),*),
            3 => $function::<StageOf<$pair, 3>, _>($($argument),*),
            4 => $function::<StageOf<$pair, 4>, _>($($argument),*),
            5 => $function::<StageOf<$pair, 5>, _>($($argument),*),
            6 => $function::<StageOf<$pair, 6>, _>($($argument),*),
            7 => $function::<StageOf<$pair, 7>, _>($($argument),*),
            8 => $function::<StageOf<$pair, 8>, _>($($argument),*),
            9 => $function::<StageOf<$pair, 9>, _>($($argument),*),
            10 => $function::<StageOf<$pair, 10>, _>($($argument),*),
            11 => $function::<StageOf<$pair, 11>, _>($($argument),*),
            12 => $function::<StageOf<$pair, 12>, _>($($argument),*),
            13 => $function::<StageOf<$pair, 13>, _>($($argument),*),
            14 => $function::<StageOf<$pair, 14>, _>($($argument),*),
            15 => $function::<StageOf<$pair, 15>, _>($($argument),*),
            _ => unreachable!("there are no more stages, and the first needs no state"),
        }
    };
}

/// The state at which the rates of a stage are taken, for as many components as there are places in `state`.
pub(super) fn combine_for<P: Pair, K: Stage>(
    stage: usize,
    from: &[f64],
    k: &[K; MAX_STAGES],
    h: f64,
    state: &mut [f64],
) {
    for_stage!(stage, P, combine, from, k, h, state);
}

fn combine<W: Weights, K: Stage>(from: &[f64], k: &[K; MAX_STAGES], h: f64, state: &mut [f64]) {
    run(state.len(), Combination::<W, K> { from, k, stage: state, h, weights: PhantomData });
}

/// The largest error of a component in a step of several, by truncation and by rounding, in units of what is tolerated.
pub(super) fn largest_error<P: Pair>(
    step: Tried<impl Stage>,
    n: usize,
    (h, tolerance, known): (f64, f64, (f64, f64)),
) -> (f64, f64) {
    let scale = Scale::of::<P>(h, tolerance, known);
    run(n, LargestError::<P, _> { step, n, scale, pair: PhantomData })
}

/// The dense output of components from `y` to `end`, in a step of this length, in `out`.
pub(super) fn polynomials<P: Pair, K: Stage, C: Receiver>(
    k: &[K; MAX_STAGES],
    y: &[f64],
    end: &[f64],
    h: f64,
    out: C,
) -> C {
    run(y.len(), Polynomials::<P, K, C> { k, y, end, h, out, pair: PhantomData })
}

pub(super) use for_stage;

impl Workspace {
    /// The dense output of all components, from `y` on, in a step of this length.
    pub(super) fn polynomials<P: Pair>(&self, y: &[f64], h: f64) -> Vec<f64> {
        let out = Vec::with_capacity(y.len() * (P::DEGREE + 1));
        polynomials::<P, _, _>(self.stages(), y, &self.end, h, out)
    }

    /// The rates at all stages.
    fn stages(&self) -> &[Column; MAX_STAGES] {
        self.k.first_chunk().expect("all stages")
    }

    /// The state at which the rates of a stage are taken.
    pub(super) fn combine_for<P: Pair>(&mut self, stage: usize, h: f64) {
        let Workspace { from, stage: state, k, .. } = self;
        combine_for::<P, _>(stage, from, k.first_chunk().expect("all stages"), h, state);
    }

    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding.
    pub(super) fn largest_error<P: Pair>(&self, n: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let scale = Scale::of::<P>(h, tolerance, (self.resolution, self.floor));
        let Workspace { from, stage: end, is_sum, noise, .. } = self;
        let step = Tried { k: self.stages(), from, end, is_sum, noise };
        run(n, LargestError::<P, _> { step, n, scale, pair: PhantomData })
    }

    /// The estimated error of one component at the end of the step, with its sign.
    pub(super) fn estimate<P: Pair>(&self, h: f64, component: usize) -> f64 {
        if self.is_few {
            return self.estimate_of_few::<P>(h, self.end.len(), component);
        }
        let high = h * weighed::<EstimateOf<P, 0>>(&self.k, component);
        let low = h * weighed::<EstimateOf<P, 1>>(&self.k, component);
        join::<P>(high, low)
    }
}

/// The error of a component with its sign, given the estimates of a pair, of which there is one or there are two.
#[inline(always)]
pub(super) fn join<P: Pair>(high: f64, low: f64) -> f64 {
    if P::TABLEAU.e.len() == 1 { high } else { join_estimates(high, low).copysign(high) }
}

#[cfg(test)]
mod tests;
