//! The modules that an instant concerns: how they are opened, and the fast path for predicted lives.

use smallvec::SmallVec;

use super::behind::When;
use super::{EventStage, Firing};
use crate::error::Error;
use crate::flow::prediction::{PredictedEnd, Prediction, predict};
use crate::schedule::{NextEvent, Owner};
use crate::trajectory::Trajectory;
use crate::world::brief;
use crate::world::context::Context;
use crate::world::state::{Change, Level, NextKind, Open, State};
use dlsys_model::{Sign, Truth, ZeroCrossing};
use dlsys_tree::ModuleId;

/// See [`EventStage::turn`].
const LAST_TURN: u8 = 2;

impl EventStage<'_, '_> {
    /// Opens everything that happens at one instant; returns the first module of it.
    pub fn open_batch(&mut self, batch: &[NextEvent]) -> Result<Option<ModuleId>, Error> {
        let all_lazy = batch.iter().all(|next| match next {
            NextEvent::Lazy(..) => true,
            NextEvent::Other(entry) => entry.owner == Owner::Derivation,
        });
        let ties = self.find_ties(batch);
        self.events.void.clear();
        let mut oldest = None;
        // Whoever asks on which side of a jump it is asks the levels that others meet, not roundings of them.
        let turns: SmallVec<[u8; 8]> = match batch {
            [_] => SmallVec::from_slice(&[0]),
            _ => batch.iter().map(|next| self.turn(next)).collect(),
        };
        let of = |turn: u8| batch.iter().zip(&turns).filter(move |(_, own)| **own == turn);
        let mut put_off: SmallVec<[u32; 2]> = SmallVec::new();
        for (next, _) in (0..=LAST_TURN).flat_map(of) {
            let owner = match *next {
                NextEvent::Lazy(_, slot) if all_lazy => {
                    self.events.firing_lazy.push(slot);
                    oldest = oldest.or(Some(self.world.tree.id(slot)));
                    continue;
                }
                NextEvent::Lazy(_, slot) => {
                    self.materialise(self.world.tree.id(slot));
                    Owner::Module(slot)
                }
                NextEvent::Other(entry) => entry.owner,
            };
            let first = match owner {
                // Ticks are not in a batch.
                Owner::Coupled | Owner::Tick => None,
                Owner::Derivation => {
                    self.begin_step();
                    None
                }
                Owner::Module(slot) => match self.fire_known(slot as usize, batch.len() == 1) {
                    Some(firing) => {
                        let id = firing.id;
                        self.events.firing.push(firing);
                        Some(id)
                    }
                    None => {
                        let touched = self.touch_scheduled(slot as usize)?;
                        if touched.is_none() {
                            put_off.push(slot);
                        }
                        touched
                    }
                },
            };
            oldest = oldest.or(first);
        }
        // What the neighbours have met is known now, and no longer moves on.
        for slot in put_off {
            let around = self.around(self.world.tree.id(slot));
            if around.iter().any(|beside| self.takes_place(*beside)) {
                self.schedule.cancel(Owner::Module(slot));
                oldest = self.touch_scheduled(slot as usize)?.or(oldest);
            }
        }
        self.join_ties(&ties);
        Ok(oldest)
    }

    /// When an event is opened among those of its instant. One at which something jumps that was not taken apart into what moves comes late, and last if
    /// it brings no level of its own.
    fn turn(&self, next: &NextEvent) -> u8 {
        let NextEvent::Other(entry) = next else { return 0 };
        let Owner::Module(slot) = entry.owner else { return 0 };
        let Some(state) = self.world.states.get(slot as usize) else { return 0 };
        let Some(rule) = state.rule.get().filter(|rule| self.setup.has_jumps[*rule]) else { return 0 };
        let (rule, touched) = (&self.setup.model.rules[rule], state.next.touched());
        match touched.iter().any(|change| rule.jumping_whole[change.atom()]) {
            false => 0,
            true if touched.iter().any(|change| change.level().is_some()) => 1,
            true => LAST_TURN,
        }
    }

    /// Opens a module because of signs that are zero now.
    pub fn touch(&mut self, id: ModuleId, touched: &[Change]) {
        let now = self.instant.at;
        let Some(state) = self.world.state_mut(id) else { return };
        state.pass_changes(now);
        let fresh = state.open.is_none();
        let open = state.follow();
        for change in touched {
            open.at[change.atom()] = change.at;
            open.guess[change.atom()] = change.after;
        }
        if fresh {
            self.events.opened.push(id);
        }
        self.world.rebase(id, now);
        // Where the instant is known from a level, the value there is that level, not a rounding of it.
        for change in touched {
            let level = change.level();
            if let Some((variable, value)) = level {
                let places = self.world.tree.places(id);
                match variable.checked_sub(places.len()) {
                    None => self.world.tree.set_value(places.start + variable, value),
                    Some(of_context) => self.note_level_of_neighbour(id, of_context, value),
                }
            } else if !self.is_meeting(id, change) {
                continue;
            }
            if let Some(open) = self.world.state_mut(id).and_then(|state| state.open.as_mut()) {
                open.levels.push(Level { atom: change.atom(), level, after: change.after });
            }
        }
        self.settle_at_edge(id);
    }

    /// True if sides meet at the instant, no variable that alone would do so, and a production depends on them or equations that end there.
    fn is_meeting(&self, id: ModuleId, change: &Change) -> bool {
        let rule = self.world.state(id).and_then(|state| state.rule.get());
        let concerns = |rule: &usize| self.setup.has_meetings[*rule] || self.setup.has_edges[*rule];
        let Some(index) = rule.filter(concerns) else { return false };
        let rule = &self.setup.model.rules[index];
        change.at == Sign::Zero
            && !rule.jumping_whole[change.atom()]
            && (self.setup.has_edges[index] && rule.decides_equations(change.atom())
                || rule.decides_productions(change.atom()))
    }

    /// The same, of a module whose event has been found to take place now.
    pub(super) fn touch_then(&mut self, id: ModuleId, touched: &[Change], when: When) {
        self.touch(id, touched);
        if let (When::Behind, Some(state)) = (when, self.world.state_mut(id)) {
            open(state).behind = true;
        }
    }

    /// Notes that a parameter of the modules of a context, counted over all of them, is at a level at this instant: whoever reads it now reads
    /// that, and not a rounding of it.
    fn note_level_of_neighbour(&mut self, id: ModuleId, mut parameter: usize, level: f64) {
        let Some(state) = self.world.state(id) else { return };
        for &module in state.context.context() {
            let own = self.world.tree.parameters(module).len();
            if parameter < own {
                self.events.met.push((module, parameter, level));
                return;
            }
            parameter -= own;
        }
    }

    /// Opens the modules that rest on a boundary and have a context: their neighbours may move now.
    pub fn open_resting(&mut self) {
        let mut resting = std::mem::take(&mut self.events.resting);
        for id in resting.drain(..) {
            let state = self.world.state(id);
            if state.is_some_and(|s| {
                s.rule.get().is_some() && s.open.is_none() && s.marks.signs().contains(&Sign::Zero)
            }) {
                self.touch(id, &[]);
            }
        }
        self.events.resting = resting;
    }

    /// Remembers those of the modules that rest on a boundary and have a context.
    pub fn note_resting(&mut self, modules: &[ModuleId]) {
        if !self.setup.has_conditions {
            return;
        }
        for &id in modules {
            let state = self.world.state(id);
            let rests = |s: &State| {
                // Sides that are constant until the module's own event are not moved by its neighbours.
                let watch = s
                    .rule
                    .get()
                    .map_or(&[][..], |rule| self.setup.model.rules[rule].zero_crossings(s.solve.get()));
                let mut atoms = s.marks.signs().iter().zip(watch);
                atoms.any(|(sign, watch)| *sign == Sign::Zero && !matches!(watch, ZeroCrossing::Constant))
            };
            if state.is_some_and(|s| !s.context.is_empty() && rests(s)) {
                self.events.resting.push(id);
            }
        }
    }

    /// Opens a module whose event it is; None if the event turns out to be a little later.
    pub fn touch_scheduled(&mut self, slot: usize) -> Result<Option<ModuleId>, Error> {
        let state = self.world.states.get_mut(slot).expect("scheduled");
        let id = state.id;
        if state.next.kind == NextKind::Doubt {
            let atom = state.next.touched()[0].atom();
            return Err(self.flow().in_doubt(id, atom));
        }
        if state.next.kind == NextKind::Fault {
            let laws = state.trajectories.iter();
            let ends: Vec<Option<f64>> = laws.map(|law| law.formula().and_then(Trajectory::end)).collect();
            let first = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
            let parameter = ends.iter().enumerate().filter_map(|(i, e)| Some((i, (*e)?))).min_by(first);
            let since = state.since;
            let mut error =
                self.world.not_finite(self.setup.model, id, parameter.map_or(0, |p| p.0), self.instant.at);
            if let Error::NotFinite { site, .. } = &mut error {
                // The values that the formula began with; at its end there are none.
                site.module += &format!(" (as of t = {})", brief(since.to_f64(), 6));
            }
            return Err(error);
        }
        let kind = state.next.kind;
        let mut touched = state.next.take_touched();
        let when = self.behind_jumps(id, &mut touched);
        if let When::Later(time) = when {
            self.world.states.get_mut(slot).expect("scheduled").next.touch(kind, touched);
            self.schedule.schedule(Owner::Module(slot as u32), time);
            return Ok(None);
        }
        if let When::Never = when {
            self.events.void.push(id);
        }
        self.flow().learn(id);
        self.touch_then(id, &touched, when);
        Ok(Some(id))
    }

    /// Begins the life of a newborn module by its prediction; false if it has none.
    pub fn begin_predicted(&mut self, id: ModuleId, index: usize) -> bool {
        let rule = &self.setup.model.rules[index];
        // Algebraic parameters must be made consistent first.
        if self.setup.numeric_only
            || !self.setup.fast_path
            || rule.is_algebraic()
            || self.setup.levels_decide[index]
        {
            return false;
        }
        if self.world.lives.rule(self.world.tree.kind(id)).is_some() {
            return self.begin_lazily(id, index);
        }
        let now = self.instant.at;
        self.world.variables(rule, id, &Context::default(), now, &mut self.scratch.variables);
        let Some(prediction) = predict(rule, now, self.scratch) else { return false };
        let Prediction { solve, signs, trajectories, end, .. } = prediction;
        let owner = Owner::Module(id.slot() as u32);
        let change = match end {
            Some(PredictedEnd::AtBirth { .. }) => return false,
            Some(PredictedEnd::Event { change, .. }) => {
                self.schedule.schedule(owner, change.time);
                Some(change)
            }
            None => {
                self.schedule.cancel(owner);
                None
            }
        };
        let state = self.world.make_state(id);
        state.renew(id);
        state.put_under(index, solve);
        state.marks.set_signs(&signs);
        state.since = now;
        state.trajectories.assign(trajectories.into_iter());
        let kind = if change.is_none() { NextKind::Nothing } else { NextKind::Event };
        state.next.touch(kind, change.into_iter().collect());
        state.restart(self.instant.number);
        true
    }

    /// The production of a module whose event was predicted, with its values moved to the event; None if more has to be examined.
    pub fn fire_predicted(&mut self, slot: usize) -> Option<Firing> {
        self.fire_known(slot, false)
    }

    /// The same, also of a module that is integrated alone, if its event is the `only` one of the instant and no module reads another: then there
    /// are no ties to look for, and no transition to be recorded.
    fn fire_known(&mut self, slot: usize, only: bool) -> Option<Firing> {
        let state = self.world.states.get(slot)?;
        if !self.setup.fast_path || state.next.kind != NextKind::Event || state.coupled {
            return None;
        }
        let is_numeric = state.is_numeric();
        if is_numeric && !(only && self.setup.plain) {
            return None;
        }
        let (id, rule) = (state.id, state.rule.get()?);
        if self.setup.levels_decide[rule] || self.setup.has_jumps[rule] || self.setup.has_meetings[rule] {
            return None;
        }
        if self.setup.kinds_with_context[self.world.tree.kind(id).index()] || !state.next.changes().is_empty()
        {
            return None;
        }
        let touched = state.next.touched();
        let at = |i: usize| {
            touched
                .iter()
                .find(|change| change.atom() == i)
                .map_or(state.marks.signs()[i], |change| change.at)
        };
        let produces = &self.setup.model.rules[rule].produces;
        let produce = produces.iter().position(|p| p.guard.judge(at) == Truth::Yes)?;
        let levels: SmallVec<[(usize, f64); 2]> = touched.iter().filter_map(Change::level).collect();
        if is_numeric {
            self.flow().learn(id);
        }
        self.world.rebase_except(id, self.instant.at, &levels);
        Some(Firing::at(id, rule, produce))
    }
}

/// The open questions of a module at the instant.
pub fn open(state: &mut State) -> &mut Open {
    state.open.get_or_insert_with(Box::default)
}
