//! Rows of empty cells that are filled by their neighbours: what has not arrived anywhere has no sign, and what has arrived has its digits, however
//! little it is.

use dlsys::sim::{Method, Settings};

use crate::common::run;

const METHODS: [Method; 4] = [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau];

/// Of what has not arrived anywhere nobody knows which of two is larger: that switches nothing, and is no event.
#[test]
fn a_row_of_empty_cells_is_filled_from_one_end() {
    for rate in ["max(c_l - c, 0)", "abs(c_l - c)", "c_l - c", "if c_l > c then c_l - c else 0"] {
        let production =
            if rate.starts_with("if") { "" } else { "\n if c_l < c produce X\nX: if t < 0 produce ε" };
        for (cells, production) in [(8, ""), (24, production)] {
            let row = "A(0) ".repeat(cells);
            let first = rate.replace("c_l", "s");
            let text = format!(
                "initial string: S(1) {row}\nS(s) < A(c): solve dc/dt = {first}\nA(c_l) < A(c):\n solve dc/dt = {rate}{production}"
            );
            for (method, tolerance) in
                [(Method::Auto, 1e-4), (Method::Auto, 1e-8), (Method::Dop853, 1e-6), (Method::Radau, 1e-6)]
            {
                let settings = Settings { method, tolerance, ..Settings::default() };
                let found = run(&text, settings, &[4.0])
                    .unwrap_or_else(|e| panic!("{method:?} {tolerance:e}: {e}\n{text}"));
                // The waiting times of Poisson's process: 1 - exp(-t) times the sum of t^j/j! below the number of the cell.
                let (mut term, mut sum) = (1.0, 0.0);
                for (number, (name, values)) in found[0].iter().skip(1).enumerate() {
                    sum += term;
                    term *= 4.0 / (number as f64 + 1.0);
                    let wanted = 1.0 - (-4.0_f64).exp() * sum;
                    assert!(
                        name == "A" && (values[0] - wanted).abs() < 10.0 * tolerance,
                        "{method:?} {tolerance:e} {number}: {name}{values:?}, not {wanted}\n{text}"
                    );
                }
            }
        }
    }
}

/// An implicit step is a polynomial through later values: it departs at once from what stays empty much longer.
#[test]
fn a_row_of_empty_cells_is_filled_in_implicit_steps() {
    for rate in [
        "max(r - c, 0) + c*(0.94 - c)",
        "max(l - c, 0) + 0.7*max(r - c, 0) - c^3",
        "abs(l - c) + abs(r - c) + c/(1 + c)",
        "(if l > c then l - c else 0) + 0.5*sin(c)",
    ] {
        let text = format!(
            "initial string: W(0.3) {} W(0.9)\nW(l) < A(c) > A(r): solve dc/dt = {rate}\nA(l) < A(c) > A(r): solve dc/dt = {rate}\nA(l) < A(c) > W(r): solve dc/dt = {rate}",
            "A(0) ".repeat(6)
        );
        let states = |method, tolerance| {
            let settings = Settings { method, tolerance, ..Settings::default() };
            run(&text, settings, &[0.5, 2.0])
                .unwrap_or_else(|e| panic!("{method:?} {tolerance:e}: {e}\n{text}"))
        };
        let exact = states(Method::Dop853, 1e-11);
        for (method, tolerance) in [Method::Radau, Method::Auto]
            .into_iter()
            .flat_map(|m| [1e-3, 1e-4, 1e-6, 1e-8].map(|tol| (m, tol)))
        {
            let found = states(method, tolerance);
            for ((_, a), (_, b)) in found.iter().flatten().zip(exact.iter().flatten()) {
                let error = (a[0] - b[0]).abs();
                assert!(error < 30.0 * tolerance, "{method:?} {tolerance:e}: {error:e}\n{text}");
            }
        }
    }
}

/// Cells that no influence has reached yet are not below zero, though the polynomials of integration are, by their noise: a production for what
/// is below zero never takes place, and nothing is in doubt.
#[test]
fn empty_cells_are_not_below_zero() {
    let row = |(rate, [left, right]): (&str, [f64; 2]), value: &str, guard: &str| {
        let cells = "F_v(0, 0) ".repeat(10);
        format!(
            "initial string: F_w({left}, 0) {cells} F_w({right}, 0)\nF(l, p) < F_v(c, v) > F(r, q):\n solve dc/dt = {rate}, v = {value}\n {guard}"
        )
    };
    let rates = [
        ("0.702*(l + r - 2*c) + 1.332*c + 1.86*abs(r - c) - 0.897*c", [1.446, 0.556]),
        ("0.128*c + 1.646*l/(1 + c*c) - 1.229*c", [1.446, 0.556]),
        ("1.336*max(l - c, 0) + 0.331*abs(r - c) - 0.504*c", [1.446, 0.556]),
        // The last cell leaves zero unseen, and goes back towards it for a while when its neighbour is found to leave.
        ("1.143*abs(r - c) + 1.062*(l + r - 2*c) - 0.549*c", [1.446, 0.0]),
        // All that arrives is on one side of the absolute value.
        ("0.643*(l + r - 2*c) + 0.672*abs(l - r) - 0.897*c", [0.0, 1.613]),
    ];
    let guards = [
        ("0", "if c < 0 produce F_v(0.4, 0)"),
        ("0", "if c + r < 0 produce ε"),
        ("0", "if min(c, r) < 0 produce ε"),
        ("0", "if max(-c, -r) > 0 produce ε"),
        ("0", "if c < 0 | r < 0 produce ε"),
        ("0", "if l > r & c < 0 produce ε"),
        ("0", "if (if l > r then c else r) < 0 produce ε"),
        ("floor(3.612*c)", "if v < 0 produce F_v(0.4, 0)"),
        ("if c < 0 then 1 else 0", "if v > 0.5 produce ε"),
    ];
    for rate in rates {
        for method in METHODS {
            for tolerance in [1e-4, 1e-6, 1e-8] {
                let settings = Settings { method, tolerance, ..Settings::default() };
                for (value, guard) in guards {
                    let [with, without] = [guard, ""].map(|guard| {
                        let text = row(rate, value, guard);
                        run(&text, settings, &[0.48]).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
                    });
                    let [with, without] = [with, without].map(|mut states| states.swap_remove(0));
                    assert_eq!(with.len(), without.len(), "{method:?} {tolerance:e}: {rate:?}; {guard}");
                    for (a, b) in with.iter().zip(&without) {
                        let off = (a.1[0] - b.1[0]).abs();
                        assert!(
                            off < 100.0 * tolerance,
                            "{method:?} {tolerance:e}: {rate:?}; {guard}: {off:e}"
                        );
                    }
                }
            }
        }
    }
}

/// The first that arrives in empty cells decides over their equations (`abs(l - r)`) as more does later: it has its digits at once. Expected: the
/// exponential of the matrix of `abs(l - r) = r - l`, with 40 digits.
#[test]
fn what_arrives_in_empty_cells_has_its_digits() {
    let cells = "F_v(0) ".repeat(10);
    let text = format!(
        "initial string: F_w(0) {cells} F_w(1.613)\nF(l) < F_v(c) > F(r): solve dc/dt = 0.643*(l + r - 2*c) + 0.672*abs(l - r) - 0.897*c"
    );
    let expected = [1.0819944183120e-18, 1.5541157061535e-16, 2.0094961360495e-14, 2.3103602368080e-12];
    for method in METHODS {
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
            let settings = Settings { method, tolerance, ..Settings::default() };
            let states = run(&text, settings, &[0.053]).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            for ((_, values), expected) in states[0][1..].iter().zip(expected) {
                let off = (values[0] / expected - 1.0).abs();
                assert!(off < tolerance.max(1e-8), "{method:?} {tolerance:e}: {expected:e} is {off:e} off");
            }
        }
    }
}

/// Two neighbours next to nothing, of which an error of integration has made the one larger that will be smaller, do not push against each other.
#[test]
fn what_is_next_to_nothing_has_a_side() {
    let cells = "F_v(0) ".repeat(8);
    let text = format!(
        "initial string: F_w(0.349) {cells} F_v(0.407) F_w(1.508)\nF(l) < F_v(c) > F(r): solve dc/dt = 0.511*(l + r - 2*c) + 0.884*min(r, l) + 1.328*abs(r - c) - 1.339*c"
    );
    for method in METHODS {
        let at = |tolerance: f64| {
            let settings = Settings { method, tolerance, ..Settings::default() };
            run(&text, settings, &[0.3])
                .unwrap_or_else(|e| panic!("{method:?} {tolerance:e}: {e}"))
                .swap_remove(0)
        };
        let exact = at(1e-11);
        for tolerance in [1e-3, 1e-5, 1e-7] {
            for (found, exact) in at(tolerance).iter().zip(&exact) {
                let off = (found.1[0] - exact.1[0]).abs();
                assert!(off < 10.0 * tolerance, "{method:?} {tolerance:e}: {off:e}");
            }
        }
    }
}
