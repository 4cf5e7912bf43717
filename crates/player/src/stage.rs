//! A scene as instances: each thing is a form and the numbers that place it.
//!
//! | form | numbers |
//! |---|---|
//! | a length of a stem | two cross-sections: centre, u, v |
//! | a surface | where its origin, its first and its second axis (of its size) come to lie; the third is their product |
//! | a surface scaled by axis | where its origin and its three axes (of its sizes) come to lie |
//! | a patch | 16 control points, row by row |
//! | a polygon | its corners |
//! | a net | the corners of its mesh |

use std::collections::HashMap;

use super::forms::Forms;
use dlsys_geometry::scene::{MaterialId, OwnerId, Point, Scene, Segment};
use dlsys_render::{CrossSection, Fit, Puff, lengths, puffs};

/// What is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// A length of a stem, with this contour of the model, or round.
    Stem(Option<u32>),
    /// A mesh, by its number among the [`Forms`].
    Mesh(u32),
    /// The same, with a scale for each axis.
    Stretched(u32),
    /// A bicubic Bézier patch: its 16 control points.
    Patch,
    /// A polygon of so many corners.
    Polygon(u32),
    /// A mesh, by its number among the [`Forms`], whose corners, so many, move by themselves: a sheet, or a piece of ground.
    Net(u32, u32),
}

impl Form {
    /// Numbers that place it.
    pub fn numbers(self) -> usize {
        match self {
            Form::Stem(_) => 18,
            Form::Mesh(_) => 9,
            Form::Stretched(_) => 12,
            Form::Patch => 48,
            Form::Polygon(corners) | Form::Net(_, corners) => 3 * corners as usize,
        }
    }
}

/// Who a thing is, at any time: the module that drew it, and which of the things of that form it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key {
    /// See [`Lineage::id`](dlsys_tree::Lineage::id).
    pub lineage: u64,
    /// The form that it is a copy of.
    pub form: Form,
    /// How many things of this form the module has drawn before it in the frame; of stems, how many segments.
    pub count: u32,
    /// Of a length of a stem: its number among those of its segment, the last of which is 0, and how many these are. Where joints come and go, lengths are not taken for
    /// others.
    pub length: [u16; 2],
}

/// Material and variant of a thing at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finish {
    /// `None`: each part of a mesh has its own.
    pub material: Option<MaterialId>,
    /// Of a stem: 1 if a dome closes its start, plus 2 if one closes its end. Of a polygon: how it is cut into
    /// triangles, by its number among the [`Forms`]. Of a mesh and of a net: 1 for ground, which the camera need not take in.
    pub variant: u32,
}

/// A thing in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// Follows the item from frame to frame.
    pub key: Key,
    /// Its colours.
    pub finish: Finish,
    /// Index of the first of its numbers.
    pub first: usize,
}

/// Everything that is to be seen at one instant.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// In string order within a kind of form.
    pub items: Vec<Item>,
    /// In scene units.
    pub numbers: Vec<f64>,
    /// What its things have in common.
    pub forms: Forms,
    /// The blobs of gases, in light.
    pub puffs: Vec<Puff>,
    counts: HashMap<(OwnerId, Form), u32>,
}

impl Stage {
    /// Takes the place of what was there before; `fit` is that of the animation.
    pub fn set(&mut self, scene: &Scene, fit: &Fit) {
        let scene = &*scene.flattened();
        self.items.clear();
        self.numbers.clear();
        self.counts.clear();
        // Lengths come stem by stem; a module's are counted in its own order, which lasts.
        let mut stems = lengths(scene, fit);
        stems.reverse();
        stems.sort_by_key(|length| length.of);
        for own in stems.chunk_by(|a, b| a.of == b.of) {
            let Segment { owner, contour, .. } = scene.segments[own[0].of];
            let count = self.count(owner, Form::Stem(contour));
            for (i, length) in own.iter().enumerate() {
                let material = Some(scene.segments[length.segment].material);
                let [start, end] = length.caps.map(u32::from);
                let finish = Finish { material, variant: start + 2 * end };
                let number = [i, own.len()].map(|n| n.min(usize::from(u16::MAX)) as u16);
                let key = Key { length: number, ..self.key(scene, owner, Form::Stem(contour), count) };
                self.items.push(Item { key, finish, first: self.numbers.len() });
                for CrossSection { centre, u, v } in length.ends {
                    [centre.coords, u, v].iter().for_each(|vector| self.numbers.extend(vector.iter()));
                }
            }
        }
        for polygon in &scene.polygons {
            let finish = Finish {
                material: Some(polygon.material),
                variant: self.forms.triangulation(&polygon.vertices),
            };
            self.begin(scene, polygon.owner, Form::Polygon(polygon.vertices.len() as u32), finish);
            self.place(&polygon.vertices);
        }
        self.set_surfaces(scene, 0);
        for patch in &scene.patches {
            self.begin(
                scene,
                patch.owner,
                Form::Patch,
                Finish { material: Some(patch.material), variant: 0 },
            );
            patch.net.iter().for_each(|row| self.place(row));
        }
        self.puffs = puffs(scene, fit, 1);
    }

    /// About how many numbers the things of a scene take, those of plants of other models included: joints and bends of stems take more.
    pub fn weight(scene: &Scene) -> usize {
        let surfaces = scene.surfaces.iter().map(|surface| match surface.rest {
            Some(_) => 3 * surface.mesh.vertices.len(),
            None => Form::Mesh(0).numbers(),
        });
        let polygons = scene.polygons.iter().map(|polygon| 3 * polygon.vertices.len());
        // Bounded by the depth of plants in plants.
        let plants = scene.plants.iter().map(|plant| Stage::weight(&plant.scene));
        let own =
            scene.segments.len() * Form::Stem(None).numbers() + scene.patches.len() * Form::Patch.numbers();
        own + surfaces.chain(polygons).chain(plants).sum::<usize>()
    }

    /// Adds ground to what is there: a scene of surfaces.
    pub fn add_ground(&mut self, ground: &Scene) {
        self.set_surfaces(ground, 1);
    }

    fn set_surfaces(&mut self, scene: &Scene, variant: u32) {
        for surface in &scene.surfaces {
            let placement = &surface.placement;
            let finish = Finish { material: surface.tint, variant };
            if let Some(rest) = &surface.rest {
                let points = &surface.mesh.vertices;
                let form = Form::Net(self.forms.net(rest), points.len() as u32);
                self.begin(scene, surface.owner, form, finish);
                self.numbers.extend(points.iter().flat_map(|p| <[f64; 3]>::from(placement.point(*p).coords)));
                continue;
            }
            let number = self.forms.mesh(surface);
            let (form, axes) =
                if placement.is_uniform() { (Form::Mesh(number), 2) } else { (Form::Stretched(number), 3) };
            self.begin(scene, surface.owner, form, finish);
            self.numbers.extend(placement.origin.iter());
            for (axis, scale) in placement.axes.iter().zip(placement.scales).take(axes) {
                self.numbers.extend((axis * scale).iter());
            }
        }
    }

    fn begin(&mut self, scene: &Scene, owner: OwnerId, form: Form, finish: Finish) {
        let count = self.count(owner, form);
        let key = self.key(scene, owner, form, count);
        self.items.push(Item { key, finish, first: self.numbers.len() });
    }

    /// How many things of a form a module has drawn before this one.
    fn count(&mut self, owner: OwnerId, form: Form) -> u32 {
        let count = self.counts.entry((owner, form)).or_default();
        *count += 1;
        *count - 1
    }

    fn key(&self, scene: &Scene, owner: OwnerId, form: Form, count: u32) -> Key {
        Key { lineage: scene.owner(owner).lineage.id, form, count, length: [0; 2] }
    }

    fn place(&mut self, points: &[Point]) {
        self.numbers.extend(points.iter().flat_map(|p| p.iter()));
    }

    /// The numbers that place a thing.
    pub fn numbers_of(&self, item: &Item) -> &[f64] {
        &self.numbers[item.first..item.first + item.key.form.numbers()]
    }
}
