//! Newton's method for the unknowns of a block of implicit equations.

use crate::flow::coupled::algebra::{Algebra, AlgebraicError, Block, FADING, Unknown, of};
use crate::flow::coupled::matrix::Matrix;
use crate::flow::coupled::rows::{EquationRow, EquationTable};
use dlsys_expr::{Scratch, Sign};
use dlsys_model::{Rule, Truth};

/// Most corrections.
const MAX_CORRECTIONS: usize = 60;
/// A correction of at most this part of the unknown is the last: the next one would be of the size of its square.
const SMALL: f64 = 1e-9;
/// A correction that does not help is rounding if it is at most this part of the unknown, or of 1.
const NOISE: f64 = 1e-13;

/// Working memory of a solver.
#[derive(Default)]
pub struct Workspace {
    variables: Vec<f64>,
    values: Vec<f64>,
    partials: Vec<f64>,
    sides: Vec<f64>,
    scratch: Scratch<f64>,
}

/// The equations at one instant, to be solved.
pub struct Solver<'s> {
    /// What is solved for, and by which equations.
    pub algebra: &'s Algebra,
    /// The equations.
    pub table: &'s EquationTable,
    /// The rules of the model, by index.
    pub rules: &'s [Rule],
    /// The time since the start of the step.
    pub tau: f64,
    /// The values of the inputs then.
    pub inputs: &'s [f64],
    /// Conditions inside the equations have the sides on which the values are, in place of those of the table.
    pub follows_sides: bool,
    /// What equations are solved for in place of zero, by unknown of the block; empty for zero.
    pub aims: Vec<f64>,
    /// Working memory.
    pub memory: &'s mut Workspace,
}

impl Solver<'_> {
    fn variables(&mut self, row: &EquationRow, y: &[f64]) {
        let variables = &mut self.memory.variables;
        self.table.variables(self.rules, row, self.tau, y, self.inputs, variables);
        if self.follows_sides && row.switches > 0 {
            self.take_sides(row);
        }
    }

    /// Gives the conditions inside the equations of a row the sides on which its variables are.
    fn take_sides(&mut self, row: &EquationRow) {
        let rule = &self.rules[row.rule];
        let solve = &rule.solves[row.solve];
        let Workspace { variables, sides, scratch, .. } = &mut *self.memory;
        sides.resize(rule.sides.outputs(), 0.0);
        rule.sides.eval(variables, scratch, sides);
        // The rows of steps have only those variables that the equations read.
        let is_known = |variable: &usize| {
            *variable >= row.sources
                || self.table.is_complete
                || !rule.aggregates.is_empty()
                || solve.stepping.reads(row.numeric_only).iter().any(|read| read.variable == *variable)
        };
        let first = variables.len() - row.switches;
        for (value, switch) in variables[first..].iter_mut().zip(&solve.switches) {
            if switch.condition.atoms().all(|(atom, _)| rule.atom_reads[atom].iter().all(is_known)) {
                let sign = |atom: usize| Sign::of(sides[2 * atom] - sides[2 * atom + 1]);
                *value = f64::from(u8::from(switch.condition.judge(sign) != Truth::No));
            }
        }
    }

    /// The value of an explicit component, or the residual of the equation of an implicit one.
    pub fn value(&mut self, unknown: Unknown, y: &[f64]) -> f64 {
        let row = self.table.rows[unknown.row as usize];
        self.variables(&row, y);
        let program = &of(self.rules, &row).values;
        let Workspace { variables, values, scratch, .. } = &mut *self.memory;
        values.resize(program.outputs(), 0.0);
        program.eval(variables, scratch, values);
        values[unknown.place as usize]
    }

    /// The residuals of the equations of a block.
    pub fn residuals(&mut self, block: &Block, y: &[f64], out: &mut Vec<f64>) {
        out.clear();
        for (i, &n) in block.unknowns.iter().enumerate() {
            let unknown = self.algebra.unknowns[n as usize];
            let row = &self.table.rows[unknown.row as usize];
            let explicit = of(self.rules, row).explicit[unknown.place as usize];
            let value = self.value(unknown, y);
            let left = if explicit { y[unknown.component as usize] - value } else { value };
            out.push(self.aims.get(i).map_or(left, |aim| left - aim));
        }
    }

    /// The partial derivatives of the equations of a block by its unknowns: row, column and value.
    pub fn partials(&mut self, block: &Block, y: &[f64]) -> Vec<(u32, u32, f64)> {
        let mut all = self.all_partials(block, y);
        all.retain_mut(|(_, component, _)| {
            let unknown = self.algebra.unknown(*component);
            let column = unknown.and_then(|unknown| block.unknowns.binary_search(&unknown).ok());
            *component = column.unwrap_or_default() as u32;
            column.is_some()
        });
        all
    }

    /// The least influence of the unknowns of a block on their equations, as a part of the largest influence there.
    pub fn condition(&mut self, block: &Block, y: &[f64]) -> f64 {
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

    /// The components that a block solves for.
    pub fn places(&self, block: &Block) -> Vec<usize> {
        (0..block.unknowns.len()).map(|unknown| self.algebra.component(block, unknown)).collect()
    }

    /// Newton's method, damped so that the correction that would follow gets smaller (Deuflhard 2004, 3.3).
    pub fn newton(&mut self, block: &Block, y: &mut [f64]) -> Result<(), AlgebraicError> {
        let places = self.places(block);
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
