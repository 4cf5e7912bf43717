//! Twins that are integrated: modules that stand at one instant with the same values, the same past and the same equations, all of
//! which read nothing else. One step, and one search of it, is made for the first of them; the others follow it.
//!
//! Divisions into equals make them: a tree whose branches are alike has as many twins as branches. They come to the queue one after
//! the other, so that it is enough to remember the last step.

use crate::flow::FlowStage;
use crate::schedule::Owner;
use crate::world::state::{Control, State};
use dlsys_tree::{ModuleId, SimTime};

/// The last step of a module that is integrated alone.
#[derive(Clone, Copy, Debug)]
pub struct LastStep {
    /// The module.
    pub id: ModuleId,
    /// The start of the step.
    pub from: SimTime,
    /// What step control, and the search for events, knew before.
    pub control: Control,
    /// See `control`.
    pub near: u64,
    /// The time of the module's entry in the schedule.
    pub at: SimTime,
}

impl FlowStage<'_, '_> {
    /// Makes the last step, with what was found in it, that of its module's twin. False if the module is none.
    pub(super) fn follow_twin(&mut self, id: ModuleId, from: SimTime, control: &Control) -> bool {
        let Some(last) = self.flows.last_step.filter(|last| last.from == from && last.control == *control)
        else {
            return false;
        };
        let (Some(twin), Some(own)) = (self.world.state(last.id), self.world.state(id)) else { return false };
        if last.near != own.next.near() || !self.are_twins(own, twin) {
            return false;
        }
        let Some(step) = twin.step.as_ref().filter(|step| step.live && step.dense.start == from).cloned()
        else {
            return false;
        };
        let (next, rule) = (twin.next.clone(), twin.rule.get());
        let near = next.near();
        let own = self.world.state_mut(id).expect("seen above");
        (own.step, own.next) = (Some(step), next);
        self.schedule.schedule(Owner::Module(id.slot() as u32), last.at);
        self.detector.note_approach(rule.unwrap_or(0), near, last.near, last.at);
        true
    }

    /// True if two modules are alike in all that their steps depend on.
    fn are_twins(&self, a: &State, b: &State) -> bool {
        let tree = &self.world.tree;
        let same_values = || {
            let [a, b] = [a, b].map(|state| tree.parameters(state.id).iter().map(|x| x.to_bits()));
            a.eq(b)
        };
        let same_past = || {
            let begun = |state: &State| {
                state.step.as_ref().filter(|s| Some(s.solve) == state.solve.get()).map(|s| s.begun)
            };
            a.since == b.since
                && tree.birth(a.id) == tree.birth(b.id)
                && begun(a).is_none_or(|begun_of_a| begun(b) == Some(begun_of_a))
        };
        let read_nothing_else = || {
            let rule = a.rule.get().map(|rule| &self.setup.model.rules[rule]);
            rule.zip(a.solve.get()).is_some_and(|(rule, solve)| {
                let programs = [&rule.solves[solve].rates, &rule.sides];
                rule.aggregates.is_empty() && programs.iter().all(|program| program.stretch().is_infinite())
            })
        };
        a.id != b.id
            && (a.rule, a.solve, a.numeric_only) == (b.rule, b.solve, b.numeric_only)
            && !a.coupled
            && !b.coupled
            && same_values()
            && same_past()
            && a.switches == b.switches
            && a.signs == b.signs
            && a.context.context().is_empty()
            && b.context.context().is_empty()
            && read_nothing_else()
    }
}
