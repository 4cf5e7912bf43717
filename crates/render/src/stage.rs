//! All that a picture shows: the drafts of a scene and of the plants of other models in it, and where each stands.
//!
//! Plants outside of the picture are left out. The others share drafts by their look and by their size in the picture, to a power of
//! two; they are never one mesh.

use std::collections::HashMap;

use super::Fit;
use super::draft::{Detail, Draft};
use super::lens::Lens;
use dlsys_geometry::scene::{Color, Placement, Plant, Point, Scene};

/// A draft in its place.
pub(super) struct Part {
    /// Its number.
    pub(super) draft: usize,
    /// `None`: the scene's own coordinates.
    pub(super) place: Option<Placement>,
    /// The number of the first colour of its palette.
    pub(super) colors: u32,
}

/// What a picture shows.
pub(super) struct Stage<'s> {
    pub(super) drafts: Vec<Draft<'s>>,
    /// In string order: what is later is in front of what is at the same depth.
    pub(super) parts: Vec<Part>,
    /// All palettes, one after the other.
    pub(super) colors: Vec<Color>,
    /// The looks of plants so far, and their drafts by the power of two of their size; plants in plants share them.
    looks: HashMap<*const Scene, Option<Look>>,
    drafted: HashMap<(*const Scene, i32), usize>,
}

/// A ball around all that one look has.
#[derive(Clone, Copy)]
struct Look {
    default_width: f64,
    centre: Point,
    radius: f64,
    colors: u32,
}

impl<'s> Stage<'s> {
    /// For a picture.
    pub(super) fn new(scene: &'s Scene, fit: &Fit, lens: &Lens) -> Stage<'s> {
        let scale_at = |p: Point| lens.scale_at(p);
        let mut stage = Stage::of(scene, fit, fit.light.is_flat(), lens.scale(), scale_at);
        stage.add_plants(scene, None, fit, lens.scale(), &|centre, radius| {
            let towards = lens.camera.towards(centre) * radius;
            let nearest = lens.scale_at(centre + towards).max(lens.scale_at(centre));
            // Within the ball around it, the viewer sees it at any size.
            let scale = if nearest > 0.0 { nearest } else { lens.scale_at(centre - towards) };
            (!lens.misses(centre, radius)).then_some(scale)
        });
        stage
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.parts.iter().map(|part| self.drafts[part.draft].len()).sum()
    }

    fn of(
        scene: &'s Scene,
        fit: &Fit,
        is_flat: bool,
        scale: f64,
        scale_at: impl Fn(Point) -> f64,
    ) -> Stage<'s> {
        let detail = Detail { scale_at, accuracy: fit.accuracy, scale, is_flat };
        Stage {
            drafts: vec![Draft::new(scene, fit.default_width, &detail)],
            parts: vec![Part { draft: 0, place: None, colors: 0 }],
            colors: scene.palette.materials().iter().map(|material| material.color).collect(),
            looks: HashMap::new(),
            drafted: HashMap::new(),
        }
    }

    /// Adds the plants of a scene in its place. `scale_of` tells the pixels of a scene unit at a ball; `None`: it is not seen.
    fn add_plants(
        &mut self,
        scene: &'s Scene,
        place: Option<&Placement>,
        fit: &Fit,
        scale: f64,
        scale_of: &dyn Fn(Point, f64) -> Option<f64>,
    ) {
        for plant in &scene.plants {
            let key = &raw const *plant.scene;
            let known = self.looks.get(&key).copied();
            let look = known.unwrap_or_else(|| self.look(plant));
            self.looks.insert(key, look);
            let Some(look) = look else { continue };
            let placement = match place {
                None => plant.placement,
                Some(outer) => plant.placement.within(outer),
            };
            let Some(seen) = scale_of(placement.point(look.centre), look.radius * placement.largest()) else {
                continue;
            };
            let exponent = (seen * placement.largest()).log2().ceil().clamp(-60.0, 60.0) as i32;
            let draft = *self.drafted.entry((key, exponent)).or_insert_with(|| {
                let scale_there = 2_f64.powi(exponent);
                let detail =
                    Detail { scale_at: |_| scale_there, accuracy: fit.accuracy, scale, is_flat: false };
                self.drafts.push(Draft::new(&plant.scene, look.default_width, &detail));
                self.drafts.len() - 1
            });
            self.parts.push(Part { draft, place: Some(placement), colors: look.colors });
            self.add_plants(&plant.scene, Some(&placement), fit, scale, scale_of);
        }
    }

    /// `None` if nothing is drawn.
    fn look(&mut self, plant: &Plant) -> Option<Look> {
        let [low, high] = plant.bounds()?;
        let colors = self.colors.len() as u32;
        self.colors.extend(plant.scene.palette.materials().iter().map(|material| material.color));
        Some(Look {
            default_width: plant.default_width(),
            centre: nalgebra::center(&low, &high),
            radius: (high - low).norm() / 2.0,
            colors,
        })
    }
}
