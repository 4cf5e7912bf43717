//! Sorting by time, in about as many steps as there are things.

use std::cmp::Ordering;

/// Sorts things by their times, and what has one time by a comparison that begins with times. They are about evenly distributed over some
/// time, so that each is near its place when all are put into as many equal parts of that time.
pub fn sort_by_time<T: Copy>(
    all: &mut Vec<T>,
    time: impl Fn(&T) -> f64,
    compare: impl Fn(&T, &T) -> Ordering + Copy,
) {
    if all.is_sorted_by(|a, b| compare(a, b) != Ordering::Greater) {
        return;
    }
    let first = all.iter().map(&time).fold(f64::INFINITY, f64::min);
    let last = all.iter().map(&time).fold(f64::NEG_INFINITY, f64::max);
    let scale = all.len() as f64 / (last - first);
    if !(scale > 0.0 && scale.is_finite()) {
        return all.sort_by(compare);
    }
    let last_part = all.len() - 1;
    let part = |one: &T| (((time(one) - first) * scale) as usize).min(last_part);
    // Where each part begins, then where its next one goes to.
    let mut places = vec![0u32; all.len() + 1];
    for one in &*all {
        places[part(one) + 1] += 1;
    }
    for i in 1..places.len() {
        places[i] += places[i - 1];
    }
    let mut sorted = all.clone();
    for one in &*all {
        let place = &mut places[part(one)];
        sorted[*place as usize] = *one;
        *place += 1;
    }
    // A place is now the end of its part.
    let mut begin = 0;
    for &end in &places[..places.len() - 1] {
        let end = end as usize;
        if end - begin > 1 {
            // Twins come in the order of their slots: a stable sort finds that.
            sorted[begin..end].sort_by(compare);
        }
        begin = end;
    }
    *all = sorted;
}
