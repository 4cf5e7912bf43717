//! Rates of many modules at once: rows with the same program, evaluated side by side in the lanes of vector registers.
//!
//! For each variable that the program reads, a [`LaneColumn`] holds the sources of that variable in all rows of a chunk.

use crate::flow::coupled::rows::{EquationRow, EquationTable, VariableSource, program};
use dlsys_expr::{LANES, Lanes};
use dlsys_model::Rule;
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
}

/// Rows that are evaluated at once: at most [`LANES`], with the same program.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    first_row: usize,
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
enum LaneColumn {
    Time,
    Age,
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
enum LanePlaces {
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
}

impl LaneBatches {
    /// Puts rows with the same program together, in chunks of at most [`LANES`].
    pub fn fill(&mut self, table: &EquationTable, rules: &[Rule]) {
        self.chunks.clear();
        self.rows.clear();
        self.columns.clear();
        self.numbers.clear();
        self.places.clear();
        self.others.clear();
        let key = |row: &EquationRow| (row.rule, row.solve, row.numeric_only);
        let mut keys: SmallVec<[_; 4]> = SmallVec::new();
        for row in table.rows.iter().filter(|row| row.rates > 0) {
            if keys.last() != Some(&key(row)) && !keys.contains(&key(row)) {
                keys.push(key(row));
            }
        }
        for of in keys {
            let first = self.rows.len();
            for (n, row) in table.rows.iter().enumerate() {
                if row.rates > 0 && key(row) == of {
                    self.rows.push(n as u32);
                }
            }
            for first in (first..self.rows.len()).step_by(LANES) {
                self.chunk(table, rules, first, LANES.min(self.rows.len() - first));
            }
        }
    }

    /// Adds a chunk of rows that have the same program.
    fn chunk(&mut self, table: &EquationTable, rules: &[Rule], first_row: usize, rows: usize) {
        let row = &table.rows[self.rows[first_row] as usize];
        let first_column = self.columns.len();
        for &variable in program(rules, row).reads() {
            let column = self.column(table, first_row..first_row + rows, variable);
            self.columns.push((variable as u32, column));
        }
        let first_place = self.places.len();
        let all = &self.rows[first_row..first_row + rows];
        self.places.extend(all.iter().map(|row| table.rows[*row as usize].first_rate as u32));
        let rates = self.run(first_place);
        let (registers, columns) =
            (row.sources + 2 + table.switches_of(row).len(), self.columns.len() - first_column);
        self.chunks.push(Chunk { first_row, rows, registers, first_column, columns, rates });
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

    /// The sources of one variable of some rows with the same program.
    fn column(&mut self, table: &EquationTable, range: Range<usize>, variable: usize) -> LaneColumn {
        let rows = self.rows[range.clone()].iter().map(|row| &table.rows[*row as usize]);
        let sources = rows.clone().next().map_or(0, |row| row.sources);
        if variable == sources {
            return LaneColumn::Time;
        }
        if variable == sources + 1 {
            return LaneColumn::Age;
        }
        let (number, place) = (self.numbers.len(), self.places.len());
        if variable > sources {
            self.numbers.extend(rows.map(|row| table.switches_of(row)[variable - sources - 2]));
            return LaneColumn::Fixed(number);
        }
        let all = rows.map(|row| table.sources[row.first_source + variable]);
        // Most variables are components or inputs.
        let components = table.places.len() as u32;
        let mut inputs = false;
        for source in all.clone() {
            match source {
                VariableSource::State(component) => self.places.push(component),
                VariableSource::Input(input) => {
                    inputs = true;
                    self.places.push(components + input);
                }
                _ => {
                    self.places.truncate(place);
                    return self.other_column(table, range, variable);
                }
            }
        }
        if inputs { LaneColumn::Known(place) } else { LaneColumn::State(self.run(place)) }
    }

    /// The sources of a variable that is neither a component nor an input in some row.
    fn other_column(&mut self, table: &EquationTable, range: Range<usize>, variable: usize) -> LaneColumn {
        let LaneBatches { rows, numbers, places, others, .. } = self;
        let all = rows[range].iter().map(|row| &table.rows[*row as usize]);
        let all = all.map(|row| table.sources[row.first_source + variable]);
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
        let components = table.places.len() as u32;
        for (lane, source) in all.enumerate() {
            places.push(match source {
                VariableSource::State(component) => component,
                VariableSource::Input(input) => components + input,
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
        for chunk in &self.chunks {
            let rows = &self.rows[chunk.first_row..chunk.first_row + chunk.rows];
            let program = program(rules, &table.rows[rows[0] as usize]);
            if registers.len() < chunk.registers {
                registers.resize(chunk.registers, [0.0; LANES]);
            }
            for (variable, column) in &self.columns[chunk.first_column..chunk.first_column + chunk.columns] {
                let register = &mut registers[*variable as usize][..rows.len()];
                self.gather(table, *column, rows, point, register);
            }
            for (output, register) in program.eval_rows(registers, rows.len()).enumerate() {
                let rates = &registers[register][..rows.len()];
                match chunk.rates {
                    LanePlaces::Run(first) => out[first + output..][..rows.len()].copy_from_slice(rates),
                    LanePlaces::Any(first) => {
                        for (rate, place) in rates.iter().zip(&self.places[first..]) {
                            out[*place as usize + output] = *rate;
                        }
                    }
                }
            }
        }
    }

    /// Fills a register with one variable of some rows.
    fn gather(
        &self,
        table: &EquationTable,
        column: LaneColumn,
        rows: &[u32],
        point: &EvaluationPoint,
        to: &mut [f64],
    ) {
        let pick = |from: &[f64], first: usize, to: &mut [f64]| {
            for (lane, place) in to.iter_mut().zip(&self.places[first..]) {
                *lane = from[*place as usize];
            }
        };
        let tau = point.tau;
        match column {
            LaneColumn::Time => to.fill(table.start.to_f64() + tau),
            LaneColumn::Age => {
                for (lane, row) in to.iter_mut().zip(rows) {
                    *lane = table.rows[*row as usize].age + tau;
                }
            }
            LaneColumn::Fixed(first) => to.copy_from_slice(&self.numbers[first..first + rows.len()]),
            LaneColumn::State(LanePlaces::Run(first)) => {
                to.copy_from_slice(&point.y[first..first + rows.len()])
            }
            LaneColumn::State(LanePlaces::Any(first)) => pick(point.y, first, to),
            LaneColumn::Known(first) => pick(point.known, first, to),
            LaneColumn::RowAggregate(first) => pick(point.aggregates, first, to),
            LaneColumn::Mixed(first, from, end) => {
                // There are no known inputs if the table has none.
                pick(if point.known.is_empty() { point.y } else { point.known }, first, to);
                for (lane, source) in &self.others[from..end] {
                    to[*lane as usize] = table.value(*source, tau, point.y, point.inputs);
                }
            }
        }
    }
}
