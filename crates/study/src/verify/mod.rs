//! Is a run right? The model is run again by an independent way, and both runs are compared: every parameter of every
//! module at every observed time, and every production.
//!
//! ```text
//! the settings in question ──same times──▶ strings, productions ─┐
//! another method, a tighter tolerance,                           ├─parameters, productions──▶ Verification ──table──▶ text
//!   one clock, no short cuts ──same times──▶ strings, productions ┘
//! ```
//!
//! Both runs go on side by side, so that only two strings are in memory. A difference in structure is never turned into a
//! number. Differences do not say which of the two is wrong, but one of them is.

mod parameters;
mod productions;
mod table;

pub use parameters::Gap;
pub use productions::{Pair, Productions, Split};
pub use table::{complaint, unverified, verification_rows, verification_table};

use std::time::Instant;

use parameters::Parameters;
use productions::Matching;
use table::way;

use super::error::Error;
use super::record::EarlyEnd;
use super::reference::TIGHTEST;
use dlsys_session::Session;
use dlsys_sim::{Method, Passed, Scheduler, Settings, Simulation};
use dlsys_tree::{Module, ModuleString};

/// The promised accuracy of a run, in tolerances.
pub const PROMISED: f64 = 100.0;

/// The tolerance of the run in question divided by that of the other one, whose promised accuracy is then one tolerance.
const TIGHTER: f64 = 100.0;

/// The part of the time limit that each method gets before any gets the whole: an explicit method would take hours for
/// stiff equations.
const FIRST_GO: f64 = 0.1;

/// The result of a comparison.
#[derive(Clone, Debug)]
pub struct Verification {
    /// Settings of the run in question.
    pub checked: Settings,
    /// Settings of the run with which it is compared.
    pub other: Settings,
    /// Settings that were tried before, and why each run ended.
    pub refused: Vec<(Settings, EarlyEnd)>,
    /// Whether both runs used Radau's method, because `auto` found the equations stiff.
    pub has_same_method: bool,
    /// Last observed time.
    pub end: f64,
    /// Number of observed times.
    pub times: usize,
    /// Number of times at which both runs have the same modules, so that parameters could be compared.
    pub compared: usize,
    /// The largest difference for each parameter of each kind of module.
    pub parameters: Vec<Gap>,
    /// Comparison of the productions.
    pub productions: Productions,
    /// The first time at which the modules differ although all productions agree, with the numbers of modules.
    pub modules: Option<(f64, usize, usize)>,
}

impl Verification {
    /// A relative difference in units of the tolerance.
    pub fn in_tolerances(&self, error: f64) -> f64 {
        error / self.checked.tolerance
    }

    /// The parameter that differs most.
    pub fn worst(&self) -> Option<&Gap> {
        self.parameters.iter().max_by(|a, b| a.error.total_cmp(&b.error))
    }

    /// True if everything was compared, and nothing differs by more than is promised.
    pub fn passes(&self) -> bool {
        let is_near = |error: Option<f64>| self.in_tolerances(error.unwrap_or(0.0)) <= PROMISED;
        self.productions.split.is_none()
            && self.modules.is_none()
            && self.compared == self.times
            && is_near(self.worst().map(|gap| gap.error))
            && is_near(self.productions.worst.as_ref().map(Pair::error))
    }
}

/// Runs a model with other methods until one reaches the last of the times, which must increase, and compares. `limit` is
/// the allowed wall time of each in seconds. `watch` is called before each run with a description of it.
///
/// # Errors
/// [`Error::Run`] if the run in question ends with an error, [`Error::NoOtherMethod`] if no other one reaches the last time.
///
/// # Examples
///
/// ```
/// use dlsys_session::Session;
/// use dlsys_sim::{Method, Settings};
/// use dlsys_study::verify;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let text = "initial string: C(0.25)\nC(x): if x < 0.5 solve dx/dt = x*(1 - x)\n if x = 0.5 produce C(x/2) C(x/2)";
/// let session = Session::from_text("cells.dls", text, &[])?;
/// let good = verify(&session, Settings::default(), &[1.0, 2.0, 3.0], 10.0, &mut |_| ())?;
/// assert!(good.passes() && good.productions.ours == 3);
///
/// let euler = Settings { method: Method::Euler, step_size: 0.1, ..Settings::default() };
/// let bad = verify(&session, euler, &[1.0, 2.0, 3.0], 10.0, &mut |_| ())?;
/// assert!(!bad.passes());
/// # Ok(())
/// # }
/// ```
pub fn verify(
    session: &Session,
    checked: Settings,
    times: &[f64],
    limit: f64,
    watch: &mut dyn FnMut(&str),
) -> Result<Verification, Error> {
    let mut refused: Vec<(Settings, EarlyEnd)> = Vec::new();
    let mut ways: Vec<(Settings, Option<EarlyEnd>)> =
        other_ways(&checked).into_iter().map(|way| (way, None)).collect();
    for part in [FIRST_GO, 1.0] {
        for (other, stop) in &mut ways {
            // What took too long may come to its end in a longer time; a refusal stays one.
            if matches!(stop, Some(EarlyEnd::Error(_))) {
                continue;
            }
            watch(&format!("verifying by {}", way(other)));
            match side_by_side(session, checked, *other, times, part * limit)? {
                Ok(found) => return Ok(Verification { refused, ..found }),
                Err(why) => {
                    refused.retain(|(known, _)| known.method != other.method);
                    refused.push((*other, why.clone()));
                    *stop = Some(why);
                }
            }
        }
    }
    Err(Error::NoOtherMethod(refused))
}

/// Ways that have as little as possible in common with the one in question, the best first: another method, which
/// integrates what has formulas, too; a tighter tolerance; one clock for all modules; and no short cuts.
fn other_ways(checked: &Settings) -> Vec<Settings> {
    // `auto` is both of Dormand and Prince's pairs, and Radau's method only where it must.
    let methods = match checked.method {
        Method::Auto => [Method::Radau, Method::Dop853],
        Method::Dop853 => [Method::Radau, Method::Dopri5],
        Method::Radau => [Method::Dop853, Method::Dopri5],
        _ => [Method::Dop853, Method::Radau],
    };
    // 1e-7, not 1.0000000000000001e-7.
    let tighter = checked.tolerance / TIGHTER;
    let tolerance = format!("{tighter:.12e}").parse().unwrap_or(tighter).max(TIGHTEST);
    let way = |method| Settings {
        method,
        scheduler: Scheduler::Global,
        tolerance,
        slow: true,
        log: true,
        transitions: false,
        ..*checked
    };
    methods.map(way).into()
}

/// Compares two ways. The inner error: the other one did not come to the end.
fn side_by_side(
    session: &Session,
    checked: Settings,
    other: Settings,
    times: &[f64],
    limit: f64,
) -> Result<Result<Verification, EarlyEnd>, Error> {
    let checked = Settings { log: true, transitions: false, ..checked };
    let mut ours = session.simulate(checked)?;
    let mut theirs = match Limited::start(session, other, limit) {
        Ok(theirs) => theirs,
        Err(stop) => return Ok(Err(stop)),
    };
    let mut string = ModuleString::default();
    let slack = |t: f64| PROMISED * checked.tolerance * t.abs().max(1.0);
    let (mut parameters, mut matching) = (Parameters::new(&session.model), Matching::default());
    let (mut compared, mut modules) = (0, None);
    for &t in times {
        ours.at(t, &mut string)?;
        if let Err(stop) = theirs.go(t) {
            return Ok(Err(stop));
        }
        matching.add(ours.take_events(), theirs.simulation.take_events());
        if same_modules(&string, &theirs.string) {
            parameters.compare_all(&string, &theirs.string);
            compared += 1;
        } else if matching.waits_only_since(t - slack(t)) {
            // What takes place about now may show already, or not yet.
            parameters.compare_common(&string, &theirs.string);
            compared += 1;
        } else if !matching.waits() && modules.is_none() {
            modules = Some((t, count(&string), count(&theirs.string)));
        }
    }
    let end = times.last().copied().unwrap_or(0.0);
    Ok(Ok(Verification {
        checked,
        other,
        refused: Vec::new(),
        has_same_method: checked.method == Method::Auto
            && other.method == Method::Radau
            && ours.has_been_stiff(),
        end,
        times: times.len(),
        compared,
        parameters: parameters.found(),
        productions: matching.judge(end, &slack),
        modules,
    }))
}

/// A simulation that stops when it takes too long.
struct Limited<'m> {
    simulation: Simulation<'m>,
    string: ModuleString,
    start: Instant,
    limit: f64,
}

/// Events and steps that are passed before a look at the clock.
const STRIDE: usize = 64;

impl<'m> Limited<'m> {
    fn start(session: &'m Session, settings: Settings, limit: f64) -> Result<Limited<'m>, EarlyEnd> {
        let start = Instant::now();
        let simulation = session.simulate(settings).map_err(EarlyEnd::Error)?;
        Ok(Limited { simulation, string: ModuleString::default(), start, limit })
    }

    /// Goes to a time and writes the structure there.
    fn go(&mut self, t: f64) -> Result<(), EarlyEnd> {
        loop {
            if self.start.elapsed().as_secs_f64() > self.limit {
                return Err(EarlyEnd::Overtime { t: self.simulation.reached(), limit: self.limit });
            }
            if self.simulation.pass_some(t, STRIDE, false).map_err(EarlyEnd::Error)? == Passed::All {
                return self.simulation.at(t, &mut self.string).map_err(EarlyEnd::Error);
            }
        }
    }
}

fn same_modules(a: &ModuleString, b: &ModuleString) -> bool {
    let same = |(m, n): (Module<'_>, Module<'_>)| {
        m.kind == n.kind && (m.kind.is_bracket() || m.lineage.id == n.lineage.id)
    };
    a.len() == b.len() && a.iter().zip(b.iter()).all(same)
}

/// Modules, brackets not counted.
fn count(string: &ModuleString) -> usize {
    string.iter().filter(|m| !m.kind.is_bracket()).count()
}
