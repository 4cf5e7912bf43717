//! Random numbers that are the same everywhere.

/// A generator of xorshift type (Marsaglia 2003).
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// A number below `n`.
    pub fn roll(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % n.max(1)
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.roll(from.len())]
    }

    /// A number with three digits behind the point, so that what is printed is what is meant.
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        let part = self.roll(1 << 20) as f64 / f64::from(1 << 20);
        ((lo + part * (hi - lo)) * 1000.0).round() / 1000.0
    }
}
