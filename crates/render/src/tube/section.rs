//! Cross-sections of tubes: their corners, their number, and the directions in which they lie.

use dlsys_geometry::scene::{Vector, sin_cos_degrees};

/// Sides of a prism whose faces are no further from its cylinder than that. Few numbers are used, so that a
/// stem that grows does not change all the time.
pub(crate) fn sides_for(radius: f64, accuracy: f64) -> usize {
    // With the last, a face is two parts in a hundred thousand of the radius from its cylinder, which shows only where the picture has a small part of a stem;
    // and a round end has more than a hundred thousand triangles.
    const STEPS: [usize; 13] = [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512];
    let deviation = |sides: usize| radius * (1.0 - sin_cos_degrees(180.0 / sides as f64).1);
    STEPS.into_iter().find(|&sides| deviation(sides) <= accuracy).unwrap_or(STEPS[STEPS.len() - 1])
}

/// A corner of a cross-section, in parts of the radius: its place, and the unit normal of the outline there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spoke {
    /// Its place, the outline's radius being 1.
    pub place: [f64; 2],
    /// The unit normal of the outline, pointing out.
    pub normal: [f64; 2],
}

pub(crate) fn circle(sides: usize) -> Vec<Spoke> {
    (0..sides)
        .map(|k| {
            let (sin, cos) = sin_cos_degrees(360.0 * k as f64 / sides as f64);
            Spoke { place: [cos, sin], normal: [cos, sin] }
        })
        .collect()
}

/// A smooth closed curve through points (Catmull and Rom 1974), with at least so many sides.
pub(crate) fn curve(points: &[[f64; 2]], sides: usize) -> Vec<Spoke> {
    let count = points.len();
    let pieces = (2 * sides).div_ceil(count).max(2);
    let mut spokes = Vec::with_capacity(count * pieces);
    for i in 0..count {
        let [a, b, c, d] = [count - 1, 0, 1, 2].map(|k| points[(i + k) % count]);
        for k in 0..pieces {
            let t = k as f64 / pieces as f64;
            let weigh = |w: [f64; 4]| [0, 1].map(|x| w[0] * a[x] + w[1] * b[x] + w[2] * c[x] + w[3] * d[x]);
            let place = weigh([
                t * (t * (1.0 - 0.5 * t) - 0.5),
                t * t * (1.5 * t - 2.5) + 1.0,
                t * (t * (2.0 - 1.5 * t) + 0.5),
                t * t * 0.5 * (t - 1.0),
            ]);
            let [x, y] = weigh([
                t * (2.0 - 1.5 * t) - 0.5,
                t * (4.5 * t - 5.0),
                t * (4.0 - 4.5 * t) + 0.5,
                t * (1.5 * t - 1.0),
            ]);
            let length = x.hypot(y);
            // Where the curve has no direction, away from the middle.
            let (x, y) = if length > 1e-9 { (y, -x) } else { (place[0], place[1]) };
            let length = x.hypot(y).max(1e-300);
            spokes.push(Spoke { place, normal: [x / length, y / length] });
        }
    }
    spokes
}

/// A cross-section.
pub(super) struct Profile {
    pub(super) spokes: Vec<Spoke>,
    /// Sine and cosine of the latitudes of a dome's rings, from the base without it to the pole without it: as many
    /// as make the dome as round as the tube.
    pub(super) latitudes: Vec<(f64, f64)>,
}

impl Profile {
    pub(super) fn new(spokes: Vec<Spoke>) -> Profile {
        let steps = (spokes.len() / 8).max(1) + 1;
        let latitude = |step| sin_cos_degrees(90.0 * step as f64 / steps as f64);
        Profile { latitudes: (1..steps).map(latitude).collect(), spokes }
    }

    /// Vertices and normals of a dome; one without width is a point.
    pub(super) fn dome(&self, radius: f64) -> [u32; 2] {
        let sides = self.spokes.len() as u32;
        let all = sides * (self.latitudes.len() as u32 + 1) + 1;
        if radius > 0.0 { [all; 2] } else { [1, sides] }
    }
}

/// Directions along and across a tube at one place: `along`, `u`, `v` are orthonormal and right-handed.
#[derive(Clone, Copy)]
pub(crate) struct Section {
    pub(crate) along: Vector,
    pub(crate) u: Vector,
    pub(crate) v: Vector,
    /// Growth of the radius along the segment.
    pub(super) slope: f64,
}

impl Section {
    /// With a cross-section counted from `u`, as far as that is across.
    pub(super) fn new(along: Vector, u: Vector, slope: f64) -> Section {
        let across = (u - along * along.dot(&u)).try_normalize(1e-6).unwrap_or_else(|| {
            let mut aside = Vector::zeros();
            aside[along.iamin()] = 1.0;
            along.cross(&aside).normalize()
        });
        Section { along, u: across, v: along.cross(&across), slope }
    }

    /// Turned by the least rotation that brings `along` to `to`.
    pub(super) fn carried(&self, to: Vector, slope: f64) -> Section {
        let half = self.along + to;
        // Two reflections, in the plane across `along` and in the one across `half`.
        let u = self.u - half * (2.0 * half.dot(&self.u) / half.norm_squared());
        Section::new(to, u, slope)
    }

    /// Away from the axis, as far as the cross-section reaches with radius 1.
    pub(super) fn outward(&self, at: &Spoke) -> Vector {
        self.u * at.place[0] + self.v * at.place[1]
    }

    /// Normal of the tube's side.
    pub(super) fn normal(&self, at: &Spoke) -> Vector {
        let ([x, y], [a, b]) = (at.normal, at.place);
        let aside = self.u * x + self.v * y;
        // Already of length 1 on a stem that does not taper: spokes and cross-sections are.
        if self.slope == 0.0 {
            return aside;
        }
        (aside - self.along * (self.slope * (x * a + y * b))).normalize()
    }
}
