//! A filament of 1,000 cells between two walls: linear and nonlinear diffusion, stiff and not, for both programs.
//!
//! Linear: c' = D (l + r - 2c) - mu c. Nonlinear: the flow between two cells is in proportion to the mean of what they
//! hold, D (l + c)/(2 w) (l - c), hence c' = D/(2 w) (l^2 + r^2 - 2 c^2) - mu c, with w the value at the walls: the
//! porous medium equation. Both are as stiff as 4 D.

use diffsol::matrix::MatrixRef;
use diffsol::{
    DefaultDenseMatrix, DiffsolError, FaerMat, FaerSparseMat, Matrix, NalgebraMat, OdeBuilder,
    OdeEquationsImplicit, OdeSolverProblem, VectorRef,
};

use crate::chain::{self, CELLS, MU, WALL};
use crate::solver::{self, Candidate, Diffsol, Dlsys, Landing, Method, Solver};

/// Output times.
pub const TIMES: [f64; 3] = [1.0, 10.0, 100.0];
/// Diffusion constant of the filament that is not stiff, and of the one that is.
pub const D_SLOW: f64 = 0.03;
pub const D_STIFF: f64 = 1e4;
/// Largest difference from the exact values at all outputs, relative to [`WALL`].
pub const TARGET: f64 = 1e-9;

/// Which equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coupling {
    Linear,
    Nonlinear,
}

/// A filament.
#[derive(Clone, Copy, Debug)]
pub struct Filament {
    pub coupling: Coupling,
    pub d: f64,
}

impl Filament {
    pub fn name(&self) -> String {
        let coupling = if self.coupling == Coupling::Linear { "linear" } else { "nonlinear" };
        format!("{coupling} filament, D = {}", self.d)
    }

    /// The model in dlsys's language.
    pub fn text(&self) -> String {
        let cells: Vec<String> = chain::initial().iter().map(|c| format!("F_v({c})")).collect();
        let law = match self.coupling {
            Coupling::Linear => "D*(l + r - 2c) - mu*c",
            Coupling::Nonlinear => "D/(2*w)*(l^2 + r^2 - 2*c^2) - mu*c",
        };
        let Filament { d, .. } = self;
        format!(
            "const D = {d}\nconst mu = {MU}\nconst w = {WALL}\n\
             initial string: F_w({WALL}) {} F_w({WALL})\n\
             F(l) < F_v(c) > F(r): solve dc/dt = {law}\n",
            cells.join(" ")
        )
    }

    pub fn dlsys(self) -> Candidate {
        let text = self.text();
        Candidate {
            name: "dlsys".into(),
            prepare: Box::new(move |tolerance| Ok(Box::new(Dlsys::new(&text, tolerance, &TIMES)?))),
        }
    }

    /// diffsol's explicit method, with each of its vectors and each way to land on an output.
    pub fn explicit(self) -> Vec<Candidate> {
        let mut all = Vec::new();
        for landing in [Landing::Interpolate, Landing::Stop] {
            all.push(self.explicit_with::<NalgebraMat<f64>>("nalgebra", landing));
            all.push(self.explicit_with::<FaerMat<f64>>("faer", landing));
        }
        all
    }

    fn explicit_with<M>(self, vectors: &str, landing: Landing) -> Candidate
    where
        M: Matrix<T = f64> + 'static,
        M::V: DefaultDenseMatrix<T = f64, C = M::C>,
        for<'b> &'b M::V: VectorRef<M::V>,
        for<'b> &'b M: MatrixRef<M>,
    {
        let prepare = move |tolerance| -> Result<Box<dyn Solver>, String> {
            match self.coupling {
                Coupling::Linear => {
                    let problem = linear::<M>(self.d, tolerance).map_err(|e| e.to_string())?;
                    Ok(ready(problem, move |p, out| solver::explicit(p, landing, &TIMES, out)))
                }
                Coupling::Nonlinear => {
                    let problem = nonlinear::<M>(self.d, tolerance).map_err(|e| e.to_string())?;
                    Ok(ready(problem, move |p, out| solver::explicit(p, landing, &TIMES, out)))
                }
            }
        };
        Candidate { name: format!("tsit45 ({vectors}, {landing:?})"), prepare: Box::new(prepare) }
    }

    /// One of diffsol's implicit methods, with a sparse Jacobian: as it is set up by default, which renews the
    /// decomposition of the matrix every 20 steps, and renewing it every 50. It interpolates at outputs; stopping there
    /// is no faster.
    pub fn implicit(self, method: Method) -> Vec<Candidate> {
        [20, 50].map(|renew| self.implicit_with(method, renew)).into()
    }

    fn implicit_with(self, method: Method, renew: usize) -> Candidate {
        let landing = Landing::Interpolate;
        let prepare = move |tolerance| -> Result<Box<dyn Solver>, String> {
            match self.coupling {
                Coupling::Linear => {
                    let mut problem =
                        linear::<FaerSparseMat<f64>>(self.d, tolerance).map_err(|e| e.to_string())?;
                    problem.ode_options.update_jacobian_after_steps = renew;
                    Ok(ready(problem, move |p, out| solver::implicit(p, method, landing, &TIMES, out)))
                }
                Coupling::Nonlinear => {
                    let mut problem =
                        nonlinear::<FaerSparseMat<f64>>(self.d, tolerance).map_err(|e| e.to_string())?;
                    problem.ode_options.update_jacobian_after_steps = renew;
                    Ok(ready(problem, move |p, out| solver::implicit(p, method, landing, &TIMES, out)))
                }
            }
        };
        Candidate { name: format!("{method:?} (LU every {renew} steps)"), prepare: Box::new(prepare) }
    }

    /// The reference for the error.
    pub fn reference(&self) -> Result<Reference, String> {
        match self.coupling {
            Coupling::Linear => {
                let cells = (0..CELLS).collect();
                Ok(Reference { cells, values: TIMES.map(|t| chain::exact(self.d, t)).into() })
            }
            Coupling::Nonlinear => stored(self.d),
        }
    }
}

/// Values of some cells at the output times.
pub struct Reference {
    /// Indices of the cells, from 0.
    pub cells: Vec<usize>,
    /// For each output, the values of these cells.
    pub values: Vec<Vec<f64>>,
}

impl Reference {
    /// Largest difference at all outputs, relative to [`WALL`].
    pub fn error(&self, solver: &dyn Solver) -> f64 {
        let mut worst: f64 = 0.0;
        for (output, expected) in self.values.iter().enumerate() {
            let found = solver.values(output);
            for (cell, x) in self.cells.iter().zip(expected) {
                let difference = found.get(*cell).map_or(f64::INFINITY, |y| (x - y).abs());
                worst = if difference.is_finite() { worst.max(difference / WALL) } else { f64::INFINITY };
            }
        }
        worst
    }
}

/// The file of the references of the nonlinear filament, which `src/bin/reference.rs` writes.
pub const STORED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/nonlinear.json");

/// Cells of the stored references: every 25th, and the two at the walls.
pub fn stored_cells() -> Vec<usize> {
    let mut cells: Vec<usize> = (0..CELLS).step_by(25).collect();
    cells.push(CELLS - 1);
    cells
}

fn stored(d: f64) -> Result<Reference, String> {
    let text = std::fs::read_to_string(STORED).map_err(|e| format!("{STORED}: {e}"))?;
    let all: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let numbers = |v: &serde_json::Value| -> Vec<f64> {
        v.as_array().into_iter().flatten().filter_map(serde_json::Value::as_f64).collect()
    };
    let outputs = all[format!("{d}")].as_array().ok_or("no reference for this D")?;
    Ok(Reference { cells: stored_cells(), values: outputs.iter().map(numbers).collect() })
}

fn ready<Eqn, F>(problem: OdeSolverProblem<Eqn>, solve: F) -> Box<dyn Solver>
where
    Eqn: OdeEquationsImplicit<T = f64> + 'static,
    F: Fn(&OdeSolverProblem<Eqn>, &mut [Eqn::V]) -> Result<(), DiffsolError> + 'static,
{
    let outputs = TIMES.map(|_| problem.atol.clone()).into();
    Box::new(Diffsol { problem, solve, outputs })
}

/// The linear filament, as a user of diffsol writes it.
fn linear<M: Matrix<T = f64> + 'static>(
    d: f64,
    tolerance: f64,
) -> Result<OdeSolverProblem<impl OdeEquationsImplicit<M = M, V = M::V, T = f64, C = M::C>>, DiffsolError> {
    let apply = move |x: &[f64], wall: f64, y: &mut [f64]| {
        let last = CELLS - 1;
        y[0] = d * (wall + x[1] - 2.0 * x[0]) - MU * x[0];
        for (y, x) in y[1..last].iter_mut().zip(x.windows(3)) {
            *y = d * (x[0] + x[2] - 2.0 * x[1]) - MU * x[1];
        }
        y[last] = d * (x[last - 1] + wall - 2.0 * x[last]) - MU * x[last];
    };
    OdeBuilder::<M>::new()
        .rtol(tolerance)
        .atol([tolerance * WALL])
        .rhs_implicit(move |x, _, _, y| apply(x, WALL, y), move |_, _, _, v, y| apply(v, 0.0, y))
        .init(|_, _, y| y.copy_from_slice(&chain::initial()), CELLS)
        .build()
}

/// The nonlinear filament.
fn nonlinear<M: Matrix<T = f64> + 'static>(
    d: f64,
    tolerance: f64,
) -> Result<OdeSolverProblem<impl OdeEquationsImplicit<M = M, V = M::V, T = f64, C = M::C>>, DiffsolError> {
    let k = d / (2.0 * WALL);
    let rate = move |l: f64, c: f64, r: f64| k * (l * l + r * r - 2.0 * c * c) - MU * c;
    let rhs = move |x: &[f64], _: &[f64], _: f64, y: &mut [f64]| {
        let last = CELLS - 1;
        y[0] = rate(WALL, x[0], x[1]);
        for (y, x) in y[1..last].iter_mut().zip(x.windows(3)) {
            *y = rate(x[0], x[1], x[2]);
        }
        y[last] = rate(x[last - 1], x[last], WALL);
    };
    let jacobian = move |x: &[f64], _: &[f64], _: f64, v: &[f64], y: &mut [f64]| {
        let last = CELLS - 1;
        let at = |i: usize| 2.0 * k * x[i] * v[i];
        for (i, y) in y.iter_mut().enumerate() {
            let left = if i > 0 { at(i - 1) } else { 0.0 };
            let right = if i < last { at(i + 1) } else { 0.0 };
            *y = left + right - 2.0 * at(i) - MU * v[i];
        }
    };
    OdeBuilder::<M>::new()
        .rtol(tolerance)
        .atol([tolerance * WALL])
        .rhs_implicit(rhs, jacobian)
        .init(|_, _, y| y.copy_from_slice(&chain::initial()), CELLS)
        .build()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both programs solve the same equations: they agree at the first output.
    #[test]
    fn same_equations() {
        for coupling in [Coupling::Linear, Coupling::Nonlinear] {
            let filament = Filament { coupling, d: D_SLOW };
            let mut ours = (filament.dlsys().prepare)(1e-8).expect("a good model");
            let mut theirs = (filament.explicit()[0].prepare)(1e-10).expect("a good problem");
            ours.run().expect("it runs");
            theirs.run().expect("it runs");
            let worst =
                (ours.values(0).iter().zip(theirs.values(0))).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-5, "{coupling:?}: {worst}");
        }
    }
}
