//! Shelves and vessels that carry as much as they can.

use dlsys_wind::study::Convergence;

use super::{SLOPE, SWEEPS, dry, heap};
use crate::{Body, Error, Extent, Ground, Place, Pour, Relief, Settings, Vector};

/// Half the width of shelves and vessels, in m.
const HALF: f64 = 0.5;
/// Depth of the space around them, in m.
const BELOW: f64 = 3.0;
/// Columns in half the width.
const FINENESS: [i32; 3] = [4, 8, 16];
/// The same for the square: 4 columns are too few for its order.
const FINER: [i32; 3] = [6, 12, 24];

/// What lies on columns for which `on` holds after all that was piled up has slipped off, in m³.
fn carried(
    cell: f64,
    n: i32,
    bed: impl Fn(f64, f64) -> f64 + Send + Sync + 'static,
    on: impl Fn(f64, f64) -> bool + Copy + Send + Sync + 'static,
) -> Result<f64, Error> {
    let pile = move |x: f64, z: f64| if on(x, z) { 1.2 * HALF } else { 0.0 };
    let mut ground = heap(cell, Extent::around(3 * n), dry(SLOPE), Relief::function(bed), pile)?;
    ground.settle(SWEEPS)?;
    Ok(volume(&ground, on))
}

/// Volume of the loose material on columns for which `on` holds, in m³.
fn volume(ground: &Ground, on: impl Fn(f64, f64) -> bool) -> f64 {
    let (cell, Extent { x, z }) = (ground.cell(), ground.extent());
    let mut sum = 0.0;
    for k in z[0]..=z[1] {
        for i in x[0]..=x[1] {
            if on(f64::from(i) * cell, f64::from(k) * cell) {
                sum += ground.loose(i, k);
            }
        }
    }
    sum * cell * cell
}

/// What a level shelf with a rim carries after all that was poured onto it has slipped off, in m³. Its points are the middle, then its rim, counterclockwise.
fn laden(n: i32, rim: &[[f64; 2]]) -> Result<f64, Error> {
    let cell = HALF / f64::from(n);
    let mut ground = heap(cell, Extent::around(3 * n), dry(SLOPE), Relief::Level(-BELOW), |_, _| 0.0)?;
    let points: Vec<_> =
        std::iter::once(&[0.0; 2]).chain(rim).map(|[x, z]| Vector::new(*x, 0.0, *z)).collect();
    let count = rim.len() as u32;
    let triangles: Vec<_> = (0..count).map(|n| [0, 1 + (n + 1) % count, 1 + n]).collect();
    let shelf = Body { shelf: true, ..Body::still(1, "a shelf", triangles.into(), points.into()) };
    let volume = 0.5 * SLOPE * (2.0 * HALF).powi(3);
    let tick = Settings::default().tick;
    let pour = Pour { id: 1, place: Place::Disc { centre: [0.0; 2], radius: HALF }, rate: volume / tick };
    ground.advance(&[pour], std::slice::from_ref(&shelf))?;
    ground.settle(SWEEPS)?;
    Ok(ground.carried())
}

/// A full disc of radius 0.5 m, a shelf: volume.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn disc() -> Result<Vec<Convergence>, Error> {
    let corner = |n: u32| f64::from(n) / 256.0 * std::f64::consts::TAU;
    let rim: Vec<_> = (0..256).map(|n| [HALF * libm::cos(corner(n)), -HALF * libm::sin(corner(n))]).collect();
    let mut found = Vec::new();
    for n in FINENESS {
        found.push((f64::from(n), laden(n, &rim)?));
    }
    let exact = std::f64::consts::PI * SLOPE * HALF * HALF * HALF / 3.0;
    Ok(Convergence::rows("full shelf, a disc: volume (m³)", exact, &found))
}

/// A full square, a shelf, scaled to sides of 1 m: volume.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn square() -> Result<Vec<Convergence>, Error> {
    let rim = [[HALF, HALF], [HALF, -HALF], [-HALF, -HALF], [-HALF, HALF]];
    let mut found = Vec::new();
    for n in FINER {
        // Edges halfway between columns; the volume goes with the cube of the width.
        let shrink = (f64::from(n) + 0.5) / f64::from(n);
        let rim = rim.map(|corner| corner.map(|at| at * shrink));
        found.push((f64::from(n), laden(n, &rim)? / shrink.powi(3)));
    }
    let exact = SLOPE * (2.0 * HALF).powi(3) / 6.0;
    Ok(Convergence::rows("full shelf, a square: volume (m³)", exact, &found))
}

/// A full box of 1 m × 1 m × 0.25 m: volume.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn bucket() -> Result<Vec<Convergence>, Error> {
    let depth = 0.25;
    let mut found = Vec::new();
    for n in FINENESS {
        // The walls stand between columns, and are a column thick.
        let cell = HALF / (f64::from(n) + 0.5);
        let (half, wall) = (HALF, HALF + cell);
        let on = move |x: f64, z: f64| x.abs().max(z.abs()) <= half;
        let bed = move |x: f64, z: f64| match x.abs().max(z.abs()) {
            r if r <= half => 0.0,
            r if r <= wall => depth,
            _ => -BELOW,
        };
        found.push((f64::from(n), carried(cell, n, bed, on)?));
    }
    let width = 2.0 * HALF;
    let exact = width * width * depth + SLOPE * width.powi(3) / 6.0;
    Ok(Convergence::rows("full box: volume (m³)", exact, &found))
}
