//! Local re-integration: the effect of an event on the coupled modules around it, within the common step of the others.
//!
//! After an event at t' within the common step, the modules whose equations or inputs have changed (the *seeds*) and
//! some rings of neighbours around them are integrated again from t' to the end of the step, with the trajectories of
//! all other modules as inputs. Ring k + 1 consists of the modules that read one of ring k, since influence passes to
//! the readers.
//!
//! # Why the error stays under the tolerance
//!
//! Let ε be the error that a step may have ([`INNER_TOLERANCE`] times the tolerance). A re-integration has the step
//! control of any other step. It neglects the change of the modules outside. These read the region only through its
//! outermost ring, and the change of that ring, old trajectory against new, is measured along the whole rest of the
//! step: if it exceeds ε anywhere, the re-integration is repeated with half as many rings more. So the neglected change
//! enters the rates outside as a disturbance of at most ε times the Lipschitz constant L of the coupling, and over the
//! rest of a step of length h it changes their values by at most ε (exp(L h) - 1). Explicit methods keep L h to a few
//! units (beyond that their stability ends, the equations count as stiff, and every event ends the step): the neglected
//! change is one more local error for each event, and accumulates as those do. Where the influence of neighbours is
//! weak (diffusion between cells), it falls by a factor of about L h / k from ring k - 1 to ring k, and a handful of
//! rings is enough.
//!
//! # Stiff equations
//!
//! Steps are implicit, and L h is large, but what decays does not grow: the equations outside carry the disturbance on
//! without adding to it, so it changes their values by at most L h times the change of the outermost ring. Regions are
//! therefore made so large that this change is below ε / (1 + L h), with the largest partial derivative by another
//! component as L. Where values diffuse, influence reaches as far as the square root of the time, and falls faster than
//! exponentially beyond that.

use crate::detect::examined::{Stages, StagesOfSteps};
use crate::flow::FlowStage;
use crate::flow::coupled::columns::{Numbers, Whole};
use crate::flow::coupled::equations::{Equations, RateWorkspace};
use crate::flow::coupled::lanes::LaneBatches;
use crate::flow::coupled::system::{Membership, System, integrated};
use crate::flow::coupled::taylor::{LOOSEST, MANY, Members, Taylor};
use crate::flow::integrator::{CERTAINTY, INNER_TOLERANCE, Integrator, StepRequest};
use crate::schedule::Owner;
use crate::world::coupled_solution::{CoupledSolution, value_of};
use crate::world::neighbours::reads;
use crate::world::prefetch::{fetch, is_large};
use crate::world::state::{Control, State};
use crate::world::states::States;
use crate::world::trajectories::Law;
use dlsys_ode::{Dense, Method};
use dlsys_tree::{ModuleId, SimTime, room};
use smallvec::SmallVec;

/// The experience of re-integrations, and their working memory: one allocates nothing but its trajectory.
#[derive(Clone)]
pub struct Reintegration {
    integrator: Integrator,
    control: Control,
    /// The numbers of rings, the seeds among them, that the last two have changed.
    changed: [usize; 2],
    /// The same in stiff equations, by cause.
    reaches: [StiffReach; 2],
    /// The largest effect of one component on the rate of another in the region, in stiff equations.
    strength: f64,
    /// Those of the components in the system of the region, while that is made.
    numbers: Numbers,
    /// The equations of the region, where they are linear; otherwise those that steps are made of.
    pub(super) taylor: Taylor,
    system: System,
    memory: RateWorkspace,
    region: Region,
    trial: TrialSolution,
    /// The stages of the last region's steps, in models whose rates may have pulses.
    stages: StagesOfSteps,
    y: Vec<f64>,
    /// Id of the last traversal of modules.
    visit: u32,
}

/// The reason why modules are integrated again.
#[derive(Clone, Copy)]
pub enum Cause {
    /// An event has changed their equations or inputs.
    Event,
    /// The common step does not resolve them.
    Roughness,
}

/// The experience of re-integrations in stiff equations, where influence diffuses; 0 if there is none.
#[derive(Clone, Copy, Default)]
struct StiffReach {
    /// Rings for the square root of a unit of time.
    spread: f64,
    /// The length of the first step of the last one.
    first: f64,
}

impl Default for Reintegration {
    fn default() -> Reintegration {
        let mut integrator = Integrator::default();
        // The end of the common step limits them.
        integrator.expect_cuts(true);
        let (control, numbers, system, memory) = Default::default();
        let (region, trial, stages, taylor, y) = Default::default();
        Reintegration {
            integrator,
            control,
            changed: [3; 2],
            reaches: Default::default(),
            strength: 0.0,
            numbers,
            taylor,
            system,
            memory,
            region,
            trial,
            stages,
            y,
            visit: 0,
        }
    }
}

impl Reintegration {
    /// Numbers the components of the last region.
    pub fn number_components(&mut self) {
        self.numbers.put(&self.trial.components);
    }

    /// Takes these numbers back.
    pub fn forget_components(&mut self) {
        self.numbers.take_back(&self.trial.components);
    }

    /// The stages of all steps of the last region, while its components are numbered.
    pub fn stages(&self) -> Stages<'_> {
        self.stages.all(self.numbers.all())
    }

    /// Evaluations of one module's equations so far.
    pub fn evaluations(&self) -> u64 {
        self.integrator.evaluations() + self.taylor.products()
    }

    /// What steps have cost so far.
    pub fn cost(&self) -> u64 {
        self.integrator.cost()
    }

    /// The number of rings with which a re-integration over so much time begins.
    fn rings_within(&self, room: f64, stiff: Option<Cause>) -> usize {
        // Around the seeds there is one ring more than changes.
        stiff.map_or(self.changed[0].max(self.changed[1]).clamp(1, MAX_RINGS), |cause| {
            let rings = (self.reaches[cause as usize].spread * room.sqrt()).ceil();
            (rings as usize).clamp(FEW_RINGS, MAX_STIFF_RINGS)
        })
    }

    /// Remembers that so many rings changed over so much time, the seeds among them.
    fn learn(&mut self, changed: usize, room: f64, stiff: Option<Cause>) {
        match stiff {
            // An attempt with too few rings costs more than a ring too many. A very short time says little.
            Some(cause) => {
                let spread = &mut self.reaches[cause as usize].spread;
                let found = SPARE_RINGS * (changed + 1) as f64 / room.sqrt();
                *spread = if *spread > 0.0 { found.min(2.0 * *spread) } else { found };
            }
            None => self.changed = [changed, self.changed[0]],
        }
    }

    /// The id of a new traversal of modules, which distinguishes the modules that it has visited.
    pub fn begin_visit(&mut self, states: &mut States) -> u32 {
        if self.visit == u32::MAX {
            // From the beginning, and no state remembers any of them.
            states.iter_mut().for_each(|state| state.visited = 0);
            self.visit = 0;
        }
        self.visit += 1;
        self.visit
    }
}

/// Most rings that are tried; least and most in stiff equations.
const MAX_RINGS: usize = 64;
const FEW_RINGS: usize = 3;
const MAX_STIFF_RINGS: usize = 4096;
/// The factor by which more rings are tried than were needed before.
const SPARE_RINGS: f64 = 1.15;
/// In stiff equations the first step is tried so many times as long as that of the last re-integration.
const BOLD: f64 = 1.5;
/// Most steps of a re-integration.
const MAX_STEPS: usize = 64;
/// A region of more than this part of all coupled modules is replaced by a new common step.
const MOST: f64 = 0.5;

/// The relative change that may be neglected in models with aggregates. A flow along branches has to be conserved
/// whatever the tolerance, but across the edge of a region the outside still receives the flow that it had before.
const CONSERVED: f64 = 1e-11;

/// Modules that are integrated again, the seeds first, then ring after ring.
#[derive(Clone, Default)]
struct Region {
    members: Vec<ModuleId>,
    /// The index of the first member of each ring.
    rings: Vec<usize>,
}

/// A trajectory of a region that has not been accepted yet.
#[derive(Clone, Default)]
struct TrialSolution {
    stretches: Vec<Dense>,
    /// Its components, by their number in the stretches.
    components: Vec<u32>,
    /// The index of the first component of each ring.
    rings: Vec<usize>,
}

impl FlowStage<'_, '_> {
    /// Integrates some coupled modules, some of which have just joined, and their neighbours again from now on. False
    /// if a new common step does that better.
    pub fn reintegrate(&mut self, seeds: &[ModuleId], joined: &[ModuleId]) -> bool {
        let now = self.instant.at;
        if self.world.coupled.is_none()
            || self.is_cut_by_events()
            || self.room(now) <= 64.0 * now.resolution()
        {
            return false;
        }
        self.number_newcomers(seeds);
        let mut region = std::mem::take(&mut self.flows.coupled.reintegration.region);
        let mut reintegrated = self.solve_again(&mut region, seeds, now, Cause::Event);
        if reintegrated {
            room::reserve(&mut self.flows.coupled.members, joined.len());
            self.flows.coupled.members.extend_from_slice(joined);
            self.accept(&region);
            // A common step that begins now finds the pulses that have been overlooked.
            reintegrated = !self.is_overlooked(&region.members);
        }
        self.flows.coupled.reintegration.region = region;
        reintegrated
    }

    /// Integrates members that the common step, which begins now, does not resolve, and their neighbours again. False if
    /// a shorter common step does that better.
    pub fn resolve(&mut self, seeds: &[ModuleId], now: SimTime) -> bool {
        let mut region = std::mem::take(&mut self.flows.coupled.reintegration.region);
        let resolved = self.solve_again(&mut region, seeds, now, Cause::Roughness);
        self.flows.coupled.reintegration.region = region;
        resolved
    }

    /// The time from an instant to the end of the common step.
    fn room(&self, now: SimTime) -> f64 {
        self.world.coupled.as_ref().map_or(0.0, |solution| solution.end.since(now))
    }

    /// Finds the region of some modules, and makes its new trajectory from an instant on a part of the coupled solution.
    fn solve_again(&mut self, region: &mut Region, seeds: &[ModuleId], now: SimTime, cause: Cause) -> bool {
        // Within a slice of time no module reads changes of others.
        let sliced = self.setup.settings.is_sliced();
        let (room, stiff) = (self.room(now), self.flows.coupled.control.stiff.then_some(cause));
        let mut rings = if sliced { 0 } else { self.flows.coupled.reintegration.rings_within(room, stiff) };
        let mut trial = std::mem::take(&mut self.flows.coupled.reintegration.trial);
        let solved = loop {
            self.surround(region, seeds, rings);
            if !sliced && region.members.len() as f64 > MOST * self.flows.coupled.members.len() as f64 {
                self.flows.coupled.reintegration.reaches[cause as usize].spread *= 0.5;
                break false;
            }
            if self.integrate(region, &mut trial, now, stiff).is_none() {
                break false;
            }
            let reach = if sliced { 0 } else { self.reach(&trial, room) };
            let closed = region.rings.len() <= rings;
            if reach < region.rings.len() || closed {
                self.flows.coupled.reintegration.learn(reach, room, stiff);
                self.adopt(&mut trial);
                break true;
            }
            rings += rings / 2 + 1;
            if rings > if stiff.is_some() { MAX_STIFF_RINGS } else { MAX_RINGS } {
                break false;
            }
        };
        trial.stretches.clear();
        self.flows.coupled.reintegration.trial = trial;
        solved
    }

    /// Gives components to the parameters of modules that have begun new trajectories.
    fn number_newcomers(&mut self, seeds: &[ModuleId]) {
        let known = self.flows.coupled.system.table.places.len();
        for &id in seeds {
            let fresh = |s: &State| s.trajectories.iter().any(|law| matches!(law, Law::Step(_)));
            if !self.world.state(id).is_some_and(fresh) {
                continue;
            }
            self.store_values(id);
            let parameters = integrated(self.setup.model, self.world.state(id).expect("a seed"));
            let solution = self.world.coupled.as_mut().expect("seen above");
            let first = solution.add(known, parameters.len()) as u32;
            self.world.state_mut(id).expect("a seed").trajectories.couple(parameters, first);
        }
    }

    /// Makes the present values of a module's integrated parameters those of the tree.
    fn store_values(&mut self, id: ModuleId) {
        let first = self.world.tree.places(id).start;
        let all = integrated(self.setup.model, self.world.state(id).expect("a seed"));
        let values: SmallVec<[f64; 4]> =
            all.iter().map(|p| self.world.value(id, *p, self.instant.at)).collect();
        for (parameter, value) in all.iter().zip(values) {
            self.world.tree.set_value(first + parameter, value);
        }
    }

    /// Makes the region of the seeds and `rings` rings around them.
    fn surround(&mut self, region: &mut Region, seeds: &[ModuleId], rings: usize) {
        let visit = self.flows.coupled.reintegration.begin_visit(&mut self.world.states);
        let is_large = is_large(self.world);
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
                for &reader in self.neighbours.lookers(seen) {
                    let Some(state) = self.world.state_mut(reader) else { continue };
                    if state.coupled && state.visited != visit && reads(self.setup.model, state, seen) {
                        state.visited = visit;
                        members.push(reader);
                        if is_large {
                            fetch(state);
                            self.neighbours.prefetch(reader.slot());
                        }
                    }
                }
            }
            if begins.last() == Some(&members.len()) {
                begins.pop();
                break;
            }
        }
    }

    /// Integrates a region from an instant to the end of the common step; None if the steps do not come that far. `stiff`
    /// tells why, if the equations are stiff.
    fn integrate(
        &mut self,
        region: &Region,
        trial: &mut TrialSolution,
        now: SimTime,
        stiff: Option<Cause>,
    ) -> Option<()> {
        let solution = self.world.coupled.as_ref()?;
        let TrialSolution { stretches, components, rings } = trial;
        let Reintegration {
            integrator,
            control,
            numbers,
            taylor,
            system,
            memory,
            stages,
            y,
            reaches,
            strength,
            ..
        } = &mut self.flows.coupled.reintegration;
        stretches.clear();
        components.clear();
        rings.clear();
        y.clear();
        let mut owners: SmallVec<[(ModuleId, usize); 32]> = SmallVec::new();
        for (n, &id) in region.members.iter().enumerate() {
            if region.rings.get(rings.len()) == Some(&n) {
                rings.push(components.len());
            }
            let state = self.world.state(id)?;
            for &parameter in integrated(self.setup.model, state) {
                if let Some(Law::Coupled(component)) = state.trajectories.get(parameter) {
                    components.push(component);
                    owners.push((id, parameter));
                }
            }
        }
        if is_large(self.world) {
            solution.prefetch(components);
        }
        y.extend(components.iter().zip(&owners).map(|(component, &(id, parameter))| {
            let value = solution.value(*component as usize, now);
            value.unwrap_or_else(|| self.world.tree.parameters(id)[parameter])
        }));
        numbers.put(components);
        let number_of = |component: u32| numbers.of(component);
        let rules = &self.setup.model.rules;
        let frozen = self.setup.settings.is_sliced();
        let tolerance = INNER_TOLERANCE * self.setup.coupled_settings.tolerance;
        // The neglected change at the edge of the region adds to the error.
        control.error = self.flows.coupled.control.error + tolerance;
        let is_explicit = stiff.is_none() && !control.stiff && !frozen;
        let is_auto = self.setup.settings.method == Method::Auto && self.setup.settings.tolerance <= LOOSEST;
        if is_explicit && is_auto && !self.setup.has_pulses {
            let world = &*self.world;
            let members = Members { world, rules, members: &region.members, numbers: Some(numbers) };
            if taylor.solve(members, solution, (y, now), (tolerance, control.error), stretches) {
                self.log.stats.steps += stretches.len() as u64;
                numbers.take_back(components);
                return Some(());
            }
        }
        let modules = Membership { world: &*self.world, members: &region.members, start: now, frozen };
        system.clear(now);
        let is_bare = is_explicit && system.gather(rules, &modules, y.len(), number_of);
        if !is_bare {
            system.rebuild(rules, &modules, number_of);
            system.prepare_rates(rules);
        }
        numbers.take_back(components);
        integrator.restart(self.setup.settings.method, y.len());
        if let Some(cause) = stiff {
            // After an event all changes fast again, however long the last steps were.
            (control.stiff, control.size) = (true, BOLD * reaches[cause as usize].first);
            let mut equations = Equations::within(std::mem::take(memory), system, rules, Some(solution));
            *strength = equations.strength(y);
            *memory = equations.memory;
        }
        let may_pulse = self.setup.has_pulses;
        integrator.keep_reached(may_pulse);
        stages.begin();
        let room = solution.end.since(now);
        let mut from = now;
        while solution.end.since(from) > 0.0 {
            if stretches.len() >= MAX_STEPS {
                return None;
            }
            let mut equations = Equations::within(std::mem::take(memory), system, rules, Some(solution));
            // The start of the step moves on.
            let modules = Membership { start: from, ..modules };
            equations.whole = is_bare.then_some(Whole { modules, components: Some(components) });
            let end = Some(solution.end);
            let stats = &mut self.log.stats;
            let settings = &self.setup.coupled_settings;
            let request = StepRequest { settings, y, start: from, limit: end };
            let step = integrator.step(request, control, &mut equations, stats);
            let start = std::mem::replace(&mut from, step.ok()?);
            if system.algebra.is_empty() {
                stretches.push(integrator.dense(&mut equations, y));
            } else {
                stretches.extend(
                    integrator.blended(&mut equations, y, &self.setup.coupled_settings, control).ok()?,
                );
            }
            *memory = equations.memory;
            if may_pulse {
                stages.add(integrator, start.since(now) / room, from.since(now) / room);
            }
            if let (Some(cause), 1) = (stiff, stretches.len()) {
                reaches[cause as usize].first = stretches[0].h;
            }
            integrator.advance(y);
            if solution.end.since(from) > 0.0 {
                system.advance(from);
            }
        }
        Some(())
    }

    /// The number of rings that a trial changes by more than the part that may be neglected.
    fn reach(&self, trial: &TrialSolution, room: f64) -> usize {
        let Some(solution) = &self.world.coupled else { return 0 };
        let tolerance = INNER_TOLERANCE * self.setup.coupled_settings.tolerance;
        let tolerance = if self.setup.gathers { tolerance.min(CONSERVED) } else { tolerance };
        let tolerance = match self.flows.coupled.control.stiff {
            true => tolerance / (1.0 + self.flows.coupled.reintegration.strength * room),
            false => tolerance,
        };
        let changes = |number: usize, component: u32| {
            trial.stretches.iter().any(|dense| {
                [(1.0, dense.end), (0.5, dense.start.after(0.5 * dense.h))].into_iter().any(
                    |(position, at)| {
                        let new = value_of(dense, number, position);
                        let old = solution.value(component as usize, at);
                        old.is_none_or(|old| (new - old).abs() > tolerance * new.abs().max(old.abs()))
                    },
                )
            })
        };
        let mut components = trial.components.iter().enumerate();
        let last = components.rfind(|(number, component)| changes(*number, **component));
        last.map_or(0, |(number, _)| trial.rings.partition_point(|first| *first <= number))
    }

    /// Makes a trial the trajectory of its region.
    fn adopt(&mut self, trial: &mut TrialSolution) {
        let all = self.flows.coupled.system.table.places.len();
        let solution: &mut CoupledSolution = self.world.coupled.as_mut().expect("seen above");
        solution.replace(&mut trial.stretches, &trial.components, all);
        let coupled = &mut self.flows.coupled;
        let is_first = !std::mem::replace(&mut coupled.reintegrated, true);
        if is_first && !coupled.pending && coupled.members.len() > MANY {
            // The next step has other equations.
            coupled.system.lanes = LaneBatches::default();
        }
        let tolerance = self.setup.coupled_settings.tolerance;
        let known = &mut self.flows.coupled.control.error;
        *known = (*known + INNER_TOLERANCE * tolerance).min(CERTAINTY * tolerance);
    }

    /// Finds the next events of a region that has been integrated again from now on.
    fn accept(&mut self, region: &Region) {
        self.flows.coupled.traffic.note_event();
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
