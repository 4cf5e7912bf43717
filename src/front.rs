//! The main types of the library: a model, its run, the plant at a time, and its picture.

use std::fmt;
use std::path::{Path, PathBuf};

use dlsys_compile::Setting;
use dlsys_geometry::scene::Scene;
use dlsys_render::{Format, FrameWriter, Survey, View};
use dlsys_session::{DrawError, LoadError, Nursery, Session};
use dlsys_sim::{Settings, Simulation, describe};
use dlsys_tree::ModuleString;

/// A model that has been read and checked.
///
/// It holds the compiled rules and the text, which messages quote. Any number of [`Run`]s may develop it at the same
/// time.
#[derive(Clone, Debug)]
pub struct Model {
    session: Session,
}

impl Model {
    /// Reads a model file, and the files that it names.
    ///
    /// # Errors
    /// [`Error::Load`]: the file cannot be read, or its text is not a valid model.
    pub fn load(path: impl AsRef<Path>) -> Result<Model, Error> {
        Model::load_with(path, &[])
    }

    /// Reads a model file with other values for some of its `param`s.
    ///
    /// # Errors
    /// As of [`Model::load`]; also if the model has no such `param`, or the value is outside its range.
    pub fn load_with(path: impl AsRef<Path>, parameters: &[(&str, f64)]) -> Result<Model, Error> {
        Ok(Model { session: Session::open(path.as_ref(), &settings(parameters))? })
    }

    /// Reads a model from memory. It cannot name files.
    ///
    /// # Errors
    /// As of [`Model::load`].
    pub fn parse(text: &str) -> Result<Model, Error> {
        Ok(Model { session: Session::from_text("model", text, &[])? })
    }

    /// The title that the model gives itself.
    pub fn title(&self) -> Option<&str> {
        self.session.model.title.as_deref()
    }

    /// Warnings about the text, in the format in which the program prints them.
    pub fn warnings(&self) -> Vec<String> {
        self.session.warnings.iter().map(|warning| warning.render(&self.session.source, false)).collect()
    }

    /// The compiled model and its text, for use with the modules of this library.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Starts a run at t = 0 with tolerance 1e-6 and the other default [`Settings`].
    ///
    /// # Errors
    /// [`Error::Run`]: a module of the initial string is outside its domain, or an equation has no value there.
    pub fn run(&self) -> Result<Run<'_>, Error> {
        self.run_with(Settings::default())
    }

    /// Starts a run with other settings.
    ///
    /// # Errors
    /// As of [`Model::run`].
    pub fn run_with(&self, settings: Settings) -> Result<Run<'_>, Error> {
        let simulation = self.session.simulate(settings).map_err(|error| self.failed(error))?;
        Ok(Run { model: self, settings, simulation, string: ModuleString::default() })
    }

    fn failed(&self, error: dlsys_sim::Error) -> Error {
        let message = error.diagnostic().render(&self.session.source, false);
        Error::Run { error: Box::new(error), message }
    }
}

fn settings(parameters: &[(&str, f64)]) -> Vec<Setting> {
    parameters.iter().map(|&(name, value)| Setting { name: name.to_owned(), value }).collect()
}

/// A model in development.
#[derive(Clone)]
pub struct Run<'m> {
    model: &'m Model,
    settings: Settings,
    simulation: Simulation<'m>,
    string: ModuleString,
}

impl Run<'_> {
    /// The plant at time `t`, in the model's unit of time. At the time of an event it contains the successors. Times must not
    /// decrease from call to call ([`crate::replay`] can go back).
    ///
    /// # Errors
    /// [`Error::Run`]: the development up to `t` is undefined, or cannot be computed to the tolerance. Every further
    /// call returns the same error.
    pub fn at(&mut self, t: f64) -> Result<Plant<'_>, Error> {
        self.simulation.at(t, &mut self.string).map_err(|error| self.model.failed(error))?;
        Ok(Plant { model: self.model, settings: self.settings, string: &self.string })
    }
}

/// A plant at one time: a string of modules.
#[derive(Clone, Copy)]
pub struct Plant<'r> {
    model: &'r Model,
    settings: Settings,
    string: &'r ModuleString,
}

/// A module of a plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Module<'r> {
    /// Its name as in the model; a bracket is `[` or `]`.
    pub name: &'r str,
    /// Its parameters at this time.
    pub parameters: &'r [f64],
    /// The time since its production, or since t = 0, in the model's unit; 0 for a bracket.
    pub age: f64,
}

impl<'r> Plant<'r> {
    /// The time, in the model's unit.
    pub fn time(&self) -> f64 {
        self.string.time
    }

    /// Number of modules, brackets included.
    pub fn len(&self) -> usize {
        self.string.len()
    }

    /// True if the string has no modules.
    pub fn is_empty(&self) -> bool {
        self.string.len() == 0
    }

    /// The modules in the order of the string.
    pub fn modules(&self) -> impl Iterator<Item = Module<'r>> {
        let kinds = &self.model.session.model.kinds;
        self.string.iter().map(|module| Module {
            name: &kinds.get(module.kind).name,
            parameters: module.parameters,
            age: if module.kind.is_bracket() { 0.0 } else { module.age },
        })
    }

    /// The drawing of the turtle.
    ///
    /// # Errors
    /// [`Error::Draw`]: a length, an angle or a width is not finite, or the drawing is unbounded.
    pub fn scene(&self) -> Result<Scene, Error> {
        let nursery = Nursery::new(&self.model.session.model, self.settings);
        let mut scene = nursery.blank();
        nursery.draw(self.string, &mut scene)?;
        Ok(scene)
    }

    /// A picture or a mesh of the whole plant, seen from the front, as the bytes of a file.
    ///
    /// # Errors
    /// As of [`Plant::scene`].
    pub fn picture(&self, format: Format) -> Result<Vec<u8>, Error> {
        let scene = self.scene()?;
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        Ok(FrameWriter::new(format, survey.fit()).write(&scene, self.model.title().unwrap_or("a plant")))
    }

    /// Writes a picture into a file; the extension determines the format (`svg`, `png`, `obj`).
    ///
    /// # Errors
    /// As of [`Plant::picture`]; [`Error::Format`] for another extension, [`Error::Write`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let format = path.extension().unwrap_or_default().to_string_lossy().parse()?;
        let picture = self.picture(format)?;
        std::fs::write(path, picture).map_err(|error| Error::Write { path: path.to_owned(), error })
    }
}

/// The string in the notation of the language, with six digits: `F(1.5) [ + A(0.25) ]`.
impl fmt::Display for Plant<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for (place, module) in self.string.iter().enumerate() {
            let separator = if place == 0 { "" } else { " " };
            let shown = describe(&self.model.session.model, module.kind, module.parameters);
            write!(f, "{separator}{shown}")?;
        }
        Ok(())
    }
}

/// The error type of the library. It displays as the message that the program prints.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The model cannot be loaded.
    #[error(transparent)]
    Load(#[from] Box<LoadError>),
    /// The run ended with an error.
    #[error("{message}")]
    Run {
        /// The error, for programs.
        error: Box<dlsys_sim::Error>,
        /// The message, which quotes the model.
        message: String,
    },
    /// The plant cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// There is no such format.
    #[error(transparent)]
    Format(#[from] dlsys_render::Error),
    /// The file cannot be written.
    #[error("cannot write {}: {error}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: std::io::Error,
    },
}
