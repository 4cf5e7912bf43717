//! Fast formatting of numbers, for the lines of a mesh file.
//!
//! Digits are made eight at a time in the bytes of one integer, by multiplications (Khuong 2011; Lemire 2021), and
//! copied as a whole into a line that has room for more than it needs.

use super::number;
use dlsys_geometry::scene::Vector;

/// Text that grows by lines.
#[derive(Default)]
pub(super) struct Text {
    bytes: Vec<u8>,
    len: usize,
}

/// Room for a line of six corners, or three numbers, and a few bytes more than that.
const LINE: usize = 192;

/// Builds one line.
pub(super) struct LineWriter<'t> {
    buffer: &'t mut [u8; LINE],
    len: usize,
}

/// A corner of a face with a blank before it, ` 12//34`: each is written for several faces.
#[derive(Clone, Copy, Default)]
pub(super) struct Corner {
    bytes: [u8; Corner::SIZE],
    len: usize,
}

impl Text {
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    /// Appends what is written to a line.
    pub(super) fn line(&mut self, write: impl FnOnce(&mut LineWriter)) {
        self.reserve(LINE);
        let Some(buffer) = self.bytes[self.len..].first_chunk_mut() else { return };
        let mut line = LineWriter { buffer, len: 0 };
        write(&mut line);
        self.len += line.len;
    }

    /// Appends words of any length.
    pub(super) fn words(&mut self, words: &[&[u8]]) {
        for word in words {
            self.reserve(word.len());
            self.bytes[self.len..self.len + word.len()].copy_from_slice(word);
            self.len += word.len();
        }
    }

    /// Makes room for so many bytes; what is there beyond the text, is of lines before.
    fn reserve(&mut self, more: usize) {
        if self.bytes.len() < self.len + more {
            self.bytes.resize(2 * self.bytes.len() + more, 0);
        }
    }

    /// Appends a keyword of at most two letters and three numbers, rounded to so many decimals, as [`number::push`] does.
    pub(super) fn triple(&mut self, keyword: &[u8], v: &Vector, decimals: usize) {
        let Some(power) = POWERS.get(decimals) else { return self.slow_triple(keyword, v, decimals) };
        let mut fixed = [Fixed::default(); 3];
        for (fixed, &x) in fixed.iter_mut().zip(v.iter()) {
            match Fixed::new(x, *power) {
                Some(found) => *fixed = found,
                None => return self.slow_triple(keyword, v, decimals),
            }
        }
        self.line(|line| {
            line.word(keyword);
            for fixed in fixed {
                line.byte(b' ');
                line.fixed(fixed, decimals);
            }
            line.byte(b'\n');
        });
    }

    #[cold]
    fn slow_triple(&mut self, keyword: &[u8], v: &Vector, decimals: usize) {
        self.numbers(keyword, v.as_slice(), decimals);
    }

    /// Appends a keyword and numbers, rounded to so many decimals.
    pub(super) fn numbers(&mut self, keyword: &[u8], numbers: &[f64], decimals: usize) {
        let mut line = String::new();
        for &x in numbers {
            line.push(' ');
            number::push(&mut line, x, decimals);
        }
        self.words(&[keyword, line.as_bytes(), b"\n"]);
    }
}

/// Appends at most eight numbers, rounded to so many decimals, as [`number::push`] does, with blanks between them, if that is quickly done. Where they
/// end in `out`; `None` if nothing has been appended.
#[inline]
pub(super) fn push_quickly<const N: usize>(
    out: &mut String,
    numbers: [f64; N],
    decimals: usize,
) -> Option<[usize; N]> {
    const { assert!(N * (LIMIT.ilog10() as usize + 3) + 2 * size_of::<u64>() <= LINE) };
    let power = POWERS.get(decimals)?;
    let mut fixed = [Fixed::default(); N];
    for (fixed, x) in fixed.iter_mut().zip(numbers) {
        *fixed = Fixed::new(x, *power)?;
    }
    let mut buffer = [0; LINE];
    let mut line = LineWriter { buffer: &mut buffer, len: 0 };
    let mut ends = [0; N];
    for (end, fixed) in ends.iter_mut().zip(fixed) {
        if line.len > 0 {
            line.byte(b' ');
        }
        line.fixed(fixed, decimals);
        *end = out.len() + line.len;
    }
    let len = line.len;
    out.push_str(std::str::from_utf8(&buffer[..len]).unwrap_or_default());
    Some(ends)
}

impl LineWriter<'_> {
    pub(super) fn byte(&mut self, byte: u8) {
        self.buffer[self.len] = byte;
        self.len += 1;
    }

    pub(super) fn word(&mut self, word: &[u8]) {
        self.buffer[self.len..self.len + word.len()].copy_from_slice(word);
        self.len += word.len();
    }

    /// Appends a face.
    pub(super) fn face(&mut self, corners: [&Corner; 3]) {
        self.byte(b'f');
        for corner in corners {
            self.buffer[self.len..self.len + Corner::SIZE].copy_from_slice(&corner.bytes);
            self.len += corner.len;
        }
        self.byte(b'\n');
    }

    #[inline]
    fn fixed(&mut self, number: Fixed, decimals: usize) {
        self.buffer[self.len] = b'-';
        let start = self.len + usize::from(number.negative);
        let digits = digits(number.digits);
        // Digits of the whole part, at least one, and those behind the point.
        let whole = 8 - decimals;
        let skipped = (digits.trailing_zeros() as usize / 8).min(whole - 1);
        let behind = decimals.saturating_sub(digits.leading_zeros() as usize / 8);
        let (ascii, point) = (digits | ZEROS, start + whole - skipped);
        self.eight(start, ascii >> (8 * skipped));
        self.len = point;
        if behind > 0 {
            self.buffer[point] = b'.';
            self.eight(point + 1, ascii >> (8 * whole));
            self.len = point + 1 + behind;
        }
    }

    /// Writes eight bytes at a place, the lowest first; what is not needed of them is written over.
    fn eight(&mut self, place: usize, bytes: u64) {
        self.buffer[place..place + 8].copy_from_slice(&bytes.to_le_bytes());
    }
}

impl Corner {
    /// Two numbers of ten digits, a blank, two strokes, and a byte that is not used.
    const SIZE: usize = 24;

    /// Of a vertex and a normal, counted from 0; OBJ counts from 1.
    pub(super) fn new(vertex: u32, normal: u32) -> Corner {
        let mut corner = Corner { bytes: [b' '; Corner::SIZE], len: 1 };
        corner.whole(u64::from(vertex) + 1);
        corner.bytes[corner.len] = b'/';
        corner.bytes[corner.len + 1] = b'/';
        corner.len += 2;
        corner.whole(u64::from(normal) + 1);
        corner
    }

    fn whole(&mut self, n: u64) {
        if n >= LIMIT {
            let text = n.to_string();
            self.bytes[self.len..self.len + text.len()].copy_from_slice(text.as_bytes());
            self.len += text.len();
            return;
        }
        let digits = digits(n);
        let skipped = digits.trailing_zeros() as usize / 8;
        self.bytes[self.len..self.len + 8]
            .copy_from_slice(&((digits | ZEROS) >> (8 * skipped)).to_le_bytes());
        self.len += 8 - skipped;
    }
}

/// Numbers from here on have more than eight digits.
const LIMIT: u64 = 100_000_000;
/// Eight times the digit 0.
const ZEROS: u64 = 0x3030_3030_3030_3030;
/// By the number of decimals, of which fewer than eight are quick.
const POWERS: [f64; 8] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];

/// The eight digits of a number below [`LIMIT`], the first in the lowest byte.
fn digits(n: u64) -> u64 {
    let fours = (n / 10_000) | (n % 10_000) << 32;
    // Quotients by 100 and by 10, in all parts at once.
    let hundreds = ((fours * 10_486) >> 20) & 0x0000_007f_0000_007f;
    let twos = hundreds | (fours - hundreds * 100) << 16;
    let tens = ((twos * 103) >> 10) & 0x000f_000f_000f_000f;
    tens | (twos - tens * 10) << 8
}

/// A number as an integer of its last decimals.
#[derive(Clone, Copy, Default)]
struct Fixed {
    negative: bool,
    digits: u64,
}

impl Fixed {
    /// `None` if it is too large.
    fn new(x: f64, power: f64) -> Option<Fixed> {
        let scaled = x.abs() * power;
        if scaled.is_nan() || scaled >= LIMIT as f64 - 1.0 {
            return None;
        }
        let below = scaled as u32;
        let mut rest = scaled - f64::from(below);
        // The product is wrong by 1e-8 at most.
        if (rest - 0.5).abs() < 1e-7 {
            rest = 0.5 + half_way(x, power, below, rest);
        }
        let digits = u64::from(below) + u64::from(rest > 0.5);
        Some(Fixed { negative: x < 0.0 && digits > 0, digits })
    }
}

/// Where a number whose last decimals are nearly half way between two goes: 0.5 for up. Half way exactly it goes to the even one.
#[cold]
fn half_way(x: f64, power: f64, below: u32, rest: f64) -> f64 {
    // What the rounding of the product has taken away; less than what `rest` differs from a half, unless that is nothing.
    let error = x.abs().mul_add(power, -(x.abs() * power));
    let excess = if rest == 0.5 { error } else { rest - 0.5 };
    match excess == 0.0 {
        true if below % 2 == 1 => 0.5,
        true => -0.5,
        false => 0.5f64.copysign(excess),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(vertex: u32, normal: u32) -> String {
        let mut text = Text::default();
        let corner = Corner::new(vertex, normal);
        text.line(|line| line.face([&corner, &corner, &Corner::new(0, 1)]));
        String::from_utf8(text.bytes().to_vec()).expect("ASCII")
    }

    #[test]
    fn corners_of_any_size() {
        for n in [0, 6, 9, 98, 99, 12_345, 9_999_998, 99_999_998, 99_999_999, 1_234_567_890, u32::MAX] {
            let [a, b] = [u64::from(n) + 1, u64::from(n / 3) + 1];
            assert_eq!(corner(n, n / 3), format!("f {a}//{b} {a}//{b} 1//2\n"));
        }
    }

    #[test]
    fn the_quick_way_writes_what_the_slow_one_does() {
        let slow = |x: f64, decimals: usize| {
            let text = format!("{x:.decimals$}");
            let text =
                if decimals > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { text.as_str() };
            if text == "-0" { "0".to_owned() } else { text.to_owned() }
        };
        let check = |v: Vector, decimals: usize| {
            let mut text = Text::default();
            text.words(&[b"before\n"]);
            text.triple(b"vn", &v, decimals);
            let [x, y, z] = [v.x, v.y, v.z].map(|x| slow(x, decimals));
            let expected = format!("before\nvn {x} {y} {z}\n");
            assert_eq!(String::from_utf8_lossy(text.bytes()), expected, "{v:?} {decimals}");
            let mut pushed = String::new();
            if let Some([first, second]) = push_quickly(&mut pushed, [v.x, v.y], decimals) {
                assert_eq!((&pushed[..first], &pushed[first + 1..second]), (&x[..], &y[..]));
            }
        };
        let mut state = 1_u64;
        for i in 0..100_000 {
            let size = 10_f64.powi(i % 16 - 8);
            let v = Vector::from_fn(|_, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let unit = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
                // Also numbers with few digits, among them ties.
                if i % 3 == 0 { (unit * size * 1e4).round() / 1e4 } else { unit * size }
            });
            for decimals in [0, 2, 3, 4, 6, 7, 9, 12] {
                check(v, decimals);
            }
        }
        // Half way between two, exactly or nearly.
        for k in 0..20_000_u32 {
            for decimals in [0, 2, 3, 7] {
                let half = (f64::from(k) + 0.5) / POWERS[decimals];
                check(Vector::new(half, -half.next_up(), half.next_down()), decimals);
                let binary = f64::from(k) / 1024.0;
                check(Vector::new(binary, -binary.next_up(), 1e4 + binary), decimals);
            }
        }
        for x in [f64::NAN, f64::INFINITY, -1e300, -0.0, 0.5, 2.5, 99_999_999.0, 9.999_999_6, 1e8] {
            check(Vector::new(x, -x, 1.0), 0);
            check(Vector::new(x, -x, 1.0), 7);
        }
    }
}
