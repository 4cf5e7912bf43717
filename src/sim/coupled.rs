//! Modules whose equations read one another, integrated together.
//!
//! Only those are coupled that read something of a neighbour which is integrated itself; a neighbour that follows a
//! formula is an input. Whatever happens to one of them, or to what they read, ends their common step.

use super::Method;
use super::error::Error;
use super::integrator::{Integrator, StepError, foresee};
use super::linear::Linear;
use super::motion::Motion;
use super::plant::Path;
use super::queue::Who;
use super::simulation::Simulation;
use super::state::{Change, Control, Next};
use super::system::{Equations, System};
use super::watch::path_together;
use crate::structure::{Instant, ModuleId, Visit};
use smallvec::SmallVec;

/// The coupled modules and their step.
#[derive(Default)]
pub struct Coupled {
    /// In string order.
    pub members: Vec<ModuleId>,
    pub system: System,
    y: Vec<f64>,
    pub integrator: Integrator,
    pub control: Control,
    /// The equations once more, if they are linear.
    linear: Option<Linear>,
    /// Nothing about the linear equations is watched: no steps are made.
    direct: bool,
    /// Signs that are zero at the event in the present step.
    touched: Vec<(ModuleId, SmallVec<[Change; 1]>)>,
    mark: Instant,
    since_mark: usize,
}

/// Taylor's series is cheap: its error may be a small part of what is tolerated.
const LINEAR_TOLERANCE: f64 = 1e-3;
/// Its steps go so many times as far as to the next event that is known.
const BEYOND: f64 = 1.25;
/// After so many of its steps without an event, the equations are called stiff.
const MANY_TAYLOR_STEPS: usize = 200;

impl Simulation<'_> {
    /// Finds out who is coupled now, and begins their motion anew if anything about it has changed.
    pub(super) fn couple(&mut self) -> Result<(), Error> {
        let model = self.model;
        let group = self.group;
        let mut wanted: Vec<ModuleId> = Vec::new();
        let mut dependent: Vec<ModuleId> = Vec::new();
        let mut affected = std::mem::take(&mut self.coupled_changed);
        for &id in &self.contextual {
            let Some(state) = self.plant.state(id) else { continue };
            let Some(rule) = state.rule.map(|r| &model.rules[r]) else { continue };
            if !rule.reads_context {
                continue;
            }
            let (mut numeric, mut moved) = (false, false);
            let concerned: SmallVec<[ModuleId; 4]> = std::iter::once(id)
                .chain(state.context.iter().copied())
                .filter(|m| {
                    let Some(state) = self.plant.state(*m) else { return false };
                    moved |= state.restarted == group;
                    numeric |= state.is_numeric();
                    *m == id || state.is_numeric()
                })
                .collect();
            if !numeric {
                if moved && state.restarted != group {
                    dependent.push(id);
                }
                continue;
            }
            affected |= moved;
            for module in concerned {
                let state = self.plant.state_mut(module).expect("seen above");
                affected |= !state.coupled || state.restarted == group;
                if std::mem::replace(&mut state.wanted, group) != group {
                    wanted.push(module);
                }
            }
        }
        let mut freed = Vec::new();
        for &id in &self.coupled.members {
            match self.plant.state(id).filter(|s| s.coupled) {
                None => affected = true,
                Some(state) if state.wanted != group => {
                    affected = true;
                    freed.push((id, state.restarted == group));
                }
                Some(_) => {}
            }
        }
        for &id in &dependent {
            if let Some(state) = self.plant.state_mut(id) {
                state.pass_changes(self.now);
            }
            self.look_ahead(id, self.now)?;
        }
        if !affected {
            return Ok(());
        }
        for (id, restarted) in freed {
            self.plant.state_mut(id).expect("seen above").coupled = false;
            if !restarted {
                self.touch_quietly(id);
                self.start_motions(id, self.forced);
                self.look_ahead(id, self.now)?;
            }
        }
        for id in wanted {
            self.plant.state_mut(id).expect("seen above").coupled = true;
        }
        self.restart_coupled()
    }

    /// Brings a module's values and signs to the present without opening it.
    fn touch_quietly(&mut self, id: ModuleId) {
        let now = self.now;
        if let Some(state) = self.plant.state_mut(id) {
            state.pass_changes(now);
        }
        self.plant.materialise(id, now);
    }

    /// Begins the common motion of the coupled modules at the present instant.
    fn restart_coupled(&mut self) -> Result<(), Error> {
        let now = self.now;
        let plant = &self.plant;
        let coupled = |visit| match visit {
            Visit::Module(id) if plant.state(id).is_some_and(|s| s.coupled) => Some(id),
            _ => None,
        };
        let members: Vec<ModuleId> = plant.tree.walk().filter_map(coupled).collect();
        let mut values = Vec::new();
        for &id in &members {
            values.clear();
            self.plant.values(id, now, &mut values);
            let first = self.plant.tree.places(id).start;
            let state = self.plant.state_mut(id).expect("a member");
            state.pass_changes(now);
            state.next = Next::default();
            let numeric: SmallVec<[usize; 4]> =
                (0..state.motions.len()).filter(|i| !state.motions[*i].is_formula()).collect();
            for i in numeric {
                self.plant.tree.set_value(first + i, values[i]);
            }
            self.queue.cancel(Who::Module(id.slot() as u32));
        }
        self.plant.coupled = None;
        self.queue.cancel(Who::Coupled);
        let mut component = 0;
        self.coupled.y.clear();
        for &id in &members {
            let model = self.model;
            let first = self.plant.tree.places(id).start;
            let state = self.plant.state_mut(id).expect("a member");
            let Some((rule, solve)) = state.rule.zip(state.solve) else { continue };
            let solve = &model.rules[rule].solves[solve];
            let forced = state.forced;
            let positions = (0..solve.of.len()).filter(|i| forced || solve.numeric.contains(i));
            let parameters: SmallVec<[usize; 4]> = positions.map(|i| solve.of[i]).collect();
            for &parameter in &parameters {
                state.motions[parameter] = Motion::Coupled(component);
                component += 1;
            }
            let values = self.plant.tree.values();
            self.coupled.y.extend(parameters.iter().map(|p| values[first + p]));
        }
        self.coupled.system = System::new(&self.model.rules, &self.plant, &members, now);
        self.coupled.members = members;
        let linear = match self.settings.method {
            Method::Auto => Linear::new(&self.coupled.system, &self.model.rules, &self.coupled.y),
            _ => None,
        };
        self.coupled.direct = linear.as_ref().is_some_and(Linear::is_direct) && !self.watches_coupled();
        // Where conditions are watched, stiff equations are for the implicit method.
        self.coupled.linear = linear.filter(|_| self.coupled.direct || !self.coupled.control.stiff);
        self.coupled.integrator.restart(self.settings.method, self.coupled.y.len());
        (self.coupled.mark, self.coupled.since_mark) = (now, 0);
        self.coupled.touched.clear();
        if self.coupled.members.is_empty() {
            return Ok(());
        }
        if self.coupled.direct {
            self.show_coupled(now);
            return Ok(());
        }
        self.step_coupled(now)
    }

    /// True if some condition of the coupled modules can only be found by searching their common motion.
    fn watches_coupled(&self) -> bool {
        self.coupled.members.iter().any(|id| {
            let state = self.plant.state(*id).expect("a member");
            state.rule.is_some_and(|r| !self.model.rules[r].atoms.is_empty())
        })
    }

    /// Computes the linear motion at an instant, if it goes without steps.
    pub(super) fn show_coupled(&mut self, at: Instant) {
        if self.coupled.direct
            && let Some(linear) = &mut self.coupled.linear
            && self.plant.coupled.as_ref().is_none_or(|d| d.start != at)
        {
            self.plant.coupled = linear.at(at);
        }
    }

    /// Makes a step of the coupled modules and searches it.
    fn step_coupled(&mut self, from: Instant) -> Result<(), Error> {
        let rules = &self.model.rules;
        let known = self.coming().map_or(f64::INFINITY, |coming| coming.at().since(from));
        let Coupled { system, y, integrator, control, linear, .. } = &mut self.coupled;
        let dense = match linear {
            Some(linear) => {
                self.stats.steps += 1;
                self.stats.rhs_evaluations += linear.evaluations();
                linear.step(self.settings.tolerance * LINEAR_TOLERANCE, BEYOND * known.max(from.resolution()))
            }
            None => {
                let mut equations = Equations::new(system, rules);
                let step = integrator.step(&self.settings, control, &mut equations, y, from, &mut self.stats);
                step.map_err(|error| self.coupled_error(error, from))?
            }
        };
        let h = dense.h;
        self.plant.coupled = Some(dense);
        self.coupled.touched.clear();
        let mut best: Option<(f64, Instant)> = None;
        let mut elder = (0.0, Instant::ZERO);
        let mut candidates = Vec::new();
        let members = std::mem::take(&mut self.coupled.members);
        for &id in &members {
            let state = self.plant.state(id).expect("a member");
            let Some(rule) = state.rule.map(|r| &rules[r]).filter(|rule| !rule.atoms.is_empty()) else {
                continue;
            };
            let path = Path::new(&self.plant, state, rule, from, h);
            let limit = best.map_or(1.0, |(b, _)| path_together(&path, b).min(1.0));
            let found = self.watcher.search(&path, limit);
            if let Some(position) = found.event {
                let birth = self.plant.tree.birth(id);
                if best.is_none_or(|(b, _)| position < b) {
                    best = Some((position, found.touched[0].time));
                    let age = path.age();
                    elder = (position + Instant::new(age + position * h).resolution() / h, birth);
                }
                candidates.push((position, birth, id, found.touched));
            }
            self.plant.state_mut(id).expect("a member").next.changes.extend(found.changes);
        }
        self.coupled.members = members;
        let Some((position, time)) = best else {
            let end = self.plant.coupled.as_ref().map_or(from, |d| d.end);
            self.queue.schedule(Who::Coupled, end);
            return Ok(());
        };
        let together = position + time.resolution() / h;
        // Those born together have clocks that are as good as their age is short.
        candidates.retain(|(at, birth, ..)| *at <= if *birth == elder.1 { elder.0 } else { together });
        self.coupled.touched.extend(candidates.into_iter().map(|(_, _, id, touched)| (id, touched)));
        self.queue.schedule(Who::Coupled, time);
        Ok(())
    }

    /// True if the coupled modules' next entry is an event, not the end of their step.
    pub(super) fn coupled_event(&self) -> bool {
        !self.coupled.touched.is_empty()
    }

    /// Opens the coupled modules whose event it is; tells the first.
    pub(super) fn touch_coupled(&mut self) -> Option<ModuleId> {
        let touched = std::mem::take(&mut self.coupled.touched);
        if let Some(dense) = &self.plant.coupled {
            let control = &mut self.coupled.control;
            foresee(control, control.last_error, self.now.since(dense.start), self.now.resolution());
        }
        for (id, changes) in &touched {
            self.touch(*id, changes);
        }
        touched.first().map(|(id, _)| *id)
    }

    /// Goes to the end of a step of the coupled modules, and on.
    pub(super) fn pass_coupled_step(&mut self, at: Instant) -> Result<(), Error> {
        let Coupled { members, system, y, integrator, control, mark, since_mark, linear, .. } =
            &mut self.coupled;
        for id in members {
            self.plant.state_mut(*id).expect("a member").pass_changes(at);
        }
        match linear {
            Some(_) => {
                if let Some(dense) = &self.plant.coupled {
                    y.iter_mut().enumerate().for_each(|(c, y)| *y = dense.value(c, 1.0));
                }
            }
            None => integrator.advance(y),
        }
        for (&(place, ..), &value) in system.places.iter().zip(y.iter()) {
            self.plant.tree.set_value(place, value);
        }
        system.advance(at);
        // Many steps in a row, and nothing happens: they are short for stability's sake.
        if linear.is_some() && *since_mark >= MANY_TAYLOR_STEPS {
            *linear = None;
            *control = Control { stiff: true, ..Control::default() };
        }
        if super::local::crawls(mark, since_mark, at) && !self.settings.method.is_fixed_step() {
            return Err(self.coupled_error(StepError::TooSmall(0), at));
        }
        self.step_coupled(at)
    }

    fn coupled_error(&self, error: StepError, at: Instant) -> Error {
        let owner = |component: usize| self.coupled.system.owner(component);
        self.step_error(error, at, owner)
    }
}
