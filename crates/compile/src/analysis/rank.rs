//! Implicit equations that are singular for all values.
//!
//! The determinant of the partial derivatives, as a function of all variables, is zero everywhere, with high probability,
//! if it is zero at many random points (Schwartz 1980, Zippel 1979).

use super::invariance::Random;
use crate::declared::DeclaredAlgebraic;
use dlsys_expr::{Graph, NodeId, Program, eliminate};

/// Number of points at which the matrix is tested.
const POINTS: usize = 24;
/// Minimum number of points at which the matrix must be defined.
const ENOUGH: usize = 6;
/// Pivots up to this size are rounding errors.
const SMALL: f64 = 1e-11;

/// True if equations that read variables below `variables` cannot determine the parameters that they are solved for.
pub fn is_singular(graph: &mut Graph, equations: &[DeclaredAlgebraic], variables: usize) -> bool {
    let n = equations.len();
    let mut partials: Vec<NodeId> = Vec::new();
    for equation in equations {
        for unknown in equations {
            partials.push(graph.derivative(equation.node, unknown.parameter as u32));
        }
    }
    let program = Program::compile(graph, &partials, variables);
    let mut random = Random::new();
    let mut defined = 0;
    for _ in 0..POINTS {
        let point: Vec<f64> = (0..variables).map(|_| random.magnitude()).collect();
        let mut matrix = vec![0.0; n * n];
        program.eval(&point, &mut Vec::new(), &mut matrix);
        if matrix.iter().any(|x| !x.is_finite()) {
            continue;
        }
        if eliminate(&mut matrix, &mut vec![0.0; n]) > SMALL {
            return false;
        }
        defined += 1;
    }
    defined >= ENOUGH
}
