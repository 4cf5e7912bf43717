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
//! - [`page`]: the recording, a player and the shaders in one file that needs no network.
//!
//! The page makes the triangles of one instant (`page/geometry.js`). The shaders (`shaders/`) have no version line: it is prepended
//! when they are compiled.

#![warn(missing_docs)]

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

pub use error::Error;
pub use forms::{Forms, MeshForm, MeshVertex};
pub use history::{Happening, History};
pub use recording::{Recorder, Recording};
pub use stage::{Finish, Form, Item, Key, Stage};
pub use track::Track;
