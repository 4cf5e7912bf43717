//! Replacement of the conditions inside equations with switches.
//!
//! An equation is smooth between the instants at which its conditions change, so that an integrator keeps its order there.
//! Each condition becomes a variable, and its change an event (see [`Switch`]).

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::analysis::{driven_form, outside_of_drivers};
use crate::conditions::{Atoms, Sides};
use crate::rules::RuleBuilder;
use dlsys_diagnostic::Span;
use dlsys_expr::{Binary, Graph, Node, NodeId, NodeMap, NodeSet, Part, Unary};
use dlsys_model::Switch;

/// Equations of a clause, the number of the module's parameters, and that of all variables.
type Written = (Vec<(usize, NodeId)>, usize, usize);

/// Equations without conditions that have been made smooth before, and what became of them: rules that differ in names only have the
/// same expressions.
#[derive(Default)]
pub struct Smoothed(FxHashMap<Written, Vec<(usize, NodeId)>>);

impl RuleBuilder<'_> {
    /// As [`smooth`](RuleBuilder::smooth), once for equations without conditions that many rules have.
    #[allow(clippy::type_complexity)]
    pub(super) fn smooth_as_before(
        &mut self,
        rates: Vec<(usize, NodeId)>,
        own: usize,
        count: usize,
        span: Span,
        atoms: &mut Atoms,
    ) -> Option<(Vec<(usize, NodeId)>, Vec<Switch>)> {
        let written = (rates, own, count);
        if let Some(smooth) = self.smoothed.0.get(&written) {
            return Some((smooth.clone(), Vec::new()));
        }
        let (smooth, switches) = self.smooth(written.0.clone(), own, count, span, atoms)?;
        if switches.is_empty() {
            self.smoothed.0.insert(written, smooth.clone());
        }
        Some((smooth, switches))
    }

    /// Makes equations smooth: conditions inside them become variables, numbered from `count` on. The first `own` variables
    /// are the module's parameters, the last two `t` and `age`.
    ///
    /// Curves and growth functions of time with a known integral are preserved where they give the whole rate a formula.
    /// Otherwise the piece of a curve is frozen like a condition.
    #[allow(clippy::type_complexity)]
    fn smooth(
        &mut self,
        rates: Vec<(usize, NodeId)>,
        own: usize,
        count: usize,
        span: Span,
        atoms: &mut Atoms,
    ) -> Option<(Vec<(usize, NodeId)>, Vec<Switch>)> {
        let mut frozen = Frozen { conditions: Vec::new(), count };
        let time = count as u32 - 2;
        let solved: Vec<u32> = rates.iter().map(|(parameter, _)| *parameter as u32).collect();
        // Truth values and own parameters without an equation in this clause are constant.
        let still = |v: u32| v >= time + 2 || (v as usize) < own && !solved.contains(&v);
        let mut smoothed = Vec::new();
        for &(parameter, rate) in &rates {
            let graph = &mut self.scope.graph;
            let outside = outside_of_drivers(graph, rate, &still, time).into_iter().collect();
            let known = frozen.conditions.len();
            let gentle =
                frozen.take_out(graph, rate, &still, Some(&outside), &mut self.scope.comparisons, span);
            let driven = gentle_is_driven(graph, parameter, gentle, rate, &still, time);
            smoothed.push((
                parameter,
                if driven {
                    gentle
                } else {
                    frozen.conditions.truncate(known);
                    let strict =
                        frozen.take_out(graph, rate, &still, None, &mut self.scope.comparisons, span);
                    where_defined(graph, strict, rate, time + 2)
                },
            ));
        }
        let mut switches = Vec::new();
        for condition in frozen.conditions {
            switches.push(Switch { condition: self.decompose(condition, span, atoms)? });
        }
        Some((smoothed, switches))
    }
}

/// True if a rate with its curves preserved has a formula; false for a rate without curves. A curve with jumps is never
/// preserved: a method that steps would step over them.
fn gentle_is_driven(
    graph: &mut Graph,
    parameter: usize,
    gentle: NodeId,
    rate: NodeId,
    still: &dyn Fn(u32) -> bool,
    time: u32,
) -> bool {
    let nodes = graph.reachable(&[rate]);
    let jumps = |id: &NodeId| match graph.node(*id) {
        Node::Curve(curve, ..) => graph.curve_of(curve).jumps(Part::Value),
        _ => false,
    };
    let curved = |id: &NodeId| graph.integral_is_known(*id);
    nodes.iter().any(curved)
        && !nodes.iter().any(jumps)
        && driven_form(graph, parameter as u32, gentle, still, time).is_some()
}

/// The smooth equation where it is finite, and the equation as written elsewhere. Steps extend beyond the instant at which
/// a condition changes, and rounding may locate that instant too late: `sqrt(max(x, 0))` continues as `sqrt(x)` there, with
/// a negative x.
fn where_defined(graph: &mut Graph, smooth: NodeId, written: NodeId, first_flag: u32) -> NodeId {
    let nodes = graph.reachable(&[smooth]);
    let is_partial = |id: &NodeId| match graph.node(*id) {
        Node::Unary(Unary::Sqrt | Unary::Ln | Unary::Ln1p | Unary::Log10 | Unary::Asin | Unary::Acos, _) => {
            true
        }
        Node::Binary(Binary::Pow, _, power) => graph.as_constant(power).is_none_or(|p| p != p.floor()),
        _ => false,
    };
    let is_flag = |id: &NodeId| matches!(graph.node(*id), Node::Var(v) if v >= first_flag);
    if !nodes.iter().any(is_partial) || !nodes.iter().any(is_flag) {
        return smooth;
    }
    let (zero, difference) = (graph.constant(0.0), graph.binary(Binary::Sub, smooth, smooth));
    let finite = graph.binary(Binary::Eq, difference, zero);
    graph.select(finite, smooth, written)
}

/// True for a piecewise constant expression such as `floor(t)/2`.
fn is_step(graph: &Graph, root: NodeId, still: &dyn Fn(u32) -> bool) -> bool {
    let mut steps: NodeSet = NodeSet::default();
    for id in graph.reachable(&[root]) {
        let is = match graph.node(id) {
            Node::Const(_) | Node::Element(..) => true,
            Node::Unary(Unary::Floor | Unary::Ceil | Unary::Sign, _) => true,
            Node::Binary(Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne, ..) => true,
            Node::Var(v) => still(v),
            Node::Select(_, a, b) => steps.contains(&a) && steps.contains(&b),
            other => other.operands().into_iter().flatten().all(|operand| steps.contains(&operand)),
        };
        if is {
            steps.insert(id);
        }
    }
    steps.contains(&root)
}

/// Conditions that have been replaced with variables.
struct Frozen {
    conditions: Vec<NodeId>,
    count: usize,
}

impl Frozen {
    fn flag(&mut self, graph: &mut Graph, condition: NodeId) -> NodeId {
        let known = self.conditions.iter().position(|c| *c == condition);
        let at = known.unwrap_or_else(|| {
            self.conditions.push(condition);
            self.conditions.len() - 1
        });
        graph.var((self.count + at) as u32)
    }

    /// Replaces the conditions in an expression with variables, except in parts that are constant or not in `outside`.
    fn take_out(
        &mut self,
        graph: &mut Graph,
        root: NodeId,
        still: &dyn Fn(u32) -> bool,
        outside: Option<&NodeSet>,
        comparisons: &mut NodeMap<(Span, Arc<Sides>)>,
        span: Span,
    ) -> NodeId {
        graph.rewrite(&[root], |graph, id, rebuilt| {
            if outside.is_some_and(|outside| !outside.contains(&id)) {
                return Some(id);
            }
            // Conditions refer to the equations as written, hence to the original operands.
            let (a, b) = match graph.node(id) {
                Node::Select(a, ..) | Node::Unary(_, a) | Node::Curve(_, _, a) => (a, a),
                Node::Binary(_, a, b) => (a, b),
                _ => return None,
            };
            if graph.variables(&[a, b]).into_iter().all(still) {
                return None;
            }
            self.smooth_node(graph, id, rebuilt, still, comparisons, span)
        })[0]
    }

    fn smooth_node(
        &mut self,
        graph: &mut Graph,
        id: NodeId,
        rebuilt: Node,
        still: &dyn Fn(u32) -> bool,
        comparisons: &mut NodeMap<(Span, Arc<Sides>)>,
        span: Span,
    ) -> Option<NodeId> {
        let zero = graph.constant(0.0);
        match (graph.node(id), rebuilt) {
            (Node::Select(condition, ..), Node::Select(_, a, b)) => {
                let chosen = self.flag(graph, condition);
                Some(graph.select(chosen, a, b))
            }
            (Node::Binary(op @ (Binary::Min | Binary::Max), x, y), Node::Binary(_, a, b)) => {
                let less = graph.binary(Binary::Lt, x, y);
                let chosen = self.flag(graph, less);
                let (a, b) = if op == Binary::Min { (a, b) } else { (b, a) };
                Some(graph.select(chosen, a, b))
            }
            (Node::Unary(Unary::Abs, x), Node::Unary(_, a)) => {
                let negative = graph.binary(Binary::Lt, x, zero);
                let chosen = self.flag(graph, negative);
                let minus = graph.unary(Unary::Neg, a);
                Some(graph.select(chosen, minus, a))
            }
            (Node::Unary(Unary::Sign, x), Node::Unary(..)) => {
                let (below, above) = (graph.binary(Binary::Lt, x, zero), graph.binary(Binary::Lt, zero, x));
                let (below, above) = (self.flag(graph, below), self.flag(graph, above));
                let (minus, one) = (graph.constant(-1.0), graph.constant(1.0));
                let rest = graph.select(above, one, zero);
                Some(graph.select(below, minus, rest))
            }
            // It changes only when its argument jumps.
            (Node::Unary(Unary::Floor | Unary::Ceil, x), _) if is_step(graph, x, still) => None,
            (Node::Unary(op @ (Unary::Floor | Unary::Ceil), x), Node::Unary(_, a)) => {
                let up = op == Unary::Ceil;
                let negated = |graph: &mut Graph, x| if up { graph.unary(Unary::Neg, x) } else { x };
                let (x, a) = (negated(graph, x), negated(graph, a));
                let (level, _) = self.level(graph, x, a, true);
                Some(negated(graph, level))
            }
            (Node::Curve(curve, part, x), Node::Curve(_, _, a))
                if !matches!(part, Part::Inverse | Part::Phase | Part::PhaseSlope) =>
            {
                let phase = graph.curve(curve, Part::Phase, x);
                let moved = graph.curve(curve, Part::Phase, a);
                let (piece, change) = self.level(graph, phase, moved, false);
                let sides = [graph.curve_of(curve).name.clone(), "its value at a knot".to_owned()];
                comparisons.entry(change).or_insert((span, Arc::new(sides.into())));
                Some(graph.piece(curve, part, piece, a))
            }
            _ => None,
        }
    }

    /// The floor of an expression x, frozen, and the condition that changes at its jumps. A jump is a sign change of sin(π x).
    /// Between two jumps the floor is the even or the odd number next to x - 1/2, which does not depend on the rounding of x
    /// at the jump. If it is `closed`, the floor of an x that rests at a whole number is that number: even if cos(π x) is
    /// positive.
    fn level(&mut self, graph: &mut Graph, x: NodeId, rebuilt: NodeId, closed: bool) -> (NodeId, NodeId) {
        let [zero, half, one, two] = [0.0, 0.5, 1.0, 2.0].map(|x| graph.constant(x));
        let sine = graph.unary(Unary::SinPi, x);
        let change = graph.binary(Binary::Lt, zero, sine);
        let mut is_even = change;
        if closed {
            let cosine = graph.unary(Unary::CosPi, x);
            let (on, up) = (graph.binary(Binary::Eq, zero, sine), graph.binary(Binary::Lt, zero, cosine));
            let on_even = graph.binary(Binary::And, on, up);
            is_even = graph.binary(Binary::Or, change, on_even);
        }
        let even = self.flag(graph, is_even);
        // 2 floor((x + 1/2 - odd) / 2) + odd: x occurs once, so that interval bounds are as narrow as possible.
        let odd = graph.select(even, zero, one);
        let shift = graph.binary(Binary::Sub, half, odd);
        let shifted = graph.binary(Binary::Add, rebuilt, shift);
        let pairs = graph.binary(Binary::Div, shifted, two);
        let pairs = graph.unary(Unary::Floor, pairs);
        let pairs = graph.binary(Binary::Mul, two, pairs);
        (graph.binary(Binary::Add, pairs, odd), change)
    }
}
