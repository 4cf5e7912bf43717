//! What a line is: a command, or text of the model; and when text of the model is complete.
//!
//! - `:word …` is a command, always, and so is `?`.
//! - A line that begins with a word of the language (`param`, `interpret`, …), or that has a `:` outside parentheses,
//!   is a declaration or a rule.
//! - A line that begins with `if`, `solve`, `produce`, `at` (rate) or `or` is one more clause of the rule that was typed last.
//! - A line that begins with the name of a command is that command. A module may be called like a command: then its rule
//!   is told by what follows the name, `(`, `<`, `>` or `:`.
//!
//! Text goes on over lines: as long as something is open, as long as lines are indented, and as long as they begin with a
//! clause. On a terminal a rule of several lines ends with an empty one.

use super::commands;
use crate::syntax::declarations::Declaration;
use crate::syntax::words;

/// What a line begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Nothing, or a remark.
    Blank,
    Command,
    /// A declaration or a rule.
    Model,
    /// A clause of a rule.
    Clause,
    Unknown,
}

/// A command, or a piece of a model, with the number of its first line (from 1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statement {
    pub kind: Line,
    pub text: String,
    pub line: usize,
}

/// The line without its remark.
fn code(line: &str) -> &str {
    let mut quoted = false;
    for (at, c) in line.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '#' if !quoted => return &line[..at],
            _ => {}
        }
    }
    line
}

/// The first word, and the rest without the space before it.
pub fn first_word(line: &str) -> (&str, &str) {
    let line = line.trim_start();
    let end = line.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(line.len());
    (&line[..end], line[end..].trim_start())
}

/// Tells what a line begins.
pub fn classify(line: &str) -> Line {
    if line.trim_start().starts_with('?') || line.trim_start().starts_with(':') {
        return Line::Command;
    }
    let body = code(line).trim();
    if body.is_empty() {
        return Line::Blank;
    }
    let (word, rest) = first_word(body);
    if words::CLAUSES.contains(&word) {
        return Line::Clause;
    }
    if words::declarations().any(|known| known == word) {
        return Line::Model;
    }
    let colon = has_colon(body);
    let apart = body.len() == word.len() || body[word.len()..].starts_with(char::is_whitespace);
    let head = rest.starts_with([':', '<', '>']) || rest.starts_with('(') && colon;
    if commands::find(word).is_some() && apart && !head {
        return Line::Command;
    }
    if colon || body.ends_with(['<', '>']) { Line::Model } else { Line::Unknown }
}

/// True if a `:` stands outside parentheses.
fn has_colon(text: &str) -> bool {
    let mut depth = 0i64;
    text.chars().any(|c| {
        depth += i64::from(c == '(') - i64::from(c == ')');
        c == ':' && depth <= 0
    })
}

/// True if text of a model needs more to come.
pub fn is_open(text: &str) -> bool {
    let body: String = text.lines().map(|line| code(line).to_owned() + "\n").collect();
    let mut depth = 0i64;
    for c in body.chars() {
        depth += i64::from(matches!(c, '(' | '[')) - i64::from(matches!(c, ')' | ']'));
    }
    let end = body.trim_end();
    let last = end.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or("");
    let waits = words::CLAUSES.contains(&last) || words::particles().any(|word| word == last);
    // The turtle's symbols may end a string; what may not, asks for an operand.
    let operator = end.ends_with([':', ',', '=', '*', '<', '>', '≤', '≥', '≠']) || end.ends_with("..");
    let clause = body.rmatch_indices(|c: char| !(c.is_alphanumeric() || c == '_')).count() > 0 && {
        let mut words = body.split(|c: char| !(c.is_alphanumeric() || c == '_')).rev();
        matches!(words.find(|word| words::CLAUSES.contains(word)), Some("if" | "at" | "let"))
    };
    depth > 0 || waits || operator || clause && has_colon(&body)
}

/// True if the line belongs to the text before it.
fn goes_on(text: &str, line: &str) -> bool {
    let indented = line.starts_with(char::is_whitespace);
    match classify(line) {
        Line::Blank => indented && !line.trim().is_empty(),
        Line::Clause => true,
        _ if indented => true,
        Line::Unknown => is_open(text),
        Line::Command | Line::Model => false,
    }
}

/// True if what was typed on a terminal can be taken as it is; otherwise Enter begins another line of it.
pub fn is_complete(input: &str) -> bool {
    let first = input.lines().find(|line| classify(line) != Line::Blank);
    match first.map(classify) {
        Some(Line::Model) => {}
        Some(Line::Clause) => return input.ends_with('\n') || !is_open(&format!("x: {input}")),
        _ => return true,
    }
    let last = input.rsplit('\n').next().unwrap_or("");
    if input.contains('\n') && last.trim().is_empty() {
        return true;
    }
    let several = input.trim_end().contains('\n');
    // An empty line ends what has lines; a declaration that is complete has no more of them.
    let (word, _) = first_word(first.unwrap_or(""));
    let is_declaration = Declaration::of_word(word).is_some_and(|declaration| !declaration.has_string());
    !is_open(input) && (!several || is_declaration)
}

/// Cuts lines into statements; blank lines and remarks between them fall away.
#[derive(Debug, Default)]
pub struct Splitter {
    open: Option<Statement>,
}

impl Splitter {
    /// Takes a line; gives what it completes: the text before it, and itself if it stands alone.
    pub fn line(&mut self, line: &str, number: usize) -> Vec<Statement> {
        let mut done = Vec::new();
        if let Some(open) = &mut self.open {
            if goes_on(&open.text, line) {
                open.text += "\n";
                open.text += line.trim_end();
                return done;
            }
            done.extend(self.open.take());
        }
        let statement = |kind| Statement { kind, text: line.trim_end().to_owned(), line: number };
        match classify(line) {
            Line::Blank => {}
            kind @ (Line::Command | Line::Unknown) => done.push(statement(kind)),
            kind @ (Line::Model | Line::Clause) => self.open = Some(statement(kind)),
        }
        done
    }

    /// What is left at the end.
    pub fn finish(&mut self) -> Option<Statement> {
        self.open.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_told_apart() {
        for (line, kind) in [
            ("run 5", Line::Command),
            ("  run", Line::Command),
            (":F(x)", Line::Command),
            ("? run", Line::Command),
            ("load C:\\plants\\a.dls", Line::Command),
            ("run(x): solve dx/dt = 1", Line::Model),
            ("run (x): solve dx/dt = 1", Line::Model),
            ("run < B: produce A", Line::Model),
            ("run: produce A", Line::Model),
            ("F(x): solve dx/dt = 1", Line::Model),
            ("±(α): solve dα/dt = 1", Line::Model),
            ("+(a): solve da/dt = 1", Line::Model),
            ("A(x) <", Line::Model),
            ("param r = 2", Line::Model),
            ("parm r = 2", Line::Unknown),
            ("title \"a: b\"", Line::Model),
            ("if x = 1 produce F", Line::Clause),
            ("# a remark", Line::Blank),
            ("", Line::Blank),
            ("x + 1", Line::Unknown),
        ] {
            assert_eq!(classify(line), kind, "{line}");
        }
    }

    #[test]
    fn what_is_open_waits_for_more() {
        for text in [
            "F(x):",
            "F(x): if x < 1",
            "F(x): if x < 1\n  solve dx/dt = 1\n  if x = 1",
            "const a = (1",
            "const a = 2*",
            "F(x): solve dx/dt = if x < 1 then",
            "A(x) <",
            "initial string:",
            "initial string: F [ A",
            "param r = 1 in 0 ..",
        ] {
            assert!(is_open(text), "{text}");
        }
        for text in [
            "F(x): solve dx/dt = 1",
            "F(x): if x < 1 solve dx/dt = if x < 0 then 1 else 2",
            "initial string: F + F -",
            "param r = 1 in 0 .. 2 # a remark (",
            "title \"# no remark\"",
        ] {
            assert!(!is_open(text), "{text}");
        }
    }

    #[test]
    fn a_rule_of_several_lines_ends_with_an_empty_one() {
        assert!(is_complete("F(x): solve dx/dt = 1"));
        assert!(!is_complete("F(x):"));
        assert!(!is_complete("F(x):\n  solve dx/dt = 1"));
        assert!(is_complete("F(x):\n  solve dx/dt = 1\n"));
        assert!(is_complete("const a = (1 +\n2)"));
        assert!(is_complete("run 5"));
        assert!(is_complete("nonsense"));
        assert!(is_complete(""));
    }

    #[test]
    fn scripts_are_cut_into_statements() {
        let script = "# a plant\ninitial string:\nA(0)\nA(x):\n  if x < 1 solve dx/dt = 1\n  # more\n  if x = 1\n    produce F(x)\n    A(0)\nrun 3\nconst a = 1\n\nif x > 2 produce B\nshow";
        let mut splitter = Splitter::default();
        let mut all = Vec::new();
        for (i, line) in script.lines().enumerate() {
            all.extend(splitter.line(line, i + 1));
        }
        all.extend(splitter.finish());
        let shape: Vec<(Line, usize, usize)> =
            all.iter().map(|s| (s.kind, s.line, s.text.lines().count())).collect();
        assert_eq!(
            shape,
            [
                (Line::Model, 2, 2),
                (Line::Model, 4, 6),
                (Line::Command, 10, 1),
                (Line::Model, 11, 1),
                (Line::Clause, 13, 1),
                (Line::Command, 14, 1),
            ]
        );
    }
}
