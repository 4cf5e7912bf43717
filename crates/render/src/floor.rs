//! The floor that a model declares, as an element of the scene: for formats that hold nothing but elements; and how it fades into the horizon.

use std::borrow::Cow;

use super::lens::{Lens, clip};
use super::{Camera, Fit, Page};
use dlsys_geometry::scene::{MaterialId, Owner, Point, Polygon, Scene, Vector};
use dlsys_tree::Lineage;

/// Half of the side of the floor in pictures, in parts of the extent; further away it has the colour of the background.
const SEEN: f64 = 300.0;
/// Half of its side in meshes.
const MESHED: f64 = 5.0;
/// How far behind the middle of the plant a coloured floor begins to fade, and after which distance from there it has half of its colour, in parts
/// of the extent.
const FADES_BEHIND: f64 = 0.5;
const FADES_WITHIN: f64 = 2.0;
/// Less than this is not seen.
const FAINT: f64 = 1.0 / 255.0;
/// Stops of a gradient from the horizon to the lower edge of the picture.
const STOPS: u32 = 24;
/// Its name in files. The mark says that it is no module, and stays out of the file.
const NAME: &str = "=ground";

/// A square of the floor at this height: its half side is so many extents. Seen from above, against the clock.
fn square(fit: &Fit, height: f64, half: f64) -> [Point; 4] {
    let (centre, extent) = fit.middle();
    [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .map(|(x, z)| Point::new(centre.x + x * half * extent, height, centre.z + z * half * extent))
}

/// The corners of what is seen of a floor at this height; none in a drawing without depth.
pub(super) fn outline(fit: &Fit, height: f64, lens: &Lens) -> Vec<Point> {
    if fit.light.is_flat() { Vec::new() } else { clip(&square(fit, height, SEEN), lens) }
}

/// A scene with its floor as a polygon of a module named `ground`, and the material of that: what is seen of it on a page, or a large square.
pub(super) fn added<'s>(
    scene: &'s Scene,
    fit: &Fit,
    page: Option<&Page>,
) -> (Cow<'s, Scene>, Option<MaterialId>) {
    let around = fit.surroundings(scene);
    let Some(height) = around.floor else { return (Cow::Borrowed(scene), None) };
    let vertices = match page {
        Some(page) => outline(fit, height, &Lens::new(fit, page.pixels, page.placement())),
        None => square(fit, height, MESHED).to_vec(),
    };
    if vertices.len() < 3 {
        return (Cow::Borrowed(scene), None);
    }
    let mut scene = scene.clone();
    let owner = scene.add_owner(Owner { name: NAME.into(), lineage: Lineage::of_axiom(0) });
    let material = scene.palette.add("ground", around.floor_color.unwrap_or(Page::BACKGROUND));
    scene.polygons.push(Polygon { vertices, material, owner });
    (Cow::Owned(scene), Some(material))
}

/// How a coloured floor fades into what is behind the horizon, as haze makes it. Places in one row of the picture fade alike: a camera does not lean
/// to a side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fading {
    camera: Camera,
    eye: Point,
    /// The horizontal direction of sight.
    ahead: Vector,
    /// Of the floor.
    height: f64,
    /// From the eye to where it begins, and from there to where half of the colour is left.
    from: f64,
    within: f64,
}

impl Fading {
    /// On a floor at this height; `None` without a horizon: without perspective, from above, from below the floor, and on sheets.
    pub(super) fn new(fit: &Fit, height: f64) -> Option<Fading> {
        let eye = fit.camera.eye().filter(|eye| eye.y > height && fit.shaded.is_none())?;
        let towards = fit.camera.view().towards();
        let ahead = Vector::new(-towards.x, 0.0, -towards.z).try_normalize(1e-3)?;
        let (middle, extent) = fit.middle();
        let from = ((middle - eye).dot(&ahead) + FADES_BEHIND * extent).max(0.0);
        Some(Fading { camera: fit.camera, eye, ahead, height, from, within: FADES_WITHIN * extent })
    }

    /// The part of the colour that is left at a place of the floor.
    pub(super) fn left(&self, at: Point) -> f64 {
        let beyond = ((at - self.eye).dot(&self.ahead) - self.from).max(0.0) / self.within;
        1.0 / (1.0 + beyond * beyond)
    }

    /// Heights of a picture between these edges, from the horizon down, with the parts of the colour that are left there, which change evenly in
    /// between; empty if nothing is seen to fade.
    pub(super) fn stops(&self, [bottom, top]: [f64; 2]) -> Vec<(f64, f64)> {
        let rise = |y: f64| self.camera.sight(y).map_or(0.0, |sight| sight.y);
        // It is linear, and rises.
        let horizon = bottom - rise(bottom) * (top - bottom) / (rise(top) - rise(bottom));
        let left = |y: f64| match self.camera.sight(y) {
            Some(sight) if sight.y < 0.0 => {
                self.left(self.eye + sight * ((self.height - self.eye.y) / sight.y))
            }
            _ => 0.0,
        };
        let stop = |k: u32| {
            let part = f64::from(k) / f64::from(STOPS);
            let y = horizon + (bottom - horizon) * part * part;
            (y, left(y))
        };
        let is_seen = horizon > bottom && left(top.min(horizon)) < 1.0 - FAINT;
        if is_seen { (0..=STOPS).map(stop).collect() } else { Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_fades_from_behind_the_plant_to_the_horizon_in_rows() {
        let camera = Camera::at(Point::new(0.0, 2.0, 10.0), Point::new(0.0, 1.0, 0.0)).expect("an eye");
        let eye = camera.eye().expect("perspective");
        let fading = Fading { camera, eye, ahead: -Vector::z(), height: 0.0, from: 11.0, within: 4.0 };
        assert_eq!(fading.left(Point::new(3.0, 0.0, 0.0)), 1.0);
        assert!((fading.left(Point::new(-7.0, 0.0, -5.0)) - 0.5).abs() < 1e-12);
        let stops = fading.stops([-3.0, 5.0]);
        let (horizon, faintest) = stops[0];
        assert!(camera.elevation(horizon).expect("perspective").abs() < 1e-12 && faintest == 0.0);
        assert!(stops.is_sorted_by(|a, b| a.0 > b.0 && a.1 <= b.1), "{stops:?}");
        assert_eq!(stops.last().expect("stops").1, 1.0);
        // A place of the floor, beside the middle, is as faint as its row.
        let at = Point::new(4.0, 0.0, -9.0);
        let y = camera.project(at).y;
        let k = stops.partition_point(|(of, _)| *of > y);
        assert!((stops[k - 1].1..=stops[k].1).contains(&fading.left(at)));
        // Only what is near is seen.
        assert!(fading.stops([-3.0, -1.0]).is_empty());
    }
}
