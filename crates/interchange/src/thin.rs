//! Which samples of a motion are enough.

/// Numbers of samples, the first and the last among them, such that `fits(i, j)` for any two in a row: as few as a search for the furthest next
/// sample finds. `fits(i, i + 1)` is never asked.
pub(crate) fn thin(count: usize, mut fits: impl FnMut(usize, usize) -> bool) -> Vec<usize> {
    let mut kept = Vec::new();
    if count == 0 {
        return kept;
    }
    kept.push(0);
    let last = count - 1;
    let mut from = 0;
    while from < last {
        let mut good = from + 1;
        let mut step = 1;
        // Twice as far as long as that fits, then by halves between the last that fitted and the first that did not.
        let mut bad = loop {
            let next = (good + step).min(last);
            if next == good {
                break None;
            }
            if !fits(from, next) {
                break Some(next);
            }
            good = next;
            step *= 2;
        };
        while let Some(limit) = bad.filter(|limit| *limit - good > 1) {
            let middle = good + (limit - good) / 2;
            match fits(from, middle) {
                true => good = middle,
                false => bad = Some(middle),
            }
        }
        kept.push(good);
        from = good;
    }
    kept
}

/// The place of an argument between the nearest of ascending arguments: the number of the one before, and the weight of the one after.
pub(crate) fn place(arguments: &[f64], x: f64) -> (usize, f64) {
    let after = arguments.partition_point(|a| *a <= x);
    if after == 0 || arguments.len() < 2 {
        return (0, 0.0);
    }
    let before = (after - 1).min(arguments.len() - 2);
    (before, weight(arguments[before], arguments[before + 1], x))
}

/// The weight of `b` at `x` between `a` and `b`, from 0 to 1.
pub(crate) fn weight(a: f64, b: f64, x: f64) -> f64 {
    if b > a { ((x - a) / (b - a)).clamp(0.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_need_their_ends_and_corners_are_kept() {
        let path: Vec<f64> = (0..200).map(|i| f64::from(if i < 77 { i } else { 154 - i })).collect();
        let fits = |i: usize, j: usize| {
            (i..j).all(|k| {
                let w = (k - i) as f64 / (j - i) as f64;
                (path[i] + (path[j] - path[i]) * w - path[k]).abs() < 1e-9
            })
        };
        assert_eq!(thin(200, fits), [0, 77, 199]);
        assert_eq!(thin(0, fits), [0; 0]);
        assert_eq!(thin(1, fits), [0]);
        assert_eq!(thin(2, |_, _| false), [0, 1]);
        assert_eq!(thin(4, |_, _| false), [0, 1, 2, 3]);
    }

    #[test]
    fn places_between_arguments() {
        let ages = [0.0, 1.0, 3.0];
        assert_eq!(place(&ages, 2.0), (1, 0.5));
        assert_eq!(place(&ages, -1.0), (0, 0.0));
        assert_eq!(place(&ages, 9.0), (1, 1.0));
        assert_eq!(place(&ages[..1], 0.5), (0, 0.0));
    }
}
