//! The quantile of the beta distribution: the inverse of the regularised incomplete beta function I_x(a, b).
//!
//! I is computed by its continued fraction (DiDonato and Morris 1992, "Algorithm 708", eq. 9), which begins with the
//! density. The density is computed without cancellation: by deviances and Stirling's series if both parameters are large
//! (Loader 2000, "Fast and accurate computation of binomial probabilities"), by powers otherwise. The inverse is found by
//! Newton's method on ln I as a function of ln x, or on the complement, whichever is small; so small quantiles have all
//! their digits. Compared with values of 40 digits for parameters from 1e-3 to 3e8 (`beta_quantiles.txt`), I has a relative error
//! below 4e-15; the quantile has this error times its sensitivity, which is 1/a for small a, and at most 1e-14 otherwise.

use std::f64::consts::PI;

/// From here on Stirling's series with [`SERIES`] is exact to rounding.
const LARGE: f64 = 16.0;
/// Coefficients of the remainder of Stirling's formula, by odd powers of 1/x: B_2k / (2k (2k - 1)).
const SERIES: [f64; 7] =
    [1.0 / 12.0, -1.0 / 360.0, 1.0 / 1260.0, -1.0 / 1680.0, 1.0 / 1188.0, -691.0 / 360_360.0, 1.0 / 156.0];
/// With parameters larger than this the expansion of Cornish and Fisher is exact to rounding.
const HUGE: f64 = 1e9;
/// Most terms of the continued fraction; their number grows like the root of the smaller parameter.
const TERMS: usize = 1_000_000;
/// Most steps of Newton's method, which halves its bracket where it would leave it.
const STEPS: usize = 200;

/// The x with I_x(a, b) = u, for positive parameters. Values below the least positive number are 0.
pub fn quantile(a: f64, b: f64, u: f64) -> f64 {
    if u <= 0.0 || u >= 1.0 {
        return if u <= 0.0 { 0.0 } else { 1.0 };
    }
    if a.min(b) > HUGE {
        return near_normal(a, b, u).clamp(0.0, 1.0);
    }
    // The side of 1/2 on which the quantile lies.
    let law = Law { a, b };
    if law.tails(0.5).0 >= u { law.solve(u, 1.0 - u) } else { 1.0 - Law { a: b, b: a }.solve(1.0 - u, u) }
}

/// The expansion of the quantile by the third cumulant and the fourth (Cornish and Fisher 1938).
fn near_normal(a: f64, b: f64, u: f64) -> f64 {
    let z = super::normal(u);
    let n = a + b;
    let (p, q) = (a / n, b / n);
    let deviation = (p * q / (n + 1.0)).sqrt();
    let skewness = 2.0 * (q - p) * ((n + 1.0) / (p * q)).sqrt() / (n + 2.0);
    let excess = 6.0 * ((p - q) * (p - q) * (n + 1.0) - p * q * (n + 2.0)) / (p * q * (n + 2.0) * (n + 3.0));
    let square = z * z;
    let by_skewness = (square - 1.0) * skewness / 6.0 - z * (2.0 * square - 5.0) * skewness * skewness / 36.0;
    p + deviation * (z + by_skewness + z * (square - 3.0) * excess / 24.0)
}

/// A beta distribution.
#[derive(Clone, Copy)]
struct Law {
    a: f64,
    b: f64,
}

impl Law {
    /// The x up to 1/2 with I_x = `lower`, given that there is one; `upper` is 1 - `lower`.
    fn solve(self, lower: f64, upper: f64) -> f64 {
        let (mut low, mut high) = (0.0, 0.5);
        let mut x = self.start(lower).clamp(f64::MIN_POSITIVE, 0.5);
        for _ in 0..STEPS {
            let (below, above) = self.tails(x);
            // Rate of the logarithm of a tail by ln x: x times the density, over the tail.
            let speed = self.weight(x) / (1.0 - x);
            let step = match lower <= upper {
                true => (lower / below).ln() * below / speed,
                false => (above / upper).ln() * above / speed,
            };
            let newton = x * step.exp();
            if (newton - x).abs() <= f64::EPSILON * x {
                return newton;
            }
            // Far in a tail, whatever underflows says on which side the quantile is.
            let is_low = if step.is_nan() { below < lower } else { step > 0.0 };
            if is_low {
                low = x
            } else {
                high = x
            }
            if high <= f64::MIN_POSITIVE {
                return 0.0;
            }
            x = match newton > low && newton < high {
                true => newton,
                // Halves the bracket in ln x as long as that is wide.
                false if low < 0.25 * high => (low.max(f64::MIN_POSITIVE) * high).sqrt(),
                false => 0.5 * (low + high),
            };
        }
        x
    }

    /// A first approximation: of a density near its mean, or of one that is a power near 0.
    fn start(self, lower: f64) -> f64 {
        if self.a.min(self.b) >= 2.0 {
            return near_normal(self.a, self.b, lower);
        }
        // I_x is x^a / (a B) for small x, and weight(h) = h^a (1 - h)^b / B at h = 1/2.
        let half = self.weight(0.5) * 2f64.powf(self.b) / self.a;
        0.5 * ((lower / half).ln() / self.a).exp()
    }

    /// I_x and 1 - I_x; the smaller one has all its digits.
    fn tails(self, x: f64) -> (f64, f64) {
        let Law { a, b } = self;
        if x < (a + 1.0) / (a + b + 2.0) {
            let lower = (self.weight(x) * fraction(a, b, x) / a).min(1.0);
            (lower, 1.0 - lower)
        } else {
            let upper = (self.weight(x) * fraction(b, a, 1.0 - x) / b).min(1.0);
            (1.0 - upper, upper)
        }
    }

    /// x^a (1 - x)^b / B(a, b)
    fn weight(self, x: f64) -> f64 {
        let Law { a, b } = self;
        let y = 1.0 - x;
        if a.min(b) < LARGE {
            return x.powf(a) * (b * (-x).ln_1p()).exp() / beta(a, b);
        }
        let n = a + b;
        // x - a/n, in a way that loses nothing near the mean.
        let away = (x * b - y * a) / n;
        let deviance = a * deviance(away * n / a) + b * deviance(-away * n / b);
        let ends = remainder(n) - remainder(a) - remainder(b);
        (a * (b / n) / (2.0 * PI)).sqrt() * (ends - deviance).exp()
    }
}

/// B(a, b), one of whose arguments is not large: by Stirling's formula at greater arguments, and by the recurrence
/// B(a, b) = B(a + 1, b) (a + b)/a.
fn beta(a: f64, b: f64) -> f64 {
    let (mut small, mut large, mut factor) = (a.min(b), a.max(b), 1.0);
    while small < LARGE {
        factor *= (small + large) / small;
        small += 1.0;
    }
    while large < LARGE {
        factor *= (small + large) / large;
        large += 1.0;
    }
    let n = small + large;
    let powers = small * (small / n).ln() + large * (-small / n).ln_1p();
    let ends = remainder(small) + remainder(large) - remainder(n);
    factor * (2.0 * PI * (1.0 / small + 1.0 / large)).sqrt() * (powers + ends).exp()
}

/// ln Γ(x) less Stirling's formula (x - 1/2) ln x - x + ln(2π)/2.
fn remainder(x: f64) -> f64 {
    let square = 1.0 / (x * x);
    SERIES.iter().rev().fold(0.0, |sum, c| sum * square + c) / x
}

/// e - ln(1 + e)
fn deviance(e: f64) -> f64 {
    if e.abs() > 0.25 {
        return e - e.ln_1p();
    }
    // With r = e/(2 + e), ln(1 + e) is 2 (r + r³/3 + r⁵/5 + …), and e - 2 r = e r.
    let r = e / (2.0 + e);
    let square = r * r;
    let (mut sum, mut power, mut odd) = (0.0, square, 3.0);
    while power > 1e-18 * square {
        sum += power / odd;
        power *= square;
        odd += 2.0;
    }
    r * (e - 2.0 * sum)
}

/// The continued fraction of a I_x(a, b) / weight(x), for x below the mean or not far above it (modified Lentz method).
fn fraction(a: f64, b: f64, x: f64) -> f64 {
    const LEAST: f64 = 1e-300;
    let away_from_zero = |value: f64| if value.abs() < LEAST { LEAST } else { value };
    let mut d = 1.0 / away_from_zero(1.0 - (a + b) / (a + 1.0) * x);
    let (mut c, mut sum) = (1.0, d);
    for m in 1..TERMS {
        let m = m as f64;
        let twice = a + 2.0 * m;
        let even = m / twice * ((b - m) / (twice - 1.0)) * x;
        let odd = -(a + m) / twice * ((a + b + m) / (twice + 1.0)) * x;
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 / away_from_zero(1.0 + term * d);
            c = away_from_zero(1.0 + term / c);
            change *= c * d;
        }
        sum *= change;
        if (change - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_other_programs() {
        let rows = include_str!("beta_quantiles.txt").lines().filter(|line| !line.starts_with('#'));
        let mut count = 0;
        for row in rows {
            let words: Vec<&str> = row.split_whitespace().collect();
            let [a, b, u, x] = [0, 1, 2, 3].map(|i| words[i].parse::<f64>().expect("a number"));
            let found = quantile(a, b, u);
            // The error of the quantile that an error of I makes.
            let law = Law { a, b };
            let sensitive = 4e-15 * u * x * (1.0 - x) / law.weight(x);
            let error = (found - x).abs();
            assert!(error <= 1e-14 * x + sensitive, "{row}: {found:e}, off by {:.1e}", error / x);
            count += 1;
        }
        assert!(count > 80);
    }

    #[test]
    fn quantiles_ascend_and_end_at_0_and_1() {
        for (a, b) in
            [(0.001, 3.0), (1e-5, 1e-5), (0.7, 0.7), (16.0, 15.9), (1e9, 2e9), (2e9, 3e12), (3.0, 1e15)]
        {
            let found: Vec<f64> = (0..=256).map(|i| quantile(a, b, f64::from(i) / 256.0)).collect();
            assert!(found.is_sorted() && found[0] == 0.0 && found[256] == 1.0, "{a}, {b}: {found:?}");
        }
        // The distribution with b = 1 is a power, also for quantiles below 1e-300.
        assert_eq!(quantile(0.001, 1.0, 0.25), 0.0);
        assert!((quantile(0.01, 1.0, 0.25) / 0.25f64.powf(100.0) - 1.0).abs() < 1e-12);
        assert!((quantile(1.0, 1e-3, 0.25) - (1.0 - 0.75f64.powf(1000.0))).abs() < 1e-16);
    }
}
