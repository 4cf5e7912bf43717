//! Cameras: the position of the viewer, and the projection of points to a picture.
//!
//! A camera stands in the direction of its [`View`]: infinitely far away (orthographic), or at an eye
//! (perspective). Pictures have the same units either way: lengths in a plane through the middle of the plant, the plane
//! of focus, are those of the scene; what is nearer is larger by the *magnification*.

use super::View;
use super::extent::{Outline, Shadow};
use dlsys_geometry::scene::{Point, Vector};

/// A view with a projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    view: View,
    /// `None`: orthographic.
    eye: Option<Eye>,
}

/// The eye of a perspective camera, in the coordinates of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Eye {
    x: f64,
    y: f64,
    /// z of the plane of focus.
    focus: f64,
    /// From the eye to the plane of focus; greater than 0.
    distance: f64,
}

impl Eye {
    /// Nearer than this part of the distance the magnification is constant: the survey found nothing there.
    const NEAR: f64 = 1e-3;

    fn magnification(&self, z: f64) -> f64 {
        self.distance / (self.distance - (z - self.focus)).max(Eye::NEAR * self.distance)
    }
}

impl Camera {
    /// Possible fields of view, in degrees.
    pub const FIELDS: std::ops::RangeInclusive<f64> = 1.0..=120.0;
    /// The nearest point is at least this part of the plant's depth away from the eye, so that it is at most five times
    /// as large as the farthest.
    const LEAST_DISTANCE: f64 = 0.25;

    /// A camera infinitely far away.
    pub fn orthographic(view: View) -> Camera {
        Camera { view, eye: None }
    }

    /// The nearest camera that sees all that casts this shadow within an angle of `field` degrees, from
    /// side to side and from top to bottom.
    pub(super) fn perspective(view: View, field: f64, shadow: &Shadow) -> Camera {
        let slope = (field.clamp(*Camera::FIELDS.start(), *Camera::FIELDS.end()) / 2.0).to_radians().tan();
        // The two planes that enclose an outline at this angle meet in the eye.
        let meet = |outline: &Outline| {
            let reach = |sign: f64| {
                let reaches = outline.corners().map(|[a, z]| sign * a + slope * z);
                reaches.into_iter().fold(f64::NEG_INFINITY, f64::max)
            };
            let (right, left) = (reach(1.0), reach(-1.0));
            ((right - left) / 2.0, (right + left) / (2.0 * slope))
        };
        let ((x, of_x), (y, of_y)) = (meet(&shadow.x), meet(&shadow.y));
        let [far, near] = shadow.x.depth();
        let side = [shadow.x.range(), shadow.y.range(), [far, near]]
            .into_iter()
            .fold(0.0, |side: f64, [low, high]| side.max(high - low));
        let side = if side > 0.0 { side } else { 1.0 };
        let least = near + (Camera::LEAST_DISTANCE * (near - far)).max(0.01 * side);
        let focus = (far + near) / 2.0;
        let distance = of_x.max(of_y).max(least) - focus;
        Camera { view, eye: Some(Eye { x, y, focus, distance }) }
    }

    /// Where the eye is in space; `None` without perspective.
    pub(super) fn eye(&self) -> Option<Point> {
        let eye = self.eye.as_ref()?;
        Some(Point::from(self.view.space(Vector::new(eye.x, eye.y, eye.focus + eye.distance))))
    }

    /// The camera that has gone round the axis y by this angle, in degrees.
    pub(super) fn turned(self, degrees: f64) -> Camera {
        // The eye is given in the axes of the view, which turn with it.
        Camera { view: self.view.turned(degrees), ..self }
    }

    /// The unit vector from a point to the viewer.
    pub(super) fn towards(&self, p: Point) -> Vector {
        match &self.eye {
            None => self.view.towards(),
            Some(eye) => {
                let seen = self.view.see(p);
                let away = Vector::new(eye.x - seen.x, eye.y - seen.y, eye.distance - (seen.z - eye.focus));
                self.view.space(away).try_normalize(0.0).unwrap_or_else(|| self.view.towards())
            }
        }
    }

    /// The projection of a point in front of the viewer; `None` if it is behind, or too near.
    pub(super) fn ahead(&self, p: Point) -> Option<Point> {
        let is_behind =
            |eye: &Eye| eye.distance - (self.view.see(p).z - eye.focus) < Eye::NEAR * eye.distance;
        (!self.eye.as_ref().is_some_and(is_behind)).then(|| self.project(p))
    }

    /// x and y of the projection times a third number, and that number, all linear in space; the third is 1 in the plane of focus and not
    /// positive behind the viewer.
    pub(super) fn homogeneous(&self, p: Point) -> [f64; 3] {
        let p = self.view.see(p);
        match &self.eye {
            None => [p.x, p.y, 1.0],
            Some(eye) => {
                let w = (eye.distance - (p.z - eye.focus)) / eye.distance;
                [p.x - eye.x + eye.x * w, p.y - eye.y + eye.y * w, w]
            }
        }
    }

    /// A camera in perspective at an eye, its plane of focus through the aim; `None` if the two are one point.
    pub(super) fn at(eye: Point, aim: Point) -> Option<Camera> {
        let away = eye - aim;
        let distance = away.norm();
        let towards = away.try_normalize(1e-300).filter(|_| distance.is_finite())?;
        let elevation = towards.y.clamp(-1.0, 1.0).asin().to_degrees();
        let azimuth =
            if towards.x.hypot(towards.z) > 0.0 { towards.x.atan2(towards.z).to_degrees() } else { 0.0 };
        let view = View::new(azimuth, elevation).ok()?;
        let aim = view.see(aim);
        Some(Camera { view, eye: Some(Eye { x: aim.x, y: aim.y, focus: aim.z, distance }) })
    }

    /// The point in space that [`project`](Camera::project) takes here.
    pub(super) fn unproject(&self, p: Point) -> Point {
        let seen = match &self.eye {
            None => p,
            Some(eye) => {
                let larger = 1.0 + p.z / eye.distance;
                Point::new(
                    eye.x + (p.x - eye.x) / larger,
                    eye.y + (p.y - eye.y) / larger,
                    eye.focus + eye.distance * (1.0 - 1.0 / larger),
                )
            }
        };
        Point::from(self.view.space(seen.coords))
    }

    /// The ray of sight to this height of the picture, in its middle, up to the plane of focus; `None` without perspective.
    pub(super) fn sight(&self, y: f64) -> Option<Vector> {
        let eye = self.eye.as_ref()?;
        Some(self.view.space(Vector::new(0.0, y - eye.y, -eye.distance)))
    }

    /// Sine of the elevation above the horizon of what is seen at this height of the picture, in its middle; `None` without perspective.
    pub(super) fn elevation(&self, y: f64) -> Option<f64> {
        self.sight(y).map(|seen| seen.y / seen.norm())
    }

    /// The direction from the scene to the viewer.
    pub fn view(&self) -> View {
        self.view
    }

    /// The projection of a point: to the right and up in the picture, in scene units of the plane of focus; z is greater for nearer
    /// points, and linear along straight lines of the picture.
    pub fn project(&self, p: Point) -> Point {
        let p = self.view.see(p);
        match &self.eye {
            None => p,
            Some(eye) => {
                let larger = eye.magnification(p.z);
                Point::new(
                    eye.x + (p.x - eye.x) * larger,
                    eye.y + (p.y - eye.y) * larger,
                    eye.distance * (larger - 1.0),
                )
            }
        }
    }

    /// The magnification at a point with this z of [`project`](Camera::project); 1 in the plane of focus.
    pub fn magnification(&self, z: f64) -> f64 {
        self.eye.map_or(1.0, |eye| 1.0 + z / eye.distance)
    }

    /// A direction, such as that of a normal: to the right, up, and along the axis of the view towards the viewer.
    pub fn direction(&self, v: Vector) -> Vector {
        self.view.see(Point::from(v)).coords
    }

    /// The z of [`project`](Camera::project) at this z of the view.
    pub(super) fn depth(&self, z: f64) -> f64 {
        self.eye.map_or(z, |eye| eye.distance * (eye.magnification(z) - 1.0))
    }

    /// Left, bottom, right and top of what casts this shadow, in the picture.
    pub(super) fn frame(&self, shadow: &Shadow) -> [f64; 4] {
        let range = |outline: &Outline, middle: fn(&Eye) -> f64| match &self.eye {
            None => outline.range(),
            Some(eye) => {
                let seen =
                    outline.corners().map(|[a, z]| middle(eye) + (a - middle(eye)) * eye.magnification(z));
                seen.into_iter()
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], a| [low.min(a), high.max(a)])
            }
        };
        let [left, right] = range(&shadow.x, |eye| eye.x);
        let [bottom, top] = range(&shadow.y, |eye| eye.y);
        [left, bottom, right, top]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extent::Extent;
    use dlsys_geometry::scene::{MaterialId, Owner, Polygon, Scene};
    use dlsys_tree::Lineage;

    fn shadow(points: &[Point]) -> Shadow {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
        scene.polygons.push(Polygon { vertices: points.to_vec(), material: MaterialId::LEAF, owner });
        Extent::of(&scene, &View::FRONT).shadow(0.0).expect("something")
    }

    #[test]
    fn a_square_fills_its_field_of_view() {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let square = corners.map(|[x, y]| Point::new(x + 5.0, y, 3.0));
        let shadow = shadow(&square);
        let camera = Camera::perspective(View::FRONT, 90.0, &shadow);
        // At 90 degrees the eye is as far away as the square reaches to either side.
        let eye = camera.eye.expect("perspective");
        assert!((eye.distance - 1.0).abs() < 1e-12 && (eye.x - 5.0).abs() < 1e-12 && eye.y.abs() < 1e-12);
        for p in square {
            assert!((camera.project(p) - Point::new(p.x, p.y, 0.0)).norm() < 1e-12);
        }
        let frame = camera.frame(&shadow);
        assert!([4.0, -1.0, 6.0, 1.0].iter().zip(frame).all(|(a, b)| (a - b).abs() < 1e-12), "{frame:?}");
    }

    #[test]
    fn nearer_is_larger_and_straight_lines_stay_linear_in_depth() {
        let ends = [Point::new(0.0, 1.0, -2.0), Point::new(1.0, -1.0, 2.0), Point::new(0.5, 3.0, 0.0)];
        let shadow = shadow(&ends);
        let camera = Camera::perspective(View::FRONT, 40.0, &shadow);
        let [a, b, _] = ends.map(|p| camera.project(p));
        assert!(b.z > a.z && camera.magnification(b.z) > 1.0 && camera.magnification(a.z) < 1.0);
        let middle = camera.project(nalgebra::center(&ends[0], &ends[1]));
        let share = (middle.x - a.x) / (b.x - a.x);
        assert!((a.z + share * (b.z - a.z) - middle.z).abs() < 1e-12);
        assert!((camera.depth(2.0) - b.z).abs() < 1e-12);
        let [left, bottom, right, top] = camera.frame(&shadow);
        for p in ends.map(|p| camera.project(p)) {
            assert!((left..=right).contains(&(p.x)) && (bottom - 1e-12..=top + 1e-12).contains(&p.y));
        }
    }

    #[test]
    fn nothing_is_behind_the_eye() {
        // A needle that points at the viewer, and a single point: no width to place a camera by.
        for points in [vec![Point::new(2.0, 1.0, -50.0), Point::new(2.0, 1.0, 50.0)], vec![Point::origin()]] {
            let camera = Camera::perspective(View::FRONT, 60.0, &shadow(&points));
            for p in points {
                let seen = camera.project(p);
                assert!(seen.coords.iter().all(|x| x.is_finite()));
                assert!((0.4..=3.01).contains(&camera.magnification(seen.z)), "{seen}");
            }
        }
    }
}
