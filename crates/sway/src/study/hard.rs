//! Hard cases: what makes other solvers fail or creep.

use std::f64::consts::PI;

use super::stem;
use crate::{Error, Fixed, Joint, Pose, Segment, Settings, Skeleton, Solver, State, Vector, upright};

/// The outcome of a hard case at the default settings.
#[derive(Clone, Debug, PartialEq)]
pub struct HardCase {
    /// What is hard.
    pub case: &'static str,
    /// Time simulated, in s.
    pub span: f64,
    /// Steps accepted.
    pub steps: u64,
    /// Steps rejected.
    pub rejected: u64,
    /// Shortest step, in s.
    pub shortest: f64,
    /// Largest distance of an end of a segment from its rest place, relative to the extent.
    pub moved: f64,
    /// Largest distance of a tip at the end from that with a tolerance a hundred times smaller, relative to the extent; `None` where that
    /// was not computed.
    pub error: Option<f64>,
    /// The error that ended the run, if one did.
    pub failure: Option<Error>,
}

/// A run: outcome, and the pose at the end.
fn run(
    case: &'static str,
    skeleton: &Skeleton,
    span: f64,
    tolerance: f64,
    wind: &impl Fn(Vector, f64) -> Vector,
) -> (HardCase, Pose) {
    let mut state = State::at_rest(skeleton);
    let mut solver = Solver::new(Settings { tolerance, ..Settings::default() });
    let rest = Pose::new(skeleton, &state.strain);
    let mut pose = Pose::default();
    let (mut shortest, mut moved) = (f64::INFINITY, 0.0_f64);
    let extent = skeleton.extent();
    let outcome = solver.advance(&mut state, 0.0, span, &mut Fixed(skeleton), wind, |step| {
        shortest = shortest.min(step.to - step.from);
        pose.set(skeleton, &step.after.strain);
        for index in 0..pose.len() {
            moved = moved.max((pose.point(index, 1.0) - rest.point(index, 1.0)).norm() / extent);
        }
    });
    let counts = solver.counts();
    let failure = outcome.err();
    let (steps, rejected) = (counts.steps, counts.rejected);
    (HardCase { case, span, steps, rejected, shortest, moved, error: None, failure }, pose)
}

/// The same with its error against a smaller tolerance.
fn compared(
    case: &'static str,
    skeleton: &Skeleton,
    span: f64,
    wind: &impl Fn(Vector, f64) -> Vector,
) -> HardCase {
    let tolerance = Settings::default().tolerance;
    let (mut outcome, pose) = run(case, skeleton, span, tolerance, wind);
    let (finer, reference) = run(case, skeleton, span, tolerance / 100.0, wind);
    if outcome.failure.is_none() && finer.failure.is_none() {
        let distance = |index| (pose.point(index, 1.0) - reference.point(index, 1.0)).norm();
        let most = (0..pose.len()).map(distance).fold(0.0, f64::max);
        outcome.error = Some(most / skeleton.extent());
    }
    outcome
}

/// A stem with damping and drag.
fn plant(n: usize, length: f64, diameter: f64, stiffness: f64) -> Skeleton {
    let mut skeleton = stem(n, length, diameter, stiffness, 900.0, true);
    for segment in skeleton.segments_mut() {
        segment.damping = 0.05 / PI;
        segment.drag_diameter = segment.diameter;
        segment.sag = false;
    }
    skeleton
}

/// All hard cases: grass in a storm, newborn segments, hair, a stiffness of 1e13 Pa, wind that turns round within a step, a stem just below
/// Greenhill's length, a division at every step, a chain of `chain` segments (10⁴ in the report).
pub fn hard_cases(chain: usize) -> Vec<HardCase> {
    let storm =
        |_: Vector, time: f64| Vector::new(40.0 + 8.0 * (9.0 * time).sin(), 0.0, 5.0 * (4.0 * time).cos());
    let breeze = |_: Vector, time: f64| Vector::new(3.0 + (5.0 * time).sin(), 0.0, (3.0 * time).cos());
    let flip =
        |_: Vector, time: f64| Vector::new(if (time * 2.3).fract() < 0.5 { 8.0 } else { -8.0 }, 0.0, 0.0);
    let grass = plant(10, 0.25, 5e-4, 1e9);
    let stem = plant(12, 0.6, 4e-3, 1e9);
    let mut newborn = stem.clone();
    for parent in [11, 5, 5] {
        let segment = Segment { length: 1e-12, ..newborn.segments()[parent] };
        let joint = Joint::fixed(upright(), Vector::zeros());
        let twig = newborn.push(Segment { parent: Some(parent), joint, ..segment });
        newborn.push(Segment { parent: Some(twig), joint: Joint::default(), ..segment });
    }
    let mut hair = stem.clone();
    for parent in [3, 7, 11] {
        let segment = Segment {
            diameter: 1e-6,
            drag_diameter: 1e-6,
            ..Segment::solid(Some(parent), 0.02, 1e-6, 1e9, 900.0)
        };
        let twig = hair.push(Segment { damping: 0.01, ..segment });
        hair.push(Segment { parent: Some(twig), damping: 0.01, ..segment });
    }
    let mut mixed = stem.clone();
    for segment in mixed.segments_mut().iter_mut().step_by(3) {
        segment.stiffness = 1e13;
    }
    let gram = 900.0 * PI * 1e-4 / 4.0 * 9.81;
    let edge = gram / (super::rigidity(0.01, 1.0) * 7.837_347 / 0.99_f64.powi(-3)).abs();
    let mut slender = plant(20, 1.0, 0.01, edge);
    slender.segments_mut().iter_mut().for_each(|segment| segment.sag = true);
    let draught = |_: Vector, time: f64| Vector::new(0.2 * time.sin(), 0.0, 0.0);
    vec![
        compared("grass of 0.5 mm at 40 m/s", &grass, 2.0, &storm),
        compared("newborn segments of 1e-12 m", &newborn, 2.0, &breeze),
        compared("hairs of 1 µm on a stem", &hair, 2.0, &breeze),
        compared("stiffness 1e13 beside 1e9 Pa", &mixed, 2.0, &breeze),
        compared("wind reversed within a step", &stem, 2.0, &flip),
        compared("1 % below Greenhill's length", &slender, 2.0, &draught),
        divided("a division at every step", &breeze),
        run("a chain of many segments", &plant(chain, 2.0, 0.01, 1e9), 0.5, 1e-3, &breeze).0,
    ]
}

/// A stem of which one segment is cut in two, in turn, every 1/60 s; compared with the stem that is not cut.
fn divided(case: &'static str, wind: &impl Fn(Vector, f64) -> Vector) -> HardCase {
    let mut skeleton = plant(6, 0.6, 4e-3, 1e9);
    let uncut = run(case, &skeleton, 1.0, 1e-5, wind).1;
    let mut state = State::at_rest(&skeleton);
    let mut solver = Solver::new(Settings::default());
    let (mut shortest, mut failure) = (f64::INFINITY, None);
    for cut in 0..60_usize {
        let from = cut as f64 / 60.0;
        let to = (cut + 1) as f64 / 60.0;
        let outcome = solver.advance(&mut state, from, to, &mut Fixed(&skeleton), wind, |step| {
            shortest = shortest.min(step.to - step.from);
        });
        if let Err(error) = outcome {
            failure = Some(error);
            break;
        }
        let place = cut * 7 % skeleton.len();
        let mut next = Skeleton::new();
        for (index, segment) in skeleton.segments().iter().enumerate() {
            let shares: &[f64] = if index == place { &[0.3, 0.7] } else { &[1.0] };
            for (part, share) in shares.iter().enumerate() {
                let parent = next.len().checked_sub(1);
                let joint = if part == 0 { segment.joint } else { Joint::default() };
                next.push(Segment { parent, joint, length: segment.length * share, ..*segment });
            }
        }
        skeleton = next;
        state.strain.insert(place, state.strain[place]);
        state.rate.insert(place, state.rate[place]);
    }
    let tip = Pose::new(&skeleton, &state.strain).point(skeleton.len() - 1, 1.0);
    let counts = solver.counts();
    let distance = (tip - uncut.point(uncut.len() - 1, 1.0)).norm() / skeleton.extent();
    HardCase {
        case,
        span: 1.0,
        steps: counts.steps,
        rejected: counts.rejected,
        shortest,
        moved: (tip - Vector::new(0.0, 0.6, 0.0)).norm() / 0.6,
        error: Some(distance),
        failure,
    }
}
