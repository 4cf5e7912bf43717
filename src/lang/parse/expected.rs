//! What the parser expected, in the language's own words.

use std::collections::BTreeSet;

use pest::error::{Error, ErrorVariant, InputLocation};

use super::Rule;
use crate::diagnostic::{Diagnostic, Span};
use crate::lang::advice;
use crate::lang::layout::{DECLARATIONS, RawItem};
use crate::lang::suggest::nearest;

/// A grammar rule as a person would call it; `None` for what is never named alone.
fn words(rule: Rule) -> Option<&'static str> {
    use Rule::*;
    Some(match rule {
        expr | number | literal | ident | call | indexed | array | if_expr | match_expr | neg | not
        | coefficient => "an expression",
        or | and | le | ge | ne | lt | gt | eq | add | sub | mul | div | pow => "an operator",
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
        local | kw_let => "`let`",
        kw_match => "`match`",
        kw_case => "`case`",
        kw_column => "`column` and its name",
        periodic => "`periodic`",
        sort => "`linear`, `monotone` or `spline`",
        kw_or => "`or` and another successor",
        hazard | kw_at => "`at rate`",
        kw_rate => "`rate`",
        solve | kw_solve => "`solve`",
        produce | kw_produce => "`produce`",
        right_context => "a module",
        bracket_open => "`[`",
        bracket_close => "`]`",
        aggregate | fold | kw_count => "an expression",
        kw_for => "`for` and a parameter",
        kw_if => "`if`",
        kw_then => "`then`",
        kw_else => "`else`",
        kw_dt => "`dt`",
        kw_step => "`step`",
        kw_in => "`in` and a range",
        kw_from => "`from` and a file",
        kw_strength => "`strength`",
        surface_name => "the name of a surface such as `@P`",
        point => "a point such as `(1, 0.5)`",
        equation | derivative | rate | zero => "an equation such as `dx/dt = …`, `x = …` or `0 = …`",
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
    // Wherever an expression can begin, an `if` can: that goes without saying.
    if expected.contains("an expression") {
        expected.remove("`if`");
        expected.remove("`match`");
    }
    // A clause is what a rule lacks, and not one more name.
    if expected.contains("`if`, `solve` or `produce`") {
        expected.remove("`let`");
    }
    let choice = expected.contains("`case`");
    // What a name is for depends on where it is asked for.
    if is_item_with_name(item)
        && text[..at].split_whitespace().count() <= 1
        && expected.contains("an expression")
    {
        expected = BTreeSet::from(["a name"]);
    }
    // Before its `:` a rule has names where other places have expressions.
    if item == Rule::rule_item && !text[..at].contains(':') && expected.remove("an expression") {
        expected.insert("the name of a parameter");
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
    // At the end of a line, point at the last thing before it rather than at nothing.
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

fn is_item_with_name(item: Rule) -> bool {
    matches!(
        item,
        Rule::const_item
            | Rule::param_item
            | Rule::def_item
            | Rule::color_item
            | Rule::gradient_item
            | Rule::contour_item
            | Rule::curve_item
            | Rule::table_item
    )
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
    let first = text.split_whitespace().next().unwrap_or_default();
    let first = first.trim_end_matches(|c: char| !c.is_alphanumeric());
    if matches!(item, Rule::rule_item)
        && let Some(word) = nearest(first, DECLARATIONS.iter().map(|(name, _)| *name))
        && first.len() > 3
    {
        return Some(format!("did you mean `{word}`?"));
    }
    if let Some(advice) = advice::for_block(item, &text[..at], found) {
        return Some(advice.to_owned());
    }
    if let Some(advice) = hint_of_chance(item, text, at, found) {
        return Some(advice.to_owned());
    }
    hint_by_symbol(item, text, at, found).or_else(|| hint_by_word(item, text, at, found))
}

/// Advice for successors with weights and for events at a rate.
fn hint_of_chance(item: Rule, text: &str, at: usize, found: &str) -> Option<&'static str> {
    const WEIGHTS: &str = "several successors each have a weight before them: `produce 2: F(x) or 1: G(x)`";
    const STEP: &str = "several successors each have a weight before them: `A -> 2: F A or 1: F`";
    if !matches!(item, Rule::rule_item | Rule::step_item) {
        return None;
    }
    let before = text[..at].trim_end();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let words: Vec<&str> = before.split(|c| !is_word(c)).filter(|w| !w.is_empty()).collect();
    let last = words.last().copied().unwrap_or_default().trim_start();
    let last = if before.ends_with(is_word) { last } else { "" };
    let arrow = before.rfind("->").max(before.rfind('→'));
    // From the beginning of the successor on.
    let successor = match item {
        Rule::step_item => arrow.map(|at| &before[at..])?,
        _ => before.rfind("produce").map_or("", |at| &before[at..]),
    };
    let weights = if item == Rule::step_item { STEP } else { WEIGHTS };
    let has_or = successor.split(|c| !is_word(c)).any(|word| word == "or");
    let number = found.starts_with(|c: char| c.is_ascii_digit());
    let begins = last == "produce" || successor.trim_end_matches(['>', '→', '-']).is_empty();
    match found {
        "or" if !successor.is_empty() => Some(weights),
        _ if last == "or" || has_or && matches!(found, "" | "\n" | "or" | ":") => Some(weights),
        _ if number && begins && !successor.is_empty() => Some(weights),
        "produce" | "solve" if last == "rate" => {
            Some("behind `at rate` stands the rate: `at rate 0.5 produce …`")
        }
        "solve" if before.rsplit('\n').next().is_some_and(|line| line.contains("at rate")) => {
            Some("what happens at a rate is a production: `at rate 0.5 produce …`")
        }
        _ if last == "rate" && words.len() > 1 && words[words.len() - 2] != "at" => Some(
            "a production at a rate is written `at rate 0.5 produce …`, with `if …` before it if it has a condition",
        ),
        _ => None,
    }
}

/// Advice that the symbols around the place give.
fn hint_by_symbol(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let previous = before.chars().next_back();
    let touching = before.len() == at;
    let in_rule = item == Rule::rule_item;
    let advice = match (previous, found) {
        (Some('='), "=") if touching => "equality is written with one `=`",
        (Some('='), "<" | ">") if touching => "“at most” is written `<=`, “at least” `>=`",
        (Some('<'), ">") if touching => "“not equal” is written `!=`",
        (Some('&'), "&") if touching => "“and” is written with one `&`",
        (Some('|'), "|") if touching => "“or” is written with one `|`",
        (Some('*'), "*") if touching => "a power is written `x^2`",
        (_, _) if item == Rule::step_item => return hint_for_step(text, at, found),
        (Some('-'), ">") if touching => ARROW,
        (_, "→") => ARROW,
        (_, "/") if text[at..].starts_with("//") => "a comment begins with `#`",
        (_, "−" | "–") => "this is a typographic dash; a minus is written `-`",
        (_, "“" | "”" | "‘" | "’" | "„") => "quotation marks are straight: `\"…\"`",
        (_, "\"") if item == Rule::title_item => "the text ends with a second `\"` on the same line",
        (_, "²" | "³") => "a power is written `x^2`",
        (_, ";") if item != Rule::modules => "a declaration ends with its line, without a sign",
        (_, "[") if item != Rule::modules && previous.is_some_and(|c| "+-*/(=,^".contains(c)) => {
            "in expressions only round parentheses `( )` group"
        }
        (_, "±") => "`±` stands for both turns in the head of a rule only; write `+` or `-`",
        (_, "~") => "“not” is written `!`",
        (_, "'") => "a derivative is written `dx/dt`",
        (Some('m'), _) if item == Rule::surface_item && before.ends_with("from") => {
            "the name of the file is a text in quotes: `surface @P from \"petal.s\"`"
        }
        (Some('e'), _) if item == Rule::surface_item && before.ends_with("surface") => {
            "the name of a surface begins with `@`: `surface @P from \"petal.s\"`"
        }
        (Some('=' | ','), _) if matches!(item, Rule::color_item | Rule::gradient_item) => {
            "a colour is a text in quotes: `\"#8b6cc9\"`"
        }
        _ if item == Rule::tropism_item => {
            "a tropism is a direction and a strength: `tropism 0, -1, 0 strength 0.2`"
        }
        _ if item == Rule::contour_item => {
            "a contour is three points or more: `contour leaf = (1, 0) (0, 0.3) (-1, 0) (0, -0.3)`"
        }
        (_, "-") if is_item_with_name(item) && !before.contains('=') => {
            "a name is made of letters, digits and `_`"
        }
        (_, "-" | "=") if item == Rule::frames_item => "frames are written `frames 0 .. 10 step 0.1`",
        (_, "=") if item == Rule::angle_item => "the angle is written `angle 45`",
        (_, ":") if matches!(item, Rule::ignore_item | Rule::consider_item) => {
            "write the names after it: `ignore F_x @L`"
        }
        (_, "<" | ">") if item == Rule::interpret_item => {
            "a drawing does not depend on the context of a module"
        }
        (Some(c), ",") if c.is_ascii_digit() && touching && item != Rule::modules => {
            "the decimal sign is a point: `0.5`"
        }
        (_, "=") if item == Rule::modules && text[at..].starts_with("=>") => {
            "a discrete rule is written `A(x) : x > 3 -> F(x)`"
        }
        (_, ",") if item == Rule::modules => "modules stand one after another, with spaces and no commas",
        (c, ".")
            if text[at + 1..].starts_with(|c: char| c.is_ascii_digit())
                || c.is_some_and(|c| c.is_ascii_digit()) =>
        {
            "a number begins and ends with a digit: `0.5`, `2`"
        }
        (Some(')'), ":") if in_rule && !before.contains(':') => {
            "a rule has one predecessor; modules around it are its context: `A(x) < B(y) > C(z):`"
        }
        (_, "=") if in_rule && before.ends_with(|c: char| c.is_alphanumeric()) => {
            "an equation is written `dx/dt = …`"
        }
        (_, ":") if in_rule && last_keyword(before) == Some("if") => {
            "a condition has no `:` behind it: `if x < 1 solve …`"
        }
        (_, ":") if in_rule && before.contains(':') => "a new rule begins on a line of its own",
        _ => return None,
    };
    Some(advice.to_owned())
}

const ARROW: &str = "in a clause a production is written `if x = 2 produce …`; a discrete rule has its arrow behind the head: `A(x) : x > 3 -> …`";

/// Advice for discrete rules.
fn hint_for_step(text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let rest = text[at..].trim_start();
    let has_arrow = before.contains("->") || before.contains('→');
    let advice = match found {
        "" | "\n" if before.ends_with("->") || before.ends_with('→') => "to produce nothing, write `-> ε`",
        "if" | "solve" | "produce" if has_arrow => {
            "a discrete rule has no clauses: it is `A(x) : x > 3 -> F(x)`; equations stand in a rule of their own, `A(x): solve …`"
        }
        "if" => "a discrete rule has its condition behind the colon, without `if`: `A(x) : x > 3 -> F(x)`",
        _ if before.ends_with(':') && rest.starts_with("if ") => {
            "a discrete rule has its condition behind the colon, without `if`: `A(x) : x > 3 -> F(x)`"
        }
        _ if before.contains(": if ") && !has_arrow => {
            "a discrete rule has its condition behind the colon, without `if`: `A(x) : x > 3 -> F(x)`"
        }
        ">" if before.trim_end_matches('-').trim_end().ends_with(':') => {
            "without a condition there is no colon: `A(x) -> F(x)`; one that always holds is `A(x) : * -> F(x)`"
        }
        _ if !has_arrow && found.starts_with(|c: char| c.is_ascii_digit()) => {
            "a head names its parameters; values belong to the initial string and to successors"
        }
        ":" if has_arrow => "the condition stands before the arrow: `A(x) : x > 3 -> F(x)`",
        ">" | "→" if has_arrow => "a rule has one arrow; a new rule begins on a line of its own",
        "," if has_arrow => "modules stand one after another, with spaces and no commas",
        _ => return None,
    };
    Some(advice.to_owned())
}

/// Advice that the words around the place give.
fn hint_by_word(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let rest = &text[at..];
    let in_rule = item == Rule::rule_item;
    let has_head = before.contains(':');
    let is_word = found.starts_with(|c: char| c.is_alphabetic());
    let ended = matches!(found, "\n" | "");
    // The line, up to the place.
    let line = before.rsplit('\n').next().unwrap_or(before).trim();
    let last_word = line.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
    let advice = match found {
        "ignore" | "consider" => "brackets cannot be chosen: they are no modules",
        _ if last_word == "not" => "“not” is written `!`",
        "if" | "then" | "else" | "solve" | "produce" if is_item_with_name(item) && !before.contains('=') => {
            "this word is reserved: choose another name"
        }
        "then" if in_rule => "a clause has no `then`: `if x < 2 solve …`",
        "in" if item == Rule::const_item => "only a `param` has a range",
        "and" => "“and” is written `&`",
        "or" => "“or” is written `|`",
        "not" => "“not” is written `!`",
        "to" if item == Rule::frames_item => "frames are written `frames 0 .. 10 step 0.1`",
        "solve" | "produce" | "if" if in_rule && !has_head => "a rule's head ends with `:`",
        "solve" | "produce" | "if" if !in_rule => {
            "this word begins a clause of a rule; if the line before it is the head of a rule, it ends with `:`"
        }
        "else" if in_rule => "every clause has a condition of its own: `if … solve …`, `if … produce …`",
        "if" if in_rule => "after its condition a clause has `solve` or `produce`",
        _ if ended && before.ends_with(['+', '-', '*', '/', '^', '=', '<', '>', '&', '|']) => {
            "an operator has something on both sides: add what is missing, or remove the sign"
        }
        _ if has_open_if(line) => "in an expression `if` has three parts: `if x < 1 then 0.5 else 0`",
        _ if ended && before.ends_with("produce") => "to produce nothing, write `produce ε`",
        _ if ended && in_rule && before.ends_with(':') => {
            "under its head a rule has clauses: `solve dx/dt = …`, `if x = 1 produce …`"
        }
        _ if in_rule && !has_head && found.starts_with(|c: char| c.is_ascii_digit()) => {
            "a head names its parameters; values belong to the initial string and to successors"
        }
        _ if in_rule && !has_head && before.ends_with(|c: char| c.is_alphanumeric()) && is_word => {
            "the names of parameters are separated by commas"
        }
        _ if in_rule && last_word == "dt" => "a derivative is followed by `=`, as in `dx/dt = 0.1*x`",
        _ if in_rule && line.ends_with("solve") => "a `solve` gives derivatives: `solve dx/dt = …`",
        _ if in_rule && is_word && is_derivative(rest) => {
            if line.contains("solve") {
                "equations are separated by commas: `solve dx/dt = …, dy/dt = …`"
            } else {
                "equations stand behind `solve`: `solve dx/dt = …`"
            }
        }
        _ if is_word || found == "(" => {
            if let Some(help) = keyword_hint(found, &["if", "then", "else", "solve", "produce"]) {
                return Some(help);
            }
            if last_word.starts_with(|c: char| c.is_alphanumeric()) && line.contains(['=', '<', '>']) {
                "to multiply, write `*`: `2*x`, `r*x`"
            } else if in_rule
                && rest.lines().next().is_some_and(|l| l.contains("solve") || l.contains("produce"))
            {
                "a condition begins with `if`"
            } else {
                return None;
            }
        }
        _ => return None,
    };
    Some(advice.to_owned())
}

/// The clause keyword that stands last in a text.
fn last_keyword(text: &str) -> Option<&str> {
    let words = text.rsplit(|c: char| !(c.is_alphanumeric() || c == '_'));
    words.into_iter().find(|word| matches!(*word, "if" | "solve" | "produce"))
}

/// Whether a line ends inside an `if` that is part of an expression.
fn has_open_if(line: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let Some(at) = ["if ", "if("].iter().filter_map(|word| line.rfind(word)).max() else { return false };
    let before = line[..at].trim_end();
    let inside = before.ends_with(['=', '+', '-', '*', '/', '^', '(', ',', '<', '>'])
        || ["then", "else"].iter().any(|word| before.ends_with(word));
    !line[..at].ends_with(is_word) && inside && !line[at..].split(|c| !is_word(c)).any(|word| word == "else")
}

/// Whether a text begins with something like `dx/dt`.
fn is_derivative(text: &str) -> bool {
    let name = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).map_or("", |end| &text[..end]);
    name.starts_with('d')
        && text[name.len()..].trim_start().strip_prefix('/').is_some_and(|r| r.trim_start().starts_with("dt"))
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
    let whole = &text[item.start..item.end];
    let mut names: Vec<&'static str> = DECLARATIONS.iter().map(|(name, _)| *name).collect();
    names.extend(["if", "solve", "produce"]);
    let diagnostic = Diagnostic::error(format!("`{first}` begins no declaration and no rule"))
        .at(span, "expected a declaration, or the head of a rule such as `F(x):`");
    if matches!(first, "if" | "solve" | "produce") {
        return diagnostic.help("a clause stands under the head of its rule, such as `F(x):`");
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
    let known: Vec<&str> = DECLARATIONS.iter().map(|(name, _)| *name).collect();
    diagnostic
        .note(format!("declarations begin with {}", known.join(", ")))
        .help("a rule has a head with a colon, and clauses: `A(x): solve dx/dt = 1`")
}
