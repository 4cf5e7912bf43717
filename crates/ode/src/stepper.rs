//! Steps of controlled error: the loop that tries a step, judges it, and tries again with another length.

use crate::control::{CERTAINTY, Control, Powerless, StepSettings, fit, growth, next_grid_time, shrinkage};
use crate::dense::Dense;
use crate::methods::{Scheme, Schemes};
use crate::one_step::{InteriorError, Step, Trial};
use crate::rates::Shifted;
use crate::workspace::{Reached, Workspace};
use crate::{Error, Method, Rates};
use dlsys_expr::SimTime;

/// The memory of smaller systems is kept between steps: it stays in the caches.
const MANY: usize = 4096;

/// The longest step. Where all errors are zero steps grow without end; beyond this number nothing is left to follow, and far beyond
/// it the positions of stages are no numbers.
const LONGEST: f64 = 1e100;
/// The factor by which true errors of steps may exceed the estimated ones.
const CAUTION: f64 = 4.0;
/// The tolerated error of a single step, as a part of the tolerance, for methods that do not say otherwise.
const TOLERANCE_SHARE: f64 = 0.1;

/// Inside a step the dense output may err by so many tolerances: where a step is much longer than stability allows, the estimate,
/// made of two, is misled by slow components.
const INTERIOR: f64 = 4.0;
/// The end of a step is known so many times better than its inside, where that is worse than the end was estimated to be.
const END_IS_BETTER: f64 = 4.0;

/// After so many rejections of one step, rounding may be the reason.
const MANY_REJECTIONS: u32 = 6;

/// An implicit step may be as long as thousands of periods of what a stiff component follows: its ends lie on that, whatever is
/// between them. So many times it is cut.
const MANY_PERIODS: u32 = 40;
/// The part of the length at which the inside of the next implicit step would err by as much as is tolerated.
const SAFETY: f64 = 0.8;

/// Errors below this part of the tolerated one, relative to max(1, |value|), are accepted where shorter steps do not help.
const NEGLIGIBLE: f64 = 1e-2;

/// The part of a step's length that is tried when its stages could not be solved for, or left the domain of the equations.
const RETREAT: f64 = 0.25;

/// Makes the steps of one system after another.
///
/// It holds working memory and the last step; what a run of steps remembers is in [`Control`], which belongs to the caller and may be
/// copied, kept, and given back.
///
/// ```
/// use dlsys_expr::SimTime;
/// use dlsys_ode::{Control, Method, Rates, StepSettings, Stepper};
///
/// /// y' = -y
/// struct Decay;
///
/// impl Rates for Decay {
///     fn rates(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
///         out[0] = -y[0];
///     }
///     fn couplings(&self) -> Vec<(u32, u32)> {
///         vec![(0, 0)]
///     }
///     fn partials(&mut self, _: f64, _: &[f64], out: &mut Vec<f64>) {
///         out.clear();
///         out.push(-1.0);
///     }
///     fn modules(&self) -> u64 {
///         1
///     }
/// }
///
/// # fn main() -> Result<(), dlsys_ode::Error> {
/// let settings = StepSettings { method: Method::Dopri5, tolerance: 1e-9, step_size: 0.1 };
/// let (mut stepper, mut control) = (Stepper::default(), Control::default());
/// let (mut y, mut now, end) = (vec![1.0], SimTime::ZERO, SimTime::new(2.0));
/// stepper.restart(settings.method, y.len());
/// while end.since(now) > 0.0 {
///     now = stepper.step(&settings, &mut control, &mut Decay, &y, now, Some(end))?;
///     stepper.advance(&mut y);
/// }
/// assert!((y[0] - (-2f64).exp()).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Default)]
pub struct Stepper {
    work: Workspace,
    schemes: Schemes,
    /// The scheme of the step just made; None before the first with the method `auto`.
    scheme: Option<Scheme>,
    /// The implicit method was taken for some step.
    has_been_implicit: bool,
    /// The rates at the start of the next step are known.
    rate_is_known: bool,
    /// Limits cut the steps shorter than step control would make them: `auto` prefers methods of low order.
    pub is_cut: bool,
    /// Nothing is searched for inside steps, so that their interior need not be as exact as their ends; see [`Stepper::refined`].
    pub is_unwatched: bool,
    /// The range of the components at the stages is kept: [`Stepper::reached`].
    pub reached_is_kept: bool,
    /// So many components may err by more than is tolerated in a step, if the method tells the errors of single ones: those that
    /// the caller integrates again, [`Stepper::rough`].
    pub spared: usize,
    /// Start, length and end of the step just made.
    step: (SimTime, f64, SimTime),
    /// Its error, relative.
    error: f64,
    /// Its dense output, where that is known already.
    output: Option<Dense>,
    /// Steps are so short that rounding of the state is taken into account.
    noisy: bool,
    steps: u64,
    rejected: u64,
}

/// The tries of one step.
struct Tries {
    scheme: Scheme,
    /// The tolerated error of the step.
    tolerance: f64,
    /// That of the run.
    outer: f64,
    /// Order of the error estimate.
    order: u32,
    start: SimTime,
    /// Length up to the limit.
    room: f64,
    is_fixed: bool,
    /// True if an earlier try failed.
    failed: bool,
    /// Rejections for the estimated error, and for the error of the dense output.
    rejections: u32,
    interior_rejections: u32,
    powerless: Powerless,
}

/// The judgement on a step tried.
enum Verdict {
    Accepted,
    /// Another step is tried, of this length.
    Again(f64),
}

impl Stepper {
    /// Prepares for another system of `n` components, or for a start elsewhere.
    pub fn restart(&mut self, method: Method, n: usize) {
        self.rate_is_known = false;
        self.noisy = false;
        self.work.noise.clear();
        self.work.end.resize(n, 0.0);
        self.scheme = method.scheme();
        self.schemes.forget();
    }

    /// Where in the step just made rates were evaluated that its error estimate depends on, as fractions of it.
    pub fn nodes(&self) -> &[f64] {
        self.schemes.nodes(self.scheme())
    }

    fn scheme(&self) -> Scheme {
        self.scheme.unwrap_or(Scheme::Dopri5)
    }

    /// True if the implicit method was taken for some step so far.
    pub fn has_been_implicit(&self) -> bool {
        self.has_been_implicit
    }

    /// Evaluations of the equations of single modules so far ([`Rates::modules`] for each evaluation of the rates).
    pub fn evaluations(&self) -> u64 {
        self.work.evaluations
    }

    /// What all steps have cost so far, about, in evaluations of one module's equations.
    pub fn cost(&self) -> u64 {
        self.work.cost()
    }

    /// Steps made and steps rejected so far.
    pub fn counts(&self) -> (u64, u64) {
        (self.steps, self.rejected)
    }

    /// The range of the components in the step just made; None for methods that do not tell, or if it is not kept.
    pub fn reached(&self) -> Option<Reached<'_>> {
        let is_known = self.work.reached_is_kept && self.scheme().facts().stages_are_kept;
        let [least, greatest] = self.work.reached.each_ref();
        is_known.then(|| Reached { least: &least[..self.size()], greatest: &greatest[..self.size()] })
    }

    /// Number of components.
    pub fn size(&self) -> usize {
        self.work.end.len()
    }

    /// The state at the end of the step just made, to be corrected where unknowns are solved for along with it.
    pub fn end_mut(&mut self) -> &mut [f64] {
        &mut self.work.end
    }

    /// The tolerated error of the single steps of most methods, as a part of the tolerance of a run.
    pub const TOLERANCE_SHARE: f64 = TOLERANCE_SHARE;

    /// Makes a step from `y` at `start`, no further than `limit`; returns its end.
    ///
    /// # Errors
    ///
    /// The step would be shorter than the resolution of time, or the equations are not finite there.
    pub fn step(
        &mut self,
        settings: &StepSettings,
        control: &mut Control,
        system: &mut impl Rates,
        y: &[f64],
        start: SimTime,
        limit: Option<SimTime>,
    ) -> Result<SimTime, Error> {
        let scheme = settings.scheme(control.stiff, self.is_cut);
        let facts = scheme.facts();
        let tolerance = settings.tolerance * facts.tolerance_share;
        self.scheme = Some(scheme);
        self.has_been_implicit |= facts.is_implicit;
        self.schemes.prepare(scheme, tolerance);
        self.work.provide(y.len(), self.schemes.stages(scheme));
        self.work.keep_reached(self.reached_is_kept);
        if !self.rate_is_known {
            self.work.start(system, y).map_err(Error::RateNotFinite)?;
            self.rate_is_known = true;
        }
        let grid = settings.grid();
        let grid_end = grid.map(|grid| SimTime::new(next_grid_time(start, grid)));
        let first = match grid_end {
            Some(end) => end.since(start),
            // The size learnt at another time may be less than the resolution of time here.
            None if control.size > 0.0 => control.size.max(64.0 * start.resolution()).min(LONGEST),
            None => self.work.first_size(self.schemes.starting_order(scheme), system, y, tolerance),
        };
        self.work.resolution = if system.is_timed() { start.resolution() } else { 0.0 };
        self.work.tick = if system.reads_clock() { start.resolution() } else { 0.0 };
        self.work.find_floor(system, y);
        // A step below the resolution of time would be made for ever.
        if grid.is_some() && first <= 0.5 * start.resolution() {
            return Err(Error::StepTooSmall(self.work.worst(y)));
        }
        (self.output, self.error) = (None, control.error);
        if self.noisy {
            self.work.measure_noise(system, y);
        }
        let mut tries = Tries {
            scheme,
            tolerance,
            outer: settings.tolerance,
            order: self.schemes.error_order(scheme),
            start,
            room: limit.map_or(f64::INFINITY, |limit| limit.since(start)),
            is_fixed: grid.is_some(),
            failed: false,
            rejections: 0,
            interior_rejections: 0,
            powerless: Powerless::default(),
        };
        let h = self.try_steps(&mut tries, control, system, y, first)?;
        self.steps += 1;
        if settings.method == Method::Auto
            && let Some(limited) = self.schemes.is_limited_by_stability(scheme, &self.work, h)
        {
            control.count_stiffness(limited);
        }
        let end = match (grid_end, limit) {
            (Some(end), _) => end,
            (None, Some(limit)) if h == tries.room => limit,
            _ => start.after(h),
        };
        self.step = (start, h, end);
        Ok(end)
    }

    /// Tries steps, the first of length `h`, until one is accepted; returns its length.
    fn try_steps(
        &mut self,
        tries: &mut Tries,
        control: &mut Control,
        system: &mut impl Rates,
        y: &[f64],
        mut h: f64,
    ) -> Result<f64, Error> {
        let start = tries.start;
        loop {
            h = fit(h, tries.room);
            if !tries.is_fixed && h <= 0.5 * start.resolution() {
                return Err(Error::StepTooSmall(self.work.worst(y)));
            }
            let step = Step { y, start, h };
            self.work.trials += system.modules();
            match self.schemes.attempt(tries.scheme, &mut self.work, system, step, tries.tolerance) {
                Trial::Diverged => {
                    self.rejected += 1;
                    h *= RETREAT;
                    tries.failed = true;
                }
                Trial::NotFinite(component) => {
                    // A stage may have left the region where the equations are defined: go nearer.
                    if tries.is_fixed || h <= 1e-12 * start.to_f64().max(1e-3) {
                        return Err(Error::ValueNotFinite(component));
                    }
                    h *= RETREAT;
                    tries.failed = true;
                }
                Trial::Done { error, rounding } => {
                    let error = self.spare(tries.scheme, error);
                    let verdict = if error.max(rounding) > 1.0 {
                        self.judge_large_error(tries, control, system, step, (error, rounding))
                    } else {
                        self.judge_interior(tries, control, system, step, (error, rounding))
                    };
                    match verdict {
                        Verdict::Accepted => return Ok(h),
                        Verdict::Again(shorter) => (h, tries.failed) = (shorter, true),
                    }
                }
            }
        }
    }

    /// The largest error of a component that is not spared, given the largest of all.
    fn spare(&mut self, scheme: Scheme, error: f64) -> f64 {
        self.work.rough.clear();
        let errors = self.schemes.component_errors(scheme);
        if self.spared == 0 || self.spared >= errors.len() {
            return error;
        }
        let mut sorted = errors.to_vec();
        let (_, most, _) = sorted.select_nth_unstable_by(self.spared, |a, b| b.total_cmp(a));
        if *most <= 1.0 {
            let rough = errors.iter().enumerate().filter(|(_, error)| **error > 1.0);
            self.work.rough.extend(rough.map(|(component, _)| component as u32));
        }
        *most
    }

    /// The length of the step just made.
    pub fn made(&self) -> f64 {
        self.step.1
    }

    /// The components, in ascending order, that err by more than is tolerated in the step just made; no more than
    /// [`Stepper::spared`].
    pub fn rough(&self) -> &[u32] {
        &self.work.rough
    }

    /// Judges a step whose estimated error, by truncation or by rounding, is larger than tolerated: it is rejected unless shorter
    /// steps would not help.
    fn judge_large_error(
        &mut self,
        tries: &mut Tries,
        control: &mut Control,
        system: &mut impl Rates,
        step: Step<'_>,
        (error, rounding): (f64, f64),
    ) -> Verdict {
        let (Step { y, start, h }, worst, tolerance) = (step, error.max(rounding), tries.tolerance);
        let absolute = |schemes: &Schemes, work: &Workspace| {
            schemes.absolute_error(tries.scheme, work, step, error, tolerance)
        };
        if !tries.is_fixed
            && (self.work.is_instant(y, h, start.resolution(), tolerance)
                || tries.powerless.is_shown(h, worst)
                    && absolute(&self.schemes, &self.work) <= NEGLIGIBLE * tolerance)
        {
            control.size = h * 10.0;
            control.last_error = 1.0;
            return Verdict::Accepted;
        }
        self.rejected += 1;
        tries.rejections += 1;
        if tries.rejections == MANY_REJECTIONS && !self.noisy && !tries.is_fixed {
            self.noisy = true;
            self.work.measure_noise(system, y);
        }
        Verdict::Again(h * shrinkage(worst, tries.order))
    }

    /// Judges a step whose estimated error is tolerated by its dense output; if that is good enough, too, the next step is planned.
    fn judge_interior(
        &mut self,
        tries: &mut Tries,
        control: &mut Control,
        system: &mut impl Rates,
        step: Step<'_>,
        (error, rounding): (f64, f64),
    ) -> Verdict {
        let (h, is_implicit) = (step.h, tries.scheme.facts().is_implicit);
        let (inside, output) = self.look_inside(tries.scheme, system, step);
        let most = if is_implicit { MANY_PERIODS } else { MANY_REJECTIONS };
        let fit = || (INTERIOR * tries.outer / inside.absolute).powf(1.0 / (f64::from(tries.order) + 1.0));
        if inside.absolute > INTERIOR * tries.outer && tries.interior_rejections < most {
            self.rejected += 1;
            tries.interior_rejections += 1;
            return Verdict::Again(h * fit().clamp(0.3, 0.9));
        }
        // Only of a step that is taken: a rejected one leaves nothing behind.
        self.output = output;
        if !tries.is_fixed {
            // Rounding is no reason to shorten a step that is good, only not to lengthen it.
            let most = if tries.failed || rounding > 0.5 { 1.0 } else { 10.0 };
            let mut next = h * growth(error, control.last_error, tries.order).clamp(0.2, most);
            if is_implicit {
                next = next.min(h * (SAFETY * fit()).max(0.2));
            }
            // A step that had to end early says nothing against longer ones.
            control.size = if 2.0 * h > tries.room { next.max(control.size) } else { next };
            control.last_error = error;
            control.error = (control.error
                + CAUTION * TOLERANCE_SHARE * tries.outer * error
                + if is_implicit { 0.0 } else { inside.relative / END_IS_BETTER })
            .min(CERTAINTY * tries.outer);
            self.error = control.error + inside.relative;
        }
        Verdict::Accepted
    }

    /// The error of the dense output inside a step that has just been tried, where it is not known from the estimate at its end; and
    /// the dense output, if it was made for that.
    fn look_inside(
        &mut self,
        scheme: Scheme,
        system: &mut impl Rates,
        step: Step<'_>,
    ) -> (InteriorError, Option<Dense>) {
        if !scheme.facts().interior_is_measured || self.is_unwatched {
            return (InteriorError::default(), None);
        }
        let dense = self.schemes.dense(scheme, &mut self.work, system, step, None);
        let error = self.schemes.interior_error(scheme, &mut self.work, system, step.y, &dense);
        (error, Some(dense))
    }

    /// The dense output of the step just made from `y`. To be called only where it is needed: a method may have to evaluate rates for
    /// it.
    pub fn dense(&mut self, system: &mut impl Rates, y: &[f64]) -> Dense {
        let (start, h, end) = self.step;
        if let Some(mut dense) = self.output.take() {
            (dense.end, dense.error) = (end, self.error);
            return dense;
        }
        let (scheme, step) = (self.scheme(), Step { y, start, h });
        let mut dense = self.schemes.dense(scheme, &mut self.work, system, step, Some(end));
        dense.error = self.error;
        dense
    }

    /// The dense output of the step just made from `y`, unwatched, for a look inside: by shorter steps where it is wrong there, which
    /// change nothing of what comes after it. One piece or several, end to end.
    pub fn refined(&mut self, system: &mut impl Rates, y: &[f64], settings: &StepSettings) -> Vec<Dense> {
        let whole = self.dense(system, y);
        if !self.scheme().facts().interior_is_measured {
            return vec![whole];
        }
        let inside = self.schemes.interior_error(self.scheme(), &mut self.work, system, y, &whole);
        if inside.absolute <= INTERIOR * settings.tolerance {
            return vec![whole];
        }
        let (mut y, mut from) = (y.to_vec(), whole.start);
        let mut control = Control { size: 0.5 * whole.h, error: self.error, ..Control::default() };
        let mut shorter = Stepper { is_cut: self.is_cut, ..Stepper::default() };
        shorter.restart(settings.method, y.len());
        let mut pieces = Vec::new();
        while whole.end.since(from) > 0.0 {
            let mut shifted = Shifted { system, by: from.since(whole.start) };
            let step = shorter.step(settings, &mut control, &mut shifted, &y, from, Some(whole.end));
            let Ok(end) = step else { return vec![whole] };
            pieces.push(shorter.dense(&mut shifted, &y));
            shorter.advance(&mut y);
            from = end;
        }
        pieces
    }

    /// Gives back the memory that only the making of a step takes, if that is much: some 140 bytes a component. What is left to do with
    /// the step just made is [`Stepper::advance`]; it has no dense output any more.
    pub fn rest(&mut self) {
        if self.size() > MANY {
            self.work.give_back(self.schemes.carried(self.scheme()));
        }
    }

    /// Makes the end of the step just made the start of the next: `y` becomes the state there.
    pub fn advance(&mut self, y: &mut Vec<f64>) {
        self.rate_is_known = self.schemes.accept(self.scheme(), &mut self.work);
        std::mem::swap(y, &mut self.work.end);
        self.work.end.resize(y.len(), 0.0);
    }
}
