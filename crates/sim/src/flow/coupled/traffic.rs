//! How long a common step may be where events are dense.
//!
//! Each event integrates its region again up to the end of the common step, with one short stretch of polynomials for
//! every event that its neighbours have had since the step began. So the work of an event grows with the length of the
//! step, and the work of the step itself is shared by the events within it. Both are least where a module has one or
//! two events in a step.

use dlsys_tree::SimTime;

/// The length of a common step, as a multiple of the mean time between the events of one module.
const EVENTS_A_STEP: f64 = 2.0;

/// Events that cut the common step, counted from its start.
#[derive(Clone, Default)]
pub struct Traffic {
    /// The start of the step.
    start: Option<SimTime>,
    /// Events since then.
    events: usize,
    /// Events a unit of time and module in the last step that had any.
    density: f64,
}

impl Traffic {
    /// Notes an event that was answered by integrating a region again.
    pub fn note_event(&mut self) {
        self.events += 1;
    }

    /// Begins a common step of so many modules, and gives the instant beyond which it does not pay.
    pub fn begin(&mut self, at: SimTime, members: usize) -> Option<SimTime> {
        if let Some(start) = self.start {
            let (passed, events) = (at.since(start), std::mem::take(&mut self.events));
            if passed > 0.0 {
                self.density = events as f64 / (passed * members.max(1) as f64);
            }
        }
        self.start = Some(at);
        let longest = EVENTS_A_STEP / self.density;
        longest.is_finite().then(|| at.after(longest))
    }
}
