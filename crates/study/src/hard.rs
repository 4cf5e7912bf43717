//! Runs hard cases and checks everything that they expect.

use super::case::{Case, Expectation, PlainModule, Within};
use super::error::Error;
use super::record::{Driver, EarlyEnd, method_name};
use dlsys_model::{KindId, Model};
use dlsys_session::Session;
use dlsys_sim::{Event, Method, Settings, Simulation, Stats, brief};
use dlsys_tree::ModuleString;

/// Settings for running cases.
#[derive(Clone, Debug)]
pub struct HardPlan {
    /// Methods, instead of those of each case.
    pub methods: Option<Vec<Method>>,
    /// Tolerances, instead of those of each case.
    pub tolerances: Option<Vec<f64>>,
    /// Seconds after which a run is stopped and counts as failed.
    pub time_limit: f64,
}

/// The result of one run of a case.
#[derive(Clone, Debug)]
pub struct CaseResult {
    /// Name of the case.
    pub case: String,
    /// Theme of the case.
    pub group: String,
    /// Path or name of its file.
    pub file: String,
    /// Method, as on the command line.
    pub method: &'static str,
    /// Tolerance of the run.
    pub tolerance: f64,
    /// The largest error of a number, as the case measures it; None if no numbers were compared.
    pub error: Option<f64>,
    /// The largest quotient of an error and the allowed error.
    pub ratio: Option<f64>,
    /// Counts of work.
    pub stats: Stats,
    /// Wall time in seconds.
    pub seconds: f64,
    /// Expectations that are not met; the run passes if there are none.
    pub mismatches: Vec<Mismatch>,
}

/// An expectation that is not met.
#[derive(Clone, Debug)]
pub struct Mismatch {
    /// Line of the file.
    pub line: usize,
    /// The quantity, its time, and by how much it is off.
    pub what: String,
    /// The expected value, as text.
    pub expected: String,
    /// The value of the run, as text.
    pub found: String,
}

impl CaseResult {
    /// True if all expectations are met.
    pub fn passes(&self) -> bool {
        self.mismatches.is_empty()
    }

    /// The first mismatch and the number of the others, or `pass`.
    pub fn summary(&self) -> String {
        let Some(first) = self.mismatches.first() else { return "pass".to_owned() };
        let more = match self.mismatches.len() {
            1 => String::new(),
            n => format!(" and {} more", n - 1),
        };
        format!("{}{more}", first.what)
    }
}

/// Runs a case with every method and tolerance. `watch` is called before each run with a description of it.
///
/// # Errors
/// If the model cannot be read.
pub fn run_case(case: &Case, plan: &HardPlan, watch: &mut dyn FnMut(&str)) -> Result<Vec<CaseResult>, Error> {
    let session = Session::from_text(&case.file, &case.text, &case.settings).map_err(|refused| {
        let all = refused.diagnostics.iter().chain(&refused.settings);
        let message: String = all.map(|d| d.render(&refused.source, false)).collect();
        Error::Case { file: case.file.clone(), line: 0, message: message.trim_end().to_owned() }
    })?;
    let mut rows = Vec::new();
    for &method in plan.methods.as_ref().unwrap_or(&case.methods) {
        for &tolerance in plan.tolerances.as_ref().unwrap_or(&case.tolerances) {
            watch(&format!("{}: {} at {tolerance:e}", case.id, method_name(method)));
            rows.push(Judge::new(case, &session.model, tolerance).run(&session, method, plan.time_limit));
        }
    }
    Ok(rows)
}

/// Compares a run with the expectations, time by time.
struct Judge<'a> {
    case: &'a Case,
    model: &'a Model,
    tolerance: f64,
    error: Option<f64>,
    ratio: Option<f64>,
    mismatches: Vec<Mismatch>,
    /// Productions so far; and those that took place a little after the time that was asked for.
    events: u64,
    instants: u64,
    last_group: Option<u64>,
    ahead: Vec<Event>,
}

impl<'a> Judge<'a> {
    fn new(case: &'a Case, model: &'a Model, tolerance: f64) -> Judge<'a> {
        Judge {
            case,
            model,
            tolerance,
            error: None,
            ratio: None,
            mismatches: Vec::new(),
            events: 0,
            instants: 0,
            last_group: None,
            ahead: Vec::new(),
        }
    }

    fn run(mut self, session: &Session, method: Method, limit: f64) -> CaseResult {
        let mut driver = Driver::new(limit, self.times().last().copied().unwrap_or(0.0));
        let (stats, stop) = self.go(session, method, &mut driver);
        let seconds = driver.seconds();
        self.check_end(stop);
        CaseResult {
            case: self.case.id.clone(),
            group: self.case.group.clone(),
            file: self.case.file.clone(),
            method: method_name(method),
            tolerance: self.tolerance,
            error: self.error,
            ratio: self.ratio,
            stats,
            seconds,
            mismatches: self.mismatches,
        }
    }

    /// Runs to the last time and checks what is expected on the way. Tells why it stopped before, if so.
    fn go(&mut self, session: &Session, method: Method, driver: &mut Driver) -> (Stats, Option<EarlyEnd>) {
        let settings =
            Settings { method, tolerance: self.tolerance, log: self.counts_events(), ..Settings::default() };
        let mut simulation = match session.simulate(settings) {
            Ok(simulation) => simulation,
            Err(fault) => return (Stats::default(), Some(EarlyEnd::Error(fault))),
        };
        let mut string = ModuleString::default();
        for t in self.times() {
            if let Err(stop) = driver.go(&mut simulation, t, &mut string) {
                return (simulation.stats(), Some(stop));
            }
            self.check_at(t, &string, &mut simulation);
        }
        (simulation.stats(), None)
    }

    fn counts_events(&self) -> bool {
        let counts = |e: &Expectation| matches!(e, Expectation::Events { .. } | Expectation::Instants { .. });
        self.case.expectations.iter().any(|(_, e)| counts(e))
    }

    /// Times to look at; the last is where a run that should fail has failed.
    fn times(&self) -> Vec<f64> {
        let mut times = Vec::new();
        for (_, expectation) in &self.case.expectations {
            times.push(match expectation {
                Expectation::Fails { t, .. } => self.case.fails_by.unwrap_or(1.5 * t + 1.0),
                other => other.time(),
            });
        }
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    fn check_at(&mut self, t: f64, string: &ModuleString, simulation: &mut Simulation<'_>) {
        self.ahead.append(&mut simulation.take_events());
        // An event within the resolution of time has taken place at `t`.
        let until = t + 8.0 * f64::EPSILON * t.abs();
        let ahead = std::mem::take(&mut self.ahead);
        let (passed, ahead): (Vec<Event>, Vec<Event>) = ahead.into_iter().partition(|e| e.time <= until);
        self.ahead = ahead;
        for event in passed {
            self.events += 1;
            self.instants += u64::from(self.last_group != Some(event.group));
            self.last_group = Some(event.group);
        }
        let case = self.case;
        for (line, expectation) in case.expectations.iter().filter(|(_, e)| e.time() == t) {
            match expectation {
                Expectation::At { string: expected, within, .. } => {
                    self.check_string(*line, t, string, expected, *within);
                }
                Expectation::Count { name, count, .. } => {
                    let found = string.iter().filter(|m| match name {
                        Some(name) => self.name(m.kind) == name,
                        None => !m.kind.is_bracket(),
                    });
                    let what = format!("number of {} at t = {t}", name.as_deref().unwrap_or("modules"));
                    self.check_count(*line, what, *count, found.count() as u64);
                }
                Expectation::Sum { name, parameter, sum, within, .. } => {
                    let of_name = string.iter().filter(|m| self.name(m.kind) == name);
                    let found = accurate_sum(of_name.filter_map(|m| m.parameters.get(*parameter).copied()));
                    let what = format!("sum of parameter {} of {name} at t = {t}", parameter + 1);
                    if let Some(off) = self.check_number(found, *sum, *within) {
                        self.miss(*line, format!("{what} is {off}"), sum.to_string(), found.to_string());
                    }
                }
                Expectation::Events { count, .. } => {
                    self.check_count(*line, format!("number of productions by t = {t}"), *count, self.events);
                }
                Expectation::Instants { count, .. } => {
                    let what = format!("number of instants with productions by t = {t}");
                    self.check_count(*line, what, *count, self.instants);
                }
                Expectation::Fails { .. } => {}
            }
        }
    }

    fn name(&self, kind: KindId) -> &'a str {
        &self.model.kinds.get(kind).name
    }

    fn miss(&mut self, line: usize, what: String, expected: String, found: String) {
        self.mismatches.push(Mismatch { line, what, expected, found });
    }

    fn check_count(&mut self, line: usize, what: String, expected: u64, found: u64) {
        if expected != found {
            self.miss(
                line,
                format!("{what} is {found} for {expected}"),
                expected.to_string(),
                found.to_string(),
            );
        }
    }

    /// Takes a number into account; says how far it is off if that is too much.
    fn check_number(&mut self, found: f64, expected: f64, within: Within) -> Option<String> {
        let (error, allowed) = (within.error(found, expected), within.allowed(self.tolerance));
        // Not a number is as wrong as can be, and nothing is exact.
        let error = if error.is_nan() { f64::INFINITY } else { error };
        let ratio = if error == 0.0 { 0.0 } else { error / allowed };
        self.error = Some(self.error.unwrap_or(0.0).max(error));
        self.ratio = Some(self.ratio.unwrap_or(0.0).max(ratio));
        (error > allowed).then(|| format!("off by {}, allowed {}", brief(error, 3), brief(allowed, 3)))
    }

    fn check_string(
        &mut self,
        line: usize,
        t: f64,
        string: &ModuleString,
        expected: &[PlainModule],
        within: Within,
    ) {
        let found: Vec<PlainModule> = string
            .iter()
            .map(|m| PlainModule { name: self.name(m.kind).to_owned(), parameters: m.parameters.to_vec() })
            .collect();
        let same = |(a, b): (&PlainModule, &PlainModule)| {
            a.name == b.name && a.parameters.len() == b.parameters.len()
        };
        let agree = found.iter().zip(expected).take_while(|pair| same(*pair)).count();
        if agree < found.len().max(expected.len()) {
            let what = format!("other modules at t = {t}, from module {} on", agree + 1);
            return self.miss(line, what, show(expected, agree), show(&found, agree));
        }
        let mut worst: Option<(f64, usize, String)> = None;
        for (i, (ours, theirs)) in found.iter().zip(expected).enumerate() {
            for (j, (x, y)) in ours.parameters.iter().zip(&theirs.parameters).enumerate() {
                let error = within.error(*x, *y);
                if let Some(off) = self.check_number(*x, *y, within)
                    && worst.as_ref().is_none_or(|w| error > w.0)
                {
                    let what = format!(
                        "parameter {} of {} (module {}) at t = {t} is {off}",
                        j + 1,
                        ours.name,
                        i + 1
                    );
                    worst = Some((error, i, what));
                }
            }
        }
        if let Some((_, i, what)) = worst {
            self.miss(line, what, show(expected, i), show(&found, i));
        }
    }

    /// Checks how the run ended.
    fn check_end(&mut self, stop: Option<EarlyEnd>) {
        let case = self.case;
        let wanted = case.expectations.iter().find_map(|(line, e)| match e {
            Expectation::Fails { faults, t, within } => Some((*line, faults, *t, *within)),
            _ => None,
        });
        let found = match &stop {
            None => "no error".to_owned(),
            Some(EarlyEnd::Error(fault)) => format!("{}: {fault} ({})", fault.name(), fault.site().time),
            Some(stop) => stop.to_string(),
        };
        match (&stop, wanted) {
            (None, None) => {}
            (Some(EarlyEnd::Error(fault)), Some((line, faults, t, within)))
                if faults.contains(&fault.name()) =>
            {
                if let Some(off) = self.check_number(fault.site().time, t, within) {
                    let expected = format!("{} at t = {t}", faults.join(" or "));
                    self.miss(line, format!("time of {} is {off}", fault.name()), expected, found);
                }
            }
            (stop, Some((line, faults, t, _))) => {
                let expected = format!("{} at t = {t}", faults.join(" or "));
                let what = match stop {
                    None => format!("the run does not end with {}", faults.join(" or ")),
                    Some(stop) => format!("the run ends otherwise: {}", end_of(stop).0),
                };
                self.miss(line, what, expected, found);
            }
            (Some(stop), None) => {
                let (word, t) = end_of(stop);
                let line = self.first_not_reached(t);
                let what = format!("the run ends too early: {word}");
                self.miss(line, what, "no error".to_owned(), found);
            }
        }
    }

    /// Line of the first expectation that a run which ended at this time has not come to.
    fn first_not_reached(&self, t: f64) -> usize {
        let later = self.case.expectations.iter().filter(|(_, e)| e.time() >= t);
        later.min_by(|a, b| a.1.time().total_cmp(&b.1.time())).map_or(1, |(line, _)| *line)
    }
}

/// A word for why a run ended, and the time to which it came.
fn end_of(stop: &EarlyEnd) -> (&'static str, f64) {
    match stop {
        EarlyEnd::Error(fault) => (fault.name(), fault.site().time),
        EarlyEnd::Overtime { t, .. } => ("it takes too long", *t),
    }
}

/// A string with every digit; of a long one, what is around a module.
fn show(pieces: &[PlainModule], around: usize) -> String {
    const SHOWN: usize = 6;
    let start = around.saturating_sub(SHOWN / 2).min(pieces.len().saturating_sub(SHOWN));
    let end = (start + SHOWN).min(pieces.len());
    let mut words: Vec<String> = pieces[start..end].iter().map(show_piece).collect();
    if start > 0 {
        words.insert(0, format!("({start} modules) …"));
    }
    if end < pieces.len() {
        words.push(format!("… ({} more)", pieces.len() - end));
    }
    if words.is_empty() { "ε".to_owned() } else { words.join(" ") }
}

fn show_piece(piece: &PlainModule) -> String {
    if piece.parameters.is_empty() {
        return piece.name.clone();
    }
    let numbers: Vec<String> = piece.parameters.iter().map(|x| brief(*x, 17)).collect();
    format!("{}({})", piece.name, numbers.join(", "))
}

/// A sum whose rounding does not grow with the number of terms (Neumaier 1974).
fn accurate_sum(terms: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0_f64);
    for x in terms {
        let next = sum + x;
        lost += if sum.abs() >= x.abs() { (sum - next) + x } else { (x - next) + sum };
        sum = next;
    }
    sum + lost
}
