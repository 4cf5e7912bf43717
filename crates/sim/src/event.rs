//! The log of productions.

use super::transition::Transition;
use dlsys_model::KindId;
use dlsys_tree::Lineage;

/// A production that took place.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub time: f64,
    /// The module that was replaced.
    pub lineage: Lineage,
    pub kind: KindId,
    /// Index into the model's rules.
    pub rule: usize,
    /// Index into the rule's `produces`.
    pub clause: usize,
    /// Index of the successor that chance has chosen, where a clause has several.
    pub successor: Option<usize>,
    /// How far the located instant is from the boundary: the largest difference between the two sides of a
    /// comparison that is met with equality there.
    pub residual: f64,
    /// Events of one instant have one number; it grows by one from instant to instant.
    pub group: u64,
    /// What it changes, if that is recorded. None where the predecessor was itself made at this instant: the
    /// transition of the first of the cascade tells all.
    pub transition: Option<Box<Transition>>,
}
