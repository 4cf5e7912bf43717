//! The right-hand side of the equations of coupled modules, as the integrators ask for it.

use super::algebra::Fault;
use super::course::Course;
use super::runge_kutta::Rates;
use super::system::{Chunk, Column, Row, System};
use crate::expr::{LANES, Lanes, Program, Scratch};
use crate::model::Rule;

/// The code of a row's rates.
pub fn program<'s>(rules: &'s [Rule], row: &Row) -> &'s Program {
    let solve = &rules[row.rule].solves[row.solve];
    if row.forced { &solve.rates } else { &solve.numeric_rates }
}

/// The right-hand side of a [`System`].
pub struct Equations<'s> {
    pub(super) system: &'s System,
    pub(super) rules: &'s [Rule],
    /// How the components move that are inputs.
    course: Option<&'s Course>,
    pub(super) inputs: Vec<f64>,
    /// Values of the aggregates.
    pub(super) sums: Vec<f64>,
    /// The state with its algebraic components solved for.
    pub(super) settled: Vec<f64>,
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    pub(super) registers: Vec<Lanes>,
}

impl<'s> Equations<'s> {
    pub fn new(system: &'s System, rules: &'s [Rule], course: Option<&'s Course>) -> Equations<'s> {
        let (inputs, sums, settled, variables, scratch, registers) = Default::default();
        Equations { system, rules, course, inputs, sums, settled, variables, scratch, registers }
    }

    /// Reads the inputs.
    pub fn read_inputs(&mut self, tau: f64) {
        self.system.read(self.course, tau, &mut self.inputs);
    }

    /// Puts the state into `settled`, with its algebraic components solved for; and reads the inputs.
    fn settle(&mut self, tau: f64, y: &[f64]) -> Result<(), Fault> {
        self.read_inputs(tau);
        if self.system.algebra.is_empty() {
            return Ok(());
        }
        self.settled.clear();
        self.settled.extend_from_slice(y);
        self.system.algebra.solve(self.system, self.rules, tau, &self.inputs, &mut self.settled)
    }

    /// Solves for the algebraic components of a state.
    pub fn make_consistent(&mut self, tau: f64, y: &mut [f64]) -> Result<(), Fault> {
        self.settle(tau, y)?;
        if !self.system.algebra.is_empty() {
            y.copy_from_slice(&self.settled);
        }
        Ok(())
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
                Column::Sum(numbers) => {
                    for (lane, number) in register.iter_mut().zip(numbers) {
                        *lane = self.sums[*number as usize];
                    }
                }
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
        let solved = self.settle(tau, y);
        let settled = std::mem::take(&mut self.settled);
        let y = if system.algebra.is_empty() { y } else { &settled };
        self.add_up(tau, y);
        for chunk in &system.chunks {
            self.lanes(chunk, tau, y, out);
        }
        for unknown in &system.algebra.unknowns {
            out[unknown.component as usize] = 0.0;
        }
        if let Err(fault) = solved {
            out[fault.component()] = f64::NAN;
        }
        self.settled = settled;
    }

    fn is_algebraic(&self) -> bool {
        !self.system.algebra.is_empty()
    }

    fn algebraic_error(&mut self, tau: f64, end: &[f64], errors: &[f64], tolerance: f64) -> f64 {
        self.sensitivity(tau, end, errors, tolerance)
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        let mut all = Vec::new();
        for row in &self.system.rows {
            self.system.row_partials(self.rules, row, |rate, partial| all.push((rate, partial.component)));
        }
        all
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        let mut variables = std::mem::take(&mut self.variables);
        let mut scratch = std::mem::take(&mut self.scratch);
        let mut values = Vec::new();
        out.clear();
        // Rates that are not finite say so when they are asked for.
        let _ = self.settle(tau, y);
        let settled = std::mem::take(&mut self.settled);
        let y = if self.system.algebra.is_empty() { y } else { &settled };
        for row in &self.system.rows {
            let jacobian = &self.rules[row.rule].solves[row.solve].jacobian;
            self.system.variables(self.rules, row, tau, y, &self.inputs, &mut variables);
            values.resize(jacobian.values.outputs(), 0.0);
            jacobian.values.eval(&variables, &mut scratch, &mut values);
            let slopes = self.system.slopes(self.rules, row, &mut variables, tau, y, &self.inputs);
            self.system.row_partials(self.rules, row, |_, partial| out.push(partial.value(&values, &slopes)));
        }
        self.settled = settled;
        self.variables = variables;
        self.scratch = scratch;
    }

    fn modules(&self) -> u64 {
        self.system.rows.len() as u64
    }
}
