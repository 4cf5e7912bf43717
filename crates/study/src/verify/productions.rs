//! The productions of two runs: the same ones, how far apart in time, and in which order.
//!
//! A production is known by the module that it replaces, which has one at most. So productions are matched whatever their
//! order is, and what has happened in one run only waits for the other.

use std::collections::HashMap;

use dlsys_sim::Event;

/// A production that both runs have.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The production in the run in question.
    pub event: Event,
    /// Its time in the run in question.
    pub ours: f64,
    /// Its time in the other run.
    pub theirs: f64,
}

impl Pair {
    /// The difference in time, relative to max(1, |t|).
    pub fn error(&self) -> f64 {
        (self.ours - self.theirs).abs() / self.theirs.abs().max(1.0)
    }
}

/// The first production that only one of the runs has.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// The production of the run in question; `None` if it has none there.
    pub ours: Option<Event>,
    /// The production of the other run.
    pub theirs: Option<Event>,
    /// If only one run has it: a production of both so close in time that the run in question cannot order the two. Their
    /// order may have been decisive.
    pub rival: Option<Pair>,
}

/// Comparison of the productions of two runs.
#[derive(Clone, Debug, Default)]
pub struct Productions {
    /// Their number in the run in question.
    pub ours: usize,
    /// Their number in the other run.
    pub theirs: usize,
    /// The one with the largest difference in time.
    pub worst: Option<Pair>,
    /// The first two in a different order.
    pub swapped: Option<(Pair, Pair)>,
    /// The first one that only one run has.
    pub split: Option<Split>,
    /// Number of productions so close to the last time that only one run has them yet.
    pub at_the_end: usize,
}

/// Productions that are matched while two runs go on.
#[derive(Default)]
pub(super) struct Matching {
    counts: (usize, usize),
    /// By the module that is replaced: what the other run has not had yet.
    ours: HashMap<u64, Event>,
    theirs: HashMap<u64, Event>,
    pairs: Vec<Pair>,
}

impl Matching {
    /// What has happened since the last time.
    pub fn add(&mut self, ours: Vec<Event>, theirs: Vec<Event>) {
        self.counts.0 += ours.len();
        self.counts.1 += theirs.len();
        for event in ours {
            self.ours.insert(event.lineage.id, event);
        }
        for theirs in theirs {
            match self.ours.remove(&theirs.lineage.id) {
                Some(ours) => self.pair(ours, theirs),
                None => drop(self.theirs.insert(theirs.lineage.id, theirs)),
            }
        }
        // What was waiting from before.
        let late: Vec<u64> = self.theirs.keys().filter(|id| self.ours.contains_key(id)).copied().collect();
        for id in late {
            if let (Some(ours), Some(theirs)) = (self.ours.remove(&id), self.theirs.remove(&id)) {
                self.pair(ours, theirs);
            }
        }
    }

    /// Two productions of one module. If they are not the same, both go on waiting.
    fn pair(&mut self, ours: Event, theirs: Event) {
        let what = |e: &Event| (e.rule, e.clause, e.successor);
        if what(&ours) == what(&theirs) {
            self.pairs.push(Pair { ours: ours.time, theirs: theirs.time, event: ours });
        } else {
            self.ours.insert(ours.lineage.id, ours);
            self.theirs.insert(theirs.lineage.id, theirs);
        }
    }

    /// True if one run has had a production that the other has not.
    pub fn waits(&self) -> bool {
        !self.ours.is_empty() || !self.theirs.is_empty()
    }

    /// True if there are such, but none from before a time.
    pub fn waits_only_since(&self, t: f64) -> bool {
        self.waits() && self.ours.values().chain(self.theirs.values()).all(|e| e.time >= t)
    }

    /// The result at the last time. `slack`: differences in time that are allowed at a time.
    pub fn judge(mut self, end: f64, slack: &dyn Fn(f64) -> f64) -> Productions {
        self.pairs.sort_by(|a, b| a.ours.total_cmp(&b.ours).then(a.theirs.total_cmp(&b.theirs)));
        let split = self.split(end, slack);
        let waiting = self.ours.len() + self.theirs.len();
        Productions {
            ours: self.counts.0,
            theirs: self.counts.1,
            worst: self.pairs.iter().max_by(|a, b| a.error().total_cmp(&b.error())).cloned(),
            swapped: swapped(&self.pairs),
            at_the_end: if split.is_none() { waiting } else { 0 },
            split,
        }
    }

    fn split(&self, end: f64, slack: &dyn Fn(f64) -> f64) -> Option<Split> {
        // A run may be about to have what is as near to the end as this. Not a module that has had another one.
        let is_open = |e: &Event, others: &HashMap<u64, Event>| {
            e.time >= end - slack(end) && !others.contains_key(&e.lineage.id)
        };
        let first = |events: &HashMap<u64, Event>, others: &HashMap<u64, Event>| {
            let sure = events.values().filter(|e| !is_open(e, others));
            sure.min_by(|a, b| a.time.total_cmp(&b.time).then(a.lineage.id.cmp(&b.lineage.id))).cloned()
        };
        let (ours, theirs) = (first(&self.ours, &self.theirs), first(&self.theirs, &self.ours));
        let (ours, theirs) = match (ours, theirs) {
            (None, None) => return None,
            (Some(a), Some(b)) if (a.time - b.time).abs() > slack(a.time) => match a.time < b.time {
                true => (Some(a), None),
                false => (None, Some(b)),
            },
            both => both,
        };
        let rival = match (&ours, &theirs) {
            (Some(_), Some(_)) => None,
            (ours, theirs) => ours.as_ref().or(theirs.as_ref()).and_then(|alone| {
                let time = |pair: &Pair| if ours.is_some() { pair.ours } else { pair.theirs };
                let distance = |pair: &Pair| (time(pair) - alone.time).abs();
                let near = self.pairs.iter().filter(|p| {
                    // At the very same instant there is no first one.
                    distance(p) > 4.0 * f64::EPSILON * alone.time.abs() && distance(p) <= slack(alone.time)
                });
                near.min_by(|a, b| distance(a).total_cmp(&distance(b))).cloned()
            }),
        };
        Some(Split { ours, theirs, rival })
    }
}

/// The first two productions of which the other run has the second first. What is simultaneous in one of the runs, to
/// rounding, has no order.
fn swapped(pairs: &[Pair]) -> Option<(Pair, Pair)> {
    let mut latest: Option<&Pair> = None;
    for pair in pairs {
        let rounding = 64.0 * f64::EPSILON * pair.ours.abs().max(1.0);
        if let Some(latest) = latest
            && pair.ours - latest.ours > rounding
            && latest.theirs - pair.theirs > rounding
        {
            return Some((latest.clone(), pair.clone()));
        }
        if latest.is_none_or(|latest| pair.theirs > latest.theirs) {
            latest = Some(pair);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_model::KindId;
    use dlsys_tree::Lineage;

    fn event(place: usize, clause: usize, time: f64) -> Event {
        Event {
            time,
            lineage: Lineage::of_axiom(place),
            kind: KindId::OPEN,
            rule: 0,
            clause,
            successor: None,
            made: 1,
            residual: 0.0,
            group: 0,
            transition: None,
        }
    }

    fn judge(batches: &[(&[Event], &[Event])], end: f64) -> Productions {
        let mut matching = Matching::default();
        for (ours, theirs) in batches {
            matching.add(ours.to_vec(), theirs.to_vec());
        }
        matching.judge(end, &|t| 1e-4 * t.abs().max(1.0))
    }

    #[test]
    fn what_comes_late_is_matched_and_measured() {
        let found = judge(&[(&[event(1, 0, 1.0)], &[]), (&[], &[event(1, 0, 4.0)])], 9.0);
        let worst = found.worst.expect("a pair");
        assert_eq!((worst.ours, worst.theirs, worst.error()), (1.0, 4.0, 0.75));
        assert!(found.split.is_none() && found.swapped.is_none() && found.at_the_end == 0);
        let found = judge(&[(&[], &[event(1, 0, 4.0)]), (&[event(1, 0, 4.0)], &[])], 9.0);
        assert!(found.split.is_none() && found.worst.is_some());
    }

    #[test]
    fn order_is_that_of_different_times() {
        let two = |a: f64, b: f64| [event(1, 0, a), event(2, 0, b)];
        let found = judge(&[(&two(1.0, 1.00001), &two(1.00003, 1.00002))], 9.0);
        let (first, second) = found.swapped.expect("another order");
        assert_eq!((first.ours, second.theirs), (1.0, 1.00002));
        for (ours, theirs) in [(two(1.0, 1.0), two(1.0, 0.9)), (two(1.0, 1.0 + 1e-15), two(1.0 + 1e-15, 1.0))]
        {
            assert!(judge(&[(&ours, &theirs)], 9.0).swapped.is_none());
        }
    }

    #[test]
    fn what_only_one_has_is_a_split_unless_the_run_ends_there() {
        let alone = event(2, 0, 3.0);
        let found = judge(&[(&[event(1, 0, 2.99999), alone.clone()], &[event(1, 0, 3.00001)])], 9.0);
        let split = found.split.expect("not the same");
        assert_eq!((split.ours.as_ref(), split.theirs.as_ref()), (Some(&alone), None));
        assert_eq!(split.rival.expect("near").event.lineage, Lineage::of_axiom(1));
        let found = judge(&[(&[], std::slice::from_ref(&alone))], 3.0001);
        assert!(found.split.is_none() && found.at_the_end == 1);
        // One module, two clauses: not the same, at the end either.
        let found = judge(&[(&[event(1, 0, 3.0)], &[event(1, 1, 3.0)])], 3.0);
        let split = found.split.expect("not the same");
        assert!(split.ours.is_some() && split.theirs.is_some());
    }
}
