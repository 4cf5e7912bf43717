//! How the coupled modules move during their common step, and on stretches that were integrated again since it was made.

use dlsys_expr::{Dual, Interval};
use dlsys_ode::{Coefficients, Dense};
use dlsys_tree::{SimTime, room};

use crate::world::prefetch::fetch;

/// The trajectory of all components from the last common step to its end.
#[derive(Clone, Debug)]
pub struct CoupledSolution {
    /// The common step, then the stretches of reintegrations.
    stretches: Vec<Dense>,
    /// By stretch, of the first of those that a region follows one after another: the number of its components that do. Each event
    /// takes over those of several before it, and what nobody follows any more would be most of what is kept.
    followers: Vec<u32>,
    /// Stretches that nobody follows: their places are free.
    free: Vec<u32>,
    /// By component: where it is found. Empty as long as there is the common step only.
    tracks: Vec<Track>,
    pub end: SimTime,
    /// The estimated relative error of the components, in the worst of the stretches.
    pub error: f64,
}

/// The stretches, one after another, in which a component is found, and its number there.
#[derive(Clone, Copy, Debug)]
struct Track {
    first: u32,
    /// None yet if this is 0.
    count: u32,
    component: u32,
}

impl Track {
    const NOWHERE: Track = Track { first: 0, count: 0, component: 0 };
}

/// The stretches of a common step are kept, whoever follows them.
const ALL: u32 = u32::MAX;

/// A component along a stretch of time that lies within one dense output.
#[derive(Clone, Copy)]
pub struct DenseComponent<'c> {
    dense: &'c Dense,
    component: usize,
    /// Position in the dense output at the start, and change of it from start to end.
    from: f64,
    scale: f64,
}

impl CoupledSolution {
    /// The components of a common step.
    pub fn new(step: Dense) -> CoupledSolution {
        let (end, error) = (step.end, step.error);
        let stretches = vec![step];
        CoupledSolution { stretches, followers: vec![ALL], free: Vec::new(), tracks: Vec::new(), end, error }
    }

    /// The components of a common step that is several stretches.
    pub fn of(stretches: Vec<Dense>) -> CoupledSolution {
        let end = stretches.last().expect("one at least").end;
        let count = stretches.len() as u32;
        let track = |component: u32| Track { first: 0, count, component };
        let tracks =
            if count == 1 { Vec::new() } else { (0..stretches[0].components() as u32).map(track).collect() };
        let error = stretches.iter().map(|dense| dense.error).fold(0.0, f64::max);
        let followers = vec![ALL; stretches.len()];
        CoupledSolution { stretches, followers, free: Vec::new(), tracks, end, error }
    }

    /// The start of the common step.
    pub fn start(&self) -> SimTime {
        self.stretches[0].start
    }

    /// True if all components follow the dense output of the common step to its end.
    pub fn is_whole(&self) -> bool {
        self.tracks.is_empty()
    }

    #[inline]
    fn track(&self, component: usize) -> Track {
        let whole = Track { first: 0, count: 1, component: component as u32 };
        self.tracks.get(component).copied().unwrap_or(whole)
    }

    /// The dense output that a component follows from an instant on, and its number there; None for one that has not been
    /// integrated yet.
    #[inline]
    pub fn stretch(&self, component: usize, at: SimTime) -> Option<(&Dense, usize)> {
        let Track { first, count, component } = self.track(component);
        if count == 1 {
            return Some((&self.stretches[first as usize], component as usize));
        }
        let own = &self.stretches[first as usize..(first + count) as usize];
        let dense = own.iter().find(|dense| at.since(dense.end) < 0.0).or(own.last())?;
        Some((dense, component as usize))
    }

    /// A component at an instant; None for one that has not been integrated yet.
    pub fn value(&self, component: usize, at: SimTime) -> Option<f64> {
        let (dense, component) = self.stretch(component, at)?;
        Some(value_of(dense, component, dense.position(at)))
    }

    /// Prefetches where these components are found, then how they move there: each of many would wait for memory three times.
    pub fn prefetch(&self, components: &[u32]) {
        components.iter().filter_map(|component| self.tracks.get(*component as usize)).for_each(fetch);
        let tracks = || components.iter().map(|component| self.track(*component as usize));
        let found = || {
            tracks()
                .filter(|track| track.count > 0)
                .map(|track| (track, &self.stretches[track.first as usize]))
        };
        found().for_each(|(_, dense)| fetch(dense));
        found().for_each(|(track, dense)| {
            let coefficients = dense.of(track.component as usize);
            coefficients.first().into_iter().chain(coefficients.last()).for_each(fetch);
        });
    }

    /// The end of the dense output that a component follows from an instant on.
    pub fn knot(&self, component: usize, from: SimTime) -> SimTime {
        self.stretch(component, from).map_or(self.end, |(dense, _)| dense.end)
    }

    /// Bounds of a component from an instant to the end; None for one that has not been integrated yet.
    pub fn hull(&self, component: usize, from: SimTime) -> Option<Interval> {
        let Track { first, count, component } = self.track(component);
        if count == 1 {
            return Some(self.stretches[first as usize].bounds(component as usize));
        }
        let own = &self.stretches[first as usize..(first + count) as usize];
        // The last one is there however late it is.
        let passed = own.iter().take_while(|dense| from.since(dense.end) >= 0.0).count();
        let ahead = own[passed.min(own.len().saturating_sub(1))..].iter();
        ahead.map(|dense| dense.bounds(component as usize)).reduce(Interval::hull)
    }

    /// A component along a stretch of time.
    pub fn piece(&self, component: usize, start: SimTime, h: f64) -> Option<DenseComponent<'_>> {
        let (dense, component) = self.stretch(component, start)?;
        Some(DenseComponent::new(dense, component, start, h))
    }

    /// Adds some components that are not integrated yet, to so many at least; gives the number of the first.
    pub fn add(&mut self, components: usize, more: usize) -> usize {
        self.track_all(components);
        let first = self.tracks.len();
        room::lengthen(&mut self.tracks, first + more, || Track::NOWHERE);
        first
    }

    /// Puts stretches in place of those that some components have followed. `components` are numbered as in the stretches.
    pub fn replace(&mut self, stretches: &mut Vec<Dense>, components: &[u32], all: usize) {
        self.track_all(all);
        components.iter().for_each(|component| self.leave(self.tracks[*component as usize]));
        self.error = stretches.iter().map(|dense| dense.error).fold(self.error, f64::max);
        let count = stretches.len() as u32;
        let first = match self.free.pop_if(|_| count == 1) {
            Some(free) => {
                stretches.drain(..).for_each(|dense| self.stretches[free as usize] = dense);
                free
            }
            None => {
                let first = self.stretches.len();
                room::reserve(&mut self.stretches, stretches.len());
                self.stretches.append(stretches);
                room::lengthen(&mut self.followers, self.stretches.len(), || 0);
                first as u32
            }
        };
        self.followers[first as usize] = components.len() as u32;
        for (number, &component) in components.iter().enumerate() {
            self.tracks[component as usize] = Track { first, count, component: number as u32 };
        }
    }

    /// Notes that nobody asks for some components any more.
    pub fn release(&mut self, components: impl IntoIterator<Item = u32>) {
        for component in components {
            if let Some(track) = self.tracks.get_mut(component as usize) {
                let before = std::mem::replace(track, Track::NOWHERE);
                self.leave(before);
            }
        }
    }

    /// Notes that a component goes another way than this from now on.
    fn leave(&mut self, Track { first, count, .. }: Track) {
        let followers = &mut self.followers[first as usize];
        if count == 0 || *followers == ALL {
            return;
        }
        *followers -= 1;
        if *followers == 0 {
            self.free.extend(first..first + count);
            for dense in &mut self.stretches[first as usize..(first + count) as usize] {
                *dense = Dense::new(dense.start, Some(dense.end), dense.h, 0, Vec::new());
            }
        }
    }

    /// Gives so many components tracks of their own, at least: those that have none follow the common step.
    fn track_all(&mut self, components: usize) {
        let mut component = self.tracks.len() as u32;
        room::lengthen(&mut self.tracks, components, || {
            component += 1;
            Track { first: 0, count: 1, component: component - 1 }
        });
    }
}

/// A component at a position. What is looked for most is the end, and that is a coefficient.
#[inline]
pub fn value_of(dense: &Dense, component: usize, position: f64) -> f64 {
    match dense.of(component) {
        [only] => *only,
        [.., last] if position == 1.0 => *last,
        _ => dense.value(component, position),
    }
}

impl<'c> DenseComponent<'c> {
    pub fn new(dense: &'c Dense, component: usize, start: SimTime, h: f64) -> DenseComponent<'c> {
        if dense.start == start && dense.h == h {
            return DenseComponent { dense, component, from: 0.0, scale: 1.0 };
        }
        let scale = if dense.h == 0.0 { 0.0 } else { h / dense.h };
        DenseComponent { dense, component, from: dense.position(start), scale }
    }

    /// The position in the dense output.
    #[inline]
    pub fn position(&self, position: f64) -> f64 {
        (self.from + self.scale * position).min(1.0)
    }

    pub fn value(&self, position: f64) -> f64 {
        self.dense.value_or_end(self.component, self.position(position))
    }

    /// The coefficients of the dense output.
    pub fn coefficients(&self) -> &'c [f64] {
        self.dense.of(self.component)
    }

    /// The value at the start and its rate, per unit of position.
    pub fn departure(&self) -> Dual<f64> {
        let Dual { value, rate } = self.dense.departure(self.component, self.from);
        Dual { value, rate: rate * self.scale }
    }

    /// Adds the polynomial, times a factor, to a sum of others of the same dense output and stretch; false if it is not of them.
    pub fn add_to(&self, factor: f64, sum: &mut Option<(DenseComponent<'c>, Coefficients)>) -> bool {
        let (first, coefficients) = sum.get_or_insert((*self, Coefficients::default()));
        self.dense.add_to(self.component, factor, coefficients);
        std::ptr::eq(first.dense, self.dense)
    }

    /// Bounds of such a sum and of its rate from one position to another.
    pub fn sum_over(&self, mut sum: Coefficients, lo: f64, hi: f64) -> Dual<Interval> {
        self.scaled(self.dense.stretch(&mut sum, self.position(lo), self.position(hi)))
    }

    /// The estimated error of a value of a size.
    pub fn error_of(&self, size: f64) -> f64 {
        self.dense.error * size + self.dense.misfit(self.component)
    }

    /// Bounds over the whole stretch.
    pub fn bounds(&self) -> Interval {
        if self.from == 0.0 && self.scale == 1.0 {
            return self.dense.bounds(self.component);
        }
        self.over(0.0, 1.0).value
    }

    /// Bounds of the value and of its rate (per unit of position) from one position to another.
    pub fn over(&self, lo: f64, hi: f64) -> Dual<Interval> {
        self.scaled(self.dense.piece(self.component, self.position(lo), self.position(hi)))
    }

    /// Rates per unit of position of the stretch.
    fn scaled(&self, Dual { value, rate }: Dual<Interval>) -> Dual<Interval> {
        let s = self.scale;
        Dual { value, rate: Interval { lo: rate.lo * s, hi: rate.hi * s, ..rate } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stretch of components that rest at some values, from 0 to 1.
    fn rest(values: &[f64]) -> Dense {
        Dense::new(SimTime::ZERO, None, 1.0, 0, values.to_vec())
    }

    #[test]
    fn what_nobody_follows_is_given_back_and_all_others_stay() {
        let mut solution = CoupledSolution::new(rest(&[1.0, 2.0, 3.0]));
        let replace = |solution: &mut CoupledSolution, values: &[f64], components: &[u32]| {
            solution.replace(&mut vec![rest(values)], components, 3);
        };
        let values = |solution: &CoupledSolution| [0, 1, 2].map(|c| solution.value(c, SimTime::ZERO));
        replace(&mut solution, &[10.0, 20.0], &[0, 1]);
        replace(&mut solution, &[200.0, 300.0], &[1, 2]);
        assert_eq!(values(&solution), [10.0, 200.0, 300.0].map(Some));
        assert!(solution.free.is_empty(), "the first component still follows the first stretch");
        // The stretch that it leaves is followed by nobody, and the new one takes its place.
        replace(&mut solution, &[100.0], &[0]);
        assert_eq!((solution.free.len(), solution.stretches.len()), (0, 3));
        replace(&mut solution, &[3000.0], &[2]);
        assert_eq!((solution.free.len(), solution.stretches.len()), (0, 4));
        assert_eq!(values(&solution), [100.0, 200.0, 3000.0].map(Some));
        // A module that dies follows nothing.
        solution.release([1]);
        assert_eq!(values(&solution), [Some(100.0), None, Some(3000.0)]);
        assert_eq!(solution.free.len(), 1);
        // Several stretches end to end take places of their own.
        solution.replace(&mut vec![rest(&[5.0]), rest(&[6.0])], &[0], 3);
        assert_eq!([0.0, 1.0].map(|t| solution.value(0, SimTime::new(t))), [5.0, 6.0].map(Some));
        assert_eq!((solution.free.len(), solution.stretches.len()), (2, 6));
    }
}
