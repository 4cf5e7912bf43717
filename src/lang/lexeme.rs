//! The tokens that the first pass over the text makes ([`layout`](super::layout)), coarser than those of the grammar: a
//! number with a point is three.

/// What a stretch of the text is, as far as its characters tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Token {
    Word,
    Number,
    Text,
    Open,
    Close,
    Comma,
    Colon,
    Symbol,
}

/// A token and what it stands in, for those who lay a text out anew.
#[derive(Clone, Copy, Debug)]
pub struct Lexeme {
    pub token: Token,
    pub start: usize,
    pub end: usize,
    /// In a string of modules, outside parentheses.
    pub in_string: bool,
    /// What stands before it can end an expression: a sign here has two sides.
    pub after_operand: bool,
    /// It cannot end an expression: an operator, or a word that works as one.
    pub operator: bool,
    /// Open parentheses around it.
    pub depth: usize,
}
