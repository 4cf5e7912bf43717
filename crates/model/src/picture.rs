//! Pictures on surfaces: texels at every size, and their mean in the neighbourhood of a place.
//!
//! Coordinates are those of Wavefront OBJ: u runs from the left edge of the picture to the right one, v from the lower edge to the upper one,
//! both from 0 to 1. A picture is kept at half its size, a quarter and so on down to one texel (Williams 1983, *Pyramidal parametrics*), each an area average,
//! so that a surface that is small costs few texels and does not flicker. Means are those of sRGB values, as the pixels of a picture are means of samples; a texel
//! counts by its opacity, so nothing of the colour of what is cut out shows.
//!
//! Where the opacity is below a half, the surface is cut out. In smaller copies the limit is another one, by which as large a part of the picture is
//! cut out as of the whole: the mean of thin parts would fall below a half, and needles would vanish in the distance (Castaño 2010, *Computing alpha
//! mipmaps*).

use std::sync::Arc;

use crate::Rgb;

/// The least opacity of 255 that is drawn.
const DRAWN: u8 = 128;
/// Copies tell what is cut out if they are at least as large as this along one side, and the part that is cut out differs by at most that: of a comb
/// with fine teeth, for example, a small copy is of one opacity.
const LEAST_CUT: usize = 16;
const MOST_OFF: f64 = 0.1;
/// Most means that are taken along the longer side of a slanting neighbourhood.
const MOST_SLANTING: f64 = 8.0;

/// A picture for surfaces, with its smaller copies.
#[derive(Debug)]
pub struct Picture {
    /// The path of its file as the model has it.
    pub path: Arc<str>,
    /// The file as it is.
    pub file: Vec<u8>,
    /// The picture itself, then each half as large as the one before.
    levels: Vec<Level>,
    /// The last copy that tells what is cut out.
    last_cut: usize,
    is_cut_out: bool,
    /// By row of blocks of [`BLOCK`] texels along each side: whether all of a block is drawn, or nothing of it.
    blocks: Vec<Drawn>,
}

/// Texels along a side of a block.
const BLOCK: usize = 8;

/// How much of a part of a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// Nothing of it.
    Nothing,
    /// Some of it, perhaps.
    Some,
    /// All of it.
    All,
}

#[derive(Debug)]
struct Level {
    size: [usize; 2],
    /// By row from the upper one: red, green, blue, opacity.
    texels: Vec<[u8; 4]>,
    /// The least opacity that is drawn.
    drawn: u8,
}

impl PartialEq for Picture {
    fn eq(&self, other: &Picture) -> bool {
        self.path == other.path && self.file == other.file
    }
}

impl Eq for Picture {}

/// A picture on a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// The picture.
    pub picture: Arc<Picture>,
    /// Beyond its edges it is repeated; else its edges go on.
    pub repeats: bool,
}

/// The part of a picture that a pixel shows: a middle, and the ways to the next pixels to the right and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The place in the middle.
    pub at: [f64; 2],
    /// From there to the next pixels.
    pub steps: [[f64; 2]; 2],
}

impl Picture {
    /// A picture of this width and height, given by rows from the upper one: red, green, blue and opacity of each texel. `None` if there are not
    /// as many texels.
    pub fn new(
        path: &str,
        file: Vec<u8>,
        [width, height]: [usize; 2],
        texels: Vec<[u8; 4]>,
    ) -> Option<Picture> {
        if texels.is_empty() || texels.len() != width.checked_mul(height)? {
            return None;
        }
        let is_cut_out = texels.iter().any(|texel| texel[3] < DRAWN);
        let whole = Level { size: [width, height], texels, drawn: DRAWN };
        let part = whole.part(DRAWN);
        let mut levels = vec![whole];
        while let Some(level) = levels.last().filter(|level| level.size != [1, 1]) {
            let mut half = level.halved();
            half.drawn = if is_cut_out { half.limit(part) } else { 0 };
            levels.push(half);
        }
        let tells = |level: &&Level| {
            level.size[0].max(level.size[1]) >= LEAST_CUT
                && (level.part(level.drawn) - part).abs() <= MOST_OFF
        };
        let last_cut = levels.iter().take_while(tells).count().saturating_sub(1);
        let blocks = levels.first().map_or_else(Vec::new, Level::blocks);
        Some(Picture { path: path.into(), file, levels, last_cut, is_cut_out, blocks })
    }

    /// Width and height in texels.
    pub fn size(&self) -> [usize; 2] {
        self.levels[0].size
    }

    /// The texels by row from the upper one: red, green, blue and opacity.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.levels[0].texels
    }

    /// The texels of the largest copy that is no wider and no higher than this.
    pub fn small(&self, side: usize) -> &[[u8; 4]] {
        let fits = |level: &&Level| level.size[0].max(level.size[1]) <= side.max(1);
        self.levels.iter().find(fits).map_or(&[], |level| &level.texels)
    }

    /// Whether some of it is cut out.
    pub fn is_cut_out(&self) -> bool {
        self.is_cut_out
    }

    /// The mean colour of what is drawn.
    pub fn mean(&self) -> Rgb {
        let (mut sum, mut count) = ([0_u64; 3], 0_u64);
        for texel in self.texels().iter().filter(|texel| texel[3] >= DRAWN) {
            (0..3).for_each(|k| sum[k] += u64::from(texel[k]));
            count += 1;
        }
        let [red, green, blue] =
            sum.map(|sum| (sum + count / 2).checked_div(count).unwrap_or_default() as Rgb);
        red << 16 | green << 8 | blue
    }
}

impl Texture {
    /// The mean colour of a part of the picture, from 0 to 255.
    pub fn color(&self, print: &Footprint) -> [f64; 3] {
        let (level, longer, count) = self.means(print);
        let mut sum = [0.0; 4];
        for i in 0..count {
            let off = (i as f64 + 0.5) / count as f64 - 0.5;
            let at = [0, 1].map(|k| print.at[k] + off * longer[k]);
            let mean = self.between(level, at);
            (0..4).for_each(|k| sum[k] += mean[k]);
        }
        [0, 1, 2].map(|k| sum[k] / sum[3])
    }

    /// Whether the surface is drawn at a place, if places at which that is decided are so many texels apart.
    pub fn is_drawn(&self, at: [f64; 2], apart: f64) -> bool {
        if !self.picture.is_cut_out {
            return true;
        }
        let level = apart.log2().floor();
        let number = if level > 0.0 { (level as usize).min(self.picture.last_cut) } else { 0 };
        let level = &self.picture.levels[number];
        let (mut opacity, near) = (0.0, self.near(level, at));
        for (texel, weight) in near {
            opacity += f64::from(texel[3]) * weight;
        }
        opacity >= f64::from(level.drawn) - 0.5
    }

    /// How much is drawn between two opposite places and up to `apart` texels around; most parts of a leaf are far from its edge.
    pub fn drawn(&self, [low, high]: [[f64; 2]; 2], apart: f64) -> Drawn {
        const MOST: usize = 9;
        let picture = &self.picture;
        let margin = 1.5 + 2.0 * apart;
        let rows = picture.size()[0].div_ceil(BLOCK);
        let mut ranges = [(0, 0); 2];
        for (k, range) in ranges.iter_mut().enumerate() {
            let side = picture.size()[k] as f64;
            let (from, to) = if k == 0 { (low[0], high[0]) } else { (1.0 - high[1], 1.0 - low[1]) };
            let (from, to) = (from * side - margin, to * side + margin);
            // Beyond its edges a picture is repeated or goes on: that is left to the places themselves.
            if !(from >= 0.0 && to < side) {
                return Drawn::Some;
            }
            *range = (from as usize / BLOCK, to as usize / BLOCK);
        }
        let [(left, right), (top, bottom)] = ranges;
        if (right - left + 1) * (bottom - top + 1) > MOST {
            return Drawn::Some;
        }
        let first = picture.blocks[top * rows + left];
        let mut all = (top..=bottom).flat_map(|row| &picture.blocks[row * rows + left..=row * rows + right]);
        if all.all(|block| *block == first) { first } else { Drawn::Some }
    }

    /// The copies whose texels are as large as the shorter side of a part of the picture, as a number with a fraction; the longer side; and how many means
    /// are to be taken along that.
    fn means(&self, print: &Footprint) -> (f64, [f64; 2], usize) {
        let size = self.picture.size().map(|side| side as f64);
        let length = |step: [f64; 2]| (step[0] * size[0]).hypot(step[1] * size[1]);
        let [a, b] = print.steps.map(length);
        let (longer, shorter) = if a >= b { (print.steps[0], b) } else { (print.steps[1], a) };
        let longest = a.max(b);
        let count = (longest / shorter.max(1.0)).ceil().clamp(1.0, MOST_SLANTING);
        let level = (longest / count).log2();
        let last = self.picture.levels.len() as f64 - 1.0;
        let level = if level > 0.0 { level.min(last) } else { 0.0 };
        (level, longer, if longest.is_finite() { count as usize } else { 1 })
    }

    /// The mean of red, green and blue, each times the opacity, and the opacity, between two copies.
    fn between(&self, level: f64, at: [f64; 2]) -> [f64; 4] {
        let (low, part) = (level as usize, level.fract());
        let one = |number: usize| {
            let mut sum = [0.0; 4];
            for (texel, weight) in self.near(&self.picture.levels[number], at) {
                // What is open counts a little, so that there is a colour wherever it is needed.
                let weight = weight * (f64::from(texel[3]) + 1e-3);
                (0..3).for_each(|k| sum[k] += f64::from(texel[k]) * weight);
                sum[3] += weight;
            }
            sum
        };
        let (mut sum, high) = (one(low), (low + 1).min(self.picture.levels.len() - 1));
        if part > 0.0 && high > low {
            let more = one(high);
            (0..4).for_each(|k| sum[k] += (more[k] - sum[k]) * part);
        }
        sum
    }

    /// The four texels around a place with their weights.
    fn near<'p>(&self, level: &'p Level, at: [f64; 2]) -> [(&'p [u8; 4], f64); 4] {
        let flipped = [at[0], 1.0 - at[1]];
        let axis = |k: usize| {
            let side = level.size[k];
            let place = if self.repeats { flipped[k].rem_euclid(1.0) } else { flipped[k].clamp(0.0, 1.0) };
            let place = if place.is_finite() { place * side as f64 - 0.5 } else { 0.0 };
            let first = place.floor();
            let number = |i: f64| match self.repeats {
                true => (i as i64).rem_euclid(side as i64) as usize,
                false => i.clamp(0.0, side as f64 - 1.0) as usize,
            };
            ([number(first), number(first + 1.0)], place - first)
        };
        let (([left, right], u), ([above, below], v)) = (axis(0), axis(1));
        let texel = |column: usize, row: usize| &level.texels[row * level.size[0] + column];
        [
            (texel(left, above), (1.0 - u) * (1.0 - v)),
            (texel(right, above), u * (1.0 - v)),
            (texel(left, below), (1.0 - u) * v),
            (texel(right, below), u * v),
        ]
    }
}

impl Level {
    /// Half as large, each texel the mean of the area that it stands for.
    fn halved(&self) -> Level {
        let size = self.size.map(|side| (side / 2).max(1));
        // For each new row or column the old ones in it, with the part of each.
        let axis = |k: usize| -> Vec<Vec<(usize, f32)>> {
            let ratio = self.size[k] as f64 / size[k] as f64;
            (0..size[k])
                .map(|i| {
                    let (from, end) = (i as f64 * ratio, (i + 1) as f64 * ratio);
                    let all = (from as usize..self.size[k]).take_while(|old| (*old as f64) < end);
                    all.map(|old| (old, (end.min(old as f64 + 1.0) - from.max(old as f64)) as f32)).collect()
                })
                .collect()
        };
        let (columns, rows) = (axis(0), axis(1));
        let mut texels = Vec::with_capacity(size[0] * size[1]);
        for row in &rows {
            for column in &columns {
                let (mut sum, mut opacity, mut area) = ([0.0_f32; 3], 0.0_f32, 0.0_f32);
                let mut open = [0.0_f32; 3];
                for (y, high) in row {
                    for (x, wide) in column {
                        let texel = self.texels[y * self.size[0] + x];
                        let (part, own) = (high * wide, f32::from(texel[3]));
                        for k in 0..3 {
                            sum[k] += part * own * f32::from(texel[k]);
                            open[k] += part * f32::from(texel[k]);
                        }
                        opacity += part * own;
                        area += part;
                    }
                }
                let color = |k: usize| if opacity > 0.0 { sum[k] / opacity } else { open[k] / area };
                let [red, green, blue] = [0, 1, 2].map(|k| (color(k) + 0.5) as u8);
                texels.push([red, green, blue, (opacity / area + 0.5) as u8]);
            }
        }
        Level { size, texels, drawn: DRAWN }
    }

    /// Whether all or nothing of each block is drawn in this copy and in all smaller ones: all of it is fully opaque, or fully transparent.
    fn blocks(&self) -> Vec<Drawn> {
        let [columns, rows] = self.size.map(|side| side.div_ceil(BLOCK));
        let mut blocks: Vec<Option<Drawn>> = vec![None; columns * rows];
        for (i, texel) in self.texels.iter().enumerate() {
            let own = match texel[3] {
                0 => Drawn::Nothing,
                255 => Drawn::All,
                _ => Drawn::Some,
            };
            let block = &mut blocks[i / self.size[0] / BLOCK * columns + i % self.size[0] / BLOCK];
            *block = Some(if block.is_none_or(|known| known == own) { own } else { Drawn::Some });
        }
        blocks.into_iter().map(|block| block.unwrap_or(Drawn::Some)).collect()
    }

    /// The part of the texels that are at least so opaque.
    fn part(&self, least: u8) -> f64 {
        self.texels.iter().filter(|texel| texel[3] >= least).count() as f64 / self.texels.len() as f64
    }

    /// The least opacity that so large a part of the texels has; of several the one next to that of the whole picture.
    fn limit(&self, part: f64) -> u8 {
        let mut counts = [0_usize; 256];
        self.texels.iter().for_each(|texel| counts[usize::from(texel[3])] += 1);
        let (mut best, mut drawn) = ((f64::INFINITY, DRAWN), 0);
        for least in (1..=255_u8).rev() {
            drawn += counts[usize::from(least)];
            let off = (drawn as f64 / self.texels.len() as f64 - part).abs();
            if off < best.0 || off == best.0 && least >= DRAWN {
                best = (off, least);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(size: [usize; 2], texel: impl Fn(usize, usize) -> [u8; 4]) -> Texture {
        let texels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y));
        let picture = Picture::new("p.png", Vec::new(), size, texels.collect()).expect("as many texels");
        Texture { picture: Arc::new(picture), repeats: false }
    }

    fn print(at: [f64; 2], step: f64) -> Footprint {
        Footprint { at, steps: [[step, 0.0], [0.0, step]] }
    }

    #[test]
    fn coordinates_begin_at_the_lower_left_corner() {
        let [red, blue] = [[255, 0, 0, 255], [0, 0, 255, 255]];
        let corner = texture([4, 4], |x, y| if x < 2 && y >= 2 { red } else { blue });
        let red_at = |texture: &Texture, at| texture.color(&print(at, 0.0))[0].round();
        assert_eq!((red_at(&corner, [0.1, 0.1]), red_at(&corner, [0.1, 0.9])), (255.0, 0.0));
        assert_eq!(red_at(&corner, [-3.0, -3.0]), 255.0, "the edge goes on");
        let repeated = Texture { repeats: true, ..corner };
        assert_eq!((red_at(&repeated, [-2.75, 4.25]), red_at(&repeated, [-2.75, 4.75])), (255.0, 0.0));
    }

    /// From far away a picture of any size is its mean; what is cut out has no colour.
    #[test]
    fn small_copies_are_means_of_what_is_drawn() {
        for size in [[64, 64], [37, 21], [1, 9]] {
            let value = |x: usize, y: usize| ((x * 7 + y * 13) % 200) as u8;
            let speckled =
                texture(
                    size,
                    |x, y| {
                        if (x + y) % 3 == 0 { [255, 0, 255, 0] } else { [value(x, y), 10, 20, 255] }
                    },
                );
            let [red, green, blue] = speckled.color(&print([0.4, 0.6], 2.0));
            let mean = speckled.picture.mean();
            assert!((red - f64::from(mean >> 16)).abs() < 4.0, "{size:?}: {red} {mean:x}");
            assert!((green - 10.0).abs() < 1.5 && (blue - 20.0).abs() < 1.5, "{green} {blue}");
        }
    }

    /// However small it is, about the same part of thin needles is drawn.
    #[test]
    fn needles_do_not_vanish_in_the_distance() {
        let needles = texture([256, 256], |x, _| [0, 99, 0, if x % 8 < 2 { 255 } else { 0 }]);
        for apart in [0.0, 2.0, 4.0, 8.0, 256.0] {
            let places = (0..40_000).map(|i| [f64::from(i % 200) / 199.7, f64::from(i / 200) / 199.7]);
            let drawn = places.filter(|at| needles.is_drawn(*at, apart)).count() as f64 / 40_000.0;
            assert!((drawn - 0.25).abs() < 0.13, "{apart}: {drawn}");
        }
    }

    /// A block that counts as drawn or open is so at every place in it, at any distance of places.
    #[test]
    fn blocks_agree_with_places() {
        let disc = texture([280, 200], |x, y| {
            let away = (x as f64 - 140.0).hypot(y as f64 - 100.0);
            [9, 9, 9, (128.0 + 60.0 * (80.0 - away)).clamp(0.0, 255.0) as u8]
        });
        let mut sure = 0;
        for apart in [0.0, 1.0, 3.0] {
            for i in 0..900 {
                let low = [f64::from(i % 30) / 30.0, f64::from(i / 30) / 30.0];
                let high = low.map(|x| x + 0.03);
                let known = disc.drawn([low, high], apart);
                let places = [low, high, [low[0], high[1]], [high[0], low[1]]];
                let drawn = places.map(|at| disc.is_drawn(at, apart));
                match known {
                    Drawn::All => assert_eq!(drawn, [true; 4], "{low:?} {apart}"),
                    Drawn::Nothing => assert_eq!(drawn, [false; 4], "{low:?} {apart}"),
                    Drawn::Some => continue,
                }
                sure += 1;
            }
        }
        // Of 1,800 places at the first two distances; at the third, most meet more blocks than are looked at.
        assert!(sure > 900, "{sure}");
    }

    #[test]
    fn sizes_and_texels_agree() {
        assert!(Picture::new("p.png", Vec::new(), [2, 2], vec![[0; 4]; 3]).is_none());
        assert!(Picture::new("p.png", Vec::new(), [0, 0], Vec::new()).is_none());
    }
}
