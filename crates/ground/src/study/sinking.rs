//! Bodies that fall into soil, and come to rest where it bears them.

use std::sync::Arc;

use dlsys_wind::study::Convergence;
use nalgebra::{Matrix3, UnitQuaternion};

use super::sphere;
use crate::{Body, Description, Drive, Error, Extent, Ground, Relief, Settings, Soil, Stand, Vector};

/// m/s².
const GRAVITY: f64 = 9.806_65;
/// Steps of the references.
const FINE: u32 = 200_000;

/// A free body that does not turn, in the ground.
#[derive(Clone, Debug)]
pub struct Ram {
    /// Its points from its middle, in m.
    pub points: Arc<[Vector]>,
    /// Closed triangles.
    pub triangles: Arc<[[u32; 3]]>,
    /// In kg.
    pub mass: f64,
    /// Its middle.
    pub stand: Stand,
}

impl Ram {
    /// A sphere of a radius in m and a density in kg/m³ that falls with a speed in m/s, with its lowest point at the height 0.
    pub fn sphere(radius: f64, density: f64, speed: f64, segments: u32) -> Ram {
        let (points, triangles) = sphere(Vector::zeros(), radius, segments);
        let mass = density * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        let stand = Stand { position: Vector::y() * radius, velocity: Vector::y() * -speed };
        Ram { points, triangles, mass, stand }
    }

    /// A block of a width and a height in m and a mass in kg, with its underside at the height 0.
    pub fn block(width: f64, height: f64, mass: f64) -> Ram {
        let at = |n: u32| {
            let part = |bit: u32| f64::from(n >> bit & 1) - 0.5;
            Vector::new(part(0) * width, part(1) * height, part(2) * width)
        };
        let sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let halves = |[a, b, c, d]: [u32; 4]| [[a, c, b], [a, d, c]];
        let triangles: Vec<[u32; 3]> = sides.into_iter().flat_map(halves).collect();
        let stand = Stand { position: Vector::y() * (0.5 * height), velocity: Vector::zeros() };
        Ram { points: (0..8).map(at).collect(), triangles: triangles.into(), mass, stand }
    }

    fn placed(&self, at: &Vector) -> Arc<[Vector]> {
        self.points.iter().map(|point| point + at).collect()
    }

    /// Goes on by a tick of the ground in some steps, and presses into it. Returns the impulse of the soil in N s.
    ///
    /// # Errors
    ///
    /// An error of the ground.
    pub fn tick(&mut self, ground: &mut Ground, pull: &Vector, steps: u32) -> Result<Vector, Error> {
        let from = self.placed(&self.stand.position);
        let bearing = ground.bearing(1, (&self.triangles, &from), &self.stand.position);
        let length = ground.setup.settings.tick / f64::from(steps);
        let light = Matrix3::identity() / self.mass;
        let mut impulse = Vector::zeros();
        for _ in 0..steps {
            let free = self.stand.velocity + (pull / self.mass - Vector::y() * GRAVITY) * length;
            let drive = Drive { turn: UnitQuaternion::identity(), spin: Vector::zeros(), free, light };
            let (stand, push) = bearing.step(&self.stand, &drive, length);
            self.stand = stand;
            impulse += push;
        }
        let to = self.placed(&self.stand.position);
        let triangles = Arc::clone(&self.triangles);
        ground
            .advance(&[], &[Body { id: 1, name: "a ram".to_owned(), triangles, from, to, shelf: false }])?;
        Ok(impulse)
    }
}

/// Level ground of a soil, twice as wide as a body with some columns in its half-width.
///
/// # Errors
///
/// A soil out of range.
pub fn fall(soil: Soil, half: f64, columns: i32) -> Result<Ground, Error> {
    let description = Description {
        cell: half / f64::from(columns),
        extent: Extent::around(4 * columns),
        soil,
        bed: Relief::Level(-100.0 * half),
        depth: Relief::Level(100.0 * half),
    };
    Ground::new(description, Settings::default())
}

/// The depth in m at which a body stops: ½m (v²)' = m g - F(z) - C(z) v², with the resistance in N and the drag in kg/m at a depth, from a speed in m/s on.
fn depth(mass: f64, speed: f64, longest: f64, forces: impl Fn(f64) -> [f64; 2]) -> f64 {
    let step = longest / f64::from(FINE);
    let rate = |z: f64, square: f64| {
        let [force, drag] = forces(z);
        2.0 * (GRAVITY - (force + drag * square) / mass)
    };
    let mut square = speed * speed;
    for n in 0..FINE {
        let z = f64::from(n) * step;
        let half = square + 0.5 * step * rate(z, square);
        let next = square + step * rate(z + 0.5 * step, half);
        if next <= 0.0 && n > 0 {
            return z + step * square / (square - next);
        }
        square = next;
    }
    f64::NAN
}

/// A sphere that falls into fresh snow, which does not heap up: the depth at which it rests.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn dropped() -> Result<Vec<Convergence>, Error> {
    let (radius, density, speed, soil) = (0.1_f64, 600.0, 3.0, Soil::snow());
    let weight = soil.weight * 1e3;
    let mass = Ram::sphere(radius, density, speed, 4).mass;
    let forces = |z: f64| {
        let (pi, low) = (std::f64::consts::PI, z.min(radius));
        let above = if z < radius {
            pi * z * z * (3.0 * radius - z) / 3.0
        } else {
            pi * radius * radius * (z - radius / 3.0)
        };
        // Friction on its sides: the depth times the horizontal part of the normal, over what is below the surface.
        let top = z.min(2.0 * radius);
        let parts = 200;
        let side: f64 = (0..parts)
            .map(|n| {
                let up = (f64::from(n) + 0.5) / f64::from(parts) * top;
                2.0 * pi * libm::sqrt(up * (2.0 * radius - up)) * (z - up)
            })
            .sum::<f64>()
            * (top / f64::from(parts));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let drag = 8.0 / 3.0 * weight / GRAVITY * pi * low * (2.0 * radius - low);
        [weight * (35.0 * above + (1.0 - half) * side), drag]
    };
    let exact = depth(mass, speed, 0.5, forces);
    let mut found = Vec::new();
    for n in [1, 2, 4] {
        let mut ram = Ram::sphere(radius, density, speed, 16 * n);
        let mut ground = fall(soil, radius, 4 * n as i32)?;
        for _ in 0..60 {
            ram.tick(&mut ground, &Vector::zeros(), n)?;
        }
        found.push((f64::from(n), radius - ram.stand.position.y));
    }
    Ok(Convergence::rows("ball dropped into snow: depth at rest (m)", exact, &found))
}

/// A block that is let go on soft mud of 1 kPa, which does not heap up: the depth at which it rests.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn released() -> Result<Vec<Convergence>, Error> {
    let (width, height, mass) = (0.2_f64, 0.4, 60.0);
    let soil = Soil { repose: 89.0, inner: 89.0, push: 0.0, cohesion: 1.0, ..Soil::mud() };
    let (weight, area) = (soil.weight * 1e3, width * width);
    let friction = soil.carries() / 35.0;
    let rough = (1.0 - libm::sin(libm::atan(friction))) * friction;
    let forces = |z: f64| {
        let below = area * (soil.carries() * weight * z + 6e3);
        let side = 4.0 * width * (rough * weight * z * z / 2.0 + 1e3 * z);
        [below + side, 8.0 / 3.0 * friction * weight / GRAVITY * area]
    };
    let exact = depth(mass, 0.0, 0.4, forces);
    let mut found = Vec::new();
    for n in [1, 2, 4] {
        let mut ram = Ram::block(width, height, mass);
        let mut ground = fall(soil, width / 2.0, 4 * n)?;
        for _ in 0..120 {
            ram.tick(&mut ground, &Vector::zeros(), n as u32)?;
        }
        found.push((f64::from(n), height / 2.0 - ram.stand.position.y));
    }
    Ok(Convergence::rows("block let go on mud: depth at rest (m)", exact, &found))
}
