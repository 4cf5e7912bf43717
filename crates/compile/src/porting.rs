//! Warnings for texts that mean something else in cpfg or L-Py, and for what has no effect here without being an error.

use rustc_hash::FxHashMap;

use crate::clauses::names_of;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{Class, DRAWN_WORDS, KindId, Model, base_of};
use dlsys_syntax::ast::{self, Action, Document, Expr, Expressions, Item, Stray, modules_of};
use dlsys_syntax::foreign_syntax;
use dlsys_syntax::print;
use dlsys_syntax::suggest::nearest;

/// Most warnings of one kind.
const MOST: usize = 5;

/// Warns of `#(w)`, which is a comment.
pub fn comments(document: &Document, diagnostics: &mut Vec<Diagnostic>) {
    for (span, inside) in &document.commented_widths {
        diagnostics.push(
            Diagnostic::warning("the rest of this line is a comment")
                .at(*span, "`#` begins a comment; in cpfg it sets the width of lines")
                .help(format!("a width is written `!({inside})`; a comment that begins with a parenthesis has a space before it: `# (…)`")),
        );
    }
}

/// Warns of signs in strings that end something in C.
pub fn strays(document: &Document, diagnostics: &mut Vec<Diagnostic>) {
    for (span, stray) in &document.strays {
        let (what, at, help) = match *stray {
            Stray::Comment => (
                "`//` begins no comment",
                "these are two rolls, and the words behind them are modules",
                "a comment begins with `#` and ends with its line",
            ),
            Stray::Continuation => (
                "`\\` at the end of a line does not join lines",
                "this is a roll by `angle`",
                "a string goes on in the next line by itself: leave the sign out, or begin the next line with it",
            ),
            Stray::Directive => (
                "this line is a comment",
                "`#` begins a comment; nothing is included or left out",
                "write `include \"FILE.dls\"`; lines between `#ifdef` and `#endif` count: delete those that are not meant",
            ),
            Stray::Definition(number) => {
                let (name, meaning) = &document.commented[number];
                let help = foreign_syntax::of_definition(name, meaning);
                // Where its name is read, an error has said so.
                if !diagnostics.iter().any(|said| said.help.contains(&help)) {
                    diagnostics.push(
                        Diagnostic::warning("this line is a comment")
                            .at(*span, "`#` begins a comment; nothing is defined")
                            .help(help),
                    );
                }
                continue;
            }
            Stray::End => (
                "`;` does not end a line",
                "this takes the next colour for what follows",
                "a declaration ends with its line: leave the sign out; as a module it has a space before it",
            ),
        };
        diagnostics.push(Diagnostic::warning(what).at(*span, at).help(help));
    }
}

/// Warns of turns in the initial string to which a rule for `±` applies, and of symbols whose parameters, or the lack of them, mean
/// something else in cpfg.
pub fn strings(document: &Document, written: &[&ast::Rule], diagnostics: &mut Vec<Diagnostic>) {
    let axioms = document.items.iter().filter_map(|(item, _)| match item {
        Item::Axiom(modules) => Some(modules),
        _ => None,
    });
    let drawings = document.items.iter().filter_map(|(item, _)| match item {
        Item::Interpret { drawn, .. } => Some(drawn),
        _ => None,
    });
    let successors =
        written.iter().flat_map(|rule| &rule.clauses).filter_map(|clause| match &clause.action {
            Action::Produce(all) => Some(all.iter().flat_map(|alternative| modules_of(&alternative.modules))),
            Action::Solve(_) => None,
        });
    let all = axioms.clone().chain(drawings).flat_map(|parts| modules_of(parts)).chain(successors.flatten());
    let all: Vec<&ast::Module> = all.collect();
    let of_cpfg = all.iter().filter_map(|module| of_parameters(module, &document.expressions));
    diagnostics.extend(of_cpfg.take(MOST));
    // A subscript says which turns are meant.
    let both: Vec<&&ast::Rule> = written.iter().filter(|rule| &*rule.predecessor.name.text == "±").collect();
    for module in axioms.flat_map(|parts| modules_of(parts)) {
        let applies = |rule: &&&&ast::Rule| {
            rule.predecessor.parameters.len() == module.arguments.len()
                && names_of(rule).iter().any(|name| **name == *module.name)
        };
        if let Some(rule) = both.iter().find(applies) {
            diagnostics.push(of_both_turns(module, rule));
            break;
        }
    }
    if let Some(module) = all.iter().find(|module| &*module.name == "!" && module.arguments.is_empty()) {
        diagnostics.push(thinner(module, written.iter().any(|rule| rule.discrete)));
    }
}

fn thinner(module: &ast::Module, discrete: bool) -> Diagnostic {
    let carried = match discrete {
        true => "`A(l, w) -> !(w) F(l) A(l, w - 0.1)`",
        false => "`A(l, w): if age = 1 produce !(w) F(l) A(l, w - 0.1)`",
    };
    Diagnostic::warning("`!` without a parameter multiplies the width by 0.7")
        .at(module.span, "cpfg and L-Py subtract a step from the width here")
        .help(format!("write the width, `!(w)`, with a parameter that carries it: {carried}"))
        .help("where 0.7 times the width is meant, a subscript says so: `!_s`")
}

/// The warning for a parameter that cpfg gives a meaning that it does not have here.
fn of_parameters(module: &ast::Module, all: &Expressions) -> Option<Diagnostic> {
    let text = |i: usize| print::expression(all, module.arguments[i].root);
    let is_number = |i: usize| matches!(all.get(module.arguments[i].root), Expr::Number(_));
    match (&*module.name, module.arguments.len()) {
        ("{", 1..) => Some(
            Diagnostic::warning(format!("`{{({})` begins a polygon, and its parameter means nothing", text(0)))
                .at(module.span, "in cpfg a generalised cylinder begins here")
                .help("consecutive lines are one smooth stem without further signs: leave `{(…)` and its `}` out; `@W(w)` gives it its width at this place, and `@C(name)` a cross-section")
                .help("a polygon begins with `{` alone"),
        ),
        (";", 2) if is_number(0) && is_number(1) => Some(
            Diagnostic::warning(format!("the second parameter of `;` means nothing here: both sides have colour {}", text(0)))
                .at(module.span, "in cpfg this is the colour of the back")
                .help(format!("leave it out: `;({})`; a second parameter is a place in a gradient, from 0 to 1: `gradient leaf = \"#8bb04f\", \"#4f8a3a\"`, then `;(leaf, 0.5)`", text(0))),
        ),
        _ => None,
    }
}

fn of_both_turns(module: &ast::Module, rule: &ast::Rule) -> Diagnostic {
    let head = &rule.predecessor;
    let formals = print::head_module(head).replacen('±', "", 1);
    Diagnostic::warning("the rule for `±` applies to this turn of the initial string, too")
        .at(module.span, "this turn changes with the others")
        .at(head.span, "the rule for both turns")
        .help(format!(
            "give the turns that change a subscript, `±_l{formals}:` for `+_l` and `-_l`; a turn of the initial string that is meant to change is then `{}_l(…)`",
            module.name
        ))
}

/// Warns of words in drawings that mean nothing there. `drawn` are the modules of drawings.
pub fn drawn_words(model: &Model, drawn: &FxHashMap<KindId, Span>, diagnostics: &mut Vec<Diagnostic>) {
    let mut all: Vec<(Span, KindId)> = drawn.iter().map(|(kind, span)| (*span, *kind)).collect();
    all.sort_unstable();
    let interpreted = || model.kinds.iter().filter(|(_, k)| k.interpretation.is_some()).map(|(_, k)| k);
    for (span, id) in all {
        let kind = model.kinds.get(id);
        let name = kind.name.as_str();
        let known = DRAWN_WORDS.contains(&base_of(name)) || interpreted().any(|other| other.name == name);
        if kind.class() != Class::Word || known || !kind.has_no_rules() {
            continue;
        }
        let candidates = interpreted().map(|kind| kind.name.as_str()).chain(DRAWN_WORDS);
        let first = Span { end: span.start + name.len() as u32, ..span };
        let mut warning = Diagnostic::warning(format!("nothing is drawn for `{name}`"))
            .at(first, "it has no drawing of its own, and the turtle gives the name no meaning");
        warning = match (foreign_syntax::module(name), nearest(name, candidates)) {
            (Some(help), _) => warning.help(help),
            (None, Some(near)) => warning.help(format!("did you mean `{near}`?")),
            (None, None) => warning
                .help(format!("write its drawing, `interpret {name}: …`, or `ε` if it is to draw nothing")),
        };
        if name.chars().count() > 1 && name.chars().all(|c| DRAWN_WORDS.contains(&c.to_string().as_str())) {
            let parts: Vec<String> = name.chars().map(String::from).collect();
            warning = warning.help(format!("two modules have a space between them: `{}`", parts.join(" ")));
        }
        diagnostics.push(warning);
    }
}
