//! Expressions as polynomials whose coefficients carry bounds of their rounding errors.
//!
//! Whether a computed value of 1e-16 is zero depends on its computation: `(1 - x)^2` at `x = 1 - 1e-8` is 1e-16 to sixteen
//! digits, and `1 - x/3` at 3 is 0 with an error of 1e-16. So every number here carries a bound of its error (running error
//! analysis; Higham 2002, section 3.3), and a number within its bound counts as zero.
//!
//! Variables that change (time, parameters with equations, neighbours) are indeterminates. A function of indeterminates is
//! another indeterminate, the same one for the same argument, so that `sin(t) - sin(t)` is zero, and `exp(-(t - 300)^2)` is
//! not zero even at points where it underflows.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use dlsys_expr::{Binary, Curve, Graph, Node, NodeId, NodeMap, Unary, Value};

/// Relative rounding error of one operation.
const ROUNDING: f64 = 0.5 * f64::EPSILON;
/// Maximum number of terms, and maximum degree.
const MAX_TERMS: usize = 64;
const MAX_DEGREE: u32 = 12;

/// A number and a bound of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    pub value: f64,
    pub error: f64,
}

impl Bounded {
    pub fn exactly(value: f64) -> Bounded {
        Bounded { value, error: 0.0 }
    }

    /// A number in the text: whole numbers are exact, others rounded.
    fn written(value: f64) -> Bounded {
        let whole = value == value.trunc() && value.abs() < 9e15;
        Bounded { value, error: if whole { 0.0 } else { ROUNDING * value.abs() } }
    }

    fn rounded(value: f64, error: f64) -> Bounded {
        Bounded { value, error: error + ROUNDING * value.abs() }
    }

    /// True if it may be zero.
    pub fn may_be_zero(self) -> bool {
        self.value.abs() <= 2.0 * self.error
    }

    fn plus(self, other: Bounded) -> Bounded {
        Bounded::rounded(self.value + other.value, self.error + other.error)
    }

    /// True for 1 and -1, which multiply without rounding.
    fn is_sign(self) -> bool {
        self.error == 0.0 && self.value.abs() == 1.0
    }

    fn times(self, other: Bounded) -> Bounded {
        if self.is_sign() || other.is_sign() {
            return Bounded { value: self.value * other.value, error: self.error.max(other.error) };
        }
        let error = self.error * other.value.abs() + other.error * (self.value.abs() + self.error);
        Bounded::rounded(self.value * other.value, error)
    }

    /// The quotient; None if the divisor may be zero.
    fn over(self, other: Bounded) -> Option<Bounded> {
        if other.may_be_zero() {
            return None;
        }
        if other.is_sign() {
            return Some(Bounded { value: self.value / other.value, ..self });
        }
        let value = self.value / other.value;
        let error = (self.error + value.abs() * other.error) / (other.value.abs() - other.error);
        Some(Bounded::rounded(value, error))
    }

    /// A function of the number, with a bound from the values at both ends of its range.
    fn through(self, f: impl Fn(f64) -> f64) -> Bounded {
        let value = f(self.value);
        let spread = [-1.0, 1.0].map(|side| (f(self.value + side * self.error) - value).abs());
        // If the function is undefined at one end, the other end gives the bound.
        let error = spread.into_iter().filter(|s| !s.is_nan()).fold(0.0, f64::max);
        Bounded { value, error: error + 4.0 * ROUNDING * value.abs() }
    }
}

/// Indeterminates with their powers, in ascending order.
type Powers = Vec<(u32, u32)>;

/// A polynomial in indeterminates. Terms that may be zero are left out, except the constant term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Form {
    terms: BTreeMap<Powers, Bounded>,
}

impl Form {
    pub fn number(x: Bounded) -> Form {
        Form { terms: BTreeMap::from([(Powers::new(), x)]) }
    }

    fn indeterminate(number: u32) -> Form {
        Form { terms: BTreeMap::from([(vec![(number, 1)], Bounded::exactly(1.0))]) }
    }

    /// Its value, if it has no indeterminates.
    pub fn as_number(&self) -> Option<Bounded> {
        match self.terms.len() {
            0 => Some(Bounded::exactly(0.0)),
            1 => self.terms.get(&Powers::new()).copied(),
            _ => None,
        }
    }

    /// True if it is zero, within its bound, for all values of the indeterminates.
    pub fn vanishes(&self) -> bool {
        self.as_number().is_some_and(Bounded::may_be_zero)
    }

    pub fn is_finite(&self) -> bool {
        self.terms.values().all(|c| c.value.is_finite() && c.error.is_finite())
    }

    /// The coefficient of an indeterminate and the rest, if the polynomial is linear in it with a constant coefficient.
    pub fn solved_for(&self, number: u32) -> Option<(Bounded, Form)> {
        let mut rest = self.clone();
        let slope = rest.terms.remove(&vec![(number, 1)])?;
        let elsewhere = rest.terms.keys().flatten().any(|(n, _)| *n == number);
        (!elsewhere).then_some((slope, rest))
    }

    fn kept(mut terms: BTreeMap<Powers, Bounded>) -> Option<Form> {
        terms.retain(|powers, c| powers.is_empty() || !c.may_be_zero());
        let degree = |powers: &Powers| powers.iter().map(|(_, power)| power).sum::<u32>();
        (terms.len() <= MAX_TERMS && terms.keys().all(|p| degree(p) <= MAX_DEGREE)).then_some(Form { terms })
    }

    fn plus(&self, other: &Form) -> Option<Form> {
        let mut terms = self.terms.clone();
        for (powers, c) in &other.terms {
            let sum = terms.get(powers).map_or(*c, |known| known.plus(*c));
            terms.insert(powers.clone(), sum);
        }
        Form::kept(terms)
    }

    fn times(&self, other: &Form) -> Option<Form> {
        let mut terms: BTreeMap<Powers, Bounded> = BTreeMap::new();
        for (m, c) in &self.terms {
            for (n, d) in &other.terms {
                let mut powers: BTreeMap<u32, u32> = m.iter().copied().collect();
                for &(number, power) in n {
                    *powers.entry(number).or_default() += power;
                }
                let (powers, product) = (powers.into_iter().collect(), c.times(*d));
                let sum = terms.get(&powers).map_or(product, |known| known.plus(product));
                terms.insert(powers, sum);
            }
            if terms.len() > 4 * MAX_TERMS {
                return None;
            }
        }
        Form::kept(terms)
    }

    pub fn scaled(&self, by: Bounded) -> Option<Form> {
        Form::kept(self.terms.iter().map(|(powers, c)| (powers.clone(), c.times(by))).collect())
    }

    /// The quotient by a number; None if that may be zero.
    pub fn over(&self, by: Bounded) -> Option<Form> {
        let terms = self.terms.iter().map(|(powers, c)| Some((powers.clone(), c.over(by)?)));
        Form::kept(terms.collect::<Option<_>>()?)
    }
}

/// The indeterminates, by variable or expression.
#[derive(Clone, Debug, Default)]
pub struct Indeterminates {
    numbers: FxHashMap<String, u32>,
}

impl Indeterminates {
    fn of(&mut self, key: String) -> Form {
        let next = self.numbers.len() as u32;
        Form::indeterminate(*self.numbers.entry(key).or_insert(next))
    }

    /// The number of the indeterminate for a variable.
    pub fn variable(&mut self, variable: u32) -> u32 {
        let next = self.numbers.len() as u32;
        *self.numbers.entry(format!("v{variable}")).or_insert(next)
    }
}

/// The forms of expressions, given those of some variables; the other variables are indeterminates. None if a form is too
/// long.
pub fn forms(
    graph: &Graph,
    roots: &[NodeId],
    variables: &dyn Fn(u32) -> Option<Form>,
    all: &mut Indeterminates,
) -> Option<Vec<Form>> {
    let mut known: NodeMap<Form> = NodeMap::default();
    for id in graph.reachable(roots) {
        let form = match graph.node(id) {
            Node::Const(bits) => Form::number(Bounded::written(f64::from_bits(bits))),
            Node::Var(v) => match variables(v) {
                Some(form) => form,
                None => Form::indeterminate(all.variable(v)),
            },
            Node::Unary(op, a) => unary(op, &known[&a], all)?,
            Node::Binary(op, a, b) => binary(op, &known[&a], &known[&b], all)?,
            Node::Select(c, a, b) => {
                let (c, a, b) = (&known[&c], &known[&a], &known[&b]);
                match c.as_number() {
                    Some(c) if c.value != 0.0 => a.clone(),
                    Some(_) => b.clone(),
                    None if a == b || a.vanishes() && b.vanishes() => a.clone(),
                    None => all.of(format!("select{c:?}{a:?}{b:?}")),
                }
            }
            Node::Curve(curve, part, x) => match known[&x].as_number() {
                Some(x) => Form::number(x.through(|x| graph.curve_of(curve).eval(part, x))),
                None => all.of(format!("curve{curve:?}{part:?}{:?}", known[&x])),
            },
            Node::Piece(curve, part, index, x) => match (known[&index].as_number(), known[&x].as_number()) {
                (Some(index), Some(x)) => {
                    let piece: &Curve = graph.curve_of(curve);
                    Form::number(x.through(|x| piece.continued(part, index.value, x)))
                }
                _ => all.of(format!("piece{curve:?}{part:?}{:?}{:?}", known[&index], known[&x])),
            },
            Node::Element(array, index) => match known[&index].as_number() {
                Some(index) => Form::number(Bounded::written(graph.array_of(array).element(index.value))),
                None => all.of(format!("element{array:?}{:?}", known[&index])),
            },
            Node::Field(field, part, at) => {
                all.of(format!("field{field:?}{part:?}{:?}", at.map(|of| &known[&of])))
            }
        };
        known.insert(id, form);
    }
    Some(roots.iter().map(|root| known[root].clone()).collect())
}

fn unary(op: Unary, a: &Form, all: &mut Indeterminates) -> Option<Form> {
    match (op, a.as_number()) {
        (Unary::Neg, _) => a.scaled(Bounded::exactly(-1.0)),
        (_, Some(x)) => Some(Form::number(x.through(|x| f64::unary(op, x)))),
        _ => Some(all.of(format!("{op:?}{a:?}"))),
    }
}

fn binary(op: Binary, a: &Form, b: &Form, all: &mut Indeterminates) -> Option<Form> {
    let power = |x: Bounded| (0.0..=8.0).contains(&x.value) && x.value == x.value.trunc() && x.error == 0.0;
    match (op, a.as_number(), b.as_number()) {
        (Binary::Add, ..) => a.plus(b),
        (Binary::Sub, ..) => a.plus(&b.scaled(Bounded::exactly(-1.0))?),
        (Binary::Mul, ..) => a.times(b),
        (Binary::Div, _, Some(y)) if !y.may_be_zero() => a.over(y),
        (Binary::Pow, None, Some(n)) if power(n) => {
            let mut product = Form::number(Bounded::exactly(1.0));
            for _ in 0..n.value as u32 {
                product = product.times(a)?;
            }
            Some(product)
        }
        (_, Some(x), Some(y)) => {
            let by_first = x.through(|x| f64::binary(op, x, y.value));
            let by_second = y.through(|y| f64::binary(op, x.value, y));
            Some(Form::number(Bounded { error: by_first.error + by_second.error, ..by_first }))
        }
        // Zero divided by any expression is zero.
        (Binary::Div, ..) if a.vanishes() => Some(a.clone()),
        (Binary::Div, ..) => a.times(&all.of(format!("1/{b:?}"))),
        _ => Some(all.of(format!("{op:?}{a:?}{b:?}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_distinguished_from_small_numbers() {
        // (1 - x)^2 at 1 - 1e-8 is small; 1 - x/3 at 3 is zero, and so is 0.3 - 0.1 x.
        let mut g = Graph::default();
        let (x, one, three) = (g.var(0), g.constant(1.0), g.constant(3.0));
        let (gap, third) = (g.binary(Binary::Sub, one, x), g.binary(Binary::Div, x, three));
        let square = g.binary(Binary::Mul, gap, gap);
        let logistic = g.binary(Binary::Sub, one, third);
        let (a, b) = (g.constant(0.3), g.constant(0.1));
        let bx = g.binary(Binary::Mul, b, x);
        let decimal = g.binary(Binary::Sub, a, bx);
        let at = |value: f64, root| {
            let point = move |_| Some(Form::number(Bounded::written(value)));
            forms(&g, &[root], &point, &mut Indeterminates::default()).expect("short")[0].vanishes()
        };
        assert!(!at(1.0 - 1e-8, square) && at(1.0, square));
        assert!(at(3.0, logistic) && !at(3.0 * (1.0 - 2f64.powi(-40)), logistic));
        assert!(at(3.0, decimal) && !at(3.0 - 1e-14, decimal));
    }

    #[test]
    fn terms_that_cancel_for_all_arguments_vanish() {
        let mut g = Graph::default();
        let (x, t) = (g.var(0), g.var(1));
        let (a, b) = (g.unary(Unary::Sin, x), g.unary(Unary::Sin, t));
        let (same, other) = (g.binary(Binary::Sub, a, b), g.binary(Binary::Add, a, b));
        let mut all = Indeterminates::default();
        let time = all.variable(1);
        let equal = move |v| (v == 0).then(|| Form::indeterminate(time));
        let found = forms(&g, &[same, other], &equal, &mut all).expect("short");
        assert!(found[0].vanishes() && !found[1].vanishes());
    }
}
