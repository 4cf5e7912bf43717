//! Statistics of the turbulence against theory.

use dlsys_wind::study::statistics;
use dlsys_wind::{Description, Field};
use nalgebra::Vector3;

#[test]
fn statistics_agree_with_theory() {
    for row in statistics(24).unwrap() {
        assert!(row.holds(), "{row:?}");
    }
}

#[test]
#[ignore = "a thousand fields take two minutes"]
fn statistics_of_a_thousand_seeds_agree_with_theory() {
    for row in statistics(1000).unwrap() {
        assert!(row.holds(), "{row:?}");
        // Thirty times as many seeds, a fifth of the scatter.
        if row.name.starts_with("variance of u_") || row.name.starts_with("correlation") {
            assert!(row.error < 0.004, "{row:?}");
        }
    }
}

/// Correlations over long ways along and across the wind and along the axes: nowhere does the field resemble itself again.
#[test]
fn nothing_repeats_within_reach() {
    let field =
        Field::new(Description { turbulence: 0.2, scale: 1.0, ..Description::new(Vector3::x(), 10.0) })
            .unwrap();
    let wind = field.at(0.0).unwrap();
    let mean = Vector3::new(10.0, 0.0, 0.0);
    let places: Vec<Vector3<f64>> = (0..400)
        .map(|i| {
            Vector3::new(0.754_877_666, 0.569_840_291, 0.430_159_709)
                .map(|f| (f64::from(i) * f).fract() * 60.0)
        })
        .collect();
    let here: Vec<_> = places.iter().map(|x| wind.velocity(*x) - mean).collect();
    let square: f64 = here.iter().map(|u| u.norm_squared()).sum();
    for axis in [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(1.0, 0.0, 1.0).normalize()] {
        for step in 0..120 {
            let offset = axis * (8.0 + 0.5 * f64::from(step));
            let product: f64 =
                places.iter().zip(&here).map(|(x, u)| (wind.velocity(x + offset) - mean).dot(u)).sum();
            assert!((product / square).abs() < 0.35, "{offset}: {}", product / square);
        }
    }
}
