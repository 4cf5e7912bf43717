//! Hidden lines: the parts of stems that nothing hides.

use super::regions::COVERED;
use crate::painter::Style;
use crate::stroke::{End, pixels_across};
use dlsys_geometry::scene::{Point, Segment, Width};

/// A stem is hidden by what is nearer by more than this part of the extent, and by more than its depth changes from cell to cell.
const NEARER: f64 = 2e-4;
/// How far a stem reaches under the strokes that hide it, in its widths and in cells more.
const UNDER: f64 = 2.0;
const UNDER_CELLS: f64 = 2.0;
/// Places along one stem that are examined, at most.
const MOST_PIECES: f64 = 20_000.0;
/// Places across a stem that are examined: its edges are at -1 and 1.
const ACROSS: [f64; 5] = [0.0, -0.4, 0.4, -0.8, 0.8];
/// A stem that looks shorter than this, in widths, has more to see than the shades across it: its ends.
const SHORTEST: f64 = 2.0;
/// How far from the end of a stem its dome is examined, in radii.
const DOME: f64 = 0.6;
/// Sine of the angle between a stem and the view, as far as it counts: of stems that are seen nearly end on it would be 0.
const LEAST_SLANT: f64 = 0.2;
/// Most of the steps along a thin stem at which only a part of its width may be hidden.
const MOST_CUT: f64 = 0.2;
/// Most of the places on a stem that may be hidden though it counts as one that nothing hides.
const MOST_HIDDEN: f64 = 0.06;

/// The depths of what hides stems, by cell; and where the camera's x, y are: at `a x + b` and `c - a y` cells.
pub struct Visible<'a> {
    pub style: Style<'a>,
    pub depths: &'a [f32],
    /// The regions of cells, if they are known.
    pub labels: &'a [u32],
    pub size: [usize; 2],
    pub placement: [f64; 3],
}

/// A part of a segment, and the shapes of its ends.
pub type Part = (Segment, [End; 2]);

/// The side of a stem that is seen at a slant is further in front of its axis than its radius.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slant {
    /// So it hides itself: its bends and forks are much of what is seen of it, and a stroke has none.
    Hides,
    /// What is a stroke does not hide itself.
    Counts,
    /// Nor does it there, and its sides are further away than what is between them.
    Rounds,
}

/// Which places on a stem are visible, in steps along it.
struct Seen {
    /// By step: the number of visible places across, and whether the one on the axis is visible.
    steps: Vec<(usize, bool)>,
    /// By step: which of the places across are visible, as bits.
    masks: Vec<u8>,
    /// By step: whether the axis is visible or hidden by a stroke.
    open: Vec<bool>,
}

impl Visible<'_> {
    /// Whether nothing hides a segment, but for its ends, and it looks like a stem. A segment that is hidden altogether is not visible.
    pub fn is_clear(&self, segment: &Segment) -> bool {
        if self.length(segment) < SHORTEST * pixels_across(segment, self.style) {
            return false;
        }
        let seen = self.seen(segment, &ACROSS, Slant::Hides);
        let Some([first, end]) = seen.range() else { return false };
        let steps = &seen.steps[first..end];
        let visible: usize = steps.iter().map(|(count, _)| count).sum();
        let all = steps.len() * ACROSS.len();
        (all - visible) as f64 <= MOST_HIDDEN * all as f64
    }

    /// The length that a segment has in the picture, in pixels of the page.
    pub fn length(&self, segment: &Segment) -> f64 {
        let [from, to] = [segment.start, segment.end].map(|p| self.style.fit.camera.project(p));
        (to - from).xy().norm() * self.style.pixels
    }

    /// Whether what hides a thin segment hides its whole width, but for a few places: its visible parts are then strokes.
    pub fn is_cut_across(&self, segment: &Segment) -> bool {
        let seen = self.seen(segment, &ACROSS, Slant::Hides);
        let cut = |(count, _): &&(usize, bool)| (1..ACROSS.len()).contains(count);
        seen.steps.iter().filter(cut).count() as f64 <= MOST_CUT * seen.steps.len() as f64
    }

    /// The parts of a segment that nothing hides, and the shapes of their ends: those of the segment where they are its own. A wide
    /// segment is clear, so it is one part.
    pub fn parts(&self, segment: &Segment, ends: [End; 2], is_thin: bool) -> Vec<Part> {
        let across = if is_thin { &ACROSS[..1] } else { &ACROSS[..] };
        let seen = self.seen(segment, across, Slant::Counts);
        let count = seen.steps.len();
        let [a, ..] = self.placement;
        let reach = UNDER_CELLS + UNDER * pixels_across(segment, self.style) / self.style.pixels * a;
        let ranges = if is_thin { seen.on_axis(reach as usize) } else { seen.range().into_iter().collect() };
        ranges.into_iter().map(|range| self.cut(segment, ends, range, count)).collect()
    }

    /// The parts of a segment that are visible, which end aslant where something hides it aslant; and those of which a part of the width is visible, and
    /// a little more. A hair line has no width to hide in part.
    pub fn over_and_under(&self, segment: &Segment, ends: [End; 2], is_hair: bool) -> [Vec<Part>; 2] {
        if self.is_beside(segment) {
            return [vec![(segment.clone(), ends)], Vec::new()];
        }
        let across = if is_hair { &ACROSS[..1] } else { &ACROSS[..] };
        let Seen { steps, masks, .. } = self.seen(segment, across, Slant::Rounds);
        let [a, ..] = self.placement;
        let radius = pixels_across(segment, self.style) / self.style.pixels * a / 2.0;
        let reach = (UNDER_CELLS + 2.0 * radius) as usize;
        let whole: Vec<Part> = runs(masks.iter().map(|mask| *mask != 0))
            .into_iter()
            .flat_map(|run| without_gaps(&masks, run))
            .map(|run| {
                let (part, mut shapes) = self.cut(segment, ends, run, steps.len());
                for (shape, aslant) in shapes.iter_mut().zip(slants(&masks, run)) {
                    let percent = |steps: i32| (f64::from(steps) / radius * 100.0) as i32;
                    if !is_hair && aslant != [0; 5] {
                        *shape = End::Slant(aslant.map(percent));
                    }
                }
                (part, shapes)
            })
            .collect();
        let mut cut = runs(steps.iter().map(|(count, _)| (1..across.len()).contains(count)));
        for [first, end] in &mut cut {
            (*first, *end) = (first.saturating_sub(reach), (*end + reach).min(steps.len()));
        }
        let under = cut.into_iter().map(|range| self.cut(segment, ends, range, steps.len())).collect();
        [whole, under]
    }

    /// Whether a segment is outside of the raster, where nothing hides it.
    fn is_beside(&self, segment: &Segment) -> bool {
        let [a, b, c] = self.placement;
        let radius = 1.0 + [0, 1].map(|k| self.front_cells(segment, k)).into_iter().fold(0.0, f64::max);
        let ends = [segment.start, segment.end].map(|p| self.style.fit.camera.project(p));
        let ends = ends.map(|p| [a * p.x + b, c - a * p.y]);
        (0..2).any(|k| {
            let size = self.size[k] as f64;
            ends.iter().all(|end| end[k] < -radius) || ends.iter().all(|end| end[k] > size + radius)
        })
    }

    /// Half the width of a segment at one of its ends, in cells.
    fn front_cells(&self, segment: &Segment, end: usize) -> f64 {
        let camera = &self.style.fit.camera;
        let z = camera.project([segment.start, segment.end][end]).z;
        let radius = segment.widths[end].resolve(self.style.fit.default_width) / 2.0;
        radius * camera.magnification(z) * self.placement[0]
    }

    /// The part of a segment between two of so many steps along it, and the shapes of its ends.
    fn cut(&self, segment: &Segment, ends: [End; 2], [first, end]: [usize; 2], count: usize) -> Part {
        let [from, to] = [first, end].map(|k| k as f64 / count as f64);
        let shape = |is_own: bool, k: usize| match ends[k] {
            End::Round if is_own && !self.has_dome(segment, k) => End::Straight,
            end if is_own => end,
            _ => End::Straight,
        };
        (part(segment, from, to), [shape(first == 0, 0), shape(end == count, 1)])
    }

    /// Whether the dome at one end of a segment is visible.
    fn has_dome(&self, segment: &Segment, end: usize) -> bool {
        let radius = segment.widths[end].resolve(self.style.fit.default_width) / 2.0;
        let (from, sign) = if end == 0 { (segment.start, -1.0) } else { (segment.end, 1.0) };
        let [a, b, c] = self.placement;
        let camera = &self.style.fit.camera;
        let at = from + segment.direction * (sign * DOME * radius);
        let (seen, towards) = (camera.project(at), camera.towards(at));
        // From there to the surface of the dome, or to that of the stem, if it is before the dome.
        let cosine = sign * segment.direction.dot(&towards);
        let ahead = DOME * cosine;
        let dome = (ahead * ahead + 1.0 - DOME * DOME).sqrt() - ahead;
        let stem = if cosine < 0.0 { 1.0 / (1.0 - cosine * cosine).sqrt().max(LEAST_SLANT) } else { 0.0 };
        let front = camera.project(at + towards * (radius * dome.max(stem))).z;
        self.is_seen([a * seen.x + b, c - a * seen.y], front / self.extent())
    }

    fn extent(&self) -> f64 {
        if self.style.fit.extent > 0.0 { self.style.fit.extent } else { 1.0 }
    }

    /// The cell at a place of the raster.
    fn cell(&self, [x, y]: [f64; 2]) -> Option<usize> {
        let [column, row] = [x.floor(), y.floor()];
        let within = column >= 0.0 && row >= 0.0 && column < self.size[0] as f64 && row < self.size[1] as f64;
        within.then(|| row as usize * self.size[0] + column as usize)
    }

    /// Whether nothing hides what is at this depth, in parts of the extent, at a place of the raster.
    fn is_seen(&self, place: [f64; 2], depth: f64) -> bool {
        self.cell(place).is_none_or(|cell| (depth + NEARER) as f32 >= self.depths[cell])
    }

    /// How much nearer than the axis the side of a stem is in front of it, at one of its ends.
    fn front(&self, segment: &Segment, end: usize) -> f64 {
        let camera = &self.style.fit.camera;
        let at = [segment.start, segment.end][end];
        let radius = segment.widths[end].resolve(self.style.fit.default_width) / 2.0;
        let towards = camera.towards(at);
        let sine = segment.direction.cross(&towards).norm().max(LEAST_SLANT);
        camera.project(at + towards * (radius / sine)).z - camera.project(at).z
    }

    /// Which places on a segment are visible.
    fn seen(&self, segment: &Segment, across: &[f64], slant: Slant) -> Seen {
        let camera = &self.style.fit.camera;
        let [a, b, c] = self.placement;
        let extent = self.extent();
        let at = |p: Point| {
            let seen = camera.project(p);
            ([a * seen.x + b, c - a * seen.y], seen.z / extent)
        };
        let ([x1, y1], z1) = at(segment.start);
        let ([x2, y2], z2) = at(segment.end);
        let length = (x2 - x1).hypot(y2 - y1);
        let pieces = length.ceil().clamp(1.0, MOST_PIECES) as usize;
        // In cells.
        let radius = pixels_across(segment, self.style) / self.style.pixels * a / 2.0;
        let fronts = match slant {
            Slant::Hides => [radius / a / extent; 2],
            Slant::Counts | Slant::Rounds => [0, 1].map(|k| self.front(segment, k) / extent),
        };
        let front = |k: usize| fronts[0] + (fronts[1] - fronts[0]) * ((k as f64 + 0.5) / pieces as f64);
        let aside = if length > 0.0 { [(y2 - y1) / length, (x1 - x2) / length] } else { [1.0, 0.0] };
        let place =
            |k: usize| segment.start + (segment.end - segment.start) * ((k as f64 + 0.5) / pieces as f64);
        // Within a cell the depth of a stem changes.
        let slope = ((z2 - z1) / pieces as f64).abs();
        let step = |k: usize| {
            let ([x, y], depth) = at(place(k));
            let place = |u: &f64| [x + aside[0] * radius * u, y + aside[1] * radius * u];
            let part = |u: &f64| if slant == Slant::Rounds { (1.0 - u * u).sqrt() } else { 1.0 };
            let is_seen = |u: &f64| self.is_seen(place(u), depth + front(k) * part(u) + slope);
            (0..).zip(across).fold(0, |mask, (bit, u)| mask | u8::from(is_seen(u)) << bit)
        };
        let is_stroke = |k: usize| {
            let cell = self.cell(at(place(k)).0);
            cell.and_then(|cell| self.labels.get(cell)) == Some(&COVERED)
        };
        let masks: Vec<u8> = (0..pieces).map(step).collect();
        let steps: Vec<(usize, bool)> =
            masks.iter().map(|mask| (mask.count_ones() as usize, mask & 1 == 1)).collect();
        let open = (0..pieces).map(|k| steps[k].1 || is_stroke(k)).collect();
        Seen { steps, masks, open }
    }
}

impl Seen {
    /// The first step of which something is visible, and the one after the last.
    fn range(&self) -> Option<[usize; 2]> {
        let is_seen = |(count, _): &(usize, bool)| *count > 0;
        let first = self.steps.iter().position(is_seen)?;
        let end = self.steps.iter().rposition(is_seen)? + 1;
        Some([first, end])
    }

    /// Runs of steps whose middle is visible, each going on for so many steps under the strokes that hide it.
    fn on_axis(&self, reach: usize) -> Vec<[usize; 2]> {
        let mut shown: Vec<bool> = self.steps.iter().map(|(_, on_axis)| *on_axis).collect();
        let mut extend = |order: &mut dyn Iterator<Item = usize>| {
            let mut left = 0;
            for k in order {
                match self.steps[k].1 {
                    true => left = reach,
                    false if left > 0 && self.open[k] => {
                        left -= 1;
                        shown[k] = true;
                    }
                    false => left = 0,
                }
            }
        };
        extend(&mut (0..self.steps.len()));
        extend(&mut (0..self.steps.len()).rev());
        runs(shown.into_iter())
    }
}

/// The runs of what is true: the first of each, and the one after its last.
fn runs(all: impl Iterator<Item = bool>) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (k, _) in all.enumerate().filter(|(_, is_in)| *is_in) {
        match runs.last_mut() {
            Some([_, end]) if *end == k => *end = k + 1,
            _ => runs.push([k, k + 1]),
        }
    }
    runs
}

/// The order of the places across from one side to the other.
const ASIDE: [usize; 5] = [3, 1, 0, 2, 4];

/// A run of steps in pieces, in each of which what is visible of each place across hangs together.
fn without_gaps(masks: &[u8], [first, end]: [usize; 2]) -> Vec<[usize; 2]> {
    let mut cuts = vec![first, end];
    for bit in 0..ACROSS.len() {
        let parts = runs(masks[first..end].iter().map(|mask| mask >> bit & 1 == 1));
        cuts.extend(parts.windows(2).map(|pair| first + (pair[0][1] + pair[1][0]) / 2));
    }
    cuts.sort_unstable();
    cuts.dedup();
    cuts.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// How many steps from the first and from the last of a run the first and the last that are visible are, by place across.
fn slants(masks: &[u8], [first, end]: [usize; 2]) -> [[i32; 5]; 2] {
    let mut slants = [[0; 5]; 2];
    for (k, bit) in ASIDE.into_iter().enumerate() {
        let mut seen = (first..end).filter(|step| masks[*step] >> bit & 1 == 1);
        let middle = usize::midpoint(first, end);
        let from = seen.next();
        let [from, to] = [from.unwrap_or(middle), seen.next_back().or(from).map_or(middle, |last| last + 1)];
        slants[0][k] = (from - first) as i32;
        slants[1][k] = to as i32 - end as i32;
    }
    slants
}

/// The part of a segment between two places from 0 to 1.
fn part(segment: &Segment, from: f64, to: f64) -> Segment {
    if from == 0.0 && to == 1.0 {
        return segment.clone();
    }
    let place = |s: f64| segment.start + (segment.end - segment.start) * s;
    let width = |s: f64| match segment.widths {
        [Width::Set(a), Width::Set(b)] => Width::Set(a + (b - a) * s),
        [first, _] => first,
    };
    Segment { start: place(from), end: place(to), widths: [width(from), width(to)], ..segment.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_parted_where_a_place_across_is_hidden_for_a_while() {
        let masks = [0, 0b11111, 0b11110, 0b11110, 0b11111, 0];
        let found = runs(masks.iter().map(|mask| *mask != 0));
        assert_eq!(found, [[1, 5]]);
        assert_eq!(without_gaps(&masks, found[0]), [[1, 3], [3, 5]]);
        assert_eq!(without_gaps(&masks[..4], [1, 4]), [[1, 4]]);
    }

    #[test]
    fn an_end_is_aslant_as_its_places_across_are_visible() {
        // The left side, at -0.8, is visible from the first step on, the right side from the last.
        let masks = [0b01000, 0b01010, 0b01011, 0b01111, 0b11111];
        assert_eq!(slants(&masks, [0, 5]), [[0, 1, 2, 3, 4], [0; 5]]);
        let back: Vec<u8> = masks.iter().rev().copied().collect();
        assert_eq!(slants(&back, [0, 5]), [[0; 5], [0, -1, -2, -3, -4]]);
        // A place that is visible nowhere takes no room.
        assert_eq!(slants(&[0b00001; 4], [0, 4]), [[2, 2, 0, 2, 2], [-2, -2, 0, -2, -2]]);
    }
}
