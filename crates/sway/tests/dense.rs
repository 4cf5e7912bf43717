//! The solver against Lagrange's equations assembled by brute force: positions of all masses by differences, a dense mass matrix.

use dlsys_sway::{Air, Fixed, Load, Matrix, Plate, Pose, Segment, Settings, Skeleton, Solver, State, Vector};
use nalgebra::{DMatrix, DVector, Rotation3};

/// Pseudo-random numbers in (-1, 1).
struct Draws(u64);

impl Draws {
    fn one(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, size: f64) -> Vector {
        Vector::new(self.one(), self.one(), self.one()) * size
    }
}

/// A skeleton with its parabola in time.
fn later(skeleton: &Skeleton, t: f64) -> Skeleton {
    let mut moved = skeleton.clone();
    for segment in moved.segments_mut() {
        let joint = &mut segment.joint;
        let turn = joint.angular_velocity * t + joint.angular_acceleration * (0.5 * t * t);
        joint.rotation = Rotation3::from_scaled_axis(turn).into_inner() * joint.rotation;
        joint.offset += joint.velocity * t + joint.acceleration * (0.5 * t * t);
        segment.length += segment.length_rate * t + segment.length_acceleration * (0.5 * t * t);
        segment.rest += segment.rest_rate * t + segment.rest_acceleration * (0.5 * t * t);
    }
    moved
}

fn random_tree(draws: &mut Draws, n: usize) -> Skeleton {
    let mut skeleton = Skeleton::new();
    for index in 0..n {
        let parent = (index > 0)
            .then(|| ((draws.one() * 0.5 + 0.5) * index as f64) as usize)
            .map(|p| p.min(index - 1));
        let mut segment = Segment::solid(parent, 0.3 + 0.1 * draws.one(), 0.05, 1e5, 900.0);
        segment.joint.rotation = Rotation3::from_scaled_axis(draws.vector(0.5)).into_inner();
        segment.joint.offset = draws.vector(0.05);
        segment.joint.angular_velocity = draws.vector(1.0);
        segment.joint.angular_acceleration = draws.vector(3.0);
        segment.joint.velocity = draws.vector(0.3);
        segment.joint.acceleration = draws.vector(2.0);
        segment.length_rate = 0.1 * draws.one();
        segment.length_acceleration = draws.one();
        segment.rest = draws.vector(2.0);
        segment.rest_rate = draws.vector(1.0);
        segment.rest_acceleration = draws.vector(3.0);
        segment.damping = 0.01;
        segment.drag_diameter = 0.2;
        segment.rigid = index % 5 == 3;
        segment.sag = index % 2 == 0;
        skeleton.push(segment);
        let spread = Matrix::new(3.0, 0.5, 0.1, 0.5, 2.0, -0.3, 0.1, -0.3, 1.5) * 1e-3;
        let at = 0.5 + 0.5 * draws.one();
        skeleton.load(Load { at, mass: 0.2, centre: draws.vector(0.1), inertia: spread });
        skeleton.load(Load::point(1.0, 0.1));
        // Some sections carry several.
        for at in [0.7, 1.0, 1.0] {
            let normal = draws.vector(1.0).normalize();
            skeleton.plate(Plate { at, centre: draws.vector(0.1), normal, area: 0.05 });
        }
        skeleton.load(Load { at: 1.0, mass: 0.1, centre: draws.vector(0.1), inertia: spread * 0.5 });
    }
    skeleton
}

/// Everything that has mass or feels air.
struct Bodies {
    /// Position, mass, drag kind.
    points: Vec<(Vector, f64, Air3)>,
    /// Axes, moment of inertia in them.
    spins: Vec<(Matrix, Matrix)>,
}

#[derive(Clone, Copy)]
enum Air3 {
    None,
    Rod(Vector, f64),
    Plate(Vector, f64),
}

/// Moments of inertia of the flywheels, from masses and their distances along the tree: δ² l √(m m₂).
fn flywheels(skeleton: &Skeleton, delta: f64) -> Vec<f64> {
    let segments = skeleton.segments();
    let mut sums = vec![(0.0, 0.0); segments.len()];
    for (index, segment) in segments.iter().enumerate() {
        // Simpson's rule is exact for the square of the distance along a rod.
        let rod = segment.mass * segment.length / 6.0;
        let mut parts = vec![(0.0, rod), (0.5 * segment.length, 4.0 * rod), (segment.length, rod)];
        let arm = |load: &Load| load.at * segment.length + load.spread();
        parts.extend(skeleton.loads(index).iter().map(|load| (arm(load), load.mass)));
        let (mut at, mut before) = (index, 0.0);
        loop {
            for (distance, mass) in &parts {
                let place: f64 = before + distance;
                sums[at].0 += mass;
                sums[at].1 += mass * place * place;
            }
            let Some(parent) = segments[at].parent else { break };
            before += segments[at].joint.offset.norm() + segments[parent].length;
            at = parent;
        }
    }
    let of =
        |(segment, sum): (&Segment, &(f64, f64))| delta * delta * segment.length * (sum.0 * sum.1).sqrt();
    segments.iter().zip(&sums).map(of).collect()
}

fn bodies(skeleton: &Skeleton, strain: &[Vector], flywheels: &[f64]) -> Bodies {
    let pose = Pose::new(skeleton, strain);
    let mut all = Bodies { points: Vec::new(), spins: Vec::new() };
    for (index, segment) in skeleton.segments().iter().enumerate() {
        for sign in [-1.0, 1.0] {
            let frame = pose.at(index, 0.5 + sign * 0.5 / 3.0_f64.sqrt());
            let tangent = frame.axes.column(0).into_owned();
            let area = 0.5 * segment.length * segment.drag_diameter;
            all.points.push((frame.origin, 0.5 * segment.mass * segment.length, Air3::Rod(tangent, area)));
            let round = segment.mass * segment.length * segment.diameter.powi(2) / 32.0;
            let polar = 2.0 * round + 0.5 * flywheels[index];
            all.spins.push((frame.axes, Matrix::from_diagonal(&Vector::new(polar, round, round))));
        }
        for load in skeleton.loads(index) {
            let frame = pose.at(index, load.at);
            all.points.push((frame.origin + frame.axes * load.centre, load.mass, Air3::None));
            all.spins.push((frame.axes, load.inertia));
        }
        for plate in skeleton.plates(index) {
            let frame = pose.at(index, plate.at);
            let point = frame.origin + frame.axes * plate.centre;
            all.points.push((point, 0.0, Air3::Plate(frame.axes * plate.normal, plate.area)));
        }
    }
    all
}

/// First and second derivative by t at 0, of fourth and higher order in the distance of samples.
fn derivatives<T>(sample: impl Fn(f64) -> T, h: f64) -> (T, T)
where
    T: Clone + std::ops::Sub<Output = T> + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let [m2, m1, o, p1, p2] = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|k| sample(k * h));
    let first =
        (p1.clone() - m1.clone()) * (8.0 / (12.0 * h)) - (p2.clone() - m2.clone()) * (1.0 / (12.0 * h));
    let second = ((p1 + m1) * 16.0 - p2 - m2 - o * 30.0) * (1.0 / (12.0 * h * h));
    (first, second)
}

fn flat(bodies: &Bodies) -> DVector<f64> {
    DVector::from_iterator(3 * bodies.points.len(), bodies.points.iter().flat_map(|p| [p.0.x, p.0.y, p.0.z]))
}

/// Angular velocity (world) of axes that change at a rate.
fn angular(rate: &Matrix, axes: &Matrix) -> Vector {
    let spin = rate * axes.transpose();
    Vector::new(spin[(2, 1)] - spin[(1, 2)], spin[(0, 2)] - spin[(2, 0)], spin[(1, 0)] - spin[(0, 1)]) * 0.5
}

#[test]
fn accelerations_are_those_of_lagrange() {
    let air = Air::default();
    let wind_speed = Vector::new(4.0, 0.5, -2.0);
    let mut worst = 0.0_f64;
    for seed in 0..6 {
        let mut draws = Draws(seed * 77 + 5);
        let n = 3 + seed as usize;
        let skeleton = random_tree(&mut draws, n);
        let mut state = State::at_rest(&skeleton);
        for index in 0..n {
            state.strain[index] = draws.vector(2.0);
            if !skeleton.segments()[index].rigid {
                state.rate[index] = draws.vector(4.0);
            }
        }
        let mut solver = Solver::new(Settings::default());
        let found = solver.accelerations(&skeleton, &state, &|_: Vector, _: f64| wind_speed, 0.0).unwrap();
        let expected = brute_force(&skeleton, &state, &air, &wind_speed);
        let scale = expected.iter().map(|a| a.norm()).fold(0.0, f64::max);
        for (index, (a, b)) in found.iter().zip(&expected).enumerate() {
            let error = (a - b).norm() / scale;
            worst = worst.max(error);
            assert!(error < 1e-6, "seed {seed}, segment {index}: {a} instead of {b}");
        }
    }
    println!("largest relative error {worst:e}");
}

fn brute_force(skeleton: &Skeleton, state: &State, air: &Air, wind: &Vector) -> Vec<Vector> {
    let n = skeleton.len();
    let wheels = flywheels(skeleton, Settings::default().rotary);
    let along = |t: f64| {
        let strain: Vec<Vector> = (0..n).map(|i| state.strain[i] + state.rate[i] * t).collect();
        bodies(&later(skeleton, t), &strain, &wheels)
    };
    let now = along(0.0);
    let (velocity, bias) = derivatives(|t| flat(&along(t)), 1e-3);
    // Jacobians of points and of turns.
    let free: Vec<(usize, usize)> =
        (0..n).filter(|&i| !skeleton.segments()[i].rigid).flat_map(|i| (0..3).map(move |k| (i, k))).collect();
    let nudged = |column: (usize, usize), t: f64| {
        let mut strain = state.strain.clone();
        strain[column.0][column.1] += t;
        bodies(skeleton, &strain, &wheels)
    };
    let points: Vec<DVector<f64>> =
        free.iter().map(|&column| derivatives(|t| flat(&nudged(column, t)), 1e-3).0).collect();
    let spins = |sample: &dyn Fn(f64) -> Bodies| -> Vec<(Matrix, Matrix)> {
        (0..now.spins.len()).map(|s| derivatives(|t| sample(t).spins[s].0, 1e-3)).collect()
    };
    let turns: Vec<Vec<Vector>> = free
        .iter()
        .map(|&column| {
            let rates = spins(&|t| nudged(column, t));
            rates.iter().zip(&now.spins).map(|(rate, spin)| angular(&rate.0, &spin.0)).collect()
        })
        .collect();
    let moving = spins(&along);
    let m = free.len();
    let mut mass = DMatrix::zeros(m, m);
    let mut load = DVector::zeros(m);
    for (p, point) in now.points.iter().enumerate() {
        let place = |vector: &DVector<f64>| Vector::new(vector[3 * p], vector[3 * p + 1], vector[3 * p + 2]);
        let relative = place(&velocity) - wind;
        let drag = match point.2 {
            Air3::None => Vector::zeros(),
            Air3::Rod(tangent, area) => {
                let across = relative - tangent * tangent.dot(&relative);
                across * (-0.5 * air.density * air.cylinder * area * across.norm())
            }
            Air3::Plate(normal, area) => {
                let along = normal * normal.dot(&relative);
                (along * air.normal + (relative - along) * air.tangential)
                    * (-0.5 * air.density * area * relative.norm())
            }
        };
        let force = (air.gravity - place(&bias)) * point.1 + drag;
        for i in 0..m {
            load[i] += place(&points[i]).dot(&force);
            for j in 0..m {
                mass[(i, j)] += point.1 * place(&points[i]).dot(&place(&points[j]));
            }
        }
    }
    for (s, (axes, inertia)) in now.spins.iter().enumerate() {
        let inertia = axes * inertia * axes.transpose();
        let omega = angular(&moving[s].0, axes);
        // The derivative of (Ṙ Rᵀ) is R̈ Rᵀ and a symmetric part.
        let alpha = angular(&moving[s].1, axes);
        let moment = -(inertia * alpha + omega.cross(&(inertia * omega)));
        for i in 0..m {
            load[i] += turns[i][s].dot(&moment);
            for j in 0..m {
                mass[(i, j)] += turns[i][s].dot(&(inertia * turns[j][s]));
            }
        }
    }
    let rest = rest_loads(skeleton, air, &free);
    for (i, &(segment, axis)) in free.iter().enumerate() {
        let piece = &skeleton.segments()[segment];
        let bent = state.strain[segment][axis] + piece.damping * state.rate[segment][axis];
        load[i] -= piece.length * piece.rigidity()[axis] * bent;
        if !piece.sag {
            load[i] -= rest[i];
        }
    }
    let solution = mass.lu().solve(&load).unwrap();
    let mut all = vec![Vector::zeros(); n];
    for (i, &(segment, axis)) in free.iter().enumerate() {
        all[segment][axis] = solution[i];
    }
    all
}

/// Minus the derivative of the weight's potential at the rest shape.
fn rest_loads(skeleton: &Skeleton, air: &Air, free: &[(usize, usize)]) -> Vec<f64> {
    let lift = |strain: &[Vector]| -> f64 {
        bodies(skeleton, strain, &vec![0.0; skeleton.len()])
            .points
            .iter()
            .map(|point| point.0.dot(&air.gravity) * point.1)
            .sum()
    };
    free.iter()
        .map(|&(segment, axis)| {
            derivatives(
                |t| {
                    let mut strain = vec![Vector::zeros(); skeleton.len()];
                    strain[segment][axis] = t;
                    lift(&strain)
                },
                1e-3,
            )
            .0
        })
        .collect()
}

/// Every method converges to the same motion of a random tree, each at its order.
#[test]
fn methods_converge_at_their_order() {
    use dlsys_sway::Method;
    let mut draws = Draws(3);
    let mut skeleton = random_tree(&mut draws, 6);
    for segment in skeleton.segments_mut() {
        let still = Segment { parent: segment.parent, ..*segment };
        *segment = Segment {
            joint: dlsys_sway::Joint::fixed(still.joint.rotation, still.joint.offset),
            length_rate: 0.0,
            length_acceleration: 0.0,
            rest_rate: Vector::zeros(),
            rest_acceleration: Vector::zeros(),
            ..still
        };
    }
    let run = |method: Method, steps: u32| {
        let longest = 0.125 / f64::from(steps);
        let settings = Settings { method, fixed: true, longest, ..Settings::default() };
        let mut state = State::at_rest(&skeleton);
        let wind = |_: Vector, time: f64| Vector::new(6.0 * (9.0 * time).sin(), 0.0, 5.0 * time);
        let mut solver = Solver::new(settings);
        solver.advance(&mut state, 0.0, 0.125, &mut Fixed(&skeleton), &wind, |_| ()).unwrap();
        Pose::new(&skeleton, &state.strain).point(5, 1.0)
    };
    let best = run(Method::Ros34Pw2, 2048);
    for (method, steps, order) in
        [(Method::Euler, 256, 1.0), (Method::Ros2, 256, 2.0), (Method::Ros34Pw2, 128, 3.0)]
    {
        let [coarse, fine] = [steps, 2 * steps].map(|steps| (run(method, steps) - best).norm());
        let found = (coarse / fine).log2();
        println!("{method:?}: {coarse:e} {fine:e} order {found}");
        assert!((found - order).abs() < 0.35, "{method:?}: {coarse:e} {fine:e}, order {found}");
    }
}
