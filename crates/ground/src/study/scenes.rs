//! Scenes of the papers, for measurements of speed: a runner's prints, a blade among 90 × 90 posts, a torus in a sandbox.

use std::sync::Arc;
use std::time::Instant;

use super::presses::sphere;
use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

/// A body that moves with a function of the time in s.
struct Moved {
    points: Arc<[Vector]>,
    triangles: Arc<[[u32; 3]]>,
    id: u64,
}

impl Moved {
    fn at(&self, from: Vector, to: Vector) -> Body {
        let place = |way: Vector| self.points.iter().map(|point| point + way).collect();
        Body {
            id: self.id,
            name: "a body".to_owned(),
            triangles: self.triangles.clone(),
            from: place(from),
            to: place(to),
            shelf: false,
        }
    }
}

fn sandpit(cell: f64, extent: Extent) -> Result<Ground, Error> {
    let (bed, depth) = (Relief::Level(-0.3), Relief::Level(0.3));
    Ground::new(Description { cell, extent, soil: Soil::sand(), bed, depth }, Settings::default())
}

/// Seconds of computing for 3 s of a runner, with nine prints of a shoe of 28 cm × 10 cm in sand, on 4096 × 512 columns of 1 cm.
///
/// # Errors
///
/// None; the ground is valid.
pub fn runner() -> Result<f64, Error> {
    let mut ground = sandpit(0.01, Extent { x: [-2048, 2047], z: [-256, 255] })?;
    let (points, triangles) = sphere(Vector::zeros(), 1.0, 24);
    let points = points.iter().map(|point| point.component_mul(&Vector::new(0.14, 0.05, 0.05))).collect();
    let shoe = Moved { points, triangles, id: 1 };
    let place = |time: f64| {
        // A third of a second for a step, half of it on the ground, 3 cm deep.
        let step = (3.0 * time).floor();
        let part = 3.0 * time - step;
        let side = if step % 2.0 == 0.0 { 0.1 } else { -0.1 };
        let height = 0.02 + 0.5 * (2.0 * (part - 0.4).abs() - 0.5).max(0.0).powi(2);
        Vector::new(step + 0.1 * (part - 0.4).max(0.0), height, side)
    };
    let begun = Instant::now();
    for tick in 0..360 {
        let (from, to) = (f64::from(tick) / 120.0, f64::from(tick + 1) / 120.0);
        // Each print is another foot.
        let foot = Moved { id: (3 * tick / 120) as u64, ..shoe.copy() };
        ground.advance(&[], &[foot.at(place(from), place(to.min((3.0 * from).floor() / 3.0 + 0.333)))])?;
    }
    Ok(begun.elapsed().as_secs_f64())
}

/// Milliseconds of computing for a tick of 1/120 s in which some shoes are pressed into sand at once and lifted again, on 4096 × 512 columns of 1 cm, and
/// the number of columns in memory, in thousands.
///
/// # Errors
///
/// None; the ground is valid.
pub fn footprints(count: u32) -> Result<[f64; 2], Error> {
    let mut ground = sandpit(0.01, Extent { x: [-2048, 2047], z: [-256, 255] })?;
    let (points, triangles) = sphere(Vector::zeros(), 1.0, 24);
    let points = points.iter().map(|point| point.component_mul(&Vector::new(0.14, 0.05, 0.05))).collect();
    let shoe = Moved { points, triangles, id: 0 };
    let at = |n: u32, tick: u32| {
        // Rows of five, 1.5 m apart; 3 cm deep after 1/6 s, above the ground after another.
        let part = f64::from(tick) / 20.0 - 1.0;
        let (x, z) = (f64::from(n / 5) * 1.5 - 19.0, f64::from(n % 5) - 2.0);
        Vector::new(x, 0.02 + 0.1 * part.abs(), z)
    };
    let begun = Instant::now();
    let ticks = 60;
    for tick in 0..ticks {
        let shoes: Vec<_> = (0..count)
            .map(|n| Moved { id: u64::from(n), ..shoe.copy() }.at(at(n, tick), at(n, tick + 1)))
            .collect();
        ground.advance(&[], &shoes)?;
    }
    let time = begun.elapsed().as_secs_f64() * 1e3 / f64::from(ticks);
    Ok([time, ground.stored() as f64 / 1e3])
}

impl Moved {
    fn copy(&self) -> Moved {
        Moved { points: self.points.clone(), triangles: self.triangles.clone(), id: self.id }
    }
}

/// Ticks in a second of a blade of 1 m that is pushed through 90 × 90 posts, 5 cm apart.
///
/// # Errors
///
/// None; the ground is valid.
pub fn posts() -> Result<f64, Error> {
    let mut ground = sandpit(0.05, Extent { x: [0, 89], z: [0, 89] })?;
    let (points, triangles) = sphere(Vector::zeros(), 1.0, 16);
    let points = points.iter().map(|point| point.component_mul(&Vector::new(0.06, 0.3, 0.5))).collect();
    let blade = Moved { points, triangles, id: 1 };
    pace(&mut ground, &blade, 360, |time| Vector::new(0.8 + 0.8 * time, 0.22, 2.25))
}

/// Ticks in a second of a torus of 4,000 triangles that is dragged through 256 × 256 columns.
///
/// # Errors
///
/// None; the ground is valid.
pub fn sandbox() -> Result<f64, Error> {
    let mut ground = sandpit(0.01, Extent { x: [0, 255], z: [0, 255] })?;
    let (points, triangles) = torus(0.12, 0.04, [80, 25]);
    let torus = Moved { points, triangles, id: 1 };
    pace(&mut ground, &torus, 240, |time| Vector::new(0.4 + 0.5 * time, 0.01, 1.28))
}

/// A torus around the y axis: its two radii, and numbers of segments.
pub fn torus(large: f64, small: f64, [around, across]: [u32; 2]) -> (Arc<[Vector]>, Arc<[[u32; 3]]>) {
    let angle = |n: u32, of: u32| std::f64::consts::TAU * f64::from(n) / f64::from(of);
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for n in 0..around {
        for m in 0..across {
            let (turn, roll) = (angle(n, around), angle(m, across));
            let radius = large + small * libm::cos(roll);
            points.push(Vector::new(
                radius * libm::cos(turn),
                small * libm::sin(roll),
                radius * libm::sin(turn),
            ));
            let at = |n: u32, m: u32| (n % around) * across + m % across;
            let [a, b, c, d] = [at(n, m), at(n + 1, m), at(n + 1, m + 1), at(n, m + 1)];
            triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    (points.into(), triangles.into())
}

/// Ticks in a second.
fn pace(ground: &mut Ground, body: &Moved, ticks: u32, place: impl Fn(f64) -> Vector) -> Result<f64, Error> {
    let begun = Instant::now();
    for tick in 0..ticks {
        let (from, to) = (f64::from(tick) / 120.0, f64::from(tick + 1) / 120.0);
        ground.advance(&[], &[body.at(place(from), place(to))])?;
    }
    Ok(f64::from(ticks) / begun.elapsed().as_secs_f64())
}
