//! The common step of the coupled modules, and the search for the next event of each member.

use crate::Scheduler;
use crate::detect::crossing::needs_search;
use crate::detect::examined::{Conditions, ExaminedStep, Stages};
use crate::detect::pulse::{MAX_UNBOUNDED, PulseFinding};
use crate::detect::quiet::Outlook;
use crate::error::Error;
use crate::flow::FlowStage;
use crate::flow::coupled::Coupled;
use crate::flow::coupled::algebra::AlgebraicError;
use crate::flow::coupled::blend::BlendError;
use crate::flow::coupled::columns::Whole;
use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::meeting::Meeting;
use crate::flow::coupled::sift::Outcome;
use crate::flow::coupled::system::{Membership, System};
use crate::flow::coupled::traffic::Work;
use crate::flow::independent::crawls;
use crate::flow::integrator::{StepError, StepRequest};
use crate::schedule::Owner;
use crate::world::World;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::path::Path;
use crate::world::prefetch::prefetch;
use crate::world::state::NextKind;
use dlsys_model::Rule;
use dlsys_tree::{ModuleId, SimTime};

/// Most times that a step is tried whose algebraic components cannot be followed, or whose rates may have pulses.
const MAX_TRIES: usize = 100;

/// The part of a common step's length that is tried where too many members would have to be integrated again.
const SHORTER: f64 = 0.25;

/// A common step: its end, and its dense output if that has been computed.
type CommonStep = (Result<SimTime, StepFailure>, Option<CoupledSolution>);

/// The reason why no common step can be made.
enum StepFailure {
    /// The method fails.
    Step(StepError),
    /// Algebraic components cannot be followed.
    Unsolved(AlgebraicError),
    /// Two solutions for a component meet at an instant.
    Meeting(usize, SimTime),
}

/// A step ends so much, as a part of itself, before the instant at which solutions meet.
const BEFORE: f64 = 1e-6;
/// Solutions meet at the start of a step if they do within this part of the stretch in which they were seen to.
const AT_ONCE: f64 = 1e-8;

impl FlowStage<'_, '_> {
    /// Makes the trajectory of the coupled modules available at an instant: the dense output of the common step, or the
    /// solution without steps.
    pub fn show_coupled(&mut self, at: SimTime) {
        let Coupled { system, members, y, integrator, control, linear, pending, .. } =
            &mut self.flows.coupled;
        match linear {
            Some(linear) => {
                if self.world.coupled.as_ref().is_none_or(|solution| solution.start() != at) {
                    let dense = linear.at(at, &self.setup.coupled_settings, control, &mut self.log.stats);
                    self.world.coupled = Some(CoupledSolution::new(dense));
                }
            }
            None => {
                if std::mem::take(pending) {
                    let mut equations = common(system, members, self.world, &self.setup.model.rules);
                    let stretches = match integrator.is_unwatched() {
                        true => integrator.refined(&mut equations, y, &self.setup.coupled_settings),
                        false => vec![integrator.dense(&mut equations, y)],
                    };
                    self.world.coupled = Some(CoupledSolution::of(stretches));
                    integrator.rest();
                }
            }
        }
    }

    /// Makes a step of the coupled modules and searches it.
    pub(super) fn step_coupled(&mut self, from: SimTime) -> Result<(), Error> {
        if self.flows.coupled.control.stiff && self.flows.coupled.system.is_bare {
            // Implicit steps need partial derivatives.
            self.write_equations(from, true);
            self.flows.coupled.system.prepare_rates(&self.setup.model.rules);
        }
        let mut may_spare = true;
        let end = loop {
            let (step, solution) = self.make_step(from, may_spare);
            let end = match step {
                Ok(end) => end,
                Err(StepFailure::Step(error)) => return self.fail_step(error, None, from),
                Err(StepFailure::Unsolved(error)) => {
                    return self.fail_step(StepError::ValueNotFinite(error.component()), Some(error), from);
                }
                Err(StepFailure::Meeting(component, at)) => {
                    let owner = self.flows.coupled.system.owner(component, &self.world.tree);
                    return Err(self.unsolved(AlgebraicError::Meeting(component), owner, at));
                }
            };
            self.flows.coupled.pending = solution.is_none();
            self.world.coupled = solution;
            if self.repair(from) {
                break end;
            }
            // The members that were spared are too many.
            may_spare = false;
            self.flows.coupled.control.size = SHORTER * end.since(from);
        };
        if !self.flows.coupled.integrator.is_unwatched() {
            self.search_all(from);
        }
        if !self.flows.coupled.pending {
            // Nobody asks for the dense output any more.
            self.flows.coupled.integrator.rest();
        }
        self.schedule.schedule(Owner::Coupled, end);
        Ok(())
    }

    /// Finds the next events of all members before the end of the common step.
    pub(super) fn search_all(&mut self, from: SimTime) {
        let members = std::mem::take(&mut self.flows.coupled.members);
        self.search_members(&members, from);
        self.flows.coupled.members = members;
    }

    /// Makes a step that resolves the algebraic components and overlooks no pulse; shorter ones are tried until one
    /// does.
    fn make_step(&mut self, from: SimTime, may_spare: bool) -> CommonStep {
        let rules = &self.setup.model.rules;
        let Coupled { traffic, members, integrator, reintegration, control, .. } = &mut self.flows.coupled;
        let work = Work { common: integrator.cost(), regions: reintegration.cost() };
        let longest = traffic.begin(from, members.len(), control.stiff.then_some(work));
        let limits = [self.setup.settings.slice_end(from), longest, self.world.resolved(from)];
        let mut limit = limits.into_iter().flatten().reduce(|a, b| if b < a { b } else { a });
        let settings = &self.setup.coupled_settings;
        let spared = if may_spare { self.spared() } else { 0 };
        self.flows.coupled.integrator.spare(spared);
        let (mut solution, mut tries) = (None, 0);
        let step = loop {
            let Coupled { system, members, y, integrator, control, pulsing, .. } = &mut self.flows.coupled;
            let mut equations = common(system, members, self.world, rules);
            let stats = &mut self.log.stats;
            let request = StepRequest { settings, y, start: from, limit };
            let step = integrator.step(request, control, &mut equations, stats);
            let step = step.map_err(StepFailure::Step);
            if step.is_err() || system.algebra.is_empty() && pulsing.is_empty() {
                break step;
            }
            let stretches = match system.algebra.is_empty() {
                true => Ok(vec![integrator.dense(&mut equations, y)]),
                false => integrator.blended(&mut equations, y, settings, control),
            };
            let least = 64.0 * from.resolution();
            match stretches {
                Ok(stretches) => {
                    let found = CoupledSolution::of(stretches);
                    let h = found.end.since(from);
                    self.world.coupled = Some(found);
                    let overlooked = self.first_overlooked(from, h, tries);
                    solution = self.world.coupled.take();
                    match overlooked {
                        Some(at) if h > least && tries < MAX_TRIES => {
                            tries += 1;
                            self.log.stats.rejected += 1;
                            let part = if at > 0.0 { at } else { 0.25 };
                            self.flows.coupled.control.size = (h * part).max(least);
                        }
                        _ => break step,
                    }
                }
                Err(BlendError::Unsolved(error)) => {
                    tries += 1;
                    stats.rejected += 1;
                    if tries > MAX_TRIES || settings.method.is_fixed_step() {
                        break Err(StepFailure::Unsolved(error));
                    }
                }
                // Events before that instant come first, so steps lead up to it.
                Err(BlendError::Meeting(Meeting { component, position, reach })) => {
                    tries += 1;
                    stats.rejected += 1;
                    let (h, is_fixed) = (integrator.made(), settings.method.is_fixed_step());
                    let ahead = position * h;
                    if position <= AT_ONCE * reach || ahead <= least || tries > MAX_TRIES || is_fixed {
                        break Err(StepFailure::Meeting(component, from.after(ahead)));
                    }
                    limit = Some(from.after((1.0 - BEFORE) * ahead));
                }
            }
        };
        (step, solution)
    }

    /// The first position in a step of length `h`, from 0 to 1, at which a pulse of some member may have been
    /// overlooked.
    fn first_overlooked(&mut self, from: SimTime, h: f64, tries: usize) -> Option<f64> {
        let Coupled { integrator, control, pulsing, .. } = &self.flows.coupled;
        let settings = &self.setup.coupled_settings;
        let stiff = control.stiff || settings.method.is_implicit();
        let conditions = Conditions::new(&self.setup.model.rules, settings, stiff);
        let end = self.world.coupled.as_ref().map_or(from, |solution| solution.end);
        let (span, stages) = ([from, end], Stages::of(integrator));
        let least = 64.0 * from.resolution();
        let overlooked = pulsing.iter().filter_map(|id| {
            let step = ExaminedStep::coupled(self.world, *id, span, stages, conditions)?;
            match self.detector.pulses.examine(&step) {
                PulseFinding::Clear => None,
                PulseFinding::Overlooked(at) => Some(at),
                PulseFinding::Unbounded(at) if tries <= MAX_UNBOUNDED && h > least => Some(at),
                PulseFinding::Unbounded(at) => {
                    let rule = self.world.state(*id).and_then(|s| s.rule.get()).unwrap_or(0);
                    self.detector.unbounded.entry(rule).or_insert(from.to_f64() + at * h);
                    None
                }
            }
        });
        overlooked.reduce(f64::min)
    }

    /// Handles a step that fails: a boundary that has been reached there is an event, anything else an error. `followed`: the reason
    /// why algebraic components cannot be followed, if that is what fails.
    fn fail_step(
        &mut self,
        error: StepError,
        followed: Option<AlgebraicError>,
        from: SimTime,
    ) -> Result<(), Error> {
        let Coupled { system, y, .. } = &self.flows.coupled;
        let mut equations = Equations::new(system, &self.setup.model.rules, None);
        // Equations without a solution explain more than the failure of a step.
        let unsolved = equations.make_consistent(0.0, &mut y.clone()).err();
        if unsolved.is_none() && self.arrest_coupled(error.component(), from) {
            return Ok(());
        }
        let is_singular = |error: &AlgebraicError| matches!(error, AlgebraicError::Singular(_));
        Err(match unsolved.or(followed.filter(is_singular)) {
            Some(unsolved) => {
                let system = &self.flows.coupled.system;
                self.unsolved(unsolved, system.owner(unsolved.component(), &self.world.tree), from)
            }
            None => self.coupled_error(error, from),
        })
    }

    /// Finds the next events of some members before the end of the common step.
    fn search_members(&mut self, members: &[ModuleId], from: SimTime) {
        let threads = self.threads_for(members.len());
        for (at, &id) in members.iter().enumerate() {
            if threads > 1 && !self.flows.coupled.pending {
                // The first one that needs it has asked for the dense output.
                let outcomes = self.sift(&members[at..], from, threads);
                for (&id, outcome) in members[at..].iter().zip(outcomes) {
                    match outcome {
                        Outcome::Unconcerned => {}
                        Outcome::Quiet => self.schedule.cancel(Owner::Module(id.slot() as u32)),
                        Outcome::Unknown => self.search_member(id, from),
                    }
                }
                return;
            }
            prefetch(self.world, members, at);
            self.search_member(id, from);
        }
    }

    /// Finds a coupled module's next event before the end of the common step.
    pub fn search_member(&mut self, id: ModuleId, from: SimTime) {
        let Some(state) = self.world.state(id) else { return };
        let Some(rule) = state.rule.get().map(|r| &self.setup.model.rules[r]) else { return };
        if rule.atoms.is_empty() || state.next.lasting {
            return;
        }
        // Of a module that needs no search, nobody asks how long its formulas meet nothing.
        let is_known = !state.horizon.is_nan();
        if !is_known && !needs_search(state, rule) {
            self.look_ahead(id, from).expect("no step is made");
            return;
        }
        self.show_coupled(from);
        let who = Owner::Module(id.slot() as u32);
        if !is_known {
            self.ask_formulas(id, rule, from);
        }
        let is_quiet = self.outlook(id, rule, from).is_some_and(|outlook| outlook.is_quiet());
        // Tests search all the same, and see that nothing is found.
        if is_quiet && !cfg!(debug_assertions) {
            return self.schedule.cancel(who);
        }
        let mut start = from;
        loop {
            let (Some(solution), Some(state)) = (&self.world.coupled, self.world.state(id)) else { return };
            let Some(rule) = state.rule.get().map(|r| &self.setup.model.rules[r]) else { return };
            // Up to the knot every variable that the module reads follows one polynomial.
            let knot = self.world.knot(state, solution, start);
            let h = knot.since(start);
            if h <= 0.0 {
                return self.schedule.cancel(who);
            }
            let path = Path::new(self.world, state, rule, start, h);
            let found = self.detector.crossings.search(&path, 1.0);
            debug_assert!(
                !is_quiet || found.is_nothing(),
                "a stretch that is plainly quiet is not: {found:?}"
            );
            let last = knot.since(solution.end) >= 0.0;
            let state = self.world.state_mut(id).expect("seen above");
            state.next.add_changes(&found.changes);
            let (before, index) = (state.next.near(), state.rule.get());
            state.next.set_near(found.near);
            self.detector.note_approach(index.unwrap_or(0), found.near, before, knot);
            let state = self.world.state_mut(id).expect("seen above");
            if found.event.is_some() {
                let time = found.touched[0].time;
                let kind = if found.in_doubt { NextKind::Doubt } else { NextKind::Event };
                state.next.touch(kind, found.touched);
                return self.schedule.schedule(who, time);
            }
            if last {
                return self.schedule.cancel(who);
            }
            start = knot;
        }
    }

    fn outlook<'o>(&'o self, id: ModuleId, rule: &'o Rule, from: SimTime) -> Option<Outlook<'o>> {
        let (solution, state) = (self.world.coupled.as_ref()?, self.world.state(id)?);
        Some(Outlook { world: self.world, solution, state, rule, from })
    }

    /// Finds out how long no formula of a module meets a level.
    fn ask_formulas(&mut self, id: ModuleId, rule: &Rule, from: SimTime) {
        let Some(outlook) = self.outlook(id, rule, from) else { return };
        let free_until = outlook.free_until();
        self.world.state_mut(id).expect("seen above").horizon = free_until;
    }

    /// Advances the coupled modules to the end of their common step, and makes the next one.
    pub fn pass_coupled_step(&mut self, at: SimTime) -> Result<(), Error> {
        let Coupled { mark, since_mark, .. } = &mut self.flows.coupled;
        if crawls(mark, since_mark, at) && !self.setup.settings.method.is_fixed_step() {
            return Err(self.coupled_error(StepError::StepTooSmall(0), at));
        }
        let slice_ends = |from| self.setup.settings.slice_end(from).is_some_and(|end| end == at);
        if self.flows.coupled.reintegrated || slice_ends(self.flows.coupled.system.table.start) {
            // The values at the end of the step are read from its dense output, which may not have been computed yet.
            self.show_coupled(at);
            return self.restart_coupled(at);
        }
        let Coupled { members, system, y, integrator, control, .. } = &mut self.flows.coupled;
        // Without conditions there are no signs that change.
        if !integrator.is_unwatched() {
            for (n, id) in members.iter().enumerate() {
                prefetch(self.world, members, n);
                self.world.state_mut(*id).expect("a member").pass_changes(at);
            }
        }
        integrator.advance(y);
        for (of, &value) in system.table.places.iter().zip(y.iter()) {
            self.world.tree.set_value(of.place as usize, value);
        }
        system.advance(at);
        if control.stiff && !self.flows.coupled.tried && self.may_go_without_steps() {
            return self.restart_coupled(at);
        }
        self.step_coupled(at)
    }

    /// True if an event of one coupled module ends the common step for all.
    pub fn is_cut_by_events(&self) -> bool {
        if self.setup.settings.is_sliced() {
            return false;
        }
        self.setup.settings.scheduler == Scheduler::Global
            || self.setup.settings.method.is_fixed_step()
            || self.setup.settings.method.is_implicit()
            || self.flows.coupled.linear.is_some()
    }

    /// Handles equations that end where no common step leads on: a boundary there, of the module that a component
    /// belongs to or of one that it reads, has been reached. False if there is none.
    fn arrest_coupled(&mut self, component: usize, at: SimTime) -> bool {
        let Some((id, _)) = self.flows.coupled.system.owner(component, &self.world.tree) else {
            return false;
        };
        let context = self.world.state(id).map(|s| s.context.to_vec()).unwrap_or_default();
        let all = std::iter::once(id).chain(context);
        let arrested: Vec<()> = all.filter_map(|id| self.arrest(id, at)).collect();
        !arrested.is_empty()
    }

    /// True if some rate of a module may have pulses.
    pub(super) fn may_pulse(&self, id: ModuleId) -> bool {
        let clause = self
            .world
            .state(id)
            .and_then(|s| Some(&self.setup.model.rules[s.rule.get()?].solves[s.solve.get()?]));
        clause.is_some_and(|solve| !solve.pulses.is_empty())
    }

    /// True if a pulse of some coupled modules may have been overlooked on their present trajectories, from now on.
    pub fn is_overlooked(&mut self, members: &[ModuleId]) -> bool {
        if !self.setup.has_pulses || self.setup.settings.method.is_fixed_step() {
            return false;
        }
        let pulsing: Vec<ModuleId> = members.iter().copied().filter(|id| self.may_pulse(*id)).collect();
        let settings = &self.setup.coupled_settings;
        let Some(solution) = &self.world.coupled else { return false };
        let span = [self.instant.at, solution.end];
        let stiff = self.flows.coupled.control.stiff;
        let conditions = Conditions::new(&self.setup.model.rules, settings, stiff);
        // Values that are solved for are no polynomials, though their dense output is.
        let is_plain = self.flows.coupled.system.algebra.is_empty();
        self.flows.coupled.reintegration.number_components();
        let reintegration = &self.flows.coupled.reintegration;
        let mut stages = reintegration.stages();
        stages.range = stages.range.filter(|_| is_plain);
        let (world, pulses) = (&self.world, &mut self.detector.pulses);
        let overlooked = pulsing.into_iter().any(|id| {
            let step = ExaminedStep::coupled(world, id, span, stages, conditions);
            step.is_some_and(|step| pulses.examine(&step) != PulseFinding::Clear)
        });
        self.flows.coupled.reintegration.forget_components();
        overlooked
    }

    /// The error of a common step that fails.
    fn coupled_error(&self, error: StepError, at: SimTime) -> Error {
        let Coupled { system, y, .. } = &self.flows.coupled;
        let owner = |component: usize| system.owner(component, &self.world.tree);
        if matches!(error, StepError::StepTooSmall(_) | StepError::ValueNotFinite(_))
            && let Some(unsolved) = Equations::new(system, &self.setup.model.rules, None).hindrance(y)
        {
            return self.unsolved(unsolved, owner(unsolved.component()), at);
        }
        self.step_error(error, at, owner)
    }
}

/// The equations of the common step.
fn common<'s>(
    system: &'s System,
    members: &'s [ModuleId],
    world: &'s World,
    rules: &'s [Rule],
) -> Equations<'s> {
    let modules = Membership { world, members, start: system.table.start, frozen: false };
    let whole = system.is_bare.then_some(Whole { modules, components: None });
    let mut equations = Equations::new(system, rules, None);
    equations.whole = whole;
    equations
}
