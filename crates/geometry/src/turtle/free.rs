//! Parts of a string that are let go (`@D`), and bodies (`solid`): what they are made of, as they are seen, and points of their surfaces.

use super::Pose;
use super::bent::PartKey;
use super::skeleton::{Carrier, Origin, Piece, Recorder, Stem};
use crate::scene::{Placement, Point, Scene, Surface};

/// What follows an `@D`, to the end of the branch, as it is seen. What is let go within it is a part of its own.
#[derive(Clone, Debug)]
pub struct FreePart {
    /// Its identity.
    pub key: PartKey,
    /// The module that holds its `@D`.
    pub origin: Origin,
    /// Where the turtle stands at the `@D`.
    pub pose: Pose,
    /// Its elements that have a mass.
    pub pieces: Vec<Piece>,
    /// Its stems that give way as long as a branch holds them, where they begin in their shape at rest.
    pub stems: Vec<Stem>,
    /// Small balls that its surface lies between: their centres and radii, in scene units.
    pub points: Vec<(Point, f64)>,
}

/// Points along each side of a Bézier patch.
const PATCH_POINTS: usize = 5;

/// The drawing of one module that is solid, as it is seen.
#[derive(Clone, Debug)]
pub struct SolidBody {
    /// The module.
    pub origin: Origin,
    /// Small balls that its surface lies between: their centres and radii, in scene units.
    pub points: Vec<(Point, f64)>,
    /// How it is not solid, if a stem that bends carries it or is a part of it, or if it is let go.
    pub passive: Option<Passive>,
}

/// How a module is passive in a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passive {
    /// It stands on stems that give way, or holds one.
    Bends,
    /// It has been let go.
    Falls,
}

impl Recorder {
    /// Notes the points of the free parts.
    pub(super) fn points(&self, scene: &Scene, parts: &mut [FreePart]) {
        self.each(scene, |carrier| carrier.part, |part, point| parts[part].points.push(point));
    }

    /// The bodies, with their points.
    pub(super) fn finish_solids(mut self, scene: &Scene) -> Vec<SolidBody> {
        let mut solids = std::mem::take(&mut self.solids);
        self.each(scene, |carrier| carrier.solid, |solid, point| solids[solid].points.push(point));
        solids.retain(|solid| !solid.points.is_empty() || solid.passive.is_some());
        solids
    }

    /// Hands over the points of elements that have an owner of one sort, with the owner's number.
    fn each(
        &self,
        scene: &Scene,
        owner: fn(&Carrier) -> Option<usize>,
        mut take: impl FnMut(usize, (Point, f64)),
    ) {
        for (carrier, segment) in self.segments.iter().zip(&scene.segments) {
            if let Some(owner) = owner(carrier) {
                let [from, to] = segment.widths.map(|width| width.resolve(0.0) / 2.0);
                take(owner, (segment.start, from));
                take(owner, (segment.end, to));
            }
        }
        for (carrier, surface) in self.surfaces.iter().zip(&scene.surfaces) {
            if let Some(owner) = owner(carrier) {
                of_surface(surface, |point| take(owner, point));
            }
        }
        for (carrier, polygon) in self.polygons.iter().zip(&scene.polygons) {
            if let Some(owner) = owner(carrier) {
                polygon.vertices.iter().for_each(|p| take(owner, (*p, 0.0)));
            }
        }
        for (carrier, patch) in self.patches.iter().zip(&scene.patches) {
            if let Some(owner) = owner(carrier) {
                let at = |k: usize| k as f64 / (PATCH_POINTS - 1) as f64;
                for (row, column) in
                    (0..PATCH_POINTS).flat_map(|row| (0..PATCH_POINTS).map(move |column| (row, column)))
                {
                    take(owner, (patch.point(at(row), at(column)), 0.0));
                }
            }
        }
    }
}

fn of_surface(surface: &Surface, mut take: impl FnMut((Point, f64))) {
    let place: &Placement = &surface.placement;
    if surface.patches.as_ref().is_some_and(|patches| patches.is_ball()) {
        let radii = place.scales.map(|scale| scale / 2.0);
        let least = radii.into_iter().fold(f64::INFINITY, f64::min);
        take((place.origin, least));
        // The ends of the axes of an ellipsoid.
        for (axis, radius) in place.axes.iter().zip(radii).filter(|(_, radius)| *radius > least) {
            let aside = axis * (radius - least);
            take((place.origin + aside, least));
            take((place.origin - aside, least));
        }
        return;
    }
    surface.mesh.vertices.iter().for_each(|vertex| take((place.point(*vertex), 0.0)));
}
