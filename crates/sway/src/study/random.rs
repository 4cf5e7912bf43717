//! Random trees in random winds: what no list of cases foresees.

use nalgebra::Rotation3;

use crate::{Error, Fixed, Load, Matrix, Plate, Segment, Settings, Skeleton, Solver, State, Vector, upright};

/// The outcome of a random case.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomCase {
    /// Number of the case: the same tree and wind each time.
    pub seed: u64,
    /// Number of segments.
    pub segments: usize,
    /// Steps accepted.
    pub steps: u64,
    /// Steps rejected.
    pub rejected: u64,
    /// Shortest step, in s, of those that did not end at the end of the run.
    pub shortest: f64,
    /// Largest energy above that at the beginning plus the work of the air less heat, relative to the sum of the absolute values of these.
    /// `None` for trees that grow, since growth does work, too.
    pub gain: Option<f64>,
    /// The error that ended the run, if one did.
    pub failure: Option<Error>,
}

/// Pseudo-random numbers.
struct Draws(u64);

impl Draws {
    /// Uniform in [0, 1): the output function of SplitMix64.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    fn vector(&mut self, size: f64) -> Vector {
        Vector::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0)) * size
    }
}

/// A tree of 3 to 30 segments that taper from their root; leaves, fruits and newborn segments now and then.
fn tree(draws: &mut Draws, grows: bool) -> Skeleton {
    let mut skeleton = Skeleton::new();
    let count = draws.between(3.0, 30.0) as usize;
    let length = draws.scale(0.01, 0.3);
    let diameter = length * draws.scale(0.002, 0.2);
    let stiffness = draws.scale(3e6, 1e10);
    let damping = if draws.chance(0.2) { 0.0 } else { draws.scale(1e-3, 0.1) };
    let taper = draws.between(0.5, 1.0);
    let branching = draws.between(0.0, 0.5);
    let leaves = draws.between(0.0, 0.6);
    let mut depth: Vec<i32> = Vec::new();
    for index in 0..count {
        let branch = draws.chance(branching);
        let parent = index
            .checked_sub(1)
            .map(|last| if branch { (draws.unit() * index as f64) as usize } else { last }.min(last));
        let level = parent.map_or(0, |parent: usize| depth[parent] + i32::from(branch));
        depth.push(level);
        let mut size = length * draws.between(0.3, 1.5);
        let mut width = diameter * taper.powi(level + index as i32 / 6);
        let mut modulus = stiffness;
        match (draws.unit() * 40.0) as u32 {
            0 => size = 1e-12,
            1 => width = 1e-6_f64.max(width * 1e-3),
            2 => modulus = 1e13,
            _ => {}
        }
        let mut segment = Segment::solid(parent, size, width, modulus, draws.between(300.0, 1200.0));
        segment.damping = damping;
        segment.sag = draws.chance(0.5);
        segment.joint.rotation = match parent {
            None => upright(),
            Some(_) => {
                let turn = draws.vector(if branch { 1.0 } else { 0.1 });
                Rotation3::from_scaled_axis(turn).into_inner()
            }
        };
        segment.rest = if draws.chance(0.3) { draws.vector(0.5 / length) } else { Vector::zeros() };
        if grows {
            segment.length_rate = size * draws.between(0.0, 1.0);
            segment.joint.angular_velocity = draws.vector(0.5);
        }
        skeleton.push(segment);
        let weight = segment.mass * size;
        if draws.chance(leaves) {
            let blade = length * draws.scale(0.1, 1.0);
            let centre = draws.vector(0.5 * blade);
            let mass = 0.3 * blade * blade;
            let inertia = Matrix::identity() * (mass * blade * blade / 12.0);
            skeleton.load(Load { at: 1.0, mass, centre, inertia });
            let normal = draws.vector(1.0).try_normalize(1e-3).unwrap_or_else(Vector::x);
            skeleton.plate(Plate { at: 1.0, centre, normal, area: blade * blade });
        } else if draws.chance(0.1) {
            skeleton.load(Load::point(draws.unit(), weight * draws.scale(0.01, 5.0)));
        }
    }
    stand(draws, &mut skeleton);
    skeleton
}

/// Chooses the stiffness so that the softest segment carries from a hundredth of what would make it buckle under its own weight to twice that.
///
/// A uniform column buckles where its weight times the square of its height is 7.8 times EI (Greenhill 1881).
fn stand(draws: &mut Draws, skeleton: &mut Skeleton) {
    let n = skeleton.len();
    let (mut mass, mut reach, mut worst) = (vec![0.0_f64; n], vec![0.0_f64; n], 0.0_f64);
    for index in (0..n).rev() {
        let loads: f64 = skeleton.loads(index).iter().map(|load| load.mass).sum();
        let arm = skeleton.loads(index).iter().map(Load::spread).fold(0.0, f64::max);
        let segment = &skeleton.segments()[index];
        mass[index] += segment.mass * segment.length + loads;
        reach[index] = segment.length + reach[index].max(arm);
        if let Some(parent) = segment.parent {
            mass[parent] += mass[index];
            reach[parent] = reach[parent].max(reach[index]);
        }
        worst = worst.max(9.81 * mass[index] * reach[index].powi(2) / segment.rigidity().y);
    }
    let factor = worst / (7.8 * draws.scale(0.01, 2.0));
    for segment in skeleton.segments_mut() {
        segment.stiffness *= factor;
    }
}

/// One case of half a second. One in four grows while it moves; one in five has a wind that turns round at once.
pub fn random_case(seed: u64, method: crate::Method, tolerance: f64) -> RandomCase {
    let mut draws = Draws(seed);
    let grows = draws.chance(0.25);
    let skeleton = tree(&mut draws, grows);
    let speed = draws.scale(0.3, 40.0);
    let (steady, gust) = (draws.vector(speed), draws.vector(0.5 * speed));
    let (pace, scale) = (draws.scale(1.0, 60.0), draws.scale(0.1, 3.0));
    let flips = draws.chance(0.2);
    let wind = |point: Vector, time: f64| {
        let phase = pace * time - point.dot(&Vector::new(1.0, 0.7, -0.4)) / scale;
        let sign = if flips && (pace * time * 0.3).fract() > 0.5 { -1.0 } else { 1.0 };
        steady * sign + gust * phase.sin()
    };
    let span = 0.5;
    let mut state = State::at_rest(&skeleton);
    let mut solver = Solver::new(Settings { method, tolerance, ..Settings::default() });
    let mut grow = |time: f64, out: &mut Skeleton| {
        if !grows {
            return crate::Growth::skeleton(&mut Fixed(&skeleton), time, out);
        }
        out.clone_from(&skeleton);
        for segment in out.segments_mut() {
            segment.length += segment.length_rate * time;
            let turn = segment.joint.angular_velocity * time;
            segment.joint.rotation = Rotation3::from_scaled_axis(turn).into_inner() * segment.joint.rotation;
        }
        true
    };
    let mut shortest = f64::INFINITY;
    let mut meter = Solver::new(solver.settings);
    let mut gain = 0.0_f64;
    let start = meter.energy(&skeleton, &state).map_or(0.0, |energy| energy.total());
    let failure = solver
        .advance(&mut state, 0.0, span, &mut grow, &wind, |step| {
            if step.to < span {
                shortest = shortest.min(step.to - step.from);
            }
            if !grows && let Ok(energy) = meter.energy(&skeleton, step.after) {
                let work = step.after.work;
                let excess = energy.total() - start - work.wind + work.dissipated;
                let all = energy.kinetic + start.abs() + work.wind.abs() + work.dissipated;
                gain = gain.max(excess / all.max(f64::MIN_POSITIVE));
            }
        })
        .err();
    let counts = solver.counts();
    RandomCase {
        seed,
        segments: skeleton.len(),
        steps: counts.steps,
        rejected: counts.rejected,
        shortest,
        gain: (!grows).then_some(gain),
        failure,
    }
}
