//! Coupled modules whose equations are linear with constant coefficients: `y' = A y + b`.
//!
//! The exact flow is the exponential of a matrix. Where nobody watches the components there are no steps: it is applied
//! from the start of the phase to each time that is looked at.
//!
//! | way | what it needs | its cost |
//! |---|---|---|
//! | [`series`]: uniformisation | neighbours that weigh on each other with one sign | grows with time times the fastest rate |
//! | [`poles`]: rational approximation | a tree, and real eigenvalues | does not: stiffness costs nothing |
//! | [`steps`] | nothing | as steps do |
//!
//! At each time each way has a bound of its error, which is compared with what the values are *then*. The cheapest way
//! is tried first; one that cannot answer for its error is left, for that time only. So the state at a time depends on
//! nothing but the time.

mod build;
mod poles;
mod rational;
mod series;
mod steps;
#[cfg(test)]
mod tests;

use crate::world::state::Control;
use crate::{Settings, Stats};
use dlsys_ode::Dense;
use dlsys_tree::SimTime;
use poles::Poles;
use series::{Orthant, Series};
use steps::Steps;

/// As many products of the matrix and a vector cost about as much as the rational approximation, once.
const POLES_COST: f64 = 60.0;
/// The same where the approximation is unproven, and made three times to see how far it can be trusted. NextKind is proven is
/// worth some more.
const UNPROVEN_POLES_COST: f64 = 2_000.0;
/// More products than this are dearer than steps.
const MOST_PRODUCTS: f64 = 30_000.0;
/// Bounds of errors may be so many tolerances: they are seldom reached, and a hundred are promised.
const ALLOWED: f64 = 40.0;
/// NextKind rounds once is off by this at most, relative to its size.
const ROUNDING: f64 = 0.5 * f64::EPSILON;

/// The equations, and the state at the start.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// Row, column and value; what stands in one place several times is added up.
    pub entries: Vec<(u32, u32, f64)>,
    pub b: Vec<f64>,
    pub y: Vec<f64>,
    /// The error that is tolerated, relative to max(1, |value|).
    pub tolerance: f64,
}

impl Problem {
    /// True if no value can be off by more than is allowed, whatever the values are, given a bound of all errors.
    fn allows_all(&self, y: &[f64], bound: f64) -> bool {
        bound <= ALLOWED * self.tolerance && y.iter().fold(true, |good, y| good & y.is_finite())
    }

    /// True if no value can be off by more than is allowed, given a bound of the error of each.
    fn allows(&self, y: &[f64], bound: impl Fn(usize) -> f64) -> bool {
        let allowed = ALLOWED * self.tolerance;
        y.iter().enumerate().all(|(i, y)| y.is_finite() && bound(i) <= allowed * y.abs().max(1.0))
    }
}

/// A linear system without steps.
#[derive(Clone)]
pub struct Linear {
    problem: Problem,
    /// The unknown of each component of the coupled modules.
    unknown: Vec<u32>,
    start: SimTime,
    orthant: Orthant,
    series: Option<Series>,
    /// Of what is larger than every error of the series.
    majorant: Option<Box<Series>>,
    poles: Option<Poles>,
    steps: Option<Box<Steps>>,
}

impl Linear {
    /// None if neighbours weigh on each other with different signs: they swing.
    fn of(problem: Problem, unknown: Vec<u32>, start: SimTime) -> Option<Linear> {
        let finite = problem.entries.iter().map(|e| &e.2).chain(&problem.b).chain(&problem.y);
        if !finite.into_iter().all(|x| x.is_finite()) {
            return None;
        }
        let orthant = Orthant::new(&problem)?;
        let poles = Poles::new(&problem);
        Some(Linear { problem, unknown, start, orthant, series: None, majorant: None, poles, steps: None })
    }

    /// The components at an instant, as the dense output of a step that stays where it is. Not numbers if there are
    /// none: growth beyond all bounds. `control` is what is known of steps, should there have to be any.
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

    /// The state some time after the start, by the first way that can answer for it.
    fn without_steps(&mut self, tau: f64) -> Option<Vec<f64>> {
        let pays_above = match &self.poles {
            Some(poles) if poles.are_proven() => POLES_COST,
            Some(_) => UNPROVEN_POLES_COST,
            None => f64::INFINITY,
        };
        // To know that does not take the series.
        let surely = self.poles.as_ref().is_some_and(|poles| poles.spare(pays_above, tau));
        let poles_first = surely || self.products(tau) > pays_above;
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

    fn series(&mut self) -> &mut Series {
        self.series.get_or_insert_with(|| Series::new(&self.problem))
    }

    /// Products of the matrix and a vector that the series takes.
    fn products(&mut self, tau: f64) -> f64 {
        self.series().products(tau)
    }

    fn by_poles(&mut self, tau: f64) -> Option<Vec<f64>> {
        self.poles.as_mut()?.at(&self.problem, tau)
    }

    fn by_series(&mut self, tau: f64) -> Option<Vec<f64>> {
        self.series();
        let Linear { problem, orthant, series: Some(series), majorant, .. } = self else { return None };
        let (y, cut, rounding) = series.at(&problem.y, tau);
        // NextKind is cut off is known for all unknowns together; what is rounded, relative to the sum of all sizes.
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
            self.steps = Some(Box::new(Steps::new(&self.problem, settings, *control)));
        }
        self.steps.as_mut()?.at(&self.problem, tau, settings, stats)
    }
}
