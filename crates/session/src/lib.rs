//! From a file to a running simulation: the pipeline that every front end uses.
//!
//! # Examples
//!
//! ```
//! use dlsys_session::Session;
//! use dlsys_sim::Settings;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "initial string: F(1)\nF(x): if x < 2 solve dx/dt = 1\n if x = 2 produce F(1) F(1)";
//! let session = Session::from_text("doubling.dls", text, &[])?;
//! let mut simulation = session.simulate(Settings::default())?;
//! let mut string = Default::default();
//! simulation.at(2.5, &mut string)?;
//! assert_eq!(string.len(), 4);
//! assert!((string.get(0).parameters[0] - 1.5).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod bed;
mod gauge;
mod looks;
mod nursery;
pub mod replay;
mod swaying;

pub use gauge::Detail;
pub use nursery::{DrawError, Nursery};
pub use swaying::{SwayReport, sways};

use std::cell::RefCell;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dlsys_compile::{Files, NoFiles, Setting};
use dlsys_diagnostic::{Diagnostic, Source};
use dlsys_model::{Measure, Model};
use dlsys_sim::{self as sim, Simulation};
use dlsys_surround::Place;
pub use dlsys_surround::Quilt;

/// A model that has been read and checked, with its text.
#[derive(Clone, Debug)]
pub struct Session {
    /// The text, including the texts that it includes; diagnostics refer to it.
    pub source: Source,
    /// The compiled model.
    pub model: Model,
    /// Warnings about the text.
    pub warnings: Vec<Diagnostic>,
    /// The files that were read: the model, unless its text came from memory, and the files that it names.
    pub inputs: Vec<Input>,
    /// The folders that were searched for these files.
    folders: Vec<PathBuf>,
}

/// Why a model, or a measure of it, cannot be read. It displays as all messages, as the program prints them.
#[derive(Debug)]
#[non_exhaustive]
pub struct LoadError {
    /// The text to which the diagnostics refer.
    pub source: Source,
    /// Errors and warnings about the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Errors in the settings, such as a value outside the range of its param.
    pub settings: Vec<Diagnostic>,
    /// The files that were read or searched for.
    pub inputs: Vec<Input>,
}

impl std::fmt::Display for LoadError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let settings = Source::new("settings", "");
        let texts = self.diagnostics.iter().map(|d| d.render(&self.source, false));
        let all: Vec<String> =
            texts.chain(self.settings.iter().map(|d| d.render(&settings, false))).collect();
        f.write_str(all.join("\n").trim_end())
    }
}

impl std::error::Error for LoadError {}

/// A file that was read or searched for, with its state just before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Its path, which need not exist.
    pub path: PathBuf,
    /// Time of the last change and length in bytes; `None` if it did not exist.
    state: Option<(SystemTime, u64)>,
}

impl Input {
    /// A file in its present state.
    pub fn now(path: &Path) -> Input {
        let state = std::fs::metadata(path).and_then(|found| Ok((found.modified()?, found.len()))).ok();
        Input { path: path.to_owned(), state }
    }

    /// Whether the file existed.
    pub fn is_there(&self) -> bool {
        self.state.is_some()
    }

    /// Whether the file has been changed, created or removed since.
    pub fn is_stale(&self) -> bool {
        Input::now(&self.path) != *self
    }
}

impl Session {
    /// Reads a model file. The files that it names (included texts, tables and surfaces) are searched for in its folder.
    ///
    /// # Errors
    /// The file cannot be read, its text is not a valid model, or a setting does not fit.
    pub fn open(path: &Path, settings: &[Setting]) -> Result<Session, Box<LoadError>> {
        Session::open_with(path, settings, &[])
    }

    /// Reads a model file. Files that it names and that are not in its folder are searched for in the other folders, in their
    /// order.
    ///
    /// # Errors
    /// As of [`Session::open`].
    pub fn open_with(
        path: &Path,
        settings: &[Setting],
        others: &[PathBuf],
    ) -> Result<Session, Box<LoadError>> {
        let name = path.display().to_string();
        let model = Input::now(path);
        let refuse = |source, diagnostic| {
            let inputs = vec![model.clone()];
            Box::new(LoadError { source, diagnostics: vec![diagnostic], settings: Vec::new(), inputs })
        };
        let bytes = read_whole(path, Source::LIMIT as u64).map_err(|error| {
            let diagnostic = Diagnostic::error(format!("the model cannot be read: {error}"))
                .help("give the path of a model's file, `NAME.dls`; `dlsys new NAME` makes one");
            refuse(Source::new(&name, ""), diagnostic)
        })?;
        let source = Source::from_bytes(name, bytes).map_err(|e| refuse(e.source, e.diagnostic))?;
        let folders = Folders::new(path.parent().unwrap_or(Path::new("")), others);
        folders.inputs.borrow_mut().push(model.clone());
        let read = Session::from_source(source, settings, &folders);
        folders.note(read)
    }

    /// Reads a model from memory; `name` stands for the file in messages. Files that it names are not found.
    ///
    /// # Errors
    /// As of [`Session::open`].
    pub fn from_text(name: &str, text: &str, settings: &[Setting]) -> Result<Session, Box<LoadError>> {
        Session::read_text(name, text, settings, &NoFiles)
    }

    fn read_text(
        name: &str,
        text: &str,
        settings: &[Setting],
        files: &dyn Files,
    ) -> Result<Session, Box<LoadError>> {
        let source = Source::from_bytes(name, text.as_bytes().to_vec()).map_err(|e| {
            Box::new(LoadError {
                source: e.source,
                diagnostics: vec![e.diagnostic],
                settings: Vec::new(),
                inputs: Vec::new(),
            })
        })?;
        Session::from_source(source, settings, files)
    }

    /// Reads a model from memory, as if it were a file in a folder; the files that it names are searched for there and in
    /// `others`. `name` stands for the file in messages.
    ///
    /// # Errors
    /// As of [`Session::open`].
    pub fn from_text_in(
        folder: &Path,
        others: &[PathBuf],
        name: &str,
        text: &str,
        settings: &[Setting],
    ) -> Result<Session, Box<LoadError>> {
        let folders = Folders::new(folder, others);
        let read = Session::read_text(name, text, settings, &folders);
        folders.note(read)
    }

    fn from_source(
        source: Source,
        settings: &[Setting],
        files: &dyn Files,
    ) -> Result<Session, Box<LoadError>> {
        let mut loaded = dlsys_compile::load_with(&source, settings, files);
        let source = loaded.source.unwrap_or(source);
        if let Some(Err(error)) = loaded.model.as_ref().map(dlsys_surround::bind) {
            loaded.model = None;
            loaded.diagnostics.insert(0, error.diagnostic());
        }
        match loaded.model {
            Some(model) => {
                Ok(Session { source, model, warnings: loaded.diagnostics, inputs: vec![], folders: vec![] })
            }
            None => Err(Box::new(LoadError {
                source,
                diagnostics: loaded.diagnostics,
                settings: loaded.refused_settings,
                inputs: Vec::new(),
            })),
        }
    }

    /// Reads a measure of this model's strings: `F(x): x` is the sum of x over all modules `F(x)`, and `F(x)`
    /// is their number. The expression may use the constants, params and functions of the model, `t` and `age`.
    ///
    /// # Errors
    /// The text is not a measure of this model.
    pub fn measure(&self, text: &str) -> Result<Measure, Box<LoadError>> {
        let values = self.model.parameters.iter();
        let settings: Vec<Setting> =
            values.map(|p| Setting { name: p.name.clone(), value: p.value }).collect();
        let source = Source::new("measure", text);
        let folders = Folders { paths: self.folders.clone(), inputs: RefCell::default() };
        let read = dlsys_compile::measure(&self.source, &folders, &settings, &self.model, &source);
        read.map_err(|errors| {
            let diagnostics = errors.into_diagnostics();
            Box::new(LoadError { source, diagnostics, settings: Vec::new(), inputs: Vec::new() })
        })
    }

    /// Starts the model at t = 0.
    ///
    /// # Errors
    /// A module of the initial string is outside its domain, or an equation has no finite value there.
    pub fn simulate(&self, settings: sim::Settings) -> Result<Simulation<'_>, sim::Error> {
        dlsys_surround::start(&self.model, settings, Place::of_scene(&self.model.scenery))
    }
}

/// The bytes of a file, or `limit + 1` bytes of a larger one.
///
/// # Errors
/// The file cannot be read, or is a device or a pipe, which might never end or never deliver a byte.
pub fn read_whole(path: &Path, limit: u64) -> std::io::Result<Vec<u8>> {
    let found = std::fs::metadata(path)?;
    if !found.is_file() && !found.is_dir() {
        let why = "it is no regular file, but a device, a pipe or the like";
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, why));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The folders from which a model may read files.
struct Folders {
    /// The first is the model's own.
    paths: Vec<PathBuf>,
    /// The files that were read or searched for.
    inputs: RefCell<Vec<Input>>,
}

impl Folders {
    fn new(own: &Path, others: &[PathBuf]) -> Folders {
        let own = if own.as_os_str().is_empty() { Path::new(".") } else { own };
        let paths = std::iter::once(own.to_owned()).chain(others.iter().cloned()).collect();
        Folders { paths, inputs: RefCell::default() }
    }

    /// Adds the inputs to a result.
    fn note(self, mut read: Result<Session, Box<LoadError>>) -> Result<Session, Box<LoadError>> {
        match &mut read {
            Ok(session) => (session.inputs, session.folders) = (self.inputs.into_inner(), self.paths),
            Err(refused) => refused.inputs = self.inputs.into_inner(),
        }
        read
    }

    /// The bytes of a file of one folder; `None` if there is none.
    fn read_from(&self, folder: &Path, path: &Path, limit: u64) -> Result<Option<Vec<u8>>, String> {
        let file = folder.join(path);
        self.inputs.borrow_mut().push(Input::now(&file));
        let failed = |error: std::io::Error| format!("{}: {error}", file.display());
        let real = match file.canonicalize() {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            real => real.map_err(failed)?,
        };
        // A link must not lead out of the folder.
        if !real.starts_with(folder.canonicalize().map_err(failed)?) {
            let whose = if *folder == *self.paths[0] { "the model's folder" } else { "its folder" };
            return Err(format!("{} leads out of {whose}", file.display()));
        }
        if !real.metadata().map_err(failed)?.is_file() {
            return Err(format!("{} is not a file", file.display()));
        }
        let mut bytes = Vec::new();
        std::fs::File::open(&real)
            .map_err(failed)?
            .take(limit + 1)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        if bytes.len() as u64 > limit {
            return Err(format!("{} has more than {} MB", file.display(), limit >> 20));
        }
        Ok(Some(bytes))
    }
}

impl Files for Folders {
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, String> {
        for folder in &self.paths {
            if let Some(bytes) = self.read_from(folder, path, limit)? {
                return Ok(bytes);
            }
        }
        let Some(own) = self.paths.first() else { return NoFiles.read(path, limit) };
        let others = if self.paths.len() > 1 { ", nor in the other folders" } else { "" };
        Err(format!("there is no file {}{others}", own.join(path).display()))
    }
}
