//! Conditions inside equations, taken out of them.
//!
//! Between the instants at which a condition changes an equation is smooth, and a method keeps its order; so each
//! condition becomes a variable, and its change an event (see [`Switch`]).

use super::rules::{Atoms, RuleBuilder};
use crate::diagnostic::Span;
use crate::expr::{Binary, Graph, Node, NodeId, Unary};
use crate::model::Switch;

impl RuleBuilder<'_> {
    /// Makes equations smooth: conditions inside them become variables, numbered from `count` on.
    #[allow(clippy::type_complexity)]
    pub(super) fn smooth(
        &mut self,
        rates: Vec<(usize, NodeId)>,
        count: usize,
        span: Span,
        atoms: &mut Atoms,
    ) -> Option<(Vec<(usize, NodeId)>, Vec<Switch>)> {
        let mut conditions: Vec<NodeId> = Vec::new();
        let mut flag = |graph: &mut Graph, condition: NodeId| {
            let known = conditions.iter().position(|c| *c == condition);
            let at = known.unwrap_or_else(|| {
                conditions.push(condition);
                conditions.len() - 1
            });
            graph.var((count + at) as u32)
        };
        let roots: Vec<NodeId> = rates.iter().map(|(_, rate)| *rate).collect();
        let smoothed = self.scope.graph.rewrite(&roots, |graph, id, rebuilt| {
            let zero = graph.constant(0.0);
            // Conditions are asked of the equations as written, so the original operands go into them.
            match (graph.node(id), rebuilt) {
                (Node::Select(condition, ..), Node::Select(_, a, b)) => {
                    let chosen = flag(graph, condition);
                    Some(graph.select(chosen, a, b))
                }
                (Node::Binary(op @ (Binary::Min | Binary::Max), x, y), Node::Binary(_, a, b)) => {
                    let less = graph.binary(Binary::Lt, x, y);
                    let chosen = flag(graph, less);
                    let (a, b) = if op == Binary::Min { (a, b) } else { (b, a) };
                    Some(graph.select(chosen, a, b))
                }
                (Node::Unary(Unary::Abs, x), Node::Unary(_, a)) => {
                    let negative = graph.binary(Binary::Lt, x, zero);
                    let chosen = flag(graph, negative);
                    let minus = graph.unary(Unary::Neg, a);
                    Some(graph.select(chosen, minus, a))
                }
                (Node::Unary(Unary::Sign, x), Node::Unary(..)) => {
                    let (below, above) =
                        (graph.binary(Binary::Lt, x, zero), graph.binary(Binary::Lt, zero, x));
                    let (below, above) = (flag(graph, below), flag(graph, above));
                    let (minus, one) = (graph.constant(-1.0), graph.constant(1.0));
                    let rest = graph.select(above, one, zero);
                    Some(graph.select(below, minus, rest))
                }
                // A jump at every whole number: where the sine of π x changes sign. Between two of them the even
                // or odd one of the two nearest whole numbers is meant, however x is rounded at the jump itself.
                (Node::Unary(op @ (Unary::Floor | Unary::Ceil), x), Node::Unary(_, a)) => {
                    let up = op == Unary::Ceil;
                    let negated = |graph: &mut Graph, x| if up { graph.unary(Unary::Neg, x) } else { x };
                    let (x, a) = (negated(graph, x), negated(graph, a));
                    let (pi, half, two) =
                        (graph.constant(std::f64::consts::PI), graph.constant(0.5), graph.constant(2.0));
                    let phase = graph.binary(Binary::Mul, pi, x);
                    let sine = graph.unary(Unary::Sin, phase);
                    let even = graph.binary(Binary::Lt, zero, sine);
                    let even = flag(graph, even);
                    let shifted = graph.binary(Binary::Add, a, half);
                    let nearest = graph.unary(Unary::Floor, shifted);
                    let pairs = graph.binary(Binary::Div, nearest, two);
                    let pairs = graph.unary(Unary::Floor, pairs);
                    let pairs = graph.binary(Binary::Mul, two, pairs);
                    let odd = graph.binary(Binary::Sub, nearest, pairs);
                    let one = graph.constant(1.0);
                    let other = graph.binary(Binary::Sub, one, odd);
                    let over = graph.select(even, odd, other);
                    let level = graph.binary(Binary::Sub, nearest, over);
                    Some(negated(graph, level))
                }
                _ => None,
            }
        });
        let mut switches = Vec::new();
        for condition in conditions {
            switches.push(Switch { condition: self.decompose(condition, span, atoms)? });
        }
        let rates = rates.iter().zip(smoothed).map(|((parameter, _), rate)| (*parameter, rate)).collect();
        Some((rates, switches))
    }
}
