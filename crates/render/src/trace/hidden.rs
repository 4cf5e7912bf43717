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
    pub depths: &'a [[f32; 1]],
    /// The regions of cells, if they are known.
    pub labels: &'a [u32],
    pub size: [usize; 2],
    pub placement: [f64; 3],
}

/// The side of a stem that is seen at a slant is further in front of its axis than its radius.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slant {
    /// So it hides itself: its bends and forks are much of what is seen of it, and a stroke has none.
    Hides,
    /// What is a stroke does not hide itself.
    Counts,
}

/// Which places on a stem are visible, in steps along it.
struct Seen {
    /// By step: the number of visible places across, and whether the one on the axis is visible.
    steps: Vec<(usize, bool)>,
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
    pub fn parts(&self, segment: &Segment, ends: [End; 2], is_thin: bool) -> Vec<(Segment, [End; 2])> {
        let across = if is_thin { &ACROSS[..1] } else { &ACROSS[..] };
        let seen = self.seen(segment, across, Slant::Counts);
        let count = seen.steps.len();
        let [a, ..] = self.placement;
        let reach = UNDER_CELLS + UNDER * pixels_across(segment, self.style) / self.style.pixels * a;
        let ranges = if is_thin { seen.on_axis(reach as usize) } else { seen.range().into_iter().collect() };
        let cut = |[first, end]: [usize; 2]| {
            let [from, to] = [first, end].map(|k| k as f64 / count as f64);
            let shape = |is_own: bool, k: usize| match ends[k] {
                End::Round if is_own && !self.has_dome(segment, k) => End::Straight,
                end if is_own => end,
                _ => End::Straight,
            };
            (part(segment, from, to), [shape(first == 0, 0), shape(end == count, 1)])
        };
        ranges.into_iter().map(cut).collect()
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
        self.cell(place).is_none_or(|cell| (depth + NEARER) as f32 >= self.depths[cell][0])
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
            Slant::Counts => [0, 1].map(|k| self.front(segment, k) / extent),
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
            let mut visible = across.iter().map(|u| self.is_seen(place(u), depth + front(k) + slope));
            let on_axis = visible.next().unwrap_or(false);
            (usize::from(on_axis) + visible.filter(|seen| *seen).count(), on_axis)
        };
        let is_stroke = |k: usize| {
            let cell = self.cell(at(place(k)).0);
            cell.and_then(|cell| self.labels.get(cell)) == Some(&COVERED)
        };
        let steps: Vec<(usize, bool)> = (0..pieces).map(step).collect();
        let open = (0..pieces).map(|k| steps[k].1 || is_stroke(k)).collect();
        Seen { steps, open }
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
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for k in (0..shown.len()).filter(|k| shown[*k]) {
            match runs.last_mut() {
                Some([_, end]) if *end == k => *end = k + 1,
                _ => runs.push([k, k + 1]),
            }
        }
        runs
    }
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
