//! A small module that reaches its threshold and starts again, ten thousand times.
//!
//! Without closed form: x' = 1 + sin(x)/2 from 0, back to 0 at x = 3. The time of one life is known nevertheless:
//! the integral of dx/(1 + a sin x) is 2/q atan((tan(x/2) + a)/q) with q = sqrt(1 - a^2) (Gradshteyn and Ryzhik,
//! 2.551.3). A shorter life, with fewer steps in it: x' = 2 (1 - x/3) x + sin(x)/10 from 1, back to 1 at x = 2; its
//! time is a quadrature. Lives that begin with the same value are known from one before, so there are also some that do not, and some whose rates differ. In closed form: the logistic apex x' = 2 (1 - x/3) x, 1 to 2; its life is ln 2.
//!
//! The error is that of one life in units of time: the time of the last event, less its exact value, divided by
//! the number of events. The lives are all alike, so nothing averages out; at the threshold x grows at about unit
//! speed in both cases (1.07 and 1.33), so this is about the error in x as well. Lives that begin with other values run along
//! one orbit; those whose rates differ are integrated each for itself.

use std::hint::black_box;

use diffsol::matrix::MatrixRef;
use diffsol::{
    DefaultDenseMatrix, DiffsolError, FaerMat, Matrix, NalgebraMat, OdeBuilder, OdeEquations,
    OdeSolverMethod, OdeSolverProblem, OdeSolverStopReason, VectorRef,
};
use dlsys::session::Session;
use dlsys::sim::{Method, Settings};
use dlsys::tree::ModuleString;

use crate::{measure, solver, tune};

/// Events in one run.
pub const EVENTS: usize = 10_000;

/// The difference of the values, or rates, with which two lives begin that are to differ: a few roundings.
const SHIFT: f64 = 1e-15;

/// What tells lives apart, by less than counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Differ {
    /// Nothing: they are known from the first.
    Not,
    /// Each begins with another value: they run along one orbit.
    InStart,
    /// Each has another rate, so that no life is known from one before.
    InRate,
}

/// An equation with its start and its threshold.
#[derive(Clone, Copy, Debug)]
pub struct Life {
    pub name: &'static str,
    /// The rate in dlsys's language.
    law: &'static str,
    rate: fn(f64) -> f64,
    start: f64,
    threshold: f64,
    differ: Differ,
    /// Exact duration.
    pub duration: f64,
}

/// x' = 1 + sin(x)/2 from 0 to 3.
pub fn sine() -> Life {
    let (a, q) = (0.5f64, 0.75f64.sqrt());
    let antiderivative = |x: f64| 2.0 / q * (((0.5 * x).tan() + a) / q).atan();
    Life {
        name: "x' = 1 + sin(x)/2, 0 to 3",
        law: "1 + 0.5*sin(x)",
        rate: |x| 1.0 + 0.5 * x.sin(),
        start: 0.0,
        threshold: 3.0,
        differ: Differ::Not,
        duration: antiderivative(3.0) - antiderivative(0.0),
    }
}

/// x' = 2 (1 - x/3) x + sin(x)/10 from 1 to 2.
pub fn short() -> Life {
    let life = Life {
        name: "x' = 2(1 - x/3)x + sin(x)/10, 1 to 2",
        law: "2*(1 - x/3)*x + 0.1*sin(x)",
        rate: |x| 2.0 * (1.0 - x / 3.0) * x + 0.1 * x.sin(),
        start: 1.0,
        threshold: 2.0,
        differ: Differ::Not,
        duration: 0.0,
    };
    Life { duration: quadrature(&life), ..life }
}

/// The time of a life as the integral of dx/x': Gauss-Legendre with 3 points in each of 200 pieces.
fn quadrature(life: &Life) -> f64 {
    let h = (life.threshold - life.start) / 200.0;
    let points = [(-0.6f64.sqrt(), 5.0 / 18.0), (0.0, 4.0 / 9.0), (0.6f64.sqrt(), 5.0 / 18.0)];
    let piece = |i: u32| {
        let middle = life.start + (f64::from(i) + 0.5) * h;
        points.iter().map(|(x, w)| w * h / (life.rate)(middle + 0.5 * h * x)).sum::<f64>()
    };
    (0..200).map(piece).sum()
}

/// x' = 2 (1 - x/3) x from 1 to 2.
pub fn logistic() -> Life {
    Life {
        name: "x' = 2(1 - x/3)x, 1 to 2",
        law: "2*(1 - x/3)*x",
        rate: |x| 2.0 * (1.0 - x / 3.0) * x,
        start: 1.0,
        threshold: 2.0,
        differ: Differ::Not,
        duration: std::f64::consts::LN_2,
    }
}

impl Life {
    /// The same with lives that differ.
    pub fn differing(self, differ: Differ) -> Life {
        Life { differ, ..self }
    }

    /// The model in dlsys's language.
    pub fn text(&self) -> String {
        let Life { law, start, threshold, .. } = self;
        let (rate, first) = match self.differ {
            Differ::Not => (None, None),
            Differ::InStart => (None, Some(format!("{start} + {SHIFT}*n"))),
            Differ::InRate => (Some(format!("{law} + {SHIFT}*n")), Some(start.to_string())),
        };
        if let Some(first) = first {
            let law = rate.as_deref().unwrap_or(law);
            return format!(
                "initial string: A({start}, 0)\nA(x, n):\n  if x < {threshold} solve dx/dt = {law}\n  \
                 if x = {threshold} produce A({first}, n + 1)\n"
            );
        }
        format!(
            "initial string: A({start})\nA(x):\n  if x < {threshold} solve dx/dt = {law}\n  \
             if x = {threshold} produce A({start})\n"
        )
    }

    /// A time in the middle of the life after the last event.
    fn end(&self, events: usize) -> f64 {
        (events as f64 + 0.5) * self.duration
    }

    pub fn session(&self) -> Result<Session, String> {
        solver::session(&self.text())
    }
}

/// The timed run of dlsys: a simulation from its start past the last event.
pub fn run_dlsys(session: &Session, life: &Life, method: Method, tolerance: f64) -> Result<u64, String> {
    let settings = Settings { method, tolerance, ..Settings::default() };
    let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    let mut string = ModuleString::default();
    simulation.at(life.end(EVENTS), &mut string).map_err(|e| e.to_string())?;
    black_box(&string);
    Ok(simulation.stats().events)
}

/// Error of one life, from the log of events; not a number if their number is wrong.
pub fn error_dlsys(session: &Session, life: &Life, method: Method, tolerance: f64) -> Result<f64, String> {
    let settings = Settings { method, tolerance, log: true, ..Settings::default() };
    let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    let events = 1000;
    simulation.at(life.end(events), &mut ModuleString::default()).map_err(|e| e.to_string())?;
    let log = simulation.take_events();
    Ok(match log.last() {
        Some(last) if log.len() == events => (last.time / events as f64 - life.duration).abs(),
        _ => f64::NAN,
    })
}

/// How diffsol begins again after an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstStep {
    /// With the step size that its step control has arrived at.
    Kept,
    /// With a share of the life.
    Share(f64),
}

/// Runs one of diffsol's restart loops, in the cheapest way its interface offers: one solver for all lives, whose
/// state is put back by hand to the start (value, derivative, time of the root, step size). Gives the time of the last
/// event.
pub fn run_diffsol<Eqn>(
    problem: &OdeSolverProblem<Eqn>,
    life: &Life,
    first: FirstStep,
    events: usize,
) -> Result<f64, DiffsolError>
where
    Eqn: OdeEquations<T = f64>,
    Eqn::V: DefaultDenseMatrix<T = f64, C = Eqn::C> + std::ops::IndexMut<usize, Output = f64>,
    for<'b> &'b Eqn::V: VectorRef<Eqn::V>,
    for<'b> &'b Eqn::M: MatrixRef<Eqn::M>,
{
    let slope = (life.rate)(life.start);
    let mut solver = problem.tsit45()?;
    let mut last = 0.0;
    if let FirstStep::Share(share) = first {
        *solver.state_mut().h = share * life.duration;
    }
    let mut done = 0;
    while done < events {
        if let OdeSolverStopReason::RootFound(t, _) = solver.step()? {
            let state = solver.state_mut();
            state.y[0] = life.start;
            state.dy[0] = slope;
            *state.t = t;
            if let FirstStep::Share(share) = first {
                *state.h = share * life.duration;
            }
            last = t;
            done += 1;
        }
    }
    Ok(last)
}

/// The problem as a user of diffsol writes it.
fn problem<M: Matrix<T = f64> + 'static>(
    life: Life,
    tolerance: f64,
) -> Result<OdeSolverProblem<impl OdeEquations<M = M, V = M::V, T = f64, C = M::C>>, DiffsolError> {
    OdeBuilder::<M>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .rhs(move |x, _, _, y| y[0] = (life.rate)(x[0]))
        .init(move |_, _, y| y[0] = life.start, 1)
        .root(move |x, _, _, y| y[0] = x[0] - life.threshold, 1)
        .build()
}

/// A run of diffsol over some events; gives the time of the last one.
pub type Loop = Box<dyn Fn(usize) -> Result<f64, String>>;

/// A restart loop with a vector type and a choice of first steps, for a tolerance.
pub struct Variant {
    pub name: String,
    pub prepare: Box<dyn Fn(f64) -> Result<Loop, String>>,
}

/// All restart loops worth trying.
pub fn variants(life: Life) -> Vec<Variant> {
    let shares = [0.1, 0.15, 0.2, 0.255, 0.34, 0.4, 0.51, 0.7, 1.02];
    let firsts = std::iter::once(FirstStep::Kept).chain(shares.map(FirstStep::Share));
    let mut all: Vec<Variant> =
        firsts.map(|first| variant::<NalgebraMat<f64>>("nalgebra", life, first)).collect();
    // Vectors of one number are slower with faer whatever the first step; one is enough to show it.
    all.push(variant::<FaerMat<f64>>("faer", life, FirstStep::Kept));
    all
}

fn variant<M>(vectors: &str, life: Life, first: FirstStep) -> Variant
where
    M: Matrix<T = f64> + 'static,
    M::V: DefaultDenseMatrix<T = f64, C = M::C> + std::ops::IndexMut<usize, Output = f64>,
    for<'b> &'b M::V: VectorRef<M::V>,
    for<'b> &'b M: MatrixRef<M>,
{
    let prepare = move |tolerance| -> Result<Loop, String> {
        let problem = problem::<M>(life, tolerance).map_err(|e| e.to_string())?;
        Ok(Box::new(move |events| run_diffsol(&problem, &life, first, events).map_err(|e| e.to_string())))
    };
    Variant { name: format!("tsit45 ({vectors}, first step {first:?})"), prepare: Box::new(prepare) }
}

/// diffsol's fastest loop at an error.
pub struct Best {
    pub name: String,
    pub tolerance: f64,
    pub error: f64,
    pub run: Loop,
}

/// The fastest loop that reaches an error; prints each one with the seconds that it takes for an event.
pub fn best_loop(life: &Life, target: f64, mut tell: impl FnMut(&Best, f64)) -> Result<Best, String> {
    let mut best: Option<(f64, Best)> = None;
    for variant in variants(*life) {
        let error = |tolerance| error_diffsol(&(variant.prepare)(tolerance).ok()?, life);
        let Some((tolerance, error)) = tune::search(4, 13, target, error) else { continue };
        let run = (variant.prepare)(tolerance)?;
        let time = (0..5).map(|_| measure::time(&mut || drop(run(EVENTS)), 1)).fold(f64::INFINITY, f64::min);
        let found = Best { name: variant.name, tolerance, error, run };
        tell(&found, time / EVENTS as f64);
        if best.as_ref().is_none_or(|b| time < b.0) {
            best = Some((time, found));
        }
    }
    best.map(|b| b.1).ok_or_else(|| "no loop reaches the error".into())
}

/// The loosest tolerance at which dlsys reaches an error, with the error.
pub fn tuned_dlsys(session: &Session, life: &Life, method: Method, target: f64) -> Option<(f64, f64)> {
    tune::search(4, 13, target, |tolerance| error_dlsys(session, life, method, tolerance).ok())
}

/// Error of one life.
pub fn error_diffsol(run: &Loop, life: &Life) -> Option<f64> {
    let events = 200;
    run(events).ok().map(|last| (last / events as f64 - life.duration).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quadrature against the two antiderivatives.
    #[test]
    fn durations() {
        for life in [sine(), logistic()] {
            let found = quadrature(&life);
            assert!((found - life.duration).abs() < 1e-13, "{}: {found}, not {}", life.name, life.duration);
        }
    }

    /// The loops restart at the right times, whatever the first step.
    #[test]
    fn diffsol_restarts() {
        let life = logistic();
        for variant in variants(life) {
            let run = (variant.prepare)(1e-10).expect("a good problem");
            let error = error_diffsol(&run, &life).expect("it runs");
            assert!(error < 1e-8, "{}: {error}", variant.name);
        }
    }
}
