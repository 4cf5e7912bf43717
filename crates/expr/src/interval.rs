//! Bounds of expressions over sets of arguments (interval arithmetic; Moore 1966).
//!
//! Bounds are not rounded outward: a few units in the last place may be missing. The user of a bound
//! (event location) compares it with a tolerance far wider than that.

use std::f64::consts::{FRAC_PI_2, PI};

use super::ops::in_period;
use super::{Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Part, Unary, Value};

/// The numbers from `lo` to `hi`, or nothing where the expression is undefined on the whole set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Least value; NaN if the interval is empty.
    pub lo: f64,
    /// Greatest value; NaN if the interval is empty.
    pub hi: f64,
    /// The expression is undefined, or jumps, somewhere on the set: no continuity may be assumed.
    pub partial: bool,
}

impl Interval {
    /// No value: the expression is undefined on the whole set.
    pub const EMPTY: Interval = Interval { lo: f64::NAN, hi: f64::NAN, partial: true };
    /// All numbers, without continuity.
    pub const ENTIRE: Interval = Interval { lo: f64::NEG_INFINITY, hi: f64::INFINITY, partial: true };

    /// The interval spanned by two numbers in any order.
    pub fn spanned(a: f64, b: f64) -> Interval {
        Interval { lo: a.min(b), hi: a.max(b), partial: false }
    }

    /// True if the expression is undefined on the whole set.
    pub fn is_empty(self) -> bool {
        self.lo.is_nan()
    }

    /// True if a number lies between the bounds, ends included; never of an empty interval.
    pub fn contains(self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Greatest absolute value.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    fn flagged(self, partial: bool) -> Interval {
        Interval { partial: self.partial || partial, ..self }
    }

    /// The smallest interval that contains both; it is partial if one of them is partial or empty.
    pub fn hull(self, other: Interval) -> Interval {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => other.flagged(true),
            (_, true) => self.flagged(true),
            _ => Interval {
                lo: self.lo.min(other.lo),
                hi: self.hi.max(other.hi),
                partial: self.partial || other.partial,
            },
        }
    }

    /// The part of the interval in `[lo, hi]`; what lies outside is where a function is undefined.
    fn clipped(self, lo: f64, hi: f64) -> Interval {
        if self.is_empty() || self.hi < lo || self.lo > hi {
            return Interval::EMPTY;
        }
        Interval {
            lo: self.lo.max(lo),
            hi: self.hi.min(hi),
            partial: self.partial || self.lo < lo || self.hi > hi,
        }
    }

    fn increasing(self, f: impl Fn(f64) -> f64) -> Interval {
        Interval { lo: f(self.lo), hi: f(self.hi), partial: self.partial }
    }

    /// Hull of `f` at the four corners; a NaN corner (0·∞, ∞-∞) widens to everything.
    fn corners(a: Interval, b: Interval, f: impl Fn(f64, f64) -> f64) -> Interval {
        let values = [f(a.lo, b.lo), f(a.lo, b.hi), f(a.hi, b.lo), f(a.hi, b.hi)];
        if values.iter().any(|v| v.is_nan()) {
            return Interval::ENTIRE;
        }
        let lo = values.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Interval { lo, hi, partial: a.partial || b.partial }
    }

    /// Cosine: extremes at the ends and at the multiples of π in between.
    fn cos(self) -> Interval {
        // An infinite interval has a width that is not a number.
        let width = self.hi - self.lo;
        if width.is_nan() || width >= 2.0 * PI || self.magnitude() > 1e9 {
            return Interval { lo: -1.0, hi: 1.0, partial: self.partial };
        }
        let (a, b) = (self.lo.cos(), self.hi.cos());
        let (mut lo, mut hi) = (a.min(b), a.max(b));
        let first = (self.lo / PI).ceil();
        let last = (self.hi / PI).floor();
        let mut k = first;
        while k <= last {
            if k.rem_euclid(2.0) == 0.0 {
                hi = 1.0
            } else {
                lo = -1.0
            }
            k += 1.0;
        }
        Interval { lo, hi, partial: self.partial }
    }

    fn pow(self, exponent: Interval) -> Interval {
        let n = exponent.lo;
        // Whole numbers without a parity of their own do not exist: from 2^53 on all of them are even.
        if exponent.lo == exponent.hi && n == n.trunc() && n.is_finite() {
            if n < 0.0 {
                return Interval::binary(
                    Binary::Div,
                    Interval::constant(1.0),
                    self.pow(Interval::constant(-n)),
                );
            }
            if n.rem_euclid(2.0) == 1.0 {
                return self.increasing(|x| x.powf(n));
            }
            let magnitude = Interval::unary(Unary::Abs, self);
            return magnitude.increasing(|x| x.powf(n));
        }
        let base = self.clipped(0.0, f64::INFINITY);
        if base.is_empty() || exponent.is_empty() {
            return Interval::EMPTY;
        }
        Interval::corners(base, exponent, f64::powf)
    }

    fn truth(yes: bool, no: bool, partial: bool) -> Interval {
        match (yes && !partial, no && !partial) {
            (true, _) => Interval::constant(1.0),
            (_, true) => Interval::constant(0.0),
            _ => Interval { lo: 0.0, hi: 1.0, partial: true },
        }
    }
}

impl Value for Interval {
    fn constant(x: f64) -> Interval {
        Interval { lo: x, hi: x, partial: false }
    }

    fn unary(op: Unary, a: Interval) -> Interval {
        if a.is_empty() {
            return Interval::EMPTY;
        }
        match op {
            Unary::Neg => Interval { lo: -a.hi, hi: -a.lo, ..a },
            Unary::Not => Interval { lo: 1.0 - a.hi, hi: 1.0 - a.lo, ..a },
            Unary::Square => Interval::unary(Unary::Abs, a).increasing(|x| x * x),
            Unary::Sqrt => a.clipped(0.0, f64::INFINITY).increasing(f64::sqrt),
            Unary::Exp => a.increasing(f64::exp),
            Unary::Ln => a.clipped(0.0, f64::INFINITY).increasing(f64::ln),
            Unary::Log10 => a.clipped(0.0, f64::INFINITY).increasing(f64::log10),
            Unary::Expm1 => a.increasing(f64::exp_m1),
            Unary::Ln1p => a.clipped(-1.0, f64::INFINITY).increasing(f64::ln_1p),
            Unary::Abs => {
                if a.contains(0.0) {
                    Interval { lo: 0.0, hi: a.magnitude(), ..a }
                } else {
                    Interval::spanned(a.lo.abs(), a.hi.abs()).flagged(a.partial)
                }
            }
            Unary::Sign | Unary::Floor | Unary::Ceil => {
                let image = a.increasing(|x| f64::unary(op, x));
                image.flagged(image.lo != image.hi)
            }
            Unary::Cos => a.cos(),
            // A sine of 0 is 0, not the rounding of a phase.
            Unary::Sin if a.magnitude() <= FRAC_PI_2 => a.increasing(f64::sin),
            Unary::Sin => Interval { lo: a.lo - FRAC_PI_2, hi: a.hi - FRAC_PI_2, ..a }.cos(),
            // Within one period the product with π keeps the digits.
            Unary::SinPi | Unary::CosPi => {
                let shift = if a.lo.is_finite() { a.lo - in_period(a.lo) } else { 0.0 };
                let phase = Interval { lo: PI * (a.lo - shift), hi: PI * (a.hi - shift), ..a };
                Interval::unary(if op == Unary::SinPi { Unary::Sin } else { Unary::Cos }, phase)
            }
            Unary::Tan => {
                let branch = |x: f64| ((x + FRAC_PI_2) / PI).floor();
                if branch(a.lo) == branch(a.hi) { a.increasing(f64::tan) } else { Interval::ENTIRE }
            }
            Unary::Asin => a.clipped(-1.0, 1.0).increasing(f64::asin),
            Unary::Acos => {
                let image = a.clipped(-1.0, 1.0).increasing(f64::acos);
                Interval { lo: image.hi, hi: image.lo, ..image }
            }
            Unary::Atan => a.increasing(f64::atan),
            Unary::Sinh => a.increasing(f64::sinh),
            Unary::Cosh => Interval::unary(Unary::Abs, a).increasing(f64::cosh),
            Unary::Tanh => a.increasing(f64::tanh),
        }
    }

    fn binary(op: Binary, a: Interval, b: Interval) -> Interval {
        if a.is_empty() || b.is_empty() {
            // NaN compares false, whatever it is compared with; only `!=` is true.
            return match op {
                Binary::Lt | Binary::Le | Binary::Eq => Interval::constant(0.0).flagged(true),
                Binary::Ne => Interval::constant(1.0).flagged(true),
                _ => Interval::EMPTY,
            };
        }
        let partial = a.partial || b.partial;
        match op {
            Binary::Add => Interval { lo: a.lo + b.lo, hi: a.hi + b.hi, partial },
            Binary::Sub => Interval { lo: a.lo - b.hi, hi: a.hi - b.lo, partial },
            Binary::Mul => Interval::corners(a, b, |x, y| if x == 0.0 || y == 0.0 { 0.0 } else { x * y }),
            Binary::Div if b.contains(0.0) => Interval::ENTIRE,
            Binary::Div => Interval::corners(a, b, |x, y| x / y),
            Binary::Pow => a.pow(b),
            Binary::Min => Interval { lo: a.lo.min(b.lo), hi: a.hi.min(b.hi), partial },
            Binary::Max => Interval { lo: a.lo.max(b.lo), hi: a.hi.max(b.hi), partial },
            Binary::Atan2 => {
                if b.lo > 0.0 || a.lo > 0.0 || a.hi < 0.0 {
                    // Away from the cut along the negative axis the angle is monotone along each
                    // side of the rectangle, so its extremes are at corners.
                    Interval::corners(a, b, f64::atan2)
                } else {
                    Interval { lo: -PI, hi: PI, partial: true }
                }
            }
            Binary::Lt => Interval::truth(a.hi < b.lo, a.lo >= b.hi, partial),
            Binary::Le => Interval::truth(a.hi <= b.lo, a.lo > b.hi, partial),
            Binary::Eq => Interval::truth(a.lo == a.hi && a == b, a.hi < b.lo || a.lo > b.hi, partial),
            Binary::Ne => Interval::unary(Unary::Not, Interval::binary(Binary::Eq, a, b)),
            Binary::And => Interval { lo: a.lo * b.lo, hi: a.hi * b.hi, partial },
            Binary::Or => Interval { lo: a.lo.max(b.lo), hi: a.hi.max(b.hi), partial },
        }
    }

    fn select(condition: Interval, a: Interval, b: Interval) -> Interval {
        if condition.lo == 1.0 {
            a
        } else if condition.hi == 0.0 {
            b
        } else {
            a.hull(b).flagged(true)
        }
    }

    fn curve(curve: &Curve, part: Part, x: Interval) -> Interval {
        curve.over(part, x)
    }

    fn piece(curve: &Curve, part: Part, index: Interval, x: Interval) -> Interval {
        curve.continued_over(part, index, x)
    }

    fn element(array: &Array, index: Interval) -> Interval {
        array.over(index)
    }

    fn field(field: &FieldSlot, part: FieldPart, at: [Interval; FIELD_ARGUMENTS]) -> Interval {
        field.over(part, at)
    }
}
