//! The solver: steps on a global grid, of controlled error.

use crate::Wind;
use crate::link::Weights;
use crate::ros2::StepError;
use crate::sweep::{Bend, Instant, Workspace};
use crate::{Error, Growth, Method, Settings, Skeleton, State, Step};

/// Advances states of one skeleton, or of several in turn. Holds working memory only: results do not depend on what it did before.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    /// How it works.
    pub settings: Settings,
    /// When it stops with [`Error::OutOfTime`], if ever.
    pub deadline: Option<std::time::Instant>,
    pub(crate) skeleton: Skeleton,
    pub(crate) work: Workspace,
    /// Second memory of the method with four stages.
    pub(crate) aside: Workspace,
    pub(crate) trial: State,
    extent: f64,
    /// The segment with the largest error in the last step tried.
    worst: usize,
    counts: Counts,
}

/// What a solver has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps accepted.
    pub steps: u64,
    /// Steps rejected for their error.
    pub rejected: u64,
}

impl Solver {
    /// A solver with settings.
    pub fn new(settings: Settings) -> Solver {
        Solver { settings, ..Solver::default() }
    }

    /// Steps made since the solver was made.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Advances a state from a time to another (s), and shows each accepted step to `observe`.
    ///
    /// Steps have the length H/2^m and end at multiples of it, or at `to`, so their ends depend on the settings, on `from`, `to` and the state
    /// only. The skeleton of a step is that at its middle; the wind is sampled at both ends, once a segment, at the middle of its length.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] if the state does not fit the skeleton, [`Error::Value`] if a value is out of range, [`Error::Step`] if the
    /// error is too large with the shortest step, [`Error::Steps`] if there are too many, [`Error::OutOfTime`] after the deadline. The state is then that of the last accepted step.
    pub fn advance(
        &mut self,
        state: &mut State,
        from: f64,
        to: f64,
        growth: &mut impl Growth,
        wind: &impl Wind,
        mut observe: impl FnMut(&Step<'_>),
    ) -> Result<(), Error> {
        self.skeleton.clear();
        let mut time = from;
        let tried = |counts: Counts| counts.steps + counts.rejected;
        let spans = ((to - from) / self.settings.longest).ceil().max(1.0);
        let limit = tried(self.counts).saturating_add((self.settings.most as f64 * spans) as u64);
        while time < to {
            let end = self.step(state, time, to, growth, wind)?;
            if tried(self.counts) > limit {
                let (segment, most) = (self.worst, self.settings.most);
                return Err(Error::Steps { time, step: end - time, segment, most });
            }
            if self.deadline.is_some_and(|deadline| std::time::Instant::now() > deadline) {
                return Err(Error::OutOfTime { time });
            }
            observe(&Step { from: time, to: end, before: state, after: &self.trial });
            std::mem::swap(state, &mut self.trial);
            time = end;
        }
        Ok(())
    }

    /// Second derivatives of all strains at an instant, in 1/(m s²). Zero for rigid segments, and for those without inertia, whose strain
    /// follows its forces at once.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance).
    pub fn accelerations(
        &mut self,
        skeleton: &Skeleton,
        state: &State,
        wind: &impl Wind,
        time: f64,
    ) -> Result<Vec<crate::Vector>, Error> {
        self.skeleton.clear();
        self.renew(state, time, &mut crate::Fixed(skeleton))?;
        let (skeleton, air) = (&self.skeleton, &self.settings.air);
        let explicit = Weights { mass: 1.0, damping: 0.0, stiffness: 0.0, extra: 0.0, blur: 0.0 };
        let bend = Bend { strain: &state.strain, rate: &state.rate };
        let now = Instant { wind, from: time, to: time };
        self.work.spread(skeleton, air, bend, now, (1.0, 0.0), &explicit);
        self.work.gather(skeleton, &state.rate, &explicit, 0.0);
        self.work.resolve(skeleton);
        Ok(self.work.links.iter().map(|link| link.x).collect())
    }

    /// One accepted step, at most to `limit`; the new state is in `trial`. Returns its end.
    fn step(
        &mut self,
        state: &State,
        time: f64,
        limit: f64,
        growth: &mut impl Growth,
        wind: &impl Wind,
    ) -> Result<f64, Error> {
        let mut level = if self.settings.fixed { 0 } else { state.level.min(self.settings.deepest) };
        loop {
            let length = self.settings.longest / f64::from(level).exp2();
            let end = next_time(time, length, limit);
            self.renew(state, time + 0.5 * (end - time), growth)?;
            let instant = Instant { wind, from: time, to: end };
            let found = self.attempt(state, instant);
            self.worst = found.segment;
            let allowed = self.settings.tolerance * self.extent.max(f64::MIN_POSITIVE);
            let excess = found.displacement / allowed;
            if self.settings.fixed || excess <= 1.0 {
                if self.settings.fixed && excess.is_nan() {
                    return Err(Error::Step { time, step: end - time, segment: found.segment, excess });
                }
                self.counts.steps += 1;
                self.trial.level = self.next_level(level, excess, end);
                return Ok(end);
            }
            self.counts.rejected += 1;
            if level >= self.settings.deepest || time + 0.5 * (end - time) <= time {
                return Err(Error::Step { time, step: end - time, segment: found.segment, excess });
            }
            level = (level + self.deeper(excess)).min(self.settings.deepest);
        }
    }

    /// Takes the skeleton of a time over.
    pub(crate) fn renew(&mut self, state: &State, time: f64, growth: &mut impl Growth) -> Result<(), Error> {
        if !growth.skeleton(time, &mut self.skeleton) {
            return Ok(());
        }
        let (skeleton, work) = (&self.skeleton, &mut self.work);
        if state.strain.len() != skeleton.len() || state.rate.len() != skeleton.len() {
            return Err(Error::Length { state: state.strain.len(), skeleton: skeleton.len() });
        }
        skeleton.check()?;
        self.extent = skeleton.extent();
        work.fit(skeleton);
        work.flywheels(skeleton, self.settings.rotary);
        work.horizon = self.settings.longest;
        work.weigh(skeleton, &self.settings.air);
        self.trial.strain.resize(skeleton.len(), crate::Vector::zeros());
        self.trial.rate.resize(skeleton.len(), crate::Vector::zeros());
        Ok(())
    }

    fn attempt<W: Wind>(&mut self, state: &State, instant: Instant<'_, W>) -> StepError {
        let (skeleton, air) = (&self.skeleton, &self.settings.air);
        match self.settings.method {
            Method::Ros2 => self.work.ros2(skeleton, air, instant, state, &mut self.trial),
            Method::Euler => self.work.euler(skeleton, air, instant, state, &mut self.trial),
            Method::Ros34Pw2 => {
                self.work.ros34pw2(&mut self.aside, skeleton, air, instant, state, &mut self.trial)
            }
        }
    }

    /// Order of the error estimate in h.
    fn exponent(&self) -> f64 {
        if self.settings.method == Method::Ros34Pw2 { 3.0 } else { 2.0 }
    }

    /// How many levels deeper a step with too large an error is tried again: 1 to 4.
    fn deeper(&self, excess: f64) -> u32 {
        if !excess.is_finite() {
            return 4;
        }
        (excess.log2() / self.exponent()).ceil().clamp(1.0, 4.0) as u32
    }

    /// The level of the next step: one less if the error leaves room for it and the grid of longer steps has a point at `end`.
    fn next_level(&self, level: u32, excess: f64, end: f64) -> u32 {
        if level == 0 || self.settings.fixed || excess * self.exponent().exp2() * 1.6 >= 1.0 {
            return level;
        }
        let longer = self.settings.longest / f64::from(level - 1).exp2();
        let aligned =
            (end / longer).fract() == 0.0 || next_time(end, longer, f64::INFINITY) - end > 0.5 * longer;
        if aligned { level - 1 } else { level }
    }
}

/// The first multiple of `length` after `time`, at most `limit`. A step to it is not shorter than a millionth of `length` because of rounding.
fn next_time(time: f64, length: f64, limit: f64) -> f64 {
    let mut end = ((time / length).floor() + 1.0) * length;
    if end - time < 1e-6 * length {
        end += length;
    }
    if limit - end < 1e-6 * length { limit } else { end }
}
