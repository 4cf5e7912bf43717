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

/// Cosine and sine of angles from -1/2 to 1/2 turns in single precision, absolute error below 3e-7.
///
/// With v = |x| - 1/4, they are -sin(2πv) and ±cos(2πv), whose polynomials are fitted to have the smallest errors between -1/4 and 1/4
/// (8e-9 and 5e-8 before rounding).
#[inline(always)]
pub(crate) fn cos_sin_single<const W: usize>(x: [f32; W]) -> ([f32; W], [f32; W]) {
    const TURN: f32 = std::f32::consts::TAU;
    let (mut cosine, mut sine) = ([0.0; W], [0.0; W]);
    for l in 0..W {
        let v = x[l].abs() - 0.25;
        let w = v * v;
        cosine[l] = -v * (TURN + w * (-41.341_713 + w * (81.604_004 + w * (-76.609_61 + w * 39.942_307))));
        let size = 0.999_999_95 + w * (-19.739_17 + w * (64.934_59 + w * (-85.240_33 + w * 56.242_38)));
        sine[l] = size.copysign(x[l]);
    }
    (cosine, sine)
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
    fn single_precision_agrees_with_double() {
        for i in -40_000..=40_000 {
            let x = i as f32 / 80_000.0;
            let ([c], [s]) = cos_sin_single([x]);
            let (cosine, sine) = cos_sin(f64::from(x));
            assert!((f64::from(c) - cosine).abs() < 3e-7, "cos at {x}: {c}, {cosine}");
            assert!((f64::from(s) - sine).abs() < 3e-7, "sin at {x}: {s}, {sine}");
        }
    }
}
