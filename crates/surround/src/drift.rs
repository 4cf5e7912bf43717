//! The wind that carries gases over a tick, and what they do not pass into: bodies and the rigid ground.
//!
//! Turbulence is evaluated at quarters of a tick, with straight lines in between. Bodies stand at instants so close that none moves by more than a
//! fourth of the layer of air around it from one to the next.

use std::sync::{Arc, OnceLock};

use dlsys_gas::{Vector, Walls};
use dlsys_wind::{Hull, Obstacle, Snapshot, Wind};

use crate::Error;
use crate::weather::Weather;

/// Parts of a tick at whose ends turbulence is evaluated: all stages of steps of a tick are there.
const QUARTERS: usize = 4;
/// Most instants with bodies in a tick, a power of 2.
const MOST_PARTS: usize = 1024;
/// Instants at which the speed of bodies is looked at.
const LOOKS: usize = 4;
/// The way of a body from one instant to the next, and that of a blob relative to it in a step, in parts of the layer of air around it.
const WAY: f64 = 0.25;
const STEP: f64 = 0.5;

/// The wind from one tick to the next.
pub(crate) struct Drift<'a, 'm> {
    weather: Option<&'a Weather<'m>>,
    begin: f64,
    tick: f64,
    free: [Kept<Arc<Snapshot>>; QUARTERS + 1],
    among: Vec<Kept<Instant>>,
    /// Bodies on their way through the tick.
    ways: Vec<Way>,
    /// The height of the ground in m.
    floor: Option<f64>,
    /// A further time at which bodies are known: that of a picture.
    shown: Option<(f64, Vec<Hull>)>,
}

type Kept<T> = OnceLock<Result<T, Error>>;

/// The wind at an instant with bodies in it: at the quarters before and after, and the part of the second one.
struct Instant {
    hulls: Vec<Hull>,
    before: Snapshot,
    after: Option<(Snapshot, f64)>,
}

/// Where a body is during a tick.
struct Way {
    centres: Vec<Vector>,
    /// How near to a centre blobs are made to go in short steps, in m.
    reach: f64,
    level: u8,
}

impl<'a, 'm> Drift<'a, 'm> {
    /// From a time on, for the length of a tick (both in s). A speed `fall` of blobs (m/s) counts beside that of the wind.
    ///
    /// # Errors
    /// The growth of bodies fails.
    pub(crate) fn new(
        weather: Option<&'a Weather<'m>>,
        [begin, tick]: [f64; 2],
        fall: f64,
        floor: Option<f64>,
    ) -> Result<Drift<'a, 'm>, Error> {
        let mut drift = Drift {
            weather,
            begin,
            tick,
            free: Default::default(),
            among: Vec::new(),
            ways: Vec::new(),
            floor,
            shown: None,
        };
        if let Some(weather) = weather.filter(|weather| weather.has_bodies()) {
            drift.look(weather, fall)?;
        }
        Ok(drift)
    }

    /// The same with the bodies of another instant within the tick, in s.
    ///
    /// # Errors
    /// The growth of bodies fails.
    pub(crate) fn showing(mut self, time: f64) -> Result<Drift<'a, 'm>, Error> {
        if let Some(weather) = self.weather.filter(|_| !self.ways.is_empty()) {
            self.shown = Some((time, weather.hulls(time)?));
        }
        Ok(self)
    }

    /// Looks at the bodies of the tick.
    fn look(&mut self, weather: &Weather<'m>, fall: f64) -> Result<(), Error> {
        let mut parts = QUARTERS;
        let times = (0..=LOOKS).map(|k| self.begin + self.tick * (k as f64 / LOOKS as f64));
        let looks = times.map(|time| weather.hulls(time)).collect::<Result<Vec<_>, Error>>()?;
        let free = weather.free(self.begin)?;
        let count = looks.iter().map(Vec::len).max().unwrap_or_default();
        for body in 0..count {
            let seen: Vec<&Hull> = looks.iter().filter_map(|hulls| hulls.get(body)).collect();
            let (mut speed, mut layer, mut radius) = (0.0_f64, f64::INFINITY, 0.0_f64);
            for hull in &seen {
                let (_, reach) = hull.ball();
                speed = speed.max(hull.velocity(0.0).norm() + hull.spin(0.0).norm() * reach);
                (layer, radius) = (layer.min(hull.layer()), radius.max(reach));
            }
            let centres: Vec<Vector> = seen.iter().map(|hull| hull.ball().0).collect();
            // Bodies come and go, and then a number stands for another one.
            speed = centres
                .windows(2)
                .fold(speed, |speed, pair| speed.max((pair[1] - pair[0]).norm() * LOOKS as f64 / self.tick));
            let air = centres.first().map_or(0.0, |centre| free.velocity(*centre).norm()) + fall.abs();
            let halvings = |way: f64| (way.max(1.0).log2().ceil()).min(f64::from(MOST_PARTS.ilog2()));
            parts = parts.max(1 << halvings(speed * self.tick / (WAY * layer)) as usize);
            let level = halvings((speed + air) * self.tick / (STEP * layer)) as u8;
            let reach = radius + layer + (air + speed / LOOKS as f64) * self.tick;
            self.ways.push(Way { centres, reach, level });
        }
        self.among = (0..=parts).map(|_| OnceLock::new()).collect();
        Ok(())
    }

    /// Why the wind had no value, if there was an instant without one.
    pub(crate) fn failure(&self) -> Option<Error> {
        let free = self.free.iter().find_map(|kept| kept.get()?.as_ref().err());
        free.or_else(|| self.among.iter().find_map(|kept| kept.get()?.as_ref().err())).cloned()
    }

    fn time_of(&self, number: usize, parts: usize) -> f64 {
        self.begin + self.tick * (number as f64 / parts as f64)
    }

    fn free(&self, weather: &Weather<'m>, number: usize) -> Result<&Arc<Snapshot>, &Error> {
        let number = number.min(QUARTERS);
        self.free[number].get_or_init(|| weather.free(self.time_of(number, QUARTERS))).as_ref()
    }

    fn among(&self, weather: &Weather<'m>, number: usize) -> Result<&Instant, &Error> {
        let parts = self.among.len() - 1;
        let number = number.min(parts);
        let make = || {
            let hulls = weather.hulls(self.time_of(number, parts))?;
            let place = (number * QUARTERS) as f64 / parts as f64;
            let (quarter, part) = (place as usize, place.fract());
            let with =
                |quarter: usize| weather.among(self.free(weather, quarter).map_err(Clone::clone)?, &hulls);
            let before = with(quarter)?;
            let after = if part > 0.0 { Some((with(quarter + 1)?, part)) } else { None };
            Ok(Instant { hulls, before, after })
        };
        self.among[number].get_or_init(make).as_ref()
    }

    /// The number of the instant at or before a time, of so many parts, and the part of the way to the next one.
    fn place(&self, time: f64, parts: usize) -> (usize, f64) {
        let place = ((time - self.begin) / self.tick * parts as f64).clamp(0.0, parts as f64);
        (place as usize, place.fract())
    }
}

impl Instant {
    fn velocity(&self, point: Vector) -> Vector {
        let before = self.before.velocity(point);
        match &self.after {
            Some((after, part)) => before.lerp(&after.velocity(point), *part),
            None => before,
        }
    }
}

impl Wind for Drift<'_, '_> {
    /// Not a number where the wind has no value; [`failure`](Drift::failure) tells why.
    fn velocity(&self, point: Vector, time: f64) -> Vector {
        let Some(weather) = self.weather else { return Vector::zeros() };
        let has_bodies = !self.ways.is_empty();
        let parts = if has_bodies { self.among.len() - 1 } else { QUARTERS };
        let (number, part) = self.place(time, parts);
        let at = |number: usize| {
            let found = match has_bodies {
                true => self.among(weather, number).map(|instant| instant.velocity(point)),
                false => self.free(weather, number).map(|snapshot| snapshot.velocity(point)),
            };
            found.unwrap_or_else(|_| Vector::repeat(f64::NAN))
        };
        let before = at(number);
        if part == 0.0 { before } else { before.lerp(&at(number + 1), part) }
    }
}

impl Walls for Drift<'_, '_> {
    fn level(&self, place: Vector) -> u8 {
        let near = self.ways.iter().filter(|way| way.is_near(place));
        near.map(|way| way.level).max().unwrap_or_default()
    }

    fn outside(&self, place: Vector, time: f64) -> Vector {
        let mut place = place;
        if let Some(weather) = self.weather.filter(|_| self.ways.iter().any(|way| way.is_near(place))) {
            let out =
                |hulls: &[Hull], place: Vector| hulls.iter().fold(place, |place, hull| hull.outside(place));
            let parts = self.among.len() - 1;
            place = match &self.shown {
                Some((shown, hulls)) if *shown == time => out(hulls, place),
                _ => {
                    let (number, part) = self.place(time, parts);
                    // The nearest one.
                    let number = number + usize::from(part > 0.5);
                    self.among(weather, number).map_or(place, |instant| out(&instant.hulls, place))
                }
            };
        }
        if let Some(floor) = self.floor {
            place.y = place.y.max(floor);
        }
        place
    }
}

impl Way {
    fn is_near(&self, place: Vector) -> bool {
        let near = |centre: &Vector| (place - centre).norm() < self.reach;
        let between = |pair: &[Vector]| {
            let way = pair[1] - pair[0];
            let square = way.norm_squared();
            let part =
                if square > 0.0 { ((place - pair[0]).dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
            near(&(pair[0] + way * part))
        };
        self.centres.iter().any(near) || self.centres.windows(2).any(between)
    }
}
