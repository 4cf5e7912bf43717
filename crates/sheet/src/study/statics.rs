//! Sheets and cords at rest under load. Rest is found by long steps, in which the method damps all motion.

use dlsys_wind::study::Convergence;

use super::fixed;
use crate::{Air, Error, Mesh, Settings, Sheet, Solver, State, Still, Tissue, Vector};

/// Length of a long step in s, and number of steps. What is left of a vibration is 1e-15 of it.
const LONG: f64 = 4.0;
const STEPS: f64 = 60.0;

/// Settings with a weight.
fn still(gravity: f64) -> Settings {
    let air = Air { gravity: Vector::new(0.0, -gravity, 0.0), ..Air::none() };
    Settings { air, ..fixed(LONG) }
}

/// Settings for what moves far before it rests: steps get longer as motion dies away.
fn slow(gravity: f64) -> Settings {
    Settings { fixed: false, tolerance: 1e-3, longest: 1.0, ..still(gravity) }
}

fn settle(sheet: &Sheet, mut state: State, settings: Settings) -> Result<State, Error> {
    Solver::new(settings).advance(sheet, &mut state, 0.0..LONG * STEPS, &[], &Still, |_| ())?;
    Ok(state)
}

/// A square sheet with an irregular mesh that is stretched by 1 %: its energy in units of `½ E t ε²`, with Green's strain ε. The strain is the same
/// everywhere, so the mesh does not matter.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn stretch() -> Result<Vec<Convergence>, Error> {
    let strain = (1.01_f64 * 1.01 - 1.0) / 2.0;
    let tissue = Tissue { poisson: 0.0, ..Tissue::new(1e7, 1000.0, 1e-3) };
    let unit = 0.5 * tissue.stiffness * tissue.thickness * strain * strain;
    let mut found = Vec::new();
    for parts in [2, 4, 8] {
        let mut mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), -Vector::y()], [parts, parts]);
        for (k, point) in mesh.points.iter_mut().enumerate() {
            let is_inner = |x: f64| x > 0.01 && x < 0.99;
            if is_inner(point.x) && is_inner(-point.y) {
                let turn = 2.4 * k as f64;
                *point += Vector::new(libm::cos(turn), libm::sin(turn), 0.0) * (0.3 / parts as f64);
            }
        }
        let sheet = Sheet::new(&mesh, &tissue, |point| point.y == 0.0 || point.y == -1.0)?;
        let mut state = State::at_rest(&sheet);
        for (point, held) in state.positions.iter_mut().zip(sheet.pinned()) {
            if *held {
                point.y *= 1.01;
            }
        }
        let state = settle(&sheet, state, Settings { air: Air::none(), ..fixed(LONG) })?;
        found.push((parts as f64, sheet.elastic_energy(&state.positions) / unit));
    }
    Ok(Convergence::rows("stretched sheet, irregular mesh: energy (½ E t ε²)", 1.0, &found))
}

/// A stretched cord under its weight: sag of its middle, `w L²/(8 T)` for small ones, less `w EI/T²` by its stiffness against bending.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn stretched_cord() -> Result<Vec<Convergence>, Error> {
    let (stiffness, density, width, gravity) = (1e8_f64, 1000.0_f64, 1e-3_f64, 1e-2_f64);
    let section = std::f64::consts::FRAC_PI_4 * width * width;
    // Weight per stretched length; the stretch is 1 %.
    let (weight, pull) = (density * section * gravity / 1.01, stiffness * section * 0.01);
    let mut found = Vec::new();
    for parts in [7, 14, 28] {
        let mesh = Mesh::cord(Vector::zeros(), Vector::x(), 2 * parts);
        let tissue = Tissue::new(stiffness, density, width);
        let sheet = Sheet::new(&mesh, &tissue, |point| point.x == 0.0 || point.x == 1.0)?;
        let mut state = State::at_rest(&sheet);
        state.positions.iter_mut().for_each(|point| *point *= 1.01);
        let state = settle(&sheet, state, still(gravity))?;
        found.push((2.0 * parts as f64, -state.positions[parts].y));
    }
    let (length, rigidity) = (1.01, stiffness * std::f64::consts::PI * width.powi(4) / 64.0);
    let exact = weight * length * length / (8.0 * pull) - weight * rigidity / (pull * pull);
    Ok(Convergence::rows("stretched cord under its weight: sag of its middle (m)", exact, &found))
}

/// A chain of 1.2 m between points 1 m apart: the sag of its middle, against the catenary of an elastic cord.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn hanging_cord() -> Result<Vec<Convergence>, Error> {
    let (stiffness, density, width, gravity) = (1e8_f64, 1000.0_f64, 2e-5_f64, 9.81_f64);
    let section = std::f64::consts::FRAC_PI_4 * width * width;
    let (weight, rigidity, half) = (density * section * gravity, stiffness * section, 0.6);
    // Half the span, and the sag, for a horizontal tension (Irvine, Cable Structures, 1981, section 1.3).
    let span = |pull: f64| pull * half / rigidity + pull / weight * libm::asinh(weight * half / pull);
    let sag = |pull: f64| {
        let steep = weight * half / pull;
        weight * half * half / (2.0 * rigidity) + pull / weight * ((1.0 + steep * steep).sqrt() - 1.0)
    };
    let (mut low, mut high) = (1e-3 * weight, 1e3 * weight);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if span(middle) < 0.5 { low = middle } else { high = middle }
    }
    let mut found = Vec::new();
    for parts in [5, 10, 20] {
        let mesh = Mesh::cord(Vector::zeros(), Vector::new(1.2, 0.0, 0.0), 2 * parts);
        let tissue = Tissue::new(stiffness, density, width);
        let sheet = Sheet::new(&mesh, &tissue, |point| point.x == 0.0 || point.x == 1.2)?;
        let mut state = State::at_rest(&sheet);
        // It begins with points on the catenary of a cord that does not stretch.
        let (unit, steepest) = (low / weight, (1.0 + (weight * half / low).powi(2)).sqrt());
        for (k, point) in state.positions.iter_mut().enumerate() {
            let steep = (k as f64 / parts as f64 - 1.0) * weight * half / low;
            let (x, y) = (unit * libm::asinh(steep), unit * ((1.0 + steep * steep).sqrt() - steepest));
            *point = Vector::new(0.5 + x, y, 0.0);
        }
        // The ends are where the exact solution has them.
        (state.positions[0], state.positions[2 * parts]) = (Vector::zeros(), Vector::x());
        let state = settle(&sheet, state, slow(gravity))?;
        found.push((2.0 * parts as f64, -state.positions[parts].y));
    }
    Ok(Convergence::rows("chain between two points: sag of its middle (m)", sag(low), &found))
}

/// A square membrane of 1 m, stretched by 5 % and held at its rim: deflection of its middle under a small load, in units of `q a²/T`.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn membrane() -> Result<Vec<Convergence>, Error> {
    let (tissue, gravity, stretch) = (Tissue::new(1e6, 1000.0, 1e-4), 1e-4, 1.05_f64);
    let tension =
        tissue.stiffness * tissue.thickness / (1.0 - tissue.poisson) * (stretch * stretch - 1.0) / 2.0;
    let load = tissue.density * tissue.thickness * gravity / (stretch * stretch);
    // The solution of Δu = -1 in the unit square, at its middle.
    let term = |i: i32, j: i32| {
        let (m, n) = (f64::from(2 * i + 1), f64::from(2 * j + 1));
        let sign = if (i + j) % 2 == 0 { 16.0 } else { -16.0 };
        sign / (std::f64::consts::PI.powi(4) * m * n * (m * m + n * n))
    };
    let exact: f64 = (0..400).flat_map(|i| (0..400).map(move |j| term(i, j))).sum();
    let mut found = Vec::new();
    for parts in [4, 8, 16] {
        let mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [parts, parts]);
        let rim = |x: f64| x == 0.0 || x == 1.0;
        let sheet = Sheet::new(&mesh, &tissue, |point| rim(point.x) || rim(point.z))?;
        let mut state = State::at_rest(&sheet);
        state.positions.iter_mut().for_each(|point| *point *= stretch);
        let state = settle(&sheet, state, still(gravity))?;
        let middle = state.positions[(parts / 2) * (parts + 1) + parts / 2].y;
        found.push((parts as f64, -middle * tension / (load * stretch * stretch)));
    }
    Ok(Convergence::rows("stretched membrane under load: deflection of its middle (q a²/T)", exact, &found))
}

/// A strip that is clamped at one end: deflection of the other by its weight, in units of `q L⁴/(8 B)`.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn cantilever() -> Result<Vec<Convergence>, Error> {
    let tissue = Tissue { poisson: 0.0, ..Tissue::new(1e8, 1000.0, 1e-3) };
    let (gravity, length) = (1e-4, 0.5_f64);
    let unit = tissue.density * tissue.thickness * gravity * length.powi(4) / (8.0 * tissue.rigidity());
    let mut found = Vec::new();
    for parts in [8, 16, 32] {
        // A hinge stands for half a piece on both of its sides, so the clamp is in the middle of the piece that is held.
        let piece = length / (parts as f64 + 0.5);
        let (origin, sides) =
            (-Vector::x() * piece, [Vector::x() * (piece * (parts + 1) as f64), Vector::z() * 0.1]);
        let mesh = Mesh::rectangle(origin, sides, [parts + 1, 2]);
        let sheet = Sheet::new(&mesh, &tissue, |point| point.x < 0.5 * piece)?;
        let state = settle(&sheet, State::at_rest(&sheet), still(gravity))?;
        found.push((parts as f64, -state.positions[parts + 1].y / unit));
    }
    Ok(Convergence::rows("clamped strip under its weight: deflection of its end (q L⁴/8B)", 1.0, &found))
}
