//! The frames of all segments under a strain: what is drawn.

use crate::arc::Section;
use crate::{Matrix, Skeleton, Vector};

/// A frame in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Heading, left and up as columns.
    pub axes: Matrix,
    /// Origin, in m.
    pub origin: Vector,
}

/// Shapes and places of all segments at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    bases: Vec<Frame>,
    /// Rotation vector of the whole length, and the length.
    arcs: Vec<(Vector, f64)>,
}

impl Pose {
    /// The pose of a skeleton under strains beyond rest, one a segment. Missing strains count as zero.
    pub fn new(skeleton: &Skeleton, strain: &[Vector]) -> Pose {
        let mut pose = Pose::default();
        pose.set(skeleton, strain);
        pose
    }

    /// The same, in the memory of this pose.
    pub fn set(&mut self, skeleton: &Skeleton, strain: &[Vector]) {
        self.bases.clear();
        self.arcs.clear();
        for (index, segment) in skeleton.segments().iter().enumerate() {
            let before = segment.parent.map_or(WORLD, |parent| self.at(parent, 1.0));
            let joint = &segment.joint;
            self.bases.push(Frame {
                axes: before.axes * joint.rotation,
                origin: before.origin + before.axes * joint.offset,
            });
            let bend = strain.get(index).copied().unwrap_or_else(Vector::zeros);
            self.arcs.push(((segment.rest + bend) * segment.length, segment.length));
        }
    }

    /// The base frame of a segment.
    pub fn base(&self, segment: usize) -> Frame {
        self.bases[segment]
    }

    /// The frame of the section at a fraction of the length, from 0 (base) to 1 (end).
    pub fn at(&self, segment: usize, fraction: f64) -> Frame {
        let base = &self.bases[segment];
        let (theta, length) = &self.arcs[segment];
        let section = Section::new(theta, fraction);
        Frame {
            axes: base.axes * section.rotation(),
            origin: base.origin + base.axes * (section.place() * *length),
        }
    }

    /// The centre of that section, in m.
    pub fn point(&self, segment: usize, fraction: f64) -> Vector {
        self.at(segment, fraction).origin
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.bases.len()
    }

    /// Whether there are no segments.
    pub fn is_empty(&self) -> bool {
        self.bases.is_empty()
    }
}

const WORLD: Frame = Frame {
    axes: Matrix::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    origin: Vector::new(0.0, 0.0, 0.0),
};
