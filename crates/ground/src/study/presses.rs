//! Bodies pressed into the ground.

use std::sync::Arc;

use dlsys_wind::study::Convergence;

use super::integral;
use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

/// A closed sphere of triangles: points and triangles.
pub fn sphere(centre: Vector, radius: f64, segments: u32) -> (Arc<[Vector]>, Arc<[[u32; 3]]>) {
    let rings = segments / 2;
    let mut points = vec![centre + Vector::y() * radius];
    for ring in 1..rings {
        let down = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for n in 0..segments {
            let turn = std::f64::consts::TAU * f64::from(n) / f64::from(segments);
            let level = libm::sin(down);
            let towards = Vector::new(level * libm::cos(turn), libm::cos(down), level * libm::sin(turn));
            points.push(centre + towards * radius);
        }
    }
    points.push(centre - Vector::y() * radius);
    let last = points.len() as u32 - 1;
    let at = |ring: u32, n: u32| match ring {
        0 => 0,
        ring if ring == rings => last,
        ring => 1 + (ring - 1) * segments + n % segments,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for n in 0..segments {
            let [a, b, c, d] = [at(ring, n), at(ring, n + 1), at(ring + 1, n + 1), at(ring + 1, n)];
            if a != b {
                triangles.push([a, b, c]);
            }
            if c != d {
                triangles.push([a, c, d]);
            }
        }
    }
    (points.into(), triangles.into())
}

/// A sphere as a body that stands still.
pub fn ball(centre: Vector, radius: f64, segments: u32) -> Body {
    let (points, triangles) = sphere(centre, radius, segments);
    Body::still(0, "a ball", triangles, points)
}

/// A sphere of radius 0.5 m, 0.3 m deep in level ground that stands: volume that it heaps up around, α πδ²(3R - δ)/3.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn sphere_rim() -> Result<Vec<Convergence>, Error> {
    let (radius, deep) = (0.5, 0.3);
    let soil = Soil { push: 0.3, ..Soil::snow() };
    let exact = soil.push * std::f64::consts::PI * deep * deep * (3.0 * radius - deep) / 3.0;
    let mut found = Vec::new();
    for n in [4, 8, 16] {
        let description = Description {
            cell: radius / f64::from(n),
            extent: Extent::around(2 * n),
            soil,
            bed: Relief::Level(-1.0),
            depth: Relief::Level(1.0),
        };
        let mut ground = Ground::new(description, Settings::default())?;
        ground.advance(&[], &[ball(Vector::new(0.0, radius - deep, 0.0), radius, 16 * n as u32)])?;
        found.push((f64::from(n), integral(&ground, |_, _, height| height.max(0.0))));
    }
    Ok(Convergence::rows("pressed sphere: volume of its rim (m³)", exact, &found))
}
