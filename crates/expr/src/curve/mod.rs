//! Functions of one variable given by points: linear between them, monotone cubics through them, B-splines over them.
//!
//! A [`Curve`] is a list of pieces, each a cubic in a parameter u from 0 to 1; so its integral and its derivatives are
//! polynomials of each piece, known without approximation. Beyond its ends a curve keeps the value it has there, or it
//! is periodic. Between two pieces its value may jump; at the jump it has the second value. `curve/bounds.rs` has the
//! same for intervals.

mod bounds;
mod build;
mod piece;

pub use build::MAX_POINTS;
use piece::Cubic;

/// How a curve follows its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    /// Straight from point to point.
    Linear,
    /// Cubics through the points, monotone wherever the points are (Fritsch and Carlson 1980).
    Monotone,
    /// The uniform cubic B-spline whose control points these are, with its ends on the first and the last of them.
    Spline,
}

/// A function that is computed from a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// The value.
    Value,
    /// First derivative.
    Slope,
    /// Second derivative.
    Second,
    /// Third derivative.
    Third,
    /// Integral from the first knot.
    Integral,
    /// Where a strictly monotone curve has a value; NaN for one that it does not have.
    Inverse,
    /// The number of the piece, and how far in it, increasing without bound or jump.
    Phase,
    /// Derivative of the phase by the argument.
    PhaseSlope,
}

impl Part {
    /// The derivative of a part, if it is another part; that of the others is taken as zero.
    pub fn derivative(self) -> Option<Part> {
        match self {
            Part::Value => Some(Part::Slope),
            Part::Slope => Some(Part::Second),
            Part::Second => Some(Part::Third),
            Part::Integral => Some(Part::Value),
            Part::Phase => Some(Part::PhaseSlope),
            Part::Third | Part::Inverse | Part::PhaseSlope => None,
        }
    }
}

/// A function of one variable by points.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the model, for messages.
    pub name: String,
    /// How it follows its points.
    pub sort: Sort,
    /// Whether it repeats beyond its ends; otherwise it keeps the values that it has there.
    pub periodic: bool,
    /// Number of points that it was made from.
    pub points: usize,
    /// Where pieces begin, and the last one ends; ascending.
    knots: Vec<f64>,
    pieces: Vec<Cubic>,
    /// The pieces, by number, at whose beginning the value jumps; ascending.
    breaks: Vec<usize>,
    /// Integral from the first knot to each.
    sums: Vec<f64>,
    /// Least and greatest value.
    range: (f64, f64),
    /// +1 or -1 if it is strictly monotone between its ends.
    direction: Option<f64>,
}

/// Where an argument lies.
enum Place {
    Before,
    After,
    /// In a piece, and how many periods away.
    In(usize, f64),
}

impl Curve {
    /// The first knot and the last.
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[0], self.knots[self.pieces.len()])
    }

    /// Least and greatest value.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// +1 if it increases strictly from its first knot to its last, -1 if it decreases so.
    pub fn direction(&self) -> Option<f64> {
        self.direction
    }

    /// True if a part never changes its sign.
    pub fn keeps_sign(&self, part: Part) -> bool {
        match part {
            Part::Value => self.range.0 >= 0.0 || self.range.1 <= 0.0,
            Part::Slope => self.direction.is_some(),
            _ => false,
        }
    }

    /// True if a part jumps at knots.
    pub fn jumps(&self, part: Part) -> bool {
        match part {
            Part::Value => !self.breaks.is_empty(),
            Part::Integral | Part::Phase | Part::Inverse => false,
            // At the ends of the others there may be a kink, too.
            Part::Slope => self.sort == Sort::Linear || !self.periodic || !self.breaks.is_empty(),
            Part::Second | Part::Third | Part::PhaseSlope => true,
        }
    }

    fn period(&self) -> f64 {
        self.knots[self.pieces.len()] - self.knots[0]
    }

    fn total(&self) -> f64 {
        self.sums[self.pieces.len()]
    }

    fn end_values(&self) -> (f64, f64) {
        (self.pieces[0].value(0.0), self.pieces[self.pieces.len() - 1].value(1.0))
    }

    fn place(&self, x: f64) -> Place {
        let last = self.pieces.len();
        let (first, end) = (self.knots[0], self.knots[last]);
        let turns = if self.periodic { ((x - first) / self.period()).floor() } else { 0.0 };
        let x = x - turns * self.period();
        if self.periodic {
            let index = self.knots[1..last].partition_point(|k| *k <= x);
            return Place::In(index, turns);
        }
        match () {
            () if x < first => Place::Before,
            () if x >= end => Place::After,
            () => Place::In(self.knots[1..last].partition_point(|k| *k <= x), 0.0),
        }
    }

    /// A part at a place; NaN for an argument that is none.
    pub fn eval(&self, part: Part, x: f64) -> f64 {
        if x.is_nan() || (self.periodic && x.is_infinite()) {
            return f64::NAN;
        }
        let last = self.pieces.len();
        if part == Part::Inverse {
            return self.inverse(x);
        }
        let (low, high) = self.end_values();
        match self.place(x) {
            Place::In(index, turns) => {
                let piece = &self.pieces[index];
                let u = piece.parameter(x - turns * self.period());
                match part {
                    Part::Integral => turns * self.total() + (self.sums[index] + piece.area(u)),
                    Part::Phase => turns * last as f64 + (index as f64 + self.fraction(index, x, turns)),
                    Part::PhaseSlope => 1.0 / (self.knots[index + 1] - self.knots[index]),
                    Part::Value => piece.value(u),
                    derivative => piece.derivative(derivative, u),
                }
            }
            Place::Before => {
                let width = self.knots[1] - self.knots[0];
                let away = self.knots[0] - x;
                match part {
                    Part::Value => low,
                    // Not 0 · ∞ for a curve that begins at zero.
                    Part::Integral if low == 0.0 => 0.0,
                    Part::Integral => -low * away,
                    Part::Phase => -away.min(f64::MAX) / (width + away.min(f64::MAX)),
                    Part::PhaseSlope => width / ((width + away) * (width + away)),
                    _ => 0.0,
                }
            }
            Place::After => {
                let width = self.knots[last] - self.knots[last - 1];
                let away = x - self.knots[last];
                match part {
                    Part::Value => high,
                    Part::Integral if high == 0.0 => self.total(),
                    Part::Integral => self.total() + high * away,
                    Part::Phase => last as f64 + away.min(f64::MAX) / (width + away.min(f64::MAX)),
                    Part::PhaseSlope => width / ((width + away) * (width + away)),
                    _ => 0.0,
                }
            }
        }
    }

    /// How far in a piece, in parts of its width.
    fn fraction(&self, index: usize, x: f64, turns: f64) -> f64 {
        let (from, to) = (self.knots[index], self.knots[index + 1]);
        // Rounding must not carry it over into the next.
        ((x - turns * self.period() - from) / (to - from)).clamp(0.0, 1.0)
    }

    /// A part of one piece, continued beyond its knots as if it were the whole curve. `index` counts pieces as
    /// [`Part::Phase`] does; -1 and the number of pieces stand for what lies beyond the ends.
    pub fn continued(&self, part: Part, index: f64, x: f64) -> f64 {
        let count = self.pieces.len() as f64;
        if x.is_nan() || index.is_nan() {
            return f64::NAN;
        }
        let turns = if self.periodic { (index / count).floor() } else { 0.0 };
        let local = index - turns * count;
        if !self.periodic && (local < 0.0 || local >= count) {
            let (low, high) = self.end_values();
            let ends = [(low, self.knots[0], 0.0), (high, self.knots[self.pieces.len()], self.total())];
            let (value, end, sum) = ends[usize::from(local >= 0.0)];
            return match part {
                Part::Value => value,
                Part::Integral => sum + value * (x - end),
                _ => 0.0,
            };
        }
        let index = (local as usize).min(self.pieces.len() - 1);
        let piece = &self.pieces[index];
        let x = x - turns * self.period();
        match part {
            Part::Integral => turns * self.total() + (self.sums[index] + piece.continued(part, x)),
            part => piece.continued(part, x),
        }
    }

    fn inverse(&self, y: f64) -> f64 {
        let Some(direction) = self.direction else { return f64::NAN };
        let last = self.pieces.len();
        let at = |i: usize| if i == last { self.end_values().1 } else { self.pieces[i].value(0.0) };
        let (low, high) = (at(0), at(last));
        if (y - low) * direction < 0.0 || (y - high) * direction > 0.0 {
            return f64::NAN;
        }
        if y == high {
            return self.knots[last];
        }
        // The last piece that begins at the value or before it.
        let (mut a, mut b) = (0, last);
        while b - a > 1 {
            let middle = usize::midpoint(a, b);
            if (at(middle) - y) * direction <= 0.0 { a = middle } else { b = middle }
        }
        let piece = &self.pieces[a];
        let u = piece::solve(|u| (piece.value(u) - y) * direction, |u| piece.speed(u) * direction);
        piece.place(u).clamp(self.knots[a], self.knots[a + 1])
    }
}

/// A list of numbers that expressions look up by number.
#[derive(Clone, Debug)]
pub struct Array {
    /// Name in the model, for messages.
    pub name: String,
    /// The elements, from number 0.
    pub values: Vec<f64>,
}

impl Array {
    /// The element with a number, counted from 0 and rounded down to a whole one; NaN if there is none.
    pub fn element(&self, index: f64) -> f64 {
        let index = index.floor();
        if index >= 0.0 && index < self.values.len() as f64 { self.values[index as usize] } else { f64::NAN }
    }
}

#[cfg(test)]
mod tests;
