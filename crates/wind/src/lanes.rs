//! Four numbers that are computed with at once, and complex numbers made of them.
//!
//! Compilers turn each operation into one instruction; all of them are exactly rounded, so results have the same bits on all machines.

use std::ops::{Add, Mul, Sub};

/// Four numbers: three components of a vector, and one that is not used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub(crate) struct Lanes(pub(crate) [f64; 4]);

impl Lanes {
    /// The same number four times.
    pub(crate) const fn all(value: f64) -> Lanes {
        Lanes([value; 4])
    }

    #[inline(always)]
    fn zip(self, other: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
        let ([a, b, c, d], [e, g, h, i]) = (self.0, other.0);
        Lanes([f(a, e), f(b, g), f(c, h), f(d, i)])
    }
}

impl Add for Lanes {
    type Output = Lanes;

    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Lanes;

    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Lanes;

    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a * b)
    }
}

/// Four complex numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Complex {
    pub(crate) re: Lanes,
    pub(crate) im: Lanes,
}

impl Complex {
    /// The product with i.
    #[inline(always)]
    pub(crate) fn times_i(self) -> Complex {
        Complex { re: Lanes::default() - self.im, im: self.re }
    }

    /// The difference, times i.
    #[inline(always)]
    pub(crate) fn minus_times_i(self, other: Complex) -> Complex {
        Complex { re: other.im - self.im, im: self.re - other.re }
    }
}

impl Add for Complex {
    type Output = Complex;

    #[inline(always)]
    fn add(self, other: Complex) -> Complex {
        Complex { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Complex;

    #[inline(always)]
    fn sub(self, other: Complex) -> Complex {
        Complex { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Complex;

    #[inline(always)]
    fn mul(self, other: Complex) -> Complex {
        Complex { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}
