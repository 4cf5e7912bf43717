//! Best rational approximation of the exponential on the negative real axis, in partial fractions.
//!
//! `exp(A) v` for a matrix `A` with eigenvalues on or near the negative real axis (decay chains, diffusion)
//! becomes seven linear solves with complex shifts, however stiff `A` is: see [`POLES`]. The error does not
//! depend on the size of the eigenvalues.
//!
//! The approximation is that of type (14,14) which is best in the maximum norm on (-infinity, 0]: W. J. Cody,
//! G. Meinardus, R. S. Varga, "Chebyshev rational approximations to e^-x in [0, +inf) and applications to
//! heat-conduction problems", J. Approx. Theory 2 (1969) 50-65; L. N. Trefethen, J. A. C. Weideman,
//! T. Schmelzer, "Talbot quadratures and rational approximations", BIT 46 (2006) 653-670. The constants were
//! computed anew: a Caratheodory-Fejer approximation as start, then the Remez exchange in 60-digit
//! arithmetic, until the error took its largest size with alternating sign at 30 points (0 and -infinity
//! among them) to better than 30 digits.
//!
//! Type (14,14) is where f64 stops paying: the best error falls 9.29-fold per degree, (16,16) has 2.1e-16 in
//! exact arithmetic, but its residues are twice as large, so rounding leaves 3e-14 for both on the axis.
//!
//! Accuracy in f64, against the true exponential (absolute errors, the largest value of exp being 1):
//!
//! | region                                       | largest error  |
//! |----------------------------------------------|----------------|
//! | z real, z <= 0                               | 3.2e-14        |
//! | Re z <= 0, abs(Im z) <= 0.1, 0.5, 1          | 3e-13, 2e-11, 4e-10 |
//! | Re z <= -abs(Im z), abs(Im z) <= 1, 2, 3     | 8e-12, 1e-10, 6e-10 |
//! | sector of 10, 20, 30, 45 degrees to the axis | 3e-13, 7e-12, 3e-10, 7e-8 |
//!
//! It is good to 1e-10 for Re z <= 0 up to abs(Im z) = 0.75, for Re z <= -1 up to 1.5, and in the sector of
//! 27 degrees to the axis. Right of the origin the error grows fast: it is no approximation for growing
//! modes, nor for oscillation.

/// Poles `(re, im)` in the upper half plane; the other seven are their conjugates.
///
/// With [`RESIDUES`] and [`ALPHA_0`], for real `z`:
/// `exp(z) ~ ALPHA_0 + 2 Re sum_j RESIDUES[j] / (z - POLES[j])`.
/// So for a real matrix and vector `exp(A) v ~ ALPHA_0 v + 2 Re sum_j x_j`, where `x_j` solves
/// `(A - POLES[j]) x_j = RESIDUES[j] v`.
/// For complex `z` the conjugate terms must be summed on their own.
#[allow(clippy::excessive_precision)] // 20 digits, so that the next reader can check them
pub const POLES: [(f64, f64); 7] = [
    (-8.8977731864688888193, 16.630982619902085304),
    (-3.7032750494234480610, 13.656371871483268170),
    (-0.20875863825013012194, 10.991260561901260918),
    (2.2697838292311127001, 8.4617379730402213968),
    (3.9933697105785685304, 6.0048316422350373162),
    (5.0893450605806245017, 3.5888240290270065157),
    (5.6231425727459771252, 1.1940690463439669732),
];

/// Residues `(re, im)` at [`POLES`], with the sign of `RESIDUES[j] / (z - POLES[j])`.
#[allow(clippy::excessive_precision)]
pub const RESIDUES: [(f64, f64); 7] = [
    (-0.000071542880635890673042, 0.00014361043349541300136),
    (0.0094390253107361688578, -0.017184791958483017532),
    (-0.37636003878226968871, 0.33518347029450103951),
    (4.8071120988325088739, -1.3209793837428724235),
    (-23.498232091082701235, -5.8083591297142075069),
    (46.933274488831293041, 45.643649768827760758),
    (-27.875161940145646399, -102.14733999056451427),
];

/// Value of the approximation at -infinity, equal to the error of the best approximation in exact arithmetic.
#[allow(clippy::excessive_precision)]
pub const ALPHA_0: f64 = 1.8321743782540412752e-14;

/// The approximation of `exp(z)` for real `z <= 0`, of absolute error below 1e-13 (meant for checks).
///
/// It is not accurate in the relative sense: below about `z = -30` it is an error of 2e-14 around zero.
#[cfg(test)]
pub fn exp(z: f64) -> f64 {
    let mut sum = 0.0;
    for ((p_re, p_im), (r_re, r_im)) in POLES.into_iter().zip(RESIDUES) {
        let (x, y) = (z - p_re, -p_im);
        // Re of r / (x + i y), divided through by x where x is large, so that no square overflows.
        sum += if x.abs() < 1e100 { (r_re * x + r_im * y) / (x * x + y * y) } else { r_re / x };
    }
    ALPHA_0 + 2.0 * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    type Complex = (f64, f64);

    fn div((a, b): Complex, (c, d): Complex) -> Complex {
        let n = c * c + d * d;
        ((a * c + b * d) / n, (b * c - a * d) / n)
    }

    /// The approximation for complex `z`, poles and conjugates apart.
    fn complex(z: Complex) -> Complex {
        let mut sum = (ALPHA_0, 0.0);
        for (p, r) in POLES.into_iter().zip(RESIDUES) {
            for sign in [1.0, -1.0] {
                let q = div((r.0, sign * r.1), (z.0 - p.0, z.1 - sign * p.1));
                sum = (sum.0 + q.0, sum.1 + q.1);
            }
        }
        sum
    }

    fn complex_error(z: Complex) -> f64 {
        let r = complex(z);
        (r.0 - z.0.exp() * z.1.cos()).hypot(r.1 - z.0.exp() * z.1.sin())
    }

    /// Points -10^k, evenly spaced in k.
    fn negative(from: i32, to: i32, per_decade: i32) -> impl Iterator<Item = f64> {
        (from * per_decade..=to * per_decade)
            .map(move |i| -(10f64.powf(f64::from(i) / f64::from(per_decade))))
    }

    #[test]
    fn close_to_exp_on_the_negative_axis() {
        let largest = negative(-8, 8, 20_000).map(|x| (exp(x) - x.exp()).abs()).fold(0.0, f64::max);
        assert!(largest < 5e-14, "{largest}");
        // At 0 the best approximation is off by -ALPHA_0 = -1.83e-14; in f64 -2.4e-14, after rounding.
        assert!((exp(0.0) - 1.0).abs() < 5e-14);
        assert!((exp(-1e8) - ALPHA_0).abs() < 1e-14);
        assert!((exp(-f64::MAX) - ALPHA_0).abs() < 1e-20);
        assert!((exp(f64::NEG_INFINITY) - ALPHA_0).abs() < 1e-20);
    }

    #[test]
    fn error_alternates() {
        // Chebyshev's criterion for a best approximation of type (14,14): 30 extremes of alternating sign. In
        // f64 only those far from the poles stand clear of rounding: the last ones, at large -z.
        let mut signs = vec![];
        for x in negative(1, 5, 400) {
            let e = exp(x) - x.exp();
            if e.abs() > 0.8 * ALPHA_0 && signs.last() != Some(&(e > 0.0)) {
                signs.push(e > 0.0);
            }
        }
        assert!(signs.len() >= 14, "{}", signs.len());
        assert_eq!(signs.last(), Some(&true));
    }

    #[test]
    fn close_in_its_derivative() {
        // r'(x) = -2 Re sum RESIDUES[j] / (x - POLES[j])^2
        for (x, bound) in [(0.0, 1e-11), (-0.1, 1e-12), (-1.0, 1e-12), (-5.0, 1e-12), (-30.0, 1e-13)] {
            let slope: f64 = POLES
                .into_iter()
                .zip(RESIDUES)
                .map(|(p, r)| -2.0 * div(div(r, (x - p.0, -p.1)), (x - p.0, -p.1)).0)
                .sum();
            assert!((slope - x.exp()).abs() < bound, "{x}: {}", slope - x.exp());
        }
    }

    #[test]
    fn close_to_exp_near_the_axis() {
        // The bounds of the table in the header. Largest at the edges of the regions, which are sampled.
        let strip = |y: f64| negative(-6, 3, 100).map(|x| complex_error((x, y))).fold(0.0, f64::max);
        for (y, bound) in [(0.1, 4e-13), (0.5, 2e-11), (1.0, 4.5e-10)] {
            assert!(strip(y) < bound, "Im z = {y}: {}", strip(y));
        }
        let wedge = |y: f64| negative(-6, 3, 100).map(|x| complex_error((x - y, y))).fold(0.0, f64::max);
        for (y, bound) in [(0.1, 2e-13), (0.5, 2e-12), (1.0, 1e-11), (2.0, 1e-10)] {
            assert!(wedge(y) < bound, "Im z = {y}: {}", wedge(y));
        }
        let ray = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            negative(-6, 6, 100).map(|r| complex_error((r * cos, -r * sin))).fold(0.0, f64::max)
        };
        for (degrees, bound) in [(10.0, 3e-13), (20.0, 7e-12), (30.0, 3e-10), (45.0, 7e-8)] {
            assert!(ray(degrees) < bound, "{degrees} degrees: {}", ray(degrees));
        }
        // And the conjugate symmetry that allows "2 Re" on the axis.
        assert!((complex((-1.5, 0.0)).0 - exp(-1.5)).abs() < 1e-13);
        assert!(complex((-1.5, 0.0)).1.abs() < 1e-13);
    }
}
