//! All zeros of an expression of one variable.
//!
//! The whole line is cut into pieces. Bounds of the expression exclude zero on a piece, or those of its slope show that it is monotone there, so that its
//! ends tell. `sin(w)` has too many zeros, and `w*w - 3*w` has two: nothing that is found at one of them tells about the others.

use super::form::Bounded;
use dlsys_expr::{Binary, Dual, Graph, Interval, Node, NodeId, Program, Scratch, Unary, Value};

/// Most pieces of the line that are examined.
const MAX_PIECES: usize = 1000;
/// Most zeros that are looked for.
const MAX_ZEROS: usize = 16;
/// The first cut of the line: no number that is a zero of what people write.
const FIRST_CUT: f64 = -0.731_058_578_630_004_9;

/// Pieces of the line with one zero each, of an expression as a function of the variable `pivot`; `point` gives the values of the others. None if some
/// zero may not be in them.
pub(super) fn pieces_with_a_zero(
    expression: &Program,
    point: &[f64],
    pivot: usize,
) -> Option<Vec<(f64, f64)>> {
    let mut along: Vec<Dual<Interval>> = point.iter().map(|&value| Dual::constant(value)).collect();
    let mut scratch = Scratch::default();
    let mut over = |lo: f64, hi: f64| {
        along[pivot] = Dual { value: Interval::spanned(lo, hi), rate: Interval::constant(1.0) };
        let mut out = [Dual::constant(0.0)];
        expression.eval(&along, &mut scratch, &mut out);
        out[0]
    };
    let mut open = vec![(FIRST_CUT, f64::INFINITY), (f64::NEG_INFINITY, FIRST_CUT)];
    let mut found: Vec<(f64, f64)> = Vec::new();
    for _ in 0..MAX_PIECES {
        let Some((lo, hi)) = open.pop() else { return Some(found) };
        let Dual { value, rate } = over(lo, hi);
        if value.is_empty() || value.lo > 0.0 || value.hi < 0.0 {
            continue;
        }
        let is_monotone = !rate.partial && (rate.lo > 0.0 || rate.hi < 0.0);
        if is_monotone && lo.is_finite() && hi.is_finite() {
            let [first, last] = [lo, hi].map(|at| over(at, at).value);
            // A zero at an end belongs to the piece before it.
            let at_first = first.lo == 0.0 && first.hi == 0.0;
            if at_first || first.hi < 0.0 && last.hi < 0.0 || first.lo > 0.0 && last.lo > 0.0 {
                continue;
            }
            if found.len() == MAX_ZEROS {
                return None;
            }
            found.push((lo, hi));
            continue;
        }
        let middle = match (lo.is_finite(), hi.is_finite()) {
            (true, false) => 2.0 * lo.max(0.5),
            (false, true) => 2.0 * hi.min(-0.5),
            _ => 0.5 * (lo + hi),
        };
        if middle <= lo || middle >= hi || !middle.is_finite() {
            return None;
        }
        open.extend([(middle, hi), (lo, middle)]);
    }
    None
}

/// The zero in such a piece, by Newton's method from its middle; None if that does not find it.
pub(super) fn zero_in(
    expression: &Program,
    point: &[f64],
    pivot: usize,
    (lo, hi): (f64, f64),
) -> Option<Bounded> {
    let mut duals: Vec<Dual<f64>> = point.iter().map(|&value| Dual { value, rate: 0.0 }).collect();
    let mut scratch = Vec::new();
    let (mut lo, mut hi, mut x) = (lo, hi, 0.5 * (lo + hi));
    let mut at = |x: f64| {
        duals[pivot] = Dual { value: x, rate: 1.0 };
        let mut out = [Dual { value: 0.0, rate: 0.0 }];
        expression.eval(&duals, &mut scratch, &mut out);
        out[0]
    };
    let rises = at(lo).value < at(hi).value;
    for _ in 0..200 {
        let Dual { value, rate } = at(x);
        let step = value / rate;
        if !step.is_finite() {
            return None;
        }
        if step.abs() <= 4.0 * f64::EPSILON * x.abs() {
            let value = x - step;
            return Some(Bounded { value, error: 4.0 * f64::EPSILON * value.abs() + step.abs() });
        }
        if (value < 0.0) == rises {
            lo = x
        } else {
            hi = x
        }
        // Where Newton's method leaves what is known, the middle of that is tried.
        let next = x - step;
        x = if lo < next && next < hi { next } else { 0.5 * (lo + hi) };
    }
    None
}

/// An expression that is zero wherever the given one is, of which bounds tell more: the numerator of a quotient of polynomials, in the form of Horner.
pub(super) fn with_same_zeros(graph: &mut Graph, root: NodeId, pivot: u32) -> NodeId {
    let (numerator, _) = quotient(graph, root, pivot);
    let Some(polynomial) = graph.polynomial(numerator, |v| v == pivot) else { return root };
    let (x, mut sum) = (graph.var(pivot), graph.constant(0.0));
    let power = |monomial: &[(u32, u32)]| monomial.first().map_or(0, |(_, power)| *power);
    for of in (0..=polynomial.degree()).rev() {
        sum = graph.binary(Binary::Mul, sum, x);
        if let Some((_, factor)) = polynomial.terms.iter().find(|(monomial, _)| power(monomial) == of) {
            sum = graph.binary(Binary::Add, sum, *factor);
        }
    }
    sum
}

/// An expression as a quotient.
fn quotient(graph: &mut Graph, root: NodeId, pivot: u32) -> (NodeId, NodeId) {
    let one = graph.constant(1.0);
    if !graph.variables(&[root]).contains(&pivot) {
        return (root, one);
    }
    match graph.node(root) {
        Node::Unary(Unary::Neg, a) => {
            let (above, below) = quotient(graph, a, pivot);
            (graph.unary(Unary::Neg, above), below)
        }
        Node::Binary(op @ (Binary::Add | Binary::Sub | Binary::Mul | Binary::Div), a, b) => {
            let [a, b] = [a, b].map(|part| quotient(graph, part, pivot));
            let mut times = |x, y| graph.binary(Binary::Mul, x, y);
            match op {
                Binary::Mul => (times(a.0, b.0), times(a.1, b.1)),
                Binary::Div => (times(a.0, b.1), times(a.1, b.0)),
                op => {
                    let (left, right, below) = (times(a.0, b.1), times(b.0, a.1), times(a.1, b.1));
                    (graph.binary(op, left, right), below)
                }
            }
        }
        _ => (root, one),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zeros(make: impl Fn(&mut Graph, NodeId) -> NodeId) -> Option<Vec<f64>> {
        let mut graph = Graph::default();
        let x = graph.var(0);
        let expression = make(&mut graph, x);
        let plain = with_same_zeros(&mut graph, expression, 0);
        let [given, plain] = [expression, plain].map(|root| Program::compile(&graph, &[root], 1));
        let pieces = pieces_with_a_zero(&plain, &[f64::NAN], 0)?;
        pieces.into_iter().map(|piece| Some(zero_in(&given, &[f64::NAN], 0, piece)?.value)).collect()
    }

    #[test]
    fn all_zeros_are_found() {
        let product = |g: &mut Graph, x| {
            let three = g.constant(3.0);
            let (square, times) = (g.binary(Binary::Mul, x, x), g.binary(Binary::Mul, three, x));
            g.binary(Binary::Sub, square, times)
        };
        assert_eq!(zeros(product), Some(vec![0.0, 3.0]));
        let far = |g: &mut Graph, x| {
            let (one, end) = (g.constant(1.0), g.constant(1e9));
            let (near, far) = (g.binary(Binary::Sub, x, one), g.binary(Binary::Sub, end, x));
            g.binary(Binary::Mul, near, far)
        };
        assert_eq!(zeros(far), Some(vec![1.0, 1e9]));
        let cubic = |g: &mut Graph, x| {
            let two = g.constant(2.0);
            let square = g.binary(Binary::Mul, x, x);
            let cube = g.binary(Binary::Mul, square, x);
            let sum = g.binary(Binary::Add, cube, x);
            g.binary(Binary::Sub, sum, two)
        };
        assert_eq!(zeros(cubic), Some(vec![1.0]));
        // x/(1 + x) = 1/2, |x| = 1, exp(-x) = exp(-1).
        let saturated = |g: &mut Graph, x| {
            let (one, half) = (g.constant(1.0), g.constant(0.5));
            let below = g.binary(Binary::Add, one, x);
            let part = g.binary(Binary::Div, x, below);
            g.binary(Binary::Sub, part, half)
        };
        assert_eq!(zeros(saturated), Some(vec![1.0]));
        let size = |g: &mut Graph, x| {
            let (one, size) = (g.constant(1.0), g.unary(Unary::Abs, x));
            g.binary(Binary::Sub, size, one)
        };
        assert_eq!(zeros(size), Some(vec![-1.0, 1.0]));
        let decay = |g: &mut Graph, x| {
            let (minus, level) = (g.unary(Unary::Neg, x), g.constant((-1f64).exp()));
            let decay = g.unary(Unary::Exp, minus);
            g.binary(Binary::Sub, decay, level)
        };
        assert_eq!(zeros(decay), Some(vec![1.0]));
    }

    #[test]
    fn without_an_end_of_zeros_nothing_is_said() {
        let half = |g: &mut Graph, x| {
            let two = g.constant(2.0);
            let half = g.binary(Binary::Div, x, two);
            g.unary(Unary::SinPi, half)
        };
        assert_eq!(zeros(half), None);
        assert_eq!(zeros(|g, x| g.binary(Binary::Mul, x, x)), None);
    }
}
