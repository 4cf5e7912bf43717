//! Values of a module that are computed without integration: explicit and implicit parameters, and aggregates of its
//! children.
//!
//! Together with rates these make differential-algebraic equations of index 1, which section 8 of the paper leaves
//! open: `dx/dt = f(x, z)`, `0 = g(x, z)`, where g determines z as long as its partial derivatives by z are not
//! singular.

use std::sync::Arc;

use super::{Jacobian, Pattern};
use dlsys_diagnostic::Span;
use dlsys_expr::{Fold, Program, Scratch, Value};

/// The parameters of a `solve` that have a value or an equation instead of a rate.
///
/// Explicit parameters of the module are substituted into the equations that read them, so the programs read only
/// parameters with rates, implicit parameters, constants, the context and time.
#[derive(Clone, Debug, Default)]
pub struct Algebraic {
    /// The parameters, explicit ones first. The equation at the same index is solved for an implicit one.
    pub of: Vec<usize>,
    /// True for `x = f`, false for `0 = g`.
    pub explicit: Vec<bool>,
    /// True if f reads only constants, time and parameters that follow formulas.
    pub closed: Vec<bool>,
    /// True if the parameter is implicit, or if a rate, a condition or another such parameter reads it. The value of any
    /// other is computed only when it is observed.
    pub needed: Vec<bool>,
    /// f of explicit parameters, g of implicit ones.
    pub values: Program,
    /// One program for each parameter that is `closed`; empty for the others.
    pub formulas: Vec<Arc<Program>>,
    /// Partial derivatives of `values` with respect to the variables that change between events.
    pub jacobian: Jacobian,
    /// The place of each equation in the text.
    pub spans: Vec<Span>,
}

impl Algebraic {
    /// True if all parameters have rates.
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// True if the parameter at this index is solved for in each step of the integrator. `numeric_only` is true if all
    /// equations are integrated, even those with formulas.
    pub fn is_solved(&self, place: usize, numeric_only: bool) -> bool {
        if numeric_only { !self.is_lazy(place) } else { self.needed[place] && !self.closed[place] }
    }

    /// True if the parameter is computed only when it is observed.
    pub fn is_lazy(&self, place: usize) -> bool {
        !self.needed[place] && !self.closed[place]
    }
}

/// A value over all modules attached to one: `sum(B(x, c): D*(c - c_0))`. Without such modules it is 0.
#[derive(Clone, Debug)]
pub struct Aggregate {
    /// The operation that combines the values of the children.
    pub fold: Fold,
    /// The kinds of children that are included.
    pub pattern: Pattern,
    /// The value of one child. It reads the variables of the rule, then the parameters of the child.
    pub term: Program,
    /// Partial derivatives of the term with respect to the variables that change; the row is always 0.
    pub jacobian: Jacobian,
    /// True if its value may change between two events.
    pub moves: bool,
    /// The text of the aggregate without its term.
    pub label: String,
    /// The place of the head of the child in the text.
    pub span: Span,
}

impl Aggregate {
    /// The value, given the variables of the rule. Each call of `next` appends the parameters of one more child; it
    /// returns false when there is none.
    pub fn evaluate<T: Value>(
        &self,
        variables: &mut Vec<T>,
        mut next: impl FnMut(&mut Vec<T>) -> bool,
        scratch: &mut Scratch<T>,
    ) -> T {
        let count = variables.len();
        let mut all = None;
        let mut term = [T::constant(0.0)];
        while next(variables) {
            self.term.eval(variables, scratch, &mut term);
            all = Some(self.fold.add(all, term[0]));
            variables.truncate(count);
        }
        all.unwrap_or_else(|| T::constant(0.0))
    }
}

/// A part of a right context: `> [ C(z) ] D(w)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContextPart {
    /// A module: the next one of the right context.
    Module,
    /// A branch begins.
    Open,
    /// The branch ends.
    Close,
}
