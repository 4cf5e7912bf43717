//! Components side by side against each alone.

use super::*;
use crate::methods::dop853::Dop853;
use crate::methods::dopri5::Dopri5;
use dlsys_wide::Width;

const H: f64 = 0.3;
const TOLERANCE: f64 = 1e-6;

/// A step of `n` components that differ by orders of magnitude, some of which rest.
fn some(n: usize) -> Workspace {
    let mut seed = n as u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let x = (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        x * 10f64.powi((seed >> 7) as i32 % 9)
    };
    let mut work = Workspace::default();
    work.provide(n, MAX_STAGES);
    for j in 0..n {
        (work.from[j], work.stage[j], work.end[j]) = (random(), random(), random());
        let rests = j % 7 == 3;
        work.k.iter_mut().for_each(|k| k[j] = if rests { 0.0 } else { random() });
    }
    work.is_sum = (0..n).map(|j| j % 5 == 1).collect();
    work.resolution = 1e-12;
    work
}

/// One component of it.
fn alone(work: &Workspace, j: usize) -> Workspace {
    let mut one = Workspace::default();
    one.provide(1, MAX_STAGES);
    (one.from[0], one.stage[0], one.end[0]) = (work.from[j], work.stage[j], work.end[j]);
    one.k.iter_mut().zip(&work.k).for_each(|(one, k)| one[0] = k[j]);
    one.is_sum = vec![work.is_sum[j]];
    one.noise = work.noise.get(j).copied().into_iter().collect();
    one.resolution = work.resolution;
    one
}

fn bits(all: &[f64]) -> Vec<u64> {
    all.iter().map(|x| x.to_bits()).collect()
}

fn check<P: Pair>(mut work: Workspace, n: usize) {
    let scale = Scale::of::<P>(H, TOLERANCE, (work.resolution, work.floor));
    let mut each: Vec<Workspace> = (0..n).map(|j| alone(&work, j)).collect();
    let errors = each.iter().map(|one| one.largest_error::<P>(1, H, TOLERANCE));
    let largest = errors.fold((0.0f64, 0.0f64), |(a, b), (error, rounding)| {
        (if error > a || error.is_nan() { error } else { a }, b.max(rounding))
    });
    let y = work.from[..n].to_vec();
    let polynomials: Vec<f64> = each.iter().flat_map(|one| one.polynomials::<P>(&one.from[..1], H)).collect();
    for width in Width::ALL {
        let Workspace { from, stage: end, is_sum, noise, .. } = &work;
        let step = Tried { k: work.stages(), from, end, is_sum, noise };
        let error = LargestError::<P, _> { step, n, scale, pair: PhantomData };
        let (error, rounding) = dlsys_wide::run_with(width, error);
        assert_eq!(bits(&[error, rounding]), bits(&[largest.0, largest.1]), "{n} components, {width:?}");
        let (k, y, end) = (work.stages(), &y, &work.end);
        let all = Polynomials::<P, _, _> { k, y, end, h: H, out: Vec::new(), pair: PhantomData };
        assert_eq!(bits(&dlsys_wide::run_with(width, all)), bits(&polynomials), "{n}, {width:?}");
    }
    for stage in 1..P::TABLEAU.a.len() {
        work.combine_for::<P>(stage, H);
        each.iter_mut().for_each(|one| one.combine_for::<P>(stage, H));
        let alone: Vec<f64> = each.iter().map(|one| one.stage[0]).collect();
        assert_eq!(bits(&work.stage[..n]), bits(&alone), "stage {stage} of {n}");
    }
    for width in Width::ALL {
        let Workspace { from, k, stage, .. } = &mut work;
        let k = k.first_chunk().expect("all stages");
        let last = Combination::<StageOf<P, 6>, Column> { from, k, stage, h: H, weights: PhantomData };
        dlsys_wide::run_with(width, last);
        each.iter_mut().for_each(|one| one.combine_for::<P>(6, H));
        let alone: Vec<f64> = each.iter().map(|one| one.stage[0]).collect();
        assert_eq!(bits(&work.stage[..n]), bits(&alone), "{n}, {width:?}");
    }
}

/// Components side by side are what each is alone, and the largest error is the largest of theirs, however many there are and however
/// wide registers are.
#[test]
fn components_are_what_each_is_alone() {
    for n in [1, 2, 3, 7, 8, 9, 20, 31, 32, 33, 64, 65, 130] {
        check::<Dopri5>(some(n), n);
        check::<Dop853>(some(n), n);
        let mut noisy = some(n);
        noisy.noise = (0..n).map(|j| j as f64 * 1e-3).collect();
        check::<Dop853>(noisy, n);
    }
}

/// An error that is no number is not lost beside others.
#[test]
fn what_is_not_a_number_is_found() {
    for (n, at) in [(1, 0), (9, 8), (70, 3), (70, 69)] {
        let mut work = some(n);
        work.k[4][at] = f64::NAN;
        let (error, _) = work.largest_error::<Dopri5>(n, H, TOLERANCE);
        assert!(error.is_nan(), "component {at} of {n}: {error}");
        let (error, _) = { some(n) }.largest_error::<Dopri5>(n, H, TOLERANCE);
        assert!(error.is_finite(), "{n}: {error}");
    }
}
