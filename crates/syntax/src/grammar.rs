//! The pest parser of `grammars/dlsys.pest`, and its rules.

/// The parser that pest derives.
#[allow(missing_docs)] // The enum that pest derives has no documentation.
mod derived {
    #[derive(pest_derive::Parser)]
    #[grammar = "../grammars/dlsys.pest"]
    pub struct Grammar;
}

pub(crate) use derived::{Grammar, Rule};

/// What the parser makes of a piece of text.
pub(crate) type Pair<'i> = pest::iterators::Pair<'i, Rule>;
