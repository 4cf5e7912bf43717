//! Earlier pixels that are like those at a place.

use super::tokens::LONGEST;

/// Candidates at a place.
const CANDIDATES: usize = 24;
/// Copies of this length are taken without a search for better ones, and none begins within them.
const LONG: usize = 96;
const HASH_BITS: u32 = 15;
/// Codes of distances in the neighbourhood.
const NEAR: usize = 120;
/// Largest distance.
const FARTHEST: usize = (1 << 20) - NEAR;

/// Copies that begin at each place: ascending lengths with their distances.
pub(super) struct Matcher {
    starts: Vec<u32>,
    found: Vec<(u32, u32)>,
}

fn hash(pixels: &[u32]) -> usize {
    let key = pixels[0].wrapping_mul(0x9e37_79b1) ^ pixels[1].wrapping_mul(0x85eb_ca6b).rotate_left(7);
    (key.wrapping_mul(0xc2b2_ae35) >> (32 - HASH_BITS)) as usize
}

fn common(pixels: &[u32], a: usize, b: usize) -> usize {
    let most = LONGEST.min(pixels.len() - b);
    pixels[a..].iter().zip(&pixels[b..b + most]).take_while(|(x, y)| x == y).count()
}

impl Matcher {
    pub(super) fn new(pixels: &[u32], width: usize) -> Matcher {
        let mut heads = vec![u32::MAX; 1 << HASH_BITS];
        let mut before = vec![u32::MAX; pixels.len()];
        let mut matcher = Matcher { starts: Vec::with_capacity(pixels.len() + 1), found: Vec::new() };
        let mut skipped = 0;
        for at in 0..pixels.len() {
            matcher.starts.push(matcher.found.len() as u32);
            let in_run = at > 0 && pixels[at] == pixels[at - 1];
            let key = pixels.get(at..at + 2).map(hash);
            if at >= skipped {
                let mut longest = 1;
                let mut meet = |from: usize| {
                    // Longer than the longest only if it has the pixel that ends that.
                    if pixels.get(from + longest) == pixels.get(at + longest) {
                        let length = common(pixels, from, at);
                        if length > longest {
                            longest = length;
                            matcher.found.push((length as u32, (at - from) as u32));
                        }
                    }
                    longest
                };
                if in_run {
                    meet(at - 1);
                }
                if at >= width {
                    meet(at - width);
                }
                let mut from = key.filter(|_| !in_run).map_or(u32::MAX, |key| heads[key]);
                for _ in 0..CANDIDATES {
                    let place = from as usize;
                    if from == u32::MAX || at - place > FARTHEST || meet(place) >= LONG {
                        break;
                    }
                    from = before[place];
                }
                if longest >= LONG {
                    skipped = at + longest;
                }
            }
            // One place of a run is enough: its beginning.
            if let Some(key) = key.filter(|_| !in_run) {
                before[at] = heads[key];
                heads[key] = at as u32;
            }
        }
        matcher.starts.push(matcher.found.len() as u32);
        matcher
    }

    /// Lengths and distances of the copies that may begin here.
    pub(super) fn at(&self, place: usize) -> &[(u32, u32)] {
        &self.found[self.starts[place] as usize..self.starts[place + 1] as usize]
    }
}

/// Codes of distances: short ones for near pixels of the rows above (RFC 9649, section 4.2.2).
pub(super) struct Plane {
    width: usize,
    /// By row above and column, from 7 to the right.
    near: [u32; 8 * 16],
}

impl Plane {
    pub(super) fn new(width: usize) -> Plane {
        // By distance, then from the middle outwards, the left side first.
        let mut places: Vec<(i32, i32, i32)> = (0..8_i32)
            .flat_map(|y| (-7..=8_i32).map(move |x| (x * x + y * y, x.abs(), -x)))
            .zip((0..8).flat_map(|y| (0..16).map(move |x| (x, y))))
            .filter(|((_, _, minus), (_, y))| *y > 0 || *minus < 0)
            .map(|((square, size, minus), (x, y))| (square * 256 + size * 16 + minus.signum() + 1, x, y))
            .collect();
        places.sort_unstable();
        let mut near = [0; 8 * 16];
        places.iter().zip(1..).for_each(|((_, x, y), code)| near[(y * 16 + x) as usize] = code);
        Plane { width, near }
    }

    pub(super) fn code(&self, distance: usize) -> u32 {
        let (rows, columns) = (distance / self.width, distance % self.width);
        let code = match (rows, columns) {
            (0..8, 0..=8) => self.near[rows * 16 + columns + 7],
            (0..7, _) if columns + 7 >= self.width => self.near[(rows + 1) * 16 + columns + 7 - self.width],
            _ => 0,
        };
        if code > 0 { code } else { (distance + NEAR) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_pixels_have_the_codes_of_the_standard() {
        let plane = Plane::new(100);
        let codes = [100, 1, 101, 99, 200, 2, 201, 199, 102, 98].map(|distance| plane.code(distance));
        assert_eq!(codes, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        assert_eq!(
            [708, 707, 693, 8, 9, 800].map(|distance| plane.code(distance)),
            [120, 117, 118, 97, 129, 920]
        );
    }
}
