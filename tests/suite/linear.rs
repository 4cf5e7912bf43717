//! Neighbours with linear equations, solved by `auto`, against closed forms: one-way transport, decay from a large
//! start, stiff chains, growth, signs. Each at several tolerances, and with the same bits whichever times are observed.

use dlsys::sim::{Method, Settings};

use crate::common::{Plain, run};

const TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-9];

fn parameters(string: &[Plain]) -> Vec<f64> {
    string.iter().flat_map(|module| module.1.iter().copied()).collect()
}

/// Parameters of all modules at some times, within ten tolerances: the promise is a hundred.
fn reaches(text: &str, times: &[f64], exact: impl Fn(f64) -> Vec<f64>) {
    for tolerance in TOLERANCES {
        let settings = Settings { tolerance, ..Settings::default() };
        let strings = run(text, settings, times).unwrap_or_else(|e| panic!("{e}\n{text}"));
        for (&t, string) in times.iter().zip(&strings) {
            let (found, wanted) = (parameters(string), exact(t));
            assert_eq!(found.len(), wanted.len(), "{text}");
            for (i, (x, y)) in found.iter().zip(&wanted).enumerate() {
                let allowed = 10.0 * tolerance * y.abs().max(1.0);
                assert!(
                    (x - y).abs() <= allowed,
                    "t = {t}, TOL = {tolerance}, no. {i}: {x}, not {y}\n{text}"
                );
                assert!(*y < 0.0 || *x >= 0.0, "t = {t}, TOL = {tolerance}, no. {i}: {x}\n{text}");
            }
            let alone = run(text, settings, &[t]).expect("it has run before");
            let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&parameters(&alone[0])), bits(&found), "t = {t}: seen on the way, and alone");
        }
    }
}

/// The part of a Poisson distribution of mean m that is at k or beyond.
fn poisson(k: usize, m: f64) -> f64 {
    let mut logarithm = -m;
    let (mut below, mut above) = (0.0, 0.0);
    for i in 0..4_000 {
        if i > 0 {
            logarithm += (m / i as f64).ln();
        }
        *(if i < k { &mut below } else { &mut above }) += logarithm.exp();
    }
    if below < 0.5 { 1.0 - below } else { above }
}

fn chain(head: &str, cell: &str, n: usize) -> String {
    format!("{head}{}", format!(" {cell}").repeat(n))
}

#[test]
fn transport_one_way() {
    let n = 64;
    let text = format!(
        "initial string: {}\nS(s) < C(x): solve dx/dt = 2.5*(s - x)\nC(s) < C(x): solve dx/dt = 2.5*(s - x)",
        chain("S(3)", "C(0)", n)
    );
    let exact = |t: f64| (0..=n).map(|k| if k == 0 { 3.0 } else { 3.0 * poisson(k, 2.5 * t) }).collect();
    reaches(&text, &[0.001, 0.7, 9.0, 14.0, 26.0, 200.0], exact);
}

/// The same, from the right to the left, and what has passed is counted at the end.
#[test]
fn transport_from_the_tip_and_what_has_arrived() {
    let n = 40;
    let text = format!(
        "initial string: {} C(1)\nE(x) > C(c): solve dx/dt = 7*c\nC(x) > C(c): solve dx/dt = 7*(c - x)\nC(x): solve dx/dt = -7*x",
        chain("E(0)", "C(0)", n)
    );
    // From the tip, which begins with everything.
    let exact = |t: f64| {
        let stage = |k: usize| poisson(k, 7.0 * t) - poisson(k + 1, 7.0 * t);
        std::iter::once(poisson(n + 1, 7.0 * t)).chain((0..=n).rev().map(stage)).collect()
    };
    reaches(&text, &[0.1, 3.0, 6.0, 20.0], exact);
}

#[test]
fn what_is_left_of_much() {
    let text = "initial string: A(0) B(0) D(7e11)\nA(x) > B(y): solve dx/dt = 0.8*(y - x)\n\
        A(x) < B(y) > D(z): solve dy/dt = 0.8*(z - y)\nB(y) < D(z): solve dz/dt = -0.8*z + 0*y";
    let exact = |t: f64| {
        let left = 7e11 * (-0.8 * t).exp();
        vec![left * (0.8 * t) * (0.8 * t) / 2.0, left * 0.8 * t, left]
    };
    reaches(text, &[1.0, 20.0, 45.0, 60.0, 1000.0], exact);
    // Both ways and stiff: the sum decays, the difference is gone at once.
    let text = "initial string: A(4e12) B(0)\nA(x) > B(y): solve dx/dt = 2000*(y - x) - x\n\
        A(x) < B(y): solve dy/dt = 2000*(x - y) - y";
    let exact = |t: f64| {
        let (sum, difference) = (2e12 * (-t).exp(), 2e12 * (-4001.0 * t).exp());
        vec![sum + difference, sum - difference]
    };
    reaches(text, &[1e-4, 0.01, 5.0, 28.0, 40.0, 700.0], exact);
}

#[test]
fn a_stiff_chain_follows_its_source() {
    let n = 30;
    let text = format!(
        "initial string: {}\nS(s): solve ds/dt = 0.25\nS(s) < C(x): solve dx/dt = 4000*(s - x)\nC(s) < C(x): solve dx/dt = 4000*(s - x)",
        chain("S(1)", "C(1)", n)
    );
    let exact = |t: f64| (0..=n).map(|k| 1.0 + 0.25 * (t - k as f64 / 4000.0)).collect();
    reaches(&text, &[0.5, 5.0, 50.0], exact);
}

#[test]
fn growth_and_resonance() {
    let text = "initial string: A(1e-6) B(3e-6)\nA(x) > B(y): solve dx/dt = 0.5*x + 40*(y - x)\n\
        A(x) < B(y): solve dy/dt = 0.5*y + 40*(x - y)";
    let exact = |t: f64| {
        let (sum, difference) = (2e-6 * (0.5 * t).exp(), 1e-6 * (-79.5 * t).exp());
        vec![sum - difference, sum + difference]
    };
    reaches(text, &[0.01, 1.0, 30.0, 80.0], exact);
    // t, then t^2/2, then t^3/6 times exp(-t).
    let text = "initial string: S(1) A(0) B(0) D(0)\nS(s): solve ds/dt = -s\nS(s) < A(x) > B(y): solve dx/dt = s - x + 0*y\n\
        A(s) < B(x) > D(y): solve dx/dt = s - x + 0*y\nB(s) < D(x): solve dx/dt = s - x";
    let exact = |t: f64| [1.0, t, t * t / 2.0, t * t * t / 6.0].map(|x| x * (-t).exp()).to_vec();
    reaches(text, &[1e-3, 1.0, 10.0, 100.0, 1e5], exact);
}

/// Neighbours that weigh on each other with a minus are as good as others; those that swing are left to steps.
#[test]
fn signs_of_influences() {
    let text = "initial string: A(1) B(-1)\nA(x) > B(y): solve dx/dt = -3*(y + x)\nA(x) < B(y): solve dy/dt = -3*(x + y)";
    reaches(text, &[0.1, 2.0, 50.0], |_| vec![1.0, -1.0]);
    let text = "initial string: A(1) B(0.5)\nA(x) > B(y): solve dx/dt = -3*(y + x)\nA(x) < B(y): solve dy/dt = -3*(x + y)";
    let exact = |t: f64| [0.25, -0.25].map(|half| half + 0.75 * (-6.0 * t).exp()).to_vec();
    reaches(text, &[0.1, 2.0, 50.0], exact);
    let text = "initial string: A(1) B(0)\nA(x) > B(y): solve dx/dt = -2*y\nA(x) < B(y): solve dy/dt = 2*x";
    reaches(text, &[0.5, 0.7], |t| vec![(2.0 * t).cos(), (2.0 * t).sin()]);
}

/// Two substances that diffuse, one of which turns into the other: every four unknowns in a ring.
#[test]
fn couplings_that_are_no_tree() {
    let sine = |i: usize| (std::f64::consts::PI * i as f64 / 6.0).sin();
    let cells: String = (1..=5).map(|i| format!(" C({}, 0)", sine(i))).collect();
    let text = format!(
        "initial string: C_w(0, 0){cells} C_w(0, 0)\nC(l, m) < C(x, y) > C(r, s): solve dx/dt = 4*(l + r - 2x) - 0.5*x, dy/dt = 4*(m + s - 2y) + 0.5*x - 0.2*y\nC_w(x, y): solve dx/dt = 0"
    );
    let slow = 8.0 * (1.0 - (std::f64::consts::PI / 6.0).cos());
    let exact = |t: f64| {
        let (x, y) = ((-(slow + 0.5) * t).exp(), (-(slow + 0.2) * t).exp());
        let cell = |i: usize| [sine(i) * x, sine(i) * 0.5 / 0.3 * (y - x)];
        [[0.0; 2]].into_iter().chain((1..=5).map(cell)).chain([[0.0; 2]]).flatten().collect()
    };
    reaches(&text, &[0.01, 0.5, 3.0, 100.0], exact);
}

#[test]
fn linear_neighbours_are_followed_without_steps() {
    // Two cells between walls at 1: with s = a + b and d = a - b, s' = 2D - (D + m) s and d' = -(3D + m) d. Decay, and
    // growth, where the largest eigenvalue is positive; stiff and not. By the method that makes no steps, and by others.
    let text = "param D = 1\nparam m = 0.5\ninitial string: W(1) C(3) C(0.25) W(1)\nC(l) < C(c) > W(r): solve dc/dt = D*(l + r - 2c) - m*c\nW(l) < C(c) > C(r): solve dc/dt = D*(l + r - 2c) - m*c";
    for (d, m) in [(1.0, 0.5), (1e4, 0.5), (0.25, -0.5), (1e-3, 0.0)] {
        let text = text.replace("D = 1\n", &format!("D = {d}\n")).replace("m = 0.5", &format!("m = {m}"));
        let exact = |t: f64| {
            let (decay, rest) = (d + m, 2.0 * d / (d + m));
            let sum = rest + (3.25 - rest) * (-decay * t).exp();
            let difference = 2.75 * (-(3.0 * d + m) * t).exp();
            [0.5 * (sum + difference), 0.5 * (sum - difference)]
        };
        for (method, bound) in [(Method::Auto, 1e-12), (Method::Radau, 1e-8)] {
            let settings = Settings { method, tolerance: 1e-10, ..Settings::default() };
            let session = crate::common::session(&text);
            let mut simulation = session.simulate(settings).expect("starts");
            let mut string = Default::default();
            for t in [0.0, 1e-5, 0.3, 2.0, 20.0] {
                simulation.at(t, &mut string).expect("runs");
                let cells = crate::common::plain(&session.model, &string);
                for (cell, exact) in cells[1..3].iter().zip(exact(t)) {
                    let error = (cell.1[0] - exact).abs() / exact.abs().max(1.0);
                    assert!(error < bound, "D = {d}, m = {m}, {method:?}, t = {t}: error {error:e}");
                }
            }
            assert_eq!(simulation.stats().steps == 0, method == Method::Auto);
        }
    }
    // Two that turn about each other have no real eigenvalues, and take steps.
    let turning = "initial string: A(1) B(0)\nA(x) > B(y): solve dx/dt = -y\nA(x) < B(y): solve dy/dt = x";
    let settings = Settings { tolerance: 1e-10, ..Settings::default() };
    let string = run(turning, settings, &[10.0]).expect("runs").remove(0);
    assert!((string[0].1[0] - 10f64.cos()).abs() < 1e-10 && (string[1].1[0] - 10f64.sin()).abs() < 1e-10);
}

/// What flows in by a formula, a power of time and two exponentials here, is solved along with the cells: c' = s + p - 3c and d' = c - d
/// with s = exp(-t) - exp(-2t) / 2 and p = 2 + t + t²/2. One step would be needed at least otherwise.
#[test]
fn formulas_flow_into_linear_neighbours_without_steps() {
    let text = "initial string: A(1, 0.5, 1, 2) C(1) D(0)\n\
                A(m, s, q, p): solve dm/dt = -m, ds/dt = m - 2*s, dq/dt = 1, dp/dt = q\n\
                A(m, s, q, p) < C(c): solve dc/dt = s + p - 3*c\n\
                C(c) < D(d): solve dd/dt = c - d";
    let (x, y, z) = (1.0 / 6.0, 2.0 / 9.0, 16.0 / 27.0);
    let fades = 1.0 - (0.5 - 0.5 + z);
    let (v, w) = (y - 2.0 * x, z - (y - 2.0 * x));
    let exact = |t: f64| {
        let [one, two, three] = [1.0, 2.0, 3.0].map(|rate: f64| (-rate * t).exp());
        let c = 0.5 * one - 0.5 * two + fades * three + (x * t + y) * t + z;
        let begins = -(0.5 - 0.5 * fades + w);
        let d = (0.5 * t + begins) * one + 0.5 * two - 0.5 * fades * three + (x * t + v) * t + w;
        vec![one, one - 0.5 * two, 1.0 + t, 2.0 + t + 0.5 * t * t, c, d]
    };
    assert!((exact(0.0)[4] - 1.0).abs() + exact(0.0)[5].abs() < 1e-14);
    reaches(text, &[0.01, 0.7, 3.0, 12.0], exact);
    let session = crate::common::session(text);
    let mut simulation = session.simulate(Settings::default()).expect("starts");
    simulation.at(12.0, &mut Default::default()).expect("runs");
    assert_eq!(simulation.stats().steps, 0);
    // What swings flows in by steps.
    let swings = "initial string: A(0, 1) C(0)\nA(x, y): solve dx/dt = y, dy/dt = -x\n\
                  A(x, y) < C(c): solve dc/dt = x - c";
    let exact = |t: f64| vec![t.sin(), t.cos(), 0.5 * (t.sin() - t.cos() + (-t).exp())];
    reaches(swings, &[0.5, 4.0], exact);
}
