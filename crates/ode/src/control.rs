//! Step size control: what it is asked for, what it remembers from step to step, and its rules.

use crate::Method;
use crate::methods::Scheme;
use dlsys_expr::SimTime;

/// How steps are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSettings {
    /// The method; `auto` chooses one for each step.
    pub method: Method,
    /// Error aimed at in every component at every time, relative to max(1, |value|). Ignored by methods with a fixed step.
    pub tolerance: f64,
    /// Length of the steps of methods with a fixed one, in units of simulated time. Steps end at its multiples.
    pub step_size: f64,
}

impl StepSettings {
    /// The grid on which steps of fixed size end.
    pub(crate) fn grid(&self) -> Option<f64> {
        self.method.is_fixed_step().then_some(self.step_size)
    }

    /// The scheme for a step.
    pub(crate) fn scheme(&self, is_stiff: bool, is_cut: bool) -> Scheme {
        let automatic = || Scheme::automatic(self.tolerance, is_stiff, is_cut);
        self.method.scheme().unwrap_or_else(automatic)
    }
}

/// The memory of step control: all that a next step depends on besides the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Length of the next step to be tried, in units of simulated time; 0 if nothing is known.
    pub size: f64,
    /// The estimated error of the last step, in units of the tolerated one.
    pub last_error: f64,
    /// Signs of stiffness in a row.
    pub stiffness_count: u32,
    /// True once the equations were found to be stiff.
    pub stiff: bool,
    /// The sum of the estimated errors of the steps so far, relative to the values; at most [`CERTAINTY`] times the tolerance.
    pub error: f64,
}

impl Default for Control {
    fn default() -> Control {
        Control { size: 0.0, last_error: 1.0, stiffness_count: 0, stiff: false, error: 0.0 }
    }
}

/// However many steps there have been, values are taken to be right to so many tolerances.
pub const CERTAINTY: f64 = 2.0;

/// So many signs of stiffness in a row mean that the equations are stiff.
const STIFF_FROM: u32 = 15;

/// A step with less than this part of the tolerated error is longer than accuracy requires.
const EASY: f64 = 1e-3;
/// How far ahead, in units of the time to the last event, such steps look.
const FORESIGHT: f64 = 8.0;

impl Control {
    /// Counts steps that are short for stability's sake only (Hairer and Wanner 1996, section IV.2).
    pub(crate) fn count_stiffness(&mut self, is_limited_by_stability: bool) {
        if is_limited_by_stability {
            self.stiffness_count += 1;
            self.stiff |= self.stiffness_count >= STIFF_FROM;
        } else {
            self.stiffness_count = self.stiffness_count.saturating_sub(2);
        }
    }

    /// Adapts the next step to an event that came when `lived` of a step of error `last_error` had passed: a step that could have had
    /// any length says nothing about the next one, but the time to the event does. `resolution` is that of time.
    pub fn foresee(&mut self, last_error: f64, lived: f64, resolution: f64) {
        // An event at the very start of a step says nothing.
        if last_error <= EASY && lived > 64.0 * resolution {
            self.size = self.size.min((FORESIGHT * lived).max(resolution));
        }
    }
}

/// The factor by which a next step may be longer: PI step control (Gustafsson 1991) with the constants of DOPRI5, beta = 0.04.
pub(crate) fn growth(error: f64, last: f64, order: u32) -> f64 {
    let exponent = 1.0 / f64::from(order + 1) - 0.03;
    0.9 * error.max(1e-10).powf(-exponent) * last.max(1e-4).powf(0.04)
}

/// The factor by which a rejected step is shortened: safety and limits as in DOPRI5 (Hairer, Nørsett and Wanner 1993, section II.4).
pub(crate) fn shrinkage(error: f64, order: u32) -> f64 {
    (0.9 * error.powf(-1.0 / f64::from(order + 1))).clamp(0.1, 0.9)
}

/// The length of a step with `room` up to its limit: two steps of the same length rather than a long one and a short one.
pub(crate) fn fit(h: f64, room: f64) -> f64 {
    if h >= room {
        room
    } else if 2.0 * h > room {
        0.5 * room
    } else {
        h
    }
}

/// The first multiple of a step size after an instant, in units of simulated time.
pub fn next_grid_time(now: SimTime, grid: f64) -> f64 {
    let t = now.to_f64();
    let mut n = (t / grid).floor() + 1.0;
    if n * grid - t <= now.resolution() {
        n += 1.0;
    }
    n * grid
}

/// Detects that step control does not help: errors that keep their size, in units of the tolerated error, however much shorter steps
/// become. Such errors are rounding of the data of the rates, or belong to a solution that is the same on all scales.
#[derive(Default)]
pub(crate) struct Powerless {
    /// Length and error of a step that was rejected.
    last: Option<(f64, f64)>,
    times: u32,
}

impl Powerless {
    /// Takes in a step that is about to be rejected; true from the third time on that a shorter step did not help.
    pub fn is_shown(&mut self, h: f64, error: f64) -> bool {
        let Some((before, known)) = self.last else {
            self.last = Some((h, error));
            return false;
        };
        if h <= 0.3 * before {
            self.times = if error > 0.5 * known { self.times + 1 } else { 0 };
            self.last = Some((h, error));
        }
        self.times >= 3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_times_are_the_multiples_of_the_step_after_an_instant() {
        assert_eq!(next_grid_time(SimTime::ZERO, 0.25), 0.25);
        assert_eq!(next_grid_time(SimTime::new(0.3), 0.25), 0.5);
        // A multiple is not after itself, nor after what rounding makes of it.
        assert_eq!(next_grid_time(SimTime::new(0.1 + 0.2), 0.1), 4.0 * 0.1);
    }

    #[test]
    fn equations_are_stiff_after_fifteen_signs_and_stay_so() {
        let mut control = Control::default();
        for sign in [true; 14].into_iter().chain([false]).chain([true; 2]) {
            control.count_stiffness(sign);
            assert!(!control.stiff);
        }
        control.count_stiffness(true);
        control.count_stiffness(false);
        assert!(control.stiff && control.stiffness_count == 13);
    }

    #[test]
    fn a_step_is_never_followed_by_a_short_rest() {
        assert_eq!([0.3, 0.6, 1.0, 2.0].map(|h| fit(h, 1.0)), [0.3, 0.5, 1.0, 1.0]);
        assert_eq!(fit(3.0, f64::INFINITY), 3.0);
    }

    #[test]
    fn errors_that_stay_while_steps_shrink_show_that_control_is_powerless() {
        let mut helps = Powerless::default();
        assert!((0..10).all(|i| !helps.is_shown(0.2f64.powi(i), 100.0 * 0.2f64.powi(i))));
        let mut no_help = Powerless::default();
        let shown: Vec<bool> = (0..5).map(|i| no_help.is_shown(0.2f64.powi(i), 100.0)).collect();
        assert_eq!(shown, [false, false, false, true, true]);
    }
}
