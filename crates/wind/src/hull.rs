//! A rounded convex body as an obstacle: all points within a radius of the convex hull of some points.

use nalgebra::{Matrix3, Vector3};

use crate::obstacle::Obstacle;

/// Most steps towards the nearest point; a few are enough, unless rounding stops the progress.
const STEPS: usize = 100;
/// The layer around a body in parts of the middle one of its half-extents, as around a [`Sphere`](crate::Sphere).
const LAYER: f64 = 0.625;

/// A body at an instant: the convex hull of points, rounded by a radius. One point is a ball, two are a capsule.
///
/// It does not depend on the time that it is asked for: a wind in which bodies move takes new ones for each instant
/// ([`Snapshot::among`](crate::Snapshot::among)). Lengths are in metres.
#[derive(Clone, Debug)]
pub struct Hull {
    points: Vec<Vector3<f64>>,
    radius: f64,
    centre: Vector3<f64>,
    /// The distance from the centre to the farthest point.
    reach: f64,
    layer: f64,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
}

impl Hull {
    /// The hull of these points, rounded by a radius; `None` unless there is a point, all coordinates are finite, and the radius is finite
    /// and greater than 0.
    pub fn new(points: Vec<Vector3<f64>>, radius: f64) -> Option<Hull> {
        let is_finite = points.iter().all(|point| point.iter().all(|x| x.is_finite()));
        if points.is_empty() || !is_finite || !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        let count = points.len() as f64;
        let centre = points.iter().sum::<Vector3<f64>>() / count;
        let reach = points.iter().map(|point| (point - centre).norm()).fold(0.0, f64::max);
        let layer = LAYER * (middle_extent(&points, centre) + radius);
        let (velocity, spin) = (Vector3::zeros(), Vector3::zeros());
        Some(Hull { points, radius, centre, reach, layer, velocity, spin })
    }

    /// A ball around it: centre and radius.
    pub fn ball(&self) -> (Vector3<f64>, f64) {
        (self.centre, self.reach + self.radius)
    }

    /// The nearest place outside, for one inside; any other place itself. Of places deep inside it is the one on the way out from the centre.
    pub fn outside(&self, place: Vector3<f64>) -> Vector3<f64> {
        let is_in = |place| self.distance(place, 0.0) < 0.0;
        if !is_in(place) {
            return place;
        }
        // Beyond rounding.
        let margin = 1e-9 * (self.reach + self.radius);
        let way = Nearest::of(&self.points, place).way;
        let distance = way.norm();
        let near = place + way * ((self.radius - distance + margin) / distance);
        if distance > 0.0 && !is_in(near) {
            return near;
        }
        let away = (place - self.centre).try_normalize(0.0).unwrap_or_else(Vector3::y);
        let (mut inner, mut outer) = (0.0, 2.0 * (self.reach + self.radius) + margin);
        for _ in 0..50 {
            let middle = 0.5 * (inner + outer);
            if is_in(place + away * middle) { inner = middle } else { outer = middle }
        }
        place + away * outer
    }

    /// The same body with the velocity of its centre in m/s and the velocity of its rotation in 1/s.
    pub fn moving(self, velocity: Vector3<f64>, spin: Vector3<f64>) -> Hull {
        Hull { velocity, spin, ..self }
    }
}

impl Obstacle for Hull {
    fn distance(&self, point: Vector3<f64>, _: f64) -> f64 {
        // Far away, the ball around the body is enough.
        let outside = (point - self.centre).norm() - self.reach - self.radius;
        if outside > 2.0 * self.layer {
            return outside;
        }
        Nearest::of(&self.points, point).way.norm() - self.radius
    }

    fn normal(&self, point: Vector3<f64>, _: f64) -> Vector3<f64> {
        let way = Nearest::of(&self.points, point).way;
        way.try_normalize(0.0).unwrap_or_else(Vector3::y)
    }

    fn velocity(&self, _: f64) -> Vector3<f64> {
        self.velocity
    }

    fn spin(&self, _: f64) -> Vector3<f64> {
        self.spin
    }

    fn centre(&self, _: f64) -> Vector3<f64> {
        self.centre
    }

    /// 5/8 of the middle one of the three half-extents.
    fn layer(&self) -> f64 {
        self.layer
    }

    fn normal_gradient(&self, point: Vector3<f64>, time: f64) -> Matrix3<f64> {
        self.bending(point, time).1
    }

    /// Over a face the normal does not turn; around an edge, it turns in one direction; around a corner, in two.
    fn bending(&self, point: Vector3<f64>, _: f64) -> (Vector3<f64>, Matrix3<f64>) {
        let Nearest { way, simplex } = Nearest::of(&self.points, point);
        let distance = way.norm();
        if distance == 0.0 {
            return (Vector3::y(), Matrix3::zeros());
        }
        let normal = way / distance;
        let across = Matrix3::identity() - normal * normal.transpose();
        let gradient = match *simplex.corners() {
            [_] => across / distance,
            [a, b] => {
                let edge = (b - a).normalize();
                (across - edge * edge.transpose()) / distance
            }
            _ => Matrix3::zeros(),
        };
        (normal, gradient)
    }
}

/// The middle one of half the extents of points along their principal axes.
fn middle_extent(points: &[Vector3<f64>], centre: Vector3<f64>) -> f64 {
    let mut spread = Matrix3::zeros();
    for point in points {
        spread += (point - centre) * (point - centre).transpose();
    }
    let axes = nalgebra::SymmetricEigen::new(spread).eigenvectors;
    let extent = |axis: Vector3<f64>| {
        let along = points.iter().map(|point| axis.dot(point));
        let (least, greatest) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        (greatest - least) / 2.0
    };
    let mut extents = [0, 1, 2].map(|k| extent(axes.column(k).into_owned()));
    extents.sort_by(f64::total_cmp);
    extents[1]
}

/// Up to four corners.
#[derive(Clone, Copy)]
struct Simplex {
    corners: [Vector3<f64>; 4],
    count: usize,
}

impl Simplex {
    fn of(corners: impl IntoIterator<Item = Vector3<f64>>) -> Simplex {
        let mut simplex = Simplex { corners: [Vector3::zeros(); 4], count: 0 };
        corners.into_iter().for_each(|corner| simplex.push(corner));
        simplex
    }

    fn push(&mut self, corner: Vector3<f64>) {
        self.corners[self.count] = corner;
        self.count += 1;
    }

    fn corners(&self) -> &[Vector3<f64>] {
        &self.corners[..self.count]
    }

    /// The point that is nearest to the origin, and the corners of the part that it lies in.
    fn nearest(&self) -> (Vector3<f64>, Simplex) {
        let mut best = (Vector3::repeat(f64::INFINITY), *self);
        for chosen in 1_u8..1 << self.count {
            let part = (0..self.count).filter(|i| chosen >> i & 1 == 1).map(|i| self.corners[i]);
            let part = Simplex::of(part);
            let found = match *part.corners() {
                [a] => Some(a),
                [a, b] => on_edge(a, b),
                [a, b, c] => on_triangle(a, b, c),
                _ => is_within(part.corners).then(Vector3::zeros),
            };
            if let Some(found) = found.filter(|found| found.norm_squared() < best.0.norm_squared()) {
                best = (found, part);
            }
        }
        best
    }
}

/// The point of a convex hull that is nearest to a place.
struct Nearest {
    /// From that point to the place; 0 within the hull.
    way: Vector3<f64>,
    /// The smallest part of the surface that the point lies in, a corner, an edge or a triangle, relative to the place.
    simplex: Simplex,
}

impl Nearest {
    /// By the method of Gilbert, Johnson and Keerthi (1988): the nearest point of a simplex of corners, which takes in a corner that is
    /// nearer as long as there is one.
    fn of(points: &[Vector3<f64>], place: Vector3<f64>) -> Nearest {
        let mut nearest = points.first().map_or_else(Vector3::zeros, |corner| corner - place);
        let mut simplex = Simplex::of([nearest]);
        for _ in 0..STEPS {
            let along = |corner: &Vector3<f64>| corner.dot(&nearest);
            let Some(next) = points.iter().min_by(|a, b| along(a).total_cmp(&along(b))) else { break };
            let next = next - place;
            let gain = nearest.norm_squared() - next.dot(&nearest);
            if gain <= 1e-14 * nearest.norm_squared() || simplex.corners().contains(&next) {
                break;
            }
            let mut larger = simplex;
            larger.push(next);
            let (found, part) = larger.nearest();
            // Rounding: there is no progress any more.
            if found.norm_squared() >= nearest.norm_squared() {
                break;
            }
            (nearest, simplex) = (found, part);
            if simplex.count == 4 {
                break;
            }
        }
        Nearest { way: -nearest, simplex }
    }
}

/// The foot of the perpendicular from the origin, if it lies between the ends.
fn on_edge(a: Vector3<f64>, b: Vector3<f64>) -> Option<Vector3<f64>> {
    let way = b - a;
    let part = -a.dot(&way) / way.norm_squared();
    (part > 0.0 && part < 1.0).then(|| a + way * part)
}

/// The same in a triangle.
fn on_triangle(a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>) -> Option<Vector3<f64>> {
    let normal = (b - a).cross(&(c - a));
    let square = normal.norm_squared();
    let foot = normal * (a.dot(&normal) / square);
    let is_left = |p: Vector3<f64>, q: Vector3<f64>| (q - p).cross(&(foot - p)).dot(&normal) > 0.0;
    (square > 0.0 && is_left(a, b) && is_left(b, c) && is_left(c, a)).then_some(foot)
}

/// True if the origin lies within a tetrahedron.
fn is_within(corners: [Vector3<f64>; 4]) -> bool {
    let volume = |[a, b, c, d]: [Vector3<f64>; 4]| (b - a).cross(&(c - a)).dot(&(d - a));
    let whole = volume(corners);
    let is_inside = |k: usize| {
        let mut part = corners;
        part[k] = Vector3::zeros();
        volume(part) * whole > 0.0
    };
    whole != 0.0 && (0..4).all(is_inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Vec<Vector3<f64>> {
        let corner = |k: i32| Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        (0..8).map(corner).collect()
    }

    /// Places in a box around the unit cube.
    fn places() -> impl Iterator<Item = Vector3<f64>> {
        let part = |k: usize, ratio: f64| (k as f64 * ratio).fract() * 4.0 - 1.5;
        (1..2000)
            .map(move |k| Vector3::new(part(k, 0.754_877_67), part(k, 0.569_840_29), part(k, 0.430_159_71)))
    }

    #[test]
    fn distances_from_a_cube_are_those_of_its_formula() {
        let body = Hull::new(cube(), 0.1).unwrap();
        for place in places() {
            let outside = place.map(|x| x - x.clamp(0.0, 1.0));
            let found = body.distance(place, 0.0);
            if outside.norm() == 0.0 {
                assert!((found + 0.1).abs() < 1e-12, "{place} {found}");
            } else if found < body.layer() {
                assert!((found - (outside.norm() - 0.1)).abs() < 1e-12, "{place} {found}");
                assert!((body.normal(place, 0.0) - outside.normalize()).norm() < 1e-10, "{place}");
            } else {
                assert!(outside.norm() - 0.1 > body.layer() - 1e-12, "{place} {found}");
            }
        }
    }

    #[test]
    fn the_way_out_of_a_cube_is_the_nearest_one_near_its_surface() {
        let body = Hull::new(cube(), 0.1).unwrap();
        for place in places() {
            let out = body.outside(place);
            let distance = body.distance(place, 0.0);
            if distance >= 0.0 {
                assert_eq!(out, place);
                continue;
            }
            assert!(body.distance(out, 0.0) >= 0.0 && body.distance(out, 0.0) < 1e-6, "{place}");
            let is_near = distance > -0.1 + 1e-9;
            assert!(!is_near || ((out - place).norm() + distance).abs() < 1e-6, "{place} {out}");
        }
    }

    #[test]
    fn normals_bend_as_differences_say() {
        let body = Hull::new(cube(), 0.1).unwrap();
        let mut compared = 0;
        for place in places() {
            let (distance, step) = (body.distance(place, 0.0), 1e-6);
            // On the border of two parts, the derivatives jump.
            let is_inner = |x: f64| x.abs() > 1e-5 && (x - 1.0).abs() > 1e-5;
            if !(0.0..body.layer()).contains(&distance) || !place.iter().all(|x| is_inner(*x)) {
                continue;
            }
            let columns: [Vector3<f64>; 3] = std::array::from_fn(|j| {
                let offset = Vector3::ith(j, step);
                (body.normal(place + offset, 0.0) - body.normal(place - offset, 0.0)) / (2.0 * step)
            });
            let error = (body.normal_gradient(place, 0.0) - Matrix3::from_columns(&columns)).norm();
            assert!(error < 1e-7, "{place} {error}");
            compared += 1;
        }
        assert!(compared > 200, "{compared}");
    }

    #[test]
    fn one_point_is_a_ball_and_flat_ones_are_a_plate() {
        let ball = Hull::new(vec![Vector3::x()], 0.5).unwrap();
        assert_eq!(ball.layer(), 0.3125);
        assert!((ball.distance(Vector3::new(1.0, 0.6, 0.0), 0.0) - 0.1).abs() < 1e-15);
        let square = cube().into_iter().filter(|corner| corner.y == 0.0).collect();
        let plate = Hull::new(square, 0.02).unwrap();
        assert!((plate.layer() - 0.625 * 0.52).abs() < 1e-12);
        assert!((plate.distance(Vector3::new(0.5, 0.3, 0.4), 0.0) - 0.28).abs() < 1e-12);
        assert!(Hull::new(vec![], 1.0).is_none() && Hull::new(cube(), 0.0).is_none());
    }
}
