//! The clock: events in their order, observation.

use std::collections::{BTreeMap, HashSet};
use std::sync::atomic::{AtomicU64, Ordering};

use super::agenda::Agenda;
use super::budget::Budget;
use super::career::Careers;
use super::chance;
use super::consistent::Consistency;
use super::coupled::Coupled;
use super::derive::Steps;
use super::error::{Error, Near, Site};
use super::event::Event;
use super::flash::Lookout;
use super::integrator::Integrator;
use super::known_rates::KnownRates;
use super::motion::Motion;
use super::neighbours::Neighbours;
use super::observe::Gallery;
use super::passing::{Coming, Front};
use super::plant::{Path, Plant};
use super::queue::Queue;
use super::settle::Firing;
use super::state::{Control, What};
use super::transition::Recorder;
use super::watch::Watcher;
use super::{Method, Settings, Stats};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::Scratch;
use dlsys_model::{CUT, KindId, Model};
use dlsys_tree::{Family, Lineage, ModuleId, ModuleString, Seed, SimTime, Tree};

/// A model developing in time; observe it with [`Simulation::at`].
///
/// Every module has a clock of its own unless it reads a neighbour that is integrated numerically; those share
/// one. Steps and events do not depend on what is observed, so the state at a time is the same bits whichever other
/// times are asked for.
#[derive(Clone)]
pub struct Simulation<'m> {
    pub(super) model: &'m Model,
    pub(super) settings: Settings,
    /// Of modules that are integrated together.
    pub(super) coupled_settings: Settings,
    pub(super) seed: Seed,
    /// Formulas are not used.
    pub(super) forced: bool,
    /// The common case is done quickly.
    pub(super) quick: bool,
    pub(super) plant: Plant,
    /// What comes next of modules with a state.
    pub(super) queue: Queue,
    /// What comes next of light modules, and the first of it.
    pub(super) agenda: Agenda,
    pub(super) front: Front,
    /// The kind of `%`, if the model has it.
    pub(super) cuts: Option<KindId>,
    /// Slots of light modules that were cut off before their events.
    pub(super) ghosts: HashSet<u32>,
    /// Time of the last event.
    pub(super) now: SimTime,
    /// Number of the last instant at which something happened.
    pub(super) group: u64,
    /// Modules that the instant concerns.
    pub(super) opened: Vec<ModuleId>,
    /// Modules that it concerns, and that have their equations already.
    pub(super) ready: Vec<ModuleId>,
    /// Modules that were made at the instant and are not looked up yet.
    pub(super) fresh: Vec<ModuleId>,
    /// The structure has changed since contexts were looked up.
    pub(super) changed: bool,
    /// Some rule has a context.
    pub(super) looks_around: bool,
    pub(super) kinds_with_context: Vec<bool>,
    /// Neighbours are remembered.
    pub(super) hands_on: bool,
    /// No module looks at others, nothing is solved for, no rule is discrete, no transition is recorded: what one light
    /// module does at an instant is no business of anybody else.
    pub(super) plain: bool,
    /// Discrete rules.
    pub(super) steps: Steps,
    pub(super) neighbours: Neighbours,
    /// Some rule has an aggregate.
    pub(super) gathers: bool,
    /// Modules attached to the one that looks.
    pub(super) attached: Vec<ModuleId>,
    /// Modules whose neighbours have changed.
    pub(super) to_look: Vec<ModuleId>,
    /// What is known of neighbours may be wrong.
    pub(super) lost: bool,
    /// Modules that rest on a boundary and have a context: neighbours may move it.
    pub(super) resting: Vec<ModuleId>,
    pub(super) coupled: Coupled,
    pub(super) algebra: Consistency,
    pub(super) alone: Integrator,
    /// Whose step it made last, and to when.
    pub(super) alone_last: Option<(ModuleId, SimTime)>,
    /// What step control has learnt, per kind and number of the clause: modules of one kind that live through the
    /// same under different rules take the same steps.
    pub(super) hints: Vec<Vec<Control>>,
    pub(super) watcher: Watcher,
    pub(super) lookout: Lookout,
    /// Rules whose rates could not be bounded, and when first.
    pub(super) unbounded: BTreeMap<usize, f64>,
    /// Atoms of rules, with the number of the rule, whose sides have come so near each other that the error of integration does not
    /// tell whether they meet; when first, and of how many modules it is not known yet.
    pub(super) approached: BTreeMap<(usize, usize), (f64, usize)>,
    /// Some rates may have flashes.
    pub(super) flashes: bool,
    /// Events in a row of modules that hardly lived.
    pub(super) stalled: usize,
    /// Since when nothing has happened but changes of equations, at one instant, and how many.
    pub(super) standing: (SimTime, usize),
    pub(super) known_rates: KnownRates,
    pub(super) stats: Stats,
    /// Productions since they were last taken, if they are recorded.
    pub(super) log: Option<Vec<Event>>,
    pub(super) recorder: Option<Recorder>,
    pub(super) gallery: Gallery,
    /// Tells the simulations of a process apart.
    pub(super) source: u64,
    /// Number of changes of the structure.
    pub(super) structure: u64,
    fault: Option<Error>,
    pub(super) budget: Budget,
    /// Entries of the queues passed so far; the last of them, and whether it was an event.
    pub(super) passed: u64,
    pub(super) last: Option<(SimTime, bool)>,
    // Memory that is used again and again.
    pub(super) variables: Vec<f64>,
    pub(super) scratch: Scratch<f64>,
    pub(super) arguments: Vec<f64>,
    /// Of each production: where its arguments end, which successor it has, and the lineage of that.
    pub(super) argument_ends: Vec<(usize, usize, Family)>,
    /// Productions that are known to apply at the instant.
    pub(super) firing: Vec<Firing>,
    /// Slots of light modules whose event it is.
    pub(super) firing_light: Vec<u32>,
    pub(super) made: Vec<ModuleId>,
    pub(super) motions: Vec<Motion>,
    pub(super) y: Vec<f64>,
    pub(super) rates: Vec<f64>,
    pub(super) group_entries: Vec<Coming>,
}

/// Number of simulations that there have been.
static SOURCES: AtomicU64 = AtomicU64::new(0);

/// Events in a row of modules that lived no longer than this many resolutions of time, after which events
/// are said to pile up.
const MAX_STALLED: usize = 100;
pub(super) const SHORT_LIFE: f64 = 64.0;

impl<'m> Simulation<'m> {
    /// Makes the initial string at t = 0 and lets everything happen that happens there.
    pub fn new(model: &'m Model, settings: Settings) -> Result<Simulation<'m>, Error> {
        let kinds = || model.kinds.iter().map(|(_, kind)| kind);
        let tree =
            Tree::new(kinds().map(|k| k.width() as u32).collect(), kinds().map(|k| k.arity as u32).collect());
        let has_context = |rule: &usize| model.rules[*rule].looks_around();
        let kinds_with_context: Vec<bool> =
            model.kinds.iter().map(|(_, kind)| kind.rules.iter().any(has_context)).collect();
        let looks_around = kinds_with_context.contains(&true);
        let hands_on = looks_around || model.rules.iter().any(|rule| rule.discrete && rule.context_len() > 0);
        let gathers = model.rules.iter().any(|rule| !rule.aggregates.is_empty());
        let (steps, algebra) = (Steps::new(model), Consistency::new(model));
        let is_discrete = model.rules.iter().any(|rule| rule.discrete);
        let plain = !hands_on && !gathers && !algebra.any && !is_discrete && !settings.transitions;
        let careers = Careers::new(model, &kinds_with_context);
        let mut simulation = Simulation {
            model,
            settings,
            coupled_settings: settings
                .for_clocks(model.rules.iter().flat_map(|r| &r.solves).any(|s| s.has_hazard_clock)),
            seed: Seed::new(settings.seed),
            forced: settings.method != Method::Auto,
            quick: !settings.transitions && !settings.slow,
            plant: Plant { tree, states: Vec::new(), careers, coupled: None },
            queue: Queue::default(),
            agenda: Agenda::default(),
            front: Front::default(),
            cuts: model.kinds.find(CUT, 0),
            ghosts: HashSet::new(),
            now: SimTime::ZERO,
            group: 0,
            opened: Vec::new(),
            ready: Vec::new(),
            fresh: Vec::new(),
            changed: true,
            looks_around,
            kinds_with_context,
            hands_on,
            plain,
            steps,
            neighbours: Neighbours::default(),
            gathers,
            attached: Vec::new(),
            algebra,
            to_look: Vec::new(),
            lost: false,
            resting: Vec::new(),
            coupled: Coupled::default(),
            alone: Integrator::default(),
            alone_last: None,
            hints: (model.kinds.iter())
                .map(|(_, kind)| {
                    let clauses = kind.rules.iter().map(|r| model.rules[*r].solves.len()).max();
                    vec![Control::default(); clauses.unwrap_or(0)]
                })
                .collect(),
            watcher: Watcher::default(),
            lookout: Lookout::default(),
            unbounded: BTreeMap::new(),
            approached: BTreeMap::new(),
            flashes: model.rules.iter().flat_map(|rule| &rule.solves).any(|solve| solve.has_pulses),
            stalled: 0,
            standing: (SimTime::ZERO, 0),
            known_rates: KnownRates::default(),
            stats: Stats::default(),
            log: settings.log.then(Vec::new),
            recorder: (settings.log && settings.transitions).then(Recorder::default),
            fault: None,
            budget: Budget::default(),
            passed: 0,
            last: None,
            variables: Vec::new(),
            scratch: Vec::new(),
            arguments: Vec::new(),
            argument_ends: Vec::new(),
            firing: Vec::new(),
            firing_light: Vec::new(),
            made: Vec::new(),
            gallery: Gallery::default(),
            source: SOURCES.fetch_add(1, Ordering::Relaxed),
            structure: 0,
            motions: Vec::new(),
            y: Vec::new(),
            rates: Vec::new(),
            group_entries: Vec::new(),
        };
        simulation.start_clock();
        simulation.plant_axiom()?;
        simulation.settle()?;
        simulation.stop_clock();
        Ok(simulation)
    }

    fn plant_axiom(&mut self) -> Result<(), Error> {
        let site = || site_of_axiom(0.0);
        let (mut arguments, mut variables) = (Vec::new(), Vec::new());
        let (axiom, scratch) = (&self.model.axiom, &mut self.scratch);
        chance::arguments(self.seed, axiom, Family::AXIOM, &mut variables, scratch, &mut arguments)
            .map_err(|misfortune| misfortune.error(site()))?;
        let tree = &mut self.plant.tree;
        tree.append(&self.model.axiom, &arguments, SimTime::ZERO, Family::AXIOM, &mut self.fresh);
        if self.hands_on {
            let skipped = |kind| self.model.kinds.get(kind).skipped;
            self.neighbours.hand_on(None, &self.model.axiom.kinds, &self.fresh, skipped);
        }
        self.stats.peak_modules = tree.len() as u64;
        if tree.len() > self.settings.max_modules {
            let limit = self.settings.max_modules;
            return Err(Error::TooManyModules { site: site(), limit, rounds: 0 });
        }
        Ok(())
    }

    /// Keeps what a search has found of atoms whose sides are too near each other to tell.
    pub(super) fn note_approach(&mut self, rule: usize, found: u64, before: u64, at: SimTime) {
        for atom in (0..64).filter(|atom| (found ^ before) & 1 << atom != 0) {
            if found & 1 << atom != 0 {
                self.approached.entry((rule, atom)).or_insert((at.to_f64(), 0)).1 += 1;
            } else if let Some((_, open)) = self.approached.get_mut(&(rule, atom)) {
                // They have met, and that was found.
                *open -= 1;
                if *open == 0 {
                    self.approached.remove(&(rule, atom));
                }
            }
        }
    }

    /// Work done so far.
    pub fn stats(&self) -> Stats {
        let coupled = self.coupled.integrator.evaluations() + self.repair_evaluations();
        let rhs_evaluations = self.stats.rhs_evaluations + self.alone.evaluations() + coupled;
        let (modules, unbounded) = (self.plant.tree.len() as u64, self.unbounded.len() as u64);
        Stats { modules, unbounded, rhs_evaluations, ..self.stats }
    }

    /// True if equations were stiff, so that the implicit method was taken.
    pub fn has_been_stiff(&self) -> bool {
        self.alone.is_implicit() || self.coupled.integrator.is_implicit()
    }

    /// What there is to say of the run so far: rules whose rates could not be bounded somewhere, so that a rate that is large
    /// there for a very short time may have been overlooked; and sides of conditions that have come nearer each other than the error
    /// of integration, so that a production may have been due.
    pub fn remarks(&self) -> Vec<Diagnostic> {
        let remark = |(&rule, &t): (&usize, &f64)| {
            let rule = &self.model.rules[rule];
            Diagnostic::warning(format!("the rates of {} have no bounds near t = {}", rule.label, brief(t, 6)))
                .at(rule.span, "these equations")
                .help("a rate that is very large there for a very short time may be overlooked: see what is divided by, or taken the logarithm of, or compare with `--method rk4 --step-size H`")
        };
        let near = |(&(rule, atom), &(t, _)): (&(usize, usize), &(f64, usize))| {
            let rule = &self.model.rules[rule];
            let boundary = rule.boundaries[atom].to_string();
            let boundary = if boundary.is_empty() { "a boundary" } else { &boundary };
            Diagnostic::warning(format!(
                "{} comes so near {boundary} by t = {} that the error of integration does not tell whether it meets it",
                rule.label,
                brief(t, 6)
            ))
            .at(rule.atoms[atom], "as long as that is so, nothing follows")
            .help("a smaller `--tolerance` tells more; if what comes near is to count, say how near: `if x >= y - 1e-5`")
        };
        self.unbounded.iter().map(remark).chain(self.approached.iter().map(near)).collect()
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
        self.pass(t)?;
        let at = SimTime::new(t);
        // An event within the resolution of time of `t` may have taken place a little after it.
        let now = if at.since(self.now) < 0.0 { self.now } else { at };
        self.show_coupled(now);
        let shown = self.observe(t, now, out);
        if let Err(fault) = &shown {
            self.fault = Some(fault.clone());
        }
        shown
    }

    /// Lets time pass up to `t` without looking. As [`Simulation::at`], of which it is a part.
    pub fn pass(&mut self, t: f64) -> Result<(), Error> {
        self.guarded(|simulation| simulation.advance(t))
    }

    /// Does something unless there was an error, and remembers its error.
    pub(super) fn guarded<T>(&mut self, go: impl FnOnce(&mut Self) -> Result<T, Error>) -> Result<T, Error> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        self.start_clock();
        let gone = go(self);
        self.stop_clock();
        if let Err(fault) = &gone {
            self.fault = Some(fault.clone());
        }
        gone
    }

    pub(super) fn has_failed(&self) -> bool {
        self.fault.is_some()
    }

    /// Opens a module whose event it is.
    pub(super) fn touch_alone(&mut self, slot: usize) -> Result<ModuleId, Error> {
        let state = self.plant.states[slot].as_mut().expect("scheduled");
        let id = state.id;
        if state.next.what == What::Doubt {
            let atom = state.next.touched[0].atom;
            return Err(self.in_doubt(id, atom));
        }
        if state.next.what == What::Fault {
            let ends: Vec<Option<f64>> = state.motions.iter().map(Motion::end).collect();
            let first = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
            let parameter = ends.iter().enumerate().filter_map(|(i, e)| Some((i, (*e)?))).min_by(first);
            let since = state.since;
            let mut error = self.not_finite(id, parameter.map_or(0, |p| p.0), self.now);
            if let Error::NotFinite { site, .. } = &mut error {
                // The values that the formula began with; at its end there are none.
                site.module += &format!(" (as of t = {})", brief(since.to_f64(), 6));
            }
            return Err(error);
        }
        let touched = std::mem::take(&mut state.next.touched);
        self.learn(id);
        self.touch(id, &touched);
        Ok(id)
    }

    /// A life about as short as the resolution of time, after a life as short, after another …
    pub(super) fn watch_for_piling_up(&mut self, id: ModuleId) -> Result<(), Error> {
        let age = self.now.since(self.plant.tree.birth(id));
        self.stalled = if age <= SHORT_LIFE * self.now.resolution() { self.stalled + 1 } else { 0 };
        if self.stalled <= MAX_STALLED {
            return Ok(());
        }
        let rule = self.plant.rule_and_clause(id).0.unwrap_or(0);
        let site = self.site_of(id, rule, self.model.rules[rule].span, self.now.to_f64());
        Err(Error::Zeno { site })
    }

    /// The time scale of a module's equations, as far as it is known.
    pub(super) fn reach_of(&self, id: ModuleId) -> f64 {
        let Some(state) = self.plant.state(id) else { return 1.0 };
        if state.coupled && self.coupled.control.size > 0.0 {
            return self.coupled.control.size;
        }
        let hint = state.solve.map_or(0.0, |solve| self.hints[self.plant.tree.kind(id).index()][solve].size);
        if hint > 0.0 { hint } else { 1.0 }
    }

    pub(super) fn not_finite(&self, id: ModuleId, parameter: usize, at: SimTime) -> Error {
        let (rule, solve) = self.plant.rule_and_clause(id);
        let rule_index = rule.unwrap_or(0);
        let compiled = &self.model.rules[rule_index];
        let span = solve.map_or(compiled.span, |s| compiled.solves[s].span);
        let site = self.site_of(id, rule_index, span, at.to_f64());
        if let Some(clock) = compiled.clocks.iter().find(|clock| clock.parameter == parameter) {
            let span = compiled.produces[clock.produce].span;
            return Error::NotFinite { site: Site { span, ..site }, what: "the rate of an event".to_owned() };
        }
        Error::NotFinite { site, what: compiled.parameters.get(parameter).cloned().unwrap_or_default() }
    }

    /// Two sides of a condition that have come too near each other for anybody to tell whether they have met.
    fn in_doubt(&mut self, id: ModuleId, atom: usize) -> Error {
        let index = self.plant.rule_and_clause(id).0.unwrap_or(0);
        let rule = &self.model.rules[index];
        self.plant.materialise(id, self.now);
        let site = self.site_of(id, index, rule.atoms[atom], self.now.to_f64());
        let mut sides = vec![0.0; rule.sides.outputs()];
        if let Some(state) = self.plant.state(id) {
            self.plant.variables(rule, id, &state.context, self.now, &mut self.variables);
            rule.sides.eval(&self.variables, &mut self.scratch, &mut sides);
        }
        let gap = (sides[2 * atom] - sides[2 * atom + 1]).abs();
        let error = self
            .plant
            .state(id)
            .map_or(0.0, |state| Path::new(&self.plant, state, rule, self.now, 0.0).error());
        let boundary = rule.boundaries[atom].to_string();
        Error::InDoubt { site, near: Box::new(Near { boundary, gap, error: error.max(gap) }) }
    }

    /// Some module, to name where nothing more is known.
    pub(super) fn anyone(&self) -> ModuleId {
        let named = self.coupled.members.iter().copied().find(|id| self.plant.state(*id).is_some());
        named
            .or_else(|| self.plant.states.iter().flatten().find(|s| s.is_alive).map(|s| s.id))
            .expect("there are modules")
    }

    pub(super) fn site(&self, fire: &Firing) -> Site {
        let span = self.model.rules[fire.rule].produces[fire.produce].span;
        self.site_of(fire.id, fire.rule, span, self.now.to_f64())
    }

    /// Where there is no module to name.
    pub(super) fn site_of_axiom(&self, time: f64) -> Site {
        site_of_axiom(time)
    }

    pub(super) fn site_of(&self, id: ModuleId, rule: usize, span: Span, time: f64) -> Site {
        let tree = &self.plant.tree;
        Site {
            module: describe(self.model, tree.kind(id), tree.parameters(id)),
            lineage: tree.lineage(id),
            rule: self.model.rules[rule].label.clone(),
            span,
            time,
        }
    }
}

fn site_of_axiom(time: f64) -> Site {
    Site {
        module: "the initial string".to_owned(),
        lineage: Lineage::of_axiom(0),
        rule: "initial string".to_owned(),
        span: Span::default(),
        time,
    }
}

/// A module as it is written, numbers to six digits: for people.
pub fn describe(model: &Model, kind: KindId, parameters: &[f64]) -> String {
    let (name, arity) = (&model.kinds.get(kind).name, model.kinds.get(kind).arity);
    // Hidden parameters are no part of how it is written.
    let parameters = &parameters[..parameters.len().min(arity)];
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
