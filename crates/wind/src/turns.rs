//! Sine and cosine of an angle in turns, with the same bits on all machines.
//!
//! An angle in turns loses its whole part exactly, however large it is; an angle in radians does not. Additions and
//! multiplications in a fixed order have the same result everywhere, other than the functions of the system.

use std::f64::consts::TAU;

/// Half a unit in the last place is 1/2 from here on, so adding and subtracting it rounds to a whole number.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// The nearest whole number, for magnitudes less than 2^51.
#[inline(always)]
pub(crate) fn nearest(x: f64) -> f64 {
    (x + ROUND) - ROUND
}

/// Cosine and sine of an angle of `x` turns (2π x radians), |x| < 2^49; absolute error below 1e-15.
#[inline]
pub(crate) fn cos_sin(x: f64) -> (f64, f64) {
    let x = x - nearest(x);
    let quarters = nearest(4.0 * x);
    let a = (x - 0.25 * quarters) * TAU;
    let b = a * a;
    // Taylor's series on [-π/4, π/4]: the first terms left out are below 3e-17.
    let sine = a
        * (1.0
            + b * (-1.0 / 6.0
                + b * (1.0 / 120.0
                    + b * (-1.0 / 5040.0
                        + b * (1.0 / 362_880.0
                            + b * (-1.0 / 39_916_800.0
                                + b * (1.0 / 6_227_020_800.0 + b * (-1.0 / 1_307_674_368_000.0))))))));
    let cosine = 1.0
        + b * (-0.5
            + b * (1.0 / 24.0
                + b * (-1.0 / 720.0
                    + b * (1.0 / 40_320.0
                        + b * (-1.0 / 3_628_800.0
                            + b * (1.0 / 479_001_600.0
                                + b * (-1.0 / 87_178_291_200.0 + b * (1.0 / 20_922_789_888_000.0))))))));
    // Selections instead of branches, since quarters are random.
    let odd = quarters == 1.0 || quarters == -1.0;
    let (c, s) = if odd { (sine, cosine) } else { (cosine, sine) };
    let c = if quarters == 1.0 || quarters == 2.0 || quarters == -2.0 { -c } else { c };
    let s = if quarters == -1.0 || quarters == 2.0 || quarters == -2.0 { -s } else { s };
    (c, s)
}

/// Cosine and sine of angles from -1/2 to 1/2 turns, absolute error below 1e-15: without selections, so that compilers compute several
/// at once.
///
/// With a = 2π(|x| - 1/4) they are -sin(a) and ±cos(a): Taylor's series, whose first terms left out are below 3e-17 on [-π/2, π/2].
#[inline(always)]
pub(crate) fn cos_sin_each<const W: usize>(x: [f64; W]) -> ([f64; W], [f64; W]) {
    let (mut cosine, mut sine) = ([0.0; W], [0.0; W]);
    for l in 0..W {
        let a = (x[l].abs() - 0.25) * TAU;
        let b = a * a;
        cosine[l] = -a * series(b, SINE);
        sine[l] = series(b, COSINE).copysign(x[l]);
    }
    (cosine, sine)
}

/// Taylor's series of sin(a)/a and of cos(a) in a².
const SINE: [f64; 11] = inverse_factorials(1);
const COSINE: [f64; 12] = inverse_factorials(0);

/// (-1)^i/(2i + first)!
const fn inverse_factorials<const N: usize>(first: usize) -> [f64; N] {
    let mut terms = [1.0; N];
    let mut i = 1;
    while i < N {
        // Products below 2^53 are exact, so each term is rounded once a step.
        terms[i] = -terms[i - 1] / ((2 * i + first) * (2 * i + first - 1)) as f64;
        i += 1;
    }
    terms
}

/// `Σ terms_i b^i`.
#[inline(always)]
fn series<const N: usize>(b: f64, terms: [f64; N]) -> f64 {
    let mut sum = 0.0;
    // Adapters of iterators would be functions of their own, built for narrow registers.
    for i in (0..N).rev() {
        sum = sum * b + terms[i];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm_over_a_turn_and_far_away() {
        for i in -4000..=4000 {
            let x = f64::from(i) / 1024.0;
            let (c, s) = cos_sin(x);
            assert!((c - libm::cos(TAU * x)).abs() < 3e-15, "cos at {x}");
            assert!((s - libm::sin(TAU * x)).abs() < 3e-15, "sin at {x}");
            // Whole turns change nothing, to the last bit.
            assert_eq!(cos_sin(x + 1_048_576.0), (c, s));
        }
        assert_eq!(cos_sin(0.25), (0.0, 1.0));
        assert_eq!(cos_sin(0.5).0, -1.0);
    }

    #[test]
    fn several_at_once_agree_with_one() {
        for i in -40_000..=40_000 {
            let x = f64::from(i) / 80_000.0;
            let ([c], [s]) = cos_sin_each([x]);
            let (cosine, sine) = cos_sin(x);
            assert!((c - cosine).abs() < 1e-15, "cos at {x}: {c}, {cosine}");
            assert!((s - sine).abs() < 1e-15, "sin at {x}: {s}, {sine}");
        }
    }
}
