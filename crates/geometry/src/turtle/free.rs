//! Parts of a string that are let go (`@D`): what they are made of, as they are seen, and where they can touch the ground.

use super::Pose;
use super::bent::PartKey;
use super::skeleton::{Origin, Piece, Recorder, Stem};
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

impl Recorder {
    /// Notes the points of the free parts.
    pub(super) fn points(&self, scene: &Scene, parts: &mut [FreePart]) {
        for (carrier, segment) in self.segments.iter().zip(&scene.segments) {
            if let Some(part) = carrier.part {
                let [from, to] = segment.widths.map(|width| width.resolve(0.0) / 2.0);
                parts[part].points.extend([(segment.start, from), (segment.end, to)]);
            }
        }
        for (carrier, surface) in self.surfaces.iter().zip(&scene.surfaces) {
            if let Some(part) = carrier.part {
                of_surface(surface, &mut parts[part].points);
            }
        }
        for (carrier, polygon) in self.polygons.iter().zip(&scene.polygons) {
            if let Some(part) = carrier.part {
                parts[part].points.extend(polygon.vertices.iter().map(|p| (*p, 0.0)));
            }
        }
        for (carrier, patch) in self.patches.iter().zip(&scene.patches) {
            if let Some(part) = carrier.part {
                let at = |k: usize| k as f64 / (PATCH_POINTS - 1) as f64;
                let all =
                    (0..PATCH_POINTS).flat_map(|row| (0..PATCH_POINTS).map(move |column| (row, column)));
                let points = all.map(|(row, column)| (patch.point(at(row), at(column)), 0.0));
                parts[part].points.extend(points);
            }
        }
    }
}

fn of_surface(surface: &Surface, points: &mut Vec<(Point, f64)>) {
    let place: &Placement = &surface.placement;
    if surface.patches.as_ref().is_some_and(|patches| patches.is_ball()) {
        let radii = place.scales.map(|scale| scale / 2.0);
        let least = radii.into_iter().fold(f64::INFINITY, f64::min);
        points.push((place.origin, least));
        // The ends of the axes of an ellipsoid.
        for (axis, radius) in place.axes.iter().zip(radii).filter(|(_, radius)| *radius > least) {
            points.extend([1.0, -1.0].map(|sign| (place.origin + axis * ((radius - least) * sign), least)));
        }
        return;
    }
    points.extend(surface.mesh.vertices.iter().map(|vertex| (place.point(*vertex), 0.0)));
}
