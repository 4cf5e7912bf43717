//! Static solution: the strain under which all forces are in balance, by Newton's method with the same elimination.

use crate::Wind;
use crate::form::Twist;
use crate::link::Weights;
use crate::ros2::StepError;
use crate::sweep::{Bend, Instant};
use crate::{Error, Fixed, Skeleton, Solver, State, Vector};

/// Iterations after which the search ends.
const MOST: usize = 400;
/// Longest displacement in one iteration, relative to the extent.
const STRIDE: f64 = 0.2;
/// Displacement of the last iteration, relative to the extent.
const CLOSE: f64 = 1e-11;

impl Solver {
    /// Changes the strain of a state into the equilibrium under weight and a steady wind, as sampled at `time`; its rates become zero.
    /// Prescribed motion of the skeleton does not count. Returns the number of iterations.
    ///
    /// The strain that the state has is the start of the search. Where it is not stable (a stem longer than Greenhill's length), the matrix
    /// is made stiffer until the step goes downhill, so the search ends in a stable equilibrium, but a start that is exactly
    /// symmetric stays so.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance); [`Error::Equilibrium`] if there is no convergence,
    /// for example because leaves flutter in every pose.
    pub fn equilibrium(
        &mut self,
        skeleton: &Skeleton,
        state: &mut State,
        wind: &impl Wind,
        time: f64,
    ) -> Result<usize, Error> {
        self.skeleton.clear();
        let held = skeleton.held();
        self.renew(state, time, &mut Fixed(&held))?;
        state.rate.fill(Vector::zeros());
        let extent = held.extent().max(f64::MIN_POSITIVE);
        // How much stiffer the matrix is than the tissue.
        let mut extra = 0.0_f64;
        let mut moved = StepError::ZERO;
        for iteration in 1..=MOST {
            let now = Instant { wind, from: time, to: time };
            let bend = Bend { strain: &state.strain, rate: &state.rate };
            let weights = Weights { mass: 0.0, damping: 0.0, stiffness: 1.0, extra, blur: 0.0 };
            self.work.spread(&held, &self.settings.air, bend, now, (1.0, 0.0), &weights);
            let whole = self.work.gather(&held, &state.rate, &weights, 0.0);
            self.work.resolve(&held);
            moved = self.displacements(&held);
            let stride = moved.displacement / extent;
            if !(whole && stride <= STRIDE) && extra < 1e12 {
                extra = (extra * 4.0).max(0.25);
                continue;
            }
            for (strain, link) in state.strain.iter_mut().zip(&self.work.links) {
                *strain += link.x;
            }
            if extra == 0.0 && stride < CLOSE {
                return Ok(iteration);
            }
            extra = if extra < 0.02 { 0.0 } else { extra / 4.0 };
        }
        Err(Error::Equilibrium { iterations: MOST, segment: moved.segment, moved: moved.displacement })
    }

    /// Largest displacement by the solution in the workspace.
    pub(crate) fn displacements(&mut self, skeleton: &Skeleton) -> StepError {
        let mut most = StepError::ZERO;
        let segments = skeleton.segments();
        for (index, segment) in segments.iter().enumerate() {
            if segment.parent.is_none() {
                self.work.links[index].errors = [Twist::ZERO; 2];
            }
            let x = [self.work.links[index].x, Vector::zeros()];
            self.work.measure(index, segment.parent, segments, x, &mut most);
        }
        most
    }
}
