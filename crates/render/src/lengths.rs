//! Stems as lengths between cross-sections, for programs that make their own triangles, such as shaders: a cross-section is a point
//! and two vectors.
//!
//! These are the tubes of the OBJ format: lengths that continue one another share the cross-section in which they meet.

use super::Fit;
use super::tube::{Collar, Section, Spoke, TubeStyle, Tubes, circle, curve, sides_for};
use dlsys_geometry::scene::{Point, Scene, Vector};

/// A cross-section of a stem: the corner at (x, y) of its outline, in parts of the radius, is at
/// `centre + x u + y v`. Vectors are in scene units, counter-clockwise seen from further along; both are 0 at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossSection {
    /// The middle.
    pub centre: Point,
    /// From the middle to the outline's (1, 0).
    pub u: Vector,
    /// From the middle to the outline's (0, 1).
    pub v: Vector,
}

impl CrossSection {
    /// At a right angle to the stem.
    pub(super) fn across(centre: Point, section: &Section, radius: f64) -> CrossSection {
        CrossSection { centre, u: section.u * radius, v: section.v * radius }
    }

    /// In the plane that halves the bend between two sections.
    pub(super) fn between(centre: Point, before: &Section, after: &Section, radius: f64) -> CrossSection {
        let plane = before.along + after.along;
        let lean = before.along.dot(&plane);
        // Along the side of the stem up to the plane.
        let [u, v] = [before.u, before.v].map(|w| (w - before.along * (w.dot(&plane) / lean)) * radius);
        CrossSection { centre, u, v }
    }

    /// As wide as a collar makes it, as far as an ellipse can be: exact at (1, 0), (0, 1) and opposite to them, but for
    /// what they differ in.
    pub(super) fn widened(self, collar: Option<&Collar>, along: Vector, drape: f64) -> CrossSection {
        let Some(collar) = collar else { return self };
        let moved = |side: Vector| match side.try_normalize(0.0) {
            Some(normal) => {
                let droop = collar.droop(self.centre, along, normal, drape);
                collar.place(self.centre + side + along * droop, normal).coords
            }
            None => self.centre.coords,
        };
        let [east, west, north, south] = [self.u, -self.u, self.v, -self.v].map(moved);
        let centre = Point::from((east + west + north + south) / 4.0);
        CrossSection { centre, u: (east - west) / 2.0, v: (north - south) / 2.0 }
    }
}

/// The part of a stem between two cross-sections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length {
    /// Index among the scene's segments of the one that it looks like.
    pub segment: usize,
    /// That of the one that it belongs to: at a fork a stem begins within the one that it leaves.
    pub of: usize,
    /// At the start and at the end.
    pub ends: [CrossSection; 2],
    /// Whether a dome closes the start and the end.
    pub caps: [bool; 2],
}

/// All stems of a scene, by segment within a stem. Where an axis ends in branches, each of these has as many lengths in all frames, however wide and long it is.
pub fn lengths(scene: &Scene, fit: &Fit) -> Vec<Length> {
    // Sides do not matter, as no corners are made. Joints have the same number of lengths in all frames.
    let tubes = Tubes::new(scene, TubeStyle { sides: 3, steady: true, ..fit.tubes() });
    (0..tubes.len()).flat_map(|i| tubes.lengths(i).collect::<Vec<_>>()).collect()
}

/// How a stem begins that an axis goes on into at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neck {
    /// Its radius there, in scene units: not less than its own.
    pub radius: f64,
    /// For how long it is wider than its own, in scene units; 0 at a segment without a length.
    pub length: f64,
}

/// The necks of the segments of a scene, by number. A segment that an axis may go on into has one whatever its size, so that there is no jump while it grows.
pub fn necks(scene: &Scene, default_width: f64) -> Vec<Option<Neck>> {
    let all = super::tube::necks(scene, default_width).into_iter();
    all.map(|neck| neck.map(|[radius, length]| Neck { radius, length })).collect()
}

/// The outline of cross-sections of a contour of the model (`None`: a circle), with as many corners as a stem of this
/// radius needs to be no further than `accuracy` from a round one; both in scene units.
pub fn cross_section(contour: Option<&[[f64; 2]]>, radius: f64, accuracy: f64) -> Vec<Spoke> {
    let sides = sides_for(radius, accuracy);
    contour.map_or_else(|| circle(sides), |points| curve(points, sides))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Survey, View};
    use dlsys_geometry::scene::{MaterialId, Owner, Segment, Width};
    use dlsys_tree::Lineage;

    #[test]
    fn lengths_meet_where_a_stem_bends_and_steps() {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(0) });
        let mut add = |start: Point, direction: Vector, widths: [f64; 2], follows| {
            let end = start + direction;
            let (widths, material) = (widths.map(Width::Set), MaterialId::STEM);
            let across = Vector::z();
            scene.segments.push(Segment {
                start,
                end,
                direction,
                across,
                widths,
                contour: None,
                material,
                owner,
                follows,
                grows_from: None,
            });
            end
        };
        let bend = add(Point::origin(), Vector::y(), [0.2, 0.2], None);
        let step = add(bend, Vector::new(0.6, 0.8, 0.0), [0.2, 0.2], Some(0));
        add(step, Vector::new(0.6, 0.8, 0.0), [0.1, 0.0], Some(1));
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let all = lengths(&scene, &survey.fit());
        let [low, high, shoulder, tip] = &all[..] else { panic!("{all:?}") };
        assert_eq!(low.ends[1], high.ends[0]);
        assert_eq!(
            [low.caps, high.caps, shoulder.caps, tip.caps],
            [[true, false], [false; 2], [false; 2], [false; 2]]
        );
        assert_eq!((shoulder.ends[0], shoulder.ends[1]), (high.ends[1], tip.ends[0]));
        assert_eq!((tip.ends[1].u, tip.ends[1].v), (Vector::zeros(), Vector::zeros()));
        // The plane of the joint is equally inclined to both directions.
        let normal = low.ends[1].u.cross(&low.ends[1].v).normalize();
        assert!((normal.y - normal.dot(&Vector::new(0.6, 0.8, 0.0))).abs() < 1e-12);
        // Outwards from a circle of the right radius.
        assert!(
            (low.ends[0].u.norm() - 0.1).abs() < 1e-12 && (shoulder.ends[1].v.norm() - 0.05).abs() < 1e-12
        );
    }

    /// A stem and two shoots at its end, of which one has this width and this length.
    fn fork(width: f64, length: f64) -> Scene {
        let mut scene = Scene::default();
        let side = Vector::new(0.5, 0.8, 0.1).normalize();
        let all = [(Vector::y() * 3.0, 1.0), (Vector::new(-1.0, 2.0, 0.4), 0.8), (side * length, width)];
        for (i, (way, width)) in all.into_iter().enumerate() {
            let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(i) });
            let start = if i > 0 { scene.segments[0].end } else { Point::origin() };
            scene.segments.push(Segment {
                start,
                end: start + way,
                direction: if i == 2 { side } else { way.normalize() },
                across: Vector::z(),
                widths: [Width::Set(width); 2],
                contour: None,
                material: MaterialId::STEM,
                owner,
                follows: None,
                grows_from: (i > 0).then_some(0),
            });
        }
        scene
    }

    /// Whatever the size of a shoot, a fork has as many lengths, which change little by little.
    #[test]
    fn a_fork_has_as_many_lengths_in_all_frames() {
        let mut survey = Survey::new(View::FRONT);
        survey.add(&fork(0.7, 3.0));
        let fit = survey.fit();
        let at = |part: f64, way: fn(f64) -> (f64, f64)| {
            let (width, length) = way(part);
            lengths(&fork(width, length), &fit)
        };
        let ways: [fn(f64) -> (f64, f64); 3] = [
            |part| (0.7 * part, 3.0),
            |part| (0.7, 0.01 + 3.0 * part),
            |part| (0.8 * part, 0.01 + 3.0 * part),
        ];
        for way in ways {
            let counts =
                |lengths: &[Length]| [0, 1, 2].map(|of| lengths.iter().filter(|l| l.of == of).count());
            let last = at(1.0, way);
            for k in 0..=100 {
                let now = at(f64::from(k) / 100.0, way);
                assert_eq!(counts(&now), counts(&last), "{k}");
                let numbers =
                    now.iter().flat_map(|l| l.ends).flat_map(|end| [end.centre.coords, end.u, end.v]);
                assert!(numbers.flat_map(|v| [v.x, v.y, v.z]).all(f64::is_finite), "{k}");
            }
        }
    }
}
