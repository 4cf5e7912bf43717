//! From a string of modules to a scene: the turtle (Prusinkiewicz and Lindenmayer 1990, *The Algorithmic
//! Beauty of Plants*, sections 1.5 to 1.6, "ABOP").
//!
//! The turtle starts at the origin, heading `+Y`, left `-X`, up `+Z`, so that a plant grows upwards in the
//! front view and `+` turns left on the screen. A module is drawn by the base name of its kind and reads its
//! leading parameters; one without a meaning draws nothing. Lengths are in scene units, angles in degrees.
//!
//! | module | meaning |
//! |---|---|
//! | `F(l)` `f(l)` | a step of length `l` (1), drawn or not; a negative length goes backwards |
//! | `g(l)` | a step, not drawn and making no vertex of a polygon |
//! | `+(a)` `-(a)` | turn left, right about up (the model's `angle`) |
//! | `&(a)` `^(a)` | pitch down, up about left |
//! | `\(a)` `/(a)` | roll left, right about heading |
//! | `\|` `$` | turn round; roll until left is horizontal |
//! | `!(w)` `!` | line width, 0 drawing nothing; 0.7 times the present one. A segment has the width at its start all along, so cutting it in two cannot be seen |
//! | `@W(w)` | the same width as `!(w)`, and what was drawn on this axis since the width was last set tapers to it, evenly over its length |
//! | `;(n)` `;` | colour `n` of the palette, 0 being the natural one; the next colour |
//! | `;(n, v)` | colour at place `v` (0 to 1) of gradient `n` |
//! | `@T(e)` | strength of the tropism from here on, in radians per scene unit: headings bend towards its direction (down, if the model declares none), see `bend.rs` |
//! | `@C(n)` | cross-section of stems from here on: a contour that the model declares, 0 being a circle. Meshes only |
//! | `[` `]` | remember and return to position, orientation, width, colour, cross-section and strength of tropism |
//! | `{` `.` `}` | begin a filled polygon, make the position a vertex, end it; steps between them make vertices, too, and are not drawn |
//! | `@L(s)` `@K(s)` `@P(s)` `@B(s)` | a leaf, a flower, a petal, a bud of size `s` (1), or any surface that the model declares; nothing if `s` is not positive |
//! | `@PS(n)` `@PC(n, r, c)` `@PD(n)` | begin Bézier patch `n`; make the position its control point in row `r` and column `c` (0 to 3); draw it, when all 16 are there. Brackets do not matter to them |
//!
//! A kind with an interpretation is drawn as that says, in place of its own meaning; what the interpretation
//! does to the turtle stays.

mod bend;
mod command;
mod frame;
mod interpret;
mod patch;
mod prepare;
mod shapes;
mod twofold;
mod walk;

#[cfg(test)]
mod organ_tests;
#[cfg(test)]
mod tests;

use crate::model::Model;
use crate::scene::{Point, Scene, Vector};
use crate::structure::{Lineage, ModuleString};

/// Most modules that one frame may draw, those that interpretations make included.
pub const MODULE_LIMIT: usize = 10_000_000;
/// Deepest nesting of interpretations.
pub const DEPTH_LIMIT: usize = 100;
/// Coordinates and sizes beyond this are a mistake of the model.
pub const COORDINATE_LIMIT: f64 = 1e100;

/// What can go wrong in drawing. Lineages say which module of the string it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    #[error("cannot draw `{name}` (module {lineage}): its parameter is {value}")]
    NotFinite { name: String, lineage: Lineage, value: f64 },
    #[error(
        "cannot draw `{name}` (module {lineage}): it goes beyond the greatest coordinate, {COORDINATE_LIMIT:e}"
    )]
    TooFar { name: String, lineage: Lineage },
    #[error(
        "too much to draw: interpreting `{name}` (module {lineage}) brings the frame to more than {MODULE_LIMIT} modules"
    )]
    TooMany { name: String, lineage: Lineage },
    #[error("interpretations of `{name}` (module {lineage}) are nested more than {DEPTH_LIMIT} deep")]
    TooDeep { name: String, lineage: Lineage },
    #[error(
        "`{name}` (module {lineage}) uses patch {patch}, which is not begun; `@PS({patch})` comes before its points"
    )]
    PatchNotBegun { name: String, lineage: Lineage, patch: i64 },
    #[error("`{name}` (module {lineage}) sets row {row}, column {column} of a patch; both are 0, 1, 2 or 3")]
    NoControlPoint { name: String, lineage: Lineage, row: f64, column: f64 },
    #[error(
        "`{name}` (module {lineage}) draws patch {patch}, which has no control point at (row, column) {missing}"
    )]
    PatchIncomplete { name: String, lineage: Lineage, patch: i64, missing: String },
    #[error("`{name}` (module {lineage}) begins more patches than a frame may have")]
    TooManyPatches { name: String, lineage: Lineage },
}

/// Where a turtle stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position: Point,
    /// Heading, left and up: unit vectors.
    pub axes: [Vector; 3],
}

/// An empty scene with the model's colours and surfaces, which are then not made again for every scene that is
/// cloned from it.
pub fn blank(model: &Model) -> Scene {
    let mut scene = Scene::default();
    prepare::prepare(model, &mut scene);
    scene
}

/// Draws a string of modules of this model, adding to the scene.
///
/// # Errors
/// See [`Error`]. The scene then holds what was drawn before.
pub fn draw(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<(), Error> {
    trace(model, string, scene).map(|_| ())
}

/// Draws, and tells where the turtle comes to stand.
///
/// # Errors
/// As of [`draw`].
pub fn trace(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Pose, Error> {
    interpret::trace(model, string, scene)
}
