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
    if let Some(text) = Fixed::new(x, decimals) {
        out.push_str(text.as_str());
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

/// The same for bytes.
pub(super) fn push_bytes(out: &mut Vec<u8>, x: f64, decimals: usize) {
    match Fixed::new(x, decimals) {
        Some(text) => out.extend_from_slice(text.as_bytes()),
        None => {
            let mut slow = String::new();
            push(&mut slow, x, decimals);
            out.extend_from_slice(slow.as_bytes());
        }
    }
}

/// Appends a whole number.
pub(super) fn push_whole(out: &mut Vec<u8>, n: u64) {
    let mut text = Fixed { buffer: [0; 32], start: 32, end: 32 };
    text.put(n, 1);
    out.extend_from_slice(text.as_bytes());
}

/// The digits of a number, written from the end. Most numbers of a file are such that an integer of
/// their decimals is exact; that is ten times as fast as the formatter of the standard library, and a mesh
/// is little else than numbers.
struct Fixed {
    buffer: [u8; 32],
    start: usize,
    end: usize,
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

impl Fixed {
    /// `None` where the integer might be another than that of the exact decimals: it is too large, or the
    /// number is nearly half way between two.
    fn new(x: f64, decimals: usize) -> Option<Fixed> {
        const POWERS: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
        let scaled = x.abs() * POWERS.get(decimals)?;
        // Also for NaN.
        if !(scaled < 1e12) {
            return None;
        }
        let below = scaled as u64;
        let rest = scaled - below as f64;
        // The product is wrong by 1e-4 at most.
        if (rest - 0.5).abs() < 1e-3 {
            return None;
        }
        let mut digits = below + u64::from(rest > 0.5);
        let mut text = Fixed { buffer: [0; 32], start: 32, end: 32 };
        if digits == 0 {
            text.put(0, 1);
            return Some(text);
        }
        let mut left = decimals;
        while left > 0 && digits % 10 == 0 {
            digits /= 10;
            left -= 1;
        }
        if left > 0 {
            let unit = POWERS[left] as u64;
            text.put(digits % unit, left);
            text.front(b'.');
            text.put(digits / unit, 1);
        } else {
            text.put(digits, 1);
        }
        if x < 0.0 {
            text.front(b'-');
        }
        Some(text)
    }

    fn front(&mut self, byte: u8) {
        self.start -= 1;
        self.buffer[self.start] = byte;
    }

    /// Puts a number before what is there, with at least so many digits.
    fn put(&mut self, mut n: u64, least: usize) {
        let end = self.start;
        while n >= 10 {
            let pair = 2 * (n % 100) as usize;
            self.start -= 2;
            self.buffer[self.start..self.start + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
            n /= 100;
        }
        if n > 0 {
            self.front(b'0' + n as u8);
        }
        while end - self.start < least {
            self.front(b'0');
        }
    }

    fn as_bytes(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    fn as_str(&self) -> &str {
        std::str::from_utf8(self.as_bytes()).unwrap_or_default()
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
            push_whole(&mut out, n);
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
                push_bytes(&mut quick, x, decimals);
                assert_eq!(String::from_utf8_lossy(&quick), slow(x, decimals), "{x:e} {decimals}");
            }
        }
        for x in [f64::NAN, f64::INFINITY, -1e300, -0.0, 0.5, 2.5] {
            let mut quick = Vec::new();
            push_bytes(&mut quick, x, 0);
            assert_eq!(String::from_utf8_lossy(&quick), slow(x, 0));
        }
    }
}
