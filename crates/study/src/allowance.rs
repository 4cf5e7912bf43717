//! The time that a study may take, and how it keeps to it: by fewer points, and, where that does not help, by an earlier end.
//!
//! Each run of a study observes the same times. A model whose first run takes long is studied up to the time that it has reached by
//! then: all that is compared is as good as on the whole, and the growth that costs most is at the end.

use std::time::Instant;

use dlsys_sim::brief;

/// Seconds that a study may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowance {
    /// For a single run.
    pub run: f64,
    /// For all of it.
    pub all: f64,
    /// Whether it may end at an earlier time than the last one; not if the times were asked for.
    pub may_shorten: bool,
}

/// Fewest times of a study that ends earlier.
pub(super) const FEWEST: usize = 2;

/// An allowance that is being spent.
pub(super) struct Purse {
    pub allowance: Allowance,
    begun: Instant,
}

impl Purse {
    pub fn open(allowance: Allowance) -> Purse {
        Purse { allowance, begun: Instant::now() }
    }

    /// A part of the whole for the first run, after which it ends at the time that it has reached; `None` if it must not.
    pub fn first(&self, part: f64) -> Option<f64> {
        self.allowance.may_shorten.then_some(part * self.allowance.all)
    }

    /// Seconds since the beginning.
    pub fn spent(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Whether a run that is expected to take so long fits into so many seconds since the beginning.
    ///
    /// # Errors
    /// What stands in its place.
    pub fn fits(&self, expected: f64, within: f64) -> Result<(), String> {
        match self.spent() + expected > within || expected > self.allowance.run {
            true => Err(format!("left out, would take about {} s", brief(expected, 2))),
            false => Ok(()),
        }
    }
}

/// The wall time of a run that ends at an earlier time than the last one where it takes long.
pub(super) struct Stopwatch {
    begun: Instant,
    /// Seconds after which the run ends.
    enough: Option<f64>,
}

impl Stopwatch {
    pub fn start(enough: Option<f64>) -> Stopwatch {
        Stopwatch { begun: Instant::now(), enough }
    }

    pub fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Whether the run ends here, having seen so many times.
    pub fn is_enough(&self, seen: usize) -> bool {
        seen >= FEWEST && self.enough.is_some_and(|enough| self.seconds() > enough)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_ends_early_only_where_it_may() {
        let of = |may_shorten| Purse::open(Allowance { run: 10.0, all: 4.0, may_shorten });
        assert_eq!((of(true).first(0.25), of(false).first(0.25)), (Some(1.0), None));
        let stopwatch = Stopwatch::start(Some(-1.0));
        assert!(!stopwatch.is_enough(1) && stopwatch.is_enough(2), "one time is no study");
        assert!(!Stopwatch::start(None).is_enough(9));
    }

    #[test]
    fn what_does_not_fit_is_left_out() {
        let purse = Purse::open(Allowance { run: 10.0, all: 4.0, may_shorten: false });
        assert!(purse.fits(1.0, 4.0).is_ok());
        assert_eq!(purse.fits(5.0, 4.0), Err("left out, would take about 5 s".to_owned()));
        assert!(purse.fits(11.0, 40.0).is_err(), "longer than a run may take");
    }
}
