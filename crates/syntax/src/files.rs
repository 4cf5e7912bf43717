//! The files that a model names: included texts, surfaces and tables.
//!
//! The language opens no file itself. The caller passes a [`Files`], which decides which paths are accessible.

use std::path::{Component, Path};

/// A source of the files that a model names.
pub trait Files {
    /// The bytes of a file by its path relative to the folder of the model. A file longer than `limit` is an error.
    ///
    /// # Errors
    /// The reason why it cannot be read, as a sentence without a full stop.
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, String>;
}

/// No files: for a text that is not in a file itself.
#[derive(Clone, Copy, Debug)]
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, _: &Path, _: u64) -> Result<Vec<u8>, String> {
        Err("this model's text does not come from a file, so there is no folder to look in".to_owned())
    }
}

/// Why a path cannot be read: it leaves the folder in which it begins, or is written as on Windows. `None` if it can.
pub fn fault_of_path(path: &str) -> Option<&'static str> {
    match (path.contains('\\'), is_inside(path)) {
        (true, _) => Some("folders in a path are separated by `/`, not by `\\`"),
        (false, false) => Some("the path leaves the model's folder"),
        (false, true) => None,
    }
}

/// True if a relative path never leaves the folder in which it begins.
pub fn is_inside(path: &str) -> bool {
    let inside = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    !path.is_empty() && inside && !path.contains('\\')
}
