//! A scene as a Wavefront OBJ mesh, with normals, materials, and one group for each module.
//!
//! A module's group is named `KIND.LINEAGE`, the same in every frame. Segments that share a ring of a tube
//! share its vertices across their groups, so a tube is one closed mesh.

use std::fmt::Write;

use super::name::Names;
use super::{Fit, GENERATOR, number, triangulate, tube};
use crate::scene::{MaterialId, OwnerId, Palette, Point, Scene, Vector};

/// Name of the material library that all frames refer to.
pub(super) const MATERIALS: &str = "materials.mtl";
/// Decimals of a normal.
const NORMAL_DECIMALS: usize = 4;

/// A triangle: vertex and normal at each corner, by number.
pub(super) struct Triangle {
    owner: OwnerId,
    pub(super) material: MaterialId,
    pub(super) corners: [(u32, u32); 3],
}

/// A growing triangle mesh.
#[derive(Default)]
pub(super) struct Triangles {
    pub(super) vertices: Vec<Point>,
    pub(super) normals: Vec<Vector>,
    pub(super) faces: Vec<Triangle>,
}

impl Triangles {
    pub(super) fn add_vertex(&mut self, p: Point) -> u32 {
        self.vertices.push(p);
        (self.vertices.len() - 1) as u32
    }

    pub(super) fn add_normal(&mut self, n: Vector) -> u32 {
        self.normals.push(n);
        (self.normals.len() - 1) as u32
    }

    /// Corners counter-clockwise, seen from outside.
    pub(super) fn add_face(&mut self, owner: OwnerId, material: MaterialId, corners: [(u32, u32); 3]) {
        self.faces.push(Triangle { owner, material, corners });
    }
}

/// Everything in a scene as triangles, in string order; stems as tubes with so many sides.
pub(super) fn triangles(scene: &Scene, fit: &Fit, sides: usize) -> Triangles {
    let mut mesh = Triangles::default();
    tube::add_tubes(scene, fit.default_width, sides, &mut mesh);
    add_polygons(scene, &mut mesh);
    add_surfaces(scene, &mut mesh);
    // Stable, so that triangles stay in the order in which they were made.
    mesh.faces.sort_by_key(|face| (face.owner, face.material));
    mesh
}

/// The document of one frame.
pub(super) fn document(scene: &Scene, fit: &Fit, sides: usize, title: &str) -> String {
    let mesh = triangles(scene, fit, sides);
    let title: String = title.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut out = format!(
        "# {GENERATOR}\n# {title}\n# Up axis: +Y; front: +Z. Units: those of the model.\nmtllib {MATERIALS}\n"
    );
    let decimals = number::decimals_for(fit.extent);
    for p in &mesh.vertices {
        push_triple(&mut out, "v", &p.coords, decimals);
    }
    for n in &mesh.normals {
        push_triple(&mut out, "vn", n, NORMAL_DECIMALS);
    }
    let names = Names::new(scene, '.');
    let mut material = None;
    for group in mesh.faces.chunk_by(|a, b| a.owner == b.owner) {
        let _ = writeln!(out, "g {}", names.get(group[0].owner));
        for face in group {
            if material != Some(face.material) {
                material = Some(face.material);
                let _ = writeln!(out, "usemtl {}", scene.palette.get(face.material).name);
            }
            // OBJ counts from 1.
            let [(a, l), (b, m), (c, n)] = face.corners.map(|(v, n)| (v + 1, n + 1));
            let _ = writeln!(out, "f {a}//{l} {b}//{m} {c}//{n}");
        }
    }
    out
}

fn push_triple(out: &mut String, keyword: &str, v: &Vector, decimals: usize) {
    out.push_str(keyword);
    for i in 0..3 {
        out.push(' ');
        number::push(out, v[i], decimals);
    }
    out.push('\n');
}

fn add_polygons(scene: &Scene, mesh: &mut Triangles) {
    for polygon in &scene.polygons {
        let facing = triangulate::normal(&polygon.vertices);
        let normal = mesh.add_normal(facing);
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(&polygon.vertices);
        for triangle in triangulate::triangulate(&polygon.vertices, facing) {
            mesh.add_face(polygon.owner, polygon.material, triangle.map(|i| (first + i as u32, normal)));
        }
    }
}

fn add_surfaces(scene: &Scene, mesh: &mut Triangles) {
    for surface in &scene.surfaces {
        let (shape, placement) = (&surface.mesh, &surface.placement);
        let (vertex, normal) = (mesh.vertices.len() as u32, mesh.normals.len() as u32);
        mesh.vertices.extend(shape.vertices.iter().map(|&v| placement.point(v)));
        mesh.normals.extend(shape.normals.iter().map(|&n| placement.direction(n)));
        for face in &shape.faces {
            let material = surface.tint.filter(|_| face.takes_tint).unwrap_or(face.material);
            mesh.add_face(surface.owner, material, face.corners.map(|i| (vertex + i, normal + i)));
        }
    }
}

/// The material library.
pub(super) fn materials(palette: &Palette) -> String {
    let mut out = format!("# {GENERATOR}\n");
    for material in palette.materials() {
        let _ = writeln!(out, "\nnewmtl {}", material.name);
        for (keyword, strength) in [("Ka", 0.2), ("Kd", 1.0)] {
            let color = Vector::from(material.color.channels()) * strength;
            push_triple(&mut out, keyword, &color, NORMAL_DECIMALS);
        }
        out.push_str("Ks 0.05 0.05 0.05\nNs 20\nd 1\nillum 2\n");
    }
    out
}
