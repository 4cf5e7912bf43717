//! A work-precision study of one model: every method at every accuracy, with errors, wall times and counts.

use std::time::Instant;

use super::allowance::Allowance;
use super::compare::Agreement;
use super::error::Error;
use super::order::{nominal_order, observed_order};
use super::points::{self, Limits, Share};
use super::record::{Accuracy, Task, method_name};
use super::reference::{Reference, References};
use dlsys_session::Session;
use dlsys_sim::{Method, Stats};

/// The methods, accuracies and times of a study.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Methods to compare, in this order.
    pub methods: Vec<Method>,
    /// Tolerances of methods with step control; `None` for [`Plan::default_tolerances`].
    pub tolerances: Option<Vec<f64>>,
    /// Step sizes of methods with a fixed step; `None` for [`Plan::default_step_sizes`].
    pub step_sizes: Option<Vec<f64>>,
    /// Slices of the scheduler `local`, which is also studied if modules read neighbours; `None` for ten powers of two.
    pub slices: Option<Vec<f64>>,
    /// Times to observe, increasing; see [`default_times`].
    pub times: Vec<f64>,
    /// Timed runs of a point, at least 1; fewer if together they take more than 0.2 seconds.
    pub runs: usize,
    /// Seconds for the points of all methods whose accuracies are not listed, an equal part for each; points that do not fit are left out. The runs
    /// that all are compared with come on top. Where one of these would take longer than a third of that, the study ends at an earlier time, if it may.
    pub allowance: Allowance,
    /// Settings of all runs but for method and accuracy, such as limits.
    pub base: dlsys_sim::Settings,
}

impl Plan {
    /// Tolerances of a study: each decade from 1e-3 to 1e-11.
    pub fn default_tolerances() -> Vec<f64> {
        vec![1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11]
    }

    /// Step sizes of a study that ends at `end`: ten powers of two, from about 64 steps to about 32,768. A
    /// method of order 1 gets two more, because it converges slowly.
    pub fn default_step_sizes(end: f64, order: Option<u32>) -> Vec<f64> {
        let largest = if end > 0.0 { (end / 64.0).log2().round() } else { 0.0 };
        let count = if order == Some(1) { 12 } else { 10 };
        (0..count).map(|i| (largest - f64::from(i)).exp2()).collect()
    }
}

/// The model's own times, thinned to at most 50, evenly, the first and the last among them. None if the
/// model has no `frames`.
pub fn default_times(session: &Session) -> Option<Vec<f64>> {
    const MOST: usize = 50;
    let frames = session.model.frames?;
    let (count, all) = (frames.count(), frames.times());
    if count <= MOST {
        return Some(all.collect());
    }
    let mut kept = (0..MOST).map(|i| i * (count - 1) / (MOST - 1)).peekable();
    Some(all.enumerate().filter(|(i, _)| kept.next_if_eq(i).is_some()).map(|(_, t)| t).collect())
}

/// Wall time of several runs, in seconds.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    /// Median.
    pub median: f64,
    /// Shortest run.
    pub min: f64,
    /// Longest run.
    pub max: f64,
    /// Number of runs.
    pub runs: usize,
}

impl Wall {
    pub(super) fn of(mut seconds: Vec<f64>) -> Wall {
        seconds.sort_by(f64::total_cmp);
        let n = seconds.len();
        let at = |i: usize| seconds.get(i).copied().unwrap_or(0.0);
        let median = (at(n.saturating_sub(1) / 2) + at(n / 2)) / 2.0;
        Wall { median, min: at(0), max: at(n.saturating_sub(1)), runs: n }
    }

    /// Half the distance from the fastest to the slowest run, as a part of the median.
    pub fn spread(&self) -> f64 {
        if self.median > 0.0 { (self.max - self.min) / 2.0 / self.median } else { 0.0 }
    }
}

impl Plan {
    /// The accuracies of a method, or of the scheduler `local`, and whether they are listed. `end` is the last time.
    fn accuracies(&self, method: Method, name: &str, end: f64) -> (Vec<Accuracy>, bool) {
        let (listed, accuracy): (_, fn(f64) -> Accuracy) = match method.is_fixed_step() {
            _ if name == LOCAL => (&self.slices, Accuracy::Slice),
            true => (&self.step_sizes, Accuracy::StepSize),
            false => (&self.tolerances, Accuracy::Tolerance),
        };
        let default = || match method.is_fixed_step() {
            _ if name == LOCAL => Plan::default_step_sizes(end, None),
            true => Plan::default_step_sizes(end, nominal_order(name)),
            false => Plan::default_tolerances(),
        };
        let values = listed.clone().unwrap_or_else(default);
        (values.into_iter().map(accuracy).collect(), listed.is_some())
    }

    /// The methods with their names, and the scheduler `local` where modules read neighbours.
    fn named(&self, session: &Session) -> Vec<(Method, &'static str)> {
        let local = reads_context(session).then_some((Method::Auto, LOCAL));
        self.methods.iter().map(|&method| (method, method_name(method))).chain(local).collect()
    }

    /// Number of calls of `watch` in [`study`], if no point is left out.
    pub fn points(&self, session: &Session) -> usize {
        let all = self.named(session);
        all.into_iter().map(|(method, name)| 1 + self.accuracies(method, name, 1.0).0.len()).sum()
    }
}

/// True if some rule reads the parameters of neighbours.
fn reads_context(session: &Session) -> bool {
    session.model.rules.iter().any(|rule| rule.reads_context)
}

/// The result of a point.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Largest error over all times and parameters, relative to max(1, |value|); over the times before the
    /// first difference if productions differ. None if there is no such time.
    pub error: Option<f64>,
    /// Whether the structure is that of the reference.
    pub agreement: Agreement,
    /// Wall time.
    pub wall: Wall,
    /// Counts of work; `modules` is the number at the end.
    pub stats: Stats,
}

/// A method at one accuracy.
#[derive(Clone, Debug)]
pub struct Point {
    /// Tolerance, step size or slice.
    pub accuracy: Accuracy,
    /// The result, or, if the point was left out, its estimated wall time in seconds.
    pub result: Result<Outcome, f64>,
}

/// The part of the time for all points that a tight run may take, where the study may end at an earlier time.
const FOR_A_REFERENCE: f64 = 0.35;

/// The name that the scheduler `local` has among methods.
const LOCAL: &str = "local";

/// All points of a method, or of the scheduler `local` (with the method `auto`).
#[derive(Clone, Debug)]
pub struct Series {
    /// The method.
    pub method: Method,
    /// Its name as on the command line, or `local`.
    pub name: &'static str,
    /// Order of convergence according to the literature; see [`nominal_order`].
    pub order: Option<u32>,
    /// Observed order: error against step size, against slice or, with step control, against evaluations of the
    /// right-hand side; see [`observed_order`].
    pub observed: Option<f64>,
    /// The run against which the errors are measured.
    pub reference: Reference,
    /// Its points, in the order of increasing work.
    pub points: Vec<Point>,
}

/// The study of a model.
#[derive(Clone, Debug)]
pub struct Study {
    /// Name for files.
    pub name: String,
    /// Title of the model, or the name of its file.
    pub title: String,
    /// Observed times, increasing.
    pub times: Vec<f64>,
    /// Number of productions of the reference.
    pub events: u64,
    /// Number of modules of the reference at the end.
    pub modules: u64,
    /// Timed runs of a point, at most.
    pub runs: usize,
    /// The results of each method.
    pub series: Vec<Series>,
}

impl Study {
    /// How many points were left out though a run of each would have taken less than `limit` seconds, and about which
    /// [`allowance`](Plan::allowance) has time for all; `None` if there are none.
    pub fn left_out(&self, limit: f64) -> Option<(usize, f64)> {
        let expected = |point: &Point| point.result.as_ref().err().copied();
        let all = self.series.iter().flat_map(|series| &series.points);
        let count = all.filter_map(expected).filter(|seconds| *seconds < limit).count();
        let seconds = |point: &Point| match &point.result {
            Ok(outcome) => outcome.wall.median,
            // With the time for it, it would be left out still.
            Err(expected) if *expected >= limit => 0.0,
            Err(expected) => *expected,
        };
        let series = self.series.iter().map(|one| (one.points.iter().map(seconds).sum(), one.points.len()));
        let series: Vec<(f64, usize)> = series.collect();
        (count > 0).then(|| (count, points::enough(&series)))
    }
}

/// Makes all runs of a study. `watch` is called before each point with a description of it, `done` after each method
/// with the study so far.
///
/// # Errors
/// [`Error::NoReference`] if no method reaches the last time.
pub fn study(
    session: &Session,
    name: &str,
    plan: &Plan,
    watch: &mut dyn FnMut(&str),
    done: &mut dyn FnMut(&Study),
) -> Result<Study, Error> {
    let mut task = Task { session, times: &plan.times, limit: plan.allowance.run, base: plan.base };
    let steps = Plan::default_step_sizes(task.end(), None);
    let mut references = References::new(task, steps.last().copied().unwrap_or(1.0) / 2.0);
    if plan.allowance.may_shorten {
        watch("how far it goes");
        task.times = &plan.times[..references.shorten(FOR_A_REFERENCE * plan.allowance.all)];
    }
    let mut study = Study {
        name: name.to_owned(),
        title: session.model.title.clone().unwrap_or_else(|| session.source.name.clone()),
        times: task.times.to_vec(),
        events: 0,
        modules: 0,
        runs: plan.runs,
        series: Vec::new(),
    };
    let all = plan.named(session);
    let are_listed = |(method, name): &(Method, &str)| plan.accuracies(*method, name, task.end()).1;
    let mut share = Share::new(plan.allowance.all, all.iter().filter(|series| !are_listed(series)).count());
    for (method, name) in all {
        watch(&format!("{name}: reference"));
        let reference = references.of(method).map_err(Error::NoReference)?;
        if study.series.is_empty() {
            (study.events, study.modules) = (reference.record.stats.events, reference.record.stats.modules);
        }
        let order = nominal_order(name);
        let (accuracies, listed) = plan.accuracies(method, name, task.end());
        let series = if listed { f64::INFINITY } else { share.next() };
        let limits = Limits { run: plan.allowance.run, series };
        let begun = Instant::now();
        let common = points::Series { task, method, order, reference: &reference, runs: plan.runs };
        let points = common.points(accuracies, limits, watch);
        if !listed {
            share.spend(begun.elapsed().as_secs_f64());
        }
        let observed = observe(&points, order, &reference);
        study.series.push(Series { method, name, order, observed, reference, points });
        done(&study);
    }
    Ok(study)
}

/// Runs with less than so many times the least work are left out of the order.
const OVERHEAD: f64 = 2.0;

/// The order that the points show.
fn observe(points: &[Point], order: Option<u32>, reference: &Reference) -> Option<f64> {
    let seen = points.iter().filter_map(|point| {
        let outcome = point.result.as_ref().ok()?;
        let work = match point.accuracy {
            Accuracy::StepSize(h) | Accuracy::Slice(h) => 1.0 / h,
            Accuracy::Tolerance(_) => outcome.stats.rhs_evaluations as f64,
        };
        outcome.agreement.is_right().then_some((work, outcome.error?))
    });
    let seen: Vec<(f64, f64)> = seen.collect();
    // Where the reference is not better than the run, the difference is not the run's error.
    let floor = 3.0 * reference.error.unwrap_or(0.0);
    // The cheapest runs spend their work on starting again at events, which no tolerance makes cheaper.
    let least = seen.iter().fold(f64::INFINITY, |least, p| least.min(p.0));
    let most: Vec<(f64, f64)> = seen.iter().copied().filter(|p| p.0 >= OVERHEAD * least).collect();
    observed_order(&most, order, floor).or_else(|| observed_order(&seen, order, floor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_thinned_evenly() {
        let model = |frames: &str| {
            let text = format!("{frames}\ninitial string: A(1)\nA(x): solve dx/dt = x");
            Session::from_text("a.dls", &text, &[]).expect("good")
        };
        let all = default_times(&model("frames 0 .. 5 step 1")).expect("frames");
        assert_eq!(all, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let thin = default_times(&model("frames 10 .. 1010 step 1")).expect("frames");
        assert_eq!((thin.len(), thin[0], thin[49]), (50, 10.0, 1010.0));
        assert!(thin.windows(2).all(|w| (20.0..=21.0).contains(&(w[1] - w[0]))), "{thin:?}");
        assert_eq!(default_times(&model("")), None);
    }

    #[test]
    fn orders_are_seen_in_a_study() {
        let text = "initial string: A(0.5)\nA(x): if x < 2 solve dx/dt = x*cos(t)\n if x = 2 produce A(0.5)";
        let session = Session::from_text("order.dls", text, &[]).expect("good");
        let plan = Plan {
            methods: Method::NAMED.iter().map(|(_, m)| *m).collect(),
            // Errors at single tolerances scatter by a factor of ten around the law; many of them show it.
            tolerances: Some((12..=44).map(|k| 10f64.powf(-0.25 * f64::from(k))).collect()),
            step_sizes: None,
            slices: None,
            times: (1..=60).map(f64::from).collect(),
            runs: 1,
            allowance: Allowance { run: 10.0, all: f64::INFINITY, may_shorten: false },
            base: dlsys_sim::Settings { max_modules: 100, ..Default::default() },
        };
        let study = study(&session, "order", &plan, &mut |_| (), &mut |_| ()).expect("a study");
        for series in &study.series {
            let observed = series.observed.expect("enough points");
            if let Some(order) = series.order {
                let ratio = observed / f64::from(order);
                // Step control follows an estimate of lower order, so that work falls short of the order a little.
                assert!((0.6..1.3).contains(&ratio), "{}: order {observed}", series.name);
            }
        }
    }
}
