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
    let (smallest, _) = reduce(a, b);
    if smallest.is_nan() || smallest == 0.0 {
        return smallest;
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k * n + k];
    }
    smallest
}

/// The sign of the determinant of a square matrix of `n` rows, stored by rows and written over, and the logarithm of its
/// size: 0 and minus infinity for a singular one.
pub fn determinant(a: &mut [f64], n: usize) -> (f64, f64) {
    let (smallest, is_even) = reduce(a, &mut vec![0.0; n]);
    if smallest == 0.0 {
        return (0.0, f64::NEG_INFINITY);
    }
    let sign = if is_even { 1.0 } else { -1.0 };
    (0..n).map(|k| a[k * n + k]).fold((sign, 0.0), |(sign, log), x| (sign * x.signum(), log + x.abs().ln()))
}

/// Makes a matrix triangular, with `b` as one more column. Returns the smallest pivot, 0 or NaN where there is none, and
/// whether the number of exchanges is even.
fn reduce(a: &mut [f64], b: &mut [f64]) -> (f64, bool) {
    let n = b.len();
    let (mut smallest, mut is_even) = (f64::INFINITY, true);
    for k in 0..n {
        let better = |i: &usize, j: &usize| a[i * n + k].abs().total_cmp(&a[j * n + k].abs());
        let pivot = (k..n).max_by(better).unwrap_or(k);
        let size = a[pivot * n + k].abs();
        if size.is_nan() || size == 0.0 {
            return (if size.is_nan() { f64::NAN } else { 0.0 }, is_even);
        }
        smallest = smallest.min(size);
        if pivot != k {
            (0..n).for_each(|j| a.swap(k * n + j, pivot * n + j));
            b.swap(k, pivot);
            is_even = !is_even;
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
    (smallest, is_even)
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

    #[test]
    fn determinants_have_their_signs_and_do_not_overflow() {
        let (sign, log) = determinant(&mut [0.0, 2.0, 3.0, 1.0], 2);
        assert!(sign == -1.0 && (log - 6.0_f64.ln()).abs() < 1e-15);
        let (sign, log) = determinant(&mut [0.0, 1e300, 0.0, 0.0, 0.0, -1e300, 1e300, 0.0, 0.0], 3);
        assert!(sign == -1.0 && (log - 3.0 * 1e300_f64.ln()).abs() < 1e-12);
        assert_eq!(determinant(&mut [1.0, 2.0, 2.0, 4.0], 2), (0.0, f64::NEG_INFINITY));
    }
}
