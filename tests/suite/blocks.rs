//! Building blocks of models against exact values: curves, growth functions, arrays, `match`, `let`.

use dlsys::sim::{Scheduler, Settings, Stats};
use dlsys::tree::ModuleString;

use crate::common::{Plain, run, session, show};

/// The parameters of the first module at some times, and what the run took.
fn trajectory(text: &str, settings: Settings, times: &[f64]) -> (Vec<Vec<f64>>, Stats) {
    let session = session(text);
    let mut simulation = session.simulate(settings).expect("it starts");
    let mut string = ModuleString::default();
    let mut all = Vec::new();
    for &t in times {
        simulation.at(t, &mut string).expect("it runs");
        all.push(string.get(0).parameters.to_vec());
    }
    (all, simulation.stats())
}

fn initial(text: &str) -> Vec<Plain> {
    run(text, Settings::default(), &[0.0]).expect("it runs").remove(0)
}

fn close(a: f64, b: f64, part: f64) -> bool {
    (a - b).abs() <= part * a.abs().max(b.abs()).max(1.0)
}

/// Points at the times from 0 to an end.
fn times(end: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|i| end * f64::from(i) / f64::from(count)).collect()
}

/// Simpson's rule on many pieces.
fn quadrature(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let n = 20_000;
    let h = (to - from) / f64::from(n);
    let middle = |i: u32| f(from + (f64::from(i) + 0.5) * h);
    let ends = |i: u32| f(from + f64::from(i) * h);
    (0..n).map(|i| h / 6.0 * (ends(i) + 4.0 * middle(i) + ends(i + 1))).sum()
}

/// The straight curve by (0, 0) (1, 2) (3, 2) (4, 0), and its integral from 0.
fn trapezium(x: f64) -> f64 {
    (2.0 * x).min(2.0).min(2.0 * (4.0 - x)).max(0.0)
}

fn under_trapezium(x: f64) -> f64 {
    let x = x.clamp(0.0, 4.0);
    match x {
        x if x < 1.0 => x * x,
        x if x < 3.0 => 1.0 + 2.0 * (x - 1.0),
        x => 6.0 - (4.0 - x) * (4.0 - x),
    }
}

const TRAPEZIUM: &str = "curve linear g = (0, 0) (1, 2) (3, 2) (4, 0)\n";

#[test]
fn drawn_growth_takes_no_steps() {
    // Each equation with its exact solution.
    type Case = (&'static str, f64, fn(f64) -> f64);
    let cases: [Case; 7] = [
        ("g(age)", 0.5, |t| 0.5 + under_trapezium(t)),
        ("g(t)*x", 0.5, |t| 0.5 * under_trapezium(t).exp()),
        ("slope(g, age)", 0.5, |t| 0.5 + trapezium(t)),
        ("1 + age/2 - 3*g(2*age)", 0.5, |t| 0.5 + t + t * t / 4.0 - 1.5 * under_trapezium(2.0 * t)),
        ("g(age)*(3 - x)", 0.5, |t| 3.0 - 2.5 * (-under_trapezium(t)).exp()),
        ("g(age)*x*(1 - x/3)", 0.5, |t| 3.0 / (1.0 + 5.0 * (-under_trapezium(t)).exp())),
        ("g(4 - age)", 0.5, |t| 6.5 - under_trapezium(4.0 - t.min(4.0))),
    ];
    for (rate, start, exact) in cases {
        let text = format!("{TRAPEZIUM}initial string: A({start})\nA(x): solve dx/dt = {rate}");
        assert!(session(&text).model.is_closed_form(), "{rate}");
        let times = times(6.0, 240);
        let (found, stats) = trajectory(&text, Settings::default(), &times);
        assert_eq!((stats.steps, stats.rhs_evaluations), (0, 0), "{rate}");
        for (t, x) in times.iter().zip(&found) {
            assert!(close(x[0], exact(*t), 1e-14), "{rate} at {t}: {} for {}", x[0], exact(*t));
        }
    }
}

#[test]
fn growth_laws_take_no_steps() {
    type Case = (&'static str, &'static str, f64, fn(f64) -> f64);
    let gompertz = |t: f64| 3.0 * (0.5f64 / 3.0).powf((-0.8 * t).exp());
    let richards = |t: f64| 3.0 * (1.0 + (6f64.powf(2.5) - 1.0) * (-2.0 * t).exp()).powf(-0.4);
    let cases: [Case; 8] = [
        ("", "gompertz_rate(x, 3, 0.8)", 0.5, gompertz),
        ("", "0.8*x*(ln(3) - ln(x))", 0.5, gompertz),
        ("", "-0.8*x*ln(x/3)", 0.5, gompertz),
        ("", "richards_rate(x, 3, 0.8, 2.5)", 0.5, richards),
        ("", "3*x^(2/3) - 3*x", 0.125, |t| (1.0 - 0.5 * (-t).exp()).powi(3)),
        ("", "logistic_rate(x, 3, 0.8)", 0.5, |t| 3.0 / (1.0 + 5.0 * (-0.8 * t).exp())),
        ("", "approach_rate(x, 3, 0.8)", 0.5, |t| 3.0 - 2.5 * (-0.8 * t).exp()),
        (TRAPEZIUM, "gompertz_rate(x, 3, 0.8)*g(t)", 0.5, |t| {
            3.0 * (0.5f64 / 3.0).powf((-0.8 * under_trapezium(t)).exp())
        }),
    ];
    for (declared, rate, start, exact) in cases {
        let text = format!("{declared}initial string: A({start})\nA(x): solve dx/dt = {rate}");
        assert!(session(&text).model.is_closed_form(), "{rate}");
        let times = times(5.0, 50);
        let (found, stats) = trajectory(&text, Settings::default(), &times);
        assert_eq!(stats.rhs_evaluations, 0, "{rate}");
        for (t, x) in times.iter().zip(&found) {
            assert!(close(x[0], exact(*t), 1e-13), "{rate} at {t}: {} for {}", x[0], exact(*t));
        }
    }
}

#[test]
fn events_on_curves_are_exact() {
    // The instant at which x reaches a level, however far it is.
    type Case = (&'static str, f64, f64, f64);
    let cases: [Case; 6] = [
        // x = t² up to 1, then 1 + 2(t - 1), then 6 - (4 - t)².
        ("g(age)", 0.0, 0.25, 0.5),
        ("g(age)", 0.0, 3.0, 2.0),
        ("g(age)", 0.0, 5.75, 3.5),
        // The instant of a knot.
        ("g(age)", 0.0, 1.0, 1.0),
        // exp(G) = e at G = 1; 1/(1 + 5 exp(-G)) = 1/2 at G = ln 5, t = 1 + (ln 5 - 1)/2.
        ("g(age)*x", 1.0, std::f64::consts::E, 1.0),
        ("g(age)*x*(1 - x/3)", 0.5, 1.5, 0.5 * (1.0 + 1.609_437_912_434_100_4)),
    ];
    for (rate, start, level, when) in cases {
        let text = format!(
            "{TRAPEZIUM}initial string: A({start}, 0)\nA(x, s):\n  if x < {level} solve dx/dt = {rate}, ds/dt = 1\n  if x = {level} produce B(s)"
        );
        let (found, stats) = trajectory(&text, Settings::default(), &[10.0]);
        assert_eq!((stats.events, stats.rhs_evaluations), (1, 0), "{rate}");
        assert!(close(found[0][0], when, 4e-15), "{rate}: {} for {when}", found[0][0]);
    }
    // Up and down again: the curve has no inverse, and both instants are found.
    let text = "curve linear g = (0, 0) (1, 1) (3, -1) (4, 0)\ninitial string: A(0, 0)
        A(x, n): if n < 2 solve dx/dt = g(t)
          if n >= 2 solve dx/dt = 0
          if n < 2 & x = 0.875 produce A(x, n + 1 + t)";
    let (found, _) = trajectory(text, Settings::default(), &[1.6, 4.0]);
    assert!(close(found[0][1], 2.5, 1e-14), "{found:?}");
    // A value that is only touched.
    let text = "curve linear g = (0, 1) (2, -1)\ninitial string: A(0)
        A(x): if x <= 0.5 solve dx/dt = g(age)\n if x = 0.5 produce B(age)";
    let (found, _) = trajectory(text, Settings::default(), &[3.0]);
    assert!(close(found[0][0], 1.0, 1e-7), "{found:?}");
    // One that is only approached, where the curve comes to rest.
    let text = "curve linear g = (0, 1) (1, 0)\ninitial string: A(0)
        A(x): if x < 0.6 solve dx/dt = g(age)\n if x = 0.6 produce B(age)";
    assert_eq!(trajectory(text, Settings::default(), &[1000.0]).1.events, 0);
}

#[test]
fn conditions_on_curves_are_located() {
    // A day that has a temperature; at 18 degrees a bud opens, and at night it closes.
    let text = "curve linear warmth = (0, 8) (0.25, 12) (0.5, 24) (1, 8) periodic
        initial string: Bud(0)
        Bud(n): if warmth(t) > 18 produce Flower(n + 1)
        Flower(n): if warmth(t) < 18 produce Bud(n + t)";
    let (found, stats) = trajectory(text, Settings::default(), &[0.3, 0.5, 0.7, 2.9]);
    // Up through 18 at 0.375, down at 0.6875, day after day.
    let sums = [0.0, 1.0, 1.6875, 3.0 + 0.6875 + 1.6875 + 2.6875];
    for (x, sum) in found.iter().zip(sums) {
        assert!(close(x[0], sum, 1e-13), "{found:?}");
    }
    assert_eq!((stats.events, stats.rhs_evaluations), (6, 0));
}

#[test]
fn knots_do_not_spoil_the_order_of_methods() {
    // x' = g(age) - x has no formula here. Between knots: x = a + b u + (x_0 - a) exp(-u), with a = g_0 - b.
    let exact = |t: f64| {
        let (mut x, mut from) = (1.0, 0.0);
        for (to, g, b) in [(1.0, 0.0, 2.0), (3.0, 2.0, 0.0), (4.0, 2.0, -2.0), (f64::INFINITY, 0.0, 0.0)] {
            let u: f64 = f64::min(t, to) - from;
            let a: f64 = g - b;
            x = a + b * u + (x - a) * (-u).exp();
            if t <= to {
                break;
            }
            from = to;
        }
        x
    };
    let text = format!("{TRAPEZIUM}initial string: A(1)\nA(x): solve dx/dt = g(age) - x");
    let times = times(6.0, 60);
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let settings = Settings { tolerance, ..Settings::default() };
        let (found, stats) = trajectory(&text, settings, &times);
        for (t, x) in times.iter().zip(&found) {
            assert!(close(x[0], exact(*t), 100.0 * tolerance), "{tolerance} at {t}");
        }
        assert!(stats.rhs_evaluations < 1500, "{tolerance}: {} evaluations", stats.rhs_evaluations);
    }
}

#[test]
fn neighbours_may_follow_curves_of_time() {
    // Mass that comes in at a drawn rate and spreads between two cells is the curve's integral.
    let text = format!(
        "{TRAPEZIUM}initial string: A(0) B(0)
        A(x) > B(y): solve dx/dt = g(t) + 3*(y - x)
        A(x) < B(y): solve dy/dt = 3*(x - y)"
    );
    for scheduler in [Scheduler::Auto, Scheduler::Global] {
        let settings = Settings { tolerance: 1e-9, scheduler, ..Settings::default() };
        for (t, string) in
            [0.5, 1.0, 2.0, 3.7, 5.0].map(|t| (t, run(&text, settings, &[t]).expect("it runs")))
        {
            let sum = string[0][0].1[0] + string[0][1].1[0];
            assert!(close(sum, under_trapezium(t), 1e-8), "{t}: {sum}");
        }
    }
}

#[test]
fn a_curve_and_its_parts_agree() {
    for sort in ["linear", "monotone", "spline"] {
        let text = |x: f64| {
            format!(
                "curve {sort} g = (0, 0.2) (1, 0.5) (2.5, 2) (3, 2.2) (5, 3)
                initial string: A(g({x}), slope(g, {x}), integral(g, 0.25, {x}), inverse(g, g({x})))"
            )
        };
        let at = |x: f64| initial(&text(x))[0].1.clone();
        for x in [0.3, 0.9, 1.7, 2.6, 4.4] {
            let [value, slope, integral, inverse] = at(x)[..] else { panic!("four") };
            let rise = (at(x + 1e-5)[0] - at(x - 1e-5)[0]) / 2e-5;
            assert!(close(slope, rise, 1e-7), "{sort} at {x}: {slope} for {rise}");
            assert!(close(inverse, x, 1e-13), "{sort} at {x}: {inverse}");
            let rate = (at(x + 1e-5)[2] - at(x - 1e-5)[2]) / 2e-5;
            assert!(close(rate, value, 1e-7) && integral > 0.0 && x > 0.25, "{sort} at {x}");
        }
    }
}

#[test]
fn functions_of_the_library_have_their_slopes_integrals_and_inverses() {
    let cases = [
        ("logistic", "0.5, 3, 0.8", true, true),
        ("logistic", "4, 3, 0.8", true, true),
        ("gompertz", "0.5, 3, 0.8", false, true),
        ("richards", "0.5, 3, 0.8, 2.5", false, true),
        ("cubic_growth", "0.5, 3, 4", true, true),
        ("approach", "0.5, 3, 0.8", true, true),
        ("beta_growth", "3, 1.5, 4", true, false),
    ];
    for (name, rest, has_integral, has_inverse) in cases {
        let value = |what: String| initial(&format!("initial string: A({what})"))[0].1[0];
        let f = |t: f64| value(format!("{name}({t}, {rest})"));
        for t in [0.4, 1.3, 2.2, 3.6] {
            let rise = (f(t + 1e-5) - f(t - 1e-5)) / 2e-5;
            let slope = value(format!("slope({name}, {t}, {rest})"));
            assert!(close(slope, rise, 1e-8), "{name} at {t}: {slope} for {rise}");
            if has_inverse {
                let inverse = value(format!("inverse({name}, {name}({t}, {rest}), {rest})"));
                assert!(close(inverse, t, 1e-12), "{name} at {t}: {inverse}");
            }
            if has_integral {
                let integral = |t: f64| value(format!("integral({name}, 0.2, {t}, {rest})"));
                let rate = (integral(t + 1e-5) - integral(t - 1e-5)) / 2e-5;
                assert!(close(rate, f(t), 1e-8), "{name} at {t}: {rate} for {}", f(t));
                assert!(integral(0.2).abs() < 1e-15);
            }
        }
    }
    // The rates belong to the functions.
    for (name, rest, of_rate) in [
        ("logistic", "0.5, 3, 0.8", "3, 0.8"),
        ("gompertz", "0.5, 3, 0.8", "3, 0.8"),
        ("richards", "0.5, 3, 0.8, 2.5", "3, 0.8, 2.5"),
        ("approach", "0.5, 3, 0.8", "3, 0.8"),
    ] {
        let text = format!(
            "initial string: A(0.5, {name}(0, {rest}), {name}(0, {rest}))
            A(x, y, z): solve dx/dt = {name}_rate(x, {of_rate}), dy/dt = slope({name}, age, {rest}), dz/dt = {name}(age, {rest})"
        );
        let (found, _) =
            trajectory(&text, Settings { tolerance: 1e-9, ..Settings::default() }, &[0.0, 0.7, 3.1]);
        for x in &found {
            assert!(close(x[0], x[1], 1e-8), "{name}: {x:?}");
        }
        let value = |t: f64| initial(&format!("initial string: A({name}({t}, {rest}))"))[0].1[0];
        assert!(close(found[2][0], value(3.1), 1e-13), "{name}: {found:?}");
    }
    // The paper's function G, and Yin's beta function at rest at its end.
    let text = "initial string: A(cubic_growth(-1, 1, 3, 2), cubic_growth(1, 1, 3, 2), cubic_growth(5, 1, 3, 2), \
        beta_growth(0, 3, 1, 2), beta_growth(1, 4, 1, 2), beta_growth(9, 3, 1, 2))";
    assert_eq!(show(&initial(text)), "A(1, 2, 3, 0, 2, 3)");
}

#[test]
fn slopes_of_growth_functions_are_integrated_by_formula() {
    let text = "const m = 3
        initial string: A(0.5, 0, 0)
        A(x, y, z):
          solve dx/dt = slope(cubic_growth, age, 0.5, m, 4), dy/dt = logistic(age, 0.5, m, 0.8),
            dz/dt = 2*slope(beta_growth, t - 1, m, 1.5, 4)";
    assert!(session(text).model.is_closed_form());
    let (found, stats) = trajectory(text, Settings::default(), &[0.7, 3.0, 6.0]);
    assert_eq!(stats.rhs_evaluations, 0);
    let logistic = |t: f64| 3.0 / (1.0 + 5.0 * (-0.8 * t).exp());
    for (t, x) in [0.7f64, 3.0, 6.0].into_iter().zip(found) {
        let u = (t / 4.0).min(1.0);
        assert!(close(x[0], 0.5 + 2.5 * u * u * (3.0 - 2.0 * u), 1e-14), "{x:?}");
        assert!(close(x[1], quadrature(logistic, 0.0, t), 1e-12), "{x:?}");
        let v = ((t - 1.0) / 4.0).clamp(0.0, 1.0);
        assert!(close(x[2], 6.0 * (1.0 + 4.0 / 2.5 * (1.0 - v)) * v.powf(4.0 / 2.5), 1e-13), "{x:?}");
    }
}

#[test]
fn what_a_model_declares_itself_wins() {
    // The definition of the fixed notation has other arguments than the library's function.
    let text = "def logistic(x, r, m) = r*(1 - x/m)*x
        def slope(x) = 10*x
        const approach = 7
        initial string: F(logistic(1, 2, 4), slope(3), approach) richards(1)
        richards(length): let curve = 2*length\n solve dlength/dt = curve";
    assert_eq!(show(&initial(text)), "F(1.5, 30, 7) richards(1)");
    // Words that came later still name modules and parameters.
    let text = "initial string: table(1) curve include(2) match(3)
        curve: produce curve_x
        interpret curve_x: ε
        interpret include(n): F(n)
        interpret match(n): F(n)
        table(case): if case < 3 solve dcase/dt = case\n if case = 3 produce include(case)";
    assert_eq!(session(text).model.rules.len(), 2);
}

#[test]
fn arrays_match_and_let() {
    let text = "const angles = [30, 45, 2*30]
        const none = [-1]
        def form(n) = match n case 0: 10 case 1: 20 case length(angles): 30 else -1
        curve g = (0, 0) (length(angles), angles[1])
        initial string: A(angles[0], angles[1.9], angles[length(angles) - 1], form(0), form(1), form(3), form(2), none[0], g(9))";
    assert_eq!(show(&initial(text)), "A(30, 45, 60, 10, 20, 30, -1, -1, 45)");
    let text = "const rates = [1, 2, 4]
        initial string: F(0, 0)
        F(x, n):
          let rate = rates[n]
          let limit =
            match n
              case 0: 1
              case 1: 3
              else 100
          if x < limit solve dx/dt = rate
          if x = limit produce F(0, n + 1)";
    // 0 to 1 in 1, 0 to 3 in 1.5, then 4 for each unit of time.
    let (found, stats) = trajectory(text, Settings::default(), &[0.5, 1.5, 3.0]);
    assert_eq!(found, [[0.5, 0.0], [1.0, 1.0], [2.0, 2.0]]);
    assert_eq!((stats.events, stats.rhs_evaluations), (2, 0));
    // An element that changes with time jumps at whole numbers.
    let text =
        "const rates = [1, 2, 4, 8]\ninitial string: F(0)\nF(x): if age < 3.5 solve dx/dt = rates[age]";
    let text = format!("{text}\n  if age = 3.5 produce B(x)");
    let (found, _) =
        trajectory(&text, Settings { tolerance: 1e-9, ..Settings::default() }, &[0.5, 1.5, 2.5, 3.5]);
    for (x, exact) in found.iter().zip([0.5, 2.0, 5.0, 11.0]) {
        assert!(close(x[0], exact, 1e-8), "{found:?}");
    }
}

fn canonical(text: &str) -> String {
    dlsys::syntax::format::format(&dlsys::diagnostic::Source::new("a.dls", text)).expect("it parses")
}

#[test]
fn blocks_have_one_layout() {
    let text = "include   \"lib.dls\"\ncurve  spline g=( 0,0 ) (1,2),(3 , 4) (5,6)   periodic\n\
        table h from\"a.csv\"column \"mass\"\nconst a=[1,2 ,-3]\n\
        A(x):\n   let y=a[ x-1 ]\n let z = match x case 0:1 case 1 : -a[0] else y\n  solve dx/dt=slope( g,y )*z\n";
    let once = canonical(text);
    assert_eq!(
        once,
        "include \"lib.dls\"\ncurve spline g = (0, 0) (1, 2), (3, 4) (5, 6) periodic\n\
        table h from \"a.csv\" column \"mass\"\nconst a = [1, 2, -3]\n\
        A(x):\n  let y = a[x - 1]\n  let z = match x case 0: 1 case 1: -a[0] else y\n  solve dx/dt = slope(g, y)*z\n"
    );
    assert_eq!(canonical(&once), once);
}
