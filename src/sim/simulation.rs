//! The clock: steps, events, observation.

use super::dense::Dense;
use super::error::{Error, Site};
use super::event::Event;
use super::runge_kutta::{Rates, Trial, Workspace};
use super::settle::Open;
use super::system::System;
use super::watch::{Found, search};
use super::{Method, Settings, Stats};
use crate::expr::Interval;
use crate::model::{KindId, Model, Sign};
use crate::structure::{Instant, Lineage, ModuleId, ModuleString, Tree};

/// What the simulation keeps of a module with rules.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub id: ModuleId,
    /// The rule that applies; None where no rule's context is there.
    pub rule: Option<usize>,
    pub context: Vec<ModuleId>,
    pub solve: Option<usize>,
    /// The sign of each atom of the rule, just after the last instant at which it was examined.
    pub signs: Vec<Sign>,
    /// Conditions inside the active equations.
    pub switches: Vec<bool>,
}

impl State {
    pub fn idle(id: ModuleId) -> State {
        State { id, rule: None, context: Vec::new(), solve: None, signs: Vec::new(), switches: Vec::new() }
    }
}

/// A step that has been made: the solution up to its end, or up to the event in it.
struct Step {
    dense: Dense,
    found: Found,
}

/// A model developing in time; observe it with [`Simulation::at`].
///
/// The `global` scheduler: one clock for all modules, time is cut at every event. Steps and events do not
/// depend on what is observed, so the state at a time is the same bits whichever other times are asked for.
pub struct Simulation<'m> {
    pub(super) model: &'m Model,
    pub(super) settings: Settings,
    pub(super) tree: Tree,
    /// By slot of the tree.
    pub(super) states: Vec<Option<State>>,
    /// Modules whose kind has rules, in string order.
    pub(super) ruled: Vec<ModuleId>,
    pub(super) ruled_is_stale: bool,
    pub(super) open: Vec<Option<Open>>,
    /// Start of the present step.
    pub(super) now: Instant,
    pub(super) system: System,
    /// State vector at `now`.
    pub(super) y: Vec<f64>,
    /// Length of the next step to be tried.
    pub(super) step_size: f64,
    /// Error of the last step, for the step control.
    last_error: f64,
    workspace: Workspace,
    /// The first stage of the next step is known.
    rate_is_known: bool,
    step: Option<Step>,
    /// Events in a row of modules that hardly lived.
    stalled: usize,
    /// Rounds of productions at the present instant.
    pub(super) rounds: usize,
    /// A time in the past, and the number of steps made since then.
    mark: Instant,
    since_mark: usize,
    pub(super) stats: Stats,
    /// Productions since they were last taken, if they are recorded.
    pub(super) log: Option<Vec<Event>>,
    /// Number of the present instant in the log.
    pub(super) group: u64,
    fault: Option<Error>,
}

/// A step with less than this part of the tolerated error is longer than accuracy asks for.
const EASY: f64 = 1e-3;
/// How far ahead, in units of the time to the last event, such steps look.
const FORESIGHT: f64 = 1e3;

/// Events in a row of modules that lived no longer than this many resolutions of time, after which events
/// are said to pile up.
const MAX_STALLED: usize = 100;
pub(super) const SHORT_LIFE: f64 = 64.0;

/// So many steps must bring time on by more than this part of it, or there is a singularity.
const MANY_STEPS: usize = 10_000;
const CRAWL: f64 = 1e-5;

impl<'m> Simulation<'m> {
    /// Makes the initial string at t = 0 and lets everything happen that happens there.
    pub fn new(model: &'m Model, settings: Settings) -> Result<Simulation<'m>, Error> {
        let mut tree = Tree::new(model.kinds.iter().map(|(_, kind)| kind.arity as u32).collect());
        let mut arguments = Vec::new();
        model.axiom.evaluate::<f64>(&[], &mut Vec::new(), &mut arguments);
        tree.append(&model.axiom, &arguments, Instant::ZERO, Lineage::of_axiom, &mut Vec::new());
        let mut simulation = Simulation {
            model,
            tree,
            states: Vec::new(),
            ruled: Vec::new(),
            ruled_is_stale: true,
            open: Vec::new(),
            now: Instant::ZERO,
            system: System::default(),
            y: Vec::new(),
            step_size: 1.0,
            last_error: 1.0,
            workspace: Workspace::default(),
            rate_is_known: false,
            step: None,
            stalled: 0,
            mark: Instant::ZERO,
            since_mark: 0,
            rounds: 0,
            stats: Stats::default(),
            log: Some(Vec::new()),
            group: 0,
            fault: None,
            settings,
        };
        simulation.stats.peak_modules = simulation.tree.len() as u64;
        if let Some(at) = arguments.iter().position(|x| !x.is_finite()) {
            return Err(Error::NotFinite {
                site: Site {
                    module: "the initial string".to_owned(),
                    lineage: Lineage::of_axiom(0),
                    rule: "initial string".to_owned(),
                    span: Default::default(),
                    time: 0.0,
                },
                what: format!("parameter {}", at + 1),
            });
        }
        if simulation.tree.len() > settings.max_modules {
            let limit = settings.max_modules;
            let site = Site {
                module: "the initial string".to_owned(),
                lineage: Lineage::of_axiom(0),
                rule: "initial string".to_owned(),
                span: Default::default(),
                time: 0.0,
            };
            return Err(Error::TooManyModules { site, limit, rounds: 0 });
        }
        simulation.settle(&[])?;
        simulation.begin_phase()?;
        simulation.step_size = simulation.first_step_size();
        Ok(simulation)
    }

    /// Work done so far.
    pub fn stats(&self) -> Stats {
        Stats { modules: self.tree.len() as u64, ..self.stats }
    }

    /// Forgets the productions so far and records none from now on: they take memory.
    pub fn without_log(mut self) -> Simulation<'m> {
        self.log = None;
        self
    }

    /// The productions since the last call, in the order of time.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.log.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Writes the structure at time `t` into `out`. Times must not decrease from call to call.
    ///
    /// A module lives from its birth to just before its end: at the instant of an event, the successors
    /// are there. After an error, every further call gives the same error.
    pub fn at(&mut self, t: f64, out: &mut ModuleString) -> Result<(), Error> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        if let Err(fault) = self.advance(t) {
            self.fault = Some(fault.clone());
            return Err(fault);
        }
        let step = self.step.as_ref().expect("advance leaves a step");
        let at = Instant::new(t);
        // An event within the resolution of time of `t` may have taken place a little after it.
        let position = step.dense.position(at);
        let now = if at.since(self.now) < 0.0 { self.now } else { at };
        let value = |place: usize| match self.system.component(place) {
            Some(component) => step.dense.value(component, position),
            None => self.tree.values()[place],
        };
        self.tree.write(now, t, value, out);
        Ok(())
    }

    /// Makes steps until one covers `t` and every event up to `t` has taken place.
    fn advance(&mut self, t: f64) -> Result<(), Error> {
        let until = Instant::new(t);
        loop {
            if self.step.is_none() {
                self.make_step()?;
            }
            let step = self.step.as_ref().expect("just made");
            match step.found.event {
                Some(position) => {
                    let when = self.now.after(position * step.dense.h);
                    if when.since(until) > until.resolution() {
                        return Ok(());
                    }
                    self.pass_event(position, when)?;
                }
                None => {
                    if self.now.after(step.dense.h).since(until) >= 0.0 {
                        return Ok(());
                    }
                    self.pass_step()?;
                }
            }
        }
    }

    /// Goes to the end of a step in which nothing happens.
    fn pass_step(&mut self) -> Result<(), Error> {
        let Step { dense, found } = self.step.take().expect("a step was made");
        self.keep_signs(&found);
        let method = self.settings.method;
        let before = self.now;
        self.now = match self.settings.grid() {
            Some(grid) => Instant::new(self.next_grid_time(grid)),
            None => self.now.after(dense.h),
        };
        if self.now.since(before) <= 0.0 {
            return Err(self.too_small(0));
        }
        self.since_mark += 1;
        if self.since_mark >= MANY_STEPS && self.settings.grid().is_none() {
            if self.now.since(self.mark) <= CRAWL * self.now.to_f64() {
                return Err(self.too_small(self.worst_component()));
            }
            (self.since_mark, self.mark) = (0, self.now);
        }
        self.rate_is_known = self.workspace.advance(method);
        std::mem::swap(&mut self.y, &mut self.workspace.end);
        self.system.advance(&self.tree, self.now);
        self.stalled = 0;
        Ok(())
    }

    /// Goes to an event and through it.
    fn pass_event(&mut self, position: f64, when: Instant) -> Result<(), Error> {
        let Step { dense, found } = self.step.take().expect("a step was made");
        self.keep_signs(&found);
        // A life about as short as the resolution of time, after a life as short, after another …
        let age = when.since(self.tree.birth(found.touched[0].id));
        self.stalled = if age <= SHORT_LIFE * when.resolution() { self.stalled + 1 } else { 0 };
        self.now = when;
        // A step that could be as long as one likes says nothing about the next; life does.
        if self.last_error <= EASY {
            self.step_size = self.step_size.min((FORESIGHT * position * dense.h).max(when.resolution()));
        }
        for (component, &place) in self.system.places.iter().enumerate() {
            self.tree.set_value(place as usize, dense.value(component, position));
        }
        if self.stalled > MAX_STALLED {
            let change = &found.touched[0];
            let rule = self.states[change.id.slot()].as_ref().and_then(|s| s.rule).unwrap_or(0);
            let site = self.site_of(change.id, rule, self.model.rules[rule].span, when.to_f64());
            return Err(Error::Zeno { site });
        }
        (self.since_mark, self.mark) = (0, when);
        self.settle(&found.touched)?;
        self.begin_phase()
    }

    fn keep_signs(&mut self, found: &Found) {
        for change in &found.changes {
            if let Some(state) = &mut self.states[change.id.slot()]
                && state.id == change.id
            {
                state.signs[change.atom] = change.after;
            }
        }
    }

    /// After a change of structure: new system, new first rates.
    fn begin_phase(&mut self) -> Result<(), Error> {
        self.rebuild();
        self.workspace.resize(self.settings.method, self.y.len());
        self.rate_is_known = false;
        self.first_rate()
    }

    fn first_rate(&mut self) -> Result<(), Error> {
        if self.rate_is_known {
            return Ok(());
        }
        let mut first = std::mem::take(&mut self.workspace.k[0]);
        self.system.equations(&self.model.rules).rates(0.0, &self.y, &mut first);
        self.stats.rhs_evaluations += 1;
        let bad = first.iter().position(|x| !x.is_finite());
        self.workspace.k[0] = first;
        self.rate_is_known = true;
        match bad {
            Some(component) => Err(self.not_finite(component, "the rate of")),
            None => Ok(()),
        }
    }

    /// Makes the next step and searches it for events.
    fn make_step(&mut self) -> Result<(), Error> {
        self.first_rate()?;
        let method = self.settings.method;
        let tolerance = self.settings.tolerance * INNER_TOLERANCE;
        let h = match self.settings.grid() {
            Some(grid) => Instant::new(self.next_grid_time(grid)).since(self.now),
            None => self.step_size,
        };
        let (mut h, mut rejected) = (h, false);
        loop {
            if self.settings.grid().is_none() && h <= 4.0 * self.now.resolution() / 8.0 && !self.y.is_empty()
            {
                return Err(self.too_small(self.worst_component()));
            }
            let mut system = self.system.equations(&self.model.rules);
            let (trial, evaluations) = self.workspace.attempt(method, &mut system, &self.y, h, tolerance);
            self.stats.rhs_evaluations += evaluations;
            match trial {
                Trial::NotFinite(component) => {
                    let component = component.unwrap_or(0);
                    // A stage may have left the region where the equations are defined: go nearer.
                    if self.settings.grid().is_some() || h <= 1e-12 * self.now.to_f64().max(1e-3) {
                        return Err(self.not_finite(component, ""));
                    }
                    h *= 0.25;
                    rejected = true;
                }
                Trial::Done { error, rounding } if error.max(rounding) > 1.0 => {
                    let error = error.max(rounding);
                    self.stats.rejected += 1;
                    // Safety and exponents as in DOPRI5 (Hairer, Nørsett and Wanner 1993, II.4).
                    h *= (0.9 * error.powf(-0.2)).clamp(0.1, 0.9);
                    rejected = true;
                }
                Trial::Done { error, rounding } => {
                    if self.settings.grid().is_none() {
                        // Rounding is no reason to shorten a step that is good, only not to lengthen it.
                        self.step_size = h * self.growth(error, rejected || rounding > 0.5);
                        self.last_error = error;
                    }
                    break;
                }
            }
        }
        self.stats.steps += 1;
        let dense = self.workspace.dense(method, self.now, &self.y, h);
        let bounds: Vec<Interval> = (0..self.y.len()).map(|i| dense.bounds(i)).collect();
        let states = &self.states;
        let signs = |id: ModuleId| states[id.slot()].as_ref().map_or(&[][..], |s| &s.signs);
        let found = search(&self.model.rules, &self.system, &dense, &bounds, signs);
        self.step = Some(Step { dense, found });
        Ok(())
    }

    /// PI step control (Gustafsson 1991) with the constants of DOPRI5: beta = 0.04.
    fn growth(&self, error: f64, rejected: bool) -> f64 {
        let error = error.max(1e-10);
        let factor = 0.9 * error.powf(-0.17) * self.last_error.max(1e-4).powf(0.04);
        factor.clamp(0.2, if rejected { 1.0 } else { 10.0 })
    }

    /// The first multiple of the step size after the present.
    fn next_grid_time(&self, grid: f64) -> f64 {
        let now = self.now.to_f64();
        let mut n = (now / grid).floor() + 1.0;
        if n * grid - now <= self.now.resolution() {
            n += 1.0;
        }
        n * grid
    }

    /// A step over which the solution changes little (Hairer, Nørsett and Wanner 1993, II.4).
    fn first_step_size(&mut self) -> f64 {
        let tolerance = self.settings.tolerance * INNER_TOLERANCE;
        let f = &self.workspace.k.first().cloned().unwrap_or_default();
        let norm = |v: &[f64]| {
            v.iter().zip(&self.y).fold(0.0f64, |m, (v, y)| m.max((v / (tolerance * (1.0 + y.abs()))).abs()))
        };
        let (d0, d1) = (norm(&self.y), norm(f));
        if self.y.is_empty() || d1 == 0.0 {
            return 1e-3;
        }
        let guess = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 };
        let ahead: Vec<f64> = self.y.iter().zip(f).map(|(y, f)| y + guess * f).collect();
        let mut later = vec![0.0; ahead.len()];
        self.system.equations(&self.model.rules).rates(guess, &ahead, &mut later);
        self.stats.rhs_evaluations += 1;
        let bend: Vec<f64> = later.iter().zip(f).map(|(a, b)| a - b).collect();
        let d2 = norm(&bend) / guess;
        let most = d1.max(d2);
        let next = if most <= 1e-15 { (guess * 1e-3).max(1e-6) } else { (0.01 / most).powf(0.2) };
        let size = next.min(100.0 * guess);
        if size.is_finite() && size > 0.0 { size } else { 1e-6 }
    }

    fn worst_component(&self) -> usize {
        let size = |i: usize| (self.workspace.k[0][i] / (1.0 + self.y[i].abs())).abs();
        (0..self.y.len()).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
    }

    fn too_small(&self, component: usize) -> Error {
        Error::StepTooSmall { site: self.site_of_component(component).0 }
    }

    fn not_finite(&self, component: usize, what: &str) -> Error {
        let (site, parameter) = self.site_of_component(component);
        Error::NotFinite { site, what: format!("{what} {parameter}").trim().to_owned() }
    }

    /// The module that a component belongs to, and the name of its parameter.
    fn site_of_component(&self, component: usize) -> (Site, String) {
        let rules = &self.model.rules;
        match self.system.owner(rules, component) {
            Some((member, parameter)) => {
                let rule = &rules[member.rule];
                let span = member.solve.map_or(rule.span, |s| rule.solves[s].span);
                let mut site = self.site_of(member.id, member.rule, span, self.now.to_f64());
                site.module = self.describe_now(member.id);
                (site, rule.parameters[parameter].clone())
            }
            None => {
                let site = Site {
                    module: "the structure".to_owned(),
                    lineage: Lineage::of_axiom(0),
                    rule: String::new(),
                    span: Default::default(),
                    time: self.now.to_f64(),
                };
                (site, "a value".to_owned())
            }
        }
    }

    /// A module with its parameters as they stand in the tree.
    pub(super) fn describe(&self, id: ModuleId) -> String {
        describe(self.model, self.tree.kind(id), self.tree.parameters(id))
    }

    fn describe_now(&self, id: ModuleId) -> String {
        let values: Vec<f64> = (self.tree.places(id))
            .map(|place| self.system.component(place).map_or(self.tree.values()[place], |c| self.y[c]))
            .collect();
        describe(self.model, self.tree.kind(id), &values)
    }
}

/// The tolerance of a single step, as a part of the tolerance asked for: errors of steps add up, and move
/// the times of events, which move what comes after them.
const INNER_TOLERANCE: f64 = 0.1;

/// A module as it is written, numbers to six digits: for people.
pub fn describe(model: &Model, kind: KindId, parameters: &[f64]) -> String {
    let name = &model.kinds.get(kind).name;
    if parameters.is_empty() {
        return name.clone();
    }
    let shown: Vec<String> = parameters.iter().map(|x| brief(*x, 6)).collect();
    format!("{name}({})", shown.join(", "))
}

/// A number to some digits, with an exponent where that is shorter: for people.
pub fn brief(x: f64, digits: usize) -> String {
    let rounded: f64 = format!("{x:.*e}", digits - 1).parse().unwrap_or(x);
    let (plain, exponent) = (rounded.to_string(), format!("{rounded:e}"));
    if plain.len() <= digits + 6 { plain } else { exponent }
}

impl Method {
    pub(super) fn stages(self) -> usize {
        match self {
            Method::Euler => 1,
            Method::Rk4 => 5,
            Method::Dopri5 | Method::Auto => 7,
        }
    }

    pub(super) fn dense_degree(self) -> usize {
        match self {
            Method::Euler => 1,
            Method::Rk4 => 3,
            Method::Dopri5 | Method::Auto => 4,
        }
    }
}
