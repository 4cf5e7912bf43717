//! The inverse Fourier transform of a lattice of 32³ points, of which few modes are not zero.
//!
//! Radix 2, decimation in frequency, in a fixed order of additions and multiplications: the same bits on all machines.
//! Real and imaginary parts are in arrays of their own, and the inner loops run along contiguous numbers.

use crate::turns::cos_sin;

/// Points along each axis.
pub(crate) const N: usize = 32;

/// Modes on an axis are whole numbers from -MODES to MODES, at most a third of the points.
pub(crate) const MODES: i32 = 10;

/// A complex lattice; point (a, b, c) is at index (32 a + b) 32 + c.
pub(crate) struct Grid {
    pub(crate) re: Vec<f64>,
    pub(crate) im: Vec<f64>,
    /// exp(2πi j/32), for j from 0 to 15.
    twiddles: [(f64, f64); N / 2],
}

impl Grid {
    pub(crate) fn new() -> Grid {
        let twiddles = std::array::from_fn(|j| cos_sin(j as f64 / N as f64));
        Grid { re: vec![0.0; N * N * N], im: vec![0.0; N * N * N], twiddles }
    }

    /// Sets all points to zero.
    pub(crate) fn clear(&mut self) {
        self.re.fill(0.0);
        self.im.fill(0.0);
    }

    /// Replaces amplitudes of modes by values at points: `Σ F(m) exp(2πi m·n/32)`. Modes beyond ±[`MODES`] must be zero.
    pub(crate) fn invert(&mut self) {
        let used = |index: usize| index <= MODES as usize || index >= N - MODES as usize;
        for a in (0..N).filter(|&a| used(a)) {
            for b in (0..N).filter(|&b| used(b)) {
                let at = (a * N + b) * N;
                single(&self.twiddles, &mut self.re[at..at + N], &mut self.im[at..at + N]);
            }
            let at = a * N * N;
            line(&self.twiddles, &mut self.re[at..at + N * N], &mut self.im[at..at + N * N], N);
        }
        line(&self.twiddles, &mut self.re, &mut self.im, N * N);
    }
}

/// The transform of 32 blocks of `width` numbers each, number by number.
fn line(twiddles: &[(f64, f64); N / 2], re: &mut [f64], im: &mut [f64], width: usize) {
    let mut half = N / 2;
    while half > 0 {
        for start in (0..N).step_by(2 * half) {
            for j in 0..half {
                let (c, s) = twiddles[j * (N / 2 / half)];
                let (upper, lower) = ((start + j) * width, (start + j + half) * width);
                let (r0, r1) = re.split_at_mut(lower);
                let (i0, i1) = im.split_at_mut(lower);
                let (r0, r1) = (&mut r0[upper..upper + width], &mut r1[..width]);
                let (i0, i1) = (&mut i0[upper..upper + width], &mut i1[..width]);
                for (((r0, r1), i0), i1) in r0.iter_mut().zip(r1).zip(i0).zip(i1) {
                    let (dr, di) = (*r0 - *r1, *i0 - *i1);
                    *r0 += *r1;
                    *i0 += *i1;
                    *r1 = dr * c - di * s;
                    *i1 = dr * s + di * c;
                }
            }
        }
        half /= 2;
    }
    // Results are in the order of reversed bits.
    for i in 0..N {
        let j = (i as u8).reverse_bits() as usize >> 3;
        if i < j {
            for k in 0..width {
                re.swap(i * width + k, j * width + k);
                im.swap(i * width + k, j * width + k);
            }
        }
    }
}

/// The same for one line of numbers: decimation in time, in local arrays of a known length.
fn single(twiddles: &[(f64, f64); N / 2], re: &mut [f64], im: &mut [f64]) {
    let reversed = |i: usize| (i as u8).reverse_bits() as usize >> 3;
    let mut x: [f64; N] = std::array::from_fn(|i| re[reversed(i)]);
    let mut y: [f64; N] = std::array::from_fn(|i| im[reversed(i)]);
    let mut half = 1;
    while half < N {
        for start in (0..N).step_by(2 * half) {
            for j in 0..half {
                let (c, s) = twiddles[j * (N / 2 / half)];
                let (upper, lower) = (start + j, start + j + half);
                let (dx, dy) = (x[lower] * c - y[lower] * s, x[lower] * s + y[lower] * c);
                (x[lower], y[lower]) = (x[upper] - dx, y[upper] - dy);
                (x[upper], y[upper]) = (x[upper] + dx, y[upper] + dy);
            }
        }
        half *= 2;
    }
    re.copy_from_slice(&x);
    im.copy_from_slice(&y);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_modes_agree_with_their_sum() {
        let modes = [([0i32, 1, -3], (0.5, -1.0)), ([10, -10, 7], (2.0, 0.25)), ([-4, 0, 9], (-1.5, 0.125))];
        let mut grid = Grid::new();
        for (m, (re, im)) in modes {
            let index = m.iter().fold(0, |at, m| at * N + m.rem_euclid(N as i32) as usize);
            grid.re[index] = re;
            grid.im[index] = im;
        }
        grid.invert();
        for n in [[0usize, 0, 0], [1, 2, 3], [31, 16, 5], [12, 30, 29]] {
            let (mut re, mut im) = (0.0, 0.0);
            for (m, (a, b)) in modes {
                let phase: i32 = m.iter().zip(n).map(|(m, n)| m * n as i32).sum();
                let (c, s) = cos_sin(f64::from(phase) / N as f64);
                re += a * c - b * s;
                im += a * s + b * c;
            }
            let index = (n[0] * N + n[1]) * N + n[2];
            assert!((grid.re[index] - re).abs() < 1e-13 && (grid.im[index] - im).abs() < 1e-13, "{n:?}");
        }
    }
}
