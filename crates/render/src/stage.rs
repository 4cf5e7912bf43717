//! All that a picture shows: the drafts of a scene and of the plants of other models in it, and where each stands.
//!
//! Plants outside of the picture are left out. The others share drafts by their look and by their size in the picture, to half a
//! power of two; they are never one mesh. A plant so near to the viewer that its parts have different sizes in the picture has a draft of its own, as detailed
//! at each place as it is seen there.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::OnceLock;

use super::Fit;
use super::draft::{Detail, Draft};
use super::lens::Lens;
use dlsys_geometry::scene::{Color, Placement, Plant, Point, Scene, Texture};

/// A plant is near if its nearest point is so many times as large in the picture as its middle.
const NEAR: f64 = 1.5;

/// Greatest distance of triangles from the curved surfaces of plants of less than [`SMALL`] pixels, in pixels; measured, it is a fifth of that. In a field there are
/// many, and their triangles would be smaller than pixels.
const SLACK_OF_SMALL: f64 = 1.0;
const SMALL: f64 = 1000.0;

/// Thin stems of the scene itself that are one part of a picture.
const STEMS: usize = 1 << 14;

/// A draft in its place, or some of it.
pub(super) struct Part {
    /// 0 for the scene itself.
    draft: usize,
    /// `None`: the scene's own coordinates.
    pub(super) place: Option<Placement>,
    /// The number of the first colour of its palette.
    pub(super) colors: u32,
    /// `None`: all of the draft. Of a scene with many thin stems these only, or, if they are none, its triangles.
    pub(super) stems: Option<Range<usize>>,
    /// The number of the plant of the scene that it is a part of; `None`: of the scene itself.
    pub(super) plant: Option<u32>,
}

/// What a picture shows.
pub(super) struct Stage<'s> {
    /// The scene without its plants.
    scene: Draft<'s>,
    wanted: Vec<Wanted<'s>>,
    /// Those that several plants share, once they are made.
    shared: Vec<OnceLock<Draft<'s>>>,
    /// In string order: what is later is in front of what is at the same depth.
    pub(super) parts: Vec<Part>,
    /// All palettes, one after the other.
    pub(super) colors: Vec<Color>,
    /// The pictures in place of colours; none if no palette has any.
    pub(super) textures: Vec<Option<&'s Texture>>,
    fit: &'s Fit,
    lens: &'s Lens,
}

/// A stage whose drafts are yet to be made.
struct Plan<'s> {
    wanted: Vec<Wanted<'s>>,
    parts: Vec<Part>,
    colors: Vec<Color>,
    textures: Vec<Option<&'s Texture>>,
    /// The looks of plants so far by the address of their scene, and their drafts by their size, in half powers of two, and by whether they stand on
    /// the floor; plants in plants share them.
    looks: HashMap<usize, Option<Look>>,
    drafted: HashMap<(usize, i32, bool), usize>,
    /// Height of the floor.
    floor: Option<f64>,
}

/// A draft that is yet to be made.
struct Wanted<'s> {
    scene: &'s Scene,
    default_width: f64,
    size: Size,
    /// Triangles are no nearer to curved surfaces than this many pixels.
    slack: f64,
    /// Height of the floor in the plant's coordinates, if it stands on one.
    floor: Option<f64>,
    /// Number of parts.
    uses: usize,
}

/// How large a plant is in the picture.
enum Size {
    /// Everywhere so many pixels for a unit.
    Even(f64),
    /// As it is seen in this place.
    Near(Placement),
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
    pub(super) fn new(scene: &'s Scene, fit: &'s Fit, lens: &'s Lens) -> Stage<'s> {
        let mut plan = Plan {
            wanted: Vec::new(),
            parts: Vec::new(),
            colors: Vec::new(),
            textures: Vec::new(),
            looks: HashMap::new(),
            drafted: HashMap::new(),
            floor: scene.surroundings.floor,
        };
        plan.add_colors(scene);
        plan.add_plants(scene, None, None, lens);
        let detail = Detail {
            scale_at: |p: Point| lens.scale_at(p),
            scale_of: None,
            accuracy: fit.accuracy,
            scale: lens.scale(),
            is_flat: fit.light.is_flat(),
            floor: scene.surroundings.floor,
        };
        let shared = plan.wanted.iter().map(|_| OnceLock::new()).collect();
        let mut scene = Draft::new(scene, fit.default_width, &detail);
        if detail.is_flat && fit.camera.eye().is_some() {
            scene.flatten(fit.camera.view().towards());
        }
        let mut parts = parts_of(&scene);
        parts.append(&mut plan.parts);
        Stage {
            scene,
            wanted: plan.wanted,
            shared,
            parts,
            colors: plan.colors,
            textures: plan.textures,
            fit,
            lens,
        }
    }

    /// Passes on the draft of a part, [piece by piece](Draft::each_piece) if that is very large. One that no other part shares is made for that, and dropped.
    pub(super) fn with_draft(&self, part: &Part, work: &mut dyn FnMut(&Draft)) {
        let has_mesh = part.stems.as_ref().is_none_or(Range::is_empty);
        let mut pass_on = |draft: &Draft| if has_mesh { draft.each_piece(work) } else { work(draft) };
        let number = part.draft.checked_sub(1);
        let Some((wanted, place)) = number.and_then(|i| self.wanted.get(i).zip(self.shared.get(i))) else {
            return pass_on(&self.scene);
        };
        let make = || wanted.draft(self.fit, self.lens);
        if wanted.uses > 1 { pass_on(place.get_or_init(make)) } else { pass_on(&make()) }
    }
}

/// The parts of the scene itself. Very many thin stems are several, so that no more of them are made at a time than there is room for.
fn parts_of(scene: &Draft) -> Vec<Part> {
    let part = |stems| Part { draft: 0, place: None, colors: 0, stems, plant: None };
    let count = scene.thin();
    if count <= STEMS {
        return vec![part(None)];
    }
    let stems = (0..count).step_by(STEMS).map(|start| start..(start + STEMS).min(count));
    std::iter::once(0..0).chain(stems).map(|stems| part(Some(stems))).collect()
}

impl<'s> Wanted<'s> {
    fn draft(&self, fit: &Fit, lens: &Lens) -> Draft<'s> {
        let (scale, is_flat, floor) = (lens.scale(), false, self.floor);
        let accuracy = fit.accuracy.max(self.slack / scale);
        match self.size {
            Size::Even(seen) => {
                let scale_at = |_| seen;
                let detail = Detail { scale_at, scale_of: None, accuracy, scale, is_flat, floor };
                Draft::new(self.scene, self.default_width, &detail)
            }
            Size::Near(placement) => {
                let larger = placement.largest();
                let scale_at = |p| lens.scale_at(placement.point(p)) * larger;
                let scale_of =
                    |p, radius: f64| lens.scale_within(placement.point(p), radius * larger) * larger;
                let detail = Detail { scale_at, scale_of: Some(&scale_of), accuracy, scale, is_flat, floor };
                Draft::new(self.scene, self.default_width, &detail)
            }
        }
    }
}

impl<'s> Plan<'s> {
    /// Adds the plants of a scene in its place, which is in a plant with a number, or is the scene itself.
    fn add_plants(&mut self, scene: &'s Scene, place: Option<&Placement>, within: Option<u32>, lens: &Lens) {
        for (number, plant) in (0..).zip(&scene.plants) {
            let number = within.unwrap_or(number);
            let key = (&raw const *plant.scene).addr();
            let known = self.looks.get(&key).copied();
            let look = known.unwrap_or_else(|| self.look(plant));
            self.looks.insert(key, look);
            let Some(look) = look else { continue };
            let placement = match place {
                None => plant.placement,
                Some(outer) => plant.placement.within(outer),
            };
            let (centre, radius) = (placement.point(look.centre), look.radius * placement.largest());
            let Some(seen) = lens.scale_of(centre, radius) else { continue };
            let scene = &plant.scene;
            let wanted = &mut self.wanted;
            let floor = self.floor.filter(|floor| stands_on(*floor, &placement, look.radius)).map(|_| 0.0);
            // The scene itself is the first draft.
            let mut add = |size, slack| {
                wanted.push(Wanted { scene, default_width: look.default_width, size, slack, floor, uses: 0 });
                wanted.len()
            };
            let draft = if seen <= NEAR * lens.scale_at(centre) {
                let exponent = (2.0 * (seen * placement.largest()).log2()).ceil().clamp(-120.0, 120.0);
                let size = (exponent / 2.0).exp2();
                let slack = if 2.0 * look.radius * size < SMALL { SLACK_OF_SMALL } else { 0.0 };
                let key = (key, exponent as i32, floor.is_some());
                *self.drafted.entry(key).or_insert_with(|| add(Size::Even(size), slack))
            } else {
                add(Size::Near(placement), 0.0)
            };
            wanted[draft - 1].uses += 1;
            let (place, plant) = (Some(placement), Some(number));
            self.parts.push(Part { draft, place, colors: look.colors, stems: None, plant });
            self.add_plants(scene, Some(&placement), Some(number), lens);
        }
    }

    /// Adds the colours of a palette, and tells the number of the first one.
    fn add_colors(&mut self, scene: &'s Scene) -> u32 {
        let first = self.colors.len();
        let materials = scene.palette.materials();
        self.colors.extend(materials.iter().map(|material| material.color));
        if scene.palette.has_textures() {
            self.textures.resize(first, None);
            self.textures.extend(materials.iter().map(|material| material.texture.as_ref()));
        }
        first as u32
    }

    /// `None` if nothing is drawn.
    fn look(&mut self, plant: &'s Plant) -> Option<Look> {
        let [low, high] = plant.bounds()?;
        let colors = self.add_colors(&plant.scene);
        Some(Look {
            default_width: plant.default_width(),
            centre: nalgebra::center(&low, &high),
            radius: (high - low).norm() / 2.0,
            colors,
        })
    }
}

/// Whether a plant with its parts within this radius stands upright on a floor: its height 0 is there.
fn stands_on(floor: f64, placement: &Placement, radius: f64) -> bool {
    let is_upright = placement.axes[1].y >= 1.0 - 1e-12;
    is_upright && (placement.origin.y - floor).abs() <= 1e-9 * radius * placement.largest()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lighting::Lighting;
    use crate::{Survey, View, raster, shot};
    use dlsys_geometry::scene::{MaterialId, Owner, Segment, Vector, Width};
    use dlsys_tree::Lineage;

    /// A ball of yarn of so many thin stems, of two colours.
    fn yarn(count: usize) -> Scene {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(0) });
        let at = |i: usize| {
            let (a, b) = (i as f64 * 0.37, i as f64 * 0.000_211);
            Point::new(a.cos() * b.sin(), b.cos(), a.sin() * b.sin())
        };
        for i in 0..count {
            let (start, end) = (at(i), at(i + 1));
            scene.segments.push(Segment {
                start,
                end,
                direction: (end - start).normalize(),
                across: Vector::x(),
                widths: [Width::Set(0.002); 2],
                contour: None,
                material: if i % 5 == 0 { MaterialId::STEM } else { MaterialId::LEAF },
                owner,
                follows: i.checked_sub(1),
                grows_from: None,
            });
        }
        scene
    }

    #[test]
    fn many_thin_stems_are_several_parts_with_the_same_pixels() {
        let scene = yarn(2 * STEMS + 100);
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let fit = survey.fit();
        let lens = Lens::new(&fit, [120, 90], [40.0, 60.0, 45.0]);
        let mut stage = Stage::new(&scene, &fit, &lens);
        assert_eq!(stage.parts.len(), 4);
        let lighting = Lighting::new(&scene, &fit, lens.scale(), 1, None, Some(&lens));
        let draw = |threads, stage: &Stage| shot::draw(&raster::FOUR, threads, stage, &lens, &lighting);
        let parts = draw(1, &stage);
        assert!(parts.pixels.iter().filter(|pixel| pixel[3] > 0).count() > 1000);
        assert_eq!(parts, draw(3, &stage));
        // Where hidden ones are dropped early.
        for (threads, most) in [(1, 20_000), (3, 5_000), (2, 1)] {
            assert_eq!(parts, shot::draw_within(most, &raster::FOUR, threads, &stage, &lens, &lighting));
        }
        stage.parts = vec![Part { draft: 0, place: None, colors: 0, stems: None, plant: None }];
        assert_eq!(parts, draw(1, &stage));
    }
}
