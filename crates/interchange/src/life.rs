//! Lives: modules whose parts go through the same shapes at the same ages share one.
//!
//! The drawing of a module in its own frame is mostly a function of its age. So modules are compared, the longest first, by the numbers of their parts at
//! the same age; those that agree get one mesh, and each its own place and time.

use std::collections::HashMap;

use dlsys_geometry::scene::Vector;

use crate::Error;
use crate::blend::{Example, blend};
use crate::part::{Form, Paint, Part, distance, stem_point};
use crate::stem::SIZES;
use crate::thin::{place, thin};
use crate::track::Phase;

/// Lives with which a module is compared, at most: where chance makes all lives different, comparing all would take forever.
const TRIED: usize = 400;

/// The shapes of modules of one kind of life, by age.
#[derive(Debug)]
pub(crate) struct Life {
    pub(crate) form: Form,
    pub(crate) paint: Paint,
    /// Name of the kind of the first module.
    pub(crate) kind: std::sync::Arc<str>,
    /// Ages at which the weights are given, ascending.
    pub(crate) ages: Vec<f64>,
    pub(crate) shape: Shape,
    /// The phase that it was made of.
    pub(crate) model: usize,
}

/// How a shape is made of others.
#[derive(Debug)]
pub(crate) enum Shape {
    /// The same at all ages.
    Still(Vec<f32>),
    /// The first shape, and of each other one as much as its weight says, from 0 to 1, instead. Weights by age, one for each other shape.
    /// `examples` are for the normals of corners, which are no sums; without them each shape has its own.
    Mixed { shapes: Vec<Vec<f32>>, weights: Vec<f32>, examples: Vec<Example> },
    /// A straight stem of this contour, with a neck or none: one whose [sizes](crate::stem::SIZES) are 1, enlarged by `size`. Weights by age: how much smaller each of these
    /// is.
    Stem { contour: Option<u32>, neck: bool, size: f32, weights: Vec<f32> },
}

impl Shape {
    /// How many weights it has at an age.
    pub(crate) fn targets(&self) -> usize {
        match self {
            Shape::Still(_) => 0,
            Shape::Mixed { shapes, .. } => shapes.len() - 1,
            Shape::Stem { neck, .. } => {
                if *neck {
                    SIZES
                } else {
                    3
                }
            }
        }
    }
}

/// Lives, and the number of the life of each phase.
#[derive(Debug)]
pub(crate) struct Lives {
    pub(crate) lives: Vec<Life>,
    pub(crate) of_phase: Vec<usize>,
}

/// Largest differences of shapes, in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Of modules of one life.
    pub(crate) likeness: f64,
    /// Of a shape from what its weights make.
    pub(crate) mix: f64,
    /// The same where triangles stand for themselves, not for curved surfaces.
    pub(crate) mix_of_nets: f64,
}

impl Phase {
    /// The age of the module at a sample.
    pub(crate) fn age(&self, i: usize) -> f64 {
        self.times[i] - self.birth
    }

    /// Its numbers at an age.
    fn at_age(&self, ages: &[f64], age: f64, out: &mut Vec<f32>) {
        let (i, w) = place(ages, age);
        let (a, b) = (self.numbers(i), self.numbers((i + 1).min(self.times.len() - 1)));
        out.clear();
        out.extend(a.iter().zip(b).map(|(a, b)| a + (b - a) * w as f32));
    }

    /// Whether the other one has its colours at the same age, or at one that differs by little.
    fn is_coloured_like(&self, other: &Phase, slack: f64) -> bool {
        const NEAR: f64 = 0.03;
        let [first, last] = [0, self.times.len() - 1].map(|i| self.age(i));
        let near = slack + NEAR * (last - first);
        [first, (first + last) / 2.0, last].into_iter().all(|age| {
            let own = self.paint_at(self.birth + age);
            let moments = [age - near, age, age + near].map(|age| other.birth + age);
            let among = other.paints.iter().filter(|(from, _)| *from >= moments[0] && *from <= moments[2]);
            moments.iter().map(|t| other.paint_at(*t)).chain(among.map(|(_, paint)| paint)).any(|p| p == own)
        })
    }

    /// Whether it goes through the same shapes as another one, which has been there at all its ages.
    fn is_like(&self, other: &Phase, ages: &[f64], slack: f64, tolerance: f64, room: &mut Vec<f32>) -> bool {
        let count = self.times.len();
        let (Some(first), Some(last)) = (ages.first(), ages.last()) else { return false };
        if self.age(0) < first - slack || self.age(count - 1) > last + slack {
            return false;
        }
        if !self.is_coloured_like(other, slack) {
            return false;
        }
        // Differences are largest at the end, mostly.
        let order = [count - 1, 0, count / 2].into_iter().chain(0..count);
        for i in order {
            other.at_age(ages, self.age(i), room);
            if distance(&self.form, [room, room], 0.0, self.numbers(i)) > tolerance {
                return false;
            }
        }
        true
    }
}

/// Finds the lives of phases. `slack` is how far apart in time the same appearance may be found for two modules.
///
/// # Errors
/// If a life would have more than `most` weights.
pub(crate) fn lives(phases: &[Phase], tolerance: Tolerance, slack: f64, most: usize) -> Result<Lives, Error> {
    let span = |i: &usize| phases[*i].times.last().unwrap_or(&0.0) - phases[*i].times.first().unwrap_or(&0.0);
    let mut order: Vec<usize> = (0..phases.len()).collect();
    order.sort_by(|a, b| span(b).total_cmp(&span(a)).then(a.cmp(b)));
    let mut models: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut known: HashMap<Form, Vec<usize>> = HashMap::new();
    let mut of_phase = vec![0; phases.len()];
    let mut room = Vec::new();
    for i in order {
        let phase = &phases[i];
        let same = known.entry(phase.form.clone()).or_default();
        let found = same.iter().rev().take(TRIED).copied().find(|&life| {
            let (model, ages): &(usize, Vec<f64>) = &models[life];
            phase.is_like(&phases[*model], ages, slack, tolerance.likeness, &mut room)
        });
        of_phase[i] = found.unwrap_or_else(|| {
            models.push((i, (0..phase.times.len()).map(|k| phase.age(k)).collect()));
            same.push(models.len() - 1);
            models.len() - 1
        });
    }
    let mix = |phase: &Phase| match phase.form.iter().all(|part| matches!(part, Part::Net(..))) {
        true => tolerance.mix_of_nets,
        false => tolerance.mix,
    };
    let lives = models.into_iter().map(|(i, ages)| life(i, &phases[i], &ages, mix(&phases[i]), most));
    Ok(Lives { lives: lives.collect::<Result<_, Error>>()?, of_phase })
}

fn life(model: usize, phase: &Phase, ages: &[f64], tolerance: f64, most: usize) -> Result<Life, Error> {
    let (ages, shape) = match &phase.form[..] {
        [Part::Stem(contour)] => stem(phase, ages, (*contour, false), tolerance),
        [Part::Shoot(contour)] => stem(phase, ages, (*contour, true), tolerance),
        _ => match still(phase, ages, tolerance).or_else(|| line(phase, ages, tolerance)) {
            Some(found) => found,
            None => mixed(phase, ages, tolerance, most)?,
        },
    };
    let (form, paint, kind) = (phase.form.clone(), phase.paint().clone(), phase.kind.clone());
    Ok(Life { form, paint, kind, ages, shape, model })
}

/// One shape, if all are near to one.
fn still(phase: &Phase, ages: &[f64], tolerance: f64) -> Option<(Vec<f64>, Shape)> {
    let middle = phase.numbers(ages.len() / 2);
    let near = |i: usize| distance(&phase.form, [middle, middle], 0.0, phase.numbers(i)) <= tolerance;
    (0..ages.len()).all(near).then(|| (Vec::new(), Shape::Still(middle.to_vec())))
}

/// Two shapes and what lies between them, if all do: organs that grow in one way only.
fn line(phase: &Phase, ages: &[f64], tolerance: f64) -> Option<(Vec<f64>, Shape)> {
    let square =
        |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum() };
    let furthest = |from: usize| {
        let all = (0..ages.len()).map(|i| (i, square(phase.numbers(from), phase.numbers(i))));
        all.fold((from, 0.0), |best, next| if next.1 > best.1 { next } else { best })
    };
    let (large, _) = furthest(0);
    let (small, span) = furthest(large);
    // The later one is the shape of the mesh itself.
    let (large, small) = (large.max(small), large.min(small));
    let (a, b) = (phase.numbers(large), phase.numbers(small));
    let mut weights = Vec::with_capacity(ages.len());
    for i in 0..ages.len() {
        let own = phase.numbers(i);
        let along: f64 =
            (a.iter().zip(b).zip(own)).map(|((a, b), x)| f64::from(b - a) * f64::from(x - a)).sum();
        let weight = (along / span).clamp(0.0, 1.0);
        if distance(&phase.form, [a, b], weight, own) > tolerance / 2.0 {
            return None;
        }
        weights.push(weight as f32);
    }
    let greatest = distance(&phase.form, [a, a], 0.0, b);
    let kept = thin(ages.len(), |i, j| {
        (i + 1..j).all(|k| {
            let w = (ages[k] - ages[i]) / (ages[j] - ages[i]);
            let mixed = f64::from(weights[i]) + f64::from(weights[j] - weights[i]) * w;
            (mixed - f64::from(weights[k])).abs() * greatest <= tolerance / 2.0
        })
    });
    let shape = Shape::Mixed {
        shapes: vec![a.to_vec(), b.to_vec()],
        weights: kept.iter().map(|&i| weights[i]).collect(),
        examples: Vec::new(),
    };
    Some((kept.iter().map(|&i| ages[i]).collect(), shape))
}

/// Shapes at ages between which straight lines are near enough, or, if these are fewer, shapes of which those at all ages are sums.
fn mixed(phase: &Phase, ages: &[f64], tolerance: f64, most: usize) -> Result<(Vec<f64>, Shape), Error> {
    let kept = thin(ages.len(), |i, j| {
        (i + 1..j).all(|k| {
            let w = (ages[k] - ages[i]) / (ages[j] - ages[i]);
            distance(&phase.form, [phase.numbers(i), phase.numbers(j)], w, phase.numbers(k)) <= tolerance
        })
    });
    let count = kept.len();
    let numbers: Vec<&[f32]> = (0..ages.len()).map(|i| phase.numbers(i)).collect();
    if let Some(found) = blend(&phase.form, ages, &numbers, count.saturating_sub(1), tolerance) {
        return Ok(found);
    }
    if count.saturating_mul(count) > most {
        return Err(Error::TooManyShapes { kind: phase.kind.to_string(), shapes: count });
    }
    // The last shape, the mature one, is that of the mesh itself.
    let shapes: Vec<Vec<f32>> = kept.iter().rev().map(|&i| phase.numbers(i).to_vec()).collect();
    let mut weights = vec![0.0; count * (count - 1)];
    for key in 0..count - 1 {
        // Shape 1 is the last but one.
        weights[key * (count - 1) + (count - 2 - key)] = 1.0;
    }
    Ok((kept.iter().map(|&i| ages[i]).collect(), Shape::Mixed { shapes, weights, examples: Vec::new() }))
}

/// A straight stem: its lengths and its radii are enough.
fn stem(
    phase: &Phase,
    ages: &[f64],
    (contour, neck): (Option<u32>, bool),
    tolerance: f64,
) -> (Vec<f64>, Shape) {
    let sizes: Vec<[f64; SIZES]> = (0..ages.len())
        .map(|i| {
            let numbers = phase.numbers(i);
            let [(start, lower), (end, upper)] = [0, 1].map(|which| stem_point(numbers, which));
            let (narrow_end, narrow) =
                if neck { stem_point(numbers, 2) } else { (start, [Vector::zeros(); 3]) };
            let [lower, upper, narrow] = [lower, upper, narrow].map(|radii| radii[0].norm());
            [(end - start).norm(), lower, upper, (narrow_end - start).norm(), narrow]
        })
        .collect();
    let size = sizes.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
    let kept = thin(ages.len(), |i, j| {
        (i + 1..j).all(|k| {
            let w = (ages[k] - ages[i]) / (ages[j] - ages[i]);
            let off = |n: usize| (sizes[i][n] + (sizes[j][n] - sizes[i][n]) * w - sizes[k][n]).abs();
            is_near(off, tolerance)
        })
    });
    let kept = match still_sizes(&sizes, tolerance) {
        true => vec![ages.len() / 2],
        false => kept,
    };
    let count = if neck { SIZES } else { 3 };
    let own = kept.iter().flat_map(|&i| &sizes[i][..count]);
    let weights = own.map(|own| (1.0 - own / size).clamp(0.0, 1.0) as f32);
    let shape = Shape::Stem { contour, neck, size: size as f32, weights: weights.collect() };
    (kept.iter().map(|&i| ages[i]).collect(), shape)
}

fn still_sizes(sizes: &[[f64; SIZES]], tolerance: f64) -> bool {
    let middle = sizes[sizes.len() / 2];
    sizes.iter().all(|own| is_near(|n: usize| (own[n] - middle[n]).abs(), tolerance))
}

/// Whether corners move by this much at most where sizes differ by these.
fn is_near(off: impl Fn(usize) -> f64, tolerance: f64) -> bool {
    off(0).max(off(3)) + off(1).max(off(2)).max(off(4)) <= tolerance
}
