//! The components of a clause's equations and the variables that its steps read.

/// Which parameters of a module are components, and what its equations read.
#[derive(Clone, Debug)]
pub struct Stepping {
    /// The parameters that are integrated, then those that are solved for, in the order of their components; where formulas
    /// are used, and where all equations are integrated.
    components: [Vec<usize>; 2],
    /// The parameters of the module and of its context that a step may read.
    reads: Vec<Read>,
    /// Of each variable of the rule: whether formulas read it when a module takes the equations up.
    formulas_read: Vec<bool>,
    /// Rates, or values that are solved for, read `t`.
    timed: bool,
}

/// A variable of a rule that is a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Read {
    /// Number of the variable among those of the rule.
    pub variable: usize,
    /// Number in the context; None for the module itself.
    pub neighbour: Option<usize>,
    /// Number of the parameter in its module.
    pub parameter: usize,
}

impl Stepping {
    /// What an analysis has found: the components with formulas and without, the variables that a step reads, of each
    /// variable whether formulas read it, and whether rates or values that are solved for read `t`.
    pub fn new(
        components: [Vec<usize>; 2],
        reads: Vec<Read>,
        formulas_read: Vec<bool>,
        timed: bool,
    ) -> Stepping {
        Stepping { components, reads, formulas_read, timed }
    }

    /// The parameters that are integrated, then those that are solved for, in the order of their components.
    pub fn components(&self, numeric_only: bool) -> &[usize] {
        &self.components[usize::from(numeric_only)]
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
    pub fn formulas_read(&self) -> &[bool] {
        &self.formulas_read
    }
}
