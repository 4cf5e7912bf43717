//! A band of rows: which triangle is seen at each sample, then the colours of its pixels.
//!
//! Most pixels are within one triangle. Such a pixel holds the number of the triangle and bounds of its depth; only when an edge crosses it, or
//! when another triangle passes through the first, it holds several ([`Fragments`]). A pixel whose farthest sample is nearer than a triangle
//! is passed at once.

use std::ops::Range;

use super::fragments::{Cover, Fragment, Fragments, Places, places};
use super::plane::{Plane, Ready};
use super::{BAND, EQUAL, Pattern, Place, STEPS, Triangles};
use crate::mapping::Cut;
use dlsys_geometry::scene::Drawn;

/// Nothing is drawn in the pixel.
const NOTHING: u32 = u32::MAX;
/// Several triangles share the pixel.
const MIXED: u32 = u32::MAX - 1;

/// A pixel as a whole.
#[derive(Clone, Copy)]
struct Pixel {
    /// The triangle that covers all of it, by its place in the band's list; or [`NOTHING`], or [`MIXED`].
    seen: u32,
    /// No sample is farther, none nearer.
    far: f32,
    near: f32,
}

const EMPTY: Pixel = Pixel { seen: NOTHING, far: f32::NEG_INFINITY, near: f32::NEG_INFINITY };

/// The samples of some rows.
pub(super) struct Band<const N: usize> {
    places: Places<N>,
    width: usize,
    pixels: Vec<Pixel>,
    /// Of pixels that several triangles share.
    shared: Vec<Fragments<N>>,
    /// Of the triangles that are seen or were, by their places in the list.
    planes: Vec<Plane>,
    /// First column in which something may be drawn, and the one after the last: most of a picture is empty.
    touched: [usize; 2],
}

impl<const N: usize> Band<N> {
    pub(super) fn new(pattern: &Pattern<N>, width: usize) -> Band<N> {
        Band {
            places: places(pattern),
            width,
            pixels: vec![EMPTY; width * BAND],
            shared: vec![Fragments::EMPTY; width * BAND],
            planes: Vec::new(),
            touched: [0; 2],
        }
    }

    /// Draws these triangles in these rows, which were empty.
    pub(super) fn draw(&mut self, triangles: &impl Triangles, numbers: &[u32], rows: Range<usize>) {
        let [first, end] = std::mem::take(&mut self.touched);
        for row in self.pixels.chunks_exact_mut(self.width.max(1)) {
            row[first..end].fill(EMPTY);
        }
        self.planes.clear();
        self.planes.resize(numbers.len(), Plane::NONE);
        for place in nearest_first(triangles, numbers) {
            let number = numbers[place] as usize;
            let corners = triangles.corners(number);
            let Some(ready) = Ready::new(corners, self.width, &rows) else { continue };
            self.planes[place] = ready.plane;
            let place = place as u32;
            let [first, last] = ready.columns;
            let [from, end] = self.touched;
            self.touched = if from == end { [first, last + 1] } else { [from.min(first), end.max(last + 1)] };
            self.fill(&ready, triangles.cut(number, N).as_ref(), place, rows.start);
        }
    }

    /// Draws a triangle.
    fn fill(&mut self, ready: &Ready, cut: Option<&Cut<'_>>, place: u32, top: usize) {
        let plane = ready.plane;
        let [lowest, highest] = plane.reach();
        let sides = ready.sides;
        let mut cover: Option<Cover<N>> = None;
        // What the samples of a pixel add to a side's function: no less, and no more.
        let least = sides.map(|[_, a, b]| (a.min(0) + b.min(0)) * STEPS);
        let most = sides.map(|[_, a, b]| (a.max(0) + b.max(0)) * STEPS);
        let mut start = sides.map(|side| side[0]);
        for row in ready.rows[0]..=ready.rows[1] {
            let mut corner = start;
            let mut entered = false;
            let line = (row - top) * self.width;
            for column in ready.columns[0]..=ready.columns[1] {
                let here = corner;
                (0..3).for_each(|k| corner[k] += sides[k][1] * STEPS);
                if (here[0] + most[0]) | (here[1] + most[1]) | (here[2] + most[2]) < 0 {
                    if entered {
                        break;
                    }
                    continue;
                }
                entered = true;
                let base = plane.at([column, row]);
                let (far, near) = (plane.bounded(base + lowest), plane.bounded(base + highest));
                let pixel = &mut self.pixels[line + column];
                if near + EQUAL < pixel.far {
                    continue;
                }
                let drawn = cut.map_or(Drawn::All, |cut| cut.in_pixel([column, row]));
                if drawn == Drawn::Nothing {
                    continue;
                }
                let is_full = drawn == Drawn::All
                    && (here[0] + least[0]) | (here[1] + least[1]) | (here[2] + least[2]) >= 0;
                let is_later = pixel.seen != MIXED && place > pixel.seen;
                let is_nearer = far > pixel.near + EQUAL || (is_later && far + EQUAL >= pixel.near);
                if is_full && (pixel.seen == NOTHING || is_nearer) {
                    *pixel = Pixel { seen: place, far, near: near.max(pixel.near) };
                    continue;
                }
                let covered = cover.get_or_insert_with(|| Cover::new(&sides, &self.places)).mask(here);
                let mask = match cut.filter(|_| drawn == Drawn::Some) {
                    Some(cut) => left_of(cut, covered, [column, row], &self.places),
                    None => covered,
                };
                if mask == 0 {
                    continue;
                }
                let shared = &mut self.shared[line + column];
                if pixel.seen != MIXED {
                    shared.begin((pixel.seen != NOTHING).then_some((pixel.seen, pixel.far)));
                    pixel.seen = MIXED;
                }
                let new = Fragment { place, mask, far, near };
                if let Some(far) = shared.add(new, &self.planes, &self.places, [column, row]) {
                    pixel.far = far;
                }
                pixel.near = if near > pixel.near { near } else { pixel.near };
            }
            (0..3).for_each(|k| start[k] += sides[k][2] * STEPS);
        }
    }

    /// The pixels of the rows from `top`. They are transparent before.
    pub(super) fn resolve(
        &self,
        triangles: &impl Triangles,
        numbers: &[u32],
        top: usize,
        pixels: &mut [[u8; 4]],
    ) {
        // Where something is drawn in front of nothing, too, all columns count.
        let [first, end] = if triangles.is_veiled() { [0, self.width] } else { self.touched };
        let mut between = Between::default();
        let mut color = |place: u32, pixel: [usize; 2]| {
            let number = numbers[place as usize] as usize;
            let weights = between.weights(number, || triangles.corners(number), pixel);
            triangles.shade(number, pixel, weights)
        };
        for (line, pixels) in pixels.chunks_exact_mut(self.width.max(1)).enumerate() {
            for (column, pixel) in pixels.iter_mut().enumerate().take(end).skip(first) {
                let at = [column, top + line];
                let index = line * self.width + column;
                *pixel = match self.pixels[index].seen {
                    NOTHING => match triangles.is_veiled() {
                        true => triangles.open(at),
                        false => continue,
                    },
                    MIXED => {
                        let surface = |place: u32| triangles.surface(numbers[place as usize] as usize);
                        self.shared[index].mean(surface, |place| color(place, at), || triangles.open(at))
                    }
                    place => color(place, at),
                };
            }
        }
    }
}

/// The samples of a mask that are not cut out.
pub(super) fn left_of<const N: usize>(
    cut: &Cut<'_>,
    mask: u32,
    [column, row]: [usize; 2],
    [xs, ys]: &Places<N>,
) -> u32 {
    let mut left = 0;
    for s in (0..N).filter(|s| mask >> s & 1 == 1) {
        let at = |pixel: usize, step: f32| pixel as f64 + f64::from(step) / STEPS as f64;
        left |= u32::from(cut.is_drawn([at(column, xs[s]), at(row, ys[s])])) << s;
    }
    left
}

/// Triangles by their places in a list, those of a surface together, and surfaces that come nearer first: what is behind is then passed
/// without looking at samples.
fn nearest_first(triangles: &impl Triangles, numbers: &[u32]) -> impl Iterator<Item = usize> {
    let mut runs: Vec<(f32, Range<usize>)> = Vec::new();
    let mut last = None;
    for (place, &number) in numbers.iter().enumerate() {
        let surface = triangles.surface(number as usize);
        let depth = triangles.corners(number as usize).iter().fold(f32::MIN, |near, p| near.max(p.depth));
        match runs.last_mut().filter(|_| last == Some(surface)) {
            Some((near, run)) => (*near, run.end) = (near.max(depth), place + 1),
            None => runs.push((depth, place..place + 1)),
        }
        last = Some(surface);
    }
    runs.sort_by(|a, b| b.0.total_cmp(&a.0));
    runs.into_iter().flat_map(|(_, run)| run)
}

/// Weights of corners in the middle of pixels, of one triangle after another.
#[derive(Default)]
struct Between {
    number: Option<usize>,
    corners: [[f64; 2]; 3],
    /// For the sides opposite of the first two corners the function of a place: `[a, b, c]`; in parts of the area.
    sides: [[f64; 3]; 2],
}

impl Between {
    /// The weights of a triangle's corners in the middle of a pixel, or at the place nearest to it if that is outside.
    fn weights(
        &mut self,
        number: usize,
        corners: impl FnOnce() -> [Place; 3],
        [column, row]: [usize; 2],
    ) -> [f64; 3] {
        if self.number != Some(number) {
            self.number = Some(number);
            let [p, q, r] = corners().map(|corner| [f64::from(corner.x), f64::from(corner.y)]);
            let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            let side = |from: [f64; 2], to: [f64; 2]| {
                let (a, b) = ((from[1] - to[1]) / area, (to[0] - from[0]) / area);
                [a, b, -(a * from[0] + b * from[1])]
            };
            self.sides = [side(q, r), side(r, p)];
            self.corners = [p, q, r];
        }
        let middle = |at: usize| (at as i64 * STEPS + STEPS / 2) as f64;
        let (x, y) = (middle(column), middle(row));
        let [u, v] = self.sides.map(|[a, b, c]| a * x + b * y + c);
        let w = 1.0 - u - v;
        if u >= 0.0 && v >= 0.0 && w >= 0.0 {
            return [u, v, w];
        }
        nearest_on_sides(self.corners, [x, y])
    }
}

/// The weights of a triangle's corners at the place on its sides that is nearest to this one. Weights below zero that are only cut off give a
/// place far away along a narrow triangle.
fn nearest_on_sides(corners: [[f64; 2]; 3], [x, y]: [f64; 2]) -> [f64; 3] {
    let mut nearest = (f64::INFINITY, [1.0, 0.0, 0.0]);
    for k in 0..3 {
        let l = (k + 1) % 3;
        let ([px, py], [qx, qy]) = (corners[k], corners[l]);
        let (dx, dy) = (qx - px, qy - py);
        let part = (((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let (ex, ey) = (px + part * dx - x, py + part * dy - y);
        let distance = ex * ex + ey * ey;
        if distance < nearest.0 {
            let mut weights = [0.0; 3];
            (weights[k], weights[l]) = (1.0 - part, part);
            nearest = (distance, weights);
        }
    }
    nearest.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_a_pixel_beside_a_narrow_triangle_are_those_of_the_place_next_to_it() {
        let place = |x: i32, y: i32| Place { x, y, depth: 0.0 };
        // Half a pixel wide at its upper end, 100 pixels long.
        let corners = [place(0, 25_600), place(0, 0), place(128, 0)];
        let mut between = Between::default();
        for row in 0..100 {
            let [low, left, right] = between.weights(0, || corners, [0, row]);
            let at = 25_600.0 * low / 256.0;
            assert!((at - (row as f64 + 0.5)).abs() < 1e-2 && left.abs() < 1e-12, "{row}: {at}, {left}");
            assert!((low + left + right - 1.0).abs() < 1e-12);
        }
        assert_eq!(between.weights(0, || corners, [1, 200]), [1.0, 0.0, 0.0]);
    }
}
