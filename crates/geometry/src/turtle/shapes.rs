//! The built-in surfaces: a leaf, a flower, a petal, a bud and a ball, of unit size, in the turtle's axes.
//!
//! Coordinates are along the heading, to the left and up. Outlines are `s^a (1 - s)^b`, with `s` from base
//! to tip: round where the exponent is near one half, pointed where it is 1.

use std::sync::LazyLock;

use crate::scene::{MaterialId, Mesh, PatchFace, Point, Shape, sin_cos_degrees};

/// A pointed oval, 1 long, 0.4 wide, folded a little along the midrib and arching over.
pub(super) static LEAF: LazyLock<Shape> = LazyLock::new(|| Shape::of_mesh(make_leaf()));

/// Five petals on a green cup, 0.5 across, opening along the heading like a bell, with a yellow centre.
pub(super) static FLOWER: LazyLock<Shape> = LazyLock::new(|| Shape::of_mesh(make_flower()));

/// A rounded petal, 1 long, 0.6 wide, narrow at its base, hollow, its tip bending back: one patch.
pub(super) static PETAL: LazyLock<Shape> = LazyLock::new(|| Shape::of_patches(make_petal()));

/// A closed bud, 1 long, 0.5 thick, pointed: four patches around the heading.
pub(super) static BUD: LazyLock<Shape> = LazyLock::new(|| Shape::of_patches(make_bud()));

/// A ball of diameter 1 around the turtle.
pub(super) static BALL: LazyLock<Shape> = LazyLock::new(|| Shape::ball(MaterialId::STEM));

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

/// Rows go from base to tip, columns from left to right, so that the front is up.
fn make_petal() -> Vec<PatchFace> {
    // Of each row: place along the heading and rise of its edge and of its middle, half widths of both.
    let row = |edge: [f64; 2], middle: [f64; 2], widths: [f64; 2]| {
        let at = |[x, z]: [f64; 2], y: f64| Point::new(x, y, z);
        [at(edge, widths[0]), at(middle, widths[1]), at(middle, -widths[1]), at(edge, -widths[0])]
    };
    let net = [
        row([0.0, 0.01], [0.0, 0.0], [0.05, 0.02]),
        row([0.3, 0.1], [0.36, -0.06], [0.16, 0.08]),
        row([0.62, 0.14], [0.72, 0.02], [0.36, 0.14]),
        row([0.88, 0.03], [1.05, -0.03], [0.25, 0.14]),
    ];
    vec![PatchFace { net, material: MaterialId::PETAL, takes_tint: true, has_picture: false }]
}

/// Each quarter has its rows from base to tip; its columns go round so that the front is outside.
fn make_bud() -> Vec<PatchFace> {
    // The handle of a cubic that follows a quarter of a circle to 3 parts in 10,000.
    const HANDLE: f64 = 0.551_915;
    const PROFILE: [(f64, f64); 4] = [(0.0, 0.0), (0.02, 0.36), (0.52, 0.3), (1.0, 0.0)];
    (0..4)
        .map(|quarter| {
            let (sin, cos) = sin_cos_degrees(90.0 * f64::from(quarter));
            let arc = [(1.0, 0.0), (1.0, HANDLE), (HANDLE, 1.0), (0.0, 1.0)]
                .map(|(a, b)| (a * cos - b * sin, a * sin + b * cos));
            let net = PROFILE.map(|(x, radius)| arc.map(|(y, z)| Point::new(x, radius * y, radius * z)));
            PatchFace { net, material: MaterialId::SEPAL, takes_tint: true, has_picture: false }
        })
        .collect()
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
        let [long, wide, _] = size(&LEAF.mesh);
        assert!((long - 1.0).abs() < 1e-12 && (wide - 0.4).abs() < 0.02, "{long} {wide}");
        let [_, wide, high] = size(&FLOWER.mesh);
        assert!((0.45..0.55).contains(&wide) && (0.45..0.55).contains(&high), "{wide} {high}");
        let [long, wide, _] = size(&PETAL.mesh);
        assert!((0.97..1.03).contains(&long) && (0.55..0.65).contains(&wide), "{long} {wide}");
        let [long, wide, high] = size(&BUD.mesh);
        assert!((long - 1.0).abs() < 1e-12 && (wide - high).abs() < 1e-9, "{long} {wide} {high}");
        assert!((0.45..0.55).contains(&wide), "{wide}");
    }

    #[test]
    fn normals_agree_with_the_winding() {
        for shape in [&LEAF, &FLOWER, &PETAL, &BUD] {
            let mesh = &shape.mesh;
            for face in &mesh.faces {
                let [p, q, r] = face.corners.map(|i| mesh.vertices[i as usize]);
                let normal = (q - p).cross(&(r - p));
                for corner in face.corners {
                    assert!(normal.dot(&mesh.normals[corner as usize]) > 0.0, "{p} {q} {r}");
                }
            }
        }
        let faces_up = |mesh: &Mesh| mesh.faces.iter().all(|f| mesh.normals[f.corners[0] as usize].z > 0.0);
        assert!(faces_up(&LEAF.mesh), "a leaf faces up");
        let middle = PETAL.mesh.normals.iter().map(|n| n.z).sum::<f64>();
        assert!(middle > 0.0, "a petal faces up");
    }

    #[test]
    fn a_bud_is_closed_and_faces_outwards() {
        let mesh = &BUD.mesh;
        let volume: f64 = (mesh.faces.iter())
            .map(|face| {
                let [p, q, r] = face.corners.map(|i| mesh.vertices[i as usize].coords);
                p.dot(&q.cross(&r)) / 6.0
            })
            .sum();
        assert!((0.05..0.2).contains(&volume), "{volume}");
        // By place, every edge is passed once in each direction.
        let place = |i: u32| mesh.vertices[i as usize].coords.map(|c| (c * 1e9).round() as i64);
        let mut edges = std::collections::HashMap::new();
        for face in &mesh.faces {
            for k in 0..3 {
                let (a, b) = (place(face.corners[k]), place(face.corners[(k + 1) % 3]));
                *edges.entry((a.x, a.y, a.z, b.x, b.y, b.z)).or_insert(0) += 1;
                *edges.entry((b.x, b.y, b.z, a.x, a.y, a.z)).or_insert(0) -= 1;
            }
        }
        assert!(edges.values().all(|&count| count == 0));
    }
}
