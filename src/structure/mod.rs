//! Modules and how they hang together.
//!
//! - [`Tree`]: the growing structure, linked, changed in place by productions.
//! - [`ModuleString`]: the structure at one instant, written out in string order with brackets; what
//!   an observer gets.
//! - [`Lineage`]: who a module is, for as long as it lives, in every run.
//! - [`Instant`]: when it was born, to more digits than a float has.

mod instant;
mod lineage;
mod string;
mod tree;

pub use instant::Instant;
pub use lineage::Lineage;
pub use string::{Module, ModuleString};
pub use tree::{ModuleId, Tree, Visit, Walk};
