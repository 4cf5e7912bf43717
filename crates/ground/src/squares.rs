//! Weights of rows of squares: how much the triangles of each move along its edges, from the differences of height along these.
//!
//! A fast test of a row finds the part of it that has steep squares; what is beside that has no weights.

use std::ops::Range;

use crate::kernel::{Law, larger, smaller};

/// Squares in the longest row.
const LONGEST: usize = 64;

/// Weights of a row of squares from the differences along their edges (x at the lower z, x at the higher, z at the lower x, z at the higher). Whether
/// any is not 0.
#[inline(always)]
pub(crate) fn squares(law: &Law, e: [&[f64]; 4], weights: [&mut [f64]; 4]) -> bool {
    let n = weights[0].len();
    let most = (law.slope * law.rest) * (law.slope * law.rest);
    let Some(steep) = steep_part(n, e, most) else {
        weights.into_iter().for_each(|weights| weights.fill(0.0));
        return false;
    };
    let [low, high, left, right] = part_of(weights, &steep);
    let [b, t, l, s] = e.map(|e| &e[steep.clone()]);
    let (tau, part) = (law.tau, law.tau * law.slope);
    for c in 0..low.len() {
        let (b, t, l, s) = (b[c] * b[c], t[c] * t[c], l[c] * l[c], s[c] * s[c]);
        let [bl, bs, tl, ts] = self::weights([b + l, b + s, t + l, t + s], [most; 4], tau, [part; 4]);
        low[c] = bl + bs;
        high[c] = tl + ts;
        left[c] = bl + tl;
        right[c] = bs + ts;
    }
    true
}

/// From the first to the last of n squares with a triangle that is steeper than the least that stands there, as squares of differences.
#[inline(always)]
fn steep_part(n: usize, e: [&[f64]; 4], least: f64) -> Option<Range<usize>> {
    let [b, t, l, s] = e.map(|e| &e[..n]);
    let mut steep = [0_u64; LONGEST];
    let steep = &mut steep[..n];
    for c in 0..n {
        let (b, t, l, s) = (b[c] * b[c], t[c] * t[c], l[c] * l[c], s[c] * s[c]);
        steep[c] = u64::from(larger(b, t) + larger(l, s) > least);
    }
    let first = steep.iter().position(|steep| *steep != 0)?;
    let last = steep.iter().rposition(|steep| *steep != 0)?;
    Some(first..last + 1)
}

/// The weights of a part of a row; those beside it are 0.
#[inline(always)]
fn part_of<'a>(weights: [&'a mut [f64]; 4], part: &Range<usize>) -> [&'a mut [f64]; 4] {
    weights.map(|weights| {
        weights[..part.start].fill(0.0);
        weights[part.end..].fill(0.0);
        &mut weights[part.clone()]
    })
}

/// Weights τ - τk/|e| of the four triangles of a square from the squares of |e|, 0 where these are not above the most that stands.
///
/// One division serves for four: its results are the products of the others. Pairs of opposite triangles stay pairs in each mirror image of the square, so
/// the rounding is the same in these.
#[inline(always)]
fn weights([bl, bs, tl, ts]: [f64; 4], most: [f64; 4], tau: f64, part: [f64; 4]) -> [f64; 4] {
    let length = |square: f64, most: f64| larger(square, most).sqrt();
    let [a, b, c, d] = [length(bl, most[0]), length(bs, most[1]), length(tl, most[2]), length(ts, most[3])];
    let (p, q) = (a * d, b * c);
    let inverse = 1.0 / (p * q);
    let (of_p, of_q) = (q * inverse, p * inverse);
    let weight = |square: f64, most: f64, part: f64, inverse: f64| {
        let weight = tau - part * inverse;
        if square > most { weight } else { 0.0 }
    };
    [
        weight(bl, most[0], part[0], d * of_p),
        weight(bs, most[1], part[1], c * of_q),
        weight(tl, most[2], part[2], b * of_q),
        weight(ts, most[3], part[3], a * of_p),
    ]
}

/// As [`squares`], with slopes and ratios of columns, of which no slope is less than `least`. A triangle has the largest slope and the smallest ratio of its columns.
#[inline(always)]
pub(crate) fn varied_squares(
    (law, least): (&Law, f64),
    e: [&[f64]; 4],
    slopes: [&[f64]; 2],
    ratios: [&[f64]; 2],
    weights: [&mut [f64]; 4],
) -> bool {
    let n = weights[0].len();
    // No column has a smaller ratio.
    let most = (least * law.rest) * (least * law.rest);
    let Some(part) = steep_part(n, e, most) else {
        weights.into_iter().for_each(|weights| weights.fill(0.0));
        return false;
    };
    let [low, high, left, right] = part_of(weights, &part);
    let [b, t, l, s] = e.map(|e| &e[part.clone()]);
    let n = low.len();
    let corners = part.start..part.end + 1;
    let [k0, k1, q0, q1] =
        [slopes[0], slopes[1], ratios[0], ratios[1]].map(|row| &row[corners.clone()][..n + 1]);
    let tau = law.tau;
    let mut steep = 0;
    for c in 0..n {
        let (b, t, l, s) = (b[c] * b[c], t[c] * t[c], l[c] * l[c], s[c] * s[c]);
        let (kb, kt) = (larger(k0[c], k0[c + 1]), larger(k1[c], k1[c + 1]));
        let (qb, qt) = (smaller(q0[c], q0[c + 1]), smaller(q1[c], q1[c + 1]));
        let slopes = [larger(kb, k1[c]), larger(kb, k1[c + 1]), larger(kt, k0[c]), larger(kt, k0[c + 1])];
        let ratios = [smaller(qb, q1[c]), smaller(qb, q1[c + 1]), smaller(qt, q0[c]), smaller(qt, q0[c + 1])];
        let most = |n: usize| (slopes[n] * ratios[n]) * (slopes[n] * ratios[n]);
        let most = [most(0), most(1), most(2), most(3)];
        let parts = [tau * slopes[0], tau * slopes[1], tau * slopes[2], tau * slopes[3]];
        let [bl, bs, tl, ts] = self::weights([b + l, b + s, t + l, t + s], most, tau, parts);
        low[c] = bl + bs;
        high[c] = tl + ts;
        left[c] = bl + tl;
        right[c] = bs + ts;
        steep |= u64::from((bl + bs) + (tl + ts) > 0.0);
    }
    steep != 0
}
