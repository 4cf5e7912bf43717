//! Construction of curves from their points: polygons, monotone cubics, B-splines.

use super::piece::Cubic;
use super::{Curve, Sort};
use crate::Error;

/// Most points of one curve.
pub const MAX_POINTS: usize = 1_000_000;

impl Curve {
    /// The curve of a sort by points. A periodic one ends on the value with which it begins. Two points with the same
    /// argument are a jump, at which the curve has the second value; among the control points of a spline they are a
    /// corner, and four of them a jump.
    ///
    /// # Errors
    ///
    /// There are too few points or too many, they descend or do not close, a jump stands at an end or has more than two
    /// points, or the numbers are too large.
    pub fn new(
        name: impl Into<String>,
        sort: Sort,
        points: &[[f64; 2]],
        periodic: bool,
    ) -> Result<Curve, Error> {
        let least = match (sort, periodic) {
            (Sort::Spline, false) => 4,
            (_, true) => 3,
            _ => 2,
        };
        if points.len() < least {
            return Err(Error::TooFew(least));
        }
        if points.len() > MAX_POINTS {
            return Err(Error::TooMany);
        }
        check_order(sort, points)?;
        let (first, last) = (points[0][1], points[points.len() - 1][1]);
        if periodic && first != last {
            return Err(Error::NotClosed { first, last });
        }
        let (pieces, breaks) = match sort {
            Sort::Spline => without_gaps(spline(points, periodic)),
            _ => through(sort, points, periodic),
        };
        let Some(first) = pieces.first() else { return Err(Error::TooFew(least)) };
        let mut knots = vec![first.place(0.0)];
        let mut sums = vec![0.0];
        // The points themselves, where the curve goes through them.
        let mut ends = points.windows(2).filter(|pair| pair[0][0] < pair[1][0]).map(|pair| pair[1][0]);
        for (i, piece) in pieces.iter().enumerate() {
            let end = ends.next().filter(|_| sort != Sort::Spline);
            knots.push(end.unwrap_or_else(|| piece.place(1.0)));
            sums.push(sums[i] + piece.area(1.0));
        }
        let sound = sums.iter().all(|x| x.is_finite())
            && knots.windows(2).all(|k| k[0] < k[1])
            && pieces.iter().all(|p| p.taylor(0.5).iter().all(|x| x.is_finite()));
        if !sound {
            return Err(Error::TooLarge);
        }
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for piece in &pieces {
            let (lo, hi) = super::bounds::cubic(&piece.y, 0.0, 1.0);
            range = (range.0.min(lo), range.1.max(hi));
        }
        let along = |sign: f64| points.windows(2).all(|pair| (pair[1][1] - pair[0][1]) * sign > 0.0);
        let direction = [1.0, -1.0].into_iter().find(|sign| along(*sign));
        let points = points.len();
        let name = name.into();
        Ok(Curve { name, sort, periodic, points, knots, pieces, breaks, sums, range, direction })
    }
}

/// Checks that the points ascend, and that a jump has two points and stands between others.
fn check_order(sort: Sort, points: &[[f64; 2]]) -> Result<(), Error> {
    if let Some(i) = points.windows(2).position(|pair| pair[1][0] < pair[0][0]) {
        return Err(Error::NotAscending(i + 1));
    }
    if sort == Sort::Spline {
        return Ok(());
    }
    let last = points.len() - 1;
    let jumps: Vec<usize> = (1..=last).filter(|i| points[i - 1][0] == points[*i][0]).collect();
    if let Some(pair) = jumps.windows(2).find(|pair| pair[0] + 1 == pair[1]) {
        return Err(Error::Crowded(pair[1]));
    }
    match jumps.iter().find(|i| **i == 1 || **i == last) {
        Some(i) => Err(Error::JumpAtEnd(*i)),
        None => Ok(()),
    }
}

/// The pieces of a curve through its points, and the numbers of those that begin with a jump.
fn through(sort: Sort, points: &[[f64; 2]], periodic: bool) -> (Vec<Cubic>, Vec<usize>) {
    let (mut pieces, mut breaks) = (Vec::new(), Vec::new());
    for run in points.chunk_by(|a, b| a[0] < b[0]) {
        if !pieces.is_empty() {
            breaks.push(pieces.len());
        }
        pieces.extend(match sort {
            Sort::Linear => linear(run),
            // A seam is smooth if the curve has no jump.
            _ => monotone(run, periodic && run.len() == points.len()),
        });
    }
    (pieces, breaks)
}

/// The pieces of a spline without those of no width, and the numbers of the pieces before which one was.
fn without_gaps(all: Vec<Cubic>) -> (Vec<Cubic>, Vec<usize>) {
    let (mut pieces, mut breaks) = (Vec::with_capacity(all.len()), Vec::new());
    for piece in all {
        if piece.place(0.0) < piece.place(1.0) {
            pieces.push(piece);
        } else {
            breaks.push(pieces.len());
        }
    }
    breaks.dedup();
    breaks.retain(|at| *at > 0 && *at < pieces.len());
    (pieces, breaks)
}

fn linear(points: &[[f64; 2]]) -> Vec<Cubic> {
    let piece = |pair: &[[f64; 2]]| {
        let ([a, p], [b, q]) = (pair[0], pair[1]);
        Cubic::new([a, b - a, 0.0, 0.0], [p, q - p, 0.0, 0.0])
    };
    points.windows(2).map(piece).collect()
}

/// Fritsch and Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17 (1980): tangents are means of
/// the slopes on both sides, zero at extremes, and cut back to the circle of radius 3 where they would overshoot.
fn monotone(points: &[[f64; 2]], periodic: bool) -> Vec<Cubic> {
    let n = points.len() - 1;
    let width: Vec<f64> = points.windows(2).map(|p| p[1][0] - p[0][0]).collect();
    let slope: Vec<f64> = points.windows(2).zip(&width).map(|(p, w)| (p[1][1] - p[0][1]) / w).collect();
    let mean = |a: f64, b: f64| if a * b <= 0.0 { 0.0 } else { 0.5 * (a + b) };
    let mut tangent: Vec<f64> = (0..=n)
        .map(|i| match i {
            _ if periodic && (i == 0 || i == n) => mean(slope[n - 1], slope[0]),
            0 => slope[0],
            _ if i == n => slope[n - 1],
            _ => mean(slope[i - 1], slope[i]),
        })
        .collect();
    for i in 0..n {
        if slope[i] == 0.0 {
            (tangent[i], tangent[i + 1]) = (0.0, 0.0);
            continue;
        }
        let (a, b) = (tangent[i] / slope[i], tangent[i + 1] / slope[i]);
        let length = a.hypot(b);
        if length > 3.0 {
            tangent[i] = 3.0 / length * a * slope[i];
            tangent[i + 1] = 3.0 / length * b * slope[i];
        }
    }
    if periodic {
        // The seam is one point: cutting back a tangent never hurts monotony.
        let least = if tangent[0].abs() < tangent[n].abs() { tangent[0] } else { tangent[n] };
        (tangent[0], tangent[n]) = (least, least);
    }
    (0..n)
        .map(|i| {
            let ([x, p], [_, q]) = (points[i], points[i + 1]);
            let (a, b) = (tangent[i] * width[i], tangent[i + 1] * width[i]);
            let rise = q - p;
            Cubic::new([x, width[i], 0.0, 0.0], [p, a, 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise])
        })
        .collect()
}

/// The uniform cubic B-spline in the plane. With ends its knots are 0, 0, 0, 0, 1, 2, …, n, n, n, n, so that it begins on
/// the first control point and ends on the last; a periodic one has whole numbers throughout.
fn spline(points: &[[f64; 2]], periodic: bool) -> Vec<Cubic> {
    let distinct = points.len() - 1;
    let period = points[distinct][0] - points[0][0];
    let control = |i: i64| -> [f64; 2] {
        if !periodic {
            return points[i as usize];
        }
        let n = distinct as i64;
        let [x, y] = points[i.rem_euclid(n) as usize];
        [x + i.div_euclid(n) as f64 * period, y]
    };
    let count = if periodic { distinct } else { points.len() - 3 };
    let knot = |i: i64| {
        let at = (i - 3) as f64;
        if periodic { at } else { at.clamp(0.0, count as f64) }
    };
    (0..count)
        .map(|span| {
            let span = span as i64;
            // The value of the blossom at three knots (de Boor's algorithm with a parameter for each level).
            let blossom = |at: [f64; 3]| {
                let first = if periodic { span - 1 } else { span };
                let mut d: [[f64; 2]; 4] = std::array::from_fn(|i| control(first + i as i64));
                for (level, t) in at.into_iter().enumerate() {
                    for i in (level + 1..4).rev() {
                        let (a, b) = (knot(span + i as i64), knot(span + i as i64 + 3 - level as i64));
                        let part = (t - a) / (b - a);
                        d[i] = std::array::from_fn(|k| d[i - 1][k] + part * (d[i][k] - d[i - 1][k]));
                    }
                }
                d[3]
            };
            let (a, b) = (knot(span + 3), knot(span + 4));
            let corners = [[a, a, a], [a, a, b], [a, b, b], [b, b, b]].map(blossom);
            let power = |k: usize| {
                let [p, q, r, s] = corners.map(|corner| corner[k]);
                [p, 3.0 * (q - p), 3.0 * (p - 2.0 * q + r), s - p + 3.0 * (q - r)]
            };
            Cubic::new(power(0), power(1))
        })
        .collect()
}
