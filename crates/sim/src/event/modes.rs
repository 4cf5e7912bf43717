//! Mode selection: the choice of equations at an instant, so that they agree with where they lead.
//!
//! Which clause is active just after an instant depends on signs just after it, and those on the equations. The first
//! choice follows what is known; a choice that leads out of its own domain is given up for the next.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use smallvec::SmallVec;

use super::SHORT_LIFE;
use super::opening::open;
use super::{EventStage, Firing};
use crate::error::Error;
use crate::world::state::{Open, Signs, Switches};
use dlsys_model::{Condition, ConditionStep, Remedy, Rule, Sign, Truth, ZeroCrossing};
use dlsys_tree::ModuleId;

/// Most passes over the open modules in which their equations are chosen anew, beyond one for each of them.
const MAX_PASSES: usize = 8;

/// So far away what a module reads may have got other equations for its signs to be in question.
pub(super) const FAR_AWAY: usize = 4;

/// So many times the conditions inside the equations of a module turn before it is tried on the boundary.
const FLIPS: usize = 2;

/// Rates that differ by no more than this part of them, or of the module's parameters over a step, are the same.
const SMOOTH: f64 = 1e-9;

/// A module without equations, and the reason.
struct NoMode {
    id: ModuleId,
    chattering: bool,
    signs: Signs,
}

/// One pass over the open modules.
#[derive(Default)]
struct Pass {
    /// Some module has got other equations: the last one, with its signs just after the instant.
    changed: Option<(ModuleId, Signs)>,
    missing: Option<NoMode>,
    /// Modules whose equations agree with their signs just after the instant, with these.
    settled: SmallVec<[(ModuleId, Signs); 4]>,
    /// Productions that hold just after the instant, if all equations are as they are now.
    follow: Vec<Firing>,
}

/// The search for equations that agree with where they lead.
#[derive(Default)]
struct Search {
    /// What the equations were after each pass.
    seen: HashSet<u64>,
    /// They have come back to what they were: from now on a module's choices count also if what it reads has changed meanwhile.
    hasty: bool,
    /// Choices up to then.
    choices: usize,
}

impl EventStage<'_, '_> {
    /// Chooses the equations of the open modules; finds productions whose conditions become true just after the
    /// instant.
    pub fn select_modes(&mut self, hurried: &mut bool, firing: &mut Vec<Firing>) -> Result<(), Error> {
        let opened = std::mem::take(&mut self.events.opened);
        let outcome = self.select_modes_of(&opened, hurried, firing);
        self.events.opened = opened;
        outcome
    }

    fn select_modes_of(
        &mut self,
        opened: &[ModuleId],
        hurried: &mut bool,
        firing: &mut Vec<Firing>,
    ) -> Result<(), Error> {
        self.choose_first(opened);
        self.flows.known_rates.clear();
        let mut search = Search::default();
        for number in 0.. {
            let mut pass = self.pass(opened, (number, search.hasty), hurried, firing);
            let turns = pass.changed.is_some() && self.turns(&mut search, number, opened);
            if turns {
                // What depends on a choice that comes and goes does not follow.
                pass.follow.retain(|fire| !self.reads_chosen_after(search.choices, fire.id, FAR_AWAY));
            }
            if pass.changed.is_none() || turns {
                firing.append(&mut pass.follow);
            }
            if !firing.is_empty() {
                return Ok(());
            }
            if pass.changed.is_some() && !turns {
                continue;
            }
            let chatters = |(id, signs)| NoMode { id, chattering: true, signs };
            if let Some(missing) = pass.missing.or_else(|| pass.changed.map(chatters)) {
                return Err(self.no_equations(&missing));
            }
            for (id, signs) in pass.settled {
                self.world.state_mut(id).expect("settled").marks.set_signs(&signs);
            }
            return Ok(());
        }
        Ok(())
    }

    /// One pass over the open modules, the equations of which are chosen anew where they do not agree with where they lead. Productions that
    /// hold at the instant go into `firing`.
    fn pass(
        &mut self,
        opened: &[ModuleId],
        (number, hasty): (usize, bool),
        hurried: &mut bool,
        firing: &mut Vec<Firing>,
    ) -> Pass {
        let mut pass = Pass::default();
        for i in 0..opened.len() {
            // Most modules that read others read them on one side: to and fro, so that those that are read come first once.
            let id = opened[if number % 2 == 0 { i } else { opened.len() - 1 - i }];
            if self.world.state(id).is_none_or(|s| s.rule.get().is_none()) {
                continue;
            }
            let (signs, snapped) = self.signs_after(id);
            // A value born within the resolution of time of zero is born on it.
            *hurried |= snapped;
            match self.production_of(id, &signs) {
                Some((fire, true)) => firing.push(fire),
                // What holds after the instant may follow from equations that this module, or another one, will not have.
                Some((fire, false)) if self.is_left_to(id, &signs) => pass.follow.push(fire),
                _ => self.reconsider(id, signs, hasty, &mut pass),
            }
        }
        pass
    }

    /// True if the choice of equations has come again, also with all choices counted: it leads nowhere.
    fn turns(&self, search: &mut Search, number: usize, opened: &[ModuleId]) -> bool {
        if search.seen.insert(self.choice_of(opened)) && number <= 2 * (MAX_PASSES + opened.len()) {
            return false;
        }
        let again = std::mem::replace(&mut search.hasty, true);
        if !again {
            search.seen.clear();
            search.choices = self.events.choices;
        }
        again
    }

    /// The first choice: the first clause that can hold where the signs are expected to go.
    pub(super) fn choose_first(&mut self, opened: &[ModuleId]) {
        for id in opened {
            let Some(state) = self.world.state_mut(*id) else { continue };
            let Some(rule) = state.rule.get().map(|r| &self.setup.model.rules[r]) else { continue };
            let entry = open(state);
            entry.tried.clear();
            (entry.flips, entry.chosen) = (0, 0);
            let guess = entry.guess.clone();
            state.solve = next_clause(rule, &guess, &[]).into();
            state.marks.set_switches(&switches(rule, state.solve.get(), &guess));
        }
    }

    /// The production of an open module that holds at the instant, or else just after it; true if it holds at it.
    fn production_of(&self, id: ModuleId, after: &[Sign]) -> Option<(Firing, bool)> {
        let state = self.world.state(id)?;
        let rule = state.rule.get()?;
        if let Some(produce) = self.production_at(rule, &state.open.as_ref()?.at) {
            return Some((Firing::at(id, rule, produce), true));
        }
        let produces = &self.setup.model.rules[rule].produces;
        let produce = produces.iter().position(|p| p.guard.judge(|i| after[i]) == Truth::Yes)?;
        Some((Firing { id, rule, produce, after: self.setup.jumps[rule][produce] }, false))
    }

    /// True if the equations of a module lead to signs under which they, or none, hold.
    fn is_left_to(&self, id: ModuleId, signs: &[Sign]) -> bool {
        let state = self.world.state(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.get().expect("open modules have a rule")];
        match rule.solves.iter().position(|solve| solve.guard.judge(|i| signs[i]) == Truth::Yes) {
            None => true,
            first => first == state.solve.get() && switches(rule, first, signs) == state.marks.switches(),
        }
    }

    /// Compares the equations of a module with the signs just after the instant that follow from them, and chooses again
    /// if they disagree.
    fn reconsider(&mut self, id: ModuleId, signs: Signs, hasty: bool, pass: &mut Pass) {
        let reads_anew = !hasty && self.reads_anew(id);
        let choices = self.events.choices + 1;
        let state = self.world.state_mut(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.get().expect("open modules have a rule")];
        let entry = state.open.as_mut().expect("open");
        if reads_anew {
            entry.flips = 0;
            entry.tried.clear();
        }
        let first = rule.solves.iter().position(|s| s.guard.judge(|i| signs[i]) == Truth::Yes);
        if first != state.solve.get() || (first.is_none() && !rule.solves.is_empty()) {
            entry.tried.extend(state.solve.get());
            // Any zero may yet go either way under other equations.
            let any: Signs = entry.at.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
            let untried = first.filter(|f| !entry.tried.contains(f));
            match untried.or_else(|| next_clause(rule, &any, &entry.tried)) {
                Some(next) => {
                    state.solve = Some(next).into();
                    state.marks.set_switches(&switches(rule, state.solve.get(), &signs));
                    entry.chosen = choices;
                    self.events.choices = choices;
                    self.flows.known_rates.forget(id);
                    pass.changed = Some((id, signs));
                }
                None => {
                    let chattering = entry.tried.len() > 1;
                    pass.missing.get_or_insert(NoMode { id, chattering, signs });
                }
            }
            return;
        }
        let wanted = switches(rule, state.solve.get(), &signs);
        let other = state.marks.switches();
        if wanted != other {
            entry.flips += 1;
            entry.chosen = choices;
            self.events.choices = choices;
            let undecided = entry.flips > FLIPS;
            let at_rest = entry.flips == FLIPS + 1;
            state.marks.set_switches(&wanted);
            self.flows.known_rates.forget(id);
            let smooth = undecided && self.is_smooth_across(id, &other);
            if smooth || at_rest {
                // It goes on alike on both sides, or there may be a rate between them that keeps it there: it rests on the boundary.
                let state = self.world.state_mut(id).expect("seen above");
                let at = &state.open.as_ref().expect("open").at;
                let both = at.iter().zip(&signs);
                let rest: Signs =
                    both.map(|(at, after)| if *at == Sign::Zero { Sign::Zero } else { *after }).collect();
                state.marks.set_switches(&switches(rule, state.solve.get(), &rest));
                if !smooth {
                    pass.changed = Some((id, signs));
                }
                pass.settled.push((id, rest));
                return;
            }
            if undecided {
                pass.missing.get_or_insert(NoMode { id, chattering: true, signs: signs.clone() });
            }
            pass.changed = Some((id, signs.clone()));
        }
        pass.settled.push((id, signs));
    }

    /// True if a module that this one reads has got other equations since this one got its own.
    fn reads_anew(&self, id: ModuleId) -> bool {
        let state = self.world.state(id).expect("open modules have a state");
        let own = state.open.as_ref().map_or(0, |open| open.chosen);
        let chosen = |module: &ModuleId| {
            let open = self.world.state(*module).and_then(|state| state.open.as_ref());
            open.is_some_and(|open| open.chosen > own)
        };
        state.context.iter().any(chosen)
    }

    /// True if a module, or what it reads, has got other equations after so many choices.
    fn reads_chosen_after(&self, choices: usize, id: ModuleId, depth: usize) -> bool {
        let Some(state) = self.world.state(id) else { return false };
        state.open.as_ref().is_some_and(|open| open.chosen > choices)
            || depth > 0 && state.context.iter().any(|id| self.reads_chosen_after(choices, *id, depth - 1))
    }

    /// What the equations of the open modules are, as one number.
    fn choice_of(&self, opened: &[ModuleId]) -> u64 {
        let mut hasher = DefaultHasher::new();
        for state in opened.iter().filter_map(|id| self.world.state(*id)) {
            (state.solve.get(), state.marks.switches()).hash(&mut hasher);
        }
        hasher.finish()
    }

    /// True if a module, and those that it reads, go on with the equations that brought them here.
    pub(super) fn goes_on_alike(&self, id: ModuleId, depth: usize) -> bool {
        let is_new = || self.instant.at.since(self.world.tree.birth(id)) <= 0.0;
        let Some(state) = self.world.state(id) else { return !is_new() };
        let is_other = |open: &Open| {
            open.flow.as_ref().is_none_or(|(solve, switches)| {
                *solve != state.solve.get() || *switches != state.marks.switches()
            })
        };
        let begins_anew = match &state.open {
            Some(open) => is_other(open),
            // It has got others that need no choice, or none, at this instant.
            None => state.has_restarted(self.instant.number) || self.instant.at.since(state.since) <= 0.0,
        };
        if begins_anew {
            return false;
        }
        depth == 0 || state.context.iter().all(|module| self.goes_on_alike(*module, depth - 1))
    }

    /// True if a module's rates are the same under other conditions inside its equations.
    fn is_smooth_across(&mut self, id: ModuleId, other: &Switches) -> bool {
        let (mut here, mut there) = (Vec::new(), Vec::new());
        self.flow().rates_now(id, &mut here);
        let swap = |simulation: &mut Self, switches: Switches| {
            simulation.flows.known_rates.forget(id);
            let state = simulation.world.state_mut(id).expect("open modules have a state");
            let before = state.marks.switches();
            state.marks.set_switches(&switches);
            before
        };
        let own = swap(self, other.clone());
        self.flow().rates_now(id, &mut there);
        swap(self, own);
        // A kink in an integrated value has the error of the value.
        let smooth = if self.flows.error_of(self.world, id) > 0.0 {
            SMOOTH.max(self.setup.settings.tolerance)
        } else {
            SMOOTH
        };
        let size = self.scale(id) / self.flows.reach_of(self.world, id);
        here.iter().zip(&there).all(|(a, b)| (a - b).abs() <= smooth * (size + a.abs().max(b.abs())))
    }

    fn no_equations(&mut self, missing: &NoMode) -> Error {
        let id = missing.id;
        if let Some(error) = self.flow().undefined_rate(id) {
            return error;
        }
        let index = self.world.state(id).and_then(|s| s.rule.get()).expect("open modules have a rule");
        let rule = &self.setup.model.rules[index];
        let site = self.world.site(self.setup.model, id, index, rule.span, self.instant.at);
        // A life about as short as the resolution of time, at the end of a line of lives: the order of events at its end
        // is lost in rounding.
        let age = self.instant.at.since(self.world.tree.birth(id));
        let generation = self.world.tree.lineage(id).generation;
        if age > 0.0 && age <= SHORT_LIFE * self.instant.at.resolution() && generation > 4 {
            return Error::Zeno { site };
        }
        if missing.chattering {
            return Error::Chattering { site };
        }
        let (mut variables, mut scratch) = (Vec::new(), Vec::new());
        let state = self.world.state(id).expect("open modules have a state");
        self.world.variables(rule, id, &state.context, self.instant.at, &mut variables);
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&variables, &mut scratch, &mut sides);
        // The signs are those just behind the instant; a production applies to those at it.
        let meet = |atom: usize| {
            let (a, b): (f64, f64) = (sides[2 * atom], sides[2 * atom + 1]);
            (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
        };
        let mut failing = Vec::new();
        for solve in &rule.solves {
            for (atom, comparison) in solve.guard.atoms() {
                let alone = Condition(vec![ConditionStep::Atom(atom as u32, comparison)]);
                if alone.judge(|i| missing.signs[i]) == Truth::No
                    && !failing.iter().any(|(s, _)| *s == rule.atoms[atom])
                {
                    // A difference that never changes may be beyond the boundary as well.
                    let moves = !matches!(solve.zero_crossings[atom], ZeroCrossing::Constant);
                    let sign = match missing.signs[atom] {
                        Sign::Undefined => Sign::Undefined,
                        _ if !moves => Sign::Any,
                        _ if meet(atom) => Sign::Zero,
                        sign => sign,
                    };
                    let remedy = Remedy::new(&self.setup.model.kinds, rule, atom, comparison, sign);
                    failing.push((rule.atoms[atom], remedy));
                }
            }
        }
        Error::OutsideDomain { site, born: age == 0.0, failing }
    }
}

/// The first clause, not tried before, whose condition holds or may hold.
fn next_clause(rule: &Rule, signs: &[Sign], tried: &[usize]) -> Option<usize> {
    (rule.solves.iter().enumerate())
        .find(|(i, s)| !tried.contains(i) && s.guard.judge(|a| signs[a]) != Truth::No)
        .map(|(i, _)| i)
}

/// The conditions inside a clause's equations. A condition that may hold is first taken to hold.
fn switches(rule: &Rule, solve: Option<usize>, signs: &[Sign]) -> Switches {
    let all = solve.map_or(&[][..], |s| &rule.solves[s].switches);
    all.iter().map(|s| s.condition.judge(|a| signs[a]) != Truth::No).collect()
}
