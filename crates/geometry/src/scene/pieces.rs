//! How many pieces the edges and the grid of a patch have, by accuracy.

use super::bernstein::{along_rows, combined, slopes, weights};
use super::patch::{Net, column};
use super::{Point, Vector};

/// Most pieces along an edge.
pub(super) const FINEST: usize = 64;
/// Parameters at which second derivatives of patches for pictures are taken: the middles of the first, the middle and the last of about four
/// pieces.
const PROBES: [f64; 3] = [0.125, 0.5, 0.875];
/// Between the probes derivatives may be larger: the part of them that is found there.
const CAUTION: f64 = 0.75;
/// What moves places within the surface changes no shape, but the places of shades: it counts with this part where the shape is all that is seen.
const WITHIN: f64 = 0.2;

/// A patch is flat if its normals are turned from the one in the middle by less than the angle with this cosine: it hardly ever hides a part of itself.
const FLAT: f64 = 0.9;
/// How much coarser than at its edges a patch is within them, where outlines are seen: no outline runs within a flat one, few do in another.
const COARSER_IN_FLAT: f64 = 3.0;
const COARSER: f64 = std::f64::consts::SQRT_2;

/// The numbers of pieces that an edge may have.
#[derive(Clone, Copy)]
pub(super) enum Steps {
    /// Powers of two: few numbers, so that the mesh of a growing patch does not change all the time. Deviations have strict bounds.
    Powers,
    /// Any, so that there are no more triangles than the accuracy asks for: for pictures. Deviations within the patch are estimated from second
    /// derivatives at a few places.
    Whole,
    /// The same where the shape is all that is seen: what moves places within the surface hardly counts.
    Shape,
    /// The same where outlines are seen: what is within the edges is coarser than these.
    Outline,
}

impl Steps {
    /// The least number of pieces whose square is at least this.
    fn pieces(self, square: f64) -> usize {
        if let Steps::Whole | Steps::Shape | Steps::Outline = self {
            return (square.sqrt().ceil() as usize).clamp(1, FINEST);
        }
        let mut n = 1;
        while n < FINEST && ((n * n) as f64) < square {
            n *= 2;
        }
        n
    }

    /// Pieces of an edge: a chord over 1/n deviates by 1/8 of the second derivative over n².
    pub(super) fn of_edge(self, edge: &[Point; 4], accuracy: f64) -> usize {
        let second = [0, 1].map(|i| edge[i].coords - 2.0 * edge[i + 1].coords + edge[i + 2].coords);
        // A cubic's second derivative is at most 6 times its second differences.
        let bend = second[0].norm().max(second[1].norm());
        self.pieces(6.0 * bend / (8.0 * accuracy))
    }

    /// Pieces along rows (from column to column) and along columns that keep the whole patch accurate, as few as will do.
    pub(super) fn of_grid(self, net: &Net, accuracy: f64) -> (usize, usize) {
        match self {
            Steps::Powers => powers(strict_derivatives(net), accuracy),
            Steps::Whole => fewest(estimated_derivatives(net, 1.0).0, accuracy),
            Steps::Shape => fewest(estimated_derivatives(net, WITHIN).0, accuracy),
            Steps::Outline => {
                let (derivatives, turn) = estimated_derivatives(net, WITHIN);
                fewest(derivatives, accuracy * if turn >= FLAT { COARSER_IN_FLAT } else { COARSER })
            }
        }
    }
}

/// The greatest second derivatives at the probes and a little more, or their bounds: along rows, mixed, along columns. Of what lies within the surface
/// a part counts. And the least cosine of the angle between the normal in the middle and another one.
fn estimated_derivatives(net: &Net, within: f64) -> ([f64; 3], f64) {
    let mut greatest = [0.0_f64; 3];
    let mut normals = [[Vector::zeros(); 3]; 3];
    let at = PROBES.map(|t| [weights(t), slopes(t), bends(t)]);
    for (of_columns, normals) in at.into_iter().zip(&mut normals) {
        // The curves of the patch, its slope and its bend at one place along its rows.
        let [values, slopes, bends] = of_columns.map(|of_columns| along_rows(net, of_columns));
        for ([values_v, slopes_v, bends_v], kept) in at.into_iter().zip(normals) {
            let second =
                [combined(&bends, values_v), combined(&slopes, slopes_v), combined(&values, bends_v)];
            let across = combined(&slopes, values_v).cross(&combined(&values, slopes_v));
            let normal = across.try_normalize(f64::MIN_POSITIVE);
            *kept = normal.unwrap_or_default();
            for (greatest, second) in greatest.iter_mut().zip(second) {
                let size = second.norm();
                let off = normal.map_or(size, |normal| normal.dot(&second).abs());
                *greatest = greatest.max(off + within * (size - off));
            }
        }
    }
    let bounds = strict_derivatives(net);
    let middle = normals[1][1];
    let turn = normals.iter().flatten().map(|normal| normal.dot(&middle)).fold(1.0, f64::min);
    ([0, 1, 2].map(|k| bounds[k].min(greatest[k] / CAUTION)), turn)
}

/// The second derivatives of Bernstein's polynomials of degree three.
fn bends(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [6.0 * s, 6.0 * t - 12.0 * s, 6.0 * s - 12.0 * t, 6.0 * t]
}

/// Bounds of the second derivatives: along rows, mixed, along columns.
fn strict_derivatives(net: &Net) -> [f64; 3] {
    let bend = |p: &[Point; 4]| {
        let second = |i: usize| (p[i].coords - 2.0 * p[i + 1].coords + p[i + 2].coords).norm();
        second(0).max(second(1))
    };
    let along = |of: &dyn Fn(usize) -> [Point; 4]| (0..4).map(|i| bend(&of(i))).fold(0.0, f64::max);
    let twist = (0..9)
        .map(|i| {
            let (r, c) = (i / 3, i % 3);
            ((net[r + 1][c + 1] - net[r + 1][c]) - (net[r][c + 1] - net[r][c])).norm()
        })
        .fold(0.0, f64::max);
    [6.0 * along(&|r| net[r]), 9.0 * twist, 6.0 * along(&|c| column(net, c))]
}

/// The fewest pieces of any number.
fn fewest([uu, uv, vv]: [f64; 3], accuracy: f64) -> (usize, usize) {
    /// Far from overflow: what is not seen may be as inaccurate as it likes.
    const COARSEST: f64 = 1e100;
    let accuracy = accuracy.min(COARSEST);
    // For each number of rows the least number of columns: where a quadratic in one over it is zero.
    let columns = |rows: usize| {
        let v = rows as f64;
        let (half, rest) = (uv / v, 8.0 * accuracy - vv / (v * v));
        let root = half + (half * half + uu * rest).sqrt();
        let columns = if root > 0.0 { root / rest } else { 1.0 };
        (rest > 0.0 && columns <= FINEST as f64).then(|| ((columns.ceil() as usize).max(1), rows))
    };
    let mut best: Option<(usize, usize)> = None;
    for rows in 1..=FINEST {
        if best.is_some_and(|(columns, best)| rows > columns * best) {
            break;
        }
        let key = |(columns, rows): (usize, usize)| (columns * rows, columns.abs_diff(rows));
        if let Some(pair) = columns(rows).filter(|pair| best.is_none_or(|best| key(*pair) < key(best))) {
            best = Some(pair);
        }
    }
    best.unwrap_or((FINEST, FINEST))
}

/// The fewest pieces that are powers of two.
fn powers([uu, uv, vv]: [f64; 3], accuracy: f64) -> (usize, usize) {
    let exponents = 0..=FINEST.trailing_zeros();
    let pairs = exponents.clone().flat_map(|i| exponents.clone().map(move |j| (1_usize << i, 1_usize << j)));
    pairs
        .filter(|&(columns, rows)| {
            let (u, v) = (columns as f64, rows as f64);
            uu / (u * u) + 2.0 * uv / (u * v) + vv / (v * v) <= 8.0 * accuracy
        })
        .min_by_key(|(columns, rows)| (columns * rows, columns.abs_diff(*rows)))
        .unwrap_or((FINEST, FINEST))
}
