//! What happens at one instant: productions, cascades, changes of equations.
//!
//! ```text
//! look up rules and contexts ─▶ judge at the instant ─▶ replace all in parallel ─┐
//!        ▲                              │ nothing holds                           │
//!        └──────────────────────────────┼─────────────────────────────────────────┘
//!                                       ▼
//!            choose equations ─▶ where do the zero signs go? ─▶ judge just after
//! ```
//!
//! LANGUAGE, "Events": all modules whose conditions hold are replaced in parallel, on the values before
//! any was replaced; then the string is examined again at the same instant, until nothing holds. Only the modules
//! that the instant concerns are *open*; the rest go on as they were.

use std::sync::LazyLock;

use smallvec::SmallVec;

use super::around::Around;
use super::career::{Career, End};
use super::chance;
use super::error::Error;
use super::event::Event;
use super::plant::Plant;
use super::simulation::Simulation;
use super::state::{Change, Open, State};
use dlsys_model::{Comparison, Model, Outcome, Sign, Truth, ZeroCrossing};
use dlsys_tree::ModuleId;

/// Most rounds of productions at one instant.
pub const MAX_ROUNDS: usize = 10_000;

/// Lists that were longer are not kept for the next instant.
pub(super) const LONG: usize = 1 << 18;

/// A production that applies.
#[derive(Clone, Debug)]
pub(super) struct Firing {
    pub id: ModuleId,
    pub rule: usize,
    pub produce: usize,
}

impl Simulation<'_> {
    /// Brings the structure at the present instant to rest: nothing holds any more, and every module
    /// has its equations. The modules in `self.opened` are open already.
    pub(super) fn settle(&mut self) -> Result<(), Error> {
        self.group += 1;
        self.note_arrivals();
        self.open_resting();
        self.begin_levelling();
        self.settle_from(0)
    }

    /// The same where nothing but productions of light modules is known to happen at the instant: `self.firing_light`.
    /// Most events are like that.
    pub(super) fn settle_lightly(&mut self) -> Result<(), Error> {
        if !self.plain {
            return self.settle();
        }
        self.group += 1;
        let light = std::mem::take(&mut self.firing_light);
        self.replace_all_light(light, 1)?;
        // What is made may have to be looked at, or end at once.
        if self.fresh.is_empty() && self.firing_light.is_empty() { Ok(()) } else { self.settle_from(1) }
    }

    /// What happens at the instant after so many rounds of productions.
    fn settle_from(&mut self, mut rounds: usize) -> Result<(), Error> {
        let mut hurried = false;
        loop {
            if !self.fresh.is_empty() || std::mem::take(&mut self.changed) {
                self.look_up();
                self.level(false)?;
            }
            if self.steps.due {
                self.afford_round(self.steps.len(), self.steps.first())?;
            }
            let mut firing = self.judge();
            let mut light = std::mem::take(&mut self.firing_light);
            self.find_steps(&mut firing);
            if !self.steps.firing.is_empty() {
                rounds += 1;
                self.replace_with_steps(&mut light, &mut firing, rounds)?;
                (self.firing, self.firing_light) = (firing, light);
                continue;
            }
            if firing.is_empty() && light.is_empty() && !self.opened.is_empty() {
                self.choose_equations(&mut hurried, &mut firing)?;
            }
            if firing.is_empty() && light.is_empty() {
                if self.level(true)? {
                    (self.firing, self.firing_light) = (firing, light);
                    continue;
                }
                (self.firing, self.firing_light) = (firing, light);
                break;
            }
            rounds += 1;
            self.watch_round(|simulation| {
                let first =
                    light.first().map_or_else(|| firing[0].id, |slot| simulation.plant.tree.id(*slot));
                simulation.site_of_firing(first, firing.first())
            })?;
            if rounds > MAX_ROUNDS {
                let first = light.first().map_or_else(|| firing[0].id, |slot| self.plant.tree.id(*slot));
                let site = self.site_of_firing(first, firing.first());
                return Err(if hurried { Error::Zeno { site } } else { Error::Cascade { site, rounds } });
            }
            if firing.iter().all(|fire| self.plant.is_light(fire.id)) {
                light.extend(firing.iter().map(|fire| fire.id.slot() as u32));
                self.replace_all_light(light, rounds)?;
            } else {
                self.promote_all(&light, &mut firing);
                self.replace(&firing, rounds)?;
                clear(&mut light);
                self.firing_light = light;
            }
            clear(&mut firing);
            self.firing = firing;
        }
        self.neighbours.end_instant();
        self.finish_transitions();
        self.begin_phases()?;
        self.arrange_step()
    }

    /// The round to which a derivation step belongs. Nobody reads light modules, so they may be replaced first; all
    /// others are replaced together.
    fn replace_with_steps(
        &mut self,
        light: &mut Vec<u32>,
        firing: &mut Vec<Firing>,
        rounds: usize,
    ) -> Result<(), Error> {
        if firing.is_empty() && !light.is_empty() {
            self.replace_all_light(std::mem::take(light), rounds)?;
        } else if !firing.is_empty() {
            self.promote_all(light, firing);
        }
        let mut steps = std::mem::take(&mut self.steps.firing);
        firing.append(&mut steps);
        self.replace(firing, rounds)?;
        self.steps.firing = steps;
        clear(&mut self.steps.firing);
        clear(firing);
        clear(light);
        Ok(())
    }

    /// Opens a module because of signs that are zero now.
    pub(super) fn touch(&mut self, id: ModuleId, touched: &[Change]) {
        let now = self.now;
        let Some(state) = self.plant.state_mut(id) else { return };
        state.pass_changes(now);
        let fresh = state.open.is_none();
        let open = state.follow();
        for change in touched {
            open.at[change.atom] = change.at;
            open.guess[change.atom] = change.after;
        }
        if fresh {
            self.opened.push(id);
        }
        self.plant.materialise(id, now);
        // Where the instant is known from a level, the value there is that level, not a rounding of it.
        for (parameter, level) in touched.iter().filter_map(|change| change.level) {
            let place = self.plant.tree.places(id).start + parameter;
            self.plant.tree.set_value(place, level);
        }
    }

    /// Opens the modules that rest on a boundary and look at their neighbours: it may be that those move now.
    fn open_resting(&mut self) {
        let mut resting = std::mem::take(&mut self.resting);
        for id in resting.drain(..) {
            let state = self.plant.state(id);
            if state.is_some_and(|s| s.rule.is_some() && s.open.is_none() && s.signs.contains(&Sign::Zero)) {
                self.touch(id, &[]);
            }
        }
        self.resting = resting;
    }

    /// Remembers those of the modules that rest on a boundary and have a context.
    pub(super) fn note_resting(&mut self, modules: &[ModuleId]) {
        for &id in modules {
            let state = self.plant.state(id);
            let rests = |s: &State| {
                // What stands still until an event of its own is not moved by others.
                let watch = s.rule.map_or(&[][..], |rule| self.model.rules[rule].watch(s.solve));
                let mut atoms = s.signs.iter().zip(watch);
                atoms.any(|(sign, watch)| *sign == Sign::Zero && !matches!(watch, ZeroCrossing::Constant))
            };
            if state.is_some_and(|s| !s.context.is_empty() && rests(s)) {
                self.resting.push(id);
            }
        }
    }

    /// The production of each open module whose condition holds at the instant.
    fn judge(&mut self) -> Vec<Firing> {
        // A cascade of light modules may be most of the structure.
        if self.opened.iter().all(|id| self.plant.is_light(*id)) {
            self.firing_light.extend(self.opened.iter().map(|id| id.slot() as u32));
            clear(&mut self.opened);
        }
        let mut firing = std::mem::take(&mut self.firing);
        let plant = &self.plant;
        firing.extend(self.opened.iter().filter_map(|&id| {
            if let Some(career) = plant.careers.get(plant.tree.label_if_alive(id)?) {
                return Some(Firing { id, rule: career.rule, produce: career.produce()? });
            }
            let state = plant.state(id)?;
            let (rule, open) = (state.rule?, state.open.as_ref()?);
            let produces = &self.model.rules[rule].produces;
            let produce = produces.iter().position(|p| p.guard.judge(|i| open.at[i]) == Truth::Yes)?;
            Some(Firing { id, rule, produce })
        }));
        firing
    }

    /// Replaces light modules: none reads what another is replaced by. Those of their successors that end at once are the next
    /// in `self.firing_light`, which was empty.
    fn replace_all_light(&mut self, mut light: Vec<u32>, rounds: usize) -> Result<(), Error> {
        if light.len() > LONG {
            self.afford_round(light.len(), light.first().map(|slot| self.plant.tree.id(*slot)))?;
            // A cascade may double with each round. Growing bit by bit, the list would be there twice.
            self.firing_light.reserve_exact(2 * light.len());
        }
        for &slot in &light {
            self.replace_light(slot, rounds)?;
        }
        if self.firing_light.is_empty() {
            clear(&mut light);
            self.firing_light = light;
        }
        self.structure += 1;
        self.changed = true;
        if !self.opened.is_empty() {
            let plant = &self.plant;
            self.opened.retain(|id| plant.state(*id).is_some());
        }
        Ok(())
    }

    /// Makes all productions of a round such as are known of modules with a state, those of light ones first.
    fn promote_all(&mut self, light: &[u32], firing: &mut Vec<Firing>) {
        for fire in firing.iter() {
            self.promote(fire.id);
        }
        let mut all = Vec::new();
        for &slot in light {
            let id = self.plant.tree.id(slot);
            let at_birth = match self.plant.careers.get(self.plant.tree.label(id)) {
                Some(Career { rule, end: Some(End::AtBirth { produce }), .. }) => Some((*rule, *produce)),
                _ => None,
            };
            self.promote(id);
            match at_birth {
                Some((rule, produce)) => all.push(Firing { id, rule, produce }),
                None => all.extend(self.fire_quickly(slot as usize)),
            }
        }
        all.append(firing);
        *firing = all;
    }

    /// The place of a production that is one too many.
    fn site_of_firing(&mut self, id: ModuleId, other: Option<&Firing>) -> super::error::Site {
        let career = self.plant.careers.get(self.plant.tree.label(id));
        let known = career.and_then(|career| Some((career.rule, career.produce()?)));
        match (known, other) {
            (Some((rule, produce)), _) => {
                self.stand_still(id);
                self.site(&Firing { id, rule, produce })
            }
            (None, Some(fire)) => self.site(fire),
            (None, None) => self.site_of(id, 0, Default::default(), self.now.to_f64()),
        }
    }

    /// Replaces all modules in parallel: every successor is computed before any is put in.
    fn replace(&mut self, firing: &[Firing], rounds: usize) -> Result<(), Error> {
        let model = self.model;
        if self.reads_lazily() {
            self.refresh(self.now)?;
        }
        self.afford_round(firing.len(), firing.first().map(|fire| fire.id))?;
        let known = self.log.as_ref().map_or(0, Vec::len);
        self.record(firing);
        let mut all = std::mem::take(&mut self.arguments);
        all.clear();
        let mut ends = std::mem::take(&mut self.argument_ends);
        ends.clear();
        let mut contexts = 0;
        for (index, fire) in firing.iter().enumerate() {
            let rule = &model.rules[fire.rule];
            let clause = &rule.produces[fire.produce];
            if clause.is_fault {
                self.take_back(known);
                return Err(Error::NegativeRate { site: self.site(fire) });
            }
            let around = context_of(model, &self.plant, &self.steps.contexts, fire, &mut contexts);
            self.plant.variables(rule, fire.id, around, self.now, &mut self.variables);
            let lineage = self.plant.tree.lineage(fire.id);
            let (seed, variables, scratch) = (self.seed, &mut self.variables, &mut self.scratch);
            let made = chance::decide(seed, &clause.outcome, clause.key, lineage, variables, scratch)
                .and_then(|which| {
                    let family = lineage.family(Outcome::production(clause.key, which));
                    let successor = &clause.outcome.successors[which];
                    chance::arguments(seed, successor, family, variables, scratch, &mut all)?;
                    Ok((which, family))
                });
            match made {
                Ok((which, family)) => {
                    self.note_choice(firing.len() - index, &clause.outcome, which);
                    ends.push((all.len(), which, family));
                }
                Err(misfortune) => {
                    self.take_back(known);
                    return Err(misfortune.error(self.site(fire)));
                }
            }
        }
        let mut first = 0;
        for (fire, &(end, which, family)) in firing.iter().zip(&ends) {
            let successor = &model.rules[fire.rule].produces[fire.produce].outcome.successors[which];
            if self.plant.tree.len() + successor.kinds.len() > self.settings.max_modules {
                let limit = self.settings.max_modules;
                return Err(Error::TooManyModules { site: self.site(fire), limit, rounds });
            }
            if let Err(shortage) = self.room_for(successor) {
                return Err(self.out_of_memory(shortage, self.site(fire)));
            }
            let kind = self.plant.tree.kind(fire.id);
            self.forget(fire.id);
            let mut made = std::mem::take(&mut self.fresh);
            let known = made.len();
            self.plant.tree.replace(fire.id, successor, &all[first..end], self.now, family, &mut made);
            self.note_successor(fire.id, successor, &made[known..]);
            self.hand_on(fire.id, kind, successor, &made[known..]);
            self.fresh = made;
            first = end;
        }
        self.arguments = all;
        self.argument_ends = ends;
        self.structure += 1;
        self.changed = true;
        let plant = &self.plant;
        self.opened.retain(|id| plant.state(*id).is_some());
        self.stats.events += firing.len() as u64;
        self.stats.peak_modules = self.stats.peak_modules.max(self.plant.tree.len() as u64);
        Ok(())
    }

    /// Tells the log, of the event that is so far from its end, which successor was chosen.
    fn note_choice(&mut self, from_end: usize, outcome: &Outcome, which: usize) {
        let Some(log) = &mut self.log else { return };
        let at = log.len() - from_end;
        log[at].successor = outcome.weights.is_some().then_some(which);
    }

    /// Takes productions out of the log again that do not take place.
    fn take_back(&mut self, known: usize) {
        if let Some(log) = &mut self.log {
            log.truncate(known);
        }
    }

    /// Writes productions that are about to take place into the log.
    fn record(&mut self, firing: &[Firing]) {
        let Some(mut log) = self.log.take() else { return };
        self.note_predecessors(firing, log.len());
        let (mut contexts, model) = (0, self.model);
        for fire in firing {
            let rule = &model.rules[fire.rule];
            let around = context_of(model, &self.plant, &self.steps.contexts, fire, &mut contexts);
            self.plant.variables(rule, fire.id, around, self.now, &mut self.variables);
            let mut sides: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
            rule.sides.eval(&self.variables, &mut self.scratch, &mut sides);
            let state = self.plant.state(fire.id).filter(|_| !rule.discrete);
            let zero = |atom: usize| match state.map(|state| (state, &state.open)) {
                None => false,
                Some((_, Some(open))) => open.at[atom] == Sign::Zero,
                Some((state, None)) => state.next.touched.iter().any(|change| change.atom == atom),
            };
            let residual = (rule.produces[fire.produce].guard.atoms())
                .filter(|_| !rule.discrete)
                .filter(|(atom, comparison)| *comparison == Comparison::Equal || zero(*atom))
                .map(|(atom, _)| (sides[2 * atom] - sides[2 * atom + 1]).abs())
                .fold(0.0, f64::max);
            log.push(Event {
                time: self.now.to_f64(),
                lineage: self.plant.tree.lineage(fire.id),
                kind: self.plant.tree.kind(fire.id),
                rule: fire.rule,
                clause: fire.produce,
                successor: None,
                residual,
                group: self.group,
                transition: None,
            });
        }
        self.log = Some(log);
    }
}

/// The context of a production. Those of a step are kept in the order of its productions; `passed` counts them.
fn context_of<'c>(
    model: &Model,
    plant: &'c Plant,
    steps: &'c [Around],
    fire: &Firing,
    passed: &mut usize,
) -> &'c Around {
    if !model.rules[fire.rule].discrete {
        return plant.state(fire.id).map_or(&NOBODY, |state| &state.context);
    }
    *passed += 1;
    &steps[*passed - 1]
}

/// What a module looks at that looks at nobody.
static NOBODY: LazyLock<Around> = LazyLock::new(Around::default);

/// Empties a list, and gives back its memory if that is much.
pub(super) fn clear<T>(list: &mut Vec<T>) {
    list.clear();
    if list.capacity() > LONG {
        *list = Vec::new();
    }
}

/// What is open about a module, which must be.
pub(super) fn open(state: &mut super::state::State) -> &mut Open {
    state.open.get_or_insert_with(Box::default)
}
