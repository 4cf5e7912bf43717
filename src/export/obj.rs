//! A scene as a Wavefront OBJ mesh, with normals, materials, and one group for each module.
//!
//! A module's group is named `KIND.LINEAGE`, the same in every frame. Segments that share a ring of a tube
//! share its vertices across their groups, so a tube is one closed mesh.

use super::name::Names;
use super::number::Line;
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
    let mut mesh = unordered(scene, fit, sides);
    // Stable, so that triangles stay in the order in which they were made.
    mesh.faces.sort_by_key(|face| (face.owner, face.material));
    mesh
}

/// Everything in a scene as triangles. Tubes have so many sides; 0: as many as it takes.
fn unordered(scene: &Scene, fit: &Fit, sides: usize) -> Triangles {
    let mut mesh = Triangles::default();
    // What tubes of eight sides take, half of them with domes.
    mesh.vertices.reserve(24 * scene.segments.len());
    mesh.normals.reserve(24 * scene.segments.len());
    mesh.faces.reserve(48 * scene.segments.len());
    match sides {
        0 => tube::add_round_tubes(scene, fit.default_width, fit.accuracy, &mut mesh),
        _ => tube::add_tubes(scene, fit.default_width, sides.max(3), &mut mesh),
    }
    add_polygons(scene, &mut mesh);
    add_surfaces(scene, &mut mesh);
    mesh
}

/// The document of one frame. Tubes have so many sides; 0: as many as it takes.
pub(super) fn document(scene: &Scene, fit: &Fit, sides: usize, title: &str) -> Vec<u8> {
    let mesh = unordered(scene, fit, sides);
    let title: String = title.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let head = format!(
        "# {GENERATOR}\n# {title}\n# Up axis: +Y; front: +Z. Units: those of the model.\nmtllib {MATERIALS}\n"
    );
    let mut out = head.into_bytes();
    out.reserve(32 * (mesh.vertices.len() + mesh.normals.len()) + 44 * mesh.faces.len());
    let decimals = number::decimals_for(fit.extent);
    // Halves side by side: a large mesh is mostly the writing of its numbers.
    let (faces, points) = std::thread::scope(|scope| {
        let (mesh, scene) = (&mesh, scene);
        let faces = scope.spawn(move || faces(mesh, scene));
        for p in &mesh.vertices {
            push_triple(&mut out, "v", &p.coords, decimals);
        }
        for n in &mesh.normals {
            push_triple(&mut out, "vn", n, NORMAL_DECIMALS);
        }
        (faces.join(), out)
    });
    let mut out = points;
    match faces {
        Ok(faces) => out.extend_from_slice(&faces),
        Err(panic) => std::panic::resume_unwind(panic),
    }
    out
}

/// The numbers of all triangles, ordered by owner and material, else in the order in which they were made. A
/// sort by counting: a large mesh has millions of triangles, and their owners are numbers from 0.
fn by_owner(mesh: &Triangles, owners: usize) -> Vec<u32> {
    let mut next = vec![0_u32; owners + 1];
    for face in &mesh.faces {
        next[face.owner.index() + 1] += 1;
    }
    for owner in 0..owners {
        next[owner + 1] += next[owner];
    }
    let ends = next[1..].to_vec();
    let mut order = vec![0_u32; mesh.faces.len()];
    for (i, face) in mesh.faces.iter().enumerate() {
        let place = &mut next[face.owner.index()];
        order[*place as usize] = i as u32;
        *place += 1;
    }
    let mut start = 0;
    for end in ends {
        let group = &mut order[start..end as usize];
        let material = |i: &u32| mesh.faces[*i as usize].material;
        if !group.is_sorted_by_key(material) {
            group.sort_by_key(material);
        }
        start = end as usize;
    }
    order
}

/// The groups and their triangles.
fn faces(mesh: &Triangles, scene: &Scene) -> Vec<u8> {
    let mut out = Vec::with_capacity(44 * mesh.faces.len());
    let names = Names::new(scene, '.');
    let mut material = None;
    let mut line = Line::new();
    let order = by_owner(mesh, scene.owners().len());
    for group in order.chunk_by(|&a, &b| mesh.faces[a as usize].owner == mesh.faces[b as usize].owner) {
        out.extend_from_slice(b"g ");
        out.extend_from_slice(names.get(mesh.faces[group[0] as usize].owner).as_bytes());
        out.push(b'\n');
        for face in group.iter().map(|&i| &mesh.faces[i as usize]) {
            if material != Some(face.material) {
                material = Some(face.material);
                out.extend_from_slice(b"usemtl ");
                out.extend_from_slice(scene.palette.get(face.material).name.as_bytes());
                out.push(b'\n');
            }
            line.word(b"f");
            for (vertex, normal) in face.corners {
                // OBJ counts from 1.
                line.word(b" ");
                line.whole(u64::from(vertex) + 1);
                line.word(b"//");
                line.whole(u64::from(normal) + 1);
            }
            line.word(b"\n");
            line.flush(&mut out);
        }
    }
    out
}

fn push_triple(out: &mut Vec<u8>, keyword: &str, v: &Vector, decimals: usize) {
    let mut line = Line::new();
    line.word(keyword.as_bytes());
    for i in 0..3 {
        line.word(b" ");
        line.number(v[i], decimals, out);
    }
    line.word(b"\n");
    line.flush(out);
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
pub(super) fn materials(palette: &Palette) -> Vec<u8> {
    let mut out = format!("# {GENERATOR}\n").into_bytes();
    for material in palette.materials() {
        out.extend_from_slice(format!("\nnewmtl {}\n", material.name).as_bytes());
        for (keyword, strength) in [("Ka", 0.2), ("Kd", 1.0)] {
            let color = Vector::from(material.color.channels()) * strength;
            push_triple(&mut out, keyword, &color, NORMAL_DECIMALS);
        }
        out.extend_from_slice(b"Ks 0.05 0.05 0.05\nNs 20\nd 1\nillum 2\n");
    }
    out
}
