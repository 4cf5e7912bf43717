//! The modules and how they move: values at any instant, and along a stretch of time.

use super::around::{Around, gather};
use super::career::Careers;
use super::course::{Course, Piece};
use super::motion::Motion;
use super::state::State;
use dlsys_expr::{Dual, Interval, Value};
use dlsys_model::{Rule, Sum};
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime, Tree};
use smallvec::SmallVec;

/// What rounding makes of a value, relative.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The growing structure with the motions of its parameters.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Its values are those at the start of each motion.
    pub tree: Tree,
    /// By slot of the tree, as far as there are any; None for modules without rules, and for light ones.
    pub states: Vec<Option<Box<State>>>,
    /// What is known of light modules, whose labels in the tree are numbers of careers.
    pub careers: Careers,
    /// How the coupled modules move.
    pub coupled: Option<Course>,
}

impl Plant {
    pub fn state(&self, id: ModuleId) -> Option<&State> {
        self.states.get(id.slot())?.as_deref().filter(|s| s.id == id && s.is_alive)
    }

    pub fn state_mut(&mut self, id: ModuleId) -> Option<&mut State> {
        self.states.get_mut(id.slot())?.as_deref_mut().filter(|s| s.id == id && s.is_alive)
    }

    /// The memory for a module's state; it may be that of another, dead one.
    pub fn make_state(&mut self, id: ModuleId) -> &mut State {
        let slot = id.slot();
        if self.states.len() <= slot {
            self.states.resize(slot + 1, None);
        }
        self.states[slot].get_or_insert_with(|| Box::new(State::new(id)))
    }

    /// Gives a module a state that knows nothing yet.
    pub fn new_state(&mut self, id: ModuleId) -> &mut State {
        let state = self.make_state(id);
        *state = State::new(id);
        state
    }

    /// True for a module that is alive and light.
    pub fn is_light(&self, id: ModuleId) -> bool {
        self.tree.label_if_alive(id).is_some_and(|label| self.careers.get(label).is_some())
    }

    /// The rule and the clause that a module lives under.
    pub fn rule_and_clause(&self, id: ModuleId) -> (Option<usize>, Option<usize>) {
        match self.careers.get(self.tree.label(id)) {
            Some(career) => (Some(career.rule), career.solve),
            None => self.state(id).map_or((None, None), |s| (s.rule, s.solve)),
        }
    }

    /// A parameter, moving since `state.since` from the value `x`, at an instant.
    #[inline]
    fn moved(&self, state: &State, motion: &Motion, x: f64, at: SimTime) -> f64 {
        match motion {
            Motion::Rest => x,
            Motion::Step(component) => match state.step.as_ref().filter(|s| s.live) {
                Some(step) => step.dense.value(*component as usize, step.dense.position(at)),
                None => x,
            },
            Motion::Coupled(component) => match &self.coupled {
                Some(course) => course.value(*component as usize, at).unwrap_or(x),
                None => x,
            },
            formula => x + formula.value(at.since(state.since).max(0.0)),
        }
    }

    /// The parameters of a module at an instant, appended to `out`; not of a light one, whose motions are not here.
    pub fn values(&self, id: ModuleId, at: SimTime, out: &mut Vec<f64>) {
        debug_assert!(self.careers.get(self.tree.label(id)).is_none_or(|career| career.is_over_at_birth()));
        let values = self.tree.parameters(id);
        match self.state(id).filter(|s| !s.motions.is_empty()) {
            None => out.extend_from_slice(values),
            Some(state) => {
                for (&x, motion) in values.iter().zip(&state.motions[..]) {
                    let rests = matches!(motion, Motion::Rest);
                    out.push(if rests { x } else { self.moved(state, motion, x, at) });
                }
            }
        }
    }

    /// One parameter of a module at an instant.
    pub fn value(&self, id: ModuleId, parameter: usize, at: SimTime) -> f64 {
        let x = self.tree.parameters(id)[parameter];
        let moving = self.state(id).and_then(|s| Some((s, s.motions.get(parameter)?)));
        moving.map_or(x, |(state, motion)| self.moved(state, motion, x, at))
    }

    /// Makes the values at an instant those of the tree, and the motions begin there, all at rest.
    pub fn materialise(&mut self, id: ModuleId, at: SimTime) {
        self.materialise_except(id, at, &[]);
    }

    /// The same, but for parameters whose values then are given.
    pub fn materialise_except(&mut self, id: ModuleId, at: SimTime, given: &[(usize, f64)]) {
        let places = self.tree.places(id);
        let mut moved: SmallVec<[(usize, f64); 4]> = SmallVec::new();
        let Some(state) = self.state(id) else { return };
        for ((i, place), motion) in places.enumerate().zip(&state.motions[..]) {
            if let Some(&(_, value)) = given.iter().find(|(parameter, _)| *parameter == i) {
                moved.push((place, value));
            } else if !matches!(motion, Motion::Rest) {
                moved.push((place, self.moved(state, motion, self.tree.values()[place], at)));
            }
        }
        for (place, value) in moved {
            self.tree.set_value(place, value);
        }
        let Some(state) = self.state_mut(id) else { return };
        state.since = at;
        for motion in &mut state.motions {
            *motion = Motion::Rest;
        }
    }

    /// The end of the stretch, from an instant on, in which all coupled components that a module reads follow one polynomial.
    pub fn knot(&self, state: &State, course: &Course, from: SimTime) -> SimTime {
        let mut knot = course.end;
        if course.is_whole() {
            return knot;
        }
        for &id in std::iter::once(&state.id).chain(&state.context) {
            for motion in self.state(id).map_or(&[][..], |s| &s.motions) {
                if let Motion::Coupled(component) = motion {
                    let end = course.knot(*component as usize, from);
                    if end.since(knot) < 0.0 {
                        knot = end;
                    }
                }
            }
        }
        knot
    }

    /// The variables of a rule at an instant: parameters, those of the context, aggregates, `t` and `age`.
    pub fn variables(&self, rule: &Rule, id: ModuleId, around: &Around, at: SimTime, out: &mut Vec<f64>) {
        out.clear();
        self.values(id, at, out);
        for module in around.context() {
            self.values(*module, at, out);
        }
        let time = [at.to_f64(), at.since(self.tree.birth(id))];
        if rule.aggregates.is_empty() {
            out.resize(rule.variables - 2, 0.0);
            out.extend(time);
            return;
        }
        let values = |child, out: &mut Vec<f64>| self.values(child, at, out);
        gather(rule, around, time, out, &mut Vec::new(), |_| true, values);
    }
}

impl Plant {
    /// The same where only some variables are read: what is not read may be any number.
    pub fn variables_read(
        &self,
        (rule, reads): (&Rule, &[bool]),
        id: ModuleId,
        around: &Around,
        at: SimTime,
        out: &mut Vec<f64>,
    ) {
        if !rule.aggregates.is_empty() {
            return self.variables(rule, id, around, at, out);
        }
        out.clear();
        self.values(id, at, out);
        let context = reads.get(out.len()..rule.variables - 2).unwrap_or_default();
        if context.contains(&true) {
            around.context().iter().for_each(|module| self.values(*module, at, out));
        }
        out.resize(rule.variables - 2, 0.0);
        out.extend([at.to_f64(), at.since(self.tree.birth(id))]);
    }
}

/// The variables of a module's rule along a stretch of time: positions 0 to 1 of `h` from `start`.
pub struct Path<'p> {
    pub plant: &'p Plant,
    pub state: &'p State,
    pub rule: &'p Rule,
    pub start: SimTime,
    pub h: f64,
    age: f64,
    /// Which variables are wanted; all where this is empty.
    wanted: &'p [bool],
    /// The module's own step, if it is not yet among what is known.
    step: Option<&'p Dense>,
}

impl<'p> Path<'p> {
    pub fn new(plant: &'p Plant, state: &'p State, rule: &'p Rule, start: SimTime, h: f64) -> Path<'p> {
        let age = start.since(plant.tree.birth(state.id));
        Path { plant, state, rule, start, h, age, wanted: &rule.watched, step: None }
    }

    /// The path of all variables that equations read; along a step of the module's own, if that is given.
    pub fn of_equations(
        plant: &'p Plant,
        state: &'p State,
        rule: &'p Rule,
        (start, h): (SimTime, f64),
        step: Option<&'p Dense>,
    ) -> Path<'p> {
        Path { wanted: &[], step, ..Path::new(plant, state, rule, start, h) }
    }

    /// What numeric motions follow along this stretch.
    fn piece<'s>(&'s self, state: &'s State, motion: &Motion) -> Option<Piece<'s>> {
        match motion {
            Motion::Step(c) => {
                let own = self.step.filter(|_| state.id == self.state.id);
                let dense = own.or(state.step.as_ref().map(|step| &step.dense))?;
                Some(Piece::new(dense, *c as usize, self.start, self.h))
            }
            Motion::Coupled(c) => self.plant.coupled.as_ref()?.piece(*c as usize, self.start, self.h),
            _ => None,
        }
    }

    /// Bounds of an own parameter over the whole stretch, if it follows dense output.
    pub fn dense_bounds(&self, parameter: usize) -> Option<Interval> {
        let motion = self.state.motions.get(parameter)?;
        Some(self.piece(self.state, motion)?.bounds())
    }

    /// Gives each variable that is wanted to one of three functions: values that rest, pieces of dense output, and formulas
    /// with their start value and the time since it.
    fn each<T: Value>(
        &self,
        out: &mut Vec<T>,
        rest: impl Fn(f64) -> T,
        piece: impl Fn(&Piece) -> T,
        formula: impl Fn(&Motion, f64, f64) -> T,
        time: impl Fn(f64) -> T,
    ) {
        out.clear();
        let wanted = |i: usize| self.wanted.get(i).copied().unwrap_or(true);
        let append = |id: ModuleId, reads: &dyn Fn(usize) -> bool, out: &mut Vec<T>| {
            let values = self.plant.tree.parameters(id);
            if !(out.len()..out.len() + values.len()).any(reads) {
                // Any value will do.
                return out.extend(values.iter().map(|x| rest(*x)));
            }
            let Some(state) = self.plant.state(id).filter(|s| !s.motions.is_empty()) else {
                return out.extend(values.iter().map(|x| rest(*x)));
            };
            let offset = self.start.since(state.since);
            for (&x, motion) in values.iter().zip(&state.motions) {
                let reads = reads(out.len());
                out.push(match motion {
                    _ if !reads => rest(x),
                    Motion::Rest => rest(x),
                    Motion::Step(_) | Motion::Coupled(_) => match self.piece(state, motion) {
                        Some(along) => piece(&along),
                        None => rest(x),
                    },
                    motion => formula(motion, x, offset),
                });
            }
        };
        for &id in std::iter::once(&self.state.id).chain(self.state.context.context()) {
            append(id, &wanted, out);
        }
        let times = [time(self.start.to_f64()), time(self.age)];
        if self.rule.aggregates.is_empty() {
            out.resize(self.rule.variables - 2, T::constant(0.0));
            out.extend(times);
            return;
        }
        let child = |id, out: &mut Vec<T>| append(id, &|_| true, out);
        gather(self.rule, &self.state.context, times, out, &mut Vec::new(), wanted, child);
    }

    /// All variables at the start.
    pub fn start(&self, out: &mut Vec<f64>) {
        self.plant.variables(self.rule, self.state.id, &self.state.context, self.start, out);
    }

    pub fn at(&self, position: f64, out: &mut Vec<f64>) {
        let tau = position * self.h;
        self.each(
            out,
            |x| x,
            |piece| piece.value(position),
            |motion, x, offset| x + motion.value(offset + tau),
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
            |motion, x, offset| Dual { value: x + motion.value(offset), rate: h * motion.rate(offset) },
            |t| Dual { value: t, rate: h },
        );
    }

    /// All variables that equations read at a position.
    pub fn everything_at(&self, position: f64, out: &mut Vec<f64>) {
        self.at(position, out);
        out.extend(self.state.switches.iter().map(|&on| f64::from(u8::from(on))));
    }

    /// Bounds of all variables that equations read. If `held`, what is integrated stays as it is in the middle.
    pub fn everything_over(&self, lo: f64, hi: f64, held: bool, out: &mut Vec<Interval>) {
        let h = self.h;
        self.each(
            out,
            Interval::constant,
            |piece| match held {
                true => Interval::constant(piece.value(0.5 * (lo + hi))),
                false => piece.over(lo, hi).value,
            },
            |motion, x, offset| {
                let value = motion.over(offset + lo * h, offset + hi * h).value;
                Interval { lo: x + value.lo, hi: x + value.hi, ..value }
            },
            |t| Interval::spanned(t + lo * h, t + hi * h),
        );
        out.extend(self.state.switches.iter().map(|&on| Interval::constant(f64::from(u8::from(on)))));
    }

    /// Bounds of values and rates from one position to another.
    pub fn over(&self, lo: f64, hi: f64, out: &mut Vec<Dual<Interval>>) {
        let h = self.h;
        self.each(
            out,
            Dual::constant,
            |piece| piece.over(lo, hi),
            |motion, x, offset| {
                let Dual { value, rate } = motion.over(offset + lo * h, offset + hi * h);
                let shifted = Interval { lo: x + value.lo, hi: x + value.hi, ..value };
                Dual { value: shifted, rate: Interval { lo: h * rate.lo, hi: h * rate.hi, ..rate } }
            },
            |t| Dual { value: Interval::spanned(t + lo * h, t + hi * h), rate: Interval::constant(h) },
        );
    }

    /// Bounds of a sum of variables, and of its rate, if those that move do so along one dense output.
    pub fn sum_over(&self, sum: &Sum, lo: f64, hi: f64) -> Option<Dual<Interval>> {
        let (mut constant, mut moving) = (sum.constant, None);
        for &(variable, factor) in &sum.terms {
            let mut parameter = variable;
            let mut modules = std::iter::once(&self.state.id).chain(self.state.context.context());
            let id = *modules.find(|id| {
                let count = self.plant.tree.parameters(**id).len();
                let is_here = parameter < count;
                parameter -= if is_here { 0 } else { count };
                is_here
            })?;
            let state = self.plant.state(id);
            match state.and_then(|state| Some((state, state.motions.get(parameter)?))) {
                Some((state, motion)) if !matches!(motion, Motion::Rest) => {
                    if !self.piece(state, motion)?.add_to(factor, &mut moving) {
                        return None;
                    }
                }
                _ => constant += factor * self.plant.tree.parameters(id)[parameter],
            }
        }
        let (first, coefficients) = moving?;
        let Dual { value, rate } = first.sum_over(coefficients, lo, hi);
        Some(Dual { value: Interval { lo: value.lo + constant, hi: value.hi + constant, ..value }, rate })
    }

    /// What the values may be at a position, given the errors of integration and of rounding.
    pub fn uncertain(&self, position: f64, out: &mut Vec<Interval>) {
        let tau = position * self.h;
        let around = |x: f64, more: f64| {
            let width = ROUNDING * x.abs() + more;
            Interval { lo: x - width, hi: x + width, partial: false }
        };
        self.each(
            out,
            |x| around(x, 0.0),
            // Beyond the position the step may lead anywhere.
            |piece| {
                around(piece.value(position), piece.error() * piece.over(0.0, position).value.magnitude())
            },
            |motion, x, offset| around(x + motion.value(offset + tau), ROUNDING * x.abs()),
            |t| around(t + tau, 0.0),
        );
    }

    /// What integrated values along the path may be wrong by, as a part of their size; 0 if there are none.
    pub fn error(&self) -> f64 {
        let course = self.plant.coupled.as_ref().map_or(0.0, |course| course.error);
        if self.state.coupled && course > 0.0 {
            return course;
        }
        let error = |state: &State| {
            let of = |motion: &Motion| match motion {
                Motion::Coupled(_) => course,
                Motion::Step(_) => state.step.as_ref().map_or(0.0, |step| step.dense.error),
                _ => 0.0,
            };
            state.motions.iter().map(of).fold(0.0, f64::max)
        };
        let others = self.state.context.iter().filter_map(|id| self.plant.state(*id));
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
                let width = piece.error() * bounds.magnitude();
                Interval { lo: bounds.lo - width, hi: bounds.hi + width, ..bounds }
            },
            |motion, x, offset| {
                let value = motion.over(offset, offset + h).value;
                Interval { lo: x + value.lo, hi: x + value.hi, ..value }
            },
            |t| Interval::spanned(t, t + h),
        );
    }
}
