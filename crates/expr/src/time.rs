//! Instants of simulated time, with a finer resolution than a 64-bit float far from zero.

/// A time as the unevaluated sum of two floats (Dekker 1971), good to about 32 digits.
///
/// A module born at t = 1e9 with a life of 1e-6 needs its birth to better than the 1e-7 that separate
/// neighbouring floats there. Ages and durations are differences of instants, rounded once.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default)]
pub struct SimTime {
    high: f64,
    low: f64,
}

impl SimTime {
    /// The start of a run.
    pub const ZERO: SimTime = SimTime { high: 0.0, low: 0.0 };

    /// The time `t`, in units of simulated time.
    #[inline]
    pub fn new(t: f64) -> SimTime {
        SimTime { high: t, low: 0.0 }
    }

    /// The product of a whole number and a duration.
    pub fn multiple(n: f64, duration: f64) -> SimTime {
        let high = n * duration;
        SimTime { high, low: n.mul_add(duration, -high) }
    }

    /// The instant after a duration.
    #[inline]
    pub fn after(self, duration: f64) -> SimTime {
        let (high, error) = two_sum(self.high, duration);
        let (high, low) = two_sum(high, self.low + error);
        SimTime { high, low }
    }

    /// The instant after a duration as a float; None if it is infinite, or no later: far from zero a short time cannot be
    /// told.
    pub fn ahead(self, duration: f64) -> Option<f64> {
        let at = self.after(duration);
        (at.since(self) > 0.0 && at.high.is_finite()).then_some(at.high)
    }

    /// The duration since an earlier instant.
    #[inline]
    pub fn since(self, earlier: SimTime) -> f64 {
        let (difference, error) = two_sum(self.high, -earlier.high);
        difference + (error + (self.low - earlier.low))
    }

    /// The nearest float.
    #[inline]
    pub fn to_f64(self) -> f64 {
        self.high
    }

    /// The bits of both floats, the larger first: to compare instants, or to hash them.
    #[inline]
    pub fn bits(self) -> [u64; 2] {
        [self.high.to_bits(), self.low.to_bits()]
    }

    /// Events closer together than this are one instant (LANGUAGE, "Events"): a few units in the last
    /// place of `t`.
    #[inline]
    pub fn resolution(self) -> f64 {
        8.0 * f64::EPSILON * self.high.abs().max(f64::MIN_POSITIVE)
    }
}

/// Sum and rounding error of it (Knuth, TAOCP 2, 4.2.2, theorem B).
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_survive_far_from_zero() {
        let birth = SimTime::new(1e9);
        let mut now = birth;
        for _ in 0..1000 {
            now = now.after(1e-9);
        }
        assert!((now.since(birth) - 1e-6).abs() < 1e-18);
    }
}
