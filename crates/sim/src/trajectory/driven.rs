//! Solutions of `dx/dt = h(t) q(x)`: those of `dx/ds = q(x)` at `s = H(t)`, where the *pace* H, the integral of h, is
//! an explicit function of time.
//!
//! The equations of this form are those of [`dlsys_model::Driven`].

use std::cell::RefCell;
use std::sync::Arc;

use smallvec::SmallVec;

use super::{Growth, Riccati};
use dlsys_expr::{Dual, Interval, Program, Scratch, Value};
use dlsys_model as model;

/// The solution for one parameter, from one start.
#[derive(Clone, Debug)]
pub struct DrivenSolution {
    flow: AutonomousFlow,
    pace: Option<Pace>,
}

/// The solution of `dx/ds = q(x)`, as displacements from the start.
#[derive(Clone, Debug)]
pub enum AutonomousFlow {
    /// The solution forward, and the solution backward, whose coefficients have the opposite signs.
    Riccati(Riccati, Riccati),
    Growth(Growth),
}

/// The pace H, from the start of the trajectory on.
#[derive(Clone, Debug)]
pub struct Pace {
    program: Arc<Program>,
    /// The variables of the rule at the start.
    variables: SmallVec<[f64; 8]>,
    /// The index of `t` among the variables; `age` is the next.
    time: usize,
    start: f64,
}

thread_local! {
    // A search evaluates a pace some ten times; these avoid an allocation each time.
    static NUMBERS: RefCell<Scratch<f64>> = const { RefCell::new(Vec::new()) };
    static RATES: RefCell<Scratch<Dual<f64>>> = const { RefCell::new(Vec::new()) };
}

/// Most evaluations of a pace in the search for an instant.
const MOST: usize = 500;

impl Pace {
    /// None if H or its rate is not finite at the start.
    pub fn new(program: Arc<Program>, variables: &[f64], time: usize) -> Option<Pace> {
        let mut pace = Pace { program, variables: SmallVec::from_slice(variables), time, start: 0.0 };
        pace.start = pace.value(0.0);
        (pace.start.is_finite() && pace.rate(0.0).is_finite()).then_some(pace)
    }

    fn eval<T: Value>(&self, lift: impl Fn(f64) -> T, times: [T; 2], scratch: &mut Scratch<T>) -> T {
        let mut variables: SmallVec<[T; 8]> = self.variables.iter().map(|x| lift(*x)).collect();
        variables[self.time..self.time + 2].copy_from_slice(&times);
        let mut out = [T::constant(0.0)];
        self.program.eval(&variables, scratch, &mut out);
        out[0]
    }

    /// The increase of H from the start to a time since the start.
    fn value(&self, tau: f64) -> f64 {
        let times = [0, 1].map(|i| self.variables[self.time + i] + tau);
        NUMBERS.with_borrow_mut(|scratch| self.eval(|x| x, times, scratch)) - self.start
    }

    fn rate(&self, tau: f64) -> f64 {
        let times = [0, 1].map(|i| Dual { value: self.variables[self.time + i] + tau, rate: 1.0 });
        RATES.with_borrow_mut(|scratch| self.eval(Dual::constant, times, scratch)).rate
    }

    fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let times = [0, 1].map(|i| {
            let now = self.variables[self.time + i];
            Dual { value: Interval::spanned(now + from, now + to), rate: Interval::constant(1.0) }
        });
        let mut bounds = self.eval(Dual::constant, times, &mut Vec::new());
        bounds.value.lo -= self.start;
        bounds.value.hi -= self.start;
        // H is continuous: its integrand may jump, but is bounded.
        bounds.value.partial = false;
        // The mean value theorem often bounds more tightly.
        let (middle, reach) = (self.value(0.5 * (from + to)), 0.5 * (to - from) * bounds.rate.magnitude());
        if reach.is_finite() {
            bounds.value.lo = bounds.value.lo.max(middle - reach);
            bounds.value.hi = bounds.value.hi.min(middle + reach);
        }
        bounds
    }

    /// The first time at which H, which is monotonic, has increased by `s`.
    fn reach(&self, s: f64) -> Option<f64> {
        let beyond = |value: f64| if s > 0.0 { value >= s } else { value <= s };
        let (mut lo, mut hi) = (0.0, 1.0);
        // The first guess: the pace of the start.
        let guess = s / self.rate(0.0);
        if guess > 0.0 && guess.is_finite() {
            hi = guess.clamp(1e-12, 1e12);
        }
        while !beyond(self.value(hi)) {
            (lo, hi) = (hi, 2.0 * hi);
            if hi > 1e18 {
                return None;
            }
        }
        let mut tau = 0.5 * (lo + hi);
        for _ in 0..200 {
            let value = self.value(tau);
            if beyond(value) {
                hi = tau
            } else {
                lo = tau
            }
            if hi - lo <= f64::EPSILON * hi {
                break;
            }
            let next = tau - (value - s) / self.rate(tau);
            // Two roundings to the far side of Newton's step close the bracket.
            let nudge = 2.0 * f64::EPSILON * next.abs() * if beyond(value) { -1.0 } else { 1.0 };
            let next = next + nudge;
            tau = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        }
        (hi > 0.0).then_some(hi)
    }

    /// A time up to which H is proven to stay between two values, close to the first at which it does not; None if none
    /// is found up to 1e15.
    fn leave(&self, below: f64, above: f64) -> Option<f64> {
        let (mut at, mut width) = (0.0, 1.0);
        for _ in 0..MOST {
            let bounds = self.over(at, at + width).value;
            if bounds.lo > below && bounds.hi < above {
                at += width;
                width *= 2.0;
                if at > 1e15 {
                    return None;
                }
            } else {
                width *= 0.5;
                if width <= 1e-12 * at.max(1e-12) {
                    return Some(at);
                }
            }
        }
        None
    }
}

impl AutonomousFlow {
    /// The solution from `x` of an equation of the given form with these coefficients; None where its closed form does
    /// not hold.
    pub fn new(form: model::GrowthLaw, x: f64, [c, b, a]: [f64; 3]) -> Option<AutonomousFlow> {
        Some(match form {
            model::GrowthLaw::Quadratic => {
                AutonomousFlow::Riccati(Riccati::new(x, c, b, a), Riccati::new(x, -c, -b, -a))
            }
            model::GrowthLaw::Gompertz => AutonomousFlow::Growth(Growth::gompertz(x, c, b)?),
            model::GrowthLaw::Bernoulli => AutonomousFlow::Growth(Growth::bernoulli(x, c, b, a)?),
        })
    }

    /// The displacement at s.
    pub fn value(&self, s: f64) -> f64 {
        match self {
            AutonomousFlow::Riccati(forward, _) if s >= 0.0 => forward.value(s),
            AutonomousFlow::Riccati(_, backward) => backward.value(-s),
            AutonomousFlow::Growth(growth) => growth.value(s),
        }
    }

    /// The value at s, if it was `x` at 0; None if there is only a displacement.
    pub fn directly(&self, x: f64, s: f64) -> Option<f64> {
        match self {
            AutonomousFlow::Riccati(forward, _) => forward.directly(x, s),
            AutonomousFlow::Growth(growth) => Some(growth.directly(s)),
        }
    }

    fn rate(&self, u: f64) -> f64 {
        match self {
            AutonomousFlow::Riccati(forward, _) => forward.rate(u),
            AutonomousFlow::Growth(growth) => growth.rate(u),
        }
    }

    fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        match self {
            AutonomousFlow::Riccati(forward, _) if from >= 0.0 => forward.over(from, to),
            AutonomousFlow::Riccati(_, backward) if to <= 0.0 => {
                let bounds = backward.over(-to, -from);
                Dual { rate: Interval { lo: -bounds.rate.hi, hi: -bounds.rate.lo, ..bounds.rate }, ..bounds }
            }
            AutonomousFlow::Riccati(..) => {
                let hull = |a: Interval, b: Interval| Interval {
                    lo: a.lo.min(b.lo),
                    hi: a.hi.max(b.hi),
                    partial: a.partial || b.partial,
                };
                let (a, b) = (self.over(from, 0.0), self.over(0.0, to));
                Dual { value: hull(a.value, b.value), rate: hull(a.rate, b.rate) }
            }
            AutonomousFlow::Growth(growth) => growth.over(from, to),
        }
    }

    fn reach(&self, u: f64, forward_in_time: bool, exact: impl FnOnce() -> f64) -> Option<f64> {
        let s = match self {
            AutonomousFlow::Riccati(forward, _) if forward_in_time => forward.reach(u, exact),
            AutonomousFlow::Riccati(_, backward) => backward.reach(u, || -exact()).map(|s| -s),
            AutonomousFlow::Growth(growth) => growth.reach(u),
        }?;
        ((s > 0.0) == forward_in_time && s != 0.0).then_some(s)
    }

    fn ends(&self) -> (Option<f64>, Option<f64>) {
        match self {
            AutonomousFlow::Riccati(forward, backward) => (backward.pole().map(|s| -s), forward.pole()),
            AutonomousFlow::Growth(growth) => growth.ends(),
        }
    }
}

impl DrivenSolution {
    /// A flow at a pace; at that of time if there is none.
    pub fn new(flow: AutonomousFlow, pace: Option<Pace>) -> DrivenSolution {
        DrivenSolution { flow, pace }
    }

    fn s(&self, tau: f64) -> f64 {
        self.pace.as_ref().map_or(tau, |pace| pace.value(tau))
    }

    /// The displacement at a time since the start.
    pub fn value(&self, tau: f64) -> f64 {
        if tau == 0.0 { 0.0 } else { self.flow.value(self.s(tau)) }
    }

    /// The value itself, at a time since the start, at which it was `x`; None if there is only a displacement.
    pub fn directly(&self, x: f64, tau: f64) -> Option<f64> {
        self.flow.directly(x, self.s(tau))
    }

    /// The rate at a time since the start.
    pub fn rate(&self, tau: f64) -> f64 {
        let pace = self.pace.as_ref().map_or(1.0, |pace| pace.rate(tau));
        self.flow.rate(self.value(tau)) * pace
    }

    /// Bounds of displacement and rate from one time since the start to another.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let Some(pace) = &self.pace else { return self.flow.over(from, to) };
        let s = pace.over(from, to);
        if s.value.is_empty() {
            return Dual { value: Interval::ENTIRE, rate: Interval::ENTIRE };
        }
        let bounds = self.flow.over(s.value.lo, s.value.hi);
        let rate = Interval::binary(dlsys_expr::Binary::Mul, bounds.rate, s.rate);
        Dual { value: bounds.value, rate: Interval { partial: rate.partial || s.rate.partial, ..rate } }
    }

    /// The first time after 0 at which the displacement is `u`, if the pace has one sign; `rate` gives the rate there as
    /// the equation is written.
    pub fn reach(&self, u: f64, rate: impl FnOnce() -> f64) -> Option<f64> {
        let Some(pace) = &self.pace else { return self.flow.reach(u, true, rate) };
        // The direction of s is that of its first change.
        let forward = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12]
            .into_iter()
            .map(|tau| pace.value(tau))
            .find(|s| *s != 0.0)
            .is_none_or(|s| s > 0.0);
        // The rate of the equation as written is one in time, not one in s.
        let s = self.flow.reach(u, forward, || self.flow.rate(u))?;
        pace.reach(s)
    }

    /// The time at which the solution ends; None if it does not end.
    pub fn end(&self) -> Option<f64> {
        let (before, after) = self.flow.ends();
        match &self.pace {
            None => after,
            Some(_) if before.is_none() && after.is_none() => None,
            Some(pace) => pace.leave(before.unwrap_or(f64::NEG_INFINITY), after.unwrap_or(f64::INFINITY)),
        }
    }
}
