//! What no blob passes into: bodies and the ground.

use crate::Vector;

/// Bodies and ground during a tick. All functions must be pure. The wind flows around bodies; walls are for what the wind does not do: blobs that
/// sink, and rounding.
///
/// After each step, the centre of a blob is put back to the nearest place outside. So a blob that sinks onto a body slides over it: what is left of
/// its speed is the part along the surface.
pub trait Walls: Sync {
    /// The least level m of the steps of a blob at a place: they are at most the length of the tick over 2^m, so that bodies do not jump over it.
    fn level(&self, place: Vector) -> u8;

    /// The place itself, or the nearest one outside, at a time in s.
    fn outside(&self, place: Vector, time: f64) -> Vector;
}

/// No walls.
#[derive(Clone, Copy, Debug)]
pub struct Open;

impl Walls for Open {
    fn level(&self, _: Vector) -> u8 {
        0
    }

    fn outside(&self, place: Vector, _: f64) -> Vector {
        place
    }
}
