//! Radau IIA collocation steps for stiff systems: s = 3 or 5 stages, order 2s - 1, L-stable.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed. 1996), section IV.8, and the
//! same authors' "Stiff differential equations solved by Radau methods", J. Comput. Appl. Math. 111 (1999)
//! 93. The stages' linear systems are decoupled by the eigenvectors of the inverse Runge-Kutta matrix; the
//! real and the complex ones are eliminated side by side, as lanes of one wide number. A [`Radau`] tries
//! single steps: step control, events and time belong to the caller.

mod collocation;
mod method;

use crate::sparse::Pattern;
use method::Method;

/// A system y' = f(tau, y); `tau` is the time since the beginning of the step tried.
pub trait Stiff {
    /// Writes f(tau, y) to `out`.
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
    /// Writes df/dy at places `Pattern::entry` of `out`, which comes filled with 0. Need not be exact.
    fn jacobian(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
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

#[derive(Clone)]
enum Kind {
    Three(Box<Method<3, 2>>),
    Five(Box<Method<5, 3>>),
}

/// Radau IIA steps. Holds the work space, the Jacobian and its factors, and the step before.
#[derive(Clone)]
pub struct Radau(Kind);

macro_rules! each {
    ($self:ident, $method:ident => $body:expr) => {
        match &$self.0 {
            Kind::Three($method) => $body,
            Kind::Five($method) => $body,
        }
    };
    (mut $self:ident, $method:ident => $body:expr) => {
        match &mut $self.0 {
            Kind::Three($method) => $body,
            Kind::Five($method) => $body,
        }
    };
}

impl Radau {
    /// The nodes of the stages, as parts of a step.
    pub fn nodes(&self) -> &[f64] {
        each!(self, method => method.nodes())
    }

    /// A method of 3 stages (order 5) or 5 stages (order 9); `None` for any other number.
    pub fn new(stages: usize) -> Option<Radau> {
        match stages {
            3 => Some(Radau(Kind::Three(Box::new(Method::new())))),
            5 => Some(Radau(Kind::Five(Box::new(Method::new())))),
            _ => None,
        }
    }

    /// Tries a step of length `h` (not 0) from `y`, where `rate` = f(0, y). `scale` > 0 is the error allowed
    /// in each component. An attempt after one that was not accepted must start from the same `y`, else call
    /// `forget`.
    pub fn attempt(
        &mut self,
        problem: &mut impl Stiff,
        pattern: &Pattern,
        y: &[f64],
        rate: &[f64],
        h: f64,
        scale: &[f64],
    ) -> Attempt {
        each!(mut self, m => m.attempt(problem, pattern, y, rate, h, scale))
    }

    /// Says that the next attempt continues at the end of the last one, if that was done.
    pub fn accept(&mut self) {
        each!(mut self, m => m.accept())
    }

    /// Forgets Jacobian, factors and the step before: to be called when the system, the pattern or (other
    /// than by an accepted step) the state has changed.
    pub fn forget(&mut self) {
        each!(mut self, m => m.forget())
    }

    /// State at the end of the last attempt done.
    pub fn end(&self) -> &[f64] {
        each!(self, m => &m.end)
    }

    /// Collocation polynomial of the last attempt done, which began at `y`: for each component its s + 1
    /// Bernstein coefficients on 0 .. 1 (shares of the step), the first exactly `y`, the last exactly `end`.
    ///
    /// Its error inside the step is of order h^(s + 1). Of use until the next attempt, also after `accept`.
    pub fn dense(&self, y: &[f64], out: &mut Vec<f64>) {
        each!(self, m => m.dense(y, out))
    }

    /// Evaluations of the rates so far, those by the caller not counted.
    #[cfg(test)]
    pub fn rates_used(&self) -> u64 {
        each!(self, m => m.rates_used)
    }

    /// Factorisations so far (all lanes together count once).
    #[cfg(test)]
    pub fn factorisations(&self) -> u64 {
        each!(self, m => m.factorisations)
    }
}

#[cfg(test)]
mod tests;
