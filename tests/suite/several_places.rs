//! Limits that are one of several places at which the sides of a condition meet: never reached, while the other places are.

use dlsys::sim::{Method, Settings};
use proptest::prelude::*;

use crate::common::run;

const METHODS: [Method; 3] = [Method::Auto, Method::Dopri5, Method::Radau];

/// Where the rate of what jumps vanishes with it, one zero of `sin(π w/2)` is a limit, and the others are not.
#[test]
fn only_one_of_many_zeros_is_a_limit() {
    let ten = (1..=10).fold(0.0, |sum, k| sum + 3.0 - f64::ln(2.0 * f64::from(k)));
    for method in METHODS {
        let of = |text: &str, end: f64| {
            let strings = run(text, Settings { method, ..Settings::default() }, &[end]);
            strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0)
        };
        let z = of("initial string: B(0, 1)\nB(z, w): solve dw/dt = w, dz/dt = floor(w/2)", 3.0)[0].1[0];
        assert!((z - ten).abs() < 1e-4, "{method:?}: {z}, not {ten}");
        let v = of("initial string: B(1, 0)\nB(w, v): solve dw/dt = w, v = floor(w/2)", 1.2)[0].1[1];
        assert!((v - 1.0).abs() < 1e-9, "{method:?}: {v}");
        let string = of("initial string: A(1)\nA(w):\n  solve dw/dt = w\n  if w^2 >= 3*w produce C(w)", 3.0);
        assert_eq!(string[0].0, "C", "{method:?}");
        assert!((string[0].1[0] - 3.0).abs() < 1e-9, "{method:?}: {string:?}");
        // Both zeros are limits, or the only one is.
        let string = of(
            "initial string: A(1)\nA(w):\n  solve dw/dt = w*(1 - w/9)\n  if w^2 >= 9*w produce C(w)",
            90.0,
        );
        assert_eq!(string[0].0, "A", "{method:?}");
        let string = of(
            "initial string: A(0.1)\nA(w):\n  solve dw/dt = w*(1 - w)\n  if w/(1 + w) >= 0.5 produce C(w)",
            50.0,
        );
        assert_eq!(string[0].0, "A", "{method:?}");
        // Away from where it rests, within the error of values of 1.
        let string = of(
            "initial string: A(1e-12)\nA(x):\n  solve dx/dt = sinh(x)\n  if abs(x) > 1e-11 produce C(t)",
            5.0,
        );
        let there = f64::ln(10.0);
        assert!(string[0].0 == "C" && (string[0].1[0] - there).abs() < 1e-4, "{method:?}: {string:?}");
        // A step begins beyond the limit at 0, by 1e-30, where the one before has overshot it.
        let string = of(
            "initial string: A(0.745)\nA(x):\n  solve dx/dt = -0.3*sinh(x)\n  if x*(x - 1) >= 0 produce C(x)",
            235.0,
        );
        assert_eq!(string[0].0, "A", "{method:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn other_places_are_met_and_the_limit_is_not(
        limit in -16..16i32, start in -4.0..4.0f64, other in -16..16i32, speed in 0.3..2.0f64,
        form in 0..4usize, law in 0..3usize, in_a_clause in prop::bool::ANY, method in 0..3usize,
    ) {
        // Quarters, so that sums and products of them are exact: a limit is not told from a place a rounding beside it.
        let [limit, other] = [limit, other].map(|quarters| 0.25 * f64::from(quarters));
        prop_assume!((start - limit).abs() > 0.1 && (start - other).abs() > 0.1 && (other - limit).abs() > 0.1);
        let (low, high) = (limit.min(other), limit.max(other));
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        // Each is negative between both places, and positive elsewhere nearby.
        let difference = match form {
            0 => format!("(x - {limit:?})*(x - {other:?})"),
            1 => format!("x^2 - {:?}*x + {:?}", low + high, low * high),
            2 => format!("abs(x - {middle:?}) - {half:?}"),
            _ => format!("(exp(x) - exp({limit:?}))*(x - {other:?})"),
        };
        let reached = (other - limit) / (start - limit);
        let is_met = 0.0 < reached && reached < 1.0;
        let begins_between = low < start && start < high;
        let condition = format!("{difference} {} 0", if begins_between { ">=" } else { "<" });
        let (rate, pace) = match law {
            0 => (format!("{speed:?}*({limit:?} - x)"), speed),
            1 => (format!("{speed:?}*({limit:?} - x)*(1 + 0.3*sin(t))"), speed),
            _ => (format!("{speed:?}*sinh({limit:?} - x)"), speed),
        };
        let text = match in_a_clause {
            true => format!("initial string: A({start:?}, 0)\nA(x, y): solve dx/dt = {rate}, dy/dt = if {condition} then 1 else 0"),
            false => format!("initial string: A({start:?}, 0)\nA(x, y):\n  solve dx/dt = {rate}\n  if {condition} produce B(x, t)"),
        };
        // The distance d from the limit: d' = -speed d, the same with another clock, or d' = -speed sinh(d).
        let clock = match law {
            2 => ((0.5 * (start - limit)).tanh() / (0.5 * (other - limit)).tanh()).ln() / pace,
            _ => -reached.ln() / pace,
        };
        let mut time = clock;
        for _ in 0..60 {
            time = if law == 1 { clock - 0.3 * (1.0 - time.cos()) } else { clock };
        }
        let end = 70.0 / speed;
        let method = METHODS[method];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[end]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
        let found = &string[0];
        if in_a_clause {
            let expected = if is_met { end - time } else { 0.0 };
            prop_assert!((found.1[1] - expected).abs() < 1e-4 * end, "{:?}: {:?}, not {}\n{}", method, found, expected, text);
        } else {
            prop_assert_eq!(&found.0, if is_met { "B" } else { "A" }, "{:?}: {:?}\n{}", method, found, text);
            prop_assert!(!is_met || (found.1[1] - time).abs() < 1e-4 * time.max(1.0), "{:?}: {:?}, not {}\n{}", method, found, time, text);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 60, ..ProptestConfig::default() })]

    /// A window in a neighbour's value, written out as a polynomial, a difference of terms that are much larger: its edges are crossed once each.
    /// Who is born on an edge goes on into the window, or out of it, and is not judged by the rounding of the difference.
    #[test]
    fn edges_of_a_window_that_is_written_out_are_crossed_once(
        tenths in 3_i32..28,
        thousandths in prop::sample::select(vec![1, 7, 20, 100, 500]),
        (law, end) in prop::sample::select(vec![("dx/dt = 1", 3.4), ("dx/dt = 1 + 0.1*sin(x)", 3.2), ("dx/dt = 0.9*(4 - x)", 3.0), ("dx/dt = 5*t", 1.2)]),
        cubic in any::<bool>(),
        apart in any::<bool>(),
    ) {
        // What is integrated is not known well enough for the narrowest.
        prop_assume!(!law.contains("sin") || thousandths >= 100);
        // In thousandths: from a to b.
        let (a, b) = (i64::from(tenths) * 100, i64::from(tenths * 100 + thousandths));
        let decimal = |numerator: i64, digits: i32| format!("{}", numerator as f64 / 10_f64.powi(digits));
        let square = format!("x^2 - {}*x + {}", decimal(a + b, 3), decimal(a * b, 6));
        let difference = if cubic { format!("({square})*(x + 5)") } else { square };
        let counts = |own: &str, of: &str| format!(
            "{of}if {difference} < 0 & s = 0 produce A({own}n + 1, 1)\n  if {difference} > 0 & s = 1 produce A({own}n + 1, 0)"
        );
        let text = match apart {
            true => format!("initial string: P(0) A(0, 0)\nP(x): solve {law}\nP(x) < A(n, s):\n  {}", counts("", "")),
            false => format!("initial string: A(0, 0, 0)\nA(x, n, s):\n  {}", counts("x, ", &format!("solve {law}\n  "))),
        };
        let string = run(&text, Settings::default(), &[end]).unwrap_or_else(|error| panic!("{error}\n{text}")).remove(0);
        let count = string.last().map_or(0.0, |module| module.1[module.1.len() - 2]);
        prop_assert_eq!(count, 2.0, "{}", text);
    }
}

/// `x` is -0.613 + 0.823 sin(3.558 t): four times through a window of a thousandth, which counts in and out.
#[test]
fn a_window_of_a_neighbour_is_not_passed_over_when_its_first_edge_is_left() {
    for method in METHODS {
        for window in ["(x + 0.575)*(x + 0.576)", "abs(x + 0.5755) - 0.0005"] {
            let text = format!(
                "axiom: P(-0.613) A(0, 0)\nP(x): solve dx/dt = 2.927*cos(3.558*t)\nP(x) < A(n, s):\n\
                 if {window} < 0 & s = 0 produce A(n + 1, 1)\nif {window} > 0 & s = 1 produce A(n + 1, 0)\n"
            );
            let strings = run(&text, Settings { method, ..Settings::default() }, &[3.0]);
            let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error:?}\n{text}")).remove(0);
            assert_eq!(string[1].1, [8.0, 0.0], "{method:?}\n{text}");
        }
    }
}
