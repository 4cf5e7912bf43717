//! Rules: context, equations and productions under one head.
//!
//! # Variables of a rule
//!
//! All expressions of a rule read the same variables, in this order: the parameters of the strict
//! predecessor, then its hidden ones ([`Kind::clocks`](super::Kind::clocks), [`Input`](super::Input)); the same of the context modules, left to
//! right as written; one value for each [`Aggregate`]; `t`; `age`; then one truth value for each [`Switch`], or the
//! [`Draw`](super::Draw)s of a successor.

use std::ops::Deref;
use std::sync::Arc;

use super::{
    Aggregate, Algebraic, Boundary, Clock, Condition, ContextPart, Jacobian, KindId, LinearRates,
    SolutionForm, Stepping, Successor, ZeroCrossing,
};
use dlsys_diagnostic::Span;
use dlsys_expr::Program;

/// Context, equations and productions of one strict predecessor.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Its index among the rules of the model.
    pub index: usize,
    /// The text of the head.
    pub label: String,
    /// The place of the head in the text.
    pub span: Span,
    /// True for a discrete rule, which has one production, applied at the multiples of the model's period, and no equations.
    pub discrete: bool,
    /// Names of the strict predecessor's parameters, hidden ones last.
    pub parameters: Vec<String>,
    /// Names of the context's parameters, in the order of the variables.
    pub context_names: Vec<String>,
    /// Left context in reading order: the last one is the nearest.
    pub left: Vec<Pattern>,
    /// Right context in reading order: the first one is the nearest.
    pub right: Vec<Pattern>,
    /// The branching of the right context: its modules in order, with the brackets between them.
    pub right_shape: Vec<ContextPart>,
    /// Aggregates of the modules attached to this one.
    pub aggregates: Vec<Aggregate>,
    /// The variable of the first aggregate. There may be more variables than aggregates; the others are unused.
    pub first_aggregate: usize,
    /// Number of variables, switches excluded.
    pub variables: usize,
    /// Both sides of every comparison: `a` of atom i is output 2i, `b` is output 2i + 1.
    pub sides: Program,
    /// By atom: the variables that its sides read, ascending.
    pub atom_reads: Vec<Vec<usize>>,
    /// By variable: true if a side reads it, directly or through an aggregate.
    pub watched: Vec<bool>,
    /// The place of each atom in the text.
    pub atoms: Vec<Span>,
    /// The boundary of each atom, as in `x = s`, for messages.
    pub boundaries: Vec<Boundary>,
    /// By atom: true if it is a part of a comparison of a whole part or a sign, which jumps where the sides of the atom meet.
    pub jumping: Vec<bool>,
    /// By atom: true if a side jumps, and the comparison could not be taken apart into comparisons of what moves.
    pub jumping_whole: Vec<bool>,
    /// The `solve` clauses in the order written; the first whose condition holds is active.
    pub solves: Vec<Solve>,
    /// The `produce` clauses in the order written; of those whose conditions hold at one instant, the first applies.
    pub produces: Vec<Produce>,
    /// Number of hidden parameters of the strict predecessor.
    pub hidden: usize,
    /// The clocks of events at a rate.
    pub clocks: Vec<Clock>,
    /// Variables of the context that change between events, because some rule has an equation for them.
    pub moving_context: Vec<usize>,
    /// True if a rate, a value or a condition reads a variable of the context that changes between events.
    pub reads_context: bool,
    /// The zero-crossing function of each atom while no `solve` clause is active.
    pub zero_crossings_at_rest: Vec<ZeroCrossing>,
}

impl Rule {
    /// True if the condition of a production asks for the sign of an atom.
    pub fn decides_productions(&self, atom: usize) -> bool {
        self.produces.iter().any(|produce| produce.guard.atoms().any(|(other, _)| other == atom))
    }

    /// True if the condition of a `solve` clause asks for the sign of an atom.
    pub fn decides_equations(&self, atom: usize) -> bool {
        self.solves.iter().any(|solve| solve.guard.atoms().any(|(other, _)| other == atom))
    }

    /// True if the behaviour of a module under this rule never changes: no conditions, no productions, at most one
    /// unconditional clause of equations without switches.
    pub fn is_plain(&self) -> bool {
        self.atoms.is_empty()
            && self.produces.is_empty()
            && self.solves.len() <= 1
            && self.solves.iter().all(|s| s.guard.is_always() && s.switches.is_empty())
    }

    /// Number of modules of its context.
    pub fn context_len(&self) -> usize {
        self.left.len() + self.right.len()
    }

    /// The zero-crossing function of each atom while a clause, or None, is active.
    pub fn zero_crossings(&self, solve: Option<usize>) -> &[ZeroCrossing] {
        solve.map_or(&self.zero_crossings_at_rest, |s| &self.solves[s].zero_crossings)
    }

    /// True if some clause has a value or an implicit equation.
    pub fn is_algebraic(&self) -> bool {
        self.solves.iter().any(|s| !s.algebraic.is_empty())
    }

    /// True if the rule has a context or aggregates.
    pub fn looks_around(&self) -> bool {
        !self.left.is_empty() || !self.right.is_empty() || !self.aggregates.is_empty()
    }

    /// Index of the variable `t`; `age` is the next one.
    pub fn time_variable(&self) -> usize {
        self.variables - 2
    }
}

/// A module of a context.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// The kinds that match, in ascending order.
    pub kinds: Vec<KindId>,
    /// Number of written parameters.
    pub arity: usize,
    /// Number of parameters, hidden ones included.
    pub width: usize,
}

impl Pattern {
    /// True if a module of this kind can stand at this place.
    pub fn matches(&self, kind: KindId) -> bool {
        self.kinds.binary_search(&kind).is_ok()
    }
}

/// A `solve` clause.
#[derive(Clone, Debug)]
pub struct Solve {
    /// The condition under which the clause is active.
    pub guard: Condition,
    /// The place of the clause in the text.
    pub span: Span,
    /// Conditions inside the equations (`if`, `min`, `max`, `abs`, `sign`).
    pub switches: Vec<Switch>,
    /// By atom of the rule: true if the flow of these equations cannot bring its difference to zero, because the surface on
    /// which it is zero is invariant, as the limit of logistic growth is.
    pub unreachable: Vec<bool>,
    /// The terms of its equations that may have pulses.
    pub pulses: Pulses,
    /// Its equations, compiled once for rules that differ in names only.
    pub equations: Arc<Equations>,
}

impl Deref for Solve {
    type Target = Equations;

    fn deref(&self) -> &Equations {
        &self.equations
    }
}

/// The equations of a clause, with what the analysis found out about them.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Parameters with a derivative, in the order of the outputs of `rates`. Parameters without an equation, or with the
    /// derivative 0, are not listed; they stay constant.
    pub of: Vec<usize>,
    /// The derivatives, smooth in all variables while the switches do not change.
    pub rates: Program,
    /// The solution form of each equation, in the order of `of`.
    pub solution_forms: Vec<SolutionForm>,
    /// Indices in `of` of the equations that are integrated numerically.
    pub numeric: Vec<usize>,
    /// The rates of the `numeric` equations.
    pub numeric_rates: Program,
    /// The rates of the `numeric` equations as linear equations, if all are linear with constant coefficients.
    pub linear: Option<LinearRates>,
    /// Partial derivatives of all rates.
    pub jacobian: Jacobian,
    /// Parameters with a value or an equation instead of a rate.
    pub algebraic: Algebraic,
    /// The zero-crossing function of each atom of the rule while the clause is active.
    pub zero_crossings: Vec<ZeroCrossing>,
    /// True if the clock of an event at a rate runs under this clause and some of its equations are integrated numerically;
    /// clocks are integrated to a tolerance of their own.
    pub has_hazard_clock: bool,
    /// The components of the equations, and the variables that a step reads.
    pub stepping: Stepping,
}

impl Equations {
    /// True if every parameter of the clause has a rate that is integrated numerically.
    pub fn is_all_numeric(&self) -> bool {
        self.numeric.len() == self.of.len() && self.algebraic.is_empty()
    }
}

/// The terms of the equations of a clause that may have pulses: that are large for a time that may fall between two stages of a step. Terms that
/// are polynomials in what a step resolves have none.
#[derive(Clone, Debug, Default)]
pub struct Pulses {
    /// The terms of rates that are integrated numerically.
    pub rates: PulseTerms,
    /// The terms of rates with formulas, which are integrated numerically only if all are.
    pub formula_rates: PulseTerms,
    /// The terms of values.
    pub values: PulseTerms,
}

impl Pulses {
    /// True if no term may have pulses.
    pub fn is_empty(&self) -> bool {
        [&self.rates, &self.formula_rates, &self.values].iter().all(|terms| terms.terms.outputs() == 0)
    }
}

/// Terms of some expressions, each of which is a rate or a value, that may have pulses.
#[derive(Clone, Debug, Default)]
pub struct PulseTerms {
    /// One output each. First those of which the expressions are sums, then those of sums inside functions and products, and of equations `0 = g`.
    pub terms: Program,
    /// The number of terms of the first sort: an expression changes by as much as such a term does.
    pub outer: usize,
    /// By term: the variables that it reads.
    pub reads: Vec<Vec<usize>>,
    /// By term: true if it reads an aggregate of what jumps. What jumps elsewhere in equations is frozen ([`Switch`]).
    pub jumping: Vec<bool>,
    /// The expressions, with one more variable for each term behind all others, which is added to that term. In place of g, which are the last, stands an
    /// estimate of the change of the unknown: g divided by the sizes of its partial derivatives.
    pub disturbed: Program,
    /// The parameter that has each expression for a rate or a value.
    pub parameters: Vec<usize>,
    /// The number of expressions that are no equations.
    pub explicit: usize,
}

/// A condition inside an equation. A variable replaces it there, so that the equation is smooth between the instants at
/// which the condition changes.
#[derive(Clone, Debug)]
pub struct Switch {
    /// The variable is 1 while this holds, and 0 otherwise.
    pub condition: Condition,
}

/// A `produce` clause.
#[derive(Clone, Debug)]
pub struct Produce {
    /// The condition: the production applies at the first instant at which it holds.
    pub guard: Condition,
    /// The place of the clause in the text.
    pub span: Span,
    /// Identifies the production: `dlsys_tree::key`.
    pub key: u64,
    /// True if the clause is an error and not a production: it fires where the rate of another clause becomes negative.
    pub is_fault: bool,
    /// The possible successors.
    pub outcome: Outcome,
}

/// The successors of a production, one of which replaces the module.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The weight of each successor, if there are several.
    pub weights: Option<Program>,
    /// One successor without weights, otherwise one for each weight.
    pub successors: Vec<Successor>,
}

impl Outcome {
    /// True if two modules with the same values may get different successors.
    pub fn is_random(&self) -> bool {
        self.weights.is_some() || self.successors.iter().any(|s| !s.is_certain())
    }

    /// Identifies a successor among all those that can replace a module.
    pub fn production(key: u64, successor: usize) -> u64 {
        key.wrapping_add(successor as u64)
    }

    /// The variables that decide over something that jumps in its weights, arguments and draws; a variable may occur several times.
    pub fn jump_reads(&self) -> impl Iterator<Item = usize> + '_ {
        let strings = self.successors.iter().flat_map(Successor::programs);
        strings.chain(&self.weights).flat_map(Program::jump_reads)
    }

    /// The variables that its weights, arguments and draws read; a variable may occur several times.
    pub fn reads(&self) -> impl Iterator<Item = usize> + '_ {
        let strings = self.successors.iter().flat_map(Successor::programs);
        strings.chain(&self.weights).flat_map(Program::reads).copied()
    }
}

/// An `interpret` declaration: the modules that the turtle draws in place of one.
///
/// Its expressions read the module's parameters, then `t`, then `age`.
#[derive(Clone, Debug)]
pub struct Interpretation {
    /// The place of its head in the text.
    pub span: Span,
    /// The modules drawn.
    pub drawn: Successor,
}
