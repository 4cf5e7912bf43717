//! The modules of a run, each with its motion.

use std::collections::HashMap;
use std::sync::Arc;

use dlsys_geometry::scene::Vector;
use dlsys_tree::Lineage;

use crate::part::{Catalogue, Form, Frame, Paint, Part, distance, reach, stem_radii, triple};
use crate::sample::Sample;
use crate::thin::{thin, weight};

/// A production that ended a module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ending {
    pub(crate) time: f64,
    /// Index of the rule.
    pub(crate) rule: usize,
}

/// A module for as long as it draws the same parts.
#[derive(Debug)]
pub(crate) struct Phase {
    pub(crate) lineage: Lineage,
    pub(crate) kind: Arc<str>,
    /// Of the phases of a module, which one, from 0.
    pub(crate) number: u32,
    pub(crate) form: Form,
    /// Materials from these times on.
    pub(crate) paints: Vec<(f64, Paint)>,
    /// When the module was born.
    pub(crate) birth: f64,
    /// The production that ends the module, if that happens within the run.
    pub(crate) ending: Option<Ending>,
    /// From when on it is seen; `None`: at the beginning of the animation.
    pub(crate) from: Option<f64>,
    /// Up to when it is seen; `None`: at the end of the animation.
    pub(crate) to: Option<f64>,
    /// Times of the samples.
    pub(crate) times: Vec<f64>,
    pub(crate) frames: Vec<Frame>,
    numbers: Vec<f32>,
    /// The first sample that has not been thinned.
    fresh: usize,
}

impl Phase {
    pub(crate) fn numbers(&self, i: usize) -> &[f32] {
        let width = self.width();
        &self.numbers[i * width..(i + 1) * width]
    }

    fn width(&self) -> usize {
        self.form.iter().map(|part| part.numbers()).sum()
    }

    /// Leaves out samples between the last thinned one and the last one that lie within the tolerance of their neighbours.
    fn thin(&mut self, tolerance: f64) {
        let start = self.fresh;
        let count = self.times.len() - start;
        if count < 3 {
            return;
        }
        let kept = thin(count, |i, j| {
            let (i, j) = (start + i, start + j);
            (i + 1..j).all(|k| self.deviation(i, j, k) <= tolerance)
        });
        let width = self.width();
        for (to, from) in kept.iter().enumerate() {
            let (to, from) = (start + to, start + from);
            self.times[to] = self.times[from];
            self.frames[to] = self.frames[from];
            self.numbers.copy_within(from * width..(from + 1) * width, to * width);
        }
        let end = start + kept.len();
        self.times.truncate(end);
        self.frames.truncate(end);
        self.numbers.truncate(end * width);
        self.fresh = end - 1;
    }

    /// Gives stems without a length the directions that they have when they have grown. A length of nearly 0 may be negative by rounding, and the stem would be upside
    /// down: which nobody sees of it, but shapes that are mixed with that one would have thinner ends.
    fn set_up(&mut self) {
        /// Longest stem without a direction of its own, in radii.
        const LONGEST: f64 = 1e-4;
        let width = self.width();
        let mut first = 0;
        for part in self.form.iter() {
            if let Part::Stem(_) | Part::Shoot(_) = part {
                let mut grown: Option<[Vector; 3]> = None;
                for i in (0..self.times.len()).rev() {
                    let own = &mut self.numbers[i * width + first..][..part.numbers()];
                    // Three axes at each of its points.
                    let axes: Vec<usize> = stem_radii(own).collect();
                    let radius = |own: &[f32], first: usize| triple(&own[first..], 0).norm();
                    let thickest = axes.iter().map(|first| radius(own, *first)).fold(0.0, f64::max);
                    let length = (triple(own, 1) - triple(own, 0)).norm();
                    match grown {
                        Some(units) if length <= LONGEST * thickest => {
                            for first in axes {
                                let radius = radius(own, first);
                                let all = units.iter().flatten().map(|x| (x * radius) as f32);
                                own[first..].iter_mut().zip(all).for_each(|(own, x)| *own = x);
                            }
                        }
                        _ => {
                            let thick = axes.into_iter().find(|first| radius(own, *first) > 0.0);
                            let units = |first: usize| {
                                [0, 1, 2].map(|axis| triple(&own[first..], axis) / radius(own, first))
                            };
                            grown = thick.map(units).or(grown);
                        }
                    }
                }
            }
            first += part.numbers();
        }
    }

    /// How far sample `k` is from the straight way between samples `i` and `j`.
    fn deviation(&self, i: usize, j: usize, k: usize) -> f64 {
        let w = weight(self.times[i], self.times[j], self.times[k]);
        let frame = self.frames[i].between(&self.frames[j], w);
        let own = self.numbers(k);
        frame.distance(&self.frames[k], reach(&self.form, own))
            + distance(&self.form, [self.numbers(i), self.numbers(j)], w, own)
    }

    /// The materials half way through.
    pub(crate) fn paint(&self) -> &Paint {
        let middle = match (self.times.first(), self.times.last()) {
            (Some(first), Some(last)) => (first + last) / 2.0,
            _ => 0.0,
        };
        self.paint_at(middle)
    }

    /// The materials at a time.
    pub(crate) fn paint_at(&self, time: f64) -> &Paint {
        let after = self.paints.partition_point(|(from, _)| *from <= time);
        &self.paints[after.saturating_sub(1)].1
    }
}

/// All modules of a run.
#[derive(Debug, Default)]
pub(crate) struct Tracks {
    /// In the order in which they are seen first.
    pub(crate) phases: Vec<Phase>,
    /// The phases that go on, and the number of phases so far, by lineage.
    open: HashMap<u64, (usize, u32)>,
    /// Phases of modules that are not seen at present.
    closed: HashMap<u64, u32>,
    pub(crate) endings: HashMap<u64, Ending>,
    pub(crate) catalogue: Catalogue,
    /// Numbers that are kept.
    pub(crate) size: usize,
}

/// Samples after which a phase is thinned.
const BLOCK: usize = 32;

impl Tracks {
    /// Takes in the next sample. `births` has the births of modules by lineage; `now` is the time that it stands for, and `before` that of the sample before.
    pub(crate) fn add(
        &mut self,
        sample: &Sample,
        before: Option<f64>,
        births: &HashMap<u64, f64>,
        tolerance: f64,
    ) {
        let now = sample.time;
        for (place, source) in &sample.sources {
            self.catalogue.surfaces.entry(*place).or_insert_with(|| source.clone());
        }
        let mut open = HashMap::with_capacity(sample.modules.len());
        for (i, module) in sample.modules.iter().enumerate() {
            let id = module.lineage.id;
            let known = self.open.remove(&id);
            let same = known.filter(|(phase, _)| *self.phases[*phase].form == *sample.parts(i));
            let (number, count) = match (same, known) {
                (Some(same), _) => same,
                (None, known) => {
                    if let Some((phase, _)) = known {
                        self.close(phase, now, tolerance);
                    }
                    let count = known.map_or_else(|| self.closed.remove(&id).unwrap_or(0), |(_, n)| n);
                    let birth = births.get(&id).copied().unwrap_or(now);
                    let from = before.map(|before| if birth > before && birth <= now { birth } else { now });
                    self.begin(sample, i, (count, birth, from));
                    (self.phases.len() - 1, count + 1)
                }
            };
            self.append(number, sample, i, tolerance);
            open.insert(id, (number, count));
        }
        let gone = std::mem::replace(&mut self.open, open);
        for (id, (phase, count)) in gone {
            self.close(phase, now, tolerance);
            self.closed.insert(id, count);
        }
    }

    fn begin(&mut self, sample: &Sample, i: usize, (number, birth, from): (u32, f64, Option<f64>)) {
        let module = &sample.modules[i];
        let paint = self.catalogue.paint(sample.materials(i));
        self.phases.push(Phase {
            lineage: module.lineage,
            kind: module.kind.clone(),
            number,
            form: self.catalogue.form(sample.parts(i)),
            paints: vec![(sample.time, paint)],
            birth,
            ending: None,
            from,
            to: None,
            times: Vec::new(),
            frames: Vec::new(),
            numbers: Vec::new(),
            fresh: 0,
        });
    }

    fn append(&mut self, number: usize, sample: &Sample, i: usize, tolerance: f64) {
        let phase = &mut self.phases[number];
        let changed = phase.paints.last().is_none_or(|(_, paint)| **paint != *sample.materials(i));
        if changed {
            let paint = self.catalogue.paint(sample.materials(i));
            phase.paints.push((sample.time, paint));
        }
        let before = phase.numbers.len();
        phase.times.push(sample.time);
        phase.frames.push(sample.modules[i].frame);
        phase.numbers.extend_from_slice(sample.numbers(i));
        if phase.times.len() - phase.fresh > BLOCK {
            phase.thin(tolerance);
        }
        self.size = (self.size + phase.numbers.len()).saturating_sub(before);
    }

    /// Ends a phase, which is not seen any more at this time.
    fn close(&mut self, number: usize, now: f64, tolerance: f64) {
        let phase = &mut self.phases[number];
        let before = phase.numbers.len();
        phase.thin(tolerance);
        self.size -= before - phase.numbers.len();
        let last = phase.times.last().copied().unwrap_or(now);
        let death = self.endings.get(&phase.lineage.id).map(|ending| ending.time);
        phase.to = Some(death.filter(|death| *death >= last && *death <= now).unwrap_or(now));
    }

    /// Ends the run: what is seen goes on.
    pub(crate) fn finish(&mut self, tolerance: f64) {
        for phase in &mut self.phases {
            phase.thin(tolerance);
            phase.set_up();
            phase.ending = self.endings.get(&phase.lineage.id).copied();
        }
        self.open.clear();
    }

    /// Whether the module of this lineage ends after one time and not after another.
    pub(crate) fn ends_within(&self, id: u64, after: f64, up_to: f64) -> bool {
        self.endings.get(&id).is_some_and(|ending| ending.time > after && ending.time <= up_to)
    }
}
