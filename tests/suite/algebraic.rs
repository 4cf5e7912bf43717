//! Parameters given by values and by equations, and sums over attached modules, against exact answers.

use dlsys::sim::{Error, Method, Scheduler, Settings};

use crate::common::{Plain, run};

/// Every parameter of every module is to be what it is in truth, within 100 tolerances (LANGUAGE, "Accuracy"), at
/// several tolerances, with both schedulers.
fn follows(text: &str, times: &[f64], truth: impl Fn(f64) -> Vec<Vec<f64>>) {
    for tolerance in [1e-4, 1e-6, 1e-9] {
        for scheduler in [Scheduler::Auto, Scheduler::Global] {
            let settings = Settings { tolerance, scheduler, ..Settings::default() };
            let states = run(text, settings, times).unwrap_or_else(|e| panic!("{e}\n{text}"));
            for (&t, state) in times.iter().zip(&states) {
                let modules: Vec<&Plain> = state.iter().filter(|m| !m.1.is_empty()).collect();
                let truth = truth(t);
                assert_eq!(modules.len(), truth.len(), "at {t}\n{text}");
                for ((name, found), wanted) in modules.iter().zip(&truth).map(|(m, w)| ((&m.0, &m.1), w)) {
                    for (&x, &y) in found.iter().zip(wanted) {
                        let error = (x - y).abs() / y.abs().max(1.0) / tolerance;
                        assert!(error < 100.0, "{name} at {t}: {x}, not {y}: {error} tolerances\n{text}");
                    }
                }
            }
        }
    }
}

/// The root of a function that rises, between two numbers.
fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        *(if f(middle) < 0.0 { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

const TIMES: [f64; 4] = [0.0, 0.3, 1.0, 2.0];

#[test]
fn a_square_root_that_is_an_equation() {
    let text = "initial string: A(1, 1)\nA(x, y): solve dx/dt = y, 0 = y^2 - x";
    follows(text, &TIMES, |t| vec![vec![(1.0 + t / 2.0).powi(2), 1.0 + t / 2.0]]);
}

#[test]
fn two_equations_in_two_unknowns() {
    // u = 2x/3 and v = x/3; their written values are far from that.
    let text = "initial string: A(1, 5, -7)\nA(x, u, v): solve dx/dt = -u*v, 0 = u + v - x, 0 = u - 2v";
    follows(text, &TIMES, |t| {
        let x = 1.0 / (1.0 + 2.0 * t / 9.0);
        vec![vec![x, 2.0 * x / 3.0, x / 3.0]]
    });
}

#[test]
fn an_equation_with_a_logarithm() {
    let text = "initial string: A(1, 0.9)\nA(x, y): solve dx/dt = y + 1, 0 = y + ln(y) - x";
    follows(text, &TIMES, |t| vec![vec![t.exp() + t, t.exp()]]);
}

#[test]
fn an_enzyme_in_its_quasi_steady_state() {
    // s + ln s falls at the rate 1.
    let text = "initial string: A(2, 0.5)\nA(s, c): solve ds/dt = -c, 0 = (1 - c)*s - c";
    follows(text, &TIMES, |t| {
        let s = root(|s| s + s.ln() - (2.0 + 2.0f64.ln() - t), 1e-9, 3.0);
        vec![vec![s, s / (1.0 + s)]]
    });
}

#[test]
fn a_pressure_that_neighbours_share() {
    // Between two ends the pressure is linear in the place, at every instant; all unknowns hang together.
    let rule = "solve dq/dt = p, 0 = p_l + p_r - 2p";
    let text = format!(
        "initial string: In(0, 0) P(0, 0) P(0, 0) P(0, 0) P(0, 0) Out(0, 0)\nIn(p, q): solve p = sin(t)\n\
         P(p_l, q_l) < P(p, q) > P(p_r, q_r): {rule}\nIn(p_l, q_l) < P(p, q) > P(p_r, q_r): {rule}\n\
         P(p_l, q_l) < P(p, q) > Out(p_r, q_r): {rule}"
    );
    follows(&text, &TIMES, |t| {
        let part = |i: u32| f64::from(5 - i) / 5.0;
        let inner = (1..5).map(|i| vec![part(i) * t.sin(), part(i) * (1.0 - t.cos())]);
        [vec![t.sin(), 0.0]].into_iter().chain(inner).chain([vec![0.0; 2]]).collect()
    });
}

#[test]
fn a_stiff_system() {
    // x follows y = cos t at a distance that is known.
    let text =
        "initial string: A(1, 0)\nA(x, y): solve dx/dt = -1e4*(x - y), 0 = y^3 + y - cos(t)^3 - cos(t)";
    follows(text, &TIMES, |t| {
        let l: f64 = 1e4;
        let steady = |t: f64| (l * l * t.cos() + l * t.sin()) / (l * l + 1.0);
        vec![vec![steady(t) + (1.0 - steady(0.0)) * (-l * t).exp(), t.cos()]]
    });
}

#[test]
fn flows_that_add_up_to_what_the_root_gives() {
    // m = sum f + p and f = w p: the share of the root is solved for, with those of its branches in it.
    let text = "initial string: R(4, 1) [ L(1, 0, 0) ] [ L(2, 0, 0) ] L(3, 0, 0)\n\
        R(p, m): solve dm/dt = -sum(L(w, f, q): f), 0 = sum(L(w, f, q): f) + p - m\n\
        R(p, m) < L(w, f, q): solve f = w*p, dq/dt = f";
    follows(text, &TIMES, |t| {
        let m = (-6.0 / 7.0 * t).exp();
        let branch = |w: f64| vec![w, w * m / 7.0, w * (1.0 - m) / 6.0];
        vec![vec![m / 7.0, m], branch(1.0), branch(2.0), branch(3.0)]
    });
}

#[test]
fn a_value_found_again_at_every_birth() {
    // The event is located on the unknown; the successor's equations are another root's.
    let text = "initial string: A(0)\nA(y):\n  if y < 0.5 solve 0 = y^3 + y - t\n  if y = 0.5 produce B(0, t, 0)\n\
        B(x, s, z): solve dx/dt = z, 0 = exp(z) - 1 - age";
    let event = 0.625;
    follows(text, &[0.0, 0.3, 0.624, 0.626, 1.0, 3.0], |t| {
        if t < event {
            return vec![vec![root(|y| y.powi(3) + y - t, -1.0, 2.0)]];
        }
        let a = 1.0 + (t - event);
        vec![vec![a * a.ln() - a + 1.0, event, a.ln()]]
    });
}

#[test]
fn values_are_formulas_where_they_can_be() {
    // The paper's cubic growth function as the function of time that it is; nothing is integrated, ever.
    let text = "const T = 4\ndef G(a) = if a < T then 3*(a/T)^2 - 2*(a/T)^3 else 1\n\
        initial string: F(0, 0)\nF(x, w):\n  if x < 0.9 solve x = G(age), w = sqrt(x)\n  if x = 0.9 produce H(t, w)";
    let g = |t: f64| 3.0 * (t / 4.0).powi(2) - 2.0 * (t / 4.0).powi(3);
    let event = root(|t| g(t) - 0.9, 0.0, 4.0);
    follows(text, &[0.0, 1.0, 3.0, 3.2, 5.0], |t| match t < event {
        true => vec![vec![g(t), g(t).sqrt()]],
        false => vec![vec![event, 0.9f64.sqrt()]],
    });
    let session = crate::common::session(text);
    let mut simulation = session.simulate(Settings::default()).expect("begins");
    simulation.at(5.0, &mut Default::default()).expect("runs");
    assert_eq!(simulation.stats().rhs_evaluations, 0);
}

#[test]
fn modules_made_by_productions_have_their_values_too() {
    // With nothing else, beside a rate, and read by a condition.
    let text = "initial string: A(1)\n\
        A(n): if age < n solve dn/dt = 0\n if age = n produce F(0, n) G(0, n) H(7)\n\
        F(x, n): solve x = 2*age\n\
        G(x, n): solve x = age^2 + n, dn/dt = 1\n\
        H(x): if age < 10 solve x = age\n if x = 0.5 produce F(0, t)";
    follows(text, &[1.25, 3.0], |t| {
        let (age, last) = (t - 1.0, if t < 1.5 { vec![t - 1.0] } else { vec![2.0 * (t - 1.5), 1.5] });
        vec![vec![2.0 * age, 1.0], vec![age * age + t, t], last]
    });
}

#[test]
fn methods_without_formulas_know_values_that_nobody_reads() {
    let text = "initial string: F(0) G(1, 0)\nF(x): solve x = 2*age\nG(y, x): solve dy/dt = y, x = y^2 + t";
    for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau, Method::Rk4] {
        let settings = Settings { method, step_size: 1e-3, ..Settings::default() };
        for (t, state) in [0.5_f64, 2.0].into_iter().zip(run(text, settings, &[0.5, 2.0]).expect("runs")) {
            let truth = [2.0 * t, t.exp(), (2.0 * t).exp() + t];
            for (x, y) in state.iter().flat_map(|m| &m.1).zip(truth) {
                assert!((x - y).abs() < 1e-4 * y.max(1.0), "{method:?} at {t}: {x}, not {y}");
            }
        }
    }
}

fn fails(text: &str) -> Error {
    run(text, Settings::default(), &[10.0]).expect_err("fails")
}

#[test]
fn singular_equations_say_so() {
    // Two solutions meet at t = π/2; the circle says no more.
    let circle = fails("initial string: A(0, 1)\nA(x, y): solve dx/dt = y, 0 = x^2 + y^2 - 1");
    assert!(circle.to_string().contains("become singular"), "{circle}");
    assert!((circle.site().time - std::f64::consts::FRAC_PI_2).abs() < 1e-3, "{circle}");
    // A fold that time brings about.
    let fold = fails("initial string: A(1)\nA(y): solve 0 = y^2 - 1 + t");
    assert!(fold.to_string().contains("singular"), "{fold}");
    assert!((fold.site().time - 1.0).abs() < 1e-3, "{fold}");
    // A double root at birth; no root at all.
    let double = fails("initial string: A(1, 1)\nA(x, y): solve dx/dt = y, 0 = (y - x)^2");
    assert!(double.to_string().contains("singular"), "{double}");
    let nothing = fails("initial string: A(1, 1)\nA(x, y): solve dx/dt = y, 0 = exp(y) + x");
    assert!(nothing.to_string().contains("no value that solves"), "{nothing}");
    assert_eq!(nothing.site().time, 0.0);
}

/// The equations of `u` in `A(x, u)`, with the start of x, its rate, the start of u, and the time at which two solutions meet.
const MEETINGS: [(&str, f64, &str, f64, f64); 7] = [
    ("(u + x)*(u - 2*x)", -1.0, "1", 1.0, 1.0),
    ("(u + x)*(u - 2*x)", -1.0, "1 + 0.001*sin(x)^2", 1.0, 0.999_727),
    ("u^2 - x^2", -1.0, "1", 1.0, 1.0),
    ("u^3 - x*u", -1.0, "1", 0.0, 1.0),
    // They meet twice, within a thousandth and a millionth of a step.
    ("u*(u - (t - 1)*(t - 1.001))", 0.0, "1", 0.0, 1.0),
    ("u*(u - (t - 1)*(t - 1.000001))", 0.0, "1", 0.0, 1.0),
    // At the instant of a kink.
    ("(u + x)*(u - 2*x)", -1.0, "1 + abs(x)", 1.0, std::f64::consts::LN_2),
];

#[test]
fn where_two_solutions_meet_the_run_ends() {
    for (equation, x, rate, u, time) in MEETINGS {
        let text = format!("initial string: A({x}, {u})\nA(x, u): solve dx/dt = {rate}, 0 = {equation}");
        let error =
            run(&text, Settings::default(), &[8.0]).expect_err(&format!("two solutions meet: {text}"));
        let said = error.to_string();
        assert!(said.contains("meet") || said.contains("singular"), "{text}: {said}");
        assert!((error.site().time - time).abs() < 1e-5, "{text}: {said}, not at {time}");
    }
    // Two unknowns, of two modules.
    let text = "initial string: P(0) A(0, 0) B(0)\nP(x): solve dx/dt = 1\n\
        P(x) < A(u, s) > B(v): solve 0 = (u + v + x - 1)*(u + v - 2*x + 2)\nA(u, s) < B(v): solve 0 = v - u/2";
    let error = fails(text);
    assert!(error.to_string().contains("meet") && (error.site().time - 1.0).abs() < 1e-6, "{error}");
}

#[test]
fn an_event_before_two_solutions_meet_comes_first() {
    let text = "initial string: A(-1, 1)\nA(x, u):\n  solve dx/dt = 1, 0 = (u + x)*(u - 2*x)\n  if x = -1e-6 produce B(u)";
    let states = run(text, Settings::default(), &[2.0]).expect("it is replaced before");
    assert!(states[0][0].0 == "B" && (states[0][0].1[0] - 1e-6).abs() < 1e-9, "{states:?}");
}

#[test]
fn equations_that_are_singular_with_one_solution_go_on() {
    for (equation, u, truth) in [
        // A root of odd order, a factor that does not matter, three solutions that become one, two that keep apart.
        ("u^3 - x", -1.0, 1.0),
        ("x*(u - sin(x))", -0.8, 1.0_f64.sin()),
        ("x^2*(u - sin(x))", -0.8, 1.0_f64.sin()),
        ("u^3 + x*u", 1.0, 0.0),
        ("u^2 - x^2 - 1e-6", 1.0, 1.000_000_5),
        ("u*abs(u) + 0.1*u - x", -0.9, 0.951_249_2),
    ] {
        let text = format!("initial string: A(-1, {u})\nA(x, u): solve dx/dt = 1, 0 = {equation}");
        let states =
            run(&text, Settings::default(), &[2.0]).unwrap_or_else(|error| panic!("{text}: {error}"));
        let values = &states[0][0].1;
        assert!((values[1] - truth).abs() < 1e-5, "{text}: {states:?}");
    }
}

#[test]
fn solutions_on_the_other_side_of_a_condition_are_found() {
    let root = |x: f64, a: f64| x.signum() * ((a * a + 4.0 * x.abs()).sqrt() - a) / 2.0;
    for (equation, truth) in [
        ("u*abs(u) + 0.427*u - x", root(-1.0, 0.427)),
        ("u + max(u, 0)^2 - x", -1.0),
        ("(if u > 0 then u^2 + u else u) - x", -1.0),
        ("sign(u)*u^2 + u - x", root(-1.0, 1.0)),
        ("max(u, -0.5)^3 + u - x", -0.875),
    ] {
        for start in [0.0, 0.1, 1.0, -0.1, 30.0] {
            let text = format!("initial string: A(-1, {start})\nA(x, u): solve dx/dt = 1, 0 = {equation}");
            let states =
                run(&text, Settings::default(), &[0.0]).unwrap_or_else(|error| panic!("{text}: {error}"));
            let values = &states[0][0].1;
            assert!((values[1] - truth).abs() < 1e-9, "{text}: {states:?}, not {truth}");
        }
    }
    // Two unknowns; and in a run, where what is read changes its sign at an event.
    let two = "initial string: A(-1, 0.5, 0.5)\nA(x, u, v): solve dx/dt = 1, 0 = u*abs(u) + u + 0.1*v - x, 0 = v*abs(v) + 0.3*v - u";
    let states = run(two, Settings::default(), &[0.0]).expect("it has a solution");
    let values = &states[0][0].1;
    let (u, v) = (values[1], values[2]);
    assert!(u < 0.0 && (u * u.abs() + u + 0.1 * v + 1.0).abs() < 1e-9, "{states:?}");
    assert!(v < 0.0 && (v * v.abs() + 0.3 * v - u).abs() < 1e-9, "{states:?}");
    let turns = "initial string: P(1) A(0, 0.5)\nP(p): if age = 1 produce P(-p)\nP(p) < A(x, u): solve dx/dt = u, 0 = u*abs(u) + u - p";
    follows(turns, &[0.5, 1.5], |t| {
        let u = root(1.0, 1.0);
        match t < 1.0 {
            true => vec![vec![1.0], vec![u * t, u]],
            false => vec![vec![-1.0], vec![u * (2.0 - t), -u]],
        }
    });
    // Where the sign changes at a jump or a pole, there is no solution.
    for equation in ["(if u > 0 then u + 1 else u - 1)", "1/u + 0*x", "exp(u) - x", "u^2 - x"] {
        let text = format!("initial string: A(-1, 0.5)\nA(x, u): solve dx/dt = 1, 0 = {equation}");
        let error = run(&text, Settings::default(), &[0.0]).expect_err(&text).to_string();
        let says = ["no value", "singular", "push against each other"];
        assert!(says.iter().any(|what| error.contains(what)), "{text}: {error}");
    }
}

#[test]
fn steps_of_a_fixed_length_know_values_too() {
    let text = "initial string: A(1, 1)\nA(x, y): solve dx/dt = y, 0 = y^2 - x";
    let settings = Settings { method: Method::Rk4, step_size: 0.01, ..Settings::default() };
    let states = run(text, settings, &[2.0]).expect("runs");
    assert!((states[0][0].1[0] - 4.0).abs() < 1e-6, "{states:?}");
    assert!((states[0][0].1[1] - 2.0).abs() < 1e-6, "{states:?}");
}

#[test]
fn values_that_jump_away_from_a_threshold_take_their_readers_along() {
    // Before t = 1 every threshold is met exactly; the reader has been followed to the instant at which its neighbour jumps.
    for text in [
        "axiom: S(1) S(1)\nS(w) > S(v): solve w = max(1, v)\nS(w): solve w = if t < 1 then 1 else 2\n",
        "axiom: S(1) S(1)\nS(w) > S(v): solve w = if v > 1 then v else 1\nS(w): solve w = if t < 1 then 1 else 2\n",
        "axiom: S(1) S(1)\nS(w) > S(v): solve w = max(1, v)\nS(w): solve w = if t < 1 then 1 else 0.5\n",
    ] {
        let last = if text.contains("0.5") { [1.0, 0.5] } else { [2.0, 2.0] };
        follows(text, &TIMES, |t| {
            let [w, v] = if t < 1.0 { [1.0, 1.0] } else { last };
            vec![vec![w], vec![v]]
        });
    }
    // The pipe model with a twig of the least width: two more twigs at t = 1.
    let pipe =
        "axiom: S(1) S(1) A\nS(w): solve w = max(1, sum(S(v): v))\nA: if age = 1 produce [ S(1) ] S(1)\n";
    follows(pipe, &TIMES, |t| match t < 1.0 {
        true => vec![vec![1.0], vec![1.0]],
        false => vec![vec![2.0], vec![2.0], vec![1.0], vec![1.0]],
    });
}

/// `dx/dt = 0.5 x exp(-0.2 x)` from 0.5 to about 6.77 at t = 9: a level that values or unknowns of a module's own pass is passed once each time.
#[test]
fn a_condition_on_a_value_of_its_own_is_met_once() {
    // 3 x passes π, 2 π … 6 π. What is below its level at the beginning is replaced there, too.
    for (value, level, met) in [
        ("v = sin(3*x)", 0.0, 6.0),
        ("v = x^2", 2.16, 2.0),
        ("v = exp(-x)", 0.1028, 1.0),
        ("v = x/(1 + x)", 0.6, 2.0),
        ("0 = v + 0.3*v^3 - sin(3*x)", 0.0, 6.0),
    ] {
        for method in [Method::Auto, Method::Dopri5, Method::Radau] {
            // What the successor begins with does not matter: it solves for the same.
            for given in ["v", "0.3"] {
                let text = format!(
                    "axiom: A(0.5, 0, 0, 0.3)\nA(x, n, s, v): solve dx/dt = 0.5*x*exp(-0.2*x), {value}\n\
                     if v < {level} & s = 0 produce A(x, n + 1, 1, {given})\n\
                     if v > {level} & s = 1 produce A(x, n + 1, 0, {given})\n"
                );
                let settings = Settings { method, ..Settings::default() };
                let states = run(&text, settings, &[9.0]).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
                assert_eq!(states[0][0].1[1], met, "{method:?}\n{text}");
            }
        }
    }
}
