//! Triangles as pixels, with a depth buffer and smooth edges.
//!
//! Each pixel has sixteen samples, or four for speed, no two in one row or column (the usual patterns for so many),
//! so that edges of any direction come out smooth and a line thinner than a pixel is as faint as it is thin. A sample holds
//! the nearest triangle there; of two at the same depth, the later one. What is seen is known before anything is shaded: a pixel is
//! shaded once for each surface that is seen in it.
//!
//! Corners are rounded to 1/256 pixel and the rest is integers, so triangles that share an edge leave no gap, and pictures are
//! the same bytes on every machine and any number of threads. A band of rows is done at a time ([`band`]): memory is that of the
//! triangles and of the picture, whatever the number of samples.

mod band;
pub(super) mod cells;
mod fragments;
mod lanes;
mod list;
mod plane;
mod resolve;
pub(super) mod samples;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use super::mapping::Cut;
use band::Band;
use list::List;

/// Rows in a band.
pub(super) const BAND: usize = 16;
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
pub(super) const STEPS: i64 = 256;
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

/// A corner on the grid of steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) x: i32,
    pub(super) y: i32,
    pub(super) depth: f32,
}

impl Corner {
    /// Rounded to the grid of steps.
    pub(super) fn place(&self) -> Place {
        Place { x: snap(self.x) as i32, y: snap(self.y) as i32, depth: self.depth as f32 }
    }
}

/// Pixels, row by row from the top: red, green, blue, each times the opacity, and opacity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<[u8; 4]>,
}

/// Triangles that are to be drawn, by number.
pub(super) trait Triangles: Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// The corners of one.
    fn corners(&self, n: usize) -> [Place; 3];

    /// The surface that it belongs to: in a pixel, triangles of one surface have one shade.
    fn surface(&self, n: usize) -> u32;

    /// What is cut out of it, decided so many times in a pixel.
    fn cut(&self, _n: usize, _count: usize) -> Option<Cut<'_>> {
        None
    }

    /// Whether there may be a colour where no triangle is.
    fn is_veiled(&self) -> bool {
        false
    }

    /// The colour where no triangle is, as [`shade`](Triangles::shade) gives it.
    fn open(&self, _pixel: [usize; 2]) -> [u8; 4] {
        [0; 4]
    }

    /// Red, green and blue, each times the opacity, and the opacity, in a pixel (column and row), at a place between the corners
    /// that has these weights.
    fn shade(&self, n: usize, pixel: [usize; 2], weights: [f64; 3]) -> [u8; 4];
}

/// Draws triangles in a picture that is so wide and high, which was empty.
pub(super) fn draw<const N: usize>(
    pattern: &Pattern<N>,
    threads: usize,
    size: [usize; 2],
    triangles: &impl Triangles,
    pixels: &mut [[u8; 4]],
) {
    let rows = pixels.chunks_mut((BAND * size[0]).max(1));
    in_bands(pattern, threads, size, triangles, rows, |band, list, top, pixels| {
        band.resolve(triangles, list, top, pixels);
    });
}

/// Whether each triangle is seen at some sample.
pub(super) fn seen<const N: usize>(
    pattern: &Pattern<N>,
    threads: usize,
    size: [usize; 2],
    triangles: &impl Triangles,
) -> Vec<bool> {
    let all: Vec<AtomicBool> = (0..triangles.count()).map(|_| AtomicBool::new(false)).collect();
    in_bands(pattern, threads, size, triangles, std::iter::repeat(()), |band, list, _, ()| {
        band.each_seen(|place| all[list.numbers[place as usize] as usize].store(true, Ordering::Relaxed));
    });
    all.into_iter().map(AtomicBool::into_inner).collect()
}

/// Finds out which triangles are seen in each band, and passes that on with what belongs to the band, and its first row.
fn in_bands<const N: usize, Own: Send>(
    pattern: &Pattern<N>,
    threads: usize,
    [width, height]: [usize; 2],
    triangles: &impl Triangles,
    own: impl Iterator<Item = Own> + Send,
    visit: impl Fn(&Band<N>, &List, usize, Own) + Sync,
) {
    // Triangles that each band may show, in order.
    let mut bands: Vec<List> = Vec::new();
    bands.resize_with(height.div_ceil(BAND), List::default);
    for number in 0..triangles.count() {
        let [p, q, r] = triangles.corners(number);
        if let Some([first, last]) = range([p.y, q.y, r.y], height) {
            let nearest = f32::MIN.max(p.depth).max(q.depth).max(r.depth);
            let surface = triangles.surface(number);
            let bands = &mut bands[first / BAND..=last / BAND];
            bands.iter_mut().for_each(|band| band.push(number as u32, surface, nearest));
        }
    }
    let work = Mutex::new(own.zip(&bands).enumerate());
    let draw_bands = || {
        let mut band = Band::new(pattern, width);
        let next = || work.lock().unwrap_or_else(PoisonError::into_inner).next();
        while let Some((index, (own, list))) = next() {
            let top = index * BAND;
            band.draw(triangles, list, top..(top + BAND).min(height));
            visit(&band, list, top, own);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.min(bands.len()) {
            scope.spawn(draw_bands);
        }
        draw_bands();
    });
}

/// Triangles of one colour.
pub(super) struct Plain<'t> {
    pub(super) triangles: &'t [[Corner; 3]],
    pub(super) color: [u8; 3],
}

impl Triangles for Plain<'_> {
    fn count(&self) -> usize {
        self.triangles.len()
    }

    fn corners(&self, n: usize) -> [Place; 3] {
        self.triangles[n].map(|corner| corner.place())
    }

    fn surface(&self, _: usize) -> u32 {
        0
    }

    fn shade(&self, _: usize, _: [usize; 2], _: [f64; 3]) -> [u8; 4] {
        let [red, green, blue] = self.color;
        [red, green, blue, 255]
    }
}

/// A coordinate in steps.
fn snap(x: f64) -> i64 {
    let steps = x.clamp(-FARTHEST, FARTHEST) * STEPS as f64;
    // To the nearest, without a call of the mathematical library.
    (steps + 0.5_f64.copysign(steps)) as i64
}

/// First and last of `end` rows or columns that what has these coordinates, in steps, may touch.
#[inline(always)]
fn range(at: [i32; 3], end: usize) -> Option<[usize; 2]> {
    let low = at[0].min(at[1]).min(at[2]).div_euclid(STEPS as i32).max(0) as usize;
    let high = at[0].max(at[1]).max(at[2]).div_euclid(STEPS as i32);
    let high = (high.max(-1) as isize).min(end as isize - 1);
    (low as isize <= high).then_some([low, high as usize])
}

/// Corners in the order that gives a positive area, and their depths. Places are in steps.
struct Oriented {
    at: [[i64; 2]; 3],
    depths: [f64; 3],
    /// Twice its area.
    area: f64,
}

/// A side: `a x + b y` grows to the inside.
#[derive(Clone, Copy)]
struct Side {
    a: i64,
    b: i64,
    /// -1 if places on it belong to the triangle on the other side, else 0.
    bias: i64,
}

impl Oriented {
    /// `None` if it has no area.
    #[inline(always)]
    fn new([p, mut q, mut r]: [Place; 3]) -> Option<Oriented> {
        let wide = |a: i32, b: i32| i64::from(a) - i64::from(b);
        let area = wide(q.x, p.x) * wide(r.y, p.y) - wide(q.y, p.y) * wide(r.x, p.x);
        if area == 0 {
            return None;
        }
        if area < 0 {
            std::mem::swap(&mut q, &mut r);
        }
        let at = |place: Place| [place.x.into(), place.y.into()];
        let depths = [p.depth.into(), q.depth.into(), r.depth.into()];
        Some(Oriented { at: [at(p), at(q), at(r)], depths, area: area.unsigned_abs() as f64 })
    }
}

impl Side {
    /// The side from one corner to the next one.
    #[inline(always)]
    fn new(from: [i64; 2], to: [i64; 2]) -> Side {
        let (a, b) = (from[1] - to[1], to[0] - from[0]);
        let is_own = (a > 0) | ((a == 0) & (b > 0));
        Side { a, b, bias: i64::from(is_own) - 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [255, 0, 0];
    const BLUE: [u8; 3] = [0, 0, 255];

    fn corner(x: f64, y: f64, depth: f64) -> Corner {
        Corner { x, y, depth }
    }

    /// Triangles with colours that may depend on the weights of their corners.
    struct Given<'t, Shade>(&'t [([Corner; 3], Shade)]);

    impl<Shade: Fn([f64; 3]) -> [u8; 3] + Sync> Triangles for Given<'_, Shade> {
        fn count(&self) -> usize {
            self.0.len()
        }

        fn corners(&self, n: usize) -> [Place; 3] {
            self.0[n].0.map(|corner| corner.place())
        }

        fn surface(&self, n: usize) -> u32 {
            n as u32
        }

        fn shade(&self, n: usize, _: [usize; 2], weights: [f64; 3]) -> [u8; 4] {
            let [red, green, blue] = (self.0[n].1)(weights);
            [red, green, blue, 255]
        }
    }

    fn painted<const N: usize>(
        pattern: &Pattern<N>,
        [width, height]: [usize; 2],
        triangles: &impl Triangles,
    ) -> Image {
        let image = |threads| {
            let mut pixels = vec![[0; 4]; width * height];
            draw(pattern, threads, [width, height], triangles, &mut pixels);
            Image { width, height, pixels }
        };
        let whole = image(1);
        assert_eq!(whole, image(3));
        whole
    }

    fn drawn(size: [usize; 2], triangles: &[([Corner; 3], [u8; 3])]) -> Image {
        let shades: Vec<_> = triangles.iter().map(|&(corners, color)| (corners, move |_| color)).collect();
        painted(&SIXTEEN, size, &Given(&shades))
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
        let middle = |triangles: &[([Corner; 3], [u8; 3])]| drawn([4, 4], triangles).pixels[2 * 4 + 2];
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
        let shade = |weights: [f64; 3]| weights.map(|w| (w * 255.0).round() as u8);
        let image = painted(&FOUR, [100, 100], &Given(&[(corners, shade)]));
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

    #[test]
    fn every_sample_has_the_triangle_that_a_plain_search_finds() {
        let size = [24, 20];
        let mut state = 1_u64;
        let mut random = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * most
        };
        for round in 0..200 {
            // Small ones and large ones, which pass through one another.
            let reach = if round % 2 == 0 { 3.0 } else { 30.0 };
            let triangles: Vec<([Corner; 3], [u8; 3])> = (0..40_u8)
                .map(|i| {
                    let (x, y) = (random(24.0), random(20.0));
                    let corners = [(); 3].map(|()| corner(x + random(reach), y + random(reach), random(1.0)));
                    (corners, [i, 255 - i, 3 * i])
                })
                .collect();
            let image = drawn(size, &triangles);
            let pixels: Vec<u32> = (0..(size[0] * size[1]) as u32).collect();
            let corners = |n: usize| triangles[n].0.map(|corner| corner.place());
            let all = cells::Given { count: triangles.len(), corners, cut: |_| None };
            let found = samples::at_samples(&SIXTEEN, size, &all, (&pixels, |pixel| pixel), |_| true);
            let mut differing = 0;
            for (pixel, numbers) in image.pixels.iter().zip(&found.numbers) {
                let mean = |channel: &dyn Fn([u8; 3]) -> u8| {
                    let seen = numbers.iter().filter(|number| **number > 0);
                    let sum: u32 = seen.map(|n| u32::from(channel(triangles[*n as usize - 1].1))).sum();
                    ((sum + 8) / 16) as u8
                };
                let expected = [mean(&|c| c[0]), mean(&|c| c[1]), mean(&|c| c[2]), mean(&|_| 255)];
                // At depths that are equal but for rounding, the two may differ.
                differing += usize::from(*pixel != expected);
            }
            assert!(differing <= 1, "round {round}: {differing} pixels differ");
        }
    }
}
