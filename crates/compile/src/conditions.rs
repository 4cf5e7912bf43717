//! Decomposition of conditions into comparisons of two sides (atoms), which all clauses of a rule share.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::advice;
use crate::comparisons::{self, Moves};
use crate::rules::RuleBuilder;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, Node, NodeId, Unary};
use dlsys_model::{Boundary, Comparison, Condition, ConditionStep};

/// Maximum number of comparisons and connectives of a condition, after expansion of functions.
const MAX_CONDITION: usize = 10_000;

/// Comparisons of a condition that are taken apart at kinks and choices, at most.
const MAX_APART: usize = 100;

/// The sides of a comparison as written.
pub struct Sides {
    pub written: [String; 2],
    /// True if its node in the graph has them in the opposite order.
    pub turned: bool,
}

impl From<[String; 2]> for Sides {
    fn from(written: [String; 2]) -> Sides {
        Sides { written, turned: false }
    }
}

/// The pairs of expressions that the conditions of a rule compare.
#[derive(Default)]
pub struct Atoms {
    pub sides: Vec<(NodeId, NodeId)>,
    pub spans: Vec<Span>,
    pub boundaries: Vec<Boundary>,
    /// True for a part of a comparison of a whole part or a sign.
    pub jumping: Vec<bool>,
    /// The module's parameters that no clause of the rule moves.
    steady: Vec<u32>,
    /// The variable of the first aggregate.
    first_aggregate: u32,
    /// What is decomposed is the condition of a production. Productions take place behind a jump, and equations change at it, so a comparison of what
    /// jumps that both ask for is two atoms.
    pub of_productions: bool,
    index: FxHashMap<(NodeId, NodeId, bool), u32>,
}

impl RuleBuilder<'_> {
    /// Decomposes a condition into comparisons of two sides.
    pub(super) fn decompose(&mut self, root: NodeId, span: Span, atoms: &mut Atoms) -> Option<Condition> {
        enum Task {
            /// A condition, and whether it is a part of a comparison of something that jumps.
            Visit(NodeId, bool),
            Emit(ConditionStep),
        }
        let jumping = self.jumping_aggregates(atoms);
        let (mut steps, mut taken_apart) = (Vec::new(), 0);
        let mut tasks = vec![Task::Visit(root, false)];
        while let Some(task) = tasks.pop() {
            if steps.len() > MAX_CONDITION {
                self.error(
                    Diagnostic::error("this condition is too long")
                        .at(span, format!("more than {MAX_CONDITION} comparisons and connectives"))
                        .help("functions that call functions multiply what they compare: compute a shared part once"),
                );
                return None;
            }
            let (id, jumps) = match task {
                Task::Emit(step) => {
                    steps.push(step);
                    continue;
                }
                Task::Visit(id, jumps) => (id, jumps),
            };
            match self.scope.graph.node(id) {
                Node::Const(bits) => steps.push(ConditionStep::Constant(f64::from_bits(bits) != 0.0)),
                Node::Unary(Unary::Not, a) => {
                    tasks.extend([Task::Emit(ConditionStep::Not), Task::Visit(a, jumps)]);
                }
                Node::Binary(op @ (Binary::And | Binary::Or), a, b) => {
                    let step = if op == Binary::And { ConditionStep::And } else { ConditionStep::Or };
                    tasks.extend([Task::Emit(step), Task::Visit(b, jumps), Task::Visit(a, jumps)]);
                }
                Node::Binary(op, a, b) => {
                    let moves = Moves { steady: &atoms.steady, jumping: &jumping };
                    if let Some(plain) = self.plain(id, span, &moves) {
                        let jumps = jumps || comparisons::has_steps(&self.scope.graph, &[id], &moves);
                        tasks.push(Task::Visit(plain, jumps));
                        continue;
                    }
                    // Parts of choices of choices multiply.
                    if taken_apart < MAX_APART
                        && let Some(parts) = comparisons::apart(&mut self.scope.graph, id, &moves)
                    {
                        taken_apart += 1;
                        self.note_parts(id, parts, span);
                        tasks.push(Task::Visit(parts, jumps));
                        continue;
                    }
                    // What is left of it may jump itself.
                    let has_steps = (jumps || atoms.of_productions)
                        && comparisons::has_steps(&self.scope.graph, &[a, b], &moves);
                    let jumps = jumps && !has_steps;
                    let comparison = match op {
                        Binary::Lt => Comparison::Less,
                        Binary::Le => Comparison::LessOrEqual,
                        Binary::Eq => Comparison::Equal,
                        _ => Comparison::NotEqual,
                    };
                    let known = self.scope.comparisons.get(&id);
                    let (at, boundary) = known.map_or((span, None), |(at, sides)| (*at, Some(&**sides)));
                    let never = [a, b]
                        .into_iter()
                        .any(|side| self.scope.graph.as_constant(side).is_some_and(f64::is_nan));
                    if never {
                        self.scope.diagnostics.push(
                            Diagnostic::warning("this comparison never holds")
                                .at(at, "one of its sides has no value (NaN)")
                                .help(advice::not_finite(f64::NAN)),
                        );
                    }
                    let apart = atoms.of_productions && has_steps;
                    steps.push(atoms.step((a, b, apart), comparison, jumps, at, boundary));
                }
                node => unreachable!("{node:?} is no condition"),
            }
        }
        Some(Condition(steps))
    }

    /// The variables of the aggregates whose terms jump.
    fn jumping_aggregates(&self, atoms: &Atoms) -> Vec<u32> {
        let moves = Moves { steady: &atoms.steady, jumping: &[] };
        let jumps = |term| comparisons::has_steps(&self.scope.graph, &[term], &moves);
        let all = (atoms.first_aggregate..).zip(&self.scope.gathered);
        all.filter(|(_, gathered)| jumps(gathered.term)).map(|(variable, _)| variable).collect()
    }

    /// A comparison in terms of what moves, if there is one.
    fn plain(&mut self, id: NodeId, span: Span, moves: &Moves<'_>) -> Option<NodeId> {
        let plain = comparisons::plain(&mut self.scope.graph, id, moves)?;
        self.note_parts(id, plain, span);
        Some(plain)
    }

    /// Where a comparison is written, and as what, holds for all parts of what takes its place.
    fn note_parts(&mut self, id: NodeId, parts: NodeId, span: Span) {
        let (at, written) = match self.scope.comparisons.get(&id) {
            Some((at, sides)) => (*at, Some(sides.written.clone())),
            None => (span, None),
        };
        for part in self.scope.graph.reachable(&[parts]) {
            if let Node::Binary(Binary::Lt | Binary::Le | Binary::Eq, ..) = self.scope.graph.node(part)
                && let Some(written) = &written
            {
                let sides = || (at, Arc::new(Sides::from(written.clone())));
                self.scope.comparisons.entry(part).or_insert_with(sides);
            }
        }
    }
}

impl Atoms {
    /// None yet, of a module of which these parameters do not move; the variable of its first aggregate.
    pub fn of(steady: Vec<u32>, first_aggregate: u32) -> Atoms {
        Atoms { steady, first_aggregate, ..Atoms::default() }
    }

    /// The step that compares two sides; each pair is stored once, in either order, and once more `apart` from the others.
    fn step(
        &mut self,
        (a, b, apart): (NodeId, NodeId, bool),
        comparison: Comparison,
        jumps: bool,
        span: Span,
        sides: Option<&Sides>,
    ) -> ConditionStep {
        let (pair, comparison) = if a <= b { ((a, b), comparison) } else { ((b, a), comparison.mirrored()) };
        let atom = *self.index.entry((pair.0, pair.1, apart)).or_insert_with(|| {
            self.sides.push(pair);
            self.spans.push(span);
            let known = sides.map(|Sides { written: [left, right], turned }| {
                Boundary::new(left, right, *turned != (a > b))
            });
            self.boundaries.push(known.unwrap_or_default());
            self.jumping.push(false);
            self.sides.len() as u32 - 1
        });
        self.jumping[atom as usize] |= jumps;
        ConditionStep::Atom(atom, comparison)
    }
}
