//! The light in which pictures are drawn unless a model or a flag declares another ([`lighting`](super::lighting)), the same in SVG and PNG.
//!
//! One lamp, up on the left behind the viewer, fixed to the camera; light from all directions, more of it from above; a gloss; and things
//! get darker with their distance. Through leaves and petals light comes from behind, so their undersides are not dark. A surface that
//! faces the viewer at the front of the plant keeps its colour. So does everything in a flat drawing: light comes up as the drawing gains
//! depth, so that it does not come on at once in an animation.

use dlsys_geometry::scene::{Point, Vector};

/// Direction to the lamp: to the right, up, towards the viewer. Of unit length.
pub(super) const LAMP: Vector = Vector::new(-0.36, 0.583, 0.728_361_861);
/// The weight of the lamp's direction, beside light from all directions.
const DIFFUSE: f64 = 0.48;
/// How far the lamp's light reaches around a surface, as that of a wide lamp: the cosine beyond a right angle.
const WRAP: f64 = 0.25;
/// The part that comes through a leaf of what the other side has more of the light.
pub(super) const TRANSMITTED: f64 = 0.55;
/// One over the length of the sum of the unit vectors to the lamp and to the viewer.
const HALF: f64 = 0.537_858_04;
/// How much lighter what faces up is than what faces the viewer.
const ABOVE: f64 = 0.08;
/// Strength and sharpness of the gloss (Blinn 1977).
pub(super) const GLOSS: f64 = 0.16;
pub(super) const SHARPNESS: i32 = 24;
/// Light that is lost from the nearest to the farthest.
const DISTANCE: f64 = 0.16;
/// Depths, in parts of the extent, from which relief and distance are drawn in full.
const RELIEF_FROM: f64 = 0.02;
const DISTANCE_FROM: f64 = 0.2;

/// A place on a surface that is to be shaded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// The unit normal of the side that is seen: to the right, up, towards the viewer.
    pub(super) normal: Vector,
    /// Where it is, as the camera projects it.
    pub(super) seen: Point,
    /// Light comes through it.
    pub(super) is_thin: bool,
}

/// Light on an animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// How much of the relief is drawn, from 0 (flat) to 1.
    relief: f64,
    /// Light that is lost for a unit of depth.
    falloff: f64,
    near: f64,
}

impl Light {
    /// The light on things between these depths, the greater one nearer; `extent` is the largest side of the whole, in scene units. Where
    /// light or a floor `is_declared`, relief is drawn in full.
    pub(super) fn new([far, near]: [f64; 2], extent: f64, is_declared: bool) -> Light {
        let depth = if extent > 0.0 { ((near - far) / extent).max(0.0) } else { 0.0 };
        let falloff =
            if depth > 0.0 { DISTANCE * (depth / DISTANCE_FROM).min(1.0) / (near - far) } else { 0.0 };
        let relief = if is_declared { 1.0 } else { (depth / RELIEF_FROM).min(1.0) };
        Light { relief, falloff, near }
    }

    /// Whether light makes a difference at all.
    pub(super) fn is_flat(&self) -> bool {
        self.relief == 0.0
    }

    /// How much of the relief is drawn, from 0 (flat) to 1.
    pub(super) fn relief(&self) -> f64 {
        self.relief
    }

    /// Strength of light, 1 leaving a colour as it is, on something with a unit normal that is turned to the viewer (to
    /// the right, up, towards the viewer) at a depth.
    pub(super) fn strength(&self, normal: Vector, depth: f64) -> f64 {
        self.at_depth(depth) + self.of_normal(normal, false)
    }

    /// The same at a spot, which light may come through.
    pub(super) fn strength_at(&self, spot: &Spot) -> f64 {
        self.at_depth(spot.seen.z) + self.of_normal(spot.normal, spot.is_thin)
    }

    /// The part that depends on the direction.
    pub(super) fn of_normal(&self, normal: Vector, is_thin: bool) -> f64 {
        // Half-way between the lamp and the viewer.
        let half = Vector::new(LAMP.x, LAMP.y, LAMP.z + 1.0) * HALF;
        let gloss = normal.dot(&half).max(0.0).powi(SHARPNESS) - half.z.powi(SHARPNESS);
        let around = |cos: f64| ((cos + WRAP) / (1.0 + WRAP)).max(0.0);
        let on_side = |cos: f64, up: f64| DIFFUSE * (around(cos) - around(LAMP.z)) + ABOVE * up;
        let cos = normal.dot(&LAMP);
        let lit = on_side(cos, normal.y);
        // All that lights the other side comes through, the light from above as well as the lamp's.
        let more = if is_thin { (on_side(-cos, -normal.y) - lit).max(0.0) } else { 0.0 };
        self.relief * (lit + TRANSMITTED * more + GLOSS * gloss)
    }

    /// The part that is left at a depth.
    pub(super) fn at_depth(&self, depth: f64) -> f64 {
        1.0 - self.falloff * (self.near - depth).max(0.0)
    }

    /// Strength of light across a stem that runs in this direction (to the right, up, towards the viewer; any length)
    /// from its left edge, looking along it, to its right edge, at places from -1 to 1. The second direction is that from the stem to the
    /// eye: in perspective, what is beside the middle of the picture is seen from its side.
    pub(super) fn across<const N: usize>(
        &self,
        [along, towards]: [Vector; 2],
        depth: f64,
        places: [f64; N],
    ) -> [f64; N] {
        normals_across([along, towards], places).map(|normal| self.strength(normal, depth))
    }
}

/// Unit normals of the visible side of a stem that runs in the first direction and is seen from the second, at places from -1, its left
/// edge, to 1.
pub(super) fn normals_across<const N: usize>([along, towards]: [Vector; 2], places: [f64; N]) -> [Vector; N] {
    let left = towards.cross(&along).try_normalize(1e-9).unwrap_or_else(Vector::y);
    // Towards the viewer, across the stem and its left.
    let facing = along.cross(&left).try_normalize(0.0).unwrap_or_else(Vector::z);
    let facing = if facing.dot(&towards) < 0.0 { -facing } else { facing };
    places.map(|s| left * -s + facing * (1.0 - s * s).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_drawings_keep_their_colours() {
        let light = Light::new([0.0, 0.0], 10.0, false);
        assert!(light.is_flat());
        assert_eq!(light.strength(LAMP, 0.0), 1.0);
        assert_eq!(light.across([Vector::x(), Vector::z()], 0.0, [-1.0, 0.0, 1.0]), [1.0; 3]);
    }

    #[test]
    fn light_that_comes_through_a_leaf_is_a_part_of_that_on_its_other_side() {
        let light = Light::new([-5.0, 5.0], 10.0, false);
        let of = |x: f64, y: f64, z: f64, is_thin: bool| {
            light.of_normal(Vector::new(x, y, z).normalize(), is_thin)
        };
        // The underside of a petal that opens upwards and is seen from a little below, and a leaf that hangs towards the viewer.
        for (x, y, z) in [(0.0, -0.9, 0.4), (0.0, -1.0, 0.1), (0.4, -0.8, 0.5)] {
            let (above, below, opaque) = (of(-x, -y, -z, true), of(x, y, z, true), of(x, y, z, false));
            assert!(opaque + 0.08 < below && below < above, "{opaque} {below} {above}");
        }
        // The lit side is that of a stem.
        assert_eq!(of(-0.2, 0.9, 0.4, true), of(-0.2, 0.9, 0.4, false));
    }

    #[test]
    fn light_comes_from_the_upper_left_and_fades_with_distance() {
        assert!((LAMP.norm() - 1.0).abs() < 1e-9);
        let light = Light::new([-5.0, 5.0], 10.0, false);
        assert_eq!(light.strength(Vector::z(), 5.0), 1.0);
        assert!((light.strength(Vector::z(), -5.0) - 0.84).abs() < 1e-12);
        let lit = |x: f64, y: f64| light.strength(Vector::new(x, y, 0.0), 5.0);
        assert!(lit(-1.0, 0.0) > lit(1.0, 0.0) && lit(0.0, 1.0) > lit(0.0, -1.0));
        // A stem that grows upwards: its left is the lighter side.
        let [left, right] = light.across([Vector::y(), Vector::z()], 5.0, [-0.8, 0.8]);
        assert!(left > right && right < 1.0, "{left} {right}");
        // On the right of the picture it is seen from its left.
        let [aside] = light.across([Vector::y(), Vector::new(-0.5, 0.0, 0.8)], 5.0, [0.0]);
        let [ahead] = light.across([Vector::y(), Vector::z()], 5.0, [0.0]);
        assert!(aside > ahead, "{aside} {ahead}");
    }
}
