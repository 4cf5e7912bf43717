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
/// The factors by which such a length changes.
const SHORTER: f64 = 0.8;
const LONGER: f64 = 1.25;

/// Evaluations of the equations of one module so far.
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
    /// The work up to the start of the step.
    work: Work,
    /// The length of steps at which both kinds of work are alike; 0 if nothing is known.
    balance: f64,
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
        }
        self.start = Some(at);
        let mut longest = EVENTS_A_STEP / self.density;
        if let Some(work) = work {
            longest = longest.min(self.balanced(work, members));
        }
        longest.is_finite().then(|| at.after(longest))
    }

    /// The length of the next step at which regions take as much work as common steps.
    fn balanced(&mut self, work: Work, members: usize) -> f64 {
        let last = std::mem::replace(&mut self.work, work);
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
