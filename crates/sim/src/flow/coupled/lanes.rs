//! Rates of many modules at once: rows with the same program, evaluated side by side in the lanes of vector registers.
//!
//! For each variable that the program reads, a [`LaneColumn`] holds the sources of that variable in all rows of a chunk.

use crate::flow::coupled::rows::{EquationRow, EquationTable, VariableSource};
use dlsys_expr::{LANES, Lanes, Program};
use dlsys_model::Rule;
use dlsys_wide::Kernel;
use smallvec::SmallVec;
use std::ops::Range;

/// All rows with rates, in chunks. The contents of chunks and columns stand in a few long lists, so that the equations
/// of another region are written into the memory of the last.
#[derive(Clone, Debug, Default)]
pub struct LaneBatches {
    chunks: Vec<Chunk>,
    rows: Vec<u32>,
    columns: Vec<(u32, LaneColumn)>,
    numbers: Vec<f64>,
    places: Vec<u32>,
    /// Lanes of mixed columns that read neither a component nor an input, with their sources.
    others: Vec<(u32, VariableSource)>,
    /// The first column of the chunk that has begun.
    first_column: usize,
}

/// What tells the program of a row's rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProgramKey {
    /// Index of the module's rule.
    pub rule: usize,
    /// Index of the active `solve` clause in the rule.
    pub solve: usize,
    /// All equations are integrated, those with closed forms too.
    pub numeric_only: bool,
}

impl ProgramKey {
    /// The program of the rates.
    pub fn program(self, rules: &[Rule]) -> &Program {
        let solve = &rules[self.rule].solves[self.solve];
        if self.numeric_only { &solve.rates } else { &solve.numeric_rates }
    }
}

/// Rows that are evaluated at once: at most [`LANES`], with the same program.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    key: ProgramKey,
    rows: usize,
    /// The number of registers that the rule's variables take.
    registers: usize,
    /// The columns that the program reads.
    first_column: usize,
    columns: usize,
    /// The component of the first rate of each row.
    rates: LanePlaces,
}

/// One variable in all rows of a chunk. The numbers are the starts of its values in a list.
#[derive(Clone, Copy, Debug)]
pub enum LaneColumn {
    Time,
    /// Ages, of rows from the first number on.
    Age(usize),
    Fixed(usize),
    State(LanePlaces),
    /// Components and inputs; the numbers of inputs follow those of the components.
    Known(usize),
    /// Aggregates, by their numbers.
    RowAggregate(usize),
    /// Mostly components and inputs, from the first number on; the lanes between the others read something else.
    Mixed(usize, usize, usize),
}

/// Places in a vector; mostly consecutive, because rows stand in string order.
#[derive(Clone, Copy, Debug)]
pub enum LanePlaces {
    Run(usize),
    Any(usize),
}

/// The values that the rows of a table read at one time.
pub struct EvaluationPoint<'r> {
    /// The time since the start of the step.
    pub tau: f64,
    /// The components.
    pub y: &'r [f64],
    /// The inputs.
    pub inputs: &'r [f64],
    /// Components, then inputs; empty if the table has no inputs.
    pub known: &'r [f64],
    /// The aggregates.
    pub aggregates: &'r [f64],
    /// The closed forms; empty if each row that reads one computes it.
    pub formulas: &'r [f64],
}

impl LaneBatches {
    /// Removes all chunks.
    pub fn clear(&mut self) {
        self.chunks.clear();
        self.rows.clear();
        self.columns.clear();
        self.numbers.clear();
        self.places.clear();
        self.others.clear();
    }

    /// Puts rows with the same program together, in chunks of at most [`LANES`].
    pub fn fill(&mut self, table: &EquationTable, rules: &[Rule]) {
        self.clear();
        let mut keys: SmallVec<[ProgramKey; 4]> = SmallVec::new();
        for row in table.rows.iter().filter(|row| row.rates > 0) {
            if keys.last() != Some(&row.key()) && !keys.contains(&row.key()) {
                keys.push(row.key());
            }
        }
        for key in keys {
            let first = self.rows.len();
            for (n, row) in table.rows.iter().enumerate() {
                if row.rates > 0 && row.key() == key {
                    self.rows.push(n as u32);
                }
            }
            for first in (first..self.rows.len()).step_by(LANES) {
                self.chunk(table, rules, first..(first + LANES).min(self.rows.len()));
            }
        }
    }

    /// Adds a chunk of rows that have the same program.
    fn chunk(&mut self, table: &EquationTable, rules: &[Rule], rows: Range<usize>) {
        let all: SmallVec<[&EquationRow; LANES]> =
            self.rows[rows.clone()].iter().map(|row| &table.rows[*row as usize]).collect();
        let (key, sources, switches) = (all[0].key(), all[0].sources, table.switches_of(all[0]).len());
        self.begin_chunk();
        for &variable in key.program(rules).reads() {
            let column = if variable == sources {
                LaneColumn::Time
            } else if variable == sources + 1 {
                LaneColumn::Age(rows.start)
            } else if let Some(switch) = variable.checked_sub(sources + 2) {
                self.numbers(all.iter().map(|row| table.switches_of(row)[switch]))
            } else {
                let read = all.iter().map(|row| table.sources[row.first_source + variable]);
                self.column(table.places.len(), read)
            };
            self.push_column(variable, column);
        }
        self.end_chunk(key, sources + 2 + switches, all.iter().map(|row| row.first_rate as u32));
    }

    /// Begins a chunk: its columns follow, in the order in which its program reads the variables.
    pub fn begin_chunk(&mut self) {
        self.first_column = self.columns.len();
    }

    /// Adds the column of a variable to the chunk that has begun.
    pub fn push_column(&mut self, variable: usize, column: LaneColumn) {
        self.columns.push((variable as u32, column));
    }

    /// Ends a chunk of rows with the same program, given the number of registers that the variables of the rule take, and the
    /// component of the first rate of each row.
    pub fn end_chunk(
        &mut self,
        key: ProgramKey,
        registers: usize,
        rates: impl ExactSizeIterator<Item = u32>,
    ) {
        let (rows, first_place) = (rates.len(), self.places.len());
        self.places.extend(rates);
        let rates = self.run(first_place);
        let (first_column, columns) = (self.first_column, self.columns.len() - self.first_column);
        self.chunks.push(Chunk { key, rows, registers, first_column, columns, rates });
    }

    /// A column of numbers.
    pub fn numbers(&mut self, numbers: impl Iterator<Item = f64>) -> LaneColumn {
        let first = self.numbers.len();
        self.numbers.extend(numbers);
        LaneColumn::Fixed(first)
    }

    /// The last places of the list, from index `from` on; they are removed from it if they are consecutive.
    fn run(&mut self, from: usize) -> LanePlaces {
        let first = self.places[from];
        if self.places[from..].iter().zip(first..).all(|(a, b)| *a == b) {
            self.places.truncate(from);
            return LanePlaces::Run(first as usize);
        }
        LanePlaces::Any(from)
    }

    /// The column of a variable with these sources, in a system of so many components. Most variables are components or
    /// inputs.
    #[inline]
    pub fn column(&mut self, components: usize, sources: impl Iterator<Item = VariableSource>) -> LaneColumn {
        let place = self.places.len();
        let mut inputs = false;
        // All sources, once one of them is neither.
        let mut mixed: SmallVec<[VariableSource; LANES]> = SmallVec::new();
        for source in sources {
            match source {
                VariableSource::State(component) if mixed.is_empty() => self.places.push(component),
                VariableSource::Input(input) if mixed.is_empty() => {
                    inputs = true;
                    self.places.push(components as u32 + input);
                }
                other => {
                    if mixed.is_empty() {
                        mixed.extend(self.places.drain(place..).map(|place| match place {
                            place if (place as usize) < components => VariableSource::State(place),
                            place => VariableSource::Input(place - components as u32),
                        }));
                    }
                    mixed.push(other);
                }
            }
        }
        if !mixed.is_empty() {
            return self.other_column(components, &mixed);
        }
        if inputs { LaneColumn::Known(place) } else { LaneColumn::State(self.run(place)) }
    }

    /// The column of a variable that is neither a component nor an input in some row.
    fn other_column(&mut self, components: usize, sources: &[VariableSource]) -> LaneColumn {
        let LaneBatches { numbers, places, others, .. } = self;
        let all = sources.iter().copied();
        let (number, place, mixed) = (numbers.len(), places.len(), others.len());
        let fixed = |source| match source {
            VariableSource::Fixed(x) => Some(x),
            _ => None,
        };
        let sum = |source| match source {
            VariableSource::Aggregate(sum) => Some(sum),
            _ => None,
        };
        if all.clone().all(|source| fixed(source).is_some()) {
            numbers.extend(all.filter_map(fixed));
            return LaneColumn::Fixed(number);
        }
        if all.clone().all(|source| sum(source).is_some()) {
            places.extend(all.filter_map(sum));
            return LaneColumn::RowAggregate(place);
        }
        for (lane, source) in all.enumerate() {
            places.push(match source {
                VariableSource::State(component) => component,
                VariableSource::Input(input) => components as u32 + input,
                other => {
                    others.push((lane as u32, other));
                    0
                }
            });
        }
        LaneColumn::Mixed(place, mixed, others.len())
    }

    /// Evaluates the rates of all rows, and writes them to their components in `out`.
    pub fn rates(
        &self,
        table: &EquationTable,
        rules: &[Rule],
        point: &EvaluationPoint,
        registers: &mut Vec<Lanes>,
        out: &mut [f64],
    ) {
        dlsys_wide::run(RatesOf { batches: self, table, rules, point, registers, out });
    }

    /// Fills a register with one variable of some rows.
    #[inline(always)]
    fn gather(
        &self,
        table: &EquationTable,
        column: LaneColumn,
        point: &EvaluationPoint,
        register: &mut Lanes,
        rows: usize,
    ) {
        let to = &mut register[..rows];
        let pick = |from: &[f64], first: usize, to: &mut [f64]| {
            let places = &self.places[first..first + to.len()];
            for (lane, place) in to.iter_mut().zip(places) {
                *lane = from[*place as usize];
            }
        };
        let tau = point.tau;
        match column {
            LaneColumn::Time => to.fill(table.start.to_f64() + tau),
            LaneColumn::Age(first) => {
                for (lane, row) in to.iter_mut().zip(&self.rows[first..]) {
                    *lane = table.rows[*row as usize].age + tau;
                }
            }
            LaneColumn::Fixed(first) => copy(&self.numbers[first..], &mut register[..], rows),
            LaneColumn::State(LanePlaces::Run(first)) => copy(&point.y[first..], &mut register[..], rows),
            LaneColumn::State(LanePlaces::Any(first)) => pick(point.y, first, to),
            LaneColumn::Known(first) => pick(point.known, first, to),
            LaneColumn::RowAggregate(first) => pick(point.aggregates, first, to),
            LaneColumn::Mixed(first, from, end) => {
                // There are no known inputs if the table has none.
                pick(if point.known.is_empty() { point.y } else { point.known }, first, to);
                for (lane, source) in &self.others[from..end] {
                    to[*lane as usize] = match *source {
                        VariableSource::Formula(i) if !point.formulas.is_empty() => {
                            point.formulas[i as usize]
                        }
                        source => table.value(source, tau, point.y, point.inputs),
                    };
                }
            }
        }
    }
}

/// Copies the values of so many rows; of all of them with few instructions, because their number is known when this is compiled.
#[inline(always)]
fn copy(from: &[f64], to: &mut [f64], rows: usize) {
    match (rows, from.first_chunk::<LANES>(), to.first_chunk_mut::<LANES>()) {
        (LANES, Some(from), Some(to)) => *to = *from,
        _ => to[..rows].copy_from_slice(&from[..rows]),
    }
}

/// The rates of all rows, with the widest registers of the processor.
struct RatesOf<'r> {
    batches: &'r LaneBatches,
    table: &'r EquationTable,
    rules: &'r [Rule],
    point: &'r EvaluationPoint<'r>,
    registers: &'r mut Vec<Lanes>,
    out: &'r mut [f64],
}

impl Kernel for RatesOf<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let RatesOf { batches, table, rules, point, registers, out } = self;
        for chunk in &batches.chunks {
            let program = chunk.key.program(rules);
            if registers.len() < chunk.registers {
                registers.resize(chunk.registers, Lanes::default());
            }
            let columns = &batches.columns[chunk.first_column..chunk.first_column + chunk.columns];
            for (variable, column) in columns {
                batches.gather(table, *column, point, &mut registers[*variable as usize], chunk.rows);
            }
            for (output, register) in program.eval_rows_inside(registers, chunk.rows).enumerate() {
                let rates = &registers[register][..];
                match chunk.rates {
                    LanePlaces::Run(first) => copy(rates, &mut out[first + output..], chunk.rows),
                    LanePlaces::Any(first) => {
                        for (rate, place) in rates[..chunk.rows].iter().zip(&batches.places[first..]) {
                            out[*place as usize + output] = *rate;
                        }
                    }
                }
            }
        }
    }
}
