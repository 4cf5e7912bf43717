//! Bicubic Bézier patches, and their tessellation by accuracy.
//!
//! A patch becomes a grid of triangles that deviates from it by no more than a given length: the second
//! differences of its control net bound its second derivatives, and these bound the deviation (Filip,
//! Magedson and Markot 1986, *Surface algorithms using bounds on derivatives*). The number of pieces of an edge
//! is a power of two that depends on the four points of that edge alone, so two patches that share an edge
//! have the same vertices there, and no cracks; finer grids inside are drawn together at the edge.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::bernstein::{Column, normal, point, slopes, weights};
use super::outline;
use super::pieces::{FINEST, Steps};
use super::{MaterialId, Mesh, OwnerId, Placement, Point, Surface, Vector, ball};

/// Control points by row and column. Seen with rows going up and columns going right, the front is towards
/// the viewer.
pub type Net = [[Point; 4]; 4];

/// A patch in space.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Control points in scene units.
    pub net: Net,
    /// Material of the whole patch.
    pub material: MaterialId,
    /// The module that drew it.
    pub owner: OwnerId,
}

impl Patch {
    /// Points whose convex hull the patch lies in, closer to it than its control points are.
    pub fn hull(&self) -> impl Iterator<Item = Point> {
        let mut nets = vec![self.net];
        for _ in 0..2 {
            nets = nets.iter().flat_map(quarters).collect();
        }
        nets.into_iter().flat_map(|net| net.into_iter().flatten())
    }

    /// The point of the patch at a place from 0 to 1 between its rows and between its columns.
    pub fn point(&self, row: f64, column: f64) -> Point {
        let weights = |u: f64| {
            let v = 1.0 - u;
            [v * v * v, 3.0 * v * v * u, 3.0 * v * u * u, u * u * u]
        };
        let (rows, columns) = (weights(row), weights(column));
        let mut sum = Vector::zeros();
        for (points, r) in self.net.iter().zip(rows) {
            for (point, c) in points.iter().zip(columns) {
                sum += point.coords * (r * c);
            }
        }
        Point::from(sum)
    }

    /// A measure of size: the lengths of the four edges of the control net.
    pub fn length(&self) -> f64 {
        edges(&self.net).iter().map(|e| (0..3).map(|i| (e[i + 1] - e[i]).norm()).sum::<f64>()).sum()
    }

    /// Numbers of pieces from column to column and from row to row of a grid of triangles that is about as near to the patch as `accuracy`, in scene units.
    pub fn pieces(&self, accuracy: f64) -> (usize, usize) {
        Steps::Whole.of_grid(&self.net, accuracy.max(f64::MIN_POSITIVE))
    }

    /// As a mesh in its place; `accuracy` is in scene units.
    pub fn surface(&self, accuracy: f64) -> Surface {
        self.placed(accuracy, Steps::Powers)
    }

    /// The same for a picture, of fewer triangles: pieces are any number, not a power of two, and their
    /// deviation is an estimate.
    pub fn draft(&self, accuracy: f64) -> Surface {
        self.placed(accuracy, Steps::Shape)
    }

    /// The same for a picture of outlines, of still fewer triangles: edges are as fine as the accuracy asks for, what is within them is coarser.
    pub fn outlined(&self, accuracy: f64) -> Surface {
        self.placed(accuracy, Steps::Outline)
    }

    fn placed(&self, accuracy: f64, steps: Steps) -> Surface {
        let origin = self.net[0][0];
        let reach = self.net.iter().flatten().map(|p| (p - origin).amax()).fold(0.0, f64::max);
        let scale = if reach > 0.0 { reach } else { 1.0 };
        let unit = self.net.map(|row| row.map(|p| Point::from((p - origin) / scale)));
        let mut mesh = Mesh::new();
        let paint = Paint { material: self.material, takes_tint: false, has_picture: false };
        tessellate(&unit, accuracy / scale, steps, paint, &mut mesh);
        let placement = Placement::uniform(origin, [Vector::x(), Vector::y(), Vector::z()], scale);
        Surface { mesh: Arc::new(mesh), patches: None, rest: None, placement, tint: None, owner: self.owner }
    }
}

/// A patch of a [`PatchSet`].
#[derive(Clone, Debug)]
pub struct PatchFace {
    /// Control points in units of the surface.
    pub net: Net,
    /// Its material, unless a colour replaces it.
    pub material: MaterialId,
    /// Whether a colour that the model chooses replaces the material.
    pub takes_tint: bool,
    /// Whether a picture is on it, the whole of it: columns go to its right, rows up.
    pub has_picture: bool,
}

/// A curved surface in coordinates of its own, drawn many times, at any size: patches, or a ball.
#[derive(Debug)]
pub struct PatchSet {
    shape: Curved,
    meshes: Meshes,
    /// For pictures.
    drafts: Meshes,
    outlines: Meshes,
}

/// Meshes that were made so far, by the exponent of their accuracy.
type Meshes = Mutex<BTreeMap<i32, Arc<Mesh>>>;

#[derive(Debug)]
enum Curved {
    Patches(Vec<PatchFace>),
    Ball(MaterialId),
}

impl PatchSet {
    /// The surface made of these patches.
    pub fn new(faces: Vec<PatchFace>) -> PatchSet {
        PatchSet::of(Curved::Patches(faces))
    }

    /// A ball of diameter 1 around the origin; a colour replaces its material.
    pub fn ball(material: MaterialId) -> PatchSet {
        PatchSet::of(Curved::Ball(material))
    }

    fn of(shape: Curved) -> PatchSet {
        PatchSet { shape, meshes: Mutex::default(), drafts: Mutex::default(), outlines: Mutex::default() }
    }

    /// True for a ball.
    pub fn is_ball(&self) -> bool {
        matches!(self.shape, Curved::Ball(_))
    }

    /// The surface as triangles that deviate from it by no more than `accuracy`, in its own units. Meshes
    /// are kept: accuracies within a factor of four share one.
    pub fn mesh(&self, accuracy: f64) -> Arc<Mesh> {
        // With 64 pieces an edge is as fine as it gets; coarser than a surface of unit size makes no sense.
        let exponent = (accuracy.log2() / 2.0).floor().clamp(-20.0, 0.0) as i32;
        self.kept(&self.meshes, exponent, 4_f64.powi(exponent), Steps::Powers)
    }

    /// The same for a picture, where the surface may be small: accuracies within a factor of the fourth root of two share a mesh, and a
    /// surface that is less than `accuracy` in size is a few triangles.
    pub fn draft(&self, accuracy: f64) -> Arc<Mesh> {
        self.kept_draft(&self.drafts, accuracy, Steps::Shape)
    }

    /// The same for a picture of outlines: see [`Patch::outlined`].
    pub fn outlined(&self, accuracy: f64) -> Arc<Mesh> {
        self.kept_draft(&self.outlines, accuracy, Steps::Outline)
    }

    fn kept_draft(&self, meshes: &Meshes, accuracy: f64, steps: Steps) -> Arc<Mesh> {
        let exponent = (4.0 * accuracy.log2()).floor().clamp(-160.0, 12.0);
        let accuracy = (exponent / 4.0).exp2();
        self.kept(meshes, exponent as i32, accuracy, steps)
    }

    fn kept(&self, meshes: &Meshes, exponent: i32, accuracy: f64, steps: Steps) -> Arc<Mesh> {
        let make = || {
            let mut mesh = Mesh::new();
            match &self.shape {
                Curved::Patches(faces) => {
                    for face in faces {
                        let PatchFace { material, takes_tint, has_picture, .. } = *face;
                        let paint = Paint { material, takes_tint, has_picture };
                        tessellate(&face.net, accuracy, steps, paint, &mut mesh);
                    }
                }
                Curved::Ball(material) => mesh = ball::mesh(accuracy, FINEST, *material),
            }
            Arc::new(mesh)
        };
        match meshes.lock() {
            Ok(mut meshes) => meshes.entry(exponent).or_insert_with(make).clone(),
            // Another thread panicked; the mesh is made again.
            Err(_) => make(),
        }
    }
}

/// The four edges: first row, last row, first column, last column.
fn edges(net: &Net) -> [[Point; 4]; 4] {
    [net[0], net[3], net.map(|row| row[0]), net.map(|row| row[3])]
}

pub(super) fn column(net: &Net, c: usize) -> [Point; 4] {
    net.map(|row| row[c])
}

/// What the triangles of a patch look like.
#[derive(Clone, Copy)]
pub(super) struct Paint {
    pub(super) material: MaterialId,
    pub(super) takes_tint: bool,
    pub(super) has_picture: bool,
}

/// Adds the triangles of a patch.
fn tessellate(net: &Net, accuracy: f64, steps: Steps, paint: Paint, mesh: &mut Mesh) {
    let accuracy = if accuracy > 0.0 { accuracy } else { f64::MIN_POSITIVE };
    let steps = match steps {
        // A picture is where its places are.
        Steps::Shape | Steps::Outline if paint.has_picture => Steps::Whole,
        steps => steps,
    };
    // Half of the deviation for the edge, half for the triangles that lead to it.
    let [bottom, top, left, right] = edges(net).map(|edge| steps.of_edge(&edge, accuracy / 2.0));
    let (columns, rows) = steps.of_grid(net, accuracy);
    let first = mesh.vertices.len() as u32;
    let edges = [bottom, top, left, right];
    if let (Steps::Outline, Some(grid)) = (steps, outline::within(edges, (columns, rows))) {
        outline::add(net, edges, grid, paint, mesh);
        return mesh.orient(first);
    }
    let (columns, rows) = (columns.max(bottom).max(top), rows.max(left).max(right));
    // On an edge the grid's vertices fall upon the nearest of those that the edge has: the number of that one, the first vertex of the
    // grid that falls upon it, and its parameter.
    let snap = |i: usize, count: usize, kept: usize| {
        let nearest = (i * kept + count / 2) / count;
        ((nearest * count).div_ceil(kept), nearest as f64 / kept as f64)
    };
    let columns_of: Vec<Column> =
        (0..=columns).map(|i| Column::new(net, i as f64 / columns as f64)).collect();
    let rows_of = (0..=rows).map(|j| j as f64 / rows as f64).map(|v| (v, weights(v), slopes(v)));
    let rows_of: Vec<(f64, [f64; 4], [f64; 4])> = rows_of.collect();
    let width = columns + 1;
    mesh.vertices.reserve(width * (rows + 1));
    mesh.normals.reserve(width * (rows + 1));
    mesh.faces.reserve(2 * columns * rows);
    let mut numbers = vec![u32::MAX; width * (rows + 1)];
    let mut add = |i: usize, j: usize, mesh: &mut Mesh| {
        let (own, mut i, mut j) = (j * width + i, i, j);
        let (mut along, mut across) = (None, None);
        if j == 0 || j == rows {
            let (snapped, u) = snap(i, columns, if j == 0 { bottom } else { top });
            (i, along) = (snapped, Some(u));
        }
        if i == 0 || i == columns {
            let (snapped, v) = snap(j, rows, if i == 0 { left } else { right });
            (j, across) = (snapped, Some(v));
        }
        if numbers[j * width + i] == u32::MAX {
            numbers[j * width + i] = mesh.vertices.len() as u32;
            let u = along.unwrap_or_else(|| i as f64 / columns as f64);
            let v = across.unwrap_or(rows_of[j].0);
            // On an edge it may be another one than that of the column and the row.
            let column = columns_of.get(i).filter(|column| column.u == u && rows_of[j].0 == v);
            let found = column.map(|column| column.at(net, &rows_of[j]));
            let (point, normal) = found.unwrap_or_else(|| (point(net, u, v), normal(net, u, v)));
            mesh.vertices.push(point);
            mesh.normals.push(normal);
            if paint.has_picture {
                mesh.places.push([u, v]);
            }
        }
        numbers[own] = numbers[j * width + i];
    };
    // In the order in which the corners of squares are met, each once.
    for j in 0..rows {
        for i in 0..columns {
            let is_first = [i == 0, j == 0];
            let corners = [(i, j, is_first == [true; 2]), (i + 1, j, is_first[1]), (i + 1, j + 1, true)];
            for (i, j, is_new) in corners.into_iter().chain([(i, j + 1, is_first[0])]) {
                if is_new {
                    add(i, j, mesh);
                }
            }
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let corner = j * width + i;
            let [a, b] = [numbers[corner], numbers[corner + 1]];
            let [d, c] = [numbers[corner + width], numbers[corner + width + 1]];
            // The diagonal that ends in the patch's own corner, so that no triangle has two of its edges;
            // but where vertices have fallen together, the one that leaves no slivers.
            let along = (i < columns / 2) == (j < rows / 2);
            let cuts = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]];
            let chosen = usize::from(!along);
            let distinct = i > 0 && j > 0 && i + 1 < columns && j + 1 < rows;
            let other = !distinct && quality(mesh, &cuts[1 - chosen]) > 1.5 * quality(mesh, &cuts[chosen]);
            for corners in cuts[if other { 1 - chosen } else { chosen }] {
                mesh.add_face(corners, paint.material, paint.takes_tint);
            }
        }
    }
    mesh.orient(first);
}

/// The least of the areas of two triangles, as far as they face as the first normal says; triangles with two
/// corners in one do not count.
fn quality(mesh: &Mesh, triangles: &[[u32; 3]; 2]) -> f64 {
    let facing = |corners: &[u32; 3]| {
        let [p, q, r] = corners.map(|i| mesh.vertices[i as usize]);
        (q - p).cross(&(r - p)).dot(&corners.iter().map(|&i| mesh.normals[i as usize]).sum::<Vector>())
    };
    let proper = triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a);
    proper.map(facing).fold(f64::INFINITY, f64::min)
}

/// A patch cut in four (de Casteljau).
fn quarters(net: &Net) -> [Net; 4] {
    let [low, high] = halves(net);
    let [a, b] = halves(&transposed(&low));
    let [c, d] = halves(&transposed(&high));
    [a, b, c, d].map(|net| transposed(&net))
}

fn transposed(net: &Net) -> Net {
    [0, 1, 2, 3].map(|c| column(net, c))
}

/// Cut across its columns.
fn halves(net: &Net) -> [Net; 2] {
    let middle = |a: &[Point; 4], b: &[Point; 4]| [0, 1, 2, 3].map(|c| nalgebra::center(&a[c], &b[c]));
    let (ab, bc, cd) = (middle(&net[0], &net[1]), middle(&net[1], &net[2]), middle(&net[2], &net[3]));
    let (abc, bcd) = (middle(&ab, &bc), middle(&bc, &cd));
    let all = middle(&abc, &bcd);
    [[net[0], ab, abc, all], [all, bcd, cd, net[3]]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAINT: Paint = Paint { material: MaterialId::LEAF, takes_tint: true, has_picture: true };

    /// A net over the unit square, raised by a function.
    fn raised(height: impl Fn(f64, f64) -> f64) -> Net {
        [0.0, 1.0, 2.0, 3.0].map(|r| [0.0, 1.0, 2.0, 3.0].map(|c| Point::new(c / 3.0, r / 3.0, height(c, r))))
    }

    fn mesh(net: &Net, accuracy: f64) -> Mesh {
        let mut mesh = Mesh::new();
        tessellate(net, accuracy, Steps::Powers, PAINT, &mut mesh);
        mesh
    }

    #[test]
    fn a_flat_patch_is_two_triangles_that_face_the_viewer() {
        let mesh = mesh(&raised(|_, _| 0.0), 1e-6);
        assert_eq!((mesh.vertices.len(), mesh.faces.len()), (4, 2));
        assert!(mesh.normals.iter().all(|n| (n - Vector::z()).norm() < 1e-12));
    }

    #[test]
    fn triangles_are_as_near_to_the_patch_as_they_should() {
        let net = raised(|c, r| 0.3 * (c * 1.7).sin() + 0.2 * c * r - 0.15 * r * r);
        for accuracy in [0.1, 1e-2, 1e-3] {
            let mesh = mesh(&net, accuracy);
            let mut worst: f64 = 0.0;
            for face in &mesh.faces {
                let [a, b, c] = face.corners.map(|i| mesh.vertices[i as usize]);
                let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
                // x and y of this net are its parameters.
                worst = worst.max((point(&net, middle.x, middle.y) - middle).norm());
                // And the places in a picture.
                for i in face.corners.map(|i| i as usize) {
                    let [u, v] = mesh.places[i];
                    assert!((mesh.vertices[i].x - u).abs() + (mesh.vertices[i].y - v).abs() < 1e-12);
                }
            }
            assert!(worst <= accuracy, "{worst} > {accuracy}");
            let area: f64 = mesh
                .faces
                .iter()
                .map(|f| {
                    let [a, b, c] = f.corners.map(|i| mesh.vertices[i as usize]);
                    (b - a).cross(&(c - a)).z / 2.0
                })
                .sum();
            assert!((area - 1.0).abs() < 1e-9, "the grid covers the square once: {area}");
        }
    }

    #[test]
    fn patches_that_share_an_edge_share_its_vertices() {
        // One bends much inside, the other is nearly flat; the common edge bends a little.
        let edge = |r: f64| 0.02 * r * (3.0 - r);
        let left = raised(|c, r| if c == 3.0 { edge(r) } else { (c * 2.0).sin() * 2.0 + r * r });
        let mut right = raised(|c, r| edge(r) * (1.0 - c / 3.0));
        right.iter_mut().flatten().for_each(|p| p.x += 1.0);
        let at_edge = |mesh: Mesh| {
            let mut heights: Vec<[i64; 2]> = (mesh.faces.iter())
                .flat_map(|f| f.corners)
                .map(|i| mesh.vertices[i as usize])
                .filter(|v| (v.x - 1.0).abs() < 1e-12)
                .map(|v| [(v.y * 1e12).round() as i64, (v.z * 1e12).round() as i64])
                .collect();
            heights.sort_unstable();
            heights.dedup();
            heights
        };
        let (a, b) = (at_edge(mesh(&left, 1e-3)), at_edge(mesh(&right, 1e-3)));
        assert_eq!(a, b);
        assert!(a.len() >= 5);
    }

    #[test]
    fn normals_are_smooth_and_agree_even_where_an_edge_is_a_point() {
        let mut net = raised(|c, r| 0.1 * r * (3.0 - r) + 0.05 * c * (3.0 - c));
        net[3] = [Point::new(0.5, 1.0, 0.0); 4];
        let mesh = mesh(&net, 1e-3);
        for face in &mesh.faces {
            let [a, b, c] = face.corners.map(|i| mesh.vertices[i as usize]);
            let facing = (b - a).cross(&(c - a));
            assert!(facing.norm() > 1e-12);
            for i in face.corners {
                assert!(
                    facing.dot(&mesh.normals[i as usize]) > 0.0,
                    "{face:?} {a} {b} {c} {facing} {} {} of {}",
                    mesh.normals[i as usize],
                    i,
                    mesh.vertices.len()
                );
                assert!((mesh.normals[i as usize].norm() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_hull_holds_the_patch_closely() {
        let owner = crate::scene::Scene::default()
            .add_owner(crate::scene::Owner { name: "@PD".into(), lineage: dlsys_tree::Lineage::of_axiom(0) });
        let net = raised(|c, r| if c == 1.0 && r == 1.0 { 9.0 } else { 0.0 });
        let patch = Patch { net, material: MaterialId::LEAF, owner };
        let highest = patch.hull().map(|p| p.z).fold(0.0, f64::max);
        let true_height = (0..100)
            .flat_map(|i| (0..100).map(move |j| (f64::from(i) / 100.0, f64::from(j) / 100.0)))
            .map(|(u, v)| point(&net, u, v).z)
            .fold(0.0, f64::max);
        assert!(highest >= true_height && highest < 1.2 * true_height, "{highest} {true_height}");
        assert!((patch.length() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn meshes_are_made_once_and_bounded() {
        let set = PatchSet::new(vec![PatchFace {
            net: raised(|c, r| (c * r).sin()),
            material: MaterialId::LEAF,
            takes_tint: true,
            has_picture: false,
        }]);
        assert!(Arc::ptr_eq(&set.mesh(0.01), &set.mesh(0.011)));
        assert!(set.mesh(0.0).faces.len() <= 2 * FINEST * FINEST);
        assert!(set.mesh(f64::INFINITY).faces.len() >= 2);
        assert!(set.mesh(1e-3).faces.len() > set.mesh(1e-1).faces.len());
    }

    #[test]
    fn drafts_are_as_near_as_they_should_with_fewer_triangles() {
        let net = raised(|c, r| 0.3 * (c * 1.7).sin() + 0.2 * c * r - 0.15 * r * r);
        for (accuracy, steps) in
            [0.1, 1e-2, 1e-3].into_iter().flat_map(|a| [(a, Steps::Whole), (a, Steps::Shape)])
        {
            let mut draft = Mesh::new();
            tessellate(&net, accuracy, steps, Paint { has_picture: false, ..PAINT }, &mut draft);
            let strict = mesh(&net, accuracy).faces.len();
            assert!(draft.faces.len() <= strict && (accuracy > 5e-3 || draft.faces.len() < strict));
            for face in &draft.faces {
                let [a, b, c] = face.corners.map(|i| draft.vertices[i as usize]);
                let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
                let away = (point(&net, middle.x, middle.y) - middle).norm();
                // Beside an edge, half as much is added by the edge's own pieces.
                assert!(away <= 1.5 * accuracy, "{away} > {accuracy}");
            }
        }
    }

    #[test]
    fn a_flat_patch_is_few_triangles_however_its_places_are_spread() {
        let mut net = raised(|_, _| 0.0);
        // Inner points are drawn to one side; the edges are straight, with even places.
        net[1..3].iter_mut().flat_map(|row| &mut row[1..3]).for_each(|p| p.x += 0.6);
        let faces = |steps| {
            let mut draft = Mesh::new();
            tessellate(&net, 1e-3, steps, Paint { has_picture: false, ..PAINT }, &mut draft);
            draft.faces.len()
        };
        assert!(4 * faces(Steps::Shape) < faces(Steps::Whole));
    }
}
