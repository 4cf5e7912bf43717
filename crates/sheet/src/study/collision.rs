//! Solids that meet sheets: momentum, energy, rest.

use dlsys_wind::study::Convergence;

use super::{TIGHT, TOLERANCES, within};
use crate::{
    Air, Error, Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Step, Still, Tissue, Vector,
};

/// Momentum and angular momentum about the origin of a sheet and of a free ball.
fn momenta(sheet: &Sheet, state: &State, mass: f64, inertia: f64) -> [Vector; 2] {
    let points = state.positions.iter().zip(&state.velocities).zip(sheet.masses());
    let mut sums = [Vector::zeros(); 2];
    for ((x, v), m) in points {
        sums[0] += v * *m;
        sums[1] += x.cross(v) * *m;
    }
    for body in &state.bodies {
        sums[0] += body.velocity * mass;
        sums[1] += body.position.cross(&body.velocity) * mass + body.spin * inertia;
    }
    sums
}

/// A ball of 0.1 kg that spins hits a free sheet of 0.1 kg off its middle, without weight and air: changes of both momenta and the largest gain of energy
/// after any step, relative to what the ball had, by tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn collision() -> Result<Vec<Convergence>, Error> {
    let (mass, radius) = (0.1, 0.1);
    let mesh = Mesh::rectangle(Vector::new(-0.5, 0.0, -0.5), [Vector::x(), Vector::z()], [10, 10]);
    let sheet = Sheet::new(&mesh, &Tissue::new(1e6, 200.0, 5e-4), |_| false)?;
    let shape = Shape::ball(radius)?;
    let solids = [Solid::free_ball(&shape, mass)];
    let (mut linear, mut angular, mut gain) = (Vec::new(), Vec::new(), Vec::new());
    for tolerance in TIGHT {
        let settings = Settings { air: Air::none(), ..within(tolerance) };
        let mut ball = Place::at(Vector::new(0.12, 0.15, 0.05)).moving(Vector::new(0.3, -2.0, 0.1));
        ball.spin = Vector::new(0.0, 0.0, 15.0);
        let mut state = State::at_rest(&sheet).with(vec![ball]);
        let mut solver = Solver::new(settings);
        let inertia = 0.4 * mass * radius * radius;
        let before = momenta(&sheet, &state, mass, inertia);
        let energy = solver.energy(&sheet, &state, 0.0, &solids).total();
        let probe = solver.clone();
        let mut most = 0.0_f64;
        solver.advance(&sheet, &mut state, 0.0..0.3, &solids, &Still, |step: &Step| {
            most = most.max(probe.energy(&sheet, step.after, step.to, &solids).total() - energy);
        })?;
        let after = momenta(&sheet, &state, mass, inertia);
        let unit = mass * 2.0;
        linear.push((tolerance, (after[0] - before[0]).norm() / unit));
        angular.push((tolerance, (after[1] - before[1]).norm() / (unit * 0.13)));
        gain.push((tolerance, most / energy));
    }
    let mut rows = Convergence::rows("ball and free sheet collide: change of momentum", 0.0, &linear);
    rows.extend(Convergence::rows("ball and free sheet collide: change of angular momentum", 0.0, &angular));
    rows.extend(Convergence::rows("ball and free sheet collide: gain of energy", 0.0, &gain));
    Ok(rows)
}

/// A body of 50 kg drops onto a trampoline from 1 m: the largest gain of energy after any step within 1.5 s, relative to the energy of the
/// fall, by tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn trampoline() -> Result<Vec<Convergence>, Error> {
    let mesh = Mesh::rectangle(Vector::new(-1.5, 0.0, -1.5), [Vector::x() * 3.0, Vector::z() * 3.0], [8, 8]);
    let tissue = Tissue { damping: 0.02, ..Tissue::new(1e7, 800.0, 2e-3) };
    let rim = |x: f64| x.abs() == 1.5;
    let sheet = Sheet::new(&mesh, &tissue, |point| rim(point.x) || rim(point.z))?;
    let shape = Shape::ball(0.25)?;
    let solids = [Solid::free_ball(&shape, 50.0)];
    let mut gain = Vec::new();
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let settings = Settings { air: Air { density: 0.0, ..Air::default() }, ..within(tolerance) };
        let mut state = State::at_rest(&sheet).with(vec![Place::at(Vector::new(0.1, 1.25, 0.2))]);
        state.positions.iter_mut().for_each(|point| *point *= 1.02);
        let mut solver = Solver::new(settings);
        let energy = solver.energy(&sheet, &state, 0.0, &solids).total();
        let probe = solver.clone();
        let mut most = 0.0_f64;
        solver.advance(&sheet, &mut state, 0.0..1.5, &solids, &Still, |step: &Step| {
            most = most.max(probe.energy(&sheet, step.after, step.to, &solids).total() - energy);
        })?;
        gain.push((tolerance, most / (50.0 * 9.81)));
    }
    Ok(Convergence::rows("body on a trampoline, 1.5 s: gain of energy", 0.0, &gain))
}

/// A sheet that drops onto a floor: impulse of the floor after 2 s less that of the weight, relative to it, and depth in the floor in parts of the extent,
/// by tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn floor() -> Result<Vec<Convergence>, Error> {
    let mesh = Mesh::rectangle(Vector::new(0.0, 0.1, 0.0), [Vector::x(), Vector::z()], [8, 8]);
    let tissue = Tissue::new(1e6, 300.0, 1e-3);
    let sheet = Sheet::new(&mesh, &tissue, |_| false)?;
    let shape = Shape::half_space();
    let path = |_: f64| Place::at(Vector::zeros());
    let solids = [Solid::guided(&shape, &path)];
    let weight = sheet.masses().iter().sum::<f64>() * 9.81;
    let (mut force, mut depths) = (Vec::new(), Vec::new());
    for tolerance in TOLERANCES {
        let mut state = State::at_rest(&sheet);
        let mut solver = Solver::new(within(tolerance));
        let mut deepest = 0.0_f64;
        solver.advance(&sheet, &mut state, 0.0..2.0, &solids, &Still, |_| ())?;
        let pushes = solver.advance(&sheet, &mut state, 2.0..3.0, &solids, &Still, |step: &Step| {
            deepest = deepest.max(step.depths[0]);
        })?;
        force.push((tolerance, -pushes[0].impulse.y / weight - 1.0));
        depths.push((tolerance, deepest));
    }
    let mut rows = Convergence::rows("sheet on a floor: force less its weight", 0.0, &force);
    rows.extend(Convergence::rows("sheet on a floor: depth (m)", 0.0, &depths));
    Ok(rows)
}
