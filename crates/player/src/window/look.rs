//! From where the plant is looked at, and what of it is in the picture.

use dlsys_geometry::scene::{MaterialId, Owner, Point, Polygon, Scene, Vector};
use dlsys_render::{Fit, Page, Picture, Size, Survey, View};
use dlsys_tree::Lineage;

/// Field of view in perspective, in degrees.
const FIELD: f64 = 30.0;
/// Room around the plant when all of it is shown.
const MARGIN: f64 = 1.08;

/// What a look is relative to: the space that the plant takes up in its whole life.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// Opposite corners of the box around everything, in scene units.
    pub corners: [Point; 2],
    /// Of a line of default width, in scene units.
    pub default_width: f64,
    /// Azimuth and elevation of the camera that the model declares for its first frame, in degrees; else those of the front.
    pub front: [f64; 2],
}

impl Default for Space {
    fn default() -> Space {
        Space {
            corners: [Point::new(-0.5, -0.5, -0.5), Point::new(0.5, 0.5, 0.5)],
            default_width: 0.01,
            front: [0.0; 2],
        }
    }
}

impl Space {
    /// What a survey has found; a cube if that is nothing.
    pub fn of(survey: &Survey) -> Space {
        let fit = survey.fit();
        let front = survey.first_surroundings().camera.map_or([0.0; 2], |at| {
            let away = at.eye - at.aim;
            [away.x.atan2(away.z), away.y.atan2(away.x.hypot(away.z))].map(f64::to_degrees)
        });
        let default_width = fit.default_width;
        fit.bounds.map_or_else(Space::default, |corners| Space { corners, default_width, front })
    }

    fn middle(&self) -> Point {
        nalgebra::center(&self.corners[0], &self.corners[1])
    }

    fn sides(&self) -> Vector {
        self.corners[1] - self.corners[0]
    }

    /// A thing that takes up the whole space, to place cameras by.
    fn as_scene(&self) -> Scene {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "space".into(), lineage: Lineage::of_axiom(0) });
        let [low, high] = self.corners;
        let level = |y: f64| {
            [(low.x, low.z), (high.x, low.z), (high.x, high.z), (low.x, high.z)]
                .map(|(x, z)| Point::new(x, y, z))
        };
        for y in [low.y, high.y] {
            scene.polygons.push(Polygon { vertices: level(y).to_vec(), material: MaterialId::LEAF, owner });
        }
        scene
    }
}

/// A direction of view, what is in the middle, and how large it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// Degrees, as of [`View`].
    pub azimuth: f64,
    pub elevation: f64,
    pub perspective: bool,
    /// In the middle of the picture, beside the middle of the space; scene units.
    target: Vector,
    zoom: f64,
    /// Half of the width and height that the space has from where it was looked at when all of it was shown: kept while the plant is
    /// turned, so that it does not change its size then.
    reach: [f64; 2],
}

impl Viewpoint {
    /// At everything, from a side.
    pub fn at(space: &Space, azimuth: f64, elevation: f64, perspective: bool) -> Viewpoint {
        let mut look = Viewpoint {
            azimuth,
            elevation,
            perspective,
            target: Vector::zeros(),
            zoom: 1.0,
            reach: [1.0; 2],
        };
        let [right, up, towards] = look.axes();
        let sides = space.sides();
        let half = |axis: Vector| axis.abs().dot(&sides) / 2.0;
        // What is nearer than the middle is seen larger.
        let nearer = if perspective { half(towards) * (FIELD / 2.0).to_radians().tan() } else { 0.0 };
        let least = sides.norm().max(f64::MIN_POSITIVE) / 50.0;
        look.reach = [right, up].map(|axis| MARGIN * (half(axis).max(least) + nearer));
        look
    }

    /// Right, up and towards the viewer.
    fn axes(&self) -> [Vector; 3] {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        [
            Vector::new(cos_a, 0.0, -sin_a),
            Vector::new(-sin_a * sin_e, cos_e, -cos_a * sin_e),
            Vector::new(sin_a * cos_e, sin_e, cos_a * cos_e),
        ]
    }

    /// Turns the plant by degrees.
    pub fn orbit(&mut self, right: f64, up: f64) {
        self.azimuth = (self.azimuth - right).rem_euclid(360.0);
        self.elevation = (self.elevation + up).clamp(-90.0, 90.0);
    }

    /// Half of the height of the picture, in scene units.
    fn half_height(&self, aspect: f64) -> f64 {
        self.reach[1].max(self.reach[0] / aspect) / self.zoom
    }

    /// Moves the plant by parts of the height of the picture, which is `aspect` times as wide as high.
    pub fn pan(&mut self, x: f64, y: f64, aspect: f64) {
        let [right, up, _] = self.axes();
        self.target -= (right * x + up * y) * (2.0 * self.half_height(aspect));
    }

    /// Makes things larger and keeps what is at this place (from the middle, in parts of the height) where it is.
    pub fn magnify(&mut self, factor: f64, x: f64, y: f64, aspect: f64) {
        let before = self.zoom;
        self.zoom = (before * factor).clamp(0.1, 1000.0);
        let change = self.zoom / before;
        self.pan(x - x * change, y - y * change, aspect);
    }

    /// The camera, and the page of so many pixels that it fills. What is drawn is within `slack` pixels of what it should be.
    pub fn camera(&self, space: &Space, pixels: [u32; 2], slack: f64) -> (Fit, Page) {
        let view = View::new(self.azimuth, self.elevation).unwrap_or(View::FRONT);
        let survey = Survey::new(view);
        let mut survey = if self.perspective { survey.with_perspective(FIELD) } else { survey };
        survey.add(&space.as_scene());
        let mut fit = survey.fit();
        let [width, height] = pixels.map(|side| f64::from(side.max(1)));
        let half = self.half_height(width / height);
        fit.default_width = space.default_width;
        fit.accuracy = slack * 2.0 * half / height;
        // Looking at a place beside the middle moves the picture, not the eye.
        let middle = fit.camera.project(space.middle());
        let [right, up, _] = self.axes();
        let at = [middle.x + right.dot(&self.target), middle.y + up.dot(&self.target)];
        let wide = half * width / height;
        let picture = Picture { area: [at[0] - wide, at[1] - half, 2.0 * wide, 2.0 * half], scale: 1.0 };
        let pixels = pixels.map(|side| side.clamp(1, Page::MOST_ON_A_SIDE));
        let page = Page::new(picture, Size::Exact(pixels[0], pixels[1]), Some(Page::BACKGROUND))
            .unwrap_or_else(|_| Page::usual(picture));
        (fit, page)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a point comes to lie, from the middle of the picture, in parts of its height.
    fn seen(look: &Viewpoint, space: &Space, p: Point) -> [f64; 2] {
        let (fit, page) = look.camera(space, [300, 200], 0.5);
        let [left, bottom, width, height] = page.picture.area;
        let at = fit.camera.project(p);
        [(at.x - left - width / 2.0) / height, (at.y - bottom - height / 2.0) / height]
    }

    #[test]
    fn everything_is_in_the_picture_from_every_side() {
        let space = Space {
            corners: [Point::new(1.0, 0.0, -1.0), Point::new(3.0, 9.0, 1.0)],
            default_width: 0.1,
            front: [0.0; 2],
        };
        for perspective in [false, true] {
            for (azimuth, elevation) in [(0.0, 0.0), (90.0, 0.0), (0.0, 90.0), (30.0, 20.0), (200.0, -50.0)] {
                let look = Viewpoint::at(&space, azimuth, elevation, perspective);
                for i in 0..8 {
                    let corner = |k: usize| space.corners[i >> k & 1][k];
                    let [x, y] = seen(&look, &space, Point::new(corner(0), corner(1), corner(2)));
                    assert!(x.abs() < 0.75 && y.abs() < 0.5, "{azimuth} {elevation} {perspective}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn what_is_under_the_pointer_stays_there() {
        let space = Space::default();
        let mut look = Viewpoint::at(&space, 20.0, 10.0, false);
        let point = Point::new(0.2, -0.1, 0.3);
        let [x, y] = seen(&look, &space, point);
        look.magnify(3.0, x, y, 1.5);
        let after = seen(&look, &space, point);
        assert!((after[0] - x).abs() < 1e-9 && (after[1] - y).abs() < 1e-9);
        look.pan(0.25, -0.5, 1.5);
        let moved = seen(&look, &space, point);
        assert!((moved[0] - x - 0.25).abs() < 1e-9 && (moved[1] - y + 0.5).abs() < 1e-9);
        look.orbit(30.0, 500.0);
        assert_eq!((look.azimuth, look.elevation), (350.0, 90.0));
        let (fit, _) = look.camera(&space, [0, 0], 0.5);
        assert!(fit.accuracy > 0.0 && fit.accuracy.is_finite());
    }
}
