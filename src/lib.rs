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
//! [`Model::load`] reads a file, [`Plant::save`] writes one, and an [`Error`] displays as the message of the program.
//! [`Settings`] has the tolerance, method, seed and limits of a run, [`replay`] goes back in time, and [`render`] writes
//! frames that share one picture area.
//!
//! # The stages
//!
//! ```text
//! text ──syntax──▶ Document ──compile──▶ Model ──sim──▶ Tree at any time t ──turtle──▶ Scene ──render──▶ SVG, PNG, OBJ
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`expr`] | expressions, compiled and evaluated as numbers, intervals or derivatives |
//! | [`syntax`] | the notation: text to syntax tree and back, formatter, the table of declarations |
//! | [`compile`] | from the syntax tree to the model: names, rules, checks, closed forms |
//! | [`model`] | the compiled model: kinds of modules, rules, conditions |
//! | [`tree`] | the tree and the string of modules, their identity and birth |
//! | [`ode`] | integration steps, dense output and roots of ordinary differential equations |
//! | [`sim`] | development in time: integration, event location, productions |
//! | [`turtle`] | from strings to geometry |
//! | [`scene`] | geometry, independent of file formats |
//! | [`render`] | SVG, PNG and OBJ files |
//! | [`interchange`] | animated GLB and USD files |
//! | [`film`] | films: animated WebP, PNG, GIF, raw video |
//! | [`player`] | recordings, the page that plays them, and the window |
//! | [`session`] | from a file to a simulation |
//! | [`replay`] | random access to simulated time |
//! | [`repl`] | the interactive session |
//! | [`surround`] | wind and stems that bend, around a growing plant |
//! | [`sway`] | mechanics of stems that bend |
//! | [`fall`](crate::fall) | flight and landing of plates and small bodies |
//! | [`gas`] | smoke, steam and pollen: blobs in the wind, and light through them |
//! | [`ground`] | sand, mud, snow and soil as columns that slip, stand, are poured, pressed and carried |
//! | [`sheet`] | flexible surfaces and nets, and their contact with solids |
//! | [`solid`] | convex rounded solids on their paths, and the gaps between them |
//! | [`wind`] | the velocity of the air, as a function of place and time |
//! | [`study`] | accuracy and cost of methods; verification |
//! | [`cli`] | the command line |
//! | [`rescue`] | report and recovery after a bug in the program |
//! | [`diagnostic`] | messages that point at the text |
//!
//! Each stage is a crate. Dependencies follow the arrow; `compile`, `sim` and `turtle` do not depend on each other.
//! `ARCHITECTURE.md` explains the design.

#![warn(missing_docs)]

pub mod cli;
mod front;
pub mod interrupt;
pub mod repl;
pub mod rescue;

pub use dlsys_render::Format;
pub use dlsys_sim::{Method, Scheduler, Settings};
pub use front::{Error, Model, Module, Plant, Run};

pub use dlsys_compile as compile;
pub use dlsys_diagnostic as diagnostic;
pub use dlsys_expr as expr;
pub use dlsys_fall as fall;
pub use dlsys_film as film;
pub use dlsys_gas as gas;
pub use dlsys_geometry::{scene, turtle};
pub use dlsys_ground as ground;
pub use dlsys_interchange as interchange;
pub use dlsys_model as model;
pub use dlsys_ode as ode;
pub use dlsys_player as player;
pub use dlsys_render as render;
pub use dlsys_session::{self as session, replay};
pub use dlsys_sheet as sheet;
pub use dlsys_sim as sim;
pub use dlsys_solid as solid;
pub use dlsys_study as study;
pub use dlsys_surround as surround;
pub use dlsys_sway as sway;
pub use dlsys_syntax as syntax;
pub use dlsys_tree as tree;
pub use dlsys_wind as wind;

/// Compiles and runs the listings of the book's chapter about the library.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/library.md")]
struct BookOfTheLibrary;
