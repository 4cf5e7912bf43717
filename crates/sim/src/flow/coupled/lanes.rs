//! Rows of a system that have the same program, evaluated side by side: of each variable that the program reads, where
//! those of all rows come from.

use crate::flow::coupled::equations::program;
use crate::flow::coupled::system::{Row, Source, System};
use dlsys_expr::{LANES, Lanes};
use dlsys_model::Rule;
use smallvec::SmallVec;
use std::ops::Range;

/// All rows with rates, in chunks. NextKind chunks and columns consist of stands in a few long lists, so that the equations
/// of another region are written into the memory of the last.
#[derive(Clone, Debug, Default)]
pub struct LaneBatches {
    chunks: Vec<Chunk>,
    rows: Vec<u32>,
    columns: Vec<(u32, Column)>,
    numbers: Vec<f64>,
    places: Vec<u32>,
    sources: Vec<Source>,
}

/// Rows that are evaluated at once: at most [`LANES`], with the same program.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    first_row: usize,
    rows: usize,
    /// Registers of the rule's variables.
    registers: usize,
    /// NextKind the program reads, and from where.
    first_column: usize,
    columns: usize,
    /// Places of the first rate of each row.
    rates: Places,
}

/// One variable of all rows of a chunk. Numbers say where its part of a list begins.
#[derive(Clone, Copy, Debug)]
enum Column {
    Time,
    Age,
    Fixed(usize),
    State(Places),
    /// Components, or inputs, whose numbers come after those of the components.
    Known(usize),
    /// Aggregates, by their numbers.
    Sum(usize),
    Mixed(usize),
}

/// Places in a vector; mostly one after another, because rows stand in string order.
#[derive(Clone, Copy, Debug)]
enum Places {
    Run(usize),
    Any(usize),
}

/// NextKind the rows of a system read at one time.
pub struct Readings<'r> {
    pub tau: f64,
    pub y: &'r [f64],
    pub inputs: &'r [f64],
    /// Components, then inputs; empty if there are no inputs.
    pub known: &'r [f64],
    pub sums: &'r [f64],
}

impl LaneBatches {
    /// Puts rows with the same program together, a chunk of them for each evaluation.
    pub fn fill(&mut self, system: &System, rules: &[Rule]) {
        self.chunks.clear();
        self.rows.clear();
        self.columns.clear();
        self.numbers.clear();
        self.places.clear();
        self.sources.clear();
        let key = |row: &Row| (row.rule, row.solve, row.numeric_only);
        let mut keys: SmallVec<[_; 4]> = SmallVec::new();
        for row in system.rows.iter().filter(|row| row.rates > 0) {
            if keys.last() != Some(&key(row)) && !keys.contains(&key(row)) {
                keys.push(key(row));
            }
        }
        for of in keys {
            let first = self.rows.len();
            for (n, row) in system.rows.iter().enumerate() {
                if row.rates > 0 && key(row) == of {
                    self.rows.push(n as u32);
                }
            }
            for first in (first..self.rows.len()).step_by(LANES) {
                self.chunk(system, rules, first, LANES.min(self.rows.len() - first));
            }
        }
    }

    fn chunk(&mut self, system: &System, rules: &[Rule], first_row: usize, rows: usize) {
        let row = &system.rows[self.rows[first_row] as usize];
        let first_column = self.columns.len();
        for &variable in program(rules, row).reads() {
            let column = self.column(system, first_row..first_row + rows, variable);
            self.columns.push((variable as u32, column));
        }
        let first_place = self.places.len();
        let all = &self.rows[first_row..first_row + rows];
        self.places.extend(all.iter().map(|row| system.rows[*row as usize].first_rate as u32));
        let rates = self.run(first_place);
        let (registers, columns) =
            (row.sources + 2 + system.switches_of(row).len(), self.columns.len() - first_column);
        self.chunks.push(Chunk { first_row, rows, registers, first_column, columns, rates });
    }

    /// The last places of the list, from one on; taken out again if they are one after another.
    fn run(&mut self, from: usize) -> Places {
        let first = self.places[from];
        if self.places[from..].iter().zip(first..).all(|(a, b)| *a == b) {
            self.places.truncate(from);
            return Places::Run(first as usize);
        }
        Places::Any(from)
    }

    /// Where one variable of some rows with the same program comes from.
    fn column(&mut self, system: &System, range: Range<usize>, variable: usize) -> Column {
        let rows = self.rows[range.clone()].iter().map(|row| &system.rows[*row as usize]);
        let sources = rows.clone().next().map_or(0, |row| row.sources);
        if variable == sources {
            return Column::Time;
        }
        if variable == sources + 1 {
            return Column::Age;
        }
        let (number, place) = (self.numbers.len(), self.places.len());
        if variable > sources {
            self.numbers.extend(rows.map(|row| system.switches_of(row)[variable - sources - 2]));
            return Column::Fixed(number);
        }
        let all = rows.map(|row| system.sources[row.first_source + variable]);
        // Mostly components and inputs.
        let components = system.places.len() as u32;
        let mut inputs = false;
        for source in all.clone() {
            match source {
                Source::State(component) => self.places.push(component),
                Source::Input(input) => {
                    inputs = true;
                    self.places.push(components + input);
                }
                _ => {
                    self.places.truncate(place);
                    return self.other_column(system, range, variable);
                }
            }
        }
        if inputs { Column::Known(place) } else { Column::State(self.run(place)) }
    }

    /// A variable that is no component in some rows.
    fn other_column(&mut self, system: &System, range: Range<usize>, variable: usize) -> Column {
        let LaneBatches { rows, numbers, places, sources, .. } = self;
        let all = rows[range].iter().map(|row| &system.rows[*row as usize]);
        let all = all.map(|row| system.sources[row.first_source + variable]);
        let (number, place, mixed) = (numbers.len(), places.len(), sources.len());
        let fixed = |source| match source {
            Source::Fixed(x) => Some(x),
            _ => None,
        };
        let sum = |source| match source {
            Source::Sum(sum) => Some(sum),
            _ => None,
        };
        if all.clone().all(|source| fixed(source).is_some()) {
            numbers.extend(all.filter_map(fixed));
            return Column::Fixed(number);
        }
        if all.clone().all(|source| sum(source).is_some()) {
            places.extend(all.filter_map(sum));
            return Column::Sum(place);
        }
        sources.extend(all);
        Column::Mixed(mixed)
    }

    /// Evaluates the rates of all rows.
    pub fn rates(
        &self,
        system: &System,
        rules: &[Rule],
        readings: &Readings,
        registers: &mut Vec<Lanes>,
        out: &mut [f64],
    ) {
        for chunk in &self.chunks {
            let rows = &self.rows[chunk.first_row..chunk.first_row + chunk.rows];
            let program = program(rules, &system.rows[rows[0] as usize]);
            if registers.len() < chunk.registers {
                registers.resize(chunk.registers, [0.0; LANES]);
            }
            for (variable, column) in &self.columns[chunk.first_column..chunk.first_column + chunk.columns] {
                let register = &mut registers[*variable as usize][..rows.len()];
                self.gather(system, *column, rows, readings, register);
            }
            for (output, register) in program.eval_rows(registers, rows.len()).enumerate() {
                let rates = &registers[register][..rows.len()];
                match chunk.rates {
                    Places::Run(first) => out[first + output..][..rows.len()].copy_from_slice(rates),
                    Places::Any(first) => {
                        for (rate, place) in rates.iter().zip(&self.places[first..]) {
                            out[*place as usize + output] = *rate;
                        }
                    }
                }
            }
        }
    }

    /// One variable of some rows.
    fn gather(&self, system: &System, column: Column, rows: &[u32], readings: &Readings, to: &mut [f64]) {
        let pick = |from: &[f64], first: usize, to: &mut [f64]| {
            for (lane, place) in to.iter_mut().zip(&self.places[first..]) {
                *lane = from[*place as usize];
            }
        };
        let tau = readings.tau;
        match column {
            Column::Time => to.fill(system.start.to_f64() + tau),
            Column::Age => {
                for (lane, row) in to.iter_mut().zip(rows) {
                    *lane = system.rows[*row as usize].age + tau;
                }
            }
            Column::Fixed(first) => to.copy_from_slice(&self.numbers[first..first + rows.len()]),
            Column::State(Places::Run(first)) => to.copy_from_slice(&readings.y[first..first + rows.len()]),
            Column::State(Places::Any(first)) => pick(readings.y, first, to),
            Column::Known(first) => pick(readings.known, first, to),
            Column::Sum(first) => pick(readings.sums, first, to),
            Column::Mixed(first) => {
                for (lane, source) in to.iter_mut().zip(&self.sources[first..]) {
                    *lane = system.value(*source, tau, readings.y, readings.inputs);
                }
            }
        }
    }
}
