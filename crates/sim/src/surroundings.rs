//! Surroundings: what acts on the modules from outside, on a grid of time of its own, as the bending of stems does.
//!
//! At each tick the surroundings get the string and give, for each module that reads `strain`, the strain at the next tick. From
//! tick to tick a strain is linear in time, so it is continuous, and to all stages it is a parameter that moves at a constant
//! rate: the tick changes the slope, and the modules concerned begin new trajectories, as they do when a neighbour changes.
//!
//! A tick is an entry of the schedule, after all others of its instant. So neither frames nor threads can change its time, the
//! string that it sees, or anything that follows from it.

use crate::error::{Error, Site};
use crate::kernel::Simulation;
use crate::log::Event;
use crate::schedule::Owner;
use crate::trajectory::Trajectory;
use crate::world::{World, describe, site_of_axiom};
use crate::{Settings, brief};
use dlsys_diagnostic::Span;
use dlsys_model::Model;
use dlsys_tree::{Module, ModuleId, ModuleString, SimTime, Version, Visit};

/// What acts on the modules of a simulation from outside, at the ticks of a grid of time.
///
/// The grid and the values must not depend on anything but the strings of the ticks, so that a run has the same bits whatever is
/// observed.
pub trait Surroundings: Send + Sync {
    /// The time of the next tick, in the model's unit: at least 0 for the first one, and after every tick later than it. Infinite
    /// if there is none; strains then stay as they are.
    fn next_tick(&self) -> f64;

    /// Takes the string at a tick and gives the values at the next one, which [`Surroundings::next_tick`] tells from then on.
    ///
    /// # Errors
    /// If the surroundings have no state at the next tick. The run then ends with [`Error::Surroundings`].
    fn tick(&mut self, string: &ModuleString, inputs: &mut Inputs) -> Result<(), Failure>;

    /// A copy that goes on as the original does, to the same bits.
    fn boxed_clone(&self) -> Box<dyn Surroundings>;

    /// Bytes that a copy takes, about.
    fn size(&self) -> usize;

    /// The work done so far, in units of very roughly a tenth of a microsecond: as [`Simulation::work`], of which it is a part.
    fn work(&self) -> u64 {
        0
    }
}

/// The values that the surroundings give at a tick.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    readers: Vec<usize>,
    strain: Vec<f64>,
    productions: Vec<Event>,
}

impl Inputs {
    /// The indices in the string of the modules that read `strain`, in ascending order.
    pub fn readers(&self) -> &[usize] {
        &self.readers
    }

    /// The strain of each reader at the next tick, without unit, in the order of [`Inputs::readers`]. They are 0 at first: the strain
    /// of a module that draws no stem.
    pub fn strain_mut(&mut self) -> &mut [f64] {
        &mut self.strain
    }

    /// The productions since the last tick, or since t = 0, in the order of time.
    pub fn productions(&self) -> &[Event] {
        &self.productions
    }

    /// Sets the strain of each reader to a function of the module.
    pub fn set_strain(&mut self, string: &ModuleString, mut strain: impl FnMut(Module<'_>) -> f64) {
        for (value, &index) in self.strain.iter_mut().zip(&self.readers) {
            *value = strain(string.get(index));
        }
    }
}

/// The reason why surroundings have no state at the next tick.
#[derive(Clone, Debug)]
pub struct Failure {
    /// The reason, as a message gives it after a colon.
    pub why: String,
    /// The index in the string of the module that it concerns; the first module if it is not known.
    pub module: Option<usize>,
    /// A place in the text, such as that of a declaration; that of the module's rule if there is none.
    pub span: Option<Span>,
    /// A remedy.
    pub help: Option<String>,
}

impl Failure {
    /// A failure without a place.
    pub fn new(why: impl Into<String>) -> Failure {
        Failure { why: why.into(), module: None, span: None, help: None }
    }

    /// The same, of the module at an index of the string.
    pub fn of(self, module: usize) -> Failure {
        Failure { module: Some(module), ..self }
    }

    /// The same at a place in the text.
    pub fn at(self, span: Span) -> Failure {
        Failure { span: Some(span), ..self }
    }

    /// The same with a remedy.
    pub fn help(self, help: impl Into<String>) -> Failure {
        Failure { help: Some(help.into()), ..self }
    }
}

/// The surroundings of a simulation, with the memory for the string that they get.
pub(super) struct Link {
    source: Box<dyn Surroundings>,
    string: ModuleString,
    inputs: Inputs,
    /// The modules that read `strain`, in string order, in the structure of some version.
    readers: Vec<ModuleId>,
    version: Option<Version>,
    /// How often a module has begun new trajectories because of a tick.
    restarts: u64,
}

impl Link {
    fn new(source: Box<dyn Surroundings>) -> Link {
        let (string, inputs, readers) = Default::default();
        Link { source, string, inputs, readers, version: None, restarts: 0 }
    }

    /// Bytes that a copy takes, about.
    pub fn size(&self) -> usize {
        self.source.size()
    }

    /// As [`Surroundings::work`], with that of the modules concerned.
    pub fn work(&self) -> u64 {
        /// The cost of a module that begins new trajectories.
        const RESTART: u64 = 10;
        self.source.work() + RESTART * self.restarts
    }

    /// Finds the modules that read `strain`, if the structure has changed.
    fn find_readers(&mut self, model: &Model, world: &World) {
        if self.version.is_some() && self.version == self.string.version() {
            return;
        }
        self.version = self.string.version();
        self.readers.clear();
        self.inputs.readers.clear();
        for (index, visit) in world.tree.walk().enumerate() {
            let Visit::Module(id) = visit else { continue };
            if model.kinds.get(world.tree.kind(id)).strain_parameter().is_some() {
                self.readers.push(id);
                self.inputs.readers.push(index);
            }
        }
    }
}

/// The string of a copy is empty: it is formed anew at the next tick.
impl Clone for Link {
    fn clone(&self) -> Link {
        Link { restarts: self.restarts, ..Link::new(self.source.boxed_clone()) }
    }
}

impl<'m> Simulation<'m> {
    /// As [`Simulation::new`], in surroundings. Those of a model that reads nothing of them are dropped.
    ///
    /// # Errors
    /// As of [`Simulation::new`], and if the time of the first tick is negative or NaN.
    pub fn with_surroundings(
        model: &'m Model,
        settings: Settings,
        surroundings: Box<dyn Surroundings>,
    ) -> Result<Simulation<'m>, Error> {
        let mut simulation = Simulation::new(model, settings)?;
        if model.reads_strain() {
            let link = Link::new(surroundings);
            simulation.schedule_tick(&link, None)?;
            simulation.surroundings = Some(Box::new(link));
            simulation.log.descent = Some(Vec::new());
        }
        Ok(simulation)
    }

    /// Puts the next tick into the schedule; returns the time until then from a tick now. `before` is the last one.
    fn schedule_tick(&mut self, link: &Link, before: Option<SimTime>) -> Result<f64, Error> {
        let next = link.source.next_tick();
        if next == f64::INFINITY {
            return Ok(next);
        }
        let ahead = SimTime::new(next).since(before.unwrap_or_default());
        let is_later = match before {
            Some(before) => ahead > before.resolution(),
            None => ahead >= 0.0,
        };
        if !is_later {
            let why = format!("their next tick would be at t = {}, which is not later", brief(next, 12));
            return Err(self.failure(Failure::new(why), link));
        }
        self.schedule.schedule(Owner::Tick, SimTime::new(next));
        Ok(ahead)
    }

    /// Passes a tick.
    pub(super) fn pass_tick(&mut self, at: SimTime) -> Result<(), Error> {
        let Some(mut link) = self.surroundings.take() else { return Ok(()) };
        let passed = self.tick(at, &mut link);
        self.surroundings = Some(link);
        passed
    }

    fn tick(&mut self, at: SimTime, link: &mut Link) -> Result<(), Error> {
        // An event within the resolution of time of the tick may have taken place a little after it.
        if at.since(self.instant.at) > 0.0 {
            self.instant.at = at;
        }
        let now = self.instant.at;
        self.flow_stage().show_coupled(now);
        self.observe(now.to_f64(), now, &mut link.string)?;
        link.find_readers(self.setup.model, &self.world);
        link.inputs.strain.clear();
        link.inputs.strain.resize(link.readers.len(), 0.0);
        let productions = &mut link.inputs.productions;
        productions.clear();
        productions.append(self.log.descent.get_or_insert_default());
        let Link { source, string, inputs, .. } = link;
        source.tick(string, inputs).map_err(|failure| self.failure(failure, link))?;
        let duration = self.schedule_tick(link, Some(now))?;
        let before = link.restarts;
        for i in 0..link.readers.len() {
            let (index, strain) = (link.inputs.readers[i], link.inputs.strain[i]);
            match self.bend(link.readers[i], strain, duration, now) {
                Some(bent) => link.restarts += u64::from(bent),
                None => {
                    let why = format!("the strain at the next tick is {}", brief(strain, 6));
                    return Err(self.failure(Failure::new(why).of(index), link));
                }
            }
        }
        if link.restarts > before { self.event_stage().iterate() } else { Ok(()) }
    }

    /// Gives a module the slope with which its strain reaches a value after a time; true if that is another slope than before, None if
    /// it is no number.
    fn bend(&mut self, id: ModuleId, strain: f64, duration: f64, now: SimTime) -> Option<bool> {
        let kind = self.world.tree.kind(id);
        let parameter = self.setup.model.kinds.get(kind).strain_parameter()?;
        let place = self.world.tree.places(id).start + parameter + 1;
        let slope = (strain - self.world.value(id, parameter, now)) / duration;
        if !slope.is_finite() || !strain.is_finite() {
            return None;
        }
        if slope == self.world.tree.values()[place] {
            return Some(false);
        }
        // The trajectory of the strain up to now has the slope before; it ends where the next one begins.
        self.world.tree.set_value(place, slope);
        let state = self.world.state(id);
        match state.and_then(|state| Some((state.rule?, state.context.clone()))) {
            Some((rule, context)) => self.event_stage().take_up(id, rule, &context),
            None => self.world.bend_at_rest(self.setup.model, id, now),
        }
        Some(true)
    }

    /// The error of surroundings that cannot go on.
    fn failure(&self, failure: Failure, link: &Link) -> Error {
        let now = self.instant.at;
        let modules = |index: usize| link.string.iter().enumerate().nth(index);
        let first = || link.string.iter().enumerate().find(|(_, module)| !module.kind.is_bracket());
        let mut site = site_of_axiom(now.to_f64());
        if let Some((index, module)) = failure.module.and_then(modules).or_else(first)
            && let Some(Visit::Module(id)) = self.world.tree.walk().nth(index)
        {
            let model = self.setup.model;
            let text = describe(model, module.kind, module.parameters);
            site = Site { module: text, ..self.world.site_of_module(model, id, now) };
        }
        site.span = failure.span.unwrap_or(site.span);
        Error::Surroundings { site, failure: Box::new(failure) }
    }
}

impl World {
    /// Begins the trajectory of the strain of a module that no rule with equations applies to, so that it goes on there, too.
    pub fn bend_at_rest(&mut self, model: &Model, id: ModuleId, now: SimTime) {
        let Some(parameter) = model.kinds.get(self.tree.kind(id)).strain_parameter() else { return };
        self.rebase(id, now);
        let values = self.tree.parameters(id);
        let (width, slope) = (values.len(), values[parameter + 1]);
        if self.state(id).is_none() {
            self.new_state(id);
        }
        let Some(state) = self.state_mut(id) else { return };
        state.since = now;
        state.trajectories.clear();
        state.trajectories.resize(width, Trajectory::Rest);
        state.trajectories[parameter] = Trajectory::Polynomial([slope, 0.0, 0.0, 0.0]);
    }
}
