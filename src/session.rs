//! From a file to a running simulation: the pipeline that every front end uses.
//!
//! ```
//! use dlsys::session::Session;
//! use dlsys::sim::Settings;
//!
//! let text = "initial string: F(1)\nF(x): if x < 2 solve dx/dt = 1\n if x = 2 produce F(1) F(1)";
//! let session = Session::from_text("doubling.dls", text, &[]).expect("the model is good");
//! let mut simulation = session.simulate(Settings::default()).expect("it starts");
//! let mut string = Default::default();
//! simulation.at(2.5, &mut string).expect("it runs");
//! assert_eq!(string.len(), 4);
//! assert!((string.get(0).parameters[0] - 1.5).abs() < 1e-12);
//! ```

use std::path::Path;

use crate::diagnostic::{Diagnostic, Source};
use crate::lang::{self, Setting};
use crate::model::Model;
use crate::sim::{self, Simulation};

/// A model that was read, with its text.
#[derive(Debug)]
pub struct Session {
    pub source: Source,
    pub model: Model,
    /// What there is to say about the text though it runs.
    pub warnings: Vec<Diagnostic>,
}

/// Why there is no session.
#[derive(Debug)]
pub struct Refused {
    pub source: Source,
    /// What is wrong with the text.
    pub diagnostics: Vec<Diagnostic>,
    /// What is wrong with the settings.
    pub settings: Vec<Diagnostic>,
}

impl Session {
    /// Reads a model file.
    pub fn open(path: &Path, settings: &[Setting]) -> Result<Session, Box<Refused>> {
        let name = path.display().to_string();
        let refuse = |source, diagnostic| {
            Box::new(Refused { source, diagnostics: vec![diagnostic], settings: Vec::new() })
        };
        let bytes = std::fs::read(path).map_err(|error| {
            let diagnostic = Diagnostic::error(format!("the model cannot be read: {error}"));
            refuse(Source::new(&name, ""), diagnostic)
        })?;
        let source = Source::from_bytes(name, bytes).map_err(|e| refuse(e.0, e.1))?;
        Session::from_source(source, settings)
    }

    /// Takes a model's text from memory; `name` stands for the file in messages.
    pub fn from_text(name: &str, text: &str, settings: &[Setting]) -> Result<Session, Box<Refused>> {
        let bytes = text.as_bytes().to_vec();
        let source = Source::from_bytes(name, bytes)
            .map_err(|e| Box::new(Refused { source: e.0, diagnostics: vec![e.1], settings: Vec::new() }))?;
        Session::from_source(source, settings)
    }

    fn from_source(source: Source, settings: &[Setting]) -> Result<Session, Box<Refused>> {
        let loaded = lang::load(&source, settings);
        match loaded.model {
            Some(model) => Ok(Session { source, model, warnings: loaded.diagnostics }),
            None => Err(Box::new(Refused {
                source,
                diagnostics: loaded.diagnostics,
                settings: loaded.refused_settings,
            })),
        }
    }

    /// Starts the model at t = 0.
    pub fn simulate(&self, settings: sim::Settings) -> Result<Simulation<'_>, sim::Error> {
        Simulation::new(&self.model, settings)
    }
}
