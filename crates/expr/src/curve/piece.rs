//! One piece of a curve: a point of the plane that is a cubic in a parameter u from 0 to 1.

use super::Part;

/// `x(u)`, which increases, and `y(u)`; coefficients from the constant one on.
#[derive(Clone, Debug)]
pub struct Cubic {
    pub x: [f64; 4],
    pub y: [f64; 4],
    /// `∫ y x' du` from 0: the coefficients of u, u², …, u⁶.
    area: [f64; 6],
    /// x is linear in u.
    pub straight: bool,
}

/// A speed of x below this part of the width of its piece is 0 but for rounding.
const VERTICAL: f64 = 1e-13;

pub fn polynomial(c: &[f64], u: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

/// The coefficients of the derivative of a cubic.
pub fn differentiated(c: &[f64; 4]) -> [f64; 4] {
    [c[1], 2.0 * c[2], 3.0 * c[3], 0.0]
}

impl Cubic {
    pub fn new(x: [f64; 4], y: [f64; 4]) -> Cubic {
        let speed = [x[1], 2.0 * x[2], 3.0 * x[3]];
        let mut area = [0.0; 6];
        for (i, a) in y.iter().enumerate() {
            for (j, b) in speed.iter().enumerate() {
                area[i + j] += a * b / (i + j + 1) as f64;
            }
        }
        // A spline through evenly spaced points is straight in x but for rounding.
        let straight = x[2].abs().max(x[3].abs()) <= 1e-14 * x[1].abs();
        Cubic { x, y, area, straight }
    }

    /// The parameter where x has a value, which lies in the piece.
    pub fn parameter(&self, x: f64) -> f64 {
        if self.straight {
            return ((x - self.x[0]) / self.x[1]).clamp(0.0, 1.0);
        }
        solve(|u| polynomial(&self.x, u) - x, |u| polynomial(&differentiated(&self.x), u))
    }

    /// x at a parameter.
    pub fn place(&self, u: f64) -> f64 {
        polynomial(&self.x, u)
    }

    pub fn value(&self, u: f64) -> f64 {
        polynomial(&self.y, u)
    }

    /// dy/du
    pub fn speed(&self, u: f64) -> f64 {
        polynomial(&differentiated(&self.y), u)
    }

    pub fn area(&self, u: f64) -> f64 {
        u * polynomial(&self.area, u)
    }

    /// A derivative by x.
    pub fn derivative(&self, part: Part, u: f64) -> f64 {
        let of = |c: &[f64; 4]| {
            let (first, second) = (differentiated(c), differentiated(&differentiated(c)));
            [polynomial(&first, u), polynomial(&second, u), 6.0 * c[3]]
        };
        let ([x1, x2, x3], [y1, y2, y3]) = (of(&self.x), of(&self.y));
        match part {
            Part::Slope => y1 / x1,
            Part::Second if self.straight => y2 / (x1 * x1),
            Part::Third if self.straight => y3 / (x1 * x1 * x1),
            Part::Second => (y2 * x1 - y1 * x2) / (x1 * x1 * x1),
            Part::Third => {
                let bend = y2 * x1 - y1 * x2;
                ((y3 * x1 - y1 * x3) * x1 - 3.0 * x2 * bend) / x1.powi(5)
            }
            _ => 0.0,
        }
    }

    /// A part, beyond the ends of the piece too: the cubic goes on, or where x is not linear its Taylor polynomial at
    /// the end. The integral counts from the beginning of the piece.
    pub fn continued(&self, part: Part, x: f64) -> f64 {
        let own = |u: f64| match part {
            Part::Value => self.value(u),
            Part::Integral => self.area(u),
            part => self.derivative(part, u),
        };
        if self.straight {
            return own((x - self.x[0]) / self.x[1]);
        }
        let (from, to) = (self.place(0.0), self.place(1.0));
        if (from..=to).contains(&x) {
            return own(self.parameter(x));
        }
        let (u, end) = if x < from { (0.0, from) } else { (1.0, to) };
        let [y, y1, y2, y3] = self.taylor(u);
        let d = x - end;
        match part {
            Part::Value => polynomial(&[y, y1, y2 / 2.0, y3 / 6.0], d),
            Part::Integral => self.area(u) + d * polynomial(&[y, y1 / 2.0, y2 / 6.0, y3 / 24.0], d),
            Part::Slope => polynomial(&[y1, y2, y3 / 2.0], d),
            Part::Second => y2 + y3 * d,
            Part::Third => y3,
            _ => 0.0,
        }
    }

    /// Value and derivatives by x. Where the curve is vertical, as at the end of a spline with two control points at one
    /// x, the derivatives are given as 0: a continuation beyond the end is flat.
    pub fn taylor(&self, u: f64) -> [f64; 4] {
        if polynomial(&differentiated(&self.x), u) <= VERTICAL * (self.place(1.0) - self.place(0.0)) {
            return [self.value(u), 0.0, 0.0, 0.0];
        }
        let [first, second, third] =
            [Part::Slope, Part::Second, Part::Third].map(|part| self.derivative(part, u));
        [self.value(u), first, second, third]
    }
}

/// The least u from 0 to 1 at which an increasing function is not negative any more: Newton's method kept between
/// bounds that close in.
pub fn solve(f: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> f64 {
    let (mut lo, mut hi) = (0.0, 1.0);
    if f(lo) >= 0.0 {
        return lo;
    }
    let mut u = 0.5;
    for _ in 0..80 {
        let value = f(u);
        if value >= 0.0 {
            hi = u
        } else {
            lo = u
        }
        if hi - lo <= f64::EPSILON * hi {
            break;
        }
        let next = u - value / slope(u);
        // A step that leaves the bracket, or is no number, halves it.
        let next = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        if (next - u).abs() <= 0.5 * f64::EPSILON * u {
            return next;
        }
        u = next;
    }
    hi
}
