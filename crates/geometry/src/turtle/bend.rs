//! Tropism: headings that bend towards a direction as the turtle goes (ABOP, section 2.3.4).
//!
//! Bending is defined per unit of length, so that cutting a segment in two changes nothing. With the heading
//! `H`, the unit vector `T` and the strength `e` (radians per scene unit, at a right angle)
//!
//! ```text
//! dH/ds = e (H × T) × H
//! ```
//!
//! `H` stays in the plane of `H` and `T`, the angle θ between them obeys `dθ/ds = -e sin θ`, and with
//! `q = exp(-e s)`
//!
//! ```text
//! tan(θ/2) = q tan(θ₀/2),   ∫ sin θ ds = (θ₀ - θ)/e,   ∫ cos θ ds = s + ln(cos²(θ₀/2) + q² sin²(θ₀/2))/e
//! ```

use crate::scene::Vector;

/// A way that bends, from a given heading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend {
    /// Towards which headings bend.
    target: Vector,
    /// In the plane of heading and target, at a right angle to the target, on the heading's side.
    aside: Vector,
    /// At a right angle to the heading, on the target's side.
    towards: Vector,
    strength: f64,
    /// Sine and cosine of half the angle between heading and target.
    half: (f64, f64),
}

impl Bend {
    /// `None` if the way is straight: no strength, or a heading that is exactly along the target.
    pub(super) fn new(heading: Vector, target: Vector, strength: f64) -> Option<Bend> {
        if strength == 0.0 {
            return None;
        }
        let half = ((heading - target).norm() / 2.0, (heading + target).norm() / 2.0);
        let aside = (heading - target * heading.dot(&target)).try_normalize(1e-300)?;
        let towards = (target - heading * heading.dot(&target)).try_normalize(1e-300)?;
        Some(Bend { target, aside, towards, strength, half })
    }

    /// At a right angle to the first heading; headings turn to this side.
    pub(super) fn towards(&self) -> Vector {
        self.towards
    }

    /// By how much the heading has turned after a way of this length, in radians.
    pub(super) fn turn(&self, s: f64) -> f64 {
        let (sin, cos) = self.half;
        let es = self.strength * s;
        // Divided by q where q is large.
        let (above, below) = if es >= 0.0 {
            (-(-es).exp_m1(), cos * cos + sin * sin * (-es).exp())
        } else {
            (es.exp_m1(), cos * cos * es.exp() + sin * sin)
        };
        2.0 * (sin * cos * above).atan2(below)
    }

    /// Where a way of this length leads.
    pub(super) fn displacement(&self, s: f64) -> Vector {
        let (sin, cos) = self.half;
        let es = self.strength * s;
        let logarithm = if es.abs() < 0.5 {
            (sin * sin * (-2.0 * es).exp_m1()).ln_1p()
        } else if es > 0.0 {
            (cos * cos + sin * sin * (-2.0 * es).exp()).ln()
        } else {
            -2.0 * es + (cos * cos * (2.0 * es).exp() + sin * sin).ln()
        };
        self.target * (s + logarithm / self.strength) + self.aside * (self.turn(s) / self.strength)
    }

    /// Into how many straight pieces a way of this length is to be cut so that none is further from it than
    /// `accuracy` (0: not known).
    pub(super) fn pieces(&self, s: f64, accuracy: f64) -> usize {
        /// Turns within a piece, in radians: with and without an accuracy to go by.
        const SHARPEST: [f64; 2] = [0.35, 0.07];
        const MOST: f64 = 1000.0;
        let start = 2.0 * self.half.0.atan2(self.half.1);
        let end = start - self.turn(s);
        let right = std::f64::consts::FRAC_PI_2;
        let crosses = (start - right) * (end - right) <= 0.0;
        let curvature = self.strength.abs() * if crosses { 1.0 } else { start.sin().max(end.sin()) };
        let count = if accuracy > 0.0 {
            (s.abs() * (curvature / (8.0 * accuracy)).sqrt()).max(curvature * s.abs() / SHARPEST[0])
        } else {
            curvature * s.abs() / SHARPEST[1]
        };
        count.ceil().clamp(1.0, MOST) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heading and position after a way, by small steps of the midpoint rule.
    fn stepped(heading: Vector, target: Vector, strength: f64, length: f64) -> (Vector, Vector) {
        let steps = 20_000;
        let ds = length / f64::from(steps);
        let rate = |h: Vector| strength * h.cross(&target).cross(&h);
        let (mut h, mut p) = (heading, Vector::zeros());
        for _ in 0..steps {
            let middle = (h + rate(h) * (ds / 2.0)).normalize();
            p += middle * ds;
            h = (h + rate(middle) * ds).normalize();
        }
        (h, p)
    }

    #[test]
    fn the_formulas_solve_the_equation() {
        let target = Vector::new(1.0, -2.0, 0.5).normalize();
        for heading in [Vector::new(0.3, 1.0, 0.2), Vector::new(-1.0, 1.9, -0.4), Vector::new(1.0, -2.0, 0.6)]
        {
            let heading = heading.normalize();
            for (strength, length) in [(0.7, 1.0), (0.7, 5.0), (-0.4, 3.0), (0.7, -1.0), (1e-9, 2.0)] {
                let (h, p) = stepped(heading, target, strength, length);
                let bend = Bend::new(heading, target, strength).expect("not straight");
                assert!((bend.displacement(length) - p).norm() < 1e-7, "{strength} {length}");
                let (sin, cos) = bend.turn(length).sin_cos();
                assert!((heading * cos + bend.towards() * sin - h).norm() < 1e-7, "{strength} {length}");
            }
        }
    }

    #[test]
    fn nothing_overflows() {
        let (up, down) = (Vector::y(), -Vector::y());
        assert!(Bend::new(up, up, 1.0).is_none() && Bend::new(up, down, 1.0).is_none());
        let slanted = Vector::new(1e-8, 1.0, 0.0).normalize();
        for (strength, length) in [(1e3, 10.0), (-1e3, 10.0), (1e3, -10.0), (1e-300, 1.0), (1e300, 1e300)] {
            let bend = Bend::new(slanted, down, strength).expect("not straight");
            assert!(bend.turn(length).is_finite(), "{strength} {length}");
            assert!((1..=1000).contains(&bend.pieces(length, 1e-6)));
            if length < 1e100 {
                assert!(
                    bend.displacement(length).norm() <= length.abs() * (1.0 + 1e-12),
                    "{strength} {length}"
                );
            }
        }
    }
}
