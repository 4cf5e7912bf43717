//! Sheets of a scene: flexible surfaces and nets from files.

use dlsys_diagnostic::Span;

/// `sheet @NAME from "FILE" of TISSUE pinned CONDITION`: a flexible surface or net, placed by the module `@NAME`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// The name with its mark: `@Net`.
    pub name: String,
    /// Its points in the file's coordinates, in units of the model. They are its shape without weight.
    pub points: Vec<[f64; 3]>,
    /// Its faces: three or more points each, in order around the face.
    pub faces: Vec<Vec<usize>>,
    /// Its cords: two points each.
    pub cords: Vec<[usize; 2]>,
    /// Whether each point is held.
    pub pinned: Vec<bool>,
    /// The tissue, by its index among those of the scene. It has a constant stiffness.
    pub tissue: usize,
    /// The place of the declaration in the text.
    pub span: Span,
}
