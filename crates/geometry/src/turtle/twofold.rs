//! Vectors of twice the usual precision (Dekker 1971; Ogita, Rump and Oishi 2005).
//!
//! A turn rounds the turtle's frame in its last place. Over a million turns about changing axes that adds up
//! to 1e-12 and more, and a string that turns its way back ends a little beside where it began. With the
//! rounding errors carried along, what is left is far below the last place.

use crate::scene::Vector;

/// The unevaluated sum of two vectors, the second one below the last place of the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Twofold {
    high: Vector,
    low: Vector,
}

/// `a + b` and its rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// A number as the sum of two of 26 bits each (Veltkamp, in Dekker 1971), whose products are exact. Where the processor that is compiled for has no fused
/// multiplication and addition, `mul_add` is a call, and takes several times as long.
#[derive(Clone, Copy)]
struct Split {
    whole: f64,
    high: f64,
    low: f64,
}

impl Split {
    fn new(whole: f64) -> Split {
        /// `2^27 + 1`
        const SPLITTER: f64 = 134_217_729.0;
        let scaled = SPLITTER * whole;
        let high = scaled - (scaled - whole);
        Split { whole, high, low: whole - high }
    }

    /// The product and its rounding error.
    fn times(self, other: Split) -> (f64, f64) {
        let product = self.whole * other.whole;
        let error = ((self.high * other.high - product) + self.high * other.low + self.low * other.high)
            + self.low * other.low;
        (product, error)
    }
}

impl Twofold {
    pub(super) fn new(v: Vector) -> Twofold {
        Twofold { high: v, low: Vector::zeros() }
    }

    /// The vector, rounded.
    pub(super) fn value(&self) -> Vector {
        self.high
    }

    /// `self * a + other * b`
    fn combined(&self, a: f64, other: &Twofold, b: f64) -> Twofold {
        let mut result = *self;
        if a == 0.0 && b.abs() == 1.0 {
            // A right angle: all products are exact, and the sums of the general way are these.
            for i in 0..3 {
                let low = 0.0 + self.low[i] * a + other.low[i] * b;
                (result.high[i], result.low[i]) = two_sum(self.high[i] * a + other.high[i] * b, low);
            }
            return result;
        }
        let [by_a, by_b] = [a, b].map(Split::new);
        for i in 0..3 {
            let (p, p_error) = Split::new(self.high[i]).times(by_a);
            let (q, q_error) = Split::new(other.high[i]).times(by_b);
            let (sum, error) = two_sum(p, q);
            let low = error + p_error + q_error + self.low[i] * a + other.low[i] * b;
            (result.high[i], result.low[i]) = two_sum(sum, low);
        }
        result
    }

    /// Brings a nearly unit vector to unit length (one step of Newton's method): with its length, squared, minus 1, times -1/2 of it is added.
    fn unit(&self) -> Twofold {
        let splits = [0, 1, 2].map(|i| Split::new(self.high[i]));
        let (mut sum, mut low) = (-1.0, 0.0);
        for (i, high) in splits.into_iter().enumerate() {
            let (square, square_error) = high.times(high);
            let (next, error) = two_sum(sum, square);
            sum = next;
            low += error + square_error + 2.0 * self.high[i] * self.low[i];
        }
        let factor = -0.5 * (sum + low);
        let mut result = *self;
        let by_factor = Split::new(factor);
        for (i, high) in splits.into_iter().enumerate() {
            let (q, q_error) = high.times(by_factor);
            let (sum, error) = two_sum(self.high[i], q);
            let low = error + 0.0 + q_error + self.low[i] + self.low[i] * factor;
            (result.high[i], result.low[i]) = two_sum(sum, low);
        }
        result
    }

    /// Two vectors turned in their plane, the first towards the second.
    pub(super) fn turned(a: &Twofold, b: &Twofold, (sin, cos): (f64, f64)) -> [Twofold; 2] {
        // Sine and cosine are rounded, so the pair is stretched a little, both by the same factor; angles
        // stay right.
        [a.combined(cos, b, sin).unit(), b.combined(cos, a, -sin).unit()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_products_are_those_of_a_fused_multiplication() {
        let mut number = 0.3_f64;
        for exponent in -400..400_i32 {
            // Irregular numbers from -1 to 1, and their products with small and large ones.
            number = (number * 997.0 + 0.123).sin();
            let (a, b) = (number, (number * 31.0).cos() * 2_f64.powi(exponent));
            let (product, error) = Split::new(a).times(Split::new(b));
            assert_eq!((product, error), (a * b, a.mul_add(b, -product)), "{a} {b}");
        }
    }
}
