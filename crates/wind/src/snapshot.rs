//! The wind at an instant, as a function of place.
//!
//! ```text
//! (x, y, z) ──level──▶ (x, η, z) ──turbulence, ramped at η = 0; mean wind; flows──▶ carried back ──bodies──▶ velocity
//! ```

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use crate::between::Turbulence;
use crate::bodies::Body;
use crate::description::positive;
use crate::eddies::Extremes;
use crate::error::Error;
use crate::field::Setting;
use crate::lattice::{Jet, Lattice, curl, curl_gradient};
use crate::obstacle::{Level, Obstacle, RAMP_SLOPES, ramp};
use crate::primitives::Primitive;

/// The wind at an instant. It is a value of its own: it can be kept, cloned and shared between threads.
///
/// Places are in metres and velocities in m/s. A place that is not finite has a velocity that is not a number.
#[derive(Clone, Debug)]
pub struct Snapshot {
    time: f64,
    turbulence: Turbulence,
    /// By the mean wind.
    pub(crate) carried: Carried,
    mean: Mean,
    flows: Vec<Primitive>,
    bodies: Vec<Body>,
    setting: Arc<Setting>,
    /// It goes on below the ground.
    is_continued: bool,
}

/// What the turbulence of an instant has of the mean wind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Carried {
    /// How far that has come since t = 0, in m.
    pub(crate) drift: f64,
    /// The factor of the velocities of the bands.
    pub(crate) amplitude: f64,
}

/// The mean wind at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mean {
    /// At 10 m, or everywhere.
    velocity: Vector3<f64>,
    /// The roughness length, and 1/ln(10 m/roughness).
    profile: Option<(f64, f64)>,
}

impl Mean {
    pub(crate) fn new(velocity: Vector3<f64>, roughness: Option<f64>) -> Mean {
        Mean { velocity, profile: roughness.map(|length| (length, 1.0 / libm::log(10.0 / length))) }
    }

    /// The speed at a height relative to that at 10 m, and its derivative.
    fn share(&self, height: f64) -> [f64; 2] {
        match self.profile {
            None => [1.0, 0.0],
            Some((length, _)) if height <= length => [0.0, 0.0],
            Some((length, factor)) => [factor * libm::log(height / length), factor / height],
        }
    }

    /// The horizontal part at a height, which has a vector potential, and the vertical part, which the ground turns aside otherwise.
    fn parts(&self, height: f64) -> (Vector3<f64>, f64) {
        let [share, _] = self.share(height);
        (Vector3::new(self.velocity.x * share, 0.0, self.velocity.z * share), self.velocity.y)
    }

    /// A potential of the horizontal part at a height, and its derivative with the height.
    fn potential(&self, height: f64) -> [Vector3<f64>; 2] {
        // curl (F(η) e) = F' y × e, and y × (v × y) = v for horizontal v.
        let across = Vector3::new(-self.velocity.z, 0.0, self.velocity.x);
        let [share, _] = self.share(height);
        let integral = match self.profile {
            None => height,
            Some((length, _)) if height <= length => 0.0,
            Some((length, factor)) => height * share - factor * (height - length),
        };
        [across * integral, across * share]
    }
}

/// What is known of the wind at a place before bodies have turned it aside.
pub(crate) struct Stream {
    /// All of the velocity.
    pub(crate) velocity: Vector3<f64>,
    /// The part that is not the curl of the potential.
    pub(crate) rest: Vector3<f64>,
}

impl Snapshot {
    pub(crate) fn new(
        time: f64,
        (turbulence, carried): (Turbulence, Carried),
        mean: Mean,
        flows: Vec<Primitive>,
        setting: Arc<Setting>,
    ) -> Result<Snapshot, Error> {
        let (bodies, is_continued) = (Vec::new(), false);
        let snapshot = Snapshot { time, turbulence, carried, mean, flows, bodies, setting, is_continued };
        let setting = Arc::clone(&snapshot.setting);
        snapshot.among(&setting.obstacles)
    }

    /// Lattices without a mean wind, flows and bodies, which go on below the ground.
    pub(crate) fn of_turbulence(time: f64, lattices: Vec<Lattice>, setting: Arc<Setting>) -> Snapshot {
        let mean = Mean::new(Vector3::zeros(), None);
        let (turbulence, carried) = (Turbulence::At(lattices.into()), Carried::default());
        let (flows, bodies) = (Vec::new(), Vec::new());
        Snapshot { time, turbulence, carried, mean, flows, bodies, setting, is_continued: true }
    }

    /// The same wind with further bodies in it, as they are at this instant. The wind at the centre of each is that without any body.
    ///
    /// # Errors
    ///
    /// A centre, a velocity or a rotation that is not finite, or a layer without a thickness.
    pub fn among(&self, obstacles: &[Arc<dyn Obstacle>]) -> Result<Snapshot, Error> {
        let mut snapshot = self.clone();
        for (i, obstacle) in obstacles.iter().enumerate() {
            let time = self.time;
            positive("the thickness of the layer around an obstacle", obstacle.layer())?;
            let [centre, velocity, spin] =
                [obstacle.centre(time), obstacle.velocity(time), obstacle.spin(time)];
            let values = centre.iter().chain(&velocity).chain(&spin);
            if let Some(value) = values.copied().find(|value| !value.is_finite()) {
                let name = format!("the centre or the velocity of obstacle {}", i + 1);
                return Err(Error::NotFinite { name, time, value });
            }
            snapshot.bodies.push(Body::new(obstacle, time, self));
        }
        Ok(snapshot)
    }

    /// The time in seconds, within the period of a wind that has one.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The same with the first lattices only. The wind at the centres of bodies is that of all.
    pub(crate) fn with_lattices(&self, count: usize) -> Snapshot {
        Snapshot { turbulence: self.turbulence.first(count), ..self.clone() }
    }

    /// The lattices of the turbulence, or those of an instant near it.
    pub(crate) fn lattices(&self) -> &[Lattice] {
        self.turbulence.lattices()
    }

    /// The bands of the turbulence, with the thickness of the layer in which each turns aside over the ground.
    fn layers(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.setting.layers.iter().copied().take(self.lattices().len()).enumerate()
    }

    /// The turbulence, if it is that of this instant.
    pub(crate) fn exact(&self) -> Option<&Arc<[Lattice]>> {
        match &self.turbulence {
            Turbulence::At(lattices) => Some(lattices),
            Turbulence::Between(_) => None,
        }
    }

    /// The level of a place over the ground; without ground, that over y = 0.
    fn level(&self, x: Vector3<f64>) -> Level {
        match &self.setting.ground {
            Some(ground) => ground.level(x, self.time),
            None => Level { eta: x.y, slope: Vector3::y() },
        }
    }

    fn ends_at_ground(&self) -> bool {
        self.setting.ground.is_some() && !self.is_continued
    }

    /// Bounds of the turbulence, or of how far it is from that at another instant, over flat ground or without any.
    ///
    /// A difference of differences is at most twice as large as those, so that each derivative of a spline is at most twice the one before over the
    /// spacing, along an axis of the lattice, and √3 times that along any direction.
    pub(crate) fn extremes(&self, before: Option<&Snapshot>) -> Extremes {
        let mut sum = [0.0; 3];
        for (i, (lattice, layer)) in self.lattices().iter().zip(self.setting.layers).enumerate() {
            let [speed, potential] = lattice.extremes(before.and_then(|before| before.lattices().get(i)));
            let finer = 2.0 * f64::sqrt(3.0) / lattice.spacing();
            let [slope, bend] = [speed * finer, speed * finer * finer];
            let mut of = [speed, slope, bend];
            if self.setting.ground.is_some() {
                // Derivatives of a product with the ramp.
                let [a, b, c] = RAMP_SLOPES;
                let [a, b, c] = [a / layer, b / (layer * layer), c / (layer * layer * layer)];
                of[0] += a * potential;
                of[1] += 2.0 * a * speed + b * potential;
                of[2] += 3.0 * a * slope + 3.0 * b * speed + c * potential;
            }
            for (sum, of) in sum.iter_mut().zip(of) {
                *sum += of;
            }
        }
        Extremes(sum)
    }

    /// α and its derivative at a height in a layer; 1 where there is no ground.
    fn ground_ramp(&self, height: f64, layer: f64) -> [f64; 3] {
        if self.setting.ground.is_none() || height >= layer {
            return [1.0, 0.0, 0.0];
        }
        let [value, slope, bend] = ramp(height / layer);
        [value, slope / layer, bend / (layer * layer)]
    }

    /// The velocity of the air.
    pub fn velocity(&self, x: Vector3<f64>) -> Vector3<f64> {
        let mut near = self.bodies.iter().filter_map(|body| {
            let distance = body.obstacle.distance(x, self.time);
            (distance < body.layer).then_some((body, distance))
        });
        let Some(first) = near.next() else { return self.stream(x).velocity };
        let stream = self.stream(x);
        let potential = self.potential(x);
        let mut velocity = stream.velocity;
        for (body, distance) in std::iter::once(first).chain(near) {
            if distance < 0.0 {
                return body.velocity_at(x);
            }
            velocity -= body.turn_aside(self.time, x, distance, potential, stream.rest);
        }
        velocity
    }

    /// The velocity without bodies.
    pub(crate) fn stream(&self, x: Vector3<f64>) -> Stream {
        let level = self.level(x);
        if level.eta < 0.0 && self.ends_at_ground() {
            return Stream { velocity: Vector3::zeros(), rest: Vector3::zeros() };
        }
        let flat = Vector3::new(x.x, level.eta, x.z);
        let mut curled = Vector3::zeros();
        for (band, layer) in self.layers() {
            let [value, slope, _] = self.ground_ramp(level.eta, layer);
            if value == 1.0 {
                curled += self.turbulence.velocity(band, flat);
                continue;
            }
            let (a, first) = self.turbulence.potential(band, flat);
            curled += curl(&ramped(&first, a, value, slope));
        }
        let (horizontal, vertical) = self.mean.parts(level.eta);
        let mut rest = Vector3::new(0.0, vertical, 0.0);
        for flow in &self.flows {
            rest += flow.velocity(flat);
        }
        rest.y *= self.ground_ramp(level.eta, self.setting.layer)[0];
        let rest = level.carry(rest);
        Stream { velocity: level.carry(curled + horizontal) + rest, rest }
    }

    /// The potential of turbulence and horizontal mean wind, and its derivatives.
    pub(crate) fn potential(&self, x: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        if self.setting.ground.as_ref().is_none_or(|ground| ground.is_flat()) {
            return self.flat_potential(x);
        }
        let carried = |x: Vector3<f64>| {
            let level = self.level(x);
            let flat = Vector3::new(x.x, level.eta, x.z);
            level.carry_potential(self.potential_over_flat(flat, level.eta).0)
        };
        let step = self.step();
        let columns: [Vector3<f64>; 3] = std::array::from_fn(|j| {
            let offset = Vector3::ith(j, step);
            (carried(x + offset) - carried(x - offset)) / (2.0 * step)
        });
        (carried(x), Matrix3::from_columns(&columns))
    }

    fn flat_potential(&self, x: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let level = self.level(x);
        self.potential_over_flat(Vector3::new(x.x, level.eta, x.z), level.eta)
    }

    fn potential_over_flat(&self, x: Vector3<f64>, height: f64) -> (Vector3<f64>, Matrix3<f64>) {
        let (mut value, mut first) = (Vector3::zeros(), Matrix3::zeros());
        for (band, layer) in self.layers() {
            let [share, slope, _] = self.ground_ramp(height, layer);
            let (a, derivatives) = self.turbulence.potential(band, x);
            value += Vector3::new(a.x * share, a.y, a.z * share);
            first += ramped(&derivatives, a, share, slope);
        }
        let [potential, slope] = self.mean.potential(height);
        first.set_column(1, &(first.column(1) + slope));
        (value + potential, first)
    }

    /// The velocity of the air and its derivatives in 1/s: row i, column j is ∂u_i/∂x_j.
    ///
    /// Derivatives are exact in free air and over flat ground. In the layer of a body and over uneven ground they are central
    /// differences, with a relative error of about 1e-6.
    pub fn velocity_and_gradient(&self, x: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let velocity = self.velocity(x);
        let flat = self.setting.ground.as_ref().is_none_or(|ground| ground.is_flat());
        let step = self.step();
        let near = |body: &Body| body.obstacle.distance(x, self.time) < body.layer + step;
        if flat && !self.bodies.iter().any(near) {
            return (velocity, self.free_gradient(x));
        }
        let columns: [Vector3<f64>; 3] = std::array::from_fn(|j| {
            let offset = Vector3::ith(j, step);
            (self.velocity(x + offset) - self.velocity(x - offset)) / (2.0 * step)
        });
        (velocity, Matrix3::from_columns(&columns))
    }

    /// The step of central differences in metres.
    fn step(&self) -> f64 {
        let smallest = self.lattices().last().map_or(self.setting.layer, Lattice::spacing);
        1e-4 * self.bodies.iter().map(|body| body.layer).fold(smallest, f64::min)
    }

    /// The derivatives of the velocity over flat ground or without any.
    fn free_gradient(&self, x: Vector3<f64>) -> Matrix3<f64> {
        let height = self.level(x).eta;
        if height < 0.0 && self.ends_at_ground() {
            return Matrix3::zeros();
        }
        let flat = Vector3::new(x.x, height, x.z);
        let mut gradient = Matrix3::zeros();
        for (band, layer) in self.layers() {
            let mut jet = self.turbulence.jet(band, flat);
            let [value, slope, bend] = self.ground_ramp(height, layer);
            if value != 1.0 {
                ramp_second(&mut jet, value, slope, bend);
            }
            gradient += curl_gradient(&jet.second);
        }
        let [_, slope] = self.mean.share(height);
        gradient[(0, 1)] += self.mean.velocity.x * slope;
        gradient[(2, 1)] += self.mean.velocity.z * slope;
        let (mut rest, mut vertical) = (Matrix3::zeros(), self.mean.velocity.y);
        for flow in &self.flows {
            rest += flow.gradient(flat);
            vertical += flow.velocity(flat).y;
        }
        let [value, slope, _] = self.ground_ramp(height, self.setting.layer);
        rest.row_mut(1).scale_mut(value);
        rest[(1, 1)] += slope * vertical;
        gradient + rest
    }

    /// The velocities at a list of places.
    pub fn velocities(&self, places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        places.iter().map(|x| self.velocity(*x)).collect()
    }
}

/// Derivatives of (αA_x, A_y, αA_z), with α a function of y.
fn ramped(first: &Matrix3<f64>, a: Vector3<f64>, value: f64, slope: f64) -> Matrix3<f64> {
    let mut ramped = *first;
    for i in [0, 2] {
        ramped.row_mut(i).scale_mut(value);
        ramped[(i, 1)] += slope * a[i];
    }
    ramped
}

/// The same for second derivatives.
fn ramp_second(jet: &mut Jet, value: f64, slope: f64, bend: f64) {
    for i in [0, 2] {
        let mut second = jet.second[i] * value;
        for j in 0..3 {
            second[(1, j)] += slope * jet.first[(i, j)];
            second[(j, 1)] += slope * jet.first[(i, j)];
        }
        second[(1, 1)] += bend * jet.value[i];
        jet.second[i] = second;
    }
}

/// Places on a regular grid, x fastest, then y, then z: `counts` along each axis, from one corner to the other, both included. An axis
/// with one place has it at `from`.
///
/// # Examples
///
/// ```
/// use dlsys_wind::grid;
/// use nalgebra::Vector3;
///
/// let places = grid(Vector3::zeros(), Vector3::new(1.0, 0.0, 3.0), [3, 1, 2]);
/// assert_eq!(places.len(), 6);
/// assert_eq!(places[1], Vector3::new(0.5, 0.0, 0.0));
/// assert_eq!(places[3], Vector3::new(0.0, 0.0, 3.0));
/// ```
pub fn grid(from: Vector3<f64>, to: Vector3<f64>, counts: [usize; 3]) -> Vec<Vector3<f64>> {
    let step = |i: usize| (to[i] - from[i]) / (counts[i].max(2) - 1) as f64;
    let steps = [step(0), step(1), step(2)];
    let place = |i: usize, index: usize| from[i] + steps[i] * index as f64;
    (0..counts[2])
        .flat_map(|z| (0..counts[1]).flat_map(move |y| (0..counts[0]).map(move |x| [x, y, z])))
        .map(|[x, y, z]| Vector3::new(place(0, x), place(1, y), place(2, z)))
        .collect()
}
