//! Follows a run through time: samples as close as the motion needs them, at events and wherever a straight way between two of them would be wrong.
//!
//! Frames are given. A sample is taken at every fourth of them, just before and just after every event, and in the
//! middle of what is left, as a test. Where the test fails, or something appears that no event explains, the interval is halved. For that, the simulation
//! is kept as it was before the frames at hand and run again. Simulations give the same bits again, so samples do not depend on the order in which they were taken.

use std::collections::{BTreeMap, HashMap};
use std::ops::Bound;

use dlsys_geometry::scene::Scene;
use dlsys_session::Nursery;
use dlsys_sim::Simulation;
use dlsys_tree::{ModuleString, mix};

use crate::part::{Frame, distance, reach};
use crate::sample::{Sample, Sampler};
use crate::stand::Planted;
use crate::thin::weight;
use crate::track::{Ending, Tracks};
use crate::{Error, Limits};

/// Frames that are worked on together, at most.
const CHUNK: usize = 64;
/// Numbers of the samples that are worked on together, at most, as far as they can be foreseen.
const AT_ONCE: usize = 20_000_000;
/// Frames from one sample to the next, where the motion does not need more.
const STRIDE: usize = 4;
/// Intervals of less than this part of the way from frame to frame, or of the longest way, are not tested.
const TESTED: f64 = 0.25;
/// Where an interval is tested, in parts of it: between these. In another place of each, or a motion to and fro of a round period would be missed in all of them.
const ASIDE: [f64; 2] = [0.31, 0.45];
/// Strings that are drawn together, at most.
const BATCH: usize = 64;
/// Halvings of an interval, at most.
const DEEPEST: u32 = 14;

/// How closely a run is followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closeness {
    /// Largest distance of a straight way between samples from the motion, in metres.
    pub(crate) straight: f64,
    /// Largest distance of samples that are left out from the straight way between others, in metres.
    pub(crate) thin: f64,
    /// How exactly the instant of an appearance without a production is found, in units of the model.
    pub(crate) instant: f64,
    /// Longest way between samples, in units of the model.
    pub(crate) longest: f64,
}

/// Follows a run.
pub(crate) struct Follower<'m, 'a> {
    pub(crate) nursery: &'a Nursery<'m>,
    pub(crate) sampler: Sampler,
    pub(crate) closeness: Closeness,
    pub(crate) limits: Limits,
    pub(crate) threads: usize,
    /// Scenes with the accuracy of curved stems, to draw into.
    pub(crate) blank: Scene,
    /// The simulation before the frames at hand.
    pub(crate) simulation: Simulation<'m>,
    pub(crate) tracks: Tracks,
    /// Births of the modules of the last samples.
    pub(crate) births: HashMap<u64, f64>,
    /// The model lets something go.
    pub(crate) falls: bool,
    /// There is one frame.
    pub(crate) is_still: bool,
    /// The plants of other models in that.
    pub(crate) planted: Vec<Planted>,
}

/// A drawn sample, and whether the interval up to it is known to be straight enough.
struct Knot {
    sample: Sample,
    depth: u32,
    done: bool,
    /// The interval is tested however short it is: the one that it is a half of was not straight.
    strict: bool,
    /// Tests that the interval, and those that it is a part of, have passed since the last that failed.
    passed: u32,
}

impl Follower<'_, '_> {
    /// Follows the run through all frames. `progress` is told the time reached, and stops the work by being false.
    pub(crate) fn follow(
        &mut self,
        frames: &[f64],
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(), Error> {
        let Some((&first, rest)) = frames.split_first() else { return Ok(()) };
        let mut start = self.take(vec![first])?.pop().unwrap_or_default();
        self.check(&start)?;
        self.planted = std::mem::take(&mut start.planted);
        let tolerance = self.closeness.thin;
        self.tracks.add(&start, None, &self.births, tolerance);
        let mut rest = rest;
        while !rest.is_empty() {
            if !progress(start.time) {
                return Err(Error::Stopped { time: start.time });
            }
            let mut count = rest.len().min(CHUNK);
            let mut times = self.base(start.time, &rest[..count])?;
            while count > 1 && times.len() * (start.size() + 1) > AT_ONCE {
                count = count.div_ceil(2);
                times = self.base(start.time, &rest[..count])?;
            }
            let (chunk, others) = rest.split_at(count);
            rest = others;
            let to_frame = (chunk[chunk.len() - 1] - start.time) / chunk.len() as f64;
            // The samples between two frames may be too many by themselves.
            for part in times.chunks((AT_ONCE / (start.size() + 1)).max(1)) {
                let knots = self.knots(start, to_frame, part.to_vec())?;
                for pair in knots.windows(2) {
                    self.tracks.add(&pair[1], Some(pair[0].time), &self.births, tolerance);
                }
                start = knots.into_iter().next_back().unwrap_or_default();
            }
            if self.tracks.size > self.limits.numbers {
                let time = chunk.last().copied().unwrap_or(first);
                return Err(Error::TooLarge { time, limit: self.limits.numbers });
            }
        }
        progress(start.time);
        self.tracks.finish(tolerance);
        Ok(())
    }

    /// The samples from the last one up to the last of these times, with these and as many more as the motion needs. From frame to frame it
    /// is `to_frame`.
    fn knots(&mut self, start: Sample, to_frame: f64, mut times: Vec<f64>) -> Result<Vec<Sample>, Error> {
        let end = times[times.len() - 1];
        let long = TESTED * to_frame.min(self.closeness.longest);
        let mut knots = BTreeMap::from([(
            key(start.time),
            Knot { sample: start, depth: 0, done: true, strict: false, passed: 0 },
        )]);
        let mut tests: Vec<f64> = Vec::new();
        loop {
            let mut all: Vec<f64> = times.iter().chain(&tests).copied().collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            let mut taken: BTreeMap<u64, Sample> = BTreeMap::new();
            for batch in all.chunks(BATCH) {
                for sample in self.take(batch.to_vec())? {
                    self.check(&sample)?;
                    taken.insert(key(sample.time), sample);
                }
            }
            for time in times.drain(..) {
                if let Some(sample) = taken.remove(&key(time)) {
                    knots.insert(
                        key(time),
                        Knot { sample, depth: 0, done: false, strict: self.falls, passed: 0 },
                    );
                }
            }
            self.judge(&mut knots, &mut taken);
            tests = self.questions(&mut knots, long);
            if tests.is_empty() {
                break;
            }
        }
        self.advance(end)?;
        Ok(knots.into_values().map(|knot| knot.sample).collect())
    }

    /// Frames, and the instants just before and just after every event; and those at which something that falls is jolted.
    fn base(&mut self, start: f64, frames: &[f64]) -> Result<Vec<f64>, Error> {
        let end = frames[frames.len() - 1];
        let mut ahead = self.simulation.clone();
        ahead.take_events();
        let passed = ahead.pass(end);
        let mut times: Vec<f64> =
            frames.iter().copied().skip(STRIDE - 1).step_by(STRIDE).chain([end]).collect();
        for event in ahead.take_events() {
            self.tracks.endings.insert(event.lineage.id, Ending { time: event.time, rule: event.rule });
            let around = margin(event.time);
            // What grows from nothing is not seen at its birth, but soon after.
            let just = [event.time - around, event.time + around, event.time + self.closeness.instant];
            times.extend(just.into_iter().filter(|t| *t > start && *t < end));
        }
        passed?;
        if self.falls {
            // Drawn up to the end, so that it has fallen.
            self.take(vec![end])?;
            times.extend(self.nursery.jolts().into_iter().filter(|t| *t > start && *t < end));
        }
        times.sort_by(f64::total_cmp);
        times.dedup();
        // What is between two of them, in parts that are not too long.
        let mut last = start;
        for frame in times.clone() {
            let parts = ((frame - last) / self.closeness.longest).ceil().clamp(1.0, 1e6) as usize;
            times.extend((1..parts).map(|i| last + (frame - last) * i as f64 / parts as f64));
            last = frame;
        }
        times.sort_by(f64::total_cmp);
        times.dedup();
        Ok(times)
    }

    /// Accepts tests where the straight way passes them; others become samples.
    fn judge(&self, knots: &mut BTreeMap<u64, Knot>, tests: &mut BTreeMap<u64, Sample>) {
        let mut turning = Vec::new();
        for (at, test) in std::mem::take(tests) {
            let before = knots.range(..at).next_back().map(|(_, knot)| &knot.sample);
            let (Some(before), Some((&after, knot))) = (before, knots.range(at..).next()) else { continue };
            let Knot { sample: end, depth, passed, .. } = knot;
            let (depth, passed) = (*depth, *passed + 1);
            let explained = self.is_explained(before, &test) && self.is_explained(&test, end);
            if explained && self.is_straight(before, &test, end) {
                // What turns to and fro may come by one place of the test at any time: both parts are tested, too.
                let done = !self.falls || passed > 1;
                if let Some(knot) = knots.get_mut(&after) {
                    (knot.done, knot.passed) = (done, passed);
                }
                // It is there, so what is left of the error is a quarter of it, where the motion is smooth.
                knots.insert(at, Knot { sample: test, depth, done, strict: self.falls, passed });
            } else {
                if let Some(knot) = knots.get_mut(&after) {
                    (knot.depth, knot.done, knot.strict, knot.passed) = (depth + 1, false, explained, 0);
                }
                let depth = depth + 1;
                knots.insert(at, Knot { sample: test, depth, done: false, strict: explained, passed: 0 });
                if explained {
                    turning.push(after);
                }
            }
        }
        // The way beside one that is not straight may have passed its test by chance.
        for after in turning {
            let next = knots.range((Bound::Excluded(after), Bound::Unbounded)).next();
            let beside = [next, knots.range(..after).rev().nth(1)].map(|knot| knot.map(|(at, _)| *at));
            for at in beside.into_iter().flatten() {
                if let Some(knot) = knots.get_mut(&at).filter(|knot| knot.done && knot.passed == 1) {
                    (knot.done, knot.strict) = (false, true);
                }
            }
        }
    }

    /// Times at which intervals are to be tested; those shorter than `long` are taken as they are, if the same things are seen at both ends and
    /// the way goes on as before.
    fn questions(&self, knots: &mut BTreeMap<u64, Knot>, long: f64) -> Vec<f64> {
        let mut times = Vec::new();
        let mut before: Option<f64> = None;
        let mut done = Vec::new();
        let all: Vec<u64> = knots.keys().copied().collect();
        for pair in all.windows(2) {
            let (Some(from), Some(to)) = (knots.get(&pair[0]), knots.get(&pair[1])) else { continue };
            if to.done {
                continue;
            }
            let (a, b) = (from.sample.time, to.sample.time);
            let explained = self.is_explained(&from.sample, &to.sample);
            // Not in the middle, where the error of a motion that turns round there is 0.
            let middle = a + (b - a) * if explained { aside(a, b) } else { 0.5 };
            let is_fine = b - a <= self.closeness.instant || middle <= a || middle >= b;
            let is_short =
                || explained && !to.strict && b - a < long && self.goes_on(knots, &from.sample, &to.sample);
            if is_fine || to.depth >= DEEPEST || is_short() {
                done.push(pair[1]);
            } else if before != Some(middle) {
                before = Some(middle);
                times.push(middle);
            }
        }
        for key in done {
            if let Some(knot) = knots.get_mut(&key) {
                knot.done = true;
            }
        }
        times
    }

    /// True if the way to a sample continues the one to the sample before it, from one that is about as far from that.
    fn goes_on(&self, knots: &BTreeMap<u64, Knot>, from: &Sample, to: &Sample) -> bool {
        let far = from.time - 0.5 * (to.time - from.time);
        let before = knots.range(..=key(far)).next_back().map(|(_, knot)| &knot.sample);
        before.is_some_and(|before| before.time < from.time && self.is_straight(before, from, to))
    }

    /// True if everything that appears, changes or disappears between two samples is explained by an event.
    fn is_explained(&self, from: &Sample, to: &Sample) -> bool {
        let (a, b) = (from.time, to.time);
        each_pair(from, to, |pair| match pair {
            (Some(i), Some(j)) => from.parts(i) == to.parts(j),
            (Some(i), None) => self.tracks.ends_within(from.modules[i].lineage.id, a, b),
            (None, Some(j)) => {
                let birth = self.births.get(&to.modules[j].lineage.id);
                birth.is_some_and(|birth| *birth > a && *birth <= b)
            }
            (None, None) => true,
        })
    }

    /// True if the straight way from one sample to another passes the one between them.
    fn is_straight(&self, from: &Sample, test: &Sample, to: &Sample) -> bool {
        let w = weight(from.time, to.time, test.time);
        let mut ends: HashMap<u64, usize> = HashMap::new();
        if !same_modules(from, to) {
            ends = to.modules.iter().enumerate().map(|(j, m)| (m.lineage.id, j)).collect();
        }
        each_pair(from, test, |pair| {
            let (Some(i), Some(k)) = pair else { return true };
            let j = if ends.is_empty() {
                i
            } else {
                *ends.get(&from.modules[i].lineage.id).unwrap_or(&usize::MAX)
            };
            let Some(end) = to.modules.get(j) else { return true };
            let form = test.parts(k);
            if to.parts(j) != test.parts(k) || from.parts(i) != test.parts(k) {
                return true;
            }
            let own = test.numbers(k);
            let frame: Frame = from.modules[i].frame.between(&end.frame, w);
            let off = frame.distance(&test.modules[k].frame, reach(form, own))
                + distance(form, [from.numbers(i), to.numbers(j)], w, own);
            off <= self.closeness.straight
        })
    }

    fn check(&self, sample: &Sample) -> Result<(), Error> {
        let limit = self.limits.nodes;
        let many = sample.modules.len() > limit || self.tracks.phases.len() > limit;
        if many { Err(Error::TooMany { time: sample.time, limit }) } else { Ok(()) }
    }

    /// Moves the simulation on to a time.
    fn advance(&mut self, time: f64) -> Result<(), Error> {
        self.simulation.pass(time)?;
        self.simulation.take_events();
        Ok(())
    }

    /// Samples at ascending times, drawn on several threads.
    fn take(&mut self, times: Vec<f64>) -> Result<Vec<Sample>, Error> {
        let mut simulation = self.simulation.clone();
        let mut strings = Vec::with_capacity(times.len());
        for time in times {
            let mut string = ModuleString::default();
            simulation.at(time, &mut string)?;
            strings.push(string);
        }
        let (nursery, sampler, blank, is_still) = (self.nursery, &self.sampler, &self.blank, self.is_still);
        let draw = |strings: &[ModuleString]| -> Result<Vec<Sample>, Error> {
            let mut scene = blank.clone();
            let one = |string: &ModuleString| {
                scene.clear();
                nursery.draw(string, &mut scene)?;
                if !scene.plants.is_empty() && !is_still {
                    return Err(Error::Plants);
                }
                let mut sample = sampler.sample(string.time, &scene);
                sample.planted = Planted::all(&scene);
                Ok(sample)
            };
            strings.iter().map(one).collect()
        };
        let share = strings.len().div_ceil(self.threads.max(1)).max(1);
        let parts: Vec<Result<Vec<Sample>, Error>> =
            dlsys_threads::in_order(self.threads, strings.chunks(share).collect(), draw);
        let mut samples = Vec::with_capacity(strings.len());
        for part in parts {
            samples.extend(part?);
        }
        for (sample, string) in samples.iter().zip(&strings) {
            self.note_births(sample, string);
        }
        Ok(samples)
    }

    /// Notes the births of modules that are new in a sample.
    fn note_births(&mut self, sample: &Sample, string: &ModuleString) {
        if sample.modules.iter().all(|module| self.births.contains_key(&module.lineage.id)) {
            return;
        }
        for module in string.iter().filter(|module| !module.kind.is_bracket()) {
            self.births.entry(module.lineage.id).or_insert(string.time - module.age);
        }
    }
}

/// Where an interval is tested, in parts of it.
fn aside(from: f64, to: f64) -> f64 {
    // A number that looks random, the same whenever the interval is the same.
    let part = (mix(from.to_bits(), to.to_bits()) >> 11) as f64 / (1_u64 << 53) as f64;
    ASIDE[0] + (ASIDE[1] - ASIDE[0]) * part
}

/// An order of times that are not negative.
fn key(time: f64) -> u64 {
    time.max(0.0).to_bits()
}

/// What is added to the time of an event, and taken from it, to be after it and before it whatever the rounding.
fn margin(time: f64) -> f64 {
    time.abs().max(1e-3) * 8.0 * f64::EPSILON
}

fn same_modules(a: &Sample, b: &Sample) -> bool {
    a.modules.len() == b.modules.len()
        && a.modules.iter().zip(&b.modules).all(|(a, b)| a.lineage.id == b.lineage.id)
}

/// Visits the modules of two samples by lineage until `visit` is false.
fn each_pair(a: &Sample, b: &Sample, mut visit: impl FnMut((Option<usize>, Option<usize>)) -> bool) -> bool {
    if same_modules(a, b) {
        return (0..a.modules.len()).all(|i| visit((Some(i), Some(i))));
    }
    let mut others: HashMap<u64, usize> =
        b.modules.iter().enumerate().map(|(j, m)| (m.lineage.id, j)).collect();
    let known = (0..a.modules.len()).all(|i| visit((Some(i), others.remove(&a.modules[i].lineage.id))));
    known && others.into_values().all(|j| visit((None, Some(j))))
}
