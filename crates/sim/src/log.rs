//! The record of a run: productions as they took place, and the work that was done.

use super::Stats;
use dlsys_model::KindId;
use dlsys_tree::Lineage;

/// The record of a run.
#[derive(Clone, Debug, Default)]
pub struct Log {
    pub stats: Stats,
    /// Productions since they were last taken, if they are recorded.
    pub events: Option<Vec<Event>>,
    /// Productions since the last tick of surroundings, if there are any: descent matters to them.
    pub descent: Option<Vec<Event>>,
}

impl Log {
    /// True if productions are recorded.
    pub fn records(&self) -> bool {
        self.events.is_some() || self.descent.is_some()
    }

    /// Records a production.
    pub fn add(&mut self, event: Event) {
        if let Some(descent) = &mut self.descent {
            descent.push(event.clone());
        }
        if let Some(events) = &mut self.events {
            events.push(event);
        }
    }

    /// Discards productions beyond the first `known`: they do not take place.
    pub fn take_back(&mut self, known: usize) {
        if let Some(events) = &mut self.events {
            events.truncate(known);
        }
    }
}

/// A production that took place.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The instant, in the model's unit of time.
    pub time: f64,
    /// The module that was replaced.
    pub lineage: Lineage,
    /// The kind of the module that was replaced.
    pub kind: KindId,
    /// Index into the model's rules.
    pub rule: usize,
    /// Index into the rule's `produces`.
    pub clause: usize,
    /// Index of the successor that chance has chosen, where a clause has several.
    pub successor: Option<usize>,
    /// Number of modules of the successor: they are `lineage.family(KEY).child(0)` and so on.
    pub made: u32,
    /// How far the located instant is from the boundary: the largest difference between the two sides of a
    /// comparison that is met with equality there.
    pub residual: f64,
    /// Events of one instant have one number; it grows by one from instant to instant.
    pub group: u64,
    /// The change that it makes, if transitions are recorded. None where the predecessor was itself made at this instant: the
    /// transition of the first of the cascade tells all.
    pub transition: Option<Box<Transition>>,
}

/// A module, or a bracket, at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct ModuleState {
    /// Its kind; brackets are kinds.
    pub kind: KindId,
    /// The parameters that are written, not the hidden ones.
    pub values: Vec<f64>,
    /// Of the values, per unit of time.
    pub rates: Vec<f64>,
    /// The time since its birth.
    pub age: f64,
}

/// The change that a production makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// The limit from the left.
    pub before: ModuleState,
    /// In string order, brackets included.
    pub after: Vec<ModuleState>,
    /// The rates before are known: not those of the initial string at t = 0.
    pub moved: bool,
    /// Something that is drawn follows the predecessor on its axis.
    pub followed: bool,
    /// Further productions at the same instant that were needed to get from one to the other.
    pub cascade: usize,
}
