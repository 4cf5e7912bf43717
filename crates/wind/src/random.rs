//! Random numbers as functions of a seed and of the mode that they belong to.
//!
//! There is no generator with a state: the number of a mode depends on nothing else. The function is the finalizer of
//! SplitMix64 (Steele, Lea, Flood 2014), applied to one key after another.

use crate::turns::cos_sin;

/// A source of independent random numbers, by keys: a number is a function of the seed and of the keys that lead to it, not of the order of
/// computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw(u64);

impl Draw {
    /// The source that belongs to a seed.
    pub fn new(seed: u64) -> Draw {
        Draw(0x7769_6e64).of(seed)
    }

    /// The source that belongs to a key within this one.
    #[must_use]
    pub fn of(self, key: u64) -> Draw {
        let mut z = self.0.rotate_left(23).wrapping_add(key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Draw(z ^ (z >> 31))
    }

    /// A number that tells this source from others.
    pub fn key(self) -> u64 {
        self.0
    }

    /// Uniformly distributed in the open interval from 0 to 1.
    pub fn unit(self) -> f64 {
        ((self.0 >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// Two independent normal numbers of mean 0 and variance 1 (Box and Muller).
    pub(crate) fn normal_pair(self) -> [f64; 2] {
        let radius = (-2.0 * libm::log(self.of(1).unit())).sqrt();
        let (c, s) = cos_sin(self.of(2).unit());
        [radius * c, radius * s]
    }
}

/// The quantile function of the normal distribution of mean 0 and variance 1, at `p` between 0 and 1, to about 1e-9 (Newton's
/// method on `erfc`).
pub(crate) fn normal_quantile(p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    // Abramowitz and Stegun 26.2.22, within 3e-3.
    let r = (-2.0 * libm::log(tail)).sqrt();
    let mut x = r - (2.30753 + 0.27061 * r) / (1.0 + r * (0.99229 + r * 0.04481));
    for _ in 0..3 {
        let excess = 0.5 * libm::erfc(x * std::f64::consts::FRAC_1_SQRT_2) - tail;
        let density = libm::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
        x += excess / density;
    }
    if p < 0.5 { -x } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_invert_the_distribution() {
        for i in 1..4000 {
            let p = f64::from(i) / 4000.0;
            let back = 0.5 * libm::erfc(-normal_quantile(p) * std::f64::consts::FRAC_1_SQRT_2);
            assert!((back - p).abs() < 1e-9, "{p} gave {back}");
        }
    }

    #[test]
    fn moments_of_normal_numbers() {
        let (mut sum, mut square, mut cross, mut fourth) = (0.0, 0.0, 0.0, 0.0);
        let n = 200_000;
        for i in 0..n {
            let [a, b] = Draw::new(7).of(i).normal_pair();
            sum += a + b;
            square += a * a + b * b;
            cross += a * b;
            fourth += a.powi(4) + b.powi(4);
        }
        let n = n as f64;
        // Four standard errors.
        assert!((sum / (2.0 * n)).abs() < 4.0 / (2.0 * n).sqrt());
        assert!((square / (2.0 * n) - 1.0).abs() < 4.0 * (2.0 / (2.0 * n)).sqrt());
        assert!((cross / n).abs() < 4.0 / n.sqrt());
        assert!((fourth / (2.0 * n) - 3.0).abs() < 4.0 * (96.0 / (2.0 * n)).sqrt());
    }
}
