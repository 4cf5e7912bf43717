//! Contact with solids: rebounds from what moves, what is carried or slides, slopes, and a throw for comparison.

use dlsys_wind::study::Convergence;

use super::TOLERANCES;
use super::courses::{Course, Courses};
use super::landing::vacuum;
use crate::motion::turn;
use crate::{Body, Contact, Error, Fall, Motion, Still, Surface, Vector};

const G: f64 = 9.81;

/// A ball of 2 cm that is dropped onto a plate which moves up at 2 m/s, and away to the side: it leaves at (1 + e) V - e v, here 0.05 s later.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn moving_plate() -> Result<Vec<Convergence>, Error> {
    let (e, rise, height, radius) = (0.7, 2.0, 1.0, 0.02);
    let hit = (libm::sqrt(rise * rise + 2.0 * G * height) - rise) / G;
    let exact = (1.0 + e) * rise + e * G * hit - G * 0.05;
    let surface = Surface { friction: 0.0, restitution: e, rolling: 0.0 };
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let plate = Course::plate(2.0, surface)
            .on(Vector::z(), move |time| (Vector::new(3.0 * time, rise * time, 0.0), 0.0));
        let release = Motion::at(Vector::new(0.0, height + radius, 0.0));
        let mut fall = Fall::new(Body::ball(0.01, radius)?, release, 0.0, None, vacuum(tolerance))?;
        found.push((tolerance, fall.among(hit + 0.05, &Still, &Courses(vec![plate]))?.velocity.y));
    }
    Ok(Convergence::rows("rebound from a plate that moves (m/s)", exact, &found))
}

/// A ball that is dropped from h = 1 m onto a solid plate without air, restitution e = 0.8: its height after the n-th impact is e²ⁿ h, here n = 4.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn bounce_on_plate() -> Result<Vec<Convergence>, Error> {
    let (e, radius) = (0.8_f64, 0.02);
    let first = libm::sqrt(2.0 / G);
    let time = first * (1.0 + 2.0 * (e + e * e + e.powi(3)) + e.powi(4));
    let surface = Surface { restitution: e, ..Surface::default() };
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let release = Motion::at(Vector::new(0.0, 1.0 + radius, 0.0));
        let mut fall = Fall::new(Body::ball(0.01, radius)?, release, 0.0, None, vacuum(tolerance))?;
        let plate = Courses(vec![Course::plate(0.5, surface)]);
        found.push((tolerance, fall.among(time, &Still, &plate)?.position.y - radius));
    }
    Ok(Convergence::rows("fourth rebound from a solid plate: height (m)", e.powi(8), &found))
}

/// A flat block, 4 cm long, with contacts at its corners.
pub(super) fn block() -> Result<Body, Error> {
    let half = [0.02, 0.015, 0.005];
    let sign = |k: u32, bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |k| Vector::new(half[0] * sign(k, 0), half[1] * sign(k, 1), half[2] * sign(k, 2));
    let contact = |k| Contact { point: corner(k), radius: 0.0 };
    Body::lump(0.03, half)?.touching((0..8).map(contact).collect())
}

/// The way along x of a block on a plate that starts from rest with an acceleration in m/s², and after half a second.
fn carried(acceleration: f64, tolerance: f64) -> Result<f64, Error> {
    let plate = Course::plate(5.0, Surface::default())
        .on(Vector::z(), move |time| (Vector::x() * (0.5 * acceleration * time * time), 0.0));
    let release = Motion::at(Vector::new(0.0, 0.005, 0.0));
    let mut fall = Fall::new(block()?, release, 0.0, None, vacuum(tolerance))?;
    Ok(fall.among(0.5, &Still, &Courses(vec![plate]))?.position.x)
}

/// A block on a plate that accelerates at 3 m/s², less than μ g = 4.905 m/s²: it is carried along; and at 8 m/s²: it slides, and is dragged at μ g.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn carry() -> Result<Vec<Convergence>, Error> {
    let (mut sticks, mut slides) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        sticks.push((tolerance, carried(3.0, tolerance)?));
        slides.push((tolerance, carried(8.0, tolerance)?));
    }
    let mut all = Convergence::rows("block on a plate that accelerates at 3 m/s²: way (m)", 0.375, &sticks);
    all.extend(Convergence::rows(
        "block on a plate that accelerates at 8 m/s²: way (m)",
        0.5 * 0.5 * G * 0.25,
        &slides,
    ));
    Ok(all)
}

/// The way down of a block on a plate with a slope in radians, within half a second.
fn downhill(slope: f64, tolerance: f64) -> Result<f64, Error> {
    let plate = Course::plate(5.0, Surface::default()).on(Vector::z(), move |_| (Vector::zeros(), slope));
    let mut release = Motion::at(Vector::zeros());
    release.attitude = dlsys_solid::Attitude::from_scaled_axis(Vector::z() * slope) * release.attitude;
    release.position = release.turned(Vector::z() * 0.005);
    let start = release.position;
    let mut fall = Fall::new(block()?, release, 0.0, None, vacuum(tolerance))?;
    Ok((fall.among(0.5, &Still, &Courses(vec![plate]))?.position - start).norm())
}

/// A block on a slope 3° below and 5° above the angle of friction, 26.565°: it stays, and slides with g (sin θ - μ cos θ).
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn slope() -> Result<Vec<Convergence>, Error> {
    let limit = libm::atan(0.5);
    let [below, above] = [limit - 3.0_f64.to_radians(), limit + 5.0_f64.to_radians()];
    let (mut stays, mut slides) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        stays.push((tolerance, downhill(below, tolerance)?));
        slides.push((tolerance, downhill(above, tolerance)?));
    }
    let exact = 0.5 * G * (libm::sin(above) - 0.5 * libm::cos(above)) * 0.25;
    let mut all = Convergence::rows("block on a slope below the angle of friction: way (m)", 0.0, &stays);
    all.extend(Convergence::rows("block on a slope above the angle of friction: way (m)", exact, &slides));
    Ok(all)
}

/// An oblique throw with spin, without air: a parabola. Its height after 0.7 s.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn parabola() -> Result<Vec<Convergence>, Error> {
    let (velocity, time) = (Vector::new(2.0, 3.0, -1.0), 0.7);
    let exact = (velocity * time - Vector::y() * (0.5 * G * time * time)).norm();
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let mut release =
            Motion { velocity, spin: Vector::new(9.0, -5.0, 20.0), ..Motion::at(Vector::zeros()) };
        release.attitude = turn(release.attitude, Vector::new(0.3, -0.8, 0.2));
        let mut fall = Fall::new(block()?, release, 0.0, None, vacuum(tolerance))?;
        found.push((tolerance, fall.at(time, &Still)?.position.norm()));
    }
    Ok(Convergence::rows("oblique throw with spin, without air: way (m)", exact, &found))
}
