//! The wind of a tick, from a field that computes whole instants.

use std::sync::OnceLock;

use dlsys_wind::{self as wind, Field, Snapshot, Wind};

use crate::Vector;

/// Parts of a tick at whose ends the field is evaluated: all stages of whole steps and of halves are there.
const PARTS: usize = 8;

/// A [`Field`] from one tick to the next: at instants that are eighths of the tick, each evaluated when it is needed, and by straight lines between
/// them.
pub struct Breeze<'a> {
    field: &'a Field,
    begin: f64,
    tick: f64,
    instants: [OnceLock<Result<Snapshot, wind::Error>>; PARTS + 1],
}

impl<'a> Breeze<'a> {
    /// The wind from a time on, for the length of a tick (both in s).
    pub fn new(field: &'a Field, begin: f64, tick: f64) -> Breeze<'a> {
        Breeze { field, begin, tick, instants: Default::default() }
    }

    /// The wind of the next tick. It keeps the instant that both have.
    pub fn next(self) -> Breeze<'a> {
        let mut next = Breeze::new(self.field, self.begin + self.tick, self.tick);
        let [.., last] = self.instants;
        next.instants[0] = last;
        next
    }

    /// Why the field had no value at an instant, if there was one.
    pub fn failure(&self) -> Option<&wind::Error> {
        self.instants.iter().find_map(|instant| instant.get()?.as_ref().err())
    }

    fn instant(&self, number: usize) -> Option<&Snapshot> {
        let number = number.min(PARTS);
        let time = self.begin + self.tick * (number as f64 / PARTS as f64);
        self.instants[number].get_or_init(|| self.field.at(time)).as_ref().ok()
    }
}

impl Wind for Breeze<'_> {
    /// Not a number where the field has no value; [`failure`](Breeze::failure) tells why.
    fn velocity(&self, point: Vector, time: f64) -> Vector {
        let at = |number: usize| match self.instant(number) {
            Some(snapshot) => snapshot.velocity(point),
            None => Vector::repeat(f64::NAN),
        };
        let place = ((time - self.begin) / self.tick * PARTS as f64).clamp(0.0, PARTS as f64);
        let before = libm::floor(place);
        let part = place - before;
        let first = at(before as usize);
        if part == 0.0 { first } else { first.lerp(&at(before as usize + 1), part) }
    }
}
