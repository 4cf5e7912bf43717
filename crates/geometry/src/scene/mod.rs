//! The scene: segments, polygons, surfaces and patches in space, each with its material and its module, independent of file
//! formats.
//!
//! ```text
//! turtle ──▶ Scene { segments, polygons, surfaces, patches } ──▶ export
//! ```
//!
//! - [`Segment`]: a straight piece of a stem. Segments that continue one another form tubes.
//! - [`Polygon`]: a filled outline. [`Surface`]: a [`Mesh`] placed in space; many share one mesh.
//! - [`Patch`]: a bicubic Bézier patch. [`PatchSet`]: a surface of patches, or a ball. [`Scene::tessellated`] makes meshes of them.
//! - [`Gas`]: smoke, steam or pollen as blobs. [`GasSource`]: where they begin.
//! - [`SheetPlace`]: where a module places a flexible surface or net.
//! - [`Owner`]: the module that drew an element. Its name is the same in every frame.
//! - [`Plant`]: the scene of another model, placed in this one. [`Surroundings`]: light, sky, camera and floor.
//! - [`Bounds`]: the bounds of a scene, or of all scenes of an animation.
//!
//! Lengths are in *scene units*, the units of the model. The axes: `+X` right, `+Y` up, `+Z` towards the
//! viewer of the front view.

mod ball;
mod bernstein;
mod bounds;
mod degrees;
mod element;
mod flat;
mod gas;
mod material;
mod mesh;
mod outline;
mod patch;
mod pieces;
mod sheet;
mod surroundings;

pub use bounds::Bounds;
pub(crate) use degrees::reduced;
pub use degrees::sin_cos_degrees;
pub use dlsys_model::{Drawn, Footprint, Picture, Texture};
pub use element::{Placement, Polygon, Segment, Surface, Width};
pub use gas::{Blob, Gas, GasSource, SourceKey};
pub use material::{Color, GRADIENT_STEPS, Material, MaterialId, Palette};
pub use mesh::{Face, Mesh};
pub use patch::{Net, Patch, PatchFace, PatchSet};
pub use sheet::{SheetKey, SheetPlace};
pub use surroundings::{Plant, Seedling, Surroundings, Viewpoint};

use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::Arc;

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::Appearance;
use dlsys_tree::Lineage;

use crate::turtle::Pose;

/// A point, in scene units.
pub type Point = nalgebra::Point3<f64>;
/// A direction or displacement, in scene units.
pub type Vector = nalgebra::Vector3<f64>;

/// The module that drew an element of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner {
    /// Name of the module's kind, as in the model: `F_i`, `@L`.
    pub name: Arc<str>,
    /// Identity of the module.
    pub lineage: Lineage,
}

/// An [`Owner`] of a [`Scene`], by number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OwnerId(u32);

impl OwnerId {
    /// Position in [`Scene::owners`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A surface in its own coordinates.
#[derive(Clone, Debug)]
pub struct Shape {
    /// The mesh; of curved surfaces, a preview.
    pub mesh: Arc<Mesh>,
    /// See [`Surface::patches`].
    pub patches: Option<Arc<PatchSet>>,
}

impl Shape {
    /// Of a mesh as it is.
    pub fn of_mesh(mesh: Mesh) -> Shape {
        Shape { mesh: Arc::new(mesh), patches: None }
    }

    /// Of patches, about 1 in size.
    pub fn of_patches(faces: Vec<PatchFace>) -> Shape {
        Shape::curved(PatchSet::new(faces))
    }

    /// A ball of diameter 1 around the origin.
    pub fn ball(material: MaterialId) -> Shape {
        Shape::curved(PatchSet::ball(material))
    }

    fn curved(patches: PatchSet) -> Shape {
        /// Accuracy of the preview.
        const PREVIEW: f64 = 1.0 / 256.0;
        Shape { mesh: patches.mesh(PREVIEW), patches: Some(Arc::new(patches)) }
    }
}

/// All elements that are drawn at one instant.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The materials; elements name them by number.
    pub palette: Palette,
    /// The model's own surfaces, and what they and the palette were made from, so that they are made once
    /// and not for every frame.
    pub shapes: Vec<Shape>,
    /// The part of the model from which `shapes` and `palette` were made.
    pub prepared_for: Option<Arc<Appearance>>,
    /// Cross-sections of stems, those of plants in the scene included; [`Segment::contour`] is an index.
    pub contours: Arc<[Vec<[f64; 2]>]>,
    /// Index of the first contour of the model that draws.
    pub first_contour: u32,
    /// Greatest distance between a curve and the segments drawn for it, in scene units, if that is known when the turtle
    /// draws; 0 if not. Bent segments are drawn in pieces; see [`Fit::accuracy`](dlsys_render::Fit::accuracy).
    pub accuracy: f64,
    /// The turtle would have drawn something else, had it known an accuracy.
    pub lacked_accuracy: bool,
    owners: Vec<Owner>,
    /// The turtle notes where it stands at the beginning of each module that draws.
    pub notes_poses: bool,
    /// With `notes_poses`, the pose of the turtle at the beginning of each of the [`owners`](Scene::owners).
    pub poses: Vec<Pose>,
    /// Pieces of stems, in string order.
    pub segments: Vec<Segment>,
    /// Filled outlines, in the order in which they were closed.
    pub polygons: Vec<Polygon>,
    /// Placed meshes, in string order.
    pub surfaces: Vec<Surface>,
    /// Bézier patches drawn by `@PD`, in string order.
    pub patches: Vec<Patch>,
    /// Where blobs of gases begin, in string order.
    pub sources: Vec<GasSource>,
    /// The gases of the model with their blobs, in the order of their declarations; empty if they are not followed.
    pub gases: Vec<Gas>,
    /// The owner of the surface that is ground of soil, if there is one. It is seen in every frame; framing ignores it.
    pub terrain: Option<OwnerId>,
    /// Where modules place sheets, in string order; the sheets themselves are among the other elements once they are drawn.
    pub sheets: Vec<SheetPlace>,
    /// Plants of other models that are to be drawn, in string order; empty once they are among `plants`.
    pub seedlings: Vec<Seedling>,
    /// Plants of other models, in string order.
    pub plants: Vec<Plant>,
    /// Light, sky, camera and floor.
    pub surroundings: Surroundings,
    /// Warnings: elements that are drawn, but hardly as they were meant.
    pub warnings: Vec<Diagnostic>,
    /// The greatest width that `!` sets, where more than a few stems are drawn.
    pub widest: Option<Widest>,
}

/// The width of a stem, and where it is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widest {
    /// In scene units.
    pub width: f64,
    /// The place in the text of the model.
    pub span: Span,
    /// The time of the string.
    pub time: f64,
}

/// Takes in the extent of a scene: points whose hull contains all of it.
pub trait Reach {
    /// True if nothing within the hull of these points can add anything: then its points are left out.
    fn covers(&self, _rough: impl Iterator<Item = Point>) -> bool {
        false
    }

    /// Takes in a point, with the width of the line there.
    fn include(&mut self, point: Point, width: Width);
}

/// Every point, for a function.
struct Visit<'f>(&'f mut dyn FnMut(Point, Width));

impl Reach for Visit<'_> {
    fn include(&mut self, point: Point, width: Width) {
        (self.0)(point, width);
    }
}

impl Scene {
    /// Removes all elements and warnings; palette, shapes and memory stay.
    pub fn clear(&mut self) {
        self.owners.clear();
        self.poses.clear();
        self.segments.clear();
        self.polygons.clear();
        self.surfaces.clear();
        self.patches.clear();
        self.sources.clear();
        self.gases.clear();
        self.terrain = None;
        self.sheets.clear();
        self.seedlings.clear();
        self.plants.clear();
        self.surroundings = Surroundings::default();
        self.warnings.clear();
        self.widest = None;
        self.lacked_accuracy = false;
    }

    /// Gives back memory that elements do not take.
    pub fn shrink_to_fit(&mut self) {
        self.owners.shrink_to_fit();
        self.segments.shrink_to_fit();
        self.polygons.shrink_to_fit();
        self.surfaces.shrink_to_fit();
        self.patches.shrink_to_fit();
    }

    /// Roughly the memory of all elements, in bytes; plants that share a scene count it once.
    pub fn footprint(&self) -> usize {
        let mut known = HashSet::new();
        self.footprint_beside(&mut known)
    }

    /// Recursion is bounded by the depth of plants in plants.
    fn footprint_beside(&self, known: &mut HashSet<*const Scene>) -> usize {
        let vertices: usize = self.polygons.iter().map(|polygon| polygon.vertices.len()).sum();
        let own = size_of_val(&*self.owners)
            + size_of_val(&*self.segments)
            + size_of_val(&*self.polygons)
            + vertices * size_of::<Point>()
            + size_of_val(&*self.surfaces)
            + size_of_val(&*self.patches)
            + size_of_val(&*self.plants)
            + self.gases.iter().map(|gas| size_of_val(&*gas.blobs)).sum::<usize>();
        let looks = self.plants.iter().map(|plant| &plant.scene);
        let others = looks.map(|scene| match known.insert(Arc::as_ptr(scene)) {
            true => size_of::<Scene>() + scene.footprint_beside(known),
            false => 0,
        });
        own + others.sum::<usize>()
    }

    /// True if there are no elements.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
            && self.polygons.is_empty()
            && self.surfaces.is_empty()
            && self.patches.is_empty()
            && self.gases.iter().all(|gas| gas.blobs.is_empty())
            && self.plants.iter().all(|plant| plant.scene.is_empty())
    }

    /// The scene with meshes in place of everything curved, none further than `accuracy` (scene units) from
    /// what it stands for. Patches come after the other surfaces.
    pub fn tessellated(&self, accuracy: f64) -> Cow<'_, Scene> {
        if self.patches.is_empty() && self.surfaces.iter().all(|surface| surface.patches.is_none()) {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        for surface in &mut scene.surfaces {
            if let Some(patches) = surface.patches.take() {
                surface.mesh = patches.mesh(accuracy / surface.placement.largest());
            }
        }
        scene.surfaces.extend(scene.patches.drain(..).map(|patch| patch.surface(accuracy)));
        Cow::Owned(scene)
    }

    /// The surfaces and patches as meshes for a picture, in the order of [`tessellated`](Scene::tessellated): each within
    /// `accuracy` (scene units) of its shape, which may depend on its place, and on a ball
    /// around it: middle and radius.
    pub fn drafted(&self, accuracy: impl Fn(Point, (Point, f64)) -> f64) -> Cow<'_, [Surface]> {
        self.drafted_by(accuracy, PatchSet::draft, Patch::draft)
    }

    /// The same by these functions of an accuracy.
    fn drafted_by(
        &self,
        accuracy: impl Fn(Point, (Point, f64)) -> f64,
        of_set: fn(&PatchSet, f64) -> Arc<Mesh>,
        of_patch: fn(&Patch, f64) -> Surface,
    ) -> Cow<'_, [Surface]> {
        if self.patches.is_empty() && self.surfaces.is_empty() {
            return Cow::Borrowed(&self.surfaces);
        }
        let placed = self.surfaces.iter().map(|surface| {
            let mut surface = surface.clone();
            let place = surface.placement;
            let (middle, radius) = surface.mesh.ball();
            let ball = (place.point(middle), radius * place.largest());
            let accuracy = accuracy(place.origin, ball) / place.largest();
            match surface.patches.take() {
                Some(patches) => surface.mesh = of_set(&patches, accuracy),
                None => surface.mesh = surface.mesh.draft(accuracy).unwrap_or(surface.mesh),
            }
            surface
        });
        let patches = self.patches.iter().map(|patch| {
            let from = patch.net[0][0];
            let points = || patch.net.iter().flatten();
            let (low, high) = points().fold((from, from), |(low, high), p| (low.inf(p), high.sup(p)));
            let ball = (nalgebra::center(&low, &high), (high - low).norm() / 2.0);
            of_patch(patch, accuracy(from, ball))
        });
        Cow::Owned(placed.chain(patches).collect())
    }

    /// The scene with meshes in place of everything curved, as detailed as a picture of outlines needs, by accuracy: see [`Patch::outlined`].
    pub fn outlined_scene(&self, accuracy: impl Fn(Point) -> f64) -> Cow<'_, Scene> {
        match self.drafted_by(|at, _| accuracy(at), PatchSet::outlined, Patch::outlined) {
            Cow::Borrowed(_) => Cow::Borrowed(self),
            Cow::Owned(surfaces) => Cow::Owned(Scene { surfaces, patches: Vec::new(), ..self.clone() }),
        }
    }

    /// Visits points whose hull contains all elements, each with the width of the line there; corners of surfaces
    /// and polygons have the width 0.
    pub fn each_point(&self, mut visit: impl FnMut(Point, Width)) {
        self.reach(&mut Visit(&mut visit));
    }

    /// Shows the extent of all elements to `reach`, plants of other models included: of these the box around each.
    pub fn reach(&self, reach: &mut impl Reach) {
        for segment in &self.segments {
            reach.include(segment.start, segment.widths[0]);
            reach.include(segment.end, segment.widths[1]);
        }
        let vertices = self.polygons.iter().flat_map(|polygon| polygon.vertices.iter().copied());
        vertices.for_each(|point| reach.include(point, Width::Set(0.0)));
        for surface in self.surfaces.iter().filter(|surface| Some(surface.owner) != self.terrain) {
            let corners = surface.mesh.bounds().map(|bounds| surface.placement.corners(bounds));
            if corners.is_some_and(|corners| reach.covers(corners.into_iter())) {
                continue;
            }
            for &vertex in &surface.mesh.vertices {
                reach.include(surface.placement.point(vertex), Width::Set(0.0));
            }
        }
        // Corners are on their patches. With all of them known, most patches are well within the rest.
        let corners =
            self.patches.iter().flat_map(|patch| [0, 3].map(|row| [patch.net[row][0], patch.net[row][3]]));
        corners.flatten().for_each(|corner| reach.include(corner, Width::Set(0.0)));
        for patch in &self.patches {
            if !reach.covers(patch.net.iter().flatten().copied()) {
                patch.hull().for_each(|point| reach.include(point, Width::Set(0.0)));
            }
        }
        for (centre, radius) in self.gases.iter().flat_map(Gas::seen) {
            reach.include(centre, Width::Set(2.0 * radius));
        }
        // The box around a plant: exact enough to frame a picture, at a cost that does not depend on the plant.
        for corner in self.plants.iter().flat_map(Plant::corners) {
            reach.include(corner, Width::Set(0.0));
        }
    }

    /// Adds a module that draws something. Modules are added in string order, each once.
    pub fn add_owner(&mut self, owner: Owner) -> OwnerId {
        self.owners.push(owner);
        OwnerId((self.owners.len() - 1) as u32)
    }

    /// Adds ground of soil: a mesh in scene units.
    pub fn add_terrain(&mut self, mesh: Arc<Mesh>) {
        // No module has this line of descent.
        let lineage = Lineage::of_axiom(0).child(u64::MAX, 0);
        let owner = self.add_owner(Owner { name: "=ground".into(), lineage });
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        let placement = Placement::uniform(Point::origin(), axes, 1.0);
        self.surfaces.push(Surface { mesh, patches: None, rest: None, placement, tint: None, owner });
        self.terrain = Some(owner);
    }

    /// The module with a number of this scene.
    pub fn owner(&self, id: OwnerId) -> &Owner {
        &self.owners[id.index()]
    }

    /// The modules that drew something, in string order.
    pub fn owners(&self) -> &[Owner] {
        &self.owners
    }
}
