//! Landing: rebounds, friction, rolling, energy, random throws.

use dlsys_wind::study::Convergence;

use super::TOLERANCES;
use crate::motion::turn;
use crate::{Air, Body, Error, Fall, Ground, Motion, Open, Settings, Still, Vector};

/// Settings without air.
pub(super) fn vacuum(tolerance: f64) -> Settings {
    Settings { tolerance, air: Air { density: 0.0, ..Air::default() }, ..Settings::default() }
}

/// A ball that is dropped from h = 1 m without air, restitution e = 0.8: its height after the third impact, halfway to the fourth in time, which is
/// e⁶ h.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn bounce() -> Result<Vec<Convergence>, Error> {
    let (e, radius) = (0.8_f64, 0.02);
    let first = (2.0 / 9.81_f64).sqrt();
    let time = first * (1.0 + 2.0 * e + 2.0 * e * e + e * e * e);
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let ground = Ground { restitution: e, ..Ground::at(0.0) };
        let release = Motion::at(Vector::new(0.0, 1.0 + radius, 0.0));
        let mut fall = Fall::new(Body::ball(0.01, radius)?, release, 0.0, Some(ground), vacuum(tolerance))?;
        found.push((tolerance, fall.at(time, &Still)?.position.y - radius));
    }
    Ok(Convergence::rows("third rebound of a ball: height (m)", e.powi(6), &found))
}

/// Way of a plate that lies on the ground and starts with a velocity of 1 m/s, until it rests.
fn sliding(settings: Settings, friction: f64) -> Result<f64, Error> {
    let ground = Ground { friction, ..Ground::at(0.0) };
    let velocity = Vector::new(0.6, 0.0, 0.8);
    let release = Motion { velocity, ..Motion::at(Vector::zeros()) };
    let mut fall = Fall::new(Body::plate(1e-3, [0.02, 0.03])?, release, 0.0, Some(ground), settings)?;
    Ok(fall.at(30.0, &Still)?.position.norm())
}

/// A plate that slides to rest on the ground without air: v²/(2 μ g). The steps in contact are of order 1, and as long as the root of the tolerance.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn slide() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        found.push((tolerance, sliding(vacuum(tolerance), 0.4)?));
    }
    Ok(Convergence::rows("sliding to rest: way (m)", 1.0 / (2.0 * 0.4 * 9.81), &found))
}

/// The same with the drag of a plate edge-on: m/(2 k) ln(1 + k v²/(μ m g)), k = ½ · 0.4 ρ A.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn slide_in_air() -> Result<Vec<Convergence>, Error> {
    let mass = 1e-3;
    let k = 0.2 * 1.2 * std::f64::consts::PI * 0.02 * 0.03;
    let exact = mass / (2.0 * k) * (k / (0.4 * mass * 9.81)).ln_1p();
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        found.push((tolerance, sliding(Settings { tolerance, ..Settings::default() }, 0.4)?));
    }
    Ok(Convergence::rows("sliding to rest in air: way (m)", exact, &found))
}

/// A ball that slides at first without spin, without air and without resistance to rolling: it rolls at 5/7 of its speed in the end.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn roll() -> Result<Vec<Convergence>, Error> {
    let radius = 0.02;
    let ground = Ground { rolling: 0.0, ..Ground::at(0.0) };
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let velocity = Vector::new(1.4, 0.0, 0.0);
        let release = Motion { velocity, ..Motion::at(Vector::new(0.0, radius, 0.0)) };
        let mut fall = Fall::new(Body::ball(0.01, radius)?, release, 0.0, Some(ground), vacuum(tolerance))?;
        found.push((tolerance, fall.at(0.5, &Still)?.velocity.norm()));
    }
    Ok(Convergence::rows("ball from sliding to rolling: speed (m/s)", 1.0, &found))
}

/// Plates and lumps that are thrown at the ground without air: the largest gain of energy in an impact or in a step in contact, and in a
/// step in flight, relative to the energy at release. Contact takes energy away; flight keeps it up to its error.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn contact_energy() -> Result<Vec<Convergence>, Error> {
    let (mut in_contact, mut in_flight) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        let (mut contact, mut flight) = (0.0_f64, 0.0_f64);
        for seed in 0..12 {
            let (body, release, ground) = throw(seed)?;
            let mut fall = Fall::new(body, release, 0.0, Some(ground), vacuum(tolerance))?;
            let start = fall.energy(&release).iter().sum::<f64>();
            while let Some(part) = fall.part(10.0, &Still, &Open)? {
                let [before, within, after] = [part.before, part.within, part.after]
                    .map(|motion| fall.energy(&motion).iter().sum::<f64>());
                if part.flight {
                    flight = flight.max((within - before) / start);
                    contact = contact.max((after - within) / start);
                } else {
                    contact = contact.max((after - before) / start);
                }
            }
        }
        in_contact.push((tolerance, contact));
        in_flight.push((tolerance, flight));
    }
    let mut all = Convergence::rows("thrown bodies: gain of energy by contact", 0.0, &in_contact);
    all.extend(Convergence::rows("thrown bodies: gain of energy in flight", 0.0, &in_flight));
    Ok(all)
}

/// A number in 0..1 from a seed and a purpose.
pub(super) fn chance(seed: u64, purpose: u64) -> f64 {
    // The mixing function of splitmix64 (Steele, Lea, Flood, 2014).
    let mut z = (seed << 8 | purpose).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A plate or a lump with a random motion above a floor at height 0.
pub(super) fn throw(seed: u64) -> Result<(Body, Motion, Ground), Error> {
    let x = |purpose: u64| chance(seed, purpose);
    let spread = |purpose: u64, size: f64| (2.0 * x(purpose) - 1.0) * size;
    let half = [0.004 + 0.03 * x(0), 0.004 + 0.03 * x(1)];
    let body = if seed % 3 == 2 {
        Body::lump(1e-3, [half[0], half[1], 0.004 + 0.02 * x(2)])?
    } else {
        Body::plate(1000.0 * 2e-4 * half[0] * half[1] * 3.0, half)?
    };
    let mut motion = Motion::at(Vector::new(spread(3, 1.0), 0.05 + x(4), spread(5, 1.0)));
    motion.velocity = Vector::new(spread(6, 3.0), spread(7, 3.0), spread(8, 3.0));
    motion.spin = Vector::new(spread(9, 60.0), spread(10, 60.0), spread(11, 60.0));
    motion.attitude = turn(motion.attitude, Vector::new(spread(12, 1.8), spread(13, 1.8), spread(14, 1.8)));
    let ground = Ground { friction: x(15), restitution: 0.9 * x(16), ..Ground::at(0.0) };
    Ok((body, motion, ground))
}

/// The end of a random throw.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomLanding {
    /// Number of the throw.
    pub seed: u64,
    /// Time at which the body rests, in s; `None` if it moves at 60 s.
    pub rest: Option<f64>,
    /// Depth of the lowest contact under the ground at any of the instants, in parts of the largest half-extent.
    pub depth: f64,
    /// Steps up to rest.
    pub steps: u64,
    /// Rebounds and impacts.
    pub impacts: u32,
}

/// A plate or lump thrown at the ground in gusty air, looked at 1000 times a second. One throw in four is at up to 100 times the speed.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn random_landing(seed: u64, tolerance: f64) -> Result<RandomLanding, Error> {
    let (body, mut release, ground) = throw(seed)?;
    if seed.is_multiple_of(4) {
        release.velocity *= 1.0 + 99.0 * chance(seed, 20);
    }
    let size = body.size();
    let gust = 4.0 * chance(seed, 21);
    let wind = move |point: Vector, time: f64| {
        Vector::new(gust * (1.0 + (3.0 * time + point.x).sin()), 0.3 * (5.0 * time).sin(), 0.2 * gust)
    };
    let settings = Settings { tolerance, ..Settings::default() };
    let mut fall = Fall::new(body.clone(), release, 0.0, Some(ground), settings)?;
    let mut depth = 0.0_f64;
    for k in 1..60_000 {
        let motion = fall.at(f64::from(k) / 1000.0, &wind)?;
        depth = depth.max(-ground.lowest(&motion, &body) / size);
        if fall.rest().is_some() {
            break;
        }
    }
    Ok(RandomLanding { seed, rest: fall.rest(), depth, steps: fall.steps(), impacts: fall.impacts() })
}
