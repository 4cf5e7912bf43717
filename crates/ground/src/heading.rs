//! How the surface of a body moves where it meets material, which decides whether it sinks in or pushes.

use std::sync::Arc;

use crate::Body;
use crate::cover::Foot;
use crate::spans::Place;

/// A motion along x, y and z: x and z in parts of the lattice, y in 2^16 quanta, so that all have one unit.
pub(crate) type Motion = [i128; 3];

/// The motions of the triangles of a body from one place to the next.
pub(crate) struct Motions {
    triangles: Arc<[[u32; 3]]>,
    ends: Option<[Arc<[Place]>; 2]>,
}

impl Motions {
    /// A body that was not there before, or had another shape, has come from above.
    pub fn new(body: &Body, before: Option<&Foot>, after: &Foot) -> Motions {
        let before = before.filter(|before| before.places.len() == after.places.len());
        let ends = before.map(|before| [before, after].map(|foot| Arc::clone(&foot.places)));
        Motions { triangles: Arc::clone(&body.triangles), ends }
    }

    /// Three times the motion of the middle of a triangle.
    pub fn of(&self, triangle: u32) -> Motion {
        let corners = self.triangles.get(triangle as usize);
        let Some((corners, [from, to])) = corners.zip(self.ends.as_ref()) else { return [0; 3] };
        let mut motion = [0; 3];
        for corner in corners {
            let (from, to) = (from[*corner as usize], to[*corner as usize]);
            motion[0] += i128::from(to.x - from.x);
            motion[1] += i128::from(to.y - from.y) >> 16;
            motion[2] += i128::from(to.z - from.z);
        }
        motion
    }
}

/// Motions, by the volumes that they displace.
#[derive(Default)]
pub(crate) struct Total {
    sum: Motion,
    volume: i128,
}

impl Total {
    pub fn add(&mut self, motion: Motion, volume: i64) {
        let volume = i128::from(volume);
        self.sum = [0, 1, 2].map(|n| self.sum[n] + motion[n] * volume);
        self.volume += volume;
    }

    pub fn mean(&self) -> Motion {
        self.sum.map(|sum| sum / self.volume.max(1))
    }
}

/// A direction in plan, and whether a body sinks at least as much as it moves along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heading {
    pub x: i128,
    pub z: i128,
    pub sinks: bool,
}

impl Heading {
    pub fn of([x, y, z]: Motion) -> Heading {
        let level = (x as f64).hypot(z as f64);
        Heading { x, z, sinks: level <= -(y as f64) || (x == 0 && z == 0) }
    }
}
