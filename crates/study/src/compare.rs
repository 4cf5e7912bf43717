//! Comparison of two runs of a model: productions and their order, modules, and the largest difference of
//! parameters.
//!
//! A difference in structure is never turned into a number. The error is taken over the times before the first
//! production that differs, and over modules that are the same ones by descent.

use super::record::Record;
use dlsys_model::Model;
use dlsys_sim::{Event, brief};
use dlsys_tree::ModuleString;

/// The first production that is not the same in two runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Which production it is, from 1.
    pub index: usize,
    /// Time of the earlier of the two.
    pub t: f64,
    /// The production of the reference at this index, as text; `None` if it has none.
    pub expected: Option<String>,
    /// The production of the run at this index.
    pub found: Option<String>,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let index = self.index;
        match (&self.found, &self.expected) {
            (Some(found), Some(expected)) => {
                write!(f, "production {index} is {found}; expected {expected}")
            }
            (Some(found), None) => write!(f, "production {index}, {found}, is not expected"),
            (None, Some(expected)) => write!(f, "production {index} is missing: {expected}"),
            (None, None) => write!(f, "production {index} differs"),
        }
    }
}

/// Whether a run has the structure of the reference.
#[derive(Clone, Debug, PartialEq)]
pub enum Agreement {
    /// It has.
    Right,
    /// Productions are not the same, or not in the same order.
    WrongEventOrder(Difference),
    /// The modules differ at an observed time.
    WrongModules {
        /// The first such time.
        t: f64,
        /// Number of modules of the run.
        ours: usize,
        /// Number of modules of the reference.
        theirs: usize,
        /// Where the productions first differ; None if they only come at other times.
        first: Option<Difference>,
    },
    /// The run ended early, and why.
    Failed(String),
}

impl Agreement {
    /// One word for files.
    pub fn key(&self) -> &'static str {
        match self {
            Agreement::Right => "right",
            Agreement::WrongEventOrder(_) => "wrong_event_order",
            Agreement::WrongModules { .. } => "wrong_modules",
            Agreement::Failed(_) => "failed",
        }
    }

    /// True if productions and modules are those of the reference.
    pub fn is_right(&self) -> bool {
        *self == Agreement::Right
    }
}

impl Agreement {
    /// The verdict in a few words: what, and at what time.
    pub fn verdict(&self) -> String {
        match self {
            Agreement::Right => "right".to_owned(),
            Agreement::WrongEventOrder(difference) => {
                format!("WRONG event order at t = {}", brief(difference.t, 6))
            }
            Agreement::WrongModules { t, ours, theirs, .. } if ours == theirs => {
                format!("WRONG modules at t = {}", brief(*t, 6))
            }
            Agreement::WrongModules { t, ours, theirs, .. } => {
                format!("WRONG: {ours} modules for {theirs} at t = {}", brief(*t, 6))
            }
            Agreement::Failed(message) => format!("FAILED: {message}"),
        }
    }

    /// What more there is to say: the first production that differs.
    pub fn detail(&self) -> Option<String> {
        match self {
            Agreement::Right | Agreement::Failed(_) => None,
            Agreement::WrongEventOrder(first) | Agreement::WrongModules { first: Some(first), .. } => {
                Some(first.to_string())
            }
            Agreement::WrongModules { first: None, .. } => {
                Some("the productions are right but early or late".to_owned())
            }
        }
    }
}

impl std::fmt::Display for Agreement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.detail() {
            Some(detail) => write!(f, "{}: {detail}", self.verdict()),
            None => write!(f, "{}", self.verdict()),
        }
    }
}

/// How a run compares with the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The largest difference of a parameter, relative to max(1, |value|), over the times before the first
    /// production that differs. None if there is no such time.
    pub error: Option<f64>,
    /// Whether the structure is that of the reference.
    pub agreement: Agreement,
}

/// Compares a run with the reference, which has come to its end. Events of the reference that are closer
/// together than `slack`, in time, may come in any order, and what is observed so near to one may or may not
/// show it.
pub fn compare(model: &Model, ours: &Record, theirs: &Record, slack: f64) -> Comparison {
    let end = match &ours.stop {
        None => theirs.states.last().map_or(0.0, |s| s.time),
        // A run that stopped is judged on what it has done.
        Some(_) => ours.states.last().map_or(-1.0, |s| s.time),
    };
    let slack = |t: f64| slack + 64.0 * f64::EPSILON * t.abs();
    let first = first_difference(model, &ours.events, &theirs.events, end, &slack);
    let limit = first.as_ref().map_or(f64::INFINITY, |d| d.t - slack(d.t));
    let near_event = |t: f64| {
        let after = theirs.events.partition_point(|e| e.time < t - slack(t));
        theirs.events.get(after).is_some_and(|e| e.time <= t + slack(t))
    };
    let mut error: Option<f64> = None;
    let mut wrong = None;
    for (a, b) in ours.states.iter().zip(&theirs.states) {
        if !same_modules(a, b) {
            if !near_event(b.time) && wrong.is_none() {
                wrong = Some((b.time, count(a), count(b)));
            }
        } else if b.time < limit {
            error = Some(error.unwrap_or(0.0).max(distance(a, b)));
        }
    }
    let agreement = match (&ours.stop, wrong, first) {
        (Some(stop), ..) => Agreement::Failed(stop.to_string()),
        (None, Some((t, ours, theirs)), first) => Agreement::WrongModules { t, ours, theirs, first },
        (None, None, Some(difference)) => Agreement::WrongEventOrder(difference),
        (None, None, None) => Agreement::Right,
    };
    Comparison { error, agreement }
}

fn same_modules(a: &ModuleString, b: &ModuleString) -> bool {
    let same = |(m, n): (dlsys_tree::Module<'_>, dlsys_tree::Module<'_>)| {
        m.kind == n.kind && (m.kind.is_bracket() || m.lineage.id == n.lineage.id)
    };
    a.len() == b.len() && a.iter().zip(b.iter()).all(same)
}

/// Modules, brackets not counted.
fn count(string: &ModuleString) -> usize {
    string.iter().filter(|m| !m.kind.is_bracket()).count()
}

fn distance(ours: &ModuleString, theirs: &ModuleString) -> f64 {
    let pairs = ours.iter().zip(theirs.iter());
    let pairs = pairs.flat_map(|(m, n)| m.parameters.iter().zip(n.parameters));
    let error = |x: f64, y: f64| (x - y).abs() / y.abs().max(1.0);
    // What is not a number is as wrong as can be.
    let errors = pairs.map(|(x, y)| Some(error(*x, *y)).filter(|e| !e.is_nan()).unwrap_or(f64::INFINITY));
    errors.fold(0.0, f64::max)
}

/// Which production it is, whenever it takes place.
fn key(event: &Event) -> (u64, usize, usize) {
    (event.lineage.id, event.rule, event.clause)
}

fn sorted(events: &[Event]) -> Vec<(u64, usize, usize)> {
    let mut keys: Vec<_> = events.iter().map(key).collect();
    keys.sort_unstable();
    keys
}

/// Finds the first production that differs. The reference is cut where its events are further apart than
/// the slack; within a piece any order will do.
fn first_difference(
    model: &Model,
    ours: &[Event],
    theirs: &[Event],
    end: f64,
    slack: &dyn Fn(f64) -> f64,
) -> Option<Difference> {
    // What happens as near to the end as this may or may not have happened yet.
    let counts = |events: &[Event]| events.partition_point(|e| e.time <= end - slack(end));
    let (sure_ours, sure_theirs) = (counts(ours), counts(theirs));
    let mut start = 0;
    while start < sure_theirs.max(sure_ours.min(theirs.len())) {
        let gap = |i: usize| theirs[i].time - theirs[i - 1].time > slack(theirs[i].time);
        let stop = (start + 1..theirs.len()).find(|&i| gap(i)).unwrap_or(theirs.len());
        let expected = &theirs[start..stop];
        let found = &ours[start.min(ours.len())..stop.min(ours.len())];
        let (of_expected, of_found) = (sorted(expected), sorted(found));
        let foreign = (found.iter().enumerate())
            .position(|(i, e)| start + i < sure_ours && of_expected.binary_search(&key(e)).is_err());
        let missing = (expected.iter().enumerate())
            .position(|(i, e)| start + i < sure_theirs && of_found.binary_search(&key(e)).is_err());
        if foreign.is_some() || missing.is_some() {
            let (foreign_event, missing_event) = (foreign.map(|i| &found[i]), missing.map(|i| &expected[i]));
            let times = [foreign_event, missing_event].into_iter().flatten().map(|e| e.time);
            return Some(Difference {
                index: start + foreign.or(missing).unwrap_or(0) + 1,
                t: times.fold(f64::INFINITY, f64::min),
                expected: missing_event.map(|e| name(model, e)),
                found: foreign_event.map(|e| name(model, e)),
            });
        }
        start = stop;
    }
    let extra = (sure_ours > theirs.len()).then(|| &ours[theirs.len()])?;
    let index = theirs.len() + 1;
    Some(Difference { index, t: extra.time, expected: None, found: Some(name(model, extra)) })
}

/// A production for people: who, and when; which of its rule's productions, if there are several.
fn name(model: &Model, event: &Event) -> String {
    let kind = &model.kinds.get(event.kind).name;
    let several = model.rules.get(event.rule).is_some_and(|rule| rule.produces.len() > 1);
    let which = if several { format!(" by its produce no. {}", event.clause + 1) } else { String::new() };
    format!("{kind} {}{which} at t = {}", event.lineage, brief(event.time, 6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Accuracy, Setup, Task};
    use dlsys_session::Session;
    use dlsys_sim::Method;

    /// Two modules that end a `gap` apart; which is first depends on the sign.
    fn record(gap: f64) -> (Session, Record) {
        let text = format!(
            "param g = {gap:e}\ninitial string: A(0) B(g)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce C(0)\n\
             B(x): if x < 1 solve dx/dt = 1\n if x = 1 produce C(0) C(0)\nC(x): solve dx/dt = x"
        );
        let session = Session::from_text("pair.dls", &text, &[]).expect("good");
        let setup = Setup { method: Method::Dopri5, accuracy: Accuracy::Tolerance(1e-9) };
        let times = [0.5, 0.95, 2.0];
        let record = Task {
            session: &session,
            times: &times,
            limit: 10.0,
            base: dlsys_sim::Settings { max_modules: 100, ..Default::default() },
        }
        .record(setup, true);
        (session, record)
    }

    #[test]
    fn order_counts_unless_events_are_close() {
        let (session, early) = record(1e-3);
        let (_, late) = record(-1e-3);
        let apart = compare(&session.model, &late, &early, 1e-6);
        let Agreement::WrongEventOrder(difference) = &apart.agreement else { panic!("{apart:?}") };
        assert_eq!(difference.index, 1);
        assert!((difference.t - 0.999).abs() < 1e-9, "{difference}");
        assert!(difference.to_string().contains("A 1 at t = 1; expected B 2 at t = 0.999"), "{difference}");
        // Before it, only B's own parameter differs.
        assert!((apart.error.expect("two times") - 2e-3).abs() < 1e-12);
        assert_eq!(compare(&session.model, &late, &early, 1e-2).agreement, Agreement::Right);
        assert_eq!(
            compare(&session.model, &early, &early, 0.0),
            Comparison { error: Some(0.0), agreement: Agreement::Right }
        );
    }

    #[test]
    fn missing_and_additional_productions_are_found() {
        let (session, whole) = record(1e-3);
        let mut short = whole.clone();
        short.events.pop();
        let found = compare(&session.model, &short, &whole, 1e-6).agreement;
        assert!(found.to_string().contains("production 2 is missing: A 1 at t = 1"), "{found}");
        let found = compare(&session.model, &whole, &short, 1e-6).agreement;
        assert!(found.to_string().contains("is not expected"), "{found}");
    }

    #[test]
    fn late_productions_show_in_the_modules() {
        let (session, whole) = record(0.1);
        let (_, late) = record(0.02);
        let found = compare(&session.model, &late, &whole, 1e-6).agreement;
        let wanted = "WRONG: 2 modules for 3 at t = 0.95: the productions are right but early or late";
        assert_eq!(found.to_string(), wanted);
    }
}
