//! The wind at places of a model, for solvers that ask for a few instants many times.

use std::sync::{Arc, Mutex, PoisonError};

use dlsys_sway as sway;
use dlsys_wind::Snapshot;

use crate::footing::Among;
use crate::weather::Weather;
use crate::{Error, Place};

/// Two times with the wind at each, the later one to be read first.
type Last = Mutex<[Option<(f64, Arc<Snapshot>)>; 2]>;

/// The wind at a place, for a solver that asks for a few instants many times.
pub struct Sampler<'m> {
    weather: Option<Arc<Weather<'m>>>,
    /// The last instants.
    last: Last,
    /// The last times of steps, of which each reads two in turn.
    steps: Last,
    /// The reason why the wind had no value at an instant.
    failure: Mutex<Option<Error>>,
    place: Place,
}

impl<'m> Sampler<'m> {
    /// The wind for a model at a place; without weather the air is still.
    pub fn new(weather: Option<Arc<Weather<'m>>>, place: Place) -> Sampler<'m> {
        let (last, steps, failure) = (Last::default(), Last::default(), Mutex::default());
        Sampler { weather, last, steps, failure, place }
    }

    /// Drops the last instants, which are large.
    pub(crate) fn forget(&self) {
        for last in [&self.last, &self.steps] {
            *last.lock().unwrap_or_else(PoisonError::into_inner) = Default::default();
        }
    }

    /// What is in the way of what falls.
    pub(crate) fn in_the_way(&self) -> Among<'_, 'm> {
        let nothing = Among { obstacles: None, footing: None };
        self.weather.as_ref().map_or(nothing, |weather| weather.in_the_way())
    }

    /// True if the air moves somewhere at some time.
    pub fn blows(&self) -> bool {
        self.weather.is_some()
    }

    /// The reason why the wind had no value, if there was an instant without one: its velocities are not numbers then, and a solver
    /// that depends on them fails.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The wind at an instant, in s; `None` without weather, or if it has no value.
    fn at(&self, time: f64) -> Option<Arc<Snapshot>> {
        self.read(&self.last, time, Weather::at)
    }

    fn read(
        &self,
        last: &Last,
        time: f64,
        read: fn(&Weather<'m>, f64) -> Result<Arc<Snapshot>, Error>,
    ) -> Option<Arc<Snapshot>> {
        let weather = self.weather.as_ref()?;
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = last.iter().flatten().find(|(at, _)| *at == time) {
            return Some(known.clone());
        }
        let new = match read(weather, time) {
            Ok(new) => new,
            Err(error) => {
                *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                return None;
            }
        };
        last.rotate_right(1);
        last[0] = Some((time, new.clone()));
        Some(new)
    }
}

/// The wind in the axes of the scene at instants of a grid, and between them by straight lines: for bodies that fall, each in steps of its own.
/// Turbulence changes little from one instant to the next, and many bodies read the same ones.
pub(crate) struct Gusts<'a, 'm>(pub(crate) &'a Sampler<'m>);

/// Instants in a second. Steps of a flight end at parts of a second that are powers of 2, and the longest ones read the wind at these.
const INSTANTS: f64 = 128.0;

impl sway::Wind for Gusts<'_, '_> {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        let Gusts(sampler) = self;
        if !sampler.blows() {
            return sway::Vector::zeros();
        }
        let at = |instant: f64| match sampler.at(instant / INSTANTS) {
            Some(snapshot) => snapshot.velocity(point),
            None => sway::Vector::repeat(f64::NAN),
        };
        let instant = (time * INSTANTS).floor();
        let part = time * INSTANTS - instant;
        let before = at(instant);
        if part == 0.0 { before } else { before.lerp(&at(instant + 1.0), part) }
    }
}

impl Sampler<'_> {
    fn velocity_in(&self, snapshot: Option<Arc<Snapshot>>, point: sway::Vector) -> sway::Vector {
        match snapshot {
            Some(snapshot) => self.place.turn.transpose() * snapshot.velocity(self.place.point(point)),
            None if self.blows() => sway::Vector::repeat(f64::NAN),
            None => sway::Vector::zeros(),
        }
    }
}

impl sway::Wind for Sampler<'_> {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        self.velocity_in(self.at(time), point)
    }
}

/// The same with turbulence between instants where times are close together, see `between.rs`.
pub(crate) struct Breeze<'a, 'm>(pub(crate) &'a Sampler<'m>);

impl sway::Wind for Breeze<'_, '_> {
    fn velocity(&self, point: sway::Vector, time: f64) -> sway::Vector {
        let Breeze(sampler) = self;
        sampler.velocity_in(sampler.read(&sampler.steps, time, Weather::between), point)
    }
}
