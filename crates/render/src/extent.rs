//! Extents of scenes in a view: convex outlines, tight enough to place a camera by them.
//!
//! A box is enough for an orthographic picture. The distance of a perspective camera depends on which
//! parts are near, so here the shadows on the view's planes x, z and y, z are bounded by sixteen lines each (the
//! support function of the shadow, at every 22.5 degrees). Such bounds are exact along the axes, merge in
//! any order to the same bits, and grow by a radius by adding it.

use std::array::from_fn;

use super::View;
use dlsys_geometry::scene::{Point, Reach, Scene, Width, sin_cos_degrees};

/// Lines around a shadow.
const LINES: usize = 16;
/// Angle between neighbouring lines, in degrees.
const STEP: f64 = 360.0 / LINES as f64;

/// A convex outline in the plane of `a` (x or y of the view) and z: for each direction at `STEP * k` degrees
/// from `a` towards z, its support function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outline([f64; LINES]);

impl Outline {
    const EMPTY: Outline = Outline([f64::NEG_INFINITY; LINES]);

    fn include(&mut self, a: f64, z: f64, radius: f64, directions: &[(f64, f64); LINES / 2]) {
        for (k, (sin, cos)) in directions.iter().enumerate() {
            let reach = a * cos + z * sin;
            self.0[k] = self.0[k].max(reach + radius);
            self.0[k + LINES / 2] = self.0[k + LINES / 2].max(radius - reach);
        }
    }

    /// Whether a point is within all lines, by more than rounding.
    fn encloses(&self, a: f64, z: f64, directions: &[(f64, f64); LINES / 2]) -> bool {
        let slack = 1e-12 * (a.abs() + z.abs());
        directions.iter().enumerate().all(|(k, (sin, cos))| {
            let reach = a * cos + z * sin;
            reach + slack < self.0[k] && slack - reach < self.0[k + LINES / 2]
        })
    }

    /// Includes another outline, widened by a radius.
    fn merge(&mut self, other: &Outline, radius: f64) {
        for (mine, reach) in self.0.iter_mut().zip(other.0) {
            *mine = mine.max(reach + radius);
        }
    }

    fn is_empty(&self) -> bool {
        self.0[0] == f64::NEG_INFINITY
    }

    /// Least and greatest value on the first axis.
    pub(super) fn range(&self) -> [f64; 2] {
        [-self.0[LINES / 2], self.0[0]]
    }

    /// Least and greatest z.
    pub(super) fn depth(&self) -> [f64; 2] {
        [-self.0[3 * LINES / 4], self.0[LINES / 4]]
    }

    /// Corners of the polygon that the lines enclose, `[a, z]`.
    pub(super) fn corners(&self) -> [[f64; 2]; LINES] {
        let (sin_step, cos_step) = sin_cos_degrees(STEP);
        from_fn(|k| {
            let (here, next) = (self.0[k], self.0[(k + 1) % LINES]);
            let (sin, cos) = sin_cos_degrees(STEP * k as f64);
            let along = (next - here * cos_step) / sin_step;
            [here * cos - along * sin, here * sin + along * cos]
        })
    }
}

/// Outlines in both planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shadow {
    /// In the plane of x and z.
    pub(super) x: Outline,
    /// In the plane of y and z.
    pub(super) y: Outline,
}

impl Shadow {
    const EMPTY: Shadow = Shadow { x: Outline::EMPTY, y: Outline::EMPTY };

    /// The shadow, in a view, of all that a profile passes when it turns round the axis y: see [`Extent::profile`].
    pub(super) fn of_profile(profile: &Shadow, view: &View) -> Shadow {
        let (sin, cos) = view.inclination();
        let mut shadow = Shadow::EMPTY;
        for [radius, height] in profile.x.corners() {
            for k in 0..LINES {
                // The support function of a level circle about the axis.
                let (s, c) = sin_cos_degrees(STEP * k as f64);
                let x = height * sin * s + radius.abs() * c.hypot(cos * s);
                let y = height * (cos * c + sin * s) + radius.abs() * (cos * s - sin * c).abs();
                shadow.x.0[k] = shadow.x.0[k].max(x);
                shadow.y.0[k] = shadow.y.0[k].max(y);
            }
        }
        shadow
    }

    fn merge(&mut self, other: &Shadow, radius: f64) {
        self.x.merge(&other.x, radius);
        self.y.merge(&other.y, radius);
    }
}

/// The extent of one or more scenes in a view, before the default width of lines is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Extent {
    /// Least and greatest z of all points, widths not counted.
    depth: [f64; 2],
    /// Everything whose width is known.
    known: Shadow,
    /// Points of lines of default width, and the widest of these.
    styled: Shadow,
    factor: f64,
}

impl Extent {
    pub(super) const EMPTY: Extent = Extent {
        depth: [f64::INFINITY, f64::NEG_INFINITY],
        known: Shadow::EMPTY,
        styled: Shadow::EMPTY,
        factor: 0.0,
    };

    /// The extent of one scene.
    pub(super) fn of(scene: &Scene, view: &View) -> Extent {
        Extent::seen(scene, |p| view.see(p))
    }

    /// The extent of one scene in the plane of the distance from the axis y (as x) and of the height (as z).
    pub(super) fn profile(scene: &Scene) -> Extent {
        Extent::seen(scene, |p| Point::new(p.x.hypot(p.z), 0.0, p.y))
    }

    fn seen(scene: &Scene, see: impl Fn(Point) -> Point) -> Extent {
        let directions: [(f64, f64); LINES / 2] = from_fn(|k| sin_cos_degrees(STEP * k as f64));
        let mut seen = Seen { extent: Extent::EMPTY, see, directions };
        scene.reach(&mut seen);
        seen.extent
    }

    /// Includes another extent in the same view.
    pub(super) fn merge(&mut self, other: &Extent) {
        self.depth = [self.depth[0].min(other.depth[0]), self.depth[1].max(other.depth[1])];
        self.known.merge(&other.known, 0.0);
        self.styled.merge(&other.styled, 0.0);
        self.factor = self.factor.max(other.factor);
    }

    /// Outlines around everything, lines having their width; `None` if there is nothing.
    pub(super) fn shadow(&self, default_width: f64) -> Option<Shadow> {
        let mut all = self.known;
        all.merge(&self.styled, self.factor * default_width / 2.0);
        (!all.x.is_empty()).then_some(all)
    }

    /// Least and greatest z of all points, widths not counted; `None` if there is nothing.
    pub(super) fn depth(&self) -> Option<[f64; 2]> {
        (self.depth[0] <= self.depth[1]).then_some(self.depth)
    }
}

/// An extent that grows.
struct Seen<S> {
    extent: Extent,
    see: S,
    directions: [(f64, f64); LINES / 2],
}

impl<S: Fn(Point) -> Point> Reach for Seen<S> {
    fn covers(&self, rough: impl Iterator<Item = Point>) -> bool {
        let [far, near] = self.extent.depth;
        let known = &self.extent.known;
        let mut rough = rough;
        rough.all(|p| {
            let p = (self.see)(p);
            far < p.z
                && p.z < near
                && known.x.encloses(p.x, p.z, &self.directions)
                && known.y.encloses(p.y, p.z, &self.directions)
        })
    }

    fn include(&mut self, p: Point, width: Width) {
        let (extent, p) = (&mut self.extent, (self.see)(p));
        let include = |shadow: &mut Shadow, radius: f64| {
            shadow.x.include(p.x, p.z, radius, &self.directions);
            shadow.y.include(p.y, p.z, radius, &self.directions);
        };
        match width {
            Width::Set(width) => include(&mut extent.known, width / 2.0),
            Width::Default(factor) => {
                include(&mut extent.styled, 0.0);
                extent.factor = extent.factor.max(factor);
            }
        }
        extent.depth = [extent.depth[0].min(p.z), extent.depth[1].max(p.z)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_enclose_their_points_and_touch_them() {
        let directions: [(f64, f64); LINES / 2] = from_fn(|k| sin_cos_degrees(STEP * k as f64));
        let points = [[1.0, 2.0], [-3.0, 0.5], [0.2, -1.0], [2.0, 0.0]];
        let mut outline = Outline::EMPTY;
        for [a, z] in points {
            outline.include(a, z, 0.0, &directions);
        }
        assert_eq!((outline.range(), outline.depth()), ([-3.0, 2.0], [-1.0, 2.0]));
        let corners = outline.corners();
        for (i, [a, z]) in corners.iter().enumerate() {
            let [b, w] = corners[(i + 1) % LINES];
            for [x, y] in points {
                let inside = (b - a) * (y - z) - (w - z) * (x - a);
                assert!(inside > -1e-12, "{x},{y} is beyond side {i}");
            }
        }
        // No more than a sixteen-sided shape must be.
        assert!(corners.iter().all(|[a, z]| (-3.01..=2.01).contains(a) && (-1.01..=2.01).contains(z)));
    }

    #[test]
    fn radii_widen_all_round() {
        let directions: [(f64, f64); LINES / 2] = from_fn(|k| sin_cos_degrees(STEP * k as f64));
        let (mut wide, mut thin, mut widened) = (Outline::EMPTY, Outline::EMPTY, Outline::EMPTY);
        for [a, z] in [[0.0, 0.0], [1.0, 3.0]] {
            wide.include(a, z, 0.5, &directions);
            thin.include(a, z, 0.0, &directions);
        }
        widened.merge(&thin, 0.5);
        for (a, b) in wide.0.iter().zip(widened.0) {
            assert!((a - b).abs() < 1e-15);
        }
        assert_eq!(Extent::EMPTY.shadow(1.0), None);
        assert_eq!(Extent::EMPTY.depth(), None);
    }
}
