//! Contact with soil that is a height field: slopes with exact solutions, and throws at random hills.

use std::sync::Arc;

use dlsys_wind::study::Convergence;

use super::TOLERANCES;
use super::contact::block;
use super::landing::{chance, throw, vacuum};
use crate::{Body, Columns, Error, Fall, Motion, Obstacles, Soil, Span, Still, Surface, Vector};

const G: f64 = 9.81;
/// Spans of the studies in s.
const TICK: f64 = 1.0 / 120.0;

/// Columns of which a function gives the height at a place in m.
#[derive(Clone, Copy)]
struct Hills<F> {
    cell: f64,
    height: F,
}

impl<F> std::fmt::Debug for Hills<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "hills of {} m", self.cell)
    }
}

impl<F: Fn(f64, f64) -> f64 + Send + Sync> Columns for Hills<F> {
    fn cell(&self) -> f64 {
        self.cell
    }

    fn height(&self, i: i32, k: i32) -> f64 {
        (self.height)(f64::from(i) * self.cell, f64::from(k) * self.cell)
    }

    fn bounds(&self, x: [i32; 2], z: [i32; 2]) -> [f64; 2] {
        let all = (x[0]..=x[1]).flat_map(|i| (z[0]..=z[1]).map(move |k| self.height(i, k)));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], height| {
            [low.min(height), high.max(height)]
        })
    }
}

/// Soil that stands still.
struct Bank(Soil);

impl Bank {
    fn new(cell: f64, surface: Surface, height: impl Fn(f64, f64) -> f64 + Send + Sync + 'static) -> Bank {
        Bank(Soil { columns: Arc::new(Hills { cell, height }), surface })
    }
}

impl Obstacles for Bank {
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, Error> {
        let begin = libm::floor(time / TICK) * TICK;
        let begin = if begin + TICK > time { begin } else { begin + TICK };
        Ok(Some(Arc::new(Span::new(begin, begin + TICK, Vec::new())?.above(self.0.clone())?.last())))
    }
}

/// The way of a body down a slope of soil (radians), from rest on it, within half a second.
fn downhill(body: Body, slope: f64, surface: Surface, tolerance: f64) -> Result<f64, Error> {
    let rise = libm::tan(slope);
    // Along neither axis of the columns: triangles of either half of a square lie in one plane.
    let (along, across) = (0.6, 0.8);
    let soil = Bank::new(0.013, surface, move |x, z| -rise * (along * x + across * z));
    let axis = Vector::new(across, 0.0, -along);
    let tilt = dlsys_solid::Attitude::from_scaled_axis(axis * slope);
    let mut release = Motion::at(Vector::zeros());
    let low = body.contacts.iter().map(|contact| (release.turned(contact.point)).y - contact.radius);
    let low = low.fold(f64::INFINITY, f64::min);
    let up = tilt * Vector::y();
    release.attitude = tilt * release.attitude;
    release.position = up * -low;
    let start = release.position;
    let mut fall = Fall::new(body, release, 0.0, None, vacuum(tolerance))?;
    Ok((fall.among(0.5, &Still, &soil)?.position - start).norm())
}

/// A ball on a slope of sand at its angle of repose, 25°: it rolls with 5/7 g (sin θ - c cos θ), where c = 0.3 is the resistance to rolling. And without friction, with g sin θ.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn roll_on_soil() -> Result<Vec<Convergence>, Error> {
    let slope = 25.0_f64.to_radians();
    let sand = Surface { friction: libm::tan(slope), restitution: 0.0, rolling: 0.3 };
    let ice = Surface { friction: 0.0, ..sand };
    let (mut rolls, mut slides) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        rolls.push((tolerance, downhill(Body::ball(0.03, 0.02)?, slope, sand, tolerance)?));
        slides.push((tolerance, downhill(Body::ball(0.03, 0.02)?, slope, ice, tolerance)?));
    }
    let way = |acceleration: f64| 0.5 * acceleration * 0.25;
    let rolling = way(5.0 / 7.0 * G * (libm::sin(slope) - 0.3 * libm::cos(slope)));
    let mut all = Convergence::rows("ball that rolls down soil: way (m)", rolling, &rolls);
    all.extend(Convergence::rows("ball that slides down soil: way (m)", way(G * libm::sin(slope)), &slides));
    Ok(all)
}

/// A block on a slope of soil 3° below and 5° above the angle of friction, 26.565°: it stays, and slides with g (sin θ - μ cos θ).
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn slope_of_soil() -> Result<Vec<Convergence>, Error> {
    let limit = libm::atan(0.5);
    let [below, above] = [limit - 3.0_f64.to_radians(), limit + 5.0_f64.to_radians()];
    let (mut stays, mut slides) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        stays.push((tolerance, downhill(block()?, below, Surface::default(), tolerance)?));
        slides.push((tolerance, downhill(block()?, above, Surface::default(), tolerance)?));
    }
    let exact = 0.5 * G * (libm::sin(above) - 0.5 * libm::cos(above)) * 0.25;
    let mut all = Convergence::rows("block on soil below the angle of friction: way (m)", 0.0, &stays);
    all.extend(Convergence::rows("block on soil above the angle of friction: way (m)", exact, &slides));
    Ok(all)
}

/// A random throw at hills of soil.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomHills {
    /// Number of the throw.
    pub seed: u64,
    /// Depth of the lowest contact below the surface at any of the instants, in parts of the largest half-extent.
    pub depth: f64,
    /// Largest gain of energy in an impact or in a step in contact, relative to the energy at release.
    pub gain: f64,
    /// Steps in all.
    pub steps: u64,
    /// Speed at the end in m/s.
    pub speed: f64,
}

/// A plate or lump thrown at hills without air, looked at 1000 times a second for two seconds. One throw in four is at 10 times the speed, and columns are between a
/// third and three times as wide as the body.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn random_hills(seed: u64, tolerance: f64) -> Result<RandomHills, Error> {
    let (body, mut release, ground) = throw(seed)?;
    if seed.is_multiple_of(4) {
        release.velocity *= 10.0;
    }
    release.position.y += 0.1;
    let size = body.size();
    let x = |purpose: u64| chance(seed, purpose);
    let cell = size * (0.3 + 2.7 * x(30));
    let waves = [20.0 + 30.0 * x(31), 20.0 + 30.0 * x(32), 7.0 * x(33)];
    let height = move |x: f64, z: f64| 0.015 * (libm::sin(waves[0] * x + waves[2]) + libm::cos(waves[1] * z));
    let surface =
        Surface { friction: ground.friction, restitution: ground.restitution, rolling: ground.rolling };
    let soil = Bank::new(cell, surface, height);
    let relief = crate::soil::Relief::new(soil.0.clone(), Arc::default());
    let mut fall = Fall::new(body.clone(), release, 0.0, None, vacuum(tolerance))?;
    let energy = |motion: &Motion| fall.energy(motion).iter().sum::<f64>();
    let start = energy(&release).abs();
    let (mut depth, mut gain, mut speed) = (0.0_f64, 0.0_f64, 0.0);
    let mut steps = fall.clone();
    while let Some(part) = steps.part(2.0, &Still, &soil)? {
        let before = if part.flight { part.within } else { part.before };
        gain = gain.max((energy(&part.after) - energy(&before)) / start);
    }
    for instant in 1..=2000 {
        let motion = fall.among(f64::from(instant) / 1000.0, &Still, &soil)?;
        for contact in &body.contacts {
            let point = motion.point(contact.point);
            depth = depth.max((relief.depth(&point).unwrap_or(f64::INFINITY) + contact.radius) / size);
        }
        speed = motion.velocity.norm();
    }
    Ok(RandomHills { seed, depth, gain, steps: fall.steps(), speed })
}
