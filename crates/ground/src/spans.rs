//! Height spans: the parts of vertical lines through columns that are inside a closed mesh of triangles (Onoue, Nishita: *Virtual Sandbox*,
//! section 3.2).
//!
//! Points are rounded to a lattice, and triangles are scan-converted in plan with integers, so a line meets exactly one of two triangles that share an edge.

use std::ops::{Mul, RangeInclusive, Sub};

use crate::tile::QUANTA;
use crate::{Error, Vector};

/// Places of the lattice in a cell, in plan.
const LATTICE: f64 = 65_536.0;
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

    /// Whether there are columns in the rectangle around some places.
    fn has_column(places: &[Place]) -> bool {
        let has = |get: fn(&Place) -> i64| {
            let (low, high) = places
                .iter()
                .map(get)
                .fold((i64::MAX, i64::MIN), |(low, high), at| (low.min(at), high.max(at)));
            Place::cells(low, true) <= Place::cells(high, false)
        };
        has(|at| at.x) && has(|at| at.z)
    }

    /// The first column from a lattice place on, or the last one up to it.
    fn cells(value: i64, up: bool) -> i32 {
        let lattice = LATTICE as i64;
        (if up { value + lattice - 1 } else { value }).div_euclid(lattice) as i32
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
        // Products of numbers below 2^30 need no wide integers.
        if high - low < 1 << 30 && far - near < 1 << 30 {
            self.cover::<i64>(number, [a, b, c], rows, places);
        } else {
            self.cover::<i128>(number, [a, b, c], rows, places);
        }
    }

    /// Adds what a triangle covers of a rectangle of columns, with integers that hold its area.
    fn cover<T: Whole>(
        &mut self,
        number: usize,
        [a, b, c]: [Place; 3],
        rows: RangeInclusive<i32>,
        places: RangeInclusive<i32>,
    ) {
        let (none, area) = (T::from(0), cross::<T>(a, b, c));
        if area == none {
            return;
        }
        let ([b, c], side, area) = if area > none { ([b, c], -1, area) } else { ([c, b], 1, none - area) };
        let lattice = LATTICE as i64;
        for k in rows {
            for i in places.clone() {
                let at = Place { x: i64::from(i) * lattice, z: i64::from(k) * lattice, y: 0 };
                let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| {
                    let weight = cross::<T>(from, to, at);
                    let (dx, dz) = (to.x - from.x, to.z - from.z);
                    (weight > none || weight == none && (dz > 0 || dz == 0 && dx < 0)).then_some(weight)
                });
                if let [Some(u), Some(v), Some(w)] = weights {
                    // Exact, so that the order of the points does not matter.
                    let part = |weight: T, y: i64| weight.into() * i128::from(y);
                    let sum: i128 = part(u, a.y) + part(v, b.y) + part(w, c.y);
                    self.hits.push(((k, i), sum.div_euclid(area.into()) as i64, side, number as u32));
                }
            }
        }
    }

    /// The spans of what was added since the last time, and a column in which what was added is not closed.
    pub fn spans(&mut self, spans: &mut Vec<Span>) -> Option<(i32, i32)> {
        self.hits.sort_unstable();
        let mut open = None;
        for column in self.hits.chunk_by(|a, b| a.0 == b.0) {
            let (k, i) = column[0].0;
            // Inside is where the line has entered and left unequally often: meshes that are inside out have an inside, too.
            let (mut depth, mut bottom, mut sole) = (0, 0, 0);
            for &(_, height, side, triangle) in column {
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
trait Whole: Copy + Ord + From<i64> + Into<i128> + Sub<Output = Self> + Mul<Output = Self> {}

impl Whole for i64 {}
impl Whole for i128 {}

/// Twice the area of a triangle in plan; positive if it turns from x to z. For 64 bits its points are within 2^30 of each other.
fn cross<T: Whole>(a: Place, b: Place, c: Place) -> T {
    let product = |x: i64, z: i64| T::from(x) * T::from(z);
    product(b.x - a.x, c.z - a.z) - product(b.z - a.z, c.x - a.x)
}

/// Puts spans in order, and joins those of a column that touch.
pub(crate) fn join(spans: &mut Vec<Span>) {
    spans.sort_unstable_by_key(|span| (span.column.1, span.column.0, span.bottom, span.top));
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
    scan.hits.sort_unstable();
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

/// The spans of what a mesh passes on its way between two places, without those at its ends; only triangles that come below a height count.
pub(crate) fn of_way(from: &[Place], to: &[Place], triangles: &[[u32; 3]], highest: i64) -> Vec<Span> {
    let (mut scan, mut spans) = (Scan::default(), Vec::new());
    for (number, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|n| n as usize);
        let ends = [from[a], from[b], from[c], to[a], to[b], to[c]];
        if ends.iter().all(|place| place.y > highest) || !Place::has_column(&ends) {
            continue;
        }
        scan.triangle(number, [from[a], from[b], from[c]]);
        scan.triangle(number, [to[c], to[b], to[a]]);
        // Both triangles at an edge divide its way along the same diagonal.
        for (a, b) in [(a, b), (b, c), (c, a)] {
            if a < b {
                scan.triangle(number, [from[b], from[a], to[a]]);
                scan.triangle(number, [from[b], to[a], to[b]]);
            } else {
                scan.triangle(number, [from[b], from[a], to[b]]);
                scan.triangle(number, [to[b], from[a], to[a]]);
            }
        }
        scan.spans(&mut spans);
    }
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
    let lattice = LATTICE as i64;
    let at = Place { x: i64::from(i) * lattice + offset[0], z: i64::from(k) * lattice + offset[1], y: 0 };
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
    let nearest = |value: i64| (value + lattice / 2).div_euclid(lattice);
    let column = (nearest(x), nearest(z));
    let offset = [x - column.0 * lattice, z - column.1 * lattice];
    ((column.0 as i32, column.1 as i32), offset, mean(|(from, to)| to.y - from.y))
}
