//! Nearest points of two convex hulls of points: a point, a cord or a face of a sheet and the core of a solid, or two solids.

use crate::Vector;

/// Most steps towards the nearest points; a few are enough, unless rounding stops the progress.
const STEPS: usize = 100;

/// The nearest points of two hulls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// From the second hull to the first one; 0 if they meet.
    pub way: Vector,
    /// Weights of the corners of the first one in its nearest point.
    pub weights: [f64; 3],
}

/// A difference of two corners, and the index of the first one.
#[derive(Clone, Copy)]
struct Corner {
    place: Vector,
    index: usize,
}

/// Up to four differences, with weights.
#[derive(Clone, Copy)]
struct Simplex {
    corners: [Corner; 4],
    weights: [f64; 4],
    count: usize,
}

impl Simplex {
    fn push(&mut self, corner: Corner) {
        self.corners[self.count] = corner;
        self.weights[self.count] = 1.0;
        self.count += 1;
    }

    /// The point that is nearest to the origin, and the part that it lies in.
    fn nearest(&self) -> (Vector, Simplex) {
        let mut best = (Vector::repeat(f64::INFINITY), *self);
        // The last corner is part of it, or it would have been the nearest one before.
        for chosen in 1_u8 << (self.count - 1)..1 << self.count {
            let mut part = Simplex { count: 0, ..*self };
            (0..self.count).filter(|i| chosen >> i & 1 == 1).for_each(|i| part.push(self.corners[i]));
            let place = |k: usize| part.corners[k].place;
            let found = match part.count {
                1 => Some([1.0, 0.0, 0.0, 0.0]),
                2 => on_edge(place(0), place(1)),
                3 => on_triangle(place(0), place(1), place(2)),
                _ => is_within([0, 1, 2, 3].map(place)).then_some([0.25; 4]),
            };
            let Some(weights) = found else { continue };
            if part.count == 4 {
                return (Vector::zeros(), Simplex { weights, ..part });
            }
            let way: Vector = (0..part.count).map(|k| place(k) * weights[k]).sum();
            if way.norm_squared() < best.0.norm_squared() {
                best = (way, Simplex { weights, ..part });
            }
        }
        best
    }
}

/// By the method of Gilbert, Johnson and Keerthi (*A fast procedure for computing the distance between complex objects in three-dimensional space*,
/// 1988). There are one to three corners of the first hull.
pub(crate) fn nearest(corners: &[Vector], core: &[Vector]) -> Nearest {
    let (way, simplex, _) = approach(corners, core, f64::INFINITY);
    let mut weights = [0.0; 3];
    for k in 0..simplex.count {
        weights[simplex.corners[k].index] += simplex.weights[k];
    }
    let sum: f64 = weights.iter().sum();
    Nearest { way, weights: weights.map(|weight| weight / sum) }
}

/// Where two hulls are nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// The shortest way from the second hull to the first one, in m; 0 if they meet.
    pub way: Vector,
    /// The point of the first one at its end.
    pub place: Vector,
}

impl Meeting {
    /// Of the hulls of points in common axes; the origin is a hull without points.
    pub fn of(first: &[Vector], second: &[Vector]) -> Meeting {
        let first = if first.is_empty() { &[Vector::zeros()] } else { first };
        let (way, simplex, _) = approach(first, second, f64::INFINITY);
        Meeting::at(first, way, simplex)
    }

    /// The same of hulls that are not further apart than a distance (m), which takes less work for others.
    ///
    /// # Errors
    ///
    /// Hulls that are further apart: a direction, from the second one to the first, along which they are.
    pub fn within(first: &[Vector], second: &[Vector], distance: f64) -> Result<Meeting, Vector> {
        let first = if first.is_empty() { &[Vector::zeros()] } else { first };
        let (way, simplex, is_near) = approach(first, second, distance);
        if is_near && way.norm_squared() <= distance * distance {
            return Ok(Meeting::at(first, way, simplex));
        }
        Err(way)
    }

    fn at(first: &[Vector], way: Vector, simplex: Simplex) -> Meeting {
        let (mut place, mut sum) = (Vector::zeros(), 0.0);
        for k in 0..simplex.count {
            place += first[simplex.corners[k].index] * simplex.weights[k];
            sum += simplex.weights[k];
        }
        Meeting { way: simplex.across(way), place: place / sum }
    }
}

impl Simplex {
    /// The way to the nearest point, across the triangle or the edge that it lies in. Where hulls are much larger than their distance, the difference of two
    /// points has too large an error for a direction; edges have none.
    fn across(&self, way: Vector) -> Vector {
        let place = |k: usize| self.corners[k].place;
        let axis = match self.count {
            2 => {
                let edge = place(1) - place(0);
                way - edge * (way.dot(&edge) / edge.norm_squared())
            }
            3 => {
                let normal = (place(1) - place(0)).cross(&(place(2) - place(0)));
                if normal.dot(&way) < 0.0 { -normal } else { normal }
            }
            _ => return way,
        };
        let Some(axis) = axis.try_normalize(0.0) else { return way };
        let distance = axis.dot(&place(0));
        // Corners that are nearly in one line do not tell it.
        if distance > 0.999 * way.norm() && distance < 1.001 * way.norm() { axis * distance } else { way }
    }
}

/// The point that is lowest along a direction; of equal ones, the first. Numbers have the total order, in which -0 is below 0.
fn lowest(points: &[Vector], direction: &Vector) -> usize {
    let mut best = (0, f64::INFINITY);
    for (index, point) in points.iter().enumerate() {
        let along = point.dot(direction);
        if along.total_cmp(&best.1).is_lt() {
            best = (index, along);
        }
    }
    best.0
}

/// The point that is highest along a direction; of equal ones, the last.
fn highest(points: &[Vector], direction: &Vector) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (index, point) in points.iter().enumerate() {
        let along = point.dot(direction);
        if along.total_cmp(&best.1).is_ge() {
            best = (index, along);
        }
    }
    best.0
}

/// The shortest way from the second hull to the first one, and the differences of corners that it lies among; false, and any way, if it is surely longer than a
/// limit. The first hull has a corner.
fn approach(first: &[Vector], second: &[Vector], limit: f64) -> (Vector, Simplex, bool) {
    let difference = |direction: Vector| {
        let index = lowest(first, &direction);
        let other = second.get(highest(second, &direction));
        Corner { place: first[index] - other.copied().unwrap_or_else(Vector::zeros), index }
    };
    let begin = difference(Vector::zeros());
    let mut simplex = Simplex { corners: [begin; 4], weights: [1.0; 4], count: 1 };
    let mut way = begin.place;
    for _ in 0..STEPS {
        let next = difference(way);
        let (square, along) = (way.norm_squared(), next.place.dot(&way));
        // All differences are as far along the way as this one.
        if along > 0.0 && along * along > limit * limit * square {
            return (way, simplex, false);
        }
        let gain = square - along;
        let known = simplex.corners[..simplex.count].iter().any(|corner| corner.place == next.place);
        if gain <= 1e-14 * square || known {
            break;
        }
        let mut larger = simplex;
        larger.push(next);
        let (found, part) = larger.nearest();
        // Rounding: there is no progress any more.
        if found.norm_squared() >= square {
            break;
        }
        (way, simplex) = (found, part);
        if simplex.count == 4 {
            break;
        }
    }
    (way, simplex, true)
}

/// Weights of the foot of the perpendicular from the origin, if it lies between the ends.
fn on_edge(a: Vector, b: Vector) -> Option<[f64; 4]> {
    let way = b - a;
    let part = -a.dot(&way) / way.norm_squared();
    (part > 0.0 && part < 1.0).then_some([1.0 - part, part, 0.0, 0.0])
}

/// The same in a triangle.
fn on_triangle(a: Vector, b: Vector, c: Vector) -> Option<[f64; 4]> {
    let normal = (b - a).cross(&(c - a));
    let square = normal.norm_squared();
    let foot = normal * (a.dot(&normal) / square);
    let part = |p: Vector, q: Vector| (q - p).cross(&(foot - p)).dot(&normal) / square;
    let (of_c, of_a, of_b) = (part(a, b), part(b, c), part(c, a));
    let is_inside = of_a > 0.0 && of_b > 0.0 && of_c > 0.0;
    (square > 0.0 && is_inside).then_some([of_a, of_b, of_c, 0.0])
}

/// True if the origin lies within a tetrahedron.
fn is_within(corners: [Vector; 4]) -> bool {
    let volume = |[a, b, c, d]: [Vector; 4]| (b - a).cross(&(c - a)).dot(&(d - a));
    let whole = volume(corners);
    let is_inside = |k: usize| {
        let mut part = corners;
        part[k] = Vector::zeros();
        volume(part) * whole > 0.0
    };
    whole != 0.0 && (0..4).all(is_inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in -1..1.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 0.123_f64;
        move || {
            state = (state * 9973.13 + 0.754_877_67).fract();
            2.0 * state - 1.0
        }
    }

    #[test]
    fn triangles_and_boxes_are_as_far_apart_as_a_fine_grid_says() {
        let corner = |k: i32| Vector::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        let cube: Vec<Vector> = (0..8).map(corner).collect();
        let mut number = numbers();
        for _ in 0..300 {
            let mut point = || Vector::new(number(), number(), number()) * 2.0 + Vector::repeat(0.5);
            let corners = [point(), point(), point()];
            let found = nearest(&corners, &cube);
            let mut least = f64::INFINITY;
            let parts = 120;
            for i in 0..=parts {
                for j in 0..=parts - i {
                    let (a, b) = (i as f64 / parts as f64, j as f64 / parts as f64);
                    let place = corners[0] * a + corners[1] * b + corners[2] * (1.0 - a - b);
                    least = least.min(place.map(|x| x - x.clamp(0.0, 1.0)).norm());
                }
            }
            let distance = found.way.norm();
            assert!(distance < least + 1e-12 && distance > least - 0.05, "{distance} {least}");
            let sum: f64 = found.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-12 && found.weights.iter().all(|x| *x >= 0.0));
            if distance > 0.0 {
                // No point of either body is beyond the planes across the way.
                let place: Vector = (0..3).map(|k| corners[k] * found.weights[k]).sum();
                let level = |point: &Vector| (point - place).dot(&found.way) / distance;
                assert!(corners.iter().all(|point| level(point) > -1e-7));
                assert!(cube.iter().all(|point| level(point) < -distance + 1e-7));
            }
        }
    }

    /// Two boxes that are turned against each other: no point of either is beyond the planes across the way.
    #[test]
    fn two_hulls_are_parted_by_planes_across_the_way() {
        let mut number = numbers();
        let mut met = 0;
        for _ in 0..2000 {
            let mut vector = || Vector::new(number(), number(), number());
            let mut made = |size: f64| {
                let (middle, turn) = (vector() * 2.0, crate::Attitude::from_scaled_axis(vector() * 3.0));
                // Flat ones, too.
                let half = vector().map(|x| if x < -0.5 { 0.0 } else { x.abs() * size });
                let sign = |k: usize, bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let corner =
                    |k| middle + turn * half.component_mul(&Vector::new(sign(k, 0), sign(k, 1), sign(k, 2)));
                (0..8).map(corner).collect::<Vec<_>>()
            };
            let (first, second) = (made(1.0), made(1.5));
            let Meeting { way, place } = Meeting::of(&first, &second);
            let distance = way.norm();
            let limit = (number() + 1.0).abs();
            let within = Meeting::within(&first, &second, limit);
            match within {
                Ok(found) => assert!(distance <= limit && found == Meeting { way, place }),
                Err(axis) => {
                    let least = first.iter().map(|point| point.dot(&axis)).fold(f64::INFINITY, f64::min);
                    let most = second.iter().map(|point| point.dot(&axis)).fold(f64::NEG_INFINITY, f64::max);
                    let apart = (least - most) / axis.norm();
                    assert!(distance > limit && apart > limit * (1.0 - 1e-9), "{apart} {limit}");
                }
            }
            met += usize::from(distance == 0.0);
            if distance > 0.0 {
                let level = |point: &Vector| (point - place).dot(&way) / distance;
                let least = first.iter().map(level).fold(f64::INFINITY, f64::min);
                let most = second.iter().map(level).fold(f64::NEG_INFINITY, f64::max);
                assert!(least > -1e-7 && most < -distance + 1e-7, "{least} {most} {distance}");
                assert!((Meeting::of(&second, &first).way + way).norm() < 1e-7);
            }
        }
        assert!(met > 50 && met < 1500, "{met}");
    }
}
