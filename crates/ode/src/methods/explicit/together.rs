//! A step of a pair that several threads make together.
//!
//! Each has the components of one part of the system, in all columns, and goes through all stages with them. What it needs of the others before
//! each evaluation is the values of those components that its rates read: few where modules read their neighbours. They are exchanged through
//! the border, a list of all components that are read across. So threads are begun once for a step, and wait for one another once for a stage.
//!
//! Components are computed as they are by one thread, and the largest of errors does not depend on the order in which they are compared: the
//! bits are those of one thread.

use super::columns::{Tried, combine_for, largest_error, polynomials};
use super::{AtPlace, Pair};
use crate::dense::{Dense, PLACE};
use crate::one_step::{InteriorError, Step, Trial};
use crate::rates::{Part, Rates};
use crate::workspace::{FLOOR, MAX_STAGES, Workspace};
use dlsys_expr::SimTime;
use dlsys_threads::Meeting;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// The parts of a system.
type Parts<'p> = Vec<Box<dyn Part + 'p>>;

/// What a thread has of a step.
struct Share<'w, 'p> {
    part: Box<dyn Part + 'p>,
    components: Range<usize>,
    /// The state at the start of the step.
    y: &'w [f64],
    from: &'w mut [f64],
    end: &'w mut [f64],
    other_end: &'w mut [f64],
    k: [&'w mut [f64]; MAX_STAGES],
    is_sum: &'w [bool],
    noise: &'w [f64],
    /// The coefficients of the dense output, where that is made.
    output: &'w mut [f64],
    /// The state at which rates are evaluated: the components, then the foreign ones.
    state: &'w mut Vec<f64>,
    links: Links,
    /// The number of exchanges so far.
    exchanges: usize,
}

/// How a part is linked to the border.
struct Links {
    /// The components that others read, and their places in the border.
    outgoing: Vec<(u32, u32)>,
    /// The places of the foreign ones.
    incoming: Vec<u32>,
}

/// The values of the components that other parts read. There are two lists, used by turns: while some read one, others may be at the next.
struct Border([Vec<AtomicU64>; 2]);

/// What the shares have in common.
struct Crew<'w> {
    border: &'w Border,
    meeting: &'w Meeting,
}

impl Share<'_, '_> {
    /// Evaluates the rates of a stage at the state that is there.
    fn evaluate(&mut self, crew: &Crew, tau: f64, stage: usize) {
        let values = &crew.border.0[self.exchanges % 2];
        self.exchanges += 1;
        for (component, place) in &self.links.outgoing {
            values[*place as usize].store(self.state[*component as usize].to_bits(), Ordering::Relaxed);
        }
        crew.meeting.wait();
        let own = self.components.len();
        for (foreign, place) in self.state[own..].iter_mut().zip(&self.links.incoming) {
            *foreign = f64::from_bits(values[*place as usize].load(Ordering::Relaxed));
        }
        self.part.rates(tau, self.state, self.k[stage]);
    }

    /// The state of a stage, and its rates.
    fn pass<P: Pair>(&mut self, crew: &Crew, stage: usize, h: f64) {
        let own = self.components.len();
        combine_for::<P, _>(stage, self.from, &self.k, h, &mut self.state[..own]);
        self.evaluate(crew, P::TABLEAU.c[stage] * h, stage);
    }

    /// Tries the step; returns the errors by truncation and by rounding, and whether all values are finite.
    fn attempt<P: Pair>(&mut self, crew: &Crew, scale: (f64, f64, (f64, f64))) -> (f64, f64, bool) {
        let (tableau, own) = (P::TABLEAU, self.components.len());
        self.from.copy_from_slice(self.y);
        for stage in 1..tableau.stages {
            self.pass::<P>(crew, stage, scale.0);
            if stage + 2 == tableau.stages {
                self.other_end.copy_from_slice(&self.state[..own]);
            }
        }
        self.end.copy_from_slice(&self.state[..own]);
        let Share { k, from, end, is_sum, noise, .. } = self;
        let step = Tried { k, from, end, is_sum, noise };
        let (error, rounding) = largest_error::<P>(step, own, scale);
        let are_finite = |all: &[f64]| all.iter().fold(true, |finite, x| finite & x.is_finite());
        (error, rounding, are_finite(end) && are_finite(k[tableau.stages - 1]))
    }

    /// Makes the dense output.
    fn dense<P: Pair>(&mut self, crew: &Crew, h: f64) {
        self.from.copy_from_slice(self.y);
        for stage in P::TABLEAU.stages..P::TABLEAU.a.len() {
            self.pass::<P>(crew, stage, h);
        }
        polynomials::<P, _, _>(&self.k, self.y, self.end, h, &mut *self.output);
    }

    /// The error of the dense output.
    fn interior_error<P: Pair>(&mut self, crew: &Crew, dense: &Dense) -> InteriorError {
        // The second and the third stage are no longer needed.
        for (number, component) in self.components.clone().enumerate() {
            (self.state[number], self.k[2][number]) = dense.at_place(component);
        }
        self.evaluate(crew, PLACE * dense.h, 1);
        let [first, rates, slopes] = [0, 1, 2].map(|stage| &*self.k[stage]);
        P::interior_error(dense.h, self.y, AtPlace { first, values: self.state, slopes, rates })
    }
}

/// The parts of a column of all components, or nothing of one that is not provided.
fn divided<'c, T>(mut column: &'c mut [T], parts: &Parts, each: usize) -> Vec<&'c mut [T]> {
    let lengths = parts.iter().map(|part| each * part.components().len());
    let is_provided = column.len() >= lengths.clone().sum();
    let lengths = lengths.map(|length| if is_provided { length } else { 0 });
    lengths.map(|length| column.split_off_mut(..length).expect("long enough")).collect()
}

/// The border of some parts, and how each is linked to it.
fn border(parts: &Parts) -> (Border, Vec<Links>) {
    let mut read: Vec<u32> = parts.iter().flat_map(|part| part.foreign()).copied().collect();
    read.sort_unstable();
    read.dedup();
    let place = |component: &u32| read.binary_search(component).expect("it is read") as u32;
    let mut links = Vec::with_capacity(parts.len());
    for part in parts {
        let Range { start, end } = part.components();
        let from = read.partition_point(|component| (*component as usize) < start);
        let own = read[from..].iter().take_while(|component| (**component as usize) < end);
        let outgoing = own.zip(from as u32..).map(|(component, place)| (component - start as u32, place));
        let incoming = part.foreign().iter().map(place);
        links.push(Links { outgoing: outgoing.collect(), incoming: incoming.collect() });
    }
    let values = || read.iter().map(|_| AtomicU64::default()).collect();
    (Border([values(), values()]), links)
}

impl Workspace {
    /// The system in parts, if threads shall share some work on a step that evaluates the rates so many times.
    pub(super) fn parts<'s>(&mut self, system: &'s mut impl Rates, times: usize) -> Option<Parts<'s>> {
        if self.reached_is_kept {
            return None;
        }
        let modules = system.modules();
        let parts = system.parts();
        if parts.is_empty() {
            return None;
        }
        self.evaluations += times as u64 * modules;
        Some(parts)
    }

    /// Does some work with each share of a step from `y`, on as many threads as there are parts; with `output`, so many coefficients for each
    /// component.
    fn together<T: Send>(
        &mut self,
        parts: Parts,
        y: &[f64],
        (output, each): (&mut [f64], usize),
        work: impl Fn(&mut Share, &Crew) -> T + Sync,
    ) -> Vec<T> {
        let (border, links) = border(&parts);
        self.states.resize_with(parts.len(), Vec::new);
        let mut k: Vec<_> = self.k.iter_mut().map(|k| divided(k, &parts, 1).into_iter()).collect();
        let mut from = divided(&mut self.from, &parts, 1).into_iter();
        let mut end = divided(&mut self.end, &parts, 1).into_iter();
        let mut other_end = divided(&mut self.other_end, &parts, 1).into_iter();
        let mut output = divided(output, &parts, each).into_iter();
        let each = parts.into_iter().zip(&mut self.states).zip(links);
        let shares = each.map(|((part, state), links)| {
            let components = part.components();
            debug_assert!(components.end <= y.len(), "a component that there is not");
            state.resize(components.len() + links.incoming.len(), 0.0);
            Share {
                y: &y[components.clone()],
                from: from.next().expect("as many as parts"),
                end: end.next().expect("as many as parts"),
                other_end: other_end.next().expect("as many as parts"),
                k: std::array::from_fn(|stage| k[stage].next().expect("as many as parts")),
                is_sum: self.is_sum.get(components.clone()).unwrap_or_default(),
                noise: self.noise.get(components.clone()).unwrap_or_default(),
                output: output.next().expect("as many as parts"),
                links,
                part,
                components,
                state,
                exchanges: 0,
            }
        });
        let shares: Vec<Share> = shares.collect();
        dlsys_threads::together(shares, |mut share, meeting| {
            work(&mut share, &Crew { border: &border, meeting })
        })
    }

    /// Tries a step of a pair from a state whose rates are known.
    pub(super) fn attempt_together<P: Pair>(
        &mut self,
        parts: Parts,
        Step { y, h, .. }: Step<'_>,
        tolerance: f64,
    ) -> Trial {
        let scale = (h, tolerance, (self.resolution, FLOOR));
        let all = self.together(parts, y, (&mut [], 0), |share, crew| share.attempt::<P>(crew, scale));
        let are_finite = all.iter().all(|(.., are_finite)| *are_finite);
        // A NaN is the largest of all.
        let largest = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        let error = all.iter().fold(0.0, |most, (error, ..)| largest(most, *error));
        let rounding = all.iter().fold(0.0, |most, (_, rounding, _)| largest(most, *rounding));
        match are_finite && error.is_finite() {
            true => Trial::Done { error, rounding },
            false => self.outcome(error, rounding, P::TABLEAU.stages - 1),
        }
    }

    /// The dense output of the step just tried.
    pub(super) fn dense_together<P: Pair>(
        &mut self,
        parts: Parts,
        Step { y, start, h }: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        let each = P::DEGREE + 1;
        let mut output = vec![0.0; y.len() * each];
        self.together(parts, y, (&mut output, each), |share, crew| share.dense::<P>(crew, h));
        Dense::new(start, end, h, P::DEGREE, output)
    }

    /// The error of the dense output inside the step just tried.
    pub(super) fn interior_error_together<P: Pair>(
        &mut self,
        parts: Parts,
        y: &[f64],
        dense: &Dense,
    ) -> InteriorError {
        let all = self.together(parts, y, (&mut [], 0), |share, crew| share.interior_error::<P>(crew, dense));
        all.iter().fold(InteriorError::default(), |most, error| InteriorError {
            relative: most.relative.max(error.relative),
            absolute: most.absolute.max(error.absolute),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::dop853::Dop853;
    use crate::{Control, Method, StepSettings, Stepper};

    const COUNT: usize = 203;

    /// The rate of a component that reads its neighbours, and one far away; not finite where one is too large.
    fn rate(tau: f64, own: f64, [before, after, far]: [f64; 3]) -> f64 {
        before * before + after - 2.0 * own * own + 0.3 * far * tau.cos() + (4.0 - own).sqrt()
    }

    /// The components that the rate of one depends on besides its own.
    fn read_by(component: usize) -> [usize; 3] {
        [(component + COUNT - 1) % COUNT, (component + 1) % COUNT, component * 7 % COUNT]
    }

    /// A ring, in parts that begin at some components; in one piece if there are none.
    struct Ring<'c>(&'c [usize]);

    impl Rates for Ring<'_> {
        fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
            for (i, out) in out.iter_mut().enumerate() {
                *out = rate(tau, y[i], read_by(i).map(|j| y[j]));
            }
        }

        fn couplings(&self) -> Vec<(u32, u32)> {
            Vec::new()
        }

        fn partials(&mut self, _: f64, _: &[f64], _: &mut Vec<f64>) {}

        fn modules(&self) -> u64 {
            COUNT as u64
        }

        fn parts(&mut self) -> Vec<Box<dyn Part + '_>> {
            let ends = self.0.iter().skip(1).copied().chain([COUNT]);
            let arc = |(start, end)| {
                let read = (start..end).flat_map(read_by).filter(|j| !(start..end).contains(j));
                let mut foreign: Vec<u32> = read.map(|j| j as u32).collect();
                foreign.sort_unstable_by_key(|j| j % 5 * 1000 + j);
                foreign.dedup();
                Box::new(Arc(start..end, foreign)) as Box<dyn Part>
            };
            self.0.iter().copied().zip(ends).map(arc).collect()
        }
    }

    struct Arc(Range<usize>, Vec<u32>);

    impl Part for Arc {
        fn components(&self) -> Range<usize> {
            self.0.clone()
        }

        fn foreign(&self) -> &[u32] {
            &self.1
        }

        fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
            let value = |j: usize| match self.0.contains(&j) {
                true => y[j - self.0.start],
                false => y[self.0.len() + self.1.iter().position(|f| *f as usize == j).expect("told")],
            };
            for (i, out) in self.0.clone().zip(out) {
                *out = rate(tau, value(i), read_by(i).map(value));
            }
        }
    }

    /// All that some steps give, in bits, with their number and that of evaluations.
    fn run(settings: StepSettings, cuts: &[usize], is_unwatched: bool) -> (Vec<u64>, (u64, u64), u64) {
        let mut stepper = Stepper::default();
        stepper.is_unwatched = is_unwatched;
        let (mut control, mut ring) = (Control::default(), Ring(cuts));
        let mut y: Vec<f64> = (0..COUNT).map(|i| 1.0 + (i as f64 * 0.7).sin() * 0.9).collect();
        let (mut now, end) = (SimTime::ZERO, SimTime::new(1.5));
        let mut bits = Vec::new();
        stepper.restart(settings.method, y.len());
        while end.since(now) > 0.0 {
            now = stepper.step(&settings, &mut control, &mut ring, &y, now, Some(end)).expect("a step");
            let dense = stepper.dense(&mut ring, &y);
            bits.extend((0..COUNT).flat_map(|c| dense.of(c)).map(|x| x.to_bits()));
            stepper.advance(&mut y);
            bits.extend(y.iter().map(|x| x.to_bits()));
        }
        (bits, stepper.counts(), stepper.evaluations())
    }

    #[test]
    fn threads_make_the_steps_of_one() {
        for (method, tolerance) in [(Method::Dopri5, 1e-5), (Method::Dop853, 1e-9), (Method::Auto, 1e-6)] {
            let settings = StepSettings { method, tolerance, step_size: 0.1 };
            for is_unwatched in [false, true] {
                let alone = run(settings, &[], is_unwatched);
                assert!(alone.1.0 > 3, "several steps");
                for cuts in [&[0, 96][..], &[0, 1, 64, 200], &[0]] {
                    assert!(run(settings, cuts, is_unwatched) == alone, "{method:?}, parts from {cuts:?}");
                }
            }
        }
    }

    /// A step that leaves the domain of the equations is found by whoever comes there, and it is the same component that is told.
    #[test]
    fn what_is_not_finite_is_found_in_any_part() {
        for far in [3, 100, 202] {
            let mut y = vec![1.0; COUNT];
            y[far] = 3.9999;
            let tried = |cuts: &[usize]| {
                let (mut work, mut ring) = (Workspace::default(), Ring(cuts));
                work.provide(COUNT, MAX_STAGES);
                work.start(&mut ring, &y).expect("a rate");
                let step = Step { y: &y, start: SimTime::ZERO, h: 0.8 };
                work.attempt_pair::<Dop853>(&mut ring, step, 1e-9)
            };
            let alone = tried(&[]);
            assert!(matches!(alone, Trial::NotFinite(_)), "{alone:?}");
            assert_eq!(tried(&[0, 50, 150]), alone);
        }
    }
}
