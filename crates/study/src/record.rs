//! One run of a model, with its states, productions and counts of work.

use std::time::Instant;

use dlsys_session::Session;
use dlsys_sim::{self as sim, Event, Method, Scheduler, Settings, Simulation, Stats, brief};
use dlsys_tree::ModuleString;

/// The setting that determines the accuracy of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// Error aimed at, relative to max(1, |value|).
    Tolerance(f64),
    /// Fixed step, in units of the model's time.
    StepSize(f64),
    /// Slice of time of the scheduler `local`, in the same units.
    Slice(f64),
}

impl Accuracy {
    /// The number, without its meaning.
    pub fn value(self) -> f64 {
        match self {
            Accuracy::Tolerance(x) | Accuracy::StepSize(x) | Accuracy::Slice(x) => x,
        }
    }

    /// `tolerance`, `step_size` or `slice`, as in files.
    pub fn key(self) -> &'static str {
        match self {
            Accuracy::Tolerance(_) => "tolerance",
            Accuracy::StepSize(_) => "step_size",
            Accuracy::Slice(_) => "slice",
        }
    }
}

impl std::fmt::Display for Accuracy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Accuracy::Tolerance(x) => write!(f, "{x:e}"),
            Accuracy::StepSize(x) | Accuracy::Slice(x) if *x < 1e-3 => write!(f, "{x:.2e}"),
            Accuracy::StepSize(x) | Accuracy::Slice(x) => write!(f, "{}", brief(*x, 5)),
        }
    }
}

/// A method and its accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// The method of integration.
    pub method: Method,
    /// Its tolerance, step size or slice.
    pub accuracy: Accuracy,
}

impl Setup {
    fn settings(self, base: Settings) -> Settings {
        let mut settings = Settings { method: self.method, ..base };
        match self.accuracy {
            Accuracy::Tolerance(x) => settings.tolerance = x,
            Accuracy::StepSize(x) => settings.step_size = x,
            Accuracy::Slice(slice) => settings.scheduler = Scheduler::Local { slice },
        }
        settings
    }
}

impl std::fmt::Display for Setup {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = match self.accuracy {
            Accuracy::Tolerance(_) => "tolerance",
            Accuracy::StepSize(_) => "step",
            Accuracy::Slice(slice) => return write!(f, "local at slice {slice}"),
        };
        write!(f, "{} at {what} {}", method_name(self.method), self.accuracy)
    }
}

/// The name that a method has on the command line.
pub fn method_name(method: Method) -> &'static str {
    method.name()
}

/// Why a run ended before its last time.
#[derive(Clone, Debug)]
pub enum EarlyEnd {
    /// The run ended with an error.
    Error(sim::Error),
    /// The run was stopped because it took too long.
    Overtime {
        /// Time reached, in the model's unit.
        t: f64,
        /// Allowed wall time in seconds.
        limit: f64,
    },
}

impl std::fmt::Display for EarlyEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EarlyEnd::Error(error) => write!(f, "{error}"),
            EarlyEnd::Overtime { t, limit } => {
                write!(f, "stopped after {} s, at t = {}", brief(*limit, 3), brief(*t, 6))
            }
        }
    }
}

/// The result of a run.
#[derive(Clone, Debug)]
pub struct Record {
    /// The string at each observed time that was reached.
    pub states: Vec<ModuleString>,
    /// All productions, in the order of time; empty if they were not logged.
    pub events: Vec<Event>,
    /// Counts of work.
    pub stats: Stats,
    /// Wall time from the initial string to the last state, in seconds.
    pub seconds: f64,
    /// Why the run ended before its last time; `None` if it did not.
    pub stop: Option<EarlyEnd>,
}

impl Record {
    /// True if two runs agree in every number, because two names chose the same method.
    pub fn is_same_run(&self, other: &Record) -> bool {
        let same_state = |a: &ModuleString, b: &ModuleString| {
            a.len() == b.len()
                && a.iter().zip(b.iter()).all(|(m, n)| m.kind == n.kind && m.parameters == n.parameters)
        };
        self.stats == other.stats
            && self.states.len() == other.states.len()
            && self.states.iter().zip(&other.states).all(|(a, b)| same_state(a, b))
    }
}

/// A model, and the times and limits of its runs.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The model.
    pub session: &'a Session,
    /// Times to observe, increasing.
    pub times: &'a [f64],
    /// Seconds after which a run is stopped.
    pub limit: f64,
    /// Settings of all runs but for method and accuracy, such as limits.
    pub base: Settings,
}

/// Advances a simulation, and stops it when it takes too long.
pub(super) struct Driver {
    start: Instant,
    /// Allowed wall time in seconds.
    limit: f64,
    /// Last time of the run.
    end: f64,
    /// Time reached.
    t: f64,
    /// Modules of strings formed only to check the wall time.
    looked: usize,
}

/// Number of checks of the wall time during a run, at equal intervals of simulated time.
const LOOKS: f64 = 64.0;
/// No more checks once they have formed this many modules, because they would distort the timing.
const MOST_LOOKED: usize = 100_000;

impl Driver {
    pub fn new(limit: f64, end: f64) -> Driver {
        Driver { start: Instant::now(), limit, end, t: 0.0, looked: 0 }
    }

    /// Wall time so far.
    pub fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Advances to a time and forms the string there. The checks on the way change no result.
    pub fn go(
        &mut self,
        simulation: &mut Simulation<'_>,
        t: f64,
        string: &mut ModuleString,
    ) -> Result<(), EarlyEnd> {
        let looks = ((t - self.t) / self.end * LOOKS).ceil().max(1.0) as usize;
        for i in 1..=looks {
            if i < looks && self.looked > MOST_LOOKED {
                continue;
            }
            let then = if i == looks { t } else { self.t + (t - self.t) * (i as f64 / looks as f64) };
            simulation.at(then, string).map_err(EarlyEnd::Error)?;
            self.looked += if i < looks { string.len() } else { 0 };
            if self.seconds() > self.limit && then < self.end {
                return Err(EarlyEnd::Overtime { t: then, limit: self.limit });
            }
        }
        self.t = t;
        Ok(())
    }
}

impl<'a> Task<'a> {
    /// Last time to observe; 0 if there is none.
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Runs, and keeps all states; with `log`, also all productions.
    pub fn record(&self, setup: Setup, log: bool) -> Record {
        let mut record = Record {
            states: Vec::with_capacity(self.times.len()),
            events: Vec::new(),
            stats: Stats::default(),
            seconds: 0.0,
            stop: None,
        };
        let states = &mut record.states;
        let (seconds, simulation, stop) = self.run(setup, log, |string| states.push(string.clone()));
        if let Some(mut simulation) = simulation {
            record.events = simulation.take_events();
            record.stats = simulation.stats();
        }
        (record.seconds, record.stop) = (seconds, stop);
        record
    }

    /// Wall time of a run in seconds; states are formed and dropped.
    pub fn time(&self, setup: Setup) -> f64 {
        self.run(setup, false, |_| ()).0
    }

    fn run(
        &self,
        setup: Setup,
        log: bool,
        mut see: impl FnMut(&ModuleString),
    ) -> (f64, Option<Simulation<'a>>, Option<EarlyEnd>) {
        let mut driver = Driver::new(self.limit, self.end());
        let settings = Settings { log, ..setup.settings(self.base) };
        let mut simulation = match self.session.simulate(settings) {
            Ok(simulation) => simulation,
            Err(error) => return (driver.seconds(), None, Some(EarlyEnd::Error(error))),
        };
        let mut string = ModuleString::default();
        for &t in self.times {
            if let Err(stop) = driver.go(&mut simulation, t, &mut string) {
                return (driver.seconds(), Some(simulation), Some(stop));
            }
            see(&string);
        }
        (driver.seconds(), Some(simulation), None)
    }
}
