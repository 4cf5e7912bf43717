//! Classification of lines as commands or text of the model, and detection of complete statements.
//!
//! - `:word …` is always a command, and so is `?`.
//! - A line that begins with a keyword of the language (`param`, `interpret`, …), or that has a `:` or the arrow of a discrete
//!   rule outside parentheses, is a declaration or a rule.
//! - A line that begins with `if`, `solve`, `produce`, `at` (rate) or `or` is a further clause of the rule typed last.
//! - A line that begins with the name of a command is that command. A module may have the name of a command: its rule
//!   is recognised by the `(`, `<`, `>` or `:` after the name.
//!
//! A statement continues over lines while a parenthesis or an operator is open, and with lines that are indented or begin
//! with a clause. On a terminal an empty line ends a rule of several lines.

use super::commands;
use crate::syntax::declarations::Declaration;
use crate::syntax::words;

/// The kind of statement that a line begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatementKind {
    /// Nothing, or a comment.
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
    pub kind: StatementKind,
    pub text: String,
    pub line: usize,
}

/// The line without its comment.
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

/// Classifies a line.
pub fn classify(line: &str) -> StatementKind {
    if line.trim_start().starts_with('?') || line.trim_start().starts_with(':') {
        return StatementKind::Command;
    }
    let body = code(line).trim();
    if body.is_empty() {
        return StatementKind::Blank;
    }
    let (word, rest) = first_word(body);
    if words::CLAUSES.contains(&word) {
        return StatementKind::Clause;
    }
    if words::declarations().any(|known| known == word) {
        return StatementKind::Model;
    }
    let colon = has_colon(body);
    let apart = body.len() == word.len() || body[word.len()..].starts_with(char::is_whitespace);
    let arrow = has_arrow(body);
    let is_step = rest.starts_with("->") || rest.starts_with("-->");
    let head = rest.starts_with([':', '<', '>']) || is_step || rest.starts_with('(') && (colon || arrow);
    if commands::find(word).is_some() && apart && !head {
        return StatementKind::Command;
    }
    let is_model = colon || arrow || body.ends_with(['<', '>']);
    if is_model { StatementKind::Model } else { StatementKind::Unknown }
}

/// True if a `:` stands outside parentheses.
fn has_colon(text: &str) -> bool {
    let mut depth = 0i64;
    text.chars().any(|c| {
        depth += i64::from(c == '(') - i64::from(c == ')');
        c == ':' && depth <= 0
    })
}

/// True if the arrow of a discrete rule, `->` or `-->`, stands outside parentheses.
fn has_arrow(text: &str) -> bool {
    let mut depth = 0i64;
    let mut before = ' ';
    text.chars().any(|c| {
        depth += i64::from(c == '(') - i64::from(c == ')');
        let last = std::mem::replace(&mut before, c);
        c == '>' && last == '-' && depth <= 0
    })
}

/// True if the text of a model is incomplete.
pub fn is_open(text: &str) -> bool {
    let body: String = text.lines().map(|line| code(line).to_owned() + "\n").collect();
    let mut depth = 0i64;
    for c in body.chars() {
        depth += i64::from(matches!(c, '(' | '[')) - i64::from(matches!(c, ')' | ']'));
    }
    let end = body.trim_end();
    let last = end.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or("");
    let waits =
        words::CLAUSES.contains(&last) || words::particles(first_word(&body).0).any(|word| word == last);
    // Symbols of the turtle may end a string; other operators need an operand.
    let operator = end.ends_with([':', ',', '=', '*', '<', '>', '≤', '≥', '≠']) || end.ends_with("..");
    let clause = body.rmatch_indices(|c: char| !(c.is_alphanumeric() || c == '_')).count() > 0 && {
        let mut words = body.split(|c: char| !(c.is_alphanumeric() || c == '_')).rev();
        matches!(words.find(|word| words::CLAUSES.contains(word)), Some("if" | "at" | "let"))
    };
    depth > 0 || waits || operator || clause && has_colon(&body)
}

/// True if the line continues the text before it.
fn goes_on(text: &str, line: &str) -> bool {
    let indented = line.starts_with(char::is_whitespace);
    match classify(line) {
        StatementKind::Blank => indented && !line.trim().is_empty(),
        StatementKind::Clause => true,
        _ if indented => true,
        StatementKind::Unknown => is_open(text),
        StatementKind::Command | StatementKind::Model => false,
    }
}

/// True if input on a terminal is complete; otherwise Enter begins another line.
pub fn is_complete(input: &str) -> bool {
    let first = input.lines().find(|line| classify(line) != StatementKind::Blank);
    match first.map(classify) {
        Some(StatementKind::Model) => {}
        Some(StatementKind::Clause) => return input.ends_with('\n') || !is_open(&format!("x: {input}")),
        _ => return true,
    }
    let last = input.rsplit('\n').next().unwrap_or("");
    if input.contains('\n') && last.trim().is_empty() {
        return true;
    }
    let several = input.trim_end().contains('\n');
    // A rule of several lines ends with an empty line; a declaration ends when it is complete.
    let (word, _) = first_word(first.unwrap_or(""));
    let is_declaration = Declaration::of_word(word).is_some_and(|declaration| !declaration.has_string());
    !is_open(input) && (!several || is_declaration)
}

/// Splits lines into statements; blank lines and comments between them are dropped.
#[derive(Debug, Default)]
pub struct Splitter {
    open: Option<Statement>,
}

impl Splitter {
    /// Adds a line; returns the statements that it completes: the one before it, and itself if it stands alone.
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
            StatementKind::Blank => {}
            kind @ (StatementKind::Command | StatementKind::Unknown) => done.push(statement(kind)),
            kind @ (StatementKind::Model | StatementKind::Clause) => self.open = Some(statement(kind)),
        }
        done
    }

    /// The last statement.
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
            ("run 5", StatementKind::Command),
            ("  run", StatementKind::Command),
            (":F(x)", StatementKind::Command),
            ("? run", StatementKind::Command),
            ("load C:\\plants\\a.dls", StatementKind::Command),
            ("run(x): solve dx/dt = 1", StatementKind::Model),
            ("run (x): solve dx/dt = 1", StatementKind::Model),
            ("run < B: produce A", StatementKind::Model),
            ("run: produce A", StatementKind::Model),
            ("F(x): solve dx/dt = 1", StatementKind::Model),
            ("±(α): solve dα/dt = 1", StatementKind::Model),
            ("+(a): solve da/dt = 1", StatementKind::Model),
            ("A(x) <", StatementKind::Model),
            ("param r = 2", StatementKind::Model),
            ("parm r = 2", StatementKind::Unknown),
            ("title \"a: b\"", StatementKind::Model),
            ("if x = 1 produce F", StatementKind::Clause),
            ("# a remark", StatementKind::Blank),
            ("", StatementKind::Blank),
            ("x + 1", StatementKind::Unknown),
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
        assert!(is_complete("const a = speed"));
        assert!(!is_complete("wind 1, 0, 0 speed"));
        assert!(is_complete("wind 1, 0, 0 speed 3"));
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
        let shape: Vec<(StatementKind, usize, usize)> =
            all.iter().map(|s| (s.kind, s.line, s.text.lines().count())).collect();
        assert_eq!(
            shape,
            [
                (StatementKind::Model, 2, 2),
                (StatementKind::Model, 4, 6),
                (StatementKind::Command, 10, 1),
                (StatementKind::Model, 11, 1),
                (StatementKind::Clause, 13, 1),
                (StatementKind::Command, 14, 1),
            ]
        );
    }
}
