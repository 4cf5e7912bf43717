//! The first instant at which a body touches a solid on its path, by bounds that nothing can pass.
//!
//! Conservative advancement with the separating axis (Mirtich, *Impulse-based dynamic simulation of rigid body systems*, 1996): between two instants, points
//! of both go on along the axis of their nearest pair with their present velocities, up to half a bound of their accelerations times the square of the time. So
//! they cannot meet before an instant that follows from that, whatever their speed; there the axis is found again.

use dlsys_solid::Meeting;

use crate::fall::Rules;
use crate::pairs::at;
use crate::step::Step;
use crate::{Motion, Span, Vector};

/// Most instants in a step at which an axis is found. Behind the last one comes another step.
const INSTANTS: usize = 400;

/// What a body meets in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Touch {
    /// Nothing.
    Nothing,
    /// A solid, at a time.
    At(f64),
    /// Nothing before a time at which the search has ended.
    Until(f64),
}

/// A part of a body, or of a solid, at an instant: places of the points of its core, and their velocities.
pub(crate) struct Front {
    pub(crate) points: Vec<Vector>,
    pub(crate) velocities: Vec<Vector>,
}

impl Front {
    /// Of points in the axes of a body.
    fn of_body(motion: &Motion, core: &[Vector]) -> Front {
        let points: Vec<Vector> = core.iter().map(|point| motion.point(*point)).collect();
        let spin = motion.world_spin();
        let velocity = |point: &Vector| motion.velocity + spin.cross(&(point - motion.position));
        Front { velocities: points.iter().map(velocity).collect(), points }
    }

    /// The extreme value along an axis after a time, with its present value and its rate.
    fn extreme(&self, axis: &Vector, after: f64) -> [f64; 3] {
        let along = |(point, velocity): (&Vector, &Vector)| {
            let (value, rate) = (axis.dot(point), axis.dot(velocity));
            [value + rate * after, value, rate]
        };
        let all = self.points.iter().zip(&self.velocities).map(along);
        all.min_by(|a, b| a[0].total_cmp(&b[0])).unwrap_or([f64::INFINITY, f64::INFINITY, 0.0])
    }
}

impl Rules {
    /// What the body meets first in a step: where it gets deeper than `depth` into one of these solids. `sunk` counts from the depth that it has at the beginning
    /// of the step, if it has any.
    pub(crate) fn first_touch(
        &self,
        step: &Step,
        (span, near): (&Span, &[usize]),
        (depth, sunk): (f64, bool),
    ) -> Touch {
        let mut first = Touch::Nothing;
        let bend = step.curvature(self.body.reach());
        for &index in near {
            let bend = bend + span.swept(index).acceleration;
            let solid = &span.solids()[index];
            for shape in solid.parts.iter() {
                for part in &self.parts {
                    let until = match first {
                        Touch::Nothing => step.end,
                        Touch::At(time) | Touch::Until(time) => time,
                    };
                    let place = |time: f64| {
                        let place = solid.path.place(time);
                        let points = at(&place, shape);
                        let velocity = |point: &Vector| place.velocity_at(&(point - place.position));
                        Front { velocities: points.iter().map(velocity).collect(), points }
                    };
                    let width = self.distance(part, shape);
                    let found = pass_by(step, part.core(), (width, &place), (bend, until), (depth, sunk));
                    if found != Touch::Nothing {
                        first = found;
                    }
                }
            }
        }
        first
    }
}

/// When points of the body (in its axes) first come nearer than a width to points that move, up to a time.
pub(crate) fn pass_by(
    step: &Step,
    core: &[Vector],
    (mut width, other): (f64, &dyn Fn(f64) -> Front),
    (bend, until): (f64, f64),
    (depth, sunk): (f64, bool),
) -> Touch {
    let mut time = step.start;
    for instant in 0..INSTANTS {
        let own = Front::of_body(&step.at(time), core);
        let other = other(time);
        let way = Meeting::of(&own.points, &other.points).way;
        let distance = way.norm();
        if instant == 0 && sunk {
            width = width.min(distance);
            // Nearly as deep as the cores: it cannot get deeper.
            if width <= depth {
                return Touch::Nothing;
            }
        }
        if distance - width < -0.5 * depth || distance == 0.0 {
            return Touch::At(time);
        }
        let axis = way / distance;
        let left = until - time;
        let clear = clear_time([&own, &other], &axis, (width - 0.75 * depth, 0.05 * depth), (bend, left));
        if clear >= left {
            return Touch::Nothing;
        }
        time += clear;
    }
    Touch::Until(time)
}

/// The time for which two fronts surely stay apart by a width along an axis, up to an error of it; at most `left`.
fn clear_time(
    [own, other]: [&Front; 2],
    axis: &Vector,
    (width, error): (f64, f64),
    (bend, left): (f64, f64),
) -> f64 {
    let mut after = left;
    // The margin is a concave function: each pair of points gives a time not before the one at which it is used up.
    for _ in 0..40 {
        let [low, from, rate] = own.extreme(axis, after);
        let [high, to, speed] = other.extreme(&-axis, after);
        if low + high - 0.5 * bend * after * after >= width - error {
            return after;
        }
        let (gap, opening) = ((from + to - width).max(0.0), rate + speed);
        let root = libm::sqrt(opening * opening + 2.0 * bend * gap);
        // The positive root of gap + opening x - bend x²/2, without differences of what is nearly equal.
        let next = if opening > 0.0 { (opening + root) / bend } else { 2.0 * gap / (root - opening) };
        if next.is_nan() || next >= after {
            return after;
        }
        after = next;
    }
    // Whatever the pair: a bound that needs no search.
    let [_, from, _] = own.extreme(axis, 0.0);
    let [_, to, _] = other.extreme(&-axis, 0.0);
    let gap = (from + to - width).max(0.0);
    let fastest = |front: &Front| front.velocities.iter().map(Vector::norm).fold(0.0, f64::max);
    let speed = fastest(own) + fastest(other);
    (2.0 * gap / (speed + libm::sqrt(speed * speed + 2.0 * bend * gap))).min(after)
}
