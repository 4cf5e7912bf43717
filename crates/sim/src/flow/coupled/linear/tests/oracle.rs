//! The exponential of a small dense matrix with 31 digits: the reference for the methods without steps.

use super::super::Problem;

/// An unevaluated sum of two floats (Dekker 1971).
#[derive(Clone, Copy, Debug, Default)]
pub struct Double(f64, f64);

fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

impl Double {
    pub fn new(x: f64) -> Double {
        Double(x, 0.0)
    }

    fn plus(self, other: Double) -> Double {
        let (sum, error) = two_sum(self.0, other.0);
        let (low, second) = two_sum(self.1, other.1);
        let (sum, error) = two_sum(sum, error + low);
        let (sum, error) = two_sum(sum, error + second);
        Double(sum, error)
    }

    fn times(self, other: Double) -> Double {
        let product = self.0 * other.0;
        let error = self.0.mul_add(other.0, -product) + (self.0 * other.1 + self.1 * other.0);
        let (sum, error) = two_sum(product, error);
        Double(sum, error)
    }

    fn over(self, n: f64) -> Double {
        let first = self.0 / n;
        let rest = self.plus(Double(-first, 0.0).times(Double::new(n)));
        Double(first, 0.0).plus(Double::new(rest.0 / n))
    }
}

type Matrix = Vec<Vec<Double>>;

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let n = a.len();
    let mut out = vec![vec![Double::default(); n]; n];
    for i in 0..n {
        for k in 0..n {
            if a[i][k].0 != 0.0 {
                for j in 0..n {
                    out[i][j] = out[i][j].plus(a[i][k].times(b[k][j]));
                }
            }
        }
    }
    out
}

/// `exp(τ A)` by scaling, the Taylor series, and squaring.
fn exponential(a: &Matrix, tau: f64) -> Matrix {
    let n = a.len();
    let rows = a.iter().map(|row| row.iter().map(|x| x.0.abs()).sum::<f64>());
    let norm = tau * rows.fold(0.0, f64::max);
    let halvings = (norm.log2().ceil() + 2.0).max(0.0);
    let step = Double::new(tau * 0.5f64.powf(halvings));
    let scaled: Matrix = a.iter().map(|row| row.iter().map(|x| x.times(step)).collect()).collect();
    let mut sum: Matrix =
        (0..n).map(|i| (0..n).map(|j| Double::new(f64::from(u8::from(i == j)))).collect()).collect();
    let mut term = sum.clone();
    for k in 1..=24 {
        term = product(&term, &scaled);
        for (row, more) in sum.iter_mut().zip(&mut term) {
            for (x, t) in row.iter_mut().zip(more) {
                *t = t.over(f64::from(k));
                *x = x.plus(*t);
            }
        }
    }
    for _ in 0..halvings as u32 {
        sum = product(&sum, &sum);
    }
    sum
}

/// The state some time after the start.
pub fn exact(problem: &Problem, tau: f64) -> Vec<f64> {
    let n = problem.y.len();
    let mut a = vec![vec![Double::default(); n + 1]; n + 1];
    for &(i, j, value) in &problem.entries {
        let place = &mut a[i as usize][j as usize];
        *place = place.plus(Double::new(value));
    }
    // The constant that b comes from has a size that leaves the matrix as it is.
    let largest = problem.entries.iter().fold(1e-3, |m: f64, e| m.max(e.2.abs()));
    let most = problem.b.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
    let constant = (most / largest).max(1e-30).log2().ceil().exp2();
    for (row, b) in a.iter_mut().zip(&problem.b) {
        row[n] = Double::new(b / constant);
    }
    let e = exponential(&a, tau);
    let start: Vec<Double> = problem.y.iter().copied().chain([constant]).map(Double::new).collect();
    let sum = |row: &Vec<Double>| {
        row.iter().zip(&start).fold(Double::default(), |sum, (a, y)| sum.plus(a.times(*y))).0
    };
    e[..n].iter().map(sum).collect()
}

/// Compares the reference with solutions in closed form.
#[test]
fn is_right_itself() {
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() <= 1e-15 * expected.abs(), "{found}, not {expected}");
    };
    let of = |entries: &[(u32, u32, f64)], b: &[f64], y: &[f64], tau: f64| {
        exact(&Problem { entries: entries.to_vec(), b: b.to_vec(), y: y.to_vec(), tolerance: 1e-6 }, tau)
    };
    // Decay, to a large time and from a large start; an inflow.
    close(of(&[(0, 0, -1.0)], &[0.0], &[1.0], 1.0)[0], (-1f64).exp());
    close(of(&[(0, 0, -2.0)], &[0.0], &[1e12], 20.0)[0], 1e12 * (-40f64).exp());
    close(of(&[(0, 0, -1e6)], &[3e6], &[5.0], 10.0)[0], 3.0);
    close(of(&[(0, 0, 0.0)], &[0.25], &[1.0], 8.0)[0], 3.0);
    // Growth.
    close(of(&[(0, 0, 3.0)], &[0.0], &[1e-100], 100.0)[0], 1e-100 * 300f64.exp());
    // A chain of decays at one rate: y_k = t^k/k! exp(-t), summed with a source: P(k, t).
    let chain: Vec<_> = (0..9u32).flat_map(|k| [(k, k, -1.0), (k + 1, k, 1.0)]).collect();
    let y = of(&[&chain[..], &[(9, 9, -1.0)]].concat(), &[0.0; 10], &[&[1.0][..], &[0.0; 9]].concat(), 7.0);
    let mut factorial = 1.0;
    for (k, y) in y.iter().enumerate() {
        factorial *= (k as f64).max(1.0);
        close(*y, 7f64.powi(k as i32) / factorial * (-7f64).exp());
    }
    // Rotation: 40 turns and an eighth.
    let turn = std::f64::consts::TAU;
    let y = of(&[(0, 1, turn), (1, 0, -turn)], &[0.0; 2], &[1.0, 0.0], 40.125);
    assert!((y[0] - 0.5f64.sqrt()).abs() < 1e-13 && (y[1] + 0.5f64.sqrt()).abs() < 1e-13, "{y:?}");
    // Two cells that exchange: half the difference decays at 2 D.
    let stiff = [(0, 0, -1e6), (0, 1, 1e6), (1, 0, 1e6), (1, 1, -1e6)];
    let y = of(&stiff, &[0.0; 2], &[3.0, 1.0], 2e-6);
    close(y[0], 2.0 + (-4f64).exp());
    close(y[1], 2.0 - (-4f64).exp());
}
