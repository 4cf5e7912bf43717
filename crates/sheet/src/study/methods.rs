//! Error of places against work, method by method.

use std::time::Instant;

use super::net::{Coupling, catch};
use crate::{Error, Mesh, Method, Settings, Sheet, Solver, State, Still, Tissue, Vector};

/// A run of a case.
#[derive(Clone, Debug)]
pub struct Work {
    /// What moves.
    pub case: &'static str,
    /// The method.
    pub method: Method,
    /// The tolerance, relative to the extent of the sheet.
    pub tolerance: f64,
    /// Largest distance of any point, and of a body, from its place in the reference, at any tick of 1/60 s; relative to the extent of the sheet.
    pub error: f64,
    /// Steps that were accepted, and rejected.
    pub steps: [u64; 2],
    /// Seconds of computing.
    pub seconds: f64,
}

/// Points at ticks, and the steps for that.
type Moved = (Vec<Vec<Vector>>, [u64; 2]);

/// Something that moves, to compare methods with.
#[derive(Clone, Copy, Debug)]
pub struct MethodCase {
    name: &'static str,
    /// The extent of its sheet in m.
    extent: f64,
    run: fn(Settings) -> Result<Moved, Error>,
    tolerances: &'static [f64],
    /// That of the reference.
    fine: f64,
}

/// The cases in which methods are compared: one without contact, and one with it.
pub const METHOD_CASES: [MethodCase; 2] = [
    MethodCase {
        name: "cloth that swings down",
        extent: 1.0,
        run: swing,
        tolerances: &[1e-3, 1e-4, 1e-5],
        fine: 1e-6,
    },
    MethodCase {
        name: "ball in a net, both ways",
        extent: 0.45,
        run: ball,
        tolerances: &[1e-2, 1e-3, 1e-4],
        fine: 1e-5,
    },
];

/// A cloth of 1 m² that is held along one side, and let go where it is level, for 0.6 s.
fn swing(settings: Settings) -> Result<Moved, Error> {
    let mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [6, 6]);
    let sheet = Sheet::new(&mesh, &Tissue::new(1e6, 500.0, 5e-4), |point| point.x == 0.0)?;
    let (mut state, mut solver) = (State::at_rest(&sheet), Solver::new(settings));
    let mut places = Vec::new();
    for tick in 0..36 {
        let span = f64::from(tick) / 60.0..f64::from(tick + 1) / 60.0;
        solver.advance(&sheet, &mut state, span, &[], &Still, |_| ())?;
        places.push(state.positions.clone());
    }
    let counts = solver.counts();
    Ok((places, [counts.steps, counts.rejected]))
}

/// The ball that is thrown into a net of half its width.
fn ball(settings: Settings) -> Result<Moved, Error> {
    let found = catch(Coupling::TwoWay, 0.06, settings)?;
    let both =
        found.net.into_iter().zip(found.ball).map(|(net, ball)| net.into_iter().chain([ball]).collect());
    Ok((both.collect(), found.steps))
}

/// The methods side by side in a case, against the method of order 2 at a tenth of the tightest tolerance.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn methods(case: &MethodCase) -> Result<Vec<Work>, Error> {
    let MethodCase { name, extent, run, tolerances, fine } = *case;
    let (exact, _) = run(Settings { tolerance: fine, ..Settings::default() })?;
    let mut all = Vec::new();
    for method in [Method::Sdirk2, Method::Euler] {
        for &tolerance in tolerances {
            let begun = Instant::now();
            let (places, steps) = run(Settings { method, tolerance, ..Settings::default() })?;
            let seconds = begun.elapsed().as_secs_f64();
            let pairs = places.iter().flatten().zip(exact.iter().flatten());
            let error = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / extent;
            all.push(Work { case: name, method, tolerance, error, steps, seconds });
        }
    }
    Ok(all)
}
