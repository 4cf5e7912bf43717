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

    /// A time of the model, given that in the animation.
    fn time(&self, at: f32) -> f64 {
        self.first + f64::from(at) / self.seconds
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
        let frames = keys.iter().zip(kept).map(|(key, i)| self.frame_at(*key, i)).collect();
        Path { keys, frames }
    }

    /// Where it is at a key that was made of a sample, and may have been moved to before that.
    fn frame_at(&self, key: f32, sample: usize) -> Frame {
        let (times, frames) = (&self.phase.times, &self.phase.frames);
        if self.clock.at(times[sample]) <= key {
            return frames[sample];
        }
        let time = self.clock.time(key);
        let Some(before) = times[..sample].iter().rposition(|at| *at <= time) else { return frames[sample] };
        let w = weight(times[before], times[before + 1], time);
        frames[before].between(&frames[before + 1], w)
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
            } else if birth.is_none() {
                // It is seen in the first picture only.
                keys.push((0.0, true));
            }
            keys.push((death.max(from) + APART, false));
        }
        keys
    }

    /// Keys of a track, as seconds and what they are made of. Where they are too near to one another, they are moved back by no more than keys are apart; of those
    /// for which there is no room even so, the first and the last of a jump stay.
    pub(crate) fn keys<K>(&self, wanted: impl Iterator<Item = (f64, K)>) -> (Vec<f32>, Vec<K>) {
        apart(wanted.map(|(time, key)| (self.clock.at(time), key)).collect())
    }
}

/// See [`Moved::keys`]; times in seconds, ascending.
fn apart<K>(all: Vec<(f32, K)>) -> (Vec<f32>, Vec<K>) {
    // Most that a key is moved, with the rounding of times.
    let farthest = |time: f32| 1.001 * APART + 2.0 * f32::EPSILON * time;
    let mut kept: Vec<(f32, K)> = Vec::with_capacity(all.len());
    // Before what the last key kept had to be, and the next one has to be.
    let [mut before, mut limit] = [f32::INFINITY; 2];
    for (time, key) in all.into_iter().rev() {
        let has_room = kept.is_empty() || time - time.min(limit) <= farthest(time) && limit > -APART / 2.0;
        if has_room {
            before = limit;
            kept.push((time.min(limit), key));
        } else if kept.len() > 1
            && let Some(last) = kept.last_mut()
        {
            *last = (time.min(before), key);
        }
        limit = kept.last().map_or(limit, |(time, _)| time - APART);
    }
    kept.reverse();
    if let Some((time, _)) = kept.first_mut() {
        *time = time.max(0.0);
    }
    kept.into_iter().unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds_from_the_first_frame() {
        let clock = Clock::new(2.0, 6.0, 0.5);
        assert_eq!([1.0, 2.0, 3.0, 6.0, 7.0].map(|t| clock.at(t)), [0.0, 0.0, 0.5, 2.0, 2.0]);
        assert_eq!(clock.time(2.0), 6.0);
        assert!(!clock.is_still() && Clock::new(1.0, 1.0, 1.0).is_still());
    }

    #[test]
    fn keys_stay_where_they_are_however_many_there_are() {
        // Five in each half of a millisecond; the last two are one instant, before and after a jump.
        let mut wanted: Vec<(f32, f32)> = (0..10_000).map(|i| (i as f32 * 1e-4, i as f32 * 1e-4)).collect();
        wanted.push((0.9999, 5.0));
        let (times, keys) = apart(wanted);
        assert!(times.len() > 1000 && times[0] < APART);
        // The first one is brought to the beginning.
        assert!(times[1..].windows(2).all(|pair| pair[1] - pair[0] > 0.99 * APART));
        let (last, others) = keys.split_last().expect("keys");
        assert!(
            *last == 5.0
                && others.iter().zip(&times).all(|(wanted, time)| (wanted - time).abs() < 1.01 * APART)
        );
        assert_eq!(
            apart(vec![(0.0, 0), (0.5, 1), (0.5, 2), (0.5, 3)]),
            (vec![0.0, 0.4995, 0.5], vec![0, 1, 3])
        );
        // Where times are half a millisecond apart.
        assert_eq!(apart(vec![(0.0, 0), (5000.0, 1), (5000.0, 2)]).1, vec![0, 1, 2]);
    }
}
