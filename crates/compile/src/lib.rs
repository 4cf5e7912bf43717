//! The language front end: text to [`Model`].
//!
//! ```text
//! text ──layout──▶ items ──parse──▶ Document ──scope, rules──▶ Model ──check──▶ remarks
//! ```
//!
//! [`load`] is the whole of it. Mistakes are collected, not thrown: a text with three mistakes gets three
//! messages. Every pass is linear in the text, and none recurses deeper than a fixed bound.

mod advice;
mod analysis;
mod appearance;
mod call;
mod chance;
mod check;
mod choice;
mod curves;
mod dead_rules;
mod equations;
mod gather;
mod globals;
mod locals;
mod measure;
mod rules;
mod scope;
mod smooth;
mod strings;
mod surface;
mod table;

use std::collections::HashMap;
use std::sync::Arc;

pub use dlsys_syntax::{Files, NoFiles};
pub use measure::measure;

use analysis::analyse;
use dlsys_diagnostic::{Diagnostic, Severity, Source, Span};
use dlsys_expr::{Binary, Unary};
use dlsys_model::{DRAWN_WORDS, Distribution, Frames, Kinds, Model, Successor};
use dlsys_syntax::ast::{self, Action, Document, Item};
use scope::{Scope, Variables};

/// A value for a `param`, given from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    pub name: String,
    pub value: f64,
}

/// What came of a text: a model unless there are errors, and everything there is to say about it.
#[derive(Debug)]
pub struct Loaded {
    pub model: Option<Model>,
    /// The text with all that it includes, if that is more than was given: places in messages are places in it.
    pub source: Option<Source>,
    pub diagnostics: Vec<Diagnostic>,
    /// What is wrong with the settings; then there is no model either.
    pub refused_settings: Vec<Diagnostic>,
}

/// Reads, checks and compiles a model that names no files.
pub fn load(source: &Source, settings: &[Setting]) -> Loaded {
    load_with(source, settings, &NoFiles)
}

/// Reads, checks and compiles a model. The surfaces that it names come from `files`.
pub fn load_with(source: &Source, settings: &[Setting], files: &dyn Files) -> Loaded {
    let (whole, document, mut diagnostics) = dlsys_syntax::read(source, files);
    let unread = !diagnostics.is_empty();
    let mut scope = Scope::default();
    let model = build(&document, settings, &mut scope, unread, files);
    diagnostics.append(&mut scope.diagnostics);
    let failed = diagnostics.iter().any(|d| d.severity == Severity::Error);
    diagnostics.sort_by_key(|d| (d.severity == Severity::Warning, d.labels.first().map(|l| l.0)));
    let refused_settings = scope.refused_settings;
    let model = model.filter(|_| !failed && refused_settings.is_empty());
    Loaded { model, source: whole, diagnostics, refused_settings }
}

/// Builds the model; errors go to the scope. `unread` tells that parts of the text are missing, so that
/// nothing is said about what may stand in them.
fn build(
    document: &Document,
    settings: &[Setting],
    scope: &mut Scope,
    unread: bool,
    files: &dyn Files,
) -> Option<Model> {
    let parameters = globals::declare(document, settings, scope, files);
    let appearance = appearance::build(document, scope, files);
    let mut kinds = Kinds::default();
    let mut single = Singles::default();
    let mut builder = rules::RuleBuilder {
        document,
        scope,
        kinds: &mut kinds,
        clocks: chance::Clocks::new(document),
        occurs: HashMap::new(),
        gathered: Vec::new(),
        drawn: HashMap::new(),
    };
    let (mut rules, mut drafts, mut written) = (vec![], vec![], vec![]);
    let (mut interpretations, mut strings, mut drawings) = (vec![], vec![], vec![]);
    let mut heads = Vec::new();
    let (mut axiom, mut ignored, mut considered) = (None, Vec::new(), Vec::new());
    let (mut title, mut angle, mut frames) = (None, 90.0, None);
    let (mut period, mut axiom_span) = (None, Span::default());
    let mut whole = true;
    for (item, span) in &document.items {
        match item {
            Item::Title(text) => {
                single.once("title", *span, builder.scope);
                if text.chars().any(char::is_control) {
                    let d = Diagnostic::error("a title has no control characters")
                        .at(*span, "it is shown in terminals");
                    builder
                        .scope
                        .diagnostics
                        .push(d.help("write the title in letters; a line break ends it"));
                }
                title = Some(text.clone());
            }
            Item::Angle(value) => {
                single.once("angle", *span, builder.scope);
                angle = builder.constant(*value).unwrap_or(90.0);
            }
            Item::Period(value) => {
                single.once("period", *span, builder.scope);
                period = Some((builder.constant(*value).unwrap_or(1.0), *span));
            }
            Item::Frames { from, to, step } => {
                single.once("frames", *span, builder.scope);
                let all = [*from, *to, *step].map(|e| builder.constant(e));
                if let [Some(from), Some(to), Some(step)] = all {
                    frames = Some(Frames { from, to, step });
                    check_frames(frames.as_ref(), *span, builder.scope);
                }
            }
            Item::Ignore(names) => ignored.extend(names),
            Item::Consider(names) => considered.extend(names),
            Item::Axiom(modules) => {
                single.once("the initial string", *span, builder.scope);
                strings.push(&modules[..]);
                let variables = Variables {
                    no_time: Some("the initial string is made at t = 0"),
                    ..Variables::default()
                };
                axiom_span = *span;
                axiom = builder.successor(modules, &variables, 0);
                whole &= axiom.is_some();
            }
            Item::Interpret { head, drawn } => {
                heads.push(head);
                drawings.push(&drawn[..]);
                match builder.interpretation(head, drawn) {
                    Some(interpretation) => interpretations.push(interpretation),
                    None => whole = false,
                }
            }
            Item::Rule(rule) => {
                for clause in &rule.clauses {
                    if let Action::Produce(successors) = &clause.action {
                        strings.extend(successors.iter().map(|s| &s.modules[..]));
                    }
                }
                written.push(rule);
                match builder.rule(rule) {
                    Some((mut compiled, draft)) => {
                        compiled.index = rules.len();
                        rules.push(compiled);
                        drafts.push(draft);
                    }
                    None => whole = false,
                }
            }
            // Globals, and what `appearance` has built.
            _ => {}
        }
    }
    let ruled: Vec<&ast::HeadModule> = written.iter().map(|rule| &rule.predecessor).collect();
    builder.check_arities(&ruled, &strings, "in its rule");
    // In drawings `F(x)` means a line, whatever `F` with other parameters is drawn as.
    let drawn = |head: &&ast::HeadModule| !DRAWN_WORDS.contains(&&*head.name.text);
    let drawn: Vec<&ast::HeadModule> = heads.iter().copied().filter(drawn).collect();
    builder.check_arities(&drawn, &drawings, "where it is drawn");
    if !unread {
        builder.check_interpretations(&heads);
    }
    let (occurs, drawn, gathered, clocks) = (builder.occurs, builder.drawn, builder.gathered, builder.clocks);
    if !single.seen("the initial string") && !unread {
        scope.diagnostics.push(
            Diagnostic::error("the model has no initial string")
                .help("begin with one, such as `initial string: F(1)`"),
        );
    }
    if scope.diagnostics.is_empty() && !unread {
        unused(document, scope);
        let is_used = |name: &str| kinds.iter().any(|(_, kind)| kind.name == name);
        appearance::unused_surfaces(&appearance, is_used, scope);
    }
    if !whole || unread {
        return None;
    }
    let mut model = Model {
        title,
        angle,
        frames,
        period: period.map_or(1.0, |(period, _)| period),
        parameters,
        kinds,
        axiom: axiom.unwrap_or_else(Successor::default),
        axiom_span,
        rules,
        interpretations: Vec::new(),
        appearance: Arc::new(appearance),
        drawn_only: Vec::new(),
        curves: scope.graph.curves().to_vec(),
    };
    for (i, rule) in written.iter().enumerate() {
        let names: &[&str] = match &*rule.predecessor.name.text {
            "±" => &["+", "-"],
            name => &[name],
        };
        for name in names {
            let kind = model.kinds.intern(name, rule.predecessor.parameters.len());
            let kind = model.kinds.get_mut(kind);
            if rule.discrete { &mut kind.steps } else { &mut kind.rules }.push(i);
        }
    }
    clocks.assign(&mut model.kinds);
    for (kind, interpretation) in interpretations {
        if let Some(before) = model.kinds.get(kind).interpretation {
            scope.diagnostics.push(
                Diagnostic::error("two interpretations of one module")
                    .at(interpretation.span, "the second one")
                    .at(model.interpretations[before].span, "the first one")
                    .help("keep one of them; what both draw can stand in one string"),
            );
        }
        model.kinds.get_mut(kind).interpretation = Some(model.interpretations.len());
        model.interpretations.push(interpretation);
    }
    let diagnostics = &mut scope.diagnostics;
    check::filter_contexts(&mut model.kinds, &ignored, &considered, diagnostics);
    check::resolve_contexts(&mut model, &written, &gathered, diagnostics);
    if single.seen("the initial string") {
        check::reachability(&model, &written, &occurs, diagnostics);
    }
    check::period(period, &model, diagnostics);
    check::coverage(&model, diagnostics);
    dead_rules::rules(&model, &written, document, diagnostics);
    check::inert_modules(&model, &occurs, diagnostics);
    check::commands(&model, diagnostics, &drawn.into_iter().chain(occurs).collect());
    analyse(&mut scope.graph, &mut model, &drafts);
    Some(model)
}

/// Declarations that a model has once.
#[derive(Default)]
struct Singles(Vec<(&'static str, Span)>);

impl Singles {
    fn seen(&self, what: &str) -> bool {
        self.0.iter().any(|(name, _)| *name == what)
    }

    fn once(&mut self, what: &'static str, span: Span, scope: &mut Scope) {
        if let Some((_, before)) = self.0.iter().find(|(name, _)| *name == what) {
            scope.diagnostics.push(
                Diagnostic::error(format!("{what} is given twice"))
                    .at(first_line(span), "the second time")
                    .at(first_line(*before), "the first time")
                    .help(match what {
                        "the initial string" => "keep one of them, with the modules of both",
                        _ => "keep one of them, and remove the other",
                    }),
            );
        }
        self.0.push((what, span));
    }
}

/// The beginning of a declaration, short enough to be underlined.
fn first_line(span: Span) -> Span {
    Span { end: span.end.min(span.start + 5), ..span }
}

fn check_frames(frames: Option<&Frames>, span: Span, scope: &mut Scope) {
    let Some(&Frames { from, to, step }) = frames else { return };
    let written = |from: f64, to: f64, step: f64| format!("write `frames {from} .. {to} step {step}`");
    let (fault, help) = if from < 0.0 {
        ("time begins at 0".to_owned(), written(0.0, to.max(0.0), step))
    } else if to < from {
        (format!("{to} is before {from}"), written(to, from, step))
    } else if step <= 0.0 {
        let hundredth = if to > from { (to - from) / 100.0 } else { 1.0 };
        let help = format!("{}, for example", written(from, to, hundredth));
        ("the step must be greater than 0".to_owned(), help)
    } else if (to - from) / step >= Frames::LIMIT as f64 {
        let help = format!("choose a longer step: {}", written(from, to, (to - from) / 100.0));
        (format!("more than {} frames", Frames::LIMIT), help)
    } else {
        return;
    };
    scope.diagnostics.push(Diagnostic::error("these frames cannot be").at(span, fault).help(help));
}

/// Constants and functions that nothing uses.
fn unused(document: &Document, scope: &mut Scope) {
    for (item, _) in document.own_items() {
        let text = |name: &ast::Name| name.text.clone();
        let (what, name, use_it) = match item {
            Item::Const { name, .. } => {
                ("constant", name, "use it in an equation, a condition or a string".into())
            }
            Item::Param { name, .. } => {
                ("param", name, "use it in an equation, a condition or a string".into())
            }
            Item::Def { name, parameters, .. } => {
                let formals: Vec<&str> = parameters.iter().map(|p| &*p.text).collect();
                ("function", name, format!("call it, as in `{}({})`", text(name), formals.join(", ")))
            }
            Item::Array { name, .. } => ("array", name, format!("use an element, as in `{}[0]`", text(name))),
            Item::Curve { name, .. } => ("curve", name, format!("use it, as in `{}(age)`", text(name))),
            Item::Table { name, .. } => ("table", name, format!("use it, as in `{}(t)`", text(name))),
            Item::Color { name, .. } => {
                ("colour", name, format!("draw with it: `;({})` in a string", text(name)))
            }
            Item::Gradient { name, .. } => {
                ("gradient", name, format!("draw with it: `;({}, v)` in a string, v from 0 to 1", text(name)))
            }
            Item::Contour { name, .. } => {
                ("contour", name, format!("draw with it: `@C({})` in a string", text(name)))
            }
            _ => continue,
        };
        let text: &Arc<str> = &name.text;
        if !scope.used.contains(text) {
            scope.diagnostics.push(
                Diagnostic::warning(format!("nobody uses the {what} `{text}`"))
                    .at(name.span, "declared here")
                    .help(format!("{use_it}, or remove this line")),
            );
        }
    }
}

/// The functions that an expression can call without declaring them: those of numbers, distributions, aggregates, of
/// curves, and of the library.
pub fn functions() -> impl Iterator<Item = &'static str> {
    let numbers =
        Unary::NAMED.iter().map(|(name, _)| *name).chain(Binary::NAMED.iter().map(|(name, _)| *name));
    let draws = Distribution::NAMED.iter().map(|(name, ..)| *name);
    let curves = curves::FUNCTIONALS.iter().map(|(name, _)| *name);
    numbers.chain(draws).chain(dlsys_syntax::words::FOLDS).chain(curves).chain(dlsys_syntax::library_names())
}

#[cfg(test)]
mod tests {
    #[test]
    fn functions_of_every_origin_are_listed() {
        for name in ["integral", "gompertz", "sin", "max", "sum", "normal"] {
            assert!(super::functions().any(|known| known == name), "{name}");
        }
    }
}
