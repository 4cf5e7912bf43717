//! From a file to a running simulation: the pipeline that every front end uses.
//!
//! # Examples
//!
//! ```
//! use dlsys_session::Session;
//! use dlsys_sim::Settings;
//!
//! let text = "initial string: F(1)\nF(x): if x < 2 solve dx/dt = 1\n if x = 2 produce F(1) F(1)";
//! let session = Session::from_text("doubling.dls", text, &[]).expect("the model is good");
//! let mut simulation = session.simulate(Settings::default()).expect("it starts");
//! let mut string = Default::default();
//! simulation.at(2.5, &mut string).expect("it runs");
//! assert_eq!(string.len(), 4);
//! assert!((string.get(0).parameters[0] - 1.5).abs() < 1e-12);
//! ```

pub mod replay;

use std::cell::RefCell;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dlsys_compile::{Files, NoFiles, Setting};
use dlsys_diagnostic::{Diagnostic, Source};
use dlsys_model::{Measure, Model};
use dlsys_sim::{self as sim, Simulation};

/// A model that was read, with its text.
#[derive(Clone, Debug)]
pub struct Session {
    pub source: Source,
    pub model: Model,
    /// What there is to say about the text though it runs.
    pub warnings: Vec<Diagnostic>,
    /// The files that were read: the model, unless it came from memory, and what it names.
    pub inputs: Vec<Input>,
    /// Where these files were looked for.
    folders: Vec<PathBuf>,
}

/// Why a model cannot be loaded. As text: all messages, as the program prints them.
#[derive(Debug)]
#[non_exhaustive]
pub struct LoadError {
    pub source: Source,
    /// What is wrong with the text.
    pub diagnostics: Vec<Diagnostic>,
    /// What is wrong with the settings.
    pub settings: Vec<Diagnostic>,
    /// The files that were read, or looked for.
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

/// A file that was read or looked for, and what it was like just before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    pub path: PathBuf,
    /// When it was changed last, and its length; `None` if it was not there.
    state: Option<(SystemTime, u64)>,
}

impl Input {
    /// A file as it is now.
    pub fn now(path: &Path) -> Input {
        let state = std::fs::metadata(path).and_then(|found| Ok((found.modified()?, found.len()))).ok();
        Input { path: path.to_owned(), state }
    }

    /// Whether it was there.
    pub fn is_there(&self) -> bool {
        self.state.is_some()
    }

    /// Whether the file is another by now: changed, made or removed.
    pub fn is_stale(&self) -> bool {
        Input::now(&self.path) != *self
    }
}

impl Session {
    /// Reads a model file. What it names, included texts, tables and surfaces, is looked for in its folder.
    ///
    /// # Errors
    /// What is wrong with the file, its text or the settings.
    pub fn open(path: &Path, settings: &[Setting]) -> Result<Session, Box<LoadError>> {
        Session::open_with(path, settings, &[])
    }

    /// Reads a model file. What it names and what is not in its folder is looked for in others, in their order.
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
        let source = Source::from_bytes(name, bytes).map_err(|e| refuse(e.0, e.1))?;
        let folders = Folders::new(path.parent().unwrap_or(Path::new("")), others);
        folders.inputs.borrow_mut().push(model.clone());
        let read = Session::from_source(source, settings, &folders);
        folders.note(read)
    }

    /// Takes a model's text from memory; `name` stands for the file in messages. Surfaces that it names are
    /// not found.
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
                source: e.0,
                diagnostics: vec![e.1],
                settings: Vec::new(),
                inputs: Vec::new(),
            })
        })?;
        Session::from_source(source, settings, files)
    }

    /// Takes a model's text from memory; the files that it names come from a folder, as if the text were a file there, or
    /// from `others`. `name` stands for the file in messages.
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
        let loaded = dlsys_compile::load_with(&source, settings, files);
        let source = loaded.source.unwrap_or(source);
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

    /// Reads what is to be measured of this model's strings: `F(x): x` is the sum of x over all modules `F(x)`, and `F(x)`
    /// is their number. It may use the constants, params and functions of the model, `t` and `age`.
    ///
    /// # Errors
    /// The messages, to be drawn with the returned source.
    pub fn measure(&self, text: &str) -> Result<Measure, (Source, Vec<Diagnostic>)> {
        let values = self.model.parameters.iter();
        let settings: Vec<Setting> =
            values.map(|p| Setting { name: p.name.clone(), value: p.value }).collect();
        let source = Source::new("measure", text);
        let folders = Folders { paths: self.folders.clone(), inputs: RefCell::default() };
        let read = dlsys_compile::measure(&self.source, &folders, &settings, &self.model, &source);
        read.map_err(|said| (source, said.into_diagnostics()))
    }

    /// Starts the model at t = 0.
    pub fn simulate(&self, settings: sim::Settings) -> Result<Simulation<'_>, sim::Error> {
        Simulation::new(&self.model, settings)
    }
}

/// The bytes of a file, or one more than the limit of a larger one. Only files are read: a device has no end, and a pipe may
/// never have a beginning.
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

/// The folder of a model and others, with the files that it may read.
struct Folders {
    /// The model's own is the first.
    paths: Vec<PathBuf>,
    /// What was asked for.
    inputs: RefCell<Vec<Input>>,
}

impl Folders {
    fn new(own: &Path, others: &[PathBuf]) -> Folders {
        let own = if own.as_os_str().is_empty() { Path::new(".") } else { own };
        let paths = std::iter::once(own.to_owned()).chain(others.iter().cloned()).collect();
        Folders { paths, inputs: RefCell::default() }
    }

    /// Puts what was read into what came of it.
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
        // A link must not lead out of the folder either.
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
