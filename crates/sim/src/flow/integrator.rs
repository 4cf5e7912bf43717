//! Steps of controlled error: [`dlsys_ode::Stepper`] with the settings and the statistics of a run, and with algebraic
//! components that are solved for along with the integrated ones.

use crate::flow::coupled::blend::BlendError;
use crate::flow::coupled::equations::Equations;
use crate::{Settings, Stats};
use dlsys_ode::{Control, Dense, Method, Rates, Reached, StepSettings, Stepper};
use dlsys_tree::SimTime;

pub use dlsys_ode::{CERTAINTY, Error as StepError, next_grid_time};

/// The tolerance of a single step, as a part of the tolerance of the run.
pub const INNER_TOLERANCE: f64 = Stepper::TOLERANCE_SHARE;

/// A step whose dense output takes this many pieces is long enough.
const MANY_PIECES: f64 = 4.0;
/// The factor by which the next step is shorter where the algebraic components could not be followed.
const SHORTER: f64 = 0.1;

/// Integrates systems of equations, one after another.
#[derive(Clone, Default)]
pub struct Integrator {
    stepper: Stepper,
}

/// The part of a run's settings that steps depend on.
fn of_steps(settings: &Settings) -> StepSettings {
    StepSettings { method: settings.method, tolerance: settings.tolerance, step_size: settings.step_size }
}

/// The start of a step, and its limits.
#[derive(Clone, Copy)]
pub struct StepRequest<'r> {
    /// Method, tolerance and step size.
    pub settings: &'r Settings,
    /// The components at the start.
    pub y: &'r [f64],
    /// The instant at which the step begins.
    pub start: SimTime,
    /// The step goes no further than to this instant.
    pub limit: Option<SimTime>,
}

impl Integrator {
    /// Prepares for another system of `n` equations, or for a start elsewhere.
    pub fn restart(&mut self, method: Method, n: usize) {
        self.stepper.restart(method, n);
    }

    /// Declares whether limits cut steps shorter than step control would make them, which methods of low order suit.
    pub fn expect_cuts(&mut self, are_cut: bool) {
        self.stepper.is_cut = are_cut;
    }

    /// Declares whether steps are free of searches for events. The dense output of such unwatched steps is refined for
    /// frames inside them ([`Integrator::refined`]).
    pub fn set_unwatched(&mut self, is_unwatched: bool) {
        self.stepper.is_unwatched = is_unwatched;
    }

    /// True if nothing is searched for inside steps.
    pub fn is_unwatched(&self) -> bool {
        self.stepper.is_unwatched
    }

    /// Lets so many components of a stiff step err by more than is tolerated: those that are integrated again.
    pub fn spare(&mut self, components: usize) {
        self.stepper.spared = components;
    }

    /// The components, in ascending order, that err by more than is tolerated in the step just made.
    pub fn rough(&self) -> &[u32] {
        self.stepper.rough()
    }

    /// The positions in the step just made, from 0 to 1, at which the rates were evaluated that its error estimate
    /// depends on.
    pub fn nodes(&self) -> &[f64] {
        self.stepper.nodes()
    }

    /// Declares whether the range of the components at the stages is asked for.
    pub fn keep_reached(&mut self, is_kept: bool) {
        self.stepper.reached_is_kept = is_kept;
    }

    /// The range of the components at the stages of the step just made, if that is known.
    pub fn reached(&self) -> Option<Reached<'_>> {
        self.stepper.reached()
    }

    /// True if the implicit method was taken for some step so far.
    pub fn is_implicit(&self) -> bool {
        self.stepper.has_been_implicit()
    }

    /// Evaluations of one module's equations so far.
    pub fn evaluations(&self) -> u64 {
        self.stepper.evaluations()
    }

    /// What steps have cost so far ([`Stepper::cost`]).
    pub fn cost(&self) -> u64 {
        self.stepper.cost()
    }

    /// Number of components.
    pub fn size(&self) -> usize {
        self.stepper.size()
    }

    /// Makes a step and returns its end. `control` is what step control has learnt from the steps before.
    pub fn step(
        &mut self,
        request: StepRequest,
        control: &mut Control,
        system: &mut impl Rates,
        stats: &mut Stats,
    ) -> Result<SimTime, StepError> {
        let StepRequest { settings, y, start, limit } = request;
        let before = self.stepper.counts();
        let end = self.stepper.step(&of_steps(settings), control, system, y, start, limit);
        let after = self.stepper.counts();
        stats.steps += after.0 - before.0;
        stats.rejected += after.1 - before.1;
        end
    }

    /// The dense output of the step just made from `y`. Some methods evaluate further rates for it, so it is computed
    /// only on demand.
    pub fn dense(&mut self, system: &mut impl Rates, y: &[f64]) -> Dense {
        self.stepper.dense(system, y)
    }

    /// The dense output of the step just made from `y`, unwatched, for a frame inside it.
    pub fn refined(&mut self, system: &mut impl Rates, y: &[f64], settings: &Settings) -> Vec<Dense> {
        self.stepper.refined(system, y, &of_steps(settings))
    }

    /// The dense output of the step just made from `y`, with its algebraic components.
    ///
    /// # Errors
    /// If these cannot be solved for, or cannot be followed; then the size of the next step to be tried is reduced. If two
    /// solutions meet.
    pub fn blended(
        &mut self,
        equations: &mut Equations,
        y: &[f64],
        settings: &Settings,
        control: &mut Control,
    ) -> Result<Vec<Dense>, BlendError> {
        let dense = self.dense(equations, y);
        let h = dense.h;
        let blended = equations.blend(&dense, y, INNER_TOLERANCE * settings.tolerance);
        match &blended {
            Ok(pieces) => {
                // The shape of the algebraic components may limit the step more than the rates do.
                control.size = control.size.min(h * (MANY_PIECES / pieces.len() as f64).max(SHORTER));
                if let Some(last) = pieces.last() {
                    for (c, end) in self.stepper.end_mut().iter_mut().enumerate() {
                        *end = last.value(c, 1.0);
                    }
                }
            }
            Err(BlendError::Unsolved(_)) => control.size = SHORTER * h,
            Err(BlendError::Meeting(_)) => {}
        }
        blended
    }

    /// The length of the step just made.
    pub fn made(&self) -> f64 {
        self.stepper.made()
    }

    /// Gives back the memory that only the making of a step takes: see [`Stepper::rest`].
    pub fn rest(&mut self) {
        self.stepper.rest();
    }

    /// Makes the end of the step just made the start of the next.
    pub fn advance(&mut self, y: &mut Vec<f64>) {
        self.stepper.advance(y);
    }
}
