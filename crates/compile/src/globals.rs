//! Constants, `param`s, functions, and the numbers of colours, tissues and gases, in the order of their dependencies.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::Setting;
use crate::advice;
use crate::appearance::first_gradient;
use crate::scope::{RESERVED, Scope};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{BUILT_IN_COLORS, Parameter};
use dlsys_syntax::Files;
use dlsys_syntax::ast::{Document, Expr, ExprId, Expression, Item, Name};
use dlsys_syntax::suggest::did_you_mean;

/// A global name with its declaration.
struct Global<'d> {
    name: &'d Name,
    kind: GlobalKind<'d>,
    library: bool,
}

enum GlobalKind<'d> {
    Const(Expression),
    Param(Expression, Option<(Expression, Expression)>),
    Def(&'d [Name], Expression),
    /// The number of a colour, a gradient, a contour, a tissue or a gas.
    Number(usize),
    Array(&'d [Expression]),
    Curve(&'d Item, Span),
}

/// Declares all global names in `scope` and returns the `param`s with the values in force.
pub fn declare(
    document: &Document,
    settings: &[Setting],
    scope: &mut Scope,
    files: &dyn Files,
) -> Vec<Parameter> {
    let globals = collect(document, scope);
    let index: FxHashMap<&str, usize> = globals.iter().enumerate().map(|(i, g)| (&*g.name.text, i)).collect();
    for name in &document.unread {
        if !index.contains_key(&**name) && !Scope::is_built_in(name) {
            scope.poison(name.clone());
        }
    }
    scope.commented.extend(document.commented.iter().cloned());
    let mut parameters = Vec::new();
    for i in order(document, &globals, &index, scope) {
        let Global { name, kind, library } = &globals[i];
        match kind {
            GlobalKind::Def(formals, body) => {
                scope.define_function(name, formals, &document.expressions, *body, *library);
            }
            GlobalKind::Array(values) => scope.define_array(name, &document.expressions, values),
            GlobalKind::Curve(item, span) => scope.define_curve(item, *span, &document.expressions, files),
            GlobalKind::Number(number) => scope.define_constant(name.text.clone(), Some(*number as f64)),
            GlobalKind::Const(body) => {
                let value = scope.constant_value(&document.expressions, *body);
                scope.define_constant(name.text.clone(), value);
            }
            GlobalKind::Param(body, range) => {
                let value = parameter(document, name, *body, *range, settings, scope);
                scope.define_constant(name.text.clone(), value.as_ref().map(|p| p.value));
                parameters.extend(value);
            }
        }
    }
    parameters.sort_by_key(|p| p.span);
    for setting in settings {
        if !parameters.iter().any(|p| p.name == setting.name) {
            let declared = index.contains_key(&*setting.name);
            let known = parameters.iter().map(|p| p.name.as_str());
            let mut error =
                Diagnostic::error(format!("the model has no param `{}` that could be set", setting.name));
            error = if declared {
                error.help(format!(
                    "`{}` is a constant; declare it with `param` to set it from outside",
                    setting.name
                ))
            } else {
                let all: Vec<String> = parameters.iter().map(|p| format!("`{}`", p.name)).take(8).collect();
                error.help(did_you_mean(&setting.name, known).unwrap_or_else(|| match &all[..] {
                    [] => "this model has no params; a constant becomes one when it is declared with `param`".to_owned(),
                    all => format!("its params are {}", all.join(", ")),
                }))
            };
            scope.refused_settings.push(error);
        }
    }
    parameters
}

fn collect<'d>(document: &'d Document, scope: &mut Scope) -> Vec<Global<'d>> {
    let mut globals: Vec<Global> = Vec::new();
    let mut first: FxHashMap<&str, Span> = FxHashMap::default();
    let mut next_color = BUILT_IN_COLORS + 1;
    let mut next_gradient = first_gradient(document);
    let mut next_contour = 1;
    let mut next_tissue = 1;
    let mut next_gas = 1;
    let count = |next: &mut usize| {
        *next += 1;
        GlobalKind::Number(*next - 1)
    };
    for (i, (item, span)) in document.items.iter().enumerate() {
        let library = document.library.is_some_and(|from| i >= from);
        let (name, kind) = match item {
            Item::Const { name, value } => (name, GlobalKind::Const(*value)),
            Item::Array { name, values } => (name, GlobalKind::Array(values)),
            Item::Curve { name, .. } | Item::Function { name, .. } | Item::Table { name, .. } => {
                (name, GlobalKind::Curve(item, *span))
            }
            Item::Param { name, value, range } => (name, GlobalKind::Param(*value, *range)),
            Item::Def { name, parameters, body } => (name, GlobalKind::Def(parameters, *body)),
            Item::Color { name, .. } => (name, count(&mut next_color)),
            Item::Gradient { name, .. } => (name, count(&mut next_gradient)),
            Item::Contour { name, .. } => (name, count(&mut next_contour)),
            Item::Tissue { name, .. } => (name, count(&mut next_tissue)),
            Item::Gas { name, .. } => (name, count(&mut next_gas)),
            _ => continue,
        };
        let Name { text, span } = name;
        if library && first.contains_key(&**text) {
            continue;
        }
        if Scope::is_built_in(text) {
            let what =
                if RESERVED.contains(&&**text) { "stands for time in every rule" } else { "is built in" };
            scope.diagnostics.push(
                Diagnostic::error(format!("`{text}` {what} and cannot be declared"))
                    .at(*span, "this name is taken")
                    .help(format!("choose another name, such as `{text}_0`")),
            );
            scope.poison(text.clone());
            continue;
        }
        if let Some(before) = first.insert(text, *span) {
            scope.diagnostics.push(
                Diagnostic::error(format!("`{text}` is declared twice"))
                    .at(*span, "the second time")
                    .at(before, "the first time")
                    .help(advice::twice(text)),
            );
            continue;
        }
        globals.push(Global { name, kind, library });
    }
    globals
}

fn parameter(
    document: &Document,
    name: &Name,
    body: Expression,
    range: Option<(Expression, Expression)>,
    settings: &[Setting],
    scope: &mut Scope,
) -> Option<Parameter> {
    let all = &document.expressions;
    let declared = scope.constant_value(all, body)?;
    let range = match range {
        Some((from, to)) => {
            let (low, high) = (scope.constant_value(all, from)?, scope.constant_value(all, to)?);
            if low > high {
                scope.diagnostics.push(
                    Diagnostic::error(format!("the range of `{}` is empty", name.text))
                        .at(
                            all.span(from.root).to(all.span(to.root)),
                            format!("{low} is greater than {high}"),
                        )
                        .help(format!("write the smaller bound first: `in {high} .. {low}`")),
                );
                return None;
            }
            if !(low..=high).contains(&declared) {
                scope.diagnostics.push(
                    Diagnostic::error(format!("the value of `{}` is outside its range", name.text))
                        .at(all.span(body.root), format!("this is {declared}"))
                        .at(
                            all.span(from.root).to(all.span(to.root)),
                            format!("the range is {low} .. {high}"),
                        )
                        .help(format!(
                            "choose a value in the range, or widen it: `in {} .. {}`",
                            low.min(declared),
                            high.max(declared)
                        )),
                );
                return None;
            }
            Some((low, high))
        }
        None => None,
    };
    let mut value = declared;
    if let Some(setting) = settings.iter().rev().find(|s| *s.name == *name.text) {
        if let Some((low, high)) = range
            && !(low..=high).contains(&setting.value)
        {
            let message = format!(
                "{} = {} is outside the range {low} .. {high} of this param",
                setting.name, setting.value
            );
            let help = format!("choose a value from {low} to {high}, or widen the range in the model");
            scope.refused_settings.push(Diagnostic::error(message).help(help));
        }
        value = setting.value;
    }
    Some(Parameter { name: name.text.to_string(), value, range, span: name.span })
}

/// The global names that an expression mentions, in order.
pub(super) fn mentions(
    document: &Document,
    expression: Expression,
) -> impl Iterator<Item = (&Arc<str>, Span)> {
    (expression.first.0..=expression.root.0).filter_map(|id| match document.expressions.get(ExprId(id)) {
        Expr::Name(name) | Expr::Call(name, _) | Expr::Index(name, _) => {
            Some((name, document.expressions.span(ExprId(id))))
        }
        _ => None,
    })
}

/// The global names that the declaration of each one mentions, and where it mentions them.
fn dependencies(
    document: &Document,
    globals: &[Global],
    index: &FxHashMap<&str, usize>,
) -> Vec<Vec<(usize, Span)>> {
    globals
        .iter()
        .map(|global| {
            let (own, bodies): (&[Name], Vec<Expression>) = match global.kind {
                GlobalKind::Def(formals, body) => (formals, vec![body]),
                GlobalKind::Const(body) | GlobalKind::Param(body, None) => (&[], vec![body]),
                GlobalKind::Param(body, Some((from, to))) => (&[], vec![body, from, to]),
                GlobalKind::Number(_) => (&[], Vec::new()),
                GlobalKind::Array(values) => (&[], values.to_vec()),
                GlobalKind::Curve(Item::Curve { points, .. }, _) => (&[], points.concat()),
                GlobalKind::Curve(..) => (&[], Vec::new()),
            };
            (bodies.into_iter())
                .flat_map(|e| mentions(document, e))
                .filter(|(name, _)| !own.iter().any(|formal| formal.text == **name))
                .filter_map(|(name, span)| Some((*index.get(&**name)?, span)))
                .collect()
        })
        .collect()
}

/// Global names, each after those it depends on; those on a cycle are reported and left out.
///
/// Depth-first search with an explicit stack: chains of declarations may be long.
fn order(
    document: &Document,
    globals: &[Global],
    index: &FxHashMap<&str, usize>,
    scope: &mut Scope,
) -> Vec<usize> {
    #[derive(Clone, Copy, PartialEq)]
    enum Mark {
        New,
        Open,
        Done,
    }
    let dependencies = dependencies(document, globals, index);
    let mut circular = vec![false; globals.len()];
    let mut marks = vec![Mark::New; globals.len()];
    let mut sorted = Vec::with_capacity(globals.len());
    for start in 0..globals.len() {
        if marks[start] != Mark::New {
            continue;
        }
        marks[start] = Mark::Open;
        let mut stack = vec![(start, 0)];
        while let Some((node, next)) = stack.last_mut() {
            let (node, edge) = (*node, *next);
            *next += 1;
            match dependencies[node].get(edge) {
                None => {
                    marks[node] = Mark::Done;
                    sorted.push(node);
                    stack.pop();
                }
                Some(&(to, span)) => match marks[to] {
                    Mark::New => {
                        marks[to] = Mark::Open;
                        stack.push((to, 0));
                    }
                    Mark::Open if std::mem::replace(&mut circular[to], true) => {}
                    Mark::Open => {
                        scope.poison(globals[to].name.text.clone());
                        let from = stack.iter().position(|(n, _)| *n == to).unwrap_or(0);
                        let path: Vec<&Global> = stack[from..].iter().map(|(n, _)| &globals[*n]).collect();
                        scope.diagnostics.push(circle(&globals[to], &path, span));
                    }
                    Mark::Done => {}
                },
            }
        }
    }
    sorted
}

/// The error for a global that depends on itself by way of `path`, which begins with it; `span` is the mention that
/// closes the circle.
fn circle(global: &Global, path: &[&Global], span: Span) -> Diagnostic {
    let name = &global.name.text;
    let mut path: Vec<&str> = path.iter().map(|global| &*global.name.text).collect();
    path.push(name);
    if path.len() > 8 {
        path.splice(4..path.len() - 3, ["…"]);
    }
    let (what, help) = match global.kind {
        GlobalKind::Def(..) => {
            ("calls itself", "write it without itself; what is repeated in time belongs in rules".to_owned())
        }
        _ => ("depends on itself", format!("give one of them a number, such as `const {name} = 1`")),
    };
    Diagnostic::error(format!("`{name}` {what}"))
        .at(span, format!("this closes the circle {}", path.join(" → ")))
        .at(global.name.span, "declared here")
        .help(help)
}
