//! Coupled modules whose equations are linear with constant coefficients: `y' = A y + b`.
//!
//! The exact flow is the exponential of a matrix. Where no condition has to be searched for events there are no steps:
//! the exponential is applied from the start of the trajectory to each time that is observed.
//!
//! | method | condition | cost |
//! |---|---|---|
//! | [`series`]: uniformisation | the influences between two neighbours have one sign | proportional to time times the fastest rate |
//! | [`poles`]: rational approximation | a tree, and real eigenvalues | independent of time and stiffness |
//! | [`steps`] | none | that of steps |
//!
//! At each time each method has a bound of its error, which is compared with the values at that time. The cheapest
//! method is tried first; one whose bound is too large is rejected for that time only. So the state at a time depends
//! on nothing but the time.

mod build;
mod poles;
mod rational;
mod series;
mod steps;
#[cfg(test)]
mod tests;

use crate::world::state::Control;
use crate::{Settings, Stats};
pub use build::chain;
use dlsys_ode::Dense;
use dlsys_tree::SimTime;
use poles::Poles;
use series::{Orthant, Series};
use steps::LinearSteps;

/// As many products of the matrix and a vector cost about as much as the rational approximation, once.
const POLES_COST: f64 = 60.0;
/// The same where the approximation has no bound of its error, so that it is made three times for an estimate, and the
/// series is preferred for longer.
const UNPROVEN_POLES_COST: f64 = 2_000.0;
/// More products than this cost more than steps.
const MOST_PRODUCTS: f64 = 30_000.0;
/// Bounds of errors may be this many tolerances: they are seldom reached, and the documented limit is a hundred.
const ALLOWED: f64 = 40.0;
/// The largest relative error of one rounding.
const ROUNDING: f64 = 0.5 * f64::EPSILON;

/// The equations `y' = A y + b`, and the state at the start.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// The entries of A: row, column and value; several entries of one place are added up.
    pub entries: Vec<(u32, u32, f64)>,
    /// The constant term.
    pub b: Vec<f64>,
    /// The state at the start.
    pub y: Vec<f64>,
    /// The tolerated error, relative to max(1, |value|).
    pub tolerance: f64,
}

impl Problem {
    /// True if the values are finite and a bound of all their errors is allowed, whatever the values are.
    fn allows_all(&self, y: &[f64], bound: f64) -> bool {
        bound <= ALLOWED * self.tolerance && y.iter().fold(true, |good, y| good & y.is_finite())
    }

    /// True if the values are finite and the bound of the error of each is allowed.
    fn allows(&self, y: &[f64], bound: impl Fn(usize) -> f64) -> bool {
        let allowed = ALLOWED * self.tolerance;
        y.iter().enumerate().all(|(i, y)| y.is_finite() && bound(i) <= allowed * y.abs().max(1.0))
    }
}

/// The solution of a linear system, evaluated at any time without steps where that is possible.
#[derive(Clone)]
pub struct Linear {
    problem: Problem,
    /// By component of the coupled modules: the index of the unknown.
    unknown: Vec<u32>,
    start: SimTime,
    orthant: Orthant,
    series: Option<Series>,
    /// A series whose values bound the sizes of all terms of `series`.
    majorant: Option<Box<Series>>,
    /// None as long as they have not been needed; None inside if there are none.
    poles: Option<Option<Poles>>,
    /// The largest coefficient.
    fastest: f64,
    steps: Option<Box<LinearSteps>>,
}

impl Linear {
    /// None if neighbours influence each other with different signs, so that the solution oscillates.
    fn of(problem: Problem, unknown: Vec<u32>, start: SimTime) -> Option<Linear> {
        let finite = problem.entries.iter().map(|e| &e.2).chain(&problem.b).chain(&problem.y);
        if !finite.into_iter().all(|x| x.is_finite()) {
            return None;
        }
        let orthant = Orthant::new(&problem)?;
        let fastest = problem.entries.iter().fold(0.0f64, |m, e| m.max(e.2.abs()));
        let (series, majorant, poles, steps) = Default::default();
        Some(Linear { problem, unknown, start, orthant, series, majorant, poles, fastest, steps })
    }

    /// The components at an instant, as the dense output of a step of length 0. NaN where the solution exceeds the
    /// range of numbers. `control` is the experience of step control, in case steps are needed.
    pub fn at(&mut self, at: SimTime, settings: &Settings, control: &Control, stats: &mut Stats) -> Dense {
        let tau = at.since(self.start).max(0.0);
        let mut y = match tau {
            0.0 => self.problem.y.clone(),
            _ => self
                .without_steps(tau)
                .or_else(|| self.with_steps(tau, settings, control, stats))
                .unwrap_or_else(|| vec![f64::NAN; self.problem.y.len()]),
        };
        self.orthant.confine(&mut y);
        let components = self.unknown.iter().map(|n| y[*n as usize]).collect();
        Dense::new(at, Some(at), 0.0, 0, components)
    }

    /// The state some time after the start, by the first method without steps whose error is within its bound.
    fn without_steps(&mut self, tau: f64) -> Option<Vec<f64>> {
        let poles_first = !self.takes_few_products(tau) && {
            let pays_above = match self.poles() {
                Some(poles) if poles.are_proven() => POLES_COST,
                Some(_) => UNPROVEN_POLES_COST,
                None => f64::INFINITY,
            };
            // This test does not need the series.
            let surely = self.poles().is_some_and(|poles| poles.spare(pays_above, tau));
            surely || self.products(tau) > pays_above
        };
        if poles_first && let Some(y) = self.by_poles(tau) {
            return Some(y);
        }
        if self.products(tau) <= MOST_PRODUCTS
            && let Some(y) = self.by_series(tau)
        {
            return Some(y);
        }
        if poles_first { None } else { self.by_poles(tau) }
    }

    /// True if no other method was good enough for some time.
    pub fn has_taken_steps(&self) -> bool {
        self.steps.is_some()
    }

    fn series(&mut self) -> &mut Series {
        self.series.get_or_insert_with(|| Series::new(&self.problem))
    }

    /// The number of products of the matrix and a vector that the series takes.
    fn products(&mut self, tau: f64) -> f64 {
        self.series().products(tau)
    }

    /// True if the series takes so few products up to a time that the rational approximation need not be looked at.
    fn takes_few_products(&mut self, tau: f64) -> bool {
        // At least as many as the largest coefficient makes: often this decides, without the series.
        self.fastest * tau <= POLES_COST && self.products(tau) <= POLES_COST
    }

    /// The rational approximation, if there is one.
    fn poles(&mut self) -> Option<&mut Poles> {
        self.poles.get_or_insert_with(|| Poles::new(&self.problem)).as_mut()
    }

    fn by_poles(&mut self, tau: f64) -> Option<Vec<f64>> {
        self.poles();
        self.poles.as_mut()?.as_mut()?.at(&self.problem, tau)
    }

    fn by_series(&mut self, tau: f64) -> Option<Vec<f64>> {
        self.series();
        let Linear { problem, orthant, series: Some(series), majorant, .. } = self else { return None };
        let (y, cut, rounding) = series.at(&problem.y, tau);
        // The truncation error is bounded for all unknowns together, the rounding error relative to the sum of all
        // sizes.
        let largest = series.largest(tau);
        if problem.allows(&y, |i| cut + rounding * if orthant.holds(i) { y[i].abs() } else { largest }) {
            return Some(y);
        }
        if orthant.holds_everywhere() || !cut.is_finite() {
            return None;
        }
        let sizes: Vec<f64> = problem.y.iter().map(|y| y.abs()).collect();
        let majorant = majorant.get_or_insert_with(|| Box::new(series.majorant()));
        let (sizes, more, _) = majorant.at(&sizes, tau);
        problem.allows(&y, |i| cut + rounding * (sizes[i] + more)).then_some(y)
    }

    fn with_steps(
        &mut self,
        tau: f64,
        settings: &Settings,
        control: &Control,
        stats: &mut Stats,
    ) -> Option<Vec<f64>> {
        if self.steps.as_ref().is_none_or(|steps| steps.have_passed(tau)) {
            self.steps = Some(Box::new(LinearSteps::new(&self.problem, settings, *control)));
        }
        self.steps.as_mut()?.at(&self.problem, tau, settings, stats)
    }
}
