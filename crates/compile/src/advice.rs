//! Help texts of messages, written with the names of the model.
//!
//! A remedy often depends on more of the text than the place of the error. The functions that derive it are collected
//! here, so that the passes stay readable.

use crate::inputs;
use crate::scope::{RESERVED, Variables};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{Class, ELASTIC, Kinds, SOURCE};
use dlsys_syntax::ast::{Expr, ExprId, Expressions, HeadModule, Module, Name};
use dlsys_syntax::print;
use dlsys_syntax::suggest::{did_you_mean, meant, nearest};

/// Help for a name that is declared twice.
pub fn twice(name: &str) -> String {
    format!("keep one of them, or call the second `{}`", numbered(name))
}

/// Something that may be given once, at two places.
pub fn given_twice(what: &str, [first, second]: [Span; 2]) -> Diagnostic {
    Diagnostic::error(format!("{what} is given twice"))
        .at(second, "the second time")
        .at(first, "the first time")
        .help("keep one of them, and remove the other")
}

/// A declaration beyond the largest number of them.
pub fn too_many(most: usize, what: &str, span: Span, help: &str) -> Diagnostic {
    Diagnostic::error(format!("more than {most} {what}")).at(span, "this one is too many").help(help)
}

/// The next numbered name: `k_2` for `k`, `s_3` for `s_2`.
pub fn numbered(name: &str) -> String {
    match name.rsplit_once('_').map(|(base, number)| (base, number.parse::<u32>())) {
        Some((base, Ok(number))) if number < u32::MAX => format!("{base}_{}", number + 1),
        _ => format!("{name}_2"),
    }
}

/// Help for a value that is infinite or not a number.
pub fn not_finite(value: f64) -> &'static str {
    if value.is_nan() {
        "a root or logarithm of a negative number, 0/0, an inverse or an element that is not there have no value: change what it is computed from"
    } else {
        "look for a division by 0, the logarithm of 0, or a number that is too large: change what it is computed from"
    }
}

/// The names of a model's modules that are words, such as `A`, `F` and `Leaf`.
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

/// Help for a module that a context, `ignore` or `consider` names but no string contains.
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

/// The error for two parameters of one head with the same name.
pub fn other_name(name: &str, left: bool, right: bool) -> String {
    let other = match (left, right) {
        (false, false) => numbered(name),
        (_, false) => format!("{name}_l"),
        (_, true) => format!("{name}_r"),
    };
    format!("give each a name of its own, such as `{name}` and `{other}`")
}

/// The error for an equation whose left side is not a parameter of the module.
pub fn not_a_parameter(name: &Name, head: &HeadModule, variables: &Variables) -> Diagnostic {
    let known = head.parameters.iter().map(|p| &*p.text);
    let error =
        Diagnostic::error(format!("`{}` is no parameter of `{}`", name.text, print::head_module(head)))
            .at(name.span, "only the parameters of the strict predecessor have equations")
            .at(head.span, "the strict predecessor");
    if variables.lets.contains_key(&name.text) {
        return error.help("a `let` names an expression; nothing is stored that could be solved");
    }
    if let Some(quantity) = inputs::named(&name.text) {
        let from =
            if quantity.is_force() { "what sheets and soil do to the solid" } else { "the bending of stems" };
        return error.help(format!(
            "`{}` follows from {from}; to compute one of your own, give the module a parameter of that name",
            quantity.name()
        ));
    }
    if variables.names.contains_key(&name.text) && !RESERVED.contains(&&*name.text) {
        return error
            .help("this is a parameter of a neighbour; its equation belongs in the neighbour's rule");
    }
    error.help(did_you_mean(&name.text, known).unwrap_or_else(|| {
        let more = head_and(head, &name.text);
        format!(
            "to let `{}` change, make it a parameter: `{more}`, with a start value wherever `{}` is made",
            name.text, head.name.text
        )
    }))
}

/// A head with this many parameters: its own names first, then new ones.
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

/// A head with one more parameter.
pub fn head_and(head: &HeadModule, name: &str) -> String {
    let names = head.parameters.iter().map(|p| &*p.text).chain([name]);
    format!("{}({})", head.name.text, names.collect::<Vec<_>>().join(", "))
}

/// Help for a module whose number of parameters differs from that of its rule or drawing.
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
    let own = crate::scope::plural(given, "parameter");
    format!("{first}; or write {other} for `{}` with {own}", module.name)
}

/// The arguments with decimal points in place of commas, if there is exactly one reading with the right number of
/// arguments: `0,5` is two numbers with nothing but the comma between them.
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
                // The value of the second number does not contain the zeros of `0,05`.
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

/// Help for an unknown name in `;(rose)`, `@C(square)`, `@E(stalk)` or `@S(steam)`: the missing declaration is a colour, a contour,
/// a tissue or a gas.
pub fn of_look(module: &Module, all: &Expressions, said: &mut [Diagnostic]) {
    let example = match &*module.name {
        ";" => "color NAME = \"#e573a5\"",
        "@C" => "contour NAME = (1, 1) (-1, 1) (-1, -1) (1, -1)",
        ELASTIC => "tissue NAME = stiffness 2e8, density 900, damping 0.05",
        SOURCE => "gas NAME = size 0.01, mass 1e-6, extinction 200",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_names_count_up() {
        assert_eq!(numbered("k"), "k_2");
        assert_eq!(numbered("x_max"), "x_max_2");
        assert_eq!(numbered("s_2"), "s_3");
    }
}
