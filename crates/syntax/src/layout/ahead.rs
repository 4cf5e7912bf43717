//! Look-ahead over the tokens of a line: the colon of a rule, the arrow of a discrete rule, the rate of a clause, the
//! weight of a successor.

use super::{ItemKind, Last, Scanner};
use crate::lexeme::{Token, in_name};

/// Words that do not begin a value.
const ENDS: [&str; 7] = ["then", "else", "case", "solve", "produce", "at", "in"];

impl Scanner<'_> {
    /// True if a `:` stands on the line outside parentheses opened on it, and before any `produce` or arrow (a colon behind
    /// those ends a weight) and not behind a `case`, which a line may have that goes on with the expression of the line before.
    pub(super) fn has_colon(&self, tokens: &[(Token, usize, usize)]) -> bool {
        let (mut depth, mut cases) = (0i64, 0usize);
        let mut matches = self.matching || self.level_matches();
        // A head has neither `for NAME in` nor `if`.
        let mut in_string = self.in_string || self.levels.len() > 1;
        for (i, &token) in tokens.iter().enumerate() {
            match token.0 {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                Token::Colon if cases > 0 => cases -= 1,
                Token::Colon if depth <= 0 => return true,
                Token::Word if self.word(token) == "match" => matches = true,
                Token::Word if matches && self.word(token) == "case" => {
                    cases += usize::from(self.is_of_case(tokens, i));
                }
                Token::Word if in_string && self.begins_group(tokens, i) => return false,
                Token::Word if self.word(token) == "solve" => in_string = false,
                Token::Word if depth <= 0 && self.word(token) == "produce" => return false,
                Token::Symbol if depth <= 0 && self.is_arrow(token.1, token.2) => return false,
                _ => {}
            }
        }
        false
    }

    /// True if a number, or a name, follows a `case`, which may also be the name of a parameter.
    fn is_of_case(&self, tokens: &[(Token, usize, usize)], case: usize) -> bool {
        let is_sign = |i: usize| tokens.get(i).is_some_and(|t| &self.text[t.1..t.2] == "-");
        let value = if is_sign(case + 1) { case + 2 } else { case + 1 };
        let is_number = tokens.get(value).is_some_and(|t| t.0 == Token::Number);
        let is_name = tokens.get(value).is_some_and(|t| t.0 == Token::Word && !ENDS.contains(&self.word(*t)));
        is_number && (value == case + 1 || tokens[value].1 == tokens[case + 1].2)
            || is_name && value == case + 1
    }

    /// True if the second token of a line begins the value of a declaration, or the name of one: a number, `-` and what no
    /// string of modules has behind it, or `@NAME from`.
    pub(super) fn begins_value(&self, tokens: &[(Token, usize, usize)]) -> bool {
        let text = |i: usize| tokens.get(i).map_or("", |t| &self.text[t.1..t.2]);
        match tokens.get(1).map(|t| t.0) {
            Some(Token::Number) => true,
            Some(Token::Symbol) if text(1) == "@" => matches!(text(3), "from" | "with" | ""),
            Some(Token::Symbol) if text(1) == "-" => {
                let mut depth = 0i64;
                let mut commas = tokens.iter().filter(|token| {
                    depth += i64::from(token.0 == Token::Open) - i64::from(token.0 == Token::Close);
                    depth == 0 && token.0 == Token::Comma
                });
                tokens.get(2).is_some_and(|t| t.0 == Token::Number) || commas.next().is_some()
            }
            _ => false,
        }
    }

    /// True if the token begins a repetition or a condition in a string.
    pub(super) fn begins_group(&self, tokens: &[(Token, usize, usize)], at: usize) -> bool {
        match self.word(tokens[at]) {
            "for" => self.is_repetition(tokens[at].2),
            "if" => self.is_string_condition(tokens[at].2),
            _ => false,
        }
    }

    /// True if `NAME in` stands behind a `for` that ends at this byte.
    pub(super) fn is_repetition(&self, end: usize) -> bool {
        let rest = self.text[end..].trim_start_matches(is_space);
        let after = rest.trim_start_matches(in_name);
        let name = &rest[..rest.len() - after.len()];
        let next = after.trim_start_matches(is_space);
        name.starts_with(char::is_alphabetic)
            && next.len() < after.len()
            && next.strip_prefix("in").is_some_and(|rest| !rest.starts_with(in_name))
    }

    /// True if the condition behind an `if` that ends at this byte ends with a colon, so that a string depends on it; that of
    /// a clause ends with `solve`, `produce` or `at rate`.
    pub(super) fn is_string_condition(&self, end: usize) -> bool {
        /// Longer conditions are those of clauses, which bounds the work.
        const LONGEST: usize = 10_000;
        let (mut depth, mut ifs) = (0usize, 0usize);
        // True behind a token that can end an expression.
        let mut ended = false;
        let mut rest = self.text[end..].char_indices().take_while(|(i, _)| *i < LONGEST).peekable();
        while let Some((i, c)) = rest.next() {
            match c {
                '(' | '[' => depth += 1,
                ')' | ']' if depth == 0 => return false,
                ')' | ']' => depth -= 1,
                ':' if depth == 0 => return true,
                '"' | ';' | '{' | '}' | '@' => return false,
                '#' => while rest.next_if(|(_, c)| *c != '\n').is_some() {},
                '\n' if depth == 0 && ended => {
                    let next = self.text[end + i..].trim_start();
                    if !["then", "else", "case", ":"].iter().any(|word| next.starts_with(word)) {
                        return false;
                    }
                }
                c if c.is_alphabetic() => {
                    let word: &str = self.text[end + i..].split(|c| !in_name(c)).next().unwrap_or_default();
                    while rest.next_if(|(j, _)| *j < i + word.len()).is_some() {}
                    match word {
                        "solve" | "produce" if depth == 0 => return false,
                        "if" => ifs += 1,
                        // That of this `if`, which is one within an expression.
                        "then" if ifs == 0 => return false,
                        "then" => ifs -= 1,
                        _ => {}
                    }
                }
                _ => {}
            }
            if !c.is_whitespace() && c != '#' {
                ended = in_name(c) || matches!(c, ')' | ']');
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
        let next = self.text[end..].trim_start_matches(is_space);
        let in_rule = self.items.last().is_some_and(|i| i.kind == ItemKind::Rule && i.after_colon.is_some());
        in_rule
            && &self.text[start..end] == "at"
            && next.strip_prefix("rate").is_some_and(|rest| !rest.starts_with(in_name))
    }

    pub(super) fn follows_at(&self, start: usize) -> bool {
        let before = self.text[..start].trim_end_matches(is_space).strip_suffix("at");
        before.is_some_and(|rest| !rest.ends_with(in_name))
    }
}

/// Space between the words of a line; other white space is an error.
pub(super) fn is_space(c: char) -> bool {
    matches!(c, ' ' | '\t' | '\r' | '\u{A0}')
}
