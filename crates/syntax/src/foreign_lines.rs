//! Notations of cpfg that concern a whole line or rule: comments of C, labels of productions, probabilities behind successors.
//!
//! What they would mean here, if anything, is far from what was meant, so one message about the notation replaces those about its parts.

use dlsys_diagnostic::{Diagnostic, Span};

/// The error for a discrete rule that is written as in cpfg, given its text and the byte at which it begins.
pub fn rule(text: &str, start: usize) -> Option<Diagnostic> {
    label(text, start)
        .or_else(|| statements(text, start))
        .or_else(|| always(text, start))
        .or_else(|| probability(text, start))
        .or_else(|| probability_at_the_arrow(text, start))
}

/// Statements in braces around a condition: `A(x) : {y = x + 1;} y < 2 {z = y;} --> A(y)`.
fn statements(text: &str, start: usize) -> Option<Diagnostic> {
    let head = &text[..text.find("->")?];
    let open = head.find('{')?;
    let close = open + head[open..].find('}')?;
    let inside = head[open + 1..close].trim();
    let (name, value) = inside.split(';').next()?.split_once('=')?;
    let (name, value) = (name.trim(), value.trim());
    let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
    (is_name && !value.is_empty() && head[..open].contains(':')).then(|| {
        Diagnostic::error("a rule has no statements")
            .at(Span::new(start + open, start + close + 1), "in cpfg these are carried out when it applies")
            .help(format!("leave them out, and write `{value}` where `{name}` is read; a `def` names an expression that is long: `def f(x) = x + 1`"))
    })
}

/// A condition that always holds: `A(x) : 1 --> F(x)`.
fn always(text: &str, start: usize) -> Option<Diagnostic> {
    let arrow = text.find("->")?;
    let (predecessor, value) = text[..arrow].trim_end_matches('-').split_once(':')?;
    let at = text.find(':')? + 1 + value.find('1')?;
    (value.trim() == "1").then(|| {
        Diagnostic::error("a number is no condition")
            .at(Span::new(start + at, start + at + 1), "in cpfg a condition that always holds")
            .help(format!(
                "leave it out, with its colon: `{} -> {}`",
                predecessor.trim(),
                first_line(&text[arrow + 2..])
            ))
    })
}

/// A probability at the arrow, as in print: `A -->(0.3) F`, `A --(0.3)-> F`.
fn probability_at_the_arrow(text: &str, start: usize) -> Option<Diagnostic> {
    let arrow = text.find("->")?;
    let (head, behind) = (text[..arrow].trim_end(), text[arrow + 2..].trim_start());
    let (predecessor, value, string) = match behind.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        Some((value, string)) => (head, value, string),
        None => {
            let (predecessor, value) = head.strip_suffix(')')?.rsplit_once('(')?;
            (predecessor.trim_end().strip_suffix('-')?, value, behind)
        }
    };
    let number = value.trim().parse::<f64>().ok().filter(|value| (0.0..=1.0).contains(value))?;
    let predecessor = predecessor.trim_end_matches('-').trim();
    let at = text.find(&format!("({value})"))? + 1;
    Some(before_its_successor((predecessor, value.trim(), number), string, (start + at, value.len())))
}

/// The error for a probability that does not stand before its successor.
fn before_its_successor(
    (predecessor, value, number): (&str, &str, f64),
    string: &str,
    (at, length): (usize, usize),
) -> Diagnostic {
    let rest = ((1.0 - number) * 1e6).round() / 1e6;
    let string = first_line(string);
    Diagnostic::error("a probability stands before its successor")
        .at(Span::new(at, at + length), "in cpfg it stands here")
        .help(format!("write all successors in one rule: `{predecessor} -> {value}: {string} or {rest}: …`"))
        .help("the values are weights: they need not add up to 1")
}

/// A label of a production: `p1: A --> F A`, `p1 : A : x > 3 --> F A`.
fn label(text: &str, start: usize) -> Option<Diagnostic> {
    let (before, behind) = text.split_once(':')?;
    let name = before.trim();
    let digits = name.strip_prefix(['p', 'P'])?;
    let condition = behind.split("->").next()?.trim_start();
    let is_label = !digits.is_empty()
        && digits.chars().all(|c| c.is_ascii_digit())
        && condition.starts_with(|c: char| c.is_uppercase());
    is_label.then(|| {
        Diagnostic::error(format!("`{name}:` is a label, and rules have none"))
            .at(Span::new(start, start + name.len()), "in ABOP and cpfg it names the production")
            .help(format!("leave it out: `{}`", first_line(behind)))
    })
}

/// A probability: `A --> F A : 0.3`, or `A : 0.3 --> F A`.
fn probability(text: &str, start: usize) -> Option<Diagnostic> {
    let arrow = text.find("->")?;
    let (head, successor) = (text[..arrow].trim_end_matches('-'), text[arrow + 2..].trim());
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| (0.0..=1.0).contains(value));
    let behind = successor.rsplit_once(':').filter(|(_, value)| number(value).is_some());
    let before = head.split_once(':').filter(|(_, value)| number(value).is_some());
    let (predecessor, string, value) = match (behind, before) {
        (Some((string, value)), _) => (head.split(':').next()?, string, value),
        (None, Some((predecessor, value))) => (predecessor, successor, value),
        (None, None) => return None,
    };
    let (predecessor, value) = (predecessor.trim(), value.trim());
    let at = match behind {
        Some(_) => text.rfind(value)?,
        None => text.find(':').and_then(|colon| Some(colon + text[colon..].find(value)?))?,
    };
    Some(before_its_successor((predecessor, value, number(value)?), string, (start + at, value.len())))
}

/// The errors for comments of C in a text, `/* … */` or lines of `// words`, and the text with spaces in their place; what follows a comment that does not end is
/// within it. `None` if there is no such comment.
pub fn comments(text: &str) -> Option<(Vec<Diagnostic>, String)> {
    let mut errors = Vec::new();
    let mut rest = String::with_capacity(text.len());
    let (mut start, mut is_behind_line) = (0, false);
    while start < text.len() {
        let line = text[start..].split_inclusive('\n').next().unwrap_or_default();
        let is_outside = |at: &usize| line[..*at].matches('"').count().is_multiple_of(2);
        let first = |sign| line.match_indices(sign).map(|(at, _)| at).find(is_outside);
        let code = &line[..first("#").unwrap_or(line.len())];
        let body = code.trim_start();
        if body.strip_prefix("//").is_some_and(|rest| rest.trim_start().starts_with(char::is_alphabetic)) {
            // Lines in a row are one comment.
            if !is_behind_line {
                let at = start + code.len() - body.len();
                errors.push(no_comment(text, at, "a comment begins with `#` and ends with its line"));
            }
            rest.extend(blank(line));
            (start, is_behind_line) = (start + line.len(), true);
            continue;
        }
        is_behind_line = false;
        let Some(at) = first("/*").filter(|at| *at < code.len()).map(|at| start + at) else {
            rest.push_str(line);
            start += line.len();
            continue;
        };
        let end = text[at + 2..].find("*/").map(|length| at + 2 + length + 2);
        let help = match end {
            Some(end) if text[at..end].contains('\n') => {
                "a comment begins with `#` and ends with its line: begin each of these lines with `#`, up to the one with `*/`"
            }
            Some(_) => "a comment begins with `#` and ends with its line",
            None => {
                "a comment begins with `#` and ends with its line; this one has no `*/`: begin each line that is meant with `#`"
            }
        };
        errors.push(no_comment(text, at, help));
        let end = end.unwrap_or(text.len());
        rest.push_str(&text[start..at]);
        rest.extend(blank(&text[at..end]));
        start = end;
    }
    (!errors.is_empty()).then_some((errors, rest))
}

fn no_comment(text: &str, at: usize, help: &str) -> Diagnostic {
    Diagnostic::error(format!("`{}` begins no comment", &text[at..at + 2]))
        .at(Span::new(at, at + 2), "here it is a turn of the turtle, or a quotient")
        .help(help)
}

/// As many bytes of spaces, with the same line breaks.
fn blank(text: &str) -> impl Iterator<Item = char> + '_ {
    text.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' })
}

/// A sign that ends something in C, where it is a module of a string here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stray {
    /// `// words`, two rolls and modules.
    Comment,
    /// `\` at the end of a line, a roll.
    Continuation,
    /// `;` at the end of a line, a colour.
    End,
    /// A line for the preprocessor of C, which is a comment: `#include "FILE"`.
    Directive,
    /// A line such as `#define K 0.5`, which is a comment, by its number among those of the document.
    Definition(usize),
}

/// The places of such signs: where a line would be strange without them being meant as in C.
pub fn strays(text: &str) -> Vec<(usize, Stray)> {
    let mut found = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let code = line.split('#').next().unwrap_or_default().trim_end();
        if !code.contains('"') {
            found.extend(stray(code).map(|(at, stray)| (start + at, stray)));
        }
        start += line.len();
    }
    found
}

fn stray(code: &str) -> Option<(usize, Stray)> {
    if let Some(at) = code.find("//")
        && !code[at + 2..].starts_with('/')
    {
        let (before, behind) = (&code[..at], &code[at + 2..]);
        let mut words = behind.split_whitespace();
        let is_prose = |word: &str| word.len() > 1 && word.starts_with(|c: char| c.is_lowercase());
        let has_signs = behind.contains(|c: char| "[]{}()+&^|!@;\\/".contains(c));
        let is_apart = behind.starts_with(char::is_whitespace) && before.chars().all(|c| c != '/');
        let is_word = behind.trim_start().starts_with(char::is_alphabetic);
        let begins = before.trim().is_empty() && is_word;
        let ends = before.ends_with(char::is_whitespace) && !has_signs && words.any(is_prose);
        if is_apart && (begins || ends) {
            return Some((at, Stray::Comment));
        }
    }
    if let Some(before) = code.strip_suffix('\\')
        && before.ends_with(char::is_whitespace)
    {
        return Some((before.len(), Stray::Continuation));
    }
    let before = code.strip_suffix(';')?;
    let is_behind = before.ends_with(|c: char| c.is_alphanumeric() || ")]}".contains(c));
    is_behind.then_some((before.len(), Stray::End))
}

/// The first line of a text, not too long for a message: one that is ends with a module outside of brackets, and a sign that says so.
fn first_line(text: &str) -> String {
    /// Most bytes.
    const LONGEST: usize = 60;
    let line = text.trim().lines().next().unwrap_or_default().trim();
    if line.len() <= LONGEST {
        return line.to_owned();
    }
    let (mut depth, mut end) = (0_i32, 0);
    for (at, c) in line.char_indices().take_while(|(at, _)| *at <= LONGEST) {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            c if c.is_whitespace() && depth == 0 => end = at,
            _ => (),
        }
    }
    format!("{} …", &line[..end]).trim_start().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn help(found: Option<Diagnostic>) -> String {
        found.map_or(String::new(), |found| found.help.join("\n"))
    }

    #[test]
    fn labels_and_probabilities_are_told_from_conditions() {
        for (text, wanted) in [
            ("p1: A --> F A", "leave it out: `A --> F A`"),
            ("p12 : A(x) : x > 3 --> F(x) A(x)", "leave it out: `A(x) : x > 3 --> F(x) A(x)`"),
            ("A --> F A : 0.3", "`A -> 0.3: F A or 0.7: …`"),
            ("A(x) : 0.25 -> F(x)", "`A(x) -> 0.25: F(x) or 0.75: …`"),
            ("A -->(0.3) F", "`A -> 0.3: F or 0.7: …`"),
            ("A(x) --(0.3)-> F(x)", "`A(x) -> 0.3: F(x) or 0.7: …`"),
            ("A(x) : 1 --> F(x)", "leave it out, with its colon: `A(x) -> F(x)`"),
            ("A(x) : {y=x+1;} y<2 --> A(y)", "write `x+1` where `y` is read"),
            (
                "A --> F(1) [ +(30) F(1) ] [ -(30) F(1) ] [ /(137.5) F(1) F(2) F(3) F(4) ] : 0.3",
                "`A -> 0.3: F(1) [ +(30) F(1) ] [ -(30) F(1) ] … or 0.7: …`",
            ),
        ] {
            assert!(help(rule(text, 7)).contains(wanted), "{text}: {}", help(rule(text, 7)));
        }
        // A module may have such a name, and a weight such a place.
        for text in [
            "p1 : t > 3 -> F",
            "A(x) : x > 0.3 -> F(x)",
            "A -> 0.3: F A or 0.7: F",
            "A : * -> F(0.3)",
            "A(x) > B(y) : x > 1 -> F",
            "A : -(1)-(2) < t -> F",
        ] {
            assert!(rule(text, 0).is_none(), "{text}");
        }
    }

    #[test]
    fn stray_signs_of_c_are_told_from_modules() {
        let found = |text: &str| strays(text).into_iter().map(|(at, _)| at).collect::<Vec<_>>();
        assert_eq!(strays("A -> F A  // leaf L\n"), [(10, Stray::Comment)]);
        assert_eq!(strays("A -> F\n// F"), [(7, Stray::Comment)]);
        assert_eq!(strays("axiom: A(0)  \\\nB(1)"), [(13, Stray::Continuation)]);
        assert_eq!(strays("axiom: A;\nA -> F[A];  # rule"), [(8, Stray::End), (19, Stray::End)]);
        for text in [
            "A -> [F] ///// F",
            "A -> F // F",
            "A -> F // [ leaf ]",
            "A -> F//(30)F",
            "A -> F \\ F",
            "A -> F ;",
            "A -> ε",
            "# a // b",
        ] {
            assert_eq!(found(text), [], "{text}");
        }
    }

    #[test]
    fn comments_of_c_are_told_from_rolls() {
        for (text, kept) in [
            ("/* a tree */\nangle 20", "            \nangle 20"),
            ("angle 20\n  // Figure 1\n// é\nF", "angle 20\n             \n     \nF"),
            ("F /* a\nb */ G", "F     \n     G"),
            ("F # /* no\nG /* X", "F # /* no\nG     "),
            ("t \"#a/*b\" /**/", "t \"#a/*b\"     "),
        ] {
            let (found, rest) = comments(text).expect("a comment");
            assert_eq!((found.len(), &rest[..]), (1, kept), "{text}");
            let at = found[0].labels[0].0.start as usize;
            assert!(text[at..].starts_with('/'), "{text}");
        }
        assert!(comments("initial string: F\n//(30) F\n/ F # // no\n").is_none());
        assert_eq!(comments("// a\nF\n// b\n/* c */ F /* d").map(|(errors, _)| errors.len()), Some(4));
    }
}
