//! The reference of a method: the closed form if the whole model has one, otherwise the run of another method with the
//! tightest tolerance, with an estimate of its own error from a second one, which may be the judged method: nobody judges
//! himself, but two tight runs serve all methods.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::allowance::FEWEST;
use super::compare::{Comparison, compare};
use super::order::nominal_order;
use super::record::{Accuracy, EarlyEnd, Record, Setup, Task, method_name};
use dlsys_session::Session;
use dlsys_sim::Method;

/// The tightest tolerance of a simulation.
pub(super) const TIGHTEST: f64 = 1e-13;
/// Time limit of a tight run, relative to that of a point of the study.
const PATIENCE: f64 = 3.0;

/// True if `auto` solves the whole model by formulas, so that it is the reference of all other methods.
fn is_exact(session: &Session) -> bool {
    session.model.is_closed_form()
}

/// The run against which a method is judged.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Method and accuracy of the run.
    pub setup: Setup,
    /// The run.
    pub record: Rc<Record>,
    /// Estimate of its error, relative to max(1, |value|): the difference from a second run. 0 for a closed form;
    /// `None` if the two differ in structure before the first observed time.
    pub error: Option<f64>,
    /// Description of the second run, and whether the two differ in structure.
    pub check: String,
    /// Whether the reference is a closed form, exact to rounding.
    pub is_closed_form: bool,
}

impl Reference {
    /// The time within which productions of a run with this setup may be exchanged: ten tolerances.
    pub fn slack(setup: Setup) -> f64 {
        match setup.accuracy {
            Accuracy::Tolerance(tolerance) => 10.0 * tolerance,
            // Its error is unknown: only what is simultaneous in the reference may be exchanged.
            Accuracy::StepSize(_) | Accuracy::Slice(_) => 10.0 * TIGHTEST,
        }
    }
}

impl std::fmt::Display for Reference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.is_closed_form {
            return write!(f, "closed form ({})", self.check);
        }
        match self.error {
            Some(error) => write!(f, "{}, which differs by {error:.0e} from {}", self.setup, self.check),
            None => write!(f, "{}, which has nothing in common with {}", self.setup, self.check),
        }
    }
}

/// Tight runs of a model, computed on first use.
pub struct References<'a> {
    task: Task<'a>,
    /// Step of the tight runs of methods that have a fixed one.
    step_size: f64,
    exact: bool,
    /// By place in `Method::NAMED`, and whether relaxed.
    runs: BTreeMap<(usize, bool), Rc<Record>>,
}

impl<'a> References<'a> {
    /// `step_size`: that of tight runs of methods that have a fixed one.
    pub fn new(task: Task<'a>, step_size: f64) -> References<'a> {
        let task = Task { limit: PATIENCE * task.limit, ..task };
        References { task, step_size, exact: is_exact(task.session), runs: BTreeMap::new() }
    }

    /// How many of the times the two best tight runs reach in so many seconds each, at least two; further ones are observed no more. All, if they
    /// fail for another reason.
    pub fn shorten(&mut self, seconds: f64) -> usize {
        let whole = self.task;
        for method in candidates().into_iter().take(2) {
            let setup = self.setup(method, false);
            let task = Task { limit: seconds.min(whole.limit), ..self.task };
            let mut record = task.record(setup, true);
            if let Some(EarlyEnd::Overtime { .. }) = record.stop {
                let count = record.reached();
                if count < FEWEST {
                    self.task = whole;
                    self.runs.clear();
                    return whole.times.len();
                }
                record.cut(count);
                self.task.times = &whole.times[..count];
                self.runs.values_mut().for_each(|run| Rc::make_mut(run).cut(count));
            }
            self.runs.insert((place(method), false), Rc::new(record));
        }
        self.task.times.len()
    }

    /// The reference of a method. If only the judged method itself reaches the last time, it is compared with itself, and
    /// [`Reference::check`] says so.
    ///
    /// # Errors
    /// If no method reaches the last time: why the preferred one did not.
    pub fn of(&mut self, judged: Method) -> Result<Reference, String> {
        if self.exact && judged != Method::Auto {
            let record = self.run(Method::Auto, false);
            if record.stop.is_none() {
                let setup = self.setup(Method::Auto, false);
                let check = "auto".to_owned();
                return Ok(Reference { setup, record, error: Some(0.0), check, is_closed_form: true });
            }
        }
        let mut why = String::from("there is no other method of sufficient order");
        let own = (judged == Method::Auto).then(|| self.run(judged, false));
        let mut found = None;
        for method in candidates().into_iter().filter(|method| *method != judged) {
            let record = self.run(method, false);
            // What `auto` does is what one of the others does: that one is not another method.
            if own.as_ref().is_some_and(|own| own.is_same_run(&record)) {
                continue;
            }
            match &record.stop {
                Some(stop) => why = format!("{}: {stop}", self.setup(method, false)),
                None => {
                    found = Some((method, record));
                    break;
                }
            }
        }
        let independent = found.is_some();
        let (method, record) = match found {
            Some(found) => found,
            None => {
                let record = self.run(judged, false);
                if record.stop.is_some() {
                    return Err(why);
                }
                (judged, record)
            }
        };
        let setup = self.setup(method, false);
        let (compared, check) = self.check(method, judged, independent, &record);
        let doubt = if compared.agreement.is_right() {
            String::new()
        } else {
            format!(" (THEY DISAGREE: {})", compared.agreement)
        };
        let own = if independent { String::new() } else { format!(" (NO OTHER METHOD: {why})") };
        let check = format!("{check}{doubt}{own}");
        Ok(Reference { setup, record, error: compared.error, check, is_closed_form: false })
    }

    /// Compares the reference with another tight run, which is described: the best there is, which serves most methods. One of the judged
    /// method that disagrees says nothing about which of them is wrong, so that a third is asked then.
    fn check(
        &mut self,
        method: Method,
        judged: Method,
        independent: bool,
        record: &Record,
    ) -> (Comparison, String) {
        let task = self.task;
        let slack = Reference::slack(self.setup(method, false));
        let compared = |other: &Record| compare(&task.session.model, other, record, slack);
        let mut doubtful = None;
        for other in candidates().into_iter().filter(|other| independent && *other != method) {
            let run = self.run(other, false);
            if run.stop.is_some() {
                continue;
            }
            let found = (compared(&run), self.setup(other, false).to_string());
            if other != judged || found.0.agreement.is_right() {
                return found;
            }
            doubtful = Some(found);
        }
        doubtful.unwrap_or_else(|| {
            // There is no other method: the same one, asked for less.
            let run = self.run(method, true);
            (compared(&run), self.setup(method, true).to_string())
        })
    }

    /// The tight setup of a method; relaxed, ten times the tolerance or twice the step.
    fn setup(&self, method: Method, relaxed: bool) -> Setup {
        let accuracy = match (method.is_fixed_step(), relaxed) {
            (true, relaxed) => Accuracy::StepSize(self.step_size * if relaxed { 2.0 } else { 1.0 }),
            (false, false) => Accuracy::Tolerance(TIGHTEST),
            (false, true) => Accuracy::Tolerance(10.0 * TIGHTEST),
        };
        Setup { method, accuracy }
    }

    fn run(&mut self, method: Method, relaxed: bool) -> Rc<Record> {
        let setup = self.setup(method, relaxed);
        let task = self.task;
        Rc::clone(
            self.runs.entry((place(method), relaxed)).or_insert_with(|| Rc::new(task.record(setup, true))),
        )
    }
}

/// The place of a method in `Method::NAMED`.
fn place(method: Method) -> usize {
    Method::NAMED.iter().position(|(_, m)| *m == method).unwrap_or(Method::NAMED.len())
}

/// Methods that can be a reference, the best first: with step control before those without, then
/// by order. Not `auto`, which is one of the others; and Euler's method is the truth about nothing.
fn candidates() -> Vec<Method> {
    let rank =
        |method: Method| (method.is_fixed_step(), std::cmp::Reverse(nominal_order(method_name(method))));
    let mut all: Vec<Method> = Method::NAMED
        .iter()
        .map(|(_, method)| *method)
        .filter(|m| *m != Method::Auto && nominal_order(method_name(*m)) >= Some(4))
        .collect();
    all.sort_by_key(|m| rank(*m));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_judges_himself() {
        let text = "initial string: A(0.1)\nA(x): solve dx/dt = x*(1 - x)";
        let session = Session::from_text("logistic.dls", text, &[]).expect("good");
        let times = [1.0, 3.0];
        let task = Task {
            session: &session,
            times: &times,
            limit: 10.0,
            base: dlsys_sim::Settings { max_modules: 100, ..Default::default() },
        };
        let mut references = References::new(task, 1.0 / 1024.0);
        for (_, judged) in Method::NAMED {
            let reference = references.of(judged).expect("a reference");
            assert_ne!(reference.setup.method, judged);
            let exact = 1.0 / (1.0 + 9.0 * (-3.0f64).exp());
            let error = (reference.record.states[1].get(0).parameters[0] - exact).abs();
            assert!(error < 1e-12 && reference.error < Some(1e-11), "{reference}: {error:e}");
        }
        let own = references.run(Method::Auto, false);
        let judge = references.of(Method::Auto).expect("a reference");
        assert!(!own.is_same_run(&judge.record), "{judge}");
    }
}
