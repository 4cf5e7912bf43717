//! The tracks of a node: where it is, how it is turned, which shape it has, and when it is seen.

use crate::life::{Life, Shape};
use crate::part::{Frame, reach};
use crate::thin::{place, thin, weight};
use crate::track::Phase;

use super::buffer::{Buffer, Kind};
use super::document::{Animation, Node};

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
        if death.is_some_and(|death| death <= birth.unwrap_or(0.0)) {
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
        let keys = self.keys(kept.iter().map(|&i| times[i]));
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
        let values: Vec<f32> = kept.iter().flat_map(|age| at(*age)).collect();
        let keys = self.keys(kept.iter().map(|age| age + birth));
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
        if let Some(birth) = birth {
            key(birth.next_down(), 0.0);
            key(birth, size);
        }
        if let Some(death) = death {
            // Where death is the next float after birth, that one key is both.
            if death.next_down() > birth.unwrap_or(-1.0) {
                key(death.next_down(), size);
            }
            key(death, 0.0);
        }
        let (input, output) = (buffer.times(&times), buffer.vectors(&scales, Kind::Motion));
        animation.add(target, "scale", input, output);
    }

    /// Times of keys in seconds, each later than the one before.
    fn keys(&self, times: impl Iterator<Item = f64>) -> Vec<f32> {
        let mut keys: Vec<f32> = Vec::new();
        for time in times {
            let key = self.clock.at(time);
            keys.push(keys.last().map_or(key, |last| key.max(last.next_up())));
        }
        keys
    }
}
