//! Modules that are integrated alone and alike: those of one kind that stand with the same values under the same equations, and read
//! nothing else. One step, and one search of it, is made for the first of them; the others follow it, at the same instant or later.
//!
//! Divisions into equals make them, a tree whose branches are alike, and organs that all begin with the same values: their lives are one
//! life at many times. What has been found for a step is kept by all that it depends on ([`Standing`]), as long as no other step takes its place.
//!
//! Times are kept as durations since the start of the step, so a follower is exactly where it would be if its own step had been made,
//! but for the rounding of times. What the resolution of time decides (which events are one instant) changes with its size; so an instant
//! counts by its power of two even where equations read no time.
//!
//! Modules with one autonomous equation need not even have one value: see [`orbits`](crate::flow::orbits).

use std::hash::Hasher;
use std::sync::Arc;

use rustc_hash::FxHasher;

use crate::error::Error;
use crate::flow::FlowStage;
use crate::flow::independent::{Experience, Made};
use crate::flow::orbits::{Onward, Orbits, Traveller};
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
/// of so many. Where all lives differ, noting how a module stands, and keeping its step, takes as long as some evaluations of its rates.
const PERIOD: u32 = 1024;
/// Modules with more parameters are none for which steps are kept: those may be large.
const MOST_PARAMETERS: usize = 32;

/// All that a step, and what is found in it, depends on, as words, first what does not move; and a hash of them.
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
    orbits: Orbits,
    /// What its orbit depends on, if it has one.
    orbit: Option<Rests>,
}

/// What an orbit depends on: the first words of a [`Standing`], and their hash; and the error of the module before its step.
#[derive(Clone, Copy, Debug)]
struct Rests {
    hash: u64,
    words: usize,
    error: f64,
}

/// What the equations and conditions of a rule read under a clause: the module's own parameters, one bit each, and whether they read the time.
#[derive(Clone, Copy, Debug)]
struct Reading {
    parameters: u32,
    time: bool,
    age: bool,
    /// It may have orbits: it is the only rule of its kind.
    is_only: bool,
    /// Steps in a row that no other had been like, nor on one orbit with.
    misses: u32,
    /// The instant at which modules that may have orbits were counted last, and whether their steps are looked for then.
    counted: ([u64; 2], bool),
}

impl Reading {
    /// Counts a step at an instant. False for one that is not worth being looked for.
    fn is_worth(&mut self, at: SimTime, may_have_orbit: bool) -> bool {
        self.misses = self.misses.checked_add(1).unwrap_or(MANY_MISSES);
        let is_worth = self.misses < MANY_MISSES || self.misses % PERIOD < SAMPLE;
        if !may_have_orbit {
            return is_worth;
        }
        // Those that are alike at one instant go on alike: all of them by their orbit, or none.
        if self.counted.0 != at.bits() {
            self.counted = (at.bits(), is_worth);
        }
        self.counted.1
    }
}

impl KnownSteps {
    pub fn new(model: &Model) -> KnownSteps {
        let several = model.kinds.iter().map(|(_, kind)| &kind.rules).filter(|rules| rules.len() > 1);
        let mut is_only = vec![true; model.rules.len()];
        several.flatten().for_each(|rule| is_only[*rule] = false);
        let reading = |(rule, is_only): (&Rule, bool), solve: &Solve| {
            let both = [&solve.rates, &rule.sides].into_iter().flat_map(|program| program.reads());
            let own = both.clone().filter(|variable| **variable < rule.parameters.len().min(MOST_PARAMETERS));
            let parameters = own.fold(0, |all, parameter| all | 1 << parameter);
            let reads = |clock: usize| both.clone().any(|variable| *variable == rule.time_variable() + clock);
            Reading {
                parameters,
                time: reads(0),
                age: reads(1),
                is_only,
                misses: 0,
                counted: ([u64::MAX; 2], false),
            }
        };
        let readings = (model.rules.iter().zip(is_only))
            .map(|(rule, only)| rule.solves.iter().map(|solve| reading((rule, only), solve)).collect())
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

    /// Notes that a step has been found for the present module.
    fn note_hit(&mut self) {
        let clause = self.now.words[0];
        self.readings[(clause >> 32) as usize][clause as u32 as usize].misses = 0;
    }

    /// Notes that modules that are like the present one, which has a value, do not run along its orbit at an instant.
    fn note_own(&mut self, x: f64, from: SimTime) {
        let KnownSteps { orbits, orbit, now, .. } = self;
        if let Some(Rests { hash, words, .. }) = *orbit {
            orbits.note_own((hash, &now.words[..words]), x, from);
        }
    }

    /// Hashes all that the present module's step depends on.
    fn hash_all(&mut self) {
        let Standing { hash, words } = &mut self.now;
        *hash = hash_of(words);
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

fn hash_of(words: &[u64]) -> u64 {
    let mut hasher = FxHasher::default();
    words.iter().for_each(|word| hasher.write_u64(*word));
    hasher.finish()
}

/// How a module goes on.
pub(super) enum Followed {
    /// By the step of one that stood like it.
    Alike,
    /// By a step of its own, which may be worth being kept, with a part of the tolerance.
    Alone { is_kept: bool, accuracy: f64 },
}

impl FlowStage<'_, '_> {
    /// Makes the step of a module that stood like this one, with what was found in it, its own, if there is one.
    pub(super) fn follow_alike(
        &mut self,
        id: ModuleId,
        from: SimTime,
        experience: &Experience,
    ) -> Result<Followed, Error> {
        let Some(orbit) = self.stand(id, from, experience) else {
            return Ok(Followed::Alone { is_kept: false, accuracy: 1.0 });
        };
        self.stand_exactly(id, from, experience);
        let Some(known) = self.flows.known_steps.get() else {
            let Some(x) = orbit else { return Ok(Followed::Alone { is_kept: true, accuracy: 1.0 }) };
            return match self.along_orbit(x, from) {
                Ok(onward) => {
                    self.flows.known_steps.note_hit();
                    self.follow(id, from, onward).map(|()| Followed::Alike)
                }
                Err(accuracy) => Ok(Followed::Alone { is_kept: true, accuracy }),
            };
        };
        self.flows.known_steps.note_hit();
        if let Some(x) = orbit {
            self.flows.known_steps.note_own(x, from);
        }
        // Steps of one standing at one instant are the same to the last bit.
        let start = known.made.dense.start;
        let moved = |time: SimTime| if from == start { time } else { from.after(time.since(start)) };
        let mut made = known.made.clone();
        (made.dense.start, made.dense.end) = (from, moved(made.dense.end));
        let (next, at) = (known.next.moved(moved), moved(known.at));
        self.follow(id, from, Onward { made, next, at })?;
        Ok(Followed::Alike)
    }

    /// Gives a module a step that is known, with what was found in it.
    fn follow(&mut self, id: ModuleId, from: SimTime, onward: Onward) -> Result<(), Error> {
        let Onward { made, next, at } = onward;
        self.take_step(id, from, made)?;
        let state = self.world.state_mut(id).expect("has a step");
        let (near, before, index) = (next.near(), state.next.near(), state.rule.get());
        state.next = next;
        self.schedule.schedule(Owner::Module(id.slot() as u32), at);
        self.detector.note_approach(index.unwrap_or(0), near, before, at);
        Ok(())
    }

    /// The step along the orbit on which a module stands; or the part of the tolerance with which it has to make its own.
    fn along_orbit(&mut self, x: f64, from: SimTime) -> Result<Onward, f64> {
        let KnownSteps { orbits, orbit, now, .. } = &mut self.flows.known_steps;
        let Rests { hash, words, error } = orbit.ok_or(1.0)?;
        let traveller = Traveller { from, error, tolerance: self.setup.settings.tolerance };
        orbits.find((hash, &now.words[..words]), x, traveller)
    }

    /// Keeps the step that a module has made since [`follow_alike`](Self::follow_alike) asked for it, and that goes on at an instant.
    pub(super) fn keep_step(&mut self, id: ModuleId, at: SimTime) {
        let Some(state) = self.world.state(id) else { return };
        let is_plain = matches!(state.next.kind, NextKind::Event | NextKind::Window);
        let Some(step) = state.trajectories.step().filter(|_| is_plain) else { return };
        let KnownSteps { orbits, orbit, now, .. } = &mut self.flows.known_steps;
        if let Some(Rests { hash, words, error }) = *orbit {
            orbits.keep((hash, &now.words[..words]), step, (&state.next, at), error);
        }
        self.flows.known_steps.keep(step, &state.next, at);
    }

    /// Notes how a module stands before a step, as far as it rests. None if its steps depend on anything else; then the value of its only
    /// integrated parameter, if all that its step reads and that moves is this.
    fn stand(&mut self, id: ModuleId, from: SimTime, experience: &Experience) -> Option<Option<f64>> {
        let tree = &self.world.tree;
        let (state, values) = (self.world.state(id)?, tree.parameters(id));
        let (index, solve) = (state.rule.get()?, state.solve.get()?);
        let rule = &self.setup.model.rules[index];
        if values.len() > MOST_PARAMETERS || !reads_nothing_else(state, rule, solve) {
            return None;
        }
        let KnownSteps { readings, now: Standing { words, .. }, orbit, .. } = &mut self.flows.known_steps;
        let reading = &mut readings[index][solve];
        let is_timed = reading.time || self.setup.settings.method.is_fixed_step();
        let may_have_orbit = reading.is_only && !is_timed && !reading.age && state.next.near() == 0;
        if !reading.is_worth(from, may_have_orbit) {
            return None;
        }
        let Reading { parameters, .. } = &*reading;
        words.clear();
        words.push((index as u64) << 32 | solve as u64);
        words.push((tree.kind(id).index() as u64) << 1 | u64::from(state.numeric_only));
        let [high, _] = from.bits();
        words.push(high >> (f64::MANTISSA_DIGITS - 1));
        let (mut moving, mut others) = (None, !may_have_orbit);
        for (parameter, value) in values.iter().enumerate() {
            match state.trajectories.get(parameter) {
                None | Some(Law::Rest) if parameters & 1 << parameter != 0 => words.push(value.to_bits()),
                None | Some(Law::Rest) => {}
                Some(Law::Step(_)) if moving.is_none() => moving = Some(*value),
                Some(_) => others = true,
            }
        }
        words.extend(state.marks.signs().iter().map(|sign| *sign as u64));
        words.extend(state.marks.switches().iter().map(|on| u64::from(*on)));
        let x = moving.filter(|_| !others);
        let (words, error) = (&words[..], experience.control.error);
        *orbit = x.map(|_| Rests { hash: hash_of(words), words: words.len(), error });
        Some(x)
    }

    /// Adds what moves.
    fn stand_exactly(&mut self, id: ModuleId, from: SimTime, experience: &Experience) {
        let tree = &self.world.tree;
        let state = self.world.state(id).expect("it stands");
        let KnownSteps { readings, now: Standing { words, .. }, .. } = &mut self.flows.known_steps;
        let clause = words[0];
        let Reading { parameters, time, .. } = readings[(clause >> 32) as usize][clause as u32 as usize];
        for (parameter, value) in tree.parameters(id).iter().enumerate() {
            match state.trajectories.get(parameter) {
                None | Some(Law::Rest) => {}
                Some(Law::Step(_)) => words.push(value.to_bits()),
                Some(_) if parameters & 1 << parameter != 0 => words.push(value.to_bits()),
                Some(_) => {}
            }
        }
        words.push(state.next.near());
        words.push(from.since(state.since).to_bits());
        words.push(from.since(tree.birth(id)).to_bits());
        experience.note(words);
        if time || self.setup.settings.method.is_fixed_step() {
            words.extend(from.bits());
        }
        self.flows.known_steps.hash_all();
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
