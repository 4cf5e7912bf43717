//! The right-hand side of the equations of coupled modules, as the integrators evaluate it.

use crate::flow::coupled::algebra::AlgebraicError;
use crate::flow::coupled::columns::Whole;
use crate::flow::coupled::lanes::EvaluationPoint;
use crate::flow::coupled::newton::{Solver, Workspace};
use crate::flow::coupled::rows::VariableSource;
use crate::flow::coupled::sections;
use crate::flow::coupled::system::System;
use crate::world::coupled_solution::CoupledSolution;
use dlsys_expr::{Lanes, Scratch};
use dlsys_model::Rule;
use dlsys_ode::{Part, Rates};

/// The right-hand side of a [`System`].
pub struct Equations<'s> {
    /// The equations.
    pub system: &'s System,
    /// The rules of the model, by index.
    pub rules: &'s [Rule],
    /// The trajectories of the components that are inputs.
    solution: Option<&'s CoupledSolution>,
    /// Working memory of evaluations.
    pub memory: RateWorkspace,
    /// What the table is made of, if the system has none.
    pub whole: Option<Whole<'s>>,
}

/// Working memory of evaluations.
#[derive(Clone, Debug, Default)]
pub struct RateWorkspace {
    /// Values of the inputs at `read_at`.
    pub inputs: Vec<f64>,
    /// Values of the closed forms at that time, in systems without a table, whose rows read all of them.
    formulas: Vec<f64>,
    /// The time at which the inputs were read, since the start of the step.
    read_at: Option<f64>,
    /// Components, then inputs.
    known: Vec<f64>,
    /// Values of the aggregates.
    pub aggregates: Vec<f64>,
    /// The state with its algebraic components solved for.
    consistent: Vec<f64>,
    variables: Vec<f64>,
    scratch: Scratch<f64>,
    /// Vector registers of the programs.
    pub registers: Vec<Lanes>,
}

impl<'s> Equations<'s> {
    /// The right-hand side of a system whose inputs follow `solution`; inputs are NaN without one.
    pub fn new(
        system: &'s System,
        rules: &'s [Rule],
        solution: Option<&'s CoupledSolution>,
    ) -> Equations<'s> {
        Equations::within(RateWorkspace::default(), system, rules, solution)
    }

    /// The right-hand side, in the workspace of earlier evaluations.
    pub fn within(
        memory: RateWorkspace,
        system: &'s System,
        rules: &'s [Rule],
        solution: Option<&'s CoupledSolution>,
    ) -> Equations<'s> {
        let memory = RateWorkspace { read_at: None, ..memory };
        Equations { system, rules, solution, memory, whole: None }
    }

    /// Reads the inputs at a time since the start of the step.
    pub fn read_inputs(&mut self, tau: f64) {
        // The last stages of a step have the same time.
        if self.memory.read_at != Some(tau) {
            self.system.table.read(self.solution, tau, &mut self.memory.inputs);
            self.memory.formulas.clear();
            if self.system.is_bare {
                self.system.table.read_formulas(tau, &mut self.memory.formulas);
            }
            self.memory.read_at = Some(tau);
        }
    }

    /// Reads the inputs, and writes the state with its algebraic components solved for into `consistent`.
    fn complete(&mut self, tau: f64, y: &[f64]) -> Result<(), AlgebraicError> {
        self.read_inputs(tau);
        if self.system.algebra.is_empty() {
            return Ok(());
        }
        let RateWorkspace { consistent, inputs, .. } = &mut self.memory;
        consistent.clear();
        consistent.extend_from_slice(y);
        self.system.algebra.solve(&self.system.table, self.rules, tau, inputs, consistent)
    }

    /// The algebraic equations at a time for which the inputs have been read.
    pub fn solver<'a>(&'a self, tau: f64, memory: &'a mut Workspace) -> Solver<'a> {
        let System { algebra, table, .. } = self.system;
        algebra.solver(table, self.rules, tau, &self.memory.inputs, memory)
    }

    /// Solves for the algebraic components of a state.
    pub fn make_consistent(&mut self, tau: f64, y: &mut [f64]) -> Result<(), AlgebraicError> {
        self.complete(tau, y)?;
        if !self.system.algebra.is_empty() {
            y.copy_from_slice(&self.memory.consistent);
        }
        Ok(())
    }
}

impl Equations<'_> {
    /// Computes all aggregates. The terms of children of many modules are evaluated together; those of each aggregate
    /// are added up in string order.
    pub fn add_up(&mut self, tau: f64, y: &[f64]) {
        let table = &self.system.table;
        self.memory.aggregates.clear();
        if table.aggregates.is_empty() {
            return;
        }
        self.memory.aggregates.resize(table.aggregates.len(), 0.0);
        let mut begun = vec![false; table.aggregates.len()];
        for (of, lanes) in &self.system.terms {
            self.fold(*of, lanes, tau, y, &mut begun);
        }
    }

    /// Adds the terms of a batch of children. `begun` tells which aggregates have a value already.
    fn fold(
        &mut self,
        (rule, aggregate): (usize, usize),
        lanes: &[(u32, u32)],
        tau: f64,
        y: &[f64],
        begun: &mut [bool],
    ) {
        let table = &self.system.table;
        let rule = &self.rules[rule];
        let aggregate = &rule.aggregates[aggregate];
        let width = aggregate.pattern.width;
        let mut registers = std::mem::take(&mut self.memory.registers);
        registers.resize(registers.len().max(rule.variables + width), Lanes::default());
        for &v in aggregate.term.reads() {
            for (lane, &(number, child)) in registers[v].iter_mut().zip(lanes) {
                let sum = &table.aggregates[number as usize];
                let row = &table.rows[sum.row as usize];
                let source = match v.checked_sub(rule.variables) {
                    Some(of_child) => table.children[sum.first + child as usize * width + of_child],
                    None if v < row.sources => table.sources[row.first_source + v],
                    None => VariableSource::Fixed(table.time(row, v - row.sources, tau)),
                };
                *lane = table.value(source, tau, y, &self.memory.inputs);
            }
        }
        let output = aggregate.term.eval_rows(&mut registers, lanes.len()).next().unwrap_or(0);
        for (lane, &(number, _)) in lanes.iter().enumerate() {
            let number = number as usize;
            let known = std::mem::replace(&mut begun[number], true).then_some(self.memory.aggregates[number]);
            self.memory.aggregates[number] = aggregate.fold.add(known, registers[output][lane]);
        }
        self.memory.registers = registers;
    }

    /// The largest effect of one component on the rate of another at the start of a step.
    pub fn strength(&mut self, y: &[f64]) -> f64 {
        let mut values = Vec::new();
        self.partials(0.0, y, &mut values);
        let others = self.couplings().into_iter().zip(values).filter(|((row, column), _)| row != column);
        others.fold(0.0, |most, (_, value)| value.abs().max(most))
    }

    /// The algebraic equations that become singular at the start of a step, if there are any: the reason why it fails.
    pub fn hindrance(&mut self, y: &[f64]) -> Option<AlgebraicError> {
        self.read_inputs(0.0);
        let fading = self.system.algebra.fading(&self.system.table, self.rules, &self.memory.inputs, y);
        fading.or_else(|| self.met(y).map(AlgebraicError::Meeting))
    }

    /// The error of the algebraic components at the end of a step that follows from those of the integrated ones, in
    /// units of the tolerance.
    pub fn sensitivity(&mut self, tau: f64, end: &[f64], errors: &[f64], tolerance: f64) -> f64 {
        let there: Result<Vec<f64>, AlgebraicError> = (|| {
            let mut there = end.to_vec();
            self.make_consistent(tau, &mut there)?;
            Ok(there)
        })();
        let mut aside: Vec<f64> = end.iter().zip(errors).map(|(y, e)| y - e).collect();
        let moved = self.make_consistent(tau, &mut aside);
        let (Ok(there), Ok(())) = (there, moved) else { return f64::INFINITY };
        let error = |c: usize| (there[c] - aside[c]).abs() / (tolerance * there[c].abs().max(1.0));
        let unknowns = self.system.algebra.unknowns.iter();
        unknowns.map(|unknown| error(unknown.component as usize)).fold(0.0, f64::max)
    }
}

impl Rates for Equations<'_> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        let system = self.system;
        if !system.sections.is_empty() {
            return sections::rates(system, self.rules, tau, y, out);
        }
        let solved = self.complete(tau, y);
        let consistent = std::mem::take(&mut self.memory.consistent);
        let y = if system.algebra.is_empty() { y } else { &consistent };
        self.add_up(tau, y);
        let RateWorkspace { inputs, known, aggregates, formulas, registers, .. } = &mut self.memory;
        known.clear();
        if !inputs.is_empty() {
            known.extend_from_slice(y);
            known.extend_from_slice(inputs);
        }
        let point = EvaluationPoint { tau, y, inputs, known, aggregates, formulas };
        system.lanes.rates(&system.table, self.rules, &point, registers, out);
        for unknown in &system.algebra.unknowns {
            out[unknown.component as usize] = 0.0;
        }
        if let Err(error) = solved {
            out[error.component()] = f64::NAN;
        }
        self.memory.consistent = consistent;
    }

    fn is_linear(&self) -> bool {
        self.system.is_linear
    }

    fn is_steady(&self) -> bool {
        self.system.is_steady()
    }

    fn is_timed(&self) -> bool {
        self.system.table.timed
    }

    fn reads_clock(&self) -> bool {
        self.system.table.timed || self.system.table.aged
    }

    fn is_algebraic(&self) -> bool {
        !self.system.algebra.is_empty()
    }

    fn algebraic_error(&mut self, tau: f64, end: &[f64], errors: &[f64], tolerance: f64) -> f64 {
        self.sensitivity(tau, end, errors, tolerance)
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        if let Some(whole) = self.whole {
            return whole.ask(self.rules, self.solution, |equations| equations.couplings());
        }
        let mut all = Vec::new();
        for row in &self.system.table.rows {
            self.system.row_partials(self.rules, row, |rate, partial| all.push((rate, partial.component)));
        }
        all
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        if let Some(whole) = self.whole {
            return whole.ask(self.rules, self.solution, |equations| equations.partials(tau, y, out));
        }
        let mut variables = std::mem::take(&mut self.memory.variables);
        let mut scratch = std::mem::take(&mut self.memory.scratch);
        let mut values = Vec::new();
        out.clear();
        // Where the algebraic components have no solution, the rates are not finite, which ends the step.
        let _ = self.complete(tau, y);
        let consistent = std::mem::take(&mut self.memory.consistent);
        let y = if self.system.algebra.is_empty() { y } else { &consistent };
        for row in &self.system.table.rows {
            let jacobian = &self.rules[row.rule].solves[row.solve].jacobian;
            if let Some(values) =
                jacobian.values.constants().filter(|_| self.system.table.aggregates.is_empty())
            {
                self.system.row_partials(self.rules, row, |_, partial| out.push(partial.value(values, &[])));
                continue;
            }
            self.system.table.variables(self.rules, row, tau, y, &self.memory.inputs, &mut variables);
            values.resize(jacobian.values.outputs(), 0.0);
            jacobian.values.eval(&variables, &mut scratch, &mut values);
            let slopes =
                self.system.table.slopes(self.rules, row, &mut variables, tau, y, &self.memory.inputs);
            self.system.row_partials(self.rules, row, |_, partial| out.push(partial.value(&values, &slopes)));
        }
        self.memory.consistent = consistent;
        self.memory.variables = variables;
        self.memory.scratch = scratch;
    }

    fn modules(&self) -> u64 {
        self.system.modules
    }

    fn parts(&mut self) -> Vec<Box<dyn Part + '_>> {
        sections::parts(self.system, self.rules)
    }
}
