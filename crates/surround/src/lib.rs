//! The surroundings of a growing plant: wind, the stems that bend in it, what is let go and falls, gases, sheets, and ground that gives way.
//!
//! ```text
//! growth (sim) ──string──▶ turtle ──skeleton──▶ body ──▶ stems in the wind (sway, wind) ──strains──▶ turtle ──▶ scene
//!                                ──free parts──▶ loose ──▶ flights (fall, wind) ──poses──▶
//! ```
//!
//! Growth is active and the surroundings are passive (O'Brien, Zordan and Hodgins): they change what is seen. They advance on a clock of
//! their own, the same for every frame rate, and hang on the descent of modules, so that a production changes neither shape
//! nor velocity.
//!
//! - [`Weather`]: the wind that a model declares.
//! - [`Survey`]: axes of a string with their natural frequencies, before anything is simulated.
//! - [`Classes`]: modes by which plants move that are small in the picture.
//! - [`Gases`]: smoke, steam and pollen at any time.
//! - [`Sheets`]: flexible surfaces and nets at any time.
//! - [`Trial`]: solids among the sheets, on their own ways or pushed by them: motions, impulses, stretches.
//! - [`Loose`]: what is let go, as a body.
//! - [`Terrain`]: ground that gives way, at any time; [`Quilt`]: in pieces whose triangles stay the same.
//! - [`Motion`]: the stems and the flights of a model at any time, as [`BentStems`] for [`draw_bent`](dlsys_geometry::turtle::draw_bent).

#![warn(missing_docs)]

mod advice;
mod afloat;
mod bending;
mod between;
mod body;
mod classes;
mod columns;
mod coupled;
mod course;
mod descent;
mod drift;
mod error;
mod flights;
mod footing;
mod gases;
mod hanging;
mod layers;
mod leading;
mod line;
mod loose;
mod marks;
mod masses;
mod mire;
mod motion;
mod obstacles;
mod outlets;
mod paths;
mod picture;
mod place;
mod points;
mod pressing;
mod pushed;
mod quilt;
mod reading;
mod sampler;
mod sheets;
mod solids;
mod spray;
mod survey;
mod terrain;
mod tracks;
mod trial;
mod weather;
mod works;

pub use bending::{BentStems, Effort, Foot};
pub use classes::{ByModes, Classes};
pub use columns::material as soil;
pub use coupled::start;
pub use error::{CouplingFault, Error, FailedStem, FallingPart};
pub use gases::{Gases, MOST_BLOBS, TICK as GAS_TICK};
pub use hanging::TICK as SHEET_TICK;
pub use loose::Loose;
pub use motion::{MOST_TICKS, Motion, Passive};
pub use paths::Meets;
pub use picture::Earth;
pub use place::Place;
pub use quilt::Quilt;
pub use reading::bind;
pub use sampler::Sampler;
pub use sheets::Sheets;
pub use survey::{Axis, Survey, Vibration, moves};
pub use terrain::{TICKS as GROUND_TICKS, Terrain, TerrainReport};
pub use trial::{SheetSeen, SolidSeen, Trial, TrialTick, Ways};
pub use weather::Weather;

/// Most points of all sheets of a scene.
pub const MOST_SHEET_POINTS: usize = 1_000_000;

/// Seconds from one tick of the clock to the next.
pub const CLOCK: f64 = 1.0 / 30.0;
