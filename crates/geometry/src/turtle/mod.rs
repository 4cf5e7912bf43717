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
//! | `@E(n)` | stems from here on give way, made of tissue `n` of the model, and are clamped here or at the stem below; 0 is rigid |
//! | `@S(n, r, d)` | blobs of gas `n` of the model begin here, `r` of them in a unit of `t`, within the distance `d` (0) |
//! | `[` `]` | remember and return to position, orientation, width, colour, cross-section, tissue and strength of tropism |
//! | `{` `.` `}` | begin a filled polygon, make the position a vertex, end it; steps between them make vertices, too, and are not drawn |
//! | `@L(s)` `@K(s)` `@P(s)` `@B(s)` | a leaf, a flower, a petal, a bud of size `s` (1), or any surface that the model declares; nothing if `s` is not positive |
//! | `@O(d)` | a ball of diameter `d` (1) around the turtle |
//! | `@L(w, l, h)` | the same for each surface: its width (to the left), length (along the heading) and height (up) in parts of its own; `@L(w, l)` is `@L(w, l, l)` |
//! | `@NAME(b, s, k)` | a plant of another model, declared by `plant @NAME from …`, as it is at its time t - b; `s` is its seed, `k` how many times as large it is as in its model (1), nothing if that is not positive |
//! | `@NAME` | a sheet, declared by `sheet @NAME from …`, whose coordinates are the turtle's: `x` to the right, `y` along the heading, `z` up |
//! | `@D` | what follows, to the end of the branch, is free since the birth of the module that holds it: it falls, flutters, lands |
//! | `@G` | the turtle is set down on the ground; `x`, `z` and its directions stay |
//! | `@PS(n)` `@PC(n, r, c)` `@PD(n)` | begin Bézier patch `n`; make the position its control point in row `r` and column `c` (0 to 3); draw it, when all 16 are there. Brackets do not matter to them |
//!
//! A kind with an interpretation is drawn as that says, in place of its own meaning; what the interpretation
//! does to the turtle stays.
//!
//! # Examples
//!
//! ```
//! use dlsys_session::Session;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let session = Session::from_text("hook.dls", "initial string: F(3) +(90) F(4) @C(7) F(1)", &[])?;
//! let mut string = Default::default();
//! session.simulate(Default::default())?.at(0.0, &mut string)?;
//! let mut scene = dlsys_geometry::turtle::blank(&session.model);
//! let end = dlsys_geometry::turtle::trace(&session.model, &string, &mut scene)?.position;
//! assert!((end.x + 5.0).abs() < 1e-12 && (end.y - 3.0).abs() < 1e-12);
//! // There is no contour 7: the segment is drawn as a circle, with a warning.
//! assert_eq!(scene.warnings[0].message, "there is no such contour");
//! # Ok(())
//! # }
//! ```

mod bend;
mod bent;
mod body;
mod command;
mod error;
mod frame;
mod free;
mod interpret;
mod patch;
mod prepare;
mod shapes;
mod skeleton;
mod surroundings;
mod twofold;
mod walk;

#[cfg(test)]
mod organ_tests;
#[cfg(test)]
mod tests;

use crate::scene::{Point, Scene, Vector};
pub use bent::{PartKey, StemKey, Strains};
pub use body::DrawnBody;
use command::Command;
use dlsys_diagnostic::Span;
use dlsys_model::{DETACH, KindId, Model, SOURCE};
use dlsys_tree::ModuleString;
pub use error::{Error, ErrorKind};
pub use free::{FreePart, Passive, SolidBody};
pub use skeleton::{Form, Load, Origin, Piece, Skeleton, Stem};
pub use surroundings::surroundings;

/// Deepest nesting of interpretations.
pub const DEPTH_LIMIT: usize = 100;
/// Coordinates and sizes beyond this are a mistake of the model.
pub const COORDINATE_LIMIT: f64 = 1e100;
/// Lengths, widths and sizes below this are treated as 0: squares of areas would underflow, and directions are quotients of them.
pub const SMALLEST_LENGTH: f64 = 1e-80;

/// Position and orientation of a turtle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Where it is, in scene units.
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

/// Empty scenes of a model and of its plants: the model's own first, then for each plant in the order of the declarations its own and those
/// of the plants in it. They share their palette and their contours.
pub fn blanks(model: &Model) -> Vec<Scene> {
    prepare::prepare_all(model)
}

/// Draws a string of modules of this model, adding to the scene. Elements that are drawn but hardly meant add to its
/// [`warnings`](Scene::warnings).
///
/// # Errors
/// See [`Error`]. The scene then holds what was drawn before.
pub fn draw(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<(), Error> {
    trace(model, string, scene).map(|_| ())
}

/// Draws as [`draw`] does, and returns the pose of the turtle at the end.
///
/// # Errors
/// As of [`draw`].
pub fn trace(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Pose, Error> {
    interpret::trace(model, string, scene)
}

/// Draws as [`draw`] does, with stems bent by these strains. Without a strain anywhere the scene is the same to the bit.
///
/// # Errors
/// As of [`draw`].
pub fn draw_bent(
    model: &Model,
    string: &ModuleString,
    strains: &dyn Strains,
    scene: &mut Scene,
) -> Result<(), Error> {
    interpret::bent(model, string, strains, scene)
}

/// True if the string alone decides the drawing: no interpretation reads the time or the age of a module.
pub fn is_timeless(model: &Model) -> bool {
    model.kinds.iter().all(|(_, kind)| {
        let drawing = kind.interpretation.map(|index| &model.interpretations[index].drawn);
        // Behind the parameters are the time and the age.
        let reads_time = |variable: &usize| [kind.arity, kind.arity + 1].contains(variable);
        drawing.is_none_or(|drawn| !drawn.programs().flat_map(|program| program.reads()).any(reads_time))
    })
}

/// The skeleton of a string: its stems that give way, and what they carry. `scene` is overwritten.
///
/// # Errors
/// As of [`draw`].
pub fn skeleton(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Skeleton, Error> {
    interpret::skeleton(model, string, scene)
}

/// The parts of a string that are let go, with stems bent by these strains, and with parts that are known where they are. `scene` is
/// overwritten.
///
/// # Errors
/// As of [`draw`].
pub fn free_parts(
    model: &Model,
    string: &ModuleString,
    strains: &dyn Strains,
    scene: &mut Scene,
) -> Result<Vec<FreePart>, Error> {
    interpret::free_parts(model, string, strains, scene)
}

/// The bodies of a string: what each of its modules that are `solid` draws, in the shape at rest of stems. `scene` is overwritten.
///
/// # Errors
/// As of [`draw`].
pub fn solids(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Vec<SolidBody>, Error> {
    interpret::solids(model, string, scene)
}

/// The bodies and shelves of a string: what each of its modules that are `solid` or `shelf` draws, as triangles, with stems bent by these strains, if any.
/// Patches are within `accuracy` of theirs, in scene units. `scene` is overwritten.
///
/// # Errors
/// As of [`draw`].
pub fn bodies(
    model: &Model,
    string: &ModuleString,
    strains: Option<&dyn Strains>,
    accuracy: f64,
    scene: &mut Scene,
) -> Result<Vec<DrawnBody>, Error> {
    interpret::bodies(model, string, strains, accuracy, scene)
}

/// The kinds of a model that hold an `@D`, themselves or in what they are drawn as, by [`KindId::index`].
pub fn kinds_that_let_go(model: &Model) -> Vec<bool> {
    Command::that_hold(|command| command == Command::Detach, model)
}

/// True if stems of a model may give way (`@E`).
pub fn bends(model: &Model) -> bool {
    !model.scenery.tissues.is_empty()
        && Command::that_hold(|command| command == Command::Elastic, model).contains(&true)
}

/// True if a model may let go of something (`@D`).
pub fn lets_go(model: &Model) -> bool {
    kinds_that_let_go(model).contains(&true)
}

/// True if a model may let out a gas (`@S`).
pub fn lets_out(model: &Model) -> bool {
    !model.scenery.gases.is_empty()
        && Command::that_hold(|command| command == Command::Source, model).contains(&true)
}

/// The kinds of a model that place a sheet, themselves or in what they are drawn as, by [`KindId::index`].
pub fn kinds_that_drape(model: &Model) -> Vec<bool> {
    Command::that_hold(|command| matches!(command, Command::Sheet(_)), model)
}

/// True if a model may place a sheet.
pub fn drapes(model: &Model) -> bool {
    !model.scenery.sheets.is_empty() && kinds_that_drape(model).contains(&true)
}

/// The first place in the text of a model that writes an `@D`.
pub fn place_of_detach(model: &Model) -> Option<Span> {
    place_of(model, DETACH)
}

/// The first place in the text of a model that writes an `@S`.
pub fn place_of_source(model: &Model) -> Option<Span> {
    place_of(model, SOURCE)
}

/// The first place in the text of a model that writes a module with this base name.
fn place_of(model: &Model, base: &str) -> Option<Span> {
    let of_rules = model.rules.iter().flat_map(|rule| &rule.produces).flat_map(|p| &p.outcome.successors);
    let drawings = model.interpretations.iter().map(|interpretation| &interpretation.drawn);
    let strings = std::iter::once(&model.axiom).chain(of_rules).chain(drawings);
    let places = strings.flat_map(|string| string.stretches()).flat_map(|stretch| &stretch.places);
    let is_one = |kind: KindId| model.kinds.get(kind).base() == base;
    places.filter(|(kind, _)| is_one(*kind)).map(|(_, span)| *span).min_by_key(|span| span.start)
}
