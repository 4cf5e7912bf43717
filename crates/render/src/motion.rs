//! How far things move in a picture from one instant to another.

use std::collections::HashMap;

use dlsys_geometry::scene::{OwnerId, Point, Scene};

use crate::{Fit, Page};

/// Where the modules of a scene are in a picture: for each, points that move as it does, in pixels.
#[derive(Clone, Debug, Default)]
pub struct Positions {
    /// By lineage. Points behind the viewer have no place.
    modules: HashMap<u64, Vec<Option<[f64; 2]>>>,
    /// Where the picture ends.
    size: [f64; 2],
}

/// What has changed between two instants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// The farthest way of a point that is in the picture, or near to it, in pixels.
    pub pixels: f64,
    /// Modules have appeared in the picture, or have gone from it, or draw other things.
    pub has_changed: bool,
}

/// How far beyond the picture a point still counts, in parts of its size.
const BESIDE: f64 = 0.25;
/// What is smaller than this, in pixels, appears unseen.
const UNSEEN: f64 = 0.5;

impl Positions {
    pub(crate) fn new(scene: &Scene, fit: &Fit, page: &Page) -> Positions {
        let [a, b, c] = page.placement();
        let mut modules: HashMap<u64, Vec<Option<[f64; 2]>>> = HashMap::new();
        let mut put = |owner: OwnerId, points: &mut dyn Iterator<Item = Point>| {
            let places = points.map(|p| fit.camera.ahead(p).map(|seen| [a * seen.x + b, c - a * seen.y]));
            modules.entry(scene.owner(owner).lineage.id).or_default().extend(places);
        };
        for segment in &scene.segments {
            put(segment.owner, &mut [segment.start, segment.end].into_iter());
        }
        for polygon in &scene.polygons {
            put(polygon.owner, &mut polygon.vertices.iter().copied());
        }
        for surface in &scene.surfaces {
            if let Some(bounds) = surface.mesh.bounds() {
                put(surface.owner, &mut surface.placement.corners(bounds).into_iter());
            }
        }
        for patch in &scene.patches {
            put(patch.owner, &mut patch.net.iter().flatten().copied());
        }
        for plant in &scene.plants {
            put(plant.owner, &mut plant.corners());
        }
        Positions { modules, size: page.pixels.map(f64::from) }
    }

    /// The motion from here to another instant of the same picture.
    pub fn motion(&self, to: &Positions) -> Motion {
        let mut motion = Motion::default();
        let mut compared = 0;
        for (module, from) in &self.modules {
            let Some(to) = to.modules.get(module) else {
                motion.has_changed |= self.is_seen(from);
                continue;
            };
            compared += 1;
            let way = |from: [f64; 2], to: [f64; 2]| match self.is_beside(from, to) {
                false => 0.0,
                true => (from[0] - to[0]).hypot(from[1] - to[1]),
            };
            if from.len() == to.len() {
                let ways = from.iter().zip(to).filter_map(|(from, to)| Some(way((*from)?, (*to)?)));
                motion.pixels = ways.fold(motion.pixels, f64::max);
            } else if let (Some(from), Some(to)) = (bounds(from), bounds(to)) {
                // Other parts, such as the pieces of a bent stem: its box.
                let ways = from.into_iter().zip(to).map(|(from, to)| way(from, to));
                motion.pixels = ways.fold(motion.pixels, f64::max);
                motion.has_changed = true;
            }
        }
        let new = || to.modules.iter().filter(|(module, _)| !self.modules.contains_key(module));
        motion.has_changed |= compared < to.modules.len() && new().any(|(_, points)| self.is_seen(points));
        motion
    }

    /// Whether a way crosses the picture, or comes near to it.
    fn is_beside(&self, from: [f64; 2], to: [f64; 2]) -> bool {
        (0..2).all(|k| {
            let (low, high) = (from[k].min(to[k]), from[k].max(to[k]));
            high >= -BESIDE * self.size[k] && low <= (1.0 + BESIDE) * self.size[k]
        })
    }

    /// Whether a module of these points is in the picture, and not too small to be seen.
    fn is_seen(&self, points: &[Option<[f64; 2]>]) -> bool {
        let Some([low, high]) = bounds(points) else { return false };
        self.is_beside(low, high) && (high[0] - low[0]).max(high[1] - low[1]) > UNSEEN
    }
}

/// The corners of the box around points.
fn bounds(points: &[Option<[f64; 2]>]) -> Option<[[f64; 2]; 2]> {
    points.iter().flatten().fold(None, |bounds, p| {
        let [low, high] = bounds.unwrap_or([*p, *p]);
        Some([[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions(modules: &[(u64, &[[f64; 2]])]) -> Positions {
        let places = |points: &[[f64; 2]]| points.iter().map(|p| Some(*p)).collect();
        let modules = modules.iter().map(|(module, points)| (*module, places(points))).collect();
        Positions { modules, size: [100.0, 50.0] }
    }

    #[test]
    fn the_fastest_point_in_the_picture_counts() {
        let before = positions(&[(1, &[[10.0, 10.0], [20.0, 10.0]]), (2, &[[900.0, 900.0]])]);
        let after = positions(&[(1, &[[11.0, 10.0], [23.0, 14.0]]), (2, &[[500.0, 900.0]])]);
        assert_eq!(before.motion(&after), Motion { pixels: 5.0, has_changed: false });
        assert_eq!(before.motion(&before), Motion::default());
    }

    #[test]
    fn what_appears_or_vanishes_is_a_change_if_it_is_seen() {
        let little = positions(&[(1, &[[10.0, 10.0]])]);
        for (points, expected) in [
            ([[10.0, 10.0], [10.2, 10.3]], false),
            ([[10.0, 10.0], [12.0, 10.0]], true),
            ([[810.0, 10.0], [812.0, 10.0]], false),
        ] {
            let more = positions(&[(1, &[[10.0, 10.0]]), (2, &points)]);
            assert_eq!(little.motion(&more), Motion { pixels: 0.0, has_changed: expected }, "{points:?}");
            assert_eq!(more.motion(&little), little.motion(&more));
        }
        // A stem in other pieces: its box.
        let bent = positions(&[(1, &[[10.0, 10.0], [10.0, 20.0], [14.0, 30.0]])]);
        let straight = positions(&[(1, &[[10.0, 10.0], [10.0, 33.0]])]);
        assert_eq!(straight.motion(&bent), Motion { pixels: 5.0, has_changed: true });
    }
}
