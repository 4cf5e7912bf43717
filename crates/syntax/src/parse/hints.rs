//! Hints for common errors in the notation, from the text around the error and the token there.

use super::advice;
use super::expected::is_item_with_name;
use crate::declarations;
use crate::foreign_syntax::{self, NO_COMMAS};
use crate::grammar::Rule;
use crate::suggest::nearest;

/// The hint for a syntax error, if it is a common one.
pub(super) fn hint(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let first = text.split_whitespace().next().unwrap_or_default();
    let first = first.trim_end_matches(|c: char| !c.is_alphanumeric());
    if matches!(item, Rule::rule_item)
        && let Some(word) = nearest(first, declarations::words())
        && first.len() > 3
    {
        return Some(format!("did you mean `{word}`?"));
    }
    if let Some(advice) = advice::for_block(item, &text[..at], found) {
        return Some(advice.to_owned());
    }
    if let Some(advice) = advice::for_scene(item, &text[..at], found, &text[at..]) {
        return Some(advice);
    }
    if let Some(advice) = hint_of_sign(item, text, at, found) {
        return Some(advice);
    }
    if let Some(advice) = hint_of_group(item, &text[..at], found) {
        return Some(advice.to_owned());
    }
    if let Some(advice) = hint_of_symbol(item, &text[..at], &text[at..]) {
        return Some(advice);
    }
    if let Some(advice) = hint_of_chance(item, text, at, found) {
        return Some(advice.to_owned());
    }
    hint_by_symbol(item, text, at, found).or_else(|| hint_by_word(item, text, at, found))
}

/// Hints for declarations that have a value and no name, with a sign before the value: the line as it is to be.
fn hint_of_sign(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let has_value = matches!(
        item,
        Rule::angle_item | Rule::period_item | Rule::ground_item | Rule::light_item | Rule::sky_item
    );
    let word = text[..at].trim();
    let is_alone = !word.is_empty() && word.chars().all(char::is_alphabetic);
    if !has_value || !is_alone || !matches!(found, ":" | "=") {
        return None;
    }
    let value = text[at + found.len()..].lines().next().unwrap_or_default();
    let value = value.split('#').next().filter(|_| !value.contains('"')).unwrap_or(value).trim();
    let is_short = !value.is_empty() && value.len() < 60 && !value.starts_with([':', '=']);
    is_short.then(|| format!("without `{found}`: write `{word} {value}`"))
}

/// Hints for repetitions and conditions in strings.
fn hint_of_group(item: Rule, before: &str, found: &str) -> Option<&'static str> {
    const REPEAT: &str = "a repetition is written `for i in 0 .. 3: ( F(i) )`";
    const CONDITION: &str = "a condition in a string is written `if x > 1: ( F(x) ) else ( A )`";
    let strings = matches!(item, Rule::modules | Rule::interpret_item);
    if !strings && !matches!(item, Rule::rule_item | Rule::step_item) {
        return None;
    }
    if found == "else" && strings {
        return Some(CONDITION);
    }
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    // The last word `for` or `if`, and the words behind it.
    let mut words: Vec<&str> = Vec::new();
    for word in before.rsplit(|c| !is_word(c)).filter(|word| !word.is_empty()) {
        match word {
            // A group that has ended, or begun with a module, is not the place of the mistake.
            "for" => {
                let bare = words
                    .last()
                    .is_none_or(|_| words.iter().rev().nth(1).is_none_or(|second| *second == "in"));
                return bare.then_some(REPEAT);
            }
            "if" if strings || found == "(" => return Some(CONDITION),
            "if" | "solve" | "produce" => return None,
            _ => words.push(word),
        }
        if words.len() > 12 {
            return None;
        }
    }
    None
}

/// Hints for symbols of strings in cpfg and L-Py.
fn hint_of_symbol(item: Rule, before: &str, rest: &str) -> Option<String> {
    let in_step = item == Rule::step_item && (before.contains("->") || before.contains('→'));
    if !in_step && !in_string(item, before) {
        return None;
    }
    let number = &rest[..rest.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(rest.len())];
    let is_number = number.starts_with(|c: char| c.is_ascii_digit());
    match before.chars().next_back().filter(|c| is_number && "+-&^\\/|!;".contains(*c)) {
        Some(symbol) => Some(format!("a parameter stands in parentheses: `{symbol}({number})`")),
        None => foreign_syntax::symbol(before, rest),
    }
}

/// Hints for successors with weights and for events at a rate.
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
        "solve" | "" | "\n"
            if before
                .rsplit('\n')
                .next()
                .is_some_and(|line| line.contains("at rate") && !line.contains("produce")) =>
        {
            Some("what happens at a rate is a production: `at rate 0.5 produce …`")
        }
        _ if last == "rate" && words.len() > 1 && words[words.len() - 2] != "at" => Some(
            "a production at a rate is written `at rate 0.5 produce …`, with `if …` before it if it has a condition",
        ),
        _ => None,
    }
}

/// Hints from the symbols around the error.
fn hint_by_symbol(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let previous = before.chars().next_back();
    let touching = before.len() == at;
    let in_rule = item == Rule::rule_item;
    let advice = match (previous, found) {
        (_, ":") if in_rule && text[at..].starts_with(":=") => EQUATION,
        (Some('d'), "(") if in_rule && last_keyword(before) == Some("solve") => EQUATION,
        (Some('/'), word) if in_rule && word.starts_with('d') && last_keyword(before) == Some("solve") => {
            "rates are by time: `dx/dt = …`"
        }
        (_, "|") if in_rule && previous.is_some_and(|c| "+-*/(=<,".contains(c)) => {
            "an absolute value is written `abs(x)`"
        }
        (Some('='), "=") if touching => "equality is written with one `=`",
        (Some('='), "<" | ">") if touching => "“at most” is written `<=`, “at least” `>=`",
        (Some('<'), ">") if touching => "“not equal” is written `!=`",
        (Some('&'), "&") if touching => "“and” is written with one `&`",
        (Some('|'), "|") if touching => "“or” is written with one `|`",
        (Some('*'), "*") if touching => "a power is written `x^2`",
        (_, "?") => "a choice between numbers is written `if x > 1 then x else 0`",
        (_, "%") if item == Rule::step_item => return Some(hint_of_remainder(before, &text[at + 1..])),
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
        (_, "%") if !in_string(item, before) => return Some(hint_of_remainder(before, &text[at + 1..])),
        (_, "±") => "`±` stands for both turns in the head of a rule only; write `+` or `-`",
        (_, "~") => "“not” is written `!`",
        (_, "'") => "a derivative is written `dx/dt`",
        _ if in_rule && is_primed(&text[at..]) => {
            "a derivative is written `dx/dt`, and stands behind `solve`: `solve dx/dt = …`"
        }
        (Some('m'), _) if item == Rule::surface_item && before.ends_with("from") => {
            "the name of the file is a text in quotes: `surface @P from \"petal.s\"`"
        }
        (Some('e'), _) if item == Rule::surface_item && before.ends_with("texture") => {
            "the name of the picture is a text in quotes: `surface @P from \"petal.s\" texture \"petal.png\"`"
        }
        (_, word) if item == Rule::surface_item && word.starts_with("textur") => {
            "a picture stands behind the file of its surface: `surface @P from \"petal.s\" texture \"petal.png\"`"
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
        (_, "-" | "=" | ",") if item == Rule::frames_item && !text[at..].contains("..") => {
            "frames are written `frames 0 .. 10 step 0.1`"
        }
        (_, "=") if item == Rule::angle_item => "the angle is written `angle 45`",
        (_, "step") if item == Rule::param_item => {
            "a `param` has a range and no step: any value in it can be chosen: `param r = 1 in 0 .. 10`"
        }
        (_, ":") if matches!(item, Rule::ignore_item | Rule::consider_item) => {
            "names stand behind the word, without a colon: `ignore F_x @L`; turns and other symbols are passed over anyway"
        }
        (_, ",")
            if matches!(
                item,
                Rule::ignore_item | Rule::consider_item | Rule::solid_item | Rule::shelf_item
            ) =>
        {
            "there are spaces between names: `Ball Post`"
        }
        (_, "<" | ">") if item == Rule::interpret_item => {
            "a drawing does not depend on the context of a module"
        }
        // Numbers with a space between them may be two equations; without one, the comma is a decimal comma.
        (Some(','), _)
            if in_rule
                && has_decimal_comma(&text[..at])
                && found.starts_with(|c: char| c.is_ascii_digit()) =>
        {
            DECIMAL
        }
        (Some(c), ",") if c.is_ascii_digit() && touching && item != Rule::modules => DECIMAL,
        (_, "=") if item == Rule::modules && text[at..].starts_with("=>") => {
            "a discrete rule is written `A(x) : x > 3 -> F(x)`"
        }
        (_, ",") if item == Rule::modules || item == Rule::interpret_item => NO_COMMAS,
        (Some(c), ",") if in_rule && last_keyword(before) == Some("produce") && is_end_of_module(c) => {
            NO_COMMAS
        }
        (_, "(") if in_string(item, before) => "a branch stands in square brackets: `[ +(45) F(1) ]`",
        (Some('{'), _) if is_argument(before, found, '{') => ROUND,
        (Some('['), _) if is_argument(before, found, '[') => ROUND,
        (Some(']'), ":") if in_rule && !before.contains(':') => ROUND,
        (c, ".")
            if text[at + 1..].starts_with(|c: char| c.is_ascii_digit())
                || c.is_some_and(|c| c.is_ascii_digit()) =>
        {
            "a number begins and ends with a digit: `0.5`, `2`"
        }
        (_, ".") if text[at + 1..].starts_with("strain") => {
            "a rule reads its own `strain` only: let the neighbour hold its own in a parameter, `solve s = strain`, and read that"
        }
        (_, ".") if text[at + 1..].starts_with("force_") => {
            "a rule reads the force on its own solid only: let the neighbour hold its own in a parameter, `solve f = force_y`, and read that"
        }
        (Some(')'), ":") if in_rule && !before.contains(':') => {
            "a rule has one predecessor; modules around it are its context: `A(x) < B(y) > C(z):`"
        }
        (_, "=") if in_rule && before.ends_with(|c: char| c.is_alphanumeric()) => EQUATION,
        (_, ":") if in_rule && last_keyword(before) == Some("if") => {
            "a condition has no `:` behind it: `if x < 1 solve …`"
        }
        (_, ":") if in_rule && before.contains(':') => "a new rule begins on a line of its own",
        _ => return None,
    };
    Some(advice.to_owned())
}

/// The hint for `%` between two numbers.
fn hint_of_remainder(before: &str, behind: &str) -> String {
    let is_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
    let x = &before[before.trim_end_matches(is_word).len()..];
    let behind = behind.trim_start();
    let y = &behind[..behind.find(|c| !is_word(c)).unwrap_or(behind.len())];
    match x.is_empty() || y.is_empty() {
        true => foreign_syntax::remainder("x", "y"),
        false => foreign_syntax::remainder(x, y),
    }
}

const EQUATION: &str = "an equation is written `dx/dt = …`";
const DECIMAL: &str = "the decimal sign is a point: `0.5`";
const POINT: &str = "a number begins with a digit: `0.5`";
const ROUND: &str = "parameters stand in round parentheses: `A(x)`";
const ARROW: &str = "in a clause a production is written `if x = 2 produce …`; a discrete rule has its arrow behind the head: `A(x) : x > 3 -> …`";

/// True if a text begins with a number that has no digit before its point.
fn begins_with_a_point(text: &str) -> bool {
    text.trim_start().strip_prefix('.').is_some_and(|behind| behind.starts_with(|c: char| c.is_ascii_digit()))
}

/// Hints for discrete rules.
fn hint_for_step(text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let rest = text[at..].trim_start();
    let has_arrow = before.contains("->") || before.contains('→');
    let advice = match found {
        "" | "\n" | "*" if before.ends_with("->") || before.ends_with('→') => {
            "to produce nothing, write `-> ε`"
        }
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
        "." if begins_with_a_point(rest) => POINT,
        ":" if has_arrow => "the condition stands before the arrow: `A(x) : x > 3 -> F(x)`",
        ">" | "→" if has_arrow => "a rule has one arrow; a new rule begins on a line of its own",
        "," if has_arrow => NO_COMMAS,
        "," if before.len() == at && before.ends_with(|c: char| c.is_ascii_digit()) => DECIMAL,
        _ if before.ends_with(['{', '['])
            && is_argument(before, found, '{') | is_argument(before, found, '[') =>
        {
            ROUND
        }
        ":" if before.ends_with(']') => ROUND,
        "(" if has_arrow => "a branch stands in square brackets: `[ +(45) F(1) ]`",
        _ => return None,
    };
    Some(advice.to_owned())
}

/// Hints from the words around the error.
fn hint_by_word(item: Rule, text: &str, at: usize, found: &str) -> Option<String> {
    let before = text[..at].trim_end();
    let rest = &text[at..];
    let in_rule = item == Rule::rule_item;
    let has_head = before.contains(':');
    let is_word = found.starts_with(|c: char| c.is_alphabetic());
    let ended = matches!(found, "\n" | "");
    // The line up to the error.
    let line = before.rsplit('\n').next().unwrap_or(before).trim();
    let last_word = line.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
    let advice = match found {
        "ignore" | "consider" | "solid" | "shelf" => "brackets cannot be chosen: they are no modules",
        "." if begins_with_a_point(rest) => POINT,
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
        "if" if item == Rule::interpret_item => {
            "a condition in a drawing is written `if x > 1: ( F(x) ) else ( A )`; a choice between numbers goes into an argument: `F(if x > 1 then x else 0)`"
        }
        "solve" | "produce" if item == Rule::interpret_item => {
            "a drawing has no clauses; its modules stand behind the colon: `interpret A(x): F(x)`"
        }
        "solve" | "produce" | "if" if !in_rule => {
            "this word begins a clause of a rule; if the line before it is the head of a rule, it ends with `:`"
        }
        "else" if in_rule => "every clause has a condition of its own: `if … solve …`, `if … produce …`",
        "if" if in_rule => {
            "after its condition a clause has `solve` or `produce`; the condition stands before them: `if x < 1 solve dx/dt = 1`"
        }
        _ if ended && before.ends_with(['+', '-', '*', '/', '^', '=', '<', '>', '&', '|']) => {
            "an operator has something on both sides: add what is missing, or remove the sign"
        }
        _ if has_open_if(line) => "in an expression `if` has three parts: `if x < 1 then 0.5 else 0`",
        _ if (ended || found == "*") && before.ends_with("produce") => {
            "to produce nothing, write `produce ε`"
        }
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
            if dlsys_expr::Unary::NAMED.iter().any(|(name, _)| *name == last_word) && is_word {
                return Some(format!("arguments stand in parentheses: `{last_word}({found})`"));
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
        _ if is_no_letter(found) => "the names of modules and parameters are made of letters, digits and `_`",
        _ => return None,
    };
    Some(advice.to_owned())
}

/// True for characters such as 🌷, which occur in no name, number or operator.
fn is_no_letter(found: &str) -> bool {
    found.starts_with(|c: char| !c.is_ascii() && !c.is_alphanumeric() && !c.is_whitespace() && c > '\u{2190}')
}

/// True if a text ends with a number and a comma that touches it, as `0,5` does before its second digit.
fn has_decimal_comma(before: &str) -> bool {
    before.strip_suffix(',').is_some_and(|rest| rest.ends_with(|c: char| c.is_ascii_digit()))
}

/// True if a module can end with this character.
fn is_end_of_module(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, ')' | ']' | '_')
}

/// True if a string of modules has begun and may continue.
fn in_string(item: Rule, before: &str) -> bool {
    match item {
        Rule::modules => true,
        Rule::interpret_item => before.contains(':'),
        Rule::rule_item => last_keyword(before) == Some("produce"),
        _ => false,
    }
}

/// True if the token found is an argument in the wrong brackets, as in `A{0}`.
fn is_argument(before: &str, found: &str, parenthesis: char) -> bool {
    let name =
        before.strip_suffix(parenthesis).is_some_and(|rest| rest.ends_with(|c: char| c.is_alphanumeric()));
    name && found.starts_with(|c: char| c.is_ascii_digit())
}

/// True if a text begins with a derivative in the form `x'`.
fn is_primed(text: &str) -> bool {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    end > 0 && text[end..].starts_with(['\'', '′', '’'])
}

/// The last clause keyword in a text.
fn last_keyword(text: &str) -> Option<&str> {
    let words = text.rsplit(|c: char| !(c.is_alphanumeric() || c == '_'));
    words.into_iter().find(|word| matches!(*word, "if" | "solve" | "produce"))
}

/// True if a line ends inside an `if` that is part of an expression.
fn has_open_if(line: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let Some(at) = ["if ", "if("].iter().filter_map(|word| line.rfind(word)).max() else { return false };
    let before = line[..at].trim_end();
    let inside = before.ends_with(['=', '+', '-', '*', '/', '^', '(', ',', '<', '>'])
        || ["then", "else"].iter().any(|word| before.ends_with(word));
    !line[..at].ends_with(is_word) && inside && !line[at..].split(|c| !is_word(c)).any(|word| word == "else")
}

/// True if a text begins with a derivative in the form `dx/dt`.
pub(super) fn is_derivative(text: &str) -> bool {
    let name = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).map_or("", |end| &text[..end]);
    name.starts_with('d')
        && text[name.len()..].trim_start().strip_prefix('/').is_some_and(|r| r.trim_start().starts_with("dt"))
}

pub(super) fn keyword_hint(found: &str, known: &[&'static str]) -> Option<String> {
    nearest(found, known.iter().copied()).map(|word| format!("did you mean `{word}`?"))
}
