//! Ordinary differential equations: one step of a method, the solution inside it, and the search of that for roots.
//!
//! - [`Method`]: the methods by name. To add an explicit one: its coefficients in `tableau.rs`, its name in `method.rs`, and its dense
//!   output in `runge_kutta.rs`.
//! - [`Workspace`]: explicit Runge-Kutta steps; what becomes of one is a [`Trial`]. Equations are [`Rates`].
//! - [`Implicit`]: Radau IIA steps, by [`sparse`] elimination.
//! - [`Dense`]: all components over a step, as polynomials in Bernstein form.
//! - [`roots`]: the first change of sign of a function that is known by bounds.
//!
//! Nothing here knows of modules or productions.

pub mod dense;
pub mod implicit;
mod method;
mod radau;
pub mod roots;
pub mod runge_kutta;
pub mod sparse;
mod tableau;

pub use dense::{Coefficients, Dense, MAX_DEGREE};
pub use implicit::Implicit;
pub use method::Method;
pub use roots::{Function, Root, first_root};
pub use runge_kutta::{Inside, Nodes, Rates, Trial, Workspace};
pub use sparse::{Pattern, Wide};
