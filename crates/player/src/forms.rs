//! Shapes shared by many things: meshes, and triangulations of polygons. Both are numbered in the order of first use.
//!
//! Each stage has its own, so that stages can be made side by side; a recording [adopts](Forms::adopt) them in order.

use std::collections::HashMap;
use std::sync::Arc;

use super::stage::{Form, Stage};
use dlsys_geometry::scene::{Color, Mesh, Palette, PatchSet, Point, Surface, Texture, Vector};
use dlsys_render::{normal, triangulate};

/// A surface before it is placed.
#[derive(Clone, Debug)]
enum MeshSource {
    Mesh(Arc<Mesh>),
    /// And the largest scale at which it has been placed.
    Patches(Arc<PatchSet>, f64),
}

impl MeshSource {
    /// Where it is in memory.
    fn place(&self) -> usize {
        match self {
            MeshSource::Mesh(mesh) => Arc::as_ptr(mesh) as usize,
            MeshSource::Patches(patches, _) => Arc::as_ptr(patches) as usize,
        }
    }
}

/// All forms that have been seen.
#[derive(Clone, Debug, Default)]
pub struct Forms {
    meshes: Vec<MeshSource>,
    /// Numbers of meshes by their place in memory, which stays theirs while `meshes` holds them.
    numbers: HashMap<usize, u32>,
    cuts: Vec<Vec<[u32; 3]>>,
    cut_numbers: HashMap<Vec<[u32; 3]>, u32>,
}

/// A corner of a mesh that may have several colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshVertex {
    /// Its place, in units of the form.
    pub place: Point,
    /// The unit normal of the surface there.
    pub normal: Vector,
    /// Its colour in full light.
    pub color: Color,
    /// The colour of the thing, if it has one, replaces this one.
    pub takes_tint: bool,
}

/// A mesh as it is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshForm {
    /// The corners.
    pub vertices: Vec<MeshVertex>,
    /// Triangles by the numbers of their corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Where each corner lies in the picture; empty without one.
    pub places: Vec<[f64; 2]>,
    /// The picture on it.
    pub texture: Option<Texture>,
    /// The corner of the mesh that each one is: those of several colours stand here more than once.
    pub corners: Vec<u32>,
}

impl Forms {
    /// The number of a surface's mesh.
    pub(super) fn mesh(&mut self, surface: &Surface) -> u32 {
        self.take_mesh(match &surface.patches {
            Some(patches) => MeshSource::Patches(patches.clone(), surface.placement.largest()),
            None => MeshSource::Mesh(surface.mesh.clone()),
        })
    }

    /// The number of a mesh whose corners move by themselves.
    pub(super) fn net(&mut self, mesh: &Arc<Mesh>) -> u32 {
        self.take_mesh(MeshSource::Mesh(Arc::clone(mesh)))
    }

    fn take_mesh(&mut self, source: MeshSource) -> u32 {
        let meshes = &mut self.meshes;
        let next = meshes.len() as u32;
        let number = *self.numbers.entry(source.place()).or_insert(next);
        match (meshes.get_mut(number as usize), &source) {
            (None, _) => meshes.push(source),
            (Some(MeshSource::Patches(_, largest)), MeshSource::Patches(_, scale)) => {
                *largest = largest.max(*scale)
            }
            _ => {}
        }
        number
    }

    /// The number of the way in which a polygon is cut into triangles.
    pub(super) fn triangulation(&mut self, vertices: &[Point]) -> u32 {
        self.take_cut(
            triangulate(vertices, normal(vertices)).into_iter().map(|t| t.map(|k| k as u32)).collect(),
        )
    }

    fn take_cut(&mut self, cut: Vec<[u32; 3]>) -> u32 {
        if let Some(&number) = self.cut_numbers.get(&cut) {
            return number;
        }
        let number = self.cuts.len() as u32;
        self.cuts.push(cut.clone());
        self.cut_numbers.insert(cut, number);
        number
    }

    /// Adds the forms of a stage, in the order of its things. Returns the numbers that they have here, by those that they
    /// have there: of meshes, and of cuts.
    pub(super) fn adopt(&mut self, stage: &Stage) -> [Vec<u32>; 2] {
        let theirs = &stage.forms;
        let mut meshes = vec![None; theirs.meshes.len()];
        let mut cuts = vec![None; theirs.cuts.len()];
        for item in &stage.items {
            match item.key.form {
                Form::Mesh(number) | Form::Stretched(number) | Form::Net(number, _) => {
                    let source = &theirs.meshes[number as usize];
                    meshes[number as usize].get_or_insert_with(|| self.take_mesh(source.clone()));
                }
                Form::Polygon(_) => {
                    let number = item.finish.variant as usize;
                    cuts[number].get_or_insert_with(|| self.take_cut(theirs.cuts[number].clone()));
                }
                Form::Stem(_) | Form::Patch => {}
            }
        }
        [meshes, cuts].map(|numbers| numbers.into_iter().map(Option::unwrap_or_default).collect())
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
            MeshSource::Mesh(mesh) => mesh.clone(),
            MeshSource::Patches(patches, largest) => patches.mesh(accuracy / largest.max(f64::MIN_POSITIVE)),
        };
        let pictured = mesh.faces.first().filter(|_| !mesh.places.is_empty());
        let texture = pictured.and_then(|face| palette.texture(face.material).cloned());
        let mut form = MeshForm { texture, ..MeshForm::default() };
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
                    form.places.extend(mesh.places.get(corner as usize));
                    form.corners.push(corner);
                    (form.vertices.len() - 1) as u32
                })
            }));
        }
        form
    }
}
