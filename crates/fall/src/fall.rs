//! The fall of one body: a pure function of its release, evaluated at any time in any order.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::error::check;
use crate::forces::Dynamics;
use crate::motion::Packed;
use crate::soil::{Hollow, Relief};
use crate::step::{Step, bogacki_shampine};
use crate::underlay::Close;
use crate::{Body, Error, Ground, Motion, Obstacles, Open, Settings, Vector, Wind};

/// What a body is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    Flight,
    Contact,
    Rest,
}

/// All that the next step depends on, beside the rules and the wind.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) time: f64,
    pub(crate) motion: Motion,
    /// Level m of the last step, which had the length H/2^m.
    pub(crate) level: u32,
    pub(crate) phase: Phase,
    /// Number of impacts so far.
    pub(crate) impacts: u32,
    /// For how long the body has hardly moved, in s.
    pub(crate) calm: f64,
    pub(crate) steps: u64,
    /// Derivative in flight, if the step before has computed it.
    pub(crate) rate: Option<Packed>,
    /// The solids that it passes through until it has left them.
    pub(crate) ignored: Arc<[u64]>,
    /// A print of the solids near a body that rests.
    pub(crate) support: u64,
    /// Soil above these heights has come onto the body and does not push it.
    pub(crate) hollow: Arc<Hollow>,
    /// The last step took no time.
    pub(crate) halted: bool,
}

impl State {
    /// The state after an impact, in which some contact may not open.
    pub(crate) fn struck(&self, motion: Motion, stays: bool) -> State {
        let phase = if stays { Phase::Contact } else { Phase::Flight };
        let impacts = self.impacts.saturating_add(1);
        State { motion, phase, impacts, calm: 0.0, rate: None, ..self.clone() }
    }
}

/// What does not change during a fall.
#[derive(Clone, Debug)]
pub(crate) struct Rules {
    pub(crate) body: Body,
    /// Its convex parts, for contact with solids.
    pub(crate) parts: Vec<dlsys_solid::Shape>,
    pub(crate) dynamics: Dynamics,
    pub(crate) ground: Option<Ground>,
    pub(crate) settings: Settings,
    /// The box around the parts, in the axes of the body.
    pub(crate) hull: [Vector; 2],
    /// The soil below the body in the present step; whether the body may come to some that is not level, and how far it may get for that to hold, in m.
    pub(crate) soil: Option<Relief>,
    pub(crate) close: Option<Close>,
    pub(crate) hilly: bool,
    pub(crate) room: f64,
    /// Largest half-extent in m.
    pub(crate) size: f64,
    /// Time scale in s, see [`Dynamics::moment`].
    moment: f64,
}

/// Motions around a step.
pub(crate) struct Part {
    pub(crate) before: Motion,
    /// At its end, before an impact.
    pub(crate) within: Motion,
    /// At its end, after an impact.
    pub(crate) after: Motion,
    /// Whether it is a step in flight.
    pub(crate) flight: bool,
}

/// The print of the surroundings of a body that rests for ever: there are no solids.
pub(crate) const FINAL: u64 = 0;
/// Number of states that are kept for going back: some kilobytes a body, of which a scene may have many.
const KEPT: usize = 16;
/// Most jolts that are noted of a fall.
const MOST_JOLTS: usize = 1024;

/// The motion of a body after its release.
///
/// The result of [`at`](Fall::at) depends on what was given to [`new`](Fall::new) and on the wind only, not on the times asked for
/// before: steps are those of the error. Going on costs the steps in between; going back costs nothing within the last steps
/// ([`keep_steps`](Fall::keep_steps)), and beyond them some steps again, from the nearest of at most 16 states that are kept.
#[derive(Clone, Debug)]
pub struct Fall {
    rules: Rules,
    release: State,
    /// The last step, and the state after it.
    step: Option<Step>,
    state: State,
    /// States in the order of time: every `stride` steps.
    kept: Vec<State>,
    stride: u64,
    /// The last steps up to the latest time, without gaps, and how many there may be.
    recent: VecDeque<Step>,
    most_recent: usize,
    /// The state at rest.
    rest: Option<State>,
    /// Times at which the velocity jumped.
    jolts: Vec<f64>,
}

impl Fall {
    /// A body that is let go at a time in s. One that is below the ground then, in part or as a whole, lands on the level of its lowest contact.
    ///
    /// # Errors
    ///
    /// A value out of range.
    pub fn new(
        body: Body,
        motion: Motion,
        time: f64,
        ground: Option<Ground>,
        settings: Settings,
    ) -> Result<Fall, Error> {
        body.check()?;
        motion.check()?;
        check("a time of release (s)", time, time.abs() <= 1e9, "-1e9 to 1e9")?;
        let settings = settings.checked()?;
        let mut ground = ground;
        if let Some(ground) = &mut ground {
            ground.check()?;
            ground.height += ground.lowest(&motion, &body).min(0.0);
        }
        let dynamics = Dynamics::new(&body, settings.air, ground);
        let balls: Vec<_> = body.contacts.iter().map(|contact| (contact.point, contact.radius)).collect();
        let parts = if balls.is_empty() { Vec::new() } else { dlsys_solid::parts(&balls)? };
        let (size, moment) = (body.size(), dynamics.moment());
        let hull = [f64::min, f64::max].map(|most: fn(f64, f64) -> f64| {
            let sign = most(-1.0, 1.0);
            let ends =
                parts.iter().flat_map(|part| part.core().iter().map(move |point| (point, part.radius())));
            let ends = ends.map(|(point, radius)| point.add_scalar(sign * radius));
            ends.reduce(|a, b| a.zip_map(&b, most)).unwrap_or_default()
        });
        let (soil, close, hilly, room) = (None, None, false, f64::INFINITY);
        let rules =
            Rules { size, moment, body, parts, dynamics, ground, settings, hull, soil, close, hilly, room };
        let state = State {
            time,
            motion,
            level: 0,
            phase: Phase::Flight,
            impacts: 0,
            calm: 0.0,
            steps: 0,
            rate: None,
            ignored: Arc::from([]),
            support: 0,
            hollow: Arc::default(),
            halted: false,
        };
        Ok(Fall {
            rules,
            release: state.clone(),
            step: None,
            state,
            kept: Vec::new(),
            stride: 8,
            recent: VecDeque::new(),
            most_recent: 0,
            rest: None,
            jolts: Vec::new(),
        })
    }

    /// The body.
    pub fn body(&self) -> &Body {
        &self.rules.body
    }

    /// Time of the release, in s.
    pub fn begin(&self) -> f64 {
        self.release.time
    }

    /// The time from which on the body rests, in s; `None` if that is later than all times asked for.
    pub fn rest(&self) -> Option<f64> {
        self.rest.as_ref().map(|state| state.time)
    }

    /// The times in s, up to the latest one asked for, at which the velocity jumped by more than the speed below which a body does not
    /// rebound: impacts, and corners that come to the ground while others touch it. At most 1,024.
    pub fn jolts(&self) -> &[f64] {
        &self.jolts
    }

    /// Number of steps up to the latest time asked for.
    pub fn steps(&self) -> u64 {
        self.state.steps.max(self.kept.last().map_or(0, |state| state.steps))
    }

    /// Number of impacts before the last time asked for.
    pub fn impacts(&self) -> u32 {
        self.state.impacts
    }

    /// Kinetic and potential energy of a motion in J, with the kinetic energy of the air that moves with the body in still air.
    pub fn energy(&self, motion: &Motion) -> [f64; 2] {
        let dynamics = &self.rules.dynamics;
        [dynamics.kinetic_energy(motion), dynamics.potential_energy(motion)]
    }

    /// Keeps so many of the last steps (0 at first), of some 400 bytes each. Results do not depend on it.
    pub fn keep_steps(&mut self, most: usize) {
        self.most_recent = most;
        let surplus = self.recent.len().saturating_sub(most);
        self.recent.drain(..surplus);
    }

    /// The motion at a time in s. Before the release it is that at the release.
    ///
    /// # Errors
    ///
    /// A time or a wind that is not finite, an error that no step makes small enough, too many steps.
    pub fn at(&mut self, time: f64, wind: &impl Wind) -> Result<Motion, Error> {
        self.among(time, wind, &Open)
    }

    /// The same among solids. What overlaps one at the release, or where it appears, passes through it until it has left it, and so does what is
    /// squeezed.
    ///
    /// # Errors
    ///
    /// As of [`at`](Fall::at), and solids that are not known at a time.
    pub fn among(
        &mut self,
        time: f64,
        wind: &impl Wind,
        obstacles: &impl Obstacles,
    ) -> Result<Motion, Error> {
        check("a time (s)", time, true, "a finite number")?;
        if time <= self.release.time {
            return Ok(self.release.motion);
        }
        if let Some(rest) = self.rest.as_ref().filter(|rest| rest.time <= time) {
            return Ok(rest.motion);
        }
        if self.step.is_some_and(|step| time < step.start) {
            let passed = self.recent.partition_point(|step| step.end <= time);
            if let Some(step) = self.recent.get(passed).filter(|step| step.start <= time) {
                return Ok(step.at(time));
            }
            let after = self.kept.partition_point(|state| state.time <= time);
            self.state = after.checked_sub(1).map_or(&self.release, |index| &self.kept[index]).clone();
            self.step = None;
        }
        loop {
            if let Some(step) = &self.step
                && time < step.end
            {
                return Ok(step.at(time));
            }
            // Among solids, what rests may be moved again.
            if self.state.phase == Phase::Rest && self.state.support == FINAL {
                self.rest = Some(self.state.clone());
                return Ok(self.state.motion);
            }
            let before = self.state.motion;
            let (step, next) = self.rules.advance(&mut self.state, wind, obstacles)?;
            self.note(step.start, &before, &step.first);
            self.note(step.end, &step.last, &next.motion);
            let (steps, reached) = (next.steps, next.time);
            (self.step, self.state) = (Some(step), next);
            self.keep(&step);
            if steps > self.rules.settings.steps {
                let from = self.release.time;
                return Err(Error::Steps { from, steps, time: reached });
            }
        }
    }

    /// Makes the next step, up to a time in s; for studies. `None` at rest and after that time.
    pub(crate) fn part(
        &mut self,
        until: f64,
        wind: &impl Wind,
        obstacles: &impl Obstacles,
    ) -> Result<Option<Part>, Error> {
        let mut before = self.state.clone();
        if before.phase == Phase::Rest || before.time >= until {
            return Ok(None);
        }
        let (step, next) = self.rules.advance(&mut before, wind, obstacles)?;
        let flight = before.phase == Phase::Flight;
        let part = Part { before: before.motion, within: step.last, after: next.motion, flight };
        (self.step, self.state) = (Some(step), next);
        Ok(Some(part))
    }

    /// The time up to which it has been followed, in s; for studies.
    pub(crate) fn reached(&self) -> f64 {
        self.state.time
    }

    /// Notes a jolt, if the velocity before and after a time differs by one.
    fn note(&mut self, time: f64, before: &Motion, after: &Motion) {
        let known = self.jolts.last().is_some_and(|last| *last >= time);
        if known || self.jolts.len() >= MOST_JOLTS {
            return;
        }
        let jump =
            (after.velocity - before.velocity).norm() + (after.spin - before.spin).norm() * self.rules.size;
        if jump > self.rules.slow() {
            self.jolts.push(time);
        }
    }

    /// Keeps a step and the state after it for going back, if they are new; of states those whose turn has come. Twice as many steps lie between those
    /// kept when there are too many.
    fn keep(&mut self, step: &Step) {
        if self.most_recent > 0 && self.recent.back().is_none_or(|last| last.end <= step.start) {
            if self.recent.len() >= self.most_recent {
                self.recent.pop_front();
            }
            self.recent.push_back(*step);
        }
        let due = self.state.steps.is_multiple_of(self.stride);
        if !due || self.kept.last().is_some_and(|last| last.steps >= self.state.steps) {
            return;
        }
        self.kept.push(self.state.clone());
        if self.kept.len() >= KEPT {
            self.stride *= 2;
            let stride = self.stride;
            self.kept.retain(|state| state.steps.is_multiple_of(stride));
        }
    }
}

impl Rules {
    /// The error of a position that is allowed, in m.
    pub(crate) fn resolution(&self) -> f64 {
        self.settings.tolerance * self.size
    }

    /// How far a contact may sink into the ground before the impact is located, in m.
    pub(crate) fn depth(&self) -> f64 {
        0.01 * self.resolution()
    }

    /// The end of a step of a level that begins at a time: the next point of the grid of this level.
    pub(crate) fn grid(&self, time: f64, level: u32) -> f64 {
        let h = self.settings.longest / libm::exp2(f64::from(level));
        let mut end = (libm::floor(time / h) + 1.0) * h;
        if end - time < 1e-9 * h {
            end += h;
        }
        // At large times, the grid may be finer than the resolution of numbers.
        if end > time { end } else { time.next_up() }
    }

    /// The next step, and the state after it.
    fn advance(
        &mut self,
        state: &mut State,
        wind: &impl Wind,
        obstacles: &impl Obstacles,
    ) -> Result<(Step, State), Error> {
        let span = obstacles.span(state.time)?;
        self.underlay(state, span.as_deref())?;
        let (step, mut next) = match (span, state.phase, &self.ground) {
            (Some(span), ..) => self.pass(&span, state, wind)?,
            (None, Phase::Contact, Some(ground)) => self.slide(ground, (state, f64::INFINITY), wind)?,
            (None, ..) => self.fly(state, wind)?,
        };
        next.steps = state.steps + 1;
        Ok((step, next))
    }

    /// A step in flight, up to the next impact at most.
    fn fly(&self, state: &State, wind: &impl Wind) -> Result<(Step, State), Error> {
        let (step, next) = self.free_step((state, f64::INFINITY), wind)?;
        let contact = self
            .ground
            .and_then(|ground| Some((ground, ground.first_contact(&step, &self.body, self.depth())?)));
        let Some((ground, time)) = contact else { return Ok((step, next)) };
        let step = step.until(time);
        let struck = State { time, motion: step.last, level: next.level, ..state.clone() };
        Ok((step, self.strike(&ground, &struck)))
    }

    /// A step in flight, not beyond a time, as if there were nothing to touch.
    pub(crate) fn free_step(
        &self,
        (state, limit): (&State, f64),
        wind: &impl Wind,
    ) -> Result<(Step, State), Error> {
        let mut level = state.level;
        loop {
            let end = self.grid(state.time, level).min(limit);
            let h = end - state.time;
            let (last, rate, error) =
                bogacki_shampine(&self.dynamics, (&state.motion, state.rate), (state.time, end), wind)?;
            let excess = self.excess(&error, state.motion.spin.norm().max(last.spin.norm()) * h);
            if !self.settings.fixed && excess > 1.0 {
                if level >= self.settings.deepest {
                    return Err(Error::Step { time: state.time, step: h, excess });
                }
                level += 1;
                continue;
            }
            // A step of twice the length has eight times the error. It must begin on its own grid.
            if !self.settings.fixed && excess < 1.0 / 16.0 && level > 0 {
                level -= 1;
            }
            let step = Step::new(state.time, state.motion, end, last);
            let next = State { time: end, motion: last, level, calm: 0.0, rate: Some(rate), ..state.clone() };
            return Ok((step, next));
        }
    }

    /// The error of a step in units of the tolerance.
    fn excess(&self, error: &Packed, turned: f64) -> f64 {
        // A step never turns the body by more than a radian: dense output and the bounds of contacts count on it.
        if turned > 1.0 {
            return f64::INFINITY;
        }
        let part = |at: usize| error.fixed_rows::<3>(at).norm();
        let attitude = 2.0 * error.fixed_rows::<4>(6).norm();
        let moved = part(0).max(part(3) * self.moment) / self.size;
        let rotated = attitude.max(part(10) * self.moment);
        // A maximum would pass over what is no number.
        let sum = moved + rotated;
        if sum.is_finite() { moved.max(rotated) / self.settings.tolerance } else { f64::INFINITY }
    }
}
