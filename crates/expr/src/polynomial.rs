//! Expressions as polynomials in some of their variables.
//!
//! The analysis of a model recognises mathematics, not spellings: `r*(1 - x/m)*x` and `r*x - r*x^2/m` have the
//! same coefficients in x.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::{Binary, Graph, Node, NodeId, NodeMap, Unary};

/// Powers of the variables, ascending by variable, none of them zero.
pub type Monomial = Vec<(u32, u32)>;

/// A polynomial whose coefficients are expressions without its variables. Coefficients that are the constant 0
/// are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Polynomial {
    /// The coefficient of each monomial; the empty monomial is the constant term.
    pub terms: BTreeMap<Monomial, NodeId>,
}

const MAX_TERMS: usize = 64;
const MAX_DEGREE: u32 = 8;

impl Polynomial {
    fn constant(node: NodeId) -> Polynomial {
        Polynomial { terms: BTreeMap::from([(Monomial::new(), node)]) }
    }

    /// Highest total degree; 0 for the zero polynomial.
    pub fn degree(&self) -> u32 {
        self.terms.keys().map(|m| m.iter().map(|(_, power)| power).sum()).max().unwrap_or(0)
    }

    /// The coefficient of the power of a single variable (0 for the constant term).
    pub fn coefficient(&self, variable: u32, power: u32) -> Option<NodeId> {
        let monomial = if power == 0 { Monomial::new() } else { vec![(variable, power)] };
        self.terms.get(&monomial).copied()
    }
}

impl Graph {
    /// The expression as a polynomial in the variables that `is_variable` selects; None if it is none that can
    /// be seen to be one, or too long a one.
    pub fn polynomial(&mut self, root: NodeId, is_variable: impl Fn(u32) -> bool) -> Option<Polynomial> {
        // None: free of the variables.
        let mut known: NodeMap<Option<Rc<Polynomial>>> = NodeMap::default();
        for id in self.reachable(&[root]) {
            let node = self.node(id);
            let free = node.operands().into_iter().flatten().all(|o| known[&o].is_none());
            let value = match node {
                Node::Var(v) if is_variable(v) => {
                    let one = self.constant(1.0);
                    Some(Polynomial { terms: BTreeMap::from([(vec![(v, 1)], one)]) })
                }
                _ if free => None,
                Node::Unary(Unary::Neg, a) => {
                    let a = part(&known, a);
                    Some(self.map(&a, |graph, c| graph.unary(Unary::Neg, c)))
                }
                Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) => {
                    let (a, b) = (part(&known, a), part(&known, b));
                    Some(self.sum(&a, &b, |graph, x, y| {
                        if op == Binary::Add { graph.plus(x, y) } else { graph.minus(x, y) }
                    })?)
                }
                Node::Binary(Binary::Mul, a, b) => Some(self.product(&part(&known, a), &part(&known, b))?),
                Node::Binary(Binary::Div, a, b) if known[&b].is_none() => {
                    let a = part(&known, a);
                    Some(self.map(&a, |graph, c| graph.binary(Binary::Div, c, b)))
                }
                Node::Binary(Binary::Pow, a, b) => {
                    let n = self.as_constant(b).filter(|n| *n >= 0.0 && *n == n.trunc() && *n <= 8.0)?;
                    let a = part(&known, a);
                    let mut power = Polynomial::constant(self.constant(1.0));
                    for _ in 0..n as u32 {
                        power = self.product(&power, &a)?;
                    }
                    Some(power)
                }
                Node::Select(c, a, b) if known[&c].is_none() => {
                    let (a, b) = (part(&known, a), part(&known, b));
                    Some(self.sum(&a, &b, |graph, x, y| graph.select(c, x, y))?)
                }
                _ => return None,
            };
            known.insert(id, value.map(Rc::new));
        }
        let mut all = (*part(&known, root)).clone();
        all.terms.retain(|_, c| self.as_constant(*c) != Some(0.0));
        Some(all)
    }

    fn map(&mut self, a: &Polynomial, f: impl Fn(&mut Graph, NodeId) -> NodeId) -> Polynomial {
        Polynomial { terms: a.terms.iter().map(|(m, &c)| (m.clone(), f(self, c))).collect() }
    }

    fn sum(
        &mut self,
        a: &Polynomial,
        b: &Polynomial,
        f: impl Fn(&mut Graph, NodeId, NodeId) -> NodeId,
    ) -> Option<Polynomial> {
        let zero = self.constant(0.0);
        let mut terms = BTreeMap::new();
        for monomial in a.terms.keys().chain(b.terms.keys()) {
            let of = |p: &Polynomial| p.terms.get(monomial).copied().unwrap_or(zero);
            let (x, y) = (of(a), of(b));
            terms.insert(monomial.clone(), f(self, x, y));
        }
        self.bounded(terms)
    }

    fn product(&mut self, a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
        let mut terms: BTreeMap<Monomial, NodeId> = BTreeMap::new();
        for (m, &c) in &a.terms {
            for (n, &d) in &b.terms {
                let mut powers: BTreeMap<u32, u32> = m.iter().copied().collect();
                for &(variable, power) in n {
                    *powers.entry(variable).or_default() += power;
                }
                let monomial: Monomial = powers.into_iter().collect();
                if monomial.iter().map(|(_, p)| p).sum::<u32>() > MAX_DEGREE || terms.len() > MAX_TERMS {
                    return None;
                }
                let product = self.times(c, d);
                let sum = match terms.get(&monomial) {
                    Some(&before) => self.plus(before, product),
                    None => product,
                };
                terms.insert(monomial, sum);
            }
        }
        self.bounded(terms)
    }

    fn bounded(&self, mut terms: BTreeMap<Monomial, NodeId>) -> Option<Polynomial> {
        terms.retain(|_, c| self.as_constant(*c) != Some(0.0));
        (terms.len() <= MAX_TERMS).then_some(Polynomial { terms })
    }
}

/// An operand as a polynomial; one without variables is its own constant term.
fn part(known: &NodeMap<Option<Rc<Polynomial>>>, id: NodeId) -> Rc<Polynomial> {
    known[&id].clone().unwrap_or_else(|| Rc::new(Polynomial::constant(id)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Program;

    /// Variables x, r, m.
    fn coefficients(g: &mut Graph, root: NodeId) -> Vec<f64> {
        let p = g.polynomial(root, |v| v == 0).expect("a polynomial in x");
        let of = |g: &mut Graph, power| {
            let node = p.coefficient(0, power).unwrap_or_else(|| g.constant(0.0));
            Program::compile(g, &[node], 3).eval_one(&[f64::NAN, 2.0, 3.0])
        };
        (0..=p.degree()).map(|power| of(g, power)).collect()
    }

    #[test]
    fn spellings_of_logistic_growth_are_one_polynomial() {
        let mut g = Graph::default();
        let (x, r, m, one) = (g.var(0), g.var(1), g.var(2), g.constant(1.0));
        let two = g.constant(2.0);
        // r (1 - x/m) x
        let q = g.binary(Binary::Div, x, m);
        let rest = g.binary(Binary::Sub, one, q);
        let rx = g.binary(Binary::Mul, r, rest);
        let a = g.binary(Binary::Mul, rx, x);
        // r x - r x²/m
        let square = g.binary(Binary::Pow, x, two);
        let loss = g.binary(Binary::Mul, r, square);
        let loss = g.binary(Binary::Div, loss, m);
        let gain = g.binary(Binary::Mul, r, x);
        let b = g.binary(Binary::Sub, gain, loss);
        assert_eq!(coefficients(&mut g, a), [0.0, 2.0, -2.0 / 3.0]);
        assert_eq!(coefficients(&mut g, b), [0.0, 2.0, -2.0 / 3.0]);
        let root = g.unary(Unary::Sqrt, x);
        assert_eq!(g.polynomial(root, |v| v == 0), None);
        assert_eq!(g.polynomial(root, |v| v == 1).map(|p| p.degree()), Some(0));
    }
}
