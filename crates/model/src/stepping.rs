//! The components of a clause's equations and the variables that its steps read.

/// The parameters of a module that are components of the integrator's state, and the variables that its equations read.
#[derive(Clone, Debug)]
pub struct Stepping {
    /// The parameters that are integrated, then those that are solved for, in the order of their components: first for the
    /// case that formulas are used, then for the case that all equations are integrated.
    components: [Vec<usize>; 2],
    /// The parameters of the module and of its context that a step may read, for the same two cases.
    reads: [Vec<Read>; 2],
    /// By variable of the rule: true if a formula reads it when the clause becomes active.
    formulas_read: Vec<bool>,
    /// True if rates, or values that are solved for, read `t`.
    timed: bool,
    /// True if steps may read `age`.
    aged: bool,
}

/// A variable of a rule that is a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Read {
    /// Number of the variable among those of the rule.
    pub variable: usize,
    /// Index of the module in the context; None for the module itself.
    pub neighbour: Option<usize>,
    /// Index of the parameter in its module.
    pub parameter: usize,
}

impl Stepping {
    /// The results of an analysis: the components with formulas and without, the parameters that a step then reads, by variable
    /// whether formulas read it, and whether rates or values that are solved for read `t`, and steps `age`.
    pub fn new(
        components: [Vec<usize>; 2],
        reads: [Vec<Read>; 2],
        formulas_read: Vec<bool>,
        [timed, aged]: [bool; 2],
    ) -> Stepping {
        Stepping { components, reads, formulas_read, timed, aged }
    }

    /// The parameters that are integrated, then those that are solved for, in the order of their components. `numeric_only`
    /// is true if all equations are integrated, even those with formulas.
    pub fn components(&self, numeric_only: bool) -> &[usize] {
        &self.components[usize::from(numeric_only)]
    }

    /// The parameters of the module and of its context that a step may read.
    pub fn reads(&self, numeric_only: bool) -> &[Read] {
        &self.reads[usize::from(numeric_only)]
    }

    /// True if rates, or values that are solved for, read the time of the simulation.
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// True if a step may read the age of the module.
    pub fn is_aged(&self) -> bool {
        self.aged
    }

    /// By variable of the rule: true if a formula reads it when the clause becomes active.
    pub fn formulas_read(&self) -> &[bool] {
        &self.formulas_read
    }
}
