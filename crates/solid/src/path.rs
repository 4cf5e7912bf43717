//! Paths of solids: places as polynomials of time through those at four instants, with bounds of their derivatives.

use crate::{Attitude, Place, Vector};

/// A polynomial of degree 3 through values at [`Path::INSTANTS`], over the parts of a span.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cubic([Vector; 4]);

impl Cubic {
    fn through(values: [Vector; 4]) -> Cubic {
        let [a, b, c, d] = values;
        // What stands is exactly at rest.
        let [b, c, d] = [b - a, c - a, d - a];
        let first = (b * 18.0 - c * 9.0 + d * 2.0) / 2.0;
        let second = (c * 36.0 - b * 45.0 - d * 9.0) / 2.0;
        let third = (b * 27.0 - c * 27.0 + d * 9.0) / 2.0;
        Cubic([a, first, second, third])
    }

    fn value(&self, part: f64) -> Vector {
        let [a, b, c, d] = self.0;
        a + (b + (c + d * part) * part) * part
    }

    fn slope(&self, part: f64) -> Vector {
        let [_, b, c, d] = self.0;
        b + (c * 2.0 + d * (3.0 * part)) * part
    }

    /// Bounds of the first derivative and of the second one between 0 and 1.
    fn bounds(&self) -> [f64; 2] {
        let [_, b, c, d] = self.0;
        let second = (c * 2.0).norm().max((c * 2.0 + d * 6.0).norm());
        // The control points of the first derivative.
        let first = b.norm().max((b + c).norm()).max((b + c * 2.0 + d * 3.0).norm());
        [first, second]
    }

    fn is_constant(&self) -> bool {
        self.0[1..].iter().all(|part| *part == Vector::zeros())
    }
}

/// The path of a solid through a span of time: its origin, and the rotation vector since the beginning, are polynomials of degree 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Where the span begins, and its length, in s.
    begin: f64,
    length: f64,
    centre: Cubic,
    turn: Cubic,
}

impl Path {
    /// The instants of a span at which a path is given, in parts of it.
    pub const INSTANTS: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

    /// Through origins (m) and rotation vectors about the axes of the world (rad) at the instants of a span, whose beginning and length are in s. Motion with
    /// an acceleration that is linear in time is exact.
    pub fn through((begin, length): (f64, f64), origins: [Vector; 4], turns: [Vector; 4]) -> Path {
        Path { begin, length, centre: Cubic::through(origins), turn: Cubic::through(turns) }
    }

    /// Of a solid that stands still.
    pub fn still(span: (f64, f64), origin: Vector) -> Path {
        Path::through(span, [origin; 4], [Vector::zeros(); 4])
    }

    /// Adds ways at the instants, in m.
    pub fn deviate(&mut self, ways: [Vector; 4]) {
        let more = Cubic::through(ways);
        self.centre.0.iter_mut().zip(more.0).for_each(|(here, more)| *here += more);
    }

    /// Where it is at a time in s.
    pub fn place(&self, time: f64) -> Place {
        let part = (time - self.begin) / self.length;
        let (turn, rate) = (self.turn.value(part), self.turn.slope(part) / self.length);
        Place {
            position: self.centre.value(part),
            attitude: Attitude::from_scaled_axis(turn),
            velocity: self.centre.slope(part) / self.length,
            spin: rate + turn.cross(&rate) / 2.0,
        }
    }

    /// True if it stands still from the beginning to the end.
    pub fn is_still(&self) -> bool {
        self.centre.is_constant() && self.turn.is_constant()
    }

    /// Bounds over the span of the speed (m/s) and of the acceleration (m/s²) of all points within a distance from the origin.
    pub fn bounds(&self, distance: f64) -> [f64; 2] {
        let [speed, acceleration] = self.centre.bounds();
        let [turning, change] = self.turn.bounds();
        // The derivatives of a rotation by those of its vector, which the exponential does not enlarge.
        let first = speed + distance * turning;
        let second = acceleration + distance * (change + 2.0 * turning * turning);
        [first / self.length, second / (self.length * self.length)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_and_are_not_far_off() {
        let span = (1.0, 0.25);
        let at = |part: f64| Vector::new(part, part * part - part, 0.3 * part * part * part);
        let turns = Path::INSTANTS.map(|part| Vector::new(0.2, -0.9 * part, 0.4) * part);
        let path = Path::through(span, Path::INSTANTS.map(at), turns);
        let arm = Vector::new(0.3, -0.1, 0.2);
        let [speed, acceleration] = path.bounds(arm.norm());
        let point = |time: f64| {
            let place = path.place(time);
            place.position + place.attitude * arm
        };
        let (mut fastest, mut hardest, h) = (0.0_f64, 0.0_f64, 1e-4);
        for k in 1..2500 {
            let time = 1.0 + f64::from(k) * h;
            let [before, here, after] = [time - h, time, time + h].map(point);
            fastest = fastest.max((after - before).norm() / (2.0 * h));
            hardest = hardest.max((after - here * 2.0 + before).norm() / (h * h));
        }
        assert!(fastest < speed && fastest > 0.3 * speed, "{fastest} {speed}");
        assert!(
            hardest < acceleration * (1.0 + 1e-3) && hardest > 0.2 * acceleration,
            "{hardest} {acceleration}"
        );
        assert!(!path.is_still() && Path::still(span, arm).is_still());
        assert_eq!(Path::still(span, arm).bounds(1.0), [0.0, 0.0]);
    }
}
