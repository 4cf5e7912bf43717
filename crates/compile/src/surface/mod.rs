//! Surfaces from files: Bézier patches as the plant modelling tools of Calgary write them (`*.s`), and
//! triangle meshes (`*.obj`).
//!
//! The contents of files come from a [`Files`], which the caller provides.

mod materials;
mod mesh;
mod patches;

use std::path::Path;

use dlsys_model::SurfaceShape;
use dlsys_syntax::{Files, is_inside};

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

/// Reads a surface; the caller fills in its name and place.
pub fn read(path: &str, files: &dyn Files) -> Result<SurfaceShape, SurfaceError> {
    if !is_inside(path) {
        return Err(SurfaceError::whole("the path leaves the model's folder")
            .help("surfaces stand in the folder of the model or below it, as in `\"surfaces/petal.s\"`"));
    }
    let extension = Path::new(path).extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let parse = match extension.as_deref() {
        Some("s") => |text: &str, _: &str, _: &dyn Files| patches::parse(text),
        Some("obj") => mesh::parse,
        _ => {
            return Err(SurfaceError::whole("this is no kind of surface file")
                .help("known are `.s` (Bézier patches) and `.obj` (Wavefront meshes)"));
        }
    };
    let bytes = files.read(Path::new(path), SIZE_LIMIT).map_err(|what| {
        SurfaceError::whole(what)
            .help("put it into the folder of the model's file or below; the path begins there")
    })?;
    parse(&String::from_utf8_lossy(&bytes), path, files)
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
