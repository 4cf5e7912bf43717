//! `match`: one of several values, by a number.

use std::sync::Arc;

use crate::conditions::Sides;
use crate::scope::{Lowered, Scope};
use dlsys_diagnostic::Diagnostic;
use dlsys_expr::{NodeId, NodeMap};
use dlsys_model::Comparison;
use dlsys_syntax::ast::{ExprId, Expressions};
use dlsys_syntax::print;

impl Scope {
    /// Lowers a `match`: its number, its cases and the default. `done` gives the lowered parts.
    pub(super) fn choice(
        &mut self,
        all: &Expressions,
        (subject, cases, otherwise): (ExprId, &[(ExprId, ExprId)], ExprId),
        done: impl Fn(ExprId) -> Option<Lowered>,
    ) -> Option<NodeId> {
        let node = self.expect_number(all, subject, done(subject)?);
        let mut whole = self.expect_number(all, otherwise, done(otherwise)?);
        let mut seen: NodeMap<ExprId> = NodeMap::default();
        let mut links = Vec::new();
        for &(value, then) in cases {
            let case = self.expect_number(all, value, done(value)?)?;
            let then = self.expect_number(all, then, done(then)?)?;
            if let Some(before) = seen.insert(case, value) {
                self.diagnostics.push(
                    Diagnostic::error("two cases of one `match` are alike")
                        .at(all.span(value), "this one is never reached")
                        .at(all.span(before), "this one comes first")
                        .help("take one of them out, or give it another value"),
                );
                return None;
            }
            links.push((case, then, value));
        }
        let node = node?;
        for (case, then, value) in links.into_iter().rev() {
            let link = self.compare(Comparison::Equal, node, case);
            let sides = [subject, value].map(|id| print::expression(all, id));
            let at = (all.span(subject).to(all.span(value)), Arc::new(Sides::from(sides)));
            self.comparisons.entry(link).or_insert(at);
            whole = Some(self.graph.select(link, then, whole?));
        }
        whole
    }
}
