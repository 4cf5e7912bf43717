//! The tables of the pairs: sum rules, orders of the solution, of the estimates and of the dense output.

use super::super::dop853::{DOP853, dop853_dense, join_estimates};
use super::super::dopri5::{DOPRI5, dopri5_dense};
use super::Tableau;

type Rate = fn(f64, [f64; 2]) -> [f64; 2];
type Solution = fn(f64) -> [f64; 2];

/// y' = y cos t, with the solution exp(sin t); the second component is its mirror.
fn cosine(t: f64, y: [f64; 2]) -> [f64; 2] {
    [y[0] * t.cos(), -y[1] * t.cos()]
}

fn cosine_solution(t: f64) -> [f64; 2] {
    [t.sin().exp(), (-t.sin()).exp()]
}

/// x' = x ln y, y' = -y ln x, with the solution exp(sin t), exp(cos t).
fn logarithms(_: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    [x * y.ln(), -y * x.ln()]
}

fn logarithms_solution(t: f64) -> [f64; 2] {
    [t.sin().exp(), t.cos().exp()]
}

const PROBLEMS: [(Rate, Solution); 2] = [(cosine, cosine_solution), (logarithms, logarithms_solution)];

/// One step: the new values and h times all rates, the extra stages with them.
fn step(tab: &Tableau, f: Rate, t: f64, h: f64, y: [f64; 2]) -> ([f64; 2], [[f64; 16]; 2]) {
    let mut hk = [[0.0; 16]; 2];
    let mut end = y;
    for (i, (c, row)) in tab.c.iter().zip(tab.a).enumerate() {
        let at = [0, 1].map(|m| y[m] + row.iter().zip(&hk[m]).map(|(a, k)| a * k).sum::<f64>());
        if i == tab.stages - 1 {
            end = at;
        }
        let rate = f(t + c * h, at);
        for m in 0..2 {
            hk[m][i] = h * rate[m];
        }
    }
    (end, hk)
}

fn dense(tab: &Tableau, y0: f64, y1: f64, hk: &[f64; 16]) -> Vec<f64> {
    match tab.order {
        5 => dopri5_dense(&[y0], &[y1], &std::array::from_fn(|i| [hk[i]]))[0].to_vec(),
        _ => dop853_dense(&[y0], &[y1], &hk.map(|k| [k]))[0].to_vec(),
    }
}

/// Value of a Bernstein polynomial by de Casteljau's scheme.
fn bernstein(mut b: Vec<f64>, s: f64) -> f64 {
    while b.len() > 1 {
        b = b.windows(2).map(|p| p[0] + s * (p[1] - p[0])).collect();
    }
    b[0]
}

/// Largest global errors over [0, 6]: at the ends of the steps and inside them.
fn errors(tab: &Tableau, (f, solution): (Rate, Solution), n: usize) -> [f64; 2] {
    let h = 6.0 / n as f64;
    let (mut y, mut at_ends, mut inside) = (solution(0.0), 0.0f64, 0.0f64);
    for i in 0..n {
        let t = i as f64 * h;
        let (end, hk) = step(tab, f, t, h, y);
        for m in 0..2 {
            let b = dense(tab, y[m], end[m], &hk[m]);
            for s in [0.1, 0.3, 0.5, 0.7, 0.9] {
                inside = inside.max((bernstein(b.clone(), s) - solution(t + s * h)[m]).abs());
            }
            at_ends = at_ends.max((end[m] - solution(t + h)[m]).abs());
        }
        y = end;
    }
    [at_ends, inside]
}

#[test]
fn tables_satisfy_the_sum_rules_of_their_order() {
    for tab in [&DOPRI5, &DOP853] {
        assert_eq!(tab.c.len(), tab.a.len());
        for (i, (c, row)) in tab.c.iter().zip(tab.a).enumerate() {
            assert_eq!(row.len(), i);
            assert!((row.iter().sum::<f64>() - c).abs() < 3e-14, "row {i}");
        }
        for row in tab.e {
            assert_eq!(row.len(), tab.stages);
            assert!(row.iter().sum::<f64>().abs() < 1e-14);
        }
        for row in tab.d {
            assert_eq!(row.len(), tab.c.len());
            assert!(row.iter().sum::<f64>().abs() < 1e-12);
        }
        // Quadrature: the weights integrate the powers below the order exactly.
        for p in 0..tab.order as i32 {
            let q: f64 = tab.weights().iter().zip(tab.c).map(|(b, c)| b * c.powi(p)).sum();
            assert!((q * f64::from(p + 1) - 1.0).abs() < 1e-14, "power {p}");
        }
    }
}

#[test]
fn global_errors_fall_with_the_order() {
    for (tab, n) in [(&DOPRI5, 160), (&DOP853, 24)] {
        for problem in PROBLEMS {
            let (coarse, fine) = (errors(tab, problem, n), errors(tab, problem, 2 * n));
            for i in 0..2 {
                let p = (coarse[i] / fine[i]).log2();
                assert!(
                    p > f64::from(tab.order) - 0.3 && p < f64::from(tab.order) + 0.7,
                    "order {} measure {i}: {p}",
                    tab.order
                );
            }
        }
    }
}

#[test]
fn local_errors_fall_with_their_orders() {
    // Powers of h in one step: the estimates (one order above their name), then the dense output.
    let cases = [(&DOPRI5, 0.1, vec![5.0], 5.0), (&DOP853, 0.4, vec![6.0, 4.0], 8.0)];
    for (tab, h, estimates, inside) in cases {
        let measure = |h: f64| {
            let (y, t) = (logarithms_solution(0.3), 0.3);
            let (end, hk) = step(tab, logarithms, t, h, y);
            let mut v: Vec<f64> =
                tab.e.iter().map(|e| e.iter().zip(&hk[0]).map(|(e, k)| e * k).sum::<f64>().abs()).collect();
            let b = dense(tab, y[0], end[0], &hk[0]);
            v.push((1..40).fold(0.0, |max: f64, i| {
                let s = f64::from(i) / 40.0;
                max.max((bernstein(b.clone(), s) - logarithms_solution(t + s * h)[0]).abs())
            }));
            v
        };
        let (coarse, fine) = (measure(h), measure(h / 2.0));
        for (i, want) in estimates.iter().chain([&inside]).enumerate() {
            let p = (coarse[i] / fine[i]).log2();
            assert!((p - want).abs() < 0.5, "order {} local {i}: {p}", tab.order);
        }
    }
}

#[test]
fn bernstein_form_equals_the_nested_form() {
    let hk: [f64; 16] = std::array::from_fn(|i| (1.7 * i as f64).sin());
    let (y0, y1) = (1.3, -0.4);
    let dot = |d: &[f64]| d.iter().zip(&hk).map(|(d, k)| d * k).sum::<f64>();
    let small = dense(&DOPRI5, y0, y1, &hk);
    let large = dense(&DOP853, y0, y1, &hk);
    assert_eq!([small[0], small[4], large[0], large[7]], [y0, y1, y0, y1]);
    for i in 0..=20 {
        let s = f64::from(i) / 20.0;
        let u = 1.0 - s;
        let r2 = y1 - y0;
        let r3 = hk[0] - r2;
        let r4 = r2 - hk[6] - r3;
        let nested = y0 + s * (r2 + u * (r3 + s * (r4 + u * dot(DOPRI5.d[0]))));
        assert!((bernstein(small.clone(), s) - nested).abs() < 1e-14);
        let r4 = r2 - hk[12] - r3;
        let r: Vec<f64> = DOP853.d.iter().map(|d| dot(d)).collect();
        let tail = r[0] + s * (r[1] + u * (r[2] + s * r[3]));
        let nested = y0 + s * (r2 + u * (r3 + s * (r4 + u * tail)));
        assert!((bernstein(large.clone(), s) - nested).abs() < 1e-13);
    }
}

#[test]
fn straight_lines_stay_straight() {
    // A constant rate must not meet the large weights: the coefficients are those of a line to rounding.
    let [b] = dop853_dense(&[1.0], &[1.25], &[[0.25]; 16]);
    for (i, b) in b.iter().enumerate() {
        assert!((b - (1.0 + 0.25 * i as f64 / 7.0)).abs() < 3e-16);
    }
}

#[test]
fn the_joined_estimate_is_finite_only_if_both_are_and_does_not_underflow() {
    assert!((join_estimates(-3.0, 40.0) - 9.0 / 5.0).abs() < 1e-15);
    assert!((join_estimates(3e-200, 40e-200) / 1.8e-200 - 1.0).abs() < 1e-15);
    assert_eq!(join_estimates(2.0, 0.0), 2.0);
    assert_eq!(join_estimates(0.0, 0.0), 0.0);
    assert_eq!(join_estimates(f64::NAN, 1.0), f64::INFINITY);
    assert_eq!(join_estimates(1.0, f64::NEG_INFINITY), f64::INFINITY);
}
