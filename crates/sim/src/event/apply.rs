//! The application of productions: modules are replaced in parallel, on the values before any of them was replaced.

use std::sync::LazyLock;

use smallvec::SmallVec;

use super::chance::{self, Undrawn};
use super::levels::{put_levels, set_levels};
use super::{EventStage, Firing};
use crate::budget;
use crate::error::{Error, Site};
use crate::log::Event;
use crate::memory::Shortage;
use crate::scratch::{Scratch, clear};
use crate::world::World;
use crate::world::context::Context;
use crate::world::life::{End, LifeClass};
use crate::world::new_modules::kinds_of;
use dlsys_model::{Comparison, KindId, Model, Rule, Sign};
use dlsys_tree::{Lineage, ModuleId};

/// The context of a rule without one.
static NO_CONTEXT: LazyLock<Context> = LazyLock::new(Context::default);

/// The reason why a production cannot be applied.
#[derive(Clone, Debug)]
pub enum Refusal {
    /// The successor has no parameters.
    Undrawn(Undrawn),
    /// The rate of the event was negative.
    NegativeRate,
    TooManyModules {
        limit: usize,
        rounds: usize,
    },
    OutOfMemory(Shortage),
}

impl From<Undrawn> for Refusal {
    fn from(undrawn: Undrawn) -> Refusal {
        Refusal::Undrawn(undrawn)
    }
}

impl Refusal {
    pub fn error(self, world: &World, site: Site) -> Error {
        match self {
            Refusal::Undrawn(undrawn) => undrawn.error(site),
            Refusal::NegativeRate => Error::NegativeRate { site },
            Refusal::TooManyModules { limit, rounds } => Error::TooManyModules { site, limit, rounds },
            Refusal::OutOfMemory(shortage) => budget::out_of_memory(world, shortage, site),
        }
    }
}

/// The distance of an instant from the boundary of a production: see [`Event::residual`]. The variables in `scratch` are
/// those of the instant; `zero` tells which signs are zero there.
pub fn residual(rule: &Rule, produce: usize, zero: impl Fn(usize) -> bool, scratch: &mut Scratch) -> f64 {
    let mut sides: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
    rule.sides.eval(&scratch.variables, &mut scratch.registers, &mut sides);
    (rule.produces[produce].guard.atoms())
        .filter(|(atom, comparison)| *comparison == Comparison::Equal || zero(*atom))
        .map(|(atom, _)| (sides[2 * atom] - sides[2 * atom + 1]).abs())
        .fold(0.0, f64::max)
}

impl EventStage<'_, '_> {
    /// The round to which a derivation step belongs. No module reads a lazy one, so these may be replaced first; all
    /// others are replaced together.
    pub fn replace_with_steps(
        &mut self,
        lazy: &mut Vec<u32>,
        firing: &mut Vec<Firing>,
        rounds: usize,
    ) -> Result<(), Error> {
        if firing.is_empty() && !lazy.is_empty() {
            self.replace_all_lazy(std::mem::take(lazy), rounds)?;
        } else if !firing.is_empty() {
            self.materialise_all(lazy, firing);
        }
        let mut steps = std::mem::take(&mut self.events.steps.firing);
        firing.append(&mut steps);
        self.replace(firing, rounds)?;
        self.events.steps.firing = steps;
        clear(&mut self.events.steps.firing);
        clear(firing);
        clear(lazy);
        Ok(())
    }

    /// Materialises all modules of a round, the lazy ones first, so that all are replaced in parallel.
    pub fn materialise_all(&mut self, lazy: &[u32], firing: &mut Vec<Firing>) {
        for fire in firing.iter() {
            self.materialise(fire.id);
        }
        if lazy.is_empty() {
            return;
        }
        let mut all = Vec::new();
        for &slot in lazy {
            let id = self.world.tree.id(slot);
            let at_birth = match self.world.lives.get(self.world.tree.label(id)) {
                Some(LifeClass { rule, end: Some(End::AtBirth { produce }), .. }) => Some((*rule, *produce)),
                _ => None,
            };
            self.materialise(id);
            match at_birth {
                Some((rule, produce)) => all.push(Firing::at(id, rule, produce)),
                None => all.extend(self.fire_predicted(slot as usize)),
            }
        }
        all.append(firing);
        *firing = all;
    }

    /// The place of a production.
    pub fn site(&self, fire: &Firing) -> Site {
        let span = self.setup.model.rules[fire.rule].produces[fire.produce].span;
        self.world.site(self.setup.model, fire.id, fire.rule, span, self.instant.at)
    }

    /// Makes room for modules of these kinds, with so many parameters.
    #[inline]
    pub fn room(&mut self, kinds: &[KindId], width: usize, rounds: usize) -> Result<(), Refusal> {
        let limit = self.setup.settings.max_modules;
        if self.world.tree.len() + kinds.len() > limit {
            return Err(Refusal::TooManyModules { limit, rounds });
        }
        let coupled = self.flows.coupled.members.len();
        budget::room_for(self.setup, self.world, coupled, (kinds, width)).map_err(Refusal::OutOfMemory)
    }

    /// Writes a production into the log, if there is one.
    pub fn record(
        &mut self,
        (kind, lineage): (KindId, Lineage),
        (rule, clause): (usize, usize),
        (successor, made): (Option<usize>, &[KindId]),
        residual: f64,
    ) {
        let (time, group) = (self.instant.at.to_f64(), self.instant.number);
        let made = made.iter().filter(|kind| !kind.is_bracket()).count() as u32;
        let transition = None;
        self.log.add(Event {
            time,
            lineage,
            kind,
            rule,
            clause,
            successor,
            made,
            residual,
            group,
            transition,
        });
    }

    /// Replaces all modules in parallel: every successor is computed before any is put in.
    pub fn replace(&mut self, firing: &[Firing], rounds: usize) -> Result<(), Error> {
        if self.flows.lazy_algebra {
            let now = self.instant.at;
            self.flow().refresh(now)?;
        }
        self.afford_round(firing.len(), firing.first().map(|fire| fire.id))?;
        self.note_predecessors(firing);
        let mut new = std::mem::take(&mut self.events.new_modules);
        let mut ends = std::mem::take(&mut self.events.module_ends);
        new.clear();
        ends.clear();
        let (mut contexts, model) = (0, self.setup.model);
        let known = self.log.events.as_ref().map_or(0, Vec::len);
        for fire in firing {
            let rule = &model.rules[fire.rule];
            let clause = &rule.produces[fire.produce];
            let around = context_of(model, self.world, &self.events.steps.contexts, fire, &mut contexts);
            let (now, variables) = (self.instant.at, &mut self.scratch.variables);
            match self.setup.successors_read_context[fire.rule]
                || self.setup.has_meetings[fire.rule]
                || self.log.records()
            {
                true => self.world.variables(rule, fire.id, around, now, variables),
                false => self.world.variables_read((rule, &[]), fire.id, around, now, variables),
            }
            put_levels(&self.events.met, (&self.world.tree, fire.id), around, variables);
            set_levels(self.setup, self.world, fire, self.scratch);
            if self.setup.is_algebraic {
                self.note_values(fire.id);
            }
            let lineage = self.world.tree.lineage(fire.id);
            let residual = if self.log.records() { self.residual(fire) } else { 0.0 };
            let made = match clause.is_fault {
                true => Err(Refusal::NegativeRate),
                false if fire.after => self.successor_after(fire, &mut new).map_err(Refusal::from),
                false => chance::successor(self.setup.seed, clause, lineage, self.scratch, &mut new)
                    .map_err(Refusal::from),
            };
            match made {
                Ok((which, family)) => {
                    let first = ends.last().map_or(0, |(end, ..): &([usize; 2], _, _)| end[0]);
                    ends.push(([new.kinds.len(), new.arguments.len()], which, family));
                    if self.log.records() {
                        let (kind, chosen) = (
                            self.world.tree.kind(fire.id),
                            clause.outcome.weights.is_some().then_some(which),
                        );
                        let kinds = kinds_of(&clause.outcome.successors[which], &new.kinds[first..]);
                        self.record((kind, lineage), (fire.rule, fire.produce), (chosen, kinds), residual);
                    }
                }
                Err(refusal) => {
                    // None of this round takes place.
                    self.log.take_back(known);
                    return Err(refusal.error(self.world, self.site(fire)));
                }
            }
        }
        let mut first = [0, 0];
        for (fire, &(end, which, family)) in firing.iter().zip(&ends) {
            let successor = &model.rules[fire.rule].produces[fire.produce].outcome.successors[which];
            let kinds = kinds_of(successor, &new.kinds[first[0]..end[0]]);
            let arguments = &new.arguments[first[1]..end[1]];
            if let Err(refusal) = self.room(kinds, arguments.len(), rounds) {
                return Err(refusal.error(self.world, self.site(fire)));
            }
            let (kind, now) = (self.world.tree.kind(fire.id), self.instant.at);
            self.flow().forget(fire.id);
            let mut made = std::mem::take(&mut self.events.fresh);
            let known = made.len();
            self.world.tree.replace(fire.id, kinds, arguments, now, family, &mut made);
            self.note_successor(fire.id, kinds, &made[known..]);
            self.events.heir = match made[..] {
                [heir] if kinds == [kind] && firing.len() == 1 && self.events.to_look.is_empty() => {
                    Some((fire.id, heir))
                }
                _ => None,
            };
            self.hand_on(fire.id, kind, kinds, &made[known..]);
            self.events.fresh = made;
            first = end;
        }
        self.events.new_modules = new;
        self.events.module_ends = ends;
        self.world.structure += 1;
        self.events.changed = true;
        let world = &self.world;
        self.events.opened.retain(|id| world.state(*id).is_some());
        self.log.stats.events += firing.len() as u64;
        self.log.stats.peak_modules = self.log.stats.peak_modules.max(self.world.tree.len() as u64);
        Ok(())
    }

    /// Notes the algebraic values of a module that is replaced. By the variables in `self.scratch`.
    fn note_values(&mut self, id: ModuleId) {
        let Some(state) = self.world.state(id) else { return };
        let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { return };
        let algebraic = &self.setup.model.rules[rule].solves[solve].algebraic;
        let kept = algebraic.of.iter().enumerate().filter(|(place, _)| !algebraic.is_lazy(*place));
        let values = kept.map(|(_, &parameter)| self.scratch.variables[parameter]);
        self.events.replaced_values.extend(values);
    }

    /// The residual of the production of a materialised module. By the variables in `self.scratch`.
    fn residual(&mut self, fire: &Firing) -> f64 {
        let rule = &self.setup.model.rules[fire.rule];
        if rule.discrete {
            return 0.0;
        }
        let Some(state) = self.world.state(fire.id) else {
            return residual(rule, fire.produce, |_| false, self.scratch);
        };
        let zero = |atom: usize| match &state.open {
            Some(open) => open.at[atom] == Sign::Zero,
            None => state.next.touched().iter().any(|change| change.atom() == atom),
        };
        residual(rule, fire.produce, zero, self.scratch)
    }

    /// Asks for the lists that so many productions of the instant take; `first` is one of the modules.
    pub fn afford_round(&mut self, productions: usize, first: Option<ModuleId>) -> Result<(), Error> {
        budget::afford_round(self.setup, self.world, productions, self.events.steps.due, || {
            let now = self.instant.at;
            match first {
                Some(id) => self.world.site_of_module(self.setup.model, id, now),
                None => crate::world::site_of_axiom(now.to_f64()),
            }
        })
    }
}

/// The context of a production. Those of a step are kept in the order of its productions; `passed` counts them.
fn context_of<'c>(
    model: &Model,
    world: &'c World,
    steps: &'c [Context],
    fire: &Firing,
    passed: &mut usize,
) -> &'c Context {
    if !model.rules[fire.rule].discrete {
        return world.state(fire.id).map_or(&NO_CONTEXT, |state| &state.context);
    }
    *passed += 1;
    &steps[*passed - 1]
}
