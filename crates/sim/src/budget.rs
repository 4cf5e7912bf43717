//! The limits of a run: productions and steps, seconds, memory. A run that would not end stops with a message.
//!
//! A life of 1e-18, an event at rate 1e300 or a step of 1e-300 never ends, and no count of modules grows. So time is
//! watched, too: where at the pace of the last hundred thousand things, and of those before, a run would take a hundred
//! times the limit, it is stopped at once. A structure of many modules may have many events at one time: the measure is many
//! things for each module. Results do not depend on any of this, unless it is exceeded.

use std::time::{Duration, Instant as Wall};

use crate::Settings;
use crate::error::{Error, Site};
use crate::memory::{self, Shortage};
use crate::setup::Setup;
use crate::world::World;
use crate::world::state::State;
use dlsys_model::KindId;
use dlsys_tree::{SimTime, room};

/// Productions and steps after which the pace is looked at: so many at least, and so many for each module.
const LOOK: u64 = 100_000;
const LOOK_PER_MODULE: u64 = 25;
/// Looks in a row that must find the run too slow, none much better than the first.
const LOOKS: u32 = 4;
const BETTER: f64 = 2.0;
/// A run is stopped if it is foreseen to need so many times its limit.
const FAR_TOO_MANY: f64 = 100.0;

/// Bytes a module in the lists of one instant, and in a string that is observed.
const IN_LISTS: u64 = 64;
const IN_STRING: u64 = 160;

/// The work and the time spent so far.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// The count of productions and steps at which to look next.
    next: u64,
    /// The count at the last look, and the time then.
    done: u64,
    mark: SimTime,
    /// Looks in a row that have found the run far too slow, and by how much the first.
    slow: u32,
    first: f64,
    /// Wall time of earlier calls, and when the present one began.
    spent: Duration,
    since: Option<Wall>,
}

/// A limit that was exceeded.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    Events(u64),
    Seconds(f64),
}

impl Limit {
    pub fn error(self, site: Site) -> Error {
        match self {
            Limit::Events(limit) => Error::TooManyEvents { site, limit, foreseen: None },
            Limit::Seconds(limit) => Error::OutOfTime { site, limit },
        }
    }
}

impl Budget {
    /// Begins to count seconds, if they are limited.
    pub fn start_clock(&mut self, settings: &Settings) {
        self.since = settings.max_seconds.is_finite().then(Wall::now);
    }

    /// Stops counting seconds.
    pub fn stop_clock(&mut self) {
        if let Some(since) = self.since.take() {
            self.spent += since.elapsed();
        }
    }

    fn is_overtime(&self, settings: &Settings) -> bool {
        let Some(since) = self.since else { return false };
        (self.spent + since.elapsed()).as_secs_f64() > settings.max_seconds
    }

    /// True if it is time to look at the pace, after so many productions and steps.
    #[inline]
    pub fn is_due(&self, done: u64) -> bool {
        done >= self.next || self.since.is_some()
    }

    /// Productions that may follow, after so many productions and steps, before it is time to look again.
    pub fn left(&self, settings: &Settings, done: u64) -> u64 {
        if self.is_overtime(settings) { 0 } else { self.next.saturating_sub(done) }
    }

    /// Checks that the next entry of the schedule may still be passed, on the way to some time.
    ///
    /// # Errors
    /// If a limit is exceeded, or is foreseen to be exceeded by far; `site` names the next module.
    #[cold]
    pub fn check(
        &mut self,
        settings: &Settings,
        done: u64,
        modules: usize,
        (at, until): (SimTime, SimTime),
        site: impl FnOnce() -> Site,
    ) -> Result<(), Error> {
        if self.is_overtime(settings) {
            return Err(Error::OutOfTime { site: site(), limit: settings.max_seconds });
        }
        let limit = settings.max_events;
        if done < self.next {
            return Ok(());
        }
        if done >= limit {
            return Err(Error::TooManyEvents { site: site(), limit, foreseen: None });
        }
        let (some, time) = (done - self.done, at.since(self.mark));
        let until = SimTime::new(until.to_f64().max(settings.horizon));
        let foreseen = some as f64 * (until.since(at).max(0.0) / time.max(0.0));
        if until.to_f64().is_finite() && self.next > 0 && foreseen > FAR_TOO_MANY * limit as f64 {
            if self.slow == 0 || time > BETTER * self.first {
                (self.slow, self.first) = (0, time);
            }
            self.slow += 1;
            if self.slow >= LOOKS {
                let foreseen = Some(Box::new((foreseen, until.to_f64())));
                return Err(Error::TooManyEvents { site: site(), limit, foreseen });
            }
        } else {
            self.slow = 0;
        }
        (self.done, self.mark) = (done, at);
        let window = LOOK.max(LOOK_PER_MODULE * modules as u64);
        self.next = (done + window).min(limit);
        Ok(())
    }

    /// The limit that is exceeded within an instant, after a round of productions.
    pub fn exceeded(&self, settings: &Settings, events: u64) -> Option<Limit> {
        match events > settings.max_events {
            true => Some(Limit::Events(settings.max_events)),
            false => self.is_overtime(settings).then_some(Limit::Seconds(settings.max_seconds)),
        }
    }
}

/// Asks for memory before it is needed; `site` names a module that needs it.
///
/// # Errors
/// If it is not there.
pub fn afford(setup: &Setup, world: &World, bytes: u64, site: impl FnOnce() -> Site) -> Result<(), Error> {
    memory::ask(bytes, setup.settings.max_memory, world.tree.size() as u64)
        .map_err(|shortage| out_of_memory(world, shortage, site()))
}

/// Asks for the lists that so many productions of one instant take; `steps` if a derivation step is among them.
///
/// # Errors
/// As of [`afford`].
pub fn afford_round(
    setup: &Setup,
    world: &World,
    productions: usize,
    steps: bool,
    site: impl FnOnce() -> Site,
) -> Result<(), Error> {
    let bytes = productions as u64 * (IN_LISTS + if steps { 2 * IN_LISTS } else { 0 });
    // Lists are there twice while they grow.
    afford(setup, world, 3 * bytes, site)
}

/// Asks for the memory that the string of the structure takes.
///
/// # Errors
/// As of [`afford`].
pub fn afford_string(setup: &Setup, world: &World, site: impl FnOnce() -> Site) -> Result<(), Error> {
    let (nodes, values) = world.tree.extent();
    afford(setup, world, nodes as u64 * IN_STRING + 16 * values as u64, site)
}

/// The error of memory that is not there.
pub fn out_of_memory(world: &World, shortage: Shortage, site: Site) -> Error {
    Error::OutOfMemory { modules: world.tree.len(), shortage: Box::new(shortage), site }
}

/// Makes room for modules of these kinds, with so many parameters. Where lists must grow for that ([`room`]), everything that is kept of modules grows with them:
/// that is asked for at once.
///
/// # Errors
/// If the memory is not there.
#[inline]
pub fn room_for(
    setup: &Setup,
    world: &mut World,
    coupled: usize,
    (kinds, width): (&[KindId], usize),
) -> Result<(), Shortage> {
    match world.tree.has_room(kinds, width) {
        true => Ok(()),
        false => grow(setup, world, coupled, (kinds, width)),
    }
}

#[cold]
fn grow(
    setup: &Setup,
    world: &mut World,
    coupled: usize,
    (kinds, width): (&[KindId], usize),
) -> Result<(), Shortage> {
    let (slots, known) = (world.tree.slots().max(1), world.tree.size() as u64);
    let more = kinds.len().max(room::step(slots)) as f64 / slots as f64;
    let grown = size(setup, world, coupled) as u64 + IN_LISTS * slots as u64;
    // A list may be there twice while it grows.
    let wanted = (more * grown as f64) as u64 + known;
    memory::ask(wanted, setup.settings.max_memory, known)?;
    let grown = world.tree.make_room(kinds, width);
    grown.map_err(|_| Shortage { wanted, there: None, own_limit: false })
}

/// Bytes that a copy of a simulation takes, about; `coupled` is the number of coupled modules.
pub fn size(setup: &Setup, world: &World, coupled: usize) -> usize {
    /// The cost of a coupled component: its equations, a step, the working memory of the method.
    const COMPONENT: usize = 400;
    /// Of more slots than this, one of so many is looked at.
    const MANY: usize = 4096;
    const SOME: usize = 16;
    let numeric = |state: &State| state.trajectories.step().map_or(0, |step| size_of_val(step) + 400);
    // Most are not in the caches, and some tell what all are like.
    let every = if world.states.slots() > MANY { SOME } else { 1 };
    let some = world.states.iter().step_by(every);
    let states = every * some.map(|s| size_of::<State>() + 100 + numeric(s)).sum::<usize>();
    let known = if setup.looks_around { 100 } else { 0 };
    let events = 12 * world.tree.len();
    world.tree.size()
        + events
        + states
        + COMPONENT * coupled
        + known * world.tree.slots()
        + 8 * world.states.slots()
}
