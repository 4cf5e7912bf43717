//! The motion of blobs over a tick, in chunks over threads.
//!
//! A blob that has been there for four ticks goes on by the method of Adams and Bashforth of order 4, with one evaluation of the wind at the new place. The
//! corrector of Adams and Moulton at that place gives the error (Milne's device). New blobs, and those whose error is too large, make steps of the
//! pair of Runge-Kutta methods of orders 3 and 2 of Bogacki and Shampine.

use std::sync::{Mutex, PoisonError};

use dlsys_wind::Wind;

use crate::blobs::Blobs;
use crate::walls::Walls;
use crate::{Error, Gas, Settings, Vector};

/// Blobs that a thread takes at a time.
const CHUNK: usize = 2048;

/// A tick.
#[derive(Clone, Copy)]
pub(crate) struct Tick<'a> {
    pub(crate) gas: &'a Gas,
    pub(crate) settings: &'a Settings,
    /// When it begins and ends, in s.
    pub(crate) begin: f64,
    pub(crate) end: f64,
}

/// What changes of a blob.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moving {
    pub(crate) centre: Vector,
    /// At the present time; not a number if it is not known.
    pub(crate) velocity: Vector,
    /// Velocities at the ticks before, the latest first.
    pub(crate) past: [Vector; 3],
    /// How many of them are known.
    pub(crate) known: u8,
    /// Level m of the last step of Runge and Kutta.
    pub(crate) level: u8,
}

impl Moving {
    /// At a place, with no past.
    pub(crate) fn at(centre: Vector) -> Moving {
        Moving { centre, velocity: Vector::repeat(f64::NAN), past: [Vector::zeros(); 3], known: 0, level: 0 }
    }
}

/// Some blobs.
struct Chunk<'a> {
    moving: &'a mut [Moving],
    born: &'a [f64],
    since: &'a [f64],
    variances: &'a [f64],
}

impl Tick<'_> {
    /// Carries all blobs to the end. Each one by itself: their order and the number of threads do not matter.
    pub(crate) fn carry(
        &self,
        blobs: &mut Blobs,
        wind: &(impl Wind + Sync),
        walls: &impl Walls,
    ) -> Result<(), Error> {
        let threads = self.settings.threads.min(blobs.len().div_ceil(CHUNK)).max(1);
        let known =
            blobs.born.chunks(CHUNK).zip(blobs.since.chunks(CHUNK)).zip(blobs.variances.chunks(CHUNK));
        let chunks = blobs.moving.chunks_mut(CHUNK).zip(known);
        let chunks =
            chunks.map(|(moving, ((born, since), variances))| Chunk { moving, born, since, variances });
        let chunks = Mutex::new(chunks.enumerate());
        let work = || {
            let mut failed: Option<(usize, Error)> = None;
            loop {
                let next = chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some((number, chunk)) = next else { return failed };
                // All chunks are tried, so that the error is that of the first blob with one, whichever thread has it.
                if let Err(error) = self.carry_chunk(chunk, (wind, walls)) {
                    failed = failed.or(Some((number, error)));
                }
            }
        };
        let failed = std::thread::scope(|scope| {
            let handles: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
            let own = work();
            let others = handles.into_iter().filter_map(|handle| match handle.join() {
                Ok(failed) => failed,
                Err(panic) => std::panic::resume_unwind(panic),
            });
            own.into_iter().chain(others).min_by_key(|(number, _)| *number)
        });
        failed.map_or(Ok(()), |(_, error)| Err(error))
    }

    fn carry_chunk(&self, chunk: Chunk, around: (&impl Wind, &impl Walls)) -> Result<(), Error> {
        for (blob, moving) in chunk.moving.iter_mut().enumerate() {
            let begin = chunk.born[blob].max(self.begin);
            let age = (begin - chunk.since[blob]).max(0.0);
            let variance = chunk.variances[blob] + 2.0 * self.gas.diffusion * age;
            self.go(moving, begin, self.settings.tolerance * libm::sqrt(variance), around)?;
        }
        Ok(())
    }

    /// The velocity of a blob: that of the air, and its fall.
    fn velocity(&self, place: Vector, time: f64, wind: &impl Wind) -> Vector {
        let mut velocity = wind.velocity(place, time);
        velocity.y -= self.gas.fall;
        velocity
    }

    /// Carries a blob from a time to the end of the tick, with errors of steps below `allowed` (m).
    fn go(
        &self,
        blob: &mut Moving,
        begin: f64,
        allowed: f64,
        (wind, walls): (&impl Wind, &impl Walls),
    ) -> Result<(), Error> {
        let (before, has_past) = (blob.velocity, blob.velocity.x.is_finite());
        let level = walls.level(blob.centre);
        let gone = blob.known == 3 && level == 0 && self.adams(blob, allowed, wind);
        if gone {
            blob.centre = walls.outside(blob.centre, self.end);
        } else {
            blob.level = blob.level.max(level);
            self.runge_kutta(blob, begin, (allowed, level), (wind, walls))?;
        }
        if has_past {
            blob.past = [before, blob.past[0], blob.past[1]];
            blob.known = (blob.known + 1).min(3);
        }
        Ok(())
    }

    /// A step of Adams and Bashforth; false if its error is too large, and nothing is changed.
    fn adams(&self, blob: &mut Moving, allowed: f64, wind: &impl Wind) -> bool {
        let (h, a, [b, c, d]) = (self.end - self.begin, blob.velocity, blob.past);
        let centre = blob.centre + (a * 55.0 - b * 59.0 + c * 37.0 - d * 9.0) * (h / 24.0);
        let velocity = self.velocity(centre, self.end, wind);
        let fourth = velocity - (a + c) * 4.0 + b * 6.0 + d;
        // 251/720 of the fourth difference, which is the fifth derivative of the place.
        let error = fourth.norm() * (h * 251.0 / 720.0);
        let fits = self.settings.fixed || error <= allowed;
        if fits && error.is_finite() {
            (blob.centre, blob.velocity) = (centre, velocity);
            return true;
        }
        false
    }

    /// Steps of Runge and Kutta.
    fn runge_kutta(
        &self,
        blob: &mut Moving,
        begin: f64,
        (allowed, least): (f64, u8),
        (wind, walls): (&impl Wind, &impl Walls),
    ) -> Result<(), Error> {
        let mut time = begin;
        if !blob.velocity.x.is_finite() {
            blob.velocity = self.velocity(blob.centre, time, wind);
        }
        while time < self.end {
            let next = self.grid(time, blob.level);
            let h = next - time;
            let (x, a) = (blob.centre, blob.velocity);
            let b = self.velocity(x + a * (h / 2.0), time + h / 2.0, wind);
            let c = self.velocity(x + b * (0.75 * h), time + 0.75 * h, wind);
            let last = x + (a * 2.0 + b * 3.0 + c * 4.0) * (h / 9.0);
            let velocity = self.velocity(last, next, wind);
            let error = (b * 6.0 + c * 8.0 - a * 5.0 - velocity * 9.0).norm() * (h / 72.0);
            if !error.is_finite() {
                return Err(Error::Wind { time, at: x.into() });
            }
            if !self.settings.fixed {
                if error > allowed && blob.level < self.settings.deepest {
                    blob.level += 1;
                    continue;
                }
                // A step of twice the length has eight times the error. It begins on its own grid.
                if error < allowed / 16.0 && blob.level > least {
                    blob.level -= 1;
                }
            }
            let centre = walls.outside(last, next);
            let velocity = if centre == last { velocity } else { self.velocity(centre, next, wind) };
            (blob.centre, blob.velocity, time) = (centre, velocity, next);
        }
        Ok(())
    }

    /// The end of a step of a level that begins at a time: the next point of the grid of this level, up to the end of the tick.
    fn grid(&self, time: f64, level: u8) -> f64 {
        let h = (self.end - self.begin) / libm::exp2(f64::from(level));
        let passed = libm::floor((time - self.begin) / h) + 1.0;
        let mut next = self.begin + passed * h;
        if next - time < 1e-9 * h {
            next += h;
        }
        if next > time { next.min(self.end) } else { time.next_up() }
    }
}
