//! Resolution of the names in contexts, aggregates, `ignore` and `consider` to kinds of modules.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::advice;
use crate::declared::{DeclaredPattern, DeclaredRule, ResolvedRule};
use crate::scope::plural;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{Class, KindId, Kinds, Pattern, class_of};
use dlsys_syntax::ast;

/// Kinds by the names that patterns can use for them.
struct ByName<'k> {
    exact: FxHashMap<&'k str, Vec<KindId>>,
    base: FxHashMap<&'k str, Vec<KindId>>,
}

impl<'k> ByName<'k> {
    fn new(kinds: &'k Kinds) -> ByName<'k> {
        let mut index = ByName { exact: FxHashMap::default(), base: FxHashMap::default() };
        for (id, kind) in kinds.iter() {
            index.exact.entry(&kind.name).or_default().push(id);
            index.base.entry(kind.base()).or_default().push(id);
        }
        index
    }

    /// The kinds of a name: without `_`, all kinds with that base name; otherwise those with the name itself.
    fn matching(&self, name: &str) -> &[KindId] {
        let exact = class_of(name) != Class::Word || name.contains('_');
        let index = if exact { &self.exact } else { &self.base };
        index.get(name).map_or(&[], Vec::as_slice)
    }
}

/// Resolves the modules of contexts and aggregates to kinds, and reports those that nothing can match.
pub fn resolve_all(
    kinds: &Kinds,
    rules: Vec<DeclaredRule>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<ResolvedRule> {
    let names = ByName::new(kinds);
    let mut find =
        |pattern: &DeclaredPattern, never: &str| resolve(kinds, &names, pattern, never, diagnostics);
    let mut resolved = Vec::with_capacity(rules.len());
    for declared in rules {
        let mut side = |patterns: &[DeclaredPattern]| -> Vec<Pattern> {
            patterns.iter().map(|pattern| find(pattern, "this context never matches")).collect()
        };
        let (left, right) = (side(&declared.left), side(&declared.right));
        let never = "nothing of this name is ever attached to a module";
        let children = declared.aggregates.iter().map(|aggregate| find(&aggregate.pattern, never)).collect();
        resolved.push(ResolvedRule { declared, left, right, children });
    }
    resolved
}

fn resolve(
    kinds: &Kinds,
    names: &ByName,
    declared: &DeclaredPattern,
    never: &str,
    diagnostics: &mut Vec<Diagnostic>,
) -> Pattern {
    let DeclaredPattern { head, width } = declared;
    let (name, arity) = (&*head.name.text, head.parameters.len());
    let named = names.matching(name);
    let matching = named.iter().copied().filter(|id| kinds.get(*id).arity == arity).collect();
    let pattern = Pattern { kinds: matching, arity, width: *width };
    if pattern.kinds.is_empty() {
        let error = match named.first().map(|id| kinds.get(*id)) {
            Some(kind) => Diagnostic::error(format!(
                "`{}` has {}, not {arity}",
                kind.name,
                plural(kind.arity, "parameter"),
            ))
            .at(head.span, "the number of parameters must agree, or the context never matches")
            .help(format!("name each of them, used or not: `{}`", advice::head_with(head, kind.arity))),
            None => Diagnostic::warning(format!("there is no module `{name}`"))
                .at(head.span, never)
                .help(advice::no_such_module(kinds, name)),
        };
        diagnostics.push(error);
    } else if pattern.kinds.iter().all(|id| kinds.get(*id).skipped) {
        diagnostics.push(
            Diagnostic::error(format!("`{name}` is passed over in the search for context"))
                .at(head.span, never)
                .help(if class_of(name) == Class::Word {
                    format!("take `{name}` out of `ignore`, or name it in `consider`")
                } else {
                    format!("symbols and surfaces count as context only if a `consider` names them: `consider {name} …`, with all other modules that count")
                }),
        );
    }
    pattern
}

/// The kinds that `solid` or `shelf` names.
pub fn bodies(kinds: &Kinds, names: &[&ast::Name], diagnostics: &mut Vec<Diagnostic>) -> Vec<(KindId, Span)> {
    if names.is_empty() {
        return Vec::new();
    }
    let index = ByName::new(kinds);
    let mut solids: Vec<(KindId, Span)> = Vec::new();
    for name in names {
        let found = index.matching(&name.text);
        if found.is_empty() {
            diagnostics.push(
                Diagnostic::error(format!("there is no module `{}`", name.text))
                    .at(name.span, "no body of this name")
                    .help(advice::no_such_module(kinds, &name.text)),
            );
        }
        for &kind in found {
            if !solids.iter().any(|(known, _)| *known == kind) {
                solids.push((kind, name.span));
            }
        }
    }
    solids
}

/// Applies `ignore` and `consider` to the kinds.
pub fn filter(
    kinds: &mut Kinds,
    ignored: &[&ast::Name],
    considered: &[&ast::Name],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let find = |kinds: &Kinds, name: &ast::Name, diagnostics: &mut Vec<Diagnostic>| -> Vec<KindId> {
        let found = ByName::new(kinds).matching(&name.text).to_vec();
        if found.is_empty() {
            diagnostics.push(
                Diagnostic::warning(format!("there is no module `{}`", name.text))
                    .at(name.span, "nothing to skip or to consider")
                    .help(advice::no_such_module(kinds, &name.text)),
            );
        }
        found
    };
    if !considered.is_empty() {
        let chosen: FxHashSet<KindId> =
            considered.iter().flat_map(|name| find(kinds, name, diagnostics)).collect();
        let all: Vec<KindId> = kinds.iter().map(|(id, _)| id).collect();
        for id in all {
            kinds.get_mut(id).skipped = !chosen.contains(&id);
        }
    }
    for name in ignored {
        for id in find(kinds, name, diagnostics) {
            kinds.get_mut(id).skipped = true;
        }
    }
}
