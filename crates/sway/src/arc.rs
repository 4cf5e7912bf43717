//! The shape of a segment of constant strain in closed form, with its derivatives by the strain.
//!
//! A segment is described by the rotation vector θ = l κ of its whole length and the fraction ξ of a section. In the base frame
//!
//! - the section is turned by `R = exp(ξ [θ])` and stands at `l g`, `g = ∫₀^ξ exp(η [θ]) e dη`, with the heading e;
//! - a change of θ by dθ turns it by `B dθ`, `B = ∫₀^ξ exp(η [θ]) dη`, and moves it by `l C dθ`, `C = ∂g/∂θ`.
//!
//! With K = [θ], `R = 1 + a K + b K²`, `B = ξ + b K + c K²`, `g = B e`, where a, b and c are entire functions of (ξ |θ|)². They are summed as
//! series below 4, so that nothing cancels for straight segments, and computed with sine and cosine above.

use crate::{Matrix, Vector};

/// Coefficients 1/(2k+2)! and 1/(2k+3)! of the two series, in powers of -y.
const COSINE: [f64; TERMS] = coefficients(2);
const SINE: [f64; TERMS] = coefficients(3);
/// Enough for y ≤ 4.
const TERMS: usize = 16;
/// Enough for y ≤ 0.02.
const FEW: usize = 7;

const fn coefficients(first: u32) -> [f64; TERMS] {
    let mut all = [0.0; TERMS];
    let mut factorial = 1.0;
    let mut n = 1;
    while n <= first {
        factorial *= n as f64;
        n += 1;
    }
    let mut k = 0;
    while k < TERMS {
        all[k] = if k % 2 == 0 { 1.0 / factorial } else { -1.0 / factorial };
        factorial *= (n * (n + 1)) as f64;
        n += 2;
        k += 1;
    }
    all
}

/// A polynomial, and its first and second derivatives, by Horner's rule.
#[inline(always)]
fn polynomial<const N: usize>(coefficients: &[f64; TERMS], y: f64) -> [f64; 3] {
    let (mut value, mut first, mut half) = (coefficients[N - 1], 0.0, 0.0);
    for &coefficient in coefficients[..N - 1].iter().rev() {
        half = half * y + first;
        first = first * y + value;
        value = value * y + coefficient;
    }
    [value, first, 2.0 * half]
}

/// `(1 - cos x)/x²` and `(x - sin x)/x³` as functions of y = x², with their first and second derivatives.
#[inline(always)]
fn functions(y: f64) -> ([f64; 3], [f64; 3]) {
    if y <= 0.02 {
        return (polynomial::<FEW>(&COSINE, y), polynomial::<FEW>(&SINE, y));
    }
    if y <= 4.0 {
        return (polynomial::<TERMS>(&COSINE, y), polynomial::<TERMS>(&SINE, y));
    }
    let x = y.sqrt();
    let (sine, cosine) = x.sin_cos();
    let ratio = sine / x;
    let slope = (cosine - ratio) / (2.0 * y);
    let bend = (-0.5 * ratio - 3.0 * slope) / (2.0 * y);
    let b = (1.0 - cosine) / y;
    let db = (0.5 * ratio - b) / y;
    let c = (1.0 - ratio) / y;
    let dc = (-slope - c) / y;
    ([b, db, (0.5 * slope - 2.0 * db) / y], [c, dc, (-bend - 2.0 * dc) / y])
}

/// A section of a segment in its base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Section {
    theta: Vector,
    xi: f64,
    /// θ × e and θ × (θ × e).
    across: Vector,
    inward: Vector,
    /// a, b, c, and the derivatives of b and c by |θ|, divided by |θ|, once and twice.
    a: f64,
    b: [f64; 3],
    c: [f64; 3],
}

impl Section {
    pub(crate) const ZERO: Section = {
        let zero = Vector::new(0.0, 0.0, 0.0);
        Section { theta: zero, xi: 0.0, across: zero, inward: zero, a: 0.0, b: [0.0; 3], c: [0.0; 3] }
    };

    /// The section at the fraction `xi` of a segment with the rotation vector `theta`.
    #[inline(always)]
    pub(crate) fn new(theta: &Vector, xi: f64) -> Section {
        let square = theta.norm_squared();
        let (xi2, xi3) = (xi * xi, xi * xi * xi);
        let y = xi2 * square;
        let (b, c) = functions(y);
        let across = Vector::new(0.0, theta.z, -theta.y);
        let mut inward = theta * theta.x;
        inward.x -= square;
        Section {
            theta: *theta,
            xi,
            across,
            inward,
            a: xi * (1.0 - y * c[0]),
            b: [xi2 * b[0], 2.0 * xi2 * xi2 * b[1], 4.0 * xi3 * xi3 * b[2]],
            c: [xi3 * c[0], 2.0 * xi2 * xi3 * c[1], 4.0 * xi3 * xi2 * xi2 * c[2]],
        }
    }

    /// R.
    #[inline(always)]
    pub(crate) fn rotation(&self) -> Matrix {
        rotation_like(&self.theta, 1.0, self.a, self.b[0])
    }

    /// B.
    #[inline(always)]
    pub(crate) fn turning(&self) -> Matrix {
        rotation_like(&self.theta, self.xi, self.b[0], self.c[0])
    }

    /// g.
    #[inline(always)]
    pub(crate) fn place(&self) -> Vector {
        let mut place = self.across * self.b[0] + self.inward * self.c[0];
        place.x += self.xi;
        place
    }

    /// C.
    #[inline(always)]
    pub(crate) fn shift(&self) -> Matrix {
        let (b, c) = (self.b[0], self.c[0]);
        let slope = self.across * self.b[1] + self.inward * self.c[1];
        let mut shift = slope * self.theta.transpose();
        let (u, t) = (&self.across, &self.theta);
        // b (x × e) + c (x × u + x (θ·e) - e (θ·x)), column by column of x.
        shift[(0, 1)] += c * (u.z - t.y);
        shift[(0, 2)] += c * (-u.y - t.z);
        shift[(1, 0)] += -c * u.z;
        shift[(1, 1)] += c * t.x;
        shift[(1, 2)] += b + c * u.x;
        shift[(2, 0)] += c * u.y;
        shift[(2, 1)] += -b - c * u.x;
        shift[(2, 2)] += c * t.x;
        shift
    }

    /// The unit tangent R e.
    #[inline(always)]
    pub(crate) fn tangent(&self) -> Vector {
        let mut tangent = self.across * self.a + self.inward * self.b[0];
        tangent.x += 1.0;
        tangent
    }

    /// Second derivative of g along a path with the rate `rate` of θ and without acceleration.
    #[inline(always)]
    pub(crate) fn shift_rate(&self, rate: &Vector) -> Vector {
        let (s, n) = (self.theta.dot(rate), rate.norm_squared());
        let (db, dc) = (self.b[1] * s, self.c[1] * s);
        let (ddb, ddc) = (self.b[2] * s * s + self.b[1] * n, self.c[2] * s * s + self.c[1] * n);
        let across_rate = Vector::new(0.0, rate.z, -rate.y);
        let inward_rate = rate.cross(&self.across) + self.theta.cross(&across_rate);
        across_rate * (2.0 * db)
            + inward_rate * (2.0 * dc)
            + rate.cross(&across_rate) * (2.0 * self.c[0])
            + self.across * ddb
            + self.inward * ddc
    }

    /// Derivative of `B rate` along such a path, in the base frame.
    #[inline(always)]
    pub(crate) fn turning_rate(&self, rate: &Vector) -> Vector {
        let s = self.theta.dot(rate);
        let turn = self.theta.cross(rate);
        turn * (self.b[1] * s) + self.theta.cross(&turn) * (self.c[1] * s) + rate.cross(&turn) * self.c[0]
    }
}

/// `start + first K + second K²`, K = [θ].
#[inline(always)]
fn rotation_like(theta: &Vector, start: f64, first: f64, second: f64) -> Matrix {
    let (x, y, z) = (theta.x, theta.y, theta.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    Matrix::new(
        start - second * (yy + zz),
        second * x * y - first * z,
        second * x * z + first * y,
        second * x * y + first * z,
        start - second * (xx + zz),
        second * y * z - first * x,
        second * x * z - first * y,
        second * y * z + first * x,
        start - second * (xx + yy),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of the place and of the rotation agree with the derivatives, at angles of every branch.
    #[test]
    fn derivatives_agree_with_differences() {
        for scale in [1e-9, 0.05, 0.14, 0.9, 1.9, 2.1, 7.0] {
            let theta = Vector::new(0.3, -0.7, 0.64) * scale;
            let rate = Vector::new(-0.4, 0.5, 0.8);
            for xi in [0.25, 1.0] {
                let section = Section::new(&theta, xi);
                let h = 1e-4;
                let [before, after] = [-h, h].map(|h| Section::new(&(theta + rate * h), xi));
                let speed = (after.place() - before.place()) / (2.0 * h);
                assert!((section.shift() * rate - speed).norm() < 1e-8, "shift at {scale}");
                let acceleration = (after.place() - section.place() * 2.0 + before.place()) / (h * h);
                assert!((section.shift_rate(&rate) - acceleration).norm() < 1e-6, "second at {scale}");
                let spin =
                    (after.rotation() - before.rotation()) * section.rotation().transpose() / (2.0 * h);
                let turning = section.turning() * rate;
                let spin = Vector::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
                assert!((turning - spin).norm() < 1e-8, "turning at {scale}");
                let change = (after.turning() * rate - before.turning() * rate) / (2.0 * h);
                assert!((section.turning_rate(&rate) - change).norm() < 1e-8, "turning rate at {scale}");
                assert!((section.rotation().column(0) - section.tangent()).norm() < 1e-15);
            }
        }
    }

    /// Series and closed forms meet, and a straight segment is exact.
    #[test]
    fn branches_meet() {
        for border in [0.02_f64, 4.0] {
            let (below, above) = (functions(border), functions(border * (1.0 + 1e-15)));
            for (a, b) in below.0.iter().chain(&below.1).zip(above.0.iter().chain(&above.1)) {
                assert!((a / b - 1.0).abs() < 2e-13, "{a} {b} at {border}");
            }
        }
        let straight = Section::new(&Vector::zeros(), 0.5);
        assert_eq!(straight.place(), Vector::new(0.5, 0.0, 0.0));
        assert_eq!(straight.turning(), Matrix::identity() * 0.5);
    }
}
