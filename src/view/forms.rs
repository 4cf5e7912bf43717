//! The forms that things have in common: meshes, and how polygons are cut. Both are numbered as they are first seen.

use std::collections::HashMap;
use std::sync::Arc;

use crate::export::{normal, triangulate};
use crate::scene::{Color, Mesh, Palette, PatchSet, Point, Surface, Vector};

/// A surface before it is placed.
#[derive(Clone, Debug)]
enum Source {
    Mesh(Arc<Mesh>),
    /// And the largest scale at which it has been placed.
    Patches(Arc<PatchSet>, f64),
}

/// All forms that have been seen.
#[derive(Clone, Debug, Default)]
pub struct Forms {
    meshes: Vec<Source>,
    /// Numbers of meshes by their place in memory, which stays theirs while `meshes` holds them.
    numbers: HashMap<usize, u32>,
    cuts: Vec<Vec<[u32; 3]>>,
    cut_numbers: HashMap<Vec<[u32; 3]>, u32>,
}

/// A corner of a mesh that may have several colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshVertex {
    pub place: Point,
    pub normal: Vector,
    pub color: Color,
    /// The colour of the thing, if it has one, replaces this one.
    pub takes_tint: bool,
}

/// A mesh as it is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshForm {
    pub vertices: Vec<MeshVertex>,
    pub triangles: Vec<[u32; 3]>,
}

impl Forms {
    /// The number of a surface's mesh.
    pub(super) fn mesh(&mut self, surface: &Surface) -> u32 {
        let place = match &surface.patches {
            Some(patches) => Arc::as_ptr(patches) as usize,
            None => Arc::as_ptr(&surface.mesh) as usize,
        };
        let meshes = &mut self.meshes;
        let number = *self.numbers.entry(place).or_insert_with(|| {
            meshes.push(match &surface.patches {
                Some(patches) => Source::Patches(patches.clone(), 0.0),
                None => Source::Mesh(surface.mesh.clone()),
            });
            (meshes.len() - 1) as u32
        });
        if let Source::Patches(_, largest) = &mut meshes[number as usize] {
            *largest = largest.max(surface.placement.scale);
        }
        number
    }

    /// The number of the way in which a polygon is cut into triangles.
    pub(super) fn triangulation(&mut self, vertices: &[Point]) -> u32 {
        let cut: Vec<[u32; 3]> =
            triangulate(vertices, normal(vertices)).into_iter().map(|t| t.map(|k| k as u32)).collect();
        if let Some(&number) = self.cut_numbers.get(&cut) {
            return number;
        }
        let number = self.cuts.len() as u32;
        self.cuts.push(cut.clone());
        self.cut_numbers.insert(cut, number);
        number
    }

    /// Triangles of polygons, by number.
    pub fn cuts(&self) -> &[Vec<[u32; 3]>] {
        &self.cuts
    }

    /// Number of meshes.
    pub fn meshes(&self) -> usize {
        self.meshes.len()
    }

    /// A mesh, by number, no further than `accuracy` (scene units) from its surface where it is largest.
    pub fn mesh_form(&self, number: usize, accuracy: f64, palette: &Palette) -> MeshForm {
        let mesh = match &self.meshes[number] {
            Source::Mesh(mesh) => mesh.clone(),
            Source::Patches(patches, largest) => patches.mesh(accuracy / largest.max(f64::MIN_POSITIVE)),
        };
        let mut form = MeshForm::default();
        let mut known = HashMap::new();
        for face in &mesh.faces {
            form.triangles.push(face.corners.map(|corner| {
                *known.entry((corner, face.material, face.takes_tint)).or_insert_with(|| {
                    form.vertices.push(MeshVertex {
                        place: mesh.vertices[corner as usize],
                        normal: mesh.normals[corner as usize],
                        color: palette.get(face.material).color,
                        takes_tint: face.takes_tint,
                    });
                    (form.vertices.len() - 1) as u32
                })
            }));
        }
        form
    }
}
