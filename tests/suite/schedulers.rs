//! Re-integration and matching of contexts after events: the local algorithms against the global ones.

use dlsys::session::Session;
use dlsys::sim::{Error, Method, Scheduler, Settings};
use proptest::prelude::*;

use crate::common::{Plain, run, show};
use crate::dice::Dice;

/// A filament, maybe with branches, of cells that grow, divide, exchange and decay.
fn tissue(seed: u64) -> String {
    let mut dice = Dice(seed);
    let d = |dice: &mut Dice| dice.between(0.02, 0.6);
    tissue_with(&mut dice, d)
}

/// The same whose cells exchange so fast that the equations are stiff.
fn stiff_tissue(seed: u64) -> String {
    tissue_with(&mut Dice(seed), |dice| 10f64.powf(dice.between(2.0, 4.5)))
}

fn tissue_with(dice: &mut Dice, d: impl FnOnce(&mut Dice) -> f64) -> String {
    let growth = dice.pick(&["0.2*x", "0.3", "0.1*x*(2 - x) + 0.05", "0.2*x + 0.001*c", "0.2*sqrt(x)"]);
    let exchange = dice.pick(&[
        "D*(l + r - 2c) - 0.1*c",
        "D*(l^2 + r^2 - 2*c^2)/4 - 0.05*c",
        "D*(l - c) - 0.1*(c - 1)",
        "D*(l + r - 2c) + (if c < 1 then 0.2 else -0.1*c)",
        "D*(l + r - 2c) - 0.2*c*x",
    ]);
    let successor = dice.pick(&[
        "F(0.4*x, c) F(0.6*x, c)",
        "F(0.5*x, 1.5*c) F(0.5*x, 0.5*c)",
        "F(0.5*x, c) [+ F(0.3, c)] F(0.5*x, c)",
        "F(0.3*x, 0.8*c + 0.1)",
    ]);
    let d = d(dice);
    let mut cells = String::new();
    for i in 0..120 {
        let (x, c) = (dice.between(0.4, 1.0), dice.between(0.6, 3.0));
        let cell = if i % 29 == 7 { format!("H({c:.4}) ") } else { format!("F({x:.4}, {c:.4}) ") };
        cells += &cell;
    }
    format!(
        "const D = {d:.4}\ninitial string: H(2) {cells} H(1)\n\
         def flow(l, c, r, x) = {exchange}\n\
         F(y, l) < F(x, c) > F(z, r):\n  if x < 1 & c > 0.3 solve dx/dt = {growth}, dc/dt = flow(l, c, r, x)\n  \
         if x = 1 & c > 0.3 produce {successor}\n  if c <= 0.3 produce H(2)\n\
         H(l) < F(x, c) > F(z, r):\n  if x < 1 & c > 0.3 solve dx/dt = {growth}, dc/dt = flow(l, c, r, x)\n  \
         if x = 1 & c > 0.3 produce {successor}\n  if c <= 0.3 produce H(2)\n\
         F(y, l) < F(x, c) > H(r):\n  if x < 1 & c > 0.3 solve dx/dt = {growth}, dc/dt = flow(l, c, r, x)\n  \
         if x = 1 & c > 0.3 produce {successor}\n  if c <= 0.3 produce H(2)\n\
         H(h): solve dh/dt = 0.5*(2 - h)\n"
    )
}

/// The largest difference of parameters, relative to max(1, |value|); the strings must be the same.
fn distance(a: &[Vec<Plain>], b: &[Vec<Plain>], context: &str) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        let names = |s: &[Plain]| s.iter().map(|m| m.0.clone()).collect::<Vec<_>>();
        assert_eq!(names(a), names(b), "{context}");
        for ((_, x), (_, y)) in a.iter().zip(b) {
            for (x, y) in x.iter().zip(y) {
                worst = worst.max((x - y).abs() / y.abs().max(1.0));
            }
        }
    }
    worst
}

const TIMES: [f64; 4] = [0.5, 1.5, 3.0, 5.0];

#[test]
fn repairs_err_no_more_than_the_tolerance() {
    let mut compared = 0;
    for seed in 0..16 {
        let text = tissue(seed);
        let with = |scheduler, method, tolerance| {
            let settings = Settings { scheduler, method, tolerance, ..Settings::default() };
            run(&text, settings, &TIMES)
        };
        let exact = match with(Scheduler::Global, Method::Auto, 1e-10) {
            Ok(exact) => exact,
            // The exchange that jumps at c = 1 may lead back there from both sides.
            Err(Error::Chattering { .. }) => continue,
            Err(error) => panic!("{error}\n{text}"),
        };
        compared += 1;
        for (method, tolerance) in
            [(Method::Auto, 1e-4), (Method::Auto, 1e-6), (Method::Auto, 1e-8), (Method::Dopri5, 1e-6)]
        {
            let ours = with(Scheduler::Auto, method, tolerance).unwrap_or_else(|e| panic!("{e}\n{text}"));
            let error = distance(&ours, &exact, &text);
            assert!(error <= 20.0 * tolerance, "{method:?} at {tolerance:e} errs by {error:e}\n{text}");
        }
    }
    assert!(compared >= 12, "{compared} tissues");
}

#[test]
fn repairs_of_stiff_steps_err_no_more_than_the_tolerance() {
    let (times, mut compared) = ([0.1, 0.3, 0.5], 0);
    for seed in 0..12 {
        let text = stiff_tissue(seed);
        let with = |scheduler, tolerance| {
            run(&text, Settings { scheduler, tolerance, ..Settings::default() }, &times)
        };
        let exact = match with(Scheduler::Global, 1e-10) {
            Ok(exact) => exact,
            // The exchange that jumps at c = 1 may lead back there from both sides.
            Err(Error::Chattering { .. }) => continue,
            Err(error) => panic!("{error}\n{text}"),
        };
        compared += 1;
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let ours = with(Scheduler::Auto, tolerance).unwrap_or_else(|e| panic!("{e}\n{text}"));
            let error = distance(&ours, &exact, &text);
            assert!(error <= 20.0 * tolerance, "at {tolerance:e} errs by {error:e}\n{text}");
        }
    }
    assert!(compared >= 8, "{compared} tissues");
}

/// Cells that exchange fast, each of which halves what it holds once in a unit of time.
#[test]
fn stiff_events_cost_what_they_touch() {
    let mut dice = Dice(5);
    let cells: String = (0..1000)
        .map(|_| format!("F({:.6}, {:.4}) ", dice.between(0.0, 1.0), dice.between(50.0, 200.0)))
        .collect();
    let text = format!(
        "const D = 1e4\ninitial string: W(255) {cells} W(255)\n         F(u, l) < F(x, c) > F(v, r):\n  if x < 1 solve dx/dt = 1, dc/dt = D*(l + r - 2c) - 0.03*c\n  \
         if x = 1 produce F(0, 0.5*c + 60)\n         W(l) < F(x, c) > F(v, r):\n  if x < 1 solve dx/dt = 1, dc/dt = D*(l + r - 2c) - 0.03*c\n  \
         if x = 1 produce F(0, 0.5*c + 60)\n         F(u, l) < F(x, c) > W(r):\n  if x < 1 solve dx/dt = 1, dc/dt = D*(l + r - 2c) - 0.03*c\n  \
         if x = 1 produce F(0, 0.5*c + 60)\n"
    );
    let session = Session::from_text("busy and stiff", &text, &[]).expect("a model");
    let work = |scheduler| {
        let settings = Settings { scheduler, ..Settings::default() };
        let mut simulation = session.simulate(settings).expect("it starts");
        // The first steps find out that the equations are stiff.
        simulation.pass(0.03).expect("it runs");
        let before = simulation.stats();
        simulation.pass(0.09).expect("it runs");
        let stats = simulation.stats();
        assert!((40..80).contains(&(stats.events - before.events)), "{stats:?}");
        stats.rhs_evaluations - before.rhs_evaluations
    };
    let (ours, all) = (work(Scheduler::Auto), work(Scheduler::Global));
    assert!(4 * ours < all, "{ours} evaluations of one module, {all} if each event ends the step for all");
}

#[test]
fn repairs_do_not_depend_on_what_is_observed() {
    let far: Vec<f64> = (0..=200).map(|i| f64::from(i) * 0.025).collect();
    let near: Vec<f64> = far.iter().map(|t| t / 10.0).collect();
    for (text, few, often) in [(tissue(3), TIMES.to_vec(), far), (stiff_tissue(3), vec![0.1, 0.5], near)] {
        let one = run(&text, Settings::default(), &few).expect("runs");
        let other = run(&text, Settings::default(), &often).expect("runs");
        for (t, state) in few.iter().zip(&one) {
            let at = often.iter().position(|u| (u - t).abs() < 1e-12).expect("observed");
            assert_eq!(show(state), show(&other[at]));
        }
    }
}

#[test]
fn slices_err_in_proportion_to_their_length() {
    let text = "initial string: F(0.5, 1) F(0.6, 3) F(0.7, 2)\n\
                F(y, l) < F(x, c): if x < 1 solve dx/dt = 0.1, dc/dt = 0.5*(l - c)\n  \
                if x = 1 produce F(0.5, c) F(0.5, c)\nF(x, c): solve dx/dt = 0, dc/dt = -0.3*c";
    let with = |scheduler| run(text, Settings { scheduler, ..Settings::default() }, &[6.0]).expect("runs");
    let exact = with(Scheduler::Global);
    let error = |slice| distance(&with(Scheduler::Local { slice }), &exact, text);
    let (coarse, fine) = (error(0.1), error(0.0125));
    assert!(coarse > 1e-3 && (5.0..11.0).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
}

/// A string of modules with the times of their births, rewritten as the language says, by looking at all of it.
struct Rewriting {
    string: Vec<(char, u32)>,
    /// Left context, predecessor, right context, successor.
    rules: Vec<(Option<char>, char, Option<char>, String)>,
}

const SKIPPED: &str = "+C";

impl Rewriting {
    fn left(&self, mut i: usize) -> Option<char> {
        let mut depth = 0;
        while i > 0 {
            i -= 1;
            match self.string[i].0 {
                ']' => depth += 1,
                // The bracket of a finished branch, or that of our own.
                '[' if depth > 0 => depth -= 1,
                '[' => {}
                c if depth == 0 && !SKIPPED.contains(c) => return Some(c),
                _ => {}
            }
        }
        None
    }

    fn right(&self, i: usize) -> Option<char> {
        let mut depth = 0;
        for &(c, _) in &self.string[i + 1..] {
            match c {
                '[' => depth += 1,
                ']' if depth == 0 => return None,
                ']' => depth -= 1,
                c if depth == 0 && !SKIPPED.contains(c) => return Some(c),
                _ => {}
            }
        }
        None
    }

    /// Everything that happens at an instant: modules of age 1 and more are replaced where a rule applies.
    fn step(&mut self, now: u32) {
        loop {
            let replaced: Vec<Option<&str>> = (0..self.string.len())
                .map(|i| {
                    let (c, birth) = self.string[i];
                    let fits =
                        |wanted: Option<char>, found: Option<char>| wanted.is_none() || wanted == found;
                    let rule = self.rules.iter().find(|(left, strict, right, _)| {
                        *strict == c && fits(*left, self.left(i)) && fits(*right, self.right(i))
                    })?;
                    (now > birth).then_some(rule.3.as_str())
                })
                .collect();
            if replaced.iter().all(Option::is_none) || self.string.len() > 30_000 {
                return;
            }
            let mut next = Vec::new();
            for (module, successor) in self.string.iter().zip(&replaced) {
                match successor {
                    None => next.push(*module),
                    Some(successor) => next.extend(successor.chars().map(|c| (c, now))),
                }
            }
            self.string = next;
        }
    }
}

/// Rules over A, B, C, D and +, with contexts, branches and modules that are skipped; the last two applied to
/// everything.
fn rewriting(seed: u64) -> Rewriting {
    let mut dice = Dice(seed);
    let parts = ["A", "B", "C", "D", "+", "A", "B", "[A]", "[+B]", "[C[D]A]", ""];
    let kinds = ["A", "B", "C", "D", "+"];
    let one = |s: &str| s.chars().next();
    let mut rules = Vec::new();
    for _ in 0..9 {
        let strict = one(dice.pick(&kinds)).expect("a kind");
        let context =
            |dice: &mut Dice| (dice.unit() < 0.6).then(|| one(dice.pick(&["A", "B", "D"]))).flatten();
        let (left, right) = (context(&mut dice), context(&mut dice));
        let length = (dice.unit() * 3.5) as usize;
        let successor: String = (0..length).map(|_| dice.pick(&parts)).collect();
        rules.push((left, strict, right, successor));
    }
    // The more that a head asks for, the earlier it must be written; and each only once.
    rules.sort_by_key(|r| (usize::from(r.0.is_none()) + usize::from(r.2.is_none()), r.0, r.1, r.2));
    rules.dedup_by_key(|r| (r.0, r.1, r.2));
    let string: String = "ABCD+".chars().chain((0..12).flat_map(|_| dice.pick(&parts).chars())).collect();
    Rewriting { string: string.chars().map(|c| (c, 0)).collect(), rules }
}

impl Rewriting {
    fn model(&self) -> String {
        let spaced = |s: &str| match s.is_empty() {
            true => "ε".to_owned(),
            false => s.chars().map(|c| format!("{c} ")).collect(),
        };
        let start: String = self.string.iter().map(|m| m.0).collect();
        let mut text = format!("ignore C\ninitial string: {}\n", spaced(&start));
        for (left, strict, right, successor) in &self.rules {
            let left = left.map_or(String::new(), |c| format!("{c} < "));
            let right = right.map_or(String::new(), |c| format!(" > {c}"));
            text += &format!("{left}{strict}{right}: if age >= 1 produce {}\n", spaced(successor));
        }
        text
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn contexts_are_those_of_the_whole_string(seed in 0u64..1_000_000) {
        let mut plain = rewriting(seed);
        let text = plain.model();
        let times: Vec<f64> = (0..7).map(f64::from).collect();
        let settings = Settings { max_modules: 3000, ..Settings::default() };
        // Too many modules, or a cascade without end, is not what is tested.
        if let Ok(states) = run(&text, settings, &times) {
            for (now, state) in states.iter().enumerate() {
                plain.step(now as u32);
                let expected: Vec<String> = plain.string.iter().map(|m| m.0.to_string()).collect();
                let found: Vec<String> = state.iter().map(|m| m.0.clone()).collect();
                prop_assert_eq!(found, expected, "at t = {}\n{}", now, text);
            }
        }
    }
}
