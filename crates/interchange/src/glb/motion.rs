//! The tracks of a node: where it is, how it is turned, which shape it has, and when it is seen.

use crate::life::{Life, Shape};
use crate::motion::Moved;
use crate::thin::place;

use super::buffer::{Buffer, Kind};
use super::document::{Animation, Node};

/// What the tracks of a node are written into.
pub(super) struct Tracks<'a> {
    /// The number that the node will have.
    pub(super) target: usize,
    pub(super) node: &'a mut Node,
    pub(super) animation: &'a mut Animation,
    pub(super) buffer: &'a mut Buffer,
    /// The largest coordinate of a node so far, in metres.
    pub(super) farthest: &'a mut f64,
}

impl Tracks<'_> {
    /// Writes all tracks of a node. False if the module is there for less time than a float can tell.
    pub(super) fn write(mut self, moved: &Moved<'_>) -> bool {
        let size = if let Shape::Stem { size, .. } = moved.life.shape { size } else { 1.0 };
        let Some(lifetime) = moved.lifetime() else { return false };
        self.place(moved);
        self.shape(moved);
        self.sight(moved, lifetime, size);
        true
    }

    fn add(&mut self, path: &'static str, input: usize, output: usize) {
        self.animation.add(self.target, path, input, output);
    }

    /// Translation and rotation, with keys in common.
    fn place(&mut self, moved: &Moved<'_>) {
        let path = moved.path();
        let far = path.frames.iter().map(|frame| frame.origin.coords.amax());
        *self.farthest = far.fold(*self.farthest, f64::max);
        let places: Vec<[f32; 3]> =
            path.frames.iter().map(|frame| frame.origin.coords.map(|x| x as f32).into()).collect();
        let mut turns: Vec<[f32; 4]> = Vec::with_capacity(path.frames.len());
        for frame in &path.frames {
            let turn: [f32; 4] = frame.turn.coords.map(|x| x as f32).into();
            let dot = |a: &[f32; 4]| a.iter().zip(&turn).map(|(a, b)| a * b).sum::<f32>();
            // Both signs are one turn; the nearer one, so that what is between is the shorter way.
            let is_far = turns.last().is_some_and(|before| dot(before) < 0.0);
            turns.push(if is_far { turn.map(|x| -x) } else { turn });
        }
        self.node.translation = places.last().copied().filter(|at| *at != [0.0; 3]);
        self.node.rotation = turns.last().copied().filter(|turn| *turn != [0.0, 0.0, 0.0, 1.0]);
        if path.is_still() || moved.clock.is_still() {
            return;
        }
        let input = self.buffer.times(&path.keys);
        if places.iter().any(|at| *at != places[0]) {
            let output = self.buffer.vectors(&places, Kind::Motion);
            self.add("translation", input, output);
        }
        if turns.iter().any(|turn| *turn != turns[0]) {
            let output = self.buffer.turns(&turns);
            self.add("rotation", input, output);
        }
    }

    /// Weights of the shapes, at the ages of the life as far as they are within the animation.
    fn shape(&mut self, moved: &Moved<'_>) {
        let Life { ages, shape, .. } = moved.life;
        let count = shape.targets();
        let weights = match shape {
            Shape::Still(_) => return,
            Shape::Mixed { weights, .. } | Shape::Stem { weights, .. } => weights,
        };
        let at = |age: f64| -> Vec<f32> {
            let (i, w) = place(ages, age);
            let row = |i: usize| &weights[i * count..(i + 1) * count];
            let next = row((i + 1).min(ages.len() - 1));
            row(i).iter().zip(next).map(|(a, b)| a + (b - a) * w as f32).collect()
        };
        let birth = moved.phase.birth;
        let [first, last] = [moved.clock.first - birth, moved.clock.last - birth];
        let end = moved.phase.times.last().map_or(last, |last| last - birth);
        self.node.weights = Some(at(end));
        if moved.clock.is_still() || ages.len() < 2 {
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
        let (keys, kept) = moved.keys(kept.into_iter().map(|age| (age + birth, age)));
        if keys.len() < 2 {
            return;
        }
        let values: Vec<f32> = kept.iter().flat_map(|age| at(*age)).collect();
        let (input, output) = (self.buffer.times(&keys), self.buffer.scalars(&values));
        self.add("weights", input, output);
    }

    /// A scale of 0 before birth and after death.
    fn sight(&mut self, moved: &Moved<'_>, lifetime: [Option<f32>; 2], size: f32) {
        let shown = if lifetime[1].is_some() && !moved.clock.is_still() { 0.0 } else { size };
        self.node.scale = Some([shown; 3]).filter(|scale| *scale != [1.0; 3]);
        let (times, scales): (Vec<f32>, Vec<[f32; 3]>) = moved
            .sight(lifetime)
            .into_iter()
            .map(|(time, seen)| (time, [if seen { size } else { 0.0 }; 3]))
            .unzip();
        if !times.is_empty() {
            let (input, output) = (self.buffer.times(&times), self.buffer.vectors(&scales, Kind::Motion));
            self.add("scale", input, output);
        }
    }
}
