//! Triangulation of polygons in space.

use dlsys_geometry::scene::{Point, Vector};

/// Polygons with more vertices are not searched for ears, which takes quadratic time.
const EAR_LIMIT: usize = 4096;

/// The direction in which a polygon faces: its vertices go counter-clockwise about it. Newell's method, so
/// the polygon need not be flat or convex. `Vector::z()` if it has no area.
pub fn normal(vertices: &[Point]) -> Vector {
    let Some(&origin) = vertices.first() else { return Vector::z() };
    let mut sum = Vector::zeros();
    let mut longest = 0.0_f64;
    for (i, p) in vertices.iter().enumerate() {
        let next = vertices[(i + 1) % vertices.len()];
        // Relative to one of the vertices, so that a polygon far from the origin loses no digits.
        sum += (p - origin).cross(&(next - origin));
        longest = longest.max((p - origin).norm());
    }
    sum.try_normalize(1e-12 * longest * longest).unwrap_or_else(Vector::z)
}

/// Cuts a polygon into `n - 2` triangles of vertex indices, turning the same way as the polygon, by cutting
/// off ears (Meisters 1975) in the plane that `normal` is normal to. Outlines that cross themselves give
/// triangles, too, but not a meaningful area.
pub fn triangulate(vertices: &[Point], normal: Vector) -> Vec<[usize; 3]> {
    let flat = flatten(vertices, normal);
    let mut rest: Vec<usize> = (0..vertices.len()).collect();
    let mut triangles = Vec::with_capacity(vertices.len().saturating_sub(2));
    while rest.len() > 3 && vertices.len() <= EAR_LIMIT {
        let Some(ear) = (0..rest.len()).find(|&i| is_ear(&flat, &rest, i)) else { break };
        let n = rest.len();
        triangles.push([rest[(ear + n - 1) % n], rest[ear], rest[(ear + 1) % n]]);
        rest.remove(ear);
    }
    // The last triangle; or, if there is no ear because of rounding or crossing, a fan.
    for i in 2..rest.len() {
        triangles.push([rest[0], rest[i - 1], rest[i]]);
    }
    triangles
}

/// Coordinates in the plane.
fn flatten(vertices: &[Point], normal: Vector) -> Vec<[f64; 2]> {
    let least = normal.iamin();
    let mut aside = Vector::zeros();
    aside[least] = 1.0;
    let x = aside.cross(&normal).normalize();
    let y = normal.cross(&x);
    vertices.iter().map(|p| [x.dot(&p.coords), y.dot(&p.coords)]).collect()
}

/// Twice the area of a triangle, positive if counter-clockwise.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether the corner at place `i` is convex with no other vertex inside.
fn is_ear(flat: &[[f64; 2]], rest: &[usize], i: usize) -> bool {
    let n = rest.len();
    let [a, b, c] = [(i + n - 1) % n, i, (i + 1) % n].map(|place| flat[rest[place]]);
    if area(a, b, c) <= 0.0 {
        return false;
    }
    rest.iter().map(|&j| flat[j]).filter(|p| ![a, b, c].contains(p)).all(|p| {
        // Outside of one of the sides.
        area(a, b, p) < 0.0 || area(b, c, p) < 0.0 || area(c, a, p) < 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_concave_outline_keeps_its_area() {
        // An arrowhead in a tilted plane.
        let flat = [[0.0, 0.0], [2.0, 0.0], [0.5, 0.5], [0.0, 2.0]];
        let vertices: Vec<Point> = flat.iter().map(|p| Point::new(p[0], p[1], p[0] + 5.0)).collect();
        let normal = normal(&vertices);
        let triangles = triangulate(&vertices, normal);
        assert_eq!(triangles.len(), 2);
        let mut total = 0.0;
        for [a, b, c] in triangles {
            let cross = (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a]));
            assert!(cross.dot(&normal) > 0.0, "same side up");
            total += cross.norm() / 2.0;
        }
        assert!((total - 1.0 * 2_f64.sqrt()).abs() < 1e-12, "{total}");
    }

    #[test]
    fn degenerate_outlines_do_no_harm() {
        let line: Vec<Point> = (0..5).map(|i| Point::new(f64::from(i), 0.0, 0.0)).collect();
        assert_eq!(triangulate(&line, normal(&line)).len(), 3);
        assert!(triangulate(&line[..2], normal(&line[..2])).is_empty());
        assert!(triangulate(&[], normal(&[])).is_empty());
    }
}
