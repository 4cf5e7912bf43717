//! The tokens that the first pass over the text makes ([`layout`](super::layout)). Numbers and names end where those of the
//! grammar end; symbols of several characters are cut into their characters.

use pest::unicode::MARK;

/// The kind of a token, determined by its characters alone.
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

/// A token and its surroundings, for the formatter.
#[derive(Clone, Copy, Debug)]
pub struct Lexeme {
    pub token: Token,
    pub start: usize,
    pub end: usize,
    /// True in a string of modules, outside parentheses.
    pub in_string: bool,
    /// True if the token before it can end an expression, so that a sign here is a binary operator.
    pub after_operand: bool,
    /// True if it cannot end an expression: an operator, or a word that works as one.
    pub operator: bool,
    /// True for the parentheses of a repetition or a condition in a string, and for the words of these.
    pub group: bool,
    /// Number of parentheses that are open around it.
    pub depth: usize,
}

/// The length of the number that a text begins with, 0 if it begins with none: digits, a fraction, an exponent, each as
/// far as it goes. It is the `number` of the grammar: `1e2x` is `1e2` times `x`, and `2ex` is 2 times `ex`.
pub fn number_length(text: &str) -> usize {
    let text = text.as_bytes();
    let digits = |from: usize| text[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(0);
    if end == 0 {
        return 0;
    }
    if text.get(end) == Some(&b'.') && text.get(end + 1).is_some_and(u8::is_ascii_digit) {
        end += 1 + digits(end + 1);
    }
    if matches!(text.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(text.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(text.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

/// True if a name continues with this character. Combining marks belong to the letter before them. The grammar excludes
/// some alphanumeric characters from names, such as `²`; they occur nowhere else in a valid text.
pub fn in_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || !c.is_ascii() && (c.is_alphanumeric() || MARK(c))
}

/// The end of the characters of a name from a byte on.
pub fn name_end(text: &str, from: usize) -> usize {
    let bytes = text.as_bytes();
    let mut end = from;
    while let Some(&byte) = bytes.get(end) {
        if byte.is_ascii() {
            if !(byte.is_ascii_alphanumeric() || byte == b'_') {
                break;
            }
            end += 1;
        } else {
            match text[end..].chars().next() {
                Some(c) if in_name(c) => end += c.len_utf8(),
                _ => break,
            }
        }
    }
    end
}

/// The symbols that may have a subscript: `+_l(a)` is a turn with a name of its own.
pub const SUBSCRIPTED: &str = "±+-&^\\/|$!;";

/// True if the text behind a symbol begins with a subscript.
pub fn has_subscript(text: &str) -> bool {
    text.strip_prefix('_').is_some_and(|rest| rest.starts_with(in_name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grammar::{Grammar, Rule};
    use pest::Parser;

    /// The scanner and the grammar agree on the ends of numbers and names.
    #[test]
    fn numbers_and_names_end_where_the_grammar_ends_them() {
        let endings = [
            "", "e", "E5", "e+", "e-3", "e+07x", ".", "..", ".5", ".5e", ".5e1.5", "x", "e2x", "(", "_", "²",
        ];
        for start in ["", "0", "10", "x", "x1", "e2", "größe", "gro\u{308}ße", "\u{308}if", "x₁", "τ_0"]
        {
            for ending in endings {
                let text = format!("{start}{ending}");
                let number =
                    Grammar::parse(Rule::number, &text).map_or(0, |mut p| p.next().unwrap().as_str().len());
                assert_eq!(number_length(&text), number, "{text}");
                let name =
                    Grammar::parse(Rule::ident, &text).map_or(0, |mut p| p.next().unwrap().as_str().len());
                if name > 0 && !text.contains('²') {
                    assert_eq!(text.find(|c| !in_name(c)).unwrap_or(text.len()), name, "{text}");
                }
            }
        }
    }
}
