//! The motion of a module in the time of a file: where it is, how it is turned, and when it is seen.

use crate::life::Life;
use crate::part::{Frame, reach};
use crate::thin::{thin, weight};
use crate::track::Phase;

/// Least time between two keys of a track, in seconds. Blender takes keys that are less than a hundredth of a frame apart for one, and a frame is a 24th of
/// a second where it does not know better.
pub(crate) const APART: f32 = 5e-4;

/// Times of the model as seconds of the animation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    pub(crate) first: f64,
    pub(crate) last: f64,
    seconds: f64,
}

impl Clock {
    pub(crate) fn new(first: f64, last: f64, seconds: f64) -> Clock {
        Clock { first, last, seconds }
    }

    /// True if there is one instant only.
    pub(crate) fn is_still(&self) -> bool {
        self.last <= self.first
    }

    /// The length of the animation.
    pub(crate) fn end(&self) -> f32 {
        self.at(self.last)
    }

    /// An instant of the animation; what is before it or after it is brought to its ends.
    pub(crate) fn at(&self, time: f64) -> f32 {
        ((time.clamp(self.first, self.last) - self.first) * self.seconds) as f32
    }
}

/// A module whose motion is written.
pub(crate) struct Moved<'a> {
    pub(crate) phase: &'a Phase,
    pub(crate) life: &'a Life,
    pub(crate) clock: &'a Clock,
    /// Largest distance of a point from its place, in metres.
    pub(crate) tolerance: f64,
}

/// Places with straight ways between them: one, or as many as there are keys.
pub(crate) struct Path {
    /// In seconds, ascending.
    pub(crate) keys: Vec<f32>,
    pub(crate) frames: Vec<Frame>,
}

impl Path {
    /// Whether there is one place only.
    pub(crate) fn is_still(&self) -> bool {
        self.keys.len() < 2
    }
}

impl Moved<'_> {
    /// Its birth and its death in seconds, if they are within the animation. `None` if the module is there for less time than a float can tell.
    pub(crate) fn lifetime(&self) -> Option<[Option<f32>; 2]> {
        let [birth, death] =
            [self.phase.from, self.phase.to].map(|time| time.map(|time| self.clock.at(time)));
        let birth = birth.filter(|birth| *birth > 0.0);
        let is_brief = death.is_some_and(|death| death <= birth.unwrap_or(0.0)) && !self.clock.is_still();
        (!is_brief).then_some([birth, death])
    }

    /// Where it is and how it is turned.
    pub(crate) fn path(&self) -> Path {
        let (times, frames) = (&self.phase.times, &self.phase.frames);
        let reaches: Vec<f64> =
            (0..times.len()).map(|i| reach(&self.phase.form, self.phase.numbers(i))).collect();
        let near = |i: usize, frame: &Frame| frame.distance(&frames[i], reaches[i]) <= self.tolerance;
        let middle = frames[frames.len() / 2];
        let kept = match (0..times.len()).all(|i| near(i, &middle)) {
            true => vec![frames.len() / 2],
            false => thin(times.len(), |i, j| {
                (i + 1..j).all(|k| {
                    let w = weight(times[i], times[j], times[k]);
                    near(k, &frames[i].between(&frames[j], w))
                })
            }),
        };
        let (keys, kept) = self.keys(kept.into_iter().map(|i| (times[i], i)));
        Path { keys, frames: kept.into_iter().map(|i| frames[i]).collect() }
    }

    /// When it begins and ends to be seen: instants, and whether it is seen then, with a linear change between two that differ. Empty if it is seen always.
    pub(crate) fn sight(&self, [birth, death]: [Option<f32>; 2]) -> Vec<(f32, bool)> {
        let mut keys = Vec::new();
        if self.clock.is_still() {
            return keys;
        }
        // It appears before its birth and vanishes after its death, so that there is no hole where it takes the place of another module.
        let end = self.clock.end();
        let mut from = 0.0;
        if let Some(birth) = birth {
            from = birth.max(APART);
            keys.extend([(from - APART, false), (from, true)]);
        }
        if let Some(death) = death {
            let death = death.min(end - APART);
            if death >= from + APART {
                keys.push((death, true));
            }
            keys.push((death.max(from) + APART, false));
        }
        keys
    }

    /// Keys of a track, as seconds and what they are made of. Keys in a row that are too near to one another are moved back; what would be before the
    /// beginning is left out.
    pub(crate) fn keys<K>(&self, wanted: impl Iterator<Item = (f64, K)>) -> (Vec<f32>, Vec<K>) {
        let mut all: Vec<(f32, K)> = wanted.map(|(time, key)| (self.clock.at(time), key)).collect();
        let mut limit = f32::INFINITY;
        for (time, _) in all.iter_mut().rev() {
            *time = time.min(limit);
            limit = *time - APART;
        }
        let first = all.iter().position(|(time, _)| *time > -APART / 2.0).unwrap_or(0);
        all.drain(..first);
        if let Some((time, _)) = all.first_mut() {
            *time = time.max(0.0);
        }
        all.into_iter().unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds_from_the_first_frame() {
        let clock = Clock::new(2.0, 6.0, 0.5);
        assert_eq!([1.0, 2.0, 3.0, 6.0, 7.0].map(|t| clock.at(t)), [0.0, 0.0, 0.5, 2.0, 2.0]);
        assert!(!clock.is_still() && Clock::new(1.0, 1.0, 1.0).is_still());
    }
}
