//! The modules that are integrated together, determined anew at each event from those whose equations have begun there.

use crate::flow::FlowStage;
use crate::flow::coupled::Coupled;
use std::collections::HashSet;

use crate::error::Error;
use crate::scratch::clear;
use dlsys_tree::ModuleId;

/// The modules that an instant affects, by its consequence for them.
#[derive(Clone, Default)]
pub struct Affected {
    /// Coupled modules whose equations or inputs have changed.
    pub seeds: Vec<ModuleId>,
    /// Of these, those that were not coupled before.
    pub joined: Vec<ModuleId>,
    /// Modules that are no longer coupled.
    pub freed: Vec<ModuleId>,
    /// Modules with closed forms whose conditions read a neighbour that has changed.
    pub dependent: Vec<ModuleId>,
}

impl Affected {
    fn clear(&mut self) {
        let Affected { seeds, joined, freed, dependent } = self;
        [seeds, joined, freed, dependent].into_iter().for_each(clear);
    }
}

impl FlowStage<'_, '_> {
    /// Determines the coupled modules, given those that have begun new trajectories, and integrates them from now on.
    ///
    /// # Errors
    /// If no step leads on.
    pub fn couple(&mut self, begun: &[ModuleId]) -> Result<(), Error> {
        let mut affected = std::mem::take(&mut self.flows.coupled.affected);
        self.find_affected(begun, &mut affected);
        let coupled = self.couple_affected(&affected);
        affected.clear();
        self.flows.coupled.affected = affected;
        coupled
    }

    /// Couples, frees and restarts the affected modules.
    fn couple_affected(&mut self, affected: &Affected) -> Result<(), Error> {
        let Affected { seeds, joined, freed, dependent } = affected;
        for &id in dependent {
            if let Some(state) = self.world.state_mut(id) {
                state.pass_changes(self.instant.at);
            }
            self.look_ahead(id, self.instant.at)?;
        }
        for &id in freed {
            let now = self.instant.at;
            let state = self.world.state_mut(id).expect("seen above");
            (state.coupled, state.horizon) = (false, f64::NAN);
            state.pass_changes(now);
            if !state.has_restarted(self.instant.number) {
                self.world.rebase(id, now);
                self.start_trajectories(id, self.setup.numeric_only);
                self.look_ahead(id, now)?;
            }
        }
        self.flows.coupled.reintegrated |= !freed.is_empty();
        for &id in seeds {
            let now = self.instant.at;
            let state = self.world.state_mut(id).expect("seen above");
            if !state.coupled {
                (state.coupled, state.horizon) = (true, f64::NAN);
            }
            state.pass_changes(now);
            // Closed forms continue as they were, whatever their module reads.
            if !state.next.lasting || state.has_restarted(self.instant.number) {
                state.next = state.next.again();
            }
        }
        if seeds.is_empty() || self.reintegrate(seeds, joined) {
            return Ok(());
        }
        let Coupled { linear, cuts, traffic, .. } = &mut self.flows.coupled;
        if let Some(linear) = linear {
            *cuts += 1;
            if linear.has_taken_steps() {
                traffic.take_steps();
            }
        }
        let now = self.instant.at;
        if let Some(solution) = &self.world.coupled {
            let control = &mut self.flows.coupled.control;
            control.foresee(control.last_error, now.since(solution.start()), now.resolution());
        }
        (self.flows.coupled.mark, self.flows.coupled.since_mark) = (now, 0);
        self.restart_coupled(now)
    }

    /// Classifies the modules that have begun new trajectories, and their neighbours.
    fn find_affected(&mut self, begun: &[ModuleId], affected: &mut Affected) {
        let mut near = std::mem::take(&mut self.flows.coupled.loosened);
        if self.instant.number == 1 {
            // All modules begin now, the neighbours among them.
            near.extend_from_slice(begun);
        } else {
            self.find_neighbours(begun, &mut near);
        }
        near.sort_unstable();
        let moved =
            |id: &ModuleId| self.world.state(*id).is_some_and(|s| s.has_restarted(self.instant.number));
        for &id in &near {
            let Some(state) = self.world.state(id) else { continue };
            let coupled = self.is_coupled(id);
            let reads = state.rule.get().is_some_and(|r| self.setup.model.rules[r].reads_context);
            let has_moved = state.has_restarted(self.instant.number);
            let new_input =
                || reads && (state.has_exchanged(self.instant.number) || state.context.iter().any(moved));
            if coupled {
                if !state.coupled {
                    affected.joined.push(id);
                }
                if !state.coupled || has_moved || new_input() {
                    affected.seeds.push(id);
                }
            } else if state.coupled {
                affected.freed.push(id);
            } else if !has_moved && new_input() {
                affected.dependent.push(id);
            }
        }
        clear(&mut near);
        self.flows.coupled.loosened = near;
    }

    /// Adds modules that have begun new trajectories, those that read them, and those that are read by either of them, each once.
    fn find_neighbours(&mut self, begun: &[ModuleId], near: &mut Vec<ModuleId>) {
        // Modules with many neighbours, whose neighbours have been added already.
        let mut known = HashSet::new();
        for &id in begun {
            near.push(id);
            self.neighbours.readers(self.world, self.setup.model, id, |reader, context| {
                near.push(reader);
                if context.len() < 8 || known.insert(reader) {
                    near.extend_from_slice(context);
                }
            });
            if let Some(state) = self.world.state(id) {
                near.extend_from_slice(&state.context);
            }
        }
        let visit = self.flows.coupled.reintegration.begin_visit(&mut self.world.states);
        near.retain(|id| {
            let state = self.world.state_mut(*id);
            state.is_some_and(|state| std::mem::replace(&mut state.visited, visit) != visit)
        });
    }

    /// True if a module has to be integrated together with neighbours: it reads one that is integrated, or it is
    /// integrated itself and reads a neighbour or is read by one; or if it has algebraic components, which only coupled
    /// equations solve for.
    fn is_coupled(&self, id: ModuleId) -> bool {
        let Some(state) = self.world.state(id) else { return false };
        let Some(rule) = state.rule.get() else { return false };
        let numeric = |id: &ModuleId| self.world.state(*id).is_some_and(|s| s.is_numeric());
        if self.setup.model.rules[rule].reads_context
            && (state.is_numeric() || state.context.iter().any(numeric))
        {
            return true;
        }
        let solved = |s: usize| {
            let algebraic = &self.setup.model.rules[rule].solves[s].algebraic;
            (0..algebraic.of.len()).any(|place| algebraic.is_solved(place, state.numeric_only))
        };
        if state.solve.get().is_some_and(solved) {
            return true;
        }
        let mut read = false;
        if state.is_numeric() {
            self.neighbours.readers(self.world, self.setup.model, id, |_, _| read = true);
        }
        read
    }
}
