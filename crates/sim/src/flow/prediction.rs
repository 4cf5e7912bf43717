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
struct PredictedCrossing {
    time: SimTime,
    /// The time from birth, if it was found as that.
    tau: Option<f64>,
    /// The parameter that meets a level, and the level.
    level: Option<(usize, f64)>,
}

/// Predicts the life of a module that is born at an instant. The variables in `scratch` are its parameters, then `t` and
/// `age`. None if there is no closed form for it.
pub fn predict(rule: &Rule, birth: SimTime, scratch: &mut Scratch) -> Option<Prediction> {
    let (signs, clear) = signs_at_birth(rule, scratch);
    let holds = |guard: &Condition| guard.judge(|i| signs[i]) == Truth::Yes;
    if let Some(produce) = rule.produces.iter().position(|p| holds(&p.guard)) {
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
    for end in life.trajectories.iter().filter_map(Trajectory::end) {
        match life.end {
            Some(PredictedEnd::Event { change, .. }) if change.time.since(birth) < end => {}
            _ => return None,
        }
        life.lasting = None;
    }
    Some(life)
}

impl Prediction {
    /// Finds the sign that becomes zero first, and the production that follows; None if that has no closed form.
    fn find_first_event(&mut self, rule: &Rule, birth: SimTime, scratch: &mut Scratch) -> Option<()> {
        let mut first: Option<Change> = None;
        for (atom, watch) in rule.zero_crossings(self.solve).iter().enumerate() {
            if matches!(watch, ZeroCrossing::Search(_)) {
                return None;
            }
            let Some(crossing) = crossing(rule, self.solve, atom, &self.trajectories, birth, scratch) else {
                continue;
            };
            let PredictedCrossing { time, tau, level } = crossing;
            if time.since(birth) <= 0.0 {
                self.lasting = None;
                continue;
            }
            let change = Change { atom, time, at: Sign::Zero, after: opposite(self.signs[atom]), level };
            let Some(known) = &mut first else {
                first = Some(change);
                self.lasting = self.lasting.and(tau).map(Some);
                continue;
            };
            self.lasting = None;
            let later = time.since(known.time);
            // The order of two events at nearly one instant is decided in the general way.
            if later.abs() <= 2.0 * time.resolution() {
                return None;
            }
            if later < 0.0 {
                *known = change;
            }
        }
        let Some(change) = first else { return Some(()) };
        // If nothing follows from it, the general way searches on.
        let at = |i: usize| if i == change.atom { Sign::Zero } else { self.signs[i] };
        let produce = rule.produces.iter().position(|p| p.guard.judge(at) == Truth::Yes)?;
        self.end = Some(PredictedEnd::Event { change, produce });
        Some(())
    }
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
            (Some(formula), _) => x + formula.value(tau),
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

/// The signs of a newborn module's atoms, and whether all are clearly different from zero.
fn signs_at_birth(rule: &Rule, scratch: &mut Scratch) -> (Signs, bool) {
    let mut signs = Signs::new();
    if rule.atoms.is_empty() {
        return (signs, true);
    }
    let mut out: SmallVec<[f64; 8]> = smallvec::smallvec![0.0; rule.sides.outputs()];
    rule.sides.eval(&scratch.variables, &mut scratch.registers, &mut out);
    let own = &scratch.variables[..rule.parameters.len()];
    let scale = own.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let mut clear = true;
    for side in out.chunks(2) {
        let gap = side[0] - side[1];
        // Not so for NaN and for infinite sides either.
        clear &= gap.abs() > NEAR * scale.max(side[0].abs()) && gap.is_finite();
        signs.push(sign_at_birth(side[0], side[1]));
    }
    (signs, clear)
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
    let tau = match reach(variable, time, level, trajectories.get(variable), start, exact)? {
        Reach::At(time) => return Some(PredictedCrossing { time, tau: None, level: None }),
        Reach::Age(age) => age - start,
        Reach::After(tau) => tau,
    };
    let level = (variable < time).then_some((variable, level));
    Some(PredictedCrossing { time: birth.after(tau), tau: Some(tau), level })
}
