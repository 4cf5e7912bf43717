//! What a mesh passes on its way between two places: of each triangle, the prism between where it was and where it is.

use std::ops::RangeInclusive;

use crate::spans::{NARROW, Place, STEP, Scan, Span, height_at};

/// Lines through columns, numbers of the six points, in the order in which the three points before stand before those after.
const EDGES: [[usize; 2]; 9] = [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];

/// What a mesh passes, as spans. What stands higher than the surface is left out, in part.
pub(crate) struct Way<'a> {
    pub from: &'a [Place],
    pub to: &'a [Place],
    /// No surface near is higher.
    pub highest: i64,
}

impl Way<'_> {
    /// Adds the spans of what the triangles of a mesh pass, without those at the ends of the way. Those of one triangle follow each other.
    pub fn spans(
        &self,
        triangles: &[[u32; 3]],
        mut top: impl FnMut((i32, i32)) -> i64,
        spans: &mut Vec<Span>,
    ) {
        let mut scan = Scan::default();
        for (number, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|n| n as usize);
            let ends = [self.from[a], self.from[b], self.from[c], self.to[a], self.to[b], self.to[c]];
            let lowest = ends.iter().fold(i64::MAX, |lowest, end| lowest.min(end.y));
            if lowest > self.highest {
                continue;
            }
            let [along_x, along_z] = [range(ends, |end| end.x), range(ends, |end| end.z)];
            let columns = |[low, high]: [i64; 2]| Place::cells(low, true)..=Place::cells(high, false);
            let (places, rows) = (columns(along_x), columns(along_z));
            if places.is_empty() || rows.is_empty() {
                continue;
            }
            // Both triangles at an edge divide its way along the same diagonal.
            let rises = [(a, b), (b, c), (c, a)].map(|(a, b)| a < b);
            if [along_x, along_z].into_iter().all(|[low, high]| high - low < NARROW) {
                let prism = Prism::new(number as u32, ends, rises, [*places.start(), *rows.start()]);
                prism.spans((places, rows), |column| lowest <= top(column), spans);
            } else {
                wide(&mut scan, number, ends, rises);
                scan.spans(spans);
            }
        }
    }
}

fn range(ends: [Place; 6], get: fn(&Place) -> i64) -> [i64; 2] {
    let [mut low, mut high] = [get(&ends[0]); 2];
    for end in &ends[1..] {
        (low, high) = (low.min(get(end)), high.max(get(end)));
    }
    [low, high]
}

/// The eight triangles around a prism, for one that is too large for narrow integers.
fn wide(scan: &mut Scan, number: usize, ends: [Place; 6], rises: [bool; 3]) {
    let [a, b, c, d, e, f] = ends;
    scan.triangle(number, [a, b, c]);
    scan.triangle(number, [f, e, d]);
    for ([a, b, c, d], rises) in [[a, b, d, e], [b, c, e, f], [c, a, f, d]].into_iter().zip(rises) {
        if rises {
            scan.triangle(number, [b, a, c]);
            scan.triangle(number, [b, c, d]);
        } else {
            scan.triangle(number, [b, a, d]);
            scan.triangle(number, [d, a, c]);
        }
    }
}

/// A directed line in plan, with its weight at the first column: twice the area of the triangle of the line and the column.
#[derive(Clone, Copy, Default)]
struct Line {
    weight: i64,
    dx: i64,
    dz: i64,
    /// 1 where a column on the line counts as one on its positive side.
    more: i64,
}

impl Line {
    fn new(from: Place, to: Place, at: [i64; 2]) -> Line {
        let (dx, dz) = (to.x - from.x, to.z - from.z);
        let weight = dx * (at[1] - from.z) - dz * (at[0] - from.x);
        Line { weight, dx, dz, more: i64::from(dz > 0 || dz == 0 && dx < 0) }
    }

    /// The weight some columns further.
    fn at(&self, i: i64, k: i64) -> i64 {
        self.weight + (self.dx * k - self.dz * i) * STEP
    }
}

/// A triangle of a prism: the lines along which it is gone around, and whether along or against them; and its points.
type Face = ([(usize, bool); 3], [usize; 3]);

/// A triangle on its way.
struct Prism {
    number: u32,
    /// Heights of its points.
    heights: [i64; 6],
    /// The lines of [`EDGES`], and the diagonals of the sides.
    lines: [Line; 12],
    /// The triangles around it.
    faces: [Face; 8],
    first: [i32; 2],
}

impl Prism {
    fn new(number: u32, ends: [Place; 6], rises: [bool; 3], first: [i32; 2]) -> Prism {
        let at = first.map(|first| i64::from(first) * STEP);
        let mut lines = [Line::default(); 12];
        for (line, [from, to]) in lines.iter_mut().zip(EDGES) {
            *line = Line::new(ends[from], ends[to], at);
        }
        let (along, against) = (true, false);
        let mut faces = [([(0, along), (1, along), (2, along)], [0, 1, 2]); 8];
        faces[1] = ([(4, against), (3, against), (5, against)], [5, 4, 3]);
        for (side, rises) in rises.into_iter().enumerate() {
            // Corners of the side: a and b before, c and d after.
            let (a, b) = (side, (side + 1) % 3);
            let (c, d) = (a + 3, b + 3);
            let diagonal = 9 + side;
            let (way_a, way_b) = (6 + a, 6 + b);
            let pair = if rises {
                lines[diagonal] = Line::new(ends[b], ends[c], at);
                [
                    ([(side, against), (way_a, along), (diagonal, against)], [b, a, c]),
                    ([(diagonal, along), (side + 3, along), (way_b, against)], [b, c, d]),
                ]
            } else {
                lines[diagonal] = Line::new(ends[a], ends[d], at);
                [
                    ([(side, against), (diagonal, along), (way_b, against)], [b, a, d]),
                    ([(diagonal, against), (way_a, along), (side + 3, along)], [d, a, c]),
                ]
            };
            faces[2 + 2 * side..4 + 2 * side].copy_from_slice(&pair);
        }
        Prism { number, heights: ends.map(|end| end.y), lines, faces, first }
    }

    /// Adds the spans over those of a rectangle of columns that are wanted.
    fn spans(
        &self,
        (places, rows): (RangeInclusive<i32>, RangeInclusive<i32>),
        mut wanted: impl FnMut((i32, i32)) -> bool,
        spans: &mut Vec<Span>,
    ) {
        for k in rows {
            for i in places.clone() {
                if wanted((i, k)) {
                    self.over((i, k), spans);
                }
            }
        }
    }

    /// Adds the spans over a column. Its line meets a triangle if it is on the same side of the three lines around that, gone along one after the other; on the side of a line that it
    /// is not on if that is gone against.
    fn over(&self, (i, k): (i32, i32), spans: &mut Vec<Span>) {
        let [x, z] = [i64::from(i - self.first[0]), i64::from(k - self.first[1])];
        let weights = self.lines.map(|line| line.at(x, z));
        let mut sides = 0_u32;
        for (n, (weight, line)) in weights.iter().zip(&self.lines).enumerate() {
            sides |= u32::from(weight + line.more > 0) << n;
        }
        let (mut hits, mut count) = ([(0_i64, 0_i32); 8], 0);
        for (lines, points) in &self.faces {
            let [p, q, r] = lines.map(|(line, along)| (sides >> line & 1 != 0) == along);
            if p != q || q != r {
                continue;
            }
            let signed = lines.map(|(line, along)| if along { weights[line] } else { -weights[line] });
            let [u, v, w] = if p { signed } else { signed.map(|weight| -weight) };
            // The weight of a line is that of the corner that is not on it.
            let [first, second, third] = points.map(|point| self.heights[point]);
            let area = u + v + w;
            if area > 0 {
                hits[count] = (height_at([u, v], area, [second, third, first]), if p { -1 } else { 1 });
                count += 1;
            }
        }
        let hits = &mut hits[..count];
        hits.sort_unstable();
        let (mut depth, mut bottom) = (0, 0);
        for &mut (height, side) in hits {
            if depth == 0 {
                bottom = height;
            }
            depth += side;
            if depth == 0 {
                spans.push(Span { column: (i, k), bottom, top: height, sole: self.number, lid: self.number });
            }
        }
    }
}
