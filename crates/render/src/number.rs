//! Numbers as short text that is the same on every machine.

use std::fmt::Write;

use super::text;

/// Rounds to so many decimals.
pub(super) fn rounded(x: f64, decimals: usize) -> f64 {
    let mut text = String::new();
    push(&mut text, x, decimals);
    text.parse().unwrap_or(x)
}

/// Appends a number, rounded to so many decimals, without trailing zeros and without a negative zero.
pub fn push(out: &mut String, x: f64, decimals: usize) {
    if text::push_quickly(out, [x], decimals).is_none() {
        push_slowly(out, x, decimals);
    }
}

/// Appends several numbers likewise, with blanks between them. Where they end in `out`.
pub(super) fn push_row<const N: usize>(out: &mut String, numbers: [f64; N], decimals: usize) -> [usize; N] {
    text::push_quickly(out, numbers, decimals).unwrap_or_else(|| {
        let mut is_first = true;
        numbers.map(|x| {
            if !std::mem::take(&mut is_first) {
                out.push(' ');
            }
            push(out, x, decimals);
            out.len()
        })
    })
}

#[cold]
fn push_slowly(out: &mut String, x: f64, decimals: usize) {
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
        assert_eq!(decimals_for(1.0), 6);
        assert_eq!(decimals_for(5000.0), 3);
        assert_eq!(decimals_for(0.0), 6);
    }
}
