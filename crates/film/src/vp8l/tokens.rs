//! Pixels as literals, places of a cache of colours, and copies of earlier pixels (RFC 9649, sections 3.6 and 4.2): the cheapest sequence of them under a model of
//! their costs, found by dynamic programming.

use super::matches::{Matcher, Plane};

/// Literals of the green channel.
pub(super) const LITERALS: usize = 256;
/// Codes of lengths.
pub(super) const LENGTHS: usize = 24;
/// Codes of distances.
const DISTANCES: usize = 40;
/// Longest copy.
pub(super) const LONGEST: usize = 4096;

/// A part of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token {
    Literal(u32),
    /// A place in the cache.
    Cached(u32),
    /// Its length, and the code of its distance.
    Copy(u32, u32),
}

impl Token {
    /// The number of pixels.
    pub(super) fn pixels(self) -> usize {
        if let Token::Copy(length, _) = self { length as usize } else { 1 }
    }
}

/// A number from 1 as a code, the number of bits behind it, and these (RFC 9649, section 4.2.2).
pub(super) fn code_of(number: u32) -> (usize, u32, u32) {
    let rest = number - 1;
    if rest < 4 {
        return (rest as usize, 0, 0);
    }
    let highest = rest.ilog2();
    let second = (rest >> (highest - 1)) & 1;
    ((2 * highest + second) as usize, highest - 1, rest & ((1 << (highest - 1)) - 1))
}

/// How often each symbol of the five codes is used: green with lengths and the cache, red, blue, opacity, distances.
#[derive(Clone)]
pub(super) struct Counts(pub(super) [Vec<u32>; 5]);

impl Counts {
    pub(super) fn new(cache: u32) -> Counts {
        let cached = if cache > 0 { 1 << cache } else { 0 };
        Counts([LITERALS + LENGTHS + cached, 256, 256, 256, DISTANCES].map(|count| vec![0; count]))
    }

    pub(super) fn add(&mut self, token: Token) {
        let Counts([green, red, blue, opacity, distances]) = self;
        match token {
            Token::Literal(pixel) => {
                let [b, g, r, a] = pixel.to_le_bytes().map(usize::from);
                green[g] += 1;
                red[r] += 1;
                blue[b] += 1;
                opacity[a] += 1;
            }
            Token::Cached(place) => green[LITERALS + LENGTHS + place as usize] += 1,
            Token::Copy(length, distance) => {
                green[LITERALS + code_of(length).0] += 1;
                distances[code_of(distance).0] += 1;
            }
        }
    }

    /// Bits of all tokens and of their codes, about.
    pub(super) fn bits(&self) -> f32 {
        let used = self.0.iter().flatten().filter(|count| **count > 0).count();
        let entropy = |counts: &Vec<u32>| {
            let all = counts.iter().sum::<u32>() as f32;
            let terms = counts.iter().filter(|count| **count > 0).map(|count| *count as f32);
            terms.map(|count| count * (all / count).log2()).sum::<f32>()
        };
        let behind = |counts: &[u32]| {
            let bits = |(code, count): (usize, &u32)| *count as f32 * (code.max(2) / 2 - 1) as f32;
            counts.iter().enumerate().map(bits).sum::<f32>()
        };
        let behind = behind(&self.0[0][LITERALS..LITERALS + LENGTHS]) + behind(&self.0[4]);
        self.0.iter().map(entropy).sum::<f32>() + behind + 4.0 * used as f32
    }

    pub(super) fn of(tokens: &[Token], cache: u32) -> Counts {
        let mut counts = Counts::new(cache);
        tokens.iter().for_each(|token| counts.add(*token));
        counts
    }
}

/// Bits of symbols.
pub(super) struct Costs([Vec<f32>; 5]);

impl Costs {
    /// Those of an ideal code for symbols that are as frequent as here.
    pub(super) fn of(counts: &Counts) -> Costs {
        Costs(counts.0.clone().map(|counts| {
            let all = (counts.iter().sum::<u32>() as f32).max(1.0).log2();
            // A symbol that has not been used yet costs more than the rarest.
            counts.iter().map(|count| all - (*count as f32).max(0.3).log2()).collect()
        }))
    }

    fn literal(&self, pixel: u32) -> f32 {
        let [b, g, r, a] = pixel.to_le_bytes().map(usize::from);
        self.0[0][g] + self.0[1][r] + self.0[2][b] + self.0[3][a]
    }

    fn cached(&self, place: u32) -> f32 {
        self.0[0][LITERALS + LENGTHS + place as usize]
    }

    fn distance(&self, distance: u32) -> f32 {
        let (code, bits, _) = code_of(distance);
        self.0[4][code] + bits as f32
    }

    fn length(&self, length: usize) -> f32 {
        let (code, bits, _) = code_of(length as u32);
        self.0[0][LITERALS + code] + bits as f32
    }
}

/// The place of a colour in a cache.
fn place_in(cache: u32, pixel: u32) -> u32 {
    0x1e35_a7bd_u32.wrapping_mul(pixel) >> (32 - cache)
}

/// A cache of colours, by its number of bits. It holds all pixels so far, however they were coded.
struct Cache {
    bits: u32,
    held: Vec<u32>,
    last: Option<u32>,
}

impl Cache {
    fn new(bits: u32) -> Cache {
        Cache { bits, held: vec![0; if bits > 0 { 1 << bits } else { 0 }], last: None }
    }

    /// Whether the pixel was there; then it is.
    fn meet(&mut self, pixel: u32) -> bool {
        if self.bits == 0 {
            return false;
        }
        // Most pixels are like the one before.
        if self.last.replace(pixel) == Some(pixel) {
            return true;
        }
        std::mem::replace(&mut self.held[place_in(self.bits, pixel) as usize], pixel) == pixel
    }
}

/// The cheapest tokens.
pub(super) fn parse(
    pixels: &[u32],
    plane: &Plane,
    cache: u32,
    matcher: &Matcher,
    costs: &Costs,
) -> Vec<Token> {
    let mut held = Cache::new(cache);
    let held: Vec<bool> = pixels.iter().map(|pixel| held.meet(*pixel)).collect();
    // The least cost up to each pixel, and the last token of it: a length, and a distance.
    let mut best = vec![(f32::INFINITY, 0_u32, 0_u32); pixels.len() + 1];
    best[0].0 = 0.0;
    let lengths: Vec<f32> =
        (0..=LONGEST).map(|length| if length > 0 { costs.length(length) } else { 0.0 }).collect();
    for at in 0..pixels.len() {
        let so_far = best[at].0;
        if so_far.is_infinite() {
            continue;
        }
        let mut reach = |to: usize, cost: f32, length: u32, distance: u32| {
            if so_far + cost < best[to].0 {
                best[to] = (so_far + cost, length, distance);
            }
        };
        let mut alone = costs.literal(pixels[at]);
        if held[at] {
            alone = alone.min(costs.cached(place_in(cache, pixels[at])));
        }
        reach(at + 1, alone, 1, 0);
        let mut shortest = 1;
        for &(length, distance) in matcher.at(at) {
            let (length, far) = (length as usize, costs.distance(plane.code(distance as usize)));
            // Every length is possible; that of the whole copy, and short ones, are enough.
            for part in (shortest..length.min(shortest + 16)).chain([length]) {
                reach(at + part, far + lengths[part], part as u32, distance);
            }
            shortest = length;
        }
    }
    let mut tokens = Vec::new();
    let mut at = pixels.len();
    while at > 0 {
        let (_, length, distance) = best[at];
        at -= length as usize;
        tokens.push(if distance > 0 {
            Token::Copy(length, plane.code(distance as usize))
        } else {
            single(pixels[at], held[at], cache, costs)
        });
    }
    tokens.reverse();
    tokens
}

fn single(pixel: u32, held: bool, cache: u32, costs: &Costs) -> Token {
    if held {
        let place = place_in(cache, pixel);
        if costs.cached(place) <= costs.literal(pixel) {
            return Token::Cached(place);
        }
    }
    Token::Literal(pixel)
}

/// The symbols of the same copies with a cache of another size: its places in place of literals.
pub(super) fn with_cache(pixels: &[u32], tokens: &[Token], cache: u32) -> Counts {
    let mut held = Cache::new(cache);
    let mut counts = Counts::new(cache);
    let mut rest = pixels;
    for token in tokens {
        let (these, others) = rest.split_at(token.pixels());
        rest = others;
        let was_held = these.iter().fold(false, |_, pixel| held.meet(*pixel));
        counts.add(match token {
            Token::Copy(..) => *token,
            _ if was_held => Token::Cached(place_in(cache, these[0])),
            _ => Token::Literal(these[0]),
        });
    }
    counts
}
