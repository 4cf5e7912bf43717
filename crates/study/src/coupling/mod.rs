//! How the passive parts of a scene are best coupled with its active ones (O'Brien, Zordan, Hodgins, *Combining Active and Passive Simulations for
//! Secondary Motion*, IEEE Transactions on Visualization and Computer Graphics 6, 2000).
//!
//! ```text
//! Model ──reading──▶ coupling that it has
//! Model ──trials, in lock step──▶ forces and accelerations (table I), cost and error of each coupling ──decide (figure 17)──▶ coupling that serves
//! ```
//!
//! - `reading`: which solids read forces, which equations may hold a stand-in.
//! - `runs`: the model both ways, one way and, with a stand-in, as it is written; what is measured on the way.
//! - `decide`: the questions of figure 17 with the measured numbers.
//! - `text`, `data`: all of it for a terminal, as CSV and as JSON.

mod data;
mod decide;
mod reading;
mod runs;
mod text;

use std::collections::BTreeMap;
use std::time::Instant;

use dlsys_geometry::turtle;
use dlsys_model::{Model, Quantity};
use dlsys_sim::{Settings, Simulation};
use dlsys_surround::{CLOCK, Motion, Passive, Place, Weather};

pub use data::{coupling_csv, coupling_json};
pub use decide::{Decision, Question, Thresholds};
pub use reading::has_feedback;
pub use text::coupling_text;

/// One of the three couplings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Coupling {
    /// The active part does not feel the passive one.
    OneWay,
    /// The active part feels a stand-in that the model's equations hold, and leads the passive one.
    Hybrid,
    /// Equal and opposite forces.
    TwoWay,
}

impl Coupling {
    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Coupling::OneWay => "one-way",
            Coupling::Hybrid => "hybrid",
            Coupling::TwoWay => "two-way",
        }
    }
}

/// What is to be measured.
#[derive(Clone, Debug)]
pub struct CouplingPlan<'a> {
    /// The last time, in units of the model.
    pub until: f64,
    /// Settings of all runs.
    pub settings: Settings,
    /// Seconds that each run may take at least; it may take as many as the limit of patience.
    pub time_limit: f64,
    /// Masses in kg of solids whose rules read no force, by the names of their modules.
    pub masses: BTreeMap<String, f64>,
    /// The same model without the stand-in that its equations hold.
    pub without: Option<&'a Model>,
    /// Limits of the decision.
    pub thresholds: Thresholds,
}

/// Least, largest and mean of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The least.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// The mean.
    pub mean: f64,
}

/// What a passive part did to the solids of one name in one run: a row of table I.
#[derive(Clone, Debug)]
pub struct Row {
    /// The name of the modules that draw the solids.
    pub active: String,
    /// The name of the sheet; `None` for the sum of all, where several touch.
    pub passive: Option<String>,
    /// The mass in kg of the sheets of that name.
    pub passive_mass: f64,
    /// The coupling of the run.
    pub coupling: Coupling,
    /// Seconds of contact, added up over the solids.
    pub touching: f64,
    /// Magnitude of the force in N, mean of each tick in which they touch.
    pub force: Range,
    /// Magnitude of the acceleration in m/s² that it causes, or would cause, if the mass is known.
    pub acceleration: Option<Range>,
}

/// How far the solids of one name are from where the most accurate two-way run has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// At most, in m.
    pub most: f64,
    /// At the end, in m.
    pub end: f64,
}

/// A run with one coupling.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The coupling.
    pub coupling: Coupling,
    /// It is the one that the model has.
    pub is_own: bool,
    /// Seconds of computing, growth included.
    pub seconds: f64,
    /// Steps of the sheets that were accepted, and rejected.
    pub steps: [u64; 2],
    /// The largest stretch of an edge or cord of any sheet: its length relative to that at rest, less 1.
    pub stretch: f64,
    /// Distances from the reference, by the name of the modules; empty without a reference.
    pub apart: BTreeMap<String, Apart>,
    /// Why it did not come to its end, and the time in units of the model that it reached.
    pub failed: Option<(String, f64)>,
}

/// The solids of one name.
#[derive(Clone, Debug)]
pub struct Active {
    /// The name of their modules.
    pub name: String,
    /// Number of modules that were touched in some run.
    pub count: usize,
    /// Their size in m.
    pub size: f64,
    /// The mass in kg: measured from the equations, or given.
    pub mass: Option<f64>,
    /// The mass is that of equations that read forces.
    pub is_measured: bool,
    /// The coupling that the equations have.
    pub coupling: Coupling,
    /// The equations hold a force that depends on place or velocity, or change with them; that may be a stand-in.
    pub has_feedback: bool,
    /// Magnitude of the acceleration (m/s²) that growth itself gives them, without the passive parts, in the ticks in which they touch.
    pub own: Option<Range>,
    /// The decision.
    pub decision: Decision,
}

/// The feet of the stems that modules of one name draw.
#[derive(Clone, Debug)]
pub struct Feet {
    /// The name of the modules.
    pub name: String,
    /// Magnitude of the moment in N m that the stems pass on.
    pub moment: Range,
    /// The largest bending strain at the feet.
    pub strain: f64,
    /// The names of the modules of the model whose rules read `strain`.
    pub readers: Vec<String>,
}

/// All that is measured of a model.
#[derive(Clone, Debug)]
pub struct CouplingStudy {
    /// The title of the model, or the name of its file.
    pub title: String,
    /// The last time, in units of the model, and the number of ticks of the sheets.
    pub until: f64,
    /// Number of ticks.
    pub ticks: u64,
    /// The rows of table I.
    pub rows: Vec<Row>,
    /// The active parts.
    pub actives: Vec<Active>,
    /// Seconds of computing of growth alone.
    pub alone: f64,
    /// The runs.
    pub trials: Vec<Trial>,
    /// The tolerance of the run with which the others are compared, relative to the extent of a sheet.
    pub reference: Option<f64>,
    /// Stems.
    pub feet: Vec<Feet>,
    /// What is not measured, and why.
    pub notes: Vec<String>,
    /// Limits of the decision.
    pub thresholds: Thresholds,
}

/// Why a model cannot be studied.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CouplingError {
    /// Nothing passive acts back on anything.
    #[error("nothing passive in it touches an active part: it places no sheet, and no stem of it gives way{}", also(.notes))]
    NothingPassive {
        /// Passive parts whose forces are not measured.
        notes: Vec<String>,
    },
    /// Sheets, but nothing that they could touch.
    #[error("nothing is `solid`, so the sheets touch nothing that is active")]
    NothingSolid,
    /// No contact.
    #[error("no solid touches a sheet up to t = {until}")]
    NoContact {
        /// The last time.
        until: f64,
    },
    /// A mass of something that is not solid.
    #[error("there is no solid `{name}`; {}", known(.solids))]
    NoSuchSolid {
        /// The name.
        name: String,
        /// Those that there are.
        solids: Vec<String>,
    },
    /// A mass of what has one.
    #[error("the rules of `{name}` read the force on it, so its mass follows from its equations")]
    MassIsKnown {
        /// The name.
        name: String,
    },
    /// A model both ways has no stand-in.
    #[error("its rules read forces: it is two-way, and has no stand-in")]
    NoStandIn,
    /// Growth, or a part of the scene.
    #[error(transparent)]
    Surroundings(#[from] Box<dlsys_surround::Error>),
}

impl CouplingError {
    /// What to do about it.
    pub fn help(&self) -> Option<&'static str> {
        Some(match self {
            CouplingError::NothingPassive { .. } => "declare a `sheet` or a `tissue`, and what is `solid`",
            CouplingError::NothingSolid => "name the modules that touch them: `solid NAME`",
            CouplingError::NoContact { .. } => {
                "run it longer with `--at T`, or see with `dlsys view` where the solid goes"
            }
            CouplingError::NoSuchSolid { .. } => {
                "give the mass as `--mass NAME=KG`, with the name of a `solid` module"
            }
            CouplingError::MassIsKnown { .. } => "leave out its `--mass`",
            CouplingError::NoStandIn => "leave out `--without`",
            CouplingError::Surroundings(_) => return None,
        })
    }
}

fn also(notes: &[String]) -> String {
    notes.iter().map(|note| format!("\n  {note}")).collect()
}

fn known(solids: &[String]) -> String {
    match solids {
        [] => "nothing is solid".to_owned(),
        _ => format!("solid are {}", solids.join(", ")),
    }
}

/// Measures a model and decides. `say` is called with what is being done, and the part of it that is done.
///
/// # Errors
/// Nothing passive, nothing that touches it, masses of what has none, and all errors of growth and of the parts of the scene that are not those of one coupling.
pub fn coupling_study(
    model: &Model,
    title: &str,
    plan: &CouplingPlan,
    say: &mut dyn FnMut(&str, f64),
) -> Result<CouplingStudy, CouplingError> {
    let (drapes, bends) = (turtle::drapes(model), turtle::bends(model));
    let notes = reading::notes(model);
    if !drapes && !bends {
        return Err(CouplingError::NothingPassive { notes });
    }
    reading::check(model, plan)?;
    if drapes && !bends && model.scenery.solids.is_empty() {
        return Err(CouplingError::NothingSolid);
    }
    let (until, thresholds) = (plan.until, plan.thresholds);
    let feet = if bends { feet(model, plan, say)? } else { Vec::new() };
    let mut study = CouplingStudy {
        title: title.to_owned(),
        until,
        ticks: 0,
        rows: Vec::new(),
        actives: Vec::new(),
        alone: 0.0,
        trials: Vec::new(),
        reference: None,
        feet,
        notes,
        thresholds,
    };
    if drapes && !model.scenery.solids.is_empty() {
        say("growth alone", 0.0);
        study.alone = alone(model, plan)?;
        runs::run(model, plan, &mut study, say)?;
        if study.actives.is_empty() && study.feet.is_empty() {
            return Err(CouplingError::NoContact { until });
        }
    }
    Ok(study)
}

/// Seconds that growth takes without sheets.
fn alone(model: &Model, plan: &CouplingPlan) -> Result<f64, CouplingError> {
    let growth = |error: dlsys_sim::Error| Box::new(dlsys_surround::Error::from(error));
    let begun = Instant::now();
    let mut simulation = match model.reads_force() {
        true => Simulation::new(model, plan.settings),
        false => dlsys_surround::start(model, plan.settings, Place::of_scene(&model.scenery)),
    }
    .map_err(growth)?;
    simulation.pass(plan.until).map_err(growth)?;
    Ok(begun.elapsed().as_secs_f64())
}

/// Follows stems, and measures what they do to their feet.
fn feet(
    model: &Model,
    plan: &CouplingPlan,
    say: &mut dyn FnMut(&str, f64),
) -> Result<Vec<Feet>, CouplingError> {
    let place = Place::of_scene(&model.scenery);
    let weather = Weather::of(model, plan.settings).map_err(Box::new)?;
    let passive = Passive { marks: false, kept: 0, ..Passive::of(plan.settings.bending) };
    let motion = Motion::new(model, plan.settings, weather, place, passive).map_err(Box::new)?;
    let Some(motion) = motion else { return Ok(Vec::new()) };
    let mut found: BTreeMap<String, (runs::Sum, f64)> = BTreeMap::new();
    let end = plan.until * model.scenery.units.time;
    let mut tick = 0_u64;
    loop {
        let time = tick as f64 * CLOCK;
        if time > end {
            break;
        }
        if tick.is_multiple_of(30) {
            say("stems", time / end.max(CLOCK));
        }
        motion.advance(time).map_err(Box::new)?;
        for foot in motion.feet() {
            let (sum, strain) = found.entry(model.kinds.get(foot.kind).name.clone()).or_default();
            sum.add(foot.moment, 1.0);
            *strain = strain.max(foot.strain);
        }
        tick += 1;
    }
    let read = model.kinds.iter().filter(|(_, kind)| kind.input_parameter(Quantity::Strain).is_some());
    let readers: Vec<String> = read.map(|(_, kind)| kind.name.clone()).collect();
    let feet = found.into_iter().filter_map(|(name, (moment, strain))| {
        Some(Feet { name, moment: moment.range()?, strain, readers: readers.clone() })
    });
    Ok(feet.collect())
}
