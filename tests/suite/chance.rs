//! Chance: times of events at a rate, draws and choices, compared with their distributions; random numbers depend on the
//! seed, the lineage and the place in the text, and on nothing else.
//!
//! The seeds are fixed, so the tests are deterministic. A correct distribution exceeds the bounds for one seed in a
//! thousand.

use std::collections::HashMap;

use dlsys::sim::{Event, Method, Scheduler, Settings};
use dlsys::tree::{Lineage, ModuleString};
use statrs::function::erf::erfc;

use crate::cli::dlsys;
use crate::common::{Plain, plain, session};

/// A bound of √n times the statistic of Kolmogorov and Smirnov, exceeded with probability 0.001.
const KS: f64 = 1.949;

/// √n times the largest difference between the distribution of values that should be uniform in (0, 1), and that.
fn kolmogorov(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let distance = |(i, u): (usize, &f64)| (u - i as f64 / n).abs().max((u - (i + 1) as f64 / n).abs());
    values.iter().enumerate().map(distance).fold(0.0, f64::max) * n.sqrt()
}

/// The productions of a model up to a time.
fn events(text: &str, settings: Settings, to: f64) -> Vec<Event> {
    let session = session(text);
    let mut simulation = session.simulate(Settings { log: true, ..settings }).expect("it starts");
    simulation.at(to, &mut ModuleString::default()).expect("it runs");
    simulation.take_events()
}

/// So many modules side by side, each in a branch.
fn many(n: usize, module: &str) -> String {
    format!("initial string: {}\n", format!("[ {module} ]\n").repeat(n))
}

/// Times of the events of n equal modules under a rule, all of which must have happened up to `to`.
fn times(n: usize, module: &str, rule: &str, to: f64) -> Vec<f64> {
    let all = events(&(many(n, module) + rule), Settings::default(), to);
    assert_eq!(all.len(), n, "all have had their event");
    all.iter().map(|event| event.time).collect()
}

/// Checks that the cumulative hazard at the events is exponentially distributed with mean 1.
fn check(times: Vec<f64>, cumulative: impl Fn(f64) -> f64) {
    let statistic = kolmogorov(times.into_iter().map(|t| (-cumulative(t)).exp()).collect());
    assert!(statistic < KS, "{statistic}");
}

#[test]
fn constant_rates_give_exponential_lives() {
    check(times(100_000, "F", "F: at rate 2 produce ε", 20.0), |t| 2.0 * t);
}

#[test]
fn rates_that_depend_on_time_have_their_distribution() {
    check(times(100_000, "F", "F: at rate 0.5 + 3*age^2 produce ε", 5.0), |t| 0.5 * t + t * t * t);
}

#[test]
fn rates_that_depend_on_the_state_have_their_distribution() {
    let rule = "F(x): solve dx/dt = 0.7*x at rate x produce ε";
    check(times(100_000, "F(0.1)", rule, 9.0), |t| 0.1 / 0.7 * ((0.7 * t).exp() - 1.0));
}

/// A rate without a formula: its integral is that of the logistic function.
const LOGISTIC: &str = "F(x): solve dx/dt = x*(1 - x) at rate 2*x produce ε";

#[test]
fn integrated_rates_have_their_distribution() {
    check(times(5_000, "F(0.1)", LOGISTIC, 20.0), |t| 2.0 * (1.0 + 0.1 * (t.exp() - 1.0)).ln());
}

#[test]
fn a_clock_stands_while_the_condition_does_not_hold() {
    let times = times(20_000, "F", "F: if t < 0.5 | t >= 2 at rate 1 produce ε", 20.0);
    assert!(times.iter().all(|t| *t < 0.5 || *t >= 2.0));
    assert!(times.iter().any(|t| *t < 0.5));
    check(times, |t| t.min(0.5) + (t - 2.0).max(0.0));
}

#[test]
fn a_clock_goes_on_at_another_rate_when_a_neighbour_is_replaced() {
    let rules = "N(y) < F: at rate y produce ε\nN(y): if y < 2 & t = 0.4 produce N(3)";
    let all = events(&(many(3_000, "N(1) F") + rules), Settings::default(), 12.0);
    let times: Vec<f64> = all.iter().filter(|e| e.rule == 0).map(|e| e.time).collect();
    assert_eq!(times.len(), 3_000);
    check(times, |t| t.min(0.4) + 3.0 * (t - 0.4).max(0.0));
}

#[test]
fn clauses_have_clocks_of_their_own() {
    // The first of two is exponential with the sum of the rates, and each wins by its share.
    let all = events(
        &(many(20_000, "F") + "F:\n at rate 1 produce K\n at rate 3 produce G"),
        Settings::default(),
        12.0,
    );
    let first = all.iter().filter(|e| e.clause == 0).count() as f64;
    assert!((first - 5_000.0).abs() < 3.3 * (20_000.0f64 * 0.25 * 0.75).sqrt(), "{first}");
    check(all.iter().map(|e| e.time).collect(), |t| 4.0 * t);
}

#[test]
fn times_do_not_depend_on_the_tolerance() {
    let coupled = "N(y) < F(x): solve dx/dt = y - x at rate x produce ε\nN(y): solve dy/dt = y*(2 - y)";
    let formulas = "F(x): solve dx/dt = 0.7*x at rate x produce ε";
    for (module, rule) in [("F(0.1)", LOGISTIC), ("N(0.2) F(0)", coupled), ("F(0.1)", formulas)] {
        let at = |tolerance| {
            let settings = Settings { tolerance, ..Settings::default() };
            let all = events(&(many(40, module) + rule), settings, 20.0);
            all.into_iter().map(|e| (e.lineage, e.time)).collect::<HashMap<Lineage, f64>>()
        };
        let (loose, tight) = (at(1e-6), at(1e-10));
        assert_eq!((loose.len(), tight.len()), (40, 40));
        let apart = loose.iter().map(|(who, t)| (t - tight[who]).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-9, "{rule}: {apart:e}");
    }
}

/// A bush with everything in it: weights, draws, rates by formula and by integration, contexts.
const BUSH: &str = "
initial string: B(1) A(1, uniform(0.8, 1.2))
A(s, v):
  at rate 2*v
    produce 3: F(0, s) [ +(normal(30, 5)) A(0.8*s, v*lognormal(0, 0.1)) ] A(0.9*s, v)
         or 1: F(0, s) [ -(choice(20, 40)) L(0.1) ] A(0.9*s, uniform(0.5, 1))
         or 0.2*s: F(0, s) L(0.1)
B(y) < F(x, s): solve dx/dt = y*(s - x)
F(x, s): solve dx/dt = s - x
L(x):
  solve dx/dt = x*(1 - x)
  if age > 0.5 at rate x produce K(integer(1, 3))
B(y): solve dy/dt = 0.1*y
";

/// All productions of the bush, and its string at the end.
fn bush(settings: Settings, frames: usize) -> (Vec<(Lineage, u64, Option<usize>)>, String) {
    let session = session(BUSH);
    let mut simulation = session.simulate(Settings { log: true, ..settings }).expect("it starts");
    let mut string = ModuleString::default();
    for i in 1..=frames {
        simulation.at(3.0 * i as f64 / frames as f64, &mut string).expect("it runs");
    }
    let all = simulation.take_events();
    assert!(all.len() > 40, "it grows");
    let events = all.iter().map(|e| (e.lineage, e.time.to_bits(), e.successor)).collect();
    (events, format!("{:?}", plain(&session.model, &string)))
}

#[test]
fn the_same_seed_gives_the_same_plant() {
    let settings = Settings { seed: 5, ..Settings::default() };
    let (events, string) = bush(settings, 10);
    assert_eq!(bush(settings, 10).1, string);
    let again = bush(settings, 1000);
    assert_eq!(again.0, events, "events do not depend on frames");
    assert_eq!(again.1, string, "nor does the string");
    assert_eq!(bush(Settings { slow: true, ..settings }, 10).0, events, "the general way is the quick one");
    let sorted = |mut all: Vec<(Lineage, u64, Option<usize>)>| {
        all.sort_by_key(|(_, time, _)| *time);
        all
    };
    let global = bush(Settings { scheduler: Scheduler::Global, ..settings }, 10);
    assert_eq!(sorted(global.0).len(), events.len());
    assert_ne!(bush(Settings { seed: 8, ..settings }, 10).1, string);
}

#[test]
fn schedulers_methods_and_tolerances_draw_the_same() {
    let reference = bush(Settings { seed: 7, ..Settings::default() }, 1).0;
    let others = [
        Settings { seed: 7, scheduler: Scheduler::Global, ..Settings::default() },
        Settings { seed: 7, tolerance: 1e-10, ..Settings::default() },
        Settings { seed: 7, method: Method::Dop853, ..Settings::default() },
    ];
    for settings in others {
        let all: HashMap<Lineage, (u64, Option<usize>)> =
            bush(settings, 1).0.into_iter().map(|(who, time, which)| (who, (time, which))).collect();
        assert_eq!(all.len(), reference.len(), "{settings:?}");
        for (who, time, which) in &reference {
            let (other, chosen) = all.get(who).expect("the same modules");
            assert_eq!(chosen, which);
            assert!((f64::from_bits(*other) - f64::from_bits(*time)).abs() < 1e-9, "{settings:?}");
        }
    }
}

#[test]
fn a_rule_changed_for_one_branch_leaves_the_others_alone() {
    let text = |other: &str| {
        format!(
            "initial string: [ B(1) ] [ A(1) ]
             A(s): at rate 1 produce 1: F(uniform(0, 1)) [ A(0.5*s) ] A(s) or 1: F(normal(s, 1)) A(s)
             B(s): {other}"
        )
    };
    let of_a = |text: &str| {
        let session = session(text);
        let mut simulation = session.simulate(Settings::default()).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(4.0, &mut string).expect("it runs");
        let kinds = &session.model.kinds;
        let modules = string.iter().filter(|m| matches!(&*kinds.get(m.kind).name, "A" | "F"));
        modules.map(|m| (m.lineage, m.age.to_bits(), m.parameters.to_vec())).collect::<Vec<_>>()
    };
    let one = of_a(&text("at rate 1 produce G(uniform(0, 1)) B(s) B(s)"));
    assert!(one.len() > 5);
    assert_eq!(one, of_a(&text("solve ds/dt = 1 if s = 2 produce ε")));
    assert_eq!(one, of_a(&text("at rate 5 produce 1: G(exponential(2)) B(s) or 2: ε")));
}

/// The first parameters of n modules of the initial string.
fn draws(n: usize, what: &str) -> Vec<f64> {
    let session = session(&format!("initial string: {}", format!("F({what})\n").repeat(n)));
    let mut simulation = session.simulate(Settings { seed: 11, ..Settings::default() }).expect("it starts");
    let mut string = ModuleString::default();
    simulation.at(0.0, &mut string).expect("it runs");
    string.iter().map(|m| m.parameters[0]).collect()
}

#[test]
fn draws_have_their_distributions() {
    let normal = |z: f64| 0.5 * erfc(-z / std::f64::consts::SQRT_2);
    type Cumulative<'a> = &'a dyn Fn(f64) -> f64;
    let all: [(&str, Cumulative); 5] = [
        ("uniform(-1, 3)", &|x| (x + 1.0) / 4.0),
        ("normal(2, 0.5)", &|x| normal((x - 2.0) / 0.5)),
        ("lognormal(1, 0.3)", &|x| normal((x.ln() - 1.0) / 0.3)),
        ("exponential(4)", &|x| 1.0 - (-4.0 * x).exp()),
        // The sum of two draws of one module: they have nothing in common.
        ("uniform(0, 1) + uniform(0, 1)", &|x| {
            if x < 1.0 { x * x / 2.0 } else { 1.0 - (2.0 - x) * (2.0 - x) / 2.0 }
        }),
    ];
    for (what, cumulative) in all {
        let statistic = kolmogorov(draws(20_000, what).into_iter().map(cumulative).collect());
        assert!(statistic < KS, "{what}: {statistic}");
    }
}

#[test]
fn whole_numbers_and_choices_are_equally_likely() {
    // Chi-square with 5 degrees of freedom exceeds 20.5 with probability 0.001.
    for (what, values) in [
        ("integer(1, 6)", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ("choice(2, 3, 5, 7, 11, 13)", [2.0, 3.0, 5.0, 7.0, 11.0, 13.0]),
    ] {
        let all = draws(12_000, what);
        let counts = values.map(|v| all.iter().filter(|x| **x == v).count() as f64);
        assert_eq!(counts.iter().sum::<f64>(), 12_000.0, "{what}");
        let chi: f64 = counts.iter().map(|n| (n - 2_000.0) * (n - 2_000.0) / 2_000.0).sum();
        assert!(chi < 20.5, "{what}: {chi}");
    }
}

#[test]
fn weights_are_values_at_the_event() {
    let text = many(9_000, "F(0)") + "F(x): solve dx/dt = 1 if x = 2 produce x: K or 1: G or 0: H";
    let all = events(&text, Settings::default(), 3.0);
    let count = |which| all.iter().filter(|e| e.successor == Some(which)).count() as f64;
    assert!((count(0) - 6_000.0).abs() < 3.3 * (9_000.0f64 * 2.0 / 9.0).sqrt(), "{}", count(0));
    assert_eq!((count(0) + count(1), count(2)), (9_000.0, 0.0));
}

/// The stochastic L-system of ABOP, figure 1.27, angles left out.
const WEEDS: &str = "
initial string: F
F -> 1: F [ + F ] F [ - F ] F
  or 1: F [ + F ] F
  or 1: F [ - F ] F
";

#[test]
fn the_weeds_of_the_book_have_their_frequencies() {
    let session = session(WEEDS);
    let (mut counts, mut segments) = ([0.0; 3], Vec::new());
    for seed in 0..400 {
        let mut simulation =
            session.simulate(Settings { seed, log: true, ..Settings::default() }).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(4.0, &mut string).expect("it runs");
        for event in simulation.take_events() {
            counts[event.successor.expect("there is a choice")] += 1.0;
        }
        let is_segment = |m: &dlsys::tree::Module| session.model.kinds.get(m.kind).name == "F";
        segments.push(string.iter().filter(is_segment).count() as f64);
    }
    // Chi-square with 2 degrees of freedom exceeds 13.8 with probability 0.001.
    let expected = counts.iter().sum::<f64>() / 3.0;
    let chi: f64 = counts.iter().map(|n| (n - expected) * (n - expected) / expected).sum();
    assert!(chi < 13.8, "{counts:?}: {chi}");
    // A branching process: five offspring or three, with mean 11/3 and variance 8/9 (Harris 1963, section I.5).
    let (m, variance) = (11.0f64 / 3.0, 8.0 / 9.0);
    let deviation = (variance * m.powi(3) * (m.powi(4) - 1.0) / (m - 1.0)).sqrt();
    let mean = segments.iter().sum::<f64>() / 400.0;
    assert!((mean - m.powi(4)).abs() < 3.3 * deviation / 20.0, "{mean}");
    let spread = (segments.iter().map(|x| (x - m.powi(4)).powi(2)).sum::<f64>() / 400.0).sqrt();
    assert!((spread / deviation - 1.0).abs() < 0.15, "{spread}, {deviation}");
}

#[test]
fn weights_of_discrete_rules_read_parameters_and_go_on_over_lines() {
    let text =
        many(4_000, "A(3)") + "A(n) : n > 0\n  -> n: K\n  or (1): G\nB -> 1: A(1) or 2: ε\ninterpret B: ε";
    let all = events(&(text + "\nG -> B"), Settings::default(), 1.5);
    let first = all.iter().filter(|e| e.successor == Some(0)).count() as f64;
    assert!((first - 3_000.0).abs() < 3.3 * (4_000.0f64 * 3.0 / 16.0).sqrt(), "{first}");
}

#[test]
fn models_that_use_these_words_otherwise_go_on_working() {
    let text = "
def uniform(a, b) = a + b
def choice(x) = 2*x
initial string: at(1) rate or(choice(2))
at(x):
  if x < 3 solve dx/dt = uniform(1, 0)
  if x = 3 produce or(uniform(1, 2)) at(0) or(1)
or(x) < rate: produce at(1)
";
    let session = session(text);
    assert!(session.model.rules.iter().flat_map(|r| &r.produces).all(|p| !p.outcome.is_random()));
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).expect("it starts").at(2.5, &mut string).expect("it runs");
    let names: Vec<Plain> = plain(&session.model, &string);
    assert_eq!(names[0], ("or".to_owned(), vec![3.0]));
}

#[test]
fn weights_and_rates_have_a_layout() {
    let text = "initial string: A(1)\nA(x):\n  if x<2\n at rate  3*x produce 2:F or x :G\n or 1:[ A(1) ]A(2)\n at rate 1\n  produce F\n";
    let laid_out = |text: &str| {
        dlsys::syntax::format::format(&dlsys::diagnostic::Source::new("t", text)).expect("a layout")
    };
    let once = laid_out(text);
    assert_eq!(
        once,
        "initial string: A(1)\nA(x):\n  if x < 2\n    at rate 3*x produce 2: F or x: G\n                     or 1: [ A(1) ]A(2)\n  at rate 1\n    produce F\n"
    );
    assert_eq!(laid_out(&once), once);
}

#[test]
fn who_draws_a_module_sees_no_clock() {
    let text = "initial string: F(2)\nF(x): at rate 0.001 produce ε\ninterpret F(x): F(x + age) +(t)";
    let session = session(text);
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).expect("it starts").at(3.0, &mut string).expect("it runs");
    assert_eq!(plain(&session.model, &string), [("F".to_owned(), vec![2.0])]);
    let mut scene = dlsys::turtle::blank(&session.model);
    dlsys::turtle::draw(&session.model, &string, &mut scene).expect("drawable");
    let measure = session.measure("F(x): x + age + t").expect("a measure");
    assert_eq!(measure.over(3.0, string.iter().map(|m| (m.kind, m.parameters, m.age))), 8.0);
}

/// A file with a model, and the folder that holds it.
fn saved(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bush.dls");
    std::fs::write(&file, text).expect("saved");
    let name = file.to_str().expect("plain").to_owned();
    (folder, name)
}

#[test]
fn specimens_are_the_runs_of_their_seeds() {
    let (folder, model) = saved(BUSH);
    let csv = folder.path().join("spread.csv").display().to_string();
    let plot = folder.path().join("spread.svg").display().to_string();
    let run = |threads: &str, more: &[&str]| {
        let arguments = [
            "run",
            &model,
            "--at",
            "1,2",
            "--seeds",
            "3..8",
            "--measure",
            "F(x, s): x",
            "--measure",
            "A(s, v)",
        ];
        let arguments = [&arguments, &["--threads", threads][..], more].concat();
        let done = dlsys(&arguments);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).expect("text")
    };
    let one = run("1", &["--format", "json"]);
    assert_eq!(one, run("2", &["--format", "json"]), "nothing depends on threads");
    let lines: Vec<serde_json::Value> =
        one.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines.len(), 6);
    let session = session(BUSH);
    for (line, seed) in lines.iter().zip(3..) {
        let mut simulation = session.simulate(Settings { seed, ..Settings::default() }).expect("it starts");
        let mut string = ModuleString::default();
        for (i, t) in [1.0, 2.0].into_iter().enumerate() {
            simulation.at(t, &mut string).expect("it runs");
            let count = plain(&session.model, &string).iter().filter(|(name, _)| name == "A").count();
            assert_eq!(line["measures"]["A(s, v)"][i], count as f64, "seed {seed}");
            let sum: f64 = plain(&session.model, &string).iter().filter(|m| m.0 == "F").map(|m| m.1[0]).sum();
            assert!((line["measures"]["F(x, s): x"][i].as_f64().expect("a number") - sum).abs() < 1e-12);
        }
    }
    let table = run("2", &["--csv", &csv, "--plot", &plot]);
    assert!(table.contains("A(s, v)  6 specimens") && table.contains("median"), "{table}");
    let written = std::fs::read_to_string(&csv).expect("written");
    assert_eq!(written.lines().count(), 5);
    let values: Vec<f64> =
        lines.iter().map(|l| l["measures"]["A(s, v)"][1].as_f64().expect("a number")).collect();
    let mean = values.iter().sum::<f64>() / 6.0;
    assert!(written.contains(&format!("\"A(s, v)\",2,6,{mean},")), "{written}");
    assert!(std::fs::read_to_string(&plot).expect("written").contains("</svg>"));
}

#[test]
fn specimens_are_rendered_into_folders_to_one_scale() {
    let (folder, model) = saved(BUSH);
    let out = folder.path().join("all").display().to_string();
    let done = dlsys(&["render", &model, "--at", "1,2", "--seeds", "9..10", "--out", &out, "--threads", "2"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let manifest = |seed: &str| -> serde_json::Value {
        let path = folder.path().join("all").join(seed).join("manifest.json");
        serde_json::from_str(&std::fs::read_to_string(path).expect("written")).expect("JSON")
    };
    let (nine, ten) = (manifest("seed-09"), manifest("seed-10"));
    let find = |m: &serde_json::Value, key: &str| m.pointer(key).cloned();
    assert_eq!(nine["view_box"], ten["view_box"]);
    assert!(nine.to_string().contains("\"seed\":9") && ten.to_string().contains("\"seed\":10"));
    assert_eq!(find(&nine, "/frames").map(|f| f.as_array().map(Vec::len)), Some(Some(2)));
}

#[test]
fn wrong_measures_and_seeds_are_refused() {
    let (_folder, model) = saved(BUSH);
    for (arguments, says) in [
        (&["--seeds", "3..1"][..], "1 is before 3"),
        (&["--seeds", "3"], "FIRST..LAST"),
        (&["--seeds", "0..3", "--measure", "Q(x)"], "the model has no `Q`"),
        (&["--seeds", "0..3", "--measure", "F(x)"], "`F` has 2 parameters"),
        (&["--seeds", "0..3", "--measure", "F(x, s): y"], "`y`"),
        (&["--seeds", "0..3", "--measure", "F(x, s): uniform(0, 1)"], "cannot be done here"),
        (&["--seeds", "0..3", "--measure", "F(x, s"], "a measure is a module"),
        (&["--measure", "F(x, s)"], "--seeds"),
        (&["--seeds", "0..3", "--seed", "1"], "--seed"),
    ] {
        let done = dlsys(&[&["run", &model, "--at", "1"], arguments].concat());
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(says), "{arguments:?}: {said}");
    }
}

#[test]
fn a_specimen_that_fails_is_named() {
    let (_folder, model) =
        saved("initial string: F\nF: at rate 1 produce G(normal(0, 1))\nG(x): if age = 1 produce K(sqrt(x))");
    let done = dlsys(&["run", &model, "--at", "9", "--seeds", "0..40"]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(said.contains("the specimen of `--seed 1`"), "{said}");
}
