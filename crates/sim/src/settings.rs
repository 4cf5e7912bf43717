//! Settings of a run, and the statistics of its work.

use crate::Method;
use crate::flow::next_grid_time;
use dlsys_tree::SimTime;

/// Rates of events that have no formula are integrated with at most this tolerance, so that their times are the same to
/// nine digits whatever the tolerance is.
const CLOCK_TOLERANCE: f64 = 1e-11;

/// The modules that are integrated again after an event, among those that are integrated together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scheduler {
    /// As many of the neighbours as the tolerance requires.
    #[default]
    Auto,
    /// All: one clock, and time is cut at every event. The reference.
    Global,
    /// None: equations see their neighbours as they were at the start of the slice of time, or at the module's last
    /// event in it. The approximation that the paper makes for speed (section 5); its error is of the order of the
    /// slice.
    Local {
        /// Length of a slice, in units of time; slices end at its multiples.
        slice: f64,
    },
}

/// A method by which stems that bend are advanced in time; the crate `dlsys-sway` describes them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BendMethod {
    /// ROS2: order 2, two solutions with one matrix a step.
    #[default]
    Ros2,
    /// ROS34PW2: order 3, four stages; for small tolerances.
    Ros34Pw2,
    /// The implicit Euler method: order 1, for comparison.
    Euler,
}

impl BendMethod {
    /// The methods with their names on the command line.
    pub const NAMED: [(&'static str, BendMethod); 3] =
        [("ros2", BendMethod::Ros2), ("ros34pw2", BendMethod::Ros34Pw2), ("euler", BendMethod::Euler)];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        BendMethod::NAMED.iter().find(|(_, method)| *method == self).map_or("", |(name, _)| name)
    }
}

/// How the surroundings of a simulation are computed: stems that bend in the wind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BendSettings {
    /// The method.
    pub method: BendMethod,
    /// Largest error of a step: displacement of any point of the stems, relative to the longest path along them.
    pub tolerance: f64,
}

impl Default for BendSettings {
    /// ROS2 with a tolerance of 1e-3.
    fn default() -> BendSettings {
        BendSettings { method: BendMethod::Ros2, tolerance: 1e-3 }
    }
}

/// What moves soil that is too steep; the crate `dlsys-ground` describes the rules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GroundRule {
    /// The conservative law of slipping.
    #[default]
    Law,
    /// Erosion of Sumner, O'Brien, Hodgins 1999, for comparison.
    Sumner,
    /// Erosion of Onoue, Nishita 2003, for comparison.
    Sandbox,
    /// Slices of Li, Moshell 1993, made stable, for comparison.
    Li,
}

impl GroundRule {
    /// The rules with their names on the command line.
    pub const NAMED: [(&'static str, GroundRule); 4] = [
        ("law", GroundRule::Law),
        ("sumner", GroundRule::Sumner),
        ("sandbox", GroundRule::Sandbox),
        ("li", GroundRule::Li),
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        GroundRule::NAMED.iter().find(|(_, rule)| *rule == self).map_or("", |(name, _)| name)
    }
}

/// How a simulation is run.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The integration method; `Auto` uses closed forms where there are any.
    pub method: Method,
    /// The treatment of coupled modules at events.
    pub scheduler: Scheduler,
    /// Error aimed at in every parameter at every time, relative to max(1, |value|).
    pub tolerance: f64,
    /// Step of the methods that have a fixed one, in units of time. Steps end at its multiples.
    pub step_size: f64,
    /// The seed of all random numbers.
    pub seed: u64,
    /// More modules than this are an error.
    pub max_modules: usize,
    /// More productions and steps than this are an error; so is a run that is foreseen to need a hundred times as many, at
    /// a pace that hardly brings time on.
    pub max_events: u64,
    /// The last time that will be asked for, if that is known: what a run needs is foreseen up to there, whatever time is asked for
    /// first. Results do not depend on it.
    pub horizon: f64,
    /// More seconds than this, spent in calls of the simulation, are an error. Infinite by default.
    pub max_seconds: f64,
    /// More bytes of memory than this, of the process as a whole where the system tells them, are an error. By
    /// default only as much as the system does not have.
    pub max_memory: u64,
    /// Threads that compute the lives of modules that read no others, and make the common steps of those that do. Results do not depend on it.
    pub threads: usize,
    /// Modules from which on threads share them: the lives of fewer are computed, and their steps made, before threads have begun
    /// (differential tests).
    #[doc(hidden)]
    pub threads_from: usize,
    /// Productions are recorded for [`Simulation::take_events`].
    pub log: bool,
    /// Disables the fast path (differential tests).
    #[doc(hidden)]
    pub slow: bool,
    /// With `log`: the change that each production makes is recorded, too ([`Event::transition`]). Every event then costs work
    /// for all modules whose rules have a context.
    pub transitions: bool,
    /// How stems that bend are followed. Growth that reads nothing of them does not depend on it.
    pub bending: BendSettings,
    /// By which rule soil slips. Growth that reads nothing of it does not depend on it.
    pub ground_rule: GroundRule,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            method: Method::Auto,
            scheduler: Scheduler::Auto,
            tolerance: 1e-6,
            step_size: 0.01,
            seed: 0,
            max_modules: Settings::MODULES,
            max_events: Settings::EVENTS,
            horizon: f64::NEG_INFINITY,
            max_seconds: f64::INFINITY,
            max_memory: u64::MAX,
            threads: 1,
            threads_from: 1 << 14,
            log: false,
            slow: false,
            transitions: false,
            bending: BendSettings::default(),
            ground_rule: GroundRule::default(),
        }
    }
}

impl Settings {
    /// Default limit of modules, so large that only a run without end exceeds it.
    pub const MODULES: usize = 10_000_000;
    /// Default limit of productions and steps.
    pub const EVENTS: u64 = 10_000_000_000;

    /// For equations that decide by chance: there is no tolerance in when an event happens that has no time of its own.
    pub(crate) fn for_clocks(&self, has_clocks: bool) -> Settings {
        match has_clocks {
            true => Settings { tolerance: self.tolerance.min(CLOCK_TOLERANCE), ..*self },
            false => *self,
        }
    }

    /// True if neighbours are seen as they were at the start of a slice of time.
    pub(crate) fn is_sliced(&self) -> bool {
        matches!(self.scheduler, Scheduler::Local { .. })
    }

    /// The end of the slice of time after an instant, if there are slices.
    pub(crate) fn slice_end(&self, after: SimTime) -> Option<SimTime> {
        match self.scheduler {
            Scheduler::Local { slice } => Some(SimTime::new(next_grid_time(after, slice))),
            _ => None,
        }
    }
}

/// Work done by a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Stats {
    /// Productions applied.
    pub events: u64,
    /// Steps accepted.
    pub steps: u64,
    /// Steps tried again with a smaller size.
    pub rejected: u64,
    /// Evaluations of the equations of one module.
    pub rhs_evaluations: u64,
    /// Modules alive, brackets not counted.
    pub modules: u64,
    /// Most modules that were alive at once.
    pub peak_modules: u64,
    /// Rules whose rates could not be bounded somewhere: [`Simulation::remarks`].
    pub unbounded: u64,
}
