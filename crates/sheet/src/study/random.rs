//! Random solids that move through the place of a sheet that is held at its rim: none may pass through it.

use crate::{
    Attitude, Error, Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Step, Still, Tissue, Vector,
};

/// The end of a random pass.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomPass {
    /// Its number.
    pub seed: u64,
    /// Lengths of the solid that it moves in a tick of 1/60 s.
    pub lengths: f64,
    /// Whether the sheet was on the wrong side of the solid's centre after any step.
    pub pierced: bool,
    /// Whether they touched.
    pub touched: bool,
    /// Largest depth after a step, in radii of the solid's rounding.
    pub depth: f64,
    /// Steps, and steps that were rejected.
    pub steps: [u64; 2],
}

/// A number in 0..1 from a seed and a purpose.
fn chance(seed: u64, purpose: u64) -> f64 {
    // The mixing function of splitmix64 (Steele, Lea, Flood, 2014).
    let mut z = (seed << 8 | purpose).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A ball or a rounded box that moves through a sheet of 1 m on a straight path, straight or grazing, at 0.1 to 100 of its lengths in a tick.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn random_pass(seed: u64) -> Result<RandomPass, Error> {
    let x = |purpose: u64| chance(seed, purpose);
    let spread = |purpose: u64, size: f64| (2.0 * x(purpose) - 1.0) * size;
    let parts = 6 + (6.0 * x(0)) as usize;
    let mesh = Mesh::rectangle(Vector::new(-0.5, 0.0, -0.5), [Vector::x(), Vector::z()], [parts, parts]);
    let tissue = Tissue::new(libm::pow(10.0, 4.0 + 3.0 * x(1)), 300.0, 3e-4);
    let rim = |x: f64| x.abs() == 0.5;
    let sheet = Sheet::new(&mesh, &tissue, |point| rim(point.x) || rim(point.z))?;
    let (half, round) = (0.02 + 0.06 * x(2), 0.015 + 0.03 * x(3));
    let (shape, length) = if seed.is_multiple_of(2) {
        (Shape::ball(half + round)?, 2.0 * (half + round))
    } else {
        let corner = |k: u64| {
            let side = |bit: u64| if k >> bit & 1 == 1 { half } else { -half };
            Vector::new(side(0), 0.3 * side(1), side(2))
        };
        (Shape::rounded((0..8).map(corner).collect(), round)?, 2.0 * (half + round))
    };
    let lengths = libm::pow(10.0, 3.0 * x(4) - 1.0);
    // Every third one grazes.
    let slope = if seed.is_multiple_of(3) { 0.1 } else { 1.0 };
    let way = Vector::new(spread(5, 1.0), -slope * (0.3 + x(6)), spread(7, 1.0)).normalize();
    // It begins above the sheet, and stays within the rim, where points are held that cannot give way.
    let limit = 0.48 - shape.reach();
    let start = Vector::new(spread(8, limit), shape.reach() + 0.01, spread(9, limit));
    let velocity = way * (lengths * length * 60.0);
    let spin = Vector::new(spread(10, 20.0), spread(11, 20.0), spread(12, 20.0));
    let path = move |time: f64| Place {
        position: start + velocity * time,
        attitude: Attitude::from_scaled_axis(spin * time),
        velocity,
        spin,
    };
    // Until it is one length beyond the sheet, or at the rim.
    let beyond = 2.0 * (shape.reach() + 0.01) / -way.y;
    let room = |k: usize| (limit * way[k].signum() - start[k]) / way[k];
    let room = beyond.min(room(0)).min(room(2));
    let end = room.max(0.0) / velocity.norm();
    let solids = [Solid::guided(&shape, &path)];
    let mut state = State::at_rest(&sheet);
    let mut solver = Solver::new(Settings::default());
    let (mut depth, mut pierced, mut touched) = (0.0_f64, false, false);
    solver.advance(&sheet, &mut state, 0.0..end, &solids, &Still, |step: &Step| {
        depth = depth.max(step.depths[0]);
        touched |= step.pushes[0].impulse.norm() > 0.0;
        pierced |= crossings(&sheet, &step.after.positions, [start, path(step.to).position]) % 2 == 1;
    })?;
    let counts = solver.counts();
    let depth = depth / shape.radius();
    Ok(RandomPass { seed, lengths, pierced, touched, depth, steps: [counts.steps, counts.rejected] })
}

/// How many triangles a line between two points crosses.
fn crossings(sheet: &Sheet, x: &[Vector], [from, to]: [Vector; 2]) -> usize {
    let way = to - from;
    let is_crossed = |face: &&[usize; 3]| {
        let [a, b, c] = face.map(|point| x[point] - from);
        let normal = (b - a).cross(&(c - a));
        let along = normal.dot(&way);
        let part = normal.dot(&a) / along;
        let side = |p: Vector, q: Vector| p.cross(&q).dot(&way) * along.signum();
        part > 0.0 && part < 1.0 && [side(a, b), side(b, c), side(c, a)].iter().all(|side| *side >= 0.0)
    };
    sheet.triangles().iter().filter(is_crossed).count()
}
