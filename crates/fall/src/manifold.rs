//! The places where a body faces a height field, which hold it together: its contact manifold.
//!
//! Points of the body face the surface, and sides and edges of the body face ridges: edges between triangles that fall away from each other. Of a side that lies along
//! a ridge, the nearest places alone would be one point, on which the body rocks; both ends of their common stretch hold it.

use std::collections::VecDeque;

use dlsys_solid::{Meeting, Shape};

use crate::fall::Rules;
use crate::ground::GROUND;
use crate::pairs::{Facing, SKIN};
use crate::soil::{Face, Relief};
use crate::{Motion, Vector};

/// Rounding of directions.
const TILT: f64 = 1e-6;
/// Places that are nearer than this are one, and cores that are nearer meet, in parts of the size of the body.
const SAME: f64 = 1e-6;
const SMALL: f64 = 1e-9;
/// Most directions that are tried before the nearest places are searched.
const AXES: usize = 4;

impl Relief {
    /// The height in m below which a fold between triangles is rounding.
    pub(crate) fn fold(&self) -> f64 {
        TILT * self.soil.columns.cell()
    }

    /// All places within a margin (m) where a body faces the surface.
    pub(crate) fn facings(&self, rules: &Rules, motion: &Motion, margin: f64) -> Vec<Facing> {
        let faces = self.near(rules, motion, margin.max(0.0) + SKIN * rules.resolution());
        let mut manifold = Manifold { relief: self, rules, motion, margin, found: Vec::new() };
        for part in &rules.parts {
            let core = rules.core(motion, part);
            core.iter().for_each(|point| manifold.point(part, point));
            if core.len() > 1 {
                manifold.sides(part, &core, &faces);
            }
        }
        manifold.found
    }
}

/// What has been found of one body.
struct Manifold<'a> {
    relief: &'a Relief,
    rules: &'a Rules,
    motion: &'a Motion,
    margin: f64,
    found: Vec<Facing>,
}

impl Manifold<'_> {
    /// The distance of a core from the surface within which it counts.
    fn reach(&self, part: &Shape) -> f64 {
        self.rules.width(part) + self.margin.max(0.0)
    }

    fn small(&self) -> f64 {
        SMALL * self.rules.size
    }

    /// Adds a place of the core, if it is near and not known.
    fn push(&mut self, part: &Shape, (place, normal): (&Vector, Vector), distance: f64) {
        let (gap, radius) = (distance - self.rules.width(part), part.radius());
        let arm = place - normal * radius - self.motion.position;
        let known = |other: &Facing| {
            (other.arm - arm).norm() <= SAME * self.rules.size && other.normal.dot(&normal) > 1.0 - TILT
        };
        if gap <= self.margin && !self.found.iter().any(known) {
            self.found.push(Facing { number: GROUND, gap, normal, arm, radius });
        }
    }

    /// A point of the core, and the triangles near it.
    fn point(&mut self, part: &Shape, point: &Vector) {
        let (reach, small) = (self.reach(part), self.small());
        let below = self.relief.face(point.x, point.z).filter(|face| face.depth(point) >= -small);
        if let Some(face) = below {
            self.push(part, (point, face.up), -face.depth(point));
            return;
        }
        let relief = self.relief;
        for face in relief.faces([point.x - reach, point.x + reach], [point.z - reach, point.z + reach]) {
            let above = -face.depth(point);
            if above > reach || above <= 0.0 {
                continue;
            }
            let foot = point - face.up * above;
            let way = match face.holds(foot.x, foot.z) {
                true => face.up * above,
                false => Meeting::of(&[*point], &face.corners).way,
            };
            let distance = way.norm();
            if distance > reach || distance <= small || way.dot(&face.up) <= 0.0 {
                continue;
            }
            let normal = way / distance;
            if relief.is_outward(&(point - way), &normal, relief.fold()) {
                self.push(part, (point, normal), distance);
            }
        }
    }

    /// Sides and edges of the core, with ridges. Where no point of the body is below the surface, a side that gets through it meets a ridge.
    fn sides(&mut self, part: &Shape, core: &[Vector], faces: &[Face]) {
        let reach = self.reach(part);
        let near: Vec<&Face> = faces.iter().filter(|face| face.lowest(core) <= reach).collect();
        let mut apart = Apart::new(core, reach);
        for Ridge { ends, ups } in ridges(&near, self.relief.fold()) {
            let Some(meeting) = apart.meeting(&ends) else { continue };
            if meeting.way.norm() > self.small() {
                self.along(part, core, (&ends, meeting));
                continue;
            }
            for up in ups {
                let sunk = sunk(core, (&ends, &up), self.rules.size);
                self.push(part, (&meeting.place, up), -sunk);
            }
        }
    }

    /// The places of the core that face a ridge: the nearest one, and the ends of the stretch in which the side that it lies in is above the ridge.
    fn along(&mut self, part: &Shape, core: &[Vector], (ends, meeting): (&[Vector; 2], Meeting)) {
        let Meeting { way, place } = meeting;
        let (distance, small) = (way.norm(), self.small());
        if distance <= small || way.y <= 0.0 {
            return;
        }
        let normal = way / distance;
        // Within the error that is allowed, a side lies on more than the one ridge that is foremost: a small turn brings it from each to the next. A corner of the
        // body, however, would be caught by what it has passed.
        let is_corner = core.iter().any(|point| (point - place).norm() <= small);
        let resolution = self.rules.resolution();
        let most = if is_corner { self.relief.fold() } else { self.relief.fold().max(resolution) };
        if !self.relief.is_outward(&(place - way), &normal, most) {
            return;
        }
        self.push(part, (&place, normal), distance);
        let side = core.iter().filter(|point| (**point - place).dot(&normal) <= resolution);
        for (place, distance) in stretch(side, ends, &normal).into_iter().flatten() {
            self.push(part, (&place, normal), distance);
        }
    }
}

/// Directions along which a core is further from something than a distance. They tell the same of much that is beside it, with less work.
pub(crate) struct Apart<'a> {
    core: &'a [Vector],
    distance: f64,
    /// The last ones, and how far the core reaches against them.
    axes: VecDeque<(Vector, f64)>,
}

impl Apart<'_> {
    pub(crate) fn new(core: &[Vector], distance: f64) -> Apart<'_> {
        Apart { core, distance, axes: VecDeque::with_capacity(AXES) }
    }

    /// Where the core is nearest to an edge, if that is within the distance.
    pub(crate) fn meeting(&mut self, ends: &[Vector; 2]) -> Option<Meeting> {
        let is_apart = |(axis, least): &(Vector, f64)| {
            least - ends[0].dot(axis).max(ends[1].dot(axis)) > self.distance * (1.0 + SMALL)
        };
        if self.axes.iter().any(is_apart) {
            return None;
        }
        let meeting = Meeting::within(self.core, ends, self.distance);
        let axis = meeting.map_or_else(|way| way, |meeting| meeting.way).try_normalize(0.0);
        if let Some(axis) = axis {
            self.axes.truncate(AXES - 1);
            let least = self.core.iter().map(|point| point.dot(&axis)).fold(f64::INFINITY, f64::min);
            self.axes.push_front((axis, least));
        }
        meeting.ok()
    }
}

/// An edge between triangles that fall away from each other, and their normals.
pub(crate) struct Ridge {
    pub(crate) ends: [Vector; 2],
    ups: [Vector; 2],
}

/// The edges on both sides of which there are triangles, of these, that fall away from each other by more than a height. An edge that is near has both of them near.
pub(crate) fn ridges(faces: &[&Face], least: f64) -> Vec<Ridge> {
    let order = |a: &Vector, b: &Vector| a.x.total_cmp(&b.x).then(a.z.total_cmp(&b.z));
    let edges = faces.iter().flat_map(|face| {
        [[0, 1, 2], [1, 2, 0], [2, 0, 1]].map(|corners| {
            let [a, b, other] = corners.map(|k| face.corners[k]);
            (if order(&a, &b).is_le() { [a, b] } else { [b, a] }, other, face.up)
        })
    });
    let mut edges: Vec<([Vector; 2], Vector, Vector)> = edges.collect();
    edges.sort_by(|(a, ..), (b, ..)| order(&a[0], &b[0]).then_with(|| order(&a[1], &b[1])));
    let ridge = |group: &[([Vector; 2], Vector, Vector)]| match *group {
        [(ends, _, up), (_, other, beyond)] => {
            ((other - ends[0]).dot(&up) < -least).then_some(Ridge { ends, ups: [up, beyond] })
        }
        _ => None,
    };
    edges.chunk_by(|(a, ..), (b, ..)| a == b).filter_map(ridge).collect()
}

/// The ends of the stretch of an edge that is below a side, seen along a normal: the places of the side, and how far they are above the edge. `None` for an end that is
/// not there.
fn stretch<'a>(
    side: impl Iterator<Item = &'a Vector>,
    [from, to]: &[Vector; 2],
    normal: &Vector,
) -> [Option<(Vector, f64)>; 2] {
    let flat = |way: Vector| way - normal * way.dot(normal);
    let along = flat(to - from);
    let length = along.norm_squared();
    let across = normal.cross(&along);
    if length <= 0.0 {
        return [None, None];
    }
    // On both sides of the plane through edge and normal: share of the edge, and distance from the plane.
    let placed = side.map(|point| {
        let way = point - from;
        (point, way.dot(&along) / length, way.dot(&across))
    });
    let placed: Vec<(&Vector, f64, f64)> = placed.collect();
    let mut ends: [Option<Vector>; 2] = [None, None];
    let mut shares = [f64::INFINITY, f64::NEG_INFINITY];
    for (p, at_p, left) in placed.iter().filter(|(.., aside)| *aside >= 0.0) {
        for (q, at_q, right) in placed.iter().filter(|(.., aside)| *aside <= 0.0) {
            let whole = left - right;
            let part = if whole > 0.0 { left / whole } else { 0.0 };
            let (share, place) = (at_p + (at_q - at_p) * part, *p + (*q - *p) * part);
            for (end, is_further) in [(0, share < shares[0]), (1, share > shares[1])] {
                if is_further {
                    (shares[end], ends[end]) = (share, Some(place));
                }
            }
        }
    }
    let [Some(first), Some(last)] = ends else { return [None, None] };
    if shares[0] >= 1.0 || shares[1] <= 0.0 {
        return [None, None];
    }
    // Of the side, what is above the edge.
    let [low, high] = shares;
    let at = |share: f64| {
        let share = share.clamp(0.0, 1.0);
        let part = if high > low { (share - low) / (high - low) } else { 0.0 };
        let place = first + (last - first) * part.clamp(0.0, 1.0);
        Some((place, (place - from - (to - from) * share).dot(normal)))
    };
    [at(low), at(high)]
}

/// How far a core must move along a normal until it is out of an edge.
fn sunk(core: &[Vector], (ends, up): (&[Vector; 2], &Vector), size: f64) -> f64 {
    let lowest = core.iter().map(|point| (ends[0] - point).dot(up).max((ends[1] - point).dot(up)));
    let [mut inside, mut outside] = [0.0, lowest.fold(0.0, f64::max)];
    for _ in 0..40 {
        if outside - inside <= SMALL * size {
            break;
        }
        let middle = (inside + outside) / 2.0;
        let moved = ends.map(|end| end - up * middle);
        if Meeting::of(core, &moved).way.norm() > SMALL * size { outside = middle } else { inside = middle }
    }
    outside
}
