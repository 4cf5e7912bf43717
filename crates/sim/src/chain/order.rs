//! The order of productions that were computed chain by chain.

use dlsys_tree::SimTime;
use std::cmp::Ordering;

/// A production of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Happened {
    pub at: SimTime,
    /// Of the module that is replaced.
    pub slot: u32,
    /// The number of the production in the plan.
    pub entry: u32,
}

/// Sorts productions as the schedule does, by instants, then slots.
pub fn sort(events: &mut Vec<Happened>) {
    let compare = |a: &Happened, b: &Happened| {
        a.at.partial_cmp(&b.at).unwrap_or(Ordering::Equal).then(a.slot.cmp(&b.slot))
    };
    sort_by_time(events, |event| event.at.to_f64(), compare);
}

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

/// The first of sorted productions that is so near the next one that both are one instant, though their computed times differ: what takes
/// place then is decided in the general way.
pub fn first_near(events: &[Happened]) -> Option<SimTime> {
    let is_near = |pair: &&[Happened]| {
        let [a, b] = [pair[0].at, pair[1].at];
        a != b && b.since(a) <= 4.0 * b.resolution()
    };
    events.windows(2).find(is_near).map(|pair| pair[0].at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sorted_as_by_comparison(times in proptest::collection::vec((0..60u32, 0..3u32, 0..9u32), 0..200), far in any::<bool>()) {
            let at = |(t, tiny, slot): (u32, u32, u32)| {
                // Many at one time, some at nearly one, and one far away.
                let at = SimTime::new(f64::from(t / 3)).after(f64::from(tiny) * 1e-20);
                Happened { at, slot, entry: 0 }
            };
            let mut events: Vec<Happened> = times.into_iter().map(at).collect();
            if far {
                events.push(at((3_000_000_000, 0, 0)));
            }
            let mut expected = events.clone();
            expected.sort_by(|a, b| a.at.partial_cmp(&b.at).expect("numbers").then(a.slot.cmp(&b.slot)));
            sort(&mut events);
            prop_assert_eq!(events, expected);
        }
    }

    #[test]
    fn nearly_one_instant_is_found() {
        let event = |t: f64, after: f64| Happened { at: SimTime::new(t).after(after), slot: 0, entry: 0 };
        let twins = [event(1.0, 0.0), event(1.0, 0.0), event(2.0, 0.0)];
        assert_eq!(first_near(&twins), None);
        let near = [event(1.0, 0.0), event(2.0, 0.0), event(2.0, 1e-17), event(3.0, 0.0)];
        assert_eq!(first_near(&near), Some(SimTime::new(2.0)));
        assert_eq!(first_near(&[event(2.0, 0.0), event(2.0, 5e-15)]), Some(SimTime::new(2.0)));
    }
}
