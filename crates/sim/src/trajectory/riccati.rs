//! Solutions of `x' = c + b x + a x²` with constant coefficients.
//!
//! Written for the displacement `u = x - x(0)`: `u' = f + d u + a u²`, where f is the rate at the start and
//! `d = b + 2 a x(0)`. The discriminant `d² - 4 a f = b² - 4 a c` tells the cases apart. All formulas avoid
//! cancellation: a start of 1e-300, a threshold 1e-12 from the limit, and a life of 1e-12 keep their digits.

use super::LITTLE;
use dlsys_expr::{Dual, Interval};

/// A growth law of one parameter, from one start. Modules keep theirs: it has no number that follows from the others in a few
/// instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Riccati {
    /// Rate at the start.
    f: f64,
    d: f64,
    a: f64,
    /// Half the square root of the discriminant; if that is negative, minus half the square root of its magnitude.
    root: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Case {
    /// a = 0
    Exponential,
    /// Two real equilibria, or a double one.
    Real,
    /// None: growth through a pole.
    Complex,
}

/// From a start so many times as large as the equilibrium that it falls to, and as 1, a displacement does not tell the value there.
const FAR: f64 = 1e7;
/// A rate of less than this part of that at the start has lost digits if it is computed from the coefficients.
const NEARLY_STILL: f64 = 1e-2;

impl Riccati {
    /// The solution of `x' = c + b x + a x²` from `x`.
    pub fn new(x: f64, c: f64, b: f64, a: f64) -> Riccati {
        let f = c + (b + a * x) * x;
        let d = b + 2.0 * a * x;
        // From the original coefficients: b² - 4ac is constant along the solution, and loses fewer digits.
        let discriminant = b * b - 4.0 * a * c;
        let w = 0.5 * discriminant.abs().sqrt();
        Riccati { f, d, a, root: if discriminant < 0.0 { -w } else { w } }
    }

    fn case(&self) -> Case {
        match () {
            _ if self.a == 0.0 => Case::Exponential,
            _ if self.root < 0.0 => Case::Complex,
            _ => Case::Real,
        }
    }

    /// Half the square root of the discriminant's magnitude.
    fn w(&self) -> f64 {
        self.root.abs()
    }

    /// The roots of the rate in `u` are `-f/p` and `-f/q`: `p + q = 2w` (d ≥ 0; else with the signs of d turned),
    /// `p q = -a f`.
    fn roots(&self) -> (f64, f64) {
        let p = self.w() + 0.5 * self.d.abs();
        (p, if p == 0.0 { 0.0 } else { -self.a * self.f / p })
    }

    /// The one in the denominator of the solution, `1 - fading (1 - exp(-2 w τ)) / (2 w)`.
    fn fading(&self) -> f64 {
        let (p, q) = self.roots();
        if self.d >= 0.0 { p } else { q }
    }

    /// `(1 - exp(-2 w τ)) / (2 w)`, which is τ for w = 0.
    fn decay(&self, tau: f64) -> f64 {
        let w = self.w();
        if w == 0.0 { tau } else { -(-2.0 * w * tau).exp_m1() / (2.0 * w) }
    }

    /// The displacement at a time since the start. Infinite or NaN from the pole on.
    pub fn value(&self, tau: f64) -> f64 {
        if self.f == 0.0 || tau == 0.0 {
            return 0.0;
        }
        match self.case() {
            Case::Exponential if self.d == 0.0 => self.f * tau,
            Case::Exponential => self.f * ((self.d * tau).exp_m1() / self.d),
            Case::Real => {
                let (g, w, (p, q)) = (self.decay(tau), self.w(), self.roots());
                let (still, fading) = if self.d >= 0.0 { (q, p) } else { (p, q) };
                // Without a pole q is positive, and a sum of positive terms loses nothing.
                if q > 0.0 {
                    // Computed directly: 1 - 2 w g would cancel.
                    let left = (-2.0 * w * tau).exp();
                    return self.f * (2.0 * w * g) / (still + fading * left);
                }
                let rest = 1.0 - fading * g;
                if rest <= 0.0 { f64::NAN } else { self.f * g / rest }
            }
            Case::Complex => {
                if tau >= self.pole().unwrap_or(f64::INFINITY) {
                    return f64::NAN;
                }
                let w = self.w();
                let (s, c) = (w * tau).sin_cos();
                self.f * s / (w * c - 0.5 * self.d * s)
            }
        }
    }

    /// True if the solution of `x' = c + b x + a x²` falls from `x` to an equilibrium so much smaller that the displacement from `x` has lost the digits
    /// of it.
    pub fn loses_digits(&self, x: f64, c: f64, b: f64, a: f64) -> bool {
        let equilibrium = match self.case() {
            _ if self.f == 0.0 || x.abs() < FAR => return false,
            // A decay to 0 is computed directly.
            Case::Exponential if self.d >= 0.0 || c == 0.0 => return false,
            Case::Exponential => -c / b,
            Case::Complex => return false,
            Case::Real if self.pole().is_some() => return false,
            // The rate falls where the solution rests. Of the two forms of that root, one does not cancel.
            Case::Real if b > 0.0 => (-b - 2.0 * self.w()) / (2.0 * a),
            Case::Real if b < 2.0 * self.w() => 2.0 * c / (2.0 * self.w() - b),
            Case::Real => 0.0,
        };
        equilibrium.abs() * FAR < x.abs()
    }

    /// The value at a time since the start, at which it was `x`, for `x' = b x`: not by its displacement.
    pub fn directly(&self, x: f64, tau: f64) -> Option<f64> {
        let decays = self.case() == Case::Exponential && self.f == self.d * x;
        decays.then(|| x * (self.d * tau).exp())
    }

    /// The same for any equation; by the displacement where that has the digits.
    pub fn at(&self, x: f64, tau: f64) -> f64 {
        let value = x + self.value(tau);
        if value.abs() < LITTLE * x.abs() { self.directly(x, tau).unwrap_or(value) } else { value }
    }

    /// The rate where the displacement is `u`.
    pub fn rate(&self, u: f64) -> f64 {
        self.f + (self.d + self.a * u) * u
    }

    /// The coefficients f and d, if the equation is `x' = f + d (x - x(0))`.
    pub fn exponential(&self) -> Option<(f64, f64)> {
        (self.case() == Case::Exponential).then_some((self.f, self.d))
    }

    /// The time of the pole, or of overflow; None if the solution exists at all times after 0.
    pub fn pole(&self) -> Option<f64> {
        match self.case() {
            _ if self.f == 0.0 => None,
            // exp(d τ) overflows.
            Case::Exponential => (self.d > 0.0)
                .then(|| (f64::MAX.ln() - (self.f.abs() / self.d).ln()).min(709.782_712_893_384) / self.d),
            Case::Real => {
                let (w, fading) = (self.w(), self.fading());
                // 1 = fading (1 - E) / (2w)
                let part = 2.0 * w / fading;
                if self.roots().1 > 0.0 || fading <= 0.0 || part > 1.0 {
                    return None;
                }
                let tau = if w == 0.0 { 1.0 / fading } else { -(-part).ln_1p() / (2.0 * w) };
                tau.is_finite().then_some(tau)
            }
            Case::Complex => Some(self.w().atan2(0.5 * self.d) / self.w()),
        }
    }

    /// The first time after 0 at which the displacement is `u`. `exact_rate` computes the rate there from the equation
    /// as written, which near an equilibrium has more correct digits than the coefficients give.
    pub fn reach(&self, u: f64, exact_rate: impl FnOnce() -> f64) -> Option<f64> {
        let ahead = u * self.f > 0.0;
        let mut rate = self.rate(u);
        if ahead && rate.abs() < NEARLY_STILL * self.f.abs() {
            rate = exact_rate();
        }
        // Between the start and `u` the rate has one sign, or `u` is not reached.
        if !ahead || rate.is_nan() || rate * self.f <= 0.0 {
            return None;
        }
        let ratio = rate / self.f;
        let tau = match self.case() {
            Case::Exponential if self.d == 0.0 => u / self.f,
            Case::Exponential if (0.5..2.0).contains(&ratio) => (u * self.d / self.f).ln_1p() / self.d,
            Case::Exponential => ratio.ln() / self.d,
            Case::Real => {
                let (w, fading) = (self.w(), self.fading());
                // E = exp(-2 w τ) = rate f / (f + u fading)², and 1 - E = 2 w u / (f + u fading).
                let below = self.f + u * fading;
                if below * self.f <= 0.0 {
                    return None;
                }
                if w == 0.0 {
                    u / below
                } else {
                    let gone = 2.0 * w * u / below;
                    let rest = (rate / below) * (self.f / below);
                    let log = if gone < 0.5 { (-gone).ln_1p() } else { rest.ln() };
                    -log / (2.0 * w)
                }
            }
            Case::Complex => {
                let (w, sign) = (self.w(), self.f.signum());
                (w * u * sign).atan2((self.f + 0.5 * self.d * u) * sign) / w
            }
        };
        (tau.is_finite() && tau > 0.0).then_some(tau)
    }

    /// Bounds of displacement and rate from one time since the start to another. The solution of an autonomous equation
    /// is monotonic.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let (a, b) = (self.value(from), self.value(to));
        if !a.is_finite() || !b.is_finite() {
            return Dual { value: Interval::ENTIRE, rate: Interval::ENTIRE };
        }
        let mut rate = Interval::spanned(self.rate(a), self.rate(b));
        let extreme = -0.5 * self.d / self.a;
        if a.min(b) < extreme && extreme < a.max(b) {
            let there = self.rate(extreme);
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
        (a - b).abs() <= part * a.abs().max(b.abs())
    }

    #[test]
    fn the_apex_of_the_leaf_doubles_in_ln_2() {
        // Paper, section 7.1: x' = 2 (1 - x/3) x from 1 to 2; A01 and E02 of the hard cases.
        let apex = Riccati::new(1.0, 0.0, 2.0, -2.0 / 3.0);
        let rate = |x: f64| 2.0 * (1.0 - x / 3.0) * x;
        assert!(close(apex.reach(1.0, || rate(2.0)).expect("reached"), std::f64::consts::LN_2, 4e-16));
        let near = 3.0 * (1.0 - 2f64.powi(-40));
        assert!(close(
            apex.reach(near - 1.0, || rate(near)).expect("reached"),
            14.209_517_201_478_424,
            1e-14
        ));
        assert_eq!(apex.reach(2.0, || rate(3.0)), None);
        assert!(close(1.0 + apex.value(20.0), 3.0, 1e-15));
        // G05: a life of 7e-13.
        let step = 2f64.powi(-40);
        assert!(close(
            apex.reach(step, || rate(1.0 + step)).expect("reached"),
            6.821_210_263_295_411e-13,
            1e-13
        ));
        // G02: from 1e-300.
        let tiny = Riccati::new(1e-300, 0.0, 1.0, -1.0);
        assert!(close(tiny.reach(0.5, || 0.25).expect("reached"), 690.775_527_898_213_7, 1e-15));
        assert!(close(tiny.value(690.775_527_898_213_7), 0.5, 1e-12));
    }

    #[test]
    fn what_falls_from_far_above_is_told() {
        let loses = |x: f64, c: f64, b: f64, a: f64| Riccati::new(x, c, b, a).loses_digits(x, c, b, a);
        assert!(
            loses(1e18, 2.0, 0.0, -1.0) && loses(1e18, 0.0, 1.0, -1.0 / 3.0) && loses(1e18, 2.0, -1.0, 0.0)
        );
        assert!(loses(-1e18, -2.0, 0.0, 1.0) && loses(1e9, 0.0, 0.0, -1.0));
        // Towards nothing smaller, or nowhere.
        assert!(!loses(1e18, 1e36, 0.0, -1.0) && !loses(1e18, 0.0, -1.0, 0.0) && !loses(3.0, 2.0, 0.0, -1.0));
        assert!(!loses(1e18, 0.0, 1.0, 0.0) && !loses(1e18, 1.0, 0.0, 1.0));
    }

    #[test]
    fn growth_through_a_pole() {
        // x' = 1 + x² from 0 is the tangent; x' = x² from 1 is 1 / (1 - τ).
        let tangent = Riccati::new(0.0, 1.0, 0.0, 1.0);
        assert!(close(tangent.value(1.0), 1f64.tan(), 1e-15));
        assert!(close(tangent.reach(1e6, || 1.0 + 1e12).expect("reached"), 1e6f64.atan(), 1e-15));
        assert!(close(tangent.pole().expect("a pole"), std::f64::consts::FRAC_PI_2, 1e-15));
        let hyperbola = Riccati::new(1.0, 0.0, 0.0, 1.0);
        assert!(close(hyperbola.pole().expect("a pole"), 1.0, 1e-15));
        assert!(close(1.0 + hyperbola.value(0.9), 10.0, 1e-14));
        let grows = Riccati::new(1.0, 0.0, 1.0, 0.0);
        assert!(close(grows.pole().expect("overflow"), 709.782_712_893_384, 1e-13));
    }

    proptest! {
        /// The displacement satisfies its equation, and `reach` inverts it.
        #[test]
        fn solutions_solve(c in -3.0..3.0f64, b in -3.0..3.0f64, a in -3.0..3.0f64, x in -2.0..2.0f64, part in 0.05..0.8f64) {
            let law = Riccati::new(x, c, b, a);
            let end = law.pole().unwrap_or(3.0).min(3.0) * part;
            let u = law.value(end);
            prop_assume!(u.abs() < 100.0 && u.abs() > 1e-9);
            let h = 1e-5 * end;
            let slope = (law.value(end + h) - law.value(end - h)) / (2.0 * h);
            prop_assert!((slope - law.rate(u)).abs() <= 1e-5 * (1.0 + slope.abs()), "{slope} {}", law.rate(u));
            let rate = law.rate(u);
            // Near an equilibrium the time is not determined by a rounded value.
            prop_assume!(rate.abs() > 1e-6 * law.f.abs());
            let back = law.reach(u, || rate);
            prop_assert!(back.is_some_and(|t| (t - end).abs() <= 1e-8 * end), "{back:?} {end}");
        }
    }
}
