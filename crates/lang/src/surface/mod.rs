//! Surfaces from files: Bézier patches as the plant modelling tools of Calgary write them (`*.s`), and
//! triangle meshes (`*.obj`).
//!
//! The language reads no file itself; it asks a [`Files`], which whoever has the model's text provides.

mod materials;
mod mesh;
mod patches;

use std::path::{Component, Path};

use dlsys_model::SurfaceShape;

/// Greatest size of a surface file, in bytes.
pub const SIZE_LIMIT: u64 = 64 << 20;
/// Most patches, or triangles, of one surface.
pub const PART_LIMIT: usize = 1_000_000;
/// Greatest coordinate.
const COORDINATE_LIMIT: f64 = 1e30;

/// Where the files that a model names come from.
pub trait Files {
    /// The bytes of a file, by a path relative to the model's own folder; at most `limit` of them.
    ///
    /// # Errors
    /// Why it cannot be read, as a sentence without its end.
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, String>;
}

/// No files: of a text that is not in a file itself.
#[derive(Clone, Copy, Debug)]
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, _: &Path, _: u64) -> Result<Vec<u8>, String> {
        Err("this model's text does not come from a file, so there is no folder to look in".to_owned())
    }
}

/// What is wrong with a surface file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// From 1, if one line is to blame.
    pub line: Option<usize>,
    pub what: String,
    pub help: Option<String>,
}

impl Fault {
    fn whole(what: impl Into<String>) -> Fault {
        Fault { line: None, what: what.into(), help: None }
    }

    fn at(line: usize, what: impl Into<String>) -> Fault {
        Fault { line: Some(line), what: what.into(), help: None }
    }

    fn help(self, help: &str) -> Fault {
        Fault { help: Some(help.to_owned()), ..self }
    }
}

/// True if a path goes down from where it begins, and never up.
pub fn is_inside(path: &str) -> bool {
    let inside = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    !path.is_empty() && inside && !path.contains('\\')
}

/// Reads a surface; its name and place are left empty.
pub fn read(path: &str, files: &dyn Files) -> Result<SurfaceShape, Fault> {
    if !is_inside(path) {
        return Err(Fault::whole("the path leaves the model's folder")
            .help("surfaces stand in the folder of the model or below it, as in `\"surfaces/petal.s\"`"));
    }
    let extension = Path::new(path).extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let parse = match extension.as_deref() {
        Some("s") => |text: &str, _: &str, _: &dyn Files| patches::parse(text),
        Some("obj") => mesh::parse,
        _ => {
            return Err(Fault::whole("this is no kind of surface file")
                .help("known are `.s` (Bézier patches) and `.obj` (Wavefront meshes)"));
        }
    };
    let bytes = files.read(Path::new(path), SIZE_LIMIT).map_err(|what| {
        Fault::whole(what).help("put it into the folder of the model's file or below; the path begins there")
    })?;
    parse(&String::from_utf8_lossy(&bytes), path, files)
}

/// A number of a surface file.
fn number(text: &str, line: usize) -> Result<f64, Fault> {
    let value: Option<f64> = text.parse().ok();
    match value {
        Some(x) if x.is_finite() && x.abs() <= COORDINATE_LIMIT => Ok(x),
        Some(_) => Err(Fault::at(line, format!("`{}` is too large or no number", shown(text)))),
        None => Err(Fault::at(line, format!("expected a number, not `{}`", shown(text)))),
    }
}

/// The beginning of a word, for a message.
fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(40).collect()
}
