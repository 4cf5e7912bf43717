//! Solutions of `x' = x (a + b ln x)` (Gompertz) and `x' = a x + b x^p` (Bernoulli; with p = 2/3 von Bertalanffy, with
//! p = 1 + shape Richards), with constant coefficients.
//!
//! A substitution makes both linear. With `y = ln(x / x(0))`, or `y = (x / x(0))^(1-p) - 1`, it is `y' = f + d y` from
//! `y = 0`, so that growth from 1e-300 and small displacements keep their digits. Where x grows by a large factor towards a limit, `y` comes near -1, and
//! `z = 1 + y` has the digits: it is `exp(d s) + g (exp(d s) - 1)/d`, with `g = f - d = (1-p) b x(0)^(p-1)`, two terms of one sign.

use dlsys_expr::{Dual, Interval};

/// A growth law of one parameter, from one start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The value at the start, greater than 0.
    x: f64,
    /// Rate of y at the start.
    f: f64,
    d: f64,
    /// f - d, of Bernoulli's equation.
    g: f64,
    /// 1 - p; None for Gompertz's law.
    bend: Option<f64>,
}

/// Where a solution of Bernoulli's equation is: y, and z = 1 + y.
#[derive(Clone, Copy)]
struct Place {
    y: f64,
    z: f64,
}

impl Place {
    /// True where y has more digits than z.
    fn is_near_start(self) -> bool {
        self.y > -0.5
    }

    /// ln(z)
    fn logarithm(self) -> f64 {
        if self.is_near_start() { self.y.ln_1p() } else { self.z.ln() }
    }
}

/// The greatest logarithm of a number.
const LARGEST: f64 = 709.782_712_893_384;

impl Growth {
    /// The solution of `x' = x (a + b ln x)` from `x`; None where the closed form does not hold, as for `x` ≤ 0.
    pub fn gompertz(x: f64, a: f64, b: f64) -> Option<Growth> {
        Growth { x, f: a + b * x.ln(), d: b, g: 0.0, bend: None }.checked()
    }

    /// The solution of `x' = a x + b x^p` from `x`; None where the closed form does not hold, as for `x` ≤ 0 or p = 1, or `b x^p` is too small for a number.
    pub fn bernoulli(x: f64, a: f64, b: f64, p: f64) -> Option<Growth> {
        let bend = 1.0 - p;
        let power = b * x.powf(p - 1.0);
        if b != 0.0 && !power.is_normal() {
            return None;
        }
        Growth { x, f: bend * (a + power), d: bend * a, g: bend * power, bend: Some(bend) }.checked()
    }

    fn checked(self) -> Option<Growth> {
        let good = self.x > 0.0 && self.f.is_finite() && self.d.is_finite() && self.bend != Some(0.0);
        good.then_some(self)
    }

    /// The integral of `exp(d s)`.
    fn spread(&self, s: f64) -> f64 {
        if self.d == 0.0 { s } else { (self.d * s).exp_m1() / self.d }
    }

    /// ln(x / x(0)) at a time; NaN beyond the end of the solution.
    fn logarithm(&self, s: f64) -> f64 {
        let spread = self.spread(s);
        let y = self.f * spread;
        let Some(bend) = self.bend else { return y };
        let z = if y.is_finite() { (self.d * s).exp() + self.g * spread } else { y };
        if z < 0.0 { f64::NAN } else { Place { y, z }.logarithm() / bend }
    }

    /// The displacement at a time since the start, which may be negative. NaN or infinite beyond the end of the
    /// solution.
    pub fn value(&self, s: f64) -> f64 {
        if self.f == 0.0 || s == 0.0 { 0.0 } else { self.x * self.logarithm(s).exp_m1() }
    }

    /// The value itself at a time since the start.
    pub fn directly(&self, s: f64) -> f64 {
        self.x * self.logarithm(s).exp()
    }

    /// The rate where the displacement is `u`.
    pub fn rate(&self, u: f64) -> f64 {
        let size = self.x + u;
        let place = self.place_of(u);
        match self.bend {
            None => size * (self.f + self.d * place.y),
            // d ln x = dy / (bend z)
            Some(bend) => size * self.slope(place) / (bend * place.z),
        }
    }

    /// y' = f + d y = g + d z
    fn slope(&self, place: Place) -> f64 {
        if place.is_near_start() || self.bend.is_none() {
            self.f + self.d * place.y
        } else {
            self.g + self.d * place.z
        }
    }

    fn place_of(&self, u: f64) -> Place {
        let logarithm = (u / self.x).ln_1p();
        match self.bend {
            None => Place { y: logarithm, z: f64::NAN },
            Some(bend) => Place { y: (bend * logarithm).exp_m1(), z: (bend * logarithm).exp() },
        }
    }

    /// The time at which the solution is at a place; None if it never is.
    fn time_of(&self, place: Place) -> Option<f64> {
        let s = if self.d == 0.0 {
            place.y / self.f
        } else if place.is_near_start() || self.bend.is_none() {
            (self.d * (place.y / self.f)).ln_1p() / self.d
        } else {
            (self.slope(place) / self.f).ln() / self.d
        };
        s.is_finite().then_some(s)
    }

    /// The time, before or after 0, at which the displacement is `u`.
    pub fn reach(&self, u: f64) -> Option<f64> {
        if self.f == 0.0 || u <= -self.x && self.bend.is_none_or(|bend| bend <= 0.0) {
            return None;
        }
        self.time_of(self.place_of(u))
    }

    /// The times, before and after 0, at which the solution ends.
    pub fn ends(&self) -> (Option<f64>, Option<f64>) {
        if self.f == 0.0 {
            return (None, None);
        }
        let largest = LARGEST - self.x.ln().max(0.0);
        let above = match self.bend {
            None => Place { y: largest, z: f64::NAN },
            Some(bend) => Place { y: (bend * largest).exp_m1(), z: (bend * largest).exp() },
        };
        let nothing = self.bend.map(|_| Place { y: -1.0, z: 0.0 });
        let ends = [Some(above), nothing].into_iter().flatten().filter_map(|place| self.time_of(place));
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
        // z d = (g + d z)(1 - 1/bend).
        let extreme = match self.bend {
            None => -(self.f + self.d) / self.d,
            Some(bend) => {
                let part = 1.0 - 1.0 / bend;
                (self.g * part / (self.d * (1.0 - part))).ln() / bend
            }
        };
        let u = self.x * extreme.exp_m1();
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

    #[test]
    fn growth_by_many_decades_ends_at_its_limit() {
        // x' = a x (1 - (x/k)^n) has the solution k (1 + ((k/x0)^n - 1) exp(-n a s))^(-1/n).
        for (x, k, n) in [
            (0.0886f64, 75.8, 5.0),
            (0.01, 100.0, 4.0),
            (1e-6, 100.0, 2.0),
            (1e-9, 1e3, 1.5),
            (1e-20, 1.0, 3.0),
        ] {
            let a = 4.9;
            let law = Growth::bernoulli(x, a, -a * f64::powf(k, -n), n + 1.0).expect("a solution");
            assert_eq!(law.ends().1, None, "{x} {k} {n}");
            for s in [0.1, 1.0, 2.0, 4.0, 9.0, 30.0, 200.0] {
                let rest = ((n * (k / x).ln()).exp_m1().ln() - n * a * s).exp();
                let exact = k * (rest.ln_1p() / -n).exp();
                let found = x + law.value(s);
                assert!(close(found, exact, 1e-12), "{found}, not {exact}, from {x} to {k}, {n} at {s}");
                let rate = a * exact * (1.0 - (exact / k).powf(n));
                assert!((law.rate(law.value(s)) - rate).abs() <= 1e-12 * a * k, "{rate} at {s}");
                if exact < 0.999 * k {
                    assert!(close(law.reach(exact - x).expect("reached"), s, 1e-9), "{s}");
                }
            }
        }
        // Too small for a number: there is no closed form in numbers.
        assert!(Growth::bernoulli(1e-100, 1.0, -1.0, 6.0).is_none());
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
