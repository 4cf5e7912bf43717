//! The interface of one-step methods: all that step control ([`Stepper`](crate::Stepper)) needs of a method.
//!
//! A method tries a step from a state whose rates are in the [`Workspace`], leaves the state at its end there, and tells the
//! estimated error. The step is then accepted, or tried again with another length. Only an accepted step has a dense output
//! computed, and only where it is needed: a method may have to evaluate further rates for it.

use crate::Rates;
use crate::dense::Dense;
use crate::workspace::Workspace;
use dlsys_expr::SimTime;

/// The outcome of a trial step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trial {
    /// The state at the end is in the workspace.
    Done {
        /// The largest estimated truncation error of a component, in units of the tolerated error; 0 for methods without an
        /// estimate.
        error: f64,
        /// The largest error of a component by rounding, in the same units.
        rounding: f64,
    },
    /// A rate or a value in the step was not finite: the component.
    NotFinite(usize),
    /// The equations of the stages of an implicit method could not be solved.
    Diverged,
}

/// The error of a dense output inside its step, as far as it is known.
#[derive(Clone, Copy, Debug, Default)]
pub struct InteriorError {
    /// As a part of the values and of their changes in the step.
    pub relative: f64,
    /// Relative to max(1, |value|).
    pub absolute: f64,
}

/// A step from a state `y` at `start`, of length `h` in units of simulated time.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The state at the start.
    pub y: &'a [f64],
    /// The time of the start.
    pub start: SimTime,
    /// The length.
    pub h: f64,
}

/// A method that computes the state at the end of a step from the state at its start.
///
/// Its coefficients are constants of the type; what it remembers from one step to the next (a Jacobian, its factors) are fields.
/// A method is added by a file with an implementation, and a line in the table in `methods/mod.rs`. Explicit Runge-Kutta pairs
/// implement `Pair` (`methods/explicit.rs`) and get the rest from there.
pub trait OneStep {
    /// The tolerated error of a single step, as a part of the tolerance of a run: errors of steps add up, and move the times of
    /// events, which move everything after them.
    const TOLERANCE_SHARE: f64 = 0.1;

    /// True if the dense output may be much worse inside a step than the estimate at its end says, so that it has to be measured
    /// ([`OneStep::interior_error`]) where events are searched for.
    const INTERIOR_IS_MEASURED: bool = false;

    /// True if the workspace knows the range of the states at the stages ([`Stepper::reached`](crate::Stepper::reached)).
    const STAGES_ARE_KEPT: bool = false;

    /// Prepares for steps with a tolerance (that of a single step): a family of methods chooses its member.
    fn prepare(&mut self, _tolerance: f64) {}

    /// Drops all memory of the system: the next step is one of another system, or starts elsewhere.
    fn forget(&mut self) {}

    /// The order `q` of the error estimate: it falls like `h^(q + 1)`.
    fn error_order(&self) -> u32;

    /// The order from which the length of the very first step is guessed.
    fn starting_order(&self) -> u32 {
        self.error_order()
    }

    /// The number of stages of the workspace that a step and its dense output use; no less than two, which the first step is guessed with.
    fn stages(&self) -> usize;

    /// The stage that [`OneStep::accept`] makes the first of the next step, if there is one.
    fn carried(&self) -> usize {
        0
    }

    /// Where in a step the rates are evaluated that its error estimate depends on, as fractions of it, from 0 to 1.
    fn nodes(&self) -> &[f64];

    /// Tries a step, whose rates at the start are known to the workspace; leaves its end there.
    fn attempt(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> Trial;

    /// The largest estimated error of a component in the step just tried, relative to max(1, |value|). `error` and `tolerance` are
    /// those of the trial.
    fn absolute_error(&self, work: &Workspace, step: Step<'_>, error: f64, tolerance: f64) -> f64 {
        // Errors are relative to the change in a step, too, where a value starts from nothing.
        let sizes = step.y.iter().zip(work.rates_at_start()).map(|(y, f)| y.abs().max((step.h * f).abs()));
        sizes.fold(0.0, |most, size| most.max(error * tolerance * size.min(1.0)))
    }

    /// The estimated error of each component in the step just tried, in units of what is tolerated; empty where only the largest
    /// one is known.
    fn component_errors(&self) -> &[f64] {
        &[]
    }

    /// Whether the step just tried was as long as the stability of the method allows for its decay, a sign of stiffness. None for
    /// methods that are not limited by stability, or cannot tell.
    fn is_limited_by_stability(&self, _work: &Workspace, _h: f64) -> Option<bool> {
        None
    }

    /// The dense output of the step just tried, up to `end` where that is known more precisely than as `start + h`.
    fn dense(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense;

    /// The error of the dense output inside the step just tried; measured only if [`OneStep::INTERIOR_IS_MEASURED`].
    fn interior_error(
        &self,
        _work: &mut Workspace,
        _system: &mut impl Rates,
        _y: &[f64],
        _dense: &Dense,
    ) -> InteriorError {
        InteriorError::default()
    }

    /// Makes the end of the step just tried the start of the next. True if the rates there are known to the workspace.
    fn accept(&mut self, work: &mut Workspace) -> bool;
}
