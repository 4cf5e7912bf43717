//! `manifest.json`: the contents of a directory of frames, and the settings that it was made with.

use serde::Serialize;

/// The description of a render, as it is written to `manifest.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    /// Program and version, filled in by [`Manifest::new`]; it identifies the directory as that of a render.
    pub generator: String,
    /// Name of the model's file, without its folder: the same bytes wherever `render` is called.
    pub model: String,
    /// The model's `title`.
    pub title: Option<String>,
    /// All settings that the frames depend on: format, view, tolerance, method, parameters, ….
    pub settings: serde_json::Value,
    /// `viewBox` that all frames share: left, top, width, height (SVG only).
    pub view_box: Option<[f64; 4]>,
    /// Opposite corners of the box around all frames, in scene units; `None` if nothing is drawn.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// The frames, in the order of time.
    pub frames: Vec<FrameRecord>,
    /// Names of all files, frames included; filled in by
    /// [`FrameDirectory::finish`](super::FrameDirectory::finish).
    pub files: Vec<String>,
}

/// One frame of a [`Manifest`].
#[derive(Clone, Debug, Serialize)]
pub struct FrameRecord {
    /// Number of the frame, from 0.
    pub index: usize,
    /// Time of the simulation.
    pub time: f64,
    /// Name of the file.
    pub file: String,
    /// Number of modules, brackets not counted.
    pub modules: usize,
    /// Opposite corners of the box around what is drawn, lines having their width, in scene units; `None` if
    /// nothing is.
    pub bounds: Option<[[f64; 3]; 2]>,
}

impl Manifest {
    /// A manifest without frames.
    pub fn new(model: impl Into<String>, title: Option<String>, settings: serde_json::Value) -> Manifest {
        Manifest {
            generator: super::GENERATOR.to_owned(),
            model: model.into(),
            title,
            settings,
            view_box: None,
            bounds: None,
            frames: Vec::new(),
            files: Vec::new(),
        }
    }
}
