//! A language, interpreter and growth animator for **differential L-systems**: plants as growing strings
//! of modules, whose parameters follow ordinary differential equations while they stay in a legal domain,
//! and which productions replace when a trajectory reaches the domain's boundary (Prusinkiewicz, Hammel and
//! Mjolsness, *Animation of Plant Development*, SIGGRAPH '93).
//!
//! # A plant, and its picture
//!
//! ```
//! # fn main() -> Result<(), dlsys::Error> {
//! let model = dlsys::Model::parse("
//!     initial string: A(0)
//!     A(x):
//!       if x < 1  solve dx/dt = 1
//!       if x = 1  produce F(x) [ +(30) A(0) ] A(0)
//! ")?;
//! let mut run = model.run()?;
//! let plant = run.at(2.5)?;
//! assert_eq!(plant.to_string(), "F(1) [ +(30) F(1) [ +(30) A(0.5) ] A(0.5) ] F(1) [ +(30) A(0.5) ] A(0.5)");
//! let svg = plant.picture(dlsys::Format::SVG)?;
//! # assert!(svg.starts_with(b"<svg"));
//! # Ok(())
//! # }
//! ```
//!
//! [`Model::load`] reads a file, [`Plant::save`] writes one, and errors are the messages of the program. The module
//! [`sim`] has the settings of a run (tolerance, method, seed, limits), [`replay`] goes back in time, [`render`] writes
//! frames that share one picture area.
//!
//! # The stages
//!
//! ```text
//! text ──lang──▶ Model ──sim──▶ Tree at any time t ──turtle──▶ Scene ──render──▶ SVG, PNG, OBJ
//! ```
//!
//! | module | what it is |
//! |---|---|
//! | [`expr`] | pure mathematics: expressions, compiled, evaluated as numbers, bounds or derivatives |
//! | [`lang`] | text to model; everything that can be said about a text |
//! | [`model`] | what a model says: kinds of modules, rules, conditions |
//! | [`tree`] | modules and how they hang together: tree, string, identity, birth |
//! | [`ode`] | steps, dense output, roots: nothing about plants |
//! | [`sim`] | development in time: integration, event location, productions |
//! | [`turtle`] | strings as geometry |
//! | [`scene`] | geometry that knows no file format |
//! | [`render`] | files |
//! | [`player`] | a plant as something to walk around: recordings, a page that plays them, a window |
//! | [`session`] | the pipeline as a whole |
//! | [`replay`] | any time after any other |
//! | [`repl`] | the interactive session |
//! | [`study`] | how good the answers are, and what they cost |
//! | [`cli`] | the program |
//! | [`rescue`] | what is said and saved when the program is at fault |
//! | [`diagnostic`] | messages that point at the text |
//!
//! Each is a crate of its own. Imports go down this arrow and never back; `lang`, `sim` and `turtle` do not know one another.
//! `ARCHITECTURE.md` tells why things are as they are.

#![warn(missing_docs)]

pub mod cli;
mod front;
pub mod interrupt;
pub mod repl;
pub mod rescue;

pub use dlsys_render::Format;
pub use dlsys_sim::{Method, Scheduler, Settings};
pub use front::{Error, Model, Module, Plant, Run};

pub use dlsys_diagnostic as diagnostic;
pub use dlsys_expr as expr;
pub use dlsys_geometry::{scene, turtle};
pub use dlsys_lang as lang;
pub use dlsys_model as model;
pub use dlsys_ode as ode;
pub use dlsys_player as player;
pub use dlsys_render as render;
pub use dlsys_session::{self as session, replay};
pub use dlsys_sim as sim;
pub use dlsys_study as study;
pub use dlsys_tree as tree;

/// The listings of the book's chapter about the library are compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/library.md")]
struct BookOfTheLibrary;
