//! Height spans: the parts of vertical lines through columns that are inside a closed mesh of triangles (Onoue, Nishita: *Virtual Sandbox*,
//! section 3.2).
//!
//! Points are rounded to a lattice, and triangles are scan-converted in plan with integers, so a line meets exactly one of two triangles that share an edge.

use std::ops::{Mul, RangeInclusive, Sub};

use crate::order::by_columns;
use crate::tile::QUANTA;
use crate::{Error, Vector};

/// Places of the lattice in a cell, in plan.
const LATTICE: f64 = 65_536.0;
/// The same.
pub(crate) const STEP: i64 = 65_536;
/// Products of numbers below this need no wide integers.
pub(crate) const NARROW: i64 = 1 << 30;
/// Farthest point of a body, in cells.
const FARTHEST: f64 = 2_097_152.0;

/// A point on the lattice: x and z in parts of a cell, y in quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub x: i64,
    pub z: i64,
    pub y: i64,
}

impl Place {
    /// The place of a point in m.
    pub fn new(point: &Vector, cell: f64) -> Option<Place> {
        let at = point / cell;
        // A point that is not a number is not near.
        let near = |value: f64| value.abs() <= FARTHEST;
        (near(at.x) && near(at.y) && near(at.z)).then(|| Place {
            x: (at.x * LATTICE).round() as i64,
            z: (at.z * LATTICE).round() as i64,
            y: (at.y * QUANTA).round() as i64,
        })
    }

    /// The first column from a lattice place on, or the last one up to it.
    pub fn cells(value: i64, up: bool) -> i32 {
        (if up { value + STEP - 1 } else { value }).div_euclid(STEP) as i32
    }
}

/// A part of a column: from the bottom to the top, in quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub column: (i32, i32),
    pub bottom: i64,
    pub top: i64,
    /// The triangles at the bottom and at the top.
    pub sole: u32,
    pub lid: u32,
}

/// Where a vertical line meets a triangle: the column (z before x), the height, whether the line enters there from below (-1) or leaves (1), and the
/// triangle.
type Hit = ((i32, i32), i64, i32, u32);

/// The spans of closed triangles, by columns in order, along z first.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    hits: Vec<Hit>,
}

impl Scan {
    /// Adds a triangle. Lines that pass its edges belong to one side of them.
    pub fn triangle(&mut self, number: usize, [a, b, c]: [Place; 3]) {
        let (low, high) = (a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x));
        let (near, far) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
        let rows = Place::cells(near, true)..=Place::cells(far, false);
        let places = Place::cells(low, true)..=Place::cells(high, false);
        if rows.is_empty() || places.is_empty() {
            return;
        }
        if high - low < NARROW && far - near < NARROW {
            self.walk(number, [a, b, c], rows, places);
        } else {
            self.cover(number, [a, b, c], rows, places);
        }
    }

    /// Adds what a triangle covers of a rectangle of columns. From one column to the next, weights change by the same amount.
    fn walk(
        &mut self,
        number: usize,
        [a, b, c]: [Place; 3],
        rows: RangeInclusive<i32>,
        places: RangeInclusive<i32>,
    ) {
        let area = cross::<i64>(a, b, c);
        if area == 0 {
            return;
        }
        let ([b, c], side, area) = if area > 0 { ([b, c], -1, area) } else { ([c, b], 1, -area) };
        let edges = [(b, c), (c, a), (a, b)];
        // A line on an edge belongs to one side: there, a weight of 0 counts as more.
        let more = edges.map(|(from, to)| {
            let (dx, dz) = (to.x - from.x, to.z - from.z);
            i64::from(dz > 0 || dz == 0 && dx < 0)
        });
        let step = edges.map(|(from, to)| (from.z - to.z) * STEP);
        for k in rows {
            let at = Place { x: i64::from(*places.start()) * STEP, z: i64::from(k) * STEP, y: 0 };
            let mut weights = edges.map(|(from, to)| cross::<i64>(from, to, at));
            for i in places.clone() {
                let [u, v, w] = weights;
                if u + more[0] > 0 && v + more[1] > 0 && w + more[2] > 0 {
                    let height = height_at([v, w], area, [a, b, c].map(|corner| corner.y));
                    self.hits.push(((k, i), height, side, number as u32));
                }
                weights = [u + step[0], v + step[1], w + step[2]];
            }
        }
    }

    /// As [`walk`](Self::walk), for a triangle that is too large for narrow integers.
    fn cover(
        &mut self,
        number: usize,
        [a, b, c]: [Place; 3],
        rows: RangeInclusive<i32>,
        places: RangeInclusive<i32>,
    ) {
        let area = cross::<i128>(a, b, c);
        if area == 0 {
            return;
        }
        let ([b, c], side, area) = if area > 0 { ([b, c], -1, area) } else { ([c, b], 1, -area) };
        for k in rows {
            for i in places.clone() {
                let at = Place { x: i64::from(i) * STEP, z: i64::from(k) * STEP, y: 0 };
                let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| {
                    let weight = cross::<i128>(from, to, at);
                    let (dx, dz) = (to.x - from.x, to.z - from.z);
                    (weight > 0 || weight == 0 && (dz > 0 || dz == 0 && dx < 0)).then_some(weight)
                });
                if let [Some(u), Some(v), Some(w)] = weights {
                    // Exact, so that the order of the points does not matter.
                    let sum = u * i128::from(a.y) + v * i128::from(b.y) + w * i128::from(c.y);
                    self.hits.push(((k, i), sum.div_euclid(area) as i64, side, number as u32));
                }
            }
        }
    }

    /// The spans of what was added since the last time, and a column in which what was added is not closed.
    pub fn spans(&mut self, spans: &mut Vec<Span>) -> Option<(i32, i32)> {
        by_columns(&mut self.hits, |((k, i), ..)| (*i, *k));
        let mut open = None;
        for column in self.hits.chunk_by_mut(|a, b| a.0 == b.0) {
            column.sort_unstable();
            let (k, i) = column[0].0;
            // Inside is where the line has entered and left unequally often: meshes that are inside out have an inside, too.
            let (mut depth, mut bottom, mut sole) = (0, 0, 0);
            for &mut (_, height, side, triangle) in column {
                if depth == 0 {
                    (bottom, sole) = (height, triangle);
                }
                depth += side;
                if depth == 0 {
                    spans.push(Span { column: (i, k), bottom, top: height, sole, lid: triangle });
                }
            }
            if depth != 0 {
                open = Some((i, k));
            }
        }
        self.hits.clear();
        open
    }
}

/// Integers of some width.
trait Whole: From<i64> + Sub<Output = Self> + Mul<Output = Self> {}

impl Whole for i64 {}
impl Whole for i128 {}

/// The height of a triangle with these heights of its corners, rounded down, where its second and third corner have these weights of an area: exact, so that
/// the order of the corners does not matter.
#[inline]
pub(crate) fn height_at([v, w]: [i64; 2], area: i64, [a, b, c]: [i64; 3]) -> i64 {
    let (to_b, to_c) = (b - a, c - a);
    // A division of floats is fast, and off by some quanta at most.
    let mut rise = ((v as f64 * to_b as f64 + w as f64 * to_c as f64) / area as f64) as i64;
    let product = |x: i64, y: i64| i128::from(x) * i128::from(y);
    let mut rest = product(v, to_b) + product(w, to_c) - product(rise, area);
    while rest < 0 {
        (rise, rest) = (rise - 1, rest + i128::from(area));
    }
    while rest >= i128::from(area) {
        (rise, rest) = (rise + 1, rest - i128::from(area));
    }
    a + rise
}

/// Twice the area of a triangle in plan; positive if it turns from x to z. For 64 bits its points are within 2^30 of each other.
fn cross<T: Whole>(a: Place, b: Place, c: Place) -> T {
    let product = |x: i64, z: i64| T::from(x) * T::from(z);
    product(b.x - a.x, c.z - a.z) - product(b.z - a.z, c.x - a.x)
}

/// Puts spans in order, those of equal ends as they are, and joins those of a column that touch.
pub(crate) fn join(spans: &mut Vec<Span>) {
    by_columns(spans, |span| span.column);
    for column in spans.chunk_by_mut(|a, b| a.column == b.column) {
        column.sort_by_key(|span| (span.bottom, span.top));
    }
    spans.dedup_by(|next, span| {
        let touches = next.column == span.column && next.bottom <= span.top;
        if touches && next.top > span.top {
            (span.top, span.lid) = (next.top, next.lid);
        }
        touches
    });
}

/// The spans of a closed mesh.
///
/// # Errors
///
/// A mesh that is not closed.
pub(crate) fn of_mesh(
    name: &str,
    places: &[Place],
    triangles: &[[u32; 3]],
    cell: f64,
) -> Result<Vec<Span>, Error> {
    let (mut scan, mut spans) = (Scan::default(), Vec::new());
    for (number, triangle) in triangles.iter().enumerate() {
        scan.triangle(number, triangle.map(|n| places[n as usize]));
    }
    match scan.spans(&mut spans) {
        Some((i, k)) => Err(Error::Open { name: name.to_owned(), at: [i, k].map(|at| f64::from(at) * cell) }),
        None => {
            join(&mut spans);
            Ok(spans)
        }
    }
}

/// The heights of a surface without thickness over columns, as spans without height.
pub(crate) fn of_surface(places: &[Place], triangles: &[[u32; 3]]) -> Vec<Span> {
    let mut scan = Scan::default();
    for (number, triangle) in triangles.iter().enumerate() {
        scan.triangle(number, triangle.map(|n| places[n as usize]));
    }
    by_columns(&mut scan.hits, |((k, i), ..)| (*i, *k));
    let span = |&((k, i), height, _, triangle): &Hit| Span {
        column: (i, k),
        bottom: height,
        top: height,
        sole: triangle,
        lid: triangle,
    };
    let mut spans: Vec<_> = scan.hits.iter().map(span).collect();
    join(&mut spans);
    spans
}

/// Where a load at a column and an offset from it in parts of the lattice is, after the triangle that it lies on has moved: column, offset, and how much
/// higher, in quanta.
pub(crate) fn carried(
    corners: [(Place, Place); 3],
    (i, k): (i32, i32),
    offset: [i64; 2],
) -> ((i32, i32), [i64; 2], i64) {
    let at = Place { x: i64::from(i) * STEP + offset[0], z: i64::from(k) * STEP + offset[1], y: 0 };
    let [a, b, c] = corners.map(|(from, _)| from);
    let sign = if cross::<i128>(a, b, c) < 0 { -1 } else { 1 };
    // A place beside the triangle moves as the nearest part of its edges, roughly.
    let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| (sign * cross::<i128>(from, to, at)).max(0));
    let total = weights.iter().sum::<i128>().max(1);
    // Division rounds towards 0, so mirror images move as mirror images.
    let mean = |way: fn(&(Place, Place)) -> i64| {
        let sum: i128 =
            weights.iter().zip(&corners).map(|(weight, corner)| weight * i128::from(way(corner))).sum();
        (sum / total) as i64
    };
    let (x, z) = (at.x + mean(|(from, to)| to.x - from.x), at.z + mean(|(from, to)| to.z - from.z));
    let nearest = |value: i64| (value + STEP / 2).div_euclid(STEP);
    let column = (nearest(x), nearest(z));
    let offset = [x - column.0 * STEP, z - column.1 * STEP];
    ((column.0 as i32, column.1 as i32), offset, mean(|(from, to)| to.y - from.y))
}
