//! Development in time: the combined discrete and continuous scheduler.
//!
//! ```text
//!  queue: what comes next, per module ──event──▶ settle: productions, choice of equations
//!     ▲                                                    │
//!     │                                                    ▼
//!  watch: the first event on a stretch ◀── phase: how each parameter moves from here on
//!                                            formula │ own steps (local) │ common steps (coupled)
//!  at(t): every parameter's motion, evaluated and written out in string order
//! ```
//!
//! - `simulation`: the clock; what a caller uses is [`Simulation`]. `queue`: the order of time.
//! - `settle`, `choose`, `lookup`: what happens at one instant.
//! - `phase`: from an instant to the next; `motion`: formulas; `local`, `coupled`, `system`, `linear`:
//!   numeric integration.
//! - `access`: going to and fro; `inspect`: all that is known of one module.
//! - `plant`, `state`: the modules and how they move; `watch`, `doubt`: the search for events.
//! - `integrator`: step control; the steps themselves are in [`dlsys_ode`].
//!
//! A parameter whose equation has a formula is evaluated, never stepped, and a module that reads none of its
//! neighbours keeps a clock of its own. Equations are integrated as if their `if`s did not exist: within a step every
//! condition inside them is frozen, and its change is an event. So the methods keep their order at the end of a
//! growth function, and a discontinuous rate costs no accuracy.
//!
//! # Examples
//!
//! The productions of a cell that grows by the logistic equation and divides at half its limit:
//!
//! ```
//! use dlsys_session::Session;
//! use dlsys_sim::Settings;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "initial string: C(0.25)\nC(x): if x < 0.5 solve dx/dt = x*(1 - x)\n if x = 0.5 produce C(x/2) C(x/2)";
//! let session = Session::from_text("cells.dls", text, &[])?;
//! let settings = Settings { tolerance: 1e-9, log: true, ..Settings::default() };
//! let mut simulation = session.simulate(settings)?;
//! let mut string = Default::default();
//! simulation.at(3.0, &mut string)?;
//! let events = simulation.take_events();
//! // The logistic goes from 1/4 to 1/2 in ln 3 units of time.
//! assert_eq!((events.len(), string.len()), (3, 4));
//! assert!((events[0].time - 3f64.ln()).abs() < 1e-9 && (events[2].time - 9f64.ln()).abs() < 1e-9);
//! # Ok(())
//! # }
//! ```
//!
//! The error of a run names the place and a remedy:
//!
//! ```
//! # use dlsys_session::Session;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "initial string: C(1)\nC(x): if x < 2 solve dx/dt = 1";
//! let session = Session::from_text("cell.dls", text, &[])?;
//! let mut simulation = session.simulate(Default::default())?;
//! if let Err(error) = simulation.at(5.0, &mut Default::default()) {
//!     let message = error.diagnostic().render(&session.source, false);
//!     assert!(message.starts_with("error: C(2) left its domain at t = 1"));
//!     assert!(message.contains("`if x = 2 produce C_end(x)`"));
//! }
//! # Ok(())
//! # }
//! ```

mod access;
mod agenda;
mod algebra;
mod around;
mod blend;
mod budget;
mod career;
mod chance;
mod choose;
mod columns;
mod consistent;
mod couple;
mod coupled;
mod course;
mod cut;
mod derive;
mod doubt;
mod equations;
mod error;
mod event;
mod exact;
mod fetch;
mod flash;
mod gather;
mod inspect;
mod integrator;
mod known_rates;
mod light;
mod linear;
mod local;
mod lookup;
pub mod memory;
mod motion;
mod neighbours;
mod observe;
mod passing;
mod phase;
mod plant;
mod queue;
mod quick;
mod repair;
mod settle;
mod signs;
mod simulation;
mod state;
mod system;
mod transition;
mod watch;

pub use access::{Passed, happens_by};
pub use dlsys_ode::Method;
pub use error::{Error, Near, Site, Unsolved};
pub use event::Event;
pub use inspect::{Inspection, Seen};
pub use settle::MAX_ROUNDS;
pub use simulation::{Simulation, brief, describe};
pub use transition::{Stand, Transition};

/// Rates of events that have no formula are integrated with at most this tolerance, so that their times are the same to
/// nine digits whatever the tolerance is.
const CLOCK_TOLERANCE: f64 = 1e-11;

/// Who is solved again after an event, among modules that are integrated together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scheduler {
    /// As many of the neighbours as the tolerance asks for.
    #[default]
    Auto,
    /// All: one clock, and time is cut at every event. The reference.
    Global,
    /// Nobody: equations see their neighbours as they were at the start of the slice of time, or at the module's last
    /// event in it. The approximation that the paper makes for speed (section 5); its error is of the order of the
    /// slice.
    Local {
        /// Length of a slice, in units of time; slices end at its multiples.
        slice: f64,
    },
}

/// How a simulation is run.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub method: Method,
    pub scheduler: Scheduler,
    /// Error aimed at in every parameter at every time, relative to max(1, |value|).
    pub tolerance: f64,
    /// Step of the methods that have a fixed one, in units of time. Steps end at its multiples.
    pub step_size: f64,
    /// What random numbers follow from.
    pub seed: u64,
    /// More modules than this are an error.
    pub max_modules: usize,
    /// More productions and steps than this are an error; so is a run that is foreseen to need a hundred times as many, at
    /// a pace that hardly brings time on.
    pub max_events: u64,
    /// More seconds than this, spent in calls of the simulation, are an error. Infinite by default.
    pub max_seconds: f64,
    /// More bytes of memory than this, of the process as a whole where the system tells them, are an error. By
    /// default only what the system has not got.
    pub max_memory: u64,
    /// Productions are recorded for [`Simulation::take_events`].
    pub log: bool,
    /// Everything is done the general way; for tests of the quick one.
    #[doc(hidden)]
    pub slow: bool,
    /// With `log`: what each production changes is recorded, too ([`Event::transition`]). Every event then costs work
    /// for all modules whose rules have a context.
    pub transitions: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            method: Method::Auto,
            scheduler: Scheduler::Auto,
            tolerance: 1e-6,
            step_size: 0.01,
            seed: 0,
            max_modules: Settings::MODULES,
            max_events: Settings::EVENTS,
            max_seconds: f64::INFINITY,
            max_memory: u64::MAX,
            log: false,
            slow: false,
            transitions: false,
        }
    }
}

impl Settings {
    /// What a run may take unless something else is said: so much that only what runs away takes more.
    pub const MODULES: usize = 10_000_000;
    pub const EVENTS: u64 = 10_000_000_000;

    /// The grid on which steps of fixed size end.
    fn grid(&self) -> Option<f64> {
        self.method.is_fixed_step().then_some(self.step_size)
    }

    /// For equations that decide by chance: there is no tolerance in when an event happens that has no time of its own.
    fn for_clocks(&self, has_clocks: bool) -> Settings {
        match has_clocks {
            true => Settings { tolerance: self.tolerance.min(CLOCK_TOLERANCE), ..*self },
            false => *self,
        }
    }

    /// True if neighbours are seen as they were at the start of a slice of time.
    fn is_sliced(&self) -> bool {
        matches!(self.scheduler, Scheduler::Local { .. })
    }

    /// The end of the slice of time after an instant, if there are slices.
    fn slice_end(&self, after: dlsys_tree::SimTime) -> Option<dlsys_tree::SimTime> {
        match self.scheduler {
            Scheduler::Local { slice } => {
                Some(dlsys_tree::SimTime::new(integrator::next_grid_time(after, slice)))
            }
            _ => None,
        }
    }
}

/// Work done by a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Stats {
    /// Productions applied.
    pub events: u64,
    /// Steps accepted.
    pub steps: u64,
    /// Steps tried again with a smaller size.
    pub rejected: u64,
    /// Evaluations of the equations of one module.
    pub rhs_evaluations: u64,
    /// Modules alive, brackets not counted.
    pub modules: u64,
    /// Most modules that were alive at once.
    pub peak_modules: u64,
    /// Rules whose rates could not be bounded somewhere: [`Simulation::remarks`].
    pub unbounded: u64,
}
