//! Pairs of a part of a body and a part of a solid: gaps, places where they face each other, and the way out of one another.

use dlsys_solid::{Meeting, Place, Shape};
use nalgebra::Matrix3;

use crate::fall::Rules;
use crate::ground::GROUND;
use crate::impulse::{Bound, Carrier};
use crate::{Motion, Obstacle, Span, Surface, Vector};

/// How far polyhedra stay apart that touch, in parts of the error of a position that is allowed: GJK gives no normal between those that meet.
pub(crate) const SKIN: f64 = 2.0;
/// Most moves by which a body leaves what it overlaps.
const MOVES: usize = 16;

/// A place where a body faces a solid or the ground.
#[derive(Clone, Debug)]
pub(crate) struct Facing {
    /// The index of the solid in its span, or [`GROUND`].
    pub(crate) number: usize,
    pub(crate) gap: f64,
    /// From the solid to the body.
    pub(crate) normal: Vector,
    /// From the centre of mass to the place, in the axes of the world.
    pub(crate) arm: Vector,
    /// The radius of the body there.
    pub(crate) radius: f64,
}

/// A body and the solids near it at an instant.
pub(crate) struct Scene<'a> {
    pub(crate) rules: &'a Rules,
    pub(crate) span: &'a Span,
    /// The solids that count, by their index.
    pub(crate) near: &'a [usize],
}

/// The core of a shape in the axes of the world.
pub(crate) fn at(place: &Place, shape: &Shape) -> Vec<Vector> {
    shape.core().iter().map(|point| place.position + place.attitude * point).collect()
}

impl Rules {
    /// The core of a part of the body in the axes of the world.
    pub(crate) fn core(&self, motion: &Motion, part: &Shape) -> Vec<Vector> {
        part.core().iter().map(|point| motion.point(*point)).collect()
    }

    /// The distance of the cores of two parts that touch.
    pub(crate) fn distance(&self, own: &Shape, other: &Shape) -> f64 {
        (own.radius() + other.radius()).max(SKIN * self.resolution())
    }

    /// The distance of the core of a part from soil that it touches.
    pub(crate) fn width(&self, own: &Shape) -> f64 {
        own.radius().max(SKIN * self.resolution())
    }

    /// A ball around the body, which is larger than it by a length.
    pub(crate) fn ball(&self, motion: &Motion, more: f64) -> (Vector, f64) {
        (motion.position, self.body.reach() + SKIN * self.resolution() + more)
    }
}

impl Scene<'_> {
    fn solid(&self, index: usize) -> &Obstacle {
        &self.span.solids()[index]
    }

    /// How what is touched holds the body.
    pub(crate) fn surface(&self, number: usize) -> Surface {
        match number {
            GROUND => match (self.rules.hills(), self.rules.ground) {
                (Some(relief), _) => relief.soil.surface,
                (None, ground) => ground.map(|ground| ground.surface()).unwrap_or_default(),
            },
            index => self.solid(index).surface,
        }
    }

    /// The narrowest gaps of the body to each part of the solids, where they are narrower than a margin.
    fn narrowest(&self, motion: &Motion, time: f64, margin: f64) -> Vec<Facing> {
        let mut found = Vec::new();
        self.pairs(motion, time, |index, (part, own), (shape, other)| {
            found.extend(self.facing((index, motion), (part, own), (shape, other), margin));
        });
        if let Some(ground) = self.rules.ground {
            found.extend(self.above(&ground, motion).min_by(|a, b| a.gap.total_cmp(&b.gap)));
        }
        if let Some(relief) = self.rules.hills() {
            found.extend(relief.facings(self.rules, motion, margin));
        }
        found.retain(|facing| facing.gap <= margin);
        found
    }

    /// The places where the contacts of the body face the ground.
    fn above<'b>(
        &'b self,
        ground: &'b crate::Ground,
        motion: &'b Motion,
    ) -> impl Iterator<Item = Facing> + 'b {
        self.rules.body.contacts.iter().map(|contact| {
            let arm = motion.turned(contact.point) - Vector::y() * contact.radius;
            let gap = ground.gap(motion, contact);
            Facing { number: GROUND, gap, normal: Vector::y(), arm, radius: contact.radius }
        })
    }

    /// Calls `act` with each part of the body and each part of the solids, with their cores in the axes of the world.
    fn pairs(
        &self,
        motion: &Motion,
        time: f64,
        mut act: impl FnMut(usize, (&Shape, &[Vector]), (&Shape, &[Vector])),
    ) {
        let own: Vec<Vec<Vector>> =
            self.rules.parts.iter().map(|part| self.rules.core(motion, part)).collect();
        for &index in self.near {
            let solid = self.solid(index);
            let place = solid.path.place(time);
            for shape in solid.parts.iter() {
                let other = at(&place, shape);
                for (part, own) in self.rules.parts.iter().zip(&own) {
                    act(index, (part, own), (shape, &other));
                }
            }
        }
    }

    /// Where a part of the body is nearest to one of a solid, if that is within a margin.
    fn facing(
        &self,
        (number, motion): (usize, &Motion),
        (part, own): (&Shape, &[Vector]),
        (shape, other): (&Shape, &[Vector]),
        margin: f64,
    ) -> Option<Facing> {
        let Meeting { way, place } = Meeting::of(own, other);
        let (width, radius) = (self.rules.distance(part, shape), part.radius());
        let distance = way.norm();
        if distance - width > margin {
            return None;
        }
        // Rounding decides where the cores are nearer than this.
        if distance > 1e-9 * self.rules.size {
            let normal = way / distance;
            let arm = place - normal * radius - motion.position;
            return Some(Facing { number, gap: distance - width, normal, arm, radius });
        }
        let normal = way_out(own, other, motion.position);
        let lowest = own.iter().min_by(|a, b| a.dot(&normal).total_cmp(&b.dot(&normal)))?;
        let highest = other.iter().map(|point| point.dot(&normal)).fold(f64::NEG_INFINITY, f64::max);
        let arm = lowest - normal * radius - motion.position;
        Some(Facing { number, gap: lowest.dot(&normal) - highest - width, normal, arm, radius })
    }

    /// All places within a margin where body and solids face each other: points of either with the other, and where they are nearest; and contacts of
    /// the body with the ground.
    pub(crate) fn facings(&self, motion: &Motion, time: f64, margin: f64) -> Vec<Facing> {
        let mut found = Vec::new();
        self.pairs(motion, time, |index, (part, own), (shape, other)| {
            let Some(nearest) = self.facing((index, motion), (part, own), (shape, other), margin) else {
                return;
            };
            found.push(nearest);
            let (width, radius) = (self.rules.distance(part, shape), part.radius());
            let mut push = |Meeting { way, place }: Meeting| {
                let distance = way.norm();
                if distance - width <= margin && distance > 1e-9 * self.rules.size {
                    let normal = way / distance;
                    let arm = place - normal * radius - motion.position;
                    found.push(Facing { number: index, gap: distance - width, normal, arm, radius });
                }
            };
            if own.len() > 1 {
                own.iter().for_each(|point| push(Meeting::of(&[*point], other)));
            }
            if other.len() > 1 {
                let reach = self.rules.body.reach() + width + margin;
                let within = |point: &&Vector| (*point - motion.position).norm() <= reach;
                other.iter().filter(within).for_each(|point| push(Meeting::of(own, &[*point])));
            }
        });
        if let Some(ground) = &self.rules.ground {
            found.extend(self.above(ground, motion).filter(|facing| facing.gap <= margin));
        }
        if let Some(relief) = self.rules.hills() {
            found.extend(relief.facings(self.rules, motion, margin));
        }
        found
    }

    /// The narrowest gap, at most as wide as a margin.
    pub(crate) fn gap(&self, motion: &Motion, time: f64, margin: f64) -> f64 {
        self.narrowest(motion, time, margin).iter().map(|facing| facing.gap).fold(margin, f64::min)
    }

    /// The numbers of the solids that the body overlaps by more than a depth.
    pub(crate) fn overlapped(&self, motion: &Motion, time: f64, depth: f64) -> Vec<u64> {
        let mut found = Vec::new();
        self.pairs(motion, time, |index, (part, own), (shape, other)| {
            let facing = self.facing((index, motion), (part, own), (shape, other), -depth);
            found.extend(facing.filter(|facing| facing.gap < -depth).map(|_| self.solid(index).number));
        });
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Moves a body out of what it overlaps, if that is possible. Returns the way.
    pub(crate) fn part(&self, motion: &mut Motion, time: f64) -> Vector {
        let (start, depth) = (motion.position, 0.01 * self.rules.depth());
        for _ in 0..MOVES {
            let narrow = self.narrowest(motion, time, 0.0);
            let deepest = narrow.into_iter().min_by(|a, b| a.gap.total_cmp(&b.gap));
            let Some(facing) = deepest.filter(|facing| facing.gap < -depth) else { break };
            motion.position -= facing.normal * facing.gap;
        }
        motion.position - start
    }

    /// The motion of what is touched, as a rigid one, at an instant.
    pub(crate) fn carrier(&self, number: usize, motion: &Motion, time: f64) -> Carrier {
        if number == GROUND || self.span.swept(number).is_still {
            return Carrier::default();
        }
        let place = self.solid(number).path.place(time);
        let arm = motion.position - place.position;
        Carrier { velocity: place.velocity_at(&arm), spin: place.spin }
    }

    /// The mean motion of what is touched from one time to another.
    pub(crate) fn mean_carrier(&self, number: usize, motion: &Motion, [from, to]: [f64; 2]) -> Carrier {
        if number == GROUND || self.span.swept(number).is_still {
            return Carrier::default();
        }
        let [here, there] = [from, to].map(|time| self.solid(number).path.place(time));
        let turn = there.attitude * here.attitude.inverse();
        let moved = there.position + turn * (motion.position - here.position);
        let h = to - from;
        Carrier { velocity: (moved - motion.position) / h, spin: turn.scaled_axis() / h }
    }

    /// The mean velocity of what is touched, from one time to another, at the place of a facing.
    fn mean_surface(&self, facing: &Facing, motion: &Motion, [from, to]: [f64; 2]) -> Vector {
        if facing.number == GROUND || self.span.swept(facing.number).is_still {
            return Vector::zeros();
        }
        let [here, there] = [from, to].map(|time| self.solid(facing.number).path.place(time));
        let turn = there.attitude * here.attitude.inverse();
        let point = motion.position + facing.arm;
        (there.position + turn * (point - here.position) - point) / (to - from)
    }

    /// The velocity of what is touched at the place of a facing, at an instant.
    pub(crate) fn surface_velocity(&self, facing: &Facing, motion: &Motion, time: f64) -> Vector {
        let carrier = self.carrier(facing.number, motion, time);
        carrier.velocity + carrier.spin.cross(&facing.arm)
    }

    /// Contacts of an impact at an instant, or of a step from one time to another. `least` gives the least velocity along the normal from the gap and the present
    /// one, both relative to what is touched.
    pub(crate) fn bounds(
        &self,
        facings: &[Facing],
        motion: &Motion,
        [from, to]: [f64; 2],
        least: impl Fn(&Facing, f64) -> Option<f64>,
    ) -> Vec<Bound> {
        let bound = |facing: &Facing| {
            let (surface, carrier) = if to > from {
                let carrier = self.mean_carrier(facing.number, motion, [from, to]);
                (self.mean_surface(facing, motion, [from, to]), carrier)
            } else {
                let carrier = self.carrier(facing.number, motion, from);
                (self.surface_velocity(facing, motion, from), carrier)
            };
            let velocity = motion.velocity + motion.world_spin().cross(&facing.arm) - surface;
            Some(Bound {
                arm: facing.arm,
                frame: frame(&facing.normal),
                surface,
                carrier,
                radius: facing.radius,
                least: least(facing, velocity.dot(&facing.normal))?,
                grip: self.surface(facing.number),
                number: facing.number,
            })
        };
        facings.iter().filter_map(bound).collect()
    }
}

/// Axes with a normal as the second one.
fn frame(normal: &Vector) -> Matrix3<f64> {
    if *normal == Vector::y() {
        return Matrix3::identity();
    }
    let other = Vector::ith(normal.iamin(), 1.0);
    let first = normal.cross(&other).normalize();
    Matrix3::from_columns(&[first, *normal, first.cross(normal)])
}

/// A direction in which a body leaves a solid with which its core meets: that in which it would leave it if it were smaller.
fn way_out(own: &[Vector], other: &[Vector], centre: Vector) -> Vector {
    const SIZES: [f64; 6] = [0.95, 0.8, 0.6, 0.4, 0.2, 0.0];
    for size in SIZES {
        let smaller: Vec<Vector> = own.iter().map(|point| centre + (point - centre) * size).collect();
        let Meeting { way, .. } = Meeting::of(&smaller, other);
        let extent = own.iter().map(|point| (point - centre).norm()).fold(0.0, f64::max);
        if way.norm() > 1e-9 * extent.max(f64::MIN_POSITIVE) {
            return way.normalize();
        }
    }
    let middle = other.iter().sum::<Vector>() / other.len().max(1) as f64;
    let aside = centre - middle;
    if let Some(normal) = flat(other) {
        let up = if normal.dot(&aside).abs() > 1e-9 * aside.norm() { normal.dot(&aside) } else { normal.y };
        return if up < 0.0 { -normal } else { normal };
    }
    aside.try_normalize(0.0).unwrap_or_else(Vector::y)
}

/// The normal of points in one plane, if they are.
fn flat(points: &[Vector]) -> Option<Vector> {
    let first = points.first()?;
    let far = |along: &dyn Fn(&Vector) -> f64| {
        points.iter().map(|point| point - first).max_by(|a, b| along(a).total_cmp(&along(b)))
    };
    let across = far(&|way| way.norm())?;
    let other = far(&|way| across.cross(way).norm())?;
    let normal = across.cross(&other).try_normalize(0.0)?;
    let is_flat = points.iter().all(|point| normal.dot(&(point - first)).abs() < 1e-9 * across.norm());
    is_flat.then_some(normal)
}
