//! Event iteration: the productions and changes of equations of one instant, until nothing changes any more.
//!
//! ```text
//! look up rules and contexts ─▶ judge at the instant ─▶ apply productions in parallel ─┐
//!   (lookup, matching)            (iterate)     │         (apply, lazy, derivation)     │
//!        ▲                                      │ nothing holds                         │
//!        └──────────────────────────────────────┼───────────────────────────────────────┘
//!                                               ▼
//!            select modes ─▶ where do the zero signs go? ─▶ judge just after ─▶ start flows
//!              (modes)
//! ```
//!
//! All modules whose conditions hold are replaced in parallel, on the values before any was replaced; then the string is
//! examined again at the same instant, until nothing holds. Only the modules that the instant concerns are *open*; all
//! others go on as they were.

mod after;
mod apply;
mod behind;
pub mod chance;
mod consistency;
mod cut;
pub mod derivation;
mod exact;
mod heading;
mod iterate;
mod lazy;
mod levels;
mod lookup;
mod matching;
mod meeting;
mod modes;
mod opening;
mod ties;
pub mod transition;

use crate::budget::Budget;
use crate::detect::Detector;
use crate::flow::{FlowStage, Flows, lazy as lives};
use crate::log::Log;
use crate::schedule::{NextEvent, Schedule};
use crate::scratch::Scratch;
use crate::setup::Setup;
use crate::world::neighbours::Neighbours;
use crate::world::new_modules::NewModules;
use crate::world::{Instant, World};
use derivation::Steps;
use dlsys_tree::{Family, ModuleId};
use transition::Recorder;

pub use iterate::MAX_ROUNDS;

/// A life of no more than so many resolutions of time is short.
pub const SHORT_LIFE: f64 = 64.0;

/// A production that applies.
#[derive(Clone, Debug)]
pub struct Firing {
    pub id: ModuleId,
    pub rule: usize,
    pub produce: usize,
    /// Something jumps in it, and it holds just after the instant but not at it: see [`after`].
    pub after: bool,
}

impl Firing {
    /// A production that holds at the instant.
    pub fn at(id: ModuleId, rule: usize, produce: usize) -> Firing {
        Firing { id, rule, produce, after: false }
    }
}

/// The modules that an instant concerns, and the work that is left to do at it.
#[derive(Clone, Debug, Default)]
pub struct Events {
    /// Modules that the instant concerns.
    pub opened: Vec<ModuleId>,
    /// Modules that it concerns, and that have their equations already.
    ready: Vec<ModuleId>,
    /// Modules that were made at the instant and have not been looked up yet.
    pub fresh: Vec<ModuleId>,
    /// The structure has changed since contexts were matched.
    changed: bool,
    /// Modules whose neighbours have changed.
    to_look: Vec<ModuleId>,
    /// The remembered neighbours may be wrong.
    lost: bool,
    /// The one module that was replaced since contexts were matched, and the one of the same kind in its place; None if
    /// that is not all that has changed.
    heir: Option<(ModuleId, ModuleId)>,
    /// Modules that rest on a boundary and have a context: their neighbours may move it.
    resting: Vec<ModuleId>,
    /// Discrete rules.
    pub steps: Steps,
    /// Equations chosen anew, so far.
    choices: usize,
    /// Parameters that meet levels at the instant, of modules that others look at: the module, the number of the parameter, the level.
    met: Vec<(ModuleId, usize, f64)>,
    /// Modules that were opened for an event which does not take place by the numbers of now.
    void: Vec<ModuleId>,
    /// Algebraic values of modules that were replaced at the instant, as they were followed.
    replaced_values: Vec<f64>,
    /// What jumps at the instant has jumped: a production has been applied that holds just after it only.
    is_after: bool,
    /// Productions that are known to apply.
    pub firing: Vec<Firing>,
    /// Slots of lazy modules whose event it is.
    pub firing_lazy: Vec<u32>,
    /// Times that algebraic values have changed at the present instant.
    consistency_rounds: usize,
    recorder: Option<Recorder>,
    // Memory that is used again and again.
    pub batch: Vec<NextEvent>,
    made: Vec<ModuleId>,
    attached: Vec<ModuleId>,
    new_modules: NewModules,
    /// Of each production: where its kinds and arguments end, which successor it has, and the lineage of that.
    module_ends: Vec<([usize; 2], usize, Family)>,
}

impl Events {
    pub fn new(setup: &Setup) -> Events {
        let settings = &setup.settings;
        Events {
            steps: Steps::new(setup.model),
            changed: true,
            recorder: (settings.log && settings.transitions).then(Recorder::default),
            ..Events::default()
        }
    }

    /// True if the instant concerns no module.
    pub fn is_idle(&self) -> bool {
        self.opened.is_empty() && self.firing.is_empty() && self.firing_lazy.is_empty() && !self.steps.due
    }
}

/// The parts that event iteration works on.
pub struct EventStage<'s, 'm> {
    pub setup: &'s Setup<'m>,
    pub instant: &'s mut Instant,
    pub world: &'s mut World,
    pub neighbours: &'s mut Neighbours,
    pub schedule: &'s mut Schedule,
    pub flows: &'s mut Flows,
    pub detector: &'s mut Detector,
    pub events: &'s mut Events,
    pub log: &'s mut Log,
    pub budget: &'s Budget,
    pub scratch: &'s mut Scratch,
}

impl<'m> EventStage<'_, 'm> {
    /// The parts that flows work on.
    fn flow(&mut self) -> FlowStage<'_, 'm> {
        FlowStage {
            setup: self.setup,
            instant: self.instant,
            world: self.world,
            neighbours: self.neighbours,
            schedule: self.schedule,
            flows: self.flows,
            detector: self.detector,
            log: self.log,
            scratch: self.scratch,
        }
    }

    /// Gives a lazy module the state that it would have, had it never been lazy.
    fn materialise(&mut self, id: ModuleId) {
        lives::materialise(self.world, &self.setup.model.rules, id, self.instant, self.scratch);
    }
}
