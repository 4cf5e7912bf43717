//! Orbits: the curves on which lives with one autonomous equation run.
//!
//! Where the rate of the only integrated parameter reads that parameter and nothing else that moves, neither `t` nor `age`, two solutions that have one
//! value have one future (uniqueness of solutions: Hairer, Nørsett and Wanner 1993, section I.7). So lives that begin with different values run along
//! one curve from different points on, and its steps, with the events that were found in them, serve them all: a life from a value in the middle
//! of a step takes the rest of that.
//!
//! The point where a life begins is found by the step's dense output, and its error adds to that of the life. So steps are made anew and more
//! accurately, once a second life comes by with another value; and a life begins only where the rate is not much smaller than later in the
//! step, or at its start, because that error grows as rates do.
//!
//! Which steps are kept is a matter of what came before. Modules with one rule and one value take the same step at one instant all the same, so that
//! their events are one instant; those of a kind with several rules have no orbits, because a module under another rule would take another step.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::flow::independent::Made;
use crate::flow::integrator::CERTAINTY;
use crate::world::state::{Next, NextKind, Step};
use dlsys_ode::Dense;
use dlsys_tree::SimTime;

/// So many orbits are kept, by hash.
const PLACES: usize = 256;
/// So many steps are kept of one orbit.
const MOST_PIECES: usize = 64;
/// The rest of a step is taken if it is at least this part of it.
const LEAST_REST: f64 = 1e-6;
/// How many times as fast a value may change later in a step as where a life begins.
const MOST_SPEED_UP: f64 = 2.0;
/// The part of the tolerance with which steps are made that lives of many values take.
const SHARED_TOLERANCE: f64 = 0.1;
/// Points of a step at which a life may begin are found to this part of it.
const PARTS: u32 = 8;
/// An event that is nearer than so many resolutions of time is not taken from an orbit.
const APART: f64 = 16.0;

/// A step along an orbit.
#[derive(Debug)]
struct Piece {
    /// The values between which lives may begin: the end is not one of them.
    from: f64,
    to: f64,
    /// A life may begin with this value, too: that of the start of the step.
    start: f64,
    made: Made,
    /// The error at the end that the step has added, relative.
    added: f64,
    next: Next,
    /// The time of the entry in the schedule.
    at: SimTime,
}

/// Steps under equations and conditions, with all that they read and that rests.
#[derive(Clone, Debug, Default)]
struct Orbit {
    standing: Vec<u64>,
    pieces: Vec<Arc<Piece>>,
    /// Lives with different values have come by.
    is_shared: bool,
    now: Answers,
}

/// What has been found at one instant, by value: modules that are alike take the same step then, whatever others have added in between.
#[derive(Clone, Debug, Default)]
struct Answers {
    instant: [u64; 2],
    /// The part of the tolerance for a step of their own.
    pieces: FxHashMap<u64, Result<Arc<Piece>, f64>>,
}

impl Answers {
    /// Those at an instant.
    fn at(&mut self, instant: SimTime) -> &mut FxHashMap<u64, Result<Arc<Piece>, f64>> {
        if self.instant != instant.bits() {
            self.instant = instant.bits();
            self.pieces.clear();
        }
        &mut self.pieces
    }
}

impl Orbit {
    /// Becomes that of other equations.
    fn begin(&mut self, standing: &[u64]) {
        self.standing.clear();
        self.standing.extend_from_slice(standing);
        self.pieces.clear();
        self.now.pieces.clear();
        self.is_shared = false;
    }

    /// The part of the tolerance with which a module makes a step of its own.
    fn accuracy(&self) -> f64 {
        if self.is_shared { SHARED_TOLERANCE } else { 1.0 }
    }

    /// The longest piece that leads on from a value.
    fn longest(&self, x: f64) -> Option<&Arc<Piece>> {
        let (mut longest, mut leads) = (None, 0.0);
        for piece in &self.pieces {
            let rest = piece.leads(x);
            if rest > leads {
                (longest, leads) = (Some(piece), rest);
            }
        }
        longest
    }
}

/// Orbits, by the hash of what they depend on. One takes the place of another of the same hash.
#[derive(Clone, Debug, Default)]
pub struct Orbits {
    /// Empty before the first is known.
    places: Vec<Orbit>,
}

/// The step that a life takes.
pub struct Onward {
    pub made: Made,
    pub next: Next,
    pub at: SimTime,
}

impl Piece {
    /// True for the value of its start, but for what rounding does to the end of the step before.
    fn starts_at(&self, x: f64) -> bool {
        (x - self.start).abs() <= 4.0 * f64::EPSILON * self.start.abs()
    }

    /// How far it leads from a value on; 0 if it does not.
    fn leads(&self, x: f64) -> f64 {
        let within = self.starts_at(x) || (x - self.from) * (self.to - x) > 0.0 || x == self.from;
        let rest = (self.to - x).abs();
        if within && rest > LEAST_REST * (self.to - self.start).abs() { rest } else { 0.0 }
    }

    /// The step from a value on, which a module with this error has at an instant.
    fn onward(&self, x: f64, module: Traveller) -> Option<Onward> {
        let Traveller { from, error, tolerance } = module;
        let known = &self.made.dense;
        let (mut dense, before) = match self.starts_at(x) {
            true if x != self.start => (known.rest(0.0, from, x), 0.0),
            true => {
                let mut dense = known.clone();
                dense.start = from;
                dense.end = if from == known.start { known.end } else { from.after(dense.h) };
                (dense, 0.0)
            }
            false => {
                let position = known.position_of(0, x);
                (known.rest(position, from, x), position * known.h)
            }
        };
        // Steps from one value at one instant are the same to the last bit.
        let moved = |time: SimTime| match from == known.start && before == 0.0 {
            true => time,
            false => from.after(time.since(known.start) - before),
        };
        let at = if self.at == known.end { dense.end } else { moved(self.at) };
        if at.since(from) <= APART * at.resolution() {
            return None;
        }
        let mut control = self.made.control;
        control.error = (error + self.added).min(CERTAINTY * tolerance);
        dense.error += control.error - self.made.control.error;
        let Made { number, hurdle, .. } = self.made;
        Some(Onward { made: Made { dense, control, number, hurdle }, next: self.next.moved(moved), at })
    }
}

impl Orbits {
    fn place(hash: u64) -> usize {
        (hash >> (u64::BITS - PLACES.ilog2())) as usize
    }

    /// The step of a module with a value under equations and conditions with this standing and hash; or the part of the tolerance
    /// with which it has to make one of its own.
    pub fn find(
        &mut self,
        (hash, standing): (u64, &[u64]),
        x: f64,
        module: Traveller,
    ) -> Result<Onward, f64> {
        let orbit = self.places.get_mut(Orbits::place(hash)).filter(|orbit| orbit.standing == standing);
        let Some(orbit) = orbit else { return Err(1.0) };
        if let Some(answer) = orbit.now.at(module.from).get(&x.to_bits()) {
            return match answer {
                Ok(piece) => piece.onward(x, module).ok_or(1.0),
                Err(accuracy) => Err(*accuracy),
            };
        }
        let piece = orbit.longest(x).cloned();
        let begins_within = piece.as_ref().is_some_and(|piece| !piece.starts_at(x));
        if begins_within && !orbit.is_shared {
            orbit.pieces.clear();
            orbit.is_shared = true;
        } else if let Some(piece) = piece
            && let Some(onward) = piece.onward(x, module)
        {
            orbit.now.pieces.insert(x.to_bits(), Ok(piece));
            return Ok(onward);
        }
        let accuracy = orbit.accuracy();
        orbit.now.pieces.insert(x.to_bits(), Err(accuracy));
        Err(accuracy)
    }

    /// Notes that modules with a value have a step from elsewhere at an instant.
    pub fn note_own(&mut self, (hash, standing): (u64, &[u64]), x: f64, from: SimTime) {
        let orbit = self.places.get_mut(Orbits::place(hash)).filter(|orbit| orbit.standing == standing);
        if let Some(orbit) = orbit {
            orbit.now.at(from).entry(x.to_bits()).or_insert(Err(1.0));
        }
    }

    /// Keeps the step of a module, which had an error before it, if others can take it.
    pub fn keep(
        &mut self,
        (hash, standing): (u64, &[u64]),
        step: &Step,
        (next, at): (&Next, SimTime),
        error: f64,
    ) {
        let is_plain = matches!(next.kind, NextKind::Event | NextKind::Window);
        let Some(from) = begins(&step.dense) else { return };
        if !is_plain || !next.changes().is_empty() || next.near() != 0 {
            return;
        }
        if self.places.is_empty() {
            self.places.resize(PLACES, Orbit::default());
        }
        let orbit = &mut self.places[Orbits::place(hash)];
        if orbit.standing != standing {
            orbit.begin(standing);
        }
        if orbit.pieces.len() == MOST_PIECES {
            return;
        }
        let Step { dense, control, number, hurdle, .. } = step;
        let made = Made { dense: dense.clone(), control: *control, number: *number, hurdle: *hurdle };
        let end = if next.kind == NextKind::Event { dense.position(at) } else { 1.0 };
        let (start, to) = (dense.value_or_end(0, 0.0), dense.value_or_end(0, end));
        let added = (control.error - error).max(0.0);
        let piece = Arc::new(Piece { from, to, start, made, added, next: next.clone(), at });
        orbit.now.at(dense.start).insert(start.to_bits(), Ok(piece.clone()));
        orbit.pieces.push(piece);
    }
}

/// What the step of a module depends on besides its value: the instant, and the error of the value so far.
#[derive(Clone, Copy, Debug)]
pub struct Traveller {
    pub from: SimTime,
    pub error: f64,
    pub tolerance: f64,
}

/// The first value of a step at which another life may begin; None if there is none: the step must lead one way all along.
fn begins(dense: &Dense) -> Option<f64> {
    if dense.components() != 1 || !dense.misfits.is_empty() {
        return None;
    }
    let [first, .., last] = dense.of(0) else { return None };
    let rises = last > first;
    if !dense.of(0).windows(2).all(|pair| (pair[1] > pair[0]) == rises && pair[1] != pair[0]) {
        return None;
    }
    (0..PARTS).map(|part| f64::from(part) / f64::from(PARTS)).find_map(|position| {
        let x = dense.value_or_end(0, position);
        let rest = dense.rest(position, dense.start, x);
        let mut speeds = rest.of(0).windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let speed = speeds.next()?;
        speeds.all(|later| later <= MOST_SPEED_UP * speed).then_some(x)
    })
}
