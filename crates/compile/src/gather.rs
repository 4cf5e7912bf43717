//! The aggregates of a rule: `sum(B(x, c): …)`.

use crate::declared::DeclaredAggregate;
use crate::rules::RuleBuilder;
use dlsys_expr::Program;
use dlsys_model::Aggregate;
use dlsys_syntax::ast::{self, Expr, ExprId};

impl RuleBuilder<'_> {
    /// Number of aggregates in the text of a rule; each gets a variable.
    pub(super) fn aggregates_in(&self, rule: &ast::Rule) -> u32 {
        let nodes = rule.nodes.0.0..rule.nodes.1.0;
        let is_one = |id: &u32| matches!(self.document.expressions.get(ExprId(*id)), Expr::Aggregate(_));
        nodes.filter(is_one).count() as u32
    }

    /// The aggregates that the expressions of the rule read, in the order of their variables. An aggregate that is written
    /// twice is listed once, and the last of the variables is then unused.
    pub(super) fn aggregates(&mut self) -> Vec<DeclaredAggregate> {
        let gathered = std::mem::take(&mut self.scope.gathered);
        gathered
            .into_iter()
            .map(|one| DeclaredAggregate { fold: one.fold, pattern: self.pattern(one.head), term: one.term })
            .collect()
    }
}

/// By variable: true if a condition reads it, directly or through an aggregate. `first` is the variable of the first
/// aggregate.
pub(super) fn watched(sides: &Program, aggregates: &[Aggregate], count: usize, first: usize) -> Vec<bool> {
    let mut watched: Vec<bool> = vec![false; count];
    for &v in sides.reads() {
        watched[v] = true;
        if let Some(aggregate) = v.checked_sub(first).and_then(|i| aggregates.get(i)) {
            aggregate.term.reads().iter().copied().filter(|v| *v < count).for_each(|v| watched[v] = true);
        }
    }
    watched
}
