//! Where the turtle looks: heading, left and up, turned without drift.
//!
//! A string turns its turtle millions of times, mostly to and fro about one axis. Consecutive turns about
//! the same axis are therefore kept as one angle in degrees, reduced modulo 360, and applied only when
//! another axis comes; for angles that are multiples of a binary fraction (45, 137.5, 1) that sum is exact,
//! and so a plane curve is as good after a million turns as after one.
//!
//! Turns about changing axes are applied in twice the usual precision ([`Twofold`]).

use super::twofold::Twofold;
use crate::scene::{Vector, reduced, sin_cos_degrees};

/// An axis of the turtle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Heading,
    Left,
    Up,
}

/// Three orthonormal vectors, `heading × left = up`, and a turn yet to be applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    heading: Twofold,
    left: Twofold,
    up: Twofold,
    axis: Axis,
    /// Degrees about `axis`, in (-360, 360).
    pending: f64,
    /// The two vectors that the pending turn moves, once they have been computed: branches often begin with
    /// the same turn, and a turn is by far the most expensive part of a step.
    turned: Option<[Twofold; 2]>,
}

/// Turns that a walk has made, with their results: a plane figure has few directions, to which it comes back again and again.
#[derive(Default)]
pub(super) struct Turns {
    known: [Option<(Turn, [Twofold; 2])>; 1 << Turns::BITS],
}

#[derive(Clone, Copy, PartialEq)]
struct Turn {
    axis: Axis,
    degrees: f64,
    moved: [Twofold; 2],
}

impl Turns {
    const BITS: u32 = 4;

    /// Where a turn by so many degrees is kept (Fibonacci hashing).
    fn place(degrees: f64) -> usize {
        (degrees.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - Turns::BITS)) as usize
    }
}

impl Frame {
    /// Looking up (`+Y`), with the front view's viewer (`+Z`) above.
    pub(super) fn upright() -> Frame {
        Frame::looking(Vector::y(), -Vector::x(), Vector::z())
    }

    fn looking(heading: Vector, left: Vector, up: Vector) -> Frame {
        let [heading, left, up] = [heading, left, up].map(Twofold::new);
        Frame { heading, left, up, axis: Axis::Up, pending: 0.0, turned: None }
    }

    /// Turns about an axis: left about up, down about left, to the left about heading (the left side goes
    /// down). `degrees` must be finite.
    pub(super) fn turn(&mut self, axis: Axis, degrees: f64) {
        let degrees = reduced(degrees);
        if degrees == 0.0 {
            return;
        }
        if axis != self.axis {
            self.apply();
            self.axis = axis;
        }
        self.pending = reduced(self.pending + degrees);
        self.turned = None;
    }

    /// Heading, left and up as they are now.
    pub(super) fn vectors(&mut self) -> [Vector; 3] {
        let Frame { heading, left, up, .. } = *self;
        let now = match (self.pending == 0.0, self.axis) {
            (true, _) => [heading, left, up],
            (false, Axis::Up) => {
                let [heading, left] = self.turned();
                [heading, left, up]
            }
            (false, Axis::Left) => {
                let [up, heading] = self.turned();
                [heading, left, up]
            }
            (false, Axis::Heading) => {
                let [left, up] = self.turned();
                [heading, left, up]
            }
        };
        now.map(|v| v.value())
    }

    /// The same, with what turns like the pending one have led to.
    pub(super) fn vectors_by(&mut self, turns: &mut Turns) -> [Vector; 3] {
        if self.pending != 0.0 && self.turned.is_none() {
            let key = Turn { axis: self.axis, degrees: self.pending, moved: self.moved() };
            let place = &mut turns.known[Turns::place(self.pending)];
            self.turned = match place {
                Some((turn, turned)) if *turn == key => Some(*turned),
                _ => Some(place.insert((key, self.turned())).1),
            };
        }
        self.vectors()
    }

    /// Rolls until left is horizontal and up is as far up as it can be (`$`; Prusinkiewicz and Lindenmayer
    /// 1990, p. 57). A vertical heading is left as it is.
    pub(super) fn level(&mut self) {
        let [heading, ..] = self.vectors();
        if let Some(left) = Vector::y().cross(&heading).try_normalize(1e-9) {
            *self = Frame::looking(heading, left, heading.cross(&left));
        }
    }

    /// Turns the heading towards a unit vector at a right angle to it, by an angle in radians, and left and
    /// up with it.
    pub(super) fn bend(&mut self, towards: Vector, angle: f64) {
        let [heading, left, _] = self.vectors();
        let (sin, cos) = angle.sin_cos();
        let turned = (heading * cos + towards * sin).normalize();
        let across = left.dot(&towards);
        let left = left + (towards * (cos - 1.0) - heading * sin) * across;
        let left = (left - turned * turned.dot(&left)).normalize();
        *self = Frame::looking(turned, left, turned.cross(&left));
    }

    /// The vectors that the pending turn moves: the first towards the second, about the heading the other way.
    fn moved(&self) -> [Twofold; 2] {
        match self.axis {
            Axis::Up => [self.heading, self.left],
            Axis::Left => [self.up, self.heading],
            Axis::Heading => [self.left, self.up],
        }
    }

    /// The same after the turn.
    fn turned(&mut self) -> [Twofold; 2] {
        let (pending, axis, [a, b]) = (self.pending, self.axis, self.moved());
        *self.turned.get_or_insert_with(|| {
            let (sin, cos) = sin_cos_degrees(pending);
            Twofold::turned(&a, &b, (if axis == Axis::Heading { -sin } else { sin }, cos))
        })
    }

    /// Applies the pending turn.
    fn apply(&mut self) {
        if self.pending == 0.0 {
            return;
        }
        let turned = self.turned();
        match self.axis {
            Axis::Up => [self.heading, self.left] = turned,
            Axis::Left => [self.up, self.heading] = turned,
            Axis::Heading => [self.left, self.up] = turned,
        }
        self.pending = 0.0;
        self.turned = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_orthonormal(frame: &mut Frame) {
        let [h, l, u] = frame.vectors();
        for (a, b, expected) in [(h, h, 1.0), (l, l, 1.0), (u, u, 1.0), (h, l, 0.0), (l, u, 0.0), (u, h, 0.0)]
        {
            assert!((a.dot(&b) - expected).abs() < 1e-12, "{frame:?}");
        }
        assert!((h.cross(&l) - u).norm() < 1e-12);
    }

    #[test]
    fn turns_go_where_their_names_say() {
        let turned = |axis| {
            let mut frame = Frame::upright();
            frame.turn(axis, 90.0);
            frame.vectors()
        };
        assert_eq!(turned(Axis::Up)[0], -Vector::x(), "turning left on the screen");
        assert_eq!(turned(Axis::Left)[0], -Vector::z(), "pitching down, away from up");
        assert_eq!(turned(Axis::Heading)[1], -Vector::z(), "rolling left, the left side goes down");
    }

    #[test]
    fn a_million_turns_about_one_axis_come_back_exactly() {
        for angle in [45.0, 137.5, 1.0, -0.25] {
            let mut frame = Frame::upright();
            for _ in 0..720 * 1400 {
                frame.turn(Axis::Up, angle);
            }
            assert_eq!(frame.vectors(), Frame::upright().vectors(), "{angle}");
        }
    }

    #[test]
    fn a_million_turns_about_alternating_axes_stay_orthonormal() {
        let axes = [Axis::Up, Axis::Heading, Axis::Left];
        for angle in [45.0, 137.5, 1.0] {
            let mut frame = Frame::upright();
            for i in 0..1_000_000 {
                frame.turn(axes[i % 3], angle);
                if i % 1000 == 0 {
                    assert_orthonormal(&mut frame);
                }
            }
            assert_orthonormal(&mut frame);
        }
    }

    #[test]
    fn turns_that_are_known_lead_where_they_led() {
        let axes = [Axis::Up, Axis::Heading, Axis::Up, Axis::Left, Axis::Up];
        let (mut frame, mut turns) = (Frame::upright(), Turns::default());
        for i in 0..20_000_usize {
            // Long stretches in one plane, with few directions.
            frame.turn(axes[i / 500 % 5], [30.0, -45.0, 90.0, 137.5][i % 7 % 4]);
            let mut other = frame;
            other.turned = None;
            assert_eq!(frame.vectors_by(&mut turns), other.vectors(), "{i}");
        }
    }

    #[test]
    fn a_long_way_there_and_back_ends_where_it_began() {
        let axes = [Axis::Up, Axis::Heading, Axis::Left];
        for angle in [45.0, 137.5, 1.0] {
            let mut frame = Frame::upright();
            for i in 0..500_000 {
                frame.turn(axes[i % 3], angle);
            }
            for i in (0..500_000).rev() {
                frame.turn(axes[i % 3], -angle);
            }
            for (a, b) in frame.vectors().iter().zip(Frame::upright().vectors()) {
                assert!((a - b).norm() < 1e-15, "{angle}: {}", (a - b).norm());
            }
        }
    }

    #[test]
    fn right_angles_about_all_axes_are_exact() {
        let mut frame = Frame::upright();
        // Yaw, then pitch by 90 degrees turns about a diagonal of the cube: three times is nothing.
        for _ in 0..300_000 {
            frame.turn(Axis::Up, 90.0);
            frame.turn(Axis::Left, 90.0);
        }
        assert_eq!(frame.vectors(), Frame::upright().vectors());
    }

    #[test]
    fn level_makes_left_horizontal() {
        let mut frame = Frame::upright();
        frame.turn(Axis::Up, -90.0);
        frame.level();
        assert_eq!(frame.vectors(), [Vector::x(), -Vector::z(), Vector::y()]);
        let mut frame = Frame::upright();
        frame.turn(Axis::Heading, 30.0);
        let before = frame.vectors();
        frame.level();
        assert_eq!(frame.vectors(), before, "a vertical heading is left as it is");
        frame.turn(Axis::Left, 77.0);
        frame.turn(Axis::Heading, 123.0);
        frame.level();
        let [_, left, up] = frame.vectors();
        assert!(left.y.abs() < 1e-15 && up.y > 0.0);
        assert_orthonormal(&mut frame);
    }
}
