//! Energy spectra of turbulence, and what follows from them: variances and correlations.

use libm::{asinh, cosh, exp, pow, sinh, tgamma};

/// The energy spectrum E(k) of the turbulence over the length k of the wave vector, in rad/m: half the mean square of the
/// velocity is ∫E dk (Stam and Fiume 1993, equation 8).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spectrum {
    /// Von Kármán's: E ∝ (kL)⁴/(1 + k²L²)^(17/6), with L and the variance from the integral scale and the intensity. Eddies travel
    /// with the mean wind, and a mode of k decorrelates as exp(-k²s²/2) over the length s = ∫I|U| dt.
    #[default]
    VonKarman,
    /// Kolmogorov's as in Stam and Fiume 1993 (equations 9 and 11): E = 1.5 ε^⅔ k^(-5/3) from k_inertial on, 0 below. The exponents
    /// that equation 9 prints, ε^(3/2) and k^(-5/2), are dimensionally wrong. Modes decorrelate as exp(-k²σ²τ²/2). Eddies
    /// do not travel with the mean wind, nor depend on it: large and small scales are independent there (section 2).
    Kolmogorov {
        /// The rate ε of dissipation in m²/s³, at least 0; 1 in the paper.
        dissipation: f64,
        /// k_inertial in rad/m, greater than 0; 4 in the paper.
        inertial: f64,
        /// σ in m/s, at least 0; 1 in the paper.
        sigma: f64,
    },
}

/// Von Kármán's length as a multiple of the longitudinal integral scale: Γ(1/3)/(√π Γ(5/6)) = 1.339.
pub fn von_karman_length(scale: f64) -> f64 {
    scale * tgamma(1.0 / 3.0) / (std::f64::consts::PI.sqrt() * tgamma(5.0 / 6.0))
}

/// ∫₀^∞ x⁴/(1 + x²)^(17/6) dx = B(5/2, 1/3)/2 = 1.0326.
fn von_karman_integral() -> f64 {
    0.5 * tgamma(2.5) * tgamma(1.0 / 3.0) / tgamma(17.0 / 6.0)
}

/// A spectrum with its numbers filled in.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Energy {
    /// Unit variance of each component; the length.
    VonKarman(f64),
    /// The factor of k^(-5/3), and the smallest k.
    Kolmogorov(f64, f64),
}

impl Energy {
    pub(crate) fn new(spectrum: Spectrum, scale: f64) -> Energy {
        match spectrum {
            Spectrum::VonKarman => Energy::VonKarman(von_karman_length(scale)),
            Spectrum::Kolmogorov { dissipation, inertial, .. } => {
                Energy::Kolmogorov(1.5 * pow(dissipation, 2.0 / 3.0), inertial)
            }
        }
    }

    /// E(k) in m³/s², for a unit variance of each component where the spectrum is von Kármán's.
    pub(crate) fn at(self, k: f64) -> f64 {
        match self {
            Energy::VonKarman(length) => {
                let square = (k * length) * (k * length);
                1.5 * length / von_karman_integral() * square * square * pow(1.0 + square, -17.0 / 6.0)
            }
            Energy::Kolmogorov(factor, inertial) if k >= inertial => factor * pow(k, -5.0 / 3.0),
            Energy::Kolmogorov(..) => 0.0,
        }
    }

    /// The wave number of the largest eddies that matter: below it there is little energy or none.
    pub(crate) fn smallest(self) -> f64 {
        match self {
            // 0.3 % of the energy lies below; boxes of 14 L.
            Energy::VonKarman(length) => std::f64::consts::TAU / (14.0 * length),
            Energy::Kolmogorov(_, inertial) => 0.5 * inertial,
        }
    }

    /// ∫E dk from `from` to `to`, which may be infinite.
    pub(crate) fn integral(self, from: f64, to: f64) -> f64 {
        match self {
            Energy::Kolmogorov(factor, inertial) => {
                let tail = |k: f64| if k.is_finite() { pow(k.max(inertial), -2.0 / 3.0) } else { 0.0 };
                1.5 * factor * (tail(from) - tail(to))
            }
            // With k = sinh(v)/L the integrand is smooth, and falls as exp(-2v/3) at the end.
            Energy::VonKarman(length) => {
                let end = |k: f64| if k.is_finite() { asinh(k * length) } else { 60.0 };
                let f = |v: f64| self.at(sinh(v) / length) * cosh(v) / length;
                simpson(f, end(from), end(to), 4000)
            }
        }
    }
}

/// Simpson's rule with an even number of intervals.
fn simpson(f: impl Fn(f64) -> f64, from: f64, to: f64, intervals: u32) -> f64 {
    let h = (to - from) / f64::from(intervals);
    let inner: f64 =
        (1..intervals).map(|i| f(from + h * f64::from(i)) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (f(from) + inner + f(to)) * h / 3.0
}

/// The longitudinal and the transverse correlation f and g of von Kármán's turbulence between points at a distance r, given as
/// a multiple of von Kármán's length: f = 2^⅔/Γ(⅓) r^⅓ K_⅓(r), g = f + r f'/2.
///
/// # Examples
///
/// ```
/// let (f, g) = dlsys_wind::correlations(0.5);
/// assert!((f - 0.4651).abs() < 1e-4 && (g - 0.3234).abs() < 1e-4);
/// ```
pub fn correlations(r: f64) -> (f64, f64) {
    if r <= 0.0 {
        return (1.0, 1.0);
    }
    let factor = pow(2.0, 2.0 / 3.0) / tgamma(1.0 / 3.0);
    let f = factor * pow(r, 1.0 / 3.0) * bessel_k(1.0 / 3.0, r);
    // d/dr r^ν K_ν(r) = -r^ν K_(ν-1)(r), and K is even in its order.
    let slope = -factor * pow(r, 1.0 / 3.0) * bessel_k(2.0 / 3.0, r);
    (f, f + 0.5 * r * slope)
}

/// The modified Bessel function K of the second kind: ∫₀^∞ exp(-x cosh v) cosh(νv) dv.
fn bessel_k(order: f64, x: f64) -> f64 {
    // The integrand is below 1e-300 from x cosh v = 700 on. The rule converges exponentially for such integrands.
    let end = (700.0 / x).max(1.0).acosh();
    simpson(|v| exp(-x * cosh(v)) * cosh(order * v), 0.0, end, 2000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_and_lengths() {
        let energy = Energy::new(Spectrum::VonKarman, 4.0);
        // Three components of variance 1.
        assert!((energy.integral(0.0, f64::INFINITY) - 1.5).abs() < 1e-9);
        let parts = energy.integral(0.0, 3.0) + energy.integral(3.0, f64::INFINITY);
        assert!((parts - 1.5).abs() < 1e-9);
        assert!((1.0 / von_karman_length(1.0) - 0.7468).abs() < 1e-4);
        // Variance of a component 0.688 α ε^⅔ L^⅔, where E → α ε^⅔ k^(-5/3).
        let (k, length) = (1e6, von_karman_length(4.0));
        let rate = energy.at(k) * pow(k, 5.0 / 3.0);
        assert!((1.0 / (rate * pow(length, 2.0 / 3.0)) - 0.688).abs() < 1e-3);
        let paper = Energy::new(Spectrum::Kolmogorov { dissipation: 1.0, inertial: 4.0, sigma: 1.0 }, 1.0);
        assert_eq!(paper.at(3.999), 0.0);
        assert!((paper.integral(0.0, f64::INFINITY) - 2.25 * 4f64.powf(-2.0 / 3.0)).abs() < 1e-12);
    }

    #[test]
    fn correlations_begin_at_one_and_have_their_integral_scale() {
        let (f, g) = correlations(1e-6);
        assert!((f - 1.0).abs() < 1e-3 && (g - 1.0).abs() < 1e-3);
        let integral = simpson(|v| correlations(v * v).0 * 2.0 * v, 0.0, 6.0, 400);
        assert!((integral - 0.7468).abs() < 1e-4, "{integral}");
    }
}
