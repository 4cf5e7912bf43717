//! Path data of outlines, as short as the grammar of SVG allows.

use super::contour::Corner;
use crate::number;

/// Appends a closed outline to path data, in relative coordinates of so many decimals.
pub(super) fn push_outline(
    data: &mut String,
    outline: &[Corner],
    to_page: impl Fn(Corner) -> [f64; 2],
    decimals: usize,
) {
    let scale = 10_f64.powi(decimals as i32);
    let (mut last, mut count): (Option<[f64; 2]>, _) = (None, 0);
    for corner in outline {
        let at = to_page(*corner).map(|x| (x * scale).round());
        let [x, y] = last.map_or(at, |last| [at[0] - last[0], at[1] - last[1]]);
        if last.is_some() && x == 0.0 && y == 0.0 {
            continue;
        }
        // One command is for all corners behind it.
        match count {
            0 => data.push('M'),
            1 => data.push('l'),
            _ => {}
        }
        push_number(data, x / scale, decimals);
        push_number(data, y / scale, decimals);
        last = Some(at);
        count += 1;
    }
    data.push('z');
}

/// Appends a number to path data, as short as it can be.
fn push_number(data: &mut String, x: f64, decimals: usize) {
    let start = data.len();
    number::push(data, x, decimals);
    // No zero before the point.
    for (text, zero) in [("0.", 0), ("-0.", 1)] {
        if data[start..].starts_with(text) {
            data.remove(start + zero);
        }
    }
    // A sign parts numbers, and so does a point behind a number that has one.
    let before = data[..start].rsplit(|c: char| !c.is_ascii_digit() && c != '.').next().unwrap_or_default();
    let is_parted = before.is_empty()
        || data[start..].starts_with('-')
        || data[start..].starts_with('.') && before.contains('.');
    if !is_parted {
        data.insert(start, ' ');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of path data, read by the grammar of SVG: a command is for all pairs of numbers behind it, and a number ends where it cannot go on.
    fn corners(data: &str) -> Vec<Vec<[f64; 2]>> {
        let (mut outlines, mut numbers) = (Vec::new(), Vec::new());
        let (mut at, mut relative) = ([0.0, 0.0], false);
        let mut rest = data;
        while let Some(first) = rest.chars().next() {
            match first {
                'M' | 'l' | 'z' => {
                    assert!(numbers.is_empty(), "{data}");
                    relative = first == 'l';
                    if first == 'M' {
                        outlines.push(Vec::new());
                    }
                    rest = &rest[1..];
                }
                ' ' => rest = &rest[1..],
                _ => {
                    let mut points = 0;
                    let end = rest.char_indices().position(|(n, c)| {
                        points += usize::from(c == '.');
                        !(c.is_ascii_digit() || c == '.' && points == 1 || c == '-' && n == 0)
                    });
                    let (number, left) = rest.split_at(end.unwrap_or(rest.len()));
                    numbers.push(number.parse::<f64>().expect("a number"));
                    rest = left;
                }
            }
            if let [x, y] = numbers[..] {
                at = if relative { [at[0] + x, at[1] + y] } else { [x, y] };
                outlines.last_mut().expect("an outline").push(at);
                numbers.clear();
            }
        }
        outlines
    }

    #[test]
    fn outlines_are_short_and_can_be_read_back() {
        let mut data = String::new();
        let all: [&[Corner]; 3] = [
            &[[0.0, 0.0], [0.5, 0.25], [1.25, -0.5], [12.0, 3.0], [12.0, 3.0], [12.0, 10.0]],
            &[[-0.25, 1.0], [2.0, 2.5], [2.0, 2.75], [3.0, 2.75], [2.99, 2.5]],
            &[[7.0, -0.5]],
        ];
        all.iter().for_each(|outline| push_outline(&mut data, outline, |corner| corner, 2));
        assert_eq!(data, "M0 0l.5.25.75-.75 10.75 3.5 0 7zM-.25 1l2.25 1.5 0 .25 1 0-.01-.25zM7-.5z");
        let read = corners(&data);
        for (outline, read) in all.iter().zip(&read) {
            let mut expected = outline.to_vec();
            expected.dedup();
            let distance = |(a, b): (&[f64; 2], &Corner)| (a[0] - b[0]).abs() + (a[1] - b[1]).abs();
            assert_eq!(read.len(), expected.len(), "{data}");
            assert!(read.iter().zip(&expected).map(distance).all(|d| d < 1e-9), "{data}");
        }
    }
}
