//! Syntax errors in the terms of the language, from the grammar rules that the parser expected.

use std::collections::BTreeSet;

use pest::error::{Error, ErrorVariant, InputLocation};

use super::advice;
use super::build::keyword;
use super::hints::{hint, is_derivative, keyword_hint};
use crate::declarations::{self, DECLARATIONS, Declaration};
use crate::foreign_syntax;
use crate::grammar::Rule;
use crate::layout::RawItem;
use dlsys_diagnostic::{Diagnostic, Span};

/// The description of a grammar rule in messages; `None` for rules that messages do not mention.
fn words(rule: Rule) -> Option<&'static str> {
    use Rule::*;
    Some(match rule {
        expr | number | lone_number | literal | ident | call | indexed | array | if_expr | match_expr
        | neg | not | coefficient => "an expression",
        or | and | comparison | sum | product | pow => "an operator",
        module | modules | successor | alternative | name => "a module",
        epsilon => "`ε` for nothing",
        arguments => "`(` and parameters",
        formals => "`(` and the names of parameters",
        head | head_module | plus_minus | context => "a module",
        step_head | step_context | step_right => "a module",
        arrow => "`->` and a successor",
        always => "`*`",
        left_of => "`<` after the left context",
        right_of => "`>` and the right context",
        clause => "`if`, `solve` or `produce`",
        local => "`let`",
        kw_column => "`column` and its name",
        periodic => "`periodic`",
        sort => "`linear`, `monotone` or `spline`",
        kw_or => "`or` and another successor",
        hazard | kw_at => "`at rate`",
        solve | kw_solve => "`solve`",
        produce | kw_produce => "`produce`",
        right_context => "a module",
        bracket_open => "`[`",
        bracket_close => "`]`",
        aggregate | fold | count_word => "an expression",
        kw_for => "`for` and a parameter",
        kw_in => "`in` and a range",
        kw_from => "`from` and a file",
        kw_texture => "`texture` and a picture",
        kw_of => "`of` and a tissue",
        kw_pinned => "`pinned` and a condition",
        surface_name => "the name of a surface such as `@P`",
        units_part | units_word => "`length` or `time` and a value",
        wind_part | wind_word | spectrum => "an option such as `speed`",
        kolmogorov => "`kolmogorov` and three values",
        flow_kind | uniform | flow_word => "`uniform`, `source`, `sink` or `vortex`",
        flow_part | flow_place | decay => "an option such as `at`",
        bed_part | bed_word => "`cell`, `depth`, `height`, `extent` or `size` and a value",
        soil_part | soil_word | soil_base => "a material such as `sand`, or a value such as `repose 30`",
        pour_part | pour_word | pour_place => "`rate`, `at` or `radius`",
        tissue_part | tissue_word | sag => "`stiffness`, `density`, `damping`, `thickness` or `sag`",
        gas_part | gas_word | gas_color => "a value such as `size 0.01`",
        point => "a point such as `(1, 0.5)`",
        equation | derivative | rate | zero => "an equation such as `dx/dt = …`, `x = …` or `0 = …`",
        equals => "`=`",
        colon => "`:`",
        close => "`)`",
        range => "`..`",
        text | text_body => "a text in quotes",
        EOI => "the end of the line",
        // The word that begins the declaration has already been parsed.
        _ => return keyword(rule).filter(|known| Declaration::of_word(known.trim_matches('`')).is_none()),
    })
}

/// Converts an error of pest to a diagnostic.
pub fn explain(item: Rule, error: &Error<Rule>, text: &str, offset: usize) -> Diagnostic {
    let at = match error.location {
        InputLocation::Pos(at) | InputLocation::Span((at, _)) => at,
    };
    let found = token_at(text, at);
    let mut expected: BTreeSet<&'static str> = BTreeSet::new();
    if let ErrorVariant::ParsingError { positives, .. } = &error.variant {
        expected.extend(positives.iter().filter_map(|r| words(*r)));
    }
    // An expression may begin with `if` or `match`; listing them adds nothing.
    if expected.contains("an expression") {
        expected.remove("`if`");
        expected.remove("`match`");
    }
    // In a string, `for` and `if` are rarely meant where a module is missing.
    if expected.contains("a module") {
        expected.remove("`for` and a parameter");
        expected.remove("`if`");
    }
    // A rule without a clause lacks a clause rather than another `let`.
    if expected.contains("`if`, `solve` or `produce`") {
        expected.remove("`let`");
    }
    let choice = expected.contains("`case`");
    // Directly after its word, such a declaration needs a name.
    if is_item_with_name(item)
        && text[..at].split_whitespace().count() <= 1
        && expected.contains("an expression")
    {
        expected = BTreeSet::from(["a name"]);
    }
    // Before the `:` of a rule, names stand in the places of expressions.
    if item == Rule::rule_item && !text[..at].contains(':') && expected.remove("an expression") {
        expected.insert("the name of a parameter");
    }
    // A line of cpfg or L-Py that is parsed as the head of a rule.
    let behind = text[..at].split_once(':').map_or("", |(_, behind)| behind);
    if item == Rule::rule_item
        && behind.trim().is_empty()
        && keyword_hint(found, &["if", "solve", "produce"]).is_none()
        && let Some(said) = foreign_syntax::line(text.lines().next().unwrap_or_default(), offset)
    {
        return said;
    }
    let shown: Vec<&str> = expected.into_iter().collect();
    let what = match shown.split_last() {
        None => "this does not belong here".to_owned(),
        Some((last, [])) => format!("expected {last}"),
        Some((last, rest)) => format!("expected {} or {last}", rest.join(", ")),
    };
    let message = match found {
        "" if item == Rule::rule_item => "the rule ends too early".to_owned(),
        "" | "\n" => "the line ends too early".to_owned(),
        token => format!("`{token}` is not expected here"),
    };
    let end = if found == "\n" { at } else { at + found.len() };
    // At the end of a line, point at the last character before it.
    let span = if end == at {
        let before = text[..at].trim_end();
        let from = before.char_indices().next_back().map_or(0, |(i, _)| i);
        Span::new(offset + from, offset + before.len())
    } else {
        Span::new(offset + at, offset + end)
    };
    let what = if end == at { format!("{what} after this") } else { what };
    let choice = choice.then_some("a choice is written `match n case 0: 1 case 1: 2 else 3`");
    let advice = hint(item, text, at, found).or_else(|| choice.map(str::to_owned));
    Diagnostic::error(message).at(span, what).help(advice.unwrap_or_else(|| advice::usage(item).to_owned()))
}

/// True for a declaration whose word is followed by a name without a mark.
pub(super) fn is_item_with_name(item: Rule) -> bool {
    Declaration::of_rule(item).is_some_and(|declaration| declaration.named.is_word())
}

/// The word, number or symbol at a place.
fn token_at(text: &str, at: usize) -> &str {
    let rest = &text[at..];
    let Some(first) = rest.chars().next() else { return "" };
    let alike = |c: char| c.is_alphanumeric() || c == '_';
    if alike(first) {
        let end = rest.find(|c| !alike(c)).unwrap_or(rest.len());
        // Quote at most a line's worth.
        &rest[..rest.char_indices().map(|(i, _)| i).nth(40).unwrap_or(rest.len()).min(end)]
    } else {
        &rest[..first.len_utf8()]
    }
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
    if let Some(said) = foreign_syntax::line(line, item.start) {
        return said;
    }
    let whole = &text[item.start..item.end];
    let mut names: Vec<&'static str> = declarations::words().collect();
    names.extend(["if", "solve", "produce"]);
    let diagnostic = Diagnostic::error(format!("`{first}` begins no declaration and no rule"))
        .at(span, "expected a declaration, or the head of a rule such as `F(x):`");
    if matches!(first, "if" | "solve" | "produce") {
        return diagnostic.help("a clause stands under the head of its rule, such as `F(x):`");
    }
    if matches!(first, "when" | "once") {
        return diagnostic.help("a condition begins with `if`: `if x = 1 produce F(x)`");
    }
    // A word that begins a declaration where its value follows.
    if let Some(declaration) = Declaration::of_word(first) {
        return Diagnostic::error(format!("`{first}` is not complete"))
            .at(span, "expected its value behind it")
            .help(declaration.written);
    }
    let mut owners = DECLARATIONS.iter().filter(|known| known.options.iter().any(|o| o.word == first));
    if let (Some(owner), None) = (owners.next(), owners.next()) {
        return diagnostic.help(format!(
            "`{first}` is a part of `{}`, which ends with its line: write it on the same line",
            owner.word
        ));
    }
    if let Some(help) = keyword_hint(first, &names) {
        return diagnostic.help(help);
    }
    if is_derivative(line) {
        return diagnostic.help("equations stand in a rule, behind `solve`: `solve dx/dt = …`");
    }
    if whole.contains("solve") || whole.contains("produce") {
        return diagnostic.help("a rule's head ends with `:`");
    }
    if line.contains("=>") || line.contains("<-") || line.contains("⇒") {
        return diagnostic.help("a discrete rule is written `A(x) : x > 3 -> F(x)`");
    }
    if line.contains('=') {
        return diagnostic.help("a constant is declared with `const NAME = VALUE`");
    }
    let known: Vec<&str> = declarations::words().collect();
    diagnostic
        .note(format!("declarations begin with {}", known.join(", ")))
        .help("a rule has a head with a colon, and clauses: `A(x): solve dx/dt = 1`")
}
