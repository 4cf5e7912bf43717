//! Normals of meshes whose shapes are sums: normals of sums are no sums of normals, so they are fitted to examples.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::blend::Example;
use crate::mesh::{Layout, Places};

/// Part of the largest diagonal element that is added to all, so that directions which no example shows stay 0.
const RIDGE: f64 = 1e-6;

/// Replaces the normals of all shapes but the first by those whose sums are nearest to the normals of the examples (least squares).
pub(super) fn fit(layout: &Layout, examples: &[Example], all: &mut [Vec<Places>]) {
    let count = all.len().saturating_sub(1);
    if examples.is_empty() || count == 0 {
        return;
    }
    let weights = DMatrix::from_fn(examples.len(), count, |i, k| f64::from(examples[i].weights[k]));
    let mut square = weights.transpose() * &weights;
    let ridge = RIDGE * square.diagonal().max().max(f64::MIN_POSITIVE);
    square.iter_mut().step_by(count + 1).for_each(|x| *x += ridge);
    let Some(solver) = Cholesky::new(square) else { return };
    let shown: Vec<Vec<Places>> = examples.iter().map(|example| layout.places(&example.numbers)).collect();
    for primitive in 0..layout.primitives.len() {
        let corners = all[0][primitive].normals.len();
        for corner in 0..corners {
            let own = |places: &[Places]| places[primitive].normals[corner];
            // Where the first shape has no normal, that of the mature one.
            let mut base = own(&all[0]);
            if base == [0.0; 3] {
                base = shown.last().map_or(base, |last| own(last));
                all[0][primitive].normals[corner] = base;
            }
            for axis in 0..3 {
                let off = |i: usize| match own(&shown[i]) {
                    normal if normal == [0.0; 3] => 0.0,
                    normal => f64::from(normal[axis] - base[axis]),
                };
                let off = DVector::from_fn(examples.len(), |i, _| off(i));
                let found = solver.solve(&(weights.transpose() * off));
                for (shape, found) in all[1..].iter_mut().zip(found.iter()) {
                    shape[primitive].normals[corner][axis] = base[axis] + *found as f32;
                }
            }
        }
    }
}
