//! What casts shadows: all triangles and thin stems of a scene and of the plants of other models in it, a batch at a time.
//!
//! Plants share drafts as in a picture ([`Stage`](super::stage::Stage)). A draft is made, all plants that share it are passed on, and it is dropped
//! again: only [`KEPT`] triangles of drafts and one [`BATCH`] are in memory, however many plants there are. The order does not matter to
//! shadow maps, which keep the nearest.

use std::collections::HashMap;

use super::Fit;
use super::draft::{Detail, Draft};
use super::triangles::Triangle;
use dlsys_geometry::scene::{MaterialId, Placement, Point, Scene, Texture, Vector};
use dlsys_threads::each;

/// Triangles and thin stems in a batch.
const BATCH: usize = 1 << 16;
/// Most triangles of drafts that are kept from the measuring of the scene to its shadows; the others are made twice.
const KEPT: usize = 2_000_000;

/// Drafts that are measured side by side.
const SIDE_BY_SIDE: usize = 64;
/// Triangles are no nearer to curved surfaces than this, in pixels, of which a cell of a shadow map has one or more: the edges of shadows are smooth over three cells.
const SLACK: f64 = 0.7;

/// A triangle of which parts are cut out: corners, their places in the picture, and that.
pub(super) type CutTriangle<'s> = ([u32; 3], [[f64; 2]; 3], &'s Texture);

/// Triangles and thin stems, relative to the middle of the box around everything.
#[derive(Default)]
pub(super) struct Batch<'s> {
    /// By coordinate.
    pub(super) vertices: [Vec<f32>; 3],
    /// Corners by number of a vertex.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) cut: Vec<CutTriangle<'s>>,
    /// Ends and radii.
    pub(super) lines: Vec<([[f32; 3]; 2], [f32; 2])>,
}

impl Batch<'_> {
    /// How many more there is room for.
    fn room(&self) -> usize {
        BATCH.saturating_sub(self.triangles.len() + self.cut.len() + self.lines.len())
    }

    fn clear(&mut self) {
        self.vertices.iter_mut().for_each(Vec::clear);
        self.triangles.clear();
        self.cut.clear();
        self.lines.clear();
    }
}

/// Plants that look the same, or the scene itself.
struct Group<'s> {
    scene: &'s Scene,
    default_width: f64,
    /// Pixels for a unit of the plant.
    scale: f64,
    /// `None`: the scene's own coordinates.
    places: Vec<Option<Placement>>,
}

/// All that casts shadows in a frame.
pub(super) struct Casters<'s> {
    fit: &'s Fit,
    scale: f64,
    /// Of the scene's own elements, those of this material cast no shadows.
    without: Option<MaterialId>,
    groups: Vec<Group<'s>>,
    numbers: HashMap<(usize, i32), usize>,
    /// By group, if it is kept.
    drafts: Vec<Option<Draft<'s>>>,
    around: Reach,
    /// Around all but the ground of soil.
    core: Reach,
    count: usize,
}

/// A box: its middle, and half of its sides.
pub(super) type Reach = [Vector; 2];

/// The box around points, as far as they are known.
struct Around([Vector; 2]);

impl Around {
    fn nothing() -> Around {
        Around([Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY)])
    }

    fn include(&mut self, at: &Vector) {
        let [low, high] = self.0;
        self.0 = [low.inf(at), high.sup(at)];
    }

    fn merge(&mut self, other: &Around) {
        let ([low, high], [other_low, other_high]) = (self.0, other.0);
        self.0 = [low.inf(&other_low), high.sup(&other_high)];
    }

    fn reach(&self) -> Option<Reach> {
        let [low, high] = self.0;
        (low.x <= high.x).then(|| [(low + high) / 2.0, (high - low) / 2.0])
    }
}

/// A draft, boxes around its ground of soil and all else wherever it is, and how much there is of it.
struct Measured<'s> {
    draft: Draft<'s>,
    soil: Around,
    around: Around,
    count: usize,
}

impl<'s> Casters<'s> {
    /// All that a scene has, but for what is of a material of its own, at so many pixels for a scene unit; plants as coarse as they are seen
    /// with `scale_at` pixels. Of the plants, those count whose ball (middle and radius) does.
    pub(super) fn new(
        scene: &'s Scene,
        fit: &'s Fit,
        scale: f64,
        scale_at: impl Fn(Point) -> f64,
        without: Option<MaterialId>,
        counts: impl Fn(Point, f64) -> bool,
        threads: usize,
    ) -> Casters<'s> {
        let own = Group { scene, default_width: fit.default_width, scale, places: vec![None] };
        let mut casters = Casters {
            fit,
            scale,
            without,
            groups: vec![own],
            numbers: HashMap::new(),
            drafts: Vec::new(),
            around: [Vector::zeros(); 2],
            core: [Vector::zeros(); 2],
            count: 0,
        };
        casters.gather(scene, None, &scale_at, &counts);
        casters.measure(threads);
        casters
    }

    /// Sorts the plants of a scene in its place into groups. Recursion is bounded by the depth of plants in plants.
    fn gather(
        &mut self,
        scene: &'s Scene,
        place: Option<&Placement>,
        scale_at: &dyn Fn(Point) -> f64,
        counts: &dyn Fn(Point, f64) -> bool,
    ) {
        for plant in &scene.plants {
            let Some([low, high]) = plant.bounds() else { continue };
            let placement = match place {
                None => plant.placement,
                Some(outer) => plant.placement.within(outer),
            };
            let middle = placement.point(nalgebra::center(&low, &high));
            if !counts(middle, (high - low).norm() / 2.0 * placement.largest()) {
                continue;
            }
            // A plant behind the viewer is seen by its shadow only.
            let seen = Some(scale_at(middle)).filter(|seen| *seen > 0.0);
            let scale = seen.map_or(self.scale, |seen| seen.min(self.scale)) * placement.largest();
            let exponent = scale.log2().ceil().clamp(-60.0, 60.0) as i32;
            let number =
                *self.numbers.entry(((&raw const *plant.scene).addr(), exponent)).or_insert_with(|| {
                    let scale = 2_f64.powi(exponent);
                    let default_width = plant.default_width();
                    self.groups.push(Group { scene: &plant.scene, default_width, scale, places: Vec::new() });
                    self.groups.len() - 1
                });
            self.groups[number].places.push(Some(placement));
            self.gather(&plant.scene, Some(&placement), scale_at, counts);
        }
    }

    fn draft(&self, group: &Group<'s>) -> Draft<'s> {
        let detail = Detail {
            scale_at: |_| group.scale,
            scale_of: None,
            accuracy: self.fit.accuracy.max(SLACK / self.scale),
            scale: self.scale,
            is_flat: false,
            floor: group.scene.surroundings.floor,
        };
        Draft::new(group.scene, group.default_width, &detail)
    }

    /// Those of the triangles of a draft that cast shadows where it has this place.
    fn casting<'d>(
        &self,
        faces: &'d [Triangle],
        place: Option<&Placement>,
    ) -> impl Iterator<Item = &'d Triangle> + use<'d> {
        let without = self.without.filter(|_| place.is_none());
        faces.iter().filter(move |face| Some(face.material) != without)
    }

    /// Finds the box around everything, and how much there is.
    fn measure(&mut self, threads: usize) {
        let (mut around, mut core) = (Around::nothing(), Around::nothing());
        let (mut count, mut kept) = (0, 0);
        let mut drafts = Vec::with_capacity(self.groups.len());
        for groups in self.groups.chunks(SIDE_BY_SIDE) {
            for measured in each(threads, groups.len(), |i| self.measured(&groups[i])) {
                around.merge(&measured.soil);
                core.merge(&measured.around);
                count += measured.count;
                kept += measured.draft.len();
                drafts.push(Some(measured.draft).filter(|_| kept <= KEPT));
            }
        }
        (self.drafts, self.count) = (drafts, count);
        around.merge(&core);
        self.around = around.reach().unwrap_or(self.around);
        self.core = core.reach().unwrap_or(self.around);
    }

    fn measured(&self, group: &Group<'s>) -> Measured<'s> {
        let draft = self.draft(group);
        let (mut soil, mut around) = (Around::nothing(), Around::nothing());
        let mut count = 0;
        for place in &group.places {
            let place = place.as_ref();
            let terrain = group.scene.terrain.filter(|_| place.is_none());
            draft.each_piece(&mut |piece| {
                for face in self.casting(&piece.mesh.faces, place) {
                    let around = if Some(face.owner) == terrain { &mut soil } else { &mut around };
                    for (v, _) in face.corners {
                        let at = piece.mesh.vertices[v as usize];
                        around.include(&place.map_or(at, |place| place.point(at)).coords);
                    }
                    count += 1;
                }
                for (ends, _) in piece.lines(place) {
                    ends.iter().for_each(|end| around.include(&end.coords));
                    count += 1;
                }
            });
        }
        Measured { draft, soil, around, count }
    }

    /// Passes everything on, a batch at a time.
    pub(super) fn each_batch(&self, mut visit: impl FnMut(&Batch)) {
        let mut batch = Batch::default();
        let relative = |p: Point| {
            let p = p.coords - self.around[0];
            [p.x as f32, p.y as f32, p.z as f32]
        };
        let mut pass_on = |batch: &mut Batch| {
            if batch.room() == 0 {
                visit(batch);
                batch.clear();
            }
        };
        for (group, kept) in self.groups.iter().zip(&self.drafts) {
            let made = kept.is_none().then(|| self.draft(group));
            let Some(draft) = kept.as_ref().or(made.as_ref()) else { continue };
            for place in &group.places {
                let place = place.as_ref();
                draft.each_piece(&mut |draft| {
                    let mut rest = &draft.mesh.faces[..];
                    while !rest.is_empty() {
                        let (faces, later) = rest.split_at(batch.room().min(rest.len()));
                        rest = later;
                        // Triangles that follow one another have vertices that do.
                        let corners =
                            self.casting(faces, place).flat_map(|face| face.corners.map(|(v, _)| v));
                        let (low, end) =
                            corners.fold((u32::MAX, 0), |(low, end), v| (low.min(v), end.max(v + 1)));
                        let first = batch.vertices[0].len() as u32;
                        let vertices =
                            draft.mesh.vertices.get(low as usize..end as usize).unwrap_or_default();
                        let placed =
                            vertices.iter().map(|&p| relative(place.map_or(p, |place| place.point(p))));
                        for p in placed {
                            batch.vertices.iter_mut().zip(p).for_each(|(all, x)| all.push(x));
                        }
                        for face in self.casting(faces, place) {
                            let corners = face.corners.map(|(v, _)| first + (v - low));
                            match draft.cut_out(face) {
                                None => batch.triangles.push(corners),
                                Some((places, texture)) => batch.cut.push((corners, places, texture)),
                            }
                        }
                        pass_on(&mut batch);
                    }
                    for (ends, radii) in draft.lines(place) {
                        batch.lines.push((ends.map(relative), radii.map(|r| r as f32)));
                        pass_on(&mut batch);
                    }
                });
            }
        }
        visit(&batch);
    }

    /// The box around everything.
    pub(super) fn around(&self) -> Reach {
        self.around
    }

    /// The box around everything but ground of soil, which reaches much further than what stands on it.
    pub(super) fn core(&self) -> Reach {
        self.core
    }

    /// Number of triangles and thin stems.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Survey, View};
    use dlsys_geometry::scene::{Owner, Patch, Plant};
    use dlsys_tree::Lineage;
    use std::sync::Arc;

    #[test]
    fn all_plants_come_in_batches_whether_their_drafts_are_kept_or_not() {
        let mut organ = Scene::default();
        let owner = organ.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
        let place = |r: usize, c: usize| Point::new(c as f64, r as f64, (c * c + r) as f64 / 3.0);
        let net = [0, 1, 2, 3].map(|r| [0, 1, 2, 3].map(|c| place(r, c)));
        organ.patches.push(Patch { net, material: MaterialId::LEAF, owner });
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "@P".into(), lineage: Lineage::of_axiom(0) });
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        let at = |i: usize| Placement::uniform(Point::new(0.001 * i as f64, 0.0, 0.0), axes, 1.0);
        let plant = Plant::new(Arc::new(organ), at(0), owner);
        scene.plants = (0..3000).map(|i| plant.twin(at(i), owner)).collect();
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let fit = survey.fit();
        let mut casters = Casters::new(&scene, &fit, 160.0, |_| 160.0, None, |_, _| true, 1);
        let collect = |casters: &Casters| {
            let (mut all, mut most) = (Vec::new(), 0);
            casters.each_batch(|batch| {
                let corners = |t: &[u32; 3]| t.map(|v| batch.vertices.each_ref().map(|all| all[v as usize]));
                all.extend(batch.triangles.iter().map(corners));
                most = most.max(batch.triangles.len().max(batch.vertices[0].len()));
            });
            (all, most)
        };
        let (kept, most) = collect(&casters);
        assert_eq!(kept.len(), casters.count());
        assert!(kept.len() > BATCH && most < BATCH + BATCH / 8, "{} {most}", kept.len());
        assert_eq!(casters.groups.len(), 2, "one draft for all plants");
        casters.drafts.iter_mut().for_each(|draft| *draft = None);
        assert_eq!(collect(&casters).0, kept);
        // One mesh of all of them goes in parts, too.
        let flat = scene.flattened();
        let whole = Casters::new(&flat, &fit, 160.0, |_| 160.0, None, |_, _| true, 1);
        let (passed, most) = collect(&whole);
        assert_eq!(passed.len(), whole.count());
        assert!(passed.len() > BATCH && most < BATCH + BATCH / 8, "{} {most}", passed.len());
        // Far away, a plant is two triangles.
        let far = Casters::new(&scene, &fit, 40.0, |_| 1e-3, None, |_, _| true, 1);
        assert_eq!(far.count(), 6000);
    }
}
