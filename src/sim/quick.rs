//! The common case, done quickly: a module that reads nobody, follows formulas only, and whose next event is a formula.
//!
//! What happens here is what `settle`, `choose` and `phase` would do; whatever is unusual (a sign that is zero or nearly
//! so, a condition inside an equation, a search, an end of the solution) is left to them. A test runs every model both
//! ways.

use smallvec::SmallVec;

use super::lookup::NEAR;
use super::motion::Motion;
use super::queue::Who;
use super::settle::Firing;
use super::simulation::Simulation;
use super::state::{Change, Signs, State, What};
use super::watch::{opposite, rate_at};
use crate::model::{Law, Rule, Sign, Solve, Truth, Watch};
use crate::structure::{Instant, ModuleId};

/// What a newborn module is going to do.
struct Outlook {
    solve: Option<usize>,
    signs: Signs,
    motions: SmallVec<[Motion; 2]>,
    touched: SmallVec<[Change; 1]>,
}

impl Simulation<'_> {
    /// Begins the life of a module whose kind has no contexts; false if that takes more than is done here.
    pub(super) fn begin_quickly(&mut self, id: ModuleId, index: usize) -> bool {
        if self.forced || !self.quick {
            return false;
        }
        let Some(outlook) = self.outlook(id, &self.model.rules[index]) else { return false };
        let who = Who::Module(id.slot() as u32);
        match outlook.touched.first() {
            Some(first) => self.queue.schedule(who, first.time),
            None => self.queue.cancel(who),
        }
        let state = self.plant.states[id.slot()].get_or_insert_with(|| State::new(id));
        state.renew(id);
        state.rule = Some(index);
        state.solve = outlook.solve;
        state.signs = outlook.signs;
        state.since = self.now;
        state.motions = outlook.motions;
        state.next.what = if outlook.touched.is_empty() { What::Nothing } else { What::Event };
        state.next.touched = outlook.touched;
        state.restarted = self.group;
        true
    }

    fn outlook(&mut self, id: ModuleId, rule: &Rule) -> Option<Outlook> {
        self.plant.variables(id, &[], self.now, &mut self.variables);
        let signs = self.clear_signs(rule)?;
        let holds = |guard: &crate::model::Condition| guard.judge(|i| signs[i]) == Truth::Yes;
        if rule.produces.iter().any(|p| holds(&p.guard)) {
            return None;
        }
        let solve = rule.solves.iter().position(|s| holds(&s.guard));
        let active = match solve {
            None if !rule.solves.is_empty() => return None,
            None => None,
            Some(s) => Some(&rule.solves[s]),
        };
        let mut motions = SmallVec::new();
        if let Some(clause) = active.filter(|s| !s.of.is_empty()) {
            let simple = |law: &Law| matches!(law, Law::Polynomial(_) | Law::Quadratic(_));
            if !clause.switches.is_empty() || !clause.laws.iter().all(simple) {
                return None;
            }
            motions.resize(rule.parameters.len(), Motion::Rest);
            if !self.formulas(clause, rule.time_variable(), &mut motions) {
                return None;
            }
        }
        let touched = self.first_crossing(rule, active, solve, &signs, &motions)?;
        let before = |end: f64| touched.first().is_none_or(|t| t.time.since(self.now) >= end);
        if motions.iter().filter_map(Motion::end).any(before) {
            return None;
        }
        Some(Outlook { solve, signs, motions, touched })
    }

    /// The signs of a rule's atoms, if all are plain.
    fn clear_signs(&mut self, rule: &Rule) -> Option<Signs> {
        let mut signs = Signs::new();
        if rule.atoms.is_empty() {
            return Some(signs);
        }
        let mut out: SmallVec<[f64; 8]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.variables, &mut self.scratch, &mut out);
        let own = &self.variables[..rule.parameters.len()];
        let scale = own.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        for side in out.chunks(2) {
            let gap = side[0] - side[1];
            // Not so for NaN and for infinite sides either.
            if !(gap.abs() > NEAR * scale.max(side[0].abs()) && gap.is_finite()) {
                return None;
            }
            signs.push(Sign::of(gap));
        }
        Some(signs)
    }

    /// The signs that become zero first, if that is a formula and something follows from it; empty if none ever does.
    fn first_crossing(
        &mut self,
        rule: &Rule,
        clause: Option<&Solve>,
        solve: Option<usize>,
        signs: &Signs,
        motions: &[Motion],
    ) -> Option<SmallVec<[Change; 1]>> {
        let time = rule.time_variable();
        let mut touched: SmallVec<[Change; 1]> = SmallVec::new();
        for (atom, watch) in rule.watch(solve).iter().enumerate() {
            let (variable, program) = match watch {
                Watch::Still => continue,
                Watch::Root => return None,
                Watch::Crossing { variable, level } => (*variable, level),
            };
            if clause.is_some_and(|s| s.unreachable[atom]) {
                continue;
            }
            let mut level = [0.0];
            program.eval(&self.variables, &mut self.scratch, &mut level);
            let [level] = level;
            let when = if !level.is_finite() {
                continue;
            } else if variable == time {
                Instant::new(level)
            } else if variable == time + 1 {
                self.now.after(level - self.variables[variable])
            } else {
                let Some(motion) = motions.get(variable) else { continue };
                let start = self.variables[variable];
                let (variables, scratch, rates) = (&self.variables, &mut self.scratch, &mut self.rates);
                let exact = || rate_at(clause, variables, variable, level, scratch, rates);
                let Some(tau) = motion.reach(level - start, exact) else { continue };
                self.now.after(tau)
            };
            if when.since(self.now) <= 0.0 {
                continue;
            }
            let level = (variable < time).then_some((variable, level));
            let change = Change { atom, time: when, at: Sign::Zero, after: opposite(signs[atom]), level };
            let Some(first) = touched.first() else {
                touched.push(change);
                continue;
            };
            let later = when.since(first.time);
            // Two at one instant, or nearly so, are for others to sort out.
            if later.abs() <= 2.0 * when.resolution() {
                return None;
            }
            if later < 0.0 {
                touched[0] = change;
            }
        }
        if let Some(change) = touched.first() {
            // Nothing may follow from it; then the search goes on, elsewhere.
            let at = |i: usize| if i == change.atom { Sign::Zero } else { signs[i] };
            if !rule.produces.iter().any(|p| p.guard.judge(at) == Truth::Yes) {
                return None;
            }
        }
        Some(touched)
    }

    /// The production that a module's event is, if that is all there is to it; its values are then those of the event.
    pub(super) fn fire_quickly(&mut self, slot: usize) -> Option<Firing> {
        let state = self.plant.states[slot].as_ref()?;
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
