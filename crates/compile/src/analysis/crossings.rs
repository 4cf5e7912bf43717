//! Zero-crossing functions: the method that locates the zero of each difference of two sides.

use dlsys_expr::{Binary, Graph, Monomial, NodeId, Polynomial, Program, Unary};
use dlsys_model::{AffineSum, ZeroCrossing};

use super::variability::Constants;

/// The zero-crossing function of two sides. `monotone` is true for own parameters with monotone solutions.
pub fn crossing(
    graph: &mut Graph,
    (a, b): (NodeId, NodeId),
    constants: &Constants,
    monotone: &dyn Fn(usize) -> bool,
    total: usize,
) -> ZeroCrossing {
    if constants.all_constant(graph, &[a, b]) {
        return ZeroCrossing::Constant;
    }
    let difference = graph.binary(Binary::Sub, a, b);
    let Some(p) = graph.polynomial(difference, |v| !constants.is_constant(v)) else {
        return ZeroCrossing::Search { sum: None, level: None };
    };
    let moving: Vec<(&[(u32, u32)], NodeId)> =
        p.terms.iter().filter(|(m, _)| !m.is_empty()).map(|(m, c)| (&m[..], *c)).collect();
    match moving[..] {
        [] => ZeroCrossing::Constant,
        [(&[(variable, 1)], slope)] => {
            let v = variable as usize;
            let level = match p.terms.get(&Monomial::new()) {
                None => graph.constant(0.0),
                Some(&rest) => {
                    let minus = graph.unary(Unary::Neg, rest);
                    graph.binary(Binary::Div, minus, slope)
                }
            };
            let level = Program::compile(graph, &[level], total);
            if v >= constants.own && v < constants.time || v < constants.own && !monotone(v) {
                return ZeroCrossing::Search { sum: sum(graph, &p), level: Some((v, level)) };
            }
            ZeroCrossing::Formula { variable: v, level }
        }
        _ => ZeroCrossing::Search { sum: sum(graph, &p), level: None },
    }
}

/// A polynomial as an affine sum, if it is linear with constant factors.
fn sum(graph: &Graph, p: &Polynomial) -> Option<AffineSum> {
    let mut sum = AffineSum { constant: 0.0, terms: Vec::new() };
    for (monomial, &factor) in &p.terms {
        let factor = graph.as_constant(factor)?;
        match monomial[..] {
            [] => sum.constant = factor,
            [(variable, 1)] => sum.terms.push((variable as usize, factor)),
            _ => return None,
        }
    }
    Some(sum)
}
