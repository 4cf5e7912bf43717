//! The built-in surfaces: a leaf and a flower, of unit size, in the turtle's axes.
//!
//! Coordinates are along the heading, to the left and up. Outlines are `s^a (1 - s)^b`, with `s` from base
//! to tip: round where the exponent is near one half, pointed where it is 1.

use std::sync::{Arc, LazyLock};

use crate::scene::{MaterialId, Mesh, Point, sin_cos_degrees};

/// A pointed oval, 1 long, 0.4 wide, folded a little along the midrib and arching over.
pub(super) fn leaf() -> Arc<Mesh> {
    static LEAF: LazyLock<Arc<Mesh>> = LazyLock::new(|| Arc::new(make_leaf()));
    LEAF.clone()
}

/// Five petals on a green cup, 0.5 across, opening along the heading like a bell, with a yellow centre.
pub(super) fn flower() -> Arc<Mesh> {
    static FLOWER: LazyLock<Arc<Mesh>> = LazyLock::new(|| Arc::new(make_flower()));
    FLOWER.clone()
}

/// Positions from 0 to 1 that lie closer near the ends, where outlines turn most.
fn stations(count: usize) -> impl Iterator<Item = f64> {
    (0..=count).map(move |i| {
        let even = i as f64 / count as f64;
        let crowded = 0.5 - 0.5 * sin_cos_degrees(180.0 * even).1;
        0.4 * even + 0.6 * crowded
    })
}

/// `s^a (1 - s)^b`, scaled to a greatest value of 1.
fn outline(s: f64, a: f64, b: f64) -> f64 {
    let value = |s: f64| s.powf(a) * (1.0 - s).powf(b);
    value(s) / value(a / (a + b))
}

fn make_leaf() -> Mesh {
    const HALF_WIDTH: f64 = 0.2;
    // Rise of the edges over the midrib, for each unit of width.
    const FOLD: f64 = 0.3;
    let midrib = |s: f64| Point::new(s, 0.0, 0.16 * s - 0.26 * s * s);
    let mut mesh = Mesh::new();
    // The halves have a midrib of their own each, so that the fold is sharp.
    for side in [1.0, -1.0] {
        let rows: Vec<Vec<Point>> = stations(16)
            .map(|s| {
                let width = HALF_WIDTH * outline(s, 0.7, 1.0);
                let centre = midrib(s);
                let edge = Point::new(s, side * width, centre.z + FOLD * width);
                if side > 0.0 { vec![edge, centre] } else { vec![centre, edge] }
            })
            .collect();
        mesh.add_grid(&rows, MaterialId::LEAF, true);
    }
    mesh.finish()
}

fn make_flower() -> Mesh {
    const PETALS: usize = 5;
    let mut mesh = Mesh::new();
    // A point at this height along the heading, distance from it, and angle about it. Up is 0 degrees.
    let place = |height: f64, radius: f64, degrees: f64| {
        let (sin, cos) = sin_cos_degrees(degrees);
        Point::new(height, radius * sin, radius * cos)
    };
    for petal in 0..PETALS {
        let towards = 360.0 / PETALS as f64 * petal as f64;
        for side in [1.0, -1.0] {
            let rows: Vec<Vec<Point>> = stations(5)
                .map(|s| {
                    // A bell: along the heading first, then outwards, and back a little at the tip.
                    let radius = 0.035 + 0.215 * s.powf(1.6);
                    let height = 0.03 + 0.28 * s - 0.1 * s * s * s;
                    let width = 0.012 * (1.0 - s) + 0.098 * outline(s, 0.9, 0.6);
                    // Petals are hollow: their edges bend towards the axis of the flower.
                    let edge_at = place(height + 0.25 * width, radius - 0.12 * width, towards);
                    let (sin, cos) = sin_cos_degrees(towards);
                    let edge =
                        Point::new(edge_at.x, edge_at.y + side * width * cos, edge_at.z - side * width * sin);
                    let centre = place(height, radius, towards);
                    if side > 0.0 { vec![edge, centre] } else { vec![centre, edge] }
                })
                .collect();
            mesh.add_grid(&rows, MaterialId::PETAL, true);
        }
    }
    // The centre, a small dome; the cup below, from the stem to where the petals begin.
    let ring = |height: f64, radius: f64, columns: usize| -> Vec<Point> {
        (0..=columns).map(|i| place(height, radius, 360.0 / columns as f64 * (columns - i) as f64)).collect()
    };
    let dome: Vec<Vec<Point>> = [0.0, 45.0, 90.0]
        .map(sin_cos_degrees)
        .map(|(sin, cos)| ring(0.09 + 0.05 * sin, 0.052 * cos, 8))
        .into();
    mesh.add_grid(&dome, MaterialId::CENTRE, false);
    let cup = [(0.0, 0.0), (0.025, 0.04), (0.09, 0.058)].map(|(h, r)| ring(h, r, 8));
    mesh.add_grid(&cup, MaterialId::SEPAL, false);
    mesh.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(mesh: &Mesh) -> [f64; 3] {
        [0, 1, 2].map(|i| {
            let values = || mesh.vertices.iter().map(|v| v[i]);
            values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
        })
    }

    #[test]
    fn shapes_have_unit_size() {
        let [long, wide, _] = size(&leaf());
        assert!((long - 1.0).abs() < 1e-12 && (wide - 0.4).abs() < 0.02, "{long} {wide}");
        let [_, wide, high] = size(&flower());
        assert!((0.45..0.55).contains(&wide) && (0.45..0.55).contains(&high), "{wide} {high}");
    }

    #[test]
    fn normals_agree_with_the_winding() {
        for mesh in [leaf(), flower()] {
            for face in &mesh.faces {
                let [p, q, r] = face.corners.map(|i| mesh.vertices[i as usize]);
                let normal = (q - p).cross(&(r - p));
                for corner in face.corners {
                    assert!(normal.dot(&mesh.normals[corner as usize]) > 0.0);
                }
            }
        }
        assert!(
            leaf().faces.iter().all(|f| leaf().normals[f.corners[0] as usize].z > 0.0),
            "a leaf faces up"
        );
    }
}
