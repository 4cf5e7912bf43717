//! Symmetric sparse matrices of 3×3 blocks: one row a point, only blocks on and below the diagonal.

use crate::{Matrix, Vector};

/// Which points are coupled. The blocks below the diagonal are in slots, row by row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pattern {
    /// The first slot of each row, and the number of slots at the end.
    starts: Vec<usize>,
    columns: Vec<u32>,
}

impl Pattern {
    /// The pattern of `rows` points with these pairs, in any order and any number of times.
    pub fn new(rows: usize, mut pairs: Vec<[usize; 2]>) -> Pattern {
        for pair in &mut pairs {
            *pair = [pair[0].max(pair[1]), pair[0].min(pair[1])];
        }
        pairs.sort_unstable();
        pairs.dedup();
        let starts = (0..=rows).map(|row| pairs.partition_point(|pair| pair[0] < row)).collect();
        Pattern { starts, columns: pairs.iter().map(|pair| pair[1] as u32).collect() }
    }

    /// The slot of a pair of the pattern.
    pub fn slot(&self, a: usize, b: usize) -> usize {
        let (row, column) = (a.max(b), a.min(b));
        let start = self.starts[row];
        start + self.columns[start..self.starts[row + 1]].partition_point(|found| (*found as usize) < column)
    }

    fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }
}

/// The blocks of a matrix.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    pub diagonal: Vec<Matrix>,
    pub lower: Vec<Matrix>,
}

impl Blocks {
    /// Sets all blocks to 0.
    pub fn clear(&mut self, pattern: &Pattern) {
        self.diagonal.clear();
        self.diagonal.resize(pattern.starts.len() - 1, Matrix::zeros());
        self.lower.clear();
        self.lower.resize(pattern.columns.len(), Matrix::zeros());
    }

    /// Adds the block of row `a` and column `b`, whose pair has this slot, and its counterpart.
    #[inline(always)]
    pub fn add(&mut self, slot: usize, a: usize, b: usize, block: &Matrix) {
        if a > b {
            self.lower[slot] += block;
        } else {
            self.lower[slot] += block.transpose();
        }
    }

    /// The product with a vector.
    pub fn multiply(&self, pattern: &Pattern, x: &[Vector], y: &mut [Vector]) {
        for (row, diagonal) in self.diagonal.iter().enumerate() {
            let own = x[row];
            let mut sum = diagonal * own;
            for slot in pattern.row(row) {
                let (column, block) = (pattern.columns[slot] as usize, &self.lower[slot]);
                sum += block * x[column];
                y[column] += block.tr_mul(&own);
            }
            // Later rows add to this one.
            y[row] = sum;
        }
    }

    /// Symmetric Gauss-Seidel: solves `(D + L) D⁻¹ (D + Lᵀ) z = r`, with the inverses of D.
    pub fn sweep(&self, pattern: &Pattern, inverse: &[Matrix], r: &[Vector], z: &mut [Vector]) {
        let rows = self.diagonal.len();
        for row in 0..rows {
            let mut sum = r[row];
            for slot in pattern.row(row) {
                sum -= self.lower[slot] * z[pattern.columns[slot] as usize];
            }
            z[row] = inverse[row] * sum;
        }
        // z is D⁻¹ times the solution of the first half; what later rows take from earlier ones is gathered in place.
        for row in (0..rows).rev() {
            let own = z[row];
            for slot in pattern.row(row) {
                let column = pattern.columns[slot] as usize;
                z[column] -= inverse[column] * self.lower[slot].tr_mul(&own);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_sweeps_are_those_of_the_full_matrix() {
        let pattern = Pattern::new(4, vec![[0, 1], [3, 1], [2, 3], [1, 0], [0, 3]]);
        let mut blocks = Blocks::default();
        blocks.clear(&pattern);
        let mut full = nalgebra::DMatrix::<f64>::zeros(12, 12);
        let mut number = 0.3;
        let mut block = || {
            Matrix::from_fn(|_, _| {
                number = (number * 7.13 + 0.17_f64).fract();
                number - 0.5
            })
        };
        for (a, b) in [(1, 0), (1, 3), (2, 3), (0, 3)] {
            let part = block();
            blocks.add(pattern.slot(a, b), a, b, &part);
            let mut view = full.view_mut((3 * a, 3 * b), (3, 3));
            view += part;
            let mut view = full.view_mut((3 * b, 3 * a), (3, 3));
            view += part.transpose();
        }
        for row in 0..4 {
            let part = block();
            blocks.diagonal[row] = part * part.transpose() + Matrix::identity() * 4.0;
            full.view_mut((3 * row, 3 * row), (3, 3)).copy_from(&blocks.diagonal[row]);
        }
        let x: Vec<Vector> = (0..4).map(|k| Vector::new(k as f64, 1.0, -0.5)).collect();
        let flat = nalgebra::DVector::from_iterator(12, x.iter().flat_map(|x| x.iter().copied()));
        let mut y = vec![Vector::zeros(); 4];
        blocks.multiply(&pattern, &x, &mut y);
        let expected = &full * &flat;
        let inverse: Vec<_> = blocks.diagonal.iter().map(|block| block.try_inverse().unwrap()).collect();
        let mut z = vec![Vector::zeros(); 4];
        blocks.sweep(&pattern, &inverse, &x, &mut z);
        let diagonal =
            nalgebra::DMatrix::from_fn(12, 12, |i, j| if i / 3 == j / 3 { full[(i, j)] } else { 0.0 });
        let lower =
            nalgebra::DMatrix::from_fn(12, 12, |i, j| if i / 3 >= j / 3 { full[(i, j)] } else { 0.0 });
        let split = &lower * diagonal.clone().try_inverse().unwrap() * lower.transpose();
        let solved = split.try_inverse().unwrap() * flat;
        for k in 0..12 {
            assert!((y[k / 3][k % 3] - expected[k]).abs() < 1e-13);
            assert!((z[k / 3][k % 3] - solved[k]).abs() < 1e-12, "{k}");
        }
    }
}
