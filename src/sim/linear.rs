//! Coupled modules whose equations are linear with constant coefficients: `y' = A y + b`.
//!
//! The exact flow is the exponential of a matrix with the structure of the tree. Where nobody watches the components,
//! there are no steps: it is applied from the start of the phase to each time that is looked at, by a rational
//! approximation whose every pole costs one elimination from the tips to the root: stiffness costs nothing (Trefethen,
//! Weideman and Schmelzer 2006).

use super::dense::Dense;
use super::motion::Motion;
use super::rational::{ALPHA_0, POLES, RESIDUES};
use super::sparse::{Pattern, Wide};
use super::system::{Source, System};
use crate::expr::Scratch;
use crate::model::Rule;
use crate::structure::Instant;

/// Lanes of an elimination: the seven poles and one that does nothing.
const LANES: usize = 8;

/// Neighbours may weigh on each other by factors that differ; along the whole tree, weights may spread by no more than
/// this, or the matrix is too far from a symmetric one for the approximation to be safe.
const MAX_SPREAD: f64 = 1e3;

/// A linear system and its state at the start.
#[derive(Clone, Debug)]
pub struct Linear {
    pattern: Pattern,
    a: Vec<f64>,
    b: Vec<f64>,
    y: Vec<f64>,
    /// The unknown of each component of the coupled modules.
    unknown: Vec<u32>,
    start: Instant,
    /// No eigenvalue is larger.
    bound: f64,
    factors: Vec<Wide<LANES>>,
    rhs: Vec<Wide<LANES>>,
}

impl Linear {
    /// The equations of coupled modules, if they are linear and so is everything that they read, and if all eigenvalues
    /// are certainly real.
    pub fn new(system: &System, rules: &[Rule], y: &[f64]) -> Option<Linear> {
        if !system.algebra.is_empty() {
            return None;
        }
        let mut unknown = vec![u32::MAX; y.len()];
        let mut inputs = vec![u32::MAX; system.formulas.len()];
        let (mut state, mut b) = (Vec::new(), Vec::new());
        let mut entries: Vec<(u32, u32, f64)> = Vec::new();
        // Unknowns are numbered in string order: what stands left of a module before it.
        for row in &system.rows {
            let solve = &rules[row.rule].solves[row.solve];
            if row.forced || solve.linear.is_none() {
                return None;
            }
            let sources = &system.sources[row.first_source..row.first_source + row.sources];
            let rule = &rules[row.rule];
            let own = rule.parameters.len();
            let left: usize = rule.left.iter().map(|p| p.width).sum();
            let mut number = |source: &Source, state: &mut Vec<f64>, b: &mut Vec<f64>| -> Option<()> {
                if let Source::Formula(i) = *source
                    && inputs[i as usize] == u32::MAX
                {
                    let formula = &system.formulas[i as usize];
                    let x = formula.x + formula.motion.value(formula.offset);
                    let (rate, decay) = match &formula.motion {
                        Motion::Polynomial([c, 0.0, 0.0, 0.0]) => (*c, 0.0),
                        Motion::Riccati(law) => (formula.motion.rate(formula.offset), law.exponential()?.1),
                        _ => return None,
                    };
                    let n = state.len() as u32;
                    inputs[i as usize] = n;
                    // x' = rate + decay (x - x(start))
                    entries.push((n, n, decay));
                    state.push(x);
                    b.push(rate - decay * x);
                }
                Some(())
            };
            let read = |v: usize| {
                solve.linear.as_ref().is_some_and(|l| l.variables.iter().flatten().any(|r| *r == v))
            };
            for (v, source) in sources.iter().enumerate().take(own + left) {
                if read(v) {
                    number(source, &mut state, &mut b)?;
                }
            }
            for component in row.first_rate..row.first_rate + solve.numeric.len() {
                unknown[component] = state.len() as u32;
                state.push(y[component]);
                b.push(0.0);
            }
            for (v, source) in sources.iter().enumerate().skip(own + left) {
                if read(v) {
                    number(source, &mut state, &mut b)?;
                }
            }
        }
        let (mut variables, mut scratch, mut out): (Vec<f64>, Scratch<f64>, Vec<f64>) = Default::default();
        for row in &system.rows {
            let linear = rules[row.rule].solves[row.solve].linear.as_ref()?;
            system.variables(rules, row, 0.0, y, &[], &mut variables);
            out.resize(linear.coefficients.outputs(), 0.0);
            linear.coefficients.eval(&variables, &mut scratch, &mut out);
            let mut next = out.iter();
            for (i, reads) in linear.variables.iter().enumerate() {
                let n = unknown[row.first_rate + i];
                b[n as usize] += next.next()?;
                for &v in reads {
                    let coefficient = *next.next()?;
                    match system.sources[row.first_source + v] {
                        Source::Fixed(x) => b[n as usize] += coefficient * x,
                        Source::State(component) => {
                            entries.push((n, unknown[component as usize], coefficient))
                        }
                        Source::Input(_) | Source::Sum(_) => return None,
                        Source::Formula(input) => entries.push((n, inputs[input as usize], coefficient)),
                    }
                }
            }
        }
        if entries.iter().any(|e| !e.2.is_finite()) || b.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let couplings: Vec<(u32, u32)> = entries.iter().map(|e| (e.0, e.1)).collect();
        let pattern = Pattern::new(state.len(), &couplings)?;
        let mut a = vec![0.0; pattern.entries()];
        for &(row, column, value) in &entries {
            a[pattern.entry(row as usize, column as usize)?] += value;
        }
        let bound = real_bound(&pattern, &a, &entries, state.len())?;
        let start = system.start;
        let (factors, rhs) = (Vec::new(), Vec::new());
        Some(Linear { pattern, a, b, y: state, unknown, start, bound, factors, rhs })
    }

    /// The components at an instant, as the dense output of a step that stays where it is. Not numbers if there are
    /// none: growth beyond all bounds.
    pub fn at(&mut self, at: Instant) -> Dense {
        let tau = at.since(self.start).max(0.0);
        let sigma = self.bound.max(0.0);
        let y = match tau {
            0.0 => self.y.clone(),
            _ => self.propagate(tau, sigma).unwrap_or_else(|| vec![f64::NAN; self.y.len()]),
        };
        let components = self.unknown.iter().map(|n| y[*n as usize]).collect();
        Dense::new(at, Some(at), 0.0, 0, components)
    }

    /// `exp(τ A) y + τ φ(τ A) b`: the exponential of the matrix with b as a further column, shifted by σ so that no
    /// eigenvalue is positive.
    fn propagate(&mut self, tau: f64, sigma: f64) -> Option<Vec<f64>> {
        let mut shift = Wide { re: [1.0; LANES], im: [0.0; LANES] };
        for (lane, (re, im)) in POLES.iter().enumerate() {
            (shift.re[lane], shift.im[lane]) = (re + sigma * tau, *im);
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
        self.rhs.extend(self.y.iter().zip(&self.b).map(|(y, b)| Wide {
            re: std::array::from_fn(|i| y * of_y.re[i] + b * of_b.re[i]),
            im: std::array::from_fn(|i| y * of_y.im[i] + b * of_b.im[i]),
        }));
        self.pattern.solve(&self.factors, &mut self.rhs);
        let growth = (sigma * tau).exp();
        let sum = |(x, y): (&Wide<LANES>, &f64)| growth * (ALPHA_0 * y + 2.0 * x.re.iter().sum::<f64>());
        Some(self.rhs.iter().zip(&self.y).map(sum).collect())
    }
}

/// An upper bound of the eigenvalues, if they are certainly real: neighbours that weigh on each other with one sign make
/// a tree's matrix similar to a symmetric one; one-way influences add nothing to the spectrum.
fn real_bound(pattern: &Pattern, a: &[f64], entries: &[(u32, u32, f64)], n: usize) -> Option<f64> {
    let value = |i: u32, j: u32| pattern.entry(i as usize, j as usize).map_or(0.0, |e| a[e]);
    let mut discs: Vec<f64> = (0..n as u32).map(|i| value(i, i)).collect();
    let mut weight = vec![0.0f64; n];
    let mut parent = vec![u32::MAX; n];
    let mut pairs: Vec<(u32, u32)> =
        entries.iter().filter(|e| e.0 != e.1).map(|e| (e.0.min(e.1), e.0.max(e.1))).collect();
    pairs.sort_unstable();
    pairs.dedup();
    for (i, j) in pairs {
        // A cycle proves nothing.
        if std::mem::replace(&mut parent[j as usize], i) != u32::MAX {
            return None;
        }
        let (up, down) = (value(i, j), value(j, i));
        let product = up * down;
        if product < 0.0 {
            return None;
        }
        if product > 0.0 {
            weight[j as usize] = weight[i as usize] + 0.5 * (down / up).ln();
            discs[i as usize] += product.sqrt();
            discs[j as usize] += product.sqrt();
        }
    }
    let (low, high) = weight.iter().fold((0.0f64, 0.0f64), |(l, h), w| (l.min(*w), h.max(*w)));
    let largest = discs.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (high - low <= MAX_SPREAD.ln() && largest.is_finite()).then_some(largest)
}
