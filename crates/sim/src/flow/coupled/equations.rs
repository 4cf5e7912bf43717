//! The right-hand side of the equations of coupled modules, as the integrators ask for it.

use crate::flow::coupled::algebra::Fault;
use crate::flow::coupled::lanes::Readings;
use crate::flow::coupled::system::{Row, System};
use crate::world::coupled_solution::CoupledSolution;
use dlsys_expr::{Lanes, Program, Scratch};
use dlsys_model::Rule;
use dlsys_ode::Rates;

/// The code of a row's rates.
pub fn program<'s>(rules: &'s [Rule], row: &Row) -> &'s Program {
    let solve = &rules[row.rule].solves[row.solve];
    if row.numeric_only { &solve.rates } else { &solve.numeric_rates }
}

/// The right-hand side of a [`System`].
pub struct Equations<'s> {
    pub system: &'s System,
    pub rules: &'s [Rule],
    /// How the components move that are inputs.
    solution: Option<&'s CoupledSolution>,
    pub memory: Memory,
}

/// Working memory of evaluations.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    pub inputs: Vec<f64>,
    /// The time that the inputs are of.
    read_at: Option<f64>,
    /// Components, then inputs.
    known: Vec<f64>,
    /// Values of the aggregates.
    pub sums: Vec<f64>,
    /// The state with its algebraic components solved for.
    settled: Vec<f64>,
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    pub registers: Vec<Lanes>,
}

impl<'s> Equations<'s> {
    pub fn new(
        system: &'s System,
        rules: &'s [Rule],
        solution: Option<&'s CoupledSolution>,
    ) -> Equations<'s> {
        Equations::within(Memory::default(), system, rules, solution)
    }

    /// The same, in the memory of other evaluations.
    pub fn within(
        memory: Memory,
        system: &'s System,
        rules: &'s [Rule],
        solution: Option<&'s CoupledSolution>,
    ) -> Equations<'s> {
        Equations { system, rules, solution, memory: Memory { read_at: None, ..memory } }
    }

    /// Reads the inputs.
    pub fn read_inputs(&mut self, tau: f64) {
        // The last stages of a step are of one time.
        if self.memory.read_at != Some(tau) {
            self.system.read(self.solution, tau, &mut self.memory.inputs);
            self.memory.read_at = Some(tau);
        }
    }

    /// Puts the state into `settled`, with its algebraic components solved for; and reads the inputs.
    fn settle(&mut self, tau: f64, y: &[f64]) -> Result<(), Fault> {
        self.read_inputs(tau);
        if self.system.algebra.is_empty() {
            return Ok(());
        }
        let Memory { settled, inputs, .. } = &mut self.memory;
        settled.clear();
        settled.extend_from_slice(y);
        self.system.algebra.solve(self.system, self.rules, tau, inputs, settled)
    }

    /// Solves for the algebraic components of a state.
    pub fn make_consistent(&mut self, tau: f64, y: &mut [f64]) -> Result<(), Fault> {
        self.settle(tau, y)?;
        if !self.system.algebra.is_empty() {
            y.copy_from_slice(&self.memory.settled);
        }
        Ok(())
    }
}

impl Rates for Equations<'_> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        let solved = self.settle(tau, y);
        let settled = std::mem::take(&mut self.memory.settled);
        let y = if system.algebra.is_empty() { y } else { &settled };
        self.add_up(tau, y);
        let Memory { inputs, known, sums, registers, .. } = &mut self.memory;
        known.clear();
        if !inputs.is_empty() {
            known.extend_from_slice(y);
            known.extend_from_slice(inputs);
        }
        let readings = Readings { tau, y, inputs, known, sums };
        system.columns.rates(system, self.rules, &readings, registers, out);
        for unknown in &system.algebra.unknowns {
            out[unknown.component as usize] = 0.0;
        }
        if let Err(fault) = solved {
            out[fault.component()] = f64::NAN;
        }
        self.memory.settled = settled;
    }

    fn is_timed(&self) -> bool {
        self.system.timed
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
        let mut variables = std::mem::take(&mut self.memory.variables);
        let mut scratch = std::mem::take(&mut self.memory.scratch);
        let mut values = Vec::new();
        out.clear();
        // Rates that are not finite say so when they are asked for.
        let _ = self.settle(tau, y);
        let settled = std::mem::take(&mut self.memory.settled);
        let y = if self.system.algebra.is_empty() { y } else { &settled };
        for row in &self.system.rows {
            let jacobian = &self.rules[row.rule].solves[row.solve].jacobian;
            self.system.variables(self.rules, row, tau, y, &self.memory.inputs, &mut variables);
            values.resize(jacobian.values.outputs(), 0.0);
            jacobian.values.eval(&variables, &mut scratch, &mut values);
            let slopes = self.system.slopes(self.rules, row, &mut variables, tau, y, &self.memory.inputs);
            self.system.row_partials(self.rules, row, |_, partial| out.push(partial.value(&values, &slopes)));
        }
        self.memory.settled = settled;
        self.memory.variables = variables;
        self.memory.scratch = scratch;
    }

    fn modules(&self) -> u64 {
        self.system.rows.len() as u64
    }
}
