//! Fields as regions: what an SVG is made of if a scene has plants of other models in it.
//!
//! Plants outside of the picture are left out. As many of the others as there is room for, the largest in the picture first, are drawn as what they consist of, module by
//! module. All smaller ones are drafts, as in a PNG ([`Stage`]), of which only those triangles are kept that nothing hides, and each is one thing. So
//! memory and the size of a file follow from what is seen, not from the number of plants.
//!
//! ```text
//! parts, the nearest first ──▶ depths by cell ──▶ of each small plant the triangles that are in front
//! ```

use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::ops::Range;

use super::draft::{self, Draft};
use super::lens::Lens;
use super::raster::cells::{self, Given, Middles};
use super::raster::{self, Place};
use super::shot;
use super::stage::{Part, Stage};
use super::trace::{CELLS_PER_PIXEL, MOST_CELLS};
use super::triangles::{Triangle, Triangles};
use super::{Fit, Page};
use dlsys_geometry::scene::{OwnerId, Placement, Plant, Point, Scene, Vector};
use dlsys_threads::each;

/// How much finer than in pixels surfaces are in drawings of vectors, which are looked at enlarged.
const FINER: f64 = 2.0;
/// How much larger or smaller than in the plane of focus surfaces are drawn with more or less detail.
const MOST_MAGNIFIED: f64 = 100.0;
/// About how many triangles all plants have that are drawn as what they consist of.
const MOST_OF_LARGE: usize = 2_000_000;
/// Most triangles of small plants that are seen.
const MOST_OF_SMALL: usize = 12_000_000;
/// Plants of more pixels are near: of those their parts have different sizes in the picture.
const EVEN: f64 = 500.0;
/// About how many triangles a stem has.
const STEM: usize = 80;
/// Parts that are made side by side.
const BLOCK: usize = 64;
/// What is behind by no more than this, in the rasteriser's depths, is not hidden.
const EQUAL: f32 = 1e-5;

/// A scene on a page, and which of its plants are large.
pub(super) struct Field<'s> {
    scene: &'s Scene,
    fit: &'s Fit,
    page: &'s Page,
    lens: Lens,
    /// By plant: what is drawn of it.
    shown: Vec<Shown>,
    /// Most triangles of small plants that are seen.
    most_of_small: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    Nothing,
    Draft,
    All,
}

impl<'s> Field<'s> {
    /// A scene in the picture of a frame.
    pub(super) fn of(scene: &'s Scene, fit: &'s Fit, page: &'s Page) -> Field<'s> {
        Field::within([MOST_OF_LARGE, MOST_OF_SMALL], scene, fit, page)
    }

    /// The same with room for about so many triangles of large plants, and for so many of small ones that are seen.
    fn within(
        [most_of_large, most_of_small]: [usize; 2],
        scene: &'s Scene,
        fit: &'s Fit,
        page: &'s Page,
    ) -> Field<'s> {
        let lens = Lens::new(fit, page.pixels, page.placement());
        let shown = vec![Shown::Nothing; scene.plants.len()];
        let mut field = Field { scene, fit, page, lens, shown, most_of_small };
        let mut seen: Vec<(f64, usize)> = (scene.plants.iter().enumerate())
            .filter_map(|(number, plant)| Some((field.size(plant)?, number)))
            .collect();
        seen.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let (mut counts, mut sum) = (HashMap::new(), 0);
        for (size, number) in seen {
            let count = field.triangles(&scene.plants[number], size, &mut counts);
            let has_room = sum + count <= most_of_large;
            sum += if has_room { count } else { 0 };
            field.shown[number] = if has_room { Shown::All } else { Shown::Draft };
        }
        field
    }

    /// The diameter of a plant in the picture, in pixels; `None` if it is outside.
    fn size(&self, plant: &Plant) -> Option<f64> {
        let [low, high] = plant.bounds()?;
        let radius = (high - low).norm() / 2.0 * plant.placement.largest();
        let seen = self.lens.scale_of(plant.placement.point(nalgebra::center(&low, &high)), radius)?;
        Some(2.0 * radius * seen)
    }

    /// About how many triangles a plant of this size has if it is drawn as what it consists of, given the numbers of what is seen about evenly, by scene
    /// and half power of two of the accuracy.
    fn triangles(&self, plant: &Plant, size: f64, known: &mut HashMap<(usize, i32), usize>) -> usize {
        let place = &plant.placement;
        let at_middle = self.accuracy(place.origin);
        let count = || count(&plant.scene, place, &|at| self.accuracy(at));
        if size > EVEN {
            return count();
        }
        let exponent = (2.0 * (at_middle / place.largest()).log2()).round() as i32;
        *known.entry(((&raw const *plant.scene).addr(), exponent)).or_insert_with(count)
    }

    /// Greatest distance of triangles from surfaces at a place, in scene units.
    fn accuracy(&self, at: Point) -> f64 {
        let [pixels, ..] = self.page.placement();
        let nearer = self.fit.camera.magnification(self.fit.camera.project(at).z);
        let scale = pixels * nearer.clamp(1.0 / MOST_MAGNIFIED, MOST_MAGNIFIED);
        draft::accuracy(FINER * scale, self.fit.accuracy * pixels)
    }

    /// The scene with its large plants, all as elements of its own, without patches.
    pub(super) fn large(&self) -> Cow<'s, Scene> {
        let accuracy = |at| self.accuracy(at);
        match self.scene.flattened_with(|number| self.shown[number] == Shown::All) {
            Cow::Borrowed(scene) => self.fit.drawn(scene.outlined_scene(accuracy)),
            Cow::Owned(scene) => Cow::Owned(self.fit.drawn(scene.outlined_scene(accuracy)).into_owned()),
        }
    }

    /// What is seen of the small plants; `None` if there are none.
    ///
    /// # Errors
    /// If that is more than there is room for.
    pub(super) fn small(&self, threads: usize) -> io::Result<Option<Triangles>> {
        if !self.shown.contains(&Shown::Draft) {
            return Ok(None);
        }
        let stage = Stage::new(self.scene, self.fit, &self.lens);
        let mut front = Front::new(self.cells());
        let mut mesh = Triangles::with_capacity(0, 0, 0);
        for block in self.nearest_first(&stage).chunks(BLOCK) {
            let make = |number: usize| {
                let part = block[number];
                let mut all = Vec::new();
                stage
                    .with_draft(part, &mut |draft| all.push(front.seen(draft, part, self.small_owner(part))));
                all
            };
            for (kept, hiding) in each(threads, block.len(), make).into_iter().flatten() {
                front.hide_behind(&hiding);
                mesh.append(&kept);
            }
            if mesh.faces.len() > self.most_of_small {
                mesh.retain(|face, vertices| front.is_in_front(face, vertices));
            }
            if mesh.faces.len() > self.most_of_small {
                return Err(io::Error::other(TOO_MANY));
            }
        }
        mesh.retain(|face, vertices| front.is_in_front(face, vertices));
        Ok(Some(mesh))
    }

    /// The parts of a stage, those of plants that are nearer to the viewer first: what is behind is then passed early.
    fn nearest_first<'p>(&self, stage: &'p Stage) -> Vec<&'p Part> {
        let depth = |part: &&Part| match part.plant {
            Some(plant) => self.fit.camera.project(self.scene.plants[plant as usize].placement.origin).z,
            None => f64::INFINITY,
        };
        let mut parts: Vec<&Part> = stage.parts.iter().collect();
        parts.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
        parts
    }

    /// The module that a small plant is a part of.
    fn small_owner(&self, part: &Part) -> Option<OwnerId> {
        let number = part.plant? as usize;
        (self.shown[number] == Shown::Draft).then(|| self.scene.plants[number].owner)
    }

    /// The camera with the cells of the regions.
    fn cells(&self) -> Lens {
        let larger = f64::from(self.page.pixels[0].max(self.page.pixels[1]));
        let finer = CELLS_PER_PIXEL.min(MOST_CELLS / larger);
        let size = self.page.pixels.map(|side| (f64::from(side) * finer).ceil() as u32);
        Lens::new(self.fit, size, self.page.placement().map(|x| x * finer))
    }
}

/// What to do where an SVG has no room for a field.
const TOO_MANY: &str = "more than 12 million triangles of plants are seen in this picture, too many for an SVG; \
    draw it smaller (`--size`), with fewer plants, or as PNG (`--format png`)";

/// About how many triangles a scene has in its place at accuracies by place, plants in plants included: recursion is bounded by their depth.
fn count(scene: &Scene, place: &Placement, accuracy: &dyn Fn(Point) -> f64) -> usize {
    let surfaces = scene.surfaces.iter().map(|surface| {
        let placement = surface.placement.within(place);
        let accuracy = accuracy(placement.origin) / placement.largest();
        match &surface.patches {
            Some(patches) => patches.outlined(accuracy).faces.len(),
            None => surface.mesh.draft(accuracy).as_ref().unwrap_or(&surface.mesh).faces.len(),
        }
    });
    let patches = scene.patches.iter().map(|patch| {
        let accuracy = accuracy(place.point(patch.net[0][0])) / place.largest();
        let (columns, rows) = patch.pieces(accuracy);
        2 * columns * rows
    });
    let polygons = scene.polygons.iter().map(|polygon| polygon.vertices.len());
    let plants =
        scene.plants.iter().map(|plant| count(&plant.scene, &plant.placement.within(place), accuracy));
    surfaces.chain(patches).chain(polygons).chain(plants).sum::<usize>() + STEM * scene.segments.len()
}

/// The depths of what is nearest.
struct Front {
    lens: Lens,
    /// By cell; greater ones are nearer.
    nearest: Middles,
}

impl Front {
    /// Of nothing.
    fn new(lens: Lens) -> Front {
        let cells = lens.size[0] * lens.size[1];
        let nearest = Middles { numbers: vec![0; cells], depths: vec![f32::NEG_INFINITY; cells] };
        Front { lens, nearest }
    }

    /// Those triangles of a draft in its place that nothing hides so far, if it belongs to a module; and the corners of those of them that hide what is behind.
    fn seen(&self, draft: &Draft, part: &Part, owner: Option<OwnerId>) -> (Triangles, Vec<[Place; 3]>) {
        let is_seen = |places: &[Place; 3]| self.is_seen(places);
        let mut mesh = drafted(draft, part, &self.lens, owner.unwrap_or_default(), is_seen);
        let hiding = mesh.faces.iter().filter(|face| draft.holes(face).is_none());
        let hiding = hiding.map(|face| self.places(face, &mesh.vertices)).collect();
        match owner {
            // Triangles of one look follow one another.
            Some(_) => mesh.faces.sort_by_key(|face| face.material),
            None => mesh = Triangles::with_capacity(0, 0, 0),
        }
        (mesh, hiding)
    }

    /// Adds triangles that hide what is behind.
    fn hide_behind(&mut self, places: &[[Place; 3]]) {
        let triangles = Given { count: places.len(), corners: |n: usize| places[n], cut: |_| None };
        let nothing = Middles { numbers: Vec::new(), depths: Vec::new() };
        let nearest = std::mem::replace(&mut self.nearest, nothing);
        self.nearest = cells::in_middles(self.lens.size, &triangles, nearest).0;
    }

    fn places(&self, face: &Triangle, vertices: &[Point]) -> [Place; 3] {
        face.corners.map(|(vertex, _)| self.lens.place(vertices[vertex as usize]))
    }

    /// Whether nothing hides a triangle.
    fn is_in_front(&self, face: &Triangle, vertices: &[Point]) -> bool {
        self.is_seen(&self.places(face, vertices))
    }

    /// Whether a triangle is in front in one of the cells that it may touch.
    fn is_seen(&self, places: &[Place; 3]) -> bool {
        let near = places[0].depth.max(places[1].depth).max(places[2].depth) + EQUAL;
        let range = |at: [i32; 3], count: usize| {
            let cell = |at: i32| i64::from(at).div_euclid(raster::STEPS);
            let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
            (cell(low) - 1).clamp(0, count as i64) as usize..(cell(high) + 2).clamp(0, count as i64) as usize
        };
        let [width, height] = self.lens.size;
        let columns = range(places.map(|place| place.x), width);
        range(places.map(|place| place.y), height).any(|row| {
            let line = row * width;
            let depths = &self.nearest.depths[line + columns.start..line + columns.end];
            depths.iter().any(|depth| *depth <= near)
        })
    }
}

/// The triangles of a draft in its place, as parts of a module, that are in the picture and to be seen.
fn drafted(
    draft: &Draft,
    part: &Part,
    lens: &Lens,
    owner: OwnerId,
    is_seen: impl Fn(&[Place; 3]) -> bool,
) -> Triangles {
    let is_seen = |places: &[Place; 3], is_thin: bool| {
        shot::may_be_seen(places, is_thin, [0..lens.size[0], 0..lens.size[1]]) && is_seen(places)
    };
    let mut mesh = Triangles::with_capacity(0, 0, 0);
    if part.stems.as_ref().is_none_or(Range::is_empty) {
        add_mesh(draft, part, lens, owner, is_seen, &mut mesh);
    }
    add_ribbons(draft, part, lens, owner, is_seen, &mut mesh);
    mesh
}

/// Adds the triangles of the mesh of a draft that are to be seen, and the vertices and normals that these have.
fn add_mesh(
    draft: &Draft,
    part: &Part,
    lens: &Lens,
    owner: OwnerId,
    is_seen: impl Fn(&[Place; 3], bool) -> bool,
    mesh: &mut Triangles,
) {
    let from = &draft.mesh;
    let place = |p: Point| part.place.map_or(p, |place| place.point(p));
    let turned = |n: Vector| part.place.map_or(n, |place| place.turned(n));
    let vertices: Vec<Point> = from.vertices.iter().map(|&p| place(p)).collect();
    let places: Vec<Place> = vertices.iter().map(|&p| lens.place(p)).collect();
    // By number in the draft: the number here.
    let mut of_vertex: Vec<Option<u32>> = vec![None; vertices.len()];
    let mut of_normal: Vec<Option<u32>> = vec![None; from.normals.len()];
    for face in &from.faces {
        if !is_seen(&face.corners.map(|(v, _)| places[v as usize]), face.is_thin) {
            continue;
        }
        let corners = face.corners.map(|(v, n)| {
            let vertex = *of_vertex[v as usize].get_or_insert_with(|| {
                mesh.vertices.push(vertices[v as usize]);
                mesh.places.extend(from.places.get(v as usize));
                mesh.vertices.len() as u32 - 1
            });
            let normal = *of_normal[n as usize].get_or_insert_with(|| {
                mesh.normals.push(turned(from.normals[n as usize]));
                mesh.normals.len() as u32 - 1
            });
            (vertex, normal)
        });
        mesh.faces.push(Triangle { owner, corners, ..*face });
    }
}

/// Adds the thin stems of a draft that are to be seen.
fn add_ribbons(
    draft: &Draft,
    part: &Part,
    lens: &Lens,
    owner: OwnerId,
    is_seen: impl Fn(&[Place; 3], bool) -> bool,
    mesh: &mut Triangles,
) {
    let stems = part.stems.clone().unwrap_or(0..draft.thin());
    let ribbons = draft.ribbons(stems, part.place.as_ref(), |p| lens.camera.towards(p));
    for (surface, ribbon) in (draft.mesh.segments.len() as u32..).zip(ribbons) {
        let corners = ribbon.corners.as_flattened();
        let places = [0, 1, 2, 3].map(|k| lens.place(corners[k]));
        let both = [[0, 1, 3], [0, 3, 2]];
        let seen = both.map(|three| is_seen(&three.map(|k: usize| places[k]), false));
        if seen == [false; 2] {
            continue;
        }
        let [vertex, normal] = [mesh.vertices.len(), mesh.normals.len()].map(|count| count as u32);
        mesh.vertices.extend(corners);
        let (aside, ahead) = shot::turned([places[0], places[1]]);
        let turned = |sign: f32| ribbon.side * f64::from(sign * aside) + ribbon.facing * f64::from(ahead);
        mesh.normals.extend([turned(-1.0), turned(1.0)]);
        for (three, _) in both.into_iter().zip(seen).filter(|(_, is_seen)| *is_seen) {
            let corners = three.map(|k| (vertex + k as u32, normal + (k as u32 & 1)));
            mesh.faces.push(Triangle { owner, material: ribbon.material, corners, surface, is_thin: false });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Format, FrameWriter, Survey, View};
    use dlsys_geometry::scene::{MaterialId, Owner, Polygon, Segment, Width};
    use dlsys_tree::Lineage;
    use std::sync::Arc;

    fn owned(scene: &mut Scene, name: &str, number: usize) -> OwnerId {
        scene.add_owner(Owner { name: name.into(), lineage: Lineage::of_axiom(number) })
    }

    /// A plant of stems, thick and thin ones, with a leaf at each joint.
    fn herb() -> Scene {
        let mut scene = Scene::default();
        let at =
            |i: usize| Point::new((i as f64 * 2.4).sin() * 0.2, i as f64 * 0.2, (i as f64 * 2.4).cos() * 0.2);
        for i in 0..8 {
            let owner = owned(&mut scene, "F", i);
            let (start, end) = (at(i), at(i + 1));
            scene.segments.push(Segment {
                start,
                end,
                direction: (end - start).normalize(),
                across: Vector::z(),
                widths: [Width::Set(if i % 2 == 0 { 0.1 } else { 0.002 }); 2],
                contour: None,
                material: MaterialId::STEM,
                owner,
                follows: i.checked_sub(1),
                grows_from: None,
            });
            let vertices = vec![end, end + Vector::new(0.4, 0.1, 0.1), end + Vector::new(0.2, 0.5, -0.1)];
            scene.polygons.push(Polygon { vertices, material: MaterialId::LEAF, owner });
        }
        scene
    }

    /// So many of them in rows, one behind the other, and one beside the picture of the others.
    fn rows(count: usize) -> Scene {
        let mut scene = Scene::default();
        let look = Arc::new(herb());
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        for i in 0..count {
            let owner = owned(&mut scene, "P", i);
            let origin = Point::new((i % 5) as f64 * 0.37, 0.0, -((i / 5) as f64) * 0.3);
            let placement = Placement::uniform(origin, axes, 1.0);
            scene.plants.push(Plant::new(look.clone(), placement, owner));
        }
        scene
    }

    fn surveyed(scene: &Scene) -> (Fit, Page) {
        let mut survey = Survey::new(View::FRONT);
        survey.add(scene);
        let fit = survey.fit();
        let page = Page::new(fit.picture, crate::Size::Larger(200), None).expect("a page");
        (fit, page)
    }

    #[test]
    fn what_is_kept_of_small_plants_is_all_that_is_seen() {
        let mut scene = rows(40);
        // A wall in front of the left half.
        let wall = [[-1.0, -1.0], [0.8, -1.0], [0.8, 3.0], [-1.0, 3.0]].map(|[x, y]| Point::new(x, y, 1.0));
        let owner = owned(&mut scene, "W", 40);
        scene.polygons.push(Polygon { vertices: wall.to_vec(), material: MaterialId::STEM, owner });
        let (fit, page) = surveyed(&scene);
        let field = Field::within([0, MOST_OF_SMALL], &scene, &fit, &page);
        assert!(field.shown.iter().all(|shown| *shown == Shown::Draft));
        let kept = field.small(1).expect("room").expect("small plants");
        let stage = Stage::new(&scene, &fit, &field.lens);
        let (mut all, mut seen) = (Front::new(field.cells()), Front::new(field.cells()));
        let mut count = 0;
        for part in &stage.parts {
            let nothing = Front::new(field.cells());
            stage.with_draft(part, &mut |draft| {
                let (mesh, hiding) = nothing.seen(draft, part, Some(OwnerId::default()));
                count += mesh.faces.len();
                all.hide_behind(&hiding);
                if part.plant.is_none() {
                    seen.hide_behind(&hiding);
                }
            });
        }
        assert!(2 * kept.faces.len() < count, "{} of {count} are kept", kept.faces.len());
        let places: Vec<[Place; 3]> =
            kept.faces.iter().map(|face| seen.places(face, &kept.vertices)).collect();
        seen.hide_behind(&places);
        assert!(all.nearest.depths.iter().any(|depth| depth.is_finite()));
        assert!(all.nearest.depths == seen.nearest.depths);
        // Whatever the number of threads.
        let other = field.small(3).expect("room").expect("small plants");
        assert!(other.vertices == kept.vertices && other.normals == kept.normals);
        assert_eq!(other.faces.len(), kept.faces.len());
    }

    #[test]
    fn what_is_larger_in_the_picture_is_drawn_by_modules() {
        let mut scene = rows(6);
        scene.plants[4].placement.scales = [2.0; 3];
        // Beside the page.
        let (fit, page) = surveyed(&scene);
        let outside = scene.plants[0].placement.origin - Vector::x() * 100.0;
        scene.plants[0].placement.origin = outside;
        let one = count(&scene.plants[4].scene, &scene.plants[4].placement, &|_| 1.0);
        let field = Field::within([one, MOST_OF_SMALL], &scene, &fit, &page);
        use Shown::{All, Draft, Nothing};
        assert_eq!(field.shown, [Nothing, Draft, Draft, Draft, All, Draft]);
        assert_eq!(field.large().segments.len(), 8);
        let small = field.small(1).expect("room").expect("small plants");
        let owners: std::collections::HashSet<OwnerId> = small.faces.iter().map(|face| face.owner).collect();
        assert!(owners.iter().all(|owner| [1, 2, 3, 5].contains(&owner.index())), "{owners:?}");
        assert!(owners.len() >= 3, "{owners:?}");
        // With room for all, nothing is small.
        assert!(Field::of(&scene, &fit, &page).small(1).expect("room").is_none());
        let error = Field::within([0, 10], &scene, &fit, &page).small(1).err().expect("no room");
        assert!(error.to_string().contains("--size"), "{error}");
    }

    #[test]
    fn plants_beside_the_picture_are_not_in_the_file() {
        let scene = rows(3);
        let (fit, page) = surveyed(&scene);
        let mut wider = scene.clone();
        let owner = owned(&mut wider, "P", 3);
        let place = Placement { origin: Point::new(1e3, 0.0, 0.0), ..wider.plants[0].placement };
        wider.plants.push(wider.plants[0].twin(place, owner));
        let writer = FrameWriter { page, ..FrameWriter::new(Format::SVG, fit) };
        assert!(writer.write(&scene, "") == writer.write(&wider, ""));
    }
}
