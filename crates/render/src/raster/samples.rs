//! Which triangle is the nearest at several samples of some pixels: those in which edges are.

use super::band::left_of;
use super::cells::{Given, Nearest};
use super::fragments::{self, Cover, Places};
use super::plane::Ready;
use super::{EQUAL, Pattern, Place, STEPS, range};
use crate::mapping::Cut;

/// Eight samples, no two in a row or column.
pub(crate) const EIGHT: Pattern<8> = [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)];
/// In a rectangle of no more pixels than this, those that have samples are looked for before it is known which the triangle touches.
const FEW: usize = 256;
/// Pixels along a side of a block, as a power of two.
const BLOCK: u32 = 3;

/// Finds the nearest triangle at each sample of these pixels; `places` has the number of each among them, from 1 on, and 0 for others. Of two at the same
/// depth it is the later. Triangles that are known to be `seen` come first, so that most others are hidden by then.
pub(crate) fn at_samples<'c, const N: usize>(
    pattern: &Pattern<N>,
    size: [usize; 2],
    triangles: &Given<impl Fn(usize) -> [Place; 3], impl Fn(usize) -> Option<Cut<'c>>>,
    (pixels, places): (&[u32], &[u32]),
    seen: impl Fn(usize) -> bool,
) -> Nearest<N> {
    let count = pixels.len();
    let mut nearest = Nearest { numbers: vec![[0; N]; count], depths: vec![[f32::NEG_INFINITY; N]; count] };
    let Given { corners, cut, .. } = triangles;
    let area = Area { samples: &fragments::places(pattern), places, size };
    for number in (0..triangles.count).filter(|number| seen(*number)) {
        nearest.add(&area, (number, corners(number), || cut(number)), |_, _| true);
    }
    let farthest = |depths: &[f32; N]| depths.iter().copied().fold(f32::INFINITY, f32::min);
    let far: Vec<f32> = nearest.depths.iter().map(farthest).collect();
    let is_open = |place: usize, depth: f32| far.get(place).is_some_and(|far| depth + EQUAL >= *far);
    let blocks = Blocks::new(size, pixels, &far);
    for number in (0..triangles.count).filter(|number| !seen(*number)) {
        let corners = corners(number);
        if blocks.is_open(&corners) {
            nearest.add(&area, (number, corners, || cut(number)), is_open);
        }
    }
    nearest
}

/// By block of pixels the depth of what is farthest in those that have samples, so that most of what is hidden is passed at once.
struct Blocks {
    size: [usize; 2],
    far: Vec<f32>,
}

impl Blocks {
    /// Of these pixels, which have these depths.
    fn new([width, height]: [usize; 2], pixels: &[u32], depths: &[f32]) -> Blocks {
        let size = [width, height].map(|side| (side >> BLOCK) + 1);
        let mut far = vec![f32::INFINITY; size[0] * size[1]];
        for (pixel, depth) in pixels.iter().zip(depths) {
            let [column, row] = [*pixel as usize % width, *pixel as usize / width].map(|at| at >> BLOCK);
            let known = &mut far[row * size[0] + column];
            *known = known.min(*depth);
        }
        Blocks { size, far }
    }

    /// Whether a triangle may be in front of something.
    fn is_open(&self, corners: &[Place; 3]) -> bool {
        let front = front(corners);
        let range = |at: [i32; 3], count| range(at.map(|at| i64::from(at) >> BLOCK), count);
        let columns = range(corners.map(|corner| corner.x), self.size[0]);
        let rows = range(corners.map(|corner| corner.y), self.size[1]);
        let Some(([left, right], [top, bottom])) = columns.zip(rows) else { return false };
        (top..=bottom).any(|row| {
            let line = &self.far[row * self.size[0]..][left..=right];
            line.iter().any(|far| front + EQUAL >= *far)
        })
    }
}

/// The depth of the nearest corner.
fn front(corners: &[Place; 3]) -> f32 {
    corners[0].depth.max(corners[1].depth).max(corners[2].depth)
}

/// Where there are samples.
struct Area<'a, const N: usize> {
    samples: &'a Places<N>,
    /// By pixel: its place, from 1 on, or 0.
    places: &'a [u32],
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
        let Ready { columns, rows, sides, .. } = &self.ready;
        let by = [column as i64 - columns[0] as i64, row as i64 - rows[0] as i64].map(|by| by * STEPS);
        sides.map(|[value, a, b]| value + a * by[0] + b * by[1])
    }

    /// Whether all samples of a pixel where the functions of the sides have these values are outside.
    fn is_beside(&self, here: [i64; 3]) -> bool {
        (here[0] + self.most[0]) | (here[1] + self.most[1]) | (here[2] + self.most[2]) < 0
    }
}

impl<const N: usize> Nearest<N> {
    /// Adds a triangle where it is in front. `is_open` tells whether something at this depth may be seen at a place.
    fn add<'c>(
        &mut self,
        area: &Area<N>,
        (number, corners, cut): (usize, [Place; 3], impl FnOnce() -> Option<Cut<'c>>),
        is_open: impl Fn(usize, f32) -> bool,
    ) {
        let [width, height] = area.size;
        let columns = range(corners.map(|corner| i64::from(corner.x)), width);
        let rows = range(corners.map(|corner| i64::from(corner.y)), height);
        let Some(([left, right], [top, bottom])) = columns.zip(rows) else { return };
        let front = front(&corners);
        let open = |[column, row]: [usize; 2]| {
            let place = (area.places[row * width + column] as usize).checked_sub(1)?;
            is_open(place, front).then_some(place)
        };
        let drawn = || {
            let ready = Ready::new(corners, width, &(0..height))?;
            Some(Drawn::new(number as u32 + 1, ready, cut(), area.samples))
        };
        if (right - left + 1) * (bottom - top + 1) > FEW {
            if let Some(drawn) = drawn() {
                self.add_large(area, &drawn, open);
            }
            return;
        }
        // Most of them touch no pixel that has samples.
        let mut pixels = (top..=bottom).flat_map(|row| (left..=right).map(move |column| [column, row]));
        let Some(first) = pixels.find(|pixel| open(*pixel).is_some()) else { return };
        let Some(drawn) = drawn() else { return };
        for pixel in std::iter::once(first).chain(pixels) {
            let Some(place) = open(pixel) else { continue };
            let here = drawn.at(pixel);
            if !drawn.is_beside(here) {
                self.add_at(place, area, &drawn, (pixel, here));
            }
        }
    }

    /// Adds a triangle row by row, from side to side.
    fn add_large(&mut self, area: &Area<N>, drawn: &Drawn<N>, open: impl Fn([usize; 2]) -> Option<usize>) {
        let Ready { columns, rows, sides, .. } = &drawn.ready;
        for row in rows[0]..=rows[1] {
            let mut corner = drawn.at([columns[0], row]);
            let mut entered = false;
            for column in columns[0]..=columns[1] {
                let here = corner;
                (0..3).for_each(|k| corner[k] += sides[k][1] * STEPS);
                if drawn.is_beside(here) {
                    if entered {
                        break;
                    }
                    continue;
                }
                entered = true;
                if let Some(place) = open([column, row]) {
                    self.add_at(place, area, drawn, ([column, row], here));
                }
            }
        }
    }

    /// Adds a triangle in a pixel.
    fn add_at(
        &mut self,
        place: usize,
        area: &Area<N>,
        drawn: &Drawn<N>,
        (pixel, here): ([usize; 2], [i64; 3]),
    ) {
        let [xs, ys] = area.samples;
        let covered = drawn.cover.mask(here);
        let mask = drawn.cut.as_ref().map_or(covered, |cut| left_of(cut, covered, pixel, area.samples));
        if mask == 0 {
            return;
        }
        let plane = &drawn.ready.plane;
        let base = plane.at(pixel);
        let (numbers, depths) = (&mut self.numbers[place], &mut self.depths[place]);
        // Without branches, so that the compiler works on several samples at a time.
        for s in 0..N {
            let depth = plane.sample(base, [xs[s], ys[s]]);
            let least = if drawn.number > numbers[s] { depth + EQUAL } else { depth - EQUAL };
            let is_nearer = mask >> s & 1 == 1 && least >= depths[s];
            let nearest = if depth > depths[s] { depth } else { depths[s] };
            depths[s] = if is_nearer { nearest } else { depths[s] };
            numbers[s] = if is_nearer { drawn.number } else { numbers[s] };
        }
    }
}
