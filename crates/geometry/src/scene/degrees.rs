//! Sines and cosines of angles in degrees, exact where the value is.
//!
//! `sin(90°)` computed in radians is 1 but `cos(90°)` is 6e-17, and a thousand right angles later a square
//! is no square. Here the angle is reduced to `-45° ..= 45°` around a quarter turn first, which loses
//! nothing (the remainder of two floating-point numbers is one), so that symmetries of the circle hold
//! bit for bit.

use std::f64::consts::FRAC_1_SQRT_2;

/// `(sin, cos)` of an angle in degrees. Multiples of 30° and 45° have the values of the textbook, rounded
/// once; an infinite or undefined angle gives NaN.
pub fn sin_cos_degrees(angle: f64) -> (f64, f64) {
    if !angle.is_finite() {
        return (f64::NAN, f64::NAN);
    }
    let reduced = reduced(angle);
    let quarter = (reduced / 90.0).round();
    // Exact: the two numbers are within a factor of two of each other (Sterbenz), or `quarter` is 0.
    let rest = reduced - 90.0 * quarter;
    let (sin, cos) = near_zero(rest);
    match (quarter as i64).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// An angle in degrees modulo 360. A remainder takes many times as long as a comparison.
pub(crate) fn reduced(degrees: f64) -> f64 {
    if degrees.abs() < 360.0 { degrees } else { degrees % 360.0 }
}

/// The same for `-45 ..= 45`.
fn near_zero(angle: f64) -> (f64, f64) {
    if angle.abs() == 45.0 {
        return (FRAC_1_SQRT_2.copysign(angle), FRAC_1_SQRT_2);
    }
    let (sin, cos) = angle.to_radians().sin_cos();
    if angle.abs() == 30.0 { (0.5_f64.copysign(angle), cos) } else { (sin, cos) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turns_are_exact() {
        for turns in -9..9 {
            let base = 360.0 * f64::from(turns);
            assert_eq!(sin_cos_degrees(base), (0.0, 1.0));
            assert_eq!(sin_cos_degrees(base + 90.0), (1.0, 0.0));
            assert_eq!(sin_cos_degrees(base + 180.0), (0.0, -1.0));
            assert_eq!(sin_cos_degrees(base + 270.0), (-1.0, 0.0));
            let (sin, cos) = sin_cos_degrees(base + 135.0);
            assert_eq!(sin, -cos);
            assert_eq!(sin_cos_degrees(base + 150.0).0, 0.5);
            assert_eq!(sin_cos_degrees(base + 60.0).1, 0.5);
        }
    }

    #[test]
    fn other_angles_agree_with_radians() {
        for i in -1000..1000 {
            let angle = f64::from(i) * 1.37;
            let (sin, cos) = sin_cos_degrees(angle);
            assert!((sin - angle.to_radians().sin()).abs() < 1e-14);
            assert!((cos - angle.to_radians().cos()).abs() < 1e-14);
        }
        assert!(sin_cos_degrees(f64::INFINITY).0.is_nan());
    }
}
