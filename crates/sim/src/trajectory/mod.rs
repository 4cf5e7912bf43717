//! Trajectories: the motion of one parameter of one module from an instant on, in closed form or along dense output.
//!
//! Time is counted from the start of the trajectory, and values are displacements from the value there, so that a module
//! born at t = 1e9 moves as precisely as one born at 0. Where little is left of the value at the start, its displacement has lost the
//! digits of what is left, and that is computed from the solution itself ([`Trajectory::at`]).

mod driven;
mod function;
mod growth;
mod riccati;
mod sum;

pub use driven::{AutonomousFlow, DrivenSolution, Pace};
pub use function::FunctionOfTime;
use growth::Growth;
pub use riccati::Riccati;
pub use sum::{Chain, TermSum, Terms};

use dlsys_expr::{Dual, Interval, Value};

/// The trajectory of a parameter.
#[derive(Clone, Debug, Default)]
pub enum Trajectory {
    /// The parameter is constant.
    #[default]
    Rest,
    /// Displacement `c_0 τ + c_1 τ² + c_2 τ³ + c_3 τ⁴`.
    Polynomial([f64; 4]),
    /// Solution of `x' = c + b x + a x²`.
    Riccati(Riccati),
    /// Sum of products of powers, exponentials, sines and cosines of time.
    Sum(Box<TermSum>),
    /// Solution of an autonomous equation at a rate that varies with time.
    Driven(Box<DrivenSolution>),
    /// Explicit function of time and of parameters with closed forms.
    Function(Box<FunctionOfTime>),
    /// Dense output of a step of the module itself: the number of the component.
    Step(u32),
    /// Dense output of the coupled modules: the number of the component.
    Coupled(u32),
}

/// A value of less than this part of that at the start is not computed as a displacement, which would be right to the digits of the start.
const LITTLE: f64 = 1e-2;

impl Trajectory {
    /// The value at a time since the start, at which it was `x`; NaN for dense output.
    #[inline]
    pub fn at(&self, x: f64, tau: f64) -> f64 {
        let value = x + self.value(tau);
        let is_direct = value.abs() < LITTLE * x.abs() || self.begins_elsewhere(x);
        if is_direct { self.directly(x, tau).unwrap_or(value) } else { value }
    }

    /// True for a function of time whose value at the start is not `x`: a steep one whose conditions have changed at an instant that is
    /// rounded.
    #[inline]
    fn begins_elsewhere(&self, x: f64) -> bool {
        matches!(self, Trajectory::Function(function) if !function.begins_at(x))
    }

    /// True if it is known to be defined at all times: others may end at a pole.
    pub fn is_total(&self) -> bool {
        match self {
            Trajectory::Function(function) => function.is_total(),
            Trajectory::Riccati(law) => law.exponential().is_some(),
            Trajectory::Driven(_) => false,
            _ => true,
        }
    }

    /// Bounds of value and rate from one time since the start, at which the value was `x`, to another; unbounded for dense output.
    #[inline]
    pub fn within(&self, x: f64, from: f64, to: f64) -> Dual<Interval> {
        let Dual { value, rate } = self.over(from, to);
        let value = Interval { lo: x + value.lo, hi: x + value.hi, ..value };
        let direct = || match self {
            Trajectory::Sum(sum) => sum.directly_over(x, from, to),
            Trajectory::Function(function) => Some(function.directly_over(from, to)),
            // Monotonic.
            _ => Some(Interval::spanned(self.directly(x, from)?, self.directly(x, to)?)),
        };
        let is_direct = value.magnitude() < LITTLE * x.abs() || self.begins_elsewhere(x);
        let value = if is_direct { direct().unwrap_or(value) } else { value };
        Dual { value, rate }
    }

    /// The size of what is rounded in a value that was `x` at the start.
    pub fn rounded(&self, x: f64, value: f64) -> f64 {
        let is_direct = value.abs() < LITTLE * x.abs() && self.directly(x, 0.0).is_some();
        if is_direct { value.abs() } else { x.abs() }
    }

    /// The value, not as a displacement; None if there is no other form.
    #[cold]
    fn directly(&self, x: f64, tau: f64) -> Option<f64> {
        match self {
            Trajectory::Riccati(law) => law.directly(x, tau),
            Trajectory::Sum(sum) => sum.directly(x, tau),
            Trajectory::Driven(driven) => driven.directly(x, tau),
            Trajectory::Function(function) => Some(function.at(tau)),
            _ => None,
        }
    }

    /// True for a closed form, which is evaluated and not integrated.
    pub fn is_formula(&self) -> bool {
        !matches!(self, Trajectory::Step(_) | Trajectory::Coupled(_))
    }

    /// The displacement at a time since the start; NaN for dense output.
    #[inline]
    pub fn value(&self, tau: f64) -> f64 {
        match self {
            Trajectory::Rest => 0.0,
            Trajectory::Polynomial(c) => tau * (c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]))),
            Trajectory::Riccati(law) => law.value(tau),
            Trajectory::Sum(sum) => sum.value(tau),
            Trajectory::Driven(driven) => driven.value(tau),
            Trajectory::Function(function) => function.value(tau),
            Trajectory::Step(_) | Trajectory::Coupled(_) => f64::NAN,
        }
    }

    /// The rate at a time since the start; NaN for dense output.
    #[inline]
    pub fn rate(&self, tau: f64) -> f64 {
        match self {
            Trajectory::Rest => 0.0,
            Trajectory::Polynomial(c) => c[0] + tau * (2.0 * c[1] + tau * (3.0 * c[2] + tau * 4.0 * c[3])),
            Trajectory::Riccati(law) => law.rate(law.value(tau)),
            Trajectory::Sum(sum) => sum.rate(tau),
            Trajectory::Driven(driven) => driven.rate(tau),
            Trajectory::Function(function) => function.rate(tau),
            Trajectory::Step(_) | Trajectory::Coupled(_) => f64::NAN,
        }
    }

    /// Bounds of displacement and rate from one time since the start to another; unbounded for dense output.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        match self {
            Trajectory::Rest => Dual { value: Interval::constant(0.0), rate: Interval::constant(0.0) },
            Trajectory::Polynomial(c) => bound_polynomial(c, from, to),
            Trajectory::Riccati(law) => law.over(from, to),
            Trajectory::Sum(sum) => sum.over(from, to),
            Trajectory::Driven(driven) => driven.over(from, to),
            Trajectory::Function(function) => function.over(from, to),
            Trajectory::Step(_) | Trajectory::Coupled(_) => {
                Dual { value: Interval::ENTIRE, rate: Interval::ENTIRE }
            }
        }
    }

    /// The first time after 0 at which the displacement is `u`, for trajectories that are monotonic; None for others.
    /// `rate` computes the rate there from the equation as written.
    #[inline]
    pub fn reach(&self, u: f64, rate: impl FnOnce() -> f64) -> Option<f64> {
        match self {
            Trajectory::Polynomial([c, 0.0, 0.0, 0.0]) => {
                let tau = u / c;
                (tau > 0.0 && tau.is_finite()).then_some(tau)
            }
            Trajectory::Riccati(law) => law.reach(u, rate),
            Trajectory::Driven(driven) => driven.reach(u, rate),
            _ => None,
        }
    }

    /// The time at which the solution ends, at a pole for instance; None if it does not end.
    #[inline]
    pub fn end(&self) -> Option<f64> {
        match self {
            Trajectory::Riccati(law) => law.pole(),
            Trajectory::Driven(driven) => driven.end(),
            _ => None,
        }
    }

    /// The trajectory from the value `x` as a sum of terms; None if it has another form.
    pub fn terms(&self, x: f64) -> Option<Terms> {
        match self {
            Trajectory::Rest => Some(Terms::constant(x)),
            Trajectory::Polynomial(c) => Some(Terms::polynomial(x, c)),
            // x + f (exp(d τ) - 1) / d
            Trajectory::Riccati(law) => law.exponential().map(|(f, d)| {
                if d == 0.0 { Terms::affine(x, f) } else { Terms::exponential(x - f / d, f / d, d) }
            }),
            Trajectory::Sum(sum) => Some(sum.terms(x)),
            Trajectory::Driven(_)
            | Trajectory::Function(_)
            | Trajectory::Step(_)
            | Trajectory::Coupled(_) => None,
        }
    }
}

/// Bounds by Taylor's formula about the middle: the first terms exactly, the rest by their size.
fn bound_polynomial(c: &[f64; 4], from: f64, to: f64) -> Dual<Interval> {
    let (m, r) = (0.5 * (from + to), 0.5 * (to - from));
    let value = m * (c[0] + m * (c[1] + m * (c[2] + m * c[3])));
    let first = c[0] + m * (2.0 * c[1] + m * (3.0 * c[2] + m * 4.0 * c[3]));
    let second = 2.0 * c[1] + m * (6.0 * c[2] + m * 12.0 * c[3]);
    let third = 6.0 * c[2] + m * 24.0 * c[3];
    let fourth = 24.0 * c[3];
    let reach =
        r * (first.abs() + r / 2.0 * (second.abs() + r / 3.0 * (third.abs() + r / 4.0 * fourth.abs())));
    let slack = r * (second.abs() + r / 2.0 * (third.abs() + r / 3.0 * fourth.abs()));
    Dual {
        value: Interval { lo: value - reach, hi: value + reach, partial: false },
        rate: Interval { lo: first - slack, hi: first + slack, partial: false },
    }
}
