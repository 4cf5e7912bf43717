//! Balls as triangles: an icosahedron whose faces are cut into triangles, all corners on the ball.
//!
//! Triangles are nearly of one size and shape, so a ball has no poles. Corners on an edge of the icosahedron are shared, so
//! the mesh is closed.

use std::collections::HashMap;

use super::{Face, MaterialId, Mesh, Point, Vector};

/// Radius of the ball that [`mesh`] makes.
const RADIUS: f64 = 0.5;

/// A ball of diameter 1 around the origin, no triangle further than `accuracy` from it, as far as that takes no more
/// than `finest` pieces on an edge.
pub(super) fn mesh(accuracy: f64, finest: usize, material: MaterialId) -> Mesh {
    let pieces = pieces(accuracy, finest);
    let corners = corners();
    let mut mesh = Mesh::new();
    let mut numbers = HashMap::new();
    for face in faces(&corners) {
        let mut number = |i: usize, j: usize| {
            // A corner is known by the weights of the icosahedron's corners that it lies between.
            let mut weights = [(face[0], pieces - i - j), (face[1], i), (face[2], j)];
            weights.iter_mut().filter(|(_, weight)| *weight == 0).for_each(|place| place.0 = 0);
            weights.sort_unstable();
            *numbers.entry(weights).or_insert_with(|| {
                let sum: Vector =
                    weights.iter().map(|(corner, weight)| corners[*corner] * *weight as f64).sum();
                let outwards = sum.normalize();
                mesh.vertices.push(Point::from(outwards * RADIUS));
                mesh.normals.push(outwards);
                (mesh.vertices.len() - 1) as u32
            })
        };
        let mut triangles = Vec::with_capacity(pieces * pieces);
        for i in 0..pieces {
            for j in 0..pieces - i {
                let [a, b, c] = [number(i, j), number(i + 1, j), number(i, j + 1)];
                triangles.push([a, b, c]);
                if i + j + 1 < pieces {
                    triangles.push([b, number(i + 1, j + 1), c]);
                }
            }
        }
        mesh.faces.extend(triangles.into_iter().map(|corners| Face { corners, material, takes_tint: true }));
    }
    mesh
}

/// Pieces of an edge of the icosahedron. The largest triangles are in the middle of its faces, which are 1.258 times nearer
/// to the centre than the ball: a triangle there has a circumradius of 0.764 / n radii, and is half the square of that from
/// the ball.
fn pieces(accuracy: f64, finest: usize) -> usize {
    let square = 0.292 * RADIUS / accuracy.max(f64::MIN_POSITIVE);
    (square.sqrt().ceil().min(finest as f64) as usize).max(2)
}

/// The corners of an icosahedron, as unit vectors; two of them are on the first axis.
fn corners() -> Vec<Vector> {
    // Height and distance from the axis of the two rings of five.
    let (height, radius) = (0.2_f64.sqrt(), 0.8_f64.sqrt());
    let mut corners = vec![Vector::x()];
    for (ring, side) in [(0.0, 1.0), (36.0, -1.0)] {
        corners.extend((0..5).map(|k| {
            let (sin, cos) = super::sin_cos_degrees(72.0 * f64::from(k) + ring);
            Vector::new(side * height, radius * cos, radius * sin)
        }));
    }
    corners.push(-Vector::x());
    corners
}

/// The faces of the icosahedron: three corners that are neighbours of one another, counter-clockwise seen from outside.
fn faces(corners: &[Vector]) -> Vec<[usize; 3]> {
    let near = |a: usize, b: usize| corners[a].dot(&corners[b]) > 0.3;
    let mut faces = Vec::new();
    for a in 0..corners.len() {
        for b in a + 1..corners.len() {
            for c in (b + 1..corners.len()).filter(|c| near(a, b) && near(a, *c) && near(b, *c)) {
                let outside = corners[a].dot(&corners[b].cross(&corners[c])) > 0.0;
                faces.push(if outside { [a, b, c] } else { [a, c, b] });
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_closed_round_and_as_near_as_it_should_be() {
        for accuracy in [0.25, 1e-2, 1e-3, 1e-4] {
            let mesh = mesh(accuracy, 64, MaterialId::STEM);
            let mut edges = HashMap::new();
            let (mut worst, mut volume): (f64, f64) = (0.0, 0.0);
            for face in &mesh.faces {
                let [p, q, r] = face.corners.map(|i| mesh.vertices[i as usize].coords);
                let normal = (q - p).cross(&(r - p)).normalize();
                worst = worst.max(RADIUS - normal.dot(&p));
                volume += p.dot(&q.cross(&r)) / 6.0;
                for k in 0..3 {
                    *edges.entry((face.corners[k], face.corners[(k + 1) % 3])).or_insert(0) += 1;
                    *edges.entry((face.corners[(k + 1) % 3], face.corners[k])).or_insert(0) -= 1;
                }
            }
            assert!(edges.values().all(|count| *count == 0), "closed");
            assert!(worst > 0.0 && worst <= accuracy, "{worst} > {accuracy}");
            let whole = std::f64::consts::PI / 6.0;
            assert!(volume < whole && volume > whole - 4.0 * accuracy, "{volume} of {whole}");
            assert!(mesh.vertices.iter().all(|p| (p.coords.norm() - RADIUS).abs() < 1e-12));
        }
        assert_eq!(faces(&corners()).len(), 20);
    }
}
