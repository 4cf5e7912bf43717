//! Surfaces from files: Bézier patches as the plant modelling tools of Calgary write them (`*.s`), and
//! triangle meshes (`*.obj`); and the pictures on them (`*.png`).
//!
//! The contents of files come from a [`Files`], which the caller provides.

mod materials;
mod mesh;
mod net;
mod patches;
mod picture;

use std::path::Path;

pub use net::{Net, read as read_net};
pub use picture::{read as read_picture, within_limit};

use dlsys_model::SurfaceShape;
use dlsys_syntax::{Files, fault_of_path};

/// Maximum size of a surface file, in bytes.
pub const SIZE_LIMIT: u64 = 64 << 20;
/// Maximum number of patches or triangles of one surface.
pub const PART_LIMIT: usize = 1_000_000;
/// Maximum absolute value of a coordinate.
const COORDINATE_LIMIT: f64 = 1e30;

/// An error in a surface file.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceError {
    /// The line with the error, from 1; None if it concerns the whole file.
    pub line: Option<usize>,
    pub what: String,
    pub help: Option<String>,
}

impl SurfaceError {
    fn whole(what: impl Into<String>) -> SurfaceError {
        SurfaceError { line: None, what: what.into(), help: None }
    }

    fn at(line: usize, what: impl Into<String>) -> SurfaceError {
        SurfaceError { line: Some(line), what: what.into(), help: None }
    }

    fn help(self, help: &str) -> SurfaceError {
        SurfaceError { help: Some(help.to_owned()), ..self }
    }
}

/// Reads a surface, with places of its vertices in a picture if there is one on it; the caller fills in its name, its place and the picture.
pub fn read(path: &str, has_picture: bool, files: &dyn Files) -> Result<SurfaceShape, SurfaceError> {
    if let Some(why) = fault_of_path(path) {
        return Err(SurfaceError::whole(why)
            .help("surfaces stand in the folder of the model or below it, as in `\"surfaces/petal.s\"`"));
    }
    let extension = Path::new(path).extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let is_mesh = match extension.as_deref() {
        Some("s") => false,
        Some("obj") => true,
        _ => {
            return Err(SurfaceError::whole("this is no kind of surface file")
                .help("known are `.s` (Bézier patches) and `.obj` (Wavefront meshes)"));
        }
    };
    let bytes = files.read(Path::new(path), SIZE_LIMIT).map_err(|what| {
        SurfaceError::whole(what)
            .help("put it into the folder of the model's file or below; the path begins there")
    })?;
    let text = String::from_utf8_lossy(&bytes);
    if is_mesh { mesh::parse(&text, path, has_picture, files) } else { patches::parse(&text) }
}

/// A number of a surface file.
fn number(text: &str, line: usize) -> Result<f64, SurfaceError> {
    let value: Option<f64> = text.parse().ok();
    match value {
        Some(x) if x.is_finite() && x.abs() <= COORDINATE_LIMIT => Ok(x),
        Some(_) => Err(SurfaceError::at(line, format!("`{}` is too large or no number", shown(text)))),
        None => Err(SurfaceError::at(line, format!("expected a number, not `{}`", shown(text)))),
    }
}

/// The beginning of a word, for a message.
fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(40).collect()
}
