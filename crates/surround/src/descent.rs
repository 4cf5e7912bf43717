//! Descent: the module that each new module replaced.

use std::collections::HashMap;

use dlsys_model::{Model, Outcome};
use dlsys_sim::Event;

/// The predecessors of the modules that an interval of time has made, by [`id`](dlsys_tree::Lineage::id).
#[derive(Clone, Debug, Default)]
pub(crate) struct Descent(HashMap<u64, u64>);

impl Descent {
    /// Adds productions.
    pub(crate) fn add(&mut self, model: &Model, events: &[Event]) {
        for event in events {
            let clause = &model.rules[event.rule].produces[event.clause];
            let key = Outcome::production(clause.key, event.successor.unwrap_or(0));
            let family = event.lineage.family(key);
            let children = (0..event.made as usize).map(|place| (family.child(place).id, event.lineage.id));
            self.0.extend(children);
        }
    }

    /// Adds those of the interval that follows.
    pub(crate) fn extend(&mut self, next: &Descent) {
        self.0.extend(&next.0);
    }

    /// The module itself, the one that it replaced, and so on, as far as this interval reaches.
    pub(crate) fn line(&self, module: u64) -> impl Iterator<Item = u64> {
        std::iter::successors(Some(module), |id| self.0.get(id).copied())
    }

    /// True if there were no productions.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
