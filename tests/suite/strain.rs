//! `strain` in rules: the surroundings give its values at the ticks of a grid of time, here as a known function of time and lineage.
//! Between ticks it is linear, so that times of events are known to rounding.

use dlsys::compile::{Loaded, load_with_tissue};
use dlsys::diagnostic::Source;
use dlsys::model::{Model, Tissue};
use dlsys::replay::{Replay, Stop};
use dlsys::sim::{Error, Event, Failure, Inputs, Method, Scheduler, Settings, Simulation, Surroundings};
use dlsys::tree::{Lineage, ModuleString};

use crate::common::{Plain, plain};
use crate::dice::Dice;

/// Strains that are a function of time and lineage, at the multiples of a tick.
#[derive(Clone)]
struct Known {
    tick: f64,
    /// Ticks passed so far.
    passed: u32,
    strain: fn(f64, Lineage) -> f64,
}

impl Known {
    fn new(tick: f64, strain: fn(f64, Lineage) -> f64) -> Known {
        Known { tick, passed: 0, strain }
    }

    /// Strain and slope at a time: linear between ticks, from 0 at t = 0.
    fn at(&self, t: f64, lineage: Lineage) -> (f64, f64) {
        let n = (t / self.tick).floor();
        let knot = |n: f64| if n == 0.0 { 0.0 } else { (self.strain)(n * self.tick, lineage) };
        let slope = (knot(n + 1.0) - knot(n)) / self.tick;
        (knot(n) + slope * (t - n * self.tick), slope)
    }

    /// The first time at which the strain is `level`, rising from below.
    fn reaches(&self, level: f64, lineage: Lineage) -> f64 {
        let interval = (0..).map(|n| f64::from(n) * self.tick);
        let end = |t: f64| self.at(t, lineage).0 + self.at(t, lineage).1 * self.tick;
        let start = { interval }.find(|t| end(*t) >= level).expect("it does");
        let (from, slope) = self.at(start, lineage);
        start + (level - from) / slope
    }
}

impl Surroundings for Known {
    fn next_tick(&self) -> f64 {
        f64::from(self.passed) * self.tick
    }

    fn tick(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure> {
        assert_eq!(string.time, self.next_tick(), "the string is that of the tick");
        self.passed += 1;
        let t = self.next_tick();
        inputs.set_strain(string, |module| (self.strain)(t, module.lineage));
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Surroundings> {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        size_of::<Known>()
    }
}

fn load(text: &str) -> Loaded {
    let tissue = Tissue {
        name: "wood".into(),
        stiffness: 1e9,
        density: 800.0,
        damping: 0.05,
        thickness: Tissue::THICKNESS,
        sag: false,
        span: Default::default(),
    };
    load_with_tissue(&Source::new("test.dls", text), &[], tissue)
}

fn model(text: &str) -> Model {
    let loaded = load(text);
    let source = Source::new("test.dls", text);
    let all: String = loaded.diagnostics.iter().map(|d| d.render(&source, false)).collect();
    loaded.model.unwrap_or_else(|| panic!("{all}"))
}

fn start<'m>(model: &'m Model, settings: Settings, known: &Known) -> Simulation<'m> {
    let settings = Settings { log: true, ..settings };
    Simulation::with_surroundings(model, settings, known.boxed_clone()).expect("it starts")
}

fn events(text: &str, settings: Settings, known: &Known, to: f64) -> Vec<Event> {
    let model = model(text);
    let mut simulation = start(&model, settings, known);
    simulation.pass(to).expect("it runs");
    simulation.take_events()
}

fn string(text: &str, settings: Settings, known: &Known, t: f64) -> Vec<Plain> {
    let model = model(text);
    let mut string = ModuleString::default();
    start(&model, settings, known).at(t, &mut string).expect("it runs");
    plain(&model, &string)
}

/// All methods, and both ways of a module alone to be predicted.
fn all_settings() -> Vec<Settings> {
    let slow = Settings { slow: true, ..Settings::default() };
    let methods = Method::NAMED.into_iter().map(|(_, method)| Settings { method, ..Settings::default() });
    let schedulers = [Scheduler::Global, Scheduler::Local { slice: 0.07 }];
    let others = schedulers.map(|scheduler| Settings { scheduler, ..Settings::default() });
    methods.chain(others).chain([slow]).collect()
}

fn rises(t: f64, _: Lineage) -> f64 {
    0.01 * t * t
}

/// Another stem, another strain.
fn by_lineage(t: f64, lineage: Lineage) -> f64 {
    let part = (lineage.id >> 40) as f64 / f64::from(1 << 24);
    0.02 * (1.0 + part) * (1.0 - (-t).exp()) + 0.004 * (5.0 * t + 6.0 * part).sin()
}

#[test]
fn events_on_strain_are_located_to_rounding() {
    let known = Known::new(0.3, rises);
    for condition in
        ["strain > 0.02", "strain >= 0.02", "strain = 0.02", "50*strain >= 1", "strain - 0.02 > 0"]
    {
        for settings in all_settings() {
            let text = format!("initial string: A\nA: if {condition} produce B(strain)");
            let all = events(&text, settings, &known, 3.0);
            let expected = known.reaches(0.02, Lineage::of_axiom(0));
            assert_eq!(all.len(), 1, "{condition} {settings:?}");
            let error = (all[0].time - expected).abs();
            assert!(error < 4e-15 * 3.0, "{condition}, {settings:?}: {error:e}");
            let end = string(&text, settings, &known, 3.0);
            assert!((end[0].1[0] - 0.02).abs() < 1e-16 * 20.0, "{end:?}");
        }
    }
}

#[test]
fn a_strain_that_begins_on_its_boundary_leaves_it_at_the_tick() {
    let all = events(
        "initial string: A\nA: if strain > 0 produce B",
        Settings::default(),
        &Known::new(0.5, rises),
        1.0,
    );
    assert_eq!(all.iter().map(|e| e.time).collect::<Vec<_>>(), [0.0]);
    let late = |t: f64, _: Lineage| if t > 1.2 { 0.01 } else { 0.0 };
    let all = events(
        "initial string: A\nA: if strain > 0 produce B",
        Settings::default(),
        &Known::new(0.5, late),
        2.0,
    );
    assert_eq!(all.iter().map(|e| e.time).collect::<Vec<_>>(), [1.0]);
    // It reaches the level exactly at a tick, and turns there.
    let peak = |t: f64, _: Lineage| 0.25 - (t - 1.0) * (t - 1.0);
    let turned = Known::new(0.5, peak);
    let at = |condition: &str| {
        events(&format!("initial string: A\nA: if {condition} produce B"), Settings::default(), &turned, 4.0)
    };
    assert_eq!(at("strain >= 0.25").iter().map(|e| e.time).collect::<Vec<_>>(), [1.0]);
    assert_eq!(at("strain > 0.26").len(), 0);
    // Falling through zero: at 0, -0.75 at t = 2.
    let falls = at("age > 0.6 & strain < 0");
    assert!((falls[0].time - 1.5).abs() < 1e-15, "{}", falls[0].time);
}

#[test]
fn equations_read_the_strain() {
    // x' = strain, y' = strain - y, z = 3 strain: all closed forms; against sums over the ticks.
    let text =
        "initial string: A(0, 0, 0)\nA(x, y, z): solve dx/dt = strain, dy/dt = strain - y, z = 3*strain";
    let known = Known::new(0.25, by_lineage);
    let lineage = Lineage::of_axiom(0);
    for settings in all_settings().into_iter().filter(|s| s.method != Method::Euler) {
        for t in [0.1, 0.25, 1.0, 1.9, 3.3] {
            let (mut x, mut y, mut from) = (0.0, 0.0, 0.0f64);
            while from < t {
                let h = (t - from).min(known.tick);
                let (s, slope) = known.at(from, lineage);
                x += s * h + slope * h * h / 2.0;
                // y' = s + slope τ - y
                let limit = |tau: f64| s + slope * tau - slope;
                y = limit(h) + (y - limit(0.0)) * (-h).exp();
                from += known.tick;
            }
            let own = &string(text, settings, &known, t)[0].1;
            let bound = if settings.method == Method::Auto { 1e-14 } else { 2e-6 };
            let z = 3.0 * known.at(t, lineage).0;
            assert!(
                (own[0] - x).abs() < bound && (own[1] - y).abs() < bound,
                "{settings:?} at {t}: {own:?}, {x} {y}"
            );
            assert!((own[2] - z).abs() < 1e-9, "{settings:?} at {t}: {own:?}, {z}");
        }
    }
}

#[test]
fn halving_the_tick_quarters_the_error() {
    // ∫ 0.02 (1 - exp(-t)) dt from 0 to 2.
    let text = "initial string: A(0)\nA(x): solve dx/dt = strain";
    let exact = 0.02 * (2.0 - (1.0 - (-2.0f64).exp()));
    let error = |tick: f64| {
        let known = Known::new(tick, |t, _| 0.02 * (1.0 - (-t).exp()));
        (string(text, Settings::default(), &known, 2.0)[0].1[0] - exact).abs()
    };
    for tick in [0.2, 0.1, 0.05, 0.025] {
        let ratio = error(tick) / error(tick / 2.0);
        assert!((ratio - 4.0).abs() < 0.05, "{tick}: {ratio}");
    }
}

#[test]
fn successors_take_the_strain_over_and_branches_begin_unbent() {
    let text = "initial string: A\n\
        A: if age = 0.7 & strain >= 0 produce C [ C ] for i in 1 .. 2: ( C [ C ] ) [ for i in 1 .. 1: ( C ) ] D C\n\
        C: if age = 0.1 produce E(strain)\n\
        D: if age = 0.1 produce E(7)";
    let known = Known::new(0.5, rises);
    let there = known.at(0.8, Lineage::of_axiom(0)).0;
    for settings in all_settings() {
        let values: Vec<f64> = (string(text, settings, &known, 0.9).iter())
            .filter(|(name, _)| name == "E")
            .map(|(_, values)| values[0])
            .collect();
        let expected = [there, 0.0, there, 0.0, there, 0.0, 0.0, 7.0, there];
        assert_eq!(values.len(), expected.len());
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-15, "{values:?}, not {expected:?}");
        }
    }
    // From the next tick on a branch bends, too: half way between the ticks at 1 and 1.5.
    let late =
        "initial string: A\nA: if age = 0.7 & strain >= 0 produce [ C ]\nC: if age = 0.55 produce E(strain)";
    let bent = string(late, Settings::default(), &known, 1.3)[1].1[0];
    assert!((bent - 0.5 * rises(1.5, Lineage::of_axiom(0))).abs() < 1e-15, "{bent}");
}

#[test]
fn strain_goes_on_where_no_rule_applies() {
    // B has a rule only beside an A, which comes at t = 1.2; its discrete rule reads the strain at t = 2.
    let known = Known::new(0.5, rises);
    let text = "initial string: [ G ] B\nG: if age = 1.2 produce A\n[A] < B: if age = 1.3 produce E(strain)";
    let text = text.replace("[A] < B", "A < B").replace("[ G ] B", "G B");
    let e = string(&text, Settings::default(), &known, 1.4)[1].1[0];
    assert!((e - known.at(1.3, Lineage::of_axiom(1)).0).abs() < 1e-15, "{e}");
    let discrete = "period 0.7\ninitial string: B\nB : strain > 0.03 -> E(strain)";
    let found = events(discrete, Settings::default(), &known, 4.0);
    let first = (1..).map(|n| 0.7 * f64::from(n)).find(|t| known.at(*t, Lineage::of_axiom(0)).0 > 0.03);
    assert_eq!(Some(found[0].time), first);
    let e = string(discrete, Settings::default(), &known, 4.0)[0].1[0];
    assert!((e - known.at(found[0].time, Lineage::of_axiom(0)).0).abs() < 1e-15, "{e}");
}

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

/// The error of a run with these surroundings.
fn error_of(model: &Model, surroundings: Box<dyn Surroundings>) -> Error {
    let started = Simulation::with_surroundings(model, Settings::default(), surroundings);
    let mut simulation = match started {
        Ok(simulation) => simulation,
        Err(error) => return error,
    };
    let error = simulation.pass(2.0).expect_err("it fails");
    assert_eq!(
        simulation.at(3.0, &mut ModuleString::default()).expect_err("for good").to_string(),
        error.to_string()
    );
    error
}

/// Surroundings that fail in some way at the third tick.
#[derive(Clone)]
struct Failing(u32, fn(&mut Inputs) -> Result<f64, Failure>, f64);

impl Surroundings for Failing {
    fn next_tick(&self) -> f64 {
        if self.0 == 3 { self.2 } else { f64::from(self.0) * 0.5 }
    }

    fn tick(&mut self, _: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure> {
        self.0 += 1;
        if self.0 == 3 {
            self.2 = (self.1)(inputs)?;
        }
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Surroundings> {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        0
    }
}

#[test]
fn surroundings_that_fail_end_the_run_with_a_place() {
    let text = "initial string: [ F(2) ] A(3)\nA(x): solve dx/dt = strain";
    let model = model(text);
    let failing = |how| error_of(&model, Box::new(Failing(0, how, 0.0)));
    let message = |error: &Error| error.diagnostic().render(&Source::new("test.dls", text), false);
    let nan = failing(|inputs| {
        assert_eq!(inputs.readers(), [3]);
        inputs.strain_mut()[0] = f64::NAN;
        Ok(1.5)
    });
    assert_eq!((nan.name(), nan.site().time), ("Surroundings", 1.0));
    let shown = message(&nan);
    assert!(
        shown
            .starts_with("error: the surroundings of A(3) fail at t = 1: the strain at the next tick is NaN"),
        "{shown}"
    );
    assert!(shown.contains("test.dls:2:"), "{shown}");
    let told =
        failing(|_| Err(Failure::new("this stem has no width").of(1).help("write `!(0.1)` before it")));
    let shown = message(&told);
    assert!(
        shown.starts_with("error: the surroundings of F(2) fail at t = 1: this stem has no width"),
        "{shown}"
    );
    assert!(shown.contains("help: write `!(0.1)` before it"), "{shown}");
    let backwards = failing(|_| Ok(1.0)).to_string();
    assert!(backwards.ends_with("their next tick would be at t = 1, which is not later"), "{backwards}");
    assert!(failing(|_| Ok(f64::NAN)).to_string().ends_with("at t = NaN, which is not later"));
    let early = error_of(&model, Box::new(Failing(3, |_| Ok(1.0), -1.0)));
    assert!(early.to_string().contains("t = -1"), "{early}");
    // No tick any more: strains stay.
    let mut rest = Simulation::with_surroundings(
        &model,
        Settings::default(),
        Box::new(Failing(0, |_| Ok(f64::INFINITY), 0.0)),
    );
    rest.as_mut().expect("it starts").pass(1e6).expect("it runs");
}

#[test]
fn a_string_without_modules_has_ticks() {
    let known = Known::new(0.25, rises);
    assert_eq!(
        string("initial string: A\nA: if strain > 0.001 produce ε", Settings::default(), &known, 9.0),
        []
    );
}

fn messages(text: &str) -> String {
    let source = Source::new("test.dls", text);
    let loaded = load(text);
    assert!(loaded.model.is_none(), "{text}");
    loaded.diagnostics.iter().map(|d| d.render(&source, false)).collect()
}

#[test]
fn strain_is_known_in_rules_only() {
    for text in [
        "const c = strain\ninitial string: A(c)",
        "param c = strain\ninitial string: A(c)",
        "initial string: A(strain)",
        "def f(x) = x*strain\ninitial string: A(f(2))",
        "initial string: A\ninterpret A: F(strain)",
        "initial string: A\nlight strain, 1, 0\ninterpret A: F(1)",
    ] {
        let shown = messages(text);
        assert!(
            shown.contains("`strain` has no meaning here") && shown.contains("test.dls:"),
            "{text}: {shown}"
        );
        assert!(shown.contains("pass its value on"), "{shown}");
    }
}

#[test]
fn strain_needs_a_tissue() {
    let text = "initial string: A\nA: if strain > 1 produce B";
    let loaded = dlsys::compile::load(&Source::new("test.dls", text), &[]);
    assert!(loaded.model.is_none());
    let shown: String =
        loaded.diagnostics.iter().map(|d| d.render(&Source::new("test.dls", text), false)).collect();
    assert!(shown.contains("test.dls:2:7") && shown.contains("put `@E(wood)`"), "{shown}");
}

#[test]
fn names_of_a_model_hide_strain() {
    for text in [
        "const strain = 2\ninitial string: A(1)\nA(x): solve dx/dt = strain",
        "param strain = 2\ninitial string: A(1)\nA(x): solve dx/dt = strain",
        "initial string: A(1, 2)\nA(x, strain): solve dx/dt = strain",
        "initial string: A(1)\nA(x): let strain = 2\n solve dx/dt = strain",
        "def strain(y) = 2*y\ninitial string: A(1)\nA(x): solve dx/dt = strain(1)",
        "initial string: B(2) A(1)\nB(strain) < A(x): solve dx/dt = strain",
        "initial string: A(1) [ B(2) ]\nA(x): solve dx/dt = sum(B(strain): strain)",
        "initial string: A(1)\nA(x): if age = 0 produce for strain in 2 .. 2: ( A(1, strain) )\nA(x, a): solve dx/dt = a",
    ] {
        let loaded = dlsys::compile::load(&Source::new("test.dls", text), &[]);
        let shown: String = loaded.diagnostics.iter().map(|d| d.message.clone()).collect();
        let model = loaded.model.unwrap_or_else(|| panic!("{text}: {shown}"));
        assert!(!model.reads_strain(), "{text}");
        let mut simulation = Simulation::new(&model, Settings::default()).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(3.0, &mut string).expect("it runs");
        assert!(
            plain(&model, &string).iter().any(|(name, x)| name == "A" && x[0] == 7.0),
            "{text}: {:?}",
            plain(&model, &string)
        );
    }
}
