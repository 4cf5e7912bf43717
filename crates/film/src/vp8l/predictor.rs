//! The predictor transform (RFC 9649, section 3.5.1): each pixel as its difference from a mixture of its neighbours.

/// Ways of prediction.
const MODES: usize = 14;
/// A pixel without neighbours: opaque black.
const BLACK: u32 = 0xff00_0000;

/// Differences by channel, modulo 256.
fn difference(a: u32, b: u32) -> u32 {
    // Each channel borrows from ones between the channels.
    let odd = ((a & 0xff00_ff00) | 0x00ff_00ff).wrapping_sub(b & 0xff00_ff00);
    let even = ((a & 0x00ff_00ff) | 0xff00_ff00) - (b & 0x00ff_00ff);
    (odd & 0xff00_ff00) | (even & 0x00ff_00ff)
}

/// Means by channel, rounded down.
fn mean(a: u32, b: u32) -> u32 {
    (((a ^ b) & 0xfefe_fefe) >> 1) + (a & b)
}

fn by_channel(f: impl Fn(usize) -> i32) -> u32 {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| f(i).clamp(0, 255) as u8))
}

/// The neighbours of a pixel: left, top, top right, top left.
#[derive(Clone, Copy)]
struct Around {
    left: u32,
    top: u32,
    right: u32,
    corner: u32,
}

impl Around {
    /// Those of a pixel that is neither in the first row nor in the first column.
    fn of(pixels: &[u32], at: usize, width: usize) -> Around {
        let above = at - width;
        Around {
            left: pixels[at - 1],
            top: pixels[above],
            right: pixels[above + 1],
            corner: pixels[above - 1],
        }
    }

    fn bytes(self) -> [[i32; 4]; 3] {
        [self.left, self.top, self.corner].map(|pixel| pixel.to_le_bytes().map(i32::from))
    }

    /// Left or top, whichever is nearer to left + top - corner.
    fn select(self) -> u32 {
        let [left, top, corner] = self.bytes();
        let distance = |of: [i32; 4]| (0..4).map(|i| (of[i] - corner[i]).abs()).sum::<i32>();
        if distance(top) < distance(left) { self.left } else { self.top }
    }

    fn full(self) -> u32 {
        let [left, top, corner] = self.bytes();
        by_channel(|i| left[i] + top[i] - corner[i])
    }

    fn half(self) -> u32 {
        let between = mean(self.left, self.top).to_le_bytes().map(i32::from);
        let corner = self.corner.to_le_bytes().map(i32::from);
        by_channel(|i| between[i] + (between[i] - corner[i]) / 2)
    }

    fn all(self) -> [u32; MODES] {
        let Around { left, top, right, corner } = self;
        let [before, behind] = [mean(left, corner), mean(top, right)];
        [
            BLACK,
            left,
            top,
            right,
            corner,
            mean(mean(left, right), top),
            before,
            mean(left, top),
            mean(corner, top),
            behind,
            mean(before, behind),
            self.select(),
            self.full(),
            self.half(),
        ]
    }

    fn one(self, mode: u8) -> u32 {
        let Around { left, top, right, corner } = self;
        match mode {
            0 => BLACK,
            1 => left,
            2 => top,
            3 => right,
            4 => corner,
            5 => mean(mean(left, right), top),
            6 => mean(left, corner),
            7 => mean(left, top),
            8 => mean(corner, top),
            9 => mean(top, right),
            10 => mean(mean(left, corner), mean(top, right)),
            11 => self.select(),
            12 => self.full(),
            _ => self.half(),
        }
    }
}

/// A picture as differences from predictions.
pub(super) struct Residuals {
    /// The mode of each tile.
    pub(super) modes: Vec<u8>,
    /// The binary logarithm of the side of tiles.
    pub(super) tile: u32,
    pub(super) pixels: Vec<u32>,
}

/// Bits by channel and difference.
type Costs = [[f32; 256]; 4];

/// A guess: small differences are frequent, and opacity hardly changes.
fn guess() -> Costs {
    let mut costs = [[0.0; 256]; 4];
    for (channel, costs) in costs.iter_mut().enumerate() {
        for (value, cost) in costs.iter_mut().enumerate() {
            let size = f32::from((value as u8 as i8).unsigned_abs());
            *cost = match (channel, value) {
                (3, 0) => 0.1,
                (3, _) => 6.0,
                _ => 1.0 + 1.8 * (1.0 + size).log2(),
            };
        }
    }
    costs
}

/// Bits of each difference, if it is as frequent as here.
fn costs_of(pixels: &[u32]) -> Costs {
    let mut counts = [[0_u32; 256]; 4];
    // Most pixels without any difference are in runs.
    for pixel in pixels.iter().filter(|pixel| **pixel != 0) {
        pixel
            .to_le_bytes()
            .into_iter()
            .zip(&mut counts)
            .for_each(|(value, counts)| counts[usize::from(value)] += 1);
    }
    counts.map(|counts| {
        let all: u32 = counts.iter().sum();
        let all = (all as f32 + 64.0).log2();
        counts.map(|count| all - (count as f32 + 0.25).log2())
    })
}

fn is_clear(pixel: u32) -> bool {
    pixel >> 24 == 0
}

/// Pixels as differences. With `open`, pixels of opacity 0 may get any colour, and get the one that is predicted.
pub(super) fn predict(pixels: &[u32], width: usize, open: bool, tile: u32) -> Residuals {
    let mut costs = guess();
    let mut modes = Vec::new();
    let mut residuals = Vec::new();
    for _ in 0..2 {
        let mut pixels = pixels.to_vec();
        modes = choose(&mut pixels, width, open, tile, &costs);
        residuals = apply(&mut pixels, width, open, tile, &modes);
        costs = costs_of(&residuals);
    }
    Residuals { modes, tile, pixels: residuals }
}

/// The best mode of each tile. Open pixels get colours that are near to those of [`apply`].
fn choose(pixels: &mut [u32], width: usize, open: bool, tile: u32, costs: &Costs) -> Vec<u8> {
    let height = pixels.len() / width;
    let side = 1 << tile;
    let mut modes = Vec::with_capacity(width.div_ceil(side) * height.div_ceil(side));
    for top in (0..height).step_by(side) {
        for left in (0..width).step_by(side) {
            let rows = top.max(1)..height.min(top + side);
            let columns = left.max(1)..width.min(left + side);
            let places = || rows.clone().flat_map(|y| columns.clone().map(move |x| y * width + x));
            // In a tile that is as clear as its left neighbour all modes are the same.
            let last = modes.last().copied().unwrap_or(0);
            if open && places().all(|at| is_clear(pixels[at])) {
                for at in places() {
                    pixels[at] = Around::of(pixels, at, width).one(last) & !BLACK;
                }
                modes.push(last);
                continue;
            }
            let mut sums = [0.0; MODES];
            // Neighbouring tiles with one mode make the list of modes shorter.
            sums[usize::from(last)] = -4.0;
            for at in places() {
                let pixel = pixels[at];
                if open && is_clear(pixel) {
                    pixels[at] = pixels[at - 1] & !BLACK;
                    let opacities = Around::of(pixels, at, width).all();
                    sums.iter_mut().zip(opacities).for_each(|(sum, prediction)| {
                        *sum += costs[3][((0_u32.wrapping_sub(prediction >> 24)) & 255) as usize];
                    });
                    continue;
                }
                for (sum, prediction) in sums.iter_mut().zip(Around::of(pixels, at, width).all()) {
                    let [b, g, r, a] = difference(pixel, prediction).to_le_bytes().map(usize::from);
                    *sum += costs[0][b] + costs[1][g] + costs[2][r] + costs[3][a];
                }
            }
            let best = (0..MODES).min_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0) as u8;
            for at in places() {
                if open && is_clear(pixels[at]) {
                    pixels[at] = Around::of(pixels, at, width).one(best) & !BLACK;
                }
            }
            modes.push(best);
        }
    }
    modes
}

/// The differences; open pixels get the colours that are predicted.
fn apply(pixels: &mut [u32], width: usize, open: bool, tile: u32, modes: &[u8]) -> Vec<u32> {
    let tiles = width.div_ceil(1 << tile);
    let mut residuals = Vec::with_capacity(pixels.len());
    for at in 0..pixels.len() {
        let (x, y) = (at % width, at / width);
        let prediction = match (x, y) {
            (0, 0) => BLACK,
            (_, 0) => pixels[at - 1],
            (0, _) => pixels[at - width],
            _ => Around::of(pixels, at, width).one(modes[(y >> tile) * tiles + (x >> tile)]),
        };
        if open && is_clear(pixels[at]) {
            pixels[at] = prediction & !BLACK;
        }
        residuals.push(difference(pixels[at], prediction));
    }
    residuals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums by channel, modulo 256.
    fn add(a: u32, b: u32) -> u32 {
        let odd = (a & 0xff00_ff00).wrapping_add(b & 0xff00_ff00);
        let even = (a & 0x00ff_00ff) + (b & 0x00ff_00ff);
        (odd & 0xff00_ff00) | (even & 0x00ff_00ff)
    }

    #[test]
    fn channels_do_not_touch_each_other() {
        let (a, b) = (0x0180_ff00, 0xff7f_01ff);
        assert_eq!(difference(a, b), 0x0201_fe01);
        assert_eq!(add(difference(a, b), b), a);
        assert_eq!(mean(0x00ff_0103, 0xff01_0204), 0x7f80_0103);
    }
}
