//! Collars: a stem widens where it leaves the stem that it grows from, or the ground that it stands on.
//!
//! A point of the stem's plain surface moves out along its normal n by
//!
//! ```text
//! height (1 - n·m) (1 - d / length)³      for 0 ≤ d ≤ length
//! ```
//!
//! where d is its distance from the parent's surface and m the parent's normal there: most in an acute angle, not at all
//! where the surfaces run alongside, so that a branch as thick as its parent has no bulge on its sides. The
//! shape depends on places alone, not on how stems are divided into segments.

use dlsys_geometry::scene::{Point, Vector};

/// Height of a collar at a right angle, in parts of the branch's radius, and its length, in parts of the height.
const HEIGHT: f64 = 0.5;
const LENGTH: f64 = 3.2;
/// The same of a foot on the ground: a hint of roots that is no plinth under a pole. A foot is no longer than this part of its stem.
const FOOT: f64 = 0.16;
const FOOT_LENGTH: f64 = 10.0;
const FOOT_OF_STEM: f64 = 0.25;
/// Sines of the angle to the parent from which a collar appears, and from which it has its height: a branch that leaves
/// along its parent comes out of it slowly.
const FROM: f64 = 0.17;
const FULL: f64 = 0.4;

/// What a stem grows from.
#[derive(Clone, Copy, Debug)]
enum Parent {
    /// A stem that ends at the joint, in a `ball` or not, and may go on from there; directions are its own, and radii those at the joint.
    Stem { back: Vector, radius: f64, ahead: Option<(Vector, f64)>, ball: bool },
    /// The ground, at this height.
    Ground(f64),
}

/// How a stem goes on from the joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    pub(super) direction: Vector,
    pub(super) radius: f64,
    /// How much of it goes on, from 0, nothing, to 1.
    pub(super) part: f64,
    /// Whether its axis ends at the joint, and this is a branch.
    pub(super) ends: bool,
}

/// A collar of one stem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Collar {
    parent: Parent,
    joint: Point,
    /// The stem's radius at its beginning.
    radius: f64,
    height: f64,
    length: f64,
    /// Lengths along the stem between which it comes out of its parent and out of the collar.
    between: [f64; 2],
    edge: Option<Edge>,
}

/// Where the plain surface of a branch comes out of its parent, each of its lines at a length of its own.
#[derive(Clone, Copy, Debug)]
struct Edge {
    /// Unit vectors across the branch: away from the parent's direction as far as it can be, and across the parent, too.
    away: Vector,
    across: Vector,
    sin: f64,
    cos: f64,
    /// Radius of the parent.
    wide: f64,
    /// The middle of those lengths.
    middle: f64,
}

impl Edge {
    /// By how much the line on this side (a unit vector) comes out later than the middle.
    fn later(&self, outward: Vector, radius: f64) -> f64 {
        let (a, b) = (radius * outward.dot(&self.away), radius * outward.dot(&self.across));
        ((self.wide * self.wide - b * b).max(0.0).sqrt() - a * self.cos) / self.sin - self.middle
    }
}

/// A cross-section that a collar needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Station {
    /// Its length along the stem.
    pub(super) at: f64,
    /// How far it follows the edge at which the branch comes out of its parent: from 0, flat, to 1.
    pub(super) drape: f64,
}

/// How many pieces a collar has.
#[derive(Clone, Copy, Debug)]
pub(super) enum Pieces {
    Fixed(u8),
    Within(f64),
}

impl Collar {
    /// The collar of a branch with this direction and radius, and this part of its height. `None` if it would be no higher than `accuracy`.
    pub(super) fn of_branch(
        [joint, direction]: [Vector; 2],
        radius: f64,
        parent: (Vector, f64),
        ahead: Option<Ahead>,
        (accuracy, share): (f64, f64),
    ) -> Option<Collar> {
        let (back, thickness) = parent;
        // The one of both directions on whose side the branch is.
        let (along, wide) = match ahead.filter(|ahead| direction.dot(&ahead.direction) > 0.0) {
            Some(Ahead { direction, radius, part, .. }) if part < 1.0 => {
                let between = (back * (1.0 - part) + direction * part).try_normalize(1e-9);
                (between.unwrap_or(back), thickness + (radius - thickness) * part)
            }
            Some(Ahead { direction, radius, .. }) => (direction, radius),
            None => parent,
        };
        let (sin, cos) = (direction.cross(&along).norm(), direction.dot(&along));
        let part = ((sin - FROM) / (FULL - FROM)).clamp(0.0, 1.0);
        let height = HEIGHT * radius.min(wide) * part * part * (3.0 - 2.0 * part) * share;
        if height <= accuracy {
            return None;
        }
        let length = LENGTH * height;
        let inside = (wide * wide - radius * radius).max(0.0).sqrt();
        let middle = 0.5 * (wide + inside) / sin;
        // Lines come out no more than this before and after the middle.
        let spread = (0.5 * (wide - inside) + radius * cos.abs()) / sin;
        let reach = middle + (spread + length / sin).max(1.3 * spread);
        let away = (direction * cos - along) / sin;
        let edge = Edge { away, across: direction.cross(&away), sin, cos, wide, middle };
        Some(Collar {
            parent: Parent::Stem {
                back,
                radius: thickness,
                ahead: ahead.map(|ahead| (ahead.direction, ahead.radius * ahead.part)),
                ball: ahead.is_some_and(|ahead| ahead.ends),
            },
            joint: Point::from(joint),
            radius,
            height,
            length,
            between: [(middle - spread).max(0.0), reach],
            edge: Some(edge),
        })
    }

    /// The foot of a stem that stands on the ground at this height, and goes on straight and evenly for this length.
    pub(super) fn of_foot(
        joint: Point,
        direction: Vector,
        radius: f64,
        (ground, even): (f64, f64),
    ) -> Collar {
        let length = (FOOT_LENGTH * FOOT * radius).min(FOOT_OF_STEM * even);
        let height = length / FOOT_LENGTH;
        let sin = direction.y.max(0.5);
        let (low, cos) = (ground - joint.y, (1.0 - sin * sin).max(0.0).sqrt());
        let between = [(low - radius * cos) / sin, (low + length + radius * cos) / sin].map(|s| s.max(0.0));
        Collar { parent: Parent::Ground(ground), joint, radius, height, length, between, edge: None }
    }

    /// Length along the stem from which on it is plain.
    pub(super) fn reach(&self) -> f64 {
        self.between[1]
    }

    /// Where along the stem it needs cross-sections, to be no further than about `accuracy` from its
    /// shape, or so many pieces, which are as many in all frames. The stem goes on straight and evenly for the length `free`.
    pub(super) fn stations(&self, pieces: Pieces, free: f64) -> Vec<Station> {
        let (pieces, begins_inside) = match pieces {
            Pieces::Fixed(pieces) => (f64::from(pieces), false),
            Pieces::Within(accuracy) => {
                ((1.5 * (self.height / accuracy).sqrt()).ceil().clamp(3.0, 12.0), true)
            }
        };
        let [from, to] = self.between;
        let parts = (0..=pieces as usize).map(|k| k as f64 / pieces);
        let Some(edge) = self.edge.filter(|_| to <= free) else {
            return parts.map(|part| Station { at: from + (to - from) * part, drape: 0.0 }).collect();
        };
        // One inside the parent, one at the edge, others closer to it than to the end.
        let inside = (edge.middle - 0.4 * self.length).max(0.4 * edge.middle);
        let span = to - edge.middle;
        let outside = parts.map(|part| part.powf(1.4));
        let outside = outside.map(|part| Station { at: edge.middle + span * part, drape: 1.0 - part });
        // Lengths do without the first: a little of it may be seen at the edge.
        let inside = Station { at: inside, drape: 1.0 };
        begins_inside.then_some(inside).into_iter().chain(outside).collect()
    }

    /// By how much the line of the stem on this side is longer, up to a cross-section with its middle here, than that
    /// middle.
    pub(crate) fn droop(&self, centre: Point, along: Vector, outward: Vector, drape: f64) -> f64 {
        let Some(edge) = self.edge.filter(|_| drape > 0.0) else { return 0.0 };
        // No line begins before the joint.
        (drape * edge.later(outward, self.radius)).max(-(centre - self.joint).dot(&along))
    }

    /// Distance of a point from the parent's surface, the unit normal there, and how fast that turns on the way along
    /// a direction.
    fn parent(&self, at: Point) -> (f64, Vector, impl Fn(Vector) -> Vector) {
        let v = at - self.joint;
        // The part of `v` across an axis, which counts beside it, and the radius there.
        let (mut aside, mut axis, mut distance) = (v, Vector::zeros(), f64::INFINITY);
        match self.parent {
            Parent::Ground(height) => (aside, axis, distance) = (Vector::y(), Vector::y(), at.y - height),
            Parent::Stem { back, radius, ahead, ball } => {
                if ball {
                    distance = v.norm() - radius;
                }
                let sides = [Some((-back, radius)), ahead];
                for (along, radius) in sides.into_iter().flatten() {
                    let far = v.dot(&along);
                    let across = v - along * far;
                    if far >= 0.0 && across.norm() - radius < distance {
                        (aside, axis, distance) = (across, along, across.norm() - radius);
                    }
                }
                if distance == f64::INFINITY {
                    distance = v.norm() - radius;
                }
            }
        }
        let size = aside.norm();
        let normal = if size > 0.0 { aside / size } else { Vector::zeros() };
        let bends = matches!(self.parent, Parent::Stem { .. }) && size > 0.0;
        let turn = move |t: Vector| match bends {
            true => (t - axis * axis.dot(&t) - normal * normal.dot(&t)) / size,
            false => Vector::zeros(),
        };
        (distance, normal, turn)
    }

    /// The factor of the height at a distance from the parent, and its derivative.
    fn profile(&self, distance: f64) -> (f64, f64) {
        if distance <= 0.0 {
            return (1.0, 0.0);
        }
        let rest = (1.0 - distance / self.length).max(0.0);
        (rest * rest * rest, -3.0 * rest * rest / self.length)
    }

    /// The place of a point of the plain surface with this normal.
    pub(crate) fn place(&self, at: Point, normal: Vector) -> Point {
        let (distance, of_parent, _) = self.parent(at);
        at + normal * (self.height * (1.0 - normal.dot(&of_parent)) * self.profile(distance).0)
    }

    /// The normal at such a point; `along` is the direction of the stem there.
    pub(super) fn normal(&self, at: Point, normal: Vector, along: Vector) -> Vector {
        let (distance, of_parent, turn) = self.parent(at);
        let (part, slope) = self.profile(distance);
        let Some(around) = along.cross(&normal).try_normalize(1e-6).filter(|_| part > 0.0) else {
            return normal;
        };
        let open = 1.0 - normal.dot(&of_parent);
        let moved = |t: Vector| {
            // How the stem's own normal turns along t.
            let own = (t - along * along.dot(&t)) / self.radius;
            let closing = own.dot(&of_parent) + normal.dot(&turn(t));
            let rise = self.height * (open * slope * of_parent.dot(&t) - closing * part);
            t + normal * rise + own * (self.height * open * part)
        };
        let across = moved(around).cross(&moved(normal.cross(&around)));
        let facing = if across.dot(&normal) < 0.0 { -across } else { across };
        facing.try_normalize(1e-300).unwrap_or(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn collar(angle: f64) -> (Collar, Vector) {
        let direction = Vector::new(angle.sin(), angle.cos(), 0.0);
        let (joint, up) = (Vector::new(0.0, 1.0, 0.0), Vector::y());
        let ahead = Ahead { direction: up, radius: 1.0, part: 1.0, ends: false };
        let collar = Collar::of_branch([joint, direction], 0.5, (up, 1.0), Some(ahead), (1e-6, 1.0));
        (collar.expect("high enough"), direction)
    }

    /// The normal is that of the surface, by differences.
    #[test]
    fn normals_are_those_of_the_shape() {
        for angle in [0.5, 1.0, std::f64::consts::FRAC_PI_2, 2.4] {
            let (collar, along) = collar(angle);
            let side = along.cross(&Vector::z()).normalize();
            for step in 0..40 {
                let turn = f64::from(step) * 0.7;
                let far = collar.between[0] + (collar.reach() - collar.between[0]) * f64::from(step) / 40.0;
                let moved = |turn: f64, far: f64| {
                    let normal = side * turn.cos() + Vector::z() * turn.sin();
                    let at = collar.joint + along * far + normal * 0.5;
                    (at, normal, collar.place(at, normal))
                };
                let (at, normal, place) = moved(turn, far);
                if collar.parent(at).0.abs() < 1e-3 {
                    continue;
                }
                let e = 1e-6;
                let (a, b) = (moved(turn + e, far).2 - place, moved(turn, far + e).2 - place);
                let expected = a.cross(&b).normalize();
                let expected = if expected.dot(&normal) < 0.0 { -expected } else { expected };
                let found = collar.normal(at, normal, along);
                assert!((found - expected).norm() < 1e-3, "{angle} {turn} {far}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_collar_ends_where_it_should_and_begins_inside() {
        for angle in [0.5, 1.0, 1.5, 2.4] {
            let (collar, along) = collar(angle);
            let side = along.cross(&Vector::z()).normalize();
            for turn in (0..36).map(|k| f64::from(k) * 0.1745) {
                let normal = side * turn.cos() + Vector::z() * turn.sin();
                let at = |far: f64| collar.joint + along * far + normal * 0.5;
                let end = at(collar.reach() + 1e-9);
                assert!((collar.place(end, normal) - end).norm() < 1e-9, "plain from its reach on");
                let start = collar.place(at(0.0), normal);
                assert!(collar.parent(start).0 < 0.0, "inside its parent at the joint");
            }
        }
    }
}
