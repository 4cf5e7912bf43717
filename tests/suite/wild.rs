//! The models of the repository, including the ones with mistakes, with random changes, which are the same in every run.
//!
//! Reading any text ends with a model or with messages that can be rendered, never with a panic.
//! [`layout`](super::layout) formats these texts.

use std::path::PathBuf;

use dlsys::diagnostic::Severity;
use dlsys::session::Session;

use crate::common::models;
use crate::dice::Dice;

/// The texts of all models, with their paths.
pub fn texts() -> Vec<(PathBuf, String)> {
    let text = |path: PathBuf| {
        let bytes = std::fs::read(&path).expect("readable");
        String::from_utf8(bytes).ok().map(|text| (path, text))
    };
    models().into_iter().filter_map(text).collect()
}

/// A place between two characters.
fn place(text: &str, dice: &mut Dice) -> usize {
    let mut at = dice.below(text.len() + 1);
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// What may stand behind a number, in front of one, or in its place.
const NUMBERS: [&str; 22] = [
    "1e2x",
    "2e3r",
    "1e9floor(t)",
    "1e2",
    "1E+2x",
    "3e-4(x)",
    "2ex",
    "2e",
    "2e_1",
    "2e2e2",
    "1.5e2.5",
    "1..2",
    "5.",
    ".5",
    "0x1F",
    "1_000",
    "2₁",
    "2x₁",
    "2²",
    "2if x < 1 then 1 else 0",
    "3sum(F(x): x)",
    "007",
];

/// Tokens of the language and of others, and white space of all kinds.
const ODD: [&str; 76] = [
    "#",
    "\"",
    "\"a # b\"",
    "'",
    "@",
    "@ L",
    "@L",
    "±",
    "+",
    "-",
    "->",
    "-->",
    "→",
    "- >",
    "..",
    "...",
    ".",
    "==",
    "&&",
    "||",
    "!=",
    "! =",
    "!",
    "≤",
    "< =",
    "·",
    "**",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    ";",
    "%",
    "|",
    "\\",
    "$",
    "~",
    "ε",
    "epsilon",
    "if",
    "then",
    "else",
    "solve",
    "produce",
    "or",
    "at rate",
    "at",
    "let",
    "match",
    "case 0:",
    "for",
    "step",
    "in",
    "string",
    "strength",
    "sum(",
    "count(",
    "periodic",
    "title",
    "ignore",
    "def",
    "\t",
    "\u{a0}",
    "\u{2003}",
    "\r",
    "\n",
    "\r\n",
    "\n\n\n",
    "\u{308}",
    "é",
    "e\u{301}",
    "\u{200b}",
];

/// Expressions and modules that mean something somewhere.
const EXPRESSIONS: [&str; 40] = [
    "slope(f, 1)",
    "slope(g, x)",
    "inverse(g, 2)",
    "inverse(logistic, 0.5)",
    "integral(g, 0, 1)",
    "length(a)",
    "a[10]",
    "a[-1]",
    "a[x]",
    "uniform(0, 1)",
    "normal(0, 1)",
    "choice(1, 2)",
    "integer(1, 2)",
    "sum(A(x): x)",
    "count(A(x))",
    "largest(B: 1)",
    "t",
    "age",
    "(x > 0)",
    "(if x > 0 then 1 else 0)",
    "match x case 0: 1 else 2",
    "1/0",
    "sqrt(-1)",
    "1e400",
    "floor(t)",
    "min(x, 1)",
    "f(x)",
    "f(f(x))",
    "max(1)",
    "nowhere",
    "A(x)",
    "A",
    "F(x)[+F]",
    "% ",
    "at rate 2 produce A",
    "solve x = 1",
    "solve 0 = x - 1 for x",
    "produce 1: A or 2: F(x)",
    "let y = 2",
    "[ A ]",
];

/// A text with one to five random changes.
pub fn changed(text: &str, dice: &mut Dice) -> String {
    let mut text = text.to_owned();
    for _ in 0..=dice.below(4) {
        let at = place(&text, dice);
        match dice.below(11) {
            kind @ 0..=4 => put_in(&mut text, at, kind, dice),
            kind => replace(&mut text, at, kind, dice),
        }
    }
    text
}

/// One of the next places at which a word or a number begins or ends.
fn edge(text: &str, at: usize, dice: &mut Dice) -> usize {
    let edges: Vec<usize> = (text[at..].char_indices().zip(text[at..].chars().skip(1)))
        .filter(|((_, a), b)| a.is_alphanumeric() != b.is_alphanumeric())
        .map(|((i, a), _)| at + i + a.len_utf8())
        .take(8)
        .collect();
    edges.get(dice.below(edges.len())).copied().unwrap_or(at)
}

/// The end of the stretch from `start` on in which every character has a property.
fn end_of(text: &str, start: usize, has: impl Fn(char) -> bool) -> usize {
    text[start..].find(|c: char| !has(c)).map_or(text.len(), |i| start + i)
}

/// Something odd at a place, a number, or other white space.
fn put_in(text: &mut String, at: usize, kind: usize, dice: &mut Dice) {
    match kind {
        0 => text.insert_str(at, dice.pick(&ODD)),
        1 => {
            let at = edge(text, at, dice);
            text.insert_str(at, dice.pick(&ODD));
        }
        2 => {
            // A number with something that is glued to it.
            if let Some(start) = text[at..].find(|c: char| c.is_ascii_digit()).map(|i| at + i) {
                let end = end_of(text, start, |c| c.is_ascii_digit());
                let start = if dice.below(2) == 0 { end } else { start };
                text.replace_range(start..end, dice.pick(&NUMBERS));
            }
        }
        3 => {
            let at = edge(text, at, dice);
            text.insert_str(at, dice.pick(&[" ", "  ", "\t", "\n", "\n  ", "\r\n", " \n\n "]));
        }
        _ => {
            // White space that is gone.
            if let Some(start) = text[at..].find(char::is_whitespace).map(|i| at + i) {
                let end = end_of(text, start, char::is_whitespace);
                text.replace_range(start..end, dice.pick(&["", "", " "]));
            }
        }
    }
}

/// Less text, or text of another place.
fn replace(text: &mut String, at: usize, kind: usize, dice: &mut Dice) {
    let after =
        |text: &str, count: usize| text[at..].char_indices().nth(count).map_or(text.len(), |(i, _)| at + i);
    match kind {
        5 => {
            let end = after(text, 1 + dice.below(5));
            text.replace_range(at..end, "");
        }
        6 => {
            // Something of the text, elsewhere.
            let end = after(text, 1 + dice.below(40));
            let copy = text[at..end].to_owned();
            let to = place(text, dice);
            text.insert_str(to, &copy);
        }
        7 | 8 => {
            // A word that is another.
            let in_word = |c: char| c.is_alphanumeric() || c == '_';
            if let Some(start) = text[at..].find(in_word).map(|i| at + i) {
                let end = end_of(text, start, in_word);
                let words: Vec<&str> = text.split(|c| !in_word(c)).filter(|w| !w.is_empty()).collect();
                let other = dice.pick(&words).to_owned();
                text.replace_range(start..end, &other);
            }
        }
        9 => {
            // A term, a parameter or a module that is another.
            if let Some(start) = text[at..].find(char::is_alphanumeric).map(|i| at + i) {
                let end = end_of(text, start, |c| c.is_alphanumeric() || "_.".contains(c));
                text.replace_range(start..end, dice.pick(&EXPRESSIONS));
            }
        }
        _ => {
            let mut lines: Vec<&str> = text.split_inclusive('\n').collect();
            let (a, b) = (dice.below(lines.len()), dice.below(lines.len()));
            if !lines.is_empty() {
                lines.swap(a, b);
            }
            *text = lines.concat();
        }
    }
}

#[test]
fn changed_texts_are_read_or_get_their_messages() {
    read_or_refuse(8);
}

#[test]
#[ignore = "slow: tens of thousands of texts"]
fn very_many_changed_texts_are_read_or_get_their_messages() {
    read_or_refuse(1);
}

/// Reads one in `share` of tens of thousands of changed texts.
fn read_or_refuse(share: usize) {
    let mut dice = Dice(7);
    let (mut read, mut refused, mut panics) = (0, 0, Vec::new());
    for (path, text) in &texts() {
        let folder = path.parent().expect("a folder");
        for _ in 0..(60_000 / text.len().max(100)).clamp(10, 120) / share {
            let other = changed(text, &mut dice);
            let reading = || Session::from_text_in(folder, &[], "m.dls", &other, &[]);
            let Ok(done) = std::panic::catch_unwind(reading) else {
                panics.push(other);
                continue;
            };
            match done {
                Ok(session) => {
                    read += 1;
                    for warning in &session.warnings {
                        assert_eq!(warning.severity, Severity::Warning, "{other}");
                        assert!(!warning.render(&session.source, false).is_empty());
                    }
                }
                Err(fault) => {
                    refused += 1;
                    let errors = fault.diagnostics.iter().filter(|d| d.severity == Severity::Error);
                    assert!(errors.count() > 0, "refused without a word:\n{other}");
                    for said in &fault.diagnostics {
                        assert!(!said.render(&fault.source, false).is_empty());
                    }
                }
            }
        }
    }
    assert!(panics.is_empty(), "{} texts, such as\n{}", panics.len(), panics[0]);
    assert!(read > 3000 / share && refused > 10_000 / share, "{read} {refused}");
}
