//! Ties: two modules of which one sees the other, whose events happen at one instant in truth but at two as integrated.

use super::EventStage;
use super::behind::When;
use crate::detect::doubt::FAR;
use crate::detect::signs::{opposite, produces};
use crate::detect::switched;
use crate::flow::algebraic::is_algebraic;
use crate::world::path::Path;
use crate::world::state::{Change, NextKind, Signs};
use dlsys_model::Sign;
use dlsys_tree::ModuleId;
use smallvec::SmallVec;

/// The rounding of values, relative to them.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Events that are one instant in truth are nearer as integrated than this part of what is taken for the error: a fiftieth at most, in the hard
/// cases that have such.
const SURE: f64 = 0.1;

impl EventStage<'_, '_> {
    /// Opens the modules that read one that has an event now, and whose own event is not later by more than the error.
    pub fn join_ties(&mut self) {
        if !self.setup.looks_around {
            return;
        }
        let mut known = 0;
        // Those that join may be looked at, too.
        while known < self.events.opened.len() + self.events.firing.len() {
            let id = match self.events.opened.get(known) {
                Some(id) => *id,
                None => self.events.firing[known - self.events.opened.len()].id,
            };
            known += 1;
            let other = self.flows.error_of(self.world, id);
            for looker in self.lookers_through_values(id) {
                if let Some(change) = self.tie(looker, other) {
                    let mut changes = [change];
                    let when = self.behind_jumps(looker, &mut changes);
                    if let When::Later(_) = when {
                        continue;
                    }
                    let before = self.events.opened.len();
                    self.touch_then(looker, &changes, when);
                    known = if self.events.opened.len() > before && known > before { before } else { known };
                }
            }
        }
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
    /// values have the error `other`.
    fn tie(&mut self, id: ModuleId, other: f64) -> Option<Change> {
        let state = self.world.state(id).filter(|s| s.open.is_none())?;
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
        let mut signs: Signs = state.marks.signs().into();
        for change in state.next.changes().iter().filter(|change| change.time.since(self.instant.at) <= 0.0) {
            signs[change.atom()] = change.after;
        }
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
        if apart > SURE {
            self.detector.note_joined(rule.index, atom, self.instant.at);
        }
        Some(Change::new(atom, self.instant.at, [Sign::Zero, opposite(signs[atom])]))
    }
}
