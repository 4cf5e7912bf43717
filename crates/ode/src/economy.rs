//! Polynomials of many powers, written as ones of a degree that dense output has.
//!
//! The first terms of a Taylor series are exact at one end and worst at the other. The polynomial of the same degree that goes through the
//! function at Chebyshev's points errs equally little everywhere: of degree 7, some ten thousand times less. Those with both ends of the
//! interval among them (Lobatto) keep the ends as they are.
//!
//! Source: Lanczos's economization of power series, C. Lanczos, "Applied Analysis", 1956, section VII.6; here by interpolation, L. N.
//! Trefethen, "Approximation Theory and Approximation Practice", 2013, chapters 2 to 4.

use crate::dense::{Dense, MAX_DEGREE};
use dlsys_expr::SimTime;
use dlsys_wide::Kernel;
use std::sync::LazyLock;

/// The highest power that is taken into account.
pub const MAX_POWER: usize = 20;
/// The least degree that polynomials are written with: that for which evaluation is fastest.
pub const LEAST_DEGREE: usize = 4;
/// Positions at which an error is measured, and what it may be larger by in between.
const SAMPLES: usize = 400;
const BETWEEN: f64 = 1.01;

/// What stands for the powers of the position in polynomials of one degree.
struct Economy {
    /// By power: Bernstein coefficients.
    columns: [[f64; MAX_DEGREE + 1]; MAX_POWER + 1],
    /// By power: the largest difference from it, for positions from 0 to 1.
    errors: [f64; MAX_POWER + 1],
}

static ECONOMIES: LazyLock<Vec<Economy>> =
    LazyLock::new(|| (LEAST_DEGREE..=MAX_DEGREE).map(Economy::new).collect());

impl Economy {
    fn new(degree: usize) -> Economy {
        // The polynomial that is zero at the points, by powers, without the highest, whose coefficient is 1.
        let mut zero = vec![1.0];
        for j in 0..=degree {
            let point = (0.5 * std::f64::consts::PI * j as f64 / degree as f64).sin().powi(2);
            let mut next = vec![0.0; zero.len() + 1];
            for (i, c) in zero.iter().enumerate() {
                next[i + 1] += c;
                next[i] -= point * c;
            }
            zero = next;
        }
        let (mut columns, mut errors) = ([[0.0; MAX_DEGREE + 1]; MAX_POWER + 1], [0.0; MAX_POWER + 1]);
        // What stands for the power, by powers: for the next one it is multiplied by the position, and the highest power taken out.
        let mut stands = vec![0.0; degree + 1];
        stands[0] = 1.0;
        for power in 0..=MAX_POWER {
            if power > 0 {
                let highest = stands.pop().expect("one at least");
                stands.insert(0, 0.0);
                stands.iter_mut().zip(&zero).for_each(|(c, zero)| *c -= highest * zero);
            }
            columns[power] = bernstein(&stands);
            if power > 0 {
                (columns[power][0], columns[power][degree]) = (0.0, 1.0);
            }
            let difference =
                |s: f64| (stands.iter().rev().fold(0.0, |sum, c| sum * s + c) - s.powi(power as i32)).abs();
            let at = |n: usize| difference(n as f64 / SAMPLES as f64);
            errors[power] =
                if power <= degree { 0.0 } else { BETWEEN * (0..=SAMPLES).map(at).fold(0.0, f64::max) };
        }
        Economy { columns, errors }
    }
}

/// The Bernstein coefficients of a polynomial given by powers, of the degree that its length says.
fn bernstein(powers: &[f64]) -> [f64; MAX_DEGREE + 1] {
    let (mut c, degree) = ([0.0; MAX_DEGREE + 1], powers.len() - 1);
    let mut inverse = 1.0;
    for (i, power) in powers.iter().enumerate() {
        c[i] = power * inverse;
        inverse *= (i + 1) as f64 / (degree - i).max(1) as f64;
    }
    for level in 1..=degree {
        for i in (level..=degree).rev() {
            c[i] += c[i - 1];
        }
    }
    c
}

/// The largest error, for positions from 0 to 1, of what stands for polynomials in one of a degree from [`LEAST_DEGREE`] to
/// [`MAX_DEGREE`], whose coefficients of each power are at most these.
pub fn economy_error(degree: usize, sizes: &[f64]) -> f64 {
    let errors = &ECONOMIES[degree - LEAST_DEGREE].errors;
    let beyond = degree + 1..sizes.len();
    beyond.map(|power| sizes[power] * errors[power]).sum()
}

/// Polynomials of a degree that stand for those of many powers of the position, which are added one after another: the ends are those of
/// the polynomials as they are given.
#[derive(Debug)]
pub struct Economized {
    degree: usize,
    /// The next power, and what its coefficients are multiplied by.
    power: usize,
    factor: f64,
    shorter: f64,
    coefficients: Vec<f64>,
}

impl Economized {
    /// So many components of a degree from [`LEAST_DEGREE`] to [`MAX_DEGREE`], along a step that is so many times shorter than the one along
    /// which coefficients are given.
    pub fn new(degree: usize, components: usize, shorter: f64) -> Economized {
        let coefficients = vec![0.0; components * (degree + 1)];
        Economized { degree, power: 0, factor: 1.0, shorter, coefficients }
    }

    /// Adds the coefficients of the next powers of the position, from 0 on up to at most [`MAX_POWER`]: of one for all components, `stride`
    /// numbers behind of the next, and so on.
    pub fn add(&mut self, powers: &[f64], stride: usize) {
        match self.degree {
            4 => self.write::<5>(powers, stride),
            5 => self.write::<6>(powers, stride),
            6 => self.write::<7>(powers, stride),
            _ => self.write::<{ MAX_DEGREE + 1 }>(powers, stride),
        }
    }

    fn write<const N: usize>(&mut self, powers: &[f64], stride: usize) {
        let Economized { degree, power, factor, shorter, coefficients } = self;
        let count = powers.len() / stride;
        let columns = &ECONOMIES[*degree - LEAST_DEGREE].columns[*power..][..count];
        *power += count;
        let all = coefficients.as_chunks_mut::<N>().0;
        *factor = dlsys_wide::run(Write { columns, powers, stride, factor: (*factor, *shorter), all });
    }

    /// The step from one instant to another, of a length.
    pub fn dense(self, (start, end, h): (SimTime, SimTime, f64)) -> Dense {
        Dense::new(start, Some(end), h, self.degree, self.coefficients)
    }
}

struct Write<'w, const N: usize> {
    columns: &'w [[f64; MAX_DEGREE + 1]],
    powers: &'w [f64],
    stride: usize,
    /// The factor of the first power, and what it is divided by from power to power.
    factor: (f64, f64),
    all: &'w mut [[f64; N]],
}

impl<const N: usize> Kernel for Write<'_, N> {
    /// The factor of the power after these.
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Write { columns, powers, stride, factor: (mut factor, shorter), all } = self;
        for (power, column) in columns.iter().enumerate() {
            let powers = &powers[power * stride..][..all.len()];
            // Copies, of which the compiler knows that nothing else is written when they are.
            let column: [f64; N] = std::array::from_fn(|i| column[i]);
            for (component, of) in all.iter_mut().enumerate() {
                let (mut c, power) = (*of, factor * powers[component]);
                for i in 0..N {
                    c[i] += power * column[i];
                }
                *of = c;
            }
            factor /= shorter;
        }
        factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends() -> (SimTime, SimTime, f64) {
        (SimTime::ZERO, SimTime::new(1.0), 1.0)
    }

    #[test]
    fn an_exponential_is_as_near_as_the_error_says_and_exact_at_its_ends() {
        for (degree, best) in [(4, 6e-5), (5, 3e-6), (6, 1e-7), (7, 3e-9)] {
            let powers: Vec<f64> = (1..=MAX_POWER)
                .scan(1.0, |c, k| {
                    *c *= -1.0 / k as f64;
                    Some(*c)
                })
                .collect();
            let powers: Vec<f64> = std::iter::once(1.0).chain(powers).collect();
            // Along twice the length, at first several powers at once.
            let mut economized = Economized::new(degree, 2, 2.0);
            let double: Vec<f64> = (powers.iter().zip(0..))
                .flat_map(|(c, power)| [1.0, 2.0].map(|factor| factor * c * 2f64.powi(power)))
                .collect();
            let (some, others) = double.split_at(6);
            economized.add(some, 2);
            others.chunks(2).for_each(|power| economized.add(power, 2));
            let dense = economized.dense(ends());
            let sizes: Vec<f64> = powers.iter().map(|c| c.abs()).collect();
            let error = economy_error(degree, &sizes);
            assert!(error < best, "degree {degree}: {error}");
            for n in 0..=100 {
                let s = f64::from(n) / 100.0;
                let off = (dense.value(0, s) - (-s).exp()).abs();
                assert!(off <= error + 1e-15, "degree {degree} at {s}: {off} against {error}");
                assert!((dense.value(1, s) - 2.0 * dense.value(0, s)).abs() < 1e-14);
            }
            assert_eq!(dense.value(0, 0.0), 1.0);
            assert!((dense.value(0, 1.0) - (-1f64).exp()).abs() < 1e-15);
        }
    }

    #[test]
    fn a_polynomial_of_low_degree_stays_what_it_is() {
        let powers = [1.0, -2.0, 0.5, 3.0, 0.25];
        for degree in LEAST_DEGREE..=MAX_DEGREE {
            let mut economized = Economized::new(degree, 1, 1.0);
            economized.add(&powers, 1);
            let dense = economized.dense(ends());
            assert_eq!(economy_error(degree, &powers.map(f64::abs)), 0.0);
            for n in 0..=10 {
                let s = f64::from(n) / 10.0;
                let exact = powers.iter().rev().fold(0.0, |sum, c| sum * s + c);
                assert!((dense.value(0, s) - exact).abs() < 1e-14);
            }
        }
    }
}
