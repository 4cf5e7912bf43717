//! Structures that read `strain`: neighbours, random events, lazy modules, random access in time. What is observed, and how a run
//! is scheduled, changes nothing.

use dlsys::replay::{Replay, Stop};
use dlsys::sim::{Method, Scheduler, Settings, Surroundings};
use dlsys::tree::{Lineage, ModuleString};

use crate::common::plain;
use crate::dice::Dice;
use crate::strain::{Known, all_settings, by_lineage, events, model, start, string};

/// A growing stem whose parts pass a substance on, snap, and branch by chance.
const STEM: &str = "initial string: S(0.4, 1) S(0.5, 0.2) S(0.6, 0.7) S(0.3, 0.1) T\n\
    S(y, d) < S(x, c):\n  \
    if x < 1 solve dx/dt = 0.5*(1 + 10*strain), dc/dt = 0.8*(d - c) - 3*strain*c\n  \
    if x = 1 produce S(x/2, c) S(x/2, c) [ S(0.1, c) ]\n  \
    if strain > 0.03 produce U(x)\n  \
    at rate 20*strain produce S(x, c/2) [ S(0.2, 0) ]\n\
    S(x, c):\n  \
    if x < 1 solve dx/dt = 0.6 - 5*strain, dc/dt = 0.1*c*(2 - c)\n  \
    if x = 1 produce S(x/2, c) S(x/2, c)\n  \
    if strain > 0.035 produce U(x)\n\
    T: if strain >= 0.02 produce [ S(0.3, strain) ] T_done\n\
    U(x): solve dx/dt = -x\n";

fn bits(string: &ModuleString) -> Vec<(usize, Vec<u64>, u64, u64)> {
    let module = |m: dlsys::tree::Module| {
        let parameters = m.parameters.iter().map(|x| x.to_bits()).collect();
        (m.kind.index(), parameters, m.age.to_bits(), m.lineage.id)
    };
    string.iter().map(module).collect()
}

#[test]
fn what_is_observed_changes_nothing() {
    let model = model(STEM);
    let known = Known::new(0.125, by_lineage);
    // At ticks, beside them, and anywhere.
    let mut times: Vec<f64> = (0..40).flat_map(|i| [0.1 * f64::from(i), 0.125 * f64::from(i)]).collect();
    times.extend(
        (1..30).flat_map(|i| [0.125 * f64::from(i) * (1.0 + 1e-15), 0.125 * f64::from(i) * (1.0 - 1e-15)]),
    );
    times.retain(|t| *t <= 3.6);
    times.sort_by(f64::total_cmp);
    for settings in all_settings() {
        let mut observed = start(&model, settings, &known);
        let mut last = ModuleString::default();
        let mut seen = Vec::new();
        for &t in &times {
            observed.at(t, &mut last).expect("it runs");
            seen.push(bits(&last));
        }
        let all = observed.take_events();
        assert!(all.len() > 20, "{}", all.len());
        for (&t, seen) in times.iter().zip(&seen).step_by(7) {
            let mut alone = start(&model, settings, &known);
            let mut string = ModuleString::default();
            alone.at(t, &mut string).expect("it runs");
            assert!(bits(&string) == *seen, "{settings:?} at {t}");
            let own = alone.take_events();
            assert_eq!(own[..], all[..own.len()], "{settings:?} at {t}");
        }
    }
}

#[test]
fn replay_goes_back_to_the_same_bits() {
    let model = model(STEM);
    let known = Known::new(0.125, by_lineage);
    let settings = Settings::default();
    for memory in [Replay::MEMORY, 20_000] {
        let replay = Replay::with_surroundings(&model, settings, known.boxed_clone());
        let mut replay = replay.expect("it starts").with_memory(memory);
        for i in 0..60 {
            let t = f64::from(i * 37 % 60) * 0.0625;
            assert_eq!(replay.seek(t).expect("it runs"), Stop::There);
            let mut string = ModuleString::default();
            let mut alone = start(&model, settings, &known);
            alone.at(t, &mut string).expect("it runs");
            assert!(bits(replay.string().expect("formed")) == bits(&string), "at {t}");
            assert!(replay.events().eq(&alone.take_events()), "events up to {t}");
        }
    }
}

#[test]
fn ways_to_run_agree() {
    let known = Known::new(0.125, by_lineage);
    // Chance acts on many of them: its clocks are as exact as their rates.
    let run = |settings: Settings| events(STEM, Settings { tolerance: 1e-9, ..settings }, &known, 3.0);
    let reference = run(Settings { scheduler: Scheduler::Global, ..Settings::default() });
    for settings in [
        Settings::default(),
        Settings { slow: true, ..Settings::default() },
        Settings { method: Method::Dopri5, ..Settings::default() },
        Settings { method: Method::Radau, ..Settings::default() },
    ] {
        let all = run(settings);
        assert_eq!(all.len(), reference.len(), "{settings:?}");
        for (event, other) in all.iter().zip(&reference) {
            assert_eq!(event.lineage, other.lineage, "{settings:?}");
            assert!((event.time - other.time).abs() < 1e-7, "{settings:?}: {} {}", event.time, other.time);
        }
    }
}

#[test]
fn lazy_modules_may_end_at_ticks() {
    // A lives from tick to tick and reads nothing; what it makes is born at a tick, and reads the strain.
    let text = "initial string: A\n\
        A: if age = 0.25 produce A [ B(0) ] B(1)\n\
        B(x): solve dx/dt = (if strain > 0.01 then 2 else strain) if strain = 0.024 produce C(x)";
    let model = model(text);
    let known = Known::new(0.25, by_lineage);
    let run = |slow: bool| {
        let mut simulation = start(&model, Settings { slow, ..Settings::default() }, &known);
        let mut string = ModuleString::default();
        simulation.at(4.0, &mut string).expect("it runs");
        (bits(&string), simulation.take_events())
    };
    let (fast, slow) = (run(false), run(true));
    assert!(fast == slow);
    assert!(fast.1.iter().filter(|event| model.kinds.get(event.kind).name == "B").count() > 10);
    // The times at which the strain begins to matter, by quadrature of the same polygon.
    let mut string = ModuleString::default();
    start(&model, Settings::default(), &known).at(3.9, &mut string).expect("it runs");
    let modules: Vec<_> = string.iter().filter(|m| model.kinds.get(m.kind).name == "B").collect();
    assert!(modules.len() > 3);
    for module in modules {
        let birth = 3.9 - module.age;
        let first = if module.lineage.place() == Some(1) { 0.0 } else { 1.0 };
        // Born at a tick: from 0 there to the value of the next.
        let strain = |t: f64| match t - birth {
            since if since < 0.25 => since / 0.25 * by_lineage(birth + 0.25, module.lineage),
            _ => known.at(t, module.lineage).0,
        };
        let rate = |t: f64| if strain(t) > 0.01 { 2.0 } else { strain(t) };
        let n = 100_000;
        let h = module.age / f64::from(n);
        let integral: f64 = (0..n).map(|i| h * rate(birth + (f64::from(i) + 0.5) * h)).sum();
        let error = (module.parameters[0] - first - integral).abs();
        assert!(error < 4.0 * h * 2.0, "{error:e}");
    }
}

#[test]
fn neighbours_follow_values_that_read_the_strain() {
    let text = "initial string: G(0, 0.1) F(0) F(1) F(2) F(0)\n\
        G(z, w): solve z = 3*strain, 0 = w^3 + w - 20*strain\n\
        G(z, w) < F(x): solve dx/dt = z + w - x\n\
        F(y) < F(x) > F(z): solve dx/dt = y - 2*x + z + 5*strain\n\
        F(y) < F(x): solve dx/dt = y - x + strain";
    let known = Known::new(0.15, by_lineage);
    let run =
        |method, tolerance| string(text, Settings { method, tolerance, ..Settings::default() }, &known, 2.5);
    let reference = run(Method::Radau, 1e-12);
    for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
        for (own, exact) in run(method, 1e-9).iter().zip(&reference) {
            for (x, y) in own.1.iter().zip(&exact.1) {
                assert!((x - y).abs() < 2e-9, "{method:?}: {own:?}, not {exact:?}");
            }
        }
    }
    let root = (reference[0].1[1], known.at(2.5, Lineage::of_axiom(0)).0);
    assert!((root.0.powi(3) + root.0 - 20.0 * root.1).abs() < 1e-10);
}

/// A filament of cells that grow, divide, exchange and snap, all of them under strain.
fn filament(seed: u64) -> String {
    let mut dice = Dice(seed);
    let growth =
        dice.pick(&["0.2*x*(1 + 20*strain)", "0.3 - 4*strain", "0.1*x*(2 - x) + strain", "0.2*x + 0.001*c"]);
    let exchange = dice.pick(&[
        "D*(l + r - 2*c) - 4*strain*c",
        "D*(l - c) + strain",
        "D*(l^2 + r^2 - 2*c^2) + (if strain < 0.02 then 0.2 else -c)",
    ]);
    let successor = dice.pick(&[
        "F(0.4*x, c) F(0.6*x, c)",
        "F(x/2, 1.5*c) [ F(0.3, c) ] F(x/2, c/2)",
        "F(x/2, c + strain)",
    ]);
    let limit = dice.between(0.02, 0.045);
    let mut cells = String::new();
    for _ in 0..dice.between(5.0, 30.0) as usize {
        cells += &format!("F({:.4}, {:.4}) ", dice.between(0.4, 1.0), dice.between(0.6, 3.0));
    }
    format!(
        "const D = {:.3}\ninitial string: H(2) {cells} H(1)\n\
         F(y, l) < F(x, c) > F(z, r):\n  if x < 1 & strain <= {limit:.4} solve dx/dt = {growth}, dc/dt = {exchange}\n  \
         if x = 1 produce {successor}\n  if strain > {limit:.4} produce H(c)\n\
         F(x, c): if x < 1 solve dx/dt = {growth}, dc/dt = -0.1*c if x = 1 produce H(c)\n\
         H(h): solve dh/dt = 0.5*(2 - h)",
        dice.between(0.05, 0.6)
    )
}

#[test]
fn local_and_global_schedulers_agree_and_frames_change_nothing() {
    let mut productions = 0;
    for seed in 0..40 {
        let text = filament(seed);
        let model = model(&text);
        let known = Known::new([0.05, 0.125, 0.3][seed as usize % 3], by_lineage);
        let run = |scheduler, frames: u32| {
            let settings = Settings { scheduler, tolerance: 1e-9, ..Settings::default() };
            let mut simulation = start(&model, settings, &known);
            let mut string = ModuleString::default();
            for i in 1..=frames {
                simulation.at(2.0 * f64::from(i) / f64::from(frames), &mut string).expect("it runs");
            }
            (string, simulation.take_events())
        };
        let (local, seen, global) =
            (run(Scheduler::Auto, 1), run(Scheduler::Auto, 80), run(Scheduler::Global, 1));
        assert!(bits(&local.0) == bits(&seen.0) && local.1 == seen.1, "{text}");
        productions += local.1.len();
        assert_eq!(local.1.len(), global.1.len(), "{text}");
        for (a, b) in plain(&model, &local.0).iter().zip(&plain(&model, &global.0)) {
            assert_eq!(a.0, b.0, "{text}");
            for (x, y) in a.1.iter().zip(&b.1) {
                assert!((x - y).abs() < 1e-7 * y.abs().max(1.0), "{a:?} {b:?}\n{text}");
            }
        }
    }
    assert!(productions > 400, "{productions}");
}

#[test]
fn coupled_neighbours_read_the_strain() {
    // a' = s_a(t) - a², b' = 3 (a - b) + 10 s_b(t): by small steps of the classical method.
    let text = "initial string: F(0.1) F(0.2)\n\
        F(y) < F(x): solve dx/dt = 3*(y - x) + 10*strain\nF(x): solve dx/dt = strain - x^2";
    let known = Known::new(0.2, by_lineage);
    let [a, b] = [0, 1].map(Lineage::of_axiom);
    let rates =
        |t: f64, [x, y]: [f64; 2]| [known.at(t, a).0 - x * x, 3.0 * (x - y) + 10.0 * known.at(t, b).0];
    let (mut state, h) = ([0.1, 0.2], 0.002);
    for i in 0..1000 {
        // Within a tick, so that the rates are smooth.
        let t = f64::from(i) * h;
        let middle =
            |t: f64| t.clamp((f64::from(i / 100)) * 0.2 + 1e-13, f64::from(i / 100 + 1) * 0.2 - 1e-13);
        let step = |k: [f64; 2], part: f64| [state[0] + part * h * k[0], state[1] + part * h * k[1]];
        let k1 = rates(middle(t), state);
        let k2 = rates(middle(t + h / 2.0), step(k1, 0.5));
        let k3 = rates(middle(t + h / 2.0), step(k2, 0.5));
        let k4 = rates(middle(t + h), step(k3, 1.0));
        state = [0, 1].map(|j| state[j] + h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]));
    }
    for scheduler in [Scheduler::Auto, Scheduler::Global] {
        for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
            let settings = Settings { scheduler, method, tolerance: 1e-9, ..Settings::default() };
            let end = string(text, settings, &known, 2.0);
            for (own, exact) in end.iter().zip(state) {
                assert!((own.1[0] - exact).abs() < 3e-9, "{settings:?}: {} {exact}", own.1[0]);
            }
        }
    }
    let local = |slice: f64| {
        let settings =
            Settings { scheduler: Scheduler::Local { slice }, tolerance: 1e-9, ..Settings::default() };
        (string(text, settings, &known, 2.0)[1].1[0] - state[1]).abs()
    };
    assert!(local(0.01) < 0.6 * local(0.02), "{} {}", local(0.01), local(0.02));
}

#[test]
fn rates_of_random_events_follow_the_strain() {
    let n = 20_000;
    let text = format!("initial string: {}\nA: at rate 40*strain produce ε", "[ A ]\n".repeat(n));
    let known = Known::new(0.5, |t, _| 0.05 * t);
    let all = events(&text, Settings::default(), &known, 10.0);
    assert_eq!(all.len(), n);
    // The strain is 0.05 t exactly, so the cumulative hazard is t².
    let mut values: Vec<f64> = all.iter().map(|event| (-event.time * event.time).exp()).collect();
    values.sort_by(f64::total_cmp);
    let size = n as f64;
    let distance = |(i, u): (usize, &f64)| (u - i as f64 / size).abs().max((u - (i + 1) as f64 / size).abs());
    let statistic = values.iter().enumerate().map(distance).fold(0.0, f64::max) * size.sqrt();
    assert!(statistic < 1.949, "{statistic}");
}
