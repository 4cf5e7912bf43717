//! What happens when: events, contexts, changes of equations, errors of a run. Small models, exact answers.
//!
//! Ids such as A02 refer to the collection of hard cases from which an answer was taken.

use dlsys::sim::{Error, Method, Settings};
use proptest::prelude::*;

use crate::common::{Plain, repository, run, show};

/// Runs with every method that is exact enough; all must show the same.
fn expect(text: &str, states: &[(f64, &str)]) {
    let times: Vec<f64> = states.iter().map(|s| s.0).collect();
    for settings in [
        Settings { tolerance: 1e-11, ..Settings::default() },
        Settings { method: Method::Rk4, step_size: 1.0 / 512.0, ..Settings::default() },
    ] {
        let ours = run(text, settings, &times).unwrap_or_else(|e| panic!("{e}\n{text}"));
        for ((t, wanted), state) in states.iter().zip(&ours) {
            assert_eq!(&show(state), wanted, "at t = {t} with {:?}\n{text}", settings.method);
        }
    }
}

fn fails(text: &str, until: f64) -> Error {
    run(text, Settings { max_modules: 100_000, ..Settings::default() }, &[until]).expect_err("fails")
}

#[test]
fn an_event_at_a_frame_shows_the_successor() {
    // A03: ten frames of 0.1; A01: logistic growth, whose period is ln 2.
    let ramp =
        "initial string: A(0)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce B(x)\nB(x): solve dx/dt = 0";
    let tenth = 0.1;
    expect(ramp, &[(9.0 * tenth, "A(0.9)"), (1.0, "B(1)"), (10.0 * tenth, "B(1)")]);
    let apex = "initial string: A(1)\nA(x): if x < 2 solve dx/dt = 2*(1 - x/3)*x\n if x = 2 produce A(x/2)";
    let third = 3.0 * std::f64::consts::LN_2;
    expect(apex, &[(third - 1e-10, "A(2)"), (third + 1e-10, "A(1)")]);
}

#[test]
fn birth_on_the_boundary() {
    // A02: it must divide at t = 0, once.
    let cell = "initial string: C(1)\nC(x): if x < 1 solve dx/dt = 0.01*x\n if x = 1 produce C(0.37) C(0.63)";
    expect(
        cell,
        &[(0.0, "C(0.37) C(0.63)"), (46.0, &show(&[c(0.37 * 0.46f64.exp()), c(0.63 * 0.46f64.exp())]))],
    );
    // A ball thrown up from the floor is legal; it comes down later, and bounces.
    let ball = "initial string: B(0, 1)\nB(x, v):\n if x > 0 solve dx/dt = v, dv/dt = -2\n if x = 0 & v < 0 produce D(v)\nD(v): if t < 0 solve dv/dt = 0\n if t >= 0 produce E(v)\nE(v): solve dv/dt = 0";
    expect(ball, &[(0.5, "B(0.25, 0)"), (1.0, "E(-1)")]);
}

fn c(x: f64) -> Plain {
    ("C".to_owned(), vec![x])
}

#[test]
fn touching_counts_once_and_nearly_touching_does_not() {
    // B01: x = 2t - t², which touches 1 at t = 1.
    let graze = |level: &str| {
        format!(
            "initial string: A(0, 2) N(0)\nA(x, v):\n solve dx/dt = v, dv/dt = -2\n if x = {level} produce B(x)\nB(x): solve dx/dt = 1\nN(n): solve dn/dt = 1"
        )
    };
    let touched = run(&graze("1"), Settings::default(), &[0.9, 2.0]).expect("runs");
    assert_eq!(show(&touched[0]), "A(0.99, 0.2) N(0.9)");
    let (name, parameters) = &touched[1][0];
    assert!(name == "B" && (parameters[0] - 2.0).abs() < 1e-6, "{touched:?}");
    // However the double root is written.
    for condition in
        ["(x - 1)^2 = 0", "(x - 1)*(x - 1) = 0", "-(x - 1)^2 >= 0", "x*x - 2x + 1 = 0", "x*(2 - x) = 1"]
    {
        let text = format!("initial string: A(0)\nA(x):\n solve dx/dt = 1\n if {condition} produce B(t)");
        let t = time_of_event(&text, 2.0).unwrap_or_else(|| panic!("{condition}"));
        assert!((t - 1.0).abs() < 1e-6, "{condition}: {t}");
    }
    // B03: a gap of 2^-40 is a gap.
    assert_eq!(
        show(&run(&graze("1 + 2^-40"), Settings::default(), &[2.0]).expect("runs")[0]),
        "A(0, -2) N(2)"
    );
    // B02: a pair of crossings 1.9e-6 apart; the first counts.
    let pair = run(&graze("1 - 2^-40"), Settings::default(), &[1.5]).expect("runs");
    let (_, parameters) = &pair[0][0];
    let exact = 1.0 - 2f64.powi(-40) + 1.5 - 0.999_999_046_325_683_6;
    assert!((parameters[0] - exact).abs() < 1e-9, "{pair:?}");
}

#[test]
fn growth_that_ends_on_its_threshold_arrives() {
    // B05: the cubic growth function of section 6 of the paper.
    let text = "def G(T, τ) = if τ <= T then 6/T^2*(1 - τ/T)*τ else 0\ninitial string: A(0)\nA(x): if x < 1 solve dx/dt = G(1, age)\n if x = 1 produce B(x)\nB(x): solve dx/dt = 0";
    let strings = run(text, Settings::default(), &[0.999, 1.001, 2.0]).expect("runs");
    assert_eq!(strings[0][0].0, "A");
    assert_eq!((show(&strings[1]), show(&strings[2])), ("B(1)".to_owned(), "B(1)".to_owned()));
}

#[test]
fn a_limit_is_approached_and_never_reached() {
    // E01, for a condition and for a domain; also written out in other ways.
    for rate in ["2*(1 - x/3)*x", "2*x - 2*x^2/3", "2*x*(3 - x)/3"] {
        let text = format!("initial string: A(1)\nA(x): if x < 3 solve dx/dt = {rate}\n if x = 3 produce B");
        expect(&text, &[(20.0, "A(3)"), (300.0, "A(3)")]);
        let late = run(&text, Settings::default(), &[1e6]).expect("runs");
        assert!(late[0][0].0 == "A" && (late[0][0].1[0] - 3.0).abs() < 1e-5, "{late:?}");
    }
    let decay = "initial string: A(1)\nA(x): if x > 0 solve dx/dt = -x\n if x = 0 produce B";
    let late = run(decay, Settings::default(), &[2000.0]).expect("runs");
    assert!(late[0][0].0 == "A" && late[0][0].1[0].abs() < 1e-6, "{late:?}");
}

#[test]
fn two_crossings_within_a_step_are_seen() {
    // C01: x = 1 - 1000 (t - 5)², exact for any method of order 2, so that steps grow to the end.
    let text = "initial string: A(-24999)\nA(x):\n solve dx/dt = -2000*(t - 5)\n if x = 0.9999 produce B(t)";
    let strings = run(text, Settings::default(), &[10.0]).expect("runs");
    assert!((strings[0][0].1[0] - 4.999_683_772_233_983).abs() < 1e-9, "{strings:?}");
    // C03: a pulse of a tenth in a hundred.
    let pulse = "initial string: A(0)\nA(x):\n solve dx/dt = if 20 < t < 20.1 then 10000 else 0\n if x = 500 produce B(t)";
    let strings = run(pulse, Settings::default(), &[100.0]).expect("runs");
    assert!((strings[0][0].1[0] - 20.05).abs() < 1e-12, "{strings:?}");
    // G07: nothing is defined beyond the root.
    let edge = "initial string: A(1)\nA(x):\n solve dx/dt = -1\n if sqrt(x) = 0.1 produce B(t)";
    let strings = run(edge, Settings::default(), &[0.995]).expect("runs");
    assert!((strings[0][0].1[0] - 0.99).abs() < 1e-12, "{strings:?}");
}

#[test]
fn simultaneous_events_read_the_values_before_them() {
    // D02: each production reads the other's value at the limit from the left.
    let text = "initial string: A(0) B(0)\nA(x) > B(y):\n if x < 1 solve dx/dt = 1\n if x = 1 produce A2(y)\nA(x) < B(y):\n if y < 2 solve dy/dt = 2\n if y = 2 produce B2(x)\nA2(x): solve dx/dt = 0\nB2(x): solve dx/dt = 0";
    expect(text, &[(1.0, "A2(2) B2(1)")]);
    // D01: 2^12 cells divide in one instant.
    let cells = "initial string: C(0.5)\nC(x): if x < 1 solve dx/dt = x\n if x = 1 produce C(0.5) C(0.5)";
    let t = 12.0 * std::f64::consts::LN_2;
    let strings = run(cells, Settings { tolerance: 1e-11, ..Settings::default() }, &[t - 1e-9, t + 1e-9])
        .expect("runs");
    assert_eq!((strings[0].len(), strings[1].len()), (2048, 4096));
}

#[test]
fn cascades_end_or_are_errors() {
    // D06: a thousand productions in one instant.
    let finite = "initial string: A(1000, 1)\nA(n, x): if x >= 1 & n > 0 produce A(n - 1, x)";
    expect(finite, &[(0.0, "A(0, 1)")]);
    // D07: without end.
    let endless = "initial string: A(1)\nA(x): if x >= 1 produce B(x)\nB(x): if x >= 1 produce A(x)";
    match fails(endless, 1.0) {
        Error::Cascade { site, .. } => assert!(site.time == 0.0 && ["A(1)", "B(1)"].contains(&&*site.module)),
        other => panic!("{other}"),
    }
    // A condition that goes on holding on the successor is a cascade.
    let stuck = "initial string: B(0, -1)\nB(x, v):\n solve dx/dt = v\n if x = 0 produce B(x, -v/2)";
    assert!(matches!(fails(stuck, 1.0), Error::Cascade { .. }));
    let doubling = "initial string: A\nA: produce A A";
    assert!(matches!(fails(doubling, 1.0), Error::TooManyModules { .. }));
}

#[test]
fn events_that_pile_up_are_an_error_at_the_right_time() {
    // F01: t_n = 2 - 2^(1-n).
    let halving = "initial string: A(0, 1)\nA(x, s): if x < s solve dx/dt = 1\n if x = s produce A(0, s/2)";
    expect(halving, &[(1.998, "A(0.00190625, 0.001953125)")]);
    match fails(halving, 3.0) {
        Error::Zeno { site } => assert!((site.time - 2.0).abs() < 1e-9, "{site:?}"),
        other => panic!("{other}"),
    }
    // F02: a ball that loses half its speed at each bounce.
    let ball = "initial string: B(10, 0)\nB(x, v):\n if x > 0 solve dx/dt = v, dv/dt = -9.81\n if x = 0 & v < 0 produce B(0, -v/2)";
    for (restitution, end) in [(0.05, 1.578_142_399_0), (0.9, 27.129_019_335_6), (0.99, 284.140_781_461)] {
        let text = ball.replace("-v/2", &format!("-{restitution}*v"));
        match fails(&text, 400.0) {
            Error::Zeno { site } => assert!((site.time - end).abs() < 1e-8, "{site:?}"),
            other => panic!("{other}"),
        }
    }
    match fails(ball, 5.0) {
        Error::Zeno { site } => assert!((site.time - 4.283_529_368_781_193).abs() < 1e-6, "{site:?}"),
        other => panic!("{other}"),
    }
}

#[test]
fn a_rule_can_switch_between_equations() {
    let text = "initial string: A(0)\nA(x):\n if x < 1 solve dx/dt = 1\n if x >= 1 solve dx/dt = 0.5";
    expect(text, &[(0.5, "A(0.5)"), (1.0, "A(1)"), (3.0, "A(2)")]);
    // And back, and without losing order at the switch: x'' = -x by pieces.
    let bang = "initial string: A(1, 0)\nA(x, v):\n if x > 0 solve dx/dt = v, dv/dt = -1\n if x < 0 solve dx/dt = v, dv/dt = 1";
    let period = 4.0 * 2f64.sqrt();
    expect(bang, &[(period, "A(1, 0)")]);
    // Discontinuous right-hand sides inside one equation are located as well.
    let inside = "initial string: A(0)\nA(x): solve dx/dt = if x < 1 then 2 else 0.25";
    expect(inside, &[(0.5, "A(1)"), (1.5, "A(1.25)")]);
    let kink = "initial string: A(-1)\nA(x): solve dx/dt = 1 + abs(x) + max(x, 0) - min(x, 0) + sign(x)";
    let strings = run(kink, Settings { tolerance: 1e-10, ..Settings::default() }, &[10.0]);
    assert!(strings.is_ok());
}

#[test]
fn equations_that_push_against_each_other_are_an_error() {
    // F03
    for text in [
        "initial string: A(1)\nA(x):\n if x > 0 solve dx/dt = -1\n if x < 0 solve dx/dt = 1",
        "initial string: A(1)\nA(x): solve dx/dt = if x > 0 then -1 else 1",
    ] {
        match fails(text, 2.0) {
            Error::Chattering { site } => assert!((site.time - 1.0).abs() < 1e-9),
            other => panic!("{other}"),
        }
    }
}

#[test]
fn a_module_outside_its_domain_is_an_error_with_its_place() {
    let text = "initial string: A(0) B\nA(x):\n if x < 1 solve dx/dt = 1\n if x = 2 produce B\nB: produce ε";
    match fails(text, 5.0) {
        Error::OutsideDomain { site, failing, .. } => {
            assert!((site.time - 1.0).abs() < 1e-12 && site.module.starts_with("A("), "{site:?}");
            assert_eq!(site.lineage.to_string(), "1");
            assert_eq!(failing.len(), 1);
        }
        other => panic!("{other}"),
    }
    let born = "initial string: A(3)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce ε";
    assert!(matches!(fails(born, 1.0), Error::OutsideDomain { site, .. } if site.time == 0.0));
}

#[test]
fn values_that_are_not_finite_are_errors() {
    // G03: e^t overflows at 709.78; stages of a step do so a little earlier.
    match fails("initial string: A(1)\nA(x): solve dx/dt = x", 800.0) {
        Error::NotFinite { site, what } => {
            assert!((site.time - 709.78).abs() < 3.0 && what.contains('x'), "{site:?} {what}");
        }
        other => panic!("{other}"),
    }
    match fails("initial string: A(1)\nA(x): solve dx/dt = x^2", 2.0) {
        Error::StepTooSmall { site } | Error::NotFinite { site, .. } => {
            assert!((site.time - 1.0).abs() < 1e-6)
        }
        other => panic!("{other}"),
    }
    assert!(matches!(fails("initial string: A(0)\nA(x): produce B(1/x)", 1.0), Error::NotFinite { .. }));
}

#[test]
fn conditions_without_an_equality_are_met_when_they_become_true() {
    let text = "initial string: A(0)\nA(x):\n solve dx/dt = 1\n if x > 1 produce B(x)\nB(x): solve dx/dt = 0";
    expect(text, &[(0.9, "A(0.9)"), (1.1, "B(1)")]);
    let either = "initial string: A(0, 5)\nA(x, y):\n solve dx/dt = 1, dy/dt = -1\n if !(x < 3) | y <= 3 produce B(x, y)\nB(x, y): solve dx/dt = 0";
    expect(either, &[(1.9, "A(1.9, 3.1)"), (2.0, "B(2, 3)")]);
    let unequal = "initial string: A(1) A(2)\nA(x): if x != 1 produce B";
    expect(unequal, &[(0.0, "A(1) B")]);
    let chained = "initial string: A(0)\nA(x):\n solve dx/dt = 1\n if 1 < x < 2 & t > 1.5 produce B(x)\nB(x): solve dx/dt = 0";
    expect(chained, &[(1.4, "A(1.4)"), (1.6, "B(1.5)")]);
    let of_time = "initial string: A\nA: if t = 2 produce B\nB: if age = 0.5 produce C";
    expect(of_time, &[(1.9, "A"), (2.0, "B"), (2.4, "B"), (2.5, "C")]);
}

#[test]
fn contexts_are_found_along_the_axes() {
    let text = "initial string: A(1) [ +(30) B(2) [ C(3) ] ] [ B(4) ] D(5)\nA(a) < B(b): produce X(a, b)\nB(b) < C(c): produce Y(b, c)\nA(a) < D(d): produce Z(a, d)";
    expect(text, &[(0.0, "A(1) [ +(30) X(1, 2) [ Y(2, 3) ] ] [ X(1, 4) ] Z(1, 5)")]);
    let several =
        "initial string: A(1) B(2) C(3) D(4) E(5)\nA(a) B(b) < C(c) > D(d) E(f): produce X(a, b, d, f)";
    expect(several, &[(0.0, "A(1) B(2) X(1, 2, 4, 5) D(4) E(5)")]);
    let missing = "initial string: C C(1)\nC(x) < C(y): produce X\nC: if t < 0 produce X";
    expect(missing, &[(0.0, "C C(1)")]);
}

#[test]
fn base_names_match_in_contexts_and_exact_names_themselves() {
    let text = "initial string: F_h(1) F_v(2) F(3)\nF(a) < F_v(x): produce X(a)\nF_h(a) < F(x): produce Y";
    expect(text, &[(0.0, "F_h(1) X(1) F(3)")]);
}

#[test]
fn ignore_and_consider_choose_what_counts() {
    let skipped = "ignore I\ninitial string: A(1) I + ! B\nA(a) < B: produce X(a)\nI: if t < 0 produce ε";
    expect(skipped, &[(0.0, "A(1) I + ! X(1)")]);
    let considered = "consider + B\ninitial string: A(1) +(2) C B\n+(a) < B: produce X(a)\nA(x): if t < 0 produce C\nC: if t < 0 produce ε";
    expect(considered, &[(0.0, "A(1) +(2) C X(2)")]);
}

#[test]
fn rules_are_looked_up_again_when_the_neighbourhood_changes() {
    // B grows while A stands before it; when A becomes C, the second rule applies.
    let text = "initial string: A(0) B(0)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce C\nA(x) < B(y): solve dy/dt = 1\nC < B(y): solve dy/dt = 10\nB(y): solve dy/dt = 0\nC: if age = 1 produce ε";
    expect(text, &[(1.0, "C B(1)"), (1.5, "C B(6)"), (3.0, "B(11)")]);
    // An equality that becomes true because a neighbour is replaced.
    let jump = "initial string: A(0) B(7)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce A2(7)\nA(x) < B(y): if x = y produce X\nA2(x) < B(y): if x = y produce Y";
    expect(jump, &[(0.9, "A(0.9) B(7)"), (1.0, "A2(7) Y")]);
}

#[test]
fn the_first_written_wins_and_plus_minus_is_both() {
    let text =
        "initial string: A(0)\nA(x):\n if x < 1 solve dx/dt = 1\n if x = 1 produce B\n if x >= 1 produce C";
    expect(text, &[(1.0, "B")]);
    let turns = "initial string: +(1) -(2) +\n±(α): solve dα/dt = 1";
    expect(turns, &[(1.0, "+(2) -(3) +")]);
}

#[test]
fn age_is_sharp_far_from_zero() {
    // G09: born at t = 1e9, where neighbouring floats are 1e-7 apart, with a life of ln 2.
    let text = "initial string: S\nS: if t = 1e9 produce A(1)\nA(x):\n if x < 2 solve dx/dt = 2*(1 - x/3)*x\n if x = 2 produce B(age)\nB(a): if t < 0 produce ε";
    let born = 1e9;
    let strings =
        run(text, Settings { tolerance: 1e-12, ..Settings::default() }, &[born, born + 0.693, born + 0.694]);
    let strings = strings.expect("runs");
    assert_eq!((&*strings[0][0].0, &*strings[1][0].0), ("A", "A"));
    assert!(
        strings[2][0].0 == "B" && (strings[2][0].1[0] - std::f64::consts::LN_2).abs() < 1e-11,
        "{strings:?}"
    );
}

#[test]
fn ten_thousand_bounces_do_not_fall_through() {
    // F05: t_n = (2n - 1) sqrt(20/9.81); 2,000 of them here.
    let text = "initial string: B(10, 0, 0)\nB(x, v, n):\n if x > 0 solve dx/dt = v, dv/dt = -9.81\n if x = 0 & v < 0 produce B(0, -v, n + 1)";
    let t = |n: f64| (2.0 * n - 1.0) * (20.0f64 / 9.81).sqrt();
    let strings = run(text, Settings::default(), &[t(2000.0) - 1e-6, t(2000.0) + 1e-6]).expect("runs");
    assert_eq!((strings[0][0].1[2], strings[1][0].1[2]), (1999.0, 2000.0));
}

/// The time at which a model's only module became B(t).
fn time_of_event(text: &str, until: f64) -> Option<f64> {
    let strings = run(text, Settings::default(), &[until]).unwrap_or_else(|e| panic!("{e}\n{text}"));
    strings[0].first().filter(|m| m.0 == "B").map(|m| m.1[0])
}

#[test]
fn poles_and_edges_of_definedness_hide_no_event_and_make_none() {
    for (text, wanted) in [
        ("A(1)\nA(x): solve dx/dt = -1\n if 1/x = 2 produce B(t)", Some(0.5)),
        ("A(0, 1)\nA(x, y): solve dx/dt = 1, dy/dt = -1\n if x/y = 2 produce B(t)", Some(2.0 / 3.0)),
        ("A\nA: if tan(t) = -5 produce B(t)", Some(std::f64::consts::PI - 5f64.atan())),
        ("A(0)\nA(x): solve dx/dt = 1\n if log10(x) = 0 produce B(t)", Some(1.0)),
        ("A(0)\nA(x): solve dx/dt = 1\n if 1/(x - 0.5) = 5 produce B(t)", Some(0.7)),
        ("A\nA: if 1/(t - 1) = 0 produce B(t)", None),
        // A jump over a value is no equality; arriving at it is.
        ("A(0)\nA(x): solve dx/dt = 1\n if floor(x) = 0.5 produce B(t)", None),
        ("A(0)\nA(x): solve dx/dt = 1\n if floor(x) = 1 produce B(t)", Some(1.0)),
    ] {
        let found = time_of_event(&format!("initial string: {text}"), 1.9);
        let close = match (found, wanted) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-12,
            (a, b) => a == b,
        };
        assert!(close, "{text}: {found:?}, not {wanted:?}");
    }
}

#[test]
fn a_limit_is_one_however_it_is_written_and_what_is_just_below_is_none() {
    for condition in ["x/3 = 1", "x - 3 = 0", "1 - x/3 = 0", "2x = 6"] {
        let text =
            format!("initial string: A(1)\nA(x): solve dx/dt = 2*(1 - x/3)*x\n if {condition} produce B(t)");
        assert_eq!(time_of_event(&text, 50.0), None, "{condition}");
    }
    // E02: a slope of 5e-12 at the threshold, so that the time is known to a few digits only.
    let near = "initial string: A(1)\nA(x): solve dx/dt = 2*(1 - x/3)*x\n if x = 3*(1 - 2^-40) produce B(t)";
    let strings = run(near, Settings { tolerance: 1e-13, ..Settings::default() }, &[20.0]).expect("runs");
    assert!(strings[0][0].0 == "B" && (strings[0][0].1[0] - 14.2095).abs() < 0.5, "{strings:?}");
}

#[test]
fn growth_from_very_little_is_known_to_its_own_digits() {
    for (start, t) in [(1e-6, 13.8155), (1e-9, 20.723), (1e-15, 34.538)] {
        for tolerance in [1e-4, 1e-6, 1e-10] {
            let text = format!("initial string: A({start})\nA(x): solve dx/dt = x");
            let settings = Settings { tolerance, ..Settings::default() };
            let x = run(&text, settings, &[t]).expect("runs")[0][0].1[0];
            let exact = start * t.exp();
            assert!((x - exact).abs() < 100.0 * tolerance, "{start}, {tolerance}: {x}, not {exact}");
        }
    }
}

#[test]
fn events_with_long_waits_before_them_are_sharp() {
    // Steps grow while nothing happens; what happens then is not judged on their scale.
    let short = "initial string: A(0)\nA(n):\n if age = 1 & n < 14 produce A(n + 1)\n if n = 14 & age = 0.001 produce B(t)";
    assert!((time_of_event(short, 20.0).expect("happens") - 14.001).abs() < 1e-12);
    let hundred = "initial string: A(0)\nA(n): if age = 1 produce A(n + 1)";
    expect(hundred, &[(100.5, "A(100)")]);
    // Two siblings far from t = 0, whose lives differ by less than neighbouring floats there.
    let twins = "initial string: G\nG: if t = 1e6 produce S(0) L(0)\nS(x): if x < 0.001 solve dx/dt = 1\n if x = 0.001 produce D\nD < L(y): if y < 0.001 + 1e-11 solve dy/dt = 1\n if y >= 0.001 + 1e-11 produce B(t)\nL(y): if y < 0.001 + 1e-11 solve dy/dt = 1\n if y = 0.001 + 1e-11 produce D";
    assert_eq!(show(&run(twins, Settings::default(), &[1e6 + 1.0]).expect("runs")[0]), "D B(1000000)");
}

#[test]
fn resting_on_a_boundary_is_no_fault() {
    let rest = "initial string: A(0)\nA(x):\n if x < 1 solve dx/dt = 1\n if x = 1 solve dx/dt = 0";
    expect(rest, &[(2.0, "A(1)")]);
    // And it is remembered that the sides are equal.
    let later = "initial string: A(0)\nA(x):\n if x < 1 solve dx/dt = 1\n if x >= 1 solve dx/dt = 0\n if x = 1 & age > 3 produce B(t)";
    assert!((time_of_event(later, 5.0).expect("happens") - 3.0).abs() < 1e-12);
    let slow = "initial string: A(1000)\nA(x): if x > 1000 solve dx/dt = 1e-9";
    expect(slow, &[(10.0, "A(1000)")]);
}

#[test]
fn singularities_end_the_run_and_do_not_hang() {
    for text in [
        "F(1)\nF(x): solve dx/dt = 1/(2 - x)",
        "F(1)\nF(x): solve dx/dt = -1/x",
        "F(1)\nF(x): solve dx/dt = tan(x)",
    ] {
        let error = fails(&format!("initial string: {text}"), 10.0);
        assert!(matches!(error, Error::StepTooSmall { .. } | Error::NotFinite { .. }), "{error}");
    }
}

#[test]
fn nothing_to_do_costs_nothing_however_long() {
    let text = "initial string: A(1) F(2)\nA(x): if x = 2 produce F(1)";
    let session = crate::common::session(text);
    let mut simulation = session.simulate(Settings::default()).expect("starts");
    simulation.at(1e12, &mut Default::default()).expect("runs");
    assert!(simulation.stats().steps < 100);
}

proptest! {
    /// Division conserves length: x' = r x, so the sum of x grows like e^(r t) whatever is divided when.
    #[test]
    fn division_conserves_length(k in 0.2..0.8f64, r in 0.1..1.0f64, first in 0.1..1.0f64) {
        let text = format!("initial string: C({first})\nC(x):\n if x < 1 solve dx/dt = {r}*x\n if x = 1 produce C({k}) C(1 - {k})");
        let end = 4.0 / r;
        let strings = run(&text, Settings { tolerance: 1e-9, ..Settings::default() }, &[end / 2.0, end]).expect("runs");
        for (state, t) in strings.iter().zip([end / 2.0, end]) {
            let total: f64 = state.iter().map(|m| m.1[0]).sum();
            let exact = first * (r * t).exp();
            prop_assert!((total / exact - 1.0).abs() < 1e-6, "{total} {exact}");
        }
    }

    /// Brackets stay balanced and modules in order, whatever is replaced by what.
    #[test]
    fn strings_stay_well_formed(life in proptest::collection::vec(0.1..2.0f64, 3), seed in any::<u32>()) {
        let shapes = ["[A(0)]B(0)", "B(0)[[A(0)]C(0)]", "ε", "[B(0)][C(0)]A(0)", "[]"];
        let pick = |i: u32| shapes[((seed >> (3 * i)) % 5) as usize];
        let rule = |name: &str, i: usize| {
            format!("{name}(x): if x < {} solve dx/dt = 1\n if x = {} produce {}\n", life[i], life[i], pick(i as u32))
        };
        let text = format!("initial string: A(0)[B(0)]C(0)\n{}{}{}", rule("A", 0), rule("B", 1), rule("C", 2));
        let end = 3.0;
        let Ok(strings) = run(&text, Settings { max_modules: 20_000, ..Settings::default() }, &[1.0, 2.0, end]) else {
            return Ok(());
        };
        for state in strings {
            let mut depth = 0i64;
            for (name, parameters) in state {
                match &*name {
                    "[" => depth += 1,
                    "]" => depth -= 1,
                    _ => prop_assert!(parameters[0] >= 0.0 && parameters[0] <= 2.0),
                }
                prop_assert!(depth >= 0);
            }
            prop_assert_eq!(depth, 0);
        }
    }
}

#[test]
fn the_quick_way_is_the_general_way() {
    // The common case has code of its own; it must give the same bits.
    let folders = ["models", "models/hard", "tests/paper-models"];
    let files = folders.iter().flat_map(|f| std::fs::read_dir(repository(f)).expect("a folder"));
    let mut compared = 0;
    for file in
        files.map(|f| f.expect("readable").path()).filter(|p| p.extension().is_some_and(|e| e == "dls"))
    {
        let big = ["h01-", "h03-"];
        if big.iter().any(|b| file.file_name().is_some_and(|n| n.to_string_lossy().starts_with(b))) {
            continue;
        }
        let bits = |slow| -> Vec<Vec<(String, Vec<u64>)>> {
            let settings = Settings { slow, ..Settings::default() };
            let session = dlsys::session::Session::open(&file, &[]).expect("a good model");
            let Ok(mut simulation) = session.simulate(settings) else { return Vec::new() };
            let mut string = Default::default();
            let mut all = Vec::new();
            for t in [0.0, 0.3, 1.0, 2.5, 9.0] {
                if simulation.at(t, &mut string).is_err() {
                    break;
                }
                let state = crate::common::plain(&session.model, &string).into_iter();
                all.push(state.map(|(n, p)| (n, p.into_iter().map(f64::to_bits).collect())).collect());
            }
            all
        };
        assert!(bits(false) == bits(true), "{}", file.display());
        compared += 1;
    }
    assert!(compared > 80, "{compared} models");
}

#[test]
fn an_instant_that_is_shared_is_passed_once() {
    // The growth of F ends at age 2, at the very instant, but for rounding, at which another A divides; by formulas
    // and by steps. Once the end was met twice, and growth went on; once it fell between two steps, and was missed.
    let text = "def G(T, τ) = if τ <= T then 6/T^2*(1 - τ/T)*τ else 0\ninitial string: A(0)\nA(x):\n if x < 1 solve dx/dt = 1\n if x = 1 produce F(0)[A(0)]\nF(x): solve dx/dt = G(2, age)";
    for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
        let settings = Settings { method, tolerance: 1e-9, ..Settings::default() };
        let strings = run(text, settings, &[9.5]).expect("runs");
        let grown = strings[0].iter().filter(|(name, p)| name == "F" && (p[0] - 1.0).abs() < 1e-8).count();
        assert_eq!(grown, 7, "{method:?}: {}", show(&strings[0]));
    }
}

#[test]
fn an_event_at_birth_says_nothing_about_the_steps_to_come() {
    // `floor` jumps where A is born; once the next steps were taken to be as short as that life of nothing.
    let text = "initial string: A(0.2, 0) B(0.3) A(0.5, 0.1) B(0.1)\nB(z) < A(x, y):\n if x < 1.11 solve dx/dt = 1.04*(0.65 - x), dy/dt = 1.49*floor(age + 1)*0.3\n if x = 1.11 produce A(0.33*x, 0) B(0) A(0.1, 0.2)\nA(x, y):\n if x < 1.11 solve dx/dt = 1.51*age*(2 - age/5), dy/dt = 0.26*sin(age)+0.3\n if x = 1.11 produce A(0.33*x, 0) B(0) A(0.1, 0.2)\nA(x, y) < B(z):\n solve dz/dt = 1.96\n if z = 1.65 & age > 0.3 produce B(0.33*z) C(z)\nB(z):\n solve dz/dt = 1.48*cos(z)+1.2\n if z = 1.65 & age > 0.3 produce B(0.33*z) C(z)\nC(q): solve dq/dt = if age < 1.16 then 0.57 else 0.1";
    let state = |method| {
        let settings = Settings { method, tolerance: 1e-9, ..Settings::default() };
        run(text, settings, &[2.7]).expect("runs").remove(0)
    };
    let (auto, dop853) = (state(Method::Auto), state(Method::Dop853));
    for ((name, a), (other, b)) in auto.iter().zip(&dop853) {
        assert_eq!((name, a.len()), (other, b.len()));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{name}: {a:?} {b:?}");
    }
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
