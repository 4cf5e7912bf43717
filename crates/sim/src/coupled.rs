//! Modules whose equations read one another: who they are, and their common step.
//!
//! Only those are coupled that read something of a neighbour which is integrated itself; a neighbour that follows a
//! formula is an input. All of them are integrated together over a common step. What happens to some of them within
//! it is repaired there (`repair`), or ends it for all.

use super::couple::Affected;
use super::course::Course;
use super::equations::Equations;
use super::error::Error;
use super::fetch::fetch_ahead;
use super::flash::{self, Glance, MAX_UNBOUNDED};
use super::integrator::{Integrator, StepError};
use super::linear::Linear;
use super::motion::Motion;
use super::plant::{Path, Plant};
use super::queue::Who;
use super::repair::Repairer;
use super::simulation::Simulation;
use super::state::{Control, State, What};
use super::system::System;
use super::watch::needs_search;
use super::{Method, Scheduler};
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
    pub(super) linear: Option<Linear>,
    /// A step has been made whose dense output nobody has asked for yet.
    pending: bool,
    /// Repairs have changed the members or their motion since the common step was made.
    pub repaired: bool,
    /// Modules that have lost a neighbour who reads them.
    pub loosened: Vec<ModuleId>,
    pub repairer: Repairer,
    pub(super) affected: Affected,
    /// A solution without steps was looked for.
    tried: bool,
    /// Times that an event cut a motion without steps.
    pub(super) cuts: u32,
    pub(super) mark: SimTime,
    pub(super) since_mark: usize,
    /// Members whose rates may have flashes.
    flashing: Vec<ModuleId>,
}

/// Most times that a step is tried whose algebraic components cannot be followed.
const MAX_TRIES: usize = 100;

/// Solving without steps begins anew, for all modules, at every event: after so many of them steps are made.
const MAX_CUTS: u32 = 2;

impl Simulation<'_> {
    /// Begins the common motion of the coupled modules at an instant.
    pub(super) fn restart_coupled(&mut self, at: SimTime) -> Result<(), Error> {
        let mut members = std::mem::take(&mut self.coupled.members);
        members.clear();
        members.extend(self.plant.tree.walk().filter_map(|visit| match visit {
            Visit::Module(id) if matches!(self.plant.states.get(id.slot()), Some(Some(_))) => Some(id),
            _ => None,
        }));
        let course = self.plant.coupled.take();
        self.coupled.y.clear();
        let mut count = 0;
        for n in 0..members.len() {
            fetch_ahead(&self.plant, &members, n);
            let id = members[n];
            if self.plant.state(id).is_none_or(|s| !s.coupled) {
                continue;
            }
            members[count] = id;
            count += 1;
            let Plant { tree, states, .. } = &mut self.plant;
            let state = states[id.slot()].as_mut().expect("a member");
            let first = tree.places(id).start;
            for &parameter in integrated(self.model, state) {
                let motion = &mut state.motions[parameter];
                let value = match *motion {
                    Motion::Coupled(component) => {
                        course.as_ref().and_then(|c| c.value(component as usize, at))
                    }
                    Motion::Step(component) => state
                        .step
                        .as_ref()
                        .filter(|step| step.live)
                        .map(|step| step.dense.value(component as usize, step.dense.position(at))),
                    _ => None,
                };
                let place = first + parameter;
                let value = value.unwrap_or(tree.values()[place]);
                tree.set_value(place, value);
                *motion = Motion::Coupled(self.coupled.y.len() as u32);
                self.coupled.y.push(value);
            }
            state.pass_changes(at);
            if !state.next.lasting {
                state.next = state.next.again();
                self.queue.cancel(Who::Module(id.slot() as u32));
            }
        }
        members.truncate(count);
        self.queue.cancel(Who::Coupled);
        let frozen = self.settings.is_sliced();
        self.coupled.system.rebuild(&self.model.rules, &self.plant, &members, at, Some, frozen);
        self.coupled.flashing.clear();
        if self.flashes && !self.settings.method.is_fixed_step() {
            let flashing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_flash(*id)).collect();
            self.coupled.flashing = flashing;
        }
        self.coupled.members = members;
        (self.coupled.repaired, self.coupled.pending) = (false, false);
        let without_steps = self.settings.method == Method::Auto
            && (self.coupled.control.stiff || self.coupled.cuts < MAX_CUTS)
            && !self.settings.is_sliced()
            && !self.watches_coupled();
        self.coupled.tried = without_steps;
        self.coupled.linear = (without_steps)
            .then(|| {
                let tolerance = self.coupled_settings.tolerance;
                Linear::new(&self.coupled.system, &self.model.rules, &self.coupled.y, tolerance)
            })
            .flatten();
        // After each, all members are searched.
        self.coupled.integrator.expect_high_overhead();
        let is_unwatched = self.model.rules.iter().all(|rule| rule.atoms.is_empty())
            && self.coupled.flashing.is_empty()
            && self.coupled.system.algebra.is_empty();
        self.coupled.integrator.set_unwatched(is_unwatched);
        self.coupled.integrator.restart(self.settings.method, self.coupled.y.len());
        if self.coupled.members.is_empty() {
            return Ok(());
        }
        if self.coupled.linear.is_some() {
            self.show_coupled(at);
            return Ok(());
        }
        self.step_coupled(at)
    }

    /// True if some condition of the coupled modules can only be found by searching their common motion.
    fn watches_coupled(&self) -> bool {
        self.coupled.members.iter().any(|id| self.is_watched(*id))
    }

    fn is_watched(&self, id: ModuleId) -> bool {
        let rule = self.plant.state(id).and_then(|s| s.rule);
        rule.is_some_and(|r| !self.model.rules[r].atoms.is_empty())
    }

    /// Sees to it that the coupled modules' motion is known at an instant.
    pub(super) fn show_coupled(&mut self, at: SimTime) {
        let Coupled { system, y, integrator, control, linear, pending, .. } = &mut self.coupled;
        match linear {
            Some(linear) => {
                if self.plant.coupled.as_ref().is_none_or(|course| course.start() != at) {
                    let dense = linear.at(at, &self.coupled_settings, control, &mut self.stats);
                    self.plant.coupled = Some(Course::new(dense));
                }
            }
            None => {
                if std::mem::take(pending) {
                    let mut equations = Equations::new(system, &self.model.rules, None);
                    let stretches = match integrator.is_unwatched() {
                        true => integrator.refined(&mut equations, y, &self.coupled_settings),
                        false => vec![integrator.dense(&mut equations, y)],
                    };
                    self.plant.coupled = Some(Course::of(stretches));
                }
            }
        }
    }

    /// Makes a step of the coupled modules and searches it.
    fn step_coupled(&mut self, from: SimTime) -> Result<(), Error> {
        let rules = &self.model.rules;
        let Coupled { system, y, integrator, control, flashing, .. } = &mut self.coupled;
        let mut equations = Equations::new(system, rules, None);
        let limit = self.settings.slice_end(from);
        let (mut course, mut tries) = (None, 0);
        let settings = &self.coupled_settings;
        let step = loop {
            let stats = &mut self.stats;
            let step = integrator.step(settings, control, &mut equations, y, from, limit, stats);
            if step.is_err() || system.algebra.is_empty() && flashing.is_empty() {
                break step;
            }
            let stretches = match system.algebra.is_empty() {
                true => Ok(vec![integrator.dense(&mut equations, y)]),
                false => integrator.blended(&mut equations, y, settings, control),
            };
            match stretches {
                Ok(stretches) => {
                    let found = Course::of(stretches);
                    let h = found.end.since(from);
                    self.plant.coupled = Some(found);
                    let stiff = control.stiff || settings.method.is_implicit();
                    let nodes = integrator.nodes();
                    let overlooked = flashing.iter().filter_map(|id| {
                        let how = (settings.tolerance, stiff);
                        let step = step_of(&self.plant, rules, *id, from, &nodes, how)?;
                        match self.lookout.look(&step) {
                            Glance::Clear => None,
                            Glance::Overlooked(at) => Some(at),
                            Glance::Unbounded(at) if tries <= MAX_UNBOUNDED => Some(at),
                            Glance::Unbounded(at) => {
                                let rule = self.plant.state(*id).and_then(|s| s.rule).unwrap_or(0);
                                self.unbounded.entry(rule).or_insert(from.to_f64() + at * h);
                                None
                            }
                        }
                    });
                    let overlooked = overlooked.reduce(f64::min);
                    course = self.plant.coupled.take();
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
                // What cannot be solved for says more than that no step goes on.
                let fault = equations.make_consistent(0.0, &mut y.clone()).err();
                if fault.is_none() && self.arrest_coupled(error.component(), from) {
                    return Ok(());
                }
                return Err(match fault {
                    Some(fault) => self.unsolved(fault, self.coupled.system.owner(fault.component()), from),
                    None => self.coupled_error(error, from),
                });
            }
        };
        self.coupled.pending = course.is_none();
        self.plant.coupled = course;
        let members = std::mem::take(&mut self.coupled.members);
        for (at, &id) in members.iter().enumerate() {
            fetch_ahead(&self.plant, &members, at);
            self.search_member(id, from);
        }
        self.coupled.members = members;
        self.queue.schedule(Who::Coupled, end);
        Ok(())
    }

    /// Finds a coupled module's next event before the end of the common step.
    pub(super) fn search_member(&mut self, id: ModuleId, from: SimTime) {
        let Some(state) = self.plant.state(id) else { return };
        let Some(rule) = state.rule.map(|r| &self.model.rules[r]) else { return };
        if rule.atoms.is_empty() || state.next.lasting {
            return;
        }
        if !needs_search(state, rule) {
            self.look_ahead(id, from).expect("no step is made");
            return;
        }
        self.show_coupled(from);
        let who = Who::Module(id.slot() as u32);
        let mut start = from;
        loop {
            let (Some(course), Some(state)) = (&self.plant.coupled, self.plant.state(id)) else { return };
            let Some(rule) = state.rule.map(|r| &self.model.rules[r]) else { return };
            // Everything that the module reads follows one polynomial up to there.
            let knot = self.plant.knot(state, course, start);
            let h = knot.since(start);
            if h <= 0.0 {
                return self.queue.cancel(who);
            }
            let path = Path::new(&self.plant, state, rule, start, h);
            let found = self.watcher.search(&path, 1.0);
            let last = knot.since(course.end) >= 0.0;
            let state = self.plant.state_mut(id).expect("seen above");
            state.next.changes.extend(found.changes);
            let (before, index) = (std::mem::replace(&mut state.next.near, found.near), state.rule);
            self.note_approach(index.unwrap_or(0), found.near, before, knot);
            let state = self.plant.state_mut(id).expect("seen above");
            if found.event.is_some() {
                let time = found.touched[0].time;
                let what = if found.in_doubt { What::Doubt } else { What::Event };
                (state.next.what, state.next.touched) = (what, found.touched);
                return self.queue.schedule(who, time);
            }
            if last {
                return self.queue.cancel(who);
            }
            start = knot;
        }
    }

    /// Goes to the end of a step of the coupled modules, and on.
    pub(super) fn pass_coupled_step(&mut self, at: SimTime) -> Result<(), Error> {
        let Coupled { mark, since_mark, .. } = &mut self.coupled;
        if super::local::crawls(mark, since_mark, at) && !self.settings.method.is_fixed_step() {
            return Err(self.coupled_error(StepError::StepTooSmall(0), at));
        }
        let slice_ends = |from| self.settings.slice_end(from).is_some_and(|end| end == at);
        if self.coupled.repaired || slice_ends(self.coupled.system.start) {
            // What the step has brought is read from its motion, which nobody may have asked for yet.
            self.show_coupled(at);
            return self.restart_coupled(at);
        }
        let Coupled { members, system, y, integrator, control, .. } = &mut self.coupled;
        for (n, id) in members.iter().enumerate() {
            fetch_ahead(&self.plant, members, n);
            self.plant.state_mut(*id).expect("a member").pass_changes(at);
        }
        integrator.advance(y);
        for (&(place, ..), &value) in system.places.iter().zip(y.iter()) {
            self.plant.tree.set_value(place, value);
        }
        system.advance(at);
        let stiff = control.stiff && self.settings.method == Method::Auto;
        if stiff && !self.coupled.tried && !self.watches_coupled() {
            return self.restart_coupled(at);
        }
        self.step_coupled(at)
    }

    /// True if events end the common step for all.
    pub(super) fn is_cut_by_events(&self) -> bool {
        if self.settings.is_sliced() {
            return false;
        }
        self.settings.scheduler == Scheduler::Global
            || self.settings.method.is_fixed_step()
            || self.settings.method.is_implicit()
            || self.coupled.control.stiff
            || self.coupled.linear.is_some()
    }

    /// Where no common step leads on because some equations end there: if a boundary is there too, of the module that a
    /// component belongs to or of one that it reads, it has been reached.
    fn arrest_coupled(&mut self, component: usize, at: SimTime) -> bool {
        let Some((id, _)) = self.coupled.system.owner(component) else { return false };
        let context = self.plant.state(id).map(|s| s.context.to_vec()).unwrap_or_default();
        let all = std::iter::once(id).chain(context);
        let arrested: Vec<()> = all.filter_map(|id| self.arrest(id, at)).collect();
        !arrested.is_empty()
    }

    fn may_flash(&self, id: ModuleId) -> bool {
        let clause = self.plant.state(id).and_then(|s| Some(&self.model.rules[s.rule?].solves[s.solve?]));
        clause.is_some_and(|solve| solve.flashes)
    }

    /// True if something may have been overlooked of the present motion of some coupled modules, from now on.
    pub(super) fn is_overlooked(&mut self, members: &[ModuleId]) -> bool {
        if !self.flashes || self.settings.method.is_fixed_step() {
            return false;
        }
        let flashing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_flash(*id)).collect();
        let how = (self.coupled_settings.tolerance, false);
        let (plant, rules, lookout) = (&self.plant, &self.model.rules, &mut self.lookout);
        let nodes = &*self.coupled.repairer.nodes();
        flashing.into_iter().any(|id| {
            let step = step_of(plant, rules, id, self.now, nodes, how);
            step.is_some_and(|step| lookout.look(&step) != Glance::Clear)
        })
    }

    fn coupled_error(&self, error: StepError, at: SimTime) -> Error {
        let Coupled { system, y, .. } = &self.coupled;
        let owner = |component: usize| system.owner(component);
        if matches!(error, StepError::StepTooSmall(_) | StepError::ValueNotFinite(_))
            && let Some(fault) = Equations::new(system, &self.model.rules, None).fading(y)
        {
            return self.unsolved(fault, owner(fault.component()), at);
        }
        self.step_error(error, at, owner)
    }
}

/// A step of a coupled module, from an instant to the end of what is known.
fn step_of<'p>(
    plant: &'p Plant,
    rules: &'p [Rule],
    id: ModuleId,
    start: SimTime,
    nodes: &'p [f64],
    (tolerance, stiff): (f64, bool),
) -> Option<flash::Step<'p>> {
    let state = plant.state(id)?;
    let rule = &rules[state.rule?];
    let (solve, end) = (&rule.solves[state.solve?], plant.coupled.as_ref()?.end);
    Some(flash::Step { plant, state, rule, solve, start, end, nodes, own: None, tolerance, stiff })
}

/// The parameters of a coupled module that are integrated, then those that are solved for, in the order of their
/// components.
pub(super) fn integrated<'m>(model: &'m Model, state: &State) -> &'m [usize] {
    let Some((rule, solve)) = state.rule.zip(state.solve) else { return &[] };
    model.rules[rule].solves[solve].stepping.components(state.forced)
}
