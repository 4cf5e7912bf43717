//! Triangle meshes in coordinates of their own.

use std::sync::OnceLock;

use super::{MaterialId, Point, Vector};

/// A triangle mesh with smooth normals. Its axes are the turtle's: heading, left, up.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Places of the vertices.
    pub vertices: Vec<Point>,
    /// One unit normal for each vertex.
    pub normals: Vec<Vector>,
    /// The triangles.
    pub faces: Vec<Face>,
    /// The box around it, once that was needed.
    bounds: OnceLock<Option<[Point; 2]>>,
}

/// A triangle, counter-clockwise seen from the side to which its normals point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Vertices by number.
    pub corners: [u32; 3],
    /// Its material, unless a colour replaces it.
    pub material: MaterialId,
    /// Whether a colour that the model chooses replaces the material.
    pub takes_tint: bool,
}

impl Mesh {
    /// A mesh without faces.
    pub fn new() -> Mesh {
        Mesh { vertices: Vec::new(), normals: Vec::new(), faces: Vec::new(), bounds: OnceLock::new() }
    }

    /// Opposite corners of a box around all vertices, wider than them by more than rounding; `None` if there are none. It is computed once:
    /// vertices must not change afterwards.
    pub fn bounds(&self) -> Option<[Point; 2]> {
        const MARGIN: f64 = 1e-9;
        *self.bounds.get_or_init(|| {
            let first = self.vertices.first()?;
            let (low, high) =
                self.vertices.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
            let margin = Vector::repeat(MARGIN * low.coords.amax().max(high.coords.amax()));
            Some([low - margin, high + margin])
        })
    }

    /// Adds a grid of vertices, `rows` of equal length, as two triangles to each square. Seen with rows
    /// going up and columns going right, the front is towards the viewer. Triangles without area, as where
    /// a row shrinks to a point, are left out.
    pub fn add_grid(&mut self, rows: &[Vec<Point>], material: MaterialId, takes_tint: bool) {
        let first = self.vertices.len() as u32;
        let columns = rows.first().map_or(0, Vec::len) as u32;
        self.vertices.extend(rows.iter().flatten());
        self.normals.resize(self.vertices.len(), Vector::zeros());
        for row in 1..rows.len() as u32 {
            for column in 1..columns {
                let b = first + row * columns + column;
                let a = b - columns;
                for corners in [[a - 1, a, b], [a - 1, b, b - 1]] {
                    let [p, q, r] = corners.map(|i| self.vertices[i as usize]);
                    let area = (q - p).cross(&(r - p));
                    if area.norm() < 1e-12 {
                        continue;
                    }
                    self.faces.push(Face { corners, material, takes_tint });
                    for corner in corners {
                        self.normals[corner as usize] += area;
                    }
                }
            }
        }
    }

    /// Adds a triangle unless it has no area. Lengths are of the order of 1.
    pub(super) fn add_face(&mut self, corners: [u32; 3], material: MaterialId, takes_tint: bool) {
        let [p, q, r] = corners.map(|i| self.vertices[i as usize]);
        if (q - p).cross(&(r - p)).norm() > 1e-12 {
            self.faces.push(Face { corners, material, takes_tint });
        }
    }

    /// Where a normal does not agree with a triangle at its vertex, as on a fold, the mean of the triangles
    /// there takes its place. `first` is the first vertex to look at.
    pub(super) fn orient(&mut self, first: u32) {
        let mut means = vec![Vector::zeros(); self.vertices.len() - first as usize];
        let mut wrong = vec![false; means.len()];
        for face in self.faces.iter().filter(|face| face.corners[0] >= first) {
            let [p, q, r] = face.corners.map(|i| self.vertices[i as usize]);
            let area = (q - p).cross(&(r - p));
            for corner in face.corners {
                means[(corner - first) as usize] += area;
                wrong[(corner - first) as usize] |= area.dot(&self.normals[corner as usize]) <= 0.0;
            }
        }
        let normals = &mut self.normals[first as usize..];
        for ((normal, mean), _) in normals.iter_mut().zip(means).zip(wrong).filter(|(_, wrong)| *wrong) {
            *normal = mean.try_normalize(1e-300).unwrap_or(*normal);
        }
    }

    /// A mesh of triangles, each with its corners and its material. Where there are no normals, each vertex gets the mean of its triangles'.
    pub fn of_triangles(
        vertices: Vec<Point>,
        normals: &[Vector],
        triangles: impl IntoIterator<Item = ([u32; 3], MaterialId)>,
    ) -> Mesh {
        let normals_of = vec![Vector::zeros(); vertices.len()];
        let mut mesh = Mesh { normals: normals_of, vertices, ..Mesh::new() };
        for (corners, material) in triangles {
            let [p, q, r] = corners.map(|i| mesh.vertices[i as usize]);
            let area = (q - p).cross(&(r - p));
            if area == Vector::zeros() {
                continue;
            }
            mesh.faces.push(Face { corners, material, takes_tint: true });
            for corner in corners {
                mesh.normals[corner as usize] += area;
            }
        }
        let mut mesh = mesh.finish();
        for (own, given) in mesh.normals.iter_mut().zip(normals) {
            *own = given.try_normalize(1e-300).unwrap_or(*own);
        }
        mesh
    }

    /// Brings the normals to unit length, after the last grid.
    pub fn finish(mut self) -> Mesh {
        for normal in &mut self.normals {
            *normal = normal.try_normalize(1e-300).unwrap_or_else(Vector::z);
        }
        self
    }
}

impl Default for Mesh {
    fn default() -> Mesh {
        Mesh::new()
    }
}
