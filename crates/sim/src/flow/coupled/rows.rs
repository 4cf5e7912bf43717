//! The equations of some modules as a table: one row for each module, with the sources of the variables that it reads.
//!
//! The table is data: the order in which algebraic components are solved for (`algebra`) and the batches in which rates
//! are evaluated (`lanes`) are derived from it, and [`System`](super::system::System) holds all three.

use crate::flow::coupled::lanes::ProgramKey;
use crate::trajectory::Trajectory;
use crate::world::coupled_solution::CoupledSolution;
use dlsys_model::Rule;
use dlsys_tree::{ModuleId, SimTime, Tree};

/// The origin of the value of a rule's variable.
#[derive(Clone, Copy, Debug)]
pub enum VariableSource {
    /// A value that does not change before the next event.
    Fixed(f64),
    /// A component of the state vector.
    State(u32),
    /// A closed form, by its number in [`EquationTable::formulas`].
    Formula(u32),
    /// A component of the coupled solution that is not integrated here, by its number among the inputs of the table.
    Input(u32),
    /// An aggregate, by its number in [`EquationTable::aggregates`].
    Aggregate(u32),
}

/// The equations of some modules.
#[derive(Clone, Debug, Default)]
pub struct EquationTable {
    /// The rows, in the order of the members.
    pub rows: Vec<EquationRow>,
    /// The sources of the variables of all rows, row after row; without `t`, `age` and switches.
    pub sources: Vec<VariableSource>,
    /// The parameters with closed forms that rows read.
    pub formulas: Vec<FormulaInput>,
    /// The aggregates of all rows.
    pub aggregates: Vec<RowAggregate>,
    /// The sources of the parameters of the children of all aggregates.
    pub children: Vec<VariableSource>,
    /// For each algebraic component of each row: its place among the algebraic parameters of the clause.
    pub(super) given: Vec<u32>,
    /// Components of the coupled solution that are read as inputs.
    pub(super) inputs: Vec<u32>,
    /// The switches of all rows: 1 for on, 0 for off.
    pub(super) switches: Vec<f64>,
    /// Where each component belongs.
    pub places: Vec<ComponentPlace>,
    /// The start of the step, from which time is counted.
    pub start: SimTime,
    /// Some rates depend on `t`, or on `age`.
    pub timed: bool,
    pub aged: bool,
    /// Rows have the sources of all variables, not only of those that their equations read.
    pub is_complete: bool,
}

/// Where a component belongs.
#[derive(Clone, Copy, Debug)]
pub struct ComponentPlace {
    /// The place in the values of the tree.
    pub place: u32,
    /// The slot of the module: its generation, and which of its parameters this is, the tree tells.
    slot: u32,
}

impl ComponentPlace {
    /// Of a parameter of a living module whose parameters begin at a place in the values of the tree.
    pub fn new(first: usize, module: ModuleId, parameter: usize) -> ComponentPlace {
        ComponentPlace { place: (first + parameter) as u32, slot: module.slot() as u32 }
    }

    /// The module, as long as it lives, and its parameter.
    pub fn owner(self, tree: &Tree) -> (ModuleId, usize) {
        let module = tree.id(self.slot);
        (module, self.place as usize - tree.places(module).start)
    }
}

/// A parameter with a closed form that rows read.
#[derive(Clone, Debug)]
pub struct FormulaInput {
    /// The place of the parameter in the values of the tree.
    pub(super) place: u32,
    /// The closed form.
    pub trajectory: Trajectory,
    /// The value at the start of the trajectory.
    pub x: f64,
    pub(super) since: SimTime,
    /// The time from the start of the trajectory to the start of the step.
    pub offset: f64,
}

/// The equations of one module.
#[derive(Clone, Copy, Debug)]
pub struct EquationRow {
    /// Index of the module's rule.
    pub rule: usize,
    /// Index of the active `solve` clause in the rule.
    pub solve: usize,
    /// All equations are integrated, those with closed forms too.
    pub numeric_only: bool,
    /// The first source of a variable, in [`EquationTable::sources`].
    pub first_source: usize,
    /// The number of variables with sources: all but `t`, `age` and switches.
    pub sources: usize,
    pub(super) first_switch: usize,
    pub(super) switches: usize,
    /// The first component of the module. Integrated components come first, then those that are solved for.
    pub first_rate: usize,
    /// The number of integrated components.
    pub rates: usize,
    /// The number of components that are solved for.
    pub algebraic: usize,
    pub(super) first_given: usize,
    pub(super) birth: SimTime,
    /// The age of the module at the start of the step.
    pub age: f64,
}

/// An aggregate of a row.
#[derive(Clone, Copy, Debug)]
pub struct RowAggregate {
    /// Index of the row.
    pub row: u32,
    /// Number among the aggregates of the rule.
    pub aggregate: usize,
    /// The start of the children's parameters in [`EquationTable::children`], one child after another.
    pub first: usize,
    /// The number of children.
    pub count: usize,
}

impl EquationRow {
    /// What tells the program of the rates.
    pub fn key(&self) -> ProgramKey {
        ProgramKey { rule: self.rule, solve: self.solve, numeric_only: self.numeric_only }
    }
}

impl EquationTable {
    /// A table without rows.
    pub fn at(start: SimTime) -> EquationTable {
        EquationTable { start, ..EquationTable::default() }
    }

    /// Removes all rows.
    pub(super) fn clear(&mut self, start: SimTime) {
        self.start = start;
        (self.timed, self.aged) = (false, false);
        self.rows.clear();
        self.sources.clear();
        self.formulas.clear();
        self.inputs.clear();
        self.switches.clear();
        self.places.clear();
        self.aggregates.clear();
        self.children.clear();
        self.given.clear();
    }

    /// Adds a row with the algebraic parameters of a module only: with the first component and the places of the
    /// parameters in the clause. The sources of the row and of its children have been added.
    pub fn push_algebraic(
        &mut self,
        (rule, solve): (usize, usize),
        (first_source, sources): (usize, usize),
        switches: impl Iterator<Item = f64>,
        (first_rate, given): (usize, &[u32]),
        birth: SimTime,
    ) {
        let first_switch = self.switches.len();
        self.switches.extend(switches);
        self.rows.push(EquationRow {
            rule,
            solve,
            numeric_only: false,
            first_source,
            sources,
            first_switch,
            switches: self.switches.len() - first_switch,
            first_rate,
            rates: 0,
            algebraic: given.len(),
            first_given: self.given.len(),
            birth,
            age: self.start.since(birth),
        });
        self.given.extend_from_slice(given);
    }

    /// The place of each algebraic component of a row among the algebraic parameters of its clause.
    pub fn given(&self, row: &EquationRow) -> &[u32] {
        &self.given[row.first_given..row.first_given + row.algebraic]
    }

    /// The switches of a row.
    pub fn switches_of(&self, row: &EquationRow) -> &[f64] {
        &self.switches[row.first_switch..row.first_switch + row.switches]
    }

    /// The values of the inputs at a time after the start, from the coupled solution; NaN where they are unknown.
    pub fn read(&self, solution: Option<&CoupledSolution>, tau: f64, out: &mut Vec<f64>) {
        out.clear();
        if self.inputs.is_empty() {
            return;
        }
        let at = self.start.after(tau);
        for &component in &self.inputs {
            out.push(solution.and_then(|c| c.value(component as usize, at)).unwrap_or(f64::NAN));
        }
    }

    /// The values of all closed forms at a time after the start.
    pub fn read_formulas(&self, tau: f64, out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.formulas.iter().map(|of| of.trajectory.at(of.x, of.offset + tau)));
    }

    /// The value of a source at a time after the start, given the components and the inputs; 0 for an aggregate.
    pub fn value(&self, source: VariableSource, tau: f64, y: &[f64], inputs: &[f64]) -> f64 {
        match source {
            VariableSource::Aggregate(_) => 0.0,
            VariableSource::Input(i) => inputs[i as usize],
            VariableSource::Fixed(x) => x,
            VariableSource::State(component) => y[component as usize],
            VariableSource::Formula(i) => {
                let FormulaInput { trajectory, x, offset, .. } = &self.formulas[i as usize];
                trajectory.at(*x, offset + tau)
            }
        }
    }

    /// `t` if `which` is 0, else the age of a row's module, at a time after the start.
    pub fn time(&self, row: &EquationRow, which: usize, tau: f64) -> f64 {
        if which == 0 { self.start.to_f64() + tau } else { row.age + tau }
    }

    /// Moves the start of the step, from which time is counted.
    pub fn advance(&mut self, start: SimTime) {
        self.start = start;
        for row in &mut self.rows {
            row.age = start.since(row.birth);
        }
        for formula in &mut self.formulas {
            formula.offset = start.since(formula.since);
        }
    }

    /// Writes the variables of a row's rule, then its switches, at a time after the start, given the components and the
    /// inputs.
    pub fn variables(
        &self,
        rules: &[Rule],
        row: &EquationRow,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
        out: &mut Vec<f64>,
    ) {
        out.clear();
        let sources = &self.sources[row.first_source..row.first_source + row.sources];
        out.extend(sources.iter().map(|source| self.value(*source, tau, y, inputs)));
        out.extend([self.start.to_f64() + tau, row.age + tau]);
        self.gather(rules, row, tau, y, inputs, out);
        out.extend_from_slice(self.switches_of(row));
    }

    /// The module, and its parameter, that a component belongs to.
    pub fn owner(&self, component: usize, tree: &Tree) -> Option<(ModuleId, usize)> {
        self.places.get(component).map(|of| of.owner(tree))
    }
}
