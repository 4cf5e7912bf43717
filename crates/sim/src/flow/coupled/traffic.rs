//! How long a common step may be where events are dense.
//!
//! Each event integrates its region again up to the end of the common step, with one short stretch of polynomials for
//! every event that its neighbours have had since the step began. So the work of an event grows with the length of the
//! step, and the work of the step itself is shared by the events within it. Both are least where a module has about one
//! event in a step: half as long, they take a tenth longer; twice as long, regions have a ring more and stretches take twice
//! the memory.
//!
//! In stiff equations an event reaches so many modules within one life that regions would be all there is. There the
//! length is found by what it costs: a step as long as its events take as much work as the step.

use dlsys_tree::SimTime;

/// The length of a common step, as a multiple of the mean time between the events of one module.
const EVENTS_A_STEP: f64 = 1.0;
/// The first, the least and the greatest length in stiff equations, as multiples of the mean time between two events.
const FIRST: f64 = 4.0;
const LEAST: f64 = 0.1;
const MOST: f64 = 1e3;
/// So many events tell what one of them takes.
const SOME: usize = 16;
/// What a solution without steps takes for a module, in evaluations of its equations.
const ONE_SOLUTION: f64 = 10.0;
/// Each instant takes a solution, also if something happens elsewhere only: more of all for each event of the tissue are too many.
const INSTANTS: u64 = 2;
/// The factors by which such a length changes.
const SHORTER: f64 = 0.8;
const LONGER: f64 = 1.25;

/// What steps have cost so far.
#[derive(Clone, Copy, Default)]
pub struct Work {
    /// In common steps.
    pub common: u64,
    /// In regions that were integrated again.
    pub regions: u64,
}

/// Events that cut the common step, counted from its start.
#[derive(Clone, Default)]
pub struct Traffic {
    /// The start of the step.
    start: Option<SimTime>,
    /// Events since then.
    events: usize,
    /// Events a unit of time and module in the last step that had any.
    density: f64,
    /// The work up to the start of the step, once equations are stiff.
    work: Option<Work>,
    /// The work since then, and the events that it has answered.
    all: (u64, usize),
    /// The length of steps at which both kinds of work are alike; 0 if nothing is known.
    balance: f64,
    /// Solutions without steps have failed.
    takes_steps: bool,
    /// The number of the instant since which no steps have been made, and how often solutions have begun anew since.
    rest: Option<(u64, u64)>,
}

impl Traffic {
    /// Notes an event that was answered by integrating a region again.
    pub fn note_event(&mut self) {
        self.events += 1;
    }

    /// Begins a common step of so many modules, and gives the instant beyond which it does not pay. `work` is what has been
    /// done so far, if the equations are stiff.
    pub fn begin(&mut self, at: SimTime, members: usize, work: Option<Work>) -> Option<SimTime> {
        if let Some(start) = self.start {
            let (passed, events) = (at.since(start), std::mem::take(&mut self.events));
            if passed > 0.0 {
                self.density = events as f64 / (passed * members.max(1) as f64);
            }
            if let (Some(before), Some(now)) = (self.work, work) {
                self.all.0 += now.common - before.common + now.regions - before.regions;
                self.all.1 += events;
            }
        }
        (self.start, self.rest) = (Some(at), None);
        let mut longest = EVENTS_A_STEP / self.density;
        if let Some(work) = work {
            longest = longest.min(self.balanced(work, members));
        }
        longest.is_finite().then(|| at.after(longest))
    }

    /// True if events have been seen to take more work in stiff equations than a solution without steps, for so many modules at
    /// each of them.
    pub fn is_heavy(&self, members: usize) -> bool {
        let (work, events) = self.all;
        !self.takes_steps && events >= SOME && work as f64 >= ONE_SOLUTION * (members * events) as f64
    }

    /// Notes that no step is made from the instant of this number on.
    pub fn pause(&mut self, instant: u64) {
        (self.start, self.events) = (None, 0);
        let (first, solutions) = self.rest.get_or_insert((instant, 0));
        self.takes_steps |= instant - *first > INSTANTS * *solutions + SOME as u64;
        *solutions += 1;
    }

    /// Notes that a solution without steps has failed.
    pub fn take_steps(&mut self) {
        self.takes_steps = true;
    }

    /// The length of the next step at which regions take as much work as common steps.
    fn balanced(&mut self, work: Work, members: usize) -> f64 {
        let last = self.work.replace(work).unwrap_or_default();
        let (common, regions) = (work.common - last.common, work.regions - last.regions);
        let interval = 1.0 / (self.density * members.max(1) as f64);
        if !interval.is_finite() {
            return f64::INFINITY;
        }
        let factor = if regions > common { SHORTER } else { LONGER };
        let length = if self.balance > 0.0 { self.balance * factor } else { FIRST * interval };
        self.balance = length.clamp(LEAST * interval, MOST * interval);
        self.balance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Traffic after `events` events in a step that took so much work.
    fn after(events: usize, work: u64) -> Traffic {
        let mut traffic = Traffic::default();
        traffic.begin(SimTime::ZERO, 100, Some(Work { common: 7, regions: 0 }));
        (0..events).for_each(|_| traffic.note_event());
        traffic.begin(SimTime::new(1.0), 100, Some(Work { common: 7 + work, regions: 0 }));
        traffic
    }

    #[test]
    fn events_are_heavy_that_take_more_than_a_solution_for_all() {
        assert!(after(20, 20_000).is_heavy(100) && !after(20, 20_000).is_heavy(101));
        assert!(!after(20, 19_999).is_heavy(100) && !after(15, 100_000).is_heavy(100));
    }

    #[test]
    fn a_tissue_that_little_happens_to_takes_steps() {
        let mut traffic = after(20, 20_000);
        // One instant elsewhere for each of its own, then two.
        (0..1000).for_each(|event| traffic.pause(2 * event));
        assert!(traffic.is_heavy(100));
        (0..1000).for_each(|event| traffic.pause(2000 + 3 * event));
        assert!(!traffic.is_heavy(100));
    }
}
