//! Advice for texts that cannot be parsed: how the declaration at hand is written.

use super::Rule;

/// Advice for curves, tables, arrays and names within rules, by the text before the place and what was found there.
pub fn for_block(item: Rule, before: &str, found: &str) -> Option<&'static str> {
    let previous = before.trim_end().chars().next_back();
    match item {
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

/// How a declaration is written, for mistakes about which nothing better is known.
pub fn usage(item: Rule) -> &'static str {
    match item {
        Rule::title_item => "a title is written `title \"Anabaena\"`",
        Rule::const_item => "a constant is written `const k = 0.5`",
        Rule::param_item => "a param is written `param r = 0.5`, or with a range `param r = 0.5 in 0 .. 1`",
        Rule::def_item => "a function is written `def growth(x, r) = r*x`",
        Rule::include_item => "other texts are taken in by `include \"organs.dls\"`",
        Rule::curve_item => "a curve is written `curve g = (0, 0) (1, 0.3) (2, 1)`",
        Rule::table_item => "a table is written `table g from \"file.csv\"`",
        Rule::angle_item => "the angle is written `angle 45`, in degrees",
        Rule::period_item => "the period of discrete rules is written `period 1`",
        Rule::frames_item => "frames are written `frames 0 .. 10 step 0.1`",
        Rule::color_item => "a colour is written `color rose = \"#e573a5\"`",
        Rule::gradient_item => "a gradient is written `gradient leaf = \"#b9cf6a\", \"#4d7d38\"`",
        Rule::surface_item => "a surface is written `surface @P from \"petal.s\"`",
        Rule::contour_item => "a contour is written `contour leaf = (1, 0) (0, 0.3) (-1, 0) (0, -0.3)`",
        Rule::tropism_item => "a tropism is written `tropism 0, -1, 0 strength 0.2`",
        Rule::ignore_item => "modules that are no context are written `ignore F_x @L`",
        Rule::consider_item => "the modules that are context are written `consider F A`",
        Rule::interpret_item => "a drawing is written `interpret A(x): !(0.1) F(x)`",
        Rule::step_item => "a discrete rule is written `A(x) : x > 3 -> F(x) A(x/2)`",
        Rule::modules => "a string of modules is written `F(1) [ +(45) A(0) ] A(0)`",
        _ => "a rule is written `A(x): if x < 1 solve dx/dt = 1 if x = 1 produce F(x) A(0)`",
    }
}

/// The initial string as it is to be written, from the line on which it was tried.
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
