//! Look-ahead over the tokens of a line: the colon of a rule, the arrow of a discrete rule, the rate of a clause, the
//! weight of a successor.

use super::{ItemKind, Last, Scanner};
use crate::lexeme::{Token, in_name};

impl Scanner<'_> {
    /// True if a `:` stands on the line outside parentheses opened on it, and before any `produce` or arrow (a colon behind
    /// those ends a weight).
    pub(super) fn has_colon(&self, tokens: &[(Token, usize, usize)]) -> bool {
        let mut depth = 0i64;
        for &token in tokens {
            match token.0 {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                Token::Colon if depth <= 0 => return true,
                Token::Word if depth <= 0 && self.word(token) == "produce" => return false,
                Token::Symbol if depth <= 0 && self.is_arrow(token.1, token.2) => return false,
                _ => {}
            }
        }
        false
    }

    /// The byte at which the arrow of a discrete rule begins, if the line has one.
    pub(super) fn arrow_outside_parentheses(&self, tokens: &[(Token, usize, usize)]) -> Option<usize> {
        let mut depth = 0i64;
        for (i, &(token, start, end)) in tokens.iter().enumerate() {
            match token {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                Token::Symbol if depth > 0 => {}
                Token::Symbol if self.text[start..end].starts_with('→') => return Some(start),
                Token::Symbol if self.ends_arrow(start) => {
                    // `-->` is also an arrow.
                    let long = i > 1 && tokens[i - 2].2 + 1 == start && self.text[..start].ends_with("--");
                    return Some(start - if long { 2 } else { 1 });
                }
                _ => {}
            }
        }
        None
    }

    /// True for the `>` of an arrow.
    fn ends_arrow(&self, at: usize) -> bool {
        self.text[at..].starts_with('>') && self.text[..at].ends_with('-')
    }

    /// True if the token is an arrow, or the `>` that ends one.
    pub(super) fn is_arrow(&self, start: usize, end: usize) -> bool {
        &self.text[start..end] == "→" || self.ends_arrow(start)
    }

    /// True if the head or the condition of a rule must continue: the line before ends with an operator or a colon.
    pub(super) fn goes_on(&self) -> bool {
        let in_rule = self.items.last().is_some_and(|i| i.kind == ItemKind::Rule && i.after_colon.is_some());
        in_rule
            && !self.in_string
            && self.levels.len() == 1
            && matches!(self.last, Last::Colon | Last::Operator)
    }

    /// True if a line continues the successors of a clause with a weight and its colon. A head begins neither with a number
    /// nor with a parenthesis, and cannot stand where a weight is required.
    pub(super) fn goes_on_with_weight(&self, tokens: &[(Token, usize, usize)]) -> bool {
        let Some(&first) = tokens.first() else { return false };
        let begins = matches!(first.0, Token::Number | Token::Open) && (self.weighted || self.weight_next);
        let or = self.word(first) == "or";
        self.in_successor() && (begins || self.weighted && (or || self.weight_next))
    }

    /// True in a successor of a rule, outside parentheses.
    pub(super) fn in_successor(&self) -> bool {
        let in_rule = self.items.last().is_some_and(|i| matches!(i.kind, ItemKind::Rule | ItemKind::Step));
        in_rule && self.in_string && self.levels.len() == 1
    }

    /// True if the word at these bytes begins `at rate`.
    pub(super) fn is_at_rate(&self, start: usize, end: usize) -> bool {
        let next = self.text[end..].trim_start_matches([' ', '\t']);
        let in_rule = self.items.last().is_some_and(|i| i.kind == ItemKind::Rule && i.after_colon.is_some());
        in_rule
            && &self.text[start..end] == "at"
            && next.strip_prefix("rate").is_some_and(|rest| !rest.starts_with(in_name))
    }

    pub(super) fn follows_at(&self, start: usize) -> bool {
        let before = self.text[..start].trim_end_matches([' ', '\t']).strip_suffix("at");
        before.is_some_and(|rest| !rest.ends_with(in_name))
    }
}
