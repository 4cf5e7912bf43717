//! The files that a model names: included texts, surfaces and tables.
//!
//! The language opens no file itself. The caller passes a [`Files`], which decides what a path may reach.

use std::path::{Component, Path};

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

/// True if a path goes down from where it begins, and never up.
pub fn is_inside(path: &str) -> bool {
    let inside = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    !path.is_empty() && inside && !path.contains('\\')
}
