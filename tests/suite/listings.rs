//! The paper's listings against states computed by an independent program.
//!
//! `tests/reference/listings.json`: the context-free models by closed forms of every trajectory and event
//! time, exact to rounding; Anabaena and Hieracium as one global system with DOP853 at rtol 1e-12, events
//! located, good to about 1e-9. `anabaena_events.json`: all 351 events up to t = 575.

use dlsys::sim::{Method, Settings};
use dlsys::tree::ModuleString;
use serde_json::Value;

use crate::common::{Plain, plain, repository, run};

fn reference(name: &str) -> Value {
    let text = std::fs::read_to_string(repository("tests/reference").join(name)).expect("a reference");
    serde_json::from_str(&text).expect("JSON")
}

/// A listing, and its states by time.
fn listing(name: &str) -> (String, Vec<f64>, Vec<Vec<Plain>>) {
    let all = reference("listings.json");
    let text = std::fs::read_to_string(repository("tests/paper-models").join(format!("{name}.dls")));
    let states = all[name]["states"].as_array().expect("states");
    let times = states.iter().map(|s| s["t"].as_f64().expect("a time")).collect();
    let strings = states
        .iter()
        .map(|state| {
            let modules = state["modules"].as_array().expect("modules").iter();
            modules
                .map(|m| {
                    let parameters = m[1].as_array().expect("parameters").iter();
                    let name = m[0].as_str().expect("a name").to_owned();
                    (name, parameters.map(|x| x.as_f64().expect("a number")).collect())
                })
                .collect()
        })
        .collect();
    (text.expect("a listing"), times, strings)
}

/// The largest error of a parameter, relative to max(1, |value|). Names must agree.
fn error(ours: &[Vec<Plain>], theirs: &[Vec<Plain>], what: &str) -> f64 {
    let mut worst: f64 = 0.0;
    for (i, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        let names = |s: &[Plain]| s.iter().map(|(n, p)| (n.clone(), p.len())).collect::<Vec<_>>();
        assert!(names(ours) == names(theirs), "{what}: other modules in state {i}");
        for (a, b) in ours.iter().flat_map(|m| &m.1).zip(theirs.iter().flat_map(|m| &m.1)) {
            worst = worst.max((a - b).abs() / b.abs().max(1.0));
        }
    }
    worst
}

const ALL: [&str; 6] = ["dragon", "leaf", "campanula", "lychnis", "anabaena", "hieracium-apex"];

#[test]
fn every_listing_is_within_tolerance_by_every_method() {
    // The promise (LANGUAGE, "Accuracy") is 100 TOL. What is held here is ten times better; the reference of
    // the last two models is itself good to 1e-9 only. The other methods integrate what `auto` has formulas for.
    for name in ALL {
        let (text, times, states) = listing(name);
        for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
            for tolerance in [1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
                let what = format!("{name} by {method:?} at {tolerance:e}");
                let settings = Settings { method, tolerance, ..Settings::default() };
                let ours = run(&text, settings, &times).expect("runs");
                let error = error(&ours, &states, &what);
                assert!(error <= 10.0 * tolerance, "{what}: error {error:e}");
            }
        }
    }
}

#[test]
fn listings_without_context_are_exact_at_any_tolerance() {
    for name in ["dragon", "leaf", "campanula", "lychnis"] {
        let (text, times, states) = listing(name);
        assert!(crate::common::session(&text).model.is_closed_form(), "{name}");
        for tolerance in [1e-1, 1e-6, 1e-13] {
            let ours = run(&text, Settings { tolerance, ..Settings::default() }, &times).expect("runs");
            let error = error(&ours, &states, name);
            assert!(error <= 1e-14, "{name} at {tolerance:e}: error {error:e}");
        }
    }
}

#[test]
fn fixed_steps_locate_events_and_converge() {
    for (method, order, steps) in [(Method::Euler, 1.0, [0.02, 0.005]), (Method::Rk4, 4.0, [0.2, 0.05])] {
        for name in ["leaf", "anabaena"] {
            let (text, times, states) = listing(name);
            // Euler's method is too crude for Anabaena's later events to come in their order.
            let (times, states) =
                if name == "anabaena" { (&times[..2], &states[..2]) } else { (&times[..], &states[..]) };
            let errors = steps.map(|step_size| {
                let settings = Settings { method, step_size, ..Settings::default() };
                let what = format!("{name}, {method:?}, {step_size}");
                error(&run(&text, settings, times).expect("runs"), states, &what)
            });
            let slope = (errors[0] / errors[1]).ln() / (steps[0] / steps[1]).ln();
            assert!((slope - order).abs() < 0.6, "{name}, {method:?}: order {slope}, errors {errors:?}");
        }
    }
}

#[test]
fn anabaena_has_its_events_in_their_order() {
    let events = reference("anabaena_events.json");
    let (text, ..) = listing("anabaena");
    let session = crate::common::session(&text);
    let settings = Settings { tolerance: 1e-10, log: true, ..Settings::default() };
    let mut simulation = session.simulate(settings).expect("starts");
    let mut string = ModuleString::default();
    let census = |string: &ModuleString| {
        let cells = plain(&session.model, string);
        let heterocysts = cells.iter().filter(|(name, _)| name == "F_h").count();
        (cells.len(), heterocysts)
    };
    // Divisions ("s") add a cell, differentiations ("d") a heterocyst; just before and just after each
    // event the census must be what the reference says.
    let (mut cells, mut heterocysts) = (3, 2);
    let list = events["events"].as_array().expect("events");
    let time = |e: &Value| e[0].as_str().expect("a time").parse::<f64>().expect("a number");
    for (i, event) in list.iter().enumerate() {
        let t = time(event);
        let margin = 1e-8 * t.max(1.0) / 10.0;
        if i > 0 && t - time(&list[i - 1]) > 2.0 * margin {
            simulation.at(t - margin, &mut string).expect("runs");
            assert_eq!(census(&string), (cells, heterocysts), "before event {i} at {t}");
        }
        match event[1].as_str() {
            Some("s") => cells += 1,
            _ => heterocysts += 1,
        }
        if list.get(i + 1).is_none_or(|next| time(next) - t > 2.0 * margin) {
            simulation.at(t + margin, &mut string).expect("runs");
            assert_eq!(census(&string), (cells, heterocysts), "after event {i} at {t}");
        }
    }
    assert_eq!((list.len(), simulation.stats().events), (351, 351));
    let log = simulation.take_events();
    for (event, ours) in list.iter().zip(&log) {
        let division = event[1].as_str() == Some("s");
        assert!((time(event) - ours.time).abs() <= 1e-8, "{event} is at {}", ours.time);
        assert_eq!(division, ours.clause == 0, "{event}");
        assert!(ours.residual <= 1e-9, "{event}: {}", ours.residual);
    }
}

#[test]
fn two_boundaries_a_few_roundings_apart_are_two_events() {
    // With this step, two neighbouring cells divide 3e-12 apart at t = 471: the second is past its boundary, by less
    // than rounding, when the first changes its context.
    let (text, ..) = listing("anabaena");
    let settings = Settings { method: Method::Euler, step_size: 1.0 / 512.0, ..Settings::default() };
    run(&text, settings, &[472.0]).expect("nobody leaves the domain");
}

#[test]
fn frames_never_steer() {
    for name in ALL {
        let (text, times, _) = listing(name);
        let end = times[times.len() - 1];
        let few = run(&text, Settings::default(), &times).expect("runs");
        let mut many: Vec<f64> =
            (0..3000).map(|i| end * f64::from(i) / 2999.0).chain(times.clone()).collect();
        many.sort_by(f64::total_cmp);
        many.dedup();
        let all = run(&text, Settings::default(), &many).expect("runs");
        for (t, state) in times.iter().zip(few) {
            let at = many.iter().position(|m| m == t).expect("asked for");
            let bits = |s: &[Plain]| {
                s.iter()
                    .map(|(n, p)| (n.clone(), p.iter().map(|x| x.to_bits()).collect::<Vec<_>>()))
                    .collect::<Vec<_>>()
            };
            assert!(bits(&all[at]) == bits(&state), "{name} at {t}");
        }
    }
}

#[test]
fn the_dragon_keeps_its_ends_apart() {
    let (text, ..) = listing("dragon");
    let session = crate::common::session(&text);
    let mut simulation = session.simulate(Settings::default()).expect("starts");
    let (mut string, mut scene) = (ModuleString::default(), dlsys::scene::Scene::default());
    for i in 0..=80 {
        let t = f64::from(i) * 0.1;
        simulation.at(t, &mut string).expect("runs");
        scene.clear();
        dlsys::turtle::draw(&session.model, &string, &mut scene).expect("draws");
        let ends = [&scene.segments[0], &scene.segments[scene.segments.len() - 1]];
        let distance = nalgebra::distance(&ends[0].start, &ends[1].end);
        assert!((distance - 1.0).abs() < 1e-12, "t = {t}: {distance}");
    }
}
