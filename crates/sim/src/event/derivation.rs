//! Derivation steps: discrete rules, applied to the whole string at the multiples of the period (ABOP, chapter 1).
//!
//! A step is part of the first round of productions at its instant (`iterate`): its rules see the values from before the
//! instant, as continuous productions of that round do, and their successors are not replaced once more by the step. Time is
//! counted in steps, so the instant of step n is n times the period, rounded once, however many there were.
//!
//! The modules that may be replaced are listed, so a step costs what it examines and not the size of the structure. A module
//! leaves the list after one examination if nothing changes that its rules read.

use super::EventStage;
use std::collections::HashMap;

use smallvec::SmallVec;

use crate::detect::signs::sign_at_birth;
use crate::error::Error;
use crate::event::Firing;
use crate::event::exact::exact_atoms;
use crate::schedule::Owner;
use crate::world::context::Context;
use dlsys_model::{Model, Rule, Sign, Truth};
use dlsys_tree::{ModuleId, SimTime};

/// The state of derivation steps.
#[derive(Clone, Debug, Default)]
pub struct Steps {
    /// Number of the last step; two steps are one period apart.
    passed: f64,
    scheduled: bool,
    /// The step belongs to the instant under examination.
    pub due: bool,
    /// Modules that discrete rules may apply to.
    population: Vec<ModuleId>,
    /// Productions of the present step.
    pub firing: Vec<Firing>,
    /// Their contexts, one after another.
    pub contexts: Vec<Context>,
    /// By kind: there are discrete rules for it.
    pub has_rules: Vec<bool>,
    /// By kind: if no rule applies to a module at its first step, none ever does.
    is_settled: Vec<bool>,
    /// By rule and atom: both sides are exact.
    exact: Vec<Vec<bool>>,
}

impl Steps {
    pub fn new(model: &Model) -> Steps {
        let reads_itself = |rule: &Rule| {
            !rule.looks_around() && rule.sides.reads().iter().all(|v| *v < rule.parameters.len())
        };
        let has_rules = model.kinds.iter().map(|(_, kind)| !kind.steps.is_empty());
        let is_settled = (model.kinds.iter()).map(|(_, kind)| {
            let rests = kind.rules.is_empty() && kind.read_inputs().next().is_none();
            rests && kind.steps.iter().all(|r| reads_itself(&model.rules[*r]))
        });
        let exact = exact_atoms(model);
        Steps { has_rules: has_rules.collect(), is_settled: is_settled.collect(), exact, ..Steps::default() }
    }

    /// The first module that may be replaced.
    pub fn first(&self) -> Option<ModuleId> {
        self.population.first().copied()
    }

    pub fn len(&self) -> usize {
        self.population.len()
    }

    /// Counts a newborn module in.
    pub fn join(&mut self, id: ModuleId) {
        self.population.push(id);
    }
}

impl EventStage<'_, '_> {
    /// Schedules the next step, if discrete rules may apply to some module.
    pub fn arrange_step(&mut self) -> Result<(), Error> {
        if self.events.steps.scheduled || self.events.steps.population.is_empty() {
            return Ok(());
        }
        let (now, period) = (self.instant.at, self.setup.model.period);
        let mut next = (now.to_f64() / period).floor().max(self.events.steps.passed) + 1.0;
        // A module that is born within the resolution of time of a step is born at that step.
        while SimTime::multiple(next - 1.0, period).since(now) > now.resolution() {
            next -= 1.0;
        }
        while SimTime::multiple(next, period).since(now) <= now.resolution() {
            next += 1.0;
            if SimTime::multiple(next, period).since(SimTime::multiple(next - 1.0, period))
                <= now.resolution()
            {
                let id = self.events.steps.population[0];
                let rule = self.setup.model.kinds.get(self.world.tree.kind(id)).steps[0];
                let site =
                    self.world.site(self.setup.model, id, rule, self.setup.model.rules[rule].span, now);
                return Err(Error::PeriodTooShort { site, period });
            }
        }
        self.events.steps.passed = next - 1.0;
        self.events.steps.scheduled = true;
        self.schedule.schedule(Owner::Derivation, SimTime::multiple(next, period));
        Ok(())
    }

    /// Says that the next step belongs to the instant that is about to be examined.
    pub fn begin_step(&mut self) {
        self.events.steps.due = true;
        self.events.steps.scheduled = false;
        self.events.steps.passed += 1.0;
    }

    /// The productions of a step that is due. A module that a continuous rule replaces at the same instant is replaced
    /// by the rule that is written first.
    pub fn find_steps(&mut self, firing: &mut Vec<Firing>) {
        if !std::mem::take(&mut self.events.steps.due) {
            return;
        }
        let mut others: HashMap<ModuleId, usize> = HashMap::new();
        for fire in firing.iter() {
            if self.events.steps.has_rules[self.world.tree.kind(fire.id).index()] {
                others.insert(fire.id, fire.rule);
            }
        }
        let mut population = std::mem::take(&mut self.events.steps.population);
        let mut found = std::mem::take(&mut self.events.steps.firing);
        self.events.steps.contexts.clear();
        let mut first = Vec::new();
        population.retain(|&id| {
            if !self.world.tree.is_alive(id) {
                return false;
            }
            let kind = self.world.tree.kind(id).index();
            match self.applying(id) {
                None => !self.events.steps.is_settled[kind],
                Some((rule, _)) if others.get(&id).is_some_and(|other| *other < rule) => true,
                Some((rule, context)) => {
                    if others.contains_key(&id) {
                        first.push(id);
                    }
                    self.events.steps.contexts.push(context);
                    found.push(Firing::at(id, rule, 0));
                    false
                }
            }
        });
        firing.retain(|fire| !first.contains(&fire.id));
        self.events.steps.population = population;
        self.events.steps.firing = found;
    }

    /// The first discrete rule whose context is there and whose condition holds, with that context.
    fn applying(&mut self, id: ModuleId) -> Option<(usize, Context)> {
        let model = self.setup.model;
        let mut context = Context::default();
        for &index in &model.kinds.get(self.world.tree.kind(id)).steps {
            let rule = &model.rules[index];
            if !self.context(id, rule, false, &mut context) {
                continue;
            }
            if self.holds_now(id, rule, &context) {
                return Some((index, context));
            }
        }
        None
    }

    /// Judges the condition of a discrete rule by the values of now.
    fn holds_now(&mut self, id: ModuleId, rule: &Rule, context: &Context) -> bool {
        let guard = &rule.produces[0].guard;
        if guard.is_always() {
            return true;
        }
        self.world.variables(rule, id, context, self.instant.at, &mut self.scratch.variables);
        let mut sides: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.scratch.variables, &mut self.scratch.registers, &mut sides);
        let exact = &self.events.steps.exact[rule.index];
        let sign = |atom: usize| match (sides[2 * atom], sides[2 * atom + 1]) {
            (a, b) if !exact[atom] => sign_at_birth(a, b),
            // Not by their difference: that of two infinite sides is no number.
            (a, b) if a == b => Sign::Zero,
            (a, b) if a < b => Sign::Minus,
            (a, b) if a > b => Sign::Plus,
            _ => Sign::Undefined,
        };
        guard.judge(sign) == Truth::Yes
    }
}
