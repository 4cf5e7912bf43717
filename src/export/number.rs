//! Numbers as short text that is the same on every machine.

use std::fmt::Write;

/// Rounds to so many decimals.
pub(super) fn rounded(x: f64, decimals: usize) -> f64 {
    let mut text = String::new();
    push(&mut text, x, decimals);
    text.parse().unwrap_or(x)
}

/// Appends a number, rounded to so many decimals, without trailing zeros and without a negative zero.
pub(super) fn push(out: &mut String, x: f64, decimals: usize) {
    if let Some(fixed) = Fixed::new(x, decimals) {
        let mut line = Line::new();
        line.fixed(fixed);
        out.push_str(std::str::from_utf8(&line.buffer[..line.len]).unwrap_or_default());
        return;
    }
    let start = out.len();
    // Writing to a string does not fail.
    let _ = write!(out, "{x:.decimals$}");
    if decimals > 0 {
        out.truncate(out.trim_end_matches('0').len());
        out.truncate(out.trim_end_matches('.').len());
    }
    if &out[start..] == "-0" {
        out.replace_range(start.., "0");
    }
}

/// A line of a file of numbers, put together in one place and then appended at once.
pub(super) struct Line {
    buffer: [u8; Line::SIZE],
    len: usize,
}

impl Line {
    const SIZE: usize = 256;

    pub(super) fn new() -> Line {
        Line { buffer: [0; Line::SIZE], len: 0 }
    }

    /// Appends a word of at most 32 bytes.
    pub(super) fn word(&mut self, word: &[u8]) {
        self.buffer[self.len..self.len + word.len()].copy_from_slice(word);
        self.len += word.len();
    }

    /// Appends a whole number.
    pub(super) fn whole(&mut self, n: u64) {
        let digits = n.checked_ilog10().map_or(1, |log| log as usize + 1);
        self.put(n, digits);
    }

    /// Appends a number as [`push`] does; the line so far goes to `out` if it does not fit.
    pub(super) fn number(&mut self, x: f64, decimals: usize, out: &mut Vec<u8>) {
        match Fixed::new(x, decimals) {
            Some(fixed) => self.fixed(fixed),
            None => {
                self.flush(out);
                let mut slow = String::new();
                push(&mut slow, x, decimals);
                out.extend_from_slice(slow.as_bytes());
            }
        }
    }

    /// Appends the line to a file and begins a new one.
    pub(super) fn flush(&mut self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.buffer[..self.len]);
        self.len = 0;
    }

    /// Appends exactly so many digits of a number, zeros in front if need be.
    fn put(&mut self, mut n: u64, digits: usize) {
        let mut at = self.len + digits;
        let start = self.len;
        self.len = at;
        while at >= start + 2 {
            let pair = 2 * (n % 100) as usize;
            n /= 100;
            at -= 2;
            self.buffer[at] = PAIRS[pair];
            self.buffer[at + 1] = PAIRS[pair + 1];
        }
        if at > start {
            self.buffer[start] = b'0' + (n % 10) as u8;
        }
    }

    fn fixed(&mut self, Fixed { negative, whole, fraction, decimals }: Fixed) {
        if negative {
            self.word(b"-");
        }
        self.whole(whole);
        if fraction > 0 {
            self.word(b".");
            self.put(fraction, decimals);
            while self.buffer[self.len - 1] == b'0' {
                self.len -= 1;
            }
        }
    }
}

/// All numbers of two digits.
const PAIRS: [u8; 200] = {
    let mut pairs = [0; 200];
    let mut i = 0;
    while i < 100 {
        pairs[2 * i] = b'0' + (i / 10) as u8;
        pairs[2 * i + 1] = b'0' + (i % 10) as u8;
        i += 1;
    }
    pairs
};

/// A number in parts. Most numbers of a file are such that an integer of their decimals is exact; that is ten
/// times as fast as the formatter of the standard library, and a mesh is little else than numbers.
struct Fixed {
    negative: bool,
    whole: u64,
    /// In units of the last decimal.
    fraction: u64,
    decimals: usize,
}

impl Fixed {
    /// `None` where the integer might be another than that of the exact decimals: it is too large, or the
    /// number is nearly half way between two.
    fn new(x: f64, decimals: usize) -> Option<Fixed> {
        const POWERS: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
        let power = *POWERS.get(decimals)?;
        let scaled = x.abs() * power;
        if scaled.is_nan() || scaled >= 1e12 {
            return None;
        }
        let below = scaled as u64;
        let rest = scaled - below as f64;
        // The product is wrong by 1e-4 at most.
        if (rest - 0.5).abs() < 1e-3 {
            return None;
        }
        let digits = below + u64::from(rest > 0.5);
        // A number below 1e12 has an exact quotient, rounded down.
        let whole = (digits as f64 / power) as u64;
        let fraction = digits - whole * power as u64;
        Some(Fixed { negative: x < 0.0 && digits > 0, whole, fraction, decimals })
    }
}

/// The decimals that tell apart a millionth of a length.
pub(super) fn decimals_for(extent: f64) -> usize {
    if !(extent > 0.0 && extent.is_finite()) {
        return 6;
    }
    (6 - extent.log10().floor() as i64).clamp(0, 300) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let text = |x, decimals| {
            let mut out = String::from("100");
            push(&mut out, x, decimals);
            out.split_off(3)
        };
        assert_eq!(text(1.0, 3), "1");
        assert_eq!(text(100.0, 0), "100");
        assert_eq!(text(-0.0001, 3), "0");
        assert_eq!(text(0.1 + 0.2, 3), "0.3");
        assert_eq!(text(-12.3456, 2), "-12.35");
        for (n, shown) in [(0, "0"), (7, "7"), (10, "10"), (105, "105"), (1_000_000, "1000000")] {
            let mut out = Vec::new();
            let mut line = Line::new();
            line.whole(n);
            line.flush(&mut out);
            assert_eq!(out, shown.as_bytes());
        }
        assert_eq!(decimals_for(1.0), 6);
        assert_eq!(decimals_for(5000.0), 3);
        assert_eq!(decimals_for(0.0), 6);
    }

    #[test]
    fn the_quick_way_writes_what_the_slow_one_does() {
        let slow = |x: f64, decimals: usize| {
            let text = format!("{x:.decimals$}");
            let text =
                if decimals > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { text.as_str() };
            if text == "-0" { "0".to_owned() } else { text.to_owned() }
        };
        let mut state = 1_u64;
        for i in 0..200_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let unit = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
            let size = 10_f64.powi(i % 16 - 8);
            // Also numbers with few digits, among them ties.
            let x = if i % 3 == 0 { (unit * size * 1e4).round() / 1e4 } else { unit * size };
            for decimals in [0, 2, 3, 4, 6, 9, 12] {
                let mut quick = Vec::new();
                let mut line = Line::new();
                line.number(x, decimals, &mut quick);
                line.flush(&mut quick);
                assert_eq!(String::from_utf8_lossy(&quick), slow(x, decimals), "{x:e} {decimals}");
            }
        }
        for x in [f64::NAN, f64::INFINITY, -1e300, -0.0, 0.5, 2.5] {
            let mut quick = Vec::new();
            let mut line = Line::new();
            line.number(x, 0, &mut quick);
            line.flush(&mut quick);
            assert_eq!(String::from_utf8_lossy(&quick), slow(x, 0));
        }
    }
}
