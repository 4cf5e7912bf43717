//! Steps of controlled error.

use crate::flow::coupled::algebra::Fault;
use crate::flow::coupled::equations::Equations;
use crate::world::state::Control;
use crate::{Method, Settings, Stats};
use dlsys_ode::Dense;
use dlsys_ode::Implicit;
use dlsys_ode::{Inside, Nodes, Rates, Trial, Workspace};
use dlsys_tree::SimTime;

/// Makes the steps of one system of equations after another.
#[derive(Clone, Default)]
pub struct Integrator {
    workspace: Workspace,
    implicit: Option<Box<Implicit>>,
    /// The rates at the start of the next step are known.
    rate_is_known: bool,
    method: Method,
    /// Steps cost much besides the rates.
    pub dear: bool,
    /// Nothing is looked for inside steps; frames that fall into them are refined ([`Integrator::refined`]).
    pub unwatched: bool,
    /// Start, length and end of the step just made.
    step: (SimTime, f64, SimTime),
    /// What it may be wrong by, relative.
    error: f64,
    /// Its dense output, where that is known already.
    output: Option<Dense>,
    /// Steps are so short that rounding of the state is looked at.
    noisy: bool,
}

/// Why there is no step. The component that is to blame, if it is known.
#[derive(Clone, Copy, Debug)]
pub enum StepError {
    TooSmall(usize),
    /// A rate at the start of a step.
    Rate(usize),
    NotFinite(usize),
}

/// The tolerance of a single step, as a part of the tolerance asked for: errors of steps add up, and move
/// the times of events, which move what comes after them.
pub const INNER_TOLERANCE: f64 = 0.1;

/// Errors of steps that are estimated may be so many times larger.
const CAUTION: f64 = 4.0;
/// However many steps there have been, values are taken to be right to so many tolerances.
pub const CERTAINTY: f64 = 2.0;

/// Inside a step the dense output may be wrong by so many tolerances: it is where the step is much longer than stability allows
/// and the estimate, made of two, is misled by what moves slowly.
const INSIDE: f64 = 4.0;

/// The end of a step is known so many times better than its inside, if that is worse than its end was estimated.
const OUTSIDE: f64 = 4.0;

/// After so many rejections of one step, rounding may be why.
const MANY_REJECTIONS: u32 = 6;

/// An error of no more than this part of the tolerated one, for values of the size of 1, is none where step control does not help.
const NOTHING: f64 = 1e-2;

/// A step is long enough that takes so many stretches.
const MANY_STRETCHES: f64 = 4.0;
/// How much shorter a step is tried when what is solved for along with it cannot be followed.
const SHORTER: f64 = 0.1;

/// The same for the implicit method: between the ends of its long steps the solution is known less well than there.
const INNER_TOLERANCE_IMPLICIT: f64 = 0.01;

/// Looser than this, many small steps of low order are cheaper than few of high order.
const HIGH_ORDER_BELOW: f64 = 1e-7;
/// The same where each step costs much besides the rates.
const HIGH_ORDER_BELOW_IF_STEPS_ARE_DEAR: f64 = 1e-5;

/// A step with less than this part of the tolerated error is longer than accuracy asks for.
const EASY: f64 = 1e-3;
/// How far ahead, in units of the time to the last event, such steps look.
const FORESIGHT: f64 = 8.0;

impl Integrator {
    /// Prepares for another system of `n` equations, or for a start elsewhere.
    pub fn restart(&mut self, method: Method, n: usize) {
        self.rate_is_known = false;
        self.noisy = false;
        self.workspace.noise.clear();
        self.workspace.resize(n);
        self.method = method;
        if let Some(implicit) = &mut self.implicit {
            implicit.forget();
        }
    }

    /// Where in the step just made rates were evaluated that count.
    pub fn nodes(&self) -> Nodes {
        match &self.implicit {
            Some(implicit) if self.method == Method::Radau => Nodes::from_slice(implicit.nodes()),
            _ => self.method.nodes(),
        }
    }

    /// True if the implicit method was taken.
    pub fn is_implicit(&self) -> bool {
        self.implicit.is_some()
    }

    /// Evaluations of one module's equations so far.
    pub fn evaluations(&self) -> u64 {
        self.workspace.evaluations
    }

    /// Number of components.
    pub fn size(&self) -> usize {
        self.workspace.end.len()
    }

    /// The method for a step.
    fn choose(&self, settings: &Settings, control: &Control) -> Method {
        match settings.method {
            Method::Auto if control.stiff => Method::Radau,
            Method::Auto if settings.tolerance < HIGH_ORDER_BELOW => Method::Dop853,
            Method::Auto if self.dear && settings.tolerance < HIGH_ORDER_BELOW_IF_STEPS_ARE_DEAR => {
                Method::Dop853
            }
            Method::Auto => Method::Dopri5,
            method => method,
        }
    }

    /// Makes a step from `y` at `start`, no further than `limit`; tells its end.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        settings: &Settings,
        control: &mut Control,
        system: &mut impl Rates,
        y: &[f64],
        start: SimTime,
        limit: Option<SimTime>,
        stats: &mut Stats,
    ) -> Result<SimTime, StepError> {
        self.method = self.choose(settings, control);
        let method = self.method;
        let inner = if method == Method::Radau { INNER_TOLERANCE_IMPLICIT } else { INNER_TOLERANCE };
        let tolerance = settings.tolerance * inner;
        if method == Method::Radau && self.implicit.as_ref().is_none_or(|i| !i.fits(tolerance)) {
            self.implicit = Some(Box::new(Implicit::new(tolerance)));
        }
        let order = match &self.implicit {
            Some(implicit) if method == Method::Radau => implicit.error_order(),
            _ => method.error_order(),
        };
        if !self.rate_is_known {
            self.workspace.start(system, y).map_err(StepError::Rate)?;
            self.rate_is_known = true;
        }
        let grid = settings.grid();
        let mut h = match grid {
            Some(grid) => SimTime::new(next_grid_time(start, grid)).since(start),
            // What was learnt at another time may be less than time can tell here.
            None if control.size > 0.0 => control.size.max(64.0 * start.resolution()),
            None => self.workspace.first_size(method, system, y, tolerance),
        };
        self.workspace.resolution = if system.is_timed() { start.resolution() } else { 0.0 };
        // A step that time cannot tell would be made for ever.
        if grid.is_some() && h <= 0.5 * start.resolution() {
            return Err(StepError::TooSmall(self.workspace.worst(y)));
        }
        let room = limit.map_or(f64::INFINITY, |limit| limit.since(start));
        let mut rejected = false;
        let mut powerless = Powerless::default();
        (self.output, self.error) = (None, control.error);
        let (mut rejections, mut wiggles) = (0, 0);
        if self.noisy {
            self.workspace.measure_noise(system, y);
        }
        loop {
            // Two steps of the same length rather than a long one and a short one.
            h = if h >= room {
                room
            } else if 2.0 * h > room {
                0.5 * room
            } else {
                h
            };
            if grid.is_none() && h <= 0.5 * start.resolution() {
                return Err(StepError::TooSmall(self.workspace.worst(y)));
            }
            let trial = match &mut self.implicit {
                Some(implicit) if method == Method::Radau => {
                    implicit.attempt(&mut self.workspace, system, y, h, tolerance)
                }
                _ => self.workspace.attempt(method, system, y, h, tolerance),
            };
            match trial {
                Trial::Diverged => {
                    stats.rejected += 1;
                    h *= 0.25;
                    rejected = true;
                }
                Trial::NotFinite(component) => {
                    // A stage may have left the region where the equations are defined: go nearer.
                    if grid.is_some() || h <= 1e-12 * start.to_f64().max(1e-3) {
                        return Err(StepError::NotFinite(component));
                    }
                    h *= 0.25;
                    rejected = true;
                }
                Trial::Done { error, rounding }
                    if error.max(rounding) > 1.0
                        && grid.is_none()
                        && (self.workspace.is_instant(y, h, start.resolution(), tolerance)
                            || powerless.is_shown(h, error.max(rounding))
                                && self.workspace.absolute_error(method, y, h, error, tolerance)
                                    <= NOTHING * tolerance) =>
                {
                    control.size = h * 10.0;
                    control.last_error = 1.0;
                    break;
                }
                Trial::Done { error, rounding } if error.max(rounding) > 1.0 => {
                    stats.rejected += 1;
                    // Safety and limits as in DOPRI5 (Hairer, Nørsett and Wanner 1993, II.4).
                    rejections += 1;
                    if rejections == MANY_REJECTIONS && !self.noisy && grid.is_none() {
                        self.noisy = true;
                        self.workspace.measure_noise(system, y);
                    }
                    h *= (0.9 * error.max(rounding).powf(-1.0 / f64::from(order + 1))).clamp(0.1, 0.9);
                    rejected = true;
                }
                Trial::Done { error, rounding } => {
                    let (inside, output) = self.look_inside(method, system, y, start, h);
                    if inside.absolute > INSIDE * settings.tolerance && wiggles < MANY_REJECTIONS {
                        stats.rejected += 1;
                        wiggles += 1;
                        h *= (INSIDE * settings.tolerance / inside.absolute).powf(0.125).clamp(0.3, 0.9);
                        rejected = true;
                        continue;
                    }
                    // Only of a step that is taken: a rejected one leaves nothing behind.
                    self.output = output;
                    if grid.is_none() {
                        // Rounding is no reason to shorten a step that is good, only not to lengthen it.
                        let most = if rejected || rounding > 0.5 { 1.0 } else { 10.0 };
                        let next = h * growth(error, control.last_error, order).clamp(0.2, most);
                        // A step that had to end early says nothing against longer ones.
                        control.size = if 2.0 * h > room { next.max(control.size) } else { next };
                        control.last_error = error;
                        let most = CERTAINTY * settings.tolerance;
                        control.error = (control.error
                            + CAUTION * INNER_TOLERANCE * settings.tolerance * error
                            + inside.relative / OUTSIDE)
                            .min(most);
                        self.error = control.error + inside.relative;
                    }
                    break;
                }
            }
        }
        stats.steps += 1;
        if settings.method == Method::Auto && method != Method::Radau {
            suspect(control, self.workspace.stiffness(method, h), method);
        }
        let end = match (grid, limit) {
            (Some(grid), _) => SimTime::new(next_grid_time(start, grid)),
            (None, Some(limit)) if h == room => limit,
            _ => start.after(h),
        };
        self.step = (start, h, end);
        Ok(end)
    }

    /// What the dense output of a step that has just been tried is wrong by inside, where that is not known from the
    /// estimate of its end; and the dense output, if it was made for that.
    fn look_inside(
        &mut self,
        method: Method,
        system: &mut impl Rates,
        y: &[f64],
        start: SimTime,
        h: f64,
    ) -> (Inside, Option<Dense>) {
        if method != Method::Dop853 || self.unwatched {
            return (Inside::default(), None);
        }
        self.workspace.finish(method, system, y, h);
        let dense = self.workspace.dense(method, start, None, y, h);
        let error = self.workspace.measure_interpolation(system, y, &dense);
        (error, Some(dense))
    }

    /// The dense output of the step just made from `y`. Nobody need ask for it: a method may have to evaluate rates for
    /// it.
    pub fn dense(&mut self, system: &mut impl Rates, y: &[f64]) -> Dense {
        let (start, h, end) = self.step;
        if let Some(mut dense) = self.output.take() {
            (dense.end, dense.error) = (end, self.error);
            return dense;
        }
        let mut dense = match self.implicit.as_mut().filter(|_| self.method == Method::Radau) {
            Some(implicit) => implicit.dense(start, y, h),
            None => {
                self.workspace.finish(self.method, system, y, h);
                self.workspace.dense(self.method, start, Some(end), y, h)
            }
        };
        dense.error = self.error;
        dense
    }

    /// The dense output of the step just made from `y`, in which nothing was looked for, for a frame inside: by shorter steps
    /// where it is wrong there, which change nothing of what comes after it.
    pub fn refined(&mut self, system: &mut impl Rates, y: &[f64], settings: &Settings) -> Vec<Dense> {
        let whole = self.dense(system, y);
        if self.method != Method::Dop853 {
            return vec![whole];
        }
        let inside = self.workspace.measure_interpolation(system, y, &whole);
        if inside.absolute <= INSIDE * settings.tolerance {
            return vec![whole];
        }
        let (mut y, mut from) = (y.to_vec(), whole.start);
        let mut control = Control { size: 0.5 * whole.h, error: self.error, ..Control::default() };
        let mut shorter = Integrator { dear: self.dear, ..Integrator::default() };
        shorter.restart(settings.method, y.len());
        let (mut stretches, mut stats) = (Vec::new(), Stats::default());
        while whole.end.since(from) > 0.0 {
            let mut shifted = Shifted { system, by: from.since(whole.start) };
            let step =
                shorter.step(settings, &mut control, &mut shifted, &y, from, Some(whole.end), &mut stats);
            let Ok(end) = step else { return vec![whole] };
            stretches.push(shorter.dense(&mut shifted, &y));
            shorter.advance(&mut y);
            from = end;
        }
        stretches
    }

    /// The dense output of the step just made from `y`, with what is solved for along with it. Where that cannot be
    /// followed, the next step to be tried is shorter.
    pub fn blended(
        &mut self,
        equations: &mut Equations,
        y: &[f64],
        settings: &Settings,
        control: &mut Control,
    ) -> Result<Vec<Dense>, Fault> {
        let dense = self.dense(equations, y);
        let h = dense.h;
        let blended = equations.blend(&dense, y, INNER_TOLERANCE * settings.tolerance);
        match &blended {
            Ok(stretches) => {
                // What it looks like may matter more than the rates.
                control.size = control.size.min(h * (MANY_STRETCHES / stretches.len() as f64).max(SHORTER));
                let last = stretches.last().expect("one at least");
                for (c, end) in self.workspace.end.iter_mut().enumerate() {
                    *end = last.value(c, 1.0);
                }
            }
            Err(_) => control.size = SHORTER * h,
        }
        blended
    }

    /// Makes the end of the step just made the start of the next.
    pub fn advance(&mut self, y: &mut Vec<f64>) {
        if let Some(implicit) = self.implicit.as_mut().filter(|_| self.method == Method::Radau) {
            implicit.accept();
        }
        self.rate_is_known = self.workspace.advance(self.method);
        std::mem::swap(y, &mut self.workspace.end);
        self.workspace.end.resize(y.len(), 0.0);
    }
}

/// Equations whose time begins later.
struct Shifted<'s, R> {
    system: &'s mut R,
    by: f64,
}

impl<R: Rates> Rates for Shifted<'_, R> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.system.rates(self.by + tau, y, out);
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.system.couplings()
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        self.system.partials(self.by + tau, y, out);
    }

    fn modules(&self) -> u64 {
        self.system.modules()
    }

    fn is_timed(&self) -> bool {
        self.system.is_timed()
    }
}

/// The step times the rate of decay up to which an explicit method damps.
fn stability(method: Method) -> f64 {
    if method == Method::Dop853 { 1.9 } else { 2.8 }
}

/// Step control that does not help: errors that stay what they are, for their scale, however much shorter steps become. They
/// are rounding of what the rates are computed from, or belong to a solution that looks the same on all scales.
#[derive(Default)]
struct Powerless {
    /// Length and error of a step that was rejected.
    last: Option<(f64, f64)>,
    times: u32,
}

impl Powerless {
    /// Takes in a step that is about to be rejected.
    fn is_shown(&mut self, h: f64, error: f64) -> bool {
        let Some((before, known)) = self.last else {
            self.last = Some((h, error));
            return false;
        };
        if h <= 0.3 * before {
            self.times = if error > 0.5 * known { self.times + 1 } else { 0 };
            self.last = Some((h, error));
        }
        self.times >= 3
    }
}

/// Watches for steps that are short for stability's sake only (Hairer and Wanner 1996, IV.2). The bounds lie below the
/// ends of the stability regions, where step control was seen to stay; at the tolerances that DOP853 is used for,
/// accuracy alone keeps steps well under its bound.
fn suspect(control: &mut Control, stiffness: f64, method: Method) {
    if stiffness > stability(method) {
        control.suspicion += 1;
        control.stiff |= control.suspicion >= 15;
    } else {
        control.suspicion = control.suspicion.saturating_sub(2);
    }
}

/// After an event at some time into a step: one that could be as long as one likes says nothing about the next, but
/// life does.
pub fn foresee(control: &mut Control, last_error: f64, lived: f64, resolution: f64) {
    // An event at the very start of a step says nothing.
    if last_error <= EASY && lived > 64.0 * resolution {
        control.size = control.size.min((FORESIGHT * lived).max(resolution));
    }
}

/// PI step control (Gustafsson 1991) with the constants of DOPRI5: beta = 0.04.
fn growth(error: f64, last: f64, order: u32) -> f64 {
    let exponent = 1.0 / f64::from(order + 1) - 0.03;
    0.9 * error.max(1e-10).powf(-exponent) * last.max(1e-4).powf(0.04)
}

/// The first multiple of the step size after an instant.
pub fn next_grid_time(now: SimTime, grid: f64) -> f64 {
    let t = now.to_f64();
    let mut n = (t / grid).floor() + 1.0;
    if n * grid - t <= now.resolution() {
        n += 1.0;
    }
    n * grid
}
