//! Motion: decrement, energy, prescribed motion of the base, momentum, cutting.

use dlsys_wind::study::Convergence;

use super::{stem, vibration::BETA, weightless};
use crate::{
    Error, Fixed, Joint, Load, Method, Pose, Segment, Settings, Skeleton, Solver, State, Still, Vector,
};

/// Settings of steps of one length.
fn steps(settings: Settings, length: f64) -> Settings {
    Settings { fixed: true, longest: length, ..settings }
}

/// Logarithmic decrement of the first mode of a stem, δ = 2πζ/√(1 - ζ²) with ζ = ωτ/2, over five periods of 20, 40 and 80 steps.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn decrement() -> Result<Vec<Convergence>, Error> {
    let mut skeleton = stem(10, 1.0, 0.01, 1e9, 900.0, false);
    let rest = vec![Vector::zeros(); skeleton.len()];
    let shape = |skeleton: &Skeleton| Solver::new(weightless()).modes(skeleton, &rest, 1);
    let omega = shape(&skeleton)?.first().map_or(f64::NAN, |mode| mode.squared.sqrt());
    let zeta = 0.05;
    skeleton.segments_mut().iter_mut().for_each(|segment| segment.damping = 2.0 * zeta / omega);
    let mode = shape(&skeleton)?.swap_remove(0);
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let period = std::f64::consts::TAU / damped;
    let axis = mode.shape[0].iamax();
    let mut found = Vec::new();
    for count in [20.0, 40.0, 80.0] {
        let mut state = State::at_rest(&skeleton);
        for (strain, shape) in state.strain.iter_mut().zip(&mode.shape) {
            *strain = shape * 1e-6;
        }
        // Amplitude of the coordinate q of the mode, at any phase.
        let amplitude = |state: &State| {
            let [q, rate] = [&state.strain, &state.rate].map(|list| list[0][axis] / mode.shape[0][axis]);
            q.hypot((rate + zeta * omega * q) / damped)
        };
        let before = amplitude(&state);
        let mut solver = Solver::new(steps(weightless(), period / count));
        solver.advance(&mut state, 0.0, 5.0 * period, &mut Fixed(&skeleton), &Still, |_| ())?;
        found.push((count, (before / amplitude(&state)).ln() / 5.0));
    }
    let exact = std::f64::consts::TAU * zeta / (1.0 - zeta * zeta).sqrt();
    Ok(Convergence::rows("logarithmic decrement (steps a period)", exact, &found))
}

/// A stem that bends much in a gust: gain of energy less work of the wind plus heat, relative to the work, by the number of steps a second.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn energy_balance() -> Result<Vec<Convergence>, Error> {
    let mut skeleton = stem(10, 1.0, 0.01, 3e8, 900.0, true);
    for segment in skeleton.segments_mut() {
        segment.damping = 0.02;
        segment.drag_diameter = 0.05;
    }
    let wind = |_: Vector, time: f64| Vector::new(6.0 * (5.0 * time).sin(), 0.0, 2.0 * time);
    let mut found = Vec::new();
    for count in [200.0, 400.0, 800.0] {
        let mut state = State::at_rest(&skeleton);
        let mut solver = Solver::new(steps(Settings::default(), 1.0 / count));
        let before = solver.energy(&skeleton, &state)?.total();
        solver.advance(&mut state, 0.0, 1.0, &mut Fixed(&skeleton), &wind, |_| ())?;
        let gain = solver.energy(&skeleton, &state)?.total() - before;
        found.push((count, (gain - state.work.wind + state.work.dissipated) / state.work.wind));
    }
    Ok(Convergence::rows("energy balance: defect/work (steps a second)", 0.0, &found))
}

/// `F(x) → F(k x) F((1 - k) x)` with copied strain and rate, in a bent and moving stem: largest change of position (m) and velocity (m/s)
/// of the ends behind, by k.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn splitting() -> Result<Vec<Convergence>, Error> {
    let whole = stem(6, 1.0, 0.01, 1e8, 900.0, true);
    let mut state = State::at_rest(&whole);
    for index in 0..whole.len() {
        let x = index as f64;
        state.strain[index] = Vector::new(x.sin(), (2.0 * x).cos(), 2.0 - x);
        state.rate[index] = Vector::new(x.cos(), 5.0 - x, 3.0 * (3.0 * x).sin());
    }
    let (mut places, mut speeds) = (Vec::new(), Vec::new());
    for k in [0.5, 0.1, 1e-9] {
        let (mut cut, mut copied) = (Skeleton::new(), State::default());
        for (index, segment) in whole.segments().iter().enumerate() {
            let parts: &[f64] = if index == 2 { &[k, 1.0 - k] } else { &[1.0] };
            for (part, share) in parts.iter().enumerate() {
                let parent = cut.len().checked_sub(1);
                let joint = if part == 0 { segment.joint } else { Joint::default() };
                cut.push(Segment { parent, joint, length: segment.length * share, ..*segment });
                copied.strain.push(state.strain[index]);
                copied.rate.push(state.rate[index]);
            }
        }
        let [before, after] = [(&whole, &state), (&cut, &copied)].map(|(skeleton, state)| {
            let velocities = Solver::new(Settings::default()).velocities(skeleton, state);
            (Pose::new(skeleton, &state.strain), velocities)
        });
        let speed = after.1?[6] - before.1?[5];
        places.push((k, (after.0.point(6, 1.0) - before.0.point(5, 1.0)).norm()));
        speeds.push((k, speed.norm()));
    }
    let mut all = Convergence::rows("cut at k: shift of the tip (m)", 0.0, &places);
    all.extend(Convergence::rows("cut at k: change of its velocity (m/s)", 0.0, &speeds));
    Ok(all)
}

/// Tip of a cantilever whose base is shaken across from rest, X = A sin Ωt, relative to the base, against the sum of five modes of the
/// uniform beam; segments and steps are refined together.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn shaken_cantilever() -> Result<Vec<Convergence>, Error> {
    let (length, diameter, stiffness, density) = (1.0_f64, 1e-3_f64, 1e10, 900.0);
    let unit = (stiffness * diameter * diameter / (16.0 * density) / length.powi(4)).sqrt();
    let (size, shake, end) = (1e-5, 2.0 * unit, 4.0 / unit);
    let mut exact = 0.0;
    for (k, beta) in BETA.iter().enumerate() {
        let omega = beta * beta * unit;
        let (h, c) = (beta.sinh() - beta.sin(), beta.cosh() + beta.cos());
        let sigma = h / c;
        let sign = if k % 2 == 0 { 2.0 } else { -2.0 };
        let response = (shake * end).sin() - shake / omega * (omega * end).sin();
        exact +=
            sign * 2.0 * sigma / beta * size * shake * shake / (omega * omega - shake * shake) * response;
    }
    let mut found = Vec::new();
    for n in [8, 16, 32] {
        let rest = stem(n, length, diameter, stiffness, density, false);
        let mut growth = |time: f64, skeleton: &mut Skeleton| {
            skeleton.clone_from(&rest);
            if let Some(first) = skeleton.segments_mut().first_mut() {
                let (sine, cosine) = (shake * time).sin_cos();
                first.joint.offset.y = size * sine;
                first.joint.velocity.y = size * shake * cosine;
                first.joint.acceleration.y = -size * shake * shake * sine;
            }
            true
        };
        let mut state = State::at_rest(&rest);
        let settings = steps(weightless(), end / (100.0 * n as f64));
        Solver::new(settings).advance(&mut state, 0.0, end, &mut growth, &Still, |_| ())?;
        found.push((n as f64, Pose::new(&rest, &state.strain).point(n - 1, 1.0).y));
    }
    Ok(Convergence::rows("shaken cantilever: tip (m)", exact, &found))
}

/// A pendulum whose pivot accelerates steadily by a from rest: half a period of the pendulum in the gravity √(g² + a²) later it stands at
/// twice the angle atan(a/g). Angle by the number of steps.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn pendulum_on_a_cart() -> Result<Vec<Convergence>, Error> {
    let (length, pull, hinge) = (0.8_f64, 6.0_f64, 1e-6);
    let amplitude = (pull / 9.81_f64).atan();
    let half = 0.5 * pendulum_period(length, 9.81_f64.hypot(pull), amplitude);
    let mut rest = Skeleton::new();
    // Rotations by θ strain the hinge by θ/l; its stiffness is far below the weight.
    let mut soft = Segment::solid(None, hinge, 1e-6, 1.0, 0.0);
    soft.joint.rotation = nalgebra::Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    soft.drag_diameter = 0.0;
    rest.push(soft);
    rest.push(Segment { rigid: true, drag_diameter: 0.0, ..Segment::solid(Some(0), length, 1e-6, 1.0, 0.0) });
    rest.load(Load { inertia: nalgebra::Matrix3::identity() * 1e-9, ..Load::point(1.0, 0.3) });
    let mut found = Vec::new();
    for count in [100.0, 200.0, 400.0] {
        let mut growth = |time: f64, skeleton: &mut Skeleton| {
            skeleton.clone_from(&rest);
            if let Some(first) = skeleton.segments_mut().first_mut() {
                first.joint.offset.x = 0.5 * pull * time * time;
                first.joint.velocity.x = pull * time;
                first.joint.acceleration.x = pull;
            }
            true
        };
        let mut state = State::at_rest(&rest);
        let settings = steps(Settings::default(), half / count);
        Solver::new(settings).advance(&mut state, 0.0, half, &mut growth, &Still, |_| ())?;
        found.push((count, state.strain[0].norm() * hinge));
    }
    Ok(Convergence::rows("pendulum on a cart: angle (steps)", 2.0 * amplitude, &found))
}

/// Period of a pendulum of any amplitude, by the arithmetic-geometric mean.
fn pendulum_period(length: f64, gravity: f64, amplitude: f64) -> f64 {
    let (mut a, mut b) = (1.0_f64, (0.5 * amplitude).cos());
    for _ in 0..8 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::TAU * (length / gravity).sqrt() / a
}

/// A limp stem that hangs and swings round, with crosses of four weights: relative change of its angular momentum about the vertical in 2 s, by
/// tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn angular_momentum() -> Result<Vec<Convergence>, Error> {
    let mut skeleton = Skeleton::new();
    for index in 0..4_usize {
        let mut segment = Segment::solid(index.checked_sub(1), 0.2, 4e-3, 1e8, 0.0);
        segment.drag_diameter = 0.0;
        if index == 0 {
            segment.joint.rotation = nalgebra::Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        }
        skeleton.push(segment);
        for arm in [Vector::y(), -Vector::y(), Vector::z(), -Vector::z()] {
            skeleton.load(Load { centre: arm * 0.04, ..Load::point(1.0, 0.005 + 0.0025 * index as f64) });
        }
    }
    // The weights' velocities are differences of their places a moment later and earlier.
    let momentum = |state: &State| -> f64 {
        const MOMENT: f64 = 1e-5;
        let places = |time: f64| -> Vec<Vector> {
            let strain = state.strain.iter().zip(&state.rate).map(|(strain, rate)| strain + rate * time);
            let pose = Pose::new(&skeleton, &strain.collect::<Vec<_>>());
            let of = |index: usize| {
                let frame = pose.at(index, 1.0);
                skeleton.loads(index).iter().map(move |load| frame.origin + frame.axes * load.centre)
            };
            (0..skeleton.len()).flat_map(of).collect()
        };
        let masses = (0..skeleton.len()).flat_map(|index| skeleton.loads(index)).map(|load| load.mass);
        let moving = places(MOMENT).into_iter().zip(places(-MOMENT)).zip(masses);
        moving.map(|((after, before), mass)| before.cross(&after).y * mass / (2.0 * MOMENT)).sum()
    };
    let mut found = Vec::new();
    for tolerance in [1e-3, 1e-4, 1e-5] {
        let mut state = State::at_rest(&skeleton);
        for (index, rate) in state.rate.iter_mut().enumerate() {
            *rate = Vector::new(0.0, 1.0, 0.5 - 0.1 * index as f64);
            state.strain[index] = Vector::new(0.0, 0.5, -1.0);
        }
        let settings = Settings { tolerance, rotary: 0.0, ..Settings::default() };
        let before = momentum(&state);
        Solver::new(settings).advance(&mut state, 0.0, 2.0, &mut Fixed(&skeleton), &Still, |_| ())?;
        found.push((tolerance, momentum(&state) / before - 1.0));
    }
    Ok(Convergence::rows("angular momentum: relative change (tolerance)", 0.0, &found))
}

/// What the flywheels about the tangents change: largest distance of the tip of a stalk that hangs over, in gusts from its side, from that with
/// smaller ones, relative to its length, by δ.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn flywheels() -> Result<Vec<Convergence>, Error> {
    let (mut skeleton, wind) = stalk_in_gusts();
    for segment in skeleton.segments_mut() {
        segment.rest.y = 1.0;
    }
    let run = |rotary: f64| {
        let settings = Settings { tolerance: 1e-8, rotary, ..Settings::default() };
        frames_of_tip(&skeleton, settings, &wind).map(|run| run.0)
    };
    let reference = run(0.0125)?;
    let mut found = Vec::new();
    for delta in [0.2, 0.1, 0.05] {
        let tips = run(delta)?;
        let most = tips.iter().zip(&reference).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        found.push((delta, most));
    }
    Ok(Convergence::rows("flywheels of δ: tip of a stalk in gusts/L", 0.0, &found))
}

/// A stalk of 1 m, bent to and fro and sideways by gusts.
fn stalk_in_gusts() -> (Skeleton, impl Fn(Vector, f64) -> Vector) {
    let mut skeleton = stem(12, 1.0, 0.01, 5e8, 900.0, true);
    for segment in skeleton.segments_mut() {
        segment.damping = 0.01;
        segment.drag_diameter = 0.03;
    }
    let wind = |point: Vector, time: f64| {
        let gust = (3.0 * time).sin() + 0.5 * (11.0 * time - point.y).sin();
        Vector::new(5.0 * gust, 0.0, 2.0 * (7.0 * time).cos())
    };
    (skeleton, wind)
}

/// Places of a tip at 60 frames a second during 2 s, and the steps tried.
fn frames_of_tip(
    skeleton: &Skeleton,
    settings: Settings,
    wind: &impl Fn(Vector, f64) -> Vector,
) -> Result<(Vec<Vector>, u64), Error> {
    let mut solver = Solver::new(settings);
    let mut state = State::at_rest(skeleton);
    let mut frames = Vec::new();
    let tip = skeleton.len() - 1;
    solver.advance(&mut state, 0.0, 2.0, &mut Fixed(skeleton), wind, |step| {
        while frames.len() as f64 / 60.0 <= step.to {
            let time = frames.len() as f64 / 60.0;
            let strain: Vec<Vector> = (0..=tip).map(|index| step.strain(index, time)).collect();
            frames.push(Pose::new(skeleton, &strain).point(tip, 1.0));
        }
    })?;
    let counts = solver.counts();
    Ok((frames, counts.steps + counts.rejected))
}

/// Work and error of a method at a tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkRow {
    /// Method of integration.
    pub method: Method,
    /// Tolerance of a step.
    pub tolerance: f64,
    /// Steps, with those rejected.
    pub steps: u64,
    /// Right-hand sides: those of a step times steps.
    pub evaluations: u64,
    /// Largest distance of the tip from the reference at 60 frames a second, relative to the length of the stem.
    pub error: f64,
}

/// The implicit methods side by side: error of a stem in gusts against work, by tolerance. The reference is ROS2 at a
/// tolerance of 1e-7. A method that fails at a tolerance has no row.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn methods() -> Result<Vec<WorkRow>, Error> {
    let (skeleton, wind) = stalk_in_gusts();
    let run = |method: Method, tolerance: f64| {
        frames_of_tip(&skeleton, Settings { method, tolerance, ..Settings::default() }, &wind)
    };
    let reference = run(Method::Ros2, 1e-7)?.0;
    let mut all = Vec::new();
    for (method, evaluations) in [(Method::Euler, 1), (Method::Ros2, 2), (Method::Ros34Pw2, 4)] {
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
            let Ok((frames, steps)) = run(method, tolerance) else { continue };
            let error = frames.iter().zip(&reference).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            all.push(WorkRow { method, tolerance, steps, evaluations: steps * evaluations, error });
        }
    }
    Ok(all)
}
