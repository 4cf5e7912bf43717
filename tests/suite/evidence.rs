//! Events of integrated values: those that are found, those that do not exist, and those that are reported as undecided.

use dlsys::sim::{Error, Method, Settings};

use crate::common::{run, session};
/// The time of the first production up to a time; None if there is none.
pub fn first_event(text: &str, settings: Settings, by: f64) -> Result<Option<f64>, Error> {
    let session = session(text);
    let mut simulation = session.simulate(Settings { log: true, ..settings })?;
    simulation.pass(by)?;
    Ok(simulation.take_events().first().map(|event| event.time))
}

/// The first parameter of the last module at a time.
pub fn last_value(text: &str, at: f64) -> f64 {
    let session = session(text);
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let mut string = Default::default();
    simulation.at(at, &mut string).unwrap_or_else(|e| panic!("{text}{e}"));
    string.iter().last().expect("a module").parameters[0]
}

/// A sine in two modules, and a threshold at, above or below its greatest value.
fn sine(threshold: f64) -> String {
    format!(
        "initial string: X(0) Y(1)\nX(x) > Y(y):\n  solve dx/dt = y\n  if x = {threshold:?} produce E\n\
         X(x) < Y(y): solve dy/dt = -x\n"
    )
}

#[test]
fn what_misses_and_what_crosses_is_told_apart_beyond_the_tolerance() {
    for (method, tolerance) in [
        (Method::Auto, 1e-4),
        (Method::Auto, 1e-6),
        (Method::Auto, 1e-9),
        (Method::Dop853, 1e-6),
        (Method::Radau, 1e-6),
    ] {
        let settings = Settings { method, tolerance, ..Settings::default() };
        for power in 2..13 {
            for digit in [1.0, 3.0] {
                let gap = digit * 10f64.powi(-power);
                let certain = gap > 50.0 * tolerance;
                let doubt =
                    |outcome: &Result<Option<f64>, Error>| matches!(outcome, Err(Error::InDoubt { .. }));
                let miss = first_event(&sine(1.0 + gap), settings, 4.0);
                assert!(matches!(miss, Ok(None)) || doubt(&miss) && !certain, "{gap} {settings:?}: {miss:?}");
                let hit = first_event(&sine(1.0 - gap), settings, 4.0);
                let exact = (1.0 - gap).asin();
                // The slope there is the root of twice the gap.
                let allowed = 100.0 * tolerance / (2.0 * gap).sqrt();
                let found = matches!(hit, Ok(Some(t)) if (t - exact).abs() <= allowed.max(1e-12));
                assert!(found || doubt(&hit) && !certain, "{gap} {settings:?}: {hit:?}, not {exact}");
            }
        }
    }
}

#[test]
fn neighbours_that_equalise_never_meet() {
    for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
        for tolerance in [1e-3, 1e-6, 1e-9, 1e-11] {
            for (rate, extra) in [(1.0, ""), (0.3, " + 0.1 - 0.1*x"), (4.0, " - 0.2*x^3"), (1.0, " + sin(t)")]
            {
                let text = format!(
                    "initial string: B(0.2) C(0.8)\nB(x) > C(y): solve dx/dt = {rate}*(y - x){extra}\n\
                     B(y) < C(x):\n  solve dx/dt = {rate}*(y - x){extra}\n  if x = y produce E\n  if x - y < 0 produce G\n"
                );
                let settings = Settings { method, tolerance, ..Settings::default() };
                let found = first_event(&text, settings, 400.0);
                assert!(matches!(found, Ok(None)), "{found:?} {settings:?}\n{text}");
            }
        }
    }
}

#[test]
fn thresholds_short_of_a_limit_are_reached() {
    // x = 1 - exp(-t), and one that is approached like 1/t; limits of both are not.
    for short in [1e-2, 1e-5, 1e-8, 1e-11, 1e-14] {
        let exponential = |level: &str| {
            format!("initial string: A(0)\nA(x):\n  solve dx/dt = 1 - x\n  if x = {level} produce E")
        };
        let t =
            first_event(&exponential(&format!("1 - {short:?}")), Settings::default(), 1e3).expect("it runs");
        let exact = -f64::ln(1.0 - (1.0 - short));
        assert!(t.is_some_and(|t| (t - exact).abs() < 1e-2 * exact), "{short}: {t:?}, not {exact}");
        assert_eq!(first_event(&exponential("1"), Settings::default(), 1e3).expect("it runs"), None);
        let slow = |level: &str| {
            format!("initial string: A(0)\nA(x):\n  solve dx/dt = (1 - x)^2\n  if x = {level} produce E")
        };
        let exact = 1.0 / (1.0 - (1.0 - short)) - 1.0;
        let t = first_event(&slow(&format!("1 - {short:?}")), Settings::default(), 1e15).expect("it runs");
        assert!(t.is_some_and(|t| (t - exact).abs() < 1e-2 * exact), "{short}: {t:?}, not {exact}");
        assert_eq!(first_event(&slow("1"), Settings::default(), 1e15).expect("it runs"), None);
    }
}

#[test]
fn a_formula_of_a_neighbour_that_comes_to_rest_on_a_threshold_reaches_it() {
    let resting = "curve linear f = (0, 0) (1, 1) (2, 1) (3, 2)\ninitial string: S(0) R(0)\nS(x): solve x = f(t)\n\
                   S(y) < R(x):\n  solve dx/dt = 0.1*sin(x) + 1\n  if y >= 1 produce E(t)";
    let knots = "curve linear f = (0, 0) (1.5, 0) (3.5, 1.5)\ncurve linear g = (0, 1) (2, 0.5) (3.75, 1)\ninitial string: S(0, 0) R(0)\n\
                 S(y, z): solve y = f(t), z = g(t)\nS(y, z) < R(x):\n  solve dx/dt = 1 + 0.1*sin(x)\n  if (z >= 1 | z <= 1.5) & y = 1.5 produce E(t)";
    for (text, exact) in [(resting, 1.0), (knots, 3.5)] {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let settings = Settings { tolerance, ..Settings::default() };
            let t = first_event(text, settings, 6.0).expect("it runs").expect("it is reached");
            assert!((t - exact).abs() < 1e-9, "{t}, not {exact}, at {tolerance}\n{text}");
        }
    }
}

#[test]
fn touches_of_a_neighbours_formula_are_events_or_reported() {
    // Growth that ends on the threshold; a corner, through a value of a value; a touch that is flat; a corner of a curve, which polynomials round off.
    let cases = [
        (
            "S(0) R(0)\nS(x): solve dx/dt = if t < 1 then 6*t*(1 - t) else 0\nS(y) < R(x)",
            "1 + 0.1*sin(x)",
            "y >= 1",
            1e-6,
        ),
        (
            "S(2.4) Q(0) R(0.1)\nS(x): solve dx/dt = (if t < 1 then 0.1 else -0.1)\nS(y) < Q(w): solve w = y\nQ(y) < R(x)",
            "1",
            "y - 2.5 >= 0",
            1e-9,
        ),
        ("S(4) R(0.1)\nS(x): solve dx/dt = 12*(t - 1)^3\nS(y) < R(x)", "y - x", "y <= 1", 1e-3),
        (
            "S(0) Q(0) R(0.1)\nS(y): solve y = f(t)\nS(y) < Q(w): solve w = y\nQ(y) < R(x)",
            "x*(1 - x)",
            "y = 0",
            0.0,
        ),
    ];
    for (modules, rate, condition, slack) in cases {
        for tolerance in [1e-4, 1e-6, 1e-9] {
            let text = format!(
                "curve linear f = (0, 0.25) (1, 0) (2, 1.5)\ninitial string: {modules}:\n  solve dx/dt = {rate}\n  if {condition} produce E(t)"
            );
            let settings = Settings { tolerance, ..Settings::default() };
            match first_event(&text, settings, 6.0) {
                Ok(t) => {
                    assert!(t.is_some_and(|t| (t - 1.0).abs() <= f64::max(slack, tolerance)), "{t:?}\n{text}")
                }
                Err(error) => {
                    assert!(slack == 0.0 && matches!(error, Error::InDoubt { .. }), "{error}\n{text}")
                }
            }
        }
    }
}

#[test]
fn unknowns_are_solved_for_with_the_right_side_of_a_corner_before_anything_happens() {
    for (equation, condition, exact) in [
        ("0.1 - 0.6*p - 0.5 - 0.3*abs(p + 0.4)", "p <= -0.2", Some(-2.8 / 3.0)),
        ("0.1 - 0.6*p - 0.5 - 0.3*abs(p + 0.4)", "-0.7 < p < -0.5", None),
        ("2 - p - max(p, 0.5)", "p >= 0.2", Some(1.0)),
        ("2 - p - (if p > 0.5 then 3*(p - 0.5) else 0)", "p >= 0.2", Some(0.875)),
    ] {
        let text =
            format!("initial string: W(0)\nW(p):\n  solve 0 = {equation}\n  if {condition} produce D(p)");
        let end = run(&text, Settings::default(), &[1.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let found = (end[0][0].0 == "D").then_some(end[0][0].1[0]);
        assert_eq!(found.map(|p| (p * 1e9).round()), exact.map(|p: f64| (p * 1e9).round()), "{text}");
    }
    // In the middle of a run, and for a module that reads the unknown.
    let jump = "initial string: S(0) W(0) V(0)\nS(q): if t = 1 produce S_2(2)\nS(q) < W(p): solve 0 = q - p - max(p, 0.5)\n\
                W(q) < V(x):\n  solve dx/dt = 1 + 0.1*sin(x)\n  if q >= 1.2 produce D(q)";
    let end = run(jump, Settings::default(), &[3.0]).expect("it runs");
    assert_eq!(end[0][2].0, "V", "{end:?}");
}

/// Where an unknown passes zero, corrections of Newton's method are rounding, and halve by chance as they do at a double root.
#[test]
fn an_unknown_passes_zero_at_a_corner_of_its_equation() {
    let text = "initial string: S(0) W(0.76, 0)\nS(p): solve p = t - 1\nS(q) < W(x, p):\n\
                  solve dx/dt = 0.66 + 0.3*p*x - 0.2*x, 0 = 1.2462*(q - p) - 0.3*x - 0.5027*max(p, 0)";
    let end = run(text, Settings::default(), &[3.0]).expect("it runs");
    // Runge and Kutta's method in 300,000 steps, with p solved for by hand on each side of the corner.
    let [x, p] = [2.235_244_841_51, 1.041_698_523_38];
    let values = &end[0][1].1;
    assert!((values[0] - x).abs() < 1e-5 && (values[1] - p).abs() < 1e-5, "{values:?}");
}

#[test]
fn a_strict_condition_does_not_hold_where_its_sides_only_touch() {
    for (rate, condition) in [
        ("1", "sin(x) > 1"),
        ("1", "cos(x) < -1"),
        ("1", "1 - (t - 1)^2 > 1"),
        ("1", "cubic_growth(t, 0, 1, 1) > 1"),
        ("1", "(5 - x)^200 < 0"),
        ("cos(t)", "x > 1"),
    ] {
        let text =
            format!("initial string: R(0)\nR(x):\n  solve dx/dt = {rate}\n  if {condition} produce E(t)");
        assert_eq!(first_event(&text, Settings::default(), 10.0).expect("it runs"), None, "{text}");
    }
    // One that rises again behind a rest is met where it rises.
    let text = "curve linear f = (0, 0) (1, 1) (2, 1) (3, 2)\ninitial string: R(0)\nR(x):\n  solve x = f(t)\n  if x > 1 produce E(t)";
    let t = first_event(text, Settings::default(), 3.0).expect("it runs").expect("it is met");
    assert!((t - 2.0).abs() < 1e-9, "{t}");
}

#[test]
fn slow_decay_with_an_inflow_that_is_a_power_or_a_wave() {
    // By series in the slow rate: what is left out is below 1e-12.
    for slow in [1e-3, 1e-5, 1e-8, 1e-12] {
        for (inflow, exact) in [
            ("t^3", 2500.0 - slow * 1e5 / 20.0 + slow * slow * 1e6 / 120.0),
            ("t", 50.0 - slow * 1e3 / 6.0 + slow * slow * 1e4 / 24.0),
            ("exp(-SLOW*t)*t^2", (1e3 / 3.0) * f64::exp(-slow * 10.0)),
        ] {
            let inflow = inflow.replace("SLOW", &format!("{slow:?}"));
            let text = format!("initial string: R(0)\nR(x): solve dx/dt = -{slow:?}*x + {inflow}");
            let x = run(&text, Settings::default(), &[10.0]).expect("it runs")[0][0].1[0];
            assert!((x - exact).abs() < 1e-6 * exact, "{x}, not {exact}\n{text}");
        }
    }
    // A chain of three within a module.
    for slow in [1e-3, 1e-8] {
        let text = format!(
            "initial string: R(0, 0, 1)\nR(x, y, z): solve dx/dt = y, dy/dt = z, dz/dt = -{slow:?}*z"
        );
        let x = run(&text, Settings::default(), &[1.0]).expect("it runs")[0][0].1[0];
        assert!((x - (0.5 - slow / 6.0)).abs() < 1e-6, "{x}\n{text}");
    }
}

#[test]
fn twins_have_their_events_together_whatever_their_neighbours_are() {
    for (rate, level) in [("1 - x^3", 0.9), ("x*cos(x)", 1.4), ("1/(1 + x^2)", 2.0), ("exp(-x)", 1.1)] {
        for tolerance in [1e-4, 1e-6, 1e-9] {
            let text = format!(
                "initial string: A(0.1, 0) A(0.1, 1) D(0)\nC(b, m) < A(x, n): solve dx/dt = 0\n\
                 A(x, n) > D(z):\n  solve dx/dt = {rate}, dn/dt = z - x*n\n  if x = {level} produce C(t, n)\n\
                 A(x, n):\n  solve dx/dt = {rate}\n  if x = {level} produce C(t, n)\n\
                 A(x, n) < D(z): solve dz/dt = x - z"
            );
            let settings = Settings { tolerance, ..Settings::default() };
            let end = run(&text, settings, &[30.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
            let names: String = end[0].iter().map(|module| module.0.as_str()).collect();
            assert_eq!(names, "CCD", "{settings:?}\n{text}");
        }
    }
}

#[test]
fn kinks_between_neighbours_do_not_push() {
    // The kink is written as a difference and 0, which are small where the values are not.
    let text = "initial string: C(1.2, 0) C(0.72, 0) C(0.88, 0) C(1.53, 0) C(0.95, 0) C(0.36, 0) C(1.25, 0) C(1.31, 0) C(0.71, 0) C(1.49, 0) C(0.45, 0) C(0.12, 0) C(0.81, 0)
C(l, m) < C(x, n) > C(r, o):
  solve dx/dt = 1.67*abs(l - x) - 1.67*x + 3.4*(r - x) + 1.04*exp(-x) - 0.98*x
  if x = 0.57 & n = 0 produce C(x/2, 1) C(x/2, 1)
C(l, m) < C(x, n):
  solve dx/dt = 1.67*(l - x) + 1.04*exp(-x) - 0.98*x
  if x = 0.57 & n = 0 produce C(x/2, 1) C(x/2, 1)
C(x, n) > C(r, o):
  solve dx/dt = 3.4*(r - x) + 1.04*exp(-x) - 0.98*x
  if x = 0.57 & n = 0 produce C(x/2, 1) C(x/2, 1)
";
    let outcome = run(text, Settings::default(), &[4.0]);
    assert!(outcome.is_ok(), "{outcome:?}");
}

#[test]
fn sides_that_stay_within_the_error_get_a_warning_and_a_crossing_gets_none() {
    let remarks = |text: &str, method: Method, to: f64| -> Vec<String> {
        let session = session(text);
        let mut simulation = session.simulate(Settings { method, ..Settings::default() }).expect("it starts");
        simulation.pass(to).expect("it runs");
        simulation.remarks().into_iter().map(|remark| remark.message).collect()
    };
    let equal = "initial string: B(0.2) C(0.8)\nB(x) > C(y): solve dx/dt = y - x - 0.1*x^3\n\
                 B(y) < C(x):\n  solve dx/dt = y - x - 0.1*x^3\n  if x = y produce E\n";
    for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
        let said = remarks(equal, method, 40.0);
        assert!(
            said.len() == 1 && said[0].starts_with("B(y) < C(x) comes so near x = y by t = "),
            "{said:?}"
        );
        assert_eq!(remarks(&sine(0.9), method, 4.0), Vec::<String>::new());
        assert_eq!(remarks(&sine(0.0), method, 4.0), Vec::<String>::new());
    }
}

#[test]
fn a_module_goes_on_with_the_neighbour_that_comes_when_another_dies() {
    // x' = r - x, first with r = 0.9 + t; from 0.1 on with r = 0.3 + t, of a module that nobody has read before.
    let exact = |t: f64| {
        let first = |t: f64| 0.7 * (-t).exp() - 0.1 + t;
        let second = |t: f64| (first(0.1) + 0.6) * (0.1 - t).exp() - 0.7 + t;
        if t <= 0.1 { first(t) } else { second(t) }
    };
    for growth in ["1", "1 + 0*y*sin(t)"] {
        let text = format!(
            "initial string: A(0.6) B(0.9) B(0.3)\nA(x) > B(r): solve dx/dt = r - x\nA(x): solve dx/dt = -x\n\
             B(y):\n if y < 1 solve dy/dt = {growth}\n if y >= 1 produce ε\n"
        );
        for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
            let settings = Settings { method, tolerance: 1e-8, ..Settings::default() };
            let times = [0.05, 0.2, 0.6];
            for (t, string) in times.into_iter().zip(run(&text, settings, &times).expect("it runs")) {
                let x = string[0].1[0];
                assert!((x - exact(t)).abs() < 1e-7, "{method:?}, {growth}, {t}: {x}, not {}", exact(t));
            }
        }
    }
}

/// A condition of a production may jump where a value takes a whole number, or changes its sign: whichever way the instant of that is
/// rounded, the jump is seen.
#[test]
fn conditions_that_jump_are_seen_wherever_the_jump_is() {
    for condition in [
        "floor(x)/x >= 0.9475",
        "x - floor(x) < 0.1 & x > 0.7",
        "floor(x) - 0.1*x > 0.85",
        "x - 2*floor(x/2) < 0.3 & x > 0.8 | floor(x) > 0.5",
        "sign(x - 1) - 0.1*x > 0.5",
        "(if x < 1 then 0 else 2 - x) > 0.5",
        "ceil(-x) + 1 - 0.3*(x - 1) <= 0",
    ] {
        for rate in ["1", "1.07", "0.3 + 0*x", "0.2*x"] {
            for step in 0..40 {
                let start = 0.05 + 0.023 * f64::from(step);
                let text = format!(
                    "initial string: A({start})\nA(x):\n  solve dx/dt = {rate}\n  if {condition} produce E\n"
                );
                let exact = match rate {
                    "0.2*x" => -5.0 * start.ln(),
                    rate => (1.0 - start) / rate.trim_end_matches(" + 0*x").parse::<f64>().expect("a number"),
                };
                for method in [Method::Auto, Method::Dopri5] {
                    let settings = Settings { method, ..Settings::default() };
                    let found = first_event(&text, settings, 30.0).unwrap_or_else(|e| panic!("{text}{e}"));
                    let error = (found.unwrap_or(f64::INFINITY) - exact).abs();
                    assert!(error < 1e-4, "{found:?}, not {exact}, {method:?}, of\n{text}");
                }
            }
        }
    }
}

/// A stiff value that follows another one is where that is, at all times and not only where steps end: y = g - g'/K + O(1/K²) for
/// y' = -K (y - g(t)).
#[test]
fn stiff_values_follow_what_they_are_drawn_to_between_the_stages_of_steps() {
    for rate in [1e5, 1e6, 1e8] {
        let sine = format!("-{rate:e}*(y - sin(t)) + 0.001*sin(y)");
        let ramp = format!("-{rate:e}*(y - tanh(3*(t - 8))) + 0.001*sin(y)");
        let air = format!("{rate:e}*(x - y)");
        let alone =
            |law: &str, extra: &str| format!("initial string: B(0)\nB(y):\n  solve dy/dt = {law}\n{extra}");
        let beside = |extra: &str| {
            format!(
                "initial string: A(0) B(0)\nA(x): solve x = sin(t)\nA(x) < B(y):\n  solve dy/dt = {air}\n{extra}"
            )
        };
        let event = "  if y > 1.5 produce E\n";
        let wave: fn(f64) -> f64 = f64::sin;
        let rise: fn(f64) -> f64 = |t| (3.0 * (t - 8.0)).tanh();
        for (text, target) in [
            (alone(&sine, ""), wave),
            (alone(&sine, event), wave),
            (alone(&ramp, ""), rise),
            (alone(&ramp, event), rise),
            (beside(""), wave),
            (beside(event), wave),
        ] {
            let session = session(&text);
            let mut simulation = session.simulate(Settings::default()).expect("it starts");
            let mut string = Default::default();
            for step in 1..=40 {
                let t = 0.37 * f64::from(step);
                simulation.at(t, &mut string).unwrap_or_else(|e| panic!("{text}{e}"));
                let y = string.iter().last().expect("a module").parameters[0];
                let error = (y - target(t)).abs() - 3.0 / rate;
                assert!(error < 1e-3, "{error:.1e} at {t} of\n{text}");
            }
        }
        let peak = format!("{}  if y > 0.9999 produce E\n", beside(""));
        let found = first_event(&peak, Settings::default(), 3.0).expect("it runs");
        let exact = 0.9999f64.asin();
        assert!(found.is_some_and(|t| (t - exact).abs() < 0.01), "{found:?}, not {exact}, of\n{peak}");
    }
}

/// Conditions on one integrated value change in the order of their levels, however near these are: within a millionth of the value.
#[test]
fn levels_of_one_value_are_taken_in_their_order() {
    for width in [1e-3, 3e-6, 3e-7, 2e-8] {
        for centre in [2.495317526254918, 4.67684092234138] {
            // A triangle of area 1.
            let height = 1.0 / width;
            let text = format!(
                "initial string: A(0.21, 0)\nA(x, y): solve dx/dt = 2/(1 + x^2) + 0.1*x, \
                 dy/dt = {height}*max(0, 1 - abs(x - {centre})/{width})*(2/(1 + x^2) + 0.1*x)\n"
            );
            let end = run(&text, Settings::default(), &[10.0]).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert!((end[0][0].1[1] - 1.0).abs() < 1e-3, "{:?} of\n{text}", end[0]);
            let text = format!(
                "initial string: A(0.21)\nA(x):\n  solve dx/dt = 1 + 0.2*sin(3*x)\n  if x = {centre} & x < {} produce E\n",
                centre + width
            );
            assert!(first_event(&text, Settings::default(), 10.0).expect("it runs").is_some(), "{text}");
        }
    }
}

/// The outline of a circle as a value that a neighbour reads: it begins and ends like a root, in less time than a step.
#[test]
fn a_neighbour_follows_a_value_that_begins_and_ends_like_a_root() {
    for width in [1e-2, 1e-4, 7e-6] {
        let text = format!(
            "initial string: A(0.3, 0) B(0)\n\
             A(x, v): solve dx/dt = 1 + 0.2*sin(3*x), v = sqrt(max(0, {width}^2 - (x - 3)^2))/{width}\n\
             A(x, v) < B(y): solve dy/dt = v*(1 + 0.2*sin(3*x))/{width}\n"
        );
        let (y, exact) = (last_value(&text, 5.0), std::f64::consts::FRAC_PI_2);
        assert!((y - exact).abs() < 1e-3, "{y}, not {exact}, of\n{text}");
    }
}

/// What is left of a value that was large has all its digits.
#[test]
fn what_is_left_of_a_large_value_has_its_digits() {
    let falls = "initial string: A(0)\nA(v): solve v = exp(50 - t)\n";
    for at in [40.0, 48.0, 50.0, 70.0f64] {
        let (found, exact) = (last_value(falls, at), (50.0 - at).exp());
        assert!((found - exact).abs() < 1e-9 * exact, "{found}, not {exact}");
    }
    for (law, start, level, at) in [
        // x = -sqrt(2) coth(-sqrt(2) t), and so on.
        ("2 - x^2", "1e18", 1.5, (1.5f64 / 2f64.sqrt()).recip().atanh() / 2f64.sqrt()),
        ("x*(1 - x/3)", "1e18", 3.01, (3.01f64 / 0.01).ln()),
        ("2 - x", "1e18", 2.5, (1e18f64 / 0.5).ln()),
    ] {
        let text = format!(
            "initial string: A({start})\nA(x):\n  solve dx/dt = {law}\n  if x <= {level} produce B\n"
        );
        let found = first_event(&text, Settings::default(), 100.0).expect("it runs");
        assert!(found.is_some_and(|t| (t - at).abs() < 1e-5 * at), "{found:?}, not {at}, of\n{text}");
    }
    for law in [
        "logistic(t, 1e13, 1, 1e-12)",
        "1e13*richards(t, 5, 1, 0.1, 20)/5",
        "1e13/7*richards(age, 7, 1, 0.01, 18)",
    ] {
        let v = last_value(&format!("initial string: A(0)\nA(v): solve v = {law}\n"), 0.0);
        assert!((v / 1e13 - 1.0).abs() < 1e-12, "{v} of {law}");
    }
    let decays = "initial string: A(1e17)\nA(x): solve dx/dt = -x\n";
    assert!((last_value(decays, 40.0) / (1e17 * (-40f64).exp()) - 1.0).abs() < 1e-9);
    for (law, level, exact) in [
        ("solve x = (age + 1e-6)^-3", 0.5, 2f64.cbrt() - 1e-6),
        ("solve x = 1/(age + 1e-9)^2", 0.5, 2f64.sqrt() - 1e-9),
        ("solve x = exp(50 - t)", 1e-3, 50.0 - 1e-3f64.ln()),
    ] {
        let text = format!("initial string: A(0)\nA(x):\n  {law}\n  if x <= {level} produce B\n");
        let found = first_event(&text, Settings::default(), 100.0).expect("it runs");
        assert!(found.is_some_and(|t| (t - exact).abs() < 1e-6), "{found:?}, not {exact}, of\n{text}");
    }
}

/// A steep formula whose condition changes goes on from what it is, not from a rounding of the instant of the change.
#[test]
fn a_steep_formula_leaves_no_residue_behind_a_switch() {
    for (law, at) in [("6.8e6*exp(-abs((t - 5.565)/1.48e-7))", 20.0), ("1e13*max(0, 5.56 - t)", 6.0)] {
        let v = last_value(&format!("initial string: A(0)\nA(v): solve v = {law}\n"), at);
        assert_eq!(v, 0.0, "{law}");
        let seen = last_value(
            &format!(
                "initial string: A(0) B(0)\nA(v): solve v = {law}\nA(v) < B(y): solve dy/dt = 1 + v - v\n"
            ),
            at,
        );
        assert!((seen - at).abs() < 1e-4, "{seen} for {at}: {law}");
    }
}

/// After a pole, at which its sides are as large as numbers can be, a condition changes where its sides meet, however soon that is.
#[test]
fn conditions_that_come_back_after_a_pole_are_seen() {
    let after = |condition: &str, at| {
        last_value(&format!("initial string: A(0)\nA(y): solve dy/dt = if {condition} then 1 else 0\n"), at)
    };
    // False from the pole at 2 to 2.2.
    assert!((after("1/(2 - t) > -5", 6.0) - 5.8).abs() < 1e-5);
    // False from the pole at π/2 to atan(-2) + π.
    let exact = 3.0 - (std::f64::consts::FRAC_PI_2 - 2f64.atan());
    assert!((after("tan(t) > -2", 3.0) - exact).abs() < 1e-5, "{}", after("tan(t) > -2", 3.0));
}

/// A module that is born on the edge of a condition, and does not move at once, leaves it once: however long the difference is rounding.
#[test]
fn a_module_born_on_an_edge_leaves_it_once_though_it_does_not_move_at_once() {
    for (rate, at) in [
        ("5*age", 15.0),
        ("5*age^2", 15.0),
        ("3*sin(age)", 3.0),
        ("5*t", 15.0),
        ("t^3", 15.0),
        ("1 - cos(2*age)", 15.0),
        ("exp(age) - 1", 3.0),
        ("1e-3*age", 30.0),
    ] {
        for (low, high, window) in [
            (2.5, 2.6, "x^2 - 5.1*x + 6.5"),
            (0.7, 0.9, "x^2 - 1.6*x + 0.63"),
            (0.7, 0.9, "abs(x - 0.8) - 0.1"),
            (-0.3, 0.1, "x^2 + 0.2*x - 0.03"),
        ] {
            for born in [low, high] {
                let text = format!(
                    "initial string: A({born}, 0, {side})\nA(x, n, s):\n  solve dx/dt = {rate}\n  \
                     if {window} < 0 & s = 0 produce A(x, n + 1, 1)\n  if {window} > 0 & s = 1 produce A(x, n + 1, 0)\n",
                    side = u8::from(born == high),
                );
                let states = run(&text, Settings::default(), &[at]).unwrap_or_else(|e| panic!("{text}{e}"));
                let wanted = if born == high { 1.0 } else { 2.0 };
                assert_eq!(states[0][0].1[1], wanted, "{states:?} of\n{text}");
            }
        }
    }
}
