//! A language, interpreter and growth animator for **differential L-systems**: plants as growing strings
//! of modules, whose parameters follow ordinary differential equations while they stay in a legal domain,
//! and which productions replace when a trajectory reaches the domain's boundary (Prusinkiewicz, Hammel and
//! Mjolsness, *Animation of Plant Development*, SIGGRAPH '93).
//!
//! # A first model
//!
//! ```
//! use dlsys::session::Session;
//! use dlsys::sim::Settings;
//! use dlsys::tree::ModuleString;
//!
//! let text = "
//!     initial string: A(0)
//!     A(x):
//!       if x < 1  solve dx/dt = 1
//!       if x = 1  produce F(x) [ +(30) A(0) ] A(0)
//! ";
//! let session = Session::from_text("bush.dls", text, &[]).expect("a good model");
//! let mut simulation = session.simulate(Settings::default()).expect("a good start");
//! let mut string = ModuleString::default();
//! simulation.at(2.5, &mut string).expect("it runs");
//! let names: Vec<&str> = string.iter().map(|m| session.model.kinds.get(m.kind).name.as_str()).collect();
//! assert_eq!(names.join(" "), "F [ + F [ + A ] A ] F [ + A ] A");
//! ```
//!
//! and to a picture:
//!
//! ```
//! # let text = "initial string: F(1) [ +(30) @L(1) ] F(1) @K(1)";
//! # let session = dlsys::session::Session::from_text("twig.dls", text, &[]).expect("a good model");
//! # let mut simulation = session.simulate(Default::default()).expect("a good start");
//! # let mut string = Default::default();
//! # simulation.at(1.0, &mut string).expect("it runs");
//! use dlsys::render::{Format, FrameWriter, Survey, View};
//! use dlsys::scene::Scene;
//!
//! let mut scene = Scene::default();
//! dlsys::turtle::draw(&session.model, &string, &mut scene).expect("finite");
//! let mut survey = Survey::new(View::FRONT);
//! survey.add(&scene);
//! let svg = FrameWriter::new(Format::Svg, survey.fit()).write(&scene, "a twig");
//! assert!(svg.starts_with(b"<svg"));
//! ```
//!
//! # The stages
//!
//! ```text
//! text ──lang──▶ Model ──sim──▶ Tree at any time t ──turtle──▶ Scene ──export──▶ SVG, PNG, OBJ
//! ```
//!
//! | module | what it is |
//! |---|---|
//! | [`expr`] | pure mathematics: expressions, compiled, evaluated as numbers, bounds or derivatives |
//! | [`lang`] | text to model; everything that can be said about a text |
//! | [`model`] | what a model says: kinds of modules, rules, conditions |
//! | [`structure`] | modules and how they hang together: tree, string, identity, birth |
//! | [`sim`] | development in time: integration, event location, productions |
//! | [`turtle`] | strings as geometry |
//! | [`scene`] | geometry that knows no file format |
//! | [`export`] | files |
//! | [`view`] | a plant as something to walk around: recordings, a page that plays them, a window |
//! | [`session`] | the pipeline as a whole |
//! | [`replay`] | any time after any other |
//! | [`repl`] | the interactive session |
//! | [`report`] | how good the answers are, and what they cost |
//! | [`cli`] | the program |
//! | [`memory`] | whether there is memory for what comes next |
//! | [`rescue`] | what is said and saved when the program is at fault |
//! | [`diagnostic`] | messages that point at the text |
//!
//! Imports go down this arrow and never back; `lang`, `sim`, `turtle` and `export` do not know one another.
//! `ARCHITECTURE.md` tells why things are as they are.

pub mod cli;
pub mod interrupt;
pub mod repl;
pub mod rescue;

pub use dlsys_diagnostic as diagnostic;
pub use dlsys_expr as expr;
pub use dlsys_geometry::{scene, turtle};
pub use dlsys_lang as lang;
pub use dlsys_model as model;
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
