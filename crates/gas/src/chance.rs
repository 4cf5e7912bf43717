//! Random numbers as functions of keys: of a source and the number of a blob, not of the order of computation.

use dlsys_wind::Draw;

use crate::Vector;

/// A source of independent numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chance(Draw);

impl Chance {
    pub(crate) fn new(seed: u64) -> Chance {
        Chance(Draw::new(seed))
    }

    /// The source that belongs to a key within this one.
    pub(crate) fn of(self, key: u64) -> Chance {
        Chance(self.0.of(key))
    }

    /// A number that tells this source from others.
    pub(crate) fn key(self) -> u64 {
        self.0.key()
    }

    /// Uniformly distributed in the open interval from 0 to 1.
    pub(crate) fn unit(self) -> f64 {
        self.0.unit()
    }

    /// Uniformly distributed over directions (Archimedes: heights on a sphere are uniform).
    pub(crate) fn direction(self) -> Vector {
        let height = 2.0 * self.of(0).unit() - 1.0;
        let angle = std::f64::consts::TAU * self.of(1).unit();
        let across = (1.0 - height * height).sqrt();
        Vector::new(across * libm::cos(angle), height, across * libm::sin(angle))
    }

    /// Uniformly distributed in a ball of radius 1.
    pub(crate) fn in_ball(self) -> Vector {
        self.of(2).direction() * libm::cbrt(self.of(3).unit())
    }

    /// Three orthogonal directions, uniformly distributed.
    pub(crate) fn axes(self) -> [Vector; 3] {
        let first = self.of(4).direction();
        let angle = std::f64::consts::TAU * self.of(5).unit();
        let aside = if first.x.abs() < 0.6 { Vector::x() } else { Vector::y() };
        let second = first.cross(&aside).normalize();
        let third = first.cross(&second);
        let (cos, sin) = (libm::cos(angle), libm::sin(angle));
        [first, second * cos + third * sin, third * cos - second * sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means and variances of balls and axes, within five standard errors.
    #[test]
    fn places_are_uniform() {
        let count = 100_000;
        let (mut mean, mut square, mut axes) = (Vector::zeros(), Vector::zeros(), Vector::zeros());
        for k in 0..count {
            let place = Chance::new(7).of(k).in_ball();
            assert!(place.norm() <= 1.0);
            mean += place;
            square += place.component_mul(&place);
            let [a, b, c] = Chance::new(7).of(k).axes();
            assert!(a.dot(&b).abs() < 1e-12 && (a.cross(&b) - c).norm() < 1e-12);
            axes += c.component_mul(&c);
        }
        let count = count as f64;
        assert!(mean.amax() / count < 5.0 * (0.2 / count).sqrt());
        for (value, expected) in square.iter().map(|v| (*v, 0.2)).chain(axes.iter().map(|v| (*v, 1.0 / 3.0)))
        {
            assert!((value / count - expected).abs() < 5.0 * 0.3 / count.sqrt(), "{value} {expected}");
        }
    }
}
