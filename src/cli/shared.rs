//! Arguments that several commands share: model, times, methods and limits.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::args::IncludeArgs;
use super::common::Failure;
use super::values::{
    bend_method, bend_tolerance, bytes, events, ground_rule, method, positive, seed, setting, time, tolerance,
};
use crate::compile::Setting;
use crate::interchange::Format;
use crate::sim::{BendMethod, BendSettings, GroundRule, Method, Settings};
use crate::study::method_name;

/// Limits of a run, so that a run that would not end stops with a message.
#[derive(Clone, Copy, Debug, Args)]
pub struct BudgetArgs {
    /// More modules than this are an error
    ///
    /// A number above 10 million also allows a frame to be drawn with so many, those of interpretations included.
    #[arg(long, value_name = "N", default_value_t = Settings::MODULES)]
    pub max_modules: usize,
    /// More productions and steps than this are an error, such as 1e12
    ///
    /// So is a run that hardly advances in time and would take a hundred times as many.
    #[arg(long, value_name = "N", default_value = "1e10", value_parser = events)]
    pub max_events: u64,
    /// A simulation that takes longer than this is an error [default: none does]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub max_seconds: Option<f64>,
    /// A simulation that needs more memory than this is an error, such as 500MB or 8GB [default: the memory of the
    /// system]
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub max_memory: Option<u64>,
}

impl BudgetArgs {
    /// Settings with these limits.
    pub fn settings(&self) -> Settings {
        Settings {
            max_modules: self.max_modules,
            max_events: self.max_events,
            max_seconds: self.max_seconds.unwrap_or(f64::INFINITY),
            max_memory: self.max_memory.unwrap_or(u64::MAX),
            ..Settings::default()
        }
    }
}

/// Flags that say how the equations of a model are solved, and with which random numbers.
#[derive(Clone, Copy, Debug, Args)]
pub struct SolverArgs {
    /// Target error of every parameter, relative to max(1, |value|)
    #[arg(long, value_name = "TOL", allow_negative_numbers = true, default_value = "1e-6", value_parser = tolerance)]
    pub tolerance: f64,
    /// Method of integration: auto, dopri5, dop853, radau, rk4, euler; all but auto integrate parameters with formulas, too
    #[arg(long, default_value = "auto", value_parser = method)]
    pub method: Method,
    /// Step of the methods with a fixed one (rk4, euler)
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = positive)]
    pub step_size: Option<f64>,
    /// Seed of random numbers, for models that draw them: the same seed gives the same plant
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value = "0", value_parser = seed)]
    pub seed: u64,
    /// Largest error of a step of stems that bend (`tissue`), relative to the size of the plant
    #[arg(long, value_name = "TOL", allow_negative_numbers = true, default_value = "1e-3", value_parser = bend_tolerance)]
    pub bend_tolerance: f64,
    /// Method of integration of stems that bend: ros2, ros34pw2 (faster below tolerances of about 1e-5), euler (for comparison)
    #[arg(long, value_name = "METHOD", default_value = "ros2", value_parser = bend_method)]
    pub bend_method: BendMethod,
    /// What moves soil that is too steep: law, or for comparison the rules of the papers: sumner, sandbox, li
    #[arg(long, value_name = "RULE", default_value = "law", value_parser = ground_rule)]
    pub ground_rule: GroundRule,
}

impl SolverArgs {
    /// Adds these flags to settings.
    ///
    /// # Errors
    /// A fixed step without its length, or a length of step for a method that chooses its own.
    pub fn apply(&self, settings: Settings) -> Result<Settings, Failure> {
        if self.method.is_fixed_step() && self.step_size.is_none() {
            return Err(Failure::Usage(
                "error: this method has a fixed step\n\n  = help: give its length, in the model's unit of time: `--step-size H`\n".to_owned(),
            ));
        }
        if let Some(h) = self.step_size.filter(|_| !self.method.is_fixed_step()) {
            return Err(Failure::Usage(format!(
                "error: `--step-size {h}` is for methods with a fixed step, and `{}` chooses its own\n\n  \
                 = help: say how accurate it has to be with `--tolerance TOL`, or choose `--method rk4` or `--method euler`\n",
                method_name(self.method)
            )));
        }
        Ok(Settings {
            method: self.method,
            tolerance: self.tolerance,
            step_size: self.step_size.unwrap_or(settings.step_size),
            seed: self.seed,
            bending: BendSettings { method: self.bend_method, tolerance: self.bend_tolerance },
            ground_rule: self.ground_rule,
            ..settings
        })
    }
}

/// How fast a film is: frames in a second, and units of the model's time, if that is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    pub frames: f64,
    pub speed: Option<f64>,
}

/// Flags of everything that runs a model.
#[derive(Debug, Args)]
pub struct SharedArgs {
    /// Model file (*.dls)
    pub model: PathBuf,
    /// Times to observe
    #[arg(long, value_name = "T1,T2,…", allow_negative_numbers = true, value_delimiter = ',', value_parser = time, conflicts_with_all = ["from", "to", "step"])]
    pub at: Option<Vec<f64>>,
    /// First of equidistant times to observe [default: the model's `frames`]
    #[arg(long, value_name = "A", allow_negative_numbers = true, value_parser = time)]
    pub from: Option<f64>,
    /// Last of them
    #[arg(long, value_name = "B", allow_negative_numbers = true, value_parser = time)]
    pub to: Option<f64>,
    /// Time between them
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub step: Option<f64>,
    /// What says the time between them if `step` does not.
    #[arg(skip)]
    pub rate: Option<Rate>,
    /// Set a `param` of the model; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting)]
    pub settings: Vec<Setting>,
    #[command(flatten)]
    pub include: IncludeArgs,
    #[command(flatten)]
    pub solver: SolverArgs,
    /// Scheduler of modules that read their neighbours
    #[arg(long, value_enum, default_value_t = Scheduler::Auto)]
    pub scheduler: Scheduler,
    /// Length of the slices of time of the scheduler `local`; its error is of that order
    #[arg(long, value_name = "DT", allow_negative_numbers = true, value_parser = positive)]
    pub slice: Option<f64>,
    #[command(flatten)]
    pub budget: BudgetArgs,
    /// Write times and counts of work as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Write every production that takes place, up to the last observed time, as a line of JSON; - is standard output
    ///
    /// In the order of time. Fields: t; group, the same number for simultaneous events; lineage and id of the module
    /// that was replaced, and its name, module; rule, its head; clause, which `produce` of the rule, from 1; successor,
    /// where a clause has several, which of them, from 1; line of that clause in the model; residual, by how much the two sides of an `=` differ at the located instant (null if
    /// that is not finite). An error at t = 0 leaves the file empty, a later one leaves what happened before it.
    #[arg(long, value_name = "FILE")]
    pub events: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Scheduler {
    /// After an event, only as many neighbours as the tolerance requires are integrated again
    Auto,
    /// One clock for all modules, cut at every event: the reference
    Global,
    /// Neighbours are constant during a slice of time (--slice): the paper's approximation
    Local,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Topology {
    /// A prim for each module; shapes are interpolated between samples
    Constant,
    /// A mesh for each material, whose triangles change from frame to frame, with velocities
    Varying,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RunFormat {
    /// Text for reading
    Text,
    /// One JSON object per time, each on a line
    Json,
    /// One animated file for other programs, glTF 2.0 binary: a node for each module that draws, with -o FILE
    Glb,
    /// The same for programs that take USD (Blender, Houdini), in text
    Usda,
}

impl RunFormat {
    /// The format of text, or of a file of geometry.
    pub fn of_text(self) -> Result<TextFormat, Format> {
        match self {
            RunFormat::Text => Ok(TextFormat::Text),
            RunFormat::Json => Ok(TextFormat::Json),
            RunFormat::Glb => Err(Format::Glb),
            RunFormat::Usda => Err(Format::Usda),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TextFormat {
    /// Text for reading
    Text,
    /// One JSON object; for `run`, one per time, each on a line
    Json,
}
