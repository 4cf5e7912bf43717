//! A scene as triangles: their numbering and order, for every format of meshes.
//!
//! ```text
//! Scene ──▶ Solid ──points, faces──▶ text of a file (obj), or Triangles in memory (png)
//! ```
//!
//! Vertices and normals are numbered first; then every part of the mesh can be made by itself. So a file is
//! written on several threads without the mesh being in memory.

use std::borrow::Cow;
use std::ops::Range;

use super::tube::{TubeStyle, Tubes};
use super::{Fit, triangulate};
use dlsys_geometry::scene::{Face, MaterialId, OwnerId, Point, Scene, Surface, Vector};

#[cfg(test)]
mod tests;

/// Takes vertices and normals, in the order of their numbers.
pub(super) trait Points {
    fn vertex(&mut self, at: impl FnOnce() -> Point);
    fn normal(&mut self, of: impl FnOnce() -> Vector);

    /// The places in a picture of the vertices that came last.
    fn places(&mut self, _places: &[[f64; 2]]) {}
}

/// Takes triangles; corners are counter-clockwise, seen from outside, each a vertex and a normal by number.
pub(super) trait Faces {
    fn face(&mut self, corners: [(u32, u32); 3]);

    /// A triangle under a picture: of each corner also the number of its place in that.
    fn pictured(&mut self, corners: [(u32, u32); 3], _places: [u32; 3]) {
        self.face(corners);
    }

    /// Triangles of a mesh of so many vertices, each with the normal of its number, from the first vertex and normal on.
    fn mesh(&mut self, [vertex, normal]: [u32; 2], _vertices: usize, faces: &[Face]) {
        for face in faces {
            self.face(face.corners.map(|k| (vertex + k, normal + k)));
        }
    }

    /// The side between two rings of as many corners, the second one further along. At a point a side has one triangle.
    fn strip(&mut self, from: Ring, to: Ring) {
        for k in 0..from.sides {
            let after = if k + 1 == from.sides { 0 } else { k + 1 };
            let [a, b, c, d] = [from.corner(k), from.corner(after), to.corner(after), to.corner(k)];
            if !from.point {
                self.face([a, b, c]);
            }
            if !to.point {
                self.face([a, c, d]);
            }
        }
    }

    /// The triangles between a ring and a pole, which is further along unless `reversed`.
    fn fan(&mut self, pole: (u32, u32), ring: Ring, reversed: bool) {
        for k in 0..ring.sides {
            let after = if k + 1 == ring.sides { 0 } else { k + 1 };
            let (a, b) = if reversed { (after, k) } else { (k, after) };
            self.face([pole, ring.corner(a), ring.corner(b)]);
        }
    }
}

/// Vertices and normals around a tube, by number: one after the other from the first ones.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Ring {
    pub(super) vertex: u32,
    pub(super) normal: u32,
    pub(super) sides: u32,
    /// All corners are one vertex.
    pub(super) point: bool,
    /// All corners have one normal.
    pub(super) flat: bool,
}

impl Ring {
    pub(super) fn corner(&self, k: u32) -> (u32, u32) {
        (self.vertex + if self.point { 0 } else { k }, self.normal + if self.flat { 0 } else { k })
    }
}

/// A part of a scene that is drawn at once and belongs to one module.
#[derive(Clone, Copy)]
enum Item {
    /// A piece of a tube.
    Stem(usize),
    Polygon(usize),
    Surface(usize),
}

/// Triangles of one material of one item.
struct Run {
    material: MaterialId,
    item: Item,
    /// Faces of the surface; of other items all.
    faces: Range<usize>,
}

/// A scene as triangles that are yet to be made.
pub(super) struct Solid<'s> {
    pub(super) scene: &'s Scene,
    tubes: Tubes<'s>,
    placed: Cow<'s, [Surface]>,
    /// Numbers of the first vertices and normals of each polygon and surface; of surfaces also of the first places in pictures.
    polygons: Vec<[u32; 2]>,
    surfaces: Vec<[u32; 3]>,
    /// Numbers of all vertices and normals.
    pub(super) counts: [u32; 2],
    /// Whether anything has places in a picture.
    pub(super) has_places: bool,
}

impl<'s> Solid<'s> {
    /// Of everything in a scene; stems are tubes with so many sides, 0: as many as it takes.
    pub(super) fn new(scene: &'s Scene, fit: &Fit, sides: usize) -> Solid<'s> {
        let tubes = Tubes::new(scene, TubeStyle { sides, ..fit.tubes() });
        Solid::of(scene, tubes, Cow::Borrowed(&scene.surfaces))
    }

    /// Of these tubes, the polygons of a scene, and these surfaces in place of its own.
    pub(super) fn of(scene: &'s Scene, tubes: Tubes<'s>, placed: Cow<'s, [Surface]>) -> Solid<'s> {
        let mut counts = tubes.counts;
        let mut number = |vertices: usize, normals: usize| {
            let first = counts;
            counts = [counts[0].saturating_add(vertices as u32), counts[1].saturating_add(normals as u32)];
            first
        };
        let polygons = scene.polygons.iter().map(|polygon| number(polygon.vertices.len(), 1)).collect();
        let mut places = 0_u32;
        let surfaces = placed.iter().map(|s| {
            let [vertex, normal] = number(s.mesh.vertices.len(), s.mesh.normals.len());
            let first = places;
            places = places.saturating_add(s.mesh.places.len() as u32);
            [vertex, normal, first]
        });
        let surfaces = surfaces.collect();
        Solid { scene, tubes, placed, polygons, surfaces, counts, has_places: places > 0 }
    }

    /// Number of items: pieces of stems, polygons, surfaces.
    pub(super) fn len(&self) -> usize {
        self.tubes.len() + self.polygons.len() + self.placed.len()
    }

    fn item(&self, n: usize) -> Item {
        let (stems, polygons) = (self.tubes.len(), self.polygons.len());
        match n {
            n if n < stems => Item::Stem(n),
            n if n < stems + polygons => Item::Polygon(n - stems),
            n => Item::Surface(n - stems - polygons),
        }
    }

    fn owner(&self, item: Item) -> OwnerId {
        match item {
            Item::Stem(i) => self.tubes.segment(i).owner,
            Item::Polygon(i) => self.scene.polygons[i].owner,
            Item::Surface(i) => self.placed[i].owner,
        }
    }

    /// Numbers of the first vertex and normal of an item.
    fn first(&self, n: usize) -> [u32; 2] {
        match self.item(n) {
            Item::Stem(i) => self.tubes.first(i),
            Item::Polygon(i) => self.polygons[i],
            Item::Surface(i) => {
                let [vertex, normal, _] = self.surfaces[i];
                [vertex, normal]
            }
        }
    }

    /// Whether an item has corners that belong to the one before.
    fn begins_on_one_before(&self, n: usize) -> bool {
        matches!(self.item(n), Item::Stem(i) if self.tubes.begins_on_one_before(i))
    }

    /// The module that an item belongs to.
    pub(super) fn owner_of(&self, n: usize) -> OwnerId {
        self.owner(self.item(n))
    }

    /// How much there is to an item, in points.
    fn weight(&self, n: usize) -> usize {
        match self.item(n) {
            Item::Stem(i) => self.tubes.points_of(i),
            Item::Polygon(i) => self.scene.polygons[i].vertices.len(),
            Item::Surface(i) => self.placed[i].mesh.vertices.len(),
        }
    }

    /// Cuts a list of items in parts of about as many points.
    pub(super) fn parts(&self, items: impl Iterator<Item = usize>, points: usize) -> Vec<Range<usize>> {
        let mut parts = Vec::new();
        let (mut start, mut end, mut weight) = (0, 0, 0);
        for item in items {
            end += 1;
            weight += self.weight(item);
            if weight >= points {
                parts.push(start..end);
                (start, weight) = (end, 0);
            }
        }
        if end > start {
            parts.push(start..end);
        }
        parts
    }

    /// Makes the vertices and normals of some items, in order.
    pub(super) fn points(&self, items: Range<usize>, out: &mut impl Points) {
        let stems = self.tubes.len();
        self.tubes.points(items.start.min(stems)..items.end.min(stems), out);
        for n in items.start.max(stems)..items.end {
            match self.item(n) {
                Item::Stem(_) => {}
                Item::Polygon(i) => {
                    let polygon = &self.scene.polygons[i];
                    out.normal(|| triangulate::normal(&polygon.vertices));
                    for &p in &polygon.vertices {
                        out.vertex(|| p);
                    }
                }
                Item::Surface(i) => {
                    let surface = &self.placed[i];
                    for &v in &surface.mesh.vertices {
                        out.vertex(|| surface.placement.point(v));
                    }
                    for &n in &surface.mesh.normals {
                        out.normal(|| surface.placement.normal(n));
                    }
                    if !surface.mesh.places.is_empty() {
                        out.places(&surface.mesh.places);
                    }
                }
            }
        }
    }

    /// All items by owner, else in their order. A sort by counting: owners are numbers from 0.
    pub(super) fn by_owner(&self) -> Vec<u32> {
        let mut next = vec![0_u32; self.scene.owners().len() + 1];
        for n in 0..self.len() {
            next[self.owner_of(n).index() + 1] += 1;
        }
        for owner in 1..next.len() {
            next[owner] += next[owner - 1];
        }
        let mut order = vec![0_u32; self.len()];
        for n in 0..self.len() {
            let place = &mut next[self.owner_of(n).index()];
            order[*place as usize] = n as u32;
            *place += 1;
        }
        order
    }

    /// Makes the triangles of items that are given [by owner](Solid::by_owner), by material within an owner: `begin`
    /// is told the owner and the material before those that have them, and the number of their segment if they are of a stem. All of an
    /// owner must be given at once.
    pub(super) fn faces<Out: Faces>(
        &self,
        items: &[u32],
        out: &mut Out,
        mut begin: impl FnMut(&mut Out, OwnerId, MaterialId, Option<usize>),
    ) {
        let owner = |n: u32| self.owner_of(n as usize);
        let mut runs: Vec<Run> = Vec::new();
        for group in items.chunk_by(|&a, &b| owner(a) == owner(b)) {
            runs.clear();
            for &n in group {
                self.add_runs(self.item(n as usize), &mut runs);
            }
            // Stable, so that triangles stay in the order in which they were made.
            if !runs.is_sorted_by_key(|run| run.material) {
                runs.sort_by_key(|run| run.material);
            }
            for run in &runs {
                let segment = match run.item {
                    Item::Stem(piece) => Some(self.tubes.segment_number(piece)),
                    Item::Polygon(_) | Item::Surface(_) => None,
                };
                begin(out, owner(group[0]), run.material, segment);
                self.faces_of(run, out);
            }
        }
    }

    fn add_runs(&self, item: Item, runs: &mut Vec<Run>) {
        match item {
            Item::Stem(i) => runs.push(Run { material: self.tubes.segment(i).material, item, faces: 0..0 }),
            Item::Polygon(i) => {
                runs.push(Run { material: self.scene.polygons[i].material, item, faces: 0..0 });
            }
            Item::Surface(i) => {
                let surface = &self.placed[i];
                for (start, face) in surface.mesh.faces.iter().enumerate() {
                    let material = surface.tint.filter(|_| face.takes_tint).unwrap_or(face.material);
                    match runs.last_mut().filter(|run| start > 0 && run.material == material) {
                        Some(run) => run.faces.end += 1,
                        None => runs.push(Run { material, item, faces: start..start + 1 }),
                    }
                }
            }
        }
    }

    fn faces_of(&self, run: &Run, out: &mut impl Faces) {
        match run.item {
            Item::Stem(i) => self.tubes.faces(i, out),
            Item::Polygon(i) => {
                let vertices = &self.scene.polygons[i].vertices;
                let [first, normal] = self.polygons[i];
                for triangle in triangulate::triangulate(vertices, triangulate::normal(vertices)) {
                    out.face(triangle.map(|k| (first + k as u32, normal)));
                }
            }
            Item::Surface(i) => {
                let [vertex, normal, place] = self.surfaces[i];
                let mesh = &self.placed[i].mesh;
                let faces = &mesh.faces[run.faces.clone()];
                if mesh.places.is_empty() {
                    return out.mesh([vertex, normal], mesh.vertices.len(), faces);
                }
                for face in faces {
                    let corners = face.corners.map(|k| (vertex + k, normal + k));
                    out.pictured(corners, face.corners.map(|k| place + k));
                }
            }
        }
    }
}

/// A triangle: vertex and normal at each corner, by number.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    pub(super) owner: OwnerId,
    pub(super) material: MaterialId,
    pub(super) corners: [(u32, u32); 3],
    /// The surface that it is a part of, by number; and whether that is a leaf or the like, through which light comes.
    pub(super) surface: u32,
    pub(super) is_thin: bool,
}

/// A triangle mesh in memory.
pub(super) struct Triangles {
    pub(super) vertices: Vec<Point>,
    pub(super) normals: Vec<Vector>,
    /// By vertex: where it lies in the picture of its material. Empty if nothing has a picture.
    pub(super) places: Vec<[f64; 2]>,
    pub(super) faces: Vec<Triangle>,
    /// By number of a surface: the segment that it is a part of.
    pub(super) segments: Vec<Option<u32>>,
    /// Of the triangles that come next.
    owner: OwnerId,
    material: MaterialId,
    surface: u32,
    is_thin: bool,
}

impl Points for Triangles {
    fn vertex(&mut self, at: impl FnOnce() -> Point) {
        self.vertices.push(at());
    }

    fn normal(&mut self, of: impl FnOnce() -> Vector) {
        self.normals.push(of());
    }

    fn places(&mut self, places: &[[f64; 2]]) {
        self.places.resize(self.vertices.len() - places.len(), [0.0; 2]);
        self.places.extend(places);
    }
}

impl Faces for Triangles {
    fn face(&mut self, corners: [(u32, u32); 3]) {
        let Triangles { owner, material, surface, is_thin, .. } = *self;
        self.faces.push(Triangle { owner, material, corners, surface, is_thin });
    }
}

impl Triangles {
    /// None, with room for so many vertices, normals and triangles.
    pub(super) fn with_capacity(vertices: usize, normals: usize, faces: usize) -> Triangles {
        Triangles {
            vertices: Vec::with_capacity(vertices),
            normals: Vec::with_capacity(normals),
            places: Vec::new(),
            faces: Vec::with_capacity(faces),
            segments: vec![None],
            owner: OwnerId::default(),
            material: MaterialId::STEM,
            surface: 0,
            is_thin: false,
        }
    }

    /// Adds all triangles of another mesh, none of which is a part of a stem.
    pub(super) fn append(&mut self, other: &Triangles) {
        let [vertex, normal] = [self.vertices.len(), self.normals.len()].map(|count| count as u32);
        if !(self.places.is_empty() && other.places.is_empty()) {
            self.places.resize(self.vertices.len(), [0.0; 2]);
            self.places.extend_from_slice(&other.places);
            self.places.resize(self.vertices.len() + other.vertices.len(), [0.0; 2]);
        }
        self.vertices.extend_from_slice(&other.vertices);
        self.normals.extend_from_slice(&other.normals);
        let first = self.segments.len() as u32;
        let last = other.faces.iter().map(|face| face.surface).max();
        self.segments.resize(self.segments.len() + last.map_or(0, |last| last as usize + 1), None);
        self.faces.extend(other.faces.iter().map(|face| Triangle {
            corners: face.corners.map(|(v, n)| (vertex + v, normal + n)),
            surface: first + face.surface,
            ..*face
        }));
        self.surface = self.segments.len() as u32 - 1;
    }

    /// Keeps some of the triangles, and vertices and normals that these have. Their order stays.
    pub(super) fn retain(&mut self, is_kept: impl Fn(&Triangle, &[Point]) -> bool) {
        let Triangles { vertices, normals, places, faces, .. } = self;
        faces.retain(|face| is_kept(face, vertices));
        let corners = || faces.iter().flat_map(|face| face.corners);
        let vertex = renumbered(vertices.len(), corners().map(|(vertex, _)| vertex));
        let normal = renumbered(normals.len(), corners().map(|(_, normal)| normal));
        keep_numbered(vertices, &vertex);
        keep_numbered(places, &vertex);
        keep_numbered(normals, &normal);
        for face in faces {
            face.corners = face.corners.map(|(v, n)| (vertex[v as usize], normal[n as usize]));
        }
    }

    /// Leaves out the far sides of stems and of ground: these are closed, so nothing of them is seen. Vertices are given as the camera sees them.
    pub(super) fn without_far_sides(&mut self, seen: &[Point]) {
        self.faces.retain(|face| {
            let [p, q, r] = face.corners.map(|(vertex, _)| seen[vertex as usize]);
            let is_far = (q.x - p.x) * (r.y - p.y) <= (q.y - p.y) * (r.x - p.x);
            face.is_thin || !is_far
        });
    }

    /// Everything in a solid, in string order; stems, by number, only if they are to be `kept`.
    pub(super) fn of(solid: &Solid, kept: impl Fn(usize) -> bool) -> Triangles {
        let [vertices, normals] = solid.counts.map(|count| count as usize);
        let mut mesh = Triangles::with_capacity(vertices, normals, 2 * vertices);
        solid.points(0..solid.len(), &mut mesh);
        if solid.has_places {
            mesh.places.resize(mesh.vertices.len(), [0.0; 2]);
        }
        let mut items = solid.by_owner();
        items.retain(|&n| match solid.item(n as usize) {
            Item::Stem(piece) => kept(solid.tubes.segment_number(piece)),
            _ => true,
        });
        mesh.add_faces(solid, &items);
        mesh
    }

    /// Some items of a solid, in the order of the list, with the vertices and normals that these have.
    pub(super) fn of_items(solid: &Solid, items: &[u32]) -> Triangles {
        let mut mesh = Triangles::with_capacity(0, 0, 0);
        mesh.add_faces(solid, items);
        // The items that have those, in runs, and the first numbers of each run: in the solid and here.
        let before = |&n: &u32| solid.begins_on_one_before(n as usize).then(|| n - 1);
        let mut all: Vec<u32> = items.iter().flat_map(|n| before(n).into_iter().chain([*n])).collect();
        all.sort_unstable();
        all.dedup();
        let mut firsts: Vec<[[u32; 2]; 2]> = Vec::new();
        for run in all.chunk_by(|a, b| a + 1 == *b) {
            let here = [mesh.vertices.len() as u32, mesh.normals.len() as u32];
            firsts.push([solid.first(run[0] as usize), here]);
            solid.points(run[0] as usize..run[run.len() - 1] as usize + 1, &mut mesh);
        }
        if solid.has_places {
            mesh.places.resize(mesh.vertices.len(), [0.0; 2]);
        }
        let here = |number: u32, kind: usize| {
            let run = firsts.partition_point(|[of_solid, _]| of_solid[kind] <= number) - 1;
            number - firsts[run][0][kind] + firsts[run][1][kind]
        };
        for face in &mut mesh.faces {
            face.corners = face.corners.map(|(vertex, normal)| (here(vertex, 0), here(normal, 1)));
        }
        mesh
    }

    /// Adds the triangles of items of a solid, with the solid's numbers of vertices and normals.
    fn add_faces(&mut self, solid: &Solid, items: &[u32]) {
        solid.faces(items, self, |mesh, owner, material, segment| {
            // No light comes through the ground.
            let is_thin = segment.is_none() && Some(owner) != solid.scene.terrain;
            (mesh.owner, mesh.material, mesh.is_thin) = (owner, material, is_thin);
            mesh.surface += 1;
            mesh.segments.push(segment.map(|segment| segment as u32));
        });
    }
}

/// New numbers for those of so many things that are used, in their order; `u32::MAX` for the others.
pub(super) fn renumbered(count: usize, used: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut numbers = vec![u32::MAX; count];
    used.for_each(|old| numbers[old as usize] = 0);
    let used = numbers.iter_mut().filter(|number| **number == 0);
    (0..).zip(used).for_each(|(next, number)| *number = next);
    numbers
}

/// Keeps those of all things that have a new number.
pub(super) fn keep_numbered<T>(all: &mut Vec<T>, numbers: &[u32]) {
    let mut numbers = numbers.iter();
    all.retain(|_| numbers.next().is_some_and(|number| *number != u32::MAX));
}
