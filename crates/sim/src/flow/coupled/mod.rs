//! Modules whose equations read one another: who they are, and their common step.
//!
//! Only those are coupled that read something of a neighbour which is integrated itself; a neighbour that follows a
//! formula is an input. All of them are integrated together over a common step. NextKind happens to some of them within
//! it is reintegrated there (`reintegration`), or ends it for all.

pub mod aggregates;
pub mod algebra;
pub mod blend;
pub mod couple;
pub mod equations;
pub mod lanes;
pub mod linear;
pub mod prefetch;
pub mod reintegration;
pub mod system;

use super::FlowStage;
use crate::detect::crossing::needs_search;
use crate::detect::pulse::{ExaminedStep, MAX_UNBOUNDED, PulseFinding};
use crate::error::Error;
use crate::flow::coupled::couple::Affected;
use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::linear::Linear;
use crate::flow::coupled::prefetch::prefetch;
use crate::flow::coupled::reintegration::Reintegration;
use crate::flow::coupled::system::System;
use crate::flow::integrator::{Integrator, StepError};
use crate::schedule::Owner;
use crate::trajectory::Trajectory;
use crate::world::World;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::path::Path;
use crate::world::state::{Control, NextKind, State};
use crate::{Method, Scheduler};
use dlsys_model::{Model, Rule};
use dlsys_tree::{ModuleId, SimTime, Visit};

/// The coupled modules and their common step.
#[derive(Clone, Default)]
pub struct Coupled {
    /// Those of the common step in string order, then those that have come since; some may have gone.
    pub members: Vec<ModuleId>,
    pub system: System,
    y: Vec<f64>,
    pub integrator: Integrator,
    pub control: Control,
    /// The equations once more, if they are solved without steps.
    pub linear: Option<Linear>,
    /// A step has been made whose dense output nobody has asked for yet.
    pending: bool,
    /// Repairs have changed the members or their trajectory since the common step was made.
    pub reintegrated: bool,
    /// Modules that have lost a neighbour who reads them.
    pub loosened: Vec<ModuleId>,
    pub reintegration: Reintegration,
    pub affected: Affected,
    /// A solution without steps was looked for.
    tried: bool,
    /// Times that an event cut a trajectory without steps.
    pub cuts: u32,
    pub mark: SimTime,
    pub since_mark: usize,
    /// Members whose rates may have pulses.
    pulsing: Vec<ModuleId>,
}

impl Coupled {
    /// Evaluations of the equations of one module so far.
    pub fn evaluations(&self) -> u64 {
        self.integrator.evaluations() + self.reintegration.evaluations()
    }
}

/// Most times that a step is tried whose algebraic components cannot be followed.
const MAX_TRIES: usize = 100;

/// Solving without steps begins anew, for all modules, at every event: after so many of them steps are made.
const MAX_CUTS: u32 = 2;

impl FlowStage<'_, '_> {
    /// Begins the common trajectory of the coupled modules at an instant.
    pub fn restart_coupled(&mut self, at: SimTime) -> Result<(), Error> {
        let mut members = std::mem::take(&mut self.flows.coupled.members);
        members.clear();
        members.extend(self.world.tree.walk().filter_map(|visit| match visit {
            Visit::Module(id) if matches!(self.world.states.get(id.slot()), Some(Some(_))) => Some(id),
            _ => None,
        }));
        let solution = self.world.coupled.take();
        self.flows.coupled.y.clear();
        let mut count = 0;
        for n in 0..members.len() {
            prefetch(self.world, &members, n);
            let id = members[n];
            if self.world.state(id).is_none_or(|s| !s.coupled) {
                continue;
            }
            members[count] = id;
            count += 1;
            let World { tree, states, .. } = &mut self.world;
            let state = states[id.slot()].as_mut().expect("a member");
            let first = tree.places(id).start;
            for &parameter in integrated(self.setup.model, state) {
                let trajectory = &mut state.trajectories[parameter];
                let value = match *trajectory {
                    Trajectory::Coupled(component) => {
                        solution.as_ref().and_then(|c| c.value(component as usize, at))
                    }
                    Trajectory::Step(component) => state
                        .step
                        .as_ref()
                        .filter(|step| step.live)
                        .map(|step| step.dense.value(component as usize, step.dense.position(at))),
                    _ => None,
                };
                let place = first + parameter;
                let value = value.unwrap_or(tree.values()[place]);
                tree.set_value(place, value);
                *trajectory = Trajectory::Coupled(self.flows.coupled.y.len() as u32);
                self.flows.coupled.y.push(value);
            }
            state.pass_changes(at);
            if !state.next.lasting {
                state.next = state.next.again();
                self.schedule.cancel(Owner::Module(id.slot() as u32));
            }
        }
        members.truncate(count);
        self.schedule.cancel(Owner::Coupled);
        let frozen = self.setup.settings.is_sliced();
        self.flows.coupled.system.rebuild(&self.setup.model.rules, self.world, &members, at, Some, frozen);
        self.flows.coupled.pulsing.clear();
        if self.setup.has_pulses && !self.setup.settings.method.is_fixed_step() {
            let pulsing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_pulse(*id)).collect();
            self.flows.coupled.pulsing = pulsing;
        }
        self.flows.coupled.members = members;
        (self.flows.coupled.reintegrated, self.flows.coupled.pending) = (false, false);
        let without_steps = self.setup.settings.method == Method::Auto
            && (self.flows.coupled.control.stiff || self.flows.coupled.cuts < MAX_CUTS)
            && !self.setup.settings.is_sliced()
            && !self.watches_coupled();
        self.flows.coupled.tried = without_steps;
        self.flows.coupled.linear = (without_steps)
            .then(|| {
                let tolerance = self.setup.coupled_settings.tolerance;
                Linear::new(
                    &self.flows.coupled.system,
                    &self.setup.model.rules,
                    &self.flows.coupled.y,
                    tolerance,
                )
            })
            .flatten();
        // After each, all members are searched.
        self.flows.coupled.integrator.expect_high_overhead();
        let is_unwatched = self.setup.model.rules.iter().all(|rule| rule.atoms.is_empty())
            && self.flows.coupled.pulsing.is_empty()
            && self.flows.coupled.system.algebra.is_empty();
        self.flows.coupled.integrator.set_unwatched(is_unwatched);
        self.flows.coupled.integrator.restart(self.setup.settings.method, self.flows.coupled.y.len());
        if self.flows.coupled.members.is_empty() {
            return Ok(());
        }
        if self.flows.coupled.linear.is_some() {
            self.show_coupled(at);
            return Ok(());
        }
        self.step_coupled(at)
    }

    /// True if some condition of the coupled modules can only be found by searching their common trajectory.
    fn watches_coupled(&self) -> bool {
        self.flows.coupled.members.iter().any(|id| self.is_watched(*id))
    }

    fn is_watched(&self, id: ModuleId) -> bool {
        let rule = self.world.state(id).and_then(|s| s.rule);
        rule.is_some_and(|r| !self.setup.model.rules[r].atoms.is_empty())
    }

    /// Sees to it that the coupled modules' trajectory is known at an instant.
    pub fn show_coupled(&mut self, at: SimTime) {
        let Coupled { system, y, integrator, control, linear, pending, .. } = &mut self.flows.coupled;
        match linear {
            Some(linear) => {
                if self.world.coupled.as_ref().is_none_or(|solution| solution.start() != at) {
                    let dense = linear.at(at, &self.setup.coupled_settings, control, &mut self.log.stats);
                    self.world.coupled = Some(CoupledSolution::new(dense));
                }
            }
            None => {
                if std::mem::take(pending) {
                    let mut equations = Equations::new(system, &self.setup.model.rules, None);
                    let stretches = match integrator.is_unwatched() {
                        true => integrator.refined(&mut equations, y, &self.setup.coupled_settings),
                        false => vec![integrator.dense(&mut equations, y)],
                    };
                    self.world.coupled = Some(CoupledSolution::of(stretches));
                }
            }
        }
    }

    /// Makes a step of the coupled modules and searches it.
    fn step_coupled(&mut self, from: SimTime) -> Result<(), Error> {
        let rules = &self.setup.model.rules;
        let Coupled { system, y, integrator, control, pulsing, .. } = &mut self.flows.coupled;
        let mut equations = Equations::new(system, rules, None);
        let limit = self.setup.settings.slice_end(from);
        let (mut solution, mut tries) = (None, 0);
        let settings = &self.setup.coupled_settings;
        let step = loop {
            let stats = &mut self.log.stats;
            let step = integrator.step(settings, control, &mut equations, y, from, limit, stats);
            if step.is_err() || system.algebra.is_empty() && pulsing.is_empty() {
                break step;
            }
            let stretches = match system.algebra.is_empty() {
                true => Ok(vec![integrator.dense(&mut equations, y)]),
                false => integrator.blended(&mut equations, y, settings, control),
            };
            match stretches {
                Ok(stretches) => {
                    let found = CoupledSolution::of(stretches);
                    let h = found.end.since(from);
                    self.world.coupled = Some(found);
                    let stiff = control.stiff || settings.method.is_implicit();
                    let nodes = integrator.nodes();
                    let overlooked = pulsing.iter().filter_map(|id| {
                        let how = (settings.tolerance, stiff);
                        let step = step_of(self.world, rules, *id, from, &nodes, how)?;
                        match self.detector.pulses.examine(&step) {
                            PulseFinding::Clear => None,
                            PulseFinding::Overlooked(at) => Some(at),
                            PulseFinding::Unbounded(at) if tries <= MAX_UNBOUNDED => Some(at),
                            PulseFinding::Unbounded(at) => {
                                let rule = self.world.state(*id).and_then(|s| s.rule).unwrap_or(0);
                                self.detector.unbounded.entry(rule).or_insert(from.to_f64() + at * h);
                                None
                            }
                        }
                    });
                    let overlooked = overlooked.reduce(f64::min);
                    solution = self.world.coupled.take();
                    let least = 64.0 * from.resolution();
                    match overlooked {
                        Some(at) if h > least && tries < MAX_TRIES => {
                            tries += 1;
                            stats.rejected += 1;
                            control.size = (h * if at > 0.0 { at } else { 0.25 }).max(least);
                        }
                        _ => break step,
                    }
                }
                Err(fault) => {
                    tries += 1;
                    stats.rejected += 1;
                    if tries > MAX_TRIES || settings.method.is_fixed_step() {
                        break Err(StepError::ValueNotFinite(fault.component()));
                    }
                }
            }
        };
        let end = match step {
            Ok(end) => end,
            Err(error) => {
                // NextKind cannot be solved for says more than that no step goes on.
                let fault = equations.make_consistent(0.0, &mut y.clone()).err();
                let component = error.component();
                if fault.is_none() && self.arrest_coupled(component, from) {
                    return Ok(());
                }
                return Err(match fault {
                    Some(fault) => {
                        self.unsolved(fault, self.flows.coupled.system.owner(fault.component()), from)
                    }
                    None => self.coupled_error(error, from),
                });
            }
        };
        self.flows.coupled.pending = solution.is_none();
        self.world.coupled = solution;
        let members = std::mem::take(&mut self.flows.coupled.members);
        for (at, &id) in members.iter().enumerate() {
            prefetch(self.world, &members, at);
            self.search_member(id, from);
        }
        self.flows.coupled.members = members;
        self.schedule.schedule(Owner::Coupled, end);
        Ok(())
    }

    /// Finds a coupled module's next event before the end of the common step.
    pub fn search_member(&mut self, id: ModuleId, from: SimTime) {
        let Some(state) = self.world.state(id) else { return };
        let Some(rule) = state.rule.map(|r| &self.setup.model.rules[r]) else { return };
        if rule.atoms.is_empty() || state.next.lasting {
            return;
        }
        if !needs_search(state, rule) {
            self.look_ahead(id, from).expect("no step is made");
            return;
        }
        self.show_coupled(from);
        let who = Owner::Module(id.slot() as u32);
        let mut start = from;
        loop {
            let (Some(solution), Some(state)) = (&self.world.coupled, self.world.state(id)) else { return };
            let Some(rule) = state.rule.map(|r| &self.setup.model.rules[r]) else { return };
            // Everything that the module reads follows one polynomial up to there.
            let knot = self.world.knot(state, solution, start);
            let h = knot.since(start);
            if h <= 0.0 {
                return self.schedule.cancel(who);
            }
            let path = Path::new(self.world, state, rule, start, h);
            let found = self.detector.crossings.search(&path, 1.0);
            let last = knot.since(solution.end) >= 0.0;
            let state = self.world.state_mut(id).expect("seen above");
            state.next.changes.extend(found.changes);
            let (before, index) = (std::mem::replace(&mut state.next.near, found.near), state.rule);
            self.detector.note_approach(index.unwrap_or(0), found.near, before, knot);
            let state = self.world.state_mut(id).expect("seen above");
            if found.event.is_some() {
                let time = found.touched[0].time;
                let what = if found.in_doubt { NextKind::Doubt } else { NextKind::Event };
                (state.next.kind, state.next.touched) = (what, found.touched);
                return self.schedule.schedule(who, time);
            }
            if last {
                return self.schedule.cancel(who);
            }
            start = knot;
        }
    }

    /// Goes to the end of a step of the coupled modules, and on.
    pub fn pass_coupled_step(&mut self, at: SimTime) -> Result<(), Error> {
        let Coupled { mark, since_mark, .. } = &mut self.flows.coupled;
        if super::independent::crawls(mark, since_mark, at) && !self.setup.settings.method.is_fixed_step() {
            return Err(self.coupled_error(StepError::StepTooSmall(0), at));
        }
        let slice_ends = |from| self.setup.settings.slice_end(from).is_some_and(|end| end == at);
        if self.flows.coupled.reintegrated || slice_ends(self.flows.coupled.system.start) {
            // NextKind the step has brought is read from its trajectory, which nobody may have asked for yet.
            self.show_coupled(at);
            return self.restart_coupled(at);
        }
        let Coupled { members, system, y, integrator, control, .. } = &mut self.flows.coupled;
        for (n, id) in members.iter().enumerate() {
            prefetch(self.world, members, n);
            self.world.state_mut(*id).expect("a member").pass_changes(at);
        }
        integrator.advance(y);
        for (&(place, ..), &value) in system.places.iter().zip(y.iter()) {
            self.world.tree.set_value(place, value);
        }
        system.advance(at);
        let stiff = control.stiff && self.setup.settings.method == Method::Auto;
        if stiff && !self.flows.coupled.tried && !self.watches_coupled() {
            return self.restart_coupled(at);
        }
        self.step_coupled(at)
    }

    /// True if events end the common step for all.
    pub fn is_cut_by_events(&self) -> bool {
        if self.setup.settings.is_sliced() {
            return false;
        }
        self.setup.settings.scheduler == Scheduler::Global
            || self.setup.settings.method.is_fixed_step()
            || self.setup.settings.method.is_implicit()
            || self.flows.coupled.control.stiff
            || self.flows.coupled.linear.is_some()
    }

    /// Where no common step leads on because some equations end there: if a boundary is there too, of the module that a
    /// component belongs to or of one that it reads, it has been reached.
    fn arrest_coupled(&mut self, component: usize, at: SimTime) -> bool {
        let Some((id, _)) = self.flows.coupled.system.owner(component) else { return false };
        let context = self.world.state(id).map(|s| s.context.to_vec()).unwrap_or_default();
        let all = std::iter::once(id).chain(context);
        let arrested: Vec<()> = all.filter_map(|id| self.arrest(id, at)).collect();
        !arrested.is_empty()
    }

    fn may_pulse(&self, id: ModuleId) -> bool {
        let clause =
            self.world.state(id).and_then(|s| Some(&self.setup.model.rules[s.rule?].solves[s.solve?]));
        clause.is_some_and(|solve| solve.has_pulses)
    }

    /// True if something may have been overlooked of the present trajectory of some coupled modules, from now on.
    pub fn is_overlooked(&mut self, members: &[ModuleId]) -> bool {
        if !self.setup.has_pulses || self.setup.settings.method.is_fixed_step() {
            return false;
        }
        let pulsing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_pulse(*id)).collect();
        let how = (self.setup.coupled_settings.tolerance, false);
        let (world, rules, pulses) = (&self.world, &self.setup.model.rules, &mut self.detector.pulses);
        let nodes = &*self.flows.coupled.reintegration.nodes();
        pulsing.into_iter().any(|id| {
            let step = step_of(world, rules, id, self.instant.at, nodes, how);
            step.is_some_and(|step| pulses.examine(&step) != PulseFinding::Clear)
        })
    }

    fn coupled_error(&self, error: StepError, at: SimTime) -> Error {
        let Coupled { system, y, .. } = &self.flows.coupled;
        let owner = |component: usize| system.owner(component);
        if matches!(error, StepError::StepTooSmall(_) | StepError::ValueNotFinite(_))
            && let Some(fault) = Equations::new(system, &self.setup.model.rules, None).fading(y)
        {
            return self.unsolved(fault, owner(fault.component()), at);
        }
        self.step_error(error, at, owner)
    }
}

/// A step of a coupled module, from an instant to the end of what is known.
fn step_of<'p>(
    world: &'p World,
    rules: &'p [Rule],
    id: ModuleId,
    start: SimTime,
    nodes: &'p [f64],
    (tolerance, stiff): (f64, bool),
) -> Option<ExaminedStep<'p>> {
    let state = world.state(id)?;
    let rule = &rules[state.rule?];
    let (solve, end) = (&rule.solves[state.solve?], world.coupled.as_ref()?.end);
    Some(ExaminedStep { world, state, rule, solve, start, end, nodes, own: None, tolerance, stiff })
}

/// The parameters of a coupled module that are integrated, then those that are solved for, in the order of their
/// components.
pub fn integrated<'m>(model: &'m Model, state: &State) -> &'m [usize] {
    let Some((rule, solve)) = state.rule.zip(state.solve) else { return &[] };
    model.rules[rule].solves[solve].stepping.components(state.numeric_only)
}
