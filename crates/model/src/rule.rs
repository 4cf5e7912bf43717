//! Rules: what the text writes under one head.
//!
//! # Variables of a rule
//!
//! All expressions of a rule read the same variables, in this order: the parameters of the strict
//! predecessor, then its hidden ones ([`Kind::clocks`](super::Kind::clocks)); the same of the context modules, left to
//! right as written; one value for each [`Aggregate`]; `t`; `age`; then one truth value for each [`Switch`], or the
//! [`Draw`]s of a successor.

use super::{
    Aggregate, Algebraic, Boundary, Clock, Condition, ContextPart, Draw, Jacobian, KindId, LinearRates,
    NewClock, SolutionForm, Stepping, ZeroCrossing,
};
use dlsys_diagnostic::Span;
use dlsys_expr::{Program, Scratch, Value};

/// Context, equations and productions of one strict predecessor.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Its place among the rules of the model.
    pub index: usize,
    /// The head as written.
    pub label: String,
    /// Where the head is written.
    pub span: Span,
    /// It applies at the multiples of the model's period only, has no equations and one production.
    pub discrete: bool,
    /// Names of the strict predecessor's parameters, hidden ones last.
    pub parameters: Vec<String>,
    /// Names of the context's parameters, in the order of the variables.
    pub context_names: Vec<String>,
    /// Left context in reading order: the last one is the nearest.
    pub left: Vec<Pattern>,
    /// Right context in reading order: the first one is the nearest.
    pub right: Vec<Pattern>,
    /// How the right context stands: one after another, or on branches.
    pub right_shape: Vec<ContextPart>,
    /// Values of the modules attached to this one.
    pub aggregates: Vec<Aggregate>,
    /// The variable of the first of them. There may be more variables than aggregates; nobody reads those.
    pub first_aggregate: usize,
    /// Number of variables, switches excluded.
    pub variables: usize,
    /// Both sides of every comparison: `a` of atom i is output 2i, `b` is output 2i + 1.
    pub sides: Program,
    /// Which variables they read, by themselves or through aggregates.
    pub watched: Vec<bool>,
    /// Where each atom is written.
    pub atoms: Vec<Span>,
    /// The boundary of each atom, as in `x = s`, for messages.
    pub boundaries: Vec<Boundary>,
    /// In the order written: of those that hold, the first is active.
    pub solves: Vec<Solve>,
    /// In the order written: of those that hold at one instant, the first wins.
    pub produces: Vec<Produce>,
    /// How many of them are hidden.
    pub hidden: usize,
    /// Of events at a rate.
    pub clocks: Vec<Clock>,
    /// Variables of the context for which some rule has an equation.
    pub moving_context: Vec<usize>,
    /// Rates or conditions read some of them.
    pub reads_context: bool,
    /// How each atom is watched while no clause is active; the clauses say it for themselves.
    pub zero_crossings_at_rest: Vec<ZeroCrossing>,
}

impl Rule {
    /// True if modules under this rule do the same from their first instant to their last: no conditions, no
    /// productions, at most one clause of equations.
    pub fn is_plain(&self) -> bool {
        self.atoms.is_empty()
            && self.produces.is_empty()
            && self.solves.len() <= 1
            && self.solves.iter().all(|s| s.guard.is_always() && s.switches.is_empty())
    }

    /// Number of modules that its context consists of.
    pub fn context_len(&self) -> usize {
        self.left.len() + self.right.len()
    }

    /// How each atom is watched under a clause.
    pub fn zero_crossings(&self, solve: Option<usize>) -> &[ZeroCrossing] {
        solve.map_or(&self.zero_crossings_at_rest, |s| &self.solves[s].zero_crossings)
    }

    /// True if some parameter is given by a value or an equation instead of a rate.
    pub fn is_algebraic(&self) -> bool {
        self.solves.iter().any(|s| !s.algebraic.is_empty())
    }

    /// True if it looks at neighbours of the module.
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
    /// All kinds that match, ascending.
    pub kinds: Vec<KindId>,
    /// Number of parameters.
    pub arity: usize,
    /// With those that are hidden.
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
    /// The clause is active while this holds.
    pub guard: Condition,
    /// Where the clause is written.
    pub span: Span,
    /// Parameters that have a derivative, in the order of the outputs of `rates`. A parameter that is
    /// not named, or whose derivative is the constant 0, is not here: it stays as it is.
    pub of: Vec<usize>,
    /// The derivatives, smooth in all variables while the switches stand.
    pub rates: Program,
    /// Conditions inside the equations (`if`, `min`, `max`, `abs`, `sign`).
    pub switches: Vec<Switch>,
    /// Atoms that the flow of these equations cannot bring to zero, because the surface on which they
    /// are zero is invariant: a logistic growth and its own limit. One per atom of the rule.
    pub unreachable: Vec<bool>,
    /// How each equation is solved, in the order of `of`.
    pub solution_forms: Vec<SolutionForm>,
    /// Positions in `of` of the equations that are integrated numerically.
    pub numeric: Vec<usize>,
    /// Their rates.
    pub numeric_rates: Program,
    /// Their rates once more, if all are linear.
    pub linear: Option<LinearRates>,
    /// Derivatives of all rates.
    pub jacobian: Jacobian,
    /// Parameters with a value or an equation instead of a rate.
    pub algebraic: Algebraic,
    /// How the zero of each atom is found while the clause is active.
    pub zero_crossings: Vec<ZeroCrossing>,
    /// Rates depend on time in a way that may be over before a step notices: not as polynomials.
    pub has_pulses: bool,
    /// The clock of an event at a rate runs, and something is integrated numerically.
    pub has_hazard_clock: bool,
    /// The components of the equations, and the variables that a step reads.
    pub stepping: Stepping,
}

/// A condition inside an equation, replaced there by a variable, so that the equation is smooth between
/// the instants at which the condition changes.
#[derive(Clone, Debug)]
pub struct Switch {
    /// The variable is 1 while this holds, and 0 otherwise.
    pub condition: Condition,
}

/// A `produce` clause.
#[derive(Clone, Debug)]
pub struct Produce {
    /// The production applies at the instant at which this holds.
    pub guard: Condition,
    /// Where the clause is written.
    pub span: Span,
    /// Tells the productions of a rule apart: [`key`](dlsys_tree::key).
    pub key: u64,
    /// No production: the rate of another clause has become negative.
    pub is_fault: bool,
    /// The modules that take the place of this one.
    pub outcome: Outcome,
}

/// What takes a module's place.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The weight of each successor, if there are several.
    pub weights: Option<Program>,
    /// One, or as many as there are weights.
    pub successors: Vec<Successor>,
}

impl Outcome {
    /// True if what takes the place of two modules with the same values may differ.
    pub fn is_random(&self) -> bool {
        self.weights.is_some() || self.successors.iter().any(|s| !s.is_certain())
    }

    /// A number that tells the productions of a model apart that can replace one module.
    pub fn production(key: u64, successor: usize) -> u64 {
        key.wrapping_add(successor as u64)
    }

    /// What it reads.
    pub fn reads(&self) -> impl Iterator<Item = usize> + '_ {
        let draws = self.successors.iter().flat_map(|s| &s.draws).map(|draw| &draw.parameters);
        let arguments = self.successors.iter().map(|s| &s.arguments);
        arguments.chain(draws).chain(&self.weights).flat_map(Program::reads).copied()
    }
}

/// A string of modules whose arguments are computed when it is made.
#[derive(Clone, Debug, Default)]
pub struct Successor {
    /// In string order, with brackets.
    pub kinds: Vec<KindId>,
    /// The arguments of all modules, one after another, clocks left out. They read the draws, too.
    pub arguments: Program,
    /// The random numbers that the arguments read.
    pub draws: Vec<Draw>,
    /// In the order of the modules.
    pub clocks: Vec<NewClock>,
    /// The first modules, brackets left out, and where they stand in the text.
    pub places: Vec<(KindId, Span)>,
}

impl Successor {
    /// Of how many modules the place is kept: as many as a lineage tells apart.
    pub const PLACES: usize = 254;

    /// Where the module at a place stands in the text, if it is of this kind.
    pub fn place_of(&self, place: usize, kind: KindId) -> Option<Span> {
        self.places.get(place).filter(|(known, _)| *known == kind).map(|(_, span)| *span)
    }

    /// Number of the parameters of all its modules, hidden ones included.
    pub fn width(&self) -> usize {
        self.arguments.outputs() + self.clocks.len()
    }

    /// Computes the arguments of a string without chance.
    pub fn evaluate<T: Value>(&self, variables: &[T], scratch: &mut Scratch<T>, out: &mut Vec<T>) {
        out.clear();
        out.resize(self.arguments.outputs(), T::constant(0.0));
        self.arguments.eval(variables, scratch, out);
    }

    /// True if its arguments follow from the values of the predecessor.
    pub fn is_certain(&self) -> bool {
        self.draws.is_empty() && self.clocks.is_empty()
    }
}

/// An `interpret` declaration: what the turtle draws in place of a module.
///
/// Its expressions read the module's parameters, then `t`, then `age`.
#[derive(Clone, Debug)]
pub struct Interpretation {
    /// Where its head is written.
    pub span: Span,
    /// The modules that are drawn.
    pub drawn: Successor,
}
