//! The inverse Fourier transform of three real fields on a lattice of 32³ points, of which few modes are not zero.
//!
//! The modes of a real field at m and -m are conjugate, so that half of them suffices: those whose last component is not negative. The
//! three fields are computed at once, as lanes of vectors, in a fixed order of operations: the same bits on all machines.
//!
//! ```text
//! modes (a, b, c) ──along a──▶ 32 planes of modes (b, c) ──along b──▶ modes c of each line ──along c──▶ values at points
//! ```

use dlsys_wide::{Kernel, Width};

use crate::lanes::{Complex, Lanes};
use crate::turns::cos_sin;

/// Points along each axis.
pub(crate) const N: usize = 32;

/// Modes on an axis are whole numbers from -MODES to MODES, at most a third of the points.
pub(crate) const MODES: i32 = 10;

/// The longest wave vectors have this square of their length.
pub(crate) const LONGEST: i32 = 110;

/// Modes on an axis: 0 to MODES, then -MODES to -1.
const USED: usize = 2 * MODES as usize + 1;

/// Modes on the last axis, of which only half are there.
const HALF: usize = MODES as usize + 1;

/// A mode's place among those on an axis.
fn position(m: i32) -> usize {
    m.rem_euclid(USED as i32) as usize
}

/// The index of a mode whose last component is not negative.
pub(crate) fn index([a, b, c]: [i32; 3]) -> usize {
    (c as usize * USED + position(b)) * USED + position(a)
}

/// Memory for modes, and for the way from them to values.
#[derive(Debug)]
pub(crate) struct Transform {
    /// The amplitudes of modes, see [`index`]. Modes whose last component is 0 must be there with their conjugates.
    pub(crate) modes: Vec<Complex>,
    /// After the first step: for each a and c the modes b. Those that are longer than all modes are always zero.
    planes: Vec<Complex>,
    /// For each b the modes c.
    plane: Vec<[Complex; HALF]>,
    /// exp(2πi j/32).
    roots: [Complex; N],
}

impl Transform {
    pub(crate) fn new() -> Transform {
        let zero = Complex::default();
        let roots = std::array::from_fn(|j| {
            let (c, s) = cos_sin(j as f64 / N as f64);
            Complex { re: Lanes::all(c), im: Lanes::all(s) }
        });
        Transform {
            modes: vec![zero; HALF * USED * USED],
            planes: vec![zero; N * HALF * USED],
            plane: vec![[zero; HALF]; N],
            roots,
        }
    }

    /// Sets all modes to zero.
    pub(crate) fn clear(&mut self) {
        self.modes.fill(Complex::default());
    }

    /// The values at the points of the lattice: `Σ F(m) exp(2πi m·n/32)`. Point (a, b, c) is at index (32 a + b) 32 + c.
    pub(crate) fn values(&mut self) -> Box<[Lanes]> {
        self.values_with(Width::widest())
    }

    /// The same with registers of a width.
    pub(crate) fn values_with(&mut self, width: Width) -> Box<[Lanes]> {
        dlsys_wide::run_with(width, Values(self))
    }
}

struct Values<'t>(&'t mut Transform);

impl Kernel for Values<'_> {
    type Output = Box<[Lanes]>;

    #[inline(always)]
    fn run(self) -> Box<[Lanes]> {
        let Transform { modes, planes, plane, roots } = self.0;
        let (columns, _) = modes.as_chunks::<USED>();
        for (column, modes) in columns.iter().enumerate() {
            let (b, c) = (column % USED, (column / USED) as i32);
            let b = (b as i32 + MODES) % USED as i32 - MODES;
            if b * b + c * c <= LONGEST {
                line(roots, modes, |a, value| planes[a * HALF * USED + column] = value);
            }
        }
        let mut values = vec![Lanes::default(); N * N * N].into_boxed_slice();
        let mut lines = values.as_chunks_mut::<N>().0.iter_mut();
        for half in planes.as_chunks::<USED>().0.as_chunks::<HALF>().0 {
            for (c, modes) in half.iter().enumerate() {
                line(roots, modes, |b, value| plane[b][c] = value);
            }
            for (half, line) in plane.iter().zip(&mut lines) {
                real_line(roots, half, line);
            }
        }
        values
    }
}

/// The transform of four numbers: Σ i^(jq) x_j.
#[inline(always)]
fn four([x0, x1, x2, x3]: [Complex; 4]) -> [Complex; 4] {
    let (a, b, c, d) = (x0 + x2, x0 - x2, x1 + x3, x1.minus_times_i(x3));
    [a + c, b + d, a - c, b - d]
}

/// The transform of the modes on an axis into values at 32 points, which are given to `write` with their indices.
///
/// 32 = 4 · 8: with n = j + 8l and k = q + 4r, the value at k is Σ_j e^(2πi jr/8) e^(2πi jq/32) Σ_l i^(lq) x(j + 8l). Modes between 10
/// and 22 are zero, so that at least one of the four terms of the inner sum is missing.
#[inline(always)]
fn line(roots: &[Complex; N], x: &[Complex; USED], mut write: impl FnMut(usize, Complex)) {
    let mut parts = [[Complex::default(); 8]; 4];
    for j in 0..8 {
        // Modes j and j - 8, and j + 8 or j - 16 if there is one.
        let (x0, x3) = (x[j], x[USED - 8 + j]);
        let sums = match j {
            0..=2 => {
                let (c, d) = (x[j + 8] + x3, x[j + 8].minus_times_i(x3));
                [x0 + c, x0 + d, x0 - c, x0 - d]
            }
            3..=5 => {
                let d = x3.times_i();
                [x0 + x3, x0 - d, x0 - x3, x0 + d]
            }
            _ => {
                let x2 = x[USED - 16 + j];
                let (a, b, d) = (x0 + x2, x0 - x2, x3.times_i());
                [a + x3, b - d, a - x3, b + d]
            }
        };
        parts[0][j] = sums[0];
        for q in 1..4 {
            parts[q][j] = sums[q] * roots[j * q];
        }
    }
    for (q, z) in parts.iter().enumerate() {
        let even = four([z[0], z[2], z[4], z[6]]);
        let odd = four([z[1], z[3], z[5], z[7]]);
        for r in 0..4 {
            let odd = if r == 0 { odd[0] } else { odd[r] * roots[4 * r] };
            write(q + 4 * r, even[r] + odd);
            write(q + 4 * (r + 4), even[r] - odd);
        }
    }
}

/// The real values at 32 points of modes 0 to 10 and their conjugates.
///
/// Values at even points become the real, those at odd points the imaginary part of 16 complex values, whose transform has the modes
/// (1 + i e^(2πi k/32)) F(k) at k modulo 16.
#[inline(always)]
fn real_line(roots: &[Complex; N], modes: &[Complex; HALF], values: &mut [Lanes; N]) {
    let mut z = [Complex::default(); N / 2];
    let one = Lanes::all(1.0);
    // Mode 0 is real up to rounding.
    z[0] = Complex { re: modes[0].re, im: modes[0].re };
    for k in 1..HALF {
        let mode = modes[k];
        let factor = Complex { re: one - roots[k].im, im: roots[k].re };
        let here = mode * factor;
        // The same for -k, of the conjugate.
        let there = Complex { re: mode.re + mode.re - here.re, im: here.im - (mode.im + mode.im) };
        z[k] = z[k] + here;
        z[N / 2 - k] = z[N / 2 - k] + there;
    }
    let mut parts = [[Complex::default(); 4]; 4];
    for j in 0..4 {
        let sums = four([z[j], z[j + 4], z[j + 8], z[j + 12]]);
        for q in 0..4 {
            parts[q][j] = if j * q == 0 { sums[q] } else { sums[q] * roots[2 * j * q] };
        }
    }
    for (q, part) in parts.into_iter().enumerate() {
        for (r, value) in four(part).into_iter().enumerate() {
            let at = 2 * (q + 4 * r);
            (values[at], values[at + 1]) = (value.re, value.im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Modes in all parts of the spectrum, with pairs of conjugates where the last component is 0.
    const GIVEN: [([i32; 3], [f64; 2]); 10] = [
        ([0, 1, 3], [0.5, -1.0]),
        ([0, 0, 0], [0.75, 0.0]),
        ([6, -6, 6], [2.0, 0.25]),
        ([-4, 0, 9], [-1.5, 0.125]),
        ([3, -5, 1], [0.25, 1.5]),
        ([-7, 7, 2], [1.0, 1.0]),
        ([10, 2, 0], [-0.5, 0.75]),
        ([-10, -2, 0], [-0.5, -0.75]),
        ([0, 3, 0], [0.5, 2.0]),
        ([0, -3, 0], [0.5, -2.0]),
    ];

    #[test]
    fn a_few_modes_agree_with_their_sum() {
        let mut transform = Transform::new();
        // Nothing is left of a transform before.
        transform.modes.fill(Complex { re: Lanes::all(7.0), im: Lanes::all(-3.0) });
        transform.values();
        transform.clear();
        for (m, [re, im]) in GIVEN {
            let lanes = |x: f64| Lanes([x, 2.0 * x, -x, 0.0]);
            transform.modes[index(m)] = Complex { re: lanes(re), im: lanes(im) };
        }
        let values = transform.values();
        let size: f64 = GIVEN.iter().map(|(_, [re, im])| 2.0 * re.hypot(*im)).sum();
        assert_eq!(values.len(), N * N * N);
        for (at, value) in values.iter().enumerate() {
            let n = [at / (N * N), at / N % N, at % N];
            let mut sum = 0.0;
            for (m, [re, im]) in GIVEN {
                let phase: i32 = m.iter().zip(n).map(|(m, n)| m * n as i32).sum();
                let (c, s) = cos_sin(f64::from(phase) / N as f64);
                let pair = if m[2] == 0 { 1.0 } else { 2.0 };
                sum += pair * (re * c - im * s);
            }
            for (lane, factor) in [1.0, 2.0, -1.0, 0.0].into_iter().enumerate() {
                let error = value.0[lane] - factor * sum;
                assert!(error.abs() <= 1e-15 * factor.abs() * size, "{n:?}, lane {lane}: {error:e}");
            }
        }
    }
}
