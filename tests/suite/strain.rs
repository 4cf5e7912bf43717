//! `strain` in rules: the surroundings give its values at the ticks of a grid of time, here as a known function of time and lineage.
//! Between ticks it is linear, so that times of events are known to rounding.

use dlsys::compile::Loaded;
use dlsys::diagnostic::Source;
use dlsys::model::Model;
use dlsys::sim::{Error, Event, Failure, Inputs, Method, Scheduler, Settings, Simulation, Surroundings};
use dlsys::tree::{Lineage, ModuleString};

use crate::common::{Plain, plain};

/// Strains that are a function of time and lineage, at the multiples of a tick.
#[derive(Clone)]
pub struct Known {
    pub tick: f64,
    /// Ticks passed so far.
    passed: u32,
    strain: fn(f64, Lineage) -> f64,
}

impl Known {
    pub fn new(tick: f64, strain: fn(f64, Lineage) -> f64) -> Known {
        Known { tick, passed: 0, strain }
    }

    /// Strain and slope at a time: linear between ticks, from 0 at t = 0.
    pub fn at(&self, t: f64, lineage: Lineage) -> (f64, f64) {
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

    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a,
    {
        Box::new(self.clone())
    }

    fn size(&self) -> usize {
        size_of::<Known>()
    }
}

/// The text with a tissue, behind it, so that places of messages stay.
fn with_tissue(text: &str) -> Source {
    Source::new("test.dls", format!("{text}\ntissue wood = stiffness 1e9, density 800, damping 0.05\n"))
}

fn load(text: &str) -> Loaded {
    dlsys::compile::load(&with_tissue(text), &[])
}

pub fn model(text: &str) -> Model {
    let (source, loaded) = (with_tissue(text), load(text));
    let all: String = loaded.diagnostics.iter().map(|d| d.render(&source, false)).collect();
    loaded.model.unwrap_or_else(|| panic!("{all}"))
}

pub fn start<'m>(model: &'m Model, settings: Settings, known: &Known) -> Simulation<'m> {
    let settings = Settings { log: true, ..settings };
    Simulation::with_surroundings(model, settings, known.boxed_clone()).expect("it starts")
}

pub fn events(text: &str, settings: Settings, known: &Known, to: f64) -> Vec<Event> {
    let model = model(text);
    let mut simulation = start(&model, settings, known);
    simulation.pass(to).expect("it runs");
    simulation.take_events()
}

pub fn string(text: &str, settings: Settings, known: &Known, t: f64) -> Vec<Plain> {
    let model = model(text);
    let mut string = ModuleString::default();
    start(&model, settings, known).at(t, &mut string).expect("it runs");
    plain(&model, &string)
}

/// All methods, and both ways of a module alone to be predicted.
pub fn all_settings() -> Vec<Settings> {
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
pub fn by_lineage(t: f64, lineage: Lineage) -> f64 {
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

    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a,
    {
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
