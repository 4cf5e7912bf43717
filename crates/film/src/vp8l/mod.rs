//! Pictures as WebP's lossless bit stream (RFC 9649: J. Zern, P. Massimino and J. Alakuijala, *WebP Image Format*, 2024).

mod bits;
mod matches;
mod predictor;
mod prefix;
mod tokens;

use bits::Bits;
use matches::{Matcher, Plane};
use predictor::Residuals;
use prefix::Prefix;
use tokens::{Costs, Counts, Token, code_of};

/// The binary logarithm of the side of tiles with one predictor.
const TILE: u32 = 3;
/// Sizes of the cache of colours that are tried, as binary logarithms; 0 is none.
const CACHES: [u32; 5] = [0, 4, 7, 9, 10];
/// Predictions that make the symbols cheaper by this factor are not compared with the colours themselves.
const MUCH_CHEAPER: f32 = 0.8;

/// The data of a chunk VP8L: pixels row by row, opacity in the highest byte, then red, green, blue. With `open`, the colours of pixels of opacity 0 do not matter.
pub(crate) fn encode(pixels: &[u32], width: usize, open: bool) -> Vec<u8> {
    let height = pixels.len() / width;
    let mut bits = Bits::default();
    bits.put(0x2f, 8);
    bits.put(width as u32 - 1, 14);
    bits.put(height as u32 - 1, 14);
    bits.put(u32::from(pixels.iter().any(|pixel| pixel >> 24 < 255)), 1);
    bits.put(0, 3);
    let direct = flat(pixels, open);
    let without_green: Vec<u32> = pixels.iter().map(|pixel| subtract_green(*pixel)).collect();
    let residuals = predictor::predict(&without_green, width, open, TILE);
    let guesses = [runs(&direct).bits(), runs(&residuals.pixels).bits()];
    // Copies and the cache do more for colours than for differences.
    let predicted = (guesses[1] < guesses[0]).then(|| Coded::new(&residuals.pixels, width));
    let direct = (guesses[1] > MUCH_CHEAPER * guesses[0]).then(|| Coded::new(&direct, width));
    match (direct, predicted) {
        (Some(direct), predicted)
            if predicted.as_ref().is_none_or(|predicted| direct.cost <= predicted.cost) =>
        {
            bits.put(0, 1);
            direct.write(true, &mut bits);
        }
        (_, Some(predicted)) => {
            write_transforms(&residuals, width, &mut bits);
            predicted.write(true, &mut bits);
        }
        // One of the two is made.
        _ => {}
    }
    bits.finish()
}

/// Colours that do not matter, all alike.
fn flat(pixels: &[u32], open: bool) -> Vec<u32> {
    pixels.iter().map(|pixel| if open && pixel >> 24 == 0 { 0 } else { *pixel }).collect()
}

/// Red and blue as differences from green (RFC 9649, section 4.1.3).
fn subtract_green(pixel: u32) -> u32 {
    let [b, g, r, a] = pixel.to_le_bytes();
    u32::from_le_bytes([b.wrapping_sub(g), g, r.wrapping_sub(g), a])
}

fn write_transforms(residuals: &Residuals, width: usize, bits: &mut Bits) {
    // Subtracting green.
    bits.put(1 | 2 << 1, 3);
    bits.put(1, 3);
    bits.put(residuals.tile - 2, 3);
    let modes: Vec<u32> = residuals.modes.iter().map(|mode| 0xff00_0000 | u32::from(*mode) << 8).collect();
    Coded::new(&modes, width.div_ceil(1 << residuals.tile)).write(false, bits);
    bits.put(0, 1);
}

/// A picture as tokens.
struct Coded {
    tokens: Vec<Token>,
    /// The binary logarithm of the size of the cache of colours, or 0.
    cache: u32,
    /// Bits, about.
    cost: f32,
}

impl Coded {
    fn new(pixels: &[u32], width: usize) -> Coded {
        let plane = Plane::new(width);
        let matcher = Matcher::new(pixels, width);
        let mut tokens = tokens::parse(pixels, &plane, 0, &matcher, &Costs::of(&runs(pixels)));
        let sized = |cache| (cache, tokens::with_cache(pixels, &tokens, cache));
        let of_sizes = CACHES.map(sized).into_iter();
        let Some((cache, mut counts)) = of_sizes.min_by(|a, b| a.1.bits().total_cmp(&b.1.bits())) else {
            return Coded { tokens, cache: 0, cost: 0.0 };
        };
        tokens = tokens::parse(pixels, &plane, cache, &matcher, &Costs::of(&counts));
        counts = Counts::of(&tokens, cache);
        let cost = counts.bits();
        Coded { tokens, cache, cost }
    }

    /// Writes the tokens with their codes; those of the whole picture say that there is one group of codes.
    fn write(&self, is_whole: bool, bits: &mut Bits) {
        bits.put(u32::from(self.cache > 0), 1);
        if self.cache > 0 {
            bits.put(self.cache, 4);
        }
        if is_whole {
            bits.put(0, 1);
        }
        let counts = Counts::of(&self.tokens, self.cache);
        let codes = counts.0.each_ref().map(|counts| Prefix::new(counts));
        codes.iter().for_each(|code| code.write(bits));
        let [green, red, blue, opacity, distances] = &codes;
        for token in &self.tokens {
            match *token {
                Token::Literal(pixel) => {
                    let [b, g, r, a] = pixel.to_le_bytes().map(usize::from);
                    green.put(g, bits);
                    red.put(r, bits);
                    blue.put(b, bits);
                    opacity.put(a, bits);
                }
                Token::Cached(place) => green.put(tokens::LITERALS + tokens::LENGTHS + place as usize, bits),
                Token::Copy(length, distance) => {
                    let (symbol, width, extra) = code_of(length);
                    green.put(tokens::LITERALS + symbol, bits);
                    bits.put(extra, width);
                    let (symbol, width, extra) = code_of(distance);
                    distances.put(symbol, bits);
                    bits.put(extra, width);
                }
            }
        }
    }
}

/// A first model: literals, and copies of the pixel before.
fn runs(pixels: &[u32]) -> Counts {
    let mut counts = Counts::new(0);
    for run in pixels.chunk_by(|a, b| a == b) {
        counts.add(Token::Literal(run[0]));
        if let Some(rest) = u32::try_from(run.len() - 1).ok().filter(|rest| *rest > 0) {
            // The pixel to the left has the code 2.
            counts.add(Token::Copy(rest.min(tokens::LONGEST as u32), 2));
        }
    }
    counts
}

#[cfg(test)]
mod tests;
