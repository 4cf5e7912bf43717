//! Algebraic components, which are solved for along with the integrated ones.
//!
//! The equations are differential-algebraic of index 1: the integrated components determine these. Therefore the
//! integrator works on an ordinary differential equation, in which each evaluation of rates solves for the algebraic
//! components first (the state space form of Hairer and Wanner 1996, VI.1). Compared with index reduction, which
//! differentiates the equations and integrates the algebraic components, nothing drifts and no projection is needed;
//! and an explicit value costs one evaluation.
//!
//! Components that depend on one another in a circle, within a module or along the tree, are solved together by
//! Newton's method; others one after another, in the order of their dependence (Tarjan's strongly connected components).

use crate::flow::coupled::newton::{Solver, Workspace};
use crate::flow::coupled::rows::{EquationRow, EquationTable};
use dlsys_model::{Algebraic, Rule};

/// An algebraic component.
#[derive(Clone, Copy, Debug)]
pub struct Unknown {
    /// Number of the component in the state vector.
    pub component: u32,
    /// Index of the row with its equation.
    pub row: u32,
    /// Index among the algebraic parameters of the row's clause.
    pub place: u32,
}

/// The algebraic components of a table of equations, in the order in which they are solved for.
#[derive(Clone, Debug, Default)]
pub struct Algebra {
    /// All algebraic components, in string order.
    pub unknowns: Vec<Unknown>,
    /// The blocks, in the order in which they are solved.
    pub blocks: Vec<Block>,
    /// By component: the index of the unknown, or [`NONE`].
    number: Vec<u32>,
}

/// Unknowns that depend on one another, and are solved for together.
#[derive(Clone, Debug)]
pub struct Block {
    /// Indices of the unknowns, in string order.
    pub unknowns: Vec<u32>,
    /// The block is one explicit value that does not depend on itself.
    pub explicit: bool,
}

/// The reason why algebraic components have no solution, with a component that it concerns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlgebraicError {
    /// The partial derivatives by the unknowns are singular at the solution.
    Singular(usize),
    /// Newton's method does not converge.
    NoSolution(usize),
    /// A value in the course of the iteration is not finite.
    NotFinite(usize),
    /// The partial derivatives become singular before long.
    Fading(usize),
    /// The component changes too fast for polynomials to follow.
    Rough(usize),
    /// Solutions meet: the partial derivatives are singular at one instant.
    Meeting(usize),
}

impl AlgebraicError {
    /// The component that the error concerns.
    pub fn component(self) -> usize {
        match self {
            AlgebraicError::Singular(c)
            | AlgebraicError::NoSolution(c)
            | AlgebraicError::NotFinite(c)
            | AlgebraicError::Fading(c)
            | AlgebraicError::Rough(c)
            | AlgebraicError::Meeting(c) => c,
        }
    }
}

/// No unknown has this number.
const NONE: u32 = u32::MAX;
/// Unknowns whose influence on their equations is less than this part of the largest influence explain why steps have
/// become too small.
pub const FADING: f64 = 1e-2;

impl Algebra {
    /// The algebraic components of a table of rows.
    pub fn new(table: &EquationTable, rules: &[Rule]) -> Algebra {
        let mut algebra = Algebra::default();
        for (n, row) in table.rows.iter().enumerate().filter(|(_, row)| row.algebraic > 0) {
            for (component, &place) in (row.first_rate + row.rates..).zip(table.given(row)) {
                let unknown = Unknown { component: component as u32, row: n as u32, place };
                if algebra.number.len() <= component {
                    algebra.number.resize(component + 1, NONE);
                }
                algebra.number[component] = algebra.unknowns.len() as u32;
                algebra.unknowns.push(unknown);
            }
        }
        if !algebra.unknowns.is_empty() {
            algebra.sort(table, rules);
        }
        algebra
    }

    /// True if no component is algebraic.
    pub fn is_empty(&self) -> bool {
        self.unknowns.is_empty()
    }

    /// The component of an unknown of a block.
    pub fn component(&self, block: &Block, unknown: usize) -> usize {
        self.unknowns[block.unknowns[unknown] as usize].component as usize
    }

    /// The index of the unknown that a component is, if it is one.
    pub fn unknown(&self, component: u32) -> Option<u32> {
        self.number.get(component as usize).copied().filter(|number| *number != NONE)
    }

    /// True for an algebraic component.
    pub fn is_solved(&self, component: u32) -> bool {
        self.unknown(component).is_some()
    }

    /// Puts the unknowns into the order of their dependence, those on a cycle together (Tarjan 1972; with an explicit
    /// stack, because chains may be as long as the string).
    fn sort(&mut self, table: &EquationTable, rules: &[Rule]) {
        let n = self.unknowns.len();
        let mut depends: Vec<Vec<u32>> = vec![Vec::new(); n];
        for row in table.rows.iter().filter(|row| row.algebraic > 0) {
            let jacobian = &of(rules, row).jacobian;
            table.visit_partials(rules, row, jacobian, |partial| {
                let position = jacobian.entries[partial.entry].0 as u32;
                let own = table.given(row).iter().position(|place| *place == position);
                if let Some(own) = own
                    && let Some(to) = self.unknown(partial.component)
                {
                    let from = self.number[row.first_rate + row.rates + own];
                    depends[from as usize].push(to);
                }
            });
        }
        let (mut index, mut low, mut on_stack) = (vec![NONE; n], vec![0u32; n], vec![false; n]);
        let (mut stack, mut calls, mut next) = (Vec::new(), Vec::new(), 0u32);
        for start in 0..n {
            if index[start] != NONE {
                continue;
            }
            calls.push((start, 0));
            while let Some((v, edge)) = calls.pop() {
                if edge == 0 {
                    (index[v], low[v]) = (next, next);
                    next += 1;
                    stack.push(v as u32);
                    on_stack[v] = true;
                }
                if let Some(&w) = depends[v].get(edge) {
                    calls.push((v, edge + 1));
                    let w = w as usize;
                    if index[w] == NONE {
                        calls.push((w, 0));
                    } else if on_stack[w] {
                        low[v] = low[v].min(index[w]);
                    }
                    continue;
                }
                if low[v] == index[v] {
                    let mut unknowns = Vec::new();
                    while let Some(w) = stack.pop() {
                        on_stack[w as usize] = false;
                        unknowns.push(w);
                        if w as usize == v {
                            break;
                        }
                    }
                    // In string order, for elimination from the tips to the root.
                    unknowns.sort_unstable();
                    let alone = unknowns.len() == 1 && !depends[v].contains(&(v as u32));
                    let Unknown { row, place, .. } = self.unknowns[v];
                    let explicit = alone && of(rules, &table.rows[row as usize]).explicit[place as usize];
                    self.blocks.push(Block { unknowns, explicit });
                }
                if let Some(&(parent, _)) = calls.last() {
                    low[parent] = low[parent].min(low[v]);
                }
            }
        }
    }

    /// Solves for the algebraic components of the state `y` at a time since the start of the step. The values that they
    /// have in `y` are the first guess.
    pub fn solve(
        &self,
        table: &EquationTable,
        rules: &[Rule],
        tau: f64,
        inputs: &[f64],
        y: &mut [f64],
    ) -> Result<(), AlgebraicError> {
        let mut memory = Workspace::default();
        let mut solver = self.solver(table, rules, tau, inputs, &mut memory);
        for block in &self.blocks {
            match block.explicit {
                true => {
                    let unknown = self.unknowns[block.unknowns[0] as usize];
                    let value = solver.value(unknown, y);
                    if !value.is_finite() {
                        return Err(AlgebraicError::NotFinite(unknown.component as usize));
                    }
                    y[unknown.component as usize] = value;
                }
                // Steps that fail are made shorter, but an instant is what it is.
                false if table.is_complete => solver.search(block, y)?,
                false => solver.newton(block, y)?,
            }
        }
        Ok(())
    }
}

impl Algebra {
    /// The equations at a time since the start of the step, with the conditions inside them as in the table.
    pub fn solver<'s>(
        &'s self,
        table: &'s EquationTable,
        rules: &'s [Rule],
        tau: f64,
        inputs: &'s [f64],
        memory: &'s mut Workspace,
    ) -> Solver<'s> {
        Solver { algebra: self, table, rules, tau, inputs, follows_sides: false, aims: Vec::new(), memory }
    }

    /// The unknowns whose equations become singular, and which therefore change ever faster, if there are any: the
    /// reason why steps have become too small.
    pub fn fading(
        &self,
        table: &EquationTable,
        rules: &[Rule],
        inputs: &[f64],
        y: &[f64],
    ) -> Option<AlgebraicError> {
        let mut memory = Workspace::default();
        let mut solver = self.solver(table, rules, 0.0, inputs, &mut memory);
        let implicit = self.blocks.iter().filter(|block| !block.explicit);
        let mut known = implicit.map(|block| (block, solver.condition(block, y)));
        let (block, _) = known.find(|(_, condition)| *condition < FADING)?;
        Some(AlgebraicError::Fading(self.unknowns[block.unknowns[0] as usize].component as usize))
    }
}

/// The algebraic parameters of a row's clause.
pub fn of<'r>(rules: &'r [Rule], row: &EquationRow) -> &'r Algebraic {
    &rules[row.rule].solves[row.solve].algebraic
}
