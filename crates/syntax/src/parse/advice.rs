//! Advice for texts that cannot be parsed: the notation of the declaration at hand.

use crate::declarations::Declaration;
use crate::grammar::Rule;
use crate::suggest::nearest;

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

/// Advice for units, wind, flows, tissues and gases, given the text before the error, the token there, and the text from it on.
pub fn for_scene(item: Rule, before: &str, found: &str, rest: &str) -> Option<String> {
    let is_scene = matches!(
        item,
        Rule::units_item
            | Rule::wind_item
            | Rule::flow_item
            | Rule::tissue_item
            | Rule::gas_item
            | Rule::soil_item
            | Rule::ground_item
            | Rule::pour_item
    );
    if !is_scene {
        return None;
    }
    let options = Declaration::of_rule(item)?.options.iter().map(|option| option.word);
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let said: Vec<&str> = before.split(|c| !is_word(c)).filter(|word| !word.is_empty()).collect();
    let kind = said.get(1).copied().unwrap_or_default();
    let advice = match item {
        Rule::wind_item if before.trim_end().ends_with("spectrum") => {
            "a spectrum is written `spectrum kolmogorov 1, 4, 1`; without one it is von Kármán's"
        }
        Rule::wind_item if said.contains(&"kolmogorov") => {
            "it has three values: rate of dissipation, smallest wave number, spread of frequencies, as in `spectrum kolmogorov 1, 4, 1`"
        }
        Rule::wind_item if found == "," && rest[1..].trim_start().starts_with(char::is_alphabetic) => {
            "no comma stands before `speed` and the other options: `wind 1, 0, 0 speed 3 turbulence 0.2 scale 5`"
        }
        Rule::wind_item if before.matches(',').count() < 2 && found != "," => {
            "the direction is three numbers: `wind 1, 0, 0 speed 3`"
        }
        Rule::flow_item if found == "," && matches!(kind, "source" | "sink" | "vortex") => {
            "its strength is one number, and its place stands behind `at`: `flow source 2 at 0, 1, 0 decay 3`"
        }
        Rule::flow_item if before.matches(',').count() < 2 && kind == "uniform" => {
            "its velocity is three numbers: `flow uniform 1, 0, 0`"
        }
        Rule::tissue_item | Rule::gas_item | Rule::units_item | Rule::soil_item
            if options.clone().any(|word| word == found) =>
        {
            return Some(format!("its parts are separated by commas: {}", usage(item)));
        }
        _ => return nearest(found, options).map(|word| format!("did you mean `{word}`?")),
    };
    Some(advice.to_owned())
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
