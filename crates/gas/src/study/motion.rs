//! Motion, diffusion and decay of blobs.

use std::f64::consts::TAU;

use dlsys_wind::{Still, Wind, study::Convergence};

use crate::{Cloud, Error, Gas, Settings, Source, Vector};

/// The tolerances of the study, in parts of the standard deviation of a blob.
const TOLERANCES: [f64; 3] = [1e-2, 1e-4, 1e-6];

/// A gas that is carried only.
const CARRIED: Gas = Gas { diffusion: 0.0, decay: 0.0, size: 0.05, mass: 1e-3, fall: 0.0 };

/// A cloud of one blob, carried to the first tick at or after a time.
fn carried(
    gas: Gas,
    settings: Settings,
    place: Vector,
    until: f64,
    wind: &(impl Wind + Sync),
) -> Result<Cloud, Error> {
    let mut cloud = Cloud::new(gas, settings)?;
    cloud.add(place, 1.0)?;
    // Lengths of ticks that are not powers of 2 add up with rounding.
    while cloud.time() < until - 1e-6 * cloud.tick() {
        cloud.advance(&[], wind)?;
    }
    Ok(cloud)
}

/// The mean of the centres, with their masses as weights.
fn centre(cloud: &Cloud) -> Vector {
    cloud.blobs().map(|blob| blob.centre * blob.mass).sum::<Vector>() / cloud.mass()
}

/// A blob that diffuses, is carried by a uniform wind, and splits four times: the variance of all of it along y, σ² + 2κt, by the length of ticks.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn spreading() -> Result<Vec<Convergence>, Error> {
    let gas = Gas { diffusion: 2e-3, decay: 0.3, size: 0.01, ..CARRIED };
    let wind = |_: Vector, _: f64| Vector::new(0.5, 0.1, -0.2);
    let mut found = Vec::new();
    for tick in [1.0 / 8.0, 1.0 / 32.0, 1.0 / 128.0] {
        let settings = Settings { tick, split: 0.06, ..Settings::default() };
        let cloud = carried(gas, settings, Vector::zeros(), 4.0, &wind)?;
        let mean = centre(&cloud);
        let moment = |blob: crate::Blob| blob.mass * (blob.variance + (blob.centre.y - mean.y).powi(2));
        found.push((tick, cloud.blobs().map(moment).sum::<f64>() / cloud.mass()));
    }
    Ok(Convergence::rows("spreading and splitting: variance (m²)", 1e-4 + 2.0 * 2e-3 * 4.0, &found))
}

/// The mass of all blobs of a source that decays, by the length of ticks: rate · m (1 - e^(-αt))/α, but for the count of whole blobs, which is
/// a sum.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn decay() -> Result<Vec<Convergence>, Error> {
    let gas = Gas { decay: 0.7, ..CARRIED };
    let rate = 50.0;
    let exact = (1..=200).map(|k| 1e-3 * (-0.7 * (4.0 - f64::from(k) / rate)).exp()).sum();
    let mut found = Vec::new();
    for tick in [1.0 / 8.0, 1.0 / 32.0, 1.0 / 128.0] {
        let mut cloud = Cloud::new(gas, Settings { tick, ..Settings::default() })?;
        while cloud.time() < 4.0 {
            cloud.advance(&[Source::at(1, Vector::zeros(), 0.1, rate)], &Still)?;
        }
        found.push((tick, cloud.mass()));
    }
    Ok(Convergence::rows("source with decay: mass after 4 s (kg)", exact, &found))
}

/// A blob that sinks in still air at its speed of fall.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn fall() -> Result<Vec<Convergence>, Error> {
    let gas = Gas { fall: 0.3, ..CARRIED };
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let settings = Settings { tolerance, ..Settings::default() };
        found.push((tolerance, centre(&carried(gas, settings, Vector::zeros(), 10.0, &Still)?).y));
    }
    Ok(Convergence::rows("sinking: height after 10 s (m)", -3.0, &found))
}

/// A uniform wind cos 3t: the way is sin(3t)/3.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn gust() -> Result<Vec<Convergence>, Error> {
    let wind = |_: Vector, time: f64| Vector::new((3.0 * time).cos(), 0.0, 0.0);
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let settings = Settings { tick: 1.0 / 8.0, tolerance, ..Settings::default() };
        found.push((tolerance, centre(&carried(CARRIED, settings, Vector::zeros(), 10.0, &wind)?).x));
    }
    Ok(Convergence::rows("uniform gusts: way after 10 s (m)", 30_f64.sin() / 3.0, &found))
}

/// A straining flow (x, -y, 0) 1/s: x grows as e^t.
fn strained(settings: Settings) -> Result<f64, Error> {
    let wind = |point: Vector, _: f64| Vector::new(point.x, -point.y, 0.0);
    Ok(centre(&carried(CARRIED, settings, Vector::new(0.1, 1.0, 0.0), 4.0, &wind)?).x)
}

/// A straining flow, by tolerance.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn strain() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let settings = Settings { tick: 1.0 / 4.0, tolerance, ..Settings::default() };
        found.push((tolerance, strained(settings)?));
    }
    Ok(Convergence::rows("straining flow: place after 4 s (m)", 0.1 * 4_f64.exp(), &found))
}

/// A straining flow, by the length of ticks.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn strain_ticks() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for tick in [1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0] {
        found.push((tick, strained(Settings { tick, fixed: true, ..Settings::default() })?));
    }
    Ok(Convergence::rows("straining flow, by ticks: place (m)", 0.1 * 4_f64.exp(), &found))
}

/// A blob in a rigid rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turns {
    /// Its distance from the axis, in m; 1 at the beginning.
    pub radius: f64,
    /// The angle in rad by which it is ahead of the rotation.
    pub ahead: f64,
}

impl Turns {
    /// After some turns of one turn in a second.
    ///
    /// # Errors
    ///
    /// An error of the cloud.
    pub fn new(turns: u32, settings: Settings) -> Result<Turns, Error> {
        let wind = |point: Vector, _: f64| Vector::new(-point.y, point.x, 0.0) * TAU;
        let cloud = carried(CARRIED, settings, Vector::x(), f64::from(turns), &wind)?;
        let place = centre(&cloud);
        let wanted = TAU * cloud.time().fract();
        let ahead = place.y.atan2(place.x) - wanted;
        Ok(Turns { radius: place.x.hypot(place.y), ahead: ahead - TAU * (ahead / TAU).round() })
    }
}

/// Rigid rotation: the radius after 1,000 turns, by tolerance, with ticks of 1/128 of a turn.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn rotation() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let settings = Settings { tick: 1.0 / 128.0, tolerance, ..Settings::default() };
        found.push((tolerance, Turns::new(1000, settings)?.radius));
    }
    Ok(Convergence::rows("rigid rotation: radius after 1,000 turns (m)", 1.0, &found))
}

/// Rigid rotation, by the length of ticks: the radius after 1,000 turns, and the angle after 10.
///
/// # Errors
///
/// An error of the cloud, which is a defect.
pub fn rotation_ticks() -> Result<Vec<Convergence>, Error> {
    let (mut radii, mut angles) = (Vec::new(), Vec::new());
    for tick in [1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0] {
        let settings = Settings { tick, fixed: true, ..Settings::default() };
        radii.push((tick, Turns::new(1000, settings)?.radius));
        angles.push((tick, Turns::new(10, settings)?.ahead));
    }
    let mut all = Convergence::rows("rigid rotation, by ticks: radius after 1,000 turns (m)", 1.0, &radii);
    all.extend(Convergence::rows("rigid rotation, by ticks: angle after 10 turns (rad)", 0.0, &angles));
    Ok(all)
}
