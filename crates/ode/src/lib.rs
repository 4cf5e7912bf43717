//! Initial value problems for ordinary differential equations: steps of controlled error, the solution inside each step, and the search
//! of that for roots.
//!
//! ```text
//! Rates ──OneStep──▶ Trial ──Stepper──▶ step accepted ──▶ Dense ──first_root──▶ Root
//! ```
//!
//! - [`Rates`]: the system of equations `y' = f(t, y)`.
//! - [`Method`]: the methods by name; [`OneStep`] is what each implements (`methods/`, whose `mod.rs` says how to add one).
//! - [`Stepper`]: makes steps with a method and controls their length; its page has an example. [`Control`] is what it remembers.
//! - [`Dense`]: all components over a step, as polynomials in Bernstein form.
//! - [`first_root`]: the first change of sign of a function of which bounds are known.
//! - [`Pattern`]: sparse elimination, for the implicit method and for others who solve linear systems on trees.
//!
//! The equations, and events in them, belong to the caller: this crate knows of numbers only.

#![warn(missing_docs)]

mod column;
mod control;
mod dense;
mod economy;
mod error;
mod methods;
mod one_step;
mod rates;
mod roots;
mod sparse;
mod stepper;
mod workspace;

pub use control::{CERTAINTY, Control, StepSettings, next_grid_time};
pub use dense::{Coefficients, Dense, MAX_DEGREE};
pub use economy::{Economized, LEAST_DEGREE, MAX_POWER, economy_error};
pub use error::Error;
pub use methods::Method;
pub use one_step::{InteriorError, OneStep, Step, Trial};
pub use rates::{Part, Rates};
pub use roots::{Function, Root, first_root};
pub use sparse::{Complex, Field, Pattern, Wide};
pub use stepper::Stepper;
pub use workspace::Reached;
pub use workspace::Workspace;
