//! Symbolic derivatives, for Jacobians.

use super::{Binary, Graph, Node, NodeId, NodeMap, Part, Unary};

impl Graph {
    /// The partial derivative of an expression by a variable. Functions that jump (`floor`, `sign`, comparisons)
    /// have the derivative 0, which is what holds between the jumps; so have derivatives of fields, of which no second ones are known.
    pub fn derivative(&mut self, root: NodeId, variable: u32) -> NodeId {
        let zero = self.constant(0.0);
        let mut known: NodeMap<NodeId> = NodeMap::default();
        for id in self.reachable(&[root]) {
            let of = |known: &NodeMap<NodeId>, id: NodeId| known[&id];
            let rate = match self.node(id) {
                Node::Const(_) => zero,
                Node::Var(v) => self.constant(if v == variable { 1.0 } else { 0.0 }),
                Node::Unary(op, a) => {
                    let da = of(&known, a);
                    if da == zero {
                        zero
                    } else {
                        match self.slope(op, id, a) {
                            Some(slope) => self.times(slope, da),
                            None => zero,
                        }
                    }
                }
                Node::Binary(op, a, b) => {
                    let (da, db) = (of(&known, a), of(&known, b));
                    if da == zero && db == zero { zero } else { self.binary_rate(op, id, (a, da), (b, db)) }
                }
                Node::Select(c, a, b) => {
                    let (da, db) = (of(&known, a), of(&known, b));
                    self.select(c, da, db)
                }
                Node::Curve(curve, part, x) => {
                    let dx = of(&known, x);
                    if dx == zero {
                        zero
                    } else if part == Part::Inverse {
                        let slope = self.curve(curve, Part::Slope, id);
                        self.binary(Binary::Div, dx, slope)
                    } else {
                        let slope = part.derivative().map_or(zero, |slope| self.curve(curve, slope, x));
                        self.times(slope, dx)
                    }
                }
                Node::Piece(curve, part, index, x) => {
                    let dx = of(&known, x);
                    let slope = part.derivative().map_or(zero, |slope| self.piece(curve, slope, index, x));
                    self.times(slope, dx)
                }
                Node::Element(..) => zero,
                Node::Field(field, part, at) => {
                    let mut sum = zero;
                    for (i, of) in at.into_iter().enumerate() {
                        let rate = known[&of];
                        if let Some(slope) = part.derivative(i).filter(|_| rate != zero) {
                            let slope = self.field(field, slope, at);
                            let share = self.times(slope, rate);
                            sum = self.plus(sum, share);
                        }
                    }
                    sum
                }
            };
            known.insert(id, rate);
        }
        known[&root]
    }

    /// The derivative of a function of one operand, if it is not zero wherever there is one.
    fn slope(&mut self, op: Unary, value: NodeId, x: NodeId) -> Option<NodeId> {
        let one = self.constant(1.0);
        Some(match op {
            Unary::Neg => self.constant(-1.0),
            Unary::Square => {
                let two = self.constant(2.0);
                self.times(two, x)
            }
            Unary::Sqrt => {
                let half = self.constant(0.5);
                self.binary(Binary::Div, half, value)
            }
            Unary::Exp => value,
            Unary::Ln => self.binary(Binary::Div, one, x),
            Unary::Expm1 => self.binary(Binary::Add, value, one),
            Unary::Ln1p => {
                let sum = self.binary(Binary::Add, one, x);
                self.binary(Binary::Div, one, sum)
            }
            Unary::Log10 => {
                let factor = self.constant(std::f64::consts::LOG10_E);
                self.binary(Binary::Div, factor, x)
            }
            Unary::Abs => self.unary(Unary::Sign, x),
            Unary::Not | Unary::Sign | Unary::Floor | Unary::Ceil => return None,
            Unary::Sin => self.unary(Unary::Cos, x),
            Unary::Cos => {
                let sine = self.unary(Unary::Sin, x);
                self.unary(Unary::Neg, sine)
            }
            Unary::SinPi | Unary::CosPi => {
                let (other, sign) =
                    if op == Unary::SinPi { (Unary::CosPi, 1.0) } else { (Unary::SinPi, -1.0) };
                let (other, pi) = (self.unary(other, x), self.constant(sign * std::f64::consts::PI));
                self.binary(Binary::Mul, pi, other)
            }
            Unary::Tan => {
                let square = self.binary(Binary::Mul, value, value);
                self.binary(Binary::Add, one, square)
            }
            Unary::Asin | Unary::Acos => {
                let square = self.binary(Binary::Mul, x, x);
                let rest = self.binary(Binary::Sub, one, square);
                let root = self.unary(Unary::Sqrt, rest);
                let top = self.constant(if op == Unary::Asin { 1.0 } else { -1.0 });
                self.binary(Binary::Div, top, root)
            }
            Unary::Atan => {
                let square = self.binary(Binary::Mul, x, x);
                let sum = self.binary(Binary::Add, one, square);
                self.binary(Binary::Div, one, sum)
            }
            Unary::Sinh => self.unary(Unary::Cosh, x),
            Unary::Cosh => self.unary(Unary::Sinh, x),
            Unary::Tanh => {
                let square = self.binary(Binary::Mul, value, value);
                self.binary(Binary::Sub, one, square)
            }
        })
    }

    fn binary_rate(
        &mut self,
        op: Binary,
        value: NodeId,
        (a, da): (NodeId, NodeId),
        (b, db): (NodeId, NodeId),
    ) -> NodeId {
        match op {
            Binary::Add => self.plus(da, db),
            Binary::Sub => self.minus(da, db),
            Binary::Mul => {
                let (left, right) = (self.times(da, b), self.times(a, db));
                self.plus(left, right)
            }
            Binary::Div => {
                let part = self.times(value, db);
                let top = self.minus(da, part);
                self.binary(Binary::Div, top, b)
            }
            Binary::Pow => {
                let one = self.constant(1.0);
                let lower = self.binary(Binary::Sub, b, one);
                let power = self.binary(Binary::Pow, a, lower);
                let slope = self.times(b, power);
                let by_base = self.times(slope, da);
                let logarithm = self.unary(Unary::Ln, a);
                let growth = self.times(value, logarithm);
                let by_exponent = self.times(growth, db);
                self.plus(by_base, by_exponent)
            }
            Binary::Min | Binary::Max => {
                let (low, high) = if op == Binary::Min { (a, b) } else { (b, a) };
                let first = self.binary(Binary::Lt, low, high);
                self.select(first, da, db)
            }
            Binary::Atan2 => {
                let (left, right) = (self.times(b, da), self.times(a, db));
                let top = self.minus(left, right);
                let (aa, bb) = (self.times(a, a), self.times(b, b));
                let norm = self.plus(aa, bb);
                self.binary(Binary::Div, top, norm)
            }
            Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne | Binary::And | Binary::Or => {
                self.constant(0.0)
            }
        }
    }

    fn is_zero(&self, a: NodeId) -> bool {
        self.as_constant(a) == Some(0.0)
    }

    /// Product in which 0 annihilates: in a derivative a zero stands for "does not depend".
    pub(super) fn times(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if self.is_zero(a) || self.is_zero(b) {
            return self.constant(0.0);
        }
        if self.as_constant(b) == Some(1.0) {
            return a;
        }
        self.binary(Binary::Mul, a, b)
    }

    /// A sum, without terms that are 0.
    pub fn plus(&mut self, a: NodeId, b: NodeId) -> NodeId {
        match (self.is_zero(a), self.is_zero(b)) {
            (true, _) => b,
            (_, true) => a,
            _ => self.binary(Binary::Add, a, b),
        }
    }

    pub(super) fn minus(&mut self, a: NodeId, b: NodeId) -> NodeId {
        match (self.is_zero(a), self.is_zero(b)) {
            (_, true) => a,
            (true, _) => self.unary(Unary::Neg, b),
            _ => self.binary(Binary::Sub, a, b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dual, Program, Value};
    use proptest::prelude::*;

    proptest! {
        /// Against forward differentiation, which is independent code.
        #[test]
        fn derivatives_agree_with_dual_numbers(
            choices in proptest::collection::vec((0usize..32, 0usize..40, 0usize..40), 1..12),
            x in 0.2..3.0f64, y in 0.2..3.0f64,
        ) {
            let mut g = Graph::default();
            let mut nodes = vec![g.var(0), g.var(1), g.constant(0.7), g.constant(2.0)];
            for (op, a, b) in choices {
                let (a, b) = (nodes[a % nodes.len()], nodes[b % nodes.len()]);
                let unary = [Unary::Neg, Unary::Sqrt, Unary::Exp, Unary::Ln, Unary::Log10, Unary::Expm1, Unary::Ln1p, Unary::Abs, Unary::Sin, Unary::SinPi, Unary::CosPi,
                    Unary::Cos, Unary::Tan, Unary::Asin, Unary::Acos, Unary::Atan, Unary::Sinh, Unary::Cosh, Unary::Tanh];
                let binary = [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Pow, Binary::Min, Binary::Max, Binary::Atan2];
                let node = match op {
                    i if i < unary.len() => g.unary(unary[i], a),
                    i => g.binary(binary[i % binary.len()], a, b),
                };
                nodes.push(node);
            }
            let root = *nodes.last().expect("not empty");
            let derivative = g.derivative(root, 0);
            let symbolic = Program::compile(&g, &[derivative], 2).eval_one(&[x, y]);
            let mut out = [Dual::constant(0.0)];
            let point = [Dual { value: x, rate: 1.0 }, Dual { value: y, rate: 0.0 }];
            Program::compile(&g, &[root], 2).eval(&point, &mut Vec::new(), &mut out);
            let forward = out[0].rate;
            prop_assume!(forward.is_finite() && symbolic.is_finite() && forward.abs() < 1e12);
            prop_assert!((symbolic - forward).abs() <= 1e-8 * forward.abs().max(1.0), "{symbolic} {forward}");
        }
    }
}
