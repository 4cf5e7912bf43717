//! The variables of a rule along a stretch of time: values, rates and bounds at any position of it.

use super::World;
use super::context::gather;
use crate::trajectory::Trajectory;
use crate::world::coupled_solution::DenseComponent;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::{Dual, Interval, Value};
use dlsys_model::{AffineSum, Rule};
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime};
use smallvec::SmallVec;

/// The rounding error of a value, relative to it.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A value with its rounding and another error.
pub fn around(x: f64, more: f64) -> Interval {
    let width = ROUNDING * x.abs() + more;
    Interval { lo: x - width, hi: x + width, partial: false }
}

/// The variables of a module's rule along a stretch of time: positions 0 to 1 of `h` from `start`.
pub struct Path<'p> {
    pub world: &'p World,
    pub state: &'p State,
    pub rule: &'p Rule,
    pub start: SimTime,
    pub h: f64,
    /// Which variables are wanted; all where this is empty.
    wanted: &'p [bool],
    /// The module's own step, if it is not stored in its state yet.
    step: Option<&'p Dense>,
}

/// Values that are much smaller are not followed to their own accuracy; see the step control of `dlsys_ode`.
pub const NEXT_TO_NOTHING: f64 = 1e-17;

impl<'p> Path<'p> {
    pub fn new(world: &'p World, state: &'p State, rule: &'p Rule, start: SimTime, h: f64) -> Path<'p> {
        Path { world, state, rule, start, h, wanted: &rule.watched, step: None }
    }

    /// The age of the module at the start. Births stand elsewhere in memory.
    fn age(&self) -> f64 {
        self.start.since(self.world.tree.birth(self.state.id))
    }

    /// The path of all variables that equations read; along a step of the module's own, if that is given.
    pub fn of_equations(
        world: &'p World,
        state: &'p State,
        rule: &'p Rule,
        (start, h): (SimTime, f64),
        step: Option<&'p Dense>,
    ) -> Path<'p> {
        Path { wanted: &[], step, ..Path::new(world, state, rule, start, h) }
    }

    /// The dense output that a numeric trajectory follows along this stretch.
    fn piece<'s>(&'s self, state: &'s State, law: Law) -> Option<DenseComponent<'s>> {
        match law {
            Law::Step(c) => {
                let own = self.step.filter(|_| state.id == self.state.id);
                let dense = own.or(state.trajectories.step().map(|step| &step.dense))?;
                Some(DenseComponent::new(dense, c as usize, self.start, self.h))
            }
            Law::Coupled(c) => self.world.coupled.as_ref()?.piece(c as usize, self.start, self.h),
            Law::Rest | Law::Formula(_) => None,
        }
    }

    /// The dense output that an own parameter follows, if it is integrated.
    pub fn dense_component(&self, parameter: usize) -> Option<DenseComponent<'_>> {
        self.piece(self.state, self.state.trajectories.get(parameter)?)
    }

    /// Bounds of an own parameter over the whole stretch, if it follows dense output.
    pub fn dense_bounds(&self, parameter: usize) -> Option<Interval> {
        Some(self.dense_component(parameter)?.bounds())
    }

    /// Gives each variable that is wanted to one of three functions: values that rest, pieces of dense output, and formulas
    /// with their start value and the time since it.
    fn each<T: Value>(
        &self,
        out: &mut Vec<T>,
        rest: impl Fn(f64) -> T,
        piece: impl Fn(&DenseComponent) -> T,
        formula: impl Fn(&Trajectory, f64, f64) -> T,
        time: impl Fn(f64) -> T,
    ) {
        out.clear();
        let wanted = |i: usize| self.wanted.get(i).copied().unwrap_or(true);
        for &id in std::iter::once(&self.state.id).chain(self.state.context.context()) {
            self.append(id, wanted, out, &rest, &piece, &formula);
        }
        let age = wanted(self.rule.variables - 1) || !self.rule.aggregates.is_empty();
        let times = [time(self.start.to_f64()), time(if age { self.age() } else { 0.0 })];
        if self.rule.aggregates.is_empty() {
            out.resize(self.rule.variables - 2, T::constant(0.0));
            out.extend(times);
            return;
        }
        let child = |id, out: &mut Vec<T>| self.append(id, |_| true, out, &rest, &piece, &formula);
        gather(self.rule, &self.state.context, times, out, &mut Vec::new(), wanted, child);
    }

    /// Appends the parameters of one module, of which those are computed whose place in `out` is read.
    #[inline]
    fn append<T: Value>(
        &self,
        id: ModuleId,
        reads: impl Fn(usize) -> bool,
        out: &mut Vec<T>,
        rest: &impl Fn(f64) -> T,
        piece: &impl Fn(&DenseComponent) -> T,
        formula: &impl Fn(&Trajectory, f64, f64) -> T,
    ) {
        let values = self.world.tree.parameters(id);
        if !(out.len()..out.len() + values.len()).any(&reads) {
            // Any value will do.
            return out.extend(values.iter().map(|x| rest(*x)));
        }
        let Some(state) = self.world.state(id).filter(|s| !s.trajectories.is_empty()) else {
            return out.extend(values.iter().map(|x| rest(*x)));
        };
        let offset = self.start.since(state.since);
        for (&x, law) in values.iter().zip(state.trajectories.iter()) {
            let reads = reads(out.len());
            out.push(match law {
                _ if !reads => rest(x),
                Law::Rest => rest(x),
                Law::Step(_) | Law::Coupled(_) => match self.piece(state, law) {
                    Some(along) => piece(&along),
                    None => rest(x),
                },
                Law::Formula(trajectory) => formula(trajectory, x, offset),
            });
        }
    }

    /// All variables at the start.
    pub fn start(&self, out: &mut Vec<f64>) {
        self.world.variables(self.rule, self.state.id, &self.state.context, self.start, out);
    }

    pub fn at(&self, position: f64, out: &mut Vec<f64>) {
        let tau = position * self.h;
        self.each(
            out,
            |x| x,
            |piece| piece.value(position),
            |trajectory, x, offset| trajectory.at(x, offset + tau),
            |t| t + tau,
        );
    }

    /// Values at the start with their rates, per unit of position.
    pub fn departure(&self, out: &mut Vec<Dual<f64>>) {
        let h = self.h;
        self.each(
            out,
            Dual::constant,
            |piece| piece.departure(),
            |trajectory, x, offset| Dual {
                value: trajectory.at(x, offset),
                rate: h * trajectory.rate(offset),
            },
            |t| Dual { value: t, rate: h },
        );
    }

    /// All variables that equations read at a position.
    pub fn everything_at(&self, position: f64, out: &mut Vec<f64>) {
        self.at(position, out);
        out.extend(self.state.marks.switch_values());
    }

    /// Bounds of all variables that equations read.
    pub fn everything_over(&self, lo: f64, hi: f64, out: &mut Vec<Interval>) {
        let h = self.h;
        self.each(
            out,
            Interval::constant,
            |piece| if (lo, hi) == (0.0, 1.0) { piece.bounds() } else { piece.over(lo, hi).value },
            |trajectory, x, offset| trajectory.within(x, offset + lo * h, offset + hi * h).value,
            |t| Interval::spanned(t + lo * h, t + hi * h),
        );
        out.extend(self.state.marks.switch_values().map(Interval::constant));
    }

    /// The same with the bounds of their rates, per unit of position.
    pub fn everything_along(&self, lo: f64, hi: f64, out: &mut Vec<Dual<Interval>>) {
        self.over(lo, hi, out);
        out.extend(self.state.marks.switch_values().map(Dual::constant));
    }

    /// Bounds of values and rates from one position to another.
    pub fn over(&self, lo: f64, hi: f64, out: &mut Vec<Dual<Interval>>) {
        let h = self.h;
        self.each(
            out,
            Dual::constant,
            |piece| piece.over(lo, hi),
            |trajectory, x, offset| {
                let Dual { value, rate } = trajectory.within(x, offset + lo * h, offset + hi * h);
                Dual { value, rate: Interval { lo: h * rate.lo, hi: h * rate.hi, ..rate } }
            },
            |t| Dual { value: Interval::spanned(t + lo * h, t + hi * h), rate: Interval::constant(h) },
        );
    }

    /// Bounds of a sum of variables, and of its rate, if those that move do so along one dense output.
    pub fn sum_over(&self, sum: &AffineSum, lo: f64, hi: f64) -> Option<Dual<Interval>> {
        let (mut constant, mut moving) = (sum.constant, None);
        for &(variable, factor) in &sum.terms {
            let (id, parameter) = self.place_of(variable)?;
            let state = self.world.state(id);
            match state.and_then(|state| Some((state, state.trajectories.get(parameter)?))) {
                Some((state, law)) if !matches!(law, Law::Rest) => {
                    if !self.piece(state, law)?.add_to(factor, &mut moving) {
                        return None;
                    }
                }
                _ => constant += factor * self.world.tree.parameters(id)[parameter],
            }
        }
        let (first, coefficients) = moving?;
        let Dual { value, rate } = first.sum_over(coefficients, lo, hi);
        Some(Dual { value: Interval { lo: value.lo + constant, hi: value.hi + constant, ..value }, rate })
    }

    /// Bounds of the values at a position, given the errors of integration and of rounding.
    pub fn uncertain(&self, position: f64, out: &mut Vec<Interval>) {
        let tau = position * self.h;
        self.each(
            out,
            |x| around(x, 0.0),
            // Beyond the position the step may lead anywhere.
            |piece| {
                around(piece.value(position), piece.error_of(piece.over(0.0, position).value.magnitude()))
            },
            |trajectory, x, offset| {
                let value = trajectory.at(x, offset + tau);
                around(value, ROUNDING * trajectory.rounded(x, value))
            },
            |t| around(t + tau, 0.0),
        );
    }

    /// The values at a position, those that are integrated with the errors that they have when they are next to nothing; if `on_the_way`, to what they
    /// become in the step: a polynomial through later values errs by a part of these.
    pub fn next_to_nothing(&self, position: f64, on_the_way: bool, out: &mut Vec<Interval>) {
        let tau = position * self.h;
        let exactly = |x| Interval::constant(x);
        self.each(
            out,
            exactly,
            |piece| {
                let most = if on_the_way { piece.bounds().magnitude() } else { 0.0 };
                around(piece.value(position), piece.error_of(NEXT_TO_NOTHING.max(most)))
            },
            |trajectory, x, offset| exactly(trajectory.at(x, offset + tau)),
            |t| exactly(t + tau),
        );
    }

    /// False for modules that stand alone, whose values are followed to their own accuracy however small they are.
    pub fn reads_others(&self) -> bool {
        Path::is_among_others(self.state)
    }

    /// See [`reads_others`](Path::reads_others).
    pub fn is_among_others(state: &State) -> bool {
        state.coupled || !state.context.context().is_empty()
    }

    /// True if some of these variables is integrated: it follows dense output, or is a sum in which something does.
    pub fn is_integrated(&self, variables: &[usize]) -> bool {
        variables.iter().any(|&variable| {
            let aggregate = variable.checked_sub(self.rule.first_aggregate);
            if let Some(number) = aggregate.filter(|number| *number < self.rule.aggregates.len()) {
                let term = self.rule.aggregates[number].term.reads();
                let others = term.iter().copied().filter(|v| *v < self.rule.first_aggregate);
                let mut children = self.state.context.children(number).iter();
                return self.is_integrated(&others.collect::<SmallVec<[usize; 8]>>())
                    || children.any(|id| self.world.state(*id).is_some_and(State::is_numeric));
            }
            self.law_of(variable).is_some_and(Law::is_numeric)
        })
    }

    /// The module of the rule or its context that has a variable for a parameter, and the number of that; None for aggregates and times.
    fn place_of(&self, variable: usize) -> Option<(ModuleId, usize)> {
        let mut parameter = variable;
        for &id in std::iter::once(&self.state.id).chain(self.state.context.context()) {
            let count = self.world.tree.parameters(id).len();
            if parameter < count {
                return Some((id, parameter));
            }
            parameter -= count;
        }
        None
    }

    /// The trajectory of a variable that is a parameter of a module with equations.
    fn law_of(&self, variable: usize) -> Option<Law<'_>> {
        let (id, parameter) = self.place_of(variable)?;
        self.world.state(id)?.trajectories.get(parameter)
    }

    /// True for a parameter that follows a function of time, which may jump.
    pub fn is_function(&self, variable: usize) -> bool {
        self.law_of(variable).is_some_and(|law| matches!(law, Law::Formula(Trajectory::Function(_))))
    }

    /// True for a variable that is defined at all times of the path: what a function of time reads may end. Of aggregates nothing is known.
    pub fn is_total(&self, variable: usize) -> bool {
        match self.law_of(variable) {
            Some(Law::Formula(trajectory)) => trajectory.is_total(),
            Some(_) => true,
            None => variable < self.rule.first_aggregate,
        }
    }

    /// False for a variable that is a parameter at rest.
    pub fn moves(&self, variable: usize) -> bool {
        let rests = self.law_of(variable).is_none_or(|law| matches!(law, Law::Rest));
        self.place_of(variable).is_none() || !rests
    }

    /// The estimated error of integrated values along the path, relative to their size; 0 if there are none.
    pub fn error(&self) -> f64 {
        let solution = self.world.coupled.as_ref().map_or(0.0, |solution| solution.error);
        if self.state.coupled && solution > 0.0 {
            return solution;
        }
        let error = |state: &State| {
            let of = |law: Law| match law {
                Law::Coupled(_) => solution,
                Law::Step(_) => state.trajectories.step().map_or(0.0, |step| step.dense.error),
                Law::Rest | Law::Formula(_) => 0.0,
            };
            state.trajectories.iter().map(of).fold(0.0, f64::max)
        };
        let others = self.state.context.iter().filter_map(|id| self.world.state(*id));
        others.map(error).fold(error(self.state), f64::max)
    }

    /// Bounds of values over the whole stretch, given the errors of integration.
    pub fn whole(&self, out: &mut Vec<Interval>) {
        let h = self.h;
        self.each(
            out,
            Interval::constant,
            |piece| {
                let bounds = piece.bounds();
                let width = piece.error_of(bounds.magnitude());
                Interval { lo: bounds.lo - width, hi: bounds.hi + width, ..bounds }
            },
            |trajectory, x, offset| trajectory.within(x, offset, offset + h).value,
            |t| Interval::spanned(t, t + h),
        );
    }
}
