//! The members for which something may happen in a common step, found by several threads at once.
//!
//! Of most members of a large tissue it is plain that nothing does (`detect/quiet.rs`), and to see it takes only reading. Those that are left are
//! searched one after another, as all are by one thread.

use crate::detect::quiet::Outlook;
use crate::flow::FlowStage;
use crate::world::prefetch::prefetch;
use dlsys_tree::{ModuleId, SimTime};

/// So many members are looked at at a time: threads share what is left.
pub(super) const AT_A_TIME: usize = 2048;

/// What a search of a member would find.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// There is nothing to be searched.
    Unconcerned,
    /// Nothing happens before the end.
    Quiet,
    Unknown,
}

impl FlowStage<'_, '_> {
    /// What searches of some members from an instant on would find. The dense output of the common step is there.
    pub(super) fn sift(&self, members: &[ModuleId], from: SimTime, threads: usize) -> Vec<Outcome> {
        let parts: Vec<&[ModuleId]> = members.chunks(AT_A_TIME).collect();
        let found = dlsys_threads::each(threads, parts.len(), |number| {
            let outcome = |(at, id): (usize, &ModuleId)| {
                prefetch(self.world, parts[number], at);
                self.outcome(*id, from)
            };
            parts[number].iter().enumerate().map(outcome).collect::<Vec<Outcome>>()
        });
        found.concat()
    }

    fn outcome(&self, id: ModuleId, from: SimTime) -> Outcome {
        let Some(state) = self.world.state(id) else { return Outcome::Unconcerned };
        let Some(rule) = state.rule.get().map(|r| &self.setup.model.rules[r]) else {
            return Outcome::Unconcerned;
        };
        if rule.atoms.is_empty() || state.next.lasting {
            return Outcome::Unconcerned;
        }
        let (false, Some(solution)) = (state.horizon.is_nan(), &self.world.coupled) else {
            return Outcome::Unknown;
        };
        let outlook = Outlook { world: self.world, solution, state, rule, from };
        if outlook.is_quiet() { Outcome::Quiet } else { Outcome::Unknown }
    }
}
