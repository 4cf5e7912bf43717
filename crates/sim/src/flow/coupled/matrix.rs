//! The partial derivatives of a block of implicit equations by its unknowns, as a matrix that is eliminated.

use dlsys_expr::{determinant, eliminate};
use dlsys_ode::Pattern;

/// A matrix is singular if a pivot is at most this part of its row.
const SINGULAR: f64 = 1e-13;
/// Up to this many unknowns are eliminated with pivoting.
pub const FEW: usize = 48;
/// Up to this many unknowns are eliminated with pivoting if elimination without pivoting fails.
const MANY: usize = 1000;

/// The partial derivatives of a block.
pub enum Matrix {
    /// All entries, by rows, of so many unknowns.
    Dense(usize, Vec<f64>),
    /// Those of neighbours only: the pattern, the entries, and the factors.
    Sparse(Pattern, Vec<f64>, Vec<f64>),
    /// No elimination is at hand.
    Singular,
}

impl Matrix {
    /// The matrix of `n` unknowns with these entries: row, column and value. Entries at one place are added.
    pub fn new(entries: Vec<(u32, u32, f64)>, n: usize) -> Matrix {
        if n > FEW {
            let couplings: Vec<(u32, u32)> = entries.iter().map(|e| (e.0, e.1)).collect();
            if let Some(pattern) = Pattern::new(n, &couplings) {
                let mut values = vec![0.0; pattern.entries()];
                for &(i, j, value) in &entries {
                    if let Some(place) = pattern.entry(i as usize, j as usize) {
                        values[place] += value;
                    }
                }
                let mut factors = Vec::new();
                // The matrix itself: no shift, and the opposite sign.
                if pattern.factor(&values, 0.0, -1.0, &mut factors) {
                    return Matrix::Sparse(pattern, values, factors);
                }
            }
            if n > MANY {
                return Matrix::Singular;
            }
        }
        let mut matrix = vec![0.0; n * n];
        for (i, j, value) in entries {
            matrix[i as usize * n + j as usize] += value;
        }
        Matrix::Dense(n, matrix)
    }

    /// The solution for a right-hand side; None if the matrix is singular to rounding.
    pub fn solve(&self, right: &[f64]) -> Option<Vec<f64>> {
        let mut x = right.to_vec();
        match self {
            Matrix::Singular => return None,
            Matrix::Dense(n, matrix) => {
                debug_assert_eq!(*n, right.len());
                let pivot = eliminate(&mut matrix.clone(), &mut x);
                if pivot.is_nan() || pivot <= SINGULAR {
                    return None;
                }
            }
            Matrix::Sparse(pattern, values, factors) => {
                pattern.solve(factors, &mut x);
                // One correction takes back the digits that elimination without pivoting has lost.
                let mut product = vec![0.0; x.len()];
                pattern.multiply(values, &x, &mut product);
                let mut rest: Vec<f64> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
                pattern.solve(factors, &mut rest);
                x.iter_mut().zip(rest).for_each(|(x, r)| *x += r);
            }
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }

    /// The sign of the determinant, and the logarithm of its size; None if it is not known.
    pub fn determinant(&self) -> Option<(f64, f64)> {
        let (sign, log) = match self {
            Matrix::Singular => return None,
            Matrix::Dense(n, matrix) => determinant(&mut matrix.clone(), *n),
            // Elimination keeps the inverses of the pivots in front.
            Matrix::Sparse(pattern, _, factors) => (factors[..pattern.unknowns()].iter())
                .fold((1.0, 0.0), |(sign, log), inverse| (sign * inverse.signum(), log - inverse.abs().ln())),
        };
        (!sign.is_nan() && !log.is_nan()).then_some((sign, log))
    }
}
