//! The fast path against the reference path: both must give the same bits, the same log of events and the same errors,
//! whichever times are observed.

use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;
use proptest::prelude::*;

use crate::common::{models, repository};

const LAWS: [&str; 8] = ["1", "0.5", "2", "2*(1 - x/3)*x", "x", "0.25 + age", "3 - x", "1 + 0.5*age^2 - x*0"];
/// What follows, with `n` generations to go.
const SUCCESSORS: [&str; 8] = [
    "A(0.5, n - 1) B(0.25, n - 1)",
    "B(0.5, n - 1) [ + C(0.5, n - 1) ] A(0.25, n - 1)",
    "C(0.25, n - 1) - A(0.5, n - 1)",
    "A(x/4, n - 1) + A(x/4, n - 1)",
    "[ B(0.25, n - 1) ] [ B(0.5, n - 1) ]",
    // Over as soon as it is there.
    "A(2, n - 1) B(1.5, n - 1)",
    "D(t) C(0.5, n - 1)",
    "",
];
const HEIGHTS: [&str; 4] = ["1", "1.5", "2", "1 + n/8"];
/// Contexts: none, one that only has to be there, one whose motion is read, one read by equations.
const CONTEXTS: [&str; 4] = [
    "",
    "D(b) < A(x, n):\n if x < 1 solve dx/dt = 1, dn/dt = 0\n if x >= 1 produce D(b)\n",
    "C(y, m) < B(x, n):\n if x < y + 0.5 solve dx/dt = 2, dn/dt = 0\n if x >= y + 0.5 produce D(y)\n",
    "A(x, n) > B(y, m):\n if x < 1 solve dx/dt = 0.5 + 0.1*y, dn/dt = 0\n if x >= 1 produce D(y)\n",
];

fn rule(kind: &str, law: usize, height: usize, successor: usize) -> String {
    let (law, height, successor) = (LAWS[law], HEIGHTS[height], SUCCESSORS[successor]);
    let successor = if successor.is_empty() { "ε" } else { successor };
    format!(
        "{kind}(x, n):\n if x < {height} solve dx/dt = {law}, dn/dt = 0\n if x >= {height} & n > 0 produce {successor}\n \
         if x >= {height} & n <= 0 produce D(x) E(x, 0)\n"
    )
}

/// All that can be seen of a run: at each time the modules with the bits of their numbers, then the log.
fn seen(text: &str, settings: Settings, times: &[f64], shown: &[f64]) -> Vec<String> {
    let session = crate::common::session(text);
    let mut all = Vec::new();
    let mut simulation = match session.simulate(settings) {
        Ok(simulation) => simulation,
        Err(error) => return vec![error.to_string()],
    };
    let (mut string, mut other) = (ModuleString::default(), ModuleString::default());
    for (i, &t) in times.iter().enumerate() {
        // Two strings that are filled again, in turns.
        let string = if i % 3 == 0 { &mut other } else { &mut string };
        if let Err(error) = simulation.at(t, string) {
            all.push(error.to_string());
            break;
        }
        if !shown.contains(&t) {
            continue;
        }
        all.push(format!("t = {t}"));
        all.extend(string.iter().map(|m| {
            let bits: Vec<u64> = m.parameters.iter().map(|x| x.to_bits()).collect();
            let name = &session.model.kinds.get(m.kind).name;
            format!("{name} {bits:x?} {:x} {} {}", m.age.to_bits(), m.lineage.name(), m.lineage)
        }));
    }
    // Within an instant the quick way comes first.
    let mut events = simulation.take_events();
    events.sort_by_key(|event| (event.group, event.lineage.id));
    all.extend(events.iter().map(|event| format!("{event:?}")));
    all
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]
    #[test]
    fn light_modules_do_what_others_do(
        rules in proptest::collection::vec((0..LAWS.len(), 0..HEIGHTS.len(), 0..SUCCESSORS.len()), 3),
        context in 0..CONTEXTS.len(),
        generations in 1..5u32,
        frames in proptest::collection::vec(0.0..6.0f64, 1..5),
        between in proptest::collection::vec(0.0..6.0f64, 0..20),
    ) {
        let mut text = format!(
            "initial string: A(0.25, {generations}) C(0.5, {generations}) [ - A(0.25, {generations}) ] B(0.5, {generations})\n"
        );
        text += CONTEXTS[context];
        for (kind, (law, height, successor)) in ["A", "B", "C"].iter().zip(&rules) {
            text += &rule(kind, *law, *height, *successor);
        }
        // Growth by pieces, and a part that only grows.
        text += "E(x, y):\n if age < 0.5 solve dx/dt = 1, dy/dt = -y\n if age >= 0.5 solve dx/dt = -0.5, dy/dt = y + 1\n";
        let mut shown = frames;
        // The last one is the same for all, for so far goes the log.
        shown.extend([0.0, 1.0, 3.0, 6.0]);
        shown.sort_by(f64::total_cmp);
        shown.dedup();
        let mut times: Vec<f64> = shown.iter().chain(&between).copied().collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let general = Settings { log: true, slow: true, max_modules: 5000, ..Settings::default() };
        let quick = Settings { slow: false, ..general };
        let known = seen(&text, general, &shown, &shown);
        prop_assert_eq!(&seen(&text, quick, &shown, &shown), &known, "{}", &text);
        prop_assert_eq!(&seen(&text, quick, &times, &shown), &known, "{}", &text);
    }
}

/// Every model of the repository on the fast path and on the reference path, compared bit by bit: strings, events, and errors.
#[test]
fn both_paths_grow_every_model_alike() {
    let mut compared = 0;
    for path in models() {
        let Ok(session) = Session::open(&path, &[]) else { continue };
        let outcome = |slow| {
            let settings =
                Settings { slow, log: true, max_modules: 3000, max_events: 30_000, ..Settings::default() };
            let mut bits: Vec<(String, Vec<u64>)> = Vec::new();
            let end = session.simulate(settings).and_then(|mut simulation| {
                let mut string = ModuleString::default();
                let shown = [0.0, 0.4, 1.3, 5.0].into_iter().try_for_each(|time| {
                    simulation.at(time, &mut string)?;
                    bits.extend(string.iter().map(|module| {
                        let name = session.model.kinds.get(module.kind).name.clone();
                        let age = (!module.kind.is_bracket()).then_some(module.age);
                        let values = module.parameters.iter().copied().chain(age);
                        (name, values.map(f64::to_bits).collect())
                    }));
                    Ok(())
                });
                bits.extend(simulation.take_events().iter().map(|event| {
                    let numbers = [event.time.to_bits(), event.rule as u64, event.clause as u64, event.group];
                    (format!("{:?}", event.lineage), numbers.to_vec())
                }));
                shown
            });
            (end.err().map(|error| error.to_string()), bits)
        };
        let (reference, fast) = (outcome(true), outcome(false));
        compared += usize::from(!fast.1.is_empty());
        // Where a budget ends a run depends on the path; what came before does not.
        let is_budget = |outcome: &Option<String>| outcome.as_ref().is_some_and(|e| e.contains("more than"));
        if !(is_budget(&reference.0) && is_budget(&fast.0)) {
            assert_eq!(reference.0, fast.0, "{}", path.display());
            let place = reference.1.iter().zip(&fast.1).position(|(a, b)| a != b);
            let place =
                place.or((reference.1.len() != fast.1.len()).then(|| reference.1.len().min(fast.1.len())));
            if let Some(place) = place {
                let [a, b] = [&reference, &fast].map(|outcome| outcome.1.get(place));
                panic!("{}: reference {a:?}, fast {b:?}", path.display());
            }
        }
    }
    assert!(compared > 150, "{compared} models ran");
}

/// The models that are meant to be run, without a budget and for longer than above.
#[test]
#[ignore = "slow: whole models on the reference path"]
fn both_paths_grow_whole_models_alike() {
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
