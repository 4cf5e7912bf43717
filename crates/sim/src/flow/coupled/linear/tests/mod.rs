//! Tests of the methods without steps: random equations of every kind against an exponential with 31 digits, and
//! transport in closed form.

mod oracle;
mod plain;

use super::*;
use crate::{Settings, Stats};
use oracle::exact;

/// Random numbers (Vigna's splitmix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * (self.bits() >> 11) as f64 * 0.5f64.powi(53)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    fn chance(&mut self, p: f64) -> bool {
        self.between(0.0, 1.0) < p
    }

    /// Ten to a power.
    fn decades(&mut self, lo: f64, hi: f64) -> f64 {
        10f64.powf(self.between(lo, hi))
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as u64) as usize]
    }
}

/// The relation of the two influences between neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Weighing {
    Alike,
    Weighted,
    OneWay,
    Mixed,
    Against,
}

/// A random problem whose unknowns form a tree, and a time.
fn random(random: &mut Random, weighing: Weighing) -> (Problem, f64) {
    let n = 2 + random.below(9) as u32;
    let rate = random.decades(-3.0, 4.0);
    let spread = random.one_of(&[0.0, 0.0, 1.0, 3.0]);
    let signed = random.chance(0.2);
    let line = random.one_of(&[0.5, 1.0]);
    let outwards = random.chance(0.5);
    let decay = random.one_of(&[0.0, 1e-6, 0.01, 1.0]);
    let mut decays = vec![0.0; n as usize];
    let mut entries = Vec::new();
    for k in 1..n {
        let parent = if random.chance(line) { k - 1 } else { random.below(u64::from(k)) as u32 };
        let d = rate * random.decades(-spread, spread);
        let how = if weighing != Weighing::Mixed {
            weighing
        } else {
            random.one_of(&[Weighing::Alike, Weighing::Weighted, Weighing::OneWay])
        };
        let (mut up, mut down) = match how {
            Weighing::Alike => (d, d),
            Weighing::Weighted => (d, d * random.decades(-1.5, 1.5)),
            Weighing::OneWay if outwards => (0.0, d),
            Weighing::OneWay => (d, 0.0),
            _ => (d, if random.chance(0.5) { -d } else { d }),
        };
        // A flow is lost at its origin, or only measured there.
        let (lost_above, lost_below) = if random.chance(0.5) { (down, up) } else { (up, down) };
        decays[parent as usize] += lost_above.abs();
        decays[k as usize] += lost_below.abs();
        if signed && random.chance(0.5) {
            (up, down) = (-up, -down);
        }
        entries.extend([(parent, k, up), (k, parent, down)]);
    }
    let grows = random.chance(0.15);
    for (k, d) in decays.iter().enumerate() {
        let growth = if grows { rate * random.between(0.0, 0.3) } else { 0.0 };
        entries.push((k as u32, k as u32, growth - d - decay * rate * random.between(0.5, 1.5)));
    }
    let size = random.one_of(&[1.0, 1.0, 255.0, 1e12, 1e-300, 1e-9]);
    let negative = random.chance(0.3);
    let dense = random.one_of(&[0.0, 0.3, 1.0]);
    let value = |random: &mut Random, dense: f64, size: f64| match random.chance(dense) {
        true => size * random.between(if negative { -1.0 } else { 0.0 }, 1.0),
        false => 0.0,
    };
    let mut y: Vec<f64> = (0..n).map(|_| value(random, dense, size)).collect();
    // One of another size.
    y[random.below(u64::from(n)) as usize] = random.one_of(&[0.0, 1.0, 1.0, 1e12]);
    let inflow = random.one_of(&[0.0, 0.0, 0.3, 1.0]);
    let mut b: Vec<f64> = (0..n).map(|_| value(random, inflow, rate * size)).collect();
    // Formulas that are read: a line in time, or an exponential that tends to a value.
    for _ in 0..random.one_of(&[0, 0, 1, 2]) {
        let m = y.len() as u32;
        let reader = random.below(u64::from(n)) as u32;
        let decay = if random.chance(0.5) { 0.0 } else { -rate * random.decades(-3.0, 1.0) };
        entries.extend([(m, m, decay), (reader, m, rate * random.between(0.1, 1.0))]);
        y.push(random.between(0.0, 2.0));
        b.push(rate * random.between(0.0, 1.0));
    }
    let tolerance = random.one_of(&[1e-3, 1e-6, 1e-9, 1e-11]);
    let longest = random.one_of(&[2.0, 4.0, 7.0]);
    let tau = random.decades(-3.0, longest) / rate;
    (Problem { entries, b, y, tolerance }, tau)
}

/// The largest error in units of the tolerance; None if there are no numbers of that size.
fn error(problem: &Problem, tau: f64, found: &[f64]) -> Option<f64> {
    let exact = exact(problem, tau);
    if exact.iter().any(|x| x.is_nan() || x.abs() > 1e200) {
        return None;
    }
    let off = |(x, y): (&f64, &f64)| (x - y).abs() / (problem.tolerance * y.abs().max(1.0));
    Some(found.iter().zip(&exact).map(off).fold(0.0, f64::max))
}

fn linear(problem: &Problem) -> Option<Linear> {
    let unknown = (0..problem.y.len() as u32).collect();
    Linear::of(problem.clone(), unknown, SimTime::ZERO)
}

/// Checks the errors of the accepted answers of each method over random equations of one kind. There must be at least
/// `wanted` answers of each.
fn answers(weighing: Weighing, wanted: [usize; 3]) {
    let (mut counts, mut worst) = ([0; 3], [0.0f64; 3]);
    for seed in 0..1_000 {
        let (problem, tau) = random(&mut Random(seed), weighing);
        let Some(mut linear) = linear(&problem) else { continue };
        let proven = linear.poles().is_some_and(|poles| poles.are_proven());
        let affordable = linear.products(tau) <= MOST_PRODUCTS;
        let series = if affordable { linear.by_series(tau) } else { None };
        let poles = linear.by_poles(tau);
        for (way, found) in [(0, series), (if proven { 1 } else { 2 }, poles)] {
            let Some(mut found) = found else { continue };
            let what = format!("{weighing:?}, seed {seed}, way {way}, t = {tau}\n{problem:?}");
            let Some(error) = error(&problem, tau, &found) else { continue };
            assert!(error <= 5.0, "{error} tolerances: {what}");
            if way == 0 {
                // Sums without cancellation need no correction.
                let before = found.clone();
                linear.orthant.confine(&mut found);
                assert_eq!(before, found, "{what}");
            }
            counts[way] += 1;
            worst[way] = worst[way].max(error);
        }
    }
    assert!((0..3).all(|way| counts[way] >= wanted[way]), "{weighing:?}: {counts:?}");
    println!("{weighing:?}: {counts:?} answers, errors up to {worst:?}");
}

#[test]
fn neighbours_that_weigh_alike() {
    answers(Weighing::Alike, [700, 300, 200]);
}

#[test]
fn neighbours_of_different_weight() {
    answers(Weighing::Weighted, [600, 200, 120]);
}

#[test]
fn influences_one_way() {
    answers(Weighing::OneWay, [600, 0, 400]);
}

#[test]
fn influences_of_all_kinds() {
    answers(Weighing::Mixed, [600, 50, 300]);
}

#[test]
fn neighbours_that_swing_are_left_to_steps() {
    let swing = |entries: &[(u32, u32, f64)]| {
        let problem =
            Problem { entries: entries.to_vec(), b: vec![0.0; 3], y: vec![1.0; 3], tolerance: 1e-6 };
        linear(&problem).is_some()
    };
    assert!(!swing(&[(0, 1, 1.0), (1, 0, -1.0)]));
    assert!(!swing(&[(0, 1, 1.0), (1, 2, 1.0), (2, 0, -1.0)]));
    assert!(swing(&[(0, 1, -1.0), (1, 2, -1.0), (2, 0, 1.0)]));
    assert!(swing(&[(0, 1, -1.0), (1, 0, -2.0)]));
    answers(Weighing::Against, [50, 0, 0]);
}

/// Without losses the inflow accumulates, and every rounding of the matrix lasts. The bound of the error is hardly
/// larger than the error here.
#[test]
fn flow_without_losses() {
    let mut answers = 0;
    for seed in 0..600 {
        let mut r = Random(seed);
        let n = 2 + r.below(3) as u32;
        let (mut entries, mut decays) = (Vec::new(), vec![0.0; n as usize]);
        for k in 1..n {
            let d = r.decades(-1.0, 2.0);
            let seen_only = r.chance(0.2);
            entries.extend([(k, k - 1, d), (k - 1, k, if seen_only { 0.0 } else { d })]);
            decays[k as usize] += d;
            decays[k as usize - 1] += if seen_only { 0.0 } else { d };
        }
        entries.extend(decays.iter().enumerate().map(|(k, d)| (k as u32, k as u32, -d)));
        let mut b = vec![0.0; n as usize];
        b[0] = r.one_of(&[0.0, 1.0, 1e6]);
        let size = r.one_of(&[0.0, 1.0, 1e6]);
        let y = (0..n).map(|_| size * r.between(-1.0, 1.0)).collect();
        let problem = Problem { entries, b, y, tolerance: r.one_of(&[1e-9, 1e-11]) };
        let tau = r.decades(-1.0, 6.0);
        let mut linear = linear(&problem).expect("no unknown swings");
        let series = if linear.products(tau) <= MOST_PRODUCTS { linear.by_series(tau) } else { None };
        for found in [series, linear.by_poles(tau)].into_iter().flatten() {
            let error = error(&problem, tau, &found).expect("nothing overflows");
            assert!(error <= ALLOWED, "{error} tolerances: seed {seed}, t = {tau}\n{problem:?}");
            answers += 1;
        }
    }
    assert!(answers >= 500, "{answers}");
}

/// Every answer that the simulation receives, by any method, is within the documented error and has the right sign.
#[test]
fn errors_are_within_the_limit_by_every_method() {
    let (mut stepped, mut confined) = (0, 0);
    for seed in 10_000..10_400 {
        let mut r = Random(seed);
        let weighing = r.one_of(&[Weighing::Alike, Weighing::Weighted, Weighing::OneWay, Weighing::Mixed]);
        let (mut problem, tau) = random(&mut r, weighing);
        problem.tolerance = problem.tolerance.max(1e-9);
        let Some(mut linear) = linear(&problem) else { continue };
        let settings = Settings { tolerance: problem.tolerance, ..Settings::default() };
        let (mut before, mut stats) = (linear.clone(), Stats::default());
        let at = SimTime::new(tau);
        let dense = linear.at(at, &settings, &Control::default(), &mut stats);
        let found: Vec<f64> = (0..dense.components()).map(|i| dense.value(i, 0.0)).collect();
        if let Some(error) = error(&problem, tau, &found) {
            assert!(error <= 100.0, "{error} tolerances: seed {seed}, t = {tau}, {stats:?}\n{problem:?}");
        }
        if linear.orthant.holds_everywhere() && linear.orthant.clone().is_positive() {
            confined += 1;
            assert!(!found.iter().any(|x| *x < 0.0), "seed {seed}: {found:?}");
        }
        stepped += usize::from(stats.steps > 0);
        // The same bits follow after evaluations at other times, later and earlier.
        for part in [0.01, 0.5, 0.9, 2.0] {
            if part < 1.0 || stats.steps == 0 {
                before.at(SimTime::new(part * tau), &settings, &Control::default(), &mut stats);
            }
        }
        let again = before.at(at, &settings, &Control::default(), &mut stats);
        for (i, x) in found.iter().enumerate() {
            assert_eq!(x.to_bits(), again.value(i, 0.0).to_bits(), "seed {seed}, unknown {i}");
        }
    }
    assert!(stepped >= 20 && confined >= 100, "{stepped} with steps, {confined} that stay positive");
}

/// One way along a chain, from a source that stays: P(k, t), the part of a Poisson distribution from k on.
#[test]
fn transport_one_way_is_as_good_as_diffusion() {
    for (n, t) in [(60, 0.5), (150, 90.0), (700, 600.0), (900, 3000.0)] {
        let mut entries: Vec<(u32, u32, f64)> = (0..n).map(|k| (k, k, -1.0)).collect();
        entries.extend((1..n).map(|k| (k, k - 1, 1.0)));
        let mut b = vec![0.0; n as usize];
        b[0] = 1.0;
        let problem = Problem { entries, b, y: vec![0.0; n as usize], tolerance: 1e-9 };
        let mut linear = linear(&problem).expect("no unknown swings");
        let found = linear.without_steps(t).expect("series can answer for it");
        // P(k, t) as one minus the terms below k, or as the terms from k on, whichever is less.
        let mut logarithm = -t;
        let terms: Vec<f64> = (0..5_000)
            .map(|k| {
                if k > 0 {
                    logarithm += (t / f64::from(k)).ln();
                }
                logarithm.exp()
            })
            .collect();
        for (k, found) in found.iter().enumerate() {
            let above: f64 = terms[k + 1..].iter().rev().sum();
            let exact = if above < 0.5 { above } else { 1.0 - terms[..=k].iter().sum::<f64>() };
            let allowed = 1e-11 * exact + 1e-16;
            assert!((found - exact).abs() <= allowed, "n = {n}, t = {t}, cell {k}: {found}, not {exact}");
        }
    }
}

/// The remainder of a large start that decays is known to its own digits.
#[test]
fn the_remainder_of_a_large_start_keeps_its_digits() {
    // x' = y - x, y' = -y.
    let entries = vec![(0, 0, -1.0), (0, 1, 1.0), (1, 1, -1.0)];
    let problem = Problem { entries, b: vec![0.0; 2], y: vec![0.0, 3e13], tolerance: 1e-9 };
    for t in [1.0f64, 30.0, 45.0, 200.0, 1e4] {
        let found = linear(&problem).and_then(|mut l| l.without_steps(t)).expect("series can answer for it");
        for (found, exact) in found.iter().zip([3e13 * t * (-t).exp(), 3e13 * (-t).exp()]) {
            assert!((found - exact).abs() <= 1e-12 * exact, "t = {t}: {found}, not {exact}");
        }
    }
}
