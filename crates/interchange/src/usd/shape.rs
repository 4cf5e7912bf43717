//! Lives as meshes with samples of their points.
//!
//! Organs mostly grow and change their shape at once, and growing needs many samples: so their size is a scale of its own, and points are
//! sampled as if the organ always had its largest size. Normals have samples of their own.

use dlsys_geometry::scene::{MaterialId, Vector};

use crate::life::{Life, Shape};
use crate::mesh::{Cutter, Places};
use crate::part::{self, distance, reach};
use crate::stem::{Corner, IS_LENGTH, SIZES};
use crate::thin::thin;
use crate::track::Phase;

/// Largest difference of a component of a normal from that between samples.
const SAME_NORMAL: f32 = 0.08;

/// So many times a stretch of time is cut into halves at most; each makes what is wrong there four times smaller.
const MOST_HALVINGS: usize = 12;

/// Values at ages, in units of the model; a single value has no age.
pub(super) struct Samples<T> {
    pub(super) ages: Vec<f64>,
    pub(super) values: Vec<T>,
}

impl<T> Samples<T> {
    /// The same at all ages.
    pub(super) fn still(value: T) -> Samples<T> {
        Samples { ages: Vec::new(), values: vec![value] }
    }

    fn at(ages: Vec<f64>, values: Vec<T>) -> Samples<T> {
        Samples { ages: if values.len() > 1 { ages } else { Vec::new() }, values }
    }
}

/// The triangles of one material of a life, and where their corners lie.
pub(super) struct Primitive {
    pub(super) material: MaterialId,
    pub(super) triangles: Vec<u32>,
    /// Where the corners lie in the picture of the material; empty without one.
    pub(super) pinned: Vec<[f32; 2]>,
    pub(super) points: Samples<Vec<[f32; 3]>>,
    pub(super) normals: Samples<Vec<[f32; 3]>>,
}

/// The mesh of a life.
pub(super) struct Form {
    pub(super) primitives: Vec<Primitive>,
    /// How large it is, as a part of its points, if that changes.
    pub(super) size: Option<Samples<f64>>,
}

/// Largest differences from the model, in metres.
#[derive(Clone, Copy)]
pub(super) struct Tolerance {
    pub(super) size: f64,
    pub(super) shape: f64,
}

/// The mesh of a life, made of the phase that it is the life of.
pub(super) fn form(life: &Life, phase: &Phase, cutter: &Cutter<'_>, tolerance: Tolerance) -> Form {
    match &life.shape {
        Shape::Stem { contour, neck, size, weights } => {
            Form { primitives: vec![stem(life, cutter, ((*contour, *neck), *size), weights)], size: None }
        }
        Shape::Still(shape) => {
            Form { primitives: primitives(life, cutter, &[], std::slice::from_ref(shape)), size: None }
        }
        Shape::Mixed { .. } => changing(life, phase, cutter, tolerance),
    }
}

/// A changing drawing at ages between which size and shape may be taken as linear.
struct Drawings {
    ages: Vec<f64>,
    /// A bound of the distance of all corners from the origin, and the largest of them.
    sizes: Vec<f64>,
    largest: f64,
    /// The numbers as if the organ always had its largest size.
    shapes: Vec<Vec<f32>>,
}

impl Drawings {
    /// The drawings of a phase. Between its samples it moves linearly, and the product of a size and a shape that are linear does not: so
    /// there are as many ages in between as it takes to come half as near as is tolerated.
    fn new(phase: &Phase, form: &part::Form, tolerance: f64) -> Drawings {
        let mut ages: Vec<f64> = (0..phase.times.len()).map(|i| phase.age(i)).collect();
        let mut numbers: Vec<Vec<f32>> = (0..ages.len()).map(|i| phase.numbers(i).to_vec()).collect();
        for _ in 0..MOST_HALVINGS {
            let drawings = Drawings::of(form, &ages, &numbers);
            let is_bent = |i: &usize| drawings.bend(form, *i) > 0.5 * tolerance;
            let bent: Vec<usize> = (0..ages.len().saturating_sub(1)).filter(is_bent).collect();
            if bent.is_empty() {
                return drawings;
            }
            for i in bent.into_iter().rev() {
                let half = numbers[i].iter().zip(&numbers[i + 1]).map(|(a, b)| a + 0.5 * (b - a)).collect();
                ages.insert(i + 1, ages[i] + 0.5 * (ages[i + 1] - ages[i]));
                numbers.insert(i + 1, half);
            }
        }
        Drawings::of(form, &ages, &numbers)
    }

    fn of(form: &part::Form, ages: &[f64], numbers: &[Vec<f32>]) -> Drawings {
        let sizes: Vec<f64> = numbers.iter().map(|own| reach(form, own)).collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let mut drawings = Drawings { ages: ages.to_vec(), sizes, largest, shapes: Vec::new() };
        // Without a size there is no shape either: that of the next age.
        for (i, own) in numbers.iter().enumerate().rev() {
            let part = drawings.part(i);
            drawings.shapes.push(match (part > 1e-6, drawings.shapes.last()) {
                (false, Some(next)) => next.clone(),
                (false, None) => own.clone(),
                (true, _) => own.iter().map(|x| (f64::from(*x) / part) as f32).collect(),
            });
        }
        drawings.shapes.reverse();
        drawings
    }

    /// The size as a part of the largest.
    fn part(&self, i: usize) -> f64 {
        if self.largest > 0.0 { self.sizes[i] / self.largest } else { 1.0 }
    }

    /// How far corners are, half way to the next age, from the middle between where they are at both.
    fn bend(&self, form: &part::Form, i: usize) -> f64 {
        let (here, next) = (&self.shapes[i], &self.shapes[i + 1]);
        0.25 * (self.part(i + 1) - self.part(i)).abs() * distance(form, [here, next], 0.0, next)
    }
}

fn changing(life: &Life, phase: &Phase, cutter: &Cutter<'_>, tolerance: Tolerance) -> Form {
    let drawings = Drawings::new(phase, &life.form, tolerance.shape);
    let Drawings { ages, sizes, largest, shapes } = &drawings;
    let between = |i: usize, j: usize, k: usize| (ages[k] - ages[i]) / (ages[j] - ages[i]);
    let kept = thin(ages.len(), |i, j| {
        (i + 1..j).all(|k| {
            let off = distance(&life.form, [&shapes[i], &shapes[j]], between(i, j, k), &shapes[k]);
            off * drawings.part(k) <= tolerance.shape
        })
    });
    let keys: Vec<f64> = kept.iter().map(|&i| ages[i]).collect();
    let shapes: Vec<Vec<f32>> = kept.iter().map(|&i| shapes[i].clone()).collect();
    let of_size = thin(ages.len(), |i, j| {
        (i + 1..j).all(|k| {
            let linear = sizes[i] + (sizes[j] - sizes[i]) * between(i, j, k);
            (linear - sizes[k]).abs() <= tolerance.size
        })
    });
    let is_growing = sizes.iter().any(|size| largest - size > tolerance.size);
    let size = is_growing.then(|| {
        let parts = of_size.iter().map(|&i| drawings.part(i)).collect();
        Samples::at(of_size.iter().map(|&i| ages[i]).collect(), parts)
    });
    Form { primitives: primitives(life, cutter, &keys, &shapes), size }
}

/// The primitives of a life with these numbers at these ages.
fn primitives(life: &Life, cutter: &Cutter<'_>, ages: &[f64], numbers: &[Vec<f32>]) -> Vec<Primitive> {
    // The mature one first: faces with many corners are cut as that has them.
    let backwards: Vec<Vec<f32>> = numbers.iter().rev().cloned().collect();
    let layout = cutter.layout(&life.form, &life.paint, &backwards);
    let mut places: Vec<Vec<Places>> = layout.primitives.iter().map(|_| Vec::new()).collect();
    for own in numbers {
        places.iter_mut().zip(layout.places(own)).for_each(|(all, own)| all.push(own));
    }
    let pinned = layout.pinned();
    let all = layout.primitives.into_iter().zip(pinned).zip(places);
    let all = all.filter(|(((_, triangles), _), _)| !triangles.is_empty());
    all.map(|(((material, triangles), pinned), shapes)| {
        let (points, mut normals): (Vec<_>, Vec<_>) =
            shapes.into_iter().map(|places| (places.positions, places.normals)).unzip();
        complete(&mut normals);
        let points = Samples::at(ages.to_vec(), points);
        Primitive { material, triangles, pinned, points, normals: few(ages, normals) }
    })
    .collect()
}

/// Normals with as few samples as needed.
fn few(ages: &[f64], normals: Vec<Vec<[f32; 3]>>) -> Samples<Vec<[f32; 3]>> {
    let kept = thin(normals.len(), |i, j| {
        (i + 1..j).all(|k| {
            let w = ((ages[k] - ages[i]) / (ages[j] - ages[i])) as f32;
            let components = normals[i].as_flattened().iter().zip(normals[j].as_flattened());
            let mut all = components.zip(normals[k].as_flattened());
            all.all(|((a, b), own)| (a + (b - a) * w - own).abs() <= SAME_NORMAL)
        })
    });
    let chosen: Vec<Vec<[f32; 3]>> = kept.iter().map(|&i| normals[i].clone()).collect();
    let near = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() <= SAME_NORMAL)
    };
    match &chosen[..] {
        [first, last] if near(first, last) => Samples::still(last.clone()),
        _ => Samples::at(kept.iter().filter_map(|&i| ages.get(i).copied()).collect(), chosen),
    }
}

/// A corner that has no normal at some age, because nothing there has an area, gets that of the nearest later age, or of the nearest earlier one.
fn complete(normals: &mut [Vec<[f32; 3]>]) {
    let count = normals.len();
    for corner in 0..normals.first().map_or(0, Vec::len) {
        let mut known = [0.0; 3];
        for i in (0..count).rev().chain(0..count) {
            let own = &mut normals[i][corner];
            if *own == [0.0; 3] {
                *own = known;
            }
            known = *own;
        }
        for own in normals.iter_mut().filter(|own| own[corner] == [0.0; 3]) {
            own[corner] = [0.0, 1.0, 0.0];
        }
    }
}

fn stem(
    life: &Life,
    cutter: &Cutter<'_>,
    (form, size): ((Option<u32>, bool), f32),
    weights: &[f32],
) -> Primitive {
    let sizes = weights.chunks_exact(life.shape.targets()).map(|own| {
        let mut sizes = [0.0; SIZES];
        sizes.iter_mut().zip(own).for_each(|(out, w)| *out = f64::from((1.0 - w) * size));
        sizes
    });
    let sizes: Vec<[f64; SIZES]> = sizes.collect();
    let radii = sizes.iter().flat_map(|own| own.iter().zip(IS_LENGTH)).filter(|(_, is_length)| !is_length);
    let thickest = radii.map(|(size, _)| *size).fold(0.0, f64::max);
    let tube = cutter.tube(form, thickest);
    // The frame of a stem: its direction is +Y, across is -X.
    let axes = [-Vector::x(), Vector::z(), Vector::y()];
    let normal = |corner: &Corner| Corner::turned(corner.normal, axes).map(|x| x as f32).into();
    let normals: Vec<[f32; 3]> = tube.corners.iter().map(normal).collect();
    let place = |corner: &Corner, sizes: &[f64; SIZES]| -> [f32; 3] {
        let [height, radius] = corner.sized(sizes);
        let place = Corner::turned(corner.place, axes) * radius + Vector::y() * height;
        place.map(|x| x as f32).into()
    };
    let points = sizes.iter().map(|sizes| tube.corners.iter().map(|corner| place(corner, sizes)).collect());
    Primitive {
        material: life.paint.first().copied().flatten().unwrap_or(MaterialId::STEM),
        triangles: tube.triangles.iter().flatten().copied().collect(),
        pinned: Vec::new(),
        points: Samples::at(life.ages.clone(), points.collect()),
        normals: Samples::still(normals),
    }
}
