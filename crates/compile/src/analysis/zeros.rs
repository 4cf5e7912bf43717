//! The proof that an expression of one variable has no zero but the one that is known.
//!
//! The whole line is cut into pieces. Bounds of the expression exclude zero on a piece, or those of its slope show that it is monotone on the piece with
//! the known zero. `sin(w)` has other zeros, and so has `w*w - 3*w`: nothing that is found at one of them tells about the others.

use dlsys_expr::{Binary, Dual, Graph, Interval, Node, NodeId, Program, Scratch, Unary, Value};

/// Most pieces of the line that are examined.
const MAX_PIECES: usize = 1000;

/// The zero is far from other places by as much as this, at least, in the first pieces.
const LEAST_SIZE: f64 = 1e-3;

/// True if an expression is shown to have no zero but this one, as a function of the variable `pivot`; `point` gives the values of the others.
pub(super) fn is_only_zero(expression: &Program, point: &[f64], pivot: usize, zero: f64) -> bool {
    let mut along: Vec<Dual<Interval>> = point.iter().map(|&value| Dual::constant(value)).collect();
    let mut scratch = Scratch::default();
    let mut open = vec![(f64::NEG_INFINITY, f64::INFINITY)];
    for _ in 0..MAX_PIECES {
        let Some((lo, hi)) = open.pop() else { return true };
        along[pivot] = Dual { value: Interval::spanned(lo, hi), rate: Interval::constant(1.0) };
        let mut out = [Dual::constant(0.0)];
        expression.eval(&along, &mut scratch, &mut out);
        let [Dual { value, rate }] = out;
        let has_none = value.is_empty() || value.lo > 0.0 || value.hi < 0.0;
        let is_monotone = !rate.partial && (rate.lo > 0.0 || rate.hi < 0.0);
        if has_none || is_monotone && lo < zero && zero < hi {
            continue;
        }
        let middle = middle(lo, hi, zero);
        if middle <= lo || middle >= hi {
            return false;
        }
        open.extend([(lo, middle), (middle, hi)]);
    }
    false
}

/// A place at which a piece of the line is cut: beside the zero, not at it.
fn middle(lo: f64, hi: f64, zero: f64) -> f64 {
    let size = zero.abs().max(LEAST_SIZE);
    let holds_zero = lo < zero && zero < hi;
    match (lo.is_finite(), hi.is_finite()) {
        (false, false) => zero - size,
        (true, false) if holds_zero => zero + size,
        (true, false) => lo + (lo - zero),
        (false, true) if holds_zero => zero - size,
        (false, true) => hi - (zero - hi),
        (true, true) if holds_zero && zero - lo > hi - zero => 0.5 * (lo + zero),
        (true, true) if holds_zero => 0.5 * (zero + hi),
        (true, true) => 0.5 * (lo + hi),
    }
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

    fn only(make: impl Fn(&mut Graph, NodeId) -> NodeId, zero: f64) -> bool {
        let mut graph = Graph::default();
        let x = graph.var(0);
        let expression = make(&mut graph, x);
        let plain = with_same_zeros(&mut graph, expression, 0);
        is_only_zero(&Program::compile(&graph, &[plain], 1), &[f64::NAN], 0, zero)
    }

    #[test]
    fn other_zeros_are_seen() {
        let half = |g: &mut Graph, x| {
            let two = g.constant(2.0);
            let half = g.binary(Binary::Div, x, two);
            g.unary(Unary::SinPi, half)
        };
        assert!(!only(half, 0.0));
        let product = |g: &mut Graph, x| {
            let three = g.constant(3.0);
            let (square, times) = (g.binary(Binary::Mul, x, x), g.binary(Binary::Mul, three, x));
            g.binary(Binary::Sub, square, times)
        };
        assert!(!only(product, 0.0) && !only(product, 3.0));
        // Far away: x = 1e9.
        let far = |g: &mut Graph, x| {
            let (one, end) = (g.constant(1.0), g.constant(1e9));
            let (near, far) = (g.binary(Binary::Sub, x, one), g.binary(Binary::Sub, end, x));
            g.binary(Binary::Mul, near, far)
        };
        assert!(!only(far, 1.0));
    }

    #[test]
    fn one_zero_is_shown_to_be_the_only_one() {
        let cubic = |g: &mut Graph, x| {
            let two = g.constant(2.0);
            let square = g.binary(Binary::Mul, x, x);
            let cube = g.binary(Binary::Mul, square, x);
            let sum = g.binary(Binary::Add, cube, x);
            g.binary(Binary::Sub, sum, two)
        };
        assert!(only(cubic, 1.0));
        // x/(1 + x) = 1/2.
        let saturated = |g: &mut Graph, x| {
            let (one, half) = (g.constant(1.0), g.constant(0.5));
            let below = g.binary(Binary::Add, one, x);
            let part = g.binary(Binary::Div, x, below);
            g.binary(Binary::Sub, part, half)
        };
        assert!(only(saturated, 1.0));
        let decay = |g: &mut Graph, x| {
            let (minus, level) = (g.unary(Unary::Neg, x), g.constant((-1f64).exp()));
            let decay = g.unary(Unary::Exp, minus);
            g.binary(Binary::Sub, decay, level)
        };
        assert!(only(decay, 1.0));
    }
}
