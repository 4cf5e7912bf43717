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

use crate::flow::coupled::rows::{EquationRow, EquationTable};
use dlsys_expr::{Scratch, eliminate};
use dlsys_model::{Algebraic, Rule};
use dlsys_ode::Pattern;

/// An algebraic component.
#[derive(Clone, Copy, Debug)]
pub struct Unknown {
    /// Number of the component in the state vector.
    pub component: u32,
    row: u32,
    /// Index among the algebraic parameters of the row's clause.
    place: u32,
}

/// The algebraic components of a table of equations, in the order in which they are solved for.
#[derive(Clone, Debug, Default)]
pub struct Algebra {
    /// All algebraic components, in string order.
    pub unknowns: Vec<Unknown>,
    blocks: Vec<Block>,
    /// By component: the index of the unknown, or [`NONE`].
    number: Vec<u32>,
}

/// Unknowns that depend on one another, and are solved for together.
#[derive(Clone, Debug)]
struct Block {
    unknowns: Vec<u32>,
    /// The block is one explicit value that does not depend on itself.
    explicit: bool,
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
}

impl AlgebraicError {
    /// The component that the error concerns.
    pub fn component(self) -> usize {
        match self {
            AlgebraicError::Singular(c)
            | AlgebraicError::NoSolution(c)
            | AlgebraicError::NotFinite(c)
            | AlgebraicError::Fading(c)
            | AlgebraicError::Rough(c) => c,
        }
    }
}

const NONE: u32 = u32::MAX;

/// Most corrections.
const MAX_CORRECTIONS: usize = 60;
/// A correction of at most this part of the unknown is the last: the next one would be of the size of its square.
const SMALL: f64 = 1e-9;
/// A correction that does not help is rounding if it is at most this part of the unknown, or of 1.
const NOISE: f64 = 1e-13;
/// A matrix is singular if a pivot is at most this part of its row.
const SINGULAR: f64 = 1e-13;
/// Unknowns whose influence on their equations is less than this part of the largest influence explain why steps have
/// become too small.
const FADING: f64 = 1e-2;
/// Up to this many unknowns are eliminated with pivoting.
const FEW: usize = 48;
/// Up to this many unknowns are eliminated with pivoting if elimination without pivoting fails.
const MANY: usize = 1000;

/// Working memory of a solver.
#[derive(Default)]
struct Workspace {
    variables: Vec<f64>,
    values: Vec<f64>,
    partials: Vec<f64>,
    scratch: Scratch<f64>,
}

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

    /// True for an algebraic component.
    pub fn is_solved(&self, component: u32) -> bool {
        self.number.get(component as usize).is_some_and(|n| *n != NONE)
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
                let to = self.number.get(partial.component as usize).copied().unwrap_or(NONE);
                if let Some(own) = own
                    && to != NONE
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
        let mut solver = Solver { algebra: self, table, rules, tau, inputs, memory: &mut memory };
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
                false => solver.newton(block, y)?,
            }
        }
        Ok(())
    }
}

impl Algebra {
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
        let mut solver = Solver { algebra: self, table, rules, tau: 0.0, inputs, memory: &mut memory };
        let implicit = self.blocks.iter().filter(|block| !block.explicit);
        let mut known = implicit.map(|block| (block, solver.condition(block, y)));
        let (block, _) = known.find(|(_, condition)| *condition < FADING)?;
        Some(AlgebraicError::Fading(self.unknowns[block.unknowns[0] as usize].component as usize))
    }
}

/// The algebraic parameters of a row's clause.
fn of<'r>(rules: &'r [Rule], row: &EquationRow) -> &'r Algebraic {
    &rules[row.rule].solves[row.solve].algebraic
}

/// The equations at one instant, to be solved.
struct Solver<'s> {
    algebra: &'s Algebra,
    table: &'s EquationTable,
    rules: &'s [Rule],
    tau: f64,
    inputs: &'s [f64],
    memory: &'s mut Workspace,
}

impl Solver<'_> {
    fn variables(&mut self, row: &EquationRow, y: &[f64]) {
        let variables = &mut self.memory.variables;
        self.table.variables(self.rules, row, self.tau, y, self.inputs, variables);
    }

    /// The value of an explicit component, or the residual of the equation of an implicit one.
    fn value(&mut self, unknown: Unknown, y: &[f64]) -> f64 {
        let row = self.table.rows[unknown.row as usize];
        self.variables(&row, y);
        let program = &of(self.rules, &row).values;
        let Workspace { variables, values, scratch, .. } = &mut *self.memory;
        values.resize(program.outputs(), 0.0);
        program.eval(variables, scratch, values);
        values[unknown.place as usize]
    }

    /// The residuals of the equations of a block.
    fn residuals(&mut self, block: &Block, y: &[f64], out: &mut Vec<f64>) {
        out.clear();
        for &n in &block.unknowns {
            let unknown = self.algebra.unknowns[n as usize];
            let row = &self.table.rows[unknown.row as usize];
            let explicit = of(self.rules, row).explicit[unknown.place as usize];
            let value = self.value(unknown, y);
            out.push(if explicit { y[unknown.component as usize] - value } else { value });
        }
    }

    /// The partial derivatives of the equations of a block by its unknowns: row, column and value.
    fn partials(&mut self, block: &Block, y: &[f64]) -> Vec<(u32, u32, f64)> {
        let mut all = self.all_partials(block, y);
        all.retain_mut(|(_, component, _)| {
            let unknown = self.algebra.number.get(*component as usize).copied().unwrap_or(NONE);
            let column = block.unknowns.binary_search(&unknown);
            *component = column.unwrap_or_default() as u32;
            column.is_ok()
        });
        all
    }

    /// The least influence of the unknowns of a block on their equations, as a part of the largest influence there.
    fn condition(&mut self, block: &Block, y: &[f64]) -> f64 {
        const MOMENT: f64 = 1e-6;
        let (mut before, mut after) = (Vec::new(), Vec::new());
        self.residuals(block, y, &mut before);
        let tau = std::mem::replace(&mut self.tau, MOMENT);
        self.residuals(block, y, &mut after);
        self.tau = tau;
        let mut sizes: Vec<f64> = before.iter().zip(&after).map(|(a, b)| (b - a).abs() / MOMENT).collect();
        for (row, _, value) in self.all_partials(block, y) {
            sizes[row as usize] = sizes[row as usize].max(value.abs());
        }
        let mut largest = vec![0.0_f64; sizes.len()];
        for (row, _, value) in self.partials(block, y) {
            largest[row as usize] = largest[row as usize].max(value.abs());
        }
        largest.iter().zip(&sizes).map(|(own, all)| own / all).fold(f64::INFINITY, f64::min)
    }

    /// The partial derivatives of the equations of a block: row, component and value.
    fn all_partials(&mut self, block: &Block, y: &[f64]) -> Vec<(u32, u32, f64)> {
        let mut all = Vec::new();
        for (i, &n) in block.unknowns.iter().enumerate() {
            let unknown = self.algebra.unknowns[n as usize];
            let row = self.table.rows[unknown.row as usize];
            let algebraic = of(self.rules, &row);
            let jacobian = &algebraic.jacobian;
            self.variables(&row, y);
            let Workspace { variables, partials, scratch, .. } = &mut *self.memory;
            partials.resize(jacobian.values.outputs(), 0.0);
            jacobian.values.eval(variables, scratch, partials);
            let slopes = self.table.slopes(self.rules, &row, variables, self.tau, y, self.inputs);
            let explicit = algebraic.explicit[unknown.place as usize];
            if explicit {
                all.push((i as u32, unknown.component, 1.0));
            }
            self.table.visit_partials(self.rules, &row, jacobian, |partial| {
                if jacobian.entries[partial.entry].0 == unknown.place as usize {
                    let value = partial.value(partials, &slopes);
                    all.push((i as u32, partial.component, if explicit { -value } else { value }));
                }
            });
        }
        all
    }

    /// Newton's method, damped so that the correction that would follow gets smaller (Deuflhard 2004, 3.3).
    fn newton(&mut self, block: &Block, y: &mut [f64]) -> Result<(), AlgebraicError> {
        let component = |i: usize| self.algebra.unknowns[block.unknowns[i] as usize].component as usize;
        let places: Vec<usize> = (0..block.unknowns.len()).map(component).collect();
        let bad = |r: &[f64]| r.iter().position(|x| !x.is_finite());
        let mut left = Vec::new();
        self.residuals(block, y, &mut left);
        if let Some(i) = bad(&left) {
            return Err(AlgebraicError::NotFinite(places[i]));
        }
        let (mut trial, mut last) = (Vec::new(), f64::INFINITY);
        for _ in 0..MAX_CORRECTIONS {
            let matrix = Matrix::new(self.partials(block, y), places.len());
            let Some(correction) = matrix.solve(&left) else {
                return Err(AlgebraicError::Singular(places[0]));
            };
            let start: Vec<f64> = places.iter().map(|p| y[*p]).collect();
            // This correction and the next have one scale: a solution may be zero, and on the way to it every
            // correction is large relative to the value that it is added to.
            let scale = start.iter().fold(1e-300, |most: f64, x| most.max(x.abs()));
            let length = |c: &[f64]| {
                let of = |(c, x): (&f64, &f64)| c.abs() / x.abs().max(1e-3 * scale).max(1e-12);
                c.iter().zip(&start).map(of).fold(0.0, f64::max)
            };
            let whole = length(&correction);
            // Near zero only rounding in the equations is left long before the correction is small relative to the
            // unknown.
            let noise = (correction.iter().zip(&start)).all(|(c, x)| c.abs() <= NOISE * x.abs().max(1.0));
            if whole == 0.0 {
                return Ok(());
            }
            let mut part = 1.0;
            loop {
                for ((place, from), c) in places.iter().zip(&start).zip(&correction) {
                    y[*place] = from - part * c;
                }
                self.residuals(block, y, &mut trial);
                // Only rounding is left, or nearly so.
                if part == 1.0 && whole <= SMALL {
                    return Ok(());
                }
                if bad(&trial).is_none()
                    && let Some(next) = matrix.solve(&trial)
                    && length(&next) <= (1.0 - 0.25 * part) * whole
                {
                    break;
                }
                if noise {
                    for (place, from) in places.iter().zip(&start) {
                        y[*place] = *from;
                    }
                    return Ok(());
                }
                part *= 0.5;
                if part < 1e-6 {
                    return Err(if bad(&trial).is_some() {
                        AlgebraicError::NotFinite(places[0])
                    } else {
                        AlgebraicError::NoSolution(places[0])
                    });
                }
            }
            std::mem::swap(&mut left, &mut trial);
            // At a double root corrections only halve, and so do those that are rounding, where an unknown passes zero.
            let halves = part == 1.0 && whole < 1e-6 && whole > 0.4 * last;
            if halves && self.condition(block, y) < FADING {
                return Err(AlgebraicError::Singular(places[0]));
            }
            last = whole;
        }
        Err(AlgebraicError::NoSolution(places[0]))
    }
}

/// The partial derivatives of a block.
enum Matrix {
    Dense(usize, Vec<f64>),
    Sparse(Pattern, Vec<f64>, Vec<f64>),
    Singular,
}

impl Matrix {
    fn new(entries: Vec<(u32, u32, f64)>, n: usize) -> Matrix {
        if n > FEW {
            let couplings: Vec<(u32, u32)> = entries.iter().map(|e| (e.0, e.1)).collect();
            if let Some(pattern) = Pattern::new(n, &couplings) {
                let mut values = vec![0.0; pattern.entries()];
                for &(i, j, value) in &entries {
                    if let Some(place) = pattern.entry(i as usize, j as usize) {
                        values[place] += value;
                    }
                }
                let mut factors = Vec::new();
                // The matrix itself: no shift, and the opposite sign.
                if pattern.factor(&values, 0.0, -1.0, &mut factors) {
                    return Matrix::Sparse(pattern, values, factors);
                }
            }
            if n > MANY {
                return Matrix::Singular;
            }
        }
        let mut matrix = vec![0.0; n * n];
        for (i, j, value) in entries {
            matrix[i as usize * n + j as usize] += value;
        }
        Matrix::Dense(n, matrix)
    }

    fn solve(&self, right: &[f64]) -> Option<Vec<f64>> {
        let mut x = right.to_vec();
        match self {
            Matrix::Singular => return None,
            Matrix::Dense(n, matrix) => {
                debug_assert_eq!(*n, right.len());
                let pivot = eliminate(&mut matrix.clone(), &mut x);
                if pivot.is_nan() || pivot <= SINGULAR {
                    return None;
                }
            }
            Matrix::Sparse(pattern, values, factors) => {
                pattern.solve(factors, &mut x);
                // One correction takes back the digits that elimination without pivoting has lost.
                let mut product = vec![0.0; x.len()];
                pattern.multiply(values, &x, &mut product);
                let mut rest: Vec<f64> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
                pattern.solve(factors, &mut rest);
                x.iter_mut().zip(rest).for_each(|(x, r)| *x += r);
            }
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}
