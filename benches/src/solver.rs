//! One interface to both programs: run to three output times, then return the values.

use std::time::{Duration, Instant};

use diffsol::matrix::MatrixRef;
use diffsol::{
    DefaultDenseMatrix, DiffsolError, FaerContext, FaerSparseLU, FaerSparseMat, FaerVec, OdeEquations,
    OdeEquationsImplicit, OdeSolverMethod, OdeSolverProblem, OdeSolverStopReason, Vector, VectorRef,
};
use dlsys::session::Session;
use dlsys::sim::{Settings, Simulation};
use dlsys::tree::ModuleString;

use crate::measure::{self, Spread};

/// A program with a problem and a tolerance, ready to be timed.
pub trait Solver {
    /// Everything that is timed: from starting the solver to the last output.
    fn run(&mut self) -> Result<(), String>;
    /// The unknowns at an output time, after a run.
    fn values(&self, output: usize) -> Vec<f64>;
}

/// Makes the solver for a tolerance.
pub type Prepare = dyn Fn(f64) -> Result<Box<dyn Solver>, String>;

/// A program that is not yet given a tolerance.
pub struct Candidate {
    pub name: String,
    /// Makes the solver for a tolerance; not timed.
    pub prepare: Box<Prepare>,
}

/// dlsys on a model whose string is: wall, cells with one parameter each, wall.
pub struct Dlsys {
    session: Session,
    settings: Settings,
    times: Vec<f64>,
    strings: Vec<ModuleString>,
}

impl Dlsys {
    pub fn new(text: &str, tolerance: f64, times: &[f64]) -> Result<Dlsys, String> {
        Ok(Dlsys {
            session: session(text)?,
            settings: Settings { tolerance, ..Settings::default() },
            times: times.to_vec(),
            strings: vec![ModuleString::default(); times.len()],
        })
    }

    /// True if the run ends within the limit. Approaches the last time in growing pieces, because a run cannot be
    /// interrupted; the pieces do not change the steps.
    pub fn ends_within(&self, limit: Duration) -> Result<bool, String> {
        let end = self.times.last().copied().unwrap_or(0.0);
        let begin = Instant::now();
        let mut simulation = self.start()?;
        let mut string = ModuleString::default();
        let mut t = end * 1e-7;
        while t < end {
            simulation.at(t, &mut string).map_err(|e| e.to_string())?;
            if begin.elapsed() > limit {
                return Ok(false);
            }
            t *= 1.5;
        }
        Ok(true)
    }

    /// Median of the seconds that `Session::simulate` takes, which are part of every run.
    pub fn starting(&self, rounds: usize) -> Result<f64, String> {
        self.start()?;
        let mut once = || drop(self.start());
        Ok(Spread::of((0..rounds).map(|_| measure::time(&mut once, 1)).collect()).median)
    }

    fn start(&self) -> Result<Simulation<'_>, String> {
        self.session.simulate(self.settings).map_err(|e| e.to_string())
    }
}

impl Solver for Dlsys {
    fn run(&mut self) -> Result<(), String> {
        let mut simulation = self.session.simulate(self.settings).map_err(|e| e.to_string())?;
        for (t, string) in self.times.iter().zip(&mut self.strings) {
            simulation.at(*t, string).map_err(|e| e.to_string())?;
        }
        Ok(())
    }

    fn values(&self, output: usize) -> Vec<f64> {
        let string = &self.strings[output];
        let cells = 1..string.len().saturating_sub(1);
        cells.map(|i| string.get(i).parameters.first().copied().unwrap_or(f64::NAN)).collect()
    }
}

/// Reads a model.
pub fn session(text: &str) -> Result<Session, String> {
    Session::from_text("benchmark.dls", text, &[]).map_err(|refused| format!("{:?}", refused.diagnostics))
}

/// How diffsol is brought to an output time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landing {
    /// Step over it, then interpolate.
    Interpolate,
    /// Let a step end there.
    Stop,
}

/// diffsol with a problem; `solve` builds the solver and fills the outputs.
pub struct Diffsol<Eqn: OdeEquations, F> {
    pub problem: OdeSolverProblem<Eqn>,
    pub solve: F,
    pub outputs: Vec<Eqn::V>,
}

impl<Eqn, F> Solver for Diffsol<Eqn, F>
where
    Eqn: OdeEquations<T = f64>,
    F: Fn(&OdeSolverProblem<Eqn>, &mut [Eqn::V]) -> Result<(), DiffsolError>,
{
    fn run(&mut self) -> Result<(), String> {
        (self.solve)(&self.problem, &mut self.outputs).map_err(|e| e.to_string())
    }

    fn values(&self, output: usize) -> Vec<f64> {
        self.outputs[output].clone_as_vec()
    }
}

/// Takes a solver through the output times.
pub fn land<'a, Eqn, S>(
    mut solver: S,
    landing: Landing,
    times: &[f64],
    outputs: &mut [Eqn::V],
) -> Result<(), DiffsolError>
where
    Eqn: OdeEquations<T = f64> + 'a,
    S: OdeSolverMethod<'a, Eqn>,
{
    for (t, output) in times.iter().zip(outputs) {
        match landing {
            Landing::Interpolate => {
                while solver.state().t < *t {
                    solver.step()?;
                }
                solver.interpolate_inplace(*t, output)?;
            }
            Landing::Stop => {
                solver.set_stop_time(*t)?;
                while !matches!(solver.step()?, OdeSolverStopReason::TstopReached) {}
                output.copy_from(solver.state().y);
            }
        }
    }
    Ok(())
}

/// Methods of diffsol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Tsit45,
    Bdf,
    Esdirk34,
}

/// Runs an explicit method.
pub fn explicit<Eqn>(
    problem: &OdeSolverProblem<Eqn>,
    landing: Landing,
    times: &[f64],
    outputs: &mut [Eqn::V],
) -> Result<(), DiffsolError>
where
    Eqn: OdeEquations<T = f64>,
    Eqn::V: DefaultDenseMatrix<T = f64, C = Eqn::C>,
    for<'b> &'b Eqn::V: VectorRef<Eqn::V>,
    for<'b> &'b Eqn::M: MatrixRef<Eqn::M>,
{
    land(problem.tsit45()?, landing, times, outputs)
}

/// Runs an implicit method with a sparse direct linear solver.
pub fn implicit<Eqn>(
    problem: &OdeSolverProblem<Eqn>,
    method: Method,
    landing: Landing,
    times: &[f64],
    outputs: &mut [Eqn::V],
) -> Result<(), DiffsolError>
where
    Eqn: OdeEquationsImplicit<T = f64, M = FaerSparseMat<f64>, V = FaerVec<f64>, C = FaerContext>,
{
    match method {
        Method::Tsit45 => land(problem.tsit45()?, landing, times, outputs),
        Method::Bdf => land(problem.bdf::<FaerSparseLU<f64>>()?, landing, times, outputs),
        Method::Esdirk34 => land(problem.esdirk34::<FaerSparseLU<f64>>()?, landing, times, outputs),
    }
}
