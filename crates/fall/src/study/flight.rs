//! Flight in still air: terminal speed, broadside fall, flutter, tumbling.

use std::f64::consts::{PI, TAU};

use dlsys_wind::study::Convergence;

use super::TOLERANCES;
use super::planar::{Planar, planar_flutter, planar_tumble};
use crate::motion::turn;
use crate::{Air, Body, Error, Fall, Motion, Settings, Still, Vector};

fn settings(tolerance: f64) -> Settings {
    Settings { tolerance, ..Settings::default() }
}

/// A petal.
fn petal() -> Result<Body, Error> {
    Body::plate(4e-5, [0.01, 0.015])
}

/// Terminal speed of a petal broadside on, v_t = √(2 m g/(2.4 ρ A)), and of a seed, with buoyancy; after 2 s and 20 s.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn terminal_speed() -> Result<Vec<Convergence>, Error> {
    let air = Air::default();
    let (petal, seed) = (petal()?, Body::ball(2e-5, 2e-3)?);
    let exact = (2.0 * petal.mass * 9.81 / (2.4 * 1.2 * petal.area)).sqrt();
    let volume = 4.0 / 3.0 * PI * 8e-9;
    let heavy = (2.0 * (2e-5 - 1.2 * volume) * 9.81 / (0.47 * 1.2 * PI * 4e-6)).sqrt();
    let mut all = Vec::new();
    for (case, body, time, exact) in [
        ("terminal speed of a petal (m/s)", petal, 2.0, exact),
        ("terminal speed of a seed (m/s)", seed, 20.0, heavy),
    ] {
        let mut found = Vec::new();
        for tolerance in TOLERANCES {
            let mut fall = Fall::new(
                body.clone(),
                Motion::at(Vector::zeros()),
                0.0,
                None,
                Settings { air, ..settings(tolerance) },
            )?;
            found.push((tolerance, -fall.at(time, &Still)?.velocity.y));
        }
        all.extend(Convergence::rows(case, exact, &found));
    }
    Ok(all)
}

/// A body that falls from rest against drag ∝ v²: v = v_t tanh(g' t/v_t) and the way v_t²/g' ln cosh(g' t/v_t), with the acceleration at
/// the start g' = weight/(mass + mass of the air that moves with the body), at t = v_t/g'.
struct Broadside {
    body: Body,
    time: f64,
    speed: f64,
    way: f64,
}

impl Broadside {
    fn new() -> Result<Broadside, Error> {
        let body = petal()?;
        let terminal = (2.0 * body.mass * 9.81 / (2.4 * 1.2 * body.area)).sqrt();
        let start = body.mass * 9.81 / (body.mass + PI / 2.0 * 1.2 * 0.01 * body.area);
        let time = terminal / start;
        let way = terminal * terminal / start * 1_f64.cosh().ln();
        Ok(Broadside { body, time, speed: terminal * 1_f64.tanh(), way })
    }

    fn rows(&self, names: [&'static str; 2], list: &[(f64, Settings)]) -> Result<Vec<Convergence>, Error> {
        let (mut speeds, mut ways) = (Vec::new(), Vec::new());
        for (resolution, settings) in list {
            let mut fall = Fall::new(self.body.clone(), Motion::at(Vector::zeros()), 0.0, None, *settings)?;
            let motion = fall.at(self.time, &Still)?;
            speeds.push((*resolution, -motion.velocity.y));
            ways.push((*resolution, -motion.position.y));
        }
        let mut all = Convergence::rows(names[0], self.speed, &speeds);
        all.extend(Convergence::rows(names[1], self.way, &ways));
        Ok(all)
    }
}

/// Broadside fall of a petal, by tolerance.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn broadside() -> Result<Vec<Convergence>, Error> {
    let list = TOLERANCES.map(|tolerance| (tolerance, settings(tolerance)));
    Broadside::new()?.rows(["broadside fall: speed (m/s)", "broadside fall: way (m)"], &list)
}

/// Broadside fall of a petal, by the length of steps.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn broadside_steps() -> Result<Vec<Convergence>, Error> {
    let case = Broadside::new()?;
    let list = [8.0, 16.0, 32.0].map(|count| {
        let longest = case.time / count;
        (longest, Settings { longest, fixed: true, ..Settings::default() })
    });
    case.rows(["broadside fall, by steps: speed (m/s)", "broadside fall, by steps: way (m)"], &list)
}

/// A strip with a mass ratio I*, with its scales of velocity (m/s) and time (s).
fn strip(ratio: f64) -> Result<(Body, f64, f64), Error> {
    let a = 0.01;
    let area = PI * a * 0.03;
    let mass = ratio * PI * 1.2 * a * area / 2.0;
    let speed = (mass * 9.81 / (area / (2.0 * a)) / (PI * 1.2 * a)).sqrt();
    Ok((Body::plate(mass, [a, 0.03])?, speed, a / speed))
}

/// Angle of a plate that falls in the plane of x and y, in (-π, π].
fn angle(motion: &Motion) -> f64 {
    let normal = motion.turned(Vector::z());
    (-normal.x).atan2(normal.y)
}

/// Means over passages `from..to`, of the angle upward through `level(n)` counting turns, in units of the planar equations. The plate starts as
/// the planar one does, in a plane that is turned about the vertical.
fn measure(
    ratio: f64,
    tolerance: f64,
    level: fn(usize) -> f64,
    from: usize,
    to: usize,
) -> Result<Planar, Error> {
    let (body, speed, unit) = strip(ratio)?;
    let mut release = Motion::at(Vector::zeros());
    release.attitude = turn(release.attitude, Vector::new(0.0, -0.5, 0.0));
    let mut fall = Fall::new(body, release, 0.0, None, settings(tolerance))?;
    let mut passages = Vec::new();
    let (mut time, mut total) = (0.0, angle(&release));
    let sample = 0.05 * unit;
    while passages.len() <= to && time < 1e4 * unit {
        let next = fall.at(time + sample, &Still)?;
        let change = angle(&next) - total;
        let after = total + change - TAU * (change / TAU).round();
        let wanted = level(passages.len());
        if total < wanted && after >= wanted {
            let (mut low, mut high) = (time, time + sample);
            for _ in 0..40 {
                let middle = (low + high) / 2.0;
                let off = angle(&fall.at(middle, &Still)?) - wanted;
                if off - TAU * (off / TAU).round() < 0.0 { low = middle } else { high = middle }
            }
            passages.push((low, fall.at(low, &Still)?.position.y));
        }
        (time, total) = (time + sample, after);
    }
    let (Some(first), Some(last)) = (passages.get(from), passages.get(to)) else {
        return Ok(Planar { period: f64::NAN, fall: f64::NAN });
    };
    let time = last.0 - first.0;
    Ok(Planar { period: time / (to - from) as f64 / unit, fall: (first.1 - last.1) / time / speed })
}

/// Flutter at I* = 0.5: period in a/U and mean fall in U, over periods 5 to 15, against a second computation in the plane. The design
/// values are 6.38 and 0.30.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn flutter() -> Result<Vec<Convergence>, Error> {
    let exact = planar_flutter(0.5, 5, 15);
    let (mut periods, mut falls) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        let found = measure(0.5, tolerance, |_| 0.0, 5, 15)?;
        periods.push((tolerance, found.period));
        falls.push((tolerance, found.fall));
    }
    let mut all = Convergence::rows("flutter at I* = 0.5: period (a/U)", exact.period, &periods);
    all.extend(Convergence::rows("flutter at I* = 0.5: mean fall (U)", exact.fall, &falls));
    Ok(all)
}

/// Tumbling at I* = 1.4: time of a turn in a/U and mean fall in U, over turns 2 to 6, against a second computation in the plane. The design
/// value is 12.7 to 13.0.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn tumble() -> Result<Vec<Convergence>, Error> {
    let level = |n: usize| n as f64 * TAU;
    let exact = planar_tumble(1.4, 2, 6);
    let (mut periods, mut falls) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        let found = measure(1.4, tolerance, level, 2, 6)?;
        periods.push((tolerance, found.period));
        falls.push((tolerance, found.fall));
    }
    let mut all = Convergence::rows("tumbling at I* = 1.4: time of a turn (a/U)", exact.period, &periods);
    all.extend(Convergence::rows("tumbling at I* = 1.4: mean fall (U)", exact.fall, &falls));
    Ok(all)
}
