//! Modules that are integrated alone and alike: those of one kind that stand with the same values under the same equations, and read
//! nothing else. One step, and one search of it, is made for the first of them; the others follow it, at the same instant or later.
//!
//! Divisions into equals make them, a tree whose branches are alike, and organs that all begin with the same values: their lives are one
//! life at many times. What has been found for a step is kept by all that it depends on ([`Standing`]), as long as no other step takes its place.
//!
//! Times are kept as durations since the start of the step, so a follower is exactly where it would be if its own step had been made,
//! but for the rounding of times. What the resolution of time decides (which events are one instant) changes with its size; so an instant
//! counts by its power of two even where equations read no time.

use std::hash::Hasher;
use std::sync::Arc;

use rustc_hash::FxHasher;

use crate::error::Error;
use crate::flow::FlowStage;
use crate::flow::independent::{Experience, Made};
use crate::schedule::Owner;
use crate::world::state::{Next, NextKind, State, Step};
use crate::world::trajectories::Law;
use dlsys_model::{Model, Rule, Solve};
use dlsys_tree::{ModuleId, SimTime};

/// So many steps are kept.
const PLACES: usize = 1024;
/// After so many steps of a clause in a row that none had been like, only some are kept and looked for:
const MANY_MISSES: u32 = PLACES as u32;
/// so many
const SAMPLE: u32 = 64;
/// of so many. Where all lives differ, noting how a module stands takes as long as a few evaluations of its rates.
const PERIOD: u32 = 1024;
/// Modules with more parameters are none for which steps are kept: those may be large.
const MOST_PARAMETERS: usize = 32;

/// All that a step, and what is found in it, depends on, as words; and a hash of them.
#[derive(Debug, Default, PartialEq)]
struct Standing {
    hash: u64,
    words: Vec<u64>,
}

impl Clone for Standing {
    fn clone(&self) -> Standing {
        Standing { hash: self.hash, words: self.words.clone() }
    }

    fn clone_from(&mut self, other: &Standing) {
        self.hash = other.hash;
        self.words.clone_from(&other.words);
    }
}

/// A step that has been made and searched.
#[derive(Debug)]
pub struct KnownStep {
    standing: Standing,
    made: Made,
    /// What has been found, and the time of the module's entry in the schedule.
    next: Next,
    at: SimTime,
}

/// Steps that have been made, by hash. A step takes the place of one of the same hash.
#[derive(Clone, Debug, Default)]
pub struct KnownSteps {
    /// By rule and clause.
    readings: Vec<Vec<Reading>>,
    /// Empty before the first is known.
    places: Vec<Option<Arc<KnownStep>>>,
    /// How the module stands whose step is being made.
    now: Standing,
}

/// What the equations and conditions of a rule read under a clause: the module's own parameters, one bit each, and whether they read the time.
#[derive(Clone, Copy, Debug)]
struct Reading {
    parameters: u32,
    time: bool,
    /// Steps in a row that no other had been like.
    misses: u32,
}

impl Reading {
    /// Counts a step. False for one that is not worth being looked for.
    fn is_worth(&mut self) -> bool {
        self.misses = self.misses.checked_add(1).unwrap_or(MANY_MISSES);
        self.misses < MANY_MISSES || self.misses % PERIOD < SAMPLE
    }
}

impl KnownSteps {
    pub fn new(model: &Model) -> KnownSteps {
        let reading = |rule: &Rule, solve: &Solve| {
            let both = [&solve.rates, &rule.sides].into_iter().flat_map(|program| program.reads());
            let own = both.clone().filter(|variable| **variable < rule.parameters.len().min(MOST_PARAMETERS));
            let parameters = own.fold(0, |all, parameter| all | 1 << parameter);
            Reading {
                parameters,
                time: both.clone().any(|variable| *variable == rule.time_variable()),
                misses: 0,
            }
        };
        let readings = (model.rules.iter())
            .map(|rule| rule.solves.iter().map(|solve| reading(rule, solve)).collect())
            .collect();
        KnownSteps { readings, ..KnownSteps::default() }
    }

    fn place(hash: u64) -> usize {
        (hash >> (u64::BITS - PLACES.ilog2())) as usize
    }

    /// The step of a module that stood like the present one.
    fn get(&self) -> Option<Arc<KnownStep>> {
        let known = self.places.get(KnownSteps::place(self.now.hash))?.as_ref()?;
        (known.standing == self.now).then(|| known.clone())
    }

    /// Notes that a step has been found.
    fn note_hit(&mut self, known: &KnownStep) {
        let clause = known.standing.words[0];
        self.readings[(clause >> 32) as usize][clause as u32 as usize].misses = 0;
    }

    /// Keeps the step of the present module, in the memory of the one whose place it takes.
    fn keep(&mut self, step: &Step, next: &Next, at: SimTime) {
        if self.places.is_empty() {
            self.places.resize(PLACES, None);
        }
        let KnownSteps { places, now, .. } = self;
        let Step { dense, control, number, hurdle, .. } = step;
        let place = &mut places[KnownSteps::place(now.hash)];
        match place.as_mut().and_then(Arc::get_mut) {
            Some(known) => {
                known.standing.clone_from(now);
                known.made.dense.clone_from(dense);
                (known.made.control, known.made.number, known.made.hurdle) = (*control, *number, *hurdle);
                (known.next, known.at) = (next.clone(), at);
            }
            None => {
                let (standing, dense) = (now.clone(), dense.clone());
                let made = Made { dense, control: *control, number: *number, hurdle: *hurdle };
                *place = Some(Arc::new(KnownStep { standing, made, next: next.clone(), at }));
            }
        }
    }
}

/// How a module goes on.
pub(super) enum Followed {
    /// By the step of one that stood like it.
    Alike,
    /// By a step of its own, which may be worth being kept.
    Alone { is_kept: bool },
}

impl FlowStage<'_, '_> {
    /// Makes the step of a module that stood like this one, with what was found in it, its own, if there is one.
    pub(super) fn follow_alike(
        &mut self,
        id: ModuleId,
        from: SimTime,
        experience: &Experience,
    ) -> Result<Followed, Error> {
        if !self.stand(id, from, experience) {
            return Ok(Followed::Alone { is_kept: false });
        }
        let Some(known) = self.flows.known_steps.get() else {
            return Ok(Followed::Alone { is_kept: true });
        };
        self.flows.known_steps.note_hit(&known);
        // Steps of one standing at one instant are the same to the last bit.
        let start = known.made.dense.start;
        let moved = |time: SimTime| if from == start { time } else { from.after(time.since(start)) };
        let mut made = known.made.clone();
        (made.dense.start, made.dense.end) = (from, moved(made.dense.end));
        self.take_step(id, from, made)?;
        let state = self.world.state_mut(id).expect("has a step");
        let (near, index) = (state.next.near(), state.rule.get());
        state.next = known.next.moved(moved);
        self.schedule.schedule(Owner::Module(id.slot() as u32), moved(known.at));
        self.detector.note_approach(index.unwrap_or(0), known.next.near(), near, moved(known.at));
        Ok(Followed::Alike)
    }

    /// Keeps the step that a module has made since [`follow_alike`](Self::follow_alike) asked for it, and that goes on at an instant.
    pub(super) fn keep_step(&mut self, id: ModuleId, at: SimTime) {
        let Some(state) = self.world.state(id) else { return };
        let is_plain = matches!(state.next.kind, NextKind::Event | NextKind::Window);
        if let Some(step) = state.trajectories.step().filter(|_| is_plain) {
            self.flows.known_steps.keep(step, &state.next, at);
        }
    }

    /// Notes how a module stands before a step. False if its steps depend on anything else.
    fn stand(&mut self, id: ModuleId, from: SimTime, experience: &Experience) -> bool {
        let tree = &self.world.tree;
        let (Some(state), values) = (self.world.state(id), tree.parameters(id)) else { return false };
        let (Some(index), Some(solve)) = (state.rule.get(), state.solve.get()) else { return false };
        let rule = &self.setup.model.rules[index];
        if values.len() > MOST_PARAMETERS || !reads_nothing_else(state, rule, solve) {
            return false;
        }
        let KnownSteps { readings, now: Standing { hash, words }, .. } = &mut self.flows.known_steps;
        let reading = &mut readings[index][solve];
        if !reading.is_worth() {
            return false;
        }
        let Reading { parameters, time: reads_time, .. } = &*reading;
        words.clear();
        words.push((index as u64) << 32 | solve as u64);
        words.push(tree.kind(id).index() as u64);
        for (parameter, value) in values.iter().enumerate() {
            if parameters & 1 << parameter != 0
                || matches!(state.trajectories.get(parameter), Some(Law::Step(_)))
            {
                words.push(value.to_bits());
            }
        }
        state.marks.signs().iter().for_each(|sign| words.push(*sign as u64));
        words.extend(state.marks.switches().iter().map(|on| u64::from(*on)));
        words.push(state.next.near());
        words.push(from.since(state.since).to_bits());
        words.push(from.since(tree.birth(id)).to_bits());
        experience.note(state.numeric_only, words);
        let [high, low] = from.bits();
        if *reads_time || self.setup.settings.method.is_fixed_step() {
            words.extend([high, low]);
        } else {
            words.push(high >> (f64::MANTISSA_DIGITS - 1));
        }
        let mut hasher = FxHasher::default();
        words.iter().for_each(|word| hasher.write_u64(*word));
        *hash = hasher.finish();
        true
    }
}

/// Whether the steps of a module depend on nothing but itself and the time.
fn reads_nothing_else(state: &State, rule: &Rule, solve: usize) -> bool {
    let programs = [&rule.solves[solve].rates, &rule.sides];
    !state.coupled
        && state.context.context().is_empty()
        && rule.aggregates.is_empty()
        && programs.iter().all(|program| program.stretch().is_infinite())
}
