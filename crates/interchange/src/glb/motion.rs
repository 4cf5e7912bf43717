//! The tracks of a node: where it is, how it is turned, which shape it has, and when it is seen.

use crate::life::{Life, Shape};
use crate::part::{Frame, reach};
use crate::thin::{place, thin, weight};
use crate::track::Phase;

use super::buffer::{Buffer, Kind};
use super::document::{Animation, Node};

/// Least time between two keys of a track, in seconds. Blender takes keys that are less than a hundredth of a frame apart for one, and a frame is a 24th of
/// a second where it does not know better.
const APART: f32 = 5e-4;

/// Times of the model as seconds of the animation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    first: f64,
    last: f64,
    seconds: f64,
}

impl Clock {
    pub(super) fn new(first: f64, last: f64, seconds: f64) -> Clock {
        Clock { first, last, seconds }
    }

    /// True if there is one instant only.
    pub(super) fn is_still(&self) -> bool {
        self.last <= self.first
    }

    /// The length of the animation.
    pub(super) fn end(&self) -> f32 {
        self.at(self.last)
    }

    fn at(&self, time: f64) -> f32 {
        ((time.clamp(self.first, self.last) - self.first) * self.seconds) as f32
    }
}

/// A module whose tracks are written.
pub(super) struct Moved<'a> {
    pub(super) phase: &'a Phase,
    pub(super) life: &'a Life,
    pub(super) clock: &'a Clock,
    /// Largest distance of a point from its place, in metres.
    pub(super) tolerance: f64,
}

impl Moved<'_> {
    /// Writes all tracks of a node. False if the module is there for less time than a float can tell.
    pub(super) fn write(
        &self,
        target: usize,
        node: &mut Node,
        animation: &mut Animation,
        buffer: &mut Buffer,
    ) -> bool {
        let size = if let Shape::Stem { size, .. } = self.life.shape { size } else { 1.0 };
        let [birth, death] =
            [self.phase.from, self.phase.to].map(|time| time.map(|time| self.clock.at(time)));
        let birth = birth.filter(|birth| *birth > 0.0);
        if death.is_some_and(|death| death <= birth.unwrap_or(0.0)) && !self.clock.is_still() {
            return false;
        }
        self.place(target, node, animation, buffer);
        self.shape(target, node, animation, buffer);
        self.sight([birth, death], size, (target, node, animation, buffer));
        true
    }

    /// Translation and rotation, with keys in common.
    fn place(&self, target: usize, node: &mut Node, animation: &mut Animation, buffer: &mut Buffer) {
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
        let places: Vec<[f32; 3]> =
            kept.iter().map(|&i| frames[i].origin.coords.map(|x| x as f32).into()).collect();
        let mut turns: Vec<[f32; 4]> = Vec::with_capacity(kept.len());
        for &i in &kept {
            let turn: [f32; 4] = frames[i].turn.coords.map(|x| x as f32).into();
            let dot = |a: &[f32; 4]| a.iter().zip(&turn).map(|(a, b)| a * b).sum::<f32>();
            // Both signs are one turn; the nearer one, so that what is between is the shorter way.
            let is_far = turns.last().is_some_and(|before| dot(before) < 0.0);
            turns.push(if is_far { turn.map(|x| -x) } else { turn });
        }
        node.translation = places.last().copied().filter(|at| *at != [0.0; 3]);
        node.rotation = turns.last().copied().filter(|turn| *turn != [0.0, 0.0, 0.0, 1.0]);
        if keys.len() < 2 || self.clock.is_still() {
            return;
        }
        let input = buffer.times(&keys);
        if places.iter().any(|at| *at != places[0]) {
            let output = buffer.vectors(&places, Kind::Motion);
            animation.add(target, "translation", input, output);
        }
        if turns.iter().any(|turn| *turn != turns[0]) {
            let output = buffer.turns(&turns);
            animation.add(target, "rotation", input, output);
        }
    }

    /// Weights of the shapes, at the ages of the life as far as they are within the animation.
    fn shape(&self, target: usize, node: &mut Node, animation: &mut Animation, buffer: &mut Buffer) {
        let Life { ages, shape, .. } = self.life;
        let (count, weights) = match shape {
            Shape::Still(_) => return,
            Shape::Mixed { shapes, weights, .. } => (shapes.len() - 1, weights),
            Shape::Stem { weights, .. } => (3, weights),
        };
        let at = |age: f64| -> Vec<f32> {
            let (i, w) = place(ages, age);
            let row = |i: usize| &weights[i * count..(i + 1) * count];
            let next = row((i + 1).min(ages.len() - 1));
            row(i).iter().zip(next).map(|(a, b)| a + (b - a) * w as f32).collect()
        };
        let birth = self.phase.birth;
        let [first, last] = [self.clock.first - birth, self.clock.last - birth];
        let end = self.phase.times.last().map_or(last, |last| last - birth);
        node.weights = Some(at(end));
        if self.clock.is_still() || ages.len() < 2 {
            return;
        }
        // Keys beyond the beginning and the end of the animation are brought there.
        let inner = ages.iter().copied().filter(|age| *age > first && *age < last);
        let from = (ages[0] <= first).then_some(first);
        let to = (ages[ages.len() - 1] >= last).then_some(last);
        let kept: Vec<f64> = from.into_iter().chain(inner).chain(to).collect();
        if kept.len() < 2 {
            return;
        }
        let (keys, kept) = self.keys(kept.into_iter().map(|age| (age + birth, age)));
        if keys.len() < 2 {
            return;
        }
        let values: Vec<f32> = kept.iter().flat_map(|age| at(*age)).collect();
        let (input, output) = (buffer.times(&keys), buffer.scalars(&values));
        animation.add(target, "weights", input, output);
    }

    /// A scale of 0 before birth and after death.
    fn sight(
        &self,
        [birth, death]: [Option<f32>; 2],
        size: f32,
        (target, node, animation, buffer): (usize, &mut Node, &mut Animation, &mut Buffer),
    ) {
        let shown = if death.is_some() && !self.clock.is_still() { 0.0 } else { size };
        node.scale = Some([shown; 3]).filter(|scale| *scale != [1.0; 3]);
        if self.clock.is_still() || (birth.is_none() && death.is_none()) {
            return;
        }
        let (mut times, mut scales) = (Vec::new(), Vec::new());
        let mut key = |time: f32, scale: f32| {
            times.push(time);
            scales.push([scale; 3]);
        };
        // It appears before its birth and vanishes after its death, so that there is no hole where it takes the place of another module.
        let end = self.clock.end();
        let mut from = 0.0;
        if let Some(birth) = birth {
            from = birth.max(APART);
            key(from - APART, 0.0);
            key(from, size);
        }
        if let Some(death) = death {
            let death = death.min(end - APART);
            if death >= from + APART {
                key(death, size);
            }
            key(death.max(from) + APART, 0.0);
        }
        let (input, output) = (buffer.times(&times), buffer.vectors(&scales, Kind::Motion));
        animation.add(target, "scale", input, output);
    }

    /// Keys of a track, as seconds and what they are made of. Keys in a row that are too near to one another are moved back; what would be before the
    /// beginning is left out.
    fn keys<K>(&self, wanted: impl Iterator<Item = (f64, K)>) -> (Vec<f32>, Vec<K>) {
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
