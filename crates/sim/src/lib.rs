//! Development in time: the combined discrete and continuous scheduler.
//!
//! ```text
//!  schedule: the next event of each module ──event──▶ event: productions, selection of modes
//!     ▲                                                     │
//!     │                                                     ▼
//!  detect: the first event on a stretch ◀── flow: how each parameter moves from here on
//!                                             closed form │ own steps (independent) │ common steps (coupled)
//!  observe: every parameter's trajectory, evaluated and written out in string order
//! ```
//!
//! - `kernel`: [`Simulation`], its parts, and the loop over events. Begin here.
//! - `world`: the modules, their states and lives, contexts and neighbours.
//! - `schedule`: one order of time. `event`: event iteration at one instant.
//! - `flow`: from one instant to the next; `trajectory`: closed forms. `detect`: zero crossings, doubts, pulses.
//! - `surroundings`: what acts on the modules from outside, on a grid of time of its own.
//! - `observe`: frames and inspection; `access`: random access in time. `log`, `budget`, `memory`: records and limits.
//!
//! Imports point from `kernel` to `event` to `flow` to `detect` and `schedule` to `world`; a stage is handed the parts that
//! it works on and sees no others.
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

#![warn(missing_docs)]

mod access;
mod budget;
mod chain;
mod detect;
mod error;
mod event;
mod flow;
mod kernel;
mod log;
pub mod memory;
mod observe;
mod schedule;
mod scratch;
mod settings;
mod setup;
mod surroundings;
mod trajectory;
mod world;

pub use access::{Passed, happens_by};
pub use dlsys_ode::Method;
pub use error::{Error, Near, Site, Unsolved};
pub use event::MAX_ROUNDS;
pub use kernel::Simulation;
pub use log::{Event, ModuleState, Transition};
pub use observe::inspect::{InspectedModule, Inspection};
pub use settings::{BendMethod, BendSettings, GroundRule, Scheduler, Settings, Stats};
pub use surroundings::{Failure, Force, Inputs, Surroundings};
pub use world::{brief, describe};
