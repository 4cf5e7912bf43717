//! Bounds of scenes, before the default width of their lines is known.

use super::{Point, Reach, Scene, Width};

/// An upright box; empty if `low > high`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    low: Point,
    high: Point,
}

impl Block {
    const EMPTY: Block = Block {
        low: Point::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }

    /// Includes a ball.
    fn include(&mut self, p: Point, radius: f64) {
        for i in 0..3 {
            self.low[i] = self.low[i].min(p[i] - radius);
            self.high[i] = self.high[i].max(p[i] + radius);
        }
    }

    fn merge(&mut self, other: &Block) {
        for i in 0..3 {
            self.low[i] = self.low[i].min(other.low[i]);
            self.high[i] = self.high[i].max(other.high[i]);
        }
    }
}

/// The bounds of one or more scenes: everything drawn, with the widths of lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// Points only, without widths: the default width is relative to their extent.
    points: Block,
    /// Everything whose width is known.
    known: Block,
    /// Points of lines of default width, and the widest of these.
    styled: Block,
    factor: f64,
}

impl Default for Bounds {
    fn default() -> Bounds {
        Bounds { points: Block::EMPTY, known: Block::EMPTY, styled: Block::EMPTY, factor: 0.0 }
    }
}

impl Bounds {
    /// The default width of a line, in parts of the largest extent of the whole animation.
    pub const DEFAULT_WIDTH: f64 = 0.008;

    /// The bounds of one scene.
    pub fn of(scene: &Scene) -> Bounds {
        let mut bounds = Bounds::default();
        bounds.add(scene);
        bounds
    }

    /// Includes a scene.
    pub fn add(&mut self, scene: &Scene) {
        scene.reach(self);
    }

    /// Includes other bounds in the same coordinates.
    pub fn merge(&mut self, other: &Bounds) {
        self.points.merge(&other.points);
        self.known.merge(&other.known);
        self.styled.merge(&other.styled);
        self.factor = self.factor.max(other.factor);
    }

    /// True if nothing was included.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The largest of the [sides](Bounds::sides).
    pub fn extent(&self) -> f64 {
        self.sides()[0]
    }

    /// Sides of the box around all points, widths not counted, the largest first; 0 if there is nothing.
    pub fn sides(&self) -> [f64; 3] {
        if self.is_empty() {
            return [0.0; 3];
        }
        let mut sides: [f64; 3] = (self.points.high - self.points.low).into();
        sides.sort_by(|a, b| b.total_cmp(a));
        sides
    }

    /// The default width that goes with these bounds, in scene units: a fixed part of their extent. Where
    /// there is no extent, as of a single flat dot, 1 stands in for it.
    pub fn default_width(&self) -> f64 {
        let extent = self.extent();
        Bounds::DEFAULT_WIDTH * if extent > 0.0 { extent } else { 1.0 }
    }

    /// Opposite corners of the box around everything, lines having their width; `None` if there is nothing.
    pub fn corners(&self, default_width: f64) -> Option<[Point; 2]> {
        if self.is_empty() {
            return None;
        }
        let mut all = self.known;
        if !self.styled.is_empty() {
            let radius = self.factor * default_width / 2.0;
            all.include(self.styled.low, radius);
            all.include(self.styled.high, radius);
        }
        Some([all.low, all.high])
    }
}

impl Reach for Bounds {
    fn covers(&self, rough: impl Iterator<Item = Point>) -> bool {
        let [points, known] = [&self.points, &self.known];
        let mut rough = rough;
        rough.all(|p| {
            (0..3).all(|i| {
                let within = |block: &Block| block.low[i] < p[i] && p[i] < block.high[i];
                within(points) && within(known)
            })
        })
    }

    fn include(&mut self, point: Point, width: Width) {
        self.points.include(point, 0.0);
        match width {
            Width::Set(width) => self.known.include(point, width / 2.0),
            Width::Default(factor) => {
                self.styled.include(point, 0.0);
                self.factor = self.factor.max(factor);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{MaterialId, Owner, Segment, Vector};
    use dlsys_tree::Lineage;

    fn line(scene: &mut Scene, end: Point, width: Width) {
        let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(0) });
        scene.segments.push(Segment {
            start: Point::origin(),
            end,
            direction: end.coords.normalize(),
            across: Vector::x(),
            widths: [width; 2],
            contour: None,
            material: MaterialId::STEM,
            owner,
            follows: None,
            grows_from: None,
        });
    }

    #[test]
    fn nothing_has_no_corners() {
        let bounds = Bounds::of(&Scene::default());
        assert_eq!(bounds.corners(bounds.default_width()), None);
        assert_eq!(bounds.extent(), 0.0);
        assert_eq!(bounds.default_width(), 0.008);
    }

    #[test]
    fn default_widths_follow_the_whole_animation() {
        let (mut small, mut large) = (Scene::default(), Scene::default());
        line(&mut small, Point::new(0.0, 1.0, 0.0), Width::Default(1.0));
        line(&mut large, Point::new(0.0, 100.0, 0.0), Width::Set(4.0));
        let mut all = Bounds::of(&small);
        all.merge(&Bounds::of(&large));
        assert_eq!(all.default_width(), 0.8);
        let [low, high] = all.corners(all.default_width()).expect("not empty");
        assert_eq!((low.x, low.y, high.y), (-2.0, -2.0, 102.0));
        let [low, high] = Bounds::of(&small).corners(all.default_width()).expect("not empty");
        assert_eq!((low.x, high.y), (-0.4, 1.4));
    }
}
