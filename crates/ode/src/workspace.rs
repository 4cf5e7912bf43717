//! The working memory that all methods share, and the measurements on a step that need no knowledge of the method.

use crate::Rates;
use crate::column::{Column, Row};
use crate::one_step::Trial;

/// Errors below the tolerated part of this are ignored, whatever the size of the component, but for what grows from less.
pub(crate) const FLOOR: f64 = 1e-18;
/// The same where something does.
const LEAST: f64 = 1e-290;

/// The part of a component that no rate reads to which the error of a step is relative, where it goes less far in the step; more where
/// rounding is in the way.
pub(crate) fn part_of_sum(tolerance: f64) -> f64 {
    (1e-13 / tolerance).clamp(1e-3, 1.0)
}

/// A step of so many resolutions of time, in which nothing changes by more than [`NOTHING`] times the tolerance, is an instant.
const INSTANT: f64 = 1e4;
const NOTHING: f64 = 1e-3;

/// What a step tried costs beyond its evaluations of rates, in such evaluations.
const ELIMINATION: u64 = 8;

/// Components that fit into the processor's registers together. States and rates are padded to whole multiples of this; the values
/// in the padding mean nothing.
pub(crate) const PART: usize = 8;

/// The most stages of a method: those of DOP853 with its dense output.
pub(crate) const MAX_STAGES: usize = 16;

/// The rates of few components at all stages.
pub(crate) type Few = [Row; MAX_STAGES];

/// The range of each component among the states at which the rates were evaluated in a step.
#[derive(Clone, Copy, Debug)]
pub struct Reached<'s> {
    /// The least value of each component.
    pub least: &'s [f64],
    /// The greatest.
    pub greatest: &'s [f64],
}

impl Reached<'_> {
    /// The least and the greatest value of a component; None if there is no such component.
    pub fn of(&self, component: usize) -> Option<(f64, f64)> {
        Some((*self.least.get(component)?, *self.greatest.get(component)?))
    }
}

/// Working memory of a step: states and rates of all components.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// The state at the start of the step.
    pub(crate) from: Column,
    /// Rates at the stages; the first is that of the start of the step.
    pub(crate) k: Vec<Column>,
    /// The rates at the stages of the step just tried, where components are few: then [`Workspace::k`] has only those at the ends.
    pub(crate) few: Few,
    /// The step just tried is one of few components.
    pub(crate) is_few: bool,
    /// The state at which the rates of a stage are evaluated.
    pub(crate) stage: Column,
    /// The state of the stage before the last, where that is also at the end of the step.
    pub(crate) other_end: Vec<f64>,
    /// The state at the end of the step.
    pub(crate) end: Vec<f64>,
    /// The state of a stage in parts, where several threads make a step.
    pub(crate) states: Vec<Vec<f64>>,
    /// The number of components and of stages that there is room for.
    provided: (usize, usize),
    /// The least and the greatest values of the components at the stages of the step just tried, where these are kept.
    pub(crate) reached: [Vec<f64>; 2],
    pub(crate) reached_is_kept: bool,
    /// The components that no rate reads ([`Rates::mark_sums`]).
    pub(crate) is_sum: Vec<bool>,
    /// The error of each rate by rounding of the state; empty unless noise was measured.
    pub(crate) noise: Vec<f64>,
    /// The resolution of time at the start of the step if rates depend on time, otherwise 0.
    pub(crate) resolution: f64,
    /// The same if they depend on time or an age.
    pub(crate) tick: f64,
    /// See [`FLOOR`].
    pub(crate) floor: f64,
    /// Evaluations of the equations of single modules so far.
    pub(crate) evaluations: u64,
    /// Steps of single modules tried so far.
    pub(crate) trials: u64,
    /// The components, in ascending order, that err by more than is tolerated in the step just tried, and are to be integrated again.
    pub(crate) rough: Vec<u32>,
}

impl Workspace {
    /// Fits the memory to systems of `n` components, and makes room for so many stages.
    pub fn provide(&mut self, n: usize, stages: usize) {
        self.end.resize(n, 0.0);
        self.floor = FLOOR;
        if self.provided == (n, stages) {
            return;
        }
        self.provided = (n, stages);
        let places = n.next_multiple_of(PART);
        if self.k.is_empty() {
            self.k.resize(MAX_STAGES, Column::default());
        }
        self.k[..stages].iter_mut().for_each(|k| k.resize(places));
        self.from.resize(places);
        self.stage.resize(places);
        self.other_end.resize(n, 0.0);
    }

    /// Gives back all memory of the step just made that the next one does not read: all but one stage, and the end.
    pub(crate) fn give_back(&mut self, carried: usize) {
        let others = self.k.iter_mut().enumerate().filter(|(stage, _)| *stage != carried);
        others.map(|(_, k)| k).chain([&mut self.from, &mut self.stage]).for_each(|k| *k = Column::default());
        (self.other_end, self.states) = (Vec::new(), Vec::new());
        self.provided = (0, 0);
    }

    /// What all steps have cost so far, in evaluations of one module's equations.
    pub(crate) fn cost(&self) -> u64 {
        self.evaluations + ELIMINATION * self.trials
    }

    /// Keeps the range of the components at the stages, or does not.
    pub(crate) fn keep_reached(&mut self, is_kept: bool) {
        self.reached_is_kept = is_kept;
        if is_kept {
            let places = self.stage.len();
            self.reached.iter_mut().for_each(|values| values.resize(places, 0.0));
        }
    }

    /// Includes the state of a stage in the range; the first stage begins a new one.
    pub(crate) fn reach(&mut self, is_first: bool) {
        if !self.reached_is_kept {
            return;
        }
        let n = self.end.len();
        let [least, greatest] = &mut self.reached;
        if is_first {
            least[..n].copy_from_slice(&self.from[..n]);
            greatest[..n].copy_from_slice(&self.from[..n]);
        }
        for ((least, greatest), value) in least.iter_mut().zip(greatest).zip(self.stage.head(n)) {
            *least = least.min(*value);
            *greatest = greatest.max(*value);
        }
    }

    /// Evaluates the rates at the state `self.stage`, for a stage.
    pub(crate) fn evaluate(&mut self, system: &mut impl Rates, tau: f64, stage: usize) {
        self.evaluations += system.modules();
        let n = self.end.len();
        system.rates(tau, self.stage.head(n), self.k[stage].head_mut(n));
    }

    /// Computes the rates at the start of a step.
    ///
    /// # Errors
    ///
    /// The first component whose rate is not finite.
    pub fn start(&mut self, system: &mut impl Rates, y: &[f64]) -> Result<(), usize> {
        self.stage[..y.len()].copy_from_slice(y);
        self.is_sum.clear();
        self.is_sum.resize(y.len(), false);
        system.mark_sums(&mut self.is_sum);
        self.evaluate(system, 0.0, 0);
        self.rates_at_start().iter().position(|x| !x.is_finite()).map_or(Ok(()), Err)
    }

    /// The state at the end of the step just tried.
    pub fn end(&self) -> &[f64] {
        &self.end
    }

    /// The rates at the start of the step.
    pub fn rates_at_start(&self) -> &[f64] {
        &self.k[0][..self.end.len()]
    }

    /// The outcome of a step with these errors whose end and whose rates there, those of stage `last`, are known.
    pub(crate) fn outcome(&self, error: f64, rounding: f64, last: usize) -> Trial {
        let rates = &self.k[last][..self.end.len()];
        // All are looked at before any is searched for: that goes side by side.
        let are_finite = |all: &[f64]| all.iter().fold(true, |finite, x| finite & x.is_finite());
        if error.is_finite() && are_finite(&self.end) && are_finite(rates) {
            return Trial::Done { error, rounding };
        }
        let first_bad = |all: &[f64]| all.iter().position(|x| !x.is_finite());
        Trial::NotFinite(first_bad(&self.end).or_else(|| first_bad(rates)).unwrap_or(0))
    }

    /// The length of a first step over which the solution changes little, for a method of order `order`: in units of simulated time,
    /// more than 0. One evaluation of the rates (Hairer, Nørsett and Wanner 1993, section II.4).
    pub(crate) fn first_size(
        &mut self,
        order: u32,
        system: &mut impl Rates,
        y: &[f64],
        tolerance: f64,
    ) -> f64 {
        let f = &self.k[0][..y.len()];
        let norm = |v: &[f64]| {
            v.iter().zip(y).fold(0.0f64, |m, (v, y)| m.max((v / (tolerance * (1.0 + y.abs()))).abs()))
        };
        let (d0, d1) = (norm(y), norm(f));
        if y.is_empty() || d1 == 0.0 {
            return 1e-3;
        }
        let guess = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 };
        for (s, (y, f)) in self.stage.iter_mut().zip(y.iter().zip(f)) {
            *s = y + guess * f;
        }
        self.evaluate(system, guess, 1);
        let bend: Vec<f64> = self.k[1].iter().zip(self.k[0].iter()).map(|(a, b)| a - b).collect();
        let most = d1.max(norm(&bend) / guess);
        let order = f64::from(order + 1);
        let next = if most <= 1e-15 { (guess * 1e-3).max(1e-6) } else { (0.01 / most).powf(1.0 / order) };
        let size = next.min(100.0 * guess);
        if size.is_finite() && size > 0.0 { size } else { 1e-6 }
    }

    /// Finds below which size of a component errors are ignored. What grows by itself keeps its relative error however small it is, and may
    /// become large; among components of several modules that would make steps short where next to nothing of something has arrived.
    pub(crate) fn find_floor(&mut self, system: &impl Rates, y: &[f64]) {
        let grows = |(y, rate): (&f64, &f64)| {
            *y != 0.0 && y.abs() < FLOOR && *rate != 0.0 && (*y > 0.0) == (*rate > 0.0)
        };
        let is_least = system.stands_alone() && y.iter().zip(self.k[0].iter()).any(grows);
        self.floor = if is_least { LEAST } else { FLOOR };
    }

    /// Estimates the error of each rate by rounding of the state, from the partial derivatives, and of its terms.
    pub(crate) fn measure_noise(&mut self, system: &mut impl Rates, y: &[f64]) {
        let (couplings, mut partials) = (system.couplings(), Vec::new());
        system.partials(0.0, y, &mut partials);
        self.noise.clear();
        self.noise.resize(y.len(), 0.0);
        for (&(row, column), slope) in couplings.iter().zip(&partials) {
            let part = f64::EPSILON * (slope * y[column as usize]).abs();
            self.noise[row as usize] += if part.is_finite() { part } else { 0.0 };
        }
        system.add_rounding(0.0, y, &mut self.noise);
    }

    /// True for a step so short that no more than a small part of the tolerance can change in it, however rates may jump. Shorter
    /// steps do not help where a rate leaves zero like a root, or jumps where no condition says so.
    pub(crate) fn is_instant(&self, y: &[f64], h: f64, resolution: f64, tolerance: f64) -> bool {
        let change =
            |most: f64| y.iter().zip(&self.end).all(|(y, end)| (end - y).abs() <= most * y.abs().max(1.0));
        h <= INSTANT * resolution && change(NOTHING * tolerance) || h <= 4.0 * resolution && change(1e-9)
    }

    /// The component whose rate at the start is largest for its size.
    pub(crate) fn worst(&self, y: &[f64]) -> usize {
        let size = |i: usize| (self.k[0][i] / (1.0 + y[i].abs())).abs();
        (0..y.len()).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
    }
}
