//! The common case, done quickly: a module that reads nobody, follows formulas only, and whose next event is a formula.
//!
//! What happens here is what `settle`, `choose` and `phase` would do; whatever is unusual (a sign that is zero or nearly
//! so, a condition inside an equation, a search, an end of the solution) is left to them. A test runs every model both
//! ways.

use smallvec::SmallVec;

use super::around::Around;
use super::lookup::{NEAR, sign_at_birth};
use super::motion::Motion;
use super::queue::Who;
use super::settle::Firing;
use super::signs::{opposite, rate_at};
use super::simulation::Simulation;
use super::state::{Change, Signs, What};
use dlsys_model::{Law, Rule, Sign, Solve, Truth, ZeroCrossing};
use dlsys_tree::{ModuleId, SimTime};

/// What a newborn module is going to do. It lives on the stack for a moment: a box would cost more than its size.
#[allow(clippy::large_enum_variant)]
pub(super) enum Outlook {
    /// It is replaced at once, by this production.
    Over {
        produce: usize,
        signs: Signs,
    },
    Lives(Prospect),
}

pub(super) struct Prospect {
    pub solve: Option<usize>,
    pub signs: Signs,
    pub motions: SmallVec<[Motion; 2]>,
    pub first: First,
}

/// The first event of a life.
pub(super) struct First {
    /// The event with the production that follows; None if there never is one.
    pub event: Option<(Change, usize)>,
    /// The time to the event, or none ever, if nothing else was in question: then it does not depend on when the
    /// module is born, unless the rule reads `t`.
    pub lasting: Option<Option<f64>>,
}

/// Where the two sides of an atom meet.
pub(super) struct Meeting {
    pub time: SimTime,
    /// The time from birth, if it was found as that.
    pub tau: Option<f64>,
    /// The parameter that meets a level, and the level.
    pub level: Option<(usize, f64)>,
}

impl Simulation<'_> {
    /// Begins the life of a module whose kind has no contexts; false if that takes more than is done here.
    pub(super) fn begin_quickly(&mut self, id: ModuleId, index: usize) -> bool {
        // What has a value or an equation must be made consistent first.
        if self.forced || !self.quick || self.model.rules[index].is_algebraic() {
            return false;
        }
        if self.plant.careers.rule(self.plant.tree.kind(id)).is_some() {
            return self.begin_lightly(id, index);
        }
        let around = Around::default();
        self.plant.variables(&self.model.rules[index], id, &around, self.now, &mut self.variables);
        let Some(Outlook::Lives(outlook)) = self.outlook(&self.model.rules[index]) else { return false };
        let who = Who::Module(id.slot() as u32);
        let event = outlook.first.event;
        match &event {
            Some((change, _)) => self.queue.schedule(who, change.time),
            None => self.queue.cancel(who),
        }
        let state = self.plant.make_state(id);
        state.renew(id);
        state.rule = Some(index);
        state.solve = outlook.solve;
        state.signs = outlook.signs;
        state.since = self.now;
        state.motions = outlook.motions;
        state.next.what = if event.is_none() { What::Nothing } else { What::Event };
        state.next.touched = event.into_iter().map(|(change, _)| change).collect();
        state.restarted = self.group;
        true
    }

    /// What a module does that is born now with the parameters that `self.variables` begins with. Then come `t` and
    /// `age`.
    pub(super) fn outlook(&mut self, rule: &Rule) -> Option<Outlook> {
        let (signs, clear) = self.signs_at_birth(rule);
        let holds = |guard: &dlsys_model::Condition| guard.judge(|i| signs[i]) == Truth::Yes;
        if let Some(produce) = rule.produces.iter().position(|p| holds(&p.guard)) {
            return Some(Outlook::Over { produce, signs });
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
        let motions = self.simple_motions(rule, active)?;
        let mut first = self.first_crossing(rule, active, solve, &signs, &motions)?;
        for end in motions.iter().filter_map(Motion::end) {
            if first.event.is_none_or(|(change, _)| change.time.since(self.now) >= end) {
                return None;
            }
            first.lasting = None;
        }
        Some(Outlook::Lives(Prospect { solve, signs, motions, first }))
    }

    /// The motions under a clause from `self.variables`, if they are such as are done here.
    pub(super) fn simple_motions(
        &mut self,
        rule: &Rule,
        clause: Option<&Solve>,
    ) -> Option<SmallVec<[Motion; 2]>> {
        let mut motions = SmallVec::new();
        let Some(clause) = clause.filter(|s| !s.of.is_empty()) else { return Some(motions) };
        let simple = |law: &Law| matches!(law, Law::Polynomial(_) | Law::Quadratic(_) | Law::Driven(_));
        if !clause.switches.is_empty() || !clause.laws.iter().all(simple) {
            return None;
        }
        motions.resize(rule.parameters.len(), Motion::Rest);
        self.formulas(clause, rule.time_variable(), &mut motions).then_some(motions)
    }

    /// The signs of a newborn module's atoms, and whether all are plain.
    fn signs_at_birth(&mut self, rule: &Rule) -> (Signs, bool) {
        let mut signs = Signs::new();
        if rule.atoms.is_empty() {
            return (signs, true);
        }
        let mut out: SmallVec<[f64; 8]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.variables, &mut self.scratch, &mut out);
        let own = &self.variables[..rule.parameters.len()];
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

    /// The sign that becomes zero first, with what follows, if that is a formula and a production follows from it.
    fn first_crossing(
        &mut self,
        rule: &Rule,
        clause: Option<&Solve>,
        solve: Option<usize>,
        signs: &Signs,
        motions: &[Motion],
    ) -> Option<First> {
        let mut first: Option<Change> = None;
        let mut lasting = Some(None);
        for (atom, watch) in rule.watch(solve).iter().enumerate() {
            if matches!(watch, ZeroCrossing::Search(_)) {
                return None;
            }
            let Some(meeting) = self.crossing(rule, clause, atom, watch, motions, self.now) else {
                continue;
            };
            let Meeting { time, tau, level } = meeting;
            if time.since(self.now) <= 0.0 {
                lasting = None;
                continue;
            }
            let change = Change { atom, time, at: Sign::Zero, after: opposite(signs[atom]), level };
            let Some(known) = &mut first else {
                first = Some(change);
                lasting = lasting.and(tau).map(Some);
                continue;
            };
            lasting = None;
            let later = time.since(known.time);
            // Two at one instant, or nearly so, are for others to sort out.
            if later.abs() <= 2.0 * time.resolution() {
                return None;
            }
            if later < 0.0 {
                *known = change;
            }
        }
        let Some(change) = first else { return Some(First { event: None, lasting }) };
        // Nothing may follow from it; then the search goes on, elsewhere.
        let at = |i: usize| if i == change.atom { Sign::Zero } else { signs[i] };
        let produce = rule.produces.iter().position(|p| p.guard.judge(at) == Truth::Yes)?;
        Some(First { event: Some((change, produce)), lasting })
    }

    /// When an atom's sides meet, of a module born at an instant, if that is a formula; and the parameter that meets a
    /// level then. By `self.variables`, which are those of the birth.
    pub(super) fn crossing(
        &mut self,
        rule: &Rule,
        clause: Option<&Solve>,
        atom: usize,
        watch: &ZeroCrossing,
        motions: &[Motion],
        birth: SimTime,
    ) -> Option<Meeting> {
        let ZeroCrossing::Formula { variable, level } = watch else { return None };
        let (variable, time) = (*variable, rule.time_variable());
        if clause.is_some_and(|s| s.unreachable[atom]) {
            return None;
        }
        let mut out = [0.0];
        level.eval(&self.variables, &mut self.scratch, &mut out);
        let [level] = out;
        let tau = if !level.is_finite() {
            return None;
        } else if variable == time {
            return Some(Meeting { time: SimTime::new(level), tau: None, level: None });
        } else if variable == time + 1 {
            level - self.variables[variable]
        } else {
            let motion = motions.get(variable)?;
            let start = self.variables[variable];
            let (variables, scratch, rates) = (&self.variables, &mut self.scratch, &mut self.rates);
            let exact = || rate_at(clause, variables, variable, level, scratch, rates);
            motion.reach(level - start, exact)?
        };
        let level = (variable < time).then_some((variable, level));
        Some(Meeting { time: birth.after(tau), tau: Some(tau), level })
    }

    /// The production that a module's event is, if that is all there is to it; its values are then those of the event.
    pub(super) fn fire_quickly(&mut self, slot: usize) -> Option<Firing> {
        let state = self.plant.states.get(slot)?.as_ref()?;
        if !self.quick || state.next.what != What::Event || state.is_numeric() || state.coupled {
            return None;
        }
        let (id, rule) = (state.id, state.rule?);
        if self.kinds_with_context[self.plant.tree.kind(id).index()] || !state.next.changes.is_empty() {
            return None;
        }
        let touched = &state.next.touched;
        let at = |i: usize| {
            touched.iter().find(|change| change.atom == i).map_or(state.signs[i], |change| change.at)
        };
        let produces = &self.model.rules[rule].produces;
        let produce = produces.iter().position(|p| p.guard.judge(at) == Truth::Yes)?;
        let levels: SmallVec<[(usize, f64); 2]> = touched.iter().filter_map(|c| c.level).collect();
        self.plant.materialise_except(id, self.now, &levels);
        Some(Firing { id, rule, produce })
    }
}
