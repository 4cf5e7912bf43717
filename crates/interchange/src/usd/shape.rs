//! Lives as meshes with samples of their points.

use dlsys_geometry::scene::{MaterialId, Vector};

use crate::life::{Life, Shape};
use crate::mesh::{Cutter, Places};
use crate::stem::Corner;

/// Normals that differ by less than this from those of the mature shape are not sampled.
const SAME_NORMAL: f32 = 0.01;

/// The triangles of one material of a life, and where their corners lie.
pub(super) struct Primitive {
    pub(super) material: MaterialId,
    pub(super) triangles: Vec<u32>,
    /// One for each age, or one for all.
    pub(super) shapes: Vec<Places>,
}

impl Primitive {
    /// Whether the normals are the same in all shapes.
    pub(super) fn has_one_normal(&self) -> bool {
        let Some(last) = self.shapes.last() else { return true };
        let near = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_NORMAL);
        self.shapes.iter().all(|shape| shape.normals.iter().zip(&last.normals).all(|(a, b)| near(a, b)))
    }
}

/// The primitives of a life: their shapes are at its ages.
pub(super) fn primitives(life: &Life, cutter: &Cutter<'_>) -> Vec<Primitive> {
    if let Shape::Stem { contour, size, weights } = &life.shape {
        return vec![stem(life, cutter, (*contour, *size), weights)];
    }
    let numbers = numbers(life);
    // The mature one first: faces with many corners are cut as that has them.
    let backwards: Vec<Vec<f32>> = numbers.iter().rev().cloned().collect();
    let layout = cutter.layout(&life.form, &life.paint, &backwards);
    let mut primitives: Vec<Primitive> = (layout.primitives.iter())
        .map(|(material, triangles)| Primitive {
            material: *material,
            triangles: triangles.clone(),
            shapes: Vec::with_capacity(numbers.len()),
        })
        .collect();
    for own in &numbers {
        for (primitive, places) in primitives.iter_mut().zip(layout.places(own)) {
            primitive.shapes.push(places);
        }
    }
    primitives.retain(|primitive| !primitive.triangles.is_empty());
    primitives.iter_mut().for_each(complete);
    primitives
}

/// The numbers of a life at each of its ages.
fn numbers(life: &Life) -> Vec<Vec<f32>> {
    match &life.shape {
        Shape::Mixed { shapes, weights, .. } => {
            let count = shapes.len() - 1;
            let sum = |row: &[f32]| -> Vec<f32> {
                let mut sum: Vec<f64> = shapes[0].iter().map(|x| f64::from(*x)).collect();
                for (shape, weight) in shapes[1..].iter().zip(row) {
                    for ((sum, base), x) in sum.iter_mut().zip(&shapes[0]).zip(shape) {
                        *sum += (f64::from(*x) - f64::from(*base)) * f64::from(*weight);
                    }
                }
                sum.into_iter().map(|x| x as f32).collect()
            };
            match count {
                0 => vec![shapes[0].clone()],
                _ => weights.chunks_exact(count).map(sum).collect(),
            }
        }
        Shape::Still(shape) => vec![shape.clone()],
        Shape::Stem { .. } => Vec::new(),
    }
}

/// A corner that has no normal at some age, because nothing there has an area, gets that of the nearest later age, or of the nearest earlier one.
fn complete(primitive: &mut Primitive) {
    let count = primitive.shapes.len();
    for corner in 0..primitive.shapes.first().map_or(0, |shape| shape.normals.len()) {
        let mut known = [0.0; 3];
        for i in (0..count).rev().chain(0..count) {
            let own = &mut primitive.shapes[i].normals[corner];
            if *own == [0.0; 3] {
                *own = known;
            }
            known = *own;
        }
        for shape in primitive.shapes.iter_mut().filter(|shape| shape.normals[corner] == [0.0; 3]) {
            shape.normals[corner] = [0.0, 1.0, 0.0];
        }
    }
}

fn stem(life: &Life, cutter: &Cutter<'_>, (contour, size): (Option<u32>, f32), weights: &[f32]) -> Primitive {
    let sizes: Vec<[f32; 3]> =
        weights.as_chunks::<3>().0.iter().map(|own| own.map(|w| (1.0 - w) * size)).collect();
    let thickest = sizes.iter().map(|[_, a, b]| a.max(*b)).fold(0.0, f32::max);
    let tube = cutter.tube(contour, f64::from(thickest));
    // The frame of a stem: its direction is +Y, across is -X.
    let axes = [-Vector::x(), Vector::z(), Vector::y()];
    let normal = |corner: &Corner| Corner::turned(corner.normal, axes).map(|x| x as f32).into();
    let normals: Vec<[f32; 3]> = tube.corners.iter().map(normal).collect();
    let place = |corner: &Corner, [length, lower, upper]: [f32; 3]| -> [f32; 3] {
        let (radius, height) = if corner.upper { (upper, length) } else { (lower, 0.0) };
        let place = Corner::turned(corner.place, axes) * f64::from(radius) + Vector::y() * f64::from(height);
        place.map(|x| x as f32).into()
    };
    let shape = |sizes: &[f32; 3]| Places {
        positions: tube.corners.iter().map(|corner| place(corner, *sizes)).collect(),
        normals: normals.clone(),
    };
    Primitive {
        material: life.paint.first().copied().flatten().unwrap_or(MaterialId::STEM),
        triangles: tube.triangles.iter().flatten().copied().collect(),
        shapes: sizes.iter().map(shape).collect(),
    }
}
