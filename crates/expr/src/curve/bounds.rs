//! Bounds of curves over stretches of their argument.

use super::piece::{Cubic, differentiated, polynomial};
use super::{Curve, Part, Place};
use crate::{Array, Binary, Interval, Value};

/// Over more pieces than this the bounds are those of the whole curve; the caller halves the stretch for better ones.
const MANY: usize = 64;

/// Least and greatest value of a cubic between two arguments.
pub fn cubic(c: &[f64; 4], from: f64, to: f64) -> (f64, f64) {
    let (a, b) = (polynomial(c, from), polynomial(c, to));
    let (mut lo, mut hi) = (a.min(b), a.max(b));
    // Extremes: c_1 + 2 c_2 u + 3 c_3 u² = 0.
    let (p, q, r) = (3.0 * c[3], 2.0 * c[2], c[1]);
    let root = (q * q - 4.0 * p * r).max(0.0).sqrt();
    let large = -0.5 * (q + root.copysign(q));
    for u in [large / p, r / large] {
        if u > from && u < to {
            let value = polynomial(c, u);
            (lo, hi) = (lo.min(value), hi.max(value));
        }
    }
    (lo, hi)
}

fn over_cubic(c: &[f64; 4], from: f64, to: f64) -> Interval {
    let (lo, hi) = cubic(c, from, to);
    Interval { lo, hi, partial: false }
}

impl Cubic {
    /// A derivative, or the value, between two parameters.
    fn over(&self, part: Part, from: f64, to: f64) -> Interval {
        let op = Interval::binary;
        let (y, first) = (&self.y, differentiated(&self.y));
        let second = differentiated(&first);
        if part == Part::Value {
            return over_cubic(y, from, to);
        }
        let num = Interval::constant;
        if self.straight {
            let w = self.x[1];
            return match part {
                Part::Slope => op(Binary::Div, over_cubic(&first, from, to), num(w)),
                Part::Second => op(Binary::Div, over_cubic(&second, from, to), num(w * w)),
                _ => num(self.derivative(part, from)),
            };
        }
        let speed = differentiated(&self.x);
        let [x1, x2] = [speed, differentiated(&speed)].map(|c| over_cubic(&c, from, to));
        let [y1, y2] = [first, second].map(|c| over_cubic(&c, from, to));
        let (x3, y3) = (num(6.0 * self.x[3]), num(6.0 * y[3]));
        let mul = |a, b| op(Binary::Mul, a, b);
        let bend = op(Binary::Sub, mul(y2, x1), mul(y1, x2));
        match part {
            Part::Slope => op(Binary::Div, y1, x1),
            Part::Second => op(Binary::Div, bend, mul(x1, mul(x1, x1))),
            _ => {
                let turn = mul(op(Binary::Sub, mul(y3, x1), mul(y1, x3)), x1);
                let rest = mul(num(3.0), mul(x2, bend));
                let square = mul(x1, x1);
                op(Binary::Div, op(Binary::Sub, turn, rest), mul(x1, mul(square, square)))
            }
        }
    }
}

impl Curve {
    /// Bounds of a part over a set of arguments.
    pub fn over(&self, part: Part, x: Interval) -> Interval {
        if x.is_empty() {
            return Interval::EMPTY;
        }
        let at = |x: f64| self.eval(part, x);
        let flag = |bound: Interval| Interval { partial: bound.partial || x.partial, ..bound };
        match part {
            Part::Phase => return flag(Interval { lo: at(x.lo), hi: at(x.hi), partial: false }),
            Part::Inverse => return flag(self.inverse_over(x)),
            Part::Integral => return flag(self.integral_over(x)),
            _ => {}
        }
        if !x.lo.is_finite() || !x.hi.is_finite() || x.hi - x.lo >= f64::MAX {
            return flag(self.whole(part));
        }
        let count = self.pieces.len();
        let number = |place: &Place, turns: f64| match place {
            Place::Before => -1.0,
            Place::After => count as f64,
            Place::In(index, _) => turns * count as f64 + *index as f64,
        };
        let [first, last] = [x.lo, x.hi].map(|x| {
            let place = self.place(x);
            let turns = if let Place::In(_, turns) = place { turns } else { 0.0 };
            number(&place, turns)
        });
        if last - first > MANY as f64 {
            return flag(self.whole(part));
        }
        let mut bound: Option<Interval> = None;
        let mut index = first;
        while index <= last {
            let next = self.over_piece(part, index, x);
            bound = Some(match bound {
                Some(b) => Interval { lo: b.lo.min(next.lo), hi: b.hi.max(next.hi), partial: false },
                None => next,
            });
            index += 1.0;
        }
        let bound = bound.unwrap_or(Interval::ENTIRE);
        flag(Interval { partial: first != last && self.jumps_between(part, first, last), ..bound })
    }

    fn jumps_between(&self, part: Part, first: f64, last: f64) -> bool {
        // Within a curve that is no polygon slopes do not jump, only at its ends.
        if part == Part::Value {
            let count = self.pieces.len() as f64;
            return self.breaks.iter().any(|at| {
                // The first time that this piece begins beyond `first`.
                let turns = if self.periodic { ((first - *at as f64) / count).floor() + 1.0 } else { 0.0 };
                let begins = *at as f64 + turns * count;
                first < begins && begins <= last
            });
        }
        let inside = first >= 0.0 && last < self.pieces.len() as f64;
        let smooth = part == Part::Slope
            && self.sort != super::Sort::Linear
            && self.breaks.is_empty()
            && (self.periodic || inside);
        self.jumps(part) && !smooth
    }

    /// The part of a piece that lies in a set.
    fn over_piece(&self, part: Part, index: f64, x: Interval) -> Interval {
        let count = self.pieces.len() as f64;
        if !self.periodic && !(0.0..count).contains(&index) {
            let edge = if index < 0.0 { x.hi.min(self.knots[0]) } else { x.lo.max(self.domain().1) };
            let far = if index < 0.0 { x.lo } else { x.hi };
            return Interval::spanned(self.eval(part, edge), self.eval(part, far));
        }
        let turns = if self.periodic { (index / count).floor() } else { 0.0 };
        let index = (index - turns * count) as usize;
        let piece = &self.pieces[index];
        if part == Part::PhaseSlope {
            return Interval::constant(1.0 / (self.knots[index + 1] - self.knots[index]));
        }
        let [from, to] = [x.lo, x.hi].map(|x| {
            let x = (x - turns * self.period()).clamp(self.knots[index], self.knots[index + 1]);
            piece.parameter(x)
        });
        // The parameter itself is rounded.
        let slack = if piece.straight { 0.0 } else { 4.0 * f64::EPSILON };
        piece.over(part, (from - slack).max(0.0), (to + slack).min(1.0))
    }

    /// Bounds of a part over everything.
    fn whole(&self, part: Part) -> Interval {
        match part {
            Part::Value => Interval { lo: self.range.0, hi: self.range.1, partial: self.jumps(part) },
            _ if self.pieces.len() > MANY => Interval::ENTIRE,
            _ => {
                let hull = |a: Interval, b: Interval| Interval {
                    lo: a.lo.min(b.lo),
                    hi: a.hi.max(b.hi),
                    partial: true,
                };
                let own = self.pieces.iter().enumerate().map(|(i, piece)| match part {
                    Part::PhaseSlope => Interval::constant(1.0 / (self.knots[i + 1] - self.knots[i])),
                    part => piece.over(part, 0.0, 1.0),
                });
                // Beyond the ends all of them vanish, or nearly so.
                own.fold(Interval::constant(0.0), hull)
            }
        }
    }

    fn integral_over(&self, x: Interval) -> Interval {
        let (a, b) = (self.eval(Part::Integral, x.lo), self.eval(Part::Integral, x.hi));
        let values = self.over(Part::Value, x);
        if values.lo >= 0.0 || values.hi <= 0.0 {
            return Interval::spanned(a, b);
        }
        let (middle, reach) = (0.5 * (x.lo + x.hi), 0.5 * (x.hi - x.lo) * values.magnitude());
        let centre = self.eval(Part::Integral, middle);
        if !centre.is_finite() || !reach.is_finite() {
            return Interval::ENTIRE;
        }
        Interval { lo: centre - reach, hi: centre + reach, partial: false }
    }

    fn inverse_over(&self, y: Interval) -> Interval {
        let (lo, hi) = self.range;
        if self.direction.is_none() || y.hi < lo || y.lo > hi {
            return Interval::EMPTY;
        }
        let ends = [y.lo.max(lo), y.hi.min(hi)].map(|y| self.eval(Part::Inverse, y));
        Interval { partial: y.lo < lo || y.hi > hi, ..Interval::spanned(ends[0], ends[1]) }
    }

    /// Bounds of [`Curve::continued`].
    pub fn continued_over(&self, part: Part, index: Interval, x: Interval) -> Interval {
        if x.is_empty() || index.is_empty() {
            return Interval::EMPTY;
        }
        if index.lo != index.hi {
            return Interval::ENTIRE;
        }
        let count = self.pieces.len() as f64;
        let partial = x.partial || index.partial;
        let beyond = !self.periodic && !(0.0..count).contains(&index.lo);
        let turns = (index.lo / count).floor();
        let local = if beyond { 0 } else { (index.lo - turns * count) as usize };
        let piece = &self.pieces[local];
        if beyond || part == Part::Integral {
            // Constant and linear, or rare: by the ends and the mean value theorem.
            let at = |x: f64| self.continued(part, index.lo, x);
            let Some(rate) = part.derivative().filter(|_| part == Part::Integral) else {
                return Interval { partial, ..Interval::spanned(at(x.lo), at(x.hi)) };
            };
            let rate = self.continued_over(rate, index, x).magnitude();
            let (middle, reach) = (at(0.5 * (x.lo + x.hi)), 0.5 * (x.hi - x.lo) * rate);
            return Interval { lo: middle - reach, hi: middle + reach, partial };
        }
        let shift = if self.periodic { turns * self.period() } else { 0.0 };
        let (from, to) = (x.lo - shift, x.hi - shift);
        let own = if piece.straight {
            let [u, v] = [from, to].map(|x| (x - piece.x[0]) / piece.x[1]);
            piece.over(part, u, v)
        } else {
            piece.taylor_over(part, from, to)
        };
        Interval { partial: partial || own.partial, ..own }
    }
}

impl Cubic {
    /// A piece that is not straight, with its Taylor polynomials at both ends.
    fn taylor_over(&self, part: Part, from: f64, to: f64) -> Interval {
        let (start, end) = (self.place(0.0), self.place(1.0));
        let mut bounds: Vec<Interval> = Vec::new();
        if from < end && to > start {
            let [u, v] = [from, to].map(|x| self.parameter(x.clamp(start, end)));
            bounds.push(self.over(part, u, v));
        }
        for (u, at, a, b) in [(0.0, start, from, to.min(start)), (1.0, end, from.max(end), to)] {
            if a <= b {
                let [y, y1, y2, y3] = self.taylor(u);
                let c = match part {
                    Part::Value => [y, y1, y2 / 2.0, y3 / 6.0],
                    Part::Slope => [y1, y2, y3 / 2.0, 0.0],
                    Part::Second => [y2, y3, 0.0, 0.0],
                    _ => [y3, 0.0, 0.0, 0.0],
                };
                bounds.push(over_cubic(&c, a - at, b - at));
            }
        }
        bounds
            .into_iter()
            .reduce(|a, b| Interval { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi), partial: false })
            .unwrap_or(Interval::ENTIRE)
    }
}

impl Array {
    /// Bounds of an element.
    pub fn over(&self, index: Interval) -> Interval {
        let count = self.values.len() as f64;
        let (first, last) = (index.lo.floor(), index.hi.floor());
        if index.is_empty() || last < 0.0 || first >= count {
            return Interval::EMPTY;
        }
        let inside = first.max(0.0) as usize..=last.min(count - 1.0) as usize;
        let values = &self.values[inside];
        let lo = values.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Interval { lo, hi, partial: index.partial || first < 0.0 || last >= count || first != last }
    }
}
