//! Random access in time: advancing in small pieces, and the times that can still be shown.
//!
//! A copy of a simulation goes on as the simulation does, to the same bits, so copies are the marks from which earlier
//! times are reached again (`replay`). Between two entries of its schedule the state of a simulation is known at any time:
//! closed forms and dense output are evaluated there, forwards or backwards.

use crate::error::Error;
use crate::kernel::Simulation;
use crate::schedule::is_before;
use dlsys_tree::SimTime;

/// Where [`Simulation::pass_some`] or [`Simulation::pass_piece`] has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passed {
    /// Nothing comes before the time that was asked for.
    All,
    /// After productions of one instant.
    Event,
    /// After as many entries as were allowed.
    Some,
}

/// True if an event of an instant has taken place when time has passed up to `t`.
pub fn happens_by(at: SimTime, t: f64) -> bool {
    is_before(at, true, SimTime::new(t))
}

impl Simulation<'_> {
    /// Lets time pass up to `t`, as [`Simulation::pass`], but at most so many entries of the queues (events, ends of
    /// steps), and, if that is asked for, only to the next production.
    ///
    /// # Errors
    /// As of [`Simulation::pass`].
    pub fn pass_some(&mut self, t: f64, most: usize, one_event: bool) -> Result<Passed, Error> {
        for _ in 0..most {
            let before = self.log.stats.events;
            match self.guarded(|simulation| simulation.advance_once(t))? {
                None => return Ok(Passed::All),
                // Not if a module has only gone over to other equations.
                Some(_) if one_event && self.log.stats.events > before => return Ok(Passed::Event),
                Some(_) => {}
            }
        }
        Ok(Passed::Some)
    }

    /// Lets time pass up to `t`, as [`Simulation::pass`], in pieces: stops after so many entries of the queues, or where many productions were
    /// computed at once. The fastest way; how large a piece is, depends on the model.
    ///
    /// # Errors
    /// As of [`Simulation::pass`].
    pub fn pass_piece(&mut self, t: f64, entries: usize) -> Result<Passed, Error> {
        self.guarded(|simulation| {
            for _ in 0..entries {
                if simulation.pass_chains(t) {
                    return Ok(Passed::Some);
                }
                if simulation.advance_once(t)?.is_none() {
                    return Ok(Passed::All);
                }
            }
            Ok(Passed::Some)
        })
    }

    /// True if nothing has been passed that comes after `t`: then [`Simulation::at`] may be asked for `t`, though
    /// later times have been looked at before, and gives the bits that a run to `t` gives.
    pub fn can_show(&self, t: f64) -> bool {
        !self.has_failed()
            && self.schedule.last.is_none_or(|(at, event)| is_before(at, event, SimTime::new(t)))
    }

    /// The time of the last thing that was passed; 0 at the start.
    pub fn reached(&self) -> f64 {
        self.reached_at().to_f64()
    }

    /// The same, to all its digits.
    pub fn reached_at(&self) -> SimTime {
        self.schedule.last.map_or(SimTime::ZERO, |(at, _)| at)
    }

    /// A measure of the work done so far, in units of very roughly a tenth of a microsecond. It grows
    /// with time, and is the same in every run of the model.
    pub fn work(&self) -> u64 {
        /// The cost of a step of an independent module; of a step of a re-integration, with the search of its neighbours.
        const STEP: [u64; 2] = [10, 100];
        let stats = self.stats();
        let steps = STEP[usize::from(self.setup.looks_around)] * stats.steps;
        let around = self.surroundings.as_ref().map_or(0, |link| link.work());
        4 * (stats.events + self.schedule.passed) + stats.rhs_evaluations / 8 + steps + around
    }
}
