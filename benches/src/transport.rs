//! Transport one way along 1,000 cells, for both programs: c_k' = v (c_{k-1} - c_k), c_0 = 1, all empty at first.
//!
//! c_k(t) is the tail from k on of a Poisson distribution of mean v t. All eigenvalues are -v, but the matrix is a single
//! Jordan block, far from normal: its exponential needs another method than that of diffusion.

use diffsol::matrix::MatrixRef;
use diffsol::{
    DefaultDenseMatrix, DiffsolError, FaerMat, Matrix, NalgebraMat, OdeBuilder, OdeEquationsImplicit,
    OdeSolverProblem, VectorRef,
};

use crate::filament::Reference;
use crate::solver::{self, Candidate, Diffsol, Dlsys, Landing, Solver};

pub const CELLS: usize = 1000;
/// Cells that are passed in a unit of time.
pub const SPEED: f64 = 1.0;
/// Output times.
pub const TIMES: [f64; 3] = [100.0, 300.0, 500.0];
/// Largest difference from the exact values at all outputs.
pub const TARGET: f64 = 1e-9;

/// The model in dlsys's language. The last module is nothing but an end.
pub fn text() -> String {
    let cells = vec!["C(0)"; CELLS].join(" ");
    format!(
        "const v = {SPEED}\ninitial string: S(1) {cells} E(0)\n\
         S(l) < C(c): solve dc/dt = v*(l - c)\nC(l) < C(c): solve dc/dt = v*(l - c)\n"
    )
}

pub fn dlsys() -> Candidate {
    let text = text();
    Candidate {
        name: "dlsys".into(),
        prepare: Box::new(move |tolerance| Ok(Box::new(Dlsys::new(&text, tolerance, &TIMES)?))),
    }
}

/// diffsol's explicit method, with each of its vectors and each way to land on an output. Implicit ones are slower by
/// far: nothing is stiff.
pub fn explicit() -> Vec<Candidate> {
    let mut all = Vec::new();
    for landing in [Landing::Interpolate, Landing::Stop] {
        all.push(explicit_with::<NalgebraMat<f64>>("nalgebra", landing));
        all.push(explicit_with::<FaerMat<f64>>("faer", landing));
    }
    all
}

fn explicit_with<M>(vectors: &str, landing: Landing) -> Candidate
where
    M: Matrix<T = f64> + 'static,
    M::V: DefaultDenseMatrix<T = f64, C = M::C>,
    for<'b> &'b M::V: VectorRef<M::V>,
    for<'b> &'b M: MatrixRef<M>,
{
    let prepare = move |tolerance| -> Result<Box<dyn Solver>, String> {
        let problem = problem::<M>(tolerance).map_err(|e| e.to_string())?;
        let outputs = TIMES.map(|_| problem.atol.clone()).into();
        let solve = move |problem: &_, out: &mut [_]| solver::explicit(problem, landing, &TIMES, out);
        Ok(Box::new(Diffsol { problem, solve, outputs }))
    };
    Candidate { name: format!("tsit45 ({vectors}, {landing:?})"), prepare: Box::new(prepare) }
}

/// The problem, as a user of diffsol writes it.
fn problem<M: Matrix<T = f64> + 'static>(
    tolerance: f64,
) -> Result<OdeSolverProblem<impl OdeEquationsImplicit<M = M, V = M::V, T = f64, C = M::C>>, DiffsolError> {
    let apply = move |x: &[f64], source: f64, y: &mut [f64]| {
        y[0] = SPEED * (source - x[0]);
        for (y, x) in y[1..].iter_mut().zip(x.windows(2)) {
            *y = SPEED * (x[0] - x[1]);
        }
    };
    OdeBuilder::<M>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .rhs_implicit(move |x, _, _, y| apply(x, 1.0, y), move |_, _, _, v, y| apply(v, 0.0, y))
        .init(|_, _, y| y.fill(0.0), CELLS)
        .build()
}

/// The reference for the error.
pub fn reference() -> Reference {
    Reference { cells: (0..CELLS).collect(), values: TIMES.map(exact).into() }
}

/// The exact values at a time, to about 13 digits.
pub fn exact(t: f64) -> Vec<f64> {
    let mean = SPEED * t;
    let mut logarithm = -mean;
    let terms: Vec<f64> = (0..4 * CELLS)
        .map(|k| {
            if k > 0 {
                logarithm += (mean / k as f64).ln();
            }
            logarithm.exp()
        })
        .collect();
    // From the tail, so that what is small is known, too.
    let mut above = vec![0.0; CELLS];
    let mut sum = 0.0;
    for (k, term) in terms.iter().enumerate().rev() {
        sum += term;
        if (1..=CELLS).contains(&k) {
            above[k - 1] = sum;
        }
    }
    above
}

/// Largest difference at all outputs.
pub fn error(reference: &Reference, solver: &dyn Solver) -> f64 {
    // The reference divides by the value at the walls of a filament.
    reference.error(solver) * crate::chain::WALL
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both programs solve the same equations, and those are the ones that the reference is of.
    #[test]
    fn same_equations() {
        let reference = reference();
        for candidate in [dlsys(), explicit().swap_remove(0)] {
            let mut solver = (candidate.prepare)(1e-9).expect("a good problem");
            solver.run().expect("it runs");
            let worst = error(&reference, solver.as_ref());
            assert!(worst < 1e-6, "{}: {worst}", candidate.name);
        }
    }

    /// P(501, 500), 50 digits.
    #[test]
    fn agrees_with_fifty_digits() {
        let found = exact(500.0)[500];
        assert!((found - HALF_WAY).abs() < 1e-12, "{found}");
    }

    const HALF_WAY: f64 = 0.48810887830124858;
}
