//! Aggregates of a rule: what is written as `sum(B(x, c): …)`.

use crate::chance::Clocks;
use crate::rules::RuleBuilder;
use dlsys_expr::{NodeId, Program};
use dlsys_model::{Aggregate, Jacobian, Pattern};
use dlsys_syntax::ast::{self, Expr, ExprId, HeadModule};
use dlsys_syntax::print;

impl RuleBuilder<'_> {
    /// How many aggregates a rule has as it is written; each gets a variable.
    pub(super) fn aggregates_in(&self, rule: &ast::Rule) -> u32 {
        let nodes = rule.nodes.0.0..rule.nodes.1.0;
        let is_one = |id: &u32| matches!(self.document.expressions.get(ExprId(*id)), Expr::Aggregate(_));
        nodes.filter(is_one).count() as u32
    }

    /// The aggregates that the rule's expressions have been found to read, one for each of its variables, with their
    /// terms. One that is written twice is there once, and then nobody reads the last of the variables.
    pub(super) fn aggregates(&mut self, count: usize) -> (Vec<Aggregate>, Vec<NodeId>) {
        let gathered = std::mem::take(&mut self.scope.gathered);
        // Behind the parameters that are written stand hidden ones.
        let width = |clocks: &Clocks, m: &HeadModule| {
            m.parameters.len() + clocks.width(&m.name.text, m.parameters.len())
        };
        let aggregates = (gathered.iter())
            .map(|one| Aggregate {
                fold: one.fold,
                pattern: Pattern {
                    kinds: Vec::new(),
                    arity: one.head.parameters.len(),
                    width: width(&self.clocks, &one.head),
                },
                term: Program::compile(
                    &self.scope.graph,
                    &[one.term],
                    count + width(&self.clocks, &one.head),
                ),
                jacobian: Jacobian::default(),
                moves: false,
                label: format!("{} over {}", one.fold.name(), print::head_module(&one.head)),
                span: one.head.span,
            })
            .collect();
        let terms = gathered.iter().map(|one| one.term).collect();
        self.gathered.push(gathered.into_iter().map(|one| one.head).collect());
        (aggregates, terms)
    }
}

/// The variables that conditions read, by themselves or through aggregates, which begin with the variable `first`.
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
