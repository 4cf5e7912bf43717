//! What a step costs.

use std::time::Instant;

use crate::{Error, Mesh, Settings, Sheet, Solver, State, Tissue, Vector};

/// A measured cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// Number of points.
    pub points: usize,
    /// Seconds of computing for a point and a step tried.
    pub seconds: f64,
    /// Iterations of linear systems in a step.
    pub iterations: f64,
    /// Steps tried for a second.
    pub steps: f64,
}

/// A flag of 1.5 m × 1 m (cotton of 0.3 mm, E = 1 MPa across all threads) in a wind of 6 m/s, of about this many points, for a tenth of a second.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn pace(points: usize) -> Result<Pace, Error> {
    let rows = ((points as f64 / 1.5).sqrt() as usize).max(2);
    let sides = [Vector::x() * 1.5, -Vector::y()];
    let mesh = Mesh::rectangle(Vector::zeros(), sides, [rows * 3 / 2, rows - 1]);
    let sheet = Sheet::new(&mesh, &Tissue::new(1e6, 500.0, 3e-4), |point| point.x == 0.0)?;
    let wind = |point: Vector, time: f64| Vector::new(6.0, 0.0, 0.6 * libm::sin(3.0 * time - 2.0 * point.x));
    let mut state = State::at_rest(&sheet);
    let mut solver = Solver::new(Settings::default());
    let (begun, time) = (Instant::now(), 0.1);
    solver.advance(&sheet, &mut state, 0.0..time, &[], &wind, |_| ())?;
    let counts = solver.counts();
    let tried = (counts.steps + counts.rejected) as f64;
    Ok(Pace {
        points: sheet.len(),
        seconds: begun.elapsed().as_secs_f64() / (tried * sheet.len() as f64),
        iterations: counts.iterations as f64 / tried,
        steps: tried / time,
    })
}

/// The cost for flags of about 1,000 and 10,000 points.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn paces() -> Result<Vec<Pace>, Error> {
    [1000, 10_000].into_iter().map(pace).collect()
}
