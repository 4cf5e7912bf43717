//! What to write instead: the help of messages, in the words and names of the text that they are about.
//!
//! A message says what is wrong where it is found; what to do about it often takes more of the text than the place
//! itself. That part is here, so that the passes stay readable.

use super::ast::{Expr, ExprId, Expressions, HeadModule, Module, Name};
use super::parse::Rule;
use super::print;
use super::scope::{RESERVED, Variables};
use super::suggest::{did_you_mean, meant, nearest};
use dlsys_diagnostic::Diagnostic;
use dlsys_model::{Class, Kinds};

/// Of something declared twice.
pub fn twice(name: &str) -> String {
    format!("keep one of them, or call the second `{}`", numbered(name))
}

/// `k` becomes `k_2`, `s_2` becomes `s_3`.
pub fn numbered(name: &str) -> String {
    match name.rsplit_once('_').map(|(base, number)| (base, number.parse::<u32>())) {
        Some((base, Ok(number))) if number < u32::MAX => format!("{base}_{}", number + 1),
        _ => format!("{name}_2"),
    }
}

/// Of a value that is infinite or no number.
pub fn not_finite(value: f64) -> &'static str {
    if value.is_nan() {
        "a root or logarithm of a negative number, 0/0, an inverse or an element that is not there have no value: change what it is computed from"
    } else {
        "look for a division by 0, the logarithm of 0, or a number that is too large: change what it is computed from"
    }
}

/// The modules of a model that have names, as `A`, `F` and `Leaf`.
pub fn known_words(kinds: &Kinds) -> Option<String> {
    const MOST: usize = 8;
    let mut names: Vec<&str> =
        kinds.iter().filter(|(_, k)| k.class() == Class::Word).map(|(_, k)| k.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let more = names.len() > MOST;
    names.truncate(MOST);
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    (!quoted.is_empty()).then(|| quoted.join(", ") + if more { ", …" } else { "" })
}

/// Of a module that a context, `ignore` or `consider` names and no string has; `nowhere` is a name that is no module.
pub fn no_such_module(kinds: &Kinds, nowhere: &str) -> String {
    let others = || kinds.iter().map(|(_, k)| k.name.as_str()).filter(|name| *name != nowhere);
    if let Some(near) = nearest(nowhere, others()) {
        return meant(nowhere, near);
    }
    let advice =
        format!("put `{nowhere}` into the initial string or a successor, or name a module that is there");
    match known_words(kinds) {
        Some(known) => format!("{advice}: {known}"),
        None => advice,
    }
}

/// Of two parameters of one head with the same name.
pub fn other_name(name: &str, left: bool, right: bool) -> String {
    let other = match (left, right) {
        (false, false) => numbered(name),
        (_, false) => format!("{name}_l"),
        (_, true) => format!("{name}_r"),
    };
    format!("give each a name of its own, such as `{name}` and `{other}`")
}

/// An equation for something that is no parameter of its module.
pub fn not_a_parameter(name: &Name, head: &HeadModule, variables: &Variables) -> Diagnostic {
    let known = head.parameters.iter().map(|p| &*p.text);
    let error =
        Diagnostic::error(format!("`{}` is no parameter of `{}`", name.text, print::head_module(head)))
            .at(name.span, "only the parameters of the strict predecessor have equations")
            .at(head.span, "the strict predecessor");
    if variables.lets.contains_key(&name.text) {
        return error.help("a `let` names an expression; nothing is stored that could be solved");
    }
    if variables.names.contains_key(&name.text) && !RESERVED.contains(&&*name.text) {
        return error
            .help("this is a parameter of a neighbour; its equation belongs into the neighbour's rule");
    }
    error.help(did_you_mean(&name.text, known).unwrap_or_else(|| {
        let more = head_and(head, &name.text);
        format!(
            "to let `{}` change, make it a parameter: `{more}`, with a start value wherever `{}` is made",
            name.text, head.name.text
        )
    }))
}

/// A head with this many names: those it has, and others for those it lacks.
pub fn head_with(head: &HeadModule, wanted: usize) -> String {
    let mut names: Vec<String> = head.parameters.iter().take(wanted).map(|p| p.text.to_string()).collect();
    let mut spare = ('a'..='z').map(String::from).filter(|c| head.parameters.iter().all(|p| *p.text != **c));
    while names.len() < wanted.min(20) {
        names.extend(spare.next());
    }
    if names.is_empty() {
        head.name.text.to_string()
    } else {
        format!("{}({})", head.name.text, names.join(", "))
    }
}

/// A head with one more name.
pub fn head_and(head: &HeadModule, name: &str) -> String {
    let names = head.parameters.iter().map(|p| &*p.text).chain([name]);
    format!("{}({})", head.name.text, names.collect::<Vec<_>>().join(", "))
}

/// Of a module whose number of parameters is not that of its rule or drawing.
pub fn wrong_arity(module: &Module, head: &HeadModule, place: &str) -> String {
    let given = module.arguments.len();
    let right = print::head_module(head);
    let more: Vec<String> = head.parameters.iter().skip(given).map(|p| format!("`{}`", p.text)).collect();
    let first = if !more.is_empty() {
        format!("also give a value for {}, as in `{right}`", more.join(", "))
    } else if right == *module.name {
        format!("write `{right}` alone")
    } else {
        format!("write it as `{right}`")
    };
    let other = if place == "in its rule" { "a rule" } else { "an `interpret`" };
    let own = super::scope::plural(given, "parameter");
    format!("{first}; or write {other} for `{}` with {own}", module.name)
}

/// Arguments as they are meant where the right number of them, and no other, comes of commas for decimal points: `0,5` is two
/// numbers with nothing but the comma between them.
pub fn decimal_comma(
    all: &Expressions,
    arguments: impl Iterator<Item = ExprId>,
    wanted: usize,
) -> Option<String> {
    let digits = |id: ExprId| match all.get(id) {
        Expr::Number(x) if x.fract() == 0.0 => Some(all.span(id)),
        _ => None,
    };
    let mut meant: Vec<(String, Option<u32>)> = Vec::new();
    let mut joined = false;
    for id in arguments {
        let text = print::expression(all, id);
        let whole = digits(match all.get(id) {
            Expr::Negate(inner) => *inner,
            _ => id,
        });
        match (meant.last_mut(), digits(id)) {
            (Some((before, end)), Some(span)) if end.is_some_and(|end| end + 1 == span.start) => {
                // The zeros of `0,05` are no part of the number.
                let width = (span.end - span.start) as usize;
                before.push_str(&format!(".{text:0>width$}"));
                (*end, joined) = (None, true);
            }
            _ => meant.push((text, whole.map(|span| span.end))),
        }
    }
    let texts: Vec<String> = meant.into_iter().map(|(text, _)| text).collect();
    (joined && texts.len() == wanted).then(|| texts.join(", "))
}

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

/// Of `;(rose)` and `@C(square)` where nothing has that name: what to declare is no constant.
pub fn of_look(module: &Module, all: &Expressions, said: &mut [Diagnostic]) {
    let example = match &*module.name {
        ";" => "color NAME = \"#e573a5\"",
        "@C" => "contour NAME = (1, 1) (-1, 1) (-1, -1) (1, -1)",
        _ => return,
    };
    let Some(Expr::Name(name)) = module.arguments.first().map(|a| all.get(a.root)) else { return };
    let message = format!("unknown name `{name}`");
    for unknown in said.iter_mut().filter(|d| d.message == message) {
        let declare = unknown.help.iter().position(|help| help.starts_with("declare it"));
        if let Some(at) = declare {
            unknown.help[at] = format!("declare it: `{}`", example.replace("NAME", name));
        }
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
    fn second_names_count_on() {
        assert_eq!(numbered("k"), "k_2");
        assert_eq!(numbered("x_max"), "x_max_2");
        assert_eq!(numbered("s_2"), "s_3");
    }

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
