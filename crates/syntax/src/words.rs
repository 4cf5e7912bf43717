//! The words of the language, for programs that colour, complete or count them.

pub use crate::declarations::words as declarations;
use crate::declarations::{Declaration, Follow, options};
pub use crate::lexeme::{in_name, number_length};

/// Words that begin a part of a rule, and `then` and `else`, which may begin a line of an expression.
pub const CLAUSES: [&str; 8] = ["if", "then", "else", "solve", "produce", "or", "at", "let"];

/// The aggregates over the modules attached to one: `sum(B(x): x)`.
pub const FOLDS: [&str; 4] = ["sum", "count", "largest", "smallest"];

/// Words within rules and expressions that are keywords in certain places only.
const WITHIN_RULES: [&str; 4] = ["rate", "for", "match", "case"];

/// Words that are keywords in certain places only and never end a declaration: those of all rules and expressions, and those
/// within the declaration that `first` begins. A word may be listed several times.
pub fn particles(first: &str) -> impl Iterator<Item = &'static str> {
    let own = Declaration::of_word(first).map_or(&[][..], |declaration| declaration.options);
    let everywhere = options().filter(|option| option.follow == Follow::ValueEverywhere);
    let open = own.iter().filter(|option| option.follow != Follow::Nothing);
    everywhere.chain(open).map(|option| option.word).chain(WITHIN_RULES)
}

/// Words that end the declaration that `first` begins.
pub fn endings(first: &str) -> impl Iterator<Item = &'static str> {
    let own = Declaration::of_word(first).map_or(&[][..], |declaration| declaration.options);
    own.iter().filter(|option| option.follow == Follow::Nothing).map(|option| option.word)
}
