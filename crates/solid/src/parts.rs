//! Bodies of balls as convex parts: their hull, and the balls that are larger than its rounding.

use crate::{Error, Shape, Vector};

/// In radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Points that stand for a ball in a hull whose rounding is less than its radius.
const BALL_POINTS: usize = 32;
/// Most points of a hull: of more, the outermost ones in as many directions.
const MOST_POINTS: usize = 64;
/// Most balls that are parts of their own: the largest ones.
const MOST_BALLS: usize = 8;

/// Convex parts of the smallest convex body around balls (centre and radius in m): the hull of their centres, rounded by the least radius, in which larger
/// balls are points all around them; and these balls themselves, at most eight, so that they are round where they are outermost.
///
/// # Errors
///
/// No ball, a coordinate or a radius that is not finite, or a negative radius.
pub fn parts(balls: &[(Vector, f64)]) -> Result<Vec<Shape>, Error> {
    let least = balls.iter().map(|(_, radius)| *radius).fold(f64::INFINITY, f64::min);
    let is_large = |radius: f64| radius > least * (1.0 + 1e-9);
    let mut points = Vec::with_capacity(balls.len());
    for (centre, radius) in balls {
        if is_large(*radius) {
            points.extend(directions(BALL_POINTS).map(|way| centre + way * (radius - least)));
        } else {
            points.push(*centre);
        }
    }
    if points.len() > MOST_POINTS {
        points = outermost(&points);
    }
    let radius = if least.is_finite() { least } else { 0.0 };
    let mut parts = vec![Shape::hull(points, radius)?];
    let mut large: Vec<&(Vector, f64)> = balls.iter().filter(|(_, radius)| is_large(*radius)).collect();
    large.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (centre, radius) in large.into_iter().take(MOST_BALLS) {
        parts.push(Shape::hull(vec![*centre], *radius)?);
    }
    Ok(parts)
}

/// Directions evenly over a sphere, along a spiral of the golden angle.
fn directions(count: usize) -> impl Iterator<Item = Vector> {
    (0..count).map(move |k| {
        let height = 1.0 - (2 * k + 1) as f64 / count as f64;
        let angle = GOLDEN_ANGLE * k as f64;
        let across = libm::sqrt(1.0 - height * height);
        Vector::new(across * libm::cos(angle), across * libm::sin(angle), height)
    })
}

/// The outermost points in directions all around, each once.
fn outermost(points: &[Vector]) -> Vec<Vector> {
    let mut found: Vec<usize> = directions(MOST_POINTS)
        .filter_map(|way| {
            let along = |i: &usize| points[*i].dot(&way);
            (0..points.len()).max_by(|a, b| along(a).total_cmp(&along(b)))
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found.into_iter().map(|i| points[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Meeting;

    #[test]
    fn balls_of_one_radius_are_their_hull_and_larger_ones_are_round() {
        let pole = parts(&[(Vector::zeros(), 0.1), (Vector::y(), 0.1)]).expect("a body");
        assert_eq!((pole.len(), pole[0].core().len(), pole[0].radius()), (1, 2, 0.1));
        let apple = parts(&[(Vector::zeros(), 0.4), (Vector::y() * 0.5, 0.02)]).expect("a body");
        assert_eq!(apple.len(), 2);
        assert_eq!((apple[1].core(), apple[1].radius()), (&[Vector::zeros()][..], 0.4));
        // The hull is within the body, and not far within.
        let far = |way: Vector| way * 10.0 - way * Meeting::of(&[way * 10.0], apple[0].core()).way.norm();
        for way in [-Vector::y(), Vector::x(), Vector::new(0.6, -0.8, 0.0)] {
            let reach = far(way).norm() + 0.02;
            assert!(reach < 0.4 + 1e-12 && reach > 0.36, "{reach}");
        }
    }
}
