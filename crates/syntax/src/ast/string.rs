//! Strings of modules: of initial strings, successors and drawings.

use std::sync::Arc;

use super::{Expression, Name};
use dlsys_diagnostic::Span;

/// A module of the initial string or of a successor.
#[derive(Clone, Debug, PartialEq)]
pub struct Module {
    /// The name with its mark, as in `F`, `@L` or `+`.
    pub name: Arc<str>,
    /// Name and arguments.
    pub span: Span,
    /// The values of its parameters.
    pub arguments: Vec<Expression>,
}

/// A part of a string of modules.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// A module.
    Module(Module),
    /// `for i in A .. B: ( … )`
    Repeat(Box<Repetition>),
    /// `if C: ( … ) else ( … )`
    If(Box<Conditional>),
}

/// A repeated part of a string: `for i in A .. B: ( … )`.
#[derive(Clone, Debug, PartialEq)]
pub struct Repetition {
    /// The name of the index, in the body only.
    pub index: Name,
    /// The first value of the index.
    pub from: Expression,
    /// The last value of the index.
    pub to: Expression,
    /// The string that is repeated.
    pub body: Vec<Part>,
    /// From `for` to the last `)`.
    pub span: Span,
}

/// A part of a string under a condition: `if C: ( … ) else ( … )`.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditional {
    /// The condition.
    pub condition: Expression,
    /// The string where it holds.
    pub then: Vec<Part>,
    /// The string where it does not; empty without an `else`.
    pub otherwise: Vec<Part>,
    /// From `if` to the last `)`.
    pub span: Span,
}

/// All modules of a string as written, those of repetitions once, those of both branches of a condition.
pub fn modules_of(parts: &[Part]) -> impl Iterator<Item = &Module> {
    let mut stack = vec![parts.iter()];
    std::iter::from_fn(move || {
        loop {
            match stack.last_mut()?.next() {
                None => drop(stack.pop()),
                Some(Part::Module(module)) => return Some(module),
                Some(Part::Repeat(repetition)) => stack.push(repetition.body.iter()),
                Some(Part::If(conditional)) => {
                    stack.push(conditional.otherwise.iter());
                    stack.push(conditional.then.iter());
                }
            }
        }
    })
}
