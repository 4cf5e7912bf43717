//! Solutions of `x' = x (a + b ln x)` (Gompertz) and `x' = a x + b x^p` (Bernoulli; with p = 2/3 von Bertalanffy, with
//! p = 1 + shape Richards), with constant coefficients.
//!
//! A substitution makes both linear. With `y = ln(x / x(0))`, or `y = (x / x(0))^(1-p) - 1`, it is `y' = f + d y` from
//! `y = 0`, so that growth from 1e-300 and small displacements keep their digits.

use dlsys_expr::{Dual, Interval};

/// A growth law of one parameter, from one start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The value at the start, greater than 0.
    x: f64,
    /// Rate of y at the start.
    f: f64,
    d: f64,
    /// 1 - p; None for Gompertz's law.
    bend: Option<f64>,
}

/// The greatest logarithm of a number.
const LARGEST: f64 = 709.782_712_893_384;

impl Growth {
    /// The solution of `x' = x (a + b ln x)` from `x`; None where the closed form does not hold, as for `x` ≤ 0.
    pub fn gompertz(x: f64, a: f64, b: f64) -> Option<Growth> {
        Growth { x, f: a + b * x.ln(), d: b, bend: None }.checked()
    }

    /// The solution of `x' = a x + b x^p` from `x`; None where the closed form does not hold, as for `x` ≤ 0 or p = 1.
    pub fn bernoulli(x: f64, a: f64, b: f64, p: f64) -> Option<Growth> {
        let bend = 1.0 - p;
        Growth { x, f: bend * (a + b * x.powf(p - 1.0)), d: bend * a, bend: Some(bend) }.checked()
    }

    fn checked(self) -> Option<Growth> {
        let good = self.x > 0.0 && self.f.is_finite() && self.d.is_finite() && self.bend != Some(0.0);
        good.then_some(self)
    }

    fn y(&self, s: f64) -> f64 {
        if self.d == 0.0 { self.f * s } else { self.f * ((self.d * s).exp_m1() / self.d) }
    }

    /// ln(x / x(0)) as a function of y.
    fn logarithm(&self, y: f64) -> f64 {
        self.bend.map_or(y, |bend| y.ln_1p() / bend)
    }

    /// The displacement at a time since the start, which may be negative. NaN or infinite beyond the end of the
    /// solution.
    pub fn value(&self, s: f64) -> f64 {
        if self.f == 0.0 || s == 0.0 {
            return 0.0;
        }
        let y = self.y(s);
        if self.bend.is_some() && y < -1.0 {
            return f64::NAN;
        }
        self.x * self.logarithm(y).exp_m1()
    }

    /// The rate where the displacement is `u`.
    pub fn rate(&self, u: f64) -> f64 {
        let y = self.y_of(u);
        let size = self.x + u;
        match self.bend {
            None => size * (self.f + self.d * y),
            // d ln x = dy / (bend (1 + y))
            Some(bend) => size * (self.f + self.d * y) / (bend * (1.0 + y)),
        }
    }

    fn y_of(&self, u: f64) -> f64 {
        let logarithm = (u / self.x).ln_1p();
        self.bend.map_or(logarithm, |bend| (bend * logarithm).exp_m1())
    }

    /// The time at which y has a value; None if it never has.
    fn time_of(&self, y: f64) -> Option<f64> {
        let s = if self.d == 0.0 { y / self.f } else { (self.d * (y / self.f)).ln_1p() / self.d };
        s.is_finite().then_some(s)
    }

    /// The time, before or after 0, at which the displacement is `u`.
    pub fn reach(&self, u: f64) -> Option<f64> {
        if self.f == 0.0 || u <= -self.x && self.bend.is_none_or(|bend| bend <= 0.0) {
            return None;
        }
        self.time_of(self.y_of(u))
    }

    /// The times, before and after 0, at which the solution ends.
    pub fn ends(&self) -> (Option<f64>, Option<f64>) {
        if self.f == 0.0 {
            return (None, None);
        }
        let largest = LARGEST - self.x.ln().max(0.0);
        let above = self.bend.map_or(largest, |bend| (bend * largest).exp_m1());
        let ends =
            [Some(above), self.bend.map(|_| -1.0)].into_iter().flatten().filter_map(|y| self.time_of(y));
        let (mut before, mut after): (Option<f64>, Option<f64>) = (None, None);
        for s in ends {
            if s > 0.0 {
                after = Some(after.map_or(s, |known| known.min(s)));
            } else {
                before = Some(before.map_or(s, |known| known.max(s)));
            }
        }
        (before, after)
    }

    /// Bounds of displacement and rate from one time since the start to another. The solution is monotonic.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let (a, b) = (self.value(from), self.value(to));
        if !a.is_finite() || !b.is_finite() {
            return Dual { value: Interval::ENTIRE, rate: Interval::ENTIRE };
        }
        let mut rate = Interval::spanned(self.rate(a), self.rate(b));
        // The rate has one extreme, where d(ln x')/ds = 0: (f + d y) + d = 0 for Gompertz; for Bernoulli where
        // (1 + y) d = (f + d y)(1 - 1/bend).
        let extreme = match self.bend {
            None => -(self.f + self.d) / self.d,
            Some(bend) => {
                let part = 1.0 - 1.0 / bend;
                (self.f * part - self.d) / (self.d * (1.0 - part))
            }
        };
        let u = self.x * self.logarithm(extreme).exp_m1();
        if a.min(b) < u && u < a.max(b) {
            let there = self.rate(u);
            rate = Interval { lo: rate.lo.min(there), hi: rate.hi.max(there), ..rate };
        }
        Dual { value: Interval::spanned(a, b), rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(a: f64, b: f64, part: f64) -> bool {
        (a - b).abs() <= part * a.abs().max(b.abs()).max(1e-300)
    }

    #[test]
    fn known_solutions() {
        // Gompertz: x' = 2 x ln(3/x) from 1: 3 (1/3)^exp(-2 s).
        let law = Growth::gompertz(1.0, 2.0 * 3f64.ln(), -2.0).expect("a solution");
        let s: f64 = 0.7;
        assert!(close(1.0 + law.value(s), 3.0 * (1f64 / 3.0).powf((-2.0 * s).exp()), 1e-15));
        assert!(close(law.reach(law.value(s)).expect("reached"), s, 1e-14));
        assert_eq!(law.reach(3.0), None);
        // Von Bertalanffy: x' = 3 x^(2/3) - 3 x from 1/8: (1 - exp(-s)/2)^3.
        let law = Growth::bernoulli(0.125, -3.0, 3.0, 2.0 / 3.0).expect("a solution");
        assert!(close(0.125 + law.value(s), (1.0 - 0.5 * (-s).exp()).powi(3), 1e-14));
        // x' = x³ from 1 ends at 1/2; x' = -sqrt(x) from 1 arrives at 0 at 2.
        let law = Growth::bernoulli(1.0, 0.0, 1.0, 3.0).expect("a solution");
        assert!(close(1.0 + law.value(0.375), 2.0, 1e-14));
        assert!(close(law.ends().1.expect("a pole"), 0.5, 1e-14));
        let law = Growth::bernoulli(1.0, 0.0, -1.0, 0.5).expect("a solution");
        assert!(close(law.reach(-1.0).expect("reached"), 2.0, 1e-14));
        assert!(
            Growth::gompertz(0.0, 1.0, 1.0).is_none() && Growth::bernoulli(-1.0, 1.0, 1.0, 0.5).is_none()
        );
    }

    proptest! {
        #[test]
        fn solutions_solve(x in 0.1..3.0f64, a in -2.0..2.0f64, b in -2.0..2.0f64, p in 0.2..3.0f64, s in -0.5..0.5f64, gompertz: bool) {
            prop_assume!((p - 1.0).abs() > 0.05 && s.abs() > 1e-3);
            let law = if gompertz { Growth::gompertz(x, a, b) } else { Growth::bernoulli(x, a, b, p) };
            let law = law.expect("a positive start");
            let q = |x: f64| if gompertz { x * (a + b * x.ln()) } else { a * x + b * x.powf(p) };
            let u = law.value(s);
            prop_assume!(u.is_finite() && x + u > 1e-3 && u.abs() < 100.0);
            prop_assert!((law.rate(u) - q(x + u)).abs() <= 1e-9 * (1.0 + q(x + u).abs()), "{} {}", law.rate(u), q(x + u));
            let h = 1e-6;
            let slope = (law.value(s + h) - law.value(s - h)) / (2.0 * h);
            prop_assume!(slope.is_finite());
            prop_assert!((slope - law.rate(u)).abs() <= 1e-4 * (1.0 + slope.abs()), "{slope} {}", law.rate(u));
            let bounds = law.over(s.min(0.0), s.max(0.0));
            let middle = law.value(0.4 * s);
            let slack = 1e-9 * (1.0 + middle.abs());
            prop_assert!(bounds.value.lo - slack <= middle && middle <= bounds.value.hi + slack);
            let rate = law.rate(middle);
            prop_assert!(bounds.rate.lo - slack * 10.0 <= rate && rate <= bounds.rate.hi + 10.0 * slack, "{rate} {bounds:?}");
            prop_assume!(law.rate(u).abs() > 1e-3);
            let back = law.reach(u).expect("it was there");
            prop_assert!((back - s).abs() <= 1e-8, "{back} {s}");
        }
    }
}
