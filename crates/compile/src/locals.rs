//! `let`: names for parts of a rule.

use rustc_hash::FxHashMap;

use crate::rules::RuleBuilder;
use crate::scope::{RESERVED, Scope, Variables};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_syntax::ast;

impl RuleBuilder<'_> {
    /// Declares the names of `let` lines, each for those after it; false if one has an error.
    pub(super) fn locals(&mut self, rule: &ast::Rule, variables: &mut Variables) -> bool {
        let mut good = true;
        let mut seen: FxHashMap<&str, Span> = FxHashMap::default();
        variables.lets = rule.locals.iter().map(|(name, _)| (name.text.clone(), name.span)).collect();
        for (name, value) in &rule.locals {
            let text = &name.text;
            let node = self.scope.number(&self.document.expressions, *value, variables);
            let error = if RESERVED.contains(&&**text) || Scope::is_built_in(text) {
                let what =
                    if RESERVED.contains(&&**text) { "stands for time in every rule" } else { "is built in" };
                Some(Diagnostic::error(format!("`{text}` {what} and cannot be declared")))
            } else if let Some(before) = seen.insert(text, name.span) {
                let twice = Diagnostic::error(format!("two `let` lines of this rule are called `{text}`"));
                Some(twice.at(name.span, "the second one").at(before, "the first one"))
            } else if variables.names.contains_key(text) {
                let error = Diagnostic::error(format!("`{text}` is a parameter of this rule already"));
                Some(error.at(name.span, "this would hide it").at(rule.head, "the head of the rule"))
            } else {
                None
            };
            if let Some(error) = error {
                let error = if error.labels.is_empty() { error.at(name.span, "this one") } else { error };
                self.error(error.help("choose another name"));
                good = false;
            } else if let Some(node) = node {
                variables.names.insert(text.clone(), node);
            } else {
                // Its uses are not reported.
                self.scope.poison(text.clone());
                good = false;
            }
        }
        let used = |name: &str| mentions_after(&self.document.expressions, rule, name);
        for (name, _) in &rule.locals {
            if good && !used(&name.text) {
                self.scope.diagnostics.push(
                    Diagnostic::warning(format!("the name `{}` is not used", name.text))
                        .at(name.span, "declared here")
                        .help("use it in a clause of this rule, or leave the line out"),
                );
            }
        }
        good
    }
}

/// True if an expression of a rule mentions a name. The expressions of an item are contiguous in the arena.
fn mentions_after(all: &ast::Expressions, rule: &ast::Rule, name: &str) -> bool {
    let Some((_, first)) = rule.locals.first() else { return false };
    all.iter_within(first.first, rule.clauses.last().map(|c| c.span))
        .any(|expr| matches!(expr, ast::Expr::Name(other) if &**other == name))
}
