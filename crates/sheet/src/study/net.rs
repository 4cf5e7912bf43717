//! The ball and the net of O'Brien, Zordan and Hodgins: a ball of 0.68 kg, a net of 0.03 kg.

use crate::{Error, Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Step, Still, Tissue, Vector};

/// How the ball is coupled with the net.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coupling {
    /// Both act on each other.
    TwoWay,
    /// The ball flies as if there were no net.
    OneWay,
}

/// A ball in a net: places and forces at ticks of 1/60 s.
#[derive(Clone, Debug)]
pub struct Catch {
    /// Places of the ball in m.
    pub ball: Vec<Vector>,
    /// Places of all points of the net in m.
    pub net: Vec<Vec<Vector>>,
    /// Force of the net on the ball in N, the mean of each tick.
    pub forces: Vec<f64>,
    /// Steps, and steps that were rejected.
    pub steps: [u64; 2],
    /// The largest depth of the net in the ball in m.
    pub depth: f64,
}

/// Mass of the ball and of the net in kg, and radius of the ball and of the hoop in m.
const BALL: f64 = 0.68;
const NET: f64 = 0.03;
const RADIUS: f64 = 0.12;
const HOOP: f64 = 0.225;
/// Hooks at the hoop; rows of meshes; height of the net in m.
const HOOKS: usize = 12;
const ROWS: usize = 6;
const HEIGHT: f64 = 0.42;
/// A tick in s.
const TICK: f64 = 1.0 / 60.0;

/// The net of a hoop at height 0, with an open or a closed end of this radius in m.
///
/// # Errors
///
/// A radius at which cords have no length.
pub fn hoop_net(end: f64) -> Result<Sheet, Error> {
    let mut mesh = Mesh::default();
    for row in 0..=ROWS {
        let down = row as f64 / ROWS as f64;
        let radius = HOOP + (end - HOOP) * down.sqrt();
        for hook in 0..HOOKS {
            let turn = std::f64::consts::TAU * (hook as f64 + 0.5 * row as f64) / HOOKS as f64;
            let place = Vector::new(radius * libm::cos(turn), -HEIGHT * down, radius * libm::sin(turn));
            mesh.points.push(place);
        }
    }
    for row in 0..ROWS {
        for hook in 0..HOOKS {
            let (own, below) = (row * HOOKS + hook, (row + 1) * HOOKS);
            mesh.cords.push([own, below + hook]);
            mesh.cords.push([own, below + (hook + HOOKS - 1) % HOOKS]);
        }
    }
    let last = ROWS * HOOKS;
    mesh.cords.extend((0..HOOKS).map(|hook| [last + hook, last + (hook + 1) % HOOKS]));
    let length: f64 = mesh.cords.iter().map(|&[a, b]| (mesh.points[a] - mesh.points[b]).norm()).sum();
    let width = 3e-3_f64;
    let density = NET / (length * std::f64::consts::FRAC_PI_4 * width * width);
    Sheet::new(&mesh, &Tissue { damping: 0.1, ..Tissue::new(5e6, density, width) }, |point| point.y == 0.0)
}

/// A ball that is thrown into the net, for 0.7 s. The closer the end of the net, the farther the ball must stretch it, or is stopped.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn catch(coupling: Coupling, end: f64, settings: Settings) -> Result<Catch, Error> {
    let sheet = hoop_net(end)?;
    let shape = Shape::ball(RADIUS)?;
    let (from, speed) = (Vector::new(-0.05, 0.3, 0.02), Vector::new(0.3, -2.5, 0.1));
    let gravity = settings.air.gravity;
    let flight = move |time: f64| {
        let place = from + speed * time + gravity * (0.5 * time * time);
        Place::at(place).moving(speed + gravity * time)
    };
    let mut state = State::at_rest(&sheet);
    let solids = match coupling {
        Coupling::TwoWay => [Solid::free_ball(&shape, BALL)],
        Coupling::OneWay => [Solid::guided(&shape, &flight)],
    };
    if coupling == Coupling::TwoWay {
        state.bodies.push(flight(0.0));
    }
    let mut solver = Solver::new(settings);
    let (mut ball, mut net, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    let mut depth = 0.0_f64;
    let ticks = 42;
    // Ticks of less than a step share its force; they are at multiples of both.
    let stride = (settings.longest / TICK).round().max(1.0) as usize;
    for tick in (stride..=ticks).step_by(stride) {
        let (start, time) = ((tick - stride) as f64 * TICK, tick as f64 * TICK);
        let pushes = solver.advance(&sheet, &mut state, start..time, &solids, &Still, |step: &Step| {
            depth = depth.max(step.depths[0]);
        })?;
        forces.push(pushes[0].impulse.norm() / (time - start));
        ball.push(state.bodies.first().map_or(flight(time).position, |body| body.position));
        net.push(state.positions.clone());
    }
    let counts = solver.counts();
    Ok(Catch { ball, net, forces, steps: [counts.steps, counts.rejected], depth })
}

impl Catch {
    /// Least, largest and mean force in N over the ticks in which ball and net touch, and the accelerations of the ball in m/s²: the columns of the
    /// paper's table I.
    pub fn table(&self) -> [[f64; 3]; 2] {
        let touching: Vec<f64> = self.forces.iter().copied().filter(|force| *force > 0.0).collect();
        let sum = |of: fn(f64, f64) -> f64, start: f64| touching.iter().copied().fold(start, of);
        let count = touching.len().max(1) as f64;
        let least = if touching.is_empty() { 0.0 } else { sum(f64::min, f64::INFINITY) };
        let forces = [least, sum(f64::max, 0.0), sum(|a, b| a + b, 0.0) / count];
        [forces, forces.map(|force| force / BALL)]
    }

    /// Largest distance of the ball, and of any point of the net, from the places in another catch at the same times, in m.
    pub fn distance(&self, other: &Catch) -> [f64; 2] {
        let stride = (other.ball.len() / self.ball.len().max(1)).max(1);
        let mut far = [0.0_f64; 2];
        for k in 0..self.ball.len() {
            let Some(place) = other.ball.get((k + 1) * stride - 1) else { break };
            far[0] = far[0].max((self.ball[k] - place).norm());
            for (a, b) in self.net[k].iter().zip(&other.net[(k + 1) * stride - 1]) {
                far[1] = far[1].max((a - b).norm());
            }
        }
        far
    }
}

/// The catch with steps of one length, coupled both ways: length of the step (s), and largest errors of the ball and of any point of the net (m) against a
/// tolerance of 1e-4.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn throw_steps(end: f64) -> Result<Vec<(f64, [f64; 2], Catch)>, Error> {
    let exact = catch(Coupling::TwoWay, end, Settings { tolerance: 1e-4, ..Settings::default() })?;
    let mut rows = Vec::new();
    for step in [TICK / 16.0, TICK / 32.0, TICK / 64.0] {
        let found =
            catch(Coupling::TwoWay, end, Settings { longest: step, fixed: true, ..Settings::default() })?;
        rows.push((step, found.distance(&exact), found));
    }
    Ok(rows)
}
