//! The appearance of modules: colours, surfaces, contours, tropism.
//!
//! Plain data: `dlsys-compile` fills it in, and the turtle builds materials and meshes from it.

use std::sync::Arc;

use crate::Texture;
use dlsys_diagnostic::Span;

/// The declarations `color`, `gradient`, `surface`, `contour` and `tropism` of a model.
#[derive(Clone, Debug, Default)]
pub struct Appearance {
    /// In the order written; colour `i` is number `BUILT_IN_COLORS + 1 + i` of `;(n)`.
    pub colors: Vec<NamedColor>,
    /// In the order written; their numbers follow those of the colours.
    pub gradients: Vec<Gradient>,
    /// Surfaces read from files, in the order written.
    pub surfaces: Vec<Arc<SurfaceShape>>,
    /// In the order written; contour `i` is number `i + 1` of `@C(n)`.
    pub contours: Vec<Contour>,
    /// The direction towards which headings bend, if the model has one.
    pub tropism: Option<Tropism>,
}

/// Colours that need no declaration: numbers 1 to 12 of `;(n)`.
pub const BUILT_IN_COLORS: usize = 12;

/// A colour of the sRGB space as `0xRRGGBB`.
pub type Rgb = u32;

/// `color name = "#rrggbb"`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedColor {
    /// The name as declared, or the name of the material in its file.
    pub name: Arc<str>,
    /// The colour.
    pub rgb: Rgb,
}

/// `gradient name = "#rrggbb", …`: colours at equal distances from 0 to 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gradient {
    /// The name as declared.
    pub name: Arc<str>,
    /// The colours, two or more.
    pub stops: Vec<Rgb>,
}

/// `tropism X, Y, Z strength E`: headings bend towards a direction (ABOP, section 2.3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tropism {
    /// A unit vector, in scene coordinates.
    pub direction: [f64; 3],
    /// Radians per scene unit for a heading at a right angle to the direction; negative bends away.
    pub strength: f64,
}

/// The 16 control points of a bicubic Bézier patch, row by row.
pub type Net = [[f64; 3]; 16];

/// A surface from a file, in the turtle's axes (along the heading, to the left, up) with the turtle at the origin.
#[derive(Clone, Debug, Default)]
pub struct SurfaceShape {
    /// The name with its mark: `@P`.
    pub name: String,
    /// Bicubic patches. Seen from the front with rows going up, columns go to the right.
    pub patches: Vec<Net>,
    /// Corners of triangles.
    pub vertices: Vec<[f64; 3]>,
    /// One normal for each vertex; empty if the file has none.
    pub normals: Vec<[f64; 3]>,
    /// Indices of three vertices each, counter-clockwise as seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Where each vertex lies in the picture on the surface: see [`Picture`](crate::Picture); empty without a picture. A patch has the whole
    /// picture on it: columns go to the right, rows up.
    pub places: Vec<[f64; 2]>,
    /// The picture on the surface.
    pub texture: Option<Texture>,
    /// The materials of the file.
    pub materials: Vec<NamedColor>,
    /// Index of the material of each triangle; empty if no triangle has one.
    pub painted: Vec<Option<u32>>,
    /// The place of the declaration in the text.
    pub span: Span,
}

/// `contour name = (x, y) …`: the cross-section of a stem through these points, counter-clockwise about the origin, in
/// units of the radius of the stem.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// The name as declared.
    pub name: Arc<str>,
    /// The points, three or more.
    pub points: Vec<[f64; 2]>,
}
