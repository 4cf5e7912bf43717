//! What surrounds a plant: light, sky, camera, floor, and other plants.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use super::{
    Bounds, Color, MaterialId, OwnerId, Patch, Placement, Point, Polygon, Scene, Segment, Surface, Vector,
    Width,
};

/// The surroundings that a model declares, at the time of its scene. What is `None` is not declared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Direction towards the sun, of any length but 0 (`light`).
    pub sun: Option<Vector>,
    /// Colours of the zenith and of the horizon (`sky`).
    pub sky: Option<[Color; 2]>,
    /// The camera (`camera`).
    pub camera: Option<Viewpoint>,
    /// Height of a rigid horizontal floor without end, in scene units (`ground`).
    pub floor: Option<f64>,
}

/// A camera in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The eye, in scene units.
    pub eye: Point,
    /// The point in the middle of the picture, different from the eye.
    pub aim: Point,
    /// Angle of view across the smaller side of the picture, in degrees, from 1 to 120.
    pub angle: f64,
}

/// A plant of another model, placed in a scene.
#[derive(Clone, Debug)]
pub struct Plant {
    /// What the other model draws, in its own colours; shared by all plants that look the same.
    pub scene: Arc<Scene>,
    /// Where it is placed: its `+X`, `+Y` and `+Z` turn to these axes.
    pub placement: Placement,
    /// The module that drew it.
    pub owner: OwnerId,
}

impl Placement {
    /// The place of what has this place within something that is placed itself.
    pub fn of(&self, inner: &Placement) -> Placement {
        Placement {
            origin: self.point(inner.origin),
            axes: inner.axes.map(|axis| self.direction(axis)),
            scale: self.scale * inner.scale,
        }
    }
}

impl Scene {
    /// The scene with the elements of its plants as its own, each owned by the module that drew its plant, for formats that hold one
    /// scene. Stems of plants are round. Memory is in proportion to all plants.
    pub fn flattened(&self) -> Cow<'_, Scene> {
        if self.plants.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut whole = self.clone();
        let plants = std::mem::take(&mut whole.plants);
        let mut materials = HashMap::new();
        for plant in &plants {
            whole.take_in(&plant.scene, &plant.placement, plant.owner, &mut materials);
        }
        Cow::Owned(whole)
    }

    fn take_in(
        &mut self,
        scene: &Arc<Scene>,
        place: &Placement,
        owner: OwnerId,
        materials: &mut HashMap<(*const Scene, MaterialId), MaterialId>,
    ) {
        let width = Bounds::of(scene).default_width();
        let mut material = |palette: &mut super::Palette, id: MaterialId| {
            *materials.entry((Arc::as_ptr(scene), id)).or_insert_with(|| {
                let material = scene.palette.get(id);
                let same = palette.materials().iter().position(|own| own == material);
                let own = same.and_then(|index| palette.at(index));
                own.unwrap_or_else(|| palette.add(&material.name, material.color))
            })
        };
        let first = self.segments.len();
        for segment in &scene.segments {
            let id = material(&mut self.palette, segment.material);
            self.segments.push(Segment {
                start: place.point(segment.start),
                end: place.point(segment.end),
                direction: place.direction(segment.direction),
                across: place.direction(segment.across),
                widths: segment.widths.map(|w| Width::Set(w.resolve(width) * place.scale)),
                contour: None,
                material: id,
                owner,
                follows: segment.follows.map(|before| before + first),
            });
        }
        for polygon in &scene.polygons {
            let vertices = polygon.vertices.iter().map(|&p| place.point(p)).collect();
            let id = material(&mut self.palette, polygon.material);
            self.polygons.push(Polygon { vertices, material: id, owner });
        }
        for patch in &scene.patches {
            let net = patch.net.map(|row| row.map(|p| place.point(p)));
            let id = material(&mut self.palette, patch.material);
            self.patches.push(Patch { net, material: id, owner });
        }
        let mut meshes = HashMap::new();
        for surface in &scene.surfaces {
            let tint = surface.tint.map(|id| material(&mut self.palette, id));
            let mesh = meshes.entry(Arc::as_ptr(&surface.mesh)).or_insert_with(|| {
                let mut mesh = (*surface.mesh).clone();
                for face in &mut mesh.faces {
                    face.material = material(&mut self.palette, face.material);
                }
                Arc::new(mesh)
            });
            let placement = place.of(&surface.placement);
            self.surfaces.push(Surface { mesh: mesh.clone(), patches: None, placement, tint, owner });
        }
        for plant in &scene.plants {
            self.take_in(&plant.scene, &place.of(&plant.placement), owner, materials);
        }
    }
}
