//! The repair of a common step in stiff equations: few members that it does not resolve are integrated again, with shorter
//! steps, in place of a shorter step for all.
//!
//! After an event values change fast around it, and slowly everywhere else. An implicit method stays stable with a step
//! that suits the rest; its errors are large around the event only, and are estimated for each component. Members with
//! too large an error are integrated again like those that an event affects ([`reintegration`](super::reintegration)):
//! with as many neighbours as they change, measured against the step that is repaired.

use crate::flow::FlowStage;
use dlsys_tree::{ModuleId, SimTime};

/// The part of the components of a common step that may be integrated again.
const SPARED: usize = 8;
/// Components that are further from each other in the string belong to regions of their own.
const APART: u32 = 16;

impl FlowStage<'_, '_> {
    /// The number of components that a common step need not resolve.
    pub(super) fn spared(&self) -> usize {
        let coupled = &self.flows.coupled;
        let is_plain =
            coupled.control.stiff && coupled.system.algebra.is_empty() && coupled.pulsing.is_empty();
        if is_plain && !self.setup.settings.is_sliced() && !self.is_cut_by_events() {
            coupled.system.table.places.len() / SPARED
        } else {
            0
        }
    }

    /// Integrates those members again that the common step just made does not resolve; false if a shorter step for all does
    /// that better.
    pub(super) fn repair(&mut self, from: SimTime) -> bool {
        if self.flows.coupled.integrator.rough().is_empty() {
            return true;
        }
        self.show_coupled(from);
        let rough = self.flows.coupled.integrator.rough().to_vec();
        rough.chunk_by(|a, b| b - a <= APART).all(|near| {
            let tree = &self.world.tree;
            let owner = |component: &u32| self.flows.coupled.system.owner(*component as usize, tree);
            let mut seeds: Vec<ModuleId> = near.iter().filter_map(owner).map(|(id, _)| id).collect();
            seeds.dedup();
            self.resolve(&seeds, from)
        })
    }
}
