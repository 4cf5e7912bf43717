//! Recordings of growing plants, the HTML page that plays them, and (feature `viewer`) the window of `dlsys view`.
//!
//! ```text
//! Scene ──▶ Stage ──▶ Recording ──▶ page (one HTML file that plays it)
//! ```
//!
//! - [`Stage`]: a scene as things in their places. A shape that repeats (a surface, the side of a stem, a patch) is a
//!   form; each thing is a few numbers that place its form. All of them are points or differences of points, so halfway
//!   between two stages is halfway between their numbers.
//! - [`Recording`]: stages over time, each thing followed by the lineage of its module.
//! - [`Clouds`]: the blobs of gases in a recording.
//! - [`page`]: the recording, a player and the shaders in one file that needs no network.
//!
//! The page makes the triangles of one instant (`page/geometry.js`). The shaders (`shaders/`) have no version line: it is prepended
//! when they are compiled.
//!
//! ```
//! use dlsys_player::{Recorder, Stage, page};
//! use dlsys_render::{Survey, View};
//! use dlsys_session::{Nursery, Session};
//! use dlsys_sim::Settings;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "initial string: F(1) [ +(30) F(2) ]";
//! let session = Session::from_text("stem.dls", text, &[])?;
//! let mut string = Default::default();
//! session.simulate(Default::default())?.at(0.0, &mut string)?;
//! let nursery = Nursery::new(&session.model, Settings::default());
//! let mut scene = nursery.blank();
//! nursery.draw(&string, &mut scene)?;
//!
//! let mut survey = Survey::new(View::FRONT);
//! survey.add(&scene);
//! let fit = survey.fit();
//! let mut stage = Stage::default();
//! stage.set(&scene, &fit);
//! let mut recorder = Recorder::new(&session.model, &scene, text, &fit);
//! recorder.add(0.0, 2, &stage)?;
//! assert!(page::document(&recorder.finish()).contains("<html"));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod clouds;
mod encode;
mod error;
mod forms;
mod history;
pub mod page;
mod recording;
mod stage;
mod track;
#[cfg(feature = "viewer")]
pub mod window;

pub use clouds::Clouds;
pub use error::Error;
pub use forms::{Forms, MeshForm, MeshVertex};
pub use history::{Happening, History};
pub use recording::{Recorder, Recording};
pub use stage::{Finish, Form, Item, Key, Stage};
pub use track::Track;
