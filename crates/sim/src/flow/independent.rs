//! Independent modules: those that read no integrated neighbour are integrated alone, each with steps of its own.

use crate::detect::Detector;
use crate::detect::examined::{Conditions, ExaminedStep, Stages};
use crate::detect::pulse::{MAX_UNBOUNDED, PulseFinding};
use crate::error::Error;
use crate::flow::FlowStage;
use crate::flow::integrator::{StepError, StepRequest};
use crate::trajectory::Trajectory;
use crate::world::state::{Control, Hurdle, State, Step};
use crate::world::trajectories::Law;
use crate::world::{World, describe};
use dlsys_expr::{Program, Scratch};
use dlsys_model::{Rule, Solve};
use dlsys_ode::{Dense, Rates};
use dlsys_tree::{ModuleId, SimTime};
use smallvec::SmallVec;

/// The number of steps after which the progress of time is checked.
const MANY_STEPS: usize = 10_000;
/// Steps that advance time by no more than this part of it indicate a singularity.
const CRAWL: f64 = 1e-5;

/// Counts a step that ends at `at`. True if the last [`MANY_STEPS`] of them, since `mark`, have hardly advanced time.
pub fn crawls(mark: &mut SimTime, since_mark: &mut usize, at: SimTime) -> bool {
    *since_mark += 1;
    if *since_mark < MANY_STEPS {
        return false;
    }
    let crawls = at.since(*mark) <= CRAWL * at.to_f64();
    (*since_mark, *mark) = (0, at);
    crawls
}

/// What the steps of a module under a clause tell the next one: lives that follow each other begin alike.
#[derive(Clone, Copy, Default)]
pub struct Hint {
    /// The experience of step control, with the length that the first step should have had.
    pub control: Control,
    /// A step that was rejected at first.
    hurdle: Option<Hurdle>,
}

/// What a module knows when it makes a step.
#[derive(Clone, Copy)]
pub struct Experience {
    pub control: Control,
    /// The number of steps under the clause before this one.
    number: u32,
    /// The hurdle that is known.
    hurdle: Option<Hurdle>,
    /// The step goes on from one of the present trajectory.
    goes_on: bool,
}

impl Experience {
    /// Adds what a step depends on. The length with which a trajectory begins is a guess of no consequence.
    pub fn note(&self, words: &mut Vec<u64>) {
        let Experience { control, number, hurdle, goes_on } = self;
        words.push(control.error.to_bits());
        words.push(u64::from(*number) << 1 | u64::from(*goes_on));
        if *goes_on {
            let Control { size, last_error, stiffness_count, stiff, .. } = control;
            words.extend([size.to_bits(), last_error.to_bits()]);
            words.push(u64::from(*stiffness_count) << 1 | u64::from(*stiff));
            words.extend(
                hurdle
                    .map(|Hurdle { number, size }| [u64::from(number), size.to_bits()])
                    .into_iter()
                    .flatten(),
            );
        }
    }
}

/// A step that has been made, and the experience with which the module goes on.
#[derive(Clone, Debug)]
pub struct Made {
    pub dense: Dense,
    pub control: Control,
    /// See [`Step`].
    pub number: u32,
    pub hurdle: Option<Hurdle>,
}

/// The equations of one module that is integrated alone.
struct Independent<'a> {
    solve: &'a Solve,
    program: &'a Program,
    /// The registers of the program: first all variables of the rule, of which those that move are filled in for each evaluation.
    variables: Vec<f64>,
    /// The index of each component among the variables.
    numeric: SmallVec<[usize; 4]>,
    /// The parameters with closed forms: index, trajectory, and value at the start of that.
    formulas: SmallVec<[(usize, &'a Trajectory, f64); 4]>,
    /// The time from the start of the trajectories to the start of the step.
    offset: f64,
    /// The index of `t` among the variables; `age` is the next.
    time: usize,
    /// Whether the rates read these.
    clocks: [bool; 2],
    /// The only variable that moves, if there is no other, and no clock is read.
    only: Option<usize>,
    /// `t` and `age` at the start of the step.
    t: f64,
    age: f64,
    scratch: Scratch<f64>,
}

impl<'a> Independent<'a> {
    fn new(
        world: &'a World,
        state: &'a State,
        rule: &'a Rule,
        from: SimTime,
        mut variables: Vec<f64>,
        scratch: Scratch<f64>,
        y: &mut Vec<f64>,
    ) -> Independent<'a> {
        y.clear();
        let own = world.tree.parameters(state.id);
        let context = state.context.context();
        if !rule.aggregates.is_empty() {
            world.variables(rule, state.id, &state.context, from, &mut variables);
        } else if !context.is_empty() {
            variables.clear();
            variables.extend_from_slice(own);
            context.iter().for_each(|module| world.values(*module, from, &mut variables));
        }
        // What programs leave behind the variables stays: there is room for it then.
        let count = rule.variables + state.marks.switch_values().count();
        if variables.len() < count {
            variables.resize(count, 0.0);
        }
        // Those that move, and the times, are filled in for each evaluation.
        variables[..own.len()].copy_from_slice(own);
        for (place, on) in variables[rule.variables..].iter_mut().zip(state.marks.switch_values()) {
            *place = on;
        }
        let (t, age) = (from.to_f64(), from.since(world.tree.birth(state.id)));
        let solve = &rule.solves[state.solve.get().expect("numeric trajectories have equations")];
        let program = if state.numeric_only { &solve.rates } else { &solve.numeric_rates };
        let mut numeric: SmallVec<[usize; 4]> = smallvec::smallvec![0; program.outputs()];
        let mut formulas = SmallVec::new();
        y.resize(program.outputs(), 0.0);
        for (i, law) in state.trajectories.iter().enumerate() {
            match law {
                Law::Rest => {}
                Law::Step(c) | Law::Coupled(c) => {
                    numeric[c as usize] = i;
                    y[c as usize] = own[i];
                }
                Law::Formula(formula) => formulas.push((i, formula, own[i])),
            }
        }
        let (offset, time) = (from.since(state.since), rule.time_variable());
        let clocks = [program.reads().contains(&time), program.reads().contains(&(time + 1))];
        let only = match numeric[..] {
            [only] if formulas.is_empty() && clocks == [false; 2] => Some(only),
            _ => None,
        };
        Independent {
            solve,
            program,
            variables,
            numeric,
            formulas,
            offset,
            time,
            clocks,
            only,
            t,
            age,
            scratch,
        }
    }
}

impl Independent<'_> {
    /// The partial derivatives of the rates by the components: row, column and entry in the clause's Jacobian.
    fn entries(&self) -> impl Iterator<Item = (u32, u32, usize)> {
        let component = |variable: usize| self.numeric.iter().position(|v| *v == variable).map(|c| c as u32);
        self.solve.jacobian.entries.iter().enumerate().filter_map(move |(entry, &(row, variable))| {
            Some((component(self.solve.of[row])?, component(variable)?, entry))
        })
    }

    /// Fills in the variables that move, at a time since the start of the step.
    fn move_to(&mut self, tau: f64, y: &[f64]) {
        self.move_components(tau, y);
        self.variables[self.time] = self.t + tau;
        self.variables[self.time + 1] = self.age + tau;
    }

    /// The same but for the times.
    #[inline]
    fn move_components(&mut self, tau: f64, y: &[f64]) {
        let numeric = &self.numeric[..y.len()];
        for (component, value) in y.iter().enumerate() {
            self.variables[numeric[component]] = *value;
        }
        if !self.formulas.is_empty() {
            for &(variable, trajectory, x) in &self.formulas {
                self.variables[variable] = trajectory.at(x, self.offset + tau);
            }
        }
    }
}

/// A term is made larger by so many times its rounding, to see what that does to rates: so much that it shows.
const MANY_ROUNDINGS: f64 = 64.0;

/// Most times that a step is cut because it may have overlooked a pulse.
const MAX_TRIES: usize = 100;

impl Rates for Independent<'_> {
    #[inline]
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        match (self.only, y) {
            (Some(only), [y]) => self.variables[only] = *y,
            _ if self.clocks == [false; 2] => self.move_components(tau, y),
            _ => self.move_to(tau, y),
        }
        self.program.eval_in(&mut self.variables, out);
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.entries().map(|(row, column, _)| (row, column)).collect()
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        self.move_to(tau, y);
        let values = &self.solve.jacobian.values;
        let mut all: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; values.outputs()];
        values.eval(&self.variables, &mut self.scratch, &mut all);
        out.clear();
        out.extend(self.entries().map(|(.., entry)| all[entry]));
    }

    fn add_rounding(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.move_to(tau, y);
        let all = &self.solve.pulses.rates;
        let mut terms = vec![0.0; all.terms.outputs()];
        if terms.is_empty() {
            return;
        }
        all.terms.eval(&self.variables, &mut self.scratch, &mut terms);
        let first = all.disturbed.variables() - terms.len();
        let mut variables = self.variables[..first].to_vec();
        variables.resize(first + terms.len(), 0.0);
        let [mut rates, mut others] = [(); 2].map(|()| vec![0.0; all.disturbed.outputs()]);
        all.disturbed.eval(&variables, &mut self.scratch, &mut rates);
        for (more, term) in (first..).zip(&terms) {
            variables[more] = MANY_ROUNDINGS * f64::EPSILON * term.abs();
            all.disturbed.eval(&variables, &mut self.scratch, &mut others);
            variables[more] = 0.0;
            for ((rate, other), of) in rates.iter().zip(&others).zip(&all.parameters) {
                let rounding = (other - rate).abs() / MANY_ROUNDINGS;
                if let Some(component) = self.numeric.iter().position(|variable| variable == of)
                    && rounding.is_finite()
                {
                    out[component] += rounding;
                }
            }
        }
    }

    fn modules(&self) -> u64 {
        1
    }

    fn stands_alone(&self) -> bool {
        true
    }

    fn mark_sums(&self, is_sum: &mut [bool]) {
        for (is_sum, variable) in is_sum.iter_mut().zip(&self.numeric) {
            *is_sum = !self.solve.jacobian.entries.iter().any(|entry| entry.1 == *variable);
        }
    }

    fn is_timed(&self) -> bool {
        self.clocks[0]
    }

    fn reads_clock(&self) -> bool {
        self.clocks.contains(&true)
    }
}

/// The first position in a step, from 0 to 1, from which on a pulse may have been overlooked. A rule whose rates cannot
/// be bounded in steps that have been cut often enough, or that are as short as steps can be, is recorded.
fn overlooked(detector: &mut Detector, step: &ExaminedStep, rule: usize, is_last: bool) -> Option<f64> {
    match detector.pulses.examine(step) {
        PulseFinding::Clear => None,
        PulseFinding::Unbounded(at) if is_last => {
            let h = step.own.map_or(0.0, |dense| dense.h);
            detector.unbounded.entry(rule).or_insert(step.start.to_f64() + at * h);
            None
        }
        PulseFinding::Overlooked(at) | PulseFinding::Unbounded(at) => Some(at),
    }
}

impl FlowStage<'_, '_> {
    /// The experience with which a module makes its next step.
    pub fn experience(&self, id: ModuleId) -> Experience {
        let state = self.world.state(id).expect("a module with a rule");
        let solve = state.solve.get().expect("has equations");
        let hint = self.flows.hints[self.world.tree.kind(id).index()][solve];
        let last = state.trajectories.step();
        let (mut control, number, hurdle) = match last {
            Some(s) if s.solve == solve => (s.control, s.number + 1, s.hurdle),
            Some(s) if s.live => (s.control, 0, hint.hurdle),
            _ => (hint.control, 0, hint.hurdle),
        };
        if let Some(hurdle) = hurdle.filter(|hurdle| hurdle.number == number) {
            control.size = control.size.min(hurdle.size);
        }
        // The experience of other modules tells nothing about the error of this one's values.
        control.error = last.map_or(0.0, |s| s.control.error);
        Experience { control, number, hurdle, goes_on: last.is_some_and(|s| s.live) }
    }

    /// Makes a step of a module from its values in the tree, with this experience and a part of the tolerance; returns its length.
    ///
    /// # Errors
    /// If no step can be made, or steps hardly advance time.
    pub fn step_independent(
        &mut self,
        id: ModuleId,
        from: SimTime,
        experience: Experience,
        accuracy: f64,
    ) -> Result<f64, Error> {
        let Experience { mut control, number, mut hurdle, .. } = experience;
        let rejected = self.log.stats.rejected;
        let dense = self.make_own_step(id, from, &mut control, accuracy).map_err(|error| {
            let own = |component: usize| {
                let state = self.world.state(id)?;
                let is_it = |law| matches!(law, Law::Step(c) if c as usize == component);
                Some((id, state.trajectories.iter().position(is_it)?))
            };
            self.step_error(error, from, own)
        })?;
        let is_new = self.log.stats.rejected > rejected && hurdle.is_none_or(|hurdle| number < hurdle.number);
        if is_new || hurdle.is_some_and(|hurdle| number == hurdle.number) {
            hurdle = Some(Hurdle { number, size: control.size });
        }
        let h = dense.h;
        self.flows.independent_last = Some((id, dense.end));
        self.take_step(id, from, Made { dense, control, number, hurdle })?;
        Ok(h)
    }

    /// Gives a module the step that leads on from an instant.
    ///
    /// # Errors
    /// If steps hardly advance time.
    pub fn take_step(&mut self, id: ModuleId, from: SimTime, made: Made) -> Result<(), Error> {
        let fixed = self.setup.settings.method.is_fixed_step();
        let state = self.world.state_mut(id).expect("a module with a rule");
        let solve = state.solve.get().expect("has equations");
        let Made { dense, control, number, hurdle } = made;
        let crawling = match state.trajectories.step_mut() {
            Some(step) => {
                if !step.live {
                    (step.mark, step.since_mark) = (from, 0);
                }
                if step.solve != solve {
                    (step.solve, step.begun, step.first) = (solve, from, control.size);
                }
                (step.dense, step.control, step.live) = (dense, control, true);
                (step.number, step.hurdle) = (number, hurdle);
                crawls(&mut step.mark, &mut step.since_mark, from)
            }
            None => {
                let (begun, mark, since_mark, first) = (from, from, 0, control.size);
                let step_made = Step {
                    dense,
                    control,
                    solve,
                    begun,
                    first,
                    number,
                    hurdle,
                    live: true,
                    mark,
                    since_mark,
                };
                state.trajectories.begin_steps(step_made);
                false
            }
        };
        if crawling && !fixed {
            return Err(self.step_error(StepError::StepTooSmall(0), from, |_| Some((id, 0))));
        }
        Ok(())
    }

    /// Makes a step of a module that overlooks no pulse; shorter ones are tried until one does.
    fn make_own_step(
        &mut self,
        id: ModuleId,
        from: SimTime,
        control: &mut Control,
        accuracy: f64,
    ) -> Result<Dense, StepError> {
        let state = self.world.state(id).expect("a module with a rule");
        let (index, solve) =
            (state.rule.get().expect("has a rule"), state.solve.get().expect("has equations"));
        let rule = &self.setup.model.rules[index];
        let solve = &rule.solves[solve];
        let mut y = std::mem::take(&mut self.flows.y);
        let variables = std::mem::take(&mut self.flows.registers);
        let scratch = std::mem::take(&mut self.scratch.registers);
        let mut system = Independent::new(self.world, state, rule, from, variables, scratch, &mut y);
        let integrator = &mut self.flows.independent;
        // A step that begins at the end of the module's last one need not evaluate its rates again.
        let last = state.trajectories.step().filter(|s| s.live);
        if last.is_some_and(|s| self.flows.independent_last == Some((id, s.dense.end)))
            && y.len() == integrator.size()
        {
            integrator.advance(&mut y);
        } else {
            integrator.restart(self.setup.settings.method, y.len());
        }
        let fixed = self.setup.settings.method.is_fixed_step();
        let mut settings = self.setup.settings.for_clocks(solve.has_hazard_clock);
        settings.tolerance *= accuracy;
        let error = control.error;
        let stiff = control.stiff || self.setup.settings.method.is_implicit();
        let pulses = !solve.pulses.is_empty() && !fixed;
        integrator.keep_reached(pulses);
        let least = 64.0 * from.resolution();
        // Where fields are read, they cut the steps.
        let limit = self.world.resolved(from).filter(|_| solve.rates.stretch().is_finite());
        integrator.expect_cuts(limit.is_some());
        let mut tries = 0;
        let step = loop {
            let stats = &mut self.log.stats;
            let request = StepRequest { settings: &settings, y: &y, start: from, limit };
            let step = integrator.step(request, control, &mut system, stats);
            let step = step.map(|_| integrator.dense(&mut system, &y));
            let Ok(dense) = &step else { break step };
            tries += 1;
            if !pulses || tries > MAX_TRIES {
                break step;
            }
            let conditions = Conditions::new(&self.setup.model.rules, &self.setup.settings, stiff);
            let stages = Stages::of(integrator);
            let examined = ExaminedStep::alone(self.world, id, dense, stages, conditions);
            let Some(examined) = examined else { break step };
            let is_last = tries > MAX_UNBOUNDED || dense.h <= least;
            match overlooked(self.detector, &examined, index, is_last) {
                Some(at) if dense.h > least => {
                    stats.rejected += 1;
                    let part = if at > 0.0 { at } else { 0.25 };
                    control.size = (part * dense.h).max(least);
                }
                _ => break step,
            }
        };
        (self.flows.registers, self.scratch.registers) = (system.variables, system.scratch);
        self.flows.y = y;
        // A step that is more accurate does not make the values more accurate from which it leads.
        control.error = control.error.max(error);
        step
    }

    /// Adapts the step size with which a module goes on after an event inside its own step, and that with which the next module
    /// under these equations begins: as this one should have begun, for lives that follow each other begin alike.
    pub fn learn(&mut self, id: ModuleId) {
        let (now, kind) = (self.instant.at, self.world.tree.kind(id).index());
        let Some(state) = self.world.state_mut(id) else { return };
        let (Some(solve), Some(step)) = (state.solve.get(), state.trajectories.step_mut()) else { return };
        if step.live {
            let control = &mut step.control;
            control.foresee(control.last_error, now.since(step.dense.start), now.resolution());
            control.last_error = 1.0;
            let size = if step.dense.start == step.begun { control.size } else { step.first };
            let control = Control { size, ..*control };
            self.flows.hints[kind][solve] = Hint { control, hurdle: step.hurdle };
        }
    }

    /// The error of a run for a step that fails. `owner` gives the module and parameter that a component belongs to.
    pub fn step_error(
        &self,
        error: StepError,
        at: SimTime,
        owner: impl Fn(usize) -> Option<(ModuleId, usize)>,
    ) -> Error {
        let (id, parameter) = owner(error.component()).unwrap_or_else(|| (self.flows.anyone(self.world), 0));
        let index = self.world.state(id).and_then(|s| s.rule.get()).unwrap_or(0);
        let rule = &self.setup.model.rules[index];
        let solve = self.world.state(id).and_then(|s| s.solve.get());
        let span = solve.map_or(rule.span, |s| rule.solves[s].span);
        let mut site = self.world.site(self.setup.model, id, index, span, at);
        let mut values = Vec::new();
        self.world.values(id, at, &mut values);
        site.module = describe(self.setup.model, self.world.tree.kind(id), &values);
        let name = rule.parameters.get(parameter).cloned().unwrap_or_default();
        if let Some(clock) = rule.clocks.iter().find(|clock| clock.parameter == parameter)
            && !matches!(error, StepError::StepTooSmall(_))
        {
            site.span = rule.produces[clock.produce].span;
            return Error::NotFinite { site, what: "the rate of an event".to_owned() };
        }
        match error {
            StepError::StepTooSmall(_) => Error::StepTooSmall { site },
            StepError::RateNotFinite(_) => Error::NotFinite { site, what: format!("the rate of {name}") },
            _ => Error::NotFinite { site, what: name },
        }
    }
}
