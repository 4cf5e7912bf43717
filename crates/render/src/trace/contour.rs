//! Outlines of sets of cells: followed along the edges of cells, then simplified.

/// A rectangle of cells, each inside or outside of a set.
pub struct Mask<'a, F, G> {
    pub width: usize,
    pub height: usize,
    pub inside: &'a [bool],
    /// The part of a cell that the set covers, from 0 to 1, or that its item does.
    pub covered: F,
    /// Of a cell of the same item: how much lighter it is than the darkest that belong to the set.
    pub shade: G,
}

/// What is counted of a cell.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The shade of the set, lighter ones, and what is painted later.
    Shade,
    /// All shades of its item, and what is painted later.
    Item,
}

/// A place that an outline passes, no further than a tolerance.
#[derive(Clone, Copy)]
struct Place {
    at: Corner,
    tolerance: f64,
}

/// The greatest distance of outlines, in cells, from the edges of items, and from those between two shades of one item or under what
/// is painted later.
const TOLERANCE: f64 = 0.25;
const TOLERANCE_INSIDE: f64 = 0.9;

/// A corner of an outline, in cells from the upper left corner of the mask.
pub type Corner = [f64; 2];

impl<F: Fn(usize, Part) -> f64, G: Fn(usize) -> Option<f64>> Mask<'_, F, G> {
    fn at(&self, x: i64, y: i64) -> bool {
        (0..self.width as i64).contains(&x)
            && (0..self.height as i64).contains(&y)
            && self.inside[y as usize * self.width + x as usize]
    }

    /// All outlines of the set, those of holes included: between the centres of cells inside and outside, where the set ends by
    /// the parts that it covers; each simplified.
    pub fn outlines(&self) -> Vec<Vec<Corner>> {
        // An edge below a cell outside and above one inside, by cell: the outline goes to the right there.
        let mut begun = vec![false; self.width * (self.height + 1)];
        let mut outlines = Vec::new();
        for y in 0..=self.height as i64 {
            for x in 0..self.width as i64 {
                let is_top = self.at(x, y) && !self.at(x, y - 1);
                if is_top && !begun[y as usize * self.width + x as usize] {
                    outlines.push(simplified(&self.follow(x, y, &mut begun)));
                }
            }
        }
        outlines.retain(|outline| outline.len() >= 3);
        outlines
    }

    /// Where the set ends between the centres of the two cells beside an edge, which goes from a lattice point in a direction.
    fn crossing(&self, [x, y]: [i64; 2], [dx, dy]: [i64; 2]) -> Place {
        let cell = |side: i64| {
            let (cx, cy) = (dx - dy * side, dy + dx * side);
            [x + (cx - 1).div_euclid(2), y + (cy - 1).div_euclid(2)]
        };
        let (inner, outer) = (cell(1), cell(-1));
        let number = |[x, y]: [i64; 2]| {
            let within = (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y);
            within.then(|| y as usize * self.width + x as usize)
        };
        let covered = |cell: [i64; 2], of| number(cell).map_or(0.0, |i| (self.covered)(i, of));
        let shade = |cell: [i64; 2]| number(cell).and_then(&self.shade);
        let between = |a: f64, b: f64| {
            let (high, low) = (a.max(0.5), b.min(0.5));
            if high == low { 0.5 } else { (high - 0.5) / (high - low) }
        };
        let (t, tolerance) = match (shade(inner), shade(outer)) {
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
                (_, b) if b > 0.99 => (0.5, TOLERANCE_INSIDE),
                (a, b) => (between(a, b), TOLERANCE),
            },
        };
        let at = [0, 1].map(|k| inner[k] as f64 + 0.5 + t * (outer[k] - inner[k]) as f64);
        Place { at, tolerance }
    }

    /// The middles of the edges of the outline that begins with the upper edge of a cell, the set being on the right.
    fn follow(&self, x: i64, y: i64, begun: &mut [bool]) -> Vec<Place> {
        let start = (x, y, (1, 0));
        let (mut x, mut y, mut direction) = start;
        let mut middles = Vec::new();
        loop {
            // The edge goes from the lattice point (x, y) in the direction; the cell on its right is inside.
            let (dx, dy): (i64, i64) = direction;
            if direction == (1, 0) {
                begun[y as usize * self.width + x as usize] = true;
            }
            middles.push(self.crossing([x, y], [dx, dy]));
            (x, y) = (x + dx, y + dy);
            // The two cells ahead, on the left and on the right of the direction.
            let ahead = |side: i64| {
                let (cx, cy) = (dx - dy * side, dy + dx * side);
                // Of the four cells around the lattice point.
                self.at(x + (cx - 1).div_euclid(2), y + (cy - 1).div_euclid(2))
            };
            direction = match (ahead(-1), ahead(1)) {
                // Cells that touch in a corner only are apart.
                (_, false) => (-dy, dx),
                (false, true) => (dx, dy),
                (true, true) => (dy, -dx),
            };
            if (x, y, direction) == start {
                return middles;
            }
        }
    }
}

/// A closed line with fewer corners, none of the given ones further from it than its tolerance (Ramer, Douglas and Peucker).
fn simplified(points: &[Place]) -> Vec<Corner> {
    let n = points.len();
    // Two corners that are far apart stay.
    let far = |from: Corner| {
        let distance = |p: &Place| (p.at[0] - from[0]).powi(2) + (p.at[1] - from[1]).powi(2);
        (0..n).max_by(|&i, &j| distance(&points[i]).total_cmp(&distance(&points[j]))).unwrap_or(0)
    };
    let a = far(points[0].at);
    let b = far(points[a].at);
    let (a, b) = (a.min(b), a.max(b));
    let mut kept = vec![false; n];
    (kept[a], kept[b]) = (true, true);
    // Stretches of indices, which may go beyond the end.
    let mut stretches = vec![(a, b), (b, a + n)];
    while let Some((from, to)) = stretches.pop() {
        let (p, q) = (points[from % n].at, points[to % n].at);
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let length = dx.hypot(dy);
        // In tolerances.
        let offset = |i: usize| {
            let Place { at: [x, y], tolerance } = points[i % n];
            let (ex, ey) = (x - p[0], y - p[1]);
            let distance = if length > 0.0 { (ex * dy - ey * dx).abs() / length } else { ex.hypot(ey) };
            distance / tolerance
        };
        let worst = (from + 1..to).map(|i| (i, offset(i))).max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((worst, _)) = worst.filter(|(_, offset)| *offset > 1.0) {
            kept[worst % n] = true;
            stretches.extend([(from, worst), (worst, to)]);
        }
    }
    points.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(place, _)| place.at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Vec<Vec<Corner>> {
        let inside: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let covered = |i: usize, _| f64::from(u8::from(inside[i]));
        Mask { width: rows[0].len(), height: rows.len(), inside: &inside, covered, shade: |_| None }
            .outlines()
    }

    fn area(outline: &[Corner]) -> f64 {
        let next = outline.iter().cycle().skip(1);
        outline.iter().zip(next).map(|(p, q)| p[0] * q[1] - q[0] * p[1]).sum::<f64>() / 2.0
    }

    #[test]
    fn a_square_keeps_its_place_and_its_hole() {
        let outlines = mask(&[
            "########", "########", "##....##", "##....##", "##....##", "##....##", "########", "########",
        ]);
        assert_eq!(outlines.len(), 2);
        // The corners of a cell are cut.
        assert!((area(&outlines[0]) - 64.0).abs() <= 1.0, "{outlines:?}");
        assert!((area(&outlines[1]) + 16.0).abs() <= 1.5, "{outlines:?}");
    }

    #[test]
    fn cells_that_touch_in_a_corner_are_two_outlines() {
        assert_eq!(mask(&["##..", "##..", "..##", "..##"]).len(), 2);
    }

    #[test]
    fn an_edge_is_where_the_covered_parts_say() {
        let inside = [true, true, false, true, true, false];
        let covered = |i: usize, _| [1.0, 0.75, 0.0][i % 3];
        let outlines = Mask { width: 3, height: 2, inside: &inside, covered, shade: |_| None }.outlines();
        let right = outlines[0].iter().fold(0.0_f64, |right, p| right.max(p[0]));
        assert!((right - 1.75).abs() < 0.1, "{outlines:?}");
    }

    #[test]
    fn a_slanted_edge_is_one_line() {
        let covered = |i: usize| (20.0 + ((i / 40) as f64 + 0.5) / 4.0 - (i % 40) as f64).clamp(0.0, 1.0);
        let inside: Vec<bool> = (0..1600).map(|i| covered(i) >= 0.5).collect();
        let mask =
            Mask { width: 40, height: 40, inside: &inside, covered: |i, _| covered(i), shade: |_| None };
        let outlines = mask.outlines();
        // The corners are cut; the edge itself has a corner at most.
        assert!(outlines.len() == 1 && outlines[0].len() <= 9, "{outlines:?}");
    }

    #[test]
    fn a_shade_ends_where_the_light_passes_its_limit() {
        let shade = |i: usize| 2.2 - ((i % 5) as f64 + 0.5);
        let inside: Vec<bool> = (0..25).map(|i| shade(i) > 0.0).collect();
        let covered = |i: usize, part| if part == Part::Item || inside[i] { 1.0 } else { 0.0 };
        let mask = Mask { width: 5, height: 5, inside: &inside, covered, shade: |i| Some(shade(i)) };
        // Down between the second and the third column.
        let [x, y] = mask.crossing([2, 2], [0, 1]).at;
        assert!((x - 2.2).abs() < 1e-9 && y == 2.5, "{x} {y}");
    }
}
