//! Vibration, swing and fall.

use dlsys_wind::study::Convergence;

use super::{TIGHT, TOLERANCES, fixed, within};
use crate::{Air, Error, Mesh, Settings, Sheet, Solver, State, Still, Tissue, Vector};

/// A stretched cord of 16 pieces in its first mode: the place of its middle after 1⅛ periods, in units of the amplitude, by the number of steps a
/// period. The frequency is that of 15 masses on a string, `2 √(T/(m l)) sin(π/32)`.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn vibration() -> Result<Vec<Convergence>, Error> {
    let tissue = Tissue { damping: 0.0, ..Tissue::new(1e7, 1000.0, 1e-3) };
    let (parts, stretch) = (16, 1.02);
    let mesh = Mesh::cord(Vector::zeros(), Vector::x(), parts);
    let sheet = Sheet::new(&mesh, &tissue, |point| point.x == 0.0 || point.x == 1.0)?;
    let section = std::f64::consts::FRAC_PI_4 * tissue.thickness * tissue.thickness;
    let (pull, piece) = (tissue.stiffness * section * (stretch - 1.0), stretch / parts as f64);
    let mass = tissue.density * section / parts as f64;
    let wave = std::f64::consts::PI / parts as f64;
    // Bending between pieces: EI/(rest length) over the square of the stretched one, by the square of the second difference.
    let bend = tissue.stiffness * std::f64::consts::PI * tissue.thickness.powi(4) / 64.0 * parts as f64;
    let second = 2.0 - 2.0 * libm::cos(wave);
    let omega = ((pull / piece * second + bend / (piece * piece) * second * second) / mass).sqrt();
    let amplitude = 1e-5;
    let period = std::f64::consts::TAU / omega;
    let mut found = Vec::new();
    for steps in [32.0, 64.0, 128.0] {
        let mut state = State::at_rest(&sheet);
        for (k, point) in state.positions.iter_mut().enumerate() {
            *point = Vector::new(point.x * stretch, amplitude * libm::sin(wave * k as f64), 0.0);
        }
        let settings = Settings { air: Air::none(), ..fixed(period / steps) };
        Solver::new(settings).advance(&sheet, &mut state, 0.0..1.125 * period, &[], &Still, |_| ())?;
        found.push((steps, state.positions[parts / 2].y / amplitude));
    }
    let exact = std::f64::consts::FRAC_1_SQRT_2;
    Ok(Convergence::rows(
        "vibration of a stretched cord, by steps a period: place of its middle",
        exact,
        &found,
    ))
}

/// A mass on a stiff cord, released at 1 rad: its angle after 1¼ periods, by tolerance. The stretch of the cord is 2e-7 rad of it.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn pendulum() -> Result<Vec<Convergence>, Error> {
    let tissue = Tissue { damping: 0.0, ..Tissue::new(1e11, 1000.0, 1e-3) };
    let (length, gravity) = (0.5_f64, 9.81_f64);
    // The arithmetic-geometric mean of 1 and cos(θ/2).
    let (mut a, mut b) = (1.0_f64, libm::cos(0.5));
    for _ in 0..10 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    let period = std::f64::consts::TAU * (length / gravity).sqrt() / a;
    let end = Vector::new(libm::sin(1.0), -libm::cos(1.0), 0.0) * length;
    let sheet = Sheet::new(&Mesh::cord(Vector::zeros(), end, 1), &tissue, |point| point.y == 0.0)?;
    let mut found = Vec::new();
    for tolerance in TIGHT {
        let settings = Settings { air: Air { density: 0.0, ..Air::default() }, ..within(tolerance) };
        let mut state = State::at_rest(&sheet);
        Solver::new(settings).advance(&sheet, &mut state, 0.0..1.25 * period, &[], &Still, |_| ())?;
        let place = state.positions[1];
        found.push((tolerance, libm::atan2(place.x, -place.y)));
    }
    Ok(Convergence::rows("pendulum from 1 rad, 1¼ periods: angle (rad)", 0.0, &found))
}

/// A free sheet that falls broadside: its speed after 0.3 s, `v_t tanh(g t/v_t)`, by tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn fall() -> Result<Vec<Convergence>, Error> {
    let tissue = Tissue::new(1e7, 1000.0, 2e-4);
    let mut mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [4, 4]);
    let cut = |face: &Vec<usize>| [vec![face[0], face[1], face[2]], vec![face[0], face[2], face[3]]];
    mesh.faces = mesh.faces.iter().flat_map(cut).collect();
    let sheet = Sheet::new(&mesh, &tissue, |_| false)?;
    let speed = (2.0 * tissue.density * tissue.thickness * 9.81 / (1.2 * 1.2_f64)).sqrt();
    let time = 0.3;
    let mut found = Vec::new();
    for tolerance in TOLERANCES {
        let mut state = State::at_rest(&sheet);
        Solver::new(within(tolerance)).advance(&sheet, &mut state, 0.0..time, &[], &Still, |_| ())?;
        found.push((tolerance, -state.velocities[7].y));
    }
    let exact = speed * libm::tanh(9.81 * time / speed);
    Ok(Convergence::rows("sheet that falls broadside for 0.3 s: speed (m/s)", exact, &found))
}
