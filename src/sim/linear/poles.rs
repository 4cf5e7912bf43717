//! The exponential of a matrix by the best rational approximation on the negative axis (`rational`): every pole costs one
//! elimination from the tips to the root, and stiffness costs nothing (Trefethen, Weideman and Schmelzer 2006).
//!
//! The error is bounded on the spectrum only if the matrix is normal in some norm. Neighbours that weigh on each other make
//! a tree's matrix similar to a symmetric one, by a diagonal matrix of weights: then the error of each unknown is bounded
//! by its weight, the error of the approximation, and the size of the start, measured with the weights (`proven`). It does not
//! fall when the values do: what has decayed by twelve decades is not known any more. An influence one way is
//! as far from normal as can be, though all eigenvalues are real; along a chain of such influences the approximation means
//! nothing. Then it is made over the whole time, and again over two halves, each with an error of its own.

use super::rational::{ALPHA_0, POLES, RESIDUES};
use super::{Problem, ROUNDING};
use crate::sim::sparse::{Pattern, Wide};

/// Lanes of an elimination: the seven poles and one that does nothing.
const LANES: usize = 8;
/// The approximation is no farther than this from the exponential on the negative axis, in f64.
const ERROR: f64 = 5e-14;
/// The same of the difference quotients of its error.
const ERROR_OF_SLOPE: f64 = 2e-11;
/// What is rounded in an elimination, in units of what the largest entry rounds to.
const ROUNDINGS: f64 = 3.0;
/// Roundings of the pivots themselves last as disturbances do, and so do those of the state of rest.
const MEMORIES: f64 = 8.0;
/// The largest weight, and the inverse of the smallest, as a logarithm.
const MOST_WEIGHT: f64 = 200.0;
/// The difference between the whole and the halves may be as large as this part of the tolerance.
const AGREEMENT: f64 = 0.5;

#[derive(Clone, Debug)]
pub struct Poles {
    pattern: Pattern,
    a: Vec<f64>,
    /// No eigenvalue is larger; not negative.
    shift: f64,
    /// What is known of the error. None if influences are one way.
    proof: Option<Proof>,
    /// The largest entry.
    largest: f64,
    factors: Vec<Wide<LANES>>,
    rhs: Vec<Wide<LANES>>,
}

/// The matrix is symmetric in the coordinates `y / weight`.
#[derive(Clone, Debug)]
struct Proof {
    weights: Vec<f64>,
    /// Of each unknown: the part of the forest that it belongs to.
    part: Vec<u32>,
    sizes: Vec<Sizes>,
}

/// Sizes in a part of the forest, in the coordinates in which its matrix is symmetric.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    /// Squares of the lengths of the start, of b, and of the state of rest and what the start is away from it.
    y: f64,
    b: f64,
    rest: f64,
    away: f64,
    /// The largest value of the start, or of the state of rest if that is known.
    most: f64,
    /// A disturbance that lasts is never more than what it adds in so much time.
    memory: f64,
}

impl Poles {
    /// None if the couplings are no forest.
    pub fn new(problem: &Problem) -> Option<Poles> {
        let n = problem.y.len();
        let couplings: Vec<(u32, u32)> = problem.entries.iter().map(|e| (e.0, e.1)).collect();
        let pattern = Pattern::new(n, &couplings)?;
        let mut a = vec![0.0; pattern.entries()];
        for &(row, column, value) in &problem.entries {
            a[pattern.entry(row as usize, column as usize)?] += value;
        }
        let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut discs = a[..n].to_vec();
        let mut weights = vec![0.0f64; n];
        let mut part = vec![0; n];
        let (mut parts, mut both_ways) = (0, true);
        for (k, above) in pattern.forest()?.enumerate() {
            let Some((parent, place)) = above else {
                part[k] = parts;
                parts += 1;
                continue;
            };
            part[k] = part[parent];
            let (down, up) = (a[place], a[place + 1]);
            let product = down * up;
            if product > 0.0 {
                weights[k] = weights[parent] + if down == up { 0.0 } else { 0.5 * (down / up).ln() };
                discs[k] += product.sqrt();
                discs[parent] += product.sqrt();
            } else if product < 0.0 {
                return None;
            } else {
                both_ways &= down == 0.0 && up == 0.0;
            }
        }
        let shift = discs.into_iter().fold(0.0, f64::max);
        let (factors, rhs) = (Vec::new(), Vec::new());
        let mut poles = Poles { pattern, a, shift, proof: None, largest, factors, rhs };
        if both_ways && shift.is_finite() && weights.iter().all(|w| w.abs() <= MOST_WEIGHT) {
            weights.iter_mut().for_each(|w| *w = w.exp());
            poles.proof = Some(poles.proof(problem, weights, part, parts as usize));
        }
        shift.is_finite().then_some(poles)
    }

    /// True if the error has a bound.
    pub fn are_proven(&self) -> bool {
        self.proof.is_some()
    }

    fn proof(&self, problem: &Problem, weights: Vec<f64>, part: Vec<u32>, parts: usize) -> Proof {
        let mut sizes = vec![Sizes::default(); parts];
        // Where everything comes to rest, A x = -b, and where a disturbance of 1 would lead.
        let mut rest: Vec<f64> = problem.b.iter().map(|b| -b).collect();
        let mut disturbed: Vec<f64> = weights.iter().map(|w| -w).collect();
        let mut factors = Vec::new();
        if self.pattern.factor(&self.a, 0.0, -1.0, &mut factors) {
            self.pattern.solve(&factors, &mut rest);
            self.pattern.solve(&factors, &mut disturbed);
        } else {
            rest.iter_mut().filter(|x| **x != 0.0).for_each(|x| *x = f64::INFINITY);
            disturbed.fill(f64::INFINITY);
        }
        let keeps_signs = self.a[weights.len()..].iter().all(|a| *a >= 0.0);
        for i in 0..weights.len() {
            let size = &mut sizes[part[i] as usize];
            let [y, b, rest, disturbed] =
                [problem.y[i], problem.b[i], rest[i], disturbed[i]].map(|x| x / weights[i]);
            let lasts = keeps_signs && self.shift == 0.0 && disturbed >= 0.0;
            size.memory = size.memory.max(if lasts { disturbed } else { f64::INFINITY });
            size.y += y * y;
            size.b += b * b;
            size.rest += rest * rest;
            size.away += (y - rest) * (y - rest);
            size.most = size.most.max(y.abs()).max(if rest.is_finite() { rest.abs() } else { 0.0 });
        }
        Proof { weights, part, sizes }
    }

    /// The state some time after the start of the problem. None if its error may be too large.
    pub fn at(&mut self, problem: &Problem, tau: f64) -> Option<Vec<f64>> {
        let whole = self.propagate(&problem.y, &problem.b, tau)?;
        let growth = (self.shift * tau).exp();
        let rounding = ROUNDINGS * ROUNDING * self.largest;
        if let Some(Proof { weights, part, sizes }) = &self.proof {
            let bounds: Vec<f64> = sizes
                .iter()
                .map(|s| {
                    let slope = ERROR * s.y.sqrt() + ERROR_OF_SLOPE * tau * s.b.sqrt();
                    let rest = ERROR * (s.away.sqrt() + 2.0 * s.rest.sqrt());
                    let time = tau.min(MEMORIES * s.memory);
                    growth * (slope.min(rest) + rounding * time * s.most)
                })
                .collect();
            return problem.allows(&whole, |i| weights[i] * bounds[part[i] as usize]).then_some(whole);
        }
        let half = self.propagate(&problem.y, &problem.b, 0.5 * tau)?;
        let halves = self.propagate(&half, &problem.b, 0.5 * tau)?;
        let most = problem.y.iter().chain(&halves).fold(0.0f64, |m, y| m.max(y.abs()));
        if !problem.allows(&halves, |_| growth * rounding * tau * most) {
            return None;
        }
        let allowed = AGREEMENT * problem.tolerance;
        let agree = |(x, y): (&f64, &f64)| (x - y).abs() <= allowed * y.abs().max(1.0);
        whole.iter().zip(&halves).all(agree).then_some(halves)
    }

    /// `exp(τ A) y + τ φ(τ A) b`: the exponential of the matrix with b as a further column, shifted so that no
    /// eigenvalue is positive.
    fn propagate(&mut self, y: &[f64], b: &[f64], tau: f64) -> Option<Vec<f64>> {
        let mut shift = Wide { re: [1.0; LANES], im: [0.0; LANES] };
        for (lane, (re, im)) in POLES.iter().enumerate() {
            (shift.re[lane], shift.im[lane]) = (re + self.shift * tau, *im);
        }
        if !self.pattern.factor(&self.a, shift, tau, &mut self.factors) {
            return None;
        }
        // For each pole p with residue r: (p - τ A) x = -r (y + τ b / p).
        let mut of_y = Wide { re: [0.0; LANES], im: [0.0; LANES] };
        let mut of_b = of_y;
        for (lane, (re, im)) in RESIDUES.iter().enumerate() {
            let (p, q) = (shift.re[lane], shift.im[lane]);
            let norm = p * p + q * q;
            (of_y.re[lane], of_y.im[lane]) = (-re, -im);
            (of_b.re[lane], of_b.im[lane]) =
                (-tau * (re * p + im * q) / norm, -tau * (im * p - re * q) / norm);
        }
        self.rhs.clear();
        self.rhs.extend(y.iter().zip(b).map(|(y, b)| Wide {
            re: std::array::from_fn(|i| y * of_y.re[i] + b * of_b.re[i]),
            im: std::array::from_fn(|i| y * of_y.im[i] + b * of_b.im[i]),
        }));
        self.pattern.solve(&self.factors, &mut self.rhs);
        let growth = (self.shift * tau).exp();
        let sum = |(x, y): (&Wide<LANES>, &f64)| growth * (ALPHA_0 * y + 2.0 * x.re.iter().sum::<f64>());
        Some(self.rhs.iter().zip(y).map(sum).collect())
    }
}
