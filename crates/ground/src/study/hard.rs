//! Cases in which material or bodies could go on without an end, or lose something.

use std::sync::Arc;
use std::time::Instant;

use super::presses::sphere;
use crate::noise::{mixed, unit};
use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

/// How a hard case ended.
#[derive(Clone, Debug)]
pub struct HardCase {
    /// What happens.
    pub case: &'static str,
    /// Sweeps until everything was at rest.
    pub sweeps: u64,
    /// Columns that they computed.
    pub updates: u64,
    /// What the volume has changed by, in parts of quanta: 0.
    pub imbalance: i128,
    /// Seconds of computing.
    pub seconds: f64,
    /// Why it failed.
    pub failure: Option<String>,
}

/// Most sweeps until a case is at rest.
const SWEEPS: u64 = 400_000;
/// Width of columns in m.
const CELL: f64 = 0.01;

/// Columns of 1 cm from -0.4 to 0.4 m.
fn square(soil: Soil, bed: Relief, depth: Relief) -> Description {
    Description { cell: CELL, extent: Extent::around(40), soil, bed, depth }
}

/// A number from 0 to 1 of a column.
fn random(seed: u64, x: f64, z: f64) -> f64 {
    let number = |at: f64| (at / CELL).round() as i64 as u64;
    unit(mixed(seed ^ mixed(number(x) ^ mixed(number(z)))))
}

/// Lets a ground come to rest after bodies have gone through it; `bodies` tells where they are in each tick.
fn case(
    case: &'static str,
    description: Description,
    ticks: u32,
    bodies: impl Fn(u32) -> Vec<Body>,
) -> HardCase {
    let begun = Instant::now();
    let run = || -> Result<Ground, Error> {
        let mut ground = Ground::new(description, Settings::default())?;
        for tick in 0..ticks {
            ground.advance(&[], &bodies(tick))?;
        }
        if ticks > 0 {
            // They are gone; what was in the air comes down, and banks fail.
            while ground.particles() > 0 || !ground.is_at_rest() {
                ground.advance(&[], &[])?;
                if ground.sweeps() > SWEEPS {
                    break;
                }
            }
        }
        ground.settle(SWEEPS)?;
        Ok(ground)
    };
    let (ground, failure) = match run() {
        Ok(ground) => (Some(ground), None),
        Err(error) => (None, Some(error.to_string())),
    };
    let imbalance = ground.as_ref().map_or(0, Ground::imbalance);
    let lost = (imbalance != 0).then(|| "volume is lost or comes from nowhere".to_owned());
    HardCase {
        case,
        sweeps: ground.as_ref().map_or(0, Ground::sweeps),
        updates: ground.as_ref().map_or(0, Ground::updates),
        imbalance,
        seconds: begun.elapsed().as_secs_f64(),
        failure: failure.or(lost),
    }
}

/// A body on its way in a tick.
fn moving(shape: &(Arc<[Vector]>, Arc<[[u32; 3]]>), from: Vector, to: Vector) -> Body {
    let at = |way: Vector| shape.0.iter().map(|point| point + way).collect();
    Body { to: at(to), ..Body::still(1, "a ball", shape.1.clone(), at(from)) }
}

/// The hard cases: films, spikes, walls, chains of banks, bodies that are gone within a tick, and bodies thrown about at random. Errors are told in each.
pub fn hard_cases() -> Vec<HardCase> {
    let none = |_: u32| Vec::new();
    let (level, flat) = (|height: f64| Relief::Level(height), Relief::Level(0.0));
    let sand = Soil::sand();
    let spike = |height: f64| Relief::function(move |x, z| if x == 0.0 && z == 0.0 { height } else { 0.0 });
    let slope = |x: f64, z: f64| 2.0 * x + 0.5 * z;
    let bumps = |x: f64, z: f64| 0.3 * random(1, x, z);
    let patches = |x: f64, z: f64| (0.2 * (random(2, x, z) - 0.4)).max(0.0);
    let wall = |x: f64, _: f64| if x > 0.0 { 0.3 } else { 0.02 };
    // Steps of 8 cm, each higher than its soil stands when what fell from above lies on its edge.
    let stairs = |x: f64, _: f64| 0.08 * ((x + 0.4) / 0.1).floor();
    let loam = Soil { cohesion: 0.3, swell: 0.2, ..sand };
    let ball = sphere(Vector::zeros(), 0.08, 24);
    let pebble = sphere(Vector::zeros(), 0.02, 8);
    let gone = |tick: u32| {
        let at = |y: f64| Vector::new(0.003, y, -0.002);
        let (low, high) = (at(0.1), at(5.1));
        vec![if tick == 0 { moving(&ball, low, low) } else { moving(&ball, low, high) }]
    };
    let shot = |tick: u32| {
        let at = |tick: u32| Vector::new(-0.3 + 0.6 * f64::from(tick % 2), 0.12, 0.0);
        vec![moving(&pebble, at(tick), at(tick + 1))]
    };
    let thrown = |tick: u32| {
        let at = |tick: u32| {
            let number = |n: u64| unit(mixed(mixed(u64::from(tick / 4)) ^ n)) - 0.5;
            let next = |n: u64| unit(mixed(mixed(u64::from(tick / 4 + 1)) ^ n)) - 0.5;
            let part = f64::from(tick % 4) / 4.0;
            let along = |n: u64| number(n) + part * (next(n) - number(n));
            Vector::new(0.5 * along(1), 0.2 + 0.4 * along(2), 0.5 * along(3))
        };
        vec![moving(&ball, at(tick), at(tick + 1))]
    };
    let sticky = Soil { stick: 0.002, shed: 0.02, ..sand };
    vec![
        case("a film of 10 µm on a bed of 64°", square(sand, Relief::function(slope), level(1e-5)), 0, none),
        case("a spike of 10 m on one column", square(sand, flat.clone(), spike(10.0)), 0, none),
        case("one of snow, of 100 m", square(Soil::snow(), flat.clone(), spike(100.0)), 0, none),
        case(
            "random patches on a random bed",
            square(sand, Relief::function(bumps), Relief::function(patches)),
            0,
            none,
        ),
        case("a wall of loose sand", square(sand, flat.clone(), Relief::function(wall)), 0, none),
        case(
            "stairs of loam that bring each other down",
            square(loam, flat.clone(), Relief::function(stairs)),
            1,
            none,
        ),
        case("a ball that is gone within a tick", square(sand, flat.clone(), level(0.2)), 2, gone),
        case("a pebble at 72 m/s, to and fro", square(sand, flat.clone(), level(0.12)), 20, shot),
        case("a ball thrown about, that throws up sand", square(sticky, flat, level(0.2)), 80, thrown),
    ]
}
