//! Numbers for the sparse elimination: real, complex, and several complex numbers side by side.

/// Numbers the elimination can work with. Magnitudes should stay within about 1e-150 .. 1e150, because the
/// complex reciprocal squares them.
pub trait Field: Copy {
    /// How many `f64` fit into one number; the tree elimination packs real couplings into whole numbers.
    const REALS: usize;
    /// The number 0.
    fn zero() -> Self;
    /// A real number.
    fn from_f64(x: f64) -> Self;
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Product with a real number.
    fn scale(self, factor: f64) -> Self;
    /// `1 / self`; not usable if `self` is 0.
    fn reciprocal(self) -> Self;
    /// Finite and not 0 (in every lane).
    fn usable(self) -> bool;
    /// Stores a real number at place `i` of a slice seen as `f64`s, `i < REALS * len`.
    fn put(slice: &mut [Self], i: usize, x: f64);
    /// Reads what `put` stored.
    fn get(slice: &[Self], i: usize) -> f64;
}

impl Field for f64 {
    const REALS: usize = 1;
    #[inline(always)]
    fn zero() -> Self {
        0.0
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn usable(self) -> bool {
        self.is_finite() && self != 0.0
    }
    #[inline(always)]
    fn put(slice: &mut [Self], i: usize, x: f64) {
        slice[i] = x;
    }
    #[inline(always)]
    fn get(slice: &[Self], i: usize) -> f64 {
        slice[i]
    }
}

/// A complex number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Field for Complex {
    const REALS: usize = 2;
    #[inline(always)]
    fn zero() -> Self {
        Complex { re: 0.0, im: 0.0 }
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Complex { re: x, im: 0.0 }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Complex { re: self.re + other.re, im: self.im + other.im }
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Complex { re: self.re - other.re, im: self.im - other.im }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Complex { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        Complex { re: self.re * factor, im: self.im * factor }
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        let d = 1.0 / (self.re * self.re + self.im * self.im);
        Complex { re: self.re * d, im: -self.im * d }
    }
    #[inline(always)]
    fn usable(self) -> bool {
        (self.re.abs() + self.im.abs()).usable()
    }
    #[inline(always)]
    fn put(slice: &mut [Self], i: usize, x: f64) {
        let c = &mut slice[i / 2];
        *(if i.is_multiple_of(2) { &mut c.re } else { &mut c.im }) = x;
    }
    #[inline(always)]
    fn get(slice: &[Self], i: usize) -> f64 {
        let c = &slice[i / 2];
        if i.is_multiple_of(2) { c.re } else { c.im }
    }
}

/// `N` complex numbers; operations go lane by lane, so that the compiler can use vector instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wide<const N: usize> {
    /// Real parts.
    pub re: [f64; N],
    /// Imaginary parts.
    pub im: [f64; N],
}

impl<const N: usize> Field for Wide<N> {
    const REALS: usize = 2 * N;
    #[inline(always)]
    fn zero() -> Self {
        Wide { re: [0.0; N], im: [0.0; N] }
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Wide { re: [x; N], im: [0.0; N] }
    }
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for l in 0..N {
            self.re[l] += other.re[l];
            self.im[l] += other.im[l];
        }
        self
    }
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for l in 0..N {
            self.re[l] -= other.re[l];
            self.im[l] -= other.im[l];
        }
        self
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut out = self;
        for l in 0..N {
            out.re[l] = self.re[l] * other.re[l] - self.im[l] * other.im[l];
            out.im[l] = self.re[l] * other.im[l] + self.im[l] * other.re[l];
        }
        out
    }
    #[inline(always)]
    fn scale(mut self, factor: f64) -> Self {
        for l in 0..N {
            self.re[l] *= factor;
            self.im[l] *= factor;
        }
        self
    }
    #[inline(always)]
    fn reciprocal(mut self) -> Self {
        for l in 0..N {
            let d = 1.0 / (self.re[l] * self.re[l] + self.im[l] * self.im[l]);
            self.re[l] *= d;
            self.im[l] *= -d;
        }
        self
    }
    #[inline(always)]
    fn usable(self) -> bool {
        (0..N).fold(true, |good, l| good & (self.re[l].abs() + self.im[l].abs()).usable())
    }
    #[inline(always)]
    fn put(slice: &mut [Self], i: usize, x: f64) {
        let (w, l) = (&mut slice[i / (2 * N)], i % (2 * N));
        *(if l < N { &mut w.re[l] } else { &mut w.im[l - N] }) = x;
    }
    #[inline(always)]
    fn get(slice: &[Self], i: usize) -> f64 {
        let (w, l) = (&slice[i / (2 * N)], i % (2 * N));
        if l < N { w.re[l] } else { w.im[l - N] }
    }
}
