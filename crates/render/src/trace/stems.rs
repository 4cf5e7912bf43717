//! Scenes of nothing but stems: strokes from back to front, and only what is wide in the picture as regions.
//!
//! A stroke costs as much as a line of text, a region what its cells do. So where there are no surfaces, stems are strokes in an [order] in which
//! nothing covers what is in front of it. Regions are left for wide stems, whose joints, feet and bends have shades of their own.

use super::order::{self, Line};
use super::{LEAST_PIXELS, WIDEST_STROKE};
use crate::painter::Style;
use dlsys_geometry::scene::{Point, Scene, Segment};

/// A stem that looks shorter than this many widths is a region: its ends are much of it.
const SHORTEST: f64 = 1.0;

/// One of so many stems, or more of them, are regions: then all are.
const MANY: usize = 4;

/// How the stems of a scene without anything else are painted.
pub struct Plan {
    /// The strokes, from back to front.
    pub strokes: Vec<usize>,
    /// By segment: whether it is made of regions, and whether it is, or meets one that is.
    pub is_region: Vec<bool>,
    pub is_near: Vec<bool>,
}

impl Plan {
    /// `None` if all has to be made of regions: there are other things than stems, or stems that overlap in a circle, or light that changes along a
    /// stem.
    pub fn of(scene: &Scene, style: Style) -> Option<Plan> {
        let around = style.fit.surroundings(style.casting.unwrap_or(scene));
        let has_lamp = around.sun.is_none() && around.sky.is_none() && around.floor.is_none();
        let is_bare = scene.surfaces.is_empty() && scene.polygons.is_empty() && scene.terrain.is_none();
        if !has_lamp || !is_bare {
            return None;
        }
        let mut lines: Vec<Line> =
            scene.segments.iter().map(|segment| line(segment, style)).collect::<Option<_>>()?;
        let is_region: Vec<bool> =
            lines.iter().zip(&scene.segments).map(|(line, segment)| is_region(line, segment)).collect();
        if MANY * is_region.iter().filter(|is_region| **is_region).count() > lines.len() {
            return None;
        }
        let is_joined = |i: Option<usize>| i.is_some_and(|i| is_region[i]);
        let mut is_near = is_region.clone();
        for (i, segment) in scene.segments.iter().enumerate() {
            is_near[i] |= is_joined(segment.follows) || is_joined(segment.grows_from);
            for before in [segment.follows, segment.grows_from].into_iter().flatten() {
                is_near[before] |= is_region[i];
            }
        }
        let numbers: Vec<usize> = (0..lines.len()).filter(|i| !is_region[*i]).collect();
        let mut kept = is_region.iter().map(|is_region| !is_region);
        lines.retain(|_| kept.next() == Some(true));
        let strokes = order::from_back(&lines)?.into_iter().map(|i| numbers[i as usize]).collect();
        Some(Plan { strokes, is_region, is_near })
    }

    /// Whether there is any region.
    pub fn has_regions(&self) -> bool {
        self.is_region.contains(&true)
    }
}

/// A segment in the picture; `None` if the viewer does not see all of it from before.
fn line(segment: &Segment, style: Style) -> Option<Line> {
    let Style { fit, pixels, .. } = style;
    let see = |p: Point| fit.camera.ahead(p);
    let seen = [see(segment.start)?, see(segment.end)?];
    let larger = seen.map(|p| fit.camera.magnification(p.z));
    let radius = |k: usize| segment.widths[k].resolve(fit.default_width) / 2.0 * larger[k] * pixels;
    let radii = [radius(0), radius(1)];
    let fronts = [radii[0] * larger[0], radii[1] * larger[1]];
    let ends = seen.map(|p| [p.x * pixels, p.y * pixels, p.z * pixels]);
    let hides = radii[0] + radii[1] >= LEAST_PIXELS;
    Some(Line { ends, radii, fronts, hides, color: segment.material.index() })
}

/// Whether a stem is more than a stroke shows.
fn is_region(line: &Line, segment: &Segment) -> bool {
    let Line { ends: [[x1, y1, _], [x2, y2, _]], radii: [a, b], hides, .. } = *line;
    let length = (x2 - x1).hypot(y2 - y1);
    hides && (segment.contour.is_some() || a + b > WIDEST_STROKE || length < SHORTEST * (a + b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Format;
    use crate::{FrameWriter, Page, Survey, View};
    use dlsys_geometry::scene::{MaterialId, Owner, Polygon, Vector, Width};
    use dlsys_tree::Lineage;

    /// Stems of one module each, between these places and of these widths.
    fn scene(stems: &[([f64; 3], [f64; 3], f64)]) -> Scene {
        let mut scene = Scene::default();
        for (i, (start, end, width)) in stems.iter().enumerate() {
            let [start, end] = [start, end].map(|p| Point::from(*p));
            let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(i) });
            scene.segments.push(Segment {
                start,
                end,
                direction: (end - start).normalize(),
                across: Vector::x(),
                widths: [Width::Set(*width); 2],
                contour: None,
                material: if i % 2 == 0 { MaterialId::STEM } else { MaterialId::LEAF },
                owner,
                follows: None,
                grows_from: None,
            });
        }
        scene
    }

    fn with_plan<Found>(scene: &Scene, look: impl FnOnce(Option<Plan>) -> Found) -> Found {
        let mut survey = Survey::new(View::FRONT);
        survey.add(scene);
        let fit = survey.fit();
        let style = crate::formats::svg::style(&fit, &Page::usual(fit.picture));
        look(Plan::of(scene, style))
    }

    /// One that runs into the depth, in front of the second and behind the third where it crosses them, though the depths of the middles tell otherwise; and
    /// one that is apart.
    fn crossed() -> Scene {
        scene(&[
            ([0.0, 0.0, -100.0], [100.0, 0.0, 40.0], 1.0),
            ([50.0, -10.0, -45.0], [50.0, 10.0, -45.0], 1.0),
            ([90.0, -10.0, 40.0], [90.0, 10.0, 40.0], 1.0),
            ([20.0, 20.0, 0.0], [20.0, 90.0, 0.0], 1.0),
        ])
    }

    #[test]
    fn stems_are_painted_in_the_order_in_which_they_cover_one_another() {
        let scene = crossed();
        let order = with_plan(&scene, |plan| plan.expect("an order").strokes);
        let place = |i: usize| order.iter().position(|other| *other == i);
        assert!(place(1) < place(0) && place(0) < place(2), "{order:?}");
        // No region, and each is one element.
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let svg = FrameWriter::new(Format::SVG, survey.fit()).write(&scene, "");
        let svg = String::from_utf8(svg).expect("UTF-8");
        assert_eq!(svg.matches(" id=\"F-").count(), 4, "{svg}");
        assert!(!svg.contains("<g id="), "{svg}");
    }

    #[test]
    fn other_things_than_stems_are_regions_and_so_are_many_wide_stems() {
        let mut all = crossed();
        all.polygons.push(Polygon {
            vertices: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point::from).to_vec(),
            material: MaterialId::LEAF,
            owner: all.segments[0].owner,
        });
        assert!(with_plan(&all, |plan| plan.is_none()));
        let mut wide = crossed();
        wide.segments[3].widths = [Width::Set(6.0); 2];
        let plan = with_plan(&wide, |plan| plan.expect("an order"));
        assert_eq!((plan.is_region, plan.strokes.len()), (vec![false, false, false, true], 3));
        wide.segments[2].widths = [Width::Set(6.0); 2];
        assert!(with_plan(&wide, |plan| plan.is_none()));
        // One passes through another.
        let mut through = crossed();
        (through.segments[1].start.z, through.segments[1].end.z) = (-30.0, -30.0);
        assert!(with_plan(&through, |plan| plan.is_none()));
    }
}
