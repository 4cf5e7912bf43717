//! The order of productions that were computed chain by chain.

use dlsys_tree::SimTime;
use std::cmp::Ordering;

use crate::schedule::sort_by_time;

/// A production of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Happened {
    pub at: SimTime,
    /// Of the module that is replaced.
    pub slot: u32,
    /// Its number in the plan.
    pub entry: u32,
}

/// The productions of some chains in the order of the schedule: by instants, then slots.
#[derive(Debug, Default)]
pub struct Sorted {
    /// All of them, in ranges of time that do not meet; none is empty.
    ranges: Vec<Range>,
    /// Number of instants.
    pub instants: u64,
    /// The first instant that is so near the next one that both count as one, though their computed times differ: what takes place then is
    /// decided in the general way.
    pub near: Option<SimTime>,
}

/// Productions in a range of time.
#[derive(Debug)]
struct Range {
    events: Vec<Happened>,
    instants: u64,
    near: Option<SimTime>,
}

impl Range {
    fn of(mut events: Vec<Happened>) -> Range {
        sort(&mut events);
        let changes = events.windows(2).filter(|pair| pair[0].at != pair[1].at).count() as u64;
        let near = first_near(&events);
        Range { instants: changes + u64::from(!events.is_empty()), near, events }
    }
}

impl Sorted {
    /// Sorts productions that are in several lists, on several threads.
    pub fn of(mut lists: Vec<Vec<Happened>>, threads: usize) -> Sorted {
        let ranges = match (threads, lists.len()) {
            (..=1, 1) => lists.drain(..).map(Range::of).collect(),
            _ => in_ranges(&lists, threads),
        };
        let mut sorted = Sorted::default();
        for range in ranges.into_iter().filter(|range| !range.events.is_empty()) {
            sorted.instants += range.instants;
            let ends = sorted.last().zip(range.events.first());
            let meeting = ends.and_then(|(a, b)| first_near(&[*a, *b]));
            sorted.near = sorted.near.or(meeting).or(range.near);
            sorted.ranges.push(range);
        }
        sorted
    }

    pub fn len(&self) -> usize {
        self.ranges.iter().map(|range| range.events.len()).sum()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Happened> {
        self.ranges.iter().flat_map(|range| &range.events)
    }

    pub fn nth(&self, mut number: usize) -> Option<&Happened> {
        for Range { events, .. } in &self.ranges {
            match events.get(number) {
                None => number -= events.len(),
                found => return found,
            }
        }
        None
    }

    pub fn last(&self) -> Option<&Happened> {
        self.ranges.last()?.events.last()
    }
}

/// The productions in each of as many equal ranges of time as there are threads.
fn in_ranges(lists: &[Vec<Happened>], threads: usize) -> Vec<Range> {
    let times = lists.iter().flatten().map(|event| event.at.to_f64());
    let [first, last] =
        times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| [low.min(t), high.max(t)]);
    let scale = threads as f64 / (last - first);
    let count = if scale > 0.0 && scale.is_finite() { threads.max(1) } else { 1 };
    let range_of = |event: &Happened| match count {
        1 => 0,
        _ => (((event.at.to_f64() - first) * scale) as usize).min(count - 1),
    };
    dlsys_threads::each(threads, count, |number| {
        Range::of(lists.iter().flatten().filter(|event| range_of(event) == number).copied().collect())
    })
}

/// Sorts productions as the schedule does, by instants, then slots.
fn sort(events: &mut Vec<Happened>) {
    let compare = |a: &Happened, b: &Happened| {
        a.at.partial_cmp(&b.at).unwrap_or(Ordering::Equal).then(a.slot.cmp(&b.slot))
    };
    sort_by_time(events, |event| event.at.to_f64(), compare);
}

/// The first of sorted productions that is so near the next one that both are one instant.
fn first_near(events: &[Happened]) -> Option<SimTime> {
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
            let changes = expected.windows(2).filter(|pair| pair[0].at != pair[1].at).count();
            let instants = if expected.is_empty() { 0 } else { 1 + changes as u64 };
            for threads in [1, 2, 3] {
                let lists = match threads {
                    1 => vec![events.clone()],
                    _ => events.chunks(7).map(<[Happened]>::to_vec).collect(),
                };
                let sorted = Sorted::of(lists, threads);
                prop_assert_eq!(sorted.iter().copied().collect::<Vec<_>>(), &expected[..]);
                prop_assert_eq!((sorted.instants, sorted.len()), (instants, expected.len()));
                prop_assert_eq!(sorted.near, first_near(&expected));
                prop_assert_eq!(sorted.last(), expected.last());
            }
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
