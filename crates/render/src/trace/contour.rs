//! Outlines of sets of cells: followed along the edges of cells, then simplified.

/// A set of cells of a raster. None is at the rim of the raster.
pub struct Mask<I, F, G, H> {
    /// Cells in a row of the raster.
    pub width: usize,
    /// Whether a cell belongs to the set; none beyond the raster does.
    pub inside: I,
    /// The part of a cell that the set covers, from 0 to 1, or that its item does.
    pub covered: F,
    /// Of a cell of the same item: how much lighter it is than the darkest that belong to the set.
    pub shade: G,
    /// Of a cell that does not belong to the set: how exactly an outline beside it has to be kept if that runs under what is painted later.
    pub hidden: H,
}

/// An outline of a set, as it is followed.
pub struct Outline {
    places: Vec<Place>,
    /// It goes around a hole of the set.
    pub is_hole: bool,
}

impl Outline {
    /// Makes it exact where it leaves the edge of an item: there, three regions meet, and a corner that two of them cut off would show what lies
    /// under both.
    pub fn keep_junctions(&mut self) {
        let is_edge = |place: &Place| place.tolerance <= TOLERANCE;
        for i in 1..self.places.len() {
            let [a, b] = [is_edge(&self.places[i - 1]), is_edge(&self.places[i])];
            if a != b {
                let inside = &mut self.places[if a { i } else { i - 1 }];
                inside.tolerance = inside.tolerance.min(TOLERANCE_JUNCTION);
            }
        }
    }

    /// Its corners; none if it is too small to be seen.
    pub fn simplified(&self) -> Option<Vec<Corner>> {
        Some(simplified(&self.places))
            .filter(|corners| corners.len() >= 3 && area(corners).abs() >= LEAST_AREA)
    }
}

/// What is counted of a cell.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The shade of the set, lighter ones, and what is painted later.
    Shade,
    /// All shades of its item, and what is painted later.
    Item,
}

/// How much room an outline has under what is painted later.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// As much as the margin of a region.
    Amid,
    /// Little: beside it, something is seen that was painted before.
    NearEdge,
}

impl Hidden {
    fn tolerance(self) -> f64 {
        match self {
            Hidden::Amid => TOLERANCE_HIDDEN,
            Hidden::NearEdge => TOLERANCE_NEAR_EDGE,
        }
    }
}

/// A place that an outline passes, no further than a tolerance.
#[derive(Clone, Copy)]
struct Place {
    at: Corner,
    tolerance: f64,
}

/// The greatest distance of outlines, in cells, from the edges of items, from those between two shades of one item, and from where
/// they should run under what is painted later.
const TOLERANCE: f64 = 0.25;
const TOLERANCE_INSIDE: f64 = 1.1;
/// That at the edges of a strip, in parts of half its width; and the least one.
const STRIP: f64 = 0.4;
const LEAST_TOLERANCE: f64 = 0.02;
const TOLERANCE_HIDDEN: f64 = 1.5;
const TOLERANCE_NEAR_EDGE: f64 = 0.8;
/// That of the first place within an item.
const TOLERANCE_JUNCTION: f64 = 0.25;

/// Cosine of the turn at a corner that is sharp, and sine of that at one which is not.
const SHARP: f64 = -0.3;
const STRAIGHT: f64 = 0.4;
/// The least area that an outline surrounds, in cells: less covers no more than a fiftieth of a pixel.
const LEAST_AREA: f64 = 0.1;

/// Most outlines have no more places by far.
const SHORT: usize = 64;

/// A corner of an outline, in cells from the upper left corner of the mask.
pub type Corner = [f64; 2];

impl<I, F, G, H> Mask<I, F, G, H>
where
    I: Fn(usize) -> bool,
    F: Fn(usize, Part) -> f64,
    G: Fn(usize) -> Option<f64>,
    H: Fn(usize) -> Option<Hidden>,
{
    /// Whether an outline passes above a cell, to the right.
    pub fn is_top(&self, cell: usize) -> bool {
        (self.inside)(cell) && !(self.inside)(cell - self.width)
    }

    /// Where the set ends between the centres of two neighbours, given the column and row of the first, and the way to the other.
    fn crossing(&self, [inner, outer]: [usize; 2], [at, way]: [[f64; 2]; 2]) -> Place {
        let between = |a: f64, b: f64| {
            let (high, low) = (a.max(0.5), b.min(0.5));
            if high == low { 0.5 } else { (high - 0.5) / (high - low) }
        };
        let covered = |cell: usize, part: Part| (self.covered)(cell, part);
        let hidden = (self.hidden)(outer);
        let (t, tolerance) = match ((self.shade)(inner), (self.shade)(outer)) {
            _ if hidden.is_some() => (0.5, hidden.map_or(TOLERANCE, Hidden::tolerance)),
            // A lighter shade is painted over it.
            (_, Some(low)) if low >= 0.0 => (0.5, TOLERANCE_HIDDEN),
            (Some(high), Some(low)) => {
                let (a, b) = (covered(inner, Part::Shade), covered(outer, Part::Shade));
                match high > 0.0 && low < 0.0 && a == 1.0 && b == 0.0 {
                    // Where the shade passes the limit.
                    true => (high / (high - low), TOLERANCE_INSIDE),
                    // At a crease.
                    false => (between(a, b), TOLERANCE_INSIDE),
                }
            }
            _ => match (covered(inner, Part::Item), covered(outer, Part::Item)) {
                // Where both are covered, it ends under what is painted later.
                (_, b) if b > 0.99 => (0.5, TOLERANCE_HIDDEN),
                (a, b) => self.edge([inner, outer], [a, b]),
            },
        };
        Place { at: [at[0] + 0.5 + t * way[0], at[1] + 0.5 + t * way[1]], tolerance }
    }

    /// Where an item ends that covers these parts of two neighbours, from the centre of the inner one, and the tolerance there: so that
    /// what is inside is as much as is covered. A part that lies between two ends is shared by them.
    fn edge(&self, [inner, outer]: [usize; 2], [a, b]: [f64; 2]) -> (f64, f64) {
        let step = outer.wrapping_sub(inner);
        let is_strip = !(self.inside)(inner.wrapping_sub(step));
        let is_gap = b > 0.0 && (self.inside)(outer.wrapping_add(step));
        let own = if is_strip { a / 2.0 } else { a - 0.5 };
        let t = (own + if is_gap { b / 2.0 } else { b }).clamp(-0.45, 1.45);
        // A strip is not to vanish.
        (t, if is_strip { TOLERANCE.min(t * STRIP).max(LEAST_TOLERANCE) } else { TOLERANCE })
    }

    /// The outline that begins with the upper edge of a cell, the set being on its right: between the centres of cells inside and
    /// outside, where the set ends by the parts that it covers. `pass` takes the cells below whose upper edges it goes to the right.
    pub fn follow(&self, start: usize, mut pass: impl FnMut(usize)) -> Outline {
        // Right, down, left, up, as differences of cells; they wrap around.
        let steps = [1, self.width, 1_usize.wrapping_neg(), self.width.wrapping_neg()];
        // The cells on the right of an edge that begins at the upper left corner of a cell, and on its left, by direction.
        let up_left = (self.width + 1).wrapping_neg();
        let right_of = [0, steps[2], up_left, steps[3]];
        let left_of = [steps[3], 0, steps[2], up_left];
        // Columns and rows of the cells on the right, from that corner; and the ways to those on the left.
        const RIGHT: [[f64; 2]; 4] = [[0.0, 0.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0]];
        const WAYS: [[f64; 2]; 4] = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        const AHEAD: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
        let (mut at, mut direction) = (start, 0);
        let [mut column, mut row] = [start % self.width, start / self.width].map(|at| at as i64);
        let mut places = Vec::with_capacity(SHORT);
        // Of what it surrounds, in cells; negative if that is on its left.
        let mut area = 0_i64;
        loop {
            match direction {
                0 => {
                    pass(at);
                    area -= row;
                }
                2 => area += row,
                _ => {}
            }
            let beside = |by: [usize; 4]| at.wrapping_add(by[direction]);
            let [right, down] = RIGHT[direction];
            let inner = [column as f64 + right, row as f64 + down];
            places.push(self.crossing([beside(right_of), beside(left_of)], [inner, WAYS[direction]]));
            at = at.wrapping_add(steps[direction]);
            column += AHEAD[direction][0];
            row += AHEAD[direction][1];
            let ahead = |by: [usize; 4]| (self.inside)(at.wrapping_add(by[direction]));
            direction = match (ahead(left_of), ahead(right_of)) {
                // Cells that touch in a corner only are apart.
                (_, false) => (direction + 1) % 4,
                (false, true) => direction,
                (true, true) => (direction + 3) % 4,
            };
            if (at, direction) == (start, 0) {
                return Outline { places, is_hole: area < 0 };
            }
        }
    }
}

/// What an outline surrounds, in cells, negative if it goes around it the other way.
fn area(outline: &[Corner]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(p, q)| p[0] * q[1] - q[0] * p[1]).sum::<f64>() / 2.0
}

/// A closed line with fewer corners, none of the given ones further from it than its tolerance (Ramer, Douglas and Peucker).
fn simplified(points: &[Place]) -> Vec<Corner> {
    let n = points.len();
    // Two corners that are far apart stay: the last ones of those that are as far.
    let far = |from: Corner| {
        let mut farthest = (0, 0.0);
        for (i, place) in points.iter().enumerate() {
            let [x, y] = [place.at[0] - from[0], place.at[1] - from[1]];
            let distance = x * x + y * y;
            if distance >= farthest.1 {
                farthest = (i, distance);
            }
        }
        farthest.0
    };
    let a = far(points[0].at);
    let b = far(points[a].at);
    let (a, b) = (a.min(b), a.max(b));
    let mut kept = vec![false; n];
    (kept[a], kept[b]) = (true, true);
    let weights: Vec<f64> = points.iter().map(|place| (place.tolerance * place.tolerance).recip()).collect();
    // Stretches of indices, which may go beyond the end.
    let mut stretches = vec![(a, b), (b, a + n)];
    while let Some((from, to)) = stretches.pop() {
        let (p, q) = (points[from % n].at, points[to % n].at);
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let square = dx * dx + dy * dy;
        let by_square = square.recip();
        let mut worst = (from, 1.0);
        // Up to the end, and what goes beyond it.
        let beyond = (from + 1).max(n) - n..to.max(n) - n;
        for (first, range) in [(0, from + 1..to.min(n)), (n, beyond)] {
            if range.is_empty() {
                continue;
            }
            let start = first + range.start;
            let places = points[range.clone()].iter().zip(&weights[range]);
            for (i, (place, weight)) in (start..).zip(places) {
                let (ex, ey) = (place.at[0] - p[0], place.at[1] - p[1]);
                // The square of the distance, in tolerances.
                let across = ex * dy - ey * dx;
                let distance = if square > 0.0 { across * across * by_square } else { ex * ex + ey * ey };
                let off = distance * weight;
                if off > worst.1 {
                    worst = (i, off);
                }
            }
        }
        if worst.0 != from {
            kept[worst.0 % n] = true;
            stretches.extend([(from, worst.0), (worst.0, to)]);
        }
    }
    let corners: Vec<usize> = (0..n).filter(|i| kept[*i]).collect();
    balanced(points, &corners)
}

/// The corners that are kept, moved so that as much lies on one side of the lines between them as on the other. Corners on a curve alone would
/// make all that is convex smaller.
fn balanced(points: &[Place], corners: &[usize]) -> Vec<Corner> {
    let (n, count) = (points.len(), corners.len());
    // Of the line that begins at each corner: its normal, and how far places are on that side in the mean.
    let lines: Vec<(Corner, f64)> = (0..count)
        .map(|k| {
            let (from, to) = (corners[k], corners[(k + 1) % count]);
            let to = if to > from { to } else { to + n };
            let (p, q) = (points[from].at, points[to % n].at);
            let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
            let length = dx.hypot(dy);
            if length == 0.0 {
                return ([0.0; 2], 0.0);
            }
            let normal = [dy / length, -dx / length];
            let seen =
                (from + 1..to).map(|i| points[i % n]).filter(|place| place.tolerance <= TOLERANCE_INSIDE);
            let offset = |place: Place| (0..2).map(|k| (place.at[k] - p[k]) * normal[k]).sum::<f64>();
            (normal, seen.map(offset).sum::<f64>() / (to - from) as f64)
        })
        .collect();
    let moved = |k: usize| {
        let by = shift(lines[(k + count - 1) % count], lines[k]);
        [0, 1].map(|axis| points[corners[k]].at[axis] + by[axis])
    };
    (0..count).map(moved).collect()
}

/// How a corner moves if the two lines that meet there move along their normals by so much. One at the tip of something sharp stays.
fn shift((p, a): (Corner, f64), (q, b): (Corner, f64)) -> [f64; 2] {
    let (sin, cos) = (p[0] * q[1] - p[1] * q[0], p[0] * q[0] + p[1] * q[1]);
    match () {
        () if cos < SHARP => [0.0; 2],
        () if sin.abs() > STRAIGHT => [(a * q[1] - b * p[1]) / sin, (b * p[0] - a * q[0]) / sin],
        () => [0, 1].map(|k| (p[k] + q[k]) / (1.0 + cos) * (a + b) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The outlines of a set in a raster of so many columns, whose rim is empty.
    fn outlines<I, F, G, H>(mask: &Mask<I, F, G, H>, count: usize) -> Vec<Vec<Corner>>
    where
        I: Fn(usize) -> bool,
        F: Fn(usize, Part) -> f64,
        G: Fn(usize) -> Option<f64>,
        H: Fn(usize) -> Option<Hidden>,
    {
        let mut begun = vec![false; count];
        let mut outlines = Vec::new();
        for cell in mask.width..count - mask.width {
            if mask.is_top(cell) && !begun[cell] {
                outlines.extend(mask.follow(cell, |cell| begun[cell] = true).simplified());
            }
        }
        outlines
    }

    fn mask(rows: &[&str]) -> Vec<Vec<Corner>> {
        let inside: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let covered = |i: usize, _| f64::from(u8::from(inside[i]));
        let mask = Mask {
            width: rows[0].len(),
            inside: |i: usize| inside.get(i) == Some(&true),
            covered,
            shade: |_| None,
            hidden: |_| None,
        };
        outlines(&mask, inside.len())
    }

    #[test]
    fn a_square_keeps_its_place_and_its_hole() {
        let outlines = mask(&[
            "..........",
            ".########.",
            ".########.",
            ".##....##.",
            ".##....##.",
            ".##....##.",
            ".##....##.",
            ".########.",
            ".########.",
            "..........",
        ]);
        assert_eq!(outlines.len(), 2);
        // The corners of a cell are cut.
        assert!((area(&outlines[0]) - 64.0).abs() <= 1.0, "{outlines:?}");
        assert!((area(&outlines[1]) + 16.0).abs() <= 1.5, "{outlines:?}");
    }

    #[test]
    fn holes_are_told_from_outlines() {
        let inside = |i: usize| (1..6).contains(&(i % 7)) && (1..6).contains(&(i / 7)) && i != 24;
        let mask = Mask { width: 7, inside, covered: |_, _| 0.0, shade: |_| None, hidden: |_| None };
        assert!(!mask.follow(8, |_| ()).is_hole);
        assert!(mask.follow(24 + 7, |_| ()).is_hole);
    }

    #[test]
    fn cells_that_touch_in_a_corner_are_two_outlines() {
        assert_eq!(mask(&["......", ".##...", ".##...", "...##.", "...##.", "......"]).len(), 2);
    }

    #[test]
    fn an_edge_is_where_the_covered_parts_say() {
        let parts = [0.0, 1.0, 0.75, 0.0, 0.0];
        let inside = |i: usize| (1..9).contains(&(i / 5)) && parts[i % 5] > 0.5;
        let covered = |i: usize, _| if inside(i) { parts[i % 5] } else { 0.0 };
        let outlines = outlines(&Mask { width: 5, inside, covered, shade: |_| None, hidden: |_| None }, 50);
        let right = outlines[0].iter().fold(0.0_f64, |right, p| right.max(p[0]));
        assert!((right - 2.75).abs() < 0.1, "{outlines:?}");
    }

    #[test]
    fn a_narrow_strip_and_a_narrow_gap_are_as_wide_as_the_covered_parts_say() {
        let row = |rows: &[usize], i: usize| rows.contains(&(i / 20)) && (1..19).contains(&(i % 20));
        let strip = |i: usize| row(&[2], i);
        let covered = |i: usize, _| if strip(i) { 0.4 } else { 0.0 };
        let found =
            outlines(&Mask { width: 20, inside: strip, covered, shade: |_| None, hidden: |_| None }, 100);
        assert!(found.len() == 1 && (area(&found[0]) / 0.4 - 17.0).abs() <= 1.0, "{found:?}");

        let sides = |i: usize| row(&[1, 2, 4, 5], i);
        let covered = |i: usize, _| match i / 20 {
            3 if row(&[3], i) => 0.7,
            _ => f64::from(u8::from(sides(i))),
        };
        let found =
            outlines(&Mask { width: 20, inside: sides, covered, shade: |_| None, hidden: |_| None }, 140);
        let low = found[0].iter().fold(0.0_f64, |low, p| low.max(p[1]));
        let high = found[1].iter().fold(9.0_f64, |high, p| high.min(p[1]));
        assert!((high - low - 0.3).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn what_is_round_keeps_its_area() {
        for radius in [4.0, 12.3, 18.0] {
            let covered = |i: usize, _| {
                let [x, y] = [i % 40, i / 40].map(|x| x as f64 + 0.5 - 20.0);
                (radius - x.hypot(y) + 0.5).clamp(0.0, 1.0)
            };
            let inside = |i: usize| covered(i, Part::Item) >= 0.5;
            let found =
                outlines(&Mask { width: 40, inside, covered, shade: |_| None, hidden: |_| None }, 1600);
            let part = area(&found[0]) / (std::f64::consts::PI * radius * radius);
            // Eight corners on a circle have nine tenths of its area.
            assert!(found.len() == 1 && (part - 1.0).abs() < 0.02, "{radius}: {part}, {}", found[0].len());
        }
    }

    #[test]
    fn a_slanted_edge_is_one_line() {
        let is_rim = |i: usize| [i % 40, i / 40].into_iter().any(|x| x == 0 || x == 39);
        let covered = |i: usize, _| {
            let part = (20.0 + ((i / 40) as f64 + 0.5) / 4.0 - (i % 40) as f64).clamp(0.0, 1.0);
            if is_rim(i) { 0.0 } else { part }
        };
        let inside = |i: usize| covered(i, Part::Item) >= 0.5;
        let outlines =
            outlines(&Mask { width: 40, inside, covered, shade: |_| None, hidden: |_| None }, 1600);
        // The corners are cut; the edge itself has a corner at most.
        assert!(outlines.len() == 1 && outlines[0].len() <= 9, "{outlines:?}");
    }

    #[test]
    fn a_shade_ends_where_the_light_passes_its_limit() {
        let shade = |i: usize| 2.2 - ((i % 5) as f64 + 0.5);
        let inside = |i: usize| shade(i) > 0.0;
        let covered = |i: usize, part| if part == Part::Item || inside(i) { 1.0 } else { 0.0 };
        let mask = Mask { width: 5, inside, covered, shade: |i| Some(shade(i)), hidden: |_| None };
        // Between the second and the third column.
        let [x, y] = mask.crossing([11, 12], [[1.0, 2.0], [1.0, 0.0]]).at;
        assert!((x - 2.2).abs() < 1e-9 && y == 2.5, "{x} {y}");
    }
}
