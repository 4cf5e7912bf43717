//! Command-line arguments.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use super::fmt::FmtArgs;
use super::new::NewArgs;
use super::render::args::RENDER_EXAMPLES;
pub use super::render::args::RenderArgs;
use super::shared::Topology;
use super::shared::{BudgetArgs, RunFormat, SharedArgs, SolverArgs, TextFormat};
use super::shell::{self, CompletionsArgs, ManArgs};
use super::values::{
    Seeds, bend_tolerance, figure, frame_format, limit, mass, method, positive, runs, seeds, setting,
    threads, time, tolerance,
};
use super::verify::VerifyArgs;
use crate::compile::Setting;
use crate::render::Format;
use crate::sim::Method;

/// Differential L-systems: plants as growing strings of modules, whose parameters follow differential
/// equations and whose productions fire when a trajectory reaches the boundary of its domain.
#[derive(Debug, Parser)]
#[command(name = "dlsys", version, propagate_version = true)]
pub struct Command {
    #[command(subcommand)]
    pub action: Action,
    /// Show the progress of long work on standard error even if that is not a terminal: a line every 5 seconds
    #[arg(long, global = true)]
    pub progress: bool,
}

#[derive(Debug, Subcommand)]
pub enum Action {
    /// Write a small commented model, NAME.dls; an existing file is never overwritten
    New(NewArgs),
    /// Read a model and report errors and warnings, without running it
    Check(CheckArgs),
    /// Lay out model files canonically; comments, line breaks and meaning stay the same
    ///
    /// A declaration or rule begins in the first column, clauses are indented by 2, lines that continue a clause
    /// by 4. Binary + - < = & | have spaces around them, * / ^ none; in strings of modules one space or none,
    /// as written. A file that does not parse stays as it is. A file is replaced as a whole or not at all.
    Fmt(FmtArgs),
    /// Print how each equation and each condition of a model is solved (with the method `auto`), and why
    #[command(after_long_help = EXPLAIN_JSON)]
    Explain(ExplainArgs),
    /// Run a model and print its strings of modules, or write its growth as one animated file
    #[command(after_long_help = RUN_EXAMPLES)]
    Run(Box<RunArgs>),
    /// Run a model and draw it: a file for each frame, or all frames on one sheet
    #[command(after_long_help = RENDER_EXAMPLES)]
    Render(Box<RenderArgs>),
    /// Look at a growing plant in a window, or write a page for the browser that plays its growth
    ///
    /// The window plays, goes to any time, and rotates; it has a slider for each param with a range, reads the model again when
    /// it is saved, and shows errors. It is available if dlsys was built with `--features viewer`.
    ///
    /// With -o FILE: a page, one file that needs no network, with orbit, timeline, productions and the values of its params.
    View(ViewArgs),
    /// Draw the paper's figures that show development, from the models that come with the program
    ///
    /// Each figure is made by a `dlsys render` command; --list prints the commands. Writes a folder for each picture,
    /// the models, and index.html, which shows all pictures.
    Gallery(GalleryArgs),
    /// Compare methods on models: errors, wall times, counts of work; or run the hard cases
    ///
    /// Each model is run by each method at each tolerance or step size. The error is the largest over all
    /// times and parameters, relative to max(1, |value|), against the closed form if there is one, or the
    /// run of another method with the tightest tolerance, whose own error is shown. Different productions, orders of
    /// productions or modules are reported with the first difference; the error is then that before it. Wall
    /// times are medians of several runs, one at a time; the spread is half the distance from the fastest to
    /// the slowest. The observed order is the slope of error against step size or, for methods with step
    /// control, against evaluations of the right-hand side.
    ///
    /// Each method has an equal part of --budget; points that do not fit are left out, and the report says so.
    ///
    /// For a model with tissues, a second table has the error of drawn positions against work, for each method and tolerance
    /// of bending.
    ///
    /// With --hard, models that state their exact answers in their first lines are run and checked.
    Report(ReportArgs),
    /// Print a script that completes commands and flags in a shell
    #[command(after_long_help = shell::WHERE, after_help = shell::WHERE)]
    Completions(CompletionsArgs),
    /// Print a manual page: `dlsys man > dlsys.1`, `dlsys man render | man -l -`
    Man(ManArgs),
    /// Write, run, inspect and change a model interactively
    ///
    /// Type declarations and rules as in a model file, and commands: run, step, back, show, inspect, plot, draw, export …;
    /// `help` lists them. Without a terminal the lines of standard input are executed in order; the exit status is 1 if
    /// one of them fails. The history is kept in $XDG_STATE_HOME/dlsys (or ~/.local/state/dlsys).
    Repl(ReplArgs),
}

impl Action {
    /// Fills in what follows from several flags.
    pub fn complete(&mut self) {
        if let Action::Render(args) = self {
            args.format = (args.chosen_format)
                .or_else(|| super::render::one_picture::format_of(&args.out))
                .unwrap_or_default();
            args.shared.rate = super::render::pace::of(args);
        }
        if let Action::Run(args) = self
            && args.format == RunFormat::Text
            && let Some(extension) = args.file.out.as_deref().and_then(|out| out.extension())
        {
            args.format = match extension.to_str() {
                Some("glb") => RunFormat::Glb,
                Some("usda") => RunFormat::Usda,
                _ => RunFormat::Text,
            };
        }
    }
}

/// A string, a distribution, a file that other programs play.
const RUN_EXAMPLES: &str = "\
Examples:
  dlsys run models/anabaena.dls --at 1,2
      the string of modules at two times
  dlsys run models/birch.dls --seeds 1..100 --measure 'F(x): x' --at 14
      the distribution of a length over a hundred specimens
  dlsys run models/lychnis.dls --format glb -o lychnis.glb
      the growing plant as one file for Blender, Godot, Unity, three.js";

/// The fields of `explain --format json`.
const EXPLAIN_JSON: &str = "\
JSON fields:
  kinds       a list of
    name, arity
    work        no rules | at rest | formulas | alone | coupled
    rules       positions in the list `rules`
    drawn_only  parameters that only drawing reads
  rules       a list of
    head, line, kinds
    solves      a list of line, condition, parameters; of these
      name, reads (what its rate depends on), why
      class       constant | closed form | local | coupled and linear | coupled
      law         form of the solution, or null
    produces    a list of line, condition
    conditions  a list of boundary, line, decides (clause, line), and
      found       for each `solve`: its line, why, and
        class       nothing to find | never met | closed-form time
                    | root on a closed form | root on dense output
  curves      a list of name, sort (linear | monotone | spline), points,
              from, to (arguments), least, greatest (values), periodic,
              inverse (it rises throughout, or falls throughout)
  scene       if declared, a list of part, class, why
  bending     with tissues: t, ticks (steps of the clock up to t), wind (m/s), and
    axes        a list of kinds, tissue, depth (brackets), count, measured; as least and greatest
                values in SI: segments, length, width, mass, carried,
                frequency, damping, cauchy, greenhill
  falling     with `@D`: a list of plant, t, and
    parts       a list of kind, shape (plate | lump), count; as least and greatest values
                in SI: mass, size, speed (of falling), ratio (I* of plates)
  summary     kinds by work; closed_form: nothing is ever integrated";

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Model file (*.dls)
    pub model: PathBuf,
    /// Set a `param` of the model; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting)]
    pub settings: Vec<Setting>,
    #[command(flatten)]
    pub include: IncludeArgs,
    /// Also run the model and report the productions at which the drawing (C0) or its speed (C1) jumps
    ///
    /// At every production, the predecessor just before and its successor just after are drawn from the same turtle and
    /// compared: the position and the direction (heading and roll) in which the
    /// turtle leaves, the total drawn length, and the speeds of all three. Surfaces count with their size as length;
    /// widths and colours do not count. Direction counts only if something drawn follows. Several productions
    /// in succession at one instant are taken together. Jumps are relative to the larger of both sides, or to
    /// a thousandth of the largest in the whole run. A production at t = 0 has no speed before it.
    #[arg(long)]
    pub continuity: bool,
    /// With --continuity: the time up to which the model is run [default: the end of its `frames`]
    #[arg(long, value_name = "T", value_parser = time, requires = "continuity")]
    pub to: Option<f64>,
    /// With --continuity: smaller relative jumps are ignored (for angles: in radians)
    #[arg(long, value_name = "TOL", allow_negative_numbers = true, default_value = "1e-6", value_parser = tolerance, requires = "continuity")]
    pub tolerance: f64,
    /// With --continuity: exit with status 1 if a production makes a jump of this order or lower. Without this flag
    /// a jump is reported but is not an error
    #[arg(long, value_enum, requires = "continuity")]
    pub deny: Option<Order>,
    #[command(flatten)]
    pub budget: BudgetArgs,
}

/// Further folders for files that a model names.
#[derive(Debug, Args)]
pub struct IncludeArgs {
    /// Search this folder for files that a model names (`include`, `table`, `surface`) and that are not in its own folder;
    /// can be repeated
    #[arg(long = "include-path", value_name = "DIR")]
    pub folders: Vec<PathBuf>,
}

/// Orders of continuity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Order {
    /// Of positions, directions and lengths
    C0,
    /// Of these and of their speeds
    C1,
}

#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// Model file (*.dls)
    pub model: PathBuf,
    /// Set a `param` of the model; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting)]
    pub settings: Vec<Setting>,
    #[command(flatten)]
    pub include: IncludeArgs,
    /// Output format; JSON is one object, with `kinds`, `rules` and `summary`
    #[arg(long, value_enum, default_value_t = TextFormat::Text)]
    pub format: TextFormat,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub shared: SharedArgs,
    #[command(flatten)]
    pub verify: VerifyArgs,
    /// Instead of running the model, sample its wind at the places of a CSV file; - is standard input
    ///
    /// The first line of the file is `x,y,z`, or `t,x,y,z` for places with times of their own; without t every place is
    /// sampled at every observed time. Places and times are in units of the model. As text: CSV with the columns
    /// t,x,y,z,u,v,w; as JSON: a line for each sample with these fields. u, v and w are the velocity of the air along x, y and z in m/s.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["seeds", "events", "stats", "verify"])]
    pub field: Option<PathBuf>,
    /// Output format of strings, measures or samples; or `glb`, `usda`: the growth as one animated file (with -o) [default: that of the file that -o names, or text]
    #[arg(long, value_enum, default_value_t = RunFormat::Text, hide_default_value = true)]
    pub format: RunFormat,
    #[command(flatten)]
    pub file: FileArgs,
    /// Run specimens with these seeds, both ends included, and print the distributions of their measures at each
    /// time
    ///
    /// As text: number of specimens, mean, sample standard deviation,
    /// quantiles (interpolated linearly between the two nearest values). As JSON: one line for each specimen, in the order of seeds, with
    /// seed, t (the times), and for each measure its values at these times.
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with_all = ["seed", "events", "stats", "verify"])]
    pub seeds: Option<Seeds>,
    /// A measure of each specimen: 'F(x): x' is the sum of x over all modules F(x), 'F(x)' their number; can be
    /// repeated [default: the number of all modules]
    #[arg(long = "measure", value_name = "HEAD: EXPR", requires = "seeds")]
    pub measures: Vec<String>,
    /// Write the distributions of the measures as CSV; - is standard output
    #[arg(long, value_name = "FILE", requires = "seeds")]
    pub csv: Option<PathBuf>,
    /// Draw the distributions of the measures over time as SVG: median, mean, bands of 50 and 90 per cent of specimens
    #[arg(long, value_name = "FILE", requires = "seeds")]
    pub plot: Option<PathBuf>,
    /// Number of specimens run at once, or of threads that compute and draw, with no effect on the results [default: one for each core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,
}

/// Flags of `run` that are for files of whole animations.
#[derive(Debug, Args)]
pub struct FileArgs {
    /// With --format glb or usda: the file, such as plant.glb, or a folder for it
    #[arg(short, long = "out", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// With --format glb or usda: largest distance of anything in the file from its place in the model, at any time, in scene units
    /// [default: 1/2000 of the extent of the whole animation]
    #[arg(long, value_name = "L", allow_negative_numbers = true, value_parser = positive)]
    pub accuracy: Option<f64>,
    /// With --format glb or usda: units of the model's time in a second of the animation [default: 1, or, with `units … time S`, 1/S]
    #[arg(long, value_name = "V", allow_negative_numbers = true, value_parser = positive)]
    pub speed: Option<f64>,
    /// With --format usda: whether meshes keep their triangles. varying: a mesh for each material whose triangles change from frame to frame, with velocities
    #[arg(long, value_enum, default_value_t = Topology::Constant)]
    pub topology: Topology,
    /// With --format glb or usda: write over a file of another kind
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub shared: SharedArgs,
    /// Write a page for the browser, such as plant.html, instead of opening a window
    #[arg(short, long = "out", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write a picture (PNG) of the window, when all is in it, and close it
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    pub screenshot: Option<PathBuf>,
    /// Wait for so many seconds before that
    #[arg(long, value_name = "S", value_parser = positive, conflicts_with = "out", hide = true)]
    pub delay: Option<f64>,
    /// Move this slider, wait for the picture, and say how long it took; can be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting, conflicts_with = "out", hide = true)]
    pub slide: Vec<Setting>,
    /// Play for so many seconds and say how many pictures a second there were
    #[arg(long, value_name = "S", value_parser = positive, conflicts_with = "out", hide = true)]
    pub play: Option<f64>,
    /// Largest distance of the drawing from a curved surface, in scene units [default: 1/2000 of the extent of the
    /// whole animation]
    ///
    /// Applies to stems and Bézier patches, with at most 4096 sides of a stem and 64 pieces on an edge of a patch. The leaf
    /// @L, the flower @K and meshes from files are not subdivided.
    #[arg(long, value_name = "L", value_parser = positive, requires = "out")]
    pub accuracy: Option<f64>,
    /// Write over a file that is not a page of dlsys
    #[arg(long, requires = "out")]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct GalleryArgs {
    /// Directory for the pictures; made if it is not there
    #[arg(short, long = "out", value_name = "DIR", required_unless_present = "list")]
    pub out: Option<PathBuf>,
    /// Draw this figure only; can be repeated
    #[arg(long = "figure", value_name = "N", value_parser = figure)]
    pub figures: Vec<u8>,
    /// File format of the pictures: svg or png
    #[arg(long, value_parser = frame_format(), default_value = Format::SVG.extension())]
    pub format: Format,
    /// Print the lines, draw nothing
    #[arg(long)]
    pub list: bool,
}

#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Model files (*.dls)
    #[arg(value_name = "MODEL", required_unless_present_any = ["hard", "surroundings"], conflicts_with_all = ["hard", "surroundings"])]
    pub models: Vec<PathBuf>,
    /// Directory for NAME.csv, NAME.json and the plot NAME.svg, with tissues also NAME-stems.csv (with --hard: hard.csv,
    /// hard.json; with --surroundings: surroundings.csv; with --coupling: NAME-coupling.csv, NAME-coupling.json); made if it is not there
    #[arg(short, long = "out", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Methods to compare, in this order [default: all; with --hard those that each case names]
    #[arg(long, value_name = "M1,M2,…", value_delimiter = ',', value_parser = method)]
    pub methods: Option<Vec<Method>>,
    /// Tolerances of methods with step control [default: each decade from 1e-3 to 1e-11; with --hard those
    /// that each case names]
    #[arg(long, value_name = "TOL1,TOL2,…", value_delimiter = ',', value_parser = tolerance)]
    pub tolerances: Option<Vec<f64>>,
    /// Step sizes of methods with a fixed step [default: ten powers of two, from about 1/64 of the last time;
    /// fourteen for euler]
    #[arg(long, value_name = "H1,H2,…", value_delimiter = ',', value_parser = positive, conflicts_with = "hard")]
    pub step_sizes: Option<Vec<f64>>,
    /// Slices of time of `--scheduler local`, whose error is measured where modules read their neighbours [default: ten
    /// powers of two, as step sizes]
    #[arg(long, value_name = "DT1,DT2,…", allow_negative_numbers = true, value_delimiter = ',', value_parser = positive, conflicts_with = "hard")]
    pub slices: Option<Vec<f64>>,
    /// Times at which to compare [default: the model's `frames`, at most 50 of them]
    #[arg(long, value_name = "T1,T2,…", allow_negative_numbers = true, value_delimiter = ',', value_parser = time, conflicts_with_all = ["from", "to", "step", "hard"])]
    pub at: Option<Vec<f64>>,
    /// First of equidistant times at which to compare
    #[arg(long, value_name = "A", allow_negative_numbers = true, value_parser = time, requires = "to", requires = "step", conflicts_with = "hard")]
    pub from: Option<f64>,
    /// Last of them
    #[arg(long, value_name = "B", allow_negative_numbers = true, value_parser = time, requires = "from")]
    pub to: Option<f64>,
    /// Time between them
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive, requires = "from")]
    pub step: Option<f64>,
    /// Set a `param` of every model; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting, conflicts_with = "hard")]
    pub settings: Vec<Setting>,
    #[command(flatten)]
    pub include: IncludeArgs,
    /// Timed runs of each point, of which the median is shown; fewer where they take more than 0.2 seconds, or where there is no time
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = runs)]
    pub runs: usize,
    /// Seconds for the points of all methods, an equal part for each; points that do not fit are left out, and it is said how long they
    /// would take. What --tolerances, --step-sizes and --slices list is measured in any case. The runs that all are compared with come on top: where one would
    /// take longer than a third of S, the report ends at an earlier time, and says so, unless times or points are listed. What bends, falls or gives way has S seconds more
    #[arg(long = "budget", value_name = "S", allow_negative_numbers = true, default_value = "4", value_parser = positive)]
    pub study_budget: f64,
    /// Seconds that a run may take; a point that would take longer, judged from the one before, is left out
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value = "10", value_parser = positive)]
    pub time_limit: f64,
    #[command(flatten)]
    pub budget: BudgetArgs,
    /// Instead of the study: compute everything again in an independent way, as `dlsys run --verify` does, at each tolerance,
    /// with the method `auto` or those of --methods. Exit status 1 if something differs by more than 100 tolerances
    #[arg(long, conflicts_with_all = ["hard", "out", "step_sizes", "slices"])]
    pub verify: bool,
    /// Run the hard cases: all *.dls files of a directory, or, without one, those that are built in. Exit
    /// status 1 if any fails
    #[arg(long, value_name = "DIR", num_args = 0..=1)]
    pub hard: Option<Option<PathBuf>>,
    /// Exact cases of the wind, of stems that bend, of bodies that fall, of gases, of sheets and of ground (statistics of turbulence, beams, buckling, vibrations, flutter, landing, energy, light, membranes, contact, heaps)
    /// with errors and orders, hard cases, error against work of the implicit methods, and speed. Exit status 1 if a statistic is out of its bound or a hard case fails
    #[arg(long, conflicts_with_all = ["hard", "verify", "methods", "tolerances", "step_sizes", "slices", "at", "from", "settings"])]
    pub surroundings: bool,
    /// Instead of the study: forces and accelerations by sheets on the solids of a model, what one-way, two-way and hybrid coupling cost in time and
    /// in error of the solids' motion, and which of them serves, as in the decision tree of O'Brien, Zordan and Hodgins; also what stems do to what holds them
    #[arg(long, conflicts_with_all = ["hard", "surroundings", "verify", "methods", "tolerances", "step_sizes", "slices"])]
    pub coupling: bool,
    /// With --coupling, the mass in kg of the solids of a name whose rules read no force: it tells accelerations, and what both ways would do; can be repeated
    #[arg(long = "mass", value_name = "NAME=KG", value_parser = mass, requires = "coupling")]
    pub masses: Vec<(String, f64)>,
    /// With --coupling, the value of a `param` that takes the stand-in for a passive part out of the rules of a hybrid model; can be repeated
    #[arg(long = "without", value_name = "NAME=VALUE", value_parser = setting, requires = "coupling")]
    pub without: Vec<Setting>,
    /// With --coupling, a limit of the decision; can be repeated. Accelerations below `negligible` (1 m/s²) are, and so are those below `overwhelmed` (0.1) of
    /// all others, and motions that differ by less than `unseen` (0.05) of the size; a sheet may be stretched by `stretch` (0.3), and both ways may take `patience` (60 s)
    #[arg(long = "limit", value_name = "NAME=VALUE", value_parser = limit, requires = "coupling")]
    pub limits: Vec<(String, f64)>,
    /// Largest error of a step of stems and sheets with --coupling, relative to the extent
    #[arg(long, value_name = "TOL", allow_negative_numbers = true, default_value = "1e-3", value_parser = bend_tolerance, requires = "coupling")]
    pub bend_tolerance: f64,
    /// With --hard, run only the case of this name; can be repeated
    #[arg(long = "case", value_name = "ID")]
    pub cases: Vec<String>,
}

#[derive(Debug, Args)]
pub struct ReplArgs {
    /// Model file (*.dls) to begin with
    pub model: Option<PathBuf>,
    /// Set a `param` of the model; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting, requires = "model")]
    pub settings: Vec<Setting>,
    #[command(flatten)]
    pub include: IncludeArgs,
    #[command(flatten)]
    pub solver: SolverArgs,
    #[command(flatten)]
    pub budget: BudgetArgs,
    /// Print each line before its answer, as on a terminal; for transcripts
    #[arg(long)]
    pub echo: bool,
}
