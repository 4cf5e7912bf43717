//! Modules whose equations read one another, integrated together.
//!
//! Only those are coupled that read something of a neighbour which is integrated itself; a neighbour that follows a
//! formula is an input. Whatever happens to one of them, or to what they read, ends their common step.

use super::Method;
use super::error::Error;
use super::integrator::{Integrator, StepError, foresee};
use super::linear::Linear;
use super::motion::Motion;
use super::plant::{Path, Plant};
use super::queue::Who;
use super::runge_kutta::Rates;
use super::simulation::Simulation;
use super::state::{Change, Control, Next};
use super::watch::path_together;
use crate::expr::{LANES, Lanes, Program, Scratch};
use crate::model::Rule;
use crate::structure::{Instant, ModuleId, Visit};
use smallvec::SmallVec;

/// The coupled modules and their step.
#[derive(Default)]
pub struct Coupled {
    /// In string order.
    pub members: Vec<ModuleId>,
    pub system: System,
    y: Vec<f64>,
    integrator: Integrator,
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

/// Where a variable of a rule comes from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// It does not change before the next event.
    Fixed(f64),
    /// A component of the state vector.
    State(u32),
    /// A formula.
    Formula(u32),
}

/// The equations of the coupled modules.
#[derive(Clone, Debug, Default)]
pub struct System {
    pub rows: Vec<Row>,
    pub sources: Vec<Source>,
    pub formulas: Vec<Formula>,
    /// Rows with the same program.
    batches: Vec<Vec<u32>>,
    /// The variables that the programs of each rule's clauses read.
    reads: Vec<Vec<Vec<usize>>>,
    switches: Vec<f64>,
    /// Place in the tree's values, and owner with its parameter, of each component.
    places: Vec<(usize, ModuleId, usize)>,
    pub start: Instant,
}

/// A parameter that follows a formula, as an input.
#[derive(Clone, Debug)]
pub struct Formula {
    pub motion: Motion,
    pub x: f64,
    since: Instant,
    /// Time since then, at the start of the step.
    pub offset: f64,
}

/// The equations of one module.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub rule: usize,
    pub solve: usize,
    pub forced: bool,
    pub first_source: usize,
    pub sources: usize,
    first_switch: usize,
    switches: usize,
    pub first_rate: usize,
    birth: Instant,
    age: f64,
}

impl System {
    /// The equations of some modules of the plant, whose numeric parameters have their components.
    fn new(rules: &[Rule], plant: &Plant, members: &[ModuleId], start: Instant) -> System {
        let mut system = System { start, ..System::default() };
        for &id in members {
            let state = plant.state(id).expect("members have states");
            let first = plant.tree.places(id).start;
            let mut own: Vec<(u32, usize)> = (state.motions.iter().enumerate())
                .filter_map(|(parameter, m)| match m {
                    Motion::Coupled(c) => Some((*c, parameter)),
                    _ => None,
                })
                .collect();
            own.sort_unstable();
            let (Some(rule), Some(solve)) = (state.rule, state.solve) else { continue };
            if own.is_empty() {
                continue;
            }
            let first_rate = system.places.len();
            system.places.extend(own.iter().map(|&(_, parameter)| (first + parameter, id, parameter)));
            let first_source = system.sources.len();
            for &module in std::iter::once(&id).chain(&state.context) {
                let values = plant.tree.parameters(module);
                let neighbour = plant.state(module).filter(|s| !s.motions.is_empty());
                for (i, &x) in values.iter().enumerate() {
                    system.sources.push(match neighbour.map(|s| (&s.motions[i], s.since)) {
                        None | Some((Motion::Rest | Motion::Step(_), _)) => Source::Fixed(x),
                        Some((Motion::Coupled(c), _)) => Source::State(*c),
                        Some((motion, since)) => {
                            let offset = start.since(since);
                            system.formulas.push(Formula { motion: motion.clone(), x, since, offset });
                            Source::Formula(system.formulas.len() as u32 - 1)
                        }
                    });
                }
            }
            let first_switch = system.switches.len();
            system.switches.extend(state.switches.iter().map(|&on| f64::from(u8::from(on))));
            let birth = plant.tree.birth(id);
            system.rows.push(Row {
                rule,
                solve,
                forced: state.forced,
                first_source,
                sources: system.sources.len() - first_source,
                first_switch,
                switches: system.switches.len() - first_switch,
                first_rate,
                birth,
                age: start.since(birth),
            });
        }
        system.batch(rules);
        system
    }

    /// Puts rows with the same program together.
    fn batch(&mut self, rules: &[Rule]) {
        self.reads = vec![Vec::new(); rules.len()];
        let mut keys: Vec<(usize, usize, bool)> = Vec::new();
        for (n, row) in self.rows.iter().enumerate() {
            let key = (row.rule, row.solve, row.forced);
            let batch = keys.iter().position(|k| *k == key).unwrap_or_else(|| {
                keys.push(key);
                self.batches.push(Vec::new());
                keys.len() - 1
            });
            self.batches[batch].push(n as u32);
        }
        for (rule, solve, _) in keys {
            self.reads[rule].resize(rules[rule].solves.len(), Vec::new());
            self.reads[rule][solve] = rules[rule].solves[solve].rates.reads();
        }
    }

    /// One variable of a row's rule.
    fn variable(&self, row: &Row, variable: usize, tau: f64, y: &[f64]) -> f64 {
        if variable < row.sources {
            return match self.sources[row.first_source + variable] {
                Source::Fixed(x) => x,
                Source::State(component) => y[component as usize],
                Source::Formula(i) => {
                    let Formula { motion, x, offset, .. } = &self.formulas[i as usize];
                    x + motion.value(offset + tau)
                }
            };
        }
        match variable - row.sources {
            0 => self.start.to_f64() + tau,
            1 => row.age + tau,
            switch => self.switches[row.first_switch + switch - 2],
        }
    }

    /// Moves the start of the step.
    fn advance(&mut self, start: Instant) {
        self.start = start;
        for row in &mut self.rows {
            row.age = start.since(row.birth);
        }
        for formula in &mut self.formulas {
            formula.offset = start.since(formula.since);
        }
    }

    pub fn variables(&self, row: &Row, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        out.clear();
        for source in &self.sources[row.first_source..row.first_source + row.sources] {
            out.push(match *source {
                Source::Fixed(x) => x,
                Source::State(component) => y[component as usize],
                Source::Formula(i) => {
                    let Formula { motion, x, offset, .. } = &self.formulas[i as usize];
                    x + motion.value(offset + tau)
                }
            });
        }
        out.extend([self.start.to_f64() + tau, row.age + tau]);
        out.extend_from_slice(&self.switches[row.first_switch..row.first_switch + row.switches]);
    }

    /// Row, column and entry in the clause's Jacobian, of each partial derivative of one module's rates.
    fn row_partials<'s>(
        &'s self,
        rules: &'s [Rule],
        row: &'s Row,
    ) -> impl Iterator<Item = (u32, u32, usize)> + 's {
        let solve = &rules[row.rule].solves[row.solve];
        (solve.jacobian.entries.iter().enumerate()).filter_map(move |(entry, &(position, variable))| {
            let rate =
                if row.forced { Some(position) } else { solve.numeric.iter().position(|p| *p == position) };
            match self.sources[row.first_source + variable] {
                Source::State(column) => Some(((row.first_rate + rate?) as u32, column, entry)),
                _ => None,
            }
        })
    }

    fn partials<'s>(&'s self, rules: &'s [Rule]) -> impl Iterator<Item = (u32, u32, usize)> + 's {
        self.rows.iter().flat_map(|row| self.row_partials(rules, row))
    }

    /// The module, and its parameter, that a component belongs to.
    pub fn owner(&self, component: usize) -> Option<(ModuleId, usize)> {
        self.places.get(component).map(|&(_, id, parameter)| (id, parameter))
    }
}

/// The code of a row's rates.
fn program<'s>(rules: &'s [Rule], row: &Row) -> &'s Program {
    let solve = &rules[row.rule].solves[row.solve];
    if row.forced { &solve.rates } else { &solve.numeric_rates }
}

/// The right-hand side of a [`System`].
struct Equations<'s> {
    system: &'s System,
    rules: &'s [Rule],
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    registers: Vec<Lanes>,
}

impl Equations<'_> {
    /// The rates of a few rows that have the same program.
    fn lanes(&mut self, rows: &[u32], tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        let first = &system.rows[rows[0] as usize];
        let program = program(self.rules, first);
        let mut registers = std::mem::take(&mut self.registers);
        registers.resize(first.sources + 2 + first.switches, [0.0; LANES]);
        for &variable in &system.reads[first.rule][first.solve] {
            let register = &mut registers[variable];
            for (lane, &row) in rows.iter().enumerate() {
                let row = &system.rows[row as usize];
                register[lane] = system.variable(row, variable, tau, y);
            }
        }
        for (output, register) in program.eval_lanes(&mut registers).enumerate() {
            for (lane, &row) in rows.iter().enumerate() {
                out[system.rows[row as usize].first_rate + output] = registers[register][lane];
            }
        }
        self.registers = registers;
    }
}

impl Rates for Equations<'_> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        for batch in &system.batches {
            for rows in batch.chunks(LANES) {
                self.lanes(rows, tau, y, out);
            }
        }
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.system.partials(self.rules).map(|(row, column, _)| (row, column)).collect()
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        let mut variables = std::mem::take(&mut self.variables);
        let mut scratch = std::mem::take(&mut self.scratch);
        let mut values = Vec::new();
        out.clear();
        for row in &self.system.rows {
            let jacobian = &self.rules[row.rule].solves[row.solve].jacobian;
            self.system.variables(row, tau, y, &mut variables);
            values.resize(jacobian.values.outputs(), 0.0);
            jacobian.values.eval(&variables, &mut scratch, &mut values);
            out.extend(self.system.row_partials(self.rules, row).map(|(.., entry)| values[entry]));
        }
        self.variables = variables;
        self.scratch = scratch;
    }

    fn modules(&self) -> u64 {
        self.system.rows.len() as u64
    }
}

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
        self.coupled.linear = match self.settings.method {
            Method::Auto if !self.coupled.control.stiff => {
                Linear::new(&self.coupled.system, &self.model.rules, &self.coupled.y)
            }
            _ => None,
        };
        self.coupled.direct =
            self.coupled.linear.as_ref().is_some_and(Linear::is_direct) && !self.watches_coupled();
        self.coupled.integrator.restart(self.settings.method, self.coupled.y.len());
        (self.coupled.mark, self.coupled.since_mark) = (now, 0);
        if self.coupled.members.is_empty() {
            self.queue.cancel(Who::Coupled);
            return Ok(());
        }
        if self.coupled.direct {
            self.queue.cancel(Who::Coupled);
            self.coupled.touched.clear();
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
        let known = self.queue.peek().map_or(f64::INFINITY, |entry| entry.at.since(from));
        let Coupled { system, y, integrator, control, linear, .. } = &mut self.coupled;
        let dense = match linear {
            Some(linear) => {
                self.stats.steps += 1;
                self.stats.rhs_evaluations += linear.evaluations();
                linear.step(self.settings.tolerance * LINEAR_TOLERANCE, BEYOND * known.max(from.resolution()))
            }
            None => {
                let mut equations = Equations {
                    system,
                    rules,
                    variables: Vec::new(),
                    scratch: Vec::new(),
                    registers: Vec::new(),
                };
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
