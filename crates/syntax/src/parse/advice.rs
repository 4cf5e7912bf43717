//! Advice for texts that cannot be parsed: the notation of the declaration at hand.

use crate::declarations::Declaration;
use crate::grammar::Rule;

/// Advice for curves, tables, arrays and names within rules, given the text before the error and the token there.
pub fn for_block(item: Rule, before: &str, found: &str) -> Option<&'static str> {
    let previous = before.trim_end().chars().next_back();
    match item {
        Rule::curve_item if before.contains('"') => Some(
            "a function of cpfg is written `curve g from \"g.func\"`, or `curve g from \"functions.fset\" item \"NAME\"`",
        ),
        Rule::curve_item if before.trim_end().ends_with("from") => {
            Some("the name of the file is a text in quotes: `curve g from \"g.func\"`")
        }
        Rule::curve_item if found == "from" => Some(
            "a function of cpfg is a B-spline, and `from` stands behind its name: `curve g from \"g.func\"`",
        ),
        Rule::curve_item if before.contains('=') => {
            Some("a curve is two points or more, of two numbers each: `curve g = (0, 0) (1, 0.3) (2, 1)`")
        }
        Rule::curve_item if before.split_whitespace().count() == 2 && found != "=" => {
            Some("a curve is `linear`, `monotone` or `spline`: `curve linear g = (0, 0) (2, 1)`")
        }
        Rule::table_item if before.split_whitespace().count() > 1 => Some(
            "a table is written `table g from \"file.csv\"`, or `table g from \"file.csv\" column \"name\"`",
        ),
        Rule::include_item => Some("the name of the file is a text in quotes: `include \"organs.dls\"`"),
        Rule::const_item if previous == Some('[') && found == "]" => {
            Some("an array has one element or more: `const a = [1, 2, 3]`")
        }
        Rule::const_item if found == "[" && matches!(previous, Some('[' | ',')) => {
            Some("the elements of an array are numbers: `const a = [1, 2, 3]`")
        }
        Rule::rule_item if found == "let" => {
            Some("a `let` stands between the head of its rule and the first clause")
        }
        _ => None,
    }
}

/// The notation of a declaration or rule, for errors without a specific hint.
pub fn usage(item: Rule) -> &'static str {
    match item {
        Rule::step_item => "a discrete rule is written `A(x) : x > 3 -> F(x) A(x/2)`",
        _ => Declaration::of_rule(item).map_or(
            "a rule is written `A(x): if x < 1 solve dx/dt = 1 if x = 1 produce F(x) A(0)`",
            |declaration| declaration.written,
        ),
    }
}

/// The corrected initial string for a line that attempts to declare one.
pub fn initial_string(line: &str) -> String {
    let line = line.split('#').next().unwrap_or_default();
    let string = match line.split_once(':') {
        Some((_, string)) => string,
        None => {
            let words = |c: char| c.is_lowercase() || c.is_whitespace();
            line.trim_start_matches(words)
        }
    };
    let string: String = string.trim().chars().take(40).collect();
    match &*string {
        "" => "write its modules behind a colon: `initial string: F(1) A`".to_owned(),
        string => format!("write `initial string: {string}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_initial_string_is_completed() {
        assert_eq!(initial_string("initial: F(1)"), "write `initial string: F(1)`");
        assert_eq!(initial_string("initial string F(1) A # two"), "write `initial string: F(1) A`");
        assert_eq!(
            initial_string("initial string"),
            "write its modules behind a colon: `initial string: F(1) A`"
        );
    }
}
