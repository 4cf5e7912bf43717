//! Parameters that are explicit functions of time, and of other parameters with closed forms.

use std::sync::Arc;

use dlsys_expr::{Dual, Interval, Program, Value};

use super::Trajectory;

/// A program over the variables of a rule, some of which move: time, and parameters with closed forms.
#[derive(Clone, Debug)]
pub struct FunctionOfTime {
    program: Arc<Program>,
    /// The variables at the start.
    variables: Vec<f64>,
    /// The variables that move, with their trajectories.
    moving: Vec<(usize, Trajectory)>,
    /// The index of `t` among the variables; `age` is the next.
    time: usize,
    /// The value at the start.
    start: f64,
}

impl FunctionOfTime {
    /// A function of variables that move from given values on; None if its value at the start is not finite.
    pub fn new(
        program: &Arc<Program>,
        variables: &[f64],
        moving: Vec<(usize, Trajectory)>,
        time: usize,
    ) -> Option<FunctionOfTime> {
        let (program, variables) = (program.clone(), variables.to_vec());
        let mut function = FunctionOfTime { program, variables, moving, time, start: 0.0 };
        function.start = function.at(0.0);
        function.start.is_finite().then_some(function)
    }

    /// Evaluates the program, given the values of the variables that move.
    fn evaluate<T: Value>(
        &self,
        mut variables: Vec<T>,
        trajectory: impl Fn(&Trajectory, f64) -> T,
        time: [T; 2],
    ) -> T {
        for (variable, how) in &self.moving {
            variables[*variable] = trajectory(how, self.variables[*variable]);
        }
        [variables[self.time], variables[self.time + 1]] = time;
        let mut out = [T::constant(0.0)];
        self.program.eval(&variables, &mut Vec::new(), &mut out);
        out[0]
    }

    /// True if it is defined at all times.
    pub fn is_total(&self) -> bool {
        self.program.is_total() && self.moving.iter().all(|(_, trajectory)| trajectory.is_total())
    }

    /// The value itself at a time since the start.
    pub fn at(&self, tau: f64) -> f64 {
        let time = [self.variables[self.time] + tau, self.variables[self.time + 1] + tau];
        self.evaluate(self.variables.clone(), |trajectory, x| trajectory.at(x, tau), time)
    }

    /// Bounds of the value itself.
    pub fn directly_over(&self, from: f64, to: f64) -> Interval {
        self.bounds(from, to).value
    }

    /// True if the value at the start is this one, but for rounding.
    #[inline]
    pub fn begins_at(&self, x: f64) -> bool {
        (x - self.start).abs() <= 64.0 * f64::EPSILON * self.start.abs()
    }

    /// The displacement at a time since the start.
    pub fn value(&self, tau: f64) -> f64 {
        self.at(tau) - self.start
    }

    /// The rate at a time since the start.
    pub fn rate(&self, tau: f64) -> f64 {
        let still = |value: f64| Dual { value, rate: 0.0 };
        let time = [self.time, self.time + 1].map(|v| Dual { value: self.variables[v] + tau, rate: 1.0 });
        let trajectory = |trajectory: &Trajectory, x: f64| Dual {
            value: trajectory.at(x, tau),
            rate: trajectory.rate(tau),
        };
        self.evaluate(self.variables.iter().map(|x| still(*x)).collect(), trajectory, time).rate
    }

    /// Bounds of displacement and rate from one time to another.
    pub fn over(&self, from: f64, to: f64) -> Dual<Interval> {
        let Dual { value, rate } = self.bounds(from, to);
        Dual { value: Interval { lo: value.lo - self.start, hi: value.hi - self.start, ..value }, rate }
    }

    /// Bounds of value and rate.
    fn bounds(&self, from: f64, to: f64) -> Dual<Interval> {
        let time = [self.time, self.time + 1].map(|v| {
            let value = Interval::spanned(self.variables[v] + from, self.variables[v] + to);
            Dual { value, rate: Interval::constant(1.0) }
        });
        let trajectory = |trajectory: &Trajectory, x: f64| trajectory.within(x, from, to);
        let still = self.variables.iter().map(|x| Dual::constant(*x)).collect();
        self.evaluate(still, trajectory, time)
    }
}
