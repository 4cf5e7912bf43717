//! Corners and jumps: conditions inside equations, values that come to rest on a boundary, knots of curves, modules that
//! get several rules at one instant. Each case has an exact answer; most of them once failed.

use dlsys::sim::{Method, Scheduler, Settings};

use crate::common::run;

/// By every way of solving: parameters of all modules at a time, within 100 tolerances.
fn reaches(text: &str, t: f64, wanted: &[f64]) {
    let auto = Settings::default();
    let ways = [
        auto,
        Settings { scheduler: Scheduler::Global, ..auto },
        Settings { method: Method::Dop853, tolerance: 1e-9, ..auto },
        Settings { method: Method::Radau, ..auto },
    ];
    for settings in ways {
        let found = run(text, settings, &[t]).unwrap_or_else(|e| panic!("{e}, {settings:?}\n{text}"));
        let found: Vec<f64> = found[0].iter().flat_map(|module| module.1.iter().copied()).collect();
        assert_eq!(found.len(), wanted.len(), "{found:?}, {settings:?}\n{text}");
        for (x, y) in found.iter().zip(wanted) {
            let allowed = 100.0 * settings.tolerance * y.abs().max(1.0);
            assert!((x - y).abs() <= allowed, "{found:?}, not {wanted:?}, {settings:?}\n{text}");
        }
    }
}

/// A module alone, one parameter that begins at 0.
fn rate(before: &str, rate: &str, t: f64, wanted: f64) {
    reaches(&format!("{before}\ninitial string: A(0)\nA(x): solve dx/dt = {rate}"), t, &[wanted]);
}

#[test]
fn a_motion_begins_once_however_many_rules_an_instant_brings() {
    let grown = |t: f64| 2.0 * ((0.331_f64 / 2.0).tan() * (0.445 * t).exp()).atan();
    let rule = "solve dx/dt = 0.445*sin(x)";
    reaches(
        &format!("initial string: G(0.331) A(3)\nA(n): if n > 0 produce H(n)\nG(x) > H(y): {rule}"),
        2.0,
        &[grown(2.0), 3.0],
    );
    reaches(
        &format!(
            "initial string: G(0.331) A(3)\nA(n): if n > 0 produce G(n)\nG(x) > G(y): {rule}\nG(x): solve dx/dt = 0.1*x"
        ),
        2.0,
        &[grown(2.0), 3.0 * 0.2_f64.exp()],
    );
    reaches(
        &format!(
            "initial string: S(0) G(0.331)\nS(n): if t = 1 produce A(n)\nA(n): produce H(n)\nA(n) < G(x): solve dx/dt = sin(x)\nH(n) < G(x): {rule}"
        ),
        3.0,
        &[0.0, grown(2.0)],
    );
}

#[test]
fn floors_are_whole_numbers_where_they_come_to_rest() {
    rate("", "floor(min(t, 2))", 4.0, 5.0);
    rate("", "-ceil(max(-t, -2))", 4.0, 5.0);
    rate("const a = [1, 2, 3]", "a[min(t, 2)]", 4.0, 9.0);
    rate("const a = [1, 2, 3]\ncurve linear g = (0, 0) (2, 2)", "a[g(t)]", 4.0, 9.0);
    reaches(
        "const a = [1, 2, 3]\ninitial string: A(1) B(0)\nA(x): solve dx/dt = 0\nA(x) < B(y): solve dy/dt = a[min(4t, 2)]",
        3.0,
        &[1.0, 8.25],
    );
    reaches(
        "initial string: A(0.427, 0.611)\nA(y, x): solve dx/dt = 0.1*floor(4x + y) + 0.1",
        1.0,
        &[0.427, 1.027],
    );
}

/// An argument that is itself a step does not pass a whole number, it jumps to it.
#[test]
fn steps_of_steps_jump_with_them() {
    let v = "const v = [1, 2.5, -3, 4]\n";
    rate(v, "v[floor(t)]", 3.0, 0.5);
    rate(v, "v[floor(2t)/2]", 3.0, 0.5);
    rate(v, "v[min(floor(t), 2)]", 3.0, 0.5);
    rate(v, "v[if t < 1 then 0 else 1]", 3.0, 6.0);
    rate("", "floor(floor(t))", 3.0, 3.0);
    rate("", "floor(ceil(t))", 3.0, 6.0);
    rate("", "floor(if t < 1 then 0 else 1)", 3.0, 2.0);
    for (index, t, expected) in [
        ("n", 0.5, 1.0),
        ("n", 1.5, 2.5),
        ("n", 2.5, -3.0),
        ("3 - n", 0.5, 4.0),
        ("3 - n", 1.5, -3.0),
        ("n + 1e-9", 1.5, 2.5),
        ("n + 0.5", 3.5, 4.0),
    ] {
        let model = format!("{v}initial string: A(0, v[0])\nA(n, s): solve n = floor(t), s = v[{index}]");
        reaches(&model, t, &[f64::floor(t), expected]);
    }
}

#[test]
fn what_jumps_may_be_compared() {
    rate("", "if floor(t) = 1 then 2 else 0.5", 4.0, 3.5);
    rate("", "if floor(t) > 1 then 2 else 0.5", 4.0, 5.0);
    rate("", "match floor(t) case 0: 1 case 1: 2 else 0.5", 4.0, 4.0);
    rate("", "if sign(t - 1) = 1 then 2 else 0.5", 4.0, 6.5);
    for (clauses, wanted) in [
        ("if floor(t) = 1 solve dx/dt = 1\n  if floor(t) != 1 solve dx/dt = 2", 7.0),
        ("if floor(t) <= 1 solve dx/dt = 1\n  if floor(t) > 1 solve dx/dt = 2", 6.0),
    ] {
        reaches(&format!("initial string: A(0)\nA(x):\n  {clauses}"), 4.0, &[wanted]);
    }
    // The instant of a production is that of the jump.
    reaches("initial string: A(0)\nA(x): solve dx/dt = 1\n  if floor(t) > 1 produce B(t)", 4.0, &[2.0]);
    reaches("initial string: A(0)\nA(x): solve dx/dt = 0.5\n  if floor(x) > 2 produce B(t)", 7.0, &[6.0]);
    reaches("initial string: A(0)\nA(x): solve x = floor(t)", 4.0, &[4.0]);
}

#[test]
fn curves_in_conditions_pass_their_knots() {
    // Whatever rounding makes of the instant of a knot.
    for knot in (0..40).map(|i| 2.0 + 0.025 * f64::from(i)) {
        let curve = format!("curve linear g = (0, 1) ({knot}, 0.4) (3, 0)");
        reaches(
            &format!("{curve}\ninitial string: B(0)\nB(y): solve y = if 0.5 > g(t) then 1 else 2"),
            2.995,
            &[1.0],
        );
        reaches(
            &format!(
                "{curve}\ninitial string: C(0.1, 0.2)\nC(x, y): solve dx/dt = 0.2, 0 = y - sin(g(t)) for y"
            ),
            4.0,
            &[0.9, 0.0],
        );
    }
}

#[test]
fn what_is_undefined_beyond_a_corner_is_not_asked_for_there() {
    let falling = |y: &str| format!("initial string: A(0.5, 0)\nA(x, y): solve dx/dt = -0.3, {y}");
    reaches(&falling("y = max(x, 0)^1.5\n  if y = 7 produce B"), 3.0, &[-0.4, 0.0]);
    reaches(&falling("y = sqrt(abs(x))"), 3.0, &[-0.4, 0.4_f64.sqrt()]);
    let integral = (0.5_f64.powf(1.5) + 0.4_f64.powf(1.5)) / 1.5 / 0.3;
    reaches(&falling("dy/dt = sqrt(abs(x))"), 3.0, &[-0.4, integral]);
    reaches(
        "initial string: A(0.5) B(0)\nA(x): solve dx/dt = -0.3\nA(x) < B(y): solve y = sqrt(max(x, 0))",
        3.0,
        &[-0.4, 0.0],
    );
    // Without bound on the way there: no polynomial follows that, but a formula does.
    let text = falling("y = if x > 0 then ln(x) else 1");
    let states = run(&text, Settings::default(), &[1.0, 3.0]).expect("it runs");
    assert_eq!((states[0][0].1[1], states[1][0].1[1]), (states[0][0].1[0].ln(), 1.0));
    // Undefined as written: an error, not an event.
    let error = run(&falling("y = sqrt(x)\n  if y = 7 produce B"), Settings::default(), &[3.0]);
    assert!(error.expect_err("there is no y").to_string().contains("not finite"));
}

#[test]
fn values_follow_one_another_off_a_boundary() {
    let edge = "S(x): solve dx/dt = -1\nS(l) < B(x, y): solve x = l, dy/dt = x
B(l, m) < B(x, y):\n  if x < 1 solve x = l, dy/dt = 1\n  if x >= 1 solve x = l, dy/dt = 2";
    let string = format!("initial string: S(1) {}", "B(1, 0) ".repeat(40));
    let mut wanted = vec![0.5, 0.5, 0.375];
    wanted.extend([0.5, 0.5].repeat(39));
    reaches(&format!("{string}\n{edge}"), 0.5, &wanted);
}

#[test]
fn equations_are_solved_at_zero_and_across_it() {
    for (equation, from, wanted) in [
        ("y^3 + y", 0.182, 0.0),
        ("exp(y) - 1", 1.0, 0.0),
        ("sin(y)", 0.2, 0.0),
        ("y^3 + y - 0.001", 1.0, 0.000999999),
    ] {
        reaches(&format!("initial string: C({from})\nC(y): solve 0 = {equation} for y"), 1.0, &[wanted]);
    }
    let crossing = "initial string: C(1, 1)\nC(x, y): solve dx/dt = -1, 0 = y + y^3 - x - x^3 for y";
    reaches(crossing, 1.0, &[0.0, 0.0]);
    reaches(crossing, 2.5, &[-1.5, -1.5]);
    // What has no equation stands still, and may be read by one.
    reaches("initial string: C(0.5, 1)\nC(y, n): solve 0 = y - n for y", 1.0, &[1.0, 1.0]);
}

#[test]
fn what_decays_to_zero_across_corners_comes_to_rest() {
    for (text, t) in [
        (
            "initial string: C(0.5) D(0.2)\nC(x) > D(y): solve dx/dt = 100*(y - 2*x)\nC(x) < D(y): solve dy/dt = 100*(x - 2*y) - 0.1*abs(y)",
            4.0,
        ),
        (
            "initial string: C(0.5, 0.7)\nC(x, y): solve dx/dt = 1000*(sin(0.7*y) - x), dy/dt = 1000*(x/(1 + abs(x))/2 - y)",
            1.0,
        ),
    ] {
        for method in [Method::Auto, Method::Dopri5, Method::Radau] {
            let states = run(text, Settings { method, ..Settings::default() }, &[t]).expect("it runs");
            assert!(
                states[0].iter().flat_map(|module| &module.1).all(|x| x.abs() < 1e-9),
                "{states:?}\n{text}"
            );
        }
    }
    // Neighbours that approach each other.
    let text =
        "initial string: A(0.65) A(0.765)\nA(l) < A(x): solve dx/dt = abs(x - l)/(1 + abs(l)) - 0.462*x";
    let states = run(text, Settings::default(), &[20.0]).expect("it runs");
    // x' = (0.65 - x)/1.65 - 0.462 x in the end.
    let rest = (0.65 / 1.65) / (1.0 / 1.65 + 0.462);
    assert!((states[0][1].1[0] - rest).abs() < 1e-4, "{states:?}");
}

/// What has been searched, or the step of somebody else, may end at that instant, too.
#[test]
fn at_the_instant_of_an_event_its_successor_is_there() {
    let meets = "A(x, n):\n  solve x = age\n  if x = 3 produce C(t)\n  if t = n produce C(t)";
    reaches(&format!("initial string: A(0, 2) A(0, 1)\n{meets}"), 1.0, &[1.0, 2.0, 1.0]);
    reaches(&format!("initial string: A(0, 7) A(0, 5) A(0, 1)\n{meets}"), 5.0, &[3.0, 3.0, 1.0]);
    reaches(
        &format!("initial string: A(0, 2) A(0, 1) S(1)\n{meets}\nS(n) : * -> S(n + 1)"),
        1.0,
        &[1.0, 2.0, 1.0, 2.0],
    );
    reaches("initial string: M(0)\nM(s): solve s = floor(t)", 1.0, &[1.0]);
    let rare = "A(n):\n  if t >= 1 + n produce ε\n  at rate 0.01*t produce B";
    reaches(&format!("initial string: A(1) A(0)\n{rare}"), 1.0, &[1.0]);
    // Steps of a length that is given end there.
    let steps = Settings { method: Method::Rk4, step_size: 0.125, ..Settings::default() };
    let text = "initial string: X(0) A(1)\nX(x): solve dx/dt = cos(x)\nA(n): if t = n produce ε";
    assert_eq!(run(text, steps, &[1.0]).expect("it runs")[0].len(), 1);
}

/// Values that no equation moves are compared to the last bit, whichever way a condition is written; values that come of
/// equations with a tolerance.
#[test]
fn conditions_over_values_that_nothing_moves_are_exact() {
    let text = "initial string: U(0) G(0) E(0)\nU(x) : x < 1 -> U(x + 0.1)\nG(x) : 1 - x > 0 -> G(x + 0.1)\n\
        E(x) : x = 0.3 -> E(9)\nE(x) -> E(x + 0.1)\n";
    let strings = crate::common::run(text, Settings::default(), &[20.0]).expect("it runs");
    // Ten times 0.1 is less than 1, and three times 0.1 is not 0.3, as for every other program.
    let sum: f64 = (0..11).fold(0.0, |x, _| x + 0.1);
    let parameters: Vec<f64> = strings[0].iter().map(|(_, p)| p[0]).collect();
    assert_eq!(parameters[..2], [sum, sum]);
    assert!(parameters[2] < 3.0, "{}", parameters[2]);
    // What has grown, and what is handed on of it, has the error of an integration.
    let grown = "initial string: C(0)\nC(x): solve dx/dt = 0.1\nC(x) : x >= 0.3 -> D(x, 0)\n\
        D(x, n) : x = 0.3 & n = 0 -> D(x, 1)\n";
    let strings = crate::common::run(grown, Settings::default(), &[4.0]).expect("it runs");
    assert_eq!(strings[0][0].0, "D");
    assert_eq!(strings[0][0].1[1], 1.0);
}
