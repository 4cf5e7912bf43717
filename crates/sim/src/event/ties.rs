//! Ties: two modules of which one sees the other, whose events happen at one instant in truth but at two as integrated.

use super::EventStage;
use super::behind::{When, signs as signs_of};
use crate::detect::doubt::FAR;
use crate::detect::signs::{opposite, produces};
use crate::detect::switched;
use crate::flow::algebraic::is_algebraic;
use crate::schedule::{NextEvent, Owner};
use crate::world::path::Path;
use crate::world::state::{Change, NextKind, Signs, State};
use dlsys_expr::{Dual, Interval};
use dlsys_model::Sign;
use dlsys_tree::ModuleId;
use smallvec::SmallVec;

/// The rounding of values, relative to them.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Events that are one instant in truth are nearer as integrated than this part of what is taken for the error: a fiftieth at most, in the hard
/// cases that have such.
const SURE: f64 = 0.1;

/// The event of a module beside one which has its event now, and which is not later by more than the error.
pub(super) struct Tie {
    /// The module that has its event now.
    with: ModuleId,
    id: ModuleId,
    change: Change,
    /// How far the sides are apart, as a part of the error.
    apart: f64,
}

impl EventStage<'_, '_> {
    /// The modules that read those that have their events now or are read by them, and whose own events are not later by more than the error. To be
    /// asked for before anything is opened: what is opened rests, and then nothing comes nearer its values.
    pub(super) fn find_ties(&mut self, batch: &[NextEvent]) -> SmallVec<[Tie; 2]> {
        let mut ties = SmallVec::new();
        if !self.setup.looks_around {
            return ties;
        }
        let mut happening: SmallVec<[ModuleId; 8]> = self.events.opened.iter().copied().collect();
        happening.extend(self.events.firing.iter().map(|fire| fire.id));
        happening.extend(batch.iter().filter_map(|next| self.module_of(next)));
        let visit = self.flows.coupled.reintegration.begin_visit(&mut self.world.states);
        for id in &happening {
            if let Some(state) = self.world.state_mut(*id) {
                state.visited = visit;
            }
        }
        let mut known = 0;
        // Those that join may be looked at, too.
        while known < happening.len() {
            let with = happening[known];
            known += 1;
            let other = self.flows.error_of(self.world, with);
            for id in self.around(with) {
                if self.world.state(id).is_none_or(|state| state.visited == visit) {
                    continue;
                }
                if let Some((change, apart)) = self.tie(id, other).or_else(|| self.tie_of_jump(id, other)) {
                    ties.push(Tie { with, id, change, apart });
                    happening.push(id);
                    self.world.state_mut(id).expect("it has an event").visited = visit;
                }
            }
        }
        ties
    }

    /// The module whose event it is.
    fn module_of(&self, next: &NextEvent) -> Option<ModuleId> {
        let slot = match next {
            NextEvent::Lazy(_, slot) => *slot,
            NextEvent::Other(entry) => match entry.owner {
                Owner::Module(slot) => slot,
                Owner::Coupled | Owner::Tick | Owner::Derivation => return None,
            },
        };
        Some(self.world.tree.id(slot))
    }

    /// Opens the modules of ties, where the event that they are tied to takes place now.
    pub(super) fn join_ties(&mut self, ties: &[Tie]) {
        for tie in ties {
            let is_void = self.events.void.contains(&tie.with);
            if is_void || !self.takes_place(tie.with) || self.takes_place(tie.id) {
                continue;
            }
            let mut changes = [tie.change];
            let when = self.behind_jumps(tie.id, &mut changes);
            if matches!(when, When::Later(_) | When::Never) {
                continue;
            }
            if let (true, Some(rule)) =
                (tie.apart > SURE, self.world.state(tie.id).and_then(|s| s.rule.get()))
            {
                self.detector.note_joined(
                    self.setup.model.rules[rule].index,
                    tie.change.atom(),
                    self.instant.at,
                );
            }
            self.touch_then(tie.id, &changes, when);
        }
    }

    /// True for a module that has been opened, or whose production is known to apply now.
    pub(super) fn takes_place(&self, id: ModuleId) -> bool {
        self.world.state(id).is_some_and(|state| state.open.is_some())
            || self.events.firing.iter().any(|fire| fire.id == id)
    }

    /// The modules that a module reads, and those that read it.
    pub(super) fn around(&self, id: ModuleId) -> SmallVec<[ModuleId; 8]> {
        let mut around = self.lookers_through_values(id);
        around.extend(self.world.state(id).into_iter().flat_map(|state| state.context.iter().copied()));
        around
    }

    /// The modules that read a module, and those that read it through values of modules that read it.
    fn lookers_through_values(&self, id: ModuleId) -> SmallVec<[ModuleId; 8]> {
        let mut found: SmallVec<[ModuleId; 8]> = self.neighbours.lookers(id).iter().copied().collect();
        let mut at = 0;
        while self.setup.is_algebraic && at < found.len() {
            if is_algebraic(self.setup.model, self.world, found[at]) {
                let more = self.neighbours.lookers(found[at]).iter().filter(|looker| **looker != id);
                let more: SmallVec<[ModuleId; 8]> =
                    more.copied().filter(|looker| !found.contains(looker)).collect();
                found.extend(more);
            }
            at += 1;
        }
        found
    }

    /// The production of a module that is not later than now by more than the error, beside an event of a module whose
    /// values have the error `other`, and how far its sides are apart, as a part of the error.
    fn tie(&mut self, id: ModuleId, other: f64) -> Option<(Change, f64)> {
        let state = self.world.state(id)?;
        let rule = &self.setup.model.rules[state.rule.get()?];
        if rule.produces.is_empty() || rule.atoms.is_empty() {
            return None;
        }
        // The next event, or the end of the searched stretch, is mostly far away.
        let known = match (&state.next.kind, &self.world.coupled, state.trajectories.step()) {
            (NextKind::Event, ..) => state.next.touched()[0].time,
            (_, Some(solution), _) if state.coupled => solution.end,
            (_, _, Some(step)) => step.dense.end,
            _ => self.instant.at,
        };
        let path = Path::new(self.world, state, rule, self.instant.at, 64.0 * self.instant.at.resolution());
        let error = match path.error() {
            // Formulas in values: only rounding keeps them apart.
            0.0 if self.setup.is_algebraic => ROUNDING,
            error => error,
        };
        let reach = self.flows.reach_of(self.world, id);
        let factor = if error > 0.0 { 1.0 + other / error } else { 0.0 };
        if known.since(self.instant.at) > FAR * factor * error * reach.max(self.instant.at.resolution()) {
            return None;
        }
        let signs = self.signs_now(state);
        let (atom, apart) = (0..rule.atoms.len()).find_map(|atom| {
            let may = error > 0.0
                && matches!(signs[atom], Sign::Plus | Sign::Minus)
                && (produces(rule, &signs, atom) || switched::may_decide(&path, atom))
                && path.is_integrated(&rule.atom_reads[atom]);
            let sign = signs[atom];
            let apart = may.then(|| self.detector.crossings.about_to_meet(&path, atom, sign, factor))??;
            (produces(rule, &signs, atom) || switched::decides(&path, atom, 0.0, &signs))
                .then_some((atom, apart))
        })?;
        Some((Change::new(atom, self.instant.at, [Sign::Zero, opposite(signs[atom])]), apart))
    }

    /// The same of a difference that jumps and was not taken apart into what moves: its sides do not come nearer each other before they do. But they have
    /// jumped where all that they read has moved as far as it errs.
    fn tie_of_jump(&mut self, id: ModuleId, other: f64) -> Option<(Change, f64)> {
        let state = self.world.state(id)?;
        let index = state.rule.get().filter(|rule| self.setup.has_jumps[*rule])?;
        let rule = &self.setup.model.rules[index];
        let signs = self.signs_now(state);
        let may = |atom: &usize| rule.jumping_whole[*atom] && produces(rule, &signs, *atom);
        let atoms: SmallVec<[usize; 4]> = (0..rule.atoms.len()).filter(may).collect();
        if atoms.is_empty() {
            return None;
        }
        let path = Path::new(self.world, state, rule, self.instant.at, 64.0 * self.instant.at.resolution());
        let error = path.error();
        let factor = if error > 0.0 { 1.0 + other / error } else { 1.0 };
        let (mut moving, mut uncertain) = (Vec::new(), Vec::new());
        path.departure(&mut moving);
        path.uncertain(0.0, &mut uncertain);
        let changes: Vec<Change> = (atoms.iter())
            .map(|atom| Change::new(*atom, self.instant.at, [Sign::Zero, opposite(signs[*atom])]))
            .collect();
        [SURE, 1.0].into_iter().find_map(|part| {
            let ahead = |(v, around): (&Dual<f64>, &Interval)| {
                let noise = 0.5 * factor * (around.hi - around.lo);
                if v.rate == 0.0 || noise.is_nan() {
                    v.value
                } else {
                    v.value + part * noise * v.rate.signum()
                }
            };
            let values: Vec<f64> = moving.iter().zip(&uncertain).map(ahead).collect();
            let then = signs_of(rule, &changes, &values, &mut self.scratch.registers);
            let jumped =
                changes.iter().zip(then).find(|(change, then)| [Sign::Zero, change.after].contains(then));
            jumped.map(|(change, at)| (Change::new(change.atom(), change.time, [at, change.after]), part))
        })
    }

    /// The signs of a module as it is now, with those that have changed without consequence.
    pub(super) fn signs_now(&self, state: &State) -> Signs {
        let mut signs: Signs = state.marks.signs().into();
        for change in state.next.changes().iter().filter(|change| change.time.since(self.instant.at) <= 0.0) {
            signs[change.atom()] = change.after;
        }
        signs
    }
}
