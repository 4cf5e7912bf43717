//! Pulses: rates and values that are large for less than a step, wherever they stand. None is passed over, or integrated in part.

use dlsys::sim::{Method, Settings};

use crate::common::run;
use crate::evidence::{first_event, last_value};

#[test]
fn pulses_of_any_width_are_seen_wherever_they_are() {
    // One of area 1 at a random place: in a rate of time, along a parameter, in a neighbour's value, among coupled modules.
    for n in 0..60 {
        let (at, width) = (8.0 + (n as f64 * 7.31) % 40.0, 10f64.powf(-(n as f64 % 5.0)));
        let height = 1.0 / (width * std::f64::consts::PI.sqrt());
        let pulse = |x: &str| format!("{height:?}*exp(-(({x} - {at:?})/{width:?})^2)");
        let models = [
            format!("initial string: A(0)\nA(x): solve dx/dt = {}", pulse("t")),
            format!("initial string: A(0, 0)\nA(x, y): solve dx/dt = {}, dy/dt = 1", pulse("y")),
            format!(
                "initial string: L(0) A(0)\nL(y): solve y = {}\nL(y) < A(x): solve dx/dt = y",
                pulse("t")
            ),
            format!(
                "initial string: A(0) B(0)\nA(x) > B(y): solve dx/dt = {} + 0*y\nA(x) < B(y): solve dy/dt = x - y",
                pulse("t")
            ),
            format!(
                "initial string: A(0) [ B(0) ]\nA(x): solve dx/dt = sum(B(y): {})\nB(y): solve dy/dt = 1",
                pulse("y")
            ),
        ];
        for text in models {
            for (method, tolerance) in [(Method::Auto, 1e-6), (Method::Dop853, 1e-8), (Method::Dopri5, 1e-4)]
            {
                let settings = Settings { method, tolerance, ..Settings::default() };
                let end = run(&text, settings, &[100.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
                let x = end[0].iter().find(|module| module.0 == "A").expect("it lives").1[0];
                assert!(
                    (x - 1.0).abs() < 100.0 * tolerance,
                    "{x} at {at} of width {width}, {settings:?}\n{text}"
                );
            }
        }
    }
}

/// A pulse in a value that a neighbour reads. Dense output has stages of its own: one that meets the pulse shows some of it, though no error depends on that.
#[test]
fn pulses_of_values_that_neighbours_read_are_seen_between_the_stages_that_count() {
    for n in 0..120 {
        let at = 0.3 + (n as f64 * 0.317) % 1.4;
        let text = format!(
            "initial string: C(0.18, 0) C(0.37, 0) C(0.45, 0) C(0.92, 0) C(1.16, 0)\n\
             C(l, w) < C(x, v): solve v = exp(-((t - {at:?})/0.01)^2)*x, dx/dt = w - x + 1.23*x/(0.62 + x) - 0.62*x\n\
             C(x, v): solve v = x, dx/dt = 0.75 - x"
        );
        let end = |method, tolerance| {
            let settings = Settings { method, tolerance, ..Settings::default() };
            run(&text, settings, &[2.0]).unwrap_or_else(|e| panic!("{e}\n{text}")).remove(0)
        };
        let (found, reference) = (end(Method::Auto, 1e-6), end(Method::Dopri5, 1e-9));
        for (found, reference) in found.iter().zip(&reference) {
            assert!((found.1[0] - reference.1[0]).abs() < 1e-4, "{found:?} {reference:?}\n{text}");
        }
    }
}

#[test]
fn pulses_along_integrated_values_are_seen_in_stiff_equations() {
    // x is 1/sqrt(1 + t), y and w follow it at once. A pulse of area 1 along one of them is over in a time of 30 to 0.003 parts of a thousand.
    for n in 0..12 {
        let (at, width) = (0.35 + 0.041 * f64::from(n), 10f64.powi(-3 - n % 3));
        // Polynomials cannot follow a value that changes faster than the last of these, and the run says so.
        let values = usize::from(n % 3 < 2);
        let height = 0.5 * at.powi(3) / (width * std::f64::consts::PI.sqrt());
        let pulse = |x: &str| format!("{height:?}*exp(-(({x} - {at:?})/{width:?})^2)");
        let models = [
            format!(
                "initial string: A(0, 1, 1)\nA(z, x, y): solve dz/dt = {}, dx/dt = -0.5*x^3, dy/dt = 1e6*(x - y)",
                pulse("x")
            ),
            format!(
                "initial string: A(0, 1, 1)\nA(z, x, y): solve dz/dt = {}, dx/dt = -0.5*y^3, dy/dt = 1e6*(x - y)",
                pulse("y")
            ),
            format!(
                "initial string: B(1) A(0, 1)\nB(x) > A(z, y): solve dx/dt = -0.5*x*x*y\nB(x) < A(z, y): solve dz/dt = {}, dy/dt = 1e6*(x - y)",
                pulse("x")
            ),
            format!(
                "initial string: B(1, 0) A(0, 1)\nB(x, v) > A(z, y): solve dx/dt = -0.5*x*x*y, v = {}\nB(x, v) < A(z, y): solve dz/dt = v, dy/dt = 1e6*(x - y)",
                pulse("x")
            ),
        ];
        for text in &models[..3 + values] {
            for (method, tolerance) in [(Method::Auto, 1e-6), (Method::Radau, 1e-4), (Method::Radau, 1e-9)] {
                let settings = Settings { method, tolerance, ..Settings::default() };
                let end = run(text, settings, &[10.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
                let z = end[0].iter().find(|module| module.0 == "A").expect("it lives").1[0];
                let exact = 1.0 + 3.0 * (width / at).powi(2);
                assert!(
                    (z - exact).abs() < (100.0 * tolerance).max(3e-6),
                    "{z}, not {exact}, at {at} of width {width}, {settings:?}\n{text}"
                );
            }
        }
    }
}

#[test]
fn pulses_that_are_high_even_powers_are_seen_twice() {
    let text = "initial string: R(0)\nR(x): solve dx/dt = 1e3*cos(t - 0.5)^1000000";
    let x = run(text, Settings::default(), &[4.5]).expect("it runs")[0][0].1[0];
    let exact = 2e3 * (2.0 * std::f64::consts::PI / 1e6).sqrt();
    assert!((x - exact).abs() < 1e-4 * exact, "{x}, not {exact}");
}

#[test]
fn a_pulse_that_only_the_dense_output_has_seen_is_seen() {
    // One stage of DOP853's dense output, which counts for no error, may fall on the flank of a pulse between two stages that do.
    for n in 0..400 {
        let at = 2.0 + 0.0013 * f64::from(n);
        let text = format!(
            "initial string: L(0) R(0.1)\nL(y): solve dy/dt = {:?}*exp(-((t - {at:?})/2e-4)^2) - y*y\nL(y) < R(x): solve dx/dt = y - x",
            1.0 / (2e-4 * std::f64::consts::PI.sqrt())
        );
        let settings = Settings { tolerance: 1e-8, ..Settings::default() };
        let end = run(&text, settings, &[4.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let exact = 1.0 / (1.0 + 4.0 - at);
        let y = end[0][0].1[0];
        assert!((y - exact).abs() < 1e-3, "{y}, not {exact}\n{text}");
    }
}

/// A pulse is no less for what stands beside it: a rate, or a wave; in a module, or in a value that a neighbour reads.
#[test]
fn pulses_beside_something_larger_are_seen() {
    let root = std::f64::consts::PI.sqrt();
    for (base, total) in [("1", 20.0), ("5*sin(0.3*t)", 5.0 / 0.3 * (1.0 - 6f64.cos())), ("30", 600.0)] {
        for width in [0.3, 0.03, 0.01] {
            for height in [0.3, 1.0, 7.0, 20.0] {
                for place in 0..6 {
                    let centre = 3.13 + 2.317 * f64::from(place);
                    let pulse = format!("{height}*exp(-((t - {centre})/{width})^2)");
                    let texts = [
                        format!("initial string: A(0)\nA(y): solve dy/dt = {base} + {pulse}\n"),
                        format!(
                            "initial string: A(0)\nA(y): solve dy/dt = sqrt(({base} + {pulse})^2)*sign({base} + {pulse})\n"
                        ),
                        format!(
                            "initial string: V(0) A(0)\nV(v): solve v = {base} + {pulse}\nV(v) < A(y): solve dy/dt = v\n"
                        ),
                    ];
                    for (which, text) in texts.iter().enumerate() {
                        // The root of a square is the size of the sum, which has corners where a wave passes 0: those have tests of their own.
                        if which == 1 && base.contains("sin") {
                            continue;
                        }
                        let y = last_value(text, 20.0);
                        let exact = total + height * width * root;
                        assert!(
                            (y - exact).abs() < 1e-4 * exact.abs().max(1.0),
                            "{y}, not {exact}, of\n{text}"
                        );
                    }
                }
            }
        }
    }
}

/// Nor does it matter what the sum of wave and pulse stands in: a function, a product, an equation, a value that events or neighbours read.
#[test]
fn pulses_inside_formulas_and_equations_are_seen() {
    for place in 0..12 {
        let (centre, width) = (3.13 + 1.217 * f64::from(place), [0.1, 0.01, 0.001][place as usize % 3]);
        let sum = format!("(5*sin(0.3*t) + 2*exp(-((t - {centre})/{width})^2))");
        let exact = |f: &dyn Fn(f64) -> f64, of: &dyn Fn(f64) -> f64| {
            // Simpson's rule, with a fine grid around the pulse.
            let parts = |a: f64, b: f64, n: usize| {
                let (h, at) = ((b - a) / n as f64, |k: usize| a + (b - a) * k as f64 / n as f64);
                let weight = |k: usize| if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
                (0..=n).map(|k| weight(k) * h / 3.0 * of(f(at(k)))).sum::<f64>()
            };
            let (before, after) = (centre - 8.0 * width, centre + 8.0 * width);
            parts(0.0, before, 2000) + parts(before, after, 2000) + parts(after, 20.0, 2000)
        };
        let value = |t: f64| 5.0 * (0.3 * t).sin() + 2.0 * (-((t - centre) / width).powi(2)).exp();
        let root = |r: f64| (0..60).fold(r.cbrt(), |v: f64, _| v - (v + v.powi(3) - r) / (1.0 + 3.0 * v * v));
        let cases: [(String, f64); 6] = [
            (format!("A(0)\nA(y): solve dy/dt = sqrt(20 + {sum})"), exact(&value, &|v| (20.0 + v).sqrt())),
            (
                format!("A(0)\nA(y): solve dy/dt = (2 + sin(t))*{sum}"),
                exact(&|t| (2.0 + t.sin()) * value(t), &|v| v),
            ),
            (
                format!("V(0) A(0)\nV(v): solve v = {sum}\nV(v) < A(y): solve dy/dt = 10*exp(0.1*v)"),
                exact(&value, &|v| 10.0 * (0.1 * v).exp()),
            ),
            (
                format!(
                    "A(0) [ V(0) ] [ V(0) ]\nV(v): solve v = {sum}\nA(y): solve dy/dt = sum(V(v): 0.5*v)"
                ),
                exact(&value, &|v| v),
            ),
            (format!("A(0, 0)\nA(y, v): solve dy/dt = v, 0 = v + v^3 - {sum}"), exact(&value, &root)),
            (
                format!(
                    "A(0, 0, 1)\nA(y, v, z): solve dy/dt = v, 0 = v + v^3 - {sum}, dz/dt = -1e4*(z - cos(t))*(1 + z^2)"
                ),
                exact(&value, &root),
            ),
        ];
        for (text, exact) in cases {
            let end =
                run(&format!("initial string: {text}\n"), Settings::default(), &[20.0]).expect("it runs");
            let y = end[0].iter().find(|module| module.0 == "A").expect("it lives").1[0];
            assert!((y - exact).abs() < 1e-4 * exact.abs().max(1.0), "{y}, not {exact}, of\n{text}");
        }
        // Events on such values.
        let top = 5.0 * (0.3 * centre).sin() + 1.0;
        let lone = format!("x*exp(-((t - {centre})/{width})^2)");
        for text in [
            format!(
                "A(1, 0)\nA(x, v):\n  solve dx/dt = 1e-13*sin(x), 0 = v + v^3 - {lone}\n  if v > 0.2 produce E"
            ),
            format!(
                "S(1) P(0) A\nS(x): solve dx/dt = 1e-13*sin(x)\nS(x) < P(p): solve p = x*{sum}\n\
                 P(p) < A: if p > {top} & abs(t - {centre}) < {width} produce E"
            ),
        ] {
            let found = first_event(&format!("initial string: {text}\n"), Settings::default(), 20.0);
            let at = found.expect("it runs");
            assert!(
                at.is_some_and(|t| t < centre && t > centre - 3.0 * width),
                "{at:?}, not {centre}, of\n{text}"
            );
        }
    }
}

/// Two formulas of a step may agree by chance where a stage has met a pulse: some steps of a hundred over one do.
#[test]
fn no_pulse_of_many_is_integrated_by_chance() {
    for (rate, centre) in [(8.497574587310485, 0.0), (8.1, 0.3), (7.3, 0.7)] {
        // Each period has the area 2 pi exp(-20) I0(20).
        let text = format!(
            "initial string: A(0)\nA(y): solve dy/dt = {rate}*exp(20*(cos({rate}*(t - {centre})) - 1))\n"
        );
        let bessel = (0..200).fold((1.0, 1.0), |(term, sum): (f64, f64), k| {
            let next = term * 100.0 / f64::from((k + 1) * (k + 1));
            (next, sum + next)
        });
        let periods = 100.0;
        let exact = periods * 2.0 * std::f64::consts::PI * (-20f64).exp() * bessel.1;
        let y = last_value(&text, periods * 2.0 * std::f64::consts::PI / rate);
        assert!((y - exact).abs() < 1e-4 * exact, "{y}, not {exact}, of\n{text}");
    }
}

/// A pulse soon after the birth of each cell of a filament in which cells have events all the time: it is within what is integrated again around an
/// event, and in no step of all cells. The reference has no pulse but what it adds, at birth.
#[test]
fn pulses_after_events_of_neighbours_are_seen() {
    let added = 800.0 * 5e-5 * std::f64::consts::PI.sqrt();
    for n in 0..12 {
        let at = 0.003 + 0.0004 * f64::from(n);
        let end = |height: f64, first: f64, at_birth: f64| {
            let cells: String =
                (1..60).map(|i| format!(" F_v({:?}, 1)", (f64::from(i) * 0.618) % 1.0)).collect();
            let text = format!(
                "initial string: F_w(0, 2) F_v(0, {first}){cells} F_w(0, 2)\n\
                 F(u, l) < F_v(x, c) > F(v, r):\n  \
                   if x < 1 solve dx/dt = 1, dc/dt = 0.03*(l + r - 2c) + 0.1*sin(c) + {height}*exp(-((x - {at:?})/0.00005)^2)\n  \
                   if x = 1 produce F_v(0, 0.5*c + {at_birth})"
            );
            run(&text, Settings::default(), &[1.9]).unwrap_or_else(|e| panic!("{e}\n{text}")).remove(0)
        };
        let (found, reference) = (end(800.0, 1.0, 0.4), end(0.0, 1.0 + added, 0.4 + added));
        for (a, b) in found.iter().zip(&reference).filter(|(a, _)| a.1[0] > at + 0.0004) {
            // What a cell has for `at` more does so much.
            assert!((a.1[1] - b.1[1]).abs() < 0.3 * added * at, "{a:?}, not {b:?}, at {at}");
        }
    }
}

/// Two steps between two stages: each differs at the stages as much as anywhere, and only their difference is short.
#[test]
fn two_steps_that_come_and_go_are_seen_together() {
    for n in 0..40 {
        let (start, length) =
            (0.5 + (f64::from(n) * 7.31) % 8.0, [1.0, 0.4, 0.1, 0.03, 0.003][n as usize % 5]);
        // Far from a short one, rates are the rounding of their terms.
        let (end, edge) = (start + length, length / 15.0);
        let tanh = format!("tanh((t - {start:?})/{edge:?}) - tanh((t - {end:?})/{edge:?})");
        let models = [
            (format!("initial string: A(0)\nA(x): solve dx/dt = {tanh}"), 2.0 * length),
            (
                format!(
                    "initial string: A(0)\nA(x): solve dx/dt = 1/(1 + exp(-(t - {start:?})/{edge:?})) - 1/(1 + exp(-(t - {end:?})/{edge:?}))"
                ),
                length,
            ),
            (
                format!(
                    "initial string: A(0)\nA(x): solve dx/dt = (1 + tanh((t - {start:?})/{edge:?}))*(1 - tanh((t - {end:?})/{edge:?}))"
                ),
                4.0 * length,
            ),
            (format!("initial string: A(0)\nA(x): solve dx/dt = exp({tanh}) - 1"), f64::NAN),
            (
                format!(
                    "initial string: B(0, 0) A(0)\nB(y, v): solve dy/dt = 0.1*y, v = {tanh}\nB(y, v) < A(x): solve dx/dt = v"
                ),
                2.0 * length,
            ),
        ];
        for (text, exact) in models {
            let exact = if exact.is_nan() {
                // A sum of the midpoints, of what is not 0 far from its edges.
                let (from, to, many) = (start - 1.0, end + 1.0, 20_000);
                let h = (to - from) / f64::from(many);
                let at = |t: f64| (((t - start) / edge).tanh() - ((t - end) / edge).tanh()).exp_m1();
                (0..many).map(|i| h * at(from + (f64::from(i) + 0.5) * h)).sum()
            } else {
                exact
            };
            for method in [Method::Auto, Method::Dopri5, Method::Radau] {
                let strings = run(&text, Settings { method, ..Settings::default() }, &[10.5]);
                let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
                let x = string.last().expect("it lives").1[0];
                assert!((x - exact).abs() < 1e-4 * exact, "{method:?}: {x}, not {exact}, of\n{text}");
            }
        }
    }
}
