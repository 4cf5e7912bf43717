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

/// `a * b` and its rounding error.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
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
        for i in 0..3 {
            let (p, p_error) = two_product(self.high[i], a);
            let (q, q_error) = two_product(other.high[i], b);
            let (sum, error) = two_sum(p, q);
            let low = error + p_error + q_error + self.low[i] * a + other.low[i] * b;
            (result.high[i], result.low[i]) = two_sum(sum, low);
        }
        result
    }

    /// Length, squared, minus 1: the excess of a vector that is nearly of unit length.
    fn excess(&self) -> f64 {
        let (mut sum, mut low) = (-1.0, 0.0);
        for i in 0..3 {
            let (square, square_error) = two_product(self.high[i], self.high[i]);
            let (next, error) = two_sum(sum, square);
            sum = next;
            low += error + square_error + 2.0 * self.high[i] * self.low[i];
        }
        sum + low
    }

    /// Brings a nearly unit vector to unit length (one step of Newton's method).
    fn unit(&self) -> Twofold {
        self.combined(1.0, self, -0.5 * self.excess())
    }

    /// Two vectors turned in their plane, the first towards the second.
    pub(super) fn turned(a: &Twofold, b: &Twofold, (sin, cos): (f64, f64)) -> [Twofold; 2] {
        // Sine and cosine are rounded, so the pair is stretched a little, both by the same factor; angles
        // stay right.
        [a.combined(cos, b, sin).unit(), b.combined(cos, a, -sin).unit()]
    }
}
