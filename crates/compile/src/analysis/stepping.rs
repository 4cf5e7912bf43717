//! The components of a clause's equations, and the variables that its steps read.

use dlsys_expr::Program;
use dlsys_model::{Algebraic, Jacobian, LinearRates, Read, SolutionForm, Stepping};

use super::ResolvedRule;

/// The layout of the variables of a rule.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct VariableLayout {
    /// Number of the module's own parameters.
    own: usize,
    /// Number of the parameters of each module of the context.
    context: Vec<usize>,
    /// Number of all variables.
    variables: usize,
    /// True if there are aggregates among them.
    aggregates: bool,
}

impl VariableLayout {
    pub fn of(rule: &ResolvedRule) -> VariableLayout {
        VariableLayout {
            own: rule.declared.own(),
            context: rule.context().map(|pattern| pattern.width).collect(),
            variables: rule.declared.variables,
            aggregates: !rule.children.is_empty(),
        }
    }
}

/// The equations of a clause; the fields are those of [`dlsys_model::Equations`].
pub struct StepEquations<'e> {
    pub of: &'e [usize],
    pub rates: &'e Program,
    pub solution_forms: &'e [SolutionForm],
    pub numeric: &'e [usize],
    pub numeric_rates: &'e Program,
    pub linear: Option<&'e LinearRates>,
    pub jacobian: &'e Jacobian,
    pub algebraic: &'e Algebraic,
}

impl StepEquations<'_> {
    /// The components of the clause and the variables that its steps read.
    pub fn stepping(&self, layout: &VariableLayout) -> Stepping {
        let algebraic = self.algebraic;
        let components = [false, true].map(|numeric_only| {
            let numeric = (0..self.of.len()).filter(|i| numeric_only || self.numeric.contains(i));
            let solved = (0..algebraic.of.len()).filter(|place| algebraic.is_solved(*place, numeric_only));
            numeric.map(|i| self.of[i]).chain(solved.map(|place| algebraic.of[place])).collect()
        });
        let widths = layout.context.iter().copied().enumerate();
        let own = (0..layout.own).map(|parameter| (None, parameter));
        let context = widths.flat_map(|(n, width)| (0..width).map(move |parameter| (Some(n), parameter)));
        let all: Vec<Read> = (own.chain(context).enumerate())
            .map(|(variable, (neighbour, parameter))| Read { variable, neighbour, parameter })
            .collect();
        let read = [false, true].map(|numeric_only| self.read_by_steps(numeric_only, layout));
        let reads =
            [0, 1].map(|case: usize| all.iter().copied().filter(|one| read[case][one.variable]).collect());
        let mut formulas = Vec::new();
        let mut few = !layout.aggregates && algebraic.is_empty();
        for form in self.solution_forms {
            match form {
                SolutionForm::Polynomial(program) | SolutionForm::Quadratic(program) => {
                    formulas.push(program)
                }
                SolutionForm::Driven(driven) => {
                    formulas.extend([&driven.coefficients].into_iter().chain(driven.pace.as_deref()))
                }
                SolutionForm::Numeric(_) => {}
                SolutionForm::Sum { .. } => few = false,
            }
        }
        let mut formulas_read = read_by(formulas.into_iter(), layout.variables);
        if !few {
            formulas_read.fill(true);
        }
        formulas_read.iter_mut().take(layout.own).for_each(|own| *own = true);
        let time = layout.variables - 2;
        let timed = [self.rates, &algebraic.values].iter().any(|program| program.reads().contains(&time));
        Stepping::new(components, reads, formulas_read, [timed, read.iter().any(|read| read[time + 1])])
    }

    /// By variable: true if steps read it, of the integrated equations or of all.
    fn read_by_steps(&self, numeric_only: bool, layout: &VariableLayout) -> Vec<bool> {
        // Implicit equations and aggregates read variables that are not listed in these programs.
        if !self.algebraic.is_empty() || layout.aggregates {
            return vec![true; layout.variables];
        }
        let (linear, derivatives) = (self.linear, &self.jacobian.values);
        let rates = if numeric_only { self.rates } else { self.numeric_rates };
        let mut read = read_by([rates].into_iter().chain(linear.map(|l| &l.coefficients)), layout.variables);
        let of_linear = linear.into_iter().flat_map(|l| l.variables.iter().flatten().copied());
        let of_derivatives = (self.jacobian.entries.iter().enumerate())
            .filter(|(_, (rate, _))| numeric_only || self.numeric.contains(rate))
            .flat_map(|(entry, (_, variable))| {
                derivatives.output_reads(entry).into_iter().chain([*variable])
            });
        for variable in of_linear.chain(of_derivatives) {
            // Switches come behind the variables.
            if let Some(read) = read.get_mut(variable) {
                *read = true;
            }
        }
        read
    }
}

/// By variable: true if some program reads it.
fn read_by<'p>(programs: impl Iterator<Item = &'p Program>, variables: usize) -> Vec<bool> {
    let mut all = vec![false; variables];
    for &variable in programs.flat_map(Program::reads) {
        if let Some(read) = all.get_mut(variable) {
            *read = true;
        }
    }
    all
}
