//! The points of a series: which of them are measured in the time that there is, and how long their runs take.

use std::time::Instant;

use super::compare::{Agreement, compare};
use super::record::{Accuracy, Setup, Task};
use super::reference::Reference;
use super::study::{Outcome, Point, Wall};
use dlsys_sim::Method;

/// No more timed runs of a point once they have taken so many seconds. The times of shorter runs vary more, and more of them
/// are needed for a median; one run of this length is known well enough.
const LONG: f64 = 0.2;
/// The part of the time of a series after which no further point is begun: what is left is for the medians of those that there are.
const FOR_POINTS: f64 = 0.85;

/// The time that several series share.
pub(super) struct Share {
    /// Seconds that are left.
    seconds: f64,
    /// Series that are still to come.
    series: usize,
}

impl Share {
    pub fn new(seconds: f64, series: usize) -> Share {
        Share { seconds, series }
    }

    /// The seconds of the next series: an equal part of what is left, so that what one does not need is for those behind it.
    pub fn next(&self) -> f64 {
        (self.seconds / self.series.max(1) as f64).max(0.0)
    }

    /// The next series has taken so many seconds.
    pub fn spend(&mut self, seconds: f64) {
        self.seconds -= seconds;
        self.series = self.series.saturating_sub(1);
    }
}

/// Seconds with which all series have time for all points; of each, how long one run of each point takes, and how many points there are.
pub(super) fn enough(series: &[(f64, usize)]) -> f64 {
    let mut before = 0.0;
    let mut enough: f64 = 0.0;
    for (k, (seconds, points)) in series.iter().enumerate() {
        enough = enough.max(before + seconds / FOR_POINTS * (series.len() - k) as f64);
        before += seconds + LONG * *points as f64;
    }
    enough
}

/// Seconds that are allowed.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// For a run.
    pub run: f64,
    /// For all runs of a series.
    pub series: f64,
}

/// What all points of a series have in common.
pub(super) struct Series<'a> {
    pub task: Task<'a>,
    pub method: Method,
    /// Order of convergence according to the literature.
    pub order: Option<u32>,
    pub reference: &'a Reference,
    /// Timed runs of a point, at most.
    pub runs: usize,
}

impl Series<'_> {
    /// Measures points, the cheapest first: from it the cost of the next is known. `watch` is called before each with a description
    /// of it. The first point is measured in any case.
    pub fn points(
        &self,
        mut accuracies: Vec<Accuracy>,
        limits: Limits,
        watch: &mut dyn FnMut(&str),
    ) -> Vec<Point> {
        accuracies.sort_by(|a, b| b.value().total_cmp(&a.value()));
        let begun = Instant::now();
        let seconds = || begun.elapsed().as_secs_f64();
        let mut points: Vec<Point> = Vec::new();
        for accuracy in accuracies {
            let expected = expected_seconds(&points, accuracy, self.order);
            let fits = points.is_empty() || seconds() + expected <= FOR_POINTS * limits.series;
            if expected >= limits.run || !fits {
                points.push(Point { accuracy, result: Err(expected) });
                continue;
            }
            let setup = self.setup(accuracy);
            watch(&setup.to_string());
            points.push(Point { accuracy, result: Ok(self.run(setup)) });
        }
        self.repeat(&mut points, limits.series, &seconds);
        points
    }

    fn setup(&self, accuracy: Accuracy) -> Setup {
        Setup { method: self.method, accuracy }
    }

    /// One run for the answers, whose time stands for all where there is no more time.
    fn run(&self, setup: Setup) -> Outcome {
        let record = self.task.record(setup, true);
        let model = &self.task.session.model;
        let comparison = compare(model, &record, &self.reference.record, Reference::slack(setup));
        Outcome {
            error: comparison.error,
            agreement: comparison.agreement,
            wall: Wall::of(vec![record.seconds]),
            stats: record.stats,
        }
    }

    /// Runs for the time, in rounds: what else the machine does for a while then meets all points.
    fn repeat(&self, points: &mut [Point], limit: f64, seconds: &dyn Fn() -> f64) {
        let mut times: Vec<Vec<f64>> = vec![Vec::new(); points.len()];
        for _ in 0..self.runs {
            for (point, times) in points.iter().zip(&mut times) {
                let Ok(outcome) = &point.result else { continue };
                let expected = outcome.wall.median;
                let is_known = expected >= LONG || times.iter().sum::<f64>() >= LONG;
                if !matches!(outcome.agreement, Agreement::Failed(_))
                    && !is_known
                    && seconds() + expected <= limit
                {
                    times.push(self.task.time(self.setup(point.accuracy)));
                }
            }
        }
        for (point, times) in points.iter_mut().zip(times).filter(|(_, times)| !times.is_empty()) {
            if let Ok(outcome) = &mut point.result {
                outcome.wall = Wall::of(times);
            }
        }
    }
}

/// How long the next point will take, judged from the ones before it: by the last two, or by the order.
/// 0 if nothing is known. Without an order, `auto` takes steps of order 8 where it takes any.
fn expected_seconds(points: &[Point], next: Accuracy, order: Option<u32>) -> f64 {
    let Some(last) = points.last() else { return 0.0 };
    let taken = match &last.result {
        Ok(outcome) => outcome.wall.median,
        Err(expected) => *expected,
    };
    let finer = (last.accuracy.value() / next.value()).max(1.0);
    let exponent = match next {
        Accuracy::StepSize(_) | Accuracy::Slice(_) => 1.0,
        Accuracy::Tolerance(_) => 1.0 / f64::from(order.unwrap_or(8)),
    };
    taken * finer.powf(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_sim::Stats;

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

    #[test]
    fn what_a_series_does_not_need_is_for_those_behind_it() {
        let mut share = Share::new(6.0, 3);
        assert_eq!(share.next(), 2.0);
        share.spend(1.0);
        assert_eq!(share.next(), 2.5);
        share.spend(7.0);
        assert_eq!(share.next(), 0.0, "too much was taken");
    }

    #[test]
    fn what_is_said_to_be_enough_is_enough() {
        for series in [&[(1.0, 2), (20.0, 9), (3.0, 4)][..], &[(9.0, 3), (0.1, 9)], &[(0.5, 1)]] {
            let budget = enough(series);
            let fits = |budget: f64| {
                let mut share = Share::new(budget, series.len());
                series.iter().all(|(seconds, points)| {
                    let part = share.next();
                    share.spend((seconds + LONG * *points as f64).min(part));
                    seconds <= &(FOR_POINTS * part + 1e-9)
                })
            };
            assert!(fits(budget), "{series:?}");
            assert!(!fits(0.5 * budget), "{series:?}");
        }
    }
}
