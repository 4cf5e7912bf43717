//! Events, contexts, changes of equations and errors of a run: small models with exact answers. [`precision`](super::precision)
//! has more of them.
//!
//! Ids such as A02 refer to the collection of hard cases from which an answer was taken.

use dlsys::sim::{Error, Method, Settings};
use proptest::prelude::*;

use crate::common::{Plain, run, show};

/// Runs with every method that is exact enough; all must show the same.
pub fn expect(text: &str, states: &[(f64, &str)]) {
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

pub fn fails(text: &str, until: f64) -> Error {
    run(text, Settings { max_modules: 100_000, ..Settings::default() }, &[until]).expect_err("fails")
}

/// The time at which a model's only module became B(t).
pub fn time_of_event(text: &str, until: f64) -> Option<f64> {
    let strings = run(text, Settings::default(), &[until]).unwrap_or_else(|e| panic!("{e}\n{text}"));
    strings[0].first().filter(|m| m.0 == "B").map(|m| m.1[0])
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
