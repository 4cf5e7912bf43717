//! The prediction of a life: from the values of a module at birth to its first event, as one function.
//!
//! It covers modules that read no other module and whose parameters and first event have closed forms. Whatever is
//! unusual (a sign that is zero or nearly so, a condition inside an equation, a search, a solution that ends, two events
//! at nearly one instant) has no prediction and goes the general way (`event`, `flow`), to the same bits.
//!
//! A *materialised* module keeps its prediction as a [`State`](crate::world::state::State). Of a *lazy* one (`lazy`) only
//! its class and its values at birth are kept; [`retrace`] computes trajectories and event again with the same code.

use smallvec::SmallVec;

use super::closed_form;
use crate::detect::signs::{NEAR, Reach, opposite, rate_at, reach, sign_at_birth};
use crate::scratch::Scratch;
use crate::trajectory::Trajectory;
use crate::world::life::{End, Life, LifeClass};
use crate::world::state::{Change, Signs};
use dlsys_model::{Condition, Rule, Sign, SolutionForm, Solve, Truth, ZeroCrossing};
use dlsys_tree::SimTime;

/// The life of a module from its birth to its first event.
pub struct Prediction {
    pub solve: Option<usize>,
    /// The signs of the rule's atoms from birth to the event.
    pub signs: Signs,
    pub trajectories: SmallVec<[Trajectory; 2]>,
    /// None if the module lives for ever.
    pub end: Option<PredictedEnd>,
    /// The time from birth to the event (or none ever), if nothing else was in question: then it does not depend on when
    /// the module is born, unless the rule reads `t`.
    pub lasting: Option<Option<f64>>,
}

/// The production at the end of a life.
#[derive(Clone, Copy)]
pub enum PredictedEnd {
    /// It applies as soon as the module is there.
    AtBirth { produce: usize },
    /// It applies when a sign has changed.
    Event { change: Change, produce: usize },
}

/// The instant at which the two sides of an atom meet.
#[derive(Clone, Copy, Debug)]
pub struct PredictedCrossing {
    pub time: SimTime,
    /// The time from birth, if it was found as that.
    pub tau: Option<f64>,
    /// The parameter that meets a level, and the level.
    pub level: Option<(usize, f64)>,
}

/// Predicts the life of a module that is born at an instant. The variables in `scratch` are its parameters, then `t` and
/// `age`. None if there is no closed form for it.
pub fn predict(rule: &Rule, birth: SimTime, scratch: &mut Scratch) -> Option<Prediction> {
    let SignsAtBirth { signs, clear, in_doubt } = signs_at_birth(rule, scratch);
    let holds = |guard: &Condition| guard.judge(|i| signs[i]) == Truth::Yes;
    if let Some(produce) = rule.produces.iter().position(|p| holds(&p.guard)) {
        if in_doubt {
            return None;
        }
        let end = Some(PredictedEnd::AtBirth { produce });
        return Some(Prediction { solve: None, signs, trajectories: SmallVec::new(), end, lasting: None });
    }
    if !clear {
        return None;
    }
    let solve = rule.solves.iter().position(|s| holds(&s.guard));
    let active = match solve {
        None if !rule.solves.is_empty() => return None,
        None => None,
        Some(s) => Some(&rule.solves[s]),
    };
    let trajectories = trajectories(rule, active, scratch)?;
    let mut life = Prediction { solve, signs, trajectories, end: None, lasting: Some(None) };
    life.find_first_event(rule, birth, scratch)?;
    let event = match life.end {
        Some(PredictedEnd::Event { change, .. }) => Some(change.time),
        _ => None,
    };
    for trajectory in &life.trajectories {
        match outlives(trajectory.end(), birth, event) {
            Outlives::Always => {}
            Outlives::Event => life.lasting = None,
            Outlives::Not => return None,
        }
    }
    Some(life)
}

/// How long a solution holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outlives {
    /// For ever.
    Always,
    /// Beyond the event at which the life ends.
    Event,
    /// It ends before that, at a pole for instance.
    Not,
}

/// How long a solution holds that ends some time after the birth, or never, in a life that ends with an event, or never.
#[inline]
pub fn outlives(end: Option<f64>, birth: SimTime, event: Option<SimTime>) -> Outlives {
    let Some(end) = end else { return Outlives::Always };
    match event.is_some_and(|at| at.since(birth) < end) {
        true => Outlives::Event,
        false => Outlives::Not,
    }
}

impl Prediction {
    /// Finds the sign that becomes zero first, and the production that follows; None if that has no closed form.
    fn find_first_event(&mut self, rule: &Rule, birth: SimTime, scratch: &mut Scratch) -> Option<()> {
        let (solve, trajectories) = (self.solve, &self.trajectories);
        let meet = |atom: usize| crossing(rule, solve, atom, trajectories, birth, scratch);
        let FirstCrossing { change, lasting } =
            first_crossing(rule.zero_crossings(solve), &self.signs, birth, meet)?;
        self.end = match change {
            // If nothing follows from it, the general way searches on.
            Some(change) => {
                let produce = follows(rule, &self.signs, change.atom())?;
                Some(PredictedEnd::Event { change, produce })
            }
            None => None,
        };
        self.lasting = lasting;
        Some(())
    }
}

/// The first crossing of a life.
#[derive(Clone, Copy)]
pub struct FirstCrossing {
    /// The sign that becomes zero first; None if no sign ever does.
    pub change: Option<Change>,
    /// See [`Prediction::lasting`].
    pub lasting: Option<Option<f64>>,
}

/// The first crossing of a life with these signs from birth on; `meet` gives the instant at which the two sides of an atom meet.
/// None if it has no closed form.
#[inline]
pub fn first_crossing(
    watches: &[ZeroCrossing],
    signs: &[Sign],
    birth: SimTime,
    mut meet: impl FnMut(usize) -> Option<PredictedCrossing>,
) -> Option<FirstCrossing> {
    let mut first: Option<Change> = None;
    let mut lasting = Some(None);
    for (atom, watch) in watches.iter().enumerate() {
        if matches!(watch, ZeroCrossing::Search { .. }) {
            return None;
        }
        let Some(PredictedCrossing { time, tau, level }) = meet(atom) else { continue };
        if time.since(birth) <= 0.0 {
            lasting = None;
            continue;
        }
        let change = Change::new(atom, time, [Sign::Zero, opposite(signs[atom])]).at_level(level);
        let Some(known) = &mut first else {
            first = Some(change);
            lasting = lasting.and(tau).map(Some);
            continue;
        };
        lasting = None;
        let later = time.since(known.time);
        // The order of two events at nearly one instant is decided in the general way.
        if later.abs() <= 2.0 * time.resolution() {
            return None;
        }
        if later < 0.0 {
            *known = change;
        }
    }
    Some(FirstCrossing { change: first, lasting })
}

/// The production that follows when a sign becomes zero while the others are as they were.
pub fn follows(rule: &Rule, signs: &[Sign], zero: usize) -> Option<usize> {
    let at = |i: usize| if i == zero { Sign::Zero } else { signs[i] };
    rule.produces.iter().position(|p| p.guard.judge(at) == Truth::Yes)
}

/// Computes trajectories and event of a life of a known class again, from `life.birth` and `life.values`.
pub fn retrace(rule: &Rule, class: &LifeClass, timeless: bool, life: &mut Life, scratch: &mut Scratch) {
    let birth = life.birth;
    (life.replaced, life.known, life.lasting) = (None, true, false);
    scratch.variables.clear();
    scratch.variables.extend_from_slice(&life.values);
    scratch.variables.extend([birth.to_f64(), birth.since(birth)]);
    let clause = class.solve.map(|s| &rule.solves[s]);
    life.trajectories = trajectories(rule, clause, scratch).unwrap_or_default();
    (life.at, life.tau, life.level) = (birth, None, None);
    if let Some(End::Crossing { atom, .. }) = class.end
        && let Some(crossing) = crossing(rule, class.solve, atom, &life.trajectories, birth, scratch)
    {
        (life.at, life.level) = (crossing.time, crossing.level);
        life.tau = crossing.tau.filter(|_| timeless);
    }
}

/// The parameters at the event of a life, appended to `out`. Where the instant is known from a level, the value is that
/// level, not a rounding of it.
pub fn values_at_event(life: &Life, at: SimTime, out: &mut Vec<f64>) {
    let tau = at.since(life.birth).max(0.0);
    for (i, &x) in life.values.iter().enumerate() {
        out.push(match (life.trajectories.get(i), life.level) {
            (_, Some((parameter, level))) if parameter == i => level,
            (None | Some(Trajectory::Rest), _) => x,
            (Some(formula), _) => formula.at(x, tau),
        });
    }
}

/// The trajectories under a clause from the variables in `scratch`; None if some have no simple closed form. An empty list
/// means that no parameter moves.
fn trajectories(
    rule: &Rule,
    clause: Option<&Solve>,
    scratch: &mut Scratch,
) -> Option<SmallVec<[Trajectory; 2]>> {
    let mut trajectories = SmallVec::new();
    let Some(clause) = clause.filter(|s| !s.of.is_empty()) else { return Some(trajectories) };
    let simple = |law: &SolutionForm| {
        matches!(law, SolutionForm::Polynomial(_) | SolutionForm::Quadratic(_) | SolutionForm::Driven(_))
    };
    if !clause.switches.is_empty() || !clause.solution_forms.iter().all(simple) {
        return None;
    }
    trajectories.resize(rule.parameters.len(), Trajectory::Rest);
    closed_form::formulas(clause, rule.time_variable(), scratch, &mut trajectories).then_some(trajectories)
}

/// The signs of a newborn module's atoms.
#[derive(Default)]
struct SignsAtBirth {
    signs: Signs,
    /// All are clearly different from zero.
    clear: bool,
    /// Some sides differ by so little that it may be the resolution of time.
    in_doubt: bool,
}

fn signs_at_birth(rule: &Rule, scratch: &mut Scratch) -> SignsAtBirth {
    let mut at_birth = SignsAtBirth { clear: true, ..SignsAtBirth::default() };
    if rule.atoms.is_empty() {
        return at_birth;
    }
    let mut out: SmallVec<[f64; 8]> = smallvec::smallvec![0.0; rule.sides.outputs()];
    rule.sides.eval(&scratch.variables, &mut scratch.registers, &mut out);
    let own = &scratch.variables[..rule.parameters.len()];
    let scale = own.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    for side in out.chunks(2) {
        let (clear, sign) = (is_clear(side[0], side[1], scale), sign_at_birth(side[0], side[1]));
        at_birth.clear &= clear;
        at_birth.in_doubt |= !clear && matches!(sign, Sign::Plus | Sign::Minus);
        at_birth.signs.push(sign);
    }
    at_birth
}

/// True if the sides of an atom clearly differ at birth, in a module whose largest parameter, or 1, is `scale`.
#[inline]
pub fn is_clear(a: f64, b: f64, scale: f64) -> bool {
    let gap = a - b;
    // Not so for NaN and for infinite sides either.
    gap.abs() > NEAR * scale.max(a.abs()) && gap.is_finite()
}

/// The instant at which an atom's sides meet, of a module born at an instant, if it has a closed form. The variables in
/// `scratch` are those of the birth.
fn crossing(
    rule: &Rule,
    solve: Option<usize>,
    atom: usize,
    trajectories: &[Trajectory],
    birth: SimTime,
    scratch: &mut Scratch,
) -> Option<PredictedCrossing> {
    let ZeroCrossing::Formula { variable, level } = &rule.zero_crossings(solve)[atom] else { return None };
    let (variable, time) = (*variable, rule.time_variable());
    let clause = solve.map(|s| &rule.solves[s]);
    if clause.is_some_and(|s| s.unreachable[atom]) {
        return None;
    }
    let mut out = [0.0];
    let Scratch { variables, registers, rates } = scratch;
    level.eval(variables, registers, &mut out);
    let [level] = out;
    let start = variables[variable];
    let exact = || rate_at(clause, variables, variable, level, registers, rates);
    meeting((variable, time), level, trajectories.get(variable), (birth, start), exact)
}

/// The instant at which a variable, of a module born at an instant with some value of it, takes a level. `time` is the number of
/// `t`; `exact` as for [`reach`].
#[inline]
pub fn meeting(
    (variable, time): (usize, usize),
    level: f64,
    trajectory: Option<&Trajectory>,
    (birth, start): (SimTime, f64),
    exact: impl FnOnce() -> f64,
) -> Option<PredictedCrossing> {
    let tau = match reach(variable, time, level, trajectory, start, exact)? {
        Reach::At(time) => return Some(PredictedCrossing { time, tau: None, level: None }),
        Reach::Age(age) => age - start,
        Reach::After(tau) => tau,
    };
    let level = (variable < time).then_some((variable, level));
    Some(PredictedCrossing { time: birth.after(tau), tau: Some(tau), level })
}
