//! The order in which stems are painted, so that none is painted over what is in front of it.
//!
//! Stems are sorted by the depths of their middles. Where two overlap in the picture, that may not be their order there: a long one that runs
//! into the depth is in front of some and behind others. So pairs that overlap are found in a grid, and what is behind at the place where they do comes
//! first (Newell, Newell and Sancha 1972). There is no such order if stems overlap in a circle or pass through one another.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A stem in the picture.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Its ends, in pixels: to the right, up, and towards the viewer.
    pub ends: [[f64; 3]; 2],
    /// Half its width at its ends, and by how much its surface is nearer than its axis.
    pub radii: [f64; 2],
    pub fronts: [f64; 2],
    /// It is wide enough to hide something, and to be hidden in part.
    pub hides: bool,
    /// Number of its colour.
    pub color: usize,
}

/// Two stems are one over the other for certain if their axes are as far apart as this part of their radii, else they touch.
const APART: f64 = 0.3;
/// Cells of the grid on a side, at most; and pairs that are looked at for each stem, in the mean.
const MOST_CELLS: f64 = 512.0;
const MOST_PAIRS: usize = 400;

/// How two stems overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Overlap {
    Apart,
    /// The first is in front.
    Over,
    Under,
    /// Each is in front of the other somewhere, or they pass through one another and have different colours.
    Both,
}

/// The numbers of stems from back to front. `None` if there is no such order, or if it would take too long to find.
pub fn from_back(lines: &[Line]) -> Option<Vec<u32>> {
    let mut order: Vec<u32> = (0..lines.len() as u32).collect();
    let depth = |i: u32| lines[i as usize].ends[0][2] + lines[i as usize].ends[1][2];
    order.sort_by(|a, b| depth(*a).total_cmp(&depth(*b)).then(a.cmp(b)));
    let mut ranks = vec![0; lines.len()];
    (0..).zip(&order).for_each(|(rank, i)| ranks[*i as usize] = rank);
    // Pairs of ranks, what is behind first.
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    let is_fine = each_near(lines, |i, j| {
        match overlap(&lines[i], &lines[j]) {
            Overlap::Apart => {}
            Overlap::Over => pairs.push([ranks[j], ranks[i]]),
            Overlap::Under => pairs.push([ranks[i], ranks[j]]),
            Overlap::Both => return false,
        }
        true
    });
    if !is_fine {
        return None;
    }
    if pairs.iter().all(|[behind, front]| behind < front) {
        return Some(order);
    }
    let sorted = sorted(lines.len(), &pairs)?;
    Some(sorted.into_iter().map(|rank| order[rank as usize]).collect())
}

/// The numbers below `count`, the least that is allowed first, so that the first of each pair comes before the second. `None` if pairs make a circle.
fn sorted(count: usize, pairs: &[[u32; 2]]) -> Option<Vec<u32>> {
    let mut waits = vec![0_u32; count];
    let mut starts = vec![0_u32; count + 1];
    for [before, after] in pairs {
        waits[*after as usize] += 1;
        starts[*before as usize + 1] += 1;
    }
    for i in 0..count {
        starts[i + 1] += starts[i];
    }
    let mut places = starts.clone();
    let mut after = vec![0_u32; pairs.len()];
    for [first, second] in pairs {
        let place = &mut places[*first as usize];
        after[*place as usize] = *second;
        *place += 1;
    }
    let mut free: BinaryHeap<Reverse<u32>> =
        (0..count as u32).filter(|i| waits[*i as usize] == 0).map(Reverse).collect();
    let mut found = Vec::with_capacity(count);
    while let Some(Reverse(i)) = free.pop() {
        found.push(i);
        let [from, to] = [starts[i as usize], starts[i as usize + 1]].map(|place| place as usize);
        for &next in &after[from..to] {
            waits[next as usize] -= 1;
            if waits[next as usize] == 0 {
                free.push(Reverse(next));
            }
        }
    }
    (found.len() == count).then_some(found)
}

impl Line {
    /// Left, bottom, right and top.
    fn bounds(&self) -> [f64; 4] {
        let [[x1, y1, _], [x2, y2, _]] = self.ends;
        let r = self.radii[0].max(self.radii[1]);
        [x1.min(x2) - r, y1.min(y2) - r, x1.max(x2) + r, y1.max(y2) + r]
    }

    /// Depth, radius and front at a place from 0 to 1.
    fn at(&self, s: f64) -> [f64; 3] {
        let of = |k: usize| [self.ends[k][2], self.radii[k], self.fronts[k]];
        let [a, b] = [of(0), of(1)];
        [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * s)
    }

    /// The place from 0 to 1 that is next to a point of the picture, and its distance.
    fn next_to(&self, [x, y, _]: [f64; 3]) -> (f64, f64) {
        let [[x1, y1, _], [x2, y2, _]] = self.ends;
        let (dx, dy) = (x2 - x1, y2 - y1);
        let square = dx * dx + dy * dy;
        let s = if square > 0.0 { (((x - x1) * dx + (y - y1) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
        (s, (x1 + s * dx - x).hypot(y1 + s * dy - y))
    }
}

/// How two stems overlap, as far as it is certain. What begins where the other ends or begins touches it there.
fn overlap(a: &Line, b: &Line) -> Overlap {
    let mut found = Overlap::Apart;
    let is_joined = a.ends.iter().any(|end| b.ends.contains(end));
    let mut look = |s: f64, t: f64, distance: f64| {
        let ([z, r, front], [other, radius, far]) = (a.at(s), b.at(t));
        if distance >= r + radius {
            return;
        }
        let (apart, near) = (z - other, front + far);
        let this = match apart > 0.0 {
            _ if apart.abs() < APART * near => {
                if is_joined {
                    return;
                } else {
                    Overlap::Both
                }
            }
            true => Overlap::Over,
            false => Overlap::Under,
        };
        found = if found == Overlap::Apart || found == this { this } else { Overlap::Both };
    };
    for (k, end) in a.ends.iter().enumerate().filter(|(_, end)| !b.ends.contains(end)) {
        let (t, distance) = b.next_to(*end);
        look(k as f64, t, distance);
    }
    for (k, end) in b.ends.iter().enumerate().filter(|(_, end)| !a.ends.contains(end)) {
        let (s, distance) = a.next_to(*end);
        look(s, k as f64, distance);
    }
    let [[px, py, _], [p2x, p2y, _]] = a.ends;
    let [[qx, qy, _], [q2x, q2y, _]] = b.ends;
    let ([ax, ay], [bx, by], [cx, cy]) = ([p2x - px, p2y - py], [q2x - qx, q2y - qy], [qx - px, qy - py]);
    let wide = ax * by - ay * bx;
    let (s, t) = ((cx * by - cy * bx) / wide, (cx * ay - cy * ax) / wide);
    if !is_joined && (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        look(s, t, 0.0);
    }
    // Of one colour it does not show.
    let shows = a.hides && b.hides && a.color != b.color;
    if found == Overlap::Both && !shows { Overlap::Apart } else { found }
}

/// A grid over the picture, and the stems that hide something in each cell.
struct Grid {
    corner: [f64; 2],
    side: f64,
    size: [usize; 2],
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Grid {
    fn new(lines: &[Line]) -> Option<Grid> {
        let all = lines.iter().map(Line::bounds);
        let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let [left, bottom, right, top] =
            all.fold(start, |a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
        let hiders = || lines.iter().filter(|line| line.hides).map(Line::bounds);
        let count = hiders().count();
        if count == 0 || ![left, bottom, right, top].into_iter().all(f64::is_finite) {
            return None;
        }
        let mean = hiders().map(|[l, b, r, t]| (r - l).max(t - b)).sum::<f64>() / count as f64;
        let side = mean.max((right - left).max(top - bottom) / MOST_CELLS).max(f64::MIN_POSITIVE);
        let size = [right - left, top - bottom].map(|length| (length / side) as usize + 1);
        let (starts, items) = (vec![0; size[0] * size[1] + 1], Vec::new());
        let mut grid = Grid { corner: [left, bottom], side, size, starts, items };
        let hiders = || (0..).zip(lines).filter(|(_, line)| line.hides);
        for (_, line) in hiders() {
            let range = grid.range(line.bounds());
            grid.cells(range).for_each(|cell| grid.starts[cell + 1] += 1);
        }
        for cell in 1..grid.starts.len() {
            grid.starts[cell] += grid.starts[cell - 1];
        }
        grid.items = vec![0; grid.starts.last().map_or(0, |count| *count as usize)];
        let mut places = grid.starts.clone();
        for (i, line) in hiders() {
            for cell in grid.cells(grid.range(line.bounds())) {
                grid.items[places[cell] as usize] = i;
                places[cell] += 1;
            }
        }
        Some(grid)
    }

    /// First column and row, and last ones, of the cells that a stem with these bounds may be in.
    fn range(&self, [left, bottom, right, top]: [f64; 4]) -> [usize; 4] {
        let cell = |x: f64, k: usize| (((x - self.corner[k]) / self.side) as usize).min(self.size[k] - 1);
        [cell(left, 0), cell(bottom, 1), cell(right, 0), cell(top, 1)]
    }

    fn cells(&self, [left, bottom, right, top]: [usize; 4]) -> impl Iterator<Item = usize> + use<> {
        let width = self.size[0];
        (bottom..=top).flat_map(move |row| (left..=right).map(move |column| row * width + column))
    }
}

/// Passes on pairs of stems that may overlap, one of which hides something, each once, until one of them is refused or there are too many: false then.
fn each_near(lines: &[Line], mut pass: impl FnMut(usize, usize) -> bool) -> bool {
    let Some(grid) = Grid::new(lines) else { return true };
    let places: Vec<([f64; 4], [usize; 4])> =
        lines.iter().map(|line| (line.bounds(), grid.range(line.bounds()))).collect();
    let mut left = MOST_PAIRS * lines.len();
    for (i, line) in lines.iter().enumerate() {
        let (bounds, range) = places[i];
        for cell in grid.cells(range) {
            let [from, to] = [grid.starts[cell], grid.starts[cell + 1]].map(|place| place as usize);
            let Some(rest) = left.checked_sub(to - from) else { return false };
            left = rest;
            for &j in &grid.items[from..to] {
                // A pair of two that hide is found from both.
                if j as usize == i || line.hides && (j as usize) < i {
                    continue;
                }
                let (its, other_range) = places[j as usize];
                if its[0] > bounds[2] || its[2] < bounds[0] || its[1] > bounds[3] || its[3] < bounds[1] {
                    continue;
                }
                // In the first of the cells that both may be in.
                let first = range[1].max(other_range[1]) * grid.size[0] + range[0].max(other_range[0]);
                if first == cell && !pass(i, j as usize) {
                    return false;
                }
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stems two pixels wide between these places, each of a colour of its own.
    fn lines(ends: &[[[f64; 3]; 2]]) -> Vec<Line> {
        let line = |(color, ends): (usize, &[[f64; 3]; 2])| Line {
            ends: *ends,
            radii: [1.0; 2],
            fronts: [1.0; 2],
            hides: true,
            color,
        };
        ends.iter().enumerate().map(line).collect()
    }

    /// In the order of the depths of their middles this one, which runs into the depth, would come first.
    const STEEP: [[f64; 3]; 2] = [[0.0, 0.0, -100.0], [100.0, 0.0, 40.0]];

    #[test]
    fn what_is_behind_where_two_overlap_comes_first() {
        let behind = [[90.0, -10.0, 0.0], [90.0, 10.0, 0.0]];
        let front = [[50.0, -10.0, -20.0], [50.0, 10.0, -20.0]];
        let apart = [[20.0, 20.0, -200.0], [20.0, 90.0, -200.0]];
        assert_eq!(from_back(&lines(&[behind, STEEP])), Some(vec![0, 1]));
        assert_eq!(from_back(&lines(&[front, STEEP, behind, apart])), Some(vec![3, 2, 1, 0]));
        // In the picture side by side: their middles tell.
        let beside = [[90.0, 3.0, 0.0], [90.0, 10.0, 0.0]];
        assert_eq!(from_back(&lines(&[beside, STEEP])), Some(vec![1, 0]));
    }

    #[test]
    fn stems_that_overlap_in_a_circle_have_no_order() {
        let circle = [
            [[0.0, 0.0, 0.0], [100.0, 0.0, 20.0]],
            [[90.0, -10.0, 0.0], [90.0, 90.0, 20.0]],
            [[100.0, 80.0, 0.0], [-10.0, -10.0, 20.0]],
        ];
        assert_eq!(from_back(&lines(&circle)), None);
        assert!(from_back(&lines(&circle[..2])).is_some());
    }

    #[test]
    fn stems_that_pass_through_one_another_have_an_order_only_if_that_does_not_show() {
        let mut crossed = lines(&[STEEP, [[50.0, -10.0, -30.0], [50.0, 10.0, -30.0]]]);
        assert_eq!(from_back(&crossed), None);
        crossed[1].color = 0;
        assert_eq!(from_back(&crossed), Some(vec![0, 1]));
        crossed[1] = Line { hides: false, color: 1, ..crossed[1] };
        assert_eq!(from_back(&crossed), Some(vec![0, 1]));
        // A branch touches its stem where it begins.
        let forked = lines(&[STEEP, [[100.0, 0.0, 40.0], [110.0, 30.0, 0.0]]]);
        assert_eq!(from_back(&forked), Some(vec![0, 1]));
    }

    #[test]
    fn many_pairs_are_found_in_the_grid_as_without_it() {
        // Pseudo-random.
        let mut state = 7_u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut end = || [300.0 * number(), 200.0 * number(), 1000.0 * number()];
        let ends: Vec<[[f64; 3]; 2]> = (0..120)
            .map(|i| {
                let [from, to] = [end(), end()];
                let part = if i % 10 == 0 { 1.0 } else { 0.1 };
                [from, [0, 1, 2].map(|k| from[k] + part * (to[k] - from[k]))]
            })
            .collect();
        let mut all = lines(&ends);
        all.iter_mut().step_by(3).for_each(|line| line.hides = false);
        let mut found = Vec::new();
        assert!(each_near(&all, |i, j| {
            found.push([i.min(j), i.max(j)]);
            true
        }));
        let count = found.len();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), count, "a pair was found twice");
        for (i, a) in all.iter().enumerate() {
            for (j, b) in all.iter().enumerate().skip(i + 1) {
                let meets = (a.hides || b.hides) && overlap(a, b) != Overlap::Apart;
                assert!(!meets || found.contains(&[i, j]), "{i} {j}");
            }
        }
    }
}
