//! Values with their derivative along a trajectory (forward differentiation).

use super::{Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Interval, Part, Unary, Value};
use std::f64::consts::PI;

/// A value and its rate of change.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The value.
    pub value: T,
    /// Its derivative along the trajectory: per unit of time, or per unit of position in a step.
    pub rate: T,
}

/// The operations that forward differentiation needs beyond those of [`Value`].
pub trait Differentiable: Value {
    /// True if the value is exactly zero.
    fn is_zero(self) -> bool;
    /// Rate of change of a function that is constant except for jumps (`floor`, `sign`, comparisons),
    /// given its value over the set: zero, or unbounded where there may be a jump.
    fn rate_of_steps(image: Self) -> Self;
    /// Rate of a choice between two branches.
    fn select_rate(condition: Self, a: Self, b: Self) -> Self;
    /// A rate of which nothing is known.
    fn unknown_rate() -> Self;
}

impl Differentiable for f64 {
    fn is_zero(self) -> bool {
        self == 0.0
    }
    fn rate_of_steps(_: f64) -> f64 {
        0.0
    }
    fn select_rate(condition: f64, a: f64, b: f64) -> f64 {
        f64::select(condition, a, b)
    }
    fn unknown_rate() -> f64 {
        f64::NAN
    }
}

impl Differentiable for Interval {
    fn is_zero(self) -> bool {
        self.lo == 0.0 && self.hi == 0.0
    }
    fn rate_of_steps(image: Interval) -> Interval {
        if image.partial { Interval::ENTIRE } else { Interval::constant(0.0) }
    }
    fn select_rate(condition: Interval, a: Interval, b: Interval) -> Interval {
        if condition.lo == condition.hi { Interval::select(condition, a, b) } else { Interval::ENTIRE }
    }
    fn unknown_rate() -> Interval {
        Interval::ENTIRE
    }
}

impl<T: Differentiable> Value for Dual<T> {
    fn constant(x: f64) -> Dual<T> {
        Dual { value: T::constant(x), rate: T::constant(0.0) }
    }

    fn unary(op: Unary, a: Dual<T>) -> Dual<T> {
        let value = T::unary(op, a.value);
        if a.rate.is_zero() {
            return Dual { value, rate: T::constant(0.0) };
        }
        let one = T::constant(1.0);
        let x = a.value;
        let square = |y| T::binary(Binary::Mul, y, y);
        let over = |n, d| T::binary(Binary::Div, n, d);
        let slope = match op {
            Unary::Neg | Unary::Not => T::constant(-1.0),
            Unary::Square => T::binary(Binary::Mul, T::constant(2.0), x),
            Unary::Sqrt => over(T::constant(0.5), value),
            Unary::Exp => value,
            Unary::Ln => over(one, x),
            Unary::Expm1 => T::binary(Binary::Add, value, one),
            Unary::Ln1p => over(one, T::binary(Binary::Add, one, x)),
            Unary::Log10 => over(T::constant(std::f64::consts::LOG10_E), x),
            Unary::Abs => T::unary(Unary::Sign, x),
            Unary::Sign | Unary::Floor | Unary::Ceil => {
                return Dual { value, rate: T::rate_of_steps(value) };
            }
            Unary::Sin => T::unary(Unary::Cos, x),
            Unary::Cos => T::unary(Unary::Neg, T::unary(Unary::Sin, x)),
            Unary::SinPi => T::binary(Binary::Mul, T::constant(PI), T::unary(Unary::CosPi, x)),
            Unary::CosPi => T::binary(Binary::Mul, T::constant(-PI), T::unary(Unary::SinPi, x)),
            Unary::Tan => T::binary(Binary::Add, one, square(value)),
            Unary::Asin | Unary::Acos => {
                let root = T::unary(Unary::Sqrt, T::binary(Binary::Sub, one, square(x)));
                over(T::constant(if op == Unary::Asin { 1.0 } else { -1.0 }), root)
            }
            Unary::Atan => over(one, T::binary(Binary::Add, one, square(x))),
            Unary::Sinh => T::unary(Unary::Cosh, x),
            Unary::Cosh => T::unary(Unary::Sinh, x),
            Unary::Tanh => T::binary(Binary::Sub, one, square(value)),
        };
        Dual { value, rate: T::binary(Binary::Mul, slope, a.rate) }
    }

    fn binary(op: Binary, a: Dual<T>, b: Dual<T>) -> Dual<T> {
        let value = T::binary(op, a.value, b.value);
        if a.rate.is_zero() && b.rate.is_zero() {
            return Dual { value, rate: T::constant(0.0) };
        }
        let mul = |x, y| T::binary(Binary::Mul, x, y);
        let rate = match op {
            Binary::Add => T::binary(Binary::Add, a.rate, b.rate),
            Binary::Sub => T::binary(Binary::Sub, a.rate, b.rate),
            Binary::Mul => T::binary(Binary::Add, mul(a.rate, b.value), mul(a.value, b.rate)),
            Binary::Div => {
                let top = T::binary(Binary::Sub, a.rate, mul(value, b.rate));
                T::binary(Binary::Div, top, b.value)
            }
            Binary::Pow => {
                let lower = T::binary(Binary::Sub, b.value, T::constant(1.0));
                let by_base = mul(mul(b.value, T::binary(Binary::Pow, a.value, lower)), a.rate);
                if b.rate.is_zero() {
                    by_base
                } else {
                    let by_exponent = mul(mul(value, T::unary(Unary::Ln, a.value)), b.rate);
                    if a.rate.is_zero() { by_exponent } else { T::binary(Binary::Add, by_base, by_exponent) }
                }
            }
            Binary::Min | Binary::Max => {
                let (low, high) = if op == Binary::Min { (a, b) } else { (b, a) };
                let first = T::binary(Binary::Lt, low.value, high.value);
                return Dual { value, rate: T::select_rate(first, a.rate, b.rate) };
            }
            Binary::Atan2 => {
                let top = T::binary(Binary::Sub, mul(b.value, a.rate), mul(a.value, b.rate));
                let norm = T::binary(Binary::Add, mul(a.value, a.value), mul(b.value, b.value));
                T::binary(Binary::Div, top, norm)
            }
            Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne | Binary::And | Binary::Or => {
                T::rate_of_steps(value)
            }
        };
        Dual { value, rate }
    }

    fn select(condition: Dual<T>, a: Dual<T>, b: Dual<T>) -> Dual<T> {
        Dual {
            value: T::select(condition.value, a.value, b.value),
            rate: T::select_rate(condition.value, a.rate, b.rate),
        }
    }

    fn curve(curve: &Curve, part: Part, x: Dual<T>) -> Dual<T> {
        let value = T::curve(curve, part, x.value);
        let zero = T::constant(0.0);
        if x.rate.is_zero() {
            return Dual { value, rate: zero };
        }
        let slope = match part.derivative() {
            Some(slope) => T::curve(curve, slope, x.value),
            None if part == Part::Inverse => {
                let slope = T::curve(curve, Part::Slope, value);
                T::binary(Binary::Div, T::constant(1.0), slope)
            }
            None => return Dual { value, rate: T::rate_of_steps(value) },
        };
        Dual { value, rate: T::binary(Binary::Mul, slope, x.rate) }
    }

    fn piece(curve: &Curve, part: Part, index: Dual<T>, x: Dual<T>) -> Dual<T> {
        let value = T::piece(curve, part, index.value, x.value);
        let rate = match part.derivative() {
            Some(_) if x.rate.is_zero() => T::constant(0.0),
            Some(slope) => T::binary(Binary::Mul, T::piece(curve, slope, index.value, x.value), x.rate),
            None => T::constant(0.0),
        };
        Dual { value, rate }
    }

    fn element(array: &Array, index: Dual<T>) -> Dual<T> {
        let value = T::element(array, index.value);
        let still = index.rate.is_zero();
        Dual { value, rate: if still { T::constant(0.0) } else { T::rate_of_steps(value) } }
    }

    fn field(field: &FieldSlot, part: FieldPart, at: [Dual<T>; FIELD_ARGUMENTS]) -> Dual<T> {
        let places = at.map(|of| of.value);
        let value = T::field(field, part, places);
        let mut rate = T::constant(0.0);
        for (i, of) in at.iter().enumerate().filter(|(_, of)| !of.rate.is_zero()) {
            let slope =
                part.derivative(i).map_or_else(T::unknown_rate, |slope| T::field(field, slope, places));
            let share = T::binary(Binary::Mul, slope, of.rate);
            rate = if rate.is_zero() { share } else { T::binary(Binary::Add, rate, share) };
        }
        Dual { value, rate }
    }
}
