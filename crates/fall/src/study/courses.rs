//! Solids on given ways, for exact cases and random passes.

use std::sync::Arc;

use dlsys_solid::{Attitude, Meeting, Path, Shape};

use crate::{Error, Obstacle, Obstacles, Span, Surface, Vector};

/// Seconds of a span.
const TICK: f64 = 1.0 / 64.0;

/// Where the origin of a solid is at a time (m), and its angle about its axis (rad).
type Way = Box<dyn Fn(f64) -> (Vector, f64) + Sync>;

/// A solid on a way.
pub(super) struct Course {
    /// Its corners and the radius of its rounding, where its angle is 0.
    corners: Vec<Vector>,
    radius: f64,
    axis: Vector,
    surface: Surface,
    way: Way,
}

impl Course {
    pub(super) fn new(corners: Vec<Vector>, radius: f64, surface: Surface) -> Course {
        let way = Box::new(|_| (Vector::zeros(), 0.0));
        Course { corners, radius, axis: Vector::z(), surface, way }
    }

    /// A plate across the y axis, from -half to half along x and z.
    pub(super) fn plate(half: f64, surface: Surface) -> Course {
        Course::cuboid(Vector::new(half, 0.0, half), surface)
    }

    /// A box with half-extents.
    pub(super) fn cuboid(half: Vector, surface: Surface) -> Course {
        let sign = |k: u32, bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let corner = |k| half.component_mul(&Vector::new(sign(k, 0), sign(k, 1), sign(k, 2)));
        Course::new((0..8).map(corner).collect(), 0.0, surface)
    }

    /// The same on a way, turned about an axis.
    pub(super) fn on(self, axis: Vector, way: impl Fn(f64) -> (Vector, f64) + Sync + 'static) -> Course {
        Course { axis, way: Box::new(way), ..self }
    }

    fn obstacle(&self, number: u64, begin: f64, is_new: bool) -> Result<Obstacle, Error> {
        let (_, first) = (self.way)(begin);
        let turn = Attitude::from_scaled_axis(self.axis * first);
        let shape = Shape::hull(self.corners.iter().map(|corner| turn * corner).collect(), self.radius)?;
        let places = Path::INSTANTS.map(|part| (self.way)(begin + part * TICK));
        let turns = places.map(|(_, angle)| self.axis * (angle - first));
        let path = Path::through((begin, TICK), places.map(|place| place.0), turns);
        Ok(Obstacle { number, parts: Arc::from([shape]), path, surface: self.surface, is_new })
    }

    /// A point of the world in the axes of the solid at a time.
    pub(super) fn local(&self, point: Vector, time: f64) -> Vector {
        let (origin, angle) = (self.way)(time);
        Attitude::from_scaled_axis(self.axis * -angle) * (point - origin)
    }

    /// Distance of a point in the axes of the solid from its surface; negative inside a box.
    pub(super) fn distance(&self, point: &Vector) -> f64 {
        let away = Meeting::of(&[*point], &self.corners).way.norm();
        if away > 0.0 {
            return away - self.radius;
        }
        let most = self.corners.iter().fold(Vector::zeros(), |most: Vector, corner| most.sup(&corner.abs()));
        -(most - point.abs()).min() - self.radius
    }
}

/// Solids on their ways.
pub(super) struct Courses(pub(super) Vec<Course>);

impl Obstacles for Courses {
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, Error> {
        let begin = libm::floor(time / TICK) * TICK;
        let solid = |(number, course): (u64, &Course)| course.obstacle(number, begin, false);
        let solids = (0..).zip(&self.0).map(solid).collect::<Result<_, _>>()?;
        Ok(Some(Arc::new(Span::new(begin, begin + TICK, solids)?)))
    }
}
