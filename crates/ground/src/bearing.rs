//! How soil bears a body: where its surface is below the level of the soil around it, and what that can hold.
//!
//! The limits of a part of the surface with the outward normal n and the depth z, for soil of the weight γ:
//!
//! | | limit | source |
//! |---|---|---|
//! | downward | K γ z, along the normal, K = 35 tan φ | Brzinski, Mayor, Durian, *Depth-dependent resistance of granular media to vertical penetration*, 2013 |
//! | sideways | 0.37 of it | Li, Zhang, Goldman, *A terradynamics of legged locomotion on granular media*, 2013: generic α_x(π/2, 0) over α_z(0, π/2) |
//! | upward, below soil | 0.25 of it | the same: α_z(0, -π/2) |
//! | cohesion c | 6 c | Skempton, *The bearing capacity of clays*, 1951: round and square footings at the surface |
//! | friction below, along the horizontal | tan φ of the limit below, and c | Coulomb |
//! | friction on the sides, along the vertical | (1 - sin φ) tan φ γ z, and c | Jaky's pressure at rest, 1944 |
//!
//! Soil that is set in motion has a drag of (8/3) tan φ ρ |u| u for each projected area (Katsuragi, Durian, *Drag force scaling for penetration into granular media*, 2013). φ is the angle of repose,
//! and at most 45°: what stands steeper is held by more than friction. Where K is given, tan φ = K/35 everywhere here, at most 1: mud that stands in steep rims is no rough soil.
//!
//! The level is a plane through the columns around those that the body presses, as far as it is wide: a hollow that it has made does not count, its rim does. Depths are
//! exact integrals over the triangles of the body, so they do not depend on where columns are.

use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion};

use crate::press::SKIN;
use crate::resist::{Facet, Resistance};
use crate::tile::QUANTA;
use crate::{Ground, Soil, Vector};

/// The pressure that is held, in weights of the soil above, by the tangent of the angle of repose.
const BEARING: f64 = 35.0;
/// Limits sideways and upward relative to that downward.
const SIDEWAYS: f64 = 0.37;
const UPWARD: f64 = 0.25;
/// The limit of cohesive soil in cohesions.
const COHESIVE: f64 = 6.0;
/// Drag by the tangent of the angle of repose, density, speed squared and area.
const DRAG: f64 = 8.0 / 3.0;
/// m/s², for the density of soil of a weight.
const GRAVITY: f64 = 9.806_65;
/// Distance beyond a side, in cells, at which soil is looked for.
const BESIDE: f64 = 1.5;
/// Most columns around a body, along each axis, that make the level.
const WIDEST: i32 = 64;
/// Times that a step looks for the place of its middle.
const PASSES: usize = 3;
/// A change of the velocity, relative to it, up to which it is found.
const NEAR: f64 = 1e-9;

/// The strength of a soil.
#[derive(Clone, Copy, Debug)]
struct Strength {
    /// Weight in N/m³.
    weight: f64,
    /// The pressure that it holds, in weights of the soil above.
    bearing: f64,
    /// In Pa.
    cohesion: f64,
    friction: f64,
    /// The friction at a side, in weights of the soil above.
    shaft: f64,
}

impl Strength {
    fn of(soil: &Soil) -> Strength {
        let bearing = soil.carries();
        let friction = (bearing / BEARING).min(1.0);
        let angle = libm::atan(friction);
        Strength {
            weight: soil.weight * 1e3,
            bearing,
            cohesion: soil.cohesion * 1e3,
            friction,
            shaft: (1.0 - libm::sin(angle)) * friction,
        }
    }
}

/// The level of the soil around a body: a plane over x and z, in m.
#[derive(Clone, Copy, Debug)]
struct Level {
    middle: [f64; 2],
    height: f64,
    slopes: [f64; 2],
}

impl Level {
    fn at(&self, point: &Vector) -> f64 {
        let [x, z] = self.middle;
        self.height + self.slopes[0] * (point.x - x) + self.slopes[1] * (point.z - z)
    }
}

/// A body in soil, or above it, as it is borne from a tick of the ground on, up to the next one.
#[derive(Clone, Debug)]
pub struct Bearing {
    level: Level,
    strength: Strength,
    /// From the middle of the body.
    points: Vec<Vector>,
    triangles: Arc<[[u32; 3]]>,
    /// How much of the soil at its level is beside each triangle and, if it looks up, above it: 0 to 1.
    gates: Vec<[f64; 2]>,
    /// -1 for a mesh that is inside out.
    side: f64,
    /// The weight in N of what lies on it.
    load: f64,
}

/// The motion of a body's middle: place in m, velocity in m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// In m.
    pub position: Vector,
    /// In m/s.
    pub velocity: Vector,
}

/// How a body turns, and what moves it but for the soil, in a step.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Its turn from the pose of the [`Bearing`], in the middle of the step.
    pub turn: UnitQuaternion<f64>,
    /// In 1/s.
    pub spin: Vector,
    /// The velocity in m/s that it would have at the end without soil.
    pub free: Vector,
    /// The inverse of its mass, in 1/kg.
    pub light: Matrix3<f64>,
}

impl Soil {
    /// The pressure that it holds below a body, in weights of the soil above: K of K γ z. 35 tan φ, φ at most 45°, if nothing is said.
    pub fn carries(&self) -> f64 {
        self.bearing.unwrap_or_else(|| BEARING * libm::tan(self.repose.min(45.0).to_radians()))
    }
}

impl Ground {
    /// How the ground bears a body of an identity and a shape, with its middle somewhere: of closed triangles, as it stands at the present tick.
    pub fn bearing(
        &self,
        id: u64,
        (triangles, points): (&Arc<[[u32; 3]]>, &[Vector]),
        middle: &Vector,
    ) -> Bearing {
        let level = self.level_around(id, points);
        let corners = |triangle: &[u32; 3]| triangle.map(|n| points[n as usize] - middle);
        let volume = |[a, b, c]: [Vector; 3]| a.dot(&b.cross(&c));
        let side = if triangles.iter().map(|t| volume(corners(t))).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        let gate = |corners: &[u32; 3]| self.gates(id, side, corners.map(|n| points[n as usize]), &level);
        Bearing {
            level,
            strength: Strength::of(self.soil()),
            gates: triangles.iter().map(gate).collect(),
            points: points.iter().map(|point| point - middle).collect(),
            triangles: Arc::clone(triangles),
            side,
            load: self.load_on(id),
        }
    }

    /// Whether the soil of a column presses against a body.
    fn is_pressed(&self, column: (i32, i32)) -> bool {
        self.roof(column).saturating_sub(self.top(column.0, column.1)) <= SKIN
    }

    /// The plane through the columns around those that a body presses; of a body that presses none, through those below its lowest points.
    fn level_around(&self, id: u64, points: &[Vector]) -> Level {
        let extent = self.extent();
        let pressed = self.feet.get(&id).map_or(Vec::new(), |foot| {
            let at = foot.undersides.iter().filter(|((i, k), underside)| {
                extent.contains(*i, *k) && underside - self.top(*i, *k) <= SKIN
            });
            at.map(|(column, _)| *column).collect::<Vec<_>>()
        });
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        let mut take = |at: [i32; 2]| {
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(at[axis]), high[axis].max(at[axis]));
            }
        };
        let around = if pressed.is_empty() {
            let lowest = points.iter().map(|point| point.y).fold(f64::INFINITY, f64::min);
            let cell = |at: f64| ((at / self.cell()).clamp(-1e9, 1e9)) as i32;
            let near = points.iter().filter(|point| point.y <= lowest + 0.5 * self.cell());
            near.for_each(|point| take([cell(point.x), cell(point.z)]));
            2
        } else {
            pressed.iter().for_each(|(i, k)| take([*i, *k]));
            let radius = libm::sqrt(pressed.len() as f64 / std::f64::consts::PI);
            (radius.ceil() as i32).clamp(2, WIDEST)
        };
        let inside = |axis: usize, [from, to]: [i32; 2]| {
            let first = low[axis].saturating_sub(around).clamp(from, to);
            first..=high[axis].saturating_add(around).clamp(from, to)
        };
        let (xs, zs) = (inside(0, extent.x), inside(1, extent.z));
        let free = |column: &(i32, i32)| pressed.is_empty() || !self.is_pressed(*column);
        let columns: Vec<(i32, i32)> =
            zs.flat_map(|k| xs.clone().map(move |i| (i, k))).filter(free).collect();
        self.plane(&columns, points)
    }

    /// The plane of least squares through columns; level along an axis along which there is one only.
    fn plane(&self, columns: &[(i32, i32)], points: &[Vector]) -> Level {
        if columns.is_empty() {
            // A body that covers all of the ground.
            let height = points.first().map_or(0.0, |point| self.height(point.x, point.z));
            return Level { middle: [0.0; 2], height, slopes: [0.0; 2] };
        }
        let count = columns.len() as f64;
        let places: Vec<[f64; 3]> = (columns.iter())
            .map(|(i, k)| [f64::from(*i) * self.cell(), self.column(*i, *k), f64::from(*k) * self.cell()])
            .collect();
        let mean = |n: usize| places.iter().map(|place| place[n]).sum::<f64>() / count;
        let [x, height, z] = [0, 1, 2].map(mean);
        let mut sums = [0.0; 5];
        for [px, py, pz] in &places {
            let (dx, dy, dz) = (px - x, py - height, pz - z);
            for (sum, more) in sums.iter_mut().zip([dx * dx, dx * dz, dz * dz, dx * dy, dz * dy]) {
                *sum += more;
            }
        }
        let [xx, xz, zz, xy, zy] = sums;
        let least = 1e-6 * self.cell() * self.cell() * count;
        let determinant = xx * zz - xz * xz;
        let slopes = match (xx > least, zz > least) {
            (true, true) if determinant > 1e-6 * xx * zz => {
                [(xy * zz - zy * xz) / determinant, (zy * xx - xy * xz) / determinant]
            }
            (true, false) => [xy / xx, 0.0],
            (false, true) => [0.0, zy / zz],
            _ => [0.0; 2],
        };
        Level { middle: [x, z], height, slopes }
    }

    /// How much of the soil at its level is beside a triangle and above it.
    fn gates(&self, id: u64, side: f64, [a, b, c]: [Vector; 3], level: &Level) -> [f64; 2] {
        let (centre, across) = ((a + b + c) / 3.0, (b - a).cross(&(c - a)) * side);
        let part = |height: f64, from: f64| {
            let deep = level.at(&centre) - from;
            if deep > 0.0 { ((height - from) / deep).clamp(0.0, 1.0) } else { 1.0 }
        };
        let lowest = a.y.min(b.y).min(c.y);
        if level.at(&centre) <= lowest {
            return [1.0, 0.0];
        }
        let nearest = |at: f64| (at / self.cell()).round().clamp(-1e9, 1e9) as i32;
        let out = libm::hypot(across.x, across.z);
        let mut beside = 1.0;
        if out > 1e-9 * across.norm() {
            let way = BESIDE * self.cell() / out;
            let (x, z) = (centre.x + across.x * way, centre.z + across.z * way);
            if !self.is_pressed((nearest(x), nearest(z))) {
                beside = part(self.height(x, z), lowest);
            }
        }
        let mut above = 0.0;
        if across.y > 0.0 {
            let floors = self.floors.get(&(nearest(centre.x), nearest(centre.z)));
            let own = floors.into_iter().flatten().filter(|floor| floor.body == id && floor.load > 0);
            let load = own.map(|floor| floor.load).max().unwrap_or(0) as f64 / QUANTA * self.cell();
            above = part(centre.y + load, centre.y);
        }
        [beside, above]
    }

    /// The weight in N of what lies on a body.
    fn load_on(&self, id: u64) -> f64 {
        let own = self.floors.values().flatten().filter(|floor| floor.body == id);
        let sum: i128 = own.map(|floor| i128::from(floor.load)).sum();
        sum as f64 / QUANTA * self.cell().powi(3) * self.soil().weight * 1e3
    }
}

/// The integral of the depth over a triangle of an area, where it is not negative, and the area there. The depth is linear.
fn below(area: f64, depths: [f64; 3]) -> [f64; 2] {
    let mean = (depths[0] + depths[1] + depths[2]) / 3.0;
    // The corner triangle at one corner, where the depth has the sign that it has there only.
    let corner = |n: usize| {
        let (own, next, other) = (depths[n], depths[(n + 1) % 3], depths[(n + 2) % 3]);
        let part = area * (own / (own - next)) * (own / (own - other));
        [part * own / 3.0, part]
    };
    let positive = |n: &usize| depths[*n] > 0.0;
    match (0..3).filter(positive).count() {
        0 => [0.0; 2],
        1 => corner((0..3).find(positive).unwrap_or(0)),
        2 => {
            let [integral, part] = corner((0..3).find(|n| !positive(n)).unwrap_or(0));
            [area * mean - integral, area - part]
        }
        _ => [area * mean, area],
    }
}

impl Bearing {
    /// Whether some point is below the level with its middle at a place.
    pub fn is_below(&self, position: &Vector, turn: &UnitQuaternion<f64>) -> bool {
        let is_below = |point: &Vector| {
            let point = position + turn * point;
            point.y < self.level.at(&point)
        };
        self.load > 0.0 || self.points.iter().any(is_below)
    }

    /// The resistance with its middle at a place.
    fn resistance(&self, position: &Vector, turn: &UnitQuaternion<f64>) -> Resistance {
        let Strength { weight, bearing, cohesion, friction, shaft } = self.strength;
        let arms: Vec<Vector> = self.points.iter().map(|point| turn * point).collect();
        let depth = |arm: &Vector| {
            let point = position + arm;
            self.level.at(&point) - point.y
        };
        let depths: Vec<f64> = arms.iter().map(depth).collect();
        let mut facets = Vec::new();
        for (corners, [beside, above]) in self.triangles.iter().zip(&self.gates) {
            let at = corners.map(|n| depths[n as usize]);
            if at.iter().all(|depth| *depth <= 0.0) {
                continue;
            }
            let [a, b, c] = corners.map(|n| arms[n as usize]);
            let across = (b - a).cross(&(c - a)) * self.side;
            let double = across.norm();
            if double == 0.0 {
                continue;
            }
            let [deep, area] = below(0.5 * double, at);
            let out = across / double;
            let limit = bearing * weight * deep + COHESIVE * cohesion * area;
            let upright = if out.y < 0.0 { 1.0 } else { UPWARD * above };
            let push = Vector::new(
                SIDEWAYS * beside * out.x * limit,
                upright * out.y * limit,
                SIDEWAYS * beside * out.z * limit,
            );
            let open = if out.y < 0.0 { 1.0 } else { *above };
            let swept = Vector::new(beside * out.x, open * out.y, beside * out.z) * area;
            let base = (-out.y).max(0.0) * (friction * bearing * weight * deep + cohesion * area);
            let level = libm::hypot(out.x, out.z);
            let shaft = beside * level * (shaft * weight * deep + cohesion * area);
            facets.push(Facet { push, swept, base, shaft, arm: (a + b + c) / 3.0 });
        }
        Resistance { facets, density: DRAG * friction * weight / GRAVITY }
    }

    /// The largest force in N with which the soil resists a motion from rest at a place, by its direction.
    pub fn limit(&self, position: &Vector, direction: &Vector) -> f64 {
        let all = self.resistance(position, &UnitQuaternion::identity());
        direction.try_normalize(0.0).map_or(0.0, |direction| all.power(&direction, &Vector::zeros()).0)
    }

    /// A step of a length in s from where a body is: where it is then, and the impulse of the soil, in N s.
    ///
    /// The resistance is that in the middle of the step, so the error of a step is of third order where a body moves on; where it stops, its place is within a quarter of
    /// the way of the step.
    pub fn step(&self, from: &Stand, drive: &Drive, length: f64) -> (Stand, Vector) {
        let Drive { turn, spin, free, light } = drive;
        // What lies on it has weight.
        let weight = Vector::new(0.0, -self.load * length, 0.0);
        let free = free + light * weight;
        // What rests stays so.
        let (mut velocity, mut impulse) = (from.velocity, Vector::zeros());
        for _ in 0..PASSES {
            let (guess, middle) = (velocity, from.position + (from.velocity + velocity) * (0.25 * length));
            let all = self.resistance(&middle, turn);
            (velocity, impulse) = all.slow((&from.velocity, &free), light, spin, length);
            if (velocity - guess).norm() <= NEAR * (free.norm() + velocity.norm()) {
                break;
            }
        }
        let position = from.position + (from.velocity + velocity) * (0.5 * length);
        (Stand { position, velocity }, impulse + weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_integrated_exactly() {
        // Against many small triangles, which are wholly in or out but for a few.
        let parts = 400;
        for depths in
            [[1.0, -0.5, -2.0], [1.0, 0.7, -0.3], [0.2, 0.5, 0.1], [-1.0, -2.0, -0.1], [0.0, 1.0, -1.0]]
        {
            let [mut deep, mut area] = [0.0; 2];
            for i in 0..parts {
                for j in 0..parts - i {
                    for up in [1.0, 2.0] {
                        let (u, v) = (
                            (f64::from(i) + up / 3.0) / f64::from(parts),
                            (f64::from(j) + up / 3.0) / f64::from(parts),
                        );
                        let depth = depths[0] * (1.0 - u - v) + depths[1] * u + depths[2] * v;
                        if u + v < 1.0 && depth > 0.0 {
                            deep += depth;
                            area += 1.0;
                        }
                    }
                }
            }
            let all = f64::from(parts * parts);
            let [exact, part] = below(2.0, depths);
            assert!((exact - 2.0 * deep / all).abs() < 2e-3, "{exact} {}", 2.0 * deep / all);
            assert!((part - 2.0 * area / all).abs() < 1e-2, "{part} {}", 2.0 * area / all);
        }
    }
}
