//! A scene with its plants, as one scene without plants.

use std::borrow::Cow;

use super::{OwnerId, Patch, Placement, Polygon, Scene, Segment, Surface, Width};

impl Scene {
    /// The scene with the elements of its plants among its own, plants in plants included: for formats that know nothing of plants.
    pub fn flattened(&self) -> Cow<'_, Scene> {
        self.flattened_with(|_| true)
    }

    /// The same with those of its plants, by number, that are to be `kept`; the others are left out.
    pub fn flattened_with(&self, kept: impl Fn(usize) -> bool) -> Cow<'_, Scene> {
        if self.plants.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut flat = self.clone();
        let plants = std::mem::take(&mut flat.plants).into_iter().enumerate();
        for (_, plant) in plants.filter(|(number, _)| kept(*number)) {
            flat.add_plant(&plant.scene, &plant.placement, plant.owner);
        }
        Cow::Owned(flat)
    }

    /// Adds the elements of another scene with the same palette and contours, as a plant of this module. Recursion is bounded by the
    /// depth of plants in plants.
    fn add_plant(&mut self, plant: &Scene, at: &Placement, owner: OwnerId) {
        let around = self.owners[owner.index()].lineage;
        let first = self.owners.len() as u32;
        let own = |id: OwnerId| OwnerId(first + id.0);
        for inner in &plant.owners {
            let mut inner = inner.clone();
            inner.lineage = around.of_plant(inner.lineage);
            self.owners.push(inner);
        }
        let offset = self.segments.len();
        let width = |width: Width| match width {
            Width::Set(width) => Width::Set(width * at.largest()),
            default => default,
        };
        self.segments.extend(plant.segments.iter().map(|segment| Segment {
            start: at.point(segment.start),
            end: at.point(segment.end),
            direction: at.turned(segment.direction),
            across: at.turned(segment.across),
            widths: segment.widths.map(width),
            owner: own(segment.owner),
            follows: segment.follows.map(|before| before + offset),
            grows_from: segment.grows_from.map(|parent| parent + offset),
            ..segment.clone()
        }));
        self.polygons.extend(plant.polygons.iter().map(|polygon| Polygon {
            vertices: polygon.vertices.iter().map(|p| at.point(*p)).collect(),
            material: polygon.material,
            owner: own(polygon.owner),
        }));
        self.surfaces.extend(plant.surfaces.iter().map(|surface| Surface {
            placement: surface.placement.within(at),
            owner: own(surface.owner),
            ..surface.clone()
        }));
        self.patches.extend(plant.patches.iter().map(|patch| Patch {
            net: patch.net.map(|row| row.map(|p| at.point(p))),
            material: patch.material,
            owner: own(patch.owner),
        }));
        for inner in &plant.plants {
            self.add_plant(&inner.scene, &inner.placement.within(at), own(inner.owner));
        }
    }
}
