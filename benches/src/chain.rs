//! The filament with linear diffusion, solved exactly by sine modes.
//!
//! c_i' = D (c_{i-1} + c_{i+1} - 2 c_i) - mu c_i for i = 1..N with c_0 = c_{N+1} = w. The steady state is
//! w cosh((i - (N+1)/2) s) / cosh((N+1) s / 2) with 2 D (cosh s - 1) = mu, and the difference from it decays in the
//! modes sin(k pi i/(N+1)) at the rates mu + 4 D sin(k pi/(2 N + 2))^2 (discrete sine transform: any text on the
//! second difference with fixed ends, for example Strang, Computational Science and Engineering, section 1.5).

/// Cells between the walls.
pub const CELLS: usize = 1000;
/// Decay of what the cells hold, per unit of time.
pub const MU: f64 = 0.03;
/// Value at both ends.
pub const WALL: f64 = 255.0;

/// Rough initial values, which excite every mode: 5 + 250 frac(i golden ratio), i = 1..N.
pub fn initial() -> Vec<f64> {
    (1..=CELLS).map(|i| 5.0 + 250.0 * (i as f64 * 0.6180339887498949).fract()).collect()
}

/// The exact values at time `t`, to about 13 digits.
pub fn exact(d: f64, t: f64) -> Vec<f64> {
    let n = CELLS + 1;
    let sine: Vec<f64> = (0..2 * n).map(|m| (std::f64::consts::PI * m as f64 / n as f64).sin()).collect();
    let s = 2.0 * (MU / (4.0 * d)).sqrt().asinh();
    let below = |m: f64| (-s * m).exp();
    let steady = |i: usize| {
        let (i, n) = (i as f64, n as f64);
        WALL * (below(i) + below(n - i)) / (1.0 + below(n))
    };
    let missing: Vec<f64> = initial().iter().enumerate().map(|(i, c)| c - steady(i + 1)).collect();
    let mut values: Vec<f64> = (1..n).map(steady).collect();
    for k in 1..n {
        let half = (0.5 * std::f64::consts::PI * k as f64 / n as f64).sin();
        let decay = (-(MU + 4.0 * d * half * half) * t).exp();
        if decay < 1e-30 {
            continue;
        }
        let along = |i: usize| sine[(k * (i + 1)) % (2 * n)];
        let amplitude: f64 = missing.iter().enumerate().map(|(i, x)| x * along(i)).sum();
        for (i, value) in values.iter_mut().enumerate() {
            *value += 2.0 / n as f64 * amplitude * decay * along(i);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (D, t, i, c_i(t)): the same sum with 30 digits.
    #[allow(clippy::excessive_precision)]
    const SUMS: [(f64, f64, usize, f64); 6] = [
        (1e4, 1.0, 2, 253.461578034014531893600921053),
        (1e4, 10.0, 500, 159.086201106794060800396384233),
        (1e4, 100.0, 1000, 254.691302828909705451273886286),
        (0.03, 1.0, 500, 15.9367096236618421294776890568),
        (0.03, 10.0, 500, 43.9547403171892934735281580647),
        (0.03, 100.0, 1, 99.0087496758671705276766695338),
    ];

    #[test]
    fn agrees_with_thirty_digits() {
        for (d, t, i, expected) in SUMS {
            let found = exact(d, t)[i - 1];
            assert!((found - expected).abs() < 1e-11, "D = {d}, t = {t}: c_{i} = {found}, not {expected}");
        }
    }

    #[test]
    fn begins_with_the_initial_values() {
        let worst = exact(1e4, 0.0).iter().zip(initial()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-10, "{worst}");
    }
}
