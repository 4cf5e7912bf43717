//! The order of productions that were computed chain by chain.

use dlsys_tree::SimTime;
use std::cmp::Ordering;

/// A production of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Happened {
    pub at: SimTime,
    /// Of the module that is replaced.
    pub slot: u32,
    /// Its place among those that are logged.
    pub entry: u32,
}

/// The order of the schedule: instants, then slots.
fn compare(a: &Happened, b: &Happened) -> Ordering {
    a.at.partial_cmp(&b.at).unwrap_or(Ordering::Equal).then(a.slot.cmp(&b.slot))
}

/// Sorts productions. They are about evenly distributed over some time, so that each is near its place when all are put into as many
/// equal parts of that time.
pub fn sort(events: &mut Vec<Happened>) {
    let times = || events.iter().map(|event| event.at.to_f64());
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    let scale = events.len() as f64 / (last - first);
    if !(scale > 0.0 && scale.is_finite()) {
        return events.sort_unstable_by(compare);
    }
    let last_part = events.len() - 1;
    let part = |event: &Happened| (((event.at.to_f64() - first) * scale) as usize).min(last_part);
    // Where each part begins, then where its next production goes to.
    let mut places = vec![0u32; events.len() + 1];
    for event in &*events {
        places[part(event) + 1] += 1;
    }
    for i in 1..places.len() {
        places[i] += places[i - 1];
    }
    let mut sorted = events.clone();
    for event in &*events {
        let place = &mut places[part(event)];
        sorted[*place as usize] = *event;
        *place += 1;
    }
    // A place is now the end of its part.
    let mut begin = 0;
    for &end in &places[..places.len() - 1] {
        let end = end as usize;
        if end - begin > 1 {
            sorted[begin..end].sort_unstable_by(compare);
        }
        begin = end;
    }
    *events = sorted;
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
            expected.sort_by(compare);
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
