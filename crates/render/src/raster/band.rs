//! A band of rows: which triangle is seen at each sample, then the colours of its pixels.
//!
//! Most pixels are within one triangle. Such a pixel holds the number of the triangle and bounds of its depth, and its samples are written
//! only when an edge crosses it, or when another triangle passes through the first. A pixel whose farthest sample is nearer than a triangle
//! is passed at once.

use std::array::from_fn;
use std::ops::Range;

use super::{BAND, EQUAL, Pattern, Place, STEPS, Triangles, range};

/// Nothing is drawn in the pixel, or at the sample.
const NOTHING: u32 = u32::MAX;
/// The samples of the pixel differ.
const MIXED: u32 = u32::MAX - 1;
/// Sides with fewer steps along each axis are tested with floats, where all values are exact integers; and bound of a side's function,
/// beyond which its value does not matter.
const SHORTEST: i64 = 1 << 11;
const FLOAT_LIMIT: i64 = 1 << 23;
/// Sides with fewer steps are tested in 32 bits; and the same bound.
const LONGEST: i64 = 1 << 20;
const LIMIT: i64 = 1 << 30;

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

/// Samples of a pixel: depths, and triangles by their places in the list.
#[derive(Clone, Copy)]
struct Samples<const N: usize> {
    depths: [f32; N],
    seen: [u32; N],
}

/// The depth of a triangle at the upper left corners of pixels: at one place, its growth to the right and down, and its bounds.
#[derive(Clone, Copy)]
struct Plane {
    column: f32,
    row: f32,
    depth: f32,
    right: f32,
    down: f32,
    least: f32,
    greatest: f32,
}

impl Plane {
    fn at(&self, column: usize, row: usize) -> f32 {
        self.depth + self.right * (column as f32 - self.column) + self.down * (row as f32 - self.row)
    }

    /// The least and the greatest that a sample adds, or less and more.
    fn reach(&self) -> [f32; 2] {
        let range = |slope: f32| if slope < 0.0 { [slope, 0.0] } else { [0.0, slope] };
        let ([a, b], [c, d]) = (range(self.right), range(self.down));
        [a + c, b + d]
    }

    /// The depth at a sample, given that at the corner of its pixel; the sample's place is in steps.
    #[inline(always)]
    fn sample(&self, base: f32, x: f32, y: f32) -> f32 {
        const STEP: f32 = 1.0 / STEPS as f32;
        base + self.right * (x * STEP) + self.down * (y * STEP)
    }

    #[inline(always)]
    fn bounded(&self, depth: f32) -> f32 {
        let depth = if depth > self.least { depth } else { self.least };
        if depth < self.greatest { depth } else { self.greatest }
    }
}

/// A triangle, ready to be drawn.
struct Ready {
    columns: [usize; 2],
    rows: [usize; 2],
    /// For each side the value of its function at the upper left corner of the first pixel, and its growth by a step to the right and
    /// down. The function is not negative within.
    sides: [[i64; 3]; 3],
    plane: Plane,
}

impl Ready {
    /// `None` if no sample of these rows can be in it.
    fn new(corners: [Place; 3], width: usize, band: &Range<usize>) -> Option<Ready> {
        let mut at = corners.map(|corner| [i64::from(corner.x), i64::from(corner.y)]);
        let mut depths = corners.map(|corner| f64::from(corner.depth));
        let [[ax, ay], [bx, by], [cx, cy]] = at;
        let area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        if area == 0 {
            return None;
        }
        if area < 0 {
            at.swap(1, 2);
            depths.swap(1, 2);
        }
        let columns = range(at.map(|p| p[0]), width)?;
        let [first, last] = range(at.map(|p| p[1]), band.end)?;
        let rows = [first.max(band.start), last];
        if rows[0] > rows[1] {
            return None;
        }
        let (x, y) = (columns[0] as i64 * STEPS, rows[0] as i64 * STEPS);
        // The side opposite of each corner; places on a side belong to one of the two triangles that meet there.
        let lines = [0, 1, 2].map(|k| {
            let ([px, py], [qx, qy]) = (at[(k + 1) % 3], at[(k + 2) % 3]);
            let (a, b) = (py - qy, qx - px);
            let bias = if a > 0 || (a == 0 && b > 0) { 0 } else { -1 };
            [a * (x - px) + b * (y - py) + bias, a, b]
        });
        let scale = STEPS as f64 / area.unsigned_abs() as f64;
        let slope = |i: usize| (0..3).map(|k| lines[k][i] as f64 * depths[k]).sum::<f64>() * scale;
        let (right, down) = (slope(1), slope(2));
        let steps = STEPS as f64;
        let depth =
            depths[0] + right * ((x - at[0][0]) as f64 / steps) + down * ((y - at[0][1]) as f64 / steps);
        let (least, greatest) = depths
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &z| (low.min(z), high.max(z)));
        let plane = Plane {
            column: columns[0] as f32,
            row: rows[0] as f32,
            depth: depth as f32,
            right: right as f32,
            down: down as f32,
            least: least as f32,
            greatest: greatest as f32,
        };
        Some(Ready { columns, rows, sides: lines, plane })
    }
}

/// The samples of some rows.
pub(super) struct Band<const N: usize> {
    /// Places of the samples in a pixel, in steps from its upper left corner.
    pattern: [[f32; N]; 2],
    width: usize,
    pixels: Vec<Pixel>,
    samples: Vec<Samples<N>>,
    /// Of the triangles that are seen or were, by their places in the list.
    planes: Vec<Plane>,
    /// First column in which something may be drawn, and the one after the last: most of a picture is empty.
    touched: [usize; 2],
}

impl<const N: usize> Band<N> {
    pub(super) fn new(pattern: &Pattern<N>, width: usize) -> Band<N> {
        let place = |k: i64| ((k + 8) * (STEPS / 16) + STEPS / 32) as f32;
        let pattern = [pattern.map(|(x, _)| place(x)), pattern.map(|(_, y)| place(y))];
        let samples = Samples { depths: [f32::NEG_INFINITY; N], seen: [NOTHING; N] };
        Band {
            pattern,
            width,
            pixels: vec![EMPTY; width * BAND],
            samples: vec![samples; width * BAND],
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
        self.planes.resize(numbers.len(), NO_PLANE);
        for place in nearest_first(triangles, numbers) {
            let corners = triangles.corners(numbers[place] as usize);
            let Some(ready) = Ready::new(corners, self.width, &rows) else { continue };
            self.planes[place] = ready.plane;
            let place = place as u32;
            let [first, last] = ready.columns;
            let [from, end] = self.touched;
            self.touched = if from == end { [first, last + 1] } else { [from.min(first), end.max(last + 1)] };
            self.fill(&ready, place, rows.start);
        }
    }

    /// Draws a triangle.
    fn fill(&mut self, ready: &Ready, place: u32, top: usize) {
        let plane = ready.plane;
        let [lowest, highest] = plane.reach();
        let sides = ready.sides;
        let is_below = |most: i64| sides.iter().all(|[_, a, b]| a.abs() < most && b.abs() < most);
        let (is_short, is_medium) = (is_below(SHORTEST), is_below(LONGEST));
        let slopes = sides.map(|[_, a, b]| [a as f32, b as f32]);
        let mut at_samples = None;
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
                let base = plane.at(column, row);
                let (far, near) = (plane.bounded(base + lowest), plane.bounded(base + highest));
                let pixel = &mut self.pixels[line + column];
                if near + EQUAL < pixel.far {
                    continue;
                }
                let is_full = (here[0] + least[0]) | (here[1] + least[1]) | (here[2] + least[2]) >= 0;
                let is_later = pixel.seen != MIXED && place > pixel.seen;
                let is_nearer = far > pixel.near + EQUAL || (is_later && far + EQUAL >= pixel.near);
                if is_full && (pixel.seen == NOTHING || is_nearer) {
                    *pixel = Pixel { seen: place, far, near: near.max(pixel.near) };
                    continue;
                }
                let samples = &mut self.samples[line + column];
                if pixel.seen != MIXED {
                    samples.expand(pixel.seen, &self.planes, &self.pattern, [column, row]);
                    pixel.seen = MIXED;
                }
                let Samples { depths, seen } = samples;
                let [xs, ys] = &self.pattern;
                let mut pen = Pen { plane, base, place, xs, ys, depths, seen };
                pixel.far = if is_short {
                    let here = here.map(|value| value.clamp(-FLOAT_LIMIT, FLOAT_LIMIT) as f32);
                    pen.add(here, slopes)
                } else if is_medium {
                    let [a, b, c] =
                        at_samples.get_or_insert_with(|| sides.map(|side| at_samples_of(side, xs, ys)));
                    pen.add_medium(here.map(|value| value.clamp(-LIMIT, LIMIT) as i32), [a, b, c])
                } else {
                    pen.add_long(here, sides)
                };
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
        let [first, end] = self.touched;
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
                    NOTHING => continue,
                    MIXED => {
                        let surface = |place: u32| triangles.surface(numbers[place as usize] as usize);
                        mean(&self.samples[index].seen, surface, |place| color(place, at))
                    }
                    place => color(place, at),
                };
            }
        }
    }
}

const NO_PLANE: Plane =
    Plane { column: 0.0, row: 0.0, depth: 0.0, right: 0.0, down: 0.0, least: 0.0, greatest: 0.0 };

impl<const N: usize> Samples<N> {
    /// Writes what a whole pixel held.
    fn expand(&mut self, seen: u32, planes: &[Plane], pattern: &[[f32; N]; 2], [column, row]: [usize; 2]) {
        self.seen = [seen; N];
        self.depths = match planes.get(seen as usize) {
            None => [f32::NEG_INFINITY; N],
            Some(plane) => {
                let base = plane.at(column, row);
                from_fn(|s| plane.bounded(plane.sample(base, pattern[0][s], pattern[1][s])))
            }
        };
    }
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

/// What the samples add to the function of a side.
fn at_samples_of<const N: usize>([_, a, b]: [i64; 3], xs: &[f32; N], ys: &[f32; N]) -> [i32; N] {
    from_fn(|s| (a * xs[s] as i64 + b * ys[s] as i64) as i32)
}

/// A triangle at the samples of one pixel. It is added where samples are within its sides and nothing is nearer, and the depth of the
/// farthest sample returned. The loops have no branches and are not unrolled, so that the compiler makes them work on several samples at a
/// time.
struct Pen<'a> {
    plane: Plane,
    base: f32,
    place: u32,
    xs: &'a [f32],
    ys: &'a [f32],
    depths: &'a mut [f32],
    seen: &'a mut [u32],
}

impl Pen<'_> {
    /// For the values of the sides' functions at the pixel, and their growth by a step.
    #[inline(never)]
    fn add(&mut self, here: [f32; 3], [a, b, c]: [[f32; 2]; 3]) -> f32 {
        let count = self.depths.len();
        let (xs, ys) = (&self.xs[..count], &self.ys[..count]);
        let (depths, seen) = (&mut self.depths[..count], &mut self.seen[..count]);
        let (plane, base, place) = (self.plane, self.base, self.place);
        for s in 0..count {
            let (x, y) = (xs[s], ys[s]);
            let value = |k: usize, side: [f32; 2]| (here[k] + (side[0] * x + side[1] * y)).to_bits();
            let outside = (value(0, a) | value(1, b) | value(2, c)) as i32 >> 31;
            draw(&plane, base, place, [x, y], outside, &mut depths[s], &mut seen[s]);
        }
        farthest(depths)
    }

    /// The same, with that which each sample adds.
    #[inline(never)]
    fn add_medium(&mut self, here: [i32; 3], sides: [&[i32]; 3]) -> f32 {
        let count = self.depths.len();
        let (xs, ys) = (&self.xs[..count], &self.ys[..count]);
        let [a, b, c] = [&sides[0][..count], &sides[1][..count], &sides[2][..count]];
        let (depths, seen) = (&mut self.depths[..count], &mut self.seen[..count]);
        let (plane, base, place) = (self.plane, self.base, self.place);
        let [p, q, r] = here;
        for s in 0..count {
            let outside = (p.wrapping_add(a[s]) | q.wrapping_add(b[s]) | r.wrapping_add(c[s])) >> 31;
            draw(&plane, base, place, [xs[s], ys[s]], outside, &mut depths[s], &mut seen[s]);
        }
        farthest(depths)
    }

    /// The same for sides of any length.
    fn add_long(&mut self, here: [i64; 3], sides: [[i64; 3]; 3]) -> f32 {
        for s in 0..self.depths.len() {
            let (x, y) = (self.xs[s], self.ys[s]);
            let value = |k: usize| here[k] + sides[k][1] * x as i64 + sides[k][2] * y as i64;
            let outside = ((value(0) | value(1) | value(2)) >> 63) as i32;
            draw(&self.plane, self.base, self.place, [x, y], outside, &mut self.depths[s], &mut self.seen[s]);
        }
        farthest(self.depths)
    }
}

/// Keeps the nearer of a triangle and what a sample holds; `outside` has all bits set if the sample is.
#[inline(always)]
fn draw(
    plane: &Plane,
    base: f32,
    place: u32,
    [x, y]: [f32; 2],
    outside: i32,
    held: &mut f32,
    seen: &mut u32,
) {
    let depth = plane.bounded(plane.sample(base, x, y));
    let is_near = if depth > *held + EQUAL { u32::MAX } else { 0 };
    let is_equal = if depth + EQUAL >= *held { u32::MAX } else { 0 };
    // Nothing is before anything.
    let is_later = if place.wrapping_add(1) as i32 > seen.wrapping_add(1) as i32 { u32::MAX } else { 0 };
    let mask = (is_near | (is_equal & is_later)) & !(outside as u32);
    let nearer = if depth > *held { depth } else { *held };
    *held = f32::from_bits((nearer.to_bits() & mask) | (held.to_bits() & !mask));
    *seen = (place & mask) | (*seen & !mask);
}

/// The least of some depths.
fn farthest(depths: &[f32]) -> f32 {
    let mut least = [f32::INFINITY; 4];
    for four in depths.chunks_exact(4) {
        for k in 0..4 {
            least[k] = if four[k] < least[k] { four[k] } else { least[k] };
        }
    }
    least.into_iter().fold(f32::INFINITY, |a, b| if b < a { b } else { a })
}

/// The mean colour of samples. Each surface is shaded where its first sample is: the first ones are in the middle.
fn mean<const N: usize>(
    seen: &[u32; N],
    surface: impl Fn(u32) -> u32,
    mut color: impl FnMut(u32) -> [u8; 4],
) -> [u8; 4] {
    let mut known: [(u32, u32, [u8; 4]); N] = [(NOTHING, 0, [0; 4]); N];
    let mut count = 0;
    let mut sum = [0_u32; 4];
    for &place in seen.iter().filter(|place| **place != NOTHING) {
        let same = known[..count].iter().find(|known| known.0 == place);
        let painted = match same {
            Some(known) => known.2,
            None => {
                let of = surface(place);
                let alike = known[..count].iter().find(|known| known.1 == of).map(|known| known.2);
                let painted = alike.unwrap_or_else(|| color(place));
                known[count] = (place, of, painted);
                count += 1;
                painted
            }
        };
        sum.iter_mut().zip(painted).for_each(|(sum, channel)| *sum += u32::from(channel));
    }
    sum.map(|total| ((total + N as u32 / 2) / N as u32) as u8)
}

/// Weights of corners in the middle of pixels, of one triangle after another.
#[derive(Default)]
struct Between {
    number: Option<usize>,
    /// For the sides opposite of the first two corners the function of a place: `[a, b, c]`; in parts of the area.
    sides: [[f64; 3]; 2],
}

impl Between {
    /// The weights of a triangle's corners in the middle of a pixel, or near it if that is outside.
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
        }
        let middle = |at: usize| (at as i64 * STEPS + STEPS / 2) as f64;
        let (x, y) = (middle(column), middle(row));
        let [u, v] = self.sides.map(|[a, b, c]| a * x + b * y + c);
        let w = 1.0 - u - v;
        if u >= 0.0 && v >= 0.0 && w >= 0.0 {
            return [u, v, w];
        }
        let [u, v, w] = [u.max(0.0), v.max(0.0), w.max(0.0)];
        let sum = u + v + w;
        [u / sum, v / sum, w / sum]
    }
}
