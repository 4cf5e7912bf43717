//! What a Radau IIA step needs of its system, and the choice between three and five stages.

use super::newton::Newton;
use crate::one_step::InteriorError;
use crate::sparse::Pattern;

/// A system y' = f(tau, y); `tau` is the time since the beginning of the step tried.
pub trait Stiff {
    /// Writes f(tau, y) to `out`.
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
    /// Writes df/dy at places `Pattern::entry` of `out`, which is filled with 0 before. Need not be exact, unless the system is linear.
    fn jacobian(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
    /// What is known of the system beforehand.
    fn form(&self) -> Form {
        Form::Any
    }
}

/// What is known of a system beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Nothing.
    Any,
    /// df/dy is the same everywhere, and f depends on y alone.
    LinearSteady,
}

/// The start of a step.
#[derive(Clone, Copy)]
pub struct Start<'a> {
    /// The structure of the Jacobian.
    pub pattern: &'a Pattern,
    /// The state.
    pub y: &'a [f64],
    /// Its rates: f(0, y).
    pub rate: &'a [f64],
    /// The error tolerated in each component, more than 0.
    pub scale: &'a [f64],
    /// The relative error tolerated in what was next to nothing and is driven.
    pub tolerance: f64,
}

/// Outcome of a step tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attempt {
    /// The stages are found.
    Done {
        /// Largest estimated error as a share of the allowed one; a good step has at most 1. The estimate is
        /// of order s + 1 in the step length: a new step is `h * 0.9 * error^(-1 / (s + 1))`, but not longer
        /// than this one if this one followed a failure: the estimate is then filtered twice and says little
        /// about stiff components.
        error: f64,
        /// Newton iterations needed.
        newton: u32,
    },
    /// Newton's iteration does not converge (even with a new Jacobian), or a pivot vanishes: try a shorter
    /// step.
    Diverged,
    /// A value is not finite: the component if it is known; `None` also for arguments that make no sense.
    NotFinite(Option<usize>),
}

/// What an attempt began with.
#[derive(Clone, Copy)]
pub struct Beginning<'a> {
    /// The state.
    pub y: &'a [f64],
    /// Its rates.
    pub rates: &'a [f64],
    /// The components that are integrated again.
    pub rough: &'a [u32],
}

/// The method of three or of five stages. Holds the work space, the Jacobian and its factors, and the step before.
#[derive(Clone)]
pub enum Stages {
    /// Order 5.
    Three(Box<Newton<3, 2>>),
    /// Order 9.
    Five(Box<Newton<5, 3>>),
}

macro_rules! each {
    ($self:ident, $newton:ident => $body:expr) => {
        match $self {
            Stages::Three($newton) => $body,
            Stages::Five($newton) => $body,
        }
    };
}

impl Stages {
    /// The method of 3 stages (order 5), or, for any greater number, of 5 (order 9).
    pub fn of(count: usize) -> Stages {
        if count <= 3 {
            Stages::Three(Box::new(Newton::new()))
        } else {
            Stages::Five(Box::new(Newton::new()))
        }
    }

    /// The number of stages.
    pub fn count(&self) -> usize {
        self.nodes().len()
    }

    /// The nodes of the stages, as parts of a step.
    pub fn nodes(&self) -> &[f64] {
        each!(self, newton => newton.nodes())
    }

    /// The error inside the last attempt done, at two places between stages: by the defect, the difference between the rates of the
    /// equations and that of the output, filtered as the estimate at the end is. `rates` evaluates rates.
    pub fn interior_error(
        &self,
        pattern: &Pattern,
        beginning: Beginning<'_>,
        rates: impl FnMut(f64, &[f64], &mut [f64]),
    ) -> InteriorError {
        each!(self, newton => newton.interior_error(pattern, beginning, rates))
    }

    /// Tries a step of length `h` (not 0). An attempt after one that was not accepted must have the same start, else call
    /// `forget` before.
    pub fn attempt(&mut self, problem: &mut impl Stiff, start: &Start<'_>, h: f64) -> Attempt {
        each!(self, newton => newton.attempt(problem, start, h))
    }

    /// The estimated error of each component in the last attempt done, as a share of the allowed one.
    pub fn component_errors(&self) -> &[f64] {
        each!(self, newton => &newton.shares)
    }

    /// The largest estimated error of a component in the last attempt done, which began at `y`, relative to max(1, |value|).
    pub fn absolute_error(&self, y: &[f64]) -> f64 {
        each!(self, newton => newton.absolute_error(y))
    }

    /// Says that the next attempt continues at the end of the last one, if that was done.
    pub fn accept(&mut self) {
        each!(self, newton => newton.accept());
    }

    /// Forgets Jacobian, factors and the step before: to be called when the system, the pattern or (other
    /// than by an accepted step) the state has changed.
    pub fn forget(&mut self) {
        each!(self, newton => newton.forget());
    }

    /// State at the end of the last attempt done.
    pub fn end(&self) -> &[f64] {
        each!(self, newton => &newton.end)
    }

    /// Collocation polynomial of the last attempt done, which began at `y`: for each component its s + 1
    /// Bernstein coefficients on 0 .. 1 (shares of the step), the first exactly `y`, the last exactly `end`.
    ///
    /// Its error inside the step is of order h^(s + 1). Of use until the next attempt, also after `accept`.
    pub fn dense(&self, y: &[f64], out: &mut Vec<f64>) {
        each!(self, newton => newton.dense(y, out));
    }

    /// Evaluations of the rates so far, those by the caller not counted.
    #[cfg(test)]
    pub fn rates_used(&self) -> u64 {
        each!(self, newton => newton.rates_used)
    }

    /// Factorisations so far (all lanes together count once).
    #[cfg(test)]
    pub fn factorisations(&self) -> u64 {
        each!(self, newton => newton.factorisations)
    }
}
