//! Comparisons of values that jump or rest, as comparisons of what moves.
//!
//! `floor(x) = 2` changes where x passes 2 and 3, but the difference of its sides rests at whole numbers and jumps from one to the
//! next: whether it has just jumped cannot be told from its value near the jump, where x may be rounded to either side. `2 <= x & x < 3`
//! says the same, and changes where differences of smooth values cross zero. The same holds for `sign`, and for comparisons of
//! `max(x, y)`, `min(x, y)` and `abs(x)`, which have kinks and rest where they are compared with an operand; and for the place within a period, `x - floor(x) < 0.3`: it is so where
//! sin(π x) sin(π (x - 0.3)) is negative, and where x is whole.

use dlsys_expr::{Binary, Graph, Node, NodeId, Unary};

/// Whole numbers below this are added without rounding.
const EXACT: f64 = (1u64 << 50) as f64;

/// How variables move.
pub struct Moves<'v> {
    /// Variables that do not.
    pub steady: &'v [u32],
    /// Variables that jump: aggregates of what does.
    pub jumping: &'v [u32],
}

impl Moves<'_> {
    fn is_steady(&self, variable: u32) -> bool {
        self.steady.contains(&variable)
    }
}

/// A comparison that holds for the same values and compares what moves; None if there is none. Comparisons with NaN keep their results.
pub fn plain(graph: &mut Graph, id: NodeId, moves: &Moves<'_>) -> Option<NodeId> {
    let Node::Binary(op, a, b) = graph.node(id) else { return None };
    let (a, b) = shifted(graph, a, b);
    let (b, a) = shifted(graph, b, a);
    match op {
        Binary::Eq => equal(graph, a, b, moves).or_else(|| equal(graph, b, a, moves)),
        Binary::Ne => {
            let equal = equal(graph, a, b, moves).or_else(|| equal(graph, b, a, moves))?;
            Some(graph.unary(Unary::Not, equal))
        }
        Binary::Lt | Binary::Le => {
            let is_strict = op == Binary::Lt;
            phase(graph, a, b, is_strict, moves)
                .or_else(|| below(graph, a, b, is_strict, moves))
                .or_else(|| above(graph, a, b, is_strict, moves))
        }
        _ => None,
    }
}

/// A comparison of `min(x, y)`, `max(x, y)`, `abs(x)` or `if p then x else y` with anything, as comparisons of x and y; None if it is of
/// nothing like that. The smaller of two values has a kink where they are equal, and what is said of one of them, such as that it still rests at 0, is lost.
/// Comparisons with NaN keep their results.
pub fn apart(graph: &mut Graph, id: NodeId, moves: &Moves<'_>) -> Option<NodeId> {
    if let Some(parts) = of_branches(graph, id, moves) {
        return Some(parts);
    }
    let Node::Binary(op, a, b) = graph.node(id) else { return None };
    if has_steps(graph, &[a, b], moves) {
        return None;
    }
    match op {
        Binary::Eq => one_is(graph, a, b).or_else(|| one_is(graph, b, a)),
        Binary::Ne => {
            let equal = one_is(graph, a, b).or_else(|| one_is(graph, b, a))?;
            Some(graph.unary(Unary::Not, equal))
        }
        Binary::Lt | Binary::Le => {
            let is_strict = op == Binary::Lt;
            each_below(graph, a, b, is_strict).or_else(|| each_above(graph, a, b, is_strict))
        }
        _ => None,
    }
}

/// `(if p then x else y) < level` as `p & x < level | !p & y < level`, where p, x and y move; the same of other comparisons. A branch that rests makes a jump of
/// the choice, as a whole part is one, and it is searched as such.
fn of_branches(graph: &mut Graph, id: NodeId, moves: &Moves<'_>) -> Option<NodeId> {
    let Node::Binary(op, a, b) = graph.node(id) else { return None };
    let is_left = matches!(graph.node(a), Node::Select(..));
    let Node::Select(condition, yes, no) = graph.node(if is_left { a } else { b }) else { return None };
    let rests = |branch| graph.variables(&[branch]).into_iter().all(|v| moves.is_steady(v));
    if [condition, yes, no].into_iter().any(rests) {
        return None;
    }
    // The one that is not chosen may have no value.
    if !graph.reachable(&[yes, no]).into_iter().all(|id| has_value(graph.node(id))) {
        return None;
    }
    let not = graph.unary(Unary::Not, condition);
    let each = [(condition, yes), (not, no)].map(|(holds, branch)| {
        let (a, b) = if is_left { (branch, b) } else { (a, branch) };
        let compared = graph.binary(op, a, b);
        graph.binary(Binary::And, holds, compared)
    });
    Some(graph.binary(Binary::Or, each[0], each[1]))
}

/// True for operations that have a value for all finite operands, but for overflow.
fn has_value(node: Node) -> bool {
    use Binary::{Add, And, Eq, Le, Lt, Max, Min, Mul, Ne, Or, Sub};
    match node {
        Node::Const(_) | Node::Var(_) | Node::Select(..) => true,
        Node::Unary(op, _) => matches!(
            op,
            Unary::Neg | Unary::Square | Unary::Not | Unary::Abs | Unary::Sign | Unary::Floor | Unary::Ceil
        ),
        Node::Binary(op, ..) => matches!(op, Add | Sub | Mul | Min | Max | Lt | Le | Eq | Ne | And | Or),
        _ => false,
    }
}

/// What minima of minima, maxima of maxima, or an absolute value, which is the larger of x and -x, are of; and whether it is the smallest.
fn operands(graph: &mut Graph, id: NodeId) -> Option<(bool, Vec<NodeId>)> {
    let op = match graph.node(id) {
        Node::Binary(op @ (Binary::Min | Binary::Max), ..) => op,
        Node::Unary(Unary::Abs, x) => return Some((false, vec![x, graph.unary(Unary::Neg, x)])),
        _ => return None,
    };
    let (mut found, mut rest) = (Vec::new(), vec![id]);
    while let Some(id) = rest.pop() {
        match graph.node(id) {
            Node::Binary(other, x, y) if other == op => rest.extend([y, x]),
            _ => found.push(id),
        }
    }
    Some((op == Binary::Min, found))
}

fn joined(graph: &mut Graph, op: Binary, all: impl IntoIterator<Item = NodeId>) -> Option<NodeId> {
    all.into_iter().reduce(|all, next| graph.binary(op, all, next))
}

/// `min(x, y) = level`, or `max(x, y) = level`: one is, and none is beyond it.
fn one_is(graph: &mut Graph, step: NodeId, level: NodeId) -> Option<NodeId> {
    let (is_least, operands) = operands(graph, step)?;
    let is_level: Vec<NodeId> = operands.iter().map(|x| graph.binary(Binary::Eq, *x, level)).collect();
    let is_within = operands.iter().map(|x| {
        let (lo, hi) = if is_least { (level, *x) } else { (*x, level) };
        ordered(graph, false, lo, hi)
    });
    let is_within: Vec<NodeId> = is_within.collect();
    let one = joined(graph, Binary::Or, is_level)?;
    joined(graph, Binary::And, [one].into_iter().chain(is_within))
}

/// `min(x, y) < level`, `max(x, y) < level`, or with `<=`.
fn each_below(graph: &mut Graph, step: NodeId, level: NodeId, is_strict: bool) -> Option<NodeId> {
    let (is_least, operands) = operands(graph, step)?;
    let pairs: Vec<_> = operands.into_iter().map(|x| [x, level]).collect();
    all_or_one(graph, !is_least, &pairs, is_strict)
}

/// `level < min(x, y)`, `level < max(x, y)`, or with `<=`.
fn each_above(graph: &mut Graph, level: NodeId, step: NodeId, is_strict: bool) -> Option<NodeId> {
    let (is_least, operands) = operands(graph, step)?;
    let pairs: Vec<_> = operands.into_iter().map(|x| [level, x]).collect();
    all_or_one(graph, is_least, &pairs, is_strict)
}

/// All pairs are in order; or one of them is, and all have numbers.
fn all_or_one(graph: &mut Graph, all: bool, pairs: &[[NodeId; 2]], is_strict: bool) -> Option<NodeId> {
    let are: Vec<NodeId> = pairs.iter().map(|[a, b]| ordered(graph, is_strict, *a, *b)).collect();
    if all {
        return joined(graph, Binary::And, are);
    }
    let one = joined(graph, Binary::Or, are.iter().copied())?;
    let have_numbers = are.iter().zip(pairs).map(|(is_so, [a, b])| {
        let is_not = ordered(graph, !is_strict, *b, *a);
        graph.binary(Binary::Or, *is_so, is_not)
    });
    let have_numbers: Vec<NodeId> = have_numbers.collect();
    joined(graph, Binary::And, [one].into_iter().chain(have_numbers))
}

/// `step + n` and a level, both whole numbers, as the step and the level less n.
fn shifted(graph: &mut Graph, sum: NodeId, level: NodeId) -> (NodeId, NodeId) {
    let is_whole = |x: &f64| *x == x.floor() && x.abs() < EXACT;
    let whole = |graph: &Graph, id| graph.as_constant(id).filter(is_whole);
    if let Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) = graph.node(sum)
        && let Some(level_is) = whole(graph, level)
    {
        let (step, n) = match (whole(graph, a), whole(graph, b)) {
            (None, Some(n)) if op == Binary::Add => (a, n),
            (None, Some(n)) => (a, -n),
            (Some(n), None) if op == Binary::Add => (b, n),
            _ => return (sum, level),
        };
        if matches!(graph.node(step), Node::Unary(Unary::Floor | Unary::Ceil | Unary::Sign, _)) {
            return (step, graph.constant(level_is - n));
        }
    }
    (sum, level)
}

/// True if an expression moves without jumps, so that its whole part jumps where it passes whole numbers, and a level does not move, so that its
/// whole part does not.
fn jumps(graph: &Graph, x: NodeId, level: NodeId, moves: &Moves<'_>) -> bool {
    let rests = |id| graph.variables(&[id]).into_iter().all(|v| moves.is_steady(v));
    rests(level) && !rests(x) && !has_steps(graph, &[x], moves)
}

/// True if expressions jump while variables move: they contain a whole part, a sign, a choice or the like of what is not steady.
pub fn has_steps(graph: &Graph, roots: &[NodeId], moves: &Moves<'_>) -> bool {
    let decides = |id: NodeId| match graph.node(id) {
        Node::Unary(Unary::Floor | Unary::Ceil | Unary::Sign, a) | Node::Element(_, a) => Some([a, a]),
        Node::Binary(Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne, a, b) => Some([a, b]),
        Node::Piece(_, _, a, b) => Some([a, b]),
        Node::Select(condition, ..) => Some([condition; 2]),
        Node::Curve(curve, part, a) if graph.curve_of(curve).jumps(part) => Some([a, a]),
        Node::Var(v) if moves.jumping.contains(&v) => Some([id, id]),
        _ => None,
    };
    let moving = |over: [NodeId; 2]| !graph.variables(&over).into_iter().all(|v| moves.is_steady(v));
    graph.reachable(roots).into_iter().filter_map(decides).any(moving)
}

/// `x - floor(x)` compared with a number between 0 and 1, on either side.
fn phase(graph: &mut Graph, a: NodeId, b: NodeId, is_strict: bool, moves: &Moves<'_>) -> Option<NodeId> {
    let whole_part = |graph: &Graph, id| match graph.node(id) {
        Node::Binary(Binary::Sub, x, whole) if graph.node(whole) == Node::Unary(Unary::Floor, x) => Some(x),
        _ => None,
    };
    let number = |graph: &Graph, id| graph.as_constant(id).filter(|level| 0.0 < *level && *level < 1.0);
    let (x, level, is_below) = match (whole_part(graph, a), whole_part(graph, b)) {
        (Some(x), None) if number(graph, b).is_some() => (x, b, true),
        (None, Some(x)) if number(graph, a).is_some() => (x, a, false),
        _ => return None,
    };
    if has_steps(graph, &[x], moves) {
        return None;
    }
    let zero = graph.constant(0.0);
    let beyond = graph.binary(Binary::Sub, x, level);
    let [begins, ends] = [x, beyond].map(|x| graph.unary(Unary::SinPi, x));
    let product = graph.binary(Binary::Mul, begins, ends);
    let (lo, hi) = if is_below { (product, zero) } else { (zero, product) };
    let inside = graph.binary(Binary::Lt, lo, hi);
    // Which of the two ends counts: the whole number with what is below, the level where equality counts.
    let ends: &[NodeId] = match (is_below, is_strict) {
        (true, true) => &[begins],
        (true, false) => &[begins, ends],
        (false, true) => &[],
        (false, false) => &[ends],
    };
    Some(ends.iter().fold(inside, |all, end| {
        let there = graph.binary(Binary::Eq, *end, zero);
        graph.binary(Binary::Or, all, there)
    }))
}

/// `x < y`, or `x <= y`.
fn ordered(graph: &mut Graph, is_strict: bool, x: NodeId, y: NodeId) -> NodeId {
    graph.binary(if is_strict { Binary::Lt } else { Binary::Le }, x, y)
}

/// `floor(x) + n`, or `ceil(x) + n`.
fn whole(graph: &mut Graph, op: Unary, x: NodeId, n: f64) -> NodeId {
    let (part, n) = (graph.unary(op, x), graph.constant(n));
    graph.binary(Binary::Add, part, n)
}

/// `step = level`.
fn equal(graph: &mut Graph, step: NodeId, level: NodeId, moves: &Moves<'_>) -> Option<NodeId> {
    let zero = graph.constant(0.0);
    match graph.node(step) {
        Node::Unary(op @ (Unary::Floor | Unary::Ceil), x) if jumps(graph, x, level, moves) => {
            let part = graph.unary(op, level);
            let is_whole = graph.binary(Binary::Eq, level, part);
            // From level to level + 1, or from level - 1 to level.
            let beside = graph.constant(if op == Unary::Floor { 1.0 } else { -1.0 });
            let beside = graph.binary(Binary::Add, level, beside);
            let (lo, hi) = if op == Unary::Floor { (level, beside) } else { (beside, level) };
            let from = ordered(graph, op == Unary::Ceil, lo, x);
            let to = ordered(graph, op == Unary::Floor, x, hi);
            let both = graph.binary(Binary::And, from, to);
            match graph.as_constant(is_whole) {
                Some(1.0) => Some(both),
                Some(_) => Some(zero),
                None => Some(graph.binary(Binary::And, is_whole, both)),
            }
        }
        Node::Unary(Unary::Sign, x) => {
            let signs = [(-1.0, Binary::Lt, x, zero), (0.0, Binary::Eq, x, zero), (1.0, Binary::Lt, zero, x)];
            if let Some(level) = graph.as_constant(level) {
                let found = signs.into_iter().find(|(sign, ..)| *sign == level);
                return Some(found.map_or(zero, |(_, op, a, b)| graph.binary(op, a, b)));
            }
            sign_against(graph, (x, level), moves, |graph, sign, level| graph.binary(Binary::Eq, level, sign))
        }
        Node::Unary(Unary::Abs, x) if x == level => Some(ordered(graph, false, zero, x)),
        Node::Binary(op @ (Binary::Min | Binary::Max), x, y) if x == level || y == level => {
            let (same, other) = if x == level { (x, y) } else { (y, x) };
            let (lo, hi) = if op == Binary::Min { (same, other) } else { (other, same) };
            Some(ordered(graph, false, lo, hi))
        }
        _ => None,
    }
}

/// A comparison of the sign of what moves with a level that rests: that of each of the three signs, where the sign is that one.
fn sign_against(
    graph: &mut Graph,
    (x, level): (NodeId, NodeId),
    moves: &Moves<'_>,
    compare: impl Fn(&mut Graph, NodeId, NodeId) -> NodeId,
) -> Option<NodeId> {
    if !jumps(graph, x, level, moves) {
        return None;
    }
    let zero = graph.constant(0.0);
    let mut one = |sign: f64, op: Binary, a: NodeId, b: NodeId| {
        let sign = graph.constant(sign);
        let (is_so, holds) = (graph.binary(op, a, b), compare(graph, sign, level));
        graph.binary(Binary::And, holds, is_so)
    };
    let each = [one(-1.0, Binary::Lt, x, zero), one(0.0, Binary::Eq, x, zero), one(1.0, Binary::Lt, zero, x)];
    each.into_iter().reduce(|all, next| graph.binary(Binary::Or, all, next))
}

/// `step < level`, or `step <= level`.
fn below(
    graph: &mut Graph,
    step: NodeId,
    level: NodeId,
    is_strict: bool,
    moves: &Moves<'_>,
) -> Option<NodeId> {
    match graph.node(step) {
        Node::Unary(op @ (Unary::Floor | Unary::Ceil), x) if jumps(graph, x, level, moves) => {
            // floor(x) < l: x < ceil(l). floor(x) <= l: x < floor(l) + 1. ceil(x) < l: x <= ceil(l) - 1. ceil(x) <= l: x <= floor(l).
            let is_floor = op == Unary::Floor;
            let part = if is_strict { Unary::Ceil } else { Unary::Floor };
            let shift = f64::from(u8::from(is_floor)) - f64::from(u8::from(is_strict));
            let end = whole(graph, part, level, shift);
            Some(ordered(graph, is_floor, x, end))
        }
        Node::Unary(Unary::Sign, x) => {
            let zero = graph.constant(0.0);
            let Some(level) = graph.as_constant(level) else {
                return sign_against(graph, (x, level), moves, |graph, sign, level| {
                    ordered(graph, is_strict, sign, level)
                });
            };
            let holds = |sign: f64| if is_strict { sign < level } else { sign <= level };
            match [-1.0, 0.0, 1.0].map(holds) {
                [true, false, false] => Some(ordered(graph, true, x, zero)),
                [true, true, false] => Some(ordered(graph, false, x, zero)),
                _ => None,
            }
        }
        // max(x, y) <= y, and min(x, y) < y.
        Node::Binary(op @ (Binary::Min | Binary::Max), x, y)
            if (x == level || y == level) && is_strict == (op == Binary::Min) =>
        {
            let other = if x == level { y } else { x };
            Some(ordered(graph, is_strict, other, level))
        }
        _ => None,
    }
}

/// `level < step`, or `level <= step`: what is not so where `step <= level`, or `step < level`, but for NaN.
fn above(
    graph: &mut Graph,
    level: NodeId,
    step: NodeId,
    is_strict: bool,
    moves: &Moves<'_>,
) -> Option<NodeId> {
    if let Node::Unary(Unary::Sign, x) = graph.node(step)
        && graph.as_constant(level).is_none()
    {
        return sign_against(graph, (x, level), moves, |graph, sign, level| {
            ordered(graph, is_strict, level, sign)
        });
    }
    let opposite = below(graph, step, level, !is_strict, moves)?;
    match graph.node(opposite) {
        Node::Binary(op @ (Binary::Lt | Binary::Le), x, y) => Some(ordered(graph, op == Binary::Le, y, x)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Moves, apart, plain};
    use dlsys_expr::{Binary, Graph, NodeId, Program, Unary};

    /// The value of an expression of x and y.
    fn value(graph: &Graph, root: NodeId, variables: [f64; 2]) -> f64 {
        Program::compile(graph, &[root], 2).eval_one(&variables)
    }

    /// Checks that what is made of comparisons, on either side, holds for the same numbers; returns of how many something is made.
    fn compared(
        graph: &mut Graph,
        (sides, levels): (&[NodeId], &[NodeId]),
        numbers: &[f64],
        make: impl Fn(&mut Graph, NodeId) -> Option<NodeId>,
    ) -> usize {
        let mut known = 0;
        for (&side, &level) in sides.iter().flat_map(|side| levels.iter().map(move |level| (side, level))) {
            for op in [Binary::Lt, Binary::Le, Binary::Eq, Binary::Ne] {
                for (a, b) in [(side, level), (level, side)] {
                    let written = graph.binary(op, a, b);
                    let Some(made) = make(graph, written) else { continue };
                    known += 1;
                    for (&x, &y) in numbers.iter().flat_map(|x| numbers.iter().map(move |y| (x, y))) {
                        let [before, after] = [written, made].map(|root| value(graph, root, [x, y]));
                        assert_eq!(before, after, "{op:?} {side:?} {level:?}: {x}, {y}");
                    }
                }
            }
        }
        known
    }

    #[test]
    fn comparisons_taken_apart_hold_for_the_same_values() {
        let numbers =
            [-2.5, -1.0, -0.5, -0.0, 0.0, 0.5, 1.0, 2.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        let mut graph = Graph::default();
        let (x, y) = (graph.var(0), graph.var(1));
        let one = graph.constant(1.0);
        let double = graph.binary(Binary::Add, y, y);
        let mut kinks = vec![graph.unary(Unary::Abs, x)];
        for op in [Binary::Min, Binary::Max] {
            kinks.extend([graph.binary(op, x, y), graph.binary(op, one, x)]);
        }
        kinks.push(graph.binary(Binary::Min, kinks[1], double));
        let is_less = graph.binary(Binary::Lt, x, y);
        kinks.push(graph.select(is_less, double, x));
        let mut levels: Vec<NodeId> = numbers.map(|number| graph.constant(number)).into();
        levels.extend([double, kinks[1], kinks[4]]);
        let known = compared(&mut graph, (&kinks, &levels), &numbers, |graph, written| {
            apart(graph, written, &Moves { steady: &[], jumping: &[] })
        });
        assert!(known > 250, "{known}");
    }

    #[test]
    fn plain_comparisons_hold_for_the_same_values() {
        let numbers =
            [-2.5, -2.0, -1.75, -1.5, -1.0, -0.5, 0.0, 0.5, 0.75, 1.0, 1.5, 2.0, 2.25, 2.5, f64::NAN];
        let mut graph = Graph::default();
        let (x, y) = (graph.var(0), graph.var(1));
        let mut steps: Vec<NodeId> =
            [Unary::Floor, Unary::Ceil, Unary::Sign, Unary::Abs].map(|op| graph.unary(op, x)).into();
        for op in [Binary::Min, Binary::Max] {
            steps.extend([graph.binary(op, x, y), graph.binary(op, y, x)]);
        }
        for (op, n) in [(Binary::Add, 1.0), (Binary::Sub, 2.0)] {
            let n = graph.constant(n);
            for step in 0..3 {
                steps.push(graph.binary(op, steps[step], n));
            }
            steps.push(graph.binary(Binary::Add, n, steps[0]));
        }
        let floor = steps[0];
        steps.push(graph.binary(Binary::Sub, x, floor));
        let mut levels: Vec<NodeId> = numbers[..14].iter().map(|number| graph.constant(*number)).collect();
        levels.extend([x, y]);
        // y rests, x moves.
        let known = compared(&mut graph, (&steps, &levels), &numbers, |graph, written| {
            plain(graph, written, &Moves { steady: &[1], jumping: &[] })
        });
        assert!(known > 250, "{known}");
    }
}
