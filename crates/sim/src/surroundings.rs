//! Surroundings: what acts on the modules from outside, on a grid of time of its own, as the bending of stems does.
//!
//! At each tick the surroundings get the string and give, for each module that reads `strain`, a force or the ground, the values up to the next tick. From
//! tick to tick they are linear in time: a strain from its present value on, so it is continuous; a force from a new one. To all stages each is a parameter
//! that moves at a constant rate: the tick changes the slope, and the modules concerned begin new trajectories, as they do when a neighbour changes.
//!
//! A tick is an entry of the schedule, after all others of its instant. So neither frames nor threads can change its time, the
//! string that it sees, or anything that follows from it.

use crate::budget;
use crate::error::{Error, Site};
use crate::kernel::Simulation;
use crate::log::Event;
use crate::memory::{self, TICKS_OF_MEMORY};
use crate::schedule::Owner;
use crate::trajectory::Trajectory;
use crate::world::{World, describe, site_of_axiom};
use crate::{Settings, brief};
use dlsys_diagnostic::Span;
use dlsys_model::{Model, Quantity};
use dlsys_tree::{Module, ModuleId, ModuleString, SimTime, Version, Visit};
use smallvec::SmallVec;

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
    fn boxed_clone<'a>(&self) -> Box<dyn Surroundings + 'a>
    where
        Self: 'a;

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
    forces: Vec<Force>,
    ground: f64,
    productions: Vec<Event>,
}

/// A force from a tick to the next one, in units of the model: kg·length/time². For each axis its value after the tick and that before the next one; in
/// between it is linear in time.
pub type Force = [[f64; 2]; 3];

impl Inputs {
    /// The indices in the string of the modules that read what the surroundings give, in ascending order.
    pub fn readers(&self) -> &[usize] {
        &self.readers
    }

    /// The strain of each reader at the next tick, without unit, in the order of [`Inputs::readers`]. They are 0 at first: the strain
    /// of a module that draws no stem.
    pub fn strain_mut(&mut self) -> &mut [f64] {
        &mut self.strain
    }

    /// The force on the solid of each reader, in the order of [`Inputs::readers`]. They are 0 at first.
    pub fn forces_mut(&mut self) -> &mut [Force] {
        &mut self.forces
    }

    /// Sets the number of the heights of the ground that hold from now on; 0 is the ground at the beginning.
    pub fn set_ground(&mut self, number: f64) {
        self.ground = number;
    }

    /// The productions since the last tick, or since t = 0, in the order of time.
    pub fn productions(&self) -> &[Event] {
        &self.productions
    }

    /// Sets the force of each reader to a function of the module.
    pub fn set_forces(&mut self, string: &ModuleString, mut force: impl FnMut(Module<'_>) -> Force) {
        for (value, &index) in self.forces.iter_mut().zip(&self.readers) {
            *value = force(string.get(index));
        }
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

/// The modules that read what the surroundings give, and what they are given.
#[derive(Default)]
struct Readers {
    string: ModuleString,
    inputs: Inputs,
    /// In string order, in the structure of some version.
    modules: Vec<ModuleId>,
    version: Option<Version>,
}

impl Readers {
    /// Finds the modules, if the structure has changed.
    fn find(&mut self, model: &Model, world: &World) {
        if self.version.is_none() || self.version != self.string.version() {
            self.version = self.string.version();
            self.modules.clear();
            self.inputs.readers.clear();
            for (index, visit) in world.tree.walk().enumerate() {
                let Visit::Module(id) = visit else { continue };
                if model.kinds.get(world.tree.kind(id)).read_inputs().next().is_some() {
                    self.modules.push(id);
                    self.inputs.readers.push(index);
                }
            }
        }
        self.inputs.strain.clear();
        self.inputs.strain.resize(self.modules.len(), 0.0);
        self.inputs.forces.clear();
        self.inputs.forces.resize(self.modules.len(), Force::default());
    }
}

/// The surroundings of a simulation, with the memory for the string that they get.
pub(super) struct Link<'m> {
    source: Box<dyn Surroundings + 'm>,
    readers: Readers,
    /// How often a module has begun new trajectories because of a tick.
    restarts: u64,
    /// Ticks so far.
    ticks: u64,
}

impl<'m> Link<'m> {
    fn new(source: Box<dyn Surroundings + 'm>) -> Link<'m> {
        Link { source, readers: Readers::default(), restarts: 0, ticks: 0 }
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
}

/// The string of a copy is empty: it is formed anew at the next tick.
impl<'m> Clone for Link<'m> {
    fn clone(&self) -> Link<'m> {
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
        surroundings: Box<dyn Surroundings + 'm>,
    ) -> Result<Simulation<'m>, Error> {
        let mut simulation = Simulation::new(model, settings)?;
        if model.reads_inputs() {
            let link = Link::new(surroundings);
            simulation.schedule_tick(&link, None)?;
            simulation.surroundings = Some(Box::new(link));
            simulation.log.descent = Some(Vec::new());
        }
        Ok(simulation)
    }

    /// Gives values to all modules that read what surroundings give, at a time up to which the simulation has [passed](Simulation::pass), as a tick does: they
    /// hold for a `duration`, and go on with their slopes after it. For simulations without surroundings.
    ///
    /// # Errors
    /// A value that is not finite, and those of what happens then: conditions may begin to hold.
    pub fn give(
        &mut self,
        (time, duration): (f64, f64),
        give: impl FnOnce(&ModuleString, &mut Inputs),
    ) -> Result<(), Error> {
        self.guarded(|simulation| {
            let mut readers = Readers::default();
            let now = simulation.begin_tick(SimTime::new(time));
            simulation.show_to(&mut readers, now)?;
            give(&readers.string, &mut readers.inputs);
            simulation.hand(&readers, duration, now).map(|_| ())
        })
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
            return Err(self.failure(Failure::new(why), &link.readers));
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
        let now = self.begin_tick(at);
        self.show_to(&mut link.readers, now)?;
        let Link { source, readers, .. } = link;
        let productions = &mut readers.inputs.productions;
        productions.clear();
        productions.append(self.log.descent.get_or_insert_default());
        let given = source.tick(&readers.string, &mut readers.inputs);
        given.map_err(|failure| self.failure(failure, readers))?;
        if link.ticks.is_multiple_of(TICKS_OF_MEMORY) {
            memory::ask_for_a_little(self.setup.settings.max_memory).map_err(|shortage| {
                budget::out_of_memory(&self.world, shortage, self.site_of_shown(None, &link.readers))
            })?;
        }
        link.ticks += 1;
        let duration = self.schedule_tick(link, Some(now))?;
        link.restarts += self.hand(&link.readers, duration, now)?;
        Ok(())
    }

    /// The instant of a tick: an event within the resolution of time of it may have taken place a little after it.
    fn begin_tick(&mut self, at: SimTime) -> SimTime {
        if at.since(self.instant.at) > 0.0 {
            self.instant.at = at;
        }
        self.instant.at
    }

    /// Writes the string for surroundings, and finds the modules that read what they give.
    fn show_to(&mut self, readers: &mut Readers, now: SimTime) -> Result<(), Error> {
        self.flow_stage().show_coupled(now);
        self.observe(now.to_f64(), now, &mut readers.string)?;
        readers.find(self.setup.model, &self.world);
        Ok(())
    }

    /// Lets modules go on with what they are given for a duration; returns how many of them begin new trajectories.
    fn hand(&mut self, readers: &Readers, duration: f64, now: SimTime) -> Result<u64, Error> {
        let mut restarts = 0;
        self.world.ground = readers.inputs.ground;
        for (i, &id) in readers.modules.iter().enumerate() {
            let (strain, force) = (readers.inputs.strain[i], readers.inputs.forces[i]);
            match self.take_inputs(id, (strain, force, readers.inputs.ground), duration, now) {
                Ok(restarted) => restarts += u64::from(restarted),
                Err(quantity) => {
                    let why = match quantity {
                        Quantity::Strain => format!("the strain at the next tick is {}", brief(strain, 6)),
                        Quantity::Force(axis) => {
                            let [from, to] = force[axis].map(|value| brief(value, 6));
                            format!("`{}` goes from {from} to {to}", quantity.name())
                        }
                        Quantity::Ground => "the ground has no height".to_owned(),
                    };
                    let failure = Failure::new(why).of(readers.inputs.readers[i]);
                    return Err(self.failure(failure, readers));
                }
            }
        }
        if restarts > 0 {
            self.event_stage().iterate()?;
        }
        Ok(restarts)
    }

    /// Gives a module the values and slopes with which its quantities go on; true if any is another than before, and a quantity if that is no number.
    fn take_inputs(
        &mut self,
        id: ModuleId,
        (strain, force, ground): (f64, Force, f64),
        duration: f64,
        now: SimTime,
    ) -> Result<bool, Quantity> {
        let model = self.setup.model;
        let start = self.world.tree.places(id).start;
        let mut given: SmallVec<[(usize, f64); 8]> = SmallVec::new();
        for (quantity, parameter) in model.kinds.get(self.world.tree.kind(id)).read_inputs() {
            let present = self.world.value(id, parameter, now);
            let [value, end] = match quantity {
                Quantity::Strain => [present, strain],
                Quantity::Force(axis) => force[axis],
                Quantity::Ground => [ground, ground],
            };
            let slope = if value == end { 0.0 } else { (end - value) / duration };
            if !slope.is_finite() || !end.is_finite() {
                return Err(quantity);
            }
            if value != present {
                given.push((parameter, value));
            }
            if slope != self.world.tree.values()[start + parameter + 1] {
                given.push((parameter + 1, slope));
            }
        }
        if given.is_empty() {
            return Ok(false);
        }
        // The trajectories up to now have the slopes before; they end where the next ones begin.
        let state = self.world.state(id);
        match state.and_then(|state| Some((state.rule.get()?, state.context.clone()))) {
            Some((rule, context)) => self.event_stage().take_up_with(id, rule, &context, &given),
            None => {
                self.world.rebase_with(id, now, &given);
                self.world.let_inputs_go_on(model, id, now);
            }
        }
        Ok(true)
    }

    /// The place of a module of the string that the surroundings were shown, or of the first one.
    fn site_of_shown(&self, index: Option<usize>, readers: &Readers) -> Site {
        let now = self.instant.at;
        let modules = |index: usize| readers.string.iter().enumerate().nth(index);
        let first = || readers.string.iter().enumerate().find(|(_, module)| !module.kind.is_bracket());
        if let Some((index, module)) = index.and_then(modules).or_else(first)
            && let Some(Visit::Module(id)) = self.world.tree.walk().nth(index)
        {
            let model = self.setup.model;
            let text = describe(model, module.kind, module.parameters);
            return Site { module: text, ..self.world.site_of_module(model, id, now) };
        }
        site_of_axiom(now.to_f64())
    }

    /// The error of surroundings that cannot go on.
    fn failure(&self, failure: Failure, readers: &Readers) -> Error {
        let mut site = self.site_of_shown(failure.module, readers);
        site.span = failure.span.unwrap_or(site.span);
        Error::Surroundings { site, failure: Box::new(failure) }
    }
}

impl World {
    /// As [`World::rebase`], with values that are given.
    pub fn rebase_with(&mut self, id: ModuleId, now: SimTime, given: &[(usize, f64)]) {
        self.rebase(id, now);
        self.give(id, given);
    }

    /// Gives some parameters of a module without trajectories new values.
    pub fn give(&mut self, id: ModuleId, given: &[(usize, f64)]) {
        for (parameter, value) in given {
            self.tree.set_value(self.tree.places(id).start + parameter, *value);
        }
    }

    /// Gives a new module the present state of the ground, if it reads the ground.
    pub fn put_on_ground(&mut self, model: &Model, id: ModuleId) {
        if let Some(parameter) = model.kinds.get(self.tree.kind(id)).input_parameter(Quantity::Ground) {
            let start = self.tree.places(id).start;
            self.tree.set_value(start + parameter, self.ground);
        }
    }

    /// Begins the trajectories of what the surroundings give to a module that no rule with equations applies to, so that it goes on there, too.
    pub fn let_inputs_go_on(&mut self, model: &Model, id: ModuleId, now: SimTime) {
        let kind = model.kinds.get(self.tree.kind(id));
        if kind.read_inputs().next().is_none() {
            return;
        }
        self.rebase(id, now);
        let values = self.tree.parameters(id);
        let mut trajectories = vec![Trajectory::Rest; values.len()];
        for (_, parameter) in kind.read_inputs() {
            trajectories[parameter] = Trajectory::Polynomial([values[parameter + 1], 0.0, 0.0, 0.0]);
        }
        if self.state(id).is_none() {
            self.new_state(id);
        }
        let Some(state) = self.state_mut(id) else { return };
        (state.since, state.horizon) = (now, f64::NAN);
        state.trajectories.assign(trajectories.into_iter());
    }
}
