//! Hidden lines: the parts of thin stems that no surface hides.

use crate::painter::Style;
use dlsys_geometry::scene::{Point, Segment, Width};

/// A stem is hidden by what is nearer by more than this part of the extent.
const NEARER: f32 = 2e-3;

/// The depths of what hides thin stems, by cell; and where the camera's x, y are: at `a x + b` and `c - a y` cells.
pub struct Visible<'a> {
    pub style: Style<'a>,
    pub depths: &'a [[f32; 1]],
    pub size: [usize; 2],
    pub placement: [f64; 3],
}

/// Places along one stem that are examined, at most.
const MOST_PIECES: f64 = 20_000.0;

impl Visible<'_> {
    /// The parts of a segment that nothing hides.
    pub fn parts(&self, segment: &Segment) -> Vec<Segment> {
        let camera = &self.style.fit.camera;
        let [a, b, c] = self.placement;
        let extent = if self.style.fit.extent > 0.0 { self.style.fit.extent } else { 1.0 };
        let at = |p: Point| {
            let seen = camera.project(p);
            ([a * seen.x + b, c - a * seen.y], (seen.z / extent) as f32)
        };
        let ([x1, y1], _) = at(segment.start);
        let ([x2, y2], _) = at(segment.end);
        let pieces = ((x2 - x1).hypot(y2 - y1)).ceil().clamp(1.0, MOST_PIECES) as usize;
        let is_seen = |k: usize| {
            let p = segment.start + (segment.end - segment.start) * ((k as f64 + 0.5) / pieces as f64);
            let ([x, y], depth) = at(p);
            let [column, row] = [x.floor(), y.floor()];
            let within =
                column >= 0.0 && row >= 0.0 && column < self.size[0] as f64 && row < self.size[1] as f64;
            !within || depth + NEARER >= self.depths[row as usize * self.size[0] + column as usize][0]
        };
        let mut parts = Vec::new();
        let mut from = None;
        for k in 0..=pieces {
            match (k < pieces && is_seen(k), from) {
                (true, None) => from = Some(k),
                (false, Some(first)) => {
                    parts.push(part(segment, first as f64 / pieces as f64, k as f64 / pieces as f64));
                    from = None;
                }
                _ => {}
            }
        }
        parts
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
