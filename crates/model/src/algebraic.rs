//! What is known of a module without integrating it: explicit and implicit parameters, and aggregates of its children.
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
/// The own explicit parameters that an equation reads have been put into it, so that the programs read parameters
/// with rates, implicit ones, constants, the context and time.
#[derive(Clone, Debug, Default)]
pub struct Algebraic {
    /// The parameters, explicit ones first. Of an implicit one, the equation of the same place is solved for it.
    pub of: Vec<usize>,
    /// `x = f`, not `0 = g`.
    pub explicit: Vec<bool>,
    /// A formula of constants, time and parameters that follow formulas.
    pub closed: Vec<bool>,
    /// It is implicit, or some rate, condition or other such parameter reads it. An explicit one that nobody reads is
    /// computed when somebody looks.
    pub needed: Vec<bool>,
    /// f of explicit parameters, g of implicit ones.
    pub values: Program,
    /// Of the formulas alone, one program each, empty for others.
    pub formulas: Vec<Arc<Program>>,
    /// Partial derivatives of `values` by what changes.
    pub jacobian: Jacobian,
    /// Where each equation is written.
    pub spans: Vec<Span>,
}

impl Algebraic {
    /// True if all parameters have rates.
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// True if the place is one whose parameter is solved for along with those that are integrated: `numeric_only` if no
    /// formulas are used.
    pub fn is_solved(&self, place: usize, numeric_only: bool) -> bool {
        if numeric_only { !self.is_lazy(place) } else { self.needed[place] && !self.closed[place] }
    }

    /// True if the parameter is computed only when somebody looks.
    pub fn is_lazy(&self, place: usize) -> bool {
        !self.needed[place] && !self.closed[place]
    }
}

/// Something of all modules attached to one: `sum(B(x, c): D*(c - c_0))`. Of no modules it is 0.
#[derive(Clone, Debug)]
pub struct Aggregate {
    /// How the values of the children are combined.
    pub fold: Fold,
    /// The children that count.
    pub pattern: Pattern,
    /// The value of one child. It reads the variables of the rule, then the parameters of the child.
    pub term: Program,
    /// Partial derivatives of the term by what changes; the row is 0.
    pub jacobian: Jacobian,
    /// Something in it changes from one event to the next.
    pub moves: bool,
    /// As it is written, without the term.
    pub label: String,
    /// Where the head of the child is written.
    pub span: Span,
}

impl Aggregate {
    /// The value, given the variables of the rule, and a function that appends the parameters of one child after
    /// another and says whether there was one.
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
