//! The equations of the coupled modules between two changes of structure.

use super::course::Course;
use super::motion::Motion;
use super::plant::Plant;
use super::runge_kutta::Rates;
use crate::expr::{LANES, Lanes, Program, Scratch};
use crate::model::Rule;
use crate::structure::{Instant, ModuleId};
use smallvec::SmallVec;

/// Rule, clause and whether all is integrated, and the rows for which that is so.
type Batch = ((usize, usize, bool), SmallVec<[u32; 16]>);

/// Where a variable of a rule comes from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// It does not change before the next event.
    Fixed(f64),
    /// A component of the state vector.
    State(u32),
    /// A formula.
    Formula(u32),
    /// A component of the coupled modules that is no unknown here: it is known already how it moves.
    Input(u32),
}

/// The equations of the coupled modules.
#[derive(Clone, Debug, Default)]
pub struct System {
    pub rows: Vec<Row>,
    pub sources: Vec<Source>,
    pub formulas: Vec<Formula>,
    /// Components of the coupled modules that are read.
    inputs: Vec<u32>,
    chunks: Vec<Chunk>,
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

/// Rows that are evaluated at once: at most [`LANES`], with the same program.
#[derive(Clone, Debug)]
struct Chunk {
    rows: Vec<u32>,
    /// Registers of the rule's variables.
    registers: usize,
    /// What the program reads, and from where.
    columns: Vec<(usize, Column)>,
    /// Places of the first rate of each row.
    rates: Places,
}

/// One variable of all rows of a chunk.
#[derive(Clone, Debug)]
enum Column {
    Time,
    Age,
    Fixed(Vec<f64>),
    State(Places),
    Mixed(Vec<Source>),
}

/// Places in a vector; mostly one after another, because rows stand in string order.
#[derive(Clone, Debug)]
enum Places {
    Run { first: usize, count: usize },
    Any(Vec<u32>),
}

impl Places {
    fn new(all: Vec<u32>) -> Places {
        let first = all[0];
        match all.iter().zip(first..).all(|(a, b)| *a == b) {
            true => Places::Run { first: first as usize, count: all.len() },
            false => Places::Any(all),
        }
    }

    fn gather(&self, from: &[f64], to: &mut Lanes) {
        match self {
            &Places::Run { first, count } => to[..count].copy_from_slice(&from[first..first + count]),
            Places::Any(all) => {
                for (lane, place) in to.iter_mut().zip(all) {
                    *lane = from[*place as usize];
                }
            }
        }
    }

    /// Writes to the places, all moved by `offset`.
    fn scatter(&self, from: &Lanes, offset: usize, to: &mut [f64]) {
        match self {
            &Places::Run { first, count } => {
                to[first + offset..first + offset + count].copy_from_slice(&from[..count])
            }
            Places::Any(all) => {
                for (lane, place) in from.iter().zip(all) {
                    to[*place as usize + offset] = *lane;
                }
            }
        }
    }
}

impl System {
    /// The equations of some of the coupled modules. `unknown` gives the number here of a component, in the order of
    /// the members; None if it is not integrated here. If `frozen`, neighbours are
    /// taken as they are at the start.
    pub fn new(
        rules: &[Rule],
        plant: &Plant,
        members: &[ModuleId],
        start: Instant,
        unknown: impl Fn(u32) -> Option<u32>,
        frozen: bool,
    ) -> System {
        let mut system = System::default();
        system.rebuild(rules, plant, members, start, unknown, frozen);
        system
    }

    /// The same, in the memory of other equations.
    pub fn rebuild(
        &mut self,
        rules: &[Rule],
        plant: &Plant,
        members: &[ModuleId],
        start: Instant,
        unknown: impl Fn(u32) -> Option<u32>,
        frozen: bool,
    ) {
        let system = self;
        system.start = start;
        system.rows.clear();
        system.sources.clear();
        system.formulas.clear();
        system.inputs.clear();
        system.switches.clear();
        system.places.clear();
        let mut values_then = Vec::new();
        for &id in members {
            let state = plant.state(id).expect("members have states");
            let first = plant.tree.places(id).start;
            let mut own: SmallVec<[(u32, usize); 4]> = (state.motions.iter().enumerate())
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
                if frozen && module != id {
                    values_then.clear();
                    plant.values(module, start, &mut values_then);
                    system.sources.extend(values_then.iter().map(|x| Source::Fixed(*x)));
                    continue;
                }
                let values = plant.tree.parameters(module);
                let neighbour = plant.state(module).filter(|s| !s.motions.is_empty());
                for (i, &x) in values.iter().enumerate() {
                    system.sources.push(match neighbour.map(|s| (&s.motions[i], s.since)) {
                        None | Some((Motion::Rest | Motion::Step(_), _)) => Source::Fixed(x),
                        Some((Motion::Coupled(c), _)) => match unknown(*c) {
                            Some(number) => Source::State(number),
                            None => {
                                system.inputs.push(*c);
                                Source::Input(system.inputs.len() as u32 - 1)
                            }
                        },
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
    }

    /// Puts rows with the same program together, a chunk of them for each evaluation.
    fn batch(&mut self, rules: &[Rule]) {
        let mut batches: SmallVec<[Batch; 4]> = SmallVec::new();
        for (n, row) in self.rows.iter().enumerate() {
            let key = (row.rule, row.solve, row.forced);
            match batches.iter_mut().find(|(k, _)| *k == key) {
                Some((_, rows)) => rows.push(n as u32),
                None => batches.push((key, smallvec::smallvec![n as u32])),
            }
        }
        let mut chunks = std::mem::take(&mut self.chunks);
        chunks.clear();
        for (_, rows) in &batches {
            let first = &self.rows[rows[0] as usize];
            let program = program(rules, first);
            let reads = program.reads();
            for rows in rows.chunks(LANES) {
                let columns = reads.iter().map(|&variable| (variable, self.column(rows, variable))).collect();
                let rates = rows.iter().map(|row| self.rows[*row as usize].first_rate as u32).collect();
                let registers = first.sources + 2 + first.switches;
                let rows = rows.to_vec();
                chunks.push(Chunk { rows, registers, columns, rates: Places::new(rates) });
            }
        }
        self.chunks = chunks;
    }

    /// Where one variable of some rows with the same program comes from.
    fn column(&self, rows: &[u32], variable: usize) -> Column {
        let rows = || rows.iter().map(|row| &self.rows[*row as usize]);
        let sources = rows().next().map_or(0, |row| row.sources);
        if variable == sources {
            return Column::Time;
        }
        if variable == sources + 1 {
            return Column::Age;
        }
        if variable > sources {
            let switch = |row: &Row| self.switches[row.first_switch + variable - sources - 2];
            return Column::Fixed(rows().map(switch).collect());
        }
        let all: Vec<Source> = rows().map(|row| self.sources[row.first_source + variable]).collect();
        let state = |source: &Source| match source {
            Source::State(component) => Some(*component),
            _ => None,
        };
        let fixed = |source: &Source| match source {
            Source::Fixed(x) => Some(*x),
            _ => None,
        };
        if let Some(components) = all.iter().map(state).collect() {
            return Column::State(Places::new(components));
        }
        match all.iter().map(fixed).collect() {
            Some(values) => Column::Fixed(values),
            None => Column::Mixed(all),
        }
    }

    /// What the components that are read are at a time after the start; NaN where that is not known.
    fn read(&self, course: Option<&Course>, tau: f64, out: &mut Vec<f64>) {
        out.clear();
        if !self.inputs.is_empty() {
            let at = self.start.after(tau);
            let value = |component: &u32| course.and_then(|c| c.value(*component as usize, at));
            out.extend(self.inputs.iter().map(|component| value(component).unwrap_or(f64::NAN)));
        }
    }

    fn value(&self, source: Source, tau: f64, y: &[f64], inputs: &[f64]) -> f64 {
        match source {
            Source::Input(i) => inputs[i as usize],
            Source::Fixed(x) => x,
            Source::State(component) => y[component as usize],
            Source::Formula(i) => {
                let Formula { motion, x, offset, .. } = &self.formulas[i as usize];
                x + motion.value(offset + tau)
            }
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

    /// The variables of a row's rule, `inputs` being what it reads besides.
    pub fn variables(&self, row: &Row, tau: f64, y: &[f64], inputs: &[f64], out: &mut Vec<f64>) {
        out.clear();
        let sources = &self.sources[row.first_source..row.first_source + row.sources];
        out.extend(sources.iter().map(|source| self.value(*source, tau, y, inputs)));
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
    /// How the components move that are inputs.
    course: Option<&'s Course>,
    inputs: Vec<f64>,
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    registers: Vec<Lanes>,
}

impl<'s> Equations<'s> {
    pub fn new(system: &'s System, rules: &'s [Rule], course: Option<&'s Course>) -> Equations<'s> {
        let (inputs, variables, scratch, registers) = Default::default();
        Equations { system, rules, course, inputs, variables, scratch, registers }
    }

    /// The rates of a few rows that have the same program.
    fn lanes(&mut self, chunk: &Chunk, tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        let program = program(self.rules, &system.rows[chunk.rows[0] as usize]);
        self.registers.resize(chunk.registers, [0.0; LANES]);
        for (variable, column) in &chunk.columns {
            let register = &mut self.registers[*variable];
            match column {
                Column::Time => *register = [system.start.to_f64() + tau; LANES],
                Column::Age => {
                    for (lane, row) in register.iter_mut().zip(&chunk.rows) {
                        *lane = system.rows[*row as usize].age + tau;
                    }
                }
                Column::Fixed(values) => register[..values.len()].copy_from_slice(values),
                Column::State(places) => places.gather(y, register),
                Column::Mixed(sources) => {
                    for (lane, source) in register.iter_mut().zip(sources) {
                        *lane = system.value(*source, tau, y, &self.inputs);
                    }
                }
            }
        }
        for (output, register) in program.eval_lanes(&mut self.registers).enumerate() {
            chunk.rates.scatter(&self.registers[register], output, out);
        }
    }
}

impl Rates for Equations<'_> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        system.read(self.course, tau, &mut self.inputs);
        for chunk in &system.chunks {
            self.lanes(chunk, tau, y, out);
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
        self.system.read(self.course, tau, &mut self.inputs);
        for row in &self.system.rows {
            let jacobian = &self.rules[row.rule].solves[row.solve].jacobian;
            self.system.variables(row, tau, y, &self.inputs, &mut variables);
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
