//! Modules and how they hang together.
//!
//! - [`Tree`]: the growing structure, linked, changed in place by productions.
//! - [`ModuleString`]: the structure at one instant, written out in string order with brackets; what
//!   an observer gets.
//! - [`Lineage`]: who a module is, for as long as it lives, in every run.
//! - [`Seed`]: random numbers, each of which belongs to a module.
//! - [`SimTime`]: when it was born, to more digits than a float has.

#![warn(missing_docs)]

mod brood;
mod chance;
mod lineage;
mod string;
mod tree;
mod walk;
mod ways;

pub use chance::{Purpose, Seed, key};
pub use dlsys_expr::SimTime;
pub use lineage::{Family, Lineage};
pub use string::{Module, ModuleString, Version};
pub use tree::{Look, ModuleId, NO_LABEL, Tree};
pub use walk::{Visit, Walk};
