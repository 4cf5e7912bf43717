//! A stem that is let go: our chain of arcs, and Rapier's multibody, a chain of rods with hinges.
//!
//! A uniform stem of 1 m, clamped at one end and level, falls under its weight for a second (its first period is 0.9 s). Hinges stand in the
//! middle of the pieces whose bending they stand for, so that both chains approach the beam with the square of the length of a piece. The
//! error is the largest distance of the tip from that of a fine chain of arcs at ten times; Rapier agrees with it to 3e-4, so neither
//! program is its own judge.

use std::time::Instant;

use dlsys_sway::{Error, Fixed, Pose, Segment, Settings, Skeleton, Solver, State, Vector};
use rapier3d_f64::prelude as rapier;

/// Diameter in m, Young's modulus in Pa, density in kg/m³: the tip of the stem at rest hangs 0.29 m lower.
const DIAMETER: f64 = 0.01;
const STIFFNESS: f64 = 5.9e8;
const DENSITY: f64 = 900.0;
/// Times at which the tip is compared, and the time between them in s.
const OUTPUTS: usize = 10;
const BETWEEN: f64 = 0.1;

/// The stem's tip at the times of comparison, and what it cost.
#[derive(Clone, Debug)]
pub struct Run {
    pub tip: Vec<[f64; 2]>,
    pub steps: usize,
    pub seconds: f64,
}

impl Run {
    /// The largest distance of the tip, in m; not a number where a run left the numbers.
    pub fn error(&self, reference: &Run) -> f64 {
        let distance = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
        let distances = self.tip.iter().zip(&reference.tip).map(distance);
        distances.fold(0.0, |most, next| if next > most || next.is_nan() { next } else { most })
    }
}

/// Our solver, with a tolerance for each step and a damping time in s.
pub fn arcs(pieces: usize, tolerance: f64, damping: f64) -> Result<Run, Error> {
    let mut skeleton = Skeleton::new();
    for i in 0..pieces {
        let piece = Segment::solid(i.checked_sub(1), 1.0 / pieces as f64, DIAMETER, STIFFNESS, DENSITY);
        skeleton.push(Segment { damping, drag_diameter: 0.0, ..piece });
    }
    let still = |_: Vector, _: f64| Vector::zeros();
    let (mut state, mut tip, mut steps) = (State::at_rest(&skeleton), Vec::new(), 0);
    let mut solver = Solver::new(Settings { tolerance, ..Settings::default() });
    let begun = Instant::now();
    for output in 0..OUTPUTS {
        let (from, to) = (output as f64 * BETWEEN, (output + 1) as f64 * BETWEEN);
        solver.advance(&mut state, from, to, &mut Fixed(&skeleton), &still, |_| steps += 1)?;
        let point = Pose::new(&skeleton, &state.strain).point(pieces - 1, 1.0);
        tip.push([point.x, point.y]);
    }
    Ok(Run { tip, steps, seconds: begun.elapsed().as_secs_f64() })
}

/// How a hinge of Rapier's holds against bending.
#[derive(Clone, Copy, Debug)]
pub enum Hinge {
    /// A torque that is computed from the angle before each step.
    Torque,
    /// The joint's own motor as a spring, which Rapier's iteration solves implicitly, with a damping time in s and a number of inner
    /// iterations.
    Motor { damping: f64, iterations: usize },
}

/// Rapier's multibody with steps of `step` seconds, of which at most `most` are made between two times of comparison.
pub fn rods(pieces: usize, hinge: Hinge, step: f64, most: usize) -> Run {
    let mut stem = Rods::new(pieces, hinge, step);
    let between = ((BETWEEN / step).round() as usize).min(most);
    let mut tip = Vec::new();
    let begun = Instant::now();
    for _ in 0..OUTPUTS {
        for _ in 0..between {
            stem.step();
        }
        tip.push(stem.tip());
    }
    Run { tip, steps: OUTPUTS * between, seconds: begun.elapsed().as_secs_f64() }
}

struct Rods {
    /// The fixed body, and the rods.
    links: Vec<rapier::RigidBodyHandle>,
    /// Nm for a radian at a hinge, where a torque holds it.
    spring: Option<f64>,
    /// The end of the last rod, in its own axes.
    end: rapier::Vector,
    parameters: rapier::IntegrationParameters,
    pipeline: rapier::PhysicsPipeline,
    islands: rapier::IslandManager,
    broad: rapier::DefaultBroadPhase,
    narrow: rapier::NarrowPhase,
    bodies: rapier::RigidBodySet,
    colliders: rapier::ColliderSet,
    impulses: rapier::ImpulseJointSet,
    joints: rapier::MultibodyJointSet,
    continuous: rapier::CCDSolver,
    /// Angles of the links, kept for its memory.
    angles: Vec<f64>,
}

impl Rods {
    fn new(pieces: usize, hinge: Hinge, step: f64) -> Rods {
        let length = 1.0 / pieces as f64;
        let area = std::f64::consts::PI * DIAMETER * DIAMETER / 4.0;
        let spring = STIFFNESS * area * DIAMETER * DIAMETER / 16.0 / length;
        let along = |x: f64| rapier::Vector::new(x, 0.0, 0.0);
        let (mut bodies, mut joints) = (rapier::RigidBodySet::new(), rapier::MultibodyJointSet::new());
        let mut links = vec![bodies.insert(rapier::RigidBodyBuilder::fixed())];
        for i in 0..pieces {
            // The first half of the first piece is clamped, the second half of the last one is free.
            let rod = if i + 1 == pieces { 0.5 * length } else { length };
            let mass = DENSITY * area * rod;
            let (about, across) = (mass * DIAMETER * DIAMETER / 8.0, mass * rod * rod / 12.0);
            let inertia = rapier::Vector::new(about, across, across);
            let body = rapier::RigidBodyBuilder::dynamic()
                .translation(along((i as f64 + 0.5) * length))
                .can_sleep(false)
                .additional_mass_properties(rapier::MassProperties::new(along(0.5 * rod), mass, inertia));
            let before = if i == 0 { 0.5 * length } else { length };
            let mut joint = rapier::RevoluteJointBuilder::new(rapier::Vector::new(0.0, 0.0, 1.0))
                .local_anchor1(along(before))
                .local_anchor2(along(0.0));
            if let Hinge::Motor { damping, .. } = hinge {
                joint = joint.motor_model(rapier::MotorModel::ForceBased).motor_position(
                    0.0,
                    spring,
                    spring * damping,
                );
            }
            let (parent, link) = (links[i], bodies.insert(body));
            links.push(link);
            if let Some(handle) = joints.insert(parent, link, joint.build(), true)
                && let Some((multibody, _)) = joints.get_mut(handle)
            {
                // Otherwise every joint is damped as if it stood in syrup.
                multibody.damping_mut().fill(0.0);
            }
        }
        let mut parameters = rapier::IntegrationParameters { dt: step, ..Default::default() };
        parameters.num_solver_iterations = 1;
        if let Hinge::Motor { iterations, .. } = hinge {
            parameters.num_internal_pgs_iterations = iterations;
        }
        Rods {
            links,
            spring: matches!(hinge, Hinge::Torque).then_some(spring),
            end: along(0.5 * length),
            parameters,
            pipeline: rapier::PhysicsPipeline::new(),
            islands: rapier::IslandManager::new(),
            broad: rapier::DefaultBroadPhase::new(),
            narrow: rapier::NarrowPhase::new(),
            bodies,
            colliders: rapier::ColliderSet::new(),
            impulses: rapier::ImpulseJointSet::new(),
            joints,
            continuous: rapier::CCDSolver::new(),
            angles: Vec::new(),
        }
    }

    fn step(&mut self) {
        if let Some(spring) = self.spring {
            self.bend(spring);
        }
        self.pipeline.step(
            rapier::Vector::new(0.0, -9.81, 0.0),
            &self.parameters,
            &mut self.islands,
            &mut self.broad,
            &mut self.narrow,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulses,
            &mut self.joints,
            &mut self.continuous,
            &(),
            &(),
        );
    }

    /// Torques at the hinges, equal and opposite on both links.
    fn bend(&mut self, spring: f64) {
        self.angles.clear();
        for link in &self.links {
            let rotation = self.bodies[*link].rotation();
            self.angles.push(2.0 * rotation.z.atan2(rotation.w));
            self.bodies[*link].reset_torques(true);
        }
        for (i, pair) in self.angles.windows(2).enumerate() {
            let torque = spring * (pair[1] - pair[0]);
            self.bodies[self.links[i + 1]].add_torque(rapier::Vector::new(0.0, 0.0, -torque), true);
            self.bodies[self.links[i]].add_torque(rapier::Vector::new(0.0, 0.0, torque), true);
        }
    }

    fn tip(&self) -> [f64; 2] {
        self.links.last().map_or([f64::NAN; 2], |link| {
            let point = self.bodies[*link].position().transform_point(self.end);
            [point.x, point.y]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten rods and ten arcs are the same stem, up to the length of their pieces.
    #[test]
    fn both_chains_are_the_same_stem() {
        let (Ok(fine), Ok(ours)) = (arcs(80, 1e-6, 0.0), arcs(10, 1e-5, 0.0)) else { panic!("refused") };
        let theirs = rods(10, Hinge::Torque, 2.5e-4, usize::MAX);
        assert!(ours.error(&fine) < 1e-2, "{}", ours.error(&fine));
        assert!(theirs.error(&fine) < 1e-2, "{}", theirs.error(&fine));
    }
}
