//! Triangles as pixels, with a depth buffer and smooth edges.
//!
//! Each pixel has sixteen samples, or four for speed, no two in one row or column (the usual patterns for so many),
//! so that edges of any direction come out smooth and a line thinner than a pixel is as faint as it is thin. A sample holds
//! the nearest triangle there; of two at the same depth, the later one. A triangle is shaded once in each
//! pixel.
//!
//! Corners are rounded to 1/256 pixel and the rest is integers, so triangles that share an edge leave no gap, and pictures are
//! the same bytes on every machine and any number of threads. A band of rows is done at a time: memory is that of the triangles
//! and of the picture, whatever the number of samples.

pub(super) mod cells;

use std::sync::{Mutex, PoisonError};

use dlsys_geometry::scene::Color;

/// Rows in a band.
const BAND: usize = 16;
/// Places of the samples in a pixel, in sixteenths of it from its middle.
pub(super) type Pattern<const N: usize> = [(i64, i64); N];
pub(super) const SIXTEEN: Pattern<16> = [
    (1, 1),
    (-1, -3),
    (-3, 2),
    (4, -1),
    (-5, -2),
    (2, 5),
    (5, 3),
    (3, -5),
    (-2, 6),
    (0, -7),
    (-4, -6),
    (-6, 4),
    (-8, 0),
    (7, -4),
    (6, 7),
    (-7, -8),
];
pub(super) const FOUR: Pattern<4> = [(-2, -6), (6, -2), (-6, 2), (2, 6)];
/// Steps of a coordinate in a pixel.
const STEPS: i64 = 256;
/// Corners further away than this many pixels are moved in.
const FARTHEST: f64 = 500_000.0;
/// Depths that differ by less are equal.
const EQUAL: f32 = 1e-6;

/// A corner of a triangle: pixels to the right and down from the upper left corner of the picture, and depth, greater being
/// nearer, of the order of 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) depth: f64,
}

/// Pixels, row by row from the top: red, green, blue, each times the opacity, and opacity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<[u8; 4]>,
}

/// Draws `count` triangles, the n-th with corners `corners(n)` and the colour `shade(n, weights)` at a place between
/// them, in a picture of this size.
pub(super) fn draw<const N: usize>(
    pattern: &Pattern<N>,
    threads: usize,
    [width, height]: [u32; 2],
    count: usize,
    corners: impl Fn(usize) -> [Corner; 3] + Sync,
    shade: impl Fn(usize, [f64; 3]) -> Color + Sync,
) -> Image {
    let [width, height] = [width as usize, height as usize];
    // Triangles that each band may show, in order.
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    for number in 0..count {
        let at = corners(number).map(|corner| snap(corner.y));
        if let Some([first, last]) = range(at, height) {
            bands[first / BAND..=last / BAND].iter_mut().for_each(|band| band.push(number as u32));
        }
    }
    let mut pixels = vec![[0; 4]; width * height];
    let work = Mutex::new(pixels.chunks_mut((BAND * width).max(1)).zip(&bands).enumerate());
    let draw_bands = || {
        let mut band = Band::new(pattern, width);
        let next = || work.lock().unwrap_or_else(PoisonError::into_inner).next();
        while let Some((index, (pixels, numbers))) = next() {
            let top = index * BAND;
            let rows = BAND.min(height - top);
            band.clear();
            for &number in numbers {
                let number = number as usize;
                if let Some(triangle) = Triangle::new(pattern, number, corners(number), width, height) {
                    band.fill(&triangle, top, rows, &shade);
                }
            }
            band.resolve(pixels);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.min(bands.len()) {
            scope.spawn(draw_bands);
        }
        draw_bands();
    });
    Image { width, height, pixels }
}

/// A coordinate in steps.
fn snap(x: f64) -> i64 {
    (x.clamp(-FARTHEST, FARTHEST) * STEPS as f64).round() as i64
}

/// First and last of `end` rows or columns that what has these coordinates, in steps, may touch.
fn range(at: [i64; 3], end: usize) -> Option<[usize; 2]> {
    let low = at[0].min(at[1]).min(at[2]).div_euclid(STEPS).max(0);
    let high = at[0].max(at[1]).max(at[2]).div_euclid(STEPS).min(end as i64 - 1);
    (low <= high).then_some([low as usize, high as usize])
}

/// A triangle, made ready.
struct Triangle<const N: usize> {
    number: usize,
    /// First and last column and row of pixels that it may touch.
    columns: [usize; 2],
    rows: [usize; 2],
    /// For each side the function `a x + b y + c` of a place in steps, which is not negative within: `[a, b, c]`; and
    /// what makes it positive there, for places on the side itself belong to one of the two triangles that meet there.
    sides: [[i64; 3]; 3],
    bias: [i64; 3],
    /// Value of each side's function at the samples, beside that at the upper left corner of the pixel.
    at_samples: [[i64; N]; 3],
    /// Twice the area.
    area: f64,
    /// Depth at the upper left corner of the picture, its growth for a pixel to the right and down, and its bounds.
    depth: [f64; 3],
    depths: [f64; 2],
    /// The corners were given in the other sense of rotation.
    turned: bool,
}

impl<const N: usize> Triangle<N> {
    /// `None` if no sample can be in it.
    fn new(
        pattern: &Pattern<N>,
        number: usize,
        corners: [Corner; 3],
        width: usize,
        height: usize,
    ) -> Option<Triangle<N>> {
        let mut at = corners.map(|corner| [snap(corner.x), snap(corner.y)]);
        let mut depths = corners.map(|corner| corner.depth);
        let [[ax, ay], [bx, by], [cx, cy]] = at;
        let area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        if area == 0 {
            return None;
        }
        let turned = area < 0;
        if turned {
            at.swap(1, 2);
            depths.swap(1, 2);
        }
        let columns = range(at.map(|p| p[0]), width)?;
        let rows = range(at.map(|p| p[1]), height)?;
        // The side opposite of each corner.
        let sides = [0, 1, 2].map(|k| {
            let ([px, py], [qx, qy]) = (at[(k + 1) % 3], at[(k + 2) % 3]);
            let (a, b) = (py - qy, qx - px);
            [a, b, -(a * px + b * py)]
        });
        let bias = sides.map(|[a, b, _]| if a > 0 || (a == 0 && b > 0) { 0 } else { -1 });
        let at_samples = sides.map(|[a, b, _]| {
            pattern.map(|(x, y)| {
                let place = |k: i64| (k + 8) * (STEPS / 16) + STEPS / 32;
                a * place(x) + b * place(y)
            })
        });
        let area = area.unsigned_abs() as f64;
        let slope =
            |i: usize| (0..3).map(|k| sides[k][i] as f64 * depths[k]).sum::<f64>() / area * STEPS as f64;
        let (right, down) = (slope(0), slope(1));
        let [x, y] = at[0].map(|x| x as f64 / STEPS as f64);
        let [least, greatest] = depths
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &z| [low.min(z), high.max(z)]);
        Some(Triangle {
            number,
            columns,
            rows,
            sides,
            bias,
            at_samples,
            area,
            depth: [depths[0] - right * x - down * y, right, down],
            depths: [least, greatest],
            turned,
        })
    }

    /// Weights of the corners, in their given order, at a place in steps, or near it if that is outside.
    fn weights(&self, x: i64, y: i64) -> [f64; 3] {
        let raw = self.sides.map(|[a, b, c]| ((a * x + b * y + c) as f64 / self.area).max(0.0));
        let sum: f64 = raw.iter().sum();
        let [a, b, c] = raw.map(|w| w / sum);
        if self.turned { [a, c, b] } else { [a, b, c] }
    }
}

/// The samples of some rows.
struct Band<'p, const N: usize> {
    pattern: &'p Pattern<N>,
    width: usize,
    depths: Vec<f32>,
    /// `0xffrrggbb`, or 0 where there is nothing.
    colors: Vec<u32>,
    /// First column in which something may be drawn, and the one after the last: most of a picture is empty.
    touched: [usize; 2],
}

impl<const N: usize> Band<'_, N> {
    fn new(pattern: &Pattern<N>, width: usize) -> Band<'_, N> {
        let samples = width * BAND * N;
        Band {
            pattern,
            width,
            depths: vec![f32::NEG_INFINITY; samples],
            colors: vec![0; samples],
            touched: [0; 2],
        }
    }

    fn clear(&mut self) {
        let [first, end] = std::mem::take(&mut self.touched).map(|column| column * N);
        let row = (self.width * N).max(1);
        for (depths, colors) in self.depths.chunks_exact_mut(row).zip(self.colors.chunks_exact_mut(row)) {
            depths[first..end].fill(f32::NEG_INFINITY);
            colors[first..end].fill(0);
        }
    }

    /// Draws the part of a triangle in the `rows` rows from `top`.
    fn fill(
        &mut self,
        triangle: &Triangle<N>,
        top: usize,
        rows: usize,
        shade: &impl Fn(usize, [f64; 3]) -> Color,
    ) {
        let [first, last] = triangle.columns;
        let [from, end] = self.touched;
        self.touched = if from == end { [first, last + 1] } else { [from.min(first), end.max(last + 1)] };
        let place = |k: i64| (k as f64 + 8.5) / 16.0;
        let [origin, right, down] = triangle.depth;
        let depth_at = self.pattern.map(|(x, y)| right * place(x) + down * place(y));
        let largest = triangle.at_samples.map(|at| at.iter().copied().max().unwrap_or(0));
        for row in triangle.rows[0].max(top)..=triangle.rows[1].min(top + rows - 1) {
            for column in triangle.columns[0]..=triangle.columns[1] {
                let (x, y) = (column as i64 * STEPS, row as i64 * STEPS);
                let value = |k: usize| {
                    let [a, b, c] = triangle.sides[k];
                    a * x + b * y + c + triangle.bias[k]
                };
                let corner = [value(0), value(1), value(2)];
                if (0..3).any(|k| corner[k] + largest[k] < 0) {
                    continue;
                }
                let base = origin + right * column as f64 + down * row as f64;
                let first = ((row - top) * self.width + column) * N;
                let mut color = None;
                for s in 0..N {
                    let at = &triangle.at_samples;
                    if (corner[0] + at[0][s]) | (corner[1] + at[1][s]) | (corner[2] + at[2][s]) < 0 {
                        continue;
                    }
                    let [least, greatest] = triangle.depths;
                    let depth = (base + depth_at[s]).clamp(least, greatest) as f32;
                    let held = &mut self.depths[first + s];
                    if depth + EQUAL >= *held {
                        *held = depth.max(*held);
                        self.colors[first + s] = *color.get_or_insert_with(|| {
                            let half = STEPS / 2;
                            let Color { red, green, blue } =
                                shade(triangle.number, triangle.weights(x + half, y + half));
                            u32::from_be_bytes([255, red, green, blue])
                        });
                    }
                }
            }
        }
    }

    /// The pixels of the first rows: the means of their samples. They are transparent before.
    fn resolve(&self, pixels: &mut [[u8; 4]]) {
        let [first, end] = self.touched;
        let samples = self.colors.chunks_exact((self.width * N).max(1));
        for (pixels, samples) in pixels.chunks_exact_mut(self.width.max(1)).zip(samples) {
            let samples = samples[first * N..end * N].chunks_exact(N);
            for (pixel, samples) in pixels[first..end].iter_mut().zip(samples) {
                if samples[1..].iter().all(|sample| *sample == samples[0]) {
                    let [opacity, red, green, blue] = samples[0].to_be_bytes();
                    *pixel = [red, green, blue, opacity];
                    continue;
                }
                let mut sum = [0_u32; 4];
                for sample in samples {
                    let [opacity, red, green, blue] = sample.to_be_bytes();
                    for (total, channel) in sum.iter_mut().zip([red, green, blue, opacity]) {
                        *total += u32::from(channel);
                    }
                }
                *pixel = sum.map(|total| ((total + N as u32 / 2) / N as u32) as u8);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Color = Color::hex(0xff0000);
    const BLUE: Color = Color::hex(0x0000ff);

    fn corner(x: f64, y: f64, depth: f64) -> Corner {
        Corner { x, y, depth }
    }

    fn drawn(size: [u32; 2], triangles: &[([Corner; 3], Color)]) -> Image {
        let threads = |threads| {
            draw(&SIXTEEN, threads, size, triangles.len(), |n| triangles[n].0, |n, _| triangles[n].1)
        };
        assert_eq!(threads(1), threads(3));
        threads(1)
    }

    #[test]
    fn a_square_of_two_triangles_has_no_seam_and_exact_edges() {
        let [a, b, c, d] = [(1.5, 2.0), (7.0, 2.0), (7.0, 6.25), (1.5, 6.25)].map(|(x, y)| corner(x, y, 0.0));
        let image = drawn([8, 8], &[([a, b, c], RED), ([a, d, c], RED)]);
        let opacity = |x: usize, y: usize| image.pixels[y * 8 + x][3];
        for y in 2..6 {
            for x in 2..7 {
                assert_eq!(image.pixels[y * 8 + x], [255, 0, 0, 255], "{x},{y}");
            }
            assert_eq!((opacity(1, y), opacity(0, y), opacity(7, y)), (128, 0, 0));
        }
        assert_eq!((opacity(3, 6), opacity(3, 7), opacity(3, 1)), (64, 0, 0));
    }

    #[test]
    fn nearer_wins_and_of_equals_the_later() {
        let square = |x: f64, z: [f64; 3], color| {
            ([corner(x, -20.0, z[0]), corner(x + 40.0, 20.0, z[1]), corner(x - 40.0, 20.0, z[2])], color)
        };
        let middle = |triangles: &[([Corner; 3], Color)]| drawn([4, 4], triangles).pixels[2 * 4 + 2];
        let (red, blue) = ([255, 0, 0, 255], [0, 0, 255, 255]);
        assert_eq!(middle(&[square(2.0, [0.5; 3], RED), square(2.0, [0.4; 3], BLUE)]), red);
        assert_eq!(middle(&[square(2.0, [0.4; 3], RED), square(2.0, [0.5; 3], BLUE)]), blue);
        assert_eq!(middle(&[square(2.0, [0.5; 3], RED), square(2.0, [0.5; 3], BLUE)]), blue);
        // Two that cross: each is seen where it is nearer.
        let crossing =
            drawn([16, 1], &[square(8.0, [0.0, 1.0, -1.0], RED), square(8.0, [0.0, -1.0, 1.0], BLUE)]);
        assert_eq!((crossing.pixels[1], crossing.pixels[14]), (blue, red));
    }

    #[test]
    fn shades_are_interpolated_and_order_of_bands_does_not_matter() {
        let corners = [corner(0.0, 0.0, 0.0), corner(100.0, 0.0, 0.0), corner(0.0, 100.0, 0.0)];
        let shade = |_, [a, b, c]: [f64; 3]| {
            let byte = |w: f64| (w * 255.0).round() as u8;
            Color { red: byte(a), green: byte(b), blue: byte(c) }
        };
        let image = draw(&FOUR, 2, [100, 100], 1, |_| corners, shade);
        let [red, green, blue, opacity] = image.pixels[20 * 100 + 50];
        // At (50.5, 20.5): weights 0.29, 0.505, 0.205.
        assert_eq!([red, green, blue, opacity], [74, 129, 52, 255]);
    }

    #[test]
    fn a_line_thinner_than_a_pixel_is_faint() {
        let line = |x: f64| {
            let [a, b, c, d] =
                [(x, 0.0), (x + 0.25, 0.0), (x + 0.25, 9.0), (x, 9.0)].map(|(x, y)| corner(x, y, 0.0));
            drawn([2, 9], &[([a, b, c], RED), ([a, c, d], RED)]).pixels[8][3]
        };
        assert_eq!([0.0, 0.3, 0.6].map(line), [64; 3]);
    }

    #[test]
    fn what_is_far_outside_or_flat_does_no_harm() {
        let far = [corner(-1e300, 0.0, 0.0), corner(1e300, 1e300, 0.0), corner(1e300, -1e300, 0.0)];
        let line = [corner(0.0, 0.0, 0.0), corner(1.0, 1.0, 0.0), corner(2.0, 2.0, 0.0)];
        let undefined = [corner(f64::NAN, 0.0, f64::NAN); 3];
        assert_eq!(drawn([3, 3], &[(far, RED), (line, BLUE), (undefined, BLUE)]).pixels.len(), 9);
    }
}
