//! A work-precision study of one model: every method at every accuracy, with errors, wall times and counts.

use super::compare::{Agreement, compare};
use super::error::Error;
use super::order::{nominal_order, observed_order};
use super::record::{Accuracy, Setup, Task, method_name};
use super::reference::{Reference, References};
use dlsys_session::Session;
use dlsys_sim::{Method, Stats};

/// The methods, accuracies and times of a study.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Methods to compare, in this order.
    pub methods: Vec<Method>,
    /// Tolerances of methods with step control.
    pub tolerances: Vec<f64>,
    /// Step sizes of methods with a fixed step; `None` for [`Plan::default_step_sizes`].
    pub step_sizes: Option<Vec<f64>>,
    /// Slices of the scheduler `local`, which is also studied if modules read neighbours; `None` for ten powers of two.
    pub slices: Option<Vec<f64>>,
    /// Times to observe, increasing; see [`default_times`].
    pub times: Vec<f64>,
    /// Timed runs of a point, at least 1; fewer if together they take more than 0.2 seconds.
    pub runs: usize,
    /// Allowed wall time of a single run in seconds.
    pub time_limit: f64,
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
    fn of(mut seconds: Vec<f64>) -> Wall {
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
    /// Number of calls of `watch` in [`study`], if no point is left out.
    pub fn points(&self, session: &Session) -> usize {
        let steps = |given: &Option<Vec<f64>>, order| {
            given.as_ref().map_or_else(|| Plan::default_step_sizes(1.0, order).len(), Vec::len)
        };
        let of_method = |method: &Method| match method.is_fixed_step() {
            true => 1 + steps(&self.step_sizes, nominal_order(method_name(*method))),
            false => 1 + self.tolerances.len(),
        };
        let local = if reads_context(session) { 1 + steps(&self.slices, None) } else { 0 };
        self.methods.iter().map(of_method).sum::<usize>() + local
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

/// No more timed runs of a point once they have taken so many seconds. The times of shorter runs vary more, and more of them
/// are needed for a median; one run of this length is known well enough.
const LONG: f64 = 0.2;

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
    let task = Task { session, times: &plan.times, limit: plan.time_limit, base: plan.base };
    let steps = Plan::default_step_sizes(task.end(), None);
    let mut references = References::new(task, steps.last().copied().unwrap_or(1.0) / 2.0);
    let mut study = Study {
        name: name.to_owned(),
        title: session.model.title.clone().unwrap_or_else(|| session.source.name.clone()),
        times: plan.times.clone(),
        events: 0,
        modules: 0,
        runs: plan.runs,
        series: Vec::new(),
    };
    let local = reads_context(session).then_some((Method::Auto, LOCAL));
    let all = plan.methods.iter().map(|&method| (method, method_name(method))).chain(local);
    for (method, name) in all {
        watch(&format!("{name}: reference"));
        let reference = references.of(method).map_err(Error::NoReference)?;
        if study.series.is_empty() {
            (study.events, study.modules) = (reference.record.stats.events, reference.record.stats.modules);
        }
        let order = nominal_order(name);
        let mut accuracies: Vec<Accuracy> = if name == LOCAL {
            let slices = plan.slices.clone();
            let slices = slices.unwrap_or_else(|| Plan::default_step_sizes(task.end(), None));
            slices.into_iter().map(Accuracy::Slice).collect()
        } else if method.is_fixed_step() {
            let steps = plan.step_sizes.clone();
            let steps = steps.unwrap_or_else(|| Plan::default_step_sizes(task.end(), order));
            steps.into_iter().map(Accuracy::StepSize).collect()
        } else {
            plan.tolerances.iter().map(|&tolerance| Accuracy::Tolerance(tolerance)).collect()
        };
        // The cheapest first: from it the cost of the next is known.
        accuracies.sort_by(|a, b| b.value().total_cmp(&a.value()));
        let mut points: Vec<Point> = Vec::new();
        for accuracy in accuracies {
            let expected = expected_seconds(&points, accuracy, order);
            if expected >= plan.time_limit {
                points.push(Point { accuracy, result: Err(expected) });
                continue;
            }
            let setup = Setup { method, accuracy };
            watch(&setup.to_string());
            points.push(Point { accuracy, result: Ok(outcome(task, setup, &reference, plan.runs)) });
        }
        let observed = observe(&points, order, &reference);
        study.series.push(Series { method, name, order, observed, reference, points });
        done(&study);
    }
    Ok(study)
}

/// One run for the answers, then some for the time.
fn outcome(task: Task<'_>, setup: Setup, reference: &Reference, runs: usize) -> Outcome {
    let record = task.record(setup, true);
    let model = &task.session.model;
    let comparison = compare(model, &record, &reference.record, Reference::slack(setup));
    let mut seconds = Vec::new();
    if record.stop.is_none() && record.seconds < LONG {
        let mut spent = 0.0;
        while seconds.len() < runs && spent < LONG {
            let taken = task.time(setup);
            spent += taken;
            seconds.push(taken);
        }
    }
    if seconds.is_empty() {
        seconds.push(record.seconds);
    }
    Outcome {
        error: comparison.error,
        agreement: comparison.agreement,
        wall: Wall::of(seconds),
        stats: record.stats,
    }
}

/// How long the next point will take, judged from the ones before it: by the last two, or by the order.
/// 0 if nothing is known.
fn expected_seconds(points: &[Point], next: Accuracy, order: Option<u32>) -> f64 {
    let Some(last) = points.last() else { return 0.0 };
    let taken = match &last.result {
        Ok(outcome) => outcome.wall.median,
        Err(expected) => *expected,
    };
    let finer = (last.accuracy.value() / next.value()).max(1.0);
    let exponent = match next {
        Accuracy::StepSize(_) | Accuracy::Slice(_) => 1.0,
        Accuracy::Tolerance(_) => 1.0 / f64::from(order.unwrap_or(5)),
    };
    taken * finer.powf(exponent)
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
            tolerances: (12..=44).map(|k| 10f64.powf(-0.25 * f64::from(k))).collect(),
            step_sizes: None,
            slices: None,
            times: (1..=60).map(f64::from).collect(),
            runs: 1,
            time_limit: 10.0,
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

    #[test]
    fn a_long_point_is_left_out() {
        let point = |tolerance, seconds: f64| Point {
            accuracy: Accuracy::Tolerance(tolerance),
            result: Ok(Outcome {
                error: None,
                agreement: Agreement::Right,
                wall: Wall::of(vec![seconds]),
                stats: Stats::default(),
            }),
        };
        let expected = expected_seconds(&[point(1e-3, 1.0)], Accuracy::Tolerance(1e-8), Some(5));
        assert!((expected - 10.0).abs() < 1e-9);
        let halved = expected_seconds(&[point(0.5, 3.0)], Accuracy::StepSize(0.25), Some(4));
        assert!((halved - 6.0).abs() < 1e-9);
        assert_eq!(expected_seconds(&[], Accuracy::StepSize(0.25), Some(4)), 0.0);
        let wall = Wall::of(vec![3.0, 1.0, 2.0, 6.0]);
        assert_eq!((wall.median, wall.min, wall.max, wall.spread()), (2.5, 1.0, 6.0, 1.0));
    }
}
