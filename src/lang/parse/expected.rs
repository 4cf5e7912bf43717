//! What the parser expected, in the language's own words.

use std::collections::BTreeSet;

use pest::error::{Error, ErrorVariant, InputLocation};

use super::Rule;
use crate::diagnostic::{Diagnostic, Span};
use crate::lang::layout::{DECLARATIONS, RawItem};
use crate::lang::suggest::nearest;

/// A grammar rule as a person would call it; `None` for what is never named alone.
fn words(rule: Rule) -> Option<&'static str> {
    use Rule::*;
    Some(match rule {
        expr | primary | prefix | number | ident | call | if_expr | neg | not | coefficient => {
            "an expression"
        }
        infix | or | and | le | ge | ne | lt | gt | eq | add | sub | mul | div | pow => "an operator",
        module | modules | successor | name | word | symbol => "a module",
        epsilon => "`ε` for nothing",
        arguments => "`(` and parameters",
        formals => "`(` and the names of parameters",
        head | head_module | plus_minus | context => "a module",
        left_of => "`<` after the left context",
        right_of => "`>` and the right context",
        clause => "`if`, `solve` or `produce`",
        solve | kw_solve => "`solve`",
        produce | kw_produce => "`produce`",
        kw_if => "`if`",
        kw_then => "`then`",
        kw_else => "`else`",
        kw_dt => "`dt`",
        kw_step => "`step`",
        kw_in => "`in` and a range",
        equation | derivative | rate => "a derivative such as `dx/dt`",
        equals => "`=`",
        colon => "`:`",
        close => "`)`",
        range => "`..`",
        text | text_body => "a text in quotes",
        EOI => "the end of the line",
        _ => return None,
    })
}

/// Turns pest's error into a message.
pub fn explain(item: Rule, error: &Error<Rule>, text: &str, offset: usize) -> Diagnostic {
    let at = match error.location {
        InputLocation::Pos(at) | InputLocation::Span((at, _)) => at,
    };
    let found = token_at(text, at);
    let mut expected: BTreeSet<&'static str> = BTreeSet::new();
    if let ErrorVariant::ParsingError { positives, .. } = &error.variant {
        expected.extend(positives.iter().filter_map(|r| words(*r)));
    }
    // What a name is for depends on where it is asked for.
    if is_item_with_name(item)
        && text[..at].split_whitespace().count() <= 1
        && expected.contains("an expression")
    {
        expected = BTreeSet::from(["a name"]);
    }
    let shown: Vec<&str> = expected.into_iter().collect();
    let what = match shown.split_last() {
        None => "this does not belong here".to_owned(),
        Some((last, [])) => format!("expected {last}"),
        Some((last, rest)) => format!("expected {} or {last}", rest.join(", ")),
    };
    let message = match found {
        "" => "the text ends too early".to_owned(),
        "\n" => "the line ends too early".to_owned(),
        token => format!("`{token}` is not expected here"),
    };
    let end = if found == "\n" { at } else { at + found.len() };
    // At the end of a line, point at the last thing before it rather than at nothing.
    let span = if end == at {
        let before = text[..at].trim_end();
        let from = before.char_indices().next_back().map_or(0, |(i, _)| i);
        Span::new(offset + from, offset + before.len())
    } else {
        Span::new(offset + at, offset + end)
    };
    let what = if end == at { format!("{what} after this") } else { what };
    Diagnostic::error(message).at(span, what).help_opt(hint(item, text, at, found))
}

fn is_item_with_name(item: Rule) -> bool {
    matches!(item, Rule::const_item | Rule::param_item | Rule::def_item)
}

/// The word, number or symbol at a place.
fn token_at(text: &str, at: usize) -> &str {
    let rest = &text[at..];
    let Some(first) = rest.chars().next() else { return "" };
    let alike = |c: char| c.is_alphanumeric() || c == '_';
    if alike(first) {
        let end = rest.find(|c| !alike(c)).unwrap_or(rest.len());
        // Quote no more than a line's worth.
        &rest[..rest.char_indices().map(|(i, _)| i).nth(40).unwrap_or(rest.len()).min(end)]
    } else {
        &rest[..first.len_utf8()]
    }
}

/// Advice for mistakes that people make.
fn hint(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let previous = before.chars().next_back();
    let touching = before.len() == at;
    let advice = match (previous, found) {
        (Some('='), "=") if touching => "equality is written with one `=`",
        (Some('&'), "&") if touching => "“and” is written with one `&`",
        (Some('|'), "|") if touching => "“or” is written with one `|`",
        (Some('*'), "*") if touching => "a power is written `x^2`",
        (_, "and") => "“and” is written `&`",
        (_, "or") => "“or” is written `|`",
        (_, "not") => "“not” is written `!`",
        (_, "±") => "`±` stands for both turns in the head of a rule only; write `+` or `-`",
        (_, "~") => "the language has no `~`; “not” is written `!`",
        (_, "'") => "a derivative is written `dx/dt`",
        (_, "→") => "a production is written `produce …`",
        (Some('-'), ">") if touching => {
            "a production is written `produce …`, after an `if` with its condition"
        }
        (_, ".") if item != Rule::rule_item => "a number begins with a digit: `0.5`",
        (_, "=") if item == Rule::rule_item && before.ends_with(|c: char| c.is_alphanumeric()) => {
            "an equation is written `dx/dt = …`"
        }
        (_, "solve" | "produce" | "if") if item == Rule::rule_item && !before.contains(':') => {
            "a rule's head ends with `:`"
        }
        (_, "solve" | "produce" | "if" | "then" | "else") if item != Rule::rule_item => {
            "this word is reserved; a rule begins with its head, such as `F(x):`"
        }
        (_, ":") if item == Rule::rule_item && before.contains(':') => {
            "a new rule begins on a line of its own"
        }
        (_, "\n" | "") if matches!(item, Rule::rule_item) && before.ends_with(':') => {
            "under its head a rule has clauses: `solve dx/dt = …`, `if x = 1 produce …`"
        }
        (_, "\n" | "") if before.ends_with("produce") => "to produce nothing, write `produce ε`",
        _ if item == Rule::rule_item
            && !before.contains(':')
            && found.starts_with(|c: char| c.is_ascii_digit()) =>
        {
            "a head names its parameters; values belong to the initial string and to successors"
        }
        _ if item == Rule::rule_item && found.starts_with(|c: char| c.is_alphabetic()) => {
            return keyword_hint(found, &["if", "solve", "produce"]);
        }
        _ if is_number_before(before) && touching => "write the multiplication out: `2*x`",
        _ => return None,
    };
    Some(advice.to_owned())
}

fn is_number_before(before: &str) -> bool {
    before.ends_with(|c: char| c.is_ascii_digit())
}

fn keyword_hint(found: &str, known: &[&'static str]) -> Option<String> {
    nearest(found, known.iter().copied()).map(|word| format!("did you mean `{word}`?"))
}

/// A line that begins no declaration and no rule.
pub fn unknown_line(text: &str, item: &RawItem) -> Diagnostic {
    let line = text[item.start..item.end].lines().next().unwrap_or_default();
    let first = token_at(line, 0);
    let span = Span::new(item.start, item.start + first.len());
    let is_symbol = !first.starts_with(|c: char| c.is_alphanumeric());
    if is_symbol && matches!(first, "+" | "-" | "*" | "/" | "^" | "&" | "|" | "<" | ">" | "=") {
        return Diagnostic::error("the line before ended an expression")
            .at(span, "this begins a new line")
            .help("to go on with an expression, put the operator at the end of the line before, or parentheses around it");
    }
    let names: Vec<&'static str> =
        DECLARATIONS.iter().map(|(name, _)| *name).chain(["if", "solve", "produce"]).collect();
    let mut diagnostic = Diagnostic::error(format!("`{first}` begins no declaration and no rule"))
        .at(span, "expected a declaration, or the head of a rule such as `F(x):`");
    if let Some(help) = keyword_hint(first, &names) {
        diagnostic = diagnostic.help(help);
    } else if line.contains("solve") || line.contains("produce") {
        diagnostic = diagnostic.help("a rule's head ends with `:`");
    } else if line.contains('=') {
        diagnostic = diagnostic.help("a constant is declared with `const NAME = VALUE`");
    } else if matches!(first, "if" | "solve" | "produce") {
        diagnostic = diagnostic.help("a clause stands under the head of its rule, such as `F(x):`");
    } else {
        let known: Vec<&str> = DECLARATIONS.iter().map(|(name, _)| *name).collect();
        diagnostic = diagnostic.note(format!("declarations begin with {}", known.join(", ")));
    }
    diagnostic
}
