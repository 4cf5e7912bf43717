//! What the steps of a clause's equations ask for again and again, found out once when the model is read.

use super::{Law, Rule, Solve};
use dlsys_expr::Program;

/// Which parameters of a module are components, and what its equations read.
#[derive(Clone, Debug, Default)]
pub struct Stepping {
    /// The parameters that are integrated, then those that are solved for, in the order of their components; where formulas
    /// are used, and where all equations are integrated.
    components: [Vec<usize>; 2],
    /// The parameters of the module and of its context that a step may read.
    reads: Vec<Read>,
    /// Of each variable of the rule: whether formulas read it when a module takes the equations up.
    laws_read: Vec<bool>,
    /// Rates, or values that are solved for, read `t`.
    timed: bool,
}

/// A variable of a rule that is a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Read {
    pub variable: usize,
    /// Number in the context; None for the module itself.
    pub neighbour: Option<usize>,
    pub parameter: usize,
}

impl Stepping {
    pub fn new(rule: &Rule, solve: &Solve) -> Stepping {
        let algebraic = &solve.algebraic;
        let components = [false, true].map(|forced| {
            let numeric = (0..solve.of.len()).filter(|i| forced || solve.numeric.contains(i));
            let solved = (0..algebraic.of.len()).filter(|place| algebraic.is_solved(*place, forced));
            numeric.map(|i| solve.of[i]).chain(solved.map(|place| algebraic.of[place])).collect()
        });
        let linear = solve.linear.as_ref();
        let programs = [&solve.rates, &solve.numeric_rates, &solve.jacobian.values];
        let mut read = read_by(programs.into_iter().chain(linear.map(|l| &l.coefficients)), rule.variables);
        let entries = solve.jacobian.entries.iter().map(|(_, variable)| *variable);
        for variable in linear.into_iter().flat_map(|l| l.variables.iter().flatten().copied()).chain(entries)
        {
            read[variable] = true;
        }
        // What is solved for, and what is added up over children, reads by ways of its own.
        if !algebraic.is_empty() || !rule.aggregates.is_empty() {
            read.fill(true);
        }
        let widths = rule.left.iter().chain(&rule.right).map(|pattern| pattern.width).enumerate();
        let own = (0..rule.parameters.len()).map(|parameter| (None, parameter));
        let context = widths.flat_map(|(n, width)| (0..width).map(move |parameter| (Some(n), parameter)));
        let reads = (own.chain(context).enumerate())
            .map(|(variable, (neighbour, parameter))| Read { variable, neighbour, parameter })
            .filter(|one| read[one.variable])
            .collect();
        let mut laws = Vec::new();
        let mut few = rule.aggregates.is_empty() && algebraic.is_empty();
        for law in &solve.laws {
            match law {
                Law::Polynomial(program) | Law::Quadratic(program) => laws.push(program),
                Law::Driven(driven) => {
                    laws.extend([&driven.coefficients].into_iter().chain(driven.pace.as_deref()))
                }
                Law::Numeric(_) => {}
                Law::Sum { .. } => few = false,
            }
        }
        let mut laws_read = read_by(laws.into_iter(), rule.variables);
        if !few {
            laws_read.fill(true);
        }
        laws_read.iter_mut().take(rule.parameters.len()).for_each(|own| *own = true);
        let time = rule.time_variable();
        let timed = [&solve.rates, &algebraic.values].iter().any(|program| program.reads().contains(&time));
        Stepping { components, reads, laws_read, timed }
    }

    /// The parameters that are integrated, then those that are solved for, in the order of their components.
    pub fn components(&self, forced: bool) -> &[usize] {
        &self.components[usize::from(forced)]
    }

    /// The parameters of the module and of its context that a step may read.
    pub fn reads(&self) -> &[Read] {
        &self.reads
    }

    /// True if rates, or values that are solved for, read the time of the simulation.
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// The variables that formulas read when a module takes the equations up.
    pub fn laws_read(&self) -> &[bool] {
        &self.laws_read
    }
}

/// Of each variable: whether some program reads it.
fn read_by<'p>(programs: impl Iterator<Item = &'p Program>, variables: usize) -> Vec<bool> {
    let mut all = vec![false; variables];
    for &variable in programs.flat_map(Program::reads) {
        if let Some(read) = all.get_mut(variable) {
            *read = true;
        }
    }
    all
}
