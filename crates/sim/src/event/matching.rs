//! Matching of contexts: the modules that a rule reads, and the signs of its atoms by the values of now.

use smallvec::SmallVec;

use super::EventStage;
use super::levels::put_levels;
use crate::detect::crossing::TOUCH;
use crate::detect::signs::{EQUAL, NEAR, noise, opposite};
use crate::world::context::Context;
use crate::world::path::NEXT_TO_NOTHING;
use crate::world::state::Signs;
use dlsys_model::{ContextPart, Pattern, Rule, Sign};
use dlsys_tree::ModuleId;

/// The place of the bracket that closes the first one.
fn closing(shape: &[ContextPart]) -> usize {
    let mut depth = 0;
    for (i, turn) in shape.iter().enumerate() {
        match turn {
            ContextPart::Open => depth += 1,
            ContextPart::Close if depth == 1 => return i,
            ContextPart::Close => depth -= 1,
            ContextPart::Module => {}
        }
    }
    shape.len()
}

impl EventStage<'_, '_> {
    /// Collects the context of a rule, in the order of the rule's variables; false if it does not match. `lasting`: the
    /// module is noted as a looker of all modules that were examined.
    pub fn context(&mut self, id: ModuleId, rule: &Rule, lasting: bool, out: &mut Context) -> bool {
        out.clear();
        let skipped = |kind| self.setup.model.kinds.get(kind).skipped;
        let (tree, neighbours) = (&self.world.tree, &mut self.neighbours);
        let mut look = |at: &mut ModuleId, pattern: &Pattern, left: bool| {
            let found = match left {
                true => neighbours.left(tree, *at, skipped),
                false => neighbours.right(tree, *at, skipped),
            };
            let Some(found) = found else { return false };
            if lasting {
                neighbours.note(tree, id, found);
            }
            *at = found;
            out.push(found);
            pattern.matches(tree.kind(found))
        };
        let mut at = id;
        if !rule.left.iter().rev().all(|pattern| look(&mut at, pattern, true)) {
            return false;
        }
        at = id;
        if rule.right_shape.iter().all(|turn| *turn == ContextPart::Module) {
            if !rule.right.iter().all(|pattern| look(&mut at, pattern, false)) {
                return false;
            }
        } else if self.follow((id, lasting), id, &rule.right_shape, &mut rule.right.iter(), out).is_none() {
            return false;
        }
        out.reverse(rule.left.len());
        if !rule.aggregates.is_empty() {
            self.attached_to((id, lasting), id);
            let tree = &self.world.tree;
            for aggregate in &rule.aggregates {
                let matching = |child: &&ModuleId| aggregate.pattern.matches(tree.kind(**child));
                out.push_children(self.events.attached.iter().filter(matching).copied());
            }
        }
        true
    }

    /// Finds the modules attached to one, and notes, if `lasting`, the looker. Returns whether the last one is on its axis.
    fn attached_to(&mut self, (looker, lasting): (ModuleId, bool), id: ModuleId) -> bool {
        let (tree, neighbours) = (&self.world.tree, &mut self.neighbours);
        self.events.attached.clear();
        let on_axis =
            tree.children(id, |kind| self.setup.model.kinds.get(kind).skipped, &mut self.events.attached);
        for child in self.events.attached.iter().filter(|_| lasting) {
            neighbours.note(tree, looker, *child);
        }
        on_axis
    }

    /// Collects a right context with branches, as seen from a module: each branch stands for the first one, after those
    /// before it, that begins as written. None if it does not match. No deeper than brackets in a text.
    fn follow(
        &mut self,
        looker: (ModuleId, bool),
        from: ModuleId,
        shape: &[ContextPart],
        patterns: &mut std::slice::Iter<Pattern>,
        out: &mut Context,
    ) -> Option<()> {
        let mut on_axis = self.attached_to(looker, from);
        let mut around = self.events.attached.clone();
        let mut next_branch = 0;
        let mut turns = 0;
        while turns < shape.len() {
            if shape[turns] == ContextPart::Module {
                let next = around.last().copied().filter(|_| on_axis)?;
                let pattern = patterns.next()?;
                if !pattern.matches(self.world.tree.kind(next)) {
                    return None;
                }
                out.push(next);
                turns += 1;
                if turns < shape.len() {
                    on_axis = self.attached_to(looker, next);
                    around = self.events.attached.clone();
                    next_branch = 0;
                }
                continue;
            }
            let inside = &shape[turns + 1..turns + closing(&shape[turns..])];
            let branches = around.len() - usize::from(on_axis);
            let known = out.context().len();
            let found = (next_branch..branches).find_map(|branch| {
                let mut inner = patterns.clone();
                let first = inner.next()?;
                out.truncate(known);
                if !first.matches(self.world.tree.kind(around[branch])) {
                    return None;
                }
                out.push(around[branch]);
                self.follow(looker, around[branch], &inside[1..], &mut inner, out)?;
                Some((branch, inner))
            });
            let (branch, inner) = found?;
            next_branch = branch + 1;
            *patterns = inner;
            turns += inside.len() + 2;
        }
        Some(())
    }

    /// The signs of a rule's atoms by the values of now, and whether all are far from zero. `followed` are the signs
    /// that the module was followed with.
    pub fn signs_of_values(
        &mut self,
        id: ModuleId,
        rule: &Rule,
        context: &Context,
        followed: Option<(Signs, f64)>,
    ) -> (Signs, bool) {
        if rule.atoms.is_empty() {
            return (Signs::new(), true);
        }
        let read = (rule, &rule.watched[..]);
        self.world.variables_read(read, id, context, self.instant.at, &mut self.scratch.variables);
        put_levels(&self.events.met, (&self.world.tree, id), context, &mut self.scratch.variables);
        let mut out: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.scratch.variables, &mut self.scratch.registers, &mut out);
        let scale = self.world.tree.parameters(id).iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let error = if followed.is_some() { self.flows.error_among_others(self.world, id) } else { 0.0 };
        let least = error * NEXT_TO_NOTHING;
        let mut clear = true;
        let signs = (out.chunks(2).enumerate())
            .map(|(atom, side)| {
                let difference = side[0] - side[1];
                // An infinite side is far from everything.
                let size = side[0].abs().max(side[1].abs());
                // A sign that has just turned, by no more than rounding, turns at this instant.
                let turned = followed.as_ref().is_some_and(|f| f.0[atom] == opposite(Sign::of(difference)));
                let tolerance = if turned { TOUCH } else { EQUAL };
                // What is a difference of larger terms is known no better than these.
                let is_rounding = || {
                    followed.is_none()
                        && !rule.jumping_whole[atom]
                        && difference.abs() <= NEAR * scale
                        && difference.abs() <= noise(rule, atom, &self.scratch.variables, EQUAL)
                };
                let equal = size.is_finite() && (difference.abs() <= tolerance * size || is_rounding());
                // Next to nothing there is no sign but the one that it had.
                if let Some((signs, _)) = followed.as_ref().filter(|_| !equal && difference.abs() <= least) {
                    clear = false;
                    return signs[atom];
                }
                // By no more than the error of integration: it goes on with the sign that it had.
                if let Some((signs, error)) = followed.as_ref().filter(|f| turned && !equal && f.1 > 0.0)
                    && difference.abs() <= noise(rule, atom, &self.scratch.variables, *error)
                {
                    return signs[atom];
                }
                clear &= !equal && difference.abs() > NEAR * scale;
                if equal { Sign::Zero } else { Sign::of(difference) }
            })
            .collect();
        (signs, clear)
    }
}
