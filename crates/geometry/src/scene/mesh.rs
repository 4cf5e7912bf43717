//! Triangle meshes in coordinates of their own.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, OnceLock};

use super::{MaterialId, Point, Vector};

/// A triangle mesh with smooth normals. Its axes are the turtle's: heading, left, up.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Places of the vertices.
    pub vertices: Vec<Point>,
    /// One unit normal for each vertex.
    pub normals: Vec<Vector>,
    /// Where each vertex lies in the picture on the mesh: to the right and up, from its lower left corner, each in parts of its side. Empty if there is none.
    pub places: Vec<[f64; 2]>,
    /// The triangles.
    pub faces: Vec<Face>,
    /// The box around it, once that was needed.
    bounds: OnceLock<Option<[Point; 2]>>,
    /// Coarser ones that were made so far, by the exponent of their accuracy.
    coarser: Coarser,
}

/// Meshes that stand for a finer one; a copy of that begins without them.
#[derive(Debug, Default)]
struct Coarser(Mutex<BTreeMap<i32, Arc<Mesh>>>);

impl Clone for Coarser {
    fn clone(&self) -> Coarser {
        Coarser::default()
    }
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
        Mesh {
            vertices: Vec::new(),
            normals: Vec::new(),
            places: Vec::new(),
            faces: Vec::new(),
            bounds: OnceLock::new(),
            coarser: Coarser::default(),
        }
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

    /// Middle and radius of a ball around all vertices.
    pub fn ball(&self) -> (Point, f64) {
        let around = |[low, high]: [Point; 2]| (nalgebra::center(&low, &high), (high - low).norm() / 2.0);
        self.bounds().map_or((Point::origin(), 0.0), around)
    }

    /// The mesh for a picture in which it may be small: of vertices nearer to one another than `accuracy`, in its own units, one is left, and triangles
    /// with two corners in one are gone. `None` if that would be hardly fewer triangles. Meshes are kept: accuracies within a factor of two share one.
    pub fn draft(&self, accuracy: f64) -> Option<Arc<Mesh>> {
        /// Parts of the extent: with finer cells than this, hardly any vertices fall together.
        const FINEST: f64 = 1.0 / 256.0;
        let [low, high] = self.bounds()?;
        if accuracy.is_nan() || accuracy < FINEST * (high - low).max() {
            return None;
        }
        let exponent = accuracy.log2().floor().min(60.0) as i32;
        let make = || Arc::new(self.clustered(2_f64.powi(exponent)));
        let coarse = match self.coarser.0.lock() {
            Ok(mut known) => known.entry(exponent).or_insert_with(make).clone(),
            Err(_) => make(),
        };
        (coarse.faces.len() * 4 <= self.faces.len() * 3).then_some(coarse)
    }

    /// One vertex for each cell of a grid whose diagonal is at most `accuracy`: the first one there, with the mean of the normals.
    fn clustered(&self, accuracy: f64) -> Mesh {
        let side = accuracy / 3_f64.sqrt();
        let mut mesh = Mesh::new();
        let mut cells: HashMap<[i64; 3], u32> = HashMap::new();
        let numbers: Vec<u32> = (self.vertices.iter().zip(&self.normals).enumerate())
            .map(|(i, (vertex, normal))| {
                let cell = [0, 1, 2].map(|k| (vertex[k] / side).floor() as i64);
                let number = *cells.entry(cell).or_insert(mesh.vertices.len() as u32);
                if number as usize == mesh.vertices.len() {
                    mesh.vertices.push(*vertex);
                    mesh.normals.push(Vector::zeros());
                    mesh.places.extend(self.places.get(i));
                }
                mesh.normals[number as usize] += normal;
                number
            })
            .collect();
        for face in &self.faces {
            let corners @ [a, b, c] = face.corners.map(|corner| numbers[corner as usize]);
            if a != b && b != c && c != a {
                mesh.faces.push(Face { corners, ..*face });
            }
        }
        mesh.finish()
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
        let area = |face: &Face| {
            let [p, q, r] = face.corners;
            let [p, q, r] = [self.vertices[p as usize], self.vertices[q as usize], self.vertices[r as usize]];
            (q - p).cross(&(r - p))
        };
        let is_wrong = |area: &Vector, corner: u32| area.dot(&self.normals[corner as usize]) <= 0.0;
        // Mostly the last ones of all.
        let from = self.faces.partition_point(|face| face.corners[0] < first);
        let faces = || self.faces[from..].iter().filter(|face| face.corners[0] >= first);
        let all_right = faces().all(|face| {
            let area = area(face);
            !face.corners.iter().any(|corner| is_wrong(&area, *corner))
        });
        if all_right {
            return;
        }
        let mut means = vec![Vector::zeros(); self.vertices.len() - first as usize];
        let mut wrong = vec![false; means.len()];
        for face in faces() {
            let area = area(face);
            for corner in face.corners {
                means[(corner - first) as usize] += area;
                wrong[(corner - first) as usize] |= is_wrong(&area, corner);
            }
        }
        let normals = &mut self.normals[first as usize..];
        for ((normal, mean), _) in normals.iter_mut().zip(means).zip(wrong).filter(|(_, wrong)| *wrong) {
            *normal = mean.try_normalize(1e-300).unwrap_or(*normal);
        }
    }

    /// This mesh under a picture, with the place of each vertex in that. No colour replaces it.
    pub fn under_picture(mut self, places: Vec<[f64; 2]>) -> Mesh {
        self.faces.iter_mut().for_each(|face| face.takes_tint = false);
        Mesh { places, ..self }
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

    /// The same faces with their vertices in other places, and normals that follow the faces.
    pub fn moved(&self, vertices: Vec<Point>) -> Mesh {
        let normals = self.normals_at(|corner| vertices[corner as usize]);
        let places = self.places.clone();
        Mesh { vertices, normals, places, faces: self.faces.clone(), ..Mesh::new() }.finish()
    }

    /// For each vertex the sum of the vector areas of its faces, times 2, where its vertices are elsewhere.
    pub fn normals_at(&self, vertex: impl Fn(u32) -> Point) -> Vec<Vector> {
        let mut normals = vec![Vector::zeros(); self.vertices.len()];
        for face in &self.faces {
            let [p, q, r] = face.corners.map(&vertex);
            let area = (q - p).cross(&(r - p));
            face.corners.iter().for_each(|&corner| normals[corner as usize] += area);
        }
        normals
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_mesh_is_few_triangles_no_further_away_than_asked() {
        let rows: Vec<Vec<Point>> = (0..=20)
            .map(|i| {
                let u = f64::from(i) / 20.0;
                (0..=20).map(|j| Point::new(u, f64::from(j) / 20.0, 0.2 * (3.0 * u).sin())).collect()
            })
            .collect();
        let mut mesh = Mesh::new();
        mesh.add_grid(&rows, MaterialId::LEAF, true);
        let mesh = mesh.finish();
        assert!(mesh.draft(1e-3).is_none(), "nothing falls together");
        let mut before = mesh.faces.len();
        for accuracy in [0.13, 0.26, 0.52] {
            let coarse = mesh.draft(accuracy).expect("coarser");
            assert!(coarse.faces.len() < before && !coarse.faces.is_empty());
            before = coarse.faces.len();
            let distance =
                |p: &Point| coarse.vertices.iter().map(|q| (p - q).norm()).fold(f64::MAX, f64::min);
            assert!(mesh.vertices.iter().all(|p| distance(p) <= accuracy));
            assert!(coarse.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-12 && n.z < 0.0));
            assert!(Arc::ptr_eq(&coarse, &mesh.draft(accuracy * 1.01).expect("kept")));
        }
        assert!(mesh.draft(f64::INFINITY).expect("coarser").faces.is_empty());
    }
}
