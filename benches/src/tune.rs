//! The search for the loosest tolerance that reaches an error.
//!
//! An error that falls below the target at one tolerance by luck, because two errors cancel, and rises above it at
//! the next does not count: a tolerance is good if it and the tighter ones after it, for a whole decade, are.

use std::time::{Duration, Instant};

use crate::solver::{Candidate, Solver};

/// Tolerances that are tried in one decade.
const PER_DECADE: i32 = 8;

/// A program at the tolerance at which it reaches the wanted error.
pub struct Tuned {
    pub name: String,
    pub tolerance: f64,
    pub error: f64,
    pub solver: Box<dyn Solver>,
}

/// The `k`-th of the tolerances that are tried.
pub fn tolerance(k: i32) -> f64 {
    10f64.powf(-f64::from(k) / f64::from(PER_DECADE))
}

/// The loosest tolerance between `loosest` and `tightest` (decades, as positive exponents) from which on `error`, a
/// function of the tolerance, stays at or below `target`. Ends when it has for a decade.
pub fn search(
    loosest: i32,
    tightest: i32,
    target: f64,
    mut error: impl FnMut(f64) -> Option<f64>,
) -> Option<(f64, f64)> {
    let mut found = None;
    let mut since = 0;
    for k in loosest * PER_DECADE..=tightest * PER_DECADE {
        match error(tolerance(k)) {
            Some(e) if e <= target => {
                found = found.or(Some((tolerance(k), e)));
                since += 1;
                if since > PER_DECADE {
                    break;
                }
            }
            _ => {
                found = None;
                since = 0;
            }
        }
    }
    found
}

/// Searches for one candidate, ending when a single run takes longer than `limit`.
pub fn tune(
    candidate: &Candidate,
    (loosest, tightest): (i32, i32),
    target: f64,
    limit: Duration,
    error: &dyn Fn(&dyn Solver) -> f64,
) -> Option<Tuned> {
    let mut slow = false;
    let (tolerance, reached) = search(loosest, tightest, target, |tolerance| {
        if slow {
            return None;
        }
        let mut solver = (candidate.prepare)(tolerance).ok()?;
        let begin = Instant::now();
        let outcome = solver.run();
        slow = begin.elapsed() > limit;
        outcome.ok()?;
        Some(error(solver.as_ref()))
    })?;
    let solver = (candidate.prepare)(tolerance).ok()?;
    Some(Tuned { name: candidate.name.clone(), tolerance, error: reached, solver })
}

/// Searches for all candidates and keeps the fastest, by the shortest of a few runs; prints each one.
pub fn fastest(
    candidates: &[Candidate],
    decades: (i32, i32),
    target: f64,
    limit: Duration,
    error: &dyn Fn(&dyn Solver) -> f64,
    mut tell: impl FnMut(&str, Option<(&Tuned, Duration)>),
) -> Option<Tuned> {
    let mut best: Option<(Duration, Tuned)> = None;
    for candidate in candidates {
        let Some(mut tuned) = tune(candidate, decades, target, limit, error) else {
            tell(&candidate.name, None);
            continue;
        };
        let mut shortest = Duration::MAX;
        for _ in 0..5 {
            let begin = Instant::now();
            if tuned.solver.run().is_err() {
                break;
            }
            shortest = shortest.min(begin.elapsed());
        }
        tell(&candidate.name, Some((&tuned, shortest)));
        if best.as_ref().is_none_or(|b| shortest < b.0) {
            best = Some((shortest, tuned));
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lucky tolerance is passed over; the answer is the first of a whole decade of good ones.
    #[test]
    fn luck_does_not_count() {
        let lucky = tolerance(12);
        let error = |tol: f64| Some(if tol == lucky { 0.0 } else { 3.0 * tol });
        let (found, reached) = search(1, 6, 1e-3, error).expect("there is one");
        assert!(reached <= 1e-3 && 3.0 * found * 10f64.powf(1.0 / f64::from(PER_DECADE)) > 1e-3);
        assert!(search(1, 3, 1e-9, error).is_none());
    }
}
