//! The start of the common trajectory of the coupled modules: who they are, their values, their equations, and the method.

use crate::detect::crossing::needs_search;
use crate::error::Error;
use crate::flow::FlowStage;
use crate::flow::coupled::Coupled;
use crate::flow::coupled::linear::Linear;
use crate::flow::coupled::rows::ComponentPlace;
use crate::flow::coupled::sift::AT_A_TIME;
use crate::flow::coupled::system::{Membership, integrated};
use crate::schedule::Owner;
use crate::world::World;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::prefetch::{Guide, prefetch};
use crate::world::state::State;
use crate::world::trajectories::Law;
use crate::{Method, Scheduler};
use dlsys_tree::{ModuleId, SimTime, Visit, room};

/// A solution without steps begins anew, for all modules, at every event; after this many events steps are made.
const MAX_CUTS: u32 = 2;

impl FlowStage<'_, '_> {
    /// Begins the common trajectory of the coupled modules at an instant.
    pub fn restart_coupled(&mut self, at: SimTime) -> Result<(), Error> {
        let members = self.gather_members(at);
        self.schedule.cancel(Owner::Coupled);
        self.flows.coupled.pulsing.clear();
        if self.setup.has_pulses && !self.setup.settings.method.is_fixed_step() {
            let pulsing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_pulse(*id)).collect();
            self.flows.coupled.pulsing = pulsing;
        }
        self.flows.coupled.members = members;
        (self.flows.coupled.reintegrated, self.flows.coupled.pending) = (false, false);
        if self.step_by_powers(at) {
            return Ok(());
        }
        self.choose_method(at);
        if self.flows.coupled.members.is_empty() {
            return Ok(());
        }
        if self.flows.coupled.linear.is_some() {
            self.show_coupled(at);
            if self.setup.has_conditions {
                let members = std::mem::take(&mut self.flows.coupled.members);
                members.iter().for_each(|id| self.search_member(*id, at));
                self.flows.coupled.members = members;
            }
            return Ok(());
        }
        self.step_coupled(at)
    }

    /// The coupled modules in string order. Their present values become those of the tree and of the state vector.
    fn gather_members(&mut self, at: SimTime) -> Vec<ModuleId> {
        let before = std::mem::take(&mut self.flows.coupled.members);
        let (mut guide, mut members) = (Guide::new(self.world, &before), Vec::new());
        room::reserve(&mut members, before.len());
        for visit in self.world.tree.walk() {
            if let Visit::Module(id) = visit {
                guide.pass(self.world, id);
                if self.world.states.get(id.slot()).is_some() {
                    room::push(&mut members, id);
                }
            }
        }
        let solution = self.world.coupled.take();
        let Coupled { y, system, .. } = &mut self.flows.coupled;
        y.clear();
        system.clear(at);
        y.reserve_exact(members.len());
        system.table.places.reserve_exact(members.len());
        // Threads read side by side what one reads and writes at once.
        let threads = self.threads_for(members.len());
        let known = match threads {
            0 | 1 => Vec::new(),
            _ => self.present_values(&members, solution.as_ref(), at, threads),
        };
        let mut known = known.iter().flatten().copied();
        let mut count = 0;
        for n in 0..members.len() {
            prefetch(self.world, &members, n);
            let id = members[n];
            if self.world.state(id).is_none_or(|s| !s.coupled) {
                continue;
            }
            members[count] = id;
            count += 1;
            self.gather_member(id, solution.as_ref(), at, &mut known);
        }
        members.truncate(count);
        members
    }

    /// The present values of the components of all members, in their order, in several lists.
    fn present_values(
        &self,
        members: &[ModuleId],
        solution: Option<&CoupledSolution>,
        at: SimTime,
        threads: usize,
    ) -> Vec<Vec<f64>> {
        let parts: Vec<&[ModuleId]> = members.chunks(AT_A_TIME).collect();
        dlsys_threads::each(threads, parts.len(), |number| {
            let mut values = Vec::with_capacity(AT_A_TIME);
            for (n, id) in parts[number].iter().enumerate() {
                prefetch(self.world, parts[number], n);
                let Some(state) = self.world.state(*id).filter(|state| state.coupled) else { continue };
                let parameters = self.world.tree.parameters(*id);
                let value = |p: &usize| present(state, *p, solution, at).unwrap_or(parameters[*p]);
                values.extend(integrated(self.setup.model, state).iter().map(value));
            }
            values
        })
    }

    /// Makes the present values of a module's components those of the tree, and appends them to the state vector. Those that are known
    /// already come from a list.
    #[inline]
    fn gather_member(
        &mut self,
        id: ModuleId,
        solution: Option<&CoupledSolution>,
        at: SimTime,
        known: &mut impl Iterator<Item = f64>,
    ) {
        let World { tree, states, .. } = &mut *self.world;
        let state = states.get_mut(id.slot()).expect("a member");
        let first = tree.places(id).start;
        let parameters = integrated(self.setup.model, state);
        let component = self.flows.coupled.y.len() as u32;
        for &parameter in parameters {
            let place = first + parameter;
            let value = known.next().or_else(|| present(state, parameter, solution, at));
            let value = value.unwrap_or(tree.values()[place]);
            tree.set_value(place, value);
            self.flows.coupled.y.push(value);
            self.flows.coupled.system.table.places.push(ComponentPlace::new(first, id, parameter));
        }
        state.trajectories.couple(parameters, component);
        state.pass_changes(at);
        if !state.next.lasting {
            state.next = state.next.again();
            self.schedule.cancel(Owner::Module(id.slot() as u32));
        }
    }

    /// Writes the equations of the members, and solves them without steps if they are linear and no event can cut their
    /// trajectory; else prepares the integrator.
    fn choose_method(&mut self, at: SimTime) {
        let without_steps = self.may_go_without_steps();
        let is_explicit = !self.setup.settings.method.is_implicit() && !self.flows.coupled.control.stiff;
        let is_linear = without_steps && self.flows.coupled.members.iter().all(|id| self.is_linear(*id));
        let (rules, tolerance) = (&self.setup.model.rules, self.setup.coupled_settings.tolerance);
        let Coupled { members, y, .. } = &self.flows.coupled;
        let modules = Membership { world: self.world, members, start: at, frozen: false };
        let mut without = if is_linear { Linear::of_plain(rules, &modules, y, tolerance) } else { None };
        if without.is_none() {
            self.write_equations(at, is_linear || !is_explicit);
            let Coupled { system, y, .. } = &self.flows.coupled;
            without = is_linear.then(|| Linear::new(system, rules, y, tolerance)).flatten();
        }
        let Coupled { system, y, integrator, linear, tried, pulsing, traffic, .. } = &mut self.flows.coupled;
        match &without {
            Some(_) => traffic.pause(self.instant.number),
            // It is not tried again at each event.
            None if without_steps => traffic.take_steps(),
            None => {}
        }
        (*tried, *linear) = (without_steps, without);
        // After each step all members are searched.
        let is_unwatched = !self.setup.has_conditions && pulsing.is_empty() && system.algebra.is_empty();
        integrator.set_unwatched(is_unwatched);
        integrator.keep_reached(!pulsing.is_empty());
        if linear.is_some() {
            system.sections.clear();
        } else {
            if !system.is_bare {
                system.prepare_rates(rules);
            }
            integrator.restart(self.setup.settings.method, y.len());
        }
    }

    /// True if a solution without steps is to be tried: no event can cut the common trajectory, or each is met by a formula and a solution
    /// for all modules takes less than an event does in steps.
    pub(super) fn may_go_without_steps(&self) -> bool {
        let settings = &self.setup.settings;
        if settings.method != Method::Auto || settings.is_sliced() {
            return false;
        }
        let Coupled { control, cuts, traffic, members, .. } = &self.flows.coupled;
        if control.stiff && settings.scheduler == Scheduler::Auto && traffic.is_heavy(members.len()) {
            return !self.setup.has_conditions || !members.iter().any(|id| self.needs_search(*id));
        }
        (control.stiff || *cuts < MAX_CUTS) && !self.searches_coupled()
    }

    /// True if an event of a member cannot be found from its formulas alone.
    fn needs_search(&self, id: ModuleId) -> bool {
        let Some(state) = self.world.state(id) else { return false };
        let rule = state.rule.get().map(|rule| &self.setup.model.rules[rule]);
        rule.is_some_and(|rule| needs_search(state, rule))
    }

    /// True if all integrated parameters of a coupled module have linear equations with constant coefficients.
    fn is_linear(&self, id: ModuleId) -> bool {
        let Some(state) = self.world.state(id) else { return true };
        let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { return true };
        self.setup.model.rules[rule].solves[solve].linear.is_some()
    }

    /// Writes the equations of the members from an instant on: as columns only, where that is enough.
    pub(super) fn write_equations(&mut self, at: SimTime, with_table: bool) {
        let (rules, frozen) = (&self.setup.model.rules, self.setup.settings.is_sliced());
        let threads = self.threads_for(self.flows.coupled.members.len());
        let Coupled { system, members, y, .. } = &mut self.flows.coupled;
        let modules = Membership { world: self.world, members, start: at, frozen };
        if with_table || frozen || !system.gather_all(rules, &modules, y.len(), threads) {
            system.rebuild(rules, &modules, Some);
        }
    }

    /// The number of threads that shall work on so many modules.
    pub(super) fn threads_for(&self, modules: usize) -> usize {
        let settings = &self.setup.settings;
        // Ranges of the states at stages are kept by one thread.
        let is_shared = modules >= settings.threads_from && self.flows.coupled.pulsing.is_empty();
        if is_shared { settings.threads } else { 1 }
    }

    /// True if some condition of the coupled modules can only be found by searching their common trajectory.
    pub(super) fn searches_coupled(&self) -> bool {
        self.setup.has_conditions && self.flows.coupled.members.iter().any(|id| self.has_conditions(*id))
    }

    fn has_conditions(&self, id: ModuleId) -> bool {
        let rule = self.world.state(id).and_then(|s| s.rule.get());
        rule.is_some_and(|r| !self.setup.model.rules[r].atoms.is_empty())
    }
}

/// The present value of an integrated parameter; None if it is the one in the tree.
#[inline]
fn present(state: &State, parameter: usize, solution: Option<&CoupledSolution>, at: SimTime) -> Option<f64> {
    match state.trajectories.get(parameter)? {
        Law::Coupled(component) => solution.and_then(|c| c.value(component as usize, at)),
        Law::Step(component) => {
            let step = state.trajectories.step().filter(|step| step.live);
            step.map(|step| step.dense.value(component as usize, step.dense.position(at)))
        }
        _ => None,
    }
}
