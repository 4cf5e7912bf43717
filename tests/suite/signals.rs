//! Signals along branches: sums over attached modules, right contexts with branches, events at given times.

use dlsys::sim::{Scheduler, Settings};

use crate::common::{Plain, run, show};

fn at(text: &str, times: &[f64]) -> Vec<Vec<Plain>> {
    let settings = Settings { tolerance: 1e-9, ..Settings::default() };
    run(text, settings, times).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A tree whose cells grow, divide and branch, while something diffuses between them.
fn tree(max: &str) -> String {
    let divide = "if x = 1\n    produce C(0.42, 0.42*m) [ C(0.27, 0.27*m) ] C(0.31, 0.31*m)\n";
    format!(
        "const D = 1\nconst r = {max}\ninitial string: C(0.5, 1)\n\
         C(x_p, m_p) < C(x, m):\n  if x < 1\n    \
         solve dx/dt = r*x, dm/dt = D*(m_p/x_p - m/x) - sum(C(x_c, m_c): D*(m/x - m_c/x_c))\n  {divide}\
         C(x, m):\n  if x < 1\n    solve dx/dt = r*x, dm/dt = -sum(C(x_c, m_c): D*(m/x - m_c/x_c))\n  {divide}"
    )
}

/// The sum of numbers to the last digit (Neumaier 1974).
fn exact_sum(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, lost) = numbers.fold((0.0_f64, 0.0), |(sum, lost), x| {
        let all = sum + x;
        let small = if sum.abs() >= x.abs() { (sum - all) + x } else { (x - all) + sum };
        (all, lost + small)
    });
    sum + lost
}

#[test]
fn mass_on_a_growing_tree_is_conserved() {
    conserve_mass(17, 10);
}

#[test]
#[ignore = "slow: ten thousand modules that exchange mass"]
fn mass_on_a_large_tree_is_conserved() {
    let modules = conserve_mass(21, 12);
    assert!(modules > 10_000, "{modules}");
}

/// Grows a tree to so many of the times, with local repair and with one clock; the number of modules at the end of the former.
fn conserve_mass(auto: usize, global: usize) -> usize {
    let mut modules = 0;
    let times: Vec<f64> = (0..=20).map(|i| 0.68 * f64::from(i)).collect();
    for (scheduler, until) in [(Scheduler::Auto, auto), (Scheduler::Global, global)] {
        let settings = Settings { scheduler, ..Settings::default() };
        let states = run(&tree("0.7"), settings, &times[..until]).expect("runs");
        for (state, t) in states.iter().zip(&times) {
            let mass = exact_sum(state.iter().filter(|m| !m.1.is_empty()).map(|m| m.1[1]));
            assert!((mass - 1.0).abs() < 1e-10, "{scheduler:?}: {} at {t}", mass - 1.0);
        }
        if scheduler == Scheduler::Auto {
            modules = states[until - 1].iter().filter(|m| !m.1.is_empty()).count();
        }
    }
    modules
}

#[test]
fn sums_see_what_is_attached_and_nothing_else() {
    let string = "initial string: A(0, 0) [ +(30) B(1) B(10) ] [ [ B(2) ] X B(20) ] B(4) B(40)\n";
    // By position in the string: the first of each branch and the next on the axis.
    let all = "A(x, n): if t < 1 solve dx/dt = sum(B(b): b), n = count(B(b))\n if t = 1 produce S(x, n, largest(B(b): b), smallest(B(b): b), count(X))\n";
    let states = at(&format!("{string}{all}"), &[0.5, 2.0]);
    assert_eq!(show(&states[0][..1]), "A(3.5, 3)");
    assert_eq!(show(&states[1][..1]), "S(7, 3, 4, 1, 1)");
    // What is ignored is passed over.
    let rest = all.replace("count(X)", "0");
    let states = at(&format!("ignore X\n{string}{rest}"), &[2.0]);
    assert_eq!(show(&states[0][..1]), "S(27, 4, 20, 1, 0)");
}

#[test]
fn sums_follow_births_and_deaths() {
    let text = "initial string: A(0) [ B(1) ] [ B(2) ] B(3)\n\
        A(x): solve dx/dt = count(B(y))\nB(y): if t < y solve dy/dt = 0\n if t = y produce ε";
    let states = at(text, &[0.5, 1.5, 2.5, 4.0]);
    let shown: Vec<String> = states.iter().map(|s| show(&s[..1])).collect();
    assert_eq!(shown, ["A(1.5)", "A(4)", "A(5.5)", "A(6)"]);
}

#[test]
fn a_condition_on_a_sum_is_located() {
    // The sum is 3 e^t; it reaches 6 at ln 2.
    let text = "initial string: A [ B(1) ] B(2)\nB(y): solve dy/dt = y\nA: if sum(B(y): y) = 6 produce D(t)";
    let states = at(text, &[1.0]);
    assert_eq!(
        show(&states[0][..1]),
        format!("D({})", show(&[("".into(), vec![2.0f64.ln()])]).trim_matches(['(', ')']))
    );
}

#[test]
fn right_contexts_with_branches() {
    let seen = |string: &str, rule: &str| {
        let state = &at(&format!("initial string: {string}\n{rule}"), &[0.0])[0];
        show(state)
    };
    // ABOP, p. 32: the branch and what follows on the axis.
    let rule = "S(x) > [ C(y) ] D(z): produce T(x, y, z)";
    assert_eq!(seen("S(1) [ C(2) E ] D(3)", rule), "T(1, 2, 3) [ C(2) E ] D(3)");
    assert_eq!(seen("S(1) [ B ] [ C(2) ] [ E ] D(3)", rule), "T(1, 2, 3) [ B ] [ C(2) ] [ E ] D(3)");
    assert_eq!(seen("S(1) D(3) [ C(2) ]", rule), "S(1) D(3) [ C(2) ]");
    let deep = "S(x) > [ C(y) [ E(u) ] F(v) ] D(z) H: produce T(x, y, z, u, v)";
    assert_eq!(
        seen("S(1) [ C(2) [ E(4) ] F(5) ] D(3) H", deep),
        "T(1, 2, 3, 4, 5) [ C(2) [ E(4) ] F(5) ] D(3) H"
    );
    assert_eq!(seen("S(1) [ C(2) F(5) [ E(4) ] ] D(3) H", deep), "S(1) [ C(2) F(5) [ E(4) ] ] D(3) H");
}

#[test]
fn times_given_in_advance_are_exact() {
    let text = "initial string: A(0) P(0)\nA(n):\n  if n = 0 & t = 0.1 produce A(1)\n  if n = 1 & t = 5 produce A(2)\n  \
        if n = 2 & t = 7.25 produce A(3)\nP(k): if t = 0.3*(k + 1) produce P(k + 1)";
    let states = at(text, &[0.1, 4.999, 5.0, 7.25, 9.1]);
    let shown: Vec<String> = states.iter().map(|s| show(s)).collect();
    assert_eq!(shown, ["A(1) P(0)", "A(1) P(16)", "A(2) P(16)", "A(3) P(24)", "A(3) P(30)"]);
}
