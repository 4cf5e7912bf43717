//! Random access in time: the state at a time is that of a run from the start, bit for bit, on whatever path the time is
//! reached.

use dlsys::replay::{Replay, Stop};
use dlsys::session::Session;
use dlsys::sim::{Event, Method, Scheduler, Settings};
use dlsys::tree::ModuleString;

use crate::common::{repository, session};

/// Everything that can be seen of a string.
fn bits(string: &ModuleString) -> Vec<(usize, Vec<u64>, u64, u64)> {
    let module = |m: dlsys::tree::Module| {
        let parameters = m.parameters.iter().map(|x| x.to_bits()).collect();
        (m.kind.index(), parameters, m.age.to_bits(), m.lineage.id)
    };
    string.iter().map(module).collect()
}

/// The state at a time and all that has happened, by a run that knows nothing of any other time.
fn fresh(session: &Session, settings: Settings, t: f64) -> (ModuleString, Vec<Event>) {
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(Settings { log: true, ..settings }).expect("it starts");
    simulation.at(t, &mut string).expect("it runs");
    (string, simulation.take_events())
}

/// Goes to and fro; `memory` as of [`Replay::with_memory`].
fn to_and_fro(name: &str, session: &Session, settings: Settings, times: &[f64], memory: usize) {
    let mut replay = Replay::new(&session.model, settings).expect("it starts").with_memory(memory);
    // A fixed order without an order.
    let mut order: Vec<usize> = (0..times.len()).chain((0..times.len()).rev()).collect();
    order.extend((0..times.len()).map(|i| i * 7919 % times.len()));
    let all: Vec<_> = times.iter().map(|&t| fresh(session, settings, t)).collect();
    for i in order {
        assert_eq!(replay.seek(times[i]).expect("it runs"), Stop::There);
        let (string, events) = &all[i];
        assert_eq!(replay.string().expect("it is formed").time, string.time);
        assert!(bits(replay.string().expect("it is formed")) == bits(string), "{name} at t = {}", times[i]);
        assert!(replay.events().eq(events), "{name}: events up to t = {}", times[i]);
    }
}

fn models() -> Vec<(String, Session)> {
    let mut all = Vec::new();
    for folder in ["models", "tests/paper-models"] {
        let mut paths: Vec<_> = std::fs::read_dir(repository(folder))
            .expect("there")
            .map(|entry| entry.expect("readable").path())
            .filter(|path| path.extension().is_some_and(|e| e == "dls"))
            .collect();
        paths.sort();
        for path in paths {
            let session = Session::open(&path, &[]).expect("a good model");
            all.push((path.display().to_string(), session));
        }
    }
    all
}

/// A few times of a model, those of frames and others.
fn times(session: &Session, count: usize) -> Vec<f64> {
    let frames = session.model.frames.expect("our models have frames");
    let end = frames.to.min(400.0);
    (0..count).map(|i| end * (i as f64 + 0.3 * (i % 3) as f64) / count as f64).collect()
}

#[test]
fn every_model_is_the_same_from_every_side() {
    for (name, session) in models() {
        let times = times(&session, 9);
        to_and_fro(&name, &session, Settings::default(), &times, Replay::MEMORY);
        // Nothing but the start is remembered.
        to_and_fro(&name, &session, Settings::default(), &times[..4], 0);
    }
}

#[test]
fn every_way_of_integrating_is_the_same_from_every_side() {
    let model = Session::open(&repository("tests/paper-models/anabaena.dls"), &[]).expect("a good model");
    let times = [0.0, 199.0, 30.0, 30.5, 120.25, 250.0];
    for method in [Method::Dopri5, Method::Radau, Method::Rk4, Method::Euler] {
        let settings = Settings { method, step_size: 0.5, ..Settings::default() };
        to_and_fro("a method", &model, settings, &times, Replay::MEMORY);
    }
    for scheduler in [Scheduler::Global, Scheduler::Local { slice: 0.5 }] {
        let settings = Settings { scheduler, ..Settings::default() };
        to_and_fro("a scheduler", &model, settings, &times, Replay::MEMORY);
    }
}

#[test]
fn hard_cases_are_the_same_from_every_side() {
    for (name, text) in dlsys::study::CASES {
        let Ok(session) = Session::from_text(name, text, &[]) else { continue };
        let Some(frames) = session.model.frames else { continue };
        // Those that end in an error, or take long, have tests of their own.
        let t = [0.3 * frames.to, frames.to, 0.7 * frames.to];
        let mut simulation = session.simulate(Settings::default()).expect("it starts");
        if simulation.pass(frames.to).is_ok() && simulation.stats().events < 20_000 {
            to_and_fro(name, &session, Settings::default(), &t, Replay::MEMORY);
        }
    }
}

#[test]
fn events_are_visited_one_by_one() {
    let session = Session::open(&repository("models/leaf.dls"), &[]).expect("a good model");
    let (_, events) = fresh(&session, Settings::default(), 9.0);
    let mut replay = Replay::new(&session.model, Settings::default()).expect("it starts");
    let mut seen = Vec::new();
    while replay.seek_event(9.0).expect("it runs") == Stop::There {
        let (string, _) = fresh(&session, Settings::default(), replay.time());
        assert!(bits(replay.string().expect("it is formed")) == bits(&string));
        seen.push(replay.time());
    }
    assert_eq!(replay.time(), 9.0);
    assert_eq!(seen, events.iter().map(|e| e.time).collect::<Vec<_>>());
    assert_eq!(replay.events().len(), 5);
    while replay.seek_event_before().expect("it runs") == Stop::There {
        assert_eq!(seen.pop(), Some(replay.time()));
        assert_eq!(replay.events().len(), seen.len() + 1);
    }
    assert!(seen.is_empty() && replay.time() == 0.0 && replay.events().len() == 0);
    let first = replay.string().expect("it is formed").get(0).lineage;
    assert_eq!(replay.end_of(first, 9.0).map(|e| e.time), events.first().map(|e| e.time));
    assert_eq!(replay.end_of(first, 0.1), None);
}

/// What is said of a time that nobody has looked at is what is seen there.
#[test]
fn events_are_known_before_they_are_seen() {
    let models =
        ["models/wilting.dls", "models/birch.dls", "models/abop/bush.dls", "tests/paper-models/anabaena.dls"];
    let read = |name: &str| std::fs::read_to_string(repository(name)).expect("there");
    // Cuts change more than the module that is replaced; the last two are events of one instant, but for rounding.
    let cut = "initial string: A(0) B(1) A(0.5) [ B(2) ] B(3)
A(x): if x < 1 solve dx/dt = 1
  if x = 1 produce A(0) % B(x) B(x)
B(x): solve dx/dt = -x
frames 0 .. 6 step 1";
    let near = "initial string: A(0.1) A(0.30000000000000004) A(0.3)
A(x): if x < 3 solve dx/dt = 1
  if x = 3 produce B B
frames 0 .. 4 step 1";
    let texts = models
        .iter()
        .map(|name| (*name, read(name)))
        .chain([("a cut", cut.to_owned()), ("near", near.to_owned())]);
    for (name, text) in texts {
        let session = Session::from_text(repository(name).to_string_lossy().as_ref(), &text, &[])
            .expect("a good model");
        let end = session.model.frames.expect("it has frames").to;
        let mut replay = Replay::new(&session.model, Settings::default()).expect("it starts");
        replay.seek(end / 2.0).expect("it runs");
        replay.seek(end).expect("it runs");
        let mut steps = 0;
        while replay.seek_event_before().expect("it runs") == Stop::There && steps < 60 {
            let (t, modules, productions) = (replay.time(), replay.modules(), replay.productions());
            assert_eq!(productions, replay.events().len());
            if steps % 5 != 3 {
                let (string, events) = fresh(&session, Settings::default(), t);
                let seen = string.iter().filter(|m| !m.kind.is_bracket()).count();
                assert_eq!((modules, productions), (seen, events.len()), "{name} at t = {t}");
                assert!(replay.events().eq(&events));
                if steps % 3 == 0 {
                    assert!(
                        bits(replay.string().expect("it is formed")) == bits(&string),
                        "{name} at t = {t}"
                    );
                    assert_eq!((modules, productions), (replay.modules(), replay.productions()));
                }
            }
            steps += 1;
        }
        assert!(steps > 1, "{name}");
        // On from a time that nobody has looked at.
        let all = fresh(&session, Settings::default(), end).1;
        let next = all.iter().map(|event| event.time).find(|t| *t > replay.time());
        assert_eq!(replay.seek_event(end).expect("it runs") == Stop::There, next.is_some());
        assert_eq!(replay.time(), next.unwrap_or(end), "{name}");
    }
}

#[test]
fn an_error_leaves_the_present_alone() {
    let session = session(
        "initial string: A(0)\nA(x):\n  if x < 1 solve dx/dt = 1\n  if x = 1 produce A(0) B(1)\nB(x): solve dx/dt = x^2 + 0*t",
    );
    let mut replay = Replay::new(&session.model, Settings::default()).expect("it starts");
    replay.seek(1.75).expect("it runs");
    let before = bits(replay.string().expect("it is formed"));
    for _ in 0..2 {
        assert!(replay.seek(5.0).is_err());
        assert_eq!(replay.time(), 1.75);
        assert!(bits(replay.string().expect("it is formed")) == before);
    }
    replay.seek(0.5).expect("it runs");
    replay.seek(1.75).expect("it runs");
    assert!(bits(replay.string().expect("it is formed")) == before);
}

#[test]
fn a_flag_stops_a_long_way_and_the_rest_is_gone_later() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    let session = Session::open(&repository("tests/paper-models/anabaena.dls"), &[]).expect("a good model");
    let mut replay = Replay::new(&session.model, Settings::default()).expect("it starts");
    let flag = Arc::new(AtomicBool::new(true));
    replay.stop_when(flag.clone());
    assert_eq!(replay.seek(300.0).expect("it runs"), Stop::Interrupted);
    let t = replay.time();
    assert!(0.0 < t && t < 300.0);
    flag.store(false, Ordering::Relaxed);
    for t in [t, 300.0] {
        replay.seek(t).expect("it runs");
        assert!(
            bits(replay.string().expect("it is formed")) == bits(&fresh(&session, Settings::default(), t).0),
            "t = {t}"
        );
    }
}

/// Cells that grow, each with its own phase, exchange something, and divide.
const FILAMENT: &str = "
frames 0 .. 12 step 0.1
initial string: A(1, 0) A(1.3, 1) A(1.7, 0)
A(a, c) < A(x, y) > A(b, d):
  if x < 2 solve dx/dt = ln(2)*x, dy/dt = c + d - 2y
  if x = 2 produce A(0.9, y) A(1.1, y/2)
A(x, y):
  if x < 2 solve dx/dt = ln(2)*x, dy/dt = 1 - y
  if x = 2 produce A(0.9, y) A(1.1, y/2)
";

/// Criterion of speed, in units of work: stepping back 1,000 times is less than running ten times. Time is for people
/// to measure, see the book (Speed against error).
#[test]
fn a_thousand_steps_back_are_less_work_than_ten_runs() {
    for (name, text, end) in [
        ("cells that divide", FILAMENT, 9.0),
        ("a curve", &std::fs::read_to_string(repository("models/dragon.dls")).expect("there"), 9.7),
    ] {
        let session = session(text);
        let mut replay = Replay::new(&session.model, Settings::default()).expect("it starts");
        replay.seek(end).expect("it runs");
        let run = replay.work_spent();
        for i in (0..1000).rev() {
            replay.seek(end * f64::from(i) / 1000.0).expect("it runs");
        }
        let back = replay.work_spent() - run;
        assert!(back < 10 * run, "{name}: {back} against {run}");
        let mut steps = 0;
        replay.seek(end).expect("it runs");
        let before = replay.work_spent();
        while steps < 1000 && replay.seek_event_before().expect("it runs") == Stop::There {
            steps += 1;
        }
        assert!(replay.work_spent() - before < 10 * run, "{name}: {steps} events");
        let (count, bytes) = replay.marks();
        assert!(count <= 256 && bytes <= Replay::MEMORY);
    }
}
