//! NextKind an event does to the coupled modules around it, without ending the common step of the others.
//!
//! After an event at t' within the common step, the modules whose equations or inputs have changed (the *seeds*) and some
//! rings of neighbours around them are integrated again from t' to the end of the step, with the trajectory of everybody
//! else as an input. NextKind a ring is: who reads a module is one ring further out, since influence goes to those who read.
//!
//! # Why the error stays under the tolerance
//!
//! Let ε be the error that a step may have ([`INNER_TOLERANCE`] times the tolerance). The reintegration is integrated with the
//! step control of any other step. NextKind it leaves out is the change of the modules outside. They read the region only
//! through its outermost ring, and the change of that ring, old trajectory against new, is measured along the whole
//! rest of the step: if it is more than ε anywhere, the reintegration is done again with twice as many rings. So what is
//! left out enters the rates outside as a disturbance of at most ε times the Lipschitz constant L of the coupling, and
//! over the rest of a step of length h changes their values by at most ε (exp(L h) - 1). Explicit methods keep L h
//! to a few units (beyond that their stability ends, the equations count as stiff, and every event ends the step), and
//! steps are reintegrated where events happen: the neglected change is one more local error, and adds up as those do. Where
//! neighbours' influence is weak (diffusion between cells), it falls by a factor of about L h / k from ring k - 1 to
//! ring k, and a handful of rings is enough.

use crate::flow::FlowStage;
use crate::flow::coupled::equations::{Equations, RateWorkspace};
use crate::flow::coupled::system::{Membership, System, integrated};
use crate::flow::integrator::{CERTAINTY, INNER_TOLERANCE, Integrator, StepRequest};
use crate::schedule::Owner;
use crate::trajectory::Trajectory;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::neighbours::reads;
use crate::world::state::{Control, State};
use dlsys_ode::Dense;
use dlsys_ode::Nodes;
use dlsys_tree::{ModuleId, SimTime};
use smallvec::SmallVec;

/// NextKind reintegrations have learnt, and their memory: nothing is allocated for one but its trajectory.
#[derive(Clone)]
pub struct Reintegration {
    integrator: Integrator,
    control: Control,
    /// Rings to begin with.
    rings: usize,
    /// By component: its number in the system of the region.
    numbers: Vec<u32>,
    /// The equations of the region.
    system: System,
    memory: RateWorkspace,
    region: Region,
    trial: Trial,
    y: Vec<f64>,
    /// Number of the last visit to modules.
    visit: u64,
}

impl Default for Reintegration {
    fn default() -> Reintegration {
        let (integrator, control, numbers, system, memory) = Default::default();
        let (region, trial, y) = Default::default();
        Reintegration { integrator, control, rings: 3, numbers, system, memory, region, trial, y, visit: 0 }
    }
}

impl Reintegration {
    /// Where its steps evaluate rates.
    pub fn nodes(&self) -> Nodes {
        self.integrator.nodes()
    }

    /// Evaluations of one module's equations so far.
    pub fn evaluations(&self) -> u64 {
        self.integrator.evaluations()
    }

    /// A number for a visit to modules that no visit has had.
    pub fn begin_visit(&mut self) -> u64 {
        self.visit += 1;
        self.visit
    }
}

/// Most rings that are tried.
const MAX_RINGS: usize = 64;
/// Most steps of a reintegration.
const MAX_STEPS: usize = 64;
/// A region of more than this part of all modules is no region.
const MOST: f64 = 0.5;

/// NextKind flows along branches is to be conserved whatever the tolerance: what the edge of a region sends to the outside,
/// the outside gets only as it was before. In models that add up over branches no more than this may be neglected, for
/// its size.
const CONSERVED: f64 = 1e-11;

const NOT_HERE: u32 = u32::MAX;

/// Modules that are integrated again, the seeds first, then ring after ring.
#[derive(Clone, Default)]
struct Region {
    members: Vec<ModuleId>,
    /// Where each ring begins.
    rings: Vec<usize>,
}

/// The trajectory of a region.
#[derive(Clone, Default)]
struct Trial {
    stretches: Vec<Dense>,
    /// Its components, by their number in the stretches.
    components: Vec<u32>,
    /// Where those of each ring begin.
    rings: Vec<usize>,
}

impl FlowStage<'_, '_> {
    /// Lets some coupled modules, of which some have just joined, go on with new equations; false if that is better
    /// done by a new common step.
    pub fn reintegrate(&mut self, seeds: &[ModuleId], joined: &[ModuleId]) -> bool {
        let Some(solution) = &self.world.coupled else { return false };
        let room = solution.end.since(self.instant.at);
        if self.is_cut_by_events() || room <= 64.0 * self.instant.at.resolution() {
            return false;
        }
        self.number_newcomers(seeds);
        let (region, trial) =
            (&mut self.flows.coupled.reintegration.region, &mut self.flows.coupled.reintegration.trial);
        let (mut region, mut trial) = (std::mem::take(region), std::mem::take(trial));
        let reintegrated = self.reintegrate_within(&mut region, &mut trial, seeds, joined);
        trial.stretches.clear();
        (self.flows.coupled.reintegration.region, self.flows.coupled.reintegration.trial) = (region, trial);
        reintegrated
    }

    fn reintegrate_within(
        &mut self,
        region: &mut Region,
        trial: &mut Trial,
        seeds: &[ModuleId],
        joined: &[ModuleId],
    ) -> bool {
        // Within a slice of time nobody sees what happens to others.
        let sliced = self.setup.settings.is_sliced();
        let mut rings = if sliced { 0 } else { self.flows.coupled.reintegration.rings };
        loop {
            self.surround(region, seeds, rings);
            if !sliced && region.members.len() as f64 > MOST * self.flows.coupled.members.len() as f64 {
                return false;
            }
            if self.integrate(region, trial).is_none() {
                return false;
            }
            let reach = if sliced { 0 } else { self.reach(trial) };
            let closed = region.rings.len() <= rings;
            if reach < region.rings.len() || closed {
                // One ring beyond the last that changed.
                self.flows.coupled.reintegration.rings = (reach + 1).clamp(1, MAX_RINGS);
                self.flows.coupled.members.extend_from_slice(joined);
                self.take_over(region, trial);
                // A common step that begins now finds what has been overlooked.
                return !self.is_overlooked(&region.members);
            }
            rings *= 2;
            if rings > MAX_RINGS {
                return false;
            }
        }
    }

    /// Gives components to the parameters of modules that have begun new trajectories.
    fn number_newcomers(&mut self, seeds: &[ModuleId]) {
        let known = self.flows.coupled.system.table.places.len();
        for &id in seeds {
            let fresh = |s: &State| s.trajectories.iter().any(|m| matches!(m, Trajectory::Step(_)));
            if !self.world.state(id).is_some_and(fresh) {
                continue;
            }
            self.settle_values(id);
            let state = self.world.state(id).expect("a seed");
            for &parameter in integrated(self.setup.model, state) {
                let solution = self.world.coupled.as_mut().expect("seen above");
                let component = solution.add(known) as u32;
                self.world.state_mut(id).expect("a seed").trajectories[parameter] =
                    Trajectory::Coupled(component);
            }
        }
    }

    /// Makes the present values of a module's integrated parameters those of the tree.
    fn settle_values(&mut self, id: ModuleId) {
        let first = self.world.tree.places(id).start;
        let all = integrated(self.setup.model, self.world.state(id).expect("a seed"));
        let values: SmallVec<[f64; 4]> =
            all.iter().map(|p| self.world.value(id, *p, self.instant.at)).collect();
        for (parameter, value) in all.iter().zip(values) {
            self.world.tree.set_value(first + parameter, value);
        }
    }

    /// Makes a region of the seeds and so many rings around them.
    fn surround(&mut self, region: &mut Region, seeds: &[ModuleId], rings: usize) {
        let visit = self.flows.coupled.reintegration.begin_visit();
        let Region { members, rings: begins } = region;
        members.clear();
        begins.clear();
        begins.push(0);
        for &id in seeds {
            self.world.state_mut(id).expect("a seed").visited = visit;
            members.push(id);
        }
        for _ in 0..rings {
            let (from, to) = (*begins.last().expect("the seeds"), members.len());
            begins.push(to);
            for inner in from..to {
                let seen = members[inner];
                for &looker in self.neighbours.lookers(seen) {
                    let Some(state) = self.world.state_mut(looker) else { continue };
                    if state.coupled && state.visited != visit && reads(self.setup.model, state, seen) {
                        state.visited = visit;
                        members.push(looker);
                    }
                }
            }
            if begins.last() == Some(&members.len()) {
                begins.pop();
                break;
            }
        }
    }

    /// The trajectory of a region from now to the end of the common step; None if there is none.
    fn integrate(&mut self, region: &Region, trial: &mut Trial) -> Option<()> {
        let solution = self.world.coupled.as_ref()?;
        let Trial { stretches, components, rings } = trial;
        let Reintegration { integrator, control, numbers, system, memory, y, .. } =
            &mut self.flows.coupled.reintegration;
        stretches.clear();
        components.clear();
        rings.clear();
        y.clear();
        for (n, &id) in region.members.iter().enumerate() {
            if region.rings.get(rings.len()) == Some(&n) {
                rings.push(components.len());
            }
            let (state, values) = (self.world.state(id)?, self.world.tree.parameters(id));
            for &parameter in integrated(self.setup.model, state) {
                if let Trajectory::Coupled(component) = state.trajectories[parameter] {
                    components.push(component);
                    y.push(solution.value(component as usize, self.instant.at).unwrap_or(values[parameter]));
                }
            }
        }
        for (number, &component) in components.iter().enumerate() {
            if numbers.len() <= component as usize {
                numbers.resize(component as usize + 1, NOT_HERE);
            }
            numbers[component as usize] = number as u32;
        }
        let number = |component: u32| numbers.get(component as usize).copied().filter(|n| *n != NOT_HERE);
        let rules = &self.setup.model.rules;
        let frozen = self.setup.settings.is_sliced();
        let (world, members, start) = (&*self.world, &region.members, self.instant.at);
        system.rebuild(rules, &Membership { world, members, start, frozen }, number);
        for &component in &*components {
            numbers[component as usize] = NOT_HERE;
        }
        integrator.restart(self.setup.settings.method, y.len());
        // The edge of the region neglects as much as that.
        control.error =
            self.flows.coupled.control.error + INNER_TOLERANCE * self.setup.coupled_settings.tolerance;
        let mut from = self.instant.at;
        while solution.end.since(from) > 0.0 {
            if stretches.len() >= MAX_STEPS {
                return None;
            }
            let mut equations = Equations::within(std::mem::take(memory), system, rules, Some(solution));
            let end = Some(solution.end);
            let stats = &mut self.log.stats;
            let settings = &self.setup.coupled_settings;
            let request = StepRequest { settings, y, start: from, limit: end };
            let step = integrator.step(request, control, &mut equations, stats);
            from = step.ok()?;
            if system.algebra.is_empty() {
                stretches.push(integrator.dense(&mut equations, y));
            } else {
                stretches.extend(
                    integrator.blended(&mut equations, y, &self.setup.coupled_settings, control).ok()?,
                );
            }
            *memory = equations.memory;
            integrator.advance(y);
            if solution.end.since(from) > 0.0 {
                system.advance(from);
            }
        }
        Some(())
    }

    /// The number of rings that a trial changes by more than may be neglected.
    fn reach(&self, trial: &Trial) -> usize {
        let Some(solution) = &self.world.coupled else { return 0 };
        let tolerance = INNER_TOLERANCE * self.setup.coupled_settings.tolerance;
        let tolerance = if self.setup.gathers { tolerance.min(CONSERVED) } else { tolerance };
        let changes = |number: usize, component: u32| {
            trial.stretches.iter().any(|dense| {
                [0.5, 1.0].into_iter().any(|position| {
                    let at = if position == 1.0 { dense.end } else { dense.start.after(position * dense.h) };
                    let new = dense.value(number, position);
                    let old = solution.value(component as usize, at);
                    old.is_none_or(|old| (new - old).abs() > tolerance * new.abs().max(old.abs()))
                })
            })
        };
        let mut components = trial.components.iter().enumerate();
        let last = components.rfind(|(number, component)| changes(*number, **component));
        last.map_or(0, |(number, _)| trial.rings.partition_point(|first| *first <= number))
    }

    /// Makes a trial the trajectory of its region, and finds the region's next events.
    fn take_over(&mut self, region: &Region, trial: &mut Trial) {
        let all = self.flows.coupled.system.table.places.len();
        let solution: &mut CoupledSolution = self.world.coupled.as_mut().expect("seen above");
        solution.replace(&mut trial.stretches, &trial.components, all);
        self.flows.coupled.reintegrated = true;
        let tolerance = self.setup.coupled_settings.tolerance;
        let known = &mut self.flows.coupled.control.error;
        *known = (*known + INNER_TOLERANCE * tolerance).min(CERTAINTY * tolerance);
        let now: SimTime = self.instant.at;
        for &id in &region.members {
            let state = self.world.state_mut(id).expect("a member");
            state.pass_changes(now);
            if !state.next.lasting {
                state.next = state.next.again();
                self.schedule.cancel(Owner::Module(id.slot() as u32));
                self.search_member(id, now);
            }
        }
    }
}
