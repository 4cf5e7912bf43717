//! The equations of the coupled modules between two changes of structure.

use super::motion::Motion;
use super::plant::Plant;
use super::runge_kutta::Rates;
use crate::expr::{LANES, Lanes, Program, Scratch};
use crate::model::Rule;
use crate::structure::{Instant, ModuleId};

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
    pub places: Vec<(usize, ModuleId, usize)>,
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
    pub fn new(rules: &[Rule], plant: &Plant, members: &[ModuleId], start: Instant) -> System {
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
    pub fn advance(&mut self, start: Instant) {
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
pub struct Equations<'s> {
    system: &'s System,
    rules: &'s [Rule],
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    registers: Vec<Lanes>,
}

impl<'s> Equations<'s> {
    pub fn new(system: &'s System, rules: &'s [Rule]) -> Equations<'s> {
        let (variables, scratch, registers) = Default::default();
        Equations { system, rules, variables, scratch, registers }
    }

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
