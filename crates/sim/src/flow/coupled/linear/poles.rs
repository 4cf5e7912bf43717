//! The exponential of a matrix by the best rational approximation on the negative axis (`rational`): every pole costs
//! one elimination from the tips to the root, and stiffness costs nothing (Trefethen, Weideman and Schmelzer 2006).
//!
//! The error is bounded on the spectrum only if the matrix is normal in some norm. Mutual influences make
//! a tree's matrix similar to a symmetric one, by a diagonal matrix of weights: then the error of each unknown is
//! bounded by its weight, the error of the approximation, and the size of the start, measured with the weights
//! ([`Proof`]). The bound does not decrease with the values: a value that has decayed by twelve decades has no digits
//! left. An influence in one direction is far from normal, though all eigenvalues are real; along a chain of such
//! influences the approximation is meaningless. Then it is computed over the whole time, and again over two halves,
//! each with an error of its own.

use super::rational::{ALPHA_0, POLES, RESIDUES};
use super::{Problem, ROUNDING};
use dlsys_ode::{Pattern, Wide};

/// Lanes of an elimination: the seven poles and one that is unused.
const LANES: usize = 8;
/// The largest distance of the approximation from the exponential on the negative axis, in f64.
const ERROR: f64 = 5e-14;
/// The same of the difference quotients of its error.
const ERROR_OF_SLOPE: f64 = 2e-11;
/// The rounding error of an elimination, in units of that of the largest entry.
const ROUNDINGS: f64 = 4.5;
/// The effect of the roundings of the pivots and of the equilibrium, which last as disturbances do, in units of the
/// memory.
const MEMORIES: f64 = 8.0;
/// The largest weight, and the inverse of the smallest, as a logarithm.
const MOST_WEIGHT: f64 = 200.0;
/// The difference between the whole and the halves may be as large as this part of the tolerance.
const AGREEMENT: f64 = 0.5;

/// The rational approximation for one matrix.
#[derive(Clone, Debug)]
pub struct Poles {
    pattern: Pattern,
    a: Vec<f64>,
    /// A bound of all eigenvalues; not negative.
    shift: f64,
    /// The bound of the error. None if some influences have one direction only.
    proof: Option<Proof>,
    /// The largest value of b, and of the equilibrium: infinite if there is none.
    inflow: f64,
    rest: f64,
    /// The largest entry.
    largest: f64,
    factors: Vec<Wide<LANES>>,
    rhs: Vec<Wide<LANES>>,
}

/// The matrix is symmetric in the coordinates `y / weight`.
#[derive(Clone, Debug)]
struct Proof {
    weights: Vec<f64>,
    /// By unknown: the tree of the forest that it belongs to.
    part: Vec<u32>,
    sizes: Vec<Sizes>,
    /// The largest weight.
    heaviest: f64,
    /// The memories have been computed.
    remembers: bool,
}

/// Sizes in a tree of the forest, in the coordinates in which its matrix is symmetric.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    /// Squares of the lengths of the start, of b, of the equilibrium, and of the distance of the start from that.
    y: f64,
    b: f64,
    rest: f64,
    away: f64,
    /// The largest value of the start, or of the equilibrium if there is one; if there is none, of the inflow.
    most: f64,
    inflow: f64,
    /// The effect of a lasting disturbance is never larger than its contribution over this time; infinite until it is
    /// computed.
    memory: f64,
}

impl Proof {
    fn new(problem: &Problem, weights: Vec<f64>, part: Vec<u32>, parts: usize, rest: &[f64]) -> Proof {
        let mut sizes = vec![Sizes { memory: f64::INFINITY, ..Sizes::default() }; parts];
        for (i, weight) in weights.iter().enumerate() {
            let size = &mut sizes[part[i] as usize];
            let inverse = 1.0 / weight;
            let [y, b, rest] = [problem.y[i], problem.b[i], rest[i]].map(|x| x * inverse);
            size.y += y * y;
            size.b += b * b;
            size.rest += rest * rest;
            size.away += (y - rest) * (y - rest);
            size.most = size.most.max(y.abs());
            if rest.is_finite() {
                size.most = size.most.max(rest.abs());
            } else {
                size.inflow = size.inflow.max(b.abs());
            }
        }
        let heaviest = weights.iter().fold(0.0, |m: f64, w| m.max(*w));
        Proof { weights, part, sizes, heaviest, remembers: false }
    }

    /// True if the error of the state `y` at a time is allowed. `rounding` is the rounding error of the matrix,
    /// `growth` a bound of the factor by which values have grown since the start.
    fn holds(&self, problem: &Problem, y: &[f64], tau: f64, growth: f64, rounding: f64) -> bool {
        let bound = |s: &Sizes| {
            let slope = ERROR * s.y.sqrt() + ERROR_OF_SLOPE * tau * s.b.sqrt();
            let rest = ERROR * (s.away.sqrt() + 2.0 * s.rest.sqrt());
            let time = tau.min(MEMORIES * s.memory);
            growth * (slope.min(rest) + rounding * time * (s.most + tau * s.inflow))
        };
        let bounds: Vec<f64> = self.sizes.iter().map(bound).collect();
        let largest =
            self.heaviest * bounds.iter().fold(0.0, |m, b| if *b > m || b.is_nan() { *b } else { m });
        // In most cases the largest bound is sufficient.
        problem.allows_all(y, largest)
            || problem.allows(y, |i| self.weights[i] * bounds[self.part[i] as usize])
    }
}

impl Poles {
    /// None if the couplings are no forest, or two neighbours influence each other with different signs.
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
        let most = |values: &[f64]| values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let inflow = most(&problem.b);
        let mut poles = Poles { pattern, a, shift, proof: None, inflow, rest: 0.0, largest, factors, rhs };
        let mut rest = vec![0.0; n];
        if inflow > 0.0 {
            rest = poles.rest(problem.b.iter().copied()).unwrap_or_else(|| vec![f64::INFINITY; n]);
            poles.rest = most(&rest);
        }
        if both_ways && weights.iter().all(|w| w.abs() <= MOST_WEIGHT) {
            weights.iter_mut().for_each(|w| *w = w.exp());
            poles.proof = Some(Proof::new(problem, weights, part, parts as usize, &rest));
        }
        shift.is_finite().then_some(poles)
    }

    /// The equilibrium: `A x = -b`; None if A is singular.
    fn rest(&self, b: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
        let mut factors = Vec::new();
        let mut x: Vec<f64> = b.map(|b| -b).collect();
        let regular = self.pattern.factor(&self.a, 0.0, -1.0, &mut factors);
        self.pattern.solve(&factors, &mut x);
        regular.then_some(x)
    }

    /// Computes the memories from the equilibrium under a disturbance of 1. False if they are known or cannot be
    /// computed.
    fn remember(&mut self) -> bool {
        let Some(proof) = self.proof.as_ref().filter(|proof| !proof.remembers) else { return false };
        let keeps_signs = self.a[proof.weights.len()..].iter().all(|a| *a >= 0.0);
        let led =
            (keeps_signs && self.shift == 0.0).then(|| self.rest(proof.weights.iter().copied())).flatten();
        let Some(proof) = &mut self.proof else { return false };
        proof.remembers = true;
        let Some(led) = led else { return false };
        proof.sizes.iter_mut().for_each(|size| size.memory = 0.0);
        for (i, x) in led.iter().enumerate() {
            let memory = &mut proof.sizes[proof.part[i] as usize].memory;
            *memory = memory.max(if *x >= 0.0 { x / proof.weights[i] } else { f64::INFINITY });
        }
        true
    }

    /// True if a series takes more than this number of products of the matrix and a vector up to a time.
    pub fn spare(&self, products: f64, tau: f64) -> bool {
        self.largest * tau > products
    }

    /// True if the error has a bound.
    pub fn are_proven(&self) -> bool {
        self.proof.is_some()
    }

    /// The state some time after the start of the problem. None if its error may be too large.
    pub fn at(&mut self, problem: &Problem, tau: f64) -> Option<Vec<f64>> {
        let whole = self.propagate(&problem.y, &problem.b, tau)?;
        let growth = (self.shift * tau).exp();
        let rounding = ROUNDINGS * ROUNDING * self.largest;
        while let Some(proof) = &self.proof {
            if proof.holds(problem, &whole, tau, growth, rounding) {
                return Some(whole);
            }
            if !self.remember() {
                return None;
            }
        }
        let half = self.propagate(&problem.y, &problem.b, 0.5 * tau)?;
        let halves = self.propagate(&half, &problem.b, 0.5 * tau)?;
        // Values that accumulate in unknowns without losses have the same relative error over the whole and over the
        // halves.
        let flow = self.rest.min(tau * self.inflow);
        let most = problem.y.iter().chain(&halves).fold(flow, |m, y| m.max(y.abs()));
        if !problem.allows(&halves, |_| growth * (rounding * tau + ERROR_OF_SLOPE) * most) {
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
