//! The surface of ground of soil and its particles as meshes in units of the model.

use dlsys_geometry::scene;
use dlsys_ground as ground;

use crate::columns::from_metres;
use crate::picture::{Earth, Picture};

/// Of the normal of a particle that does not point up.
const OWN: f64 = 0.4;

/// A mesh in m and particles as one mesh of a material, where a unit of the model is so many metres, and under a picture if there is one. Normals of particles are turned
/// up by more than a half, so that they are as light as the ground is.
pub(crate) fn with_spray(
    mut mesh: ground::Mesh,
    spray: &ground::Mesh,
    (metre, picture): (f64, Option<Picture>),
    earth: Earth,
) -> scene::Mesh {
    let mut normals = Vec::new();
    if !spray.points.is_empty() {
        normals.resize(mesh.points.len(), ground::Vector::zeros());
        // Opposite corners are in pairs.
        let octahedra = spray.points.chunks_exact(2).flat_map(|pair| {
            let axis = (pair[0] - pair[1]).normalize() * OWN;
            [ground::Vector::y() + axis, ground::Vector::y() - axis]
        });
        normals.extend(octahedra);
    }
    mesh.append(spray);
    let material = |corners: &[u32; 3]| {
        // Where there is a picture, the first points are those of the surface.
        let is_loose = picture.is_some() && corners[0] as usize >= mesh.slid.len();
        if is_loose { earth.loose } else { earth.surface }
    };
    let triangles = mesh.triangles.iter().map(|corners| (*corners, material(corners)));
    let made = scene::Mesh::of_triangles(from_metres(&mesh.points, metre), &normals, triangles);
    match picture {
        Some(picture) => picture.put_on(made, &mesh.points, &mesh.slid),
        None => made,
    }
}
