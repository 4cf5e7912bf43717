//! Which plants of one simulation share a drawing: those whose ages are so near to one another that the picture cannot show the difference.
//!
//! ```text
//! ages, from young to old:  |........|....|..|........|     drawn at the bars; both drawings at the ends of a stretch are compared,
//!                                                           and a plant between takes the nearer one if they are alike at its place
//! ```
//!
//! Two drawings are alike if each element of one has its counterpart in the other, no point of it further away than the tolerance, and those
//! without a counterpart are smaller than that. The tolerance of a plant is [`PART`] of the error in pixels that the picture may have, at the point of the
//! plant that is nearest to the camera. So plants near to the camera have drawings of their own, and those far away share. The choice depends on
//! the plants, the camera and the size of the picture; it does not depend on threads and on what was drawn before.
//!
//! **Errors.** Between two drawings that are alike something may come and go within less time than half the stretch; that is not seen. A job is
//! halved at least [`LEAST_HALVINGS`] times, at the ages of its plants, which are irregular, so a motion that repeats itself is not mistaken for rest.

use dlsys_geometry::scene::{
    MaterialId, Palette, Patch, Placement, Plant, Point, Polygon, Scene, Segment, Surface, Vector, Viewpoint,
    Width,
};

use crate::gauge::Detail;

/// The part of [`Detail::bound`] by which two drawings may differ. A plant takes the nearer one, and is off by about half of it.
const PART: f64 = 1.0;
/// Halvings of a stretch of ages before drawings at its ends may be shared.
pub(crate) const LEAST_HALVINGS: u32 = 3;
/// Largest difference of a channel of two colours that are alike.
const SHADE: u8 = 2;
/// How many times as much plants may differ that are not in the picture, and in a first pass, which only measures the scene.
const UNSEEN: f64 = 8.0;

/// The view of a scene in which plants may be small.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    eye: Point,
    forward: Vector,
    /// Half of the angle of view, as a slope: across the smaller side, and from corner to corner.
    slope: f64,
    steepest: f64,
    /// Pixels across the smaller side, and the difference in pixels that may be.
    pixels: f64,
    bound: f64,
}

impl Sight {
    /// `None` without a camera. A survey is a first pass.
    pub(crate) fn new(detail: Detail, declared: Option<Viewpoint>, is_survey: bool) -> Option<Sight> {
        let Viewpoint { eye, aim, angle } = detail.viewpoint.or(declared)?;
        let slope = (angle / 2.0).to_radians().tan();
        let forward = (aim - eye).try_normalize(0.0)?;
        let bound = PART * detail.bound * if is_survey { UNSEEN } else { 1.0 };
        let steepest = slope * detail.shape.max(1.0).hypot(1.0);
        Some(Sight { eye, forward, slope, steepest, pixels: detail.pixels, bound })
    }

    /// The largest difference that two drawings of a plant may have, in units of the plant, if no point of it is further than `reach` units from
    /// its root; 0 if the camera stands in it.
    pub(crate) fn tolerance(&self, place: &Placement, reach: f64) -> f64 {
        let reach = reach * place.largest();
        let away = place.origin - self.eye;
        let (depth, distance) = (away.dot(&self.forward), away.norm());
        let aside = (distance * distance - depth * depth).max(0.0).sqrt();
        // From the side of the cone around the picture, and from its tip.
        let outside = (aside - depth * self.steepest) / self.steepest.hypot(1.0);
        let is_seen = outside <= reach;
        // A point in the picture is at least this deep, at its distance.
        let depth = (depth - reach).max((distance - reach) / self.steepest.hypot(1.0));
        let pixels = self.pixels * 0.5 / (self.slope * depth.max(f64::MIN_POSITIVE)) * place.largest();
        let bound = if is_seen { self.bound } else { UNSEEN * self.bound };
        if depth > 0.0 && pixels > 0.0 { bound / pixels } else { 0.0 }
    }
}

/// The greatest distance of a point of a plant from its root, in its own units.
pub(crate) fn reach(plant: Option<&Plant>) -> f64 {
    let bounds = plant.and_then(Plant::bounds);
    bounds.map_or(0.0, |[low, high]| low.coords.abs().sup(&high.coords.abs()).norm())
}

/// Whether two drawings of a plant differ by no more than a tolerance.
pub(crate) fn alike(a: &Scene, b: &Scene, tolerance: f64) -> bool {
    let pair = Pair { colors: [&a.palette, &b.palette], tolerance };
    tolerance > 0.0
        && a.plants.is_empty()
        && b.plants.is_empty()
        && pair.all(&chains(&a.segments), &chains(&b.segments))
        && pair.all(&a.patches, &b.patches)
        && pair.all(&a.surfaces, &b.surfaces)
        && pair.all(&a.polygons, &b.polygons)
}

struct Pair<'s> {
    colors: [&'s Palette; 2],
    tolerance: f64,
}

/// An element of a drawing.
trait Element {
    /// Whether it hardly differs from another one.
    fn is_near(&self, other: &Self, pair: &Pair) -> bool;

    /// Whether it is too small to be missed.
    fn is_small(&self, tolerance: f64) -> bool;
}

impl Pair<'_> {
    /// Whether the elements of two lists in their order are counterparts, but for small ones.
    fn all<E: Element>(&self, a: &[E], b: &[E]) -> bool {
        let (mut i, mut j) = (0, 0);
        loop {
            match (a.get(i), b.get(j)) {
                (None, None) => return true,
                (Some(x), Some(y)) if x.is_near(y, self) => (i, j) = (i + 1, j + 1),
                // In a plant that grows, the younger drawing lacks what the older one has.
                (_, Some(y)) if y.is_small(self.tolerance) => j += 1,
                (Some(x), _) if x.is_small(self.tolerance) => i += 1,
                _ => return false,
            }
        }
    }

    fn points(&self, p: Point, q: Point) -> bool {
        (p - q).norm_squared() <= self.tolerance * self.tolerance
    }

    fn widths(&self, a: Width, b: Width) -> bool {
        match (a, b) {
            (Width::Set(a), Width::Set(b)) => (a - b).abs() <= 2.0 * self.tolerance,
            (a, b) => a == b,
        }
    }

    fn shades(&self, a: MaterialId, b: MaterialId) -> bool {
        let [a, b] = [self.colors[0].get(a).color, self.colors[1].get(b).color];
        let near = |a: u8, b: u8| a.abs_diff(b) <= SHADE;
        near(a.red, b.red) && near(a.green, b.green) && near(a.blue, b.blue)
    }
}

/// Whether all points are near to the first.
fn is_one_point(mut points: impl Iterator<Item = Point>, tolerance: f64) -> bool {
    let Some(first) = points.next() else { return true };
    points.all(|p| (p - first).norm() <= tolerance)
}

/// Segments of one axis, each of which continues the one before.
struct Chain<'s>(&'s [Segment]);

/// The axes of a drawing, in their order: how they are cut into segments does not matter.
fn chains(segments: &[Segment]) -> Vec<Chain<'_>> {
    let mut chains = Vec::new();
    let mut first = 0;
    for next in 1..=segments.len() {
        if segments.get(next).is_none_or(|segment| segment.follows != Some(next - 1)) {
            chains.push(Chain(&segments[first..next]));
            first = next;
        }
    }
    chains
}

impl Chain<'_> {
    /// Whether each corner of it is at the same place of another one, in their order.
    fn is_along(&self, other: &Chain, pair: &Pair, is_swapped: bool) -> bool {
        let mut place = 0;
        let mut follow = |at: Point, width: Width, material: MaterialId| {
            let found = other.0[place..].iter().position(|segment| {
                let length = (segment.end - segment.start).norm();
                let along = (at - segment.start).dot(&segment.direction).clamp(0.0, length);
                let part = if length > 0.0 { along / length } else { 0.0 };
                let materials =
                    if is_swapped { (segment.material, material) } else { (material, segment.material) };
                pair.points(at, segment.start + segment.direction * along)
                    && pair.widths(width, mixed(segment.widths, part))
                    && pair.shades(materials.0, materials.1)
            });
            place += found.unwrap_or(0);
            found.is_some()
        };
        self.0.iter().all(|segment| {
            let Segment { start, end, widths, material, .. } = *segment;
            follow(start, widths[0], material) && follow(end, widths[1], material)
        })
    }
}

/// The width at a part of the way.
fn mixed([a, b]: [Width; 2], part: f64) -> Width {
    match (a, b) {
        (Width::Set(a), Width::Set(b)) => Width::Set(a + (b - a) * part),
        (a, b) => {
            if part < 0.5 {
                a
            } else {
                b
            }
        }
    }
}

impl Element for Chain<'_> {
    fn is_near(&self, other: &Self, pair: &Pair) -> bool {
        let ends =
            |chain: &Self| chain.0.first().zip(chain.0.last()).map(|(a, b)| (a.start, b.end, a.contour));
        let Some(((a, b, contour), (c, d, of_other))) = ends(self).zip(ends(other)) else { return false };
        contour == of_other
            && pair.points(a, c)
            && pair.points(b, d)
            && self.is_along(other, pair, false)
            && other.is_along(self, pair, true)
    }

    fn is_small(&self, tolerance: f64) -> bool {
        let is_thin = |segment: &Segment| segment.widths.iter().all(|w| w.resolve(0.0) <= 2.0 * tolerance);
        let points = self.0.iter().flat_map(|segment| [segment.start, segment.end]);
        self.0.iter().all(is_thin) && is_one_point(points, tolerance)
    }
}

impl Element for Patch {
    fn is_near(&self, other: &Patch, pair: &Pair) -> bool {
        let mut both = self.net.iter().flatten().zip(other.net.iter().flatten());
        both.all(|(p, q)| pair.points(*p, *q)) && pair.shades(self.material, other.material)
    }

    fn is_small(&self, tolerance: f64) -> bool {
        is_one_point(self.net.iter().flatten().copied(), tolerance)
    }
}

impl Element for Surface {
    fn is_near(&self, other: &Surface, pair: &Pair) -> bool {
        let is_same = std::sync::Arc::ptr_eq(&self.mesh, &other.mesh);
        let tints = match (self.tint, other.tint) {
            (Some(a), Some(b)) => pair.shades(a, b),
            (a, b) => a == b,
        };
        let corners = |surface: &Surface| self.mesh.bounds().map(|bounds| surface.placement.corners(bounds));
        let is_near = match corners(self).zip(corners(other)) {
            Some((a, b)) => a.into_iter().zip(b).all(|(p, q)| pair.points(p, q)),
            None => true,
        };
        is_same && tints && is_near
    }

    fn is_small(&self, tolerance: f64) -> bool {
        let corners = self.mesh.bounds().map(|bounds| self.placement.corners(bounds));
        corners.is_none_or(|corners| is_one_point(corners.into_iter(), tolerance))
    }
}

impl Element for Polygon {
    fn is_near(&self, other: &Polygon, pair: &Pair) -> bool {
        self.vertices.len() == other.vertices.len()
            && self.vertices.iter().zip(&other.vertices).all(|(p, q)| pair.points(*p, *q))
            && pair.shades(self.material, other.material)
    }

    fn is_small(&self, tolerance: f64) -> bool {
        is_one_point(self.vertices.iter().copied(), tolerance)
    }
}
