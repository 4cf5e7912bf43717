//! The width of lines to which a model gives none.
//!
//! Usually it is a fixed part of the extent of the animation. Where lines are crowded, that would be a blob: figure 1.24 of *The
//! Algorithmic Beauty of Plants* has 1,500 lines and more. There they are thinner, so that together they cover a twentieth of the box around
//! everything, or a quarter as wide as what a module draws is long, whichever is wider. The
//! frame with most lines decides, so all frames of an animation have the same width, and the order in which they are surveyed does not
//! matter.

use dlsys_geometry::scene::{Bounds, OwnerId, Scene, Width};

/// The part of the two larger sides of the box around everything that crowded lines may cover; a slender box counts as this wide, in parts of its length.
const INK: f64 = 0.05;
const SLENDER: f64 = 0.2;
/// The width of a line, in parts of the mean length of what a module draws, at which crowded lines are still told apart.
const SLIM: f64 = 0.25;
/// The least width, in parts of the extent: a pixel of a picture of a thousand.
const LEAST: f64 = 0.001;

/// Lines of default width in the frame that has most of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Crowd {
    /// Their length, each times its factor of the default width.
    length: f64,
    /// Number of modules that draw them.
    modules: usize,
}

impl Crowd {
    /// The lines of one scene.
    pub(super) fn of(scene: &Scene) -> Crowd {
        let mut crowd = Crowd::default();
        let mut last: Option<OwnerId> = None;
        for segment in &scene.segments {
            if let [Width::Default(a), Width::Default(b)] = segment.widths {
                crowd.length += (segment.end - segment.start).norm() * (a + b) / 2.0;
                crowd.modules += usize::from(last != Some(segment.owner));
                last = Some(segment.owner);
            }
        }
        crowd
    }

    /// Those of the frame that has more.
    pub(super) fn merge(&mut self, other: Crowd) {
        let order = self.length.total_cmp(&other.length).then(self.modules.cmp(&other.modules));
        if order.is_lt() {
            *self = other;
        }
    }

    /// The default width within these bounds, in scene units.
    pub(super) fn default_width(&self, bounds: &Bounds) -> f64 {
        let (usual, [extent, wide, _]) = (bounds.default_width(), bounds.sides());
        if !(self.length > 0.0 && extent > 0.0) {
            return usual;
        }
        let slim = SLIM * self.length / self.modules as f64;
        (INK * extent * wide.max(SLENDER * extent) / self.length).max(slim).max(LEAST * extent).min(usual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_geometry::scene::{MaterialId, Owner, Point, Segment, Vector};
    use dlsys_tree::Lineage;

    /// Lines from (0, y) to (length, y), each of a module.
    fn lines(count: u32, length: f64, width: Width) -> Scene {
        let mut scene = Scene::default();
        for i in 0..count {
            let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(i as usize) });
            let start = Point::new(0.0, f64::from(i) / f64::from(count.max(2) - 1), 0.0);
            scene.segments.push(Segment {
                start,
                end: start + Vector::x() * length,
                direction: Vector::x(),
                across: Vector::y(),
                widths: [width; 2],
                contour: None,
                material: MaterialId::STEM,
                owner,
                follows: None,
                grows_from: None,
            });
        }
        scene
    }

    fn width(scene: &Scene) -> f64 {
        Crowd::of(scene).default_width(&Bounds::of(scene))
    }

    #[test]
    fn crowded_lines_are_thin_and_others_are_not() {
        let usual = Bounds::DEFAULT_WIDTH;
        assert_eq!(width(&lines(1, 1.0, Width::Default(1.0))), usual, "a filament");
        assert_eq!(width(&lines(6, 1.0, Width::Default(1.0))), usual);
        // A quarter of 0.01 is more than what covers a twentieth, and than the least.
        assert!((width(&lines(3000, 0.01, Width::Default(1.0))) - 0.0025).abs() < 1e-12);
        assert!((width(&lines(20, 1.0, Width::Default(1.0))) - usual).abs() < 1e-12, "long ones");
        assert!((width(&lines(60_000, 0.002, Width::Default(1.0))) - 0.001).abs() < 1e-12);
        assert_eq!(
            width(&lines(3000, 0.01, Width::Set(0.1))),
            usual,
            "widths of the model count for nothing"
        );
        assert!(width(&Scene::default()) > 0.0);
    }

    #[test]
    fn the_frame_with_most_lines_decides_in_any_order() {
        let frames = [10, 3000, 200].map(|count| Crowd::of(&lines(count, 0.01, Width::Default(1.0))));
        let merged = |order: [usize; 3]| {
            let mut all = Crowd::default();
            order.into_iter().for_each(|i| all.merge(frames[i]));
            all
        };
        assert_eq!(merged([0, 1, 2]), frames[1]);
        assert_eq!(merged([2, 1, 0]), merged([1, 0, 2]));
    }
}
