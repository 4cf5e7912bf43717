//! The largest eigenvalues of a self-adjoint operator on strains, by the Rayleigh-Ritz method on a block Krylov space.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::Vector;

/// Vectors that are iterated side by side: stems with round sections have pairs of equal frequencies.
const BLOCK: usize = 4;

/// Eigenvalues, largest first, with their vectors, which have norm 1 in the inner product.
pub(crate) struct Pairs {
    pub values: Vec<f64>,
    pub vectors: Vec<Vec<Vector>>,
}

/// The `count` largest eigenvalues of an operator that is self-adjoint in an inner product, from at most `room` vectors of a Krylov space.
pub(crate) fn largest(
    size: usize,
    count: usize,
    room: usize,
    mut apply: impl FnMut(&[Vector]) -> Vec<Vector>,
    mut dual: impl FnMut(&[Vector]) -> Vec<Vector>,
) -> Pairs {
    let mut basis: Vec<Vec<Vector>> = Vec::new();
    let mut duals: Vec<Vec<Vector>> = Vec::new();
    let mut images: Vec<Vec<Vector>> = Vec::new();
    let mut waiting: Vec<Vec<Vector>> = (0..BLOCK).map(|seed| apply(&start(size, seed))).collect();
    let mut next = 0;
    while basis.len() < room.min(3 * size) {
        let mut vector = if next < waiting.len() { std::mem::take(&mut waiting[next]) } else { break };
        next += 1;
        let before = dot(&vector, &dual(&vector)).max(0.0).sqrt();
        // Twice, because once leaves what rounding put in.
        for _ in 0..2 {
            for (other, image) in basis.iter().zip(&duals) {
                let part = dot(&vector, image);
                subtract(&mut vector, other, part);
            }
        }
        let mut image = dual(&vector);
        let norm = dot(&vector, &image).max(0.0).sqrt();
        if norm <= 1e-10 * before || !norm.is_finite() {
            continue;
        }
        for value in vector.iter_mut().chain(&mut image) {
            *value /= norm;
        }
        let applied = apply(&vector);
        waiting.push(applied.clone());
        basis.push(vector);
        duals.push(image);
        images.push(applied);
    }
    let m = basis.len();
    if m == 0 {
        return Pairs { values: Vec::new(), vectors: Vec::new() };
    }
    let matrix =
        DMatrix::from_fn(m, m, |i, j| 0.5 * (dot(&duals[i], &images[j]) + dot(&duals[j], &images[i])));
    let eigen = SymmetricEigen::new(matrix);
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order.truncate(count);
    let vectors = order
        .iter()
        .map(|&k| {
            let mut vector = vec![Vector::zeros(); size];
            for (j, part) in basis.iter().enumerate() {
                subtract(&mut vector, part, -eigen.eigenvectors[(j, k)]);
            }
            vector
        })
        .collect();
    Pairs { values: order.iter().map(|&k| eigen.eigenvalues[k]).collect(), vectors }
}

/// A start that no symmetry makes orthogonal to a bending mode: fixed numbers without a pattern. Twist comes in where it is coupled with bending.
fn start(size: usize, seed: usize) -> Vec<Vector> {
    let draw = |k: usize| ((k * BLOCK + seed + 1) as f64 * 12.9898).sin() * 43758.5453 % 1.0;
    (0..size).map(|i| Vector::new(0.0, draw(2 * i), draw(2 * i + 1))).collect()
}

fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn subtract(from: &mut [Vector], other: &[Vector], factor: f64) {
    for (value, other) in from.iter_mut().zip(other) {
        *value -= other * factor;
    }
}
