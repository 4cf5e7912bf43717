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
    /// Counts of work at each observed time that was reached.
    marks: Vec<Stats>,
}

impl Record {
    /// Observed times that were reached.
    pub fn reached(&self) -> usize {
        self.states.len()
    }

    /// The run up to the first `count` times, of those that it has reached: as if it had observed no others. Its wall time stays that of the whole.
    pub fn cut(&mut self, count: usize) {
        let Some(stats) = count.checked_sub(1).and_then(|last| self.marks.get(last)) else { return };
        (self.stats, self.stop) = (*stats, None);
        self.states.truncate(count);
        self.marks.truncate(count);
        let end = self.states.last().map_or(0.0, |state| state.time);
        self.events.truncate(self.events.partition_point(|event| event.time <= end));
    }

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
            marks: Vec::with_capacity(self.times.len()),
        };
        let (states, marks) = (&mut record.states, &mut record.marks);
        let (seconds, simulation, stop) = self.run(setup, log, |string, stats| {
            states.push(string.clone());
            marks.push(stats);
        });
        if let Some(mut simulation) = simulation {
            record.events = simulation.take_events();
            record.stats = simulation.stats();
        }
        (record.seconds, record.stop) = (seconds, stop);
        record
    }

    /// Wall time of a run in seconds; states are formed and dropped.
    pub fn time(&self, setup: Setup) -> f64 {
        self.run(setup, false, |_, _| ()).0
    }

    fn run(
        &self,
        setup: Setup,
        log: bool,
        mut see: impl FnMut(&ModuleString, Stats),
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
            see(&string, simulation.stats());
        }
        (driver.seconds(), Some(simulation), None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_is_cut_is_that_of_fewer_times() {
        let text = "initial string: A(0.1)\nA(x): if x < 1 solve dx/dt = x*(1 + 0.1*sin(t))\n if x = 1 produce A(0.5) [ A(0.3) ]";
        let session = Session::from_text("fork.dls", text, &[]).expect("good");
        let times: Vec<f64> = (1..=12).map(|i| 0.5 * f64::from(i)).collect();
        let setup = Setup { method: Method::Dop853, accuracy: Accuracy::Tolerance(1e-6) };
        let base = Settings { max_modules: 1000, ..Settings::default() };
        let of = |times| Task { session: &session, times, limit: 10.0, base }.record(setup, true);
        let (mut whole, part) = (of(&times), of(&times[..9]));
        assert!(whole.events.len() > part.events.len() && !part.events.is_empty());
        whole.cut(9);
        assert!(whole.is_same_run(&part) && whole.reached() == 9 && whole.stop.is_none());
        let events = |record: &Record| format!("{:?}", record.events);
        assert_eq!(events(&whole), events(&part));
    }
}
