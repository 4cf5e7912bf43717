//! The floor that a model declares, as an element of the scene: for formats that hold nothing but elements.

use std::borrow::Cow;

use super::lens::{Lens, clip};
use super::{Fit, Page};
use dlsys_geometry::scene::{MaterialId, Owner, Point, Polygon, Scene};
use dlsys_tree::Lineage;

/// Half of the side of the floor in pictures, in parts of the extent; further away it has the colour of the background.
const SEEN: f64 = 300.0;
/// Half of its side in meshes.
const MESHED: f64 = 5.0;
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
