//! Expressions, in one arena with operands before their users, so that passes over them are loops: a sum of a million terms is a million
//! nodes, not a million stack frames.

use std::sync::Arc;

use super::HeadModule;
use dlsys_diagnostic::Span;
use dlsys_expr::{Comparison, Fold};

/// A node of an expression, by its place in [`Expressions`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ExprId(pub u32);

/// A whole expression: its nodes are those from `first` to `root`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expression {
    /// The node that was read first.
    pub first: ExprId,
    /// The node of the whole expression.
    pub root: ExprId,
}

/// An operator between two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// `a + b`
    Add,
    /// `a - b`
    Sub,
    /// `a*b`
    Mul,
    /// `a/b`
    Div,
    /// `a^b`
    Pow,
    /// `a & b`, of conditions.
    And,
    /// `a | b`, of conditions.
    Or,
}

/// A node of an expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expr {
    /// A number as written, always finite and without a sign.
    Number(f64),
    /// A constant, parameter or variable.
    Name(Arc<str>),
    /// A function and its arguments.
    Call(Arc<str>, Vec<ExprId>),
    /// `-a`
    Negate(ExprId),
    /// `!a`, of a condition.
    Not(ExprId),
    /// `a + b` and the like.
    Binary(Operator, ExprId, ExprId),
    /// `2c`: a number written directly before its factor.
    Scale(f64, ExprId),
    /// `a < b <= c`
    Compare(ExprId, Vec<(Comparison, ExprId)>),
    /// Condition, then, else.
    If(ExprId, ExprId, ExprId),
    /// `match n case a: x … else y`: the number, each case with its value, and the value if no case matches.
    Match(ExprId, Vec<(ExprId, ExprId)>, ExprId),
    /// `a[i]`
    Index(Arc<str>, ExprId),
    /// `(a)`; kept so that printing preserves the parentheses.
    Parenthesis(ExprId),
    /// `sum(B(x, c): D*(c - c_0))`
    Aggregate(Box<Aggregate>),
}

/// An aggregate of the modules attached to one, over those that match a head.
#[derive(Clone, Debug, PartialEq)]
pub struct Aggregate {
    /// How the values are combined.
    pub fold: Fold,
    /// The modules that count, with names for their parameters.
    pub head: HeadModule,
    /// The term of one module; its nodes precede that of the aggregate. None for `count`.
    pub term: Option<Expression>,
}

/// The arena of all expressions of a document.
#[derive(Clone, Debug, Default)]
pub struct Expressions {
    nodes: Vec<Expr>,
    spans: Vec<Span>,
}

impl Expressions {
    /// Adds a node whose operands are already in the arena.
    pub fn push(&mut self, node: Expr, span: Span) -> ExprId {
        self.nodes.push(node);
        self.spans.push(span);
        ExprId(self.nodes.len() as u32 - 1)
    }

    /// The id that the next node will get.
    pub fn next(&self) -> ExprId {
        ExprId(self.nodes.len() as u32)
    }

    /// Removes the nodes from `first` on, and gives them.
    pub(crate) fn split_off(&mut self, first: ExprId) -> Expressions {
        let from = first.0 as usize;
        Expressions { nodes: self.nodes.split_off(from), spans: self.spans.split_off(from) }
    }

    /// The nodes from `first` on, with their places.
    pub(crate) fn since(&self, first: ExprId) -> (&[Expr], &[Span]) {
        (&self.nodes[first.0 as usize..], &self.spans[first.0 as usize..])
    }

    /// A node of this arena.
    pub fn get(&self, id: ExprId) -> &Expr {
        &self.nodes[id.0 as usize]
    }

    /// A node of this arena, to be changed.
    pub fn get_mut(&mut self, id: ExprId) -> &mut Expr {
        &mut self.nodes[id.0 as usize]
    }

    /// The place of a node in the text.
    pub fn span(&self, id: ExprId) -> Span {
        self.spans[id.0 as usize]
    }

    /// All nodes, operands before their users.
    pub fn iter(&self) -> impl Iterator<Item = &Expr> {
        self.nodes.iter()
    }

    /// The nodes from `first` on that begin in the text before the end of `last`, or all of them if that is None.
    pub fn iter_within(&self, first: ExprId, last: Option<Span>) -> impl Iterator<Item = &Expr> {
        let end = last.map_or(u32::MAX, |span| span.end);
        let from = first.0 as usize;
        self.nodes[from..]
            .iter()
            .zip(&self.spans[from..])
            .take_while(move |(_, s)| s.start < end)
            .map(|n| n.0)
    }

    /// Widens the place of a node in the text, as parentheses do.
    pub fn widen(&mut self, id: ExprId, span: Span) {
        self.spans[id.0 as usize] = self.spans[id.0 as usize].to(span);
    }
}
