//! Gaussian elimination with pivoting, for the few unknowns of a small system.
//!
//! Rows are scaled by their largest entries and the pivot is sought in the column (Golub and Van Loan 2013, 3.4).

/// Solves `a x = b` for a square matrix stored by rows; both are written over, and `b` becomes x. Returns the smallest
/// pivot, in units of the scaled rows: 0, or the rounding of it, for a singular matrix.
pub fn eliminate(a: &mut [f64], b: &mut [f64]) -> f64 {
    let n = b.len();
    for (row, b) in a.chunks_mut(n.max(1)).zip(b.iter_mut()) {
        let size = row.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if size > 0.0 {
            row.iter_mut().for_each(|x| *x /= size);
            *b /= size;
        }
    }
    let mut smallest = f64::INFINITY;
    for k in 0..n {
        let better = |i: &usize, j: &usize| a[i * n + k].abs().total_cmp(&a[j * n + k].abs());
        let pivot = (k..n).max_by(better).unwrap_or(k);
        let size = a[pivot * n + k].abs();
        if size.is_nan() || size == 0.0 {
            return if size.is_nan() { f64::NAN } else { 0.0 };
        }
        smallest = smallest.min(size);
        if pivot != k {
            (0..n).for_each(|j| a.swap(k * n + j, pivot * n + j));
            b.swap(k, pivot);
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            if factor != 0.0 {
                for j in k..n {
                    a[i * n + j] -= factor * a[k * n + j];
                }
                b[i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k * n + k];
    }
    smallest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_in_the_corner_is_no_obstacle_and_a_singular_matrix_is_seen() {
        let mut b = [5.0, 4.0];
        assert!(eliminate(&mut [0.0, 2.0, 1.0, 1.0], &mut b) > 0.1);
        assert_eq!(b, [1.5, 2.5]);
        assert!(eliminate(&mut [1e-3, 1e-3, 0.2, 0.2], &mut [1.0, 1.0]) < 1e-15);
    }
}
