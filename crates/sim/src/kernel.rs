//! The kernel: a simulation and its loop over events.
//!
//! ```text
//! at(t):   pass(t) ──────────────────────────────▶ observe
//!            │ until nothing is due before t
//!            ▼
//!   next entry of the schedule
//!     ├─ end of a searched stretch ─▶ flow: go on ─▶ detect ─▶ schedule
//!     └─ event ─▶ gather the batch of one instant ─▶ event: iterate ─▶ flow: start ─▶ detect ─▶ schedule
//! ```
//!
//! A simulation is made of parts; a stage is handed the parts that it works on ([`FlowStage`], [`EventStage`]). Only this
//! file and `observe` see all of them.

use super::budget::{self, Budget};
use super::chain::Chains;
use super::error::{Error, Site};
use super::event::{EventStage, Events, SHORT_LIFE, chance};
use super::flow::{FlowStage, Flows, lazy};
use super::log::{Event, Log};
use super::observe::cache::FrameCache;
use super::schedule::{Entry, NextEvent, Owner, Schedule, is_before};
use super::scratch::Scratch;
use super::setup::Setup;
use super::surroundings::Link;
use super::world::neighbours::Neighbours;
use super::world::new_modules::{NewModules, kinds_of};
use super::world::prefetch::prefetch_events;
use super::world::state::NextKind;
use super::world::{Instant, World, site_of_axiom};
use super::{Settings, Stats, detect::Detector};
use dlsys_diagnostic::Diagnostic;
use dlsys_model::Model;
use dlsys_tree::{Family, ModuleId, ModuleString, SimTime};

/// A model developing in time; observe it with [`Simulation::at`].
///
/// Every module has a clock of its own unless it reads a neighbour that is integrated numerically; those share
/// one. Steps and events do not depend on what is observed, so the state at a time is the same bits whichever other
/// times are asked for.
#[derive(Clone)]
pub struct Simulation<'m> {
    pub(super) setup: Setup<'m>,
    /// The instant of the last event.
    pub(super) instant: Instant,
    pub(super) world: World,
    pub(super) neighbours: Neighbours,
    pub(super) schedule: Schedule,
    pub(super) flows: Flows,
    detector: Detector,
    events: Events,
    pub(super) log: Log,
    pub(super) frames: FrameCache,
    pub(super) scratch: Scratch,
    /// None for a model that reads nothing of its surroundings.
    pub(super) surroundings: Option<Box<Link<'m>>>,
    pub(super) budget: Budget,
    pub(super) chains: Chains,
    progress: Progress,
    /// The error with which the simulation has ended.
    fault: Option<Error>,
}

/// Signs that time hardly goes on.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// Events in a row of modules that hardly lived.
    stalled: usize,
    /// The instant since when only equations have changed, and how often.
    standing: (SimTime, usize),
}

/// Events in a row of short lives, after which events are said to pile up.
const MAX_STALLED: usize = 100;

/// Changes of equations at one instant. Several modules may change theirs within the resolution of time, but not so many.
const MAX_STANDING: usize = 1000;
/// Time stands if it goes on by no more than so many times its resolution from one change of equations to the next.
const CRAWL: f64 = 1000.0;

impl<'m> Simulation<'m> {
    /// Makes the initial string at t = 0 and lets everything happen that happens there. Without surroundings
    /// ([`Simulation::with_surroundings`]) every `strain` and every force is 0.
    ///
    /// # Errors
    /// If the initial string has no parameters, or what happens at t = 0 fails.
    pub fn new(model: &'m Model, settings: Settings) -> Result<Simulation<'m>, Error> {
        let setup = Setup::new(model, settings);
        let mut simulation = Simulation {
            instant: Instant::default(),
            world: World::new(model, &setup.kinds_with_context),
            neighbours: Neighbours::default(),
            schedule: Schedule::default(),
            flows: Flows::new(model),
            detector: Detector::default(),
            events: Events::new(&setup),
            log: Log { events: settings.log.then(Vec::new), ..Log::default() },
            frames: FrameCache::new(),
            scratch: Scratch::default(),
            surroundings: None,
            budget: Budget::default(),
            chains: Chains::default(),
            progress: Progress::default(),
            fault: None,
            setup,
        };
        simulation.budget.start_clock(&settings);
        simulation.plant_axiom()?;
        simulation.event_stage().iterate()?;
        simulation.budget.stop_clock();
        Ok(simulation)
    }

    /// Makes the modules of the initial string.
    fn plant_axiom(&mut self) -> Result<(), Error> {
        let site = || site_of_axiom(0.0);
        let (mut new, axiom) = (NewModules::default(), &self.setup.model.axiom);
        let (mut variables, registers) = (Vec::new(), &mut self.scratch.registers);
        chance::modules(self.setup.seed, axiom, Family::AXIOM, &mut variables, registers, &mut new)
            .map_err(|undrawn| undrawn.error(site()))?;
        let (tree, fresh) = (&mut self.world.tree, &mut self.events.fresh);
        let kinds = kinds_of(axiom, &new.kinds);
        tree.append(kinds, &new.arguments, SimTime::ZERO, Family::AXIOM, fresh);
        if self.setup.hands_on {
            self.neighbours.hand_on(None, kinds, fresh, |kind| self.setup.skips(kind));
        }
        self.log.stats.peak_modules = tree.len() as u64;
        let limit = self.setup.settings.max_modules;
        match tree.len() > limit {
            true => Err(Error::TooManyModules { site: site(), limit, rounds: 0 }),
            false => Ok(()),
        }
    }

    /// The parts that flows work on.
    pub(super) fn flow_stage(&mut self) -> FlowStage<'_, 'm> {
        FlowStage {
            setup: &self.setup,
            instant: &self.instant,
            world: &mut self.world,
            neighbours: &self.neighbours,
            schedule: &mut self.schedule,
            flows: &mut self.flows,
            detector: &mut self.detector,
            log: &mut self.log,
            scratch: &mut self.scratch,
        }
    }

    /// The parts that event iteration works on.
    pub(super) fn event_stage(&mut self) -> EventStage<'_, 'm> {
        EventStage {
            setup: &self.setup,
            instant: &mut self.instant,
            world: &mut self.world,
            neighbours: &mut self.neighbours,
            schedule: &mut self.schedule,
            flows: &mut self.flows,
            detector: &mut self.detector,
            events: &mut self.events,
            log: &mut self.log,
            budget: &self.budget,
            scratch: &mut self.scratch,
        }
    }

    /// Writes the structure at time `t` into `out`. Times must not decrease from call to call.
    ///
    /// A module lives from its birth to just before its end: at the instant of an event, the successors
    /// are there. After an error, every further call gives the same error.
    ///
    /// # Errors
    /// If an event up to `t` fails, an integration does not go on, or a limit of the settings is exceeded.
    pub fn at(&mut self, t: f64, out: &mut ModuleString) -> Result<(), Error> {
        self.pass(t)?;
        let at = SimTime::new(t);
        // An event within the resolution of time of `t` may have taken place a little after it.
        let now = if at.since(self.instant.at) < 0.0 { self.instant.at } else { at };
        self.flow_stage().show_coupled(now);
        let shown = self.observe(t, now, out);
        if let Err(fault) = &shown {
            self.fault = Some(fault.clone());
        }
        shown
    }

    /// Lets time pass up to `t` without an observation: the first part of [`Simulation::at`].
    ///
    /// # Errors
    /// As of [`Simulation::at`].
    pub fn pass(&mut self, t: f64) -> Result<(), Error> {
        self.guarded(|simulation| {
            while simulation.pass_chains(t) || simulation.advance_once(t)?.is_some() {}
            Ok(())
        })
    }

    /// Calls a function unless the simulation has failed, and keeps its error.
    pub(super) fn guarded<T>(&mut self, go: impl FnOnce(&mut Self) -> Result<T, Error>) -> Result<T, Error> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        self.budget.start_clock(&self.setup.settings);
        let gone = go(self);
        self.budget.stop_clock();
        if let Err(fault) = &gone {
            self.fault = Some(fault.clone());
        }
        gone
    }

    pub(super) fn has_failed(&self) -> bool {
        self.fault.is_some()
    }

    /// The next entry of the schedule.
    fn peek(&mut self) -> Option<NextEvent> {
        let (rules, scratch) = (&self.setup.model.rules, &mut self.scratch);
        self.schedule.peek(&mut self.world, |world, slot| lazy::event_of(world, rules, slot, scratch))
    }

    /// Passes the next entry of the schedule, if it is due before `t`; returns whether it was an event.
    pub(super) fn advance_once(&mut self, t: f64) -> Result<Option<bool>, Error> {
        let until = SimTime::new(t);
        let Some(next) = self.peek() else { return Ok(None) };
        let event = match next {
            NextEvent::Other(entry) => is_event(&self.world, entry.owner),
            NextEvent::Lazy(..) => true,
        };
        if !is_before(next.at(), event, until) && (event || !self.must_go_on(next, until)) {
            return Ok(None);
        }
        // One entry may be many productions, and most are one.
        let done = self.log.stats.events.max(self.schedule.passed);
        if self.budget.is_due(done) {
            let modules = self.world.tree.len();
            let Simulation { setup, world, flows, events, .. } = self;
            let site = || site_of_next(setup, world, flows, events, next);
            self.budget.check(&setup.settings, done, modules, (next.at(), until), site)?;
        }
        (self.schedule.passed, self.schedule.last) = (self.schedule.passed + 1, Some((next.at(), event)));
        match next {
            NextEvent::Other(entry) if !event => {
                self.schedule.take(&next);
                self.go_on(entry)?;
            }
            NextEvent::Other(Entry { owner: Owner::Tick, at, .. }) => {
                self.schedule.take(&next);
                self.pass_tick(at)?;
            }
            _ => self.pass_event(next)?,
        }
        Ok(Some(event))
    }

    /// True for the end of a searched stretch at the very instant up to which time passes, if what happens then is found
    /// only by going on from there.
    fn must_go_on(&mut self, next: NextEvent, until: SimTime) -> bool {
        let NextEvent::Other(entry) = next else { return false };
        if entry.at.since(until) > until.resolution() {
            return false;
        }
        // A stretch of a closed form costs nothing to go on from.
        if let Owner::Module(slot) = entry.owner
            && self.world.states.get(slot as usize).is_some_and(|s| s.coupled || !s.is_numeric())
        {
            return true;
        }
        // One more step may lead beyond the end of the equations.
        let world = &self.world;
        self.schedule.any_at(until, |owner| is_event(world, owner))
    }

    /// Goes on from the end of a searched stretch.
    fn go_on(&mut self, entry: Entry) -> Result<(), Error> {
        self.goes_on();
        match entry.owner {
            Owner::Coupled => self.flow_stage().pass_coupled_step(entry.at),
            Owner::Derivation | Owner::Tick => unreachable!("they are events"),
            Owner::Module(slot) => {
                let id = self.world.states.get(slot as usize).expect("scheduled").id;
                self.flow_stage().pass_window(id, entry.at)
            }
        }
    }

    /// Goes to an event and through it, with all that happens at the same instant.
    fn pass_event(&mut self, first: NextEvent) -> Result<(), Error> {
        let at = first.at();
        if let NextEvent::Lazy(_, slot) = first
            && self.schedule.take_batch(at, &mut self.events.firing_lazy)
        {
            self.instant.at = at;
            // The next module is fetched from memory meanwhile.
            if let Some(slot) = self.schedule.upcoming_slot() {
                std::hint::black_box(self.world.tree.birth(self.world.tree.id(slot)));
            }
            self.flow_stage().show_coupled(at);
            self.check_pace(self.world.tree.id(slot))?;
            return self.event_stage().iterate_lazily();
        }
        let oldest = self.gather(at)?;
        if let Some(id) = oldest {
            self.check_pace(id)?;
        }
        if oldest.is_none() && self.events.is_idle() {
            // All that was due has turned out to be a little later.
            return Ok(());
        }
        let before = self.log.stats.events;
        prefetch_events(&self.world, &self.neighbours, self.schedule.soon());
        self.event_stage().iterate()?;
        match oldest {
            Some(id) if self.log.stats.events == before => self.check_standstill(id),
            _ => Ok(()),
        }
    }

    /// Collects the batch of everything that happens at an instant; returns the first module of it.
    fn gather(&mut self, at: SimTime) -> Result<Option<ModuleId>, Error> {
        let mut batch = std::mem::take(&mut self.events.batch);
        batch.clear();
        let mut first: Option<(SimTime, f64)> = None;
        let mut later = Vec::new();
        while let Some(next) = self.peek() {
            if next.at().since(at) > at.resolution() {
                break;
            }
            self.schedule.take(&next);
            let id = match next {
                // A tick comes after all that happens at its instant.
                NextEvent::Other(Entry { owner: Owner::Tick, .. }) => {
                    later.push(next);
                    continue;
                }
                // The common step does not go on before what happens at this instant.
                NextEvent::Other(Entry { owner: Owner::Coupled, .. }) if !batch.is_empty() => {
                    later.push(next);
                    continue;
                }
                NextEvent::Other(entry) if !is_event(&self.world, entry.owner) => {
                    self.go_on(entry)?;
                    continue;
                }
                NextEvent::Lazy(_, slot) => Some(self.world.tree.id(slot)),
                NextEvent::Other(Entry { owner: Owner::Module(slot), .. }) => {
                    Some(self.world.states.get(slot as usize).expect("scheduled").id)
                }
                NextEvent::Other(_) => None,
            };
            if let Some(id) = id {
                let birth = self.world.tree.birth(id);
                match first {
                    None => first = Some((birth, at.since(birth))),
                    // Those born together have clocks that are as good as their age is short.
                    Some((elder, age)) if elder == birth => {
                        if next.at().since(birth) - age > SimTime::new(age).resolution() {
                            later.push(next);
                            continue;
                        }
                    }
                    Some(_) => {}
                }
            }
            batch.push(next);
        }
        for next in later {
            self.schedule.put_back(next);
        }
        self.instant.at = at;
        self.flow_stage().show_coupled(at);
        let oldest = self.event_stage().open_batch(&batch);
        self.events.batch = batch;
        oldest
    }

    /// Forgets signs that time hardly goes on.
    pub(super) fn goes_on(&mut self) {
        self.progress.stalled = 0;
    }

    /// Checks that events do not pile up: a life about as short as the resolution of time, after a life as short, and so on.
    fn check_pace(&mut self, id: ModuleId) -> Result<(), Error> {
        let now = self.instant.at;
        let is_short = now.since(self.world.tree.birth(id)) <= SHORT_LIFE * now.resolution();
        self.progress.stalled = if is_short { self.progress.stalled + 1 } else { 0 };
        match self.progress.stalled <= MAX_STALLED {
            true => Ok(()),
            false => Err(self.no_progress(id, |site| Error::Zeno { site })),
        }
    }

    /// Checks that equations do not change again and again while time hardly goes on.
    fn check_standstill(&mut self, id: ModuleId) -> Result<(), Error> {
        let now = self.instant.at;
        let (since, times) = self.progress.standing;
        let stands = now.since(since) <= (1.0 + CRAWL * times as f64) * now.resolution();
        self.progress.standing = if stands { (since, times + 1) } else { (now, 0) };
        // Many modules may change their equations one after the other within a short time.
        match times <= MAX_STANDING.max(8 * self.world.tree.len()) || !stands {
            true => Ok(()),
            false => Err(self.no_progress(id, |site| Error::Chattering { site })),
        }
    }

    /// The error of a module with which time does not go on.
    #[cold]
    fn no_progress(&mut self, id: ModuleId, error: impl FnOnce(Site) -> Error) -> Error {
        let undefined = self.flow_stage().undefined_rate(id);
        undefined.unwrap_or_else(|| error(self.world.site_of_rule(self.setup.model, id, self.instant.at)))
    }

    /// Work done so far.
    pub fn stats(&self) -> Stats {
        let rhs_evaluations = self.log.stats.rhs_evaluations + self.flows.evaluations();
        let (modules, unbounded) = (self.world.tree.len() as u64, self.detector.unbounded.len() as u64);
        Stats { modules, unbounded, rhs_evaluations, ..self.log.stats }
    }

    /// True if equations were stiff, so that the implicit method was taken.
    pub fn has_been_stiff(&self) -> bool {
        self.flows.has_been_stiff()
    }

    /// Warnings of the run so far: rules whose rates could not be bounded somewhere, so that a rate that is large there for a
    /// very short time may have been overlooked; and sides of conditions that have come nearer each other than the error of
    /// integration, so that a production may have been due.
    pub fn remarks(&self) -> Vec<Diagnostic> {
        self.detector.remarks(self.setup.model)
    }

    /// The productions since the last call, in the order of time.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.log.events.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Productions that were computed chain by chain, without the queue (differential tests).
    #[doc(hidden)]
    pub fn productions_in_chains(&self) -> u64 {
        self.chains.productions
    }

    /// Bytes that a copy takes, about.
    pub fn size(&self) -> usize {
        let around = self.surroundings.as_ref().map_or(0, |link| link.size());
        budget::size(&self.setup, &self.world, self.flows.coupled.members.len()) + around
    }
}

/// True if an entry is an event, not the end of a searched stretch.
fn is_event(world: &World, owner: Owner) -> bool {
    match owner {
        Owner::Coupled => false,
        Owner::Derivation | Owner::Tick => true,
        Owner::Module(slot) => {
            world.states.get(slot as usize).is_some_and(|s| s.next.kind != NextKind::Window)
        }
    }
}

/// The place of the next entry of the schedule.
fn site_of_next(setup: &Setup, world: &World, flows: &Flows, events: &Events, next: NextEvent) -> Site {
    let id = match next {
        NextEvent::Lazy(_, slot) => world.tree.id(slot),
        NextEvent::Other(entry) => match entry.owner {
            Owner::Module(slot) => match world.states.get(slot as usize) {
                Some(state) => state.id,
                None => flows.anyone(world),
            },
            Owner::Derivation => events.steps.first().unwrap_or_else(|| flows.anyone(world)),
            Owner::Coupled => flows.anyone(world),
            Owner::Tick => return world.site_of_first(setup.model, next.at()),
        },
    };
    world.site_of_module(setup.model, id, next.at())
}
