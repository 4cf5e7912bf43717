//! Which rule applies to a module, in which context, and how its signs stand there.
//!
//! The first rule whose context is present applies, looked up again whenever the structure has changed
//! (LANGUAGE, "Rules").

use super::settle::Open;
use super::simulation::{Simulation, State};
use crate::model::{Rule, Sign};
use crate::structure::{ModuleId, Visit};

/// Two numbers are equal if they differ by no more than this part of the larger.
const EQUAL: f64 = 8.0 * f64::EPSILON;

impl Simulation<'_> {
    /// Finds each module's rule and context; opens those for which they are new.
    pub(super) fn look_up(&mut self, open: &mut [Option<Open>]) {
        let rules = &self.model.rules;
        let kinds = &self.model.kinds;
        self.ruled.clear();
        self.ruled.extend(self.tree.walk().filter_map(|visit| match visit {
            Visit::Module(id) if !kinds.get(self.tree.kind(id)).rules.is_empty() => Some(id),
            _ => None,
        }));
        self.ruled_is_stale = false;
        self.states.resize(self.tree.slots(), None);
        let mut context = Vec::new();
        for &id in &self.ruled {
            let applies = kinds
                .get(self.tree.kind(id))
                .rules
                .iter()
                .copied()
                .find(|&rule| self.context(id, &rules[rule], &mut context));
            let state = self.states[id.slot()].as_ref().filter(|s| s.id == id);
            let Some(rule) = applies else {
                if state.is_none_or(|s| s.rule.is_some()) {
                    self.states[id.slot()] = Some(State::idle(id));
                    open[id.slot()] = None;
                }
                continue;
            };
            let same = state.is_some_and(|s| s.rule == Some(rule) && s.context == context);
            if same {
                continue;
            }
            let mut signs = self.signs_of_values(id, rule, &context);
            // A limit that is only approached may have been reached by rounding.
            if let Some(State { rule: Some(before), solve: Some(solve), signs: known, .. }) = state
                && *before == rule
            {
                for (atom, &unreachable) in rules[rule].solves[*solve].unreachable.iter().enumerate() {
                    if unreachable {
                        signs[atom] = known[atom];
                    }
                }
            }
            open[id.slot()] = Some(Open::elsewhere(&signs));
            self.states[id.slot()] = Some(State {
                id,
                rule: Some(rule),
                context: context.clone(),
                solve: None,
                signs,
                switches: Vec::new(),
            });
        }
    }

    /// Collects the context that a rule asks for, in the order of the rule's variables; false if it is
    /// not there.
    fn context(&self, id: ModuleId, rule: &Rule, out: &mut Vec<ModuleId>) -> bool {
        out.clear();
        let skipped = |kind| self.model.kinds.get(kind).skipped;
        let mut at = id;
        for pattern in rule.left.iter().rev() {
            match self.tree.left(at, skipped) {
                Some(found) if pattern.matches(self.tree.kind(found)) => {
                    out.push(found);
                    at = found;
                }
                _ => return false,
            }
        }
        out.reverse();
        at = id;
        for pattern in &rule.right {
            match self.tree.right(at, skipped) {
                Some(found) if pattern.matches(self.tree.kind(found)) => {
                    out.push(found);
                    at = found;
                }
                _ => return false,
            }
        }
        true
    }

    /// A rule's variables at the present instant, from the values in the tree.
    pub(super) fn values(&self, id: ModuleId, context: &[ModuleId]) -> Vec<f64> {
        let mut variables: Vec<f64> = self.tree.parameters(id).to_vec();
        for module in context {
            variables.extend_from_slice(self.tree.parameters(*module));
        }
        variables.extend([self.now.to_f64(), self.now.since(self.tree.birth(id))]);
        variables
    }

    fn signs_of_values(&self, id: ModuleId, rule: usize, context: &[ModuleId]) -> Vec<Sign> {
        let sides = &self.model.rules[rule].sides;
        let mut out = vec![0.0; sides.outputs()];
        sides.eval(&self.values(id, context), &mut Vec::new(), &mut out);
        out.chunks(2)
            .map(|side| {
                let difference = side[0] - side[1];
                // An infinite side is far from everything.
                let size = side[0].abs().max(side[1].abs());
                let equal = size.is_finite() && difference.abs() <= EQUAL * size;
                if equal { Sign::Zero } else { Sign::of(difference) }
            })
            .collect()
    }
}
