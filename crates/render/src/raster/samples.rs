//! Which triangle is the nearest at several samples of some pixels: those in which edges are.

use wide::bytemuck::cast;
use wide::{f32x4, i32x4};

use super::band::left_of;
use super::cells::{Given, Nearest};
use super::fragments::{self, Cover, Places};
use super::plane::Ready;
use super::{EQUAL, Pattern, Place, STEPS, range};
use crate::mapping::Cut;

/// Eight samples, no two in a row or column.
pub(crate) const EIGHT: Pattern<8> = [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)];
/// Pixels along a side of a block.
const BLOCK: usize = 8;
/// The first four bits.
const BITS: i32x4 = i32x4::new([1, 2, 4, 8]);
/// The first column of a block.
const COLUMN: u64 = 0x0101_0101_0101_0101;

/// Finds the nearest triangle at each sample of these pixels; `place` gives the number of each among them. Of two at the same
/// depth it is the later. Triangles that are known to be `seen` come first, so that most others are hidden by then.
pub(crate) fn at_samples<'c, const N: usize>(
    pattern: &Pattern<N>,
    size: [usize; 2],
    triangles: &Given<impl Fn(usize) -> [Place; 3], impl Fn(usize) -> Option<Cut<'c>>>,
    (pixels, place): (&[u32], impl Fn(usize) -> usize),
    seen: impl Fn(usize) -> bool,
) -> Nearest<N> {
    let count = pixels.len();
    let mut nearest = Nearest { numbers: vec![[0; N]; count], depths: vec![[f32::NEG_INFINITY; N]; count] };
    let Given { corners, cut, .. } = triangles;
    let area = Area { samples: &fragments::places(pattern), place, size };
    let blocks = Blocks::new(size, pixels, |_| f32::NEG_INFINITY);
    for number in (0..triangles.count).filter(|number| seen(*number)) {
        nearest.add(&area, &blocks, (number, corners(number), || cut(number)), |_, _| true);
    }
    let farthest = |depths: &[f32; N]| depths.iter().copied().fold(f32::INFINITY, f32::min);
    let far: Vec<f32> = nearest.depths.iter().map(farthest).collect();
    let blocks = Blocks::new(size, pixels, |place| far[place]);
    let is_open = |place: usize, depth: f32| depth + EQUAL >= far[place];
    for number in (0..triangles.count).filter(|number| !seen(*number)) {
        nearest.add(&area, &blocks, (number, corners(number), || cut(number)), is_open);
    }
    nearest
}

/// Pixels that have samples, by blocks, so that those of them that a triangle may touch are found at once.
struct Blocks {
    /// Blocks in a row.
    width: usize,
    /// By block: the depth of what is farthest in its pixels, and these, a bit each, row by row.
    far: Vec<f32>,
    pixels: Vec<u64>,
}

impl Blocks {
    /// Of these pixels. What is there is at this depth.
    fn new([width, height]: [usize; 2], pixels: &[u32], depth: impl Fn(usize) -> f32) -> Blocks {
        let size = [width, height].map(|side| side.div_ceil(BLOCK));
        let count = size[0] * size[1];
        let mut blocks = Blocks { width: size[0], far: vec![f32::INFINITY; count], pixels: vec![0; count] };
        for (place, pixel) in pixels.iter().enumerate() {
            let (column, row) = (*pixel as usize % width, *pixel as usize / width);
            let block = row / BLOCK * size[0] + column / BLOCK;
            blocks.pixels[block] |= 1 << (row % BLOCK * BLOCK + column % BLOCK);
            blocks.far[block] = depth(place).min(blocks.far[block]);
        }
        blocks
    }

    /// The pixels that have samples in a block, of those within some lines and columns of blocks, if something at this depth may be seen there.
    #[inline(always)]
    fn open(&self, block: usize, within: u64, depth: f32) -> u64 {
        let pixels = self.pixels[block] & within;
        if pixels != 0 && depth + EQUAL >= self.far[block] { pixels } else { 0 }
    }
}

/// The bits from the first to the last of a range that are within a block, which are so far apart.
#[inline(always)]
fn within(block: usize, [first, last]: [usize; 2], apart: u32) -> u64 {
    let (from, to) = (first.saturating_sub(block * BLOCK), (last - block * BLOCK).min(BLOCK - 1));
    let bits = u64::MAX >> (64 - apart * (to + 1) as u32);
    bits & !0 << (apart * from as u32)
}

/// Where there are samples.
struct Area<'a, const N: usize, P> {
    samples: &'a Places<N>,
    /// Of a pixel that has samples: its place among those.
    place: P,
    size: [usize; 2],
}

/// A triangle at samples.
struct Drawn<'c, const N: usize> {
    number: u32,
    ready: Ready,
    cover: Cover<N>,
    cut: Option<Cut<'c>>,
    /// What the samples of a pixel add to a side's function at most.
    most: [i64; 3],
}

impl<'c, const N: usize> Drawn<'c, N> {
    fn new(number: u32, ready: Ready, cut: Option<Cut<'c>>, samples: &Places<N>) -> Drawn<'c, N> {
        let cover = Cover::new(&ready.sides, samples);
        let most = ready.sides.map(|[_, a, b]| (a.max(0) + b.max(0)) * STEPS);
        Drawn { number, ready, cover, cut, most }
    }

    /// The values of the functions of the sides at the corner of a pixel.
    fn at(&self, [column, row]: [usize; 2]) -> [i64; 3] {
        let Ready { columns, rows, sides: [p, q, r], .. } = &self.ready;
        let right = (column as i64 - columns[0] as i64) * STEPS;
        let down = (row as i64 - rows[0] as i64) * STEPS;
        [p, q, r].map(|[value, a, b]| value + a * right + b * down)
    }

    /// Whether all of so many pixels to the right and down from one are outside.
    fn is_beside(&self, pixel: [usize; 2], count: i64) -> bool {
        self.is_outside(self.at(pixel), count)
    }

    /// The same, given the values at the corner of that one.
    #[inline(always)]
    fn is_outside(&self, here: [i64; 3], count: i64) -> bool {
        let most = self.most;
        (here[0] + most[0] * count) | (here[1] + most[1] * count) | (here[2] + most[2] * count) < 0
    }
}

impl<const N: usize> Nearest<N> {
    /// Adds a triangle where it is in front. `is_open` tells whether something at this depth may be seen at a place.
    fn add<'c>(
        &mut self,
        area: &Area<N, impl Fn(usize) -> usize>,
        blocks: &Blocks,
        (number, corners, cut): (usize, [Place; 3], impl FnOnce() -> Option<Cut<'c>>),
        is_open: impl Fn(usize, f32) -> bool,
    ) {
        let [width, height] = area.size;
        let [p, q, r] = corners;
        let Some(columns) = range([p.x, q.x, r.x], width) else { return };
        let Some(rows) = range([p.y, q.y, r.y], height) else { return };
        let front = p.depth.max(q.depth).max(r.depth);
        // Most triangles touch no pixel that has samples.
        let (mut drawn, mut cut): (Option<Drawn<N>>, _) = (None, Some(cut));
        for row in rows[0] / BLOCK..rows[1] / BLOCK + 1 {
            let lines = within(row, rows, BLOCK as u32);
            for column in columns[0] / BLOCK..columns[1] / BLOCK + 1 {
                let bits = lines & (within(column, columns, 1) * COLUMN);
                let mut pixels = blocks.open(row * blocks.width + column, bits, front);
                let first = [column * BLOCK, row * BLOCK];
                if pixels == 0 || drawn.as_ref().is_some_and(|drawn| drawn.is_beside(first, BLOCK as i64)) {
                    continue;
                }
                while pixels != 0 {
                    let bit = pixels.trailing_zeros() as usize;
                    pixels &= pixels - 1;
                    let pixel = [first[0] + bit % BLOCK, first[1] + bit / BLOCK];
                    let place = (area.place)(pixel[1] * width + pixel[0]);
                    if !is_open(place, front) {
                        continue;
                    }
                    if drawn.is_none() {
                        let ready = Ready::new(corners, width, &(0..height));
                        let cut = cut.take().and_then(|cut| cut());
                        drawn = ready.map(|ready| Drawn::new(number as u32 + 1, ready, cut, area.samples));
                    }
                    let Some(drawn) = &drawn else { return };
                    self.add_at(place, area.samples, drawn, pixel);
                }
            }
        }
    }

    /// Adds a triangle in a pixel.
    fn add_at(&mut self, place: usize, samples: &Places<N>, drawn: &Drawn<N>, pixel: [usize; 2]) {
        let [xs, ys] = samples;
        let here = drawn.at(pixel);
        if drawn.is_outside(here, 1) {
            return;
        }
        let covered = drawn.cover.mask(here);
        let mask = drawn.cut.as_ref().map_or(covered, |cut| left_of(cut, covered, pixel, samples));
        if mask == 0 {
            return;
        }
        let plane = &drawn.ready.plane;
        let base = plane.at(pixel);
        let numbers = self.numbers[place].as_chunks_mut::<4>().0;
        let depths = self.depths[place].as_chunks_mut::<4>().0;
        let [xs, ys] = [xs, ys].map(|at| at.as_chunks::<4>().0);
        let (number, equal) = (i32x4::splat(drawn.number as i32), f32x4::splat(EQUAL));
        for k in 0..N / 4 {
            let (held, far) = (cast::<[u32; 4], i32x4>(numbers[k]), f32x4::new(depths[k]));
            let depth = plane.samples(base, [f32x4::new(xs[k]), f32x4::new(ys[k])]);
            let is_later: f32x4 = cast(number.simd_gt(held));
            let least = is_later.select(depth + equal, depth - equal);
            let is_covered = (i32x4::splat((mask >> (4 * k)) as i32) & BITS).simd_eq(BITS);
            let is_nearer = is_covered & cast::<f32x4, i32x4>(least.simd_ge(far));
            numbers[k] = cast(is_nearer.select(number, held));
            depths[k] = cast(cast::<i32x4, f32x4>(is_nearer).select(depth.fast_max(far), far));
        }
    }
}
