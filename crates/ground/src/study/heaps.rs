//! Heaps on a bed: what collapses, and what is poured.

use dlsys_wind::study::Convergence;

use super::{SLOPE, SWEEPS, dry, heap, heap_by, integral, mean};
use crate::{Error, Extent, Ground, Place, Pour, Relief, Rule};

/// Columns in the radius or width that a case is about.
const FINENESS: [i32; 3] = [8, 16, 32];

/// A cylinder of radius 0.5 m and height 0.4 m: difference between the heap that it becomes and the exact one, in parts of the volume.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn cylinder() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in FINENESS {
        found.push((f64::from(n), collapsed(n, Rule::Law)?.1));
    }
    Ok(Convergence::rows("collapsing cylinder: difference from the exact heap (volumes)", 0.0, &found))
}

/// What becomes of the cylinder of [`cylinder`], with some columns in its radius, and the difference from the exact heap.
pub(super) fn collapsed(n: i32, rule: Rule) -> Result<(Ground, f64), Error> {
    let (radius, height, k) = (0.5_f64, 0.4_f64, SLOPE);
    let plateau = -height / (2.0 * k) + (radius * radius - height * height / (12.0 * k * k)).sqrt();
    let exact = move |r: f64| height.min(height - k * (r - plateau)).max(0.0);
    let cell = radius / f64::from(n);
    let inside = move |x: f64, z: f64| if x.hypot(z) <= radius { height } else { 0.0 };
    let extent = Extent::around(9 * n / 5);
    let mut ground = heap_by(rule, cell, extent, dry(k), Relief::Level(0.0), mean(cell, inside))?;
    ground.settle(SWEEPS)?;
    let volume = std::f64::consts::PI * radius * radius * height;
    let error = integral(&ground, |x, z, h| (h - exact(x.hypot(z))).abs()) / volume;
    Ok((ground, error))
}

/// A row of columns along x.
fn row(n: i32) -> Extent {
    Extent { x: [-n, n], z: [0, 0] }
}

/// A dam that breaks: height 0.5 m on one side of x = 0. Difference from the exact ramp, in parts of what lies on the other side
/// in the end. It is that of the slope at which material comes to rest, a thousandth, with columns of any size.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn dam() -> Result<Vec<Convergence>, Error> {
    let (height, k) = (0.5, SLOPE);
    let mut found = Vec::new();
    for n in FINENESS {
        let cell = height / f64::from(n);
        let behind = move |x: f64, _: f64| if x < 0.0 { height } else { 0.0 };
        let mut ground = heap(cell, row(2 * n), dry(k), Relief::Level(0.0), mean(cell, behind))?;
        ground.settle(SWEEPS)?;
        let exact = |x: f64| (height / 2.0 - k * x).clamp(0.0, height);
        let error = integral(&ground, |x, _, h| (h - exact(x)).abs()) / (cell * height * height / (8.0 * k));
        found.push((f64::from(n), error));
    }
    Ok(Convergence::rows("dam: difference from the ramp (volumes beyond)", 0.0, &found))
}

/// A strip of half-width 0.2 m and height 0.5 m that becomes a ridge: its height.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn strip() -> Result<Vec<Convergence>, Error> {
    let (half, height, k) = (0.2_f64, 0.5, SLOPE);
    let exact = (2.0 * half * height * k).sqrt();
    let mut found = Vec::new();
    for n in FINENESS {
        let cell = height / f64::from(n);
        let inside = move |x: f64, _: f64| if x.abs() <= half { height } else { 0.0 };
        let mut ground = heap(cell, row(2 * n), dry(k), Relief::Level(0.0), mean(cell, inside))?;
        ground.settle(SWEEPS)?;
        found.push((f64::from(n), ground.column(0, 0)));
    }
    Ok(Convergence::rows("strip: height of the ridge (m)", exact, &found))
}

/// Radius of the cone that is poured, in m.
const CONE: f64 = 0.5;

/// A cone that is poured onto a level bed in some portions, each of which comes to rest.
pub(super) fn poured(n: i32, portions: u32, rule: Rule) -> Result<Ground, Error> {
    let cell = CONE / f64::from(n);
    let volume = std::f64::consts::PI * SLOPE * CONE * CONE * CONE / 3.0;
    let extent = Extent::around(6 * n / 5);
    let mut ground = heap_by(rule, cell, extent, dry(SLOPE), Relief::Level(0.0), |_, _| 0.0)?;
    let place = Place::Disc { centre: [0.0; 2], radius: 0.1 * CONE };
    let pour = Pour { id: 0, place, rate: volume / f64::from(portions) };
    for _ in 0..portions {
        ground.pour(&pour, 1.0)?;
        ground.settle(SWEEPS)?;
    }
    Ok(ground)
}

/// Difference of a poured cone from the exact one, in parts of its volume.
pub(super) fn cone_error(ground: &Ground) -> f64 {
    let volume = std::f64::consts::PI * SLOPE * CONE * CONE * CONE / 3.0;
    integral(ground, |x, z, h| (h - (SLOPE * (CONE - x.hypot(z))).max(0.0)).abs()) / volume
}

/// A poured cone: difference from the exact one.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn cone() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in FINENESS {
        found.push((f64::from(n), cone_error(&poured(n, 1, Rule::Law)?)));
    }
    Ok(Convergence::rows("poured cone: difference from the exact one (volumes)", 0.0, &found))
}

/// A cone of 8 columns in its radius, poured in 1, 10 and 40 portions: difference from the exact one, in parts of that of one portion.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn portions() -> Result<Vec<Convergence>, Error> {
    let once = cone_error(&poured(8, 1, Rule::Law)?);
    let mut found = Vec::new();
    for portions in [1, 10, 40] {
        found.push((f64::from(portions), cone_error(&poured(8, portions, Rule::Law)?) / once));
    }
    Ok(Convergence::rows("poured cone by portions: error relative to one portion", 1.0, &found))
}

/// Distance from the axis at which a heap has a height, along a direction, by bisection, in m.
fn contour(ground: &Ground, direction: [f64; 2], height: f64) -> f64 {
    let [mut low, mut high] = [0.0, 2.0 * CONE];
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        let above = ground.height(middle * direction[0], middle * direction[1]) > height;
        (low, high) = if above { (middle, high) } else { (low, middle) };
    }
    low
}

/// Radius of the contour of a cone at a quarter of its height between two axes, relative to that along an axis.
pub(super) fn roundness(ground: &Ground) -> f64 {
    let height = 0.25 * SLOPE * CONE;
    let half = std::f64::consts::FRAC_1_SQRT_2;
    contour(ground, [half, half], height) / contour(ground, [1.0, 0.0], height)
}

/// A poured cone is round: radius of its contour at a quarter of the height between two axes, relative to that along an axis.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn round() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in FINENESS {
        found.push((f64::from(n), roundness(&poured(n, 1, Rule::Law)?)));
    }
    Ok(Convergence::rows("poured cone: its contour turned by 45°", 1.0, &found))
}

/// A cone on a bed with a slope of 0.3, which grows by a quarter: difference from the exact one. It is poured onto one column, in portions as
/// high as that is wide: more at once, or over a wider place, is another heap.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn cone_on_incline() -> Result<Vec<Convergence>, Error> {
    let (k, s, grown) = (SLOPE, 0.3, 1.25);
    let height = |volume: f64| (3.0 * volume * (k * k - s * s).powf(1.5) / (std::f64::consts::PI * k)).cbrt();
    let volume = std::f64::consts::PI * k * CONE * CONE * CONE / 3.0;
    let mut found = Vec::new();
    for n in [4, 8, 12] {
        let cell = CONE / f64::from(n);
        let before = height(volume / grown);
        let first = move |x: f64, z: f64| (before - k * x.hypot(z) - s * x).max(0.0);
        let bed = Relief::function(move |x, _| s * x);
        let mut ground = heap(cell, Extent::around(2 * n), dry(k), bed, mean(cell, first))?;
        let added = volume - volume / grown;
        let portions = (added / cell.powi(3)).ceil();
        let place = Place::Disc { centre: [0.0; 2], radius: 0.0 };
        let pour = Pour { id: 0, place, rate: added / portions };
        for _ in 0..portions as u32 {
            ground.pour(&pour, 1.0)?;
            ground.settle(SWEEPS)?;
        }
        let after = height(volume);
        let exact = |x: f64, z: f64| (after - k * x.hypot(z) - s * x).max(0.0);
        found.push((f64::from(n), integral(&ground, |x, z, h| (h - s * x - exact(x, z)).abs()) / volume));
    }
    Ok(Convergence::rows(
        "cone that grows on an incline: difference from the exact one (volumes)",
        0.0,
        &found,
    ))
}
