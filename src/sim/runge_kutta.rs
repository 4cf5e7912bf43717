//! One step of a Runge-Kutta method, with its dense output.

use super::Method;
use super::dense::Dense;
use crate::structure::Instant;

/// A system of equations `y' = f(tau, y)`, `tau` counted from the start of the step.
pub trait Rates {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
}

/// Dormand and Prince (1980), RK5(4)7M: nodes, coefficients, and the weights of the error.
const C: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];
const A: [&[f64]; 7] = [
    &[],
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Continuous extension of order 4 (Hairer, Nørsett and Wanner 1993, II.6; the code DOPRI5).
const D: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// Errors below the tolerated part of this are none, whatever they are errors of.
const FLOOR: f64 = 1e-18;

/// Working memory of a step.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// Rates at the stages; the first is that of the start of the step.
    pub k: Vec<Vec<f64>>,
    stage: Vec<f64>,
    /// The state at the end of the step.
    pub end: Vec<f64>,
}

/// What became of a trial step.
pub enum Trial {
    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding;
    /// 0 for methods without estimate.
    Done { error: f64, rounding: f64 },
    /// Some rate or value on the way was not finite; the component, if it is known.
    NotFinite(Option<usize>),
}

impl Workspace {
    pub fn resize(&mut self, method: Method, n: usize) {
        self.k.resize(method.stages(), Vec::new());
        for k in &mut self.k {
            k.resize(n, 0.0);
        }
        self.stage.resize(n, 0.0);
        self.end.resize(n, 0.0);
    }

    /// Tries a step from `y`, whose rates are in `k[0]`. Returns also the number of evaluations.
    pub fn attempt(
        &mut self,
        method: Method,
        system: &mut impl Rates,
        y: &[f64],
        h: f64,
        tolerance: f64,
    ) -> (Trial, u64) {
        match method {
            Method::Euler => {
                for (end, (y, k)) in self.end.iter_mut().zip(y.iter().zip(&self.k[0])) {
                    *end = y + h * k;
                }
                (self.finite(0.0, 0.0), 0)
            }
            Method::Rk4 => {
                for (i, c) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
                    for (s, (y, k)) in self.stage.iter_mut().zip(y.iter().zip(&self.k[i - 1])) {
                        *s = y + h * c * k;
                    }
                    system.rates(c * h, &self.stage, &mut self.k[i]);
                }
                for (i, end) in self.end.iter_mut().enumerate() {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|s| self.k[s][i]);
                    *end = y[i] + h / 6.0 * (a + 2.0 * (b + c) + d);
                }
                // The rate at the end gives the Hermite interpolant and is the next step's first.
                system.rates(h, &self.end, &mut self.k[4]);
                (self.finite(0.0, 0.0), 4)
            }
            Method::Dopri5 | Method::Auto => {
                for i in 1..7 {
                    for (j, s) in self.stage.iter_mut().enumerate() {
                        let mut sum = 0.0;
                        for (a, k) in A[i].iter().zip(&self.k) {
                            sum += a * k[j];
                        }
                        *s = y[j] + h * sum;
                    }
                    system.rates(C[i] * h, &self.stage, &mut self.k[i]);
                }
                // The last stage is the end of the step.
                self.end.copy_from_slice(&self.stage);
                let (mut error, mut rounding): (f64, f64) = (0.0, 0.0);
                for (j, (a, b)) in y.iter().zip(&self.end).enumerate() {
                    let mut sum = 0.0;
                    for (e, k) in E.iter().zip(&self.k) {
                        sum += e * k[j];
                    }
                    // Relative to where the step begins, and to how far it goes from there at first: what
                    // grows from 1e-6 must be known to its own digits. Not to where it ends: beyond an
                    // event, equations may lead anywhere, and that must not spoil the part that counts.
                    let scale = tolerance * (a.abs().max((h * self.k[0][j]).abs()) + FLOOR);
                    rounding = rounding.max(4.0 * f64::EPSILON * b.abs() / scale);
                    let ratio = (h * sum).abs() / scale;
                    error = if ratio > error || ratio.is_nan() { ratio } else { error };
                }
                (self.finite(error, rounding), 6)
            }
        }
    }

    fn finite(&self, error: f64, rounding: f64) -> Trial {
        let bad = self.end.iter().position(|x| !x.is_finite());
        let last = self.k.last().and_then(|k| k.iter().position(|x| !x.is_finite()));
        match bad.or(last) {
            None if error.is_finite() => Trial::Done { error, rounding },
            at => Trial::NotFinite(at),
        }
    }

    /// The dense output of the step just tried.
    pub fn dense(&self, method: Method, start: Instant, y: &[f64], h: f64) -> Dense {
        let degree = method.dense_degree();
        let mut c = Vec::with_capacity(y.len() * (degree + 1));
        for (j, (&a, &b)) in y.iter().zip(&self.end).enumerate() {
            match method {
                Method::Euler => c.extend([a, b]),
                Method::Rk4 => {
                    c.extend([a, a + h / 3.0 * self.k[0][j], b - h / 3.0 * self.k[4][j], b]);
                }
                Method::Dopri5 | Method::Auto => {
                    // y(s) = a + s r2 + s(1-s) r3 + s²(1-s) r4 + s²(1-s)² r5, turned into Bernstein form.
                    let r2 = b - a;
                    let r3 = h * self.k[0][j] - r2;
                    let r4 = r2 - h * self.k[6][j] - r3;
                    let mut r5 = 0.0;
                    for (d, k) in D.iter().zip(&self.k) {
                        r5 += d * k[j];
                    }
                    r5 *= h;
                    c.extend([
                        a,
                        a + 0.25 * h * self.k[0][j],
                        0.5 * (a + b) + r3 / 3.0 + (r4 + r5) / 6.0,
                        b - 0.25 * h * self.k[6][j],
                        b,
                    ]);
                }
            }
        }
        Dense::new(start, h, degree, c)
    }

    /// Makes the end of the step the start of the next: its rate is known.
    pub fn advance(&mut self, method: Method) -> bool {
        let last = self.k.len() - 1;
        if last > 0 {
            self.k.swap(0, last);
        }
        method != Method::Euler
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y' = y cos(t), y(0) = 1: y = exp(sin t).
    struct Growth {
        t: f64,
    }

    impl Rates for Growth {
        fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
            out[0] = y[0] * (self.t + tau).cos();
        }
    }

    /// Largest error at step ends, and in the middle of steps, on [0, 2].
    fn errors(method: Method, steps: usize) -> (f64, f64) {
        let h = 2.0 / steps as f64;
        let mut workspace = Workspace::default();
        workspace.resize(method, 1);
        let mut y = vec![1.0];
        let (mut end, mut inside): (f64, f64) = (0.0, 0.0);
        for i in 0..steps {
            let mut system = Growth { t: i as f64 * h };
            system.rates(0.0, &y, &mut workspace.k[0]);
            workspace.attempt(method, &mut system, &y, h, 1.0);
            let dense = workspace.dense(method, Instant::ZERO, &y, h);
            y.copy_from_slice(&workspace.end);
            let exact = |s: f64| (system.t + s * h).sin().exp();
            end = end.max((y[0] - exact(1.0)).abs());
            for s in [0.25, 0.5, 0.8] {
                inside = inside.max((dense.value(0, s) - exact(s)).abs());
            }
        }
        (end, inside)
    }

    #[test]
    fn methods_and_their_dense_outputs_have_their_order() {
        for (method, order, dense_order) in
            [(Method::Euler, 1.0, 1.0), (Method::Rk4, 4.0, 4.0), (Method::Dopri5, 5.0, 5.0)]
        {
            let (coarse, fine) = (errors(method, 20), errors(method, 80));
            let slope = |a: f64, b: f64| (a / b).ln() / 4f64.ln();
            let (ends, inside) = (slope(coarse.0, fine.0), slope(coarse.1, fine.1));
            assert!((ends - order).abs() < 0.25, "{method:?}: order {ends}");
            // A dense output of degree p over one step errs like h^(p+1), as the ends do after many.
            assert!((inside - dense_order).abs() < 0.35, "{method:?}: dense order {inside}");
        }
    }
}
