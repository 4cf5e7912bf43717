//! How far expressions are from polynomials, over a box of their variables.
//!
//! Each function is replaced by its Taylor polynomial of degree [`DEGREE`] about the middle of its argument. What this leaves out is
//! bounded by the remainder, and carried on by the Lipschitz constants of what is done with it. So an expression whose
//! arguments move little is a polynomial of its variables but for a `misfit`, however it behaves elsewhere.
//!
//! As with [`Interval`](super::Interval), rounding is not counted.

use super::{Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Part, Unary, Value};

/// The degree of the polynomials that stand for functions.
const DEGREE: i32 = 8;
/// (DEGREE + 1)!
const FACTORIAL: f64 = 362_880.0;
/// The largest whole exponent that is multiplied out.
const MOST_FACTORS: f64 = 16.0;

/// The values of an expression over a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smooth {
    /// A value in the middle of the others.
    pub middle: f64,
    /// All values are this near the middle.
    pub reach: f64,
    /// The largest distance from some polynomial of the variables; infinite or not a number where no bound is known.
    pub misfit: f64,
}

impl Smooth {
    /// Nothing is known.
    pub const UNKNOWN: Smooth = Smooth { middle: f64::NAN, reach: f64::INFINITY, misfit: f64::INFINITY };

    /// A variable between two numbers.
    pub fn spanned(lo: f64, hi: f64) -> Smooth {
        Smooth { middle: 0.5 * (lo + hi), reach: 0.5 * (hi - lo).abs(), misfit: 0.0 }
    }

    /// The number, if it is only one.
    fn exact(self) -> Option<f64> {
        (self.reach == 0.0 && self.misfit == 0.0).then_some(self.middle)
    }

    /// The distance from the middle within which values and polynomial lie.
    fn radius(self) -> f64 {
        self.reach + self.misfit
    }

    /// A value near `middle`. The middle alone is a polynomial, too.
    fn new(middle: f64, reach: f64, misfit: f64) -> Smooth {
        Smooth { middle, reach, misfit: if reach < misfit { reach } else { misfit } }
    }

    /// A function of the argument: its value at the middle, a bound of its change, of its slope, and the remainder of its Taylor polynomial.
    fn function(self, middle: f64, reach: f64, slope: f64, remainder: f64) -> Smooth {
        Smooth::new(middle, reach, slope * self.misfit + remainder)
    }

    fn scaled(self, by: f64) -> Smooth {
        let Smooth { middle, reach, misfit } = self;
        Smooth { middle: by * middle, reach: by.abs() * reach, misfit: by.abs() * misfit }
    }

    fn plus(self, other: Smooth) -> Smooth {
        Smooth::new(self.middle + other.middle, self.reach + other.reach, self.misfit + other.misfit)
    }

    fn times(self, other: Smooth) -> Smooth {
        let (a, b) = (self.middle.abs(), other.middle.abs());
        let reach = a * other.reach + b * self.reach + self.reach * other.reach;
        let misfit = (a + self.radius()) * other.misfit + (b + other.radius()) * self.misfit;
        Smooth::new(self.middle * other.middle, reach, misfit)
    }

    /// The radius as a part of the distance from a pole or a branch point at zero; None if it may be reached.
    fn part(self) -> Option<f64> {
        let part = self.radius() / self.middle.abs();
        (part < 1.0).then_some(part)
    }

    fn reciprocal(self) -> Smooth {
        let Some(part) = self.part() else { return Smooth::UNKNOWN };
        let (value, rest) = (1.0 / self.middle, 1.0 - part);
        let (size, slope) = (value.abs(), (value / rest).powi(2));
        self.function(value, size * part / rest, slope, size * part.powi(DEGREE + 1) / rest)
    }

    fn exp(self) -> Smooth {
        let (value, radius) = (self.middle.exp(), self.radius());
        let most = (self.middle + radius).exp();
        self.function(value, most - value, most, most * radius.powi(DEGREE + 1) / FACTORIAL)
    }

    fn ln(self) -> Smooth {
        let Some(part) = self.part().filter(|_| self.middle > 0.0) else { return Smooth::UNKNOWN };
        let rest = 1.0 - part;
        let slope = 1.0 / (self.middle * rest);
        self.function(self.middle.ln(), part / rest, slope, part.powi(DEGREE + 1) / rest)
    }

    fn sqrt(self) -> Smooth {
        let Some(part) = self.part().filter(|_| self.middle > 0.0) else { return Smooth::UNKNOWN };
        let (value, rest) = (self.middle.sqrt(), 1.0 - part);
        let slope = 0.5 / (value * rest.sqrt());
        self.function(value, value * part, slope, value * part.powi(DEGREE + 1) / rest)
    }

    /// Sine or cosine, whose value at the middle is given: all derivatives are 1 at most.
    fn wave(self, middle: f64) -> Smooth {
        let radius = self.radius();
        self.function(middle, radius, 1.0, radius.powi(DEGREE + 1) / FACTORIAL)
    }

    fn pow(self, exponent: Smooth) -> Smooth {
        match exponent.exact() {
            Some(n) if n == n.trunc() && (0.0..=MOST_FACTORS).contains(&n) => {
                (0..n as usize).fold(Smooth::constant(1.0), |power, _| power.times(self))
            }
            _ => exponent.times(self.ln()).exp(),
        }
    }

    /// Whether all values are less than all of another one, if that is known.
    fn is_less(self, other: Smooth) -> Option<bool> {
        let (gap, apart) = (other.middle - self.middle, self.radius() + other.radius());
        (gap.abs() > apart).then_some(gap > 0.0)
    }
}

impl Value for Smooth {
    fn constant(x: f64) -> Smooth {
        Smooth { middle: x, reach: 0.0, misfit: 0.0 }
    }

    fn unary(op: Unary, a: Smooth) -> Smooth {
        if let Some(x) = a.exact() {
            return Smooth::constant(f64::unary(op, x));
        }
        let one = Smooth::constant(1.0);
        match op {
            Unary::Neg => a.scaled(-1.0),
            Unary::Square => a.times(a),
            Unary::Sqrt => a.sqrt(),
            Unary::Exp => a.exp(),
            Unary::Expm1 => a.exp().plus(one.scaled(-1.0)),
            Unary::Ln => a.ln(),
            Unary::Ln1p => a.plus(one).ln(),
            Unary::Log10 => a.ln().scaled(std::f64::consts::LOG10_E),
            Unary::Sin => a.wave(a.middle.sin()),
            Unary::Cos => a.wave(a.middle.cos()),
            Unary::SinPi => Smooth::unary(Unary::Sin, a.scaled(std::f64::consts::PI)),
            Unary::CosPi => Smooth::unary(Unary::Cos, a.scaled(std::f64::consts::PI)),
            Unary::Tan => a.wave(a.middle.sin()).times(a.wave(a.middle.cos()).reciprocal()),
            Unary::Sinh => a.exp().plus(a.scaled(-1.0).exp().scaled(-1.0)).scaled(0.5),
            Unary::Cosh => a.exp().plus(a.scaled(-1.0).exp()).scaled(0.5),
            Unary::Tanh => {
                let side = 1.0f64.copysign(a.middle);
                let rest = a.scaled(-2.0 * side).exp();
                one.plus(rest.times(rest.plus(one).reciprocal()).scaled(-2.0)).scaled(side)
            }
            Unary::Abs => match a.is_less(Smooth::constant(0.0)) {
                Some(is_negative) => a.scaled(if is_negative { -1.0 } else { 1.0 }),
                None => Smooth::UNKNOWN,
            },
            Unary::Not
            | Unary::Sign
            | Unary::Floor
            | Unary::Ceil
            | Unary::Asin
            | Unary::Acos
            | Unary::Atan => Smooth::UNKNOWN,
        }
    }

    fn binary(op: Binary, a: Smooth, b: Smooth) -> Smooth {
        if let (Some(x), Some(y)) = (a.exact(), b.exact()) {
            return Smooth::constant(f64::binary(op, x, y));
        }
        let decided =
            |yes: Option<bool>| yes.map_or(Smooth::UNKNOWN, |yes| Smooth::constant(f64::from(u8::from(yes))));
        match op {
            Binary::Add => a.plus(b),
            Binary::Sub => a.plus(b.scaled(-1.0)),
            Binary::Mul => a.times(b),
            Binary::Div => a.times(b.reciprocal()),
            Binary::Pow => a.pow(b),
            Binary::Min => a.is_less(b).map_or(Smooth::UNKNOWN, |less| if less { a } else { b }),
            Binary::Max => a.is_less(b).map_or(Smooth::UNKNOWN, |less| if less { b } else { a }),
            Binary::Lt | Binary::Le => decided(a.is_less(b)),
            Binary::Atan2 | Binary::Eq | Binary::Ne | Binary::And | Binary::Or => Smooth::UNKNOWN,
        }
    }

    fn select(condition: Smooth, a: Smooth, b: Smooth) -> Smooth {
        condition.exact().map_or(Smooth::UNKNOWN, |truth| if truth != 0.0 { a } else { b })
    }

    fn curve(curve: &Curve, part: Part, x: Smooth) -> Smooth {
        x.exact().map_or(Smooth::UNKNOWN, |x| Smooth::constant(f64::curve(curve, part, x)))
    }

    fn piece(curve: &Curve, part: Part, index: Smooth, x: Smooth) -> Smooth {
        let both = index.exact().zip(x.exact());
        both.map_or(Smooth::UNKNOWN, |(index, x)| Smooth::constant(f64::piece(curve, part, index, x)))
    }

    fn element(array: &Array, index: Smooth) -> Smooth {
        index.exact().map_or(Smooth::UNKNOWN, |index| Smooth::constant(f64::element(array, index)))
    }

    fn field(_field: &FieldSlot, _part: FieldPart, _at: [Smooth; FIELD_ARGUMENTS]) -> Smooth {
        Smooth::UNKNOWN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, NodeId, Program};

    /// An expression of one variable from a graph.
    fn program(build: impl Fn(&mut Graph, NodeId) -> NodeId) -> Program {
        let mut graph = Graph::default();
        let x = graph.var(0);
        let root = build(&mut graph, x);
        Program::compile(&graph, &[root], 1)
    }

    fn over(program: &Program, lo: f64, hi: f64) -> Smooth {
        let mut out = [Smooth::UNKNOWN];
        program.eval(&[Smooth::spanned(lo, hi)], &mut Vec::new(), &mut out);
        out[0]
    }

    /// The polynomial through the values at the `n` points of Chebyshev between two numbers, in Lagrange's form.
    fn interpolated(program: &Program, (lo, hi): (f64, f64), n: usize, at: f64) -> f64 {
        let place = |i: usize| {
            let angle = std::f64::consts::PI * (i as f64 + 0.5) / n as f64;
            0.5 * (lo + hi) - 0.5 * (hi - lo) * angle.cos()
        };
        let weight = |i: usize| -> f64 {
            let others = (0..n).filter(|j| *j != i);
            others.map(|j| (at - place(j)) / (place(i) - place(j))).product()
        };
        (0..n).map(|i| weight(i) * program.eval_one(&[place(i)])).sum()
    }

    /// Bounds hold, and misfits are not much larger than they need be: no polynomial of degree 8 is nearer than a fourth of the distance of
    /// the one through nine points of Chebyshev (their Lebesgue constant is below 3).
    #[test]
    fn functions_are_as_near_polynomials_as_is_said() {
        let functions = [Unary::Sin, Unary::Cos, Unary::Exp, Unary::Ln, Unary::Sqrt, Unary::Tan, Unary::Tanh];
        for op in functions.into_iter().chain([Unary::Sinh, Unary::Cosh, Unary::Log10, Unary::Ln1p]) {
            let program = program(|graph, x| graph.unary(op, x));
            for half in [0.05, 0.2, 0.4] {
                let (lo, hi) = (1.1 - half, 1.1 + half);
                let all = over(&program, lo, hi);
                let mut farthest: f64 = 0.0;
                for i in 0..=200 {
                    let x = lo + (hi - lo) * f64::from(i) / 200.0;
                    let value = program.eval_one(&[x]);
                    assert!(
                        (value - all.middle).abs() <= all.reach * (1.0 + 1e-12),
                        "{op:?} at {x}: {all:?}"
                    );
                    farthest = farthest.max((value - interpolated(&program, (lo, hi), 9, x)).abs());
                }
                assert!(farthest <= 4.0 * all.misfit + 1e-14, "{op:?} ± {half}: {farthest:e}, {all:?}");
            }
            assert!(over(&program, 1.05, 1.15).misfit < 1e-7, "{op:?}: {:?}", over(&program, 1.05, 1.15));
        }
    }

    /// Polynomials have no misfit, poles and corners inside have no bound, and what is nearly constant is near a constant.
    #[test]
    fn misfits_are_those_of_what_is_no_polynomial() {
        let cube = program(|graph, x| {
            let three = graph.constant(3.0);
            graph.binary(Binary::Pow, x, three)
        });
        assert_eq!(over(&cube, -2.0, 5.0).misfit, 0.0);
        let pole = program(|graph, x| {
            let one = graph.constant(1.0);
            graph.binary(Binary::Div, one, x)
        });
        assert!(over(&pole, -0.1, 1.0).misfit == f64::INFINITY || over(&pole, -0.1, 1.0).misfit.is_nan());
        assert!(over(&pole, 10.0, 10.5).misfit < 1e-13);
        let corner = program(|graph, x| graph.unary(Unary::Abs, x));
        assert_eq!(over(&corner, 0.1, 2.0).misfit, 0.0);
        assert!(over(&corner, -0.1, 2.0).misfit.is_infinite());
        // A pulse of width 0.01 at 1: nothing from afar, anything where it is.
        let pulse = program(|graph, x| {
            let (one, width) = (graph.constant(1.0), graph.constant(0.01));
            let from = graph.binary(Binary::Sub, x, one);
            let scaled = graph.binary(Binary::Div, from, width);
            let square = graph.binary(Binary::Mul, scaled, scaled);
            let minus = graph.unary(Unary::Neg, square);
            graph.unary(Unary::Exp, minus)
        });
        assert!(over(&pulse, 0.2, 0.3).misfit < 1e-300);
        assert!(over(&pulse, 0.9, 1.1).misfit > 1.0);
    }
}
