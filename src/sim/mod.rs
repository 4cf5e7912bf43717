//! Development in time: the combined discrete and continuous scheduler.
//!
//! ```text
//!          ┌─────────── make_step: integrate, search the step ───────────┐
//!          ▼                                                             │
//! [System: equations of all modules] ──event──▶ settle: productions ─────┤
//!          │                                                             │
//!          └──no event──▶ next step ─────────────────────────────────────┘
//!                    at(t): the dense output, written out in string order
//! ```
//!
//! - `simulation`: the clock; what a caller uses is [`Simulation`].
//! - `settle`: what happens at one instant; `lookup`: rules and contexts.
//! - `system`: the equations between two instants.
//! - `runge_kutta`, `dense`: one step, and the solution inside it.
//! - `watch`, `roots`: the search of a step for the first event.
//!
//! Equations are integrated as if their `if`s did not exist: within a step every condition inside them is
//! frozen, and its change is an event that cuts the step. So the methods keep their order at the end of a
//! growth function, and a discontinuous rate costs no accuracy.

mod dense;
mod error;
mod event;
mod lookup;
mod roots;
mod runge_kutta;
mod settle;
mod simulation;
mod system;
mod watch;

pub use error::{Error, Site};
pub use event::Event;
pub use settle::MAX_ROUNDS;
pub use simulation::{Simulation, brief, describe};

/// How equations are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The exact solution where there is one, otherwise the method that suits the equations.
    Auto,
    /// Forward Euler with a fixed step: order 1. What the paper's authors used (section 8).
    Euler,
    /// The classical Runge-Kutta method with a fixed step: order 4.
    Rk4,
    /// Dormand and Prince's pair of orders 5 and 4 with step control.
    Dopri5,
}

impl Method {
    /// Methods by the names they have on the command line.
    pub const NAMED: [(&'static str, Method); 4] = [
        ("auto", Method::Auto),
        ("dopri5", Method::Dopri5),
        ("rk4", Method::Rk4),
        ("euler", Method::Euler),
    ];

    /// True if the method needs a step size and ignores the tolerance.
    pub fn is_fixed_step(self) -> bool {
        matches!(self, Method::Euler | Method::Rk4)
    }
}

/// How a simulation is run.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub method: Method,
    /// Error aimed at in every parameter at every time, relative to max(1, |value|).
    pub tolerance: f64,
    /// Step of the methods that have a fixed one, in units of time. Steps end at its multiples.
    pub step_size: f64,
    /// More modules than this are an error.
    pub max_modules: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { method: Method::Auto, tolerance: 1e-6, step_size: 0.01, max_modules: 10_000_000 }
    }
}

impl Settings {
    /// The grid on which steps of fixed size end.
    fn grid(&self) -> Option<f64> {
        self.method.is_fixed_step().then_some(self.step_size)
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
    /// Evaluations of the equations of the whole structure.
    pub rhs_evaluations: u64,
    /// Modules alive, brackets not counted.
    pub modules: u64,
    /// Most modules that were alive at once.
    pub peak_modules: u64,
}
