//! The growing structure: modules on axes, their identity, and the string of modules that observers get.
//!
//! - [`Tree`]: the linked structure, changed in place by productions.
//! - [`ModuleString`]: the structure at one instant, in string order with brackets.
//! - [`Lineage`]: the identity of a module, by descent; the same in every run.
//! - [`Seed`]: random numbers, each of which belongs to a module.
//! - [`SimTime`]: instants, to about 32 digits.
//!
//! ```
//! use dlsys_tree::{Lineage, Purpose, Seed};
//!
//! // The second successor of the third module of the initial string.
//! let module = Lineage::of_axiom(2).child(0, 1);
//! assert_eq!(module.to_string(), "3.2");
//! // Its random numbers follow from the seed and from its identity.
//! let draw = || Seed::new(7).unit(module, Purpose::Parameter(0));
//! assert_eq!(draw(), draw());
//! ```

#![warn(missing_docs)]

mod chance;
mod lineage;
pub mod room;
mod siblings;
mod string;
mod tree;
mod walk;
mod ways;

pub use chance::{Purpose, Seed, key};
pub use dlsys_expr::SimTime;
pub use lineage::{Family, Lineage, mix};
pub use string::{Module, ModuleString, Version};
pub use tree::{LastOfChain, ModuleId, ModuleView, NO_LABEL, Tree};
pub use walk::{Visit, Walk};
