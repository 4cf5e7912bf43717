//! Sums of products of powers, exponentials, sines and cosines of time, as numbers and as solutions.
//!
//! [`Terms`] is an algebra: a rate is evaluated in it, with time and other solutions as its variables, and
//! [`Terms::solve`] integrates the result. A solution that would be inaccurate in this form (too many terms, or near
//! resonance) is refused; then the module is integrated numerically.

use dlsys_expr::{
    Array, Binary, Curve, Dual, FIELD_ARGUMENTS, FieldPart, FieldSlot, Interval, Part, Unary, Value,
};
use smallvec::SmallVec;

/// The term Re (re + i im) τ^power exp((growth + i frequency) τ).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Term {
    re: f64,
    im: f64,
    power: u32,
    growth: f64,
    frequency: f64,
}

const MAX_TERMS: usize = 16;

/// A sum of at most [`MAX_TERMS`] terms.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    terms: [Term; MAX_TERMS],
    len: usize,
    /// The function is not such a sum, or has too many terms.
    refused: bool,
}

/// Solutions each of which flows into the one before: `x_i' = d_i x_i + x_(i+1)`, and the last one has a constant inflow.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// For each, d and the value at some time.
    pub links: SmallVec<[(f64, f64); 4]>,
    /// The inflow of the last one.
    pub inflow: f64,
}

/// The terms of a solution may be this many times larger at its start than its value there, or than 1. What they cancel is lost: the solution is right
/// to 1e-12. `x' = -a x + t³` has terms of 6/a⁴.
const CANCELLATION: f64 = 1e4;

/// Exponents that differ by less than this part of their size, but are not equal, would cancel digits.
const RESONANCE: f64 = 1e-4;

impl Term {
    fn value(&self, tau: f64) -> f64 {
        let (sin, cos) = if self.frequency == 0.0 { (0.0, 1.0) } else { (self.frequency * tau).sin_cos() };
        let power = if self.power == 0 { 1.0 } else { tau.powi(self.power as i32) };
        let growth = if self.growth == 0.0 { 1.0 } else { (self.growth * tau).exp() };
        power * growth * (self.re * cos - self.im * sin)
    }

    fn over(&self, tau: Interval) -> Interval {
        let num = Interval::constant;
        let mul = |a, b| Interval::binary(Binary::Mul, a, b);
        let wave = if self.frequency == 0.0 {
            num(self.re)
        } else {
            let phase = mul(num(self.frequency), tau);
            let (cos, sin) = (Interval::unary(Unary::Cos, phase), Interval::unary(Unary::Sin, phase));
            Interval::binary(Binary::Sub, mul(num(self.re), cos), mul(num(self.im), sin))
        };
        let power = Interval::binary(Binary::Pow, tau, num(f64::from(self.power)));
        let growth = Interval::unary(Unary::Exp, mul(num(self.growth), tau));
        mul(mul(power, growth), wave)
    }
}

impl Terms {
    const ZERO: Terms = Terms {
        terms: [Term { re: 0.0, im: 0.0, power: 0, growth: 0.0, frequency: 0.0 }; MAX_TERMS],
        len: 0,
        refused: false,
    };
    const REFUSED: Terms = Terms { refused: true, ..Terms::ZERO };

    /// The sum a + b τ.
    pub fn affine(a: f64, b: f64) -> Terms {
        let mut sum = Terms::constant(a);
        sum.add(Term { re: b, power: 1, ..Term::default() });
        sum
    }

    /// The sum a + b exp(d τ).
    pub fn exponential(a: f64, b: f64, d: f64) -> Terms {
        let mut sum = Terms::constant(a);
        sum.add(Term { re: b, growth: d, ..Term::default() });
        sum
    }

    /// The sum x + c_0 τ + c_1 τ² + …
    pub fn polynomial(x: f64, c: &[f64]) -> Terms {
        let mut sum = Terms::constant(x);
        for (power, &re) in (1..).zip(c) {
            sum.add(Term { re, power, ..Term::default() });
        }
        sum
    }

    fn add(&mut self, term: Term) {
        if term.re == 0.0 && term.im == 0.0 {
            return;
        }
        let alike = self.terms[..self.len]
            .iter_mut()
            .find(|t| (t.power, t.growth, t.frequency) == (term.power, term.growth, term.frequency));
        if let Some(same) = alike {
            same.re += term.re;
            same.im += term.im;
        } else if self.len == MAX_TERMS || term.power > 12 {
            self.refused = true;
        } else {
            self.terms[self.len] = term;
            self.len += 1;
        }
    }

    fn terms(&self) -> &[Term] {
        &self.terms[..self.len]
    }

    fn scaled(mut self, by: f64) -> Terms {
        for term in &mut self.terms[..self.len] {
            term.re *= by;
            term.im *= by;
        }
        self
    }

    fn product(a: &Terms, b: &Terms) -> Terms {
        let mut out = Terms { refused: a.refused || b.refused, ..Terms::ZERO };
        for x in a.terms() {
            for y in b.terms() {
                // The oscillating one first; a factor without frequency is real.
                let (x, y) = if x.frequency == 0.0 { (y, x) } else { (x, y) };
                let base = Term { power: x.power + y.power, growth: x.growth + y.growth, ..*x };
                if y.frequency == 0.0 {
                    out.add(Term { re: x.re * y.re, im: x.im * y.re, ..base });
                    continue;
                }
                // Re u Re v = (Re u v + Re u v*) / 2
                for (im, frequency) in [(y.im, y.frequency), (-y.im, -y.frequency)] {
                    let frequency = x.frequency + frequency;
                    let re = 0.5 * (x.re * y.re - x.im * im);
                    let im = if frequency == 0.0 { 0.0 } else { 0.5 * (x.re * im + x.im * y.re) };
                    out.add(Term { re, im, frequency, ..base });
                }
            }
        }
        out
    }

    /// The value, if it is constant.
    fn as_constant(&self) -> Option<f64> {
        match self.terms() {
            _ if self.refused => None,
            [] => Some(0.0),
            [t] if t.power == 0 && t.growth == 0.0 && t.frequency == 0.0 => Some(t.re),
            _ => None,
        }
    }

    /// The coefficients a and b, if the sum is a + b τ.
    fn as_affine(&self) -> Option<(f64, f64)> {
        let (mut a, mut b) = (0.0, 0.0);
        for t in self.terms() {
            match t.power {
                _ if t.growth != 0.0 || t.frequency != 0.0 || self.refused => return None,
                0 => a += t.re,
                1 => b += t.re,
                _ => return None,
            }
        }
        Some((a, b))
    }

    /// The solution of `x' = b x + g` from `x`, where g is this sum; None if it is no such sum, or would lose too many
    /// digits.
    pub fn solve(&self, x: f64, b: f64) -> Option<TermSum> {
        if self.refused {
            return None;
        }
        let mut out = Terms::ZERO;
        let mut at_start = 0.0;
        for t in self.terms() {
            // δ = z - b
            let (dr, di) = (t.growth - b, t.frequency);
            let size = dr.hypot(di);
            if size == 0.0 {
                let re = t.re / f64::from(t.power + 1);
                out.add(Term { re, im: 0.0, power: t.power + 1, growth: b, frequency: 0.0 });
                continue;
            }
            if size < RESONANCE * t.growth.abs().max(b.abs()).max(t.frequency.abs()) {
                return None;
            }
            // ∫ s^n exp(δ s) ds = exp(δ τ) Σ_k (-1)^(n-k) n!/k! τ^k / δ^(n-k+1)
            let norm = size * size;
            let (ir, ii) = (dr / norm, -di / norm);
            let (mut re, mut im) = (t.re * ir - t.im * ii, t.re * ii + t.im * ir);
            for k in (0..=t.power).rev() {
                out.add(Term { re, im, power: k, ..*t });
                if k == 0 {
                    at_start += re;
                }
                let factor = -f64::from(k);
                (re, im) = (factor * (re * ir - im * ii), factor * (re * ii + im * ir));
            }
        }
        out.add(Term { re: x - at_start, growth: b, ..Term::default() });
        // Later the terms cancel each other less: those without a power are the largest only at first. Infinite ones and NaN fail as well.
        let at_first = out.terms().iter().filter(|t| t.power == 0).map(|t| t.re.hypot(t.im)).sum::<f64>();
        let finite = out.terms().iter().all(|t| t.re.is_finite() && t.im.is_finite());
        if out.refused || !finite || at_first > CANCELLATION * x.abs().max(1.0) {
            return None;
        }
        Some(TermSum::new(out))
    }

    /// The sum as the first of a chain of solutions, with their values at a time. None if a term oscillates, or there are too many.
    pub fn chain(&self, tau: f64) -> Option<Chain> {
        if self.refused || self.terms().iter().any(|t| t.frequency != 0.0) {
            return None;
        }
        let (mut links, mut rest) = (SmallVec::new(), *self);
        loop {
            let inflow = rest.as_constant();
            if let (Some(inflow), false) = (inflow, links.is_empty()) {
                return Some(Chain { links, inflow });
            }
            let varies = |t: &&Term| t.power > 0 || t.growth != 0.0;
            let d = rest.terms().iter().find(varies).map_or(0.0, |t| t.growth);
            links.push((d, rest.terms().iter().map(|t| t.value(tau)).sum()));
            // The inflow: x' - d x.
            let mut next = Terms::ZERO;
            for t in rest.terms() {
                next.add(Term { re: (t.growth - d) * t.re, ..*t });
                if t.power > 0 {
                    next.add(Term { re: f64::from(t.power) * t.re, power: t.power - 1, ..*t });
                }
            }
            if links.len() == MAX_TERMS {
                return None;
            }
            rest = next;
        }
    }

    fn derivative(&self) -> Terms {
        let mut out = Terms::ZERO;
        for t in self.terms() {
            out.add(Term {
                re: t.re * t.growth - t.im * t.frequency,
                im: t.re * t.frequency + t.im * t.growth,
                ..*t
            });
            if t.power > 0 {
                let n = f64::from(t.power);
                out.add(Term { re: n * t.re, im: n * t.im, power: t.power - 1, ..*t });
            }
        }
        out
    }
}

impl Value for Terms {
    fn constant(x: f64) -> Terms {
        let mut sum = Terms::ZERO;
        sum.add(Term { re: x, ..Term::default() });
        sum
    }

    fn unary(op: Unary, a: Terms) -> Terms {
        if let Some(x) = a.as_constant() {
            return Terms::constant(f64::unary(op, x));
        }
        match (op, a.as_affine()) {
            (Unary::Neg, _) => a.scaled(-1.0),
            (Unary::Exp, Some((c, b))) => Terms::exponential(0.0, c.exp(), b),
            (Unary::Cos | Unary::Sin, Some((c, b))) => {
                // cos(c + b τ) = Re e^{ic} e^{ibτ}; a sine is a cosine a quarter turn later.
                let (sin, cos) = c.sin_cos();
                let (re, im) = if op == Unary::Cos { (cos, sin) } else { (sin, -cos) };
                let mut sum = Terms::ZERO;
                sum.add(Term { re, im, frequency: b, ..Term::default() });
                sum
            }
            _ => Terms::REFUSED,
        }
    }

    fn binary(op: Binary, a: Terms, b: Terms) -> Terms {
        if let (Some(x), Some(y)) = (a.as_constant(), b.as_constant()) {
            return Terms::constant(f64::binary(op, x, y));
        }
        match op {
            Binary::Add | Binary::Sub => {
                let mut sum = Terms { refused: a.refused || b.refused, ..a };
                for t in b.scaled(if op == Binary::Add { 1.0 } else { -1.0 }).terms() {
                    sum.add(*t);
                }
                sum
            }
            Binary::Mul => Terms::product(&a, &b),
            Binary::Div => b.as_constant().map_or(Terms::REFUSED, |x| a.scaled(1.0 / x)),
            Binary::Pow => match b.as_constant() {
                Some(n) if (0.0..=4.0).contains(&n) && n == n.trunc() => {
                    (0..n as u32).fold(Terms::constant(1.0), |power, _| Terms::product(&power, &a))
                }
                _ => Terms::REFUSED,
            },
            _ => Terms::REFUSED,
        }
    }

    fn select(condition: Terms, a: Terms, b: Terms) -> Terms {
        match condition.as_constant() {
            Some(c) => {
                if c != 0.0 {
                    a
                } else {
                    b
                }
            }
            None => Terms::REFUSED,
        }
    }

    fn curve(curve: &Curve, part: Part, x: Terms) -> Terms {
        x.as_constant().map_or(Terms::REFUSED, |x| Terms::constant(curve.eval(part, x)))
    }

    fn piece(curve: &Curve, part: Part, index: Terms, x: Terms) -> Terms {
        let both = index.as_constant().zip(x.as_constant());
        both.map_or(Terms::REFUSED, |(index, x)| Terms::constant(curve.continued(part, index, x)))
    }

    fn element(array: &Array, index: Terms) -> Terms {
        index.as_constant().map_or(Terms::REFUSED, |index| Terms::constant(array.element(index)))
    }

    fn field(_: &FieldSlot, _: FieldPart, _: [Terms; FIELD_ARGUMENTS]) -> Terms {
        Terms::REFUSED
    }
}

/// A solution that is a sum of terms, with its rate.
#[derive(Clone, Debug, PartialEq)]
pub struct TermSum {
    terms: Vec<Term>,
    rate: Vec<Term>,
    /// The value at the start, as computed from the terms.
    start: f64,
}

impl TermSum {
    fn new(terms: Terms) -> TermSum {
        let all: Vec<Term> = terms.terms().to_vec();
        let start = all.iter().map(|t| t.value(0.0)).sum();
        TermSum { terms: all, rate: terms.derivative().terms().to_vec(), start }
    }

    /// The displacement at a time since the start.
    pub fn value(&self, tau: f64) -> f64 {
        if tau == 0.0 {
            return 0.0;
        }
        self.terms.iter().map(|t| t.value(tau)).sum::<f64>() - self.start
    }

    /// The value itself, if the trajectory began at `x`.
    pub fn directly(&self, x: f64, tau: f64) -> Option<f64> {
        self.begins_at(x).then(|| self.terms.iter().map(|t| t.value(tau)).sum())
    }

    /// Bounds of the value itself.
    pub fn directly_over(&self, x: f64, from: f64, to: f64) -> Option<Interval> {
        let tau = Interval::spanned(from, to);
        let add = |sum, term: &Term| Interval::binary(Binary::Add, sum, term.over(tau));
        self.begins_at(x).then(|| self.terms.iter().fold(Interval::constant(0.0), add))
    }

    fn begins_at(&self, x: f64) -> bool {
        (self.start - x).abs() <= 8.0 * f64::EPSILON * x.abs()
    }

    /// The rate at a time since the start.
    pub fn rate(&self, tau: f64) -> f64 {
        self.rate.iter().map(|t| t.value(tau)).sum()
    }

    /// Bounds of displacement and rate from one time since the start to another.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let tau = Interval::spanned(from, to);
        let total = |terms: &[Term], start: f64| {
            (terms.iter())
                .fold(Interval::constant(start), |sum, t| Interval::binary(Binary::Add, sum, t.over(tau)))
        };
        Dual { value: total(&self.terms, -self.start), rate: total(&self.rate, 0.0) }
    }

    /// The solution from the value `x` as terms, for equations that depend on it.
    pub fn terms(&self, x: f64) -> Terms {
        let mut out = Terms::constant(x - self.start);
        for t in &self.terms {
            out.add(*t);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-13 * a.abs().max(b.abs()).max(1.0), "{a} {b}");
    }

    #[test]
    fn triangular_systems_with_resonance() {
        // y' = -y + 1 from 0, z' = -z + y from 0: z = 1 - (1 + τ) exp(-τ).
        let y = Terms::constant(1.0).solve(0.0, -1.0).expect("a sum");
        let z = y.terms(0.0).solve(0.0, -1.0).expect("a sum");
        for tau in [0.1, 1.0, 5.0] {
            close(y.value(tau), 1.0 - (-tau).exp());
            close(z.value(tau), 1.0 - (1.0 + tau) * (-tau).exp());
            close(z.rate(tau), tau * (-tau).exp());
        }
        // Almost in resonance: refused.
        assert!(Terms::exponential(0.0, 1.0, -1.0 + 1e-9).solve(0.0, -1.0).is_none());
    }

    #[test]
    fn what_would_cancel_is_refused() {
        // x' = a x + τ^k and x' = a x + sin(τ w) with a slow rate or frequency: the terms are k!/a^(k+1) and 1/w^2, the value of the order of 1.
        let power = |k: i32| {
            let tau = Terms::affine(0.0, 1.0);
            (1..k).fold(tau, |power, _| Terms::product(&power, &tau))
        };
        for (k, least) in [(1, 0.02), (2, 0.1), (3, 0.2)] {
            assert!(power(k).solve(0.0, -1e-5).is_none() && power(k).solve(0.0, -1e-9).is_none());
            assert!(power(k).solve(0.0, -least).is_some());
        }
        let wave = |w: f64| Terms::unary(Unary::Sin, Terms::affine(0.0, w)).scaled(1.0 / w);
        assert!(wave(1e-8).solve(0.0, 0.0).is_none() && wave(1e-4).solve(1.0, -1e-3).is_none());
        let x = wave(0.02).solve(0.0, 0.0).expect("a sum");
        close(x.value(1.0), (1.0 - 0.02f64.cos()) / 4e-4);
        // Large values may have large terms.
        assert!(wave(1e-3).solve(1e6, 0.0).is_some());
    }

    #[test]
    fn oscillations() {
        // x' = τ cos(2τ + 1) sin(τ), integrated; checked by its rate and by differences.
        let tau = Terms::affine(0.0, 1.0);
        let phase = Terms::affine(1.0, 2.0);
        let product = Terms::binary(
            Binary::Mul,
            Terms::binary(Binary::Mul, tau, Terms::unary(Unary::Cos, phase)),
            Terms::unary(Unary::Sin, tau),
        );
        let x = product.solve(3.0, 0.0).expect("a sum");
        for t in [0.3f64, 2.0, 7.0] {
            let f = |t: f64| t * (2.0 * t + 1.0).cos() * t.sin();
            close(x.rate(t), f(t));
            let n = 2000;
            let h = t / f64::from(n);
            let simpson: f64 = (0..n)
                .map(|i| {
                    let a = f64::from(i) * h;
                    h / 6.0 * (f(a) + 4.0 * f(a + h / 2.0) + f(a + h))
                })
                .sum();
            assert!((x.value(t) - simpson).abs() < 1e-11, "{} {simpson}", x.value(t));
            let bounds = x.over(t, t + 0.01);
            for s in [0.0, 0.003, 0.01] {
                assert!(bounds.value.lo <= x.value(t + s) && x.value(t + s) <= bounds.value.hi);
                assert!(bounds.rate.lo <= x.rate(t + s) && x.rate(t + s) <= bounds.rate.hi);
            }
        }
    }
}
