//! Prefix codes (RFC 9649, section 3.7.2): lengths by Huffman's algorithm, canonical codes, and how they are written.

use super::bits::Bits;

/// Longest code.
const LONGEST: u8 = 15;
/// Longest code among those for lengths.
const LONGEST_OF_LENGTHS: u8 = 7;
/// The order in which lengths of the codes for lengths are written.
const ORDER: [usize; 19] = [17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// A code for symbols, from how often each is used.
pub(super) struct Prefix {
    lengths: Vec<u8>,
    /// Each with its bits in the order of writing.
    codes: Vec<u16>,
    /// A symbol that is alone takes no bits.
    is_single: bool,
}

impl Prefix {
    pub(super) fn new(counts: &[u32]) -> Prefix {
        Prefix::limited(counts, LONGEST)
    }

    fn limited(counts: &[u32], longest: u8) -> Prefix {
        let lengths = lengths(counts, longest);
        let is_single = lengths.iter().filter(|length| **length > 0).count() < 2;
        Prefix { codes: canonical(&lengths), lengths, is_single }
    }

    /// Writes a symbol.
    pub(super) fn put(&self, symbol: usize, bits: &mut Bits) {
        if !self.is_single {
            bits.put(u32::from(self.codes[symbol]), u32::from(self.lengths[symbol]));
        }
    }

    /// Writes the code itself.
    pub(super) fn write(&self, bits: &mut Bits) {
        let used: Vec<usize> = (0..self.lengths.len()).filter(|i| self.lengths[*i] > 0).take(3).collect();
        match used[..] {
            [] => self.write_simple(0, None, bits),
            [one] if one < 256 => self.write_simple(one, None, bits),
            [one, two] if two < 256 => self.write_simple(one, Some(two), bits),
            _ => self.write_lengths(bits),
        }
    }

    fn write_simple(&self, one: usize, two: Option<usize>, bits: &mut Bits) {
        bits.put(1, 1);
        bits.put(u32::from(two.is_some()), 1);
        let wide = one > 1;
        bits.put(u32::from(wide), 1);
        bits.put(one as u32, if wide { 8 } else { 1 });
        if let Some(two) = two {
            bits.put(two as u32, 8);
        }
    }

    fn write_lengths(&self, bits: &mut Bits) {
        let runs = runs(&self.lengths);
        let mut counts = [0; 19];
        runs.iter().for_each(|run| counts[run.0] += 1);
        let code = Prefix::limited(&counts, LONGEST_OF_LENGTHS);
        bits.put(0, 1);
        let written =
            ORDER.iter().rposition(|symbol| code.lengths[*symbol] > 0).map_or(4, |last| (last + 1).max(4));
        bits.put(written as u32 - 4, 4);
        ORDER[..written].iter().for_each(|symbol| bits.put(u32::from(code.lengths[*symbol]), 3));
        // As many lengths follow as there are symbols.
        bits.put(0, 1);
        for (symbol, extra, width) in runs {
            code.put(symbol, bits);
            bits.put(extra, width);
        }
    }
}

/// Lengths with repetitions: a symbol, a number behind it, and the bits of that.
fn runs(lengths: &[u8]) -> Vec<(usize, u32, u32)> {
    let mut runs = Vec::new();
    let mut before = 8;
    for group in lengths.chunk_by(|a, b| a == b) {
        let (length, mut rest) = (group[0], group.len() as u32);
        if length == 0 {
            while rest >= 3 {
                let (symbol, least, most, width) = if rest > 10 { (18, 11, 138, 7) } else { (17, 3, 10, 3) };
                let taken = rest.min(most);
                runs.push((symbol, taken - least, width));
                rest -= taken;
            }
        } else {
            if length != before {
                runs.push((usize::from(length), 0, 0));
                (before, rest) = (length, rest - 1);
            }
            while rest >= 3 {
                let taken = rest.min(6);
                runs.push((16, taken - 3, 2));
                rest -= taken;
            }
        }
        runs.extend((0..rest).map(|_| (usize::from(length), 0, 0)));
    }
    runs
}

/// Lengths of codes, none longer than `longest`; 0 where a symbol is not used.
fn lengths(counts: &[u32], longest: u8) -> Vec<u8> {
    let mut lengths = vec![0; counts.len()];
    let mut used: Vec<usize> = (0..counts.len()).filter(|i| counts[*i] > 0).collect();
    if let [only] = used[..] {
        lengths[only] = 1;
    }
    if used.len() < 2 {
        return lengths;
    }
    used.sort_by_key(|i| counts[*i]);
    // Rare symbols count for more until no code is too long.
    let mut least = 1;
    loop {
        let weights: Vec<u64> = used.iter().map(|i| u64::from(counts[*i].max(least))).collect();
        let depths = depths(&weights);
        if depths.iter().all(|depth| *depth <= u32::from(longest)) {
            used.iter().zip(depths).for_each(|(i, depth)| lengths[*i] = depth as u8);
            return lengths;
        }
        least *= 2;
    }
}

/// Depths of the leaves of Huffman's tree, for ascending weights, two or more.
fn depths(weights: &[u64]) -> Vec<u32> {
    let count = weights.len();
    let mut sums = weights.to_vec();
    let mut parents = vec![0; 2 * count - 1];
    let (mut leaf, mut inner) = (0, count);
    while sums.len() < 2 * count - 1 {
        // The next of the leaves, or of the sums, which ascend as well.
        let mut next = || {
            let is_leaf = leaf < count && (inner >= sums.len() || sums[leaf] <= sums[inner]);
            let place = if is_leaf { &mut leaf } else { &mut inner };
            *place += 1;
            *place - 1
        };
        let pair = [next(), next()];
        pair.iter().for_each(|node| parents[*node] = sums.len());
        sums.push(sums[pair[0]] + sums[pair[1]]);
    }
    let mut depths = vec![0; 2 * count - 1];
    for node in (0..2 * count - 2).rev() {
        depths[node] = depths[parents[node]] + 1;
    }
    depths.truncate(count);
    depths
}

/// Canonical codes of these lengths, their bits reversed.
fn canonical(lengths: &[u8]) -> Vec<u16> {
    let mut codes = vec![0; lengths.len()];
    let mut code = 0_u32;
    for length in 1..=LONGEST {
        for i in (0..lengths.len()).filter(|i| lengths[*i] == length) {
            codes[i] = (code.reverse_bits() >> (32 - u32::from(length))) as u16;
            code += 1;
        }
        code <<= 1;
    }
    codes
}
