//! Declared rules: names resolved and expressions in the graph, but not yet compiled or analysed.
//!
//! ```text
//! ast::Rule ──rules──▶ DeclaredRule ──contexts──▶ ResolvedRule ──analysis──▶ model::Rule
//! ```
//!
//! A [`DeclaredRule`] is built while the document is lowered, before all kinds of modules are known, so its contexts are
//! names. A [`ResolvedRule`] adds the kinds that match them. Variables are numbered as in a compiled rule
//! ([`dlsys_model::Rule`]).

use dlsys_diagnostic::Span;
use dlsys_expr::{Fold, NodeId};
use dlsys_model::{Boundary, Clock, Condition, ContextPart, Pattern, Produce, Switch};
use dlsys_syntax::ast::HeadModule;

/// Context, equations and productions under one head.
pub struct DeclaredRule {
    /// Its index among the rules of the model.
    pub index: usize,
    /// The text of the head.
    pub label: String,
    pub span: Span,
    /// True for a discrete rule, which applies at the multiples of the model's period only.
    pub discrete: bool,
    /// Names of the strict predecessor's parameters, hidden ones last.
    pub parameters: Vec<String>,
    /// Names of the context's parameters, in the order of the variables.
    pub context_names: Vec<String>,
    pub left: Vec<DeclaredPattern>,
    pub right: Vec<DeclaredPattern>,
    pub right_shape: Vec<ContextPart>,
    pub aggregates: Vec<DeclaredAggregate>,
    /// The variable of the first aggregate.
    pub first_aggregate: usize,
    /// Number of variables, switches excluded.
    pub variables: usize,
    /// Both sides of each comparison (atom).
    pub sides: Vec<(NodeId, NodeId)>,
    /// The place of each atom in the text.
    pub atoms: Vec<Span>,
    pub boundaries: Vec<Boundary>,
    /// By atom: true if it is a part of a comparison of a whole part or a sign.
    pub jumping: Vec<bool>,
    pub solves: Vec<DeclaredSolve>,
    pub produces: Vec<Produce>,
    /// Number of hidden parameters of the strict predecessor.
    pub hidden: usize,
    pub clocks: Vec<Clock>,
}

impl DeclaredRule {
    /// Number of the strict predecessor's parameters, hidden ones included.
    pub fn own(&self) -> usize {
        self.parameters.len()
    }

    /// The variable `t`; `age` is the next one.
    pub fn time(&self) -> usize {
        self.variables - 2
    }

    /// True if some clause has an equation for this parameter of the strict predecessor.
    pub fn moves(&self, parameter: usize) -> bool {
        self.solves.iter().any(|solve| solve.moves(parameter))
    }

    /// The terms of the aggregates, in their order.
    pub fn terms(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.aggregates.iter().map(|aggregate| aggregate.term)
    }

    /// Both sides of all atoms.
    pub fn side_nodes(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.sides.iter().flat_map(|(a, b)| [*a, *b])
    }

    /// All parameters with their rates, of all clauses.
    pub fn rates(&self) -> impl Iterator<Item = (usize, NodeId)> + '_ {
        self.solves.iter().flat_map(|solve| &solve.rates).copied()
    }

    /// All values and implicit equations, of all clauses.
    pub fn algebraic(&self) -> impl Iterator<Item = &DeclaredAlgebraic> {
        self.solves.iter().flat_map(|solve| &solve.algebraic)
    }
}

/// A module of a context, by name.
pub struct DeclaredPattern {
    pub head: HeadModule,
    /// Number of its parameters, hidden ones included.
    pub width: usize,
}

/// `sum(B(x, c): …)`
pub struct DeclaredAggregate {
    pub fold: Fold,
    pub pattern: DeclaredPattern,
    /// The value of one child. It reads the variables of the rule, then the parameters of the child.
    pub term: NodeId,
}

/// A `solve` clause.
pub struct DeclaredSolve {
    pub guard: Condition,
    pub span: Span,
    /// Parameters with their rates; a rate that is the constant 0 is left out.
    pub rates: Vec<(usize, NodeId)>,
    /// Parameters with a value or an equation instead of a rate, explicit ones first.
    pub algebraic: Vec<DeclaredAlgebraic>,
    pub switches: Vec<Switch>,
    /// By atom: true if the flow of these equations cannot bring its difference to zero.
    pub unreachable: Vec<bool>,
}

impl DeclaredSolve {
    /// True if the clause has an equation for this parameter.
    pub fn moves(&self, parameter: usize) -> bool {
        self.moved().any(|moved| moved == parameter)
    }

    /// The parameters that have a rate, a value or an equation.
    pub fn moved(&self) -> impl Iterator<Item = usize> + '_ {
        self.rates.iter().map(|rate| rate.0).chain(self.algebraic.iter().map(|entry| entry.parameter))
    }
}

/// `x = f`, or `0 = g` to be solved for x.
#[derive(Clone, Debug)]
pub struct DeclaredAlgebraic {
    pub parameter: usize,
    /// f or g.
    pub node: NodeId,
    pub explicit: bool,
    pub span: Span,
}

/// A rule with the kinds of modules that its contexts and aggregates match.
pub struct ResolvedRule {
    pub declared: DeclaredRule,
    pub left: Vec<Pattern>,
    pub right: Vec<Pattern>,
    /// The patterns of the aggregates.
    pub children: Vec<Pattern>,
}

impl ResolvedRule {
    /// The modules of the context in the order of their variables.
    pub fn context(&self) -> impl Iterator<Item = &Pattern> {
        self.left.iter().chain(&self.right)
    }
}
